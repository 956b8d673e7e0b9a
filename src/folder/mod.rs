//! A paper as a folder: its systems, figures and claims as data, which are made, checked and blessed with `twofold paper`.
//!
//! ```text
//! paper.toml       citation, what holds for all runs, readings of the paper's parameters, what it leaves open
//! systems/*.toml   its equations
//! figures/*.toml   its figures, panel by panel
//! measures.toml    what its claims rest on beside the figures: orbits, exponents, rests, runs
//! claims.toml      what it says, each sentence with a check and the day on which its rule was fixed
//! data/*.csv       numbers read off the paper, drawn over panels
//! expected/        the hashes and outcomes that were found before
//! ```
//!
//! Questions are written in the words of the command line ([`words`]); `docs/papers.md` has every key.

pub mod check;
pub mod make;
mod page;
pub mod words;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use serde::Deserialize;
use serde::de::DeserializeOwned;
use toml::Spanned;

use crate::cli::flags::Use;
use crate::job::AnyQuestion;
use crate::paper::draw::plot::{self, Kind, Look};
use crate::paper::plots::{Columns, Drawing, Plot, Plots, Points};
use crate::paper::{Figure, Picture, View};
use crate::record::FileError;
use crate::record::files::read_text;
use crate::record::manifest::is_plain_name;
use crate::record::read_tree;
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
    /// Where it lies.
    pub root: PathBuf,
    /// The paper.
    pub about: About,
    /// The file that says so.
    common: Origin,
    /// Its figures, in the order of their names.
    pub figures: Vec<Figure>,
    /// What in the paper each figure shows, in the same order.
    pub shows: Vec<String>,
    /// Everything that claims may read, by name: "fig3/a" for a panel, in a reading "fig3/a@printed"; a measure by its own.
    pub sources: BTreeMap<String, Source>,
    /// What it says.
    pub claims: Vec<Claim>,
}

/// What a claim reads.
#[derive(Clone, Debug)]
pub struct Source {
    /// In the words of the file.
    pub said: Said,
    /// What is asked for.
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
    /// Where it appeared.
    #[serde(default)]
    pub journal: String,
    /// Its digital object identifier.
    #[serde(default)]
    pub doi: String,
    /// Its number on arXiv.
    #[serde(default)]
    pub arxiv: String,
    /// What it is about, in our words, and which text the equations were taken from.
    pub summary: String,
    /// The day on which the folder was published, for archives.
    pub published: Option<toml::value::Datetime>,
    /// The folder's licence for archives, by its SPDX name: "CC-BY-4.0".
    #[serde(default)]
    pub license: String,
    /// What it leaves open.
    #[serde(default)]
    pub open: Vec<String>,
    /// Words that hold for every run of a panel.
    #[serde(default)]
    run: Words,
    /// Readings of its parameters, if it can be read in more than one way: a picture of each figure is made for each.
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
    title: String,
    /// Caption, in our words.
    caption: String,
    /// What in the paper it shows: "fig. 3".
    #[serde(default)]
    shows: String,
    /// Panels in a row [default: at most three].
    columns: Option<Spanned<usize>>,
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
    #[serde(default)]
    title: String,
    /// How it is drawn.
    draw: Spanned<Draw>,
    /// The run that it shows; of `draw = "columns"` nothing.
    run: Option<Spanned<Words>>,
    /// States on the axes.
    axes: Option<Spanned<Vec<String>>>,
    /// Azimuth and elevation in degrees, of a panel in space.
    camera: Option<Spanned<[f64; 2]>>,
    /// The measure whose table is drawn.
    of: Option<Spanned<String>>,
    /// Its table [default: the first].
    table: Option<String>,
    /// The horizontal column.
    x: Option<String>,
    /// The vertical columns.
    #[serde(default)]
    y: Vec<String>,
    /// Dots instead of a line.
    #[serde(default)]
    dots: bool,
    /// Numbers of the paper to be drawn over it.
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
}

/// Numbers read off the paper.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct PointsFile {
    /// What they are.
    name: String,
    /// A CSV file of the folder whose first two columns are the horizontal and the vertical values.
    file: String,
}

/// A measure: `[NAME]` of measures.toml.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct MeasureFile {
    /// A run, as `twofold run` follows it: the facts of its answer, and its table.
    run: Option<Spanned<Words>>,
    /// A closed orbit, as `twofold orbit` finds it: period, point, multipliers; with `along` its branch.
    orbit: Option<Spanned<Words>>,
    /// Lyapunov exponents, as `twofold lyapunov` computes them.
    lyapunov: Option<Spanned<Words>>,
    /// Equilibria and pseudo-equilibria, as `twofold rests` finds them.
    rests: Option<Spanned<Words>>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ClaimsFile {
    #[serde(default)]
    claim: Vec<Spanned<ClaimFile>>,
}

