//! Detection of structure that a step jumps over.
//!
//! A method evaluates an equation at few places in a step. A transition function, an exponential or
//! a resonance that rises and falls between them leaves no trace in its error estimate. [`Guarded`]
//! looks at each accepted step's continuous extension: it bounds how far the arguments of all
//! operations that can be flat far away and steep near by (gates) leave the chords between their
//! values at the step's ends. Nearly always that shows that none of them comes near its steep part,
//! that it hardly moves, or that it goes through once, and the step stands. Otherwise the step is
//! searched by bisection, and where the right-hand side along the continuous extension is found
//! outside what the method saw (its values at the step's ends and the extension's own derivative:
//! the defect, Enright 1989) by more than the tolerance allows, the step is taken back. The method
//! then ends a step where the structure begins and goes through it with short steps.
//!
//! A step that stands is exactly the method's own.
//!
//! Where the argument of a sign (a kink of `abs`, a jump) changes its own inside a step, the step
//! is taken back, too, and ends just behind that zero, unless the tolerance could not tell (Hairer,
//! Norsett & Wanner 1993, sec. II.6). A jump that attracts from both sides is refused.
//!
//! Of a discontinuous system the fields at work are looked at, up to the surface, and a switching
//! function as far as a step would miss that it passes the level at which it acts.

use std::sync::Arc;

use nalgebra::SVector;

use super::roots::brent;
use super::step::{Failure, Interpolant, Statistics, Step, Stepper, Tolerance};
use twofold_num::elementary::ln;
use twofold_num::series::HIGH_POWER;
use twofold_num::tape::{Node, Operation, Replay};
use twofold_num::{Decimal, Elementary, Tape};
use twofold_system::VectorField;
use twofold_system::singular::{Ends, written_sign};

/// The numbers between two bounds, up to a few roundings.
#[derive(Clone, Copy, Debug)]
struct Range {
    low: f64,
    high: f64,
}

impl Range {
    const ALL: Self = Self { low: f64::NEG_INFINITY, high: f64::INFINITY };

    fn new(low: f64, high: f64) -> Self {
        // Also if one is no number.
        if low <= high { Self { low, high } } else { Self::ALL }
    }

    fn of(values: impl IntoIterator<Item = f64>) -> Self {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for v in values {
            if v.is_nan() {
                return Self::ALL;
            }
            low = low.min(v);
            high = high.max(v);
        }
        Self::new(low, high)
    }

    fn width(self) -> f64 {
        self.high - self.low
    }

    /// The largest absolute value, and the smallest.
    fn sizes(self) -> (f64, f64) {
        let least = if self.low <= 0.0 && self.high >= 0.0 {
            0.0
        } else {
            self.low.abs().min(self.high.abs())
        };
        (self.low.abs().max(self.high.abs()), least)
    }
}

/// A number along a step: its values at the step's ends, and a bound on how far it leaves the chord
/// between them (up to a few roundings).
#[derive(Clone, Copy, Debug)]
struct Along {
    ends: [f64; 2],
    bend: f64,
}

impl Along {
    fn new(ends: [f64; 2], bend: f64) -> Self {
        // A bound that is not a number is infinite.
        Self { ends, bend: if bend >= 0.0 { bend } else { f64::INFINITY } }
    }

    fn constant(value: f64) -> Self {
        Self { ends: [value; 2], bend: 0.0 }
    }

    fn range(self) -> Range {
        let range = Range::of(self.ends);
        Range::new(range.low - self.bend, range.high + self.bend)
    }

    fn change(self) -> f64 {
        (self.ends[1] - self.ends[0]).abs()
    }

    /// The larger of its sizes at the ends.
    fn size(self) -> f64 {
        self.ends[0].abs().max(self.ends[1].abs())
    }

    fn plus(self, other: Self, sign: f64) -> Self {
        let ends = [0, 1].map(|i| self.ends[i] + sign * other.ends[i]);
        Self::new(ends, self.bend + other.bend)
    }

    fn changes_sign(self) -> bool {
        self.ends[0] < 0.0 && self.ends[1] > 0.0 || self.ends[0] > 0.0 && self.ends[1] < 0.0
    }

    /// A product of chords leaves its own by theta (1 - theta) times both changes.
    fn times(self, other: Self) -> Self {
        let ends = [0, 1].map(|i| self.ends[i] * other.ends[i]);
        let bent = self.bend * other.size() + other.bend * self.size() + self.bend * other.bend;
        Self::new(ends, 0.25 * self.change() * other.change() + bent)
    }

    /// A function of it, with bounds on its slope and curvature in the range, and on how far it
    /// leaves any value that it takes there.
    fn through(self, f: impl Fn(f64) -> f64, slope: f64, curvature: f64, most: f64) -> Self {
        let change = self.change();
        let bend = 0.125 * curvature * change * change + slope * self.bend;
        Self::new(self.ends.map(f), if bend < most { bend } else { most })
    }

    /// A function that goes from -1 to 1 and is flat far from zero.
    fn through_step(self, f: impl Fn(f64) -> f64, slope: f64, curvature: f64) -> Self {
        let (_, least) = self.range().sizes();
        let most = if least > 0.0 { 1.0 - f(least) } else { 2.0 };
        self.through(f, slope, curvature, most)
    }

