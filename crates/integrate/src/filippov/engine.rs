//! The state machine of Filippov motion: the mode is decided at each event.

mod flight;
mod folds;
mod slide;

use std::cell::OnceCell;
use std::sync::Arc;

use nalgebra::SVector;

use super::automatic::Automatic;
use super::exit::{Chooser, ExitPlan};
use super::flow::{
    FreeFlow, Height, InPhysicalTime, Sided, SlidingFlow, Straight, Truncated, desingularised,
    length, lie_derivative, project,
};
use super::two_fold::{AlongCurve, FusedFolds, LARGEST_RADIUS, Linearised, SlidingAtTwoFold};
use super::{
    CHOOSE, Choice, EventKind, ExitRule, FilippovError, FilippovObserver, FilippovOptions,
    FilippovSummary, Mode, ModeEvent, Side,
};
use crate::driver::Monitor;
use crate::guard::Gates;
use crate::roots::{OfState, Start, Zero, brent, first_zero, first_zero_after, first_zero_along};
use crate::step::{Failure, Flow, Interpolant, Statistics, Step, StopReason, Tolerance, finite};
use twofold_num::series::HIGH_POWER;
use twofold_num::{Dual, Elementary, Interval, Tape};
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
        is_simple: is_simple(system),
        fields: Default::default(),
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

/// Whether h and both fields are polynomials of so low degree that no field, nor the sliding flow,
/// has [gates](Gates) or an [end of its domain](Ends): a factor of a product of fields and of the
/// gradient of h is a power of at most the sum of their degrees.
pub(super) fn is_simple<P: PiecewiseSmooth<N>, const N: usize>(system: &P) -> bool {
    let of_sliding = |[h, field]: [u32; 2]| field.saturating_mul(2).saturating_add(h);
    system.degrees().is_some_and(|degrees| of_sliding(degrees) < HIGH_POWER)
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

impl Lie {
    /// Whether the field of `side` is tangent to the surface.
    fn is_tangent(&self, side: Side) -> bool {
        match side {
            Side::Plus => self.p.abs() <= self.zero_p,
            Side::Minus => self.q.abs() <= self.zero_q,
        }
    }
}

/// A [margin](Sliding::margins) along the sliding flow, whose states begin with those of the
/// motion.
struct Margin<'a, P, const N: usize> {
    system: Sided<'a, P>,
    side: Side,
    sign: f64,
}

impl<P: PiecewiseSmooth<N>, const N: usize, const M: usize> OfState<M> for Margin<'_, P, N> {
    fn at<S: Elementary>(&self, z: &SVector<S, M>) -> S {
        let x = SVector::<S, N>::from_fn(|i, _| z[i]);
        lie_derivative(&self.system, &x, self.side).scale(self.sign)
    }
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
    /// [`is_simple`].
    is_simple: bool,
    /// f+ and f-, with the ends of their domains, once they have been asked for.
    fields: [OnceCell<(Arc<Tape>, Option<Ends>)>; 2],
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
    fn sliding_clock(l: &Lie) -> f64 {
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
        self.fields[usize::from(side == Side::Minus)].get_or_init(|| {
            let flow = FreeFlow { system: Sided { system: self.system, depth: None }, side };
            let tape = Arc::new(Tape::clone(&flow.tape()).with_names(self.system.names()));
            (tape.clone(), Ends::new(tape))
        })
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
        if self.is_simple {
            return None;
        }
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
        self.lie(x).is_tangent(side)
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
        if self.is_simple {
            return None;
        }
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
}
