//! Closed orbits and their multipliers.
//!
//! A closed orbit is a fixed point of the return map of a plane, found by Newton's method with the
//! map's exact derivative from the variational equation; the eigenvalues of that derivative are the
//! orbit's Floquet multipliers without the trivial one (Guckenheimer & Holmes 1983, sec. 1.5;
//! Parker & Chua 1989, ch. 5). |multiplier| < 1 for all: the orbit attracts, at the rate
//! -ln|multiplier| / period.

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use super::tangent::Tangent;
use twofold_integrate::roots::{self, CrossingFinder};
use twofold_integrate::{Dopri5, Failure, Guarded, Stepper, Tolerance};
use twofold_num::elementary::{ln, sqrt};
use twofold_num::linear::{eigenvalues, solve};
use twofold_system::VectorField;

/// The plane `x[axis] = value`, crossed in one direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ReturnPlane {
    /// Index of the coordinate.
    pub axis: usize,
    /// Its value on the plane.
    pub value: f64,
    /// Whether the coordinate increases where the orbit is counted.
    pub upward: bool,
}

/// Options of [`closed_orbit`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FloquetOptions {
    /// Local error of the orbit and its tangent vectors.
    pub tolerance: Tolerance,
    /// Longest step.
    pub max_step: f64,
    /// Largest return error |P(u) - u| that counts as closed.
    pub closed: f64,
    /// Maximum number of Newton iterations.
    pub iterations: usize,
    /// Give up on a return after this time.
    pub longest_return: f64,
    /// And after so many steps: Newton's method may come to states from which one takes days.
    pub most_steps: u64,
}

impl Default for FloquetOptions {
    fn default() -> Self {
        Self {
            tolerance: Tolerance { rtol: 1e-11, atol: 1e-11 },
            max_step: f64::INFINITY,
            closed: 1e-9,
            iterations: 30,
            longest_return: 1e4,
            most_steps: 10_000_000,
        }
    }
}

/// A closed orbit with its stability.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ClosedOrbit {
    /// Crossings of the plane in the counted direction, in the order of the motion; full states.
    pub points: Vec<Vec<f64>>,
    /// Crossings of the plane in the other direction.
    pub opposite: Vec<Vec<f64>>,
    /// Its period.
    pub period: f64,
    /// Multipliers as (real, imaginary), by falling modulus.
    pub multipliers: Vec<[f64; 2]>,
    /// Rate at which nearby orbits approach it in the end, per unit time: -ln(largest
    /// modulus)/period. Negative: it repels.
    pub rate: f64,
    /// |P(u) - u| at the end.
    pub residual: f64,
    /// Newton iterations made.
    pub iterations: usize,
}

/// Why no closed orbit was found.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The integration failed.
    #[error(transparent)]
    Integration(#[from] Failure),
    /// The orbit does not come back.
    #[error(
        "the orbit from {from:?} did not return to the plane within t = {within}: start nearer to \
            the closed orbit"
    )]
    NoReturn {
        /// Start on the plane.
        from: Vec<f64>,
        /// Time given.
        within: f64,
    },
    /// The orbit takes too many steps.
    #[error(
        "the orbit from {from:?} took {steps} steps without coming back to the plane: start nearer \
            to the closed orbit"
    )]
    TooLong {
        /// Start on the plane.
        from: Vec<f64>,
        /// Steps given.
        steps: u64,
    },
    /// Newton's method did not converge.
    #[error(
        "no closed orbit found near the start: return error {residual:e} after {iterations} Newton \
            iterations; start nearer or check the number of returns"
    )]
    NotConverged {
        /// Return error reached.
        residual: f64,
        /// Iterations made.
        iterations: usize,
    },
    /// Zero returns were asked for.
    #[error("a closed orbit crosses its plane at least once per turn: ask for one return or more")]
    NoReturns,
    /// The derivative of the return map minus the identity is singular.
    #[error("the closed orbit is not isolated here (the return map has multiplier 1)")]
    NotIsolated,
}

/// Pivots below this share of the largest entry are rounding.
const SINGULAR: f64 = 1e-14;

/// The return after a number of crossings, with the map's derivative.
struct Return<const N: usize> {
    point: SVector<f64, N>,
    time: f64,
    /// dP/du as an N x N matrix whose row and column `axis` are zero.
    derivative: SMatrix<f64, N, N>,
    same: Vec<Vec<f64>>,
    opposite: Vec<Vec<f64>>,
    extent: f64,
    sizes: Vec<f64>,
    passes: bool,
}

