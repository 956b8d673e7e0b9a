//! Studies: pictures that are made of something other than the paper's runs.
//!
//! A study is a question written out as JSON (hashed as the spec), a pure function from nothing but that question to named
//! tables of numbers (hashed as the data), and a drawing of those tables.

use serde_json::Value;

use crate::job::simulate::RunError;
use crate::job::table::Table;
use crate::render::Sheet;

/// A picture that computes its own numbers. Function pointers keep figures plain data.
#[derive(Clone, Copy, Debug)]
pub struct Study {
    /// Every number that the study depends on.
    pub question: fn() -> Value,
    /// Computes the tables.
    pub compute: fn() -> Result<Vec<Table>, RunError>,
    /// Draws them: panels, legend, subtitle, footer. Title, description and provenance are added by the pipeline.
    pub draw: fn(&[Table]) -> Sheet,
}
