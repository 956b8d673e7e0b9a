//! Following a general system exactly: from switch to switch, from event to event.
//!
//! Between switches the equations are smooth and a step of one of the methods is made. Every step
//! is searched for the first zero of all switching functions, events' expressions and limits of
//! sliding; it is made again to end there, and [what happens there](crate::selection) is decided
//! from the equations on both sides.

mod clock;
mod deciding;
mod locate;
mod meeting;
mod multistep;
mod search;
pub mod sensitivity;
mod series;
mod settling;
mod sliding;
pub mod tangent;

use clock::Clock;
use search::active_value;
pub(crate) use sliding::determinant_of_negative;

use std::rc::Rc;

use twofold_integrate::Extents;
use twofold_num::elementary::rough_pow;
use twofold_num::linear::solve_any;
use twofold_num::{Dual, Short};
use twofold_system::Expression;

use crate::cells::Cells;
use crate::definition::{Direction, Event, When};
use crate::equation::{Compiled, Configuration, Equation, EquationError};
use crate::model::Model;
use crate::range::Range;
use crate::roots::{
    PLACES, at_fraction, first, first_behind_tangent, first_of_polynomial, first_of_series,
    slope_at_beginning, stays,
};
use crate::selection::{
    Intersection, MOST_TOGETHER, Mixture, Way, attraction, complementary, groups, hold, leads_away,
    mixture, mixtures_differ, near_solution, nearest_of_hull, position_hold, possibilities, turn,
    turn_of_position, velocities_differ,
};
use crate::step::{LEAST_FALLING, LEAST_STATE, Step, UNDERFLOW};

/// Data recorded during a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// The path, by points that a polyline through leaves by at most this distance, by less
    /// of small states: [`Options::extents`].
    Path {
        /// The distance.
        chord: f64,
    },
    /// The state at the multiples of this time.
    Times {
        /// The time.
        every: f64,
    },
    /// The state at each zero of an expression.
    Section(Expression),
}

/// Side taken where the motion is not unique.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// The run ends with an error.
    Undecided,
    /// To positive values.
    Plus,
    /// To negative values.
    Minus,
}

/// Integration method.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Method {
    /// Dormand & Prince, explicit.
    #[default]
    Dopri5,
    /// Radau IIA, implicit: for motion that is stiff between switches or in sliding.
    Radau5,
    /// Taylor series of the motion, of an order that the tolerance decides: for many digits. A root
    /// of zero, which has none, is left by steps of Radau IIA, here and by the other methods.
    Taylor,
    /// Adams and BDF formulas of variable order, chosen automatically: for smooth stretches that
    /// are long beside the time that the order takes to grow, stiff or not.
    Lsoda,
}

impl Method {
    /// All methods.
    pub const ALL: [Method; 4] = [Method::Dopri5, Method::Radau5, Method::Taylor, Method::Lsoda];

    /// The one of this name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|method| method.name() == name)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        match self {
            Method::Dopri5 => "dopri5",
            Method::Radau5 => "radau5",
            Method::Taylor => "taylor",
            Method::Lsoda => "lsoda",
        }
    }
}

/// Options for the integration of a system.
#[derive(Clone, Debug, PartialEq)]
pub struct Options {
    /// Start time.
    pub t_start: f64,
    /// End time.
    pub t_end: f64,
    /// The initial state; without one the file's.
    pub start: Option<Vec<f64>>,
    /// The initial mode.
    pub mode: usize,
    /// Relative tolerance of a step.
    pub rtol: f64,
    /// Absolute tolerance; without one each state is measured by its own size, near zero by a
    /// hundredth of its largest one of late.
    pub atol: Option<f64>,
    /// The longest step.
    pub max_step: f64,
    /// The most steps.
    pub max_steps: u64,
    /// Data to record.
    pub record: Record,
    /// The extents of small states, to which a path keeps nearer.
    pub extents: Extents,
    /// Side taken where the motion is not unique.
    pub exit: Exit,
    /// Integration method.
    pub method: Method,
    /// Mixture taken if several mixtures of the fields stay on several surfaces.
    pub intersection: Intersection,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            t_start: 0.0,
            t_end: 100.0,
            start: None,
            mode: 0,
            rtol: 1e-10,
            atol: None,
            max_step: f64::INFINITY,
            max_steps: 400_000_000,
            record: Record::Path { chord: 1e-3 },
            extents: Extents::default(),
            exit: Exit::Undecided,
            method: Method::Dopri5,
            intersection: Intersection::Undecided,
        }
    }
}

/// A recorded point.
#[derive(Clone, Debug)]
pub struct Point<'a> {
    /// The time.
    pub t: f64,
    /// The state.
    pub x: &'a [f64],
    /// The mode's number.
    pub mode: usize,
    /// For each switching function +, - or 0 (slid upon, or at rest at zero); . where the equations
    /// do not ask it here. Whole parts stand as #.
    pub signs: &'a str,
    /// The event that happens here.
    pub event: Option<&'a str>,
    /// At a crossing of the section +1 if its expression rises, -1 if it falls.
    pub direction: Option<f64>,
}

/// Reason for the end of a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// At its end time.
    Finished,
    /// By an event that says stop.
    Stopped(String),
    /// At the accumulation (Zeno) of an event: the event, the time and a bound on its error.
    Zeno {
        /// The event's name.
        event: String,
        /// The time at which infinitely many are over.
        t: f64,
        /// A bound on its error.
        error: f64,
    },
    /// The observer wanted no more.
    Interrupted,
}

/// A run's end and its work.
#[derive(Clone, Debug, PartialEq)]
pub struct Outcome {
    /// Why it ended.
    pub ending: Ending,
    /// The time then.
    pub t: f64,
    /// The state then.
    pub x: Vec<f64>,
    /// The mode then.
    pub mode: usize,
    /// Accepted steps.
    pub steps: u64,
    /// Switches met.
    pub switches: u64,
    /// Events that happened.
    pub events: u64,
    /// The largest size of each state.
    pub sizes: Vec<f64>,
}

/// Why a system cannot be followed further.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum HybridError {
    /// The equations are not complete.
    #[error(transparent)]
    Equation(#[from] EquationError),
    /// An initial state that is none.
    #[error("{0}")]
    Start(String),
    /// A wrong number of the run.
    #[error("{0}")]
    Bad(String),
    /// No closed orbit was found.
    #[error("{0}")]
    NoOrbit(String),
    /// Several continuations.
    #[error(
        "the motion is not decided at t = {t}, state {x:?}: on {surfaces} it can go on in more \
            than one way ({ways}). Nothing is chosen here: end the run before that time (--t-end), \
            start elsewhere (--start), change a parameter (--set), choose a side (--exit \
            at-once:plus or at-once:minus), or choose a mixture (--intersection)",
        t = Short(*t)
    )]
    Undecided {
        /// When.
        t: f64,
        /// The state.
        x: Vec<f64>,
        /// The switching functions that are zero there.
        surfaces: String,
        /// The ways.
        ways: String,
    },
    /// Surfaces that cannot be told apart.
    #[error("at t = {t}, state {x:?}, {why}", t = Short(*t))]
    Stuck {
        /// When.
        t: f64,
        /// The state.
        x: Vec<f64>,
        /// The reason, in words.
        why: String,
    },
    /// A domain is left.
    #[error(
        "the motion leaves the domain of the equations at t = {t}, state {x:?}: {what}. End the \
            run before that time (--t-end), or start elsewhere (--start)",
        t = Short(*t)
    )]
    Domain {
        /// When.
        t: f64,
        /// The state.
        x: Vec<f64>,
        /// The operation without a value, and its equation.
        what: String,
    },
    /// Switches accumulate.
    #[error(
        "switches at {surfaces} accumulate at t = {t} (error at most {error:.1e}), state {x:?}, \
            and nothing says how motion goes on: end the run before that time (--t-end), or \
            describe what holds there by an [[event]]",
        t = Short(*t)
    )]
    Accumulation {
        /// When.
        t: f64,
        /// A bound on its error.
        error: f64,
        /// The state.
        x: Vec<f64>,
        /// The switching function.
        surfaces: String,
    },
    /// Too many steps.
    #[error("{steps} steps were made by t = {t}, the most that --max-steps allows", t = Short(*t))]
    Budget {
        /// The limit.
        steps: u64,
        /// The time reached.
        t: f64,
    },
}

/// Largest number of times that a step is shortened before it is given up.
const MOST_SHORTENINGS: usize = 200;
/// Steps that are a smaller part of the run may be on their way to a root's end.
const SHORT_STEP: f64 = 1e-4;
/// Largest number of times that switches may make each other jump at one moment.
const MOST_JUMPS: usize = 32;

/// Derivatives of watched values that are smaller parts of their terms than this are zero.
const SMALLEST_SLOPE: f64 = 1e-11;

/// By which numbers speeds are differentiated.
#[derive(Clone, Copy)]
enum By<'a> {
    /// States and time along the field.
    Field,
    /// One variable.
    Variable(usize),
    /// States in a direction.
    Direction(&'a [f64]),
}

