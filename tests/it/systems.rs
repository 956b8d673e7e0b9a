//! A user's system, from a file to recorded data, in any dimension.
#![cfg(feature = "cli")]
#![allow(clippy::disallowed_methods)] // compared with tolerances, not with hashes

use std::fs;

use assert_cmd::Command;
use twofold::integrate::filippov::{ExitRule, Side};
use twofold::integrate::{Kick, KickLaw, Schedule, Tolerance};
use twofold::job::spec::*;
use twofold::job::{Executor, LargestExponent, Run};
use twofold::system::{Caricature, Definition, Relaxation, System};

/// Uncoupled oscillators x_i' = v_i, v_i' = -x_i, `n` states, switched by a coordinate of their own
/// decay.
fn rotors(n: usize) -> System {
    let names: Vec<String> = (0..n).map(|i| format!("x{i}")).collect();
    let rate = |i: usize, sign: &str| match i {
        i if i % 2 == 1 => format!("\"-x{}\"", i - 1),
        i if i + 1 < n => format!("\"x{}\"", i + 1),
        _ => format!("\"{sign}\""),
    };
    let field = |sign: &str| (0..n).map(|i| rate(i, sign)).collect::<Vec<_>>().join(", ");
    let quoted: Vec<String> = names.iter().map(|n| format!("\"{n}\"")).collect();
    let text = format!(
        "states = [{}]\nh = \"x0 - 10\"\nplus = [{}]\nminus = [{}]",
        quoted.join(", "),
        field("-1"),
        field("1")
    );
    System::new(Definition::from_toml(&text, "rotors.toml").unwrap_or_else(|e| panic!("{e}")))
}

fn question(system: System, switch: SwitchSpec, observe: Observation) -> RunSpec {
    let start = (0..system.dimension()).map(|i| if i % 2 == 0 { 1.0 } else { 0.0 }).collect();
    let mut method = MethodSpec::ndsolve_defaults(Method::Dopri5);
    method.tolerance = Tolerance { rtol: 1e-11, atol: 1e-11 };
    RunSpec { system, switch, start, t_end: 6.0, method, schedule: Schedule::default(), observe }
}

#[test]
fn every_dimension_by_every_switch() {
    for n in 1..=4 {
        let switches = [
            SwitchSpec::tanh(1e-3),
            // phi starts where h says: below the surface.
            SwitchSpec::Hysteretic {
                eps: 1e-3,
                eps_prime: 1e-2,
                relaxation: Relaxation::Single,
                phi0: 0.0,
            },
            SwitchSpec::delayed(1e-2),
            SwitchSpec::relay(1e-2),
            SwitchSpec::Filippov { exit: ExitRule::AtOnce { side: Side::Plus }, funnel: None },
        ];
        for switch in switches {
            let spec = question(rotors(n), switch, Observation::Path { chord: 1e-2 });
            let answer =
                Executor::quiet().ask(&Run(spec.clone())).unwrap_or_else(|e| panic!("{n}: {e}"));
            let state: Vec<f64> = answer.fact("state").unwrap();
            assert_eq!(state.len(), n);
            for i in (0..n / 2 * 2).step_by(2) {
                let (c, s) = (6.0_f64.cos(), 6.0_f64.sin());
                assert!(
                    (state[i] - c).abs() < 1e-8 && (state[i + 1] + s).abs() < 1e-8,
                    "{n} {switch:?} {state:?}"
                );
            }
            if n % 2 == 1 {
                // Below the surface at x0 = 10: the last one grows at rate 1, until it is x0 itself
                // that is switched.
                let want = 7.0;
                assert!((state[n - 1] - want).abs() < 1e-8, "{n} {switch:?} {state:?}");
            }
            let table = &answer.tables[0];
            assert!(table.len() > 2 && table.column(&format!("x{}", n - 1)).is_some());
            // The question comes back from JSON, and asks the same.
            let json = serde_json::to_string(&spec).unwrap();
            assert_eq!(serde_json::from_str::<RunSpec>(&json).unwrap(), spec);
        }
    }
}

