//! Taylor series of the solution, order and step size after Jorba & Zou (2005), layer-resolved.
//!
//! The series come from the equation itself ([`twofold_num::series`]), in `f64`, in
//! [`DoubleDouble`] or in [`MultiFloat`]s.
//!
//! **Layers.** A smoothed switch, tanh(h/eps), is constant to working precision outside a layer
//! |h/eps| < w. There all its derivatives vanish, so that a high-order method with long steps jumps
//! across the layer and its own error estimate sees nothing (erf(h/eps) is constant sooner; it is
//! treated alike). (Adaptive Taylor methods without a cure get even a first crossing wrong at every
//! tolerance.) This one knows the arguments of every tanh in the equation, because it computes
//! their series: outside a layer, a step ends before the argument has come nearer than the layer's
//! edge, with certainty (a bound on the argument's speed over the step, not a sample). Inside, what
//! the series of tanh leaves out has a bound, however small its last terms are (Cauchy's estimate,
//! below), and a step is as long as keeps that below the tolerance, or as changes the argument by
//! [`LAYER_STRIDE`], half of eps, where the series shows all that there is.
//!
//! **Kinks, jumps, ends of the domain.** The equation tells its signs, roots, logarithms and
//! quotients too. A step ends just behind the first zero of a sign's argument, found with certainty
//! on its series, as at an event, and the next begins with the other branch. Before a singular
//! operation's argument (a quotient's divisor) is zero, also in the complex plane, a step has
//! ended: so the method gets as near to a real zero as numbers allow, and says that it cannot go
//! on. A step goes on where an exponential is, as a bound over the step shows, nothing beside the
//! tolerance, or where its argument changes by so much that its series shows it.
//!
//! **The bound.** Beyond w > 0, |tanh(w + c) - 1| = 2/|exp(2 w + 2 c) + 1| is at most M = 2/(exp(2
//! (w - r)) - 1) for complex |c| <= r < w. If the argument's terms allow it to move by r at most in
//! a (complex) time R, the coefficient k of tanh's series is at most M/R^k, and what follows degree
//! p at most M q^(p+1)/(1 - q) in a step q R (Cauchy's estimate; Ahlfors 1979, sec. 4.2.3). The
//! edge is where tanh differs from 1 by the tolerance.

use std::sync::Arc;

use nalgebra::SVector;

use super::step::{Failure, Interpolant, Statistics, Step, Stepper, Tolerance, finite, is_last};
use twofold_num::elementary::{exp, ln, rough_pow};
use twofold_num::series::{Constants, LayerKind, MarkKind, Solution};
use twofold_num::tape::Node;
use twofold_num::{DoubleDouble, FromDecimal, MultiFloat, Scalar, Tape};
use twofold_system::VectorField;
use twofold_system::singular::{written, written_sign};

/// Change of a tanh's argument that a step inside a layer may always make.
pub const LAYER_STRIDE: f64 = 0.5;

/// Jorba & Zou (2005), sec. 3: the step is shortened by exp(-0.7/(p - 1)) for safety.
const SAFETY_EXPONENT: f64 = -0.7;

/// A step is planned outside a layer only from this far beyond the edge, and then lands less than
/// this far beyond: else the last bits of the landing would decide on which side the next step
/// begins.
const EDGE_MARGIN: f64 = 1.0;

/// Evaluations of a tanh argument's series in search of the layer's edge; then the part of the step
/// that is known to be free is taken.
const EDGE_SEARCH: usize = 100;

/// The order at which the work per unit of time is least for analytic solutions (Jorba & Zou 2005,
/// sec. 3), with numbers of relative spacing `epsilon`.
pub fn order_for(tolerance: Tolerance, epsilon: f64) -> u16 {
    let smallest = tolerance.rtol.min(tolerance.atol).clamp(epsilon / 16.0, 1e-2);
    (1.0 - 0.5 * ln(smallest)).ceil() as u16
}

/// A number type that this method can work in.
pub trait Precision: Scalar + FromDecimal {
    /// Relative spacing of the numbers.
    const EPSILON: f64;
    /// tanh is exactly +-1 beyond this argument.
    const TANH_SATURATION: f64;
    /// Whether series of the orders that this precision asks for have coefficients beyond the range
    /// of `f64`.
    const BEYOND_F64: bool = false;

    /// log2 of the absolute value, to some digits; minus infinity for zero.
    fn size(self) -> f64 {
        log2(self.to_f64().abs())
    }

    /// The numbers rounded, in `scratch` if they are not what they are.
    fn rounded<'a>(numbers: &'a [Self], scratch: &'a mut Vec<f64>) -> &'a [f64] {
        scratch.clear();
        scratch.extend(numbers.iter().map(|c| c.to_f64()));
        scratch
    }
}

impl Precision for f64 {
    const EPSILON: f64 = f64::EPSILON;
    const TANH_SATURATION: f64 = 19.1;

    fn rounded<'a>(numbers: &'a [Self], _: &'a mut Vec<f64>) -> &'a [f64] {
        numbers
    }
}

impl Precision for DoubleDouble {
    const EPSILON: f64 = DoubleDouble::EPSILON;
    const TANH_SATURATION: f64 = 38.0;
}

impl<const L: usize> Precision for MultiFloat<L> {
    const EPSILON: f64 = MultiFloat::<L>::EPSILON;
    const TANH_SATURATION: f64 = MultiFloat::<L>::TANH_SATURATION;
    const BEYOND_F64: bool = true;

    fn size(self) -> f64 {
        self.log2()
    }
}

