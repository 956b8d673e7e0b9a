//! A method for smoothed switches: outside the layer the equation is a polynomial, inside it the
//! layer's own variable is the clock.
//!
//! A smoothed system x' = f(x, tanh u), u = h(x)/eps, is two equations in one. Where |u| exceeds an
//! *edge*, tanh is +-1 to far below the tolerance, and if f is a polynomial in x there ([`Flow`]),
//! its solutions have cheap Taylor series of any order: long steps, as in [`Taylor`](super::Taylor)
//! (Jorba & Zou 2005), and where such a step meets the edge is a zero of a polynomial, found with
//! certainty (`Contact`). Inside, an orbit that crosses the layer does so in a time of order eps,
//! in which x hardly moves while tanh runs from one end to the other: as a function of u, dx/du =
//! f/u' is smooth, small, and has tanh at places that are known beforehand. Eight-stage Gauss
//! collocation in u (`Gauss`, order 16) on a few fixed parts of the layer, all parts side by side,
//! solved by a few fixed-point iterations, does it: one step. (Taking a component of the state as
//! clock to land on a surface: Henon 1982.)
//!
//! An orbit that does not cross - it slides along the layer, or touches it and turns back - is
//! followed through it by [`Dopri5`] in time, with steps that move u by [`STRIDE`] at most, and
//! with tanh u for a state beside the others (`Sliding`). Where u is not a sum of states every
//! orbit is followed so through the layer, and by [`Dopri5`] alone.
//!
//! The edge lies where 1 - tanh u is a hundredth of the tolerance: what is dropped outside is never
//! more than that part of the field.

mod contact;
mod crossing;
mod gauss;
mod sliding;

use std::sync::Arc;

use nalgebra::SVector;

use self::contact::{Contact, MOST};
use self::crossing::{Collocation, Crossing, Layer, Section};
use self::sliding::Sliding;
use super::Dopri5;
use super::step::{Failure, Interpolant, Statistics, Step, Stepper, Tolerance, finite, is_last};
use twofold_num::elementary::{exp, ln, rough_exp2, rough_log2};
use twofold_num::polynomial::{Flow, NotPolynomial, Series};
use twofold_num::{Given, Tape};
use twofold_system::VectorField;

/// Largest change of u in one time step inside the layer.
pub const STRIDE: f64 = 4.0;

/// A step in time inside the layer ends there only when u is so far beyond the edge: else an orbit
/// that follows the edge would change methods at every step.
const BEYOND: f64 = 1.0;

/// Jorba & Zou (2005), sec. 3: the step is shortened by exp(-0.7/(p - 1)) for safety.
const SAFETY_EXPONENT: f64 = -0.7;

/// Maximum number of halvings of the layer's parts, after which the other method is used.
const HALVINGS: u32 = 5;

/// Whether the equation on `tape` can be integrated by [`Layered`].
///
/// # Errors
/// The reason why it cannot.
pub fn applicable(tape: &Tape) -> Result<(), NotPolynomial> {
    Flow::new(tape, 1.0).map(|_| ())
}

/// The stepper. See the [module](self).
///
/// ```
/// use nalgebra::Vector2;
/// use twofold_integrate::{DriveOptions, Ignore, Layered, Tolerance, drive};
/// use twofold_system::{Field, System, Transition};
/// let block = System::builtin("stick-slip").expect("built in");
/// let smoothed = Field::smoothed(&block, Transition::Tanh, 1e-3).bind::<2>()?;
/// let mut layered = Layered::new(Tolerance { rtol: 1e-10, atol: 1e-10 });
/// let to = DriveOptions::to(5.0);
/// let end = drive(&smoothed, Vector2::new(0.0, 0.0), &to, &mut layered, &mut Ignore, &())?;
/// assert_eq!(end.t, 5.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
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
    /// The field where the layer was met, for tanh = -1 and +1.
    ends: [SVector<f64, N>; 2],
    /// Of each side.
    series: [Series; 2],
    arc: Polynomial<N>,
    crossing: Crossing<N>,
    inner: Dopri5<N>,
    sliding: Sliding,
}

/// Data about an equation.
#[derive(Clone)]
struct Equation<const N: usize> {
    tape: Arc<Tape>,
    /// For tanh = -1 and +1.
    sides: [Flow; 2],
    layer: Option<Layer<N>>,
}

/// Place of the orbit relative to the layer.
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

/// Interpolant of the last step.
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

impl<const N: usize> Polynomial<N> {
    /// The coefficients of degree 0 to `degree` in the fraction of a step of length `h`, from those
    /// in time.
    fn scale(&mut self, series: &Series, h: f64, degree: usize) {
        let mut power = 1.0;
        for k in 0..(degree + 1).min(MOST) {
            for i in 0..N {
                self.coefficients[i][k] = series.component(i)[k] * power;
            }
            power *= h;
        }
        self.count = degree + 1;
    }
}

