//! Switches with a past, delayed ones and relays, against formulas and against programs that share
//! nothing with this one but the equations.

#[allow(dead_code)] // the examples' own main functions
#[path = "../../papers/jeffrey-2013/examples/delay_growth.rs"]
mod delay_growth;
#[allow(dead_code)]
#[path = "../../papers/jeffrey-2013/examples/delay_runs.rs"]
mod delay_runs;

use std::process::Command;

use crate::claims::Reads;
use twofold::analyse::delay::LateRule;
use twofold::analyse::passage::Predicted;
use twofold::analyse::{Crossing, Direction};
use twofold::integrate::delay::{History, Inside};
use twofold::integrate::{Kick, KickLaw, Schedule, StepCap, Tolerance};
use twofold::jeffrey_2013::Reading;
use twofold::jeffrey_2013::delay;
use twofold::jeffrey_2013::study::claims::claims;
use twofold::jeffrey_2013::study::similarity::{Rule, Similar, WAYS};
use twofold::job::recording::Data;
use twofold::job::simulate::simulate;
use twofold::job::spec::*;
use twofold::job::{Executor, Run};
use twofold::num::elementary::{exp, ln};
use twofold::system::{Caricature, Definition, System, Transition};

fn spec(alpha: f64, switch: SwitchSpec, method: Method, tolerance: f64, t_end: f64) -> RunSpec {
    RunSpec {
        system: Caricature::with_reinjection(alpha, 1e-5).into(),
        switch,
        start: vec![0.2, 0.0, -1.0],
        t_end,
        method: MethodSpec {
            name: method,
            tolerance: Tolerance { rtol: tolerance, atol: tolerance },
            step_cap: StepCap::None,
            max_steps: 1_000_000,
            precision: None,
            order: None,
        },
        schedule: Schedule::default(),
        observe: Observation::Section { coordinate: 1, value: 0.0 },
    }
}

fn crossings(spec: &RunSpec) -> Vec<Crossing> {
    match simulate(spec, &()).unwrap().data {
        Data::Section(crossings) => crossings,
        _ => unreachable!("a section was asked for"),
    }
}

fn numbers(text: &str) -> impl Iterator<Item = Vec<&str>> {
    text.lines()
        .filter(|l| l.starts_with(|c: char| c.is_ascii_digit()))
        .map(|l| l.split(',').collect())
}

/// The distance of the first `rows` crossings from a reference's, by time, x and z, the largest.
fn apart(found: &[Crossing], reference: &str, rows: usize) -> f64 {
    let mut worst = 0.0_f64;
    assert!(found.len() >= rows, "{} crossings", found.len());
    for (c, row) in found.iter().zip(numbers(reference).take(rows)) {
        let n = |i: usize| row[i].parse::<f64>().unwrap();
        assert_eq!(c.direction == Direction::Up, row[3] == "up");
        for (a, b) in [(c.t, n(0)), (c.x[0], n(1)), (c.x[2], n(2))] {
            worst = worst.max((a - b).abs() / b.abs().max(1.0));
        }
    }
    worst
}

const RECONSTRUCTED: &str = include_str!("../data/delay-sharp-reconstructed.csv");
const PRINTED: &str = include_str!("../data/delay-sharp-printed.csv");

/// Before the two-fold: a method is as far from 113 bits as its tolerance says.
#[test]
fn crossings_before_the_two_fold_are_those_of_113_bits() {
    for (alpha, text, rows, t_end) in [(1e-1, RECONSTRUCTED, 2, 5.0), (1e-3, PRINTED, 4, 30.0)] {
        for (method, tolerance, allowed) in [
            (Method::Dopri5, 1e-9, 1e-7),
            (Method::Dopri5, 1e-12, 1e-10),
            (Method::Taylor, 1e-16, 1e-12),
        ] {
            let found =
                crossings(&spec(alpha, SwitchSpec::delayed(1e-3), method, tolerance, t_end));
            let worst = apart(&found, text, rows);
            assert!(worst < allowed, "{method:?} {tolerance}: {worst:e}");
        }
    }
}

/// Through the two-fold and out again, in double-double arithmetic: all rows to 13.4, after 2,900
/// switches, to the rounding of the section's f64.
#[test]
fn double_double_follows_113_bits_through_the_two_fold() {
    let found =
        crossings(&spec(1e-1, SwitchSpec::delayed(1e-3), Method::TaylorExtended, 1e-30, 13.4));
    let worst = apart(&found, RECONSTRUCTED, 9);
    assert!(found.len() == 9 && worst < 1e-14, "{worst:e}");
}

