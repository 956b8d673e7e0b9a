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
        // Almost all denominators are powers of two, because the numbers were floating-point
        // numbers.
        let twos = |n: &BigInt| n.trailing_zeros();
        let shift = twos(&numerator).unwrap_or(0).min(twos(&denominator).unwrap_or(0));
        Self { numerator: numerator >> shift, denominator: denominator >> shift }
    }

    /// A whole number.
    pub fn whole(n: i64) -> Self {
        Self { numerator: n.into(), denominator: 1.into() }
    }

    /// m 2^-places.
    pub fn dyadic(m: BigInt, places: u32) -> Self {
        Self::new(m, BigInt::from(1) << places)
    }

    /// The largest whole number of units 2^-places that is not above it.
    pub fn scaled_down(&self, places: u32) -> BigInt {
        let scaled: BigInt = &self.numerator << places;
        let whole: BigInt = &scaled / &self.denominator;
        if self.is_negative() && &whole * &self.denominator != scaled { whole - 1 } else { whole }
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
        let power = BigInt::from(10)
            .pow(u32::try_from(exponent.unsigned_abs()).ok().filter(|e| *e < 10_000)?);
        let digits: BigInt = all.parse().ok()?;
        Some(if exponent < 0 {
            Self::new(digits, power)
        } else {
            Self::new(digits * power, 1.into())
        })
    }

    /// The absolute value.
    pub fn abs(&self) -> Self {
        Self {
            numerator: self.numerator.magnitude().clone().into(),
            denominator: self.denominator.clone(),
        }
    }

    /// The largest multiple of a small power of two that is not above it.
    fn rounded_down(&self) -> Self {
        Self::dyadic(self.scaled_down(GRID), GRID)
    }

    /// One over it; `None` of zero.
    pub fn inverse(&self) -> Option<Self> {
        match self.numerator.sign() {
            Sign::NoSign => None,
            Sign::Plus => Some(Self {
                numerator: self.denominator.clone(),
                denominator: self.numerator.clone(),
            }),
            Sign::Minus => {
                Some(Self { numerator: -&self.denominator, denominator: -&self.numerator })
            }
        }
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
        let quotient =
            if shift >= 0 { (n << shift as usize) / d } else { n / (d << (-shift) as usize) };
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

/// Rounding is to multiples of 2^-GRID.
const GRID: u32 = 240;

/// An enclosure of twice the inverse hyperbolic tangent of t, |t| <= 1/3, from its series.
fn twice_artanh(t: &Range) -> Option<Range> {
    const TERMS: i64 = 80;
    let square = t.squared().rounded();
    let (mut power, mut sum) = (t.clone(), Range::point(&Rational::whole(0)));
    for n in 0..TERMS {
        let odd = Rational::whole(2 * n + 1).inverse()?;
        sum = (&sum + &(&power * &Range::point(&odd))).rounded();
        power = (&power * &square).rounded();
    }
    // The rest is less than twice the next power.
    let sum = sum.widened(&(&power.magnitude() + &power.magnitude()));
    Some(&sum + &sum)
}

/// An enclosure of the natural logarithm; `None` unless x is positive.
fn logarithm(x: &Rational) -> Option<Range> {
    if x.numerator.sign() != Sign::Plus {
        return None;
    }
    // x = m 2^e with m between 1/2 and 2; ln m = 2 artanh((m - 1)/(m + 1)).
    let exponent = x.numerator.bits() as i64 - x.denominator.bits() as i64;
    let shift = BigInt::from(1) << exponent.unsigned_abs();
    let power = Rational::new(shift, 1.into());
    let m = if exponent >= 0 { x * &power.inverse()? } else { x * &power };
    let one = Rational::whole(1);
    let t = Range::point(&(&(&m - &one) * &(&m + &one).inverse()?)).rounded();
    let third = Range::point(&Rational::whole(3).inverse()?).rounded();
    let two = &Range::point(&Rational::whole(exponent)) * &twice_artanh(&third)?;
    Some((&two + &twice_artanh(&t)?).rounded())
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

    /// The least range that holds both.
    pub fn hull(&self, o: &Self) -> Self {
        Self {
            low: self.low.clone().min(o.low.clone()),
            high: self.high.clone().max(o.high.clone()),
        }
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

    /// Wider, to bounds that are short: multiples of 2^-240.
    pub fn rounded(&self) -> Self {
        Self { low: self.low.rounded_down(), high: -&(-&self.high).rounded_down() }
    }

    /// One over its numbers; `None` if zero is one of them.
    pub fn inverse(&self) -> Option<Self> {
        let zero = Rational::whole(0);
        if self.low <= zero && self.high >= zero {
            return None;
        }
        Some(Self { low: self.high.inverse()?, high: self.low.inverse()? })
    }

    /// The square roots of its numbers; `None` if one of them is negative.
    pub fn sqrt(&self) -> Option<Self> {
        if self.low.is_negative() {
            return None;
        }
        // Whole numbers of 4^-GRID, rounded down and up.
        let fine = |x: &Rational| -> BigInt { (&x.numerator << (2 * GRID)) / &x.denominator };
        let (low, high) = (fine(&self.low).sqrt(), (fine(&self.high) + 1u32).sqrt() + 1);
        let of = |n: BigInt| Rational::new(n, BigInt::from(1) << GRID);
        Some(Self { low: of(low), high: of(high) })
    }

    /// The natural logarithms of its numbers; `None` unless all are positive.
    pub fn ln(&self) -> Option<Self> {
        let (low, high) = (logarithm(&self.low)?, logarithm(&self.high)?);
        Some(Self { low: low.low, high: high.high })
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
        let products =
            [&self.low * &o.low, &self.low * &o.high, &self.high * &o.low, &self.high * &o.high];
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
        assert!(
            Rational::exactly(f64::NAN).is_none() && Rational::exactly(f64::INFINITY).is_none()
        );
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
    fn roots_and_logarithms_are_enclosed() {
        let d = |t: &str| Rational::decimal(t).unwrap();
        for (x, root, ln) in [
            // 40 digits, from mpmath.
            (
                "2",
                "1.414213562373095048801688724209698078570",
                "0.6931471805599453094172321214581765680755",
            ),
            (
                "1.01",
                "1.004987562112089027021926491275957618694",
                "0.009950330853168082848215357544260741688630",
            ),
            (
                "0.05",
                "0.2236067977499789696409173668731276235441",
                "-2.995732273553990993435223576142540775677",
            ),
            (
                "1e9",
                "31622.77660168379331998893544432718533720",
                "20.72326583694641115616192309215927786840",
            ),
        ] {
            for (got, want) in [(Range::point(&d(x)).sqrt(), root), (Range::point(&d(x)).ln(), ln)]
            {
                let (got, want) =
                    (got.unwrap(), Range::point(&d(want)).widened(&Rational::tenth_to(34)));
                assert!(got.within(&want) && got.low <= got.high, "{x}: {got}");
            }
            let root = Range::point(&d(x)).sqrt().unwrap();
            assert!(&root.low * &root.low <= d(x) && &root.high * &root.high >= d(x));
        }
        let r = |a: &str, b: &str| Range { low: d(a), high: d(b) };
        assert!(
            r("-1", "1").ln().is_none()
                && r("0", "1").ln().is_none()
                && r("-1", "1").sqrt().is_none()
        );
        assert!(r("-1", "1").inverse().is_none());
        let i = r("-4", "-2").inverse().unwrap();
        assert_eq!((i.low, i.high), (d("-0.5"), d("-0.25")));
        let third = Range::point(&Rational::whole(-3).inverse().unwrap()).rounded();
        assert!(
            third.low < Rational::whole(-3).inverse().unwrap()
                && Rational::whole(-3).inverse().unwrap() < third.high
        );
        assert!(third.width() < Rational::tenth_to(70));
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
