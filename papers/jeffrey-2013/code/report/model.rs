//! The report as data. Its JSON is described by schemas/report.schema.json.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::space::SpaceView;
use crate::Reading;
use twofold_integrate::Statistics;
use twofold_job::record::{Hash, Layer, PictureEntry};
use twofold_job::spec::RunSpec;
use twofold_paper::compare::Comparison;

/// Version of the report's JSON.
pub const VERSION: u32 = 1;
/// NDSolve's default MaxSteps: the most steps that one call makes, and the reason why the paper
/// divides its runs.
pub const NDSOLVE_MAX_STEPS: u64 = 10_000;

/// Everything the page shows.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// "twofold-report".
    pub format: &'static str,
    /// [`VERSION`].
    pub version: u32,
    /// "twofold 0.1.0".
    pub made_by: String,
    /// The article that the figures belong to.
    pub article: Article,
    /// Counts.
    pub summary: Summary,
    /// The figures, in natural order of their folders' names.
    pub figures: Vec<FigureReport>,
    /// By which programs, on which machines and in what time the figures were made, as far as the
    /// folder says.
    pub making: Vec<Making>,
    /// Files that could not be read, a line each.
    pub problems: Vec<String>,
    /// Findings of docs/findings.md, as HTML; for the page alone.
    #[serde(skip)]
    pub findings: Vec<String>,
    /// Odds of docs/census.md and docs/parameters.md, as HTML; for the page alone.
    #[serde(skip)]
    pub odds: Vec<String>,
    /// Panels of docs/census.md with a run that shows the paper's outcome; for the page alone.
    #[serde(skip)]
    pub occurring: Option<Occurring>,
}

/// Panels of the census of which some run shows the paper's outcome.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occurring {
    /// In each reading, printed first.
    pub panels: [usize; 2],
    /// Number of panels.
    pub of: usize,
    /// Runs of each.
    pub runs: u64,
}

/// The file in the folder of the figures that says how they were made. It is the one file there
/// that holds times, and no figure depends on it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Makings {
    /// "twofold-making".
    pub format: String,
    /// Version of this file's form.
    pub version: u32,
    /// One entry for each call of the program that figures in the folder come from, the last one
    /// last.
    pub runs: Vec<Making>,
}

/// A call of the program that made figures.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Making {
    /// The figures that come from it.
    pub figures: Vec<String>,
    /// "twofold 0.2.0".
    pub program: String,
    /// The commit that the program was built from.
    pub commit: String,
    /// The compiler.
    pub compiler: String,
    /// The machine that it was built for.
    pub target: String,
    /// The build's profile.
    pub profile: String,
    /// Threads that computed.
    pub threads: usize,
    /// Whether answers kept from earlier calls could be used.
    pub store: bool,
    /// From the first question to the last file, in seconds.
    pub seconds: f64,
    /// Computations, the longest first; what is missing here came from the store.
    pub computed: Vec<Timed>,
}

/// A computation and the time it took.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Timed {
    /// Name of the computation.
    pub what: String,
    /// Seconds, beside whatever else was computed.
    pub seconds: f64,
}

impl Makings {
    /// With another call's entry; figures that it made again no longer come from an earlier one.
    pub fn with(mut self, making: Making) -> Self {
        for run in &mut self.runs {
            run.figures.retain(|f| !making.figures.contains(f));
        }
        self.runs.retain(|run| !run.figures.is_empty());
        self.runs.push(making);
        Self { format: "twofold-making".into(), version: 1, runs: self.runs }
    }
}

/// An article.
#[derive(Clone, Debug, Serialize)]
pub struct Article {
    /// Author.
    pub author: &'static str,
    /// Title.
    pub title: &'static str,
    /// Year.
    pub year: u32,
}

/// The article whose figures are recomputed.
pub const ARTICLE: Article = Article {
    author: "M. R. Jeffrey",
    title: "Singularities that induce a breakdown of determinism in mechanics",
    year: 2013,
};

