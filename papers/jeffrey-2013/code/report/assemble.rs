//! From files to a report.

use std::collections::BTreeMap;
use std::path::Path;

use rayon::prelude::*;
use serde::Deserialize;
use serde_json::Value;

use super::model::*;
use super::{prose, space};
use crate::Reading;
use twofold_job::Table;
use twofold_job::encode::from_csv;
use twofold_job::record::{FileBytes, FileError, Hash, Layer, Manifest, PictureEntry, files};
use twofold_job::spec::Method;
use twofold_paper::compare;
use twofold_paper::pipeline::{PanelRecord, TableRecord, pixel_hash};
use twofold_paper::wording;
use twofold_paper::{Camera, Figure};
use twofold_render::{Pixels, Shrink, decode_png, encode_preview, shrunk};

/// The record beside a picture. Verdicts are read loosely: their evidence may hold numbers that
/// JSON writes as null.
#[derive(Deserialize)]
struct Record {
    hashes: PictureEntry,
    #[serde(default)]
    title: String,
    reading: Option<Reading>,
    caption: String,
    #[serde(default)]
    alterations: Vec<String>,
    #[serde(default)]
    panels: Vec<PanelRecord>,
    #[serde(default)]
    verdicts: Vec<Value>,
    #[serde(default)]
    tables: Vec<TableRecord>,
}

/// A file of the figures' folder, as far as a report needs it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MadeFile {
    /// Its path inside the folder, with forward slashes.
    pub path: String,
    /// Its size in bytes.
    pub size: u64,
    /// Its hash.
    pub sha256: Hash,
    /// Its content; empty for a table that no view in space is drawn from, which is only listed.
    pub bytes: Vec<u8>,
}

impl MadeFile {
    /// The file at `place`, whose path inside the figures' folder is `path`, among the files of
    /// these figures.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: String, place: &Path, figures: &[Figure]) -> Result<Self, FileError> {
        let folder = path.rsplit_once('/').map_or("", |(folder, _)| folder);
        if path.ends_with(".csv") && space::camera(figures, folder).is_none() {
            let (sha256, size) = files::digest(place)?;
            return Ok(Self { path, size, sha256, bytes: Vec::new() });
        }
        Ok(Self::of(path, files::read(place)?))
    }

    /// A file of these bytes, whose path inside the figures' folder is `path`.
    pub fn of(path: String, bytes: Vec<u8>) -> Self {
        Self { path, size: bytes.len() as u64, sha256: Hash::of(&bytes), bytes }
    }

    fn folder(&self) -> &str {
        self.path.rsplit_once('/').map_or("", |(folder, _)| folder)
    }

    fn name(&self) -> &str {
        self.path.rsplit_once('/').map_or(&self.path, |(_, name)| name)
    }
}

/// Data that a report takes from the program that makes it.
#[derive(Clone, Copy, Debug)]
pub struct Program<'a> {
    /// The figures that it knows.
    pub figures: &'a [Figure],
    /// Its pages of findings and theorems, which the report repeats.
    pub findings: &'a str,
    /// Its docs/census.md and docs/parameters.md, whose odds the page repeats.
    pub odds: &'a str,
}

/// Puts the report together: `made` are the files of the figures' folder, `committed` those of the
/// references' folder (figN/expected.json and figN/NAME.png).
pub fn assemble(made: &[MadeFile], committed: &[FileBytes], program: &Program<'_>) -> Report {
    let mut problems = Vec::new();
    let mut folders: BTreeMap<(bool, Vec<Piece>, &str), Vec<&MadeFile>> = BTreeMap::new();
    for file in made.iter().filter(|f| !f.folder().is_empty() && !f.folder().contains('/')) {
        folders
            .entry((!of_the_paper(file.folder()), natural(file.folder()), file.folder()))
            .or_default()
            .push(file);
    }
    let committed = Committed { files: committed, figures: program.figures };
    let folders: Vec<(&str, Vec<&MadeFile>)> =
        folders.into_iter().map(|((_, _, id), files)| (id, files)).collect();
    let each: Vec<(FigureReport, Vec<String>)> =
        folders.par_iter().map(|(id, files)| figure(id, files, &committed)).collect();
    let mut figures = Vec::new();
    for (figure, found) in each {
        problems.extend(found);
        if !figure.pictures.is_empty() || !figure.unrecorded.is_empty() {
            figures.push(figure);
        }
    }
    let making = making(made, &mut problems);
    Report {
        format: "twofold-report",
        version: VERSION,
        made_by: concat!("twofold ", env!("CARGO_PKG_VERSION")).to_owned(),
        article: ARTICLE,
        summary: summary(&figures),
        figures,
        making,
        problems,
        findings: prose::of_the_project(program.findings),
        odds: prose::of_the_odds(program.odds),
        occurring: prose::occurring(program.odds),
    }
}