/// SciPy's DOP853 as a method of steps (scripts/delay_reference.py). The orbit magnifies an error
/// by some 10^3 until t = 12, as the reference's own uncertainty shows.
#[test]
fn the_smooth_rule_agrees_with_scipy() {
    let rows: Vec<Vec<f64>> = numbers(include_str!("../data/delay-smooth.csv"))
        .map(|row| row.iter().map(|cell| cell.parse().unwrap()).collect())
        .collect();
    assert_eq!(rows.len(), 24);
    for case in rows.chunks(12) {
        let (delay, eps) = (case[0][0], Some(case[0][1]));
        let (transition, history) = (Some(Transition::Tanh), History::Constant);
        let switch = SwitchSpec::Delayed { delay, eps, transition, history };
        for (method, tolerance, allowed) in [
            (Method::Dopri5, 1e-8, 1e-5),
            (Method::Dopri5, 1e-11, 1e-8),
            (Method::Radau5, 1e-9, 1e-6),
        ] {
            let observe = Observation::Times { every: 1.0 };
            let run = RunSpec { observe, ..spec(1e-1, switch, method, tolerance, 12.0) };
            let Data::Path(found) = simulate(&run, &()).unwrap().data else {
                unreachable!("times were asked for")
            };
            for (sample, row) in found[1..].iter().zip(case) {
                let worst = (0..3).map(|i| (sample.x[i] - row[3 + i]).abs()).fold(0.0, f64::max);
                assert!(
                    worst < allowed + row[6],
                    "{delay} {method:?} {tolerance} at {}: {worst:e}",
                    sample.t
                );
            }
        }
    }
}

/// The same bytes however the run is asked for and whatever looks on; the answer names the history.
#[test]
fn an_answer_is_its_questions() {
    let run = spec(1e-1, SwitchSpec::delayed(1e-2), Method::Dopri5, 1e-9, 12.0);
    let answer = Executor::quiet().ask(&Run(run.clone())).unwrap();
    assert_eq!(answer.fact::<String>("history").unwrap(), "constant");
    let json = serde_json::to_value(&run).unwrap();
    assert_eq!(
        json["switch"],
        serde_json::json!({ "delayed": { "delay": 1e-2, "history": "constant" } })
    );
    let again: RunSpec = serde_json::from_value(json).unwrap();
    assert_eq!(*Executor::quiet().ask(&Run(again)).unwrap(), *answer);
    // A question without a delay has no word of one.
    let smoothed =
        serde_json::to_string(&spec(1e-1, SwitchSpec::tanh(1e-3), Method::Dopri5, 1e-9, 12.0))
            .unwrap();
    assert!(!smoothed.contains("delay") && !smoothed.contains("history"));
}

/// Kicks and restarts; those that are asked for before the switch has seen the start are refused.
#[test]
fn kicks_and_restarts_are_as_with_other_switches() {
    for switch in [
        SwitchSpec::delayed(1e-2),
        SwitchSpec::relay(1e-2),
        SwitchSpec::Delayed {
            delay: 1e-2,
            eps: Some(1e-2),
            transition: Some(Transition::Tanh),
            history: History::Flow,
        },
    ] {
        let plain = spec(1e-1, switch, Method::Dopri5, 1e-11, 6.0);
        let schedule = Schedule { restart_every: Some(0.37), kick: None };
        let (a, b) = (
            simulate(&plain, &()).unwrap(),
            simulate(&RunSpec { schedule, ..plain.clone() }, &()).unwrap(),
        );
        assert!((0..3).all(|i| (a.x[i] - b.x[i]).abs() < 1e-8), "{:?} {:?}", a.x, b.x);
        let kick = Kick { every: 0.3, size: 1e-2, law: KickLaw::Sphere, seed: 1, stream: 0 };
        let kicked = RunSpec {
            schedule: Schedule { restart_every: None, kick: Some(kick) },
            ..plain.clone()
        };
        let c = simulate(&kicked, &()).unwrap();
        assert!(
            (0..3).any(|i| (a.x[i] - c.x[i]).abs() > 1e-3) && c.x.iter().all(|x| x.abs() < 5.0),
            "{:?}",
            c.x
        );
    }
}

