//! Pictures whose panels are drawn from answers of any kind, of systems of any dimension: the
//! figures of a paper's folder.

use std::collections::BTreeSet;
use std::sync::Arc;

use serde_json::json;
use twofold_hybrid::Model;
use twofold_hybrid::motion::Record;
use twofold_job::general::GeneralRun;
use twofold_job::record::Hash;
use twofold_job::spec::RunSpec;
use twofold_job::{Answer, AnyQuestion, Column, Entry, Run, Table};
use twofold_render::markup;
use twofold_render::sheet::{
    Axis, ColumnWidth, Content, DotStyle, LegendEntry, LegendKey, LineStyle, MarkerShape,
    MarkerStyle, PlanePanel, Sheet,
};
use twofold_render::style;
use twofold_system::System;

use super::draw::plot::{self, Crossed, Frame, Look};
use super::draw::scan::{self, Scanned};
use super::tables::{column, table};
use super::wording;

/// The panels of a picture.
#[derive(Clone, Debug)]
pub struct Plots {
    /// Number of panels in a row.
    pub columns: usize,
    /// The panels, row by row.
    pub plots: Vec<Plot>,
}

/// A panel: a question, and how its answer is drawn.
#[derive(Clone, Debug)]
pub struct Plot {
    /// "a", "i" ...
    pub label: String,
    /// A few words above the panel, as plain text.
    pub title: String,
    /// The question.
    pub question: AnyQuestion,
    /// Drawing of the answer.
    pub drawing: Drawing,
    /// Numbers of the paper that are drawn over it.
    pub points: Option<Points>,
}

/// Drawing of an answer.
#[derive(Clone, Debug)]
pub enum Drawing {
    /// A run, as `twofold plot` draws it.
    Run(Box<Recorded>, Look),
    /// Columns of a table against another one.
    Columns(Columns),
    /// Endings of a scan's or sweep's runs over two settings, as `twofold scan` draws them.
    Map(Box<[Scanned; 2]>),
}

/// A run of a system of either kind.
#[derive(Clone, Debug)]
pub enum Recorded {
    /// Of a system with h, plus and minus.
    Surfaces(RunSpec),
    /// Of a general system, with the equation of its section as text.
    General(GeneralRun, Option<String>),
}

/// Columns of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns {
    /// The table; the first one if none is named.
    pub table: Option<String>,
    /// The horizontal column.
    pub x: String,
    /// The vertical columns.
    pub y: Vec<String>,
    /// Dots instead of a line.
    pub dots: bool,
    /// Titles of the axes as plain text, instead of the columns' names.
    pub labels: Option<[String; 2]>,
    /// Names of the vertical columns in the legend, as plain text, instead of the columns' own.
    pub names: Vec<String>,
}

/// Numbers read off a paper.
#[derive(Clone, Debug, PartialEq)]
pub struct Points {
    /// Name of the numbers, as plain text.
    pub name: String,
    /// Horizontal and vertical values.
    pub points: Vec<[f64; 2]>,
}

impl Points {
    /// The hash of these points and of the data that they are drawn over.
    pub(super) fn hash_over(&self, data: &Hash) -> Hash {
        Hash::of_json(&json!({ "data": data, "points": self.points }))
    }
}

impl Recorded {
    /// The run as a question.
    pub fn question(&self) -> AnyQuestion {
        match self {
            Recorded::Surfaces(spec) => Arc::new(Run(spec.clone())),
            Recorded::General(run, _) => Arc::new(run.clone()),
        }
    }

    /// Data about it that a picture needs.
    pub fn frame(&self) -> Frame<'_> {
        match self {
            Recorded::Surfaces(spec) => Frame::from(spec),
            Recorded::General(run, section) => {
                let definition = run.model.definition();
                let crossed = |text| Crossed::of(text, &run.model.coordinates());
                Frame {
                    title: definition.title(),
                    states: definition.states(),
                    axes: definition.axes(),
                    system: None,
                    section: match &run.options.record {
                        Record::Section(_) => section.as_deref().map(crossed),
                        _ => None,
                    },
                    times: (run.options.t_start, run.options.t_end),
                }
            }
        }
    }
}

impl Plots {
    /// Everything that is drawn and not asked, as text: a change of it is another picture.
    pub(super) fn looks(&self) -> String {
        let looks: Vec<_> = self
            .plots
            .iter()
            .map(|p| {
                let drawing = match &p.drawing {
                    Drawing::Run(_, look) => format!("{look:?}"),
                    Drawing::Columns(columns) => format!("{columns:?}"),
                    Drawing::Map(over) => format!("{over:?}"),
                };
                format!("{} {} {drawing} {:?}", p.label, p.title, p.points)
            })
            .collect();
        format!("{} {looks:?}", self.columns)
    }