/// A condition that a step is searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sought {
    /// The value of an active guard, by its number; whole parts have two.
    Guard { guard: usize, upper: bool },
    /// A watched expression.
    Watched(usize),
    /// A watched expression that changes its sign through a pole.
    Pole(usize),
    /// A weight of sliding: the surface's place among those slid upon, and whether it is left to
    /// the positive side.
    Leave { place: usize, plus: bool },
    /// Sliding stops being attracting.
    Repelling,
    /// A contact opens, by its place.
    Release(usize),
    /// A kink of the field on the positive side of a surface slid upon, by its place among those.
    Beyond(usize),
}

/// A thing that is met, by numbers that other equations keep.
#[derive(Clone, Copy, Debug)]
enum Found {
    /// A guard that is slid upon.
    Slid(usize),
    /// A contact, by its watched expression.
    Contact(usize),
    /// A kink of the field on the positive side of a surface slid upon.
    Kink { slid: usize, guard: usize },
}

/// A meeting of a watched expression with zero that a switch brings about.
enum Jump {
    /// It is on the other side now.
    Over,
    /// It was held at zero and leaves it, or is held there from now on.
    Leaves,
    /// It jumps onto zero.
    Onto,
}

/// A kink of a field on the other side of a surface slid upon, whose function is another one there.
#[derive(Clone, Copy, Debug)]
struct Beyond {
    /// The surface's place among those slid upon.
    place: usize,
    guard: usize,
    side: f64,
    /// Whether it has just been passed.
    fresh: bool,
}

/// Times at which something happened again and again.
#[derive(Clone, Debug, Default)]
struct Train {
    times: Vec<f64>,
}

/// Times in which sixty of them are as good as none, relative to the time.
const SO_SHORT: f64 = 1e-11;
/// A weight of sliding that is zero because a field runs along the surface is so up to this
/// rounding; one that grows beyond its root is none.
const ALONG: f64 = 1e-10;

impl Train {
    /// Whether what happened before, and at `t` again, comes in ever shorter times.
    fn shrinks(&self, t: f64) -> bool {
        let n = self.times.len();
        n >= 5 && {
            let gap = |i: usize| self.times[n - i] - self.times[n - i - 1];
            t - self.times[n - 1] < gap(1) && gap(1) < gap(2) && gap(2) < gap(3)
        }
    }

    /// The time after which infinitely many turns to and fro are over, where two take ever shorter
    /// times, by one factor.
    fn turns(&self) -> Option<f64> {
        let [d, c, b, a] = *self.times.last_chunk()?;
        let q = (a - b) / (c - d);
        (q > 0.0 && q < 0.95).then(|| (a - c) * q / (1.0 - q))
    }

    /// The time at which infinitely many are over, by Aitken's extrapolation, and the last time
    /// between two, where these shrink.
    fn limit(&self, t: f64) -> Option<(f64, f64)> {
        let n = self.times.len();
        self.shrinks(t).then(|| {
            let gap = |i: usize| self.times[n - i] - self.times[n - i - 1];
            (self.times[n - 1] + gap(1) * gap(1) / (gap(2) - gap(1)), gap(1))
        })
    }

    /// Notes one more; gives the time at which infinitely many are over, with a bound on its error,
    /// once that is known. Times that are less than `grain` apart are not told apart reliably.
    fn note(&mut self, t: f64, grain: f64) -> Option<(f64, f64)> {
        self.times.push(t);
        let rounding = 4.0 * f64::EPSILON * t.abs();
        if self.times.len() > 20 && t - self.times[self.times.len() - 20] <= rounding {
            // No time passes any more.
            return Some((t, rounding));
        }
        let n = self.times.len();
        if n > 60 && t - self.times[n - 60] <= SO_SHORT * t.abs() {
            // The method's own error keeps them from coming any faster.
            return Some((t, t - self.times[n - 60]));
        }
        if n > 64 {
            self.times.remove(0);
        }
        self.told(t, grain)
    }

    /// The same of those that are noted.
    fn told(&self, t: f64, grain: f64) -> Option<(f64, f64)> {
        let n = self.times.len();
        if n < 6 {
            return None;
        }
        let gap = |i: usize| self.times[n - i] - self.times[n - i - 1];
        let [g1, g2, g3, g4] = [gap(1), gap(2), gap(3), gap(4)];
        if !(g1 < g2 && g2 < g3 && g3 < g4) {
            return None;
        }
        // Aitken's extrapolation of the last three times, and of the three before.
        let limit = |last: f64, g: f64, before: f64| last + g * g / (before - g);
        let (now, earlier) = (limit(self.times[n - 1], g1, g2), limit(self.times[n - 2], g2, g3));
        let left = now - t;
        let error = (now - earlier).abs() + 4.0 * f64::EPSILON * now.abs();
        let steady = (g1 / g2 - g2 / g3).abs() < 0.1 && g1 / g2 < 0.999;
        (steady
            && left >= 0.0
            && (g1 <= grain
                || left <= 1e-8 * (self.times[n - 1] - self.times[0]).max(1e-4 * t.abs()))
            && error <= 0.1 * left.max(1e-13 * t.abs()))
        .then_some((now, error))
    }
}

/// A contact: motion rests on an event's surface.
#[derive(Clone, Debug, PartialEq)]
struct Contact {
    event: usize,
    watched: usize,
    /// A direction by which the event's reset is differentiated for that in which the contact acts;
    /// of one state that is set, this itself.
    along: Rc<[f64]>,
    /// +1 if the surface is met from above.
    above: f64,
}

/// The equations on one side of a contact whose place or speed other functions see: with the sides
/// that these have as soon as the motion leaves it to that side.
struct Off {
    /// Place of the contact, and the side.
    place: usize,
    way: f64,
    config: Configuration,
    compiled: Rc<Compiled>,
    variables: Vec<f64>,
}

/// A step that stands, but for what is met in it.
struct Accepted {
    length: f64,
    error: f64,
    /// Subintervals in which the step is searched; empty: the whole step.
    parts: Vec<(f64, f64)>,
    /// Whether longer ones were tried.
    rejected: bool,
}

struct Follower<'a> {
    equation: Equation,
    model: &'a Model,
    options: &'a Options,
    n: usize,
    t: f64,
    x: Vec<f64>,
    config: Configuration,
    compiled: Rc<Compiled>,
    /// States, time, answers, tables: what programs read.
    variables: Vec<f64>,
    /// Guards that are slid upon, and for each the configuration on its positive side (all others
    /// slid upon on their negative one).
    sliding: Vec<usize>,
    /// Whether each guard is slid upon.
    slides: Vec<bool>,
    /// For each guard that is slid upon the side whose field runs along the surface, so that its
    /// weight is one to rounding; else 0.
    along: Vec<f64>,
    base: Vec<(Rc<Compiled>, Vec<f64>)>,
    /// Kinks of those fields.
    beyond: Vec<Beyond>,
    /// Fields on all sides of the surfaces slid upon, for the rule that chooses among mixtures if
    /// these differ.
    corners: Vec<(Rc<Compiled>, Vec<f64>)>,
    /// The sides of the surfaces slid upon that have points, where some are zero because others
    /// are. The corners are theirs alone then.
    cells: Option<Cells>,
    /// The surfaces of [`Intersection::Order`].
    order: Vec<usize>,
    /// Surfaces slid upon that know nothing of each other: the one that each state's derivative
    /// depends on.
    separate: Option<Vec<Option<usize>>>,
    /// Whether some of the functions slid upon stay at zero where the others do.
    dependent: bool,
    contacts: Vec<Contact>,
    /// Whether each guard is held at zero by contacts.
    guard_held: Vec<bool>,
    off: Vec<Off>,
    /// Whether the motion has come to a point that it does not leave.
    rests: bool,
    /// Whether the last step's error was the rounding of the time.
    noisy: bool,
    /// Sign of each watched expression; 0 if it stays at zero.
    watch_side: Vec<f64>,
    /// Whether each watched expression is held at zero: by surfaces that are slid upon, or because
    /// only switches move it.
    held: Vec<bool>,
    /// Guards and watched expressions that left zero at the step's beginning.
    fresh_guard: Vec<bool>,
    fresh_watch: Vec<bool>,
    /// Of each watched expression whose contact has opened, and that is zero to rounding since, by
    /// how much it may be beyond zero; else zero.
    released: Vec<f64>,
    /// Whether each watched expression is of bodies that touch and move on together.
    touches: Vec<bool>,
    /// Whether each watched expression had no speed where it left zero, and each guard.
    tangent: Vec<bool>,
    tangent_guard: Vec<bool>,
    /// The number of functions that are nearly zero and are being decided together; else zero.
    meeting: usize,
    /// Kinks that follow from what is decided, and are not decided with it.
    left_out: Vec<usize>,
    /// Guards that are zero to rounding where motion begins: their speeds are known to rounding,
    /// too.
    touching: Vec<bool>,
    /// The watched expression that leaves zero in the present step, with its rounding there.
    leaves: Option<(usize, f64)>,
    /// Of each guard whose zero was slid upon until now, by how much the speeds of its two sides
    /// differ; and the same of each watched expression held there, with the sign of the side that
    /// it leaves to.
    left: Vec<f64>,
    left_watch: Vec<f64>,
    /// The event of each watched expression; none for a section.
    event_of: Vec<Option<usize>>,
    /// Whether each event's condition holds.
    holds: Vec<bool>,
    /// Events whose conditions become true at the run's very beginning.
    at_start: Vec<usize>,
    /// Events whose conditions the switches of this moment make false.
    unmade: Vec<usize>,
    /// When each watched expression was passed last.
    passed_at: Vec<f64>,
    /// Whether the fields on the sides of several surfaces slid upon are no sums of what each adds.
    is_no_sum: bool,
    /// Whether a part of the states has come to rest, where neighbours have no common linear
    /// motion.
    part_rests: bool,
    /// Values of the watched expressions before a table's step.
    watched_before: Vec<f64>,
    /// Whether tables have stepped on to other pieces at this moment.
    tables_step: bool,
    /// The largest size of each state so far.
    size: Vec<f64>,
    /// By no less the errors of states are measured that come from zero.
    least: f64,
    /// Guards that are, or were, slid upon in higher order, and for each the states that their
    /// sides move.
    turned: Vec<(usize, Vec<bool>)>,
    /// The same of late: forgotten as a state falls far below it, and where an event sets it.
    lately: Vec<f64>,
    /// Each state's size before the steps below [`AT_THE_END`] of the time, and its time.
    before: Vec<f64>,
    before_at: f64,
    /// The rounding error of each speed, where a state has become small; else zero.
    noise: Vec<f64>,
    /// The error that the tolerance of other states leaves of the speed of each state that is no
    /// more than such errors; else zero.
    inherited: Vec<f64>,
    trains: Vec<Train>,
    switch_trains: Vec<Train>,
    signs: String,
    tangents: Option<tangent::Tangents>,
    growth: Option<tangent::Growth>,
    /// The next multiple that is recorded.
    next_record: f64,
    /// The small states as far as they have come.
    extents: Extents,
    /// Room for values.
    scratch: Vec<f64>,
    scale: Vec<f64>,
    room: Vec<f64>,
    samples: [Vec<f64>; 5],
    /// Ranges of variables and of watched values in a step.
    ranges: [Vec<Range>; 2],
    expansions: series::Expansions,
    reached: Option<&'a dyn Fn(f64) -> bool>,
    outcome: Outcome,
}

