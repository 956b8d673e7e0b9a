//! Event location: zeros of a function of the state along one step, on its dense output.

use nalgebra::{SMatrix, SVector};

use super::step::Step;
use twofold_num::elementary::cos;
use twofold_num::{Dual, Elementary, Interval};

/// The zero of `f` in [a, b], f(a) and f(b) of opposite sign or one of them zero, to the last bits
/// of the bracket.
///
/// Brent (1973), ch. 4: inverse quadratic interpolation and secant steps, kept inside the bracket
/// by bisection.
///
/// ```
/// use twofold_integrate::roots::brent;
/// let root = brent(|x| x * x - 2.0, 0.0, 2.0, -2.0, 2.0);
/// assert!((root - std::f64::consts::SQRT_2).abs() < 1e-15);
/// ```
pub fn brent(mut f: impl FnMut(f64) -> f64, a: f64, b: f64, fa: f64, fb: f64) -> f64 {
    brent_of(&mut f, a, b, fa, fb)
}

/// For any function, so that it is compiled once for all of them; so are those below.
fn brent_of(f: &mut dyn FnMut(f64) -> f64, a: f64, b: f64, fa: f64, fb: f64) -> f64 {
    let (mut a, mut b, mut fa, mut fb) = (a, b, fa, fb);
    let (mut c, mut fc) = (a, fa);
    let mut d = b - a;
    let mut e = d;
    for _ in 0..200 {
        if (fb > 0.0) == (fc > 0.0) {
            (c, fc) = (a, fa);
            d = b - a;
            e = d;
        }
        if fc.abs() < fb.abs() {
            (a, b, c) = (b, c, b);
            (fa, fb, fc) = (fb, fc, fb);
        }
        let tol = 2.0 * f64::EPSILON * b.abs() + 0.5 * f64::EPSILON;
        let m = 0.5 * (c - b);
        if m.abs() <= tol || fb == 0.0 {
            return b;
        }
        if e.abs() < tol || fa.abs() <= fb.abs() {
            d = m;
            e = m;
        } else {
            let s = fb / fa;
            let (mut p, mut q) = if a == c {
                (2.0 * m * s, 1.0 - s)
            } else {
                let (q, r) = (fa / fc, fb / fc);
                (
                    s * (2.0 * m * q * (q - r) - (b - a) * (r - 1.0)),
                    (q - 1.0) * (r - 1.0) * (s - 1.0),
                )
            };
            if p > 0.0 {
                q = -q;
            } else {
                p = -p;
            }
            if 2.0 * p < (3.0 * m * q - (tol * q).abs()).min((e * q).abs()) {
                e = d;
                d = p / q;
            } else {
                d = m;
                e = m;
            }
        }
        (a, fa) = (b, fb);
        b += if d.abs() > tol { d } else { tol.copysign(m) };
        fb = f(b);
    }
    b
}

/// A crossing from one side of a surface to the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing {
    /// The fraction of the step at which the surface is met.
    pub theta: f64,
    /// Whether the orbit comes from the negative side.
    pub upward: bool,
}

/// Finds an orbit's crossings of a surface g = 0, step by step. The one rule of this program for
/// what a crossing and its sense are:
///
/// - A crossing is where g, having last been of one sign, is of the other. Its sense is that of the
///   signs.
/// - So a zero is no side: an orbit that starts on the surface has not passed it, and one that
///   touches it and turns back neither. A zero exactly at a step's end is decided by what follows,
///   and if it is a crossing it is reported once, at fraction 0 of the next step.
/// - Where an orbit comes to the surface and stays on it for a step, as in sliding, it crosses
///   there; where it leaves it for the side that it came from it crosses back, for the other side
///   it does not cross again.
/// - A jump between two steps (a kick) to the other side is no crossing; the new side counts from
///   there.
#[derive(Clone, Copy, Debug, Default)]
pub struct CrossingFinder {
    /// The sign last seen, or zero before any, and while the orbit stays on the surface.
    side: f64,
    /// The sign before it came to the surface and stayed; else zero.
    stayed: f64,
}

impl CrossingFinder {
    /// A finder for an orbit that starts on the positive side (`true`) or on the negative side.
    pub fn starting(positive: bool) -> Self {
        Self { side: if positive { 1.0 } else { -1.0 }, stayed: 0.0 }
    }

