//! The first zero of a function along a step.
//!
//! Values at five places give a polynomial of degree four, which is what a linear function of the
//! step's continuous extension is. Where its Bernstein coefficients have one sign there is no zero
//! (Farin 2002, sec. 6.3); else the step is halved until a change of sign stands alone, which is
//! then narrowed down on the function itself (regula falsi, the Illinois way: Dowell & Jarratt
//! 1971; halving where that is slow).

use crate::equation::same_sign;

/// Places of the samples, as fractions.
pub(crate) const PLACES: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];
/// Largest number of halvings of a step whose end is on the same side, and of one whose end is
/// beyond zero: down to the last digits.
const DEPTH: usize = 12;
const DEEPEST: usize = 60;

/// The Bernstein coefficients of the polynomial through five equidistant values.
fn bernstein(v: &[f64; 5]) -> [f64; 5] {
    let [a, b, c, d, e] = *v;
    [
        a,
        (-13.0 * a + 48.0 * b - 36.0 * c + 16.0 * d - 3.0 * e) / 12.0,
        (13.0 * a - 64.0 * b + 120.0 * c - 64.0 * d + 13.0 * e) / 18.0,
        (-3.0 * a + 16.0 * b - 36.0 * c + 48.0 * d - 13.0 * e) / 12.0,
        e,
    ]
}

/// The slope at the beginning of the polynomial through five values, for the whole interval.
pub(crate) fn slope_at_beginning(v: &[f64; 5]) -> f64 {
    let b = bernstein(v);
    4.0 * (b[1] - b[0])
}

/// [`first`] of a function that leaves zero at `from` to its side as a square does, but for
/// rounding.
pub(crate) fn first_behind_tangent(
    side: f64,
    from: f64,
    to: f64,
    f: &mut dyn FnMut(f64) -> f64,
) -> Option<f64> {
    let mut end = to;
    for _ in 0..DEEPEST {
        let b = bernstein(&PLACES.map(|u| f(from + u * (end - from))));
        if b[2..].iter().all(|c| c * side > 0.0) {
            let rest = PLACES.map(|u| f(end + u * (to - end)));
            return if end < to { first(rest, side, end, to, f, 0) } else { None };
        }
        end = from + 0.5 * (end - from);
    }
    Some(from)
}

/// The value of a polynomial by its Bernstein coefficients.
pub(crate) fn at_fraction(b: &[f64; 5], u: f64) -> f64 {
    let w = 1.0 - u;
    let mut level = *b;
    for n in (1..5).rev() {
        for i in 0..n {
            level[i] = w * level[i] + u * level[i + 1];
        }
    }
    level[0]
}

/// Whether the polynomial through these values stays on its side of zero, where it may begin at
/// zero.
pub(crate) fn stays(v: &[f64; 5], side: f64) -> bool {
    // A function that is zero all along passes zero nowhere.
    if v.iter().all(|v| *v == 0.0) {
        return true;
    }
    let b = bernstein(v);
    if !(b[1..].iter().all(|c| c * side > 0.0) && b[0] * side >= 0.0) {
        return false;
    }
    keeps_away(&b, side)
}

/// Whether Bernstein coefficients on one side of zero say that there is no zero.
pub(crate) fn keeps_away(b: &[f64; 5], side: f64) -> bool {
    // A polynomial that only comes near to zero between its ends is not what the function is: it is
    // looked at closer.
    let (low, high) =
        b.iter().fold((f64::INFINITY, 0.0_f64), |(l, h), c| (l.min(c * side), h.max(c * side)));
    let goes_one_way = b.windows(2).all(|w| w[0] <= w[1]) || b.windows(2).all(|w| w[0] >= w[1]);
    goes_one_way || low > NEAR * (high - low)
}

/// A function whose least value in an interval is less than this part of its range there is looked
/// at closer.
const NEAR: f64 = 0.05;

