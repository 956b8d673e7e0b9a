//! The state machine of Filippov motion: the mode is decided at each event.

use std::sync::Arc;

use nalgebra::SVector;

use super::automatic::Automatic;
use super::exit::{Chooser, ExitPlan};
use super::flow::{
    FreeFlow, InPhysicalTime, Sided, SlidingFlow, Straight, Truncated, desingularised, length,
    lie_derivative, project,
};
use super::two_fold::{AlongCurve, FusedFolds, LARGEST_RADIUS, Linearised, SlidingAtTwoFold};
use super::{
    CHOOSE, Choice, EventKind, ExitRule, FilippovError, FilippovObserver, FilippovOptions,
    FilippovSummary, Mode, ModeEvent, Side,
};
use crate::driver::Monitor;
use crate::guard::Gates;
use crate::roots::{Enclosed, Start, Zero, brent, first_zero, first_zero_after, first_zero_along};
use crate::step::{Failure, Flow, Interpolant, Statistics, Step, StopReason, Tolerance, finite};
use twofold_num::{Arithmetic, Dual, Interval, Tape};
use twofold_system::filippov::{TwoFold, gradient, lie_derivatives, two_fold};
use twofold_system::singular::Ends;
use twofold_system::{PiecewiseSmooth, VectorField, variables};

/// Runs the Filippov motion of `system` from (0, x0) to `t_end`. `M` is `N + 1` and is inferred.
///
/// ```
/// use nalgebra::Vector2;
/// use twofold_integrate::filippov::{ExitRule, FilippovOptions, Mode, Trajectory, run};
/// use twofold_system::System;
/// let block = System::builtin("stick-slip").expect("built in").bind::<2>()?;
/// let mut path = Trajectory::new(4);
/// let options = FilippovOptions::default();
/// let end = run(&block, Vector2::new(0.0, 0.0), 20.0, &options, ExitRule::Undecided, &mut path)?;
/// assert_eq!(end.t, 20.0);
/// assert!(path.pieces.iter().any(|piece| piece.mode == Mode::SlidingAttracting)); // it sticks
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// See [`FilippovError`]; each names the time and the state.
pub fn run<P, const N: usize, const M: usize>(
    system: &P,
    x0: SVector<f64, N>,
    t_end: f64,
    settings: &FilippovOptions,
    rule: ExitRule,
    observer: &mut dyn FilippovObserver<N>,
) -> Result<FilippovSummary<N>, FilippovError>
where
    P: PiecewiseSmooth<N>,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    run_watched(system, x0, t_end, settings, rule, observer, &())
}

/// [`run`], reporting its time to `monitor`; when `monitor` asks to stop, the run ends as
/// [`StopReason::Cancelled`].
///
/// # Errors
/// See [`FilippovError`]; each names the time and the state.
pub fn run_watched<P, const N: usize, const M: usize>(
    system: &P,
    x0: SVector<f64, N>,
    t_end: f64,
    settings: &FilippovOptions,
    rule: ExitRule,
    observer: &mut dyn FilippovObserver<N>,
    monitor: &dyn Monitor,
) -> Result<FilippovSummary<N>, FilippovError>
where
    P: PiecewiseSmooth<N>,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let origin = Origin { t: 0.0, x: x0, departure: Departure::Anywhere };
    run_from(system, origin, t_end, settings, &mut Chooser::new(rule), observer, monitor)
}

/// Start of a run: time, state and departure.
#[derive(Clone, Debug)]
pub(super) struct Origin<const N: usize> {
    pub t: f64,
    pub x: SVector<f64, N>,
    pub departure: Departure<N>,
}

/// Data about a run's start.
#[derive(Clone, Debug)]
pub(super) enum Departure<const N: usize> {
    /// Wherever the state is.
    Anywhere,
    /// On the surface, up to the rounding of what found it.
    OnSurface,
    /// At a two-fold.
    TwoFold(Option<Box<SlidingAtTwoFold<N>>>),
    /// On the surface, in the repelling region.
    Repelling,
    /// On the surface, in a mode that is known.
    Decided(Mode),
}

/// [`run_watched`] from anywhere, with an exit rule that may have been at work before.
pub(super) fn run_from<P, const N: usize, const M: usize>(
    system: &P,
    origin: Origin<N>,
    t_end: f64,
    settings: &FilippovOptions,
    chooser: &mut Chooser,
    observer: &mut dyn FilippovObserver<N>,
    monitor: &dyn Monitor,
) -> Result<FilippovSummary<N>, FilippovError>
where
    P: PiecewiseSmooth<N>,
    for<'a> SlidingFlow<'a, P, N>: VectorField<M>,
{
    let Origin { t: t0, x: x0, departure } = origin;
    const { assert!(M == N + 1, "the sliding flow carries exactly one extra state") };
    chooser.rule.validate().map_err(FilippovError::Invalid)?;
    let tolerances = [settings.tolerance.rtol, settings.tolerance.atol, settings.max_step];
    if !tolerances.iter().all(|v| *v > 0.0) {
        return Err(FilippovError::Invalid("tolerances and the step cap must be above 0".into()));
    }
    if !(t_end > t0 && t_end.is_finite()) {
        return Err(FilippovError::Invalid(format!(
            "the end time must be finite and after the start, not {t_end}"
        )));
    }
    if !finite(&x0) {
        return Err(Failure::NotFinite { t: t0, state: Failure::state(&x0) }.into());
    }
    let mut engine = Engine {
        system,
        settings,
        chooser,
        observer,
        monitor,
        t: t0,
        x: x0,
        t_end,
        events: 0,
        statistics: Statistics { highest_order: 5, ..Statistics::default() },
        accumulation: Accumulation::default(),
        tightened: false,
        size: x0.abs(),
        speed: SVector::zeros(),
        stop: None,
        steps_until_watch: STEPS_BETWEEN_WATCHES,
        depth: None,
        fields: SIDES.map(|side| {
            let flow = FreeFlow { system: Sided { system, depth: None }, side };
            let tape = Arc::new(Tape::clone(&flow.tape()).with_names(system.names()));
            (tape.clone(), Ends::new(tape))
        }),
        gates: Default::default(),
    };
    let mut state = match departure {
        Departure::Anywhere if !near_surface(system, &x0) => {
            let side = if system.switching(&x0) > 0.0 { Side::Plus } else { Side::Minus };
            State::Free { side, start: FlightStart::Away }
        }
        Departure::Anywhere | Departure::OnSurface => engine.start()?,
        Departure::TwoFold(Some(local)) => State::TwoFold(local),
        Departure::TwoFold(None) => {
            return Err(engine.non_transversal("the two-fold is degenerate"));
        }
        Departure::Repelling => engine.enter_repelling(None)?,
        Departure::Decided(mode) => engine.begin(mode),
    };
    loop {
        if let Some(reason) = engine.stop {
            return Ok(engine.summary(state.mode(), reason));
        }
        if engine.t >= engine.t_end {
            return Ok(engine.summary(state.mode(), StopReason::EndTime));
        }
        if engine.events > settings.max_events {
            return Err(FilippovError::TooManyEvents {
                t: engine.t,
                state: Failure::state(&engine.x),
                limit: settings.max_events,
            });
        }
        state = match state {
            State::Free { side, start } => engine.fly(side, start)?,
            State::Sliding(sliding) => engine.slide::<M>(sliding)?,
            State::TwoFold(local) => engine.depart(&local)?,
            State::Fused(folds) => engine.pass(&folds)?,
            State::Rest => engine.rest(),
            State::SetValued(mode) => return Ok(engine.summary(mode, StopReason::SetValued)),
        };
    }
}

/// Whether h is zero at `x` as far as the rounding of `x` and of h's evaluation can tell: by
/// interval arithmetic.
pub(super) fn near_surface<P: PiecewiseSmooth<N>, const N: usize>(
    system: &P,
    x: &SVector<f64, N>,
) -> bool {
    let around = x.map(|v| {
        let (low, high) = if v == 0.0 { (0.0, 0.0) } else { (v.next_down(), v.next_up()) };
        Interval::new(low, high).unwrap_or(Interval::ENTIRE)
    });
    let h = system.switching(&around);
    system.switching(x) == 0.0 || h.is_bounded() && h.contains(0.0)
}

/// `t`, or the end if that is within rounding: no step leads from the one to the other.
pub(super) fn up_to(t_end: f64, t: f64) -> f64 {
    if t_end - t <= LIMITS.end * t_end.abs() { t_end } else { t }
}

/// The beginning of a flight: the known growth of |h|.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum FlightStart {
    /// Off the surface.
    Away,
    /// On it, with this rate of growth of |h|.
    Transversal(f64),
    /// On it at a visible fold, with this second derivative of |h|.
    Tangent(f64),
    /// On it at a tangency of higher order or at a corner, off it after this time.
    Flat(f64),
}

impl FlightStart {
    /// The same over a step of this length, as a function of the fraction of the step.
    pub(super) fn over(self, length: f64) -> Start {
        match self {
            FlightStart::Away | FlightStart::Flat(_) => Start::Away,
            FlightStart::Transversal(rate) => Start::Simple(rate * length),
            FlightStart::Tangent(second) => Start::Double(0.5 * second * length * length),
        }
    }
}

/// A point of the surface to which a field is tangent.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Tangency {
    /// The second derivative of |h| along it.
    Fold(f64),
    /// That is zero, too, or as little as rounding may make it. Whether |h| grows ahead, and after
    /// which time that is seen.
    Flat { grows: bool, after: f64 },
}

impl Tangency {
    /// The start of a motion that leaves with the field, if it does.
    fn left(self) -> Option<FlightStart> {
        match self {
            Self::Fold(second) => (second > 0.0).then_some(FlightStart::Tangent(second)),
            Self::Flat { grows, after } => grows.then_some(FlightStart::Flat(after)),
        }
    }

    /// Whether the field comes to the surface, touches it and goes on towards it.
    fn presses(self) -> bool {
        matches!(self, Self::Flat { grows: false, .. })
    }

    /// Whether nothing says to which side the field leads.
    fn is_unknown(self) -> bool {
        matches!(self, Self::Fold(second) if second == 0.0 || second.is_nan())
    }
}

#[derive(Clone, Copy, Debug)]
struct Sliding {
    repelling: bool,
    /// The exit rule's plan, in repelling sliding.
    plan: Option<ExitPlan>,
    /// Time and arc of this stretch of repelling sliding so far.
    time: f64,
    arc: f64,
}

impl Sliding {
    const ATTRACTING: Self = Self { repelling: false, plan: None, time: 0.0, arc: 0.0 };

    fn mode(&self) -> Mode {
        if self.repelling { Mode::SlidingRepelling } else { Mode::SlidingAttracting }
    }

