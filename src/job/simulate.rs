//! From a spec to a recording. Pure: the same spec gives the same bytes.

use nalgebra::{SVector, vector};

use super::question::JobError;
use super::recording::{Data, Future, Recording};
use super::spec::{FunnelSpec, MethodSpec, Observation, RunSpec, SwitchSpec, SystemSpec};
use crate::analyse::path::MOST_POINTS;
use crate::analyse::{Motion, MotionRecorder, PathRecorder, Sample, SectionRecorder};
use crate::integrate::filippov::{self, AllModes, ExitRule, FilippovSummary, FunnelGrid};
use crate::integrate::{Course, Observer, Statistics, Stepper, StopReason, Watch, WithStepper, drive};
use crate::system::{Hysteretic, PiecewiseSmooth, Smoothed, VectorField};

/// Computes a run.
pub fn simulate(spec: &RunSpec, watch: &dyn Watch) -> Result<Recording, JobError> {
    spec.validate()?;
    let recording = match spec.system {
        SystemSpec::Caricature(system) => switch(spec, system, watch),
        SystemSpec::Wheel(system) => switch(spec, system, watch),
    }?;
    // The only observers here are recorders, which stop a run when they are full.
    if recording.stop == StopReason::Observer {
        return Err(JobError::TooManyPoints { t: recording.t, limit: MOST_POINTS });
    }
    Ok(recording)
}

fn switch<P: PiecewiseSmooth<3> + Copy>(spec: &RunSpec, system: P, watch: &dyn Watch) -> Result<Recording, JobError> {
    let x0 = SVector::from(spec.start);
    match spec.switch {
        SwitchSpec::Smoothed { eps, transition } => observe(spec, &Smoothed { system, transition, eps }, x0, watch),
        SwitchSpec::Hysteretic { eps, eps_prime, relaxation, phi0 } => {
            let field = Hysteretic { system, eps, eps_prime, relaxation };
            observe(spec, &field, vector![x0[0], x0[1], x0[2], phi0], watch)
        }
        SwitchSpec::Filippov { exit, funnel } => discontinuous(spec, &system, x0, exit, funnel, watch),
    }
}

/// The discontinuous system, event by event.
fn discontinuous<P: PiecewiseSmooth<3>>(
    spec: &RunSpec,
    system: &P,
    x0: SVector<f64, 3>,
    exit: ExitRule,
    funnel: Option<FunnelSpec>,
    watch: &dyn Watch,
) -> Result<Recording, JobError> {
    let settings = filippov::Settings {
        tolerance: spec.method.tolerance,
        max_step: spec.method.step_cap.for_segment(spec.t_end),
        max_steps: spec.method.max_steps,
        ..filippov::Settings::default()
    };
    let recording = |data, summary: FilippovSummary<3>| Recording {
        data,
        t: summary.t,
        x: summary.x.into(),
        most_steps_in_segment: summary.statistics.steps,
        statistics: summary.statistics,
        stop: summary.stop,
    };
    match (spec.observe, funnel) {
        (Observation::Path { .. }, Some(funnel)) => futures(spec, system, x0, &settings, &funnel),
        (Observation::Path { chord }, None) => {
            let mut recorder = MotionRecorder::new(chord);
            let end = filippov::run_watched(system, x0, spec.t_end, &settings, exit, &mut recorder, watch)?;
            Ok(recording(Data::Motion(recorder.into_motion()), end.within_budget()?))
        }
        (Observation::Section { coordinate, value }, _) => {
            let mut recorder = SectionRecorder::new(coordinate, value);
            let mut all = AllModes(&mut recorder);
            let end = filippov::run_watched(system, x0, spec.t_end, &settings, exit, &mut all, watch)?;
            Ok(recording(Data::Section(recorder.into_crossings()), end.within_budget()?))
        }
    }
}

/// The funnel: the approach to the set-valued point, and its futures.
fn futures<P: PiecewiseSmooth<3>>(
    spec: &RunSpec,
    system: &P,
    x0: SVector<f64, 3>,
    settings: &filippov::Settings,
    funnel: &FunnelSpec,
) -> Result<Recording, JobError> {
    let grid = FunnelGrid {
        shortest: funnel.shortest,
        longest: funnel.longest,
        times: funnel.times,
        horizon: funnel.horizon,
        until_two_fold: funnel.until_two_fold,
        per_step: POINTS_PER_STEP,
    };
    let found = filippov::funnel(system, x0, spec.t_end, settings, &grid)?;
    let mut statistics = found.statistics.clone();
    let mut most_steps_in_segment = statistics.steps;
    for member in &found.members {
        statistics += &member.summary.statistics;
        most_steps_in_segment = most_steps_in_segment.max(member.summary.statistics.steps);
    }
    let futures = found
        .members
        .into_iter()
        .map(|m| Future { exit_time: m.exit_time, side: m.side, motion: motion(m.trajectory) })
        .collect();
    Ok(Recording {
        data: Data::Funnel { approach: motion(found.approach), futures },
        t: found.t,
        x: found.point.into(),
        most_steps_in_segment,
        statistics,
        stop: StopReason::SetValued,
    })
}

/// Recorded points in each step of a funnel's orbits.
const POINTS_PER_STEP: usize = 6;

fn motion(trajectory: filippov::Trajectory<3>) -> Motion {
    let samples =
        |points: Vec<(f64, SVector<f64, 3>)>| points.into_iter().map(|(t, x)| Sample { t, x: x.into() }).collect();
    let pieces = trajectory.pieces.into_iter().map(|p| (p.mode, samples(p.points))).collect();
    Motion { pieces, events: trajectory.events }
}

fn observe<F: VectorField<N>, const N: usize>(
    spec: &RunSpec,
    field: &F,
    x0: SVector<f64, N>,
    watch: &dyn Watch,
) -> Result<Recording, JobError> {
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
) -> Result<End, JobError> {
    let MethodSpec { name, tolerance, step_cap, max_steps } = spec.method;
    let course = Course { t_end: spec.t_end, schedule: spec.schedule, step_cap, max_steps };
    name.with_stepper(tolerance, Drive { field, x0, course, observer, watch })
}

/// A run that waits for its method.
struct Drive<'a, F, O, const N: usize> {
    field: &'a F,
    x0: SVector<f64, N>,
    course: Course,
    observer: &'a mut O,
    watch: &'a dyn Watch,
}

impl<F: VectorField<N>, O: Observer<N>, const N: usize> WithStepper<N> for Drive<'_, F, O, N> {
    type Answer = Result<End, JobError>;
    fn with<M: Stepper<N>>(self, mut stepper: M) -> Self::Answer {
        let Self { field, x0, course, observer, watch } = self;
        let summary = drive(field, x0, &course, &mut stepper, observer, watch)?.within_budget()?;
        Ok(End {
            t: summary.t,
            x: [summary.x[0], summary.x[1], summary.x[2]],
            statistics: summary.statistics,
            most_steps_in_segment: summary.most_steps_in_segment,
            stop: summary.stop,
        })
    }
}

/// The end of a run, before its data join it.
struct End {
    t: f64,
    x: [f64; 3],
    statistics: Statistics,
    most_steps_in_segment: u64,
    stop: StopReason,
}

impl End {
    fn recording(self, data: Data) -> Recording {
        let End { t, x, statistics, most_steps_in_segment, stop } = self;
        Recording { data, t, x, statistics, most_steps_in_segment, stop }
    }
}
