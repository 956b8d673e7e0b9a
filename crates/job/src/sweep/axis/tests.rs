use super::*;

fn values(text: &str) -> Vec<Entry> {
    let axis: Axis = text.parse().unwrap();
    assert_eq!(axis.to_string().parse::<Axis>().unwrap(), axis);
    let json = serde_json::to_string(&axis).unwrap();
    assert_eq!(serde_json::from_str::<Axis>(&json).unwrap(), axis);
    (0..axis.count()).map(|i| axis.value(i, 0.5)).collect()
}

#[test]
fn every_form_has_its_values() {
    let numbers = |v: &[f64]| v.iter().map(|x| Entry::Number(*x)).collect::<Vec<_>>();
    assert_eq!(values("interval=20,40,100"), numbers(&[20.0, 40.0, 100.0]));
    assert_eq!(values("params.alpha=1e-3..1:log:4"), numbers(&[1e-3, 1e-2, 1e-1, 1.0]));
    assert_eq!(values("params.beta=1e-6..1e-3:log:13")[4..5], numbers(&[1e-5]));
    assert_eq!(values("start.x=-1..1:5"), numbers(&[-1.0, -0.5, 0.0, 0.5, 1.0]));
    assert_eq!(values("start.x=1..2:2"), numbers(&[1.0, 2.0]));
    assert_eq!(values("rtol=1e-3..1e-2:log:2"), numbers(&[1e-3, 1e-2]));
    assert_eq!(values("shift.x=1e-9*3"), numbers(&[1e-9, 2e-9, 3.0 * 1e-9]));
    assert_eq!(values("seed=7..9"), [7, 8, 9].map(Entry::Integer));
    assert_eq!(values("stream=3,1"), [3, 1].map(Entry::Integer));
    assert_eq!(values("method=lsoda,dopri5"), ["lsoda", "dopri5"].map(Entry::from));
    assert_eq!(values("shift.y=-1e-9..1e-9"), numbers(&[0.0]));
    assert_eq!(values("rtol=1e-10..1e-6:log"), numbers(&[1e-8]));
    // Written again with all of its digits.
    assert_eq!(values("params.beta=0.25,1e-5"), numbers(&[0.25, 1e-5]));
}

/// Values that only a file or a program can contain.
#[test]
fn values_that_do_not_fit_are_refused() {
    use Coordinate::{Method, Rtol, Seed};
    let whole = |from, to| Values::Whole { from, to };
    for (coordinate, values, word) in [
        (Rtol, Values::Numbers(vec![]), "finite numbers"),
        (Rtol, Values::Numbers(vec![1.0, f64::NAN]), "finite numbers"),
        (Rtol, Values::Names(vec!["lsoda".into()]), "give numbers"),
        (Rtol, whole(1, 2), "for seed and stream"),
        (Rtol, Values::Multiples { of: f64::NAN, count: 3 }, "finite number and a count"),
        (Rtol, Values::Linear { from: 0.0, to: f64::INFINITY, count: 3 }, "finite ends"),
        (Rtol, Values::Uniform { from: f64::NEG_INFINITY, to: 0.0 }, "lower and a higher"),
        (Method, Values::Names(vec![]), "methods among"),
        (Method, Values::Numbers(vec![1.0]), "by name"),
        (Seed, Values::Numbers(vec![]), "whole numbers"),
        (Seed, Values::Numbers(vec![1.0, 1.5]), "whole numbers"),
        (Seed, Values::Numbers(vec![-1.0]), "whole numbers"),
        (Seed, Values::Numbers(vec![1e16]), "whole numbers"),
        (Seed, Values::Uniform { from: 0.0, to: 1.0 }, "whole numbers"),
    ] {
        let error = Axis { coordinate, values }.validate().unwrap_err().to_string();
        assert!(error.contains(word), "{word}: {error}");
    }
    let last = i64::MAX as u64;
    assert_eq!(Axis { coordinate: Seed, values: whole(last, last) }.validate(), Ok(()));
}

/// An end with more digits than a grid's values are rounded to is hit exactly; so is 1/3 of a
/// range.
#[test]
fn grids_end_where_they_are_asked_to() {
    // And in binary 0.2 + (0.9 - 0.2) is not 0.9.
    for (from, to) in [(0.1 + 0.2, 1.1 * 1.1), (0.2, 0.9)] {
        let log = Axis { coordinate: Coordinate::Rtol, values: Values::Log { from, to, count: 4 } };
        let linear =
            Axis { coordinate: Coordinate::Rtol, values: Values::Linear { from, to, count: 4 } };
        for axis in [log, linear] {
            assert_eq!((axis.value(0, 0.0), axis.value(3, 0.0)), (from.into(), to.into()));
            assert!(axis.value(1, 0.0).value() > from && axis.value(2, 0.0).value() < to);
            assert_eq!((axis.count(), axis.is_random()), (4, false));
        }
    }
    let drawn = |u| "rtol=1e-4..1:log".parse::<Axis>().unwrap().value(0, u).value();
    assert!((drawn(0.25) - 1e-3).abs() < 1e-15 && (drawn(0.0) - 1e-4).abs() < 1e-16);
    let drawn = |u| "rtol=-1..3".parse::<Axis>().unwrap().value(0, u).value();
    assert_eq!([0.0, 0.25, 0.75].map(drawn), [-1.0, 0.0, 2.0]);
}