/// The Taylor-series stepper in the arithmetic `S`.
///
/// As a [`Stepper`] it takes and gives `f64` states; between restarts it keeps time and state in
/// `S`, which [`Taylor::state`] and [`Taylor::at`] give in full.
///
/// ```
/// # use nalgebra::{SVector, Vector2};
/// # use twofold_num::Elementary;
/// # use twofold_system::VectorField;
/// # struct Oscillator;
/// # impl VectorField<2> for Oscillator {
/// #     fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
/// #         Vector2::new(x[1], -x[0])
/// #     }
/// # }
/// use twofold_integrate::{DriveOptions, Ignore, Taylor, Tolerance, drive};
/// // x'' = -x from (1, 0), in f64; `Taylor::extended` works with 32 digits.
/// let mut taylor = Taylor::new(Tolerance { rtol: 1e-15, atol: 1e-15 });
/// let to = DriveOptions::to(1.0);
/// let end = drive(&Oscillator, Vector2::new(1.0, 0.0), &to, &mut taylor, &mut Ignore, &())?;
/// assert!((end.x[0] - 0.540_302_305_868_139_7).abs() < 1e-14);
/// # Ok::<(), twofold_integrate::Failure>(())
/// ```
#[derive(Clone, Debug)]
pub struct Taylor<const N: usize, S = f64> {
    tolerance: Tolerance,
    statistics: Statistics,
    constants: Constants,
    solution: Solution<S>,
    order: usize,
    t: S,
    x: SVector<S, N>,
    /// Rounding errors of `x` since the last restart, to be added with the next step.
    lost: SVector<S, N>,
    /// Time, state and what rounding had taken at the start of the last step.
    from: (S, SVector<S, N>, SVector<S, N>),
    t_end: S,
    max_step: f64,
    /// Length of the last step.
    h: S,
    /// exp([`SAFETY_EXPONENT`]/(p - 1)).
    safety: f64,
    layers: Layers,
    /// The equation, for messages.
    tape: Arc<Tape>,
    /// Steps in a row that only passed a sign's zero.
    landings: i32,
    /// A layer's argument, rounded.
    argument: Vec<f64>,
    /// The last step's series, rounded.
    rounded: Polynomial<N>,
}

/// A step's series in the fraction of the step.
#[derive(Clone, Debug)]
struct Polynomial<const N: usize> {
    coefficients: Vec<SVector<f64, N>>,
}

impl<const N: usize> Interpolant<N> for Polynomial<N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        self.coefficients.iter().rev().fold(SVector::zeros(), |sum, c| sum * theta + c)
    }
    fn coordinate(&self, theta: f64, i: usize) -> f64 {
        self.coefficients.iter().rev().fold(0.0, |sum, c| sum * theta + c[i])
    }
    fn degree(&self) -> usize {
        self.coefficients.len() - 1
    }
    /// The polynomial's distance from its start, term by term.
    fn reach(&self, coordinate: usize) -> f64 {
        self.coefficients[1..].iter().map(|c| c[coordinate].abs()).sum()
    }
}

impl<const N: usize> Taylor<N, f64> {
    /// A stepper in `f64` arithmetic: the last two terms of every step's series stay below the
    /// tolerance.
    pub fn new(tolerance: Tolerance) -> Self {
        Self::with_tolerance(tolerance)
    }
}

impl<const N: usize> Taylor<N, DoubleDouble> {
    /// A stepper in double-double arithmetic; tolerances down to about 1e-32 make sense.
    pub fn extended(tolerance: Tolerance) -> Self {
        Self::with_tolerance(tolerance)
    }
}

impl<const N: usize, const L: usize> Taylor<N, MultiFloat<L>> {
    /// A stepper in multi-precision arithmetic; tolerances down to [`MultiFloat::EPSILON`] make
    /// sense.
    pub fn multi(tolerance: Tolerance) -> Self {
        Self::with_tolerance(tolerance)
    }
}

impl<const N: usize, S: Precision> Taylor<N, S> {
    /// Series of another degree than the tolerance asks for, at least 2.
    pub fn with_order(mut self, order: usize) -> Self {
        self.order = order.max(2);
        self.safety = exp(SAFETY_EXPONENT / (self.order - 1) as f64);
        self.layers = Layers::new::<S>(self.tolerance, self.order);
        self.statistics.highest_order = self.order as u64;
        self.solution = Solution::new(self.order, &Tape::default(), Constants::Binary);
        self
    }

    /// Reads the equation's constants, and a start at t = 0, as decimal numbers
    /// ([`Constants::Decimal`]), from the next restart on.
    pub fn with_decimal_constants(mut self) -> Self {
        self.constants = Constants::Decimal;
        self
    }
}

impl<const N: usize, S: Precision> Taylor<N, S> {
    fn with_tolerance(tolerance: Tolerance) -> Self {
        let order = usize::from(order_for(tolerance, S::EPSILON));
        let zero = SVector::from_element(S::zero());
        Self {
            tolerance,
            statistics: Statistics { highest_order: order as u64, ..Statistics::default() },
            constants: Constants::Binary,
            solution: Solution::new(order, &Tape::default(), Constants::Binary),
            order,
            t: S::zero(),
            x: zero,
            lost: zero,
            from: (S::zero(), zero, zero),
            t_end: S::zero(),
            max_step: f64::INFINITY,
            h: S::zero(),
            safety: exp(SAFETY_EXPONENT / (order - 1) as f64),
            layers: Layers::new::<S>(tolerance, order),
            tape: Arc::default(),
            landings: 0,
            argument: Vec::with_capacity(order),
            rounded: Polynomial { coefficients: vec![SVector::zeros()] },
        }
    }

    /// The order of the method.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Time and state reached, in full precision.
    pub fn state(&self) -> (S, SVector<S, N>) {
        (self.t, self.x)
    }

