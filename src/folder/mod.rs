//! A paper as a folder: its systems, figures and claims as data, which are made, checked and
//! blessed with `twofold paper`.
//!
//! ```text
//! paper.toml       citation, defaults of all runs, readings of the parameters, open questions
//! systems/*.toml   its equations
//! figures/*.toml   its figures, panel by panel
//! measures.toml    what its claims rest on beside the figures: orbits, exponents, rests, runs,
//!                  scans, sweeps
//! claims.toml      its claims, each with a check and the day on which its rule was fixed
//! data/*.csv       numbers read off the paper, drawn over panels
//! expected/        the hashes and outcomes that were found before
//! ```
//!
//! Questions are written in the words of the command line ([`words`]); `docs/papers.md` has every
//! key.

pub mod check;
mod made;
pub mod make;
mod page;
pub mod words;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::ErrorKind::{NotADirectory, NotFound};
use std::ops::Range;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use serde::de::value::MapAccessDeserializer;
use serde::de::{DeserializeOwned, Error as _, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use toml::Spanned;
use toml::value::Datetime;

use crate::cli::flags::Use;
use crate::job::spec::RunSpec;
use crate::job::sweep::{Axis, Values};
use crate::job::{Answer, AnyQuestion};
use crate::paper::code::{self, Code};
use crate::paper::draw::plot::{self, Look, PictureKind, PlotError};
use crate::paper::draw::scan::Scanned;
use crate::paper::drawing::draft;
use crate::paper::plots::{Columns, Drawing, Plot, Plots, Points, Recorded};
use crate::paper::tables;
use crate::paper::verdict::{Claim as PanelClaim, SectionClaim};
use crate::paper::{Camera, Figure, FigurePanel, ParameterReading, Picture, Repeats, View};
use crate::record::FileError;
use crate::record::files::read_text;
use crate::record::manifest::is_plain_name;
use crate::record::{self, first_special};
use crate::render::{RenderError, markup};
use crate::system::Diagnostic;
use crate::system::diagnostic::nearest;

use check::{Claim, ClaimFile};
use words::{Ask, Said, Words};

/// Why a folder cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum FolderError {
    /// Something is wrong in a file.
    #[error("{0}")]
    Text(Box<Diagnostic>),
    /// A file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file that has to be there is not.
    #[error("{0}")]
    Missing(String),
}

/// A paper's folder, read and checked.
#[derive(Debug)]
pub struct Folder {
    /// Its path.
    pub root: PathBuf,
    files: Files,
    /// The paper.
    pub about: About,
    /// The file that says so.
    common: Origin,
    /// The code that it names.
    pub(crate) code: Option<Code>,
    /// Its figures, in the order of their names.
    pub figures: Vec<Figure>,
    /// The part of the paper that each figure shows, in the same order.
    pub shows: Vec<String>,
    /// Everything that claims may read, by name: "fig3/a" for a panel, in a reading
    /// "fig3/a@printed"; a measure by its own.
    pub sources: BTreeMap<String, Source>,
    /// Its claims.
    pub claims: Vec<Claim>,
    /// The columns that figures and claims read.
    columns: Vec<ReadColumns>,
}

/// Columns of an answer's table that a file names.
#[derive(Clone, Debug)]
struct ReadColumns {
    origin: Origin,
    question: AnyQuestion,
    /// The table [default: the first].
    table: Option<Spanned<String>>,
    columns: Vec<Spanned<String>>,
    /// Whether they are columns of words.
    words: bool,
}

impl ReadColumns {
    /// Refuses a name that the answer does not have.
    fn check(&self, answer: &Answer) -> Result<(), FolderError> {
        let wrong = |name: &Spanned<String>, why: String| {
            let (why, help) = why.split_once("; ").unwrap_or((&why, ""));
            let help = (!help.is_empty()).then(|| help.to_owned());
            FolderError::at(&self.origin, name.span(), why, help)
        };
        for name in &self.columns {
            let at = self.table.as_ref().unwrap_or(name);
            let table = tables::table(answer, self.table.as_ref().map(|t| t.get_ref().as_str()))
                .map_err(|why| wrong(at, why))?;
            let found = match self.words {
                true => tables::words(table, name.get_ref()).map(drop),
                false => tables::column(table, name.get_ref()).map(drop),
            };
            found.map_err(|why| wrong(name, why))?;
        }
        Ok(())
    }
}

/// A source of numbers for claims.
#[derive(Clone, Debug)]
pub struct Source {
    /// The file's text.
    pub said: Said,
    /// The kind of question.
    pub ask: Ask,
    /// The question.
    pub question: AnyQuestion,
}

/// The paper: `paper.toml`.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct About {
    /// Version of this format: 1.
    format: Spanned<u32>,
    /// Title.
    pub title: String,
    /// Authors.
    pub authors: Vec<String>,
    /// Year.
    pub year: u16,
    /// Journal or proceedings.
    #[serde(default)]
    pub journal: String,
    /// Its digital object identifier.
    #[serde(default)]
    pub doi: String,
    /// Its number on arXiv.
    #[serde(default)]
    pub arxiv: String,
    /// Its subject, in our words, and the text from which the equations were taken.
    pub summary: String,
    /// The day on which the folder was published, for archives.
    pub published: Option<Spanned<Datetime>>,
    /// The folder's licence for archives, by its SPDX name, "CC-BY-4.0", or several to choose from:
    /// "MIT OR Apache-2.0".
    #[serde(default)]
    pub license: String,
    /// Questions that it leaves open.
    #[serde(default)]
    pub open: Vec<String>,
    /// Code in this program that has more of the paper's figures, which `twofold figure` makes, and
    /// the runs of `repeats`: "jeffrey-2013".
    code: Option<Spanned<String>>,
    /// Words that hold for every run of a panel.
    #[serde(default)]
    run: Words,
    /// Readings of its parameters, if it can be read in more than one way: a picture of each figure
    /// is made for each.
    #[serde(default)]
    readings: BTreeMap<Spanned<String>, ReadingFile>,
}

/// A reading of the parameters.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct ReadingFile {
    /// Why it may be read so.
    about: String,
    /// A reading that this one changes.
    extends: Option<Spanned<String>>,
    /// Words that hold for every run of a panel in this reading.
    #[serde(default)]
    run: Words,
}

