//! Filippov motion where two switching surfaces meet.
//!
//! At a point of both surfaces there are four fields, one for each pair of signs. What is decided
//! there (Filippov 1988, ch. 2; Dieci & Lopez 2009, 2011) follows from their Lie derivatives:
//!
//! - a field that points into its own quadrant leaves there;
//! - sliding on one surface leaves where it moves away from the other;
//! - the motion stays on the intersection where zero lies inside the convex hull of the pairs of
//!   Lie derivatives. Its velocity is a mixture of the fields that is tangent to both surfaces.
//!   Four fields leave one such mixture undetermined; the velocity is unique where all of them give
//!   the same, as with switches that add;
//! - fields that turn around the intersection come to it or leave it in a spiral; a return map,
//!   linear to leading order, says which.
//!
//! A derivative that vanishes is replaced by its own derivative along the motion. The motion is
//! decided where exactly one of these is possible; nothing is chosen anywhere else.

use nalgebra::SVector;

use super::{Faces, FilippovOptions, Side};
use crate::step::Interpolant;
use twofold_num::elementary::sqrt;
use twofold_num::{Dual, Elementary};
use twofold_system::filippov::gradient;
use twofold_system::{PiecewiseSmooth, VectorField, variables};

/// Relative size below which a rate is rounding: some thousand roundings.
const ROUNDING: f64 = 1e-13;
/// Relative difference of velocities below which they are the same.
const SAME_VELOCITY: f64 = 1e-11;
/// A turn that changes the distance by less than this share neither contracts nor expands to
/// leading order.
const NEUTRAL: f64 = 1e-9;

/// The sign of a function number `surface` in the field number `mode`: bit i of the number is set
/// where function i is negative.
pub(super) fn side(mode: usize, surface: usize) -> Side {
    if mode >> surface & 1 == 0 { Side::Plus } else { Side::Minus }
}

fn field<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    faces: &Faces<P>,
    mode: usize,
    x: &SVector<S, N>,
) -> SVector<S, N> {
    let face = &faces[0][mode >> 1];
    if mode & 1 == 0 { face.plus(x) } else { face.minus(x) }
}

fn dot<S: Elementary, const N: usize>(a: &SVector<S, N>, b: &SVector<S, N>) -> S {
    (0..N).fold(S::zero(), |sum, i| sum + a[i] * b[i])
}

type Fields<S, const N: usize> = ([SVector<S, N>; 4], [[S; 2]; 4]);

/// The four fields at `x` and the rates of both functions along each.
fn fields<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    faces: &Faces<P>,
    x: &SVector<S, N>,
) -> Fields<S, N> {
    let slopes: [SVector<S, N>; 2] = std::array::from_fn(|i| gradient(&faces[i][0], x));
    let fields: [SVector<S, N>; 4] = std::array::from_fn(|m| field(faces, m, x));
    let rates = std::array::from_fn(|m| std::array::from_fn(|i| dot(&slopes[i], &fields[m])));
    (fields, rates)
}

fn cross<S: Elementary>(a: &[S; 2], b: &[S; 2]) -> S {
    a[0] * b[1] - a[1] * b[0]
}

/// A possible continuation at a point of the intersection.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Continuation<const N: usize> {
    /// Flight with the field of this number.
    Flight(usize),
    /// Sliding on `surface`, on the side `beyond` of the other.
    Sliding { surface: usize, beyond: Side, repelling: bool },
    /// Motion along the intersection.
    Stay(Box<Mixture<N>>),
    /// A spiral away from it, of which the distance grows by this factor with each turn.
    Spiral(f64),
    /// Motion along the intersection with one of several velocities.
    Several(Box<Mixture<N>>),
    /// A rate that vanishes together with its derivative does not tell.
    Unclear(usize),
}

impl<const N: usize> std::fmt::Display for Continuation<N> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let sign = |side: Side| if side == Side::Plus { ">" } else { "<" };
        let name = |surface: usize| if surface == 0 { "h" } else { "the second h" };
        match self {
            Continuation::Flight(m) => {
                write!(
                    f,
                    "flight with the field of h {} 0, the second h {} 0",
                    sign(side(*m, 0)),
                    sign(side(*m, 1))
                )
            }
            Continuation::Sliding { surface, beyond, repelling } => {
                let kind = if *repelling { "repelling" } else { "attracting" };
                write!(
                    f,
                    "{kind} sliding on {} = 0 to where {} {} 0",
                    name(*surface),
                    name(1 - surface),
                    sign(*beyond)
                )
            }
            Continuation::Stay(_) => write!(f, "motion along the intersection"),
            Continuation::Several(_) => {
                write!(
                    f,
                    "motion along the intersection, where mixtures of the four fields have \
                        different velocities"
                )
            }
            Continuation::Spiral(ratio) if *ratio > 1.0 + NEUTRAL => {
                write!(
                    f,
                    "a spiral away from the intersection, {ratio:.4} times as far with each turn"
                )
            }
            Continuation::Spiral(_) => {
                write!(
                    f,
                    "turns around the intersection that to leading order neither contract nor \
                        expand"
                )
            }
            Continuation::Unclear(m) => write!(
                f,
                "flight with the field of h {} 0, the second h {} 0, or sliding along its edge: a \
                    Lie derivative and the one after it vanish",
                sign(side(*m, 0)),
                sign(side(*m, 1))
            ),
        }
    }
}

