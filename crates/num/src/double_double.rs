//! Double-double numbers: about 106 bits from pairs of `f64`.
//!
//! A value is an unevaluated sum `high + low` with |low| at most half an ulp of `high`. The
//! building blocks are the error-free sum of Knuth (1969; TAOCP vol. 2, sec. 4.2.2) and the
//! error-free product of Dekker (1971); the algorithms on top follow Hida, Li & Bailey (2001). Only
//! IEEE 754 additions, multiplications and divisions are used, no fused multiply-add, so the bits
//! are the same on every machine.
//!
//! The range is that of `f64`, less a margin: Dekker's splitting overflows beyond about 1e300, and
//! products below about 1e-290 lose their low parts.

mod products;

use std::cmp::Ordering;

use super::scalar::operators;
use super::{Arithmetic, Elementary, Scalar};

/// A number of about 106 bits (32 decimal digits).
///
/// ```
/// use twofold_num::{Arithmetic, DoubleDouble};
/// let third = DoubleDouble::from_f64(1.0) / DoubleDouble::from_f64(3.0);
/// let error = DoubleDouble::from_f64(1.0) - third * DoubleDouble::from_f64(3.0);
/// assert!(error.abs().high() < 1e-31);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DoubleDouble {
    high: f64,
    low: f64,
}

/// a + b = s + e exactly (Knuth).
#[inline]
pub(super) const fn two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    let bb = s - a;
    (s, (a - (s - bb)) + (b - bb))
}

/// a + b = s + e exactly, for |a| >= |b| (Dekker 1971).
#[inline]
const fn quick_two_sum(a: f64, b: f64) -> (f64, f64) {
    let s = a + b;
    (s, b - (s - a))
}

/// 2^27 + 1.
const SPLITTER: f64 = 134_217_729.0;

/// a = high + low, each of at most 26 bits (Dekker 1971, after Veltkamp).
#[inline]
const fn split(a: f64) -> (f64, f64) {
    let t = SPLITTER * a;
    let high = t - (t - a);
    (high, a - high)
}

/// a b = p + e exactly, unless a part over- or underflows (Dekker 1971).
#[inline]
pub(super) const fn two_product(a: f64, b: f64) -> (f64, f64) {
    let p = a * b;
    let ((a1, a2), (b1, b2)) = (split(a), split(b));
    (p, ((a1 * b1 - p) + a1 * b2 + a2 * b1) + a2 * b2)
}

/// 2^k for -1022 <= k <= 1023.
fn power_of_two(k: i32) -> f64 {
    f64::from_bits(((1023 + i64::from(k)) as u64) << 52)
}

impl DoubleDouble {
    /// Spacing of numbers near 1, about: 2^-105. Operations err by a few of these.
    pub const EPSILON: f64 = 2.465_190_328_815_662e-32;
    /// Zero.
    pub const ZERO: Self = Self { high: 0.0, low: 0.0 };
    /// ln 2.
    pub const LN_2: Self = Self { high: std::f64::consts::LN_2, low: 2.319_046_813_846_299_6e-17 };
    /// pi.
    pub const PI: Self = Self { high: std::f64::consts::PI, low: 1.224_646_799_147_353_2e-16 };
    /// pi/2, and the part that does not fit (for argument reduction).
    pub(super) const HALF_PI: Self =
        Self { high: std::f64::consts::FRAC_PI_2, low: 6.123_233_995_736_766e-17 };
    pub(super) const HALF_PI_REST: f64 = -1.497_384_904_859_169_8e-33;
    /// Doublings that undo the division by [`Self::REDUCTION`] in exp.
    const HALVINGS: u32 = 9;
    const REDUCTION: f64 = 512.0;

    /// The number `high + low`, for parts of any size.
    #[inline]
    pub const fn new(high: f64, low: f64) -> Self {
        let (high, low) = two_sum(high, low);
        Self { high, low }
    }

    /// The shortest decimal number that reads as `value`: `from_decimal(0.1)` is one tenth, to 106
    /// bits.
    pub fn from_decimal(value: f64) -> Self {
        if !value.is_finite() {
            return Self::from_f64(value);
        }
        // Rust prints the shortest digits that read back as the same number, on every platform.
        Self::from_digits(&format!("{value:e}")).unwrap_or(Self::from_f64(value))
    }