/// The thermostat of systems/general/relay-hysteresis.toml, as a relay: the period that its file
/// states.
#[test]
fn a_thermostat_has_its_period() {
    let text = "states = ['T']\nh = 'T - 20'\nplus = ['0.1*(10 - T)']\nminus = ['0.1*(30 - T)']";
    let system = System::new(Definition::from_toml(text, "").unwrap());
    let period = 2.0 * ln(12.0 / 8.0) / 0.1;
    for (method, tolerance) in
        [(Method::Dopri5, 1e-12), (Method::Taylor, 1e-15), (Method::TaylorExtended, 1e-30)]
    {
        let observe = Observation::Section { coordinate: 0, value: 20.0 };
        let run = spec(1e-1, SwitchSpec::relay(2.0), method, tolerance, 50.0);
        let run = RunSpec { system: system.clone(), start: vec![18.0], observe, ..run };
        let answer = Executor::quiet().ask(&Run(run)).unwrap();
        let table = answer.table("section").unwrap();
        let t = table.numbers("t");
        assert!(
            t.len() > 9 && t.windows(3).all(|t| (t[2] - t[0] - period).abs() < 1e-9),
            "{method:?}: {t:?} {period}"
        );
    }
}

/// The same bytes as plain data; the answer says what was chosen inside the band, and what that
/// came to.
#[test]
fn a_relays_answer_names_its_beginning() {
    let begins = |switch: SwitchSpec| {
        let run = spec(1e-1, switch, Method::Dopri5, 1e-9, 1.0);
        let json = serde_json::to_string(&run).unwrap();
        assert_eq!(serde_json::from_str::<RunSpec>(&json).unwrap(), run);
        let answer = Executor::quiet().ask(&Run(run)).unwrap();
        [answer.fact::<String>("inside").unwrap(), answer.fact::<String>("begins").unwrap()]
    };
    assert_eq!(begins(SwitchSpec::relay(1e-3)), ["sign", "plus"]);
    assert_eq!(begins(SwitchSpec::Relay { band: 0.3, inside: Inside::Minus }), ["minus", "minus"]);
    let json = serde_json::to_value(SwitchSpec::relay(0.25)).unwrap();
    assert_eq!(json, serde_json::json!({ "relay": { "band": 0.25, "inside": "sign" } }));
}

/// A band that narrows: the mean of the chatter tends to Filippov's motion, linearly.
#[test]
fn a_relays_mean_tends_to_filippovs_motion() {
    let at = |switch, tolerance| {
        simulate(&spec(1e-1, switch, Method::Dopri5, tolerance, 9.0), &()).unwrap().x
    };
    let exit = twofold::integrate::filippov::ExitRule::Undecided;
    let limit = at(SwitchSpec::Filippov { exit, funnel: None }, 1e-11);
    let apart = [1e-2, 2.5e-3, 6.25e-4].map(|band| {
        let x = at(SwitchSpec::relay(band), 1e-9);
        assert!(x[0].abs() < 1.001 * band, "outside the band: {x:?}");
        (x[1] - limit[1]).abs()
    });
    assert!(apart[2] < 2e-3 && apart[2] < 0.5 * apart[0], "{apart:?}");
}

/// While it slides at t = 9, without a choice before: the mean of the chatter is Filippov's motion,
/// up to the delay's first power.
#[test]
fn the_chatters_mean_tends_to_filippovs_motion() {
    let at = |switch, tolerance| {
        simulate(&spec(1e-1, switch, Method::Dopri5, tolerance, 9.0), &()).unwrap().x
    };
    let exit = twofold::integrate::filippov::ExitRule::Undecided;
    let limit = at(SwitchSpec::Filippov { exit, funnel: None }, 1e-11);
    let apart = [4e-3, 2e-3, 1e-3, 5e-4].map(|delay| {
        let x = at(SwitchSpec::delayed(delay), 1e-9);
        assert!(x[0].abs() < delay, "the surface is not far: {x:?}");
        x[1] - limit[1]
    });
    assert!(
        apart[3] < 5e-3 && apart.windows(2).all(|e| (e[0] / e[1] - 2.0).abs() < 0.2),
        "{apart:?}"
    );
}

