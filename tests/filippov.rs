//! The event-driven Filippov integrator against closed forms.

use nalgebra::vector;
use twofold::integrate::filippov::two_fold::SlidingAtTwoFold;
use twofold::integrate::filippov::{
    End, EventKind, ExitRule, FilippovError, Mode, Settings, Side, SlidingLaw, Trajectory, run,
};
use twofold::model::filippov::Visibility;
use twofold::model::{Caricature, Feedback, PiecewiseSmooth, Relay, StickSlip, TwoFoldNormalForm, Wheel};

const STAY: ExitRule = ExitRule::AfterTime { time: 1e9, side: Side::Plus };

fn random(seed: u64, mean: f64) -> ExitRule {
    ExitRule::Random { law: SlidingLaw::Exponential { mean }, plus_probability: 0.5, seed, stream: 0 }
}

/// The largest |h| on sliding pieces and at events.
fn drift<P: PiecewiseSmooth<N>, const N: usize>(system: &P, run: &Trajectory<N>) -> f64 {
    let sliding = run.pieces.iter().filter(|p| p.mode.slides()).flat_map(|p| p.points.iter().map(|(_, x)| x));
    sliding.chain(run.events.iter().map(|e| &e.state)).fold(0.0, |m, x| m.max(system.switching(x).abs()))
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
    // dt/ds = y + z, (y, z)' = A (y, z): T = -(1, 1) A^-1 (y, z) with A = [[w, 1], [1, v]].
    let n = TwoFoldNormalForm::invisible(-1.2, -1.4);
    for (y, z) in [(0.3, 0.8), (1.0, 0.05), (0.02, 0.5), (3.0, 4.0)] {
        let det = 1.2 * 1.4 - 1.0;
        let exact = -((-1.2 * y - z) + (-y - 1.4 * z)) / det;
        let mut out = Trajectory::new(4);
        let end = run(&n, vector![0.0, y, z], 100.0, &Settings::default(), ExitRule::All, &mut out).unwrap();
        assert_eq!(end.end, End::SetValued);
        assert!((end.t - exact).abs() < 1e-11 * exact, "{y} {z}: {} {exact} {:e}", end.t, end.t - exact);
        assert!(end.x.amax() < 1e-14);
        assert!(drift(&n, &out) <= 1e-12);
    }
}

#[test]
fn crossing_return_map_of_the_normal_form() {
    // f+ from (0, y, z), y < 0: x = -y t - t²/2, back at t = 2|y| at (0, |y|, z + 2 v |y|); f- likewise with w.
    let (v, w) = (-1.2, -1.4);
    let n = TwoFoldNormalForm::invisible(v, w);
    let mut out = Trajectory::new(1);
    let end = run(&n, vector![0.0, -1.0, 0.4], 20.0, &Settings::default(), STAY, &mut out).unwrap();
    assert!(end.events > 3);
    let (mut t, mut y, mut z) = (0.0, -1.0_f64, 0.4_f64);
    for event in &out.events[1..] {
        if y < 0.0 {
            (t, y, z) = (t + 2.0 * -y, -y, z + 2.0 * v * -y);
        } else {
            (t, y, z) = (t + 2.0 * -z, y + 2.0 * w * -z, -z);
        }
        assert!((event.t - t).abs() < 1e-10 * t, "{event:?} {t}");
        assert!((event.state - vector![0.0, y, z]).amax() < 1e-9 * (1.0 + y.abs() + z.abs()), "{event:?} {y} {z}");
    }
}

#[test]
fn caricature_passes_the_two_fold_several_times() {
    for (alpha, t_end) in [(1e-3, 300.0), (1e-1, 100.0)] {
        let c = Caricature::with_reinjection(alpha, 1e-5);
        let mut out = Trajectory::new(4);
        let end = run(&c, vector![0.2, 0.0, -1.0], t_end, &Settings::default(), random(2013, 0.5), &mut out).unwrap();
        let passages = out.events.iter().filter(|e| matches!(e.kind, EventKind::TwoFoldReached { .. })).count();
        println!("alpha {alpha}: {passages} passages, {} events, {:?}", end.events, end.statistics);
        for e in out.events.iter().take(40) {
            println!("{:10.5} {:?} {:?} {:?}", e.t, e.state.as_slice(), e.kind, e.to);
        }
        assert!(passages >= 3, "{passages}");
        assert!(drift(&c, &out) <= 1e-12, "{:e}", drift(&c, &out));
        assert!(wrong_side(&c, &out) <= 1e-12, "{:e}", wrong_side(&c, &out));
        assert_eq!(end.end, End::Time);
    }
}

#[test]
fn the_wheel_runs() {
    let w = Wheel::default();
    let mut out = Trajectory::new(4);
    let local = SlidingAtTwoFold::near(&w, &vector![0.69, -0.57, -0.87]).unwrap();
    println!("{:?} radius {}", local.directions, local.radius);
    let start = vector![0.69267, 0.0, 0.0];
    let end = run(&w, start, 60.0, &Settings::default(), random(1, 0.05), &mut out).unwrap();
    let passages = out.events.iter().filter(|e| matches!(e.kind, EventKind::TwoFoldReached { .. })).count();
    println!("wheel: {passages} passages, {} events, {:?}", end.events, end.statistics);
    assert!(passages >= 3, "{passages}");
    assert!(drift(&w, &out) <= 1e-12, "{:e}", drift(&w, &out));
    assert!(wrong_side(&w, &out) <= 1e-11, "{:e}", wrong_side(&w, &out));
}