/// Follows a system and gives each recorded point to `observe`, which says whether more is wanted.
///
/// # Errors
/// If the equations are not complete, motion is not decided or leaves their domain, or the budget
/// of steps is used up. What was recorded until then has been given to `observe`.
pub fn follow(
    model: &Model,
    options: &Options,
    observe: &mut dyn FnMut(&Point) -> bool,
) -> Result<Outcome, HybridError> {
    follow_watched(model, options, observe, &|_| true)
}

/// [`follow`], with a word on the time `reached` now and then, whether or not something is
/// recorded; it says whether more is wanted.
///
/// # Errors
/// As [`follow`].
pub fn follow_watched(
    model: &Model,
    options: &Options,
    observe: &mut dyn FnMut(&Point) -> bool,
    reached: &dyn Fn(f64) -> bool,
) -> Result<Outcome, HybridError> {
    let mut found = follow_once(model, options, observe, reached);
    let again = |t: f64, events: u64| error_of_accumulation(model, options, reached, t, events);
    if let Ok(Outcome { ending: Ending::Zeno { t, error, event }, events, x, .. }) = &mut found {
        /// Accumulations by two methods are the same one if the bound is no larger part of the run.
        const SAME: f64 = 0.1;
        match again(*t, *events) {
            Some(more) if more <= SAME * (*t - options.t_start) || more.is_infinite() => {
                *error += more;
            }
            _ => {
                let why = format!(
                    "{event} comes ever faster, but not so by another method: give a smaller \
                        tolerance (--rtol), or another method (--method)"
                );
                return Err(HybridError::Stuck { t: *t, x: x.clone(), why });
            }
        }
    }
    if let Err(HybridError::Accumulation { t, error, x, surfaces }) = found {
        return Err(match again(t, 0) {
            Some(more) => HybridError::Accumulation { t, error: error + more, x, surfaces },
            None => HybridError::Stuck {
                t,
                x,
                why: format!(
                    "switches at {surfaces} come ever faster, but not so at ten times the \
                        tolerance: give a smaller one (--rtol), or another method (--method)"
                ),
            },
        });
    }
    found
}

fn follow_once(
    model: &Model,
    options: &Options,
    observe: &mut dyn FnMut(&Point) -> bool,
    reached: &dyn Fn(f64) -> bool,
) -> Result<Outcome, HybridError> {
    let mut follower = Follower::new(model, options)?;
    follower.reached = Some(reached);
    follower.run_whole(observe).map(|(outcome, _)| outcome)
}

/// Time that a run makes while its steps double.
#[derive(Default)]
struct Pace {
    /// Steps and time of the last look.
    since: (u64, f64),
    /// The time made before it.
    made: f64,
    /// Doublings in a row that made hardly more time than the one before.
    slower: u32,
    /// Doublings in a row at whose pace the end is out of reach.
    far: u32,
}

impl Pace {
    /// Looks at a run that came to time `t` by so many steps. Whether its time goes with the
    /// logarithm of its steps, or has long gone so slowly, that `most` do not reach its end.
    fn is_hopeless(&mut self, steps: u64, t: f64, t_end: f64, most: u64) -> bool {
        if steps < (2 * self.since.0).max(STEPS_OF_A_PACE) {
            return false;
        }
        let made = t - self.since.1;
        let all = (t_end - t) / made * (steps - self.since.0) as f64;
        self.slower = if made < NO_LONGER * self.made { self.slower + 1 } else { 0 };
        self.far = if all > most as f64 { self.far + 1 } else { 0 };
        (self.since, self.made) = ((steps, t), made);
        let doublings = (most / steps).checked_ilog2().unwrap_or(0) + 1;
        self.slower >= 3 && t + made * f64::from(doublings) < t_end || self.far >= FAR
    }
}

/// By how much integration and rounding may have moved the time `t` at which a run accumulates, by
/// runs of another method with a tolerance near rounding or, where that does not come so far, of
/// the same one with ten times the tolerance. None if nothing accumulates then; infinite if nothing
/// more was wanted meanwhile.
fn error_of_accumulation(
    model: &Model,
    options: &Options,
    reached: &dyn Fn(f64) -> bool,
    t: f64,
    events: u64,
) -> Option<f64> {
    const FINE: f64 = 1e-14;
    let quiet = Options { record: Record::Times { every: f64::INFINITY }, ..options.clone() };
    let method = if options.method == Method::Taylor { Method::Dopri5 } else { Method::Taylor };
    let finer = Options { method, rtol: FINE, atol: None, ..quiet.clone() };
    let atol = options.atol.map(|atol| 10.0 * atol);
    let coarser = Options { rtol: 10.0 * options.rtol, atol, ..quiet };
    // None where a run comes to its end without it, and nothing is known where one does not.
    let moved = |other: &Options| match follow_once(model, other, &mut |_| true, reached) {
        Ok(Outcome { ending: Ending::Zeno { t: other, .. }, .. })
        | Err(HybridError::Accumulation { t: other, .. }) => Some((t - other).abs()),
        Ok(Outcome { ending: Ending::Finished | Ending::Stopped(_), .. }) => Some(f64::NAN),
        _ => None,
    };
    let integration =
        moved(&finer).map(|by| 2.0 * by).or_else(|| moved(&coarser).map(|by| 3.0 * by));
    if integration.is_none() && !reached(t) {
        return Some(f64::INFINITY);
    }
    let integration = integration.filter(|by| !by.is_nan());
    Some(integration? + 8.0 * f64::EPSILON * t.abs() * events as f64)
}

/// Whether an event's expression is zero, to rounding, where a motion with these options starts.
/// Such a start waits until it is met again: the end of a run is a start of another only elsewhere.
///
/// # Errors
/// If the equations are not complete, or the motion is not decided there.
pub fn starts_on_an_event(model: &Model, options: &Options) -> Result<bool, HybridError> {
    let follower = Follower::new(model, options)?;
    let fresh = follower.fresh_watch.iter().enumerate();
    Ok(fresh.into_iter().any(|(i, fresh)| *fresh && follower.is_asked(i)))
}

/// [`follow_watched`], and whether the motion at a finished run's end rests: whether it goes on for
/// a time `longer` than that, and for two of the times between its events, without moving by more
/// than `within` says of the largest size of a state. Equations that see the time do not rest.
///
/// # Errors
/// As [`follow`].
pub fn follow_to_rest(
    model: &Model,
    options: &Options,
    observe: &mut dyn FnMut(&Point) -> bool,
    reached: &dyn Fn(f64) -> bool,
    longer: f64,
    within: &dyn Fn(f64) -> f64,
) -> Result<(Outcome, bool), HybridError> {
    let mut follower = Follower::new(model, options)?;
    follower.reached = Some(reached);
    let (outcome, mut follower) = follower.run_whole(observe)?;
    if outcome.ending != Ending::Finished || follower.equation.depends_on_time() {
        return Ok((outcome, false));
    }
    let between = |(event, train): (&crate::definition::Event, &Train)| match &event.when {
        When::Every(period) => follower.equation.value(period, follower.t, &follower.x),
        _ => train.times.last_chunk().map_or(0.0, |[a, b]| b - a),
    };
    let events = model.definition().events().iter().zip(&follower.trains);
    let longest = events.map(between).fold(0.0, f64::max);
    let more = Options {
        t_start: options.t_end,
        t_end: options.t_end + longer.max(2.0 * longest),
        record: Record::Times { every: f64::INFINITY },
        ..options.clone()
    };
    follower.options = &more;
    let within = within(follower.size.iter().fold(0.0_f64, |most, s| most.max(*s)));
    let stays = |x: &[f64]| x.iter().zip(&outcome.x).all(|(a, b)| (a - b).abs() <= within);
    // A motion that cannot go on is not at rest.
    let ending = follower.run(&mut |point| stays(point.x));
    let rests = ending == Ok(Ending::Finished) && stays(&follower.x);
    if ending == Ok(Ending::Interrupted) && !reached(follower.t) {
        return Ok((Outcome { ending: Ending::Interrupted, ..outcome }, false));
    }
    Ok((outcome, rests))
}

