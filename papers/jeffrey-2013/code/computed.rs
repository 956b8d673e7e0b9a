//! Questions that a figure computes by itself, stored under the digest of this crate's code.

use serde_json::Value;

use twofold_integrate::Monitor;
use twofold_job::{Answer, Ask, JobError, Question, Table};

/// A question whose numbers are a plain function of it.
#[derive(Clone, Debug)]
pub struct Computed {
    /// The kind.
    pub kind: &'static str,
    /// Every number that it depends on.
    pub question: Value,
    /// Expected work, in the units of [`Question::cost`].
    pub cost: f64,
    /// Computes the tables.
    pub compute: fn() -> Result<Vec<Table>, JobError>,
}

impl Question for Computed {
    fn kind(&self) -> &'static str {
        self.kind
    }

    fn json(&self) -> Value {
        self.question.clone()
    }

    fn code(&self) -> Option<&'static str> {
        Some(env!("TWOFOLD_FIGURES"))
    }

    fn cost(&self) -> f64 {
        self.cost
    }

    fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        Ok(Answer::of_tables((self.compute)()?))
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;
    use twofold_job::question::{key, question_hash};

    use super::*;

    /// The same question of the same kind, computed by code that the numerics' digest covers.
    #[derive(Debug)]
    struct OfTheNumerics(Computed);

    impl Question for OfTheNumerics {
        fn kind(&self) -> &'static str {
            self.0.kind()
        }

        fn json(&self) -> Value {
            self.0.json()
        }

        fn compute(&self, executor: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
            self.0.compute(executor, monitor)
        }
    }

    #[test]
    fn what_a_figure_computes_is_stored_under_the_digest_of_its_code() {
        let own = Computed {
            kind: "own",
            question: json!({ "x": 1 }),
            cost: 1.0,
            compute: || Ok(Vec::new()),
        };
        let other = OfTheNumerics(own.clone());
        assert_eq!(question_hash(&own), question_hash(&other));
        assert_ne!(key(&own), key(&other));
        assert!(own.code().is_some_and(|digest| digest.len() == 32));
    }
}