/// A figure: `figures/NAME.toml`.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct FigureFile {
    /// Heading.
    title: Spanned<String>,
    /// Caption, in our words.
    caption: String,
    /// The part of the paper that it shows: "fig. 3".
    #[serde(default)]
    shows: String,
    /// Panels in a row [default: at most three].
    columns: Option<Spanned<usize>>,
    /// The readings of which it has a picture [default: all].
    readings: Option<Vec<Spanned<String>>>,
    /// Kind of drawing of panels that do not say it: `series`, `plane`, `space`, `section`,
    /// `columns` (a measure's table), `map` (a measure's endings over two settings), `halves` or
    /// `surface`.
    draw: Option<Spanned<Draw>>,
    /// States on the axes of panels that do not say it.
    axes: Option<Spanned<Vec<String>>>,
    /// Azimuth and elevation in degrees, of panels in space that do not say it.
    #[serde(default, deserialize_with = "two")]
    camera: Option<Spanned<[f64; 2]>>,
    /// Its panels.
    panel: Vec<Spanned<PanelFile>>,
}

/// A panel.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct PanelFile {
    /// "a", "i" ...
    label: Spanned<String>,
    /// A few words.
    title: Option<Spanned<String>>,
    /// Kind of drawing, as for the figure [default: the figure's].
    draw: Option<Spanned<Draw>>,
    /// The run that it shows; of `draw = "columns"` and `"map"` nothing.
    run: Option<Spanned<Words>>,
    /// Changes of the run in a reading.
    #[serde(default)]
    r#in: BTreeMap<Spanned<String>, Spanned<Words>>,
    /// The paper's claim about a panel drawn as `halves` or `surface`; the picture shows the
    /// verdict: of a section `{ section = "periodic" }`, `{ section = "chaos" }`, `{ section =
    /// "partly-washed-out" }` or `{ section = { period = 3 } }`, of a path
    /// `"less-organised-than-next"` or `"differs-from-next"`.
    says: Option<Spanned<PanelClaim>>,
    /// Committed runs that repeat it, "STUDY/PANEL" such as "census/7(i)"; the picture shows the
    /// share that supports the claim.
    repeats: Option<Spanned<String>>,
    /// States on the axes.
    axes: Option<Spanned<Vec<String>>>,
    /// Azimuth and elevation in degrees, of a panel in space.
    #[serde(default, deserialize_with = "two")]
    camera: Option<Spanned<[f64; 2]>>,
    /// The measure whose table is drawn; of a map one with `scan` or `sweep` over two settings.
    of: Option<Spanned<String>>,
    /// Its table [default: the first].
    table: Option<Spanned<String>>,
    /// The horizontal column.
    x: Option<Spanned<String>>,
    /// The vertical columns.
    y: Option<Spanned<Vec<Spanned<String>>>>,
    /// Dots instead of a line.
    dots: Option<Spanned<bool>>,
    /// Titles of the two axes of columns or a map [default: the columns' names].
    #[serde(default, deserialize_with = "two")]
    labels: Option<Spanned<[String; 2]>>,
    /// Names of the vertical columns in the legend [default: their own].
    names: Option<Spanned<Vec<String>>>,
    /// Numbers of the paper to be drawn over it, one table `{ name = "...", file = "..." }`.
    points: Option<Spanned<PointsFile>>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Draw {
    Series,
    Plane,
    Space,
    Section,
    Columns,
    Map,
    /// A section: the later half, and below it the early half.
    Halves,
    /// A path in space with the surface where h = 0.
    Surface,
}

impl Draw {
    fn word(self) -> &'static str {
        match self {
            Draw::Series => "series",
            Draw::Plane => "plane",
            Draw::Space => "space",
            Draw::Section => "section",
            Draw::Columns => "columns",
            Draw::Map => "map",
            Draw::Halves => "halves",
            Draw::Surface => "surface",
        }
    }
}

impl FigureFile {
    /// The place of the text that cannot be set, or of the last panel if there are too many.
    fn place_of(&self, error: &RenderError) -> Range<usize> {
        let panels = || self.panel.iter().map(Spanned::get_ref);
        let RenderError::Text(fault) = error else {
            return self.panel.last().map_or(0..0, Spanned::span);
        };
        let is_set = |text: &str| [text, &markup::literal(text)].contains(&fault.text());
        let names = panels().filter_map(|p| p.names.as_ref());
        let labels = panels().filter_map(|p| p.labels.as_ref());
        let points = panels().filter_map(|p| p.points.as_ref());
        let mut texts = std::iter::once(&self.title)
            .chain(panels().filter_map(|p| p.title.as_ref()))
            .map(|text| (std::slice::from_ref(text.get_ref()), text.span()))
            .chain(names.map(|names| (names.get_ref().as_slice(), names.span())))
            .chain(labels.map(|labels| (labels.get_ref().as_slice(), labels.span())))
            .chain(points.map(|p| (std::slice::from_ref(&p.get_ref().name), p.span())));
        let found = texts.find(|(texts, _)| texts.iter().any(|text| is_set(text)));
        found.map_or_else(|| self.title.span(), |(_, place)| place)
    }
}

impl PanelFile {
    fn title(&self) -> String {
        self.title.as_ref().map(|title| title.get_ref().clone()).unwrap_or_default()
    }

    /// Refuses a claim that nothing can be compared with.
    fn refuse_idle_claim(
        &self,
        origin: &Origin,
        draw: Draw,
        is_last: bool,
    ) -> Result<(), FolderError> {
        let Some(says) = &self.says else { return Ok(()) };
        let (why, help) = match says.get_ref() {
            PanelClaim::Section(SectionClaim::Period(0)) => {
                ("a period is one crossing or more", "give period = 1 or more")
            }
            PanelClaim::Section(_) if draw != Draw::Halves => {
                ("a claim of a section has no effect on a path", "draw it as halves")
            }
            PanelClaim::Section(_) => return Ok(()),
            _ if draw != Draw::Surface => {
                ("a claim of a path has no effect on a section", "draw it as surface")
            }
            _ if is_last => {
                ("`says` has no effect on the last panel: there is no next one", "leave it out")
            }
            _ => return Ok(()),
        };
        Err(FolderError::at(origin, says.span(), why, Some(help.to_owned())))
    }