    fn reciprocal(self) -> Self {
        let (_, least) = self.range().sizes();
        let square = least * least;
        self.through(f64::recip, 1.0 / square, 2.0 / (square * least), f64::INFINITY)
    }
}

/// An operation that can be flat where a method looks and steep elsewhere, by its argument.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Gate {
    /// tanh, erf: flat beyond this argument.
    Step(f64),
    /// The same, of which the equation is no linear function: 1 - tanh^2 is a pulse.
    Pulse(f64),
    Sign,
    Exp,
    /// A quotient's divisor, the argument of a root, a logarithm or an arc tangent: smooth in its
    /// own scale.
    Scale,
    /// Sine and cosine.
    Wave,
    /// A high power, with its exponent.
    Power(f64),
}

/// An argument may move so much without being looked at closer.
const SMALL_MOVE: f64 = 1.0;
/// An argument that leaves the chord by so little goes one way.
pub(super) const SMALL_BEND: f64 = 0.1;
/// Beyond this argument tanh is +-1 to 4e-9.
const TANH_FLAT: f64 = 10.0;
/// The same of erf.
const ERF_FLAT: f64 = 4.2;
/// Below this argument an exponential is nothing: 4e-18.
const EXP_FLAT: f64 = -40.0;
/// A factor by which a divisor may change.
const SMALL_FACTOR: f64 = 8.0;

impl Gate {
    fn of(operation: Operation, (base, exponent): (Node, u32)) -> Option<(Self, Node)> {
        match operation {
            Operation::Mul(..) if exponent >= HIGH_POWER => {
                Some((Self::Power(f64::from(exponent)), base))
            }
            Operation::Tanh(a) => Some((Self::Step(TANH_FLAT), a)),
            Operation::Erf(a) => Some((Self::Step(ERF_FLAT), a)),
            Operation::Sign(a) => Some((Self::Sign, a)),
            Operation::Exp(a) => Some((Self::Exp, a)),
            Operation::Div(_, a) | Operation::Sqrt(a) | Operation::Ln(a) | Operation::Atan(a) => {
                Some((Self::Scale, a))
            }
            Operation::Sin(a) | Operation::Cos(a) => Some((Self::Wave, a)),
            _ => None,
        }
    }

    /// Whether it passes what it passes only once, from its value at one end of the step to that at
    /// the other.
    fn is_passed_once(self, w: Along) -> bool {
        let (_, least) = w.range().sizes();
        match self {
            Self::Step(_) | Self::Exp => w.bend <= SMALL_BEND,
            Self::Sign => w.bend <= SMALL_BEND * w.change(),
            Self::Scale => w.bend <= SMALL_BEND * least,
            Self::Power(n) => n * w.bend <= SMALL_BEND * least,
            Self::Wave | Self::Pulse(_) => false,
        }
    }

    /// Whether it does nothing that a method could miss while its argument is in this range.
    fn is_quiet(self, w: Range) -> bool {
        let (most, least) = w.sizes();
        match self {
            Self::Step(flat) | Self::Pulse(flat) => w.width() <= SMALL_MOVE || least >= flat,
            Self::Sign => w.low >= 0.0 || w.high < 0.0,
            Self::Exp => w.width() <= SMALL_MOVE || w.high <= EXP_FLAT,
            Self::Scale => most <= SMALL_FACTOR * least || w.width() <= 0.0,
            Self::Wave => w.width() <= 3.0 * SMALL_MOVE,
            Self::Power(n) => n * (most - least) <= SMALL_MOVE * least || n * ln(most) <= EXP_FLAT,
        }
    }
}

/// Whether all outputs are linear functions of tanh and erf of this argument.
fn is_linear_in_steps(tape: &Tape, argument: Node) -> bool {
    let mut degree: Vec<u32> = Vec::with_capacity(tape.operations().len());
    for operation in tape.operations() {
        let of = |a: Node| degree[a];
        let own = match *operation {
            Operation::Tanh(a) | Operation::Erf(a) if a == argument => 1,
            Operation::Add(a, b) | Operation::Sub(a, b) => of(a).max(of(b)),
            Operation::Mul(a, b) => of(a).saturating_add(of(b)),
            Operation::Neg(a) => of(a),
            Operation::Div(a, b) if of(b) == 0 => of(a),
            other => 2 * other.arguments().map(of).max().unwrap_or(0),
        };
        degree.push(own.min(2));
    }
    tape.outputs().iter().all(|node| degree[*node] <= 1)
}

/// The only gate of an equation, where its argument is a linear function of the state: offset +
/// slopes . x.
#[derive(Clone, Debug)]
pub(super) struct Plain {
    pub(super) slopes: Vec<f64>,
    pub(super) offset: f64,
    pub(super) flat: f64,
}