    /// Time and state at the fraction `theta` of the last step, in full precision.
    pub fn at(&self, theta: S) -> (S, SVector<S, N>) {
        // Measured from the start of the step, which time and state have left behind.
        (self.t - self.h * (S::one() - theta), self.sum(self.h * theta))
    }

    /// [`Stepper::restart`] from a time and state in full precision.
    ///
    /// # Errors
    ///
    /// The same as [`Stepper::restart`].
    pub fn restart_from<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: S,
        x: SVector<S, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        self.restart_between(field, (t, x), S::from_f64(t_end), max_step)
    }

    /// [`Taylor::restart_from`] towards a time in full precision.
    fn restart_between<F: VectorField<N>>(
        &mut self,
        field: &F,
        (t, x): (S, SVector<S, N>),
        t_end: S,
        max_step: f64,
    ) -> Result<(), Failure> {
        self.tape = field.tape();
        self.solution.set_tape(&self.tape, self.constants);
        self.begin(&|x| field.eval(x), t, x, t_end, max_step)
    }

    /// A start, the equation being known. Like the step it is compiled once for all equations.
    fn begin(
        &mut self,
        eval: &dyn Fn(&SVector<f64, N>) -> SVector<f64, N>,
        t: S,
        x: SVector<S, N>,
        t_end: S,
        max_step: f64,
    ) -> Result<(), Failure> {
        self.t = t;
        self.x = x;
        self.lost = SVector::from_element(S::zero());
        self.t_end = t_end;
        self.max_step = max_step;
        self.h = S::zero();
        self.landings = 0;
        self.statistics.restarts += 1;
        self.statistics.evaluations += 1;
        let rounded = self.x.map(S::to_f64);
        if !finite(&rounded) || !finite(&eval(&rounded)) {
            return Err(Failure::NotFinite { t: t.to_f64(), state: Failure::state(&rounded) });
        }
        Ok(())
    }

    /// A state in `f64` as it is meant: a start is given in decimal, like the constants; later
    /// states are what they are.
    fn exact(&self, t: f64, x: SVector<f64, N>) -> SVector<S, N> {
        x.map(|x| match self.constants {
            Constants::Decimal if t == 0.0 && x.is_finite() => S::from_decimal(&x.into()),
            _ => S::from_f64(x),
        })
    }

    /// The last step's series at the time `s` after its start.
    fn sum(&self, s: S) -> SVector<S, N> {
        SVector::from_fn(|i, _| {
            self.solution.component(i).iter().rev().fold(S::zero(), |sum, c| sum * s + *c)
        })
    }

    /// The step that the series allow: the terms of degree p - 1 and p stay below atol + rtol |x|,
    /// component by component. With p as in [`Taylor::with_tolerance`] this is Jorba & Zou's step
    /// (2005, sec. 3), a factor e^2 inside the radius of convergence that these two terms suggest.
    fn accurate_step(&self) -> f64 {
        if S::BEYOND_F64 {
            return self.accurate_step_beyond_f64();
        }
        let p = self.order;
        let mut h = f64::INFINITY;
        for degree in [p - 1, p] {
            let mut size = 0.0_f64;
            for i in 0..N {
                let x = self.x[i].to_f64().abs();
                let c = self.solution.component(i)[degree].to_f64().abs();
                // NaN must not be lost, as it would be in f64::max.
                let q = c / (self.tolerance.atol + self.tolerance.rtol * x);
                size = if q > size || q.is_nan() { q } else { size };
            }
            if size.is_nan() || size.is_infinite() {
                return f64::NAN;
            }
            if size > 0.0 {
                h = h.min(rough_pow(size, -1.0 / degree as f64));
            }
        }
        h * self.safety
    }

    /// The same by logarithms.
    fn accurate_step_beyond_f64(&self) -> f64 {
        let p = self.order;
        let mut h = f64::INFINITY;
        for degree in [p - 1, p] {
            let mut size = f64::NEG_INFINITY;
            for i in 0..N {
                let allowed = self.tolerance.atol + self.tolerance.rtol * self.x[i].to_f64().abs();
                let q = self.solution.component(i)[degree].size() - log2(allowed);
                size = if q > size || q.is_nan() { q } else { size };
            }
            if size.is_nan() {
                return f64::NAN;
            }
            h = h.min(exp(-size / degree as f64 * std::f64::consts::LN_2));
        }
        h * exp(SAFETY_EXPONENT / (p - 1) as f64)
    }

    /// [`Taylor::resolved_step`] with the series in fractions of `h`, whose coefficients are of
    /// ordinary size.
    fn resolved_step_beyond_f64(&self, mut h: f64) -> f64 {
        let mut series = Vec::with_capacity(self.order);
        for (kind, w) in self.solution.layer_arguments() {
            series.clear();
            let (step, mut power) = (S::from_f64(h), S::one());
            for c in w {
                series.push((*c * power).to_f64());
                power = power * step;
            }
            h *= self.layers.longest(kind, &series, 1.0);
        }
        h
    }

    /// The longest step up to `h` that respects every layer.
    fn resolved_step(&mut self, mut h: f64) -> f64 {
        if S::BEYOND_F64 {
            return self.resolved_step_beyond_f64(h);
        }
        for (kind, w) in self.solution.layer_arguments() {
            h = self.layers.longest(kind, S::rounded(w, &mut self.argument), h);
        }
        h
    }
}

