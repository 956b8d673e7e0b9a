//! From a spec to a recording. Pure: the same spec gives the same bytes.

use std::cell::Cell;

use nalgebra::{SVector, Vector4};

use super::answer::{Answer, Stop};
use super::question::JobError;
use super::recording::{Data, Future, Recording};
use super::spec::{FunnelSpec, MethodSpec, Observation, RunSpec, SpecError, SwitchSpec};
use super::table::Table;
use twofold_analyse::path::MOST_POINTS;
use twofold_analyse::{
    Motion, MotionRecorder, PathRecorder, Sample, SectionRecorder, TimedMotion, TimesRecorder,
};
use twofold_instances::{self as instances, How, Orbits};
use twofold_instances_switched::{self as switched, Late, Motions, TwoSurfaces};
use twofold_integrate::delay::{DelayError, History};
use twofold_integrate::filippov::{
    self, AllModes, ExitRule, Faces, FilippovObserver, FilippovSummary, FunnelGrid, Mode, ModeEvent,
};
use twofold_integrate::{
    DriveOptions, Extents, Flow, Monitor, Observer, Statistics, Step, StopReason, Summary,
};
use twofold_system::{Bound, BoundField, Field};

/// Computes a run of a system with three states.
///
/// # Errors
///
/// If the spec is wrong, the system has not three states, or the orbit cannot be followed.
pub fn simulate(spec: &RunSpec, monitor: &dyn Monitor) -> Result<Recording, JobError> {
    spec.validate()?;
    if spec.system.dimension() != 3 {
        return Err(too_many_states(spec, "three states are looked at here"));
    }
    let recording = three_states(spec, &mut Aside::default(), monitor)?;
    if recording.stop == StopReason::Observer {
        return Err(full(recording.t));
    }
    Ok(recording)
}

/// Says of a state whether a run that has come there may end.
pub type Until<'a> = &'a dyn Fn(&[f64]) -> bool;

/// Computes the section of a smoothed or hysteretic run of a system with three states, and ends it
/// at the first step's end of which `until` holds: the recording then stops with
/// [`StopReason::Observer`], and is otherwise that of [`simulate`].
///
/// # Errors
///
/// As [`simulate`].
pub fn simulate_until(
    spec: &RunSpec,
    until: Until<'_>,
    monitor: &dyn Monitor,
) -> Result<Recording, JobError> {
    spec.validate()?;
    if spec.system.dimension() != 3 {
        return Err(too_many_states(spec, "three states are looked at here"));
    }
    let recording =
        three_states(spec, &mut Aside { until: Some(until), ..Aside::default() }, monitor)?;
    if recording.stop == StopReason::Observer && recording.data.len() >= MOST_POINTS {
        return Err(full(recording.t));
    }
    Ok(recording)
}

/// Computes a run of a system with up to four states.
///
/// # Errors
///
/// If the spec is wrong, or the orbit cannot be followed.
pub fn answer(spec: &RunSpec, monitor: &dyn Monitor) -> Result<Answer, JobError> {
    spec.validate()?;
    let answer = match spec.system.dimension() {
        1 => record::<1, 2>(spec, &mut Aside::default(), monitor)?.to_answer(spec),
        2 => record::<2, 3>(spec, &mut Aside::default(), monitor)?.to_answer(spec),
        3 => three_states(spec, &mut Aside::default(), monitor)?.to_answer(spec),
        4 => record::<4, 5>(spec, &mut Aside::default(), monitor)?.to_answer(spec),
        _ => return Err(too_many_states(spec, UP_TO_FOUR)),
    };
    if answer.stop == Stop::Found { Err(full(answer.fact("t")?)) } else { Ok(answer) }
}

const UP_TO_FOUR: &str = "such runs have up to four states; those of more are runs of general \
    systems (`translation::model_with`; --system FILE on the command line)";

/// The end of a streamed run.
#[derive(Clone, Debug, PartialEq)]
pub struct Streamed {
    /// Final time.
    pub t: f64,
    /// Rows passed on.
    pub rows: u64,
    /// Work done.
    pub statistics: Statistics,
    /// Why it ended; [`Stop::Found`] if `rows` asked to stop.
    pub stop: Stop,
}

