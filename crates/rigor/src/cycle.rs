//! Closed orbits, proved.
//!
//! A point of the plane that the return map takes to itself is a zero of F(x) = P(x) - x. If, for a
//! box X around a point c and an approximate inverse Y of DF, the set
//!
//! ```text
//! K = c - Y F(c) + (1 - Y DF(X)) (X - c)
//! ```
//!
//! lies in the interior of X, then X holds exactly one zero, and it lies in K (Krawczyk 1969; Moore
//! 1977; Neumaier 1990, sec. 5.1). The map's value and derivative are enclosures, so that the
//! inclusion is a proof of existence and local uniqueness. The orbit attracts if both eigenvalues
//! of DP at the point lie in the open unit disc, which is so if and only if
//! |trace| < 1 + det and det < 1 (Jury's conditions); DP(K) encloses DP there.

use nalgebra::SVector;

use super::Error;
use super::flow::{Flow, FlowOptions};
use super::section::AxisPlane;
use super::set::Set;
use twofold_num::{Arithmetic, Interval, Tape};

/// A proved closed orbit of a flow in three dimensions, with enclosures.
#[derive(Clone, Debug)]
pub struct Cycle {
    /// The box, in the plane's coordinates, in which exactly one closed orbit with this number of
    /// crossings was proved to cross.
    pub candidate: [Interval; 2],
    /// Its image by Krawczyk's operator: it lies inside the candidate, and the orbit crosses in it.
    pub image: [Interval; 2],
    /// The enclosure of the return map's value at the candidate's midpoint.
    pub value: [Interval; 2],
    /// The enclosure of the return map's derivative over the candidate.
    pub slope: [[Interval; 2]; 2],
    /// The approximate inverse used.
    pub preconditioner: [[f64; 2]; 2],
    /// The smallest box known to hold the point (by repeating the operator).
    pub point: [Interval; 2],
    /// The derivative over the smallest box.
    pub derivative: [[Interval; 2]; 2],
    /// The period.
    pub period: Interval,
    /// All crossings of a turn: time, the plane's coordinates, whether upward.
    pub crossings: Vec<(Interval, [Interval; 2], bool)>,
    /// Sum of the derivative's diagonal: of the two multipliers.
    pub trace: Interval,
    /// Its determinant: the product of the multipliers.
    pub determinant: Interval,
}

impl Cycle {
    /// Whether both multipliers are proved to lie in the open unit disc: the orbit attracts.
    pub fn attracts(&self) -> bool {
        let one = Interval::one();
        (one - self.determinant).is_positive()
            && (one + self.determinant - self.trace).is_positive()
            && (one + self.determinant + self.trace).is_positive()
    }

    /// Whether one multiplier is proved to lie outside the closed unit disc and the other inside
    /// the open one, the orbit being a saddle: their characteristic polynomial l^2 - trace l + det
    /// has different signs at 1 and at -1, so that exactly one of its zeros, both real, lies
    /// between.
    pub fn is_saddle(&self) -> bool {
        let one = Interval::one();
        let (above, below) =
            (one + self.determinant - self.trace, one + self.determinant + self.trace);
        above.is_positive() && below.is_negative() || above.is_negative() && below.is_positive()
    }
}

/// Newton's method gets to the arithmetic's end in this many steps from three digits.
const NEWTON_STEPS: usize = 6;

/// A turn from a box of the plane.
struct Turn {
    value: [Interval; 2],
    slope: [[Interval; 2]; 2],
    crossings: Vec<(Interval, [Interval; 2], bool)>,
}

/// Box in which [`prove_cycle`] searches for a closed orbit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Search {
    /// The plane; the orbit starts on it, upward.
    pub plane: AxisPlane,
    /// The other two coordinates, near the orbit.
    pub near: [f64; 2],
    /// Half the width of the box tried, in both.
    pub radius: f64,
    /// Crossings of the plane a turn, in both directions.
    pub crossings: usize,
    /// Upper bound on the duration of a turn.
    pub longest: f64,
}

fn others(axis: usize) -> [usize; 2] {
    [(0..3).find(|i| *i != axis).unwrap_or(0), (0..3).rfind(|i| *i != axis).unwrap_or(2)]
}

fn turn(flow: &mut Flow<Interval, 3>, search: &Search, from: [Interval; 2]) -> Result<Turn, Error> {
    let plane = search.plane;
    let [p, q] = others(plane.axis);
    let mut start = SVector::<Interval, 3>::from_element(Interval::from_f64(plane.value));
    (start[p], start[q]) = (from[0], from[1]);
    let mut set = Set::on_plane(start, plane.axis, plane.value, true);
    let mut crossings = Vec::new();
    for n in 0..search.crossings {
        let crossing = flow.next_crossing(&set, plane, search.longest)?;
        // It starts upward, so that directions alternate.
        if crossing.upward != (n % 2 == 1) {
            return Err(Error::WrongDirection(crossing.time.midpoint()));
        }
        set = crossing.set;
        let hull = set.hull();
        crossings.push((crossing.time, [hull[p], hull[q]], crossing.upward));
    }
    let hull = set.hull();
    let d = set.derivative().ok_or(Error::Singular)?;
    Ok(Turn {
        value: [hull[p], hull[q]],
        slope: [[d[(p, p)], d[(p, q)]], [d[(q, p)], d[(q, q)]]],
        crossings,
    })
}