/// A state is small if it is below this part of its size of late, which is then forgotten by a
/// factor a step: at the ends of steps in which it crosses zero it seldom is.
const FORGET_BELOW: f64 = 1e-3;
const FORGET_BY: f64 = 0.1;

/// So many meetings on end in which no time passes are rounding in steps that are too short; twice
/// as many are none.
const LONG_QUIET: u32 = 20;

/// Steps between two words on the time reached.
const STEPS_BETWEEN_WORDS: u64 = 64;

/// A root of zero is left by so many implicit steps, whose length grows fivefold, or not at all.
const MOST_LEAVING: u32 = 1000;

/// So many steps that take a run less than this part of its time would not end.
const STEPS_BETWEEN_LOOKS: u64 = 16384;
const NO_TIME: f64 = 1e-12;
/// Nor would so many steps in a row of a few roundings of the time each.
const MOST_CREEPING: u32 = 256;
/// Taylor series that move a run by so small a part of the time it has come would not end, either.
const LITTLE_TIME: f64 = 1e-6;
/// A run is looked at each time its steps have doubled, from so many on. If twice the steps make
/// less than this times the time for three doublings on end, its time goes with their logarithm.
const STEPS_OF_A_PACE: u64 = 1 << 14;
/// Doublings at a pace by which the end is out of reach.
const FAR: u32 = 6;
const NO_LONGER: f64 = 1.5;

/// A speed counts up to so many times the mean one of a step, which that of t^12 is well within.
const MOST_OF_MEAN: f64 = 1e3;
/// Steps below this part of the time are those at the end of a solution that grows without bound.
const AT_THE_END: f64 = 1e-12;
/// There a state's way in a part of the run counts for its size up to so many times the one before.
const MOST_OF_SIZE: f64 = 1e6;

/// By no less the errors of states are measured that come from zero, in a run from `start`: by a
/// part of its largest state, if that is as small.
fn least_beside(start: &[f64]) -> f64 {
    const OF_LARGEST: f64 = 1e-50;
    let largest = start.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    if largest > 0.0 {
        LEAST_STATE.min(OF_LARGEST * largest).max(LEAST_FALLING)
    } else {
        LEAST_STATE
    }
}

/// Scale of each state's error in a step.
fn scale_now(follower: &Follower, step: &Step, out: &mut Vec<f64>) {
    let options = follower.options;
    let span = options.t_end - options.t_start;
    // (Implicit stages and series end there by themselves.)
    let resolves = matches!(options.method, Method::Dopri5 | Method::Lsoda);
    let scale = |i: usize| {
        let size = step.x[i].abs().max(step.y[i].abs());
        match options.atol {
            Some(atol) => atol + options.rtol * size,
            // By the state's own size; from zero on by what it moves in this step, or in a
            // millionth of the run if its speed lasts so long.
            None => {
                let moved = (step.y[i] - step.x[i]).abs();
                // A speed that is large at one place alone says little.
                let speed = step.k.iter().map(|k| k[i].abs()).fold(0.0, f64::max);
                let speed =
                    if moved > 0.0 { speed.min(MOST_OF_MEAN * moved / step.h) } else { speed };
                // A solution that grows without bound is fast, too, but has a size.
                let known = follower.scale_of(i);
                let put = follower.is_put(i);
                let before = follower.before[i];
                let grows = before > 0.0 && step.x[i].abs() > before.max(0.5 * follower.size[i]);
                let ends = grows && resolves && step.h < AT_THE_END * step.t.abs();
                let most = if ends { MOST_OF_SIZE * before } else { f64::INFINITY };
                // Before a millionth of the run is over no speed has been seen to last so long:
                // one that falls is taken to fall to zero.
                let [first, last] = [0, 6].map(|k: usize| step.k[k][i].abs());
                let time = 1e-6 * span;
                let falls = step.t - options.t_start < time && last < first;
                let lasts = if falls { time.min(step.h * first / (first - last)) } else { time };
                let least = (0.1 * moved).max((lasts * speed).min(most));
                // A rounding error without a bound leaves the old size.
                let size = size.max(if put { follower.width(i) } else { 0.01 * known });
                options.rtol * size.max(least)
                    + follower.noise_in(step.h, i).unwrap_or(0.0)
                    + 4.0 * step.h * follower.inherited[i]
                    + follower.least_of(i)
            }
        }
    };
    out.clear();
    out.extend((0..step.x.len()).map(scale));
}

/// The switching functions that the rule orders.
fn order(equation: &Equation, rule: &Intersection) -> Result<Vec<usize>, HybridError> {
    let Intersection::Order(named) = rule else { return Ok(Vec::new()) };
    let mut order = Vec::new();
    for e in named {
        let found = equation.switching(e).filter(|guard| !order.contains(guard));
        order.push(found.ok_or_else(|| {
            let known: Vec<String> =
                equation.guards.iter().map(|g| g.expression.to_string()).collect();
            let known = if known.is_empty() { "none".into() } else { known.join(", ") };
            let why = if equation.switching(e).is_some() {
                "stands twice"
            } else {
                "is no switching function"
            };
            HybridError::Bad(format!(
                "--intersection order: `{e}` {why}; give those that may meet, of {known}"
            ))
        })?);
    }
    Ok(order)
}

/// End of a brief step of length `h` of the classical Runge-Kutta method of order 4 (Kutta 1901).
fn a_little_later(
    field: &mut dyn FnMut(f64, &[f64]) -> Vec<f64>,
    t: f64,
    x: &[f64],
    h: f64,
) -> Vec<f64> {
    let ahead = |by: f64, slope: &[f64]| -> Vec<f64> {
        x.iter().zip(slope).map(|(x, f)| x + by * f).collect()
    };
    let k1 = field(t, x);
    let k2 = field(t + 0.5 * h, &ahead(0.5 * h, &k1));
    let k3 = field(t + 0.5 * h, &ahead(0.5 * h, &k2));
    let k4 = field(t + h, &ahead(h, &k3));
    let mean: Vec<f64> =
        (0..x.len()).map(|i| (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]) / 6.0).collect();
    ahead(h, &mean)
}

fn same(a: &[f64], b: &[f64]) -> bool {
    let close = |(a, b): (&f64, &f64)| (a - b).abs() <= 1e-13 * (a.abs() + b.abs());
    a.iter().zip(b).all(close)
}

/// Derivatives of watched values along a field.
struct Rates {
    field: Vec<f64>,
    /// First and second derivatives.
    first: Vec<f64>,
    second: Vec<f64>,
    /// The sizes of the terms that the first derivatives are sums of.
    terms: Vec<f64>,
}

impl Rates {
    /// The first derivative, zero where only rounding is left.
    fn first_or_zero(&self, i: usize) -> f64 {
        if self.first[i].abs() > SMALLEST_SLOPE * self.terms[i] { self.first[i] } else { 0.0 }
    }

    /// Whether no term moves the value, to first and second order.
    fn stands_still(&self, i: usize) -> bool {
        self.terms[i] == 0.0 && self.second[i] == 0.0
    }

    /// -1, 0 or +1: the sign of the first derivative, or of the second where the first is zero.
    fn direction(&self, i: usize) -> f64 {
        let first = self.first_or_zero(i);
        if first != 0.0 {
            first.signum()
        } else if self.second[i] != 0.0 && self.second[i].is_finite() {
            self.second[i].signum()
        } else {
            0.0
        }
    }
}

