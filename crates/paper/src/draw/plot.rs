//! A picture of any run: its states against time, a phase plane, a path in space, or a Poincaré
//! section. Labels, axes and the switching surface come from the system.

use twofold_job::answer::Answer;
use twofold_job::spec::{Observation, RunSpec};
use twofold_job::table::Table;
use twofold_render::markup;
use twofold_render::number::number;
use twofold_render::sheet::{
    Anchor, Axis, ColumnWidth, DotStyle, LegendEntry, LegendKey, LineStyle, MarkerShape,
    MarkerStyle, PlanePanel, Sheet, SpacePanel,
};
use twofold_render::style;
use twofold_system::System;
use twofold_system::definition::State;
use twofold_system::filippov::Region;

use super::level::Level;
use super::surface;

/// Data about a run that a picture needs.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The system's title.
    pub title: &'a str,
    /// Its states.
    pub states: &'a [State],
    /// Those that pictures show.
    pub axes: &'a [usize],
    /// The system, if it has switching surfaces that are drawn.
    pub system: Option<&'a System>,
    /// The section whose crossings were recorded.
    pub section: Option<Crossed<'a>>,
    /// When the run begins and ends.
    pub times: (f64, f64),
}

/// The surface that a section's orbit crosses.
#[derive(Clone, Copy, Debug)]
pub enum Crossed<'a> {
    /// The plane where a coordinate has a value.
    Plane(usize, f64),
    /// The surface on which an equation, as text, holds.
    Surface(&'a str),
}

impl<'a> Crossed<'a> {
    /// The surface of a section's equation: the plane of a state, if it says no more than that.
    pub fn of(equation: &'a str, states: &[&str]) -> Self {
        let plane = equation.split_once('=').and_then(|(state, value)| {
            let coordinate = states.iter().position(|s| *s == state.trim())?;
            Some(Crossed::Plane(coordinate, value.trim().parse().ok()?))
        });
        plane.unwrap_or(Crossed::Surface(equation))
    }
}

impl<'a> From<&'a RunSpec> for Frame<'a> {
    fn from(run: &'a RunSpec) -> Self {
        let definition = run.system.definition();
        Self {
            title: definition.title(),
            states: definition.states(),
            axes: definition.axes(),
            system: Some(&run.system),
            section: match run.observe {
                Observation::Section { coordinate, value } => {
                    Some(Crossed::Plane(coordinate, value))
                }
                _ => None,
            },
            times: (0.0, run.t_end),
        }
    }
}

impl Frame<'_> {
    fn names(&self) -> Vec<&str> {
        self.states.iter().map(|s| s.name.as_str()).collect()
    }

    /// The curves or surfaces h = 0 in the space of these states.
    fn levels(&self, shown: &[usize], fixed: &[(usize, f64)]) -> Vec<Level<'_>> {
        self.system.map_or_else(Vec::new, |system| Level::all(system, shown, fixed))
    }
}

/// The kind of picture of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureKind {
    /// States against time, a panel for each.
    Series,
    /// One state against another.
    Plane,
    /// Three states.
    Space,
    /// Crossings of a plane.
    Section,
}

impl PictureKind {
    /// The word for it.
    pub fn word(self) -> &'static str {
        match self {
            PictureKind::Series => "series",
            PictureKind::Plane => "plane",
            PictureKind::Space => "space",
            PictureKind::Section => "section",
        }
    }

    /// The kind that suits a run: a section if passages were recorded, else by the number of axes
    /// that the system suggests, or of its states.
    pub fn suiting(run: &Frame) -> Self {
        if run.section.is_some() {
            return PictureKind::Section;
        }
        match if run.axes.is_empty() { run.states.len() } else { run.axes.len() } {
            1 => PictureKind::Series,
            2 => PictureKind::Plane,
            _ => PictureKind::Space,
        }
    }
}

