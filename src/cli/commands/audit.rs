//! `twofold audit`: recomputes a random sample of a sweep's rows.

use std::collections::BTreeSet;
use std::path::Path;

use rayon::prelude::*;
use serde_json::{Value, json};

use super::chosen;
use crate::cli::progress::{Progress, Tally};
use crate::cli::speak::{harmless, print_json};
use crate::cli::{CliError, Exit, in_pool, print};
use crate::job::JobError;
use crate::job::sweep::{Row, Rows};
use crate::num::random::RandomStream;
use crate::paper::figures;
use crate::record::hash::canonical_json;
use crate::record::{self, Hash};

/// Check sweeps in seconds: recompute some of their rows, chosen by chance, bit for bit.
///
/// Of a figure made of sweeps (census, audit, basin) and of any file that `twofold sweep` wrote.
/// Which rows are recomputed follows from the digest of all of them and from --seed. Exit code 0:
/// all came out the same. 1: something did not.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  twofold audit census --rows 1\n  twofold audit basin --rows 20 \
        --seed 12345\n  twofold audit my-sweep.csv --json"
)]
pub struct Arguments {
    /// Figures, or files of rows (.csv).
    #[arg(required = true, value_name = "FIGURE|FILE")]
    what: Vec<String>,
    /// Rows that are recomputed, of each figure or file.
    #[arg(long, value_name = "N", default_value_t = 8)]
    rows: usize,
    /// Seed of the random choice of rows: with a number that only you know, the rows cannot have
    /// been prepared.
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    seed: u64,
    /// Recompute all of them.
    #[arg(long, conflicts_with_all = ["rows", "seed"])]
    all: bool,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// The findings, row by row, as JSON on standard output.
    #[arg(long)]
    json: bool,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

/// The sweeps of a file or figure, by name.
type Sweeps = Vec<(String, Rows)>;

/// The result.
struct Report {
    name: String,
    recomputed: usize,
    of: usize,
    wrong: Vec<String>,
    parts: Vec<Value>,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let progress = Progress::new(arguments.quiet);
    if arguments.rows == 0 && !arguments.all {
        return Err(CliError::Usage("--rows 0 checks nothing: give a number above 0".into()));
    }
    // Everything is read before the first second of computing is spent.
    let subjects = arguments.what.iter().map(|what| read(what)).collect::<Result<Vec<_>, _>>()?;
    let mut reports = Vec::new();
    for (name, sweeps) in arguments.what.iter().zip(&subjects) {
        let report = recheck(arguments, name, sweeps, &progress)?;
        if !arguments.json {
            for wrong in &report.wrong {
                print(&format!("{}: DIFFERS: {}", report.name, harmless(wrong)))?;
            }
            if report.wrong.is_empty() {
                let Report { name, recomputed, of, .. } = &report;
                print(&format!("{name}: {recomputed} of {of} rows recomputed, all the same"))?;
            }
        }
        reports.push(report);
    }
    let sound = reports.iter().all(|r| r.wrong.is_empty());
    if arguments.json {
        let found: Vec<Value> = reports
            .iter()
            .map(|r| {
                json!({
                    "name": r.name, "recomputed": r.recomputed, "of": r.of,
                    "wrong": r.wrong, "parts": r.parts,
                })
            })
            .collect();
        print_json(&json!({ "format": "twofold-audit", "version": 2, "all_the_same": sound,
                "findings": found }))?;
    }
    Ok(if sound { Exit::Fine } else { Exit::CheckFailed })
}

fn read(what: &str) -> Result<Sweeps, CliError> {
    if what.to_ascii_lowercase().ends_with(".csv") {
        let bytes = record::files::read(Path::new(what))?;
        return Ok(vec![(what.to_owned(), rows_of(what, &bytes)?)]);
    }
    let named = chosen(&[what.to_owned()]);
    if named.is_err() && Path::new(what).is_file() {
        return Err(CliError::Usage(format!(
            "{}: only finished tables of `twofold sweep` in CSV are checked (FILE.csv)",
            harmless(what)
        )));
    }
    let figure = named?.remove(0);
    let sweeps = figures::data(&figure.id);
    if sweeps.is_empty() {
        let id = figure.id.to_string();
        return Err(CliError::Usage(format!(
            "{id} is not made of sweeps; `twofold check {id}` recomputes all of it"
        )));
    }
    sweeps.iter().map(|(file, bytes)| Ok(((*file).to_owned(), rows_of(file, bytes)?))).collect()
}

fn rows_of(name: &str, bytes: &[u8]) -> Result<Rows, CliError> {
    let read = Rows::from_csv(bytes);
    read.map_err(|e| CliError::Usage(format!("{}: {e}", harmless(name))))
}

/// So many of the first `of` numbers, each once, in order, as `digest` and `seed` choose them.
fn choose(of: usize, count: usize, digest: &Hash, seed: u64) -> Vec<usize> {
    let from_digest = u64::from_str_radix(&digest.as_str()[..16], 16).unwrap_or(0);
    let mut random = RandomStream::new(from_digest, seed);
    let mut rest: Vec<usize> = (0..of).collect();
    let mut chosen = BTreeSet::new();
    while chosen.len() < count && !rest.is_empty() {
        let at = ((random.uniform() * rest.len() as f64) as usize).min(rest.len() - 1);
        chosen.insert(rest.swap_remove(at));
    }
    chosen.into_iter().collect()
}

fn recheck(
    arguments: &Arguments,
    name: &str,
    sweeps: &[(String, Rows)],
    progress: &Progress,
) -> Result<Report, CliError> {
    let rows: Vec<(usize, Row)> = sweeps
        .iter()
        .enumerate()
        .flat_map(|(i, (_, rows))| rows.iter().map(move |row| (i, row)))
        .collect();
    let wanted = if arguments.all {
        (0..rows.len()).collect()
    } else {
        // Of which sweep a row is belongs to it.
        let said: Vec<_> =
            rows.iter().map(|(sweep, row)| (sweeps[*sweep].1.sweep().hash(), row.line())).collect();
        choose(rows.len(), arguments.rows, &Hash::of(&canonical_json(&said)), arguments.seed)
    };
    let tally = Tally::new(progress, wanted.len() as u64);
    let found: Vec<(usize, Result<Row, JobError>)> = in_pool(arguments.threads, || {
        let one = |number: &usize| {
            let (sweep, row) = &rows[*number];
            let again = sweeps[*sweep].1.sweep().row(row.number(), &());
            tally.done(!again.as_ref().is_ok_and(|again| row.line() == again.line()));
            (*number, again)
        };
        wanted.par_iter().with_max_len(1).map(one).collect()
    })?;
    tally.finish();
    let mut report = Report {
        name: name.to_owned(),
        recomputed: found.len(),
        of: rows.len(),
        wrong: Vec::new(),
        parts: Vec::new(),
    };
    for (number, again) in found {
        let ((sweep, row), again) = (&rows[number], again?);
        let (file, same) = (&sweeps[*sweep].0, row.line() == again.line());
        report.parts.push(json!({ "file": file, "row": row.number(), "same": same }));
        if !same {
            let number = row.number();
            report.wrong.push(format!(
                "row {number} of {file} is {}, and comes out as {}",
                row.line(),
                again.line()
            ));
        }
    }
    Ok(report)
}
