//! `twofold sweep`: the lottery, with numbers. One run from many starts that differ by almost nothing.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use rayon::prelude::*;
use serde_json::json;

use crate::analyse::attractor::{Evidence, Verdict};
use crate::cli::exit::part_of;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::progress::Progress;
use crate::cli::speak::{complain, deliver, is_standard_output, try_delivery};
use crate::cli::{CliError, Exit, in_pool};
use crate::integrate::filippov::ExitRule;
use crate::job::spec::{RunSpec, SwitchSpec};
use crate::job::{Classification, Desk, JobError};

/// The most runs of one sweep: their rows are kept in memory.
const MOST_RUNS: u32 = 1_000_000;

/// Compute the same run from many starts, each shifted a little further, and say where each of them ends. A row per run on
/// standard output (or --out), and how often each end occurred on standard error.
///
/// A run that fails has a row that says why; the exit code is then 3. Ctrl-C keeps the rows that are finished: on standard output,
/// or beside --out under the name FILE.part.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold sweep --alpha 0.1 --beta 1e-4 --restart 100 --t-end 1e5 --method dopri5 --out lottery.csv\n  \
    twofold sweep --runs 8 --shift 1e-6 --t-end 2000 --json")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// Number of runs.
    #[arg(long, default_value_t = 40, allow_negative_numbers = true)]
    runs: u32,
    /// The first component of the start is shifted by this, twice this, three times this ...
    #[arg(long, default_value_t = 1e-9, allow_hyphen_values = true)]
    shift: f64,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// File to write instead of standard output (-).
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Spec, rows and counts as JSON instead of CSV.
    #[arg(long)]
    json: bool,
    /// No progress and no summary on standard error.
    #[arg(long)]
    quiet: bool,
}

/// What became of one run.
struct Row {
    shift: f64,
    end: Result<Evidence, JobError>,
}

impl Row {
    /// Which orbit a run ends on is the question; whether it has arrived is a detail.
    fn kind(&self) -> String {
        match self.end.as_ref().map(|e| &e.verdict) {
            Ok(Verdict::Periodic(c) | Verdict::Spiralling(c) | Verdict::QuasiPeriodic(c)) => {
                format!("period {}", c.period)
            }
            Ok(other) => other.name().to_owned(),
            Err(_) => "failed".to_owned(),
        }
    }
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let spec = arguments.flags.spec(Use::Passages)?;
    if !arguments.shift.is_finite() {
        return Err(CliError::Usage(format!("--shift is {}: give a finite number", arguments.shift)));
    }
    if !(1..=MOST_RUNS).contains(&arguments.runs) {
        let text =
            format!("--runs is {}: give a number from 1 to {MOST_RUNS}, and more in several sweeps", arguments.runs);
        return Err(CliError::Usage(text));
    }
    let out = arguments.out.as_deref();
    try_delivery(out)?;
    let progress = Progress::with_grace(arguments.quiet);
    let rows: Vec<Option<Box<Row>>> = in_pool(arguments.threads, || {
        (1..=arguments.runs)
            .into_par_iter()
            .map(|k| {
                if progress.asked_to_stop().is_some() {
                    None
                } else {
                    one(&spec, f64::from(k) * arguments.shift, k, &progress)
                }
            })
            .collect()
    })?;
    let rows: Vec<Row> = rows.into_iter().flatten().map(|row| *row).collect();
    let mut counts: BTreeMap<String, u32> = BTreeMap::new();
    for row in &rows {
        *counts.entry(row.kind()).or_default() += 1;
    }
    let bytes = if arguments.json { as_json(&spec, &rows, &counts, arguments) } else { as_csv(&rows).into_bytes() };
    if (rows.len() as u64) < u64::from(arguments.runs)
        && let Some(exit) = progress.asked_to_stop()
    {
        let part = out.filter(|f| !is_standard_output(f)).map(part_of);
        deliver(part.as_deref(), &bytes)?;
        let place = part.map_or("standard output".to_owned(), |p| p.display().to_string());
        let said =
            format!("interrupted: {} of {} runs are finished, their rows are in {place}", rows.len(), arguments.runs);
        return Err(CliError::Stopped { said, exit });
    }
    deliver(out, &bytes)?;
    for (end, count) in &counts {
        progress.line(&format!("{count:>4} of {} end: {end}", arguments.runs));
    }
    match rows.iter().find_map(|row| row.end.as_ref().err().map(|error| (row.shift, error))) {
        None => Ok(Exit::Fine),
        Some((shift, error)) => {
            complain(&format!(
                "error: {} of {} runs failed; the first, shifted by {shift:?}: {error}",
                counts["failed"],
                rows.len()
            ));
            Ok(Exit::Failed)
        }
    }
}

/// One run, or nothing if it was interrupted.
fn one(spec: &RunSpec, shift: f64, k: u32, progress: &Progress) -> Option<Box<Row>> {
    let mut shifted = spec.clone();
    shifted.start[0] += shift;
    // Chance of its own in every row: the same kicks from neighbouring starts would not be independent runs.
    if let Some(kick) = &mut shifted.schedule.kick {
        kick.stream += u64::from(k);
    }
    if let SwitchSpec::Filippov { exit: ExitRule::Random { stream, .. }, .. } = &mut shifted.switch {
        *stream += u64::from(k);
    }
    // A desk of its own: what it has computed is forgotten with it, however many runs there are.
    match Classification::of(shifted).ask(&Desk::new(None, progress)) {
        Err(JobError::Interrupted) => None,
        end => Some(Box::new(Row { shift, end })),
    }
}

fn as_csv(rows: &[Row]) -> String {
    let mut text = String::from("shift,verdict,period,captured_at,rate,summary\n");
    for Row { shift, end } in rows {
        // Writing to a String cannot fail.
        let _ = match end {
            Ok(evidence) => {
                let cycle = evidence.verdict.cycle();
                let field = |value: Option<String>| value.unwrap_or_default();
                writeln!(
                    text,
                    "{shift:?},{},{},{},{},\"{}\"",
                    evidence.name,
                    field(cycle.map(|c| c.period.to_string())),
                    field(cycle.map(|c| format!("{:?}", c.captured_at))),
                    field(cycle.and_then(|c| c.approach).map(|r| format!("{:?}", r.per_time))),
                    evidence.summary.replace('"', "\"\"")
                )
            }
            Err(error) => writeln!(text, "{shift:?},failed,,,,\"{}\"", error.to_string().replace('"', "\"\"")),
        };
    }
    text
}

fn as_json(spec: &RunSpec, rows: &[Row], counts: &BTreeMap<String, u32>, arguments: &Arguments) -> Vec<u8> {
    let rows: Vec<_> = rows
        .iter()
        .map(|row| match &row.end {
            Ok(evidence) => {
                let cycle = evidence.verdict.cycle();
                json!({
                    "shift": row.shift,
                    "end": row.kind(),
                    "verdict": evidence.name,
                    "period": cycle.map(|c| c.period),
                    "captured_at": cycle.map(|c| c.captured_at),
                    "rate": cycle.and_then(|c| c.approach).map(|r| r.per_time),
                    "summary": evidence.summary,
                })
            }
            Err(error) => json!({ "shift": row.shift, "end": row.kind(), "error": error.to_string() }),
        })
        .collect();
    let whole = json!({
        "format": "twofold-sweep",
        "version": 1,
        "spec": spec,
        "runs": arguments.runs,
        "finished": rows.len(),
        "ends": counts,
        "rows": rows,
    });
    let mut bytes = serde_json::to_vec_pretty(&whole).expect("rows are plain data");
    bytes.push(b'\n');
    bytes
}
