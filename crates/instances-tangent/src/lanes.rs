//! Exponents of many orbits side by side in the lanes of vector registers.

use nalgebra::SVector;
use twofold_analyse::lyapunov::{self, Exponent};
use twofold_integrate::ensemble::InstructionSet;
use twofold_integrate::{Failure, Monitor};
use twofold_system::ParameterBatch;

/// Equations of `N` states with one tangent vector, whose exponents are computed side by side.
pub trait Exponents<const N: usize> {
    /// As [`lyapunov::largest_side_by_side`].
    fn exponents(
        &self,
        set: InstructionSet,
        starts: &[SVector<f64, N>],
        settings: &lyapunov::LyapunovOptions,
        watch: &dyn Monitor,
    ) -> Option<Vec<Result<Exponent, Failure>>>;
}

macro_rules! exponents {
    ($($n:literal $m:literal),*) => {
        $(impl Exponents<$n> for ParameterBatch<$m> {
            fn exponents(
                &self,
                set: InstructionSet,
                starts: &[SVector<f64, $n>],
                settings: &lyapunov::LyapunovOptions,
                watch: &dyn Monitor,
            ) -> Option<Vec<Result<Exponent, Failure>>> {
                lyapunov::largest_side_by_side::<$n, $m, _>(set, self, starts, settings, watch)
            }
        })*
    };
}

exponents!(2 4, 3 6, 4 8);
