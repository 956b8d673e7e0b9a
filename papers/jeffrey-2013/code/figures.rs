//! Sketches of the paper's model and our own studies. The figures
//! that the paper computed stand in `papers/jeffrey-2013`.
//!
//! Each figure stands in `NAME/figure.rs`: every number of it, and nothing else. It is part of the
//! library, so that an installed program can make it anywhere.

use crate::Reading;
use twofold::paper::{Count, Figure};

/// Names the figures' modules.
macro_rules! figures {
    ($($name:ident: $path:literal;)*) => {
        $(
            #[path = $path]
            #[allow(missing_docs)]
            pub mod $name;
        )*

        /// Every figure.
        pub fn all() -> Vec<Figure> {
            vec![$($name::figure()),*]
        }
    };
}

figures! {
    fig1: "fig1/figure.rs";
    fig3: "fig3/figure.rs";
    fig4: "fig4/figure.rs";
    lottery: "lottery/figure.rs";
    workprecision: "workprecision/figure.rs";
    digits: "digits/figure.rs";
    convergence: "convergence/figure.rs";
    law: "law/figure.rs";
    delay: "delay/figure.rs";
    census: "census/figure.rs";
    audit: "audit/figure.rs";
    basin: "basin/figure.rs";
}

/// The sweeps whose rows are committed beside a figure: name and content of each CSV file. Empty
/// for figures that compute all they show.
pub fn data(id: &str) -> &'static [(&'static str, &'static [u8])] {
    match id {
        "census" => census::DATA,
        "audit" => audit::DATA,
        "basin" => basin::DATA,
        _ => &[],
    }
}

/// Counts the committed runs of a study that repeat a panel in a reading.
pub fn counts(study: &str, reading: &str) -> Option<Count> {
    use Reading::{Printed, Reconstructed};
    match (study, Reading::named(reading)?) {
        ("census", Printed) => Some(|panel| census::support(panel, Printed)),
        ("census", Reconstructed) => Some(|panel| census::support(panel, Reconstructed)),
        ("audit", Printed) => Some(|panel| audit::support(panel, Printed)),
        ("audit", Reconstructed) => Some(|panel| audit::support(panel, Reconstructed)),
        _ => None,
    }
}
