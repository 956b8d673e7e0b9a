//! `twofold audit`: parts of a long computation, chosen by chance, computed again.

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use serde_json::{Value, json};

use super::chosen;
use crate::cli::progress::{Progress, Tally};
use crate::cli::speak::{harmless, print_json};
use crate::cli::{CliError, Exit, in_pool, print};
use crate::job::sweep::{Row, Rows};
use crate::job::{Desk, JobError, Run};
use crate::paper::checkpoints::{self, Checkpoints, Doubt, Place, choose};
use crate::paper::{Figure, figures};
use crate::record::hash::canonical_json;
use crate::record::merkle::{Tree, leaf};
use crate::record::{self, Hash, Manifest};

/// Check full-length figures and sweeps in seconds: recompute parts of them, chosen by chance, bit for bit.
///
/// Of a figure with long runs (fig7, fig8, fig9, lottery): its checkpoints are put together to their tree, whose root must be the one that this program
/// was built with; random stretches are recomputed from their checkpoints. Of a figure made of sweeps (census, audit, basin) and of any file that `twofold
/// sweep` wrote: random rows are recomputed. Which ones follows from the root of the tree over checkpoints or rows, and from --seed. Exit code 0: all came
/// out the same. 1: something did not.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  twofold audit fig7 fig8\n  twofold audit fig9 --segments 20 --seed 12345\n  twofold audit --json fig7\n  twofold audit census --segments 1\n  twofold audit my-sweep.csv"
)]
pub struct Arguments {
    /// Figures, or files of rows (.csv).
    #[arg(required = true, value_name = "FIGURE|FILE")]
    what: Vec<String>,
    /// Stretches or rows that are recomputed, of each figure or file.
    #[arg(long, value_name = "N", default_value_t = 8)]
    segments: usize,
    /// Another choice of them: a number that only you know makes sure that nobody chose them for you.
    #[arg(long, value_name = "SEED", default_value_t = 0)]
    seed: u64,
    /// Recompute all of them.
    #[arg(long, conflicts_with_all = ["segments", "seed"])]
    all: bool,
    /// Other checkpoints of the figure [default: those that this program was built with].
    #[arg(long, value_name = "FILE", conflicts_with = "make")]
    checkpoints: Option<PathBuf>,
    /// Compute a figure whole, twice, once in stretches, and write its checkpoints to FILE (figures/NAME/checkpoints.json).
    #[arg(long, value_name = "FILE", conflicts_with_all = ["all", "segments", "seed", "json"])]
    make: Option<PathBuf>,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// What was found, with each stretch's path to the root, as JSON on standard output.
    #[arg(long)]
    json: bool,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

/// What is audited.
enum Subject {
    /// A figure with long runs.
    Runs(Box<LongRuns>),
    /// A figure or file, and the sweeps that it is made of by name.
    Rows(String, Vec<(String, Rows)>),
}

/// A figure, and what is said of it.
struct LongRuns {
    figure: Figure,
    points: Checkpoints,
    /// The root that its checkpoints must have.
    root: Hash,
    reference: Manifest,
}

/// Whether a stretch could be computed, and whether it came out the same.
type Recomputed = Result<Result<(), Doubt>, JobError>;

/// What came of it.
struct Report {
    name: String,
    /// The root of the tree over stretches or rows.
    root: Hash,
    /// What is counted.
    unit: &'static str,
    recomputed: usize,
    of: usize,
    wrong: Vec<String>,
    parts: Vec<Value>,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let progress = Progress::new(arguments.quiet);
    if let Some(file) = &arguments.make {
        return make(arguments, file, &progress);
    }
    // Everything is read before the first second of computing is spent.
    let mut subjects = Vec::new();
    for what in &arguments.what {
        subjects.push(read(arguments, what)?);
    }
    let mut reports = Vec::new();
    for subject in &subjects {
        let report = match subject {
            Subject::Runs(runs) => stretches(arguments, runs, &progress)?,
            Subject::Rows(name, sweeps) => recheck(arguments, name, sweeps, &progress)?,
        };
        if !arguments.json {
            for wrong in &report.wrong {
                print(&format!("{}: DIFFERS: {}", report.name, harmless(wrong)))?;
            }
            if report.wrong.is_empty() {
                let Report { name, root, unit, recomputed, of, .. } = &report;
                let root = root.as_str();
                print(&format!("{name}: {recomputed} of {of} {unit} recomputed, all the same; root {root}"))?;
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
                    "name": r.name, "root": r.root, "unit": r.unit, "recomputed": r.recomputed, "of": r.of,
                    "wrong": r.wrong, "parts": r.parts,
                })
            })
            .collect();
        print_json(&json!({ "format": "twofold-audit", "version": 1, "all_the_same": sound, "findings": found }))?;
    }
    Ok(if sound { Exit::Fine } else { Exit::CheckFailed })
}