/// Options for drawing a run.
#[derive(Clone, Debug)]
pub struct Look {
    /// The kind of picture.
    pub kind: PictureKind,
    /// The states on the axes (of a series: the panels); empty for the ones that suit.
    pub axes: Vec<usize>,
    /// Azimuth and elevation of the camera in degrees, of a picture in space.
    pub camera: Option<(f64, f64)>,
    /// The heading as plain text; the system's title if there is none.
    pub title: Option<String>,
}

/// Why a run cannot be drawn in this way.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlotError {
    /// Too few or too many axes.
    #[error("a picture of kind {kind} has {wanted}; {given} given")]
    Axes {
        /// The kind.
        kind: &'static str,
        /// The axes that it needs, in words.
        wanted: &'static str,
        /// Number of axes given.
        given: usize,
    },
    /// Too many states.
    #[error(
        "a picture of kind series has at most sixteen panels, and the system has {states} states; \
            choose some as its axes"
    )]
    Panels {
        /// Number of the system's states.
        states: usize,
    },
    /// Too few states.
    #[error(
        "a picture of kind {kind} shows {wanted} states, and the system has {states}; choose \
            another kind"
    )]
    States {
        /// The kind.
        kind: &'static str,
        /// Number of states that it shows.
        wanted: usize,
        /// Number of the system's states.
        states: usize,
    },
    /// A path where passages are needed.
    #[error("a section shows crossings of a plane: record them, such as by --section y=0")]
    SectionNeeded,
    /// Passages where a path is needed.
    #[error(
        "crossings of a plane were recorded, and this picture needs the path: leave out --section"
    )]
    PathNeeded,
    /// The run has no table of points.
    #[error("there is no table of points in this run")]
    NoPoints,
}

/// The states that a kind of picture shows of a run, in the order of its axes.
///
/// # Errors
/// If the number of axes does not suit the kind.
pub fn axes(run: &Frame, kind: PictureKind, given: &[usize]) -> Result<Vec<usize>, PlotError> {
    let n = run.states.len();
    let wrong = |wanted| Err(PlotError::Axes { kind: kind.word(), wanted, given: given.len() });
    let few = |wanted| PlotError::States { kind: kind.word(), wanted, states: n };
    match (kind, run.section) {
        (PictureKind::Section, None) => return Err(PlotError::SectionNeeded),
        (PictureKind::Series | PictureKind::Plane | PictureKind::Space, Some(_)) => {
            return Err(PlotError::PathNeeded);
        }
        _ => {}
    }
    let suggested = run.axes;
    let others: Vec<usize> =
        suggested.iter().copied().chain((0..n).filter(|i| !suggested.contains(i))).collect();
    match (kind, given.len()) {
        // A system's axes are horizontal, depth, vertical; of two panels in the plane the first and
        // the last of them.
        (PictureKind::Series, 0) if n > MOST_PANELS => Err(PlotError::Panels { states: n }),
        (PictureKind::Series, 0) => Ok((0..n).collect()),
        (PictureKind::Series, count) if count > MOST_PANELS => wrong("at most sixteen panels"),
        (PictureKind::Plane, 0) if n < 2 => Err(few(2)),
        (PictureKind::Plane, 0) => {
            Ok(if suggested.len() == 2 { suggested.to_vec() } else { vec![others[0], others[1]] })
        }
        (PictureKind::Space, 0) if n < 3 => Err(few(3)),
        (PictureKind::Space, 0) => Ok(others[..3].to_vec()),
        (PictureKind::Section, 0) => {
            let flat = match run.section.ok_or(PlotError::SectionNeeded)? {
                Crossed::Plane(coordinate, _) => Some(coordinate),
                Crossed::Surface(_) => None,
            };
            // The only state of a system, against time.
            Ok(others.into_iter().filter(|i| n == 1 || Some(*i) != flat).take(2).collect())
        }
        (PictureKind::Plane | PictureKind::Section, 2)
        | (PictureKind::Space, 3)
        | (PictureKind::Series, _) => Ok(given.to_vec()),
        (PictureKind::Plane, _) => wrong("two axes"),
        (PictureKind::Space, _) => wrong("three axes"),
        (PictureKind::Section, 1) => Ok(given.to_vec()),
        (PictureKind::Section, _) => wrong("two axes, or one against time"),
    }
}

