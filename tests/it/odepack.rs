//! Our LSODA against ODEPACK's own Fortran, as SciPy carries it:
//! papers/jeffrey-2013/code/workprecision/odepack/reference.json, made once by
//! scripts/odepack_reference.py. Radau5 against the same reference solutions.
//!
//! Step control magnifies rounding: after some hundred steps two programs that differ in the last
//! bits make different decisions. The file therefore also says what ODEPACK does from starts 1e-12
//! away. Where it does the same from all of them, we must do exactly what it does; elsewhere its
//! own spread is the yardstick, and the 15 % of issue 3 hold.

#[allow(dead_code)]
#[path = "../../papers/jeffrey-2013/code/workprecision/data.rs"]
mod data;
#[path = "../../papers/jeffrey-2013/code/workprecision/problems.rs"]
mod problems;

use data::{Reference, ReferenceProblem, ReferenceRun, reference};
use problems::{Problem, Visit, for_each};
use twofold::integrate::lsoda::{Family, Lsoda, Switch};
use twofold::integrate::{
    DriveOptions, Ignore, Radau5, Statistics, StepCap, Stepper, Tolerance, drive,
};

/// Error and work of our LSODA.
struct Ours {
    error: f64,
    statistics: Statistics,
    switches: Vec<Switch>,
    adams_orders: [u64; 12],
    bdf_orders: [u64; 5],
}

fn ours<const N: usize>(
    problem: &Problem<N>,
    known: &ReferenceProblem,
    run: &ReferenceRun,
) -> Ours {
    let mut lsoda = Lsoda::new(Tolerance { rtol: run.rtol, atol: run.atol });
    let cap = known.max_step.unwrap_or(f64::INFINITY);
    lsoda.restart(&problem.field, 0.0, problem.start, known.t_end, cap).unwrap();
    let (mut t, mut x) = (0.0, problem.start);
    let (mut adams_orders, mut bdf_orders) = ([0; 12], [0; 5]);
    while t < known.t_end {
        let stiff_before = lsoda.statistics().stiff_steps;
        let step = lsoda.step(&problem.field).unwrap();
        (t, x) = (step.t1, step.x1);
        let order = step.interpolant.degree();
        if lsoda.statistics().stiff_steps > stiff_before {
            bdf_orders[order - 1] += 1;
        } else {
            adams_orders[order - 1] += 1;
        }
    }
    Ours {
        error: known.error(x.as_slice()),
        statistics: lsoda.statistics().clone(),
        switches: lsoda.switches().to_vec(),
        adams_orders,
        bdf_orders,
    }
}

/// Calls `check` with every run of ours and ODEPACK's.
fn compare(check: impl FnMut(&str, &ReferenceProblem, &ReferenceRun, &Ours)) {
    struct Each<C> {
        reference: Reference,
        check: C,
    }
    impl<C: FnMut(&str, &ReferenceProblem, &ReferenceRun, &Ours)> Visit for Each<C> {
        fn visit<const N: usize>(&mut self, problem: &Problem<N>) {
            let known = self
                .reference
                .problems
                .iter()
                .find(|p| p.name == problem.name)
                .expect(problem.name);
            assert_eq!(known.start, problem.start.as_slice(), "{}", problem.name);
            for run in &known.runs {
                let label = format!("{} at {:.0e}", problem.name, run.rtol);
                (self.check)(&label, known, run, &ours(problem, known, run));
            }
        }
    }
    for_each(&mut Each { reference: reference(), check });
}

/// Least and greatest of a count over ODEPACK's runs, the nominal one and the shifted ones.
fn range(nominal: u64, shifted: impl Iterator<Item = u64>) -> (u64, u64) {
    shifted.fold((nominal, nominal), |(low, high), n| (low.min(n), high.max(n)))
}

/// ODEPACK does the same from all the shifted starts.
fn robust(run: &ReferenceRun) -> bool {
    run.shifted.iter().all(|s| {
        (s.steps, s.evaluations, s.jacobians, s.stiff_steps)
            == (run.steps, run.evaluations, run.jacobians, run.stiff_steps)
            && s.switches.len() == run.switches.len()
    })
}

fn name(family: Family) -> &'static str {
    match family {
        Family::Adams => "adams",
        Family::Bdf => "bdf",
    }
}

#[test]
fn identical_where_rounding_does_not_decide() {
    let (mut seen, mut seen_switching, mut differing) = (0, 0, Vec::new());
    compare(|label, _, run, ours| {
        if !robust(run) {
            return;
        }
        seen += 1;
        seen_switching += usize::from(!run.switches.is_empty());
        let s = &ours.statistics;
        let same = (s.steps, s.evaluations, s.jacobians, s.stiff_steps)
            == (run.steps, run.evaluations, run.jacobians, run.stiff_steps)
            && ours.adams_orders == *run.adams_orders
            && ours.bdf_orders == *run.bdf_orders
            && ours.switches.len() == run.switches.len()
            && ours
                .switches
                .iter()
                .zip(&run.switches)
                .all(|(a, (t, to))| (a.t - t).abs() < 1e-5 * t && name(a.to) == to);
        if !same {
            differing.push(format!("{label}: {s:?} {:?}", ours.switches));
        }
    });
    assert!(differing.is_empty(), "{differing:#?}");
    // The test would be empty if nothing were robust.
    assert!(
        seen >= 25 && seen_switching >= 8,
        "{seen} robust runs, {seen_switching} with switches"
    );
}

