//! A paper's folder, asked from Python.

use std::path::Path;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value, json};
use twofold::folder::{Folder, FolderError};
use twofold::job::{Executor, JobError, Store};
use twofold::paper::View;
use twofold::paper::pipeline::questions;
use twofold::paper::verdict::judge;

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
        "sources": folder.sources.keys().collect::<Vec<_>>(), "points": points(&folder),
    })
    .to_string())
}

/// Numbers of the paper that panels are drawn with, by panel.
fn points(folder: &Folder) -> Map<String, Value> {
    let mut all = Map::new();
    for figure in &folder.figures {
        for picture in &figure.pictures {
            let View::Plots(plots) = &picture.view else { continue };
            for plot in &plots.plots {
                let Some(points) = &plot.points else { continue };
                let axis = |i: usize| points.points.iter().map(|p| p[i]).collect::<Vec<_>>();
                all.insert(
                    format!("{}/{}", figure.id, plot.label),
                    json!({ "x": axis(0), "y": axis(1) }),
                );
            }
        }
    }
    all
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
                let questions = claim.questions(&folder);
                let questions = questions.map_err(|e| JobError::Other(e.to_string()))?;
                asked.extend(questions.into_iter().map(|(_, question)| question));
            }
            executor.gather(&asked);
            let scored = folder.claims.iter().map(|claim| match claim.judge(&folder, &executor) {
                Ok(verdict) => Ok(json!(verdict)),
                Err(JobError::Interrupted) => Err(JobError::Interrupted),
                Err(why) => {
                    Ok(json!({ "claim": claim.id, "agrees": null, "found": why.to_string() }))
                }
            });
            Ok(json!(scored.collect::<Result<Vec<_>, _>>()?).to_string())
        })
    })
}

/// Verdicts on what panels say of themselves, as a JSON list.
#[pyfunction]
#[pyo3(signature = (folder, threads, keep, show=None))]
pub fn paper_verdicts(
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
            executor.gather(&questions(folder.figures.iter().flat_map(|f| &f.pictures)));
            let mut found = Vec::new();
            for figure in &folder.figures {
                for picture in &figure.pictures {
                    let verdicts = judge(picture, &executor)?;
                    found.extend(verdicts.into_iter().map(|v| {
                        json!({ "figure": figure.id, "panel": v.panel, "reading": v.reading,
                            "claim": v.claim_text, "found": v.found, "agrees": v.agrees })
                    }));
                }
            }
            Ok(json!(found).to_string())
        })
    })
}