    /// The crossings in `step`, in order, of a surface whose `g` need not be of a low degree in the
    /// state, such as sin(x). Between two of the places where `g` is asked there is at most one
    /// zero of the polynomials that [`first_zero`] reasons about.
    pub fn in_curved_step<const N: usize>(
        &mut self,
        step: &Step<'_, N>,
        g: impl Fn(&SVector<f64, N>) -> f64,
    ) -> Vec<Crossing> {
        let value = |theta: f64| g(&step.at(theta));
        let mut places = Vec::new();
        separated(&value, 0.0, 1.0, 0, &mut places);
        let (mut found, mut last) = (Vec::new(), (0.0, value(0.0)));
        if last.1 != 0.0 {
            (self.side, self.stayed) = (last.1.signum(), 0.0);
        } else if places.iter().all(|theta| value(*theta) == 0.0) {
            return self.stay();
        }
        for theta in places {
            let point = (theta, value(theta));
            found.extend(self.come_to(point, last, &value));
            last = point;
        }
        found
    }

    /// The crossing between two neighbouring points, if there is one.
    fn come_to(
        &mut self,
        point: (f64, f64),
        last: (f64, f64),
        value: &dyn Fn(f64) -> f64,
    ) -> Option<Crossing> {
        if point.1 == 0.0 {
            return None;
        }
        let before = std::mem::replace(&mut self.side, point.1.signum());
        let stayed = std::mem::take(&mut self.stayed);
        let crosses = if before != 0.0 { before != self.side } else { stayed == self.side };
        crosses.then(|| Crossing {
            theta: if last.1 == 0.0 {
                last.0
            } else {
                brent(value, last.0, point.0, last.1, point.1)
            },
            upward: self.side > 0.0,
        })
    }

    /// The crossings in `step`, in order. Nothing is allocated unless there is one.
    ///
    /// `g` is sampled at two points more than the interpolant's degree; between samples that keep
    /// their sign, a smallest |g| in the middle is followed to its minimum, so that two zeros
    /// between neighbouring samples are found as well.
    pub fn in_step<const N: usize>(
        &mut self,
        step: &Step<'_, N>,
        g: impl Fn(&SVector<f64, N>) -> f64,
    ) -> Vec<Crossing> {
        self.of(step.interpolant.degree(), &|theta| g(&step.at(theta)))
    }

    /// The crossing at the beginning of a step that stays on the surface.
    fn stay(&mut self) -> Vec<Crossing> {
        if self.side == 0.0 {
            return Vec::new();
        }
        self.stayed = std::mem::take(&mut self.side);
        vec![Crossing { theta: 0.0, upward: self.stayed < 0.0 }]
    }

    /// [`CrossingFinder::in_step`] for a function of the fraction of the step, on an interpolant of
    /// this degree.
    fn of(&mut self, degree: usize, value: &dyn Fn(f64) -> f64) -> Vec<Crossing> {
        let n = degree + 2;
        let sample = |i: usize| {
            let s = i as f64 / n as f64;
            (s, value(s))
        };
        let mut found = Vec::new();
        let mut before = sample(0);
        if before.1 != 0.0 {
            (self.side, self.stayed) = (before.1.signum(), 0.0);
        } else if (1..=n).all(|i| sample(i).1 == 0.0) {
            return self.stay();
        }
        let mut last = before;
        let mut next = |point: (f64, f64)| {
            found.extend(self.come_to(point, last, value));
            last = point;
        };
        let mut here = sample(1);
        // A smallest value beside an end of the step is between its first or last two samples.
        let beside = |end: (f64, f64), inner: (f64, f64)| {
            let same = end.1 != 0.0 && inner.1 != 0.0 && (end.1 > 0.0) == (inner.1 > 0.0);
            if !same || end.1.abs() > inner.1.abs() {
                return None;
            }
            let sign = end.1.signum();
            let little = end.0 + BESIDE * (inner.0 - end.0);
            if sign * value(little) >= sign * end.1 {
                return None;
            }
            let point = smallest(value, end.0.min(inner.0), end.0.max(inner.0), sign);
            (sign * point.1 < 0.0).then_some(point)
        };
        if let Some(point) = beside(before, here) {
            next(point);
        }
        for i in 1..=n {
            if i == n {
                if let Some(point) = beside(here, before) {
                    next(point);
                }
                next(here);
                break;
            }
            let after = sample(i + 1);
            let ((s0, g0), (s1, g1), (s2, g2)) = (before, here, after);
            let same = (g0 > 0.0) == (g1 > 0.0) && (g1 > 0.0) == (g2 > 0.0);
            let mut between = None;
            if same && g1.abs() <= g0.abs() && g1.abs() <= g2.abs() {
                let (s, v) = smallest(value, s0, s2, g1.signum());
                between = ((v > 0.0) != (g1 > 0.0)).then_some((s, v));
            }
            match between {
                Some(point) if point.0 < s1 => {
                    next(point);
                    next(here);
                }
                Some(point) => {
                    next(here);
                    next(point);
                }
                None => next(here),
            }
            (before, here) = (here, after);
        }
        found
    }

