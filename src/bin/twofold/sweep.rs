//! `twofold sweep`: the lottery, with numbers. One run from many starts that differ by almost nothing.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use rayon::prelude::*;
use twofold::analyse::attractor::{Evidence, Verdict};
use twofold::cli::progress::Progress;
use twofold::cli::{in_pool, print_bytes};
use twofold::job::spec::{Observation, RunSpec};
use twofold::job::{Classification, Desk};
use twofold::record;

use super::run::RunFlags;
use super::{Outcome, Problem};

/// Compute the same run from many starts, each shifted a little further, and say where each of them ends. A row per run on
/// standard output (or --out), and how often each end occurred on standard error.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// Number of runs.
    #[arg(long, default_value_t = 40)]
    runs: u32,
    /// The first component of the start is shifted by this, twice this, three times this ...
    #[arg(long, default_value_t = 1e-9, allow_hyphen_values = true)]
    shift: f64,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// File to write instead of standard output.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// No progress and no summary on standard error.
    #[arg(long)]
    quiet: bool,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Problem> {
    let mut spec = arguments.flags.spec()?;
    if !arguments.shift.is_finite() {
        return Err(format!("--shift is {}: give a finite number", arguments.shift).into());
    }
    if let Observation::Path { .. } = spec.observe {
        spec.observe = Observation::Section { coordinate: 1, value: 0.0 };
    }
    let progress = Progress::new(arguments.quiet);
    let desk = Desk::new(None, &progress);
    let rows: Vec<Result<(f64, Evidence), ThreadProblem>> = in_pool(arguments.threads, || {
        (1..=arguments.runs).into_par_iter().map(|k| one(&spec, f64::from(k) * arguments.shift, &desk)).collect()
    })?;
    let mut text = String::from("shift,verdict,period,captured_at,rate,summary\n");
    let mut counts: BTreeMap<String, u32> = BTreeMap::new();
    for row in rows {
        let (shift, evidence) = row.map_err(|e| e.to_string())?;
        let end = match &evidence.verdict {
            // Which orbit a run ends on is the question; whether it has arrived is a detail.
            Verdict::Periodic(c) | Verdict::Spiralling(c) | Verdict::QuasiPeriodic(c) => format!("period {}", c.period),
            other => other.name().to_owned(),
        };
        *counts.entry(end).or_default() += 1;
        let cycle = evidence.verdict.cycle();
        let field = |value: Option<String>| value.unwrap_or_default();
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "{shift:?},{},{},{},{},\"{}\"",
            evidence.name,
            field(cycle.map(|c| c.period.to_string())),
            field(cycle.map(|c| format!("{:?}", c.captured_at))),
            field(cycle.and_then(|c| c.approach).map(|r| format!("{:?}", r.per_time))),
            evidence.summary
        );
    }
    for (end, count) in &counts {
        progress.line(&format!("{count:>4} of {} end: {end}", arguments.runs));
    }
    match &arguments.out {
        Some(file) => record::write(file, text.as_bytes())?,
        None => print_bytes(text.as_bytes())?,
    }
    Ok(Outcome::Fine)
}

/// An error that may cross threads.
type ThreadProblem = Box<dyn std::error::Error + Send + Sync>;

fn one(spec: &RunSpec, shift: f64, desk: &Desk<'_>) -> Result<(f64, Evidence), ThreadProblem> {
    let mut shifted = spec.clone();
    shifted.start[0] += shift;
    Ok((shift, Classification::of(shifted).ask(desk)?))
}
