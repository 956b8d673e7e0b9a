//! Work beside Python: on a thread of its own, with the GIL released, while this thread listens for
//! Ctrl-C and shows progress.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use pyo3::exceptions::PyOSError;
use pyo3::prelude::*;
use twofold::integrate::Monitor;
use twofold::job::{JobError, JobMonitor, Progress};

use crate::errors;

/// Interval at which Ctrl-C is looked for and progress is shown.
const TICK: Duration = Duration::from_millis(100);
/// Longest time that a computation may take to stop when it is told to. One that takes longer is
/// left to end by itself.
const PATIENCE: Duration = Duration::from_secs(2);
/// The same as the main thread's on most systems: the debug profile needs more than a thread has by
/// itself.
const STACK: usize = 8 << 20;

/// State that both sides of a computation share.
#[derive(Default)]
pub struct Work {
    stop: AtomicBool,
    /// Bits of the share that is done, from 0 to 1.
    share: AtomicU64,
    /// Label of the present computation.
    label: Mutex<String>,
    /// Whether shares are counted by [`Work::finished`] instead of by what single jobs report.
    counted: AtomicBool,
}

impl Work {
    /// Whether the work shall stop.
    pub fn stopped(&self) -> bool {
        self.stop.load(Ordering::Relaxed)
    }

    /// `done` of `all` parts are finished.
    pub fn finished(&self, done: usize, all: usize) {
        self.counted.store(true, Ordering::Relaxed);
        self.share.store((done as f64 / all.max(1) as f64).to_bits(), Ordering::Relaxed);
    }

    /// Sets the label of the present computation.
    pub fn says(&self, label: &str) {
        label.clone_into(&mut self.label.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

/// One job's part of the display.
struct Following<'a> {
    work: &'a Work,
    extent: f64,
}

impl Monitor for Following<'_> {
    fn reached(&self, t: f64) -> ControlFlow<()> {
        if !self.work.counted.load(Ordering::Relaxed) {
            self.work.share.store((t / self.extent).to_bits(), Ordering::Relaxed);
        }
        if self.work.stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

impl JobMonitor for Following<'_> {
    fn done(self: Box<Self>, _: &str) {}
}

impl Progress for Work {
    fn begin<'a>(&'a self, label: &str, extent: f64) -> Box<dyn JobMonitor + 'a> {
        if !self.counted.load(Ordering::Relaxed) {
            self.says(label);
        }
        Box::new(Following { work: self, extent })
    }
}

/// Does `job` on a thread of its own. `show`, if given, is called with the share that is done and
/// what is being computed.
///
/// Ctrl-C, or an error in `show`, asks the job to stop and is then raised.
pub fn supervise<T: Send + 'static>(
    py: Python<'_>,
    show: Option<&Bound<'_, PyAny>>,
    job: impl FnOnce(&Work) -> Result<T, JobError> + Send + 'static,
) -> PyResult<T> {
    let work = Arc::new(Work::default());
    let (sender, mut receiver) = mpsc::sync_channel(1);
    let theirs = Arc::clone(&work);
    let thread = thread::Builder::new().name("twofold".into()).stack_size(STACK);
    // The receiver may be gone.
    let thread = thread.spawn(move || drop(sender.send(job(&theirs))));
    thread.map_err(|e| PyOSError::new_err(format!("no thread could be started: {e}")))?;
    loop {
        let result;
        (receiver, result) = py.detach(move || {
            let result = receiver.recv_timeout(TICK);
            (receiver, result)
        });
        match result {
            Ok(answer) => return answer.map_err(|e| errors::job(&e)),
            Err(RecvTimeoutError::Disconnected) => {
                return Err(errors::InternalError::new_err((
                    "the computation broke down inside the library; this is a defect, please \
                        report it",
                )));
            }
            Err(RecvTimeoutError::Timeout) => {}
        }
        let heard = py.check_signals().and_then(|()| match show {
            None => Ok(()),
            Some(show) => {
                let share = f64::from_bits(work.share.load(Ordering::Relaxed));
                let label = work.label.lock().unwrap_or_else(PoisonError::into_inner).clone();
                show.call1((share, label)).map(drop)
            }
        });
        if let Err(error) = heard {
            work.stop.store(true, Ordering::Relaxed);
            // The result of a stopped computation is of no interest.
            py.detach(move || drop(receiver.recv_timeout(PATIENCE)));
            return Err(error);
        }
    }
}
