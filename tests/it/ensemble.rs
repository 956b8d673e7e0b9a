//! A run in a lane against the same run alone.

use nalgebra::{SVector, Vector1, Vector2, Vector3};
use twofold::analyse::SectionRecorder;
use twofold::integrate::ensemble::{
    End, EnsembleRun, InstructionSet, SectionPlane, ensemble, ensemble_with,
};
use twofold::integrate::{
    Dopri5, DriveOptions, Flow, Guarded, Ignore, Kick, KickLaw, Observer, Schedule, Step, StepCap,
    StopReason, Tolerance, drive,
};
use twofold::system::{Caricature, Smoothed, Transition};

const TOLERANCE: Tolerance = Tolerance { rtol: 1.0536712e-8, atol: 1.0536712e-8 };
const PLANE: SectionPlane = SectionPlane { coordinate: 1, value: 0.0 };

/// The method whose bits lanes have.
fn method<const N: usize>(tolerance: Tolerance) -> Guarded<Dopri5<N>, N> {
    Guarded::new(Dopri5::new(tolerance), tolerance)
}

/// Runs that are computed with two registers at a time, and with four, whatever the instruction
/// set.
const FEW: usize = 19;
const MANY: u32 = 75;

fn field() -> Smoothed<Caricature> {
    Smoothed {
        system: Caricature::with_reinjection(1e-1, 1e-4),
        transition: Transition::Tanh,
        eps: 1e-3,
    }
}

/// Runs of different lengths, under different schedules and caps; one that cannot begin, one that
/// has nothing to do, one with a small budget.
fn runs() -> Vec<EnsembleRun<3>> {
    let mut runs: Vec<_> = (0..37_u32)
        .map(|k| {
            let kick =
                Kick { every: 0.9, size: 1e-3, law: KickLaw::Sphere, seed: 7, stream: k.into() };
            let schedule = Schedule {
                restart_every: (k % 3 > 0).then_some(3.7),
                kick: (k % 5 == 4).then_some(kick),
            };
            let step_cap = [StepCap::None, StepCap::Absolute(0.3), StepCap::FractionOfSegment(0.1)]
                [k as usize % 3];
            let options = DriveOptions {
                schedule,
                step_cap,
                max_steps: 50_000,
                ..DriveOptions::to(2.0 + f64::from(k * 11 % 17))
            };
            EnsembleRun { start: Vector3::new(0.1 + 0.01 * f64::from(k), 0.0, -1.0), options }
        })
        .collect();
    runs[5].start[0] = f64::NAN;
    runs[11].options.t_end = 0.0;
    runs[17].options.max_steps = 20;
    runs
}

fn alone<O: Observer<3>>(run: &EnsembleRun<3>, mut observer: O) -> End<O, 3> {
    let mut stepper = method(TOLERANCE);
    let summary = drive(&field(), run.start, &run.options, &mut stepper, &mut observer, &());
    End { summary, observer }
}

/// Bits, not values: NaN states in errors compare too.
fn words<O>(ends: &[End<O, 3>], seen: impl Fn(&O) -> String) -> Vec<String> {
    let word = |end: &End<O, 3>| match &end.summary {
        Ok(s) => format!(
            "{} {:?} {:?} {} {:?} {}",
            s.t.to_bits(),
            s.x.map(f64::to_bits),
            s.statistics,
            s.most_steps_in_segment,
            s.stop,
            seen(&end.observer)
        ),
        Err(failure) => format!("{failure:?}"),
    };
    ends.iter().map(word).collect()
}

fn crossings(recorder: &SectionRecorder<3>) -> String {
    recorder
        .crossings()
        .iter()
        .map(|c| format!("{:?} {:?};", c.t.to_bits(), c.x.map(f64::to_bits)))
        .collect()
}

/// Calls `test` for each instruction set of this machine, and says which it has not.
fn on_every_set(test: impl Fn(InstructionSet)) {
    for set in InstructionSet::ALL {
        if set.is_here() {
            test(set);
            println!("{set:?}: run");
        } else {
            println!("{set:?}: NOT RUN, this machine has not got it");
        }
    }
}

#[test]
fn a_lane_has_the_bits_of_a_run_alone_on_every_instruction_set() {
    let runs = runs();
    let recorder = || SectionRecorder::<3>::new(PLANE.coordinate, PLANE.value);
    let expected =
        words(&runs.iter().map(|run| alone(run, recorder())).collect::<Vec<_>>(), crossings);
    assert!(
        expected[5].starts_with("NotFinite") && expected[17].contains("StepBudget"),
        "{expected:?}"
    );
    let crossed = expected.iter().filter(|e| e.contains(';')).count();
    assert!(crossed > runs.len() / 2, "crossings are among what is compared: {expected:?}");
    on_every_set(|set| {
        let found = ensemble_with(set, &field(), &runs, TOLERANCE, Some(PLANE), |_| recorder());
        assert_eq!(words(&found, crossings), expected, "{set:?}");
        // Whatever the neighbours.
        let backwards: Vec<_> = runs.iter().rev().copied().collect();
        let mut found =
            ensemble_with(set, &field(), &backwards, TOLERANCE, Some(PLANE), |_| recorder());
        found.reverse();
        assert_eq!(words(&found, crossings), expected, "{set:?}, neighbours the other way round");
        // Fewer runs than lanes.
        let found =
            ensemble_with(set, &field(), &runs[..3], TOLERANCE, Some(PLANE), |_| recorder());
        assert_eq!(words(&found, crossings), expected[..3], "{set:?}, three runs");
        // Enough for more registers at a time: as many as fill 32 lanes twice.
        let twice: Vec<_> = runs.iter().chain(&backwards).copied().collect();
        assert!(twice.len() >= 2 * 4 * 8);
        let found = ensemble_with(set, &field(), &twice, TOLERANCE, Some(PLANE), |_| recorder());
        let (found, mut other) =
            (words(&found[..runs.len()], crossings), words(&found[runs.len()..], crossings));
        other.reverse();
        assert_eq!(found, expected, "{set:?}, more registers");
        assert_eq!(other, expected, "{set:?}, more registers, the second half");
    });
}