/// A state that is never so large a share of the loop has a unit of its own.
const OWN_UNIT: f64 = 1e-3;
/// And a unit of its own is larger than this share of what has the same absolute as relative error.
const RESOLVED: f64 = 1e-2;

/// The box around a stretch of an orbit.
pub(super) struct Extent<const N: usize> {
    low: SVector<f64, N>,
    high: SVector<f64, N>,
}

impl<const N: usize> Extent<N> {
    pub(super) fn new(x: &SVector<f64, N>) -> Self {
        Self { low: *x, high: *x }
    }

    pub(super) fn add(&mut self, x: impl Fn(usize) -> f64) {
        for i in 0..N {
            (self.low[i], self.high[i]) = (self.low[i].min(x(i)), self.high[i].max(x(i)));
        }
    }

    /// The largest value of each state.
    pub(super) fn largest(&self) -> SVector<f64, N> {
        self.low.abs().sup(&self.high.abs())
    }

    /// The size of the loop as each state has it: its diagonal, but of a state whose values are
    /// far smaller in all of it, as in another unit, the largest of them. A state that has decayed
    /// is not resolved so far.
    pub(super) fn sizes(&self, tolerance: Tolerance) -> SVector<f64, N> {
        let (all, resolved) = (self.diagonal(), RESOLVED * tolerance.atol / tolerance.rtol);
        self.largest().map(|own| if own > resolved && own < OWN_UNIT * all { own } else { all })
    }

    pub(super) fn diagonal(&self) -> f64 {
        (self.high - self.low).norm()
    }
}

/// The closed orbit that crosses `plane` `returns` times per turn in its direction, by Newton's
/// method from `guess` (its component `plane.axis` is set to `plane.value`). `M` is `N` (`N` + 1):
/// `closed_orbit::<3, 12, _>(...)`.
///
/// ```
/// use nalgebra::{SVector, Vector2};
/// use twofold_analyse::floquet::{Error, FloquetOptions, ReturnPlane, closed_orbit};
/// use twofold_num::Elementary;
/// use twofold_system::VectorField;
///
/// /// r' = r (1 - r^2), one radian per unit time: the unit circle attracts.
/// struct Circle;
/// impl VectorField<2> for Circle {
///     fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
///         let inward = S::one() - x[0] * x[0] - x[1] * x[1];
///         Vector2::new(x[0] * inward - x[1], x[1] * inward + x[0])
///     }
/// }
///
/// let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
/// let options = FloquetOptions::default();
/// let orbit = closed_orbit::<2, 6, _>(&Circle, plane, 1, Vector2::new(1.2, 0.0), &options)?;
/// assert!((orbit.period - 2.0 * std::f64::consts::PI).abs() < 1e-8);
/// # Ok::<(), Error>(())
/// ```
///
/// # Errors
/// See [`enum@Error`].
pub fn closed_orbit<const N: usize, const M: usize, F>(
    field: &F,
    plane: ReturnPlane,
    returns: usize,
    guess: SVector<f64, N>,
    settings: &FloquetOptions,
) -> Result<ClosedOrbit, Error>
where
    F: VectorField<N>,
    for<'a> Tangent<'a, F, N>: VectorField<M>,
{
    const { assert!(M == N * (N + 1)) };
    if returns == 0 {
        return Err(Error::NoReturns);
    }
    let mut u = guess;
    u[plane.axis] = plane.value;
    let mut residual = f64::INFINITY;
    for iteration in 0..settings.iterations {
        let r = returned::<N, M, _>(&Tangent::<F, N>(field), plane, returns, u, settings)?;
        let difference = r.point - u;
        residual = difference.norm();
        if residual <= settings.closed {
            let multipliers = multipliers(&r.derivative, plane.axis);
            let largest = multipliers.first().map_or(0.0, |m| sqrt(m[0] * m[0] + m[1] * m[1]));
            // The start is the orbit's first crossing; the last return is the start again.
            let mut points = vec![Failure::state(&u)];
            points.extend(r.same.into_iter().take(returns - 1));
            return Ok(ClosedOrbit {
                points,
                opposite: r.opposite,
                period: r.time,
                multipliers,
                rate: -ln(largest) / r.time,
                residual,
                iterations: iteration,
            });
        }
        // (DP - 1) du = -(P(u) - u) in the plane; the row and column of the axis become the
        // identity's.
        let mut matrix = r.derivative - SMatrix::identity();
        matrix[(plane.axis, plane.axis)] = 1.0;
        let scale = matrix.amax();
        let step = solve(matrix, -difference, SINGULAR * scale).ok_or(Error::NotIsolated)?;
        u += step;
        u[plane.axis] = plane.value;
    }
    Err(Error::NotConverged { residual, iterations: settings.iterations })
}

