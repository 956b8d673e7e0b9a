//! The first step size of a one-step method.

use nalgebra::SVector;

use crate::num::elementary::rough_pow;

/// Hairer, Norsett & Wanner (1993), sec. II.4, "Starting step size", for an autonomous equation.
///
/// `x` and `derivative` are the state and f there, `norm` measures in units of the tolerance, `exponent` is one over the order
/// of the error estimate plus one, no step is longer than `longest`, and `eval` is asked once for f elsewhere.
pub(super) fn starting_step<const N: usize>(
    x: &SVector<f64, N>,
    derivative: &SVector<f64, N>,
    norm: impl Fn(&SVector<f64, N>) -> f64,
    exponent: f64,
    longest: f64,
    eval: impl FnOnce(&SVector<f64, N>) -> SVector<f64, N>,
) -> f64 {
    let (d0, d1) = (norm(x), norm(derivative));
    let h0 = if d0 < 1e-5 || d1 < 1e-5 { 1e-6 } else { 0.01 * d0 / d1 };
    let h0 = h0.min(longest);
    let there = eval(&(x + derivative * h0));
    let d2 = norm(&(there - derivative)) / h0;
    let d = d1.max(d2);
    let h1 = if d <= 1e-15 { (h0 * 1e-3).max(1e-6) } else { rough_pow(0.01 / d, exponent) };
    if h1.is_finite() { (100.0 * h0).min(h1) } else { h0 }
}
