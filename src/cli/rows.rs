//! Rows of a sweep, computed side by side and kept as they finish.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;

use super::progress::{Progress, Tally};
use super::{CliError, in_pool};
use crate::job::sweep::Rows;
use crate::record::Journal;

/// The name of the journal of a file.
pub fn journal_of(file: &Path) -> PathBuf {
    let mut name = file.as_os_str().to_owned();
    name.push(".journal");
    name.into()
}

/// Computes the rows of these numbers on so many threads (0: one per core) and adds them to `rows`, and to `journal` as they finish. Whoever
/// asks to stop gets what is finished.
///
/// # Errors
///
/// If a row cannot be written to the journal, or threads cannot be had.
pub fn compute(
    rows: Rows,
    pending: &[u64],
    journal: Option<&mut Journal>,
    threads: usize,
    progress: &Progress,
) -> Result<Rows, CliError> {
    let sweep = rows.sweep().clone();
    let shared = Mutex::new((rows, journal, None::<CliError>));
    let tally = Tally::new(progress, pending.len() as u64);
    let next = AtomicUsize::new(0);
    in_pool(threads, || {
        (0..rayon::current_num_threads()).into_par_iter().with_max_len(1).for_each(|_| {
            // Rows are taken in order, so that what is finished at any moment is a fair part of the whole.
            while let Some(number) = pending.get(next.fetch_add(1, Ordering::Relaxed)) {
                if progress.asked_to_stop().is_some() {
                    break;
                }
                let Ok(row) = sweep.row(*number, &tally) else { break };
                let mut shared = shared.lock().unwrap_or_else(PoisonError::into_inner);
                let (rows, journal, trouble) = &mut *shared;
                if trouble.is_some() {
                    break;
                }
                if let Some(journal) = journal.as_mut()
                    && let Err(error) = journal.append(&row.line())
                {
                    *trouble = Some(error.into());
                    break;
                }
                tally.done(row.reason().is_some());
                // A row of this number is not there: it was missing.
                let _ = rows.insert(row);
            }
        });
    })?;
    tally.finish();
    match shared.into_inner().unwrap_or_else(PoisonError::into_inner) {
        (_, _, Some(trouble)) => Err(trouble),
        (rows, _, None) => Ok(rows),
    }
}