    /// The crossings of the plane x\[coordinate\] = value, as [`CrossingFinder::in_step`] finds
    /// them, after one cheap test: most steps stay so far from the plane that
    /// [`Interpolant::reach`](super::Interpolant::reach) proves that they do not meet it.
    pub fn through_plane<const N: usize>(
        &mut self,
        step: &Step<'_, N>,
        coordinate: usize,
        value: f64,
    ) -> Vec<Crossing> {
        let (h0, h1) = (step.x0[coordinate] - value, step.x1[coordinate] - value);
        // Nothing can be proved of a zero or a NaN: both comparisons are false then.
        if h0 > 0.0 && h1 > 0.0 || h0 < 0.0 && h1 < 0.0 {
            let reach = step.interpolant.reach(coordinate);
            // The margin is for the rounding of the interpolant and of the bound.
            let margin = 1e-12 * (h0.abs() + h1.abs() + value.abs() + reach);
            if h0.abs().min(h1.abs()) > reach + margin {
                (self.side, self.stayed) = (h0.signum(), 0.0);
                return Vec::new();
            }
        } else if (h0 > 0.0 && h1 < 0.0 || h0 < 0.0 && h1 > 0.0)
            && step.interpolant.is_monotone(coordinate)
        {
            (self.side, self.stayed) = (h1.signum(), 0.0);
            let theta = brent(|theta| step.coordinate(theta, coordinate) - value, 0.0, 1.0, h0, h1);
            return vec![Crossing { theta, upward: h1 > 0.0 }];
        }
        self.of(step.interpolant.degree(), &|theta| step.coordinate(theta, coordinate) - value)
    }
}

/// So near to an end, in parts of the distance to the next sample, it is seen whether a function
/// falls from there.
const BESIDE: f64 = 1e-6;

/// Golden-section search for the smallest `sign * f` on [a, b]; stops early once it is negative.
fn smallest(f: &dyn Fn(f64) -> f64, mut a: f64, mut b: f64, sign: f64) -> (f64, f64) {
    const INVERSE_GOLDEN: f64 = 0.618_033_988_749_894_9;
    let (mut c, mut d) = (b - INVERSE_GOLDEN * (b - a), a + INVERSE_GOLDEN * (b - a));
    let (mut fc, mut fd) = (sign * f(c), sign * f(d));
    for _ in 0..60 {
        if fc < 0.0 || fd < 0.0 {
            break;
        }
        if fc < fd {
            (b, d, fd) = (d, c, fc);
            c = b - INVERSE_GOLDEN * (b - a);
            fc = sign * f(c);
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + INVERSE_GOLDEN * (b - a);
            fd = sign * f(d);
        }
    }
    if fc < fd { (c, sign * fc) } else { (d, sign * fd) }
}

/// The behaviour of a function at the left end of an interval, for [`first_zero`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Not zero there.
    Away,
    /// Zero there with the given derivative with respect to the fraction of the step: this zero is
    /// not the one looked for.
    Simple(f64),
    /// Zero there with zero derivative and the given half second derivative.
    Double(f64),
}

/// The first zero found by [`first_zero`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Zero {
    /// The function changes sign at this fraction.
    Crossing(f64),
    /// The function comes closer to zero than rounding can tell, at this fraction, and no change of
    /// sign is resolved.
    Touch(f64),
}

