//! Scans: the late crossings of a run for each value of one setting, or the attractor over a grid
//! of two settings.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use twofold_hybrid::motion::Record;
use twofold_hybrid::{Ending as Outcome, follow_watched};
use twofold_integrate::Monitor;

use super::classification::Classification;
use super::executor::{Executor, JobMonitor, Progress};
use super::general::{GeneralRun, last_of_phase};
use super::question::{AnyQuestion, Ask, JobError, Question};
use super::run::Run;
use super::spec::{RunSpec, SwitchSpec};
use super::sweep::{Axis, Base, Coordinate, GeneralEnding, GeneralOutcome, OutcomeQuestion, Sweep};
use super::table::{Column, Entry, Table};
use super::{Answer, Stop};

/// Each run begins where that of the neighbouring value ended, so that an attractor is followed for
/// as long as it attracts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Follow {
    /// From the lowest value to the highest.
    Up,
    /// From the highest to the lowest.
    Down,
    /// Both, one after the other: where they differ, two attractors stand side by side.
    Both,
}

/// A scan.
#[derive(Clone, Debug)]
pub struct Scan {
    sweep: Sweep,
    follow: Option<Follow>,
    alike: f64,
}

/// The result of a scan.
#[derive(Debug)]
pub struct Scanned {
    /// Over one setting `passages`, a row a crossing; over two `endings`, a row a run.
    pub table: Table,
    /// Finished runs: fewer than [`Scan::runs`] if the scan was stopped.
    pub finished: u64,
    /// Those that failed.
    pub failed: u64,
    /// Why the first of them did.
    pub first_error: Option<JobError>,
}

/// Maximum number of runs of a scan, whose rows are kept in memory.
pub const MOST_RUNS: u64 = 1_000_000;

/// The attractor of a run, and its place.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
struct Landing {
    word: String,
    place: Vec<Vec<f64>>,
}

/// Data kept of a run.
struct Found {
    settings: Vec<Entry>,
    /// Late crossings: time and state.
    late: Vec<(f64, Vec<f64>)>,
    /// Over two settings.
    landing: Option<Landing>,
    end: Option<End>,
}

/// End of a run: state and mode.
type End = (Vec<f64>, usize);

type Cell = Option<(Vec<Entry>, Result<Found, JobError>)>;

/// Stops single runs when the scan is to stop.
pub(crate) struct Asked<'a> {
    pub monitor: &'a dyn Monitor,
    pub finished: &'a AtomicU64,
}

impl Monitor for Asked<'_> {
    fn reached(&self, _: f64) -> ControlFlow<()> {
        self.monitor.reached(self.finished.load(Ordering::Relaxed) as f64)
    }
}

impl JobMonitor for Asked<'_> {
    fn done(self: Box<Self>, _: &str) {}
}

impl Progress for Asked<'_> {
    fn begin<'a>(&'a self, _: &str, _: f64) -> Box<dyn JobMonitor + 'a> {
        Box::new(Asked { ..*self })
    }
}

impl Landing {
    /// Whether this is where the other run ends, too: places count as one that are within `near` of
    /// each other.
    fn is_like(&self, other: &Self, near: f64) -> bool {
        let (a, b) = (&self.place, &other.place);
        let n = a.len();
        let alike = |i: usize, j: usize| {
            let square = a[i].iter().zip(&b[j]).map(|(x, y)| (x - y) * (x - y)).sum::<f64>();
            square <= near * near
        };
        // The same turn may be cut at another crossing.
        self.word == other.word
            && n == b.len()
            && (n == 0 || (0..n).any(|s| (0..n).all(|i| alike(i, (i + s) % n))))
    }
}