/// Computes a run and passes its first table to `rows` in parts, in order and without gaps:
/// together they are the table of [`answer`]. Memory does not grow with the length of the run.
/// `rows` returns whether to continue.
///
/// # Errors
///
/// If the spec is wrong or a funnel (whose members are computed one after the other), or the orbit
/// cannot be followed.
pub fn stream(
    spec: &RunSpec,
    rows: &mut dyn FnMut(&Table) -> bool,
    monitor: &dyn Monitor,
) -> Result<Streamed, JobError> {
    spec.validate()?;
    if let SwitchSpec::Filippov { funnel: Some(_), .. } = spec.switch {
        return Err(JobError::Other("a funnel is not given away in parts".into()));
    }
    match spec.system.dimension() {
        1 => streamed(spec, rows, monitor, |aside| record::<1, 2>(spec, aside, monitor)),
        2 => streamed(spec, rows, monitor, |aside| record::<2, 3>(spec, aside, monitor)),
        3 => streamed(spec, rows, monitor, |aside| three_states(spec, aside, monitor)),
        4 => streamed(spec, rows, monitor, |aside| record::<4, 5>(spec, aside, monitor)),
        _ => Err(too_many_states(spec, UP_TO_FOUR)),
    }
}

/// Receives parts of a recording; says whether more is wanted.
type Sink<'a, const D: usize> = &'a mut dyn FnMut(Data<D>) -> bool;

/// Receivers of a growing recording.
struct Aside<'a, const D: usize> {
    /// Takes parts of it away; without one everything is kept.
    sink: Option<Sink<'a, D>>,
    /// Ends a smoothed or hysteretic run.
    until: Option<Until<'a>>,
}

impl<const D: usize> Aside<'_, D> {
    /// The most samples of one step that are kept at a time.
    fn most(&self) -> usize {
        if self.sink.is_some() { PART } else { MOST_POINTS }
    }
}

impl<const D: usize> Default for Aside<'_, D> {
    fn default() -> Self {
        Self { sink: None, until: None }
    }
}