impl Zero {
    /// The fraction of the step.
    pub fn theta(&self) -> f64 {
        match *self {
            Zero::Crossing(theta) | Zero::Touch(theta) => theta,
        }
    }
}

/// Degree of the polynomials that [`first_zero`] reasons about: twice that of Dormand-Prince's
/// interpolant, so that a switching function quadratic in the state is represented exactly.
const DEGREE: usize = 8;
type Coefficients = [f64; DEGREE + 1];

/// The first zero of `f` on (0, 1].
///
/// With the zero at the start divided out, `f` is represented by the polynomial of degree 8 through
/// its values at Chebyshev-Lobatto points, in Bernstein form. By the variation-diminishing property
/// (Lane & Riesenfeld 1981; Mourrain, Rouillier & Roy 2005) coefficients of one sign prove that
/// there is no zero, and one change of sign proves that there is exactly one; otherwise the
/// interval is halved (de Casteljau), left half first. So for `f` a polynomial of degree 8 or less
/// along the step - h linear or quadratic in the state on a dense output of degree 4 - no zero is
/// missed, up to rounding, however close two of them are. For other `f` the polynomial is compared
/// with `f` between its nodes, and the interval is halved until they agree to 1e-6 of the
/// polynomial's size; then a pair of zeros may be missed only where
/// |f| stays below that.
pub fn first_zero(f: impl Fn(f64) -> f64, start: Start) -> Option<Zero> {
    let reduced = |s: f64| match start {
        Start::Away => f(s),
        Start::Simple(slope) => {
            if s <= 0.0 {
                slope
            } else {
                f(s) / s
            }
        }
        Start::Double(curvature) => {
            if s <= 0.0 {
                curvature
            } else {
                f(s) / (s * s)
            }
        }
    };
    first_in(&reduced, 0.0, 1.0, 0)
}

/// The first zero of `f` on (from, 1].
pub fn first_zero_after(from: f64, f: &dyn Fn(f64) -> f64) -> Option<Zero> {
    let place = |s: f64| from + s * (1.0 - from);
    first_zero(|s| f(place(s)), Start::Away).map(|zero| match zero {
        Zero::Crossing(s) => Zero::Crossing(place(s)),
        Zero::Touch(s) => Zero::Touch(place(s)),
    })
}

/// A function of the state.
pub trait OfState<const N: usize> {
    /// Its value at `x`: in plain numbers, or over a set of states.
    fn at<S: Elementary>(&self, x: &SVector<S, N>) -> S;
}

/// A number on a piece of a step with its derivative by the fraction of the step (or without, if
/// `K` is 0), both enclosed.
type Enclosed<const K: usize> = Dual<Interval, K>;

/// A function of the state over sets of states: by itself, and with its derivative. Both make the
/// same enclosures of its values.
struct Enclosures<'a, const N: usize> {
    value: &'a dyn Fn(&SVector<Enclosed<0>, N>) -> Enclosed<0>,
    with_slope: &'a dyn Fn(&SVector<Enclosed<1>, N>) -> Enclosed<1>,
}

/// The first zero on (0, 1] of a function of the state along `step`. None is missed at which the
/// function has structure that the interpolant in f64 can show, however close two of them are.
///
/// The dense output is enclosed on a piece of the step by its Bernstein coefficients, the function
/// and its derivative along it by interval arithmetic; a piece is passed where the function is
/// proved to have no zero, or to be monotone without change of sign, and halved otherwise (Moore
/// 1966; Neumaier 1990, ch. 5; of the same kind is Park & Barton 1996). Where a zero is found,
/// [`first_zero`] has the last word on its place if it finds the same one.
pub fn first_zero_along<const N: usize>(
    step: &Step<'_, N>,
    function: &impl OfState<N>,
    start: Start,
) -> Option<Zero> {
    let enclosed = Enclosures { value: &|x| function.at(x), with_slope: &|x| function.at(x) };
    first_zero_enclosed(step, &|theta| function.at(&step.at(theta)), &enclosed, start)
}