impl<'a> Follower<'a> {
    fn new(model: &'a Model, options: &'a Options) -> Result<Self, HybridError> {
        let section = match &options.record {
            Record::Section(e) => Some(e),
            _ => None,
        };
        let equation = Equation::new(model, section)?;
        let n = equation.dimension();
        let x = match &options.start {
            Some(x) => x.clone(),
            None => model.start().map_err(EquationError::from)?.ok_or_else(|| {
                HybridError::Start(format!(
                    "the system suggests no initial state; give one by --start: a number for each \
                        of {}",
                    model.coordinates().join(", ")
                ))
            })?,
        };
        if x.len() != n || !x.iter().all(|v| v.is_finite()) {
            let states = model.coordinates().join(", ");
            return Err(HybridError::Start(format!(
                "the initial state is {x:?}; give a finite number for each of {states}"
            )));
        }
        let modes = model.definition().modes().len();
        if options.mode >= modes.max(1) {
            return Err(HybridError::Start(format!(
                "there is no mode number {}: there are {modes}",
                options.mode
            )));
        }
        let (t0, t1) = (options.t_start, options.t_end);
        if !(t0.is_finite() && t1.is_finite() && t1 > t0) {
            return Err(HybridError::Bad(format!(
                "the run goes from t = {t0} to {t1}: give an end time after the start (--t-end, \
                    --t-start)"
            )));
        }
        for ((name, entry), table) in model.definition().tables().iter().zip(&equation.tables) {
            let (first, last) = table.range();
            if t0 < first || t1 > last {
                return Err(HybridError::Bad(format!(
                    "the table `{name}` ({}) goes from t = {first} to {last}, and the run from \
                        {t0} to {t1}: stay within it (--t-start, --t-end)",
                    entry.file
                )));
            }
        }
        let events = model.definition().events();
        let mut event_of: Vec<Option<usize>> = Vec::new();
        event_of.extend(
            (0..events.len()).filter(|i| matches!(events[*i].when, When::Zero(..))).map(Some),
        );
        event_of.resize(equation.watched.len(), None);
        let config = Configuration {
            mode: options.mode,
            sides: vec![1.0; equation.guards.len()],
            pieces: equation.tables.iter().map(|t| t.piece(t0)).collect(),
            slid: Vec::new(),
            still: Vec::new(),
            higher: Vec::new(),
        };
        let order = order(&equation, &options.intersection)?;
        let guards = equation.guards.len();
        let watched = equation.watched.len();
        let compiled = equation.compiled(&config);
        let mut follower = Self {
            n,
            t: t0,
            compiled,
            variables: vec![0.0; equation.variables()],
            sliding: Vec::new(),
            slides: vec![false; guards],
            along: vec![0.0; guards],
            base: Vec::new(),
            beyond: Vec::new(),
            corners: Vec::new(),
            cells: None,
            order,
            separate: None,
            dependent: false,
            contacts: Vec::new(),
            guard_held: vec![false; guards],
            off: Vec::new(),
            rests: false,
            noisy: false,
            watch_side: vec![0.0; watched],
            held: vec![false; watched],
            fresh_guard: vec![false; guards],
            fresh_watch: vec![false; watched],
            touches: vec![false; watched],
            tangent: vec![false; watched],
            tangent_guard: vec![false; guards],
            meeting: 0,
            left_out: Vec::new(),
            touching: vec![false; guards],
            released: vec![0.0; watched],
            leaves: None,
            left: vec![0.0; guards],
            left_watch: vec![0.0; watched],
            event_of,
            holds: vec![false; events.len()],
            at_start: Vec::new(),
            unmade: Vec::new(),
            passed_at: vec![f64::NEG_INFINITY; watched],
            is_no_sum: false,
            part_rests: false,
            watched_before: Vec::new(),
            tables_step: false,
            size: x.iter().map(|v| v.abs()).collect(),
            least: least_beside(&x),
            turned: Vec::new(),
            lately: x.iter().map(|v| v.abs()).collect(),
            before: x.iter().map(|v| v.abs()).collect(),
            before_at: options.t_start,
            noise: vec![0.0; n],
            inherited: vec![0.0; n],
            trains: vec![Train::default(); events.len()],
            switch_trains: vec![Train::default(); guards],
            signs: String::new(),
            tangents: None,
            growth: None,
            next_record: f64::INFINITY,
            extents: options.extents.clone(),
            scratch: Vec::new(),
            scale: Vec::new(),
            room: Vec::new(),
            samples: Default::default(),
            ranges: Default::default(),
            expansions: Default::default(),
            reached: None,
            outcome: Outcome {
                ending: Ending::Finished,
                t: t0,
                x: x.clone(),
                mode: options.mode,
                steps: 0,
                switches: 0,
                events: 0,
                sizes: Vec::new(),
            },
            config,
            x,
            equation,
            model,
            options,
        };
        follower.settle_afresh(&[])?;
        if !follower.sliding.is_empty() {
            follower.variables[..n].copy_from_slice(&follower.x);
            follower.variables[n] = follower.t;
            let mut field = vec![0.0; n];
            follower.compiled.field.evaluate(&follower.variables, &mut field);
            if !field.iter().all(|f| f.is_finite()) {
                return Err(follower.left_domain(t0, &follower.x.clone()));
            }
        }
        for watched in 0..follower.watch_side.len() {
            follower.begin_watching(watched, false, false);
        }
        // An expression that is zero at the start fires when it is next met.
        follower.touches.fill(false);
        follower.rest_on_stops()?;
        follower.new_conditions();
        follower.at_start = follower.true_right_after();
        Ok(follower)
    }

    /// The run, and the follower as it is at its end.
    fn run_whole(
        mut self,
        observe: &mut dyn FnMut(&Point) -> bool,
    ) -> Result<(Outcome, Self), HybridError> {
        let ending = self.run(observe)?;
        self.outcome.ending = ending;
        self.outcome.t = self.t;
        self.outcome.x = self.x.clone();
        self.outcome.mode = self.config.mode;
        self.outcome.sizes = self.size.clone();
        Ok((self.outcome.clone(), self))
    }

