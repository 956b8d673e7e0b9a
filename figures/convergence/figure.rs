//! The limit of a stiff switch: smoothed orbits beside the Filippov motion. Not a figure of the paper; it checks the paper's premise
//! that smoothing is harmless away from the singularity, and that it decides nothing there.

use std::sync::Arc;

use nalgebra::SVector;
use rayon::prelude::*;
use serde_json::{Value, json};
use twofold::analyse::digits::{Plane, reference};
use twofold::integrate::Failure;
use twofold::integrate::filippov::limit::{ConvergenceRow, convergence, observed_rate};
use twofold::integrate::filippov::{EventKind, FilippovError, FunnelGrid, Mode, Settings, Side, funnel};
use twofold::job::table::{Column, Entry, Table};
use twofold::job::{AnyQuestion, JobError};
use twofold::num::elementary::pow;
use twofold::num::{Arithmetic, DoubleDouble, Scalar};
use twofold::paper::study::Computed;
use twofold::paper::wording::number;
use twofold::paper::{Figure, Reading, Study};
use twofold::render::sheet::*;
use twofold::render::style;
use twofold::system::filippov::{Region, region};
use twofold::system::{Smoothed, Transition};

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
/// Finer grids in the search for the nearest member.
const REFINEMENTS: usize = 3;
/// Exit times of each.
const FINER: usize = 21;
/// More passages than a smoothed orbit makes.
const MOST_PASSAGES: usize = 1000;
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
        "refinements": [REFINEMENTS, FINER],
        "tolerance": Settings::default().tolerance,
    })
}

fn side(side: Side) -> &'static str {
    match side {
        Side::Plus => "plus",
        Side::Minus => "minus",
    }
}

/// Where a future of the singularity crosses.
struct Crossing {
    exit_time: f64,
    side: Side,
    state: SVector<f64, 3>,
}

/// The funnel's crossings.
struct Crossings {
    t_visit: f64,
    point: SVector<f64, 3>,
    members: Vec<Crossing>,
}

/// The first upward crossing of each future farther than [`BEYOND`] from the singularity.
fn crossings(reading: Reading, grid: &FunnelGrid) -> Result<Crossings, FilippovError> {
    let futures = funnel(&reading.caricature(), SVector::from(START), T_END, &Settings::default(), grid)?;
    let up = EventKind::Crossing { to: Side::Plus };
    let members = futures.members.iter().filter_map(|m| {
        let event = m.trajectory.events.iter().find(|e| e.kind == up && (e.state - futures.point).norm() > BEYOND)?;
        Some(Crossing { exit_time: m.exit_time, side: m.side, state: event.state })
    });
    Ok(Crossings { t_visit: futures.t, point: futures.point, members: members.collect() })
}

/// The same crossing of the smoothed orbit, in double-double arithmetic: a visit costs more digits than `f64` has.
fn smoothed(reading: Reading, eps: f64, visit: &Crossings) -> Result<Option<SVector<f64, 3>>, Failure> {
    let system = reading.caricature();
    let field = Smoothed { system, transition: Transition::Tanh, eps };
    let x0 = SVector::from(START).map(DoubleDouble::from_f64);
    let surface = Plane { coordinate: 0, value: 0.0 };
    let passages = reference(&field, x0, surface, MOST_PASSAGES, visit.t_visit + GRID.horizon, false)?;
    let later = passages.iter().filter(|c| c.t.to_f64() > visit.t_visit).map(|c| c.x.map(|v| v.to_f64()));
    let mut far = later.filter(|x| (x - visit.point).norm() > BEYOND);
    Ok(far.find(|x| region(&system, x) == Region::CrossingUp))
}

/// The member that crosses nearest to `x`: the nearest of the grid, then of finer and finer grids around it.
fn nearest(
    reading: Reading,
    found: &Crossings,
    x: &SVector<f64, 3>,
) -> Result<Option<(f64, Side, f64)>, FilippovError> {
    let best = |members: &[Crossing], side: Option<Side>| {
        let those = members.iter().filter(|m| side.is_none_or(|s| s == m.side));
        let distances = those.map(|m| (m.exit_time, m.side, (m.state - x).norm()));
        distances.min_by(|a, b| a.2.total_cmp(&b.2))
    };
    let Some(mut near) = best(&found.members, None) else { return Ok(None) };
    let mut ratio = pow(GRID.longest / GRID.shortest, 1.0 / (GRID.times - 1) as f64);
    for _ in 0..REFINEMENTS {
        let grid = FunnelGrid { shortest: near.0 / ratio, longest: near.0 * ratio, times: FINER, ..GRID };
        if let Some(finer) = best(&crossings(reading, &grid)?.members, Some(near.1))
            && finer.2 < near.2
        {
            near = finer;
        }
        ratio = pow(ratio, 2.0 / (FINER - 1) as f64);
    }
    Ok(Some(near))
}

