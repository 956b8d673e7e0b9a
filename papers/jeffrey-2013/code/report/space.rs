//! Views in space that can be turned: the lines and surfaces of a picture's panels, thinned and
//! packed for the page's script.
//!
//! Places are whole numbers from 0 to 65535 along each side of the box, so that a view of a long
//! orbit takes some tens of kilobytes. What the script draws from them is a way to look, and no
//! result: the pictures and tables beside it are.

use serde_json::{Value, json};

use twofold_job::Table;
use twofold_paper::draw::surface;
use twofold_paper::html::base64;
use twofold_paper::{Camera, Figure, View};
use twofold_render::number::number;
use twofold_render::sheet::{SpacePanel, range_of};
use twofold_render::{clip_polygon, markup, style, ticks};
use twofold_system::System;

/// A panel to be seen in space: its label, title and what the page's script reads.
#[derive(Clone, Debug, PartialEq)]
pub struct SpaceView {
    /// The panel.
    pub label: String,
    /// Its title, rich text.
    pub title: String,
    /// Data to draw, as JSON.
    pub data: Value,
}

/// A panel's numbers.
pub struct Source<'a> {
    /// Label of the panel.
    pub label: &'a str,
    /// Its title.
    pub title: &'a str,
    /// The system whose surface is drawn.
    pub system: &'a System,
    /// Its points: a path, a motion or a funnel.
    pub table: Table,
}

/// The camera of a figure's pictures, if they are views in space.
pub fn camera(figures: &[Figure], figure: &str) -> Option<Camera> {
    let known = figures.iter().find(|f| f.id == figure)?;
    known.pictures.iter().find_map(|p| match p.view {
        View::Space { camera } => Some(camera),
        _ => None,
    })
}

/// Most points of a view; a longer line is thinned more.
const MOST_POINTS: usize = 4000;
/// Whole numbers along a side of the box.
const SIDE: f64 = 65535.0;

/// A line and what it is.
struct Line {
    kind: &'static str,
    points: Vec<[f64; 3]>,
}