/// Counts over all pictures. Altered pictures count nowhere but in `altered`.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Summary {
    /// Pictures as published.
    pub pictures: usize,
    /// Of these, the same as the reference in every layer.
    pub same: usize,
    /// Different from the reference.
    pub different: usize,
    /// Without a reference.
    pub without_reference: usize,
    /// Pictures that a user's flag altered.
    pub altered: usize,
    /// Files that are not what their record says, or are not there.
    pub damaged_files: usize,
    /// Claims and verdicts, by reading.
    pub readings: Vec<ReadingSummary>,
    /// Panels of pictures as published.
    pub panels: usize,
    /// Of these, panels computed by the method that NDSolve took by default: to the others its
    /// limit says nothing.
    pub panels_by_ndsolves_method: usize,
    /// Of those, panels in which some stretch between restarts takes more than
    /// [`NDSOLVE_MAX_STEPS`] steps.
    pub panels_beyond_ndsolve_limit: usize,
}

/// Claims and verdicts of one parameter reading.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ReadingSummary {
    /// The reading; none for figures that have no readings.
    pub reading: Option<Reading>,
    /// Claims of the paper that were judged.
    pub claims: usize,
    /// Number of these that hold.
    pub agree: usize,
    /// Kinds of findings, each with its number of panels, in order of appearance.
    pub found: Vec<Found>,
    /// Set if all noise-free sections of the reading end in the same way: then agreement with a
    /// claim of that way is no evidence for the reading.
    pub all_alike: Option<Found>,
}

/// A kind of finding.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Found {
    /// "periodic, period 1".
    pub kind: String,
    /// In how many panels.
    pub panels: usize,
}

/// A figure.
#[derive(Clone, Debug, Serialize)]
pub struct FigureReport {
    /// The folder's name, "fig7".
    pub id: String,
    /// The heading; the folder's name if no record gives one.
    pub title: String,
    /// Its pictures.
    pub pictures: Vec<PictureReport>,
    /// Pictures in the folder that no record speaks of.
    pub unrecorded: Vec<FileReport>,
    /// The unrecorded pictures' previews.
    #[serde(skip)]
    pub unrecorded_png: Vec<Preview>,
}

/// A picture.
#[derive(Clone, Debug, Serialize)]
pub struct PictureReport {
    /// File name without extension.
    pub name: String,
    /// The heading.
    pub title: String,
    /// The parameter reading.
    pub reading: Option<Reading>,
    /// The caption, plain text.
    pub caption: String,
    /// Differences from the published picture.
    pub alterations: Vec<String>,
    /// Description of the picture, for readers who cannot see it.
    pub description: String,
    /// Width and height in pixels, if the PNG file could be read.
    pub size: Option<[u32; 2]>,
    /// Hashes: spec and data from the record, pixels and files from the files as they are.
    pub hashes: PictureEntry,
    /// Its files.
    pub files: Vec<FileReport>,
    /// Its comparison with the committed reference.
    pub reference: Reference,
    /// Its panels.
    pub panels: Vec<PanelReport>,
    /// The paper's claims and whether they hold.
    pub verdicts: Vec<VerdictReport>,
    /// Bytes for the page.
    #[serde(skip)]
    pub images: Images,
    /// Its panels in space, for the page.
    #[serde(skip)]
    pub spaces: Vec<SpaceView>,
}

/// Previews of a picture as PNG files, as far as it is there: smaller, and in fewer colours
/// ([`PREVIEW_WIDTH`]).
#[derive(Clone, Debug, Default)]
pub struct Images {
    /// The picture as it is.
    pub actual: Option<Preview>,
    /// The committed one, where it is wanted for comparison.
    pub expected: Option<Preview>,
    /// The difference; of the pixels that one of its own stands for it shows the most different
    /// one.
    pub difference: Option<Preview>,
}

/// A preview.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Preview {
    /// The PNG file.
    pub png: Vec<u8>,
    /// Its width and height in pixels.
    pub size: [u32; 2],
}

/// Width of previews in pixels.
pub const PREVIEW_WIDTH: u32 = 960;

/// Comparison of a picture with the committed reference.
#[derive(Clone, Debug, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
pub enum Reference {
    /// The same in every layer.
    Same,
    /// Different.
    Different {
        /// The first layer that differs.
        layer: Layer,
        /// Panels whose spec or data differ, if that is the layer.
        panels: Vec<String>,
        /// The committed hashes.
        expected: Box<PictureEntry>,
        /// Difference of the pixels, if both pictures are there and have the same size.
        comparison: Option<Comparison>,
        /// Why there is no comparison, or what is to be known about it.
        note: Option<String>,
    },
    /// There is nothing to compare with.
    Missing {
        /// Why.
        why: String,
    },
    /// The picture was altered by a flag: it has no reference and needs none.
    Altered,
}