/// [`first_zero_along`] of a function that is `f` at a fraction of the step.
fn first_zero_enclosed<const N: usize>(
    step: &Step<'_, N>,
    f: &dyn Fn(f64) -> f64,
    enclosed: &Enclosures<'_, N>,
    start: Start,
) -> Option<Zero> {
    let Some(coefficients) = step.interpolant.bernstein() else { return first_zero(f, start) };
    let piece = Piece::whole(step.x0, coefficients);
    match scan(piece.clone(), f, enclosed, start) {
        Scan::Nothing => None,
        Scan::Unknown => first_zero(f, start),
        Scan::Crossing(a, b) => match first_zero(f, start) {
            Some(Zero::Crossing(theta)) if a <= theta && theta <= b => Some(Zero::Crossing(theta)),
            // An excursion to the other side that is no deeper than the rounding of the states is
            // none.
            Some(Zero::Touch(theta))
                if (theta - b).abs() <= TOUCH && piece.touches(step.at(theta), enclosed) =>
            {
                Some(Zero::Touch(theta))
            }
            _ => {
                let (fa, fb) = (f(a), f(b));
                // At a zero of the start, or within rounding of one, the left end has no sign of
                // its own.
                let fa = if fa == 0.0 || (fa > 0.0) == (fb > 0.0) { -fb } else { fa };
                Some(Zero::Crossing(if fb == 0.0 { b } else { brent(f, a, b, fa, fb) }))
            }
        },
        Scan::Touch(at) => match first_zero(f, start) {
            Some(Zero::Touch(theta)) if (theta - at).abs() <= TOUCH => Some(Zero::Touch(theta)),
            _ => Some(Zero::Touch(at)),
        },
    }
}

/// Two places of one touch, at which f differs from zero by rounding, are no farther apart: the
/// root of the rounding.
const TOUCH: f64 = 1e-6;
/// Rounding of a state, relative to the largest of the step.
const ROUNDING: f64 = 64.0 * f64::EPSILON;
/// Pieces narrower than this are not halved: near the spacing of the fractions.
const NARROWEST: f64 = 8.0 * f64::EPSILON;
/// A zero of second order at the start is left with this fraction: before it the function is below
/// the rounding of its values at 1.
const AFTER_TANGENCY: f64 = 1.5e-8;
/// Enclosures made for one step at most.
const MOST_PIECES: usize = 50_000;

/// The first finding of [`scan`].
enum Scan {
    Nothing,
    /// The function changes sign between these two fractions.
    Crossing(f64, f64),
    Touch(f64),
    /// More pieces than [`MOST_PIECES`] were needed.
    Unknown,
}

/// A piece of a step, as Bernstein coefficients of the state and of its derivative by the fraction
/// of the step.
#[derive(Clone)]
struct Piece<const N: usize> {
    a: f64,
    b: f64,
    x: [SVector<f64, N>; 5],
    slope: [SVector<f64, N>; 4],
    /// Rounding of the states of the whole step, and of their derivatives.
    rounding: [SVector<f64, N>; 2],
}

impl<const N: usize> Piece<N> {
    fn whole(x0: SVector<f64, N>, c: [SVector<f64, N>; 5]) -> Self {
        let slope = std::array::from_fn(|i| (c[i + 1] - c[i]) * 4.0);
        let x = c.map(|c| x0 + c);
        let largest = |c: &[SVector<f64, N>]| {
            c.iter().fold(SVector::zeros(), |m: SVector<f64, N>, c| m.sup(&c.abs()))
        };
        let rounding = [largest(&x) * ROUNDING, largest(&slope) * (4.0 * f64::EPSILON)];
        Self { a: 0.0, b: 1.0, x, slope, rounding }
    }

    /// The two parts before and after `a + part (b - a)`, by de Casteljau's subdivision.
    fn split(&self, part: f64) -> [Self; 2] {
        fn parts<const N: usize, const K: usize>(
            c: &[SVector<f64, N>; K],
            part: f64,
        ) -> [[SVector<f64, N>; K]; 2] {
            let (mut work, mut left, mut right) = (*c, *c, *c);
            for k in 0..K {
                left[k] = work[0];
                right[K - 1 - k] = work[K - 1 - k];
                for i in 0..K - 1 - k {
                    work[i] = work[i] * (1.0 - part) + work[i + 1] * part;
                }
            }
            [left, right]
        }
        let middle = self.a + part * (self.b - self.a);
        let ([x, x1], [slope, slope1]) = (parts(&self.x, part), parts(&self.slope, part));
        [Self { b: middle, x, slope, ..*self }, Self { a: middle, x: x1, slope: slope1, ..*self }]
    }

