//! Truncated power series in one variable: the coefficients of a function of sigma up to a fixed
//! order.
//!
//! A `Jet` is a [`Scalar`], so an equation written once also gives the Taylor coefficients of its
//! value along a curve (Griewank & Walther 2008, ch. 13; the recurrences are those of Knuth, TAOCP
//! 2, sec. 4.7). That is how the invariant curve of the sliding flow through a two-fold comes from
//! the equations themselves.

use std::cmp::Ordering;

use super::scalar::operators;
use super::{Arithmetic, Elementary, Scalar};

/// The series c_0 + c_1 sigma + ... + c_(K-1) sigma^(K-1), with everything from sigma^K on dropped.
/// `K` is at least 1.
///
/// ```
/// use twofold_num::Elementary;
/// use twofold_num::jet::Jet;
/// let sigma = Jet::<4> { c: [0.0, 1.0, 0.0, 0.0] };
/// let e = sigma.exp(); // 1 + s + s^2/2 + s^3/6
/// assert!((e.c[2] - 0.5).abs() < 1e-15 && (e.c[3] - 1.0 / 6.0).abs() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Jet<const K: usize> {
    /// The coefficients.
    pub c: [f64; K],
}

impl<const K: usize> Jet<K> {
    /// A constant.
    pub fn constant(value: f64) -> Self {
        let mut c = [0.0; K];
        c[0] = value;
        Self { c }
    }

    /// `f` of each pair of coefficients.
    fn pairwise(mut self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        for (a, b) in self.c.iter_mut().zip(other.c) {
            *a = f(*a, b);
        }
        self
    }

    /// The series f with w f' = a' and constant term `first`, a being `self`.
    fn integrate_over(&self, first: f64, w: &Self) -> Self {
        Self::recur(first, |k, f| {
            let known: f64 = (1..k).map(|j| j as f64 * f[j] * w.c[k - j]).sum();
            (k as f64 * self.c[k] - known) / w.c[0]
        })
    }

    /// f(self) from a recurrence: `next(k, f)` gives k f_k from the coefficients before it, `first`
    /// is f_0.
    fn recur(first: f64, mut next: impl FnMut(usize, &[f64; K]) -> f64) -> Self {
        let mut f = [0.0; K];
        f[0] = first;
        for k in 1..K {
            f[k] = next(k, &f) / k as f64;
        }
        Self { c: f }
    }
}

impl<const K: usize> PartialEq for Jet<K> {
    fn eq(&self, other: &Self) -> bool {
        self.c[0] == other.c[0]
    }
}

impl<const K: usize> PartialOrd for Jet<K> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        self.c[0].partial_cmp(&other.c[0])
    }
}

operators! {
    impl [const K: usize] Jet<K>, inline:
    Add add(self, other) { self.pairwise(other, |a, b| a + b) }
    Sub sub(self, other) { self.pairwise(other, |a, b| a - b) }
    Mul mul(self, other) {
        let mut c = [0.0; K];
        for (k, out) in c.iter_mut().enumerate() {
            *out = (0..=k).map(|j| self.c[j] * other.c[k - j]).sum();
        }
        Self { c }
    }
    Div div(self, other) {
        let mut c = [0.0; K];
        for k in 0..K {
            let known: f64 = (0..k).map(|j| c[j] * other.c[k - j]).sum();
            c[k] = (self.c[k] - known) / other.c[0];
        }
        Self { c }
    }
    -(self) { Self { c: self.c.map(|v| -v) } }
}

impl<const K: usize> Arithmetic for Jet<K> {
    fn from_f64(value: f64) -> Self {
        Self::constant(value)
    }
}

impl<const K: usize> Scalar for Jet<K> {
    fn to_f64(self) -> f64 {
        self.c[0]
    }
}

impl<const K: usize> Elementary for Jet<K> {
    fn tanh(self) -> Self {
        // t' = (1 - t^2) a'
        Self::recur(Elementary::tanh(self.c[0]), |k, t| {
            (1..=k)
                .map(|j| {
                    let square: f64 = (0..=k - j).map(|i| t[i] * t[k - j - i]).sum();
                    let slope = if k == j { 1.0 - square } else { -square };
                    j as f64 * self.c[j] * slope
                })
                .sum()
        })
    }
    fn exp(self) -> Self {
        Self::recur(Elementary::exp(self.c[0]), |k, e| {
            (1..=k).map(|j| j as f64 * self.c[j] * e[k - j]).sum()
        })
    }
    fn sin(self) -> Self {
        sin_cos(&self).0
    }
    fn cos(self) -> Self {
        sin_cos(&self).1
    }
    fn ln(self) -> Self {
        // a l' = a'
        self.integrate_over(Elementary::ln(self.c[0]), &self)
    }
    fn atan(self) -> Self {
        // (1 + a^2) t' = a'
        self.integrate_over(Elementary::atan(self.c[0]), &(Self::one() + self * self))
    }
    fn erf(self) -> Self {
        // e' = 2/sqrt(pi) exp(-a^2) a'
        let slope = (-(self * self)).exp().scale(2.0 / Elementary::sqrt(std::f64::consts::PI));
        Self::recur(Elementary::erf(self.c[0]), |k, _| {
            (1..=k).map(|j| j as f64 * self.c[j] * slope.c[k - j]).sum()
        })
    }
    fn pi() -> Self {
        Self::constant(std::f64::consts::PI)
    }
    fn sign(self) -> Self {
        Self::constant(self.c[0].sign())
    }
    fn sqrt(self) -> Self {
        // r^2 = a
        let mut r = [0.0; K];
        r[0] = Elementary::sqrt(self.c[0]);
        for k in 1..K {
            let known: f64 = (1..k).map(|j| r[j] * r[k - j]).sum();
            r[k] = (self.c[k] - known) / (2.0 * r[0]);
        }
        Self { c: r }
    }
}

