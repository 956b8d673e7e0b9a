//! Error against work: ODEPACK's LSODA, as frozen in workprecision/odepack, and this
//! crate's methods. Not a figure of the paper; it says how far the methods behind the other figures
//! can be trusted where the answer is known.

#[allow(dead_code)] // what the frozen file says beyond this picture is for tests/it/odepack.rs
mod data;
#[allow(dead_code)]
mod problems;

use std::sync::Arc;

use crate::computed::Computed;
use serde_json::{Value, json};
use twofold::job::table::{Column, Entry, Table};
use twofold::job::{AnyQuestion, JobError};
use twofold::num::elementary::{exp10, log10};
use twofold::paper::wording::number;
use twofold::paper::{Figure, Picture, Study, View};
use twofold::record::Hash;
use twofold::render::sheet::*;
use twofold::render::style;

/// Panels: the problem's name in the tables, and its heading. Van der Pol's equation with mu = 1 is
/// in the tables only.
const PANELS: [(&str, &str); 9] = [
    ("lorenz", "Lorenz"),
    ("robertson", "Robertson"),
    ("van-der-pol-1000", "van der Pol, *μ* = 1000"),
    ("oregonator", "Oregonator"),
    ("hires", "HIRES"),
    ("smoothed-printed", "smoothed, printed"),
    ("smoothed-reconstructed", "smoothed, reconstructed"),
    ("hysteretic-printed", "hysteretic, printed"),
    ("hysteretic-reconstructed", "hysteretic, reconstructed"),
];

/// Methods: the name in the tables, in the legend, and its look, from bottom to top. ODEPACK's wide
/// rings lie under our small dots, so that both are seen where they coincide.
const METHODS: [(&str, &str, MarkerShape, Colour, f64); 4] = [
    ("dopri5", "dopri5", MarkerShape::Square, style::GREEN, 3.6),
    ("radau5", "radau5", MarkerShape::Triangle, style::VERMILLION, 4.4),
    ("odepack-lsoda", "LSODA of ODEPACK", MarkerShape::OpenDot, style::INK, 6.4),
    ("lsoda", "our lsoda", MarkerShape::Dot, style::BLUE, 3.4),
];

fn question() -> Value {
    let odepack = include_str!("odepack/reference.json");
    json!({
        "study": "work-precision",
        "odepack_sha256": Hash::of(odepack.as_bytes()).as_str(),
        "methods": METHODS.map(|m| m.0),
        "most_steps": data::MOST_STEPS,
    })
}

fn compute() -> Result<Vec<Table>, JobError> {
    let columns = ["problem", "method", "rtol", "error", "evaluations", "jacobians", "steps"];
    let mut runs = Table::new(
        "runs",
        columns.map(|c| {
            if matches!(c, "problem" | "method") { Column::words(c) } else { Column::numbers(c) }
        }),
    );
    for row in data::rows() {
        runs.push(vec![
            row.problem.as_str().into(),
            row.method.into(),
            row.tolerance.into(),
            row.error.into(),
            (row.evaluations as f64).into(),
            (row.jacobians as f64).into(),
            (row.steps as f64).into(),
        ]);
    }
    let mut known =
        Table::new("references", [Column::words("problem"), Column::numbers("uncertainty")]);
    for problem in data::reference().problems {
        known.push(vec![problem.name.as_str().into(), problem.uncertainty().into()]);
    }
    Ok(vec![runs, known])
}

/// A run of the table: (problem, method, [rtol, error, evaluations, jacobians, steps]).
fn run(row: &[Entry]) -> (&str, &str, [f64; 5]) {
    let word = |i: usize| if let Entry::Word(w) = &row[i] { w.as_str() } else { "" };
    let value = |i: usize| if let Entry::Number(v) = row[i] { v } else { f64::NAN };
    (word(0), word(1), std::array::from_fn(|i| value(i + 2)))
}

/// An axis that covers these values and three powers of ten, so that its labels are powers of ten.
fn decades(title: &str, values: impl Iterator<Item = f64>) -> Axis {
    let mut axis = Axis::log_covering(title, values);
    let (mut first, mut last) = (log10(axis.lower).ceil(), log10(axis.upper).floor());
    while last - first < 2.0 {
        // The nearer power outside.
        let (down, up) = (exp10(first - 1.0), exp10(last + 1.0));
        if axis.lower / down < up / axis.upper {
            (axis.lower, first) = (down, first - 1.0);
        } else {
            (axis.upper, last) = (up, last + 1.0);
        }
    }
    axis
}

/// Panels side by side.
const COLUMNS: usize = 2;

