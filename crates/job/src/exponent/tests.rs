use crate::Executor;
use std::ops::ControlFlow;

use super::*;
use crate::cases;
use twofold_integrate::Tolerance;
use twofold_integrate::filippov::{ExitRule, Side};
use twofold_system::{Caricature, Relaxation, Transition};

fn question(system: System, switch: SwitchSpec, duration: f64) -> LargestExponent {
    let tolerance = Tolerance { rtol: 1e-9, atol: 1e-9 };
    let start = vec![1.0; system.dimension()];
    let settings = lyapunov::LyapunovOptions {
        tolerance,
        transient: 20.0,
        duration,
        ..lyapunov::LyapunovOptions::default()
    };
    LargestExponent { system, switch, start, settings }
}

fn hysteretic() -> SwitchSpec {
    SwitchSpec::hysteretic(1e-2, Relaxation::Single)
}

/// Decays at the rates 1, 2, 3 ... : neighbours approach each other at the lowest. phi, where
/// it is a state, follows h, which is far from 0.
#[test]
fn the_slowest_of_many_decays_is_the_exponent() {
    for n in 1..=5 {
        for switch in
            [SwitchSpec::tanh(1e-2), hysteretic()].into_iter().take(if n < 5 { 2 } else { 1 })
        {
            let answer =
                question(cases::decays(n), switch, 10.0).compute(&Executor::quiet(), &()).unwrap();
            let exponent: Exponent =
                answer.fact("exponent").unwrap_or_else(|e| panic!("{n} {switch:?}: {e}"));
            assert!((exponent.value + 1.0).abs() < 1e-5, "{n} {switch:?}: {exponent:?}");
            assert_eq!((exponent.duration, answer.stop), (10.0, Stop::Finished));
        }
    }
}

/// The same where the switch depends on the past, which these orbits never ask: h is far from
/// 0.
#[test]
fn decays_have_the_slowest_rate_whatever_the_switch() {
    let smooth = SwitchSpec::Delayed {
        delay: 0.3,
        eps: Some(1e-2),
        transition: Some(Transition::Tanh),
        history: twofold_integrate::delay::History::Constant,
    };
    for n in 1..=4 {
        for switch in [SwitchSpec::delayed(0.3), SwitchSpec::relay(0.1), smooth] {
            let answer =
                question(cases::decays(n), switch, 10.0).compute(&Executor::quiet(), &()).unwrap();
            let exponent: Exponent =
                answer.fact("exponent").unwrap_or_else(|e| panic!("{n} {switch:?}: {e}"));
            assert!((exponent.value + 1.0).abs() < 1e-5, "{n} {switch:?}: {exponent:?}");
        }
    }
}

/// The compiled equations and those of the same system's file.
#[test]
fn the_caricature_is_its_file() {
    let compiled = System::from(Caricature::with_reinjection(0.1, 1e-5));
    let recorded = cases::of(&compiled.definition().to_toml().replace("\"-y\"", "\"0 - y\""));
    assert!(compiled.compiled().is_some() && recorded.compiled().is_none());
    for switch in [SwitchSpec::tanh(1e-2), hysteretic()] {
        let [a, b] = [&compiled, &recorded].map(|system| {
            let question = LargestExponent {
                start: vec![0.2, 0.0, -1.0],
                ..question(system.clone(), switch, 30.0)
            };
            question.compute(&Executor::quiet(), &()).unwrap().fact::<Exponent>("exponent").unwrap()
        });
        assert!((a.value - b.value).abs() < 1e-4, "{a:?} {b:?}");
    }
}

