//! Error against work for ODEPACK's LSODA (frozen, workprecision/odepack) and for this
//! crate's methods (computed).

use nalgebra::SVector;
use serde::Deserialize;
use twofold::analyse::work_precision::{WorkPrecisionQuestion, weighted_error, work_precision};
use twofold::integrate::{
    Dopri5, DriveOptions, Failure, Guarded, Ignore, Lsoda, Method, Radau5, StepCap, Summary,
    Tolerance, drive,
};
use twofold::system::BoundField;

use super::problems::{Problem, Visit, for_each};

/// workprecision/odepack/reference.json.
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
    /// Uncertainty of that solution, by component.
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
        weighted_error(x, &self.reference, self.atol_over_rtol)
    }

    /// The same for its uncertainty.
    pub fn uncertainty(&self) -> f64 {
        let shifted: Vec<f64> =
            self.reference.iter().zip(&self.uncertainty).map(|(r, u)| r + u).collect();
        self.error(&shifted)
    }
}

/// The frozen reference file.
pub fn reference() -> Reference {
    serde_json::from_str(include_str!("odepack/reference.json"))
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

/// Steps after which a method is said not to manage a problem (Dormand-Prince on the stiff ones).
pub const MOST_STEPS: u64 = 200_000;

/// Our methods.
const METHODS: [Method; 3] = [Method::Lsoda, Method::Radau5, Method::Dopri5];

/// The orbit of `start` by one of [`METHODS`].
fn run<const N: usize>(
    field: &BoundField<N>,
    method: Method,
    tolerance: Tolerance,
    start: SVector<f64, N>,
    options: &DriveOptions,
) -> Result<Summary<N>, Failure> {
    match method {
        Method::Lsoda => {
            let mut lsoda = Guarded::new(Lsoda::new(tolerance), tolerance);
            drive(field, start, options, &mut lsoda, &mut Ignore, &())
        }
        Method::Radau5 => {
            let mut radau5 = Guarded::new(Radau5::new(tolerance), tolerance);
            drive(field, start, options, &mut radau5, &mut Ignore, &())
        }
        _ => {
            let mut dopri5 = Guarded::new(Dopri5::new(tolerance), tolerance);
            drive(field, start, options, &mut dopri5, &mut Ignore, &())
        }
    }
}

/// Every row: ODEPACK's, then ours, problem by problem. A method that fails or takes too long has
/// no row.
pub fn rows() -> Vec<Row> {
    struct Collect {
        reference: Reference,
        rows: Vec<Row>,
    }
    impl Visit for Collect {
        fn visit<const N: usize>(&mut self, problem: &Problem<N>) {
            let Self { reference, rows } = self;
            let known = reference
                .problems
                .iter()
                .find(|p| p.name == problem.name)
                .expect("every problem has a reference");
            let mut row = |method, tolerance, error, evaluations, jacobians, steps| {
                let problem = problem.name.to_owned();
                rows.push(Row { problem, method, tolerance, error, evaluations, jacobians, steps });
            };
            for run in &known.runs {
                let error = known.error(&run.x);
                row("odepack-lsoda", run.rtol, error, run.evaluations, run.jacobians, run.steps);
            }
            let ours = work_precision(&question(known), |method, tolerance, start, options| {
                run(&problem.field, method, tolerance, start, options)
            });
            let ours = ours.expect("the reference is this problem's");
            for run in ours {
                let (Some(error), Some(s)) = (run.error, run.statistics) else { continue };
                row(
                    run.method.name(),
                    run.tolerance.rtol,
                    error,
                    s.evaluations,
                    s.jacobians,
                    s.steps,
                );
            }
        }
    }
    let mut collect = Collect { reference: reference(), rows: Vec::new() };
    for_each(&mut collect);
    collect.rows
}

/// The question to our methods about a problem: the one that ODEPACK was given.
fn question(known: &ReferenceProblem) -> WorkPrecisionQuestion {
    WorkPrecisionQuestion {
        start: known.start.clone(),
        t_end: known.t_end,
        step_cap: known.max_step.map_or(StepCap::None, StepCap::Absolute),
        solution: known.reference.clone(),
        scale: known.atol_over_rtol,
        methods: METHODS.into(),
        tolerances: known.runs.iter().map(|r| Tolerance { rtol: r.rtol, atol: r.atol }).collect(),
        max_steps: MOST_STEPS,
    }
}
