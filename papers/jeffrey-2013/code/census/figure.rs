//! The census: what a panel of figs 7 and 8 shows is drawn from a lottery, and these are the odds.
//! Not a figure of the paper. Its data are committed beside it and made by `make census`; the rules
//! were fixed before (papers/jeffrey-2013/sentences.toml).

use std::sync::Arc;

use crate::computed::Computed;
use crate::reading::{Reading, studied_in_both_readings};
use crate::study::census::{self, Data, Found, MotionKind, Shorter};
use crate::study::claims::claims;
use twofold::job::sweep::Rows;
use twofold::job::table::Table;
use twofold::job::{AnyQuestion, JobError};
use twofold::paper::{Figure, Study, Support};
use twofold::record::Hash;
use twofold::render::sheet::*;
use twofold::render::style;

/// The data: figs 7 and 8 by LSODA at NDSolve's defaults from starts shifted within 1e-9; fig.
/// 7(iii) by other methods and by Dormand-Prince at other tolerances; fig. 7(iii) to a shorter time
/// by LSODA, and by the layer-resolved Taylor method with local errors of 1e-15, and of 1e-20 in
/// double-double arithmetic.
pub const DATA: &[(&str, &[u8])] = &[
    ("fig7.csv", include_bytes!("fig7.csv")),
    ("fig8.csv", include_bytes!("fig8.csv")),
    ("methods-printed.csv", include_bytes!("methods-printed.csv")),
    ("methods.csv", include_bytes!("methods.csv")),
    ("tolerances-printed.csv", include_bytes!("tolerances-printed.csv")),
    ("tolerances.csv", include_bytes!("tolerances.csv")),
    ("tight-printed.csv", include_bytes!("tight-printed.csv")),
    ("tight.csv", include_bytes!("tight.csv")),
    ("ordinary-printed.csv", include_bytes!("ordinary-printed.csv")),
    ("ordinary-reconstructed.csv", include_bytes!("ordinary-reconstructed.csv")),
    ("taylor-printed.csv", include_bytes!("taylor-printed.csv")),
    ("taylor-reconstructed.csv", include_bytes!("taylor-reconstructed.csv")),
    ("extended-printed.csv", include_bytes!("extended-printed.csv")),
    ("extended-reconstructed.csv", include_bytes!("extended-reconstructed.csv")),
];

/// Files of the shorter runs, and how they were computed: in words, and in a picture.
const SHORTER: [(&str, &str, &str); 3] = [
    ("ordinary", "LSODA", "LSODA"),
    ("taylor", "Taylor 1e-15", "10^{-15}"),
    ("extended", "Taylor 1e-20, double-double", "10^{-20}"),
];

/// Colours of the kinds, in the order of `MotionKind::ALL`.
const COLOURS: [Colour; 6] =
    [style::BLUE, style::GREEN, style::SKY, style::VERMILLION, style::INK, style::FAINT];

fn rows_of(bytes: &[u8]) -> Result<Rows, JobError> {
    Rows::from_csv(bytes).map_err(|e| JobError::Other(format!("the census' data: {e}")))
}

/// The committed content of a file.
fn committed(name: &str) -> Result<Vec<u8>, JobError> {
    let found = DATA.iter().find(|(n, _)| *n == name).map(|(_, bytes)| bytes.to_vec());
    found.ok_or_else(|| JobError::Other(format!("the census has no {name}")))
}