fn streamed<const D: usize>(
    spec: &RunSpec,
    rows: &mut dyn FnMut(&Table) -> bool,
    monitor: &dyn Monitor,
    run: impl FnOnce(&mut Aside<'_, D>) -> Result<Recording<D>, JobError>,
) -> Result<Streamed, JobError> {
    let (mut first_piece, mut count, stopped) = (0, 0, Cell::new(None));
    let mut give = |data: Data<D>| {
        let more = Recording::part(spec, &data, first_piece).is_none_or(|table| {
            count += table.len() as u64;
            // One step may hold very many samples, so the monitor is asked between them.
            let t = table.numbers("t").last().copied();
            stopped.set(t.filter(|t| monitor.reached(*t).is_break()));
            rows(&table) && stopped.get().is_none()
        });
        if let Data::Motion(motion) = &data {
            // The last piece goes on.
            first_piece += motion.pieces.len().saturating_sub(1);
        }
        more
    };
    let end = run(&mut Aside { sink: Some(&mut give), ..Aside::default() })?;
    let within = stopped.get();
    let wanted = give(end.data) || stopped.get().is_some();
    match within {
        Some(t) => {
            Ok(Streamed { t, rows: count, statistics: end.statistics, stop: Stop::Interrupted })
        }
        None => {
            let stop = if wanted { end.stop.into() } else { Stop::Found };
            Ok(Streamed { t: end.t, rows: count, statistics: end.statistics, stop })
        }
    }
}

/// Points that are kept before they are given away.
const PART: usize = 8192;

/// A recorder whose points are given away.
struct Draining<'a, 'b, R, const D: usize> {
    recorder: R,
    aside: &'a mut Aside<'b, D>,
    /// Extents of the first points, once there are enough of them, of a recorder that measures
    /// distances by them.
    extents: Option<Extents>,
}

/// Something that records and can forget.
trait Recorder<const D: usize> {
    fn kept(&self) -> usize;
    fn take(&mut self) -> Data<D>;
    /// The small states among the points that are kept, where that matters.
    fn extents(&self) -> Extents {
        Extents::default()
    }
    /// Whether a step up to time `t` is to be given to it again: it was full before the step's end.
    fn is_behind(&self, _t: f64) -> bool {
        false
    }
}

macro_rules! recorder {
    (
        $type:ident, $data:ident, $kept:expr
        $(, $more:ident($($argument:ident: f64)?) -> $found:ty)?
    ) => {
        impl<const D: usize> Recorder<D> for $type<D> {
            fn kept(&self) -> usize {
                let kept: fn(&Self) -> usize = $kept;
                kept(self)
            }
            fn take(&mut self) -> Data<D> {
                Data::$data($type::take(self))
            }
            $(fn $more(&self, $($argument: f64)?) -> $found {
                $type::$more(self, $($argument)?)
            })?
        }
    };
}
recorder!(PathRecorder, Path, PathRecorder::len, extents() -> Extents);
recorder!(TimesRecorder, Path, TimesRecorder::len, is_behind(t: f64) -> bool);
recorder!(SectionRecorder, Section, |recorder| recorder.crossings().len());
recorder!(MotionRecorder, Motion, MotionRecorder::kept, extents() -> Extents);
recorder!(TimedMotion, Motion, TimedMotion::kept, is_behind(t: f64) -> bool);

/// A run whose path is recorded; again, finer, if a state turns out to be small among the first
/// points, which are given away only then.
fn path<'b, R: Recorder<D>, T, E, const D: usize>(
    aside: &mut Aside<'b, D>,
    recorder: impl Fn(Extents) -> R,
    run: &mut dyn FnMut(&mut Draining<'_, 'b, R, D>) -> Result<T, E>,
    stop: impl Fn(&T) -> StopReason,
) -> Result<(T, R), E> {
    let mut extents = None;
    loop {
        let again = extents.is_some();
        let recorder = recorder(extents.clone().unwrap_or_default());
        let mut draining = Draining { recorder, aside: &mut *aside, extents };
        let end = run(&mut draining);
        let interrupted = end.as_ref().is_ok_and(|end| stop(end) == StopReason::Cancelled);
        let found = draining.extents.take().unwrap_or_else(|| draining.recorder.extents());
        if again || interrupted || !found.has_small() {
            return Ok((draining.kept_if_failed(end)?, draining.recorder));
        }
        extents = Some(found);
    }
}

impl<'b, R: Recorder<D>, const D: usize> Draining<'_, 'b, R, D> {
    fn new<'a>(recorder: R, aside: &'a mut Aside<'b, D>) -> Draining<'a, 'b, R, D> {
        Draining { recorder, aside, extents: Some(Extents::default()) }
    }

    /// Gives away what was recorded before a failure: it is right up to there.
    fn kept_if_failed<T, E>(&mut self, end: Result<T, E>) -> Result<T, E> {
        if end.is_err()
            && let Some(sink) = self.aside.sink.as_mut()
        {
            sink(self.recorder.take());
        }
        end
    }

    /// Gives points away if there are enough of them. Who keeps everything has no limit below that
    /// of memory.
    fn drained(&mut self, flow: Flow) -> Flow {
        if self.extents.is_none() && self.recorder.kept() >= PART {
            let extents = self.extents.insert(self.recorder.extents());
            if extents.has_small() {
                return Flow::Stop;
            }
        }
        if let Some(sink) = self.aside.sink.as_mut()
            && self.recorder.kept() >= PART
        {
            return if sink(self.recorder.take()) { Flow::Continue } else { Flow::Stop };
        }
        flow
    }
}

