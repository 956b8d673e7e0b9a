//! The parameter map: at which alpha and beta the paper's outcomes of figs 7, 8 and 9(i) are
//! likely. Not a figure of the paper. Its data are committed beside it and in capture, and
//! made by `make census` and `make capture`.

use std::sync::Arc;

use crate::Reading;
use crate::computed::Computed;
use crate::study::audit;
use crate::study::capture::{self, Candidate};
use crate::study::census;
use crate::study::claims::claims;
use twofold::job::sweep::Rows;
use twofold::job::table::{Column, Entry, Table};
use twofold::job::{AnyQuestion, JobError};
use twofold::num::elementary::{exp10, log10, sqrt};
use twofold::paper::wording::number;
use twofold::paper::{Figure, Picture, Study, Support, View};
use twofold::record::Hash;
use twofold::render::sheet::*;
use twofold::render::style;

/// Data made for this figure: the candidates, one exponent changed, by LSODA as the figures are;
/// and fig. 7's intervals, fig. 8's sigmas and fig. 9's hysteretic switch over alpha and beta by
/// Dormand-Prince at NDSolve's tolerance, which docs/parameters.md compares with LSODA's map.
pub const DATA: &[(&str, &[u8])] = &[
    ("fig7.csv", include_bytes!("fig7.csv")),
    ("fig8.csv", include_bytes!("fig8.csv")),
    ("fig9.csv", include_bytes!("fig9.csv")),
    ("alpha7.csv", include_bytes!("alpha7.csv")),
    ("alpha8.csv", include_bytes!("alpha8.csv")),
    ("beta7.csv", include_bytes!("beta7.csv")),
    ("beta8.csv", include_bytes!("beta8.csv")),
    ("alpha9.csv", include_bytes!("alpha9.csv")),
    ("beta9.csv", include_bytes!("beta9.csv")),
];

/// The printed and the reconstructed numbers of figs 7 and 8 are the census'; the map, its best
/// cell and the visits are those of the study of times of capture.
const OTHERS: [(&str, &[u8]); 8] = [
    ("../census/fig7.csv", include_bytes!("../census/fig7.csv")),
    ("../census/fig8.csv", include_bytes!("../census/fig8.csv")),
    ("../capture/map7.csv", include_bytes!("../capture/map7.csv")),
    ("../capture/map8.csv", include_bytes!("../capture/map8.csv")),
    ("../capture/best7.csv", include_bytes!("../capture/best7.csv")),
    ("../capture/best8.csv", include_bytes!("../capture/best8.csv")),
    ("../capture/best9.csv", include_bytes!("../capture/best9.csv")),
    ("../capture/visits.csv", include_bytes!("../capture/visits.csv")),
];

/// The committed content of a file.
fn committed(name: &str) -> Result<&'static [u8], JobError> {
    let found = DATA.iter().chain(&OTHERS).find(|(n, _)| *n == name).map(|(_, bytes)| *bytes);
    found.ok_or_else(|| JobError::Other(format!("the audit has no {name}")))
}

fn sweep(name: &str) -> Result<Table, JobError> {
    Rows::from_csv(committed(name)?)
        .map(|rows| rows.table())
        .map_err(|e| JobError::Other(format!("the audit's data: {e}")))
}

/// The committed visits: a row a run, with its parameters and its number of visits.
///
/// # Errors
///
/// If they are not such as `make capture` writes.
pub fn visits() -> Result<Table, JobError> {
    let bad = || JobError::Other("capture/visits.csv has a row that is no row of numbers".into());
    let text = std::str::from_utf8(committed("../capture/visits.csv")?).map_err(|_| bad())?;
    let mut lines = text.lines();
    let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let mut table = Table::new("visits", columns.iter().map(|name| Column::numbers(name)));
    for line in lines {
        let row: Result<Vec<Entry>, _> =
            line.split(',').map(|v| v.parse().map(Entry::Number)).collect();
        table.push(row.ok().filter(|row| row.len() == columns.len()).ok_or_else(bad)?);
    }
    Ok(table)
}

