//! The limit of a stiff switch: smoothed orbits beside the Filippov motion. Not a figure of the paper; it checks the paper's premise
//! that smoothing is harmless away from the singularity, and that it decides nothing there.

use nalgebra::SVector;
use serde_json::{Value, json};
use twofold::figure::simulate::RunError;
use twofold::figure::study::{Entry, Table};
use twofold::figure::wording::number;
use twofold::figure::{Figure, Picture, Reading, Study, View, cli};
use twofold::integrate::filippov::limit::{ConvergenceRow, after_visit, convergence, observed_rate};
use twofold::integrate::filippov::{EventKind, FunnelGrid, Mode, Settings, Side, funnel};
use twofold::render::sheet::*;
use twofold::render::style;

/// The start of the paper's runs.
const START: [f64; 3] = [0.2, 0.0, -1.0];
/// Stiffness parameters before the visit.
const BEFORE: [f64; 6] = [1.6e-2, 8e-3, 4e-3, 2e-3, 1e-3, 5e-4];
/// Stiffness parameters after the visit.
const AFTER: [f64; 5] = [1e-2, 3e-3, 1e-3, 3e-4, 1e-4];
/// Exits are compared where they cross the surface x = 0 farther than this from the singularity.
const BEYOND: f64 = 0.6;
/// The crossing comes before this time.
const T_END: f64 = 80.0;
/// The futures that are looked at.
const GRID: FunnelGrid =
    FunnelGrid { shortest: 1e-3, longest: 2.5, times: 80, horizon: 12.0, until_two_fold: true, per_step: 1 };
/// Colours and shapes of the times.
const LOOKS: [(Colour, MarkerShape); 4] = [
    (style::BLUE, MarkerShape::Dot),
    (style::VERMILLION, MarkerShape::Square),
    (style::GREEN, MarkerShape::Triangle),
    (style::PURPLE, MarkerShape::Star),
];

/// Times before the first visit at which the orbits are compared.
fn times(reading: Reading) -> [f64; 4] {
    match reading {
        Reading::Printed => [5.0, 12.0, 35.0, 50.0],
        Reading::Reconstructed => [2.0, 7.0, 9.0, 11.0],
    }
}

fn question(reading: Reading) -> Value {
    json!({
        "study": "convergence",
        "system": reading.caricature(),
        "start": START,
        "before": { "eps": BEFORE, "times": times(reading) },
        "after": {
            "eps": AFTER, "beyond": BEYOND, "t_end": T_END,
            "funnel": {
                "shortest": GRID.shortest, "longest": GRID.longest, "times": GRID.times, "horizon": GRID.horizon,
                "until_two_fold": GRID.until_two_fold,
            },
        },
        "tolerance": Settings::default().tolerance,
    })
}

fn side(side: Side) -> &'static str {
    match side {
        Side::Plus => "plus",
        Side::Minus => "minus",
    }
}

fn compute(reading: Reading) -> Result<Vec<Table>, RunError> {
    let (system, x0, settings) = (reading.caricature(), SVector::from(START), Settings::default());
    let mut before = Table::new("before", &["eps", "t", "mode", "distance"]);
    for row in convergence(&system, x0, &times(reading), &BEFORE, &settings)? {
        let mode = if row.mode == Mode::SlidingAttracting { "sliding" } else { "free" };
        before.rows.push(vec![row.eps.into(), row.t.into(), mode.into(), row.distance.into()]);
    }
    let mut members = Table::new("funnel", &["exit_time", "side", "y", "z"]);
    let futures = funnel(&system, x0, T_END, &settings, &GRID)?;
    for member in &futures.members {
        let up = EventKind::Crossing { to: Side::Plus };
        let far = |x: &SVector<f64, 3>| (x - futures.point).norm() > BEYOND;
        if let Some(event) = member.trajectory.events.iter().find(|e| e.kind == up && far(&e.state)) {
            let [y, z] = [event.state[1], event.state[2]];
            members.rows.push(vec![member.exit_time.into(), side(member.side).into(), y.into(), z.into()]);
        }
    }
    let columns = ["eps", "y", "z", "nearest_exit_time", "nearest_side", "distance", "width", "t_visit"];
    let mut after = Table::new("after", &columns);
    for row in after_visit(&system, x0, T_END, &AFTER, BEYOND, &GRID, &settings)? {
        after.rows.push(vec![
            row.eps.into(),
            row.crossing[1].into(),
            row.crossing[2].into(),
            row.exit_time.into(),
            side(row.side).into(),
            row.distance.into(),
            row.width.into(),
            futures.t.into(),
        ]);
    }
    Ok(vec![before, members, after])
}