/// A mixture of up to three of the fields that is tangent to both surfaces.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Mixture<const N: usize> {
    modes: [usize; 3],
    /// Set where all pairs of rates lie on a line: two fields suffice, and this direction measures
    /// their rates.
    line: Option<[f64; 2]>,
    pub velocity: SVector<f64, N>,
}

impl<const N: usize> Mixture<N> {
    fn velocity<P: PiecewiseSmooth<N>, S: Elementary>(
        &self,
        faces: &Faces<P>,
        x: &SVector<S, N>,
    ) -> SVector<S, N> {
        let (fields, rates) = fields(faces, x);
        let [a, b, c] = self.modes;
        if let Some(line) = self.line {
            let rate = |m: usize| rates[m][0].scale(line[0]) + rates[m][1].scale(line[1]);
            let weight = rate(b) / (rate(b) - rate(a));
            return SVector::from_fn(|i, _| fields[b][i] + (fields[a][i] - fields[b][i]) * weight);
        }
        let weights =
            [cross(&rates[b], &rates[c]), cross(&rates[c], &rates[a]), cross(&rates[a], &rates[b])];
        let sum = weights[0] + weights[1] + weights[2];
        SVector::from_fn(|i, _| {
            (fields[a][i] * weights[0] + fields[b][i] * weights[1] + fields[c][i] * weights[2])
                / sum
        })
    }
}

/// The motion along the intersection.
pub(super) struct AlongIntersection<'a, P, const N: usize> {
    pub faces: &'a Faces<P>,
    pub mixture: &'a Mixture<N>,
}

impl<P: PiecewiseSmooth<N>, const N: usize> VectorField<N> for AlongIntersection<'_, P, N> {
    const INTERPRETED: bool = P::INTERPRETED;
    fn eval<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.mixture.velocity(self.faces, x)
    }
}

/// The first part, up to `end`, of a step, projected onto the intersection.
pub(super) struct OnIntersection<'a, P, const N: usize> {
    pub faces: &'a Faces<P>,
    pub inner: &'a dyn Interpolant<N>,
    pub end: f64,
}

impl<P: PiecewiseSmooth<N>, const N: usize> Interpolant<N> for OnIntersection<'_, P, N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        let x = self.inner.at(theta * self.end);
        project(self.faces, &x).unwrap_or(x)
    }
    fn degree(&self) -> usize {
        2 * self.inner.degree()
    }
}

/// The shortest u with grad h_i . u = `right`[i]; `None` if the surfaces touch instead of crossing.
fn shortest<const N: usize>(
    slopes: &[SVector<f64, N>; 2],
    right: [f64; 2],
) -> Option<SVector<f64, N>> {
    let lengths = slopes.map(|s| s.norm());
    let [a, b] = [slopes[0] / lengths[0], slopes[1] / lengths[1]];
    let [r, s] = [right[0] / lengths[0], right[1] / lengths[1]];
    let c = a.dot(&b);
    let determinant = 1.0 - c * c;
    if determinant.is_nan() || determinant < 1e-12 {
        return None;
    }
    Some(a * ((r - c * s) / determinant) + b * ((s - c * r) / determinant))
}

/// The point of the intersection nearest to `x`, by Newton's method; `None` if it finds none.
pub(super) fn project<P: PiecewiseSmooth<N>, const N: usize>(
    faces: &Faces<P>,
    x: &SVector<f64, N>,
) -> Option<SVector<f64, N>> {
    let mut y = *x;
    let mut last = f64::INFINITY;
    for _ in 0..16 {
        let heights = [faces[0][0].switching(&y), faces[1][0].switching(&y)];
        if heights == [0.0; 2] {
            return Some(y);
        }
        let slopes = [gradient(&faces[0][0], &y), gradient(&faces[1][0], &y)];
        let step = shortest(&slopes, heights)?;
        let size = step.norm();
        if size.is_nan() || size >= last {
            break;
        }
        (y, last) = (y - step, size);
    }
    (last <= 64.0 * f64::EPSILON * y.amax()).then_some(y)
}

