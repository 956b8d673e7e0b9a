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

/// A bar: its name, its counts by kind, those of them that support a claim, and lines of text
/// below.
struct Bar {
    name: String,
    counts: [f64; 6],
    supporting: Option<[f64; 6]>,
    below: Vec<String>,
}

/// Stacked bars: what supports a claim first, up to a black line, the rest lighter. `labels` say
/// what the lines below are.
fn bars(bars: &[Bar], labels: &[&str], aspect: f64) -> PlanePanel {
    let n = bars.len() as f64;
    // Height of a line below the bars.
    let leading = 0.039 / aspect;
    let leading = 1.2 * leading / (1.0 - labels.len() as f64 * leading);
    let mut panel = PlanePanel::new(
        Axis::linear("", -0.95, n + 0.15),
        Axis::linear("", -0.04 - labels.len() as f64 * leading, 1.2),
    );
    (panel.axes, panel.aspect) = (false, Some(aspect));
    for percent in [0.0, 50.0, 100.0] {
        let y = percent / 100.0;
        panel = panel.line(vec![[-0.08, y], [n, y]], LineStyle::new(style::GRID, 0.6)).note(
            [-0.12, y],
            format!("{percent} %"),
            Anchor::Right,
        );
    }
    let small = |at, text: &str, anchor| {
        PlaneLayer::Note(Note { size: style::TICK_PT, ..Note::new(at, text, anchor) })
    };
    let line_at = |line: usize| -0.04 - leading * (line as f64 + 0.5);
    panel.layers.extend(
        labels
            .iter()
            .enumerate()
            .map(|(i, label)| small([-0.12, line_at(i)], label, Anchor::Right)),
    );
    for (i, bar) in bars.iter().enumerate() {
        let (left, middle, right) = (i as f64 + 0.12, i as f64 + 0.5, i as f64 + 0.88);
        let total = bar.counts.iter().sum::<f64>().max(1.0);
        let supporting = bar.supporting.unwrap_or(bar.counts);
        let rest: [f64; 6] = std::array::from_fn(|kind| bar.counts[kind] - supporting[kind]);
        let mut low = 0.0;
        for (part, white) in [(supporting, 0.0), (rest, 0.6)] {
            for (count, colour) in part.iter().zip(COLOURS).filter(|(count, _)| **count > 0.0) {
                let high = low + count / total;
                panel = panel.solid(
                    vec![[left, low], [right, low], [right, high], [left, high]],
                    colour.lighten(white),
                );
                low = high;
            }
        }
        if bar.supporting.is_some() {
            let share = supporting.iter().sum::<f64>() / total;
            let line = LineStyle::new(style::INK, 1.2);
            panel = panel.line(vec![[left - 0.06, share], [right + 0.06, share]], line);
        }
        panel = panel.note([middle, 1.02], bar.name.clone(), Anchor::Above);
        panel.layers.extend(
            bar.below
                .iter()
                .enumerate()
                .map(|(k, t)| small([middle, line_at(k)], t, Anchor::Centre)),
        );
    }
    panel
}

/// The bars of a table of groups, with a group's name as it is shown.
fn groups(table: &Table, name: impl Fn(&str) -> String) -> Vec<Bar> {
    let bar = |(row, group): (usize, &str)| {
        let counts = counts(table, row, "");
        let below = vec![format!("{:.0}", counts.iter().sum::<f64>())];
        Bar { name: name(group), counts, supporting: None, below }
    };
    table.words("group").enumerate().map(bar).collect()
}

/// The counts of a row by kind, in the order of `MotionKind::ALL`.
fn counts(table: &Table, row: usize, suffix: &str) -> [f64; 6] {
    let column = |k: MotionKind| format!("{}{suffix}", k.words().replace(' ', "_"));
    MotionKind::ALL.map(|k| table.integers(&column(k))[row] as f64)
}

