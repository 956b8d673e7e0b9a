//! Sweeps: one run with some of its numbers varied, and the outcome of each.
//!
//! A [`Sweep`] is a run, the [`Axis`] list over which it varies, and how often random axes are
//! drawn. Its cells are numbered; a cell is a question ([`OutcomeQuestion`]) with a key of its own
//! and becomes a row of a table: its settings, and where it ends. A cell that fails is a row with
//! its reason.
//!
//! Rows depend on nothing but their number: [`Rows`] computed anywhere, in any order and any parts
//! ([`Shard`]), by processes that were killed and resumed, merge to the same bytes. Random axes are
//! drawn and kicks are seeded by the row's number.
//!
//! ```
//! use twofold_job::{Executor, spec::*, sweep::{Rows, Shard, Sweep}};
//! use twofold_system::Caricature;
//! let run = RunSpec {
//!     system: Caricature::with_reinjection(1e-1, 1e-5).into(),
//!     switch: SwitchSpec::tanh(1e-3),
//!     start: vec![0.2, 0.0, -1.0],
//!     t_end: 50.0,
//!     method: MethodSpec::ndsolve_defaults(Method::Dopri5),
//!     schedule: Default::default(),
//!     observe: Observation::Section { coordinate: 1, value: 0.0 },
//! };
//! let axes = vec!["params.alpha=0.1,0.2".parse()?, "interval=20,40".parse()?];
//! let sweep = Sweep::new(run, axes, None)?;
//! let mut rows = [1, 2].map(|k| {
//!     let mut rows = Rows::of(sweep.clone());
//!     for row in (Shard { k, n: 2 }).rows(&sweep) {
//!         rows.insert(sweep.row(row, &())?)?;
//!     }
//!     Ok::<_, Box<dyn std::error::Error>>(rows)
//! });
//! let [first, second] = rows;
//! let mut whole = first?;
//! whole.merge(second?)?;
//! assert_eq!(whole.table().len(), 4);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod axis;
mod far;
mod general;
mod lanes;
mod outcome;
mod question;
mod rows;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

pub use axis::{Axis, AxisError, Coordinate, FORMS, Values};
pub use general::{GeneralEnding, GeneralOutcome};
pub use outcome::{Ending, Outcome, OutcomeQuestion, is_open, is_outcome};
pub use question::SweepQuestion;
pub use rows::{Row, Rows, RowsError, VERSION};

use super::classification::Classification;
use super::executor::{Executor, Progress};
use super::general::{GeneralRun, has_period};
use super::question::{JobError, question_hash};
use super::spec::{RunSpec, SpecError, SwitchSpec};
use super::table::Column;
use super::table::Entry;
use crate::record::Hash;
use twofold_analyse::attractor::Thresholds;
use twofold_hybrid::motion::Record;
use twofold_integrate::filippov::ExitRule;
use twofold_num::random::RandomStream;

/// Maximum number of rows of a sweep.
pub const MOST_ROWS: u64 = 1_000_000_000;

/// Marks the streams from which random axes are drawn, so that they share no numbers with the kicks
/// of runs of the same seed.
const DRAWS: u64 = 0x5377_6565_7000_0000;

/// The run that is varied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Value", into = "Value")]
pub enum Base {
    /// Of a system with h, plus and minus.
    Surfaces(Box<RunSpec>),
    /// Of a general system.
    General(Box<GeneralRun>),
}

impl From<RunSpec> for Base {
    fn from(run: RunSpec) -> Self {
        Base::Surfaces(Box::new(run))
    }
}

impl From<GeneralRun> for Base {
    fn from(run: GeneralRun) -> Self {
        Base::General(Box::new(run))
    }
}

impl From<Base> for Value {
    fn from(base: Base) -> Self {
        match base {
            Base::Surfaces(run) => json!(run),
            Base::General(run) => {
                let mut json = run.json();
                // A start that the file gives may depend on what is varied.
                json["start"] = json!(run.options.start);
                json
            }
        }
    }
}

impl TryFrom<Value> for Base {
    type Error = String;
    fn try_from(json: Value) -> Result<Self, String> {
        // Only general systems see the time.
        match json.get("t_start") {
            Some(_) => GeneralRun::from_json(json).map(Base::from),
            None => {
                serde_json::from_value::<RunSpec>(json).map(Base::from).map_err(|e| e.to_string())
            }
        }
    }
}

