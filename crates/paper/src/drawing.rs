//! From recordings to a drawing: which points, lines and surfaces, in which colours and ranges.

use super::verdict::{Grounds, PanelVerdict};
use super::{Camera, FigurePanel, Picture, Support, View, wording};
use crate::draw::surface;
use twofold_analyse::attractor::Verdict;
use twofold_analyse::{Crossing, Motion, Sample};
use twofold_integrate::filippov::{EventKind, Mode, Side};
use twofold_job::JobError;
use twofold_job::record::Hash;
use twofold_job::recording::{Data, Future, Recording};
use twofold_job::spec::Observation;
use twofold_render::RenderError;
use twofold_render::sheet::{
    Anchor, Axis, ColumnWidth, Content, DotStyle, LegendEntry, LegendKey, LineStyle, MarkerShape,
    MarkerStyle, PlanePanel, Sheet, SpacePanel, range_of,
};
use twofold_render::style;

/// The drawing of a picture of runs.
///
/// # Errors
///
/// If the runs that repeat a panel cannot be counted.
pub fn sheet(
    picture: &Picture,
    recordings: &[Recording],
    verdicts: &[PanelVerdict],
    spec: &Hash,
    data: &Hash,
) -> Result<Sheet, JobError> {
    let runs: Vec<_> = picture.panels.iter().map(|p| &p.run).collect();
    let mut sheet = dress(Sheet::new(ColumnWidth::Wide, columns(picture), ""), picture, spec, data);
    for line in wording::small_print(picture.reading_name(), &runs) {
        sheet = sheet.footer(line);
    }
    let notes = verdict_notes(picture, verdicts)?;
    // One panel's finding is said in the foot: it is too long to stand over the panel.
    for verdict in verdicts {
        let found = wording::found(&verdict.found);
        sheet = sheet.footer(if picture.panels.len() > 1 {
            format!("({}) {found}", verdict.panel)
        } else {
            found
        });
    }
    Ok(match &picture.view {
        View::Section { horizontal, vertical } => section_panels(
            sheet,
            picture,
            recordings,
            &notes,
            [*horizontal, *vertical],
            &[Half::Late, Half::Early],
        ),
        View::LateSection { horizontal, vertical } => section_panels(
            sheet,
            picture,
            recordings,
            &notes,
            [*horizontal, *vertical],
            &[Half::Late],
        ),
        View::Space { camera } => space_panels(sheet, picture, recordings, &notes, camera),
        View::Study(_) | View::Plots(_) => sheet,
    })
}

/// The drawing of a study: its own sheet, with the picture's heading and provenance.
pub fn study_sheet(picture: &Picture, sheet: Sheet, spec: &Hash, data: &Hash) -> Sheet {
    dress(sheet, picture, spec, data)
}

/// Whether a picture can be drawn, as far as that is known before anything is computed: its texts,
/// and the room that its panels take.
///
/// # Errors
///
/// As [`twofold_render::check`].
pub fn draft(picture: &Picture) -> Result<(), RenderError> {
    let nothing = Hash::of(b"");
    if let View::Plots(plots) = &picture.view {
        let sheet = plots.draft().map_err(RenderError::Drawing)?;
        return twofold_render::check(&study_sheet(picture, sheet, &nothing, &nothing));
    }
    let axis = || Axis::linear("", 0.0, 1.0);
    let plane = || Content::from(PlanePanel::new(axis(), axis()));
    let sheet = Sheet::new(ColumnWidth::Wide, columns(picture), "");
    let mut sheet = dress(sheet, picture, &nothing, &nothing);
    for panel in &picture.panels {
        let content = match &picture.view {
            View::Space { .. } => SpacePanel::new(axis(), axis(), axis()).into(),
            _ => plane(),
        };
        sheet = sheet.panel(label(picture, panel), panel.title.as_str(), content);
    }
    if let View::Section { .. } = picture.view {
        sheet = picture.panels.iter().fold(sheet, |sheet, _| sheet.panel("", "", plane()));
    }
    twofold_render::check(&sheet)
}

