//! The recording of a run, as typed data and as an [`Answer`]'s tables.
//!
//! | observation | table | columns |
//! |---|---|---|
//! | path | `path` | t, state |
//! | section | `section` | t, state, direction |
//! | Filippov motion | `motion`, `events` | t, state, mode, piece; t, state and what happened |
//! | the same of a system with two switching surfaces | `motion`, `events` | the same with the signs of both functions |
//! | funnel | `motion`, `events` | the same with the number of the future (0 is the approach), its exit time and side |

use nalgebra::SVector;

use super::answer::{Answer, NoSuchFact, Stop};
use super::question::JobError;
use super::spec::switching;
use super::spec::{RunSpec, SwitchSpec};
use super::table::{Cells, Column, Entry, Table};
use crate::record::hash::canonical_json;
use twofold_analyse::{Crossing, Direction, Motion, Sample};
use twofold_integrate::filippov::{EventKind, ExitRule, INTERSECTION, Mode, ModeEvent, Side};
use twofold_integrate::{Statistics, StopReason};
use twofold_num::tape::Program;

/// The recording of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording<const D: usize = 3> {
    /// The recorded points.
    pub data: Data<D>,
    /// Final time.
    pub t: f64,
    /// Final state; the hysteretic phi is not part of it.
    pub x: [f64; D],
    /// Work done.
    pub statistics: Statistics,
    /// The largest number of steps between restarts; NDSolve's default limit is 10,000.
    pub most_steps_in_segment: u64,
    /// Why it ended.
    pub stop: StopReason,
}

/// Recorded points.
#[derive(Clone, Debug, PartialEq)]
pub enum Data<const D: usize = 3> {
    /// A path.
    Path(Vec<Sample<D>>),
    /// A Poincare section.
    Section(Vec<Crossing<D>>),
    /// A Filippov motion: pieces by mode, and events.
    Motion(Motion<D>),
    /// The approach to a set-valued point and its futures.
    Funnel {
        /// The motion up to there.
        approach: Motion<D>,
        /// The futures, by exit time, plus before minus.
        futures: Vec<Future<D>>,
    },
}

/// One future of a set-valued point.
#[derive(Clone, Debug, PartialEq)]
pub struct Future<const D: usize = 3> {
    /// Time of repelling sliding asked for.
    pub exit_time: f64,
    /// The side left to.
    pub side: Side,
    /// The motion from the set-valued point on.
    pub motion: Motion<D>,
}

impl<const D: usize> Data<D> {
    /// Number of recorded points.
    pub fn len(&self) -> usize {
        match self {
            Data::Path(samples) => samples.len(),
            Data::Section(crossings) => crossings.len(),
            Data::Motion(motion) => motion.len(),
            Data::Funnel { approach, futures } => {
                approach.len() + futures.iter().map(|f| f.motion.len()).sum::<usize>()
            }
        }
    }

    /// Whether nothing was recorded.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Unit of every column of a state or a time: the systems here are dimensionless.
const PURE: &str = "1";

impl<const D: usize> Recording<D> {
    /// The recording, unless it was interrupted.
    ///
    /// # Errors
    ///
    /// [`JobError::Interrupted`].
    pub fn whole(self) -> Result<Self, JobError> {
        if self.stop == StopReason::Cancelled { Err(JobError::Interrupted) } else { Ok(self) }
    }