impl Scan {
    /// A scan of `sweep`; `alike`: attractors this near, as a share of the largest number in any
    /// start or attractor, are one.
    ///
    /// # Errors
    /// Settings that contradict each other, in words.
    pub fn new(sweep: Sweep, follow: Option<Follow>, alike: f64) -> Result<Self, String> {
        let scan = Self { sweep, follow, alike };
        let axes = scan.axes();
        if axes.iter().any(Axis::is_random) {
            return Err(
                "FROM..TO without a count is drawn at random, which `twofold sweep` does; give \
                    FROM..TO:COUNT"
                    .into(),
            );
        }
        if follow.is_some() {
            if axes.len() != 1 {
                return Err("an attractor is followed along one setting; give --over once".into());
            }
            if matches!(axes[0].coordinate, Coordinate::Start(_) | Coordinate::Shift(_)) {
                return Err(
                    "what is followed begins where the run before ended; vary something other than \
                        the start".into()
                );
            }
            if !matches!(axes[0].value(0, 0.5), Entry::Number(_) | Entry::Integer(_)) {
                return Err("an attractor is followed along numbers".into());
            }
            if let Base::Surfaces(run) = scan.sweep.run()
                && !matches!(run.switch, SwitchSpec::Smoothed { .. } | SwitchSpec::Filippov { .. })
            {
                return Err(
                    "of a switch with a memory more than the coordinates would have to be handed \
                        on; leave --follow out"
                        .into(),
                );
            }
        }
        if let Base::Surfaces(run) = scan.sweep.run()
            && scan.is_map()
            && run.system.dimension() < 2
        {
            return Err(
                "what runs end on is seen where they meet a section, which one state does \
                not have: give a system of two states or more"
                    .into(),
            );
        }
        let runs = scan.cells().saturating_mul(if follow == Some(Follow::Both) { 2 } else { 1 });
        if runs > MOST_RUNS {
            return Err(format!("{runs} runs; give at most {MOST_RUNS}, or use `twofold sweep`"));
        }
        Ok(scan)
    }

    /// The settings that vary.
    pub fn axes(&self) -> &[Axis] {
        self.sweep.axes()
    }

    /// Over one setting, each value once.
    fn cells(&self) -> u64 {
        self.axes().iter().map(Axis::count).product()
    }

    /// Number of runs.
    pub fn runs(&self) -> u64 {
        self.cells() * if self.follow == Some(Follow::Both) { 2 } else { 1 }
    }

    /// Whether two settings vary.
    pub fn is_map(&self) -> bool {
        self.axes().len() == 2
    }

    /// Direction in which attractors are followed.
    pub fn follow(&self) -> Option<Follow> {
        self.follow
    }

    /// The states' names.
    pub fn states(&self) -> Vec<&str> {
        self.sweep.run().states()
    }

    /// The description of this scan in its files.
    pub fn about(&self) -> Value {
        let run = match self.sweep.run() {
            Base::Surfaces(run) => json!(run),
            Base::General(run) => run.json(),
        };
        let mut about = json!({ "kind": "scan", "run": run, "over": self.axes(),
            "alike": self.is_map().then_some(self.alike) });
        if let Some(follow) = self.follow {
            about["follow"] = json!(follow);
        }
        about
    }

    /// Makes the runs, side by side on the current pool as far as none begins where another ends.
    /// `monitor` is told how many are finished and says whether to go on.
    pub fn compute(&self, monitor: &dyn Monitor) -> Scanned {
        let finished = AtomicU64::new(0);
        let asked = Asked { monitor, finished: &finished };
        let count = |found: &Cell| {
            if found.is_some() {
                finished.fetch_add(1, Ordering::Relaxed);
                let _ = asked.reached(0.0);
            }
        };
        let cells: Vec<(Option<&str>, Cell)> = match self.follow {
            None => (0..self.cells())
                .into_par_iter()
                .map(|row| {
                    let cell = self.cell(row, None, &asked);
                    count(&cell);
                    (None, cell)
                })
                .collect(),
            Some(follow) => {
                let along = |(word, rows): &Way| {
                    let mut before = None;
                    let mut cells = Vec::with_capacity(rows.len());
                    for row in rows {
                        let cell = self.cell(*row, before.as_ref(), &asked);
                        count(&cell);
                        before = handed_on(&cell);
                        let stopped = cell.is_none();
                        cells.push((*word, cell));
                        if stopped {
                            break;
                        }
                    }
                    cells
                };
                let ways = self.ways();
                match follow {
                    Follow::Up | Follow::Down => along(&ways[0]),
                    Follow::Both => {
                        let (mut all, down) = rayon::join(|| along(&ways[0]), || along(&ways[1]));
                        all.extend(down);
                        all
                    }
                }
            }
        };
        let errors = || cells.iter().filter_map(|(_, c)| c.as_ref()?.1.as_ref().err());
        let (failed, first_error) = (errors().count() as u64, errors().next().cloned());
        let table = if self.is_map() { self.endings(&cells) } else { self.passages(&cells) };
        Scanned { table, finished: finished.into_inner(), failed, first_error }
    }