/// The candidates for what was meant, with the runs that show each of the eight outcomes: the
/// table of docs/parameters.md.
///
/// # Errors
///
/// If the committed data are not the files that `make census` and `make capture` write.
pub fn candidates() -> Result<Vec<Candidate>, JobError> {
    let tables = |names: &[&str]| names.iter().map(|name| sweep(name)).collect::<Result<_, _>>();
    let sweeps = [
        tables(&["../census/fig7.csv", "alpha7.csv", "beta7.csv", "../capture/best7.csv"])?,
        tables(&["../census/fig8.csv", "alpha8.csv", "beta8.csv", "../capture/best8.csv"])?,
        tables(&["alpha9.csv", "beta9.csv", "../capture/best9.csv"])?,
    ];
    Ok(Candidate::all(&sweeps, &visits()?, &claims().rules))
}

/// Number of runs of 9(i) that support the paper's claim about it.
///
/// # Errors
///
/// If the committed data are not the files that `make census` writes.
pub fn support(panel: &str, reading: Reading) -> Result<Support, JobError> {
    let known = audit::PANELS.iter().find(|p| p.name == panel && p.column.is_none());
    let panel =
        known.ok_or_else(|| JobError::Other(format!("the audit has no runs of {panel} alone")))?;
    let table = sweep("alpha9.csv")?;
    let runs = panel.runs(&table, vec![("params.alpha", reading.caricature().alpha.into())]);
    Ok(Support {
        support: census::supporting(panel.said, &runs, &claims().rules),
        runs: runs.len() as u64,
    })
}

fn tables() -> Result<Vec<Table>, JobError> {
    let map = [&sweep("../capture/map7.csv")?, &sweep("../capture/map8.csv")?];
    Ok(vec![capture::map_table(map, &claims().rules), capture::count_table(&candidates()?)])
}

fn questions() -> Vec<AnyQuestion> {
    let data: Vec<Hash> = DATA.iter().chain(&OTHERS).map(|(_, bytes)| Hash::of(bytes)).collect();
    vec![Arc::new(Computed {
        kind: "audit",
        question: serde_json::json!({ "data": data, "rules": claims().rules }),
        cost: 1.0,
        compute: tables,
    })]
}

/// Marks of the printed and of the reconstructed numbers.
const READINGS: [(Reading, MarkerStyle); 2] = [
    (
        Reading::Printed,
        MarkerStyle { shape: MarkerShape::Cross, colour: style::VERMILLION, size: 6.0 },
    ),
    (
        Reading::Reconstructed,
        MarkerStyle { shape: MarkerShape::Star, colour: style::ORANGE, size: 7.0 },
    ),
];

/// From a light to a dark blue: the lightest is no paper.
fn blue(share: f64) -> Colour {
    let mix =
        |light: f64, dark: f64| (light + (dark - light) * share.clamp(0.0, 1.0)).round() as u8;
    Colour::rgb(mix(208.0, 8.0), mix(225.0, 48.0), mix(242.0, 107.0))
}

