//! Dual numbers: forward-mode differentiation.
//!
//! `Dual<S, N>` is a value with its N partial derivatives, `a + sum_i b_i e_i` with `e_i e_j = 0`
//! (Griewank & Walther 2008, ch. 3). Nested duals give second derivatives; that is how second Lie
//! derivatives at a fold come from the equations themselves.

use std::cmp::Ordering;

use super::scalar::operators;
use super::{Arithmetic, Elementary, Scalar};

/// A value and its partial derivatives with respect to `N` variables.
///
/// ```
/// use twofold_num::{Dual, Elementary};
/// let (x, y) = (Dual::<f64, 2>::variable(2.0, 0), Dual::variable(3.0, 1));
/// let product = x * y.exp();
/// assert_eq!(product.partials[0], product.value / 2.0);
/// assert_eq!(product.partials[1], product.value);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Dual<S, const N: usize> {
    /// The value.
    pub value: S,
    /// The partial derivatives.
    pub partials: [S; N],
}

impl<S: Arithmetic, const N: usize> Dual<S, N> {
    /// A constant: all derivatives zero.
    pub fn constant(value: S) -> Self {
        Self { value, partials: [S::zero(); N] }
    }

    /// The `index`-th independent variable.
    pub fn variable(value: S, index: usize) -> Self {
        let mut partials = [S::zero(); N];
        partials[index] = S::one();
        Self { value, partials }
    }

    /// `f` of the values and of each pair of derivatives.
    #[inline]
    fn pairwise(mut self, other: Self, f: impl Fn(S, S) -> S) -> Self {
        self.value = f(self.value, other.value);
        for (a, b) in self.partials.iter_mut().zip(other.partials) {
            *a = f(*a, b);
        }
        self
    }

    /// f(self), given the value and the derivative of f at `self.value`.
    #[inline]
    fn chain(self, value: S, slope: S) -> Self {
        Self { value, partials: self.partials.map(|p| p * slope) }
    }
}

impl<S: PartialEq, const N: usize> PartialEq for Dual<S, N> {
    fn eq(&self, other: &Self) -> bool {
        self.value == other.value
    }
}

impl<S: PartialOrd, const N: usize> PartialOrd for Dual<S, N> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.value.partial_cmp(&other.value)
    }
}

operators! {
    impl [S: Arithmetic, const N: usize] Dual<S, N>, inline:
    Add add(self, other) { self.pairwise(other, |a, b| a + b) }
    Sub sub(self, other) { self.pairwise(other, |a, b| a - b) }
    Mul mul(self, other) {
        let mut partials = [S::zero(); N];
        for (i, p) in partials.iter_mut().enumerate() {
            *p = self.partials[i] * other.value + self.value * other.partials[i];
        }
        Self { value: self.value * other.value, partials }
    }
    Div div(self, other) {
        let value = self.value / other.value;
        let mut partials = [S::zero(); N];
        for (i, p) in partials.iter_mut().enumerate() {
            *p = (self.partials[i] - value * other.partials[i]) / other.value;
        }
        Self { value, partials }
    }
    -(self) { Self { value: -self.value, partials: self.partials.map(|p| -p) } }
}

impl<S: Arithmetic, const N: usize> Arithmetic for Dual<S, N> {
    fn from_f64(value: f64) -> Self {
        Self::constant(S::from_f64(value))
    }
}

impl<S: Scalar, const N: usize> Scalar for Dual<S, N> {
    fn to_f64(self) -> f64 {
        self.value.to_f64()
    }
}