    /// Refuses keys that do nothing in a panel drawn so.
    fn refuse_idle_keys(&self, origin: &Origin, draw: Draw) -> Result<(), FolderError> {
        fn at<T>(value: Option<&Spanned<T>>) -> Option<Range<usize>> {
            value.map(Spanned::span)
        }
        let columns = draw == Draw::Columns;
        let measured = columns || draw == Draw::Map;
        let scored = matches!(draw, Draw::Halves | Draw::Surface);
        let keys = [
            ("run", at(self.run.as_ref()), !measured),
            ("in", self.r#in.keys().next().map(Spanned::span), !measured),
            ("axes", at(self.axes.as_ref()), !measured),
            ("camera", at(self.camera.as_ref()), matches!(draw, Draw::Space | Draw::Surface)),
            ("says", at(self.says.as_ref()), scored),
            ("repeats", at(self.repeats.as_ref()), scored),
            ("points", at(self.points.as_ref()), !scored),
            ("of", at(self.of.as_ref()), measured),
            ("table", at(self.table.as_ref()), columns),
            ("x", at(self.x.as_ref()), columns),
            ("y", at(self.y.as_ref()), columns),
            ("dots", at(self.dots.as_ref()), columns),
            ("labels", at(self.labels.as_ref()), measured),
            ("names", at(self.names.as_ref()), columns),
        ];
        for (key, at, _) in keys.into_iter().filter(|(_, _, acts)| !acts) {
            let Some(at) = at else { continue };
            let help = match key {
                "of" => "give run = { ... }",
                "says" | "repeats" => "draw it as halves or surface, or score it in claims.toml",
                _ => "leave it out",
            };
            let why = format!("`{key}` has no effect on draw = \"{}\"", draw.word());
            return Err(FolderError::at(origin, at, why, Some(help.to_owned())));
        }
        Ok(())
    }
}

/// Drawing of a panel: its own, or else its figure's.
struct Drawn<'a> {
    draw: &'a Spanned<Draw>,
    axes: Option<&'a Spanned<Vec<String>>>,
    camera: Option<&'a Spanned<[f64; 2]>>,
}

/// Reads a list of two; a list in TOML may be longer than the array that is read from it.
fn two<'de, D: Deserializer<'de>, T: Deserialize<'de>>(
    from: D,
) -> Result<Option<Spanned<[T; 2]>>, D::Error> {
    let list = Spanned::<Vec<T>>::deserialize(from)?;
    let place = list.span();
    let two = list.into_inner().try_into().map_err(|list: Vec<T>| {
        D::Error::custom(format!("there are {} entries; give two", list.len()))
    })?;
    Ok(Some(Spanned::new(place, two)))
}

/// Numbers read off the paper.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case", remote = "Self")]
struct PointsFile {
    /// Name of the numbers.
    name: String,
    /// A CSV file of the folder whose first two columns are the horizontal and the vertical values.
    file: String,
}

impl<'de> Deserialize<'de> for PointsFile {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        /// Refuses a list, whose first entry serde would read as the name.
        struct OneTable;

        impl<'de> Visitor<'de> for OneTable {
            type Value = PointsFile;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("one table, { name = \"...\", file = \"...\" }")
            }

            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<PointsFile, A::Error> {
                PointsFile::deserialize(MapAccessDeserializer::new(map))
            }
        }

        from.deserialize_any(OneTable)
    }
}

/// A measure: `[NAME]` of measures.toml.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct MeasureFile {
    /// A run, as `twofold run` follows it: the facts of its answer, and its table.
    run: Option<Spanned<Words>>,
    /// A closed orbit, as `twofold orbit` finds it: period, point, multipliers; with `along` its
    /// branch.
    orbit: Option<Spanned<Words>>,
    /// Lyapunov exponents, as `twofold lyapunov` computes them.
    lyapunov: Option<Spanned<Words>>,
    /// Equilibria and pseudo-equilibria, as `twofold rests` finds them.
    rests: Option<Spanned<Words>>,
    /// An orbit diagram, or a map of endings, as `twofold scan` computes it: the table of its late
    /// crossings, or of its endings. Over one setting every run has to succeed.
    scan: Option<Spanned<Words>>,
    /// Many runs, as `twofold sweep` computes them: the table of its rows.
    sweep: Option<Spanned<Words>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ClaimsFile {
    #[serde(default)]
    claim: Vec<Spanned<ClaimFile>>,
}

/// A file of a folder: its path there and its text.
type Origin = Arc<(String, String)>;

/// The path of a file in the folder, and its text.
pub type Embedded = &'static [(&'static str, &'static str)];

/// Place of a folder's files.
#[derive(Clone, Debug)]
enum Files {
    Disk(PathBuf),
    Embedded(Embedded),
}

impl Files {
    /// A file's text, if it is there.
    fn text(&self, path: &str) -> Result<Option<String>, FolderError> {
        match self {
            Files::Disk(root) => {
                let file = root.join(path);
                let (whole, found) = match (root.canonicalize(), file.canonicalize()) {
                    (Ok(whole), Ok(found)) => (whole, found),
                    (Err(source), _) | (_, Err(source))
                        if !matches!(source.kind(), NotFound | NotADirectory) =>
                    {
                        return Err(FileError { action: "read", path: file, source }.into());
                    }
                    _ if file.is_symlink() => {
                        let why = format!("{}: a link that leads nowhere", file.display());
                        return Err(FolderError::Missing(why));
                    }
                    _ => return Ok(None),
                };
                if !found.starts_with(whole) {
                    return Err(FolderError::Missing(format!(
                        "{}: a link that leads out of the paper's folder; put the file itself \
                            there",
                        file.display()
                    )));
                }
                Ok(Some(read_text(&file)?))
            }
            Files::Embedded(all) => Ok(all.iter().find(|f| f.0 == path).map(|f| f.1.to_owned())),
        }
    }

