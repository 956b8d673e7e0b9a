//! Filippov motion with two switching surfaces, as far as they are met one at a time.
//!
//! Near a point of one surface that is off the other, a system with two is a system with one: the other's sign does not change there. So a run
//! is a sequence of runs of the one-surface engine, each with the sign of the other surface fixed (a *face* of the system), and ends its turn
//! where the other surface is reached, which becomes the one that is followed. Crossing, sliding, folds, two-folds and the exit
//! rule are those of [`engine`](super::engine) on each surface.
//!
//! Where both surfaces meet, one case is decided: a motion that slides attracted on one surface when it comes to the other, where all four
//! fields cross that other surface in the same direction. Every mixture of them does too, so the motion crosses it, and goes on as the far
//! side says. In any other case Filippov's convention leaves a whole family of sliding vectors (Filippov 1988, ch. 2; Dieci & Lopez 2011),
//! and nothing here chooses one: the run ends with [`FilippovError::Intersection`].

use nalgebra::SVector;

use super::engine::{Departure, Origin, near_surface, run_from, up_to};
use super::exit::Chooser;
use super::flow::{SlidingFlow, Truncated, project};
use super::{EventKind, ExitRule, FilippovError, FilippovObserver, FilippovSummary, Mode, ModeEvent, Settings, Side};
use crate::driver::Watch;
use crate::roots::{Enclosed, Start, first_zero_along};
use crate::step::{Failure, Flow, Statistics, Step, StopReason, Tolerance, finite};
use twofold_num::Arithmetic;
use twofold_system::filippov::{Region, gradient, lie_derivatives, region, sliding_field};
use twofold_system::{PiecewiseSmooth, VectorField};

/// The faces of a system with two surfaces: `faces[i][0]` switches at surface i where the other function is positive, `faces[i][1]` where it is
/// negative.
pub type Faces<P> = [[P; 2]; 2];

/// Nearer to a point of both surfaces than so many tolerances of the motion is at their intersection.
pub const INTERSECTION: f64 = 100.0;

