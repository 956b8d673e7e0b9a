//! Figures as data.
//!
//! A [`Figure`] is a list of pictures, a picture a list of panels, a panel a question
//! ([`RunSpec`]). The way of every figure is the same: questions -> [`pipeline`] (put to an
//! [`Executor`](twofold_job::Executor) in parallel, each computed once) -> answers -> [`drawing`]
//! -> bytes -> files. The figures themselves stand in a paper's folder, or in a crate of the
//! paper's own: every number of a caption, and nothing else.
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod claim;
pub mod compare;
pub mod draw;
pub mod drawing;
pub mod html;
pub mod pipeline;
pub mod plots;
pub mod reuse;
pub mod study;
pub mod tables;
pub mod verdict;
pub mod wording;

use std::borrow::Cow;
use std::sync::Arc;

use serde::Serialize;

pub use plots::Plots;
pub use study::Study;
use twofold_integrate::filippov::ExitRule;
use twofold_job::JobError;
use twofold_job::spec::{Method, RunSpec, SwitchSpec};
use verdict::Claim;

/// A figure of the paper.
#[derive(Clone, Debug)]
pub struct Figure {
    /// "fig7".
    pub id: Cow<'static, str>,
    /// Description of its subject.
    pub title: Cow<'static, str>,
    /// Its pictures: one per parameter reading, or one.
    pub pictures: Vec<Picture>,
}

/// One picture file.
#[derive(Clone, Debug)]
pub struct Picture {
    /// File name without extension: the figure's and the reading's name, "fig7-first".
    pub name: String,
    /// The parameter reading, if the figure has readings.
    pub reading: Option<ParameterReading>,
    /// The heading.
    pub title: Cow<'static, str>,
    /// The caption, in our own words.
    pub caption: String,
    /// View of the panels.
    pub view: View,
    /// The panels, in the paper's order.
    pub panels: Vec<FigurePanel>,
    /// Differences between this picture and the published one ("t = 500 instead of 200000"); empty
    /// if there are none.
    pub alterations: Vec<String>,
}

/// One panel: a label and a question.
#[derive(Clone, Debug)]
pub struct FigurePanel {
    /// "i", "ii", ... as in the paper.
    pub label: String,
    /// A few words above the panel.
    pub title: String,
    /// The run.
    pub run: RunSpec,
    /// The paper's claim about it.
    pub claim: Option<Claim>,
    /// The claimant, as the face says: the paper, or a panel of it that this one varies.
    pub claimant: String,
    /// Runs that repeat the panel's from starts that a reader could not tell apart.
    pub repeats: Option<Repeats>,
}

/// Counts the runs that repeat a panel of this name.
pub type Count = fn(&str) -> Result<Support, JobError>;

/// The runs that repeat a panel, counted when the panel is drawn.
#[derive(Clone, Debug)]
pub struct Repeats {
    /// The panel, as the repeated runs call it.
    pub panel: String,
    /// Counts the runs.
    pub count: Count,
}

/// The number of repeated runs of a panel that support the paper's claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Support {
    /// Runs that support the claim.
    pub support: u64,
    /// All repeated runs.
    pub runs: u64,
}

/// View of a picture's panels.
#[derive(Clone, Debug)]
pub enum View {
    /// A Poincare section in the plane of two coordinates: the later half, and the early half below
    /// it.
    Section {
        /// Index of the horizontal coordinate.
        horizontal: usize,
        /// Index of the vertical coordinate.
        vertical: usize,
    },
    /// The later half of such a section alone, as the paper shows it.
    LateSection {
        /// Index of the horizontal coordinate.
        horizontal: usize,
        /// Index of the vertical coordinate.
        vertical: usize,
    },
    /// A path in space with the switching surface.
    Space {
        /// Camera and axes.
        camera: Camera,
    },
    /// Something other than runs: a sketch computed from the model, a comparison of methods. The
    /// picture has no panels of runs; the study makes its own.
    Study(Study),
    /// Panels that are drawn from answers of any kind, of systems of any dimension: the figures of
    /// a paper's folder.
    Plots(Arc<Plots>),
}