    fn run(&mut self, observe: &mut dyn FnMut(&Point) -> bool) -> Result<Ending, HybridError> {
        let model = self.model;
        let definition = model.definition();
        let at_start = std::mem::take(&mut self.at_start);
        let mut clock = Clock::new(self, &at_start)?;
        let mut step = Step::new(self.n);
        let mut h = 0.0;
        // The next implicit step where there is no series, and how many there were.
        let (mut implicit, mut leaving, mut creeping) = (0.0, 0, 0);
        let mut quiet = 0;
        // Whether the last step was made shorter than its tolerance asked for.
        let mut shortened = false;
        let mut last_met = f64::NEG_INFINITY;
        let mut looked_at = (self.outcome.steps, self.t);
        let mut pace = Pace { since: (0, self.t), ..Pace::default() };
        if !matches!(self.options.record, Record::Section(_)) {
            if !self.emit(self.t, None, observe) {
                return Ok(Ending::Interrupted);
            }
            if let Record::Times { every } = self.options.record {
                self.next_record = ((self.t / every).floor() + 1.0) * every;
            }
        }
        let (mut last_values, mut list, mut found) = (Vec::new(), Vec::new(), Vec::new());
        let mut room = vec![0.0; self.n];
        loop {
            // Times at which something is known to happen.
            if clock.next().is_some_and(|time| time <= self.t) {
                let met = self.met_here();
                if let Some(ending) = self.on_time(&mut clock, definition, &met, observe)? {
                    return Ok(ending);
                }
                h = 0.0;
                continue;
            }
            if self.t >= self.options.t_end {
                return Ok(Ending::Finished);
            }
            if self.rests {
                let until = clock.next().unwrap_or(f64::INFINITY).min(self.options.t_end);
                if !self.rest_until(until, observe)? {
                    return Ok(Ending::Interrupted);
                }
                continue;
            }
            if self.outcome.steps.is_multiple_of(STEPS_BETWEEN_WORDS)
                && self.reached.is_some_and(|go_on| !go_on(self.t))
            {
                return Ok(Ending::Interrupted);
            }
            if self.outcome.steps >= looked_at.0 + STEPS_BETWEEN_LOOKS {
                let before = std::mem::replace(&mut looked_at, (self.outcome.steps, self.t)).1;
                let made = self.t - before;
                // Before the end of a root's domain a series reaches as far as the motion does.
                let little = made <= LITTLE_TIME * (self.t - self.options.t_start);
                if self.options.method == Method::Taylor && little && self.breaks_ahead(made) {
                    return Err(self.left_domain(self.t, &self.x.clone()));
                }
                if made <= NO_TIME * (self.options.t_end - self.options.t_start) {
                    let why =
                        "steps, events or switches follow each other without end in no time: \
                        describe by one [[event]] what happens there, or give another --method"
                            .into();
                    return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
                }
                let Outcome { steps, switches, events, .. } = self.outcome;
                let (t_end, most) = (self.options.t_end, self.options.max_steps);
                let hopeless = pace.is_hopeless(steps, self.t, t_end, most);
                if hopeless && switches + events <= steps / 100 {
                    let tolerance = match self.options.atol {
                        None => "give states near zero an absolute tolerance (--atol), ",
                        Some(_) => "",
                    };
                    let why = format!(
                        "steps stay too short ({steps} so far; if it goes on so, the end takes \
                            more than --max-steps allows): {tolerance}give another --method, end \
                            the run before (--t-end), or smooth what turns so fast there, as \
                            sqrt(x^2 + y^2 + 1e-12) for a length"
                    );
                    return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
                }
                if hopeless {
                    let why = format!(
                        "switches or events follow each other ever faster, as chatter ({steps} \
                        steps so far; if it goes on so, the end takes more than --max-steps \
                        allows). End the run before (--t-end), or write a smooth function for \
                        the switch, as tanh(u/1e-3) for sign(u)"
                    );
                    return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
                }
            }
            if self.outcome.steps >= self.options.max_steps {
                return Err(HybridError::Budget { steps: self.outcome.steps, t: self.t });
            }
            creeping = if step.h <= 4.0 * f64::EPSILON * self.t.abs() { creeping + 1 } else { 0 };
            if creeping == MOST_CREEPING && self.breaks_ahead(f64::from(creeping) * step.h) {
                return Err(self.left_domain(self.t, &self.x.clone()));
            }
            let short = step.h < SHORT_STEP * (self.options.t_end - self.options.t_start);
            if short && let Some(met) = self.lands_at_a_root(clock.next().unwrap_or(f64::INFINITY))
            {
                h = 0.0;
                let before = self.before(&met)?;
                if let Some(ending) = self.meet(definition, &met, &[], observe)? {
                    return Ok(ending);
                }
                self.after(before)?;
                continue;
            }
            // (The multistep method would lose its history at each.)
            let halves = matches!(self.options.method, Method::Dopri5 | Method::Radau5);
            if halves
                && short
                && shortened
                && self.is_just_before_an_edge()
                && self.land_at_an_edge()?
            {
                h = 0.0;
                continue;
            }
            self.open_pulled()?;
            if self.is_no_sum {
                return Err(self.no_sum());
            }
            if let Some((event, error)) = self.pressed_without_rest() {
                let event = definition.events()[event].name.clone();
                let quiet = matches!(self.options.record, Record::Section(_));
                if !quiet && !self.emit(self.t, Some(&event), observe) {
                    return Ok(Ending::Interrupted);
                }
                return Ok(Ending::Zeno { event, t: self.t, error });
            }
            if !self.x.iter().all(|v| v.is_finite()) {
                return Err(self.left_domain(step.t, &step.x));
            }
            step.t = self.t;
            step.x.copy_from_slice(&self.x);
            self.rhs(step.t, &step.x, &mut room);
            step.k[0].copy_from_slice(&room);
            self.noise.fill(0.0);
            self.inherited.fill(0.0);
            if !room.iter().all(|v| v.is_finite()) {
                if self.put_beyond() || self.comes_to_rest(self.t, true) {
                    continue;
                }
                return Err(self.left_domain(step.t, &step.x));
            }
            if self.is_blind(step.h) && self.is_at_a_pole(&room) {
                return Err(self.left_domain(step.t, &step.x));
            }
            step.jacobian = None;
            if self.options.method == Method::Radau5 {
                step.jacobian = Some(self.finite_jacobian(step.t, &step.x));
            }
            let mut no_series = None;
            let leaves = leaving < MOST_LEAVING && self.is_stiff_behind_a_root(&step, implicit);
            if leaves {
                leaving += 1;
                (step.series, step.multistep) = (None, None);
                step.jacobian = Some(self.finite_jacobian(step.t, &step.x));
                h = if h > 0.0 { implicit.min(h) } else { implicit };
            } else if self.options.method == Method::Taylor {
                no_series = match self.expand(&mut step) {
                    Ok(state) => state,
                    Err(_) if self.goes_on_at_an_edge()? => continue,
                    Err(error) => return Err(error),
                };
                // If switches or events are frequent, a step is no longer than the time between
                // them.
                let longest = if h > 0.0 { h } else { f64::INFINITY };
                let reach = match no_series {
                    None => self.step_of_series(&step)?,
                    Some(_) => f64::INFINITY,
                };
                match no_series {
                    // Beside the root series reach less far than they do.
                    None if reach < implicit && leaving < MOST_LEAVING => {
                        leaving += 1;
                        step.series = None;
                        step.jacobian = Some(self.finite_jacobian(step.t, &step.x));
                        h = implicit.min(longest);
                    }
                    None => {
                        (implicit, leaving) = (0.0, 0);
                        h = reach.min(longest);
                        // Before a switch at which a root ends series reach ever less far.
                        let short = h < SHORT_STEP * (self.options.t_end - self.options.t_start);
                        if short && self.breaks_ahead(10.0 * h) && self.land_at_an_edge()? {
                            h = 0.0;
                            continue;
                        }
                    }
                    Some(_) if self.goes_on_at_an_edge()? => continue,
                    Some(state) if leaving == MOST_LEAVING && !self.overflows() => {
                        return Err(self.has_no_series(&step, state));
                    }
                    // Implicit steps leave a root of zero.
                    Some(_) => {
                        leaving = (leaving + 1).min(MOST_LEAVING);
                        step.series = None;
                        step.jacobian = Some(self.finite_jacobian(step.t, &step.x));
                        if implicit == 0.0 {
                            implicit = self.first_step(&room);
                        }
                        h = implicit.min(longest);
                    }
                }
            } else if self.options.method == Method::Lsoda {
                self.take_up(&mut step);
                h = if h > 0.0 { h } else { f64::INFINITY };
            } else if h == 0.0 {
                h = self.first_step(&room);
            }
            if !leaves && self.options.method != Method::Taylor {
                (implicit, leaving) = (0.0, 0);
            }
            let stop = clock.next().unwrap_or(f64::INFINITY).min(self.options.t_end);
            let mut wanted = h.min(self.options.max_step);
            let to_stop = self.t + wanted * 1.000_001 >= stop;
            if to_stop {
                wanted = stop - self.t;
            }
            let accepted = self.step_within(&mut step, wanted, &mut list);
            let Some(Accepted { length: wanted, error, parts, rejected }) = accepted else {
                if self.goes_on_at_an_edge()? {
                    h = 0.0;
                    continue;
                }
                return Err(match no_series {
                    Some(state) => self.has_no_series(&step, state),
                    None => self.left_domain(self.t, &step.x.clone()),
                });
            };
            if self.leaves_rest(&step) {
                continue;
            }
            shortened = rejected;
            let stopped = to_stop && !rejected;
            let most = if rejected { 1.2 } else { 5.0 };
            let factor = match error {
                0.0 => most,
                _ => (0.9 * rough_pow(error, -0.2)).clamp(0.2, most),
            };
            if self.options.method != Method::Radau5 && step.jacobian.is_some() {
                implicit = factor * wanted;
            }
            let h_next = match self.options.method {
                // The next step's series, or the history, says it.
                Method::Taylor | Method::Lsoda => f64::INFINITY,
                _ => wanted * factor,
            };
            self.find(&step, &list, &parts, &mut last_values, &mut found);
            let earliest = found.iter().map(|(theta, _)| *theta).fold(f64::INFINITY, f64::min);
            // The domain of what decides the field ends before anything is met: shorter steps come
            // nearer to its end.
            let ends = |((sought, _), value): (&(Sought, f64), &f64)| {
                value.is_nan()
                    && matches!(sought, Sought::Guard { guard,
                        .. } if self.compiled.deciding.contains(guard))
            };
            if !earliest.is_finite() && list.iter().zip(&last_values).any(ends) {
                h = search::SHORTER * wanted;
                if self.t + h == self.t
                    || h <= f64::EPSILON * 1e-6 * (self.options.t_end - self.options.t_start)
                {
                    if self.land_at_an_edge()? {
                        h = 0.0;
                        continue;
                    }
                    return Err(self.left_domain(self.t, &self.x.clone()));
                }
                continue;
            }
            // Together is what no rounding of the time tells apart.
            let together = (64.0 * f64::EPSILON * self.t.abs().max(wanted) / wanted).min(1e-9);
            let mut met: Vec<Sought> = found
                .iter()
                .filter(|(theta, _)| *theta <= earliest + together)
                .map(|(_, sought)| *sought)
                .collect();
            if earliest.is_finite() {
                self.tell_poles(&step, earliest, &mut met);
                self.land(&mut step, earliest * wanted, wanted, met[0]);
                // A layer just before what is met, as |x|/(|x| + 1e-9) has one, is seen by the
                // step that ends there alone.
                if let Some(shorter) = self.landed_too_far(&step) {
                    h = shorter;
                    continue;
                }
            }
            // The step stands.
            let length = step.h;
            self.carry(&step);
            self.outcome.steps += 1;
            let end = if stopped && !earliest.is_finite() { stop } else { self.t + length };
            if !self.record(&step, end, observe) {
                return Ok(Ending::Interrupted);
            }
            for i in 0..self.n {
                let size = step.y[i].abs();
                self.size[i] = self.size[i].max(size);
                self.lately[i] = self.lately[i].max(size);
                if size < FORGET_BELOW * self.lately[i] {
                    self.lately[i] *= FORGET_BY;
                }
            }
            let progress = end > self.t;
            self.t = end;
            self.x.copy_from_slice(&step.y);
            if end - self.before_at > AT_THE_END * end.abs() {
                self.before.iter_mut().zip(&self.x).for_each(|(before, x)| *before = x.abs());
                self.before_at = end;
            }
            self.underflow(&mut step);
            self.note_growth(end);
            if !earliest.is_finite() && self.along.iter().any(|along| *along != 0.0) {
                self.tell_along(&list, &last_values);
            }
            if progress {
                self.clear_fresh(&list, &last_values, earliest.is_finite());
                self.clear_released();
            }
            h = if earliest.is_finite() {
                // If switches or events are frequent, a step is about as long as the time between
                // them.
                let between = std::mem::replace(&mut last_met, self.t);
                // Those in no time are rounding, which longer steps leave behind.
                let rounding =
                    f64::EPSILON * self.t.abs() * f64::from(1_u32 << quiet.min(LONG_QUIET));
                let between = 1.5 * (self.t - between).max(rounding);
                // Steps in which nothing is told from rounding grow at last.
                if quiet < LONG_QUIET { h_next.max(h).min(between) } else { h_next.max(h) }
            } else {
                h_next
            };
            if !earliest.is_finite() {
                if !self.sliding.is_empty() || !self.contacts.is_empty() {
                    self.project();
                }
                self.keep(&mut step);
                continue;
            }
            // Sliding ends, and goes on behind a switch, on its surface.
            if !self.sliding.is_empty() {
                self.project();
                self.put_where_met(&met);
            } else if !self.contacts.is_empty() {
                self.place_contacts();
            }
            quiet = if progress { 0 } else { quiet + 1 };
            if quiet > 2 * LONG_QUIET {
                let why = "the same surface is met again and again without time passing: the \
                    motion there is not resolved; smooth the switch, or describe what holds there \
                    by an [[event]]"
                    .into();
                return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
            }
            let rounding = 4.0 * f64::EPSILON * self.t.abs().max(length);
            let ending = match clock.next().filter(|time| *time - self.t <= rounding) {
                Some(time) => {
                    self.t = time;
                    self.meet_here(&mut met);
                    self.on_time(&mut clock, definition, &met, observe)?
                }
                None => {
                    // Functions that are zero to rounding where sliding ends decide with it.
                    if met.iter().any(|m| matches!(m, Sought::Leave { .. } | Sought::Repelling)) {
                        self.meet_here(&mut met);
                    }
                    let before = self.before(&met)?;
                    let ending = self.meet(definition, &met, &[], observe)?;
                    if ending.is_none() {
                        self.after(before)?;
                    }
                    ending
                }
            };
            if let Some(ending) = ending {
                return Ok(ending);
            }
        }
    }

