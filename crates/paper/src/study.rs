//! Studies: pictures that are made of something other than the paper's runs.

use std::sync::Arc;

use twofold_job::{Answer, AnyQuestion, Table};
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

impl Study {
    /// The tables of all answers, in order.
    pub fn tables(answers: &[Arc<Answer>]) -> Vec<Table> {
        answers.iter().flat_map(|a| a.tables.iter().cloned()).collect()
    }
}