/// Growth in a passage: across delay^-1, along and carried in delay^0, up to what the phases of a
/// few starts scatter over one decade. The example has three decades.
#[test]
fn growth_in_a_passage_is_of_order_one_in_inner_units() {
    let found: Vec<_> = [1e-2, 3e-3, 1e-3]
        .map(|d| {
            (
                d,
                delay_growth::growth(LateRule::Sharp { delay: d }, &delay_growth::STARTS[..3])
                    .unwrap(),
            )
        })
        .into();
    let [across, along, carried_in] = delay_growth::exponents(&found).map(|(slope, _)| slope);
    assert!(
        (across + 1.0).abs() < 0.3 && along.abs() < 0.1 && carried_in.abs() < 0.3,
        "{across} {along} {carried_in}"
    );
    for (delay, growth) in &found {
        for g in growth {
            let inner = [
                g.across * delay,
                g.along,
                g.carried_in,
                (g.exit[1] * g.exit[1] + g.exit[2] * g.exit[2]).sqrt(),
            ];
            let bounds = [(0.1, 0.5), (2.0, 3.5), (10.0, 40.0), (3.0, 30.0)];
            assert!(
                inner.iter().zip(bounds).all(|(v, (low, high))| (low..high).contains(v)),
                "{delay}: {g:?}"
            );
        }
    }
}

/// The committed powers, each near the one that the chatter's phase explains: across, along and
/// carried in.
#[test]
fn committed_growth_has_the_powers_of_the_chatters_phase() {
    let growth = delay::growth().unwrap();
    let are = |powers: [(f64, f64); 3], expected: [f64; 3], within: f64| {
        let near = powers.iter().zip(expected).all(|((power, _), e)| (power - e).abs() < within);
        assert!(near, "{powers:?} and not {expected:?}");
        assert!(powers.iter().all(|(_, error)| *error > 0.0 && *error < within), "{powers:?}");
    };
    are(delay::sharp_powers(&growth, "sharp"), [-1.0, 0.0, 0.0], 0.05);
    are(delay::sharp_powers(&growth, "relay"), [-0.5, 0.0, -0.5], 0.03);
    // The smooth rule: smoothing's powers, and order one in inner units.
    let law = Predicted::of(-1.2, -1.4);
    let smoothing = [law.across(), law.along(), law.carried()];
    are(delay::smooth_powers(&growth, delay::SMALL, delay::SMALL_EPS), smoothing, 0.15);
    are(delay::smooth_powers(&growth, delay::LARGE, 1e-2), [-0.5, 0.0, 0.0], 0.1);
}