/// A file and what is known of it.
#[derive(Clone, Debug, Serialize)]
pub struct FileReport {
    /// Path inside the folder of the figures.
    pub path: String,
    /// Its role.
    pub role: Role,
    /// The panel whose numbers it holds.
    pub panel: Option<String>,
    /// Media type.
    pub media_type: &'static str,
    /// Length.
    pub bytes: u64,
    /// SHA-256; none if the file is not there.
    pub sha256: Option<Hash>,
    /// Whether it agrees with its record.
    pub integrity: Integrity,
}

/// Purpose of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Role {
    /// The picture as PNG.
    Png,
    /// The picture as SVG.
    Svg,
    /// The picture as PDF.
    Pdf,
    /// A panel's numbers.
    Data,
    /// The record.
    Record,
}

/// Whether a file agrees with its record.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Integrity {
    /// It is.
    Unchanged,
    /// It is not.
    Changed,
    /// It is not there.
    Missing,
    /// The record does not say.
    Unrecorded,
}

impl Integrity {
    /// In words.
    pub fn words(self) -> &'static str {
        match self {
            Self::Unchanged => "as recorded",
            Self::Changed => "changed since it was made",
            Self::Missing => "not there",
            Self::Unrecorded => "no hash recorded",
        }
    }
}

/// A panel.
#[derive(Clone, Debug, Serialize)]
pub struct PanelReport {
    /// Label, "ii".
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
    /// The most steps between two restarts.
    pub most_steps_in_segment: u64,
    /// Whether that is within [`NDSOLVE_MAX_STEPS`]; null for another method than NDSolve's.
    pub within_ndsolve_limit: Option<bool>,
}

/// A claim, what was found, and whether they agree.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct VerdictReport {
    /// The panel.
    pub panel: String,
    /// The method.
    pub method: String,
    /// The paper's claim.
    pub claim: String,
    /// Kind of the finding, in a word or two.
    pub kind: String,
    /// The finding, in one line.
    pub found: String,
    /// Whether they agree.
    pub agrees: bool,
    /// Why, or with what reservation.
    pub because: String,
    /// The verdict as it was recorded, with its evidence: for verdicts.json.
    #[serde(skip)]
    pub recorded: Value,
}

/// A verdict as the record beside a picture holds it. Its evidence is passed on unread.
#[derive(Clone, Debug, Deserialize)]
pub struct RecordedVerdict {
    /// The panel.
    pub panel: String,
    /// The method.
    pub method: String,
    /// The claim in words.
    pub claim_text: String,
    /// The finding.
    pub found: String,
    /// Whether they agree.
    pub agrees: bool,
    /// Why.
    pub because: String,
    /// The evidence.
    #[serde(default)]
    pub evidence: Value,
}

impl Report {
    /// The report as indented JSON with a final newline.
    pub fn to_json(&self) -> Vec<u8> {
        indented(self)
    }

    /// All verdicts of all pictures with their evidence, as indented JSON with a final newline.
    pub fn verdicts_json(&self) -> Vec<u8> {
        let verdicts: Vec<&Value> = self
            .figures
            .iter()
            .flat_map(|f| &f.pictures)
            .flat_map(|p| &p.verdicts)
            .map(|v| &v.recorded)
            .collect();
        indented(&serde_json::json!({
            "format": "twofold-verdicts",
            "version": VERSION,
            "made_by": self.made_by,
            "verdicts": verdicts,
        }))
    }
}

/// JSON for files.
pub(super) fn indented<T: Serialize>(value: &T) -> Vec<u8> {
    let mut bytes = serde_json::to_vec_pretty(value).expect("reports are plain data");
    bytes.push(b'\n');
    bytes
}

/// Whether a figure is one of the paper's; ours have names, not numbers, and come after them.
pub(super) fn of_the_paper(id: &str) -> bool {
    id.strip_prefix("fig")
        .is_some_and(|number| !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()))
}
