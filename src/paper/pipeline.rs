//! From pictures to bytes: independent runs side by side, collected in order.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::verdict::{PanelVerdict, judge};
use super::{Picture, Reading, Study, View, drawing};
use crate::cli::progress::Progress;
use crate::integrate::Statistics;
use crate::job::encode;
use crate::job::simulate::{Recording, RunError, simulate};
use crate::job::spec::RunSpec;
use crate::record::hash::canonical_json;
use crate::record::{Hash, PanelEntry, PictureEntry};
use crate::render::{Pixels, RenderError, Rendered, render};

/// A computed picture: its files' bytes and what is known about them.
#[derive(Clone, Debug)]
pub struct Computed {
    /// PNG, SVG and PDF.
    pub rendered: Rendered,
    /// CSV per panel: (label, bytes).
    pub tables: Vec<(String, Vec<u8>)>,
    /// What is known about the picture, as it is written beside it.
    pub record: PictureRecord,
    /// The recorded runs, panel by panel.
    pub recordings: Vec<Recording>,
}

/// What is known about a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureRecord {
    /// Hashes of every layer.
    pub hashes: PictureEntry,
    /// The heading; empty in records of before it was kept.
    #[serde(default)]
    pub title: String,
    /// The parameter reading.
    pub reading: Option<Reading>,
    /// The caption.
    pub caption: String,
    /// How it differs from the published picture; empty for the real thing.
    pub alterations: Vec<String>,
    /// Its panels.
    pub panels: Vec<PanelRecord>,
    /// Verdicts on the paper's claims; empty until they are asked for.
    pub verdicts: Vec<PanelVerdict>,
    /// What a study depends on; absent for pictures of runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub question: Option<serde_json::Value>,
}

/// What is known about a panel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelRecord {
    /// Label.
    pub label: String,
    /// Title.
    pub title: String,
    /// The run.
    pub run: RunSpec,
    /// Recorded points.
    pub points: usize,
    /// Final time.
    pub t: f64,
    /// Final state.
    pub state: [f64; 3],
    /// Work done.
    pub statistics: Statistics,
    /// The largest number of steps between restarts; NDSolve's default limit is 10,000.
    pub most_steps_in_segment: u64,
}

/// A picture that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// A run failed.
    #[error("{picture} ({panel}): {source}")]
    Run {
        /// The picture.
        picture: String,
        /// The panel.
        panel: String,
        /// Why.
        source: RunError,
    },
    /// The drawing failed.
    #[error("{picture}: {source}")]
    Render {
        /// The picture.
        picture: String,
        /// Why.
        source: RenderError,
    },
}

/// The hash of a decoded picture: width and height (little-endian), then RGBA row by row.
pub fn pixel_hash(pixels: &Pixels) -> Hash {
    let mut bytes = Vec::with_capacity(8 + pixels.rgba.len());
    bytes.extend_from_slice(&pixels.width.to_le_bytes());
    bytes.extend_from_slice(&pixels.height.to_le_bytes());
    bytes.extend_from_slice(&pixels.rgba);
    Hash::of(&bytes)
}

