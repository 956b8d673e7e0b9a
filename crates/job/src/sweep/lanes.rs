//! Rows computed side by side in the lanes of vector registers, with the same bits.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::SVector;

use super::{Ending, OutcomeQuestion, Row, Sweep, far};
use crate::answer::Answer;
use crate::classification::SoFar;
use crate::executor::{Executor, Progress};
use crate::exponent::LargestExponent;
use crate::question::{JobError, Question, question_hash};
use crate::record::Hash;
use crate::recording::{Data, Recording};
use crate::spec::{Method, Observation, RunSpec, SwitchSpec};
use crate::table::Entry;
use twofold_analyse::SectionRecorder;
use twofold_analyse::path::MOST_POINTS;
use twofold_instances::{self as instances, Lanes};
use twofold_integrate::ensemble::{
    Common, End, EnsembleRun, InstructionSet, SectionPlane, Tolerances,
};
use twofold_integrate::{DriveOptions, Monitor, StopReason, Summary};
use twofold_system::{BindError, BoundField, Field, ParameterBatch};

/// Fewer cells than this are computed one after the other.
const FEWEST: usize = 3;

/// So many cells of one equation run by themselves, compiled where that is possible; with fewer,
/// lanes would stay empty that cells of other parameters can have.
const ENOUGH: usize = 32;

/// Number of pending exponents at which they are computed together: enough to fill the lanes twice,
/// few enough that a killed run loses little.
const TOGETHER: usize = 32;

/// States of the systems that run in lanes: compiled once for each number of them, the usual ones.
const STATES: std::ops::RangeInclusive<usize> = 2..=4;

/// A row to be computed.
struct Cell {
    number: u64,
    settings: Vec<Entry>,
    question: OutcomeQuestion,
    key: Hash,
}

impl Cell {
    fn run(&self) -> &RunSpec {
        &self.question.0.run
    }

    /// Section plane of a run that lanes can compute: a smoothed run by Dormand-Prince.
    fn plane(&self) -> Option<SectionPlane> {
        let run = self.run();
        let method = &run.method;
        let plain =
            method.name == Method::Dopri5 && method.precision.is_none() && method.order.is_none();
        match (run.switch, run.observe) {
            (SwitchSpec::Smoothed { .. }, Observation::Section { coordinate, value })
                if plain && STATES.contains(&run.system.dimension()) && run.validate().is_ok() =>
            {
                Some(SectionPlane { coordinate, value })
            }
            _ => None,
        }
    }

    /// Its row.
    fn row(&self, ending: Result<Ending, JobError>) -> Row {
        match ending {
            Ok(ending) => Row::found(self.number, self.settings.clone(), &self.key, ending.outcome),
            Err(error) => {
                Row::failed(self.number, self.settings.clone(), Some(&self.key), error.to_string())
            }
        }
    }

    /// The equation, if it is a smoothed one.
    fn equation(&self) -> Option<Field> {
        let run = self.run();
        match run.switch {
            SwitchSpec::Smoothed { eps, transition } => {
                Some(Field::smoothed(&run.system, transition, eps))
            }
            _ => None,
        }
    }

    fn has_the_equation_of(&self, other: &Self) -> bool {
        let (a, b) = (self.run(), other.run());
        a.system == b.system && a.switch == b.switch
    }

    /// Whether both have one section: what all lanes share besides the operations of their
    /// equations.
    fn is_asked_like(&self, other: &Self) -> bool {
        let (a, b) = (self.run(), other.run());
        a.observe == b.observe && a.method.name == b.method.name
    }
}

/// Cells that share lanes.
struct Group {
    cells: Vec<Cell>,
    /// The first one's.
    equation: Field,
    /// All have that one.
    of_one_equation: bool,
}

impl Group {
    /// Those among `cells` that share lanes, together; cells of one equation that are many share
    /// them with no others.
    fn all(cells: Vec<Cell>) -> Vec<Self> {
        let mut of_one: Vec<Self> = Vec::new();
        for cell in cells {
            let same = |group: &&mut Self| {
                let first = &group.cells[0];
                first.is_asked_like(&cell) && first.has_the_equation_of(&cell)
            };
            match of_one.iter_mut().find(same) {
                Some(group) => group.cells.push(cell),
                None => of_one.extend(cell.equation().map(|equation| Self {
                    cells: vec![cell],
                    equation,
                    of_one_equation: true,
                })),
            }
        }
        let (mut groups, few): (Vec<Self>, Vec<Self>) =
            of_one.into_iter().partition(|g| g.cells.len() >= ENOUGH);
        let apart = groups.len();
        for group in few {
            let batch = |other: &&mut Self| {
                other.cells[0].is_asked_like(&group.cells[0])
                    && other.equation.is_like(&group.equation)
            };
            match groups[apart..].iter_mut().find(batch) {
                Some(other) => {
                    other.cells.extend(group.cells);
                    other.of_one_equation = false;
                }
                None => groups.push(group),
            }
        }
        groups
    }