    /// The ways in which it goes over its settings.
    fn ways(&self) -> Vec<Way> {
        let mut up: Vec<u64> = (0..self.cells()).collect();
        let Some(follow) = self.follow else { return vec![(None, up)] };
        let values: Vec<f64> = up.iter().map(|row| self.sweep.settings(*row)[0].value()).collect();
        up.sort_by(|a, b| values[*a as usize].total_cmp(&values[*b as usize]));
        let down: Vec<u64> = up.iter().rev().copied().collect();
        let (up, down) = ((Some("up"), up), (Some("down"), down));
        match follow {
            Follow::Up => vec![up],
            Follow::Down => vec![down],
            Follow::Both => vec![up, down],
        }
    }

    /// One run, or nothing if it was stopped.
    fn cell(&self, row: u64, from: Option<&End>, asked: &Asked<'_>) -> Cell {
        let settings = self.sweep.settings(row);
        let found = match self.sweep.run_of(row).map_err(JobError::Other) {
            Err(error) => Err(error),
            Ok(Base::Surfaces(run)) => self.of_surfaces(*run, from, asked),
            Ok(Base::General(run)) => self.of_general(*run, from, asked),
        };
        match found {
            Err(JobError::Interrupted) => None,
            found => Some((settings.clone(), found.map(|found| Found { settings, ..found }))),
        }
    }

    fn of_surfaces(
        &self,
        mut run: RunSpec,
        from: Option<&End>,
        asked: &Asked<'_>,
    ) -> Result<Found, JobError> {
        let none = Found { settings: Vec::new(), late: Vec::new(), landing: None, end: None };
        let executor = Executor::new(None, asked);
        if self.is_map() {
            let ending = OutcomeQuestion(Classification::of(run)).ending(&executor, asked)?;
            return Ok(Found {
                landing: Some(Landing { word: ending.outcome.word, place: ending.place }),
                ..none
            });
        }
        if let Some((state, _)) = from {
            run.start.clone_from(state);
        }
        let answer = executor.ask(&Run(run.clone()))?;
        if answer.stop == Stop::Interrupted {
            return Err(JobError::Interrupted);
        }
        let late = late(run.t_end, &run.system.coordinates(), &answer)
            .ok_or_else(|| JobError::Other("no section was recorded".into()))?;
        let end = self.follow.map(|_| answer.fact("state")).transpose()?.map(|state| (state, 0));
        Ok(Found { late, end, ..none })
    }

