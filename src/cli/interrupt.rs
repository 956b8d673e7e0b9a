//! Ctrl-C, SIGTERM and a closed terminal (SIGHUP): the program ends within a second, prints one
//! line, and leaves no temporary files.
//!
//! Most programs here write every picture as soon as it is finished: for them a signal removes the
//! temporary files and ends the process. A command whose result grows row by row can ask for grace
//! ([`Grace`]): it is told, and has a moment to keep the rows that it has.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicU8, AtomicUsize, Ordering};

use super::Exit;

/// Number of graces that are requested at present.
static GRACES: AtomicUsize = AtomicUsize::new(0);
/// The exit code of the signal that came; 0 before.
static CAME: AtomicU8 = AtomicU8::new(0);

/// Clears what stands on the terminal before the last words; set by the first progress display.
#[cfg_attr(not(unix), allow(dead_code))]
static CLEAR: OnceLock<fn()> = OnceLock::new();

/// Lets a signal call `clear` before the process ends.
pub fn clear_with(clear: fn()) {
    let _ = CLEAR.set(clear);
}

/// While this value exists, a signal is first announced ([`Grace::asked_to_stop`]); the process
/// ends at most [`GRACE_MS`] later.
pub struct Grace(());

/// Time for a computation to stop and to write its rows, in milliseconds.
pub const GRACE_MS: u64 = 800;

impl Grace {
    /// Enables the grace period.
    #[allow(clippy::new_without_default)] // it is not a value but a state of the process
    pub fn new() -> Self {
        GRACES.fetch_add(1, Ordering::SeqCst);
        Self(())
    }

    /// The exit code of the signal, if one was received.
    pub fn asked_to_stop(&self) -> Option<Exit> {
        match CAME.load(Ordering::SeqCst) {
            0 => None,
            code if code == Exit::Terminated as u8 => Some(Exit::Terminated),
            _ => Some(Exit::Interrupted),
        }
    }
}

impl Drop for Grace {
    fn drop(&mut self) {
        GRACES.fetch_sub(1, Ordering::SeqCst);
    }
}

/// Starts to listen. Where there are no such signals, or no thread can be had, they keep their
/// ordinary effect.
pub fn listen() {
    #[cfg(unix)]
    unix::listen();
}

#[cfg(unix)]
mod unix {
    use std::sync::Arc;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::thread;
    use std::time::Duration;

    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::iterator::Signals;

    use super::{CAME, CLEAR, Exit, GRACE_MS, GRACES};
    use crate::cli::speak::complain;
    use crate::record;

    pub fn listen() {
        // A file grown beyond its limit (SIGXFSZ) is then an error of that write, with a message,
        // instead of a silent end. It is taken before anything is written, not by the thread, which
        // may start later than a short run ends.
        let _ = signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)));
        // The other signals are taken over by the thread itself: where it cannot be started, they
        // are not.
        let _ = thread::Builder::new().name("signals".into()).spawn(|| {
            let mut listened = vec![SIGINT, SIGTERM];
            // `nohup` has it ignored, and a handler would undo that.
            if record::files::closed_terminal_ends() {
                listened.push(SIGHUP);
            }
            if let Ok(mut signals) = Signals::new(listened) {
                wait(&mut signals);
            }
        });
    }

    fn wait(signals: &mut Signals) {
        let Some(signal) = signals.forever().next() else { return };
        let exit = if signal == SIGINT { Exit::Interrupted } else { Exit::Terminated };
        CAME.store(exit as u8, Ordering::SeqCst);
        if GRACES.load(Ordering::SeqCst) > 0 {
            // The main thread ends the process when it has kept what it has. A second signal ends
            // the waiting.
            for _ in 0..GRACE_MS / 10 {
                thread::sleep(Duration::from_millis(10));
                if signals.pending().next().is_some() {
                    break;
                }
            }
        }
        record::files::abandon();
        if let Some(clear) = CLEAR.get() {
            clear();
        }
        complain(match exit {
            Exit::Terminated => "terminated: finished files are kept, unfinished ones are removed",
            _ => "interrupted: finished files are kept, unfinished ones are removed",
        });
        std::process::exit(i32::from(exit as u8));
    }
}