    /// The TOML files of a part of the folder, by name.
    fn names(&self, part: &str) -> Result<Vec<String>, FolderError> {
        let paths: Vec<String> = match self {
            Files::Disk(root) => {
                let folder = root.join(part);
                let ours = |name: &String| name.ends_with(".toml") && !name.starts_with('.');
                let no_folder = folder.exists() && !folder.is_dir();
                let mut found = if no_folder { Vec::new() } else { record::names(&folder)? };
                found.retain(ours);
                let special = found.iter().map(|name| folder.join(name)).find(|f| !f.is_file());
                if let Some(path) = special.or(no_folder.then_some(folder)) {
                    let why = format!("{}: neither a file nor a folder of files", path.display());
                    return Err(FolderError::Missing(why));
                }
                found
            }
            Files::Embedded(all) => all
                .iter()
                .filter_map(|f| f.0.strip_prefix(part)?.strip_prefix('/').map(str::to_owned))
                .collect(),
        };
        let mut names = Vec::new();
        for path in paths {
            let name = path.trim_end_matches(".toml").to_owned();
            // The claims' expectations have this name.
            if name == "claims" {
                let why = format!("{part}/claims.toml: this name is the claims'; give another");
                return Err(FolderError::Missing(why));
            }
            if !is_plain_name(&name) || name.contains('.') {
                let why = format!(
                    "{part}/{}: no plain name; use letters, digits, - and _",
                    path.escape_debug()
                );
                return Err(FolderError::Missing(why));
            }
            names.push(name);
        }
        names.sort();
        Ok(names)
    }

    /// Refuses files of a part of the folder whose names differ in case alone.
    fn has_no_twins(&self, part: &str) -> Result<(), FolderError> {
        let Files::Disk(root) = self else { return Ok(()) };
        let mut names = record::names(&root.join(part))?;
        names.sort_by_key(|name| name.to_ascii_lowercase());
        let twins = names.windows(2).find(|pair| pair[0].eq_ignore_ascii_case(&pair[1]));
        let Some([one, other]) = twins else { return Ok(()) };
        let [one, other] = [one, other].map(|name| Path::new(part).join(name));
        Err(FolderError::Missing(format!(
            "{} and {} differ in case alone, and are one file on some machines: give one of them \
                another name",
            one.display(),
            other.display()
        )))
    }

    /// A file of the folder, if it is there.
    fn parsed<T: DeserializeOwned>(&self, path: &str) -> Result<Option<(Origin, T)>, FolderError> {
        let Some(text) = self.text(path)? else { return Ok(None) };
        let origin = Arc::new((path.to_owned(), text));
        match toml::from_str(&origin.1) {
            Ok(read) => Ok(Some((origin, read))),
            Err(error) => {
                let message = error.message().lines().next().unwrap_or_default().to_owned();
                Err(FolderError::at(&origin, error.span().unwrap_or(0..0), message, None))
            }
        }
    }
}

impl Folder {
    /// Reads a folder, all of it, and checks that every question can be asked and every claim reads
    /// something.
    ///
    /// # Errors
    /// The first problem, with its file, place and remedy.
    pub fn read(root: &Path) -> Result<Self, FolderError> {
        // Files there are written, and would be through a link.
        for part in ["out", "expected"] {
            if let Some(special) = first_special(&root.join(part))? {
                return Err(FolderError::Missing(format!(
                    "{}: a link, pipe or device, through which something foreign could be \
                        written; remove it",
                    special.display()
                )));
            }
        }
        Self::read_from(root, Files::Disk(root.to_owned()))
    }

    /// The same for a folder that is embedded in the program.
    ///
    /// # Errors
    /// As [`Folder::read`].
    pub fn embedded(root: &str, files: Embedded) -> Result<Self, FolderError> {
        Self::read_from(Path::new(root), Files::Embedded(files))
    }

    fn read_from(root: &Path, files: Files) -> Result<Self, FolderError> {
        let (origin, about): (Origin, About) = files.parsed("paper.toml")?.ok_or_else(|| {
            FolderError::Missing(format!(
                "{}: there is no paper.toml; name a paper's folder, or make one with twofold paper \
                    new",
                root.display()
            ))
        })?;
        if *about.format.get_ref() != 1 {
            let why = format!("format {} is not known to this program", about.format.get_ref());
            return Err(FolderError::at(
                &origin,
                about.format.span(),
                why,
                Some("write format = 1".into()),
            ));
        }
        about.published.iter().try_for_each(|given| day(&origin, "published", given))?;
        let readings = readings(&origin, &about)?;
        let code = about.code.as_ref().map(|name| {
            code::named(name.get_ref()).ok_or_else(|| {
                let why = format!("this program has no code called `{}`", name.get_ref());
                FolderError::at(&origin, name.span(), why, Some("leave `code` out".into()))
            })
        });
        let code = code.transpose()?;
        for part in ["", "figures", "systems", "data"] {
            files.has_no_twins(part)?;
        }
        let mut folder = Self {
            root: root.to_owned(),
            files,
            figures: Vec::new(),
            shows: Vec::new(),
            sources: BTreeMap::new(),
            claims: Vec::new(),
            columns: Vec::new(),
            about,
            common: origin,
            code,
        };
        folder.read_measures()?;
        for name in folder.files.names("figures")? {
            folder.read_figure(&name, &readings)?;
        }
        folder.read_claims()?;
        Ok(folder)
    }

    fn read_measures(&mut self) -> Result<(), FolderError> {
        type Measures = BTreeMap<Spanned<String>, Spanned<MeasureFile>>;
        let Some((origin, measures)) = self.files.parsed::<Measures>("measures.toml")? else {
            return Ok(());
        };
        for (name, measure) in measures {
            plain(&origin, &name, "measure")?;
            let place = measure.span();
            let MeasureFile { run, orbit, lyapunov, rests, scan, sweep } = measure.into_inner();
            let given = [
                (Ask::Run, run),
                (Ask::Orbit, orbit),
                (Ask::Lyapunov, lyapunov),
                (Ask::Rests, rests),
                (Ask::Scan, scan),
                (Ask::Sweep, sweep),
            ];
            let mut given: Vec<_> =
                given.into_iter().filter_map(|(ask, words)| Some((ask, words?))).collect();
            let (Some((ask, words)), true) = (given.pop(), given.is_empty()) else {
                let why =
                    format!("measure `{}` asks no question, or more than one", name.get_ref());
                let help = "give it one of run, orbit, lyapunov, rests, scan, sweep".to_owned();
                return Err(FolderError::at(&origin, place, why, Some(help)));
            };
            let said = Said::new(&origin, &words, &self.common, &[])?;
            let question = said.question(ask, &self.root)?;
            self.sources.insert(name.into_inner(), Source { said, ask, question });
        }
        Ok(())
    }

