//! A method for smoothed switches: outside the layer the equation is a polynomial, inside it the layer's own variable is the clock.
//!
//! A smoothed system x' = f(x, tanh u), u = h(x)/eps, is two equations in one. Where |u| exceeds an *edge*, tanh is +-1 to far below the
//! tolerance, and if f is a polynomial in x there ([`Flow`]), its solutions have cheap Taylor series of any order: long steps,
//! as in [`Taylor`](super::Taylor) (Jorba & Zou 2005), and where such a step meets the edge is a zero of a polynomial, found with certainty
//! (`Contact`). Inside, an orbit that crosses the layer does so in a time of order eps, in which x hardly moves while tanh runs from one end to the
//! other: as a function of u, dx/du = f/u' is smooth, small, and has tanh at places that are known beforehand. Eight-stage Gauss collocation in u
//! (`Gauss`, order 16) on a few fixed parts of the layer, solved by a few fixed-point iterations, does it. (Taking a component of the state as
//! clock to land on a surface: Henon 1982.)
//!
//! An orbit that does not cross - it slides along the layer, or touches it and turns back - is followed through it by
//! [`Dopri5`] in time, with steps that move u by [`STRIDE`] at most; so is every orbit where u is not a sum of states.
//!
//! The edge lies where 1 - tanh u is a hundredth of the tolerance: what is dropped outside is never more than that part of the field.

mod contact;
mod gauss;

use std::sync::Arc;

use nalgebra::SVector;
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Simd, WithSimd};

use self::contact::{Contact, MOST};
use self::gauss::{Gauss, STAGES, Stages};
use super::Dopri5;
use super::step::{Failure, Interpolant, Statistics, Step, Stepper, Tolerance, finite};
use crate::num::elementary::{exp, ln, rough_exp2, rough_log2, tanh};
use crate::num::polynomial::{Flow, NotPolynomial, Series};
use crate::num::{Given, Registers, Tape};
use crate::system::VectorField;

/// How far a step in time inside the layer may move u.
pub const STRIDE: f64 = 4.0;

/// A step in time inside the layer ends there only when u is so far beyond the edge: else an orbit that follows the edge would change methods at
/// every step.
const BEYOND: f64 = 1.0;

/// Jorba & Zou (2005), sec. 3: the step is shortened by exp(-0.7/(p - 1)) for safety.
const SAFETY_EXPONENT: f64 = -0.7;

/// Most fixed-point iterations of a collocation step.
const SWEEPS: usize = 12;

/// How often a part of the layer may be halved before the layer is left to the other method.
const HALVINGS: usize = 5;

/// Whether the equation on `tape` can be integrated by [`Layered`].
///
/// # Errors
/// Why not.
pub fn applicable(tape: &Tape) -> Result<(), NotPolynomial> {
    Flow::new(tape, 1.0).map(|_| ())
}

/// The stepper. See the [module](self).
#[derive(Clone)]
pub struct Layered<const N: usize> {
    tolerance: Tolerance,
    statistics: Statistics,
    degree: usize,
    safety: f64,
    edge: f64,
    contact: Contact,
    equation: Option<Equation<N>>,
    t: f64,
    x: SVector<f64, N>,
    t_end: f64,
    max_step: f64,
    place: Place,
    /// dx/du where the last part of a crossing ended.
    slope: SVector<f64, N>,
    /// Of each side.
    series: [Series; 2],
    arc: Polynomial<N>,
    crossing: Crossing<N>,
    inner: Dopri5<N>,
}

/// What is known of an equation.
#[derive(Clone)]
struct Equation<const N: usize> {
    tape: Arc<Tape>,
    /// For tanh = -1 and +1.
    sides: [Flow; 2],
    layer: Option<Layer<N>>,
}