    /// The decimal number written as `text`: digits, point, exponent. `None` if it is not one.
    /// Digits beyond the 32nd or so are rounded.
    pub fn from_digits(text: &str) -> Option<Self> {
        let (digits, exponent) = match text.split_once(['e', 'E']) {
            Some((digits, exponent)) => (digits, exponent.parse::<i32>().ok()?),
            None => (text, 0),
        };
        let unsigned = digits.strip_prefix(['-', '+']).unwrap_or(digits);
        let mut exponent = exponent.clamp(-2000, 2000);
        let mut number = Self::zero();
        let (mut after_point, mut any) = (false, false);
        for c in unsigned.chars() {
            match c {
                '0'..='9' => {
                    // Exact up to 31 digits.
                    number = number.times_f64(10.0).plus_f64(f64::from(c as u8 - b'0'));
                    exponent -= i32::from(after_point);
                    any = true;
                }
                '.' if !after_point => after_point = true,
                _ => return None,
            }
        }
        if !any {
            return None;
        }
        if number.high == 0.0 {
            return Some(number);
        }
        let ten = Self::from_f64(10.0);
        let power = (0..exponent.abs()).fold(Self::one(), |power, _| power * ten);
        let number = if exponent < 0 { number / power } else { number * power };
        Some(if digits.starts_with('-') { -number } else { number })
    }

    /// The nearest `f64`.
    #[inline]
    pub const fn high(self) -> f64 {
        self.high
    }

    /// The part that [`DoubleDouble::high`] leaves out.
    #[inline]
    pub const fn low(self) -> f64 {
        self.low
    }

    /// The absolute value.
    #[inline]
    pub fn abs(self) -> Self {
        if self.high < 0.0 { -self } else { self }
    }

    /// The accurate sum: relative error below 2 EPSILON also under cancellation.
    #[inline]
    pub(super) const fn plus(self, other: Self) -> Self {
        let (s, e) = two_sum(self.high, other.high);
        let (t, f) = two_sum(self.low, other.low);
        let (s, e) = quick_two_sum(s, e + t);
        let (high, low) = quick_two_sum(s, e + f);
        Self { high, low }
    }

    #[inline]
    pub(super) const fn negative(self) -> Self {
        Self { high: -self.high, low: -self.low }
    }

    #[inline]
    pub(super) const fn times(self, other: Self) -> Self {
        let (p, e) = two_product(self.high, other.high);
        let (high, low) = quick_two_sum(p, e + (self.high * other.low + self.low * other.high));
        Self { high, low }
    }

    /// Long division: three quotients.
    #[inline]
    pub(super) const fn divided_by(self, other: Self) -> Self {
        let q1 = self.high / other.high;
        let r = self.plus(other.times_f64(q1).negative());
        let q2 = r.high / other.high;
        let r = r.plus(other.times_f64(q2).negative());
        let q3 = r.high / other.high;
        let (high, low) = quick_two_sum(q1, q2);
        Self { high, low }.plus_f64(q3)
    }

    #[inline]
    const fn times_f64(self, b: f64) -> Self {
        let (p, e) = two_product(self.high, b);
        let (high, low) = quick_two_sum(p, e + self.low * b);
        Self { high, low }
    }

    #[inline]
    const fn plus_f64(self, b: f64) -> Self {
        let (s, e) = two_sum(self.high, b);
        let (high, low) = quick_two_sum(s, e + self.low);
        Self { high, low }
    }

    /// self * 2^k; exact unless it over- or underflows.
    pub(super) fn times_power_of_two(self, k: i32) -> Self {
        // In two halves, because 2^k itself may leave the range although the product does not.
        let (a, b) = (
            power_of_two((k / 2).clamp(-1022, 1023)),
            power_of_two((k - k / 2).clamp(-1022, 1023)),
        );
        Self { high: self.high * a * b, low: self.low * a * b }
    }

    /// exp(self) - 1 for |self| < 0.36: Taylor series of self/512, then e^(2a) - 1 = 2 (e^a - 1) +
    /// (e^a - 1)^2 nine times (Hida, Li & Bailey 2001). Without the 1, nothing is lost for small
    /// arguments.
    fn small_exp_m1(self) -> Self {
        let r = self.times_f64(1.0 / Self::REDUCTION);
        let (mut term, mut sum) = (r, r);
        // (0.36/512)^10/10! < 1e-38, relative to a sum of the size of r: 2e-35.
        for n in 2..11 {
            term = term * r / Self::from_f64(f64::from(n));
            sum += term;
        }
        for _ in 0..Self::HALVINGS {
            sum = sum.times_f64(2.0) + sum * sum;
        }
        sum
    }

