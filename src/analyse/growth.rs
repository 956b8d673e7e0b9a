//! What a visit to a two-fold makes of a small disturbance.
//!
//! A two-fold singularity has no determined exit (Jeffrey 2013, secs 2 and 4). The smoothed system is an ordinary
//! differential equation and has one, but near the singularity it amplifies whatever disturbs it. [`growth()`] measures how much
//! larger a small disturbance is after the first visit, as a function of when and in which direction it was made, with orbits
//! in double-double arithmetic.
//!
//! Measured with this module, first visit, two-fold with cubic reinjection (alpha = 1e-1, beta = 1e-5), growth of a disturbance between 0.1 before
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
//! little more: the *place* of the exit crossing hardly depends on the start (its time does). With
//! alpha = 1e-3 the growth in x at the passage is larger still: 1e14, 2e16, 2e20.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::reference::{ExtendedCrossing, ExtendedPoint, Plane, REFERENCE_TOLERANCE, first_crossing, reference};
use crate::integrate::{Failure, Statistics, Stepper, Taylor};
use crate::num::elementary::log10;
use crate::num::{Arithmetic, DoubleDouble, Scalar};
use crate::system::VectorField;

/// Which disturbances of which orbit: all that [`growth()`] depends on besides the equation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct GrowthQuestion {
    /// The start, at t = 0.
    pub start: [f64; 3],
    /// Visit and exit are crossings of this plane.
    pub section: Plane,
    /// The first crossing whose state has no component larger than this is the visit, the next that has one is the exit.
    pub near: f64,
    /// When disturbances are made, relative to the visit; increasing.
    pub offsets: Vec<f64>,
    /// Size of disturbances made at t = 0. They are contracted before they grow, so that it need not be tiny.
    pub at_start: f64,
    /// The exit must come before this time.
    pub exit_by: f64,
}

/// The answer to a [`GrowthQuestion`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Growth {
    /// The visit, with the growth of disturbances made near it; absent if there is none, or no exit, in the given time.
    pub visit: Option<Visit>,
    /// Growth until the exit of disturbances made at t = 0 in the first, second, third component; absent where the
    /// disturbed orbit has no such crossing. None at all without a visit, or if the exit is none of the orbit's crossings.
    pub from_start: Option<[Option<f64>; 3]>,
    /// Work of all orbits together.
    pub statistics: Statistics,
}

/// More crossings than an orbit of the lengths in question makes.
const MOST_CROSSINGS: usize = 1000;
/// Orbits are followed so long past the exit that a disturbed one has crossed as well.
const PAST_EXIT: f64 = 0.1;

/// Measures how the first visit to the singularity at the origin amplifies disturbances.
///
/// # Errors
/// [`Failure`] of an orbit.
pub fn growth<F: VectorField<3>>(field: &F, question: &GrowthQuestion) -> Result<Growth, Failure> {
    let GrowthQuestion { start, section, near, ref offsets, at_start, exit_by } = *question;
    let mut answer = Growth { visit: None, from_start: None, statistics: Statistics::default() };
    let x0 = SVector::from(start);
    let Some(visit) = amplification(field, x0, section, near, offsets, exit_by, &mut answer.statistics)? else {
        return Ok(answer);
    };
    // From the start: the same crossing of the undisturbed and of the disturbed orbits.
    let start = x0.map(DoubleDouble::from_f64);
    let mut orbit = |x0: ExtendedPoint| -> Result<Vec<ExtendedCrossing>, Failure> {
        let found = reference(field, x0, section, MOST_CROSSINGS, visit.exit_t + PAST_EXIT, false)?;
        answer.statistics += &found.statistics;
        Ok(found.crossings)
    };
    let undisturbed = orbit(start)?;
    if let Some(exit) = undisturbed.iter().position(|c| c.t.to_f64() >= visit.exit_t) {
        let mut factors = [None; 3];
        for (component, factor) in factors.iter_mut().enumerate() {
            let mut x0 = start;
            x0[component] += DoubleDouble::from_f64(at_start);
            if let Some(moved) = orbit(x0)?.get(exit) {
                *factor = Some((moved.x - undisturbed[exit].x).map(|c| c.to_f64()).amax() / at_start);
            }
        }
        answer.from_start = Some(factors);
    }
    answer.visit = Some(visit);
    Ok(answer)
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
/// small enough to be linear. `Ok(None)`: no visit, or no exit, before `t_end`. The work is added to `work`.
fn amplification<F: VectorField<3>>(
    field: &F,
    x0: SVector<f64, 3>,
    plane: Plane,
    near: f64,
    offsets: &[f64],
    t_end: f64,
    work: &mut Statistics,
) -> Result<Option<Visit>, Failure> {
    let start = x0.map(DoubleDouble::from_f64);
    let at_start = (DoubleDouble::zero(), start);
    let Some(visit) = first_crossing(field, at_start, plane, |c| c.extent() < near, t_end, work)? else {
        return Ok(None);
    };
    let t_visit = visit.t.to_f64();
    let leaves = |after: f64| move |c: &ExtendedCrossing| c.t.to_f64() > after && c.extent() >= near;
    let (mut t, mut x) = (DoubleDouble::zero(), start);
    let Some(out) = first_crossing(field, (t, x), plane, leaves(t_visit), t_end, work)? else { return Ok(None) };
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
        let Some(undisturbed) = first_crossing(field, (t, x), plane, wanted, t_end, work)? else { continue };
        let mut factors = [0.0; 3];
        for component in 0..3 {
            let size = &mut sizes[component];
            factors[component] = loop {
                let mut disturbed = x;
                disturbed[component] += DoubleDouble::from_f64(*size);
                // A disturbed orbit that never leaves has been moved by more than is linear.
                let response = first_crossing(field, (t, disturbed), plane, wanted, t_end, work)?
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
    *work += stepper.statistics();
    Ok(Some(Visit { t: t_visit, exit_t: out.t.to_f64(), exit: std::array::from_fn(|i| out.x[i].to_f64()), rows }))
}
