//! Filippov's convention on the switching surface: regions, sliding motion, folds and two-folds.
//!
//! Notation: L±h = grad h . f± is the Lie derivative of h along f±; L±²h the second one. Sources:
//! Filippov (1988), ch. 2; di Bernardo, Budd, Champneys & Kowalczyk (2008), ch. 2; Jeffrey &
//! Colombo (2009) for the two-fold.

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use super::{PiecewiseSmooth, variables};
use twofold_num::elementary::sqrt;
use twofold_num::{Dual, Elementary};

/// The kind of motion at a point of the surface h = 0.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Region {
    /// L+h < 0 < L-h: both fields point to the surface; motion slides along it.
    Attracting,
    /// L-h < 0 < L+h: both fields point away; sliding is possible and may end at any moment.
    Repelling,
    /// Both Lie derivatives positive: motion crosses to h > 0.
    CrossingUp,
    /// Both Lie derivatives negative: motion crosses to h < 0.
    CrossingDown,
    /// One of the Lie derivatives is zero: a fold of that field, or a two-fold.
    Boundary,
}

/// The first Lie derivatives (L+h, L-h) at `x`.
pub fn lie_derivatives<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    system: &P,
    x: &SVector<S, N>,
) -> (S, S) {
    let gradient = gradient(system, x);
    (dot(&gradient, &system.plus(x)), dot(&gradient, &system.minus(x)))
}

/// The second Lie derivatives (L+²h, L-²h) at `x`.
pub fn second_lie_derivatives<P: PiecewiseSmooth<N>, const N: usize>(
    system: &P,
    x: &SVector<f64, N>,
) -> (f64, f64) {
    let (plus, minus) = lie_derivatives::<P, Dual<f64, N>, N>(system, &variables(x));
    let along = |d: Dual<f64, N>, f: SVector<f64, N>| (0..N).map(|i| d.partials[i] * f[i]).sum();
    (along(plus, system.plus(x)), along(minus, system.minus(x)))
}

/// grad h at `x`.
pub fn gradient<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    system: &P,
    x: &SVector<S, N>,
) -> SVector<S, N> {
    let h = system.switching(&variables(x));
    SVector::from_fn(|i, _| h.partials[i])
}

/// Region of the surface in which `x` lies.
pub fn region<P: PiecewiseSmooth<N>, const N: usize>(system: &P, x: &SVector<f64, N>) -> Region {
    let (plus, minus) = lie_derivatives(system, x);
    match (plus.partial_cmp(&0.0), minus.partial_cmp(&0.0)) {
        (Some(std::cmp::Ordering::Less), Some(std::cmp::Ordering::Greater)) => Region::Attracting,
        (Some(std::cmp::Ordering::Greater), Some(std::cmp::Ordering::Less)) => Region::Repelling,
        (Some(std::cmp::Ordering::Greater), Some(std::cmp::Ordering::Greater)) => {
            Region::CrossingUp
        }
        (Some(std::cmp::Ordering::Less), Some(std::cmp::Ordering::Less)) => Region::CrossingDown,
        _ => Region::Boundary,
    }
}

/// Filippov's weight lambda of f+, chosen so that lambda f+ + (1 - lambda) f- is tangent to the
/// surface: lambda = L-h/(L-h - L+h). In (0, 1) exactly in the sliding regions.
pub fn sliding_weight<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    system: &P,
    x: &SVector<S, N>,
) -> S {
    let (plus, minus) = lie_derivatives(system, x);
    minus / (minus - plus)
}

/// The sliding vector field lambda f+ + (1 - lambda) f-. Undefined (0/0) at a two-fold.
///
/// ```
/// use nalgebra::{Vector2, Vector3};
/// use twofold_system::{System, filippov::sliding_field};
/// let block = System::builtin("stick-slip").expect("built in").bind::<2>()?;
/// // On the belt (v = 0.3) the spring stretches and the block does not accelerate.
/// let sliding = sliding_field(&block, &Vector2::new(0.1, 0.3));
/// assert!((sliding[0] - 0.3).abs() < 1e-12 && sliding[1].abs() < 1e-12);
/// # Ok::<(), twofold_system::BindError>(())
/// ```
pub fn sliding_field<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    system: &P,
    x: &SVector<S, N>,
) -> SVector<S, N> {
    let lambda = sliding_weight(system, x);
    let (plus, minus) = (system.plus(x), system.minus(x));
    SVector::from_fn(|i, _| minus[i] + (plus[i] - minus[i]) * lambda)
}

/// The tangency of a field to the surface at a fold, seen from its own side.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Visibility {
    /// The tangent orbit lies on the field's own side: it is really followed.
    Visible,
    /// The tangent orbit lies on the other side, where the field does not hold.
    Invisible,
}

