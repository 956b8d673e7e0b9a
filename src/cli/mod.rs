//! The command line that every figure binary shares.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Parser;
use rayon::prelude::*;

pub mod progress;

use self::progress::Progress;
use crate::job::spec::{Method, SpecError};
use crate::job::{Desk, Store};
use crate::paper::pipeline::{Computed, PictureRecord, PipelineError, compute, questions};
use crate::paper::{Alterations, Figure, Picture, Reading};
use crate::record::{FileError, write};

/// Compute a figure of Jeffrey (2013) and write it as PNG, SVG and PDF, with its numbers as CSV.
#[derive(Clone, Debug, Parser)]
#[command(version, about, long_about = None)]
struct Arguments {
    #[command(flatten)]
    flags: FigureFlags,
}

/// How figures are made.
#[derive(Clone, Debug, clap::Args)]
pub struct FigureFlags {
    /// Folder to write to; a folder named after the figure is made in it.
    #[arg(long, value_name = "DIR", default_value = "target/figures")]
    out: PathBuf,
    /// Parameter reading.
    #[arg(long, value_name = "READING", default_value = "all")]
    reading: Readings,
    /// One panel only, such as "ii"; the picture is marked.
    #[arg(long, value_name = "PANEL")]
    only: Option<String>,
    /// Threads; 0 is one per core. The bytes do not depend on it.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// Another seed for random kicks and exits; the picture is marked.
    #[arg(long, value_name = "SEED")]
    seed: Option<u64>,
    /// Another final time; the picture is marked as shortened.
    #[arg(long, value_name = "T")]
    t_end: Option<f64>,
    /// Another integration method; the picture is marked.
    #[arg(long, value_name = "METHOD")]
    method: Option<Method>,
    #[command(flatten)]
    store: StoreFlags,
    /// Print what was made, with hashes and statistics, as JSON on standard output.
    #[arg(long)]
    json: bool,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
    /// Print the runs' specs as JSON and compute nothing; a single one can be given to `twofold run --spec`.
    #[arg(long)]
    print_spec: bool,
}

/// Where answers are kept, so that nothing is computed twice.
#[derive(Clone, Debug, clap::Args)]
pub struct StoreFlags {
    /// Folder in which answers are kept for the next time.
    #[arg(long, value_name = "DIR", default_value = "target/store")]
    store: PathBuf,
    /// Compute everything anew and keep nothing.
    #[arg(long, conflicts_with = "store")]
    fresh: bool,
}

impl StoreFlags {
    /// The store that these flags ask for.
    pub fn store(&self) -> Option<Store> {
        (!self.fresh).then(|| Store::new(&self.store))
    }
}

/// Which readings to make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Readings {
    /// As printed.
    Printed,
    /// With the digit changed.
    Reconstructed,
    /// Both.
    All,
}

impl Readings {
    fn wants(self, reading: Option<Reading>) -> bool {
        match self {
            Readings::All => true,
            Readings::Printed => reading != Some(Reading::Reconstructed),
            Readings::Reconstructed => reading != Some(Reading::Printed),
        }
    }
}

/// What can go wrong in a figure binary, each with its exit code: all are bad usage, input or place (2).
#[derive(Debug, thiserror::Error)]
pub enum CliError {
    /// No panel of that name.
    #[error("there is no panel \"{panel}\" in {figure}; choose one of {known}")]
    NoSuchPanel {
        /// What was asked for.
        panel: String,
        /// The figure.
        figure: &'static str,
        /// What there is.
        known: String,
    },
    /// A wrong number.
    #[error("--{0}")]
    Spec(#[from] SpecError),
    /// A run or a drawing failed.
    #[error(transparent)]
    Pipeline(#[from] PipelineError),
    /// A file could not be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Threads could not be started.
    #[error("cannot start {threads} threads: {reason}; give a smaller --threads")]
    Threads {
        /// How many.
        threads: usize,
        /// Why.
        reason: String,
    },
    /// Standard output could not be written.
    #[error("cannot write to standard output: {0}")]
    Output(#[from] std::io::Error),
}

/// Runs a figure binary: parses the command line, computes, writes.
pub fn main(figure: Figure) -> ExitCode {
    match run(vec![figure], &Arguments::parse().flags) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error}");
            ExitCode::from(2)
        }
    }
}

/// Computes these figures and writes them, as the flags say.
///
/// # Errors
///
/// See [`CliError`].
pub fn run(figures: Vec<Figure>, arguments: &FigureFlags) -> Result<(), CliError> {
    let figures = figures.into_iter().map(|f| select(f, arguments)).collect::<Result<Vec<_>, _>>()?;
    if arguments.print_spec {
        return print_specs(&figures);
    }
    let progress = Progress::new(arguments.quiet);
    let desk = Desk::new(arguments.store.store(), &progress);
    let records = in_pool(arguments.threads, || make(&figures, &arguments.out, &desk))??;
    if arguments.json {
        print(&serde_json::to_string_pretty(&records).expect("records are plain data"))?;
    }
    Ok(())
}

