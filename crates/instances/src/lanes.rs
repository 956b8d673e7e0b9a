//! Many orbits side by side in the lanes of vector registers.

use twofold_analyse::SectionRecorder;
use twofold_integrate::ensemble::{Common, End, EnsembleRun, InstructionSet, ensemble_in_vectors};
use twofold_system::{Caricature, ParameterBatch, Smoothed, System, Transition};

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

/// The smoothed equation of the paper's system, if `system` is that: compiled, it gives the same
/// bits sooner.
pub fn smoothed_in_lanes(
    system: &System,
    transition: Transition,
    eps: f64,
) -> Option<impl Lanes<3>> {
    system.compiled().map(|system| Smoothed { system, transition, eps })
}
