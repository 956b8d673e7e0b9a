//! The breakdown of determinism, in digits.
//!
//! A two-fold singularity has no determined exit (Jeffrey 2013, secs 2 and 4). The smoothed system is an ordinary
//! differential equation and has one, but near the singularity it amplifies whatever disturbs it. Two measurements
//! put numbers on that: how many digits of each crossing a method gets right ([`agreement`]), and how much larger a
//! small disturbance is after a visit, as a function of when it was made ([`amplification`]). Both are measured
//! against an orbit in double-double arithmetic ([`reference()`]).
//!
//! Measured with this module, first visit, reconstructed reading (alpha = 1e-1), growth of a disturbance between 0.1 before
//! and 0.1 after the passage, by its direction:
//!
//! ```text
//! eps                              1e-2              1e-3              1e-4
//! across the layer (x)             1e9 .. 3e9        7e11 .. 8e12      8e14 .. 5e16
//! along the surface (y, z)         1e6 .. 1.5e8      6e9 .. 1.1e11     2e12 .. 2.7e14
//! made at t = 0                    0.09 .. 0.12      0.02              0.006
//! ```
//!
//! Three to four digits per decade of eps. What is brought in from outside is contracted on the way in by as much, and a
//! little more: the *place* of the exit crossing hardly depends on the start (its time does). In the printed reading
//! (alpha = 1e-3) the growth in x at the passage is larger still: 1e14, 2e16, 2e20.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::section::{Direction, SectionRecorder};
use crate::integrate::{
    Course, Failure, Flow, Observer, Step, StepCap, Stepper, Taylor, Tolerance, drive, roots::sign_changes,
};
use crate::num::elementary::log10;
use crate::num::{Arithmetic, DoubleDouble, Scalar};
use crate::system::VectorField;

/// A point in double-double precision.
pub type ExtendedPoint = SVector<DoubleDouble, 3>;

/// The local tolerance of reference orbits: at the precision of the arithmetic.
pub const REFERENCE_TOLERANCE: Tolerance = Tolerance { rtol: 1e-32, atol: 1e-32 };

/// The plane through which crossings are counted: `state[coordinate] = value`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plane {
    /// Index of the coordinate.
    pub coordinate: usize,
    /// Its value on the plane.
    pub value: f64,
}

/// A passage through a plane, in double-double precision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExtendedCrossing {
    /// Time.
    pub t: DoubleDouble,
    /// State.
    pub x: ExtendedPoint,
    /// Sense.
    pub direction: Direction,
}

impl ExtendedCrossing {
    /// The largest component of the state.
    fn extent(&self) -> f64 {
        self.x.iter().map(|c| c.to_f64().abs()).fold(0.0, f64::max)
    }
}

/// The first `count` crossings of `plane` by the orbit through `x0` at t = 0, in double-double arithmetic; fewer if `t_end`
/// comes first. `decimal`: read the equation's constants as decimal numbers
/// ([`Constants::Decimal`](crate::num::series::Constants)); without, the equation is the one that `f64` methods solve.
pub fn reference<F: VectorField<3>>(
    field: &F,
    x0: ExtendedPoint,
    plane: Plane,
    count: usize,
    t_end: f64,
    decimal: bool,
) -> Result<Vec<ExtendedCrossing>, Failure> {
    let mut stepper = Taylor::extended(REFERENCE_TOLERANCE);
    if decimal {
        stepper = stepper.with_decimal_constants();
    }
    stepper.restart_from(field, DoubleDouble::zero(), x0, t_end, f64::INFINITY)?;
    let mut found = Vec::with_capacity(count);
    while found.len() < count && stepper.state().0.to_f64() < t_end {
        next_crossings(&mut stepper, field, plane, |crossing| found.push(crossing))?;
    }
    found.truncate(count);
    Ok(found)
}

/// Steps of one reference orbit. The orbits of the paper's first 200 units of time take some 1e4; the stiff far attractor
/// takes as many per unit of time and would never end.
const MOST_STEPS: u64 = 2_000_000;

/// One step; its crossings go to `found`.
fn next_crossings<F: VectorField<3>>(
    stepper: &mut Taylor<3, DoubleDouble>,
    field: &F,
    plane: Plane,
    mut found: impl FnMut(ExtendedCrossing),
) -> Result<(), Failure> {
    if stepper.statistics().steps >= MOST_STEPS {
        let (t, x) = stepper.state();
        let state = Failure::state(&x.map(|c| c.to_f64()));
        return Err(Failure::TooManySteps { t: t.to_f64(), limit: MOST_STEPS, state });
    }
    let step = stepper.step(field)?;
    let mut before = step.x0[plane.coordinate] - plane.value;
    for theta in sign_changes(&step, |x| x[plane.coordinate] - plane.value) {
        let direction = if before < 0.0 { Direction::Up } else { Direction::Down };
        before = -before;
        let (t, x) = refine(stepper, plane, theta);
        found(ExtendedCrossing { t, x, direction });
    }
    Ok(())
}

