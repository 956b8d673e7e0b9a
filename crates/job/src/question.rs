//! The question that a job asks, and its key.

use std::fmt;
use std::sync::Arc;

use serde_json::{Value, json};

use super::answer::{Answer, NoSuchFact};
use super::spec::SpecError;
use crate::record::Hash;
use twofold_hybrid::HybridError;
use twofold_hybrid::rests::RestError;
use twofold_integrate::filippov::FilippovError;
use twofold_integrate::{Failure, Monitor};
use twofold_system::BindError;

/// Version of the numerics: a digest of the sources that numbers depend on, made when the program
/// is built. Answers of another version are never taken for this one's.
pub const NUMERICS: &str = env!("TWOFOLD_NUMERICS");

/// Answers questions, each computed once: an [`Executor`](super::Executor), as questions see it.
pub trait Ask: Sync {
    /// The answer to a question.
    ///
    /// # Errors
    ///
    /// The failure of the computation; asked again, the same failure.
    fn ask(&self, question: &dyn Question) -> Result<Arc<Answer>, JobError>;

    /// The answer to a question that is not expected to be asked again: it is kept in the store,
    /// not in memory.
    ///
    /// # Errors
    ///
    /// As [`Ask::ask`].
    fn ask_in_passing(&self, question: &dyn Question) -> Result<Arc<Answer>, JobError>;

    /// Computes all these questions in parallel, dependencies first.
    fn gather(&self, questions: &[AnyQuestion]);
}

/// A computation as data: everything that its answer depends on, and nothing else.
///
/// Two equal questions have equal answers, to the last bit, on any machine. A question computes on
/// the thread that asks it and starts no others: parallel is only what is asked side by side
/// ([`Ask::gather`]).
pub trait Question: fmt::Debug + Send + Sync {
    /// The kind of computation: "run".
    fn kind(&self) -> &'static str;

    /// Every number that the answer depends on.
    fn json(&self) -> Value;

    /// Digest of the code that computes the answer, where that is not all part of [`NUMERICS`].
    fn code(&self) -> Option<&'static str> {
        None
    }

    /// A few words for a progress display.
    fn label(&self) -> String {
        self.kind().to_owned()
    }

    /// The last value that [`Monitor::reached`] will be given.
    fn extent(&self) -> f64 {
        1.0
    }

    /// Expected work in arbitrary units, the same for all kinds, without that of the questions it
    /// rests on: it decides only in which order things are done.
    fn cost(&self) -> f64 {
        1.0
    }

    /// Questions that computing this one will ask, as far as they are known beforehand.
    /// [`Ask::gather`] has them answered first, so that no thread waits for another; nothing
    /// else depends on it.
    fn rests_on(&self) -> Vec<AnyQuestion> {
        Vec::new()
    }

    /// Computes the answer. It may put other questions to `executor`; each is computed once.
    ///
    /// # Errors
    ///
    /// If the question makes no sense, or the computation cannot be carried out.
    fn compute(&self, executor: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError>;
}

/// A question that can be handed around.
pub type AnyQuestion = Arc<dyn Question>;

/// The digest of a question: the same for any version of the program that asks the same.
pub fn question_hash(question: &dyn Question) -> Hash {
    Hash::of_json(&json!({ "kind": question.kind(), "question": question.json() }))
}

