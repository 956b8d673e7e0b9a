//! The executor: computes each question once, or takes its answer from the store.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::answer::{Answer, Stop};
use super::plan::QuestionPlan;
use super::question::{AnyQuestion, Ask, JobError, Question, key};
use super::store::{Kept, Store};
use crate::record::Hash;
use twofold_integrate::Monitor;

/// Displays the progress of jobs.
pub trait Progress: Sync {
    /// A job begins; its monitor will be told values up to `extent`.
    fn begin<'a>(&'a self, label: &str, extent: f64) -> Box<dyn JobMonitor + 'a>;
    /// One line for the user.
    fn line(&self, _text: &str) {}
}

/// Follows one job.
pub trait JobMonitor: Monitor {
    /// The job is over; `what` is said of it.
    fn done(self: Box<Self>, what: &str);
}

impl Progress for () {
    fn begin<'a>(&'a self, _: &str, _: f64) -> Box<dyn JobMonitor + 'a> {
        Box::new(())
    }
}

impl JobMonitor for () {
    fn done(self: Box<Self>, _: &str) {}
}

/// An answer in the making, or made.
type Cell = Arc<OnceLock<Result<Arc<Answer>, JobError>>>;

/// Computes each question once, and hands out its answer.
///
/// Several threads may ask at a time; a thread that asks for an answer that another is computing
/// waits for it. There is no deadlock: dependencies between jobs have no cycles, and a job does no
/// other work while it computes (see [`Question`]).
///
/// ```
/// use twofold_job::{Executor, Run, spec::*};
/// use twofold_system::System;
/// let run = RunSpec {
///     system: System::builtin("chua").expect("built in"),
///     switch: SwitchSpec::tanh(1e-2),
///     start: vec![0.1, 0.0, 0.0],
///     t_end: 20.0,
///     method: MethodSpec::ndsolve_defaults(Method::Dopri5),
///     schedule: Default::default(),
///     observe: Observation::Section { coordinate: 1, value: 0.0 },
/// };
/// let executor = Executor::quiet();
/// let answer = executor.ask(&Run(run.clone()))?;
/// let again = executor.ask(&Run(run))?; // not computed again
/// assert!(std::sync::Arc::ptr_eq(&answer, &again));
/// # Ok::<(), twofold_job::JobError>(())
/// ```
pub struct Executor<'a> {
    store: Option<Store>,
    progress: &'a dyn Progress,
    answers: Mutex<HashMap<Hash, Cell>>,
    /// For what questions are asked, as progress says it.
    purposes: Mutex<HashMap<Hash, String>>,
}

impl Executor<'static> {
    /// An executor without store and without display.
    pub fn quiet() -> Self {
        Executor::new(None, &())
    }
}

impl Ask for Executor<'_> {
    fn ask(&self, question: &dyn Question) -> Result<Arc<Answer>, JobError> {
        Executor::ask(self, question)
    }

    fn ask_in_passing(&self, question: &dyn Question) -> Result<Arc<Answer>, JobError> {
        Executor::ask_in_passing(self, question)
    }

    fn gather(&self, questions: &[AnyQuestion]) {
        Executor::gather(self, questions);
    }
}

impl<'a> Executor<'a> {
    /// An executor that keeps answers in `store`, if there is one, and reports to `progress`.
    pub fn new(store: Option<Store>, progress: &'a dyn Progress) -> Self {
        Self { store, progress, answers: Mutex::default(), purposes: Mutex::default() }
    }