/// A layer whose variable is a sum of states.
#[derive(Clone)]
struct Layer<const N: usize> {
    gradient: SVector<f64, N>,
    /// u at x = 0.
    constant: f64,
    /// The parts that it is crossed in, for u > 0: [parts\[i\], parts\[i + 1\]].
    parts: Vec<f64>,
    /// tanh at the nodes of each.
    tanh: Vec<Stages>,
}

/// Where the orbit is.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Place {
    /// Beyond the edge, on the side of this sign; `leaving` if on the edge itself.
    Outside { side: f64, leaving: bool },
    /// In the layer at u, nothing being known of how it goes on.
    Arrived { u: f64 },
    /// Crossing the layer, at u, to the side `direction`.
    Crossing { u: f64, direction: f64 },
    /// In the layer, in time.
    Inside,
}

/// Which interpolant the last step has.
enum Made {
    Arc,
    Crossing,
    Inner,
}

/// An arc outside: a polynomial in the fraction of the step.
#[derive(Clone)]
struct Polynomial<const N: usize> {
    coefficients: [[f64; MOST]; N],
    count: usize,
}

impl<const N: usize> Interpolant<N> for Polynomial<N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        SVector::from_fn(|i, _| self.coordinate(theta, i))
    }
    fn coordinate(&self, theta: f64, i: usize) -> f64 {
        self.coefficients[i][..self.count].iter().rev().fold(0.0, |sum, c| sum * theta + c)
    }
    fn degree(&self) -> usize {
        self.count - 1
    }
    /// The distance from the start, term by term.
    fn reach(&self, coordinate: usize) -> f64 {
        self.coefficients[coordinate][1..self.count].iter().map(|c| c.abs()).sum()
    }
}

/// A part of a crossing: x and t as functions of u.
#[derive(Clone)]
struct Crossing<const N: usize> {
    x0: SVector<f64, N>,
    /// Half the part's length in u, with its sign.
    half: f64,
    /// dx/du and dt/du at the nodes.
    slopes: [Stages; N],
    rate: Stages,
    /// The step's length in time.
    duration: f64,
}

impl<const N: usize> Crossing<N> {
    /// Where in the part, from -1 to 1, the time `elapsed` has passed.
    fn position(&self, elapsed: f64) -> f64 {
        let rate = Gauss::get().coefficients(&self.rate);
        let (mut low, mut high) = (-1.0, 1.0);
        let whole = self.half * gauss::integral(&rate, 1.0);
        let mut s = (2.0 * (elapsed / whole) - 1.0).clamp(low, high);
        for _ in 0..60 {
            let excess = self.half * gauss::integral(&rate, s) - elapsed;
            if excess > 0.0 {
                high = s;
            } else {
                low = s;
            }
            let step = excess / (self.half * gauss::sum(&rate, s));
            let next = if (low..=high).contains(&(s - step)) { s - step } else { 0.5 * (low + high) };
            if (next - s).abs() <= 4.0 * f64::EPSILON {
                return next;
            }
            s = next;
        }
        s
    }

    fn state(&self, s: f64) -> SVector<f64, N> {
        SVector::from_fn(|i, _| {
            self.x0[i] + self.half * gauss::integral(&Gauss::get().coefficients(&self.slopes[i]), s)
        })
    }
}

impl<const N: usize> Interpolant<N> for Crossing<N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        self.state(self.position(theta * self.duration))
    }
    fn degree(&self) -> usize {
        STAGES
    }
    /// The length of the way at most.
    fn reach(&self, coordinate: usize) -> f64 {
        let fastest = self.slopes[coordinate].iter().fold(0.0_f64, |m, v| m.max(v.abs()));
        2.0 * self.half.abs() * fastest * Gauss::get().lebesgue
    }
}

