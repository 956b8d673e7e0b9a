//! Our LSODA against ODEPACK's, as SciPy carries it: tests/data/odepack/reference.json, made once by
//! scripts/odepack_reference.py.

#[allow(dead_code)]
#[path = "../figures/workprecision/data.rs"]
mod data;
#[path = "../figures/workprecision/problems.rs"]
mod problems;

use data::{ReferenceProblem, ReferenceRun, reference};
use problems::{Problem, Visit, for_each};
use twofold::integrate::lsoda::{Family, Lsoda, Switch};
use twofold::integrate::{Statistics, Stepper, Tolerance};
use twofold::model::VectorField;

/// What our LSODA did where ODEPACK did `theirs`.
struct Ours {
    x: Vec<f64>,
    statistics: Statistics,
    switches: Vec<Switch>,
}

fn ours<F: VectorField<N>, const N: usize>(
    problem: &Problem<F, N>,
    known: &ReferenceProblem,
    run: &ReferenceRun,
) -> Ours {
    let mut lsoda = Lsoda::new(Tolerance { rtol: run.rtol, atol: run.atol });
    let cap = known.max_step.unwrap_or(f64::INFINITY);
    let (x, statistics) =
        data::integrate(&mut lsoda, &problem.field, problem.start, known.t_end, cap, 1_000_000).expect(problem.name);
    Ours { x: x.as_slice().to_vec(), statistics, switches: lsoda.switches().to_vec() }
}

#[test]
#[ignore = "prints the comparison table"]
fn table() {
    struct Print;
    impl Visit for Print {
        fn visit<F: VectorField<N>, const N: usize>(&mut self, problem: &Problem<F, N>) {
            let reference = reference();
            let known = reference.problems.iter().find(|p| p.name == problem.name).unwrap();
            for run in &known.runs {
                let o = ours(problem, known, run);
                let s = &o.statistics;
                println!(
                    "{:26} {:.0e} err {:.2e} {:.2e} steps {} {} ({:+.1}%) evals {} {} ({:+.1}%) jac {} {} stiff {} {} order {} switches {:?} | {:?}",
                    problem.name,
                    run.rtol,
                    known.error(&run.x),
                    known.error(&o.x),
                    run.steps,
                    s.steps,
                    100.0 * (s.steps as f64 / run.steps as f64 - 1.0),
                    run.evaluations,
                    s.evaluations,
                    100.0 * (s.evaluations as f64 / run.evaluations as f64 - 1.0),
                    run.jacobians,
                    s.jacobians,
                    run.stiff_steps,
                    s.stiff_steps,
                    s.highest_order,
                    run.switches.iter().map(|s| s.0).collect::<Vec<_>>(),
                    o.switches.iter().map(|s| s.t).collect::<Vec<_>>(),
                );
            }
        }
    }
    for_each(&mut Print);
}

#[test]
#[ignore = "prints the work-precision rows"]
fn work_precision() {
    for r in data::rows() {
        println!(
            "{:26} {:14} {:.0e} {:.2e} {} {} {}",
            r.problem, r.method, r.tolerance, r.error, r.evaluations, r.jacobians, r.steps
        );
    }
}