    /// The drawing of the answers, in the panels' order.
    ///
    /// # Errors
    /// The panel, and why it cannot be drawn.
    pub fn sheet(&self, answers: &[Arc<Answer>]) -> Result<Sheet, (String, String)> {
        self.laid_out(self.plots.iter().zip(answers).map(|(plot, a)| (plot, plot.sheet(a))))
    }

    /// The drawing without data: its texts and panels, before anything is computed.
    ///
    /// # Errors
    /// Why a panel cannot be drawn.
    pub fn draft(&self) -> Result<Sheet, String> {
        self.laid_out(self.plots.iter().map(|p| (p, p.draft()))).map_err(|(_, why)| why)
    }

    fn laid_out<'a>(
        &self,
        parts: impl Iterator<Item = (&'a Plot, Result<Sheet, String>)>,
    ) -> Result<Sheet, (String, String)> {
        let width = if self.columns == 1 && self.plots.len() == 1 {
            ColumnWidth::Single
        } else {
            ColumnWidth::Wide
        };
        let mut whole = Sheet::new(width, self.columns, "");
        for (plot, part) in parts {
            let part = part.map_err(|why| (plot.label.clone(), why))?;
            let time = match part.panels.last().map(|p| &p.content) {
                Some(Content::Plane(plane)) => plane.x.title.clone(),
                _ => String::new(),
            };
            let label = if self.plots.len() > 1 {
                format!("({})", markup::literal(&plot.label))
            } else {
                String::new()
            };
            for (k, mut panel) in part.panels.into_iter().enumerate() {
                if k == 0 {
                    (panel.label, panel.title) = (label.clone(), markup::literal(&plot.title));
                }
                if let Content::Plane(plane) = &mut panel.content {
                    plane.aspect = plane.aspect.or(Some(part.panel_aspect));
                    // States of a series that stand side by side do not share their axis.
                    if self.columns > 1 && plane.x.title.is_empty() {
                        plane.x.title.clone_from(&time);
                    }
                }
                whole.panels.push(panel);
            }
            for mut entry in part.legend {
                // Maps have colours of their own.
                if let Drawing::Map(_) = plot.drawing
                    && !label.is_empty()
                {
                    entry.text = format!("{label} {}", entry.text);
                }
                if !whole.legend.contains(&entry) {
                    whole.legend.push(entry);
                }
            }
        }
        whole.footer.extend(self.parameters());
        Ok(whole)
    }

    /// Parameters of the panels' systems: those that all panels have in common, then each one's,
    /// but those that its heading says.
    fn parameters(&self) -> Option<String> {
        let all: Vec<Vec<(String, f64)>> = self.plots.iter().map(Plot::parameters).collect();
        let shared = |p: &&(String, f64)| all.iter().all(|panel| panel.contains(p));
        let common: Vec<_> = all.first()?.iter().filter(shared).collect();
        let said = |list: &[&(String, f64)]| {
            wording::numbers(list.iter().map(|(name, value)| (name.as_str(), *value)))
        };
        let mut parts = vec![(Vec::new(), said(&common))];
        for (plot, panel) in self.plots.iter().zip(&all) {
            let headed = |p: &&(String, f64)| {
                let text = format!("{} = {}", p.0, p.1);
                plot.title.split(", ").any(|part| part == text)
            };
            let own: Vec<_> = panel.iter().filter(|p| !common.contains(p) && !headed(p)).collect();
            let own = said(&own);
            let label = format!("({})", markup::literal(&plot.label));
            match parts[1..].iter_mut().find(|(_, text)| *text == own) {
                Some((labels, _)) => labels.push(label),
                None => parts.push((vec![label], own)),
            }
        }
        parts.retain(|(_, text)| !text.is_empty());
        let parts: Vec<String> =
            parts.into_iter().map(|(l, text)| format!("{} {text}", l.join(", "))).collect();
        (!parts.is_empty()).then(|| parts.join("; ").trim_start().to_owned())
    }
}

