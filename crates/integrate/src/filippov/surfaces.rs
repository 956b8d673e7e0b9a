//! Filippov motion with two switching surfaces.
//!
//! Near a point of one surface that is off the other, a system with two is a system with one: the
//! other's sign does not change there. So a run is a sequence of runs of the one-surface engine,
//! each with the sign of the other surface fixed (a *face* of the system), and ends its turn where
//! the other surface is reached, which becomes the one that is followed. Crossing, sliding, folds,
//! two-folds and the exit rule are those of [`engine`](super::engine) on each surface.
//!
//! At points where both surfaces meet, [`intersection`](super::intersection) lists the possible
//! continuations. A single one is followed, also along the intersection itself; otherwise the run
//! ends with [`FilippovError::Undecided`].

use nalgebra::SVector;

use super::engine::{Departure, FlightStart, Origin, near_surface, run_from, up_to};
use super::exit::Chooser;
use super::flow::{Height, SlidingFlow, Truncated, project};
use super::intersection::{
    AlongIntersection, Continuation, Mixture, OnIntersection, UNDECIDING, continuations, deciding,
    resolution, side, turns,
};
use super::{Choice, WITHOUT_CHOICE, intersection};
use super::{
    EventKind, ExitRule, FilippovError, FilippovObserver, FilippovOptions, FilippovSummary, Mode,
    ModeEvent, Side,
};
use crate::dopri5::Dopri5;
use crate::driver::Monitor;
use crate::guard::Guarded;
use crate::roots::{OfState, Start, first_zero, first_zero_along};
use crate::step::{Failure, Flow, Statistics, Step, Stepper, StopReason, finite};
use twofold_num::Dual;
use twofold_system::filippov::{gradient, sliding_field};
use twofold_system::{PiecewiseSmooth, VectorField, variables};

/// The faces of a system with two surfaces: `faces[i][0]` switches at surface i where the other
/// function is positive, `faces[i][1]` where it is negative.
pub type Faces<P> = [[P; 2]; 2];

/// Distance from a surface, relative to the state's size, below which tables call a state on the
/// surface.
pub const INTERSECTION: f64 = 1e-9;

/// Share of [`resolution`] within which a spiral has come to the intersection: nearer, a turn takes
/// no time that matters.
const END_OF_SPIRAL: f64 = 1e-4;
/// Share of [`resolution`] within which sliding that reaches the other surface is at the
/// intersection.
const SLID: f64 = 100.0;

/// The next part of a run.
enum Part<const N: usize> {
    /// A run of the one-surface engine on surface `active`, on the side `beyond` of the other.
    Face {
        active: usize,
        beyond: Side,
        departure: Departure<N>,
        left: Option<FlightStart>,
        first: First,
    },
    /// Motion along the intersection.
    Intersection(Box<Mixture<N>>),
}

/// The kind of a part's first event.
#[derive(Clone, Copy, Debug)]
enum First {
    /// As the engine says.
    AsIs,
    /// An arrival from this side of the surface that is now followed.
    Arrived(Side),
    /// This, after this mode.
    Called(EventKind, Mode),
}

