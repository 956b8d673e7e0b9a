//! The delayed switch, which the paper leaves out (end of sec. 4.3), beside smoothing and
//! hysteresis. Not a figure of the paper. The data of (c) to (j) are committed beside it and
//! made by `make delay-data`; sentence 4.8's rules were fixed before
//! (papers/jeffrey-2013/sentences.toml).

use std::cmp::Ordering;
use std::sync::Arc;

use crate::Reading;
use crate::computed::Computed;
use crate::study::claims::claims;
use crate::study::similarity::{self, Rule, Score, Similar, WAYS};
use twofold::analyse::passage::Predicted;
use twofold::integrate::Schedule;
use twofold::integrate::delay::History;
use twofold::job::spec::*;
use twofold::job::table::{Column, Table};
use twofold::job::{Answer, AnyQuestion, JobError, Run};
use twofold::num::elementary::{exp10, log10};
use twofold::num::fit::line;
use twofold::paper::wording::number;
use twofold::paper::{Figure, Picture, Study, View};
use twofold::record::Hash;
use twofold::render::sheet::*;
use twofold::render::style;
use twofold::system::{Relaxation, Transition};

/// The data: growth in one passage, exits by the chatter's phase, late sections, and distances of
/// runs from the rules.
pub const DATA: [(&str, &str); 4] = [
    ("growth", include_str!("growth.csv")),
    ("exits", include_str!("exits.csv")),
    ("sections", include_str!("sections.csv")),
    ("runs", include_str!("runs.csv")),
];

/// The passage of (a) begins in attracting sliding.
const START: [f64; 3] = [0.0, 0.3, 0.2];
/// Its end.
const END: f64 = 2.6;
/// Its x is shown until here.
const CHATTER: f64 = 1.8;
/// Its eps, the paper's.
const EPS: f64 = 1e-3;
/// Its delay: eps'.
const DELAY: f64 = 1e-2;
/// Half the height of a strip of (b).
const STRIP: f64 = 2.6e-3;
/// Half the sides of what (c) to (f) show in each reading.
const SIDES: [[f64; 2]; 2] = [[21.0, 2.0], [1.75, 1.1]];
/// Colours of the rules, in all panels.
const SMOOTHING: Colour = style::INK;
/// See [`SMOOTHING`].
const HYSTERESIS: Colour = style::GREEN;
/// See [`SMOOTHING`].
const SHARP: Colour = style::VERMILLION;
/// See [`SMOOTHING`].
const SMOOTH: Colour = style::BLUE;
/// Delays of (g) and (h), with the share of white in their colours.
const DELAYS: [(f64, f64); 4] = [(1e-2, 0.75), (1e-3, 0.5), (1e-4, 0.25), (1e-5, 0.0)];
/// eps of (j), with their shapes.
const LAYERS: [(f64, MarkerShape); 4] = [
    (1e-2, MarkerShape::Dot),
    (1e-3, MarkerShape::Square),
    (1e-4, MarkerShape::Triangle),
    (1e-5, MarkerShape::Star),
];