    /// The sign with which the desingularised flow runs forward in time.
    fn direction(&self) -> f64 {
        if self.repelling { -1.0 } else { 1.0 }
    }

    /// Signed distances of L+h and L-h from zero; both are positive inside the region.
    fn margins<P: PiecewiseSmooth<N>, const N: usize>(
        &self,
        system: &P,
        x: &SVector<f64, N>,
    ) -> [f64; 2] {
        let (p, q) = lie_derivatives(system, x);
        [-self.direction() * p, self.direction() * q]
    }
}

/// A failure of the sliding flow, by the motion's own state and time.
fn in_time<const N: usize>(mut failure: Failure, t_base: f64) -> Failure {
    if let Some((t, state)) = failure.place() {
        *t = t_base + state[N];
        state.truncate(N);
    }
    failure
}

/// A state of the sliding flow without its clock.
fn without_clock<const N: usize, const M: usize>(z: &SVector<f64, M>) -> SVector<f64, N> {
    SVector::from_fn(|i, _| z[i])
}

/// Lengths of the chords of the first part, up to the fraction `theta`, of a step of the sliding
/// flow.
fn chords<const N: usize, const M: usize>(step: &Step<'_, M>, theta: f64) -> [f64; CHORDS] {
    let mut last = without_clock::<N, M>(&step.x0);
    std::array::from_fn(|k| {
        let point = without_clock(&step.at(theta * (k + 1) as f64 / CHORDS as f64));
        let length = (point - last).norm();
        last = point;
        length
    })
}

/// The two-fold that sliding may be running into.
struct TwoFoldAhead<const N: usize> {
    linear: Option<Linearised<N>>,
    /// The same with its curves, once they have been needed.
    whole: Option<SlidingAtTwoFold<N>>,
    /// The margins when it was last looked for.
    tried_at: f64,
}

impl<const N: usize> TwoFoldAhead<N> {
    fn new() -> Self {
        Self { linear: None, whole: None, tried_at: f64::INFINITY }
    }

    /// Looks for it from `x`, each time the Lie derivatives have halved.
    fn look<P: PiecewiseSmooth<N>>(&mut self, system: &P, x: &SVector<f64, N>, margins: [f64; 2]) {
        let size = margins.into_iter().fold(0.0, f64::max);
        if size >= 0.5 * self.tried_at || size.is_nan() {
            return;
        }
        self.tried_at = size;
        // From far away Newton's method may have found another two-fold: trust only the latest
        // answer.
        if let Ok(TwoFold { point, .. }) = two_fold(system, x)
            && self.linear.as_ref().is_none_or(|l| {
                (l.point - point).amax() > LIMITS.same_point * x.amax().max(point.amax())
            })
        {
            (self.linear, self.whole) = (Linearised::at(system, point), None);
        }
    }

    /// The two-fold if the distance to it is at most `leg` radii, or `blur`. Its curves, of which
    /// the radius is known, are expanded only when they may decide that.
    fn within<P: PiecewiseSmooth<N>>(
        &mut self,
        system: &P,
        x: &SVector<f64, N>,
        leg: f64,
        blur: f64,
    ) -> Option<&SlidingAtTwoFold<N>> {
        let linear = self.linear.as_ref()?;
        let distance = (linear.point - x).norm();
        if distance > (leg * LARGEST_RADIUS).max(blur) {
            return None;
        }
        let fold = self.whole.get_or_insert_with(|| linear.with_curves(system));
        (distance <= (leg * fold.radius).max(blur)).then_some(&*fold)
    }
}

enum State<const N: usize> {
    Free {
        side: Side,
        start: FlightStart,
    },
    Sliding(Sliding),
    TwoFold(Box<SlidingAtTwoFold<N>>),
    Fused(Box<FusedFolds<N>>),
    /// At a point of the surface where zero lies between the two fields: the motion stays there.
    Rest,
    SetValued(Option<Mode>),
}

impl<const N: usize> State<N> {
    fn mode(&self) -> Option<Mode> {
        match self {
            State::Free { side, .. } => Some((*side).into()),
            State::Sliding(s) => Some(s.mode()),
            State::TwoFold(_) | State::Fused(_) => None,
            State::Rest => Some(Mode::SlidingAttracting),
            State::SetValued(mode) => *mode,
        }
    }
}

/// The flights since the last that was longer than the one before the last: whether they come
/// together in a point.
///
/// Crossings accumulate at t* if from some flight on the durations fall geometrically, each flight
/// against the last one on its own side (Goebel, Sanfelice & Teel 2012, sec. 2.2; Or & Ames 2011).
/// Flights near a grazing are short, too, but one at a time.
#[derive(Clone, Debug)]
struct Accumulation<const N: usize> {
    in_a_row: u64,
    /// Duration of the first of them.
    first: f64,
    /// Durations of the last flights and the states in which they ended, the latest first.
    last: [(f64, SVector<f64, N>); ZENO_FLIGHTS + 2],
}

impl<const N: usize> Default for Accumulation<N> {
    fn default() -> Self {
        Self { in_a_row: 0, first: 0.0, last: [(0.0, SVector::zeros()); ZENO_FLIGHTS + 2] }
    }
}

impl<const N: usize> Accumulation<N> {
    /// A flight took `duration` and ended at (t, x). The time and the point at which crossings
    /// accumulate, if they do and the time left until then is below what is resolved.
    fn flight(
        &mut self,
        duration: f64,
        t: f64,
        x: SVector<f64, N>,
    ) -> Option<(f64, SVector<f64, N>)> {
        self.last.rotate_right(1);
        self.last[0] = (duration, x);
        if duration < self.last[2].0 {
            self.in_a_row += 1;
        } else {
            (self.in_a_row, self.first) = (0, duration);
        }
        if self.in_a_row < ZENO_FLIGHTS as u64 {
            return None;
        }
        let ratios = (0..ZENO_FLIGHTS).map(|i| self.last[i].0 / self.last[i + 2].0);
        let (low, high) = ratios.fold((f64::INFINITY, 0.0_f64), |(l, h), r| (l.min(r), h.max(r)));
        let left = (self.last[0].0 + self.last[1].0) * high / (1.0 - high);
        // A NaN is no accumulation.
        let geometric =
            high - low <= LIMITS.zeno_spread * (1.0 - high) && left <= LIMITS.zeno_left * t.abs();
        geometric.then(|| (left, x + (x - self.last[2].1) * (high / (1.0 - high))))
    }
}

impl<const N: usize> Accumulation<N> {
    /// The tolerances of the next flight. Its height is of the order of the square of its duration,
    /// and may be far below the absolute tolerance.
    fn tolerance(&self, of_the_run: Tolerance) -> Tolerance {
        let shrunk = self.last[0].0 / self.first;
        if self.in_a_row == 0 || shrunk.is_nan() || shrunk > LIMITS.zeno_shrunk {
            return of_the_run;
        }
        Tolerance { atol: of_the_run.atol * shrunk * shrunk, ..of_the_run }
    }
}

/// Flights in a row whose durations have one ratio, before it is taken for the ratio of all that
/// follow.
const ZENO_FLIGHTS: usize = 8;

/// A motion that does not move.
struct ConstantState<const N: usize>(SVector<f64, N>);

impl<const N: usize> Interpolant<N> for ConstantState<N> {
    fn at(&self, _: f64) -> SVector<f64, N> {
        self.0
    }
    fn degree(&self) -> usize {
        0
    }
    fn bernstein(&self) -> Option<[SVector<f64, N>; 5]> {
        Some([SVector::zeros(); 5])
    }
}