impl<S: Elementary, const N: usize> Elementary for Dual<S, N> {
    fn tanh(self) -> Self {
        let t = self.value.tanh();
        self.chain(t, self.value.sech_squared().unwrap_or_else(|| S::one() - t * t))
    }
    fn sech_squared(self) -> Option<Self> {
        let s = self.value.sech_squared()?;
        Some(self.chain(s, -(self.value.tanh() * s).scale(2.0)))
    }
    fn exp(self) -> Self {
        let e = self.value.exp();
        self.chain(e, e)
    }
    fn sin(self) -> Self {
        self.chain(self.value.sin(), self.value.cos())
    }
    fn cos(self) -> Self {
        self.chain(self.value.cos(), -self.value.sin())
    }
    fn sqrt(self) -> Self {
        let r = self.value.sqrt();
        self.chain(r, S::from_f64(0.5) / r)
    }
    fn ln(self) -> Self {
        self.chain(self.value.ln(), S::one() / self.value)
    }
    fn atan(self) -> Self {
        self.chain(self.value.atan(), S::one() / (S::one() + self.value * self.value))
    }
    fn erf(self) -> Self {
        let slope = (-(self.value * self.value)).exp() * (S::from_f64(2.0) / S::pi().sqrt());
        self.chain(self.value.erf(), slope)
    }
    fn pi() -> Self {
        Self::constant(S::pi())
    }
    fn sign(self) -> Self {
        Self::constant(self.value.sign())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn sample<S: Scalar>(x: S, y: S) -> S {
        (x * y).sin() + (x / (y * y + S::one())).tanh() - (y - x).exp() * (x * x + S::one()).sqrt()
            + y.cos()
            + (x * x + S::one()).ln() * y.atan()
            - (x - y).erf()
            + (x + S::pi()).power(3).scale(0.01)
            + (x * x + S::one()).power(-2)
    }

    proptest! {
        #[test]
        fn partials_match_central_differences(x in -2.0..2.0_f64, y in -2.0..2.0_f64) {
            let d = sample(Dual::<f64, 2>::variable(x, 0), Dual::variable(y, 1));
            let h = 1e-6;
            let dx = (sample(x + h, y) - sample(x - h, y)) / (2.0 * h);
            let dy = (sample(x, y + h) - sample(x, y - h)) / (2.0 * h);
            prop_assert!((d.partials[0] - dx).abs() < 1e-6 * (1.0 + dx.abs()), "{} {}",
                d.partials[0], dx);
            prop_assert!((d.partials[1] - dy).abs() < 1e-6 * (1.0 + dy.abs()));
        }
    }

    #[test]
    fn nesting_gives_second_derivatives() {
        // d^2/dx^2 tanh x = -2 tanh x (1 - tanh^2 x)
        let x: Dual<Dual<f64, 1>, 1> =
            Dual { value: Dual::variable(0.3, 0), partials: [Dual::constant(1.0)] };
        let t = elementary_tanh(0.3);
        assert!((x.tanh().partials[0].partials[0] + 2.0 * t * (1.0 - t * t)).abs() < 1e-15);
    }

    fn elementary_tanh(x: f64) -> f64 {
        super::super::elementary::tanh(x)
    }

    #[test]
    fn values_are_those_without_derivatives() {
        let (x, y) = (0.7, -1.3);
        let d = sample(Dual::<f64, 2>::variable(x, 0), Dual::variable(y, 1));
        assert_eq!(d.to_f64(), sample(x, y));
        let (a, b) = (Dual::<f64, 2>::variable(x, 0), Dual::variable(y, 1));
        let (mut sum, mut difference) = (a, a);
        sum += b;
        difference -= b;
        assert_eq!((sum.value, sum.partials), (x + y, [1.0, 1.0]));
        assert_eq!((difference.value, difference.partials), (x - y, [1.0, -1.0]));
        assert_eq!(((-b).value, (-b).partials), (-y, [-0.0, -1.0]));
        assert!(a > b && a == Dual::constant(x) && a != b);
        assert_eq!((a.sign().value, b.sign().value, b.sign().partials), (1.0, -1.0, [0.0; 2]));
        assert_eq!(
            (Dual::<f64, 1>::pi().value, Dual::<f64, 1>::pi().partials),
            (std::f64::consts::PI, [0.0])
        );
    }

    /// Each function's slope is its derivative, written down.
    #[test]
    fn slopes_are_derivatives() {
        type Function = (fn(Dual<f64, 1>) -> Dual<f64, 1>, f64);
        let x = 0.7_f64;
        let t = elementary_tanh(x);
        let functions: [Function; 9] = [
            (Elementary::tanh, 1.0 - t * t),
            (Elementary::exp, x.exp()),
            (Elementary::sin, x.cos()),
            (Elementary::cos, -x.sin()),
            (Elementary::sqrt, 0.5 / x.sqrt()),
            (Elementary::ln, 1.0 / x),
            (Elementary::atan, 1.0 / (1.0 + x * x)),
            (Elementary::erf, std::f64::consts::FRAC_2_SQRT_PI * (-x * x).exp()),
            (|v| Dual::constant(2.0) / v, -2.0 / (x * x)),
        ];
        for (n, (f, slope)) in functions.into_iter().enumerate() {
            let got = f(Dual::variable(x, 0)).partials[0];
            assert!((got - slope).abs() < 1e-15 * 8.0, "function {n}: {got} {slope}");
        }
    }
}
