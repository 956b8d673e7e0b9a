//! From a spec to a recording. Pure: the same spec gives the same bytes.

use nalgebra::{SVector, vector};

use super::answer::{Answer, Stop};
use super::question::JobError;
use super::recording::{Data, Future, Recording};
use super::spec::{FunnelSpec, MethodSpec, Observation, RunSpec, SpecError, SwitchSpec};
use crate::analyse::path::MOST_POINTS;
use crate::analyse::{Motion, MotionRecorder, PathRecorder, Sample, SectionRecorder};
use crate::integrate::filippov::{
    self, AllModes, ExitRule, FilippovObserver, FilippovSummary, FunnelGrid, Mode, ModeEvent, SlidingFlow,
};
use crate::integrate::{Course, Flow, Observer, Step, Stepper, StopReason, Summary, Watch, WithStepper, drive};
use crate::system::{Bound, Compiled, Field, Hysteretic, PiecewiseSmooth, Smoothed, VectorField};

/// Computes a run of a system with three states.
///
/// # Errors
///
/// If the spec is wrong, the system has not three states, or the orbit cannot be followed.
pub fn simulate(spec: &RunSpec, watch: &dyn Watch) -> Result<Recording, JobError> {
    spec.validate()?;
    if spec.system.dimension() != 3 {
        return Err(too_many_states(spec, "three states are looked at here"));
    }
    let recording = three_states(spec, None, watch)?;
    if recording.stop == StopReason::Observer {
        return Err(full(recording.t));
    }
    Ok(recording)
}

/// Says of a state whether a run that has come there may end.
pub type Until<'a> = &'a dyn Fn(&[f64]) -> bool;

/// Computes the section of a smoothed or hysteretic run of a system with three states, and ends it at the first step's end of which `until`
/// holds: the recording then stops with [`StopReason::Observer`], and is otherwise that of [`simulate`].
///
/// # Errors
///
/// As [`simulate`].
pub fn simulate_until(spec: &RunSpec, until: Until<'_>, watch: &dyn Watch) -> Result<Recording, JobError> {
    spec.validate()?;
    if spec.system.dimension() != 3 {
        return Err(too_many_states(spec, "three states are looked at here"));
    }
    let recording = three_states(spec, Some(until), watch)?;
    if recording.stop == StopReason::Observer && recording.data.len() >= MOST_POINTS {
        return Err(full(recording.t));
    }
    Ok(recording)
}

/// Computes a run of a system with any number of states.
///
/// # Errors
///
/// If the spec is wrong, or the orbit cannot be followed.
pub fn answer(spec: &RunSpec, watch: &dyn Watch) -> Result<Answer, JobError> {
    spec.validate()?;
    let answer = match spec.system.dimension() {
        1 => record::<1, 2>(spec, None, watch)?.to_answer(spec),
        2 => record::<2, 3>(spec, None, watch)?.to_answer(spec),
        3 => three_states(spec, None, watch)?.to_answer(spec),
        4 => record::<4, 5>(spec, None, watch)?.to_answer(spec),
        5 => record::<5, 6>(spec, None, watch)?.to_answer(spec),
        6 => record::<6, 7>(spec, None, watch)?.to_answer(spec),
        7 => record::<7, 8>(spec, None, watch)?.to_answer(spec),
        8 => record::<8, 9>(spec, None, watch)?.to_answer(spec),
        _ => return Err(too_many_states(spec, "runs are computed with up to eight states")),
    };
    if answer.stop == Stop::Found { Err(full(answer.fact("t")?)) } else { Ok(answer) }
}

/// The only observers here are recorders, which stop a run when they are full.
fn full(t: f64) -> JobError {
    JobError::TooManyPoints { t, limit: MOST_POINTS }
}

/// What a dimension that is not provided for looks like to the one who asked.
fn too_many_states(spec: &RunSpec, rule: &'static str) -> JobError {
    SpecError { field: "system", value: format!("one of {} states", spec.system.dimension()), rule }.into()
}

