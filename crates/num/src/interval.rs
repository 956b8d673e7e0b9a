//! Intervals: arithmetic whose results are theorems.
//!
//! An [`Interval`] is a closed set of real numbers between two `f64`. The result of every operation
//! contains every value that the operation takes on its arguments (Moore 1966; Neumaier 1990; IEEE
//! 1788-2015). Rounding outward needs no directed rounding modes: the error of a rounded sum,
//! product, quotient or root is itself known exactly, from Knuth's TwoSum and Dekker's product, so
//! that a bound moves to the neighbouring number if, and only if, the rounded result is on the
//! wrong side of the exact one (Rump, Ogita & Oishi 2005; Kulisch 2013, ch. 7). Bounds are
//! therefore the best possible ones wherever Dekker's product is exact (results between 2^-900 and
//! 2^1000), and one neighbour wider beyond.
//!
//! **Nothing is silent.** There is no empty interval and no NaN. Where an operation is not defined
//! on all of its arguments (division by an interval that holds 0, the root of one that holds
//! negative numbers, the sign of one that holds both signs) the result is [`Interval::ENTIRE`]:
//! "nothing is known". Everything computed from it is `ENTIRE` too, even a product with zero or a
//! tanh, so that no inclusion can be verified by accident. Intersections say when they are empty.

use super::double_double::{two_product, two_sum};
use super::scalar::operators;
use super::{Arithmetic, Decimal, Dual, Elementary, FromDecimal, elementary};

/// All real numbers from `lower` to `upper`.
///
/// Neither bound is NaN, `lower <= upper`, `lower < inf`, `upper > -inf`. Equality is that of sets.
///
/// ```
/// use twofold_num::Interval;
/// let x = Interval::new(1.0, 2.0).unwrap();
/// let y = x * x - x; // x is taken twice: an enclosure, not the range
/// assert!(y.contains(0.0) && y.contains(2.0) && y.lower() >= -1.0 && y.upper() <= 3.0);
/// assert!((Interval::UNIT / Interval::UNIT).is_entire()); // division by an interval that holds 0
/// ```
#[derive(Clone, Copy, PartialEq)]
pub struct Interval {
    pub(super) lower: f64,
    pub(super) upper: f64,
}

/// Why there is no such interval.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// The bounds are not bounds.
    #[error(
        "no interval lies between {lower} and {upper}: give two numbers, the smaller one first"
    )]
    Bounds {
        /// The lower bound given.
        lower: f64,
        /// The upper bound given.
        upper: f64,
    },
    /// The intervals have no number in common.
    #[error(
        "{0:?} and {1:?} have no number in common: one of them cannot be an enclosure of the same \
            quantity"
    )]
    Disjoint(Interval, Interval),
}

/// Below this, Dekker's product may lose its low part to underflow.
const SMALL: f64 = f64::from_bits((1023 - 900) << 52);
/// Above this, it may overflow.
const LARGE: f64 = f64::from_bits((1023 + 1000) << 52);

/// The largest `f64` not above a + b.
#[inline]
fn add_down(a: f64, b: f64) -> f64 {
    // TwoSum overflows inside only if the sum does or a summand is next to overflow; the error is
    // NaN then (Boldo, Graillat & Muller 2017).
    let (s, e) = two_sum(a, b);
    if e >= 0.0 {
        s
    } else if e < 0.0 {
        s.next_down()
    } else if s == f64::INFINITY {
        f64::MAX
    } else if s.is_nan() {
        f64::NEG_INFINITY
    } else {
        s.next_down()
    }
}

/// The smallest `f64` not below a + b.
#[inline]
fn add_up(a: f64, b: f64) -> f64 {
    -add_down(-a, -b)
}

/// Whether a product or quotient of this size has an exact error.
#[inline]
fn exact_range(p: f64) -> bool {
    let m = p.abs();
    SMALL < m && m < LARGE
}

/// A lower bound of what rounds to `p` and lies on `p`'s side of zero or on zero.
#[inline]
fn below(p: f64, positive: bool) -> f64 {
    if p == f64::INFINITY {
        f64::MAX
    } else if positive {
        p.next_down().max(0.0)
    } else {
        p.next_down()
    }
}