#[test]
fn without_a_plane_ends_are_the_same() {
    let runs = runs();
    let expected =
        words(&runs.iter().map(|run| alone(run, Ignore)).collect::<Vec<_>>(), |_| String::new());
    let found = ensemble(&field(), &runs, TOLERANCE, None, |_| Ignore);
    assert_eq!(words(&found, |_| String::new()), expected);
}

/// Stops at the second step that it hears of.
struct Second(SectionRecorder<3>);
impl Observer<3> for Second {
    fn step(&mut self, step: &Step<'_, 3>) -> Flow {
        let _ = self.0.step(step);
        if self.0.crossings().len() >= 2 { Flow::Stop } else { Flow::Continue }
    }
}

#[test]
fn an_observer_may_stop_its_run_and_no_other() {
    let runs = runs();
    let second = || Second(SectionRecorder::new(PLANE.coordinate, PLANE.value));
    let expected = words(&runs.iter().map(|run| alone(run, second())).collect::<Vec<_>>(), |s| {
        crossings(&s.0)
    });
    assert!(
        expected.iter().any(|e| e.contains(&format!("{:?}", StopReason::Observer))),
        "{expected:?}"
    );
    assert!(
        expected.iter().any(|e| e.contains(&format!("{:?}", StopReason::EndTime))),
        "{expected:?}"
    );
    on_every_set(|set| {
        let found = ensemble_with(set, &field(), &runs, TOLERANCE, Some(PLANE), |_| second());
        assert_eq!(words(&found, |s| crossings(&s.0)), expected, "{set:?}");
    });
}

/// x' = x^2: leaves the numbers in finite time, by steps that shrink.
#[test]
fn failures_are_those_of_a_run_alone() {
    struct Exploding;
    impl twofold::system::VectorField<1> for Exploding {
        fn eval<S: twofold::num::Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
            Vector1::new(x[0] * x[0])
        }
    }
    let runs: Vec<EnsembleRun<1>> = (0..MANY)
        .map(|k| EnsembleRun {
            start: Vector1::new(0.25 * f64::from(k) - 4.0),
            options: DriveOptions::to(1.0),
        })
        .collect();
    let word = |summary: &Result<twofold::integrate::Summary<1>, twofold::integrate::Failure>| {
        format!("{summary:?}")
    };
    let expected: Vec<_> = runs
        .iter()
        .map(|run| {
            let mut stepper = method(TOLERANCE);
            word(&drive(&Exploding, run.start, &run.options, &mut stepper, &mut Ignore, &()))
        })
        .collect();
    assert!(
        expected.iter().any(|e| e.starts_with("Err")) && expected[0].starts_with("Ok"),
        "{expected:?}"
    );
    on_every_set(|set| {
        for count in [FEW, runs.len()] {
            let found = ensemble_with(set, &Exploding, &runs[..count], TOLERANCE, None, |_| Ignore);
            let found: Vec<_> = found.iter().map(|end| word(&end.summary)).collect();
            assert_eq!(found, expected[..count], "{set:?}, {count} runs");
        }
    });
}

/// x' = c - sqrt(x) with c as a second state: trial points where x is negative have no value.
/// Orbits with c = 0 end there, others only look over the edge.
#[test]
fn a_trial_that_has_no_value_is_repeated_as_in_a_run_alone() {
    struct Edge;
    impl twofold::system::VectorField<2> for Edge {
        fn eval<S: twofold::num::Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            Vector2::new(x[1] - x[0].sqrt(), S::zero())
        }
    }
    let coarse = Tolerance { rtol: 1e-2, atol: 1e-2 };
    let runs: Vec<EnsembleRun<2>> = (0..MANY)
        .map(|k| EnsembleRun {
            start: Vector2::new(0.3 + 0.02 * f64::from(k), 0.05 * f64::from(k % 3)),
            options: DriveOptions::to(9.0),
        })
        .collect();
    let word = |summary: &Result<twofold::integrate::Summary<2>, twofold::integrate::Failure>| {
        match summary {
            Ok(end) => {
                format!("{:?} {:?} {:?}", end.x.map(f64::to_bits), end.t.to_bits(), end.statistics)
            }
            Err(failure) => format!("{failure:?}"),
        }
    };
    let alone: Vec<_> = runs
        .iter()
        .map(|run| drive(&Edge, run.start, &run.options, &mut method(coarse), &mut Ignore, &()))
        .collect();
    let expected: Vec<_> = alone.iter().map(word).collect();
    assert!(expected.iter().any(|e| e.starts_with("Undefined")), "{expected:?}");
    assert!(alone.iter().flatten().any(|end| end.statistics.rejected > 0), "{expected:?}");
    on_every_set(|set| {
        for count in [FEW, runs.len()] {
            let found = ensemble_with(set, &Edge, &runs[..count], coarse, None, |_| Ignore);
            let found: Vec<_> = found.iter().map(|end| word(&end.summary)).collect();
            assert_eq!(found, expected[..count], "{set:?}, {count} runs");
        }
    });
}

#[test]
fn no_runs_no_ends() {
    assert!(ensemble(&field(), &[], TOLERANCE, None, |_| Ignore).is_empty());
}