/// Orbits side by side have the exponents that they have alone: the compiled caricature's with
/// numbers of their own, files' systems of two to four states, every transition function; some
/// that cannot be followed, and vectors that shrink by far more than a step may.
#[test]
fn exponents_side_by_side_are_those_alone() {
    let compiled = |alpha: f64| System::from(Caricature::with_reinjection(alpha, 1e-5));
    let caricature = |alpha: f64, switch: SwitchSpec| {
        let question = question(compiled(alpha), switch, 4.0);
        let settings = lyapunov::LyapunovOptions { transient: 1.0, ..question.settings };
        LargestExponent { start: vec![0.2, alpha, -1.0], settings, ..question }
    };
    let smoothed = |eps: f64, transition: Transition| SwitchSpec::Smoothed { eps, transition };
    let mut all: Vec<(Vec<LargestExponent>, bool)> = Vec::new();
    let transitions = [
        Transition::PerturbedTanh { sigma: 0.1 },
        Transition::Arctan,
        Transition::Algebraic,
        Transition::Erf,
    ];
    for transition in transitions {
        all.push((
            (1..4).map(|k| caricature(0.1 * f64::from(k), smoothed(1e-2, transition))).collect(),
            true,
        ));
    }
    let tanh = |k: u32| {
        caricature(
            0.1 + 0.002 * f64::from(k),
            smoothed(1e-2 / f64::from(1 + k % 3), Transition::Tanh),
        )
    };
    let mut many: Vec<_> = (0..70).map(tanh).collect();
    many[7].start[0] = f64::NAN;
    many[9].start[1] = 1e200;
    all.push((many, true));
    for (states, growth) in [(2, "0.9"), (3, "0.9"), (4, "-2")] {
        let of = |k: u32| {
            let names = ["x", "y", "z", "w"];
            let mut fields: Vec<String> =
                names.iter().map(|name| format!("0 - {name}*{k}")).collect();
            fields[0] = format!("x*({growth} - x*x) + tanh(y)");
            let fields: Vec<&str> = fields[..states].iter().map(String::as_str).collect();
            let system = cases::smooth(&names[..states], "y - 0.3", &fields);
            let start = vec![0.1 * f64::from(k); states];
            LargestExponent { start, ..question(system, SwitchSpec::tanh(1e-2), 20.0) }
        };
        all.push(((2..7).map(of).collect(), true));
    }
    // No exponent before its time: a budget of steps.
    let poor = |k: u32| {
        let question = caricature(0.1 + 0.01 * f64::from(k), SwitchSpec::tanh(1e-2));
        let settings = lyapunov::LyapunovOptions { max_steps: 500, ..question.settings };
        LargestExponent { settings, ..question }
    };
    all.push(((0..3).map(poor).collect(), true));
    // Settings that differ, kicks, other equations, five states.
    let [mut a, b] = [0.1, 0.2].map(|alpha| caricature(alpha, SwitchSpec::tanh(1e-2)));
    all.push((vec![a.clone(), caricature(0.1, smoothed(1e-2, Transition::Erf))], false));
    all.push((vec![a.clone(), caricature(0.1, hysteretic())], false));
    a.settings.duration = 10.0;
    all.push((vec![a.clone(), b.clone()], false));
    a.settings.kick = Some(twofold_integrate::Kick {
        every: 1.0,
        size: 1e-3,
        law: twofold_integrate::KickLaw::Sphere,
        seed: 1,
        stream: 1,
    });
    all.push((vec![a.clone(), a], false));
    let five = question(cases::decays(5), SwitchSpec::tanh(1e-2), 9.0);
    all.push((vec![five.clone(), five], false));
    for (questions, together) in all {
        let alone: Vec<Option<Exponent>> = questions
            .iter()
            .map(|question| question.found(&question.compute(&Executor::quiet(), &()).unwrap()))
            .collect();
        let bits = |all: &[Option<Exponent>]| -> Vec<_> {
            all.iter()
                .map(|e| e.map(|e| [e.value, e.standard_error, e.duration].map(f64::to_bits)))
                .collect()
        };
        let questions: Vec<_> = questions.iter().collect();
        for set in InstructionSet::ALL.into_iter().filter(|set| set.is_here()) {
            let found = LargestExponent::side_by_side(&questions, set, &()).unwrap();
            assert_eq!(found.is_some(), together, "{:?}", questions[0]);
            if let Some(found) = found {
                assert_eq!(bits(&found), bits(&alone), "{set:?} {:?}", questions[0]);
            }
        }
        if questions.len() == 70 {
            let none = |i: usize| alone[i].is_none();
            assert!(none(7) && none(9) && !none(8), "{alone:?}");
        }
    }
}

#[test]
fn what_has_no_exponent_says_why() {
    let said = |q: LargestExponent| {
        q.compute(&Executor::quiet(), &()).unwrap().fact::<String>("failure").unwrap()
    };
    let few = LargestExponent {
        start: vec![1.0],
        ..question(cases::decays(2), SwitchSpec::tanh(1e-2), 9.0)
    };
    assert!(said(few).contains("1 numbers, the system 2 states"));
    let exit = ExitRule::AtOnce { side: Side::Plus };
    let filippov = question(cases::decays(2), SwitchSpec::Filippov { exit, funnel: None }, 9.0);
    assert!(said(filippov).contains("ask for all"));
    assert!(said(question(cases::decays(6), SwitchSpec::tanh(1e-2), 9.0)).contains("not for 6"));
    assert!(said(question(cases::decays(5), hysteretic(), 9.0)).contains("not for 6"));
    assert!(said(question(cases::decays(5), SwitchSpec::relay(0.1), 9.0)).contains("not for 5"));
    // x' = x^2 leaves at t = 1.
    let leaving = cases::smooth(&["x"], "x + 1", &["x*x"]);
    assert!(!said(question(leaving, SwitchSpec::tanh(1e-2), 9.0)).is_empty());
}

#[test]
fn phi_begins_on_the_side_of_the_start() {
    let system = cases::smooth(&["x", "y"], "y - 1", &["-x", "-y"]);
    for (y, phi) in [(1.5, 1.0), (0.5, 0.0), (1.0, 1.0)] {
        let question =
            LargestExponent { start: vec![0.0, y], ..question(system.clone(), hysteretic(), 9.0) };
        assert_eq!(question.phi(), phi, "{y}");
    }
}

/// Asked to stop at a third of the time; and before eight of the 64 blocks are done.
#[test]
fn an_interrupted_mean_says_so() {
    struct Until(f64);
    impl Monitor for Until {
        fn reached(&self, t: f64) -> ControlFlow<()> {
            if t < self.0 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        }
    }
    let turning = |duration| {
        question(
            cases::smooth(&["x", "v"], "x + 9", &["v", "-x"]),
            SwitchSpec::tanh(1e-2),
            duration,
        )
    };
    let third = turning(3000.0).compute(&Executor::quiet(), &Until(1000.0)).unwrap();
    assert_eq!(third.stop, Stop::Interrupted);
    let exponent: Exponent = third.fact("exponent").unwrap();
    assert!(
        (900.0..2500.0).contains(&exponent.duration) && exponent.value.abs() < 1e-2,
        "{exponent:?}"
    );
    assert_eq!(
        turning(30_000.0).compute(&Executor::quiet(), &Until(1.0)),
        Err(JobError::Interrupted)
    );
}
