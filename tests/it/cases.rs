//! The cases of `tests/cases`: each command is run in its folder, and its answer compared with the
//! known one.

use std::fmt::Write as _;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use rayon::prelude::*;
use regex::RegexBuilder;
use serde_json::Value;

/// Exit code and output of a command.
struct Answer {
    code: i64,
    out: String,
    err: String,
}

/// A CSV table without its comments.
struct Table<'a> {
    names: Vec<&'a str>,
    rows: Vec<Vec<&'a str>>,
}

impl<'a> Table<'a> {
    fn new(text: &'a str) -> Result<Self, String> {
        let mut lines =
            text.lines().filter(|line| !line.trim().is_empty() && !line.starts_with('#'));
        let names = lines.next().ok_or("no table")?.split(',').collect();
        let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
        if rows.is_empty() { Err("no rows".into()) } else { Ok(Self { names, rows }) }
    }

    fn column(&self, name: &str) -> Result<Vec<&'a str>, String> {
        let k = self.names.iter().position(|n| *n == name).ok_or(format!("no column {name}"))?;
        Ok(self.rows.iter().map(|row| row[k]).collect())
    }
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("{key} is a number"))
}

fn texts(value: &Value, key: &str) -> Vec<String> {
    value[key].as_array().into_iter().flatten().map(|v| v.as_str().unwrap().to_owned()).collect()
}

/// The patterns that `text` contains, without regard to case.
fn found(patterns: &[String], text: &str) -> Vec<String> {
    let contains = |pattern: &&String| {
        RegexBuilder::new(pattern)
            .case_insensitive(true)
            .multi_line(true)
            .build()
            .unwrap()
            .is_match(text)
    };
    patterns.iter().filter(contains).cloned().collect()
}

/// Exit codes that a case allows.
fn codes(expected: &Value, otherwise: &[i64]) -> Vec<i64> {
    match &expected["exit"] {
        Value::Null => otherwise.to_vec(),
        Value::Array(list) => list.iter().map(|v| v.as_i64().unwrap()).collect(),
        one => vec![one.as_i64().unwrap()],
    }
}

fn parsed(cell: &str) -> Result<f64, String> {
    cell.parse().map_err(|_| format!("{cell:?} is no number"))
}

