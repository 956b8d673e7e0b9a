//! From pictures to bytes: questions asked, answers judged and drawn.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};

use super::plots::Points;
use super::verdict::{self, PanelVerdict, judge};
use super::{Picture, View, drawing};
use twofold_integrate::Statistics;
use twofold_job::question::question_hash;
use twofold_job::record::{FileError, Hash, PanelEntry, PictureEntry, VerdictEntry};
use twofold_job::spec::RunSpec;
use twofold_job::{Answer, AnyQuestion, JobError, Recording, Run, Stop, Table};
use twofold_job::{Ask, encode};
use twofold_render::{Pixels, RenderError, Rendered, render};

/// A computed picture and its record.
#[derive(Clone, Debug)]
pub struct Computed {
    /// PNG, SVG and PDF.
    pub rendered: Rendered,
    /// The record that is written beside the picture.
    pub record: PictureRecord,
}

/// The record of a picture.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PictureRecord {
    /// Hashes of every layer.
    pub hashes: PictureEntry,
    /// The heading.
    pub title: String,
    /// The parameter reading.
    pub reading: Option<String>,
    /// The caption.
    pub caption: String,
    /// Differences from the published picture; empty if there are none.
    pub alterations: Vec<String>,
    /// Its panels, if it is made of runs.
    pub panels: Vec<PanelRecord>,
    /// Verdicts on the paper's claims.
    pub verdicts: Vec<PanelVerdict>,
    /// Its questions, if it is not made of runs.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub questions: Vec<Value>,
    /// The tables' files, name and digest.
    pub tables: Vec<TableRecord>,
}

impl PictureRecord {
    /// As it is written beside the picture, NAME.json.
    pub fn to_json(&self) -> Vec<u8> {
        let mut json = serde_json::to_vec_pretty(self).expect("a record is plain data");
        json.push(b'\n');
        json
    }

    /// The files that it vouches for: name and digest of the picture's own, then of its tables'.
    pub fn files(&self) -> Vec<(String, &Hash)> {
        let PictureEntry { name, png, svg, pdf, .. } = &self.hashes;
        let drawn = [("png", png), ("svg", svg), ("pdf", pdf)]
            .map(|(ending, hash)| (format!("{name}.{ending}"), hash));
        drawn.into_iter().chain(self.tables.iter().map(|t| (t.file.clone(), &t.sha256))).collect()
    }
}

/// The record of a table's file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TableRecord {
    /// The file's name.
    pub file: String,
    /// The panel whose numbers it holds, if it is made of runs.
    pub panel: Option<String>,
    /// Digest of the file.
    pub sha256: Hash,
    /// Rows.
    pub rows: usize,
}

/// The record of a panel.
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
    /// Why the run ended.
    pub stop: Stop,
    /// Work done.
    pub statistics: Statistics,
    /// The largest number of steps between restarts.
    pub most_steps_in_segment: u64,
}

/// A picture that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum PipelineError {
    /// A computation failed.
    #[error("{picture} ({part}): {source}")]
    Job {
        /// The picture.
        picture: String,
        /// The panel, or what else was computed.
        part: String,
        /// Why.
        source: JobError,
    },
    /// The drawing failed.
    #[error("{picture}: {source}")]
    Render {
        /// The picture.
        picture: String,
        /// Why.
        source: RenderError,
    },
    /// A table's file could not be written.
    #[error(transparent)]
    Table(#[from] FileError),
}

/// The hash of a decoded picture: width and height (little-endian), then RGBA row by row.
pub fn pixel_hash(pixels: &Pixels) -> Hash {
    Hash::of_parts([&pixels.width.to_le_bytes()[..], &pixels.height.to_le_bytes(), &pixels.rgba])
}

/// Numbers of the paper that are drawn over a panel.
fn points_of<'a>(picture: &'a Picture, label: &str) -> Option<&'a Points> {
    let View::Plots(plots) = &picture.view else { return None };
    plots.plots.iter().find(|p| p.label == label)?.points.as_ref()
}

