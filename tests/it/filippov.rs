//! The event-driven Filippov integrator against closed forms.
#![allow(clippy::disallowed_methods)] // exact solutions are compared to tolerances, not hashed

use nalgebra::{SVector, Vector2, Vector3};
use std::ops::ControlFlow;

use crate::claims::Reads;
use crate::wheel::Wheel;
use twofold::integrate::filippov::two_fold::SlidingAtTwoFold;
use twofold::integrate::filippov::{
    EventKind, ExitRule, FilippovError, FilippovOptions, FunnelGrid, Mode, Side, SlidingLaw,
    Trajectory, connect, funnel, history, run, run_watched,
};
use twofold::integrate::{Monitor, StopReason, Tolerance};
use twofold::system::{Bound, Caricature, PiecewiseSmooth, System};

/// A built-in system with these parameters.
fn builtin<const N: usize>(name: &str, parameters: &[(&str, f64)]) -> Bound<N> {
    let values = parameters.iter().map(|(name, value)| (*name, (*value).into()));
    System::builtin(name).unwrap().with_all(values).unwrap().bind().unwrap()
}

/// The two-fold normal form (4), invisible from both sides.
fn invisible(v: f64, w: f64) -> Bound<3> {
    builtin("two-fold", &[("v", v), ("w", w)])
}

const STAY: ExitRule = ExitRule::AfterTime { time: 1e9, side: Side::Plus };

fn random(seed: u64, mean: f64) -> ExitRule {
    ExitRule::Random {
        law: SlidingLaw::Exponential { mean },
        plus_probability: 0.5,
        seed,
        stream: 0,
    }
}

/// The largest |h| on sliding pieces and at events.
fn drift<P: PiecewiseSmooth<N>, const N: usize>(system: &P, run: &Trajectory<N>) -> f64 {
    let sliding =
        run.pieces.iter().filter(|p| p.mode.slides()).flat_map(|p| p.points.iter().map(|(_, x)| x));
    sliding
        .chain(run.events.iter().map(|e| &e.state))
        .fold(0.0, |m, x| m.max(system.switching(x).abs()))
}

/// The largest |h| on the wrong side in free flight.
fn wrong_side<P: PiecewiseSmooth<N>, const N: usize>(system: &P, run: &Trajectory<N>) -> f64 {
    let mut worst = 0.0_f64;
    for piece in &run.pieces {
        let sign = match piece.mode {
            Mode::Plus => 1.0,
            Mode::Minus => -1.0,
            _ => continue,
        };
        for (_, x) in &piece.points {
            worst = worst.max(-sign * system.switching(x));
        }
    }
    worst
}

#[test]
fn sliding_time_to_the_two_fold_of_the_normal_form() {
    let mut reads = Reads::by("filippov::sliding_time_to_the_two_fold_of_the_normal_form");
    // dt/ds = y + z, (y, z)' = A (y, z): T = -(1, 1) A^-1 (y, z) with A = [[w, 1], [1, v]].
    let n = invisible(-1.2, -1.4);
    let mut longest = 0.0_f64;
    for (y, z) in [(0.3, 0.8), (1.0, 0.05), (0.02, 0.5), (3.0, 4.0)] {
        let det = 1.2 * 1.4 - 1.0;
        let exact = -((-1.2 * y - z) + (-y - 1.4 * z)) / det;
        let mut out = Trajectory::new(4);
        let end = run(
            &n,
            Vector3::new(0.0, y, z),
            100.0,
            &FilippovOptions::default(),
            ExitRule::All,
            &mut out,
        )
        .unwrap();
        assert_eq!(end.stop, StopReason::SetValued);
        assert!(
            (end.t - exact).abs() < 1e-11 * exact,
            "{y} {z}: {} {exact} {:e}",
            end.t,
            end.t - exact
        );
        assert!(end.x.amax() < 1e-14);
        assert!(drift(&n, &out) <= 1e-12);
        longest = longest.max(end.t);
    }
    reads.read("3.4", "longest time of sliding into the origin", longest);
}

#[test]
fn crossing_return_map_of_the_normal_form() {
    // f+ from (0, y, z), y < 0: x = -y t - t²/2, back at t = 2|y| at (0, |y|, z + 2 v |y|); f-
    // likewise with w.
    let (v, w) = (-1.2, -1.4);
    let n = invisible(v, w);
    let mut out = Trajectory::new(1);
    let end =
        run(&n, Vector3::new(0.0, -1.0, 0.4), 20.0, &FilippovOptions::default(), STAY, &mut out)
            .unwrap();
    assert!(end.events > 3);
    let (mut t, mut y, mut z) = (0.0, -1.0_f64, 0.4_f64);
    for event in &out.events[1..] {
        if y < 0.0 {
            (t, y, z) = (t + 2.0 * -y, -y, z + 2.0 * v * -y);
        } else {
            (t, y, z) = (t + 2.0 * -z, y + 2.0 * w * -z, -z);
        }
        assert!((event.t - t).abs() < 1e-10 * t, "{event:?} {t}");
        assert!(
            (event.state - Vector3::new(0.0, y, z)).amax() < 1e-9 * (1.0 + y.abs() + z.abs()),
            "{event:?} {y} {z}"
        );
    }
}

fn visible_pair(plus: bool, minus: bool) -> Bound<3> {
    let sign = |visible| if visible { -1.0 } else { 1.0 };
    builtin(
        "two-fold",
        &[("plus_fold", sign(plus)), ("minus_fold", sign(minus)), ("v", 0.0), ("w", 0.0)],
    )
}

fn close<const N: usize>(a: SVector<f64, N>, b: SVector<f64, N>, tolerance: f64) {
    assert!((a - b).amax() <= tolerance, "{:?} is not {:?}", a.as_slice(), b.as_slice());
}