impl<const N: usize> Interpolant<N> for Polynomial<N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        SVector::from_fn(|i, _| self.coordinate(theta, i))
    }
    // Four polynomials in theta^4 (Estrin 1960): a single one would wait for itself all the way.
    // Beyond the last coefficient are zeros.
    #[inline]
    fn coordinate(&self, theta: f64, i: usize) -> f64 {
        let theta2 = theta * theta;
        let theta4 = theta2 * theta2;
        let mut sums = [0.0; 4];
        for four in self.coefficients[i][..self.count.next_multiple_of(4)].chunks_exact(4).rev() {
            for (sum, c) in sums.iter_mut().zip(four) {
                *sum = *sum * theta4 + c;
            }
        }
        (sums[0] + sums[1] * theta) + (sums[2] + sums[3] * theta) * theta2
    }
    fn degree(&self) -> usize {
        self.count - 1
    }
    /// The distance from the chord, term by term: theta - theta^2 is at most 1/4, theta - theta^k
    /// less than 1.
    fn reach(&self, coordinate: usize) -> f64 {
        let c = &self.coefficients[coordinate];
        0.25 * c[2].abs() + c[3..self.count].iter().map(|c| c.abs()).sum::<f64>()
    }
    /// The derivative keeps the sign that it has at the start.
    fn is_monotone(&self, coordinate: usize) -> bool {
        let c = &self.coefficients[coordinate];
        let bend = c[..self.count].iter().zip(DEGREES).skip(2).map(|(c, k)| c.abs() * k);
        c[1].abs() > bend.sum::<f64>() * (1.0 + 1e-12)
    }
}

/// 0, 1, 2, ...
const DEGREES: [f64; MOST] = {
    let mut degrees = [0.0; MOST];
    let mut k = 0;
    while k < MOST {
        degrees[k] = k as f64;
        k += 1;
    }
    degrees
};

impl<const N: usize> Layered<N> {
    /// A stepper with the given tolerances.
    pub fn new(tolerance: Tolerance) -> Self {
        let smallest = tolerance.rtol.min(tolerance.atol).clamp(f64::EPSILON / 16.0, 1e-2);
        // A degree more costs about as much as the one before: only what is computed now is waited
        // for. So the work per unit of time, p tolerance^(-1/p), is least near -ln(tolerance), and
        // hardly less than there at the longer half of that.
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
            ends: [zero; 2],
            series: [Series::default(), Series::default()],
            arc: Polynomial { coefficients: [[0.0; MOST]; N], count: degree + 1 },
            crossing: Crossing::none(),
            inner: Dopri5::new(tolerance),
            sliding: Sliding::default(),
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
            gradient
                .iter()
                .any(|g| *g != 0.0)
                .then(|| Layer::new(gradient, constant, self.edge, self.tolerance.atol))
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
            self.ends = [-1.0, 1.0].map(|side| {
                let f = field.eval(&self.x.map(|x| Given::new(x, side)));
                SVector::from_fn(|i, _| f[i].value())
            });
            return self.ends.each_ref().map(|f| layer.gradient.dot(f));
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
        if u.abs() > self.edge {
            Place::Outside { side: u.signum(), leaving: false }
        } else {
            Place::Arrived { u }
        }
    }

