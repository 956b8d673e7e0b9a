//! `twofold sweep`: one run with some of its numbers varied, and where each ends. The sweep itself
//! is [`job::sweep`](crate::job::sweep).

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::cli::ending;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::general;
use crate::cli::progress::Progress;
use crate::cli::rows::{Pending, compute, journal_of};
use crate::cli::speak::{complain, deliver, is_standard_output, try_delivery};
use crate::cli::{CliError, Exit};
use crate::job::question;
use crate::job::sweep::{
    Axis, Base, Coordinate, Draws, Row, Rows, Shard, Sweep, SweepError, VERSION, Values,
};
use crate::job::table::Entry;
use crate::record::Journal;
use crate::record::files::read;

/// The most runs of --runs.
const MOST_RUNS: u64 = 1_000_000;
/// The runs of a sweep that names no axis.
const RUNS: u64 = 40;
/// By how much each of them is shifted.
const SHIFT: f64 = 1e-9;
/// The seed of random axes.
const DRAW_SEED: u64 = 2013;

/// Vary any number of a run, and say where each run ends: a row each, on standard output (or
/// --out), and how often each end occurred on standard error. Without --over, 40 starts whose first
/// component is shifted a little further each time. Without --section, ends of systems with h, plus
/// and minus are judged by their crossings of the second state's zero.
///
/// Rows are written to FILE.journal as they finish; --resume goes on with it after a kill, and
/// `twofold sweep merge` puts parts together: the same bytes, whatever the parts, their order and
/// how often they were interrupted. A run that fails is a row that says why; the exit code is then
/// 3. Random numbers of kicks and exits differ from row to row.
#[derive(Debug, clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "What can be varied: params.NAME, start.NAME, shift.NAME (added to the start), \
        rtol, atol, tolerance (both), max-step, t-end,\n\
    interval (between restarts), eps, eps-prime, delay, band, sigma, kick-every, kick-size, seed, \
    stream, method.\n\
    Values: a,b,c; FROM..TO:COUNT; FROM..TO:log:COUNT; STEP*COUNT; FROM..TO and FROM..TO:log drawn \
    at random; seed=FIRST..LAST.\n\n\
    Examples:\n  \
    twofold sweep --alpha 0.1 --beta 1e-4 --restart 100 --t-end 1e5 --method dopri5 --out \
    shifted.csv\n  \
    twofold sweep --t-end 2e5 --over params.alpha=1e-3..1:log:13 --over interval=20,40,100 --out \
    map.csv\n  \
    twofold sweep --t-end 2e5 --over method=lsoda,dopri5 --over shift.x=-1e-9..1e-9 --random 100 \
    --shard 2/8 --out part2.csv\n  \
    twofold sweep --system bouncing-ball --t-end 20 --over params.r=0.5..0.9:9 --out balls.csv\n  \
    twofold sweep merge part*.csv --out whole.csv"
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    #[command(flatten)]
    flags: RunFlags,
    /// Vary this; may be repeated, and rows then run over all combinations, the last axis fastest.
    #[arg(
        long,
        value_parser = crate::cli::flags::axis,
        value_name = "NAME=VALUES",
        allow_hyphen_values = true
    )]
    over: Vec<Axis>,
    /// Draw axes given as FROM..TO this many times for each combination of the others.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    random: Option<u64>,
    /// Seed of those draws [default: 2013].
    #[arg(long, value_name = "SEED", allow_negative_numbers = true)]
    random_seed: Option<u64>,
    /// Period of a general system that depends on the time: its states at the multiples of it are
    /// compared, instead of those at a --section.
    #[arg(
        long,
        value_parser = crate::cli::flags::time,
        value_name = "T",
        allow_hyphen_values = true
    )]
    period: Option<f64>,
    /// Number of runs: short for --over shift.NAME=SHIFT*RUNS with the first component's name
    /// [default: 40].
    #[arg(long, allow_negative_numbers = true)]
    runs: Option<u64>,
    /// With --runs: the first component of the start is shifted by this, twice this, three times
    /// this ... [default: 1e-9].
    #[arg(long, value_parser = crate::cli::flags::plain, allow_hyphen_values = true)]
    shift: Option<f64>,
    /// Compute only every Nth row, from the Kth on.
    #[arg(long, value_name = "K/N", default_value = "1/1")]
    shard: Shard,
    /// Go on with the rows that FILE and FILE.journal hold; FILE may be of the same sweep with
    /// fewer draws.
    #[arg(long)]
    resume: bool,
    /// With --resume: rows of another version of the program are kept if this many of them, spread
    /// evenly, come out the same again.
    #[arg(long, value_name = "N", allow_negative_numbers = true)]
    recheck: Option<u64>,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// File to write instead of standard output (-): JSON if its name ends in .json, else CSV.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Spec, rows and counts as JSON.
    #[arg(long)]
    json: bool,
    /// No progress and no summary on standard error.
    #[arg(long)]
    quiet: bool,
}

