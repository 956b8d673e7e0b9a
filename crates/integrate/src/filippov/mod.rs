//! Filippov motion by events: free flight, crossing, sliding, folds, two-folds.
//!
//! # The mathematics
//!
//! Of x' = f+ where h > 0 and x' = f- where h < 0, write p = L+h and q = L-h for the Lie
//! derivatives. On h = 0 (Filippov 1988, ch. 2):
//!
//! | p | q | motion |
//! |---|---|---|
//! | > 0 | > 0 | crosses to h > 0 |
//! | < 0 | < 0 | crosses to h < 0 |
//! | < 0 | > 0 | attracting sliding, x' = (q f+ - p f-)/(q - p) |
//! | > 0 | < 0 | repelling sliding with the same field; may end at any moment, to either side |
//! | = 0 | | fold of f+: visible if L+²h > 0, invisible if L+²h < 0 |
//! | | = 0 | fold of f-: visible if L-²h < 0, invisible if L-²h > 0 |
//! | = 0 | = 0 | two-fold |
//!
//! A run is a sequence of pieces, each in one [`Mode`], and of [`ModeEvent`]s between them
//! (Piiroinen & Kuznetsov 2008; Dieci & Lopez 2009, 2012). After every landing on the surface the
//! mode that follows is decided from the signs of p and q at the landing point, never by stepping
//! on and looking; so a motion that should slide slides from its first landing on, and chattering
//! cannot occur.
//!
//! **Free flight** ends at the first zero of h on the step's dense output;
//! [`roots::first_zero`](super::roots::first_zero) says precisely when it is certain that none was
//! missed (h linear or quadratic in the state: always, up to rounding). A flight that begins on the
//! surface has a zero of h at its start; it is divided out, so that an early return is seen and the
//! start is not taken for one.
//!
//! **Sliding** is integrated with the desingularised field F = q f+ - p f- and physical time as an
//! extra state, t' = q - p ([`SlidingFlow`]). F leaves h unchanged identically and is smooth even
//! at a two-fold. Every recorded point, also between the ends of a step, is projected onto h = 0
//! along grad h. Attracting sliding ends where p or q comes to zero: there it leaves tangentially
//! along the visible fold's own orbit. Repelling sliding ends by an [`ExitRule`], or at the latest
//! where p or q comes to zero: that is an invisible fold, and the orbit leaves to the other side.
//!
//! **At a two-fold** F = 0. [`two_fold`] has the local analysis. If sliding runs into it, the last
//! leg is a closed form with a stated error ([`EventKind::TwoFoldReached`]). There the future is a
//! set, and the exit rule selects from it: where the sliding flow continues into the repelling
//! region (an invisible two-fold with vw > 1, v < 0; a visible one where the line of entry leads
//! on) the orbit follows the analytic continuation of the invariant curve for as long as the rule
//! says; [`ExitRule::AtOnce`] to a visible side takes that side's tangent orbit. Where the rule
//! asks for a future that does not exist the run ends with [`FilippovError::NoSuchExit`].
//!
//! **Two switching surfaces** are followed one at a time ([`run_two_surfaces`]); where they meet,
//! the motion is followed if the four fields decide it, and refused if not.
//!
//! **A field that runs along the surface** everywhere (a closed valve, a saturation) is slid along
//! if the other one points to the surface: the only velocity of Filippov's hull that is tangent to
//! it is that field's own.
//!
//! **Non-transversal cases.** A fold whose second Lie derivative vanishes too (a cusp), and contact
//! with a two-fold that is not reached along a sliding direction, end with
//! [`FilippovError::NonTransversal`]; crossings that accumulate (invisible two-folds have such
//! orbits) end with [`FilippovError::Zeno`], which names the moment of accumulation.

mod automatic;
mod engine;
mod exit;
mod flow;
mod funnel;
mod intersection;
mod surfaces;
mod trajectory;
pub mod two_fold;

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::driver::Observer;
use super::step::{Failure, Flow, Statistics, Step, StopReason, Tolerance};
use twofold_num::Short;

pub use engine::{run, run_watched};
pub use exit::{ExitRule, Side, SlidingLaw};
pub use flow::SlidingFlow;
pub use funnel::{Funnel, FunnelGrid, FunnelMember, connect, funnel, history};
pub use surfaces::{Faces, INTERSECTION, run_two_surfaces};
pub use trajectory::{Piece, Trajectory};

/// The kind of motion between two events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// Free flight with f+ in h >= 0.
    Plus,
    /// Free flight with f- in h <= 0.
    Minus,
    /// Sliding on h = 0 that attracts from both sides.
    SlidingAttracting,
    /// Sliding on h = 0 that repels to both sides.
    SlidingRepelling,
}

impl Mode {
    /// Whether the motion is on the surface.
    pub fn slides(self) -> bool {
        matches!(self, Mode::SlidingAttracting | Mode::SlidingRepelling)
    }
}

impl From<Side> for Mode {
    fn from(side: Side) -> Self {
        match side {
            Side::Plus => Mode::Plus,
            Side::Minus => Mode::Minus,
        }
    }
}