/// Runs the Filippov motion of a system with two switching surfaces from (0, x0) to `t_end`. `M` is
/// `N + 1` and is inferred. The modes that the observer is told are those of the surface that was
/// met last (at the start: the first one, unless the run starts on the second).
///
/// ```
/// use nalgebra::{Vector2, Vector4};
/// use twofold_integrate::filippov::{ExitRule, FilippovOptions, Trajectory, run_two_surfaces};
/// use twofold_system::System;
/// let blocks = System::builtin("two-blocks").expect("built in");
/// let [[a, b], [c, d]] = blocks.faces().expect("two surfaces");
/// let faces = [[a.bind::<4>()?, b.bind::<4>()?], [c.bind::<4>()?, d.bind::<4>()?]];
/// let mut path = Trajectory::new(1);
/// let options = FilippovOptions::default();
/// let start = Vector4::new(0.0, 0.0, 0.0, 0.0);
/// let end = run_two_surfaces(&faces, start, 5.0, &options, ExitRule::Undecided, &mut path, &())?;
/// assert_eq!(end.t, 5.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// [`FilippovError::Undecided`] where both surfaces meet and several motions are possible; else see
/// [`FilippovError`]. Each names the time and the state.
pub fn run_two_surfaces<P, const N: usize, const M: usize>(
    faces: &Faces<P>,
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
    if rule == ExitRule::All {
        return Err(FilippovError::Invalid(
            "all futures are followed at one switching surface only, not at two".into(),
        ));
    }
    if !finite(&x0) {
        return Err(Failure::NotFinite { t: 0.0, state: Failure::state(&x0) }.into());
    }
    let mut chooser = Chooser::new(rule);
    let mut run = SurfacesRun {
        faces,
        settings,
        t_end,
        observer,
        monitor,
        t: 0.0,
        x: x0,
        events: 0,
        statistics: Statistics::default(),
    };
    run.statistics.highest_order = 5;
    let near = [0, 1].map(|surface: usize| near_surface(&faces[surface][0], &x0));
    let start = if near == [true; 2] { run.corner(&x0, 1.0) } else { None };
    let mut part = match start {
        Some(corner) => {
            run.x = corner;
            run.decide(None)?
        }
        None => {
            let active = usize::from(near[1]);
            let beyond = run.side_of(1 - active);
            Part::Face {
                active,
                beyond,
                departure: Departure::Anywhere,
                left: None,
                first: First::AsIs,
            }
        }
    };
    loop {
        let (active, beyond, departure, left, first) = match part {
            Part::Face { active, beyond, departure, left, first } => {
                (active, beyond, departure, left, first)
            }
            Part::Intersection(mixture) => match run.along(*mixture)? {
                Ok(next) => {
                    part = next;
                    continue;
                }
                Err(stop) => return Ok(run.summary(Some(Mode::SlidingAttracting), stop)),
            },
        };
        let other = 1 - active;
        let face = &faces[active][usize::from(beyond == Side::Minus)];
        let (t, events) = (run.t, run.events);
        let mut guard = Guard {
            observer: &mut *run.observer,
            guarded: &faces[other][0],
            sign: beyond.sign(),
            first,
            left,
            hit: None,
            t_end,
        };
        let remaining = FilippovOptions {
            max_events: settings.max_events.saturating_sub(events),
            max_steps: settings.max_steps.saturating_sub(run.statistics.steps),
            ..*settings
        };
        let from_corner = left.is_some();
        let origin = Origin { t, x: run.x, departure };
        let summary = run_from(face, origin, t_end, &remaining, &mut chooser, &mut guard, monitor)?;
        let hit = guard.hit;
        run.events += summary.events;
        run.statistics += &summary.statistics;
        let Some(Hit { t: when, x: place, mode, from, wanted }) = hit else {
            return Ok(FilippovSummary {
                events: run.events,
                statistics: run.statistics,
                ..summary
            });
        };
        (run.t, run.x) = (when, place);
        if !wanted {
            return Ok(run.summary(Some(mode), StopReason::Observer));
        }
        if matches!(summary.stop, StopReason::Cancelled | StopReason::StepBudget) {
            return Ok(run.summary(Some(mode), summary.stop));
        }
        if when >= t_end {
            return Ok(run.summary(Some(mode), StopReason::EndTime));
        }
        if run.events > settings.max_events {
            return Err(FilippovError::TooManyEvents {
                t: when,
                state: Failure::state(&place),
                limit: settings.max_events,
            });
        }
        if from_corner && when <= t {
            return Err(run.undecided(
                &[],
                "the motion does not get away from where both switching surfaces meet",
            ));
        }
        // A sliding motion is on both surfaces; a flight that only comes near one may pass by.
        let mut corner = run.corner(&place, if mode.slides() { SLID } else { 1.0 });
        if let Some(at) = corner
            && !mode.slides()
            && !run.within(END_OF_SPIRAL, &place, &at)
            && turns(faces, &at)
        {
            // A spiral comes nearer by itself.
            corner = None;
        }
        part = match corner {
            Some(at) => {
                run.x = at;
                run.decide(Some(Arrival { mode, surface: other, from }))?
            }
            None => Part::Face {
                active: other,
                beyond: run.side_of(active),
                departure: Departure::OnSurface,
                left: None,
                first: First::Arrived(from),
            },
        };
    }
}

