//! Runs of general systems, as tables.

use serde_json::{Value, json};
use twofold_hybrid::motion::{Exit, Record};
use twofold_hybrid::selection::Intersection;
use twofold_hybrid::{Ending, HybridError, Model, Options, Point, follow};

use super::answer::{Answer, Stop};
use super::table::{Column, Entry, Table};

/// A run of a general system.
#[derive(Clone, Debug)]
pub struct GeneralRun {
    /// The system.
    pub model: Model,
    /// How it is followed.
    pub options: Options,
}

/// Rows are handed on in parts of so many.
const PART: usize = 4096;

impl GeneralRun {
    /// Everything that the run depends on, as data.
    pub fn json(&self) -> Value {
        let o = &self.options;
        json!({
            "system": self.model.json(),
            "t_start": o.t_start,
            "t_end": o.t_end,
            "start": o.start,
            "method": { "name": o.method.name(), "rtol": o.rtol, "atol": o.atol, "max_step": o.max_step.is_finite().then_some(o.max_step), "max_steps": o.max_steps },
            "observe": match &o.record {
                Record::Path { chord } => json!({ "path": { "chord": chord } }),
                Record::Times { every } => json!({ "times": { "every": every } }),
                Record::Section(e) => json!({ "section": e.to_string() }),
            },
            "intersection": match o.intersection {
                Intersection::Undecided => "undecided",
                Intersection::Bilinear => "bilinear",
                Intersection::HullLeastNorm => "hull-least-norm",
            },
            "exit": match o.exit {
                Exit::Undecided => "undecided",
                Exit::Plus => "at-once:plus",
                Exit::Minus => "at-once:minus",
            },
        })
    }

    /// What a file of this run says about itself.
    pub fn about(&self) -> Value {
        json!({ "kind": "general-run", "question": self.json() })
    }

    /// An empty table for the points: time, states, and as far as the system has them the mode, the signs of its switching functions and the event.
    pub fn table(&self) -> Table {
        let definition = self.model.definition();
        let name = if matches!(self.options.record, Record::Section(_)) { "section" } else { "path" };
        let unit = |unit: &str| if unit.is_empty() { "1".to_owned() } else { unit.to_owned() };
        let mut columns = vec![Column::numbers("t")];
        columns.extend(definition.states().iter().map(|s| {
            let mut column = Column::numbers(&s.name);
            column.unit = unit(&s.about.unit);
            column
        }));
        let has = self.columns();
        columns.extend(has.iter().map(|name| Column::words(name)));
        Table::new(name, columns)
    }

    /// The names of the columns of words.
    fn columns(&self) -> Vec<&'static str> {
        let definition = self.model.definition();
        let mut names = Vec::new();
        if definition.modes().len() > 1 {
            names.push("mode");
        }
        if self.model.has_switches() {
            names.push("signs");
        }
        if !definition.events().is_empty() && !matches!(self.options.record, Record::Section(_)) {
            names.push("event");
        }
        names
    }

    fn row(&self, columns: &[&str], point: &Point) -> Vec<Entry> {
        let mut row: Vec<Entry> = std::iter::once(point.t).chain(point.x.iter().copied()).map(Entry::Number).collect();
        row.extend(columns.iter().map(|column| match *column {
            "mode" => Entry::Word(self.model.definition().modes()[point.mode].name.clone()),
            "signs" => Entry::Word(point.signs.to_owned()),
            _ => Entry::Word(point.event.unwrap_or_default().to_owned()),
        }));
        row
    }

    /// Follows the system and hands its rows on in parts, which may come before an error; `more` says whether more is wanted.
    /// The answer holds facts, and no rows.
    ///
    /// # Errors
    /// As [`follow`].
    pub fn stream(
        &self,
        rows: &mut dyn FnMut(&Table) -> bool,
        reached: &dyn Fn(f64) -> bool,
    ) -> Result<Answer, HybridError> {
        let columns = self.columns();
        let empty = self.table();
        let mut table = empty.clone();
        let found = follow(&self.model, &self.options, &mut |point| {
            table.push(self.row(&columns, point));
            let mut more = reached(point.t);
            if table.len() >= PART {
                more &= rows(&table);
                table = empty.clone();
            }
            more
        });
        rows(&table);
        let outcome = found?;
        let mut answer = Answer::of_tables(vec![empty])
            .with_fact("t", &outcome.t)
            .with_fact("x", &outcome.x)
            .with_fact("steps", &outcome.steps)
            .with_fact("switches", &outcome.switches)
            .with_fact("events", &outcome.events);
        match &outcome.ending {
            Ending::Finished => {}
            Ending::Stopped(event) => answer = answer.with_fact("stopped_by", event),
            Ending::Zeno { event, t, error } => {
                answer = answer.with_fact("zeno", &json!({ "event": event, "t": t, "error": error }));
            }
            Ending::Interrupted => {}
        }
        answer.stop = match outcome.ending {
            Ending::Finished => Stop::Finished,
            Ending::Stopped(_) | Ending::Zeno { .. } => Stop::Found,
            Ending::Interrupted => Stop::Interrupted,
        };
        Ok(answer)
    }

    /// The whole run in memory.
    ///
    /// # Errors
    /// As [`follow`].
    pub fn compute(&self, reached: &dyn Fn(f64) -> bool) -> Result<Answer, HybridError> {
        let mut whole = self.table();
        let mut answer = self.stream(
            &mut |part| {
                whole.extend(part.rows());
                true
            },
            reached,
        )?;
        answer.tables = vec![whole];
        Ok(answer)
    }
}