impl Plot {
    /// Parameters of its system, but that along which a branch is followed and those over which
    /// runs vary.
    fn parameters(&self) -> Vec<(String, f64)> {
        let question = self.question.json();
        let runs = &question["sweep"];
        let system = question.get("system").unwrap_or(&runs["run"]["system"]);
        let mut parameters: Vec<(String, f64)> =
            match serde_json::from_value::<System>(system.clone()) {
                Ok(system) => {
                    system.parameters().map(|(name, v)| (name.into(), v.value())).collect()
                }
                Err(_) => {
                    let Ok(model) = Model::from_json(system.clone()) else { return Vec::new() };
                    let values = model.values().unwrap_or_default();
                    let names = model.definition().parameters().iter().map(|p| p.name.clone());
                    names.filter_map(|name| values.get(&name).map(|v| (name.clone(), *v))).collect()
                }
            };
        parameters.retain(|(name, _)| question["along"]["parameter"] != *name);
        for axis in runs["over"].as_array().into_iter().flatten() {
            parameters.retain(|(name, _)| axis["coordinate"] != format!("params.{name}"));
        }
        parameters
    }

    /// Dots of a table. Those of an orbit diagram have one shade, as `twofold scan` draws them:
    /// periodic branches would be denser than chaos.
    fn look_of_dots(&self) -> DotStyle {
        if self.question.kind() == "scan" { DotStyle::plain(style::INK) } else { DotStyle::late() }
    }

    fn sheet(&self, answer: &Answer) -> Result<Sheet, String> {
        let sheet = match &self.drawing {
            Drawing::Run(recorded, look) => {
                let frame = recorded.frame();
                plot::sheet(&frame, answer, look, Vec::new()).map_err(|e| e.to_string())?
            }
            Drawing::Columns(columns) => columns.sheet(answer, self.look_of_dots())?,
            Drawing::Map(over) => scan::map("", over.each_ref(), table(answer, None)?)?,
        };
        Ok(self.with_points(sheet))
    }

    /// Its drawing of a table of two rows, without the surface h = 0.
    fn draft(&self) -> Result<Sheet, String> {
        let two_rows = |name: &str, columns: BTreeSet<&str>| {
            let mut table = Table::new(name, columns.iter().map(|c| Column::numbers(c)));
            for x in [0.0, 1.0] {
                table.push(columns.iter().map(|_| Entry::Number(x)));
            }
            Answer::of_tables(vec![table])
        };
        let sheet = match &self.drawing {
            Drawing::Run(recorded, look) => {
                let frame = Frame { system: None, ..recorded.frame() };
                let table = if frame.section.is_some() { "section" } else { "path" };
                let states = frame.states.iter().map(|s| s.name.as_str());
                let answer = two_rows(table, states.chain(["t"]).collect());
                plot::sheet(&frame, &answer, look, Vec::new()).map_err(|e| e.to_string())?
            }
            Drawing::Columns(columns) => {
                let names = columns.y.iter().chain([&columns.x]).map(String::as_str);
                let table = columns.table.as_deref().unwrap_or_default();
                columns.sheet(&two_rows(table, names.collect()), self.look_of_dots())?
            }
            Drawing::Map(over) => {
                let settings = over.iter().map(|of| Column::numbers(&of.column));
                let columns = settings.chain([Column::words("ending")]);
                scan::map("", over.each_ref(), &Table::new("endings", columns))?
            }
        };
        Ok(self.with_points(sheet))
    }

    /// The drawing with the paper's numbers over it.
    fn with_points(&self, mut sheet: Sheet) -> Sheet {
        if let (Some(points), Some(Content::Plane(plane))) =
            (&self.points, sheet.panels.first_mut().map(|p| &mut p.content))
        {
            // A number of the paper that lies far from ours is seen.
            plane.x.reach(points.points.iter().map(|p| p[0]));
            plane.y.reach(points.points.iter().map(|p| p[1]));
            *plane = std::mem::replace(
                plane,
                PlanePanel::new(Axis::linear("", 0.0, 1.0), Axis::linear("", 0.0, 1.0)),
            )
            .markers(points.points.clone(), READ_OFF);
            sheet = sheet.legend(LegendEntry::new(
                LegendKey::Marker(READ_OFF),
                markup::literal(&points.name),
            ));
        }
        sheet
    }
}

