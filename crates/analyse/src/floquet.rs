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
mod tests {
    use super::*;
    use twofold_num::Elementary;

    /// r' = a r (1 - r^2), angle' = 1: period 2 pi, multiplier exp(-4 pi a).
    struct Hopf(f64);
    impl VectorField<2> for Hopf {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            let g = (S::one() - x[0] * x[0] - x[1] * x[1]).scale(self.0);
            SVector::from([g * x[0] - x[1], g * x[1] + x[0]])
        }
    }

    #[test]
    fn hopf_normal_form_is_exact() {
        let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
        for a in [0.05, 0.5, -0.03] {
            let o = closed_orbit::<2, 6, _>(
                &Hopf(a),
                plane,
                1,
                SVector::from([1.2, 0.0]),
                &FloquetOptions::default(),
            )
            .unwrap();
            assert!((o.period - std::f64::consts::TAU).abs() < 1e-9, "{o:?}");
            assert!((o.rate - 2.0 * a).abs() < 1e-8, "{o:?}");
            assert!((o.points[0][0] - 1.0).abs() < 1e-8 && (o.opposite[0][0] + 1.0).abs() < 1e-8);
        }
    }

    #[test]
    fn no_returns_are_refused() {
        let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
        let found = closed_orbit::<2, 6, _>(
            &Hopf(0.5),
            plane,
            0,
            SVector::from([1.2, 0.0]),
            &FloquetOptions::default(),
        );
        assert_eq!(found, Err(Error::NoReturns));
    }

    #[test]
    fn cubic_eigenvalues() {
        // Companion form of (l - 0.9)(l^2 - 0.2 l + 0.5), surrounded by the axis.
        let mut m = SMatrix::<f64, 4, 4>::zeros();
        let (c2, c1, c0) = (1.1, -0.68, 0.45);
        for (i, j, v) in [(0, 0, c2), (0, 2, c1), (0, 3, c0), (2, 0, 1.0), (3, 2, 1.0)] {
            m[(i, j)] = v;
        }
        let e = multipliers(&m, 1);
        assert!((e[0][0] - 0.9).abs() < 1e-12 && e[0][1] == 0.0, "{e:?}");
        assert!((e[1][0] - 0.1).abs() < 1e-12 && (e[1][1].abs() - 0.7).abs() < 1e-12, "{e:?}");
        assert!(e[2][0] == e[1][0] && e[2][1] == -e[1][1], "a pair: {e:?}");
    }

    /// s' = 1, y' = q'(s) with q(s) = s (s^2 - 1)(s^2 - 4): so y - q(s) stays what it is, and a
    /// return of a plane of y is a root of a polynomial.
    struct Quintic;
    impl VectorField<2> for Quintic {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            let s2 = x[0] * x[0];
            SVector::from([S::one(), (s2 * s2).scale(5.0) - s2.scale(15.0) + S::one().scale(4.0)])
        }
    }

    #[test]
    fn returns_of_a_polynomial_are_its_roots() {
        // The method is exact for it and its dense output is not: the crossing is landed on, and
        // what is left is mended.
        let settings = FloquetOptions {
            tolerance: Tolerance { rtol: 1e-5, atol: 1e-5 },
            ..FloquetOptions::default()
        };
        for value in [0.0, 0.7, -3.0] {
            let plane = ReturnPlane { axis: 1, value, upward: true };
            let of = |returns| {
                let start = SVector::from([-2.0, value]);
                return_map::<2, 6, _>(
                    &Tangent::<Quintic, 2>(&Quintic),
                    plane,
                    returns,
                    &start,
                    &settings,
                )
                .unwrap()
            };
            // Upwards at -2, 0, 2 with the slopes 24, 4, 24; the derivative is the slope at the
            // start over that at the end.
            for (returns, s, derivative) in [(1, 0.0, 6.0), (2, 2.0, 1.0)] {
                let r = of(returns);
                assert!((r.point[0] - s).abs() < 1e-9 && r.point[1] == value, "{r:?}");
                assert!((r.time - (s + 2.0)).abs() < 1e-9, "{r:?}");
                assert!(
                    (r.derivative[0] - derivative).abs() < 1e-6 && r.derivative[1..] == [0.0; 3],
                    "{r:?}"
                );
                assert_eq!((r.same.len(), r.opposite.len()), (returns, returns));
                assert!(
                    r.opposite.iter().zip([-1.0, 1.0]).all(|(x, s)| (x[0] - s).abs() < 1e-3),
                    "{r:?}"
                );
            }
        }
    }

    #[test]
    fn a_plane_beside_the_centre_sees_the_same_orbit() {
        let settings = FloquetOptions::default();
        let root = sqrt(0.75);
        for (upward, z) in [(true, -root), (false, root)] {
            let plane = ReturnPlane { axis: 0, value: 0.5, upward };
            for returns in [1, 2] {
                let guess = SVector::from([0.3, 1.1 * z]);
                let o =
                    closed_orbit::<2, 6, _>(&Hopf(0.05), plane, returns, guess, &settings).unwrap();
                let turns = [0.0, 1.0, 2.0][returns];
                assert!((o.period - turns * std::f64::consts::TAU).abs() < 1e-8, "{o:?}");
                assert!(
                    (ln(o.multipliers[0][0]) + turns * 0.2 * std::f64::consts::PI).abs() < 1e-7,
                    "{o:?}"
                );
                assert!((o.rate - 0.1).abs() < 1e-8, "{o:?}");
                assert_eq!(
                    (o.points.len(), o.opposite.len(), o.multipliers.len()),
                    (returns, returns, 1)
                );
                assert!(
                    o.points.iter().all(|p| (p[0] - 0.5).abs() < 1e-7 && (p[1] - z).abs() < 1e-7),
                    "{o:?}"
                );
                assert!(
                    o.opposite.iter().all(|p| (p[0] - 0.5).abs() < 1e-7 && (p[1] + z).abs() < 1e-7),
                    "{o:?}"
                );
            }
        }
    }

    #[test]
    fn what_does_not_return_or_converge_is_told() {
        let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
        let of = |settings| {
            closed_orbit::<2, 6, _>(&Hopf(0.05), plane, 1, SVector::from([1.2, 0.0]), &settings)
        };
        let short = of(FloquetOptions { longest_return: 6.0, ..FloquetOptions::default() });
        assert_eq!(short, Err(Error::NoReturn { from: vec![1.2, 0.0], within: 6.0 }));
        let few = of(FloquetOptions { most_steps: 10, ..FloquetOptions::default() });
        assert_eq!(few, Err(Error::TooLong { from: vec![1.2, 0.0], steps: 10 }));
        // After one iteration it still misses itself, by what Newton's method makes of a start 0.2
        // off.
        let Err(Error::NotConverged { residual, iterations: 1 }) =
            of(FloquetOptions { iterations: 1, ..FloquetOptions::default() })
        else {
            panic!("one iteration is not enough")
        };
        // r^2/(1 - r^2) grows by exp(4 pi a) a turn, which says where 1.2 goes.
        let ratio = 1.44 / 0.44 * twofold_num::elementary::exp(0.2 * std::f64::consts::PI);
        let there = sqrt(ratio / (ratio - 1.0));
        assert!((residual - (1.2 - there)).abs() < 1e-8, "{residual} {there}");
    }

    #[test]
    fn multipliers_come_by_falling_modulus() {
        let of = |rows: &[f64], n, axis| multipliers_of(rows, n, axis);
        let close = |got: &[[f64; 2]], want: &[[f64; 2]]| {
            let near = |(g, w): (&[f64; 2], &[f64; 2])| {
                (g[0] - w[0]).abs() < 1e-10 && (g[1].abs() - w[1]).abs() < 1e-10
            };
            assert!(got.len() == want.len() && got.iter().zip(want).all(near), "{got:?} {want:?}");
        };
        assert!(of(&[0.0], 1, 0).is_empty());
        close(&of(&[0.0, 0.0, 0.0, -0.7], 2, 0), &[[-0.7, 0.0]]);
        // l^2 - s l + p, as ((s, -p), (1, 0)) around an axis in the middle.
        let two = |s: f64, p: f64| of(&[s, 0.0, -p, 0.0, 9.0, 0.0, 1.0, 0.0, 0.0], 3, 1);
        close(&two(3.0, 2.0), &[[2.0, 0.0], [1.0, 0.0]]);
        close(&two(-3.0, 2.0), &[[-2.0, 0.0], [-1.0, 0.0]]);
        close(&two(-1.0, -6.0), &[[-3.0, 0.0], [2.0, 0.0]]);
        close(&two(2.0, 5.0), &[[1.0, 2.0], [1.0, 2.0]]);
        close(&two(0.0, 0.0), &[[0.0, 0.0], [0.0, 0.0]]);
        close(&two(2.0, 1.0), &[[1.0, 0.0], [1.0, 0.0]]);
        // The small one keeps its digits beside a large one.
        assert!((two(1e9 + 1e-9, 1.0)[1][0] * 1e9 - 1.0).abs() < 1e-12);
        // (l - 0.5)(l^2 - 0.2 l + 0.82): the pair has the larger modulus. Not a companion: similar
        // to one, with full rows.
        let three = |rows: [[f64; 3]; 3]| {
            let shear = [[1.0, 2.0, -1.0], [1.0, 3.0, 2.0], [0.0, 1.0, 4.0]];
            let back = [[10.0, -9.0, 7.0], [-4.0, 4.0, -3.0], [1.0, -1.0, 1.0]];
            let times = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| -> [[f64; 3]; 3] {
                std::array::from_fn(|i| {
                    std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum())
                })
            };
            let m = times(times(shear, rows), back);
            let full: Vec<f64> = (0..16)
                .map(|k| if k / 4 == 3 || k % 4 == 3 { 0.0 } else { m[k / 4][k % 4] })
                .collect();
            of(&full, 4, 3)
        };
        close(
            &three([[0.7, -0.92, 0.41], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
            &[[0.1, 0.9], [0.1, 0.9], [0.5, 0.0]],
        );
        // The tribonacci constant is larger than any coefficient of its polynomial.
        let pair = [-0.419_643_377_607_080_6, 0.606_290_729_207_199_4];
        let tribonacci = three([[1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        close(&tribonacci, &[[1.839_286_755_214_161, 0.0], pair, pair]);
        // Four of five states: (l - 0.5)(l + 0.3) and a pair, the first of which feeds the others.
        let pair_first = [
            [0.2, -0.82, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0],
            [5.0, 0.0, 0.2, 0.15],
            [0.0, 7.0, 1.0, 0.0],
        ];
        let pair_last = [
            [0.2, 0.15, 0.0, 0.0],
            [1.0, 0.0, 0.0, 0.0],
            [5.0, 0.0, 0.2, -0.82],
            [0.0, 7.0, 1.0, 0.0],
        ];
        for four in [pair_first, pair_last] {
            let entry = |k: usize| {
                if k / 5 == 0 || k.is_multiple_of(5) { 9.0 } else { four[k / 5 - 1][k % 5 - 1] }
            };
            let full: Vec<f64> = (0..25).map(entry).collect();
            close(&of(&full, 5, 0), &[[0.1, 0.9], [0.1, 0.9], [0.5, 0.0], [-0.3, 0.0]]);
        }
        close(
            &three([[0.2, 0.0, 0.0], [0.0, -0.9, 0.0], [0.0, 0.0, 0.5]]),
            &[[-0.9, 0.0], [0.5, 0.0], [0.2, 0.0]],
        );
    }

    #[test]
    fn a_pair_of_complex_multipliers_has_the_rate_of_its_modulus() {
        /// With d = r^2 - 1: (d, z)' = ((-0.02, -0.3), (0.3, -0.02)) (d, z), angle' = 1.
        struct Ring;
        impl VectorField<3> for Ring {
            fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
                let square = x[0] * x[0] + x[1] * x[1];
                let d = square - S::one();
                let g = (-d.scale(0.02) - x[2].scale(0.3)) / square.scale(2.0);
                SVector::from([g * x[0] - x[1], g * x[1] + x[0], d.scale(0.3) - x[2].scale(0.02)])
            }
        }
        let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
        let guess = SVector::from([1.1, 0.0, 0.05]);
        let o =
            closed_orbit::<3, 12, _>(&Ring, plane, 1, guess, &FloquetOptions::default()).unwrap();
        assert!((o.rate - 0.02).abs() < 1e-8 && o.multipliers[0][1] != 0.0, "{o:?}");
    }
}