const SIDES: [Side; 2] = [Side::Plus, Side::Minus];
/// Lie derivatives of sizes between this and its reciprocal are of order one.
const CLOCK: f64 = 65_536.0;
/// Parts of a step between which the end of a domain is looked for.
const QUARTERS: [f64; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// A long stretch without events must not keep a monitor waiting.
const STEPS_BETWEEN_WATCHES: u32 = 4096;

/// Chords of a step by which its length is measured.
const CHORDS: usize = 16;

/// The numbers by which the engine decides what rounding blurs. None is a tolerance of the motion;
/// those are in [`FilippovOptions`].
struct Limits {
    /// A first Lie derivative below this share of its terms, and of its change over the size of the
    /// run, is zero: some fifty roundings.
    lie: f64,
    /// A two-fold is looked for where both Lie derivatives are below so many of those.
    near_two_fold: f64,
    /// Two-folds within this share of their size are one, and so are a two-fold and the present
    /// state.
    same_point: f64,
    /// Newton steps that sharpen a touch of the surface, which a root finder knows only to half of
    /// the digits.
    touch_steps: usize,
    /// Largest fraction of the step by which such a Newton step moves the touch.
    touch_range: f64,
    /// Largest difference of the ratios of durations in an accumulation, as a share of their
    /// distance from 1.
    zeno_spread: f64,
    /// Largest rest of an accumulation, as a share of the time.
    zeno_left: f64,
    /// Flights that are shorter than this share of the first of such a row are integrated with
    /// smaller absolute tolerances.
    zeno_shrunk: f64,
    /// A field is zero at a point of the surface below this share of the speed of the motion
    /// before: a root of the rounding, for fields that are no smoother than sqrt(|h|) there.
    rest: f64,
    /// Smallest relative tolerance of a flight.
    finest: f64,
    /// The end of a run is reached within so many spacings of the numbers there.
    end: f64,
    /// A sliding step that advances time by no more than this share of it is idle.
    idle: f64,
    /// So many idle steps are the arrival at a degenerate point.
    idle_steps: u32,
    /// A field without values beyond the surface is asked no nearer to it, where the surface goes
    /// through zero.
    depth: f64,
    /// Parts of a step that are no farther apart are one moment.
    same_moment: f64,
    /// The first step of sliding out of two folds in one place changes the Lie derivatives by this
    /// share of the same.
    departure: f64,
    /// The rate at which sliding passes two folds in one place changes there by less than this
    /// share of it.
    kink: f64,
    /// Closer to a two-fold than so many tolerances there is nothing to integrate.
    blur: f64,
    /// Rounding of the state, as a share of it, by which h is blurred.
    blurred: f64,
    /// Distance of a zero of h from the surface, as a share of the state, above which h jumps.
    jump: f64,
    /// At a zero h is smaller than this share of what it was halfway to it; at a pole or jump it is
    /// not.
    falls: f64,
    /// A share below this is as good as zero.
    small: f64,
    /// A field runs along the surface if it does so at these distances before and behind, as shares
    /// of the states.
    along: [f64; 3],
    /// Distances ahead, as shares of the states, at which it is seen to which side a field leads
    /// that is tangent to the surface.
    ahead: [f64; 6],
    /// Distances from a corner of h, as shares of the states, at which its two sides are looked at.
    corner: [f64; 2],
    /// Velocities of sliding at these distances that differ by less than this share are one.
    same_velocity: f64,
    /// A field has no limit at the surface if from the first of these distances to the second, and
    /// on to the third, it grows by as much again.
    approach: [f64; 3],
    /// Sliding restarts on the surface when it has drifted off by this share of the state, or by
    /// `drift_in_tolerances`.
    drift: f64,
    /// Drift in absolute tolerances at which sliding restarts, if that is more.
    drift_in_tolerances: f64,
    /// Chords by which the path out of a two-fold is measured.
    departure_chords: usize,
    /// Departures shorter than this share of the shortest one are raised to it: closer to the
    /// two-fold the signs of the Lie derivatives are rounding.
    shortest_departure: f64,
}

const LIMITS: Limits = Limits {
    lie: 1e-14,
    near_two_fold: 1e5,
    same_point: 1e-9,
    touch_steps: 4,
    touch_range: 1e-3,
    zeno_spread: 0.1,
    zeno_left: 1e-10,
    zeno_shrunk: 0.1,
    rest: 1e-7,
    finest: 16.0 * f64::EPSILON,
    end: 4.0 * f64::EPSILON,
    idle: 4.0 * f64::EPSILON,
    idle_steps: 32,
    depth: 1e-24,
    same_moment: 1e-9,
    departure: 1e-7,
    kink: 1e-3,
    blur: 300.0,
    blurred: 64.0 * f64::EPSILON,
    jump: 1e-7,
    falls: 0.9,
    small: 1e-6,
    along: [1e-4, 1e-2, 0.1],
    ahead: [1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1],
    corner: [1e-6, 1e-4],
    same_velocity: 1e-3,
    approach: [1e-4, 1e-8, 1e-12],
    drift: 1e-10,
    drift_in_tolerances: 10.0,
    departure_chords: 256,
    shortest_departure: 1e-6,
};

/// Part of the rest of a step behind which a margin that has touched zero is looked at.
const BEHIND_TOUCH: f64 = 1e-2;
/// So many touches of a margin in one step are passed.
const MOST_TOUCHES: usize = 16;
const DEGENERATE_END: &str = "sliding comes to a point where both fields are tangent to the \
    surface, and which is neither a regular two-fold nor two folds in one place with a sliding \
    motion through them";

/// The ways on, in words.
const REPELLING: &str = "repelling sliding, which may end at any later moment to either side";
fn flight(side: Side) -> String {
    format!("flight to h {} 0", if side == Side::Plus { ">" } else { "<" })
}

/// The event that ended a stretch of sliding within a step.
#[derive(Clone, Copy, Debug, PartialEq)]
enum SlidingEnd {
    /// L+h (`Plus`) or L-h (`Minus`) came to zero.
    Fold(Side),
    Planned,
    Time,
}

/// First and second Lie derivatives with the sizes below which the first count as zero.
struct Lie {
    p: f64,
    q: f64,
    /// L+²h and L-²h.
    pp: f64,
    mm: f64,
    /// L-L+h and L+L-h.
    pm: f64,
    mp: f64,
    zero_p: f64,
    zero_q: f64,
}

struct Engine<'a, P, const N: usize> {
    system: &'a P,
    settings: &'a FilippovOptions,
    /// The exit rule at work. It goes on from run to run where one run is made of several.
    chooser: &'a mut Chooser,
    /// Any, so that the engine is compiled once for all of them.
    observer: &'a mut dyn FilippovObserver<N>,
    monitor: &'a dyn Monitor,
    t: f64,
    x: SVector<f64, N>,
    t_end: f64,
    events: u64,
    statistics: Statistics,
    accumulation: Accumulation<N>,
    /// The largest |x_i| of the run so far: rounding in a state is relative to it.
    size: SVector<f64, N>,
    /// The largest mean speed of a step so far, by components.
    speed: SVector<f64, N>,
    stop: Option<StopReason>,
    steps_until_watch: u32,
    /// Whether the next flight is integrated with the squares of the tolerances.
    tightened: bool,
    /// Set where a field has no value beyond the surface: how near to it fields are asked (see
    /// [`Sided`]).
    depth: Option<f64>,
    /// f+ and f-, with the ends of their domains.
    fields: [(Arc<Tape>, Option<Ends>); 2],
    /// The structure that steps of f+, f-, and of attracting and repelling sliding may jump over;
    /// `None` until it is asked for.
    gates: [Option<Option<Gates>>; 4],
}

