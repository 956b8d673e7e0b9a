//! Exact numbers: fractions of whole numbers of any size, and intervals of them.

use std::cmp::Ordering;
use std::fmt;
use std::ops::{Add, Mul, Neg, Sub};

use num_bigint::{BigInt, Sign};

/// A fraction. The denominator is positive; common factors of two are removed, others need not be.
#[derive(Clone, Debug)]
pub struct Rational {
    numerator: BigInt,
    denominator: BigInt,
}

impl Rational {
    fn new(numerator: BigInt, denominator: BigInt) -> Self {
        // Almost all denominators are powers of two, because the numbers were floating-point numbers.
        let twos = |n: &BigInt| n.trailing_zeros();
        let shift = twos(&numerator).unwrap_or(0).min(twos(&denominator).unwrap_or(0));
        Self { numerator: numerator >> shift, denominator: denominator >> shift }
    }

    /// A whole number.
    pub fn whole(n: i64) -> Self {
        Self { numerator: n.into(), denominator: 1.into() }
    }

    /// One over a power of ten.
    pub fn tenth_to(power: u32) -> Self {
        Self::new(1.into(), BigInt::from(10).pow(power))
    }

    /// The number that a floating-point number is; `None` for infinities and not-a-number.
    pub fn exactly(value: f64) -> Option<Self> {
        if !value.is_finite() {
            return None;
        }
        let bits = value.to_bits();
        let (exponent, fraction) = (((bits >> 52) & 0x7ff) as i64, bits & ((1 << 52) - 1));
        let (mantissa, exponent) =
            if exponent == 0 { (fraction, -1074) } else { (fraction | (1 << 52), exponent - 1075) };
        let mut numerator = BigInt::from(mantissa);
        let mut denominator = BigInt::from(1);
        if exponent >= 0 {
            numerator <<= exponent as usize;
        } else {
            denominator <<= (-exponent) as usize;
        }
        Some(Self::new(if value.is_sign_negative() { -numerator } else { numerator }, denominator))
    }

    /// The decimal number written as `text`; `None` if it is not one.
    pub fn decimal(text: &str) -> Option<Self> {
        let (digits, exponent) = match text.split_once(['e', 'E']) {
            Some((digits, exponent)) => (digits, exponent.parse::<i64>().ok()?),
            None => (text, 0),
        };
        let (whole, part) = digits.split_once('.').unwrap_or((digits, ""));
        let all: String = format!("{whole}{part}");
        let unsigned = all.strip_prefix(['-', '+']).unwrap_or(&all);
        if unsigned.is_empty() || !unsigned.bytes().all(|b| b.is_ascii_digit()) {
            return None;
        }
        let exponent = exponent - i64::try_from(part.len()).ok()?;
        let power = BigInt::from(10).pow(u32::try_from(exponent.unsigned_abs()).ok().filter(|e| *e < 10_000)?);
        let digits: BigInt = all.parse().ok()?;
        Some(if exponent < 0 { Self::new(digits, power) } else { Self::new(digits * power, 1.into()) })
    }

    /// The absolute value.
    pub fn abs(&self) -> Self {
        Self { numerator: self.numerator.magnitude().clone().into(), denominator: self.denominator.clone() }
    }

    /// Whether it is below zero.
    pub fn is_negative(&self) -> bool {
        self.numerator.sign() == Sign::Minus
    }

    /// Near enough for words.
    pub fn approximately(&self) -> f64 {
        // Sixty bits of the quotient, and their power of two.
        let (n, d) = (self.numerator.magnitude(), self.denominator.magnitude());
        let shift = 60 + d.bits() as i64 - n.bits() as i64;
        let quotient = if shift >= 0 { (n << shift as usize) / d } else { n / (d << (-shift) as usize) };
        let digits = quotient.iter_u64_digits().next().unwrap_or(0) as f64;
        let mut value = if self.is_negative() { -digits } else { digits };
        let factor = if shift >= 0 { 0.5 } else { 2.0 };
        for _ in 0..shift.unsigned_abs() {
            value *= factor;
        }
        value
    }
}

impl PartialEq for Rational {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Rational {}

impl PartialOrd for Rational {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Rational {
    fn cmp(&self, other: &Self) -> Ordering {
        (&self.numerator * &other.denominator).cmp(&(&other.numerator * &self.denominator))
    }
}

impl Add for &Rational {
    type Output = Rational;
    fn add(self, o: &Rational) -> Rational {
        let numerator = &self.numerator * &o.denominator + &o.numerator * &self.denominator;
        Rational::new(numerator, &self.denominator * &o.denominator)
    }
}

impl Neg for &Rational {
    type Output = Rational;
    fn neg(self) -> Rational {
        Rational { numerator: -&self.numerator, denominator: self.denominator.clone() }
    }
}

impl Sub for &Rational {
    type Output = Rational;
    fn sub(self, o: &Rational) -> Rational {
        self + &-o
    }
}

impl Mul for &Rational {
    type Output = Rational;
    fn mul(self, o: &Rational) -> Rational {
        Rational::new(&self.numerator * &o.numerator, &self.denominator * &o.denominator)
    }
}

/// All numbers from `low` to `high`.
#[derive(Clone, Debug)]
pub struct Range {
    /// The least.
    pub low: Rational,
    /// The greatest.
    pub high: Rational,
}

impl Range {
    /// One number.
    pub fn point(x: &Rational) -> Self {
        Self { low: x.clone(), high: x.clone() }
    }

