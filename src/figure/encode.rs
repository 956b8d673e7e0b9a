//! Recorded numbers as bytes: little-endian bits for hashing, CSV and JSON for people.

use std::fmt::Write as _;

use serde_json::json;

use super::simulate::{Data, Recording};
use super::spec::RunSpec;

/// The bytes that are hashed: every number as the little-endian bits of an f64, row after row.
pub fn bits(data: &Data) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut push = |v: f64| bytes.extend_from_slice(&v.to_bits().to_le_bytes());
    match data {
        Data::Path(samples) => {
            for s in samples {
                [s.t, s.x[0], s.x[1], s.x[2]].into_iter().for_each(&mut push);
            }
        }
        Data::Section(crossings) => {
            for c in crossings {
                let sense = if c.direction == crate::observe::Direction::Up { 1.0 } else { -1.0 };
                [c.t, c.x[0], c.x[1], c.x[2], sense].into_iter().for_each(&mut push);
            }
        }
    }
    bytes
}

/// CSV with a header line and shortest round-trip numbers.
pub fn csv(spec: &RunSpec, data: &Data) -> Vec<u8> {
    let [a, b, c] = spec.system.coordinates();
    let mut text = String::new();
    // Writing to a String cannot fail.
    match data {
        Data::Path(samples) => {
            let _ = writeln!(text, "t,{a},{b},{c}");
            for s in samples {
                let _ = writeln!(text, "{:?},{:?},{:?},{:?}", s.t, s.x[0], s.x[1], s.x[2]);
            }
        }
        Data::Section(crossings) => {
            let _ = writeln!(text, "t,{a},{b},{c},direction");
            for k in crossings {
                let _ = writeln!(text, "{:?},{:?},{:?},{:?},{}", k.t, k.x[0], k.x[1], k.x[2], k.direction.word());
            }
        }
    }
    text.into_bytes()
}

/// JSON: the spec, the statistics, and the rows as arrays under their column names.
pub fn json(spec: &RunSpec, recording: &Recording) -> Vec<u8> {
    let [a, b, c] = spec.system.coordinates();
    let (columns, rows): (Vec<&str>, Vec<serde_json::Value>) = match &recording.data {
        Data::Path(samples) => {
            (vec!["t", a, b, c], samples.iter().map(|s| json!([s.t, s.x[0], s.x[1], s.x[2]])).collect())
        }
        Data::Section(crossings) => (
            vec!["t", a, b, c, "direction"],
            crossings.iter().map(|k| json!([k.t, k.x[0], k.x[1], k.x[2], k.direction.word()])).collect(),
        ),
    };
    let value = json!({
        "spec": spec,
        "end": { "t": recording.t, "state": recording.x },
        "statistics": recording.statistics,
        "most_steps_in_segment": recording.most_steps_in_segment,
        "columns": columns,
        "rows": rows,
    });
    let mut bytes = serde_json::to_vec(&value).expect("a recording is plain data");
    bytes.push(b'\n');
    bytes
}
