//! The paper that has code of its own beside its folder: the only module that names one.

use super::{Count, Figure, ParameterReading};
use crate::verify::Theorem;
use twofold_jeffrey_2013::{Reading, all, counts};

pub use twofold_jeffrey_2013::data;
pub use twofold_jeffrey_2013::study::verdict_table;

/// Folder of the paper in the sources.
pub const FOLDER: &str = "papers/jeffrey-2013";

/// The paper's folder, so that an installed program can make and check its figures anywhere: the
/// path of each file there, and its text.
pub const FILES: &[(&str, &str)] = twofold_papers::JEFFREY_2013;

/// The readings of a built-in system's parameters. If none is named, commands take the first.
pub fn readings(system: &str) -> Vec<ParameterReading> {
    match system {
        "caricature" | "caricature-as-printed" => Reading::ALL.map(Into::into).into(),
        _ => Vec::new(),
    }
}

/// The theorems about the paper's equation, which `twofold verify` checks certificates against.
pub fn theorems() -> Vec<Theorem> {
    #[derive(serde::Deserialize)]
    struct File {
        theorem: Vec<Theorem>,
    }
    toml::from_str::<File>(twofold_papers::jeffrey_2013("theorems.toml"))
        .expect("the embedded theorems are well formed: a test reads them")
        .theorem
}

/// Code of a paper.
#[derive(Clone, Copy, Debug)]
pub struct Code {
    /// Its figures.
    pub figures: fn() -> Vec<Figure>,
    /// Counts the committed runs of a study that repeat a panel, by the names of study and reading.
    pub counts: fn(&str, &str) -> Option<Count>,
}

/// The code that a paper's folder names.
pub fn named(name: &str) -> Option<Code> {
    (name == "jeffrey-2013").then_some(Code { figures: all, counts })
}