    /// The states on it; the rounding of the coefficients is included.
    fn states(&self) -> SVector<Enclosed<0>, N> {
        SVector::from_fn(|i, _| Dual::constant(hull(&self.x, i, self.rounding[0][i])))
    }

    /// The same with their derivatives.
    fn states_with_slopes(&self) -> SVector<Enclosed<1>, N> {
        let [of_x, of_slope] = &self.rounding;
        SVector::from_fn(|i, _| Dual {
            value: hull(&self.x, i, of_x[i]),
            partials: [hull(&self.slope, i, of_slope[i])],
        })
    }

    /// Whether the function is zero at the state `x` of the step as far as its rounding lets tell.
    fn touches(&self, x: SVector<f64, N>, enclosed: &Enclosures<'_, N>) -> bool {
        let [of_x, _] = &self.rounding;
        (enclosed.value)(&SVector::from_fn(|i, _| Dual::constant(hull(&[x], i, of_x[i]))))
            .value
            .contains(0.0)
    }
}

/// The numbers between the i-th components, widened by `rounding`.
fn hull<const N: usize>(c: &[SVector<f64, N>], i: usize, rounding: f64) -> Interval {
    let (low, high) =
        c.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), c| (l.min(c[i]), h.max(c[i])));
    Interval::new(low - rounding, high + rounding).unwrap_or(Interval::ENTIRE)
}

/// The first zero from the left. Up to the piece that is looked at the function keeps the sign that
/// it has behind its start.
fn scan<const N: usize>(
    whole: Piece<N>,
    f: &dyn Fn(f64) -> f64,
    enclosed: &Enclosures<'_, N>,
    start: Start,
) -> Scan {
    let sign = match start {
        Start::Away => f(0.0),
        Start::Simple(slope) => slope,
        Start::Double(curvature) => curvature,
    };
    let mut waiting = vec![match start {
        Start::Double(_) => {
            let [_, rest] = whole.split(AFTER_TANGENCY);
            rest
        }
        _ => whole,
    }];
    let changed = |s: f64| {
        let v = f(s);
        v == 0.0 || (v > 0.0) != (sign > 0.0)
    };
    for _ in 0..MOST_PIECES {
        let Some(piece) = waiting.pop() else { return Scan::Nothing };
        let (a, b) = (piece.a, piece.b);
        let value = (enclosed.value)(&piece.states()).value;
        if !value.contains(0.0) {
            // A piece that begins beyond zero, by rounding, has its crossing there.
            if value.is_positive() != (sign > 0.0) {
                return if a > 0.0 {
                    Scan::Crossing((a - NARROWEST).max(0.0), a)
                } else {
                    Scan::Unknown
                };
            }
            continue;
        }
        let [slope] = (enclosed.with_slope)(&piece.states_with_slopes()).partials;
        if slope.is_positive() || slope.is_negative() {
            // Away from zero; or towards it, as far as its sign at the end says.
            if slope.is_positive() != (sign > 0.0) && changed(b) {
                return Scan::Crossing(a, b);
            }
            continue;
        }
        if b - a > NARROWEST {
            let [left, right] = piece.split(0.5);
            waiting.extend([right, left]);
        } else if changed(b) {
            return Scan::Crossing(a, b);
        } else if value.is_bounded() && (a > 0.0 || start == Start::Away) {
            return Scan::Touch(0.5 * (a + b));
        }
    }
    Scan::Unknown
}

fn first_in(q: &dyn Fn(f64) -> f64, a: f64, b: f64, depth: usize) -> Option<Zero> {
    let (coefficients, size, error) = polynomial(q, a, b);
    if !is_sound(size, error) && depth < DEEPEST {
        let middle = 0.5 * (a + b);
        return first_in(q, a, middle, depth + 1).or_else(|| first_in(q, middle, b, depth + 1));
    }
    isolate(q, &coefficients, a, b, 0, size)
}