impl<const N: usize, S: Precision> Taylor<N, S> {
    /// The longest step up to `h` before any singular operation's argument can be zero and in which
    /// no exponential hides.
    fn regular_step(&mut self, mut h: f64) -> f64 {
        for (kind, _, w) in self.solution.marks() {
            // The argument's own series may end sooner than the state's.
            let fractions = self.layers.in_fractions(w, h, &mut self.argument);
            let size = fractions.iter().fold(0.0_f64, |a, c| a.max(c.abs()));
            let allowed = match kind {
                MarkKind::Sign => exp(self.layers.log_tolerance) * size,
                MarkKind::Singular => 0.01 * fractions[0].abs(),
                MarkKind::Exp | MarkKind::Curved => 0.05,
                MarkKind::Power(n) => 0.05 / f64::from(n) * size,
            };
            h *= resolved(fractions, allowed);
            let fractions = self.layers.in_fractions(w, h, &mut self.argument);
            let part = match kind {
                MarkKind::Sign | MarkKind::Curved => continue,
                MarkKind::Singular => {
                    stride_time(fractions, DOMAIN_SHARE * fractions[0].abs(), 1.0)
                }
                MarkKind::Exp => self.layers.visible(fractions),
                MarkKind::Power(n) => self.layers.visible_power(fractions, f64::from(n)),
            };
            if part < 1.0 {
                h *= part;
            }
        }
        h
    }

    /// The first zero of a sign's argument in a step of length `h`, if there is one.
    fn first_switch(&mut self, h: f64) -> Option<(S, Node)> {
        let mut first: Option<(S, Node)> = None;
        for (_, node, w) in self.solution.marks().filter(|(kind, _, _)| *kind == MarkKind::Sign) {
            let Some(theta) = first_crossing(self.layers.in_fractions(w, h, &mut self.argument))
            else {
                continue;
            };
            // To this precision, by Newton's method, unless it leaves the neighbourhood.
            let (length, start) = (S::from_f64(h), S::from_f64(h * theta));
            let mut s = start;
            for _ in 0..6 {
                let (mut value, mut slope) = (S::zero(), S::zero());
                for c in w.iter().rev() {
                    slope = slope * s + value;
                    value = value * s + *c;
                }
                let next = s - value / slope;
                let moved = (next - start).to_f64().abs();
                if moved.is_nan() || moved > 1e-6 * h {
                    s = start;
                    break;
                }
                s = next;
            }
            let s = if s > S::zero() { s } else { S::zero() };
            if s < length && first.is_none_or(|(other, _)| s < other) {
                first = Some((s, node));
            }
        }
        first
    }

    /// The failure, or the singular operation that explains it, where the argument of one is next
    /// to zero.
    fn stuck(&self, failure: Failure) -> Failure {
        let (Failure::NotFinite { t, state } | Failure::StepUnderflow { t, state, .. }) = &failure
        else {
            return failure;
        };
        let until = |w: &[S]| w[0].to_f64().abs() / w.get(1).map_or(0.0, |c| c.to_f64().abs());
        let near = |(kind, _, w): &(MarkKind, Node, &[S])| {
            *kind == MarkKind::Singular
                && (w[0] == S::zero() || until(w) <= NEXT_TO * (1.0 + t.abs()))
        };
        let Some((_, node, w)) = self.solution.marks().find(near) else { return failure };
        let text = written(&self.tape, node);
        let argument = self.tape.operations()[node].arguments().last().unwrap_or(node);
        let argument = written(&self.tape, argument);
        let what = format!("{text} has no derivative, or no value, where {argument} is zero");
        let later = if w[0] == S::zero() { 0.0 } else { until(w) };
        Failure::NotSmooth { t: t + later, state: state.clone(), what }
    }
}

/// A failure within this part of 1 + t of an argument's zero is that zero's.
const NEXT_TO: f64 = 1e-6;

/// A step's share of the way to a zero, in the complex plane, of a singular operation's argument.
const DOMAIN_SHARE: f64 = 0.9;

/// So many steps in a row that only pass zeros of signs: the motion does not leave them.
const MOST_LANDINGS: i32 = 14;

/// The part of the unit interval in which the last two terms of the series `c` are `allowed` at
/// most.
fn resolved(c: &[f64], allowed: f64) -> f64 {
    let mut part = 1.0_f64;
    for (k, term) in c.iter().enumerate().skip(c.len().saturating_sub(2).max(1)) {
        if term.abs() > allowed {
            part = part.min(rough_pow(allowed / term.abs(), 1.0 / k as f64));
        }
    }
    part
}

/// First sign change of the polynomial `c` in [0, 1], zero counting as positive.
fn first_crossing(c: &[f64]) -> Option<f64> {
    let sign = if c[0] < 0.0 { -1.0 } else { 1.0 };
    let at = |s: f64| sign * value(c, s);
    let mut open = vec![(0.0, 1.0)];
    let mut shifted = Vec::with_capacity(c.len());
    while let Some((left, right)) = open.pop() {
        let (middle, radius) = (0.5 * (left + right), 0.5 * (right - left));
        // Taylor's formula around the middle, by repeated synthetic division.
        shifted.clear();
        shifted.extend_from_slice(c);
        for start in 0..shifted.len() {
            for j in (start..shifted.len() - 1).rev() {
                shifted[j] += middle * shifted[j + 1];
            }
        }
        if sign * shifted[0] > travel(&shifted, radius) {
            continue;
        }
        let bend = speed(&shifted, radius) - shifted.get(1).map_or(0.0, |c| c.abs());
        let monotone = shifted.len() > 1 && shifted[1].abs() > bend;
        if monotone || radius < 1e-12 {
            if at(right) < 0.0 {
                let (mut a, mut b) = (left, right);
                for _ in 0..200 {
                    let m = 0.5 * (a + b);
                    if m <= a || m >= b {
                        break;
                    }
                    if at(m) < 0.0 { b = m } else { a = m }
                }
                return Some(b);
            }
            continue;
        }
        open.push((middle, right));
        open.push((left, middle));
    }
    None
}

