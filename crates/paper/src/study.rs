//! Studies: pictures that are made of something other than the paper's runs.

use std::sync::Arc;

use serde_json::Value;

use twofold_integrate::Monitor;
use twofold_job::{Answer, AnyQuestion, Ask, JobError, Question, Table};
use twofold_render::Sheet;

/// A picture that asks its own questions and draws the answers. Function pointers keep figures
/// plain data.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    /// The questions.
    pub questions: fn() -> Vec<AnyQuestion>,
    /// Draws the answers, in the questions' order: panels, legend, subtitle, footer. Title,
    /// description and provenance are added by the pipeline.
    pub draw: fn(&[Arc<Answer>]) -> Sheet,
}

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

impl Study {
    /// The tables of all answers, in order.
    pub fn tables(answers: &[Arc<Answer>]) -> Vec<Table> {
        answers.iter().flat_map(|a| a.tables.iter().cloned()).collect()
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