impl Base {
    /// The states' names.
    pub fn states(&self) -> Vec<&str> {
        match self {
            Base::Surfaces(run) => run.system.coordinates(),
            Base::General(run) => run.model.coordinates(),
        }
    }

    /// Start of runs, if it is given; otherwise empty.
    pub fn start(&self) -> Vec<f64> {
        match self {
            Base::Surfaces(run) => run.start.clone(),
            Base::General(run) => general::start_of(run).unwrap_or_default(),
        }
    }

    /// Refuses a run that is looked at after a time that is no period of its equations at the end.
    fn has_period(&self) -> Result<(), String> {
        let Base::General(run) = self else { return Ok(()) };
        let GeneralRun { model, options } = &**run;
        match options.record {
            Record::Times { every } if every.is_finite() => {
                let from = (options.t_end - 2.0 * every).max(options.t_start);
                has_period(model, options, every, from).map_err(|e| e.to_string())
            }
            _ => Ok(()),
        }
    }

    fn apply(&mut self, coordinate: &Coordinate, value: &Entry) -> Result<(), String> {
        match self {
            Base::Surfaces(run) => coordinate.apply(run, value),
            Base::General(run) => coordinate.apply_to_general(run, value),
        }
    }
}

/// A run with some of its numbers varied.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// The run that all cells vary.
    run: Base,
    /// Varied axes. The last listed axis runs fastest; draws run slowest.
    over: Vec<Axis>,
    /// Draws of random axes in each cell of the grid.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    random: Option<Draws>,
    /// The limits by which runs are judged.
    thresholds: Thresholds,
}

/// Draws of random axes: their number and their seed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Draws {
    /// Draws for each cell of the grid.
    pub count: u64,
    /// Seed of the generator (ChaCha8); the stream is the row's number.
    pub seed: u64,
}

/// A sweep that cannot be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SweepError {
    /// An axis is wrong in itself.
    #[error(transparent)]
    Axis(#[from] AxisError),
    /// An axis would have no effect on this run.
    #[error("{axis} has no effect here: {why}")]
    NoEffect {
        /// The coordinate.
        axis: String,
        /// Why not.
        why: String,
    },
    /// Two axes give the same number.
    #[error("{0} and {1} both give the same number; leave one of them out")]
    Twice(String, String),
    /// Draws without a random axis, or a random axis without draws.
    #[error("{0}")]
    Draws(&'static str),
    /// More rows than are counted.
    #[error("that is {0} rows; give at most {MOST_ROWS}")]
    TooMany(u128),
    /// The run that is varied is wrong.
    #[error(transparent)]
    Spec(#[from] SpecError),
    /// The run is looked at after a time that is no period of its equations.
    #[error("{0}")]
    Period(String),
}

/// A part of a sweep's rows: every `n`th, counted from the `k`th.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of the part, from 1.
    pub k: u64,
    /// Number of parts.
    pub n: u64,
}

impl Shard {
    /// The whole.
    pub const WHOLE: Shard = Shard { k: 1, n: 1 };

    /// The numbers of its rows.
    pub fn rows(self, sweep: &Sweep) -> impl Iterator<Item = u64> + use<> {
        let step = usize::try_from(self.n.max(1)).unwrap_or(usize::MAX);
        (self.k.saturating_sub(1)..sweep.rows()).step_by(step)
    }

    /// Number of its rows.
    pub fn count(self, sweep: &Sweep) -> u64 {
        sweep.rows().saturating_sub(self.k.saturating_sub(1)).div_ceil(self.n.max(1))
    }

    /// Whether a row is one of them.
    pub fn has(self, row: u64) -> bool {
        row % self.n.max(1) == self.k.saturating_sub(1)
    }
}

impl std::str::FromStr for Shard {
    type Err = String;
    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').map(|(k, n)| (k.trim().parse(), n.trim().parse()));
        match parts {
            Some((Ok(k), Ok(n))) if (1..=n).contains(&k) => Ok(Shard { k, n }),
            _ => {
                Err(format!("\"{text}\" is not a shard; give K/N with K from 1 to N, such as 2/8"))
            }
        }
    }
}

