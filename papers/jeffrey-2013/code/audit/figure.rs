//! The parameter map: at which alpha and beta the paper's outcomes of figs 7, 8 and 9(i) are
//! likely. Not a figure of the paper. Its data are committed beside it and in capture, and
//! made by `make census` and `make capture`.

use std::sync::Arc;

use crate::Reading;
use crate::computed::Computed;
use crate::study::audit::{self, Candidate, Cell, PRIORS};
use crate::study::capture;
use crate::study::census;
use crate::study::claims::claims;
use twofold::job::sweep::Rows;
use twofold::job::table::Table;
use twofold::job::{AnyQuestion, JobError};
use twofold::num::elementary::sqrt;
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

/// The printed and the reconstructed numbers of figs 7 and 8 are the census'; the map is that of
/// the study of times of capture.
const OTHERS: [(&str, &[u8]); 4] = [
    ("../census/fig7.csv", include_bytes!("../census/fig7.csv")),
    ("../census/fig8.csv", include_bytes!("../census/fig8.csv")),
    ("../capture/map7.csv", include_bytes!("../capture/map7.csv")),
    ("../capture/map8.csv", include_bytes!("../capture/map8.csv")),
];

/// The committed content of a file.
fn committed(name: &str) -> Result<Vec<u8>, JobError> {
    let found =
        DATA.iter().chain(&OTHERS).find(|(n, _)| *n == name).map(|(_, bytes)| bytes.to_vec());
    found.ok_or_else(|| JobError::Other(format!("the audit has no {name}")))
}

fn table_of(bytes: &[u8]) -> Result<Table, JobError> {
    Rows::from_csv(bytes)
        .map(|rows| rows.table())
        .map_err(|e| JobError::Other(format!("the audit's data: {e}")))
}

/// The candidates for what was meant, the printed numbers first: with as many runs of each panel
/// for all, because fewer runs leave more room for what did not happen; and the printed and
/// reconstructed numbers alone, with all their runs.
///
/// # Errors
///
/// If the committed data are not the files that `make census` writes.
pub fn candidates() -> Result<[Vec<Candidate>; 2], JobError> {
    candidates_in(&committed)
}

/// The candidates by the files that `read` gives for names as in [`DATA`], and for the census'
/// names with `../census/` before them.
///
/// # Errors
///
/// If they are not such as `make census` writes, or `read` fails.
pub fn candidates_in(
    read: &dyn Fn(&str) -> Result<Vec<u8>, JobError>,
) -> Result<[Vec<Candidate>; 2], JobError> {
    let tables = |names: &[&str]| -> Result<Vec<Table>, JobError> {
        names.iter().map(|name| table_of(&read(name)?)).collect()
    };
    let sweeps = [
        tables(&["../census/fig7.csv", "alpha7.csv", "beta7.csv"])?,
        tables(&["../census/fig8.csv", "alpha8.csv", "beta8.csv"])?,
        tables(&["alpha9.csv", "beta9.csv"])?,
    ];
    let rules = &claims().rules;
    let all = audit::cells(&sweeps, audit::ALL, rules);
    let fewest = std::array::from_fn(|panel| {
        let runs = all.iter().map(|cell| cell.runs[panel]).min().unwrap_or(0);
        usize::try_from(runs).unwrap_or(usize::MAX)
    });
    let equal = audit::cells(&sweeps, fewest, rules);
    let readings = Reading::ALL.map(Reading::parameters);
    let two: Vec<Cell> =
        all.into_iter().filter(|cell| readings.contains(&[cell.alpha, cell.beta])).collect();
    match (audit::candidates(&equal, rules), audit::candidates(&two, rules)) {
        (Some(equal), Some(two)) => Ok([equal, two]),
        _ => {
            Err(JobError::Other("the printed numbers are not among the audit's candidates".into()))
        }
    }
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
    let table = table_of(&committed("alpha9.csv")?)?;
    let runs = panel.runs(&table, vec![("params.alpha", reading.caricature().alpha.into())]);
    Ok(Support {
        support: census::supporting(panel.said, &runs, &claims().rules),
        runs: runs.len() as u64,
    })
}

fn tables() -> Result<Vec<Table>, JobError> {
    let [fig7, fig8] =
        ["../capture/map7.csv", "../capture/map8.csv"].map(|name| table_of(&committed(name)?));
    let map = capture::map_table([&fig7?, &fig8?], &claims().rules);
    Ok(vec![map, audit::candidate_table(&candidates()?[0])])
}

fn questions() -> Vec<AnyQuestion> {
    let data: Vec<Hash> = DATA.iter().chain(&OTHERS).map(|(_, bytes)| Hash::of(bytes)).collect();
    vec![Arc::new(Computed {
        kind: "audit",
        question: serde_json::json!({ "data": data, "rules": claims().rules, "priors": PRIORS }),
        cost: 1.0,
        compute: tables,
    })]
}

/// From white to a dark blue.
fn shade(share: f64) -> Colour {
    let mix =
        |light: f64, dark: f64| (light + (dark - light) * share.clamp(0.0, 1.0)).round() as u8;
    Colour::rgb(mix(247.0, 8.0), mix(251.0, 48.0), mix(255.0, 107.0))
}