#[test]
fn caricature_passes_the_two_fold_several_times() {
    for (alpha, t_end) in [(1e-3, 300.0), (1e-1, 100.0)] {
        let c = Caricature::with_reinjection(alpha, 1e-5);
        let mut out = Trajectory::new(4);
        let end = run(
            &c,
            Vector3::new(0.2, 0.0, -1.0),
            t_end,
            &FilippovOptions::default(),
            random(2013, 0.5),
            &mut out,
        )
        .unwrap();
        let passages = out
            .events
            .iter()
            .filter(|e| matches!(e.kind, EventKind::TwoFoldReached { .. }))
            .count();
        assert!(passages >= 3, "{passages}");
        assert!(drift(&c, &out) <= 1e-12, "{:e}", drift(&c, &out));
        assert!(wrong_side(&c, &out) <= 1e-12, "{:e}", wrong_side(&c, &out));
        assert_eq!(end.stop, StopReason::EndTime);
        // Pieces join without gaps, and the mode that an event announces is the mode of the piece
        // that follows.
        for pair in out.pieces.windows(2) {
            assert_eq!(pair[0].points.last(), pair[1].points.first());
        }
        for event in &out.events {
            let next =
                out.pieces.iter().find(|p| p.points[0].0 == event.t && Some(p.mode) == event.to);
            assert!(event.to.is_none() || next.is_some(), "{event:?}");
        }
    }
}

#[test]
fn the_misprinted_sign_never_returns() {
    // SCIENCE.md section 1: with -z the orbit sticks to a point and never returns.
    use twofold::system::caricature::MinusSign;
    let c = Caricature {
        first_component_of_minus: MinusSign::PrintedInEquation5,
        ..Caricature::with_reinjection(1e-3, 1e-5)
    };
    let mut out = Trajectory::new(1);
    let end =
        run(&c, Vector3::new(0.2, 0.0, -1.0), 4000.0, &FilippovOptions::default(), STAY, &mut out)
            .unwrap();
    assert_eq!(end.mode, Some(Mode::SlidingAttracting));
    // It ends on the point where f+ and f- are opposed, lambda f+ + (1 - lambda) f- = 0 with lambda
    // = z/(z - y): that is (0, 8.084, -9.014); SCIENCE.md says "near (0, 8.9, -9.4)", which does
    // not satisfy this equation.
    let (y, z) = (end.x[1], end.x[2]);
    let (lambda, r2) = (z / (z - y), y * y + z * z);
    assert!((lambda - 1.4 * (1.0 - lambda) + (1e-3 - 1e-5 * y) * r2).abs() < 1e-9);
    assert!((-1.2 * lambda + 1.0 - lambda + (1e-3 - 1e-5 * z) * r2).abs() < 1e-9);
    assert!((end.x - Vector3::new(0.0, 8.9, -9.4)).norm() < 1.0);
}

#[test]
fn the_wheel_returns_to_its_singularity() {
    let w = Wheel::default();
    let mut out = Trajectory::new(4);
    let end = run(
        &w,
        Vector3::new(0.69267, 0.0, 0.0),
        60.0,
        &FilippovOptions::default(),
        random(1, 0.05),
        &mut out,
    )
    .unwrap();
    let at = Vector3::new(0.6926698897, -0.5736729677, -0.8666344383);
    let visits: Vec<_> =
        out.events.iter().filter(|e| matches!(e.kind, EventKind::TwoFoldReached { .. })).collect();
    assert!(visits.len() >= 3, "{}", visits.len());
    for visit in visits {
        close(visit.state, at, 1e-10);
    }
    assert!(drift(&w, &out) <= 1e-12, "{:e}", drift(&w, &out));
    assert!(wrong_side(&w, &out) <= 1e-12, "{:e}", wrong_side(&w, &out));
    assert_eq!(end.stop, StopReason::EndTime);
}

#[test]
fn the_wheels_sliding_rates_are_those_of_its_normal_form() {
    // mu_strong/mu_weak depends on v and w of eq. (4) only: mu² - (v + w) mu + vw - 1 = 0.
    let local =
        SlidingAtTwoFold::near(&Wheel::default(), &Vector3::new(0.69, -0.57, -0.87)).unwrap();
    let (v, w) = (-1.84902_f64, -1.98457);
    let root = (0.25 * (v + w) * (v + w) - v * w + 1.0).sqrt();
    let ratio = (0.5 * (v + w) - root) / (0.5 * (v + w) + root);
    let [weak, strong] = local.directions.unwrap();
    assert!(
        (strong.rate / weak.rate - ratio).abs() < 1e-4 * ratio,
        "{} {ratio}",
        strong.rate / weak.rate
    );
    assert!(weak.slides() && !strong.slides());
}

#[test]
fn time_along_the_invariant_curve_is_the_integrators() {
    // Sliding from a point of the curve takes the series' time, and stays on the curve.
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let local = SlidingAtTwoFold::near(&c, &Vector3::new(0.0, 0.01, 0.01)).unwrap();
    let curve = local.through.as_ref().unwrap();
    assert!(curve.radius > 0.1, "{}", curve.radius);
    for part in [0.3, 0.9] {
        let start = curve.at(part * curve.radius);
        let exact = -curve.time(part * curve.radius);
        let mut out = Trajectory::new(1);
        let end =
            run(&c, start, 100.0, &FilippovOptions::default(), ExitRule::All, &mut out).unwrap();
        assert!((end.t - exact).abs() < 1e-10 * exact, "{} {exact}", end.t);
    }
    // Into the repelling region: the exit after a given time is the point of the curve at that
    // time.
    let time = 0.5 * curve.time(-curve.radius);
    let mut out = Trajectory::new(1);
    let rule = ExitRule::AfterTime { time, side: Side::Minus };
    let _ = run(&c, Vector3::new(0.0, 0.0, 0.0), 3.0, &FilippovOptions::default(), rule, &mut out)
        .unwrap();
    let exit = out.events.iter().find(|e| matches!(e.kind, EventKind::Exit { .. })).unwrap();
    assert!((exit.t - time).abs() < 1e-14);
    close(
        exit.state,
        curve.at(-0.5 * curve.radius.min(curve.sigma(time, curve.radius).abs() * 2.0)),
        1e-12,
    );
}

#[test]
fn last_leg_error_is_within_its_estimate() {
    // The same arrival with the leg begun 10^4 times farther out: the difference is of the size
    // stated.
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let arrival = |leg: f64| {
        let settings = FilippovOptions { leg, ..FilippovOptions::default() };
        let mut out = Trajectory::new(1);
        let _ = run(&c, Vector3::new(0.0, 1.0, 0.2), 100.0, &settings, ExitRule::All, &mut out)
            .unwrap();
        let error = |e: &EventKind| {
            if let EventKind::TwoFoldReached { error, .. } = *e { Some(error) } else { None }
        };
        out.events.iter().find_map(|e| error(&e.kind).map(|error| (e.t, error))).unwrap()
    };
    let (exact, tiny) = arrival(1e-8);
    assert!(tiny < 1e-14, "{tiny:e}");
    for leg in [1e-2, 1e-3, 1e-4] {
        let (t, estimate) = arrival(leg);
        let error = (t - exact).abs();
        assert!(error <= estimate + 1e-12, "leg {leg}: {error:e}, estimate {estimate:e}");
    }
}

