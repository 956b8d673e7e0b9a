//! Studies: pictures that are made of something other than the paper's runs.

use std::sync::Arc;

use serde_json::Value;

use twofold_integrate::Watch;
use twofold_job::{Answer, AnyQuestion, Desk, JobError, Question, Table};
use twofold_render::Sheet;

/// A picture that asks its own questions and draws the answers. Function pointers keep figures plain data.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    /// What is asked.
    pub questions: fn() -> Vec<AnyQuestion>,
    /// Draws the answers, in the questions' order: panels, legend, subtitle, footer. Title, description and provenance are added by the
    /// pipeline.
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

    fn compute(&self, _: &Desk<'_>, _: &dyn Watch) -> Result<Answer, JobError> {
        Ok(Answer::of_tables((self.compute)()?))
    }
}

impl Study {
    /// The tables of all answers, in order.
    pub fn tables(answers: &[Arc<Answer>]) -> Vec<Table> {
        answers.iter().flat_map(|a| a.tables.iter().cloned()).collect()
    }
}
