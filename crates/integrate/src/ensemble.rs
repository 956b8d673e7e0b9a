//! Many independent runs at once, of one equation or of equations that differ in numbers alone
//! ([`ParameterBatch`](twofold_system::ParameterBatch)), side by side in the lanes of vector
//! registers, by Dormand-Prince 5(4).
//!
//! Each lane has its own time, step size, schedule and end, accepts and rejects steps by itself,
//! and receives the next run when its own has ended. A run's result does not depend on its
//! neighbours, on the number of lanes, or on the machine: it is bit for bit that of
//! [`drive`](super::drive) with [`Guarded`](super::Guarded) [`Dopri5`], because every operation is
//! the same, in the same order (tests/it/ensemble.rs).
//!
//! The instruction set is chosen when the program runs ([`InstructionSet`]). It decides how many
//! lanes an instruction takes and nothing else: no operation is fused, none reordered.

// Loops by number over registers and components: iterators and closures may stay calls, compiled
// for the wrong instruction set.
#![allow(clippy::needless_range_loop)]

use nalgebra::SVector;
use pulp::bytemuck::{cast_slice, cast_slice_mut};
use pulp::{Scalar, Simd, WithSimd};
use serde::{Deserialize, Serialize};

use super::dopri5::{Dense, Dopri5, control, tableau::*};
use super::driver::{DriveOptions, Monitor, Observer, Summary};
use super::guard::{Gates, SMALL_BEND, Stage, Stages};
use super::schedule::{Kicker, Segment};
use super::step::{Failure, Flow, Statistics, Step, Stepper, StopReason, Tolerance};
use twofold_num::elementary::kernels::{rough_exp2, rough_log2};
use twofold_num::elementary::sqrt;
use twofold_num::{Aligned, Arithmetic, Mask, Registers};
use twofold_system::{BatchedField, VectorField};

/// One run of an ensemble: its start and its options.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnsembleRun<const N: usize> {
    /// The state at time 0.
    pub start: SVector<f64, N>,
    /// End time, schedule and bounds on steps.
    pub options: DriveOptions,
}

/// The end of one run.
#[derive(Clone, Debug, PartialEq)]
pub struct End<O, const N: usize> {
    /// The summary, as [`drive`](super::drive) returns it.
    pub summary: Result<Summary<N>, Failure>,
    /// The run's observer, after the run.
    pub observer: O,
}

/// The plane x\[coordinate\] = value.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SectionPlane {
    /// Index of the component of the state.
    pub coordinate: usize,
    /// Its value there.
    pub value: f64,
}

/// Tolerances of the local error, shared by all runs or one for each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerances<'a> {
    /// The same in all.
    All(Tolerance),
    /// One for each run, in their order.
    Each(&'a [Tolerance]),
}

impl Tolerances<'_> {
    fn of(&self, run: usize) -> Tolerance {
        match self {
            Self::All(tolerance) => *tolerance,
            Self::Each(tolerances) => tolerances[run],
        }
    }
}

/// Options of an ensemble besides the equations and the runs' own options.
#[derive(Clone, Copy)]
pub struct Common<'a, const N: usize> {
    /// Tolerances of the local error.
    pub tolerances: Tolerances<'a>,
    /// The plane that observers monitor; without one they receive kicks only.
    pub plane: Option<SectionPlane>,
    /// A corner for each run, which ends as if its observer had stopped it
    /// ([`StopReason::Observer`]) at the first step's end where each component of the state is
    /// above the corner's.
    pub corners: Option<&'a [SVector<f64, N>]>,
    /// A vector that each run carries along, as part of its state.
    pub carried: Option<Carried<'a>>,
    /// Asked at intervals whether to go on; if not, unfinished runs are abandoned.
    pub monitor: &'a dyn Monitor,
}

/// A tangent vector that each run carries: the components of the state from `first` on. When its
/// length leaves `range` it is renormalised to 1 (Benettin, Galgani, Giorgilli & Strelcyn 1980),
/// the method restarts, and observers are told.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Carried<'a> {
    /// Index of its first component.
    pub first: usize,
    /// The least and the greatest length that a step may leave it with.
    pub range: [f64; 2],
    /// When methods start anew, in place of the schedules' restarts and kicks: increasing times,
    /// the last of them the end.
    pub stops: &'a [f64],
}

impl Carried<'_> {
    /// Its length in the state `x`.
    pub fn length<const N: usize>(&self, x: &SVector<f64, N>) -> f64 {
        sqrt(x.iter().skip(self.first).map(|v| v * v).sum())
    }
}

/// The instruction set in which lanes are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum InstructionSet {
    /// The instructions that the program was compiled for, one lane.
    Portable,
    /// AVX2, four lanes an instruction.
    Avx2,
    /// AVX-512, eight lanes an instruction.
    Avx512,
}

impl InstructionSet {
    /// All instruction sets, including those of other machines.
    pub const ALL: [Self; 3] = [Self::Portable, Self::Avx2, Self::Avx512];

