//! Properties that hold whatever the numbers are: of steps, of passages, of sliding, of time turned
//! round.
#![allow(clippy::disallowed_methods)] // exact solutions are compared to tolerances, not hashed

use nalgebra::{SVector, Vector2, Vector3};
use proptest::prelude::*;
use twofold::analyse::{Crossing, Direction, SectionRecorder};
use twofold::integrate::filippov::{self, ExitRule, FilippovObserver, Mode, ModeEvent};
use twofold::integrate::{
    DriveOptions, Flow, Method, Observer, Step, Stepper, StopReason, Tolerance, WithStepper, drive,
};
use twofold::num::Elementary;
use twofold::system::{Caricature, Reversed, Smoothed, Transition, VectorField};

/// A pendulum: x' = v, v' = -sin-like cubic, with friction.
#[derive(Clone, Copy, Debug)]
struct Duffing {
    friction: f64,
    cubic: f64,
}

impl VectorField<2> for Duffing {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        let (friction, cubic) = (S::from_f64(self.friction), S::from_f64(self.cubic));
        Vector2::new(x[1], -x[0] - friction * x[1] - cubic * x[0] * x[0] * x[0])
    }
}

/// Looks at every step's interpolant.
#[derive(Default)]
struct Ends {
    last: Option<(f64, SVector<f64, 2>)>,
    worst: f64,
    steps: usize,
}

impl Observer<2> for Ends {
    fn step(&mut self, step: &Step<'_, 2>) -> Flow {
        // A step begins where the last one ended, to the bit.
        if let Some((t, x)) = self.last {
            assert_eq!((t, x), (step.t0, step.x0));
        }
        assert!(step.t1 > step.t0);
        // The interpolant itself, which `Step::at` does not ask at the ends, comes to them, and to
        // itself from both sides of the middle.
        for (theta, end) in [(0.0, step.x0), (1.0, step.x1)] {
            let size = 1.0 + end.amax();
            self.worst = self.worst.max((step.interpolant.at(theta) - end).amax() / size);
        }
        assert_eq!(step.at(0.0), step.x0);
        assert_eq!(step.at(1.0), step.x1);
        self.last = Some((step.t1, step.x1));
        self.steps += 1;
        Flow::Continue
    }
}

struct Look<'a>(Duffing, SVector<f64, 2>, &'a mut Ends);

impl WithStepper<2> for Look<'_> {
    type Answer = ();
    fn with<M: Stepper<2>>(self, mut stepper: M) {
        let end =
            drive(&self.0, self.1, &DriveOptions::to(3.0), &mut stepper, self.2, &()).unwrap();
        assert_eq!((end.stop, end.t), (StopReason::EndTime, 3.0));
    }
}

/// Ends where it should.
struct Goes<'a, F>(&'a F, SVector<f64, 3>, f64);

impl<F: VectorField<3>> WithStepper<3> for Goes<'_, F> {
    type Answer = SVector<f64, 3>;
    fn with<M: Stepper<3>>(self, mut stepper: M) -> Self::Answer {
        let mut ignore = twofold::integrate::Ignore;
        drive(self.0, self.1, &DriveOptions::to(self.2), &mut stepper, &mut ignore, &()).unwrap().x
    }
}

/// The largest |h| while sliding, and how long that lasted.
#[derive(Default)]
struct OnSurface {
    furthest: f64,
    slid: f64,
    wrong: Option<String>,
}

