//! A number whose tanh has a prescribed value.

use super::scalar::{Arithmetic, Elementary, by_parts, operators};

/// A number for which every tanh returns one prescribed value, whatever its argument: evaluates an
/// equation at a given place in its layer.
#[derive(Clone, Copy, Debug)]
pub struct Given<T = f64> {
    value: T,
    /// The prescribed tanh, without meaning in a constant, which has none. All numbers that have
    /// one have the same.
    tanh: T,
    // No option: a number in a register would be moved through memory for it.
    told: bool,
}

impl<T: Elementary> Given<T> {
    /// The number `value`, in an equation where tanh is `tanh`.
    #[inline(always)]
    pub fn new(value: T, tanh: T) -> Self {
        Self { value, tanh, told: true }
    }

    /// The number.
    #[inline(always)]
    pub fn value(self) -> T {
        self.value
    }

    #[inline(always)]
    fn map(self, f: impl Fn(T) -> T) -> Self {
        Self { value: f(self.value), ..self }
    }

    /// `value`, which comes of this number and another one.
    #[inline(always)]
    fn with(self, other: Self, value: T) -> Self {
        let tanh = if self.told { self.tanh } else { other.tanh };
        Self { value, tanh, told: self.told || other.told }
    }
}

impl<T: PartialEq> PartialEq for Given<T> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

operators! {
    impl [T: Elementary] Given<T>, inline(always):
    Add add(self, other) { self.with(other, self.value + other.value) }
    Sub sub(self, other) { self.with(other, self.value - other.value) }
    Mul mul(self, other) { self.with(other, self.value * other.value) }
    Div div(self, other) { self.with(other, self.value / other.value) }
    -(self) { self.map(|v| -v) }
}

impl<T: Elementary> Arithmetic for Given<T> {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        let value = T::from_f64(value);
        Self { value, tanh: value, told: false }
    }
}

impl<T: Elementary> Elementary for Given<T> {
    #[inline(always)]
    fn tanh(self) -> Self {
        Self { value: if self.told { self.tanh } else { self.value.tanh() }, ..self }
    }
    #[inline(always)]
    fn pi() -> Self {
        Self { value: T::pi(), tanh: T::pi(), told: false }
    }
    by_parts!(exp sin cos sqrt ln atan erf sign);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tanh_is_what_it_was_told() {
        let [x, y] = [0.3_f64, -2.0].map(|v| Given::new(v, -0.25));
        let f = (x * y / Given::from_f64(1e-3)).tanh() * y + Given::from_f64(3.0) - x;
        assert_eq!(f.value(), -0.25 * -2.0 + 3.0 - 0.3);
        // Zero is no different.
        assert_eq!((Given::new(5.0_f64, 0.0) + Given::one()).tanh().value(), 0.0);
    }

    #[test]
    fn everything_else_is_as_it_is() {
        let x = Given::new(0.5_f64, 9.0);
        type Function = (fn(Given) -> Given, fn(f64) -> f64);
        let functions: [Function; 9] = [
            (Elementary::exp, Elementary::exp),
            (Elementary::sin, Elementary::sin),
            (Elementary::cos, Elementary::cos),
            (Elementary::sqrt, Elementary::sqrt),
            (Elementary::ln, Elementary::ln),
            (Elementary::atan, Elementary::atan),
            (Elementary::erf, Elementary::erf),
            (Elementary::sign, Elementary::sign),
            (|v| -v, |v| -v),
        ];
        for (f, plain) in functions {
            assert_eq!(f(x).value(), plain(0.5));
            // And what tanh is goes along.
            assert_eq!(f(x).tanh().value(), 9.0);
        }
        let (mut sum, mut difference) = (Given::from_f64(2.0), Given::from_f64(2.0));
        sum += x;
        difference -= x;
        assert_eq!((sum.value(), difference.value()), (2.5, 1.5));
        assert_eq!((sum.tanh().value(), difference.tanh().value()), (9.0, 9.0));
        // A constant has been told nothing.
        assert_eq!(Given::<f64>::pi().tanh().value(), Elementary::tanh(std::f64::consts::PI));
        assert_eq!((Given::<f64>::pi() + x).tanh().value(), 9.0);
        assert_eq!((x * Given::pi()).tanh().value(), 9.0);
        assert!(x == Given::from_f64(0.5) && x != Given::from_f64(0.25));
    }
}