    fn read_figure(&mut self, id: &str, readings: &[Given]) -> Result<(), FolderError> {
        let path = format!("figures/{id}.toml");
        let Some((origin, figure)) = self.files.parsed::<FigureFile>(&path)? else { return Ok(()) };
        if figure.panel.is_empty() {
            return Err(FolderError::at(
                &origin,
                0..0,
                "the figure has no panel",
                Some("add [[panel]]".into()),
            ));
        }
        let columns = match &figure.columns {
            Some(columns) if !(1..=6).contains(columns.get_ref()) => {
                return Err(FolderError::at(
                    &origin,
                    columns.span(),
                    "one to six panels stand in a row",
                    None,
                ));
            }
            Some(columns) => *columns.get_ref(),
            None => figure.panel.len().clamp(1, 3),
        };
        let none = [Given { name: String::new(), about: String::new(), words: Vec::new() }];
        let mut shown: Vec<&Given> =
            if readings.is_empty() { none.iter().collect() } else { readings.iter().collect() };
        if let Some(only) = &figure.readings {
            for name in only {
                known(&origin, name, readings)?;
            }
            shown.retain(|r| only.iter().any(|name| *name.get_ref() == r.name));
            if only.is_empty() {
                shown = none.iter().collect();
            }
        }
        for name in figure.panel.iter().flat_map(|panel| panel.get_ref().r#in.keys()) {
            known(&origin, name, readings)?;
            if !shown.iter().any(|r| r.name == *name.get_ref()) {
                let why =
                    format!("`in.{}` has no effect: no picture has this reading", name.get_ref());
                let help = "leave it out, or add it to `readings`".to_owned();
                return Err(FolderError::at(&origin, name.span(), why, Some(help)));
            }
        }
        let mut pictures = Vec::new();
        for reading in shown {
            let picture = self.picture(&origin, id, &figure, columns, reading)?;
            let mut others = self.figures.iter().flat_map(|figure| &figure.pictures);
            if others.any(|other| other.name == picture.name) {
                let why = format!("another figure has a picture called {}, too", picture.name);
                let help = "rename the figure's file, or the reading".to_owned();
                return Err(FolderError::at(&origin, 0..0, why, Some(help)));
            }
            pictures.push(picture);
        }
        self.figures.push(Figure {
            id: id.to_owned().into(),
            title: figure.title.into_inner().into(),
            pictures,
        });
        self.shows.push(figure.shows);
        Ok(())
    }

    /// A figure in one reading.
    fn picture(
        &mut self,
        origin: &Origin,
        id: &str,
        figure: &FigureFile,
        columns: usize,
        reading: &Given,
    ) -> Result<Picture, FolderError> {
        let at = if reading.name.is_empty() { String::new() } else { format!("@{}", reading.name) };
        let suffix = at.replace('@', "-");
        let (mut plots, mut panels, mut views) = (Vec::new(), Vec::new(), Vec::new());
        let mut labels = BTreeSet::new();
        for panel in &figure.panel {
            let (place, panel) = (panel.span(), panel.get_ref());
            let label = &panel.label;
            plain(origin, label, "label")?;
            if !labels.insert(label.get_ref()) {
                let why = format!("there are two panels `{}`", label.get_ref());
                return Err(FolderError::at(origin, label.span(), why, None));
            }
            let others = figure.panel.iter().map(|p| p.get_ref().label.get_ref());
            one_file(origin, label, "panel", others)?;
            let Some(draw) = panel.draw.as_ref().or(figure.draw.as_ref()) else {
                let help = "give draw, such as \"series\", in the panel or for the whole figure"
                    .to_owned();
                return Err(FolderError::at(
                    origin,
                    place,
                    "nothing says how the panel is drawn",
                    Some(help),
                ));
            };
            panel.refuse_idle_keys(origin, *draw.get_ref())?;
            let is_last = labels.len() == figure.panel.len();
            panel.refuse_idle_claim(origin, *draw.get_ref(), is_last)?;
            let drawn = Drawn {
                draw,
                axes: panel.axes.as_ref().or(figure.axes.as_ref()),
                camera: panel.camera.as_ref().or(figure.camera.as_ref()),
            };
            let said = panel.run.as_ref().map(|words| {
                let mut defaults = vec![&self.about.run];
                defaults.extend(&reading.words);
                let over = panel
                    .r#in
                    .iter()
                    .find(|(name, _)| *name.get_ref() == reading.name)
                    .map(|(_, words)| words);
                Said::new(origin, words, &self.common, &defaults)
                    .and_then(|said| said.over(over.map(Spanned::get_ref)))
            });
            let said = said.transpose()?;
            let question = if let Draw::Halves | Draw::Surface = draw.get_ref() {
                let (spec, view) = self.spec_and_view(origin, place, said.as_ref(), &drawn)?;
                let mut shown = FigurePanel::new(label.get_ref(), panel.title(), spec);
                shown.claim = panel.says.as_ref().map(|c| *c.get_ref());
                shown.repeats = panel
                    .repeats
                    .as_ref()
                    .map(|name| self.repeats(origin, name, &reading.name))
                    .transpose()?;
                let question: AnyQuestion = Recorded::Surfaces(shown.run.clone()).question();
                panels.push(shown);
                views.push((view, draw.span()));
                question
            } else {
                let plot = self.plot(origin, panel, place, said.as_ref(), &drawn)?;
                let question = plot.question.clone();
                plots.push(plot);
                question
            };
            if let Some(said) = said {
                self.sources.insert(
                    format!("{id}/{}{at}", label.get_ref()),
                    Source { said, ask: Ask::Run, question },
                );
            }
        }
        let mut caption = figure.caption.clone();
        let view = match views.first() {
            None => {
                if !reading.about.is_empty() {
                    caption = format!("{caption} Reading \"{}\": {}", reading.name, reading.about);
                }
                View::Plots(Plots { columns, plots }.into())
            }
            Some((first, _)) => {
                let other = views
                    .iter()
                    .find(|(view, _)| !alike(view, first))
                    .map(|(_, place)| place.clone());
                if let Some(place) =
                    other.or_else(|| (!plots.is_empty()).then(|| views[0].1.clone()))
                {
                    let why = "panels drawn as halves or surface stand in a figure of their own, \
                        with the same axes and camera";
                    return Err(FolderError::at(origin, place, why, None));
                }
                if let Some(columns) = &figure.columns {
                    let why = "`columns` has no effect on a figure drawn in this way";
                    return Err(FolderError::at(
                        origin,
                        columns.span(),
                        why,
                        Some("leave it out".into()),
                    ));
                }
                first.clone()
            }
        };
        let picture = Picture {
            name: format!("{id}{suffix}"),
            reading: if panels.is_empty() { None } else { reading.shown() },
            title: figure.title.get_ref().clone().into(),
            caption,
            view,
            panels,
            alterations: Vec::new(),
        };
        draft(&picture)
            .map_err(|e| FolderError::at(origin, figure.place_of(&e), e.to_string(), None))?;
        Ok(picture)
    }