impl FilippovObserver<3> for OnSurface {
    fn step(&mut self, mode: Mode, step: &Step<'_, 3>) -> Flow {
        for i in 0..=8 {
            let h = step.at(f64::from(i) / 8.0)[0];
            match mode {
                Mode::SlidingAttracting | Mode::SlidingRepelling => {
                    self.furthest = self.furthest.max(h.abs());
                    self.slid += step.length() / 9.0;
                }
                // Between events it stays on its side, to the accuracy with which a landing is
                // found.
                Mode::Plus if h < -1e-7 => {
                    self.wrong = Some(format!("h = {h} above, t = {}", step.t0))
                }
                Mode::Minus if h > 1e-7 => {
                    self.wrong = Some(format!("h = {h} below, t = {}", step.t0))
                }
                Mode::Plus | Mode::Minus => {}
            }
        }
        Flow::Continue
    }
    fn event(&mut self, _: &ModeEvent<3>) -> Flow {
        Flow::Continue
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 40, failure_persistence: None,
        ..ProptestConfig::default() })]

    #[test]
    fn interpolants_come_to_their_steps_ends(
        friction in 0.0..0.5_f64, cubic in 0.0..2.0_f64, x in -2.0..2.0_f64, v in -2.0..2.0_f64,
            digits in 4.0..10.0_f64,
    ) {
        let tolerance = twofold::num::elementary::exp10(-digits);
        for method in Method::ALL {
            let mut ends = Ends::default();
            let tolerance = Tolerance { rtol: tolerance, atol: tolerance };
            method.with_stepper(tolerance, Look(Duffing { friction, cubic }, Vector2::new(x, v),
                &mut ends));
            prop_assert!(ends.steps > 0);
            // LSODA's is a polynomial about the step's end: its value at the beginning is what the
            // corrector left there.
            let most = if method == Method::Lsoda { 30.0 * tolerance.rtol } else { 1e-13 };
            prop_assert!(ends.worst <= most, "{}: {:e}", method.name(), ends.worst);
        }
    }

    /// x = cos, v = -sin: every passage is known, is found once, in its sense, at its time.
    #[test]
    fn every_passage_is_found_once(
        phase in 0.0..6.2_f64, level in -0.98..0.98_f64, digits in 6.0..9.0_f64,
            method in prop::sample::select(Method::ALL.to_vec()),
    ) {
        use std::f64::consts::TAU;
        struct Record(SVector<f64, 2>, SectionRecorder<2>);
        impl WithStepper<2> for Record {
            type Answer = Vec<(f64, bool)>;
            fn with<M: Stepper<2>>(mut self, mut stepper: M) -> Self::Answer {
                let circle = Duffing { friction: 0.0, cubic: 0.0 };
                let _ = drive(&circle, self.0, &DriveOptions::to(20.0), &mut stepper, &mut self.1,
                    &()).unwrap();
                let up = |c: &Crossing<2>| c.direction == Direction::Up;
                self.1.crossings().iter().map(|c| (c.t, up(c))).collect()
            }
        }
        // cos(t + phase) = level: downwards at acos(level), upwards at -acos(level), modulo a turn.
        let angle = level.acos();
        let mut wanted: Vec<(f64, bool)> = (-1..6)
            .flat_map(|turn| [(angle, false), (-angle, true)].map(|(a,
                up)| (a - phase + f64::from(turn) * TAU, up)))
            .filter(|(t, _)| (0.0..20.0).contains(t))
            .collect();
        wanted.sort_by(|a, b| a.0.total_cmp(&b.0));
        // Not where the start or the end decides.
        prop_assume!(wanted.iter().all(|(t, _)| *t > 1e-2 && *t < 20.0 - 1e-2));
        let tolerance = twofold::num::elementary::exp10(-digits);
        let start = Vector2::new(phase.cos(), -phase.sin());
        let found = method.with_stepper(
            Tolerance { rtol: tolerance, atol: tolerance },
            Record(start, SectionRecorder::new(0, level)),
        );
        prop_assert_eq!(found.len(), wanted.len(), "{}: {:?} instead of \
            {:?}", method.name(), found, wanted);
        // A crossing at an angle of 11 degrees or more: errors of x become errors of t five times
        // as large.
        for ((t, up), (wanted_t, wanted_up)) in found.iter().zip(&wanted) {
            prop_assert_eq!(up, wanted_up);
            prop_assert!((t - wanted_t).abs() < 4e4 * tolerance.max(1e-12), "{}: {} instead of \
                {}", method.name(), t, wanted_t);
        }
    }

    /// Wherever it starts: while it slides it is on the surface exactly, and between events on its
    /// own side.
    #[test]
    fn sliding_stays_on_the_surface(x in -0.3..0.3_f64, y in -1.5..1.5_f64, z in -1.5..1.5_f64,
        time in 0.1..2.0_f64) {
        let system = Caricature::with_reinjection(1e-1, 1e-5);
        let settings = filippov::FilippovOptions { max_steps: 20_000,
            ..filippov::FilippovOptions::default() };
        let mut seen = OnSurface::default();
        let rule = ExitRule::AfterTime { time, side: filippov::Side::Plus };
        let end = filippov::run(&system, Vector3::new(x, y, z), 12.0, &settings, rule, &mut seen);
        prop_assume!(end.is_ok());
        prop_assert!(seen.furthest <= 1e-14, "{:e} from the surface", seen.furthest);
        prop_assert_eq!(seen.wrong, None);
    }

    /// There and back again: the reversed field undoes what the field did, to the tolerance times
    /// the growth of errors.
    #[test]
    fn time_turns_round(x in 0.1..0.6_f64, y in -1.0..1.0_f64, z in -1.5..-0.5_f64,
        length in 0.1..0.5_f64) {
        let system = Caricature::with_reinjection(1e-1, 1e-5);
        let field = Smoothed { system, transition: Transition::Tanh, eps: 1e-2 };
        let reversed = Smoothed { system: Reversed(system), transition: Transition::Tanh,
            eps: 1e-2 };
        let start = Vector3::new(x, y, z);
        let fine = Tolerance { rtol: 1e-11, atol: 1e-11 };
        for method in [Method::Lsoda, Method::Dopri5, Method::Radau5, Method::Taylor] {
            let there = method.with_stepper(fine, Goes(&field, start, length));
            // Layers are crossed with errors that the way back stretches: only orbits that stay off
            // the surface are compared.
            prop_assume!(there[0] > 0.05);
            let back = method.with_stepper(fine, Goes(&reversed, there, length));
            prop_assert!((back - start).amax() < 1e-8, "{}: {:e}", method.name(),
                (back - start).amax());
        }
    }
}