    fn of_general(
        &self,
        mut run: GeneralRun,
        from: Option<&End>,
        asked: &Asked<'_>,
    ) -> Result<Found, JobError> {
        let none = Found { settings: Vec::new(), late: Vec::new(), landing: None, end: None };
        if self.is_map() {
            let GeneralEnding { outcome, event, place, .. } = GeneralOutcome(run).ending(asked)?;
            let word = match &*outcome.word {
                "stopped" => format!("stopped by {event}"),
                "accumulates" => format!("{event} accumulates"),
                _ => outcome.word,
            };
            return Ok(Found { landing: Some(Landing { word, place }), ..none });
        }
        if let Some((state, mode)) = from {
            (run.options.start, run.options.mode) = (Some(state.clone()), *mode);
        }
        let middle = 0.5 * (run.options.t_start + run.options.t_end);
        let strobed = matches!(run.options.record, Record::Times { .. });
        let mut late: Vec<(f64, Vec<f64>)> = Vec::new();
        let mut observe = |point: &twofold_hybrid::Point<'_>| {
            // Seen every period is the state after the events of that moment.
            if strobed
                && point.event.is_some()
                && let Some((t, x)) = late.last_mut()
                && *t == point.t
            {
                x.copy_from_slice(point.x);
            }
            let counts = if strobed { point.event.is_none() } else { point.direction > Some(0.0) };
            if counts && point.t > middle {
                late.push((point.t, point.x.to_vec()));
            }
            true
        };
        let goes_on = |t| asked.reached(t).is_continue();
        let mut outcome = follow_watched(&run.model, &run.options, &mut observe, &goes_on)?;
        // The next run begins at the phase of this one's start.
        if let (Outcome::Finished, Some(_), Record::Times { every }) =
            (&outcome.ending, self.follow, &run.options.record)
            && let Some((last, false)) = last_of_phase(&run.options, *every)
        {
            run.options.t_end = last;
            outcome = follow_watched(&run.model, &run.options, &mut |_| true, &goes_on)?;
        }
        if outcome.ending == Outcome::Interrupted {
            return Err(JobError::Interrupted);
        }
        let end = (outcome.ending == Outcome::Finished).then_some((outcome.x, outcome.mode));
        Ok(Found { late, end, ..none })
    }

    /// Columns of the settings.
    fn columns(&self) -> Vec<Column> {
        let column = |axis: &Axis| {
            let name = axis.coordinate.to_string();
            match axis.value(0, 0.5) {
                Entry::Number(_) => Column::numbers(&name),
                Entry::Integer(_) => Column::integers(&name),
                Entry::Word(_) => Column::words(&name),
            }
        };
        self.axes().iter().map(column).collect()
    }

    fn passages(&self, cells: &[(Option<&str>, Cell)]) -> Table {
        let mut columns = self.columns();
        columns.extend(self.follow.map(|_| Column::words("follow")));
        columns.push(Column::numbers("t"));
        columns.extend(self.states().iter().map(|n| Column::numbers(n)));
        let mut table = Table::new("passages", columns);
        for (word, cell) in cells {
            let Some((_, Ok(found))) = cell else { continue };
            for (t, x) in &found.late {
                let follow = word.map(|w| Entry::Word(w.to_owned()));
                let numbers = [*t].into_iter().chain(x.iter().copied()).map(Entry::Number);
                table.push(found.settings.iter().cloned().chain(follow).chain(numbers));
            }
        }
        table
    }

    /// A row per run; endings have numbers in order of their first occurrence.
    fn endings(&self, cells: &[(Option<&str>, Cell)]) -> Table {
        let mut columns = self.columns();
        columns.extend([
            Column::words("ending"),
            Column::integers("number"),
            Column::words("reason"),
        ]);
        let mut table = Table::new("endings", columns);
        let mut known: Vec<Landing> = Vec::new();
        let cells: Vec<&(Vec<Entry>, Result<Found, JobError>)> =
            cells.iter().filter_map(|(_, c)| c.as_ref()).collect();
        let landing =
            |cell: &(Vec<Entry>, Result<Found, JobError>)| cell.1.as_ref().ok()?.landing.clone();
        let places =
            cells.iter().filter_map(|c| landing(c)).flat_map(|l| l.place.into_iter().flatten());
        let given = cells
            .iter()
            .flat_map(|c| self.axes().iter().zip(&c.0))
            .filter(|(axis, _)| matches!(axis.coordinate, Coordinate::Start(_)))
            .map(|(_, entry)| entry.value());
        let start = self.sweep.run().start();
        let near = self.alike
            * places.chain(start.into_iter().chain(given)).fold(0.0_f64, |a, x| a.max(x.abs()));
        for cell in cells {
            let (word, number, reason) = match (&cell.1, landing(cell)) {
                (Ok(_), Some(landing)) => {
                    let index =
                        known.iter().position(|e| e.is_like(&landing, near)).unwrap_or_else(|| {
                            known.push(landing.clone());
                            known.len() - 1
                        });
                    (landing.word, index as i64 + 1, String::new())
                }
                (Ok(_), None) => continue,
                (Err(error), _) => ("failed".to_owned(), 0, error.to_string()),
            };
            let more = [Entry::Word(word), Entry::Integer(number), Entry::Word(reason)];
            table.push(cell.0.iter().cloned().chain(more));
        }
        table
    }
}

