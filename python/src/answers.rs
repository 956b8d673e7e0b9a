//! Jobs asked from Python, and their answers as NumPy arrays.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use rayon::prelude::*;
use serde_json::{Value, json};
use twofold::cli::CliError;
use twofold::cli::asked::{Asked, asked};
use twofold::integrate::Monitor;
use twofold::integrate::filippov::ExitRule;
use twofold::job::question::question_hash;
use twofold::job::spec::{RunSpec, SwitchSpec};
use twofold::job::sweep::{Axis, Draws, Outcome, OutcomeQuestion, Rows, Shard, Sweep};
use twofold::job::table::Cells;
use twofold::job::{
    Answer, Classification, Executor, JobError, Question, Run, Stop, Table, encode,
};
use twofold::record::Hash;

use crate::errors;
use crate::supervise::{Work, supervise};

/// A spec from its JSON.
fn spec(text: &str) -> PyResult<RunSpec> {
    let spec: RunSpec = serde_json::from_str(text)
        .map_err(|e| errors::SpecError::new_err((e.to_string(), "spec")))?;
    spec.validate().map_err(|e| errors::spec(&e))?;
    Ok(spec)
}

/// The answer to a run, moved out of the executor that asked.
fn answer_to(run: RunSpec, work: &Work) -> Result<Answer, JobError> {
    let answer = Executor::new(None, work).ask(&Run(run))?;
    let answer = Arc::try_unwrap(answer).unwrap_or_else(|shared| (*shared).clone());
    if answer.stop == Stop::Interrupted { Err(JobError::Interrupted) } else { Ok(answer) }
}

/// A run: its tables as arrays, and everything else as JSON.
#[pyfunction]
#[pyo3(signature = (text, show=None))]
pub fn run<'py>(
    py: Python<'py>,
    text: &str,
    show: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let spec = spec(text)?;
    let question = question_hash(&Run(spec.clone()));
    let (answer, hash) = supervise(py, show, move |work| {
        let answer = answer_to(spec, work)?;
        let hash = answer.hash();
        Ok((answer, hash))
    })?;
    let result = PyDict::new(py);
    result.set_item("question", question.as_str())?;
    result.set_item("hash", hash.as_str())?;
    result.set_item("facts", json!(answer.facts).to_string())?;
    result.set_item("statistics", json!(answer.statistics).to_string())?;
    result.set_item("stop", answer.stop.word())?;
    let tables = PyDict::new(py);
    for table in answer.tables {
        let name = table.name.clone();
        tables.set_item(name, arrays(py, table)?)?;
    }
    result.set_item("tables", tables)?;
    Ok(result)
}

/// A table's columns by name. The vectors themselves change hands; words are their codes and a
/// vocabulary.
pub fn arrays(py: Python<'_>, table: Table) -> PyResult<Bound<'_, PyDict>> {
    let columns = PyDict::new(py);
    for column in table.columns {
        match column.cells {
            Cells::Numbers(values) => {
                columns.set_item(column.name, PyArray1::from_vec(py, values))?
            }
            Cells::Integers(values) => {
                columns.set_item(column.name, PyArray1::from_vec(py, values))?
            }
            Cells::Words(words) => {
                let vocabulary = PyList::new(py, words.vocabulary)?;
                columns.set_item(column.name, (PyArray1::from_vec(py, words.codes), vocabulary))?;
            }
        }
    }
    Ok(columns)
}

/// An answer: facts as JSON, tables as arrays.
pub fn handed<'py>(
    py: Python<'py>,
    hash: &str,
    facts: &Value,
    tables: Vec<Table>,
) -> PyResult<Bound<'py, PyDict>> {
    let result = PyDict::new(py);
    result.set_item("hash", hash)?;
    result.set_item("facts", facts.to_string())?;
    let named = PyDict::new(py);
    for table in tables {
        let name = table.name.clone();
        named.set_item(name, arrays(py, table)?)?;
    }
    result.set_item("tables", named)?;
    Ok(result)
}