/// Runs the Filippov motion of a system with two switching surfaces from (0, x0) to `t_end`. `M` is `N + 1` and is inferred. The modes that the
/// observer is told are those of the surface that was met last (at the start: the first one, unless the run starts on the second).
///
/// # Errors
/// [`FilippovError::Intersection`] where the run comes to both surfaces at once; else see [`FilippovError`]. Each names the time and the
/// state.
pub fn run_two_surfaces<P, const N: usize, const M: usize>(
    faces: &Faces<P>,
    x0: SVector<f64, N>,
    t_end: f64,
    settings: &Settings,
    rule: ExitRule,
    observer: &mut dyn FilippovObserver<N>,
    watch: &dyn Watch,
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
    let near = |x: &SVector<f64, N>| {
        let Tolerance { rtol, atol } = settings.tolerance;
        let reach = x.map(|v| INTERSECTION * (atol + rtol * v.abs()));
        intersection_within(faces, x, &reach)
    };
    let mut chooser = Chooser::new(rule);
    let (mut t, mut x) = (0.0, x0);
    let mut active = usize::from(near_surface(&faces[1][0], &x));
    let mut arrived = None;
    // Set where the other surface was crossed in sliding on this one: the state is on both.
    let mut passed: Option<Passage> = None;
    let (mut events, mut statistics) = (0, Statistics { highest_order: 5, ..Statistics::default() });
    loop {
        let other = 1 - active;
        if passed.is_none() && near(&x) {
            return Err(FilippovError::Intersection { t, state: Failure::state(&x) });
        }
        let below = passed.map_or(faces[other][0].switching(&x) < 0.0, |passage| passage.to == Side::Minus);
        let face = &faces[active][usize::from(below)];
        let sign = if below { -1.0 } else { 1.0 };
        let mut guard = Guard {
            observer: &mut *observer,
            guarded: &faces[other][0],
            sign,
            arrived,
            passed: passed.map(|passage| passage.to),
            left: passed.map(|passage| passage.rate),
            hit: None,
            t_end,
        };
        let left = Settings {
            max_events: settings.max_events.saturating_sub(events),
            max_steps: settings.max_steps.saturating_sub(statistics.steps),
            ..*settings
        };
        // What was found to be on the surface is on it.
        let found = arrived.is_some() || passed.is_some();
        let origin = Origin { t, x, departure: if found { Departure::OnSurface } else { Departure::Anywhere } };
        let summary = run_from(face, origin, t_end, &left, &mut chooser, &mut guard, watch)?;
        let hit = guard.hit;
        events += summary.events;
        statistics += &summary.statistics;
        let whole = |summary: FilippovSummary<N>, statistics| FilippovSummary { events, statistics, ..summary };
        let Some(Hit { t: when, x: place, mode, from, wanted }) = hit else {
            return Ok(whole(summary, statistics));
        };
        let both = mode.slides() || near(&place);
        let passage = if mode == Mode::SlidingAttracting { Passage::at(faces, active, from, &place) } else { None };
        if both && passage.is_none() {
            return Err(FilippovError::Intersection { t: when, state: Failure::state(&place) });
        }
        let ended = FilippovSummary { t: when, x: place, mode: Some(mode), ..summary };
        if !wanted {
            return Ok(whole(FilippovSummary { stop: StopReason::Observer, ..ended }, statistics));
        }
        if matches!(ended.stop, StopReason::Watch | StopReason::StepBudget) {
            return Ok(whole(ended, statistics));
        }
        if when >= t_end {
            return Ok(whole(FilippovSummary { stop: StopReason::EndTime, ..ended }, statistics));
        }
        if events > settings.max_events {
            return Err(FilippovError::TooManyEvents {
                t: when,
                state: Failure::state(&place),
                limit: settings.max_events,
            });
        }
        (t, x, passed) = (when, place, passage);
        match passage {
            Some(_) => arrived = None,
            None => (active, arrived) = (other, Some(from)),
        }
    }
}

/// Whether both functions are zero at a point near `x`, to first order: the nearest one in units of `reach` is within that.
fn intersection_within<P: PiecewiseSmooth<N>, const N: usize>(
    faces: &Faces<P>,
    x: &SVector<f64, N>,
    reach: &SVector<f64, N>,
) -> bool {
    let [h, k] = [0, 1].map(|i| faces[i][0].switching(x));
    // Gradients in those units, of length 1 each.
    let [(g, h), (l, k)] = [(0, h), (1, k)].map(|(i, value)| {
        let slope = gradient(&faces[i][0], x).component_mul(reach);
        let length = slope.norm();
        (slope / length, value / length)
    });
    if h == 0.0 && k == 0.0 {
        return true;
    }
    // |u|^2 of the shortest u with g.u = -h and l.u = -k.
    let cosine = g.dot(&l);
    let across = h - cosine * k;
    k * k + across * across / (1.0 - cosine * cosine) <= 1.0
}

/// The other surface crossed in sliding.
#[derive(Clone, Copy, Debug)]
struct Passage {
    /// The side of the other surface that it goes to.
    to: Side,
    /// How fast |h| of the other surface grows there.
    rate: f64,
}