/// Three states: by the compiled equations where there are some, which give the same bits as the recorded ones and give them sooner.
fn three_states(spec: &RunSpec, until: Option<Until<'_>>, watch: &dyn Watch) -> Result<Recording, JobError> {
    let x0 = start::<3>(spec);
    match (spec.system.compiled(), spec.switch) {
        (Some(Compiled::Caricature(system)), SwitchSpec::Smoothed { eps, transition }) => {
            observe(spec, &Smoothed { system, transition, eps }, x0, until, watch)
        }
        (Some(Compiled::Caricature(system)), SwitchSpec::Hysteretic { eps, eps_prime, relaxation, phi0 }) => {
            let field = Hysteretic { system, eps, eps_prime, relaxation };
            observe(spec, &field, vector![x0[0], x0[1], x0[2], phi0], until, watch)
        }
        (Some(Compiled::Caricature(system)), SwitchSpec::Filippov { exit, funnel }) => {
            discontinuous(spec, &system, x0, exit, funnel, watch)
        }
        (Some(Compiled::Wheel(system)), SwitchSpec::Smoothed { eps, transition }) => {
            observe(spec, &Smoothed { system, transition, eps }, x0, until, watch)
        }
        _ => record::<3, 4>(spec, until, watch),
    }
}

/// `D` states, by the recorded equations; `M` is `D + 1`.
fn record<const D: usize, const M: usize>(
    spec: &RunSpec,
    until: Option<Until<'_>>,
    watch: &dyn Watch,
) -> Result<Recording<D>, JobError>
where
    for<'a> SlidingFlow<'a, Bound<D>, D>: VectorField<M>,
{
    let x0 = start::<D>(spec);
    match spec.switch {
        SwitchSpec::Smoothed { eps, transition } => {
            let field = Field::smoothed(&spec.system, transition, eps).bind::<D>()?;
            observe(spec, &field, x0, until, watch)
        }
        SwitchSpec::Hysteretic { eps, eps_prime, relaxation, phi0 } => {
            let field = Field::hysteretic(&spec.system, eps, eps_prime, relaxation).bind::<M>()?;
            let x0 = SVector::<f64, M>::from_fn(|i, _| if i < D { x0[i] } else { phi0 });
            observe(spec, &field, x0, until, watch)
        }
        SwitchSpec::Filippov { exit, funnel } => {
            discontinuous(spec, &spec.system.bind::<D>()?, x0, exit, funnel, watch)
        }
    }
}

fn start<const D: usize>(spec: &RunSpec) -> SVector<f64, D> {
    SVector::from_fn(|i, _| spec.start.get(i).copied().unwrap_or(f64::NAN))
}

/// The discontinuous system, event by event.
fn discontinuous<P: PiecewiseSmooth<D>, const D: usize, const M: usize>(
    spec: &RunSpec,
    system: &P,
    x0: SVector<f64, D>,
    exit: ExitRule,
    funnel: Option<FunnelSpec>,
    watch: &dyn Watch,
) -> Result<Recording<D>, JobError>
where
    for<'a> SlidingFlow<'a, P, D>: VectorField<M>,
{
    let settings = filippov::Settings {
        tolerance: spec.method.tolerance,
        max_step: spec.method.step_cap.for_segment(spec.t_end),
        max_steps: spec.method.max_steps,
        ..filippov::Settings::default()
    };
    let run = |observer: &mut dyn FilippovObserver<D>| {
        filippov::run_watched(system, x0, spec.t_end, &settings, exit, &mut AnyObserver(observer), watch)?
            .within_budget()
    };
    let recording = |data, summary: FilippovSummary<D>| Recording {
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
            let end = run(&mut recorder)?;
            Ok(recording(Data::Motion(recorder.into_motion()), end))
        }
        (Observation::Section { coordinate, value }, _) => {
            let mut recorder = SectionRecorder::new(coordinate, value);
            let end = run(&mut AllModes(&mut recorder))?;
            Ok(recording(Data::Section(recorder.into_crossings()), end))
        }
    }
}

/// Any observer, so that methods are compiled once for all of them.
struct AnyObserver<'a, O: ?Sized>(&'a mut O);

impl<const N: usize> FilippovObserver<N> for AnyObserver<'_, dyn FilippovObserver<N> + '_> {
    fn step(&mut self, mode: Mode, step: &Step<'_, N>) -> Flow {
        self.0.step(mode, step)
    }
    fn event(&mut self, event: &ModeEvent<N>) -> Flow {
        self.0.event(event)
    }
}