/// Limits of a step near a layer.
#[derive(Clone, Copy, Debug)]
struct Layers {
    /// erf(w), and tanh with it, is exactly +-1 beyond.
    saturation: f64,
    /// ln of the largest error of tanh that its series may have.
    log_tolerance: f64,
    /// 1 - tanh w is that error.
    edge: f64,
    /// p + 1.
    terms: f64,
}

impl Layers {
    fn new<S: Precision>(tolerance: Tolerance, order: usize) -> Self {
        let log_tolerance = ln(tolerance.rtol.min(tolerance.atol).clamp(S::EPSILON / 16.0, 1e-2));
        let edge = 0.5 * (std::f64::consts::LN_2 - log_tolerance);
        Self { saturation: S::TANH_SATURATION, log_tolerance, edge, terms: (order + 1) as f64 }
    }

    /// A series in fractions of `h`, rounded: its coefficients are of ordinary size.
    fn in_fractions<'a, S: Precision>(
        &self,
        w: &[S],
        h: f64,
        scratch: &'a mut Vec<f64>,
    ) -> &'a [f64] {
        let (step, mut power) = (S::from_f64(h), S::one());
        scratch.clear();
        for c in w {
            scratch.push((*c * power).to_f64());
            power = power * step;
        }
        scratch
    }

    /// The part of a step over which an exponential with the argument `w`, in fractions of the
    /// step, is nothing beside the tolerance, or changes so little that its series shows it.
    fn visible(&self, w: &[f64]) -> f64 {
        let shown = stride_time(w, 0.25 * self.terms, 1.0);
        let below = self.log_tolerance - EXP_MARGIN - w[0];
        if shown < 1.0 && below > 0.0 { shown.max(stride_time(w, below, 1.0)) } else { shown }
    }

    /// The same of the power `n` of `w`.
    fn visible_power(&self, w: &[f64], n: f64) -> f64 {
        let shown = stride_time(w, 0.25 * self.terms / n * w[0].abs(), 1.0);
        let below = exp((self.log_tolerance - EXP_MARGIN) / n) - w[0].abs();
        if shown < 1.0 && below > 0.0 { shown.max(stride_time(w, below, 1.0)) } else { shown }
    }

    /// The longest step up to `h` over which the series of the transition function with the
    /// argument `w` can be trusted.
    fn longest(&self, kind: LayerKind, w: &[f64], h: f64) -> f64 {
        let edge = match kind {
            LayerKind::Tanh => self.edge,
            LayerKind::Erf => self.saturation,
        };
        let distance = w[0].abs();
        if distance >= edge + EDGE_MARGIN {
            return free_time(w, edge, h);
        }
        let always = stride_time(w, LAYER_STRIDE, h);
        match kind {
            LayerKind::Tanh if always < h => always.max(self.estimated(distance, w, h)),
            _ => always,
        }
    }

    /// The longest step up to `h` that Cauchy's estimate allows, the argument of tanh being
    /// `distance` away from 0 at its start.
    fn estimated(&self, distance: f64, w: &[f64], h: f64) -> f64 {
        // Nearly the best radius r: exp(-2 r/(p + 1)) r is largest.
        let r = (0.5 * self.terms).min(distance - 0.5);
        if r <= LAYER_STRIDE {
            return 0.0;
        }
        // M is below 2/(1 - 1/e) exp(-2 (distance - r)), and 1/(1 - q) at most 2: for smaller q
        // there is room for the thousandth of r that the travel may be longer.
        let log = (self.log_tolerance - BOUND + 2.0 * (distance - r)) / self.terms;
        let q = exp(log).min(0.5);
        q * stride_time(w, r, h / q)
    }
}

/// ln of the largest factor that an exponential is thought to stand with.
const EXP_MARGIN: f64 = 20.0;

/// ln(4/(1 - 1/e)).
const BOUND: f64 = 1.844_969_5;

fn log2(x: f64) -> f64 {
    ln(x) * std::f64::consts::LOG2_E
}

/// The polynomial `c` at s.
fn value(c: &[f64], s: f64) -> f64 {
    c.iter().rev().fold(0.0, |sum, c| sum * s + c)
}

/// sum |c_k| s^k over k >= 1: a bound on how far the polynomial `c` moves during [0, s].
fn travel(c: &[f64], s: f64) -> f64 {
    c[1..].iter().rev().fold(0.0, |sum, c| (sum + c.abs()) * s)
}

/// sum k |c_k| s^(k-1): a bound on the speed of the polynomial `c` during [0, s].
fn speed(c: &[f64], s: f64) -> f64 {
    c.iter().enumerate().skip(1).rev().fold(0.0, |sum, (k, c)| sum * s + k as f64 * c.abs())
}

/// [`travel`] and [`speed`], which need not wait for each other.
fn travel_and_speed(c: &[f64], s: f64) -> (f64, f64) {
    let (mut travel, mut speed, mut k) = (0.0, 0.0, c.len() as f64);
    for c in c[1..].iter().rev() {
        k -= 1.0;
        travel = (travel + c.abs()) * s;
        speed = speed * s + k * c.abs();
    }
    (travel, speed)
}

/// A time in [0, h] during which the polynomial `w`, which starts beyond `edge` + EDGE_MARGIN,
/// certainly stays beyond `edge`; if less than `h`, it ends less than EDGE_MARGIN beyond (or the
/// search was given up).
fn free_time(w: &[f64], edge: f64, h: f64) -> f64 {
    // The landing zone is the middle of the margin.
    let fastest = speed(w, h);
    let mut s = 0.0;
    for _ in 0..EDGE_SEARCH {
        let distance = value(w, s).abs() - edge - 0.25 * EDGE_MARGIN;
        if distance < 0.5 * EDGE_MARGIN {
            return s;
        }
        s += distance / fastest;
        if s >= h {
            return h;
        }
    }
    s
}