impl<const N: usize> Layered<N> {
    /// A stepper with the given tolerances.
    pub fn new(tolerance: Tolerance) -> Self {
        let smallest = tolerance.rtol.min(tolerance.atol).clamp(f64::EPSILON / 16.0, 1e-2);
        // A degree more costs about as much as the one before: only what is computed now is waited for. So the work per unit of time,
        // p tolerance^(-1/p), is least near -ln(tolerance), and hardly less than there at the longer half of that.
        let degree = ((-0.85 * ln(smallest)).ceil() as usize).clamp(8, Series::MOST);
        let zero = SVector::zeros();
        Self {
            tolerance,
            statistics: Statistics { highest_order: degree as u64, ..Statistics::default() },
            degree,
            safety: exp(SAFETY_EXPONENT / (degree - 1) as f64),
            edge: 0.5 * ln(200.0 / smallest),
            contact: Contact::new(degree + 1),
            equation: None,
            t: 0.0,
            x: zero,
            t_end: 0.0,
            max_step: f64::INFINITY,
            place: Place::Inside,
            slope: zero,
            series: [Series::default(), Series::default()],
            arc: Polynomial { coefficients: [[0.0; MOST]; N], count: degree + 1 },
            crossing: Crossing { x0: zero, half: 0.0, slopes: [[0.0; STAGES]; N], rate: [0.0; STAGES], duration: 0.0 },
            inner: Dopri5::new(tolerance),
        }
    }

    /// Makes the equation ready, unless it is the last one again.
    fn read(&mut self, tape: Arc<Tape>) -> Result<(), NotPolynomial> {
        if self.equation.as_ref().is_some_and(|known| known.tape == tape) {
            return Ok(());
        }
        let sides = [Flow::new(&tape, -1.0)?, Flow::new(&tape, 1.0)?];
        let layer = sides[0].linear_argument().and_then(|(gradient, constant)| {
            let gradient = SVector::<f64, N>::from_column_slice(gradient);
            // An argument that is one number everywhere has no layer to cross.
            gradient.iter().any(|g| *g != 0.0).then(|| Layer::new(gradient, constant, self.edge, self.tolerance.atol))
        });
        self.equation = Some(Equation { tape, sides, layer });
        Ok(())
    }

    /// u.
    fn layer_variable(&mut self) -> f64 {
        let Some(equation) = &self.equation else { return f64::INFINITY };
        if let Some(layer) = &equation.layer {
            return layer.gradient.dot(&self.x) + layer.constant;
        }
        equation.sides[0].expand(self.x.as_slice(), 1, &mut self.series[0]);
        equation.sides[0].argument(0, &self.series[0])
    }

    /// The time derivatives of u were tanh -1 and +1.
    fn speeds<F: VectorField<N>>(&mut self, field: &F) -> [f64; 2] {
        let Some(equation) = &self.equation else { return [0.0; 2] };
        if let Some(layer) = &equation.layer {
            return [-1.0, 1.0].map(|side| {
                let f = field.eval(&self.x.map(|x| Given::new(x, side)));
                (0..N).map(|i| layer.gradient[i] * f[i].value()).sum()
            });
        }
        std::array::from_fn(|side| {
            equation.sides[side].expand(self.x.as_slice(), 2, &mut self.series[side]);
            equation.sides[side].argument(1, &self.series[side])
        })
    }

    fn locate(&mut self) -> Place {
        let Some(equation) = &self.equation else { return Place::Inside };
        if !equation.sides[0].has_layer() {
            return Place::Outside { side: 1.0, leaving: false };
        }
        let u = self.layer_variable();
        if u.abs() > self.edge { Place::Outside { side: u.signum(), leaving: false } } else { Place::Arrived { u } }
    }