#[test]
fn counts_within_fifteen_percent() {
    let mut worst: (f64, String) = (0.0, String::new());
    compare(|label, _, run, ours| {
        for (what, a, b) in [
            ("steps", ours.statistics.steps, run.steps),
            ("evaluations", ours.statistics.evaluations, run.evaluations),
        ] {
            let deviation = a as f64 / b as f64 - 1.0;
            if deviation.abs() > worst.0 {
                worst = (deviation.abs(), format!("{label}: {a} {what}, ODEPACK {b}"));
            }
        }
    });
    println!("largest deviation {:.1} %: {}", 100.0 * worst.0, worst.1);
    assert!(worst.0 <= 0.15, "{}", worst.1);
}

#[test]
fn errors_are_odepacks() {
    compare(|label, known, run, ours| {
        let theirs = run.shifted.iter().map(|s| s.error).fold(known.error(&run.x), f64::max);
        // The reference must be good enough to tell.
        assert!(
            known.uncertainty() < 0.25 * theirs,
            "{label}: reference known to {}",
            known.uncertainty()
        );
        assert!(ours.error <= 2.0 * theirs, "{label}: {} ODEPACK {theirs}", ours.error);
    });
}

/// BDF work and switches, inside ODEPACK's own spread with room of the size of that spread.
#[test]
fn switches_are_odepacks() {
    compare(|label, _, run, ours| {
        let s = &ours.statistics;
        let near = |what: &str, n: u64, (low, high): (u64, u64)| {
            let room = (high - low).max(high / 5).max(2);
            assert!(
                low <= n + room && n <= high + room,
                "{label}: {n} {what}, ODEPACK {low}..{high}"
            );
        };
        near(
            "Jacobians",
            s.jacobians,
            range(run.jacobians, run.shifted.iter().map(|r| r.jacobians)),
        );
        near(
            "BDF steps",
            s.stiff_steps,
            range(run.stiff_steps, run.shifted.iter().map(|r| r.stiff_steps)),
        );
        let counts =
            range(run.switches.len() as u64, run.shifted.iter().map(|r| r.switches.len() as u64));
        near("switches", s.method_switches, counts);
        if counts.0 != counts.1 || s.method_switches != counts.0 {
            return;
        }
        for (k, ours) in ours.switches.iter().enumerate() {
            let times = || run.shifted.iter().map(|r| r.switches[k].0).chain([run.switches[k].0]);
            let (low, high) = (times().fold(f64::INFINITY, f64::min), times().fold(0.0, f64::max));
            let room = (high - low).max(0.02 * high);
            assert!(
                (low - room..=high + room).contains(&ours.t),
                "{label}: switch {k} at {}, ODEPACK {low}..{high}",
                ours.t
            );
            assert_eq!(name(ours.to), run.switches[k].1, "{label}");
        }
    });
}

/// Radau5 shares no code or idea with the makers of the reference solutions but the method's name:
/// its error goes down with the tolerance on every problem, to far below it except where the
/// problem itself magnifies errors.
#[test]
fn radau5_reaches_the_reference_solutions() {
    struct Check(Reference);
    impl Visit for Check {
        fn visit<const N: usize>(&mut self, problem: &Problem<N>) {
            let known =
                self.0.problems.iter().find(|p| p.name == problem.name).expect(problem.name);
            let error = |tolerance: f64| {
                let mut radau = Radau5::new(Tolerance {
                    rtol: tolerance,
                    atol: tolerance * known.atol_over_rtol,
                });
                let step_cap = known.max_step.map_or(StepCap::None, StepCap::Absolute);
                let options =
                    DriveOptions { step_cap, max_steps: 100_000, ..DriveOptions::to(known.t_end) };
                let end =
                    drive(&problem.field, problem.start, &options, &mut radau, &mut Ignore, &())
                        .unwrap();
                known.error(end.within_budget().unwrap().x.as_slice())
            };
            let (loose, tight) = (error(1e-6), error(1e-10));
            let floor = 4.0 * known.uncertainty();
            assert!(loose < 1e-4, "{}: {loose}", problem.name);
            assert!(tight < 2e-9 + floor, "{}: {tight}", problem.name);
            assert!(tight < 0.05 * loose + floor, "{}: {loose} {tight}", problem.name);
        }
    }
    for_each(&mut Check(reference()));
}

/// The data of the work-precision picture: complete, and without the rows that a non-stiff method
/// cannot give.
#[test]
fn work_precision_rows() {
    let rows = data::rows();
    for known in &reference().problems {
        let count =
            |method| rows.iter().filter(|r| r.problem == known.name && r.method == method).count();
        for method in ["odepack-lsoda", "lsoda", "radau5"] {
            assert_eq!(count(method), known.runs.len(), "{} {method}", known.name);
        }
        let too_stiff =
            ["robertson", "van-der-pol-1000", "oregonator"].contains(&known.name.as_str());
        assert_eq!(count("dopri5"), if too_stiff { 0 } else { known.runs.len() }, "{}", known.name);
    }
    assert!(rows.iter().all(|r| r.error.is_finite() && r.evaluations > 0));
}

/// `cargo test --release --test it odepack::table -- --ignored --nocapture`
#[test]
#[ignore = "prints the comparison, run by run, for a reader"]
fn table() {
    println!(
        "{:32} {:>19} {:>15} {:>15} {:>11} {:>11} {:>7}  (ours ODEPACK)",
        "", "error", "steps", "evaluations", "Jacobians", "BDF steps", "switches"
    );
    compare(|label, known, run, ours| {
        let s = &ours.statistics;
        println!(
            "{label:32} {:9.2e} {:9.2e} {:7} {:7} {:7} {:7} {:5} {:5} {:5} {:5} {:3} {:3} {}",
            ours.error,
            known.error(&run.x),
            s.steps,
            run.steps,
            s.evaluations,
            run.evaluations,
            s.jacobians,
            run.jacobians,
            s.stiff_steps,
            run.stiff_steps,
            s.method_switches,
            run.switches.len(),
            if robust(run) { "robust" } else { "" },
        );
    });
}