/// Runs of the program that made the figures, as the folder records them.
fn making(made: &[MadeFile], problems: &mut Vec<String>) -> Vec<Making> {
    let Some(file) = made.iter().find(|f| f.path == super::names::MAKING) else {
        return Vec::new();
    };
    match serde_json::from_slice::<Makings>(&file.bytes) {
        Ok(makings) => makings.runs,
        Err(error) => {
            problems.push(format!(
                "{}: cannot be read ({error}); make the figures again to have it anew",
                file.path
            ));
            Vec::new()
        }
    }
}

/// A picture as the page shows it.
fn preview(pixels: &Pixels, how: Shrink) -> Option<Preview> {
    let small = shrunk(pixels, PREVIEW_WIDTH, how);
    // A picture without pixels is not shown.
    let png = encode_preview(&small).ok()?;
    Some(Preview { png, size: [small.width, small.height] })
}

/// A name cut into words and numbers, so that fig10 comes after fig9.
fn natural(name: &str) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    for c in name.chars() {
        match (pieces.last_mut(), c.to_digit(10)) {
            (Some(Piece::Number(n)), Some(d)) => {
                *n = n.saturating_mul(10).saturating_add(u64::from(d))
            }
            (_, Some(d)) => pieces.push(Piece::Number(u64::from(d))),
            (Some(Piece::Word(w)), None) => w.push(c),
            (_, None) => pieces.push(Piece::Word(c.to_string())),
        }
    }
    pieces
}

#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Piece {
    Number(u64),
    Word(String),
}

/// The files of the references' folder, and the figures they belong to.
struct Committed<'a> {
    files: &'a [FileBytes],
    figures: &'a [Figure],
}

impl Committed<'_> {
    fn file(&self, path: &str) -> Option<&[u8]> {
        self.files.iter().find(|f| f.path == path).map(|f| f.bytes.as_slice())
    }

    fn manifest(&self, id: &str) -> Result<Manifest, String> {
        let path = format!("{id}/expected.json");
        let bytes =
            self.file(&path).ok_or_else(|| format!("no reference has been committed for {id}"))?;
        let text = std::str::from_utf8(bytes).map_err(|_| format!("{path} is not text"))?;
        Manifest::parse(text, &path).map_err(|e| e.to_string())
    }
}

