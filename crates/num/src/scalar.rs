//! The operations that an equation may apply to a number.

use std::fmt::Debug;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use super::elementary;

/// The operators of a number type: those written, and `+=` and `-=` by them.
macro_rules! operators {
    (
        impl $generics:tt $type:ty, $inline:meta:
        $($trait:ident $function:ident($this:ident, $other:ident) $body:block)*
        -($that:ident) $negative:block
    ) => {
        $(crate::scalar::operators!(
            @ $generics $type, $inline, $trait $function($this, $other: Self) $body);)*
        crate::scalar::operators!(@ $generics $type, $inline, Neg neg($that) $negative);
        crate::scalar::operators!(@ $generics $type, $inline, AddAssign add_assign +);
        crate::scalar::operators!(@ $generics $type, $inline, SubAssign sub_assign -);
    };
    (
        @ [$($generics:tt)*] $type:ty, $inline:meta,
        $trait:ident $function:ident($($argument:tt)*) $body:block
    ) => {
        impl<$($generics)*> std::ops::$trait for $type {
            type Output = Self;
            #[$inline]
            fn $function($($argument)*) -> Self $body
        }
    };
    (
        @ [$($generics:tt)*] $type:ty, $inline:meta,
        $trait:ident $function:ident $operator:tt
    ) => {
        impl<$($generics)*> std::ops::$trait for $type {
            #[$inline]
            fn $function(&mut self, other: Self) {
                *self = *self $operator other;
            }
        }
    };
}
pub(crate) use operators;

/// Functions of a number that are those of its parts.
macro_rules! by_parts {
    ($($function:ident)*) => {$(
        #[inline(always)]
        fn $function(self) -> Self {
            self.map(Elementary::$function)
        }
    )*};
}
pub(crate) use by_parts;

/// Sums, products and quotients: what a polynomial or rational equation needs.
///
/// Equality is that of values (of all lanes, of both ends of an interval); an equation never asks
/// for it.
pub trait Arithmetic:
    Copy
    + Debug
    + PartialEq
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
    /// Whether zeros are exact to the bit, as long as all numbers are finite: a - a is positive
    /// zero, a - 0 is a, sums of products begin with positive zero, and products with zero change
    /// nothing in them, nor zeros in a sum of others that is no negative zero. Work with numbers
    /// that are known to be zero may then be left out.
    const EXACT_ZEROS: bool = false;

    /// The exact value of an `f64`.
    fn from_f64(value: f64) -> Self;

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
    /// The quotient by an `f64` constant.
    #[inline]
    fn over(self, divisor: f64) -> Self {
        self / Self::from_f64(divisor)
    }
    /// The square, by one multiplication.
    #[inline]
    fn squared(self) -> Self {
        self * self
    }
    /// The sum of a_i b_(n-1-i) over the n terms, as products of series need it; the slices are of
    /// one length.
    #[inline]
    fn sum_of_products(a: &[Self], b: &[Self]) -> Self {
        let mut sum = Self::zero();
        for (a, b) in a.iter().zip(b.iter().rev()) {
            sum += *a * *b;
        }
        sum
    }
}

