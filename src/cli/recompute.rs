//! Recomputation of the rows that are committed beside a figure.

use std::path::Path;

use super::CliError;
use super::progress::Progress;
use super::rows::{Pending, compute, journal_of};
use crate::job::question::NUMERICS;
use crate::job::sweep::Rows;
use crate::record::Journal;
use crate::record::files::write;

/// Computes every row of these CSV files (name, content) anew and compares it with the committed
/// one. What was computed is kept in `folder` under the same names, with a journal until a file is
/// whole, from which the next call goes on.
///
/// # Errors
///
/// [`CliError::Differs`] if a row comes out otherwise, with how many and the first;
/// [`CliError::Stopped`] if the user asked to stop; if a file cannot be read or written.
pub fn recompute(
    data: &[(&str, &[u8])],
    folder: &Path,
    threads: usize,
    progress: &Progress,
) -> Result<(), CliError> {
    let mut otherwise = Vec::new();
    for (name, bytes) in data {
        let unusable = |e: &dyn std::fmt::Display| CliError::Usage(format!("{name}: {e}"));
        let committed = Rows::from_csv(bytes).map_err(|e| unusable(&e))?;
        let file = folder.join(name);
        let (mut journal, lines) = Journal::open(&journal_of(&file))?;
        let mut rows = Rows::of(committed.sweep().clone());
        if lines.is_empty() {
            journal.append(&rows.journal_heading())?;
        } else {
            // A journal of another program version or of other data is of no use here; the user
            // removes it to begin anew.
            let old = Rows::from_journal(&lines).map_err(|e| unusable(&e))?;
            if old.numerics().any(|n| n != NUMERICS) {
                let path = journal_of(&file);
                return Err(unusable(&format!(
                    "{} is from another version of the program; remove it",
                    path.display()
                )));
            }
            rows.merge(old).map_err(|e| unusable(&e))?;
        }
        let pending: Vec<u64> =
            committed.iter().map(|row| row.number()).filter(|n| rows.get(*n).is_none()).collect();
        progress.line(&format!("{name}: {} of {} rows to compute", pending.len(), committed.len()));
        let rows = compute(rows, Pending::these(pending), Some(&mut journal), threads, progress)?;
        if let (Some(exit), true) = (progress.asked_to_stop(), rows.len() < committed.len()) {
            let said = format!(
                "interrupted: {} of {} rows of {name} are finished and kept in {}; the same \
                    command goes on with them",
                rows.len(),
                committed.len(),
                journal_of(&file).display()
            );
            return Err(CliError::Stopped { said, exit });
        }
        write(&file, &rows.csv())?;
        journal.remove()?;
        otherwise.extend(
            committed
                .iter()
                .filter(|old| rows.get(old.number()).is_none_or(|new| new.line() != old.line()))
                .map(|old| format!("row {} of {name} was {}", old.number(), old.line())),
        );
    }
    match otherwise.first() {
        None => Ok(()),
        Some(first) => Err(CliError::Differs(format!(
            "{} committed rows have other results now; the first: {first}. The new rows are in {}",
            otherwise.len(),
            folder.display()
        ))),
    }
}
