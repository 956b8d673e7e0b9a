//! The answer to a question: tables, facts, work done, and why the computation ended.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::table::{Cells, ColumnKind, Table};
use crate::record::Hash;
use crate::record::hash::canonical_json;
use twofold_integrate::{Statistics, StopReason};

/// The result of a job.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// The numbers, as named tables.
    pub tables: Vec<Table>,
    /// Single findings by name: the final state, an exponent, a verdict's evidence.
    pub facts: Map<String, Value>,
    /// Work done, where time was stepped.
    pub statistics: Option<Statistics>,
    /// Why the computation ended.
    pub stop: Stop,
}

/// Why a computation ended. An answer always says so: one that was cut short never looks like one
/// that was finished.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Stop {
    /// All that was asked for was done.
    Finished,
    /// The condition looked for was met before the end time.
    Found,
    /// The future is a set, and the question names no member to follow.
    SetValued,
    /// The budget of steps was used up: what is there is what was done until then.
    StepBudget,
    /// Asked to stop from outside: what is there is what was done until then.
    Interrupted,
    /// The computation failed: what is there is what was done until then.
    Failed,
}

impl Stop {
    /// The word in files.
    pub fn word(self) -> &'static str {
        match self {
            Stop::Finished => "finished",
            Stop::Found => "found",
            Stop::SetValued => "set-valued",
            Stop::StepBudget => "step-budget",
            Stop::Interrupted => "interrupted",
            Stop::Failed => "failed",
        }
    }
}

impl From<StopReason> for Stop {
    fn from(reason: StopReason) -> Self {
        match reason {
            StopReason::EndTime => Stop::Finished,
            StopReason::Observer => Stop::Found,
            StopReason::Cancelled => Stop::Interrupted,
            StopReason::StepBudget => Stop::StepBudget,
            StopReason::SetValued => Stop::SetValued,
        }
    }
}

/// A fact that is missing from an answer, or has another shape than was asked for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "the answer has no fact \"{name}\" of the kind wanted ({why}); was it made by another version?"
)]
pub struct NoSuchFact {
    /// The fact's name.
    pub name: String,
    /// The reason.
    pub why: String,
}

impl Answer {
    /// An answer made of tables alone.
    pub fn of_tables(tables: Vec<Table>) -> Self {
        Self { tables, facts: Map::new(), statistics: None, stop: Stop::Finished }
    }

    /// Adds a fact.
    pub fn with_fact<T: Serialize>(mut self, name: &str, value: &T) -> Self {
        let value = serde_json::to_value(value)
            .expect("facts are plain data: string keys, no failing serialisers");
        self.facts.insert(name.to_owned(), value);
        self
    }

    /// A fact.
    ///
    /// # Errors
    ///
    /// If there is none of that name, or it is of another shape.
    pub fn fact<T: DeserializeOwned>(&self, name: &str) -> Result<T, NoSuchFact> {
        let missing = |why: String| NoSuchFact { name: name.to_owned(), why };
        let value = self.facts.get(name).ok_or_else(|| missing("there is none".into()))?;
        T::deserialize(value).map_err(|e| missing(e.to_string()))
    }

    /// The table of that name.
    pub fn table(&self, name: &str) -> Option<&Table> {
        self.tables.iter().find(|t| t.name == name)
    }

    /// Rows of all tables.
    pub fn rows(&self) -> usize {
        self.tables.iter().map(Table::len).sum()
    }

    /// The hash of what was found: tables, facts and stop reason, but not the work that it took.
    pub fn hash(&self) -> Hash {
        let mut bytes = bits(&self.tables);
        bytes.extend_from_slice(&canonical_json(&self.facts));
        bytes.extend_from_slice(self.stop.word().as_bytes());
        Hash::of(&bytes)
    }
}

/// The bytes that are hashed: table by table, column by column, little-endian. Names and units are
/// part of them; all not-a-numbers are one.
pub fn bits(tables: &[Table]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let text = |bytes: &mut Vec<u8>, text: &str| {
        bytes.extend_from_slice(&(text.len() as u64).to_le_bytes());
        bytes.extend_from_slice(text.as_bytes());
    };
    bytes.extend_from_slice(&(tables.len() as u64).to_le_bytes());
    for table in tables {
        text(&mut bytes, &table.name);
        bytes.extend_from_slice(&(table.columns.len() as u64).to_le_bytes());
        for column in &table.columns {
            text(&mut bytes, &column.name);
            text(&mut bytes, &column.unit);
            bytes.push(match column.kind() {
                ColumnKind::Number => b'n',
                ColumnKind::Integer => b'i',
                ColumnKind::Word => b'w',
            });
            bytes.extend_from_slice(&(column.len() as u64).to_le_bytes());
            match &column.cells {
                Cells::Numbers(values) => {
                    for v in values {
                        let v = if v.is_nan() { f64::NAN } else { *v };
                        bytes.extend_from_slice(&v.to_bits().to_le_bytes());
                    }
                }
                Cells::Integers(values) => {
                    values.iter().for_each(|v| bytes.extend_from_slice(&v.to_le_bytes()))
                }
                Cells::Words(words) => {
                    bytes.extend_from_slice(&(words.vocabulary.len() as u64).to_le_bytes());
                    words.vocabulary.iter().for_each(|w| text(&mut bytes, w));
                    words.codes.iter().for_each(|c| bytes.extend_from_slice(&c.to_le_bytes()));
                }
            }
        }
    }
    bytes
}