impl Plain {
    fn new(tape: &Tape, gate: Gate, argument: Node) -> Option<Self> {
        let Gate::Step(flat) = gate else { return None };
        let fixed = tape.values(&vec![0.0; tape.variables()]);
        // None: not linear.
        let mut slopes: Vec<Option<Vec<f64>>> = Vec::with_capacity(argument + 1);
        let none = vec![0.0; tape.variables()];
        for operation in &tape.operations()[..=argument] {
            let of = |a: Node| slopes[a].as_ref();
            let is_fixed = |a: Node| of(a).is_some_and(|s| s.iter().all(|v| *v == 0.0));
            let scaled =
                |a: Node, by: f64| of(a).map(|s| s.iter().map(|v| v * by).collect::<Vec<f64>>());
            let sum = |a: Node, b: Node, sign: f64| -> Option<Vec<f64>> {
                Some(of(a)?.iter().zip(of(b)?).map(|(a, b)| a + sign * b).collect())
            };
            let linear = match *operation {
                Operation::Variable(i) => {
                    let mut slopes = none.clone();
                    slopes[i] = 1.0;
                    Some(slopes)
                }
                Operation::Add(a, b) => sum(a, b, 1.0),
                Operation::Sub(a, b) => sum(a, b, -1.0),
                Operation::Neg(a) => scaled(a, -1.0),
                Operation::Mul(a, b) if is_fixed(b) => scaled(a, fixed[b]),
                Operation::Mul(a, b) if is_fixed(a) => scaled(b, fixed[a]),
                Operation::Div(a, b) if is_fixed(b) => scaled(a, 1.0 / fixed[b]),
                other => other.arguments().all(is_fixed).then(|| none.clone()),
            };
            slopes.push(linear);
        }
        let slopes = slopes.pop().flatten()?;
        Some(Self { slopes, offset: fixed[argument], flat })
    }

    /// Whether nothing can be hidden in the step, as far as little work shows: a sufficient
    /// condition, with the operations and the order of those in [`ensemble`](super::ensemble).
    fn hides_nothing<const N: usize>(&self, step: &Step<'_, N>) -> bool {
        let (mut w0, mut w1, mut bend) = (self.offset, self.offset, 0.0);
        for (i, slope) in self.slopes.iter().enumerate().filter(|(_, slope)| **slope != 0.0) {
            w0 += slope * step.x0[i];
            w1 += slope * step.x1[i];
            bend += slope.abs() * step.interpolant.bend(i);
        }
        let far = self.flat + bend;
        bend <= SMALL_BEND || (w0 >= far && w1 >= far) || (w0 <= -far && w1 <= -far)
    }
}

/// An equation's gates, ready to be looked at.
#[derive(Clone, Debug)]
pub(super) struct Gates {
    tape: Arc<Tape>,
    gates: Vec<(Gate, Node)>,
    /// Signs, each with its argument.
    signs: Vec<[Node; 2]>,
    plain: Option<Plain>,
    /// The operations that gates' arguments need, and those that the whole equation does.
    needed: [Vec<Node>; 2],
    /// Operations without variables.
    fixed: Vec<f64>,
    along: Vec<Along>,
    values: Vec<f64>,
    ends: Option<Ends>,
    /// Whether a step may lead to where the equation is not that of the motion and need not have a
    /// value: over a switching surface.
    leads_over: bool,
    /// Levels between which the last output, a switching function, is told apart.
    levels: Option<Vec<f64>>,
    /// Whether the last output is a switching function at whose zero the motion leaves the field.
    ends_at_zero: bool,
}

impl Gates {
    /// None, if the equation has no gates.
    pub(super) fn new(tape: Arc<Tape>) -> Option<Self> {
        Self::of(tape, |_| true)
    }

    /// Those of the operations in `wanted`.
    fn of(tape: Arc<Tape>, wanted: fn(Operation) -> bool) -> Option<Self> {
        let operations = tape.operations();
        let mut moves = vec![false; operations.len()];
        for (node, operation) in operations.iter().enumerate() {
            moves[node] = matches!(operation, Operation::Variable(_))
                || operation.arguments().any(|a| moves[a]);
        }
        let (live, powers) = (tape.needed(), tape.powers());
        let (mut gates, mut signs) = (Vec::<(Gate, Node)>::new(), Vec::new());
        for node in (0..operations.len()).filter(|node| live[*node] && wanted(operations[*node])) {
            if let Operation::Sign(argument) = operations[node]
                && moves[argument]
            {
                signs.push([node, argument]);
            }
            let gate = Gate::of(operations[node], powers[node]).filter(|(_, a)| moves[*a]);
            let gate = gate.map(|gate| match gate {
                (Gate::Step(flat), a) if !is_linear_in_steps(&tape, a) => (Gate::Pulse(flat), a),
                other => other,
            });
            if let Some(gate) = gate.filter(|gate| !gates.contains(gate)) {
                gates.push(gate);
            }
        }
        if gates.is_empty() {
            return None;
        }
        let mut for_gates = vec![false; operations.len()];
        gates.iter().for_each(|(_, node)| for_gates[*node] = true);
        for node in (0..operations.len()).rev().filter(|node| moves[*node]) {
            if for_gates[node] {
                operations[node].arguments().for_each(|a| for_gates[a] = true);
            }
        }
        let list = |wanted: &[bool]| {
            (0..operations.len()).filter(|node| wanted[*node] && moves[*node]).collect()
        };
        let needed = [list(&for_gates), list(&live)];
        let fixed = tape.values(&vec![0.0; tape.variables()]);
        let along = fixed.iter().map(|v| Along::constant(*v)).collect();
        let plain = match gates[..] {
            [(gate, argument)] => Plain::new(&tape, gate, argument),
            _ => None,
        };
        let ends = Ends::new(tape.clone());
        Some(Self {
            needed,
            values: fixed.clone(),
            fixed,
            along,
            gates,
            signs,
            plain,
            tape,
            ends,
            leads_over: false,
            levels: None,
            ends_at_zero: false,
        })
    }