#[test]
fn visible_visible_sliding_leaves_along_the_fold() {
    // v = w = 0, p = y, q = -z: p' = q, q' = p, t' = q - p. From (p, q) = (-1, 2): p = 0 when e^-s
    // = 3^-1/2, q = 3^1/2, after t = 3 (1 - 3^-1/2); then x = t²/2 along f+.
    let n = visible_pair(true, true);
    let root3 = 3.0_f64.sqrt();
    let exact = 3.0 * (1.0 - 1.0 / root3);
    let mut out = Trajectory::new(4);
    let end = run(
        &n,
        Vector3::new(0.0, -1.0, -2.0),
        exact + 1.0,
        &FilippovOptions::default(),
        STAY,
        &mut out,
    )
    .unwrap();
    let left =
        out.events.iter().find(|e| e.kind == EventKind::LeftByTangency { to: Side::Plus }).unwrap();
    assert!((left.t - exact).abs() < 1e-11, "{} {exact}", left.t);
    close(left.state, Vector3::new(0.0, 0.0, -root3), 1e-10);
    close(end.x, Vector3::new(0.5, 1.0, -root3), 1e-10);
    assert!(drift(&n, &out) <= 1e-12);
}

#[test]
fn visible_visible_two_fold_flies_off_at_once() {
    // On the line p = -q the sliding orbit runs into the two-fold after t = q - p = 2.
    let n = visible_pair(true, true);
    for side in [Side::Plus, Side::Minus] {
        let mut out = Trajectory::new(1);
        let end = run(
            &n,
            Vector3::new(0.0, -1.0, -1.0),
            3.0,
            &FilippovOptions::default(),
            ExitRule::AtOnce { side },
            &mut out,
        )
        .unwrap();
        let reached =
            out.events.iter().find(|e| matches!(e.kind, EventKind::TwoFoldReached { .. })).unwrap();
        assert!((reached.t - 2.0).abs() < 1e-12, "{}", reached.t);
        let expected = match side {
            Side::Plus => Vector3::new(0.5, 1.0, 0.0),
            Side::Minus => Vector3::new(-0.5, 0.0, 1.0),
        };
        close(end.x, expected, 1e-11);
    }
}

#[test]
fn visible_invisible_sliding_turns_towards_the_visible_fold() {
    // v = w = 0, plus visible: p = y, q = z, p' = q, q' = -p (a rotation). From (-1, 1): p = 0 at t
    // = 2^1/2, q = 2^1/2.
    let root2 = 2.0_f64.sqrt();
    let mut out = Trajectory::new(1);
    let end = run(
        &visible_pair(true, false),
        Vector3::new(0.0, -1.0, 1.0),
        root2 + 1.0,
        &FilippovOptions::default(),
        STAY,
        &mut out,
    )
    .unwrap();
    let left =
        out.events.iter().find(|e| e.kind == EventKind::LeftByTangency { to: Side::Plus }).unwrap();
    assert!((left.t - root2).abs() < 1e-11);
    close(end.x, Vector3::new(0.5, 1.0, root2), 1e-10);
    // Minus visible: p = -y, q = -z, p' = -q, q' = p. From (p, q) = (-1, 1) it is q that comes to
    // zero.
    let mut out = Trajectory::new(1);
    let end = run(
        &visible_pair(false, true),
        Vector3::new(0.0, 1.0, -1.0),
        root2 + 1.0,
        &FilippovOptions::default(),
        STAY,
        &mut out,
    )
    .unwrap();
    let left = out
        .events
        .iter()
        .find(|e| e.kind == EventKind::LeftByTangency { to: Side::Minus })
        .unwrap();
    assert!((left.t - root2).abs() < 1e-11);
    close(end.x, Vector3::new(-0.5, root2, 1.0), 1e-10);
}

#[test]
fn repelling_sliding_through_an_invisible_two_fold_backwards() {
    // vw < 1: the sliding direction has mu > 0, motion goes from the repelling to the attracting
    // region. With v = w = 0 the field on y = z is (1/2, 1/2): from (-1, -1) the two-fold is
    // reached at t = 2, and (1.5, 1.5) at t = 5.
    let n = visible_pair(false, false);
    let mut out = Trajectory::new(1);
    let end =
        run(&n, Vector3::new(0.0, -1.0, -1.0), 5.0, &FilippovOptions::default(), STAY, &mut out)
            .unwrap();
    let reached =
        out.events.iter().find(|e| matches!(e.kind, EventKind::TwoFoldReached { .. })).unwrap();
    assert!((reached.t - 2.0).abs() < 1e-12, "{}", reached.t);
    assert_eq!(end.mode, Some(Mode::SlidingAttracting));
    close(end.x, Vector3::new(0.0, 1.5, 1.5), 1e-11);
}

#[test]
fn repelling_sliding_ends_at_an_invisible_fold() {
    // v = w = 0: backwards p' = q, q' = p. From (p, q) = (1, -1/2): q = 0 at e^-s = 3^-1/2, t = 1.5
    // (1 - 3^-1/2), p = (3/4)^1/2; there only h > 0 is left.
    let mut out = Trajectory::new(1);
    let _ = run(
        &visible_pair(false, false),
        Vector3::new(0.0, -1.0, -0.5),
        1.0,
        &FilippovOptions::default(),
        STAY,
        &mut out,
    )
    .unwrap();
    let left = out
        .events
        .iter()
        .find(|e| matches!(e.kind, EventKind::ExitAtBoundary { to: Side::Plus, .. }))
        .expect("leaves at the fold of f-, to the other side");
    assert!((left.t - 1.5 * (1.0 - 1.0 / 3.0_f64.sqrt())).abs() < 1e-11, "{}", left.t);
    close(left.state, Vector3::new(0.0, -(0.75_f64.sqrt()), 0.0), 1e-10);
}