fn read(arguments: &Arguments, what: &str) -> Result<Subject, CliError> {
    let no_checkpoints = || match &arguments.checkpoints {
        Some(_) => Err(CliError::no_effect("--checkpoints", format!("{what} is made of rows and has none"))),
        None => Ok(()),
    };
    if what.to_ascii_lowercase().ends_with(".csv") {
        no_checkpoints()?;
        let bytes = record::files::read(Path::new(what))?;
        return Ok(Subject::Rows(what.to_owned(), vec![(what.to_owned(), rows_of(what, &bytes)?)]));
    }
    let figure = chosen(&[what.to_owned()])?.remove(0);
    let sweeps = figures::data(figure.id);
    if !sweeps.is_empty() {
        no_checkpoints()?;
        let read = |(file, bytes): &(&str, &[u8])| Ok(((*file).to_owned(), rows_of(file, bytes)?));
        return Ok(Subject::Rows(what.to_owned(), sweeps.iter().map(read).collect::<Result<_, CliError>>()?));
    }
    let built_in = figures::checkpoints(figure.id).ok_or_else(|| {
        CliError::Usage(format!(
            "{0} has no runs so long that parts of them must do; `twofold check {0}` recomputes all of it",
            figure.id
        ))
    })?;
    let parsed = |text: &str, name: &str| {
        Checkpoints::parse(text).map_err(|e| CliError::Usage(format!("{}: {e}", harmless(name))))
    };
    let committed = parsed(built_in, &format!("the built-in checkpoints of {what}"))?;
    let points = match &arguments.checkpoints {
        Some(file) => parsed(&record::files::read_text(file)?, &file.display().to_string())?,
        None => committed.clone(),
    };
    let reference = figures::reference(figure.id)
        .ok_or_else(|| CliError::Usage(format!("no reference is committed for {}", figure.id)))?;
    let reference = Manifest::parse(reference, &format!("the built-in reference of {}", figure.id))?;
    Ok(Subject::Runs(Box::new(LongRuns { figure, points, root: committed.root, reference })))
}

fn rows_of(name: &str, bytes: &[u8]) -> Result<Rows, CliError> {
    let read = Rows::from_csv(bytes);
    read.map_err(|e| CliError::Usage(format!("{}: {e}", harmless(name))))
}