    /// A run with h, plus and minus, and the way in which a figure of such runs is drawn.
    fn spec_and_view(
        &self,
        origin: &Origin,
        place: Range<usize>,
        said: Option<&Said>,
        drawn: &Drawn<'_>,
    ) -> Result<(RunSpec, View), FolderError> {
        let said = said.ok_or_else(|| {
            FolderError::at(
                origin,
                place,
                "the panel shows no run",
                Some("give run = { system = \"...\", ... }".into()),
            )
        })?;
        let Recorded::Surfaces(spec) = said.recorded(&self.root, Use::Picture)? else {
            return Err(said.complain("this way of drawing needs a system with h, plus and minus"));
        };
        let wrong = |at: Range<usize>, why: String| FolderError::at(origin, at, why, None);
        let frame = plot::Frame::from(&spec);
        let given = drawn.axes.map_or(Ok(Vec::new()), |axes| states(origin, axes, &frame))?;
        let kind = if *drawn.draw.get_ref() == Draw::Halves {
            PictureKind::Section
        } else {
            PictureKind::Space
        };
        let axes = plot::axes(&frame, kind, &given).map_err(|e| match e {
            PlotError::PathNeeded => said.complain_of("section", e.to_string()),
            _ => wrong(drawn.draw.span(), e.to_string()),
        })?;
        let view = match (kind, axes.as_slice(), drawn.camera) {
            (PictureKind::Section, _, Some(camera)) => {
                return Err(wrong(camera.span(), "`camera` has no effect on a section".to_owned()));
            }
            (PictureKind::Section, &[horizontal, vertical], None) => {
                View::Section { horizontal, vertical }
            }
            (PictureKind::Section, ..) => {
                return Err(wrong(
                    drawn.draw.span(),
                    "a section in halves has two axes".to_owned(),
                ));
            }
            (_, axes, camera) => {
                let (azimuth, elevation) =
                    camera.map_or(Ok((-60.0, 18.0)), |c| angles(origin, c))?;
                View::Space {
                    camera: Camera { axes: [axes[0], axes[1], axes[2]], azimuth, elevation },
                }
            }
        };
        Ok((spec, view))
    }

    /// The runs that repeat a panel: "STUDY/NAME".
    fn repeats(
        &self,
        origin: &Origin,
        name: &Spanned<String>,
        reading: &str,
    ) -> Result<Repeats, FolderError> {
        let found = name.get_ref().split_once('/').and_then(|(study, panel)| {
            let count = (self.code?.counts)(study, reading)?;
            Some(Repeats { panel: panel.to_owned(), count })
        });
        found.ok_or_else(|| {
            let why = format!("no committed runs are called `{}` in this reading", name.get_ref());
            FolderError::at(
                origin,
                name.span(),
                why,
                Some("name a study and one of its panels, or leave it out".into()),
            )
        })
    }

    fn plot(
        &mut self,
        origin: &Origin,
        panel: &PanelFile,
        place: Range<usize>,
        said: Option<&Said>,
        drawn: &Drawn<'_>,
    ) -> Result<Plot, FolderError> {
        let wrong = |at: Range<usize>, why: String, help: &str| {
            FolderError::at(origin, at, why, (!help.is_empty()).then(|| help.to_owned()))
        };
        let points = panel.points.as_ref().map(|points| self.points(origin, points)).transpose()?;
        let draw = *drawn.draw.get_ref();
        if draw == Draw::Columns {
            let y = panel.y.as_ref().map(Spanned::get_ref).filter(|y| !y.is_empty());
            let (Some(of), Some(x), Some(y)) = (&panel.of, &panel.x, y) else {
                let help = "give of = \"MEASURE\", x = \"COLUMN\" and y = [\"COLUMN\"]";
                return Err(wrong(drawn.draw.span(), "columns of which table?".into(), help));
            };
            let names = panel.names.as_ref().map(|n| n.get_ref().clone()).unwrap_or_default();
            if let Some(given) = panel.names.as_ref().filter(|n| n.get_ref().len() != y.len()) {
                let why = format!("{} names for {} columns", names.len(), y.len());
                return Err(wrong(given.span(), why, "give one for each of y"));
            }
            let question = self.source(origin, of)?.question.clone();
            self.columns.push(ReadColumns {
                origin: origin.clone(),
                question: question.clone(),
                table: panel.table.clone(),
                columns: std::iter::once(x).chain(y).cloned().collect(),
                words: false,
            });
            let columns = Columns {
                table: panel.table.as_ref().map(|t| t.get_ref().clone()),
                x: x.get_ref().clone(),
                y: y.iter().map(|name| name.get_ref().clone()).collect(),
                dots: panel.dots.as_ref().is_some_and(|d| *d.get_ref()),
                labels: panel.labels.as_ref().map(|l| l.get_ref().clone()),
                names,
            };
            return Ok(Plot {
                label: panel.label.get_ref().clone(),
                title: panel.title(),
                question,
                drawing: Drawing::Columns(columns),
                points,
            });
        }
        if draw == Draw::Map {
            let (question, over) = self.mapped(origin, panel, drawn.draw)?;
            return Ok(Plot {
                label: panel.label.get_ref().clone(),
                title: panel.title(),
                question,
                drawing: Drawing::Map(over.into()),
                points,
            });
        }
        let Some(said) = said else {
            return Err(wrong(
                place,
                "the panel shows no run".into(),
                "give run = { system = \"...\", ... }",
            ));
        };
        let recorded = said.recorded(&self.root, Use::Picture)?;
        let frame = recorded.frame();
        let kind = match draw {
            Draw::Series => PictureKind::Series,
            Draw::Plane => PictureKind::Plane,
            Draw::Space => PictureKind::Space,
            Draw::Section | Draw::Columns | Draw::Map | Draw::Halves | Draw::Surface => {
                PictureKind::Section
            }
        };
        let axes = drawn.axes.map_or(Ok(Vec::new()), |axes| states(origin, axes, &frame))?;
        let camera = match (drawn.camera, kind) {
            (None, _) => None,
            (Some(camera), PictureKind::Space) => Some(angles(origin, camera)?),
            (Some(camera), _) => {
                return Err(wrong(
                    camera.span(),
                    "`camera` has an effect on draw = \"space\" alone".into(),
                    "leave it out",
                ));
            }
        };
        let look = Look { kind, axes, camera, title: None };
        plot::axes(&frame, kind, &look.axes).map_err(|e| match e {
            PlotError::PathNeeded => said.complain_of("section", e.to_string()),
            _ => wrong(drawn.draw.span(), e.to_string(), ""),
        })?;
        Ok(Plot {
            label: panel.label.get_ref().clone(),
            title: panel.title(),
            question: recorded.question(),
            drawing: Drawing::Run(recorded.into(), look),
            points,
        })
    }

