//! Progress on standard error: bars on a terminal, plain lines elsewhere, nothing with `--quiet`.

use std::io::{self, IsTerminal};
use std::ops::ControlFlow;
use std::sync::{Mutex, OnceLock, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use super::Exit;
use super::flags::RunFlags;
use super::interrupt::{self, Grace};
use super::speak::{complain, harmless};
use crate::integrate::Monitor;
use crate::job;
use crate::job::sweep::Axis;

/// The bars on the screen, if there are any: a signal clears them away.
static BARS: OnceLock<MultiProgress> = OnceLock::new();

/// Takes bars off the screen.
fn clear() {
    if let Some(bars) = BARS.get() {
        // A terminal that went away shows none.
        let _ = bars.clear();
    }
}

/// Displays the progress of runs.
pub struct Progress {
    style: Style,
    grace: Option<Grace>,
    begun: Instant,
    /// Computations, and the seconds that each took.
    computed: Mutex<Vec<(String, f64)>>,
}

enum Style {
    Bars(MultiProgress),
    Lines,
    Quiet,
}

impl Progress {
    /// Bars if standard error is a terminal, else lines; nothing if `quiet`.
    pub fn new(quiet: bool) -> Self {
        let style = if quiet {
            Style::Quiet
        } else if io::stderr().is_terminal() {
            interrupt::clear_with(clear);
            let bars = BARS.get_or_init(|| {
                MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(8))
            });
            Style::Bars(bars.clone())
        } else {
            Style::Lines
        };
        Self { style, grace: None, begun: Instant::now(), computed: Mutex::default() }
    }

    /// Runs shown here stop when a signal comes, so that what they have can be kept.
    pub fn with_grace(quiet: bool) -> Self {
        Self { grace: Some(Grace::new()), ..Self::new(quiet) }
    }

    /// The exit code of the signal that stopped the runs shown here, if one was received.
    pub fn asked_to_stop(&self) -> Option<Exit> {
        self.grace.as_ref().and_then(Grace::asked_to_stop)
    }

    /// Seconds since the beginning.
    pub fn seconds(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// The jobs that were finished and the seconds that each took, the longest first.
    pub fn computed(&self) -> Vec<(String, f64)> {
        let mut jobs = self.computed.lock().unwrap_or_else(PoisonError::into_inner).clone();
        jobs.sort_by(|a, b| b.1.total_cmp(&a.1));
        jobs
    }

    fn run(&self, name: &str, t_end: f64) -> RunProgress<'_> {
        let bar = match &self.style {
            Style::Bars(bars) => {
                let bar = bars.add(ProgressBar::new(RESOLUTION));
                bar.set_style(
                    ProgressStyle::with_template("{msg:<28} {wide_bar} {percent:>3} %  {eta:>4}")
                        .unwrap_or_else(|_| ProgressStyle::default_bar()),
                );
                bar.set_message(name.to_owned());
                Some(bar)
            }
            _ => None,
        };
        RunProgress { progress: self, bar, name: name.to_owned(), t_end, begun: Instant::now() }
    }

    /// Says which rule stands for the discontinuity, if no flag chose one.
    pub fn say_default_switch(&self, flags: &RunFlags, axes: &[Axis]) {
        if let Some(rule) = flags.default_switch(axes) {
            self.line(&rule);
        }
    }

    /// One line for the user, above any bars.
    pub fn line(&self, text: &str) {
        match &self.style {
            Style::Bars(bars) => {
                // A terminal that went away is no reason to stop computing.
                let _ = bars.println(harmless(text));
            }
            Style::Lines => complain(text),
            Style::Quiet => {}
        }
    }
}

/// Steps of a bar.
const RESOLUTION: u64 = 1000;

/// The progress of one run.
pub struct RunProgress<'a> {
    progress: &'a Progress,
    bar: Option<ProgressBar>,
    name: String,
    t_end: f64,
    begun: Instant,
}

impl job::Progress for Progress {
    fn begin<'a>(&'a self, label: &str, extent: f64) -> Box<dyn job::JobMonitor + 'a> {
        Box::new(self.run(label, extent))
    }

    fn line(&self, text: &str) {
        Progress::line(self, text);
    }
}

impl job::JobMonitor for RunProgress<'_> {
    fn done(self: Box<Self>, what: &str) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        let time = self.begun.elapsed();
        let mut computed = self.progress.computed.lock().unwrap_or_else(PoisonError::into_inner);
        computed.push((self.name.clone(), time.as_secs_f64()));
        drop(computed);
        self.progress.line(&format!("{}: {what}, {}", self.name, human(time)));
    }
}