impl<R: Recorder<D> + Observer<N>, const D: usize, const N: usize> Observer<N>
    for Draining<'_, '_, R, D>
{
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        let mut flow = self.recorder.step(step);
        flow = self.drained(flow);
        while flow == Flow::Continue && self.recorder.is_behind(step.t1) {
            flow = self.recorder.step(step);
            flow = self.drained(flow);
        }
        match self.aside.until {
            Some(until) if until(&step.x1.as_slice()[..D.min(N)]) => Flow::Stop,
            _ => flow,
        }
    }
    fn kick(&mut self, t: f64, before: &SVector<f64, N>, after: &SVector<f64, N>) {
        self.recorder.kick(t, before, after);
    }
}

impl<R: Recorder<D> + FilippovObserver<D>, const D: usize> FilippovObserver<D>
    for Draining<'_, '_, R, D>
{
    fn step(&mut self, mode: Mode, step: &Step<'_, D>) -> Flow {
        let mut flow = self.recorder.step(mode, step);
        flow = self.drained(flow);
        while flow == Flow::Continue && self.recorder.is_behind(step.t1) {
            flow = self.recorder.step(mode, step);
            flow = self.drained(flow);
        }
        flow
    }
    fn event(&mut self, event: &ModeEvent<D>) -> Flow {
        self.recorder.event(event)
    }
}

/// The only observers here are recorders, which stop a run when they are full.
fn full(t: f64) -> JobError {
    JobError::TooManyPoints { t, limit: MOST_POINTS }
}

/// The error for a number of states that is not compiled.
fn too_many_states(spec: &RunSpec, rule: &'static str) -> JobError {
    SpecError { field: "system", value: format!("one of {} states", spec.system.dimension()), rule }
        .into()
}

/// Three states: by the paper's own equations where they are the system's, which give the same bits
/// sooner.
fn three_states(
    spec: &RunSpec,
    aside: &mut Aside<'_, 3>,
    monitor: &dyn Monitor,
) -> Result<Recording, JobError> {
    let x0 = start::<3>(spec);
    match spec.switch {
        SwitchSpec::Smoothed { eps, transition } => {
            observe(spec, &*instances::smoothed(&spec.system, transition, eps)?, x0, aside, monitor)
        }
        SwitchSpec::Hysteretic { eps, eps_prime, relaxation, phi0 } => {
            let field = instances::hysteretic(&spec.system, eps, eps_prime, relaxation)?;
            observe(spec, &*field, Vector4::new(x0[0], x0[1], x0[2], phi0), aside, monitor)
        }
        SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. } => {
            late(spec, &*switched::late(&spec.system)?, x0, aside, monitor)
        }
        SwitchSpec::Filippov { exit, funnel } if spec.system.faces().is_none() => discontinuous(
            spec,
            &*switched::sliding(&spec.system)?,
            x0,
            exit,
            funnel,
            aside,
            monitor,
        ),
        SwitchSpec::Filippov { .. } => record::<3, 4>(spec, aside, monitor),
    }
}

/// `D` states, by the recorded equations; `M` is `D + 1`.
fn record<const D: usize, const M: usize>(
    spec: &RunSpec,
    aside: &mut Aside<'_, D>,
    monitor: &dyn Monitor,
) -> Result<Recording<D>, JobError>
where
    BoundField<D>: Orbits<D>,
    BoundField<M>: Orbits<M>,
    Bound<D>: Motions<D> + Late<D>,
    Faces<Bound<D>>: TwoSurfaces<D>,
{
    let x0 = start::<D>(spec);
    match spec.switch {
        SwitchSpec::Smoothed { eps, transition } => {
            let field = Field::smoothed(&spec.system, transition, eps).bind::<D>()?;
            observe::<_, D, D>(spec, &field, x0, aside, monitor)
        }
        SwitchSpec::Hysteretic { eps, eps_prime, relaxation, phi0 } => {
            let field = Field::hysteretic(&spec.system, eps, eps_prime, relaxation).bind::<M>()?;
            let x0 = SVector::<f64, M>::from_fn(|i, _| if i < D { x0[i] } else { phi0 });
            observe::<_, D, M>(spec, &field, x0, aside, monitor)
        }
        SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. } => {
            late(spec, &spec.system.bind::<D>()?, x0, aside, monitor)
        }
        SwitchSpec::Filippov { exit, funnel } => match spec.system.faces() {
            None => {
                discontinuous(spec, &spec.system.bind::<D>()?, x0, exit, funnel, aside, monitor)
            }
            Some([[a, b], [c, d]]) => {
                let faces = [[a.bind()?, b.bind()?], [c.bind()?, d.bind()?]];
                watched(spec, aside, &mut |settings, observer| {
                    faces.motion_on(x0, spec.t_end, settings, exit, observer, monitor)
                })
            }
        },
    }
}

