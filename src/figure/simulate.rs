//! From a spec to a recording. Pure: the same spec gives the same bytes.

use nalgebra::{SVector, vector};

use super::spec::{Method, Observation, RunSpec, SpecError, SwitchSpec, SystemSpec};
use crate::integrate::{Dopri5, Failure, Lsoda, Observer, Radau5, Statistics, Stepper, Watch, drive};
use crate::model::{Hysteretic, PiecewiseSmooth, Smoothed, VectorField};
use crate::observe::{Crossing, PathRecorder, Sample, SectionRecorder};

/// What a run left behind.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// The recorded points.
    pub data: Data,
    /// Final time.
    pub t: f64,
    /// Final state (first three components).
    pub x: [f64; 3],
    /// Work done.
    pub statistics: Statistics,
    /// The largest number of steps between restarts; NDSolve's default limit is 10,000.
    pub most_steps_in_segment: u64,
}

/// Recorded points.
#[derive(Clone, Debug, PartialEq)]
pub enum Data {
    /// A path.
    Path(Vec<Sample>),
    /// A Poincare section.
    Section(Vec<Crossing>),
}

impl Data {
    /// Number of recorded points.
    pub fn len(&self) -> usize {
        match self {
            Data::Path(samples) => samples.len(),
            Data::Section(crossings) => crossings.len(),
        }
    }

    /// Whether nothing was recorded.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Why a run gave no recording.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RunError {
    /// The spec is wrong.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// The integration failed.
    #[error(transparent)]
    Integration(#[from] Failure),
}

/// Computes a run.
pub fn simulate(spec: &RunSpec, watch: &dyn Watch) -> Result<Recording, RunError> {
    spec.validate()?;
    match spec.system {
        SystemSpec::Caricature(system) => switch(spec, system, watch),
        SystemSpec::Wheel(system) => switch(spec, system, watch),
    }
}

fn switch<P: PiecewiseSmooth<3> + Copy>(spec: &RunSpec, system: P, watch: &dyn Watch) -> Result<Recording, RunError> {
    let x0 = SVector::from(spec.start);
    match spec.switch {
        SwitchSpec::Smoothed { eps, transition } => observe(spec, &Smoothed { system, transition, eps }, x0, watch),
        SwitchSpec::Hysteretic { eps, eps_prime, relaxation, phi0 } => {
            let field = Hysteretic { system, eps, eps_prime, relaxation };
            observe(spec, &field, vector![x0[0], x0[1], x0[2], phi0], watch)
        }
    }
}

fn observe<F: VectorField<N>, const N: usize>(
    spec: &RunSpec,
    field: &F,
    x0: SVector<f64, N>,
    watch: &dyn Watch,
) -> Result<Recording, RunError> {
    match spec.observe {
        Observation::Path { chord } => {
            let mut recorder = PathRecorder::new(&x0, chord);
            let end = integrate(spec, field, x0, &mut recorder, watch)?;
            Ok(end.recording(Data::Path(recorder.into_samples())))
        }
        Observation::Section { coordinate, value } => {
            let mut recorder = SectionRecorder::new(coordinate, value);
            let end = integrate(spec, field, x0, &mut recorder, watch)?;
            Ok(end.recording(Data::Section(recorder.into_crossings())))
        }
    }
}

fn integrate<F: VectorField<N>, O: Observer<N>, const N: usize>(
    spec: &RunSpec,
    field: &F,
    x0: SVector<f64, N>,
    observer: &mut O,
    watch: &dyn Watch,
) -> Result<End, RunError> {
    match spec.method.name {
        Method::Lsoda => step(spec, field, x0, Lsoda::new(spec.method.tolerance), observer, watch),
        Method::Dopri5 => step(spec, field, x0, Dopri5::new(spec.method.tolerance), observer, watch),
        Method::Radau5 => step(spec, field, x0, Radau5::new(spec.method.tolerance), observer, watch),
    }
}

fn step<F: VectorField<N>, M: Stepper<N>, O: Observer<N>, const N: usize>(
    spec: &RunSpec,
    field: &F,
    x0: SVector<f64, N>,
    mut stepper: M,
    observer: &mut O,
    watch: &dyn Watch,
) -> Result<End, RunError> {
    let method = &spec.method;
    let summary =
        drive(field, x0, spec.t_end, &mut stepper, &spec.schedule, method.step_cap, method.max_steps, observer, watch)?;
    Ok(End {
        t: summary.t,
        x: [summary.x[0], summary.x[1], summary.x[2]],
        statistics: summary.statistics,
        most_steps_in_segment: summary.most_steps_in_segment,
    })
}

/// The end of a run, before its data join it.
struct End {
    t: f64,
    x: [f64; 3],
    statistics: Statistics,
    most_steps_in_segment: u64,
}

impl End {
    fn recording(self, data: Data) -> Recording {
        let End { t, x, statistics, most_steps_in_segment } = self;
        Recording { data, t, x, statistics, most_steps_in_segment }
    }
}