fn compute(reading: Reading) -> Result<Vec<Table>, JobError> {
    let (system, x0, settings) = (reading.caricature(), SVector::from(START), Settings::default());
    let mut before = Table::new(
        "before",
        [Column::numbers("eps"), Column::numbers("t"), Column::words("mode"), Column::numbers("distance")],
    );
    for row in convergence(&system, x0, &times(reading), &BEFORE, &settings)? {
        let mode = if row.mode == Mode::SlidingAttracting { "sliding" } else { "free" };
        before.push(vec![row.eps.into(), row.t.into(), mode.into(), row.distance.into()]);
    }
    let found = crossings(reading, &GRID)?;
    let mut members = Table::new(
        "funnel",
        [Column::numbers("exit_time"), Column::words("side"), Column::numbers("y"), Column::numbers("z")],
    );
    let mut width = 0.0_f64;
    for (i, a) in found.members.iter().enumerate() {
        members.push(vec![a.exit_time.into(), side(a.side).into(), a.state[1].into(), a.state[2].into()]);
        for b in &found.members[..i] {
            width = width.max((a.state - b.state).norm());
        }
    }
    let exits: Vec<Result<Option<SVector<f64, 3>>, Failure>> =
        AFTER.par_iter().map(|&eps| smoothed(reading, eps, &found)).collect();
    let columns = ["eps", "y", "z", "nearest_exit_time", "nearest_side", "distance", "width", "t_visit"]
        .map(|name| if name == "nearest_side" { Column::words(name) } else { Column::numbers(name) });
    let mut after = Table::new("after", columns);
    for (eps, exit) in AFTER.into_iter().zip(exits) {
        let Some(x) = exit? else { continue };
        let Some((time, to, distance)) = nearest(reading, &found, &x)? else { continue };
        let [y, z] = [x[1], x[2]];
        let mut row: Vec<Entry> = [eps, y, z, time].map(Entry::from).into();
        row.push(side(to).into());
        row.extend([distance, width, found.t_visit].map(Entry::from));
        after.push(row);
    }
    Ok(vec![before, members, after])
}

fn value(entry: &Entry) -> f64 {
    if let Entry::Number(v) = entry { *v } else { f64::NAN }
}

/// The line y proportional to x through the last point, over the points' range.
fn proportional(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let Some(&[x0, y0]) = points.last() else { return Vec::new() };
    points.iter().map(|p| [p[0], y0 * p[0] / x0]).collect()
}

/// An axis of distances with room for a legend below.
fn with_room(room: f64, distances: impl Iterator<Item = f64>) -> Axis {
    let mut axis = Axis::log_covering("distance", distances);
    axis.lower /= room;
    axis
}