/// Distance from the intersection within which a state counts as on it, by coordinates: ten
/// tolerances.
pub(super) fn resolution<const N: usize>(
    settings: &FilippovOptions,
    x: &SVector<f64, N>,
) -> SVector<f64, N> {
    x.map(|v| 10.0 * (settings.tolerance.atol + settings.tolerance.rtol * v.abs()))
}

/// The sign of a function that changes at `slope` along the motion; 0 if both vanish.
fn sign_after(value: f64, zero: f64, slope: f64, slope_zero: f64) -> f64 {
    if value.abs() > zero {
        value.signum()
    } else if slope.abs() > slope_zero {
        slope.signum()
    } else {
        0.0
    }
}

/// The four fields at a point of the intersection with their rates and the rates' gradients.
struct Corner<const N: usize> {
    fields: [SVector<f64, N>; 4],
    rates: [[Dual<f64, N>; 2]; 4],
    slopes: [SVector<f64, N>; 2],
    /// Rates below these are rounding.
    zero: [f64; 2],
}

impl<const N: usize> Corner<N> {
    fn at<P: PiecewiseSmooth<N>>(faces: &Faces<P>, x: &SVector<f64, N>) -> Self {
        let (_, rates) = fields::<P, Dual<f64, N>, N>(faces, &variables(x));
        let fields: [SVector<f64, N>; 4] = std::array::from_fn(|m| field(faces, m, x));
        let slopes: [SVector<f64, N>; 2] = std::array::from_fn(|i| gradient(&faces[i][0], x));
        let speed = fields.iter().fold(0.0_f64, |m, f| m.max(f.norm()));
        let zero = std::array::from_fn(|i| ROUNDING * slopes[i].norm() * speed);
        Self { fields, rates, slopes, zero }
    }

    fn along(d: &Dual<f64, N>, u: &SVector<f64, N>) -> (f64, f64) {
        let slope = SVector::<f64, N>::from(d.partials);
        (slope.dot(u), ROUNDING * slope.norm() * u.norm())
    }

    /// The sign of the rate of function `i` in field `m` after a little motion along `u`.
    fn sign(&self, m: usize, i: usize, u: &SVector<f64, N>) -> f64 {
        let (slope, slope_zero) = Self::along(&self.rates[m][i], u);
        sign_after(self.rates[m][i].value, self.zero[i], slope, slope_zero)
    }

    /// The direction in which surface `i` is kept and function 1 - `i` grows to the side `beyond`.
    fn outward(&self, i: usize, beyond: Side) -> Option<SVector<f64, N>> {
        let mut right = [0.0; 2];
        right[1 - i] = beyond.sign();
        shortest(&self.slopes, right)
    }

    /// The fields on both sides of surface `i`, on the side `beyond` of the other.
    fn pair(i: usize, beyond: Side) -> [usize; 2] {
        let other = usize::from(beyond == Side::Minus) << (1 - i);
        [other, other | 1 << i]
    }

    /// Sliding on surface `i` that leaves to the side `beyond` of the other, if there is any;
    /// whether it repels.
    fn sliding(&self, i: usize, beyond: Side) -> Option<Result<bool, usize>> {
        let [a, b] = Self::pair(i, beyond);
        let outward = self.outward(i, beyond)?;
        let (p, q) = (self.sign(a, i, &outward), self.sign(b, i, &outward));
        if p * q > 0.0 || (p == 0.0 && q == 0.0) {
            return None;
        }
        let (first, second) = (self.rates[a][i], self.rates[b][i]);
        let vanish = first.value.abs() <= self.zero[i] && second.value.abs() <= self.zero[i];
        let weight = if vanish {
            let [p, q] = [first, second].map(|d| Self::along(&d, &outward).0);
            Dual::constant(q / (q - p))
        } else {
            second / (second - first)
        };
        let velocity = self.fields[b] + (self.fields[a] - self.fields[b]) * weight.value;
        let j = 1 - i;
        let rate = self.rates[b][j] + (self.rates[a][j] - self.rates[b][j]) * weight;
        let (slope, slope_zero) = if vanish { (0.0, 0.0) } else { Self::along(&rate, &velocity) };
        // Noise of a vanishing rate's own gradient is that of its terms.
        let slope_zero = slope_zero.max(self.zero[j] * ROUNDING);
        let leaves = sign_after(rate.value, self.zero[j], slope, slope_zero) == beyond.sign();
        leaves.then_some(if p == 0.0 || q == 0.0 { Err(a) } else { Ok(p > 0.0) })
    }