/// The settings of a row, axis by axis, the last axis running fastest; random axes by a draw from
/// [0, 1) each.
pub(crate) fn grid(over: &[Axis], row: u64, draws: &[f64]) -> Vec<Entry> {
    let mut rest = row % over.iter().map(Axis::count).product::<u64>();
    let one = |(axis, u): (&Axis, &f64)| {
        let i = rest % axis.count();
        rest /= axis.count();
        axis.value(i, *u)
    };
    let mut settings: Vec<Entry> = over.iter().zip(draws).rev().map(one).collect();
    settings.reverse();
    settings
}

impl Sweep {
    /// The sweep of `run` over these axes.
    ///
    /// # Errors
    ///
    /// If an axis would have no effect or gives what another gives, if random axes and draws do not
    /// come together, there are too many rows, or runs are looked at after a time that is no period
    /// of the first one's equations. A cell whose numbers are wrong is no error here but a row.
    pub fn new(
        run: impl Into<Base>,
        over: Vec<Axis>,
        random: Option<Draws>,
    ) -> Result<Self, SweepError> {
        let run = run.into();
        if let Base::Surfaces(run) = &run {
            run.validate()?;
        }
        let mut first = run.clone();
        for (i, axis) in over.iter().enumerate() {
            axis.validate()?;
            for other in &over[..i] {
                use Coordinate::{Atol, Rtol, Tolerance};
                let pair = (&axis.coordinate, &other.coordinate);
                if pair.0 == pair.1
                    || matches!(pair, (Tolerance, Rtol | Atol) | (Rtol | Atol, Tolerance))
                {
                    return Err(SweepError::Twice(
                        other.coordinate.to_string(),
                        axis.coordinate.to_string(),
                    ));
                }
            }
            let mut tried = run.clone();
            tried
                .apply(&axis.coordinate, &axis.value(0, 0.5))
                .map_err(|why| SweepError::NoEffect { axis: axis.coordinate.to_string(), why })?;
            // Numbers that are wrong together are a row.
            let _ = first.apply(&axis.coordinate, &axis.value(0, 0.5));
        }
        first.has_period().map_err(SweepError::Period)?;
        match (over.iter().any(Axis::is_random), random) {
            (true, None) => {
                return Err(SweepError::Draws(
                    "an axis FROM..TO is drawn at random: say how often, or give FROM..TO:COUNT",
                ));
            }
            (false, Some(_)) => {
                return Err(SweepError::Draws("no axis is drawn at random: give one as FROM..TO"));
            }
            (true, Some(Draws { count: 0, .. })) => {
                return Err(SweepError::Draws("give one draw or more"));
            }
            _ => {}
        }
        let sweep = Self { run, over, random, thresholds: Thresholds::default() };
        let rows: u128 =
            sweep.over.iter().fold(u128::from(random.map_or(1, |r| r.count)), |n, axis| {
                n.saturating_mul(u128::from(axis.count()))
            });
        if rows > u128::from(MOST_ROWS) { Err(SweepError::TooMany(rows)) } else { Ok(sweep) }
    }

    /// The run that is varied.
    pub fn run(&self) -> &Base {
        &self.run
    }

    /// When the run ends that is varied.
    pub fn t_end(&self) -> f64 {
        match &self.run {
            Base::Surfaces(run) => run.t_end,
            Base::General(run) => run.options.t_end,
        }
    }

    /// Varied axes.
    pub fn axes(&self) -> &[Axis] {
        &self.over
    }

    /// Draws of random axes, if there are any.
    pub fn draws(&self) -> Option<Draws> {
        self.random
    }

    /// The same with another number of draws. They run slowest: the rows of the smaller sweep are
    /// the first rows of the larger one, with the same numbers and contents. `None` without random
    /// axes.
    pub fn with_draws(&self, count: u64) -> Option<Self> {
        let random = Some(Draws { count, ..self.random? });
        Some(Self { random, ..self.clone() })
    }

    /// Number of rows.
    pub fn rows(&self) -> u64 {
        self.cells() * self.random.map_or(1, |r| r.count)
    }

    /// Cells of the grid.
    fn cells(&self) -> u64 {
        self.over.iter().map(Axis::count).product()
    }

    /// The digest of what is asked: the same for every machine that computes a part.
    pub fn hash(&self) -> Hash {
        Hash::of_json(self)
    }

