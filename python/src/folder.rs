//! A paper's folder, asked from Python.

use std::path::Path;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde_json::{Map, Value, json};
use twofold::cli::CliError;
use twofold::folder::make::Scored;
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
            "check": c.kind(), "quote": c.quote, "note": c.note })
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
#[pyo3(signature = (folder, name, threads, keep, show=None))]
pub fn paper_answer<'py>(
    py: Python<'py>,
    folder: &str,
    name: &str,
    threads: usize,
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
        let executor = executor(&folder, keep, work);
        pool(threads)?.install(|| {
            // Its parts are computed side by side.
            executor.gather(std::slice::from_ref(&question));
            let answer = executor.ask(&*question)?;
            let hash = answer.hash();
            Ok((answer, hash))
        })
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
    let refused = |e: CliError| errors::definition(e.to_string());
    let known = folder.known().map_err(refused)?;
    supervise(py, show, move |work| {
        let executor = executor(&folder, keep, work);
        let failed = |e: CliError| JobError::Other(e.to_string());
        pool(threads)?.install(|| {
            executor.gather(&folder.claims_ask(&executor).map_err(failed)?);
            let scored = folder.score(&known, &executor);
            let scored = scored.into_iter().map(|Scored { claim, verdict }| match verdict {
                Ok(v) => Ok(json!({ "id": claim.id, "agrees": v.agrees, "found": v.found,
                    "odds": v.odds, "rule_after_data": v.rule_after_data,
                    "words_after_data": v.words_after_data })),
                Err(JobError::Interrupted) => Err(JobError::Interrupted),
                Err(why) => Ok(json!({ "id": claim.id, "agrees": null, "found": why.to_string() })),
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
                            "claim": v.claim_text, "found": v.found, "agrees": v.agrees,
                            "because": v.because })
                    }));
                }
            }
            Ok(json!(found).to_string())
        })
    })
}
