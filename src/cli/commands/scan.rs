//! `twofold scan`: an orbit diagram along one setting, or a map of endings over two.

use std::path::PathBuf;

use rayon::prelude::*;
use serde_json::json;

use crate::cli::ending;
use crate::cli::exit::part_of;
use crate::cli::flags::{RunFlags, Use};
use crate::cli::progress::Progress;
use crate::cli::speak::{Delivery, complain, deliver, is_standard_output, try_delivery};
use crate::cli::{CliError, Exit, in_pool};
use crate::draw::scan::{self, Basin, Scanned};
use crate::integrate::Watch;
use crate::job::spec::{Observation, RunSpec};
use crate::job::sweep::{Axis, Coordinate, Ending, Sweep, Values};
use crate::job::table::{Column, Entry, Table};
use crate::job::{self, Answer, Executor, JobError, Run, encode};
use crate::render::markup;

use super::plot::{Format, small_print, write};

/// Vary one or two settings of a run and see what it does: over one, an orbit diagram (the late crossings of the plane for each value); over
/// two, such as a plane of starts, a map of what each run ends on.
///
/// Endings are the outcomes of `twofold sweep`: rest, period-K, irregular and so on. Runs that end on the same attractor have the same number. For
/// more settings, statistics and resuming see there.
/// Ctrl-C keeps the rows that are finished: on standard output, or beside --out under the name FILE.part.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    twofold scan --system buck --section s=0 --over params.supply=22..33:100 --t-end 200 --plot buck.png --out buck.csv\n  \
    twofold scan --system chua --section y=0 --over start.x=-3..3:40 --over start.z=-6..6:40 --t-end 200 --plot basins.png --out basins.csv")]
pub struct Arguments {
    #[command(flatten)]
    flags: RunFlags,
    /// A setting and its values: params.NAME, start.NAME, shift.NAME, eps ... =FROM..TO:COUNT, FROM..TO:log:COUNT or a,b,c; once or twice.
    #[arg(long, value_name = "NAME=VALUES", required = true, allow_hyphen_values = true, help_heading = "Scan")]
    over: Vec<Axis>,
    /// Over two settings, attractors this near (as a share of the largest number in any start or attractor) have one number [default: 0.01].
    #[arg(long, value_name = "SHARE", allow_hyphen_values = true, help_heading = "Scan")]
    alike: Option<f64>,
    /// Draw the picture into this file (.png, .svg or .pdf).
    #[arg(long, value_name = "FILE", help_heading = "Scan")]
    plot: Option<PathBuf>,
    /// The state on the diagram's vertical axis, over one setting [default: the first one that is not the plane's].
    #[arg(long, value_name = "STATE", help_heading = "Scan")]
    show: Option<String>,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    #[command(flatten)]
    delivery: Delivery,
}

/// Most runs of a scan: their rows are kept in memory.
const MOST_RUNS: u64 = 1_000_000;

/// A finished cell.
struct Cell {
    settings: Vec<Entry>,
    found: Result<Found, JobError>,
}

/// What the rows of a scan are written as.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
enum Rows {
    Csv,
}

