//! Recorded numbers as bytes: little-endian bits for hashing, CSV and JSON for people.
//!
//! Whatever was recorded is first laid out as a table of numbers and words; the three encodings are views of it.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::simulate::{Data, Recording};
use super::spec::RunSpec;
use crate::analyse::{Direction, Motion};
use crate::integrate::filippov::{Mode, ModeEvent, Side};

/// A cell of a data table.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Cell {
    Number(f64),
    /// A word, and the number that stands for it among the hashed bits.
    Word(&'static str, f64),
    /// Nothing, where a column does not apply.
    Blank,
}

/// The columns' names and a row per recorded point.
fn table(spec: &RunSpec, data: &Data) -> (Vec<&'static str>, Vec<Vec<Cell>>) {
    let [a, b, c] = spec.system.coordinates();
    let point = |t: f64, x: [f64; 3]| [t, x[0], x[1], x[2]].map(Cell::Number).to_vec();
    let with = |mut row: Vec<Cell>, more: &[Cell]| {
        row.extend_from_slice(more);
        row
    };
    match data {
        Data::Path(samples) => (vec!["t", a, b, c], samples.iter().map(|s| point(s.t, s.x)).collect()),
        Data::Section(crossings) => (
            vec!["t", a, b, c, "direction"],
            crossings.iter().map(|k| with(point(k.t, k.x), &[direction(k.direction)])).collect(),
        ),
        Data::Motion(motion) => {
            (vec!["t", a, b, c, "mode"], motion.samples().map(|(m, s)| with(point(s.t, s.x), &[mode(m)])).collect())
        }
        Data::Funnel { approach, futures } => {
            let rows = |motion: &Motion, exit: [Cell; 2]| -> Vec<Vec<Cell>> {
                motion.samples().map(|(m, s)| with(point(s.t, s.x), &[mode(m), exit[0], exit[1]])).collect()
            };
            let mut all = rows(approach, [Cell::Blank, Cell::Blank]);
            for future in futures {
                let side = match future.side {
                    Side::Plus => Cell::Word("plus", 1.0),
                    Side::Minus => Cell::Word("minus", -1.0),
                };
                all.extend(rows(&future.motion, [Cell::Number(future.exit_time), side]));
            }
            (vec!["t", a, b, c, "mode", "exit_time", "side"], all)
        }
    }
}

fn direction(direction: Direction) -> Cell {
    Cell::Word(direction.word(), if direction == Direction::Up { 1.0 } else { -1.0 })
}

fn mode(mode: Mode) -> Cell {
    match mode {
        Mode::Plus => Cell::Word("plus", 1.0),
        Mode::Minus => Cell::Word("minus", -1.0),
        Mode::SlidingAttracting => Cell::Word("sliding-attracting", 2.0),
        Mode::SlidingRepelling => Cell::Word("sliding-repelling", -2.0),
    }
}

/// The events of a recording, approach first.
fn events(data: &Data) -> Vec<&ModeEvent<3>> {
    match data {
        Data::Path(_) | Data::Section(_) => Vec::new(),
        Data::Motion(motion) => motion.events.iter().collect(),
        Data::Funnel { approach, futures } => {
            approach.events.iter().chain(futures.iter().flat_map(|f| &f.motion.events)).collect()
        }
    }
}

fn event_json(event: &ModeEvent<3>) -> Value {
    json!({
        "t": event.t,
        "state": <[f64; 3]>::from(event.state),
        "event": event.kind,
        "from": event.from,
        "to": event.to,
    })
}

/// The bytes that are hashed: every number as the little-endian bits of an f64, row after row; a word as the number that
/// stands for it, a blank as not-a-number; then the events as canonical JSON.
pub fn bits(spec: &RunSpec, data: &Data) -> Vec<u8> {
    let mut bytes = Vec::new();
    for cell in table(spec, data).1.iter().flatten() {
        let number = match cell {
            Cell::Number(v) | Cell::Word(_, v) => *v,
            Cell::Blank => f64::NAN,
        };
        bytes.extend_from_slice(&number.to_bits().to_le_bytes());
    }
    for event in events(data) {
        bytes.extend_from_slice(event_json(event).to_string().as_bytes());
    }
    bytes
}

/// CSV with a header line and shortest round-trip numbers.
pub fn csv(spec: &RunSpec, data: &Data) -> Vec<u8> {
    let (columns, rows) = table(spec, data);
    let mut text = columns.join(",");
    text.push('\n');
    for row in rows {
        for (i, cell) in row.iter().enumerate() {
            if i > 0 {
                text.push(',');
            }
            // Writing to a String cannot fail.
            let _ = match cell {
                Cell::Number(v) => write!(text, "{v:?}"),
                Cell::Word(word, _) => write!(text, "{word}"),
                Cell::Blank => Ok(()),
            };
        }
        text.push('\n');
    }
    text.into_bytes()
}

/// JSON: the spec, the statistics, the events, and the rows as arrays under their column names.
pub fn json(spec: &RunSpec, recording: &Recording) -> Vec<u8> {
    let (columns, rows) = table(spec, &recording.data);
    let rows: Vec<Vec<Value>> = rows
        .iter()
        .map(|row| {
            let value = |cell: &Cell| match cell {
                Cell::Number(v) => json!(v),
                Cell::Word(word, _) => json!(word),
                Cell::Blank => Value::Null,
            };
            row.iter().map(value).collect()
        })
        .collect();
    let value = json!({
        "spec": spec,
        "end": { "t": recording.t, "state": recording.x },
        "statistics": recording.statistics,
        "most_steps_in_segment": recording.most_steps_in_segment,
        "events": events(&recording.data).into_iter().map(event_json).collect::<Vec<_>>(),
        "columns": columns,
        "rows": rows,
    });
    let mut bytes = serde_json::to_vec(&value).expect("a recording is plain data");
    bytes.push(b'\n');
    bytes
}