/// A lower bound of a b, with 0 times infinity being 0 (the infinite end of an interval is no
/// member of it).
#[inline]
fn mul_down(a: f64, b: f64) -> f64 {
    if a == 0.0 || b == 0.0 {
        return 0.0;
    }
    let p = a * b;
    if exact_range(p) {
        let (_, e) = two_product(a, b);
        if e >= 0.0 {
            return p;
        }
        if e < 0.0 {
            return p.next_down();
        }
    }
    below(p, (a > 0.0) == (b > 0.0))
}

#[inline]
fn mul_up(a: f64, b: f64) -> f64 {
    -mul_down(-a, b)
}

/// A lower bound of a/b, b not zero.
#[inline]
fn div_down(a: f64, b: f64) -> f64 {
    if a == 0.0 {
        return 0.0;
    }
    let q = a / b;
    if exact_range(q) && exact_range(a) && exact_range(b) {
        let (p, e) = two_product(q, b);
        // p is next to a, so that a - p is exact (Sterbenz); the sign of the rounded difference is
        // that of a - q b.
        let rest = (a - p) - e;
        if rest == 0.0 || (rest > 0.0) == (b > 0.0) && !rest.is_nan() {
            return q;
        }
        return q.next_down();
    }
    below(q, (a > 0.0) == (b > 0.0))
}

#[inline]
fn div_up(a: f64, b: f64) -> f64 {
    -div_down(-a, b)
}

/// (lower, upper) bound of the root of x >= 0.
pub(super) fn sqrt_bounds(x: f64) -> (f64, f64) {
    let r = elementary::sqrt(x);
    if exact_range(x) {
        let (p, e) = two_product(r, r);
        let rest = (x - p) - e;
        return (
            if rest < 0.0 { r.next_down() } else { r },
            if rest > 0.0 { r.next_up() } else { r },
        );
    }
    if x == 0.0 {
        return (0.0, 0.0);
    }
    (below(r, true), r.next_up())
}

impl Interval {
    /// All real numbers: nothing is known.
    pub const ENTIRE: Self = Self { lower: f64::NEG_INFINITY, upper: f64::INFINITY };
    /// [-1, 1].
    pub const UNIT: Self = Self { lower: -1.0, upper: 1.0 };

    /// The numbers from `lower` to `upper`.
    ///
    /// # Errors
    /// [`Error::Bounds`] if a bound is NaN, `lower > upper`, or no real number lies between them.
    pub fn new(lower: f64, upper: f64) -> Result<Self, Error> {
        if lower <= upper && lower < f64::INFINITY && upper > f64::NEG_INFINITY {
            Ok(Self { lower, upper })
        } else {
            Err(Error::Bounds { lower, upper })
        }
    }

    /// From bounds that the caller has ordered; what is not a number becomes "nothing is known".
    #[inline]
    pub(super) fn ordered(lower: f64, upper: f64) -> Self {
        Self::new(lower, upper).unwrap_or(Self::ENTIRE)
    }

    /// The smallest interval that holds `a` and `b`.
    pub fn between(a: f64, b: f64) -> Self {
        Self::ordered(a.min(b), a.max(b))
    }

    /// The numbers within `radius` of zero; `ENTIRE` if `radius` is NaN or negative.
    #[inline]
    pub fn symmetric(radius: f64) -> Self {
        Self::ordered(-radius, radius)
    }

    /// The lower bound.
    #[inline]
    pub fn lower(self) -> f64 {
        self.lower
    }

    /// The upper bound.
    #[inline]
    pub fn upper(self) -> f64 {
        self.upper
    }

    /// A number in the middle, rounded; 0 for `ENTIRE`, a bound for half-infinite intervals.
    #[inline]
    pub fn midpoint(self) -> f64 {
        if self.lower == f64::NEG_INFINITY {
            return if self.upper == f64::INFINITY { 0.0 } else { self.upper };
        }
        if self.upper == f64::INFINITY {
            return self.lower;
        }
        // Halves first: the sum might overflow. Subnormal bounds may lose a bit, which the clamp
        // makes good.
        (0.5 * self.lower + 0.5 * self.upper).clamp(self.lower, self.upper)
    }

    /// upper - lower, rounded up.
    #[inline]
    pub fn width(self) -> f64 {
        add_up(self.upper, -self.lower)
    }

    /// The largest absolute value of a member.
    #[inline]
    pub fn magnitude(self) -> f64 {
        self.lower.abs().max(self.upper.abs())
    }

    /// The smallest absolute value of a member.
    #[inline]
    pub fn mignitude(self) -> f64 {
        if self.contains(0.0) { 0.0 } else { self.lower.abs().min(self.upper.abs()) }
    }