/// An orthographic view of the state space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    /// Coordinates along the two horizontal axes and the vertical one.
    pub axes: [usize; 3],
    /// Azimuth, degrees.
    pub azimuth: f64,
    /// Elevation, degrees.
    pub elevation: f64,
}

/// A reading of a paper's parameters: one of `[readings]` of its folder.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ParameterReading {
    /// Its name.
    pub name: String,
    /// The numbers that it gives to parameters, in the order in which they are shown.
    pub parameters: Vec<(String, f64)>,
}

impl FigurePanel {
    /// A panel.
    pub fn new(label: &str, title: impl Into<String>, run: RunSpec) -> Self {
        FigurePanel {
            label: label.to_owned(),
            title: title.into(),
            run,
            claim: None,
            claimant: "paper".into(),
            repeats: None,
        }
    }

    /// The panel with the paper's claim about it.
    pub fn claimed(self, claim: Claim) -> Self {
        FigurePanel { claim: Some(claim), ..self }
    }

    /// The panel with the runs that repeat it.
    pub fn repeated(self, repeats: Repeats) -> Self {
        FigurePanel { repeats: Some(repeats), ..self }
    }
}

/// Changes a user may ask for. A changed picture gets another name and says on its face what was
/// changed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Alterations {
    /// Another seed for kicks and exits.
    pub seed: Option<u64>,
    /// A shorter (or longer) run.
    pub t_end: Option<f64>,
    /// Another method.
    pub method: Option<Method>,
    /// The later half of sections alone.
    pub late: bool,
}

impl Picture {
    /// The name of its reading, if it has one.
    pub fn reading_name(&self) -> Option<&str> {
        self.reading.as_ref().map(|reading| reading.name.as_str())
    }

    /// Applies what the user asked for.
    pub fn alter(&mut self, alterations: &Alterations) {
        let mut suffix = String::new();
        if let Some(seed) = alterations.seed {
            let mut changed = false;
            for kick in self.panels.iter_mut().filter_map(|p| p.run.schedule.kick.as_mut()) {
                changed |= kick.seed != seed;
                kick.seed = seed;
            }
            for panel in &mut self.panels {
                if let SwitchSpec::Filippov { exit: ExitRule::Random { seed: old, .. }, .. } =
                    &mut panel.run.switch
                {
                    changed |= *old != seed;
                    *old = seed;
                }
            }
            if changed {
                suffix += &format!("-seed{seed}");
                self.alterations.push(format!("seed {seed}"));
            }
        }
        if let Some(method) = alterations.method
            && self.panels.iter().any(|p| p.run.method.name != method)
        {
            for panel in &mut self.panels {
                panel.run.method.name = method;
            }
            suffix += &format!("-{}", method.name());
            self.alterations.push(format!("method {}", method.name()));
        }
        if let Some(t_end) = alterations.t_end
            && let Some(original) = self.panels.iter().map(|p| p.run.t_end).find(|t| *t != t_end)
        {
            for panel in &mut self.panels {
                panel.run.t_end = t_end;
            }
            let word = if t_end < original { "shortened" } else { "lengthened" };
            suffix += &format!("-{word}");
            self.alterations.push(format!("{word}: t = {t_end} instead of {original}"));
        }
        if let (true, View::Section { horizontal, vertical }) = (alterations.late, &self.view) {
            self.view = View::LateSection { horizontal: *horizontal, vertical: *vertical };
            suffix += "-late";
            self.alterations.push("the later half alone".to_owned());
        }
        // Other runs have not been repeated.
        if !suffix.is_empty() && suffix != "-late" {
            self.panels.iter_mut().for_each(|panel| panel.repeats = None);
        }
        self.name += &suffix;
    }

    /// Keeps one panel.
    pub fn keep_only(&mut self, label: &str) {
        if self.panels.len() > 1 {
            self.panels.retain(|p| p.label == label);
            self.name += &format!("-only-{label}");
            self.alterations.push(format!("panel ({label}) only"));
        }
    }
}