/// A time in [0, h] during which the polynomial `w` certainly moves by `stride` (and a thousandth)
/// at most; not much shorter than need be.
fn stride_time(w: &[f64], stride: f64, h: f64) -> f64 {
    // The first term alone often tells; no rounding makes the sum less.
    let fast = w[1].abs() * h > stride;
    if !fast && travel(w, h) <= stride {
        return h;
    }
    // The travel is increasing and convex, so that Newton's method from the right converges from
    // the right.
    let first = stride / w[1].abs();
    // A branch, not a minimum: what follows then need not wait until h is known.
    let mut s = if first < h {
        first
    } else {
        std::hint::cold_path();
        h
    };
    for _ in 0..50 {
        let (travel, speed) = travel_and_speed(w, s);
        let excess = travel - stride;
        if excess <= 1e-3 * stride {
            break;
        }
        s -= excess / speed;
    }
    s
}

impl<const N: usize, S: Precision> Stepper<N> for Taylor<N, S> {
    fn restart<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        let x = self.exact(t, x);
        self.restart_from(field, S::from_f64(t), x, t_end, max_step)
    }

    fn restart_again<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        let x = self.exact(t, x);
        self.begin(&|x| field.eval(x), S::from_f64(t), x, S::from_f64(t_end), max_step)
    }

    fn step<F: VectorField<N>>(&mut self, _: &F) -> Result<Step<'_, N>, Failure> {
        self.advance()
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}

impl<const N: usize, S: Precision> Taylor<N, S> {
    /// A step. The equation is on the tape by now, so that this is compiled once for all equations.
    #[inline(never)]
    fn advance(&mut self) -> Result<Step<'_, N>, Failure> {
        let (t0, x0) = (self.t.to_f64(), self.x.map(S::to_f64));
        self.solution.expand(self.x.as_slice());
        // One evaluation of the series costs about as much as one of the right-hand side per
        // degree.
        self.statistics.evaluations += self.order as u64;

        let remaining = self.t_end - self.t;
        let accurate = self.accurate_step();
        if accurate.is_nan() {
            return Err(self.stuck(Failure::NotFinite { t: t0, state: Failure::state(&x0) }));
        }
        let h = self.regular_step(accurate.min(self.max_step).min(remaining.to_f64()));
        let h = self.resolved_step(h);
        let switch = self.first_switch(h);
        let mut last = switch.is_none() && is_last(t0, h, self.t_end.to_f64(), 1.000_000_1);
        if switch.is_none() && (h <= t0.abs() * f64::EPSILON || h < f64::MIN_POSITIVE) {
            return Err(self.stuck(Failure::StepUnderflow {
                t: t0,
                h,
                state: Failure::state(&x0),
            }));
        }
        self.h = if last { remaining } else { S::from_f64(h) };
        if let Some((zero, node)) = switch {
            // Just behind the zero: so far that the argument's rounding cannot undo it, the more
            // the oftener it did.
            let beyond = S::EPSILON * (t0.abs() + h) * (1_u64 << (2 * self.landings + 2)) as f64;
            self.landings = if zero.to_f64() > 1e3 * beyond { 0 } else { self.landings + 1 };
            if self.landings > MOST_LANDINGS {
                let what = written_sign(&self.tape, node);
                return Err(Failure::StaysOnJump { t: t0, state: Failure::state(&x0), what });
            }
            self.h = zero + S::from_f64(beyond);
            if self.h >= remaining {
                (self.h, last) = (remaining, true);
            }
        } else {
            self.landings = 0;
        }
        let before = (self.t, self.x, self.lost);
        let (x, lost) = self.landing(before.1, before.2);
        let x1 = x.map(S::to_f64);
        if !finite(&x1) {
            return Err(self.stuck(Failure::NotFinite { t: t0, state: Failure::state(&x0) }));
        }
        (self.from, self.x, self.lost) = (before, x, lost);
        self.t = if last { self.t_end } else { self.t + self.h };
        self.round();
        self.statistics.steps += 1;
        Ok(Step { t0, t1: self.t.to_f64(), x0, x1, interpolant: &self.rounded })
    }

    /// The state after a step of length `h` from `x`, and what rounding has taken from it.
    ///
    /// Summed with what the sums before have lost (Moller 1965; Hairer, Lubich & Wanner 2006, sec.
    /// VIII.5): an error is then small beside the step's increment, not beside the state.
    #[inline]
    fn landing(
        &self,
        from: SVector<S, N>,
        lost_before: SVector<S, N>,
    ) -> (SVector<S, N>, SVector<S, N>) {
        // All components at once: none waits for another.
        let series: [&[S]; N] = std::array::from_fn(|i| &self.solution.component(i)[..=self.order]);
        let mut increment = SVector::<S, N>::from_element(S::zero());
        for k in (1..=self.order).rev() {
            for i in 0..N {
                increment[i] = (increment[i] + series[i][k]) * self.h;
            }
        }
        let mut x = from;
        let mut lost = lost_before;
        for i in 0..N {
            let increment = increment[i] + lost_before[i];
            x[i] = from[i] + increment;
            lost[i] = (from[i] - x[i]) + increment;
        }
        (x, lost)
    }

    /// The series of a step of length `h`, rounded.
    #[inline]
    fn round(&mut self) {
        let mut power = S::one();
        self.rounded.coefficients.resize(self.order + 1, SVector::zeros());
        for (k, rounded) in self.rounded.coefficients.iter_mut().enumerate() {
            for i in 0..N {
                rounded[i] = (self.solution.component(i)[k] * power).to_f64();
            }
            power = power * self.h;
        }
    }
}