impl Columns {
    fn sheet(&self, answer: &Answer, look: DotStyle) -> Result<Sheet, String> {
        let table = table(answer, self.table.as_deref())?;
        let x = column(table, &self.x)?;
        let ys = self.y.iter().map(|name| column(table, name)).collect::<Result<Vec<_>, _>>()?;
        let [horizontal, vertical] = match &self.labels {
            Some(labels) => labels.each_ref().map(|label| markup::literal(label)),
            None => [
                markup::name(&self.x),
                if self.y.len() == 1 { markup::name(&self.y[0]) } else { String::new() },
            ],
        };
        let mut panel = PlanePanel::new(
            Axis::covering(horizontal, x.iter().copied()),
            Axis::covering(vertical, ys.iter().flat_map(|y| y.iter().copied())),
        );
        let mut legend = Vec::new();
        for (k, y) in ys.iter().enumerate() {
            let colour = COLOURS[k % COLOURS.len()];
            let points = x.iter().zip(y.iter()).map(|(x, y)| [*x, *y]).collect();
            let key = if self.dots {
                let dots = DotStyle { colour, ..look };
                panel = panel.dots(points, dots);
                LegendKey::Dots(dots)
            } else {
                let line = LineStyle::new(colour, style::CURVE_PT);
                panel = panel.line(points, line);
                LegendKey::Line(line)
            };
            if ys.len() > 1 {
                let name = self
                    .names
                    .get(k)
                    .map_or_else(|| markup::name(&self.y[k]), |name| markup::literal(name));
                legend.push(LegendEntry::new(key, name));
            }
        }
        let mut sheet =
            Sheet::new(ColumnWidth::Single, 1, "").panel_aspect(0.75).panel("", "", panel);
        sheet.legend = legend;
        Ok(sheet)
    }
}

const COLOURS: [twofold_render::colour::Colour; 4] =
    [style::INK, style::BLUE, style::VERMILLION, style::GREEN];