    /// The recording as an answer.
    pub fn to_answer(&self, run: &RunSpec) -> Answer {
        let names = run.system.coordinates();
        let tables = match &self.data {
            Data::Path(samples) => vec![path_table(&names, samples)],
            Data::Section(crossings) => vec![section_table(&names, crossings)],
            Data::Motion(motion) => motion_tables(&names, &[Member { motion, future: None }], 0),
            Data::Funnel { approach, futures } => {
                let mut members = vec![Member { motion: approach, future: None }];
                members.extend(
                    futures
                        .iter()
                        .map(|f| Member { motion: &f.motion, future: Some((f.exit_time, f.side)) }),
                );
                motion_tables(&names, &members, 0)
            }
        };
        let tables = tables.into_iter().map(|table| signed(run, table)).collect();
        let answer = Answer {
            statistics: Some(self.statistics.clone()),
            stop: self.stop.into(),
            ..Answer::of_tables(tables)
        }
        .with_fact("t", &self.t)
        .with_fact("state", &self.x.as_slice())
        .with_fact("most_steps_in_segment", &self.most_steps_in_segment);
        match run.switch {
            SwitchSpec::Delayed { history, .. } => answer.with_fact("history", &history),
            SwitchSpec::Relay { band, inside } => {
                let plus = inside.begins_with_plus(switching(&run.system, &run.start), band);
                answer
                    .with_fact("inside", &inside)
                    .with_fact("begins", if plus { &Side::Plus } else { &Side::Minus })
            }
            _ => answer,
        }
    }

    /// The table of points that [`Recording::to_answer`] begins with, of a part of a recording.
    /// Pieces of a motion are counted from `first_piece` on. A funnel has no parts.
    pub(super) fn part(run: &RunSpec, data: &Data<D>, first_piece: usize) -> Option<Table> {
        let names = run.system.coordinates();
        let table = match data {
            Data::Path(samples) => Some(path_table(&names, samples)),
            Data::Section(crossings) => Some(section_table(&names, crossings)),
            Data::Motion(motion) => {
                motion_tables(&names, &[Member { motion, future: None }], first_piece)
                    .into_iter()
                    .next()
            }
            Data::Funnel { .. } => None,
        };
        table.map(|table| signed(run, table))
    }