    /// A step outside; none if there is no room for one, and then the orbit is somewhere else.
    fn outside(&mut self, side: f64, leaving: bool) -> Result<Option<Made>, Failure> {
        let Some(equation) = &self.equation else { return Ok(None) };
        let (flow, series) = (&equation.sides[usize::from(side > 0.0)], &mut self.series[usize::from(side > 0.0)]);
        let (degree, width) = (self.degree, self.degree + 1);
        flow.expand(self.x.as_slice(), degree, series);
        self.statistics.evaluations += degree as u64;
        // The step that the series allow: the terms of degree p - 1 and p stay below atol + rtol |x|.
        let mut log = f64::NEG_INFINITY;
        for k in [degree - 1, degree] {
            let mut size = 0.0_f64;
            for i in 0..N {
                let q = series.component(i)[k].abs() / (self.tolerance.atol + self.tolerance.rtol * self.x[i].abs());
                // NaN must not be lost, as it would be in f64::max.
                size = if q > size || q.is_nan() { q } else { size };
            }
            if !size.is_finite() {
                // Nothing infinite is left for a next start.
                *series = Series::default();
                return Err(Failure::NotFinite { t: self.t, state: Failure::state(&self.x) });
            }
            log = log.max(rough_log2(size) / k as f64);
        }
        let accurate = rough_exp2(-log) * self.safety;
        let remaining = self.t_end - self.t;
        let mut h = accurate.min(self.max_step);
        let mut last = h * 1.000_000_1 >= remaining;
        if last {
            h = remaining;
        }
        let mut arrived = false;
        if flow.has_layer() {
            let mut distance = [0.0; MOST];
            let mut power = side;
            let known = if equation.layer.is_some() { width } else { degree };
            for (k, c) in distance[..known].iter_mut().enumerate() {
                *c = flow.argument(k, series) * power;
                power *= h;
            }
            distance[0] -= self.edge;
            if leaving || distance[0] <= 0.0 {
                distance[0] = 0.0;
                if distance[1] <= 0.0 {
                    self.place = Place::Arrived { u: side * self.edge };
                    return Ok(None);
                }
            }
            if let Some(theta) = self.contact.first(&distance[..width]) {
                self.place = Place::Arrived { u: side * self.edge };
                h *= theta;
                (arrived, last) = (true, false);
            }
        }
        if h <= self.t.abs() * f64::EPSILON || h < f64::MIN_POSITIVE {
            return if arrived {
                Ok(None)
            } else {
                Err(Failure::StepUnderflow { t: self.t, h, state: Failure::state(&self.x) })
            };
        }
        for i in 0..N {
            let mut power = 1.0;
            for k in 0..width {
                self.arc.coefficients[i][k] = series.component(i)[k] * power;
                power *= h;
            }
        }
        self.x = self.arc.at(1.0);
        self.t = if last { self.t_end } else { self.t + h };
        if !arrived {
            self.place = Place::Outside { side, leaving: false };
        }
        Ok(Some(Made::Arc))
    }

    /// What an orbit in the layer at `u` does: crosses if u moves the same way whatever tanh is.
    fn arrived<F: VectorField<N>>(&mut self, field: &F, u: f64) -> Place {
        let crosses = self.equation.as_ref().is_some_and(|equation| equation.layer.is_some());
        let [minus, plus] = self.speeds(field);
        if crosses && minus * plus > 0.0 && (u * plus < 0.0 || u.abs() < self.edge) {
            self.slope = SVector::zeros();
            Place::Crossing { u, direction: plus.signum() }
        } else {
            Place::Inside
        }
    }