/// The page of the delayed switch gives the powers and growths of the committed data.
#[test]
fn the_page_says_what_the_growth_is() {
    let page =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/docs/delay.md")).unwrap();
    let words = page.split_whitespace().collect::<Vec<_>>().join(" ");
    let growth = delay::growth().unwrap();
    let [sharp, relay] = ["sharp", "relay"].map(|r| delay::sharp_powers(&growth, r));
    let small = delay::smooth_powers(&growth, delay::SMALL, delay::SMALL_EPS);
    let large = delay::smooth_powers(&growth, delay::LARGE, 1e-2);
    for (powers, digits) in [(sharp, 3), (relay, 3), (small, 2), (large, 2)] {
        for (power, error) in powers {
            let said = format!("{power:.digits$} ± {error:.digits$}").replace('-', "−");
            assert!(words.contains(&said), "docs/delay.md does not say {said}");
        }
    }
    // The table of growths along, two digits of the starts' geometric mean.
    let number = |cell: &str| -> f64 {
        let digit = |c| "⁰¹²³⁴⁵⁶⁷⁸⁹".chars().position(|raised| raised == c);
        let plain = |c| digit(c).map_or(c, |d| char::from(b'0' + d as u8));
        cell.chars().map(plain).collect::<String>().replace("·10", "e").parse().unwrap()
    };
    let [ratios, parameters, along] = ["ratio", "parameter", "along"].map(|c| growth.numbers(c));
    let rows = page.lines().skip_while(|l| !l.starts_with("| δ/√ε | ε")).skip(2);
    let mut compared = 0;
    for row in rows.take_while(|l| l.starts_with('|')) {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        for (cell, eps) in cells[1..].iter().zip([1e-2, 1e-3, 1e-4, 1e-5]) {
            let logs: Vec<f64> = (0..growth.len())
                .filter(|i| ratios[*i] == number(cells[0]) && parameters[*i] == eps)
                .map(|i| ln(along[i]))
                .collect();
            if !cell.is_empty() {
                let mean = exp(logs.iter().sum::<f64>() / logs.len() as f64);
                let [said, found] = [number(cell), mean].map(|v| format!("{v:.1e}"));
                assert_eq!(said, found, "{row}, eps = {eps}");
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 26);
}

/// Over a uniform phase the exits' distribution does not depend on the delay, or a small band,
/// while the phase of each exit does. One exit of a distribution is 0.0043.
#[test]
fn committed_exits_have_a_limit_distribution() {
    let exits = delay::exits().unwrap();
    let gaps = ["sharp", "relay"].map(|rule| delay::exit_gaps(&exits, rule));
    assert!(gaps[0].iter().chain(&gaps[1][1..]).all(|gap| *gap < 0.01), "{gaps:?}");
    let first = [1e-3, 1e-5].map(|delay| delay::one_period(&exits, "sharp", delay)[0][1]);
    assert!((first[0] - first[1]).abs() > 10.0, "{first:?}");
}

/// Rows of each committed table, computed anew: to the digits that they have.
#[test]
fn committed_data_come_out_the_same() {
    let [growth, exits, _, runs] = delay::DATA.map(|(_, text)| text);
    let rules = [
        ("sharp,NaN,1.0000e-2", LateRule::Sharp { delay: 1e-2 }),
        ("relay,NaN,1.0000e-2", LateRule::Relay { band: 1e-2 }),
    ];
    for (name, rule) in rules {
        let [_, y, z] = delay_growth::STARTS[0];
        let found = delay_growth::growth(rule, &delay_growth::STARTS[..1]).unwrap()[0];
        let row = growth.lines().find(|l| l.starts_with(&format!("{name},{y},{z},"))).unwrap();
        let said = format!("{:.4e},{:.4e},{:.4e}", found.across, found.along, found.carried_in);
        assert!(row.contains(&said), "{row}: {said}");
        let [_, y, z] = delay_growth::exit(rule, delay_growth::start_at(rule, 0.25)).unwrap();
        let said = format!("1e-2,0.25,{y:.5},{z:.5}");
        assert!(exits.lines().any(|l| l.ends_with(&said)), "{said}");
    }
    let end = claims().similarity.end;
    for (rule, number) in [(Rule::Smoothed, 1), (Rule::Single, 7), (Rule::DelayedLong, 3)] {
        let run = delay_runs::run(Reading::Printed, rule, delay_runs::shift(number), end);
        let (outcome, captured_at) = delay_runs::settles(&delay_runs::followed(&run).unwrap(), end);
        let said = format!("printed,{},{number},{outcome},{captured_at:.1},", rule.name());
        assert!(runs.lines().any(|l| l.starts_with(&said)), "{said}");
    }
}

/// Sentence 4.8, from the committed runs by the rules that stood before them.
#[test]
fn the_effect_is_in_some_ways_similar_to_hysteresis() {
    let mut reads = Reads::by("delay::the_effect_is_in_some_ways_similar_to_hysteresis");
    let scores = delay::all_scores().unwrap();
    let is_similar = |way: usize| {
        let chosen =
            scores.iter().filter(|s| s.0 == way && s.2 == Rule::Delayed && s.3 == Rule::Literal);
        chosen.filter(|s| s.4.similar == Similar::Yes).count() == Reading::ALL.len()
    };
    for (_, reading, delayed, hysteresis, score) in &scores {
        assert_eq!(score.of, claims().similarity.runs, "{reading:?} {delayed:?} {hysteresis:?}");
    }
    let ways = (0..WAYS.len()).filter(|way| is_similar(*way)).count();
    reads.read(
        "4.8",
        "ways in which it is similar to literal hysteresis in both readings of the parameters",
        ways as f64,
    );
}

/// The exit code and what was said.
fn told(base: &[&str], arguments: &str) -> (Option<i32>, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_twofold"))
        .args(base.iter().copied().chain(arguments.split_whitespace()))
        .output()
        .unwrap();
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

/// The same of a relay; and what cannot follow one says so.
#[test]
fn a_relay_is_refused_by_name_where_it_cannot_be_followed() {
    for (command, arguments, word) in [
        ("run", "", "--band"),
        ("run", "--band 0", "above zero"),
        ("run", "--band nan", "finite"),
        ("run", "--band 0.1 --inside plus", "outside the band"),
        ("run", "--band 0.1 --method lsoda", "dopri5, taylor or taylor-extended"),
        ("run", "--band 0.1 --eps 0.1", "--eps"),
        ("run", "--band 0.1 --delay 0.1", "--delay"),
        ("run", "--band 0.1 --history flow", "--history"),
        ("run", "--band 0.1 --system relay-square --start=1,1", "one switching surface"),
        ("orbit", "--band 0.1 --section y=0", "--switch relay"),
    ] {
        let t_end: &[&str] = if command == "orbit" { &[] } else { &["--t-end", "1"] };
        let base = [&[command, "--switch", "relay"], t_end].concat();
        let (code, said) = told(&base, arguments);
        assert!(code == Some(2) && said.contains(word), "{command} {arguments}: {code:?} {said}");
    }
    let folder = tempfile::tempdir().unwrap();
    let out = |name: &str| folder.path().join(name).display().to_string();
    let relay = ["--switch", "relay", "--band", "0.01", "--t-end", "3", "--quiet"];
    for (command, more) in [
        ("lyapunov", vec!["--out", "-"]),
        (
            "run",
            vec!["--kick-every", "0.5", "--kick-size", "0.02", "--restart", "0.7", "--out", "-"],
        ),
        ("plot", vec!["--out", &out("relay.png")]),
        ("sweep", vec!["--over", "band=1e-2,2e-2", "--out", &out("relay.csv")]),
    ] {
        let (code, said) = told(&[&[command], &relay[..], &more[..]].concat(), "");
        assert!(code == Some(0), "{command}: {said}");
    }
    let table = std::fs::read_to_string(out("relay.csv")).unwrap();
    assert!(table.lines().next().unwrap().contains("band") && table.contains("0.02"), "{table}");
}

/// Exponents to the last digit, which scripts/check-arch.sh compares on other machines.
#[test]
fn committed_exponents_come_out_the_same() {
    for line in include_str!("../data/late-exponents.txt").lines() {
        let (question, facts) = line.split_once('|').unwrap();
        let output = Command::new(env!("CARGO_BIN_EXE_twofold"))
            .args(["lyapunov", "--quiet", "--format", "json"])
            .args(question.split_whitespace())
            .output()
            .unwrap();
        let answer = String::from_utf8(output.stdout).unwrap();
        assert!(answer.contains(&format!("\"facts\":{facts},\"made_by\"")), "{question}: {answer}");
    }
}

/// Wrong questions are refused before anything is computed, with exit code 2.
#[test]
fn wrong_questions_are_refused() {
    let told = |arguments: &str| {
        told(&["run", "--switch", "delayed", "--t-end", "1", "--out", "-"], arguments)
    };
    for (arguments, word) in [
        ("", "--delay"),
        ("--delay 0", "above zero"),
        ("--delay -1", "above zero"),
        ("--delay inf", "finite"),
        ("--delay nan", "finite"),
        ("--delay 1", "below the end time"),
        ("--delay 0.1 --method lsoda", "dopri5, taylor or taylor-extended"),
        ("--delay 0.1 --method layered", "dopri5, taylor or taylor-extended"),
        ("--delay 0.1 --eps 0.1 --method taylor", "dopri5 or radau5"),
        ("--delay 0.1 --eps 0", "above zero"),
        ("--delay 0.1 --transition erf", "--eps"),
        ("--delay 0.1 --restart 0.1", "longer than the delay"),
        ("--delay 0.1 --kick-every 0.05 --kick-size 0.1", "longer than the delay"),
        ("--delay 0.1 --method taylor-extended --precision 192", "106"),
        ("--delay 0.1 --method taylor-extended --horizon", "106"),
        ("--delay 1e-17", "too coarse"),
        ("--delay 1e-17 --eps 0.1", "too coarse"),
        ("--delay 0.5 --history flow --start=0.2,-1,-1", "constant history"),
        ("--delay 0.1 --system relay-square --start=1,1", "one switching surface"),
    ] {
        let (code, said) = told(arguments);
        assert!(code == Some(2) && said.contains(word), "{arguments}: {code:?} {said}");
    }
    assert_eq!(told("--delay 0.1").0, Some(0));
    // In a sweep over eps, --eps selects the smooth switch.
    let sweep = |eps: &str| {
        self::told(
            &["sweep", "--switch", "delayed", "--delay", "0.1", "--t-end", "1", "--quiet"],
            eps,
        )
    };
    assert_eq!(sweep("--eps 0.1 --over eps=0.1,0.2").0, Some(0));
    let (code, said) = sweep("--over eps=0.1,0.2");
    assert!(code == Some(2) && said.contains("give the run one"), "{said}");
}
