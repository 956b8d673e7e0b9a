use std::ops::ControlFlow;

use super::*;
use crate::cases;
use twofold_integrate::filippov::Side;
use twofold_integrate::{Kick, KickLaw, Schedule, StepCap, Tolerance};
use twofold_system::Relaxation;

const EVERY: Observation = Observation::Times { every: 0.25 };

fn switches() -> [SwitchSpec; 3] {
    let exit = ExitRule::AtOnce { side: Side::Plus };
    let hysteretic = SwitchSpec::hysteretic(1e-2, Relaxation::Single);
    [SwitchSpec::tanh(1e-2), hysteretic, SwitchSpec::Filippov { exit, funnel: None }]
}

/// A run that is streamed in parts: all rows, and the number of rows in each part.
fn in_parts(run: &RunSpec) -> (Streamed, Vec<Vec<crate::Entry>>, Vec<usize>) {
    let (mut rows, mut parts) = (Vec::new(), Vec::new());
    let mut take = |table: &Table| {
        parts.push(table.len());
        rows.extend(table.rows());
        true
    };
    (stream(run, &mut take, &()).unwrap(), rows, parts)
}

/// Decays at the rates 1, 2, 3 ...: as a whole, given away in parts, and computed in parts.
#[test]
fn runs_have_one_to_four_states() {
    for n in 1..=4 {
        for switch in switches() {
            let run = cases::run(cases::decays(n), switch, 1.0, EVERY);
            let whole = answer(&run, &()).unwrap();
            let points = &whole.tables[0];
            assert_eq!(points.numbers("t"), [0.0, 0.25, 0.5, 0.75, 1.0]);
            for k in 1..=n {
                let state = points.numbers(&format!("a{k}"));
                let right = |(t, x): (&f64, &f64)| (x - (-(k as f64) * t).exp()).abs() < 1e-10;
                assert!(
                    points.numbers("t").iter().zip(state).all(right),
                    "{n} {switch:?}: {state:?}"
                );
            }
            let state: Vec<f64> = whole.fact("state").unwrap();
            assert_eq!((state.len(), state[n - 1]), (n, points.numbers(&format!("a{n}"))[4]));
            let (end, rows, parts) = in_parts(&run);
            // Blanks are not equal to each other, but look alike.
            assert_eq!((format!("{rows:?}"), parts), (format!("{:?}", points.rows()), vec![5]));
            assert_eq!((end.t, end.rows, end.stop), (1.0, 5, Stop::Finished));
            assert_eq!(Some(&end.statistics), whole.statistics.as_ref());
        }
    }
    for switch in switches() {
        let many = cases::run(
            cases::decays(5),
            switch,
            1.0,
            Observation::Section { coordinate: 0, value: 0.5 },
        );
        let said =
            [answer(&many, &()).unwrap_err(), stream(&many, &mut |_| true, &()).unwrap_err()];
        assert!(said.iter().all(|e| e.to_string().contains("up to four states")), "{said:?}");
    }
}

/// Every state begins at its own value, not at phi's.
#[test]
fn a_hysteretic_run_begins_where_it_is_asked_to() {
    let mut run = cases::run(cases::decays(2), switches()[1], 1.0, EVERY);
    run.start = vec![0.3, -0.7];
    let points = &answer(&run, &()).unwrap().tables[0];
    for (name, from, rate) in [("a1", 0.3, 1.0), ("a2", -0.7, 2.0)] {
        let state = points.numbers(name);
        let right = |(t, x): (&f64, &f64)| (x - from * (-rate * t).exp()).abs() < 1e-10;
        assert!(state[0] == from && points.numbers("t").iter().zip(state).all(right), "{state:?}");
    }
}