/// The first place in (from, to] where the function, which begins on `side` of zero (or at zero,
/// leaving to that side), meets zero or is beyond it.
pub(crate) fn first(
    v: [f64; 5],
    side: f64,
    from: f64,
    to: f64,
    f: &mut dyn FnMut(f64) -> f64,
    depth: usize,
) -> Option<f64> {
    if stays(&v, side) {
        return None;
    }
    let b = bernstein(&v);
    let ends_beyond = v[4] * side <= 0.0;
    if ends_beyond && v[0] * side > 0.0 && changes(&b) <= 1 {
        return Some(narrow(from, to, &v, side, f));
    }
    if depth >= if ends_beyond { DEEPEST } else { DEPTH } {
        if ends_beyond {
            return Some(to);
        }
        return dip(&v, side, from, to, f).map(|(place, value)| {
            let start = [v[0], v[0], v[0], v[0], value];
            narrow(from, place, &start, side, f)
        });
    }
    let middle = 0.5 * (from + to);
    let quarter = 0.25 * (to - from);
    let (p, q) = (f(from + 0.5 * quarter), f(from + 1.5 * quarter));
    if let Some(found) = first([v[0], p, v[1], q, v[2]], side, from, middle, f, depth + 1) {
        return Some(found);
    }
    let (p, q) = (f(middle + 0.5 * quarter), f(middle + 1.5 * quarter));
    first([v[2], p, v[3], q, v[4]], side, middle, to, f, depth + 1)
}

/// Place beyond zero, and the value there, of a function that is on its side at both ends of an
/// interval: its minimum is sought by parabolas (Brent 1973, ch. 5) from the three values about the
/// least of five.
fn dip(
    v: &[f64; 5],
    side: f64,
    from: f64,
    to: f64,
    f: &mut dyn FnMut(f64) -> f64,
) -> Option<(f64, f64)> {
    let least = (0..5).min_by(|i, j| (v[*i] * side).total_cmp(&(v[*j] * side)))?;
    let inner = least.clamp(1, 3);
    let mut three: [(f64, f64); 3] = std::array::from_fn(|i| {
        (from + PLACES[inner + i - 1] * (to - from), v[inner + i - 1] * side)
    });
    for _ in 0..MOST_PARABOLAS {
        let [(a, fa), (b, fb), (c, fc)] = three;
        let (p, q) = ((b - a) * (fb - fc), (b - c) * (fb - fa));
        let place = b - 0.5 * ((b - a) * p - (b - c) * q) / (p - q);
        if !(place > a && place < c) || place == b {
            return None;
        }
        let value = f(place) * side;
        // Zero itself may be where it is only touched.
        if value < 0.0 {
            return Some((place, value * side));
        }
        // A parabola through three points that is right in a fourth has no lower ones.
        let expected = {
            let (s, d) = ((fc - fb) / (c - b), (fb - fa) / (b - a));
            fb + (place - b) * (d + (place - a) * (s - d) / (c - a))
        };
        if (value - expected).abs() <= 1e-3 * value {
            return None;
        }
        three = match (place < b, value < fb) {
            (true, true) => [(a, fa), (place, value), (b, fb)],
            (true, false) => [(place, value), (b, fb), (c, fc)],
            (false, true) => [(b, fb), (place, value), (c, fc)],
            (false, false) => [(a, fa), (b, fb), (place, value)],
        };
    }
    None
}

/// Most steps of [`dip`].
const MOST_PARABOLAS: usize = 40;

/// [`first`] of the polynomial through five values itself.
pub(crate) fn first_of_polynomial(v: [f64; 5], side: f64) -> Option<f64> {
    let b = bernstein(&v);
    // One change of sign is one zero (Descartes), from zero on one behind the beginning.
    if v[0] == 0.0 && b[1] * side > 0.0 && v[4] * side < 0.0 && changes(&b) == 1 {
        return Some(polynomial_root(&v, side));
    }
    first(v, side, 0.0, 1.0, &mut |u| at_fraction(&b, u), 0)
}

/// The last terms of a Taylor series are a smaller part of all.
const LAST_TERMS: f64 = 1e-8;