/// A file of a folder: its path there and its text.
type Origin = Arc<(String, String)>;

impl Folder {
    /// Reads a folder, all of it, and checks that every question can be asked and every claim reads something.
    ///
    /// # Errors
    /// What is wrong first, with its file, place and remedy.
    pub fn read(root: &Path) -> Result<Self, FolderError> {
        let (origin, about): (Origin, About) = parsed(root, "paper.toml")?.ok_or_else(|| {
            FolderError::Missing(format!(
                "{}: there is no paper.toml; name a paper's folder, or make one with twofold paper new",
                root.display()
            ))
        })?;
        if *about.format.get_ref() != 1 {
            let why = format!("format {} is not known to this program", about.format.get_ref());
            return Err(FolderError::at(&origin, about.format.span(), why, Some("write format = 1".into())));
        }
        let readings = readings(&origin, &about)?;
        let mut folder = Self {
            root: root.to_owned(),
            figures: Vec::new(),
            shows: Vec::new(),
            sources: BTreeMap::new(),
            claims: Vec::new(),
            about,
            common: origin,
        };
        folder.read_measures()?;
        for name in names(root, "figures")? {
            folder.read_figure(&name, &readings)?;
        }
        folder.read_claims()?;
        Ok(folder)
    }

    fn read_measures(&mut self) -> Result<(), FolderError> {
        type Measures = BTreeMap<Spanned<String>, Spanned<MeasureFile>>;
        let Some((origin, measures)) = parsed::<Measures>(&self.root, "measures.toml")? else { return Ok(()) };
        for (name, measure) in measures {
            plain(&origin, &name, "measure")?;
            let place = measure.span();
            let MeasureFile { run, orbit, lyapunov, rests } = measure.into_inner();
            let given = [(Ask::Run, run), (Ask::Orbit, orbit), (Ask::Lyapunov, lyapunov), (Ask::Rests, rests)];
            let mut given: Vec<_> = given.into_iter().filter_map(|(ask, words)| Some((ask, words?))).collect();
            let (Some((ask, words)), true) = (given.pop(), given.is_empty()) else {
                let why = format!("measure `{}` asks no question, or more than one", name.get_ref());
                let help = "give it one of run, orbit, lyapunov, rests".to_owned();
                return Err(FolderError::at(&origin, place, why, Some(help)));
            };
            let said = Said::new(&origin, &words, &self.common, &[])?;
            let question = said.question(ask, &self.root)?;
            self.sources.insert(name.into_inner(), Source { said, ask, question });
        }
        Ok(())
    }

    fn read_figure(&mut self, id: &str, readings: &[Reading]) -> Result<(), FolderError> {
        let path = format!("figures/{id}.toml");
        let Some((origin, figure)) = parsed::<FigureFile>(&self.root, &path)? else { return Ok(()) };
        if figure.panel.is_empty() {
            return Err(FolderError::at(&origin, 0..0, "the figure has no panel", Some("add [[panel]]".into())));
        }
        let columns = match &figure.columns {
            Some(columns) if !(1..=6).contains(columns.get_ref()) => {
                return Err(FolderError::at(&origin, columns.span(), "one to six panels stand in a row", None));
            }
            Some(columns) => *columns.get_ref(),
            None => figure.panel.len().clamp(1, 3),
        };
        let mut pictures = Vec::new();
        let none = [Reading { name: String::new(), about: String::new(), words: Vec::new() }];
        for reading in if readings.is_empty() { &none[..] } else { readings } {
            let mut plots = Vec::new();
            for panel in &figure.panel {
                let label = &panel.get_ref().label;
                plain(&origin, label, "label")?;
                if plots.iter().any(|p: &Plot| p.label == *label.get_ref()) {
                    let why = format!("there are two panels `{}`", label.get_ref());
                    return Err(FolderError::at(&origin, label.span(), why, None));
                }
                let plot = self.plot(&origin, panel, reading)?;
                if let Some(words) = &panel.get_ref().run {
                    let at = if reading.name.is_empty() { String::new() } else { format!("@{}", reading.name) };
                    let said = self.said(&origin, words, reading)?;
                    let source = Source { said, ask: Ask::Run, question: plot.question.clone() };
                    self.sources.insert(format!("{id}/{}{at}", label.get_ref()), source);
                }
                plots.push(plot);
            }
            let (name, mut caption) = (id.to_owned(), figure.caption.clone());
            let name = if reading.name.is_empty() { name } else { format!("{name}-{}", reading.name) };
            if !reading.about.is_empty() {
                caption = format!("{caption} Reading \"{}\": {}", reading.name, reading.about);
            }
            pictures.push(Picture {
                name,
                reading: None,
                title: figure.title.clone().into(),
                caption,
                view: View::Plots(Plots { columns, plots }.into()),
                panels: Vec::new(),
                alterations: Vec::new(),
            });
        }
        self.figures.push(Figure { id: id.to_owned().into(), title: figure.title.into(), pictures });
        self.shows.push(figure.shows);
        Ok(())
    }