#[test]
fn grazing_and_its_neighbours() {
    // f+ = (y, 1, 0) from (x0, -1, -1): x = x0 - t + t²/2 touches at t = 1 for x0 = 1/2; there f-
    // points up.
    let n = visible_pair(true, true);
    let fly = |x0: f64| {
        let mut out = Trajectory::new(1);
        let end =
            run(&n, Vector3::new(x0, -1.0, -1.0), 3.0, &FilippovOptions::default(), STAY, &mut out)
                .unwrap();
        (end, out.events)
    };
    let (end, events) = fly(0.5);
    assert_eq!(events.len(), 1, "{events:?}");
    assert_eq!(events[0].kind, EventKind::Grazing { side: Side::Plus });
    assert!((events[0].t - 1.0).abs() < 1e-6);
    close(end.x, Vector3::new(2.0, 2.0, -1.0), 1e-6);

    let (end, events) = fly(0.5 + 1e-9);
    assert!(events.is_empty(), "{events:?}");
    close(end.x, Vector3::new(2.0 + 1e-9, 2.0, -1.0), 1e-11);

    // The dip below the surface lasts 9e-5 and is 1e-9 deep: far inside one step. It lands, slides,
    // leaves at the fold.
    let (end, events) = fly(0.5 - 1e-9);
    let kinds: Vec<_> = events.iter().map(|e| e.kind).collect();
    assert_eq!(
        kinds,
        [EventKind::Landing { from: Side::Plus }, EventKind::LeftByTangency { to: Side::Plus }]
    );
    assert!((events[0].t - (1.0 - 2e-9_f64.sqrt())).abs() < 1e-8, "{:?}", events[0].t);
    close(end.x, Vector3::new(2.0, 2.0, -1.0), 1e-4);
}

#[test]
fn rules_do_what_they_say() {
    let n = invisible(-1.2, -1.4);
    // The sliding speed on the weak eigenvector (1, w') of eq. (4): |(z + w y, y + v z)|/(y + z).
    let mu = -1.3 + 1.01_f64.sqrt();
    let (y, z) = (1.0, mu + 1.4);
    let speed = -mu * (y * y + z * z).sqrt() / (y + z);
    let exit = |rule: ExitRule| {
        let mut out = Trajectory::new(1);
        let _ =
            run(&n, Vector3::new(0.0, 0.3, 0.5), 20.0, &FilippovOptions::default(), rule, &mut out)
                .unwrap();
        let departed = out.events.iter().find(|e| e.kind == EventKind::EnteredRepelling).unwrap().t;
        let e = *out.events.iter().find(|e| matches!(e.kind, EventKind::Exit { .. })).unwrap();
        let EventKind::Exit { to, time, arc, rule: recorded } = e.kind else { unreachable!() };
        assert_eq!(recorded, rule);
        assert!((e.t - departed - time).abs() < 1e-13);
        assert!((e.state.norm() - arc).abs() < 1e-9 * arc, "{} {arc}", e.state.norm());
        assert!((arc - speed * time).abs() < 1e-9 * arc, "{arc} {}", speed * time);
        (to, time, arc)
    };
    let (to, time, _) = exit(ExitRule::AfterTime { time: 0.7, side: Side::Minus });
    assert!(to == Side::Minus && (time - 0.7).abs() < 1e-14, "{to:?} {time} {:e}", time - 0.7);
    let (to, _, arc) = exit(ExitRule::AfterArc { arc: 0.25, side: Side::Plus });
    assert!(to == Side::Plus && (arc - 0.25).abs() < 1e-10);
    let (to, time, _) = exit(ExitRule::AtOnce { side: Side::Plus });
    assert!(to == Side::Plus && time > 0.0);

    // Random: the numbers are those of the named generator, time first, then side; another seed
    // gives others.
    use twofold::num::random::RandomStream;
    let mut sides = [0, 0];
    for seed in 0..12 {
        let rule = ExitRule::Random {
            law: SlidingLaw::Uniform { longest: 2.0 },
            plus_probability: 0.3,
            seed,
            stream: 4,
        };
        let (to, time, _) = exit(rule);
        let mut stream = RandomStream::new(seed, 4);
        assert!((time - 2.0 * stream.uniform()).abs() < 1e-13);
        assert_eq!(to == Side::Plus, stream.uniform() < 0.3);
        sides[usize::from(to == Side::Plus)] += 1;
    }
    assert!(sides[0] > 0 && sides[1] > 0, "{sides:?}");
}

