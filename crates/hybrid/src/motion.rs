//! Following a general system exactly: from switch to switch, from event to event.
//!
//! Between switches the equations are smooth and a step of [Dormand & Prince's method](crate::step) is made. Every step is searched for the first
//! zero of all switching functions, events' expressions and limits of sliding; it is made again to end there, and
//! [what happens there](crate::selection) is decided from the equations on both sides.

pub mod tangent;

use std::rc::Rc;

use twofold_num::Dual;
use twofold_num::elementary::rough_pow;
use twofold_num::linear::solve_any;
use twofold_system::Expression;

use crate::definition::{Direction, When};
use crate::equation::{Compiled, Configuration, Equation, EquationError};
use crate::model::Model;
use crate::roots::{PLACES, first, stays};
use crate::selection::{MOST_TOGETHER, Way, groups, possibilities};
use crate::step::Step;

/// What is recorded.
#[derive(Clone, Debug, PartialEq)]
pub enum Record {
    /// The path, by points that a polyline through leaves by at most this distance.
    Path {
        /// The distance.
        chord: f64,
    },
    /// The state at the multiples of this time.
    Times {
        /// The time.
        every: f64,
    },
    /// Where an expression is zero.
    Section(Expression),
}

/// Which side motion takes where it is not decided.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Exit {
    /// The run ends with an error.
    Undecided,
    /// To positive values.
    Plus,
    /// To negative values.
    Minus,
}

/// How a system is followed.
#[derive(Clone, Debug)]
pub struct Options {
    /// Where the time begins.
    pub t_start: f64,
    /// Where it ends.
    pub t_end: f64,
    /// The initial state; without one the file's.
    pub start: Option<Vec<f64>>,
    /// Relative tolerance of a step.
    pub rtol: f64,
    /// Absolute tolerance; without one each state is measured by its own size in the run so far.
    pub atol: Option<f64>,
    /// The longest step.
    pub max_step: f64,
    /// The most steps.
    pub max_steps: u64,
    /// What is recorded.
    pub record: Record,
    /// What is done where motion is not decided.
    pub exit: Exit,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            t_start: 0.0,
            t_end: 100.0,
            start: None,
            rtol: 1e-10,
            atol: None,
            max_step: f64::INFINITY,
            max_steps: 400_000_000,
            record: Record::Path { chord: 1e-3 },
            exit: Exit::Undecided,
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
    /// For each switching function +, - or 0 (slid upon); . where the equations do not ask it here. Whole parts stand as #.
    pub signs: &'a str,
    /// The event that happens here.
    pub event: Option<&'a str>,
    /// At a crossing of the section +1 if its expression rises, -1 if it falls.
    pub direction: Option<f64>,
}

/// How a run came to its end.
#[derive(Clone, Debug, PartialEq)]
pub enum Ending {
    /// At its end time.
    Finished,
    /// By an event that says stop.
    Stopped(String),
    /// Where an event accumulates: the event, the time and a bound on its error.
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
    /// Accepted steps.
    pub steps: u64,
    /// Switches met.
    pub switches: u64,
    /// Events that happened.
    pub events: u64,
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
    /// Several continuations.
    #[error(
        "the motion is not decided at t = {t}, state {x:?}: on {surfaces} it can go on in more than one way ({ways}). Nothing is chosen here: end the run before that time (--t-end), start elsewhere (--start), change a parameter (--set), or choose a side (--exit at-once:plus or at-once:minus)"
    )]
    Undecided {
        /// When.
        t: f64,
        /// Where.
        x: Vec<f64>,
        /// The switching functions that are zero there.
        surfaces: String,
        /// The ways.
        ways: String,
    },
    /// Surfaces that cannot be told apart.
    #[error("at t = {t}, state {x:?}, {why}")]
    Stuck {
        /// When.
        t: f64,
        /// Where.
        x: Vec<f64>,
        /// What is the matter.
        why: String,
    },
    /// A domain is left.
    #[error(
        "the motion leaves the domain of the equations at t = {t}, state {x:?}: {what}. End the run before that time (--t-end), or start elsewhere (--start)"
    )]
    Domain {
        /// When.
        t: f64,
        /// Where.
        x: Vec<f64>,
        /// Which operation, in which equation.
        what: String,
    },
    /// Switches accumulate.
    #[error(
        "switches at {surfaces} accumulate at t = {t} (error at most {error:e}), state {x:?}, and nothing says how motion goes on: end the run before that time (--t-end), or describe what holds there by an [[event]]"
    )]
    Accumulation {
        /// When.
        t: f64,
        /// A bound on its error.
        error: f64,
        /// Where.
        x: Vec<f64>,
        /// The switching function.
        surfaces: String,
    },
    /// Too many steps.
    #[error("{steps} steps were made by t = {t}, the most that --max-steps allows")]
    Budget {
        /// The limit.
        steps: u64,
        /// The time reached.
        t: f64,
    },
}

/// How often switches may make each other jump at one moment.
const MOST_JUMPS: usize = 32;

type Nested = Dual<Dual<f64, 1>, 1>;

/// What a step is searched for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sought {
    /// The value of an active guard, by its number; whole parts have two.
    Guard { guard: usize, upper: bool },
    /// A watched expression.
    Watched(usize),
    /// A weight of sliding: the surface's place among those slid upon, and whether it is left to the positive side.
    Leave { place: usize, plus: bool },
    /// Sliding stops being attracting.
    Repelling,
    /// A contact opens.
    Release,
}

/// Times at which something happened again and again.
#[derive(Clone, Debug, Default)]
struct Train {
    times: Vec<f64>,
}

impl Train {
    /// Notes one more; gives the time at which infinitely many are over, with a bound on its error, once that is known.
    fn note(&mut self, t: f64) -> Option<(f64, f64)> {
        self.times.push(t);
        let rounding = 4.0 * f64::EPSILON * t.abs();
        if self.times.len() > 20 && t - self.times[self.times.len() - 20] <= rounding {
            // No time passes any more.
            return Some((t, rounding));
        }
        let n = self.times.len();
        if n > 64 {
            self.times.remove(0);
        }
        let n = self.times.len().min(n);
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
            && left <= 1e-8 * (self.times[n - 1] - self.times[0]).max(1e-4 * t.abs())
            && error <= 0.1 * left.max(1e-13 * t.abs()))
        .then_some((now, error))
    }
}

/// A contact: motion rests on an event's surface.
#[derive(Clone, Copy, Debug)]
struct Contact {
    event: usize,
    watched: usize,
    state: usize,
    /// +1 if the surface is met from above.
    above: f64,
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
    /// Guards that are slid upon, and for each the configuration on its positive side (all others slid upon on their negative one).
    sliding: Vec<usize>,
    base: Vec<(Rc<Compiled>, Vec<f64>)>,
    /// Surfaces slid upon that know nothing of each other: the one that each state's derivative depends on.
    separate: Option<Vec<Option<usize>>>,
    contact: Option<Contact>,
    /// Which side of zero each watched expression is on; 0 if it stays there.
    watch_side: Vec<f64>,
    /// Guards and watched expressions that left zero at the step's beginning.
    fresh_guard: Vec<bool>,
    fresh_watch: Vec<bool>,
    /// The event of each watched expression; none for a section.
    event_of: Vec<Option<usize>>,
    /// Whether each event's condition holds.
    holds: Vec<bool>,
    /// The largest size of each state so far.
    size: Vec<f64>,
    trains: Vec<Train>,
    switch_trains: Vec<Train>,
    signs: String,
    tangents: Option<tangent::Tangents>,
    growth: Option<tangent::Growth>,
    /// The next multiple that is recorded.
    next_record: f64,
    rhs_room: Vec<Vec<f64>>,
    outcome: Outcome,
}

/// Follows a system and gives each recorded point to `observe`, which says whether more is wanted.
///
/// # Errors
/// If the equations are not complete, motion is not decided or leaves their domain, or the budget of steps is used up. What was recorded until then has
/// been given to `observe`.
pub fn follow(
    model: &Model,
    options: &Options,
    observe: &mut dyn FnMut(&Point) -> bool,
) -> Result<Outcome, HybridError> {
    Follower::new(model, options)?.run_whole(observe).map(|(outcome, _)| outcome)
}