fn rectangle([x0, x1]: [f64; 2], [y0, y1]: [f64; 2]) -> Vec<[f64; 2]> {
    vec![[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
}

/// The map, the scale of its colours, and its most likely pair.
fn map_panels(cells: &Table) -> (PlanePanel, PlanePanel, [f64; 2]) {
    let (alpha, beta, l) =
        (cells.numbers("alpha"), cells.numbers("beta"), cells.numbers("log10_likelihood"));
    let spacing = |values: &[f64]| {
        let mut sorted = values.to_vec();
        sorted.sort_by(f64::total_cmp);
        sorted.dedup();
        let ratio = sorted.windows(2).map(|w| w[1] / w[0]).fold(f64::INFINITY, f64::min);
        if ratio.is_finite() { sqrt(ratio) } else { 1.5 }
    };
    let (wide, high) = (spacing(alpha), spacing(beta));
    let (low, top) = range_of(l.iter().copied());
    let best = (0..l.len()).max_by(|a, b| l[*a].total_cmp(&l[*b])).unwrap_or(0);
    let best = [alpha[best], beta[best]];
    let ends = |v: &[f64], by: f64| {
        let (a, b) = range_of(v.iter().copied());
        (a / by, b * by)
    };
    let ((a0, a1), (b0, b1)) = (ends(alpha, wide), ends(beta, high));
    let mut map = PlanePanel::new(Axis::log("*α*", a0, a1), Axis::log("*β*", b0, b1));
    for ((x, y), l) in alpha.iter().zip(beta).zip(l) {
        let cell = rectangle([x / wide, x * wide], [y / high, y * high]);
        map = map.solid(cell, blue((l - low) / (top - low)));
    }
    for (reading, look) in READINGS {
        map = map.markers(vec![reading.parameters()], look);
    }
    map = map.markers(vec![best], BEST);
    let mut scale = PlanePanel::new(Axis::linear("", low, top), Axis::linear("", -1.2, 1.0));
    (scale.axes, scale.aspect) = (false, Some(0.1));
    const STEPS: usize = 64;
    let place = |i: usize| low + (top - low) * i as f64 / STEPS as f64;
    for i in 0..STEPS {
        // Two steps wide, the second under the next piece: no paper shines through.
        let piece = rectangle([place(i), place((i + 2).min(STEPS))], [0.0, 1.0]);
        scale = scale.solid(piece, blue((i as f64 + 0.5) / STEPS as f64));
    }
    for exponent in (low.ceil() as i32)..=(top.floor() as i32) {
        let at = f64::from(exponent);
        scale = scale
            .line(vec![[at, 0.0], [at, -0.25]], LineStyle::new(style::SOFT_INK, style::FRAME_PT));
        scale.layers.push(small([at, -0.8], format!("10^{{{exponent}}}")));
    }
    (map, scale, best)
}

/// The mark of the most likely pair.
const BEST: MarkerStyle =
    MarkerStyle { shape: MarkerShape::OpenDot, colour: style::VERMILLION, size: 5.0 };

/// A power of ten as that, other numbers with two digits.
fn power(value: f64) -> String {
    let exponent = log10(value);
    if (exponent - exponent.round()).abs() < 1e-9 {
        format!("10^{{{}}}", exponent.round())
    } else {
        let ten = exp10(exponent.floor());
        format!("{:.1}×10^{{{}}}", value / ten, exponent.floor())
    }
}

fn small(at: [f64; 2], text: String) -> PlaneLayer {
    PlaneLayer::Note(Note { size: style::TICK_PT, ..Note::new(at, text, Anchor::Centre) })
}

/// The counts as cells: a row a candidate, a column an outcome.
fn counts_panel(counts: &Table) -> PlanePanel {
    const OUTCOMES: usize = 8;
    let (runs, hits) = (counts.integers("runs"), counts.integers("hits"));
    let rows = counts.len() / OUTCOMES;
    let bottom = -(rows as f64);
    let mut panel = PlanePanel::new(
        Axis::linear("", -4.1, OUTCOMES as f64 + 0.05),
        Axis::linear("", bottom - 1.0, 1.0),
    );
    panel.axes = false;
    panel.aspect = Some(0.62);
    let mut texts = vec![
        ([-2.6, 0.5], "*α*".to_owned()),
        ([-1.0, 0.5], "*β*".to_owned()),
        ([-1.0, bottom - 0.5], "of".to_owned()),
    ];
    for (i, outcome) in counts.words("outcome").enumerate() {
        let (row, column) = (i / OUTCOMES, (i % OUTCOMES) as f64);
        let (top, middle) = (-(row as f64), -(row as f64) - 0.5);
        let share = hits[i] as f64 / runs[i].max(1) as f64;
        let cell = rectangle([column, column + 1.0], [top - 1.0, top]);
        panel = panel.solid(cell, style::SOFT_INK.lighten(1.0 - 0.6 * share));
        texts.push(([column + 0.5, middle], hits[i].to_string()));
        if row == 0 {
            texts.push(([column + 0.5, 0.5], outcome.to_owned()));
            texts.push(([column + 0.5, bottom - 0.5], runs[i].to_string()));
        }
        if column == 0.0 {
            let at = [counts.numbers("alpha")[i], counts.numbers("beta")[i]];
            texts.push(([-2.6, middle], power(at[0])));
            texts.push(([-1.0, middle], power(at[1])));
            for (_, look) in READINGS.into_iter().filter(|(r, _)| r.parameters() == at) {
                panel = panel.markers(vec![[-3.7, middle]], look);
            }
        }
    }
    let frame = LineStyle::new(style::FAINT, style::GRID_PT);
    for row in 0..=rows {
        panel = panel.line(vec![[0.0, -(row as f64)], [OUTCOMES as f64, -(row as f64)]], frame);
    }
    for column in 0..=OUTCOMES {
        panel = panel.line(vec![[column as f64, 0.0], [column as f64, bottom]], frame);
    }
    panel.layers.extend(texts.into_iter().map(|(at, text)| small(at, text)));
    panel
}

fn draw(tables: &[Table]) -> Sheet {
    let [cells, counts] = tables else { unreachable!("the audit has two tables") };
    let (map, scale, best) = map_panels(cells);
    let sheet = Sheet::new(ColumnWidth::Wide, 1, "")
        .panel_aspect(0.55)
        .panel("(a)", "likelihood of the six outcomes of figs 7 and 8", map)
        .panel("", "probability in (a)", scale)
        .panel("(b)", "runs that show each outcome", counts_panel(counts));
    let named = READINGS.map(|(reading, look)| (look, reading.word()));
    let fewest = cells.integers("runs").iter().min().copied().unwrap_or(0) / 6;
    named
        .into_iter()
        .chain([(BEST, "most likely")])
        .fold(sheet, |sheet, (look, words)| {
            sheet.legend(LegendEntry::new(LegendKey::Marker(look), words))
        })
        .footer(format!(
            "(a) Probability that one new run of each panel comes out as the paper says: the \
             product over the six panels of (*k* + 1/2)/(*n* + 1), where *k* of *n* = {fewest} \
             runs did (LSODA at NDSolve’s tolerance, *t* = 2×10^{{5}}). Most likely: *α* = {}, *β* \
             = {}.",
            number(best[0]),
            number(best[1])
        ))
        .footer(
            "(b) The printed numbers, those with one exponent changed, and the likeliest by \
             Dormand-Prince. 9(i): chaos; visits: two or more to the singularity by *t* = 150 \
             (fig. 6(i)). Last row: runs of each.",
        )
}

/// The figure's specification.
pub fn figure() -> Figure {
    Figure {
        id: "audit".into(),
        title: "At which parameters the paper's outcomes are likely".into(),
        pictures: vec![Picture {
            name: "audit".into(),
            reading: None,
            title: "At which parameters the paper's outcomes are likely".into(),
            caption: "(a) How likely the six outcomes that the paper reports in figs 7 and 8 are \
                      at each α and β, by LSODA, with the printed, the reconstructed and the most \
                      likely pair. (b) Number of runs that show each outcome of figs 7, 8 and 9(i) \
                      and repeated visits to the singularity, for the printed numbers and seven \
                      others: the counts of docs/parameters.md."
                .into(),
            view: View::Study(Study { questions, draw: |answers| draw(&Study::tables(answers)) }),
            panels: Vec::new(),
            alterations: Vec::new(),
        }],
    }
}