/// The kind of an event.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", tag = "kind")]
pub enum EventKind {
    /// Crossed the surface transversally.
    Crossing {
        /// The side it went to.
        to: Side,
    },
    /// Landed in the attracting region: sliding begins.
    Landing {
        /// The side it came from.
        from: Side,
    },
    /// Touched the surface at a visible fold without crossing, and flew on.
    Grazing {
        /// The side it stays on.
        side: Side,
    },
    /// Sliding ended at a visible fold: the orbit leaves tangentially. Or at a corner of h.
    LeftByTangency {
        /// The side it left to.
        to: Side,
    },
    /// The run started on the surface, in the mode that the event names.
    StartedOnSurface,
    /// The run started in the repelling region, or a graze led there: the future is a set.
    EnteredRepelling,
    /// Crossings accumulated (Zeno) at a point where the motion stays: zero lies between the two
    /// fields there.
    Accumulation {
        /// Time from the last computed crossing to the accumulation; from there on the durations
        /// are a geometric series.
        leg: f64,
    },
    /// Came to a two-fold.
    TwoFoldReached {
        /// Duration of the closed-form last leg.
        leg: f64,
        /// Estimated error of the moment of arrival.
        error: f64,
    },
    /// Left repelling sliding (or a two-fold) because the exit rule said so.
    Exit {
        /// The side it left to.
        to: Side,
        /// Time spent in repelling sliding.
        time: f64,
        /// Length of path in repelling sliding.
        arc: f64,
        /// The rule.
        rule: ExitRule,
    },
    /// Left repelling sliding because the repelling region ended (an invisible fold), before the
    /// rule's moment.
    ExitAtBoundary {
        /// The side it left to: the only one possible.
        to: Side,
        /// Time spent in repelling sliding.
        time: f64,
        /// Length of path in repelling sliding.
        arc: f64,
        /// The rule that was overtaken.
        rule: ExitRule,
    },
}

/// A change of mode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ModeEvent<const N: usize> {
    /// When.
    pub t: f64,
    /// The state, on the surface.
    pub state: SVector<f64, N>,
    /// Its kind.
    pub kind: EventKind,
    /// The mode before; `None` at the start of a run.
    pub from: Option<Mode>,
    /// The mode after; `None` at the two-fold itself and where a run stops because the future is a
    /// set.
    pub to: Option<Mode>,
}

/// Receives a Filippov run as it happens.
pub trait FilippovObserver<const N: usize> {
    /// A step, all of it in one mode. Steps follow each other without gaps; a step that an event
    /// cut short ends there.
    fn step(&mut self, mode: Mode, step: &Step<'_, N>) -> Flow;
    /// A change of mode.
    fn event(&mut self, _event: &ModeEvent<N>) -> Flow {
        Flow::Continue
    }
}

/// Hands every step, whatever its mode, to an ordinary observer: a path or a section of a Filippov
/// orbit.
#[derive(Debug)]
pub struct AllModes<'a, O>(pub &'a mut O);

impl<const N: usize, O: Observer<N>> FilippovObserver<N> for AllModes<'_, O> {
    fn step(&mut self, _: Mode, step: &Step<'_, N>) -> Flow {
        self.0.step(step)
    }
}

/// Options of a Filippov run.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FilippovOptions {
    /// Tolerances in every mode: of the Dormand-Prince method, and of Radau IIA where a piece is
    /// stiff.
    pub tolerance: Tolerance,
    /// The longest step in free flight. Sliding steps are measured in rescaled time and have no
    /// cap.
    pub max_step: f64,
    /// Distance from a two-fold, as a fraction of its radius, at which the closed-form last leg
    /// begins; never less than 300 times what the tolerances resolve.
    pub leg: f64,
    /// Distance of the shortest departure from a two-fold, as a fraction of its radius (see
    /// [`ExitRule::AtOnce`]).
    pub departure: f64,
    /// Largest number of events.
    pub max_events: u64,
    /// Largest number of steps.
    pub max_steps: u64,
}

impl Default for FilippovOptions {
    fn default() -> Self {
        Self {
            tolerance: Tolerance { rtol: 1e-12, atol: 1e-12 },
            max_step: f64::INFINITY,
            leg: 1e-7,
            departure: 1e-3,
            max_events: 1_000_000,
            max_steps: 50_000_000,
        }
    }
}

/// The end of a Filippov run.
#[derive(Clone, Debug, PartialEq)]
#[must_use = "a run may have been cut short: look at `stop`"]
pub struct FilippovSummary<const N: usize> {
    /// Final time.
    pub t: f64,
    /// Final state.
    pub x: SVector<f64, N>,
    /// The mode in which the run ended; `None` at a two-fold.
    pub mode: Option<Mode>,
    /// Why it ended; [`StopReason::SetValued`] only under the rule [`ExitRule::All`].
    pub stop: StopReason,
    /// Number of events.
    pub events: u64,
    /// Work done, all modes together.
    pub statistics: Statistics,
}