    /// Whether this machine supports it.
    pub fn is_here(self) -> bool {
        match self {
            Self::Portable => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::try_new().is_some(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => pulp::x86::V4::try_new().is_some(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The fastest instruction set of this machine.
    pub fn best() -> Self {
        let widest = [Self::Avx512, Self::Avx2];
        widest.into_iter().find(|set| set.is_here()).unwrap_or(Self::Portable)
    }
}

/// The ends of `runs`, in their order, computed with the fastest instructions of this machine.
///
/// Each run has its own observer, made by `observer` from the run's number. It receives every kick,
/// and only those steps that may meet `plane`; without a plane it receives no steps. (Most steps
/// certainly do not meet the plane, and are of no use to a section.)
///
/// # Panics
/// If `equations` are those of fewer runs than `runs`.
pub fn ensemble<E, O, const N: usize>(
    equations: &E,
    runs: &[EnsembleRun<N>],
    tolerance: Tolerance,
    plane: Option<SectionPlane>,
    observer: impl Fn(usize) -> O,
) -> Vec<End<O, N>>
where
    E: BatchedField<N>,
    O: Observer<N>,
{
    ensemble_with(InstructionSet::best(), equations, runs, tolerance, plane, observer)
}

/// [`ensemble()`] with the instructions `set`; with [`InstructionSet::best`] if this machine has
/// not got it.
pub fn ensemble_with<E, O, const N: usize>(
    set: InstructionSet,
    equations: &E,
    runs: &[EnsembleRun<N>],
    tolerance: Tolerance,
    plane: Option<SectionPlane>,
    observer: impl Fn(usize) -> O,
) -> Vec<End<O, N>>
where
    E: BatchedField<N>,
    O: Observer<N>,
{
    let mut ends: Vec<Option<End<O, N>>> = runs.iter().map(|_| None).collect();
    let common = Common {
        tolerances: Tolerances::All(tolerance),
        plane,
        corners: None,
        carried: None,
        monitor: &(),
    };
    ensemble_watched(set, equations, runs, common, observer, &mut |run, end| ends[run] = Some(end));
    ends.into_iter().flatten().collect()
}

/// [`ensemble_with`] that passes each run's number and end to `finished` when the run ends: in an
/// order that depends on the number of lanes.
///
/// # Panics
/// If `equations`, tolerances or corners are those of fewer runs than `runs`.
pub fn ensemble_watched<E, O, const N: usize>(
    set: InstructionSet,
    equations: &E,
    runs: &[EnsembleRun<N>],
    common: Common<'_, N>,
    observer: impl Fn(usize) -> O,
    finished: &mut dyn FnMut(usize, End<O, N>),
) where
    E: BatchedField<N>,
    O: Observer<N>,
{
    let all = All::<_, _, _, N, 1> { equations, runs, common, observer, finished };
    if let Some(all) = all.in_vectors(set) {
        all.with_simd(Scalar);
    }
}

/// [`ensemble_watched`] by vector instructions only: returns `false` and computes nothing on a
/// machine without them.
///
/// # Panics
/// As there.
pub fn ensemble_in_vectors<E, O, const N: usize>(
    set: InstructionSet,
    equations: &E,
    runs: &[EnsembleRun<N>],
    common: Common<'_, N>,
    observer: impl Fn(usize) -> O,
    finished: &mut dyn FnMut(usize, End<O, N>),
) -> bool
where
    E: BatchedField<N>,
    O: Observer<N>,
{
    All::<_, _, _, N, 1> { equations, runs, common, observer, finished }.in_vectors(set).is_none()
}

/// The whole task, for `K` registers.
struct All<'a, E, O, M: Fn(usize) -> O, const N: usize, const K: usize> {
    equations: &'a E,
    runs: &'a [EnsembleRun<N>],
    common: Common<'a, N>,
    observer: M,
    finished: &'a mut dyn FnMut(usize, End<O, N>),
}

impl<'a, E: BatchedField<N>, O: Observer<N>, M: Fn(usize) -> O, const N: usize>
    All<'a, E, O, M, N, 1>
{
    /// Computes all by these vector instructions, or by this machine's best; gives itself back if
    /// there are none.
    fn in_vectors(self, set: InstructionSet) -> Option<Self> {
        match if set.is_here() { set } else { InstructionSet::best() } {
            // No other processor has wider registers here.
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx2 if let Some(set) = pulp::x86::V3::try_new() => {
                self.side_by_side(set);
                None
            }
            #[cfg(target_arch = "x86_64")]
            InstructionSet::Avx512 if let Some(set) = pulp::x86::V4::try_new() => {
                self.side_by_side(set);
                None
            }
            _ => Some(self),
        }
    }
}

#[cfg(target_arch = "x86_64")]
impl<'a, E: BatchedField<N>, O: Observer<N>, M: Fn(usize) -> O, const N: usize>
    All<'a, E, O, M, N, 1>
{
    /// By as many registers at a time as suit the number of runs: while one waits for a quotient
    /// the others go on, and of four none waits long, but they take 1.6 times as long as two for a
    /// step. That pays where runs fill their lanes at least twice, and states are few: six are no
    /// faster with four.
    fn side_by_side<S: Simd>(self, set: S) {
        if const { N <= 4 } && self.runs.len() >= 2 * 4 * S::F64_LANES {
            set.vectorize(self.in_registers::<4>());
        } else {
            set.vectorize(self.in_registers::<2>());
        }
    }

    fn in_registers<const K: usize>(self) -> All<'a, E, O, M, N, K> {
        let Self { equations, runs, common, observer, finished } = self;
        All { equations, runs, common, observer, finished }
    }
}

/// The monitor is asked after so many steps, as [`drive`](super::drive) asks it.
const STEPS_UNWATCHED: u32 = 4096;

impl<E: BatchedField<N>, O: Observer<N>, M: Fn(usize) -> O, const N: usize, const K: usize> WithSimd
    for All<'_, E, O, M, N, K>
{
    type Output = ();
    #[inline(always)]
    fn with_simd<S: Simd>(self, set: S) -> Self::Output {
        let Self { equations, runs, common, observer, finished } = self;
        let width = Registers::<S, K>::WIDTH;
        let mut waiting = 0..runs.len();
        let numbers = if runs.is_empty() { 0 } else { equations.numbers(0).len() };
        let mut state = State::<S, O, N, K>::idle(set, numbers, equations.scratch_len());
        let mut unwatched = 0;
        loop {
            for l in 0..width {
                while state.lanes[l].is_none() {
                    let Some(run) = waiting.next() else { break };
                    state.give(
                        l,
                        equations.numbers(run),
                        common.corners.map(|corners| &corners[run]),
                    );
                    let tolerance = common.tolerances.of(run);
                    let segments: Box<dyn Iterator<Item = Segment>> = match common.carried {
                        None => Box::new(
                            runs[run].options.schedule.segments(0.0, runs[run].options.t_end),
                        ),
                        Some(Carried { stops, .. }) => {
                            let stops = Vec::from(stops);
                            Box::new(stops.into_iter().map(|end| Segment { end, kick: false }))
                        }
                    };
                    if let Some(end) = state.begin(
                        l,
                        equations,
                        run,
                        &runs[run],
                        segments,
                        tolerance,
                        observer(run),
                    ) {
                        finished(run, end);
                    }
                }
            }
            if state.lanes.iter().all(Option::is_none) {
                break;
            }
            // Until a lane is empty.
            while !state.step(equations, &common, finished) {
                unwatched += 1;
                if unwatched == STEPS_UNWATCHED {
                    unwatched = 0;
                    if common.monitor.reached(get(&state.t, 0)).is_break() {
                        return;
                    }
                }
            }
        }
    }
}

/// Data of a lane's run besides its numbers.
struct Lane<O, const N: usize> {
    run: usize,
    options: DriveOptions,
    segments: Box<dyn Iterator<Item = Segment>>,
    segment: Segment,
    kicker: Option<Kicker>,
    observer: O,
    restarts: u64,
    /// Steps taken before this segment.
    steps_before: f64,
    most_steps_in_segment: f64,
    /// Does the restarts.
    stepper: Dopri5<N>,
    gates: Option<Gates>,
    stages: Stages,
}

impl<O, const N: usize> Lane<O, N> {
    /// Whether the step has missed something: then what comes next goes through that.
    #[inline(never)]
    fn missed(&mut self, step: &Step<'_, N>, tolerance: Tolerance) -> Result<bool, Failure> {
        let Some(gates) = &mut self.gates else { return Ok(false) };
        match gates.missed(step, tolerance)? {
            Some(undone) => self.stages.take_back((step.t0, &step.x0), undone),
            None => Ok(false),
        }
    }
}

/// All lanes: the fields of [`Dopri5`] side by side, as bare registers.
struct State<S: Simd, O, const N: usize, const K: usize> {
    set: S,
    rtol: [S::f64s; K],
    atol: [S::f64s; K],
    t: [S::f64s; K],
    t_end: [S::f64s; K],
    max_step: [S::f64s; K],
    max_steps: [S::f64s; K],
    h: [S::f64s; K],
    last_log: [S::f64s; K],
    /// 1 after a rejected trial of the same step, else 0.
    rejected_before: [S::f64s; K],
    steps: [S::f64s; K],
    rejected: [S::f64s; K],
    x: [[S::f64s; K]; N],
    fsal: [[S::f64s; K]; N],
    corner: [[S::f64s; K]; N],
    /// [`Plain`](super::guard::Plain)'s fields, of the gate that a step may miss; none if `flat` is
    /// -infinity, and always one if it is NaN.
    slopes: [[S::f64s; K]; N],
    offset: [S::f64s; K],
    flat: [S::f64s; K],
    /// Whether a slope is not zero in any lane.
    sloping: [bool; N],
    /// Those in the runs' equations.
    numbers: Vec<Aligned<[S::f64s; K]>>,
    /// For what lies between in an evaluation; what is left there means nothing.
    scratch: Vec<Aligned<[S::f64s; K]>>,
    lanes: Vec<Option<Lane<O, N>>>,
}

#[inline(always)]
fn get<V: pulp::bytemuck::Pod, const K: usize>(parts: &[V; K], lane: usize) -> f64 {
    cast_slice::<V, f64>(parts)[lane]
}

#[inline(always)]
fn put<V: pulp::bytemuck::Pod, const K: usize>(parts: &mut [V; K], lane: usize, value: f64) {
    cast_slice_mut::<V, f64>(parts)[lane] = value;
}

impl<S: Simd, O: Observer<N>, const N: usize, const K: usize> State<S, O, N, K> {
    fn idle(set: S, numbers: usize, scratch: usize) -> Self {
        let (zero, one) = ([set.splat_f64s(0.0); K], [set.splat_f64s(1.0); K]);
        Self {
            set,
            // Of a lane that never has a run: its errors, which are zero, are divided by them.
            rtol: one,
            atol: one,
            t: zero,
            t_end: zero,
            max_step: zero,
            max_steps: zero,
            h: zero,
            last_log: zero,
            rejected_before: zero,
            steps: zero,
            rejected: zero,
            x: [zero; N],
            fsal: [zero; N],
            corner: [zero; N],
            slopes: [zero; N],
            offset: zero,
            flat: zero,
            sloping: [false; N],
            numbers: vec![Aligned(zero); numbers],
            scratch: vec![Aligned(zero); scratch],
            lanes: (0..Registers::<S, K>::WIDTH).map(|_| None).collect(),
        }
    }

    /// Data of a run besides its options, for lane `l`.
    fn give(&mut self, l: usize, numbers: &[f64], corner: Option<&SVector<f64, N>>) {
        for (of_lanes, number) in self.numbers.iter_mut().zip(numbers) {
            put(&mut of_lanes.0, l, *number);
        }
        for i in 0..N {
            put(&mut self.corner[i], l, corner.map_or(f64::INFINITY, |corner| corner[i]));
        }
    }

    /// Puts a run into an empty lane; gives its end if it needs no step.
    #[inline(never)]
    #[allow(clippy::too_many_arguments)]
    fn begin<E: BatchedField<N>>(
        &mut self,
        l: usize,
        equations: &E,
        run: usize,
        EnsembleRun { start, options }: &EnsembleRun<N>,
        mut segments: Box<dyn Iterator<Item = Segment>>,
        tolerance: Tolerance,
        observer: O,
    ) -> Option<End<O, N>> {
        put(&mut self.rtol, l, tolerance.rtol);
        put(&mut self.atol, l, tolerance.atol);
        put(&mut self.steps, l, 0.0);
        put(&mut self.rejected, l, 0.0);
        put(&mut self.t, l, 0.0);
        put(&mut self.max_steps, l, options.max_steps as f64);
        for i in 0..N {
            put(&mut self.x[i], l, start[i]);
        }
        let first = segments.next();
        self.lanes[l] = Some(Lane {
            run,
            options: *options,
            segments,
            segment: first.unwrap_or(Segment { end: 0.0, kick: false }),
            kicker: options.schedule.kick.map(|kick| Kicker::new(kick, options.kicked_states)),
            observer,
            restarts: 0,
            steps_before: 0.0,
            most_steps_in_segment: 0.0,
            stepper: Dopri5::new(tolerance),
            gates: Gates::new(equations.of(run).tape()),
            stages: Stages::new(0.0, f64::INFINITY),
        });
        self.watch_gates(l);
        if first.is_none() {
            return self.finish(l, Ok(StopReason::EndTime));
        }
        let failure = self.restart(l, equations)?.diagnosed(&equations.of(run).tape());
        self.finish(l, Err(failure))
    }

    /// Begins the segment of lane `l`.
    fn restart<E: BatchedField<N>>(&mut self, l: usize, equations: &E) -> Option<Failure> {
        let lane = self.lanes[l].as_mut()?;
        let end = lane.segment.end;
        lane.stages = Stages::new(end, lane.options.step_cap.for_segment(end - get(&self.t, l)));
        self.begin_stage(l, equations)
    }

    /// Begins the stage of lane `l` that is under way.
    fn begin_stage<E: BatchedField<N>>(&mut self, l: usize, equations: &E) -> Option<Failure> {
        let (t, x) = (get(&self.t, l), self.state(l));
        let lane = self.lanes[l].as_mut()?;
        lane.restarts += 1;
        let Stage { end, max_step } = lane.stages.now();
        if let Err(failure) = lane.stepper.restart(equations.of(lane.run), t, x, end, max_step) {
            return Some(failure);
        }
        let Dopri5 { fsal, h, last_log, max_step, .. } = &lane.stepper;
        put(&mut self.t_end, l, end);
        put(&mut self.max_step, l, *max_step);
        put(&mut self.h, l, *h);
        put(&mut self.last_log, l, *last_log);
        put(&mut self.rejected_before, l, 0.0);
        for i in 0..N {
            put(&mut self.fsal[i], l, fsal[i]);
        }
        None
    }

    /// For the lanes to see which steps hide nothing, as far as they can.
    fn watch_gates(&mut self, l: usize) {
        let gates = self.lanes[l].as_ref().and_then(|lane| lane.gates.as_ref());
        let plain = gates.and_then(Gates::plain);
        let flat = match (gates, plain) {
            (None, _) => f64::NEG_INFINITY,
            (Some(_), None) => f64::NAN,
            (Some(_), Some(plain)) => plain.flat,
        };
        put(&mut self.flat, l, flat);
        put(&mut self.offset, l, plain.map_or(0.0, |plain| plain.offset));
        for i in 0..N {
            let slope = plain.map_or(0.0, |plain| plain.slopes[i]);
            put(&mut self.slopes[i], l, slope);
            self.sloping[i] |= slope != 0.0;
        }
    }

    fn state(&self, l: usize) -> SVector<f64, N> {
        SVector::from_fn(|i, _| get(&self.x[i], l))
    }

    /// Empties lane `l`.
    fn finish(&mut self, l: usize, stop: Result<StopReason, Failure>) -> Option<End<O, N>> {
        let lane = self.lanes[l].take()?;
        put(&mut self.h, l, 0.0);
        let (steps, rejected) = (get(&self.steps, l) as u64, get(&self.rejected, l) as u64);
        let statistics = Statistics {
            steps,
            rejected,
            evaluations: 2 * lane.restarts + 6 * (steps + rejected),
            restarts: lane.restarts,
            highest_order: 5,
            ..Statistics::default()
        };
        let (t, x) = (get(&self.t, l), self.state(l));
        let most_steps_in_segment = lane.most_steps_in_segment as u64;
        let summary = stop.map(|stop| Summary { t, x, statistics, most_steps_in_segment, stop });
        Some(End { summary, observer: lane.observer })
    }

    /// One trial step in every lane. Says whether a lane has become empty.
    #[inline(always)]
    fn step<E: BatchedField<N>>(
        &mut self,
        equations: &E,
        common: &Common<'_, N>,
        finished: &mut dyn FnMut(usize, End<O, N>),
    ) -> bool {
        let set = self.set;
        let number = |value: f64| Registers::<S, K>::splat(set, value);
        let of = |parts: [S::f64s; K]| Registers::<S, K>::new(set, parts);
        let (t0, x0, k1) = (of(self.t), vector(set, &self.x), vector(set, &self.fsal));
        let remaining = of(self.t_end) - t0;
        // As step::is_last.
        let reached = t0 + of(self.h);
        let rest = of(self.t_end) - reached;
        let last = remaining
            .at_most(of(self.h) * number(1.000_000_1), set)
            .or(rest.at_most(reached.size() * number(f64::EPSILON), set));
        let h = last.select(remaining, of(self.h));

        let mut f =
            Derivative { set, equations, numbers: &self.numbers, scratch: &mut self.scratch };
        let k2 = f.at(&advanced(&x0, h, [(&k1, A21)]));
        let k3 = f.at(&advanced(&x0, h, [(&k1, A31), (&k2, A32)]));
        let k4 = f.at(&advanced(&x0, h, [(&k1, A41), (&k2, A42), (&k3, A43)]));
        let k5 = f.at(&advanced(&x0, h, [(&k1, A51), (&k2, A52), (&k3, A53), (&k4, A54)]));
        let k6 =
            f.at(&advanced(&x0, h, [(&k1, A61), (&k2, A62), (&k3, A63), (&k4, A64), (&k5, A65)]));
        let mut x1 = combined(h, (&k1, A71), [(&k3, A73), (&k4, A74), (&k5, A75), (&k6, A76)]);
        for i in 0..N {
            x1[i] = x0[i] + x1[i];
        }
        let k7 = f.at(&x1);
        let e = combined(h, (&k1, E1), [(&k3, E3), (&k4, E4), (&k5, E5), (&k6, E6), (&k7, E7)]);

        let (rtol, atol) = (of(self.rtol), of(self.atol));
        let larger = |a: Registers<S, K>, b: Registers<S, K>| a.less(b, set).select(b, a);
        let smaller = |a: Registers<S, K>, b: Registers<S, K>| b.less(a, set).select(b, a);
        let mut square = number(0.0);
        for i in 0..N {
            let q = e[i] / (atol + rtol * larger(x0[i].size(), x1[i].size()));
            square += q * q;
        }
        let square = square / number(N as f64);
        // 0 times a finite number is 0; anything else makes a NaN.
        let mut probe = square * number(0.0);
        for i in 0..N {
            probe += x1[i] * number(0.0) + k7[i] * number(0.0);
        }
        let sound = probe.size().at_most(number(0.0), set);
        let accepted = sound.and(square.at_most(number(1.0), set));

        let log = rough_log2(larger(square, number(control::LEAST_SQUARE)));
        let after_success = number(0.5)
            * (number(control::ALPHA) * log - number(control::BETA) * of(self.last_log));
        let after_failure = number(0.5 * control::ALPHA) * log;
        let factor =
            rough_exp2(accepted.select(after_success, after_failure)) / number(control::SAFETY);
        let factor = smaller(factor, number(1.0 / control::SHRINK));
        let least = accepted.select(number(1.0 / control::GROW), factor);
        let next = h / larger(factor, least);
        let again = number(0.5).less(of(self.rejected_before), set);
        let next = accepted.and(again).select(smaller(next, h), next);
        let next = accepted.select(smaller(next, of(self.max_step)), next);

        // Updates of every step.
        let (one, zero) = (number(1.0), number(0.0));
        let t1 = last.select(of(self.t_end), t0 + h);
        self.h = next.parts();
        self.t = accepted.select(t1, t0).parts();
        self.last_log =
            accepted.select(larger(log, number(control::LEAST_LOG)), of(self.last_log)).parts();
        self.rejected_before = accepted.select(zero, one).parts();
        let steps = of(self.steps) + accepted.select(one, zero);
        self.steps = steps.parts();
        self.rejected = (of(self.rejected) + accepted.select(zero, one)).parts();
        for i in 0..N {
            self.x[i] = accepted.select(x1[i], x0[i]).parts();
            self.fsal[i] = accepted.select(k7[i], k1[i]).parts();
        }

        // Conditions that few steps meet.
        let tiny = h
            .size()
            .at_most(t0.size() * number(f64::EPSILON), set)
            .or(h.less(number(f64::MIN_POSITIVE), set));
        let ended = accepted.and(last.or(of(self.max_steps).at_most(steps, set)));
        let unsound = sound.select(zero, one).size();
        let mut noted = tiny.or(ended).or(number(0.5).less(unsound, set));
        let (mut w0, mut w1, mut bend) = (of(self.offset), of(self.offset), zero);
        for i in 0..N {
            if self.sloping[i] {
                let slope = of(self.slopes[i]);
                w0 += slope * x0[i];
                w1 += slope * x1[i];
                bend += slope.size()
                    * reach(x0[i], x1[i], h, [k1[i], k3[i], k4[i], k5[i], k6[i], k7[i]], set);
            }
        }
        let flat = of(self.flat);
        let far = flat + bend;
        let above = far.at_most(w0, set).and(far.at_most(w1, set));
        let below = far.at_most(zero - w0, set).and(far.at_most(zero - w1, set));
        let known = flat.at_most(flat, set);
        let plain = bend.at_most(number(SMALL_BEND), set).or(above).or(below).and(known);
        // Steps in which the gate may be missed.
        let hiding = number(0.5).less(plain.select(zero, one), set).and(accepted);
        noted = noted.or(hiding);
        let mut met = None;
        if let Some(SectionPlane { coordinate, value }) = common.plane {
            let may = may_meet(
                coordinate,
                number(value),
                h,
                &x0,
                &x1,
                [&k1, &k3, &k4, &k5, &k6, &k7],
                set,
            );
            let may = may.and(accepted);
            met = Some(may.select(one, zero).parts());
            noted = noted.or(may);
        }
        let mut beyond = None;
        if common.corners.is_some() {
            let mut all = accepted;
            for i in 0..N {
                all = all.and(of(self.corner[i]).less(x1[i], set));
            }
            beyond = Some(all.select(one, zero).parts());
            noted = noted.or(all);
        }
        let mut outside = None;
        if let Some(Carried { first, range: [least, most], .. }) = common.carried {
            let mut square = zero;
            for i in 0..N {
                if i >= first {
                    square += x1[i] * x1[i];
                }
            }
            // The code that attends to it decides; the margin is for the root's rounding.
            let long = number(least * least * (1.0 + 1e-9)).at_most(square, set);
            let short = square.at_most(number(most * most * (1.0 - 1e-9)), set);
            let may = number(0.5).less(long.and(short).select(zero, one), set).and(accepted);
            outside = Some(may.select(one, zero).parts());
            noted = noted.or(may);
        }
        if !noted.any() {
            return false;
        }
        let lanes = |mask: Mask<S, K>| mask.select(one, zero).parts();
        let seen = Seen {
            t0: t0.parts(),
            h: h.parts(),
            tiny: lanes(tiny),
            accepted: lanes(accepted),
            sound: lanes(sound),
            last: lanes(last),
            hiding: lanes(hiding),
            met,
            beyond,
            outside,
            x: bare(&x0),
            k: [bare(&k1), bare(&k3), bare(&k4), bare(&k5), bare(&k6), bare(&k7)],
        };
        self.attend(equations, common, &seen, finished)
    }

    /// The scalar part of a step, for the lanes that need one. Says whether a lane has become
    /// empty.
    #[inline(never)]
    fn attend<E: BatchedField<N>>(
        &mut self,
        equations: &E,
        common: &Common<'_, N>,
        seen: &Seen<S, N, K>,
        finished: &mut dyn FnMut(usize, End<O, N>),
    ) -> bool {
        let mut emptied = false;
        for l in 0..Registers::<S, K>::WIDTH {
            let Some(run) = self.lanes[l].as_ref().map(|lane| lane.run) else { continue };
            if let Some(stop) = self.attend_one(l, equations, common, seen) {
                let stop = stop.map_err(|failure| failure.diagnosed(&equations.of(run).tape()));
                if let Some(end) = self.finish(l, stop) {
                    finished(run, end);
                }
                emptied = true;
            }
        }
        emptied
    }

    /// As the loop of [`drive`](super::drive) and [`Dopri5::step`] do it; gives the end of the run.
    fn attend_one<E: BatchedField<N>>(
        &mut self,
        l: usize,
        equations: &E,
        common: &Common<'_, N>,
        seen: &Seen<S, N, K>,
    ) -> Option<Result<StopReason, Failure>> {
        let yes = |parts: &[S::f64s; K]| get(parts, l) > 0.5;
        let (t0, h) = (get(&seen.t0, l), get(&seen.h, l));
        let x0 = SVector::from_fn(|i, _| get(&seen.x[i], l));
        if yes(&seen.tiny) {
            return Some(Err(Failure::StepUnderflow { t: t0, h, state: Failure::state(&x0) }));
        }
        if !yes(&seen.accepted) {
            if !yes(&seen.sound) {
                let shorter = h * 0.1;
                put(&mut self.h, l, shorter);
                if shorter <= t0.abs() * f64::EPSILON || shorter < 1e-300 {
                    return Some(Err(Failure::NotFinite { t: t0, state: Failure::state(&x0) }));
                }
            }
            return None;
        }
        let (t1, mut x1, steps) = (get(&self.t, l), self.state(l), get(&self.steps, l));
        let k = std::array::from_fn(|j| SVector::from_fn(|i, _| get(&seen.k[j][i], l)));
        let dense = Dense { h, x0, x1, k };
        if yes(&seen.hiding) {
            let tolerance = Tolerance { rtol: get(&self.rtol, l), atol: get(&self.atol, l) };
            let lane = self.lanes[l].as_mut()?;
            let step = Step { t0, t1, x0, x1, interpolant: &dense };
            let missed = match lane.missed(&step, tolerance) {
                Ok(missed) => missed,
                Err(failure) => return Some(Err(failure)),
            };
            if missed {
                put(&mut self.t, l, t0);
                for i in 0..N {
                    put(&mut self.x[i], l, x0[i]);
                }
                return self.begin_stage(l, equations).map(Err);
            }
        }
        let staged = yes(&seen.last) && self.lanes[l].as_mut()?.stages.end_at(t1);
        let last = yes(&seen.last) && t1 >= self.lanes[l].as_ref()?.segment.end;
        let mut begun = !staged || last;
        if let (true, Some(carried)) = (seen.outside.as_ref().is_some_and(yes), &common.carried) {
            let (length, [least, most]) = (carried.length(&x1), carried.range);
            if !(least..=most).contains(&length) {
                for i in carried.first..N {
                    x1[i] /= length;
                    put(&mut self.x[i], l, x1[i]);
                }
                self.lanes[l].as_mut()?.observer.rescaled(t1, length);
                if !last {
                    begun = true;
                    if let Some(failure) = self.restart(l, equations) {
                        return Some(Err(failure));
                    }
                }
            }
        }
        let lane = self.lanes[l].as_mut()?;
        let mut flow = Flow::Continue;
        if seen.met.as_ref().is_some_and(yes) {
            flow = lane.observer.step(&Step { t0, t1, x0, x1, interpolant: &dense });
        }
        if seen.beyond.as_ref().is_some_and(yes) {
            flow = Flow::Stop;
        }
        let stop = if flow == Flow::Stop {
            Some(StopReason::Observer)
        } else {
            (steps >= lane.options.max_steps as f64 && t1 < lane.options.t_end)
                .then_some(StopReason::StepBudget)
        };
        if stop.is_some() || last {
            lane.most_steps_in_segment = lane.most_steps_in_segment.max(steps - lane.steps_before);
            lane.steps_before = steps;
        }
        if stop.is_some() {
            return stop.map(Ok);
        }
        if !last {
            return if begun { None } else { self.begin_stage(l, equations).map(Err) };
        }
        if common.carried.is_some() {
            lane.observer.stopped(t1, &x1);
        }
        if let (true, Some(kicker)) = (lane.segment.kick, lane.kicker.as_mut()) {
            let kicked = kicker.apply(x1);
            lane.observer.kick(t1, &x1, &kicked);
            for i in 0..N {
                put(&mut self.x[i], l, kicked[i]);
            }
        }
        match lane.segments.next() {
            None => Some(Ok(StopReason::EndTime)),
            Some(segment) => {
                lane.segment = segment;
                self.restart(l, equations).map(Err)
            }
        }
    }
}

/// A trial step, for whom it concerns.
struct Seen<S: Simd, const N: usize, const K: usize> {
    t0: [S::f64s; K],
    h: [S::f64s; K],
    tiny: [S::f64s; K],
    accepted: [S::f64s; K],
    sound: [S::f64s; K],
    last: [S::f64s; K],
    /// Whether the step may miss a gate, lane by lane.
    hiding: [S::f64s; K],
    met: Option<[S::f64s; K]>,
    beyond: Option<[S::f64s; K]>,
    /// Whether the carried vector may be too short or too long, lane by lane.
    outside: Option<[S::f64s; K]>,
    x: [[S::f64s; K]; N],
    /// Stages 1, 3, 4, 5, 6, 7.
    k: [[[S::f64s; K]; N]; 6],
}

/// The runs' equations with their numbers.
struct Derivative<'a, E, S: Simd, const K: usize> {
    set: S,
    equations: &'a E,
    numbers: &'a [Aligned<[S::f64s; K]>],
    scratch: &'a mut [Aligned<[S::f64s; K]>],
}

impl<E, S: Simd, const K: usize> Derivative<'_, E, S, K> {
    #[inline(always)]
    fn at<const N: usize>(&mut self, x: &SVector<Registers<S, K>, N>) -> SVector<Registers<S, K>, N>
    where
        E: BatchedField<N>,
    {
        let Self { set, equations, numbers, ref mut scratch } = *self;
        vector(
            set,
            &set.vectorize(Field { set, equations, numbers, scratch, x: Aligned(bare(x)) }).0,
        )
    }
}

