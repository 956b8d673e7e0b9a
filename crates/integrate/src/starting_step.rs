//! The first step size of a one-step method.

use nalgebra::SVector;

use twofold_num::elementary::rough_pow;

/// Hairer, Norsett & Wanner (1993), sec. II.4, "Starting step size", for an autonomous equation.
///
/// `x` and `derivative` are the state and f there, `norm` measures in units of the tolerance,
/// `exponent` is one over the order of the error estimate plus one, no step is longer than
/// `longest`, and `eval` is asked once for f elsewhere.
pub(super) fn starting_step<const N: usize>(
    x: &SVector<f64, N>,
    derivative: &SVector<f64, N>,
    norm: &dyn Fn(&SVector<f64, N>) -> f64,
    exponent: f64,
    longest: f64,
    eval: &dyn Fn(&SVector<f64, N>) -> SVector<f64, N>,
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

#[cfg(test)]
mod tests {
    use nalgebra::Vector1;

    use super::*;

    /// The first step of x' = f(x) from `x` with tolerances of 1e-6, by hand from the book's
    /// recipe.
    fn first(x: f64, f: impl Fn(f64) -> f64, longest: f64) -> f64 {
        let norm = |v: &SVector<f64, 1>| v[0].abs() / (1e-6 + 1e-6 * x.abs());
        starting_step(&Vector1::new(x), &Vector1::new(f(x)), &norm, 0.2, longest, &|y| {
            Vector1::new(f(y[0]))
        })
    }

    fn near(a: f64, b: f64) {
        assert!((a / b - 1.0).abs() < 0.02, "{a} is not {b}");
    }

    #[test]
    fn the_books_recipe() {
        // d0 = d1 = d2 = 5e5: (0.01 / 5e5)^(1/5).
        near(first(1.0, |x| -x, 1.0), 0.028_854);
        // A curvature larger than the slope: d1 = 5e5, d2 = 1e8 decides. (0.01 / 1e8)^(1/5)
        near(first(1.0, |x| -1.0 - 200.0 * (x - 1.0), 1.0), 0.01);
        // From zero h0 = 1e-6 and no more than a hundred times that; also when nearly at rest.
        near(first(0.0, |_| 1.0, 1.0), 1e-4);
        near(first(1.0, |_| 1e-12, 1.0), 1e-4);
        // At rest nothing is known.
        near(first(1.0, |_| 0.0, 1.0), 1e-6);
        // Never more than a hundred times what a hundredth of the state's own time is, and that is
        // at most the longest step.
        near(first(1.0, |x| -x, 1e-5), 1e-3);
        // A derivative that is no number elsewhere.
        near(first(1.0, |x| if x == 1.0 { -1.0 } else { f64::NAN }, 1.0), 0.028_854);
    }
}
