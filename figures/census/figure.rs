//! The census: what a panel of figs 7 and 8 shows is drawn from a lottery, and these are the odds. Not a figure of the paper. Its data are committed
//! beside it and made by `make census`; the rules were fixed before (src/paper/claims.toml).

use std::sync::Arc;

use twofold::job::sweep::Rows;
use twofold::job::table::Table;
use twofold::job::{AnyQuestion, JobError};
use twofold::paper::census::{self, Data, Found, Kind};
use twofold::paper::claims::claims;
use twofold::paper::study::Computed;
use twofold::paper::{Figure, Reading, Study};
use twofold::record::Hash;
use twofold::render::sheet::*;
use twofold::render::style;

/// Figs 7 and 8: LSODA at NDSolve's defaults, starts shifted within 1e-9.
const FIG7: &[u8] = include_bytes!("fig7.parquet");
const FIG8: &[u8] = include_bytes!("fig8.parquet");
/// Fig. 7(iii) by other methods, and by Dormand-Prince at other tolerances, reconstructed reading.
const METHODS: &[u8] = include_bytes!("methods.parquet");
const TOLERANCES: &[u8] = include_bytes!("tolerances.parquet");

/// Colours of the kinds, in the order of `Kind::ALL`.
const COLOURS: [Colour; 6] = [style::BLUE, style::GREEN, style::SKY, style::VERMILLION, style::INK, style::FAINT];

fn table_of(bytes: &[u8]) -> Result<Table, JobError> {
    Rows::from_parquet(bytes).map(|rows| rows.table()).map_err(|e| JobError::Other(format!("the census' data: {e}")))
}

fn question(reading: Reading) -> AnyQuestion {
    let data = [FIG7, FIG8, METHODS, TOLERANCES].map(Hash::of);
    Arc::new(Computed {
        kind: "census",
        question: serde_json::json!({ "reading": reading, "data": data, "rules": claims().rules }),
        cost: 1.0,
        compute: match reading {
            Reading::Printed => || tables(Reading::Printed),
            Reading::Reconstructed => || tables(Reading::Reconstructed),
        },
    })
}

/// What the committed data say in a reading.
///
/// # Errors
///
/// If they are not the files that `make census` writes.
pub fn found(reading: Reading) -> Result<Found, JobError> {
    let data = Data {
        fig7: table_of(FIG7)?,
        fig8: table_of(FIG8)?,
        methods: table_of(METHODS)?,
        tolerances: table_of(TOLERANCES)?,
    };
    Ok(Found::of(reading, &data, &claims().rules))
}

fn tables(reading: Reading) -> Result<Vec<Table>, JobError> {
    Ok(found(reading)?.tables())
}

/// Columns of counts as stacked bars with a name above each.
fn bars(names: &[String], counts: &[Vec<f64>], below: &[Vec<String>]) -> PlanePanel {
    let n = names.len() as f64;
    let mut panel = PlanePanel::new(Axis::linear("", -0.75, n + 0.15), Axis::linear("", -0.24, 1.16));
    panel.axes = false;
    for percent in [0.0, 50.0, 100.0] {
        let y = percent / 100.0;
        panel = panel.line(vec![[-0.08, y], [n, y]], LineStyle::new(style::GRID, 0.6)).note(
            [-0.12, y],
            format!("{percent} %"),
            Anchor::Right,
        );
    }
    for (i, row) in counts.iter().enumerate() {
        let total: f64 = row.iter().sum();
        let (left, right) = (i as f64 + 0.12, i as f64 + 0.88);
        let mut low = 0.0;
        for (count, colour) in row.iter().zip(COLOURS).filter(|(count, _)| **count > 0.0) {
            let high = low + count / total.max(1.0);
            panel = panel.solid(vec![[left, low], [right, low], [right, high], [left, high]], colour);
            low = high;
        }
        let middle = i as f64 + 0.5;
        panel = panel.note([middle, 1.02], names[i].clone(), Anchor::Above);
        for (line, text) in below.get(i).into_iter().flatten().enumerate() {
            panel = panel.note([middle, -0.02 - 0.1 * line as f64], text.clone(), Anchor::Below);
        }
    }
    panel
}