fn draw(tables: &[Table]) -> Sheet {
    let [before, members, after] = tables else { unreachable!("compute makes three tables") };
    let (before, members, after) = (before.rows(), members.rows(), after.rows());
    let expected = LineStyle::new(style::SOFT_INK, style::CURVE_PT).dashed();

    let mut moments: Vec<f64> = Vec::new();
    for row in &before {
        if !moments.contains(&value(&row[1])) {
            moments.push(value(&row[1]));
        }
    }
    let mut approach = PlanePanel::new(
        Axis::log_covering("*ε*", before.iter().map(|r| value(&r[0]))),
        with_room(12.0, before.iter().map(|r| value(&r[3]))),
    );
    let mut rates = Vec::new();
    for (&t, (colour, shape)) in moments.iter().zip(LOOKS) {
        let rows: Vec<_> = before.iter().filter(|r| value(&r[1]) == t).collect();
        let points: Vec<[f64; 2]> = rows.iter().map(|r| [value(&r[0]), value(&r[3])]).collect();
        let marker = MarkerStyle { shape, colour, size: 4.0 };
        approach = approach.line(proportional(&points), expected).markers(points.clone(), marker);
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
        let rows = members.iter().filter(|r| r[1] == Entry::from(name));
        rows.map(|r| [value(&r[2]), value(&r[3])]).collect()
    };
    let exits: Vec<[f64; 2]> = after.iter().map(|r| [value(&r[1]), value(&r[2])]).collect();
    let all = || members.iter().map(|r| [value(&r[2]), value(&r[3])]).chain(exits.iter().copied());
    let (mut y, mut z) = (Axis::covering("*y*", all().map(|p| p[0])), Axis::covering("*z*", all().map(|p| p[1])));
    let (wide, high) = (y.upper - y.lower, z.upper - z.lower);
    let left = y.lower;
    (y.upper, z.lower) = (y.upper + 0.3 * wide, z.lower - 0.12 * high);
    let mut inside = PlanePanel::new(y, z);
    for (name, words, colour) in
        [("plus", "left to *x* > 0", style::BLUE), ("minus", "left to *x* < 0", style::VERMILLION)]
    {
        let marker = MarkerStyle { shape: MarkerShape::Dot, colour, size: 2.6 };
        inside = inside.markers(crossings(name), marker).legend(LegendKey::Marker(marker), words);
    }
    let ring = MarkerStyle { shape: MarkerShape::OpenDot, colour: style::INK, size: 5.0 };
    inside = inside.markers(exits.clone(), ring).legend(LegendKey::Marker(ring), "smoothed");
    for (row, &[y, z]) in after.iter().zip(&exits) {
        // To the right above the lowest branch, below on it, but not across the frame.
        let mut places = members.iter().map(|r| [value(&r[2]), value(&r[3])]);
        let lowest = !places.any(|m| (m[0] - y).abs() < 0.08 * wide && m[1] < z - 0.06 * high);
        let text = number(value(&row[0]));
        inside = if lowest && y > left + 0.2 * wide {
            inside.note([y, z - 0.03 * high], text, Anchor::Below)
        } else {
            inside.note([y + 0.07 * wide, z + 0.02 * high], text, Anchor::Left)
        };
    }

    let distances: Vec<[f64; 2]> = after.iter().map(|r| [value(&r[0]), value(&r[5])]).collect();
    let widths: Vec<[f64; 2]> = after.iter().map(|r| [value(&r[0]), value(&r[6])]).collect();
    let near = MarkerStyle { shape: MarkerShape::Dot, colour: style::INK, size: 4.0 };
    let whole = LineStyle::new(style::GREEN, style::CURVE_PT);
    let last = PlanePanel::new(
        Axis::log_covering("*ε*", distances.iter().map(|p| p[0])),
        with_room(10.0, distances.iter().chain(&widths).map(|p| p[1])),
    )
    .line(widths, whole)
    .markers(distances.clone(), near)
    .legend(LegendKey::Line(whole), "width of the funnel")
    .legend(LegendKey::Marker(near), "to its nearest member")
    .legend_at(Corner::LowerRight);

    let visit = after.first().map_or(f64::NAN, |r| value(&r[7]));
    let nearest: Vec<String> = after
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
        .legend(LegendEntry::new(LegendKey::Line(expected), "(a) distance proportional to *ε*, through the point of the smallest *ε*"))
        .footer(format!(
            "(a) Distance of the smoothed orbit from the Filippov orbit, whose first visit to the singularity is at *t* = {visit:.3}. \
             Measured powers of *ε*, least squares: {}.",
            rates.join(", ")
        ))
        .footer(format!(
            "(b) Where the Filippov orbits that leave the singularity after a time of repelling sliding of {} … {} first cross upwards \
             farther than {} from it, and where smoothed orbits do (labels: *ε*), followed in double-double arithmetic.",
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

fn study(reading: Reading, compute: fn() -> Result<Vec<Table>, JobError>) -> Vec<AnyQuestion> {
    vec![Arc::new(Computed { kind: "convergence", question: question(reading), cost: 4.0e5, compute })]
}

/// The figure's specification.
pub fn figure() -> Figure {
    Figure::studied_in_both_readings(
        "convergence",
        "Smoothed orbits and the Filippov motion as the switch steepens",
        "(a) Distance between smoothed orbit and Filippov orbit at four times before the first visit to the singularity, \
                  against ε, with lines proportional to ε. (b) After the visit the Filippov motion is a set: where its members next cross \
                  the surface x = 0 far from the singularity, and where smoothed orbits cross it, in the plane of y and z. (c) Distance of \
                  each smoothed crossing to the nearest member, beside the width of the set.",
        [
            Study {
                questions: || study(Reading::Printed, || compute(Reading::Printed)),
                draw: |answers| draw(&Study::tables(answers)),
            },
            Study {
                questions: || study(Reading::Reconstructed, || compute(Reading::Reconstructed)),
                draw: |answers| draw(&Study::tables(answers)),
            },
        ],
    )
}