    /// Whether all of it lies strictly between the bounds of `o`.
    pub fn inside(&self, o: &Self) -> bool {
        o.low < self.low && self.high < o.high
    }

    /// Whether all of it lies in `o`.
    pub fn within(&self, o: &Self) -> bool {
        o.low <= self.low && self.high <= o.high
    }

    /// Whether the two have a number in common.
    pub fn meets(&self, o: &Self) -> bool {
        self.low <= o.high && o.low <= self.high
    }

    /// The distance of the bounds.
    pub fn width(&self) -> Rational {
        &self.high - &self.low
    }

    /// The largest absolute value.
    pub fn magnitude(&self) -> Rational {
        self.low.abs().max(self.high.abs())
    }

    /// Wider by `by` on both sides.
    pub fn widened(&self, by: &Rational) -> Self {
        Self { low: &self.low - by, high: &self.high + by }
    }

    /// The squares of its numbers.
    pub fn squared(&self) -> Self {
        let (a, b) = (&self.low * &self.low, &self.high * &self.high);
        let least = if self.low.is_negative() != self.high.is_negative() {
            Rational::whole(0)
        } else {
            a.clone().min(b.clone())
        };
        Self { low: least, high: a.max(b) }
    }
}

impl Add for &Range {
    type Output = Range;
    fn add(self, o: &Range) -> Range {
        Range { low: &self.low + &o.low, high: &self.high + &o.high }
    }
}

impl Sub for &Range {
    type Output = Range;
    fn sub(self, o: &Range) -> Range {
        Range { low: &self.low - &o.high, high: &self.high - &o.low }
    }
}

impl Mul for &Range {
    type Output = Range;
    fn mul(self, o: &Range) -> Range {
        let products = [&self.low * &o.low, &self.low * &o.high, &self.high * &o.low, &self.high * &o.high];
        let [a, b, c, d] = products;
        let low = a.clone().min(b.clone()).min(c.clone()).min(d.clone());
        Range { low, high: a.max(b).max(c).max(d) }
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "[{:e}, {:e}]", self.low.approximately(), self.high.approximately())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn exactly(x: f64) -> Rational {
        Rational::exactly(x).unwrap()
    }

    #[test]
    fn floating_point_numbers_are_what_they_are() {
        assert_ne!(exactly(0.1), Rational::decimal("0.1").unwrap());
        assert_eq!(exactly(0.375), Rational::decimal("3.75e-1").unwrap());
        assert_eq!(&exactly(1e300) * &exactly(5e-324), &exactly(5e-324) * &exactly(1e300));
        assert_eq!(&exactly(0.1) - &exactly(0.1), Rational::whole(0));
        assert_eq!(exactly(-0.0), Rational::whole(0));
        assert!(Rational::exactly(f64::NAN).is_none() && Rational::exactly(f64::INFINITY).is_none());
        for x in [0.1, -3.5e-200, 1.7e308, 5e-324, 0.0, 1.0] {
            assert_eq!(exactly(x).approximately(), x);
        }
    }

    #[test]
    fn decimals_are_exact() {
        let d = |t: &str| Rational::decimal(t).unwrap();
        assert_eq!(&d("0.1") + &d("0.2"), d("0.3"));
        assert_eq!(d("-1.25"), -&d("125E-2"));
        assert_eq!(d("1e3"), Rational::whole(1000));
        for wrong in ["", "-", "1.2.3", "0x1", "1e", "ten", "1e99999"] {
            assert!(Rational::decimal(wrong).is_none(), "{wrong}");
        }
    }

    #[test]
    fn ranges_hold_all_results() {
        let r = |a: f64, b: f64| Range { low: exactly(a), high: exactly(b) };
        let p = &r(-2.0, 3.0) * &r(-5.0, 1.0);
        assert_eq!((p.low, p.high), (exactly(-15.0), exactly(10.0)));
        let s = r(-2.0, 1.0).squared();
        assert_eq!((s.low, s.high), (exactly(0.0), exactly(4.0)));
        assert!(r(0.0, 1.0).within(&r(0.0, 1.0)) && !r(0.0, 1.0).inside(&r(0.0, 1.0)));
        assert!(r(0.0, 1.0).meets(&r(1.0, 2.0)) && !r(0.0, 1.0).meets(&r(1.5, 2.0)));
    }
}