/// Computes and draws one picture. The result does not depend on the number of threads.
pub fn compute(picture: &Picture, progress: &Progress) -> Result<Computed, PipelineError> {
    if let View::Study(study) = &picture.view {
        return compute_study(picture, study, progress);
    }
    let recordings: Vec<Recording> = picture
        .panels
        .par_iter()
        .map(|panel| {
            let watch = progress.run(format!("{} ({})", picture.name, panel.label), panel.run.t_end);
            let result = simulate(&panel.run, &watch).map_err(|source| PipelineError::Run {
                picture: picture.name.clone(),
                panel: panel.label.clone(),
                source,
            });
            match &result {
                Ok(r) => watch.done(&format!("{} steps, {} points", r.statistics.steps, r.data.len())),
                Err(_) => watch.done("failed"),
            }
            result
        })
        .collect::<Vec<_>>()
        .into_iter()
        .collect::<Result<_, _>>()?;

    let entries: Vec<PanelEntry> = picture
        .panels
        .iter()
        .zip(&recordings)
        .map(|(panel, recording)| PanelEntry {
            label: panel.label.clone(),
            spec: Hash::of_json(&panel.run),
            data: Hash::of(&encode::bits(&panel.run, &recording.data)),
        })
        .collect();
    let spec = Hash::of(&canonical_json(&picture.panels.iter().map(|p| (&p.label, &p.run)).collect::<Vec<_>>()));
    let data = Hash::of(entries.iter().map(|e| e.data.as_str()).collect::<Vec<_>>().join("\n").as_bytes());

    let sheet = drawing::sheet(picture, &recordings, &spec, &data);
    let rendered = render(&sheet).map_err(|source| PipelineError::Render { picture: picture.name.clone(), source })?;
    let hashes = picture_entry(picture, spec, data, &rendered, entries);
    let panels = picture
        .panels
        .iter()
        .zip(&recordings)
        .map(|(panel, r)| PanelRecord {
            label: panel.label.clone(),
            title: panel.title.clone(),
            run: panel.run,
            points: r.data.len(),
            t: r.t,
            state: r.x,
            statistics: r.statistics.clone(),
            most_steps_in_segment: r.most_steps_in_segment,
        })
        .collect();
    let tables = picture
        .panels
        .iter()
        .zip(&recordings)
        .map(|(panel, r)| (panel.label.clone(), encode::csv(&panel.run, &r.data)))
        .collect();
    let record = PictureRecord {
        hashes,
        title: picture.title.to_owned(),
        reading: picture.reading,
        caption: picture.caption.clone(),
        alterations: picture.alterations.clone(),
        panels,
        verdicts: Vec::new(),
        question: None,
    };
    Ok(Computed { rendered, tables, record, recordings })
}

/// Computes and draws a study.
fn compute_study(picture: &Picture, study: &Study, progress: &Progress) -> Result<Computed, PipelineError> {
    let watch = progress.run(picture.name.clone(), 1.0);
    let tables = (study.compute)().map_err(|source| PipelineError::Run {
        picture: picture.name.clone(),
        panel: "study".into(),
        source,
    })?;
    watch.done(&format!("{} rows", tables.iter().map(|t| t.rows.len()).sum::<usize>()));
    let question = (study.question)();
    let spec = Hash::of_json(&question);
    let panels: Vec<PanelEntry> = tables
        .iter()
        .map(|t| PanelEntry { label: t.name.clone(), spec: spec.clone(), data: Hash::of(&t.bits()) })
        .collect();
    let data = Hash::of(panels.iter().map(|e| e.data.as_str()).collect::<Vec<_>>().join("\n").as_bytes());
    let sheet = drawing::study_sheet(picture, (study.draw)(&tables), &spec, &data);
    let rendered = render(&sheet).map_err(|source| PipelineError::Render { picture: picture.name.clone(), source })?;
    let hashes = picture_entry(picture, spec, data, &rendered, panels);
    let record = PictureRecord {
        title: picture.title.to_owned(),
        hashes,
        reading: picture.reading,
        caption: picture.caption.clone(),
        alterations: picture.alterations.clone(),
        panels: Vec::new(),
        verdicts: Vec::new(),
        question: Some(question),
    };
    let tables = tables.iter().map(|t| (t.name.clone(), t.csv())).collect();
    Ok(Computed { rendered, tables, record, recordings: Vec::new() })
}

fn picture_entry(
    picture: &Picture,
    spec: Hash,
    data: Hash,
    rendered: &Rendered,
    panels: Vec<PanelEntry>,
) -> PictureEntry {
    PictureEntry {
        name: picture.name.clone(),
        spec,
        data,
        pixels: pixel_hash(&rendered.pixels),
        png: Hash::of(&rendered.png),
        svg: Hash::of(&rendered.svg),
        pdf: Hash::of(&rendered.pdf),
        panels,
    }
}

impl Computed {
    /// Adds the verdicts on the paper's claims to the record.
    pub fn judge(&mut self, picture: &Picture) -> Result<(), PipelineError> {
        self.record.verdicts = judge(picture, &self.recordings).map_err(|source| PipelineError::Run {
            picture: picture.name.clone(),
            panel: "verdict".into(),
            source,
        })?;
        Ok(())
    }
}
