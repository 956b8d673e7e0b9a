//! The multistep method's history between two steps.

use nalgebra::Dyn;
use twofold_integrate::LsodaOf;

use crate::equation::Configuration;

/// The branch on which a step ended: what the motion's right-hand side depends on beside time and
/// state, and where it was.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Branch {
    pub t: f64,
    pub x: Vec<f64>,
    pub config: Configuration,
    pub sliding: Vec<usize>,
    /// Of each contact its watched expression.
    pub contacts: Vec<usize>,
}

/// The multistep method between two steps, and the step that it made.
#[derive(Clone, Debug, Default)]
pub(crate) struct Multistep {
    /// As it is where the step begins; without one the step is a first one.
    pub begin: Option<LsodaOf<Dyn>>,
    /// As it is where the step ends.
    pub made: Option<LsodaOf<Dyn>>,
    /// Where `begin` stands.
    pub branch: Option<Branch>,
    /// Errors that count as one.
    pub scale: Vec<f64>,
    /// The length of the step that it made, and its end, which may be cut off.
    pub whole: f64,
    pub end: Vec<f64>,
}

impl Multistep {
    /// The fraction of the step made at which one of length `h` ends, and the end if it is whole.
    pub(crate) fn share(&self, h: f64) -> (f64, Option<&[f64]>) {
        let share = h / self.whole;
        (share, (share == 1.0).then_some(&self.end))
    }
}