#[test]
fn bad_rules_are_named() {
    let n = invisible(-1.2, -1.4);
    let mut out = Trajectory::new(1);
    let rule = ExitRule::AfterTime { time: -1.0, side: Side::Plus };
    let error =
        run(&n, Vector3::new(0.0, 0.3, 0.5), 1.0, &FilippovOptions::default(), rule, &mut out)
            .unwrap_err();
    assert!(matches!(error, FilippovError::Invalid(ref m) if m.contains("time")), "{error}");
    let json = r#"{"random":{"law":{"exponential":{"mean":0.5}},"plus_probability":0.5,"seed":1,"stream":0}}"#;
    assert_eq!(serde_json::from_str::<ExitRule>(json).unwrap(), random(1, 0.5));
    assert!(serde_json::from_str::<ExitRule>(r#"{"after-time":{"time":1.0}}"#).is_err());
}

#[test]
fn stick_slip_limit_cycle() {
    // Slip from (friction, belt): xi'' = weakening xi' - xi with xi = x - friction + weakening
    // belt, until v = belt again.
    let (b, friction, k) = (0.3, 1.0, 0.2);
    let s = builtin::<2>("stick-slip", &[("belt", b), ("friction", friction), ("weakening", k)]);
    let omega = (1.0 - 0.25 * k * k).sqrt();
    let (a1, a2) = (k * b, (b - 0.5 * k * k * b) / omega);
    let slip = |t: f64| {
        let (sin, cos, grow) = ((omega * t).sin(), (omega * t).cos(), (0.5 * k * t).exp());
        let xi = grow * (a1 * cos + a2 * sin);
        let v = 0.5 * k * xi + grow * omega * (a2 * cos - a1 * sin);
        (xi + friction - k * b, v)
    };
    // v - belt is negative during the slip and comes back through zero once before a full turn.
    let (mut low, mut high) = (3.0, 2.0 * std::f64::consts::PI / omega);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if slip(middle).1 < b { low = middle } else { high = middle }
    }
    let (x_land, _) = slip(low);
    let period = low + (friction - x_land) / b;

    let mut out = Trajectory::new(4);
    let _ =
        run(&s, Vector2::new(0.0, 0.0), 60.0, &FilippovOptions::default(), STAY, &mut out).unwrap();
    let slips: Vec<_> = out
        .events
        .iter()
        .filter(|e| e.kind == EventKind::LeftByTangency { to: Side::Minus })
        .collect();
    let lands: Vec<_> =
        out.events.iter().filter(|e| e.kind == EventKind::Landing { from: Side::Minus }).collect();
    assert!(slips.len() >= 4);
    for pair in slips.windows(2) {
        assert!(
            (pair[1].t - pair[0].t - period).abs() < 1e-10,
            "{} {period}",
            pair[1].t - pair[0].t
        );
        close(pair[1].state, Vector2::new(friction, b), 1e-11);
    }
    assert!((lands.last().unwrap().state[0] - x_land).abs() < 1e-10);
    assert!(drift(&s, &out) <= 1e-12 && wrong_side(&s, &out) <= 1e-12);
}

#[test]
fn relay_with_linear_feedback_slides_exponentially() {
    let r = builtin::<2>("relay-linear", &[("gain", 1.0)]);
    let mut out = Trajectory::new(4);
    let end =
        run(&r, Vector2::new(0.5, 0.0), 8.0, &FilippovOptions::default(), STAY, &mut out).unwrap();
    // x = 1/2 - t²/2, v = -t: lands at t² + 2 t = 1; |v| < 1, so it slides with x' = -x.
    let t1 = 2.0_f64.sqrt() - 1.0;
    assert_eq!(out.events.len(), 1);
    assert!((out.events[0].t - t1).abs() < 1e-12);
    assert_eq!(out.events[0].kind, EventKind::Landing { from: Side::Plus });
    let x = t1 * (t1 - 8.0).exp();
    close(end.x, Vector2::new(x, -x), 1e-12);
    assert!(drift(&r, &out) <= 1e-12);
}

#[test]
fn relay_with_parabolic_feedback() {
    // Gain 2: lands at t = (4/3)^1/2 with v = -t, slides with v' = 1/2.
    let slow = builtin::<2>("relay-parabolic", &[("gain", 2.0)]);
    let t1 = (4.0_f64 / 3.0).sqrt();
    let mut out = Trajectory::new(4);
    let end =
        run(&slow, Vector2::new(2.0, 0.0), t1 + 1.5, &FilippovOptions::default(), STAY, &mut out)
            .unwrap();
    let v = -t1 + 0.75;
    close(end.x, Vector2::new(v * v, v), 1e-11);
    assert!(drift(&slow, &out) <= 1e-12);
    // The origin, at t1 + 2 t1, is a rest: zero lies between the fields (0, -1) and (0, 1).
    let end = run(
        &slow,
        Vector2::new(2.0, 0.0),
        10.0,
        &FilippovOptions::default(),
        STAY,
        &mut Trajectory::new(1),
    )
    .unwrap();
    assert!(end.x.amax() < 1e-6 && end.mode == Some(Mode::SlidingAttracting), "{end:?}");
    let end = run(
        &slow,
        Vector2::new(2.0, 0.0),
        2.9 * t1,
        &FilippovOptions::default(),
        STAY,
        &mut Trajectory::new(1),
    )
    .unwrap();
    assert!((end.x[1] + 0.05 * t1).abs() < 1e-9, "{end:?}");

    // Gain 1/2: flights accumulate at t1 + t1 (1 + r)/(1 - r), r² = (1 - k)/(1 + k), t1² = 4/(1 +
    // k).
    let fast = builtin::<2>("relay-parabolic", &[("gain", 0.5)]);
    let (t1, r) = ((4.0_f64 / 1.5).sqrt(), (0.5_f64 / 1.5).sqrt());
    let exact = t1 * (1.0 + (1.0 + r) / (1.0 - r));
    let mut out = Trajectory::new(1);
    let end =
        run(&fast, Vector2::new(2.0, 0.0), 100.0, &FilippovOptions::default(), STAY, &mut out)
            .unwrap();
    assert!(end.x.amax() < 1e-9 && end.t == 100.0, "{end:?}");
    let last = out.events.last().unwrap();
    assert!(
        matches!(last.kind, EventKind::Accumulation { .. }) && (last.t - exact).abs() < 1e-8,
        "{last:?} {exact}"
    );

    // Gain 1, time-optimal: the switching curve is an orbit of f-, along which the motion comes to
    // rest at t = 2 sqrt(2).
    let optimal = builtin::<2>("relay-parabolic", &[("gain", 1.0)]);
    let mut out = Trajectory::new(1);
    let end =
        run(&optimal, Vector2::new(2.0, 0.0), 9.0, &FilippovOptions::default(), STAY, &mut out)
            .unwrap();
    assert!(end.x.amax() < 1e-6 && end.mode == Some(Mode::SlidingAttracting), "{end:?}");
    let landing = out.events[0];
    assert!(
        landing.kind == EventKind::Landing { from: Side::Plus }
            && (landing.t - 2.0_f64.sqrt()).abs() < 1e-9,
        "{landing:?}"
    );
    let end =
        run(&optimal, Vector2::new(2.0, 0.0), 2.5, &FilippovOptions::default(), STAY, &mut out)
            .unwrap();
    let v = 2.5 - 8.0_f64.sqrt();
    close(end.x, Vector2::new(0.5 * v * v, v), 1e-9);
}

#[test]
fn the_funnel_holds_every_exit() {
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let grid = FunnelGrid {
        shortest: 0.05,
        longest: 1.5,
        times: 5,
        horizon: 60.0,
        until_two_fold: true,
        per_step: 2,
    };
    let f =
        funnel(&c, Vector3::new(0.2, 0.0, -1.0), 50.0, &FilippovOptions::default(), &grid).unwrap();
    assert!(f.point.amax() < 1e-14 && (f.t - 13.196).abs() < 1e-2, "{} {:?}", f.t, f.point);
    assert_eq!(f.members.len(), 10);
    for m in &f.members {
        let first = m.trajectory.pieces[0].points[0];
        assert_eq!(first, (f.t, f.point), "every future starts at the one point");
        let left = m
            .trajectory
            .events
            .iter()
            .find(|e| matches!(e.kind, EventKind::Exit { .. } | EventKind::ExitAtBoundary { .. }))
            .unwrap();
        if let EventKind::Exit { to, time, .. } = left.kind {
            assert!(to == m.side && (time - m.exit_time).abs() < 1e-12);
        }
        assert!(drift(&c, &m.trajectory) <= 1e-12);
    }
    let back = f.members.iter().filter(|m| m.summary.stop == StopReason::Observer).count();
    assert!(back >= 5, "{back} of 10 came back to the two-fold");
}

#[test]
fn a_step_cap_changes_no_event() {
    // Uncapped steps straddle whole excursions; steps of 1e-3 do not. The sequence of events must
    // be the same.
    fn kinds<P: PiecewiseSmooth<3>>(system: &P, max_step: f64, t_end: f64) -> Vec<(String, f64)> {
        let settings = FilippovOptions { max_step, ..FilippovOptions::default() };
        let mut out = Trajectory::new(1);
        let start = Vector3::new(0.69267, 0.0, 0.0);
        let _ = run(system, start, t_end, &settings, ExitRule::All, &mut out).unwrap();
        out.events
            .iter()
            .map(|e| (format!("{:?}", e.kind).chars().take(12).collect(), e.t))
            .collect()
    }
    let (w, n) = (Wheel::default(), invisible(-0.5, -0.5));
    for (coarse, fine) in [
        (kinds(&w, f64::INFINITY, 3.0), kinds(&w, 1e-3, 3.0)),
        (kinds(&n, f64::INFINITY, 9.0), kinds(&n, 1e-3, 9.0)),
    ] {
        assert!(!coarse.is_empty());
        assert_eq!(coarse.len(), fine.len(), "{coarse:?} {fine:?}");
        for (a, b) in coarse.iter().zip(&fine) {
            assert!(a.0 == b.0 && (a.1 - b.1).abs() < 1e-9, "{a:?} {b:?}");
        }
    }
}

#[test]
fn a_step_that_straddles_two_crossings_misses_none() {
    // x = (t - a)(t - b) exactly, in one step of any length, for b - a down to
    // 1e-5, with both fields equal, so that the orbit must cross down and up again.
    struct Parabola {
        a: f64,
        b: f64,
    }
    impl PiecewiseSmooth<2> for Parabola {
        fn switching<S: twofold::num::Elementary>(&self, x: &SVector<S, 2>) -> S {
            x[0]
        }
        fn plus<S: twofold::num::Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            Vector2::new(x[1].scale(2.0) - S::from_f64(self.a + self.b), S::one())
        }
        fn minus<S: twofold::num::Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            self.plus(x)
        }
    }
    for gap in [1.0, 1e-1, 1e-2, 1e-3, 1e-4, 1e-5] {
        for k in 0..20 {
            let a = 0.05 + 0.37 * f64::from(k);
            let p = Parabola { a, b: a + gap };
            let mut out = Trajectory::new(1);
            let _ = run(
                &p,
                Vector2::new(p.a * p.b, 0.0),
                20.0,
                &FilippovOptions::default(),
                STAY,
                &mut out,
            )
            .unwrap();
            assert_eq!(out.events.len(), 2, "gap {gap:e} a {a}: {:?}", out.events);
            let error = (out.events[0].t - p.a).abs().max((out.events[1].t - p.b).abs());
            assert!(error < 1e-13 * 20.0 / gap, "gap {gap:e} a {a}: {error:e}");
        }
    }
}

