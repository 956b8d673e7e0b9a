use super::*;
use crate::cases;
use twofold_integrate::filippov::{Side, SlidingLaw};
use twofold_integrate::{Kick, KickLaw};
use twofold_system::Caricature;

type Change = fn(&mut RunSpec);

const SECTION: Observation = Observation::Section { coordinate: 1, value: 0.0 };

fn smoothed() -> RunSpec {
    let run = cases::run(
        Caricature::with_reinjection(1e-1, 1e-5).into(),
        SwitchSpec::tanh(1e-3),
        20.0,
        SECTION,
    );
    assert_eq!(run.validate(), Ok(()));
    run
}

fn filippov() -> RunSpec {
    let exit = ExitRule::AtOnce { side: Side::Plus };
    let run = RunSpec { switch: SwitchSpec::Filippov { exit, funnel: None }, ..smoothed() };
    assert_eq!(run.validate(), Ok(()));
    run
}

fn delayed() -> RunSpec {
    let run = RunSpec { switch: SwitchSpec::delayed(1e-3), ..smoothed() };
    assert_eq!(run.validate(), Ok(()));
    run
}

const FUNNEL: FunnelSpec =
    FunnelSpec { shortest: 0.1, longest: 1.0, times: 100_000, horizon: 5.0, until_two_fold: true };

fn funnel() -> RunSpec {
    let switch = SwitchSpec::Filippov { exit: ExitRule::All, funnel: Some(FUNNEL) };
    let run = RunSpec { switch, observe: Observation::Path { chord: 1e-2 }, ..smoothed() };
    assert_eq!(run.validate(), Ok(()));
    run
}

fn refused(good: fn() -> RunSpec, cases: &[(Change, &str, &str)]) {
    for (i, (change, field, word)) in cases.iter().enumerate() {
        let mut run = good();
        change(&mut run);
        let error = run.validate().expect_err(&format!("case {i}, {field}: {word}"));
        assert!(
            error.field == *field && error.rule.contains(word),
            "case {i}, {field}, {word}: {error}"
        );
    }
}

const KICK: Kick = Kick { every: 0.3, size: 0.0, law: KickLaw::Sphere, seed: 1, stream: 0 };

fn extended(run: &mut RunSpec, precision: Option<u16>, order: Option<u16>, tolerance: f64) {
    let tolerance = Tolerance { rtol: tolerance, atol: tolerance };
    run.method =
        MethodSpec { name: Method::TaylorExtended, tolerance, precision, order, ..run.method };
}

