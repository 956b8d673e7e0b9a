//! Rows of a sweep, computed side by side and kept as they finish.

use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::progress::{Progress, Tally};
use super::{CliError, in_pool};
use crate::job::sweep::{Row, Rows, Shard};
use crate::record::Journal;

/// Fewest and most rows that a thread takes at once for its lanes, of which there are eight to
/// thirty-two: the last of many rows leave few lanes empty for long.
const LEAST: usize = 16;
const MOST: usize = 192;

/// The name of the journal of a file.
pub fn journal_of(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(".journal");
    name.into()
}

/// The numbers of rows to compute, in order; never all of them in memory.
pub struct Pending {
    numbers: Box<dyn Iterator<Item = u64> + Send>,
    /// The next ones, looked at and not taken.
    ahead: VecDeque<u64>,
    left: u64,
}

impl Pending {
    /// The missing rows of a shard.
    pub fn of(rows: &Rows, shard: Shard) -> Self {
        let numbers = Box::new(rows.missing(shard));
        Self { numbers, ahead: VecDeque::new(), left: rows.missing_count(shard) }
    }

    /// The rows of these numbers.
    pub fn these(numbers: Vec<u64>) -> Self {
        let left = numbers.len() as u64;
        Self { numbers: Box::new(numbers.into_iter()), ahead: VecDeque::new(), left }
    }

    /// Number of rows left.
    pub fn left(&self) -> u64 {
        self.left
    }

    fn first_two(&mut self) -> Option<(u64, u64)> {
        let missing = 2 - self.ahead.len().min(2);
        self.ahead.extend(self.numbers.by_ref().take(missing));
        Some((*self.ahead.front()?, *self.ahead.get(1)?))
    }

    fn take(&mut self, count: usize) -> Vec<u64> {
        let ahead = self.ahead.len().min(count);
        let mut taken: Vec<u64> = self.ahead.drain(..ahead).collect();
        taken.extend(self.numbers.by_ref().take(count - ahead));
        self.left = self.left.saturating_sub(taken.len() as u64);
        taken
    }
}

/// Computes the rows of these numbers on so many threads (0: one per core) and adds them to `rows`,
/// and to `journal` as they finish. A request to stop keeps the finished rows.
///
/// # Errors
///
/// If a row cannot be written to the journal, or threads cannot be had.
pub fn compute(
    rows: Rows,
    pending: Pending,
    journal: Option<&mut Journal>,
    threads: usize,
    progress: &Progress,
) -> Result<Rows, CliError> {
    let sweep = rows.sweep().clone();
    let shared = Mutex::new((rows, journal, None::<CliError>));
    let tally = Tally::new(progress, pending.left);
    let next = Mutex::new(pending);
    let keep = |row: Row| {
        let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
        let (rows, journal, trouble) = &mut *shared;
        if trouble.is_some() {
            return false;
        }
        if let Some(journal) = journal.as_mut()
            && let Err(error) = journal.append(&row.line())
        {
            *trouble = Some(error.into());
            return false;
        }
        tally.done(row.reason().is_some());
        // A row of this number is not there: it was missing.
        let _ = rows.insert(row);
        true
    };
    in_pool(threads, || {
        let threads = rayon::current_num_threads();
        // Rows are taken in order, so that what is finished at any moment is a fair part of the
        // whole: those that may share lanes a few at a time, and fewer towards the end, lest one
        // thread be left with many.
        let some = || {
            let mut next = next.lock().unwrap_or_else(PoisonError::into_inner);
            let share = usize::try_from(next.left).unwrap_or(usize::MAX) / (2 * threads);
            let alike = matches!(next.first_two(), Some((a, b)) if sweep.share_lanes(a, b));
            next.take(share.clamp(if alike { LEAST } else { 1 }, MOST))
        };
        (0..threads).into_par_iter().with_max_len(1).for_each(|_| {
            loop {
                let numbers = some();
                if numbers.is_empty() || progress.asked_to_stop().is_some() {
                    break;
                }
                let mut more = true;
                let taken = sweep.rows_together(&numbers, &tally, &mut |row| {
                    more = keep(row);
                    more
                });
                if taken.is_err() || !more {
                    break;
                }
            }
        });
    })?;
    tally.finish();
    match shared.into_inner().unwrap_or_else(PoisonError::into_inner) {
        (_, _, Some(trouble)) => Err(trouble),
        (rows, _, None) => Ok(rows),
    }
}
