//! The command line: flags, progress, errors in words, exit codes. Nothing below this module
//! prints, exits or reads the environment.
//!
//! - [`figure`]: the command line that every figure's binary shares. [`commands`]: that of
//!   `twofold`.
//! - [`flags`]: the flags that describe a run, and the table of which of them has an effect when.
//!   [`words`]: values by name.
//! - [`general`]: the same for general systems. [`models`]: these by name or file.
//! - [`rows`]: rows of a sweep, kept as they finish. [`recompute`]: those that are committed beside
//!   a figure, computed anew.
//! - [`exit`]: exit codes and errors. [`speak`]: the two streams. [`progress`]: bars.
//!   [`interrupt`]: Ctrl-C.
//!
//! ```
//! use twofold::cli::{CliError, Exit, in_pool};
//! assert_eq!(in_pool(2, || 6 * 7)?, 42);
//! let refused = in_pool(1_000_000, || ()).expect_err("more threads than are ever started");
//! assert_eq!(refused.exit(), Exit::Usage);
//! assert_eq!(Exit::Usage as u8, 2);
//! # Ok::<(), CliError>(())
//! ```

pub mod asked;
pub mod commands;
pub mod ending;
pub mod exit;
pub mod figure;
pub mod flags;
pub mod general;
pub mod interrupt;
pub mod models;
pub mod progress;
pub mod recompute;
pub mod rows;
pub mod speak;
pub mod words;

pub use exit::{CliError, Exit};
pub use figure::{FigureFlags, main, make, run};
pub use speak::{print, print_bytes};

/// Maximum number of threads. More never help here, and tens of thousands hang before they fail.
pub const MOST_THREADS: usize = 1024;

/// Runs `work` on a pool of so many threads (0: one per core).
///
/// # Errors
/// If there are more than [`MOST_THREADS`], or the system refuses them.
pub fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T, CliError> {
    if threads > MOST_THREADS {
        return Err(CliError::Threads {
            threads,
            reason: format!("at most {MOST_THREADS} are started"),
        });
    }
    if cfg!(target_family = "wasm") {
        // There are no threads to start: what is asked side by side is computed one after the
        // other.
        return Ok(work());
    }
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| {
        CliError::Threads { threads, reason: format!("the system refuses them ({e})") }
    })?;
    Ok(pool.install(work))
}

/// The version, and what it was built from and with (see build.rs).
pub const LONG_VERSION: &str = concat!(
    env!("CARGO_PKG_VERSION"),
    "\ncommit ",
    env!("TWOFOLD_COMMIT"),
    "\ncompiler ",
    env!("TWOFOLD_RUSTC"),
    "\ntarget ",
    env!("TWOFOLD_TARGET"),
    ", profile ",
    env!("TWOFOLD_PROFILE"),
);