/// The bars of the panels of figs 7 and 8.
fn panels(shares: &Table) -> Vec<Bar> {
    let percent = |column: &str, row: usize| format!("{:.0}", 100.0 * shares.numbers(column)[row]);
    let bar = |(row, (name, claim)): (usize, (&str, &str))| {
        let hits = shares.integers("hits")[row] as f64;
        let [one, three, ..] = counts(shares, row, "_at_shown");
        // As `census::supporting` counts: what is periodic at the end was so from `shown_from` on.
        let (supporting, claim) = match claim {
            "periodic" => ([one, three, hits - one - three, 0.0, 0.0, 0.0], claim),
            "period three" => ([0.0, hits, 0.0, 0.0, 0.0, 0.0], "period 3"),
            _ => ([0.0, 0.0, 0.0, hits, 0.0, 0.0], claim),
        };
        Bar {
            name: name.to_owned(),
            counts: counts(shares, row, "_at_end"),
            supporting: Some(supporting),
            below: vec![
                claim.to_owned(),
                format!("{} %", percent("share", row)),
                format!("{}–{}", percent("low", row), percent("high", row)),
            ],
        }
    };
    shares.words("panel").zip(shares.words("claim")).enumerate().map(bar).collect()
}

fn draw(tables: &[Table]) -> Sheet {
    let [shares, found, curves, ways, shorter] = tables else {
        unreachable!("the census has five tables")
    };
    let names: Vec<&str> = shares.words("panel").collect();
    let mut capture =
        PlanePanel::new(Axis::log("*t*", 100.0, 2e5), Axis::linear("share captured", 0.0, 1.0));
    for (i, name) in names.iter().enumerate() {
        let mut points = vec![[100.0, 0.0]];
        let mut last = 0.0;
        for row in (0..curves.len()).filter(|row| curves.words("panel").nth(*row) == Some(name)) {
            let (t, share) = (curves.numbers("t")[row], curves.numbers("share")[row]);
            points.extend([[t, last], [t, share]]);
            last = share;
        }
        points.push([2e5, last]);
        let line = LineStyle::new(style::SERIES[i], style::CURVE_PT);
        capture = capture
            .line(points, if i < 3 { line } else { line.dashed() })
            .legend(LegendKey::Line(if i < 3 { line } else { line.dashed() }), *name);
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
    let in_picture =
        |name: &str| SHORTER.iter().find(|s| s.1 == name).map_or(name, |s| s.2).to_owned();
    let horizon = shorter.numbers("t").first().copied().unwrap_or(f64::NAN);
    let p = |what: &str| {
        let row = found.words("what").position(|w| w == what);
        census::p_in_words(row.map_or(f64::NAN, |r| found.numbers("p_permutation")[r]))
    };
    let runs = shares.integers("runs");
    let mut sheet = Sheet::new(ColumnWidth::Wide, 1, "")
        .panel_aspect(0.36)
        .panel(
            "(a)",
            "where runs of each panel end",
            bars(&panels(shares), &["claim", "support", "95 %"], 0.5),
        )
        .panel("(b)", "captured by a closed orbit", capture)
        .panel(
            "(c)",
            "interval 100, by method and tolerance",
            bars(&groups(ways, short), &["runs"], 0.36),
        )
        .panel(
            "(d)",
            format!("interval 100 to *t* = {horizon}, by local error"),
            bars(&groups(shorter, in_picture), &["runs"], 0.36),
        );
    for (kind, colour) in MotionKind::ALL.into_iter().zip(COLOURS) {
        sheet = sheet.legend(LegendEntry::new(LegendKey::Area(colour, 100), kind.words()));
    }
    sheet
        .footer(format!(
            "(a) {} runs a panel to *t* = 2×10^{{5}} from starts shifted by less than 10^{{-9}}, \
             LSODA at NDSolve’s defaults. Full colour, up to the black line: runs that support the \
             paper’s claim, with the share’s 95 % interval (Wilson). A run supports “periodic” or \
             “period 3” only if it was so from 10^{{5}} on.",
            match [runs.iter().min(), runs.iter().max()].map(|n| n.copied().unwrap_or(0)) {
                [fewest, most] if fewest == most => fewest.to_string(),
                [fewest, most] => format!("{fewest} to {most}"),
            }
        ))
        .footer(
            "(c) LSODA, Dormand-Prince (DP5) and Radau IIA at NDSolve’s tolerance; Dormand-Prince \
             at others.",
        )
        .footer(format!(
            "The same odds (permutation tests): intervals 20, 40, 100 {}; *σ* {}; all six panels \
             {}; methods {}; tolerances {}; (d) {}.",
            p("intervals 20, 40, 100"),
            p("sigma 0.01, 0.1, 0.13"),
            p("all six panels"),
            p("methods"),
            p("tolerances"),
            p("ordinary and small local errors"),
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
