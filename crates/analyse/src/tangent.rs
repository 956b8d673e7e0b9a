//! A vector field together with its variational equation.

use nalgebra::SVector;

use twofold_num::{Dual, Elementary};
use twofold_system::VectorField;

/// The system (x, V)' = (f(x), Df(x) V) for `W` tangent vectors, stored after x one after another.
/// The derivative is taken of the equation itself with dual numbers: one evaluation gives f and all
/// W directional derivatives.
#[derive(Clone, Copy, Debug)]
pub struct Tangent<'a, F, const W: usize>(pub &'a F);

/// For each dimension and number of vectors in use, because `N (W + 1)` cannot yet be written in
/// stable Rust's const generics.
macro_rules! tangent {
    ($($n:literal, $w:literal);*) => { $(
        impl<F: VectorField<$n>> VectorField<{ $n * ($w + 1) }> for Tangent<'_, F, $w> {
        const INTERPRETED: bool = F::INTERPRETED;
            #[inline]
            fn eval<S: Elementary>(&self, state: &SVector<S, { $n * ($w + 1) }>) -> SVector<S,
                { $n * ($w + 1) }> {
                let x = SVector::<Dual<S, $w>, $n>::from_fn(|i, _| Dual {
                    value: state[i],
                    partials: std::array::from_fn(|j| state[$n * (j + 1) + i]),
                });
                let f = self.0.eval(&x);
                SVector::from_fn(|i, _| if i < $n { f[i].value } else {
                    f[i % $n].partials[i / $n - 1] })
            }
        }
    )* };
}

tangent!(2, 1; 2, 2; 3, 1; 3, 3; 4, 1; 4, 4);