    /// Whether implicit steps that leave a root of zero go on with one of length `h`: behind the
    /// root of what rises slowly explicit ones and series would be far shorter than the time since.
    fn is_stiff_behind_a_root(&mut self, step: &Step, h: f64) -> bool {
        /// The product of a step and a slope that explicit steps bear.
        const STIFF: f64 = 1.0;
        let n = self.n;
        h > 0.0 && {
            let jacobian = self.jacobian(step.t, &step.x);
            (0..n).any(|i| h * -jacobian[i * n + i] > STIFF)
        }
    }

    /// The rounding error that a state's speed makes in a step of length `h`, as far as it is
    /// known. Of a free state that is far smaller than it was it is no more than the tolerance of
    /// its former size: what would grow so far is none that the step resolves.
    fn noise_in(&self, h: f64, i: usize) -> Option<f64> {
        const FALLEN: f64 = 1e-3;
        let noise = 4.0 * h * self.noise[i];
        let free = self.sliding.is_empty() && self.contacts.is_empty();
        let fallen = free && self.x[i].abs() < FALLEN * self.size[i];
        let most = if fallen { self.options.rtol * self.size[i] } else { f64::INFINITY };
        self.noise[i].is_finite().then(|| noise.min(most))
    }

    /// By no less the errors of a state are measured.
    fn least_of(&self, i: usize) -> f64 {
        if self.size[i] > LEAST_STATE { LEAST_FALLING } else { self.least }
    }

    /// Makes the states zero that fall below [`UNDERFLOW`] together.
    fn underflow(&mut self, step: &mut Step) {
        let both = || step.x.iter().zip(&step.y).map(|(x, y)| (x.abs(), y.abs()));
        let tiny = |(x, y): &(f64, f64)| x.max(*y) < UNDERFLOW;
        let most =
            both().filter(tiny).fold((0.0_f64, 0.0_f64), |m, s| (m.0.max(s.0), m.1.max(s.1)));
        if most.1 < most.0 {
            let falling = both().map(|s| tiny(&s));
            self.x.iter_mut().zip(falling).filter(|(_, f)| *f).for_each(|(x, _)| *x = 0.0);
            // The multistep method's history has another state.
            if let Some(own) = &mut step.multistep {
                own.made = None;
            }
        }
    }

    /// Whether a function that rests at zero is not zero at a step's end: the step is to be made
    /// again, with the function on the side where it is then.
    fn leaves_rest(&mut self, step: &Step) -> bool {
        let active = self.compiled.active.iter().enumerate();
        let resting: Vec<(usize, usize)> = active
            .map(|(place, guard)| (place, *guard))
            .filter(|(_, guard)| {
                self.equation.rests(*guard, &self.config) && !self.guard_held[*guard]
            })
            .collect();
        if resting.is_empty() {
            return false;
        }
        self.variables[..self.n].copy_from_slice(&step.y);
        self.variables[self.n] = step.t + step.h;
        let mut values = vec![0.0; self.compiled.outputs];
        self.compiled.watched.evaluate(&self.variables, &mut values);
        let mut config = self.config.clone();
        // Functions that follow from a surface that has just been left leave zero as it does.
        let left = self.left.iter().fold(0.0_f64, |most, left| most.max(*left));
        for (place, guard) in resting {
            let small = 1e-13 * self.magnitude(&self.equation.guards[guard].expression);
            if values[place].abs() > small {
                config.sides[guard] = values[place].signum();
                self.fresh_guard[guard] = true;
                self.tangent_guard[guard] = false;
                self.left[guard] = left;
            }
        }
        let leaves = config != self.config;
        if leaves {
            self.ask_new(&mut config);
            let sliding = self.sliding.clone();
            self.adopt(config, sliding);
        }
        leaves
    }

    /// Makes a step of at most this length that the tolerance allows and that has seen what there
    /// is, with the list of what is [sought](Self::sought) in it; none if none is short enough.
    fn step_within(
        &mut self,
        step: &mut Step,
        longest: f64,
        list: &mut Vec<(Sought, f64)>,
    ) -> Option<Accepted> {
        let mut scale = std::mem::take(&mut self.scale);
        let accepted = match self.options.method {
            Method::Lsoda => {
                let made = self.multistep_within(step, longest, &mut scale, list);
                if made.is_none() && self.begins_at_a_root(step) {
                    (step.multistep, step.series) = (None, None);
                    step.jacobian = Some(self.finite_jacobian(step.t, &step.x));
                    let length = longest.min(self.first_step(&step.k[0]));
                    self.step_in_units(step, length, &mut scale, list)
                } else {
                    made
                }
            }
            _ => self.step_in_units(step, longest, &mut scale, list),
        };
        self.scale = scale;
        accepted
    }

    fn step_in_units(
        &mut self,
        step: &mut Step,
        longest: f64,
        scale: &mut Vec<f64>,
        list: &mut Vec<(Sought, f64)>,
    ) -> Option<Accepted> {
        /// So often a step without numbers is made shorter before it is made implicit.
        const EXPLICIT: usize = 8;
        let mut length = longest;
        let (mut noise, mut noted) = (None, step.series.is_some());
        for tried in 0..=MOST_SHORTENINGS {
            step.take(length, &mut |t, x, out| self.rhs(t, x, out));
            scale_now(self, step, scale);
            if (tried > 0 || self.noisy) && length <= 1e8 * f64::EPSILON * self.t.abs() {
                // Whether it is the rounding of the time that keeps the error large, as in the step
                // before.
                let noise = noise.get_or_insert_with(|| self.noise_of_time(step));
                let noise = self.noise_passed_on(step, noise);
                scale.iter_mut().zip(noise).for_each(|(s, noise)| *s += 4.0 * length * noise);
            }
            let mut error = step.error(&|i| scale[i]);
            if error > 1.0 && !noted {
                // Whether rounding errors of speeds, or errors of other states, are a part of it.
                noted = true;
                if self.note_noise(step) | self.note_inherited(step) {
                    scale_now(self, step, scale);
                    error = step.error(&|i| scale[i]);
                }
            }
            let factor = if error <= 1.0 {
                // The structure that the step missed begins at `unseen`: the step is made to end
                // before it.
                let unseen = self.unseen(step, scale).map(|theta| theta.clamp(0.05, 0.9));
                match unseen.or_else(|| self.too_long_for_tangents(step)) {
                    Some(factor) => factor,
                    None => {
                        self.sought(step, list);
                        if let Some(parts) = self.parts(step, list) {
                            self.noisy = noise.is_some();
                            return Some(Accepted { length, error, parts, rejected: tried > 0 });
                        }
                        search::SHORTER
                    }
                }
            } else if error.is_nan()
                && (tried == EXPLICIT || self.t + 0.1 * length == self.t)
                && step.explicit()
                && self.begins_at_a_root(step)
            {
                // Stages beyond zero are no numbers, however short the step is.
                step.jacobian = Some(self.finite_jacobian(step.t, &step.x));
                length = longest;
                1.0
            } else if error.is_nan() {
                0.1
            } else {
                (0.9 * rough_pow(error, -1.0 / step.power())).clamp(0.1, 0.9)
            };
            length *= factor;
            if self.t + length == self.t {
                break;
            }
        }
        None
    }

    /// By how much the field changes when the time at a step's beginning changes by its rounding.
    fn noise_of_time(&mut self, step: &Step) -> Vec<f64> {
        let (mut before, mut after) = (vec![0.0; self.n], vec![0.0; self.n]);
        let rounding = 2.0 * f64::EPSILON * step.t.abs();
        self.rhs(step.t - rounding, &step.x, &mut before);
        self.rhs(step.t + rounding, &step.x, &mut after);
        let change = |((a, now), b): ((&f64, &f64), &f64)| {
            // Before the beginning of a root's domain there is no number.
            if a.is_nan() { (b - now).abs() } else { (b - a).abs() }
        };
        before.iter().zip(&step.k[0]).zip(&after).map(change).collect()
    }