    /// The same of a field that need not have a value where steps lead. Roots and logarithms are
    /// steep where their domain ends, which a motion on a surface may touch.
    pub(super) fn of_part(tape: Arc<Tape>) -> Option<Self> {
        let wanted = |operation| !matches!(operation, Operation::Sqrt(_) | Operation::Ln(_));
        Some(Self { ends: None, leads_over: true, ..Self::of(tape, wanted)? })
    }

    /// The same of the field on one side of h = 0, up to there.
    pub(super) fn of_side(field: Arc<Tape>, h: &Tape) -> Option<Self> {
        Some(Self { levels: None, ends_at_zero: true, ..Self::with_switch(&[field], h, &[])? })
    }

    /// The same of a mixture of fields and of a switching function that is told apart at some
    /// levels.
    pub(super) fn with_switch(fields: &[Arc<Tape>], h: &Tape, levels: &[f64]) -> Option<Self> {
        let named: &Tape = fields.first().map_or(h, |field| field);
        let n = named.variables();
        let tape = Tape::record(n, |x| {
            let mut out = Vec::new();
            for field in fields {
                let mut field = Replay::new(field, x);
                out.extend((0..n).map(|i| field.output(i)));
            }
            out.push(Replay::new(h, &x[..h.variables()]).output(0));
            out
        });
        let tape = tape.with_names((0..n).map(|i| named.name(i)));
        let kept = tape.outputs().len() - 1;
        let of_fields = tape.select(0..kept).needed();
        let mut gates = Self { levels: Some(levels.to_vec()), ..Self::of_part(Arc::new(tape))? };
        // A kink of h is none of the motion.
        gates.signs.retain(|[sign, _]| of_fields[*sign]);
        Some(gates)
    }

    pub(super) fn plain(&self) -> Option<&Plain> {
        self.plain.as_ref()
    }

    /// Whether nothing can be hidden in a step with these states: all gates are quiet, or all but
    /// one that is passed once.
    fn hide_nothing(&mut self, x: impl Fn(usize) -> Along) -> bool {
        let operations = self.tape.operations();
        for node in &self.needed[0] {
            let v = &self.along;
            let along = match operations[*node] {
                Operation::Variable(i) => x(i),
                Operation::Constant(_) | Operation::Parameter(_) | Operation::Pi => continue,
                Operation::Add(a, b) => v[a].plus(v[b], 1.0),
                Operation::Sub(a, b) => v[a].plus(v[b], -1.0),
                Operation::Mul(a, b) => v[a].times(v[b]),
                Operation::Div(a, b) => v[a].times(v[b].reciprocal()),
                Operation::Neg(a) => Along { ends: v[a].ends.map(|v| -v), ..v[a] },
                // Bounds of the functions' first and second derivatives.
                Operation::Tanh(a) => v[a].through_step(Elementary::tanh, 1.0, 0.77),
                Operation::Erf(a) => v[a].through_step(Elementary::erf, 1.13, 0.97),
                Operation::Sign(a) => {
                    let (_, least) = v[a].range().sizes();
                    let jump = if least > 0.0 { 0.0 } else { 2.0 };
                    Along::new(v[a].ends.map(Elementary::sign), jump)
                }
                Operation::Exp(a) => {
                    let most = Elementary::exp(v[a].range().high);
                    v[a].through(Elementary::exp, most, most, most)
                }
                Operation::Ln(a) => {
                    let least = v[a].range().low.max(0.0);
                    v[a].through(Elementary::ln, 1.0 / least, 1.0 / (least * least), f64::INFINITY)
                }
                Operation::Sqrt(a) => {
                    let root = Elementary::sqrt(v[a].range().low.max(0.0));
                    v[a].through(
                        Elementary::sqrt,
                        0.5 / root,
                        0.25 / (root * root * root),
                        f64::INFINITY,
                    )
                }
                Operation::Sin(a) => v[a].through(Elementary::sin, 1.0, 1.0, 2.0),
                Operation::Cos(a) => v[a].through(Elementary::cos, 1.0, 1.0, 2.0),
                Operation::Atan(a) => {
                    v[a].through(Elementary::atan, 1.0, 0.65, std::f64::consts::PI)
                }
            };
            self.along[*node] = along;
        }
        let mut passed = 0;
        self.gates.iter().all(|(gate, node)| {
            let w = self.along[*node];
            gate.is_quiet(w.range()) || {
                passed += 1;
                passed == 1 && gate.is_passed_once(w)
            }
        })
    }

    /// Computes the operations of gates' arguments, or all, at `x`; one of them may be `given`.
    fn evaluate(&mut self, x: &[f64], all: bool, given: Option<(Node, f64)>) {
        let operations = self.tape.operations();
        for node in &self.needed[usize::from(all)] {
            if let Some((_, value)) = given.filter(|(given, _)| given == node) {
                self.values[*node] = value;
                continue;
            }
            let v = &self.values;
            self.values[*node] = match operations[*node] {
                Operation::Variable(i) => x[i],
                Operation::Constant(_) | Operation::Parameter(_) | Operation::Pi => {
                    self.fixed[*node]
                }
                other => self.tape.apply(other, Decimal::value, |node| v[node]),
            };
        }
    }

    /// The gates' arguments at `x`.
    fn arguments(&mut self, x: &[f64]) -> Vec<f64> {
        self.evaluate(x, false, None);
        self.gates.iter().map(|(_, node)| self.values[*node]).collect()
    }