impl<P: PiecewiseSmooth<N>, const N: usize> Engine<'_, P, N> {
    fn summary(self, mode: Option<Mode>, stop: StopReason) -> FilippovSummary<N> {
        FilippovSummary {
            t: self.t,
            x: self.x,
            mode,
            stop,
            events: self.events,
            statistics: self.statistics,
        }
    }

    fn event(&mut self, kind: EventKind, from: Option<Mode>, to: Option<Mode>) {
        self.events += 1;
        let event = ModeEvent { t: self.t, state: self.x, kind, from, to };
        if self.observer.event(&event) == Flow::Stop {
            self.stop.get_or_insert(StopReason::Observer);
        }
        self.ask_watch();
    }

    fn ask_watch(&mut self) {
        self.steps_until_watch = STEPS_BETWEEN_WATCHES;
        if self.monitor.reached(self.t).is_break() {
            self.stop.get_or_insert(StopReason::Cancelled);
        }
    }

    /// A contact that is not decided, unless the fields have no value there.
    fn non_transversal(&self, what: &'static str) -> FilippovError {
        let (t, state) = (self.t, Failure::state(&self.x));
        match self.cause_on_surface() {
            None => FilippovError::NonTransversal { t, state, what },
            Some(cause) => cause.into(),
        }
    }

    fn undecided(
        &self,
        what: &'static str,
        continuations: impl IntoIterator<Item = String>,
    ) -> FilippovError {
        let (t, state) = (self.t, Failure::state(&self.x));
        let continuations = continuations.into_iter().collect();
        let choice = Choice { what, continuations, remedy: CHOOSE };
        FilippovError::Undecided { t, state, choice: Box::new(choice) }
    }

    fn no_exit(&self, why: &'static str) -> FilippovError {
        FilippovError::NoSuchExit { t: self.t, state: Failure::state(&self.x), why }
    }

    fn sided(&self) -> Sided<'_, P> {
        Sided { system: self.system, depth: self.depth }
    }

    /// A field has no finite value at or beyond the surface: from here on each is asked on its own
    /// side only. Whether that is new.
    fn stay_inside(&mut self) -> bool {
        let new = self.depth.is_none();
        // Resolved by the state's digits, or where the surface goes through zero so small that no
        // tolerance sees it.
        let least = (4.0 * f64::EPSILON * self.x.amax()).max(LIMITS.depth);
        self.depth = Some(least * length(&gradient(self.system, &self.x)));
        new
    }

    /// Lie derivatives at a state on the surface.
    fn lie_on_surface(&mut self) -> Lie {
        let l = self.lie(&self.x);
        let known = l.p.is_finite() && l.q.is_finite();
        if !known && self.stay_inside() { self.lie(&self.x) } else { l }
    }

    fn lie(&self, x: &SVector<f64, N>) -> Lie {
        let system = self.sided();
        let (plus, minus) = (system.plus(x), system.minus(x));
        let (p, q) = lie_derivatives::<Sided<'_, P>, Dual<f64, N>, N>(&system, &variables(x));
        let along = |d: &Dual<f64, N>, f: &SVector<f64, N>| {
            (0..N).map(|i| d.partials[i] * f[i]).sum::<f64>()
        };
        let slope = gradient(self.system, x);
        // Rounding of the sum that is the Lie derivative, and of the state that it is taken at.
        let zero = |d: &Dual<f64, N>, f: &SVector<f64, N>| {
            let terms =
                (0..N).flat_map(|i| [(slope[i] * f[i]).abs(), d.partials[i].abs() * self.size[i]]);
            // A derivative that does not exist says nothing.
            LIMITS.lie * terms.filter(|term| term.is_finite()).sum::<f64>()
        };
        Lie {
            p: p.value,
            q: q.value,
            pp: along(&p, &plus),
            mm: along(&q, &minus),
            pm: along(&p, &minus),
            mp: along(&q, &plus),
            zero_p: zero(&p, &plus),
            zero_q: zero(&q, &minus),
        }
    }

    /// The factor, a power of two, by which the clock of the sliding flow runs: it would run in
    /// units of the Lie derivatives, which are those of h over those of time. Where these are of
    /// order one it is 1.
    fn sliding_clock(&self) -> f64 {
        let l = self.lie(&self.x);
        let rate = l.zero_p.max(l.zero_q) / LIMITS.lie;
        let mut clock = 1.0;
        if rate > 0.0 && rate.is_finite() && !(1.0 / CLOCK..=CLOCK).contains(&rate) {
            while rate * clock < 1.0 {
                clock *= 2.0;
            }
            while rate * clock >= 2.0 {
                clock *= 0.5;
            }
        }
        clock
    }

    /// The rounding of h at a state.
    fn blur(&self, x: &SVector<f64, N>) -> f64 {
        LIMITS.blurred * gradient(self.system, x).abs().dot(&x.abs())
    }

    /// Counts a finished piece's work.
    fn count(&mut self, work: &Statistics) {
        self.statistics += work;
        if self.statistics.steps > self.settings.max_steps {
            self.stop.get_or_insert(StopReason::StepBudget);
        }
    }

    /// Hands a step to the observer and moves to its end.
    fn take(&mut self, mode: Mode, t1: f64, x1: SVector<f64, N>, interpolant: &dyn Interpolant<N>) {
        if t1 > self.t {
            let step = Step { t0: self.t, t1, x0: self.x, x1, interpolant };
            self.size = self.size.zip_map(&x1, |s, x| s.max(x.abs()));
            self.speed =
                self.speed.zip_map(&((x1 - self.x) / (t1 - self.t)), |s, v| s.max(v.abs()));
            if self.observer.step(mode, &step) == Flow::Stop {
                self.stop.get_or_insert(StopReason::Observer);
            }
        }
        (self.t, self.x) = (t1, x1);
        self.steps_until_watch -= 1;
        if self.steps_until_watch == 0 {
            self.ask_watch();
        }
    }

    /// The mode at the start of a run on the surface.
    fn start(&mut self) -> Result<State<N>, FilippovError> {
        self.x = project(self.system, &self.x);
        let l = self.lie_on_surface();
        if let Some(local) = self.two_fold_here(&l) {
            self.x = local.point;
            self.event(EventKind::TwoFoldReached { leg: 0.0, error: 0.0 }, None, None);
            return Ok(State::TwoFold(Box::new(local)));
        }
        if let Some(folds) = self.fused_here(&l) {
            return Ok(self.meet(folds, None));
        }
        // Growth of |h| along each field on its own side; a fold counts by its second derivative.
        let growth = |first: f64, zero: f64, side: Side| {
            if first.abs() > zero {
                (first > 0.0).then_some(FlightStart::Transversal(first))
            } else {
                self.tangency(&l, side).left()
            }
        };
        let [plus, minus] =
            [growth(l.p, l.zero_p, Side::Plus), growth(-l.q, l.zero_q, Side::Minus)];
        // Beside a field that leads away, motion with another one that rests here or runs along.
        let stays = |first: f64, zero: f64, side: Side| {
            first.abs() <= zero && self.tangency(&l, side).is_unknown()
        };
        let open = plus.is_some() && stays(l.q, l.zero_q, Side::Minus)
            || minus.is_some() && stays(l.p, l.zero_p, Side::Plus);
        if open && self.chooser.rule == ExitRule::Undecided {
            let away = if plus.is_some() { Side::Plus } else { Side::Minus };
            let ways = ["motion on the surface with the other field".to_owned(), flight(away)];
            return Err(self.undecided(
                "one field leads away from the switching surface, and the other one is tangent to \
                    it or zero there",
                ways,
            ));
        }
        let state = match (plus, minus) {
            (Some(start), None) => State::Free { side: Side::Plus, start },
            (None, Some(start)) => State::Free { side: Side::Minus, start },
            (None, None) => State::Sliding(Sliding::ATTRACTING),
            (Some(_), Some(_)) => return self.enter_repelling(None),
        };
        self.event(EventKind::StartedOnSurface, None, state.mode());
        Ok(state)
    }

    /// The present state, where the first Lie derivatives decide nothing: two folds in one place,
    /// or a rest.
    fn degenerate(
        &mut self,
        from: Option<Mode>,
        what: &'static str,
    ) -> Result<State<N>, FilippovError> {
        let l = self.lie_on_surface();
        if let Some(folds) = self.fused_here(&l) {
            return Ok(self.meet(folds, from));
        }
        if from == Some(Mode::SlidingAttracting) && self.slides_past_touch() {
            return Ok(State::Sliding(Sliding::ATTRACTING));
        }
        self.rest_or(from, what)
    }

    /// Both fields touch the surface here, and attracting sliding goes on behind with the velocity
    /// that it has before: past the point, if it is so.
    fn slides_past_touch(&mut self) -> bool {
        let sided = self.sided();
        let velocity = |x: &SVector<f64, N>| {
            let (field, rate) = desingularised(&sided, x);
            field / rate
        };
        let here = velocity(&self.x);
        let mean = (sided.plus(&self.x) + sided.minus(&self.x)) * 0.5;
        let guess = if finite(&here) { here } else { mean };
        let per_speed = self.reach() / guess.norm();
        let [near, far] = LIMITS.corner.map(|share| share * per_speed);
        let at = |time: f64| project(self.system, &(self.x + guess * time));
        let ahead = velocity(&at(near));
        let slides = |time: f64| {
            let x = at(time);
            let margins = Sliding::ATTRACTING.margins(&sided, &x);
            margins.iter().all(|margin| *margin > 0.0)
                && (velocity(&x) - ahead).norm() <= LIMITS.same_velocity * ahead.norm()
        };
        let time = near.min(self.t_end - self.t);
        if ![-far, -near, near, far].into_iter().all(slides) {
            return false;
        }
        let (from, to) = (self.x, project(self.system, &(self.x + ahead * time)));
        let straight = Straight { system: self.system, from, to };
        self.take(Mode::SlidingAttracting, self.t + time, to, &straight);
        true
    }

    /// A rest, if zero lies between the fields here, or an error that says `what` else.
    fn rest_or(
        &mut self,
        from: Option<Mode>,
        what: &'static str,
    ) -> Result<State<N>, FilippovError> {
        if !self.rests_here() {
            return match from {
                Some(Mode::Plus) if self.root_begins() => self.land(Side::Plus, false),
                Some(Mode::Minus) if self.root_begins() => self.land(Side::Minus, false),
                _ if self.root_begins() => self.start(),
                _ => Err(self.non_transversal(what)),
            };
        }
        let mode = Mode::SlidingAttracting;
        let kind = match from {
            Some(Mode::Plus) => EventKind::Landing { from: Side::Plus },
            Some(Mode::Minus) => EventKind::Landing { from: Side::Minus },
            _ => EventKind::StartedOnSurface,
        };
        if from != Some(mode) {
            self.event(kind, from, Some(mode));
        }
        Ok(State::Rest)
    }

    /// Whether the motion may stay at the present state. The fields are known up to their change
    /// over the rounding of h.
    fn rests_here(&self) -> bool {
        let (x, slope) = (self.x, gradient(self.system, &self.x));
        let blurred = slope * (self.blur(&x) / slope.norm_squared());
        let beside = [(Side::Plus, x + blurred), (Side::Minus, x - blurred)];
        let below = beside.into_iter().fold(self.speed * LIMITS.rest, |below, (side, y)| {
            let there = match side {
                Side::Plus => self.system.plus(&y),
                Side::Minus => self.system.minus(&y),
            };
            below.zip_map(&(there - self.velocity(side)), |b, change| b.max(change.abs()))
        });
        self.rests_at(&x, &below)
    }

    /// Both fields are one here, along the surface, and without a derivative across it: the sides
    /// to which they lead are seen beside the surface, each on its own, from here on. Whether that
    /// is new.
    fn root_begins(&mut self) -> bool {
        let l = self.lie(&self.x);
        let apart = (self.velocity(Side::Plus) - self.velocity(Side::Minus)).abs();
        let is_one = (0..N).all(|i| apart[i] <= LIMITS.rest * self.speed[i]);
        let is_tangent = l.p.abs() <= l.zero_p && l.q.abs() <= l.zero_q;
        is_tangent && is_one && !(l.pp + l.mm).is_finite() && self.stay_inside()
    }

    /// Whether a convex combination of the two fields at `x` is zero, each component up to `below`:
    /// then Filippov's set of velocities holds zero, and the motion may stay (Filippov 1988, sec.
    /// 19).
    fn rests_at(&self, x: &SVector<f64, N>, below: &SVector<f64, N>) -> bool {
        let (system, sided) = (self.system, self.sided());
        // Their values there, or beside it on their own sides where they have none there.
        let [plus, minus] = [[system.plus(x), sided.plus(x)], [system.minus(x), sided.minus(x)]]
            .map(|[there, beside]| if finite(&there) { there } else { beside });
        // The combination nearest to zero, each component in units of its own size.
        let scaled = |v: SVector<f64, N>| {
            SVector::<f64, N>::from_fn(|i, _| {
                let size = plus[i].abs().max(minus[i].abs());
                if size > 0.0 { v[i] / size } else { 0.0 }
            })
        };
        let (apart, base) = (scaled(plus - minus), scaled(minus));
        let square = apart.norm_squared();
        let weight = if square > 0.0 { (-apart.dot(&base) / square).clamp(0.0, 1.0) } else { 0.0 };
        let mean = minus + (plus - minus) * weight;
        let rounding = |i: usize| 4.0 * f64::EPSILON * plus[i].abs().max(minus[i].abs());
        (0..N).all(|i| mean[i].abs() <= below[i].max(rounding(i)))
    }

    /// Crossings accumulate at `point`, `left` after the present moment: what follows, if the
    /// motion stays there.
    fn accumulate(
        &mut self,
        side: Side,
        left: f64,
        point: SVector<f64, N>,
        duration: f64,
    ) -> Result<State<N>, FilippovError> {
        let (crossings, point) = (self.accumulation.in_a_row, project(self.system, &point));
        // As far as the fields change over what is left of the accumulation, they are not known at
        // its end.
        let change =
            |f: &dyn Fn(&SVector<f64, N>) -> SVector<f64, N>| (f(&self.x) - f(&point)).abs();
        let (plus, minus) = (change(&|x| self.system.plus(x)), change(&|x| self.system.minus(x)));
        let below = plus.zip_map(&minus, |a, b| 10.0 * a.max(b));
        let rests = self.rests_at(&point, &below);
        if !rests && !self.attracts_beside(&point) {
            return Err(FilippovError::Zeno {
                t: self.t,
                state: Failure::state(&self.x),
                crossings,
                last: duration,
                accumulates: self.t + left,
            });
        }
        let straight = Straight { system: self.system, from: self.x, to: point };
        self.take(side.into(), up_to(self.t_end, self.t + left).min(self.t_end), point, &straight);
        self.accumulation = Accumulation::default();
        let mode = Mode::SlidingAttracting;
        self.event(EventKind::Accumulation { leg: left }, Some(side.into()), Some(mode));
        Ok(if rests { State::Rest } else { State::Sliding(Sliding::ATTRACTING) })
    }

    /// Whether both fields lead to the surface beside `x`, a state on it: they are seen there, each
    /// on its own side, from here on.
    fn attracts_beside(&mut self, x: &SVector<f64, N>) -> bool {
        self.stay_inside();
        let l = self.lie(x);
        l.p < -l.zero_p && l.q > l.zero_q
    }

    /// Begins on the surface in a mode that is known.
    fn begin(&mut self, mode: Mode) -> State<N> {
        self.event(EventKind::StartedOnSurface, None, Some(mode));
        match mode {
            Mode::Plus => self.launch(Side::Plus),
            Mode::Minus => self.launch(Side::Minus),
            Mode::SlidingAttracting | Mode::SlidingRepelling => State::Sliding(Sliding::ATTRACTING),
        }
    }

    /// A two-fold at the present state, if both Lie derivatives are almost zero there.
    fn two_fold_here(&self, l: &Lie) -> Option<SlidingAtTwoFold<N>> {
        let near = LIMITS.near_two_fold * l.zero_p.max(l.zero_q);
        if l.p.abs() > near || l.q.abs() > near {
            return None;
        }
        let local = SlidingAtTwoFold::near(self.system, &self.x)?;
        ((local.point - self.x).norm() <= LIMITS.same_point * local.radius.min(self.size.norm()))
            .then_some(local)
    }

    /// The state is in the repelling region: ask the rule.
    fn enter_repelling(&mut self, from: Option<Mode>) -> Result<State<N>, FilippovError> {
        self.event(EventKind::EnteredRepelling, from, Some(Mode::SlidingRepelling));
        if self.chooser.rule == ExitRule::Undecided {
            let ways = [REPELLING.to_owned(), flight(Side::Plus), flight(Side::Minus)];
            return Err(self.undecided("both fields point away from the switching surface", ways));
        }
        let Some(plan) = self.chooser.plan() else {
            return Ok(State::SetValued(Some(Mode::SlidingRepelling)));
        };
        if plan.time <= 0.0 || plan.arc <= 0.0 {
            return Ok(self.exit(plan.side, 0.0, 0.0, from));
        }
        Ok(State::Sliding(Sliding { repelling: true, plan: Some(plan), time: 0.0, arc: 0.0 }))
    }

    /// Leaves repelling sliding by the rule.
    fn exit(&mut self, to: Side, time: f64, arc: f64, from: Option<Mode>) -> State<N> {
        let rule = self.chooser.rule;
        self.event(EventKind::Exit { to, time, arc, rule }, from, Some(to.into()));
        self.launch(to)
    }

    /// A flight from a point of the surface where the field of `side` points to it.
    fn launch(&mut self, side: Side) -> State<N> {
        let l = self.lie_on_surface();
        let (first, zero) = match side {
            Side::Plus => (l.p, l.zero_p),
            Side::Minus => (-l.q, l.zero_q),
        };
        let start = if first.abs() > zero {
            FlightStart::Transversal(first)
        } else {
            let own = if side == Side::Plus { l.pp } else { -l.mm };
            self.tangency(&l, side).left().unwrap_or(FlightStart::Tangent(own))
        };
        State::Free { side, start }
    }

    /// A failure in flight with what the field of `side` shows of its cause.
    fn diagnosed(&self, failure: Failure, side: Side) -> FilippovError {
        failure.diagnosed(&self.field(side).0).into()
    }

    fn field(&self, side: Side) -> &(Arc<Tape>, Option<Ends>) {
        &self.fields[usize::from(side == Side::Minus)]
    }

    /// Why the motion does not go on from the present state on the surface, as far as a field shows
    /// it: its domain ends, or it grows without bound.
    fn cause_on_surface(&self) -> Option<Failure> {
        let sided = self.sided();
        let (field, rate) = desingularised(&sided, &self.x);
        let velocity = field / rate;
        let velocity = finite(&velocity).then_some(velocity.as_slice());
        let cause = |side: Side| {
            let state = Failure::state(&sided.inside(&self.x, side));
            let stopped = Failure::StepUnderflow { t: self.t, h: 0.0, state };
            match stopped.diagnosed_along(&self.field(side).0, velocity) {
                Failure::Undefined { t, what, .. } => {
                    Some(Failure::Undefined { t, state: Failure::state(&self.x), what })
                }
                Failure::Unbounded { t, .. } => {
                    Some(Failure::Unbounded { t, state: Failure::state(&self.x) })
                }
                _ => None,
            }
        };
        SIDES.into_iter().find_map(cause)
    }

    /// End of the domain of a field on one of `sides` in a step, as a fraction, and the reason in
    /// words; `state` is the part of the step that the field depends on.
    fn domain_end(
        &self,
        sides: &[Side],
        state: &dyn Fn(f64) -> SVector<f64, N>,
    ) -> Option<(f64, String)> {
        let sided = self.sided();
        let ends = sides.iter().filter_map(|side| {
            let path = |theta: f64| Failure::state(&sided.inside(&state(theta), *side));
            self.field(*side).1.as_ref()?.first(&path, &QUARTERS)
        });
        ends.min_by(|(a, _), (b, _)| a.total_cmp(b))
    }

    /// Whether h has a simple zero at `x`, on the surface: at some distance between rounding and
    /// `before`, a state of the flight to it, h differs between both sides by what its slope says.
    /// Each state counts in units of its own size.
    fn has_slope(&self, before: &SVector<f64, N>, x: &SVector<f64, N>) -> bool {
        let h = |x: &SVector<f64, N>| self.system.switching(x);
        let units = self.size.map(|size| if size > 0.0 { size } else { self.reach() });
        let steepness = |x: &SVector<f64, N>| gradient(self.system, x).component_mul(&units);
        let (normal, way) = (steepness(x), (before - x).component_div(&units).norm());
        let slope = length(&normal);
        let steepest = length(&steepness(before)).max(h(before).abs() / way);
        if !(slope > 0.0 && slope <= steepest / LIMITS.small) {
            return false;
        }
        let normal = (normal / slope).component_mul(&units);
        let nearest = 10.0 * h(x).abs() / slope + 100.0 * f64::EPSILON;
        let mut distances = std::iter::successors(Some(nearest), |distance| Some(10.0 * distance))
            .take_while(|distance| *distance < way)
            .peekable();
        distances.peek().is_none()
            || distances.any(|distance| {
                let rise = h(&(x + normal * distance)) - h(&(x - normal * distance));
                let share = rise / (2.0 * slope * distance);
                share.is_nan() || (0.5..2.0).contains(&share)
            })
    }

    /// The states' size, by which distances along and across the surface are measured.
    fn reach(&self) -> f64 {
        let size = self.size.norm();
        if size > 0.0 { size } else { 1.0 }
    }

    fn is_tangent(&self, x: &SVector<f64, N>, side: Side) -> bool {
        let l = self.lie(x);
        match side {
            Side::Plus => l.p.abs() <= l.zero_p,
            Side::Minus => l.q.abs() <= l.zero_q,
        }
    }

    /// The field of `side` here.
    fn velocity(&self, side: Side) -> SVector<f64, N> {
        match side {
            Side::Plus => self.sided().plus(&self.x),
            Side::Minus => self.sided().minus(&self.x),
        }
    }

    /// The tangency of the field of `side` to the surface here, by the field ahead.
    fn tangency(&self, l: &Lie, side: Side) -> Tangency {
        let own = if side == Side::Plus { l.pp } else { -l.mm };
        let velocity = self.velocity(side);
        let per_speed = self.reach() / velocity.norm();
        // The rounding of h for states of the run's size: what changes it by more is seen.
        let least = LIMITS.blurred * gradient(self.system, &self.x).abs().dot(&self.size);
        let ahead = LIMITS.ahead.into_iter().find_map(|share| {
            let time = share * per_speed;
            let x = project(self.system, &(self.x + velocity * time));
            let l = self.lie(&x);
            let rate = if side == Side::Plus { l.p } else { -l.q };
            (finite(&x) && rate.abs() * time > least).then_some((rate, time))
        });
        match ahead {
            Some((rate, time)) if (rate / time - own).abs() > 0.5 * own.abs() => {
                Tangency::Flat { grows: rate > 0.0, after: time }
            }
            _ => Tangency::Fold(own),
        }
    }

    /// A hop to the side of a field that brings the motion back at once, if it is lower than the
    /// rounding of h: its parabola is followed. `first`, `second`: derivatives of |h|.
    fn hops(&mut self, side: Side, first: f64, second: f64) -> bool {
        let (height, duration) = (0.5 * first * first / -second, 2.0 * first / -second);
        let is_low = second < 0.0 && height <= self.blur(&self.x);
        if !is_low || self.t + duration >= self.t_end {
            return false;
        }
        let (system, from) = (self.system, self.x);
        let straight = Straight { system, from, to: from + self.velocity(side) * duration };
        self.take(side.into(), self.t + duration, straight.at(1.0), &straight);
        true
    }

    /// Whether the field of `side` is tangent to the surface here and all along its way there.
    fn runs_along(&self, side: Side) -> bool {
        let velocity = self.velocity(side);
        let per_speed = self.reach() / velocity.norm();
        let on_the_way = LIMITS.along.iter().flat_map(|share| [-share, *share]);
        let points = on_the_way
            .map(|share| project(self.system, &(self.x + velocity * (share * per_speed))));
        per_speed.is_finite()
            && points.chain([self.x]).all(|x| finite(&x) && self.is_tangent(&x, side))
    }

    /// A field of which the domain ends on the surface, where it grows without bound: it makes no
    /// sliding motion.
    fn without_limit(&self) -> Option<Failure> {
        let normal = gradient(self.system, &self.x);
        let normal = normal / length(&normal) * self.reach();
        SIDES.into_iter().find_map(|side| {
            let (tape, ends) = self.field(side);
            let at = |depth: f64| Failure::state(&(self.x + normal * (side.sign() * depth)));
            let [far, near, nearest] = LIMITS.approach;
            let across = |theta: f64| at(near * (1.0 - 2.0 * theta));
            let (place, what) = ends.as_ref()?.first(&across, &[0.0, 1.0])?;
            let value = |depth: f64| -> Vec<f64> {
                let values = tape.values(&at(depth));
                tape.outputs().iter().map(|node| values[*node].abs()).collect()
            };
            let (far, near, nearest) = (value(far), value(near), value(nearest));
            let grows = |i: usize| {
                let [first, second] = [near[i] - far[i], nearest[i] - near[i]];
                first > 0.0 && second > 0.5 * first
            };
            let (t, state) = (self.t, Failure::state(&self.x));
            ((place - 0.5).abs() <= 1e-3 && (0..N).any(grows)).then_some(Failure::Undefined {
                t,
                state,
                what,
            })
        })
    }

    /// Free flight until the surface or the end.
    fn fly(&mut self, side: Side, start: FlightStart) -> Result<State<N>, FilippovError> {
        let place = usize::from(side == Side::Minus);
        let tape = &self.fields[place].0;
        let h = || Tape::record(N, |x| vec![self.system.switching(&SVector::from_column_slice(x))]);
        let gates = self.gates[place].take().unwrap_or_else(|| Gates::of_side(tape.clone(), &h()));
        let Tolerance { rtol, atol } = self.settings.tolerance;
        let tolerance = if self.tightened {
            Tolerance { rtol: (rtol * rtol).max(LIMITS.finest), atol: atol * atol }
        } else {
            self.accumulation.tolerance(self.settings.tolerance)
        };
        let mut method = Automatic::new(tolerance, gates);
        let next = self.fly_by(&mut method, side, start);
        self.gates[place] = Some(method.into_gates());
        next
    }

    fn fly_by(
        &mut self,
        method: &mut Automatic<N>,
        side: Side,
        start: FlightStart,
    ) -> Result<State<N>, FilippovError> {
        let system = self.system;
        let mut flow = FreeFlow { system: Sided { system, depth: self.depth }, side };
        let (t_start, mut start) = (self.t, start);
        let mut leaving = match start {
            FlightStart::Tangent(second) => Some(second),
            _ => None,
        };
        let free_until = match start {
            FlightStart::Flat(after) => t_start + after,
            _ => t_start,
        };
        if let Err(failure) =
            method.restart(&flow, self.t, self.x, self.t_end, self.settings.max_step)
        {
            return if self.stay_inside() {
                Ok(State::Free { side, start })
            } else {
                Err(self.diagnosed(failure, side))
            };
        }
        let landed = loop {
            let step = match method.step(&flow) {
                Ok(step) => step,
                // Trial points beyond the surface, where the motion does not go, may be where the
                // field has no value.
                Err(Failure::NotFinite { .. } | Failure::StepUnderflow { .. })
                    if self.stay_inside() =>
                {
                    flow.system.depth = self.depth;
                    let restarted =
                        method.restart(&flow, self.t, self.x, self.t_end, self.settings.max_step);
                    restarted.map_err(|failure| self.diagnosed(failure, side))?;
                    continue;
                }
                Err(failure) => return Err(self.diagnosed(failure, side)),
            };
            let height = |theta: f64| side.sign() * self.system.switching(&step.at(theta));
            let length = step.length();
            let at_start = start.over(length);
            // After a tangency the first steps may rise by less than the rounding of h.
            let gone = step.t1 - t_start;
            leaving = leaving.filter(|second| 0.5 * second * gone * gone <= self.blur(&step.x1));
            start =
                leaving.map_or(FlightStart::Away, |second| FlightStart::Transversal(second * gone));
            let enclosed = |x: &SVector<Enclosed, N>| self.system.switching(x).scale(side.sign());
            let free = (free_until - step.t0) / length;
            let zero = match leaving {
                Some(_) => None,
                None if free >= 1.0 => None,
                None if free > 0.0 => first_zero_after(free, &height),
                None => first_zero_along(&step, &height, &enclosed, at_start),
            };
            // A field whose domain ends on the surface ends the flight there.
            let landing = zero.map_or(f64::INFINITY, |zero| zero.theta() - LIMITS.same_moment);
            if let Some((end, what)) = self.domain_end(&[side], &|theta| step.at(theta))
                && end < landing
            {
                let (t, x) = (step.time(end), step.at(end));
                self.take(side.into(), t, x, &Truncated { inner: step.interpolant, end });
                return Err(Failure::Undefined { t, state: Failure::state(&x), what }.into());
            }
            match zero {
                None => {
                    let (t1, x1) = (step.t1, step.x1);
                    self.take(side.into(), t1, x1, step.interpolant);
                    if self.stop.is_some() || self.t >= self.t_end {
                        break None;
                    }
                }
                Some(zero) => {
                    let mut theta = zero.theta();
                    if matches!(zero, Zero::Touch(_)) {
                        // A touch is known only to the root of the rounding; the tangency itself is
                        // a simple zero.
                        for _ in 0..LIMITS.touch_steps {
                            let l = self.lie(&step.at(theta));
                            let (rate, second) = match side {
                                Side::Plus => (l.p, l.pp),
                                Side::Minus => (l.q, l.mm),
                            };
                            let moved = theta - rate / (second * length);
                            if !((moved - theta).abs() < LIMITS.touch_range
                                && (0.0..=1.0).contains(&moved))
                            {
                                break;
                            }
                            theta = moved;
                        }
                    }
                    let (t1, place) = (up_to(self.t_end, step.time(theta)), step.at(theta));
                    let x1 = project(self.system, &place);
                    // A zero of a continuous h is on the surface but for rounding, and h is smaller
                    // there than before.
                    let travel = (step.x1 - step.x0).norm() + place.norm();
                    let moved = (x1 - place).norm();
                    let [before, there] = [0.5 * theta, theta].map(&height);
                    let jumps = theta > LIMITS.same_moment
                        && before > 0.0
                        && there.abs() > (LIMITS.falls * before).max(self.blur(&place));
                    let on_surface = moved <= LIMITS.jump * travel;
                    if jumps || !on_surface || !self.has_slope(&step.at(0.5 * theta), &x1) {
                        self.take(
                            side.into(),
                            t1,
                            place,
                            &Truncated { inner: step.interpolant, end: theta },
                        );
                        let (t, state) = (t1, Failure::state(&place));
                        return Err(if jumps || there.abs() > LIMITS.small * before {
                            FilippovError::Jump { t, state }
                        } else {
                            FilippovError::Slope { t, state }
                        });
                    }
                    self.take(
                        side.into(),
                        t1,
                        x1,
                        &Truncated { inner: step.interpolant, end: theta },
                    );
                    break Some(zero);
                }
            }
            if method.statistics().steps > self.settings.max_steps {
                break None;
            }
        };
        self.count(&method.statistics());
        match landed {
            _ if self.stop.is_some() => Ok(State::Free { side, start: FlightStart::Away }),
            None => Ok(State::Free { side, start: FlightStart::Away }),
            Some(zero) => {
                let duration = self.t - t_start;
                if let Some((left, point)) = self.accumulation.flight(duration, self.t, self.x) {
                    return self.accumulate(side, left, point, duration);
                }
                self.land(side, matches!(zero, Zero::Touch(_)))
            }
        }
    }

    /// The mode after an arrival on the surface from `side`.
    fn land(&mut self, side: Side, touch: bool) -> Result<State<N>, FilippovError> {
        let tightened = std::mem::take(&mut self.tightened);
        let l = self.lie_on_surface();
        let from = Some(side.into());
        if let Some(local) = self.two_fold_here(&l) {
            let error = (local.point - self.x).norm() / self.system.plus(&self.x).norm();
            self.x = local.point;
            self.event(EventKind::TwoFoldReached { leg: 0.0, error }, from, None);
            return Ok(State::TwoFold(Box::new(local)));
        }
        if let Some(folds) = self.fused_here(&l) {
            return Ok(self.meet(folds, from));
        }
        // Growth of |h| on this side along its own field, and on the other side along the other
        // field.
        let (own, own_zero, own_second, across, across_zero, across_second) = match side {
            Side::Plus => (l.p, l.zero_p, l.pp, -l.q, l.zero_q, -l.mm),
            Side::Minus => (-l.q, l.zero_q, -l.mm, l.p, l.zero_p, l.pp),
        };
        let slides = own.abs() <= own_zero && across < -across_zero && self.runs_along(side)
            || own < -own_zero && across.abs() <= across_zero && self.runs_along(side.other());
        if slides {
            return Ok(self.land_for_good(side));
        }
        if own > own_zero && self.hops(side, own, own_second) {
            return self.land(side, false);
        }
        let tangent = own.abs() <= own_zero;
        let presses = tangent && self.tangency(&l, side).presses();
        if own >= -own_zero && !presses || (touch && own_second > 0.0) {
            let start = match tangent {
                true => self.tangency(&l, side).left(),
                false => (own_second > 0.0).then_some(FlightStart::Transversal(own)),
            };
            // A root begins at the surface, and its motion is known no better than the root of the
            // tolerance.
            let is_root = !tangent && !own_second.is_finite();
            if is_root && !tightened && !self.rests_here() {
                self.tightened = true;
                return Ok(State::Free { side, start: FlightStart::Transversal(own) });
            }
            let Some(start) = start else {
                return self
                    .degenerate(from, "a tangency from an invisible or degenerate side (a cusp)");
            };
            self.event(EventKind::Grazing { side }, from, from);
            return Ok(State::Free { side, start });
        }
        let other = side.other();
        let start = if across > across_zero {
            Some(FlightStart::Transversal(across))
        } else if across < -across_zero {
            None
        } else {
            let tangency = self.tangency(&l, other);
            if tangency.is_unknown() {
                return self.degenerate(
                    from,
                    "landing on a fold with zero second Lie derivative (a cusp)",
                );
            }
            tangency.left()
        };
        if let Some(start) = start {
            self.event(EventKind::Crossing { to: other }, from, Some(other.into()));
            if across > across_zero && self.hops(other, across, across_second) {
                return self.land(other, false);
            }
            return Ok(State::Free { side: other, start });
        }
        Ok(self.land_for_good(side))
    }

    fn land_for_good(&mut self, from: Side) -> State<N> {
        self.accumulation = Accumulation::default();
        let (kind, mode) = (EventKind::Landing { from }, Mode::SlidingAttracting);
        self.event(kind, Some(from.into()), Some(mode));
        State::Sliding(Sliding::ATTRACTING)
    }

    /// Sliding until a fold, a two-fold, the planned exit or the end.
    fn slide<const M: usize>(&mut self, sliding: Sliding) -> Result<State<N>, FilippovError>
    where
        for<'b> SlidingFlow<'b, P, N>: VectorField<M>,
    {
        if let Some(failure) = self.without_limit() {
            return Err(failure.into());
        }
        let direction = sliding.direction();
        let place = if direction > 0.0 { 2 } else { 3 };
        let gates = self.gates[place].take().unwrap_or_else(|| {
            let system = Sided { system: self.system, depth: None };
            let tape = VectorField::<M>::tape(&SlidingFlow { system, direction });
            Gates::of_part(Arc::new(Tape::clone(&tape).with_names(self.system.names())))
        });
        let mut method = Automatic::new(self.settings.tolerance, gates);
        let next = self.slide_by(&mut method, sliding);
        self.gates[place] = Some(method.into_gates());
        next
    }

    fn slide_by<const M: usize>(
        &mut self,
        method: &mut Automatic<M>,
        mut sliding: Sliding,
    ) -> Result<State<N>, FilippovError>
    where
        for<'b> SlidingFlow<'b, P, N>: VectorField<M>,
    {
        let system = self.system;
        let mode = sliding.mode();
        let sided = Sided { system, depth: self.depth };
        let clock = self.sliding_clock();
        let flow =
            SlidingFlow { system: Sided { ..sided }, direction: sliding.direction() * clock };
        let lift =
            |x: &SVector<f64, N>| SVector::<f64, M>::from_fn(|i, _| if i < N { x[i] } else { 0.0 });
        // The clock of the flow starts at zero with each restart, so that short times keep their
        // digits.
        let mut t_base = self.t;
        let mut fresh = true;
        let mut idle = 0;
        let mut came_from;
        let mut ahead = TwoFoldAhead::new();
        let mut along = SIDES.into_iter().find(|side| {
            let touches = || self.tangency(&self.lie(&self.x), *side).presses();
            !sliding.repelling
                && self.is_tangent(&self.x, *side)
                && (self.runs_along(*side) || touches())
        });
        if let Err(failure) =
            method.restart(&flow, 0.0, lift(&self.x), f64::INFINITY, f64::INFINITY)
        {
            return if self.stay_inside() {
                Ok(State::Sliding(sliding))
            } else {
                Err(self.cause_on_surface().unwrap_or(failure).into())
            };
        }
        let next = loop {
            let before = method.statistics().clone();
            let step = match method.step(&flow) {
                Ok(step) => step,
                Err(Failure::NotFinite { .. } | Failure::StepUnderflow { .. })
                    if self.stay_inside() =>
                {
                    self.count(&before);
                    return Ok(State::Sliding(sliding));
                }
                Err(_) if !sliding.repelling && self.rests_here() => {
                    self.count(&before);
                    return Ok(State::Rest);
                }
                Err(failure) => {
                    let seen = || in_time::<N>(failure, t_base);
                    return Err(self.cause_on_surface().unwrap_or_else(seen).into());
                }
            };
            let end = self.sliding_end(&step, &sliding, along, (t_base, clock), fresh);
            fresh = false;
            let until = end.map_or(f64::INFINITY, |(theta, _)| theta);
            if let Some((theta, what)) =
                self.domain_end(&SIDES, &|theta| without_clock(&step.at(theta)))
                && theta < until
            {
                let z = step.at(theta);
                let (t, x) = ((t_base + z[N]).min(self.t_end), project(system, &without_clock(&z)));
                let interpolant = InPhysicalTime {
                    system,
                    inner: step.interpolant,
                    end: theta,
                    clock: (step.x0[N], z[N]),
                };
                self.take(mode, t, x, &interpolant);
                if !sliding.repelling && self.rests_here() {
                    self.count(&method.statistics());
                    return Ok(State::Rest);
                }
                return Err(Failure::Undefined { t, state: Failure::state(&x), what }.into());
            }
            let theta = end.map_or(1.0, |(theta, _)| theta);
            let z1 = step.at(theta);
            let x1 = project(system, &without_clock(&z1));
            let t1 = match end {
                Some((_, SlidingEnd::Time)) => self.t_end,
                _ => up_to(self.t_end, t_base + z1[N]).min(self.t_end),
            };
            sliding.time += t1 - self.t;
            if sliding.plan.is_some() {
                sliding.arc += chords::<N, M>(&step, theta).iter().sum::<f64>();
            }
            let interpolant = InPhysicalTime {
                system,
                inner: step.interpolant,
                end: theta,
                clock: (step.x0[N], z1[N]),
            };
            let off = without_clock::<N, M>(&z1);
            let drift = system.switching(&off).abs();
            idle = if t1 - self.t <= LIMITS.idle * t1.abs() { idle + 1 } else { 0 };
            came_from = self.x;
            self.take(mode, t1, x1, &interpolant);
            if let Some((_, end)) = end {
                break Some(end);
            }
            if along.is_some_and(|side| !self.is_tangent(&self.x, side)) {
                (along, fresh) = (None, true);
            }
            if idle >= LIMITS.idle_steps {
                self.count(&method.statistics());
                return self.degenerate(Some(mode), DEGENERATE_END);
            }
            if self.stop.is_some() || method.statistics().steps > self.settings.max_steps {
                break Some(SlidingEnd::Time);
            }
            ahead.look(system, &self.x, sliding.margins(&sided, &self.x));
            // Nearer than the tolerances resolve there is nothing to integrate.
            let Tolerance { rtol, atol } = self.settings.tolerance;
            let blur = LIMITS.blur * (atol + rtol * self.x.amax());
            if let Some(fold) = ahead.within(system, &self.x, self.settings.leg, blur)
                && let Some((leg, error)) = fold.time_to_arrive(system, &self.x, sliding.repelling)
            {
                break self.arrive(fold.point, leg, error, mode);
            }
            // The size of h where the state is off by so much.
            let Tolerance { atol, .. } = self.settings.tolerance;
            let allowed =
                self.size.map(|size| (LIMITS.drift * size).max(LIMITS.drift_in_tolerances * atol));
            if drift > gradient(system, &off).abs().dot(&allowed) {
                t_base = self.t;
                method.restart(&flow, 0.0, lift(&self.x), f64::INFINITY, f64::INFINITY)?;
            }
        };
        self.count(&method.statistics());
        let from = Some(mode);
        match next {
            None => match ahead.whole {
                Some(fold) if self.t < self.t_end && self.stop.is_none() => {
                    Ok(State::TwoFold(Box::new(fold)))
                }
                Some(fold) if self.x == fold.point => Ok(State::TwoFold(Box::new(fold))),
                _ => Ok(State::Sliding(sliding)),
            },
            Some(SlidingEnd::Time) => Ok(State::Sliding(sliding)),
            Some(SlidingEnd::Planned) => {
                let side = sliding.plan.map_or(Side::Plus, |plan| plan.side);
                Ok(self.exit(side, sliding.time, sliding.arc, from))
            }
            Some(SlidingEnd::Fold(side)) => {
                let (field, rate) = desingularised(&sided, &came_from);
                match self.leave_at_corner(side, &sliding, field / rate)? {
                    Some(state) => Ok(state),
                    None => self.leave_at_fold(side, &sliding),
                }
            }
        }
    }

    /// The first end of sliding within a step of the sliding flow, and the fraction of the step at
    /// which it comes.
    fn sliding_end<const M: usize>(
        &self,
        step: &Step<'_, M>,
        sliding: &Sliding,
        along: Option<Side>,
        (t_base, clock): (f64, f64),
        fresh: bool,
    ) -> Option<(f64, SlidingEnd)> {
        let direction = sliding.direction();
        let mut first: Option<(f64, SlidingEnd)> = None;
        let mut propose = |theta: f64, end: SlidingEnd| {
            if first.is_none_or(|(best, _)| theta < best) {
                first = Some((theta, end));
            }
        };
        for (i, side) in [Side::Plus, Side::Minus].into_iter().enumerate() {
            if along == Some(side) {
                // Rounding of a margin that is zero is no end; what leads away is.
                let leaves = |k: usize| {
                    let z = step.at(k as f64 / CHORDS as f64);
                    let x = project(self.system, &without_clock(&z));
                    !self.is_tangent(&x, side) && sliding.margins(&self.sided(), &x)[i] < 0.0
                };
                if let Some(k) = (1..=CHORDS).find(|k| leaves(*k)) {
                    propose((k - 1) as f64 / CHORDS as f64, SlidingEnd::Fold(side));
                }
                continue;
            }
            let mut start = Start::Away;
            if fresh {
                let l = self.lie(&self.x);
                let (value, zero, rate) = match side {
                    Side::Plus => (-direction * l.p, l.zero_p, -(l.q * l.pp - l.p * l.pm)),
                    Side::Minus => (direction * l.q, l.zero_q, l.q * l.mp - l.p * l.mm),
                };
                // Sliding that begins on a fold: the margin's own zero there is not an exit.
                if value <= zero {
                    if rate <= 0.0 {
                        propose(0.0, SlidingEnd::Fold(side));
                        continue;
                    }
                    start = Start::Simple(rate * clock * step.length());
                }
            }
            let sided = self.sided();
            let sign = -side.sign() * direction;
            let margin = |s| sign * lie_derivative(&sided, &without_clock(&step.at(s)), side);
            let enclosed = |z: &SVector<Enclosed, M>| {
                let x = SVector::<Enclosed, N>::from_fn(|j, _| z[j]);
                lie_derivative(&sided, &x, side).scale(sign)
            };
            // A set of states about the surface reaches to where such a field has no value: nothing
            // encloses it.
            let mut zero = match self.depth {
                Some(_) => first_zero(margin, start),
                None => first_zero_along(step, &margin, &enclosed, start),
            };
            // Where a margin is zero and positive again behind, the motion goes on sliding.
            for _ in 0..MOST_TOUCHES {
                let Some(Zero::Touch(theta)) = zero else { break };
                let from = theta + BEHIND_TOUCH * (1.0 - theta);
                if margin(from).is_nan() || margin(from) <= 0.0 {
                    break;
                }
                zero = first_zero_after(from, &margin);
            }
            if let Some(zero) = zero {
                propose(zero.theta(), SlidingEnd::Fold(side));
            }
        }
        let (before, after) = (step.x0[N], step.x1[N]);
        let mut stop_at = |moment: f64, end: SlidingEnd| {
            if after >= moment {
                let theta = if after == moment {
                    1.0
                } else {
                    brent(|s| step.at(s)[N] - moment, 0.0, 1.0, before - moment, after - moment)
                };
                propose(theta, end);
            }
        };
        stop_at(self.t_end - t_base, SlidingEnd::Time);
        if let Some(plan) = sliding.plan {
            stop_at(self.t - t_base + (plan.time - sliding.time), SlidingEnd::Planned);
            let mut arc = 0.0;
            for (k, length) in chords::<N, M>(step, 1.0).into_iter().enumerate() {
                if sliding.arc + arc + length >= plan.arc {
                    let part = (plan.arc - sliding.arc - arc) / length;
                    propose((k as f64 + part) / CHORDS as f64, SlidingEnd::Planned);
                    break;
                }
                arc += length;
            }
        }
        first
    }

    /// The last leg into a two-fold. `None`, as the loop's result, says that no other end was met.
    fn arrive(
        &mut self,
        point: SVector<f64, N>,
        leg: f64,
        error: f64,
        mode: Mode,
    ) -> Option<SlidingEnd> {
        let straight = Straight { system: self.system, from: self.x, to: point };
        let t1 = self.t + leg;
        if t1 > self.t_end {
            let end = (self.t_end - self.t) / leg;
            let x1 = straight.at(end);
            self.take(mode, self.t_end, x1, &Truncated { inner: &straight, end });
            return Some(SlidingEnd::Time);
        }
        self.take(mode, t1, point, &straight);
        if self.stop.is_none() {
            self.event(EventKind::TwoFoldReached { leg, error }, Some(mode), None);
        }
        None
    }

    /// Sliding has come to a fold of the field of `side`.
    fn leave_at_fold(&mut self, side: Side, sliding: &Sliding) -> Result<State<N>, FilippovError> {
        let l = self.lie(&self.x);
        let from = Some(sliding.mode());
        if l.p.abs() <= l.zero_p && l.q.abs() <= l.zero_q {
            return self.degenerate(from, DEGENERATE_END);
        }
        if sliding.repelling {
            // The edge of the repelling region is an invisible fold: only the other side is left to
            // go to.
            let to = side.other();
            let (time, arc, rule) = (sliding.time, sliding.arc, self.chooser.rule);
            let first = match to {
                Side::Plus => l.p,
                Side::Minus => -l.q,
            };
            if first <= 0.0 {
                return Err(self
                    .non_transversal("repelling sliding ends where both Lie derivatives vanish"));
            }
            self.event(EventKind::ExitAtBoundary { to, time, arc, rule }, from, Some(to.into()));
            return Ok(State::Free { side: to, start: FlightStart::Transversal(first) });
        }
        let tangency = self.tangency(&l, side);
        if tangency.presses() {
            return Ok(State::Sliding(*sliding));
        }
        let Some(start) = tangency.left() else {
            return self.rest_or(
                from,
                "sliding ends at a fold that is not visible (a cusp or a two-fold)",
            );
        };
        self.event(EventKind::LeftByTangency { to: side }, from, Some(side.into()));
        Ok(State::Free { side, start })
    }

    /// The same at a corner of h, to which the motion has come with this velocity: the margin of
    /// `side` jumps there. `None` if there is no corner.
    fn leave_at_corner(
        &mut self,
        side: Side,
        sliding: &Sliding,
        velocity: SVector<f64, N>,
    ) -> Result<Option<State<N>>, FilippovError> {
        let (system, sided, from) = (self.system, self.sided(), self.x);
        let i = usize::from(side == Side::Minus);
        let [near, far] = LIMITS.corner.map(|share| share * self.reach());
        let margin = |distance: f64| {
            let x = project(system, &(from + velocity * (distance / velocity.norm())));
            sliding.margins(&sided, &x)[i]
        };
        let falls = |distance: f64| margin(-distance) - margin(distance);
        if !(margin(near) < 0.0 && falls(far) > 0.0 && falls(near) > 0.5 * falls(far)) {
            return Ok(None);
        }
        // The time after which a flight is seen to leave the surface, if it does.
        let leaves = |side: Side, field: SVector<f64, N>| {
            let time = far / field.norm();
            (side.sign() * system.switching(&(from + field * time)) > 0.0).then_some(time)
        };
        let flights = [
            leaves(Side::Plus, sided.plus(&from)).map(|time| (Side::Plus, time)),
            leaves(Side::Minus, sided.minus(&from)).map(|time| (Side::Minus, time)),
        ];
        let mode = Some(sliding.mode());
        let (to, after) = match (flights, sliding.plan) {
            ([Some(flight), None] | [None, Some(flight)], _) => flight,
            ([Some(plus), Some(minus)], Some(plan)) => {
                [plus, minus][usize::from(plan.side == Side::Minus)]
            }
            ([Some(_), Some(_)], None) => return self.enter_repelling(mode).map(Some),
            ([None, None], _) => {
                let what = "sliding ends at a corner of the surface, from which no motion leads";
                return self.rest_or(mode, what).map(Some);
            }
        };
        let kind = match sliding.repelling {
            true => {
                let (time, arc, rule) = (sliding.time, sliding.arc, self.chooser.rule);
                EventKind::ExitAtBoundary { to, time, arc, rule }
            }
            false => EventKind::LeftByTangency { to },
        };
        self.event(kind, mode, Some(to.into()));
        Ok(Some(State::Free { side: to, start: FlightStart::Flat(after) }))
    }

    /// Two folds in one place at the present state, if both Lie derivatives are almost zero there.
    fn fused_here(&self, l: &Lie) -> Option<FusedFolds<N>> {
        let near = LIMITS.near_two_fold * l.zero_p.max(l.zero_q);
        if !(l.p.abs() <= near && l.q.abs() <= near) {
            return None;
        }
        // Both fields cross in one direction: no fold, however small a focus has become.
        if l.p * l.q > 0.0 && l.p.abs() > l.zero_p && l.q.abs() > l.zero_q {
            return None;
        }
        let system = self.sided();
        let folds = FusedFolds::at(&system, &self.x).filter(FusedFolds::leave)?;
        let Some(velocity) = folds.velocity else { return Some(folds) };
        // At a kink the motion before and the motion behind are not those of one fold.
        let moved = velocity * self.departure(l, &folds);
        let [before, behind] =
            [self.x - moved, self.x + moved].map(|x| FusedFolds::at(&system, &x));
        let smooth = (before?.rate - behind?.rate).abs() <= LIMITS.kink * folds.rate.abs();
        smooth.then_some(folds)
    }

    /// The time of the first step of sliding out of two folds in one place.
    fn departure(&self, l: &Lie, folds: &FusedFolds<N>) -> f64 {
        LIMITS.departure * l.zero_p.max(l.zero_q) / LIMITS.lie / folds.rate.abs()
    }

    fn meet(&mut self, folds: FusedFolds<N>, from: Option<Mode>) -> State<N> {
        self.event(EventKind::TwoFoldReached { leg: 0.0, error: 0.0 }, from, None);
        State::Fused(Box::new(folds))
    }

    /// Rest on the surface until the end.
    fn rest(&mut self) -> State<N> {
        self.take(Mode::SlidingAttracting, self.t_end, self.x, &ConstantState(self.x));
        State::Rest
    }

    /// The future at two folds in one place.
    fn pass(&mut self, folds: &FusedFolds<N>) -> Result<State<N>, FilippovError> {
        self.accumulation = Accumulation::default();
        let growth = |side: Side| match side {
            Side::Plus => folds.second[0],
            Side::Minus => -folds.second[1],
        };
        let visible = |side: &Side| growth(*side) > 0.0;
        let flights: Vec<Side> = [Side::Plus, Side::Minus].into_iter().filter(visible).collect();
        let repelling = folds.rate > 0.0;
        let leave = |engine: &mut Self, to: Side, kind: EventKind| {
            engine.event(kind, None, Some(to.into()));
            Ok(State::Free { side: to, start: FlightStart::Tangent(growth(to)) })
        };
        let plan = match (folds.velocity, flights.as_slice()) {
            (Some(_), []) if !repelling => None,
            (None, [only]) => return leave(self, *only, EventKind::LeftByTangency { to: *only }),
            _ if self.chooser.rule == ExitRule::Undecided => {
                let slides = folds
                    .velocity
                    .map(|_| if repelling { REPELLING } else { "attracting sliding" });
                let ways =
                    slides.map(str::to_owned).into_iter().chain(flights.into_iter().map(flight));
                let what = if [Side::Plus, Side::Minus].iter().all(visible) {
                    "the folds of both fields, both visible, lie in one place (fused folds, a \
                        two-fold with two visible sides), and the motion is there"
                } else {
                    "the folds of both fields lie in one place (fused folds), and the motion is \
                        there"
                };
                return Err(self.undecided(what, ways));
            }
            _ => match self.chooser.plan() {
                None => return Ok(State::SetValued(None)),
                plan => plan,
            },
        };
        if let Some(ExitPlan { side, at_once, .. }) = plan
            && visible(&side)
            && (at_once || folds.velocity.is_none())
        {
            return leave(
                self,
                side,
                EventKind::Exit { to: side, time: 0.0, arc: 0.0, rule: self.chooser.rule },
            );
        }
        let Some(velocity) = folds.velocity else {
            return Err(self.no_exit(
                "both folds lie in one place, no sliding leaves it, and the fold of the side asked \
                    for is invisible; ask --exit for the other side",
            ));
        };
        let mode = if repelling { Mode::SlidingRepelling } else { Mode::SlidingAttracting };
        self.event(
            if repelling { EventKind::EnteredRepelling } else { EventKind::StartedOnSurface },
            None,
            Some(mode),
        );
        let l = self.lie(&self.x);
        let t1 = (self.t + self.departure(&l, folds)).min(self.t_end);
        let (time, from) = (t1 - self.t, self.x);
        let to = project(self.system, &(from + velocity * time));
        self.take(mode, t1, to, &Straight { system: self.system, from, to });
        let arc = (to - from).norm();
        Ok(match plan {
            Some(plan) if repelling && (time >= plan.time || arc >= plan.arc) => {
                self.exit(plan.side, time, arc, Some(mode))
            }
            Some(_) if repelling => State::Sliding(Sliding { repelling, plan, time, arc }),
            _ => State::Sliding(Sliding::ATTRACTING),
        })
    }

    /// The future at a two-fold.
    fn depart(&mut self, local: &SlidingAtTwoFold<N>) -> Result<State<N>, FilippovError> {
        self.accumulation = Accumulation::default();
        let [pp, _, _, mm] = local.second;
        let growth = |side: Side| match side {
            Side::Plus => pp,
            Side::Minus => -mm,
        };
        if self.chooser.rule == ExitRule::Undecided {
            let sides = [Side::Plus, Side::Minus]
                .into_iter()
                .filter(|side| growth(*side) > 0.0)
                .map(flight);
            let slides = match (&local.through, &local.back) {
                (Some(_), _) => Some(REPELLING.to_owned()),
                (None, Some(_)) => Some("attracting sliding".to_owned()),
                (None, None) => None,
            };
            return Err(self.undecided(
                "the motion is at a two-fold, where both fields are tangent to the surface",
                slides.into_iter().chain(sides),
            ));
        }
        let Some(plan) = self.chooser.plan() else {
            return Ok(State::SetValued(None));
        };
        let (side, rule) = (plan.side, self.chooser.rule);
        let curve = local.through.as_ref().or(local.back.as_ref());
        let tangent = growth(side) > 0.0;
        if tangent && (plan.at_once || curve.is_none()) {
            self.event(
                EventKind::Exit { to: side, time: 0.0, arc: 0.0, rule },
                None,
                Some(side.into()),
            );
            return Ok(State::Free { side, start: FlightStart::Tangent(growth(side)) });
        }
        let Some(curve) = curve else {
            return Err(self.no_exit(
                "no sliding motion leaves this two-fold and the fold of the side asked for is \
                    invisible; ask for the other side",
            ));
        };
        let Some(limit) = local.departure_limit(self.system, curve) else {
            return Err(self.non_transversal("the sliding direction at the two-fold is degenerate"));
        };
        let repelling = curve.rate < 0.0;
        let mode = if repelling { Mode::SlidingRepelling } else { Mode::SlidingAttracting };
        self.event(
            if repelling { EventKind::EnteredRepelling } else { EventKind::StartedOnSurface },
            None,
            Some(mode),
        );
        let sign = curve.rate.signum();
        let longest = curve.time(sign * limit);
        let shortest = curve.time(sign * self.settings.departure * limit.min(local.radius));
        // Arc along the curve up to a time, by chords.
        let arc_until = |t: f64| {
            let (end, mut last, mut arc) = (curve.sigma(t, limit), local.point, 0.0);
            for k in 1..=LIMITS.departure_chords {
                let point = curve.at(end * k as f64 / LIMITS.departure_chords as f64);
                arc += (point - last).norm();
                last = point;
            }
            arc
        };
        let mut planned = plan.time;
        if plan.arc.is_finite() {
            let excess = |t: f64| arc_until(t) - plan.arc;
            let last = excess(longest);
            planned = if last < 0.0 {
                f64::INFINITY
            } else {
                brent(excess, 0.0, longest, -plan.arc.max(1e-300), last)
            };
        }
        let planned = match (repelling, planned > 0.0) {
            (false, _) => f64::INFINITY,
            (true, false) => shortest,
            (true, true) => planned.max(LIMITS.shortest_departure * shortest),
        };
        let duration = planned.min(longest);
        let whole = AlongCurve { curve, from: 0.0, to: duration, limit };
        if self.t + duration > self.t_end {
            let end = (self.t_end - self.t) / duration;
            let x1 = project(self.system, &whole.at(end));
            self.take(mode, self.t_end, x1, &Truncated { inner: &whole, end });
            return Ok(State::Sliding(Sliding {
                repelling,
                plan: repelling.then_some(plan),
                time: 0.0,
                arc: 0.0,
            }));
        }
        let x1 = project(self.system, &whole.at(1.0));
        self.take(mode, self.t + duration, x1, &whole);
        let arc = arc_until(duration);
        if repelling && planned <= longest {
            return Ok(self.exit(side, duration, arc, Some(mode)));
        }
        Ok(State::Sliding(if repelling {
            Sliding { repelling, plan: Some(plan), time: duration, arc }
        } else {
            Sliding::ATTRACTING
        }))
    }
}
