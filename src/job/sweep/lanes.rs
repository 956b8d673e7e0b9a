//! Cells side by side in the lanes of vector registers: the same rows, sooner.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::SVector;

use super::{Fate, Row, Sweep, far};
use crate::analyse::SectionRecorder;
use crate::analyse::path::MOST_POINTS;
use crate::integrate::ensemble::{Common, End, InstructionSet, Plane, Run, ensemble_watched};
use crate::integrate::{Course, StopReason, Summary, Watch};
use crate::job::desk::{Desk, Progress};
use crate::job::question::{JobError, question_hash};
use crate::job::recording::{Data, Recording};
use crate::job::spec::{Method, Observation, RunSpec, SwitchSpec};
use crate::job::table::Entry;
use crate::record::Hash;
use crate::system::{Compiled, Field, Smoothed, VectorField};

/// Fewer cells than this are computed one after the other.
const FEWEST: usize = 3;

/// States of the systems that run in lanes: compiled once for each number of them, the usual ones.
const STATES: std::ops::RangeInclusive<usize> = 2..=4;

/// A row to be computed.
struct Cell {
    number: u64,
    settings: Vec<Entry>,
    question: Fate,
    key: Hash,
}

impl Cell {
    fn run(&self) -> &RunSpec {
        &self.question.0.run
    }

    /// What its section is taken at, if lanes compute it: a smoothed run by Dormand-Prince.
    fn plane(&self) -> Option<Plane> {
        let run = self.run();
        let method = &run.method;
        let plain = method.name == Method::Dopri5 && method.precision.is_none() && method.order.is_none();
        match (run.switch, run.observe) {
            (SwitchSpec::Smoothed { .. }, Observation::Section { coordinate, value })
                if plain && STATES.contains(&run.system.dimension()) && run.validate().is_ok() =>
            {
                Some(Plane { coordinate, value })
            }
            _ => None,
        }
    }

    /// Whether both have one equation, tolerance and section: what all lanes share.
    fn is_like(&self, other: &Self) -> bool {
        let (a, b) = (self.run(), other.run());
        a.system == b.system
            && a.switch == b.switch
            && a.observe == b.observe
            && a.method.name == b.method.name
            && a.method.tolerance == b.method.tolerance
    }
}

/// Asks the display, and whoever takes the rows.
struct Both<'a> {
    display: &'a dyn Watch,
    enough: &'a AtomicBool,
}

impl Watch for Both<'_> {
    fn reached(&self, t: f64) -> bool {
        !self.enough.load(Ordering::Relaxed) && self.display.reached(t)
    }
}

impl Sweep {
    /// Whether these two rows would share lanes on this machine: then it pays to ask for many at once.
    pub fn share_lanes(&self, a: u64, b: u64) -> bool {
        let cell = |number| self.cell(number).filter(|cell| cell.plane().is_some());
        InstructionSet::best() != InstructionSet::Portable && cell(a).zip(cell(b)).is_some_and(|(a, b)| a.is_like(&b))
    }

    fn cell(&self, number: u64) -> Option<Cell> {
        let question = self.question(number).ok()?;
        let key = question_hash(&question);
        Some(Cell { number, settings: self.settings(number), question, key })
    }

    /// Computes the rows of these numbers, and gives each to `take` as it is finished, which says whether it wants more: the rows that [`Sweep::row`] makes, bit for bit.
    /// Those that have their equation and tolerance in common run side by side in the lanes of vector registers, where the machine has any.
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
        let mut groups: Vec<Vec<Cell>> = Vec::new();
        let mut single = Vec::new();
        for &number in numbers {
            let cell = self.cell(number).filter(|cell| set != InstructionSet::Portable && cell.plane().is_some());
            let Some(cell) = cell else {
                single.push(number);
                continue;
            };
            match groups.iter_mut().find(|group| group[0].is_like(&cell)) {
                Some(group) => group.push(cell),
                None => groups.push(vec![cell]),
            }
        }
        let enough = AtomicBool::new(false);
        for group in groups {
            let few = group.len() < FEWEST;
            let done = !few && self.group(set, &group, progress, &enough, take)?;
            if enough.load(Ordering::Relaxed) {
                return Ok(());
            }
            if !done {
                single.extend(group.iter().map(|cell| cell.number));
            }
        }
        for number in single {
            if !take(self.row(number, progress)?) {
                return Ok(());
            }
        }
        Ok(())
    }

    /// Cells that are alike. Says whether lanes could compute them.
    fn group(
        &self,
        set: InstructionSet,
        cells: &[Cell],
        progress: &dyn Progress,
        enough: &AtomicBool,
        take: &mut dyn FnMut(Row) -> bool,
    ) -> Result<bool, JobError> {
        let run = cells[0].run();
        let SwitchSpec::Smoothed { eps, transition } = run.switch else { return Ok(false) };
        // The compiled equation where there is one: it gives the same bits sooner.
        if let Some(Compiled::Caricature(system)) = run.system.compiled() {
            let field = Smoothed { system, transition, eps };
            side_by_side(set, &field, cells, progress, enough, take)?;
            return Ok(true);
        }
        let field = Field::smoothed(&run.system, transition, eps);
        match run.system.dimension() {
            2 => side_by_side(set, &field.bind::<2>()?, cells, progress, enough, take)?,
            3 => side_by_side(set, &field.bind::<3>()?, cells, progress, enough, take)?,
            4 => side_by_side(set, &field.bind::<4>()?, cells, progress, enough, take)?,
            _ => return Ok(false),
        }
        Ok(true)
    }
}