#[test]
fn recordings_are_of_three_states() {
    let section = Observation::Section { coordinate: 0, value: 0.5 };
    let run = |n: usize| cases::run(cases::decays(n), SwitchSpec::tanh(1e-2), 10.0, section);
    for n in [2, 4] {
        for found in [simulate(&run(n), &()), simulate_until(&run(n), &|_| true, &())] {
            assert!(found.unwrap_err().to_string().contains("three states are looked at"));
        }
    }
    let (whole, all) =
        (simulate(&run(3), &()).unwrap(), simulate_until(&run(3), &|_| false, &()).unwrap());
    assert_eq!(whole, all);
    // a2 = 1/16 at 2 ln 2: the first step's end after that.
    let until = simulate_until(&run(3), &|x| x[1] < 0.0625, &()).unwrap();
    assert_eq!((until.stop, until.data.len()), (StopReason::Observer, 1));
    assert!(until.x[1] < 0.0625 && until.t < 2.0 && whole.t == 10.0);
}

/// A ball that falls to x = 0 from either side, passing once in two units of time: parts are
/// cut inside pieces of its motion.
#[test]
fn parts_are_the_whole() {
    let ball = cases::of("states = ['x', 'v']\nh = 'x'\nplus = ['v', '-1']\nminus = ['v', '1']");
    let turning = cases::smooth(&["x", "v"], "x + 9", &["v", "-x"]);
    let [tanh, _, filippov] = switches();
    let times = Observation::Times { every: 1e-3 };
    let chord = |chord| Observation::Path { chord };
    for (system, switch, observe, pieces) in [
        (turning.clone(), tanh, times, 0),
        (turning, tanh, chord(3e-8), 0),
        (ball.clone(), filippov, times, 10),
        (ball, filippov, chord(1e-7), 10),
    ] {
        let start = vec![0.5, 0.0];
        let run = RunSpec { start, ..cases::run(system, switch, 20.0, observe) };
        let whole = answer(&run, &()).unwrap();
        let (end, rows, parts) = in_parts(&run);
        let (last, full) = parts.split_last().unwrap();
        assert!(
            full.len() >= 2 && full.iter().all(|n| (PART..3 * PART).contains(n)) && *last < PART,
            "{parts:?}"
        );
        assert!(whole.tables[0].integers("piece").last().is_none_or(|last| *last == pieces));
        // Blanks are not equal to each other, but look alike.
        assert!(format!("{rows:?}") == format!("{:?}", whole.tables[0].rows()), "{observe:?}");
        assert_eq!((end.rows as usize, end.stop), (rows.len(), Stop::Finished));
        // Enough is enough.
        let mut parts = 0;
        let mut take = |_: &Table| {
            parts += 1;
            parts < 2
        };
        let cut = stream(&run, &mut take, &()).unwrap();
        assert_eq!(cut.stop, Stop::Found);
        assert!(cut.t < end.t && cut.rows < end.rows);
    }
}

/// Crossings of a circle at unit speed through y = 0: one each pi.
struct UntilHalf;
impl Monitor for UntilHalf {
    fn reached(&self, t: f64) -> ControlFlow<()> {
        if t < 0.5 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    }
}

/// However many samples a step holds, few are kept; and who asks to stop within it is heard.
#[test]
fn a_step_is_given_away_in_parts() {
    for switch in [switches()[0], switches()[2]] {
        let run = cases::run(cases::decays(2), switch, 1.0, Observation::Times { every: 1e-5 });
        let (end, rows, parts) = in_parts(&run);
        assert!(end.statistics.steps < 1000 && parts.iter().all(|n| *n <= PART), "{parts:?}");
        assert_eq!((end.rows, end.t, end.stop), (100_001, 1.0, Stop::Finished));
        assert!(
            format!("{rows:?}") == format!("{:?}", answer(&run, &()).unwrap().tables[0].rows())
        );
        let stop = stream(&run, &mut |_| true, &UntilHalf).unwrap();
        assert_eq!(stop.stop, Stop::Interrupted);
        assert!(
            stop.t >= 0.5
                && stop.rows < 50_001 + PART as u64
                && (stop.rows as usize).is_multiple_of(PART),
            "{stop:?}"
        );
    }
}