    /// The display.
    pub fn progress(&self) -> &'a dyn Progress {
        self.progress
    }

    /// The store, if answers are kept.
    pub fn store(&self) -> Option<&Store> {
        self.store.as_ref()
    }

    /// Says for what a question is asked: a figure's panel, a claim. Progress shows the first that
    /// was said before its label.
    pub fn asked_for(&self, question: &dyn Question, purpose: impl Into<String>) {
        let mut purposes = self.purposes.lock().unwrap_or_else(PoisonError::into_inner);
        purposes.entry(key(question)).or_insert_with(|| purpose.into());
    }

    /// The answer to a question.
    ///
    /// # Errors
    ///
    /// The failure of the computation; asked again, the same failure.
    pub fn ask(&self, question: &dyn Question) -> Result<Arc<Answer>, JobError> {
        let key = key(question);
        let cell = {
            // A panic in another job left nothing half done: the map only grows.
            let mut answers = self.answers.lock().unwrap_or_else(PoisonError::into_inner);
            answers.entry(key.clone()).or_default().clone()
        };
        cell.get_or_init(|| self.answer(question, &key)).clone()
    }

    /// The answer to a question that is not expected to be asked again: it is kept in the store,
    /// not in memory.
    ///
    /// # Errors
    ///
    /// As [`Executor::ask`].
    pub fn ask_in_passing(&self, question: &dyn Question) -> Result<Arc<Answer>, JobError> {
        let key = key(question);
        let cell = self.answers.lock().unwrap_or_else(PoisonError::into_inner).get(&key).cloned();
        match cell {
            Some(cell) => cell.get_or_init(|| self.answer(question, &key)).clone(),
            None => self.answer(question, &key),
        }
    }

    fn answer(&self, question: &dyn Question, key: &Hash) -> Result<Arc<Answer>, JobError> {
        if let Some(store) = &self.store {
            match store.get(key, question) {
                Kept::Answer(answer) => return Ok(Arc::new(answer)),
                Kept::Nothing => {}
                Kept::Damaged(why) => self.progress.line(&format!("{why}; computing it again")),
            }
        }
        let purpose =
            self.purposes.lock().unwrap_or_else(PoisonError::into_inner).get(key).cloned();
        let label = purpose.into_iter().chain([question.label()]).collect::<Vec<_>>().join(": ");
        let monitor = self.progress.begin(&label, question.extent());
        let answer = question.compute(self, &*monitor);
        match &answer {
            Ok(answer) => monitor.done(&said(answer)),
            Err(_) => monitor.done("failed"),
        }
        let answer = answer?;
        if let Some(store) = &self.store
            && answer.stop != Stop::Interrupted
            && let Err(error) = store.put(key, question, &answer)
        {
            // The answer is there; only the next run will have to compute it again.
            self.progress.line(&format!("not kept for the next run: {error}"));
        }
        Ok(Arc::new(answer))
    }

    /// Computes all these questions in parallel on the current thread pool: dependencies first, and
    /// of these the longest. With a store, answers are kept there and not in memory. Errors are
    /// kept in the executor until they are asked for.
    pub fn gather(&self, questions: &[AnyQuestion]) {
        QuestionPlan::of(questions).carry_out(|question| match &self.store {
            Some(store) if store.has(&key(&**question)) => {}
            _ => drop(self.ask(&**question)),
        });
        if self.store.is_some() {
            self.forget();
        }
    }

    /// Drops every answer from memory that the store has and that has no other owner.
    pub fn forget(&self) {
        let Some(store) = &self.store else { return };
        let mut answers = self.answers.lock().unwrap_or_else(PoisonError::into_inner);
        answers.retain(|key, cell| {
            let unused = cell
                .get()
                .is_some_and(|answer| answer.as_ref().is_ok_and(|a| Arc::strong_count(a) == 1));
            !(unused && store.has(key))
        });
    }
}