    /// Whether `x` is a member.
    #[inline]
    pub fn contains(self, x: f64) -> bool {
        self.lower <= x && x <= self.upper
    }

    /// Whether every member of `self` is one of `other`.
    #[inline]
    pub fn subset(self, other: Self) -> bool {
        other.lower <= self.lower && self.upper <= other.upper
    }

    /// Whether `self` lies in the interior of `other`. (Nothing contains `ENTIRE` in its interior,
    /// not even itself.)
    #[inline]
    pub fn interior(self, other: Self) -> bool {
        other.lower < self.lower && self.upper < other.upper
    }

    /// Whether every member is positive.
    #[inline]
    pub fn is_positive(self) -> bool {
        self.lower > 0.0
    }

    /// Whether every member is negative.
    #[inline]
    pub fn is_negative(self) -> bool {
        self.upper < 0.0
    }

    /// Whether nothing is known.
    #[inline]
    pub fn is_entire(self) -> bool {
        self == Self::ENTIRE
    }

    /// Whether both bounds are finite.
    #[inline]
    pub fn is_bounded(self) -> bool {
        self.lower > f64::NEG_INFINITY && self.upper < f64::INFINITY
    }

    /// The smallest interval that holds both.
    #[inline]
    pub fn hull(self, other: Self) -> Self {
        Self { lower: self.lower.min(other.lower), upper: self.upper.max(other.upper) }
    }

    /// The set of all numbers that lie in both.
    ///
    /// # Errors
    /// [`Error::Disjoint`] if no number does.
    pub fn intersection(self, other: Self) -> Result<Self, Error> {
        let (lower, upper) = (self.lower.max(other.lower), self.upper.min(other.upper));
        if lower <= upper { Ok(Self { lower, upper }) } else { Err(Error::Disjoint(self, other)) }
    }

    /// The exact square's enclosure: never negative.
    #[inline]
    pub(super) fn square(self) -> Self {
        if self.is_entire() {
            return Self::ENTIRE;
        }
        let (near, far) = (self.mignitude(), self.magnitude());
        Self { lower: mul_down(near, near), upper: mul_up(far, far) }
    }

    /// From the bounds of an increasing function, given by enclosures of its values at the ends.
    pub(super) fn increasing(self, f: impl Fn(f64) -> Interval) -> Self {
        if self.is_entire() {
            return Self::ENTIRE;
        }
        let (low, high) = (f(self.lower), f(self.upper));
        Self { lower: low.lower, upper: high.upper }
    }
}

impl std::fmt::Debug for Interval {
    /// The bounds, in the shortest digits that read back as the same numbers.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "[{:?}, {:?}]", self.lower, self.upper)
    }
}

operators! {
    impl [] Interval, inline:
    Add add(self, other) {
        Self { lower: add_down(self.lower, other.lower), upper: add_up(self.upper, other.upper) }
    }
    Sub sub(self, other) { self + -other }
    Mul mul(self, other) {
        let (a, b) = (self, other);
        if a.is_entire() || b.is_entire() {
            return Self::ENTIRE;
        }
        let (lower, upper) = if a.lower >= 0.0 {
            if b.lower >= 0.0 {
                (mul_down(a.lower, b.lower), mul_up(a.upper, b.upper))
            } else if b.upper <= 0.0 {
                (mul_down(a.upper, b.lower), mul_up(a.lower, b.upper))
            } else {
                (mul_down(a.upper, b.lower), mul_up(a.upper, b.upper))
            }
        } else if a.upper <= 0.0 {
            if b.lower >= 0.0 {
                (mul_down(a.lower, b.upper), mul_up(a.upper, b.lower))
            } else if b.upper <= 0.0 {
                (mul_down(a.upper, b.upper), mul_up(a.lower, b.lower))
            } else {
                (mul_down(a.lower, b.upper), mul_up(a.lower, b.lower))
            }
        } else if b.lower >= 0.0 {
            (mul_down(a.lower, b.upper), mul_up(a.upper, b.upper))
        } else if b.upper <= 0.0 {
            (mul_down(a.upper, b.lower), mul_up(a.lower, b.lower))
        } else {
            (
                mul_down(a.lower, b.upper).min(mul_down(a.upper, b.lower)),
                mul_up(a.lower, b.lower).max(mul_up(a.upper, b.upper)),
            )
        };
        Self { lower, upper }
    }
    Div div(self, other) {
        let (a, b) = (self, other);
        if a.is_entire() || b.contains(0.0) {
            return Self::ENTIRE;
        }
        if b.upper < 0.0 {
            return -a / -b;
        }
        // The numerator's end, and the end of the positive denominator that makes the quotient
        // extreme.
        let lower = div_down(a.lower, if a.lower >= 0.0 { b.upper } else { b.lower });
        let upper = div_up(a.upper, if a.upper <= 0.0 { b.upper } else { b.lower });
        Self { lower, upper }
    }
    -(self) { Self { lower: -self.upper, upper: -self.lower } }
}

