//! The two readings of the paper's parameters, and figures with a picture for each.

use std::borrow::Cow;
use std::sync::LazyLock;

use serde::{Deserialize, Serialize};

use twofold_paper::{Figure, FigurePanel, ParameterReading, Picture, Study, View};
use twofold_system::Caricature;

/// The two readings of the paper's parameters, always shown side by side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Reading {
    /// As printed. Its late motion is always one stable periodic orbit.
    Printed,
    /// One digit of alpha changed. It gives the paper's story.
    Reconstructed,
}

impl Reading {
    /// Both, in the order in which they are shown.
    pub const ALL: [Reading; 2] = [Reading::Printed, Reading::Reconstructed];

    /// The reading of this name.
    pub fn named(name: &str) -> Option<Reading> {
        Reading::ALL.into_iter().find(|reading| reading.word() == name)
    }

    /// Its name in the paper's folder, in file names and in small print.
    pub fn word(self) -> &'static str {
        match self {
            Reading::Printed => "printed",
            Reading::Reconstructed => "reconstructed",
        }
    }

    /// Its alpha and beta, as the paper's folder has them.
    pub fn parameters(self) -> [f64; 2] {
        READINGS[self as usize]
    }

    /// The caricature with this reading's re-injection.
    pub fn caricature(self) -> Caricature {
        let [alpha, beta] = self.parameters();
        Caricature::with_reinjection(alpha, beta)
    }
}

/// Alpha and beta of each reading: `[readings]` of `papers/jeffrey-2013/paper.toml`.
static READINGS: LazyLock<[[f64; 2]; 2]> = LazyLock::new(|| {
    let paper: toml::Table = twofold_papers::jeffrey_2013("paper.toml")
        .parse()
        .expect("the embedded file is well formed: a test reads it");
    Reading::ALL.map(|reading| {
        ["alpha", "beta"].map(|name| {
            paper["readings"][reading.word()]["run"]["set"][name]
                .as_float()
                .expect("a reading sets both: a test reads it")
        })
    })
});

impl From<Reading> for ParameterReading {
    fn from(reading: Reading) -> Self {
        let [alpha, beta] = reading.parameters();
        ParameterReading {
            name: reading.word().to_owned(),
            parameters: vec![("alpha".to_owned(), alpha), ("beta".to_owned(), beta)],
        }
    }
}

/// A figure with one study per reading, printed first.
pub fn studied_in_both_readings(
    id: &'static str,
    title: &'static str,
    caption: &str,
    studies: [Study; 2],
) -> Figure {
    let (id, title) = (Cow::from(id), Cow::from(title));
    let pictures = Reading::ALL
        .into_iter()
        .zip(studies)
        .map(|(reading, study)| Picture {
            name: format!("{id}-{}", reading.word()),
            reading: Some(reading.into()),
            title: title.clone(),
            caption: caption.to_owned(),
            view: View::Study(study),
            panels: Vec::new(),
            alterations: Vec::new(),
        })
        .collect();
    Figure { id, title, pictures }
}

/// A figure with one picture of runs per reading.
pub fn in_both_readings(
    id: &'static str,
    title: &'static str,
    view: View,
    caption: impl Fn(Reading) -> String,
    panels: impl Fn(Reading) -> Vec<FigurePanel>,
) -> Figure {
    let (id, title) = (Cow::from(id), Cow::from(title));
    let pictures = Reading::ALL
        .map(|reading| Picture {
            name: format!("{id}-{}", reading.word()),
            reading: Some(reading.into()),
            title: title.clone(),
            caption: caption(reading),
            view: view.clone(),
            panels: panels(reading),
            alterations: Vec::new(),
        })
        .into();
    Figure { id, title, pictures }
}