/// Nothing if the answer is right, else what is wrong with it.
fn check(expected: &Value, answer: &Answer) -> Result<(), String> {
    let both = format!("{}\n{}", answer.out, answer.err);
    let failed = || format!("exit code {}: {}", answer.code, answer.err.trim());
    let captures = |pattern: &str| -> Result<Vec<f64>, String> {
        let regex = RegexBuilder::new(pattern).multi_line(true).build().unwrap();
        let groups = regex.captures(&both).ok_or(format!("nothing like {pattern} in {both}"))?;
        groups.iter().skip(1).flatten().map(|group| parsed(group.as_str())).collect()
    };
    let kind = expected["kind"].as_str().unwrap();
    if kind != "error" && !codes(expected, &[answer.code]).contains(&answer.code) {
        return Err(failed());
    }
    match kind {
        "value" => {
            if answer.code != 0 {
                return Err(failed());
            }
            let column = Table::new(&answer.out)?.column(expected["column"].as_str().unwrap())?;
            let row = expected["row"].as_i64().unwrap();
            let row = if row < 0 { column.len() as i64 + row } else { row };
            let value = parsed(column.get(row as usize).ok_or("no such row")?)?;
            let (want, tolerance) = (number(expected, "value"), number(expected, "tol"));
            let right = (value - want).abs() <= tolerance;
            right.then_some(()).ok_or(format!("{value:e}, not {want:e} +- {tolerance:e}"))
        }
        "column_min" | "column_max" => {
            if ![0, 3].contains(&answer.code) {
                return Err(failed());
            }
            let cells = Table::new(&answer.out)?.column(expected["column"].as_str().unwrap())?;
            let values = cells
                .into_iter()
                .filter(|cell| !cell.is_empty())
                .map(parsed)
                .collect::<Result<Vec<_>, _>>()?;
            let least = kind == "column_min";
            let value = values
                .into_iter()
                .reduce(if least { f64::min } else { f64::max })
                .ok_or("no values")?;
            let low = expected["at_least"].as_f64().unwrap_or(f64::NEG_INFINITY);
            let high = expected["at_most"].as_f64().unwrap_or(f64::INFINITY);
            (low <= value && value <= high).then_some(()).ok_or(format!("{kind}: {value:e}"))
        }
        "error" => {
            if !codes(expected, &[2, 3]).contains(&answer.code) {
                return Err(format!("exit code {}, where an error was to come", answer.code));
            }
            let wanted = texts(expected, "must_contain_any");
            if !wanted.is_empty() && found(&wanted, &answer.err).is_empty() {
                return Err(format!("the error says: {}", answer.err.trim()));
            }
            let bad = found(&texts(expected, "must_not_contain"), &answer.err);
            bad.is_empty()
                .then_some(())
                .ok_or(format!("the error says {bad:?}: {}", answer.err.trim()))
        }
        "contains_any" => {
            let wanted = texts(expected, "texts");
            (!found(&wanted, &both).is_empty())
                .then_some(())
                .ok_or(format!("none of {wanted:?} in {both}"))
        }
        "not_contains" => {
            let mut unwanted = texts(expected, "texts");
            unwanted.extend(expected["text"].as_str().map(str::to_owned));
            let bad = found(&unwanted, &both);
            bad.is_empty().then_some(()).ok_or(format!("contains {bad:?}: {both}"))
        }
        "number" => {
            let value = captures(expected["pattern"].as_str().unwrap())?[0];
            let right = (value - number(expected, "value")).abs() <= number(expected, "tol");
            right.then_some(()).ok_or(format!("{value:e}, not {}", expected["value"]))
        }
        "covers" => {
            let [value, bar] = captures(expected["pattern"].as_str().unwrap())?[..] else {
                return Err("no value with a bar".into());
            };
            let want = number(expected, "value");
            let covered = (value - want).abs() <= bar;
            let narrow = bar <= expected["largest_bar"].as_f64().unwrap_or(f64::INFINITY);
            (covered && narrow).then_some(()).ok_or(format!("{value:e} +- {bar:e} for {want:e}"))
        }
        // Seconds are measured by benchmarks, not by tests.
        "time" => Ok(()),
        "plain_header" => {
            let first = answer.out.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
            let names = first.trim_start_matches(['#', ' ']).split(',').count();
            let cells = Table::new(&answer.out)?.rows[0].len();
            (names == cells).then_some(()).ok_or(format!("{names} names over {cells} columns"))
        }
        "all" => expected["of"].as_array().unwrap().iter().try_for_each(|part| check(part, answer)),
        "any" => {
            let parts = expected["of"].as_array().unwrap();
            let mut faults = parts.iter().map(|part| check(part, answer));
            let first = faults.next().unwrap();
            if first.is_ok() || faults.any(|fault| fault.is_ok()) { Ok(()) } else { first }
        }
        other => panic!("kind {other} is not known"),
    }
}

/// Runs the command of a case and compares what it prints.
fn outcome(case: &Path) -> Result<(), String> {
    let read = |name: &str| fs::read_to_string(case.join(name)).unwrap();
    let arguments = read("command");
    let expected: Value = serde_json::from_str(&read("expected.json")).unwrap();
    let mut command = Command::cargo_bin("twofold").unwrap();
    let output = command.current_dir(case).args(arguments.split_whitespace()).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    let code = i64::from(output.status.code().expect("ended by itself"));
    let answer = Answer { code, out: text(output.stdout), err: text(output.stderr) };
    assert!(!answer.err.contains("panicked"), "{}: {}", case.display(), answer.err);
    check(&expected, &answer)
}

/// `open.txt` names the cases that are not right yet. It must shrink: a case that it names and that
/// is right fails the test, too.
#[test]
fn cases_are_right_but_for_those_known_to_be_open() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/cases");
    let open = fs::read_to_string(folder.join("open.txt")).unwrap();
    let open: Vec<&str> = open.lines().filter(|line| !line.starts_with('#')).collect();
    let mut cases: Vec<_> =
        fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    cases.retain(|case| case.is_dir());
    cases.sort();
    assert!(cases.len() >= 59, "{} cases", cases.len());
    let mut faults = String::new();
    for (case, outcome) in cases.par_iter().map(|case| (case, outcome(case))).collect::<Vec<_>>() {
        let name = case.file_name().unwrap().to_str().unwrap();
        match (open.contains(&name), outcome) {
            (false, Err(fault)) => writeln!(faults, "{name} is wrong: {fault}").unwrap(),
            (true, Ok(())) => writeln!(faults, "{name} is right: take it off open.txt").unwrap(),
            _ => {}
        }
    }
    assert!(faults.is_empty(), "{faults}");
}