    /// The outputs at `x`.
    fn outputs(&mut self, x: &[f64]) -> Vec<f64> {
        self.outputs_given(x, None)
    }

    fn outputs_given(&mut self, x: &[f64], given: Option<(Node, f64)>) -> Vec<f64> {
        self.evaluate(x, true, given);
        self.tape.outputs().iter().map(|node| self.values[*node]).collect()
    }

    /// Whether all gates are quiet between five equidistant samples of their arguments, which are
    /// smooth but where another gate is not quiet.
    fn are_quiet_between(&self, samples: [&[f64]; 5]) -> bool {
        self.gates.iter().enumerate().all(|(i, (gate, _))| {
            let w = samples.map(|s| s[i]);
            let second = |k: usize| (w[k - 1] - 2.0 * w[k] + w[k + 1]).abs();
            // Twice what a parabola leaves the range of its samples by.
            let reach = 0.25 * second(1).max(second(2)).max(second(3));
            let range = Range::of(w);
            gate.is_quiet(Range::new(range.low - reach, range.high + reach))
        })
    }
}

/// Why a step is taken back.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Undone {
    /// It has missed structure between these times.
    Structure([f64; 2]),
    /// The argument of a sign passes zero inside it, and has just done so at this time.
    SignChange(f64),
}

/// A step that ends so many resolutions of time behind a sign's change has ended at it.
const LANDED: f64 = 1e3;
/// A change of a sign is landed on if the step can err by more than this part of the tolerance.
const FELT: f64 = 0.01;
/// Steps towards one change of a sign that are taken back because it is found earlier in them.
const MOST_LANDINGS: u32 = 8;

/// A missed part of a step, as fractions of it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Missed {
    from: f64,
    to: f64,
}

/// The smallest part of a step that is halved again.
const FINEST: f64 = 1e-12;
/// Most parts of a step that are looked at; a step with more is made in shorter ones.
const MOST_PARTS: usize = 4000;
/// Largest error that a step may have missed, as a multiple of the tolerance: one that its error
/// estimate does not show.
const ALLOWED: f64 = 20.0;
/// The right-hand side is outside what the method saw if by so much of its variation there.
const OUTSIDE: f64 = 0.1;

/// A part of a step, with the gates' arguments at five places in it.
struct Piece {
    from: f64,
    to: f64,
    samples: [Vec<f64>; 5],
}

impl Gates {
    /// Why the step is to be taken back, if it is. A step that the domain of the equation does not
    /// hold is an error.
    pub(super) fn missed<const N: usize>(
        &mut self,
        step: &Step<'_, N>,
        tolerance: Tolerance,
    ) -> Result<Option<Undone>, Failure> {
        if self.plain.as_ref().is_some_and(|plain| plain.hides_nothing(step)) {
            return Ok(None);
        }
        let state = |i: usize| Along::new([step.x0[i], step.x1[i]], step.interpolant.bend(i));
        if !self.hide_nothing(state) {
            if let Some(Missed { from, to }) = self.searched(step, tolerance) {
                return Ok(Some(Undone::Structure([from, to].map(|theta| step.time(theta)))));
            }
            step.stays_in_domain(self.ends.as_ref())?;
        }
        let along = &self.along;
        if self.signs.iter().any(|[_, argument]| along[*argument].changes_sign()) {
            return self.first_sign_change(step, tolerance);
        }
        Ok(None)
    }

    /// Argument of a sign at `x`.
    fn argument(&mut self, argument: Node, x: &[f64]) -> f64 {
        self.evaluate(x, false, None);
        self.values[argument]
    }

    /// The first change of a sign in the step, but at its ends, of which the motion can tell.
    ///
    /// # Errors
    /// If the motion stays there.
    #[cold]
    #[inline(never)]
    fn first_sign_change<const N: usize>(
        &mut self,
        step: &Step<'_, N>,
        tolerance: Tolerance,
    ) -> Result<Option<Undone>, Failure> {
        let h = step.length();
        let resolution = 4.0 * f64::EPSILON * (step.t0.abs() + h);
        let mut first: Option<(f64, [Node; 2])> = None;
        for sign in self.signs.clone() {
            let along = self.along[sign[1]];
            if !along.changes_sign() || !self.is_felt(sign[0], step, tolerance) {
                continue;
            }
            let argument = |theta: f64| self.argument(sign[1], step.at(theta).as_slice());
            let theta = brent(argument, 0.0, 1.0, along.ends[0], along.ends[1]);
            let inside = theta * h > resolution && (1.0 - theta) * h > LANDED * resolution;
            if inside && first.is_none_or(|(earliest, _)| theta < earliest) {
                first = Some((theta, sign));
            }
        }
        let Some((theta, [sign, argument])) = first else { return Ok(None) };
        if self.attracts(step, theta, argument) {
            return Err(Failure::StaysOnJump {
                t: step.time(theta),
                state: Failure::state(&step.at(theta)),
                what: written_sign(&self.tape, sign),
            });
        }
        Ok(Some(Undone::SignChange(step.time(theta) + resolution)))
    }