/// What is kept of a run.
enum Found {
    /// Over one setting: late crossings, with times.
    Crossings(Vec<(f64, Vec<f64>)>),
    /// Over two.
    Ending(Ending),
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let spec = arguments.flags.spec(Use::Crossings)?;
    let usage = |text: String| Err(CliError::Usage(text));
    let two = match arguments.over.len() {
        1 => false,
        2 => true,
        n => {
            return usage(format!(
                "--over is given {n} times: once for an orbit diagram, twice for a map; `twofold sweep` takes more"
            ));
        }
    };
    if arguments.over.iter().any(Axis::is_random) {
        return usage(
            "--over FROM..TO without a count is drawn at random, which `twofold sweep` does; give FROM..TO:COUNT"
                .into(),
        );
    }
    let alike = arguments.alike.unwrap_or(1e-2);
    if !two && arguments.alike.is_some() {
        return Err(CliError::no_effect(
            "--alike",
            "an orbit diagram compares nothing; leave it out, or give --over twice",
        ));
    }
    if !(alike > 0.0 && alike.is_finite()) {
        return usage(format!("--alike is {alike}: give a number above zero, such as 0.01"));
    }
    let shown = shown(arguments, &spec, two)?;
    let sweep = Sweep::new(spec, arguments.over.clone(), None).map_err(|e| CliError::Usage(format!("--over: {e}")))?;
    if sweep.rows() > MOST_RUNS {
        return usage(format!("--over: {} runs; give at most {MOST_RUNS}, or use `twofold sweep`", sweep.rows()));
    }
    let format = arguments.plot.as_deref().map(|file| Format::of(file, None)).transpose()?;
    if two
        && format.is_some()
        && !sweep.axes().iter().all(|a| matches!(a.value(0, 0.5), Entry::Number(_) | Entry::Integer(_)))
    {
        return usage("--plot: a map is drawn over numbers".into());
    }
    let out = arguments.delivery.out.as_deref();
    let Rows::Csv = ending::format(out, None, Rows::Csv)?;
    try_delivery(out)?;
    if let Some(file) = &arguments.plot {
        try_delivery(Some(file))?;
    }
    let progress = Progress::with_grace(arguments.delivery.quiet);
    let rows = sweep.rows();
    let watch = job::Progress::begin(&progress, "scan", rows as f64);
    let done = std::sync::atomic::AtomicU64::new(0);
    let cells: Vec<Option<Cell>> = in_pool(arguments.threads, || {
        (0..rows)
            .into_par_iter()
            .map(|row| {
                let cell = cell(&sweep, row, two, &progress);
                let finished = done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1;
                watch.reached(finished as f64);
                cell
            })
            .collect()
    })?;
    let cells: Vec<Cell> = cells.into_iter().flatten().collect();
    watch.done(&format!("{} of {rows} runs", cells.len()));
    let (table, basins) = if two { endings(&sweep, &cells, alike) } else { (passages(&sweep, &cells), Vec::new()) };
    let about = json!({ "kind": "scan", "run": sweep.run(), "over": sweep.axes(), "alike": two.then_some(alike) });
    let bytes = encode::csv(&table, &about);
    if (cells.len() as u64) < rows
        && let Some(exit) = progress.asked_to_stop()
    {
        let part = out.filter(|f| !is_standard_output(f)).map(part_of);
        deliver(part.as_deref(), &bytes)?;
        let place = part.map_or("standard output".to_owned(), |p| p.display().to_string());
        let said = format!("interrupted: {} of {rows} runs are finished, their rows are in {place}", cells.len());
        return Err(CliError::Stopped { said, exit });
    }
    deliver(out, &bytes)?;
    if let (Some(file), Some(format)) = (&arguments.plot, format) {
        let sheet = picture(&sweep, &table, &basins, shown.as_deref(), two);
        write(&sheet, file, format)?;
    }
    match cells.iter().find_map(|c| c.found.as_ref().err()) {
        None => Ok(Exit::Fine),
        Some(error) => {
            let failed = cells.iter().filter(|c| c.found.is_err()).count();
            complain(&format!("error: {failed} of {rows} runs failed; the first: {error}"));
            Ok(Exit::Failed)
        }
    }
}

/// The state of the vertical axis.
fn shown(arguments: &Arguments, spec: &RunSpec, two: bool) -> Result<Option<String>, CliError> {
    let names = spec.system.coordinates();
    let Observation::Section { coordinate, .. } = spec.observe else { return Ok(None) };
    match &arguments.show {
        Some(_) if two || arguments.plot.is_none() => Err(CliError::no_effect(
            "--show",
            "it names the vertical axis of an orbit diagram's picture; leave it out, or give --plot and one --over",
        )),
        Some(name) if names.contains(&name.as_str()) => Ok(Some(name.clone())),
        Some(name) => {
            Err(CliError::Usage(format!("--show {name}: there is no such state; choose among {}", names.join(", "))))
        }
        None => {
            let first = (0..names.len()).find(|i| *i != coordinate).unwrap_or(0);
            Ok(Some(names[first].to_owned()))
        }
    }
}

/// One run, or nothing if it was interrupted.
fn cell(sweep: &Sweep, row: u64, two: bool, progress: &Progress) -> Option<Cell> {
    if progress.asked_to_stop().is_some() {
        return None;
    }
    let settings = sweep.settings(row);
    let found = sweep.question(row).map_err(JobError::Other).and_then(|asked| {
        let (silent, watch) = (Silent(progress), SilentRun(progress));
        let executor = Executor::new(None, &silent);
        if two {
            return asked.ending(&executor, &watch).map(Found::Ending);
        }
        let run = asked.0.run;
        let answer = executor.ask(&Run(run.clone()))?;
        if answer.stop == job::Stop::Interrupted {
            return Err(JobError::Interrupted);
        }
        late(&run, &answer).map(Found::Crossings).ok_or_else(|| JobError::Other("no section was recorded".into()))
    });
    match found {
        Err(JobError::Interrupted) => None,
        found => Some(Cell { settings, found }),
    }
}