#[test]
fn sections_are_given_away_in_parts() {
    let circle =
        cases::smooth(&["x", "y"], "x + 9", &["x*(1 - x*x - y*y) - y", "y*(1 - x*x - y*y) + x"]);
    let section = Observation::Section { coordinate: 1, value: 0.0 };
    let mut run = cases::run(circle, SwitchSpec::tanh(1e-2), 30_000.0, section);
    run.method.tolerance = Tolerance { rtol: 1e-3, atol: 1e-3 };
    let (end, rows, parts) = in_parts(&run);
    assert!(parts.len() == 2 && parts[0] == PART && end.rows as usize == rows.len(), "{parts:?}");
    assert!(rows == answer(&run, &()).unwrap().tables[0].rows());
}

/// An oscillation by 1e-4, by each switch: its top is among the points, which are given away
/// as they are kept.
#[test]
fn the_path_of_a_small_state_is_as_fine_as_that_of_a_large_one() {
    for (switch, t_end) in switches().into_iter().flat_map(|s| [(s, 3.0), (s, 1500.0)]) {
        let turning = cases::smooth(&["x", "v"], "x + 9", &["v", "-x"]);
        let mut run = cases::run(turning, switch, t_end, Observation::Path { chord: 1e-3 });
        run.start = vec![0.0, 1e-4];
        let (_, rows, _) = in_parts(&run);
        let table = answer(&run, &()).unwrap().tables.swap_remove(0);
        assert!(format!("{rows:?}") == format!("{:?}", table.rows()));
        let top = table.numbers("x").iter().fold(0.0, |a, b| f64::max(a, *b));
        assert!((top - 1e-4).abs() < 2e-7, "{top}");
    }
}

/// A kick is two points of a path at one time, as far from each other as it is large.
#[test]
fn kicks_are_seen_in_a_path() {
    let kick = Some(Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 1, stream: 2 });
    let mut run =
        cases::run(cases::decays(3), SwitchSpec::tanh(1e-2), 1.0, Observation::Path { chord: 1.0 });
    run.schedule = Schedule { restart_every: None, kick };
    let path = &answer(&run, &()).unwrap().tables[0];
    let t = path.numbers("t");
    let kicked: Vec<usize> = (1..t.len()).filter(|k| t[*k] == t[k - 1]).collect();
    assert_eq!(kicked.len(), 3, "{t:?}");
    for (k, time) in kicked.into_iter().zip([0.3, 0.6, 0.9]) {
        let apart =
            ["a1", "a2", "a3"].map(|name| path.numbers(name)[k] - path.numbers(name)[k - 1]);
        let size = apart.iter().map(|d| d * d).sum::<f64>().sqrt();
        assert!((t[k] - time).abs() < 1e-12 && (size - 1e-3).abs() < 1e-12, "{size} at {}", t[k]);
    }
}

#[test]
fn a_filippov_run_has_the_tolerance_the_longest_step_and_the_budget_asked_for() {
    let [_, _, filippov] = switches();
    let steps = |change: &dyn Fn(&mut MethodSpec)| {
        let mut run = cases::run(cases::decays(2), filippov, 1.0, EVERY);
        change(&mut run.method);
        answer(&run, &()).map(|answer| answer.statistics.unwrap().steps)
    };
    let fine = steps(&|_| {}).unwrap();
    assert!(steps(&|m| m.tolerance = Tolerance { rtol: 1e-3, atol: 1e-3 }).unwrap() < fine / 2);
    let capped = steps(&|m| m.step_cap = StepCap::Absolute(1e-3)).unwrap();
    assert!((1000..1010).contains(&capped), "{capped}");
    // The step that exceeds the budget has been made.
    let said = steps(&|m| m.max_steps = 50).unwrap_err().to_string();
    assert!(fine > 51 && said.starts_with("51 steps were not enough"), "{said}");
}

#[test]
fn a_funnel_has_no_parts() {
    let funnel =
        FunnelSpec { shortest: 0.1, longest: 1.0, times: 3, horizon: 5.0, until_two_fold: true };
    let switch = SwitchSpec::Filippov { exit: ExitRule::All, funnel: Some(funnel) };
    let run = cases::run(cases::decays(3), switch, 1.0, Observation::Path { chord: 1e-2 });
    let said = stream(&run, &mut |_| true, &()).unwrap_err().to_string();
    assert!(said.contains("not given away in parts"), "{said}");
}