#[test]
fn every_method_takes_data() {
    for name in Method::ALL {
        let mut spec = question(
            rotors(4),
            SwitchSpec::tanh(1e-3),
            Observation::Section { coordinate: 1, value: 0.0 },
        );
        spec.method.name = name;
        let answer = Executor::quiet().ask(&Run(spec)).unwrap_or_else(|e| panic!("{name:?}: {e}"));
        let section = answer.table("section").unwrap();
        // x1 = -sin t is zero at pi (upwards).
        let t = section.numbers("t");
        assert!(t.iter().any(|t| (t - std::f64::consts::PI).abs() < 1e-7), "{name:?} {t:?}");
    }
}

#[test]
fn fast_paths_give_the_bits_of_the_record() {
    // Names decide nothing about numbers: with its states renamed, the caricature takes the
    // recorded path.
    let text = twofold::system::library::text("caricature").unwrap();
    let renamed = text
        .replace("[\"x\", \"y\", \"z\"]", "[\"x\", \"y\", \"zz\"]")
        .replace("axes = [\"y\", \"z\", \"x\"]", "")
        .replace("[\"z\"", "[\"zz\"")
        .replace("z^2", "zz^2")
        .replace("beta*z", "beta*zz");
    let recorded =
        System::new(Definition::from_toml(&renamed, "f").unwrap_or_else(|e| panic!("{e}")));
    assert_eq!(recorded.compiled(), None);
    let compiled = System::from(Caricature::with_reinjection(0.1, 1e-5));
    let kick = Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 1, stream: 0 };
    for switch in [
        SwitchSpec::tanh(1e-3),
        SwitchSpec::hysteretic(1e-2, Relaxation::Literal),
        SwitchSpec::Filippov { exit: ExitRule::AtOnce { side: Side::Plus }, funnel: None },
    ] {
        let bits = |system: &System| {
            let mut spec = question(
                system.clone(),
                switch,
                Observation::Section { coordinate: 1, value: 0.0 },
            );
            (spec.start, spec.t_end) = (vec![0.2, 0.0, -1.0], 60.0);
            if !matches!(switch, SwitchSpec::Filippov { .. }) {
                spec.schedule = Schedule { restart_every: Some(20.0), kick: Some(kick) };
            }
            let answer = Executor::quiet().ask(&Run(spec)).unwrap();
            let section = answer.table("section").unwrap();
            let numbers = |i: usize| {
                section.numbers(&section.columns[i].name).iter().map(|v| v.to_bits()).collect()
            };
            (0..4).map(numbers).collect::<Vec<Vec<u64>>>()
        };
        let (a, b) = (bits(&compiled), bits(&recorded));
        assert!(a[0].len() > 1, "{switch:?}");
        assert_eq!(a, b, "{switch:?}");
    }
    let exponent = |system: &System| {
        let settings = twofold::analyse::lyapunov::LyapunovOptions {
            transient: 5.0,
            duration: 40.0,
            ..Default::default()
        };
        let start = vec![0.2, 0.0, -1.0];
        let question = LargestExponent {
            system: system.clone(),
            switch: SwitchSpec::tanh(1e-2),
            start,
            settings,
        };
        Executor::quiet().ask(&question).unwrap().facts.clone()
    };
    assert_eq!(exponent(&compiled), exponent(&recorded));
}

#[test]
fn exponents_of_data() {
    // Two rotors and a decay: the largest exponent of x' = -x/2 beside rotations is 0; of the decay
    // alone -1/2.
    let text = "states = [\"x\"]\nh = \"x - 100\"\nplus = [\"-x/2\"]\nminus = [\"-x/2\"]";
    let system = System::new(Definition::from_toml(text, "f").unwrap());
    let settings = twofold::analyse::lyapunov::LyapunovOptions {
        transient: 1.0,
        duration: 50.0,
        ..Default::default()
    };
    let question =
        LargestExponent { system, switch: SwitchSpec::tanh(1e-3), start: vec![1.0], settings };
    let exponent: twofold::analyse::lyapunov::Exponent =
        Executor::quiet().ask(&question).unwrap().fact("exponent").unwrap();
    assert!((exponent.value + 0.5).abs() < 1e-7, "{exponent:?}");
}