    /// The cells' equations, in their order.
    fn batch<const N: usize>(&self) -> Result<Option<ParameterBatch<N>>, BindError> {
        let bound: Result<Vec<BoundField<N>>, _> =
            self.cells.iter().filter_map(Cell::equation).map(|e| e.bind()).collect();
        Ok(ParameterBatch::new(bound?))
    }
}

/// Asks both the display and the receiver of the rows whether to go on.
struct Both<'a> {
    display: &'a dyn Monitor,
    enough: &'a AtomicBool,
}

impl Monitor for Both<'_> {
    fn reached(&self, t: f64) -> ControlFlow<()> {
        if self.enough.load(Ordering::Relaxed) {
            ControlFlow::Break(())
        } else {
            self.display.reached(t)
        }
    }
}

/// A finished row, or a finished run whose verdict needs an exponent.
enum Begun {
    Row(Row),
    Waits(Box<Cell>, Answer, Box<LargestExponent>),
}

impl Sweep {
    /// Whether these two rows would share lanes on this machine, so that computing many at once
    /// pays.
    pub fn share_lanes(&self, a: u64, b: u64) -> bool {
        let cells = [a, b]
            .into_iter()
            .filter_map(|number| self.cell(number))
            .filter(|cell| cell.plane().is_some());
        InstructionSet::best() != InstructionSet::Portable
            && Group::all(cells.collect()).iter().any(|group| group.cells.len() == 2)
    }

    fn cell(&self, number: u64) -> Option<Cell> {
        let question = self.question(number).ok()?;
        let key = question_hash(&question);
        Some(Cell { number, settings: self.settings(number), question, key })
    }

    /// Computes the rows of these numbers, and gives each to `take` as it is finished, which says
    /// whether it wants more: the rows that [`Sweep::row`] makes, bit for bit. Those that have the
    /// operations of their equation and the section in common run side by side in the lanes of
    /// vector registers, where the machine has any.
    ///
    /// # Errors
    ///
    /// [`JobError::Interrupted`] if `progress` asked to stop; every other failure is a row.
    pub fn rows_together(
        &self,
        numbers: &[u64],
        progress: &dyn Progress,
        take: &mut dyn FnMut(Row) -> bool,
    ) -> Result<(), JobError> {
        self.rows_together_with(InstructionSet::best(), numbers, progress, take)
    }

    /// [`Sweep::rows_together`] with the instructions `set`.
    ///
    /// # Errors
    ///
    /// As there.
    pub fn rows_together_with(
        &self,
        set: InstructionSet,
        numbers: &[u64],
        progress: &dyn Progress,
        take: &mut dyn FnMut(Row) -> bool,
    ) -> Result<(), JobError> {
        let mut cells = Vec::new();
        let mut single = Vec::new();
        for &number in numbers {
            match self
                .cell(number)
                .filter(|cell| set != InstructionSet::Portable && cell.plane().is_some())
            {
                Some(cell) => cells.push(cell),
                None => single.push(number),
            }
        }
        let enough = AtomicBool::new(false);
        for group in Group::all(cells) {
            let few = group.cells.len() < FEWEST;
            let done = !few && self.group(set, &group, progress, &enough, take)?;
            if enough.load(Ordering::Relaxed) {
                return Ok(());
            }
            if !done {
                single.extend(group.cells.iter().map(|cell| cell.number));
            }
        }
        // One after the other, and their exponents some at a time.
        let (mut cells, mut waiting) = (Vec::new(), Vec::new());
        for number in single {
            match self.begun(set, number, progress)? {
                Begun::Row(row) => {
                    if !take(row) {
                        return Ok(());
                    }
                }
                Begun::Waits(cell, answer, exponent) => {
                    waiting.push(Waiting { cell: cells.len(), answer, exponent });
                    cells.push(*cell);
                }
            }
            if waiting.len() == TOGETHER {
                exponents(set, &cells, std::mem::take(&mut waiting), progress, &enough, take)?;
                cells.clear();
                if enough.load(Ordering::Relaxed) {
                    return Ok(());
                }
            }
        }
        exponents(set, &cells, waiting, progress, &enough, take)
    }