    fn said(&self, origin: &Origin, words: &Spanned<Words>, reading: &Reading) -> Result<Said, FolderError> {
        let mut defaults = vec![&self.about.run];
        defaults.extend(&reading.words);
        Said::new(origin, words, &self.common, &defaults)
    }

    fn plot(&self, origin: &Origin, panel: &Spanned<PanelFile>, reading: &Reading) -> Result<Plot, FolderError> {
        let place = panel.span();
        let panel = panel.get_ref();
        let wrong = |at: Range<usize>, why: String, help: &str| {
            FolderError::at(origin, at, why, (!help.is_empty()).then(|| help.to_owned()))
        };
        let points = panel.points.as_ref().map(|points| self.points(origin, points)).transpose()?;
        let draw = *panel.draw.get_ref();
        if draw == Draw::Columns {
            let idle =
                [("run", panel.run.as_ref().map(Spanned::span)), ("axes", panel.axes.as_ref().map(Spanned::span))];
            if let Some((key, Some(at))) = idle.into_iter().find(|(_, at)| at.is_some()) {
                return Err(wrong(at, format!("`{key}` has no effect on draw = \"columns\""), "leave it out"));
            }
            let (Some(of), Some(x), false) = (&panel.of, &panel.x, panel.y.is_empty()) else {
                let help = "give of = \"MEASURE\", x = \"COLUMN\" and y = [\"COLUMN\"]";
                return Err(wrong(panel.draw.span(), "columns of which table?".into(), help));
            };
            let source = self.source(origin, of)?;
            let columns = Columns { table: panel.table.clone(), x: x.clone(), y: panel.y.clone(), dots: panel.dots };
            return Ok(Plot {
                label: panel.label.get_ref().clone(),
                title: panel.title.clone(),
                question: source.question.clone(),
                drawing: Drawing::Columns(columns),
                points,
            });
        }
        if let Some(of) = &panel.of {
            return Err(wrong(
                of.span(),
                "`of` has an effect on draw = \"columns\" alone".into(),
                "give run = { ... }",
            ));
        }
        let Some(words) = &panel.run else {
            return Err(wrong(place, "the panel shows no run".into(), "give run = { system = \"...\", ... }"));
        };
        let said = self.said(origin, words, reading)?;
        let recorded = said.recorded(&self.root, Use::Picture)?;
        let frame = recorded.frame();
        let kind = match draw {
            Draw::Series => Kind::Series,
            Draw::Plane => Kind::Plane,
            Draw::Space => Kind::Space,
            Draw::Section | Draw::Columns => Kind::Section,
        };
        let mut axes = Vec::new();
        if let Some(given) = &panel.axes {
            let names: Vec<&str> = frame.states.iter().map(|s| s.name.as_str()).collect();
            for name in given.get_ref() {
                let Some(i) = names.iter().position(|n| *n == name.as_str()) else {
                    let help = nearest(name, &names)
                        .map_or(format!("states are {}", names.join(", ")), |near| format!("did you mean `{near}`?"));
                    return Err(wrong(given.span(), format!("there is no state `{name}`"), &help));
                };
                axes.push(i);
            }
        }
        let camera = match (&panel.camera, kind) {
            (None, _) => None,
            (Some(camera), Kind::Space) => {
                let [azimuth, elevation] = *camera.get_ref();
                if !(azimuth.is_finite() && elevation.abs() <= 90.0) {
                    return Err(wrong(
                        camera.span(),
                        "azimuth and elevation are degrees, the elevation from -90 to 90".into(),
                        "",
                    ));
                }
                Some((azimuth, elevation))
            }
            (Some(camera), _) => {
                return Err(wrong(
                    camera.span(),
                    "`camera` has an effect on draw = \"space\" alone".into(),
                    "leave it out",
                ));
            }
        };
        let look = Look { kind, axes, camera, title: None };
        plot::axes(&frame, kind, &look.axes).map_err(|e| wrong(panel.draw.span(), e.to_string(), ""))?;
        Ok(Plot {
            label: panel.label.get_ref().clone(),
            title: panel.title.clone(),
            question: recorded.question(),
            drawing: Drawing::Run(recorded.into(), look),
            points,
        })
    }