/// Upward crossings of the late half.
fn late(t_end: f64, states: &[&str], answer: &Answer) -> Option<Vec<(f64, Vec<f64>)>> {
    let section = answer.table("section")?;
    let columns: Vec<&[f64]> = states.iter().map(|n| section.numbers(n)).collect();
    let t = section.numbers("t");
    let upward = section
        .words("direction")
        .enumerate()
        .filter(|(row, w)| *w == "up" && t[*row] > 0.5 * t_end);
    Some(upward.map(|(row, _)| (t[row], columns.iter().map(|c| c[row]).collect())).collect())
}

/// The state from which the next run is followed. A run that fails, or is ended by an event, hands
/// nothing on: the next one begins at the start.
fn handed_on(cell: &Cell) -> Option<End> {
    cell.as_ref().and_then(|(_, found)| found.as_ref().ok()?.end.clone())
}

/// A scan as a question: the table that [`Scan::compute`] makes. It rests on `ScanPart`s, so that
/// one that was stopped goes on where it was. Over one setting a run that fails is an error, since
/// its place in the diagram would be empty; over two it is a row.
#[derive(Clone, Debug)]
pub struct ScanQuestion(Arc<Planned>);

/// A scan with its runs in their order.
#[derive(Debug)]
struct Planned {
    scan: Scan,
    ways: Vec<Way>,
}

/// A way in which a scan goes over its settings: a word, and the rows in their order.
type Way = (Option<&'static str>, Vec<u64>);

/// Some neighbouring runs of a scan.
#[derive(Clone, Debug)]
struct ScanPart {
    plan: Arc<Planned>,
    /// Which of its ways.
    way: usize,
    /// From this run of the way on.
    from: usize,
    /// As many of them.
    size: usize,
}

/// Most parts of a question of many runs: one that is stopped loses at most so much of it for each
/// thread.
pub(crate) const MOST_PARTS: u64 = 32;

/// A column of a part's table, by a name that no state has.
const RUN: &str = "run number";

impl From<Scan> for ScanQuestion {
    fn from(scan: Scan) -> Self {
        let ways = scan.ways();
        Self(Arc::new(Planned { scan, ways }))
    }
}

impl Scan {
    /// Everything that its table depends on.
    fn json(&self) -> Value {
        json!({ "sweep": self.sweep, "follow": self.follow,
            "alike": self.is_map().then_some(self.alike) })
    }

    /// Its settings, for people.
    fn varied(&self) -> String {
        self.axes().iter().map(|axis| axis.coordinate.to_string()).collect::<Vec<_>>().join(", ")
    }
}

impl ScanQuestion {
    fn parts(&self) -> Vec<ScanPart> {
        let runs = self.0.scan.cells();
        let size = usize::try_from(runs.div_ceil(MOST_PARTS)).unwrap_or(usize::MAX).max(1);
        let parts = |(way, (_, rows)): (usize, &Way)| {
            let from = (0..rows.len()).step_by(size);
            from.map(move |from| ScanPart { plan: self.0.clone(), way, from, size })
        };
        self.0.ways.iter().enumerate().flat_map(parts).collect()
    }
}

impl Question for ScanQuestion {
    fn kind(&self) -> &'static str {
        "scan"
    }

    fn json(&self) -> Value {
        self.0.scan.json()
    }

    fn label(&self) -> String {
        format!("scan over {}", self.0.scan.varied())
    }

    fn rests_on(&self) -> Vec<AnyQuestion> {
        self.parts().into_iter().map(|part| Arc::new(part) as _).collect()
    }

    fn compute(&self, executor: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
        let Planned { scan, ways } = &*self.0;
        let mut cells = Vec::new();
        for part in self.parts() {
            let answer = executor.ask(&part)?;
            let (word, _) = ways[part.way];
            cells.extend(part.cells(&answer)?.into_iter().map(|cell| (word, cell)));
        }
        let table = if scan.is_map() { scan.endings(&cells) } else { scan.passages(&cells) };
        Ok(Answer::of_tables(vec![table]))
    }
}