/// The drawing of a run; `small_print` stands at its foot.
///
/// # Errors
/// [`PlotError`] if the run cannot be drawn in this way.
pub fn sheet(
    run: &Frame,
    answer: &Answer,
    look: &Look,
    small_print: Vec<String>,
) -> Result<Sheet, PlotError> {
    let shown = axes(run, look.kind, &look.axes)?;
    let title = look.title.clone().unwrap_or_else(|| run.title.to_owned());
    let said = if title.is_empty() { "a system of its own".to_owned() } else { title.clone() };
    let width = match look.kind {
        PictureKind::Series | PictureKind::Space => ColumnWidth::Wide,
        PictureKind::Plane | PictureKind::Section => ColumnWidth::Single,
    };
    let mut sheet = Sheet::new(width, 1, format!("{}: {said}", describe(run, look.kind, &shown)));
    sheet.title = (!title.is_empty()).then(|| markup::literal(&title));
    sheet.footer = small_print;
    match look.kind {
        PictureKind::Section => section(sheet, run, answer, &shown),
        kind => {
            let lines = lines(answer, run)?;
            Ok(match kind {
                PictureKind::Series => series(sheet, run, &lines, &shown),
                PictureKind::Plane => plane(sheet, run, &lines, &shown),
                _ => space(sheet, run, answer, &lines, &shown, look.camera),
            })
        }
    }
}

/// For readers who cannot see it.
fn describe(run: &Frame, kind: PictureKind, shown: &[usize]) -> String {
    let names = run.names();
    let listed = shown.iter().map(|i| names[*i]).collect::<Vec<_>>().join(", ");
    match kind {
        PictureKind::Series => format!("{listed} against time"),
        PictureKind::Plane => format!("phase plane of {listed}"),
        PictureKind::Space => format!("path in the space of {listed}"),
        PictureKind::Section => format!("Poincaré section, {listed}"),
    }
}

/// Kind of motion along a line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Stroke {
    Smooth,
    Flight,
    Sliding,
    /// On a switching surface of a general system: it slides, or rests there.
    Surface,
    ToPlus,
    ToMinus,
    Approach,
}

/// A piece of a path in one style.
struct Line {
    look: Stroke,
    /// Number of points of the path between two resets.
    whole: usize,
    t: Vec<f64>,
    /// Per state.
    x: Vec<Vec<f64>>,
}

impl Line {
    fn points<const K: usize>(&self, axes: [usize; K]) -> Vec<[f64; K]> {
        (0..self.t.len()).map(|i| axes.map(|a| self.x[a][i])).collect()
    }
}

/// The lines of a recorded path or motion.
fn lines(answer: &Answer, run: &Frame) -> Result<Vec<Line>, PlotError> {
    let names = run.names();
    if answer.table("section").is_some() {
        return Err(PlotError::PathNeeded);
    }
    let columns = |table: &Table, rows: std::ops::Range<usize>| -> Vec<Vec<f64>> {
        names.iter().map(|n| table.numbers(n).get(rows.clone()).unwrap_or(&[]).to_vec()).collect()
    };
    let sound =
        |table: &&Table| names.iter().all(|n| table.numbers(n).len() == table.numbers("t").len());
    if let Some(path) = answer.table("path").filter(sound) {
        return Ok(pieces(path, |rows| columns(path, rows)));
    }
    let motion = answer.table("motion").filter(sound).ok_or(PlotError::NoPoints)?;
    let funnel = motion.integers("future").iter().any(|f| *f > 0);
    let (modes, pieces, futures) =
        (motion.words("mode"), motion.integers("piece"), motion.integers("future"));
    let looks: Vec<(Stroke, i64, i64)> = modes
        .zip(pieces.iter().zip(futures))
        .zip(motion.words("exit_side"))
        .map(|((mode, (piece, future)), side)| {
            let look = match (funnel, *future, side) {
                (true, 0, _) => Stroke::Approach,
                (true, _, "plus") => Stroke::ToPlus,
                (true, _, _) => Stroke::ToMinus,
                _ if mode.starts_with("sliding") => Stroke::Sliding,
                _ => Stroke::Flight,
            };
            (look, *future, *piece)
        })
        .collect();
    let mut found = Vec::new();
    let mut from = 0;
    for row in 1..=looks.len() {
        if row == looks.len() || looks[row] != looks[from] {
            let t = motion.numbers("t")[from..row].to_vec();
            let (look, whole) = (looks[from].0, t.len());
            found.push(Line { look, whole, t, x: columns(motion, from..row) });
            from = row;
        }
    }
    // Sliding above flight, the way in above the ways out.
    found.sort_by_key(|line| line.look);
    Ok(found)
}

