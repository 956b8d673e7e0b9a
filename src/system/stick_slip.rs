//! A stick-slip oscillator: a block on a moving belt, held by a spring.

use nalgebra::{SVector, vector};
use serde::{Deserialize, Serialize};

use super::PiecewiseSmooth;
use crate::num::Elementary;

/// x' = v, v' = -x - sign(h) (friction - weakening |h|), h = v - belt: unit mass and spring, dry friction that weakens
/// linearly with the slip speed (the textbook case of di Bernardo et al. 2008, sec. 1.2.3, with a linear law, so that
/// every piece of the motion has a closed form).
///
/// Sticking is x' = belt, |x| < friction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StickSlip {
    /// Speed of the belt.
    pub belt: f64,
    /// Friction force at zero slip speed.
    pub friction: f64,
    /// Loss of friction force per unit of slip speed.
    pub weakening: f64,
}

impl StickSlip {
    fn with_sign<S: Elementary>(&self, x: &SVector<S, 2>, sign: f64) -> SVector<S, 2> {
        let slip = x[1] - S::from_f64(self.belt);
        vector![x[1], slip.scale(self.weakening) - x[0] - S::from_f64(sign * self.friction)]
    }
}

impl PiecewiseSmooth<2> for StickSlip {
    fn switching<S: Elementary>(&self, x: &SVector<S, 2>) -> S {
        x[1] - S::from_f64(self.belt)
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        self.with_sign(x, 1.0)
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        self.with_sign(x, -1.0)
    }
}