impl Arithmetic for Interval {
    /// The set {value}; `ENTIRE` if `value` is not finite.
    #[inline]
    fn from_f64(value: f64) -> Self {
        Self::ordered(value, value)
    }
    #[inline]
    fn squared(self) -> Self {
        self.square()
    }
}

/// Position of the shortest decimal number that reads as an `f64`, relative to it. It is never
/// farther away than half the spacing to the next.
pub(super) enum Side {
    Exact,
    Above,
    Below,
    /// Within half a spacing; on which side is not known (numbers beyond 1e-22 ... 1e15).
    Near,
}

pub(super) fn side(value: f64) -> Side {
    if !value.is_finite() {
        return Side::Near;
    }
    if value == 0.0 {
        return Side::Exact;
    }
    let (digits, exponent) = shortest_decimal(value);
    if exponent >= 0 && value.abs() < 9e15 {
        return Side::Exact; // an integer below 2^53
    }
    if !(-22..0).contains(&exponent) {
        return Side::Near;
    }
    // 10^22 is the largest power of ten that an f64 holds; all up to it are exact.
    let power = (0..-exponent).fold(1.0_f64, |p, _| p * 10.0);
    // |value| 10^k = p + e exactly; digits = high + low exactly. All are far from under- and overflow.
    let (p, e) = two_product(value.abs(), power);
    let high = digits as f64;
    let low = (i128::from(digits) - high as i128) as f64;
    // p and high are neighbours (or equal): their difference is exact, and the rest is small beside
    // its spacing.
    let (d, rest) = two_sum(high - p, low);
    let difference = d + (rest - e);
    match difference.partial_cmp(&0.0) {
        Some(std::cmp::Ordering::Equal) => Side::Exact,
        Some(order) if (order == std::cmp::Ordering::Greater) == (value > 0.0) => Side::Above,
        _ => Side::Below,
    }
}

/// |value| = digits 10^exponent in the shortest digits that read back as the same number (at most 17).
fn shortest_decimal(value: f64) -> (u64, i32) {
    // Rust prints them the same on every platform.
    let text = format!("{:e}", value.abs());
    let (mantissa, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let mut exponent: i32 = exponent.parse().unwrap_or(0);
    let mut digits: u64 = 0;
    let mut after_point = false;
    for c in mantissa.chars() {
        if let Some(digit) = c.to_digit(10) {
            digits = digits * 10 + u64::from(digit);
            exponent -= i32::from(after_point);
        } else {
            after_point |= c == '.';
        }
    }
    (digits, exponent)
}

impl<S: Arithmetic + FromDecimal, const N: usize> FromDecimal for Dual<S, N> {
    fn from_decimal(number: &Decimal) -> Self {
        Self::constant(S::from_decimal(number))
    }
}

/// A number that stands for a set of reals: what validated integration computes with.
///
/// Two precisions: [`Interval`], and [`Ball`](crate::Ball) with about 32 digits. Wide sets
/// (remainders, errors, derivatives) are always held as [`Interval`]s; only the points that they
/// surround need the precision.
pub trait Enclosure: Elementary + FromDecimal {
    /// The set of all numbers in an interval.
    fn from_interval(interval: Interval) -> Self;
    /// The set's hull in `f64`, rounded outward.
    fn interval(self) -> Interval;
    /// A point c near the middle, as a set of one number, and an enclosure of self - c.
    fn split(self) -> (Self, Interval);
}

impl Enclosure for Interval {
    #[inline]
    fn from_interval(interval: Interval) -> Self {
        interval
    }
    #[inline]
    fn interval(self) -> Interval {
        self
    }
    #[inline]
    fn split(self) -> (Self, Interval) {
        let c = Self::from_f64(self.midpoint());
        (c, self - c)
    }
}

#[cfg(test)]
mod tests;