impl ScanPart {
    fn rows(&self) -> &[u64] {
        let (_, rows) = &self.plan.ways[self.way];
        &rows[self.from..(self.from + self.size).min(rows.len())]
    }

    /// The part that ends where this one begins, if attractors are followed.
    fn before(&self) -> Option<Self> {
        let from = self.from.checked_sub(self.size)?;
        self.plan.scan.follow.map(|_| Self { from, ..self.clone() })
    }

    /// Its runs, from its answer.
    fn cells(&self, answer: &Answer) -> Result<Vec<Cell>, JobError> {
        let scan = &self.plan.scan;
        let found = |row: u64, late, landing| {
            let settings = scan.sweep.settings(row);
            (settings.clone(), Ok(Found { settings, late, landing, end: None }))
        };
        if scan.is_map() {
            let landings: Vec<Result<Landing, String>> = answer.fact("landings")?;
            let cell = |(row, landing): (&u64, Result<Landing, String>)| match landing {
                Ok(landing) => found(*row, Vec::new(), Some(landing)),
                Err(why) => (scan.sweep.settings(*row), Err(JobError::Other(why))),
            };
            return Ok(self.rows().iter().zip(landings).map(|pair| Some(cell(pair))).collect());
        }
        let empty = || JobError::Other("a part of the scan has no table".into());
        let table = answer.tables.first().ok_or_else(empty)?;
        let (of, t) = (table.integers(RUN), table.numbers("t"));
        let states: Vec<&[f64]> =
            scan.states().into_iter().map(|name| table.numbers(name)).collect();
        let mut rest = 0..of.len();
        let mut cell = |row: &u64| {
            let count = of[rest.clone()].iter().take_while(|run| **run == *row as i64).count();
            let own = rest.by_ref().take(count);
            let late = own.map(|i| (t[i], states.iter().map(|s| s[i]).collect())).collect();
            Some(found(*row, late, None))
        };
        Ok(self.rows().iter().map(&mut cell).collect())
    }
}