impl<const N: usize> Observer<N> for AnyObserver<'_, dyn Observer<N> + '_> {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        self.0.step(step)
    }
    fn kick(&mut self, t: f64, before: &SVector<f64, N>, after: &SVector<f64, N>) {
        self.0.kick(t, before, after);
    }
}

/// The funnel: the approach to the set-valued point, and its futures.
fn futures<P: PiecewiseSmooth<D>, const D: usize, const M: usize>(
    spec: &RunSpec,
    system: &P,
    x0: SVector<f64, D>,
    settings: &filippov::Settings,
    funnel: &FunnelSpec,
) -> Result<Recording<D>, JobError>
where
    for<'a> SlidingFlow<'a, P, D>: VectorField<M>,
{
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

fn motion<const D: usize>(trajectory: filippov::Trajectory<D>) -> Motion<D> {
    let samples =
        |points: Vec<(f64, SVector<f64, D>)>| points.into_iter().map(|(t, x)| Sample { t, x: x.into() }).collect();
    let pieces = trajectory.pieces.into_iter().map(|p| (p.mode, samples(p.points))).collect();
    Motion { pieces, events: trajectory.events }
}

fn observe<F: VectorField<N>, const D: usize, const N: usize>(
    spec: &RunSpec,
    field: &F,
    x0: SVector<f64, N>,
    until: Option<Until<'_>>,
    watch: &dyn Watch,
) -> Result<Recording<D>, JobError> {
    let (summary, data) = match spec.observe {
        Observation::Path { chord } => {
            let mut recorder = PathRecorder::<D>::new(&x0, chord);
            (integrate(spec, field, x0, D, &mut recorder, watch)?, Data::Path(recorder.into_samples()))
        }
        Observation::Section { coordinate, value } => {
            let mut recorder = SectionRecorder::<D>::new(coordinate, value);
            let summary = match until {
                None => integrate(spec, field, x0, D, &mut recorder, watch)?,
                Some(until) => {
                    integrate(spec, field, x0, D, &mut RecordUntil { recorder: &mut recorder, until }, watch)?
                }
            };
            (summary, Data::Section(recorder.into_crossings()))
        }
    };
    Ok(Recording {
        data,
        t: summary.t,
        x: std::array::from_fn(|i| summary.x[i]),
        statistics: summary.statistics,
        most_steps_in_segment: summary.most_steps_in_segment,
        stop: summary.stop,
    })
}

/// Records a section until a state is reached of which `until` holds.
struct RecordUntil<'a, const D: usize> {
    recorder: &'a mut SectionRecorder<D>,
    until: Until<'a>,
}

impl<const N: usize, const D: usize> Observer<N> for RecordUntil<'_, D> {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        match self.recorder.step(step) {
            Flow::Continue if (self.until)(step.x1.as_slice()) => Flow::Stop,
            flow => flow,
        }
    }
}

/// The run itself; `states` of the equation's components are the system's.
fn integrate<'a, F: VectorField<N>, const N: usize>(
    spec: &RunSpec,
    field: &'a F,
    x0: SVector<f64, N>,
    states: usize,
    observer: &'a mut (dyn Observer<N> + 'a),
    watch: &'a dyn Watch,
) -> Result<Summary<N>, JobError> {
    let MethodSpec { name, tolerance, step_cap, max_steps } = spec.method;
    let course = Course { t_end: spec.t_end, schedule: spec.schedule, step_cap, max_steps, kicked_states: states };
    name.with_stepper(tolerance, Drive { field, x0, course, observer: AnyObserver(observer), watch })
}

/// A run that waits for its method.
struct Drive<'a, F, const N: usize> {
    field: &'a F,
    x0: SVector<f64, N>,
    course: Course,
    observer: AnyObserver<'a, dyn Observer<N> + 'a>,
    watch: &'a dyn Watch,
}

impl<F: VectorField<N>, const N: usize> WithStepper<N> for Drive<'_, F, N> {
    type Answer = Result<Summary<N>, JobError>;
    fn with<M: Stepper<N>>(self, mut stepper: M) -> Self::Answer {
        let Self { field, x0, course, mut observer, watch } = self;
        Ok(drive(field, x0, &course, &mut stepper, &mut observer, watch)?.within_budget()?)
    }
}
