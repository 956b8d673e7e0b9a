//! Work-precision measurements: error against work of several methods at several tolerances, on a
//! problem with a known solution.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};

use twofold_integrate::{
    DriveOptions, Failure, Method, Statistics, StepCap, StopReason, Summary, Tolerance,
};

/// Options of [`work_precision`]: everything that it depends on besides the equation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkPrecisionQuestion {
    /// The start, at t = 0.
    pub start: Vec<f64>,
    /// The end, where states are compared.
    pub t_end: f64,
    /// The longest step.
    pub step_cap: StepCap,
    /// The solution there.
    pub solution: Vec<f64>,
    /// An error is measured in units of |solution| + `scale`, component by component.
    pub scale: f64,
    /// The methods.
    pub methods: Vec<Method>,
    /// The tolerances that each is given.
    pub tolerances: Vec<Tolerance>,
    /// Step limit of a run.
    pub max_steps: u64,
}

/// One run.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WorkPrecisionRow {
    /// The method.
    pub method: Method,
    /// Its tolerance.
    pub tolerance: Tolerance,
    /// Error at the end, as [`weighted_error`] measures it; absent for a run that did not reach it.
    pub error: Option<f64>,
    /// Work done; none is known of a run that failed.
    pub statistics: Option<Statistics>,
    /// Why the run ended; absent for a run that failed.
    pub stop: Option<StopReason>,
    /// Why the run failed, as a message.
    pub failure: Option<String>,
}

/// The question's number of components differs from the equation's.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{what} has {got} components, the equation {wanted}")]
pub struct DimensionError {
    /// The start or the solution.
    pub what: &'static str,
    /// Components given.
    pub got: usize,
    /// Components of the equation.
    pub wanted: usize,
}

/// max_i |x_i - r_i| / (|r_i| + scale).
pub fn weighted_error(x: &[f64], solution: &[f64], scale: f64) -> f64 {
    x.iter().zip(solution).map(|(x, r)| (x - r).abs() / (r.abs() + scale)).fold(0.0, f64::max)
}

