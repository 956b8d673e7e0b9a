//! The limit of a stiff switch: smoothed orbits beside the Filippov motion. Not a figure of the
//! paper; it checks the paper's premise that smoothing is harmless away from the singularity, and
//! that it decides nothing there.

use std::sync::Arc;

use crate::reading::{Reading, studied_in_both_readings};
use twofold::analyse::limit::{AfterVisitQuestion, ConvergenceQuestion, observed_rate};
use twofold::integrate::filippov::{FilippovOptions, FunnelGrid};
use twofold::job::table::{Entry, Table};
use twofold::job::{AfterVisit, AnyQuestion, SmoothingLimit};
use twofold::num::elementary::{exp10, log10};
use twofold::paper::wording::number;
use twofold::paper::{Figure, Study};
use twofold::render::sheet::*;
use twofold::render::style;
use twofold::system::System;

/// The start of the paper's runs.
const START: [f64; 3] = [0.2, 0.0, -1.0];
/// Stiffness parameters before the visit.
const BEFORE: [f64; 6] = [1.6e-2, 8e-3, 4e-3, 2e-3, 1e-3, 5e-4];
/// Stiffness parameters after the visit: from 1e-2 down, so many a decade, over so many decades:
/// two periods of the far exit.
const PER_DECADE: usize = 10;
/// See [`PER_DECADE`].
const DECADES: usize = 3;
/// Exits are compared where they cross the surface x = 0 farther than this from the singularity.
const BEYOND: f64 = 0.6;
/// The crossing comes before this time.
const T_END: f64 = 80.0;
/// The futures that are looked at.
const GRID: FunnelGrid = FunnelGrid {
    shortest: 1e-3,
    longest: 2.5,
    times: 80,
    horizon: 12.0,
    until_two_fold: true,
    per_step: 1,
};
/// Finer grids in the search for the nearest member.
const REFINEMENTS: usize = 3;
/// Exit times of each.
const FINER: usize = 21;
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

fn before_question(reading: Reading) -> ConvergenceQuestion {
    ConvergenceQuestion {
        start: START.into(),
        times: times(reading).into(),
        eps: BEFORE.into(),
        settings: FilippovOptions::default(),
    }
}

fn after_question() -> AfterVisitQuestion {
    AfterVisitQuestion {
        start: START.into(),
        t_end: T_END,
        eps: (0..=PER_DECADE * DECADES)
            .map(|k| exp10(-2.0 - k as f64 / PER_DECADE as f64))
            .collect(),
        beyond: BEYOND,
        grid: GRID,
        refinements: REFINEMENTS,
        finer: FINER,
        settings: FilippovOptions::default(),
    }
}

/// Questions of the figure: before the visit, after it.
fn questions(reading: Reading) -> Vec<AnyQuestion> {
    let system = System::from(reading.caricature());
    vec![
        Arc::new(SmoothingLimit { system: system.clone(), compared: before_question(reading) }),
        Arc::new(AfterVisit { system, compared: after_question() }),
    ]
}

fn value(entry: &Entry) -> f64 {
    if let Entry::Number(v) = entry { *v } else { f64::NAN }
}

/// The line y proportional to x through the last point, over the points' range.
fn proportional(points: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let Some(&[x0, y0]) = points.last() else { return Vec::new() };
    points.iter().map(|p| [p[0], y0 * p[0] / x0]).collect()
}

fn draw(tables: &[Table]) -> Sheet {
    let [before, members, after] = tables else {
        unreachable!("the two questions have three tables")
    };
    let (before, members, after) = (before.rows(), members.rows(), after.rows());
    let expected = LineStyle::new(style::SOFT_INK, style::CURVE_PT).dashed();
    let (approach, legend, rates) = approach(&before, expected);
    let distances: Vec<[f64; 2]> = after.iter().map(|r| [value(&r[0]), value(&r[5])]).collect();
    let visit = after.first().map_or(f64::NAN, |r| value(&r[7]));
    legend
        .into_iter()
        .fold(Sheet::new(ColumnWidth::Wide, 1, ""), Sheet::legend)
        .panel_aspect(0.42)
        .panel("(a)", "before the visit", approach)
        .panel("(b)", "crossings of *x* = 0 after it", crossings(&members, &after))
        .panel("(c)", "distance to the nearest Filippov orbit", nearest_member(&after, &distances))
        .footer(format!(
            "(a) Distance of the smoothed orbit from the Filippov orbit, which first visits the \
             singularity at *t* = {visit:.3}. Powers of *ε*, least squares: {}.",
            rates.join(", ")
        ))
        .footer(format!(
            "(b) First upward crossings beyond {} of the Filippov orbits that leave the \
             singularity after repelling sliding for {} … {}, and of smoothed orbits, {PER_DECADE} \
             values of *ε* a decade (filled: whole decades). They wander along the funnel and jump \
             back, periodically in ln *ε* (figure law).",
            number(BEYOND),
            number(GRID.shortest),
            number(GRID.longest),
        ))
        .footer(format!("(c) Power of *ε*, least squares: {:.2}.", observed_rate(distances)))
}

