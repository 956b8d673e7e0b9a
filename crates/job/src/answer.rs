//! The answer to a question: tables, facts, work done, and why the computation ended.

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::table::Table;
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
    /// What was looked for was found before the time was up.
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
        let mut bytes = super::encode::bits(&self.tables);
        bytes.extend_from_slice(&canonical_json(&self.facts));
        bytes.extend_from_slice(self.stop.word().as_bytes());
        Hash::of(&bytes)
    }
}
