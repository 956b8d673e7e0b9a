//! What an equation may do with a number.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::elementary;

/// A real number, as the equations in [`crate::model`] see it.
///
/// Implemented by `f64`, by [`Dual`](super::Dual) (which carries derivatives) and by extended-precision numbers. An
/// equation written once over a `Scalar` therefore also gives its Jacobian and its high-precision value.
/// Comparisons look at the value only, never at derivatives.
pub trait Scalar:
    Copy
    + Debug
    + PartialEq
    + PartialOrd
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
    + AddAssign
    + SubAssign
    + Send
    + Sync
    + 'static
{
    /// The exact value of an `f64`.
    fn from_f64(value: f64) -> Self;
    /// The nearest `f64`.
    fn to_f64(self) -> f64;
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// Exponential.
    fn exp(self) -> Self;
    /// Sine.
    fn sin(self) -> Self;
    /// Cosine.
    fn cos(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;

    /// Zero.
    #[inline]
    fn zero() -> Self {
        Self::from_f64(0.0)
    }
    /// One.
    #[inline]
    fn one() -> Self {
        Self::from_f64(1.0)
    }
    /// The product with an `f64` constant.
    #[inline]
    fn scale(self, factor: f64) -> Self {
        self * Self::from_f64(factor)
    }
    /// The square, by one multiplication.
    #[inline]
    fn squared(self) -> Self {
        self * self
    }
}

impl Scalar for f64 {
    #[inline]
    fn from_f64(value: f64) -> Self {
        value
    }
    #[inline]
    fn to_f64(self) -> f64 {
        self
    }
    #[inline]
    fn tanh(self) -> Self {
        elementary::tanh(self)
    }
    #[inline]
    fn exp(self) -> Self {
        elementary::exp(self)
    }
    #[inline]
    fn sin(self) -> Self {
        elementary::sin(self)
    }
    #[inline]
    fn cos(self) -> Self {
        elementary::cos(self)
    }
    #[inline]
    fn sqrt(self) -> Self {
        elementary::sqrt(self)
    }
}