/// f at the state `x`: a function of its own in the instruction set, so that the equation is
/// compiled once and not for every stage.
struct Field<'a, E, S: Simd, const N: usize, const K: usize> {
    set: S,
    equations: &'a E,
    numbers: &'a [Aligned<[S::f64s; K]>],
    scratch: &'a mut [Aligned<[S::f64s; K]>],
    x: Aligned<[[S::f64s; K]; N]>,
}

impl<E: BatchedField<N>, S: Simd, const N: usize, const K: usize> WithSimd
    for Field<'_, E, S, N, K>
{
    type Output = Aligned<[[S::f64s; K]; N]>;
    #[inline(always)]
    fn with_simd<T: Simd>(self, _: T) -> Self::Output {
        // The instruction set is that of the caller, who has chosen it.
        Aligned(self.equations.eval_in_registers(self.set, self.x.0, self.numbers, self.scratch))
    }
}

/// A vector of the registers.
#[inline(always)]
fn vector<S: Simd, const N: usize, const K: usize>(
    set: S,
    parts: &[[S::f64s; K]; N],
) -> SVector<Registers<S, K>, N> {
    let mut v = SVector::<Registers<S, K>, N>::from_element(Registers::splat(set, 0.0));
    for i in 0..N {
        v[i] = Registers::new(set, parts[i]);
    }
    v
}