    /// The next part of a crossing; none if there is no good way to make it.
    fn cross<F: VectorField<N>>(&mut self, field: &F, u: f64, direction: f64) -> Option<Made> {
        let layer = self.equation.as_ref()?.layer.as_ref()?;
        let (mut to, known) = layer.next(u, direction);
        let mut tanh_there = known.unwrap_or_else(|| stages(u, to).map(tanh));
        let mut found = None;
        for _ in 0..HALVINGS {
            let (crossing, evaluations) = self.part(field, layer, u, to, &tanh_there);
            self.statistics.evaluations += evaluations;
            if crossing.is_some() {
                found = crossing;
                break;
            }
            to = 0.5 * (u + to);
            tanh_there = stages(u, to).map(tanh);
        }
        let mut crossing = found?;
        let end_slope = SVector::from_fn(|i, _| crossing.slopes[i][STAGES - 1]);
        let longest = self.max_step.min(self.t_end - self.t);
        let (mut position, mut reached) = (1.0, to);
        let last = self.t + crossing.duration * 1.000_000_1 >= self.t_end;
        if crossing.duration > longest {
            position = crossing.position(longest);
            reached = u + crossing.half * (position + 1.0);
            crossing.duration = longest;
        }
        let t = if last { self.t_end } else { self.t + crossing.duration };
        let x = if position < 1.0 { crossing.state(position) } else { crossing.end() };
        if t <= self.t || !finite(&x) {
            return None;
        }
        (self.t, self.x, self.crossing) = (t, x, crossing);
        self.slope = end_slope;
        self.place = if reached == direction * self.edge {
            Place::Outside { side: direction, leaving: true }
        } else {
            Place::Crossing { u: reached, direction }
        };
        Some(Made::Crossing)
    }

    /// Collocation from u to `to`, and the evaluations that it took; nothing if the orbit turns back, the iteration does not converge, or the error is
    /// too large.
    fn part<F: VectorField<N>>(
        &self,
        field: &F,
        layer: &Layer<N>,
        u: f64,
        to: f64,
        tanh: &Stages,
    ) -> (Option<Crossing<N>>, u64) {
        let tolerance = self.tolerance;
        let scale = self.x.map(|x| 1.0 / (tolerance.atol + tolerance.rtol * x.abs()));
        let half = 0.5 * (to - u);
        let gradient = layer.gradient;
        let part = Collocation { field, gradient, half, tanh, x0: self.x, slope: self.slope, scale };
        // All stages are in one register, two, or one each.
        #[cfg(target_arch = "x86_64")]
        if let Some(set) = pulp::x86::V4::try_new() {
            return Simd::vectorize(set, In::<_, 1>(part));
        } else if let Some(set) = pulp::x86::V3::try_new() {
            return Simd::vectorize(set, In::<_, 2>(part));
        }
        In::<_, STAGES>(part).with_simd(pulp::Scalar)
    }

    /// A step in time inside the layer.
    fn inside<F: VectorField<N>>(&mut self, field: &F, begin: bool) -> Result<Made, Failure> {
        let Statistics { evaluations, rejected, .. } = *self.inner.statistics();
        if begin {
            self.inner.restart(field, self.t, self.x, self.t_end, self.max_step)?;
        }
        let speeds = self.speeds(field);
        let fastest = speeds[0].abs().max(speeds[1].abs());
        self.inner.max_step = self.max_step.min(STRIDE / fastest);
        self.inner.h = self.inner.h.min(self.inner.max_step);
        let step = self.inner.step(field)?;
        (self.t, self.x) = (step.t1, step.x1);
        self.statistics.evaluations += self.inner.statistics().evaluations - evaluations;
        self.statistics.rejected += self.inner.statistics().rejected - rejected;
        let u = self.layer_variable();
        self.place = if u.abs() >= self.edge + BEYOND {
            Place::Outside { side: u.signum(), leaving: false }
        } else {
            Place::Inside
        };
        Ok(Made::Inner)
    }
}

/// One part of a crossing to compute, all stages side by side in the machine's own instructions: each lane rounds by itself, so that they change
/// no bit.
struct Collocation<'a, F, const N: usize> {
    field: &'a F,
    gradient: SVector<f64, N>,
    /// Half the part's length in u, with its sign.
    half: f64,
    tanh: &'a Stages,
    x0: SVector<f64, N>,
    /// A guess of dx/du.
    slope: SVector<f64, N>,
    /// One over the tolerated error of each component.
    scale: SVector<f64, N>,
}

/// A task for `K` registers.
struct In<T, const K: usize>(T);