    /// (sin, cos), by reduction modulo pi/2 and Taylor series. The reduction keeps about 160 bits
    /// of pi: good for arguments up to about 1e15.
    fn sin_cos(self) -> (Self, Self) {
        if !self.high.is_finite() {
            let nan = Self::from_f64(f64::NAN);
            return (nan, nan);
        }
        let quadrant = (self.high / Self::HALF_PI.high).round();
        let r = (self - Self::HALF_PI.times_f64(quadrant)).plus_f64(-quadrant * Self::HALF_PI_REST);
        let square = r * r;
        let (mut sin, mut cos) = (r, Self::one());
        let (mut sin_term, mut cos_term) = (r, Self::one());
        // |r| <= pi/4 + a little: the last terms are below 1e-36.
        for n in 1..15 {
            let k = f64::from(2 * n);
            cos_term = -(cos_term * square) / Self::from_f64(k * (k - 1.0));
            sin_term = -(sin_term * square) / Self::from_f64(k * (k + 1.0));
            cos += cos_term;
            sin += sin_term;
        }
        match quadrant.rem_euclid(4.0) as u8 {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }
}

impl PartialOrd for DoubleDouble {
    #[inline]
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        match self.high.partial_cmp(&other.high) {
            Some(Ordering::Equal) => self.low.partial_cmp(&other.low),
            order => order,
        }
    }
}

operators! {
    impl [] DoubleDouble, inline:
    Add add(self, other) { self.plus(other) }
    Sub sub(self, other) { self + -other }
    Mul mul(self, other) { self.times(other) }
    // Three quotients; two by an `f64`.
    Div div(self, other) {
        if other.low == 0.0 { self.over(other.high) } else { self.divided_by(other) }
    }
    -(self) { self.negative() }
}

impl Arithmetic for DoubleDouble {
    const EXACT_ZEROS: bool = true;

    #[inline]
    fn from_f64(value: f64) -> Self {
        Self { high: value, low: 0.0 }
    }
    #[inline]
    fn scale(self, factor: f64) -> Self {
        self.times_f64(factor)
    }
    /// Two quotients: the remainder of the first is known exactly.
    #[inline]
    fn over(self, divisor: f64) -> Self {
        let quotient = self.high / divisor;
        let (product, error) = two_product(quotient, divisor);
        let remainder = ((self.high - product) - error) + self.low;
        let (high, low) = quick_two_sum(quotient, remainder / divisor);
        Self { high, low }
    }
    #[inline]
    fn sum_of_products(a: &[Self], b: &[Self]) -> Self {
        products::sum_of_products(a, b)
    }
}

impl Scalar for DoubleDouble {
    #[inline]
    fn to_f64(self) -> f64 {
        self.high
    }
}

