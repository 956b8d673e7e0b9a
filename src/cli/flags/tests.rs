use super::*;
use clap::{Args, FromArgMatches};

fn parse(arguments: &[&str]) -> RunFlags {
    let command = RunFlags::augment_args(clap::Command::new("x").no_binary_name(true));
    RunFlags::from_arg_matches(
        &command.try_get_matches_from(arguments).unwrap_or_else(|e| panic!("{e}")),
    )
    .unwrap()
}

/// Every flag with a value that no default has and that every run allows on which the flag has
/// an effect; several, if none differs from every default.
const SAMPLES: [(&str, &[&str]); 43] = [
    ("--system", &["wheel", "two-fold"]),
    ("--set", &["alpha=0.3", "omega0=1.1"]),
    ("--switch", &["smoothed", "hysteretic", "delayed", "relay", "filippov"]),
    ("--reading", &["reconstructed"]),
    ("--alpha", &["0.01"]),
    ("--beta", &["0.02"]),
    ("--v-plus", &["-1.3"]),
    ("--v-minus", &["-1.5"]),
    ("--delay", &["0.05"]),
    ("--history", &["flow"]),
    ("--band", &["0.4"]),
    ("--inside", &["minus"]),
    ("--eps", &["0.002"]),
    ("--transition", &["arctan"]),
    ("--sigma", &["0.1"]),
    ("--eps-prime", &["0.03"]),
    ("--hysteresis", &["single"]),
    ("--start", &["0.1,0.1,0.1"]),
    ("--t-start", &["1"]),
    ("--t-end", &["7"]),
    ("--method", &["radau5", "taylor"]),
    ("--rtol", &["2e-9"]),
    ("--atol", &["2e-9"]),
    ("--max-step", &["0.1"]),
    ("--max-steps", &["1000"]),
    ("--precision", &["192"]),
    ("--order", &["40"]),
    ("--restart", &["2"]),
    ("--kick-every", &["0.7"]),
    ("--kick-size", &["0.004"]),
    ("--kick-law", &["cube"]),
    ("--exit", &["at-once:plus", "after-arc:0.2:minus"]),
    ("--intersection", &["bilinear", "order:x,y"]),
    ("--plus-probability", &["0.4"]),
    ("--funnel-times", &["3"]),
    ("--funnel-shortest", &["0.1"]),
    ("--funnel-longest", &["1"]),
    ("--funnel-horizon", &["9"]),
    ("--seed", &["5"]),
    ("--stream", &["6"]),
    ("--section", &["x=0.1", "r=0.1"]),
    ("--chord", &["0.01"]),
    ("--every", &["0.25"]),
];

/// One run of each kind.
fn kinds() -> Vec<Vec<&'static str>> {
    let mut kinds = Vec::new();
    for system in [vec![], vec!["--system", "wheel"], vec!["--alpha", "0.1", "--beta", "0.1"]] {
        for switch in [
            vec![],
            vec!["--switch", "hysteretic"],
            vec!["--kick-every", "0.3"],
            vec!["--switch", "hysteretic", "--kick-every", "0.3"],
            vec!["--switch", "delayed", "--delay", "0.02"],
            vec!["--switch", "delayed", "--delay", "0.02", "--eps", "0.01"],
            vec!["--switch", "relay", "--band", "0.3"],
            vec!["--switch", "filippov", "--exit", "after-time:0.3:minus"],
            vec!["--switch", "filippov", "--exit", "random:exponential:0.5"],
            vec!["--switch", "filippov", "--exit", "all"],
        ] {
            for recording in [vec![], vec!["--section"]] {
                let mut kind = [system.clone(), switch.clone(), recording.clone()].concat();
                if !recording.is_empty() {
                    if kind.contains(&"all") {
                        continue;
                    }
                    kind.push(if kind.contains(&"wheel") { "v=0" } else { "y=0" });
                }
                kinds.push(kind);
            }
        }
    }
    kinds
}

#[test]
fn hysteresis_begins_on_the_side_of_the_start() {
    for (x, wanted) in [("0.2", 1.0), ("0", 1.0), ("-0.2", 0.0)] {
        let start = format!("--start={x},0,-1");
        let spec = parse(&["--switch", "hysteretic", &start]).spec(Use::Any).unwrap();
        let SwitchSpec::Hysteretic { phi0, .. } = spec.switch else { panic!() };
        assert_eq!(phi0, wanted, "{x}");
    }
}

#[test]
fn the_table_holds_every_flag() {
    let command = RunFlags::augment_args(clap::Command::new("x"));
    let mut flags: Vec<String> =
        command.get_arguments().filter_map(|a| a.get_long()).map(|l| format!("--{l}")).collect();
    flags.retain(|f| f != "--spec");
    assert_eq!(flags, EFFECTS.map(|e| e.flag));
    assert_eq!(flags, SAMPLES.map(|s| s.0));
}

