//! Transition functions phi, eq. (9): how the smoothed system passes from f- to f+.

use serde::{Deserialize, Serialize};

use twofold_num::tape::Recorded;
use twofold_num::{Arithmetic, Elementary};

/// A transition function phi(h, eps), tending to 1 for h > eps and to 0 for h < -eps.
///
/// ```
/// use twofold_system::Transition;
/// assert_eq!(Transition::Tanh.eval(0.0, 1e-3), 0.5);
/// assert_eq!(Transition::Tanh.eval(1.0, 1e-3), 1.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Transition {
    /// phi = (1 + tanh(h/eps))/2, sec. 4.1.
    Tanh,
    /// phi = (1 + tanh(h/eps))/2 + sigma sqrt(eps) exp(-h^2), fig. 8. Note that the perturbation is
    /// of size sqrt(eps), not eps, and has width 1 in h, not eps: it reaches far outside the layer.
    PerturbedTanh {
        /// Size of the perturbation.
        sigma: f64,
    },
    /// phi = 1/2 + arctan(h/eps)/pi: reaches 0 and 1 only like eps/h.
    Arctan,
    /// phi = (1 + u/sqrt(1 + u^2))/2 with u = h/eps: reaches 0 and 1 like (eps/h)^2.
    Algebraic,
    /// phi = (1 + erf(h/eps))/2: reaches 0 and 1 faster than exponentially.
    Erf,
}

impl Transition {
    /// phi at the value `h` of the switching function, for the stiffness parameter `eps`.
    #[inline(always)]
    pub fn eval<S: Elementary>(&self, h: S, eps: f64) -> S {
        let width = S::from_f64(eps);
        // h/eps in every arm, and not once before them: where tanh is prescribed (`num::Given`) it
        // is not needed.
        match *self {
            Transition::Tanh => half((h / width).tanh()),
            Transition::PerturbedTanh { sigma } => {
                half((h / width).tanh()) + (-(h * h)).exp().scale(sigma * Elementary::sqrt(eps))
            }
            Transition::Arctan => {
                (h / width).atan() / S::from_f64(std::f64::consts::PI) + S::from_f64(0.5)
            }
            Transition::Algebraic => {
                let u = h / width;
                half(u / (S::one() + u * u).sqrt())
            }
            Transition::Erf => half((h / width).erf()),
        }
    }

    /// phi as operations, with eps as a parameter of its own.
    pub(super) fn record(&self, h: Recorded, eps: Recorded) -> Recorded {
        let u = h / eps;
        match *self {
            Transition::Tanh => half(u.tanh()),
            Transition::PerturbedTanh { sigma } => {
                let sigma = Recorded::parameter("sigma", &sigma.into());
                half(u.tanh()) + (-(h * h)).exp() * (sigma * eps.sqrt())
            }
            Transition::Arctan => u.atan() / Recorded::pi() + Recorded::from_f64(0.5),
            Transition::Algebraic => half(u / (Recorded::one() + u * u).sqrt()),
            Transition::Erf => half(u.erf()),
        }
    }
}

/// (1 + step)/2
#[inline(always)]
fn half<S: Elementary>(step: S) -> S {
    (S::one() + step).scale(0.5)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_transition_goes_from_0_to_1_through_one_half() {
        for t in [Transition::Tanh, Transition::Arctan, Transition::Algebraic, Transition::Erf] {
            let phi = |u: f64| t.eval(u * 1e-2, 1e-2);
            assert_eq!(phi(0.0), 0.5, "{t:?}");
            assert!((phi(1e9) - 1.0).abs() < 1e-8 && phi(-1e9).abs() < 1e-8, "{t:?}");
            for u in [0.1, 0.7, 3.0] {
                assert!((phi(u) + phi(-u) - 1.0).abs() < 1e-15 && phi(u) > phi(0.5 * u), "{t:?}");
            }
        }
        // Known values at u = 1.
        for (t, want) in [
            (Transition::Tanh, 0.880_797_077_977_882_4),
            (Transition::Arctan, 0.75),
            (Transition::Algebraic, 0.853_553_390_593_273_8),
            (Transition::Erf, 0.921_350_396_474_857_4),
        ] {
            assert!((t.eval(0.3_f64, 0.3) - want).abs() < 1e-15, "{t:?}");
        }
    }
}
