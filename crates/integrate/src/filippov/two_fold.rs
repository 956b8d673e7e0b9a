//! The sliding flow at a two-fold: linearisation, the invariant curve through it, and the time of
//! passage.
//!
//! In the coordinates p = L+h, q = L-h the desingularised flow x' = F(x) is, to first order at the
//! two-fold,
//!
//! ```text
//! p' = -(L-L+h) p + (L+²h) q,      q' = -(L-²h) p + (L+L-h) q,      dt/ds = q - p,
//! ```
//!
//! with the second Lie derivatives taken at the two-fold. For the normal form (4), p = -y and q =
//! z, the eigenvalues mu solve mu² - (v + w) mu + vw - 1 = 0. An orbit that runs into the point
//! along an eigenvector with mu < 0 never arrives in s, but needs only the finite time int (q - p)
//! ds; for the linear flow this is -(-1, 1) A^-1 (p, q).
//!
//! Along one eigenvector there is an analytic invariant curve W(sigma) with F(W) = mu sigma W' (the
//! parameterisation method of Cabre, Fontich & de la Llave 2005), and physical time along it is the
//! series t(sigma) = sum g_k sigma^k/(k mu), where sum g_k sigma^k is q - p on W. sigma > 0 lies in
//! the attracting region and sigma < 0 in the repelling one, so t(sigma) runs from negative to
//! positive through the singularity: the curve is the analytic continuation of sliding through it.
//! All other sliding orbits of a node touch this curve at the two-fold to an order
//! mu_strong/mu_weak (7.8 for v = -1.2, w = -1.4): each one of them is another future in the
//! repelling region, all of them indistinguishable from W near the point. [`funnel`](super::funnel)
//! and the exit rules follow W.

use nalgebra::{SMatrix, SVector};

use super::flow::desingularised;
use crate::roots::brent;
use crate::step::Interpolant;
use twofold_num::elementary::{pow, sqrt};
use twofold_num::jet::Jet;
use twofold_num::linear::solve;
use twofold_system::PiecewiseSmooth;
use twofold_system::filippov::{fold_conditions, lie_derivatives, shortest, two_fold};
use twofold_system::variables;

/// Terms kept in the series of the invariant curve.
const TERMS: usize = 24;
/// Upper bound of [`SlidingAtTwoFold::radius`].
pub(super) const LARGEST_RADIUS: f64 = 1.0;

/// An eigendirection of the desingularised sliding flow at a two-fold.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Eigendirection<const N: usize> {
    /// The eigenvalue mu, in rescaled time.
    pub rate: f64,
    /// (L+h, L-h) along the direction; points into the attracting region (L+h < 0 < L-h) where that
    /// is possible.
    pub lie: [f64; 2],
    /// The unit vector in state space, tangent to the surface.
    pub vector: SVector<f64, N>,
}

impl<const N: usize> Eigendirection<N> {
    /// Whether the direction lies in the sliding regions.
    pub fn slides(&self) -> bool {
        self.lie[0] < 0.0 && self.lie[1] > 0.0
    }
}

/// The sliding flow near a two-fold.
///
/// ```
/// use nalgebra::Vector3;
/// use twofold_integrate::filippov::two_fold::SlidingAtTwoFold;
/// use twofold_system::System;
/// let normal_form = System::builtin("two-fold").expect("built in").bind::<3>()?;
/// let place = Vector3::new(0.0, 0.1, 0.1);
/// let there = SlidingAtTwoFold::near(&normal_form, &place).expect("a two-fold");
/// let [weak, strong] = there.directions.expect("a node of the sliding flow");
/// assert!(weak.rate.abs() < strong.rate.abs());
/// # Ok::<(), twofold_system::BindError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct SlidingAtTwoFold<const N: usize> {
    /// The two-fold.
    pub point: SVector<f64, N>,
    /// Second Lie derivatives there: L+²h, L-L+h, L+L-h, L-²h.
    pub second: [f64; 4],
    /// The eigendirections, weak one (smaller |mu|) first; `None` if the eigenvalues are complex.
    pub directions: Option<[Eigendirection<N>; 2]>,
    /// The invariant curve along a sliding eigendirection with mu < 0 (the weak one if there are
    /// two): motion along it goes from the attracting region through the two-fold into the
    /// repelling one.
    pub through: Option<InvariantCurve<N>>,
    /// The same with mu > 0: motion along it goes from the repelling region into the attracting
    /// one.
    pub back: Option<InvariantCurve<N>>,
    /// The distance over which the local description holds: the curve's radius but at most 1; 1e-3
    /// without a curve.
    pub radius: f64,
}

