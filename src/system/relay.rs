//! A bang-bang relay: the double integrator x'' = -sign(h).

use nalgebra::{SVector, vector};
use serde::{Deserialize, Serialize};

use super::PiecewiseSmooth;
use crate::num::Elementary;

/// The switching curve of a [`Relay`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Feedback {
    /// h = x + gain v. Slides for |v| < gain, with x = x0 exp(-t/gain).
    Linear {
        /// The gain.
        gain: f64,
    },
    /// h = x + gain v |v|/2. Gain 1 is the time-optimal feedback (Pontryagin et al. 1962, sec. 5), whose switching curve is
    /// itself an orbit: there the Lie derivative vanishes identically. Above 1 the orbit slides into the origin in finite
    /// time; below 1 it switches infinitely often in finite time, each flight (1 - gain)/(1 + gain) to the power 1/2
    /// times as long as the one before (Fuller's phenomenon in its simplest form).
    Parabolic {
        /// The gain.
        gain: f64,
    },
}

/// x' = v, v' = -sign(h).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Relay {
    /// The switching curve.
    pub feedback: Feedback,
}

impl PiecewiseSmooth<2> for Relay {
    fn switching<S: Elementary>(&self, x: &SVector<S, 2>) -> S {
        let v = x[1];
        match self.feedback {
            Feedback::Linear { gain } => x[0] + v.scale(gain),
            Feedback::Parabolic { gain } => x[0] + (v * v.abs()).scale(0.5 * gain),
        }
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        vector![x[1], -S::one()]
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        vector![x[1], S::one()]
    }
}