/// Heading, description, warnings and provenance: what every picture has.
fn dress(mut sheet: Sheet, picture: &Picture, spec: &Hash, data: &Hash) -> Sheet {
    sheet.description = wording::plain(&picture.caption);
    sheet = sheet
        .title(picture.title.as_ref())
        .provenance("Software", concat!("twofold ", env!("CARGO_PKG_VERSION")))
        .provenance("Picture", &picture.name)
        .provenance("Reading", picture.reading_name().unwrap_or("none"))
        .provenance("Method", methods(picture))
        .provenance("Spec-SHA256", spec.as_str())
        .provenance("Data-SHA256", data.as_str());
    if let Some(reading) = &picture.reading {
        sheet = sheet.subtitle(wording::reading(reading));
    }
    if !picture.alterations.is_empty() {
        sheet =
            sheet.banner(format!("NOT THE PUBLISHED PICTURE: {}", picture.alterations.join("; ")));
    }
    sheet
}

/// Up to three panels stand side by side, four in a square.
fn columns(picture: &Picture) -> usize {
    match picture.panels.len() {
        n @ 0..=3 => n.max(1),
        4 => 2,
        _ => 3,
    }
}

fn methods(picture: &Picture) -> String {
    let mut names: Vec<&str> = picture.panels.iter().map(|p| p.run.method.name.name()).collect();
    names.dedup();
    if names.is_empty() { "study".into() } else { names.join(", ") }
}

/// "(ii)"; nothing where there is only one panel.
fn label(picture: &Picture, panel: &FigurePanel) -> String {
    if picture.panels.len() > 1 { format!("({})", panel.label) } else { String::new() }
}

/// The half of a section that is drawn.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Half {
    Late,
    Early,
}

/// Sections: the later half of each, as the paper shows it, and below it the early half. The same
/// axes in every panel, so that sizes can be compared.
fn section_panels(
    mut sheet: Sheet,
    picture: &Picture,
    recordings: &[Recording],
    notes: &[Vec<String>],
    axes: [usize; 2],
    halves: &[Half],
) -> Sheet {
    let late = |panel: &FigurePanel, c: &Crossing| c.t > 0.5 * panel.run.t_end;
    let half =
        |panel: &FigurePanel, c: &Crossing| if late(panel, c) { Half::Late } else { Half::Early };
    let names = picture.panels[0].run.system.coordinates();
    // Of both halves, even if one alone is drawn: beside the transient, a tolerance is small.
    let axis = |i: usize| {
        let all = recordings.iter().flat_map(|r| crossings(&r.data));
        Axis::covering(format!("*{}*", greek(names[axes[i]])), all.map(|c| c.x[axes[i]]))
    };
    let drawn: Vec<_> = picture.panels.iter().zip(recordings).zip(notes).collect();
    let rows: Vec<_> = drawn
        .chunks(sheet.columns)
        .flat_map(|row| halves.iter().map(move |shown| (row, *shown)))
        .collect();
    for (r, (row, shown)) in rows.iter().enumerate() {
        for (column, ((panel, recording), notes)) in row.iter().enumerate() {
            let points = crossings(&recording.data).iter().filter(|c| half(panel, c) == *shown);
            let points = points.map(|c| axes.map(|i| c.x[i])).collect();
            let chart =
                PlanePanel::new(axis(0), axis(1)).labelled(r + 1 == rows.len(), column == 0);
            sheet = match shown {
                Half::Late => sheet
                    .panel(
                        label(picture, panel),
                        panel.title.as_str(),
                        chart.dots(points, DotStyle::late()),
                    )
                    .notes(notes.iter().cloned()),
                Half::Early => sheet.panel("", "", chart.dots(points, DotStyle::early())),
            };
        }
    }
    if let Observation::Section { coordinate, value } = picture.panels[0].run.observe {
        sheet = sheet.footer(format!(
            "crossings of *{}* = {} upwards and downwards: an orbit of period one has one of each",
            greek(names[coordinate]),
            wording::number(value)
        ));
    }
    if picture.panels.iter().any(|panel| panel.repeats.is_some()) {
        sheet = sheet.footer(
            "*n* of *m* runs: the panel's, repeated from starts too near to its own to be told \
                apart",
        );
    }
    let middle = wording::number(0.5 * picture.panels[0].run.t_end);
    let as_there = if picture.alterations.is_empty() { ", as in the paper" } else { "" };
    let late = format!("*t* > {middle}{as_there}");
    sheet = sheet.legend(LegendEntry::new(LegendKey::Dots(DotStyle::late()), late));
    if halves.contains(&Half::Early) {
        let early = format!("*t* ≤ {middle}");
        sheet = sheet.legend(LegendEntry::new(LegendKey::Dots(DotStyle::early()), early));
    }
    sheet
}