/// The rules of (a) and (b).
fn passages() -> [(&'static str, SwitchSpec, Colour); 4] {
    let late = |eps: Option<f64>| {
        let transition = eps.map(|_| Transition::Tanh);
        SwitchSpec::Delayed { delay: DELAY, eps, transition, history: History::Constant }
    };
    [
        ("smoothing", SwitchSpec::tanh(EPS), SMOOTHING),
        ("hysteresis", SwitchSpec::hysteretic(EPS, Relaxation::Literal), HYSTERESIS),
        ("sharp delay", late(None), SHARP),
        ("smooth delay", late(Some(EPS)), SMOOTH),
    ]
}

fn questions() -> Vec<AnyQuestion> {
    let mut all: Vec<AnyQuestion> = passages()
        .into_iter()
        .map(|(_, switch, _)| -> AnyQuestion {
            Arc::new(Run(RunSpec {
                system: Reading::Reconstructed.caricature().into(),
                switch,
                start: START.into(),
                t_end: END,
                method: MethodSpec::ndsolve_defaults(Method::Dopri5),
                schedule: Schedule::default(),
                observe: Observation::Path { chord: 2e-5 },
            }))
        })
        .collect();
    let hashes: Vec<Hash> = DATA.iter().map(|(_, text)| Hash::of(text.as_bytes())).collect();
    all.push(Arc::new(Computed {
        kind: "delay",
        question: serde_json::json!({ "data": hashes, "rules": claims().similarity,
            "confidence": claims().rules.confidence }),
        cost: 1.0,
        compute: || {
            DATA.iter().take(3).map(|(name, text)| table(name, text)).chain([scores()]).collect()
        },
    }));
    all
}

/// A committed file as a table: numbers, but for a first column or two of words.
fn table(name: &str, text: &str) -> Result<Table, JobError> {
    let mut lines = text.lines();
    let columns: Vec<&str> = lines.next().unwrap_or_default().split(',').collect();
    let is_word = |column: &str| matches!(column, "rule" | "reading");
    let column = |c: &&str| if is_word(c) { Column::words(c) } else { Column::numbers(c) };
    let mut table = Table::new(name, columns.iter().map(column));
    for line in lines {
        let cells: Vec<&str> = line.split(',').collect();
        let bad = || JobError::Other(format!("delay/{name}.csv: `{line}` is no row"));
        if cells.len() != columns.len() {
            return Err(bad());
        }
        let mut row = Vec::new();
        for (column, cell) in columns.iter().zip(cells) {
            row.push(if is_word(column) {
                cell.into()
            } else {
                cell.parse::<f64>().map_err(|_| bad())?.into()
            });
        }
        table.push(row);
    }
    Ok(table)
}

/// The committed runs.
///
/// # Errors
///
/// If they are not such as `make delay-data` writes.
pub fn runs() -> Result<Vec<similarity::RuleRun>, JobError> {
    similarity::runs(DATA[3].1)
        .ok_or_else(|| JobError::Other("delay/runs.csv has other columns or rows".into()))
}

/// A way, an index of [`WAYS`], in a reading of the parameters; the delayed rule and the hysteretic
/// one; and the score.
pub type Scored = (usize, Reading, Rule, Rule, Score);

/// Every way in each reading of the parameters, for a delay of eps and of eps', against each
/// reading of eq. (10).
///
/// # Errors
///
/// As of [`runs`].
pub fn all_scores() -> Result<Vec<Scored>, JobError> {
    let runs = runs()?;
    let mut all = Vec::new();
    for hysteresis in [Rule::Literal, Rule::Single] {
        for delayed in [Rule::Delayed, Rule::DelayedLong] {
            for way in 0..WAYS.len() {
                for reading in Reading::ALL {
                    let score = similarity::score(&runs, reading, way, delayed, hysteresis);
                    all.push((way, reading, delayed, hysteresis, score));
                }
            }
        }
    }
    Ok(all)
}

fn scores() -> Result<Table, JobError> {
    let words = ["way", "reading", "delayed", "hysteresis", "outcome"].map(Column::words);
    let names = [
        "runs",
        "near",
        "near_low",
        "near_high",
        "within",
        "within_low",
        "within_high",
        "yardstick",
    ];
    let numbers = names.into_iter().chain(["to_smoothing", "to_hysteresis"]).map(Column::numbers);
    let mut table = Table::new("scores", words.into_iter().chain(numbers));
    for (way, reading, delayed, hysteresis, s) in all_scores()? {
        let words =
            [WAYS[way], reading.word(), delayed.name(), hysteresis.name(), s.similar.word()];
        let (near, within) = (s.near, s.within);
        let numbers = [
            s.of as f64,
            near.0 as f64,
            near.1[0],
            near.1[1],
            within.0 as f64,
            within.1[0],
            within.1[1],
        ];
        let numbers = numbers.into_iter().chain([s.yardstick, s.medians[0], s.medians[1]]);
        table.push(words.map(Into::into).into_iter().chain(numbers.map(Into::into)));
    }
    Ok(table)
}

fn line_of(colour: Colour) -> LineStyle {
    LineStyle::new(colour, style::CURVE_PT)
}

fn marker(shape: MarkerShape, colour: Colour, size: f64) -> MarkerStyle {
    MarkerStyle { shape, colour, size }
}

/// The rows of a table whose column `words` says `word`: their indices.
fn rows(table: &Table, words: &str, word: &str) -> Vec<usize> {
    table.words(words).enumerate().filter(|(_, w)| *w == word).map(|(i, _)| i).collect()
}

fn is_near(a: f64, b: f64) -> bool {
    (a / b - 1.0).abs() < 1e-3
}

fn draw(answers: &[Arc<Answer>]) -> Sheet {
    let tables = Study::tables(answers);
    let [paths @ .., growth, exits, sections, scores] = tables.as_slice() else {
        unreachable!("the figure asks for four paths and four tables")
    };
    let (places, strips) = passage_panels(paths);
    let (phases, distribution) = exit_panels(exits);
    let mut sheet = Sheet::new(ColumnWidth::Wide, 2, "")
        .panel_aspect(0.6)
        .panel("(a)", "one passage", places)
        .panel("(b)", "its chatter", strips);
    let mut labels = ["(c)", "(d)", "(e)", "(f)"].into_iter();
    for (reading, half) in Reading::ALL.into_iter().zip(SIDES) {
        for (rule, words) in [(Rule::Literal, "fig. 9(i)"), (Rule::Delayed, "delay *ε*")] {
            sheet = sheet.panel(
                labels.next().unwrap_or_default(),
                format!("{words}, {}", reading.word()),
                section_panel(sections, reading, rule, half, rule == Rule::Literal),
            );
        }
    }
    for (words, _, colour) in passages() {
        sheet = sheet.legend(LegendEntry::new(LegendKey::Line(line_of(colour)), words));
    }
    for (_, shape, words) in KINDS {
        let key = LegendKey::Marker(marker(shape, style::SOFT_INK, 3.4));
        sheet = sheet.legend(LegendEntry::new(key, format!("{words} (i)")));
    }
    for (eps, shape) in LAYERS {
        let key = LegendKey::Marker(marker(shape, SMOOTH, 3.4));
        sheet = sheet.legend(LegendEntry::new(key, format!("*ε* = {} (j)", tenth(eps))));
    }
    let gaps = exit_gaps(exits, "sharp").into_iter().fold(0.0, f64::max);
    let [across, along, carried] = sharp_powers(growth, "sharp").map(said);
    let [by_band, along_by_band, carried_by_band] = sharp_powers(growth, "relay").map(said);
    sheet
        .panel("(g)", "exits by phase", phases)
        .panel("(h)", "their distribution", distribution)
        .panel("(i)", "growth, sharp rules", growth_panel(growth))
        .panel("(j)", "growth, smooth delay", smooth_panel(growth))
        .footer(format!(
            "(a, b) From (0, 0.3, 0.2) in attracting sliding; *ε* = {}, *δ* = {}, eq. (10) with \
             *ε*′ = 10*ε*. Strips of (b) are {} high.",
            number(EPS),
            tenth(DELAY),
            number(2.0 * STRIP)
        ))
        .footer(format!(
            "(c–f) Sections *y* = 0, 10^{{5}} < *t* < 2 × 10^{{5}}, *ε* = {}. {}",
            number(EPS),
            verdict(scores)
        ))
        .footer(format!(
            "(g, h) Sharp delay, *δ* = 10^{{−2}} (lightest), 10^{{−3}}, 10^{{−4}} and 10^{{−5}}: \
             first *x* = 0 beyond 3*δ*. In (h) the four coincide within {gaps:.3}."
        ))
        .footer(format!(
            "(i) Means of six starts. Powers (across, along, carried in) of *δ*: {across}, \
             {along}, {carried}; of half the band: {by_band}, {along_by_band}, {carried_by_band}. \
             Dashed: smoothing’s slopes in *ε*."
        ))
        .footer(
            "(j) Three starts. Growth changes from smoothing’s to that of (i) near *δ* = √*ε*/2.",
        )
}

/// A power of ten.
fn tenth(value: f64) -> String {
    format!("10^{{−{}}}", (-log10(value)).round())
}

/// A fitted power.
fn said((value, _): (f64, f64)) -> String {
    format!("{value:.2}").replace('-', "−")
}

fn passage_panels(paths: &[Table]) -> (PlanePanel, PlanePanel) {
    let mut places =
        PlanePanel::new(Axis::linear("*y*", -0.2, 0.32), Axis::linear("*z*", -0.22, 0.26));
    let strips = PlanePanel::new(Axis::linear("*t*", 0.0, CHATTER), Axis::linear("", -1.5, 10.5));
    let mut strips = strips.labelled(true, false);
    let axis = LineStyle::new(style::GRID, style::FRAME_PT);
    places = places
        .line(vec![[-0.2, 0.0], [0.32, 0.0]], axis)
        .line(vec![[0.0, -0.22], [0.0, 0.26]], axis);
    for (k, (path, (_, _, colour))) in paths.iter().zip(passages()).enumerate() {
        let [t, x, y, z] = ["t", "x", "y", "z"].map(|c| path.numbers(c));
        let inside = |p: &[f64; 2]| p[0] > -0.2 && p[1] > -0.22 && p[0] < 0.32 && p[1] < 0.26;
        let shown: Vec<[f64; 2]> = (0..t.len()).map(|i| [y[i], z[i]]).take_while(inside).collect();
        places = places.line(shown, LineStyle::new(colour, 0.7));
        let middle = 9.0 - 3.0 * k as f64;
        let strip: Vec<[f64; 2]> = (0..t.len())
            .take_while(|i| t[*i] <= CHATTER)
            .map(|i| [t[i], middle + x[i] / STRIP])
            .collect();
        strips = strips.line(vec![[0.0, middle], [CHATTER, middle]], axis);
        for piece in pieces_within(&strip, [middle - 1.0, middle + 1.0]) {
            strips = strips.line(piece, LineStyle::new(colour, 0.7));
        }
    }
    (places.markers(vec![[0.0, 0.0]], marker(MarkerShape::Star, style::MAGENTA, 6.0)), strips)
}

/// The pieces of a polyline whose second coordinate is in `[lower, upper]`, cut at its ends.
fn pieces_within(line: &[[f64; 2]], [lower, upper]: [f64; 2]) -> Vec<Vec<[f64; 2]>> {
    let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
    for ends in line.windows(2) {
        let [from, to] = [ends[0], ends[1]];
        let rise = to[1] - from[1];
        // The fractions of this segment at which it passes the two levels, in order.
        let mut inside = [0.0_f64, 1.0];
        if rise == 0.0 {
            if from[1] < lower || from[1] > upper {
                continue;
            }
        } else {
            let [a, b] = [(lower - from[1]) / rise, (upper - from[1]) / rise];
            inside = [a.min(b).max(0.0), a.max(b).min(1.0)];
        }
        if inside[0] > inside[1] {
            continue;
        }
        let at = |s: f64| match s {
            1.0 => to,
            _ => [from[0] + s * (to[0] - from[0]), from[1] + s * rise],
        };
        match pieces.last_mut() {
            Some(piece) if piece.last() == Some(&at(inside[0])) => piece.push(at(inside[1])),
            _ => pieces.push(vec![at(inside[0]), at(inside[1])]),
        }
    }
    pieces
}

fn section_panel(
    sections: &Table,
    reading: Reading,
    rule: Rule,
    half: [f64; 2],
    left: bool,
) -> PlanePanel {
    let [x, z] = ["x", "z"].map(|c| sections.numbers(c));
    let chosen = sections.words("reading").zip(sections.words("rule")).enumerate();
    let chosen = chosen.filter(|(_, (r, s))| *r == reading.word() && *s == rule.name());
    let points: Vec<[f64; 2]> = chosen.map(|(i, _)| [x[i], z[i]]).collect();
    let panel = PlanePanel::new(
        Axis::linear("*x*", -half[0], half[0]),
        Axis::linear("*z*", -half[1], half[1]),
    )
    .labelled(true, left);
    // A closed orbit's few places are drawn as such.
    let spread = points.iter().fold(0.0_f64, |far, p| {
        let nearest = points
            .iter()
            .take(2)
            .map(|q| (p[0] - q[0]).abs() + (p[1] - q[1]).abs())
            .fold(f64::MAX, f64::min);
        far.max(nearest)
    });
    if spread < 1e-2 * half[0] {
        panel.markers(
            points.into_iter().take(2).collect(),
            marker(MarkerShape::Dot, style::INK, 4.0),
        )
    } else {
        panel.dots(points, DotStyle { colour: style::INK, diameter: Some(0.9), density: false })
    }
}

/// Verdict on sentence 4.8 in this figure's words: the ways in which the delay is similar to
/// hysteresis.
fn verdict(scores: &Table) -> String {
    let column = |name: &str| -> Vec<&str> { scores.words(name).collect() };
    let [way, reading, delayed, hysteresis, outcome] =
        ["way", "reading", "delayed", "hysteresis", "outcome"].map(column);
    let is_similar = |name: &str, r: Reading| {
        (0..scores.len()).any(|i| {
            way[i] == name
                && reading[i] == r.word()
                && delayed[i] == Rule::Delayed.name()
                && hysteresis[i] == Rule::Literal.name()
                && outcome[i] == Similar::Yes.word()
        })
    };
    let ways = ["where runs settle", "occupancy", "chatter", "exits"];
    let said = WAYS.iter().zip(ways).filter_map(|(name, words)| {
        match Reading::ALL.map(|r| is_similar(name, r)) {
            [true, true] => Some(words.to_owned()),
            [true, false] => Some(format!("{words} (printed reading only)")),
            [false, true] => Some(format!("{words} (reconstructed reading only)")),
            [false, false] => None,
        }
    });
    let said: Vec<String> = said.collect();
    format!("By the rules of sentence 4.8 delay is similar to hysteresis in: {}.", said.join(", "))
}

fn exit_panels(exits: &Table) -> (PlanePanel, PlanePanel) {
    let mut phases = PlanePanel::new(
        Axis::linear("phase of the chatter", 0.0, 1.0),
        Axis::linear("*y*/*δ* at the exit", -20.0, 14.0),
    );
    let mut distribution = PlanePanel::new(
        Axis::linear("*y*/*δ* at the exit", -20.0, 14.0),
        Axis::linear("share below", 0.0, 1.05),
    );
    for (delay, white) in DELAYS {
        let colour = SHARP.lighten(white);
        let points = one_period(exits, "sharp", delay);
        let values = sorted(&points);
        let count = values.len() as f64;
        let steps =
            values.iter().enumerate().map(|(i, v)| [*v, (i as f64 + 1.0) / count]).collect();
        phases = phases.dots(points, DotStyle { diameter: Some(1.1), ..DotStyle::plain(colour) });
        distribution = distribution.line(steps, line_of(colour));
    }
    (phases, distribution)
}

/// The exits of a rule over one period of the chatter, as (phase, y) with the phase from 0 to 1.
/// The committed starts cover a little more: the period ends where the exit is the first one again.
pub fn one_period(exits: &Table, rule: &str, wanted: f64) -> Vec<[f64; 2]> {
    let [parameter, phase, y] = ["parameter", "phase", "y"].map(|c| exits.numbers(c));
    let chosen: Vec<usize> =
        rows(exits, "rule", rule).into_iter().filter(|i| is_near(parameter[*i], wanted)).collect();
    let Some(&first) = chosen.first() else { return Vec::new() };
    let apart = |i: &usize| (y[*i] - y[first]).abs();
    let again =
        chosen.iter().filter(|i| phase[**i] > 0.8).min_by(|i, k| apart(i).total_cmp(&apart(k)));
    let period = again.map_or(1.0, |i| phase[*i]);
    chosen.into_iter().filter(|i| phase[*i] < period).map(|i| [phase[i] / period, y[i]]).collect()
}

/// The exits' y in order.
fn sorted(points: &[[f64; 2]]) -> Vec<f64> {
    let mut values: Vec<f64> = points.iter().map(|p| p[1]).collect();
    values.sort_by(f64::total_cmp);
    values
}

/// The largest distances between the distributions of exits at neighbouring parameters, in inner
/// units, the largest parameters first.
pub fn exit_gaps(exits: &Table, rule: &str) -> [f64; 3] {
    let of = DELAYS.map(|(wanted, _)| sorted(&one_period(exits, rule, wanted)));
    [0, 1, 2].map(|k| distance(&of[k], &of[k + 1]))
}

/// The committed exits.
///
/// # Errors
///
/// If they are not such as `make delay-data` writes.
pub fn exits() -> Result<Table, JobError> {
    table(DATA[1].0, DATA[1].1)
}

/// The largest distance of two distribution functions, from sorted values.
fn distance(a: &[f64], b: &[f64]) -> f64 {
    let share = |of: &[f64], v: f64| of.partition_point(|w| *w <= v) as f64 / of.len() as f64;
    a.iter().chain(b).fold(0.0, |most: f64, v| most.max((share(a, *v) - share(b, *v)).abs()))
}

/// Columns of growth, with their shapes and words.
const KINDS: [(&str, MarkerShape, &str); 3] = [
    ("across", MarkerShape::Dot, "across"),
    ("along", MarkerShape::Square, "along"),
    ("carried_in", MarkerShape::Triangle, "carried in"),
];

/// The growth of a kind, as (parameter, growth), under a rule, in the rows of which `is_meant` of
/// the ratio and the parameter.
fn growths(
    growth: &Table,
    rule: &str,
    kind: &str,
    is_meant: impl Fn(f64, f64) -> bool,
) -> Vec<(f64, f64)> {
    let [parameter, ratio, values] = ["parameter", "ratio", kind].map(|c| growth.numbers(c));
    let chosen = rows(growth, "rule", rule).into_iter();
    let chosen = chosen.filter(|i| values[*i].is_finite() && is_meant(ratio[*i], parameter[*i]));
    chosen.map(|i| (parameter[i], values[i])).collect()
}

/// The power of the parameter with which these grow, with its standard error.
fn power(points: &[(f64, f64)]) -> (f64, f64) {
    let logs: Vec<(f64, f64)> = points.iter().map(|(p, g)| (log10(*p), log10(*g))).collect();
    line(&logs).map_or((f64::NAN, f64::NAN), |line| (line.slope, line.slope_error))
}

/// The powers of growth across, along and carried in, under a sharp rule.
pub fn sharp_powers(growth: &Table, rule: &str) -> [(f64, f64); 3] {
    KINDS.map(|(kind, ..)| power(&growths(growth, rule, kind, |_, _| true)))
}

/// The same under the smooth delayed rule: for ratios in a range, and eps not above `most`. Every
/// start and ratio has a level of its own.
pub fn smooth_powers(
    growth: &Table,
    ratios: std::ops::RangeInclusive<f64>,
    most: f64,
) -> [(f64, f64); 3] {
    let (starts, all) = (growth.numbers("y0"), growth.numbers("ratio"));
    KINDS.map(|(kind, ..)| {
        let [parameter, values] = ["parameter", kind].map(|c| growth.numbers(c));
        let chosen = rows(growth, "rule", "smooth").into_iter();
        let is_meant = |i: &usize| {
            ratios.contains(&all[*i]) && parameter[*i] < 1.01 * most && values[*i].is_finite()
        };
        let mut chosen: Vec<usize> = chosen.filter(is_meant).collect();
        chosen.sort_by(|i, k| {
            (all[*i], starts[*i]).partial_cmp(&(all[*k], starts[*k])).unwrap_or(Ordering::Equal)
        });
        let mut points = Vec::new();
        for group in chosen.chunk_by(|i, k| all[*i] == all[*k] && starts[*i] == starts[*k]) {
            let mean =
                |of: &[f64]| group.iter().map(|i| log10(of[*i])).sum::<f64>() / group.len() as f64;
            let (x, y) = (mean(parameter), mean(values));
            points.extend(group.iter().map(|i| (log10(parameter[*i]) - x, log10(values[*i]) - y)));
        }
        line(&points).map_or((f64::NAN, f64::NAN), |line| (line.slope, line.slope_error))
    })
}

/// The committed growth.
///
/// # Errors
///
/// If it is not such as `make delay-data` writes.
pub fn growth() -> Result<Table, JobError> {
    table(DATA[0].0, DATA[0].1)
}

fn growth_panel(table: &Table) -> PlanePanel {
    let law = Predicted::of(-1.2, -1.4);
    let mut panel = PlanePanel::new(
        Axis::log("*δ*, or half the band", 5e-7, 2e-2),
        Axis::log("growth", 1e-2, 1e8),
    );
    for power in [law.across(), law.along(), law.carried()] {
        // The line of smoothing shows a slope, not a level: it begins at 10, or 1, at 10^-2 and
        // ends at the panel's edge.
        let log_at = |p: f64| power * (log10(p) + 2.0) + if power < 0.0 { 1.0 } else { 0.0 };
        let end = if power < 0.0 { exp10(-2.0 - 7.0 / -power) } else { 1e-6 };
        let ends = [1e-2, end].map(|p| [p, exp10(log_at(p))]);
        panel = panel.line(ends.into(), line_of(SMOOTHING).dashed());
    }
    // Small markers upon large ones: where the two rules agree, both are seen.
    for (rule, colour, size) in [("relay", HYSTERESIS, 4.0), ("sharp", SHARP, 2.2)] {
        for (kind, shape, _) in KINDS {
            let mut all = growths(table, rule, kind, |_, _| true);
            all.sort_by(|a, b| a.0.total_cmp(&b.0));
            let means = all.chunk_by(|a, b| is_near(a.0, b.0)).map(|of| {
                let logs = of.iter().map(|p| log10(p.1)).sum::<f64>();
                [of[0].0, exp10(logs / of.len() as f64)]
            });
            panel = panel.markers(means.collect(), marker(shape, colour, size));
        }
    }
    panel
}

/// Ratios delay/sqrt(eps) at which smoothing's law holds, and those at which the sharp rule's does.
pub const SMALL: std::ops::RangeInclusive<f64> = 0.0..=0.11;
/// From there on down the first of these is measured.
pub const SMALL_EPS: f64 = 3.2e-3;
/// See [`SMALL`].
pub const LARGE: std::ops::RangeInclusive<f64> = 0.99..=1.01;

fn smooth_panel(table: &Table) -> PlanePanel {
    let [parameter, ratio, along] = ["parameter", "ratio", "along"].map(|c| table.numbers(c));
    let mut panel =
        PlanePanel::new(Axis::log("*δ*/√*ε*", 2e-2, 15.0), Axis::log("growth along", 0.3, 1e9));
    for (eps, shape) in LAYERS {
        let chosen = rows(table, "rule", "smooth").into_iter();
        let chosen = chosen.filter(|i| is_near(parameter[*i], eps) && along[*i].is_finite());
        let points = chosen.map(|i| [ratio[i], along[i]]).collect();
        panel = panel.markers(points, marker(shape, SMOOTH, 3.2));
    }
    panel
}

/// The figure's specification.
pub fn figure() -> Figure {
    let picture = Picture {
        name: "delay".into(),
        reading: None,
        title: "A switch that acts late".into(),
        caption: "(a) One passage of the two-fold under smoothing, hysteresis, sharp and smooth \
                  delay, and (b) x during it. (c–f) Late sections y = 0 under the hysteresis of \
                  fig. 9(i) and under a sharp delay of the same eps, in both readings. (g) Where \
                  the two-fold is left under the sharp delay by the phase of the chatter, in \
                  delays, and (h) the distribution over phases as the delay falls. (i) Growth of a \
                  disturbance in a passage under sharp delay and sharp hysteresis (f+ until x \
                  falls to -b, f- until it rises to b) beside smoothing's powers, and (j) under \
                  smooth delay from one law to the other."
            .into(),
        view: View::Study(Study { questions, draw }),
        panels: Vec::new(),
        alterations: Vec::new(),
    };
    Figure { id: "delay".into(), title: "A switch that acts late".into(), pictures: vec![picture] }
}
