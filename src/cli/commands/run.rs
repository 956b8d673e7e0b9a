//! `twofold run`: any run, not only the paper's.

use std::path::PathBuf;

use serde_json::json;

use crate::cli::exit::part_of;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::progress::Progress;
use crate::cli::speak::{deliver, is_standard_output, try_delivery};
use crate::cli::{CliError, Exit};
use crate::job::parquet::parquet;
use crate::job::{Desk, JobError, Question, Run, Stop, encode};

/// Compute one run: its path, or with --section its passages through a plane.
///
/// A flag that would have no effect on the run is refused. Ctrl-C keeps what has been computed: on standard output, or beside --out
/// under the name FILE.part.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold run --reading reconstructed --t-end 100 --section y=0\n  \
    twofold run --switch filippov --exit random:exponential:0.5 --t-end 80 --out orbit.csv\n  \
    twofold run --system wheel --t-end 60 --format json --out wheel.json\n  \
    fig7 --only ii --reading printed --print-spec | twofold run --spec - --out section.csv")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// Print the run's spec as JSON and compute nothing.
    #[arg(long, conflicts_with = "format")]
    print_spec: bool,
    /// Output format [default: csv].
    #[arg(long, value_enum)]
    format: Option<Format>,
    /// File to write instead of standard output (-).
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Format {
    /// A header line, then a row per point.
    Csv,
    /// Spec, statistics, columns and rows.
    Json,
    /// Apache Parquet, with what a CSV file says in its first line as metadata.
    Parquet,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let spec = arguments.flags.spec(Use::Any)?;
    let out = arguments.out.as_deref();
    try_delivery(out)?;
    if arguments.print_spec {
        let mut text = serde_json::to_vec_pretty(&spec).expect("specs are plain data");
        text.push(b'\n');
        deliver(out, &text)?;
        return Ok(Exit::Fine);
    }
    let progress = Progress::with_grace(arguments.quiet);
    let run = Run(spec);
    let answer = Desk::new(None, &progress).ask(&run)?;
    let about = json!({ "kind": run.kind(), "question": run.json(), "stop": answer.stop });
    let bytes = match arguments.format.unwrap_or(Format::Csv) {
        Format::Csv => encode::csv(&answer.tables[0], &about),
        Format::Json => encode::json(&answer, &about),
        Format::Parquet => parquet(&answer.tables[0], &about),
    };
    let stopped = if answer.stop == Stop::Interrupted { progress.asked_to_stop() } else { None };
    let Some(exit) = stopped else {
        deliver(out, &bytes)?;
        return Ok(Exit::Fine);
    };
    let part = out.filter(|f| !is_standard_output(f)).map(part_of);
    deliver(part.as_deref(), &bytes)?;
    let place = part.map_or("standard output".to_owned(), |p| p.display().to_string());
    let t: f64 = answer.fact("t").map_err(JobError::from)?;
    let said = format!("interrupted at t = {t}: the {} rows up to there are in {place}", answer.rows());
    Err(CliError::Stopped { said, exit })
}
