//! All figures of the paper, for programs that treat them as a whole.
//!
//! Each `figN/main.rs` is both a binary of its own and a module here, so that a figure's numbers stand in one place.

use twofold::paper::Figure;

#[path = "convergence/main.rs"]
mod convergence;
#[path = "digits/main.rs"]
mod digits;
#[path = "fig1/main.rs"]
mod fig1;
#[path = "fig2/main.rs"]
mod fig2;
#[path = "fig3/main.rs"]
mod fig3;
#[path = "fig4/main.rs"]
mod fig4;
#[path = "fig5/main.rs"]
mod fig5;
#[path = "fig6/main.rs"]
mod fig6;
#[path = "fig7/main.rs"]
mod fig7;
#[path = "fig8/main.rs"]
mod fig8;
#[path = "fig9/main.rs"]
mod fig9;
#[path = "lottery/main.rs"]
mod lottery;
#[path = "workprecision/main.rs"]
mod workprecision;

/// Every figure, in the paper's order, then our own.
pub fn all() -> Vec<Figure> {
    vec![
        fig1::figure(),
        fig2::figure(),
        fig3::figure(),
        fig4::figure(),
        fig5::figure(),
        fig6::figure(),
        fig7::figure(),
        fig8::figure(),
        fig9::figure(),
        lottery::figure(),
        workprecision::figure(),
        digits::figure(),
        convergence::figure(),
    ]
}
