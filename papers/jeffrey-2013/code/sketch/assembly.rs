//! Fig. 1: the wheel assembly in space and from above, drawn to scale from the model's geometry.
//!
//! Coordinates: origin at the axle of the disc, first axis along the wheel's line, second from the
//! axle to the line. The wheel stands at (r, d); its axle points along (sin gamma, cos gamma), it
//! rolls along (cos gamma, -sin gamma), as in eq. (2).

use super::{lines_of, lines_table};
use twofold_job::table::Table;
use twofold_num::elementary::{cos, sin};
use twofold_render::Sheet;
use twofold_render::sheet::{
    Anchor, Axis, ColumnWidth, LineStyle, MarkerShape, MarkerStyle, Patch, PlanePanel, SpacePanel,
};
use twofold_render::style;
use twofold_system::System;

/// A line of the drawing: its name decides its look.
type Line = (String, Vec<[f64; 2]>);

/// Radius of the disc, in the model's lengths; the model does not need it, only that the wheel
/// stays on it.
const DISC: f64 = 1.7;
/// Half length and half width of the tyre's print.
const TYRE: [f64; 2] = [0.34, 0.09];

/// Everything that is drawn, with the wheel at `r` on its line.
pub fn tables(wheel: &System, r: f64) -> Vec<Table> {
    let value = |name| wheel.parameter(name).expect("it has one");
    let (d, gamma) = (value("d"), value("gamma"));
    let centre = [r, d];
    let (s, c) = (sin(gamma), cos(gamma));
    let (rolling, axle) = ([c, -s], [s, c]);
    let at = |a: f64, b: f64| {
        [centre[0] + a * rolling[0] + b * axle[0], centre[1] + a * rolling[1] + b * axle[1]]
    };
    let mut lines: Vec<Line> = Vec::new();
    let mut add = |name: &str, points: Vec<[f64; 2]>| lines.push((name.to_owned(), points));

    add("disc", arc([0.0, 0.0], DISC, 0.0, 360.0));
    add("housing", arc([0.0, 0.0], 0.93 * DISC, 0.0, 360.0));
    add("disc-turns", arc([0.0, 0.0], 1.07 * DISC, 205.0, 245.0));
    add("housing-turns", arc([0.0, 0.0], 0.80 * DISC, 290.0, 330.0));
    let reach = 0.93 * DISC;
    let half = twofold_num::elementary::sqrt((reach * reach - d * d).max(0.0));
    add("track", vec![[-half, d], [half, d]]);
    add("distance", vec![[0.0, 0.0], [0.0, d]]);
    // Spring with a straight lead at each end, its turns shrinking with r: it is drawn as long as
    // it is.
    let (from, to) = (0.06 * r, r - 0.30);
    let turns = 9;
    let mut spring = vec![[0.0, d], [from, d]];
    for k in 0..turns {
        let x = from + (to - from) * (f64::from(k) + 0.5) / f64::from(turns);
        spring.push([x, d + if k % 2 == 0 { 0.055 } else { -0.055 }]);
    }
    spring.extend([[to, d], centre]);
    add("spring", spring);
    let [a, b] = TYRE;
    add("tyre", vec![at(-a, -b), at(a, -b), at(a, b), at(-a, b), at(-a, -b)]);
    add("axle", vec![at(0.0, -0.42), at(0.0, 0.42)]);
    add("rolling", vec![at(a, 0.0), at(a + 0.34, 0.0)]);
    add("slip", vec![at(0.0, 0.42), at(0.0, 0.72)]);
    // The axle makes the angle pi/2 - gamma with the line; gamma is between the rolling direction
    // and the line.
    let degrees = gamma * 180.0 / std::f64::consts::PI;
    add("angle", arc(centre, 0.55, -degrees, 0.0));
    add("speed", vec![[r + 0.62, d], [r + 0.92, d]]);
    vec![lines_table(["x", "y"], &lines)]
}

fn arc(centre: [f64; 2], radius: f64, from: f64, to: f64) -> Vec<[f64; 2]> {
    let n = ((to - from).abs() / 2.0).ceil() as usize;
    (0..=n)
        .map(|k| {
            let a = (from + (to - from) * k as f64 / n as f64) * std::f64::consts::PI / 180.0;
            [centre[0] + radius * cos(a), centre[1] + radius * sin(a)]
        })
        .collect()
}

/// The drawing.
pub fn draw(tables: &[Table]) -> Sheet {
    let lines = tables.first().map(lines_of::<2>).unwrap_or_default();
    Sheet::new(ColumnWidth::Single, 1, "")
        .subtitle("our reconstruction, to scale")
        .panel("(a)", "obliquely", oblique(&lines))
        .panel("(b)", "from above", from_above(&lines))
}

/// Height of the wheel's hub above the disc: the tyre stands on it.
const HUB: f64 = TYRE[0];