/// The pieces of a path: it is cut at resets, and where it comes onto a switching surface or leaves
/// it. The signs of a row are those of the motion that leads to it.
fn pieces(path: &Table, columns: impl Fn(std::ops::Range<usize>) -> Vec<Vec<f64>>) -> Vec<Line> {
    let t = path.numbers("t");
    let mut looks: Vec<Stroke> = path
        .words("signs")
        .map(|signs| if signs.contains('0') { Stroke::Surface } else { Stroke::Smooth })
        .collect();
    looks.resize(t.len(), Stroke::Smooth);
    let mut found: Vec<Line> = Vec::new();
    let (mut from, mut first, mut begin) = (0, 0, 0);
    for row in 1..=t.len() {
        // A reset is no line: two rows of one time.
        let reset = row == t.len() || t[row] == t[row - 1];
        if !reset && (row == from + 1 || looks[row] == looks[row - 1]) {
            continue;
        }
        let look = looks[row - 1];
        found.push(Line { look, whole: 0, t: t[from..row].to_vec(), x: columns(from..row) });
        from = if reset { row } else { row - 1 };
        if reset {
            found[first..].iter_mut().for_each(|line| line.whole = row - begin);
            (first, begin) = (found.len(), row);
        }
    }
    found.sort_by_key(|line| line.look);
    found
}

fn line_style(look: Stroke, points: usize) -> LineStyle {
    match look {
        // A long path is drawn thinner than a curve, so that windings stay apart.
        Stroke::Smooth => {
            LineStyle::new(style::INK, if points > 4000 { 0.5 } else { style::CURVE_PT })
        }
        Stroke::Flight => LineStyle::new(style::INK, 0.7),
        Stroke::Sliding | Stroke::Surface => LineStyle::new(style::GREEN, 1.6),
        Stroke::ToPlus => LineStyle::new(style::BLUE, 0.5),
        Stroke::ToMinus => LineStyle::new(style::VERMILLION, 0.5),
        Stroke::Approach => LineStyle::new(style::INK, 1.4),
    }
}

/// Entries for the kinds of lines that occur, unless there is only one.
fn line_legend(mut sheet: Sheet, lines: &[Line]) -> Sheet {
    let mut looks: Vec<Stroke> = lines.iter().map(|l| l.look).collect();
    looks.sort();
    looks.dedup();
    for look in looks {
        let text = match look {
            Stroke::Smooth => continue,
            Stroke::Flight => "flight",
            Stroke::Sliding => "sliding",
            Stroke::Surface => "on a switching surface",
            Stroke::ToPlus => "ways out to *h* > 0",
            Stroke::ToMinus => "ways out to *h* < 0",
            Stroke::Approach => "the way in",
        };
        sheet = sheet.legend(LegendEntry::new(LegendKey::Line(line_style(look, 0)), text));
    }
    sheet
}

/// A state's name and unit.
fn title(run: &Frame, state: usize) -> String {
    let state = &run.states[state];
    let name = markup::name(&state.name);
    if state.about.unit.is_empty() {
        name
    } else {
        format!("{name} ({})", markup::literal(&state.about.unit))
    }
}