/// Runs every method at every tolerance: method by method, both in the order asked for. `run`
/// follows the equation of `N` states from a start by a method. A run that fails or is given up has
/// its row, which says so.
///
/// # Errors
/// [`DimensionError`] if the question is about another equation.
pub fn work_precision<const N: usize>(
    question: &WorkPrecisionQuestion,
    run: impl Fn(Method, Tolerance, SVector<f64, N>, &DriveOptions) -> Result<Summary<N>, Failure>,
) -> Result<Vec<WorkPrecisionRow>, DimensionError> {
    let q = question;
    let wrong = |what, v: &[f64]| DimensionError { what, got: v.len(), wanted: N };
    let start =
        <[f64; N]>::try_from(q.start.as_slice()).map_err(|_| wrong("the start", &q.start))?;
    if q.solution.len() != N {
        return Err(wrong("the solution", &q.solution));
    }
    let options =
        DriveOptions { step_cap: q.step_cap, max_steps: q.max_steps, ..DriveOptions::to(q.t_end) };
    let runs = q.methods.iter().flat_map(|m| q.tolerances.iter().map(move |t| (*m, *t)));
    let rows = runs.map(|(method, tolerance)| {
        let mut row = WorkPrecisionRow {
            method,
            tolerance,
            error: None,
            statistics: None,
            stop: None,
            failure: None,
        };
        match run(method, tolerance, SVector::from(start), &options) {
            Ok(end) => {
                row.error = (end.stop == StopReason::EndTime)
                    .then(|| weighted_error(end.x.as_slice(), &q.solution, q.scale));
                (row.statistics, row.stop) = (Some(end.statistics), Some(end.stop));
            }
            Err(failure) => row.failure = Some(failure.to_string()),
        }
        row
    });
    Ok(rows.collect())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector1;

    use super::*;
    use twofold_integrate::{Ignore, Stepper, WithStepper, drive};
    use twofold_num::Elementary;
    use twofold_num::elementary::exp;
    use twofold_system::VectorField;

    /// x' = -1000 (x - 1): stiff enough to tell methods apart.
    struct Fast;
    impl VectorField<1> for Fast {
        fn eval<S: Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
            Vector1::new((S::one() - x[0]).scale(1000.0))
        }
    }

    struct FastRun<'a>(SVector<f64, 1>, &'a DriveOptions);
    impl WithStepper<1> for FastRun<'_> {
        type Answer = Result<Summary<1>, Failure>;
        fn with<M: Stepper<1>>(self, mut stepper: M) -> Self::Answer {
            drive(&Fast, self.0, self.1, &mut stepper, &mut Ignore, &())
        }
    }

    fn rows(question: &WorkPrecisionQuestion) -> Result<Vec<WorkPrecisionRow>, DimensionError> {
        work_precision(question, |method, tolerance, start, options| {
            method.with_stepper(tolerance, FastRun(start, options))
        })
    }

    fn question() -> WorkPrecisionQuestion {
        WorkPrecisionQuestion {
            start: vec![0.0],
            t_end: 10.0,
            step_cap: StepCap::None,
            solution: vec![1.0 - exp(-1e4)],
            scale: 1.0,
            methods: vec![Method::Radau5, Method::Dopri5],
            tolerances: [1e-4, 1e-8].map(|t| Tolerance { rtol: t, atol: t }).into(),
            max_steps: 2000,
        }
    }

    #[test]
    fn a_run_given_up_keeps_its_row_and_its_reason() {
        let rows = rows(&question()).unwrap();
        let methods: Vec<_> = rows.iter().map(|r| r.method).collect();
        assert_eq!(methods, [Method::Radau5, Method::Radau5, Method::Dopri5, Method::Dopri5]);
        for r in &rows[..2] {
            assert_eq!(r.stop, Some(StopReason::EndTime));
            assert!(r.error.unwrap() < r.tolerance.rtol, "{r:?}");
        }
        for r in &rows[2..] {
            assert_eq!((r.stop, r.error), (Some(StopReason::StepBudget), None), "{r:?}");
            assert_eq!(r.statistics.as_ref().unwrap().steps, 2000);
        }
    }

    #[test]
    fn failures_have_rows_too() {
        let tolerances = vec![Tolerance { rtol: 0.0, atol: 0.0 }];
        let rows = rows(&WorkPrecisionQuestion { tolerances, ..question() }).unwrap();
        assert!(rows.iter().all(|r| r.failure.is_some() && r.error.is_none()), "{rows:?}");
    }

    #[test]
    fn other_dimensions_are_refused() {
        for wrong in [
            WorkPrecisionQuestion { start: vec![0.0; 2], ..question() },
            WorkPrecisionQuestion { solution: Vec::new(), ..question() },
        ] {
            assert!(rows(&wrong).is_err());
        }
    }

    #[test]
    fn questions_survive_json_and_refuse_what_they_do_not_know() {
        let json = serde_json::to_value(question()).unwrap();
        assert_eq!(
            serde_json::from_value::<WorkPrecisionQuestion>(json.clone()).unwrap(),
            question()
        );
        let mut more = json;
        more["colour"] = "red".into();
        assert!(serde_json::from_value::<WorkPrecisionQuestion>(more).is_err());
    }

    #[test]
    fn errors_are_weighed_component_by_component() {
        // 0.5/(1 + 1) and 2/(4 + 1); and the other way around.
        assert_eq!(weighted_error(&[1.5, -2.0], &[1.0, -4.0], 1.0), 0.4);
        assert_eq!(weighted_error(&[-2.0, 1.5], &[-4.0, 1.0], 1.0), 0.4);
        assert_eq!(weighted_error(&[3.0], &[0.0], 0.5), 6.0);
        assert_eq!(weighted_error(&[1.0, 2.0], &[1.0, 2.0], 0.0), 0.0);
    }
}