fn sin_cos<const K: usize>(a: &Jet<K>) -> (Jet<K>, Jet<K>) {
    let (mut s, mut c) = ([0.0; K], [0.0; K]);
    (s[0], c[0]) = (Elementary::sin(a.c[0]), Elementary::cos(a.c[0]));
    for k in 1..K {
        s[k] = (1..=k).map(|j| j as f64 * a.c[j] * c[k - j]).sum::<f64>() / k as f64;
        c[k] = -(1..=k).map(|j| j as f64 * a.c[j] * s[k - j]).sum::<f64>() / k as f64;
    }
    (Jet { c: s }, Jet { c })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(j: &Jet<16>, s: f64) -> f64 {
        j.c.iter().rev().fold(0.0, |acc, c| acc * s + c)
    }

    #[test]
    fn series_sum_to_the_function() {
        let f = |x: f64| -> f64 {
            Elementary::tanh(x) * Elementary::exp(-x)
                + Elementary::sin(x) / (2.0 + Elementary::cos(x))
                - Elementary::sqrt(1.5 + x)
                + Elementary::ln(1.5 + x) * Elementary::atan(x) * Elementary::erf(x)
        };
        let mut x = Jet::<16>::constant(0.3);
        x.c[1] = 1.0;
        let one = Jet::constant(1.5);
        let j = x.tanh() * (-x).exp() + x.sin() / (Jet::constant(2.0) + x.cos()) - (one + x).sqrt()
            + (one + x).ln() * x.atan() * x.erf();
        for s in [-0.1, 0.05, 0.12] {
            assert!((value(&j, s) - f(0.3 + s)).abs() < 1e-12, "{s}");
        }
    }

    /// Each function along a curved line, where every coefficient of the argument counts; summed,
    /// it is the function there.
    #[test]
    fn every_function_along_a_curve() {
        type Function = (fn(Jet<16>) -> Jet<16>, fn(f64) -> f64);
        let functions: [Function; 10] = [
            (Elementary::tanh, Elementary::tanh),
            (Elementary::exp, Elementary::exp),
            (Elementary::sin, Elementary::sin),
            (Elementary::cos, Elementary::cos),
            (Elementary::ln, Elementary::ln),
            (Elementary::atan, Elementary::atan),
            (Elementary::erf, Elementary::erf),
            (Elementary::sqrt, Elementary::sqrt),
            (|v| Jet::one() / v, |v| 1.0 / v),
            (|v| v.power(3) - v * Jet::pi(), |v| v * v * v - v * std::f64::consts::PI),
        ];
        let mut x = Jet::<16>::constant(1.3);
        (x.c[1], x.c[2], x.c[3]) = (0.5, -0.75, 0.25);
        for (n, (f, plain)) in functions.into_iter().enumerate() {
            let series = f(x);
            for s in [-0.08, 0.05, 0.1] {
                let want = plain(1.3 + 0.5 * s - 0.75 * s * s + 0.25 * s * s * s);
                assert!(
                    (value(&series, s) - want).abs() < 1e-13,
                    "function {n} at {s}: {} {want}",
                    value(&series, s)
                );
            }
        }
    }

    #[test]
    fn comparisons_and_signs_look_at_the_value_only() {
        let (mut a, mut b) = (Jet::<3>::constant(-2.0), Jet::<3>::constant(-2.0));
        (a.c[1], b.c[1]) = (1.0, 5.0);
        assert!(a == b && a < Jet::zero() && a.partial_cmp(&b) == Some(Ordering::Equal));
        assert_eq!((a.sign().c, Jet::<3>::one().sign().c), ([-1.0, 0.0, 0.0], [1.0, 0.0, 0.0]));
        assert_eq!(
            ((a - b).c, (a + b).c, (-a).c),
            ([0.0, -4.0, 0.0], [-4.0, 6.0, 0.0], [2.0, -1.0, 0.0])
        );
        assert_eq!((a.to_f64(), Jet::<2>::pi().c), (-2.0, [std::f64::consts::PI, 0.0]));
    }

    #[test]
    fn jets_compare_by_their_values() {
        let jet = |value: f64, slope: f64| {
            let mut c = [0.0; 16];
            (c[0], c[1]) = (value, slope);
            Jet { c }
        };
        assert!(jet(1.0, 2.0) == jet(1.0, 3.0) && jet(1.0, 2.0) != jet(1.5, 2.0));
        assert!(jet(1.0, 2.0) < jet(1.5, 0.0) && jet(2.0, 0.0) > jet(1.5, 3.0));
        assert_eq!(jet(1.0, 0.0).partial_cmp(&jet(f64::NAN, 0.0)), None);
        assert_eq!(crate::Scalar::to_f64(jet(0.7, 5.0)), 0.7);
    }
}