fn stretches(arguments: &Arguments, runs: &LongRuns, progress: &Progress) -> Result<Report, CliError> {
    let LongRuns { figure, points, root, reference } = runs;
    let places = points.places();
    let mut report = Report {
        name: figure.id.to_owned(),
        root: points.root.clone(),
        unit: "stretches",
        recomputed: 0,
        of: places.len(),
        wrong: Vec::new(),
        parts: Vec::new(),
    };
    if let Err(doubt) = points.confirm(figure, reference) {
        report.wrong.push(doubt.to_string());
        return Ok(report);
    }
    if points.root != *root {
        report.wrong.push(format!("the root is {}, and not {}", points.root.as_str(), root.as_str()));
    }
    let wanted = if arguments.all { places } else { choose(&places, arguments.segments, &points.root, arguments.seed) };
    let tally = Tally::counting(progress, "stretches", wanted.len() as u64);
    let found: Vec<(Place, Recomputed)> = in_pool(arguments.threads, || {
        let one = |place: &Place| {
            let found = points.recompute(figure, *place, &());
            tally.done(!matches!(found, Ok(Ok(()))));
            (*place, found)
        };
        wanted.par_iter().with_max_len(1).map(one).collect()
    })?;
    tally.finish();
    report.recomputed = found.len();
    let tree = points.tree();
    for (place, found) in found {
        let found = found?;
        let run = &points.runs[place.run];
        let before = place.stretch.checked_sub(1).map(|i| &run.ends[i]);
        report.parts.push(json!({
            "picture": run.picture, "panel": run.panel, "stretch": place.stretch + 1, "same": found.is_ok(),
            "leaf": [json!(run.spec), json!(before), json!(run.ends[place.stretch])],
            "path": tree.path(points.leaf_number(place)),
        }));
        report.wrong.extend(found.err().map(|doubt| doubt.to_string()));
    }
    Ok(report)
}

fn recheck(
    arguments: &Arguments,
    name: &str,
    sweeps: &[(String, Rows)],
    progress: &Progress,
) -> Result<Report, CliError> {
    let rows: Vec<(usize, Row)> =
        sweeps.iter().enumerate().flat_map(|(i, (_, rows))| rows.iter().map(move |row| (i, row))).collect();
    // A leaf says of which sweep, under which version of the numerics, a row is.
    let leaf_of = |(sweep, row): &(usize, Row)| {
        let rows = &sweeps[*sweep].1;
        leaf(&canonical_json(&(rows.sweep().hash(), row.line())))
    };
    let tree = Tree::of(rows.iter().map(leaf_of).collect());
    let numbers: Vec<usize> = (0..rows.len()).collect();
    let wanted =
        if arguments.all { numbers } else { choose(&numbers, arguments.segments, tree.root(), arguments.seed) };
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
        root: tree.root().clone(),
        unit: "rows",
        recomputed: found.len(),
        of: rows.len(),
        wrong: Vec::new(),
        parts: Vec::new(),
    };
    for (number, again) in found {
        let ((sweep, row), again) = (&rows[number], again?);
        let (file, same) = (&sweeps[*sweep].0, row.line() == again.line());
        report.parts.push(json!({ "file": file, "row": row.number(), "same": same, "path": tree.path(number) }));
        if !same {
            let number = row.number();
            report.wrong.push(format!("row {number} of {file} is {}, and comes out as {}", row.line(), again.line()));
        }
    }
    Ok(report)
}

/// Computes a figure's long runs whole and in stretches, and writes their checkpoints.
fn make(arguments: &Arguments, file: &Path, progress: &Progress) -> Result<Exit, CliError> {
    let [name] = &arguments.what[..] else {
        return Err(CliError::Usage("--make writes the checkpoints of one figure: name one".into()));
    };
    let figure = chosen(std::slice::from_ref(name))?.remove(0);
    let runs = checkpoints::runs(&figure);
    if runs.is_empty() {
        return Err(CliError::no_effect("--make", format!("{name} has no runs that can be cut into stretches")));
    }
    let stretches = checkpoints::STRETCHES / runs.len() as u64;
    record::files::try_place(file)?;
    let desk = Desk::new(None, progress);
    let found: Vec<Result<checkpoints::Checked, JobError>> = in_pool(arguments.threads, || {
        runs.par_iter()
            .with_max_len(1)
            .map(|run| {
                let answer = desk.ask(&Run(run.2.clone()))?;
                checkpoints::cut(*run, stretches, &answer, &())
            })
            .collect()
    })?;
    let runs = found.into_iter().collect::<Result<Vec<_>, _>>()?;
    let points = Checkpoints::of(figure.id, runs);
    record::write(file, &points.to_json())?;
    print(&format!("{name}: {} stretches, root {}", points.places().len(), points.root.as_str()))?;
    Ok(Exit::Fine)
}