/// A method whose last step can be ended earlier, in its own arithmetic.
pub(crate) trait Cuttable<const N: usize> {
    /// The numbers that it computes in.
    type Number: Precision;
    /// Whether a step that is cut short is as exact as a step of that length.
    const CUTS_EXACTLY: bool;
    /// A time and a state as they are meant.
    fn exactly(&self, t: f64, x: SVector<f64, N>) -> (Self::Number, SVector<Self::Number, N>);
    /// Starts towards `end` with steps no longer than `longest`; `again` says that the field is the
    /// last one.
    fn begin<F: VectorField<N>>(
        &mut self,
        field: &F,
        from: (Self::Number, SVector<Self::Number, N>),
        end: Self::Number,
        longest: f64,
        again: bool,
    ) -> Result<(), Failure>;
    /// Makes a step.
    fn advance<F: VectorField<N>>(&mut self, field: &F) -> Result<(), Failure>;
    /// The last step, as far as it was cut.
    fn last(&self) -> Step<'_, N>;
    /// The last step's beginning.
    fn start(&self) -> Self::Number;
    /// Time and state reached.
    fn reached(&self) -> (Self::Number, SVector<Self::Number, N>);
    /// The state at the fraction `theta` of the last step.
    fn at(&self, theta: Self::Number) -> SVector<Self::Number, N>;
    /// Ends the last step at the time `end` within it.
    fn cut(&mut self, end: Self::Number);
    /// Its statistics.
    fn statistics(&self) -> &Statistics;
}

impl<const N: usize, S: Precision> Cuttable<N> for Taylor<N, S> {
    type Number = S;
    const CUTS_EXACTLY: bool = true;

    fn exactly(&self, t: f64, x: SVector<f64, N>) -> (S, SVector<S, N>) {
        (S::from_f64(t), self.exact(t, x))
    }

    fn begin<F: VectorField<N>>(
        &mut self,
        field: &F,
        (t, x): (S, SVector<S, N>),
        end: S,
        longest: f64,
        again: bool,
    ) -> Result<(), Failure> {
        if again {
            Taylor::begin(self, &|x| field.eval(x), t, x, end, longest)
        } else {
            self.restart_between(field, (t, x), end, longest)
        }
    }

    fn advance<F: VectorField<N>>(&mut self, _: &F) -> Result<(), Failure> {
        Taylor::advance(self).map(|_| ())
    }

