//! The smoothed system, eq. (8).

use nalgebra::SVector;

use super::{PiecewiseSmooth, Transition, VectorField};
use twofold_num::Elementary;

/// x' = f- + (f+ - f-) phi(h/eps): a smooth vector field that tends to `system` as eps -> 0.
///
/// ```
/// use nalgebra::Vector3;
/// use twofold_system::{Caricature, PiecewiseSmooth, Smoothed, Transition, VectorField};
/// let system = Caricature::with_reinjection(1e-3, 1e-5);
/// let smoothed = Smoothed { system, transition: Transition::Tanh, eps: 1e-3 };
/// let x = Vector3::new(1.0, 0.0, 0.0); // far outside the layer the field is f+
/// assert!((smoothed.eval(&x) - system.plus(&x)).norm() < 1e-15);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothed<P> {
    /// The piecewise-smooth system.
    pub system: P,
    /// The transition function.
    pub transition: Transition,
    /// The stiffness parameter: half-width of the layer in h.
    pub eps: f64,
}

impl<P: PiecewiseSmooth<N>, const N: usize> VectorField<N> for Smoothed<P> {
    const INTERPRETED: bool = P::INTERPRETED;
    #[inline(always)]
    fn eval<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        let phi = self.transition.eval(self.system.switching(x), self.eps);
        blend(&self.system, x, phi)
    }
}

/// f- + (f+ - f-) phi, eq. (8), for a given phi. (1 - phi, phi) weights would not be the paper's
/// formula in rounding.
// Always inlined, like the equations: a run in lanes must have them compiled for its own
// instruction set.
#[inline(always)]
pub(super) fn blend<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    system: &P,
    x: &SVector<S, N>,
    phi: S,
) -> SVector<S, N> {
    let plus = system.plus(x);
    let mut blended = system.minus(x);
    for i in 0..N {
        blended[i] = blended[i] + (plus[i] - blended[i]) * phi;
    }
    blended
}

/// f- + (f+ - f-) phi for a prescribed number phi: the field of a system whose switch is decided
/// elsewhere.
#[derive(Clone, Copy, Debug)]
pub struct Blended<'a, P> {
    /// The piecewise-smooth system.
    pub system: &'a P,
    /// The weight of f+.
    pub phi: f64,
}

impl<P: PiecewiseSmooth<N>, const N: usize> VectorField<N> for Blended<'_, P> {
    const INTERPRETED: bool = P::INTERPRETED;
    #[inline(always)]
    fn eval<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        blend(self.system, x, S::from_f64(self.phi))
    }
}