fn draw(tables: &[Table]) -> Sheet {
    let rows = tables[0].rows();
    let runs: Vec<_> = rows.iter().map(|row| run(row)).collect();
    let mut sheet = Sheet::new(ColumnWidth::Wide, COLUMNS, "").panel_aspect(0.66);
    for (i, (problem, heading)) in PANELS.iter().enumerate() {
        let here: Vec<_> = runs.iter().filter(|r| r.0 == *problem).collect();
        let x = if i + COLUMNS >= PANELS.len() { "evaluations of *f*" } else { "" };
        let y = if i % COLUMNS == 0 { "error at the end" } else { "" };
        let x = decades(x, here.iter().map(|r| r.2[2]));
        let y = Axis::log_covering(y, here.iter().map(|r| r.2[1]));
        let (left, right) = (x.lower, x.upper);
        let mut chart = PlanePanel::new(x, y);
        if let Some([_, Entry::Number(limit)]) =
            tables[1].rows().iter().find(|r| r[0] == Entry::from(*problem)).map(Vec::as_slice)
        {
            chart = chart.line(
                vec![[left, *limit], [right, *limit]],
                LineStyle::new(style::SOFT_INK, style::FRAME_PT).dotted(),
            );
        }
        for (method, _, shape, colour, size) in METHODS {
            let points: Vec<[f64; 2]> =
                here.iter().filter(|r| r.1 == method).map(|r| [r.2[2], r.2[1]]).collect();
            if method != "odepack-lsoda" {
                chart = chart.line(points.clone(), LineStyle::new(colour, style::CURVE_PT));
            }
            chart = chart.markers(points, MarkerStyle { shape, colour, size });
        }
        sheet = sheet.panel("", *heading, chart);
    }
    let mut legend = PlanePanel::sketch((0.0, 1.0), (0.0, 0.66)).legend_at(Corner::UpperLeft);
    for (_, words, shape, colour, size) in METHODS.into_iter().rev() {
        legend = legend.legend(LegendKey::Marker(MarkerStyle { shape, colour, size }), words);
    }
    let limit = LineStyle::new(style::SOFT_INK, style::FRAME_PT).dotted();
    sheet = sheet.panel("", "", legend.legend(LegendKey::Line(limit), "uncertainty"));
    footer(&runs).into_iter().fold(sheet, Sheet::footer)
}

/// Statements about the tables, in words.
fn footer(runs: &[(&str, &str, [f64; 5])]) -> Vec<String> {
    let of = |method: &'static str| runs.iter().filter(move |r| r.1 == method);
    let pairs: Vec<_> = of("odepack-lsoda")
        .filter_map(|theirs| {
            of("lsoda")
                .find(|o| o.0 == theirs.0 && o.2[0] == theirs.2[0])
                .map(|ours| (theirs, ours))
        })
        .collect();
    let same = pairs.iter().filter(|(a, b)| a.2[2..] == b.2[2..]).count();
    let most = pairs.iter().map(|(a, b)| (b.2[2] / a.2[2] - 1.0).abs()).fold(0.0, f64::max);
    let mut absent: Vec<&str> = Vec::new();
    for (problem, _, _) in of("odepack-lsoda") {
        let heading = PANELS.iter().find(|p| p.0 == *problem).map_or(*problem, |p| p.1);
        if !absent.contains(&heading) && !of("dopri5").any(|r| r.0 == *problem) {
            absent.push(heading);
        }
    }
    vec![
        "Error: largest of |*x*_{i} − *r*_{i}|/(|*r*_{i}| + atol/rtol) at the end of the run, *r* \
            a solution computed to the dotted \
         uncertainty; nothing is resolved below it. Each marker is one tolerance. Evaluations of \
         the Jacobian are not counted."
            .into(),
        format!(
            "ODEPACK’s LSODA and ours take the same numbers of steps, evaluations and Jacobians in \
                {same} of {} runs (with van der \
             Pol at *μ* = 1, which is not drawn); in the others the evaluations differ by up to \
             {:.1} %.",
            pairs.len(),
            100.0 * most,
        ),
        if absent.is_empty() {
            "Every method finishes every problem.".into()
        } else {
            format!(
                "dopri5 does not finish within {} steps, at any tolerance: {}.",
                number(data::MOST_STEPS as f64),
                absent.join("; ")
            )
        },
    ]
}

fn questions() -> Vec<AnyQuestion> {
    vec![Arc::new(Computed { kind: "work-precision", question: question(), cost: 2e5, compute })]
}

/// The figure's specification.
pub fn figure() -> Figure {
    Figure {
        id: "workprecision".into(),
        title: "Error against work, beside ODEPACK".into(),
        pictures: vec![Picture {
            name: "workprecision".into(),
            reading: None,
            title: "Error against work, beside ODEPACK".into(),
            caption: "Error at the end of the run against the number of evaluations of the \
                right-hand side, for nine initial value \
                      problems: ODEPACK’s LSODA (rings, from a file made once with the original \
                      Fortran), our LSODA (dots), Radau IIA \
                      of order 5 (triangles) and Dormand-Prince 5(4) (squares). Logarithmic axes, \
                      one marker per tolerance. The four \
                      problems named smoothed and hysteretic are the paper's equations, in both \
                      readings of its parameters, from its start to \
                      t = 10."
                .into(),
            view: View::Study(Study { questions, draw: |answers| draw(&Study::tables(answers)) }),
            panels: Vec::new(),
            alterations: Vec::new(),
        }],
    }
}