    /// The settings of a row, axis by axis.
    pub fn settings(&self, row: u64) -> Vec<Entry> {
        let mut random = RandomStream::new(self.random.map_or(0, |r| r.seed) ^ DRAWS, row);
        // Drawn in the order of the axes, whatever the grid.
        let draws: Vec<f64> = self
            .over
            .iter()
            .map(|axis| if axis.is_random() { random.uniform() } else { 0.0 })
            .collect();
        grid(&self.over, row, &draws)
    }

    /// The run of a row.
    ///
    /// # Errors
    ///
    /// Why its settings make none.
    pub fn run_of(&self, row: u64) -> Result<Base, String> {
        let mut base = self.run.clone();
        let varied = |c: &Coordinate| self.over.iter().any(|axis| axis.coordinate == *c);
        if let Base::Surfaces(run) = &mut base
            && !varied(&Coordinate::Stream)
        {
            // Chance of its own in every row: the same kicks from neighbouring starts would not be
            // independent runs.
            if let Some(kick) = &mut run.schedule.kick {
                kick.stream = kick.stream.wrapping_add(row);
            }
            if let SwitchSpec::Filippov { exit: ExitRule::Random { stream, .. }, .. } =
                &mut run.switch
            {
                *stream = stream.wrapping_add(row);
            }
        }
        let settings = self.settings(row);
        // A shift is added to a start, so it comes after it.
        let is_shift = |axis: &&(&Axis, Entry)| matches!(axis.0.coordinate, Coordinate::Shift(_));
        let pairs: Vec<(&Axis, Entry)> = self.over.iter().zip(settings).collect();
        for (axis, value) in
            pairs.iter().filter(|p| !is_shift(p)).chain(pairs.iter().filter(is_shift))
        {
            base.apply(&axis.coordinate, value)?;
        }
        base.has_period()?;
        Ok(base)
    }

    /// The question of a row of a system with h, plus and minus.
    ///
    /// # Errors
    ///
    /// Why its settings make none.
    pub fn question(&self, row: u64) -> Result<OutcomeQuestion, String> {
        match self.run_of(row)? {
            Base::Surfaces(run) => {
                Ok(OutcomeQuestion(Classification { run: *run, thresholds: self.thresholds }))
            }
            Base::General(_) => Err("the sweep is of a general system".into()),
        }
    }

    /// The digest of a row's question, if its settings make one.
    fn key(&self, row: u64) -> Option<Hash> {
        match self.run_of(row).ok()? {
            Base::Surfaces(_) => self.question(row).ok().map(|question| question_hash(&question)),
            Base::General(run) => Some(question_hash(&GeneralOutcome(*run))),
        }
    }

    /// Columns between those of the settings and those that every sweep has.
    fn own_columns(&self) -> Vec<Column> {
        match &self.run {
            Base::Surfaces(_) => Vec::new(),
            Base::General(run) => general::columns(run),
        }
    }