/// The first place in (0, 1] where the polynomial with these coefficients, by powers, which begins
/// on `side` of zero, is at zero or beyond it; where it begins at zero, the first place behind
/// that: `at_zero` is the slope that rounding makes. Whether zero is passed or only touched is said
/// by the function itself, `f`, where the series leaves out as much as it comes near to zero.
pub(crate) fn first_of_series(
    c: &[f64],
    side: f64,
    at_zero: Option<f64>,
    f: &mut dyn FnMut(f64) -> f64,
) -> Option<f64> {
    let mut q: Vec<f64> = c.iter().map(|c| c * side).collect();
    let size = |q: &[f64]| q.iter().map(|c| c.abs()).sum::<f64>();
    if at_zero.is_some() || q[0] <= 0.0 {
        // Divided by the place, and once more where it leaves zero more slowly.
        q.remove(0);
        if q[0].abs() <= at_zero.unwrap_or(0.0) {
            q[0] = 0.0;
        }
        let rounding = 4.0 * f64::EPSILON * size(&q);
        let leaves = q.iter().position(|c| c.abs() > rounding)?;
        q.drain(..leaves);
        if q[0] < 0.0 {
            return Some(1.0 / (1_u64 << DEEPEST) as f64);
        }
    }
    let p = q.len() - 1;
    // Of the coefficients, and what the series leaves out: about its last terms, unless they are
    // those of a polynomial.
    let last = size(&q[p.saturating_sub(1)..]);
    let left_out = if last < LAST_TERMS * size(&q) { last } else { 0.0 };
    let rounding = 8.0 * f64::EPSILON * size(&q) + left_out;
    let coefficient = |i: usize| {
        let (mut sum, mut share) = (0.0, 1.0);
        for k in 0..=i {
            sum += share * q[k];
            share *= (i - k) as f64 / (p - k).max(1) as f64;
        }
        sum
    };
    let mut open = vec![((0..=p).map(coefficient).collect::<Vec<f64>>(), 0.0, 1.0)];
    // Zero to rounding: passed, if what follows is beyond it. If it is not, the function says.
    let mut touched: Option<(f64, f64)> = None;
    let mut passes = |(from, _): (f64, f64), to: f64| {
        let (a, b) = ((2.0 * from - to).max(0.0), (2.0 * to - from).min(1.0));
        first(PLACES.map(|u| f(a + u * (b - a))), side, a, b, f, 0)
    };
    while let Some((b, from, to)) = open.pop() {
        if b.iter().all(|b| *b > 0.0) {
            if b.iter().any(|b| *b > rounding)
                && let Some(touch) = touched.take()
                && let Some(passed) = passes(touch, from)
            {
                return Some(passed);
            }
            continue;
        }
        let beyond = b[p] <= 0.0;
        let turns = b.windows(2).filter(|w| (w[0] > 0.0) != (w[1] > 0.0)).count();
        let found = if beyond && b[0] > 0.0 && turns == 1 {
            Some(root_between(&q, from, to))
        } else {
            let middle = 0.5 * (from + to);
            let is_last = !(middle > from && middle < to);
            (is_last || b.iter().all(|b| b.abs() <= rounding)).then_some(to)
        };
        if let Some(root) = found {
            if b.iter().any(|b| *b < -rounding) {
                return Some(touched.filter(|_| b[0] <= rounding).map_or(root, |(_, root)| root));
            }
            if beyond {
                touched.get_or_insert((from, root));
            }
            continue;
        }
        let middle = 0.5 * (from + to);
        // Both halves (de Casteljau), the first on top.
        let (mut left, mut level) = (Vec::with_capacity(p + 1), b);
        for n in (0..=p).rev() {
            left.push(level[0]);
            for i in 0..n {
                level[i] = 0.5 * (level[i] + level[i + 1]);
            }
        }
        open.push((level, middle, to));
        open.push((left, from, middle));
    }
    touched.and_then(|touch| passes(touch, 1.0))
}

/// The zero of a polynomial that is positive at `low` and not at `high`: Newton's method within
/// bounds.
fn root_between(q: &[f64], mut low: f64, mut high: f64) -> f64 {
    let mut u = 0.5 * (low + high);
    for _ in 0..100 {
        let (value, slope) = q.iter().rev().fold((0.0, 0.0), |(v, s), c| (v * u + c, s * u + v));
        if value > 0.0 {
            low = u
        } else {
            high = u
        }
        let newton = u - value / slope;
        if settled(newton, u) {
            return newton.clamp(low, high);
        }
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if settled(next, u) {
            return next;
        }
        u = next;
    }
    u
}