    /// The question of a map, and the two settings over which its runs vary.
    fn mapped(
        &self,
        origin: &Origin,
        panel: &PanelFile,
        draw: &Spanned<Draw>,
    ) -> Result<(AnyQuestion, [Scanned; 2]), FolderError> {
        let wrong = |at: Range<usize>, why: String, help: &str| {
            FolderError::at(origin, at, why, Some(help.to_owned()))
        };
        let Some(of) = &panel.of else {
            return Err(wrong(draw.span(), "a map of which runs?".into(), "give of = \"MEASURE\""));
        };
        let source = self.source(origin, of)?;
        let name = of.get_ref();
        let over = source.question.json()["sweep"]["over"].clone();
        let axes: Vec<Axis> = serde_json::from_value(over).unwrap_or_default();
        let [x, y] = axes.as_slice() else {
            let why = format!("`{name}` does not ask for runs over two settings");
            return Err(wrong(
                of.span(),
                why,
                "name a scan or sweep with over = [\"...\", \"...\"]",
            ));
        };
        for axis in [x, y] {
            if axis.is_random() {
                let why = format!("`{name}` draws `{}` at random", axis.coordinate);
                return Err(wrong(of.span(), why, "give FROM..TO:COUNT in its `over`"));
            }
            if matches!(axis.values, Values::Names(_)) {
                let why = format!("`{name}` varies `{}` over names", axis.coordinate);
                return Err(wrong(of.span(), why, "a map is drawn over numbers"));
            }
        }
        let mut over = [Scanned::from(x), Scanned::from(y)];
        for (of, title) in over.iter_mut().zip(panel.labels.iter().flat_map(|l| l.get_ref())) {
            of.title = markup::literal(title);
        }
        Ok((source.question.clone(), over))
    }

    fn points(&self, origin: &Origin, points: &Spanned<PointsFile>) -> Result<Points, FolderError> {
        let PointsFile { name, file } = points.get_ref();
        let wrong = |why: String| FolderError::at(origin, points.span(), why, None);
        if !lies_within(file) {
            return Err(wrong(format!("the file `{file}` does not lie in this folder")));
        }
        let text = self.files.text(file).map_err(|error| wrong(error.to_string()))?;
        let text = text.ok_or_else(|| wrong(format!("there is no file `{file}`")))?;
        let mut rows = text
            .lines()
            .enumerate()
            .map(|(i, line)| (i + 1, line.trim()))
            .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'));
        let pair = |row: &str| {
            let mut numbers = row.split(',').map(|n| n.trim().trim_matches('"').parse::<f64>());
            match (numbers.next(), numbers.next()) {
                (Some(Ok(x)), Some(Ok(y))) if x.is_finite() && y.is_finite() => Some([x, y]),
                _ => None,
            }
        };
        if rows.next().is_some_and(|(_, row)| pair(row).is_some()) {
            let why = "its first line is two numbers: give a line of column names before it";
            return Err(wrong(format!("{file}: {why}")));
        }
        let mut found = Vec::new();
        for (line, row) in rows {
            let point = pair(row);
            found.push(point.ok_or_else(|| {
                wrong(format!("{file}, line {line}: `{row}` is not two numbers"))
            })?);
        }
        if found.is_empty() {
            return Err(wrong(format!("{file} has no points below its column names")));
        }
        Ok(Points { name: name.clone(), points: found })
    }

    /// The thing that is named.
    fn source(&self, origin: &Origin, name: &Spanned<String>) -> Result<&Source, FolderError> {
        self.sources.get(name.get_ref()).ok_or_else(|| {
            let known: Vec<&str> = self.sources.keys().map(String::as_str).collect();
            let help = match nearest(name.get_ref(), &known) {
                Some(near) => format!("did you mean `{near}`?"),
                None if known.is_empty() => {
                    "add a panel to figures/ or a measure to measures.toml".to_owned()
                }
                None => format!("there are {}", known.join(", ")),
            };
            let why = format!("there is no panel or measure `{}`", name.get_ref());
            FolderError::at(origin, name.span(), why, Some(help))
        })
    }

    fn read_claims(&mut self) -> Result<(), FolderError> {
        let Some((origin, file)) = self.files.parsed::<ClaimsFile>("claims.toml")? else {
            return Ok(());
        };
        let mut known = BTreeSet::new();
        for claim in file.claim {
            plain(&origin, &claim.get_ref().id, "claim")?;
            if !known.insert(claim.get_ref().id.get_ref().clone()) {
                let why = format!("there are two claims `{}`", claim.get_ref().id.get_ref());
                return Err(FolderError::at(&origin, claim.get_ref().id.span(), why, None));
            }
            let (read, words) = (claim.get_ref().column(), claim.get_ref().counts_words());
            let claim = Claim::read(&origin, claim, &|name| self.source(&origin, name))?;
            self.claims.push(claim);
            let Some((column, table, of)) = read else { continue };
            for name in of {
                self.columns.push(ReadColumns {
                    origin: origin.clone(),
                    question: self.source(&origin, &name)?.question.clone(),
                    table: table.clone(),
                    columns: vec![column.clone()],
                    words,
                });
            }
        }
        Ok(())
    }
}

/// A reading, with the words of those that it extends before its own.
struct Given {
    name: String,
    about: String,
    words: Vec<Words>,
}