/// Notes below the title of each panel: the paper's claim, whether the panel's run supports it, and
/// the number of runs that do.
fn verdict_notes(
    picture: &Picture,
    verdicts: &[PanelVerdict],
) -> Result<Vec<Vec<String>>, JobError> {
    let of = |panel: &FigurePanel| -> Result<Vec<String>, JobError> {
        let Some(verdict) = verdicts.iter().find(|v| v.panel == panel.label) else {
            return Ok(Vec::new());
        };
        let mut notes = vec![
            format!("{}: {}", panel.claimant, verdict.claim_text),
            format!("this run {}", outcome(verdict)),
        ];
        if let Some(repeats) = &panel.repeats {
            let Support { support, runs } = (repeats.count)(&repeats.panel)?;
            notes.push(format!("{support} of {runs} runs agree"));
        }
        Ok(notes)
    };
    picture.panels.iter().map(of).collect()
}

/// Whether a panel's run supports its claim. What is not decided, as that of a shortened run may
/// be, is neither.
fn outcome(verdict: &PanelVerdict) -> &'static str {
    let section = match &verdict.evidence {
        Grounds::Section(evidence) => Some(&evidence.verdict),
        Grounds::Paths { .. } | Grounds::Freshness { .. } => None,
    };
    match section {
        _ if verdict.agrees => "agrees",
        Some(Verdict::Undecided { .. } | Verdict::TooFew { .. }) => "is undecided",
        _ => "differs",
    }
}

/// Paths in space: the same box in every panel.
fn space_panels(
    mut sheet: Sheet,
    picture: &Picture,
    recordings: &[Recording],
    notes: &[Vec<String>],
    camera: &Camera,
) -> Sheet {
    let curves: Vec<Vec<Curve>> = recordings.iter().map(|r| curves(&r.data)).collect();
    let ranges: [(f64, f64); 3] = std::array::from_fn(|i| {
        let (low, high) = range_of(curves.iter().flatten().flat_map(|c| &c.points).map(|x| x[i]));
        let margin = 0.04 * (high - low);
        (low - margin, high + margin)
    });
    let names = picture.panels[0].run.system.coordinates();
    let order = camera.axes;
    let axis = |k: usize| {
        let (low, high) = ranges[order[k]];
        Axis::linear(format!("*{}*", greek(names[order[k]])), low, high)
    };
    let turn = |x: [f64; 3]| order.map(|i| x[i]);
    for (((panel, recording), curves), notes) in
        picture.panels.iter().zip(recordings).zip(&curves).zip(notes)
    {
        let mut patches = surface::patches(&panel.run.system, &ranges);
        for corner in patches.iter_mut().flat_map(|p| p.corners.iter_mut()) {
            *corner = turn(*corner);
        }
        let mut chart = SpacePanel::new(axis(0), axis(1), axis(2))
            .camera(camera.azimuth, camera.elevation)
            .surface(patches);
        for curve in curves {
            chart = chart.line(curve.points.iter().map(|x| turn(*x)).collect(), curve.style);
        }
        let connection = connection(&recording.data);
        if let Some(connection) = &connection {
            let points: Vec<[f64; 3]> = connection.points.iter().map(|x| turn(*x)).collect();
            let ends = [points[0], points[points.len() - 1]];
            chart = chart.line(points, CONNECTION).markers(ends.to_vec(), END);
            chart = chart.note(ends[0], "*A*", Anchor::Left).note(ends[1], "*B*", Anchor::Left);
        }
        let exits: Vec<[f64; 3]> = exits(&recording.data).into_iter().map(turn).collect();
        if !exits.is_empty() {
            chart = chart.markers(exits, EXIT);
        }
        let singularity = surface::singularity(&panel.run.system, &ranges);
        if let Some(point) = singularity {
            chart = chart.markers(vec![turn(point)], surface::TWO_FOLD);
        }
        sheet = sheet
            .panel(label(picture, panel), panel.title.as_str(), chart)
            .notes(notes.iter().cloned());
        // At the size of the whole the exits lie under the two-fold's dot.
        if let (Some(point), [_]) = (singularity, picture.panels.as_slice())
            && let Some(chart) = passage(
                panel,
                recording,
                &connected(curves, connection),
                point,
                [order[0], order[1]],
                &ranges,
            )
        {
            let title = format!("the passage, enlarged, seen along *{}*", greek(names[order[2]]));
            sheet = sheet.panel("", title, chart).footer(
                "in the enlargement, thin straight lines are flights above or below the surface",
            );
        }
    }
    let sheet = surface::two_fold_legend(surface::region_legend(sheet, |_| true));
    match recordings.first().map(|r| &r.data) {
        Some(Data::Motion(_)) => sheet
            .legend(LegendEntry::new(LegendKey::Line(FLIGHT), "flight"))
            .legend(LegendEntry::new(LegendKey::Line(SLIDING), "sliding"))
            .legend(LegendEntry::new(LegendKey::Marker(EXIT), "exit")),
        Some(data @ Data::Funnel { .. }) => sheet
            .footer(connection(data).map_or(String::new(), |c| c.words()))
            .legend(LegendEntry::new(
                LegendKey::Line(CONNECTION),
                "from *A* to *B* through the singularity",
            ))
            .legend(LegendEntry::new(LegendKey::Marker(EXIT), "exit"))
            .legend(LegendEntry::new(LegendKey::Line(APPROACH), "the one way in"))
            .legend(LegendEntry::new(LegendKey::Line(TO_PLUS), "ways out to *h* > 0"))
            .legend(LegendEntry::new(LegendKey::Line(TO_MINUS), "ways out to *h* < 0")),
        _ => sheet,
    }
}