    /// A row that lanes do not compute; without its exponent, if lanes may compute that.
    fn begun(
        &self,
        set: InstructionSet,
        number: u64,
        progress: &dyn Progress,
    ) -> Result<Begun, JobError> {
        let smoothed = |cell: &Cell| matches!(cell.run().switch, SwitchSpec::Smoothed { .. });
        let Some(cell) =
            self.cell(number).filter(|cell| set != InstructionSet::Portable && smoothed(cell))
        else {
            return Ok(Begun::Row(self.row(number, progress)?));
        };
        let executor = Executor::new(None, progress);
        let display = progress.begin(&cell.question.label(), cell.question.extent());
        let judged = cell.question.run(&executor, &*display).and_then(|answer| {
            let so_far = cell.question.so_far(&executor, &answer)?;
            Ok((so_far, answer))
        });
        display.done(if judged.is_ok() { "" } else { "failed" });
        Ok(match judged {
            Ok((SoFar::Awaits(exponent), answer)) => Begun::Waits(Box::new(cell), answer, exponent),
            Ok((SoFar::Judged(outcome), _)) => Begun::Row(cell.row(Ok(outcome))),
            Err(JobError::Interrupted) => return Err(JobError::Interrupted),
            Err(error) => Begun::Row(cell.row(Err(error))),
        })
    }

    /// Says whether lanes could compute them.
    fn group(
        &self,
        set: InstructionSet,
        group: &Group,
        progress: &dyn Progress,
        enough: &AtomicBool,
        take: &mut dyn FnMut(Row) -> bool,
    ) -> Result<bool, JobError> {
        let (cells, run) = (&group.cells[..], group.cells[0].run());
        let SwitchSpec::Smoothed { eps, transition } = run.switch else { return Ok(false) };
        // The compiled equation where there is one: it gives the same bits sooner.
        if group.of_one_equation
            && let Some(equations) = instances::smoothed_in_lanes(&run.system, transition, eps)
        {
            return side_by_side(set, &equations, cells, progress, enough, take);
        }
        macro_rules! of {
            ($n:literal) => {
                match group.batch::<$n>()? {
                    Some(batch) => side_by_side(set, &batch, cells, progress, enough, take),
                    None => Ok(false),
                }
            };
        }
        match run.system.dimension() {
            2 => of!(2),
            3 => of!(3),
            4 => of!(4),
            _ => Ok(false),
        }
    }
}

fn side_by_side<const N: usize>(
    set: InstructionSet,
    equations: &dyn Lanes<N>,
    cells: &[Cell],
    progress: &dyn Progress,
    enough: &AtomicBool,
    take: &mut dyn FnMut(Row) -> bool,
) -> Result<bool, JobError> {
    let first = cells[0].run();
    let plane = cells[0].plane();
    let runs: Vec<EnsembleRun<N>> = cells.iter().map(|cell| options(cell.run())).collect();
    // y and z, as `OutcomeQuestion` looks at them; systems that have such a corner have three
    // states. No state is above infinity.
    let corners: Vec<SVector<f64, N>> = cells
        .iter()
        .map(|cell| match far::corner(cell.run()) {
            Some(c) => SVector::from_fn(|i, _| if i == 0 { f64::NEG_INFINITY } else { c }),
            None => SVector::repeat(f64::INFINITY),
        })
        .collect();
    let corners =
        corners.iter().any(|corner| corner[N - 1] < f64::INFINITY).then_some(&corners[..]);
    let display = progress.begin("cells side by side", first.t_end);
    let monitor = Both { display: &*display, enough };
    let tolerances: Vec<_> = cells.iter().map(|cell| cell.run().method.tolerance).collect();
    let common = Common {
        tolerances: Tolerances::Each(&tolerances),
        plane,
        corners,
        carried: None,
        monitor: &monitor,
    };
    let section = match plane {
        Some(SectionPlane { coordinate, value }) => SectionRecorder::<N>::new(coordinate, value),
        None => SectionRecorder::<N>::new(0, 0.0),
    };
    let mut interrupted = false;
    let mut unfinished = cells.len();
    // Runs whose verdict needs an exponent, which costs many times the run: exponents are computed
    // together too.
    let mut waiting: Vec<Waiting> = Vec::new();
    let computed = equations.sections(set, &runs, common, &section, &mut |i, end| {
        unfinished -= 1;
        if interrupted || enough.load(Ordering::Relaxed) {
            return;
        }
        let question = &cells[i].question;
        // Questions about a run's end go to an executor of its own, as if the row were alone.
        let executor = Executor::new(None, progress);
        let outcome = recorded(end).and_then(|recording| {
            let answer = recording.to_answer(&question.0.run);
            Ok((question.so_far(&executor, &answer)?, answer))
        });
        let outcome = match outcome {
            Ok((SoFar::Judged(outcome), _)) => Ok(outcome),
            Ok((SoFar::Awaits(exponent), answer)) => {
                waiting.push(Waiting { cell: i, answer, exponent });
                return;
            }
            Err(JobError::Interrupted) => {
                interrupted = true;
                return;
            }
            Err(error) => Err(error),
        };
        if !take(cells[i].row(outcome)) {
            enough.store(true, Ordering::Relaxed);
        }
    });
    if !computed {
        display.done("no vector registers here");
        return Ok(false);
    }
    let given_up = unfinished > 0 && !enough.load(Ordering::Relaxed);
    if interrupted || given_up {
        display.done("interrupted");
        return Err(JobError::Interrupted);
    }
    display.done("");
    if enough.load(Ordering::Relaxed) {
        return Ok(true);
    }
    exponents(set, cells, waiting, progress, enough, take)?;
    Ok(true)
}