#[test]
fn wrong_specs_are_refused() {
    let refused = |change: &dyn Fn(&mut RunSpec)| {
        let mut spec =
            question(rotors(2), SwitchSpec::tanh(1e-3), Observation::Path { chord: 1e-2 });
        change(&mut spec);
        spec.validate().unwrap_err().to_string()
    };
    assert!(refused(&|s| s.start = vec![1.0]).contains("one number for each"));
    assert!(refused(&|s| s.start[1] = f64::NAN).contains("finite"));
    assert!(
        refused(&|s| s.observe = Observation::Section { coordinate: 2, value: 0.0 })
            .contains("count from 0")
    );
    assert!(
        refused(&|s| s.system = Caricature::with_reinjection(f64::NAN, 0.0).into())
            .contains("start is")
    );
    let named = |state: &str| {
        let text =
            format!("states = [\"{state}\"]\nh = \"{state}\"\nplus = [\"1\"]\nminus = [\"1\"]");
        System::new(Definition::from_toml(&text, "f").unwrap())
    };
    let message = refused(&|s| (s.system, s.start) = (named("t"), vec![0.0]));
    assert!(message.contains("rename the state"), "{message}");
}

fn twofold(arguments: &[&str]) -> (i32, String, String) {
    let out = Command::cargo_bin("twofold").unwrap().args(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (out.status.code().unwrap(), text(out.stdout), text(out.stderr))
}

#[test]
fn a_file_on_the_command_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("my.toml");
    let good = "states = [\"x\", \"v\"]\nstart = [1, 0]\nh = \"x + gain*v\"\nplus = \
        [\"v\", \"-1\"]\nminus = [\"v\", \"1\"]\n[parameters]\ngain = 1\n";
    fs::write(&file, good).unwrap();
    let file = file.to_str().unwrap();
    let common = ["--quiet", "--switch", "filippov", "--exit", "at-once:plus", "--t-end", "5"];
    let run = |more: &[&str]| twofold(&[&["run", "--system", file][..], &common, more].concat());
    // Slides to the origin, v = -x/gain: x = exp(-(t - t_0)/gain).
    let (code, out, err) = run(&["--set", "gain=2"]);
    assert_eq!((code, err.as_str()), (0, ""));
    let lines: Vec<&str> = out.lines().collect();
    assert!(lines[0].starts_with("t,x,v,mode"), "{}", lines[0]);
    let last: Vec<f64> =
        lines[lines.len() - 2].split(',').take(3).map(|v| v.parse().unwrap()).collect();
    assert!((last[0] - 5.0).abs() < 1e-12 && (last[1] + 2.0 * last[2]).abs() < 1e-7, "{last:?}");
    // The run's own description gives the same bytes.
    let (_, spec, _) = run(&["--set", "gain=2", "--print-spec"]);
    let stored = folder.path().join("spec.json");
    fs::write(&stored, &spec).unwrap();
    let (code, again, err) = twofold(&["run", "--quiet", "--spec", stored.to_str().unwrap()]);
    assert_eq!((code, err.as_str()), (0, ""));
    assert_eq!(again, out);

    let problem = |more: &[&str], expected: &[&str]| {
        let (code, _, err) = run(more);
        assert_ne!(code, 0);
        for e in expected {
            assert!(err.contains(e), "{e}: {err}");
        }
    };
    problem(&["--set", "gian=2"], &["--set \"gian=2\"", "did you mean `gain`?"]);
    problem(&["--set", "gain"], &["there is no \"=\""]);
    problem(&["--set", "gain=two"], &["not a decimal number"]);
    problem(&["--start", "1,2,3"], &["--start: 3 given, 2 wanted, a number for each of x, v"]);
    problem(&["--alpha", "0.1"], &["--alpha", "belongs to the caricature"]);
    problem(&["--section", "y=0"], &["no such coordinate", "x, v"]);
    fs::write(file, good.replace("gain*v", "gian*v")).unwrap();
    problem(&[], &["unknown name `gian`", "my.toml:3:10", "    ^^^^", "did you mean `gain`?"]);
    let (code, _, err) = twofold(&["run", "--system", "caricatur"]);
    assert!(code != 0 && err.contains("did you mean caricature?"), "{err}");
    let (code, _, err) = twofold(&["run", "--system", "absent.toml"]);
    assert!(code != 0 && err.contains("absent.toml"), "{err}");
}
