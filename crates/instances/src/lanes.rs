//! Many orbits side by side in the lanes of vector registers.

use nalgebra::SVector;
use twofold_analyse::SectionRecorder;
use twofold_analyse::lyapunov::{self, Exponent};
use twofold_integrate::ensemble::{Common, End, EnsembleRun, InstructionSet, ensemble_in_vectors};
use twofold_integrate::{Failure, Monitor};
use twofold_system::{Caricature, Compiled, ParameterBatch, Smoothed, System, Transition};

/// The end of a run among others, and its section.
pub type Section<const N: usize> = End<SectionRecorder<N>, N>;

/// Equations of `N` states whose orbits run side by side.
pub trait Lanes<const N: usize> {
    /// The sections of orbits, as [`ensemble_in_vectors`] gives them; each in a recorder as
    /// `section` is.
    fn sections(
        &self,
        set: InstructionSet,
        runs: &[EnsembleRun<N>],
        common: Common<'_, N>,
        section: &SectionRecorder<N>,
        finished: &mut dyn FnMut(usize, Section<N>),
    ) -> bool;
}

macro_rules! lanes {
    ($($n:literal $equations:ty;)*) => {
        $(impl Lanes<$n> for $equations {
            fn sections(
                &self,
                set: InstructionSet,
                runs: &[EnsembleRun<$n>],
                common: Common<'_, $n>,
                section: &SectionRecorder<$n>,
                finished: &mut dyn FnMut(usize, Section<$n>),
            ) -> bool {
                ensemble_in_vectors(set, self, runs, common, |_| section.clone(), finished)
            }
        })*
    };
}

lanes! {
    2 ParameterBatch<2>;
    3 ParameterBatch<3>;
    4 ParameterBatch<4>;
    3 Smoothed<Caricature>;
}

/// Equations of `N` states with one tangent vector, whose exponents are computed side by side.
pub trait Exponents<const N: usize> {
    /// As [`lyapunov::largest_side_by_side`].
    fn exponents(
        &self,
        set: InstructionSet,
        starts: &[SVector<f64, N>],
        settings: &lyapunov::LyapunovOptions,
        monitor: &dyn Monitor,
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
                monitor: &dyn Monitor,
            ) -> Option<Vec<Result<Exponent, Failure>>> {
                lyapunov::largest_side_by_side::<$n, $m, _>(set, self, starts, settings, monitor)
            }
        })*
    };
}

exponents!(2 4, 3 6, 4 8);

/// The smoothed equation of the paper's system, if `system` is that: compiled, it gives the same
/// bits sooner.
pub fn smoothed_in_lanes(
    system: &System,
    transition: Transition,
    eps: f64,
) -> Option<impl Lanes<3>> {
    match system.compiled() {
        Some(Compiled::Caricature(system)) => Some(Smoothed { system, transition, eps }),
        _ => None,
    }
}
