//! Sketches of the paper's model and our own studies, with the committed references. The figures
//! that the paper computed stand in `papers/jeffrey-2013`.
//!
//! Each figure stands in `figures/NAME/figure.rs`: every number of it, and nothing else; beside it
//! the hashes that it must have. Both are part of the library, so that an installed program can
//! make and check them anywhere.

use crate::Reading;
use twofold::paper::{Count, Figure};

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
    fig1: "fig1/figure.rs", "fig1/expected.json";
    fig3: "fig3/figure.rs", "fig3/expected.json";
    fig4: "fig4/figure.rs", "fig4/expected.json";
    lottery: "lottery/figure.rs", "lottery/expected.json";
    workprecision: "workprecision/figure.rs", "workprecision/expected.json";
    digits: "digits/figure.rs", "digits/expected.json";
    convergence: "convergence/figure.rs", "convergence/expected.json";
    law: "law/figure.rs", "law/expected.json";
    delay: "delay/figure.rs", "delay/expected.json";
    census: "census/figure.rs", "census/expected.json";
    audit: "audit/figure.rs", "audit/expected.json";
    basin: "basin/figure.rs", "basin/expected.json";
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