/// A display that shows nothing of single runs and stops them when it is asked to.
struct Silent<'a>(&'a Progress);

impl job::Progress for Silent<'_> {
    fn begin<'a>(&'a self, _: &str, _: f64) -> Box<dyn job::JobWatch + 'a> {
        Box::new(SilentRun(self.0))
    }
}

struct SilentRun<'a>(&'a Progress);

impl Watch for SilentRun<'_> {
    fn reached(&self, _: f64) -> bool {
        self.0.asked_to_stop().is_none()
    }
}

impl job::JobWatch for SilentRun<'_> {
    fn done(self: Box<Self>, _: &str) {}
}

/// Upward crossings of the late half.
fn late(run: &RunSpec, answer: &Answer) -> Option<Vec<(f64, Vec<f64>)>> {
    let section = answer.table("section")?;
    let columns: Vec<&[f64]> = run.system.coordinates().iter().map(|n| section.numbers(n)).collect();
    let t = section.numbers("t");
    let upward = section.words("direction").enumerate().filter(|(row, w)| *w == "up" && t[*row] > 0.5 * run.t_end);
    Some(upward.map(|(row, _)| (t[row], columns.iter().map(|c| c[row]).collect())).collect())
}

/// Columns of the settings.
fn setting_columns(sweep: &Sweep) -> Vec<Column> {
    sweep
        .axes()
        .iter()
        .map(|axis| {
            let name = axis.coordinate.to_string();
            match axis.value(0, 0.5) {
                Entry::Number(_) => Column::numbers(&name),
                Entry::Integer(_) => Column::integers(&name),
                Entry::Word(_) => Column::words(&name),
            }
        })
        .collect()
}

/// A line of "name = value, name = value" without the values that every run of the scan has its own of; `None` if nothing is left.
fn without(line: &str, varied: &[String]) -> Option<String> {
    let is_fixed = |part: &&str| part.split_once(" = ").is_none_or(|(name, _)| !varied.iter().any(|v| v == name));
    let fixed: Vec<&str> = line.split(", ").filter(is_fixed).collect();
    (!fixed.is_empty()).then(|| fixed.join(", "))
}

fn passages(sweep: &Sweep, cells: &[Cell]) -> Table {
    let states = sweep.run().system.coordinates();
    let columns = setting_columns(sweep).into_iter().chain([Column::numbers("t")]);
    let mut table = Table::new("passages", columns.chain(states.iter().map(|n| Column::numbers(n))));
    for cell in cells {
        if let Ok(Found::Crossings(points)) = &cell.found {
            for (t, x) in points {
                table.push(
                    cell.settings.iter().cloned().chain([(*t).into()]).chain(x.iter().map(|v| Entry::Number(*v))),
                );
            }
        }
    }
    table
}