    /// Whether the right-hand side at the step's end with the sign as it was at its beginning is so
    /// much another that the tolerance could tell.
    fn is_felt<const N: usize>(
        &mut self,
        sign: Node,
        step: &Step<'_, N>,
        tolerance: Tolerance,
    ) -> bool {
        self.evaluate(step.x0.as_slice(), true, None);
        let before = self.values[sign];
        let as_before = self.outputs_given(step.x1.as_slice(), Some((sign, before)));
        let now = self.outputs(step.x1.as_slice());
        let has_switch = self.levels.is_some() || self.ends_at_zero;
        let components = now.len() - usize::from(has_switch);
        as_before.iter().zip(&now).take(components).enumerate().any(|(o, (before, now))| {
            let i = o % N;
            let size = step.x0[i].abs().max(step.x1[i].abs());
            let allowed = FELT * (tolerance.atol + tolerance.rtol * size);
            let slight = (before - now).abs() * step.length() <= allowed;
            !slight
        })
    }

    /// Whether the velocities on both sides of an argument's zero lead to it (Filippov 1988,
    /// sec. 4): alike near it and very near, as they are beside a jump and not beside a tangency.
    fn attracts<const N: usize>(&mut self, step: &Step<'_, N>, theta: f64, argument: Node) -> bool {
        let has_switch = self.levels.is_some() || self.ends_at_zero;
        let mixed = self.tape.outputs().len() - usize::from(has_switch) > N;
        let weight = if mixed { self.weight(step) } else { 0.0 };
        let rise = (self.along[argument].ends[1] - self.along[argument].ends[0]).signum();
        // In short steps as far as rounding of the time and the state allows.
        let resolution = 4.0 * f64::EPSILON * (step.t0.abs() + step.length());
        let delta = (1e-6 * step.length()).max(LANDED * resolution);
        let close = (0.1 * delta / step.length()).max(1e-6);
        // Towards the side that is come to, from `apart` behind or before the zero.
        let mut rate = |apart: f64| {
            let x = step.at((theta + apart).clamp(0.0, 1.0));
            let out = self.outputs(x.as_slice());
            let mut ahead = x;
            for (i, x) in ahead.iter_mut().enumerate().take(out.len()) {
                let other = if mixed { out[N + i] - out[i] } else { 0.0 };
                *x += delta * (out[i] + weight * other);
            }
            let before = self.argument(argument, x.as_slice());
            rise * (self.argument(argument, ahead.as_slice()) - before)
        };
        let near = [rate(-close), rate(close)];
        let farther = [rate(-1e3 * close), rate(1e3 * close)];
        near[0] > 0.0
            && near[1] < 0.0
            && near[0] > 0.1 * farther[0]
            && near[1] < 0.1 * farther[1]
            && farther[0] > 0.0
            && farther[1] < 0.0
    }

    /// The weight of the second of two fields in the velocity at the beginning of the step.
    fn weight<const N: usize>(&mut self, step: &Step<'_, N>) -> f64 {
        let velocity = (step.at(DIFFERENCE) - step.x0) / (DIFFERENCE * step.length());
        let out = self.outputs(step.x0.as_slice());
        let apart = SVector::<f64, N>::from_fn(|i, _| out[N + i] - out[i]);
        let from_first = SVector::<f64, N>::from_fn(|i, _| velocity[i] - out[i]);
        let weight = apart.dot(&from_first) / apart.norm_squared();
        if weight.is_nan() { 0.0 } else { weight.clamp(0.0, 1.0) }
    }

    #[cold]
    #[inline(never)]
    fn searched<const N: usize>(
        &mut self,
        step: &Step<'_, N>,
        tolerance: Tolerance,
    ) -> Option<Missed> {
        let at = |gates: &mut Self, theta: f64| gates.arguments(step.at(theta).as_slice());
        let five = |from: f64, to: f64| {
            std::array::from_fn::<f64, 5, _>(|k| from + 0.25 * k as f64 * (to - from))
        };
        let mut open = vec![Piece {
            from: 0.0,
            to: 1.0,
            samples: five(0.0, 1.0).map(|theta| at(self, theta)),
        }];
        let mut leaves: Vec<(f64, f64)> = Vec::new();
        while let Some(Piece { from, to, samples }) = open.pop() {
            let whole = to - from == 1.0;
            let quiet = self.are_quiet_between(std::array::from_fn(|k| &samples[k][..]));
            if quiet && whole {
                return None;
            }
            if quiet || to - from < FINEST {
                leaves.push((from, to));
                continue;
            }
            if leaves.len() + open.len() > MOST_PARTS {
                // Too long to be searched: shorter steps are.
                return Some(Missed { from: 0.0, to: 1.0 });
            }
            let middle = 0.5 * (from + to);
            let [a, b, c, d, e] = samples;
            let between = |gates: &mut Self, from: f64, to: f64| at(gates, 0.5 * (from + to));
            let quarter = 0.25 * (to - from);
            let right = [
                c.clone(),
                between(self, middle, middle + quarter),
                d,
                between(self, middle + quarter, to),
                e,
            ];
            let left = [
                a,
                between(self, from, from + quarter),
                b,
                between(self, from + quarter, middle),
                c,
            ];
            open.push(Piece { from: middle, to, samples: right });
            open.push(Piece { from, to: middle, samples: left });
        }
        self.defect(step, tolerance, &leaves)
    }