/// Every coordinate changes what it names, and that alone; and says so where it has no effect.
#[test]
fn coordinates_change_what_they_name() {
    use crate::spec::Observation;
    use twofold_integrate::filippov::{Side, SlidingLaw};
    use twofold_integrate::{Kick, KickLaw};
    use twofold_system::{Caricature, Relaxation};
    let section = Observation::Section { coordinate: 1, value: 0.0 };
    let system = Caricature::with_reinjection(0.1, 1e-5).into();
    let mut tanh = crate::cases::run(system, SwitchSpec::tanh(1e-3), 20.0, section);
    tanh.schedule.kick =
        Some(Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 9, stream: 5 });
    let hysteretic =
        RunSpec { switch: SwitchSpec::hysteretic(1e-3, Relaxation::Single), ..tanh.clone() };
    let law = SlidingLaw::Uniform { longest: 1.0 };
    let filippov = |exit| RunSpec {
        switch: SwitchSpec::Filippov { exit, funnel: None },
        ..hysteretic.clone()
    };
    let random =
        |seed, stream| filippov(ExitRule::Random { law, plus_probability: 0.5, seed, stream });
    let mut plain = filippov(ExitRule::AtOnce { side: Side::Plus });
    plain.schedule.kick = None;
    let arctan = RunSpec {
        switch: SwitchSpec::Smoothed { eps: 1e-3, transition: Transition::Arctan },
        ..plain.clone()
    };
    let delayed = RunSpec { switch: SwitchSpec::delayed(1e-3), ..plain.clone() };
    let relay = RunSpec { switch: SwitchSpec::relay(1e-3), ..plain.clone() };
    let changed = |run: &RunSpec, text: &str| {
        let axis: Axis = text.parse().unwrap();
        let mut run = run.clone();
        axis.coordinate
            .apply(&mut run, &axis.value(0, 0.5))
            .map(|()| serde_json::to_value(&run).unwrap())
    };
    type Change = fn(&mut RunSpec);
    let cases: [(&RunSpec, &str, Change); 24] = [
        (&tanh, "params.alpha=0.2", |r| r.system = Caricature::with_reinjection(0.2, 1e-5).into()),
        (&tanh, "start.y=7", |r| r.start[1] = 7.0),
        (&tanh, "shift.z=0.25", |r| r.start[2] = 1.25),
        (&tanh, "rtol=1e-6", |r| r.method.tolerance.rtol = 1e-6),
        (&tanh, "atol=1e-6", |r| r.method.tolerance.atol = 1e-6),
        (&tanh, "tolerance=1e-6", |r| {
            (r.method.tolerance.rtol, r.method.tolerance.atol) = (1e-6, 1e-6);
        }),
        (&tanh, "max-step=0.5", |r| r.method.step_cap = StepCap::Absolute(0.5)),
        (&tanh, "t-end=30", |r| r.t_end = 30.0),
        (&tanh, "interval=3", |r| r.schedule.restart_every = Some(3.0)),
        (&hysteretic, "interval=3", |r| r.schedule.restart_every = Some(3.0)),
        (&tanh, "eps=1e-2", |r| r.switch = SwitchSpec::tanh(1e-2)),
        (&hysteretic, "eps=1e-2", |r| {
            let SwitchSpec::Hysteretic { eps, .. } = &mut r.switch else { panic!() };
            *eps = 1e-2;
        }),
        (&hysteretic, "start.x=-1", |r| {
            let SwitchSpec::Hysteretic { phi0, .. } = &mut r.switch else { panic!() };
            (*phi0, r.start[0]) = (0.0, -1.0);
        }),
        (&hysteretic, "eps-prime=1e-4", |r| {
            let SwitchSpec::Hysteretic { eps_prime, .. } = &mut r.switch else { panic!() };
            *eps_prime = 1e-4;
        }),
        (&tanh, "sigma=0.5", |r| {
            r.switch = SwitchSpec::Smoothed {
                eps: 1e-3,
                transition: Transition::PerturbedTanh { sigma: 0.5 },
            };
        }),
        (&tanh, "kick-every=0.7", |r| r.schedule.kick.as_mut().unwrap().every = 0.7),
        (&tanh, "kick-size=0.7", |r| r.schedule.kick.as_mut().unwrap().size = 0.7),
        (&tanh, "seed=70", |r| r.schedule.kick.as_mut().unwrap().seed = 70),
        (&tanh, "stream=70", |r| r.schedule.kick.as_mut().unwrap().stream = 70),
        (&tanh, "method=radau5", |r| r.method.name = Method::Radau5),
        (&tanh, "method=lsoda,taylor", |r| r.method.name = Method::Lsoda),
        (&plain, "t-end=30", |r| r.t_end = 30.0),
        (&delayed, "delay=1e-2", |r| r.switch = SwitchSpec::delayed(1e-2)),
        (&relay, "band=1e-2", |r| r.switch = SwitchSpec::relay(1e-2)),
    ];
    for (run, text, change) in cases {
        let mut wanted = run.clone();
        change(&mut wanted);
        assert_eq!(changed(run, text), Ok(serde_json::to_value(&wanted).unwrap()), "{text}");
        assert_ne!(&wanted, run, "{text}");
    }
    // Two perturbed: the new one alone.
    let SwitchSpec::Smoothed { eps, .. } = tanh.switch else { panic!() };
    let sigma =
        |sigma| SwitchSpec::Smoothed { eps, transition: Transition::PerturbedTanh { sigma } };
    let perturbed = |s| serde_json::to_value(RunSpec { switch: sigma(s), ..tanh.clone() }).unwrap();
    assert_eq!(
        changed(&RunSpec { switch: sigma(0.25), ..tanh.clone() }, "sigma=0.5"),
        Ok(perturbed(0.5))
    );
    // A random exit rule and kicks share their seed.
    let (both, seeded) = (random(1, 2), changed(&random(1, 2), "seed=8").unwrap());
    let mut wanted = random(8, 2);
    wanted.schedule.kick.as_mut().unwrap().seed = 8;
    assert_eq!(seeded, serde_json::to_value(&wanted).unwrap());
    let mut alone = both;
    alone.schedule.kick = None;
    let wanted = RunSpec { schedule: alone.schedule, ..random(1, 8) };
    assert_eq!(changed(&alone, "stream=8"), Ok(serde_json::to_value(&wanted).unwrap()));
    for (run, text, word) in [
        (&tanh, "params.gamma=1", "gamma"),
        (&tanh, "start.q=1", "no state q"),
        (&tanh, "shift.q=1", "no state q"),
        (&plain, "interval=3", "restarts belong"),
        (&plain, "eps=1", "no eps"),
        (&delayed, "eps=1", "no eps"),
        (&tanh, "delay=1", "delayed switch"),
        (&relay, "eps=1", "no eps"),
        (&delayed, "band=1", "the relay"),
        (&tanh, "eps-prime=1", "hysteretic switch"),
        (&plain, "eps-prime=1", "hysteretic switch"),
        (&hysteretic, "sigma=1", "with tanh"),
        (&arctan, "sigma=1", "with tanh"),
        (&plain, "kick-size=1", "no kicks"),
        (&plain, "kick-every=1", "no kicks"),
        (&plain, "seed=1", "nothing in this run is random"),
        (&arctan, "stream=1", "nothing in this run is random"),
    ] {
        let why = changed(run, text).unwrap_err();
        assert!(why.contains(word), "{text}: {why}");
    }
}