/// The switching surface around the two-fold at `centre`, over the coordinates `axes`: what slides
/// there, where it leaves, and the flights over it. So wide that half of the exits lie well inside;
/// nothing if there is no exit.
fn passage(
    panel: &FigurePanel,
    recording: &Recording,
    curves: &[Curve],
    centre: [f64; 3],
    axes: [usize; 2],
    ranges: &[(f64, f64); 3],
) -> Option<PlanePanel> {
    let exits: Vec<[f64; 2]> =
        exits(&recording.data).into_iter().map(|x| axes.map(|i| x[i])).collect();
    let centre = axes.map(|i| centre[i]);
    // In heights of the view, which is wider than high.
    let distance =
        |p: &[f64; 2]| (PASSAGE_ASPECT * (p[0] - centre[0]).abs()).max((p[1] - centre[1]).abs());
    let mut distances: Vec<f64> = exits.iter().map(distance).collect();
    distances.sort_by(f64::total_cmp);
    let reach = 2.0 * distances.get(distances.len() / 2)?;
    if reach.is_nan() || reach <= 0.0 {
        return None;
    }
    let mut window = *ranges;
    for (k, i) in axes.into_iter().enumerate() {
        let reach = if k == 0 { reach / PASSAGE_ASPECT } else { reach };
        window[i] = (centre[k] - reach, centre[k] + reach);
    }
    let names = panel.run.system.coordinates();
    let axis = |k: usize| {
        let (low, high) = window[axes[k]];
        Axis::linear(format!("*{}*", greek(names[axes[k]])), low, high)
    };
    let mut chart = PlanePanel::new(axis(0), axis(1)).equal();
    chart.aspect = Some(PASSAGE_ASPECT);
    for patch in surface::patches(&panel.run.system, &window) {
        let outline = patch.corners.iter().map(|x| axes.map(|i| x[i])).collect();
        chart = chart.area(outline, patch.colour.lighten(0.5));
    }
    for curve in curves {
        let seen = curve.points.iter().map(|x| axes.map(|i| x[i])).collect();
        let width = if curve.flight { FLIGHT_FROM_ABOVE_PT } else { curve.style.width };
        chart = chart.line(seen, LineStyle { width, ..curve.style });
    }
    let inside: Vec<[f64; 2]> = exits.into_iter().filter(|p| distance(p) <= reach).collect();
    Some(chart.markers(inside, EXIT).markers(vec![centre], surface::TWO_FOLD))
}