/// The analytic invariant curve through a two-fold, with time along it.
#[derive(Clone, Debug, PartialEq)]
pub struct InvariantCurve<const N: usize> {
    /// The eigenvalue mu.
    pub rate: f64,
    /// Index, 0 or 1, of the eigendirection that it follows.
    pub index: usize,
    /// |sigma| up to which the truncated series satisfies the invariance equation to 1e-12.
    pub radius: f64,
    coefficients: Vec<SVector<f64, N>>,
    time: Vec<f64>,
}

impl<const N: usize> InvariantCurve<N> {
    /// The point W(sigma).
    pub fn at(&self, sigma: f64) -> SVector<f64, N> {
        self.coefficients.iter().rev().fold(SVector::zeros(), |sum, c| sum * sigma + c)
    }

    /// Time of the point W(sigma), counted from the moment at the two-fold.
    pub fn time(&self, sigma: f64) -> f64 {
        self.time.iter().rev().fold(0.0, |sum, c| sum * sigma + c)
    }

    /// sigma at time `t` after the two-fold, |sigma| within `limit`; the end of that range if `t`
    /// is beyond it.
    pub fn sigma(&self, t: f64, limit: f64) -> f64 {
        if t == 0.0 {
            return 0.0;
        }
        let end = limit * t.signum() * self.rate.signum();
        let last = self.time(end) - t;
        if last * t <= 0.0 { end } else { brent(|s| self.time(s) - t, 0.0, end, -t, last) }
    }
}

/// The curve between two times, as an interpolant.
pub(super) struct AlongCurve<'a, const N: usize> {
    pub curve: &'a InvariantCurve<N>,
    pub from: f64,
    pub to: f64,
    pub limit: f64,
}

impl<const N: usize> Interpolant<N> for AlongCurve<'_, N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        self.curve.at(self.curve.sigma(self.from + theta * (self.to - self.from), self.limit))
    }
    fn degree(&self) -> usize {
        8
    }
}

impl<const N: usize> SlidingAtTwoFold<N> {
    /// The sliding flow at the two-fold near `guess`; `None` if there is none that Newton's method
    /// finds from there.
    pub fn near<P: PiecewiseSmooth<N>>(system: &P, guess: &SVector<f64, N>) -> Option<Self> {
        two_fold(system, guess).ok().and_then(|fold| Self::at(system, fold.point))
    }

    /// The sliding flow at the two-fold `point`.
    pub fn at<P: PiecewiseSmooth<N>>(system: &P, point: SVector<f64, N>) -> Option<Self> {
        Linearised::at(system, point).map(|linear| linear.with_curves(system))
    }

    /// The coefficients of `x` - two-fold along the two eigendirections, to first order.
    pub fn coordinates<P: PiecewiseSmooth<N>>(
        &self,
        system: &P,
        x: &SVector<f64, N>,
    ) -> Option<[f64; 2]> {
        let d = self.directions.as_ref()?;
        let (p, q) = lie_derivatives(system, x);
        let [[a, c], [b, e]] = [d[0].lie, d[1].lie];
        let det = a * e - b * c;
        Some([(p * e - b * q) / det, (a * q - p * c) / det])
    }

    /// Time of sliding from `x` to the two-fold, and an estimate of its error; `None` if sliding
    /// from `x`, in the attracting region or (`repelling`) in the repelling one, does not run into
    /// it. The leg is the invariant curve's series plus the linear flow across it: its error is of
    /// second order in the distance, estimated as time times distance over radius.
    pub fn time_to_arrive<P: PiecewiseSmooth<N>>(
        &self,
        system: &P,
        x: &SVector<f64, N>,
        repelling: bool,
    ) -> Option<(f64, f64)> {
        let d = self.directions.as_ref()?;
        let curve = if repelling { self.back.as_ref()? } else { self.through.as_ref()? };
        let c = self.coordinates(system, x)?;
        let (on, across) = (c[curve.index], c[1 - curve.index]);
        let other = &d[1 - curve.index];
        let contracts = other.rate * curve.rate > 0.0;
        if !contracts && across.abs() > 1e-3 * on.abs() {
            return None;
        }
        let direct =
            if contracts { across * (other.lie[1] - other.lie[0]) / -other.rate } else { 0.0 };
        let time = -curve.time(on) + direct;
        let distance = (x - self.point).norm();
        Some((time, time.abs() * distance / self.radius))
    }