/// The registers of a vector.
#[inline(always)]
fn bare<S: Simd, const N: usize, const K: usize>(
    v: &SVector<Registers<S, K>, N>,
) -> [[S::f64s; K]; N] {
    let mut parts = [v[0].parts(); N];
    for i in 0..N {
        parts[i] = v[i].parts();
    }
    parts
}

/// Whether the step may meet the plane, by the rule of
/// [`CrossingFinder::through_plane`](super::roots::CrossingFinder::through_plane).
#[inline(always)]
fn may_meet<S: Simd, const N: usize, const K: usize>(
    coordinate: usize,
    value: Registers<S, K>,
    h: Registers<S, K>,
    x0: &SVector<Registers<S, K>, N>,
    x1: &SVector<Registers<S, K>, N>,
    k: [&SVector<Registers<S, K>, N>; 6],
    set: S,
) -> Mask<S, K> {
    let zero = Registers::splat(set, 0.0);
    // A run-time index would send every vector through memory.
    let component = |v: &SVector<Registers<S, K>, N>| {
        let mut found = zero;
        for i in 0..N {
            if i == coordinate {
                found = v[i];
            }
        }
        found
    };
    let number = |value: f64| Registers::<S, K>::splat(set, value);
    let (a, b) = (component(x0), component(x1));
    let k = [
        component(k[0]),
        component(k[1]),
        component(k[2]),
        component(k[3]),
        component(k[4]),
        component(k[5]),
    ];
    let reach = reach(a, b, h, k, set);
    let (h0, h1) = (a - value, b - value);
    let margin = number(1e-12) * (h0.size() + h1.size() + value.size() + reach);
    let nearer = h0.size().less(h1.size(), set).select(h0.size(), h1.size());
    let clear = (reach + margin).less(nearer, set);
    let same =
        zero.less(h0, set).and(zero.less(h1, set)).or(h0.less(zero, set).and(h1.less(zero, set)));
    let far = clear.and(same).select(number(1.0), zero);
    far.less(number(0.5), set)
}