    fn pairs(&self) -> [[f64; 2]; 4] {
        std::array::from_fn(|m| {
            std::array::from_fn(|i| {
                let rate = self.rates[m][i].value;
                // In units in which both functions have slope 1.
                if rate.abs() <= self.zero[i] { 0.0 } else { rate / self.slopes[i].norm() }
            })
        })
    }

    /// Motion along the intersection.
    fn stay<P: PiecewiseSmooth<N>>(
        &self,
        faces: &Faces<P>,
        x: &SVector<f64, N>,
    ) -> Option<Continuation<N>> {
        let w = self.pairs();
        let size = w.iter().flatten().fold(0.0_f64, |m, v| m.max(v.abs()));
        let speed = self.fields.iter().fold(0.0_f64, |m, f| m.max(f.norm()));
        if size == 0.0 {
            return None;
        }
        let flat =
            (0..4).all(|a| (0..a).all(|b| cross(&w[a], &w[b]).abs() <= ROUNDING * size * size));
        if flat {
            let longest = (0..4).max_by(|&a, &b| length(&w[a]).total_cmp(&length(&w[b])))?;
            let line = w[longest].map(|v| v / length(&w[longest]));
            let r: [f64; 4] = std::array::from_fn(|m| w[m][0] * line[0] + w[m][1] * line[1]);
            let (mut low, mut high) = (0, 0);
            for m in 1..4 {
                if r[m] < r[low] {
                    low = m;
                }
                if r[m] > r[high] {
                    high = m;
                }
            }
            if r[low] >= 0.0 || r[high] <= 0.0 {
                return None;
            }
            let line = [line[0] / self.slopes[0].norm(), line[1] / self.slopes[1].norm()];
            let mut mixture =
                Mixture { modes: [low, high, high], line: Some(line), velocity: SVector::zeros() };
            mixture.velocity = mixture.velocity(faces, x);
            let v = mixture.velocity;
            let same = |a: usize, b: usize| {
                let apart = self.fields[b] * r[a] - self.fields[a] * r[b] - v * (r[a] - r[b]);
                apart.norm() <= SAME_VELOCITY * size * speed
            };
            let unique = (0..4).all(|a| (0..a).all(|b| same(a, b)));
            let mixture = Box::new(mixture);
            return Some(if unique {
                Continuation::Stay(mixture)
            } else {
                Continuation::Several(mixture)
            });
        }
        let triples = [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]];
        let weights =
            |[a, b, c]: [usize; 3]| [cross(&w[b], &w[c]), cross(&w[c], &w[a]), cross(&w[a], &w[b])];
        let determinant = |t: [usize; 3]| weights(t).iter().sum::<f64>();
        let best = triples
            .into_iter()
            .max_by(|a, b| determinant(*a).abs().total_cmp(&determinant(*b).abs()))?;
        if determinant(best).abs() <= ROUNDING * size * size {
            return None;
        }
        let mut mixture = Mixture { modes: best, line: None, velocity: SVector::zeros() };
        mixture.velocity = mixture.velocity(faces, x);
        let v = mixture.velocity;
        // Zero is inside the hull if every line through it and one of the pairs has others on both
        // sides.
        let side_of = |a: usize, b: usize| {
            let c = self.rates[a][0] * self.rates[b][1] - self.rates[a][1] * self.rates[b][0];
            let (slope, slope_zero) = Self::along(&c, &v);
            let zero = ROUNDING * size * size * self.slopes[0].norm() * self.slopes[1].norm();
            sign_after(c.value, zero, slope, slope_zero.max(ROUNDING * zero))
        };
        let inside = (0..4).all(|a| {
            let sides = || (0..4).filter(move |&b| b != a).map(|b| side_of(a, b));
            sides().any(|s| s > 0.0) && sides().any(|s| s < 0.0)
        });
        if !inside {
            return None;
        }
        let unique = triples.into_iter().all(|t| {
            let k = weights(t);
            let apart =
                self.fields[t[0]] * k[0] + self.fields[t[1]] * k[1] + self.fields[t[2]] * k[2];
            (apart - v * determinant(t)).norm() <= SAME_VELOCITY * size * size * speed
        });
        let mixture = Box::new(mixture);
        Some(if unique { Continuation::Stay(mixture) } else { Continuation::Several(mixture) })
    }

    /// The factor by which the distance grows with one turn around the intersection, if the fields
    /// turn around it.
    fn turn(&self) -> Option<f64> {
        let w = self.pairs();
        for order in [[0, 1, 3, 2], [0, 2, 3, 1]] {
            let ratio = (0..4).try_fold(1.0, |ratio, k| {
                let (m, next) = (order[k], order[(k + 1) % 4]);
                let left = usize::from(m ^ next == 2);
                let [s, r] = [left, 1 - left].map(|i| side(m, i).sign() * w[m][i]);
                (s < 0.0 && r > 0.0).then(|| ratio * (r / -s))
            });
            if ratio.is_some() {
                return ratio;
            }
        }
        // One function is the rate of the other, as position and speed: its own rate vanishes on
        // the intersection.
        (0..2).find_map(|k| {
            let j = 1 - k;
            if !(0..4).all(|m| w[m][k] == 0.0 && w[m][j] != 0.0) {
                return None;
            }
            let u = self.outward(k, Side::Plus)?;
            let gains: [f64; 4] = std::array::from_fn(|m| Self::along(&self.rates[m][k], &u).0);
            let up = gains[0].signum();
            let turns =
                (0..4).all(|m| gains[m] * up > 0.0 && w[m][j] * up * side(m, k).sign() < 0.0);
            turns.then(|| {
                let mode =
                    |s: f64, r: f64| (usize::from(s < 0.0) << k) | (usize::from(r < 0.0) << j);
                let half = |s: f64| {
                    let (out, back) = (mode(s, up * s), mode(s, -up * s));
                    (gains[out] / w[out][j]) * (w[back][j] / gains[back])
                };
                sqrt(half(1.0) * half(-1.0))
            })
        })
    }
}