    /// A step outside; none if there is no room for one, and then the orbit is somewhere else.
    fn outside(&mut self, side: f64, leaving: bool) -> Result<Option<Made>, Failure> {
        let Some(equation) = &self.equation else { return Ok(None) };
        let (flow, series) =
            (&equation.sides[usize::from(side > 0.0)], &mut self.series[usize::from(side > 0.0)]);
        let (degree, width) = (self.degree, self.degree + 1);
        flow.expand(self.x.as_slice(), degree, series);
        self.statistics.evaluations += degree as u64;
        // The step that the series allow: the terms of degree p - 1 and p stay below atol + rtol
        // |x|.
        let mut log = f64::NEG_INFINITY;
        for k in [degree - 1, degree] {
            let mut size = 0.0_f64;
            for i in 0..N {
                let q = series.component(i)[k].abs()
                    / (self.tolerance.atol + self.tolerance.rtol * self.x[i].abs());
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
        let mut last = is_last(self.t, h, self.t_end, 1.000_000_1);
        if last {
            h = remaining;
        }
        let mut arrived = false;
        if flow.has_layer() {
            let mut distance = [0.0; MOST];
            let mut power = side;
            match &equation.layer {
                Some(layer) => {
                    for i in (0..N).filter(|i| layer.gradient[*i] != 0.0) {
                        let (gradient, component) = (layer.gradient[i], series.component(i));
                        for k in 0..width {
                            distance[k] += gradient * component[k];
                        }
                    }
                    distance[0] += layer.constant;
                    for c in &mut distance[..width] {
                        *c *= power;
                        power *= h;
                    }
                }
                None => {
                    for (k, c) in distance[..degree].iter_mut().enumerate() {
                        *c = flow.argument(k, series) * power;
                        power *= h;
                    }
                }
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
        self.arc.scale(series, h, degree);
        self.x = self.arc.at(1.0);
        self.t = if last { self.t_end } else { self.t + h };
        if !arrived {
            self.place = Place::Outside { side, leaving: false };
        }
        Ok(Some(Made::Arc))
    }

    /// The motion in the layer at `u`: crossing if u moves the same way for every value of tanh.
    fn arrived<F: VectorField<N>>(&mut self, field: &F, u: f64) -> Place {
        let crosses = self.equation.as_ref().is_some_and(|equation| equation.layer.is_some());
        let [minus, plus] = self.speeds(field);
        if crosses && minus * plus > 0.0 && (u * plus < 0.0 || u.abs() < self.edge) {
            Place::Crossing { u, direction: plus.signum() }
        } else {
            Place::Inside
        }
    }

    /// The next parts of a crossing; none if there is no good way to make them.
    fn cross<F: VectorField<N>>(&mut self, field: &F, u: f64, direction: f64) -> Option<Made> {
        let layer = self.equation.as_ref()?.layer.as_ref()?;
        let (v, edge) = (u * direction, layer.edge());
        let mut place = Section::default();
        let mut reached = None;
        for halvings in 0..HALVINGS {
            let section = layer.section(v, halvings, &mut place);
            let (tolerance, x0, ends, crossing) =
                (self.tolerance, self.x, &self.ends, &mut self.crossing);
            let task =
                Collocation { field, layer, section, direction, tolerance, x0, ends, crossing };
            let (good, evaluations) = task.solve();
            self.statistics.evaluations += evaluations;
            if good {
                reached = Some(section.to);
                break;
            }
        }
        let mut reached = reached?;
        let longest = self.max_step.min(self.t_end - self.t);
        let whole = self.crossing.whole();
        let last = is_last(self.t, whole, self.t_end, 1.000_000_1);
        let mut x = self.crossing.end;
        if whole > longest {
            (reached, x) = self.crossing.after(longest);
            self.crossing.duration = longest;
        }
        let t = if last { self.t_end } else { self.t + self.crossing.duration };
        if t <= self.t || !finite(&x) {
            return None;
        }
        (self.t, self.x) = (t, x);
        self.place = if reached == edge {
            Place::Outside { side: direction, leaving: true }
        } else {
            Place::Crossing { u: reached * direction, direction }
        };
        Some(Made::Crossing)
    }

    /// A step in time inside the layer.
    fn inside<F: VectorField<N>>(&mut self, field: &F, begin: bool) -> Result<Made, Failure> {
        let Statistics { evaluations, rejected, .. } = *self.inner.statistics();
        if begin {
            self.inner.restart(field, self.t, self.x, self.t_end, self.max_step)?;
        }
        let u = if let Some(Equation { layer: Some(layer), .. }) = &self.equation {
            if begin {
                self.sliding = Sliding::begin(&self.inner, field, layer);
            }
            self.sliding.step(&mut self.inner, field, layer, self.max_step)?;
            (self.t, self.x) = (self.inner.t, self.inner.x);
            self.sliding.u
        } else {
            let speeds = self.speeds(field);
            let fastest = speeds[0].abs().max(speeds[1].abs());
            self.inner.max_step = self.max_step.min(STRIDE / fastest);
            self.inner.h = self.inner.h.min(self.inner.max_step);
            let step = self.inner.step(field)?;
            (self.t, self.x) = (step.t1, step.x1);
            self.layer_variable()
        };
        self.statistics.evaluations += self.inner.statistics().evaluations - evaluations;
        self.statistics.rejected += self.inner.statistics().rejected - rejected;
        self.place = if u.abs() >= self.edge + BEYOND {
            Place::Outside { side: u.signum(), leaving: false }
        } else {
            Place::Inside
        };
        Ok(Made::Inner)
    }
}

/// The method is compiled for systems of up to so many states.
const MOST_STATES: usize = 4;

impl<const N: usize> Layered<N> {
    fn too_many_states() -> Failure {
        Failure::NotApplicable {
            method: "layered",
            why: format!("it has {N} states, and the method is there for up to {MOST_STATES}"),
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
        if const { N > MOST_STATES } {
            return Err(Self::too_many_states());
        }
        self.read(field.tape())
            .map_err(|why| Failure::NotApplicable { method: "layered", why: why.to_string() })?;
        self.restart_again(field, t, x, t_end, max_step)
    }

    fn restart_again<F: VectorField<N>>(
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
        self.place = self.locate();
        Ok(())
    }

    fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure> {
        // Said here, too, so that nothing is compiled for them.
        if const { N > MOST_STATES } {
            return Err(Self::too_many_states());
        }
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
