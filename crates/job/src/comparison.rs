//! Comparison of two paths.

use serde_json::{Value, json};

use super::answer::Answer;
use super::question::{Ask, JobError, Question};
use super::recording::{Data, Recording};
use super::run::Run;
use super::spec::RunSpec;
use twofold_analyse::Sample;
use twofold_analyse::divider::{DividerWalk, STRIDES, common_box};
use twofold_integrate::Monitor;

/// Organisation of two runs' paths, and their overlap. Facts: `freshness` (share of each path's
/// strides into new places) and `shared` ([`Shared`](twofold_analyse::divider::Shared)).
#[derive(Clone, Debug, PartialEq)]
pub struct PathComparison(pub RunSpec, pub RunSpec);

impl Question for PathComparison {
    fn kind(&self) -> &'static str {
        "path-comparison"
    }

    fn json(&self) -> Value {
        json!({ "runs": [&self.0, &self.1], "strides": STRIDES })
    }

    fn label(&self) -> String {
        "two paths compared".into()
    }

    fn cost(&self) -> f64 {
        Run(self.0.clone()).cost() + Run(self.1.clone()).cost()
    }

    fn compute(&self, executor: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let (a, b) = (path(executor, &self.0)?, path(executor, &self.1)?);
        let range = common_box([&a[..], &b[..]]);
        let (a, b) = (DividerWalk::new(&a, &range), DividerWalk::new(&b, &range));
        Ok(Answer::of_tables(Vec::new())
            .with_fact("freshness", &[a.freshness(), b.freshness()])
            .with_fact("shared", &a.compare(&b)))
    }
}

fn path(executor: &dyn Ask, run: &RunSpec) -> Result<Vec<Sample>, JobError> {
    // Many pairs are compared, of paths that have no other use and together fill much memory.
    let recording =
        Recording::of_answer(run, &*executor.ask_in_passing(&Run(run.clone()))?)?.whole()?;
    match recording.data {
        Data::Path(samples) => Ok(samples),
        _ => {
            Err(JobError::Other("only paths can be compared as paths; leave out --section".into()))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Executor;
    use crate::cases;
    use crate::spec::{Observation, SwitchSpec};

    /// A path shares everything with itself; a section is no path.
    #[test]
    fn only_paths_are_compared() {
        let field = ["v", "-x", "-z"];
        let run = |observe| {
            cases::run(
                cases::smooth(&["x", "v", "z"], "x + 9", &field),
                SwitchSpec::tanh(1e-2),
                20.0,
                observe,
            )
        };
        let path = run(Observation::Path { chord: 1e-3 });
        let answer =
            PathComparison(path.clone(), path.clone()).compute(&Executor::quiet(), &()).unwrap();
        let [a, b] = answer.fact::<[f64; 2]>("freshness").unwrap();
        assert!(a == b && a > 0.0 && a <= 1.0, "{a} {b}");
        let section = run(Observation::Section { coordinate: 0, value: 0.0 });
        for pair in [PathComparison(path.clone(), section.clone()), PathComparison(section, path)] {
            let said = pair.compute(&Executor::quiet(), &()).unwrap_err().to_string();
            assert!(said.contains("only paths can be compared"), "{said}");
        }
    }
}