fn length(w: &[f64; 2]) -> f64 {
    sqrt(w[0] * w[0] + w[1] * w[1])
}

/// All that may follow at the point `x` of the intersection.
pub(super) fn continuations<P: PiecewiseSmooth<N>, const N: usize>(
    faces: &Faces<P>,
    x: &SVector<f64, N>,
) -> Vec<Continuation<N>> {
    let corner = Corner::at(faces, x);
    let mut found = Vec::new();
    for m in 0..4 {
        let growth: [f64; 2] =
            std::array::from_fn(|i| corner.sign(m, i, &corner.fields[m]) * side(m, i).sign());
        if growth == [1.0; 2] {
            found.push(Continuation::Flight(m));
        } else if growth.iter().all(|g| *g >= 0.0) {
            found.push(Continuation::Unclear(m));
        }
    }
    for surface in 0..2 {
        for beyond in [Side::Plus, Side::Minus] {
            match corner.sliding(surface, beyond) {
                Some(Ok(repelling)) => {
                    found.push(Continuation::Sliding { surface, beyond, repelling })
                }
                Some(Err(mode)) => found.push(Continuation::Unclear(mode)),
                None => {}
            }
        }
    }
    if let Some(stay) = corner.stay(faces, x) {
        found.push(stay);
    }
    if let Some(ratio) = corner.turn().filter(|ratio| *ratio >= 1.0 - NEUTRAL) {
        found.push(Continuation::Spiral(ratio));
    }
    found
}

/// Whether the fields turn around the intersection at `x`.
pub(super) fn turns<P: PiecewiseSmooth<N>, const N: usize>(
    faces: &Faces<P>,
    x: &SVector<f64, N>,
) -> bool {
    Corner::at(faces, x).turn().is_some()
}

/// The functions whose signs decide what follows on the intersection: rates, and the orientation of
/// each two pairs of rates. Each in units of its largest terms.
pub(super) fn deciding<P: PiecewiseSmooth<N>, const N: usize>(
    faces: &Faces<P>,
    x: &SVector<f64, N>,
) -> [f64; 14] {
    let (fields, rates) = fields(faces, x);
    let speed = fields.iter().fold(f64::MIN_POSITIVE, |m, f| m.max(f.norm()));
    let slopes: [f64; 2] = std::array::from_fn(|i| gradient(&faces[i][0], x).norm());
    let w: [[f64; 2]; 4] =
        std::array::from_fn(|m| std::array::from_fn(|i| rates[m][i] / (slopes[i] * speed)));
    let pairs = [(0, 1), (0, 2), (0, 3), (1, 2), (1, 3), (2, 3)];
    std::array::from_fn(|k| {
        if k < 8 { w[k / 2][k % 2] } else { cross(&w[pairs[k - 8].0], &w[pairs[k - 8].1]) }
    })
}

/// Values of [`deciding`] below this are rounding.
pub(super) const UNDECIDING: f64 = ROUNDING;