/// Makes these figures, each in a folder of its own under `out`: all their questions first, side by side, the longest first; then the
/// pictures. Answers that the desk's store keeps are not lost if this is killed.
///
/// # Errors
///
/// If a computation or a drawing failed or a file could not be written; what could be made is there all the same.
pub fn make(figures: &[Figure], out: &Path, desk: &Desk<'_>) -> Result<Vec<PictureRecord>, CliError> {
    desk.gather(&questions(figures.iter().flat_map(|f| &f.pictures)));
    let pictures: Vec<(PathBuf, &Picture)> =
        figures.iter().flat_map(|f| f.pictures.iter().map(|p| (out.join(f.id), p))).collect();
    let results: Vec<Result<PictureRecord, CliError>> = pictures
        .par_iter()
        .map(|(folder, picture)| {
            let computed = compute(picture, desk)?;
            write_picture(folder, &computed)?;
            let name = &computed.record.hashes.name;
            desk.progress().line(&format!("wrote {}", folder.join(format!("{name}.png")).display()));
            Ok(computed.record)
        })
        .collect();
    results.into_iter().collect()
}

/// Writes a picture's files: data first, the record last, so that a record vouches for everything beside it.
fn write_picture(folder: &Path, computed: &Computed) -> Result<(), FileError> {
    let name = &computed.record.hashes.name;
    for (label, table) in &computed.tables {
        write(&folder.join(format!("{name}-{label}.csv")), table)?;
    }
    write(&folder.join(format!("{name}.png")), &computed.rendered.png)?;
    write(&folder.join(format!("{name}.svg")), &computed.rendered.svg)?;
    write(&folder.join(format!("{name}.pdf")), &computed.rendered.pdf)?;
    let mut json = serde_json::to_vec_pretty(&computed.record).expect("a record is plain data");
    json.push(b'\n');
    write(&folder.join(format!("{name}.json")), &json)
}

/// The pictures and panels that were asked for, altered as asked for, and checked.
fn select(mut figure: Figure, arguments: &FigureFlags) -> Result<Figure, CliError> {
    if let Some(only) = &arguments.only {
        let label = only.trim_start_matches('(').trim_end_matches(')');
        let known: Vec<String> = figure.pictures.iter().flat_map(|p| &p.panels).map(|p| p.label.clone()).collect();
        if !known.iter().any(|k| k == label) {
            let mut known = known;
            known.sort_by_key(|k| (k.len(), k.clone()));
            known.dedup();
            return Err(CliError::NoSuchPanel { panel: only.clone(), figure: figure.id, known: known.join(", ") });
        }
        figure.pictures.retain(|p| p.panels.iter().any(|q| q.label == label));
        figure.pictures.iter_mut().for_each(|p| p.keep_only(label));
    }
    figure.pictures.retain(|p| arguments.reading.wants(p.reading));
    let alterations = Alterations { seed: arguments.seed, t_end: arguments.t_end, method: arguments.method };
    for picture in &mut figure.pictures {
        picture.alter(&alterations);
        for panel in &picture.panels {
            panel.run.validate()?;
        }
    }
    Ok(figure)
}

/// One spec alone, or several under their names.
fn print_specs(figures: &[Figure]) -> Result<(), CliError> {
    let specs: Vec<_> = figures
        .iter()
        .flat_map(|figure| &figure.pictures)
        .flat_map(|picture| {
            picture.panels.iter().map(move |panel| (format!("{}-{}", picture.name, panel.label), &panel.run))
        })
        .collect();
    let text = match specs.as_slice() {
        [(_, only)] => serde_json::to_string_pretty(only),
        several => serde_json::to_string_pretty(
            &several
                .iter()
                .map(|(name, run)| (name.clone(), serde_json::to_value(run).expect("specs are plain data")))
                .collect::<serde_json::Map<_, _>>(),
        ),
    };
    print(&text.expect("specs are plain data"))
}

/// Prints a line to standard output.
pub fn print(text: &str) -> Result<(), CliError> {
    print_bytes(format!("{text}\n").as_bytes())
}

/// Writes bytes to standard output; a reader that went away (`| head`) is not an error.
pub fn print_bytes(bytes: &[u8]) -> Result<(), CliError> {
    use std::io::Write;
    let mut out = std::io::stdout().lock();
    match out.write_all(bytes).and_then(|()| out.flush()) {
        Err(e) if e.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => Ok(other?),
    }
}

/// Runs `work` on a pool of so many threads (0: one per core).
pub fn in_pool<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> Result<T, CliError> {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(threads)
        .build()
        .map_err(|e| CliError::Threads { threads, reason: e.to_string() })?;
    Ok(pool.install(work))
}
