//! `twofold store`: shows and prunes the answers kept from earlier computations.

use std::path::PathBuf;

use crate::cli::{CliError, Exit, print};
use crate::job::Store;

/// Print the number of answers kept and the disk space they take; with --prune remove those that
/// can never be used again.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  twofold store\n  twofold store --prune\n  twofold store --clear"
)]
pub struct Arguments {
    /// Folder in which answers are kept.
    #[arg(long, value_name = "DIR", default_value = "target/store")]
    store: PathBuf,
    /// Remove answers of other versions of the numerics, and damaged ones.
    #[arg(long, conflicts_with = "clear")]
    prune: bool,
    /// Remove all answers.
    #[arg(long)]
    clear: bool,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let store = Store::new(&arguments.store);
    if arguments.prune || arguments.clear {
        let freed = store.prune(|entry| arguments.clear || !entry.current)?;
        print(&format!("{} MB freed", megabytes(freed)))?;
    }
    let entries = store.entries()?;
    let size = |current: bool| {
        megabytes(entries.iter().filter(|e| e.current == current).map(|e| e.bytes).sum())
    };
    let stale = entries.iter().filter(|e| !e.current).count();
    let mut text = format!(
        "{}: {} answers, {} MB",
        store.folder().display(),
        entries.len() - stale,
        size(true)
    );
    if stale > 0 {
        text += &format!(
            "\n{stale} more, {} MB, are damaged or of another version and never used: twofold \
                store --prune",
            size(false)
        );
    }
    print(&text)?;
    Ok(Exit::Fine)
}

/// Bytes in millions, with one decimal.
fn megabytes(bytes: u64) -> String {
    format!("{:.1}", bytes as f64 / 1e6)
}
