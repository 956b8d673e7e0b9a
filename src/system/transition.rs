//! Transition functions phi, eq. (9): how the smoothed system passes from f- to f+.

use serde::{Deserialize, Serialize};

use crate::num::Elementary;

/// A transition function phi(h, eps), tending to 1 for h > eps and to 0 for h < -eps.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Transition {
    /// phi = (1 + tanh(h/eps))/2, sec. 4.1.
    Tanh,
    /// phi = (1 + tanh(h/eps))/2 + sigma sqrt(eps) exp(-h^2), fig. 8. Note that the perturbation is of size sqrt(eps),
    /// not eps, and has width 1 in h, not eps: it reaches far outside the layer.
    PerturbedTanh {
        /// Size of the perturbation.
        sigma: f64,
    },
}

impl Transition {
    /// phi at the value `h` of the switching function, for the stiffness parameter `eps`.
    #[inline]
    pub fn eval<S: Elementary>(&self, h: S, eps: f64) -> S {
        let step = (S::one() + (h / S::from_f64(eps)).tanh()).scale(0.5);
        match *self {
            Transition::Tanh => step,
            Transition::PerturbedTanh { sigma } => step + (-(h * h)).exp().scale(sigma * Elementary::sqrt(eps)),
        }
    }
}
