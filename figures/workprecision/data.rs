//! Error against work for ODEPACK's LSODA (frozen, tests/data/odepack) and for this crate's methods (computed).

use nalgebra::SVector;
use serde::Deserialize;
use twofold::integrate::{Dopri5, Failure, Lsoda, Radau5, Statistics, Stepper, Tolerance};
use twofold::system::VectorField;

use super::problems::{Problem, Visit, for_each};

/// tests/data/odepack/reference.json.
#[derive(Debug, Deserialize)]
pub struct Reference {
    /// One entry a problem.
    pub problems: Vec<ReferenceProblem>,
}

/// One problem: its setting, its solution, and ODEPACK's runs.
#[derive(Debug, Deserialize)]
pub struct ReferenceProblem {
    /// Its name.
    pub name: String,
    /// Start at t = 0.
    pub start: Vec<f64>,
    /// End of the run.
    pub t_end: f64,
    /// Step cap.
    pub max_step: Option<f64>,
    /// atol as a multiple of rtol.
    pub atol_over_rtol: f64,
    /// The solution at `t_end`.
    pub reference: Vec<f64>,
    /// How well it is known.
    pub uncertainty: Vec<f64>,
    /// ODEPACK's runs, loosest first.
    pub runs: Vec<ReferenceRun>,
}

/// One run of ODEPACK's LSODA.
#[derive(Debug, Deserialize)]
pub struct ReferenceRun {
    /// Relative tolerance.
    pub rtol: f64,
    /// Absolute tolerance.
    pub atol: f64,
    /// State at the end.
    pub x: Vec<f64>,
    /// Accepted steps.
    pub steps: u64,
    /// Evaluations of f.
    pub evaluations: u64,
    /// Evaluations of its Jacobian.
    pub jacobians: u64,
    /// Steps by BDF.
    pub stiff_steps: u64,
    /// Steps at Adams orders 1, 2, ...
    pub adams_orders: Vec<u64>,
    /// Steps at BDF orders 1, 2, ...
    pub bdf_orders: Vec<u64>,
    /// Switches of family: time, to which.
    pub switches: Vec<(f64, String)>,
    /// The same run from starts 1e-12 away: how much of all this rounding decides.
    pub shifted: Vec<ShiftedRun>,
}

/// ODEPACK's run from a start 1e-12 away.
#[derive(Debug, Deserialize)]
pub struct ShiftedRun {
    /// Accepted steps.
    pub steps: u64,
    /// Evaluations of f.
    pub evaluations: u64,
    /// Evaluations of its Jacobian.
    pub jacobians: u64,
    /// Steps by BDF.
    pub stiff_steps: u64,
    /// Switches of family: time, to which.
    pub switches: Vec<(f64, String)>,
    /// Error against the reference solution.
    pub error: f64,
}

impl ReferenceProblem {
    /// max_i |x_i - r_i| / (|r_i| + atol/rtol): the error in units of rtol's weights.
    pub fn error(&self, x: &[f64]) -> f64 {
        x.iter().zip(&self.reference).map(|(x, r)| (x - r).abs() / (r.abs() + self.atol_over_rtol)).fold(0.0, f64::max)
    }

    /// The same for its uncertainty.
    pub fn uncertainty(&self) -> f64 {
        let shifted: Vec<f64> = self.reference.iter().zip(&self.uncertainty).map(|(r, u)| r + u).collect();
        self.error(&shifted)
    }
}

/// The frozen reference file.
pub fn reference() -> Reference {
    serde_json::from_str(include_str!("../../tests/data/odepack/reference.json"))
        .expect("reference.json is committed and has this form")
}

/// A point of the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Problem.
    pub problem: String,
    /// `odepack-lsoda`, `lsoda`, `radau5` or `dopri5`.
    pub method: &'static str,
    /// rtol.
    pub tolerance: f64,
    /// Error at the end, as [`ReferenceProblem::error`].
    pub error: f64,
    /// Evaluations of f.
    pub evaluations: u64,
    /// Evaluations of its Jacobian.
    pub jacobians: u64,
    /// Accepted steps.
    pub steps: u64,
}

/// Runs `stepper` over a problem.
pub fn integrate<F: VectorField<N>, M: Stepper<N>, const N: usize>(
    stepper: &mut M,
    field: &F,
    start: SVector<f64, N>,
    t_end: f64,
    max_step: f64,
    most_steps: u64,
) -> Result<(SVector<f64, N>, Statistics), Failure> {
    stepper.restart(field, 0.0, start, t_end, max_step)?;
    let (mut t, mut x) = (0.0, start);
    while t < t_end {
        let step = stepper.step(field)?;
        (t, x) = (step.t1, step.x1);
        if stepper.statistics().steps > most_steps {
            return Err(Failure::TooManySteps { t, limit: most_steps, state: Failure::state(&x) });
        }
    }
    Ok((x, stepper.statistics().clone()))
}

/// Steps after which a method is said not to manage a problem (Dormand-Prince on the stiff ones).
pub const MOST_STEPS: u64 = 200_000;

/// Every row: ODEPACK's, then ours, problem by problem. A method that fails or takes too long has no row.
pub fn rows() -> Vec<Row> {
    struct Collect {
        reference: Reference,
        rows: Vec<Row>,
    }
    impl Visit for Collect {
        fn visit<F: VectorField<N>, const N: usize>(&mut self, problem: &Problem<F, N>) {
            let Self { reference, rows } = self;
            let known =
                reference.problems.iter().find(|p| p.name == problem.name).expect("every problem has a reference");
            let row = |method, tolerance, error, evaluations, jacobians, steps| Row {
                problem: problem.name.to_owned(),
                method,
                tolerance,
                error,
                evaluations,
                jacobians,
                steps,
            };
            for run in &known.runs {
                let error = known.error(&run.x);
                rows.push(row("odepack-lsoda", run.rtol, error, run.evaluations, run.jacobians, run.steps));
            }
            let max_step = known.max_step.unwrap_or(f64::INFINITY);
            for method in ["lsoda", "radau5", "dopri5"] {
                for run in &known.runs {
                    let tolerance = Tolerance { rtol: run.rtol, atol: run.atol };
                    let (field, start, end) = (&problem.field, problem.start, known.t_end);
                    let result = match method {
                        "lsoda" => integrate(&mut Lsoda::new(tolerance), field, start, end, max_step, MOST_STEPS),

                        "radau5" => integrate(&mut Radau5::new(tolerance), field, start, end, max_step, MOST_STEPS),
                        _ => integrate(&mut Dopri5::new(tolerance), field, start, end, max_step, MOST_STEPS),
                    };
                    let Ok((x, s)) = result else { continue };
                    rows.push(row(method, run.rtol, known.error(x.as_slice()), s.evaluations, s.jacobians, s.steps));
                }
            }
        }
    }
    let mut collect = Collect { reference: reference(), rows: Vec::new() };
    for_each(&mut collect);
    collect.rows
}