impl Elementary for DoubleDouble {
    fn tanh(self) -> Self {
        // 1 - tanh w < 2 exp(-2 w): beyond this the nearest number is +-1.
        if self.high.abs() >= 38.0 {
            return Self::from_f64(1.0_f64.copysign(self.high));
        }
        if self.high.abs() < 0.17 {
            let e = self.times_f64(2.0).small_exp_m1();
            e / (e + Self::from_f64(2.0))
        } else {
            let w = self.abs();
            let t = Self::one() - Self::from_f64(2.0) / (w.times_f64(2.0).exp() + Self::one());
            if self.high < 0.0 { -t } else { t }
        }
    }
    fn exp(self) -> Self {
        if self.high > 709.0 {
            return Self::from_f64(f64::INFINITY);
        }
        if self.high < -745.0 {
            return Self::zero();
        }
        if self.high.is_nan() {
            return self;
        }
        let k = (self.high / Self::LN_2.high).round();
        let r = self - Self::LN_2.times_f64(k);
        (r.small_exp_m1() + Self::one()).times_power_of_two(k as i32)
    }
    fn sin(self) -> Self {
        self.sin_cos().0
    }
    fn cos(self) -> Self {
        self.sin_cos().1
    }
    fn ln(self) -> Self {
        if !(self.high > 0.0 && self.high.is_finite()) {
            return Self::from_f64(super::elementary::ln(self.high));
        }
        if (self.high - 1.0).abs() < 0.1 {
            // 2 atanh z, z = (x - 1)/(x + 1): keeps the relative precision where the logarithm is
            // small. |z| < 0.053.
            let z = (self - Self::one()) / (self + Self::one());
            let square = z * z;
            let (mut power, mut sum) = (z, z);
            for n in 1..14 {
                power = power * square;
                sum += power / Self::from_f64(f64::from(2 * n + 1));
            }
            return sum.times_f64(2.0);
        }
        // One Newton step of exp(y) = x from the f64 logarithm doubles its 53 bits.
        let y = Self::from_f64(super::elementary::ln(self.high));
        // exp(-y) leaves the range before x does: through exp(-y/2).
        let root = (-y).times_f64(0.5).exp();
        y + (self * root * root - Self::one())
    }
    fn atan(self) -> Self {
        if self.high.is_nan() || self.high == 0.0 {
            return self;
        }
        if self.high.abs() > 1e33 {
            // pi/2 - 1/x, and 1/x is below the last digit.
            return if self.high < 0.0 { -Self::HALF_PI } else { Self::HALF_PI };
        }
        // One Newton step of tan(y) = x from the f64 arc tangent.
        let y = Self::from_f64(super::elementary::atan(self.high));
        let (sin, cos) = y.sin_cos();
        y + (self * cos - sin) / (cos + self * sin)
    }
    fn erf(self) -> Self {
        // 1 - erf x < exp(-x^2)/x: beyond this the nearest number is +-1.
        if self.high.abs() >= 8.7 {
            return Self::from_f64(1.0_f64.copysign(self.high));
        }
        if self.high.is_nan() {
            return self;
        }
        // erf x = 2/sqrt(pi) exp(-x^2) sum of 2^n x^(2n+1)/(1 3 5 ... (2n+1)): no cancellation
        // (Abramowitz & Stegun 7.1.6).
        let square = self * self;
        let (mut term, mut sum) = (self, self);
        let mut n = 1.0;
        while term.high.abs() > 1e-34 * sum.high.abs() {
            term = (term * square).times_f64(2.0) / Self::from_f64(2.0 * n + 1.0);
            sum += term;
            n += 1.0;
        }
        (-square).exp() * sum * (Self::from_f64(2.0) / Self::PI.sqrt())
    }
    fn pi() -> Self {
        Self::PI
    }
    fn sign(self) -> Self {
        Self::from_f64(self.high.sign())
    }
    fn sqrt(self) -> Self {
        if self.high == 0.0 {
            return self;
        }
        // One Newton step from the f64 root doubles its 53 bits (Karp & Markstein 1997).
        let root = super::elementary::sqrt(self.high);
        let (square, e) = two_product(root, root);
        let rest = self - Self { high: square, low: e };
        let (high, low) = quick_two_sum(root, rest.high * (0.5 / root));
        Self { high, low }
    }
}

#[cfg(test)]
#[allow(clippy::approx_constant)] // constants are compared digit by digit
mod tests {
    use super::*;
    use crate::MultiFloat;
    use proptest::prelude::*;

    fn dd(x: f64) -> DoubleDouble {
        DoubleDouble::from_f64(x)
    }

    /// Relative difference.
    fn gap(a: DoubleDouble, b: DoubleDouble) -> f64 {
        ((a - b).to_f64() / b.to_f64()).abs()
    }

    /// Checks `got` against the first 32 digits or so of a constant, given as high and low part.
    #[track_caller]
    fn is(got: DoubleDouble, high: f64, low: f64) {
        let g = gap(got, DoubleDouble::new(high, low));
        assert!(g < 1e-30, "{got:?}, expected {high:e} + {low:e}: {g:e}");
    }

