//! The hysteretic system, eqs (8) and (10): phi becomes a state.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use super::smoothed::blend;
use super::{PiecewiseSmooth, VectorField};
use twofold_num::tape::Recorded;
use twofold_num::{Arithmetic, Elementary};

/// The reading of eq. (10)'s two divisions by eps'.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Relaxation {
    /// Literally: psi's argument is already divided by eps', and psi(w) = (1 + tanh(w/eps'))/2
    /// divides once more. phi relaxes to (1 + tanh((h + eps (2 phi - 1))/eps'^2))/2. This gives the
    /// intricate attractor that the text reports.
    #[default]
    Literal,
    /// One division: phi relaxes to (1 + tanh((h + eps (2 phi - 1))/eps'))/2.
    Single,
}

impl Relaxation {
    /// phi' as operations.
    pub(super) fn record(
        self,
        h: Recorded,
        phi: Recorded,
        eps: Recorded,
        eps_prime: Recorded,
    ) -> Recorded {
        let width = match self {
            Relaxation::Literal => eps_prime * eps_prime,
            Relaxation::Single => eps_prime,
        };
        let w = h + (phi.scale(2.0) - Recorded::one()) * eps;
        let psi = (Recorded::one() + (w / width).tanh()).scale(0.5);
        (psi - phi) / eps_prime
    }
}

/// x' = f- + (f+ - f-) phi, eps' phi' = psi - phi. State (x, phi), dimension `N + 1`.
///
/// ```
/// use nalgebra::Vector4;
/// use twofold_system::{Caricature, Hysteretic, Relaxation, VectorField};
/// let system = Caricature::with_reinjection(1e-3, 1e-5);
/// let relaxation = Relaxation::Literal;
/// let hysteretic = Hysteretic { system, eps: 1e-3, eps_prime: 1e-2, relaxation };
/// let x = Vector4::new(1.0, 0.0, 0.0, 1.0); // the state and phi
/// assert_eq!(hysteretic.eval(&x)[3], 0.0); // phi is 1 and stays 1 where h > eps
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hysteretic<P> {
    /// The piecewise-smooth system.
    pub system: P,
    /// Half-width of the hysteresis loop in h.
    pub eps: f64,
    /// Relaxation time eps' (the paper: 10 eps).
    pub eps_prime: f64,
    /// The reading of eq. (10).
    pub relaxation: Relaxation,
}

/// Implemented for each dimension, because `N + 1` cannot yet be written in stable Rust's const
/// generics.
macro_rules! hysteretic_in_dimension {
    ($n:literal, $m:literal) => {
        impl<P: PiecewiseSmooth<$n>> VectorField<$m> for Hysteretic<P> {
            const INTERPRETED: bool = P::INTERPRETED;
            #[inline]
            fn eval<S: Elementary>(&self, state: &SVector<S, $m>) -> SVector<S, $m> {
                let x = SVector::<S, $n>::from_fn(|i, _| state[i]);
                let phi = state[$n];
                let motion = blend(&self.system, &x, phi);
                let width = match self.relaxation {
                    Relaxation::Literal => self.eps_prime * self.eps_prime,
                    Relaxation::Single => self.eps_prime,
                };
                let w = self.system.switching(&x) + (phi.scale(2.0) - S::one()).scale(self.eps);
                let psi = (S::one() + (w / S::from_f64(width)).tanh()).scale(0.5);
                let relaxation = (psi - phi) / S::from_f64(self.eps_prime);
                SVector::from_fn(|i, _| if i < $n { motion[i] } else { relaxation })
            }
        }
    };
}

hysteretic_in_dimension!(2, 3);
hysteretic_in_dimension!(3, 4);