/// A figure, and what is wrong with it.
fn figure(id: &str, files: &[&MadeFile], committed: &Committed<'_>) -> (FigureReport, Vec<String>) {
    let mut problems = Vec::new();
    let manifest = committed.manifest(id);
    let mut records = Vec::new();
    for file in files.iter().filter(|f| f.name().ends_with(".json")) {
        match serde_json::from_slice::<Value>(&file.bytes) {
            // Other JSON files may stand beside the pictures: a record is what has hashes and
            // panels.
            Ok(value) if value.get("hashes").is_none() => {}
            Ok(value) => match serde_json::from_value::<Record>(value) {
                Ok(record) => records.push((file, record)),
                Err(error) => {
                    problems.push(format!("{}: not a record of this version ({error})", file.path))
                }
            },
            Err(error) => problems.push(format!("{}: not JSON ({error})", file.path)),
        }
    }
    let names: Vec<String> = records.iter().map(|(_, r)| r.hashes.name.clone()).collect();
    let each: Vec<(PictureReport, Vec<String>)> = records
        .into_par_iter()
        .map(|(file, record)| {
            let own: Vec<&MadeFile> = files
                .iter()
                .filter(|f| owner(f.name(), &names) == Some(&record.hashes.name))
                .copied()
                .collect();
            let mut problems = Vec::new();
            (picture(id, file, record, &own, committed, &manifest, &mut problems), problems)
        })
        .collect();
    let mut pictures = Vec::new();
    for (picture, found) in each {
        problems.extend(found);
        pictures.push(picture);
    }
    pictures.sort_by_key(|p| (natural(&p.name), p.name.clone()));
    for picture in &pictures {
        for missing in picture.files.iter().filter(|f| f.integrity == Integrity::Missing) {
            problems.push(format!(
                "{}: not there, but the record of {} lists it",
                missing.path, picture.name
            ));
        }
        for changed in picture.files.iter().filter(|f| f.integrity == Integrity::Changed) {
            problems.push(format!("{}: changed since it was made; make it again", changed.path));
        }
    }
    if let Ok(manifest) = &manifest {
        for entry in manifest.pictures.iter().filter(|e| !pictures.iter().any(|p| p.name == e.name))
        {
            problems.push(format!("{id}/{}.png: not made, but the reference lists it", entry.name));
        }
    }
    let mut spare = Vec::new();
    for file in files.iter().filter(|f| f.name().ends_with(".png")) {
        if pictures.iter().any(|p| file.name() == format!("{}.png", p.name)) {
            continue;
        }
        match decode_png(&file.bytes) {
            Ok(pixels) => spare.extend(preview(&pixels, Shrink::Mean).map(|p| (file, p))),
            Err(error) => problems.push(unreadable(file, &error)),
        }
    }
    let title =
        pictures.iter().map(|p| p.title.clone()).find(|t| !t.is_empty()).unwrap_or_default();
    let report = FigureReport {
        id: id.to_owned(),
        title,
        unrecorded: spare.iter().map(|(f, _)| file_report(f, Role::Png, None, None)).collect(),
        unrecorded_png: spare.into_iter().map(|(_, preview)| preview).collect(),
        pictures,
    };
    (report, problems)
}

/// The picture that a file belongs to: the longest name that the file's name goes on from with a
/// hyphen or a dot.
fn owner<'a>(file: &str, names: &'a [String]) -> Option<&'a String> {
    names
        .iter()
        .filter(|n| file.strip_prefix(n.as_str()).is_some_and(|rest| rest.starts_with(['-', '.'])))
        .max_by_key(|n| n.len())
}