    fn last(&self) -> Step<'_, N> {
        let (t0, x0, _) = self.from;
        Step {
            t0: t0.to_f64(),
            t1: self.t.to_f64(),
            x0: x0.map(S::to_f64),
            x1: self.x.map(S::to_f64),
            interpolant: &self.rounded,
        }
    }

    fn start(&self) -> S {
        self.from.0
    }

    fn reached(&self) -> (S, SVector<S, N>) {
        self.state()
    }

    fn at(&self, theta: S) -> SVector<S, N> {
        Taylor::at(self, theta).1
    }

    fn cut(&mut self, end: S) {
        self.h = end - self.from.0;
        (self.x, self.lost) = self.landing(self.from.1, self.from.2);
        self.t = end;
        self.round();
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::tape::Recorded;
    use twofold_num::{Arithmetic, Elementary};
    use twofold_system::{Caricature, Smoothed, Transition};

    /// Steps from outside the layer through it, all on compiled series?
    fn is_compiled<F: VectorField<3>>(field: &F) -> bool {
        let mut taylor = Taylor::<3>::new(Tolerance { rtol: 1e-8, atol: 1e-8 });
        taylor
            .restart(field, 0.0, nalgebra::Vector3::new(0.2, 0.0, -1.0), 10.0, f64::INFINITY)
            .unwrap();
        while taylor.state().0 < 10.0 {
            taylor.step(field).unwrap();
        }
        taylor.solution.is_compiled()
    }

    #[test]
    fn the_papers_equation_is_compiled() {
        let smoothed = |transition| Smoothed {
            system: Caricature::with_reinjection(1e-1, 1e-4),
            transition,
            eps: 1e-3,
        };
        assert!(is_compiled(&smoothed(Transition::Tanh)));
        assert!(!is_compiled(&smoothed(Transition::PerturbedTanh { sigma: 0.01 })));
    }

    #[test]
    fn free_time_stops_before_the_layer() {
        // w = 100 - 1000 s + 100 s^2: at the edge 19.1 for s = 0.0816.
        let w = [100.0, -1000.0, 100.0];
        let s = free_time(&w, 19.1, 1.0);
        let landed = value(&w, s);
        assert!((19.1..20.1).contains(&landed), "{landed}");
        assert_eq!(free_time(&w, 19.1, 0.05), 0.05);
        // Dips to 19.5 and comes back: stops in the margin rather than pass unseen.
        let dip = [100.0, -322.0, 322.0];
        let landed = value(&dip, free_time(&dip, 19.1, 1.0));
        assert!((19.1..20.1).contains(&landed), "{landed}");
        // From the other side.
        let landed = value(&[-100.0, 1000.0], free_time(&[-100.0, 1000.0], 19.1, 1.0));
        assert!((-20.1..-19.1).contains(&landed), "{landed}");
    }

    #[test]
    fn stride_time_bounds_the_travel() {
        for w in [vec![3.0, 1000.0, -1e5, 3e7], vec![3.0, 0.0, 1e4], vec![0.0, -2.0]] {
            let s = stride_time(&w, LAYER_STRIDE, 1.0);
            let travelled = travel(&w, s);
            assert!((0.99..=1.001).contains(&(travelled / LAYER_STRIDE)), "{travelled}");
        }
        assert_eq!(stride_time(&[5.0, 0.1], LAYER_STRIDE, 1.0), 1.0);
    }

    /// Truncation error of the series of tanh w at the end of the longest step that is trusted, w =
    /// distance - s + bend s^2 being the argument. With it, the step, and whether it is longer than
    /// what is always allowed (where the error is the step control's business).
    fn left_out(distance: f64, bend: f64, tolerance: f64) -> (f64, f64, bool) {
        let tolerance = Tolerance { rtol: tolerance, atol: tolerance };
        let order = usize::from(order_for(tolerance, DoubleDouble::EPSILON));
        let w = [distance, -1.0, bend];
        let h = Layers::new::<DoubleDouble>(tolerance, order).longest(LayerKind::Tanh, &w, 1e3);
        // x' = tanh w, w' = v, v' = 2 bend: the series of x is the integral of that of tanh w.
        let tape = Tape::record(3, |x| vec![x[1].tanh(), x[2], Recorded::from_f64(2.0 * bend)]);
        let mut solution = Solution::<DoubleDouble>::new(order + 1, &tape, Constants::Binary);
        solution.expand(&[
            DoubleDouble::ZERO,
            DoubleDouble::from_f64(distance),
            DoubleDouble::from_f64(-1.0),
        ]);
        let x = solution.component(0);
        let series = (0..=order).rev().fold(DoubleDouble::ZERO, |sum, k| {
            sum * DoubleDouble::from_f64(h) + x[k + 1].scale((k + 1) as f64)
        });
        let exact = DoubleDouble::from_f64(distance) - DoubleDouble::from_f64(h)
            + DoubleDouble::from_f64(bend) * DoubleDouble::from_f64(h).squared();
        ((series - exact.tanh()).to_f64().abs(), h, h > stride_time(&w, LAYER_STRIDE, 1e3))
    }

    #[test]
    fn what_the_series_of_tanh_leaves_out_is_below_the_tolerance() {
        for tolerance in [1e-6, 1e-8, 1e-12, 1e-20, 1e-28] {
            let edge = 0.5 * ln(2.0 / tolerance);
            let mut distance = 3.0;
            while distance < edge + 4.0 {
                for bend in [0.0, 0.05, -0.3] {
                    let (error, h, estimated) = left_out(distance, bend, tolerance);
                    assert!(
                        !estimated || error <= tolerance,
                        "{distance}, {bend}, {tolerance:e}: {error:e} in a step of {h}"
                    );
                    // Straight on, the layer is gone through in long steps: the estimate is worth
                    // its name.
                    let near_the_edge = (0.8 * edge..edge + EDGE_MARGIN).contains(&distance);
                    let long = if near_the_edge { 2.0 * LAYER_STRIDE } else { 0.0 };
                    assert!(
                        bend != 0.0 || h > long,
                        "{distance}, {tolerance:e}: a step of only {h}"
                    );
                }
                distance += 0.37;
            }
        }
    }

    #[test]
    fn the_order_is_jorba_and_zous() {
        let order = |size: f64| order_for(Tolerance { rtol: size, atol: 1.0 }, f64::EPSILON);
        // 1 - ln(tolerance)/2, rounded up; not above what 1e-2 asks for nor below a sixteenth of
        // the spacing of numbers.
        assert_eq!([1.0, 1e-2, 1e-3, 1e-8, 1e-15].map(order), [4, 4, 5, 11, 19]);
        assert_eq!([1e-17, 1e-40, 0.0].map(order), [21, 21, 21]);
        assert_eq!(order_for(Tolerance { rtol: 1.0, atol: 1e-30 }, 1e-33), 36);
        assert_eq!(Taylor::<1>::new(Tolerance { rtol: 1e-8, atol: 1e-3 }).order(), 11);
        assert_eq!(Taylor::<1>::new(Tolerance { rtol: 1e-8, atol: 1e-3 }).with_order(1).order(), 2);
    }

    /// x' = x, t' = 1.
    struct Growing;
    impl VectorField<2> for Growing {
        fn eval<S: twofold_num::Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            SVector::from([x[0], S::one()])
        }
    }

    #[test]
    fn a_step_is_known_in_full_precision() {
        fn looks<S: Precision>(mut taylor: Taylor<2, S>, tolerance: f64) {
            let start = SVector::from([S::from_f64(1.0), S::from_f64(0.25)]);
            taylor.restart_from(&Growing, S::from_f64(0.25), start, 7.0, 0.5).unwrap();
            for _ in 0..3 {
                let (t0, x0) = taylor.state();
                let length = taylor.step(&Growing).unwrap().length();
                let (t1, x1) = taylor.state();
                assert!(((t1 - t0).to_f64() - length).abs() < 1e-15);
                for part in [0.0, 0.25, 0.75, 1.0] {
                    let (t, x) = taylor.at(S::from_f64(part));
                    let want = t0 + (t1 - t0) * S::from_f64(part);
                    assert!(
                        (t - want).to_f64().abs() < tolerance
                            && (x[1] - want).to_f64().abs() < tolerance
                    );
                    // x = exp(t - 1/4), the exponential of this arithmetic.
                    assert!((x[0] - (want - S::from_f64(0.25)).exp()).to_f64().abs() < tolerance);
                }
                let gap = |a: SVector<S, 2>, b: SVector<S, 2>| {
                    (0..2).map(|i| (a[i] - b[i]).to_f64().abs()).fold(0.0, f64::max)
                };
                assert!(
                    gap(taylor.at(S::zero()).1, x0) < tolerance
                        && gap(taylor.at(S::one()).1, x1) < tolerance
                );
            }
        }
        let tolerance = |size: f64| Tolerance { rtol: size, atol: size };
        looks(Taylor::new(tolerance(1e-16)), 1e-14);
        looks(Taylor::extended(tolerance(1e-31)), 1e-29);
        looks(Taylor::<2, MultiFloat<4>>::multi(tolerance(1e-60)), 1e-56);
    }
}
