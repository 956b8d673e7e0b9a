//! The two-fold normal form, eq. (4), for all sign types.

use nalgebra::{SVector, vector};
use serde::{Deserialize, Serialize};

use super::PiecewiseSmooth;
use super::filippov::Visibility;
use crate::num::Elementary;

/// f+ = (-a y, 1, v), f- = (b z, w, 1) with h = x, where a = 1 (b = 1) makes the fold of f+ (of f-) invisible and -1 visible
/// (Jeffrey & Colombo 2009). Both invisible is the paper's eq. (4).
///
/// L+h = -a y and L-h = b z. The desingularised sliding flow is (y, z)' = (b z + a w y, b v z + a y), time t' = b z + a y.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TwoFoldNormalForm {
    /// The fold of f+.
    pub plus: Visibility,
    /// The fold of f-.
    pub minus: Visibility,
    /// The constant v.
    pub v: f64,
    /// The constant w.
    pub w: f64,
}

impl TwoFoldNormalForm {
    /// The paper's case, invisible from both sides.
    pub fn invisible(v: f64, w: f64) -> Self {
        Self { plus: Visibility::Invisible, minus: Visibility::Invisible, v, w }
    }

    fn signs(&self) -> (f64, f64) {
        let sign = |visibility| match visibility {
            Visibility::Invisible => 1.0,
            Visibility::Visible => -1.0,
        };
        (sign(self.plus), sign(self.minus))
    }
}

impl PiecewiseSmooth<3> for TwoFoldNormalForm {
    fn switching<S: Elementary>(&self, x: &SVector<S, 3>) -> S {
        x[0]
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        vector![x[1].scale(-self.signs().0), S::one(), S::from_f64(self.v)]
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        vector![x[2].scale(self.signs().1), S::from_f64(self.w), S::one()]
    }
}