    #[test]
    fn known_constants() {
        // High and low parts computed in 60-digit decimal arithmetic outside this project.
        is(dd(1.0).exp(), 2.718281828459045, 1.4456468917292502e-16);
        is(dd(-30.5).exp(), 5.675685232632723e-14, -2.744021414416088e-30);
        is(dd(2.0).sqrt(), 1.4142135623730951, -9.667293313452913e-17);
        is(dd(0.5).tanh(), 0.46211715726000974, 2.1916603238260928e-17);
        is(dd(0.0625).tanh(), 0.062418746747512514, 1.5112489404944624e-19);
        is(dd(-0.0009765625).tanh(), -0.0009765621895592603, 4.341379977097105e-20);
        is(dd(3.0).tanh(), 0.9950547536867305, -1.2991892863562624e-17);
        is(dd(-10.0).tanh(), -0.9999999958776927, -3.693278996616596e-17);
        is(dd(1.0).sin(), 0.8414709848078965, 1.776845092935536e-18);
        is(dd(1.0).cos(), 0.5403023058681398, -4.760954612604417e-17);
        is(dd(0.25).sin(), 0.24740395925452294, -7.53102495590706e-18);
        is(dd(10.0).sin(), -0.5440211108893698, -3.8949898668223557e-17);
        is(dd(10.0).cos(), -0.8390715290764524, -1.4147119988953418e-17);
        is(dd(-22.5).sin(), 0.4871745124605095, 3.1743994890493315e-18);
        is(dd(-22.5).cos(), -0.8733046400935156, -1.3966221885427957e-17);
        is(dd(2.0).ln(), 0.6931471805599453, 2.3190468138462996e-17);
        is(dd(10.0).ln(), 2.302585092994046, -2.1707562233822494e-16);
        is(dd(1.0625).ln(), 0.06062462181643484, 2.6424025938726934e-18);
        is(dd(0.9990234375).ln(), -0.0009770396478266127, -4.348919509358116e-20);
        is(dd(1e-300).ln(), -690.7755278982137, -2.3670096176709832e-14);
        is(dd(1e+300).ln(), 690.7755278982137, 2.3747660028800243e-14);
        is(dd(1.0).atan(), 0.7853981633974483, 3.061616997868383e-17);
        is(dd(0.25).atan(), 0.24497866312686414, 1.0698755618734451e-17);
        is(dd(-3.0).atan(), -1.2490457723982544, 2.196203799612311e-18);
        is(dd(10000000000.0).atan(), 1.5707963266948965, 6.950637705727703e-17);
        is(dd(1e-05).atan(), 9.999999999666668e-06, -4.575803486027043e-22);
        is(dd(0.5).erf(), 0.5204998778130465, 1.900077467916287e-17);
        is(dd(0.001).erf(), 0.0011283787909692365, -7.88735357945236e-20);
        is(dd(-2.0).erf(), -0.9953222650189527, -2.20719858329765e-17);
        is(dd(5.0).erf(), 0.9999999999984626, -2.294992711807301e-17);
        is(dd(8.0).erf(), 1.0, -1.1224297172982926e-29);
    }

    #[test]
    fn arithmetic_keeps_what_f64_loses() {
        let third = dd(1.0) / dd(3.0);
        is(third, 1.0 / 3.0, 1.850371707708594e-17);
        assert!(gap(third + third + third, dd(1.0)) < 2.0 * DoubleDouble::EPSILON);
        let tiny = dd(1e-25);
        assert_eq!((dd(1.0) + tiny) - dd(1.0), tiny - (tiny - ((dd(1.0) + tiny) - dd(1.0))));
        assert!(gap((dd(1.0) + tiny) - dd(1.0), tiny) < 1e-6);
        assert!(dd(1.0) + tiny > dd(1.0) && dd(1.0) - tiny < dd(1.0));
    }

    #[test]
    fn decimals() {
        for (value, n, d) in
            [(0.1, 1.0, 10.0), (-1.2, -6.0, 5.0), (1e-5, 1.0, 1e5), (12345.678, 12345678.0, 1000.0)]
        {
            assert!(
                gap(DoubleDouble::from_decimal(value), dd(n) / dd(d)) < 4.0 * DoubleDouble::EPSILON,
                "{value}"
            );
        }
        for exact in [0.0, 0.5, -3.0, 1e20] {
            assert_eq!(DoubleDouble::from_decimal(exact), dd(exact));
        }
        assert_eq!(DoubleDouble::from_decimal(0.2).to_f64(), 0.2);
        assert_eq!(DoubleDouble::from_decimal(f64::INFINITY).to_f64(), f64::INFINITY);
    }

    #[test]
    fn tanh_saturates_exactly() {
        for w in [38.0, 40.0, 1e300] {
            assert_eq!(dd(w).tanh(), dd(1.0));
            assert_eq!(dd(-w).tanh(), dd(-1.0));
        }
        assert!(dd(35.0).tanh() < dd(1.0));
    }