/// One picture from its record and its `files`.
fn picture(
    id: &str,
    own: &MadeFile,
    record: Record,
    files: &[&MadeFile],
    committed: &Committed<'_>,
    manifest: &Result<Manifest, String>,
    problems: &mut Vec<String>,
) -> PictureReport {
    let name = record.hashes.name.clone();
    let find = |suffix: &str| {
        let wanted = format!("{name}{suffix}");
        files.iter().find(|f| f.name() == wanted).copied()
    };
    let png = find(".png");
    let pixels =
        png.and_then(|f| decode_png(&f.bytes).map_err(|e| problems.push(unreadable(f, &e))).ok());

    let mut listed = Vec::new();
    let mut hashes = record.hashes.clone();
    let kinds =
        [(Role::Png, &mut hashes.png), (Role::Svg, &mut hashes.svg), (Role::Pdf, &mut hashes.pdf)];
    for (role, hash) in kinds {
        let suffix = match role {
            Role::Png => ".png",
            Role::Svg => ".svg",
            _ => ".pdf",
        };
        match find(suffix) {
            Some(file) => {
                let report = file_report(file, role, None, Some(hash));
                *hash = report.sha256.clone().unwrap_or_else(|| hash.clone());
                listed.push(report);
            }
            None => listed.push(missing(&format!("{id}/{name}{suffix}"), role, None)),
        }
    }
    if let Some(pixels) = &pixels {
        hashes.pixels = pixel_hash(pixels);
    }
    for table in &record.tables {
        listed.push(match files.iter().find(|f| f.name() == table.file) {
            Some(file) => file_report(file, Role::Data, table.panel.clone(), Some(&table.sha256)),
            None => missing(&format!("{id}/{}", table.file), Role::Data, table.panel.clone()),
        });
    }
    for table in files.iter().filter(|f| f.name().ends_with(".csv")) {
        if !listed.iter().any(|l| l.path == table.path) {
            listed.push(file_report(table, Role::Data, None, None));
        }
    }
    listed.push(file_report(own, Role::Record, None, None));

    let mut images = Images {
        actual: pixels.as_ref().and_then(|p| preview(p, Shrink::Mean)),
        ..Images::default()
    };
    let reference =
        reference(id, &hashes, &record, pixels.as_ref(), committed, manifest, &mut images);
    let verdicts = record
        .verdicts
        .into_iter()
        .filter_map(|recorded| match serde_json::from_value::<RecordedVerdict>(recorded.clone()) {
            Ok(v) => Some(VerdictReport {
                kind: kind(&v),
                panel: v.panel,
                method: v.method,
                claim: v.claim_text,
                found: v.found,
                agrees: v.agrees,
                because: v.because,
                recorded,
            }),
            Err(error) => {
                problems.push(format!("{}: a verdict cannot be read ({error})", own.path));
                None
            }
        })
        .collect();
    let panels: Vec<PanelReport> = record.panels.into_iter().map(panel).collect();
    let camera = space::camera(committed.figures, id);
    let spaces =
        camera.map_or_else(Vec::new, |camera| spaces(camera, &panels, &record.tables, files));
    PictureReport {
        spaces,
        description: description(&name, &record.title, record.reading, &record.caption, &panels),
        title: record.title,
        reading: record.reading,
        caption: record.caption,
        alterations: record.alterations,
        size: pixels.map(|p| [p.width, p.height]),
        name,
        hashes,
        files: listed,
        reference,
        panels,
        verdicts,
        images,
    }
}

/// The panels in space, from their tables; none of a picture that is no view in space, or whose
/// tables are not there.
fn spaces(
    camera: Camera,
    panels: &[PanelReport],
    tables: &[TableRecord],
    files: &[&MadeFile],
) -> Vec<space::SpaceView> {
    let table = |panel: &PanelReport| -> Option<Table> {
        let own = tables.iter().filter(|t| t.panel.as_deref() == Some(panel.label.as_str()));
        let found = own.filter_map(|t| files.iter().find(|f| f.name() == t.file));
        found
            .filter_map(|f| from_csv(&f.bytes).ok())
            .map(|(_, table)| table)
            .find(|t| t.name != "events")
    };
    let sources: Vec<space::Source<'_>> = panels
        .iter()
        .filter(|p| p.run.system.dimension() == 3)
        .filter_map(|p| {
            Some(space::Source {
                label: &p.label,
                title: &p.title,
                system: &p.run.system,
                table: table(p)?,
            })
        })
        .collect();
    space::views(&sources, &camera)
}

fn unreadable(file: &MadeFile, error: &dyn std::fmt::Display) -> String {
    format!("{}: cannot be read as a picture ({error})", file.path)
}

fn panel(p: PanelRecord) -> PanelReport {
    PanelReport {
        within_ndsolve_limit: (p.run.method.name == Method::Lsoda)
            .then_some(p.most_steps_in_segment <= NDSOLVE_MAX_STEPS),
        label: p.label,
        title: p.title,
        run: p.run,
        points: p.points,
        t: p.t,
        state: p.state,
        statistics: p.statistics,
        most_steps_in_segment: p.most_steps_in_segment,
    }
}