impl Monitor for RunProgress<'_> {
    fn reached(&self, t: f64) -> ControlFlow<()> {
        if let Some(bar) = &self.bar {
            bar.set_position((t / self.t_end * RESOLUTION as f64) as u64);
        }
        if self.progress.asked_to_stop().is_none() {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    }
}

/// The progress of many short jobs: the number finished, and the time left. A bar on a terminal,
/// occasional lines elsewhere.
pub struct Tally<'a> {
    progress: &'a Progress,
    bar: Option<ProgressBar>,
    unit: &'static str,
    total: u64,
    state: Mutex<TallyState>,
}

struct TallyState {
    finished: u64,
    failed: u64,
    begun: Instant,
    /// When the next line is due.
    next: Duration,
}

/// The first line comes after this, each next one after twice the time that passed, at most
/// [`LINE_EVERY`] later.
const FIRST_LINE: Duration = Duration::from_millis(200);
/// The longest time between two lines.
const LINE_EVERY: Duration = Duration::from_secs(60);

impl<'a> Tally<'a> {
    /// Counts rows up to `total`.
    pub fn new(progress: &'a Progress, total: u64) -> Self {
        Self::counting(progress, "rows", total)
    }

    /// Counts up to `total` things of the kind `unit`, a word in the plural.
    pub fn counting(progress: &'a Progress, unit: &'static str, total: u64) -> Self {
        let bar = match &progress.style {
            Style::Bars(bars) => {
                let bar = bars.add(ProgressBar::new(total));
                bar.set_style(
                    ProgressStyle::with_template(&format!(
                        "{{human_pos}} of {{human_len}} {unit} {{wide_bar}} {{eta}} left {{msg}}"
                    ))
                    .unwrap_or_else(|_| ProgressStyle::default_bar()),
                );
                Some(bar)
            }
            _ => None,
        };
        let state = TallyState { finished: 0, failed: 0, begun: Instant::now(), next: FIRST_LINE };
        Self { progress, bar, unit, total, state: Mutex::new(state) }
    }

    /// A job is finished.
    pub fn done(&self, failed: bool) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.finished += 1;
        state.failed += u64::from(failed);
        let failures =
            if state.failed > 0 { format!(", {} failed", state.failed) } else { String::new() };
        if let Some(bar) = &self.bar {
            bar.set_position(state.finished);
            bar.set_message(failures);
            return;
        }
        let spent = state.begun.elapsed();
        if spent >= state.next && state.finished < self.total {
            state.next = (2 * spent).min(spent + LINE_EVERY);
            let left = spent.mul_f64((self.total - state.finished) as f64 / state.finished as f64);
            let line = format!(
                "{} of {} {}{failures}, about {} left",
                state.finished,
                self.total,
                self.unit,
                human(left)
            );
            self.progress.line(&line);
        }
    }

    /// Removes the bar.
    pub fn finish(&self) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
    }
}

impl job::Progress for Tally<'_> {
    fn begin<'a>(&'a self, _: &str, _: f64) -> Box<dyn job::JobMonitor + 'a> {
        Box::new(Silent(self.progress))
    }
}

/// Shows nothing, and stops when the user asks for it.
struct Silent<'a>(&'a Progress);

impl Monitor for Silent<'_> {
    fn reached(&self, _: f64) -> ControlFlow<()> {
        if self.0.asked_to_stop().is_none() {
            ControlFlow::Continue(())
        } else {
            ControlFlow::Break(())
        }
    }
}

impl job::JobMonitor for Silent<'_> {
    fn done(self: Box<Self>, _: &str) {}
}

/// A time as people say it, rounded once.
fn human(time: Duration) -> String {
    let tenths = (time.as_secs_f64() * 10.0).round() as u64;
    if tenths < 600 {
        return format!("{}.{} s", tenths / 10, tenths % 10);
    }
    let seconds = time.as_secs_f64().round() as u64;
    format!("{} min {} s", seconds / 60, seconds % 60)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_minute_has_sixty_seconds() {
        let said = |seconds: f64| human(Duration::from_secs_f64(seconds));
        for (seconds, words) in [
            (0.0, "0.0 s"),
            (12.34, "12.3 s"),
            (59.94, "59.9 s"),
            (59.96, "1 min 0 s"),
            (119.4, "1 min 59 s"),
            (119.96, "2 min 0 s"),
            (3600.0, "60 min 0 s"),
        ] {
            assert_eq!(said(seconds), words);
        }
    }
}