/// The way in which a run came to the intersection.
#[derive(Clone, Copy, Debug)]
struct Arrival {
    mode: Mode,
    /// The surface that was reached, and the side that it came from.
    surface: usize,
    from: Side,
}

/// A run on its way.
struct SurfacesRun<'a, P, const N: usize> {
    faces: &'a Faces<P>,
    settings: &'a FilippovOptions,
    t_end: f64,
    observer: &'a mut dyn FilippovObserver<N>,
    monitor: &'a dyn Monitor,
    t: f64,
    x: SVector<f64, N>,
    events: u64,
    statistics: Statistics,
}

impl<P: PiecewiseSmooth<N>, const N: usize> SurfacesRun<'_, P, N> {
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

    fn side_of(&self, surface: usize) -> Side {
        if self.faces[surface][0].switching(&self.x) < 0.0 { Side::Minus } else { Side::Plus }
    }

    /// Whether `x` and `y` differ by no more than this share of [`resolution`], each coordinate in
    /// its own units.
    fn within(&self, share: f64, x: &SVector<f64, N>, y: &SVector<f64, N>) -> bool {
        let reach = resolution(self.settings, x);
        (0..N).all(|i| (y[i] - x[i]).abs() <= share * reach[i])
    }

    /// The point of the intersection at `x`, if one is within `share` of [`resolution`].
    fn corner(&self, x: &SVector<f64, N>, share: f64) -> Option<SVector<f64, N>> {
        intersection::project(self.faces, x).filter(|corner| self.within(share, x, corner))
    }

    fn undecided(&self, found: &[Continuation<N>], what: &'static str) -> FilippovError {
        let continuations = found.iter().map(ToString::to_string).collect();
        let choice = Box::new(Choice { what, continuations, remedy: WITHOUT_CHOICE });
        FilippovError::Undecided { t: self.t, state: Failure::state(&self.x), choice }
    }

    fn event(&mut self, kind: EventKind, from: Option<Mode>, to: Mode) -> Flow {
        self.events += 1;
        self.observer.event(&ModeEvent { t: self.t, state: self.x, kind, from, to: Some(to) })
    }

    /// The continuation at the intersection; `None` if the run starts there.
    fn decide(&mut self, arrival: Option<Arrival>) -> Result<Part<N>, FilippovError> {
        let mut found = continuations(self.faces, &self.x);
        match found.as_slice() {
            [Continuation::Stay(_)] => {
                let Some(Continuation::Stay(mixture)) = found.pop() else { unreachable!() };
                let (kind, from) = match arrival {
                    None => (EventKind::StartedOnSurface, None),
                    Some(Arrival { mode, from, .. }) => (EventKind::Landing { from }, Some(mode)),
                };
                // The next step is refused by an observer that wants no more.
                let _ = self.event(kind, from, Mode::SlidingAttracting);
                Ok(Part::Intersection(mixture))
            }
            [only @ (Continuation::Flight(_) | Continuation::Sliding { repelling: false, .. })] => {
                Ok(self.leave(only, arrival, false))
            }
            [] => Err(self.undecided(
                &[],
                "both switching surfaces meet, and their Lie derivatives do not say what follows",
            )),
            _ => Err(self.undecided(
                &found,
                "both switching surfaces meet, and the motion there is not unique",
            )),
        }
    }

    /// The part that begins at the intersection by `next`.
    fn leave(&self, next: &Continuation<N>, arrival: Option<Arrival>, stayed: bool) -> Part<N> {
        let (active, beyond, mode) = match *next {
            Continuation::Flight(m) => (0, side(m, 1), side(m, 0).into()),
            Continuation::Sliding { surface, beyond, .. } => {
                (surface, beyond, Mode::SlidingAttracting)
            }
            _ => unreachable!("the others do not leave"),
        };
        let face = &self.faces[active][usize::from(beyond == Side::Minus)];
        let at = variables(&self.x);
        let velocity = match mode {
            Mode::Plus => face.plus(&at),
            Mode::Minus => face.minus(&at),
            _ => sliding_field(face, &at),
        };
        let slope = gradient(&self.faces[1 - active][0], &at);
        let rate = (0..N).fold(Dual::constant(0.0), |sum, i| sum + slope[i] * velocity[i]);
        let along: f64 = (0..N).map(|i| rate.partials[i] * velocity[i].value).sum();
        let size: f64 = (0..N).map(|i| slope[i].value.abs() * velocity[i].value.abs()).sum();
        let left = if rate.value.abs() > UNDECIDING * size {
            FlightStart::Transversal(beyond.sign() * rate.value)
        } else {
            FlightStart::Tangent(beyond.sign() * along)
        };
        let first = match arrival {
            None if stayed => {
                First::Called(EventKind::LeftByTangency { to: beyond }, Mode::SlidingAttracting)
            }
            None => First::AsIs,
            Some(Arrival { mode: before, from, .. }) if mode.slides() && !before.slides() => {
                First::Called(EventKind::Landing { from }, before)
            }
            Some(Arrival { mode: before, surface, from }) => {
                // The side of the surface reached on which it goes on.
                let to = match (surface == active, mode) {
                    (false, _) => beyond,
                    (true, Mode::Plus) => Side::Plus,
                    (true, Mode::Minus) => Side::Minus,
                    (true, _) => from.other(),
                };
                First::Called(EventKind::Crossing { to }, before)
            }
        };
        Part::Face { active, beyond, departure: Departure::Decided(mode), left: Some(left), first }
    }

    /// Motion along the intersection until something else follows, or the reason to stop.
    fn along(
        &mut self,
        mut mixture: Mixture<N>,
    ) -> Result<Result<Part<N>, StopReason>, FilippovError> {
        let faces = self.faces;
        let mode = Mode::SlidingAttracting;
        'stretch: loop {
            let flow = AlongIntersection { faces, mixture: &mixture };
            let tolerance = self.settings.tolerance;
            let mut method = Guarded::<_, N>::new(Dopri5::new(tolerance), tolerance);
            method.restart(&flow, self.t, self.x, self.t_end, self.settings.max_step)?;
            loop {
                let before = method.statistics().clone();
                let step = method.step(&flow)?;
                let (t0, signs) = (step.t0, deciding(faces, &self.x));
                let mut end: Option<f64> = None;
                for (k, sign) in signs.into_iter().enumerate().filter(|(_, v)| v.abs() > UNDECIDING)
                {
                    let margin = |theta: f64| sign.signum() * deciding(faces, &step.at(theta))[k];
                    if let Some(zero) = first_zero(margin, Start::Away) {
                        end = Some(end.unwrap_or(1.0).min(zero.theta()));
                    }
                }
                let theta = end.unwrap_or(1.0);
                let place = step.at(theta);
                let Some(x1) = intersection::project(faces, &place) else {
                    return Err(self.undecided(
                        &[],
                        "the motion along the intersection of the switching surfaces loses it",
                    ));
                };
                let t1 = up_to(self.t_end, if theta == 1.0 { step.t1 } else { step.time(theta) });
                let interpolant = OnIntersection { faces, inner: step.interpolant, end: theta };
                let seen = Step { t0, t1, x0: self.x, x1, interpolant: &interpolant };
                let flow_on =
                    if t1 > t0 { self.observer.step(mode, &seen) } else { Flow::Continue };
                (self.t, self.x) = (t1, x1);
                let work = method.statistics();
                self.statistics.steps += work.steps - before.steps;
                self.statistics.evaluations += work.evaluations - before.evaluations;
                self.statistics.rejected += work.rejected - before.rejected;
                if flow_on == Flow::Stop {
                    return Ok(Err(StopReason::Observer));
                }
                if self.t >= self.t_end {
                    return Ok(Err(StopReason::EndTime));
                }
                if self.monitor.reached(self.t).is_break() {
                    return Ok(Err(StopReason::Cancelled));
                }
                if self.statistics.steps > self.settings.max_steps {
                    return Ok(Err(StopReason::StepBudget));
                }
                let found = continuations(faces, &self.x);
                match found.as_slice() {
                    [Continuation::Stay(next)] => {
                        if end.is_some() || !self.within(1.0, &x1, &place) {
                            mixture = (**next).clone();
                            continue 'stretch;
                        }
                    }
                    [
                        only @ (Continuation::Flight(_)
                        | Continuation::Sliding { repelling: false, .. }),
                    ] => {
                        return Ok(Ok(self.leave(only, None, true)));
                    }
                    _ => {
                        let what = "the motion along the intersection of the switching surfaces \
                            comes to where it is not unique";
                        return Err(self.undecided(&found, what));
                    }
                }
            }
        }
    }
}