/// Bound on the distance by which one coordinate leaves the range between its values `a` and `b` at
/// a step's ends, as [`Dense`]'s [`reach`](super::step::Interpolant::reach).
#[inline(always)]
fn reach<S: Simd, const K: usize>(
    a: Registers<S, K>,
    b: Registers<S, K>,
    h: Registers<S, K>,
    [k1, k3, k4, k5, k6, k7]: [Registers<S, K>; 6],
    set: S,
) -> Registers<S, K> {
    let number = |value: f64| Registers::<S, K>::splat(set, value);
    let r2 = b - a;
    let r3 = k1 * h - r2;
    let r3_and_r4 = r2 - k7 * h;
    let r5 = (k1 * number(D1)
        + k3 * number(D3)
        + k4 * number(D4)
        + k5 * number(D5)
        + k6 * number(D6)
        + k7 * number(D7))
        * h;
    let larger = r3.size().less(r3_and_r4.size(), set).select(r3_and_r4.size(), r3.size());
    number(0.25) * (larger + number(0.25) * r5.size())
}

/// x0 + k_1 (h a_1) + k_2 (h a_2) + ..., from the left.
#[inline(always)]
fn advanced<S: Simd, const N: usize, const K: usize, const M: usize>(
    x0: &SVector<Registers<S, K>, N>,
    h: Registers<S, K>,
    terms: [(&SVector<Registers<S, K>, N>, f64); M],
) -> SVector<Registers<S, K>, N> {
    let mut sum = *x0;
    for (k, a) in terms {
        let ha = h * Registers::from_f64(a);
        for i in 0..N {
            sum[i] += k[i] * ha;
        }
    }
    sum
}

/// k_1 (h a_1) + k_2 (h a_2) + ..., from the left.
#[inline(always)]
fn combined<S: Simd, const N: usize, const K: usize, const M: usize>(
    h: Registers<S, K>,
    first: (&SVector<Registers<S, K>, N>, f64),
    terms: [(&SVector<Registers<S, K>, N>, f64); M],
) -> SVector<Registers<S, K>, N> {
    let ha = h * Registers::from_f64(first.1);
    let mut start = *first.0;
    for i in 0..N {
        start[i] = start[i] * ha;
    }
    advanced(&start, h, terms)
}