    /// Computes a row.
    ///
    /// # Errors
    ///
    /// [`JobError::Interrupted`] if `progress` asked to stop; every other failure is a row.
    pub fn row(&self, row: u64, progress: &dyn Progress) -> Result<Row, JobError> {
        let mut cells = self.settings(row);
        // An executor of its own: what it has computed is forgotten with it, however many rows
        // there are.
        let executor = Executor::new(None, progress);
        let key = self.key(row);
        let found = match self.run_of(row) {
            Err(reason) => Err(JobError::Other(reason)),
            Ok(Base::General(run)) => executor
                .ask(&GeneralOutcome(*run))
                .and_then(|answer| Ok(answer.fact::<GeneralEnding>("ending")?))
                .map(|ending| {
                    cells.extend(ending.cells());
                    ending.outcome
                }),
            Ok(Base::Surfaces(run)) => executor
                .ask(&OutcomeQuestion(Classification { run: *run, thresholds: self.thresholds }))
                .and_then(|answer| Ok(answer.fact::<Outcome>("outcome")?)),
        };
        match (found, key) {
            (Ok(outcome), Some(key)) => Ok(Row::found(row, cells, &key, outcome)),
            (Err(JobError::Interrupted), _) => Err(JobError::Interrupted),
            (found, key) => {
                if let Base::General(run) = &self.run {
                    cells.extend(general::blank(run));
                }
                let reason = found.err().map_or(String::new(), |error| error.to_string());
                Ok(Row::failed(row, cells, key.as_ref(), reason))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::*;
    use proptest::prelude::*;
    use twofold_hybrid::{Definition, Model, Options};
    use twofold_integrate::{Kick, KickLaw, Schedule};
    use twofold_system::Caricature;

    fn run() -> RunSpec {
        RunSpec {
            system: Caricature::with_reinjection(1e-1, 1e-5).into(),
            switch: SwitchSpec::tanh(1e-3),
            start: vec![0.2, 0.0, -1.0],
            t_end: 60.0,
            method: MethodSpec::ndsolve_defaults(Method::Dopri5),
            schedule: Schedule::default(),
            observe: Observation::Section { coordinate: 1, value: 0.0 },
        }
    }

    fn axes(texts: &[&str]) -> Vec<Axis> {
        texts.iter().map(|t| t.parse().unwrap()).collect()
    }

    /// Runs are looked at after a time that is a period of their equations, each of its own.
    #[test]
    fn a_period_is_one_of_the_equations() {
        let sweep = |every: f64, axis: &str| {
            let text = "states = ['x']\nstart = [1]\nf = ['-a*x + cos(2*pi*t/p)']\n\
                [parameters]\na = 1\np = 1\n[[event]]\nat = 0.5\nset = { x = '2' }";
            let model = Model::new(Definition::from_toml(text, "f").unwrap());
            let record = Record::Times { every };
            let options = Options { t_end: 20.0, record, ..Options::default() };
            Sweep::new(GeneralRun { model, options }, axes(&[axis]), None)
        };
        let said = sweep(0.7, "params.a=1,2").unwrap_err().to_string();
        assert!(said.contains("is not the same 0.7 later"), "{said}");
        let of_rows = |sweep: Sweep| [0, 1].map(|row| sweep.run_of(row).is_ok());
        assert_eq!(of_rows(sweep(2.0, "params.a=1,2").unwrap()), [true; 2]);
        assert_eq!(of_rows(sweep(1.0, "params.p=1,2").unwrap()), [true, false]);
        assert_eq!(of_rows(sweep(2.0, "params.p=1,2").unwrap()), [true; 2]);
    }

    #[test]
    fn the_last_axis_runs_fastest_and_draws_slowest() {
        let over = axes(&["interval=20,40", "shift.x=-1..1", "method=lsoda,dopri5,taylor"]);
        let sweep = Sweep::new(run(), over, Some(Draws { count: 5, seed: 1 })).unwrap();
        assert_eq!(sweep.rows(), 30);
        let settings: Vec<_> = (0..30).map(|row| sweep.settings(row)).collect();
        assert_eq!((&settings[7][0], &settings[7][2]), (&20.0.into(), &"dopri5".into()));
        assert_eq!((&settings[4][0], &settings[4][2]), (&40.0.into(), &"dopri5".into()));
        let mut shifts: Vec<f64> = settings.iter().map(|s| s[1].value()).collect();
        shifts.sort_by(f64::total_cmp);
        shifts.dedup();
        assert_eq!(shifts.len(), 30, "every row has a draw of its own");
        // Frozen: a row's draw is a function of seed and number alone.
        assert_eq!(sweep.settings(3)[1], sweep.settings(3)[1]);
        assert_ne!(
            sweep.settings(3)[1],
            Entry::Number(RandomStream::new(1, 3).uniform_in(-1.0, 1.0))
        );
    }

    #[test]
    fn a_seed_and_a_number_make_a_draw() {
        let sweep = |count, seed| {
            Sweep::new(
                run(),
                axes(&["shift.x=-1..1", "eps=1e-2,1e-3"]),
                Some(Draws { count, seed }),
            )
        };
        let draw = |seed, row| sweep(3, seed).unwrap().settings(row)[0].value();
        let mut draws: Vec<f64> = (0..4)
            .flat_map(|seed| (0..6).map(move |row| (seed, row)))
            .map(|(s, r)| draw(s, r))
            .collect();
        draws.sort_by(f64::total_cmp);
        draws.dedup();
        assert_eq!(draws.len(), 24, "every seed's rows have draws of their own");
        // Whatever bits it has.
        assert!((0..64).all(|bit| draw(1 << bit, 0) != draw(0, 0)));
        // More draws are more rows behind the ones that were there.
        let (three, five) = (sweep(3, 1).unwrap(), sweep(5, 1).unwrap());
        assert_eq!((three.with_draws(5).as_ref(), three.rows(), five.rows()), (Some(&five), 6, 10));
        assert!((0..6).all(|row| three.settings(row) == five.settings(row)));
        assert_eq!(Sweep::new(run(), axes(&["eps=1e-2"]), None).unwrap().with_draws(5), None);
        assert_eq!(
            (three.axes(), three.draws()),
            (&axes(&["shift.x=-1..1", "eps=1e-2,1e-3"])[..], Some(Draws { count: 3, seed: 1 }))
        );
        assert!(sweep(0, 1).unwrap_err().to_string().contains("one draw or more"));
        assert!(sweep(MOST_ROWS / 2, 1).is_ok() && sweep(MOST_ROWS / 2 + 1, 1).is_err());
    }

    #[test]
    fn shards_are_named_from_one_on() {
        for (text, k, n) in [("1/1", 1, 1), ("2/8", 2, 8), (" 8 / 8 ", 8, 8)] {
            assert_eq!(text.parse(), Ok(Shard { k, n }));
        }
        for text in ["0/3", "4/3", "1/0", "1", "/3", "1/", "a/b", "-1/3"] {
            let error = text.parse::<Shard>().unwrap_err();
            assert!(error.contains("K from 1 to N"), "{text}: {error}");
        }
    }

    /// A shift is added to the start that another axis gives, whichever comes first.
    #[test]
    fn shifts_come_after_starts() {
        for texts in [["shift.x=0.5", "start.x=2"], ["start.x=2", "shift.x=0.5"]] {
            let sweep = Sweep::new(run(), axes(&texts), None).unwrap();
            assert_eq!(sweep.question(0).unwrap().0.run.start, [2.5, 0.0, -1.0]);
        }
    }

    #[test]
    fn what_has_no_effect_is_refused() {
        for (texts, word) in [
            (vec!["seed=1,2"], "random"),
            (vec!["kick-size=1,2"], "no kicks"),
            (vec!["eps-prime=1"], "hysteretic"),
            (vec!["params.gamma=1"], "gamma"),
            (vec!["start.q=1"], "no state q"),
            (vec!["rtol=1e-6", "rtol=1e-7"], "both"),
            (vec!["tolerance=1e-6", "rtol=1e-7"], "both"),
            (vec!["shift.x=0..1"], "how often"),
        ] {
            let error = Sweep::new(run(), axes(&texts), None).unwrap_err().to_string();
            assert!(error.contains(word), "{texts:?}: {error}");
        }
        let error =
            Sweep::new(run(), axes(&["rtol=1e-6"]), Some(Draws { count: 2, seed: 0 })).unwrap_err();
        assert!(error.to_string().contains("no axis"), "{error}");
        let many = axes(&["seed=0..99999999", "stream=0..99999999"]);
        let kick = Some(Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 0, stream: 0 });
        let kicked = RunSpec { schedule: Schedule { restart_every: None, kick }, ..run() };
        assert!(matches!(Sweep::new(kicked, many, None), Err(SweepError::TooMany(_))));
    }

    #[test]
    fn every_row_of_a_kicked_run_has_kicks_of_its_own() {
        let kick = Some(Kick { every: 0.3, size: 1e-3, law: KickLaw::Sphere, seed: 9, stream: 5 });
        let kicked = RunSpec { schedule: Schedule { restart_every: None, kick }, ..run() };
        let stream =
            |sweep: &Sweep, row| sweep.question(row).unwrap().0.run.schedule.kick.unwrap().stream;
        let sweep = Sweep::new(kicked.clone(), axes(&["shift.x=1e-9*4"]), None).unwrap();
        assert_eq!([0, 1, 3].map(|row| stream(&sweep, row)), [5, 6, 8]);
        let sweep = Sweep::new(kicked, axes(&["stream=3,3"]), None).unwrap();
        assert_eq!([0, 1].map(|row| stream(&sweep, row)), [3, 3]);
        assert!(sweep.row(0, &()).unwrap().outcome().starts_with("noisy"));
    }

    #[test]
    fn random_exits_are_judged_as_noise() {
        let exit = ExitRule::Random {
            law: twofold_integrate::filippov::SlidingLaw::Exponential { mean: 0.5 },
            plus_probability: 0.5,
            seed: 1,
            stream: 0,
        };
        let run =
            RunSpec { switch: SwitchSpec::Filippov { exit, funnel: None }, t_end: 300.0, ..run() };
        let sweep = Sweep::new(run, axes(&["shift.x=1e-9*2"]), None).unwrap();
        let rows = [0, 1].map(|row| sweep.row(row, &()).unwrap());
        assert!(rows.iter().all(|r| r.outcome().starts_with("noisy")), "{rows:?}");
        assert_ne!(rows[0].key(), rows[1].key());
    }

    #[test]
    fn a_far_run_is_named_and_costs_little() {
        let far = RunSpec { start: vec![0.5, 3.0, 3.0], t_end: 2e5, ..run() };
        let row = Sweep::new(far, Vec::new(), None).unwrap().row(0, &()).unwrap();
        assert_eq!(row.outcome(), "far");
        assert!(row.line().contains("\"far\""));
    }

    #[test]
    fn a_failing_cell_is_a_row_with_its_reason() {
        let sweep = Sweep::new(run(), axes(&["eps=1e-3,-1"]), None).unwrap();
        assert_eq!(sweep.row(1, &()).unwrap().outcome(), "failed");
        let mut rows = Rows::of(sweep.clone());
        rows.insert(sweep.row(1, &()).unwrap()).unwrap();
        assert!(rows.table().words("reason").next().unwrap().contains("above zero"));
    }

    #[test]
    fn an_outcome_that_is_not_far_is_the_classification() {
        let run = RunSpec { t_end: 400.0, ..run() };
        let outcome: Outcome = Executor::quiet()
            .ask(&OutcomeQuestion(Classification::of(run.clone())))
            .unwrap()
            .fact("outcome")
            .unwrap();
        let evidence = Classification::of(run).ask(&Executor::quiet()).unwrap();
        assert_eq!(outcome.crossings, evidence.crossings as u64);
        assert_eq!(outcome.exponent, evidence.lyapunov.map(|l| l.value));
        assert_eq!(outcome.captured_at, evidence.verdict.cycle().map(|c| c.captured_at));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(48))]

        /// Whatever the parts, their order, how they were cut short and how often a row was
        /// computed: the same bytes.
        #[test]
        fn merging_gives_the_same_bytes_however_the_rows_came(
            owners in prop::collection::vec(0_usize..4, 12),
            again in prop::collection::vec(0_usize..12, 0..5),
            order in Just([0_usize, 1, 2, 3]).prop_shuffle(),
            nested in any::<bool>(),
            kinds in prop::collection::vec(0_usize..3, 4),
        ) {
            let sweep = Sweep::new(
                RunSpec { t_end: 3.0, ..run() },
                axes(&["params.alpha=0.1,0.2", "eps=1e-2,-1,1e-3"]),
                None,
            ).unwrap();
            let sweep = Sweep { random: Some(Draws { count: 2, seed: 3 }), over: [sweep.over,
                axes(&["shift.x=0..1e-9"])].concat(), ..sweep };
            let row = |i: usize| sweep.row(i as u64, &()).unwrap();
            let mut whole = Rows::of(sweep.clone());
            let mut parts: Vec<Rows> = (0..4).map(|_| Rows::of(sweep.clone())).collect();
            for (i, owner) in owners.iter().enumerate() {
                whole.insert(row(i)).unwrap();
                parts[*owner].insert(row(i)).unwrap();
            }
            for i in again {
                parts[(i + 1) % 4].insert(row(i)).unwrap();
            }
            // A part goes through a file, a journal or CSV, or stays in memory.
            let mut parts: Vec<Option<Rows>> = parts.into_iter().zip(&kinds).map(|(part,
                kind)| Some(match kind {
                0 => Rows::from_journal(&part.journal()).unwrap(),
                1 => Rows::from_csv(&part.csv()).unwrap(),
                _ => part,
            })).collect();
            let mut take = |i: usize| parts[order[i]].take().unwrap();
            let (mut a, mut b, c, d) = (take(0), take(1), take(2), take(3));
            if nested {
                b.merge(c).unwrap();
                a.merge(b).unwrap();
                a.merge(d).unwrap();
            } else {
                a.merge(b).unwrap();
                let mut c = c;
                c.merge(d).unwrap();
                a.merge(c).unwrap();
            }
            prop_assert_eq!(a.csv(), whole.csv());
        }
    }
}