    /// The noise of speeds, and that which others have by it at the end of the step.
    fn noise_passed_on(&mut self, step: &Step, noise: &[f64]) -> Vec<f64> {
        let moved: Vec<f64> = step.x.iter().zip(noise).map(|(x, n)| x + step.h * n).collect();
        let mut there = vec![0.0; self.n];
        self.rhs(step.t, &moved, &mut there);
        let passed = there.iter().zip(&step.k[0]).map(|(a, b)| (a - b).abs());
        let sum = |(noise, passed): (&f64, f64)| {
            if passed.is_finite() { noise + passed } else { *noise }
        };
        noise.iter().zip(passed).map(sum).collect()
    }

    /// Handles the events due at the present time together with the conditions met here.
    fn on_time(
        &mut self,
        clock: &mut Clock,
        definition: &crate::Definition,
        met: &[Sought],
        observe: &mut dyn FnMut(&Point) -> bool,
    ) -> Result<Option<Ending>, HybridError> {
        let due = clock.take(self.t);
        let (mut config, sliding) = (self.config.clone(), self.sliding.clone());
        config.pieces = self.equation.tables.iter().map(|table| table.piece(self.t)).collect();
        let (asked, values) = (self.compiled.active.clone(), self.watched_values());
        self.tables_step = config.pieces != self.config.pieces;
        let mut met: Vec<(Sought, Option<Found>)> =
            met.iter().map(|sought| (*sought, self.found_at(*sought))).collect();
        if self.tables_step {
            self.watched_before = values[asked.len()..].to_vec();
        }
        self.adopt(config, sliding.clone());
        if !self.equation.tables.is_empty() {
            // A table's jump may carry switching functions over zero, or away from it, those that
            // are met at this moment, too.
            let left = self.leave_by_jump(&asked, &values);
            met.retain(|(sought, _)| match *sought {
                Sought::Guard { guard, .. } => !left.contains(&guard),
                Sought::Repelling => !sliding.iter().any(|guard| left.contains(guard)),
                _ => true,
            });
            let zero = self.sliding.clone();
            self.follow_jumps(&zero)?;
        }
        let met: Vec<Sought> =
            met.into_iter().filter_map(|(sought, found)| self.found_again(sought, found)).collect();
        let before = self.before(&met)?;
        let ending = self.meet(definition, &met, &due, observe)?;
        if ending.is_none() {
            self.after(before)?;
        }
        if ending.is_none() && !self.equation.tables.is_empty() {
            // A table's jump may let sliding end, make switching functions jump, and press bodies
            // against their stops.
            let (zero, none) = (self.sliding.clone(), vec![false; self.slides.len()]);
            self.decide(&zero, &none)?;
            self.rest_on_stops()?;
        }
        Ok(ending)
    }

    /// The thing that is met at a place of a list that the present equations make.
    fn found_at(&self, sought: Sought) -> Option<Found> {
        match sought {
            Sought::Leave { place, .. } => Some(Found::Slid(self.sliding[place])),
            Sought::Release(place) => Some(Found::Contact(self.contacts[place].watched)),
            Sought::Beyond(at) => {
                let Beyond { place, guard, .. } = self.beyond[at];
                Some(Found::Kink { slid: self.sliding[place], guard })
            }
            _ => None,
        }
    }

    /// The same condition among the equations of a later moment, if it is one of theirs. Whether
    /// sliding goes on where a table has stepped, its new piece decides.
    fn found_again(&self, sought: Sought, found: Option<Found>) -> Option<Sought> {
        let slid_at = |slid: usize| self.sliding.iter().position(|guard| *guard == slid);
        match (sought, found) {
            (Sought::Leave { .. } | Sought::Repelling, _) if self.tables_step => None,
            (Sought::Leave { plus, .. }, Some(Found::Slid(slid))) => {
                slid_at(slid).map(|place| Sought::Leave { place, plus })
            }
            (_, Some(Found::Contact(watched))) => {
                self.contacts.iter().position(|c| c.watched == watched).map(Sought::Release)
            }
            (_, Some(Found::Kink { slid, guard })) => {
                let place = slid_at(slid)?;
                let at = self.beyond.iter().position(|b| b.place == place && b.guard == guard);
                at.map(Sought::Beyond)
            }
            _ => Some(sought),
        }
    }

    /// Guards and watched expressions that are zero to rounding and about to pass it.
    fn met_here(&mut self) -> Vec<Sought> {
        let active = self.compiled.active.iter().enumerate();
        let moves = |guard: usize| !self.slides[guard] && !self.fresh_guard[guard];
        // Each with its place and the way in which it passes.
        let mut near: Vec<(Sought, usize, f64)> = Vec::new();
        for (place, guard) in active.filter(|(_, guard)| moves(**guard)) {
            let (guard, side) = (*guard, self.config.sides[*guard]);
            if self.equation.rests(guard, &self.config) || self.side_of(guard).is_some() {
                continue;
            }
            let whole = self.equation.guards[guard].whole;
            let upper = whole && self.boundary(guard) != side;
            let way = if upper || !whole && side < 0.0 { 1.0 } else { -1.0 };
            near.push((Sought::Guard { guard, upper }, place, way));
        }
        for i in 0..self.watch_side.len() {
            let e = &self.equation.watched[i];
            let (side, value) = (self.watch_side[i], self.equation.value(e, self.t, &self.x));
            let may_pass = side != 0.0 && !self.fresh_watch[i] && self.is_asked(i);
            if may_pass && value.abs() <= 1e-14 * self.magnitude(e) {
                near.push((Sought::Watched(i), self.compiled.active.len() + i, -side));
            }
        }
        if near.is_empty() {
            return Vec::new();
        }
        // Places are those of the present programs, which may ask more than the sides do.
        let config = self.config.clone();
        let plain = self.equation.compiled(&config);
        let more = |guard: &&usize| !plain.active.contains(*guard);
        let also: Vec<usize> = self.compiled.active.iter().filter(more).copied().collect();
        let (_, mut rates) = self.rates_to_order(&config, &also, true);
        let mut direction = Vec::new();
        for (sought, place, _) in &near {
            let e = match *sought {
                Sought::Watched(i) => &self.equation.watched[i],
                Sought::Guard { guard, .. } => &self.equation.guards[guard].expression,
                _ => continue,
            };
            if rates.first[*place].abs() <= self.rounding_of_slope(e, rates.second[*place]) {
                rates.first[*place] = 0.0;
            }
            direction.push(rates.direction(*place));
        }
        if !self.sliding.is_empty() {
            let field = self.velocity();
            let along = Self::along(&self.compiled, &self.variables, &field);
            for ((_, place, _), direction) in near.iter().zip(&mut direction) {
                if along[*place].abs() > SMALLEST_SLOPE * rates.terms[*place] {
                    *direction = along[*place].signum();
                }
            }
        }
        let mut passes = direction.iter();
        near.retain(|(_, _, way)| passes.next().is_some_and(|direction| direction * way > 0.0));
        near.into_iter().map(|(sought, ..)| sought).collect()
    }

    /// Adds to what is met at this moment what is zero here to rounding and about to pass it.
    fn meet_here(&mut self, met: &mut Vec<Sought>) {
        for sought in self.met_here() {
            if !met.contains(&sought) {
                met.push(sought);
            }
        }
    }

    fn emit(&self, t: f64, event: Option<&str>, observe: &mut dyn FnMut(&Point) -> bool) -> bool {
        observe(&Point {
            t,
            x: &self.x,
            mode: self.config.mode,
            signs: &self.signs,
            event,
            direction: None,
        })
    }

    /// Records a step; says whether more is wanted.
    fn record(&mut self, step: &Step, end: f64, observe: &mut dyn FnMut(&Point) -> bool) -> bool {
        let mut at = vec![0.0; self.n];
        let mut give = |t: f64, x: &[f64]| {
            observe(&Point {
                t,
                x,
                mode: self.config.mode,
                signs: &self.signs,
                event: None,
                direction: None,
            })
        };
        match self.options.record {
            Record::Times { every } => {
                let mut next = self.next_record;
                let mut count = (next / every).round();
                // The end of the run is a multiple of the time if it is one to rounding.
                let slack = if end == self.options.t_end { 1e-12 * every } else { 0.0 };
                while next <= end + slack {
                    step.at(((next - step.t) / step.h).min(1.0), &mut at);
                    if !give(next.min(end), &at) {
                        return false;
                    }
                    count += 1.0;
                    next = count * every;
                }
                self.next_record = next;
                true
            }
            Record::Path { chord } => {
                let mut farthest = 0.0_f64;
                let few = [0.25, 0.5, 0.75];
                let many: Vec<f64> = (1..16).map(|i| i as f64 / 16.0).collect();
                self.extents.reach(&step.y);
                let is_long = step.series.is_some() && step.multistep.is_none();
                for &place in if is_long { &many[..] } else { &few } {
                    step.at(place, &mut at);
                    self.extents.reach(&at);
                    let mut off = 0.0;
                    for i in 0..self.n {
                        let line = step.x[i] + place * (step.y[i] - step.x[i]);
                        let unit = self.extents.chord(i, chord) / chord;
                        let gap = (at[i] - line) / unit;
                        off += gap * gap;
                    }
                    farthest = farthest.max(off.sqrt());
                }
                let parts = (farthest / chord).sqrt().ceil().clamp(1.0, 1000.0) as usize;
                for i in 1..parts {
                    let place = i as f64 / parts as f64;
                    step.at(place, &mut at);
                    if !give(step.t + place * (end - step.t), &at) {
                        return false;
                    }
                }
                give(end, &step.y)
            }
            Record::Section(_) => true,
        }
    }
}