#[derive(Debug, clap::Subcommand)]
enum Command {
    Merge(Merge),
}

/// Put the rows of several parts of one sweep together: files that `twofold sweep` wrote, or
/// journals that it left.
///
/// Parts of two versions of the numerics are refused. If rows are missing, what is there is written
/// and the exit code is 1.
#[derive(Debug, clap::Args)]
struct Merge {
    /// The parts: .csv or .journal.
    #[arg(required = true, value_name = "FILE")]
    parts: Vec<PathBuf>,
    /// File to write instead of standard output (-): JSON if its name ends in .json, else CSV.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// Spec, rows and counts as JSON.
    #[arg(long)]
    json: bool,
    /// No summary on standard error.
    #[arg(long)]
    quiet: bool,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    match &arguments.command {
        Some(Command::Merge(merge)) => merged(merge),
        None => computed(arguments),
    }
}

const ONE_STATE: &str = "where a run ends is seen where it meets a section, which one state does \
    not have: give a system of two states or more, or write this one with `f = [...]` instead of \
    h, plus and minus";

impl Arguments {
    /// The sweep that is asked for.
    ///
    /// # Errors
    /// If a flag has no effect, or a value is wrong.
    pub fn sweep(&self) -> Result<Sweep, CliError> {
        sweep(self)
    }
}

fn sweep(arguments: &Arguments) -> Result<Sweep, CliError> {
    let usage = |text: String| Err(CliError::Usage(text));
    if let Some((flag, axis)) = arguments.flags.replaced_by(&arguments.over) {
        return Err(CliError::no_effect(
            flag,
            format!("--over {axis} gives every row its own; leave one of the two out"),
        ));
    }
    let base = match general::looked_at(&arguments.flags, arguments.period)? {
        Some(run) => Base::from(run),
        None => Base::from(arguments.flags.spec(Use::Crossings)?),
    };
    if let Base::Surfaces(run) = &base
        && run.system.dimension() < 2
    {
        return usage(ONE_STATE.into());
    }
    let mut over = arguments.over.clone();
    let given = [("--runs", arguments.runs.is_some()), ("--shift", arguments.shift.is_some())];
    if let (false, Some((flag, _))) = (over.is_empty(), given.iter().find(|(_, given)| *given)) {
        return Err(CliError::no_effect(
            *flag,
            "--over says what is varied; give --over shift.NAME=STEP*COUNT beside the other axes",
        ));
    }
    if over.is_empty() {
        let runs = arguments.runs.unwrap_or(RUNS);
        if !(1..=MOST_RUNS).contains(&runs) {
            return usage(format!(
                "--runs is {runs}: give a number from 1 to {MOST_RUNS}, or more by --over"
            ));
        }
        let shift = arguments.shift.unwrap_or(SHIFT);
        if !shift.is_finite() {
            return usage(format!("--shift is {shift}: give a finite number"));
        }
        let first = base.states().first().map_or(String::new(), |s| (*s).to_owned());
        over.push(Axis {
            coordinate: Coordinate::Shift(first),
            values: Values::Multiples { of: shift, count: runs },
        });
    }
    if let (Some(_), None) = (arguments.random_seed, arguments.random) {
        return Err(CliError::no_effect(
            "--random-seed",
            "no axis is drawn at random; leave it out, or give --random N",
        ));
    }
    let random = arguments
        .random
        .map(|count| Draws { count, seed: arguments.random_seed.unwrap_or(DRAW_SEED) });
    Sweep::new(base, over, random).map_err(|e| match e {
        SweepError::Spec(spec) => spec.into(),
        SweepError::Period(why) => CliError::Usage(why),
        other => CliError::Usage(format!("--over: {other}")),
    })
}