    #[test]
    fn ends_of_the_range() {
        assert_eq!(dd(1000.0).exp().to_f64(), f64::INFINITY);
        assert_eq!(dd(-1000.0).exp(), dd(0.0));
        assert!(dd(f64::NAN).exp().to_f64().is_nan());
        assert!(dd(f64::NAN).tanh().to_f64().is_nan());
        assert!(dd(f64::INFINITY).sin().to_f64().is_nan());
        assert_eq!(dd(0.0).sqrt(), dd(0.0));
        assert!(dd(-1.0).sqrt().to_f64().is_nan());
    }

    /// A number with both parts in use.
    fn any() -> impl Strategy<Value = DoubleDouble> {
        (-20.0..20.0_f64, -0.4..0.4_f64)
            .prop_map(|(a, b)| DoubleDouble::new(a, a * b * f64::EPSILON))
    }

    const U: f64 = DoubleDouble::EPSILON;

    proptest! {
        #[test]
        fn field_identities(a in any(), b in any(), c in any()) {
            prop_assume!(a.high.abs() > 1e-3 && b.high.abs() > 1e-3);
            prop_assert!(gap(a * b / b, a) < 8.0 * U);
            prop_assert!(gap((a / b) * b, a) < 8.0 * U);
            let scale = a.high.abs() + b.high.abs() + c.high.abs();
            prop_assert!(((a + b) - b - a).high.abs() <= 4.0 * U * scale);
            prop_assert!(((a + b) * c - (a * c + b * c)).high.abs() <= 16.0 * U * scale * scale);
            prop_assert_eq!(a * b, b * a);
            prop_assert_eq!(a.partial_cmp(&b), (a - b).high.partial_cmp(&0.0));
            prop_assert!(a.low.abs() <= 0.5 * f64::EPSILON * a.high.abs());
        }

        #[test]
        fn sqrt_squares_back(a in any()) {
            prop_assume!(a.high != 0.0);
            prop_assert!(gap(a.abs().sqrt() * a.abs().sqrt(), a.abs()) < 8.0 * U);
        }

        #[test]
        fn exp_and_trigonometry(a in any(), b in any()) {
            // Relative error of exp grows with the argument's own error: 20 U here.
            prop_assert!(gap(a.exp() * b.exp(), (a + b).exp()) < 400.0 * U);
            let (s, c) = a.sin_cos();
            prop_assert!((s * s + c * c - dd(1.0)).high.abs() < 16.0 * U);
            let (s2, c2) = b.sin_cos();
            prop_assert!(((a + b).sin() - (s * c2 + c * s2)).high.abs() < 64.0 * U);
            prop_assert!(((a + b).cos() - (c * c2 - s * s2)).high.abs() < 64.0 * U);
        }

        #[test]
        fn logarithm_arc_tangent_error_function(a in any(), b in any()) {
            prop_assume!(a.high.abs() > 1e-3 && b.high.abs() > 1e-3);
            let sum = a.abs().ln() + b.abs().ln();
            prop_assert!(((a * b).abs().ln() - sum).high.abs() < 64.0 * U * (1.0 + sum.high.abs()));
            let t = a.atan();
            prop_assert!(gap(t.sin(), a * t.cos()) < 32.0 * U);
            prop_assert_eq!((-a).erf(), -a.erf());
            // The derivative, by a difference that double-double precision affords.
            let h = dd(1e-10);
            let slope = ((a + h).erf() - (a - h).erf()) / dd(2e-10);
            let want = (-(a * a)).exp() * dd(2.0) / DoubleDouble::PI.sqrt();
            prop_assert!((slope - want).high.abs() < 1e-18, "{:?} {:?}", slope, want);
        }

        #[test]
        fn tanh_doubles(a in any(), small in -0.2..0.2_f64) {
            for a in [a, dd(small)] {
                prop_assume!(a.high != 0.0);
                // tanh 2a = 2 t/(1 + t^2)
                let t = a.tanh();
                let double = (t + t) / (dd(1.0) + t * t);
                prop_assert!(gap((a + a).tanh(), double) < 32.0 * U);
            }
        }

        #[test]
        fn high_parts_agree_with_f64(a in -20.0..20.0_f64) {
            for (extended, plain) in [
                (dd(a).exp(), Elementary::exp(a)), (dd(a).sin(), Elementary::sin(a)),
                (dd(a).cos(), Elementary::cos(a)), (dd(a).tanh(), Elementary::tanh(a)),
                (dd(a).atan(), Elementary::atan(a)), (dd(a).erf(), Elementary::erf(a)),
                (dd(a).abs().ln(), Elementary::ln(a.abs())),
            ] {
                prop_assert!((extended.to_f64() - plain).abs() <= 4e-16 * plain.abs().max(1e-10),
                    "{extended:?} {plain}");
            }
        }
    }

