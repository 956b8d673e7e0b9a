//! The question that a job asks, and its key.

use std::fmt;
use std::sync::Arc;

use serde_json::{Value, json};

use super::answer::{Answer, NoSuchFact};
use super::desk::Desk;
use super::spec::SpecError;
use crate::integrate::filippov::FilippovError;
use crate::integrate::{Failure, Watch};
use crate::record::Hash;
use crate::system::BindError;

/// Version of the numerics: a digest of the sources that numbers depend on, made when the program is built. Answers of another version
/// are never taken for this one's.
pub const NUMERICS: &str = env!("TWOFOLD_NUMERICS");

/// A computation as data: everything that its answer depends on, and nothing else.
///
/// Two equal questions have equal answers, to the last bit, on any machine. A question computes on the thread that asks it and starts no
/// others: parallel is only what is asked side by side ([`Desk::gather`]).
pub trait Question: fmt::Debug + Send + Sync {
    /// What kind of computation it is: "run".
    fn kind(&self) -> &'static str;

    /// Every number that the answer depends on.
    fn json(&self) -> Value;

    /// A few words for a progress display.
    fn label(&self) -> String {
        self.kind().to_owned()
    }

    /// The last value that [`Watch::reached`] will be given.
    fn extent(&self) -> f64 {
        1.0
    }

    /// Expected work in arbitrary units, the same for all kinds, without that of the questions it rests on: it decides only in which order things
    /// are done.
    fn cost(&self) -> f64 {
        1.0
    }

    /// Questions that computing this one will ask, as far as they are known beforehand. [`Desk::gather`] has them answered first, so that no
    /// thread waits for another; nothing else depends on it.
    fn rests_on(&self) -> Vec<AnyQuestion> {
        Vec::new()
    }

    /// Computes the answer. Other questions may be asked of `desk`; each is computed once.
    ///
    /// # Errors
    ///
    /// If the question makes no sense, or the computation cannot be carried out.
    fn compute(&self, desk: &Desk<'_>, watch: &dyn Watch) -> Result<Answer, JobError>;
}

/// A question that can be handed around.
pub type AnyQuestion = Arc<dyn Question>;

/// The digest of a question: the same for any version of the program that asks the same.
pub fn question_hash(question: &dyn Question) -> Hash {
    Hash::of_json(&json!({ "kind": question.kind(), "question": question.json() }))
}

/// The key under which an answer is kept: digest of the question and of the numerics' version.
pub fn key(question: &dyn Question) -> Hash {
    Hash::of_json(&json!({ "kind": question.kind(), "question": question.json(), "numerics": NUMERICS }))
}

/// Why a question has no answer.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum JobError {
    /// The question is wrong.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// The integration failed.
    #[error(transparent)]
    Integration(#[from] Failure),
    /// The Filippov motion could not go on.
    #[error(transparent)]
    Filippov(#[from] FilippovError),
    /// More points than fit in memory.
    #[error(
        "more than {limit} points were recorded by t = {t}, the most that are kept in memory (0.6 GB): record passages through a plane instead of the path, give a larger chord, or an earlier end time"
    )]
    TooManyPoints {
        /// Time reached.
        t: f64,
        /// The limit.
        limit: usize,
    },
    /// The question is for systems with another number of states.
    #[error(transparent)]
    Dimension(#[from] BindError),
    /// Another answer, on which this one rests, is not what it should be.
    #[error(transparent)]
    Fact(#[from] NoSuchFact),
    /// Stopped from outside before there was an answer.
    #[error("interrupted")]
    Interrupted,
    /// The computation cannot be carried out for a reason of its own kind.
    #[error("{0}")]
    Other(String),
}

impl JobError {
    /// Whether the question itself is at fault, not the computation.
    pub fn is_bad_question(&self) -> bool {
        matches!(self, JobError::Spec(_) | JobError::Dimension(_))
    }
}