/// A number as the equations see it: arithmetic and elementary functions, but no comparisons.
///
/// Implemented by `f64`, by [`Dual`](super::Dual) (which carries derivatives), by power series, by
/// extended-precision numbers and by symbolic numbers that record operations. An equation written
/// once over `Elementary` therefore also gives its Jacobian, its Taylor coefficients and its
/// high-precision value. It cannot branch on a value, so a recording made at one point is valid at
/// all points.
pub trait Elementary: Arithmetic {
    /// Hyperbolic tangent.
    fn tanh(self) -> Self;
    /// 1 - tanh^2, by number types that know it better than from the tanh: where tanh is within
    /// rounding of 1, its slope would lose all digits, and an enclosure its meaning.
    #[inline]
    fn sech_squared(self) -> Option<Self> {
        None
    }
    /// Exponential.
    fn exp(self) -> Self;
    /// Sine.
    fn sin(self) -> Self;
    /// Cosine.
    fn cos(self) -> Self;
    /// Square root.
    fn sqrt(self) -> Self;
    /// Natural logarithm.
    fn ln(self) -> Self;
    /// Arc tangent, in radians.
    fn atan(self) -> Self;
    /// Error function, 2/sqrt(pi) times the integral of exp(-s^2) from 0 to the number.
    fn erf(self) -> Self;
    /// pi, as exactly as the type can hold it.
    fn pi() -> Self;
    /// -1 below zero, +1 from zero on; its derivative is zero.
    fn sign(self) -> Self;
    /// The absolute value; its derivative at 0 is taken as +1.
    #[inline]
    fn abs(self) -> Self {
        self * self.sign()
    }
    /// An integer power by multiplication, in an order that is part of the contract because it
    /// decides bits: x^0 = 1, x^1 = x, x^(2m) = x^m x^m, x^(2m+1) = x^(2m) x, x^-n = 1/x^n.
    fn power(self, exponent: i32) -> Self {
        let n = exponent.unsigned_abs();
        let result = match n {
            0 => Self::one(),
            1 => self,
            _ => {
                let half = self.power((n / 2) as i32);
                let even = half * half;
                if n.is_multiple_of(2) { even } else { even * self }
            }
        };
        if exponent < 0 { Self::one() / result } else { result }
    }
}

/// An [`Elementary`] number with an order and a nearest `f64`: what step control and event location
/// need. Comparisons look at the value only, never at derivatives.
pub trait Scalar: Elementary + PartialOrd {
    /// The nearest `f64`.
    fn to_f64(self) -> f64;
}

impl Arithmetic for f64 {
    const EXACT_ZEROS: bool = true;

    #[inline]
    fn from_f64(value: f64) -> Self {
        value
    }
}

macro_rules! of_elementary {
    ($($function:ident)*) => {$(
        #[inline]
        fn $function(self) -> Self {
            elementary::$function(self)
        }
    )*};
}

impl Elementary for f64 {
    of_elementary!(tanh exp sin cos ln atan erf);

    /// Out of line: where an equation takes a root in one branch only, as a transition function
    /// does, the compiler would else compute it (and what is divided by it) at every evaluation and
    /// throw it away, which was a quarter of a multistep run's time.
    #[inline(never)]
    fn sqrt(self) -> Self {
        elementary::sqrt(self)
    }
    #[inline]
    fn pi() -> Self {
        std::f64::consts::PI
    }
    #[inline]
    fn sign(self) -> Self {
        if self < 0.0 { -1.0 } else { 1.0 }
    }
}

impl Scalar for f64 {
    #[inline]
    fn to_f64(self) -> f64 {
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_multiply_in_the_documented_order() {
        let x = 1.1_f64;
        let (x2, x3) = (x * x, x * x * x);
        for (n, want) in
            [(0, 1.0), (1, x), (2, x2), (3, x3), (4, x2 * x2), (5, x2 * x2 * x), (7, x3 * x3 * x)]
        {
            assert_eq!(Elementary::power(x, n).to_bits(), want.to_bits(), "{n}");
            assert_eq!(Elementary::power(x, -n).to_bits(), (1.0 / want).to_bits(), "-{n}");
        }
    }

    #[test]
    fn zero_counts_as_positive() {
        let signs = [-2.0, -0.0, 0.0, 3.0_f64].map(Elementary::sign);
        assert_eq!(signs, [-1.0, 1.0, 1.0, 1.0]);
        assert_eq!([-2.0, 0.0, 3.0_f64].map(|x| Elementary::abs(x).to_f64()), [2.0, 0.0, 3.0]);
    }

    #[test]
    fn a_number_is_its_own_value() {
        for x in [0.7, -3.0, 0.0] {
            assert_eq!(Scalar::to_f64(x), x);
            assert_eq!(Elementary::abs(x), if x < 0.0 { -x } else { x });
        }
        assert_eq!([2.5, -0.1, 0.0].map(Elementary::sign), [1.0, -1.0, 1.0]);
    }
}