/// Arrival of a run on one surface at the other.
struct Hit<const N: usize> {
    t: f64,
    x: SVector<f64, N>,
    /// The mode on the surface followed so far.
    mode: Mode,
    /// The side of the surface reached that it came from.
    from: Side,
    /// Whether the observer wants more.
    wanted: bool,
}

/// Looks out for the other surface, and hands everything on.
struct Guard<'a, P, const N: usize> {
    observer: &'a mut dyn FilippovObserver<N>,
    guarded: &'a P,
    /// The sign of its function.
    sign: f64,
    first: First,
    /// Set until the first step of a run that begins at the intersection: how it leaves the other
    /// surface.
    left: Option<FlightStart>,
    hit: Option<Hit<N>>,
    t_end: f64,
}

impl<P: PiecewiseSmooth<N>, const N: usize> FilippovObserver<N> for Guard<'_, P, N> {
    fn step(&mut self, mode: Mode, step: &Step<'_, N>) -> Flow {
        if self.hit.is_some() {
            return Flow::Stop;
        }
        let height = Height { system: self.guarded, sign: self.sign };
        let first = |start| first_zero_along(step, &height, start).map(|zero| zero.theta());
        let zero = match self.left.take() {
            Some(start) => first(start.over(step.length())),
            // Rounding may have carried the step before over the surface.
            None if height.at(&step.at(0.0)) <= 0.0 => Some(0.0),
            None => first(Start::Away),
        };
        let Some(end) = zero else { return self.observer.step(mode, step) };
        let (t, x) = (up_to(self.t_end, step.time(end)), project(self.guarded, &step.at(end)));
        let cut = Step {
            t1: t,
            x1: x,
            interpolant: &Truncated { inner: step.interpolant, end },
            ..*step
        };
        let wanted = t <= step.t0 || self.observer.step(mode, &cut) == Flow::Continue;
        let from = if self.sign > 0.0 { Side::Plus } else { Side::Minus };
        self.hit = Some(Hit { t, x, mode, from, wanted });
        Flow::Stop
    }

    fn event(&mut self, event: &ModeEvent<N>) -> Flow {
        // Events after the step in which the other surface was reached did not happen.
        if self.hit.is_some() {
            return Flow::Stop;
        }
        let from = match std::mem::replace(&mut self.first, First::AsIs) {
            First::AsIs => return self.observer.event(event),
            First::Called(kind, from) => {
                return self.observer.event(&ModeEvent { kind, from: Some(from), ..*event });
            }
            First::Arrived(from) => from,
        };
        let kind = match (event.kind, event.to) {
            (EventKind::StartedOnSurface, Some(mode)) if mode.slides() => {
                EventKind::Landing { from }
            }
            (EventKind::StartedOnSurface, Some(mode)) if mode == from.into() => {
                EventKind::Grazing { side: from }
            }
            (EventKind::StartedOnSurface, Some(_)) => EventKind::Crossing { to: from.other() },
            (kind, _) => kind,
        };
        self.observer.event(&ModeEvent { kind, from: Some(from.into()), ..*event })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Trajectory;
    use super::*;
    use nalgebra::Vector2;

    /// Constant fields, one for each quadrant of the plane: x' = (a, b) by the signs of x and y.
    #[derive(Clone, Copy)]
    struct Quadrants {
        /// For ++, -+, +-, --.
        fields: [[f64; 2]; 4],
        surface: usize,
        below: bool,
    }

    impl Quadrants {
        fn faces(fields: [[f64; 2]; 4]) -> Faces<Self> {
            [0, 1].map(|surface| [false, true].map(|below| Self { fields, surface, below }))
        }
        fn field(&self, positive: bool) -> [f64; 2] {
            let (x, y) =
                if self.surface == 0 { (positive, !self.below) } else { (!self.below, positive) };
            self.fields[usize::from(!x) + 2 * usize::from(!y)]
        }
    }

    impl PiecewiseSmooth<2> for Quadrants {
        fn switching<S: twofold_num::Elementary>(&self, x: &SVector<S, 2>) -> S {
            x[self.surface]
        }
        fn plus<S: twofold_num::Elementary>(&self, _: &SVector<S, 2>) -> SVector<S, 2> {
            SVector::from(self.field(true).map(S::from_f64))
        }
        fn minus<S: twofold_num::Elementary>(&self, _: &SVector<S, 2>) -> SVector<S, 2> {
            SVector::from(self.field(false).map(S::from_f64))
        }
    }

    fn run(
        fields: [[f64; 2]; 4],
        x0: [f64; 2],
        t_end: f64,
    ) -> (Result<FilippovSummary<2>, FilippovError>, Trajectory<2>) {
        let mut seen = Trajectory::new(1);
        let rule = ExitRule::AtOnce { side: Side::Plus };
        let faces = Quadrants::faces(fields);
        let end = run_two_surfaces(
            &faces,
            x0.into(),
            t_end,
            &FilippovOptions::default(),
            rule,
            &mut seen,
            &(),
        );
        (end, seen)
    }

    /// x' = -sign(y), y' = sign(x): around squares |x| + |y| = c, a side in the time c.
    const SQUARE: [[f64; 2]; 4] = [[-1.0, 1.0], [-1.0, -1.0], [1.0, 1.0], [1.0, -1.0]];

    #[test]
    fn both_surfaces_are_crossed_at_their_times() {
        let (end, seen) = run(SQUARE, [0.5, 0.25], 100.0);
        let end = end.unwrap();
        // c = 0.75, period 3: 100 = 33 periods and 1.
        let crossings: Vec<_> = seen.events.iter().map(|e| (e.t, e.kind)).collect();
        assert_eq!(crossings.len(), 133, "{:?}", &crossings[..5]);
        for (k, (t, kind)) in crossings.iter().enumerate() {
            assert!((t - (0.5 + 0.75 * k as f64)).abs() < 1e-11, "{k}: {t}");
            let to = if k % 4 < 2 { Side::Minus } else { Side::Plus };
            assert_eq!(*kind, EventKind::Crossing { to }, "{k}");
        }
        assert!((end.x - Vector2::new(-0.5, 0.25)).amax() < 1e-9, "{}", end.x);
        assert_eq!((end.t, end.stop, end.events), (100.0, StopReason::EndTime, 133));
    }

    /// x' = -sign(x), y' = -1 but for y' = 1 where x, y < 0: slides on x = 0 down to the origin.
    const DOWN: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [-1.0, -1.0], [1.0, 1.0]];

    #[test]
    fn sliding_into_the_other_surface_is_refused_where_they_meet() {
        let (end, seen) = run(DOWN, [1.0, 3.0], 10.0);
        let Err(FilippovError::Undecided { t, state, .. }) = end else { panic!("{end:?}") };
        assert!((t - 3.0).abs() < 1e-11 && state.iter().all(|v| v.abs() < 1e-11), "{t} {state:?}");
        assert!(seen.events.iter().any(
            |e| e.kind == EventKind::Landing { from: Side::Plus } && (e.t - 1.0).abs() < 1e-11
        ));
        // The same without ever coming there.
        let (end, _) = run(DOWN, [1.0, 3.0], 2.5);
        let end = end.unwrap();
        assert!(
            (end.x - Vector2::new(0.0, 0.5)).amax() < 1e-11
                && end.mode == Some(Mode::SlidingAttracting)
        );
        // Crossing y = 0 first, then landing on x = 0 below it, where the two fields are opposite:
        // there it rests.
        let (end, seen) = run(DOWN, [3.0, 1.0], 10.0);
        assert!((end.unwrap().x - Vector2::new(0.0, -2.0)).amax() < 1e-10);
        let kinds: Vec<_> = seen.events.iter().map(|e| e.kind).collect();
        assert_eq!(
            kinds,
            [EventKind::Crossing { to: Side::Minus }, EventKind::Landing { from: Side::Plus }]
        );
    }

    #[test]
    fn sliding_across_the_other_surface_goes_on_where_that_is_decided() {
        // x' = -sign(x) and y' from -1 (y > 0) to -2 (y < 0): all four fields cross y = 0
        // downwards.
        let (end, seen) =
            run([[-1.0, -1.0], [1.0, -1.0], [-1.0, -2.0], [1.0, -2.0]], [1.0, 3.0], 10.0);
        assert!((end.unwrap().x - Vector2::new(0.0, -14.0)).amax() < 1e-10);
        let events: Vec<_> = seen.events.iter().map(|e| (e.kind, e.to)).collect();
        let sliding = Some(Mode::SlidingAttracting);
        let crossed = EventKind::Crossing { to: Side::Minus };
        assert_eq!(
            events,
            [(EventKind::Landing { from: Side::Plus }, sliding), (crossed, sliding)]
        );
        assert!((seen.events[1].t - 3.0).abs() < 1e-11);
        // Below, x = 0 is crossed and not slid on: it leaves there, to x > 0.
        let (end, seen) =
            run([[-1.0, -1.0], [1.0, -1.0], [0.5, -2.0], [1.0, -2.0]], [1.0, 3.0], 4.0);
        assert!((end.unwrap().x - Vector2::new(0.5, -2.0)).amax() < 1e-10);
        assert_eq!(seen.events[1].to, Some(Mode::Plus));
        // Below, x = 0 repels: a set of futures.
        let (end, _) =
            run([[-1.0, -1.0], [1.0, -1.0], [1.0, -2.0], [-1.0, -2.0]], [1.0, 3.0], 10.0);
        let Err(FilippovError::Undecided { choice, .. }) = end else { panic!("{end:?}") };
        assert!(
            choice.continuations.iter().any(|way| way.contains("repelling sliding on h = 0")),
            "{choice:?}"
        );
    }

    #[test]
    fn flying_into_the_intersection_goes_on_where_all_fields_cross() {
        let (end, _) = run(SQUARE.map(|_| [-1.0, -1.0]), [2.0, 2.0], 5.0);
        assert!((end.unwrap().x - Vector2::new(-3.0, -3.0)).amax() < 1e-10);
    }

    #[test]
    fn turns_around_the_intersection_end_there_only_if_they_contract() {
        let (end, _) = run(SQUARE, [0.0, 0.0], 100.0);
        let Err(FilippovError::Undecided { t, choice, .. }) = end else { panic!("{end:?}") };
        assert!(t == 0.0 && choice.continuations.len() > 1, "{choice:?}");
        // Each side halves the distance: 1 + 1/2 + 1/4 + ... = 2 to the middle.
        let (end, seen) =
            run([[-2.0, 1.0], [-1.0, -2.0], [1.0, 2.0], [2.0, -1.0]], [1.0, 0.0], 100.0);
        let end = end.unwrap();
        assert!(end.x.amax() < 1e-11 && end.mode == Some(Mode::SlidingAttracting), "{}", end.x);
        let last = seen.events.last().unwrap();
        assert!((last.t - 1.0).abs() < 1e-6, "{}", last.t);
    }
}