/// What each state's error is measured by in a step.
fn scale_now(follower: &Follower, step: &Step) -> Vec<f64> {
    let options = follower.options;
    let span = options.t_end - options.t_start;
    let scale = |i: usize| {
        let size = step.x[i].abs().max(step.y[i].abs());
        match options.atol {
            Some(atol) => atol + options.rtol * size,
            // By the state's own size; from zero on by what it moves in this step, or in a millionth of the run.
            None => {
                let moved = (step.y[i] - step.x[i]).abs();
                let speed = step.k.iter().map(|k| k[i].abs()).fold(0.0, f64::max);
                let least = (0.1 * moved).max(1e-6 * span * speed);
                options.rtol * size.max(0.01 * follower.size[i]).max(least) + f64::MIN_POSITIVE
            }
        }
    };
    (0..step.x.len()).map(scale).collect()
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
    /// -1, 0 or +1: the sign of the first derivative, or of the second where the first is zero.
    fn direction(&self, i: usize) -> f64 {
        let small = 1e-11 * self.terms[i];
        if self.first[i].abs() > small {
            self.first[i].signum()
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
                HybridError::Start(format!("the system suggests no initial state; give one by --start, {n} numbers"))
            })?,
        };
        if x.len() != n || !x.iter().all(|v| v.is_finite()) {
            let states = model.coordinates().join(", ");
            return Err(HybridError::Start(format!(
                "the initial state is {x:?}; give {n} finite numbers, one for each of {states}"
            )));
        }
        let (t0, t1) = (options.t_start, options.t_end);
        if !(t0.is_finite() && t1.is_finite() && t1 > t0) {
            return Err(HybridError::Bad(format!(
                "the run goes from t = {t0} to {t1}: give an end time after the start (--t-end, --t-start)"
            )));
        }
        for ((name, entry), table) in model.definition().tables().iter().zip(&equation.tables) {
            let (first, last) = table.range();
            if t0 < first || t1 > last {
                return Err(HybridError::Bad(format!(
                    "the table `{name}` ({}) goes from t = {first} to {last}, and the run from {t0} to {t1}: stay within it (--t-start, --t-end)",
                    entry.file
                )));
            }
        }
        let events = model.definition().events();
        let mut event_of: Vec<Option<usize>> = Vec::new();
        event_of.extend((0..events.len()).filter(|i| matches!(events[*i].when, When::Zero(..))).map(Some));
        event_of.resize(equation.watched.len(), None);
        let config = Configuration {
            mode: 0,
            sides: vec![1.0; equation.guards.len()],
            pieces: equation.tables.iter().map(|t| t.piece(t0)).collect(),
        };
        let guards = equation.guards.len();
        let watched = equation.watched.len();
        let compiled = equation.compiled(&config);
        let mut follower = Self {
            n,
            t: t0,
            compiled,
            variables: vec![0.0; equation.variables()],
            sliding: Vec::new(),
            base: Vec::new(),
            separate: None,
            contact: None,
            watch_side: vec![0.0; watched],
            fresh_guard: vec![false; guards],
            fresh_watch: vec![false; watched],
            event_of,
            holds: vec![false; events.len()],
            size: x.iter().map(|v| v.abs()).collect(),
            trains: vec![Train::default(); events.len()],
            switch_trains: vec![Train::default(); guards],
            signs: String::new(),
            tangents: None,
            growth: None,
            next_record: f64::INFINITY,
            rhs_room: vec![vec![0.0; n]; 4],
            outcome: Outcome { ending: Ending::Finished, t: t0, x: x.clone(), steps: 0, switches: 0, events: 0 },
            config,
            x,
            equation,
            model,
            options,
        };
        follower.settle_afresh(&[])?;
        for watched in 0..follower.watch_side.len() {
            follower.begin_watching(watched, false);
        }
        follower.note_conditions();
        Ok(follower)
    }

    // What programs read.

    fn load(&mut self, config: &Configuration) -> Vec<f64> {
        let n = self.n;
        let mut v = vec![0.0; self.equation.variables()];
        v[..n].copy_from_slice(&self.x);
        v[n] = self.t;
        v[n + 1..n + 1 + config.sides.len()].copy_from_slice(&config.sides);
        for (i, (table, piece)) in self.equation.tables.iter().zip(&config.pieces).enumerate() {
            let first = n + 1 + config.sides.len() + 5 * i;
            v[first] = table.knots[*piece];
            v[first + 1..first + 5].copy_from_slice(&table.pieces[*piece]);
        }
        v
    }

    /// Takes over the configuration: programs, variables, and what sliding needs.
    fn adopt(&mut self, config: Configuration, sliding: Vec<usize>) {
        let mut config = config;
        for guard in &sliding {
            config.sides[*guard] = self.low(*guard, &config);
        }
        self.sliding = sliding;
        self.compiled = self.equation.compiled(&config);
        self.variables = self.load(&config);
        self.config = config;
        self.separate = self.separate();
        self.base = Vec::new();
        if self.separate.is_none() {
            for guard in self.sliding.clone() {
                let mut flipped = self.config.clone();
                flipped.sides[guard] = self.high(guard, &self.config);
                let variables = self.load(&flipped);
                self.base.push((self.equation.compiled(&flipped), variables));
            }
        }
        self.signs = self
            .equation
            .guards
            .iter()
            .enumerate()
            .map(|(i, guard)| match () {
                () if !self.compiled.active.contains(&i) => '.',
                () if self.sliding.contains(&i) => '0',
                () if guard.whole => '#',
                () if self.config.sides[i] > 0.0 => '+',
                () => '-',
            })
            .collect();
    }

    /// For several surfaces slid upon of which none changes another's speed: which of them each derivative depends on.
    fn separate(&self) -> Option<Vec<Option<usize>>> {
        let k = self.sliding.len();
        if k < 2 || self.sliding.iter().any(|g| self.equation.chooses(*g)) {
            return None;
        }
        let n = self.n;
        let variable = |place: usize| n + 1 + self.sliding[place];
        let mut owner = vec![None; n];
        for (i, owner) in owner.iter_mut().enumerate() {
            let mut owners = (0..k).filter(|place| self.compiled.depends(i, variable(*place)));
            *owner = owners.next();
            if owners.next().is_some() {
                return None;
            }
        }
        for place in 0..k {
            let active = self.compiled.active.iter().position(|g| *g == self.sliding[place])?;
            let strange = (0..n).any(|i| self.compiled.depends(n + active, i) && owner[i].is_some_and(|o| o != place));
            let asks = (0..k).any(|other| self.compiled.depends(n + active, variable(other)));
            if strange || asks {
                return None;
            }
        }
        Some(owner)
    }

    /// Weights of surfaces that know nothing of each other, what each adds to its own speed, and the field on all positive sides.
    fn separate_weights(&mut self, t: f64, x: &[f64], field0: &[f64]) -> (Vec<f64>, Vec<f64>, Vec<f64>) {
        let n = self.n;
        self.variables[..n].copy_from_slice(x);
        self.variables[n] = t;
        let low = Self::along(&self.compiled, &self.variables, field0);
        let sides = |follower: &mut Self, add: f64| {
            for guard in &follower.sliding {
                // On the positive side of a sign 1, of a whole part one more.
                follower.variables[n + 1 + guard] +=
                    if follower.equation.guards[*guard].whole { 0.5 * add } else { add };
            }
        };
        sides(self, 2.0);
        let mut field1 = vec![0.0; n];
        self.compiled.field.evaluate(&self.variables, &mut field1);
        let high = Self::along(&self.compiled, &self.variables, &field1);
        sides(self, -2.0);
        let mut jumps = Vec::with_capacity(self.sliding.len());
        let weight = |guard: &usize| {
            let place = self.compiled.active.iter().position(|g| g == guard);
            let (a, b) = place.map_or((f64::NAN, f64::NAN), |p| (low[p], high[p]));
            jumps.push(b - a);
            -a / (b - a)
        };
        let weights = self.sliding.iter().map(weight).collect();
        (weights, jumps, field1)
    }

    /// The answers on both sides of a guard's zero.
    fn low(&self, guard: usize, config: &Configuration) -> f64 {
        if self.equation.guards[guard].whole { self.boundary(guard, config) - 1.0 } else { -1.0 }
    }

    fn high(&self, guard: usize, config: &Configuration) -> f64 {
        if self.equation.guards[guard].whole { self.boundary(guard, config) } else { 1.0 }
    }

    /// The whole number that a guard's value is at.
    fn boundary(&self, guard: usize, config: &Configuration) -> f64 {
        let value = self.equation.value(&self.equation.guards[guard].expression, self.t, &self.x);
        let _ = config;
        value.round()
    }

    // The field.

    fn rhs(&mut self, t: f64, x: &[f64], out: &mut [f64]) {
        let n = self.n;
        self.variables[..n].copy_from_slice(x);
        self.variables[n] = t;
        self.compiled.field.evaluate(&self.variables, out);
        if let Some(owner) = self.separate.clone() {
            let (weights, _, field1) = self.separate_weights(t, x, out);
            for i in 0..n {
                if let Some(place) = owner[i] {
                    out[i] += weights[place] * (field1[i] - out[i]);
                }
            }
        } else if !self.sliding.is_empty() {
            let weights = self.weights(t, x, out);
            let field0 = out.to_vec();
            for (place, weight) in weights.iter().enumerate() {
                let other = &self.rhs_room_of(place, t, x);
                for i in 0..n {
                    out[i] += weight * (other[i] - field0[i]);
                }
            }
        }
        if let Some(contact) = self.contact {
            let (pull, grip) = self.contact_forces(contact, out);
            out[contact.state] -= pull / grip;
        }
    }

    /// The field on the positive side of a surface slid upon.
    fn rhs_room_of(&mut self, place: usize, t: f64, x: &[f64]) -> Vec<f64> {
        let n = self.n;
        let (compiled, variables) = &mut self.base[place];
        variables[..n].copy_from_slice(x);
        variables[n] = t;
        let mut out = vec![0.0; n];
        compiled.field.evaluate(variables, &mut out);
        out
    }

    /// Derivatives along `field` of the watched values of a configuration.
    fn along(compiled: &Compiled, variables: &[f64], field: &[f64]) -> Vec<f64> {
        let n = field.len();
        let mut duals: Vec<Dual<f64, 1>> = variables.iter().map(|v| Dual::constant(*v)).collect();
        for (dual, slope) in duals.iter_mut().zip(field) {
            dual.partials = [*slope];
        }
        duals[n].partials = [1.0];
        let mut out = vec![Dual::constant(0.0); compiled.outputs];
        compiled.watched.evaluate(&duals, &mut out);
        out.iter().map(|d| d.partials[0]).collect()
    }

    /// Weights of the positive sides in sliding; not-a-number where there are none.
    fn weights(&mut self, t: f64, x: &[f64], field0: &[f64]) -> Vec<f64> {
        let (a, matrix) = self.sliding_equations(t, x, field0);
        let b: Vec<f64> = a.iter().map(|v| -v).collect();
        solve_any(&matrix, &b, 0.0).unwrap_or_else(|| vec![f64::NAN; b.len()])
    }

    /// The derivatives of the functions slid upon on all negative sides, and what each positive side adds, row by row.
    fn sliding_equations(&mut self, t: f64, x: &[f64], field0: &[f64]) -> (Vec<f64>, Vec<f64>) {
        let k = self.sliding.len();
        let n = self.n;
        self.variables[..n].copy_from_slice(x);
        self.variables[n] = t;
        let place = |compiled: &Compiled, guard: usize| compiled.active.iter().position(|g| *g == guard);
        let rates = Self::along(&self.compiled, &self.variables, field0);
        let of =
            |rates: &[f64], compiled: &Compiled, guard: usize| place(compiled, guard).map_or(f64::NAN, |i| rates[i]);
        let a: Vec<f64> = self.sliding.iter().map(|g| of(&rates, &self.compiled, *g)).collect();
        let mut matrix = vec![0.0; k * k];
        for column in 0..k {
            let field = self.rhs_room_of(column, t, x);
            let (compiled, variables) = &self.base[column];
            let rates = Self::along(compiled, variables, &field);
            for row in 0..k {
                matrix[row * k + column] = of(&rates, compiled, self.sliding[row]) - a[row];
            }
        }
        (a, matrix)
    }

    /// The second derivative of a contact's expression under `field`, and how much the contact's state moves it.
    fn contact_forces(&mut self, contact: Contact, field: &[f64]) -> (f64, f64) {
        let rates = self.second_along(field, None);
        let grip = self.second_along(field, Some(contact.state));
        let place = self.compiled.active.len() + contact.watched;
        (rates[place], grip[place])
    }

    /// Second derivatives of the watched values along the field; or the derivatives of their first ones by a state.
    fn second_along(&self, field: &[f64], by: Option<usize>) -> Vec<f64> {
        let n = self.n;
        let mut direction = vec![0.0; self.variables.len()];
        match by {
            Some(state) => direction[state] = 1.0,
            None => {
                direction[..n].copy_from_slice(field);
                direction[n] = 1.0;
            }
        }
        let duals: Vec<Dual<f64, 1>> =
            self.variables.iter().zip(&direction).map(|(v, d)| Dual { value: *v, partials: [*d] }).collect();
        let mut slopes = vec![Dual::constant(0.0); n];
        self.compiled.field.evaluate(&duals, &mut slopes);
        let nested: Vec<Nested> = (0..self.variables.len())
            .map(|i| {
                let inner = Dual { value: self.variables[i], partials: [direction[i]] };
                let outer = match i {
                    i if i < n => Dual { value: field[i], partials: slopes[i].partials },
                    i if i == n => Dual::constant(1.0),
                    _ => Dual::constant(0.0),
                };
                Dual { value: inner, partials: [outer] }
            })
            .collect();
        let outputs = self.compiled.active.len() + self.equation.watched.len();
        let mut out = vec![Nested::constant(Dual::constant(0.0)); outputs];
        self.compiled.watched.evaluate(&nested, &mut out);
        out.iter().map(|d| d.partials[0].partials[0]).collect()
    }

    /// What the watched values of a configuration do at the present point.
    fn rates(&mut self, config: &Configuration) -> (Rc<Compiled>, Rates) {
        let compiled = self.equation.compiled(config);
        let variables = self.load(config);
        let n = self.n;
        let mut field = vec![0.0; n];
        compiled.field.evaluate(&variables, &mut field);
        let outputs = compiled.active.len() + self.equation.watched.len();
        let (mut slopes, mut terms) = (vec![0.0; outputs], vec![0.0; outputs]);
        const WIDE: usize = 4;
        let mut out = vec![Dual::<f64, WIDE>::constant(0.0); outputs];
        for from in (0..=n).step_by(WIDE) {
            let mut duals: Vec<Dual<f64, WIDE>> = variables.iter().map(|v| Dual::constant(*v)).collect();
            for j in 0..WIDE.min(n + 1 - from) {
                duals[from + j].partials[j] = 1.0;
            }
            compiled.watched.evaluate(&duals, &mut out);
            for (o, d) in out.iter().enumerate() {
                for j in 0..WIDE.min(n + 1 - from) {
                    let speed = if from + j == n { 1.0 } else { field[from + j] };
                    slopes[o] += d.partials[j] * speed;
                    terms[o] += (d.partials[j] * speed).abs();
                }
            }
        }
        // Second derivatives matter where first ones are zero; they are asked of the present programs.
        let mut second = vec![0.0; outputs];
        if (0..outputs).any(|i| !(slopes[i].abs() > 1e-11 * terms[i])) {
            let kept = (
                std::mem::replace(&mut self.variables, variables),
                std::mem::replace(&mut self.compiled, compiled.clone()),
            );
            second = self.second_along(&field, None);
            (self.variables, self.compiled) = kept;
        }
        (compiled, Rates { field, first: slopes, second, terms })
    }

    // What a step is searched for.

    fn sought(&self) -> Vec<(Sought, f64)> {
        let mut list = Vec::new();
        for guard in &self.compiled.active {
            if self.sliding.contains(guard) {
                continue;
            }
            if self.equation.guards[*guard].whole {
                list.push((Sought::Guard { guard: *guard, upper: false }, 1.0));
                list.push((Sought::Guard { guard: *guard, upper: true }, 1.0));
            } else {
                list.push((Sought::Guard { guard: *guard, upper: false }, self.config.sides[*guard]));
            }
        }
        for (i, side) in self.watch_side.iter().enumerate() {
            if *side != 0.0 && !self.contact.is_some_and(|c| c.watched == i) {
                list.push((Sought::Watched(i), *side));
            }
        }
        for place in 0..self.sliding.len() {
            list.push((Sought::Leave { place, plus: false }, 1.0));
            list.push((Sought::Leave { place, plus: true }, 1.0));
        }
        if !self.sliding.is_empty() {
            list.push((Sought::Repelling, 1.0));
        }
        if self.contact.is_some() {
            list.push((Sought::Release, 1.0));
        }
        list
    }

    /// The values of all that is sought at a point.
    fn measure(&mut self, list: &[(Sought, f64)], t: f64, x: &[f64], out: &mut Vec<f64>) {
        let n = self.n;
        self.variables[..n].copy_from_slice(x);
        self.variables[n] = t;
        let compiled = self.compiled.clone();
        let active = compiled.active.len();
        let mut values = std::mem::take(&mut self.rhs_room[0]);
        values.resize(active + self.equation.watched.len(), 0.0);
        compiled.watched.evaluate(&self.variables, &mut values);
        let mut weights = Vec::new();
        let mut determinant = f64::NAN;
        if !self.sliding.is_empty() {
            let mut field0 = vec![0.0; n];
            compiled.field.evaluate(&self.variables, &mut field0);
            if self.separate.is_some() {
                let jumps;
                (weights, jumps, _) = self.separate_weights(t, x, &field0);
                // Each attracts by itself: the one that is nearest to doing so no more counts.
                determinant = jumps.iter().map(|j| -j).fold(f64::INFINITY, f64::min);
            } else {
                let (a, matrix) = self.sliding_equations(t, x, &field0);
                let k = a.len();
                let b: Vec<f64> = a.iter().map(|v| -v).collect();
                weights = solve_any(&matrix, &b, 0.0).unwrap_or_else(|| vec![f64::NAN; k]);
                // Attracting where minus the matrix has a positive determinant, which a single surface's jump of speed is.
                determinant = determinant_of_negative(matrix, k);
            }
        }
        out.clear();
        for (sought, _) in list {
            out.push(match *sought {
                Sought::Guard { guard, upper } => {
                    let value = active_value(&compiled, &values, guard);
                    match (self.equation.guards[guard].whole, upper) {
                        (false, _) => value,
                        (true, false) => value - self.config.sides[guard],
                        (true, true) => self.config.sides[guard] + 1.0 - value,
                    }
                }
                Sought::Watched(i) => values[active + i],
                Sought::Leave { place, plus: false } => weights[place],
                Sought::Leave { place, plus: true } => 1.0 - weights[place],
                Sought::Repelling => determinant,
                Sought::Release => {
                    let contact = self.contact.expect("sought with a contact only");
                    let mut field = vec![0.0; n];
                    compiled.field.evaluate(&self.variables, &mut field);
                    let (pull, _) = self.contact_forces(contact, &field);
                    -contact.above * pull
                }
            });
        }
        self.rhs_room[0] = values;
    }

    // The run.

    /// The run, and the follower as it is at its end.
    fn run_whole(mut self, observe: &mut dyn FnMut(&Point) -> bool) -> Result<(Outcome, Self), HybridError> {
        let ending = self.run(observe)?;
        self.outcome.ending = ending;
        self.outcome.t = self.t;
        self.outcome.x = self.x.clone();
        Ok((self.outcome.clone(), self))
    }

    fn run(&mut self, observe: &mut dyn FnMut(&Point) -> bool) -> Result<Ending, HybridError> {
        let definition = self.model.definition().clone();
        let mut clock = Clock::new(self)?;
        let mut step = Step::new(self.n);
        let mut h = 0.0;
        let mut quiet = 0;
        let mut last_met = f64::NEG_INFINITY;
        if !matches!(self.options.record, Record::Section(_)) {
            if !self.emit(self.t, None, observe) {
                return Ok(Ending::Interrupted);
            }
            if let Record::Times { every } = self.options.record {
                self.next_record = ((self.t / every).floor() + 1.0) * every;
            }
        }
        let (mut before, mut list_values) = (Vec::new(), [const { Vec::new() }; 5]);
        let mut room = vec![0.0; self.n];
        loop {
            // Times at which something is known to happen.
            if clock.next().is_some_and(|time| time <= self.t) {
                let met = self.met_here();
                if let Some(ending) = self.on_time(&mut clock, &definition, &met, observe)? {
                    return Ok(ending);
                }
                h = 0.0;
                continue;
            }
            if self.t >= self.options.t_end {
                return Ok(Ending::Finished);
            }
            if self.outcome.steps >= self.options.max_steps {
                return Err(HybridError::Budget { steps: self.outcome.steps, t: self.t });
            }
            step.t = self.t;
            step.x.copy_from_slice(&self.x);
            let (t, x) = (self.t, self.x.clone());
            self.rhs(t, &x, &mut room);
            step.k[0].copy_from_slice(&room);
            if !room.iter().all(|v| v.is_finite()) {
                return Err(self.left_domain(t, &x));
            }
            if h == 0.0 {
                h = self.first_step(&room);
            }
            let stop = clock.next().unwrap_or(f64::INFINITY).min(self.options.t_end);
            let mut wanted = h.min(self.options.max_step);
            let to_stop = self.t + wanted * 1.000_001 >= stop;
            if to_stop {
                wanted = stop - self.t;
            }
            // A step that the tolerance allows.
            let mut rejected = 0;
            let error = loop {
                let follower = &mut *self;
                step.take(wanted, &mut |t, x, out| follower.rhs(t, x, out));
                let scale = scale_now(follower, &step);
                let error = step.error(&|i| scale[i]);
                if error <= 1.0 {
                    // What the step did not see begins there: it is made to end before.
                    let shorter = follower.unseen(&step, &scale).map(|theta| theta.clamp(0.05, 0.9));
                    let shorter = shorter.or_else(|| follower.too_long_for_tangents(&step));
                    let Some(factor) = shorter else { break error };
                    rejected += 1;
                    wanted *= factor;
                    if follower.t + wanted == follower.t || rejected > 200 {
                        break error;
                    }
                    continue;
                }
                rejected += 1;
                let factor = if error.is_nan() { 0.1 } else { (0.9 * rough_pow(error, -0.2)).clamp(0.1, 0.9) };
                wanted *= factor;
                if self.t + wanted == self.t || rejected > 200 {
                    break f64::NAN;
                }
            };
            if error.is_nan() {
                if self.land_at_an_edge()? {
                    continue;
                }
                return Err(self.left_domain(self.t + wanted, &step.x.clone()));
            }
            let stopped = to_stop && rejected == 0;
            let most = if rejected > 0 { 1.2 } else { 5.0 };
            let h_next = wanted * if error > 0.0 { (0.9 * rough_pow(error, -0.2)).clamp(0.2, most) } else { most };
            // The first thing that is met.
            let list = self.sought();
            let mut found: Vec<(f64, Sought)> = Vec::new();
            if !list.is_empty() {
                for (i, place) in PLACES.iter().enumerate() {
                    let at = self.t + place * wanted;
                    if i == 4 {
                        room.copy_from_slice(&step.y);
                    } else {
                        step.at(*place, &mut room);
                    }
                    let mut values = std::mem::take(&mut list_values[i]);
                    self.measure(&list, at, &room, &mut values);
                    list_values[i] = values;
                }
                before.clone_from(&list_values[0]);
                for (j, (sought, side)) in list.iter().enumerate() {
                    let mut v: [f64; 5] = std::array::from_fn(|i| list_values[i][j]);
                    if self.is_fresh(*sought) || v[0] * side < 0.0 {
                        v[0] = 0.0;
                    }
                    if v.iter().any(|v| v.is_nan()) {
                        // Weights of sliding where there are none, or an expression out of its domain: shorter steps find the place.
                        if matches!(sought, Sought::Leave { .. } | Sought::Repelling) {
                            found.push((0.5, *sought));
                        }
                        continue;
                    }
                    if stays(&v, *side) {
                        continue;
                    }
                    let (begin, length) = (self.t, wanted);
                    let follower = &mut *self;
                    let (one, mut value, mut at) = ([(*sought, *side)], Vec::new(), vec![0.0; room.len()]);
                    let mut f = |theta: f64| {
                        step.at(theta, &mut at);
                        follower.measure(&one, begin + theta * length, &at, &mut value);
                        value[0]
                    };
                    found.extend(first(v, *side, 0.0, 1.0, &mut f, 0).map(|theta| (theta, *sought)));
                }
            }
            let earliest = found.iter().map(|(theta, _)| *theta).fold(f64::INFINITY, f64::min);
            if earliest.is_finite() {
                let met: Vec<Sought> =
                    found.iter().filter(|(theta, _)| *theta <= earliest + 1e-9).map(|(_, sought)| *sought).collect();
                self.land(&mut step, earliest * wanted, wanted, met[0]);
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
                self.size[i] = self.size[i].max(step.y[i].abs());
            }
            let progress = end > self.t;
            self.t = end;
            self.x.copy_from_slice(&step.y);
            self.note_growth(end);
            if progress {
                self.clear_fresh(&list, &list_values[4], earliest.is_finite());
            }
            h = if earliest.is_finite() {
                // Where things happen often, steps are about as long as what is between them.
                let between = std::mem::replace(&mut last_met, self.t);
                h_next.max(h).min(1.5 * (self.t - between).max(f64::EPSILON * self.t.abs()))
            } else {
                h_next
            };
            if !earliest.is_finite() {
                if !self.sliding.is_empty() || self.contact.is_some() {
                    self.project();
                }
                continue;
            }
            quiet = if progress { 0 } else { quiet + 1 };
            if quiet > 40 {
                let why = "the same surface is met again and again without time passing: the motion there is not resolved; smooth the switch, or describe what holds there by an [[event]]".into();
                return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
            }
            let met: Vec<Sought> =
                found.iter().filter(|(theta, _)| *theta <= earliest + 1e-9).map(|(_, sought)| *sought).collect();
            let rounding = 4.0 * f64::EPSILON * self.t.abs().max(length);
            let ending = match clock.next().filter(|time| *time - self.t <= rounding) {
                Some(time) => {
                    self.t = time;
                    self.on_time(&mut clock, &definition, &met, observe)?
                }
                None => {
                    let before = self.before(&met)?;
                    let ending = self.meet(&definition, &met, &[], observe)?;
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

    /// What is due at the present time, together with what is met here.
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
        self.adopt(config, sliding);
        let before = self.before(met)?;
        let ending = self.meet(definition, met, &due, observe)?;
        if ending.is_none() {
            self.after(before)?;
        }
        if ending.is_none() && !self.equation.tables.is_empty() {
            // A table's jump may let sliding end, and make switching functions jump.
            let zero = self.sliding.clone();
            self.settle(&zero)?;
        }
        Ok(ending)
    }

    /// Watched expressions that are zero to rounding and about to pass it.
    fn met_here(&mut self) -> Vec<Sought> {
        let config = self.config.clone();
        let near: Vec<usize> = (0..self.watch_side.len())
            .filter(|i| self.watch_side[*i] != 0.0 && !self.fresh_watch[*i])
            .filter(|i| {
                let e = &self.equation.watched[*i];
                self.equation.value(e, self.t, &self.x).abs() <= 1e-14 * self.magnitude(e)
            })
            .collect();
        if near.is_empty() {
            return Vec::new();
        }
        let (compiled, rates) = self.rates(&config);
        let passes = |i: &usize| rates.direction(compiled.active.len() + i) * self.watch_side[*i] < 0.0;
        near.into_iter().filter(passes).map(Sought::Watched).collect()
    }

    fn left_domain(&mut self, t: f64, x: &[f64]) -> HybridError {
        self.variables[..self.n].copy_from_slice(x);
        self.variables[self.n] = t;
        // Looked for a little ahead, where the field's own numbers are broken.
        let mut what = self.equation.broken(&self.compiled, &self.variables);
        if what.is_none() {
            let mut field = vec![0.0; self.n];
            self.compiled.field.evaluate(&self.variables, &mut field);
            let longest =
                x.iter().zip(&field).map(|(x, f)| x.abs() / f.abs().max(f64::MIN_POSITIVE)).fold(1.0, f64::max);
            let mut ahead = 1e-12 * longest;
            while what.is_none() && ahead < 10.0 * longest {
                for i in 0..self.n {
                    self.variables[i] = x[i] + ahead * field[i];
                }
                self.variables[self.n] = t + ahead;
                what = self.equation.broken(&self.compiled, &self.variables);
                ahead *= 4.0;
            }
        }
        let what = what.unwrap_or_else(|| {
            "steps become too short to move: a singularity, or a solution that grows without bound".into()
        });
        HybridError::Domain { t, x: x.to_vec(), what }
    }

    /// Where an expression's domain ends at a switch, as that of |x|^0.5 does on either side, no step goes across. Very near to it the state is put
    /// onto the switch, and what holds there is decided; false if no switch is so near.
    fn land_at_an_edge(&mut self) -> Result<bool, HybridError> {
        let n = self.n;
        let (t, x) = (self.t, self.x.clone());
        let mut field = vec![0.0; n];
        self.rhs(t, &x, &mut field);
        let values = self.watched_values();
        let rates = Self::along(&self.compiled, &self.variables, &field);
        let mut nearest: Option<(f64, usize, usize)> = None;
        for (place, guard) in self.compiled.active.iter().enumerate() {
            let left = -values[place] / rates[place];
            let closer = nearest.is_none_or(|(best, ..)| left < best);
            let open = !self.sliding.contains(guard) && !self.equation.guards[*guard].whole;
            if open && left > 0.0 && left <= 1e-9 * (self.options.t_end - self.options.t_start) && closer {
                nearest = Some((left, place, *guard));
            }
        }
        let Some((left, place, guard)) = nearest else { return Ok(false) };
        let gradient: Vec<f64> = (0..n)
            .map(|i| {
                let mut unit = vec![0.0; n];
                unit[i] = 1.0;
                let mut still = self.variables.clone();
                still[n] = t;
                let with_time = Self::along(&self.compiled, &still, &unit)[place];
                with_time - Self::along(&self.compiled, &still, &vec![0.0; n])[place]
            })
            .collect();
        for i in 0..n {
            self.x[i] += left * field[i];
        }
        self.t += left;
        let off = self.watched_values()[place];
        let size: f64 = gradient.iter().map(|g| g * g).sum();
        if off != 0.0 && size > 0.0 {
            self.x.iter_mut().zip(&gradient).for_each(|(x, g)| *x -= off * g / size);
        }
        self.outcome.switches += 1;
        let mut zero = self.sliding.clone();
        zero.push(guard);
        self.settle(&zero)?;
        Ok(true)
    }

    /// Hairer, Norsett & Wanner (1993), sec. II.4, with the file's own scales.
    fn first_step(&mut self, field: &[f64]) -> f64 {
        let (rtol, atol) = (self.options.rtol, self.options.atol.unwrap_or(0.0));
        let span = self.options.t_end - self.t;
        let scale: Vec<f64> = self
            .x
            .iter()
            .zip(field)
            .zip(&self.size)
            .map(|((x, f), size)| {
                atol + rtol * x.abs().max(0.01 * size).max(1e-3 * f.abs() * span.min(1.0)) + f64::MIN_POSITIVE
            })
            .collect();
        let norm =
            |v: &[f64]| (v.iter().zip(&scale).map(|(v, s)| (v / s) * (v / s)).sum::<f64>() / v.len() as f64).sqrt();
        let (d0, d1) = (norm(&self.x), norm(field));
        let h0 = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 * span } else { 0.01 * d0 / d1 }.min(0.01 * span);
        let ahead: Vec<f64> = self.x.iter().zip(field).map(|(x, f)| x + h0 * f).collect();
        let mut there = vec![0.0; self.n];
        let t = self.t + h0;
        self.rhs(t, &ahead, &mut there);
        let difference: Vec<f64> = there.iter().zip(field).map(|(a, b)| a - b).collect();
        let d = d1.max(norm(&difference) / h0);
        let h1 = if d <= 1e-15 { h0 * 1e3 } else { rough_pow(0.01 / d, 0.2) };
        let h = if h1.is_finite() { (100.0 * h0).min(h1) } else { h0 };
        h.min(span)
    }

    /// The place in a step before which all is as the step saw it, if there is something that it did not see: an operation that is flat at the step's stages
    /// and steep between them. Where arguments move far, the field along the continuous extension is compared with the extension's own derivative (the
    /// defect: Enright 1989).
    fn unseen(&mut self, step: &Step, scale: &[f64]) -> Option<f64> {
        let compiled = self.compiled.clone();
        if compiled.gates.is_empty() || step.h == 0.0 {
            return None;
        }
        let n = self.n;
        let (mut x, mut out) = (vec![0.0; n], vec![0.0; compiled.gates.len()]);
        let mut arguments = |follower: &mut Self, theta: f64| {
            step.at(theta, &mut x);
            follower.variables[..n].copy_from_slice(&x);
            follower.variables[n] = step.t + theta * step.h;
            compiled.gate_arguments.evaluate(&follower.variables, &mut out);
            out.clone()
        };
        let mut open = vec![(0.0, 1.0, 0, arguments(self, 0.0), arguments(self, 1.0))];
        let mut looked = 0;
        let (mut at, mut slope, mut field) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        while let Some((a, b, depth, first, last)) = open.pop() {
            let middle = 0.5 * (a + b);
            let between = arguments(self, middle);
            let quiet = compiled.gates.iter().enumerate().all(|(i, gate)| {
                let (p, q, r) = (first[i], between[i], last[i]);
                // A parabola's reach beyond its three points.
                let bend = (0.5 * (p + r) - q).abs() * 0.5;
                gate.is_quiet(p.min(q).min(r) - bend, p.max(q).max(r) + bend)
            });
            if quiet && depth == 0 {
                return None;
            }
            step.at(middle, &mut at);
            step.slope_at(middle, &mut slope);
            self.rhs(step.t + middle * step.h, &at, &mut field);
            looked += 1;
            let defect =
                (0..n).map(|i| ((field[i] - slope[i]) * step.h * (b - a) / scale[i]).abs()).fold(0.0, f64::max);
            if !(defect <= 1e3) {
                return Some(a.max(0.05));
            }
            if !quiet && depth < 14 && looked < 4096 {
                open.push((middle, b, depth + 1, between.clone(), last));
                open.push((a, middle, depth + 1, first, between));
            }
        }
        None
    }

    fn is_fresh(&self, sought: Sought) -> bool {
        match sought {
            Sought::Guard { guard, .. } => self.fresh_guard[guard],
            Sought::Watched(i) => self.fresh_watch[i],
            _ => false,
        }
    }

    fn clear_fresh(&mut self, list: &[(Sought, f64)], end: &[f64], cut: bool) {
        if cut {
            // Time has passed: what left zero at the step's beginning is away from it, but for what is met here, which is marked anew.
            self.fresh_guard.fill(false);
            self.fresh_watch.fill(false);
            return;
        }
        for ((sought, _), value) in list.iter().zip(end) {
            match *sought {
                Sought::Guard { guard, .. } if *value != 0.0 => self.fresh_guard[guard] = false,
                Sought::Watched(i) if *value != 0.0 => self.fresh_watch[i] = false,
                _ => {}
            }
        }
        // A watched expression that stayed at zero may have left it.
        let n = self.compiled.active.len();
        if self.watch_side.contains(&0.0) {
            let mut values = vec![0.0; n + self.equation.watched.len()];
            self.variables[..self.n].copy_from_slice(&self.x);
            self.variables[self.n] = self.t;
            self.compiled.watched.evaluate(&self.variables, &mut values);
            for i in 0..self.watch_side.len() {
                let value = values[n + i];
                if self.watch_side[i] == 0.0 && value.abs() > 1e-13 * self.magnitude(&self.equation.watched[i]) {
                    self.watch_side[i] = value.signum();
                }
            }
        }
    }

    /// Makes the step end where `sought` is zero, near `h`: Newton's method on steps of their own length.
    fn land(&mut self, step: &mut Step, h: f64, longest: f64, sought: Sought) {
        let mut room = vec![0.0; self.n];
        let (mut low, mut high) = (Vec::new(), Vec::new());
        let one = [(sought, 1.0)];
        let delta = 1e-4;
        let (a, b) = ((h / longest - delta).max(0.0), (h / longest + delta).min(1.0));
        step.at(a, &mut room);
        self.measure(&one, self.t + a * longest, &room, &mut low);
        step.at(b, &mut room);
        self.measure(&one, self.t + b * longest, &room, &mut high);
        let slope = (high[0] - low[0]) / ((b - a) * longest);
        let mut length = h;
        for correction in 0.. {
            let follower = &mut *self;
            step.take(length, &mut |t, x, out| follower.rhs(t, x, out));
            if correction == 3 {
                break;
            }
            self.measure(&one, self.t + length, &step.y, &mut low);
            let correction = low[0] / slope;
            // Where the function only touches zero, or is none at all, the first place stays.
            let rounding = 2.0 * f64::EPSILON * (self.t + length).abs();
            let wanted = (length - correction).clamp(0.0, longest);
            if !correction.is_finite()
                || correction.abs() > 1e-3 * longest
                || correction.abs() <= rounding
                || wanted == length
            {
                break;
            }
            length = wanted;
        }
    }

    // Recording.

    fn emit(&self, t: f64, event: Option<&str>, observe: &mut dyn FnMut(&Point) -> bool) -> bool {
        observe(&Point { t, x: &self.x, mode: self.config.mode, signs: &self.signs, event, direction: None })
    }

    /// Records a step; says whether more is wanted.
    fn record(&mut self, step: &Step, end: f64, observe: &mut dyn FnMut(&Point) -> bool) -> bool {
        let mut at = vec![0.0; self.n];
        let mut give = |t: f64, x: &[f64]| {
            observe(&Point { t, x, mode: self.config.mode, signs: &self.signs, event: None, direction: None })
        };
        match self.options.record {
            Record::Times { every } => {
                let mut next = self.next_record;
                let mut count = (next / every).round();
                while next <= end {
                    step.at(((next - step.t) / step.h).min(1.0), &mut at);
                    if !give(next, &at) {
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
                for place in [0.25, 0.5, 0.75] {
                    step.at(place, &mut at);
                    let mut off = 0.0;
                    for i in 0..self.n {
                        let line = step.x[i] + place * (step.y[i] - step.x[i]);
                        off += (at[i] - line) * (at[i] - line);
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

    // What happens at a point that is met.

    fn meet(
        &mut self,
        definition: &crate::Definition,
        met: &[Sought],
        due: &[usize],
        observe: &mut dyn FnMut(&Point) -> bool,
    ) -> Result<Option<Ending>, HybridError> {
        let mut zero = self.sliding.clone();
        let mut fired = due.to_vec();
        let mut passed = Vec::new();
        let mut crossed = Vec::new();
        let mut leave = Vec::new();
        for sought in met {
            match *sought {
                Sought::Guard { guard, .. } => {
                    if !zero.contains(&guard) {
                        zero.push(guard);
                    }
                    crossed.push(guard);
                }
                Sought::Watched(i) => {
                    let side = self.watch_side[i];
                    passed.push(i);
                    match self.event_of[i] {
                        None => {
                            let (mode, signs, direction) = (self.config.mode, &self.signs, Some(-side));
                            let point = Point { t: self.t, x: &self.x, mode, signs, event: None, direction };
                            if !observe(&point) {
                                return Ok(Some(Ending::Interrupted));
                            }
                        }
                        Some(event) => {
                            let When::Zero(_, direction) = &definition.events()[event].when else { continue };
                            let wanted = match direction {
                                Direction::Both => true,
                                Direction::Up => side < 0.0,
                                Direction::Down => side > 0.0,
                            };
                            if wanted {
                                fired.push(event);
                            }
                        }
                    }
                }
                Sought::Leave { place, plus } => leave.push((self.sliding[place], plus)),
                Sought::Repelling => {
                    let zero = self.sliding.clone();
                    match self.options.exit {
                        Exit::Undecided => {
                            return Err(self.undecided(
                                &zero,
                                "sliding ceases to attract: it may go on, or leave at any time to either side",
                            ));
                        }
                        rule => zero.iter().for_each(|g| leave.push((*g, rule == Exit::Plus))),
                    }
                }
                Sought::Release => {
                    if let Some(contact) = self.contact.take() {
                        self.watch_side[contact.watched] = contact.above;
                        self.fresh_watch[contact.watched] = true;
                        self.trains[contact.event] = Train::default();
                    }
                }
            }
        }
        if !leave.is_empty() {
            self.outcome.switches += 1;
            let mut config = self.config.clone();
            for (guard, plus) in &leave {
                config.sides[*guard] =
                    if *plus { self.high(*guard, &self.config) } else { self.low(*guard, &self.config) };
                self.fresh_guard[*guard] = true;
                zero.retain(|g| g != guard);
            }
            self.ask_new(&mut config);
            let rest: Vec<usize> = self.sliding.iter().copied().filter(|g| zero.contains(g)).collect();
            self.adopt(config, rest);
        }
        if !crossed.is_empty() {
            self.outcome.switches += 1;
            self.settle(&zero)?;
            for guard in crossed {
                if let Some((t, error)) = self.switch_trains[guard].note(self.t).filter(|_| fired.is_empty()) {
                    let surfaces = self.names(&[guard]);
                    return Err(HybridError::Accumulation { t, error, x: self.x.clone(), surfaces });
                }
            }
            self.watch_jumps(definition, &mut passed, &mut fired);
        }
        for i in passed {
            let old = self.watch_side[i];
            self.watch_side[i] = -old;
            self.fresh_watch[i] = true;
        }
        for (i, event) in definition.events().iter().enumerate() {
            if let When::Becomes(e) = &event.when {
                let now = self.equation.holds(e, &self.config);
                if now && !self.holds[i] {
                    fired.push(i);
                }
                self.holds[i] = now;
            }
        }
        fired.sort_unstable();
        self.happen(definition, &fired, &zero, observe)
    }

    /// Lets events happen, in the file's order.
    fn happen(
        &mut self,
        definition: &crate::Definition,
        fired: &[usize],
        zero: &[usize],
        observe: &mut dyn FnMut(&Point) -> bool,
    ) -> Result<Option<Ending>, HybridError> {
        let fired: Vec<usize> = fired
            .iter()
            .copied()
            .filter(|i| definition.events()[*i].from.is_none_or(|mode| mode == self.config.mode))
            .collect();
        if fired.is_empty() {
            return Ok(None);
        }
        let quiet = matches!(self.options.record, Record::Section(_));
        let mut stop = None;
        let mut zeno = None;
        let old = self.x.clone();
        let mut new = self.x.clone();
        let mut mode = None;
        for i in &fired {
            let event = &definition.events()[*i];
            self.outcome.events += 1;
            if !quiet && !self.emit(self.t, Some(&event.name), observe) {
                return Ok(Some(Ending::Interrupted));
            }
            match &self.equation.resets[*i] {
                Some(program) => {
                    self.variables[..self.n].copy_from_slice(&old);
                    self.variables[self.n] = self.t;
                    let mut values = vec![0.0; event.set.len()];
                    program.evaluate(&self.variables, &mut values);
                    event.set.iter().zip(values).for_each(|((state, _), value)| new[*state] = value);
                }
                None => {
                    for (state, value) in &event.set {
                        new[*state] = self.equation.value(value, self.t, &old);
                    }
                }
            }
            mode = event.mode.or(mode);
            if event.stop {
                stop = Some(Ending::Stopped(event.name.clone()));
            }
            if matches!(event.when, When::Zero(..) | When::Becomes(_)) && !event.set.is_empty() {
                if let Some((t, error)) = self.trains[*i].note(self.t) {
                    zeno = Some((*i, t, error));
                }
            }
        }
        if !new.iter().all(|v| v.is_finite()) {
            let names: Vec<&str> = fired.iter().map(|i| definition.events()[*i].name.as_str()).collect();
            let why = format!("`set` of {} gives {new:?}, which is no finite state", names.join(", "));
            return Err(HybridError::Stuck { t: self.t, x: old, why });
        }
        let changed = new != old;
        let set: Vec<(usize, &Expression)> =
            fired.iter().flat_map(|i| &definition.events()[*i].set).map(|(state, e)| (*state, e)).collect();
        if !set.is_empty() {
            self.note_reset(&set, &old);
        }
        self.x = new;
        if changed || mode.is_some() {
            if let Some(mode) = mode {
                self.config.mode = mode;
            }
            // Expressions that were zero and that the reset leaves alone are zero still.
            let value = |e: &Expression, x: &[f64]| self.equation.value(e, self.t, x);
            let stays_zero = |e: &Expression| {
                let (a, b) = (value(e, &old), value(e, &self.x));
                (a - b).abs() <= 1e-12 * self.magnitude(e)
            };
            let zero: Vec<usize> =
                zero.iter().copied().filter(|g| stays_zero(&self.equation.guards[*g].expression)).collect();
            let watched: Vec<usize> = (0..self.watch_side.len())
                .filter(|i| self.fresh_watch[*i] && stays_zero(&self.equation.watched[*i]))
                .collect();
            self.contact = None;
            if mode.is_some() || !self.equation.guards.is_empty() {
                self.settle_afresh(&zero)?;
            }
            for i in 0..self.watch_side.len() {
                self.begin_watching(i, watched.contains(&i));
            }
            for i in &watched {
                let Some(event) = self.event_of[*i] else { continue };
                let When::Zero(_, direction) = definition.events()[event].when else { continue };
                // Back into the surface at once: infinitely many in no time.
                let into = match direction {
                    Direction::Down => self.watch_side[*i] < 0.0,
                    Direction::Up => self.watch_side[*i] > 0.0,
                    Direction::Both => false,
                };
                if into && fired.contains(&event) && !definition.events()[event].set.is_empty() {
                    zeno = Some((event, self.t, 4.0 * f64::EPSILON * self.t.abs()));
                }
            }
            self.note_conditions();
            let setting = fired.iter().rev().find(|i| !definition.events()[**i].set.is_empty());
            let name = &definition.events()[*setting.unwrap_or(&fired[fired.len() - 1])].name;
            if !quiet && !self.emit(self.t, Some(name), observe) {
                return Ok(Some(Ending::Interrupted));
            }
        }
        if stop.is_some() {
            return Ok(stop);
        }
        if let Some((i, t, error)) = zeno {
            let event = &definition.events()[i];
            if event.sticks
                && let Record::Times { every } = self.options.record
            {
                while self.next_record <= t {
                    if !self.emit(self.next_record, None, observe) {
                        return Ok(Some(Ending::Interrupted));
                    }
                    self.next_record = ((self.next_record / every).round() + 1.0) * every;
                }
            }
            let sticks = event.sticks && self.stick(definition, i, t);
            if !sticks {
                if !quiet {
                    self.t = t;
                    self.emit(t, Some(&event.name), observe);
                }
                return Ok(Some(Ending::Zeno { event: event.name.clone(), t, error }));
            }
            if !quiet && !self.emit(self.t, Some(&format!("{} at rest", event.name)), observe) {
                return Ok(Some(Ending::Interrupted));
            }
        }
        Ok(None)
    }

    /// Puts motion at rest on an event's surface from `t` on; false if the set state does not move the expression's derivative.
    fn stick(&mut self, definition: &crate::Definition, event: usize, t: f64) -> bool {
        let Some(watched) = self.event_of.iter().position(|e| *e == Some(event)) else { return false };
        let When::Zero(_, direction) = definition.events()[event].when else { return false };
        let Some((state, _)) = definition.events()[event].set.first() else { return false };
        let above = match direction {
            Direction::Up => -1.0,
            Direction::Down => 1.0,
            Direction::Both => {
                if self.watch_side[watched] >= 0.0 {
                    1.0
                } else {
                    -1.0
                }
            }
        };
        let contact = Contact { event, watched, state: *state, above };
        let (config, sliding) = (self.config.clone(), self.sliding.clone());
        self.adopt(config, sliding);
        let mut field = vec![0.0; self.n];
        self.compiled.field.evaluate(&self.variables, &mut field);
        let (_, grip) = self.contact_forces(contact, &field);
        if !grip.is_finite() || grip == 0.0 {
            return false;
        }
        self.contact = Some(contact);
        self.project();
        // What is left of the time that infinitely many take.
        let (now, x, mut rate) = (self.t, self.x.clone(), vec![0.0; self.n]);
        self.rhs(now, &x, &mut rate);
        for i in 0..self.n {
            self.x[i] += (t - now) * rate[i];
        }
        self.t = t;
        self.project();
        true
    }

    /// Puts the state back onto the surfaces that are slid upon, and a contact's derivative to zero.
    fn project(&mut self) {
        if let Some(contact) = self.contact {
            self.variables[..self.n].copy_from_slice(&self.x);
            self.variables[self.n] = self.t;
            let mut field = vec![0.0; self.n];
            self.compiled.field.evaluate(&self.variables, &mut field);
            let slope =
                Self::along(&self.compiled, &self.variables, &field)[self.compiled.active.len() + contact.watched];
            let (_, grip) = self.contact_forces(contact, &field);
            let correction = slope / grip;
            if correction.is_finite() {
                self.x[contact.state] -= correction;
            }
            return;
        }
        let k = self.sliding.len();
        self.variables[..self.n].copy_from_slice(&self.x);
        self.variables[self.n] = self.t;
        let outputs = self.compiled.active.len() + self.equation.watched.len();
        let mut values = vec![0.0; outputs];
        self.compiled.watched.evaluate(&self.variables, &mut values);
        let boundary: Vec<f64> = self
            .sliding
            .iter()
            .map(|g| if self.equation.guards[*g].whole { self.config.sides[*g] + 1.0 } else { 0.0 })
            .collect();
        let off: Vec<f64> =
            self.sliding.iter().zip(&boundary).map(|(g, b)| active_value(&self.compiled, &values, *g) - b).collect();
        if off.iter().all(|v| *v == 0.0) && self.tangents.is_none() {
            return;
        }
        let mut rows = vec![vec![0.0; self.n]; k];
        let mut out = vec![Dual::<f64, 1>::constant(0.0); outputs];
        for i in 0..self.n {
            let mut duals: Vec<Dual<f64, 1>> = self.variables.iter().map(|v| Dual::constant(*v)).collect();
            duals[i].partials = [1.0];
            self.compiled.watched.evaluate(&duals, &mut out);
            for (row, guard) in self.sliding.iter().enumerate() {
                let place = self.compiled.active.iter().position(|g| g == guard);
                rows[row][i] = place.map_or(0.0, |p| out[p].partials[0]);
            }
        }
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
        let mut gram = Vec::with_capacity(k * k);
        for a in &rows {
            gram.extend(rows.iter().map(|b| dot(a, b)));
        }
        let onto = |v: &mut [f64], off: &[f64]| {
            for (row, weight) in rows.iter().zip(solve_any(&gram, off, 0.0).unwrap_or_default()) {
                v.iter_mut().zip(row).for_each(|(v, r)| *v -= weight * r);
            }
        };
        onto(&mut self.x, &off);
        // Rounding carries tangent vectors off the surface, where nothing shrinks them.
        for y in self.tangents.iter_mut().flat_map(|t| &mut t.vectors) {
            let off: Vec<f64> = rows.iter().map(|row| dot(row, y)).collect();
            onto(y, &off);
        }
    }

    // Sides.

    /// The size of the terms that an expression is a sum of, at the present point.
    fn magnitude(&self, e: &Expression) -> f64 {
        match e {
            Expression::Add(a, b) | Expression::Sub(a, b) => self.magnitude(a) + self.magnitude(b),
            Expression::Neg(a) => self.magnitude(a),
            other => self.equation.value(other, self.t, &self.x).abs(),
        }
    }

    /// Which side a guard's value is on; none if it is zero to rounding.
    fn side_of(&self, guard: usize) -> Option<f64> {
        let g = &self.equation.guards[guard];
        let value = self.equation.value(&g.expression, self.t, &self.x);
        if value.is_nan() {
            return Some(if g.whole { 0.0 } else { 1.0 });
        }
        let small = 1e-14 * self.magnitude(&g.expression);
        if g.whole {
            let near = value.round();
            let at_boundary = (value - near).abs() <= small.max(1e-14 * near.abs());
            return if at_boundary { None } else { Some(value.floor()) };
        }
        if value.abs() <= small { None } else { Some(value.signum()) }
    }

    /// Finds all sides anew; those in `zero` are zero.
    fn settle_afresh(&mut self, zero: &[usize]) -> Result<(), HybridError> {
        let mut at_zero = zero.to_vec();
        for guard in 0..self.equation.guards.len() {
            if zero.contains(&guard) {
                continue;
            }
            match self.side_of(guard) {
                Some(side) => self.config.sides[guard] = side,
                None => {
                    self.config.sides[guard] =
                        self.low(guard, &self.config) + if self.equation.guards[guard].whole { 1.0 } else { 2.0 };
                    at_zero.push(guard);
                }
            }
        }
        self.adopt(self.config.clone(), Vec::new());
        self.settle(&at_zero)
    }

    /// Sides of guards that a configuration asks and the present one does not.
    fn ask_new(&mut self, config: &mut Configuration) {
        for _ in 0..8 {
            let compiled = self.equation.compiled(config);
            let mut changed = false;
            for guard in &compiled.active {
                if !self.compiled.active.contains(guard)
                    && let Some(side) = self.side_of(*guard)
                    && config.sides[*guard] != side
                {
                    config.sides[*guard] = side;
                    changed = true;
                }
            }
            if !changed {
                return;
            }
        }
    }

    fn names(&self, guards: &[usize]) -> String {
        let names: Vec<String> = guards
            .iter()
            .map(|g| {
                format!(
                    "{} = {}",
                    self.equation.guards[*g].expression,
                    if self.equation.guards[*g].whole { "a whole number" } else { "0" }
                )
            })
            .collect();
        names.join(" and ")
    }

    fn undecided(&self, zero: &[usize], ways: &str) -> HybridError {
        HybridError::Undecided { t: self.t, x: self.x.clone(), surfaces: self.names(zero), ways: ways.into() }
    }

    /// Decides where motion goes from a point at which the functions in `zero` are zero.
    fn settle(&mut self, zero: &[usize]) -> Result<(), HybridError> {
        // Only what the equations ask here; what they do not ask keeps its side until it is asked.
        let zero: Vec<usize> = zero.iter().copied().filter(|g| self.compiled.active.contains(g)).collect();
        if zero.is_empty() {
            let config = self.config.clone();
            self.adopt(config, Vec::new());
            return Ok(());
        }
        let lows: Vec<f64> = zero.iter().map(|g| self.low(*g, &self.config)).collect();
        let highs: Vec<f64> = zero.iter().map(|g| self.high(*g, &self.config)).collect();
        let vertex = |follower: &mut Self, plus: &dyn Fn(usize) -> bool| {
            let mut config = follower.config.clone();
            for (i, guard) in zero.iter().enumerate() {
                config.sides[*guard] = if plus(i) { highs[i] } else { lows[i] };
            }
            follower.ask_new(&mut config);
            let (compiled, rates) = follower.rates(&config);
            let place: Vec<Option<usize>> = zero.iter().map(|g| compiled.active.iter().position(|a| a == g)).collect();
            (config, place, rates)
        };
        let k = zero.len();
        // Which functions depend on each other.
        let sets = if k == 1 {
            vec![vec![0]]
        } else {
            let (_, place0, base) = vertex(self, &|_| false);
            let mut coupled = vec![false; k * k];
            for j in 0..k {
                let (_, place, rates) = vertex(self, &|i| i == j);
                for i in 0..k {
                    let (Some(a), Some(b)) = (place0[i], place[i]) else {
                        coupled[i * k + j] = i != j;
                        continue;
                    };
                    let scale = base.terms[a] + rates.terms[b];
                    coupled[i * k + j] = i != j && (base.first[a] - rates.first[b]).abs() > 1e-12 * scale;
                }
            }
            groups(k, |i, j| coupled[i * k + j])
        };
        let mut ways = vec![Way::Plus; k];
        for set in &sets {
            if set.len() > MOST_TOGETHER {
                let names: Vec<usize> = set.iter().map(|i| zero[*i]).collect();
                let why = format!(
                    "{} surfaces that depend on each other meet ({}); up to {MOST_TOGETHER} are resolved",
                    set.len(),
                    self.names(&names)
                );
                return Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why });
            }
            let mut cache: std::collections::HashMap<Vec<bool>, (Configuration, Vec<Option<usize>>, Rates)> =
                Default::default();
            let mut at = |follower: &mut Self, plus: Vec<bool>| {
                if !cache.contains_key(&plus) {
                    let all = |i: usize| set.iter().position(|s| *s == i).is_some_and(|p| plus[p]);
                    let made = vertex(follower, &all);
                    cache.insert(plus.clone(), made);
                }
                let (_, place, rates) = &cache[&plus];
                let first: Vec<f64> = set.iter().map(|i| place[*i].map_or(f64::NAN, |p| rates.first[p])).collect();
                let direction: Vec<f64> = set.iter().map(|i| place[*i].map_or(0.0, |p| rates.direction(p))).collect();
                (rates.field.clone(), first, direction)
            };
            // Fields that are the same on both sides decide nothing and need nothing decided.
            if set.len() == 1 {
                let (low, _, d0) = at(self, vec![false]);
                let (high, _, d1) = at(self, vec![true]);
                if same(&low, &high) {
                    let side = if d1[0] != 0.0 { d1[0] } else { d0[0] };
                    let present = self.config.sides[zero[set[0]]];
                    let plus = if side != 0.0 { side > 0.0 } else { present == highs[set[0]] };
                    ways[set[0]] = if plus { Way::Plus } else { Way::Minus };
                    continue;
                }
            }
            let mut not_affine = false;
            let found = possibilities(set.len(), |assignment| {
                let slides: Vec<usize> = (0..set.len()).filter(|i| assignment[*i] == Way::Stay).collect();
                let plus: Vec<bool> = assignment.iter().map(|w| *w == Way::Plus).collect();
                let (field0, base, direction) = at(self, plus.clone());
                let goes = |i: usize, d: f64| match assignment[i] {
                    Way::Plus => d > 0.0,
                    Way::Minus => d < 0.0,
                    Way::Stay => true,
                };
                if slides.is_empty() {
                    return (0..set.len()).all(|i| goes(i, direction[i]));
                }
                let mut columns = Vec::new();
                for s in &slides {
                    let mut flipped = plus.clone();
                    flipped[*s] = true;
                    columns.push(at(self, flipped));
                }
                let m = slides.len();
                let mut matrix = vec![0.0; m * m];
                for (c, (_, rates, _)) in columns.iter().enumerate() {
                    for (r, s) in slides.iter().enumerate() {
                        matrix[r * m + c] = rates[*s] - base[*s];
                    }
                }
                let b: Vec<f64> = slides.iter().map(|s| -base[*s]).collect();
                let Some(weights) = solve_any(&matrix, &b, 0.0) else { return false };
                if m == 1 {
                    // On both sides towards or away from the surface, to second order.
                    let (d0, d1) = (direction[slides[0]], columns[0].2[slides[0]]);
                    if d0 * d1 >= 0.0 {
                        return false;
                    }
                } else if weights.iter().any(|w| !(*w > 0.0 && *w < 1.0)) {
                    return false;
                }
                if m > 1 {
                    let mut all = plus.clone();
                    slides.iter().for_each(|s| all[*s] = true);
                    let (corner, ..) = at(self, all);
                    let predicted: Vec<f64> = (0..field0.len())
                        .map(|i| field0[i] + columns.iter().map(|(f, ..)| f[i] - field0[i]).sum::<f64>())
                        .collect();
                    let size = corner.iter().chain(&field0).fold(0.0_f64, |a, v| a.max(v.abs()));
                    if predicted.iter().zip(&corner).any(|(p, c)| (p - c).abs() > 1e-9 * size) {
                        not_affine = true;
                    }
                }
                (0..set.len()).filter(|i| !slides.contains(i)).all(|i| {
                    let rate =
                        base[i] + columns.iter().zip(&weights).map(|((_, r, _), w)| w * (r[i] - base[i])).sum::<f64>();
                    goes(i, rate)
                })
            });
            let chosen = match found.as_slice() {
                [] => {
                    let names: Vec<usize> = set.iter().map(|i| zero[*i]).collect();
                    return Err(self.undecided(&names, "no way is consistent to first and second order"));
                }
                [one] if not_affine && one.iter().filter(|w| **w == Way::Stay).count() > 1 => {
                    let names: Vec<usize> = set.iter().map(|i| zero[*i]).collect();
                    return Err(self.undecided(
                        &names,
                        "sliding on all of them, where mixtures of the fields have different velocities",
                    ));
                }
                [one] => one.clone(),
                several => {
                    let wanted = match self.options.exit {
                        Exit::Undecided => None,
                        Exit::Plus => several.iter().find(|w| w.iter().all(|w| *w == Way::Plus)),
                        Exit::Minus => several.iter().find(|w| w.iter().all(|w| *w == Way::Minus)),
                    };
                    match wanted {
                        Some(chosen) => chosen.clone(),
                        None => {
                            let names: Vec<usize> = set.iter().map(|i| zero[*i]).collect();
                            let words: Vec<String> =
                                several.iter().map(|w| w.iter().map(|w| w.sign()).collect()).collect();
                            let all = format!("signs {}", words.join(" or "));
                            return Err(self.undecided(&names, &all));
                        }
                    }
                }
            };
            for (i, way) in set.iter().zip(chosen) {
                ways[*i] = way;
            }
        }
        let mut config = self.config.clone();
        let mut sliding = Vec::new();
        for (i, guard) in zero.iter().enumerate() {
            match ways[i] {
                Way::Plus => config.sides[*guard] = highs[i],
                Way::Minus => config.sides[*guard] = lows[i],
                Way::Stay => {
                    config.sides[*guard] = lows[i];
                    sliding.push(*guard);
                }
            }
            self.fresh_guard[*guard] = true;
        }
        self.ask_new(&mut config);
        sliding.sort_unstable();
        self.adopt(config, sliding);
        self.follow_jumps(&zero)
    }

    /// A switch may make other switching functions jump: they are on the side where they arrive.
    fn follow_jumps(&mut self, zero: &[usize]) -> Result<(), HybridError> {
        for _ in 0..MOST_JUMPS {
            let mut config = self.config.clone();
            let mut values = vec![0.0; self.compiled.outputs];
            self.compiled.watched.evaluate(&self.variables, &mut values);
            let mut jumped = false;
            for (i, guard) in self.compiled.active.clone().into_iter().enumerate() {
                if zero.contains(&guard) || self.fresh_guard[guard] {
                    continue;
                }
                let g = &self.equation.guards[guard];
                let side = if g.whole { values[i].floor() } else { values[i].signum() };
                let small = 1e-12 * self.magnitude(&g.expression);
                let off = if g.whole { (values[i] - values[i].round()).abs() } else { values[i].abs() };
                if side != config.sides[guard] && off > small && side.is_finite() {
                    config.sides[guard] = side;
                    jumped = true;
                }
            }
            if !jumped {
                return Ok(());
            }
            self.ask_new(&mut config);
            let sliding = self.sliding.clone();
            self.adopt(config, sliding);
        }
        let why = "switches make each other jump without end: no side of theirs is consistent".into();
        Err(HybridError::Stuck { t: self.t, x: self.x.clone(), why })
    }

    /// Watched expressions that a switch made jump over zero have passed it.
    fn watch_jumps(&mut self, definition: &crate::Definition, passed: &mut Vec<usize>, fired: &mut Vec<usize>) {
        let mut values = vec![0.0; self.compiled.outputs];
        self.compiled.watched.evaluate(&self.variables, &mut values);
        let active = self.compiled.active.len();
        for i in 0..self.watch_side.len() {
            let (value, side) = (values[active + i], self.watch_side[i]);
            let rests = self.contact.is_some_and(|c| c.watched == i) || passed.contains(&i) || side == 0.0;
            if rests || value * side >= 0.0 || value.abs() <= 1e-12 * self.magnitude(&self.equation.watched[i]) {
                continue;
            }
            passed.push(i);
            let Some(event) = self.event_of[i] else { continue };
            let When::Zero(_, direction) = definition.events()[event].when else { continue };
            if direction == Direction::Both || (direction == Direction::Up) == (side < 0.0) {
                fired.push(event);
            }
        }
    }

    /// Finds the side of a watched expression; `zero`: it is zero here, whatever rounding says.
    fn begin_watching(&mut self, i: usize, zero: bool) {
        let place = self.compiled.active.len() + i;
        if !zero {
            let value = self.watched_values()[place];
            if value.abs() > 1e-14 * self.magnitude(&self.equation.watched[i]) {
                self.watch_side[i] = value.signum();
                self.fresh_watch[i] = false;
                return;
            }
        }
        let config = self.config.clone();
        let (_, rates) = self.rates(&config);
        self.watch_side[i] = rates.direction(place);
        self.fresh_watch[i] = true;
    }

    /// The values of guards and watched expressions at the present point.
    fn watched_values(&mut self) -> Vec<f64> {
        let mut values = vec![0.0; self.compiled.outputs];
        self.variables[..self.n].copy_from_slice(&self.x);
        self.variables[self.n] = self.t;
        self.compiled.watched.evaluate(&self.variables, &mut values);
        values
    }

    fn note_conditions(&mut self) {
        for (i, event) in self.model.definition().events().iter().enumerate() {
            if let When::Becomes(e) = &event.when {
                self.holds[i] = self.equation.holds(e, &self.config);
            }
        }
    }
}

/// The determinant of -a, of k rows, by elimination with pivots.
fn determinant_of_negative(mut a: Vec<f64>, k: usize) -> f64 {
    let mut product = 1.0;
    for column in 0..k {
        let size = |i: &usize| a[*i * k + column].abs();
        let pivot = (column..k).max_by(|i, j| size(i).total_cmp(&size(j))).unwrap_or(column);
        if pivot != column {
            (0..k).for_each(|j| a.swap(column * k + j, pivot * k + j));
            product = -product;
        }
        let diagonal = a[column * k + column];
        product *= -diagonal;
        for row in column + 1..k {
            let factor = a[row * k + column] / diagonal;
            for j in column..k {
                a[row * k + j] -= factor * a[column * k + j];
            }
        }
    }
    product
}

/// The value of a guard among those of a compiled structure.
fn active_value(compiled: &Compiled, values: &[f64], guard: usize) -> f64 {
    compiled.active.iter().position(|g| *g == guard).map_or(f64::NAN, |i| values[i])
}

/// Times at which something is known to happen: events' and tables' knots.
struct Clock {
    /// Times to come, latest first, each with its event.
    once: Vec<(f64, Option<usize>)>,
    /// Period, next multiple, event.
    periodic: Vec<(f64, f64, usize)>,
}

impl Clock {
    fn new(follower: &Follower) -> Result<Self, HybridError> {
        let constant =
            |e: &Expression| crate::model::evaluate(e, &|name| follower.equation.values().get(name).copied());
        let mut clock = Self { once: Vec::new(), periodic: Vec::new() };
        for (i, event) in follower.model.definition().events().iter().enumerate() {
            match &event.when {
                When::At(times) => {
                    for time in times {
                        let time = constant(time);
                        if !time.is_finite() {
                            return Err(HybridError::Bad(format!(
                                "{}: `at` is {time}; give a finite time",
                                event.name
                            )));
                        }
                        if time > follower.t || time == follower.options.t_start {
                            clock.once.push((time, Some(i)));
                        }
                    }
                }
                When::Every(period) => {
                    let period = constant(period);
                    if !(period.is_finite() && period > 0.0) {
                        return Err(HybridError::Bad(format!(
                            "{}: `every` is {period}; give a time above 0",
                            event.name
                        )));
                    }
                    clock.periodic.push((period, (follower.t / period).floor() + 1.0, i));
                }
                _ => {}
            }
        }
        for table in &follower.equation.tables {
            clock.once.extend(table.knots.iter().filter(|k| **k > follower.t).map(|k| (*k, None)));
        }
        clock.once.sort_by(|a, b| b.0.total_cmp(&a.0));
        Ok(clock)
    }

    fn next(&self) -> Option<f64> {
        let once = self.once.last().map(|(t, _)| *t);
        let periodic = self.periodic.iter().map(|(p, k, _)| p * k).fold(f64::INFINITY, f64::min);
        Some(once.unwrap_or(f64::INFINITY).min(periodic)).filter(|t| t.is_finite())
    }

    /// The events that happen by `t`, in the file's order.
    fn take(&mut self, t: f64) -> Vec<usize> {
        let mut happening = Vec::new();
        while let Some((_, event)) = self.once.pop_if(|(time, _)| *time <= t) {
            happening.extend(event);
        }
        for (period, multiple, event) in &mut self.periodic {
            while *period * *multiple <= t {
                *multiple += 1.0;
                happening.push(*event);
            }
        }
        happening.sort_unstable();
        happening.dedup();
        happening
    }
}
