//! A paper's folder, asked from Python.

use std::path::Path;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::json;
use twofold::folder::{Folder, FolderError};
use twofold::job::{Executor, JobError, Store};

use crate::answers::{handed, pool};
use crate::errors;
use crate::supervise::{Work, supervise};

fn read(folder: &str) -> PyResult<Folder> {
    Folder::read(Path::new(folder)).map_err(|e| match e {
        FolderError::Text(problem) => errors::diagnostic(&problem),
        other => errors::definition(other.to_string()),
    })
}

fn executor<'a>(folder: &Folder, keep: bool, work: &'a Work) -> Executor<'a> {
    Executor::new(keep.then(|| Store::new(folder.out().join(".store"))), work)
}

/// Content of a folder, as JSON.
#[pyfunction]
pub fn paper(folder: &str) -> PyResult<String> {
    let folder = read(folder)?;
    let about = &folder.about;
    let figures: Vec<_> = folder
        .figures
        .iter()
        .zip(&folder.shows)
        .map(|(figure, shows)| json!({ "id": figure.id, "title": figure.title, "shows": shows }))
        .collect();
    let claims: Vec<_> = folder
        .claims
        .iter()
        .map(|c| {
            json!({ "id": c.id, "place": c.place, "says": c.says, "decided": c.decided,
            "check": c.kind(), "note": c.note })
        })
        .collect();
    Ok(json!({
        "title": about.title, "authors": about.authors, "year": about.year,
            "journal": about.journal, "doi": about.doi,
        "arxiv": about.arxiv, "summary": about.summary, "open": about.open, "figures": figures,
            "claims": claims,
        "sources": folder.sources.keys().collect::<Vec<_>>(),
    })
    .to_string())
}

/// The answer to a panel or measure: tables as arrays, facts as JSON.
#[pyfunction]
#[pyo3(signature = (folder, name, keep, show=None))]
pub fn paper_answer<'py>(
    py: Python<'py>,
    folder: &str,
    name: &str,
    keep: bool,
    show: Option<&Bound<'py, PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    let folder = read(folder)?;
    let Some(source) = folder.sources.get(name) else {
        let known: Vec<&str> = folder.sources.keys().map(String::as_str).collect();
        let why = format!("there is no panel or measure {name:?}; there are {}", known.join(", "));
        return Err(errors::SpecError::new_err((why, "name")));
    };
    let question = source.question.clone();
    let (answer, hash) = supervise(py, show, move |work| {
        let answer = executor(&folder, keep, work).ask(&*question)?;
        let hash = answer.hash();
        Ok((answer, hash))
    })?;
    handed(py, hash.as_str(), &json!(answer.facts), answer.tables.clone())
}

/// Verdicts on the claims, as a JSON list.
#[pyfunction]
#[pyo3(signature = (folder, threads, keep, show=None))]
pub fn paper_claims(
    py: Python<'_>,
    folder: &str,
    threads: usize,
    keep: bool,
    show: Option<&Bound<'_, PyAny>>,
) -> PyResult<String> {
    let folder = read(folder)?;
    supervise(py, show, move |work| {
        let executor = executor(&folder, keep, work);
        pool(threads)?.install(|| {
            let mut asked = Vec::new();
            for claim in &folder.claims {
                asked.extend(claim.questions(&folder).map_err(|e| JobError::Other(e.to_string()))?);
            }
            executor.gather(&asked);
            let verdicts = folder.claims.iter().map(|claim| claim.judge(&folder, &executor));
            Ok(json!(verdicts.collect::<Result<Vec<_>, _>>()?).to_string())
        })
    })
}