#[test]
fn columns_are_of_the_values_kind() {
    for (text, unit, kind) in [
        ("method=lsoda", "", ColumnKind::Word),
        ("seed=1", "1", ColumnKind::Integer),
        ("stream=1..2", "1", ColumnKind::Integer),
        ("shift.x=1", "1", ColumnKind::Number),
    ] {
        let axis: Axis = text.parse().unwrap();
        let column = axis.column();
        let name = text.split('=').next().unwrap();
        assert_eq!((column.name.as_str(), column.unit.as_str(), column.kind()), (name, unit, kind));
    }
}

#[test]
fn nonsense_is_refused() {
    for (text, word) in [
        ("alpha", "="),
        ("alpha=1", "cannot be varied"),
        ("rtol=", "not a finite number"),
        ("rtol=1..2:1", "2 or more"),
        ("rtol=0..1:log:3", "above zero"),
        ("rtol=2..1", "lower"),
        ("seed=1.5", "whole"),
        ("seed=9..1", "rising"),
        ("method=euler", "lsoda"),
        ("shift.x=1*0", "count"),
        ("eps=inf", "not a finite number"),
        ("params.=1", "cannot be varied"),
        ("start.=1", "cannot be varied"),
        ("shift.=1", "cannot be varied"),
        ("rtol=1..1", "lower"),
        ("rtol=0..1:log", "above zero"),
        ("rtol=1..0:log:3", "above zero"),
        ("rtol=1..2:log:1", "2 or more"),
        ("rtol=1..2:3:4", "FROM..TO"),
        ("seed=0..9223372036854775808", "2^63"),
        ("seed=9007199254740993", "2^53"),
        ("seed=1*3", "whole"),
        ("method=", "lsoda"),
    ] {
        let error = text.parse::<Axis>().unwrap_err().to_string();
        assert!(error.contains(word), "{text}: {error}");
    }
}