impl Given {
    /// The reading as pictures show it; none for a paper without readings.
    fn shown(&self) -> Option<ParameterReading> {
        let mut parameters: Vec<(String, f64)> = Vec::new();
        for (name, value) in self.words.iter().flat_map(Words::parameters) {
            match parameters.iter_mut().find(|(known, _)| *known == name) {
                Some((_, old)) => *old = value,
                None => parameters.push((name, value)),
            }
        }
        let name = self.name.clone();
        (!name.is_empty()).then_some(ParameterReading { name, parameters })
    }
}

fn readings(origin: &Origin, about: &About) -> Result<Vec<Given>, FolderError> {
    let named = |name: &str| about.readings.iter().find(|(k, _)| k.get_ref() == name);
    let mut all = Vec::new();
    for (name, reading) in &about.readings {
        plain(origin, name, "reading")?;
        one_file(origin, name, "reading", about.readings.keys().map(Spanned::get_ref))?;
        let mut words = vec![reading.run.clone()];
        let mut seen = vec![name.get_ref().as_str()];
        let mut at = reading;
        while let Some(extends) = &at.extends {
            let Some((base, next)) = named(extends.get_ref()) else {
                let why = format!("there is no reading `{}`", extends.get_ref());
                return Err(FolderError::at(origin, extends.span(), why, None));
            };
            if seen.contains(&base.get_ref().as_str()) {
                let why = format!(
                    "readings extend each other in a circle: {} -> {}",
                    seen.join(" -> "),
                    base.get_ref()
                );
                return Err(FolderError::at(
                    origin,
                    extends.span(),
                    why,
                    Some("let one of them stand by itself".into()),
                ));
            }
            seen.push(base.get_ref());
            words.insert(0, next.run.clone());
            at = next;
        }
        all.push(Given { name: name.get_ref().clone(), about: reading.about.clone(), words });
    }
    Ok(all)
}

/// Refuses a name that is another one's with an ending: their data would have files of one name,
/// NAME-TABLE.csv.
fn one_file<'a>(
    origin: &Origin,
    name: &Spanned<String>,
    of: &str,
    mut others: impl Iterator<Item = &'a String>,
) -> Result<(), FolderError> {
    let begins = |other: &&String| {
        name.get_ref().strip_prefix(other.as_str()).is_some_and(|end| end.starts_with('-'))
    };
    let same = |other: &&String| {
        *other != name.get_ref() && other.eq_ignore_ascii_case(name.get_ref().as_str())
    };
    let Some(other) = others.find(|other| begins(other) || same(other)) else { return Ok(()) };
    let why = if same(&other) {
        format!("{of} `{}` and {of} `{other}` differ in case alone", name.get_ref())
    } else {
        format!("{of} `{}` begins with {of} `{other}` and -", name.get_ref())
    };
    let help = "their data would have files of one name; give it another".to_owned();
    Err(FolderError::at(origin, name.span(), why, Some(help)))
}

/// Whether panels can stand in one picture of these kinds.
fn alike(one: &View, other: &View) -> bool {
    match (one, other) {
        (View::Space { camera: a }, View::Space { camera: b }) => a == b,
        (
            View::Section { horizontal: x, vertical: y },
            View::Section { horizontal: u, vertical: v },
        ) => (x, y) == (u, v),
        _ => false,
    }
}

/// The states that are named.
fn states(
    origin: &Origin,
    given: &Spanned<Vec<String>>,
    frame: &plot::Frame<'_>,
) -> Result<Vec<usize>, FolderError> {
    let names: Vec<&str> = frame.states.iter().map(|s| s.name.as_str()).collect();
    let index = |name: &String| {
        names.iter().position(|n| *n == name.as_str()).ok_or_else(|| {
            let help = nearest(name, &names)
                .map_or(format!("states are {}", names.join(", ")), |near| {
                    format!("did you mean `{near}`?")
                });
            FolderError::at(origin, given.span(), format!("there is no state `{name}`"), Some(help))
        })
    };
    given.get_ref().iter().map(index).collect()
}

/// Azimuth and elevation.
fn angles(origin: &Origin, camera: &Spanned<[f64; 2]>) -> Result<(f64, f64), FolderError> {
    let [azimuth, elevation] = *camera.get_ref();
    if azimuth.is_finite() && elevation.abs() <= 90.0 {
        return Ok((azimuth, elevation));
    }
    let why = "azimuth and elevation are degrees, the elevation from -90 to 90";
    Err(FolderError::at(origin, camera.span(), why, None))
}

/// Refuses a reading that the paper does not have.
fn known(origin: &Origin, name: &Spanned<String>, readings: &[Given]) -> Result<(), FolderError> {
    let names: Vec<&str> = readings.iter().map(|r| r.name.as_str()).collect();
    if names.contains(&name.get_ref().as_str()) {
        return Ok(());
    }
    let help = nearest(name.get_ref(), &names).map(|near| format!("did you mean `{near}`?"));
    Err(FolderError::at(
        origin,
        name.span(),
        format!("there is no reading `{}`", name.get_ref()),
        help,
    ))
}

/// Refuses a date with a time, and a time alone.
fn day(origin: &Origin, key: &str, given: &Spanned<Datetime>) -> Result<(), FolderError> {
    let date = given.get_ref();
    if date.date.is_some() && date.time.is_none() {
        return Ok(());
    }
    let why = format!("`{key}` is a day, and this is {date}");
    let help = format!("give a date of TOML: {key} = 2026-11-27");
    Err(FolderError::at(origin, given.span(), why, Some(help)))
}

/// A name that files, pages and addresses can carry as it is.
fn plain(origin: &Origin, name: &Spanned<String>, what: &str) -> Result<(), FolderError> {
    if is_plain_name(name.get_ref()) {
        return Ok(());
    }
    let why = format!("the {what} `{}` is no plain name", name.get_ref().escape_debug());
    let help = "use letters, digits, - and _, such as fig3 or multipliers-24".to_owned();
    Err(FolderError::at(origin, name.span(), why, Some(help)))
}

/// Whether a path, by its words alone, leads to something in the folder that it begins from.
fn lies_within(path: &str) -> bool {
    let inner = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    let mut components = Path::new(path).components();
    components.all(inner) && Path::new(path).file_name().is_some()
}