    /// The recording that an answer to `run` holds.
    ///
    /// # Errors
    ///
    /// If the answer is not one to a run like this.
    pub fn of_answer(run: &RunSpec, answer: &Answer) -> Result<Self, NoSuchFact> {
        let names = run.system.coordinates();
        let data = if let Some(table) = answer.table("path") {
            Data::Path(samples(&names, table))
        } else if let Some(table) = answer.table("section") {
            let directions = table
                .words("direction")
                .map(|w| if w == "up" { Direction::Up } else { Direction::Down });
            let points = samples(&names, table).into_iter().zip(directions);
            Data::Section(
                points.map(|(s, direction)| Crossing { t: s.t, x: s.x, direction }).collect(),
            )
        } else if let (Some(motion), Some(events)) =
            (answer.table("motion"), answer.table("events"))
        {
            let mut members = members_of(&names, motion, events)?;
            let approach = members.remove(0).1;
            // A funnel may be empty, a motion never has futures: the question says which it is.
            match run.switch {
                SwitchSpec::Filippov { funnel: Some(_), .. } => Data::Funnel {
                    approach,
                    futures: members
                        .into_iter()
                        .filter_map(|(future, motion)| {
                            future.map(|(exit_time, side)| Future { exit_time, side, motion })
                        })
                        .collect(),
                },
                _ => Data::Motion(approach),
            }
        } else {
            let known: Vec<&str> = answer.tables.iter().map(|t| t.name.as_str()).collect();
            let why = format!("there is no table of points among {}", known.join(", "));
            return Err(NoSuchFact { name: "path".into(), why });
        };
        Ok(Self {
            data,
            t: answer.fact("t")?,
            x: answer.fact::<Vec<f64>>("state")?.try_into().map_err(|x: Vec<f64>| NoSuchFact {
                name: "state".into(),
                why: format!("it has {} components instead of {D}", x.len()),
            })?,
            statistics: answer.statistics.clone().unwrap_or_default(),
            most_steps_in_segment: answer.fact("most_steps_in_segment")?,
            stop: match answer.stop {
                Stop::Finished => StopReason::EndTime,
                Stop::Found => StopReason::Observer,
                Stop::SetValued => StopReason::SetValued,
                Stop::StepBudget => StopReason::StepBudget,
                Stop::Interrupted => StopReason::Cancelled,
                Stop::Failed => {
                    let why = "the computation failed".into();
                    return Err(NoSuchFact { name: "stop".into(), why });
                }
            },
        })
    }
}

/// A Filippov motion's table with a column `signs` if the system has two switching surfaces: the
/// signs of both functions, 0 on the surface ("+-", "0+"). With one surface the mode says it.
fn signed(run: &RunSpec, mut table: Table) -> Table {
    if run.system.definition().second().is_none()
        || !matches!(table.name.as_str(), "motion" | "events")
    {
        return table;
    }
    let (names, n) = (run.system.coordinates(), run.system.dimension());
    let functions = Program::new(&run.system.tape().select([0, 2 * n + 1]));
    let mut column = Column::words("signs");
    if let Cells::Words(words) = &mut column.cells {
        let states: Vec<&[f64]> = names.iter().map(|name| table.numbers(name)).collect();
        for row in 0..table.len() {
            let x: Vec<f64> = states.iter().map(|s| s[row]).collect();
            let mut h = [0.0; 2];
            functions.evaluate(&x, &mut h);
            let on = INTERSECTION * (1.0 + x.iter().fold(0.0f64, |a, v| a.max(v.abs())));
            let sign = |h: f64| {
                if h.abs() <= on {
                    "0"
                } else if h > 0.0 {
                    "+"
                } else {
                    "-"
                }
            };
            words.push(&format!("{}{}", sign(h[0]), sign(h[1])));
        }
    }
    table.columns.push(column);
    table
}

fn point_columns(names: &[&str]) -> Vec<Column> {
    std::iter::once(&"t")
        .chain(names)
        .map(|name| Column::new(name, PURE, super::table::ColumnKind::Number))
        .collect()
}

fn point<const D: usize>(t: f64, x: [f64; D]) -> Vec<Entry> {
    std::iter::once(t).chain(x).map(Entry::from).collect()
}

fn path_table<const D: usize>(names: &[&str], samples: &[Sample<D>]) -> Table {
    let mut table = Table::new("path", point_columns(names));
    samples.iter().for_each(|s| table.push(point(s.t, s.x)));
    table
}

fn section_table<const D: usize>(names: &[&str], crossings: &[Crossing<D>]) -> Table {
    let mut table =
        Table::new("section", point_columns(names).into_iter().chain([Column::words("direction")]));
    for c in crossings {
        let mut row = point(c.t, c.x);
        row.push(c.direction.word().into());
        table.push(row);
    }
    table
}

fn samples<const D: usize>(names: &[&str], table: &Table) -> Vec<Sample<D>> {
    let columns: [&[f64]; D] =
        std::array::from_fn(|i| names.get(i).map_or(&[][..], |name| table.numbers(name)));
    let rows = columns.iter().map(|c| c.len()).min().unwrap_or(0);
    let times = table.numbers("t").iter().take(rows).enumerate();
    times.map(|(row, t)| Sample { t: *t, x: columns.map(|c| c[row]) }).collect()
}

/// A motion, and which future it is if it is one.
struct Member<'a, const D: usize> {
    motion: &'a Motion<D>,
    future: Option<(f64, Side)>,
}

pub(super) fn side_word(side: Side) -> &'static str {
    match side {
        Side::Plus => "plus",
        Side::Minus => "minus",
    }
}

fn side_of(word: &str) -> Option<Side> {
    [Side::Plus, Side::Minus].into_iter().find(|s| side_word(*s) == word)
}

const MODES: [(Mode, &str); 4] = [
    (Mode::Plus, "plus"),
    (Mode::Minus, "minus"),
    (Mode::SlidingAttracting, "sliding-attracting"),
    (Mode::SlidingRepelling, "sliding-repelling"),
];

fn mode_word(mode: Option<Mode>) -> &'static str {
    MODES.iter().find(|(m, _)| Some(*m) == mode).map_or("", |(_, word)| word)
}