/// A two-fold: a point of the surface where both fields are tangent to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TwoFold<const N: usize> {
    /// The point.
    pub point: SVector<f64, N>,
    /// L+²h there.
    pub second_plus: f64,
    /// L-²h there.
    pub second_minus: f64,
}

impl<const N: usize> TwoFold<N> {
    /// (of f+, of f-). f+ holds where h > 0, so its tangency is visible if h is at a minimum: L+²h
    /// > 0.
    pub fn visibility(&self) -> (Visibility, Visibility) {
        let of = |visible| if visible { Visibility::Visible } else { Visibility::Invisible };
        (of(self.second_plus > 0.0), of(self.second_minus < 0.0))
    }
}

/// Why no two-fold was found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum TwoFoldError {
    /// Fewer than three states: two-folds are not generic there.
    #[error("a system of {0} states has no isolated two-fold: it takes three")]
    TooFewStates(usize),
    /// The Newton iteration met a singular or non-finite system.
    #[error(
        "the two-fold's equations h = L+h = L-h = 0 are singular near this guess; start closer to \
            the two-fold"
    )]
    Singular,
    /// The Newton iteration did not settle.
    #[error("Newton's method for the two-fold did not converge; start closer to the two-fold")]
    NotConverged,
}

/// The two-fold near `guess`: a solution of h = L+h = L-h = 0 by Newton's method, each step the
/// shortest that solves the linearised equations. In three dimensions that is the solution; in more
/// the two-folds form a set, of which one near the guess is found.
///
/// ```
/// use nalgebra::{Vector2, Vector3};
/// use twofold_system::{System, filippov::{Visibility, two_fold}};
/// let normal_form = System::builtin("two-fold").expect("built in").bind::<3>()?;
/// let found = two_fold(&normal_form, &Vector3::new(0.1, 0.2, -0.1))?;
/// assert!(found.point.norm() < 1e-12); // the origin
/// assert_eq!(found.visibility(), (Visibility::Invisible, Visibility::Invisible));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
///
/// If there are fewer than three states, or the iteration does not converge from here.
pub fn two_fold<P: PiecewiseSmooth<N>, const N: usize>(
    system: &P,
    guess: &SVector<f64, N>,
) -> Result<TwoFold<N>, TwoFoldError> {
    if N < 3 {
        return Err(TwoFoldError::TooFewStates(N));
    }
    let mut x = *guess;
    let mut last = f64::INFINITY;
    for _ in 0..30 {
        let rows = fold_conditions(system, &x);
        let step = shortest(&rows, rows.map(|row| row.value)).ok_or(TwoFoldError::Singular)?;
        x -= step;
        let size = step.amax();
        // Quadratic convergence ends at rounding: stop when steps are tiny and no longer shrink.
        if size <= 1e-13 * (1.0 + x.amax()) && (size >= 0.5 * last || size < 1e-15) {
            let (second_plus, second_minus) = second_lie_derivatives(system, &x);
            return Ok(TwoFold { point: x, second_plus, second_minus });
        }
        last = size;
    }
    Err(TwoFoldError::NotConverged)
}

/// h, L+h, L-h at `x`, each with its gradient: the conditions for a two-fold.
pub fn fold_conditions<P: PiecewiseSmooth<N>, const N: usize>(
    system: &P,
    x: &SVector<f64, N>,
) -> [Dual<f64, N>; 3] {
    let at = variables(x);
    let (p, q) = lie_derivatives::<P, Dual<f64, N>, N>(system, &at);
    [system.switching(&at), p, q]
}

/// The shortest u with (gradient of row i) . u = `right[i]`; `None` if the gradients are dependent.
pub fn shortest<const N: usize>(
    rows: &[Dual<f64, N>; 3],
    right: [f64; 3],
) -> Option<SVector<f64, N>> {
    let row = |i: usize| SVector::<f64, N>::from(rows[i].partials);
    let gram = SMatrix::<f64, 3, 3>::from_fn(|i, j| row(i).dot(&row(j)));
    let inverse_scale = SVector::<f64, 3>::from_fn(|i, _| 1.0 / sqrt(gram[(i, i)]));
    // Scaled by rows, so that the test for dependence does not depend on units.
    let scaled =
        SMatrix::<f64, 3, 3>::from_fn(|i, j| gram[(i, j)] * inverse_scale[i] * inverse_scale[j]);
    if scaled.determinant().is_nan() || scaled.determinant() < 1e-12 {
        return None;
    }
    let b = SVector::<f64, 3>::from_fn(|i, _| right[i] * inverse_scale[i]);
    let y = scaled.lu().solve(&b)?;
    let mut u = SVector::<f64, N>::zeros();
    for i in 0..3 {
        u += row(i) * (y[i] * inverse_scale[i]);
    }
    u.iter().all(|v| v.is_finite()).then_some(u)
}