    /// If all large terms cancel, the errors of the low parts remain.
    #[test]
    fn cancellation_leaves_every_bit() {
        let (a, b) = (
            DoubleDouble::new(1.0, 2.0_f64.powi(-60)),
            DoubleDouble::new(-1.0, 2.0_f64.powi(-115)),
        );
        let sum = a + b;
        assert_eq!((sum.high(), sum.low()), (2.0_f64.powi(-60), 2.0_f64.powi(-115)));
        let mut difference = a;
        difference -= -b;
        assert_eq!(difference, sum);
        assert_eq!((dd(1.0) / dd(3.0)).low(), 1.850_371_707_708_594e-17);
    }

    /// pi, to 106 bits, is not pi: its sine is what is missing, 2.99e-33, and a half, a quarter and
    /// so on.
    #[test]
    fn multiples_of_pi_miss_by_what_was_rounded_away() {
        let close = |a: DoubleDouble, b: f64| {
            assert!((a.high() / b - 1.0).abs() < 1e-9, "{a:?} is not {b:e}")
        };
        close(DoubleDouble::PI.sin(), -2.994_769_809_718_339_7e-33);
        close(DoubleDouble::HALF_PI.cos(), -1.497_384_904_859_169_8e-33);
        close((-DoubleDouble::PI).sin(), 2.994_769_809_718_339_7e-33);
        close(DoubleDouble::PI.times_f64(4.0).sin(), 1.197_907_923_887_335_9e-32);
    }

    proptest! {
        #[test]
        fn a_quotient_by_a_small_number(a in any(), n in 1_u32..2000) {
            // In twice the digits: a - n a/n, exactly.
            let exact = |x: DoubleDouble| MultiFloat::<4>::from_f64(x.high)
                + MultiFloat::from_f64(x.low);
            let quotient = a.over(f64::from(n));
            let error = (exact(a) - exact(quotient)
                * MultiFloat::from_f64(f64::from(n))).to_f64().abs();
            prop_assert!(error <= 2.0 * DoubleDouble::EPSILON * a.high.abs(), "{a:?} / {n}: \
                {error:e}");
            prop_assert_eq!(quotient, a / DoubleDouble::from_f64(f64::from(n)));
        }
    }

    #[test]
    fn texts_that_are_no_numbers() {
        for text in ["", ".", "1.2.3", "1e", "1x", "--1", "e5"] {
            assert_eq!(DoubleDouble::from_digits(text), None, "{text}");
        }
        assert_eq!(DoubleDouble::from_digits("-12.5E1"), Some(dd(-125.0)));
        assert_eq!(DoubleDouble::from_digits("+.5"), Some(dd(0.5)));
        assert!(dd(0.0).abs().high().is_sign_positive());
    }

    #[test]
    fn ends_of_the_logarithm_and_the_arc_tangent() {
        assert_eq!(dd(f64::INFINITY).ln().to_f64(), f64::INFINITY);
        assert_eq!(dd(0.0).ln().to_f64(), f64::NEG_INFINITY);
        assert!(dd(-1.0).ln().to_f64().is_nan() && dd(f64::NAN).atan().to_f64().is_nan());
        assert_eq!(
            (dd(1e40).atan(), dd(-1e40).atan()),
            (DoubleDouble::HALF_PI, -DoubleDouble::HALF_PI)
        );
        assert_eq!(dd(f64::NEG_INFINITY).atan(), -DoubleDouble::HALF_PI);
        // An argument for which the second term of a series is still within the digits: erf x =
        // 2/sqrt(pi) (x - x^3/3).
        let x = dd(1e-10);
        let want = (x - x * x * x / dd(3.0)) * dd(2.0) / DoubleDouble::PI.sqrt();
        assert!(gap(x.erf(), want) < 1e-30);
    }
}
