//! Every figure, in the paper's order, then our own, with the committed references.
//!
//! Each figure stands in `figures/NAME/figure.rs`: every number of the paper's caption, and nothing else; beside it the hashes that it must
//! have. Both are part of the library, so that an installed program can make and check them anywhere.

use super::Figure;

/// Names a figure's module and embeds its reference.
macro_rules! figures {
    ($($name:ident: $path:literal, $reference:literal;)*) => {
        $(
            #[path = $path]
            #[allow(missing_docs)]
            pub mod $name;
        )*

        /// Every figure.
        pub fn all() -> Vec<Figure> {
            vec![$($name::figure()),*]
        }

        /// The committed manifest of a figure, as text.
        pub fn reference(id: &str) -> Option<&'static str> {
            match id {
                $(stringify!($name) => Some(include_str!($reference)),)*
                _ => None,
            }
        }
    };
}

figures! {
    fig1: "../../../figures/fig1/figure.rs", "../../../figures/fig1/expected.json";
    fig2: "../../../figures/fig2/figure.rs", "../../../figures/fig2/expected.json";
    fig3: "../../../figures/fig3/figure.rs", "../../../figures/fig3/expected.json";
    fig4: "../../../figures/fig4/figure.rs", "../../../figures/fig4/expected.json";
    fig5: "../../../figures/fig5/figure.rs", "../../../figures/fig5/expected.json";
    fig6: "../../../figures/fig6/figure.rs", "../../../figures/fig6/expected.json";
    fig7: "../../../figures/fig7/figure.rs", "../../../figures/fig7/expected.json";
    fig8: "../../../figures/fig8/figure.rs", "../../../figures/fig8/expected.json";
    fig9: "../../../figures/fig9/figure.rs", "../../../figures/fig9/expected.json";
    lottery: "../../../figures/lottery/figure.rs", "../../../figures/lottery/expected.json";
    workprecision: "../../../figures/workprecision/figure.rs", "../../../figures/workprecision/expected.json";
    digits: "../../../figures/digits/figure.rs", "../../../figures/digits/expected.json";
    convergence: "../../../figures/convergence/figure.rs", "../../../figures/convergence/expected.json";
    law: "../../../figures/law/figure.rs", "../../../figures/law/expected.json";
    census: "../../../figures/census/figure.rs", "../../../figures/census/expected.json";
    audit: "../../../figures/audit/figure.rs", "../../../figures/audit/expected.json";
    basin: "../../../figures/basin/figure.rs", "../../../figures/basin/expected.json";
}

/// The sweeps whose rows are committed beside a figure: name and content of each Parquet file. Empty for figures that compute all they show.
pub fn data(id: &str) -> &'static [(&'static str, &'static [u8])] {
    match id {
        "census" => census::DATA,
        "audit" => audit::DATA,
        "basin" => basin::DATA,
        _ => &[],
    }
}

/// The checkpoints of a figure's long runs ([`Checkpoints`](super::checkpoints::Checkpoints)), as text, for `twofold audit`. None for figures without such runs.
pub fn checkpoints(id: &str) -> Option<&'static str> {
    match id {
        "fig7" => Some(include_str!("../../../figures/fig7/checkpoints.json")),
        "fig8" => Some(include_str!("../../../figures/fig8/checkpoints.json")),
        "fig9" => Some(include_str!("../../../figures/fig9/checkpoints.json")),
        "lottery" => Some(include_str!("../../../figures/lottery/checkpoints.json")),
        _ => None,
    }
}