    /// Part of a step in which the right-hand side leaves the range that the method saw, if this
    /// exceeds the allowed error.
    fn defect<const N: usize>(
        &mut self,
        step: &Step<'_, N>,
        tolerance: Tolerance,
        leaves: &[(f64, f64)],
    ) -> Option<Missed> {
        let h = step.length();
        let (f0, f1) = (self.outputs(step.x0.as_slice()), self.outputs(step.x1.as_slice()));
        let last = f0.len() - 1;
        let has_switch = self.levels.is_some() || self.ends_at_zero;
        let components = f0.len() - usize::from(has_switch);
        let hidden = |levels: &[f64], value: f64| {
            levels.iter().any(|level| {
                let beyond = |v: f64| v > *level;
                beyond(f0[last]) == beyond(f1[last]) && beyond(value) != beyond(f0[last])
            })
        };
        // Neighbouring parts in which something was missed are one structure.
        let mut structures: Vec<(Missed, SVector<f64, N>)> = Vec::new();
        let mut began = f0[last];
        'leaves: for &(from, to) in leaves {
            let mut outside = SVector::<f64, N>::zeros();
            // Boole's rule.
            for (k, weight) in [7.0, 32.0, 12.0, 32.0, 7.0].into_iter().enumerate() {
                let theta = from + 0.25 * k as f64 * (to - from);
                let f = self.outputs(step.at(theta).as_slice());
                if self.levels.as_ref().is_some_and(|levels| hidden(levels, f[last])) {
                    return Some(Missed { from, to });
                }
                if self.ends_at_zero {
                    began = if began == 0.0 { f[last] } else { began };
                    if began * f[last] < 0.0 {
                        break 'leaves;
                    }
                }
                let (before, after) =
                    ((theta - DIFFERENCE).max(0.0), (theta + DIFFERENCE).min(1.0));
                let at = |theta: f64| step.interpolant.at(theta);
                let own = (at(after) - at(before)) / ((after - before) * h);
                for o in 0..components {
                    let i = o % N;
                    let (low, high) = (f0[o].min(f1[o]).min(own[i]), f0[o].max(f1[o]).max(own[i]));
                    let beyond = (f[o] - high).max(low - f[o]);
                    if f[o].is_nan() && self.leads_over {
                        continue;
                    }
                    if f[o].is_nan() {
                        outside[i] = f64::INFINITY;
                    } else if beyond > OUTSIDE * (high - low) {
                        outside[i] += weight / 90.0 * beyond * (to - from) * h;
                    }
                }
            }
            if outside.iter().any(|v| *v > 0.0) {
                match structures.last_mut().filter(|(missed, _)| missed.to == from) {
                    Some((missed, sum)) => {
                        missed.to = to;
                        *sum += outside;
                    }
                    None => structures.push((Missed { from, to }, outside)),
                }
            }
        }
        let exceeds = |missed: &SVector<f64, N>, part: f64| {
            (0..N).any(|i| {
                let size = step.x0[i].abs().max(step.x1[i].abs());
                missed[i] > part * ALLOWED * (tolerance.atol + tolerance.rtol * size)
            })
        };
        let all = structures.iter().fold(SVector::zeros(), |sum, (_, outside)| sum + outside);
        if !exceeds(&all, 1.0) {
            return None;
        }
        let large = structures.iter().find(|(_, outside)| exceeds(outside, 0.25));
        large.or(structures.first()).map(|(missed, _)| *missed)
    }
}

/// Fraction of a step for the difference quotient of its continuous extension.
const DIFFERENCE: f64 = 1e-3;
/// Steps through a structure that was found, at least.
const STEPS_THROUGH: f64 = 16.0;
/// A structure of this part of the time is too short for steps.
const SHORTEST: f64 = 1e-12;

/// End time and longest step of a method.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stage {
    pub(super) end: f64,
    pub(super) max_step: f64,
}

/// The approach of a method to the end of its interval.
#[derive(Clone, Debug)]
pub(super) struct Stages {
    asked: Stage,
    /// Before that; the last one comes first. With how often it was moved, if it leads to the
    /// change of a sign.
    before: Vec<(Stage, u32)>,
}

impl Stages {
    pub(super) fn new(end: f64, max_step: f64) -> Self {
        Self { asked: Stage { end, max_step }, before: Vec::new() }
    }

    /// The stage under way.
    pub(super) fn now(&self) -> Stage {
        self.before.last().map_or(self.asked, |(stage, _)| *stage)
    }

    /// Whether stages end at or before the time `t`, after which they are over.
    pub(super) fn end_at(&mut self, t: f64) -> bool {
        let stages = self.before.len();
        while self.before.last().is_some_and(|(stage, _)| t >= stage.end) {
            self.before.pop();
        }
        self.before.len() < stages
    }

    /// Plans what comes instead of a step from (t, x): the steps to a structure and short ones
    /// through it, or steps to the change of a sign. Whether the step is taken back.
    #[cold]
    #[inline(never)]
    pub(super) fn take_back<const N: usize>(
        &mut self,
        (t, x): (f64, &SVector<f64, N>),
        undone: Undone,
    ) -> Result<bool, Failure> {
        let Stage { end, max_step } = self.now();
        match undone {
            Undone::Structure([from, to]) => {
                let width = width((t, x), [from, to])?;
                let short = max_step.min(width / STEPS_THROUGH);
                self.before.push((Stage { end: to.min(end), max_step: short }, 0));
                if from - t > 1e-3 * width && from - t > SHORTEST * t.abs() {
                    self.before.push((Stage { end: from, max_step }, 0));
                }
            }
            Undone::SignChange(at) => match self.before.last_mut() {
                Some((_, moved)) if *moved >= MOST_LANDINGS => return Ok(false),
                Some((stage, moved)) if *moved > 0 => (stage.end, *moved) = (at, *moved + 1),
                _ => self.before.push((Stage { end: at, max_step }, 1)),
            },
        }
        Ok(true)
    }
}