/// Whether Newton's method has come to its end, by its own step and not by one within the bounds:
/// there the rounding of a value may give the wrong side of zero, so that most of the bracket is
/// still to be halved.
fn settled(newton: f64, u: f64) -> bool {
    (newton - u).abs() <= 2.0 * f64::EPSILON * u
}

/// Number of sign changes among coefficients.
fn changes(b: &[f64; 5]) -> usize {
    let (mut changes, mut before) = (0, 0.0);
    for c in b.iter().filter(|c| **c != 0.0) {
        changes += usize::from(same_sign(before, -c));
        before = *c;
    }
    changes
}

/// Zero of the polynomial through five values, which has one change of sign, as a fraction of the
/// interval: Newton's method within bounds.
fn polynomial_root(v: &[f64; 5], side: f64) -> f64 {
    let b = bernstein(v);
    let value = |u: f64| {
        let w = 1.0 - u;
        let (mut level, mut slope) = (b, 0.0);
        for n in (1..5).rev() {
            if n == 1 {
                slope = 4.0 * (level[1] - level[0]);
            }
            for i in 0..n {
                level[i] = w * level[i] + u * level[i + 1];
            }
        }
        (level[0], slope)
    };
    let (mut low, mut high, mut u) = (0.0, 1.0, 0.5);
    for _ in 0..60 {
        let (p, slope) = value(u);
        if p * side > 0.0 {
            low = u
        } else {
            high = u
        }
        let newton = u - p / slope;
        if settled(newton, u) {
            return newton.clamp(low, high);
        }
        let next = if newton > low && newton < high { newton } else { 0.5 * (low + high) };
        if settled(next, u) {
            return next;
        }
        u = next;
    }
    u
}

/// Narrows a change of sign down to the last digits; the place given is at zero or beyond it.
fn narrow(from: f64, to: f64, v: &[f64; 5], side: f64, f: &mut dyn FnMut(f64) -> f64) -> f64 {
    let (mut a, mut fa, mut b, mut fb) = (from, v[0], to, v[4]);
    let rounding = 8.0 * f64::EPSILON * v.iter().fold(0.0_f64, |most, v| most.max(v.abs()));
    let mut c = from + (to - from) * polynomial_root(v, side);
    let mut width = b - a;
    for i in 0..200 {
        if fb == 0.0 || b - a <= 4.0 * f64::EPSILON * b.abs() {
            break;
        }
        // If a few secants did not halve the interval, as near a pole, the next step does.
        let slow = i % 4 == 3 && b - a > 0.5 * std::mem::replace(&mut width, b - a);
        if slow || !(c > a && c < b) {
            c = 0.5 * (a + b);
        }
        if !(c > a && c < b) {
            break;
        }
        let fc = f(c);
        if fc.abs() <= rounding {
            return c;
        }
        if fc * side > 0.0 {
            a = c;
            fa = fc;
            fb *= 0.5;
        } else {
            b = c;
            fb = fc;
            fa *= 0.5;
        }
        c = b - fb * (b - a) / (fb - fa);
    }
    b
}

#[cfg(test)]
mod tests {
    use super::*;

    fn find(f: impl Fn(f64) -> f64, side: f64) -> Option<f64> {
        first(PLACES.map(&f), side, 0.0, 1.0, &mut |x| f(x), 0)
    }

    fn series(c: &[f64], side: f64, at_zero: Option<f64>) -> Option<f64> {
        let mut f = |x: f64| c.iter().rev().fold(0.0, |sum, c| sum * x + c);
        first_of_series(c, side, at_zero, &mut f)
    }