/// The assembly in space: the disc below, the wheel upright on it, and at the height of its hub the
/// housing with the line along which it moves.
fn oblique(lines: &[Line]) -> SpacePanel {
    let thin = LineStyle::new(style::SOFT_INK, 0.6);
    let ink = LineStyle::new(style::INK, 0.9);
    let axis = |reach: f64| Axis::linear("", -reach, reach);
    let mut panel = SpacePanel::new(axis(1.9), axis(1.9), Axis::linear("", 0.0, 2.2 * HUB))
        .proportions([3.8, 3.8, 2.2 * HUB])
        .camera(-70.0, 32.0)
        .unboxed();
    for (name, points) in lines {
        // Height of a line: the disc's at 0, others at that of the hub.
        let height = if matches!(name.as_str(), "disc" | "disc-turns" | "slip" | "rolling") {
            0.0
        } else {
            HUB
        };
        let lifted: Vec<[f64; 3]> = points.iter().map(|p| [p[0], p[1], height]).collect();
        let last = lifted[lifted.len() - 1];
        panel = match name.as_str() {
            "disc" => panel
                .surface(vec![Patch { corners: lifted.clone(), colour: style::CROSSING }])
                .line(lifted, ink)
                .note([0.0, -1.2, 0.0], "disc", Anchor::Centre),
            "housing" => panel.line(lifted, thin.dashed()).note(
                [-1.1, -0.75, HUB],
                "housing",
                Anchor::Centre,
            ),
            "track" => panel.line(lifted, thin.dotted()),
            "distance" => panel
                .line(vec![[0.0, 0.0, 0.0], [0.0, 0.0, HUB]], ink)
                .note([0.0, 0.5 * last[1], HUB], "*d* ", Anchor::Right)
                .line(lifted, thin),
            "tyre" => {
                let at = |i: usize| [points[i][0], points[i][1]];
                let (near, far) = (wheel_side([at(0), at(1)]), wheel_side([at(3), at(2)]));
                let tread =
                    near.windows(2).zip(far.windows(2)).map(|(a, b)| vec![a[0], a[1], b[1], b[0]]);
                let grey = |corners| Patch { corners, colour: style::INK.lighten(0.35) };
                let wheel = tread.chain([near.clone(), far.clone()]).map(grey).collect();
                panel.surface(wheel).line(far, ink).line(near, ink)
            }
            "spring" => {
                let along = |share: f64| [share * last[0], last[1], HUB];
                panel
                    .line(lifted, LineStyle::new(style::BLUE, 0.9))
                    .note(along(0.3), "*k*_{w}, *c*_{w}", Anchor::Above)
                    .note(along(0.35), "*r*", Anchor::Below)
            }
            "slip" => panel.arrow(lifted, LineStyle::new(style::VERMILLION, 1.1)).note(
                last,
                " slip *h*",
                Anchor::Below,
            ),
            "rolling" => panel.arrow(lifted, ink).note(last, "rolling *V*", Anchor::Below),
            "speed" => panel.arrow(lifted, LineStyle::new(style::BLUE, 1.1)).note(
                last,
                "*v*",
                Anchor::Above,
            ),
            "disc-turns" => panel.arrow(lifted, ink).note(last, "*ω*_{0}", Anchor::Below),
            "housing-turns" => panel.arrow(lifted, thin).note(last, " *ω*", Anchor::Left),
            "angle" => panel,
            _ => panel.line(lifted, ink),
        };
    }
    panel
}

/// The outline of one side of the wheel, upright over the ends of that side's print on the disc.
fn wheel_side([from, to]: [[f64; 2]; 2]) -> Vec<[f64; 3]> {
    let circle = arc([0.0, 0.0], 1.0, 0.0, 360.0);
    let point = |[along, up]: [f64; 2]| {
        let share = 0.5 * (1.0 + along);
        [from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1]), HUB * (1.0 + up)]
    };
    circle.into_iter().map(point).collect()
}

/// The assembly in its plane.
fn from_above(lines: &[Line]) -> PlanePanel {
    let thin = LineStyle::new(style::SOFT_INK, 0.6);
    let ink = LineStyle::new(style::INK, 0.9);
    let mut panel = PlanePanel::sketch((-2.15, 2.15), (-2.0, 1.75));
    panel.aspect = Some(0.85);
    for (name, points) in lines.iter().cloned() {
        let last = points[points.len() - 1];
        panel = match name.as_str() {
            "disc" => panel.area(points.clone(), style::CROSSING).line(points, ink),
            "housing" => panel.line(points, thin.dashed()),
            "track" => panel.line(points, thin.dotted()),
            "distance" => {
                let middle = [last[0], 0.5 * last[1]];
                panel.line(points, thin).note(middle, "*d* ", Anchor::Right)
            }
            "spring" => {
                let left = [-0.04, last[1] + 0.14];
                panel
                    .line(points, LineStyle::new(style::BLUE, 0.9))
                    .note(left, "*k*_{w}, *c*_{w}", Anchor::Right)
                    .note([0.25 * last[0], last[1] - 0.06], "*r*", Anchor::Below)
            }
            "tyre" => panel.solid(points.clone(), style::INK.lighten(0.35)).line(points, ink),
            "axle" => panel.line(points, ink),
            "rolling" => panel.arrow(points, ink).note(last, " rolling *V*", Anchor::Left),
            "slip" => panel.arrow(points, LineStyle::new(style::VERMILLION, 1.1)).note(
                last,
                " slip *h*",
                Anchor::Left,
            ),
            "angle" => {
                let middle = points[points.len() / 2];
                panel.line(points, thin).note(middle, " *γ*", Anchor::Left)
            }
            "speed" => panel.arrow(points, LineStyle::new(style::BLUE, 1.1)).note(
                last,
                " *v*",
                Anchor::Left,
            ),
            "disc-turns" => panel.arrow(points, ink).note(last, "*ω*_{0}", Anchor::Below),
            "housing-turns" => panel.arrow(points, thin).note(last, "*ω*, *c*_{h}", Anchor::Right),
            _ => panel.line(points, ink),
        };
    }
    panel
        .markers(vec![[0.0, 0.0]], MarkerStyle::new(MarkerShape::OpenDot, style::INK))
        .note([0.06, -0.10], "axle of the disc", Anchor::Left)
        .note([0.0, -1.35], "disc, turning at *ω*_{0}", Anchor::Centre)
        .note([-0.75, -0.55], "housing (dashed)", Anchor::Centre)
}