/// Questions of a picture's panels, label by label; a study's questions are named after their kind.
pub(super) fn parts(picture: &Picture) -> Vec<(String, AnyQuestion)> {
    match &picture.view {
        View::Study(study) => {
            (study.questions)().into_iter().map(|q| (q.kind().to_owned(), q)).collect()
        }
        View::Plots(plots) => {
            plots.plots.iter().map(|p| (p.label.clone(), p.question.clone())).collect()
        }
        _ => picture
            .panels
            .iter()
            .map(|p| (p.label.clone(), Arc::new(Run(p.run.clone())) as AnyQuestion))
            .collect(),
    }
}

/// Everything that making these pictures will ask, so that it can be computed side by side, the
/// longest first.
pub fn questions<'a>(pictures: impl IntoIterator<Item = &'a Picture>) -> Vec<AnyQuestion> {
    let mut all = Vec::new();
    for picture in pictures {
        all.extend(parts(picture).into_iter().map(|(_, question)| question));
        all.extend((0..picture.panels.len()).flat_map(|i| verdict::questions(picture, i)));
    }
    all
}

/// Makes one picture from answers, asking `executor` for those that it does not have yet. A pure
/// view: the same answers give the same bytes.
///
/// # Errors
///
/// If a computation or the drawing failed.
pub fn compute(picture: &Picture, executor: &dyn Ask) -> Result<Computed, PipelineError> {
    compute_with_tables(picture, executor, &mut |_, _| Ok(()))
}

/// Receives a table's file: its name and its bytes.
pub type Keep<'a> = dyn FnMut(&str, &[u8]) -> Result<(), FileError> + 'a;

/// [`compute`], and hands a CSV file per table to `keep`, one after the other once the picture is
/// drawn: its name and its bytes. All of them together take more memory than everything else that a
/// picture needs.
///
/// # Errors
///
/// As [`compute`], or what `keep` says.
pub fn compute_with_tables(
    picture: &Picture,
    executor: &dyn Ask,
    keep: &mut Keep<'_>,
) -> Result<Computed, PipelineError> {
    let failed = |part: &str| {
        let (picture, part) = (picture.name.clone(), part.to_owned());
        move |source: JobError| PipelineError::Job { picture, part, source }
    };
    let parts = parts(picture);
    let answers = parts
        .iter()
        .map(|(part, question)| executor.ask(&**question).and_then(finished).map_err(failed(part)))
        .collect::<Result<Vec<Arc<Answer>>, _>>()?;
    let verdicts = judge(picture, executor).map_err(failed("verdict"))?;

    let entries: Vec<PanelEntry> = parts
        .iter()
        .zip(&answers)
        .map(|((label, question), answer)| PanelEntry {
            label: label.clone(),
            spec: question_hash(&**question),
            data: points_of(picture, label)
                .map_or_else(|| answer.hash(), |points| points.hash_over(&answer.hash())),
            verdict: verdicts.iter().find(|v| v.panel == *label).map(|v| VerdictEntry {
                claim: v.claim_text.clone(),
                found: v.found.clone(),
                agrees: v.agrees,
                sha256: Hash::of_json(v),
            }),
        })
        .collect();
    let joined = |hash: fn(&PanelEntry) -> Option<&Hash>| {
        let hashes: Vec<String> = entries
            .iter()
            .map(|e| format!("{} {}", e.label, hash(e).map_or("none", Hash::as_str)))
            .collect();
        Hash::of(hashes.join("\n").as_bytes())
    };
    let (spec, data) = (joined(|e| Some(&e.spec)), joined(|e| Some(&e.data)));
    let verdict = joined(|e| e.verdict.as_ref().map(|v| &v.sha256));

    let mut panels = Vec::new();
    let drawn = match &picture.view {
        View::Study(study) => drawing::study_sheet(picture, (study.draw)(&answers), &spec, &data),
        View::Plots(plots) => {
            let sheet =
                plots.sheet(&answers).map_err(|(part, why)| failed(&part)(JobError::Other(why)))?;
            drawing::study_sheet(picture, sheet, &spec, &data)
        }
        _ => {
            let mut recordings = Vec::new();
            for (panel, answer) in picture.panels.iter().zip(&answers) {
                let recording = <Recording>::of_answer(&panel.run, answer)
                    .map_err(|e| failed(&panel.label)(e.into()))?;
                panels.push(PanelRecord {
                    label: panel.label.clone(),
                    title: panel.title.clone(),
                    run: panel.run.clone(),
                    points: recording.data.len(),
                    t: recording.t,
                    state: recording.x,
                    stop: answer.stop,
                    statistics: recording.statistics.clone(),
                    most_steps_in_segment: recording.most_steps_in_segment,
                });
                recordings.push(recording);
            }
            drawing::sheet(picture, &recordings, &verdicts, &spec, &data)
                .map_err(failed("drawing"))?
        }
    };
    let rendered = render(&drawn)
        .map_err(|source| PipelineError::Render { picture: picture.name.clone(), source })?;

    let runs = !panels.is_empty();
    let labelled = !matches!(picture.view, View::Study(_));
    let table_records = write_tables(picture, labelled, &parts, &answers, keep)?;
    let hashes = PictureEntry {
        name: picture.name.clone(),
        spec,
        data,
        verdict,
        pixels: pixel_hash(&rendered.pixels),
        png: Hash::of(&rendered.png),
        svg: Hash::of(&rendered.svg),
        pdf: Hash::of(&rendered.pdf),
        panels: entries,
    };
    let record = PictureRecord {
        hashes,
        title: picture.title.clone().into_owned(),
        reading: picture.reading_name().map(str::to_owned),
        caption: picture.caption.clone(),
        alterations: picture.alterations.clone(),
        panels,
        verdicts,
        questions: if runs { Vec::new() } else { parts.iter().map(|(_, q)| q.json()).collect() },
        tables: table_records,
    };
    Ok(Computed { rendered, record })
}