impl Passage {
    /// What follows at a point of both surfaces, reached in attracting sliding on `active` from the side `from` of the other: that it is
    /// crossed, if this is decided.
    fn at<P: PiecewiseSmooth<N>, const N: usize>(
        faces: &Faces<P>,
        active: usize,
        from: Side,
        x: &SVector<f64, N>,
    ) -> Option<Self> {
        let to = from.other();
        let (far, other) = (&faces[active][usize::from(to == Side::Minus)], &faces[1 - active]);
        let across = other.iter().flat_map(|face| {
            let (p, q) = lie_derivatives(face, x);
            [p, q]
        });
        let all_cross = across.into_iter().all(|rate| to.sign() * rate > 0.0);
        let slope = gradient(&other[0], x);
        let along = |field: SVector<f64, N>| to.sign() * slope.dot(&field);
        let rate = match region(far, x) {
            Region::Attracting => along(sliding_field(far, x)),
            Region::CrossingUp => along(far.plus(x)),
            Region::CrossingDown => along(far.minus(x)),
            Region::Repelling | Region::Boundary => return None,
        };
        (all_cross && rate > 0.0).then_some(Self { to, rate })
    }
}

/// Where a run on one surface came to the other.
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
    /// Set until the first event of a run that begins on a surface: the side it came from.
    arrived: Option<Side>,
    /// Set until the first event of a run that goes on from a crossing in sliding: the side that it goes to.
    passed: Option<Side>,
    /// Set until the first step of such a run: how fast it leaves the other surface.
    left: Option<f64>,
    hit: Option<Hit<N>>,
    t_end: f64,
}