fn start<const D: usize>(spec: &RunSpec) -> SVector<f64, D> {
    SVector::from_fn(|i, _| spec.start.get(i).copied().unwrap_or(f64::NAN))
}

/// The discontinuous system, event by event.
fn discontinuous<P: Motions<D> + ?Sized, const D: usize>(
    spec: &RunSpec,
    system: &P,
    x0: SVector<f64, D>,
    exit: ExitRule,
    funnel: Option<FunnelSpec>,
    aside: &mut Aside<'_, D>,
    monitor: &dyn Monitor,
) -> Result<Recording<D>, JobError> {
    match funnel {
        Some(funnel) => futures(spec, system, x0, &settings(spec), &funnel),
        None => watched(spec, aside, &mut |settings, observer| {
            system.motion(x0, spec.t_end, settings, exit, observer, monitor)
        }),
    }
}

/// Options of a Filippov run.
fn settings(spec: &RunSpec) -> filippov::FilippovOptions {
    filippov::FilippovOptions {
        tolerance: spec.method.tolerance,
        max_step: spec.method.step_cap.for_segment(spec.t_end),
        max_steps: spec.method.max_steps,
        ..filippov::FilippovOptions::default()
    }
}

/// A Filippov run, given what looks on.
type FilippovRun<'a, const D: usize> = dyn FnMut(
        &filippov::FilippovOptions,
        &mut dyn FilippovObserver<D>,
    ) -> Result<FilippovSummary<D>, filippov::FilippovError>
    + 'a;

/// A Filippov run, and what is to be recorded of it.
fn watched<const D: usize>(
    spec: &RunSpec,
    aside: &mut Aside<'_, D>,
    run: &mut FilippovRun<'_, D>,
) -> Result<Recording<D>, JobError> {
    let settings = settings(spec);
    let mut run =
        |observer: &mut dyn FilippovObserver<D>| run(&settings, observer)?.within_budget();
    let recording = |data, summary: FilippovSummary<D>| Recording {
        data,
        t: summary.t,
        x: summary.x.into(),
        most_steps_in_segment: summary.statistics.steps,
        statistics: summary.statistics,
        stop: summary.stop,
    };
    match spec.observe {
        Observation::Path { chord } => {
            let recorder = |extents| MotionRecorder::new(chord).over(extents);
            let (end, recorder) = path(aside, recorder, &mut |d| run(d), |end| end.stop)?;
            Ok(recording(Data::Motion(recorder.into_motion()), end))
        }
        Observation::Times { every } => {
            let recorder = TimedMotion::new(&start(spec), every).at_most(aside.most());
            let mut draining = Draining::new(recorder, aside);
            let end = run(&mut draining);
            let end = draining.kept_if_failed(end)?;
            Ok(recording(Data::Motion(draining.recorder.into_motion()), end))
        }
        Observation::Section { coordinate, value } => {
            let mut draining = Draining::new(SectionRecorder::new(coordinate, value), aside);
            let end = run(&mut AllModes(&mut draining));
            let end = draining.kept_if_failed(end)?;
            Ok(recording(Data::Section(draining.recorder.into_crossings()), end))
        }
    }
}