impl<const N: usize> FilippovSummary<N> {
    /// This summary, unless the budget of steps ended the run.
    ///
    /// # Errors
    /// [`Failure::TooManySteps`] if the budget of steps ended the run.
    pub fn within_budget(self) -> Result<Self, FilippovError> {
        match self.stop {
            StopReason::StepBudget => Err(Failure::TooManySteps {
                t: self.t,
                limit: self.statistics.steps,
                state: Failure::state(&self.x),
            }
            .into()),
            _ => Ok(self),
        }
    }
}

/// Why a Filippov run could not go on.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FilippovError {
    /// The method failed between events.
    #[error(transparent)]
    Stepping(#[from] Failure),
    /// A number in the settings or the rule makes no sense.
    #[error("{0}")]
    Invalid(String),
    /// Crossings accumulate.
    #[error(
        "crossings accumulate (Zeno): {crossings} in a row, each sooner than the one before, the \
            last flight took {last:e}; they come together near t = {accumulates}, state {state:?}. \
            Start elsewhere, or end the run before that time",
        accumulates = Short(*accumulates)
    )]
    Zeno {
        /// Time reached.
        t: f64,
        /// State reached.
        state: Vec<f64>,
        /// Flights in a row, each shorter than the one before.
        crossings: u64,
        /// Duration of the last.
        last: f64,
        /// The estimated moment of accumulation.
        accumulates: f64,
    },
    /// A contact with the surface that first and second Lie derivatives do not decide.
    #[error(
        "non-transversal contact with the switching surface at t = {t}, state {state:?}: {what}. \
            Perturb the start or the parameters",
        t = Short(*t)
    )]
    NonTransversal {
        /// Time reached.
        t: f64,
        /// State reached.
        state: Vec<f64>,
        /// The quantity that vanishes.
        what: &'static str,
    },
    /// Several motions are possible, and nothing says which is followed.
    #[error("the motion is not decided at t = {t}, state {state:?}: {choice}", t = Short(*t))]
    Undecided {
        /// Time reached.
        t: f64,
        /// State reached.
        state: Vec<f64>,
        /// The possible choices.
        choice: Box<Choice>,
    },
    /// The switching function is not continuous along the motion.
    #[error(
        "the switching function h jumps at t = {t}, state {state:?}: it changes sign there without \
            coming to 0, or faster than numbers resolve. Give the place of the jump as a second \
            switching surface ([second] in the system's file), or smooth the switches (--switch \
            smoothed)",
        t = Short(*t)
    )]
    Jump {
        /// Time reached.
        t: f64,
        /// State reached.
        state: Vec<f64>,
    },
    /// The switching function comes to zero without a slope.
    #[error(
        "the switching function h comes to 0 at t = {t}, state {state:?}, without a finite slope \
            above 0, by which its sides are told there: write it with one, y for y^3, abs(y)*y or \
            sqrt(abs(y))*sign(y)",
        t = Short(*t)
    )]
    Slope {
        /// Time reached.
        t: f64,
        /// State reached.
        state: Vec<f64>,
    },
    /// The exit rule asks for a future that does not exist here.
    #[error("the exit rule cannot be followed at t = {t}, state {state:?}: {why}", t = Short(*t))]
    NoSuchExit {
        /// Time reached.
        t: f64,
        /// State reached.
        state: Vec<f64>,
        /// Why.
        why: &'static str,
    },
    /// The recorded futures are more than fits in memory.
    #[error(
        "more than {limit} points were recorded in the first {members} futures of the funnel: \
            follow fewer of them, or each for a shorter time"
    )]
    TooManyPoints {
        /// The limit.
        limit: usize,
        /// Futures that had been followed.
        members: usize,
    },
    /// The budget of events is used up.
    #[error(
        "{limit} events were not enough: stopped at t = {t}, state {state:?}; end the run earlier \
            (--t-end); where switches follow each other so closely, smooth them (--switch \
            smoothed)",
        t = Short(*t)
    )]
    TooManyEvents {
        /// Time reached.
        t: f64,
        /// State reached.
        state: Vec<f64>,
        /// The limit.
        limit: u64,
    },
}

/// The motions that are possible where none is decided.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "{what}. Possible: {}. {remedy}",
    if continuations.is_empty() { "not known".to_owned() } else { continuations.join("; ") }
)]
pub struct Choice {
    /// Description of the undecided place.
    pub what: &'static str,
    /// The possible continuations.
    pub continuations: Vec<String>,
    /// Advice to the user.
    pub remedy: &'static str,
}

/// Advice where an exit rule can choose.
const CHOOSE: &str = "Nothing is chosen silently: say which is followed by --exit, such as \
    at-once:plus, after-time:0.3:minus, after-arc:0.2:plus, random:exponential:0.5, or all; or end \
    the run before (--t-end)";

/// Advice where no rule can choose.
const WITHOUT_CHOICE: &str = "Nothing is chosen here: end the run before that time (--t-end), \
    start elsewhere (--start), change a parameter (--set), or smooth the switches (--switch \
    smoothed)";

#[cfg(test)]
mod tests;
