//! The paper's caricature: the two-fold normal form (4) with the re-injection of eq. (5).

use nalgebra::{SVector, Vector3};
use serde::{Deserialize, Serialize};

use super::PiecewiseSmooth;
use twofold_num::Elementary;

/// Eq. (5) of the paper, with h = x and state (x, y, z):
///
/// ```text
/// f+ = (-y, 1,  v+) + (0, alpha - beta y, alpha - beta z) |x|^2     where x > 0
/// f- = ( z, v-, 1 ) + (0, alpha - beta y, alpha - beta z) |x|^2     where x < 0
/// ```
///
/// Eq. (5) prints f- with first component -z, eq. (4) with +z. Only +z makes the origin the
/// two-fold that the paper describes, invisible from both sides;
/// [`Caricature::first_component_of_minus`] keeps the misprint available so that the difference can
/// be shown.
///
/// ```
/// use nalgebra::Vector3;
/// use twofold_system::{Caricature, PiecewiseSmooth};
/// let caricature = Caricature::with_reinjection(1e-3, 1e-5);
/// assert_eq!(caricature.plus(&Vector3::new(0.0, 0.0, 0.0)), Vector3::new(0.0, 1.0, -1.2));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Caricature {
    /// Strength of the drift in the direction (0, 1, 1).
    pub alpha: f64,
    /// Strength of the attraction (0, -y, -z).
    pub beta: f64,
    /// The constant v+ (the paper's v of eq. 4).
    pub v_plus: f64,
    /// The constant v- (the paper's w of eq. 4).
    pub v_minus: f64,
    /// The sign of z in f-.
    #[serde(default)]
    pub first_component_of_minus: MinusSign,
}

/// The sign of z in the first component of f-.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MinusSign {
    /// +z, as in eq. (4): the origin is an invisible two-fold.
    #[default]
    Equation4,
    /// -z, as printed in eq. (5): a misprint, kept to show what it does.
    PrintedInEquation5,
}

impl Caricature {
    /// The paper's v+ = -1.2 and v- = -1.4, with the given re-injection.
    pub fn with_reinjection(alpha: f64, beta: f64) -> Self {
        Self {
            alpha,
            beta,
            v_plus: -1.2,
            v_minus: -1.4,
            first_component_of_minus: MinusSign::Equation4,
        }
    }

    /// The re-injection term's y and z components.
    #[inline(always)]
    fn reinjection<S: Elementary>(&self, x: &SVector<S, 3>) -> (S, S) {
        let r2 = x[0].squared() + x[1].squared() + x[2].squared();
        let alpha = S::from_f64(self.alpha);
        ((alpha - x[1].scale(self.beta)) * r2, (alpha - x[2].scale(self.beta)) * r2)
    }
}

impl PiecewiseSmooth<3> for Caricature {
    #[inline(always)]
    fn switching<S: Elementary>(&self, x: &SVector<S, 3>) -> S {
        x[0]
    }

    #[inline(always)]
    fn plus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        let (dy, dz) = self.reinjection(x);
        Vector3::new(-x[1], S::one() + dy, S::from_f64(self.v_plus) + dz)
    }

    #[inline(always)]
    fn minus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        let (dy, dz) = self.reinjection(x);
        let first = match self.first_component_of_minus {
            MinusSign::Equation4 => x[2],
            MinusSign::PrintedInEquation5 => -x[2],
        };
        Vector3::new(first, S::from_f64(self.v_minus) + dy, S::one() + dz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_by_hand() {
        let c = Caricature::with_reinjection(1e-1, 1e-5);
        let x = Vector3::new(0.2, 0.5, -1.0);
        let r2 = 0.04 + 0.25 + 1.0;
        assert_eq!(c.switching(&x), 0.2);
        let p = c.plus(&x);
        assert!(
            (p - Vector3::new(-0.5, 1.0 + (0.1 - 0.5e-5) * r2, -1.2 + (0.1 + 1e-5) * r2)).norm()
                < 1e-15
        );
        let m = c.minus(&x);
        assert!(
            (m - Vector3::new(-1.0, -1.4 + (0.1 - 0.5e-5) * r2, 1.0 + (0.1 + 1e-5) * r2)).norm()
                < 1e-15
        );
    }
}