#[test]
fn every_rule_of_a_smoothed_run_is_kept() {
    let cases: &[(Change, &str, &str)] = &[
        (|r| r.t_end = 0.0, "t-end", "above zero"),
        (|r| r.t_end = f64::INFINITY, "t-end", "finite"),
        (|r| r.t_end = f64::NAN, "t-end", "finite"),
        (|r| r.t_end = 1.1e12, "t-end", "no digits left"),
        (|r| r.start.truncate(2), "start", "one number for each"),
        (|r| r.start[2] = f64::NAN, "start", "finite"),
        (
            |r| r.system = cases::smooth(&["x", "mode", "z"], "x", &["1", "1", "1"]),
            "system",
            "rename the state",
        ),
        (
            |r| r.system = cases::smooth(&["x", "y", "arc"], "x", &["1", "1", "1"]),
            "system",
            "rename the state",
        ),
        (|r| r.switch = SwitchSpec::tanh(0.0), "eps", "above zero"),
        (|r| r.switch = SwitchSpec::tanh(f64::NAN), "eps", "finite"),
        (
            |r| {
                let transition = Transition::PerturbedTanh { sigma: f64::INFINITY };
                r.switch = SwitchSpec::Smoothed { eps: 1e-3, transition };
            },
            "sigma",
            "finite",
        ),
        (|r| r.switch = SwitchSpec::hysteretic(-1.0, Relaxation::Single), "eps", "above zero"),
        (|r| r.switch = hysteretic(0.0, 0.0), "eps-prime", "above zero"),
        (|r| r.switch = hysteretic(1e-2, f64::NAN), "phi0", "finite"),
        (|r| r.method.tolerance.rtol = 0.0, "rtol", "above zero"),
        (|r| r.method.tolerance.rtol = 9e-16, "rtol", "1e-15"),
        (|r| r.method.tolerance.atol = 0.0, "atol", "above zero"),
        (|r| r.method.tolerance.atol = 9e-141, "atol", "1e-140"),
        (|r| r.method.precision = Some(106), "precision", "leave it out"),
        (|r| r.method.order = Some(20), "order", "leave it out"),
        (|r| r.method.step_cap = StepCap::Absolute(0.0), "max-step", "above zero"),
        (
            |r| r.method.step_cap = StepCap::FractionOfSegment(f64::NAN),
            "max-step fraction",
            "finite",
        ),
        (|r| r.method.max_steps = 0, "max-steps", "at least one"),
        (|r| (r.method.name, r.method.tolerance.rtol) = (Method::Taylor, 9e-18), "rtol", "1e-17"),
        (|r| extended(r, None, None, 9e-33), "rtol", "1e-32"),
        (|r| extended(r, Some(106), None, 9e-33), "rtol", "1e-32"),
        (|r| extended(r, Some(192), None, 3e-58), "rtol", "raise the precision"),
        (|r| extended(r, Some(100), None, 1e-9), "precision", "one of these"),
        (|r| extended(r, None, Some(3), 1e-9), "order", "4 to 1000"),
        (|r| extended(r, None, Some(1001), 1e-9), "order", "4 to 1000"),
        (
            |r| {
                r.method.name = Method::Layered;
                r.switch = SwitchSpec::Smoothed { eps: 1e-3, transition: Transition::Arctan };
            },
            "method",
            "transition tanh",
        ),
        (
            |r| {
                r.method.name = Method::Layered;
                r.switch = SwitchSpec::hysteretic(1e-3, Relaxation::Single);
            },
            "method",
            "for smoothed systems",
        ),
        (|r| r.schedule.restart_every = Some(0.0), "restart", "above zero"),
        (|r| r.schedule.restart_every = Some(1.9e-8), "restart", "10^9"),
        (|r| r.schedule.kick = Some(Kick { every: -1.0, ..KICK }), "kick-every", "above zero"),
        (|r| r.schedule.kick = Some(Kick { every: 1.9e-8, ..KICK }), "kick-every", "10^9"),
        (|r| r.schedule.kick = Some(Kick { size: -1.0, ..KICK }), "kick-size", "zero or above"),
        (
            |r| r.schedule.kick = Some(Kick { size: f64::INFINITY, ..KICK }),
            "kick-size",
            "zero or above",
        ),
        (|r| r.observe = Observation::Path { chord: 0.0 }, "chord", "above zero"),
        (|r| r.observe = Observation::Times { every: 0.0 }, "every", "above zero"),
        (|r| r.observe = Observation::Times { every: 1.9e-14 }, "every", "cannot count"),
        (
            |r| r.observe = Observation::Section { coordinate: 3, value: 0.0 },
            "section",
            "count from 0",
        ),
        (
            |r| r.observe = Observation::Section { coordinate: 2, value: f64::NAN },
            "section",
            "finite",
        ),
    ];
    refused(smoothed, cases);
}

fn hysteretic(eps_prime: f64, phi0: f64) -> SwitchSpec {
    SwitchSpec::Hysteretic { eps: 1e-3, eps_prime, relaxation: Relaxation::Single, phi0 }
}

#[test]
fn what_lies_on_an_edge_is_allowed() {
    let cases: [Change; 15] = [
        |r| r.t_end = 1e12,
        |r| r.switch = hysteretic(1e-2, -3.0),
        |r| r.method.tolerance = Tolerance { rtol: 1e-15, atol: 1e-140 },
        |r| (r.method.name, r.method.tolerance.rtol) = (Method::Taylor, 1e-17),
        |r| extended(r, None, Some(4), 1e-32),
        |r| extended(r, Some(106), Some(1000), 1e-32),
        |r| extended(r, Some(192), None, finest_extended(192)),
        // Below 1e-140, which is no rule for numbers of many bits.
        |r| extended(r, Some(192), None, finest_extended(192)),
        |r| r.method.name = Method::Layered,
        |r| r.schedule.restart_every = Some(2.1e-8),
        |r| r.schedule.kick = Some(Kick { every: 2.1e-8, ..KICK }),
        |r| r.observe = Observation::Times { every: 2.1e-14 },
        |r| r.observe = Observation::Section { coordinate: 2, value: -1.0 },
        |r| r.method.max_steps = 1,
        |r| {
            r.switch = SwitchSpec::Smoothed {
                eps: 1e-3,
                transition: Transition::PerturbedTanh { sigma: -1.0 },
            }
        },
    ];
    for (i, change) in cases.iter().enumerate() {
        let mut run = smoothed();
        change(&mut run);
        assert_eq!(run.validate(), Ok(()), "case {i}");
    }
}