/// Every flag on every kind of run, under both commands: refused by name, or the question
/// changes.
#[test]
fn no_flag_is_ignored_on_any_run() {
    let (mut tried, mut refused) = (0, 0);
    for command in [Use::Any, Use::Picture, Use::Crossings, Use::Orbit, Use::Exponent] {
        let mut kinds = kinds();
        kinds.extend([vec!["--every", "0.5"], vec!["--switch", "filippov", "--section", "y=0"]]);
        for kind in kinds {
            let Ok(plain) = parse(&kind).spec(command) else {
                // Refused by name as it stands; what these commands do take is among the
                // others.
                let fine = match command {
                    Use::Any | Use::Picture => {
                        kind.contains(&"filippov") && !kind.contains(&"--exit")
                    }
                    Use::Crossings => {
                        kind.contains(&"all")
                            || kind.contains(&"--every")
                            || !kind.contains(&"--exit")
                    }
                    Use::Orbit => {
                        let other = ["--kick-every", "--exit", "delayed", "relay"];
                        !kind.contains(&"--section") || kind.iter().any(|k| other.contains(k))
                    }
                    Use::Exponent => {
                        let other = ["all", "--section", "--every"];
                        kind.contains(&"--exit") || kind.iter().any(|k| other.contains(k))
                    }
                };
                assert!(fine, "{command:?} {kind:?}");
                continue;
            };
            for (flag, values) in SAMPLES.iter().filter(|(flag, _)| !kind.contains(flag)) {
                let mut changed = false;
                let mut errors = Vec::new();
                for value in *values {
                    match parse(&[&kind[..], &[flag, value]].concat()).spec(command) {
                        // A closed orbit has no method: of a spec it takes what its question
                        // holds.
                        Ok(spec) => changed |= spec != plain,
                        // The wheel has its own coordinates, and a change of system or switch
                        // asks for other flags: each error names what does not go together.
                        Err(error) => errors.push(error.to_string()),
                    }
                }
                tried += 1;
                refused += usize::from(!errors.is_empty());
                let named = |e: &String| {
                    e.contains(flag) || ["--switch", "--system"].contains(flag) && e.contains("--")
                };
                assert!(
                    changed || errors.len() == values.len(),
                    "{kind:?} {flag}: accepted without effect"
                );
                assert!(errors.iter().all(named), "{kind:?} {flag}: {errors:?}");
            }
        }
    }
    assert!(tried > 2500 && refused > 900, "{tried} pairs, {refused} refused");
}

/// Every flag beside every axis of a sweep: some row asks something else because of the flag,
/// or the flag is refused.
#[test]
fn no_flag_is_ignored_beside_an_axis() {
    use crate::job::sweep::Sweep;
    let axes = [
        "params.alpha=0.3,0.4",
        "params.beta=0.3,0.4",
        "params.v_plus=-2,-3",
        "start.x=1,2",
        "shift.x=1,2",
        "rtol=1e-5,1e-6",
        "atol=1e-5,1e-6",
        "tolerance=1e-5,1e-6",
        "max-step=1,2",
        "t-end=3,4",
        "interval=1,2",
        "eps=0.01,0.02",
        "eps-prime=0.01,0.02",
        "delay=0.01,0.02",
        "band=0.25,0.35",
        "sigma=0.3,0.4",
        "kick-every=1,2",
        "kick-size=1,2",
        "seed=1,2",
        "stream=1,2",
        "method=taylor,dopri5",
    ];
    let lists: Vec<Vec<Axis>> = axes
        .iter()
        .map(|a| vec![a.parse().unwrap()])
        .chain([vec![axes[0].parse().unwrap(), axes[1].parse().unwrap()]])
        .chain([["start.x=1", "start.y=1", "start.z=1"]
            .iter()
            .map(|a| a.parse().unwrap())
            .collect()])
        .collect();
    let rows = |flags: &RunFlags, over: &[Axis]| {
        let sweep = Sweep::new(flags.spec(Use::Crossings).ok()?, over.to_vec(), None).ok()?;
        Some((0..sweep.rows()).map(|row| sweep.question(row).map(|q| q.0.run)).collect::<Vec<_>>())
    };
    let (mut tried, mut refused) = (0, 0);
    for kind in kinds() {
        for over in &lists {
            let Some(plain) = rows(&parse(&kind), over) else { continue };
            for (flag, values) in SAMPLES.iter().filter(|(flag, _)| !kind.contains(flag)) {
                // A value may be the one that the run has anyway; a flag that is refused on its
                // own is another test's business.
                let (mut counts, mut works) = (false, false);
                for value in *values {
                    let with = parse(&[&kind[..], &[flag, value]].concat());
                    let same = |flags: &RunFlags| flags.spec(Use::Crossings).ok();
                    let Some(changed) = rows(&with, over) else { continue };
                    if same(&with) == same(&parse(&kind)) {
                        continue;
                    }
                    counts = true;
                    if let Some((named, _)) = with.replaced_by(over) {
                        refused += 1;
                        let said = changed == plain && named == *flag || kind.contains(&named);
                        assert!(said, "{kind:?} {flag} {over:?}: {named}");
                        works = true;
                    }
                    works |= changed != plain;
                }
                tried += usize::from(counts);
                assert!(works || !counts, "{kind:?} {flag} {over:?}: accepted without effect");
            }
        }
    }
    assert!(tried > 5000 && refused > 300, "{tried} tried, {refused} refused");
}

/// With a spec from a file every other flag is refused, whatever it is.
#[test]
fn nothing_stands_beside_a_spec() {
    for (flag, values) in SAMPLES {
        let error = parse(&["--spec", "nowhere.json", flag, values[0]])
            .spec(Use::Any)
            .unwrap_err()
            .to_string();
        assert!(error.contains(flag) && error.contains("--spec"), "{error}");
    }
}
