//! The paper's figures and the embedded references.

use pyo3::prelude::*;
use serde_json::{Value, json};
use twofold::jeffrey_2013::study::verdict_table as verdicts_as_table;
use twofold::paper::figures;
use twofold::record::Manifest;

use crate::errors::InternalError;

/// The references that were published with this version.
fn manifests() -> PyResult<Vec<Manifest>> {
    let texts = figures::all()
        .into_iter()
        .filter_map(|f| figures::reference(&f.id).map(|text| (f.id, text)));
    texts
        .map(|(id, text)| Manifest::parse(text, &id))
        .collect::<Result<_, _>>()
        .map_err(|e| InternalError::new_err((e.to_string(),)))
}

/// Every panel of every figure that is made of runs, as a JSON list: what is asked, the hash that
/// the answer must have, and the published verdict.
#[pyfunction]
pub fn panels() -> PyResult<String> {
    let manifests = manifests()?;
    let mut list = Vec::new();
    for figure in figures::all() {
        for picture in &figure.pictures {
            let reference = manifests
                .iter()
                .find(|m| m.figure == figure.id)
                .and_then(|m| m.picture(&picture.name));
            for panel in &picture.panels {
                let entry =
                    reference.and_then(|p| p.panels.iter().find(|e| e.label == panel.label));
                let verdict = entry
                    .and_then(|e| e.verdict.as_ref())
                    .map(|v| json!({ "claim": v.claim, "found": v.found, "agrees": v.agrees }));
                let value: Value = json!({
                    "figure": figure.id,
                    "title": figure.title,
                    "reading": picture.reading_name(),
                    "panel": panel.label,
                    "panel_title": panel.title,
                    "spec": panel.run,
                    "hash": entry.map(|e| e.data.as_str()),
                    "verdict": verdict,
                });
                list.push(value);
            }
        }
    }
    Ok(Value::Array(list).to_string())
}

/// The table of verdicts of docs/findings.md, in Markdown.
#[pyfunction]
pub fn verdict_table() -> PyResult<String> {
    Ok(verdicts_as_table::table(&manifests()?))
}