fn side_by_side<F: VectorField<N>, const N: usize>(
    set: InstructionSet,
    field: &F,
    cells: &[Cell],
    progress: &dyn Progress,
    enough: &AtomicBool,
    take: &mut dyn FnMut(Row) -> bool,
) -> Result<(), JobError> {
    let first = cells[0].run();
    let plane = cells[0].plane();
    let runs: Vec<Run<N>> = cells.iter().map(|cell| course(cell.run())).collect();
    // y and z, as `Fate` looks at them; systems that have such a corner have three states.
    let corner = far::corner(first).map(|c| SVector::from_fn(|i, _| if i == 0 { f64::NEG_INFINITY } else { c }));
    let display = progress.begin("cells side by side", first.t_end);
    let watch = Both { display: &*display, enough };
    let common = Common { tolerance: first.method.tolerance, plane, corner, watch: &watch };
    let observer = |_| match plane {
        Some(Plane { coordinate, value }) => SectionRecorder::<N>::new(coordinate, value),
        None => SectionRecorder::<N>::new(0, 0.0),
    };
    let mut interrupted = false;
    let mut unfinished = cells.len();
    ensemble_watched(set, field, &runs, common, observer, &mut |i, end| {
        unfinished -= 1;
        if interrupted || enough.load(Ordering::Relaxed) {
            return;
        }
        let Cell { number, settings, question, key } = &cells[i];
        // What is asked of a run's end is asked at a desk of its own, as if the row were alone.
        let desk = Desk::new(None, progress);
        let outcome = recorded(end).and_then(|recording| question.judged(&desk, &recording.to_answer(&question.0.run)));
        let row = match outcome {
            Ok(outcome) => Row::found(*number, settings.clone(), key, outcome),
            Err(JobError::Interrupted) => {
                interrupted = true;
                return;
            }
            Err(error) => Row::failed(*number, settings.clone(), Some(key), error.to_string()),
        };
        if !take(row) {
            enough.store(true, Ordering::Relaxed);
        }
    });
    let given_up = unfinished > 0 && !enough.load(Ordering::Relaxed);
    if interrupted || given_up {
        display.done("interrupted");
        return Err(JobError::Interrupted);
    }
    display.done("");
    Ok(())
}

fn course<const N: usize>(run: &RunSpec) -> Run<N> {
    let start = SVector::from_fn(|i, _| run.start.get(i).copied().unwrap_or(f64::NAN));
    let course = Course {
        t_end: run.t_end,
        schedule: run.schedule,
        step_cap: run.method.step_cap,
        max_steps: run.method.max_steps,
        kicked_states: N,
    };
    Run { start, course }
}

/// As [`simulate_until`](crate::job::simulate::simulate_until) has it.
fn recorded<const N: usize>(end: End<SectionRecorder<N>, N>) -> Result<Recording<N>, JobError> {
    let Summary { t, x, statistics, most_steps_in_segment, stop } = end.summary?.within_budget()?;
    let data = Data::Section(end.observer.into_crossings());
    if stop == StopReason::Observer && data.len() >= MOST_POINTS {
        return Err(JobError::TooManyPoints { t, limit: MOST_POINTS });
    }
    Ok(Recording { data, t, x: x.into(), statistics, most_steps_in_segment, stop })
}