fn draw(tables: &[Table]) -> Sheet {
    let [cells, candidates] = tables else { unreachable!("the audit has two tables") };
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
    let ends = |v: &[f64], by: f64| {
        let (a, b) = range_of(v.iter().copied());
        (a / by, b * by)
    };
    let ((a0, a1), (b0, b1)) = (ends(alpha, wide), ends(beta, high));
    let mut map = PlanePanel::new(Axis::log("*α*", a0, a1), Axis::log("*β*", b0, b1));
    for i in 0..l.len() {
        let (x, y) = (alpha[i], beta[i]);
        let outline = vec![
            [x / wide, y / high],
            [x * wide, y / high],
            [x * wide, y * high],
            [x / wide, y * high],
        ];
        map = map.solid(outline, shade(if top > low { (l[i] - low) / (top - low) } else { 0.0 }));
    }
    let marks = [
        (
            "printed",
            vec![Reading::Printed.parameters()],
            MarkerStyle { shape: MarkerShape::Cross, colour: style::VERMILLION, size: 6.0 },
        ),
        (
            "reconstructed",
            vec![Reading::Reconstructed.parameters()],
            MarkerStyle { shape: MarkerShape::Star, colour: style::ORANGE, size: 7.0 },
        ),
        (
            "most likely",
            vec![[alpha[best], beta[best]]],
            MarkerStyle { shape: MarkerShape::OpenDot, colour: style::VERMILLION, size: 5.0 },
        ),
    ];
    let mut sheet = Sheet::new(ColumnWidth::Wide, 1, "").panel_aspect(0.6);
    for (words, at, marker) in marks {
        map = map.markers(at, marker);
        sheet = sheet.legend(LegendEntry::new(LegendKey::Marker(marker), words));
    }
    for (share, words) in [(0.0, low), (0.5, 0.5 * (low + top)), (1.0, top)] {
        sheet = sheet.legend(LegendEntry::new(
            LegendKey::Area(shade(share), 100),
            format!("10^{{{words:.1}}}"),
        ));
    }
    let (ca, cb) = (candidates.numbers("alpha"), candidates.numbers("beta"));
    let posteriors = PRIORS.map(|prior| {
        ["", "_low", "_high"]
            .map(|end| candidates.numbers(&format!("posterior_prior_{prior}{end}")))
    });
    let n = candidates.len() as f64;
    let mut odds = PlanePanel::new(Axis::linear("", -0.8, n + 0.1), Axis::linear("", -0.3, 1.1));
    odds.axes = false;
    for percent in [0.0, 50.0, 100.0] {
        let y = percent / 100.0;
        odds = odds.line(vec![[-0.05, y], [n, y]], LineStyle::new(style::GRID, 0.6)).note(
            [-0.1, y],
            format!("{percent} %"),
            Anchor::Right,
        );
    }
    for i in 0..candidates.len() {
        for (k, colour) in [style::BLUE, style::ORANGE].into_iter().enumerate() {
            let [height, from, to] = posteriors[k].map(|column| column[i]);
            let (left, height) = (i as f64 + 0.12 + 0.38 * k as f64, height.max(0.003));
            odds = odds
                .solid(
                    vec![[left, 0.0], [left + 0.36, 0.0], [left + 0.36, height], [left, height]],
                    colour,
                )
                .line(
                    vec![[left + 0.18, from], [left + 0.18, to]],
                    LineStyle::new(style::INK, style::CURVE_PT),
                );
        }
        odds = odds.note([i as f64 + 0.5, -0.03], number(ca[i]), Anchor::Below).note(
            [i as f64 + 0.5, -0.14],
            number(cb[i]),
            Anchor::Below,
        );
    }
    let runs = cells.integers("runs").iter().min().copied().unwrap_or(0);
    sheet
        .panel("(a)", "likelihood of the six outcomes of figs 7 and 8", map)
        .panel("(b)", "posterior of *α* (above) and *β*", odds)
        .legend(LegendEntry::new(
            LegendKey::Area(style::BLUE, 100),
            format!(
                "prior of printed \
            {}",
                PRIORS[0]
            ),
        ))
        .legend(LegendEntry::new(
            LegendKey::Area(style::ORANGE, 100),
            format!(
                "prior of printed \
            {}",
                PRIORS[1]
            ),
        ))
        .footer(format!(
            "(a) Probability that one new run of each panel of figs 7 and 8 comes out as the paper \
                says, from {runs} runs in each cell \
             (LSODA at NDSolve's tolerance, *t* = 200000). Most likely: *α* = {}, *β* = {}.",
            number(alpha[best]),
            number(beta[best])
        ))
        .footer(format!(
            "(b) The printed numbers and those with one exponent changed, LSODA, {} runs or more \
                of each panel, with 95 % intervals; what is not printed shares the rest of the \
                prior evenly.",
            candidates.integers("fewest_runs").iter().min().copied().unwrap_or(0)
        ))
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
                at each α and β, by LSODA, with the printed, the reconstructed and \
                      the most likely pair. (b) How probable it is that one digit of an exponent \
                      was misprinted, under two priors: from these and 9(i)."
                .into(),
            view: View::Study(Study { questions, draw: |answers| draw(&Study::tables(answers)) }),
            panels: Vec::new(),
            alterations: Vec::new(),
        }],
    }
}