/// The crossing near the fraction `theta` of the last step, by the secant method: from 16 digits to all.
fn refine(stepper: &Taylor<3, DoubleDouble>, plane: Plane, theta: f64) -> (DoubleDouble, ExtendedPoint) {
    let height = |s| stepper.at(s).1[plane.coordinate] - DoubleDouble::from_f64(plane.value);
    let mut a = DoubleDouble::new(theta, 1e-9);
    let mut b = DoubleDouble::from_f64(theta);
    let mut ha = height(a);
    for _ in 0..4 {
        let hb = height(b);
        if hb == ha || hb == DoubleDouble::zero() {
            break;
        }
        let next = b - hb * (b - a) / (hb - ha);
        (a, ha, b) = (b, hb, next);
    }
    stepper.at(b)
}

/// How well a method reproduces one crossing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Agreement {
    /// Number of the crossing, from 1.
    pub crossing: usize,
    /// Its time on the reference orbit.
    pub t: f64,
    /// Distance of the two states: the largest difference of a component.
    pub error: f64,
    /// log10 of `error`, not below [`Agreement::FLOOR`].
    pub log10_error: f64,
}

impl Agreement {
    /// A crossing is handed on in `f64`: smaller differences are not resolved.
    pub const FLOOR: f64 = -17.0;
}

/// Stops when enough crossings are recorded.
struct Until {
    section: SectionRecorder,
    crossings: usize,
}

impl Observer<3> for Until {
    fn step(&mut self, step: &Step<'_, 3>) -> Flow {
        self.section.step(step);
        if self.section.crossings().len() >= self.crossings { Flow::Stop } else { Flow::Continue }
    }
}

/// Runs `stepper` from `x0` and compares its n-th crossing of `plane` with the n-th of `reference`. Fewer rows come back
/// if the method has made fewer crossings when twice the reference's time is over.
pub fn agreement<F: VectorField<3>, M: Stepper<3>>(
    field: &F,
    x0: SVector<f64, 3>,
    plane: Plane,
    reference: &[ExtendedCrossing],
    stepper: &mut M,
    cap: StepCap,
    max_steps: u64,
) -> Result<Vec<Agreement>, Failure> {
    let Some(last) = reference.last() else { return Ok(Vec::new()) };
    let mut until = Until { section: SectionRecorder::new(plane.coordinate, plane.value), crossings: reference.len() };
    let t_end = 2.0 * last.t.to_f64();
    let course = Course { step_cap: cap, max_steps, ..Course::to(t_end) };
    let _ = drive(field, x0, &course, stepper, &mut until, &())?.within_budget()?;
    let pairs = reference.iter().zip(until.section.crossings()).enumerate();
    Ok(pairs
        .map(|(i, (want, got))| {
            let gap = |c: usize| (DoubleDouble::from_f64(got.x[c]) - want.x[c]).to_f64().abs();
            let error = (0..3).map(gap).fold(0.0, f64::max);
            Agreement { crossing: i + 1, t: want.t.to_f64(), error, log10_error: log10(error).max(Agreement::FLOOR) }
        })
        .collect())
}

/// What became of a small disturbance.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Amplification {
    /// When it was made.
    pub t: f64,
    /// The state then.
    pub x: [f64; 3],
    /// Its growth until the exit crossing, had it been made in the first, second, third component.
    pub factors: [f64; 3],
    /// The largest of the three.
    pub factor: f64,
    /// log10 of `factor`.
    pub log10_factor: f64,
}

/// Amplified rounding of double-double numbers stays below this up to growths of about 1e20.
pub const SMALLEST_RESPONSE: f64 = 1e-9;
/// Up to here the response to a disturbance is linear to about one per cent for eps from 1e-2 to 1e-4 (compared with
/// responses 1e3 times smaller).
pub const LARGEST_RESPONSE: f64 = 1e-4;
/// A disturbance must be far above the spacing of double-double numbers near 1e-2.
const SMALLEST_SIZE: f64 = 1e-29;
/// And is none if it is not small.
const LARGEST_SIZE: f64 = 1e-9;