/// Largest number of halvings of an interval on which `q` is no such polynomial.
const DEEPEST: usize = 10;

/// Places in (a, b], the last of them b, that leave at most one zero of `q` between neighbours.
fn separated(q: &dyn Fn(f64) -> f64, a: f64, b: f64, depth: usize, places: &mut Vec<f64>) {
    let (coefficients, size, error) = polynomial(q, a, b);
    if !is_sound(size, error) && depth < DEEPEST {
        let middle = 0.5 * (a + b);
        separated(q, a, middle, depth + 1, places);
        separated(q, middle, b, depth + 1, places);
    } else {
        let rounding = NOISE * size;
        let doubt = if error <= rounding || depth >= DEEPEST { 0.0 } else { SAFE * error };
        let mut separation = Separation { q, depth, rounding, doubt, width: b - a, places };
        separation.of(&coefficients, a, b, 0);
    }
}

/// Rounding of a polynomial's values, relative to the largest of its coefficients.
const NOISE: f64 = 64.0 * f64::EPSILON;
/// A polynomial of degree 8 differs from its function by less than this multiple of the largest
/// difference seen between its nodes, and so does an eighth of its derivative: one of degree 9 has
/// derivatives of at most 162 times its size (Markov).
const SAFE: f64 = 32.0;

/// The search for places that separate the zeros of `q`, by the polynomial that stands for it.
struct Separation<'a> {
    q: &'a dyn Fn(f64) -> f64,
    /// Halvings of the step so far.
    depth: usize,
    rounding: f64,
    /// Bound of the difference between the polynomial and `q`, and of an eighth of that between
    /// their derivatives by the fraction of `width`; zero where it is not asked for.
    doubt: f64,
    width: f64,
    places: &'a mut Vec<f64>,
}

impl Separation<'_> {
    fn of(&mut self, c: &Coefficients, a: f64, b: f64, halvings: usize) {
        let (middle, within) = (0.5 * (a + b), |bound: f64| c.iter().all(|v| v.abs() <= bound));
        let one = sign_changes(c) <= 1;
        if self.doubt > 0.0 && (within(self.doubt) || one && !self.is_certain(c, b - a)) {
            // The polynomial is nearer to zero than to the function.
            separated(self.q, a, middle, self.depth + 1, self.places);
            separated(self.q, middle, b, self.depth + 1, self.places);
        } else if one || halvings >= 45 || within(self.rounding) {
            self.places.push(b);
        } else {
            let (left, right) = halves(c);
            self.of(&left, a, middle, halvings + 1);
            self.of(&right, middle, b, halvings + 1);
        }
    }

    /// Whether the function, like the polynomial, has at most one zero on a part of this length:
    /// it has none, or only grows, or only falls.
    fn is_certain(&self, c: &Coefficients, length: f64) -> bool {
        let beyond = |values: &mut dyn Iterator<Item = f64>, doubt: f64| {
            let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| {
                (low.min(v), high.max(v))
            });
            low > doubt || high < -doubt
        };
        beyond(&mut c.iter().copied(), self.doubt)
            || beyond(&mut c.windows(2).map(|w| w[1] - w[0]), self.doubt * length / self.width)
    }
}

/// By the variation-diminishing property not fewer than the zeros inside.
fn sign_changes(c: &Coefficients) -> usize {
    let signs = c.iter().filter(|v| **v != 0.0).map(|v| *v > 0.0);
    signs.clone().zip(signs.skip(1)).filter(|(x, y)| x != y).count()
}

/// Whether a polynomial with coefficients of this size and this error stands for its function.
fn is_sound(size: f64, error: f64) -> bool {
    error <= 1e-6 * size
}