/// A finished run, and the exponent that its verdict needs.
struct Waiting {
    /// Index of the cell.
    cell: usize,
    answer: Answer,
    exponent: Box<LargestExponent>,
}

/// The rows of runs whose verdict needs an exponent: exponents side by side if there are enough and
/// they share an equation, else one after the other.
fn exponents(
    set: InstructionSet,
    cells: &[Cell],
    waiting: Vec<Waiting>,
    progress: &dyn Progress,
    enough: &AtomicBool,
    take: &mut dyn FnMut(Row) -> bool,
) -> Result<(), JobError> {
    let mut found = None;
    if waiting.len() >= FEWEST {
        let questions: Vec<&LargestExponent> = waiting.iter().map(|w| &*w.exponent).collect();
        let display = progress.begin("exponents side by side", questions[0].extent());
        let monitor = Both { display: &*display, enough };
        let together = LargestExponent::side_by_side(&questions, set, &monitor);
        match &together {
            Err(_) => display.done("interrupted"),
            Ok(_) => display.done(""),
        }
        match together {
            // The receiver wants no more rows.
            Err(_) if enough.load(Ordering::Relaxed) => return Ok(()),
            together => found = together?,
        }
    }
    for (i, Waiting { cell, answer, exponent }) in waiting.into_iter().enumerate() {
        let known = match &found {
            Some(found) => Ok(found[i]),
            None => {
                Executor::new(None, progress).ask(&*exponent).map(|answer| exponent.found(&answer))
            }
        };
        let outcome =
            known.and_then(|exponent| cells[cell].question.with_exponent(&answer, exponent));
        if outcome == Err(JobError::Interrupted) {
            return Err(JobError::Interrupted);
        }
        if !take(cells[cell].row(outcome)) {
            enough.store(true, Ordering::Relaxed);
            return Ok(());
        }
    }
    Ok(())
}

fn options<const N: usize>(run: &RunSpec) -> EnsembleRun<N> {
    let start = SVector::from_fn(|i, _| run.start.get(i).copied().unwrap_or(f64::NAN));
    let options = DriveOptions {
        t_end: run.t_end,
        schedule: run.schedule,
        step_cap: run.method.step_cap,
        max_steps: run.method.max_steps,
        kicked_states: N,
    };
    EnsembleRun { start, options }
}