/// A visit to the singularity, and what it does to disturbances.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Visit {
    /// When the orbit passed the singularity: the first crossing of the plane within `near` of the origin.
    pub t: f64,
    /// The first crossing after it that is farther than `near`: where exits are compared.
    pub exit_t: f64,
    /// Its state.
    pub exit: [f64; 3],
    /// Growth of disturbances, in the order of the moments asked for.
    pub rows: Vec<Amplification>,
}

/// How the first visit to the singularity at the origin amplifies a small disturbance made at t_visit + offset, for each
/// of the increasing `offsets` (those before t = 0 count as t = 0, those after the exit are left out).
///
/// Each disturbed orbit and the undisturbed one are followed in double-double arithmetic to the exit crossing; the
/// growth is the distance of the two crossings over the size of the disturbance. The size is chosen so that the distance
/// comes out between [`SMALLEST_RESPONSE`] and [`LARGEST_RESPONSE`]: far above the arithmetic's own amplified rounding, and
/// small enough to be linear. `Ok(None)`: no visit, or no exit, before `t_end`.
pub fn amplification<F: VectorField<3>>(
    field: &F,
    x0: SVector<f64, 3>,
    plane: Plane,
    near: f64,
    offsets: &[f64],
    t_end: f64,
) -> Result<Option<Visit>, Failure> {
    let start = x0.map(DoubleDouble::from_f64);
    let Some(visit) = exit(field, DoubleDouble::zero(), start, plane, |_, c| c.extent() < near, t_end)? else {
        return Ok(None);
    };
    let t_visit = visit.t.to_f64();
    let leaves = |after: f64| move |t: f64, c: &ExtendedCrossing| t > after && c.extent() >= near;
    let (mut t, mut x) = (DoubleDouble::zero(), start);
    let Some(out) = exit(field, t, x, plane, leaves(t_visit), t_end)? else { return Ok(None) };
    let mut rows = Vec::with_capacity(offsets.len());
    let mut stepper = Taylor::extended(REFERENCE_TOLERANCE);
    let mut sizes = [1e-20; 3];
    for offset in offsets {
        let moment = (t_visit + offset).max(0.0);
        if moment >= out.t.to_f64() {
            continue;
        }
        if moment > t.to_f64() {
            stepper.restart_from(field, t, x, moment, f64::INFINITY)?;
            while stepper.state().0.to_f64() < moment {
                stepper.step(field)?;
            }
            (t, x) = stepper.state();
        }
        let wanted = leaves(t_visit.max(moment));
        let Some(undisturbed) = exit(field, t, x, plane, wanted, t_end)? else { continue };
        let mut factors = [0.0; 3];
        for component in 0..3 {
            let size = &mut sizes[component];
            factors[component] = loop {
                let mut disturbed = x;
                disturbed[component] += DoubleDouble::from_f64(*size);
                // A disturbed orbit that never leaves has been moved by more than is linear.
                let response = exit(field, t, disturbed, plane, wanted, t_end)?
                    .map_or(f64::INFINITY, |moved| (moved.x - undisturbed.x).map(|c| c.to_f64()).amax());
                if response > LARGEST_RESPONSE && *size > SMALLEST_SIZE {
                    *size *= 1e-3;
                } else if response < SMALLEST_RESPONSE && *size < LARGEST_SIZE {
                    *size *= 1e3;
                } else {
                    break response / *size;
                }
            };
        }
        let factor = factors.iter().copied().fold(0.0, f64::max);
        rows.push(Amplification {
            t: t.to_f64(),
            x: std::array::from_fn(|i| x[i].to_f64()),
            factors,
            factor,
            log10_factor: log10(factor),
        });
    }
    Ok(Some(Visit { t: t_visit, exit_t: out.t.to_f64(), exit: std::array::from_fn(|i| out.x[i].to_f64()), rows }))
}

/// The first crossing from (t, x) on that `wanted` accepts.
fn exit<F: VectorField<3>>(
    field: &F,
    t: DoubleDouble,
    x: ExtendedPoint,
    plane: Plane,
    wanted: impl Fn(f64, &ExtendedCrossing) -> bool,
    t_end: f64,
) -> Result<Option<ExtendedCrossing>, Failure> {
    let mut stepper = Taylor::extended(REFERENCE_TOLERANCE);
    stepper.restart_from(field, t, x, t_end, f64::INFINITY)?;
    let mut found = None;
    while found.is_none() && stepper.state().0.to_f64() < t_end {
        next_crossings(&mut stepper, field, plane, |c| {
            if found.is_none() && wanted(c.t.to_f64(), &c) {
                found = Some(c);
            }
        })?;
    }
    Ok(found)
}
