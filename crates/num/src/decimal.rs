//! Decimal numbers, kept with all digits that were written.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use serde::de::{Deserialize, Deserializer, Error, Visitor};
use serde::ser::{Serialize, Serializer};

use super::{Arithmetic, DoubleDouble, MultiFloat};

/// A finite number given in decimal. Plain arithmetic sees the nearest `f64`; extended precision
/// can read the decimal number itself (0.1 is one tenth), to all digits that were given.
///
/// ```
/// use twofold_num::Decimal;
/// let tenth: Decimal = "0.1".parse().unwrap();
/// assert_eq!(tenth.value(), 0.1);
/// assert!("one".parse::<Decimal>().is_err());
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Decimal {
    value: f64,
    /// The digits, if they say more than the shortest decimal number that reads as `value`.
    digits: Option<Arc<str>>,
}

/// Why a text is not a [`Decimal`]: not a number, not finite, or too long.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DecimalError {
    /// Not a number.
    #[error("`{0}` is not a decimal number; write it like 0.25, -3 or 1e-5")]
    NotANumber(String),
    /// Beyond the range of `f64`, at either end.
    #[error("{0} is outside the range of double precision, about 1e-307 to 1e308")]
    OutOfRange(String),
    /// Longer than [`Decimal::MAX_DIGITS`].
    #[error(
        "a number of more than {} characters; no arithmetic here carries so many digits",
        Decimal::MAX_DIGITS
    )]
    TooLong,
}

impl Decimal {
    /// Maximum length of a number's text, in bytes.
    pub const MAX_DIGITS: usize = 100;

    /// The nearest `f64`.
    pub fn value(&self) -> f64 {
        self.value
    }
}

/// The significant digits of a decimal number without sign, and the power of ten of the last one;
/// `None` if `text` is no number.
fn significant(text: &str) -> Option<(String, i64)> {
    let (digits, mut exponent) = match text.split_once(['e', 'E']) {
        Some((digits, exponent)) => (digits, i64::from(exponent.parse::<i32>().ok()?)),
        None => (text, 0),
    };
    let unsigned = digits.strip_prefix(['-', '+']).unwrap_or(digits);
    let (before, after) = unsigned.split_once('.').unwrap_or((unsigned, ""));
    let all = format!("{before}{after}");
    if all.is_empty() || !all.chars().all(|c| c.is_ascii_digit()) {
        return None;
    }
    exponent -= after.len() as i64;
    let short = all.trim_end_matches('0');
    exponent += (all.len() - short.len()) as i64;
    let short = short.trim_start_matches('0');
    Some(if short.is_empty() { (String::new(), 0) } else { (short.into(), exponent) })
}

impl From<f64> for Decimal {
    /// The shortest decimal number that reads as `value`.
    fn from(value: f64) -> Self {
        Self { value, digits: None }
    }
}

impl FromStr for Decimal {
    type Err = DecimalError;

    fn from_str(text: &str) -> Result<Self, DecimalError> {
        if text.len() > Self::MAX_DIGITS {
            return Err(DecimalError::TooLong);
        }
        let (Some(given), Ok(value)) = (significant(text), text.parse::<f64>()) else {
            return Err(DecimalError::NotANumber(text.into()));
        };
        if !value.is_finite() || (value.abs() < f64::MIN_POSITIVE && !given.0.is_empty()) {
            return Err(DecimalError::OutOfRange(text.into()));
        }
        // Rust prints the shortest digits that read back as the same number, on every platform.
        let same = significant(&format!("{value:e}")).is_some_and(|shortest| shortest == given);
        Ok(Self { value, digits: (!same).then(|| text.into()) })
    }
}

impl fmt::Display for Decimal {
    /// The number's digits: parsing them gives the number back.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.digits {
            Some(digits) => f.write_str(digits),
            None if self.value != 0.0 && !(1e-4..1e15).contains(&self.value.abs()) => {
                write!(f, "{:e}", self.value)
            }
            None => write!(f, "{}", self.value),
        }
    }
}

impl Serialize for Decimal {
    /// A number; a string of digits if `f64` does not hold it.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match &self.digits {
            Some(digits) => serializer.serialize_str(digits),
            None => serializer.serialize_f64(self.value),
        }
    }
}

impl<'de> Deserialize<'de> for Decimal {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Number;
        impl Visitor<'_> for Number {
            type Value = Decimal;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a finite number, or its digits as a string")
            }
            fn visit_f64<E: Error>(self, value: f64) -> Result<Decimal, E> {
                if value.is_finite() {
                    Ok(value.into())
                } else {
                    Err(E::custom("a parameter must be a finite number"))
                }
            }
            fn visit_i64<E: Error>(self, value: i64) -> Result<Decimal, E> {
                value.to_string().parse().map_err(E::custom)
            }
            fn visit_u64<E: Error>(self, value: u64) -> Result<Decimal, E> {
                value.to_string().parse().map_err(E::custom)
            }
            fn visit_str<E: Error>(self, text: &str) -> Result<Decimal, E> {
                text.parse().map_err(E::custom)
            }
        }
        deserializer.deserialize_any(Number)
    }
}