/// The time that a structure takes.
///
/// # Errors
/// If it is too short for steps.
fn width<const N: usize>(
    (t, x): (f64, &SVector<f64, N>),
    [from, to]: [f64; 2],
) -> Result<f64, Failure> {
    let width = to - from;
    if width <= SHORTEST * t.abs().max(from.abs()) {
        return Err(Failure::StepUnderflow { t: from, h: width, state: Failure::state(x) });
    }
    Ok(width)
}

/// The longest step from (t, x) that does not jump over a structure: to its beginning, or a part of
/// it.
///
/// # Errors
/// If it is too short for steps.
pub(super) fn longest_towards<const N: usize>(
    (t, x): (f64, &SVector<f64, N>),
    [from, to]: [f64; 2],
) -> Result<f64, Failure> {
    let width = width((t, x), [from, to])?;
    Ok(if from - t > 1e-3 * width { from - t } else { width / STEPS_THROUGH })
}

/// A method whose last step can be examined and taken back.
pub trait Redoable<const N: usize>: Stepper<N> {
    /// The continuous extension of the last step, which there must have been since the last
    /// restart.
    fn last(&self) -> &dyn Interpolant<N>;
}

/// A method whose steps are examined. See the [module](self).
#[derive(Clone, Debug)]
pub struct Guarded<M, const N: usize> {
    method: M,
    tolerance: Tolerance,
    gates: Option<Gates>,
    stages: Stages,
    /// The last step's end.
    reached: (f64, SVector<f64, N>),
    /// The components of the equation that are looked at, the first ones; all if absent.
    looked_at: Option<usize>,
}

impl<M, const N: usize> Guarded<M, N> {
    /// The method, with its tolerance.
    pub fn new(method: M, tolerance: Tolerance) -> Self {
        let stages = Stages::new(0.0, f64::INFINITY);
        let reached = (0.0, SVector::zeros());
        Self { method, tolerance, gates: None, stages, reached, looked_at: None }
    }

    /// Which looks at the first `states` components alone: the others are tangent vectors, which
    /// have structure of their own where the states' is passed.
    pub fn of_states(self, states: usize) -> Self {
        Self { looked_at: Some(states), ..self }
    }

    /// The method.
    pub(super) fn method(&self) -> &M {
        &self.method
    }

    /// Where the last step has ended, with the end and the longest step that were asked for.
    pub(super) fn rest(&self) -> (f64, SVector<f64, N>, Stage) {
        (self.reached.0, self.reached.1, self.stages.asked)
    }

    /// Looks at steps through these gates, from the next [`Guarded::restart_with`] on.
    pub(super) fn look_through(&mut self, gates: Option<Gates>) {
        self.gates = gates;
    }

    /// Gives the gates away.
    pub(super) fn take_gates(&mut self) -> Option<Gates> {
        self.gates.take()
    }
}

impl<M: Redoable<N>, const N: usize> Guarded<M, N> {
    /// Begins the stage under way where the last step has ended.
    fn begin<F: VectorField<N>>(&mut self, field: &F) -> Result<(), Failure> {
        let (Stage { end, max_step }, (t, x)) = (self.stages.now(), self.reached);
        self.method.restart_again(field, t, x, end, max_step)
    }

    /// [`Stepper::restart`] with the gates that there are.
    pub(super) fn restart_with<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        Stage { end, max_step }: Stage,
    ) -> Result<(), Failure> {
        self.reached = (t, x);
        self.stages = Stages::new(end, max_step);
        self.method.restart(field, t, x, end, max_step)
    }
}

impl<M: Redoable<N>, const N: usize> Stepper<N> for Guarded<M, N> {
    fn restart<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        let tape = field.tape();
        self.gates = Gates::new(match self.looked_at {
            None => tape,
            Some(states) => Arc::new(tape.select(0..states)),
        });
        self.restart_with(field, t, x, Stage { end: t_end, max_step })
    }

    fn restart_again<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        self.reached = (t, x);
        self.stages = Stages::new(t_end, max_step);
        self.method.restart_again(field, t, x, t_end, max_step)
    }

    fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure> {
        if self.gates.is_none() {
            let step = self.method.step(field)?;
            self.reached = (step.t1, step.x1);
            return Ok(step);
        }
        loop {
            if self.stages.end_at(self.reached.0) {
                self.begin(field)?;
            }
            let step = self.method.step(field)?;
            let Step { t0, t1, x0, x1, .. } = step;
            match self
                .gates
                .as_mut()
                .map_or(Ok(None), |gates| gates.missed(&step, self.tolerance))?
            {
                Some(undone) if self.stages.take_back((t0, &x0), undone)? => {
                    self.reached = (t0, x0);
                    self.begin(field)?;
                }
                _ => {
                    self.reached = (t1, x1);
                    return Ok(Step { t0, t1, x0, x1, interpolant: self.method.last() });
                }
            }
        }
    }

    fn statistics(&self) -> &Statistics {
        self.method.statistics()
    }
}