/// Height of the nearer view divided by its width.
const PASSAGE_ASPECT: f64 = 0.62;
/// Width of flights in it: thinner than what lies on the surface.
const FLIGHT_FROM_ABOVE_PT: f64 = 0.3;

/// A trajectory between two points of the set, through the singularity.
struct Connection {
    points: Vec<[f64; 3]>,
    /// Times from the first point to the two-fold, and from there to the last one.
    times: [f64; 2],
}

impl Connection {
    fn words(&self) -> String {
        let [to, from] = self.times.map(|t| wording::number((10.0 * t).round() / 10.0));
        format!(
            "*A* and *B* lie on two futures. From *A* the singularity is reached after {to}, from \
                there *B* after {from}"
        )
    }
}

/// From a point of one future back to the two-fold, and on to a point of another one, on the other
/// side; none if no future comes back. The points are the farthest from the two-fold of the last
/// flight in and of the way out.
fn connection(data: &Data) -> Option<Connection> {
    let Data::Funnel { approach, futures } = data else { return None };
    let centre = approach.samples().last()?.1.x;
    let distance =
        |s: &Sample| (0..3).map(|i| (s.x[i] - centre[i]) * (s.x[i] - centre[i])).sum::<f64>();
    let farthest = |samples: &[Sample]| {
        (0..samples.len()).max_by(|i, k| distance(&samples[*i]).total_cmp(&distance(&samples[*k])))
    };
    let back = futures.iter().find(|f| comes_back(f))?;
    let other = futures.iter().rfind(|f| f.side != back.side && f.exit_time != back.exit_time)?;
    let first = back
        .motion
        .pieces
        .iter()
        .rposition(|(mode, samples)| !mode.slides() && samples.len() > 2)?;
    let samples = |pieces: &[(Mode, Vec<Sample>)]| {
        pieces.iter().flat_map(|(_, s)| s.iter().copied()).collect()
    };
    let way_in: Vec<Sample> = samples(&back.motion.pieces[first..]);
    let way_out: Vec<Sample> = samples(&other.motion.pieces);
    let from = farthest(&way_in)?;
    let to = farthest(&way_out)?;
    let points = way_in[from..].iter().chain(&way_out[..=to]).map(|s| s.x).collect();
    let times = [way_in.last()?.t - way_in[from].t, way_out[to].t - way_out[0].t];
    Some(Connection { points, times })
}

/// Curves, and on top of them a connection.
fn connected(curves: &[Curve], connection: Option<Connection>) -> Vec<Curve> {
    let connection =
        connection.map(|c| Curve { points: c.points, style: CONNECTION, flight: false });
    curves.iter().cloned().chain(connection).collect()
}

/// Whether a future reaches the two-fold again.
fn comes_back(future: &Future) -> bool {
    future.motion.events.iter().any(|e| matches!(e.kind, EventKind::TwoFoldReached { .. }))
}

/// A curve in space.
#[derive(Clone)]
struct Curve {
    points: Vec<[f64; 3]>,
    style: LineStyle,
    /// Whether it is a flight off the switching surface.
    flight: bool,
}

/// Curves that are drawn of a recording in space.
fn curves(data: &Data) -> Vec<Curve> {
    let points = |samples: &[Sample]| samples.iter().map(|s| s.x).collect::<Vec<_>>();
    let motion = |motion: &Motion, flight: LineStyle, sliding: LineStyle| -> Vec<Curve> {
        let curve = |(mode, samples): &(Mode, Vec<Sample>)| Curve {
            points: points(samples),
            style: if mode.slides() { sliding } else { flight },
            flight: !mode.slides(),
        };
        motion.pieces.iter().map(curve).collect()
    };
    match data {
        Data::Section(_) => Vec::new(),
        Data::Path(samples) => {
            vec![Curve { points: points(samples), style: PATH, flight: false }]
        }
        Data::Motion(m) => motion(m, FLIGHT, SLIDING),
        Data::Funnel { approach, futures } => {
            let mut all = Vec::new();
            for future in futures {
                let style = if future.side == Side::Plus { TO_PLUS } else { TO_MINUS };
                all.extend(motion(&future.motion, style, style));
            }
            all.extend(motion(approach, APPROACH, APPROACH));
            all
        }
    }
}