/// The funnel: the approach to the set-valued point, and its futures.
fn futures<P: Motions<D> + ?Sized, const D: usize>(
    spec: &RunSpec,
    system: &P,
    x0: SVector<f64, D>,
    settings: &filippov::FilippovOptions,
    funnel: &FunnelSpec,
) -> Result<Recording<D>, JobError> {
    let grid = FunnelGrid {
        shortest: funnel.shortest,
        longest: funnel.longest,
        times: funnel.times,
        horizon: funnel.horizon,
        until_two_fold: funnel.until_two_fold,
        per_step: POINTS_PER_STEP,
    };
    let found = system.funnel(x0, spec.t_end, settings, &grid)?;
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
    let samples = |points: Vec<(f64, SVector<f64, D>)>| {
        points.into_iter().map(|(t, x)| Sample { t, x: x.into() }).collect()
    };
    let pieces = trajectory.pieces.into_iter().map(|p| (p.mode, samples(p.points))).collect();
    Motion { pieces, events: trajectory.events }
}

/// A run whose switch depends on the past.
fn late<P: Late<D> + ?Sized, const D: usize>(
    spec: &RunSpec,
    system: &P,
    x0: SVector<f64, D>,
    aside: &mut Aside<'_, D>,
    monitor: &dyn Monitor,
) -> Result<Recording<D>, JobError> {
    let Some(switch) = spec.switch.late() else {
        return Err(JobError::Other("this switch has no past".into()));
    };
    observed(spec, x0, aside, &mut |observer| {
        let end = system.late_orbit(&spec.system, switch, x0, &how(spec, D), observer, monitor);
        let end = end.map_err(|error| match error {
            DelayError::NoHistory { .. } => {
                let (value, rule) = (format!("{}, and {error}", History::Flow.name()), NO_HISTORY);
                JobError::from(SpecError { field: "history", value, rule })
            }
            _ => JobError::Other(error.to_string()),
        });
        Ok(end??.within_budget()?)
    })
}

const NO_HISTORY: &str = "take the constant history, or another start";

fn observe<F: Orbits<N> + ?Sized, const D: usize, const N: usize>(
    spec: &RunSpec,
    field: &F,
    x0: SVector<f64, N>,
    aside: &mut Aside<'_, D>,
    monitor: &dyn Monitor,
) -> Result<Recording<D>, JobError> {
    observed(spec, x0, aside, &mut |observer| {
        Ok(field.orbit(x0, &how(spec, D), observer, monitor)?.within_budget()?)
    })
}

/// A run, given what looks on.
type AnyRun<'a, const N: usize> =
    dyn FnMut(&mut dyn Observer<N>) -> Result<Summary<N>, JobError> + 'a;

/// A run, and what is to be recorded of it.
fn observed<const D: usize, const N: usize>(
    spec: &RunSpec,
    x0: SVector<f64, N>,
    aside: &mut Aside<'_, D>,
    run: &mut AnyRun<'_, N>,
) -> Result<Recording<D>, JobError> {
    let (summary, data) = match spec.observe {
        Observation::Path { chord } => {
            let recorder = |extents| PathRecorder::<D>::new(&x0, chord).over(extents);
            let (end, recorder) = path(aside, recorder, &mut |d| run(d), |end| end.stop)?;
            (end, Data::Path(recorder.into_samples()))
        }
        Observation::Times { every } => {
            let recorder = TimesRecorder::<D>::new(&x0, every).at_most(aside.most());
            let mut draining = Draining::new(recorder, aside);
            let end = run(&mut draining);
            (draining.kept_if_failed(end)?, Data::Path(draining.recorder.into_samples()))
        }
        Observation::Section { coordinate, value } => {
            let mut draining = Draining::new(SectionRecorder::<D>::new(coordinate, value), aside);
            let end = run(&mut draining);
            (draining.kept_if_failed(end)?, Data::Section(draining.recorder.into_crossings()))
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

/// Method and options of the run; `states` of the equation's components are the system's.
fn how(spec: &RunSpec, states: usize) -> How {
    let MethodSpec { name, tolerance, step_cap, max_steps, precision, order } = spec.method;
    let options = DriveOptions {
        t_end: spec.t_end,
        schedule: spec.schedule,
        step_cap,
        max_steps,
        kicked_states: states,
    };
    How { method: name, tolerance, precision, order, options }
}

#[cfg(test)]
mod tests;