impl<P: PiecewiseSmooth<N>, const N: usize> FilippovObserver<N> for Guard<'_, P, N> {
    fn step(&mut self, mode: Mode, step: &Step<'_, N>) -> Flow {
        if self.hit.is_some() {
            return Flow::Stop;
        }
        let height = |theta: f64| self.sign * self.guarded.switching(&step.at(theta));
        let enclosed = |x: &SVector<Enclosed, N>| self.guarded.switching(x).scale(self.sign);
        let first = |start| first_zero_along(step, &height, &enclosed, start).map(|zero| zero.theta());
        let zero = match self.left.take() {
            Some(rate) => first(Start::Simple(rate * step.length())),
            // Rounding may have carried the step before over the surface.
            None if height(0.0) <= 0.0 => Some(0.0),
            None => first(Start::Away),
        };
        let Some(end) = zero else { return self.observer.step(mode, step) };
        let (t, x) = (up_to(self.t_end, step.time(end)), project(self.guarded, &step.at(end)));
        let cut = Step { t1: t, x1: x, interpolant: &Truncated { inner: step.interpolant, end }, ..*step };
        let wanted = t <= step.t0 || self.observer.step(mode, &cut) == Flow::Continue;
        let from = if self.sign > 0.0 { Side::Plus } else { Side::Minus };
        self.hit = Some(Hit { t, x, mode, from, wanted });
        Flow::Stop
    }

    fn event(&mut self, event: &ModeEvent<N>) -> Flow {
        // What the engine says after the step in which the other surface was reached did not happen.
        if self.hit.is_some() {
            return Flow::Stop;
        }
        if let Some(to) = self.passed.take() {
            let kind = EventKind::Crossing { to };
            return self.observer.event(&ModeEvent { kind, from: Some(Mode::SlidingAttracting), ..*event });
        }
        let Some(from) = self.arrived.take() else { return self.observer.event(event) };
        let kind = match (event.kind, event.to) {
            (EventKind::StartedOnSurface, Some(mode)) if mode.slides() => EventKind::Landing { from },
            (EventKind::StartedOnSurface, Some(mode)) if mode == from.into() => EventKind::Grazing { side: from },
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
    use nalgebra::vector;

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
            let (x, y) = if self.surface == 0 { (positive, !self.below) } else { (!self.below, positive) };
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
        let end = run_two_surfaces(&faces, x0.into(), t_end, &Settings::default(), rule, &mut seen, &());
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
        assert!((end.x - vector![-0.5, 0.25]).amax() < 1e-9, "{}", end.x);
        assert_eq!((end.t, end.stop, end.events), (100.0, StopReason::EndTime, 133));
    }

    /// x' = -sign(x), y' = -1 but for y' = 1 where x, y < 0: slides on x = 0 down to the origin.
    const DOWN: [[f64; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [-1.0, -1.0], [1.0, 1.0]];

    #[test]
    fn sliding_into_the_other_surface_is_refused_where_they_meet() {
        let (end, seen) = run(DOWN, [1.0, 3.0], 10.0);
        let Err(FilippovError::Intersection { t, state }) = end else { panic!("{end:?}") };
        assert!((t - 3.0).abs() < 1e-11 && state.iter().all(|v| v.abs() < 1e-11), "{t} {state:?}");
        assert!(
            seen.events.iter().any(|e| e.kind == EventKind::Landing { from: Side::Plus } && (e.t - 1.0).abs() < 1e-11)
        );
        // The same without ever coming there.
        let (end, _) = run(DOWN, [1.0, 3.0], 2.5);
        let end = end.unwrap();
        assert!((end.x - vector![0.0, 0.5]).amax() < 1e-11 && end.mode == Some(Mode::SlidingAttracting));
        // Crossing y = 0 first, then landing on x = 0 below it, where the two fields are opposite: there it rests.
        let (end, seen) = run(DOWN, [3.0, 1.0], 10.0);
        assert!((end.unwrap().x - vector![0.0, -2.0]).amax() < 1e-10);
        let kinds: Vec<_> = seen.events.iter().map(|e| e.kind).collect();
        assert_eq!(kinds, [EventKind::Crossing { to: Side::Minus }, EventKind::Landing { from: Side::Plus }]);
    }

    #[test]
    fn sliding_across_the_other_surface_goes_on_where_that_is_decided() {
        // x' = -sign(x) and y' from -1 (y > 0) to -2 (y < 0): all four fields cross y = 0 downwards.
        let (end, seen) = run([[-1.0, -1.0], [1.0, -1.0], [-1.0, -2.0], [1.0, -2.0]], [1.0, 3.0], 10.0);
        assert!((end.unwrap().x - vector![0.0, -14.0]).amax() < 1e-10);
        let events: Vec<_> = seen.events.iter().map(|e| (e.kind, e.to)).collect();
        let sliding = Some(Mode::SlidingAttracting);
        let crossed = EventKind::Crossing { to: Side::Minus };
        assert_eq!(events, [(EventKind::Landing { from: Side::Plus }, sliding), (crossed, sliding)]);
        assert!((seen.events[1].t - 3.0).abs() < 1e-11);
        // Below, x = 0 is crossed and not slid on: it leaves there, to x > 0.
        let (end, seen) = run([[-1.0, -1.0], [1.0, -1.0], [0.5, -2.0], [1.0, -2.0]], [1.0, 3.0], 4.0);
        assert!((end.unwrap().x - vector![0.5, -2.0]).amax() < 1e-10);
        assert_eq!(seen.events[1].to, Some(Mode::Plus));
        // Below, x = 0 repels: a set of futures.
        let (end, _) = run([[-1.0, -1.0], [1.0, -1.0], [1.0, -2.0], [-1.0, -2.0]], [1.0, 3.0], 10.0);
        assert!(matches!(end, Err(FilippovError::Intersection { .. })), "{end:?}");
    }

    #[test]
    fn flying_and_starting_and_spiralling_into_the_intersection_are_refused() {
        for (fields, x0, when) in [
            (SQUARE.map(|_| [-1.0, -1.0]), [2.0, 2.0], 2.0),
            (SQUARE, [0.0, 0.0], 0.0),
            // A square that shrinks by half with each side: it comes to its middle in a finite time.
            ([[-2.0, 1.0], [-1.0, -2.0], [1.0, 2.0], [2.0, -1.0]], [1.0, 0.0], 1.0),
        ] {
            let (end, _) = run(fields, x0, 100.0);
            let Err(FilippovError::Intersection { t, .. }) = end else { panic!("{fields:?}: {end:?}") };
            assert!((t - when).abs() < 1e-6, "{t} instead of {when}");
        }
    }
}