fn range(lines: &[Line], state: usize) -> (f64, f64) {
    let axis = Axis::covering("", lines.iter().flat_map(|l| l.x[state].iter().copied()));
    if axis.upper > axis.lower {
        return (axis.lower, axis.upper);
    }
    // A state that stays what it is: as wide as such an axis is drawn.
    let half = (0.05 * axis.lower.abs()).max(0.5);
    (axis.lower - half, axis.lower + half)
}

fn series(mut sheet: Sheet, run: &Frame, lines: &[Line], shown: &[usize]) -> Sheet {
    sheet = sheet.panel_aspect(if shown.len() == 1 { 0.4 } else { 0.22 });
    let begin = run.times.0;
    let end = lines.iter().filter_map(|l| l.t.last()).fold(begin, |a, b| a.max(*b));
    let mut surface_shown = false;
    for (i, state) in shown.iter().enumerate() {
        let (low, high) = range(lines, *state);
        let time = if i + 1 == shown.len() { "*t*" } else { "" };
        let mut panel = PlanePanel::new(
            Axis::linear(time, begin, end),
            Axis::linear(title(run, *state), low, high),
        );
        for zero in run.levels(&[*state], &[]).iter().flat_map(|l| l.points((low, high))) {
            surface_shown = true;
            panel = panel.line(vec![[begin, zero], [end, zero]], SURFACE_LEVEL);
        }
        for line in lines {
            let points = line.t.iter().zip(&line.x[*state]).map(|(t, x)| [*t, *x]).collect();
            panel = panel.line(points, line_style(line.look, line.whole));
        }
        sheet = sheet.panel("", "", panel);
    }
    sheet = line_legend(sheet, lines);
    if surface_shown {
        sheet = sheet.legend(LegendEntry::new(LegendKey::Line(SURFACE_LEVEL), "*h* = 0"));
    }
    sheet
}

/// The curve h = 0 in a panel, under everything else; adds to `seen` what of it is there.
fn surface_curve(
    mut panel: PlanePanel,
    level: &Level<'_>,
    ranges: [(f64, f64); 2],
    seen: &mut Vec<CurveLook>,
) -> PlanePanel {
    for (region, points) in level.curves(ranges) {
        let look = curve_look(region);
        panel = panel.line(points, look.0);
        if !seen.contains(&look) {
            seen.push(look);
        }
    }
    panel
}