    fn points(&self, origin: &Origin, points: &Spanned<PointsFile>) -> Result<Points, FolderError> {
        let PointsFile { name, file } = points.get_ref();
        let wrong = |why: String| FolderError::at(origin, points.span(), why, None);
        if !Path::new(file).components().all(|c| matches!(c, Component::Normal(_))) {
            return Err(wrong(format!("the file `{file}` does not lie in this folder")));
        }
        let text = read_text(&self.root.join(file))?;
        let rows = text.lines().map(str::trim).filter(|l| !l.is_empty() && !l.starts_with('#')).skip(1);
        let mut found = Vec::new();
        for row in rows {
            let mut numbers = row.split(',').map(|n| n.trim().parse::<f64>());
            match (numbers.next(), numbers.next()) {
                (Some(Ok(x)), Some(Ok(y))) if x.is_finite() && y.is_finite() => found.push([x, y]),
                _ => return Err(wrong(format!("{file}: `{row}` is not two numbers"))),
            }
        }
        Ok(Points { name: name.clone(), points: found })
    }

    /// What is called so.
    fn source(&self, origin: &Origin, name: &Spanned<String>) -> Result<&Source, FolderError> {
        self.sources.get(name.get_ref()).ok_or_else(|| {
            let known: Vec<&str> = self.sources.keys().map(String::as_str).collect();
            let help = match nearest(name.get_ref(), &known) {
                Some(near) => format!("did you mean `{near}`?"),
                None if known.is_empty() => "add a panel to figures/ or a measure to measures.toml".to_owned(),
                None => format!("there are {}", known.join(", ")),
            };
            let why = format!("there is no panel or measure `{}`", name.get_ref());
            FolderError::at(origin, name.span(), why, Some(help))
        })
    }

    fn read_claims(&mut self) -> Result<(), FolderError> {
        let Some((origin, file)) = parsed::<ClaimsFile>(&self.root, "claims.toml")? else { return Ok(()) };
        let mut known = BTreeSet::new();
        for claim in file.claim {
            plain(&origin, &claim.get_ref().id, "claim")?;
            if !known.insert(claim.get_ref().id.get_ref().clone()) {
                let why = format!("there are two claims `{}`", claim.get_ref().id.get_ref());
                return Err(FolderError::at(&origin, claim.get_ref().id.span(), why, None));
            }
            let claim = Claim::read(&origin, claim, &|name| self.source(&origin, name).map(|_| ()))?;
            self.claims.push(claim);
        }
        Ok(())
    }
}

/// A reading, with the words of those that it extends before its own.
struct Reading {
    name: String,
    about: String,
    words: Vec<Words>,
}

fn readings(origin: &Origin, about: &About) -> Result<Vec<Reading>, FolderError> {
    let named = |name: &str| about.readings.iter().find(|(k, _)| k.get_ref() == name);
    let mut all = Vec::new();
    for (name, reading) in &about.readings {
        plain(origin, name, "reading")?;
        let mut words = vec![reading.run.clone()];
        let mut seen = vec![name.get_ref().as_str()];
        let mut at = reading;
        while let Some(extends) = &at.extends {
            let Some((base, next)) = named(extends.get_ref()) else {
                let why = format!("there is no reading `{}`", extends.get_ref());
                return Err(FolderError::at(origin, extends.span(), why, None));
            };
            if seen.contains(&base.get_ref().as_str()) {
                let why =
                    format!("readings extend each other in a circle: {} -> {}", seen.join(" -> "), base.get_ref());
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
        all.push(Reading { name: name.get_ref().clone(), about: reading.about.clone(), words });
    }
    Ok(all)
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

/// The TOML files of a part of the folder, by name.
fn names(root: &Path, part: &str) -> Result<Vec<String>, FolderError> {
    let folder = root.join(part);
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let tree = read_tree(&folder, &|path| path.ends_with(".toml") && !path.contains('/'))?;
    let mut names = Vec::new();
    for file in tree.files {
        let name = file.path.trim_end_matches(".toml").to_owned();
        if !is_plain_name(&name) {
            let why = format!("{part}/{}: no plain name; use letters, digits, - and _", file.path.escape_debug());
            return Err(FolderError::Missing(why));
        }
        names.push(name);
    }
    names.sort();
    Ok(names)
}

/// A file of the folder, if it is there.
fn parsed<T: DeserializeOwned>(root: &Path, path: &str) -> Result<Option<(Origin, T)>, FolderError> {
    let file = root.join(path);
    if !file.exists() {
        return Ok(None);
    }
    let text = read_text(&file)?;
    let origin = Arc::new((path.to_owned(), text));
    match toml::from_str(&origin.1) {
        Ok(read) => Ok(Some((origin, read))),
        Err(error) => {
            let message = error.message().lines().next().unwrap_or_default().to_owned();
            Err(FolderError::at(&origin, error.span().unwrap_or(0..0), message, None))
        }
    }
}