/// As [`simulate_until`](crate::simulate::simulate_until) has it.
fn recorded<const N: usize>(end: End<SectionRecorder<N>, N>) -> Result<Recording<N>, JobError> {
    let Summary { t, x, statistics, most_steps_in_segment, stop } = end.summary?.within_budget()?;
    let data = Data::Section(end.observer.into_crossings());
    if stop == StopReason::Observer && data.len() >= MOST_POINTS {
        return Err(JobError::TooManyPoints { t, limit: MOST_POINTS });
    }
    Ok(Recording { data, t, x: x.into(), statistics, most_steps_in_segment, stop })
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::super::Axis;
    use super::*;
    use crate::cases;
    use crate::executor::JobMonitor;
    use twofold_system::{Caricature, System};

    /// Counts the groups that are computed in lanes.
    #[derive(Default)]
    struct Groups(Mutex<usize>);

    impl Progress for Groups {
        fn begin<'a>(&'a self, label: &str, _: f64) -> Box<dyn JobMonitor + 'a> {
            *self.0.lock().unwrap() += usize::from(label == "cells side by side");
            Box::new(())
        }
    }

    /// In how many groups the rows of a sweep are computed; they are those computed alone.
    fn groups(system: System, axes: &[&str]) -> usize {
        let observe = Observation::Section { coordinate: 1, value: 0.5 };
        let mut run = cases::run(system, SwitchSpec::tanh(1e-2), 5.0, observe);
        run.method.tolerance.rtol = 1e-6;
        let axes: Vec<Axis> = axes.iter().map(|a| a.parse().unwrap()).collect();
        let sweep = Sweep::new(run, axes, None).unwrap();
        let numbers: Vec<u64> = (0..sweep.rows()).collect();
        let (groups, mut rows) = (Groups::default(), Vec::new());
        let mut take = |row: Row| {
            rows.push(row);
            true
        };
        sweep.rows_together(&numbers, &groups, &mut take).unwrap();
        rows.sort_by_key(Row::number);
        let rows: Vec<String> = rows.iter().map(Row::line).collect();
        let alone: Vec<String> =
            numbers.iter().map(|row| sweep.row(*row, &()).unwrap().line()).collect();
        assert_eq!(rows, alone);
        groups.0.into_inner().unwrap()
    }

    /// Three cells and more share lanes, in systems of two to four states, with files' equations
    /// and compiled ones.
    #[test]
    fn three_cells_share_lanes() {
        if InstructionSet::best() == InstructionSet::Portable {
            return;
        }
        for (n, lanes) in [(2, 1), (3, 1), (4, 1)] {
            assert_eq!(groups(cases::decays(n), &["shift.a2=1e-3*3"]), lanes, "{n} states");
        }
        let caricature = || System::from(Caricature::with_reinjection(0.1, 1e-5));
        assert_eq!(groups(caricature(), &["shift.x=1e-3*3"]), 1);
        assert_eq!(groups(caricature(), &["shift.x=1e-3*2"]), 0);
        assert_eq!(groups(caricature(), &["shift.x=1e-3*4"]), 1);
    }

    /// Both the progress display and the receiver of the rows can stop the computation.
    #[test]
    fn lanes_stop_when_asked_to() {
        struct Never;
        impl Progress for Never {
            fn begin<'a>(&'a self, _: &str, _: f64) -> Box<dyn JobMonitor + 'a> {
                Box::new(Never)
            }
        }
        impl JobMonitor for Never {
            fn done(self: Box<Self>, _: &str) {}
        }
        impl Monitor for Never {
            fn reached(&self, _: f64) -> ControlFlow<()> {
                ControlFlow::Break(())
            }
        }
        let observe = Observation::Section { coordinate: 0, value: 0.5 };
        let turning = cases::smooth(&["x", "v"], "x + 9", &["v", "-x"]);
        let run = cases::run(turning, SwitchSpec::tanh(1e-2), 300.0, observe);
        let sweep = Sweep::new(run, vec!["shift.x=1e-3*5".parse().unwrap()], None).unwrap();
        let mut none = |row: Row| panic!("row {}", row.number());
        assert_eq!(
            sweep.rows_together(&[0, 1, 2, 3, 4], &Never, &mut none),
            Err(JobError::Interrupted)
        );
        let mut taken = 0;
        let mut two = |_: Row| {
            taken += 1;
            taken < 2
        };
        assert_eq!(sweep.rows_together(&[0, 1, 2, 3, 4], &(), &mut two), Ok(()));
        assert_eq!(taken, 2);
    }

    /// Cells that differ in the width alone, in a system that switches: each has an equation of its
    /// own.
    #[test]
    fn widths_of_one_system_are_other_equations() {
        let caricature = System::from(Caricature::with_reinjection(0.1, 1e-5));
        let portable = InstructionSet::best() == InstructionSet::Portable;
        assert_eq!(groups(caricature.clone(), &["eps=1e-1,3e-2,1e-2"]), usize::from(!portable));
        // Of two equations with 32 cells each, both go by themselves.
        let many = groups(caricature, &["eps=1e-1,3e-2", "shift.x=1e-3*32"]);
        assert_eq!(many, if portable { 0 } else { 2 });
    }
}