impl<F: VectorField<N>, const N: usize, const K: usize> WithSimd for In<Collocation<'_, F, N>, K> {
    type Output = (Option<Crossing<N>>, u64);

    // Loops by number: iterators and closures may stay calls, compiled for the wrong instruction set.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn with_simd<S: Simd>(self, set: S) -> Self::Output {
        let Collocation { field, gradient, half, tanh, x0, slope, scale } = self.0;
        let gauss = Gauss::get();
        let number = |value: f64| Registers::<S, K>::splat(set, value);
        let stages = |values: &Stages| {
            let mut parts = [set.splat_f64s(0.0); K];
            cast_slice_mut::<_, f64>(&mut parts).copy_from_slice(values);
            Registers::<S, K>::new(set, parts)
        };
        let bare = |stages: Registers<S, K>| {
            let mut values = [0.0; STAGES];
            values.copy_from_slice(cast_slice::<_, f64>(&stages.parts()));
            values
        };
        let tanh = stages(tanh);
        let along = (stages(&gauss.nodes) + number(1.0)) * number(half);
        let mut states = SVector::<_, N>::from_element(number(0.0));
        for i in 0..N {
            states[i] = number(x0[i]) + number(slope[i]) * along;
        }
        let (mut evaluations, mut before) = (0, f64::NAN);
        for _ in 0..SWEEPS {
            evaluations += STAGES as u64;
            let mut x = SVector::<_, N>::from_element(Given::new(tanh, tanh));
            for i in 0..N {
                x[i] = Given::new(states[i], tanh);
            }
            let f = field.eval(&x);
            let mut speed = number(0.0);
            for i in 0..N {
                speed += number(gradient[i]) * f[i].value();
            }
            let rate = number(1.0) / speed;
            // Time goes on everywhere.
            if !bare(rate * number(half)).iter().all(|time| *time > 0.0) {
                return (None, evaluations);
            }
            let mut slopes = [[0.0; STAGES]; N];
            let mut most = number(0.0);
            for i in 0..N {
                slopes[i] = bare(f[i].value() * rate);
                let mut sum = number(0.0);
                for m in 0..STAGES {
                    sum += stages(&gauss.integrals[m]) * number(slopes[i][m]);
                }
                let new = number(x0[i]) + sum * number(half);
                let moved = (new - states[i]).size() * number(scale[i]);
                most = most.less(moved, set).select(moved, most);
                states[i] = new;
            }
            let change = bare(most).iter().fold(0.0_f64, |m, v| m.max(*v));
            let contraction = change / before;
            before = change;
            // What is left is about change * contraction / (1 - contraction); of the first iteration nothing is known.
            if contraction < 0.5 && change * contraction <= 0.02 || change <= 0.02 {
                let error = (0..N).fold(0.0_f64, |most, i| {
                    let rough = gauss.roughness(&slopes[i]);
                    let size = slopes[i].iter().fold(rough, |m, v| m.max(v.abs()));
                    // At the end the method is of twice the order.
                    let at_end = rough * rough / size.max(f64::MIN_POSITIVE);
                    most.max(half.abs() * at_end.max(rough / 160.0) * scale[i])
                });
                let rate = bare(rate);
                let duration = half * weighted(&gauss.weights, &rate);
                let crossing = Crossing { x0, half, slopes, rate, duration };
                return ((error <= 1.0).then_some(crossing), evaluations);
            }
            if contraction >= 0.5 {
                return (None, evaluations);
            }
        }
        (None, evaluations)
    }
}

/// sum of a_j b_j.
fn weighted(a: &Stages, b: &Stages) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The nodes of the part from `u` to `to`.
fn stages(u: f64, to: f64) -> Stages {
    let (middle, half) = (0.5 * (u + to), 0.5 * (to - u));
    Gauss::get().nodes.map(|node| middle + half * node)
}