/// The key under which an answer is kept: digest of the question and of the code that computes its
/// answer.
pub fn key(question: &dyn Question) -> Hash {
    let mut key =
        json!({ "kind": question.kind(), "question": question.json(), "numerics": NUMERICS });
    if let Some(code) = question.code() {
        key["code"] = code.into();
    }
    Hash::of_json(&key)
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
        "more than {limit} points were recorded by t = {t}, the most that are kept in memory (0.6 \
            GB): record crossings of a plane instead of the path, give a larger chord, or an \
            earlier end time"
    )]
    TooManyPoints {
        /// Time reached.
        t: f64,
        /// The limit.
        limit: usize,
    },
    /// A general system could not be followed.
    #[error(transparent)]
    General(Box<HybridError>),
    /// The rests of a general system could not be sought.
    #[error(transparent)]
    Rests(#[from] RestError),
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

impl From<HybridError> for JobError {
    fn from(error: HybridError) -> Self {
        JobError::General(Box::new(error))
    }
}

impl JobError {
    /// Whether the question itself is at fault, not the computation.
    pub fn is_bad_question(&self) -> bool {
        match self {
            JobError::Spec(_) | JobError::Dimension(_) => true,
            JobError::General(e) => {
                matches!(
                    **e,
                    HybridError::Equation(_) | HybridError::Start(_) | HybridError::Bad(_)
                )
            }
            JobError::Rests(e) => !matches!(e, RestError::Driven),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::spec::{Observation, SwitchSpec};
    use crate::sweep::OutcomeQuestion;
    use crate::*;
    use twofold_analyse::digits::DigitsQuestion;
    use twofold_analyse::floquet::ReturnPlane;
    use twofold_analyse::limit::{AfterVisitQuestion, ConvergenceQuestion};
    use twofold_analyse::lyapunov;
    use twofold_analyse::passage::PassageQuestion;
    use twofold_analyse::reference;
    use twofold_integrate::filippov::{FilippovOptions, FunnelGrid};
    use twofold_integrate::{StepCap, Tolerance};
    use twofold_system::{Caricature, System, Transition};

    /// Distinguishes wrong questions from failed computations.
    #[test]
    fn a_question_is_at_fault_or_its_computation_is() {
        let spec = SpecError { field: "start", value: "x".into(), rule: "give numbers" };
        let run = cases::run(
            cases::decays(2),
            SwitchSpec::tanh(1e-3),
            9.0,
            Observation::Times { every: 1.0 },
        );
        let dimension = run.system.bind::<3>().map(|_| ()).unwrap_err();
        for bad in [JobError::Spec(spec), JobError::Dimension(dimension)] {
            assert!(bad.is_bad_question(), "{bad}");
        }
        for other in [
            JobError::Interrupted,
            JobError::TooManyPoints { t: 1.0, limit: 2 },
            JobError::Other("no".into()),
        ] {
            assert!(!other.is_bad_question(), "{other}");
        }
    }

    /// One of each kind: stores and files know it by this name, and it is what makes two questions
    /// of one shape different.
    #[test]
    fn every_kind_of_question_has_a_name_of_its_own() {
        let system = System::from(Caricature::with_reinjection(0.1, 1e-5));
        let run = cases::run(
            system.clone(),
            SwitchSpec::tanh(1e-3),
            9.0,
            Observation::Times { every: 1.0 },
        );
        let (start, eps) = (vec![0.2, 0.0, -1.0], vec![1e-3]);
        let grid = FunnelGrid {
            shortest: 0.1,
            longest: 1.0,
            times: 3,
            horizon: 5.0,
            until_two_fold: true,
            per_step: 1,
        };
        let tolerance = Tolerance { rtol: 1e-9, atol: 1e-9 };
        let questions: [(AnyQuestion, &str); 12] = [
            (Arc::new(Run(run.clone())), "run"),
            (Arc::new(Classification::of(run.clone())), "classification"),
            (Arc::new(OutcomeQuestion(Classification::of(run.clone()))), "fate"),
            (Arc::new(PathComparison(run.clone(), run.clone())), "path-comparison"),
            (Arc::new(Horizon { run: run.clone(), within: 1e-9 }), "horizon"),
            (
                Arc::new(LargestExponent {
                    system: system.clone(),
                    switch: run.switch,
                    start: start.clone(),
                    settings: lyapunov::LyapunovOptions::default(),
                }),
                "largest-exponent",
            ),
            (
                Arc::new(ClosedOrbit {
                    system: system.clone(),
                    switch: run.switch,
                    start: start.clone(),
                    settle: 0.0,
                    plane: ReturnPlane { axis: 1, value: 0.0, upward: true },
                    returns: None,
                    tolerance,
                    longest_return: 9.0,
                    along: None,
                }),
                "closed-orbit",
            ),
            (
                Arc::new(MethodDigits {
                    system: system.clone(),
                    eps: 1e-3,
                    compared: DigitsQuestion {
                        start: [0.2, 0.0, -1.0],
                        section: reference::SectionPlane { coordinate: 1, value: 0.0 },
                        t_end: 9.0,
                        near: 0.1,
                        methods: Vec::new(),
                        step_cap: StepCap::None,
                        max_steps: 9,
                    },
                }),
                "method-digits",
            ),
            (
                Arc::new(SmoothingLimit {
                    system: system.clone(),
                    compared: ConvergenceQuestion {
                        start: start.clone(),
                        times: vec![1.0],
                        eps: eps.clone(),
                        settings: FilippovOptions::default(),
                    },
                }),
                "smoothing-limit",
            ),
            (
                Arc::new(AfterVisit {
                    system: system.clone(),
                    compared: AfterVisitQuestion {
                        start,
                        t_end: 9.0,
                        eps,
                        beyond: 0.1,
                        grid,
                        refinements: 1,
                        finer: 3,
                        settings: FilippovOptions::default(),
                    },
                }),
                "after-visit",
            ),
            (
                Arc::new(TwoFoldPassage {
                    system: system.clone(),
                    transition: Transition::Tanh,
                    eps: 1e-3,
                    followed: PassageQuestion::far([0.2, 0.0, -1.0], 0.1, 9.0),
                }),
                "two-fold-passage",
            ),
            (
                Arc::new(Leaving {
                    system,
                    switch: run.switch,
                    runs: Vec::new(),
                    tolerance: 1e-9,
                    longest_step: 1.0,
                    by: 9.0,
                }),
                "leaving",
            ),
        ];
        let mut keys = BTreeSet::new();
        for (question, kind) in &questions {
            assert_eq!(question.kind(), *kind);
            assert!(question.json().as_object().is_some_and(|asked| !asked.is_empty()), "{kind}");
            keys.extend([
                key(&**question).as_str().to_owned(),
                question_hash(&**question).as_str().to_owned(),
            ]);
        }
        assert_eq!(keys.len(), 2 * questions.len());
    }

    /// A key is of the kind, of what is asked, and of the version; a question's digest, of the
    /// first two.
    #[test]
    fn a_key_is_of_kind_question_and_version() {
        #[derive(Debug)]
        struct Asked(&'static str, u64);
        impl Question for Asked {
            fn kind(&self) -> &'static str {
                self.0
            }
            fn json(&self) -> Value {
                json!(self.1)
            }
            fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
                Err(JobError::Interrupted)
            }
        }
        let text = |numerics: &str| format!("{{\"kind\":\"a\",{numerics}\"question\":1}}");
        assert_eq!(question_hash(&Asked("a", 1)), Hash::of(text("").as_bytes()));
        assert_eq!(
            key(&Asked("a", 1)),
            Hash::of(text(&format!("\"numerics\":\"{NUMERICS}\",")).as_bytes())
        );
        for other in [Asked("b", 1), Asked("a", 2)] {
            assert!(
                key(&other) != key(&Asked("a", 1))
                    && question_hash(&other) != question_hash(&Asked("a", 1))
            );
        }
    }
}