#[test]
fn reversed_time_leads_back() {
    // A repelling sliding orbit of the system is an attracting one of the reversed system, through
    // the same points.
    use twofold::system::Reversed;
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let mut forward = Trajectory::new(1);
    let rule = ExitRule::AfterTime { time: 0.9, side: Side::Plus };
    let _ =
        run(&c, Vector3::new(0.0, 0.0, 0.0), 2.0, &FilippovOptions::default(), rule, &mut forward)
            .unwrap();
    let exit = forward.events.iter().find(|e| matches!(e.kind, EventKind::Exit { .. })).unwrap();
    let mut back = Trajectory::new(1);
    let end =
        run(&Reversed(c), exit.state, 5.0, &FilippovOptions::default(), ExitRule::All, &mut back)
            .unwrap();
    assert!(end.x.amax() < 1e-12 && (end.t - 0.9).abs() < 1e-10, "{end:?}");
}

#[test]
fn observers_of_ordinary_runs_work() {
    use twofold::integrate::filippov::AllModes;
    use twofold::integrate::{Flow, Observer, Step};
    #[derive(Default)]
    struct Joined(Vec<(f64, f64)>);
    impl Observer<3> for Joined {
        fn step(&mut self, step: &Step<'_, 3>) -> Flow {
            self.0.push((step.t0, step.t1));
            Flow::Continue
        }
    }
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let mut seen = Joined::default();
    let _ = run(
        &c,
        Vector3::new(0.2, 0.0, -1.0),
        40.0,
        &FilippovOptions::default(),
        random(3, 0.5),
        &mut AllModes(&mut seen),
    )
    .unwrap();
    assert_eq!((seen.0[0].0, seen.0.last().unwrap().1), (0.0, 40.0));
    assert!(seen.0.windows(2).all(|w| w[0].1 == w[1].0 && w[0].0 < w[0].1));
}

#[test]
fn interpolants_are_in_physical_time_and_on_the_surface() {
    // Between the ends of a sliding step too: |h| <= 1e-12 and the state at a time is the state of
    // a run that ends there.
    let w = Wheel::default();
    let mut out = Trajectory::new(16);
    let _ = run(
        &w,
        Vector3::new(0.69267, 0.0, 0.0),
        3.0,
        &FilippovOptions::default(),
        ExitRule::All,
        &mut out,
    )
    .unwrap();
    assert!(drift(&w, &out) <= 1e-12, "{:e}", drift(&w, &out));
    let sliding: Vec<_> = out
        .pieces
        .iter()
        .filter(|p| p.mode == Mode::SlidingAttracting)
        .flat_map(|p| &p.points)
        .collect();
    assert!(sliding.len() > 100);
    for (t, x) in sliding.iter().step_by(sliding.len() / 7) {
        let end = run(
            &w,
            Vector3::new(0.69267, 0.0, 0.0),
            *t,
            &FilippovOptions::default(),
            ExitRule::All,
            &mut Trajectory::new(1),
        )
        .unwrap();
        assert!((end.x - x).amax() < 1e-8, "t = {t}: {:e}", (end.x - x).amax());
    }
}