/// The points at which a motion leaves repelling sliding.
fn exits(data: &Data) -> Vec<[f64; 3]> {
    let of = |motion: &Motion| -> Vec<[f64; 3]> {
        let leaves = |kind: &EventKind| {
            matches!(kind, EventKind::Exit { .. } | EventKind::ExitAtBoundary { .. })
        };
        motion.events.iter().filter(|e| leaves(&e.kind)).map(|e| e.state.into()).collect()
    };
    match data {
        Data::Motion(motion) => of(motion),
        // Of a future the first one: later ones are other visits.
        Data::Funnel { futures, .. } => {
            futures.iter().filter_map(|f| of(&f.motion).into_iter().next()).collect()
        }
        _ => Vec::new(),
    }
}

/// A long path: thinner and lighter than a curve, so that its windings stay apart.
const PATH: LineStyle = LineStyle::new(style::SOFT_INK, 0.25);
/// Free flight of a Filippov motion.
const FLIGHT: LineStyle = LineStyle::new(style::INK, 0.6);
/// Sliding, drawn apart from flight by width and colour.
const SLIDING: LineStyle = LineStyle::new(style::GREEN, 1.6);
/// The motion up to a set-valued point.
const APPROACH: LineStyle = LineStyle::new(style::INK, 0.8).dashed();
/// A trajectory that connects two points.
const CONNECTION: LineStyle = LineStyle::new(style::INK, 1.4);
/// The points that it connects.
const END: MarkerStyle = MarkerStyle::new(MarkerShape::OpenDot, style::INK);
/// Futures on the side h > 0.
const TO_PLUS: LineStyle = LineStyle::new(style::BLUE, 0.35);
/// Futures on the side h < 0.
const TO_MINUS: LineStyle = LineStyle::new(style::VERMILLION, 0.35);
/// The end of repelling sliding.
const EXIT: MarkerStyle =
    MarkerStyle { shape: MarkerShape::OpenDot, colour: style::GREEN, size: 3.6 };

fn crossings(data: &Data) -> &[Crossing] {
    match data {
        Data::Section(crossings) => crossings,
        _ => &[],
    }
}

/// A coordinate's name in a picture.
fn greek(name: &str) -> &str {
    match name {
        "omega" => "ω",
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_job::simulate::simulate;
    use twofold_job::spec::{Method, MethodSpec, Observation, RunSpec, SwitchSpec};
    use twofold_render::sheet::PlaneLayer;

    #[test]
    fn the_enlarged_passage_shows_flights_whole() {
        let run = RunSpec {
            system: twofold_system::Caricature::with_reinjection(0.1, 1e-5).into(),
            switch: SwitchSpec::Filippov {
                exit: twofold_integrate::filippov::ExitRule::AfterTime {
                    time: 0.3,
                    side: Side::Plus,
                },
                funnel: None,
            },
            start: vec![0.2, 0.0, -1.0],
            t_end: 40.0,
            method: MethodSpec::ndsolve_defaults(Method::Dopri5),
            schedule: twofold_integrate::Schedule::default(),
            observe: Observation::Path { chord: 1e-3 },
        };
        let recording = simulate(&run, &()).unwrap();
        let curves = curves(&recording.data);
        let panel = FigurePanel::new("i", "", run);
        let ranges = [(-2.0, 2.0); 3];
        let chart = passage(&panel, &recording, &curves, [0.0; 3], [1, 2], &ranges).unwrap();
        let within = |p: &[f64; 2]| {
            (chart.x.lower..=chart.x.upper).contains(&p[0])
                && (chart.y.lower..=chart.y.upper).contains(&p[1])
        };
        let ends = curves.iter().flat_map(|c| [c.points.first(), c.points.last()]).flatten();
        let ends: Vec<[f64; 2]> = ends.map(|x| [x[1], x[2]]).collect();
        let mut left = 0;
        for layer in &chart.layers {
            let PlaneLayer::Line { points, .. } = layer else { continue };
            left += usize::from(!points.iter().all(within));
            for end in [points.first(), points.last()].into_iter().flatten() {
                assert!(!within(end) || ends.contains(end), "a line ends in mid-air at {end:?}");
            }
        }
        assert!(left > 3, "only {left} lines leave the window");
    }
}
