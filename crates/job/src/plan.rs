//! The order in which questions are computed in parallel.
//!
//! Dependencies come first, so that no thread waits for them. Of the questions that can be started,
//! the one with the most work on its path is started: its own work and that of its dependents
//! (critical path: Graham 1969, Hu 1961).

use std::collections::{BTreeSet, HashMap};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use super::question::{AnyQuestion, question_hash};
use crate::record::Hash;

/// Questions, each once, and those that they are known to rest on.
pub(super) struct QuestionPlan {
    /// Those that a question rests on stand before it.
    tasks: Vec<Task>,
    /// Tasks by how much is behind them, the most first.
    by_rank: Vec<usize>,
    /// Ranks of tasks that rest on nothing unfinished.
    ready: Mutex<BTreeSet<usize>>,
}

struct Task {
    question: AnyQuestion,
    /// Tasks that rest on this one.
    followers: Vec<usize>,
    /// Number of its unfinished dependencies.
    waits_for: AtomicUsize,
    rank: usize,
}

impl QuestionPlan {
    /// The plan for `questions` and all their dependencies.
    pub fn of(questions: &[AnyQuestion]) -> Self {
        let mut plan = Self { tasks: Vec::new(), by_rank: Vec::new(), ready: Mutex::default() };
        let mut known = HashMap::new();
        for question in questions {
            plan.enter(question, &mut known);
        }
        let mut behind: Vec<f64> = plan.tasks.iter().map(|task| task.question.cost()).collect();
        for task in (0..plan.tasks.len()).rev() {
            let most = plan.tasks[task].followers.iter().map(|f| behind[*f]).fold(0.0, f64::max);
            behind[task] += most;
        }
        plan.by_rank = (0..plan.tasks.len()).collect();
        plan.by_rank.sort_by(|a, b| behind[*b].total_cmp(&behind[*a]));
        for (rank, task) in plan.by_rank.iter().enumerate() {
            plan.tasks[*task].rank = rank;
        }
        let free = plan.tasks.iter().filter(|task| task.waits_for.load(Ordering::Relaxed) == 0);
        plan.ready = Mutex::new(free.map(|task| task.rank).collect());
        plan
    }

    /// The place of a question, which is entered behind all that it rests on.
    fn enter(&mut self, question: &AnyQuestion, known: &mut HashMap<Hash, usize>) -> usize {
        let hash = question_hash(&**question);
        if let Some(place) = known.get(&hash) {
            return *place;
        }
        let before: BTreeSet<usize> =
            question.rests_on().iter().map(|q| self.enter(q, known)).collect();
        let place = self.tasks.len();
        for task in &before {
            self.tasks[*task].followers.push(place);
        }
        let waits_for = AtomicUsize::new(before.len());
        self.tasks.push(Task {
            question: question.clone(),
            followers: Vec::new(),
            waits_for,
            rank: 0,
        });
        known.insert(hash, place);
        place
    }

    /// Calls `ask` once for every question, side by side on the current thread pool.
    pub fn carry_out(&self, ask: impl Fn(&AnyQuestion) + Sync) {
        let free = self.ready().len();
        rayon::scope(|scope| {
            for _ in 0..free {
                scope.spawn(|scope| self.do_next(scope, &ask));
            }
        });
    }

    /// Does the first of the tasks that are ready. There is one for every call.
    fn do_next<'scope, A: Fn(&AnyQuestion) + Sync>(
        &'scope self,
        scope: &rayon::Scope<'scope>,
        ask: &'scope A,
    ) {
        let Some(rank) = self.ready().pop_first() else { return };
        let task = &self.tasks[self.by_rank[rank]];
        ask(&task.question);
        for follower in &task.followers {
            let follower = &self.tasks[*follower];
            if follower.waits_for.fetch_sub(1, Ordering::AcqRel) == 1 {
                self.ready().insert(follower.rank);
                scope.spawn(|scope| self.do_next(scope, ask));
            }
        }
    }

    fn ready(&self) -> std::sync::MutexGuard<'_, BTreeSet<usize>> {
        // A panic elsewhere left no set half changed.
        self.ready.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::question::Ask;
    use crate::{Answer, JobError, Question};
    use serde_json::{Value, json};
    use std::sync::Arc;
    use twofold_integrate::Monitor;

    /// Rests on the questions with its divisors' numbers; the larger, the more work.
    #[derive(Debug)]
    struct Number(u64);

    impl Question for Number {
        fn kind(&self) -> &'static str {
            "number"
        }
        fn json(&self) -> Value {
            json!(self.0)
        }
        fn cost(&self) -> f64 {
            self.0 as f64
        }
        fn rests_on(&self) -> Vec<AnyQuestion> {
            (1..self.0)
                .filter(|n| self.0.is_multiple_of(*n))
                .map(|n| Arc::new(Number(n)) as _)
                .collect()
        }
        fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
            Ok(Answer::of_tables(Vec::new()))
        }
    }

    fn order(threads: usize, numbers: &[u64]) -> Vec<u64> {
        let questions: Vec<AnyQuestion> =
            numbers.iter().map(|n| Arc::new(Number(*n)) as _).collect();
        let plan = QuestionPlan::of(&questions);
        let done = Mutex::new(Vec::new());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| plan.carry_out(|q| done.lock().unwrap().push(q.json().as_u64().unwrap())));
        done.into_inner().unwrap()
    }

    #[test]
    fn the_longest_way_goes_first() {
        // Behind 5: 5 + 10. Behind 2: 2 + 10 (or 4). 7 has 7 behind it, 4 has 4 + 0.
        assert_eq!(order(1, &[4, 10, 7]), [1, 5, 2, 10, 7, 4]);
    }

    #[test]
    fn each_is_done_once_and_after_all_that_it_rests_on() {
        let all: Vec<u64> = (1..200).chain(50..100).collect();
        for threads in [1, 2, 5] {
            let done = order(threads, &all);
            assert_eq!(done.iter().collect::<BTreeSet<_>>().len(), 199);
            assert_eq!(done.len(), 199);
            // Notes are taken when a task is over, and none begins before those it rests on are.
            for (at, n) in done.iter().enumerate() {
                assert!(
                    done[at..].iter().skip(1).all(|later| n % later != 0),
                    "{n} before a divisor: {done:?}"
                );
            }
        }
    }
}