/// Answer to the question of a command with these flags.
#[pyfunction]
#[pyo3(signature = (command, flags, threads, show=None))]
pub fn ask<'py>(
    py: Python<'py>,
    command: &str,
    flags: Vec<String>,
    threads: usize,
    show: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let wrong = |e: CliError| errors::SpecError::new_err((e.to_string(), "flags"));
    let (hash, facts, tables) = match asked(command, flags).map_err(wrong)? {
        Asked::Question(question) => supervise(py, show, move |work| {
            let answer = Executor::new(None, work).ask(&*question)?;
            if answer.stop == Stop::Interrupted {
                return Err(JobError::Interrupted);
            }
            Ok((answer.hash(), json!(answer.facts), answer.tables.clone()))
        })?,
        Asked::Scan(scan) => supervise(py, show, move |work| {
            let runs = scan.runs();
            work.says(&format!("{runs} runs"));
            work.finished(0, 1);
            let found = pool(threads)?.install(|| scan.compute(&Counted { work, runs }));
            if found.finished < runs {
                return Err(JobError::Interrupted);
            }
            let first = found.first_error.map(|e| e.to_string());
            let facts = json!({ "runs": runs, "failed": found.failed, "first_error": first });
            let hash = Hash::of(&encode::bits(std::slice::from_ref(&found.table)));
            Ok((hash, facts, vec![found.table]))
        })?,
        Asked::Sweep(_) => {
            let text = "a sweep has rows and their bytes: ask by outcomes";
            return Err(errors::SpecError::new_err((text, "command")));
        }
    };
    handed(py, hash.as_str(), &facts, tables)
}

/// Counts the finished runs of a scan.
struct Counted<'a> {
    work: &'a Work,
    runs: u64,
}

impl Monitor for Counted<'_> {
    fn reached(&self, finished: f64) -> ControlFlow<()> {
        self.work.finished(finished as usize, self.runs as usize);
        if self.work.stopped() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// A run as the bytes that `twofold run` writes: `format` is "csv" or "json".
#[pyfunction]
#[pyo3(signature = (text, format, show=None))]
pub fn written(
    py: Python<'_>,
    text: &str,
    format: &str,
    show: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<u8>> {
    let spec = spec(text)?;
    let as_csv = match format {
        "csv" => true,
        "json" => false,
        other => {
            let text = format!("format is {other:?}: give \"csv\" or \"json\"");
            return Err(errors::SpecError::new_err((text, "format")));
        }
    };
    supervise(py, show, move |work| {
        let run = Run(spec);
        let answer = answer_to(run.0.clone(), work)?;
        let about = json!({ "kind": run.kind(), "question": run.json(), "stop": answer.stop });
        Ok(if as_csv { encode::csv_of_run(&run, &answer) } else { encode::json(&answer, &about) })
    })
}

/// Attractor of a run: the evidence as JSON.
#[pyfunction]
#[pyo3(signature = (text, show=None))]
pub fn classify(py: Python<'_>, text: &str, show: Option<&Bound<'_, PyAny>>) -> PyResult<String> {
    let spec = spec(text)?;
    supervise(py, show, move |work| {
        let evidence = Classification::of(spec).ask(&Executor::new(None, work))?;
        Ok(json!(evidence).to_string())
    })
}

/// A sweep over axes: its rows as arrays, and as the bytes that `twofold sweep` writes. `random` is
/// how often random axes are drawn, and their seed.
#[pyfunction]
#[pyo3(signature = (text, over, random, threads, show=None))]
pub fn sweep<'py>(
    py: Python<'py>,
    text: &str,
    over: Vec<String>,
    random: Option<(u64, u64)>,
    threads: usize,
    show: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Vec<u8>)> {
    let wrong = |what: String| errors::SpecError::new_err((what, "over"));
    let axes = over
        .iter()
        .map(|axis| axis.parse::<Axis>().map_err(|e| wrong(e.to_string())))
        .collect::<PyResult<_>>()?;
    let random = random.map(|(count, seed)| Draws { count, seed });
    let sweep = Sweep::new(spec(text)?, axes, random).map_err(|e| wrong(e.to_string()))?;
    swept(py, sweep, threads, show)
}

/// The sweep that these flags of `twofold sweep` describe, in the same form.
#[pyfunction]
#[pyo3(signature = (flags, threads, show=None))]
pub fn outcomes<'py>(
    py: Python<'py>,
    flags: Vec<String>,
    threads: usize,
    show: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Vec<u8>)> {
    let wrong = |what: String| errors::SpecError::new_err((what, "flags"));
    match asked("sweep", flags).map_err(|e| wrong(e.to_string()))? {
        Asked::Sweep(sweep) => swept(py, *sweep, threads, show),
        _ => Err(wrong("no sweep".into())),
    }
}