fn value(entry: &Entry) -> f64 {
    if let Entry::Number(v) = entry { *v } else { f64::NAN }
}

/// A line of this slope through the first point, over the points' range.
fn guide(points: &[[f64; 2]], power: impl Fn(f64) -> f64) -> Vec<[f64; 2]> {
    let Some(&[x0, y0]) = points.last() else { return Vec::new() };
    points.iter().map(|p| [p[0], y0 * power(p[0] / x0)]).collect()
}

fn draw(tables: &[Table]) -> Sheet {
    let [before, members, after] = tables else { unreachable!("compute makes three tables") };
    let expected = LineStyle::new(style::SOFT_INK, style::CURVE_PT).dashed();

    let mut moments: Vec<f64> = Vec::new();
    for row in &before.rows {
        if !moments.contains(&value(&row[1])) {
            moments.push(value(&row[1]));
        }
    }
    let mut approach = PlanePanel::new(
        Axis::log_covering("*ε*", before.rows.iter().map(|r| value(&r[0]))),
        Axis::log_covering("distance", before.rows.iter().map(|r| value(&r[3]))),
    );
    let mut rates = Vec::new();
    for (&t, (colour, shape)) in moments.iter().zip(LOOKS) {
        let rows: Vec<_> = before.rows.iter().filter(|r| value(&r[1]) == t).collect();
        let points: Vec<[f64; 2]> = rows.iter().map(|r| [value(&r[0]), value(&r[3])]).collect();
        let marker = MarkerStyle { shape, colour, size: 4.0 };
        approach = approach.line(guide(&points, |ratio| ratio), expected).markers(points.clone(), marker);
        let mode = if rows.iter().all(|r| r[2] == Entry::from("sliding")) { "sliding" } else { "free" };
        approach = approach.legend(LegendKey::Marker(marker), format!("*t* = {} ({mode})", number(t)));
        let slope: Vec<ConvergenceRow> = points
            .iter()
            .map(|p| ConvergenceRow { eps: p[0], t, mode: Mode::SlidingAttracting, distance: p[1] })
            .collect();
        rates.push(format!("{:.3} at *t* = {}", observed_rate(&slope, t), number(t)));
    }
    let approach = approach.legend_at(Corner::LowerRight);

    let crossings = |name: &'static str| -> Vec<[f64; 2]> {
        let rows = members.rows.iter().filter(|r| r[1] == Entry::from(name));
        rows.map(|r| [value(&r[2]), value(&r[3])]).collect()
    };
    let exits: Vec<[f64; 2]> = after.rows.iter().map(|r| [value(&r[1]), value(&r[2])]).collect();
    let all = || members.rows.iter().map(|r| [value(&r[2]), value(&r[3])]).chain(exits.iter().copied());
    let mut inside =
        PlanePanel::new(Axis::covering("*y*", all().map(|p| p[0])), Axis::covering("*z*", all().map(|p| p[1])));
    for (name, words, colour) in
        [("plus", "left to *x* > 0", style::BLUE), ("minus", "left to *x* < 0", style::VERMILLION)]
    {
        let marker = MarkerStyle { shape: MarkerShape::Dot, colour, size: 2.6 };
        inside = inside.markers(crossings(name), marker).legend(LegendKey::Marker(marker), words);
    }
    let smoothed = MarkerStyle { shape: MarkerShape::OpenDot, colour: style::INK, size: 5.0 };
    inside = inside.markers(exits.clone(), smoothed).legend(LegendKey::Marker(smoothed), "smoothed");
    for (row, at) in after.rows.iter().zip(&exits) {
        inside = inside.note([at[0], at[1]], format!("  {}", number(value(&row[0]))), Anchor::Left);
    }

    let distances: Vec<[f64; 2]> = after.rows.iter().map(|r| [value(&r[0]), value(&r[5])]).collect();
    let widths: Vec<[f64; 2]> = after.rows.iter().map(|r| [value(&r[0]), value(&r[6])]).collect();
    let near = MarkerStyle { shape: MarkerShape::Dot, colour: style::INK, size: 4.0 };
    let wide = LineStyle::new(style::GREEN, style::CURVE_PT);
    let last = PlanePanel::new(
        Axis::log_covering("*ε*", distances.iter().map(|p| p[0])),
        Axis::log_covering("distance", distances.iter().chain(&widths).map(|p| p[1])),
    )
    .line(widths, wide)
    .line(guide(&distances, |ratio| ratio), expected)
    .markers(distances.clone(), near)
    .legend(LegendKey::Line(wide), "width of the funnel")
    .legend(LegendKey::Marker(near), "to its nearest member")
    .legend_at(Corner::LowerRight);

    let visit = after.rows.first().map_or(f64::NAN, |r| value(&r[7]));
    let nearest: Vec<String> = after
        .rows
        .iter()
        .map(|r| format!("{} for *ε* = {}", number((value(&r[3]) * 1e3).round() / 1e3), number(value(&r[0]))))
        .collect();
    let rows: Vec<ConvergenceRow> = distances
        .iter()
        .map(|p| ConvergenceRow { eps: p[0], t: 0.0, mode: Mode::SlidingAttracting, distance: p[1] })
        .collect();
    Sheet::new(ColumnWidth::Double, 3, "")
        .panel_aspect(1.1)
        .panel("(a)", "before the visit", approach)
        .panel("(b)", "crossings of *x* = 0 after it", inside)
        .panel("(c)", "nearest member", last)
        .legend(LegendEntry::new(LegendKey::Line(expected), "distance ∝ *ε*, through the point of the smallest *ε*"))
        .footer(format!(
            "(a) Distance of the smoothed orbit from the Filippov orbit, whose first visit to the singularity is at *t* = {visit:.3}. \
             Measured powers of *ε*, least squares: {}.",
            rates.join(", ")
        ))
        .footer(format!(
            "(b) Where the Filippov orbits that leave the singularity after a time of repelling sliding of {} … {} first cross upwards \
             farther than {} from it, and where smoothed orbits do (labels: *ε*).",
            number(GRID.shortest),
            number(GRID.longest),
            number(BEYOND)
        ))
        .footer(format!(
            "(c) Distance in (b) to the nearest Filippov orbit, measured power of *ε* {:.2}. Its time of repelling sliding: {}.",
            observed_rate(&rows, 0.0),
            nearest.join(", ")
        ))
}