fn mode_of(word: &str) -> Option<Mode> {
    MODES.iter().find(|(_, w)| *w == word).map(|(m, _)| *m)
}

fn motion_tables<const D: usize>(
    names: &[&str],
    members: &[Member<'_, D>],
    first_piece: usize,
) -> Vec<Table> {
    let future = || {
        [
            Column::integers("future"),
            Column::new("exit_time", PURE, super::table::ColumnKind::Number),
            Column::words("exit_side"),
        ]
    };
    let mut points = Table::new(
        "motion",
        point_columns(names)
            .into_iter()
            .chain([Column::words("mode"), Column::integers("piece")])
            .chain(future()),
    );
    let mut events = Table::new(
        "events",
        point_columns(names)
            .into_iter()
            .chain(["event", "from", "to", "side"].map(Column::words))
            .chain(["leg", "error", "time", "arc"].map(Column::numbers))
            .chain([Column::words("rule")])
            .chain(future()),
    );
    for (number, member) in members.iter().enumerate() {
        let which = || {
            let (time, side) =
                member.future.map_or((f64::NAN, ""), |(time, side)| (time, side_word(side)));
            [(number as i64).into(), time.into(), side.into()]
        };
        for (piece, (mode, samples)) in member.motion.pieces.iter().enumerate() {
            for s in samples {
                let mut row = point(s.t, s.x);
                row.extend([mode_word(Some(*mode)).into(), ((first_piece + piece) as i64).into()]);
                row.extend(which());
                points.push(row);
            }
        }
        for event in &member.motion.events {
            let mut row = point(event.t, event.state.into());
            row.extend(event_cells(event));
            row.extend(which());
            events.push(row);
        }
    }
    vec![points, events]
}

/// event, from, to, side, leg, error, time, arc, rule.
fn event_cells<const D: usize>(event: &ModeEvent<D>) -> [Entry; 9] {
    let none = f64::NAN;
    let (word, side, [leg, error, time, arc], rule) = match event.kind {
        EventKind::Crossing { to } => ("crossing", Some(to), [none; 4], None),
        EventKind::Landing { from } => ("landing", Some(from), [none; 4], None),
        EventKind::Grazing { side } => ("grazing", Some(side), [none; 4], None),
        EventKind::LeftByTangency { to } => ("left-by-tangency", Some(to), [none; 4], None),
        EventKind::StartedOnSurface => ("started-on-surface", None, [none; 4], None),
        EventKind::EnteredRepelling => ("entered-repelling", None, [none; 4], None),
        EventKind::Accumulation { leg } => ("accumulation", None, [leg, none, none, none], None),
        EventKind::TwoFoldReached { leg, error } => {
            ("two-fold-reached", None, [leg, error, none, none], None)
        }
        EventKind::Exit { to, time, arc, rule } => {
            ("exit", Some(to), [none, none, time, arc], Some(rule))
        }
        EventKind::ExitAtBoundary { to, time, arc, rule } => {
            ("exit-at-boundary", Some(to), [none, none, time, arc], Some(rule))
        }
    };
    let rule = rule.map_or_else(String::new, |rule| {
        String::from_utf8_lossy(&canonical_json(&rule)).into_owned()
    });
    [
        word.into(),
        mode_word(event.from).into(),
        mode_word(event.to).into(),
        side.map_or("", side_word).into(),
        leg.into(),
        error.into(),
        time.into(),
        arc.into(),
        Entry::Word(rule),
    ]
}

/// Each motion of the tables with its future, in order; at least the approach, which may be empty.
type Members<const D: usize> = Vec<(Option<(f64, Side)>, Motion<D>)>;

fn members_of<const D: usize>(
    names: &[&str],
    points: &Table,
    events: &Table,
) -> Result<Members<D>, NoSuchFact> {
    let wrong = |why: &str| NoSuchFact { name: "motion".into(), why: why.into() };
    let mut members: Members<D> = vec![(None, Motion::default())];
    let mut last_piece = None;
    let futures = points
        .integers("future")
        .iter()
        .zip(points.numbers("exit_time"))
        .zip(points.words("exit_side"));
    let modes = points.words("mode").zip(points.integers("piece"));
    for ((sample, (mode, piece)), ((future, exit_time), side)) in
        samples(names, points).into_iter().zip(modes).zip(futures)
    {
        let mode = mode_of(mode).ok_or_else(|| wrong("an unknown mode"))?;
        let member = member(&mut members, *future, *exit_time, side)
            .ok_or_else(|| wrong("futures out of order"))?;
        if last_piece != Some((*future, *piece)) {
            last_piece = Some((*future, *piece));
            member.pieces.push((mode, Vec::new()));
        }
        if let Some((_, piece)) = member.pieces.last_mut() {
            piece.push(sample);
        }
    }
    let futures = events
        .integers("future")
        .iter()
        .zip(events.numbers("exit_time"))
        .zip(events.words("exit_side"));
    for ((row, sample), ((future, exit_time), side)) in
        samples(names, events).into_iter().enumerate().zip(futures)
    {
        let event = event_of(events, row, &sample).ok_or_else(|| wrong("an unknown event"))?;
        let member = member(&mut members, *future, *exit_time, side)
            .ok_or_else(|| wrong("futures out of order"))?;
        member.events.push(event);
    }
    Ok(members)
}

/// The motion of a future, made if it is the next one.
fn member<'a, const D: usize>(
    members: &'a mut Members<D>,
    future: i64,
    exit_time: f64,
    side: &str,
) -> Option<&'a mut Motion<D>> {
    let index = usize::try_from(future).ok()?;
    if index == members.len() {
        members.push((Some((exit_time, side_of(side)?)), Motion::default()));
    }
    members.get_mut(index).map(|(_, motion)| motion)
}