/// Hands over a CSV file per table, and says what is recorded of them. Tables of one name are one
/// file: a study may ask the same of several parameters.
fn write_tables(
    picture: &Picture,
    labelled: bool,
    parts: &[(String, AnyQuestion)],
    answers: &[Arc<Answer>],
    keep: &mut Keep<'_>,
) -> Result<Vec<TableRecord>, FileError> {
    struct File<'a> {
        ending: String,
        panel: Option<String>,
        tables: Vec<&'a Table>,
        about: Vec<Value>,
    }
    let mut files: Vec<File<'_>> = Vec::new();
    for ((label, question), answer) in parts.iter().zip(answers) {
        let about = json!({ "kind": question.kind(), "question_sha256": question_hash(&**question),
            "stop": answer.stop });
        for table in &answer.tables {
            // A run's main table is called after its panel.
            let ending = match (labelled, table.name.as_str()) {
                (true, "path" | "section" | "motion") => label.clone(),
                (true, other) => format!("{label}-{other}"),
                (false, other) => other.to_owned(),
            };
            match files.iter_mut().find(|f| f.ending == ending) {
                Some(file) => {
                    file.tables.push(table);
                    file.about.push(about.clone());
                }
                None => files.push(File {
                    ending,
                    panel: labelled.then(|| label.clone()),
                    tables: vec![table],
                    about: vec![about.clone()],
                }),
            }
        }
    }
    let mut records = Vec::new();
    for File { ending, panel, tables, about } in files {
        let bytes = encode::csv_of_parts(&tables, &Value::Array(about));
        let record = TableRecord {
            file: format!("{}-{ending}.csv", picture.name),
            panel,
            sha256: Hash::of(&bytes),
            rows: tables.iter().map(|t| t.len()).sum(),
        };
        keep(&record.file, &bytes)?;
        records.push(record);
    }
    Ok(records)
}

/// An answer that may be published: half a run must not look like a whole one.
fn finished(answer: Arc<Answer>) -> Result<Arc<Answer>, JobError> {
    if answer.stop == Stop::Interrupted { Err(JobError::Interrupted) } else { Ok(answer) }
}