impl<const N: usize> Crossing<N> {
    fn end(&self) -> SVector<f64, N> {
        SVector::from_fn(|i, _| self.x0[i] + self.half * weighted(&Gauss::get().weights, &self.slopes[i]))
    }
}

impl<const N: usize> Layer<N> {
    fn new(gradient: SVector<f64, N>, constant: f64, edge: f64, atol: f64) -> Self {
        let gauss = Gauss::get();
        // A unit of u in units of the state.
        let width = 1.0 / gradient.iter().fold(0.0_f64, |m, g| m.max(g.abs()));
        let good = |from: f64, to: f64| {
            let rough = 0.5 * gauss.roughness(&stages(from, to).map(tanh));
            width * 0.5 * (to - from) * (rough * rough).max(rough / 160.0) <= 0.2 * atol
        };
        let mut parts = vec![0.0];
        let mut from = 0.0;
        while from < edge {
            let mut to = edge;
            while !good(from, to) && to - from > 0.1 {
                to = from + 0.85 * (to - from);
            }
            parts.push(to);
            from = to;
        }
        let tanh = parts.windows(2).map(|part| stages(part[0], part[1]).map(tanh)).collect();
        Self { gradient, constant, parts, tanh }
    }

    /// Where the part that begins at `u` ends, in this direction, and tanh at its nodes if it is one of the usual ones.
    fn next(&self, u: f64, direction: f64) -> (f64, Option<Stages>) {
        let v = u * direction;
        // Never a tiny part.
        const LEAST: f64 = 1e-2;
        if v < -LEAST {
            // Inwards: from -parts[i + 1] to -parts[i].
            let i = self.parts.iter().rposition(|p| *p < -v - LEAST).unwrap_or(0);
            let known = self.parts.get(i + 1).is_some_and(|p| *p == -v).then(|| {
                let mut there = self.tanh[i];
                there.reverse();
                there.map(|value| -value * direction)
            });
            (-self.parts[i] * direction, known)
        } else {
            let last = self.parts.len() - 1;
            let i = self.parts.iter().position(|p| *p > v + LEAST).unwrap_or(last);
            let known = (i > 0 && self.parts[i - 1] == v).then(|| self.tanh[i - 1].map(|value| value * direction));
            (self.parts[i] * direction, known)
        }
    }
}

impl<const N: usize> Stepper<N> for Layered<N> {
    fn restart<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        (self.t, self.x, self.t_end, self.max_step) = (t, x, t_end, max_step);
        self.statistics.restarts += 1;
        self.statistics.evaluations += 1;
        if !finite(&x) || !finite(&field.eval(&x)) {
            return Err(Failure::NotFinite { t, state: Failure::state(&x) });
        }
        self.read(field.tape()).map_err(|why| Failure::NotApplicable { method: "layered", why: why.to_string() })?;
        self.place = self.locate();
        Ok(())
    }

    fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure> {
        let (t0, x0) = (self.t, self.x);
        let mut begin = false;
        let made = loop {
            match self.place {
                Place::Outside { side, leaving } => {
                    if let Some(made) = self.outside(side, leaving)? {
                        break made;
                    }
                }
                Place::Arrived { u } => {
                    self.place = self.arrived(field, u);
                    begin = self.place == Place::Inside;
                }
                Place::Crossing { u, direction } => match self.cross(field, u, direction) {
                    Some(made) => break made,
                    None => {
                        self.place = Place::Inside;
                        begin = true;
                    }
                },
                Place::Inside => break self.inside(field, begin)?,
            }
        };
        if !finite(&self.x) {
            return Err(Failure::NotFinite { t: t0, state: Failure::state(&x0) });
        }
        self.statistics.steps += 1;
        let interpolant: &dyn Interpolant<N> = match made {
            Made::Arc => &self.arc,
            Made::Crossing => &self.crossing,
            Made::Inner => &self.inner.dense,
        };
        Ok(Step { t0, t1: self.t, x0, x1: self.x, interpolant })
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}