/// A row per run, and the endings in order of their first occurrence.
fn endings(sweep: &Sweep, cells: &[Cell], alike: f64) -> (Table, Vec<Basin>) {
    let columns = setting_columns(sweep);
    let mut table = Table::new(
        "endings",
        columns.into_iter().chain([Column::words("ending"), Column::integers("number"), Column::words("reason")]),
    );
    let mut known: Vec<(Ending, Basin)> = Vec::new();
    let mut failed = Basin { name: "failed".into(), attracts: false, cells: Vec::new() };
    let scale = cells.iter().filter_map(|c| match &c.found {
        Ok(Found::Ending(ending)) => Some(ending.place.iter().flatten().copied()),
        _ => None,
    });
    let given = cells.iter().flat_map(|c| sweep.axes().iter().zip(&c.settings)).filter_map(|(axis, entry)| {
        let start = matches!(axis.coordinate, Coordinate::Start(_));
        start.then(|| entry.value())
    });
    let starts = sweep.run().start.iter().copied().chain(given);
    let near = alike * scale.flatten().chain(starts).fold(0.0_f64, |a, x| a.max(x.abs()));
    let height = sweep.axes().get(1).map_or(1, Axis::count).max(1) as usize;
    for (row, cell) in cells.iter().enumerate() {
        let at = (row / height, row % height);
        let (word, number, reason) = match &cell.found {
            Ok(Found::Ending(ending)) => {
                let word = &ending.outcome.word;
                let index = known.iter().position(|(e, _)| e.is_like(ending, near)).unwrap_or_else(|| {
                    let attracts = !ending.place.is_empty();
                    known.push((ending.clone(), Basin { name: word.clone(), attracts, cells: Vec::new() }));
                    known.len() - 1
                });
                known[index].1.cells.push(at);
                (word.clone(), index as i64 + 1, String::new())
            }
            Ok(Found::Crossings(_)) => continue,
            Err(error) => {
                failed.cells.push(at);
                ("failed".to_owned(), 0, error.to_string())
            }
        };
        let more = [Entry::Word(word), Entry::Integer(number), Entry::Word(reason)];
        table.push(cell.settings.iter().cloned().chain(more));
    }
    let words: Vec<String> = known.iter().map(|(ending, _)| ending.outcome.word.clone()).collect();
    let mut basins: Vec<Basin> = known.into_iter().map(|(_, basin)| basin).collect();
    // Two attractors may have one word; the rows tell them apart by their numbers.
    for (i, basin) in basins.iter_mut().enumerate() {
        if words.iter().filter(|word| **word == words[i]).count() > 1 {
            basin.name = format!("{}, no. {}", words[i], i + 1);
        }
    }
    if !failed.cells.is_empty() {
        basins.push(failed);
    }
    (table, basins)
}

/// A setting as it is drawn; its name as mathematics sets it, of `params.alpha` only the parameter's.
fn scanned(axis: &Axis) -> Scanned {
    let name = axis.coordinate.to_string();
    let values: Vec<f64> = (0..axis.count()).map(|i| axis.value(i, 0.5).value()).collect();
    let logarithmic = matches!(axis.values, Values::Log { .. }) && values.iter().all(|v| *v > 0.0);
    Scanned { title: markup::name(name.rsplit('.').next().unwrap_or(&name)), values, logarithmic }
}

fn picture(sweep: &Sweep, table: &Table, basins: &[Basin], shown: Option<&str>, two: bool) -> crate::render::Sheet {
    let title = sweep.run().system.definition().title().to_owned();
    let axes = sweep.axes();
    let mut sheet = if two {
        scan::map(&title, [&scanned(&axes[0]), &scanned(&axes[1])], basins)
    } else {
        let name = axes[0].coordinate.to_string();
        let value = |row: usize| table.column(&name).map_or(f64::NAN, |c| c.get(row).value());
        let heights = shown.map_or(&[][..], |s| table.numbers(s));
        let points = heights.iter().enumerate().map(|(row, y)| [value(row), *y]).collect();
        scan::diagram(&title, &scanned(&axes[0]), &shown.map_or(String::new(), markup::name), points)
    };
    let over: Vec<String> = axes.iter().map(|a| markup::literal(&a.to_string())).collect();
    let varied: Vec<String> = axes.iter().map(|axis| scanned(axis).title).collect();
    sheet.footer = small_print(sweep.run()).iter().filter_map(|line| without(line, &varied)).collect();
    sheet.footer.insert(0, format!("over {}", over.join(", ")));
    sheet
        .provenance("Software", concat!("twofold ", env!("CARGO_PKG_VERSION")))
        .provenance("Picture", if two { "scan-map" } else { "scan-diagram" })
        .provenance("Reading", "none")
        .provenance("Method", sweep.run().method.name.name())
        .provenance("Spec-SHA256", sweep.hash().as_str())
        .provenance("Data-SHA256", crate::record::Hash::of(&encode::bits(std::slice::from_ref(table))).as_str())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_print_says_nothing_of_what_is_varied() {
        let varied = ["*α*".to_owned(), "*ε*".to_owned()];
        assert_eq!(without("*α* = 9, *β* = 14, *t* = 0 … 5", &varied).as_deref(), Some("*β* = 14, *t* = 0 … 5"));
        assert_eq!(without("tanh smoothing, *ε* = 10^{-3}", &varied).as_deref(), Some("tanh smoothing"));
        assert_eq!(without("*α* = 9", &varied), None);
        assert_eq!(without("lsoda", &varied).as_deref(), Some("lsoda"));
    }
}