/// The line about a finished job.
fn said(answer: &Answer) -> String {
    // Facts have no rows to count.
    let rows = if answer.tables.is_empty() {
        "done".to_owned()
    } else {
        let count = answer.rows();
        format!("{count} row{}", if count == 1 { "" } else { "s" })
    };
    let work =
        answer.statistics.as_ref().map(|s| format!("{} steps, {rows}", s.steps)).unwrap_or(rows);
    match answer.stop {
        // The command reports a condition that was met, such as an event that ends the run.
        Stop::Finished | Stop::Found => work,
        other => format!("{work}, {}", other.word()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// Fibonacci numbers, each resting on two others; counts how often it is computed.
    #[derive(Debug)]
    struct Fibonacci<'a>(u64, &'a AtomicUsize);

    impl Question for Fibonacci<'static> {
        fn kind(&self) -> &'static str {
            "fibonacci"
        }
        fn json(&self) -> Value {
            json!(self.0)
        }
        fn cost(&self) -> f64 {
            self.0 as f64
        }
        fn compute(&self, executor: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
            self.1.fetch_add(1, Ordering::Relaxed);
            let value: u64 = match self.0 {
                13 => return Err(JobError::Other("unlucky".into())),
                n @ 0..2 => n,
                n => {
                    let before = |k| -> Result<u64, JobError> {
                        Ok(executor.ask(&Fibonacci(n - k, self.1))?.fact("value")?)
                    };
                    before(1)? + before(2)?
                }
            };
            Ok(Answer::of_tables(Vec::new()).with_fact("value", &value))
        }
    }

    #[test]
    fn each_question_is_computed_once_whatever_the_threads() {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let executor = Executor::quiet();
        let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
        let questions: Vec<AnyQuestion> =
            (0..13).chain(0..13).map(|n| Arc::new(Fibonacci(n, &COUNT)) as _).collect();
        pool.install(|| executor.gather(&questions));
        assert_eq!(COUNT.load(Ordering::Relaxed), 13);
        assert_eq!(executor.ask(&Fibonacci(12, &COUNT)).unwrap().fact::<u64>("value"), Ok(144));
        assert_eq!(COUNT.load(Ordering::Relaxed), 13);
    }

    #[test]
    fn what_the_store_has_is_not_held_in_memory() {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let folder = tempfile::tempdir().unwrap();
        let questions: Vec<AnyQuestion> =
            (0..8).map(|n| Arc::new(Fibonacci(n, &COUNT)) as _).collect();
        let held = |executor: &Executor<'_>| executor.answers.lock().unwrap().len();

        let executor = Executor::new(Some(Store::new(folder.path())), &());
        executor.gather(&questions);
        assert_eq!((COUNT.load(Ordering::Relaxed), held(&executor)), (8, 0));
        // Forgotten answers come from the store; answers with another owner stay in memory.
        let held_by_us = executor.ask(&Fibonacci(7, &COUNT)).unwrap();
        executor.ask(&Fibonacci(6, &COUNT)).unwrap();
        executor.forget();
        assert_eq!((COUNT.load(Ordering::Relaxed), held(&executor)), (8, 1));
        drop(held_by_us);

        // An executor that begins with them reads none of them (one is damaged and not missed), and
        // computes only what is missing.
        let next = Executor::new(Some(Store::new(folder.path())), &());
        let path = Store::new(folder.path()).path(&key(&*questions[3]));
        let whole = std::fs::read(&path).unwrap();
        std::fs::write(&path, &whole[1..]).unwrap();
        next.gather(&questions);
        std::fs::write(&path, &whole).unwrap();
        assert_eq!((COUNT.load(Ordering::Relaxed), held(&next)), (8, 0));
        next.gather(&[Arc::new(Fibonacci(8, &COUNT)) as _]);
        assert_eq!(COUNT.load(Ordering::Relaxed), 9);

        // Without a store, memory is the only place.
        let without = Executor::quiet();
        without.gather(&questions);
        without.forget();
        assert_eq!(held(&without), 8);
    }

    #[test]
    fn what_is_asked_in_passing_is_not_kept() {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let (executor, question) = (Executor::quiet(), Fibonacci(1, &COUNT));
        for times in 1..=2 {
            assert_eq!(executor.ask_in_passing(&question).unwrap().fact::<u64>("value"), Ok(1));
            assert_eq!(COUNT.load(Ordering::Relaxed), times);
        }
        // An answer that is kept already is used.
        executor.ask(&question).unwrap();
        executor.ask_in_passing(&question).unwrap();
        assert_eq!(COUNT.load(Ordering::Relaxed), 3);
    }

    #[test]
    fn an_error_reaches_whoever_asks() {
        static COUNT: AtomicUsize = AtomicUsize::new(0);
        let executor = Executor::quiet();
        for _ in 0..2 {
            assert_eq!(
                executor.ask(&Fibonacci(14, &COUNT)).unwrap_err(),
                JobError::Other("unlucky".into())
            );
        }
        assert_eq!(executor.ask(&Fibonacci(3, &COUNT)).unwrap().fact::<u64>("value"), Ok(2));
    }
}