/// The views of a picture's panels, all in the same box.
pub fn views(sources: &[Source<'_>], camera: &Camera) -> Vec<SpaceView> {
    let lines: Vec<Vec<Line>> = sources.iter().map(lines).collect();
    let ranges: [(f64, f64); 3] = std::array::from_fn(|i| {
        let (low, high) = range_of(lines.iter().flatten().flat_map(|l| &l.points).map(|x| x[i]));
        let margin = 0.04 * (high - low);
        (low - margin, high + margin)
    });
    if lines.iter().all(Vec::is_empty) || ranges.iter().any(|(low, high)| low >= high) {
        return Vec::new();
    }
    sources.iter().zip(&lines).map(|(source, lines)| view(source, lines, &ranges, camera)).collect()
}

fn view(
    source: &Source<'_>,
    lines: &[Line],
    ranges: &[(f64, f64); 3],
    camera: &Camera,
) -> SpaceView {
    let names = source.system.coordinates();
    let axes: Vec<Value> = camera
        .axes
        .iter()
        .map(|i| {
            let (low, high) = ranges[*i];
            let place = |v: f64| ((v - low) / (high - low) * SIDE).round();
            let ticks = ticks::linear(low, high, 4.0).major;
            let ticks: Vec<Value> =
                ticks.iter().map(|t| json!([place(t.value), markup::plain(&t.label)])).collect();
            json!({ "name": markup::plain(&markup::name(names[*i])), "ticks": ticks })
        })
        .collect();
    let place = |x: &[f64; 3]| -> [u16; 3] {
        camera
            .axes
            .map(|i| ((x[i] - ranges[i].0) / (ranges[i].1 - ranges[i].0) * SIDE).round() as u16)
    };
    let mut tolerance = SIDE / 1500.0;
    let thinned = loop {
        let thinned: Vec<(&str, Vec<[u16; 3]>)> = lines
            .iter()
            .map(|l| (l.kind, thin(&l.points.iter().map(place).collect::<Vec<_>>(), tolerance)))
            .collect();
        if thinned.iter().map(|(_, p)| p.len()).sum::<usize>() <= MOST_POINTS || tolerance > SIDE {
            break thinned;
        }
        tolerance *= 1.5;
    };
    let lines: Vec<Value> =
        thinned.iter().map(|(kind, points)| json!([kind, packed(points)])).collect();
    let (low, high) = (ranges.map(|r| r.0), ranges.map(|r| r.1));
    let mut areas: [(&str, Vec<u16>); 3] =
        ["attracting", "repelling", "crossing"].map(|kind| (kind, Vec::new()));
    for patch in surface::patches(source.system, ranges) {
        let inside = clip_polygon(&patch.corners, low, high);
        if inside.len() < 3 {
            continue;
        }
        let kind = match patch.colour {
            c if c == style::ATTRACTING => 0,
            c if c == style::REPELLING => 1,
            _ => 2,
        };
        areas[kind].1.push(inside.len() as u16);
        areas[kind].1.extend(inside.iter().flat_map(place));
    }
    let areas: Vec<Value> = areas
        .iter()
        .filter(|(_, a)| !a.is_empty())
        .map(|(kind, a)| json!([kind, bytes(a)]))
        .collect();
    let marks: Vec<Value> =
        surface::singularity(source.system, ranges).iter().map(|p| json!(place(p))).collect();
    let about: Vec<String> = camera
        .axes
        .iter()
        .map(|i| {
            format!(
                "{} from {} to {}",
                markup::plain(&markup::name(names[*i])),
                plain(low[*i]),
                plain(high[*i])
            )
        })
        .collect();
    SpaceView {
        label: source.label.to_owned(),
        title: source.title.to_owned(),
        data: json!({
            "axes": axes,
            "about": about.join(", "),
            "camera": [camera.azimuth, camera.elevation],
            "size": SpacePanel::new(unit(), unit(), unit()).proportions,
            "lines": lines,
            "areas": areas,
            "marks": marks,
        }),
    }
}

fn unit() -> twofold_render::sheet::Axis {
    twofold_render::sheet::Axis::linear("", 0.0, 1.0)
}

/// Three significant digits.
fn plain(value: f64) -> String {
    markup::plain(&number(format!("{value:.2e}").parse().unwrap_or(value)))
}

/// The lines of a table of points, in the table's order: a path is one; a motion has one for each
/// piece, a funnel for each piece of each future.
fn lines(source: &Source<'_>) -> Vec<Line> {
    let names = source.system.coordinates();
    if names.len() != 3 {
        return Vec::new();
    }
    let columns = [0, 1, 2].map(|i| source.table.numbers(names[i]));
    let rows = columns.iter().map(|c| c.len()).min().unwrap_or(0);
    let (pieces, futures) = (source.table.integers("piece"), source.table.integers("future"));
    let words = |name: &str| source.table.words(name).collect::<Vec<_>>();
    let (modes, sides) = (words("mode"), words("exit_side"));
    let funnel = sides.iter().any(|s| !s.is_empty());
    let mut lines: Vec<Line> = Vec::new();
    let mut last = None;
    for row in 0..rows {
        let group = (futures.get(row), pieces.get(row));
        if last != Some(group) {
            let kind = match (funnel, sides.get(row).copied(), modes.get(row).copied()) {
                (true, Some("plus"), _) => "plus",
                (true, Some("minus"), _) => "minus",
                (true, ..) => "approach",
                (false, _, Some(mode)) if mode.starts_with("sliding") => "sliding",
                _ => "path",
            };
            lines.push(Line { kind, points: Vec::new() });
            last = Some(group);
        }
        let point = columns.map(|c| c[row]);
        if let Some(line) = lines.last_mut()
            && point.iter().all(|v| v.is_finite())
        {
            line.points.push(point);
        }
    }
    lines.retain(|l| l.points.len() > 1);
    lines
}

/// Leaves out points that lie within `tolerance` of the line drawn without them (Douglas & Peucker
/// 1973); long lines are cut into pieces first, which bounds the work.
fn thin(points: &[[u16; 3]], tolerance: f64) -> Vec<[u16; 3]> {
    const PIECE: usize = 512;
    let mut kept = Vec::new();
    let mut start = 0;
    while start + 1 < points.len() {
        let end = (start + PIECE).min(points.len() - 1);
        let mut keep = vec![false; end - start + 1];
        let mut open = vec![(start, end)];
        while let Some((a, b)) = open.pop() {
            let farthest = (a + 1..b).map(|i| (i, distance(points[i], points[a], points[b])));
            if let Some((i, far)) = farthest.max_by(|p, q| p.1.total_cmp(&q.1))
                && far > tolerance * tolerance
            {
                keep[i - start] = true;
                open.extend([(a, i), (i, b)]);
            }
        }
        keep[0] = true;
        kept.extend((start..end).filter(|i| keep[i - start]).map(|i| points[i]));
        start = end;
    }
    kept.extend(points.last());
    kept
}

/// The squared distance of `p` from the segment between `a` and `b`.
fn distance(p: [u16; 3], a: [u16; 3], b: [u16; 3]) -> f64 {
    let minus = |u: [u16; 3], v: [u16; 3]| [0, 1, 2].map(|i| f64::from(u[i]) - f64::from(v[i]));
    let dot = |u: [f64; 3], v: [f64; 3]| u[0] * v[0] + u[1] * v[1] + u[2] * v[2];
    let (along, to) = (minus(b, a), minus(p, a));
    let length = dot(along, along);
    let share = if length > 0.0 { (dot(to, along) / length).clamp(0.0, 1.0) } else { 0.0 };
    let off = [0, 1, 2].map(|i| to[i] - share * along[i]);
    dot(off, off)
}

fn packed(points: &[[u16; 3]]) -> String {
    bytes(&points.concat())
}

/// Little-endian, base 64.
fn bytes(numbers: &[u16]) -> String {
    base64(&numbers.iter().flat_map(|n| n.to_le_bytes()).collect::<Vec<u8>>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_job::table::Column;

    fn table(rows: &[([f64; 3], &str, i64)]) -> Table {
        let columns = ["x", "y", "z"]
            .map(Column::numbers)
            .into_iter()
            .chain([Column::words("mode"), Column::integers("piece")]);
        let mut table = Table::new("motion", columns);
        for (x, mode, piece) in rows {
            table.push(x.iter().map(|v| (*v).into()).chain([(*mode).into(), (*piece).into()]));
        }
        table
    }

    #[test]
    fn pieces_are_lines_and_corners_stay() {
        let system = System::builtin("caricature").unwrap();
        let rows: Vec<([f64; 3], &str, i64)> = (0..=100)
            .map(|i| ([1.0 - f64::from(i) / 100.0, 0.5, -1.0], "plus", 0))
            .chain((0..=100).map(|i| {
                (
                    [0.0, 0.5 - f64::from(i) / 50.0, -1.0 + f64::from(i) / 50.0],
                    "sliding-attracting",
                    1,
                )
            }))
            .collect();
        let source = Source { label: "i", title: "", system: &system, table: table(&rows) };
        let camera = Camera { axes: [1, 2, 0], azimuth: -60.0, elevation: 18.0 };
        let views = views(&[source], &camera);
        let lines = views[0].data["lines"].as_array().unwrap();
        let kinds: Vec<&str> = lines.iter().map(|l| l[0].as_str().unwrap()).collect();
        assert_eq!(kinds, ["path", "sliding"]);
        // Straight lines: two points of three numbers of two bytes, sixteen characters in base 64.
        assert!(lines.iter().all(|l| l[1].as_str().unwrap().len() == 16), "{lines:?}");
        assert!(
            views[0].data["areas"].as_array().unwrap().len() == 3
                && views[0].data["marks"].as_array().unwrap().len() == 1
        );
        let axes: Vec<&str> = views[0].data["axes"]
            .as_array()
            .unwrap()
            .iter()
            .map(|a| a["name"].as_str().unwrap())
            .collect();
        assert_eq!(axes, ["y", "z", "x"]);
    }

    #[test]
    fn thinning_keeps_what_is_far_from_the_line() {
        let mut points: Vec<[u16; 3]> = (0..2000).map(|i| [i * 30, 100, 100]).collect();
        points[777] = [777 * 30, 100, 400];
        let kept = thin(&points, 10.0);
        assert!(kept.contains(&points[777]) && kept.len() < 15, "{}", kept.len());
        assert_eq!((kept.first(), kept.last()), (points.first(), points.last()));
        assert_eq!(thin(&points[..1], 10.0), points[..1]);
    }

    #[test]
    fn only_figures_in_space_have_views() {
        let figures = crate::all();
        let known: Vec<&str> =
            figures.iter().map(|f| &*f.id).filter(|id| camera(&figures, id).is_some()).collect();
        assert_eq!(known, ["fig4"]);
        assert!(camera(&figures, "nothing").is_none());
    }
}