fn computed(arguments: &Arguments) -> Result<Exit, CliError> {
    let sweep = sweep(arguments)?;
    let out = arguments.out.as_deref().filter(|f| !is_standard_output(f));
    let format = format(out, arguments.json)?;
    try_delivery(out)?;
    if arguments.recheck.is_some() && !arguments.resume {
        return Err(CliError::no_effect(
            "--recheck",
            "it belongs to --resume; leave it out, or go on with a file",
        ));
    }
    let mut rows = Rows::of(sweep.clone());
    let mut journal = None;
    if let Some(out) = out {
        journal = Some(open(arguments, out, format, &mut rows)?);
    } else if arguments.resume {
        return Err(CliError::no_effect(
            "--resume",
            "there is no file to go on with; give --out FILE",
        ));
    }
    let pending = Pending::of(&rows, arguments.shard);
    let progress = Progress::with_grace(arguments.quiet);
    progress.say_default_switch(&arguments.flags, &arguments.over);
    if arguments.resume {
        progress.line(&format!("{} rows are there, {} to compute", rows.len(), pending.left()));
    }
    let none_yet = rows.is_empty();
    let rows = match compute(rows, pending, journal.as_mut(), arguments.threads, &progress) {
        Ok(rows) => rows,
        Err(error) => {
            // A flag that was refused computed nothing: no journal stays that holds nothing.
            let refused = matches!(error, CliError::Usage(_) | CliError::Threads { .. });
            if let Some(journal) = journal.filter(|_| refused && none_yet) {
                journal.remove()?;
            }
            return Err(error);
        }
    };
    let wanted = arguments.shard.count(&sweep);
    let left = rows.missing_count(arguments.shard);
    if left > 0
        && let Some(exit) = progress.asked_to_stop()
    {
        let place = match out {
            Some(out) => format!("{}; --resume goes on with them", journal_of(out).display()),
            None => {
                deliver(None, &bytes_of(&rows, format))?;
                "standard output".to_owned()
            }
        };
        let said = format!(
            "interrupted: {} of {wanted} runs are finished, their rows are in {place}",
            wanted - left
        );
        return Err(CliError::Stopped { said, exit });
    }
    deliver(out, &bytes_of(&rows, format))?;
    if let Some(journal) = journal {
        journal.remove()?;
    }
    summary(&rows, &progress)
}

/// Opens the journal beside `out` and takes in what is there.
fn open(
    arguments: &Arguments,
    out: &Path,
    format: Format,
    rows: &mut Rows,
) -> Result<Journal, CliError> {
    let path = journal_of(out);
    let (mut journal, lines) = Journal::open(&path)?;
    let refuse = |file: &Path, why: String| CliError::Usage(format!("{}: {why}", file.display()));
    if !arguments.resume && !lines.is_empty() {
        let rows = lines.iter().filter(|line| line.starts_with('[')).count();
        let why = format!(
            "it holds {rows} rows of a sweep that was not finished; --resume goes on with it, or \
                remove it"
        );
        return Err(refuse(&path, why));
    }
    let heading = rows.journal_heading();
    if !lines.is_empty() {
        let old = Rows::from_journal(&lines).map_err(|e| refuse(&path, e.to_string()))?;
        take(arguments, rows, old, &path)?;
    }
    if arguments.resume && out.exists() {
        let old = if format == Format::Json {
            let why =
                "a finished table in JSON is not read again; write CSV, or leave out --resume";
            Err(refuse(out, why.into()))
        } else {
            read_rows(out)
        };
        if let Err(error) = old.and_then(|old| take(arguments, rows, old, out)) {
            // A journal of this sweep beside a table of another one would be in the way of both.
            if lines.is_empty() {
                journal.remove()?;
            }
            return Err(error);
        }
    }
    if !lines.contains(&heading) {
        journal.append(&heading)?;
    }
    Ok(journal)
}

/// Takes rows in that were computed before, if they may be mixed with today's.
fn take(arguments: &Arguments, rows: &mut Rows, old: Rows, file: &Path) -> Result<(), CliError> {
    let refuse = |why: String| CliError::Usage(format!("{}: {why}", file.display()));
    // A file of fewer draws holds the first rows of this sweep.
    let more = rows
        .sweep()
        .draws()
        .filter(|now| old.sweep().draws().is_some_and(|then| then.count < now.count));
    let old = match more.and_then(|now| old.with_draws(now.count)) {
        Some(more) if more.sweep() == rows.sweep() => more,
        _ => old,
    };
    let foreign: Vec<String> =
        old.numerics().filter(|n| *n != question::NUMERICS).map(str::to_owned).collect();
    if !foreign.is_empty() && old.sweep().hash() == rows.sweep().hash() && !old.is_empty() {
        let Some(wanted) = arguments.recheck else {
            return Err(refuse(format!(
                "its rows were computed by another version of the numerics ({}); --recheck N keeps \
                    them if N of them come out the same again",
                foreign.join(", ")
            )));
        };
        let there: Vec<Row> = old.iter().collect();
        let step = (there.len() / usize::try_from(wanted.max(1)).unwrap_or(usize::MAX)).max(1);
        for row in there.iter().step_by(step) {
            match old.sweep().row(row.number(), &()) {
                Ok(again) if again.line() == row.line() => {}
                Ok(_) => {
                    return Err(refuse(format!(
                        "row {} has another result with this version; start again without \
                            --resume, or in another file",
                        row.number()
                    )));
                }
                Err(error) => return Err(error.into()),
            }
        }
    }
    rows.merge_rechecked(old).map_err(|e| refuse(e.to_string()))
}