fn description(
    name: &str,
    title: &str,
    reading: Option<Reading>,
    caption: &str,
    panels: &[PanelReport],
) -> String {
    let mut text = if title.is_empty() { name.to_owned() } else { wording::plain(title) };
    if let Some(reading) = reading {
        text += &format!(", {} reading", reading.word());
    }
    text += &format!(". {}", wording::plain(caption));
    if panels.len() > 1 {
        let list: Vec<String> =
            panels.iter().map(|p| format!("({}) {}", p.label, wording::plain(&p.title))).collect();
        text += &format!(" Panels: {}.", list.join("; "));
    }
    text
}

/// Kind of a verdict about paths in space.
const PATHS: &str = "paths compared";
/// Kind of a verdict about a noisy section, as the classifier calls it.
const NOISY: &str = "noisy";

/// Kind of the finding, in a word or two, from the evidence.
fn kind(verdict: &RecordedVerdict) -> String {
    let Some(section) = verdict.evidence.get("section") else { return PATHS.to_owned() };
    let name = section.get("name").and_then(Value::as_str).unwrap_or("section");
    match section.pointer("/verdict/period").and_then(Value::as_u64) {
        Some(period) => format!("{name}, period {period}"),
        None => name.to_owned(),
    }
}

fn reference(
    id: &str,
    actual: &PictureEntry,
    record: &Record,
    pixels: Option<&Pixels>,
    committed: &Committed<'_>,
    manifest: &Result<Manifest, String>,
    images: &mut Images,
) -> Reference {
    let expected = match manifest {
        Ok(manifest) => manifest.picture(&actual.name),
        Err(_) if !record.alterations.is_empty() => return Reference::Altered,
        Err(why) => return Reference::Missing { why: why.clone() },
    };
    let Some(expected) = expected else {
        return if record.alterations.is_empty() {
            Reference::Missing {
                why: "the committed manifest does not list this picture".to_owned(),
            }
        } else {
            Reference::Altered
        };
    };
    let Some(difference) = expected.first_difference(actual) else { return Reference::Same };
    let (comparison, note) = match (committed.file(&format!("{id}/{}.png", actual.name)), pixels) {
        (None, _) => {
            (None, Some("the expected picture itself is not committed, only its hashes".to_owned()))
        }
        (Some(_), None) => (None, Some("the actual picture cannot be read".to_owned())),
        (Some(bytes), Some(pixels)) => held_against(bytes, expected, pixels, images),
    };
    Reference::Different {
        layer: difference.layer,
        panels: difference.panels,
        expected: Box::new(expected.clone()),
        comparison,
        note,
    }
}

fn held_against(
    bytes: &[u8],
    expected: &PictureEntry,
    actual: &Pixels,
    images: &mut Images,
) -> (Option<compare::Comparison>, Option<String>) {
    let before = match decode_png(bytes) {
        Ok(before) => before,
        Err(error) => {
            return (None, Some(format!("the expected picture cannot be read ({error})")));
        }
    };
    images.expected = preview(&before, Shrink::Mean);
    let note = (pixel_hash(&before) != expected.pixels)
        .then(|| "the committed PNG is itself not the picture whose hash is committed".to_owned());
    match (compare::compare(&before, actual), compare::difference_image(&before, actual)) {
        (Ok(comparison), Ok(difference)) => {
            images.difference = preview(&difference, Shrink::Strongest);
            (Some(comparison), note)
        }
        (Err(sizes), _) | (_, Err(sizes)) => (None, Some(sizes.to_string())),
    }
}

fn file_report(
    file: &MadeFile,
    role: Role,
    panel: Option<String>,
    recorded: Option<&Hash>,
) -> FileReport {
    let hash = file.sha256.clone();
    FileReport {
        path: file.path.clone(),
        role,
        panel,
        media_type: media_type(&file.path),
        bytes: file.size,
        integrity: match recorded {
            None => Integrity::Unrecorded,
            Some(r) if *r == hash => Integrity::Unchanged,
            Some(_) => Integrity::Changed,
        },
        sha256: Some(hash),
    }
}

fn missing(path: &str, role: Role, panel: Option<String>) -> FileReport {
    FileReport {
        path: path.to_owned(),
        role,
        panel,
        media_type: media_type(path),
        bytes: 0,
        sha256: None,
        integrity: Integrity::Missing,
    }
}