#[test]
fn tolerance_buys_accuracy() {
    // The first arrival at the two-fold after three crossings and a landing, against a run with
    // tiny steps.
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let arrival = |tolerance: f64, max_step: f64| {
        let settings = FilippovOptions {
            tolerance: Tolerance { rtol: tolerance, atol: tolerance },
            max_step,
            ..FilippovOptions::default()
        };
        run(
            &c,
            Vector3::new(0.2, 0.0, -1.0),
            50.0,
            &settings,
            ExitRule::All,
            &mut Trajectory::new(1),
        )
        .unwrap()
        .t
    };
    let exact = arrival(1e-13, 5e-3);
    for tolerance in [1e-6, 1e-8, 1e-10, 1e-12] {
        let error = (arrival(tolerance, f64::INFINITY) - exact).abs();
        println!("tolerance {tolerance:e}: arrival off by {error:e}");
        assert!(error < 100.0 * tolerance, "{tolerance:e}: {error:e}");
    }
}

#[test]
fn every_point_of_the_repelling_region_has_a_past_at_the_two_fold() {
    // Normal form: int dt = (1, 1) A^-1 (y, z) is also the time since the two-fold in the repelling
    // region.
    let n = invisible(-1.2, -1.4);
    for (y, z) in [(-0.3, -0.8), (-1.0, -0.05), (-0.4, -0.4)] {
        let exact = -((1.2 * y + z) + (y + 1.4 * z)) / (1.2 * 1.4 - 1.0);
        let past =
            history(&n, Vector3::new(0.0, y, z), 100.0, &FilippovOptions::default(), 4).unwrap();
        let points: Vec<_> = past.points().collect();
        let (first, last) = (points[0], points[points.len() - 1]);
        assert!(first.1.amax() < 1e-12 && first.0 == 0.0);
        close(last.1, Vector3::new(0.0, y, z), 1e-14);
        assert!((last.0 - exact).abs() < 1e-10 * exact, "{} {exact}", last.0);
        assert!(past.pieces.iter().all(|p| p.mode == Mode::SlidingRepelling));
    }
    assert!(
        history(&n, Vector3::new(0.0, 1.0, 1.0), 100.0, &FilippovOptions::default(), 4).is_err()
    );
}

#[test]
fn points_of_the_chaotic_set_are_connected_through_the_singularity() {
    let mut reads =
        Reads::by("filippov::points_of_the_chaotic_set_are_connected_through_the_singularity");
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    // Points of one orbit, taken from its free flight after the first visit.
    let mut orbit = Trajectory::new(2);
    let _ = run(
        &c,
        Vector3::new(0.2, 0.0, -1.0),
        90.0,
        &FilippovOptions::default(),
        random(3, 0.8),
        &mut orbit,
    )
    .unwrap();
    let visit =
        orbit.events.iter().find(|e| matches!(e.kind, EventKind::TwoFoldReached { .. })).unwrap().t;
    let flights: Vec<_> =
        orbit.pieces.iter().filter(|p| !p.mode.slides() && p.points[0].0 > visit).collect();
    let mut connected = 0;
    let mut tried = 0;
    for flight in flights.iter().take(12) {
        let b = flight.points[flight.points.len() / 2].1;
        tried += 1;
        let Ok(path) =
            connect(&c, Vector3::new(0.2, 0.0, -1.0), b, 200.0, &FilippovOptions::default(), 2)
        else {
            continue;
        };
        connected += 1;
        let points: Vec<_> = path.points().collect();
        assert!((points[points.len() - 1].1 - b).amax() < 1e-12, "it ends at b");
        for pair in path.pieces.windows(2) {
            let (end, start) = (pair[0].points.last().unwrap(), pair[1].points[0]);
            assert!(
                (end.0 - start.0).abs() < 1e-10 && (end.1 - start.1).amax() < 1e-9,
                "{end:?} {start:?}"
            );
        }
        // The second part is an orbit forwards too: run on from where it leaves the surface.
        let left = path.pieces.iter().rposition(|p| p.mode == Mode::SlidingRepelling).unwrap();
        let (t0, from) = *path.pieces[left].points.last().unwrap();
        let side = if path.pieces[left + 1].mode == Mode::Plus { Side::Plus } else { Side::Minus };
        let t = points[points.len() - 1].0 - t0;
        let end = run(
            &c,
            from,
            t,
            &FilippovOptions::default(),
            ExitRule::AtOnce { side },
            &mut Trajectory::new(1),
        )
        .unwrap();
        assert!((end.x - b).amax() < 1e-7, "{:e}", (end.x - b).amax());
    }
    let share = f64::from(connected) / f64::from(tried);
    reads.read("3.7", "share of pairs of points of the set that are connected", share);
    assert_eq!(connected, tried, "any two points of the set are connected");
}

/// y = 0 crossings of the smoothed system in 113-bit arithmetic: (t, x, z).
fn reference(name: &str, rows: usize) -> Vec<[f64; 3]> {
    let text = std::fs::read_to_string(format!(
        "{}/papers/jeffrey-2013/reference/{name}",
        env!("CARGO_MANIFEST_DIR")
    ))
    .unwrap();
    let lines = text.lines().filter(|l| !l.starts_with('#')).skip(1);
    lines
        .map(|l| {
            l.split(',')
                .take(3)
                .map(|v| v.parse().unwrap())
                .collect::<Vec<f64>>()
                .try_into()
                .unwrap()
        })
        .take(rows)
        .collect()
}

