//! Progress on standard error: bars on a terminal, plain lines elsewhere, nothing with `--quiet`.

use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::integrate::Watch;
use crate::job;

/// Shows how far runs have come.
pub struct Progress {
    style: Style,
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
            Style::Bars(MultiProgress::with_draw_target(ProgressDrawTarget::stderr_with_hz(8)))
        } else {
            Style::Lines
        };
        Self { style }
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

    /// One line for the user, above any bars.
    pub fn line(&self, text: &str) {
        match &self.style {
            Style::Bars(bars) => {
                // A terminal that went away is no reason to stop computing.
                let _ = bars.println(text);
            }
            Style::Lines => eprintln!("{text}"),
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
    fn begin<'a>(&'a self, label: &str, extent: f64) -> Box<dyn job::JobWatch + 'a> {
        Box::new(self.run(label, extent))
    }

    fn line(&self, text: &str) {
        Progress::line(self, text);
    }
}

impl job::JobWatch for RunProgress<'_> {
    fn done(self: Box<Self>, what: &str) {
        if let Some(bar) = &self.bar {
            bar.finish_and_clear();
        }
        self.progress.line(&format!("{}: {what}, {}", self.name, human(self.begun.elapsed())));
    }
}

impl Watch for RunProgress<'_> {
    fn reached(&self, t: f64) -> bool {
        if let Some(bar) = &self.bar {
            bar.set_position((t / self.t_end * RESOLUTION as f64) as u64);
        }
        true
    }
}

fn human(time: Duration) -> String {
    let s = time.as_secs_f64();
    if s < 60.0 { format!("{s:.1} s") } else { format!("{} min {:.0} s", (s / 60.0) as u64, s % 60.0) }
}