/// The media type by the file name's ending.
pub(super) fn media_type(path: &str) -> &'static str {
    match path.rsplit_once('.').map_or("", |(_, ending)| ending) {
        "png" => "image/png",
        "svg" => "image/svg+xml",
        "pdf" => "application/pdf",
        "csv" => "text/csv",
        "json" => "application/json",
        "html" => "text/html",
        "md" | "txt" => "text/plain",
        _ => "application/octet-stream",
    }
}

fn summary(figures: &[FigureReport]) -> Summary {
    let mut s = Summary::default();
    let mut readings: Vec<ReadingSummary> = Vec::new();
    for (figure, picture) in figures.iter().flat_map(|f| f.pictures.iter().map(move |p| (f, p))) {
        s.damaged_files += picture
            .files
            .iter()
            .filter(|f| matches!(f.integrity, Integrity::Changed | Integrity::Missing))
            .count();
        if !picture.alterations.is_empty() {
            s.altered += 1;
            continue;
        }
        s.pictures += 1;
        match picture.reference {
            Reference::Same => s.same += 1,
            Reference::Different { .. } => s.different += 1,
            Reference::Missing { .. } | Reference::Altered => s.without_reference += 1,
        }
        s.panels += picture.panels.len();
        let within = picture.panels.iter().filter_map(|p| p.within_ndsolve_limit);
        s.panels_by_ndsolves_method += within.clone().count();
        s.panels_beyond_ndsolve_limit += within.filter(|within| !within).count();
        // The paper's claims are about the paper's figures; our own pictures repeat some of them
        // under other methods.
        if picture.verdicts.is_empty() || !of_the_paper(&figure.id) {
            continue;
        }
        let index =
            readings.iter().position(|r| r.reading == picture.reading).unwrap_or_else(|| {
                let new = ReadingSummary {
                    reading: picture.reading,
                    claims: 0,
                    agree: 0,
                    found: Vec::new(),
                    all_alike: None,
                };
                readings.push(new);
                readings.len() - 1
            });
        let reading = &mut readings[index];
        for verdict in &picture.verdicts {
            reading.claims += 1;
            reading.agree += usize::from(verdict.agrees);
            match reading.found.iter_mut().find(|f| f.kind == verdict.kind) {
                Some(found) => found.panels += 1,
                None => reading.found.push(Found { kind: verdict.kind.clone(), panels: 1 }),
            }
        }
    }
    for reading in &mut readings {
        let mut ways =
            reading.found.iter().filter(|f| f.kind != PATHS && !f.kind.starts_with(NOISY));
        reading.all_alike = match (ways.next(), ways.next()) {
            (Some(only), None) if only.panels > 1 => Some(only.clone()),
            _ => None,
        };
    }
    // In the order in which readings are always shown; figures without readings last.
    readings.sort_by_key(|r| {
        Reading::ALL.iter().position(|known| Some(*known) == r.reading).unwrap_or(usize::MAX)
    });
    s.readings = readings;
    s
}

impl Reference {
    /// The first layer that differs, if one does.
    pub fn layer(&self) -> Option<Layer> {
        match self {
            Reference::Different { layer, .. } => Some(*layer),
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_sort_as_people_count() {
        let mut names = ["fig10", "lottery", "fig9", "fig2", "fig7-printed", "fig7"];
        names.sort_by_key(|n| natural(n));
        assert_eq!(names, ["fig2", "fig7", "fig7-printed", "fig9", "fig10", "lottery"]);
    }

    #[test]
    fn files_belong_to_the_longest_name() {
        let names = ["fig7-printed", "fig7-printed-shortened"].map(str::to_owned);
        assert_eq!(owner("fig7-printed-i.csv", &names), Some(&names[0]));
        assert_eq!(owner("fig7-printed-shortened-i.csv", &names), Some(&names[1]));
        assert_eq!(owner("fig7-printed.png", &names), Some(&names[0]));
        assert_eq!(owner("fig7-printedx.png", &names), None);
    }
}