#[test]
fn the_smoothed_reference_lies_within_eps() {
    // Before the first visit the smoothed orbit with eps = 1e-3 is O(eps) from the Filippov orbit.
    use twofold::integrate::filippov::AllModes;
    use twofold::integrate::roots::CrossingFinder;
    use twofold::integrate::{Flow, Observer, Step};
    #[derive(Default)]
    struct Section(Vec<[f64; 3]>, CrossingFinder);
    impl Observer<3> for Section {
        fn step(&mut self, step: &Step<'_, 3>) -> Flow {
            for passage in self.1.through_plane(step, 1, 0.0) {
                let x = step.at(passage.theta);
                self.0.push([step.time(passage.theta), x[0], x[2]]);
            }
            Flow::Continue
        }
    }
    for (name, alpha, rows) in
        [("crossings-printed.csv", 1e-3, 4), ("crossings-reconstructed.csv", 1e-1, 2)]
    {
        let c = Caricature::with_reinjection(alpha, 1e-5);
        let mut section = Section::default();
        let _ = run(
            &c,
            Vector3::new(0.2, 0.0, -1.0),
            50.0,
            &FilippovOptions::default(),
            ExitRule::All,
            &mut AllModes(&mut section),
        )
        .unwrap();
        for (found, wanted) in section.0.iter().zip(reference(name, rows)) {
            for (f, w) in found.iter().zip(wanted) {
                assert!((f - w).abs() < 2e-3 * (1.0 + w.abs()), "{name}: {found:?} {wanted:?}");
            }
        }
        assert!(section.0.len() >= rows);
    }
}

#[test]
fn the_discontinuous_wheel_fills_a_box_like_the_smoothed_wheels() {
    // SCIENCE.md section 7, smoothed with eps = 1e-3, 30 < t < 230: r in [0.22, 0.79], v in [-6.2,
    // 5.5], omega in [-8.0, 4.6].
    let w = Wheel::default();
    let mut out = Trajectory::new(2);
    let _ = run(
        &w,
        Vector3::new(0.69267, 0.0, 0.0),
        230.0,
        &FilippovOptions::default(),
        random(5, 0.05),
        &mut out,
    )
    .unwrap();
    let mut bounds = [[f64::INFINITY, f64::NEG_INFINITY]; 3];
    for (_, x) in out.points().filter(|(t, _)| *t > 30.0) {
        for (b, v) in bounds.iter_mut().zip(x.iter()) {
            *b = [b[0].min(*v), b[1].max(*v)];
        }
    }
    let visits = out
        .events
        .iter()
        .filter(|e| e.t > 30.0 && matches!(e.kind, EventKind::TwoFoldReached { .. }))
        .count();
    // Exits are our choice (exponential, mean 0.05), so the sizes agree only roughly; each side is
    // at least as long.
    for (found, smoothed) in bounds.iter().zip([[0.22, 0.79], [-6.2, 5.5], [-8.0, 4.6]]) {
        let ratio = (found[1] - found[0]) / (smoothed[1] - smoothed[0]);
        assert!((0.95..1.35).contains(&ratio), "{found:?} {smoothed:?}");
    }
    assert!(visits >= 50, "{visits}");
}

#[test]
fn a_run_that_is_cut_short_says_why() {
    struct Refuses;
    impl Monitor for Refuses {
        fn reached(&self, _: f64) -> ControlFlow<()> {
            ControlFlow::Break(())
        }
    }
    let n = invisible(-1.2, -1.4);
    let start = Vector3::new(0.0, 0.3, 0.8);
    let mut out = Trajectory::new(1);
    let few = FilippovOptions { max_steps: 3, ..FilippovOptions::default() };
    let poor = run(&n, start, 100.0, &few, ExitRule::All, &mut out).unwrap();
    assert_eq!(poor.stop, StopReason::StepBudget);
    assert!(poor.t < 100.0 && !out.pieces.is_empty(), "what was computed until then stands");
    assert!(matches!(poor.within_budget(), Err(FilippovError::Stepping(_))));

    let mut out = Trajectory::new(1);
    let cut = run_watched(
        &n,
        start,
        100.0,
        &FilippovOptions::default(),
        ExitRule::All,
        &mut out,
        &Refuses,
    )
    .unwrap();
    assert_eq!(cut.stop, StopReason::Cancelled);

    let mut out = Trajectory::new(1).until_events(1);
    let seen = run(&n, start, 100.0, &FilippovOptions::default(), ExitRule::All, &mut out).unwrap();
    assert_eq!(seen.stop, StopReason::Observer);
    // A family is not made from runs that were cut short.
    let grid = FunnelGrid {
        shortest: 0.1,
        longest: 1.0,
        times: 2,
        horizon: 5.0,
        until_two_fold: true,
        per_step: 1,
    };
    assert!(matches!(funnel(&n, start, 100.0, &few, &grid), Err(FilippovError::Stepping(_))));
}

#[test]
fn a_funnel_counts_the_work_of_its_approach() {
    use twofold::job::simulate::simulate;
    use twofold::job::spec::{FunnelSpec, Method, MethodSpec, Observation, RunSpec, SwitchSpec};
    let c = Caricature::with_reinjection(1e-1, 1e-5);
    let (start, settings) = (
        Vector3::new(0.2, 0.0, -1.0),
        FilippovOptions { max_step: 5.0, ..FilippovOptions::default() },
    );
    let grid = FunnelGrid {
        shortest: 0.1,
        longest: 1.0,
        times: 2,
        horizon: 5.0,
        until_two_fold: true,
        per_step: 1,
    };
    let alone = run(&c, start, 50.0, &settings, ExitRule::All, &mut Trajectory::new(1)).unwrap();
    let family = funnel(&c, start, 50.0, &settings, &grid).unwrap();
    assert_eq!(family.statistics, alone.statistics);
    let futures: u64 = family.members.iter().map(|m| m.summary.statistics.steps).sum();

    let FunnelGrid { shortest, longest, times, horizon, until_two_fold, .. } = grid;
    let funnel = Some(FunnelSpec { shortest, longest, times, horizon, until_two_fold });
    let spec = RunSpec {
        system: c.into(),
        switch: SwitchSpec::Filippov { exit: ExitRule::All, funnel },
        start: start.as_slice().to_vec(),
        t_end: 50.0,
        method: MethodSpec {
            tolerance: settings.tolerance,
            ..MethodSpec::ndsolve_defaults(Method::Dopri5)
        },
        schedule: Default::default(),
        observe: Observation::Path { chord: 1e-3 },
    };
    let recording = simulate(&spec, &()).unwrap();
    assert_eq!(recording.statistics.steps, alone.statistics.steps + futures);
    assert_eq!(recording.stop, StopReason::SetValued);
}