    /// Largest |sigma| along the curve, forward in time from the two-fold, up to which the series
    /// may be used.
    pub(super) fn departure_limit<P: PiecewiseSmooth<N>>(
        &self,
        system: &P,
        curve: &InvariantCurve<N>,
    ) -> Option<f64> {
        let mut limit = curve.radius;
        for _ in 0..60 {
            let inside = (1..=16).all(|k| {
                let sigma = curve.rate.signum() * limit * k as f64 / 16.0;
                let (p, q) = lie_derivatives(system, &curve.at(sigma));
                p * sigma < 0.0 && q * sigma > 0.0
            });
            if inside {
                return Some(limit);
            }
            limit *= 0.5;
        }
        None
    }
}

/// The linearisation alone: what is known of [`SlidingAtTwoFold`] without its curves, whose series
/// take far longer.
#[derive(Clone, Debug)]
pub(super) struct Linearised<const N: usize> {
    pub point: SVector<f64, N>,
    second: [f64; 4],
    directions: Option<[Eigendirection<N>; 2]>,
}

impl<const N: usize> Linearised<N> {
    pub fn at<P: PiecewiseSmooth<N>>(system: &P, point: SVector<f64, N>) -> Option<Self> {
        let rows = fold_conditions(system, &point);
        let (plus, minus) = (system.plus(&point), system.minus(&point));
        let along =
            |i: usize, f: &SVector<f64, N>| (0..N).map(|j| rows[i].partials[j] * f[j]).sum::<f64>();
        let second = [along(1, &plus), along(1, &minus), along(2, &plus), along(2, &minus)];
        let [pp, pm, mp, mm] = second;
        let a = [[-pm, pp], [-mm, mp]];
        let (trace, determinant) = (a[0][0] + a[1][1], a[0][0] * a[1][1] - a[0][1] * a[1][0]);
        let discriminant = 0.25 * trace * trace - determinant;
        let mut directions = None;
        if discriminant > 0.0 {
            let root = sqrt(discriminant);
            let strong = 0.5 * trace + if trace < 0.0 { -root } else { root };
            let weak = determinant / strong;
            let direction = |rate: f64| -> Option<Eigendirection<N>> {
                let (first, other) = ([a[0][1], rate - a[0][0]], [rate - a[1][1], a[1][0]]);
                let size = |e: [f64; 2]| e[0] * e[0] + e[1] * e[1];
                let mut lie = if size(first) >= size(other) { first } else { other };
                if lie[0] > 0.0 || (lie[0] == 0.0 && lie[1] < 0.0) {
                    lie = [-lie[0], -lie[1]];
                }
                let vector = shortest(&rows, [0.0, lie[0], lie[1]])?;
                let norm = vector.norm();
                Some(Eigendirection {
                    rate,
                    lie: [lie[0] / norm, lie[1] / norm],
                    vector: vector / norm,
                })
            };
            directions = Some([direction(weak)?, direction(strong)?]);
        }
        Some(Self { point, second, directions })
    }

    pub fn with_curves<P: PiecewiseSmooth<N>>(&self, system: &P) -> SlidingAtTwoFold<N> {
        let Self { point, second, directions } = self.clone();
        let curve = |sign: f64| {
            let d = directions.as_ref()?;
            let index = (0..2).find(|&i| d[i].slides() && d[i].rate * sign > 0.0)?;
            Some(invariant_curve(system, &point, &d[index], d[1 - index].rate, index))
        };
        let (through, back) = (curve(-1.0), curve(1.0));
        let radius =
            [&through, &back].into_iter().flatten().map(|c| c.radius).fold(f64::INFINITY, f64::min);
        let radius = if radius.is_finite() { radius.min(LARGEST_RADIUS) } else { 1e-3 };
        SlidingAtTwoFold { point, second, directions, through, back, radius }
    }
}

/// Two folds in one place: both Lie derivatives vanish on the same part of the surface, not only at
/// a point. Always so with two states.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct FusedFolds<const N: usize> {
    /// L+²h and L-²h.
    pub second: [f64; 2],
    /// Sliding through the fold, if there is any: the limit of its velocity.
    pub velocity: Option<SVector<f64, N>>,
    /// Rate of change of L+h along it: positive from attracting to repelling sliding.
    pub rate: f64,
}