fn question(reading: Reading) -> AnyQuestion {
    let data: Vec<Hash> = DATA.iter().map(|(_, bytes)| Hash::of(bytes)).collect();
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

/// Findings of the committed data in a reading.
///
/// # Errors
///
/// If they are not the files that `make census` writes.
pub fn found(reading: Reading) -> Result<Found, JobError> {
    found_in(reading, &committed)
}

/// Findings, in a reading, of the files that `read` gives for the names in [`DATA`].
///
/// # Errors
///
/// If they are not such as `make census` writes, or `read` fails.
pub fn found_in(
    reading: Reading,
    read: &dyn Fn(&str) -> Result<Vec<u8>, JobError>,
) -> Result<Found, JobError> {
    let table = |name: &str| rows_of(&read(name)?).map(|rows| rows.table());
    let tables =
        |names: &[&str]| names.iter().map(|name| table(name)).collect::<Result<Vec<_>, _>>();
    let mut shorter = Vec::new();
    for (file, name, _) in SHORTER {
        for reading in Reading::ALL {
            let rows = rows_of(&read(&format!("{file}-{}.csv", reading.word()))?)?;
            shorter.push(Shorter { name, end: rows.sweep().t_end(), table: rows.table() });
        }
    }
    let data = Data {
        fig7: table("fig7.csv")?,
        fig8: table("fig8.csv")?,
        methods: tables(&["methods-printed.csv", "methods.csv"])?,
        tolerances: tables(&[
            "tolerances-printed.csv",
            "tolerances.csv",
            "tight-printed.csv",
            "tight.csv",
        ])?,
        shorter,
    };
    Ok(Found::of(reading, &data, &claims().rules))
}

/// The place of a panel of figs 7 and 8, "7(i)", among the census'.
fn place(panel: &str) -> Result<usize, JobError> {
    let at = census::PANELS.iter().position(|p| p.name == panel);
    at.ok_or_else(|| JobError::Other(format!("the census has no panel {panel}")))
}

/// The runs that repeat a panel of figs 7 and 8, "7(i)".
///
/// # Errors
///
/// If there is no such panel, or the committed data are not the files that `make census` writes.
pub fn runs(panel: &str, reading: Reading) -> Result<Vec<census::CensusRun>, JobError> {
    let at = place(panel)?;
    let table = rows_of(&committed(["fig7.csv", "fig8.csv"][at / 3])?)?.table();
    Ok(census::PANELS[at].runs(&table, vec![("params.alpha", reading.caricature().alpha.into())]))
}

/// Number of these runs that support the paper's claim about the panel.
///
/// # Errors
///
/// As [`runs`].
pub fn support(panel: &str, reading: Reading) -> Result<Support, JobError> {
    let (said, runs) = (census::PANELS[place(panel)?].said, runs(panel, reading)?);
    Ok(Support {
        support: census::supporting(said, &runs, &claims().rules),
        runs: runs.len() as u64,
    })
}

fn tables(reading: Reading) -> Result<Vec<Table>, JobError> {
    Ok(found(reading)?.tables())
}

/// Columns of counts as stacked bars with a name above each.
fn bars(names: &[String], counts: &[Vec<f64>], below: &[Vec<String>]) -> PlanePanel {
    let n = names.len() as f64;
    let mut panel =
        PlanePanel::new(Axis::linear("", -0.95, n + 0.15), Axis::linear("", -0.24, 1.16));
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
            panel =
                panel.solid(vec![[left, low], [right, low], [right, high], [left, high]], colour);
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
    let [shares, found, curves, ways, shorter] = tables else {
        unreachable!("the census has five tables")
    };
    let count = |table: &Table, row: usize, suffix: &str| -> Vec<f64> {
        MotionKind::ALL
            .map(|k| {
                table.integers(&format!("{}{suffix}", k.words().replace(' ', "_")))[row] as f64
            })
            .to_vec()
    };
    let names: Vec<String> = shares.words("panel").map(str::to_owned).collect();
    let at_end: Vec<Vec<f64>> =
        (0..shares.len()).map(|row| count(shares, row, "_at_end")).collect();
    let percent = |v: f64| format!("{:.0}", 100.0 * v);
    let claimed: Vec<Vec<String>> = (0..shares.len())
        .map(|row| {
            let [p, low, high] = ["share", "low", "high"].map(|c| shares.numbers(c)[row]);
            vec![format!("{} %", percent(p)), format!("{}–{}", percent(low), percent(high))]
        })
        .collect();
    let mut capture =
        PlanePanel::new(Axis::log("*t*", 3.0, 2e5), Axis::linear("share captured", 0.0, 1.0));
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
    // Short, so that eight stand side by side; the footer says what they mean.
    let short = |group: &str| match group.split_once("e-") {
        Some((_, exponent)) => format!("10^{{-{exponent}}}"),
        None => match group {
            "lsoda" => "LSODA",
            "dopri5" => "DP5",
            "radau5" => "Radau",
            other => other,
        }
        .to_owned(),
    };
    let ways_names: Vec<String> = ways.words("group").map(short).collect();
    let ways_counts: Vec<Vec<f64>> = (0..ways.len()).map(|row| count(ways, row, "")).collect();
    let ways_totals: Vec<Vec<String>> = ways_counts
        .iter()
        .map(|c| vec![format!("{:.0}", c.iter().sum::<f64>()), "runs".to_owned()])
        .collect();
    let in_picture =
        |name: &str| SHORTER.iter().find(|s| s.1 == name).map_or(name, |s| s.2).to_owned();
    let shorter_names: Vec<String> = shorter.words("group").map(in_picture).collect();
    let shorter_counts: Vec<Vec<f64>> =
        (0..shorter.len()).map(|row| count(shorter, row, "")).collect();
    let shorter_totals: Vec<Vec<String>> =
        shorter_counts.iter().map(|c| vec![format!("{:.0} runs", c.iter().sum::<f64>())]).collect();
    let horizon = shorter.numbers("t").first().copied().unwrap_or(f64::NAN);
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
    let mut sheet = Sheet::new(ColumnWidth::Wide, 1, "")
        .panel_aspect(0.5)
        .panel("(a)", "where runs of each panel end", bars(&names, &at_end, &claimed))
        .panel("(b)", "captured by a closed orbit", capture)
        .panel(
            "(c)",
            "interval 100, by method and tolerance",
            bars(&ways_names, &ways_counts, &ways_totals),
        )
        .panel(
            "(d)",
            format!("interval 100 to *t* = {horizon}, by local error"),
            bars(&shorter_names, &shorter_counts, &shorter_totals),
        );
    for (kind, colour) in MotionKind::ALL.into_iter().zip(COLOURS) {
        sheet = sheet.legend(LegendEntry::new(LegendKey::Area(colour, 100), kind.words()));
    }
    sheet
        .footer(format!(
            "Runs to *t* = 200000 from starts shifted by less than 10^{{-9}}, LSODA at NDSolve's \
             defaults, {} a panel. Below each bar of (a): share of runs that support the paper's \
             claim about the panel, with its 95 % interval (Wilson). (c) LSODA, Dormand-Prince \
             (DP5) and Radau IIA at NDSolve's tolerance; Dormand-Prince at other tolerances.",
            match [runs.iter().min(), runs.iter().max()].map(|n| n.copied().unwrap_or(0)) {
                [fewest, most] if fewest == most => fewest.to_string(),
                [fewest, most] => format!("{fewest} to {most}"),
            }
        ))
        .footer(format!(
            "Tests for the same odds (permutation): intervals 20, 40, 100 {}; *σ* {}; all six \
                panels {}; methods {}; tolerances {}, without 10^{{-6}} {}; (d) {}.",
            p("intervals 20, 40, 100"),
            p("sigma 0.01, 0.1, 0.13"),
            p("all six panels"),
            p("methods"),
            p("tolerances"),
            p("tolerances below 1e-6"),
            p("ordinary and small local errors"),
        ))
        .footer(format!(
            "Three independent runs: fig. 7 all as claimed {}, not all the same {}; fig. 8 all as \
                claimed {}, not all the same {}.",
            together("fig. 7: all as claimed"),
            together("fig. 7: not all the same"),
            together("fig. 8: all as claimed"),
            together("fig. 8: not all the same"),
        ))
}

/// The figure's specification.
pub fn figure() -> Figure {
    studied_in_both_readings(
        "census",
        "The odds of each outcome of figs 7 and 8",
        "(a) Where runs of each panel of figs 7 and 8 end, of many starts that differ by less than \
         1e-9, and the share that supports the paper's claim about the panel. (b) Share \
         of runs that a closed orbit has captured by time t. (c) The same as (a) for fig. 7(iii) \
         by other methods, and by Dormand-Prince at other tolerances. (d) Runs of fig. 7(iii) that \
         end earlier, by LSODA and by a Taylor method in double-double arithmetic.",
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