impl Question for ScanPart {
    fn kind(&self) -> &'static str {
        "scan-part"
    }

    fn json(&self) -> Value {
        let scan = self.plan.scan.json();
        json!({ "scan": scan, "way": self.way, "from": self.from, "size": self.size })
    }

    fn label(&self) -> String {
        let way = self.plan.ways[self.way].0.map_or(String::new(), |word| format!(" {word}"));
        let last = self.from + self.rows().len();
        format!("scan over {}{way}, runs {} to {last}", self.plan.scan.varied(), self.from + 1)
    }

    fn extent(&self) -> f64 {
        self.rows().len() as f64
    }

    fn cost(&self) -> f64 {
        self.plan.scan.sweep.t_end() * self.rows().len() as f64
    }

    fn rests_on(&self) -> Vec<AnyQuestion> {
        self.before().into_iter().map(|part| Arc::new(part) as _).collect()
    }

    /// Over one setting the table `late`, a row a crossing, and of attractors that are followed the
    /// fact `end`; over two the fact `landings`.
    fn compute(&self, executor: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        let before = self.before().map(|part| executor.ask(&part)).transpose()?;
        let mut before: Option<End> =
            before.map(|answer| answer.fact("end")).transpose()?.unwrap_or_default();
        let finished = AtomicU64::new(0);
        let asked = Asked { monitor, finished: &finished };
        let states = self.plan.scan.states();
        let columns = [Column::integers(RUN), Column::numbers("t")].into_iter();
        let mut table = Table::new("late", columns.chain(states.into_iter().map(Column::numbers)));
        let mut landings = Vec::new();
        for &row in self.rows() {
            if asked.reached(0.0).is_break() {
                return Err(JobError::Interrupted);
            }
            let cell = self.plan.scan.cell(row, before.as_ref(), &asked);
            before = handed_on(&cell).filter(|_| self.plan.scan.follow.is_some());
            let (_, found) = cell.ok_or(JobError::Interrupted)?;
            finished.fetch_add(1, Ordering::Relaxed);
            if self.plan.scan.is_map() {
                let landing = found.map_err(|error| error.to_string());
                landings.extend(landing.map(|found| found.landing).transpose());
                continue;
            }
            let found = found.map_err(|error| {
                let value = &self.plan.scan.sweep.settings(row)[0];
                let at = match value {
                    Entry::Number(value) => value.to_string(),
                    Entry::Integer(value) => value.to_string(),
                    Entry::Word(word) => word.clone(),
                };
                JobError::Other(format!("{} = {at}: {error}", self.plan.scan.varied()))
            })?;
            for (t, x) in found.late {
                let numbers = [t].into_iter().chain(x).map(Entry::Number);
                table.push([Entry::Integer(row as i64)].into_iter().chain(numbers));
            }
        }
        if self.plan.scan.is_map() {
            return Ok(Answer::of_tables(Vec::new()).with_fact("landings", &landings));
        }
        let answer = Answer::of_tables(vec![table]);
        Ok(if self.plan.scan.follow.is_some() { answer.with_fact("end", &before) } else { answer })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Store, encode};
    use twofold_hybrid::{Definition, Model, Options};

    /// The logistic map once a unit of time; with `fails` a field that has no value beyond r = 3.3.
    fn scan(over: &[&str], follow: Option<Follow>, fails: bool) -> Scan {
        let more = if fails { " + 0*sqrt(3.3 - r)" } else { "" };
        let text = format!(
            "states = ['x']\nstart = [0.3]\nparameters = {{ r = 2.8 }}\nf = \
                ['-x{more}']\n[[event]]\nwhen = 'cos(pi*t)'\nset = {{ x = 'exp(1)*r*x*(1 - x)' }}"
        );
        let model = Model::new(Definition::from_toml(&text, "logistic").unwrap());
        let record = Record::Times { every: 1.0 };
        let run =
            GeneralRun { model, options: Options { t_end: 40.0, record, ..Options::default() } };
        let axes = over.iter().map(|axis| axis.parse().unwrap()).collect();
        Scan::new(Sweep::new(run, axes, None).unwrap(), follow, 0.01).unwrap()
    }

    /// The table of the command, whatever the parts and the ways.
    #[test]
    fn a_scan_as_a_question_has_its_table() {
        let diagram = ["params.r=2.8..3.9:70"];
        let map = ["params.r=2.8,3.2,3.5", "start.x=0.1..0.9:3"];
        for (over, follow, parts) in [
            (&diagram[..], None, 24),
            (&diagram, Some(Follow::Down), 24),
            (&diagram, Some(Follow::Both), 48),
            (&map, None, 9),
        ] {
            let (scan, folder) = (scan(over, follow, false), tempfile::tempdir().unwrap());
            let store = Store::new(folder.path());
            let question: AnyQuestion = Arc::new(ScanQuestion::from(scan.clone()));
            let executor = Executor::new(Some(store.clone()), &());
            executor.gather(std::slice::from_ref(&question));
            let answer = executor.ask(&*question).unwrap();
            let bits = |table: &Table| encode::bits(std::slice::from_ref(table));
            assert_eq!(bits(&answer.tables[0]), bits(&scan.compute(&()).table), "{follow:?}");
            // One that was stopped goes on with the parts that are kept.
            assert_eq!(store.entries().unwrap().len(), parts + 1);
        }
    }

    #[test]
    fn a_run_that_fails_leaves_no_hole_in_a_diagram() {
        let question = ScanQuestion::from(scan(&["params.r=3.2,3.4"], None, true));
        let error = Executor::quiet().ask(&question).unwrap_err().to_string();
        assert!(error.starts_with("params.r = 3.4: "), "{error}");
        let map = scan(&["params.r=3.2,3.4", "start.x=0.2,0.3"], None, true);
        let answer = Executor::quiet().ask(&ScanQuestion::from(map)).unwrap();
        assert_eq!(answer.tables[0].words("ending").filter(|word| *word == "failed").count(), 2);
    }
}