/// The inverse of a 2 x 2 matrix, not rigorous.
fn inverse(m: [[f64; 2]; 2]) -> Option<[[f64; 2]; 2]> {
    let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    let inverse = [[m[1][1] / det, -m[0][1] / det], [-m[1][0] / det, m[0][0] / det]];
    inverse.iter().flatten().all(|x| x.is_finite()).then_some(inverse)
}

/// Krawczyk's operator for F = P - 1, from enclosures of P(c) and of DP over the box.
pub fn krawczyk(
    candidate: [Interval; 2],
    centre: [f64; 2],
    value: [Interval; 2],
    slope: [[Interval; 2]; 2],
    y: [[f64; 2]; 2],
) -> [Interval; 2] {
    let point = Interval::from_f64;
    let y = y.map(|row| row.map(point));
    let c = centre.map(point);
    let f = [value[0] - c[0], value[1] - c[1]];
    let delta = |i: usize, j: usize| point(f64::from(u8::from(i == j)));
    let df = |i: usize, j: usize| slope[i][j] - delta(i, j);
    std::array::from_fn(|i| {
        let newton = c[i] - (y[i][0] * f[0] + y[i][1] * f[1]);
        (0..2).fold(newton, |sum, j| {
            let contraction = delta(i, j) - (y[i][0] * df(0, j) + y[i][1] * df(1, j));
            sum + contraction * (candidate[j] - c[j])
        })
    })
}

/// Proves a closed orbit of x' = f(x), three-dimensional, as precisely as the arithmetic allows.
///
/// ```
/// use twofold_num::{Arithmetic, Elementary, Tape, tape::Recorded};
/// use twofold_rigor::cycle::{Search, prove_cycle};
/// use twofold_rigor::{AxisPlane, FlowOptions};
/// // r' = r (1 - r^2), one radian per unit time, z' = -z: the unit circle attracts.
/// let circle = Tape::record(3, |x| {
///     let inward = Recorded::one() - x[0].squared() - x[1].squared();
///     vec![x[0] * inward - x[1], x[1] * inward + x[0], -x[2]]
/// });
/// let search = Search {
///     plane: AxisPlane { axis: 1, value: 0.0 },
///     near: [1.0, 0.0],
///     radius: 1e-6,
///     crossings: 2,
///     longest: 10.0,
/// };
/// let cycle = prove_cycle(&circle, FlowOptions::PLAIN, &search)?;
/// assert!(cycle.attracts() && cycle.period.contains(2.0 * std::f64::consts::PI));
/// # Ok::<(), twofold_rigor::Error>(())
/// ```
///
/// # Errors
/// See [`Error`]; [`Error::NotIncluded`] if the inclusion does not hold.
pub fn prove_cycle(tape: &Tape, settings: FlowOptions, search: &Search) -> Result<Cycle, Error> {
    let mut flow = Flow::<Interval, 3>::new(tape, settings);
    let preconditioner = |slope: [[Interval; 2]; 2]| {
        let m = slope.map(|row| row.map(Interval::midpoint));
        inverse([[m[0][0] - 1.0, m[0][1]], [m[1][0], m[1][1] - 1.0]]).ok_or(Error::Singular)
    };
    // Newton's method on points first, not rigorous: a better place for the box.
    let mut near = search.near;
    for _ in 0..NEWTON_STEPS {
        let point = near.map(Interval::from_f64);
        let at = turn(&mut flow, search, point)?;
        let next = krawczyk(point, near, at.value, at.slope, preconditioner(at.slope)?)
            .map(Interval::midpoint);
        let moved = (0..2).fold(0.0, |m: f64, i| m.max((next[i] - near[i]).abs()));
        near = next;
        if moved < 1e-3 * search.radius {
            break;
        }
    }
    let step = |flow: &mut Flow<Interval, 3>, x: [Interval; 2]| -> Result<_, Error> {
        let centre = x.map(Interval::midpoint);
        let over = turn(flow, search, x)?;
        let at = turn(flow, search, centre.map(Interval::from_f64))?;
        let y = preconditioner(over.slope)?;
        let image = krawczyk(x, centre, at.value, over.slope, y);
        Ok((over, at, y, image))
    };
    let candidate = near.map(|c| Interval::between(c - search.radius, c + search.radius));
    let (over, at, preconditioner, image) = step(&mut flow, candidate)?;
    if !image[0].interior(candidate[0]) || !image[1].interior(candidate[1]) {
        return Err(Error::NotIncluded { candidate: candidate.to_vec(), image: image.to_vec() });
    }
    let (value, slope) = (at.value, over.slope);
    // The zero lies in the image; again from there, as long as it helps.
    let (mut point, mut over) = (image, over);
    for _ in 0..3 {
        let (next, _, _, image) = step(&mut flow, point)?;
        over = next;
        let smaller = [0, 1].map(|i| image[i].intersection(point[i]));
        let [Ok(a), Ok(b)] = smaller else { return Err(Error::Singular) };
        let done = a.width() > 0.5 * point[0].width() && b.width() > 0.5 * point[1].width();
        point = [a, b];
        if done {
            break;
        }
    }
    let d = over.slope;
    let period = over.crossings.last().map_or(Interval::ENTIRE, |c| c.0);
    Ok(Cycle {
        candidate,
        image,
        value,
        slope,
        preconditioner,
        point,
        derivative: d,
        period,
        crossings: over.crossings,
        trace: d[0][0] + d[1][1],
        determinant: d[0][0] * d[1][1] - d[0][1] * d[1][0],
    })
}