impl<const N: usize> FusedFolds<N> {
    /// The folds at `x`, where both Lie derivatives vanish; `None` if they vanish apart from each
    /// other elsewhere.
    pub fn at<P: PiecewiseSmooth<N>>(system: &P, x: &SVector<f64, N>) -> Option<Self> {
        let rows = fold_conditions(system, x);
        let [normal, of_plus, of_minus] =
            [0, 1, 2].map(|i| SVector::<f64, N>::from(rows[i].partials));
        let along = |g: SVector<f64, N>| g - normal * (g.dot(&normal) / normal.norm_squared());
        let (a, b) = (along(of_plus), along(of_minus));
        let (aa, ab, bb) = (a.norm_squared(), a.dot(&b), b.norm_squared());
        // If a gradient is normal to the surface, the fold is not on it.
        let across = aa > 1e-12 * of_plus.norm_squared() && bb > 1e-12 * of_minus.norm_squared();
        if !(across && aa * bb - ab * ab <= 1e-12 * aa * bb) {
            return None;
        }
        let (plus, minus) = (system.plus(x), system.minus(x));
        let second = [of_plus.dot(&plus), of_minus.dot(&minus)];
        // On the surface L-h = ratio L+h: of opposite signs, or there is no sliding.
        let ratio = ab / aa;
        let velocity = (ratio < 0.0).then(|| minus + (plus - minus) * (ratio / (ratio - 1.0)));
        let rate = velocity.map_or(0.0, |v| of_plus.dot(&v));
        let moves = rate.abs() > 1e-12 * of_plus.norm() * velocity.map_or(0.0, |v| v.norm());
        Some(Self { second, velocity: velocity.filter(|_| moves), rate })
    }

    /// Whether a motion leaves them: sliding, or a flight on a visible side.
    pub fn leave(&self) -> bool {
        self.velocity.is_some() || self.second[0] > 0.0 || self.second[1] < 0.0
    }
}

/// The series of the invariant curve along `direction`, order by order:
/// (DF - k mu) W_k = -[F(W_0 + ... + W_(k-1))]_k.
fn invariant_curve<P: PiecewiseSmooth<N>, const N: usize>(
    system: &P,
    point: &SVector<f64, N>,
    direction: &Eigendirection<N>,
    other_rate: f64,
    index: usize,
) -> InvariantCurve<N> {
    let mu = direction.rate;
    let (field, _) = desingularised(system, &variables(point));
    let jacobian = SMatrix::<f64, N, N>::from_fn(|i, j| field[i].partials[j]);
    let mut w = SVector::<Jet<TERMS>, N>::from_fn(|i, _| {
        let mut c = [0.0; TERMS];
        c[0] = point[i];
        c[1] = direction.vector[i];
        Jet { c }
    });
    let mut terms = TERMS;
    for k in 2..TERMS {
        // A resonance k mu = mu_other ends the series: beyond this order the curve is not analytic.
        let matrix = jacobian - SMatrix::<f64, N, N>::identity() * (k as f64 * mu);
        let (f, _) = desingularised(system, &w);
        let right = SVector::<f64, N>::from_fn(|i, _| -f[i].c[k]);
        let resonant = (k as f64 * mu - other_rate).abs() < 1e-9 * other_rate.abs();
        match solve(matrix, right, 0.0).filter(|x| !resonant && x.iter().all(|v| v.is_finite())) {
            Some(next) => (0..N).for_each(|i| w[i].c[k] = next[i]),
            None => {
                terms = k;
                break;
            }
        }
    }
    let coefficients: Vec<_> =
        (0..terms).map(|k| SVector::<f64, N>::from_fn(|i, _| w[i].c[k])).collect();
    let (_, rate) = desingularised(system, &w);
    let time = (0..terms).map(|k| if k == 0 { 0.0 } else { rate.c[k] / (k as f64 * mu) }).collect();
    let mut curve = InvariantCurve { rate: mu, index, radius: 0.0, coefficients, time };

    // The first guess at the radius comes from the last terms; the invariance equation itself then
    // decides.
    let mut radius = 1e3_f64;
    for k in terms.saturating_sub(4).max(2)..terms {
        let c = curve.coefficients[k].amax();
        if c > 0.0 {
            radius = radius.min(pow(1e-12 / c, 1.0 / (k - 1) as f64));
        }
    }
    let slope = |s: f64| {
        (1..terms)
            .rev()
            .fold(SVector::<f64, N>::zeros(), |sum, k| sum * s + curve.coefficients[k] * k as f64)
    };
    let holds = |s: f64| {
        let (f, _) = desingularised(system, &curve.at(s));
        let wanted = slope(s) * (mu * s);
        (f - wanted).amax() <= 1e-12 * wanted.amax().max(1e-3 * mu.abs())
    };
    // After a resonance only the tangent may be left, which holds to the square of the distance.
    while radius > 1e-12
        && !(holds(radius) && holds(-radius) && holds(0.5 * radius) && holds(-0.5 * radius))
    {
        radius *= 0.9;
    }
    curve.radius = radius;
    curve
}