fn exit(run: &mut RunSpec, exit: ExitRule) {
    run.switch = SwitchSpec::Filippov { exit, funnel: None };
}

/// Moves on straight lines, switches at x = 0 and at y = 0.
fn two_surfaces() -> System {
    let field = "plus = ['1', '2', '0']\nminus = ['1', '2', '0']\n";
    cases::of(&format!("states = ['x', 'y', 'z']\nh = 'x'\n{field}[second]\nh = 'y'\n{field}"))
}

#[test]
fn every_rule_of_a_filippov_run_is_kept() {
    let law = SlidingLaw::Exponential { mean: 0.5 };
    assert!(ExitRule::Random { law, plus_probability: 1.0, seed: 1, stream: 0 }.validate().is_ok());
    let cases: &[(Change, &str, &str)] = &[
        (|r| exit(r, ExitRule::AfterTime { time: -1.0, side: Side::Plus }), "exit", "not below 0"),
        (
            |r| exit(r, ExitRule::AfterArc { arc: f64::NAN, side: Side::Plus }),
            "exit",
            "not below 0",
        ),
        (
            |r| {
                let law = SlidingLaw::Uniform { longest: 1.0 };
                exit(r, ExitRule::Random { law, plus_probability: 1.1, seed: 1, stream: 0 });
            },
            "exit",
            "between 0 and 1",
        ),
        (|r| exit(r, ExitRule::All), "exit", "go together"),
        (
            |r| {
                let exit = ExitRule::AtOnce { side: Side::Plus };
                r.switch = SwitchSpec::Filippov { exit, funnel: Some(FUNNEL) };
            },
            "exit",
            "go together",
        ),
        (|r| r.method.name = Method::Lsoda, "method", "by dopri5"),
        (|r| r.schedule.restart_every = Some(1.0), "switch", "leave them out"),
        (|r| r.schedule.kick = Some(KICK), "switch", "leave them out"),
    ];
    refused(filippov, cases);
    fn with(run: &mut RunSpec, funnel: FunnelSpec) {
        run.switch = SwitchSpec::Filippov { exit: ExitRule::All, funnel: Some(funnel) };
    }
    let cases: &[(Change, &str, &str)] = &[
        (|r| with(r, FunnelSpec { shortest: 0.0, ..FUNNEL }), "funnel-shortest", "above zero"),
        (|r| with(r, FunnelSpec { longest: f64::NAN, ..FUNNEL }), "funnel-longest", "finite"),
        (|r| with(r, FunnelSpec { horizon: -1.0, ..FUNNEL }), "funnel-horizon", "above zero"),
        (|r| with(r, FunnelSpec { times: 0, ..FUNNEL }), "funnel-times", "1 to 100000"),
        (|r| with(r, FunnelSpec { times: 100_001, ..FUNNEL }), "funnel-times", "1 to 100000"),
        (|r| r.observe = SECTION, "exit", "leave out --section"),
        (|r| r.observe = Observation::Times { every: 1.0 }, "exit", "leave out --every"),
        (|r| r.system = two_surfaces(), "exit", "has two"),
    ];
    refused(funnel, cases);
    let two = || RunSpec { system: two_surfaces(), ..filippov() };
    assert_eq!(two().validate(), Ok(()));
    let hysteresis: Change = |r| r.switch = SwitchSpec::hysteretic(1e-3, Relaxation::Single);
    refused(two, &[(hysteresis, "switch", "this one has two")]);
}

#[test]
fn every_rule_of_a_relays_run_is_kept() {
    fn relay() -> RunSpec {
        let switch = SwitchSpec::Relay { band: 0.3, inside: Inside::Minus };
        let run = RunSpec { switch, start: vec![-0.3, 0.0, -1.0], ..smoothed() };
        assert_eq!(run.validate(), Ok(()));
        run
    }
    let cases: &[(Change, &str, &str)] = &[
        (|r| r.switch = SwitchSpec::relay(0.0), "band", "above zero"),
        (|r| r.switch = SwitchSpec::relay(f64::INFINITY), "band", "finite"),
        (|r| r.system = two_surfaces(), "switch", "this one has two"),
        (|r| r.start[0] = -0.31, "inside", "outside the band"),
        (|r| r.method.name = Method::Lsoda, "method", "taylor-extended"),
        (|r| r.method.name = Method::Layered, "method", "taylor-extended"),
        (|r| extended(r, Some(192), None, 1e-30), "precision", "106 bits"),
    ];
    refused(relay, cases);
    let outside = RunSpec { switch: SwitchSpec::relay(0.29), ..relay() };
    assert_eq!(outside.validate(), Ok(()));
}