/// The constants of the two-fold normal form (4), f+ = (-y, 1, v), f- = (z, w, 1), after rescaling:
/// v = L+L-h / |L+²h| and w = L-L+h / |L-²h| up to the sign conventions of eq. (4), for an
/// invisible two-fold.
pub fn normal_form_constants<P: PiecewiseSmooth<N>, const N: usize>(
    system: &P,
    fold: &TwoFold<N>,
) -> (f64, f64) {
    let x = &fold.point;
    let (plus, minus) = lie_derivatives::<P, Dual<f64, N>, N>(system, &variables(x));
    let along =
        |d: Dual<f64, N>, f: SVector<f64, N>| (0..N).map(|i| d.partials[i] * f[i]).sum::<f64>();
    // In the normal form y = -L+h, z = L-h; along f+: y' = -L+²h, z' = L+L-h; along f-: y' =
    // -L-L+h, z' = L-²h. Time and length scales leave the ratios v = z'/y' (on f+) and w = y'/z'
    // (on f-) scaled by sqrt(-L+²h / L-²h).
    let scale = Elementary::sqrt(-fold.second_minus / fold.second_plus);
    let v = along(minus, system.plus(x)) / -fold.second_plus / scale;
    let w = -along(plus, system.minus(x)) / fold.second_minus * scale;
    (v, w)
}

/// The sum of the products of the components, in their order.
#[doc(hidden)]
pub fn dot<S: Elementary, const N: usize>(a: &SVector<S, N>, b: &SVector<S, N>) -> S {
    let mut sum = S::zero();
    for i in 0..N {
        sum += a[i] * b[i];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Caricature, System};
    use nalgebra::Vector3;

    #[test]
    fn regions_of_the_caricature() {
        let c = Caricature::with_reinjection(1e-3, 1e-5);
        assert_eq!(region(&c, &Vector3::new(0.0, 1.0, 1.0)), Region::Attracting);
        assert_eq!(region(&c, &Vector3::new(0.0, -1.0, -1.0)), Region::Repelling);
        assert_eq!(region(&c, &Vector3::new(0.0, -1.0, 1.0)), Region::CrossingUp);
        assert_eq!(region(&c, &Vector3::new(0.0, 1.0, -1.0)), Region::CrossingDown);
        assert_eq!(region(&c, &Vector3::new(0.0, 0.0, 0.0)), Region::Boundary);
    }

    #[test]
    fn sliding_in_the_caricature() {
        // lambda = z/(y + z); near the two-fold the sliding field is (z + v- y, y + v+ z)/(y + z).
        let c = Caricature::with_reinjection(0.0, 0.0);
        let x = Vector3::new(0.0, 0.3, 0.8);
        assert!((sliding_weight(&c, &x) - 0.8 / 1.1).abs() < 1e-15);
        let f = sliding_field(&c, &x);
        assert!(
            (f - Vector3::new(0.0, (0.8 - 1.4 * 0.3) / 1.1, (0.3 - 1.2 * 0.8) / 1.1)).norm()
                < 1e-15
        );
    }

    #[test]
    fn two_fold_of_the_caricature_and_its_constants() {
        let c = Caricature::with_reinjection(1e-1, 1e-5);
        let t = two_fold(&c, &Vector3::new(0.01, 0.02, -0.03)).unwrap();
        assert!(t.point.amax() < 1e-14);
        assert_eq!(t.visibility(), (Visibility::Invisible, Visibility::Invisible));
        let (v, w) = normal_form_constants(&c, &t);
        assert!((v + 1.2).abs() < 1e-12 && (w + 1.4).abs() < 1e-12, "{v} {w}");
    }

    #[test]
    fn two_fold_of_the_wheel() {
        // SCIENCE.md section 7.
        let w = System::builtin("wheel").unwrap().bind::<3>().unwrap();
        let t = two_fold(&w, &Vector3::new(0.69, -0.57, -0.87)).unwrap();
        assert!(
            (t.point - Vector3::new(0.6926698897, -0.5736729677, -0.8666344383)).amax() < 1e-10,
            "{:?}",
            t.point
        );
        assert!((t.second_plus + 39.777).abs() < 5e-4 && (t.second_minus - 45.546).abs() < 5e-4);
        assert_eq!(t.visibility(), (Visibility::Invisible, Visibility::Invisible));
        let (v, ww) = normal_form_constants(&w, &t);
        assert!((v * ww - 3.6695).abs() < 5e-5, "{v} {ww}");
        assert!((v + 1.84902).abs() < 5e-6 && (ww + 1.98457).abs() < 5e-6, "{v} {ww}");
    }
}
