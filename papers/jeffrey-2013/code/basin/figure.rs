//! The basin: where runs from starts on the plane y = 0 are after some time. Not a figure of the
//! paper. Its data are committed beside it and made by `make census`.

use std::sync::Arc;

use crate::computed::Computed;
use crate::reading::{Reading, studied_in_both_readings};
use crate::study::census::{self, MotionKind};
use twofold::job::sweep::Rows;
use twofold::job::table::{Column, Entry, Table};
use twofold::job::{AnyQuestion, JobError};
use twofold::paper::wording::number;
use twofold::paper::{Figure, Study};
use twofold::record::Hash;
use twofold::render::sheet::*;
use twofold::render::style;

/// Starts on a square of the plane y = 0, followed to the same time.
const PRINTED: &[u8] = include_bytes!("printed.csv");
const RECONSTRUCTED: &[u8] = include_bytes!("reconstructed.csv");

/// Both, under the files' names.
pub const DATA: &[(&str, &[u8])] =
    &[("printed.csv", PRINTED), ("reconstructed.csv", RECONSTRUCTED)];

/// Colours of the kinds, in the order of `MotionKind::ALL`. Undecided cells bear a cross, so that
/// no two kinds differ by hue alone.
const COLOURS: [Colour; 6] =
    [style::BLUE, style::GREEN, style::SKY, style::VERMILLION, style::CROSSING, style::WHITE];
/// Mark of an undecided cell.
const CROSS: MarkerStyle = MarkerStyle { shape: MarkerShape::Cross, colour: style::INK, size: 5.0 };

fn data(reading: Reading) -> &'static [u8] {
    match reading {
        Reading::Printed => PRINTED,
        Reading::Reconstructed => RECONSTRUCTED,
    }
}

fn tables(reading: Reading) -> Result<Vec<Table>, JobError> {
    let rows = Rows::from_csv(data(reading))
        .map_err(|e| JobError::Other(format!("the basin's data: {e}")))?;
    let end = rows.sweep().t_end();
    let table = rows.table();
    let mut found = Table::new(
        "basin",
        [Column::numbers("x"), Column::numbers("z"), Column::words("kind"), Column::numbers("t")],
    );
    let runs = census::runs(&table, &[]);
    for ((x, z), run) in table.numbers("start.x").iter().zip(table.numbers("start.z")).zip(&runs) {
        found.push([
            Entry::Number(*x),
            Entry::Number(*z),
            run.kind(end).words().into(),
            Entry::Number(end),
        ]);
    }
    Ok(vec![found])
}

fn question(reading: Reading) -> AnyQuestion {
    Arc::new(Computed {
        kind: "basin",
        question: serde_json::json!({ "reading": reading, "data": Hash::of(data(reading)) }),
        cost: 1.0,
        compute: match reading {
            Reading::Printed => || tables(Reading::Printed),
            Reading::Reconstructed => || tables(Reading::Reconstructed),
        },
    })
}

fn draw(tables: &[Table]) -> Sheet {
    let [basin] = tables else { unreachable!("the basin has one table") };
    let (x, z) = (basin.numbers("x"), basin.numbers("z"));
    let step = |values: &[f64]| {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup();
        sorted.windows(2).map(|w| w[1] - w[0]).fold(f64::INFINITY, f64::min)
    };
    let (dx, dz) = (0.5 * step(x), 0.5 * step(z));
    let kind_of = |word: &str| MotionKind::ALL.into_iter().find(|k| k.words() == word);
    let kinds: Vec<MotionKind> =
        basin.words("kind").map(|w| kind_of(w).unwrap_or(MotionKind::Undecided)).collect();
    // The frame: a cell more than holds all that is not far.
    let ends = |v: &[f64], d: f64| {
        let near = kinds.iter().zip(v).filter(|(kind, _)| **kind != MotionKind::Far);
        let (a, b) = range_of(near.map(|(_, v)| *v));
        let (first, last) = range_of(v.iter().copied());
        ((a - 3.0 * d).max(first - d), (b + 3.0 * d).min(last + d))
    };
    let ((x0, x1), (z0, z1)) = (ends(x, dx), ends(z, dz));
    let mut map = PlanePanel::new(Axis::linear("*x*", x0, x1), Axis::linear("*z*", z0, z1)).equal();
    let mut counts = [0_u64; 6];
    let mut undecided = Vec::new();
    for ((kind, a), b) in kinds.iter().zip(x).zip(z) {
        let place = *kind as usize;
        counts[place] += 1;
        if *a < x0 || *a > x1 || *b < z0 || *b > z1 {
            continue;
        }
        if *kind == MotionKind::Undecided {
            undecided.push([*a, *b]);
        }
        // A little beyond its edge, under the next cell: between cells that only touch, paper
        // shines through.
        let (right, top) = (a + 1.08 * dx, b + 1.08 * dz);
        map = map.solid(
            vec![[a - dx, b - dz], [right, b - dz], [right, top], [a - dx, top]],
            COLOURS[place],
        );
    }
    let start = MarkerStyle { shape: MarkerShape::OpenDot, colour: style::INK, size: 4.5 };
    map = map.markers(undecided, CROSS).markers(vec![[0.2, -1.0]], start);
    let mut sheet = Sheet::new(ColumnWidth::Single, 1, "")
        .panel_aspect(1.0)
        .panel("", "starts on *y* = 0", map)
        .legend(LegendEntry::new(LegendKey::Marker(start), "the paper's start"));
    for kind in MotionKind::ALL.into_iter().filter(|kind| counts[*kind as usize] > 0) {
        let key = match kind {
            MotionKind::Undecided => LegendKey::Marker(CROSS),
            _ => LegendKey::Area(COLOURS[kind as usize], 100),
        };
        sheet = sheet.legend(LegendEntry::new(key, kind.words()));
    }
    let (_, widest) = range_of(x.iter().copied());
    let end = basin.numbers("t").first().copied().unwrap_or(0.0);
    let irregular = counts[MotionKind::Irregular as usize] > 0;
    sheet
        .footer(format!(
            "State at *t* = {} of {} runs from |*x*|, |*z*| ≤ {widest}, Dormand-Prince at \
             NDSolve's tolerance: {}. Outside the frame all are far.",
            number(end),
            basin.len(),
            census::in_words(&counts)
        ))
        .footer(format!(
            "Far: in a region around (0, *α*/*β*, *α*/*β*) that no orbit leaves.{}",
            if irregular { " Irregular runs may still be captured." } else { "" }
        ))
}

/// The figure's specification.
pub fn figure() -> Figure {
    studied_in_both_readings(
        "basin",
        "Where runs are after 10 000 units of time",
        "Starts on the plane y = 0, coloured by the state of the run at t = 10 000: captured by \
         the period-one orbit, by the period-three orbit, regular otherwise, still irregular, or \
         on the way to the far state.",
        [
            Study {
                questions: || vec![question(Reading::Printed)],
                draw: |answers| draw(&Study::tables(answers)),
            },
            Study {
                questions: || vec![question(Reading::Reconstructed)],
                draw: |answers| draw(&Study::tables(answers)),
            },
        ],
    )
}
