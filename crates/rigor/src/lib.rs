//! Validated numerics: enclosures of solutions that are theorems.
//!
//! Everything here computes with sets of numbers ([`twofold_num::Interval`], [`twofold_num::Ball`])
//! and returns sets that contain the exact result, for the exact equation: constants are the
//! decimal numbers that were written, tanh is tanh and not its `f64` stand-in. What cannot be shown
//! is an [`Error`], never a wide answer that looks like one.
//!
//! - [`set`]: the shapes in which sets of states are carried along (Lohner 1987; Zgliczynski 2002),
//!   so that their width follows the flow instead of the coordinate axes.
//! - [`flow`]: one validated Taylor step, with a proof that the solution exists and stays in a box
//!   (Nedialkov & Jackson 1999).
//! - [`section`]: rigorous crossings of a coordinate plane, and the derivative of the map from
//!   crossing to crossing.
//! - [`cycle`]: closed orbits by interval Newton (Krawczyk 1969), and whether they attract.
//! - [`covering`]: covering relations between parallelograms (Zgliczynski & Gidea 2004), from which
//!   horseshoes are made.
//!
//! The proofs made with it are in the folder `proofs/`, one file a theorem.
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod covering;
pub mod cycle;
pub mod flow;
pub mod linear;
pub mod section;
pub mod set;

pub use covering::{Covering, HSet, Return, prove_covering};
pub use cycle::{Cycle, prove_cycle};
pub use flow::{Flow, FlowOptions};
pub use section::{AxisPlane, Crossing};
pub use set::Set;

use twofold_num::Interval;

/// Why something could not be shown. It does not mean that it is false.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// No step was short enough.
    #[error(
        "no enclosure of the solution over a step as short as {step:e} from t = {time}, near \
            {near:?}: the set is too wide there, or the tolerance too small for the arithmetic"
    )]
    NoEnclosure {
        /// Time reached.
        time: f64,
        /// Length of the last step tried.
        step: f64,
        /// Hull of the set.
        near: Vec<Interval>,
    },
    /// The section is met at an angle that the set is too wide to decide.
    #[error(
        "at t = {time} the flow is not transversal to the section on all of {near:?}: use a \
            narrower set or another section"
    )]
    NotTransversal {
        /// Time reached.
        time: f64,
        /// Hull of the set.
        near: Vec<Interval>,
    },
    /// No crossing within the time allowed.
    #[error("no crossing of the section before t = {0}: allow more time")]
    NoCrossing(f64),
    /// A crossing in the wrong direction.
    #[error(
        "the orbit crosses the section in the wrong direction at t = {0}: check the number of \
            crossings a turn"
    )]
    WrongDirection(f64),
    /// A matrix that may be singular.
    #[error("a matrix of derivatives may be singular on this set: use a narrower one")]
    Singular,
    /// The inclusion that would prove existence does not hold.
    #[error(
        "no proof: the Newton image {image:?} is not inside {candidate:?}; start nearer, or from a \
            box of another size"
    )]
    NotIncluded {
        /// The box started from.
        candidate: Vec<Interval>,
        /// Its image.
        image: Vec<Interval>,
    },
    /// A covering relation does not hold, or the enclosures are too wide to show it.
    #[error(
        "no covering: seen from set {set}, the image of the part {part:?} lies in {seen:?}: beyond \
            an edge u = -1 or 1, or within v = -1 and 1, is needed"
    )]
    NotCovered {
        /// The part of the covering set, a range of u.
        part: [f64; 2],
        /// The set that is to be covered, counted from 0.
        set: usize,
        /// The image in that set's coordinates (u, v).
        seen: [Interval; 2],
    },
}