/// Distances before the visit, what the marks mean, and the measured powers of eps in words.
fn approach(
    before: &[Vec<Entry>],
    expected: LineStyle,
) -> (PlanePanel, Vec<LegendEntry>, Vec<String>) {
    let mut moments: Vec<f64> = Vec::new();
    for row in before {
        if !moments.contains(&value(&row[1])) {
            moments.push(value(&row[1]));
        }
    }
    let mut panel = PlanePanel::new(
        Axis::log_covering("*ε*", before.iter().map(|r| value(&r[0]))),
        Axis::log_covering("distance", before.iter().map(|r| value(&r[3]))),
    );
    let (mut legend, mut rates) = (Vec::new(), Vec::new());
    for (&t, (colour, shape)) in moments.iter().zip(LOOKS) {
        let rows: Vec<_> = before.iter().filter(|r| value(&r[1]) == t).collect();
        let points: Vec<[f64; 2]> = rows.iter().map(|r| [value(&r[0]), value(&r[3])]).collect();
        let marker = MarkerStyle { shape, colour, size: 4.0 };
        panel = panel.line(proportional(&points), expected).markers(points.clone(), marker);
        let mode =
            if rows.iter().all(|r| r[2] == Entry::from("sliding")) { "sliding" } else { "free" };
        let words = format!("(a) *t* = {}, {mode}", number(t));
        legend.push(LegendEntry::new(LegendKey::Marker(marker), words));
        rates.push(format!("{:.3} at *t* = {}", observed_rate(points), number(t)));
    }
    let words = "(a) proportional to *ε*, through the point of the smallest *ε*";
    legend.push(LegendEntry::new(LegendKey::Line(expected), words));
    (panel, legend, rates)
}

/// Crossings of members of the funnel and of smoothed orbits after the visit.
fn crossings(members: &[Vec<Entry>], after: &[Vec<Entry>]) -> PlanePanel {
    let of = |name: &'static str| -> Vec<[f64; 2]> {
        let rows = members.iter().filter(|r| r[1] == Entry::from(name));
        rows.map(|r| [value(&r[2]), value(&r[3])]).collect()
    };
    let exits: Vec<[f64; 2]> = after.iter().map(|r| [value(&r[1]), value(&r[2])]).collect();
    let all = || members.iter().map(|r| [value(&r[2]), value(&r[3])]).chain(exits.iter().copied());
    let (mut y, mut z) =
        (Axis::covering("*y*", all().map(|p| p[0])), Axis::covering("*z*", all().map(|p| p[1])));
    let (wide, high) = (y.upper - y.lower, z.upper - z.lower);
    let left = y.lower;
    (y.upper, z.lower, z.upper) =
        (y.upper + 0.08 * wide, z.lower - 0.12 * high, z.upper + 0.08 * high);
    let mut panel = PlanePanel::new(y, z);
    for (name, words, colour) in
        [("plus", "left to *x* > 0", style::BLUE), ("minus", "left to *x* < 0", style::VERMILLION)]
    {
        let marker = MarkerStyle { shape: MarkerShape::Dot, colour, size: 2.6 };
        panel = panel.markers(of(name), marker).legend(LegendKey::Marker(marker), words);
    }
    let ring = MarkerStyle { shape: MarkerShape::OpenDot, colour: style::INK, size: 4.0 };
    panel = panel.markers(exits.clone(), ring).legend(LegendKey::Marker(ring), "smoothed");
    let disc = MarkerStyle { shape: MarkerShape::Dot, ..ring };
    for (row, &[y, z]) in after.iter().zip(&exits).step_by(PER_DECADE) {
        // Above, below on the lowest branch, but not across the frame.
        let mut places = members.iter().map(|r| [value(&r[2]), value(&r[3])]);
        let lowest = !places.any(|m| (m[0] - y).abs() < 0.08 * wide && m[1] < z - 0.06 * high);
        let text = format!("10^{{{}}}", log10(value(&row[0])).round());
        panel = panel.markers(vec![[y, z]], disc);
        panel = if lowest && y > left + 0.2 * wide {
            panel.note([y, z - 0.03 * high], text, Anchor::Below)
        } else {
            panel.note([y + 0.03 * wide, z + 0.02 * high], text, Anchor::Above)
        };
    }
    panel
}

/// Distances to the nearest member, beside the funnel's width.
fn nearest_member(after: &[Vec<Entry>], distances: &[[f64; 2]]) -> PlanePanel {
    let widths: Vec<[f64; 2]> = after.iter().map(|r| [value(&r[0]), value(&r[6])]).collect();
    let near = MarkerStyle { shape: MarkerShape::Dot, colour: style::INK, size: 4.0 };
    let whole = LineStyle::new(style::GREEN, style::CURVE_PT);
    let shown = || distances.iter().chain(&widths);
    let x = Axis::log_covering("*ε*", shown().map(|p| p[0]));
    let y = Axis::log_covering("distance", shown().map(|p| p[1]));
    let panel = PlanePanel::new(x, y).line(widths.clone(), whole).markers(distances.to_vec(), near);
    match widths.first() {
        Some(&[eps, width]) => {
            panel.note([eps, 0.35 * width], "width of the funnel", Anchor::Right)
        }
        None => panel,
    }
}

/// The figure's specification.
pub fn figure() -> Figure {
    studied_in_both_readings(
        "convergence",
        "Smoothed and Filippov motion as the switch steepens",
        "(a) Distance between smoothed orbit and Filippov orbit at four times before the first \
            visit to the singularity, \
                  against ε, with lines proportional to ε. (b) After the visit the Filippov motion \
                  is a set: where its members next cross \
                  the surface x = 0 far from the singularity, and where smoothed orbits cross it, \
                  in the plane of y and z. (c) Distance of \
                  each smoothed crossing to the nearest member, beside the width of the set.",
        [
            Study {
                questions: || questions(Reading::Printed),
                draw: |answers| draw(&Study::tables(answers)),
            },
            Study {
                questions: || questions(Reading::Reconstructed),
                draw: |answers| draw(&Study::tables(answers)),
            },
        ],
    )
}