#[test]
fn every_rule_of_a_delayed_run_is_kept() {
    fn smooth(run: &mut RunSpec, eps: Option<f64>, transition: Option<Transition>) {
        run.switch = SwitchSpec::Delayed { delay: 1e-3, eps, transition, history: History::Flow };
    }
    let cases: &[(Change, &str, &str)] = &[
        (|r| r.switch = SwitchSpec::delayed(0.0), "delay", "above zero"),
        (|r| r.switch = SwitchSpec::delayed(f64::NAN), "delay", "finite"),
        (|r| r.t_end = 1e-3, "delay", "below the end time"),
        (|r| r.switch = SwitchSpec::delayed(1e-17), "delay", "too coarse"),
        (|r| r.t_end = 1e10, "delay", "too coarse"),
        (|r| r.system = two_surfaces(), "switch", "this one has two"),
        (|r| smooth(r, Some(0.0), Some(Transition::Erf)), "eps", "above zero"),
        (|r| smooth(r, Some(1e-3), None), "transition", "both"),
        (|r| smooth(r, None, Some(Transition::Erf)), "transition", "neither"),
        (
            |r| smooth(r, Some(1e-3), Some(Transition::PerturbedTanh { sigma: f64::NAN })),
            "sigma",
            "finite",
        ),
        (|r| r.method.name = Method::Lsoda, "method", "taylor-extended"),
        (|r| r.method.name = Method::Radau5, "method", "taylor-extended"),
        (
            |r| {
                smooth(r, Some(1e-3), Some(Transition::Erf));
                r.method.name = Method::Taylor;
            },
            "method",
            "radau5",
        ),
        (|r| extended(r, Some(192), None, 1e-30), "precision", "106 bits"),
        (|r| r.schedule.restart_every = Some(1e-3), "restart", "longer than the delay"),
        (
            |r| r.schedule.kick = Some(Kick { every: 1e-4, ..KICK }),
            "kick-every",
            "longer than the delay",
        ),
    ];
    refused(delayed, cases);
    let fine: [Change; 4] = [
        |r| extended(r, Some(106), Some(40), 1e-30),
        |r| r.schedule.restart_every = Some(2e-3),
        |r| {
            smooth(r, Some(1e-3), Some(Transition::Erf));
            r.method.name = Method::Radau5;
        },
        |r| smooth(r, None, None),
    ];
    for (i, change) in fine.iter().enumerate() {
        let mut run = delayed();
        change(&mut run);
        assert_eq!(run.validate(), Ok(()), "case {i}");
    }
}

#[test]
fn default_tolerances_follow_small_states() {
    let of = |start: &[f64]| in_units_of(Tolerance { rtol: 1e-8, atol: 1e-8 }, start);
    for start in [&[0.2, 0.0, -1.0][..], &[0.0, 0.0], &[1e9], &[2e-3]] {
        assert_eq!(of(start), Tolerance { rtol: 1e-8, atol: 1e-8 });
    }
    for (size, unit) in [(3e-4, 1e-4), (1.5e-9, 1e-9), (-7e-30, 1e-30)] {
        assert!((of(&[size, 0.0]).atol / unit - 1e-8).abs() < 1e-20, "{size}");
        assert_eq!(of(&[size, 0.0]).rtol, 1e-8);
    }
}

/// 106 bits hold 32 digits; more bits, their last one beside a leading 1.
#[test]
fn the_finest_tolerance_is_the_last_bit() {
    let power = |k: i32| 2.0_f64.powi(k);
    for (bits, finest) in [(53, 1e-32), (106, 1e-32), (192, power(-191)), (999, power(-191))] {
        assert_eq!(finest_extended(bits), finest, "{bits} bits");
    }
    // Half of the digits of a double (53 bits are 15.95 of them).
    let half = MethodSpec::defaults(Method::Lsoda).tolerance;
    assert!(
        half.rtol == half.atol && (-half.rtol.log10() - 0.5 * 53.0 * 2.0_f64.log10()).abs() < 1e-4
    );
    let finest = MethodSpec::defaults(Method::TaylorExtended).tolerance;
    assert_eq!(finest, Tolerance { rtol: 1e-32, atol: 1e-32 });
}