/// Return of an orbit to its plane.
#[derive(Clone, Debug, PartialEq)]
pub struct Returned {
    /// The state there, in the order of the states.
    pub point: Vec<f64>,
    /// The time it took.
    pub time: f64,
    /// The derivative of the return map, row by row; the row and the column of the plane's
    /// coordinate are zero. Empty where none was asked for.
    pub derivative: Vec<f64>,
    /// Crossings in the plane's direction, the last of them `point` as the dense output has it.
    pub same: Vec<Vec<f64>>,
    /// Crossings in the other direction.
    pub opposite: Vec<Vec<f64>>,
    /// Diagonal of the box around the orbit up to there: the size of the loop.
    pub extent: f64,
    /// The size of the loop as each state has it: that, or less in a state of another unit.
    pub sizes: Vec<f64>,
    /// Whether the motion passes the plane in its direction at the start, too.
    pub passes: bool,
    /// The rounding error of the derivative, if it is one of differences.
    pub derivative_error: f64,
    /// Events on the way.
    pub events: usize,
}

/// The return from `u`, a point of `plane`, after `returns` crossings in its direction, with the
/// derivative of the return map: `tangent` is an equation with its variational equation for `N`
/// vectors, in `M` = `N` (`N` + 1) dimensions.
///
/// # Errors
/// If the orbit cannot be followed, or does not return.
pub fn return_map<const N: usize, const M: usize, T: VectorField<M>>(
    tangent: &T,
    plane: ReturnPlane,
    returns: usize,
    u: &SVector<f64, N>,
    settings: &FloquetOptions,
) -> Result<Returned, Error> {
    const { assert!(M == N * (N + 1)) };
    if returns == 0 {
        return Err(Error::NoReturns);
    }
    let Return { point, time, derivative, same, opposite, extent, sizes, passes } =
        returned::<N, M, T>(tangent, plane, returns, *u, settings)?;
    let derivative = (0..N * N).map(|k| derivative[(k / N, k % N)]).collect();
    let point = Failure::state(&point);
    Ok(Returned {
        point,
        time,
        derivative,
        same,
        opposite,
        extent,
        sizes,
        passes,
        derivative_error: 0.0,
        events: 0,
    })
}

fn returned<const N: usize, const M: usize, T: VectorField<M>>(
    tangent: &T,
    plane: ReturnPlane,
    returns: usize,
    u: SVector<f64, N>,
    settings: &FloquetOptions,
) -> Result<Return<N>, Error> {
    let guarded = || {
        let dopri5 = Dopri5::<M>::new(settings.tolerance);
        Guarded::new(dopri5, settings.tolerance).of_states(N)
    };
    let mut stepper = guarded();
    // x, then the columns of the identity.
    let mut state = SVector::<f64, M>::from_fn(|i, _| {
        if i < N { u[i] } else { f64::from(u8::from((i - N) / N == (i - N) % N)) }
    });
    let mut t = 0.0;
    let (mut same, mut opposite) = (Vec::new(), Vec::new());
    let mut passages = CrossingFinder::default();
    let mut extent = Extent::new(&u);
    let passes = (tangent.eval(&state)[plane.axis] > 0.0) == plane.upward;
    stepper.restart(tangent, t, state, settings.longest_return, settings.max_step)?;
    while t < settings.longest_return {
        if stepper.statistics().steps >= settings.most_steps {
            return Err(Error::TooLong { from: Failure::state(&u), steps: settings.most_steps });
        }
        let step = stepper.step(tangent)?;
        let (t0, state0) = (step.t0, step.x0);
        let found = passages.through_plane(&step, plane.axis, plane.value);
        let found: Vec<_> =
            found.iter().map(|p| (step.time(p.theta), step.at(p.theta), p.upward)).collect();
        (t, state) = (step.t1, step.x1);
        found.iter().for_each(|(_, x, _)| extent.add(|i| x[i]));
        if found.is_empty() {
            extent.add(|i| state[i]);
        }
        for (tc, at, upward) in found {
            let x: Vec<f64> = at.iter().take(N).copied().collect();
            if upward != plane.upward {
                opposite.push(x);
                continue;
            }
            same.push(x);
            if same.len() < returns {
                continue;
            }
            // Land there by a step of its own: the dense output is less accurate than the method.
            let mut landing = state0;
            if tc > t0 {
                let mut to = guarded();
                to.restart(tangent, t0, state0, tc, settings.max_step)?;
                let mut now = t0;
                while now < tc {
                    let s = to.step(tangent)?;
                    (now, landing) = (s.t1, s.x1);
                }
            }
            let f = tangent.eval(&landing);
            let dt = (plane.value - landing[plane.axis]) / f[plane.axis];
            // The remaining error is of the size of the dense output's: first order in it suffices.
            let landing = landing + f * dt;
            let f = tangent.eval(&landing);
            let point =
                SVector::<f64, N>::from_fn(
                    |i, _| if i == plane.axis { plane.value } else { landing[i] },
                );
            // Tangent vectors projected along the flow into the plane.
            let derivative = SMatrix::from_fn(|i, j| {
                if i == plane.axis || j == plane.axis {
                    return 0.0;
                }
                let column = |k: usize| landing[N * (j + 1) + k];
                column(i) - f[i] / f[plane.axis] * column(plane.axis)
            });
            let (extent, sizes) =
                (extent.diagonal(), Failure::state(&extent.sizes(settings.tolerance)));
            let time = tc + dt;
            return Ok(Return { point, time, derivative, same, opposite, extent, sizes, passes });
        }
    }
    let _ = state;
    Err(Error::NoReturn { from: Failure::state(&u), within: settings.longest_return })
}