/// The Bernstein coefficients of the polynomial that is `q` at the nodes, the largest of them, and
/// its largest difference from `q` between the nodes, as far as four places show.
fn polynomial(q: &dyn Fn(f64) -> f64, a: f64, b: f64) -> (Coefficients, f64, f64) {
    let basis = bernstein_basis();
    let at = |u: f64| q(if u >= 1.0 { b } else { a + (b - a) * u });
    let values: Coefficients = std::array::from_fn(|j| at(basis.nodes[j]));
    let mut coefficients: Coefficients =
        std::array::from_fn(|i| (0..=DEGREE).map(|j| basis.from_values[i][j] * values[j]).sum());
    coefficients[0] = values[0];
    coefficients[DEGREE] = values[DEGREE];
    let size = coefficients.iter().fold(0.0_f64, |m, c| m.max(c.abs()));
    let error = [1, 3, 4, 6].into_iter().fold(0.0_f64, |most, j| {
        let u = 0.5 * (basis.nodes[j] + basis.nodes[j + 1]);
        let here = (at(u) - bernstein(&coefficients, u)).abs();
        if here > most || here.is_nan() { here } else { most }
    });
    (coefficients, size, error)
}

fn isolate(
    q: &dyn Fn(f64) -> f64,
    c: &Coefficients,
    a: f64,
    b: f64,
    depth: usize,
    size: f64,
) -> Option<Zero> {
    let changes = sign_changes(c);
    let rounding = 64.0 * f64::EPSILON * size;
    if changes == 0 {
        // At the right end a zero is found here; one at the left end belongs to the interval
        // before.
        let end = c[DEGREE];
        return if c.iter().all(|v| *v == 0.0) || end.abs() > rounding {
            None
        } else if end == 0.0 {
            Some(Zero::Crossing(b))
        } else {
            Some(Zero::Touch(b))
        };
    }
    if changes == 1 {
        let (fa, fb) = (q(a), q(b));
        if fa != 0.0 && (fb == 0.0 || (fa > 0.0) != (fb > 0.0)) {
            return Some(Zero::Crossing(brent(q, a, b, fa, fb)));
        }
    }
    if depth >= 45 || (changes > 1 && c.iter().all(|v| v.abs() <= rounding)) {
        return Some(Zero::Touch(0.5 * (a + b)));
    }
    let (left, right) = halves(c);
    let middle = 0.5 * (a + b);
    isolate(q, &left, a, middle, depth + 1, size)
        .or_else(|| isolate(q, &right, middle, b, depth + 1, size))
}

/// De Casteljau's subdivision at 1/2.
fn halves(c: &Coefficients) -> (Coefficients, Coefficients) {
    let (mut work, mut left, mut right) = (*c, [0.0; DEGREE + 1], [0.0; DEGREE + 1]);
    for k in 0..=DEGREE {
        left[k] = work[0];
        right[DEGREE - k] = work[DEGREE - k];
        for i in 0..DEGREE - k {
            work[i] = 0.5 * (work[i] + work[i + 1]);
        }
    }
    (left, right)
}

/// The polynomial with Bernstein coefficients `c` at `u`, by de Casteljau.
fn bernstein(c: &Coefficients, u: f64) -> f64 {
    let mut work = *c;
    for k in 1..=DEGREE {
        for i in 0..=DEGREE - k {
            work[i] += u * (work[i + 1] - work[i]);
        }
    }
    work[0]
}

/// Nodes on [0, 1] and the matrix from values at them to Bernstein coefficients.
struct Basis {
    nodes: Coefficients,
    from_values: [Coefficients; DEGREE + 1],
}

fn bernstein_basis() -> &'static Basis {
    static BASIS: std::sync::OnceLock<Basis> = std::sync::OnceLock::new();
    BASIS.get_or_init(|| {
        let n = DEGREE;
        let nodes: Coefficients = std::array::from_fn(|j| match j {
            0 => 0.0,
            _ if j == n => 1.0,
            _ => 0.5 * (1.0 - cos(std::f64::consts::PI * j as f64 / n as f64)),
        });
        let mut matrix = SMatrix::<f64, { DEGREE + 1 }, { DEGREE + 1 }>::zeros();
        for (i, &u) in nodes.iter().enumerate() {
            for j in 0..=n {
                let mut unit = [0.0; DEGREE + 1];
                unit[j] = 1.0;
                matrix[(i, j)] = bernstein(&unit, u);
            }
        }
        let inverse = matrix.try_inverse().expect("interpolation at distinct nodes is unisolvent");
        Basis {
            nodes,
            from_values: std::array::from_fn(|i| std::array::from_fn(|j| inverse[(i, j)])),
        }
    })
}

#[cfg(test)]
mod tests;