    #[test]
    fn the_first_zero_of_a_series_is_found() {
        let times = |a: &[f64], b: &[f64]| {
            let mut out = vec![0.0; a.len() + b.len() - 1];
            a.iter()
                .enumerate()
                .for_each(|(i, a)| b.iter().enumerate().for_each(|(j, b)| out[i + j] += a * b));
            out
        };
        let of = |zeros: &[f64]| zeros.iter().fold(vec![1.0], |all, z| times(&all, &[-z, 1.0]));
        for degree in [1, 4, 12] {
            // Rounding of coefficients that sum up to 3^degree, where the slope is about
            // (3/2)^degree times the distance of the zeros.
            let within = f64::EPSILON * 1e4 * 2.0_f64.powi(degree as i32);
            let near = |found: Option<f64>, want: f64| {
                assert!((found.unwrap() - want).abs() < within, "{found:?} {want}")
            };
            let rest = vec![2.0; degree];
            let at = |zeros: &[f64]| of(&[zeros, &rest].concat());
            let side =
                |zeros: &[f64]| if (zeros.len() + degree).is_multiple_of(2) { 1.0 } else { -1.0 };
            for zeros in [&[0.3][..], &[0.3, 0.9], &[0.61, 0.62], &[1e-9, 0.5], &[0.5, 0.5001, 0.9]]
            {
                near(series(&at(zeros), side(zeros), None), zeros[0]);
                // From zero on.
                let behind = [&[0.0], zeros].concat();
                near(series(&at(&behind), -side(&behind), Some(0.0)), zeros[0]);
            }
            assert_eq!(series(&at(&[1.1]), side(&[1.1]), None), None);
            assert_eq!(series(&at(&[0.0]), -side(&[0.0]), Some(0.0)), None);
        }
        // It leaves zero like a square, to one side and to the other.
        assert!((series(&[0.0, 0.0, 1.0, -2.0], 1.0, Some(0.0)).unwrap() - 0.5).abs() < 1e-15);
        assert!(series(&[0.0, 0.0, -1.0, 2.0], 1.0, Some(0.0)).unwrap() < 1e-12);
        // A dip that does not reach zero, by much and by little; one that does.
        assert_eq!(series(&[0.09 + 1e-6, -0.6, 1.0], 1.0, None), None);
        assert_eq!(series(&[0.09 + 1e-13, -0.6, 1.0], 1.0, None), None);
        let found = series(&[0.09 - 1e-12, -0.6, 1.0], 1.0, None).unwrap();
        assert!((found - 0.3 + 1e-6).abs() < 1e-9, "{found}");
        assert_eq!(series(&[0.0, 0.0, 0.0], 1.0, Some(0.0)), None);
    }

    #[test]
    fn the_first_of_several_is_found() {
        let near = |found: Option<f64>, want: f64| {
            assert!((found.unwrap() - want).abs() < 1e-14, "{found:?}")
        };
        near(find(|x| (x - 0.3) * (x - 0.9), 1.0), 0.3);
        near(find(|x| (x - 0.61) * (x - 0.62), 1.0), 0.61);
        near(find(|x| 0.2 - x, 1.0), 0.2);
        near(find(|x| x - 1.0, -1.0), 1.0);
        // Two zeros between two samples.
        near(find(|x| (x - 0.30) * (x - 0.31) * (1.0 + x), 1.0), 0.3);
        assert_eq!(find(|x| (x - 0.3) * (x - 0.3) + 1e-6, 1.0), None);
        // A dip far narrower than the finest sampling, of a parabola and of none.
        for (c, w) in [(0.3, 1e-6), (0.617, 1e-7), (0.25, 1e-7)] {
            let found = find(|x| (x - c) * (x - c) - w * w, 1.0).unwrap();
            assert!((found - (c - w)).abs() < 1e-2 * w, "{c}: {found}");
            let found = find(|x| 1.0 - w * w - (x - c).cos(), 1.0).unwrap();
            assert!((found - c).abs() < 2.0 * w, "{c}: {found}");
        }
        // Polynomials themselves, from zero and not.
        let of = |f: &dyn Fn(f64) -> f64, side| first_of_polynomial(PLACES.map(f), side);
        near(of(&|x| x * (0.3 - x), 1.0), 0.3);
        near(of(&|x| x * (x - 0.3) * (x - 0.8), 1.0), 0.3);
        near(of(&|x| (x - 0.4) * (1.0 + x), -1.0), 0.4);
        assert_eq!(of(&|x| x * (1.1 - x), 1.0), None);
        // From zero, leaving.
        assert_eq!(find(|x| x, 1.0), None);
        near(find(|x| x * (0.5 - x), 1.0), 0.5);
    }
}