/// Eigenvalues of the derivative of a return map without row and column `axis`, by falling modulus:
/// Floquet multipliers. In a section of at most three dimensions they are zeros of the
/// characteristic polynomial: the large ones, which decide stability, are accurate; a strongly
/// contracted one is lost below rounding of the largest. In more dimensions by [`eigenvalues`].
fn multipliers<const N: usize>(m: &SMatrix<f64, N, N>, axis: usize) -> Vec<[f64; 2]> {
    let rows: Vec<f64> = (0..N * N).map(|k| m[(k / N, k % N)]).collect();
    multipliers_of(&rows, N, axis)
}

/// The multipliers of a [`Returned::derivative`] of `n` states.
pub fn multipliers_of(derivative: &[f64], n: usize, axis: usize) -> Vec<[f64; 2]> {
    let kept: Vec<usize> = (0..n).filter(|i| *i != axis).collect();
    let a = |i: usize, j: usize| derivative[kept[i] * n + kept[j]];
    let mut found = match kept.len() {
        0 => Vec::new(),
        1 => vec![[a(0, 0), 0.0]],
        2 => quadratic(a(0, 0) + a(1, 1), a(0, 0) * a(1, 1) - a(0, 1) * a(1, 0)).to_vec(),
        3 => {
            let trace = a(0, 0) + a(1, 1) + a(2, 2);
            let minor = |i: usize, j: usize| a(i, i) * a(j, j) - a(i, j) * a(j, i);
            let minors = minor(0, 1) + minor(0, 2) + minor(1, 2);
            let det = a(0, 0) * minor(1, 2) - a(0, 1) * (a(1, 0) * a(2, 2) - a(1, 2) * a(2, 0))
                + a(0, 2) * (a(1, 0) * a(2, 1) - a(1, 1) * a(2, 0));
            // l^3 - trace l^2 + minors l - det has a real zero within Cauchy's bound.
            let p = |l: f64| ((l - trace) * l + minors) * l - det;
            let bound = 1.0 + trace.abs().max(minors.abs()).max(det.abs());
            let real = roots::brent(p, -bound, bound, p(-bound), p(bound));
            let mut all = quadratic(trace - real, minors - real * (trace - real)).to_vec();
            all.push([real, 0.0]);
            all
        }
        size => {
            let rows: Vec<f64> = (0..size * size).map(|k| a(k / size, k % size)).collect();
            // A matrix that is not finite has none; it is told apart by its own error before.
            eigenvalues(&rows, size).unwrap_or_default()
        }
    };
    found.sort_by(|x, y| (y[0] * y[0] + y[1] * y[1]).total_cmp(&(x[0] * x[0] + x[1] * x[1])));
    found
}

/// Zeros of l^2 - s l + p.
fn quadratic(s: f64, p: f64) -> [[f64; 2]; 2] {
    let d = 0.25 * s * s - p;
    if d < 0.0 {
        return [[0.5 * s, sqrt(-d)], [0.5 * s, -sqrt(-d)]];
    }
    // The larger first; the smaller from the product, free of cancellation.
    let large = 0.5 * s + sqrt(d).copysign(s);
    let small = if large == 0.0 { 0.0 } else { p / large };
    [[large, 0.0], [small, 0.0]]
}

#[cfg(test)]
mod tests;