/// A number type that can represent a decimal number more exactly than `f64` does.
pub trait FromDecimal {
    /// The decimal number, as exactly as the type can hold it.
    fn from_decimal(number: &Decimal) -> Self;
}

impl FromDecimal for f64 {
    fn from_decimal(number: &Decimal) -> Self {
        number.value
    }
}

impl FromDecimal for DoubleDouble {
    fn from_decimal(number: &Decimal) -> Self {
        match &number.digits {
            Some(digits) => DoubleDouble::from_digits(digits)
                .unwrap_or(DoubleDouble::from_decimal(number.value)),
            None => DoubleDouble::from_decimal(number.value),
        }
    }
}

impl<const L: usize> FromDecimal for MultiFloat<L> {
    fn from_decimal(number: &Decimal) -> Self {
        // Rust prints the shortest digits that read back as the same number, on every platform.
        let shortest = || format!("{:e}", number.value);
        let digits = number.digits.as_deref().map_or_else(shortest, str::to_owned);
        MultiFloat::from_digits(&digits).unwrap_or(MultiFloat::from_f64(number.value))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn digits_beyond_f64_are_kept() {
        let short: Decimal = "0.1".parse().unwrap();
        assert_eq!(short, Decimal::from(0.1));
        let long: Decimal = "0.785398163397448309615660845819875721".parse().unwrap();
        assert_eq!(long.value(), std::f64::consts::FRAC_PI_4);
        let quarter = <DoubleDouble as FromDecimal>::from_decimal(&long);
        let error = quarter * DoubleDouble::new(4.0, 0.0) - DoubleDouble::PI;
        assert!(error.high().abs() < 1e-31, "{error:?}");
        let json = serde_json::to_string(&[short, long.clone()]).unwrap();
        assert_eq!(json, "[0.1,\"0.785398163397448309615660845819875721\"]");
        assert_eq!(serde_json::from_str::<Vec<Decimal>>(&json).unwrap()[1], long);
    }

    #[test]
    fn what_is_not_a_number_is_refused() {
        for text in
            ["", "x", "1..2", "1e", "e5", "--1", "0x10", "nan", "inf", "1_000", " 1", "1e5.5", "."]
        {
            assert!(matches!(text.parse::<Decimal>(), Err(DecimalError::NotANumber(_))), "{text}");
        }
        for text in ["1e400", "1e-400", "-2e308"] {
            assert!(matches!(text.parse::<Decimal>(), Err(DecimalError::OutOfRange(_))), "{text}");
        }
        assert_eq!("1".repeat(101).parse::<Decimal>(), Err(DecimalError::TooLong));
        assert_eq!("0e-999".parse::<Decimal>().unwrap().value(), 0.0);
    }

    proptest! {
        #[test]
        fn printed_digits_read_back(value in any::<f64>().prop_filter("normal",
            |v| v.is_normal())) {
            let number = Decimal::from(value);
            prop_assert_eq!(number.to_string().parse::<Decimal>().unwrap(), number);
        }
    }

    #[test]
    fn the_same_number_written_otherwise_needs_no_digits() {
        for text in ["100", "1e2", "1000e-1", "+100", "0100.00", "0.01e4"] {
            assert_eq!(text.parse::<Decimal>().unwrap(), Decimal::from(100.0), "{text}");
        }
        // 2^53 + 1 is no f64.
        let odd: Decimal = "9007199254740993".parse().unwrap();
        assert_eq!(
            (odd.value(), odd.to_string()),
            (9_007_199_254_740_992.0, "9007199254740993".into())
        );
        let least: Decimal = "2.2250738585072014e-308".parse().unwrap();
        assert_eq!(least.value(), f64::MIN_POSITIVE);
        assert!("1".repeat(Decimal::MAX_DIGITS).parse::<Decimal>().is_ok());
        assert_eq!(<f64 as FromDecimal>::from_decimal(&"0.25".parse().unwrap()), 0.25);
    }

    #[test]
    fn numbers_are_written_as_people_write_them() {
        for (value, text) in [
            (0.0, "0"),
            (0.25, "0.25"),
            (1e-4, "0.0001"),
            (9e-5, "9e-5"),
            (1e15, "1e15"),
            (-1e20, "-1e20"),
        ] {
            assert_eq!(Decimal::from(value).to_string(), text);
        }
        let error = serde_json::from_str::<Decimal>("true").unwrap_err().to_string();
        assert!(error.contains("a finite number, or its digits"), "{error}");
    }
}