/// The figure's specification.
pub fn figure() -> Figure {
    let title = "Smoothed orbits and the Filippov motion as the switch steepens";
    let picture = |reading: Reading, study| {
        Picture {
        name: format!("convergence-{}", reading.word()),
        reading: Some(reading),
        title,
        caption: "(a) Distance between smoothed orbit and Filippov orbit at four times before the first visit to the singularity, \
                  against ε, with lines proportional to ε. (b) After the visit the Filippov motion is a set: where its members next cross \
                  the surface x = 0 far from the singularity, and where smoothed orbits cross it, in the plane of y and z. (c) Distance of \
                  each smoothed crossing to the nearest member, beside the width of the set."
            .into(),
        view: View::Study(study),
        panels: Vec::new(),
        alterations: Vec::new(),
    }
    };
    let printed = Study { question: || question(Reading::Printed), compute: || compute(Reading::Printed), draw };
    let reconstructed =
        Study { question: || question(Reading::Reconstructed), compute: || compute(Reading::Reconstructed), draw };
    Figure {
        id: "convergence",
        title,
        pictures: vec![picture(Reading::Printed, printed), picture(Reading::Reconstructed, reconstructed)],
    }
}

/// Makes the figure.
pub fn main() -> std::process::ExitCode {
    cli::main(figure())
}