/// Rows of a sweep as arrays, and as bytes.
fn swept<'py>(
    py: Python<'py>,
    sweep: Sweep,
    threads: usize,
    show: Option<&Bound<'py, PyAny>>,
) -> PyResult<(Bound<'py, PyDict>, Vec<u8>)> {
    let rows = supervise(py, show, move |work| {
        let numbers: Vec<u64> = Shard::WHOLE.rows(&sweep).collect();
        let made = side_by_side(numbers, threads, work, |_, number| sweep.row(number, work))?;
        let mut rows = Rows::of(sweep);
        for row in made {
            rows.insert(row).map_err(|e| JobError::Other(e.to_string()))?;
        }
        Ok(rows)
    })?;
    Ok((arrays(py, rows.table())?, rows.csv()))
}

/// Outcomes of runs from these starts, in their order: a JSON object each, with "outcome" or
/// "error".
#[pyfunction]
#[pyo3(signature = (text, starts, threads, show=None))]
pub fn fates(
    py: Python<'_>,
    text: &str,
    starts: Vec<Vec<f64>>,
    threads: usize,
    show: Option<&Bound<'_, PyAny>>,
) -> PyResult<Vec<String>> {
    let spec = spec(text)?;
    for start in &starts {
        RunSpec { start: start.clone(), ..spec.clone() }
            .validate()
            .map_err(|e| errors::spec(&e))?;
    }
    supervise(py, show, move |work| {
        side_by_side(starts, threads, work, |k, start| {
            Ok(outcome(&spec, k, start, work)?.to_string())
        })
    })
}

/// A pool that is made for one call: a global one would not survive a fork.
pub fn pool(threads: usize) -> Result<rayon::ThreadPool, JobError> {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    pool.map_err(|e| JobError::Other(format!("{threads} threads could not be started: {e}")))
}

/// Independent jobs on a pool of threads, their results in order.
fn side_by_side<A: Send, B: Send>(
    jobs: Vec<A>,
    threads: usize,
    work: &Work,
    job: impl Fn(usize, A) -> Result<B, JobError> + Sync,
) -> Result<Vec<B>, JobError> {
    let pool = pool(threads)?;
    let (all, done) = (jobs.len(), AtomicUsize::new(0));
    work.says(&format!("{all} runs"));
    work.finished(0, all);
    let one = |(k, asked): (usize, A)| {
        if work.stopped() {
            return Err(JobError::Interrupted);
        }
        let answer = job(k, asked)?;
        work.finished(done.fetch_add(1, Ordering::Relaxed) + 1, all);
        Ok(answer)
    };
    pool.install(|| jobs.into_par_iter().enumerate().map(one).collect())
}

/// The outcome of start number `k`, counted from 0.
fn outcome(spec: &RunSpec, k: usize, start: Vec<f64>, work: &Work) -> Result<Value, JobError> {
    let mut run = RunSpec { start, ..spec.clone() };
    // Chance of its own in every run, as the rows of a sweep have it.
    let more = k as u64;
    if let Some(kick) = &mut run.schedule.kick {
        kick.stream = kick.stream.wrapping_add(more);
    }
    if let SwitchSpec::Filippov { exit: ExitRule::Random { stream, .. }, .. } = &mut run.switch {
        *stream = stream.wrapping_add(more);
    }
    let answer = Executor::new(None, work).ask(&OutcomeQuestion(Classification::of(run)));
    match answer.and_then(|a| Ok(a.fact::<Outcome>("outcome")?)) {
        Ok(outcome) => Ok(json!({ "outcome": outcome })),
        Err(JobError::Interrupted) => Err(JobError::Interrupted),
        Err(error) => Ok(json!({ "error": error.to_string() })),
    }
}