fn event_of<const D: usize>(events: &Table, row: usize, at: &Sample<D>) -> Option<ModeEvent<D>> {
    let cell = |name: &str| events.column(name).map(|c| c.get(row));
    let word = |name: &str| cell(name).map_or_else(String::new, |c| c.word().to_owned());
    let number = |name: &str| cell(name).map_or(f64::NAN, |c| c.value());
    let side = || side_of(&word("side"));
    let rule = || serde_json::from_str::<ExitRule>(&word("rule")).ok();
    let kind = match word("event").as_str() {
        "crossing" => EventKind::Crossing { to: side()? },
        "landing" => EventKind::Landing { from: side()? },
        "grazing" => EventKind::Grazing { side: side()? },
        "left-by-tangency" => EventKind::LeftByTangency { to: side()? },
        "started-on-surface" => EventKind::StartedOnSurface,
        "entered-repelling" => EventKind::EnteredRepelling,
        "two-fold-reached" => {
            EventKind::TwoFoldReached { leg: number("leg"), error: number("error") }
        }
        "accumulation" => EventKind::Accumulation { leg: number("leg") },
        "exit" => {
            EventKind::Exit { to: side()?, time: number("time"), arc: number("arc"), rule: rule()? }
        }
        "exit-at-boundary" => EventKind::ExitAtBoundary {
            to: side()?,
            time: number("time"),
            arc: number("arc"),
            rule: rule()?,
        },
        _ => return None,
    };
    Some(ModeEvent {
        t: at.t,
        state: SVector::from(at.x),
        kind,
        from: mode_of(&word("from")),
        to: mode_of(&word("to")),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulate::simulate;
    use crate::spec::*;
    use twofold_integrate::filippov::SlidingLaw;
    use twofold_integrate::{Schedule, StepCap, Tolerance};
    use twofold_system::{Caricature, Relaxation};

    fn run(switch: SwitchSpec, observe: Observation) -> RunSpec {
        RunSpec {
            system: Caricature::with_reinjection(1e-1, 1e-5).into(),
            switch,
            start: vec![0.2, 0.0, -1.0],
            t_end: 40.0,
            method: MethodSpec {
                name: Method::Dopri5,
                tolerance: Tolerance { rtol: 1e-9, atol: 1e-9 },
                step_cap: StepCap::None,
                max_steps: DEFAULT_MAX_STEPS,
                precision: None,
                order: None,
            },
            schedule: Schedule::default(),
            observe,
        }
    }

    #[test]
    fn every_kind_of_recording_comes_back_from_its_tables() {
        let path = Observation::Path { chord: 1e-2 };
        let section = Observation::Section { coordinate: 1, value: 0.0 };
        let random = ExitRule::Random {
            law: SlidingLaw::Exponential { mean: 0.5 },
            plus_probability: 0.5,
            seed: 1,
            stream: 2,
        };
        let funnel = FunnelSpec {
            shortest: 0.1,
            longest: 1.0,
            times: 3,
            horizon: 5.0,
            until_two_fold: true,
        };
        for run in [
            run(SwitchSpec::tanh(1e-2), path),
            run(SwitchSpec::hysteretic(1e-2, Relaxation::Single), section),
            run(SwitchSpec::tanh(1e-2), Observation::Times { every: 0.7 }),
            run(
                SwitchSpec::Filippov { exit: random, funnel: None },
                Observation::Times { every: 0.7 },
            ),
            run(SwitchSpec::Filippov { exit: random, funnel: None }, path),
            run(SwitchSpec::Filippov { exit: random, funnel: None }, section),
            run(SwitchSpec::Filippov { exit: ExitRule::All, funnel: Some(funnel) }, path),
        ] {
            let recording = simulate(&run, &()).unwrap();
            assert!(!recording.data.is_empty());
            let answer = recording.to_answer(&run);
            assert_eq!(recording.data.len(), answer.tables[0].len());
            // Of a piece between two samples tables know only that it was there.
            let mut seen = recording.clone();
            if let Data::Motion(motion) = &mut seen.data {
                motion.pieces.retain(|(_, samples)| !samples.is_empty());
            }
            assert_eq!(Recording::of_answer(&run, &answer).unwrap(), seen, "{:?}", run.switch);
            // And through the bytes that a store keeps.
            let tables = crate::encode::from_bits(&crate::encode::bits(&answer.tables)).unwrap();
            assert_eq!(Recording::of_answer(&run, &Answer { tables, ..answer }).unwrap(), seen);
        }
    }

    /// Every kind of event and every mode, on either side.
    #[test]
    fn every_event_comes_back_from_its_table() {
        let run = run(
            SwitchSpec::Filippov { exit: ExitRule::All, funnel: None },
            Observation::Path { chord: 1e-2 },
        );
        let rule = ExitRule::AfterTime { time: 0.3, side: Side::Minus };
        let kinds = [Side::Plus, Side::Minus].into_iter().flat_map(|side| {
            [
                EventKind::Crossing { to: side },
                EventKind::Landing { from: side },
                EventKind::Grazing { side },
                EventKind::LeftByTangency { to: side },
                EventKind::StartedOnSurface,
                EventKind::EnteredRepelling,
                EventKind::TwoFoldReached { leg: 0.25, error: 1e-9 },
                EventKind::Accumulation { leg: 1e-11 },
                EventKind::Exit { to: side, time: 0.3, arc: 0.7, rule },
                EventKind::ExitAtBoundary { to: side, time: 0.1, arc: 0.2, rule },
            ]
        });
        let mode = |i: usize| MODES.get(i % 5).map(|(mode, _)| *mode);
        let events: Vec<ModeEvent<3>> = kinds
            .enumerate()
            .map(|(i, kind)| ModeEvent {
                t: i as f64,
                state: SVector::from([i as f64, -1.0, 2.0]),
                kind,
                from: mode(i),
                to: mode(i + 1),
            })
            .collect();
        let piece = |(i, mode): (usize, Mode)| {
            (mode, vec![Sample { t: i as f64, x: [1.0, 2.0, i as f64] }; i + 1])
        };
        let pieces = MODES.iter().map(|(mode, _)| *mode).enumerate().map(piece).collect();
        let recording = Recording {
            data: Data::Motion(Motion { pieces, events }),
            t: 20.0,
            x: [1.0, 2.0, 3.0],
            statistics: Statistics::default(),
            most_steps_in_segment: 7,
            stop: StopReason::SetValued,
        };
        let answer = recording.to_answer(&run);
        assert_eq!(Recording::of_answer(&run, &answer).unwrap(), recording);
        assert_eq!((recording.data.len(), answer.stop), (10, Stop::SetValued));
        assert!(
            Data::<3>::Path(Vec::new()).is_empty()
                && Data::<3>::Motion(Motion::default()).is_empty()
        );
    }

    /// On a straight line through both surfaces: x = 0 at time 1, y = 0 at time 2.
    #[test]
    fn two_surfaces_have_their_signs_beside_each_point() {
        let field = "plus = ['1', '2', '3']\nminus = ['1', '2', '3']\n";
        let system = crate::cases::of(&format!(
            "states = ['x', 'y', 'z']\nh = 'x'\n{field}[second]\nh = 'y'\n{field}"
        ));
        let exit = ExitRule::AtOnce { side: Side::Plus };
        let mut run =
            run(SwitchSpec::Filippov { exit, funnel: None }, Observation::Times { every: 0.5 });
        (run.system, run.start, run.t_end) = (system, vec![-1.0, -4.0, 0.0], 3.0);
        let answer = crate::simulate::answer(&run, &()).unwrap();
        let points = &answer.tables[0];
        for ((t, signs), z) in
            points.numbers("t").iter().zip(points.words("signs")).zip(points.numbers("z"))
        {
            let sign = |h: f64| {
                if h.abs() < 1e-6 {
                    '0'
                } else if h > 0.0 {
                    '+'
                } else {
                    '-'
                }
            };
            assert_eq!(signs, format!("{}{}", sign(t - 1.0), sign(t - 2.0)), "at {t}");
            assert!((z - 3.0 * t).abs() < 1e-9);
        }
        let events: Vec<&str> = answer.table("events").unwrap().words("signs").collect();
        assert_eq!(events, ["0-", "+0"]);
    }

    /// "On" is within so many parts of 1 + the largest component: at 9 ten times as far as near the
    /// origin.
    #[test]
    fn a_surface_is_as_thick_as_the_state_is_large() {
        let field = "plus = ['1', '2', '3']\nminus = ['1', '2', '3']\n";
        let system = crate::cases::of(&format!(
            "states = ['x', 'y', 'z']\nh = 'x'\n{field}[second]\nh = 'y'\n{field}"
        ));
        let exit = ExitRule::AtOnce { side: Side::Plus };
        let mut run =
            run(SwitchSpec::Filippov { exit, funnel: None }, Observation::Times { every: 0.5 });
        run.system = system;
        let mut points = Table::new("motion", ["x", "y", "z"].map(Column::numbers));
        for [x, y, z] in [[5.0, -20.0, 9.0], [0.5, -2.0, 0.0]] {
            points.push([(x * INTERSECTION).into(), (y * INTERSECTION).into(), z.into()]);
        }
        assert_eq!(signed(&run, points).words("signs").collect::<Vec<_>>(), ["0-", "0-"]);
    }

    #[test]
    fn an_answer_of_another_kind_is_no_recording() {
        let run = run(SwitchSpec::tanh(1e-2), Observation::Path { chord: 1e-2 });
        let error = <Recording>::of_answer(&run, &Answer::of_tables(Vec::new())).unwrap_err();
        assert!(error.to_string().contains("path"), "{error}");
    }
}