/// Numbers read off a paper.
const READ_OFF: MarkerStyle =
    MarkerStyle { shape: MarkerShape::OpenDot, colour: style::VERMILLION, size: 3.6 };

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_hybrid::{Definition, Options};
    use twofold_job::Executor;

    fn ball() -> Recorded {
        let text = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-2']\n[[event]]\nwhen = \
            'x'\ndirection = 'down'\nset = { v = '-0.5*v' }";
        let model = Model::new(Definition::from_toml(text, "ball").unwrap());
        Recorded::General(
            GeneralRun { model, options: Options { t_end: 2.5, ..Options::default() } },
            None,
        )
    }

    fn plane(recorded: &Recorded) -> Plot {
        let look =
            Look { kind: plot::PictureKind::Plane, axes: vec![0, 1], camera: None, title: None };
        Plot {
            label: "a".into(),
            title: "<b> & *c*".into(),
            question: recorded.question(),
            drawing: Drawing::Run(recorded.clone().into(), look),
            points: Some(Points { name: "of the paper".into(), points: vec![[0.5, 0.5]] }),
        }
    }

    #[test]
    fn runs_of_general_systems_and_columns_stand_side_by_side() {
        let run = plane(&ball());
        let table = Plot {
            label: "b".into(),
            drawing: Drawing::Columns(Columns {
                table: None,
                x: "t".into(),
                y: vec!["x".into(), "v".into()],
                dots: true,
                labels: Some(["time (s)".into(), "both".into()]),
                names: vec!["height".into(), "speed".into()],
            }),
            points: None,
            ..run.clone()
        };
        let plots = Plots { columns: 2, plots: vec![run.clone(), table] };
        let answer = Executor::quiet().ask(&*run.question).unwrap();
        let sheet = plots.sheet(&[answer.clone(), answer]).unwrap();
        assert_eq!(sheet.panels.len(), 2);
        assert_eq!(sheet.panels[0].label, "(a)");
        let Content::Plane(plane) = &sheet.panels[1].content else { panic!("a plane") };
        assert_eq!((plane.x.title.as_str(), plane.y.title.as_str()), ("time (s)", "both"));
        assert!(sheet.legend.iter().any(|e| e.text == "speed"));
        assert!(sheet.legend.iter().any(|e| e.text == "of the paper") && sheet.legend.len() >= 3);
        twofold_render::render(&sheet).unwrap();
    }

    /// Colours of one map are not another's: the legend says whose they are.
    #[test]
    fn maps_side_by_side_have_a_legend_each() {
        let over = ["start.x=0,1", "start.v=0,1"]
            .map(|axis| Scanned::from(&axis.parse::<twofold_job::sweep::Axis>().unwrap()));
        let map = Plot { drawing: Drawing::Map(over.into()), points: None, ..plane(&ball()) };
        let answer = |words: [&str; 4]| {
            let mut table = Table::new(
                "sweep",
                ["start.x", "start.v"]
                    .map(Column::numbers)
                    .into_iter()
                    .chain([Column::words("outcome")]),
            );
            for (i, word) in words.into_iter().enumerate() {
                let number = |k: usize| Entry::Number(k as f64);
                table.push([number(i / 2), number(i % 2), Entry::Word(word.into())]);
            }
            Arc::new(Answer::of_tables(vec![table]))
        };
        let answers = [answer(["rest"; 4]), answer(["far", "rest", "rest", "rest"])];
        let legend = |plots: Vec<Plot>| {
            let sheet = Plots { columns: 2, plots }.sheet(&answers).unwrap();
            twofold_render::render(&sheet).unwrap();
            sheet.legend.into_iter().map(|e| e.text).collect::<Vec<_>>()
        };
        let b = Plot { label: "b".into(), ..map.clone() };
        assert_eq!(legend(vec![map.clone(), b]), ["(a) rest (4)", "(b) far (1)", "(b) rest (3)"]);
        assert_eq!(legend(vec![map]), ["rest (4)"]);
    }

    #[test]
    fn each_state_of_a_series_has_the_time_below_it_when_they_stand_side_by_side() {
        let ball = ball();
        let look =
            Look { kind: plot::PictureKind::Series, axes: vec![0, 1], camera: None, title: None };
        let series =
            Plot { drawing: Drawing::Run(ball.clone().into(), look), points: None, ..plane(&ball) };
        let answer = Executor::quiet().ask(&*series.question).unwrap();
        let titles = |columns| {
            let sheet = Plots { columns, plots: vec![series.clone()] }
                .sheet(std::slice::from_ref(&answer))
                .unwrap();
            let title = |p: &twofold_render::sheet::SheetPanel| match &p.content {
                Content::Plane(plane) => plane.x.title.clone(),
                _ => "no plane".into(),
            };
            sheet.panels.iter().map(title).collect::<Vec<_>>()
        };
        assert_eq!(titles(1), ["", "*t*"]);
        assert_eq!(titles(2), ["*t*", "*t*"]);
    }

    #[test]
    fn a_picture_says_parameters_that_panels_share_and_each_ones_own() {
        let panel = |label: &str, parameters: &str| {
            let text =
                format!("states = ['x']\nstart = [1]\nf = ['-x']\n[parameters]\n{parameters}");
            let model = Model::new(Definition::from_toml(&text, "test").unwrap());
            let run = GeneralRun { model, options: Options::default() };
            Plot { label: label.into(), ..plane(&Recorded::General(run, None)) }
        };
        let said = |plots| Plots { columns: 1, plots }.parameters();
        let [a, b] = ["k = 1e-5\nalpha = 0.3", "k = 1e-5\nalpha = 2"];
        assert_eq!(said(vec![panel("a", "")]), None);
        assert_eq!(said(vec![panel("a", a)]).unwrap(), "*k* = 10^{-5}, *α* = 0.3");
        assert_eq!(
            said(vec![panel("a", a), panel("b", b), panel("c", a)]).unwrap(),
            "*k* = 10^{-5}; (a), (c) *α* = 0.3; (b) *α* = 2"
        );
        assert_eq!(said(vec![panel("a", "w = 2"), panel("b", "")]).unwrap(), "(a) *w* = 2");
        let headed = Plot { title: "w = 2, slow".into(), ..panel("a", "w = 2") };
        assert_eq!(said(vec![headed, panel("b", "w = 3")]).unwrap(), "(b) *w* = 3");
        let system = twofold_system::System::builtin("two-fold").unwrap();
        let run = RunSpec {
            system,
            switch: twofold_job::spec::SwitchSpec::tanh(1e-3),
            start: vec![0.2, 0.0, -1.0],
            t_end: 1.0,
            method: twofold_job::spec::MethodSpec::ndsolve_defaults(
                twofold_integrate::Method::Dopri5,
            ),
            schedule: twofold_integrate::Schedule::default(),
            observe: twofold_job::spec::Observation::Path { chord: 1e-3 },
        };
        let said_of_surfaces = said(vec![plane(&Recorded::Surfaces(run))]).unwrap();
        assert!(said_of_surfaces.contains("*v* = −1.2, *w* = −1.4"), "{said_of_surfaces}");
        let many: String = (0..20).map(|i| format!("p{i} = {i}\n")).collect();
        let many = said(vec![panel("a", &many)]).unwrap();
        assert!(many.matches(" = ").count() == 12 && many.ends_with(", …"), "{many}");
    }

    #[test]
    fn whatever_is_drawn_is_part_of_the_looks() {
        let plots = Plots { columns: 1, plots: vec![plane(&ball())] };
        let changes: [&dyn Fn(&mut Plots); 4] = [
            &|p| p.columns = 2,
            &|p| p.plots[0].title.push('.'),
            &|p| p.plots[0].points = None,
            &|p| {
                if let Drawing::Run(_, look) = &mut p.plots[0].drawing {
                    look.axes = vec![1, 0];
                }
            },
        ];
        for change in changes {
            let mut other = plots.clone();
            change(&mut other);
            assert_ne!(other.looks(), plots.looks());
        }
    }
}