/// The rows of a file of ours.
fn read_rows(file: &Path) -> Result<Rows, CliError> {
    let ending = file.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
    let found = match ending.as_str() {
        "journal" => Rows::from_journal(&Journal::read(file)?),
        _ => Rows::from_csv(&read(file)?),
    };
    found.map_err(|e| CliError::Usage(format!("{}: {e}", file.display())))
}

fn merged(arguments: &Merge) -> Result<Exit, CliError> {
    let out = arguments.out.as_deref().filter(|f| !is_standard_output(f));
    let format = format(out, arguments.json)?;
    try_delivery(out)?;
    let mut parts = arguments.parts.iter();
    let first = parts.next().ok_or_else(|| CliError::Usage("give the parts to merge".into()))?;
    let mut rows = read_rows(first)?;
    for part in parts {
        rows.merge(read_rows(part)?)
            .map_err(|e| CliError::Usage(format!("{}: {e}", part.display())))?;
    }
    deliver(out, &bytes_of(&rows, format))?;
    let progress = Progress::new(arguments.quiet);
    progress.line(&format!("{} of {} rows", rows.len(), rows.sweep().rows()));
    let ends = summary(&rows, &progress)?;
    let missing = rows.missing_count(Shard::WHOLE);
    if missing == 0 {
        return Ok(ends);
    }
    let first = rows.missing(Shard::WHOLE).next().unwrap_or_default();
    complain(&format!(
        "error: {missing} of {} rows are in none of the parts, the first of them row {first}; \
            merge their parts, too, or \
         compute them with --resume",
        rows.sweep().rows()
    ));
    Ok(if ends == Exit::Fine { Exit::CheckFailed } else { ends })
}

/// Format of the rows.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
enum Format {
    Csv,
    Json,
}

fn format(out: Option<&Path>, as_json: bool) -> Result<Format, CliError> {
    ending::format(out, as_json.then_some(Format::Json), Format::Csv)
}

fn bytes_of(rows: &Rows, format: Format) -> Vec<u8> {
    match format {
        Format::Csv => rows.csv(),
        Format::Json => json_of(rows),
    }
}

fn json_of(rows: &Rows) -> Vec<u8> {
    let table = rows.table();
    let cell = |entry: &Entry| match entry {
        Entry::Number(v) => json!(v),
        Entry::Integer(v) => json!(v),
        Entry::Word(w) => json!(w),
    };
    let list: Vec<Value> = table
        .rows()
        .iter()
        .map(|row| table.columns.iter().zip(row).map(|(c, e)| (c.name.clone(), cell(e))).collect())
        .collect();
    let whole = json!({
        "format": "twofold-sweep",
        "version": VERSION,
        "sweep": rows.sweep().hash(),
        "spec": rows.sweep().run(),
        "over": rows.sweep().axes(),
        "runs": rows.sweep().rows(),
        "finished": rows.len(),
        "ends": rows.counts(),
        "rows": list,
    });
    let mut bytes = serde_json::to_vec_pretty(&whole).expect("rows are plain data");
    bytes.push(b'\n');
    bytes
}

/// Prints the number of runs with each end, and the first failure, if there is one.
fn summary(rows: &Rows, progress: &Progress) -> Result<Exit, CliError> {
    let counts = rows.counts();
    for (end, count) in &counts {
        progress.line(&format!("{count:>4} of {} end: {end}", rows.len()));
    }
    match rows.iter().find(|row| row.reason().is_some()) {
        None => Ok(Exit::Fine),
        Some(row) => {
            let failed = rows.iter().filter(|row| row.reason().is_some()).count();
            complain(&format!(
                "error: {failed} of {} runs failed; the first, row {}: {}",
                rows.len(),
                row.number(),
                row.reason().unwrap_or_default()
            ));
            Ok(Exit::Failed)
        }
    }
}