fn draw(tables: &[Table]) -> Sheet {
    let [shares, found, curves, ways] = tables else { unreachable!("the census has four tables") };
    let count = |table: &Table, row: usize, suffix: &str| -> Vec<f64> {
        Kind::ALL.map(|k| table.integers(&format!("{}{suffix}", k.words().replace(' ', "_")))[row] as f64).to_vec()
    };
    let names: Vec<String> = shares.words("panel").map(str::to_owned).collect();
    let at_end: Vec<Vec<f64>> = (0..shares.len()).map(|row| count(shares, row, "_at_end")).collect();
    let percent = |v: f64| format!("{:.0}", 100.0 * v);
    let claimed: Vec<Vec<String>> = (0..shares.len())
        .map(|row| {
            let [p, low, high] = ["share", "low", "high"].map(|c| shares.numbers(c)[row]);
            vec![format!("{} %", percent(p)), format!("[{}, {}]", percent(low), percent(high))]
        })
        .collect();
    let mut capture = PlanePanel::new(Axis::log("*t*", 3.0, 2e5), Axis::linear("share captured", 0.0, 1.0));
    for (i, name) in names.iter().enumerate() {
        let mut points = vec![[3.0, 0.0]];
        let mut last = 0.0;
        for row in (0..curves.len()).filter(|row| curves.words("panel").nth(*row) == Some(name)) {
            let (t, share) = (curves.numbers("t")[row], curves.numbers("share")[row]);
            points.extend([[t.max(3.0), last], [t.max(3.0), share]]);
            last = share;
        }
        points.push([2e5, last]);
        let line = LineStyle::new(style::SERIES[i], style::CURVE_PT);
        capture = capture
            .line(points, if i < 3 { line } else { line.dashed() })
            .legend(LegendKey::Line(if i < 3 { line } else { line.dashed() }), name.clone());
    }
    capture = capture.legend_at(Corner::UpperLeft);
    let ways_names: Vec<String> = ways.words("group").map(str::to_owned).collect();
    let ways_counts: Vec<Vec<f64>> = (0..ways.len()).map(|row| count(ways, row, "")).collect();
    let ways_totals: Vec<Vec<String>> =
        ways_counts.iter().map(|c| vec![format!("{:.0}", c.iter().sum::<f64>()), "runs".to_owned()]).collect();
    let value = |what: &str, column: &str| {
        let row = found.words("what").position(|w| w == what);
        row.map_or(f64::NAN, |r| found.numbers(column)[r])
    };
    let p = |what: &str| census::p_in_words(value(what, "p_permutation"));
    let together = |what: &str| {
        let [mean, low, high] = ["value", "low", "high"].map(|c| value(what, c));
        format!("{} % [{}, {}]", percent(mean), percent(low), percent(high))
    };
    let runs: Vec<i64> = shares.integers("runs").to_vec();
    let mut sheet = Sheet::new(ColumnWidth::Double, 2, "")
        .panel_aspect(0.62)
        .panel("(a)", "where runs of each panel end", bars(&names, &at_end, &claimed))
        .panel("(b)", "captured by a closed orbit", capture)
        .panel("(c)", "interval 100, by method and tolerance", bars(&ways_names, &ways_counts, &ways_totals))
        .panel("", "", Content::Blank);
    for (kind, colour) in Kind::ALL.into_iter().zip(COLOURS) {
        sheet = sheet.legend(LegendEntry::new(LegendKey::Area(colour, 100), kind.words()));
    }
    sheet
        .footer(format!(
            "Runs to *t* = 200000 from starts shifted by less than 10^{{-9}}, LSODA at NDSolve's defaults, {} to {} a panel. Below each bar of (a): share of runs \
             that bear out what the paper says of the panel, with its 95 % interval (Wilson).",
            runs.iter().min().copied().unwrap_or(0),
            runs.iter().max().copied().unwrap_or(0)
        ))
        .footer(format!(
            "Tests for the same odds (permutation): intervals 20, 40, 100 {}; *σ* {}; all six panels {}; methods {}; tolerances {}.",
            p("intervals 20, 40, 100"),
            p("sigma 0.01, 0.1, 0.13"),
            p("all six panels"),
            p("methods"),
            p("tolerances"),
        ))
        .footer(format!(
            "Three independent runs: fig. 7 all as claimed {}, not all the same {}; fig. 8 all as claimed {}, not all the same {}.",
            together("fig. 7: all as claimed"),
            together("fig. 7: not all the same"),
            together("fig. 8: all as claimed"),
            together("fig. 8: not all the same"),
        ))
}

/// The figure's specification.
pub fn figure() -> Figure {
    Figure::studied_in_both_readings(
        "census",
        "The odds of each outcome of figs 7 and 8",
        "(a) Where runs of each panel of figs 7 and 8 end, of many starts that differ by less than 1e-9, and the share that bears out what the \
         paper says of the panel. (b) Share of runs that a closed orbit has captured by time t. (c) The same as (a) for fig. 7(iii) by other \
         methods and tolerances.",
        [
            Study { questions: || vec![question(Reading::Printed)], draw: |answers| draw(&Study::tables(answers)) },
            Study {
                questions: || vec![question(Reading::Reconstructed)],
                draw: |answers| draw(&Study::tables(answers)),
            },
        ],
    )
}