type CurveLook = (LineStyle, &'static str);

fn curve_look(region: Option<Region>) -> CurveLook {
    match region {
        Some(Region::Attracting) => (LineStyle::new(style::ATTRACTING, 2.2), "*h* = 0, attracting"),
        Some(Region::Repelling) => (LineStyle::new(style::REPELLING, 2.2), "*h* = 0, repelling"),
        Some(_) => (LineStyle::new(style::FAINT, 1.4), "*h* = 0, crossing"),
        None => (LineStyle::new(style::FAINT, 1.4), "*h* = 0"),
    }
}

fn curve_legend(mut sheet: Sheet, looks: Vec<CurveLook>) -> Sheet {
    for (line, text) in looks {
        sheet = sheet.legend(LegendEntry::new(LegendKey::Line(line), text));
    }
    sheet
}

fn plane(sheet: Sheet, run: &Frame, lines: &[Line], shown: &[usize]) -> Sheet {
    let [u, v] = [shown[0], shown[1]];
    let ranges = [range(lines, u), range(lines, v)];
    let axis = |k: usize| Axis::linear(title(run, shown[k]), ranges[k].0, ranges[k].1);
    let mut panel = PlanePanel::new(axis(0), axis(1));
    let mut looks = Vec::new();
    for level in run.levels(shown, &[]) {
        panel = surface_curve(panel, &level, ranges, &mut looks);
    }
    for line in lines {
        panel = panel.line(line.points([u, v]), line_style(line.look, line.whole));
    }
    let start = lines
        .iter()
        .filter(|l| l.t.first() == Some(&run.times.0))
        .map(|l| [l.x[u][0], l.x[v][0]])
        .take(1)
        .collect();
    panel = panel.markers(start, START);
    let sheet = sheet.panel_aspect(0.8).panel("", "", panel);
    curve_legend(line_legend(sheet, lines), looks)
        .legend(LegendEntry::new(LegendKey::Marker(START), "start"))
}

fn space(
    mut sheet: Sheet,
    run: &Frame,
    answer: &Answer,
    lines: &[Line],
    shown: &[usize],
    camera: Option<(f64, f64)>,
) -> Sheet {
    let order = [shown[0], shown[1], shown[2]];
    let ranges = order.map(|i| range(lines, i));
    let axis = |k: usize| Axis::linear(title(run, order[k]), ranges[k].0, ranges[k].1);
    let mut panel = SpacePanel::new(axis(0), axis(1), axis(2));
    if let Some((azimuth, elevation)) = camera {
        panel = panel.camera(azimuth, elevation);
    }
    let mut regions = false;
    let mut patches = Vec::new();
    for level in run.levels(&order, &[]) {
        regions |= level.has_regions();
        patches.extend(level.patches(&ranges));
    }
    let colours: Vec<_> = patches.iter().map(|p| p.colour).collect();
    if !patches.is_empty() {
        panel = panel.surface(patches);
    }
    for line in lines {
        panel = panel.line(line.points(order), line_style(line.look, line.whole));
    }
    let exits: Vec<[f64; 3]> =
        exits(answer, run).into_iter().map(|x| order.map(|i| x[i])).collect();
    let any_exits = !exits.is_empty();
    if any_exits {
        panel = panel.markers(exits, EXIT);
    }
    let mut box_of_states = [(0.0, 0.0); 3];
    let singular = run.system.filter(|system| system.dimension() == 3).and_then(|system| {
        order.iter().zip(ranges).for_each(|(i, r)| box_of_states[*i] = r);
        surface::singularity(system, &box_of_states)
    });
    if let Some(point) = singular {
        panel = panel.markers(vec![order.map(|i| point[i])], surface::TWO_FOLD);
    }
    sheet = line_legend(sheet.panel("", "", panel), lines);
    sheet = match colours.first() {
        Some(_) if regions => surface::region_legend(sheet, |colour| colours.contains(&colour)),
        Some(colour) => sheet
            .legend(LegendEntry::new(LegendKey::Area(*colour, style::SURFACE_OPACITY), "*h* = 0")),
        None => sheet,
    };
    if any_exits {
        sheet = sheet.legend(LegendEntry::new(LegendKey::Marker(EXIT), "exit"));
    }
    if singular.is_some() {
        sheet = surface::two_fold_legend(sheet);
    }
    sheet
}

fn section(
    sheet: Sheet,
    run: &Frame,
    answer: &Answer,
    shown: &[usize],
) -> Result<Sheet, PlotError> {
    let table = answer.table("section").ok_or(PlotError::SectionNeeded)?;
    let crossed = run.section.ok_or(PlotError::SectionNeeded)?;
    let names = run.names();
    let t = table.numbers("t");
    let half = 0.5 * (run.times.0 + run.times.1);
    // One state left: against time.
    let (horizontal, vertical) = match shown {
        [u, v, ..] => (Some(*u), Some(*v)),
        [u] => (None, Some(*u)),
        [] => return Err(PlotError::States { kind: "section", wanted: 2, states: names.len() }),
    };
    let column = |state: Option<usize>| state.map_or(t, |i| table.numbers(names[i]));
    let (xs, ys) = (column(horizontal), column(vertical));
    if xs.len() != t.len() || ys.len() != t.len() {
        return Err(PlotError::NoPoints);
    }
    let axis = |state: Option<usize>, values: &[f64]| match state {
        Some(i) => Axis::covering(title(run, i), values.iter().copied()),
        None => Axis::linear("*t*", run.times.0, run.times.1),
    };
    let (x, y) = (axis(horizontal, xs), axis(vertical, ys));
    let ranges = [(x.lower, x.upper), (y.lower, y.upper)];
    let mut panel = PlanePanel::new(x, y);
    let mut looks = Vec::new();
    if let (Some(u), Some(v)) = (horizontal, vertical) {
        let fixed = match crossed {
            Crossed::Plane(coordinate, value) => vec![(coordinate, value)],
            Crossed::Surface(_) => Vec::new(),
        };
        for level in run.levels(&[u, v], &fixed) {
            panel = surface_curve(panel, &level, ranges, &mut looks);
        }
    }
    if t.is_empty() {
        let middle = ranges.map(|(low, high)| 0.5 * (low + high));
        panel = panel.note(middle, "no crossing", Anchor::Centre);
    }
    let points = |late: bool| {
        (0..t.len()).filter(|i| (t[*i] > half) == late).map(|i| [xs[i], ys[i]]).collect::<Vec<_>>()
    };
    panel = panel.dots(points(false), DotStyle::early()).dots(points(true), DotStyle::late());
    let plane = match crossed {
        Crossed::Plane(coordinate, value) => {
            format!("{} = {}", markup::name(names[coordinate]), number(value))
        }
        Crossed::Surface(equation) => markup::literal(equation),
    };
    let sheet =
        sheet.subtitle(format!("crossings of {plane}")).panel_aspect(0.9).panel("", "", panel);
    let half = number(half);
    let sheet = sheet
        .legend(LegendEntry::new(LegendKey::Dots(DotStyle::early()), format!("*t* ≤ {half}")))
        .legend(LegendEntry::new(LegendKey::Dots(DotStyle::late()), format!("*t* > {half}")));
    Ok(curve_legend(sheet, looks))
}

/// The points at which a motion leaves repelling sliding.
fn exits(answer: &Answer, run: &Frame) -> Vec<Vec<f64>> {
    let Some(events) = answer.table("events") else { return Vec::new() };
    let columns: Vec<&[f64]> = run.names().iter().map(|n| events.numbers(n)).collect();
    let single = |row: usize| events.integers("future").get(row) == Some(&0);
    events
        .words("event")
        .enumerate()
        .filter(|(row, word)| word.starts_with("exit") && single(*row))
        .map(|(row, _)| columns.iter().map(|c| c.get(row).copied().unwrap_or(f64::NAN)).collect())
        .collect()
}

/// Most panels of a series.
const MOST_PANELS: usize = 16;
/// h = 0 as a level in a series.
const SURFACE_LEVEL: LineStyle = LineStyle::new(style::SOFT_INK, 0.6).dashed();
/// The start of a path.
const START: MarkerStyle =
    MarkerStyle { shape: MarkerShape::OpenDot, colour: style::INK, size: 3.6 };
/// The end of repelling sliding.
const EXIT: MarkerStyle =
    MarkerStyle { shape: MarkerShape::OpenDot, colour: style::GREEN, size: 3.6 };

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_job::{Column, Entry};

    /// Flight to a surface, sliding on it, flight, a reset, flight: pieces meet but at the reset,
    /// and sliding is drawn last.
    #[test]
    fn paths_are_cut_where_they_slide_and_at_resets() {
        let mut path = Table::new(
            "path",
            [Column::numbers("t"), Column::numbers("x"), Column::words("signs")],
        );
        let rows = [(0.0, "+-"), (1.0, "+-"), (2.0, "0-"), (3.0, "0-"), (4.0, "+-"), (4.0, "+-")];
        for (t, signs) in rows.into_iter().chain([(5.0, "+-")]) {
            path.push([Entry::Number(t), Entry::Number(10.0 * t), Entry::Word(signs.into())]);
        }
        let found = pieces(&path, |rows| vec![path.numbers("x")[rows].to_vec()]);
        let times: Vec<_> = found.iter().map(|line| (line.look, &line.t[..])).collect();
        assert_eq!(
            times,
            [
                (Stroke::Smooth, &[0.0, 1.0][..]),
                (Stroke::Smooth, &[3.0, 4.0]),
                (Stroke::Smooth, &[4.0, 5.0]),
                (Stroke::Surface, &[1.0, 2.0, 3.0]),
            ]
        );
        assert_eq!(found[3].x, [[10.0, 20.0, 30.0]]);
        assert!(found.iter().map(|line| line.whole).eq([5, 5, 2, 5]));
    }
}
