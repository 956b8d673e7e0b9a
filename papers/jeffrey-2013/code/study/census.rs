//! The census: the frequency of each outcome of a panel of figs 7 and 8 among runs whose starts
//! differ by less than a reader could see, and what follows for the paper's claims. Rules:
//! [`claims`](super::claims).

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::claims::Rules;
use crate::Reading;
use twofold_analyse::counts::{Homogeneity, goodman, homogeneity, wilson};
use twofold_job::record::Manifest;
use twofold_job::table::{Column, Entry, Table};
use twofold_num::random::RandomStream;

/// The kind of motion of a run at a given time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MotionKind {
    /// Captured by a closed orbit of one return.
    PeriodOne,
    /// Captured by a closed orbit of three returns.
    PeriodThree,
    /// Captured by another closed orbit, or regular without one.
    OtherRegular,
    /// Irregular until then.
    Irregular,
    /// On its way to the far state.
    Far,
    /// Undecided, or failed.
    Undecided,
}

impl MotionKind {
    /// All kinds.
    pub const ALL: [MotionKind; 6] = [
        MotionKind::PeriodOne,
        MotionKind::PeriodThree,
        MotionKind::OtherRegular,
        MotionKind::Irregular,
        MotionKind::Far,
        MotionKind::Undecided,
    ];

    /// For tables and legends.
    pub fn words(self) -> &'static str {
        match self {
            MotionKind::PeriodOne => "period one",
            MotionKind::PeriodThree => "period three",
            MotionKind::OtherRegular => "other regular",
            MotionKind::Irregular => "irregular",
            MotionKind::Far => "far",
            MotionKind::Undecided => "undecided",
        }
    }
}

/// The paper's claim about a panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Said {
    /// A periodic orbit, of whatever period.
    Periodic,
    /// A period-three orbit.
    PeriodThree,
    /// Chaos.
    Chaos,
}

impl Said {
    /// The claim in a word.
    pub fn words(self) -> &'static str {
        match self {
            Said::Periodic => "periodic",
            Said::PeriodThree => "period three",
            Said::Chaos => "chaos",
        }
    }
}

/// A panel: its name, the paper's claim, and the rows of a sweep that are its runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CensusPanel {
    /// "7(i)".
    pub name: &'static str,
    /// The claim.
    pub said: Said,
    /// The column that sets it apart from the other panels of its sweep, and its value there;
    /// `None` if the sweep is of this panel alone.
    pub column: Option<(&'static str, f64)>,
}

impl CensusPanel {
    /// The runs of the panel in a sweep's table, among those in which every column of `chosen` has
    /// its value.
    pub fn runs(&self, table: &Table, mut chosen: Vec<(&str, Entry)>) -> Vec<CensusRun> {
        chosen.extend(self.column.map(|(name, value)| (name, Entry::Number(value))));
        runs(table, &chosen)
    }
}

/// Figs 7 and 8.
pub const PANELS: [CensusPanel; 6] = [
    CensusPanel { name: "7(i)", said: Said::Periodic, column: Some(("interval", 20.0)) },
    CensusPanel { name: "7(ii)", said: Said::PeriodThree, column: Some(("interval", 40.0)) },
    CensusPanel { name: "7(iii)", said: Said::Chaos, column: Some(("interval", 100.0)) },
    CensusPanel { name: "8(i)", said: Said::Chaos, column: Some(("sigma", 0.01)) },
    CensusPanel { name: "8(ii)", said: Said::Periodic, column: Some(("sigma", 0.1)) },
    CensusPanel { name: "8(iii)", said: Said::Periodic, column: Some(("sigma", 0.13)) },
];

/// One finished run of a panel.
#[derive(Clone, Debug, PartialEq)]
pub struct CensusRun {
    /// The row's outcome, in the sweep's words.
    pub outcome: String,
    /// Period of the closed orbit, 0 without one.
    pub period: i64,
    /// When it was captured.
    pub captured_at: f64,
}

impl CensusRun {
    /// The kind of motion at time `t`: regular once captured, irregular before. Regular motion
    /// without a time of capture counts as regular from the start.
    pub fn kind(&self, t: f64) -> MotionKind {
        let later = self.captured_at > t;
        match self.outcome.as_str() {
            "irregular" => MotionKind::Irregular,
            "far" if later => MotionKind::Irregular,
            "far" => MotionKind::Far,
            "failed" | "undecided" | "too-few" | "escaped" | "rest" => MotionKind::Undecided,
            _ if later => MotionKind::Irregular,
            "period-1" => MotionKind::PeriodOne,
            "period-3" => MotionKind::PeriodThree,
            _ => MotionKind::OtherRegular,
        }
    }

    /// When a closed orbit, or the far state, captured it. A ring is no closed orbit.
    pub fn captured(&self) -> Option<f64> {
        (self.captured_at.is_finite() && self.outcome != "quasi-periodic")
            .then_some(self.captured_at)
    }
}

/// The runs of a sweep's table in which every column of `chosen` has its value.
pub fn runs(table: &Table, chosen: &[(&str, Entry)]) -> Vec<CensusRun> {
    let columns: Option<Vec<(&Column, &Entry)>> =
        chosen.iter().map(|(name, v)| Some((table.column(name)?, v))).collect();
    let (Some(columns), Some(outcomes), Some(periods), Some(captured)) =
        (columns, table.column("outcome"), table.column("period"), table.column("captured_at"))
    else {
        return Vec::new();
    };
    (0..table.len())
        .filter(|row| columns.iter().all(|(c, v)| c.get(*row) == **v))
        .map(|row| CensusRun {
            outcome: outcomes.get(row).word().to_owned(),
            period: periods.get(row).value() as i64,
            captured_at: captured.get(row).value(),
        })
        .collect()
}

/// The number of runs of each kind at time `t`, in the order of [`MotionKind::ALL`].
pub fn tally(runs: &[CensusRun], t: f64) -> [u64; 6] {
    MotionKind::ALL.map(|kind| runs.iter().filter(|r| r.kind(t) == kind).count() as u64)
}

/// Number of runs that support a claim: periodic from `shown_from` on, or irregular to the end.
pub fn supporting(said: Said, runs: &[CensusRun], rules: &Rules) -> u64 {
    let is = |run: &&CensusRun| match said {
        Said::Periodic => {
            run.kind(rules.shown_from) != MotionKind::Irregular
                && run.outcome == format!("period-{}", run.period)
        }
        Said::PeriodThree => run.kind(rules.shown_from) == MotionKind::PeriodThree,
        Said::Chaos => run.kind(rules.end) == MotionKind::Irregular,
    };
    runs.iter().filter(is).count() as u64
}

/// The share of runs that is captured by time `t`, as a step function: (time, share) at every
/// capture.
pub fn captures(runs: &[CensusRun], of: impl Fn(&CensusRun) -> bool) -> Vec<[f64; 2]> {
    let mut times: Vec<f64> =
        runs.iter().filter(|r| of(r)).filter_map(CensusRun::captured).collect();
    times.sort_by(f64::total_cmp);
    let n = runs.len().max(1) as f64;
    times.iter().enumerate().map(|(i, t)| [*t, (i + 1) as f64 / n]).collect()
}

/// A panel's result: the share of its runs that support the paper's claim.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PanelShare {
    /// "7(i)".
    pub panel: String,
    /// The reading.
    pub reading: Reading,
    /// The paper's statement.
    pub said: Said,
    /// Runs.
    pub runs: u64,
    /// Number of runs that support it.
    pub hits: u64,
    /// Interval of their share (Wilson).
    pub interval: [f64; 2],
    /// Kinds at `shown_from`, in the order of [`MotionKind::ALL`].
    pub at_shown: [u64; 6],
    /// Kinds at the end.
    pub at_end: [u64; 6],
    /// Simultaneous intervals of the shares at the end (Goodman).
    pub intervals_at_end: Vec<[f64; 2]>,
    /// Quartiles of the capture times of the runs that were captured; not-a-number without any.
    pub capture_quartiles: [f64; 3],
}

/// A panel's runs, judged.
pub fn share(
    panel: &CensusPanel,
    reading: Reading,
    runs: &[CensusRun],
    rules: &Rules,
) -> PanelShare {
    let hits = supporting(panel.said, runs, rules);
    let at_end = tally(runs, rules.end);
    let captured: Vec<f64> = captures(runs, |_| true).iter().map(|p| p[0]).collect();
    let quartile =
        |q: usize| captured.get((captured.len() * q / 4).min(captured.len().saturating_sub(1)));
    PanelShare {
        panel: panel.name.to_owned(),
        reading,
        said: panel.said,
        runs: runs.len() as u64,
        hits,
        interval: wilson(hits, runs.len() as u64, rules.confidence),
        at_shown: tally(runs, rules.shown_from),
        at_end,
        intervals_at_end: goodman(&at_end, rules.confidence),
        capture_quartiles: [1, 2, 3].map(|q| quartile(q).copied().unwrap_or(f64::NAN)),
    }
}

/// Tests whether groups of runs have the same distribution of outcomes at the end.
pub fn same_odds(groups: &[Vec<CensusRun>], rules: &Rules) -> Homogeneity {
    let rows: Vec<Vec<u64>> = groups.iter().map(|g| tally(g, rules.end).to_vec()).collect();
    homogeneity(&rows, rules.permutations, rules.permutation_seed)
}

/// A probability with its credible interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Probability {
    /// Posterior mean.
    pub mean: f64,
    /// Ends of the central interval.
    pub interval: [f64; 2],
}

/// Joint probabilities of the panels of a figure, one independent run each.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Together {
    /// All three outcomes as the paper has them.
    pub as_claimed: Probability,
    /// Not all three runs have the same outcome: "settles to different attractors".
    pub differ: Probability,
    /// Some run is periodic from `shown_from` on, and some irregular to the end: "jumps between
    /// regimes".
    pub both_regimes: Probability,
}

/// Draws from the posterior of shares.
const POSTERIOR_DRAWS: usize = 20_000;

/// The panels of one figure and reading together. Shares have the posterior that Jeffreys' prior
/// gives (Dirichlet with 1/2 for each of the kinds at the end, and Beta with 1/2 for what is
/// claimed); panels are independent.
pub fn together(panels: &[PanelShare], rules: &Rules) -> Together {
    let mut random = RandomStream::new(rules.permutation_seed, 1);
    let (mut claimed, mut differ, mut both) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..POSTERIOR_DRAWS {
        let (mut product, mut none_irregular, mut none_periodic, mut neither) =
            (1.0, 1.0, 1.0, 1.0);
        let mut same = [1.0; 6];
        for panel in panels {
            let shares = dirichlet(&panel.at_end.map(|n| n as f64 + 0.5), &mut random);
            // In the order of Kind::ALL.
            for (same, share) in same.iter_mut().zip(&shares) {
                *same *= share;
            }
            let hits = [panel.hits as f64 + 0.5, (panel.runs - panel.hits) as f64 + 0.5];
            product *= dirichlet(&hits, &mut random)[0];
            let (irregular, periodic) = (shares[3], shares[0] + shares[1]);
            none_irregular *= 1.0 - irregular;
            none_periodic *= 1.0 - periodic;
            neither *= (1.0 - irregular - periodic).max(0.0);
        }
        claimed.push(product);
        differ.push(1.0 - same.iter().sum::<f64>());
        both.push(1.0 - none_irregular - none_periodic + neither);
    }
    let summary = |mut values: Vec<f64>| {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.sort_by(f64::total_cmp);
        let tail = 0.5 * (1.0 - rules.confidence);
        let at = |q: f64| values[((values.len() - 1) as f64 * q) as usize];
        Probability { mean, interval: [at(tail), at(1.0 - tail)] }
    };
    Together { as_claimed: summary(claimed), differ: summary(differ), both_regimes: summary(both) }
}

/// A draw from a Dirichlet distribution: gamma variates over their sum.
pub(super) fn dirichlet<const N: usize>(weights: &[f64; N], random: &mut RandomStream) -> [f64; N] {
    let variates = weights.map(|w| gamma(w, random));
    let sum: f64 = variates.iter().sum();
    variates.map(|v| v / sum)
}

/// A gamma variate (Marsaglia & Tsang 2000, ACM Trans. Math. Softw. 26, 363), for shapes below 1 by
/// their boost.
fn gamma(shape: f64, random: &mut RandomStream) -> f64 {
    use twofold_num::elementary::{exp, ln, sqrt};
    if shape < 1.0 {
        let u = 1.0 - random.uniform();
        return gamma(shape + 1.0, random) * exp(ln(u) / shape);
    }
    let d = shape - 1.0 / 3.0;
    let c = 1.0 / sqrt(9.0 * d);
    loop {
        let x = random.normal();
        let v = 1.0 + c * x;
        if v <= 0.0 {
            continue;
        }
        let v = v * v * v;
        let u = 1.0 - random.uniform();
        if ln(u) < 0.5 * x * x + d - d * v + d * ln(v) {
            return d * v;
        }
    }
}

/// Panels' shares as a table.
pub fn panel_table(shares: &[PanelShare]) -> Table {
    let mut columns = vec![
        Column::words("reading"),
        Column::words("panel"),
        Column::words("claim"),
        Column::integers("runs"),
        Column::integers("hits"),
    ];
    columns.extend(["share", "low", "high"].map(Column::numbers));
    for at in ["shown", "end"] {
        columns.extend(
            MotionKind::ALL
                .map(|k| Column::integers(&format!("{} at {at}", k.words()).replace(' ', "_"))),
        );
    }
    let bounds = |k: MotionKind| {
        ["low", "high"].map(|e| format!("{} at end {e}", k.words()).replace(' ', "_"))
    };
    columns.extend(MotionKind::ALL.into_iter().flat_map(bounds).map(|name| Column::numbers(&name)));
    columns.extend(["capture_q1", "capture_median", "capture_q3"].map(Column::numbers));
    let mut table = Table::new("census", columns);
    for s in shares {
        let whole = |v: u64| Entry::Integer(v as i64);
        let mut row: Vec<Entry> = vec![
            s.reading.word().into(),
            s.panel.as_str().into(),
            s.said.words().into(),
            whole(s.runs),
            whole(s.hits),
        ];
        row.extend(
            [s.hits as f64 / s.runs as f64, s.interval[0], s.interval[1]].map(Entry::Number),
        );
        row.extend(s.at_shown.iter().chain(&s.at_end).map(|v| whole(*v)));
        row.extend(s.intervals_at_end.iter().flatten().map(|v| Entry::Number(*v)));
        row.extend(s.capture_quartiles.map(Entry::Number));
        table.push(row);
    }
    table
}

/// Groups of a table's runs by the values of a column, in order of first appearance.
pub fn grouped(
    table: &Table,
    column: &str,
    chosen: &[(&str, Entry)],
) -> Vec<(Entry, Vec<CensusRun>)> {
    let Some(values) = table.column(column) else { return Vec::new() };
    let mut order: Vec<Entry> = Vec::new();
    for row in 0..table.len() {
        let value = values.get(row);
        if !order.contains(&value) {
            order.push(value);
        }
    }
    order
        .into_iter()
        .map(|value| {
            let all: Vec<(&str, Entry)> =
                chosen.iter().cloned().chain([(column, value.clone())]).collect();
            (value, runs(table, &all))
        })
        .collect()
}

/// The census' sweeps, as tables.
#[derive(Clone, Debug)]
pub struct Data {
    /// Fig. 7's intervals.
    pub fig7: Table,
    /// Fig. 8's sigmas.
    pub fig8: Table,
    /// Fig. 7(iii) by other methods, in any number of parts.
    pub methods: Vec<Table>,
    /// Fig. 7(iii) by one method at other tolerances, in any number of parts.
    pub tolerances: Vec<Table>,
    /// Fig. 7(iii) to a shorter time, with small and with ordinary local errors.
    pub shorter: Vec<Shorter>,
}

/// Runs of fig. 7(iii) that were not followed to its end.
#[derive(Clone, Debug)]
pub struct Shorter {
    /// The method.
    pub name: &'static str,
    /// The end time.
    pub end: f64,
    /// The rows.
    pub table: Table,
}

/// Results of the census in one reading.
#[derive(Clone, Debug, PartialEq)]
pub struct Found {
    /// The reading.
    pub reading: Reading,
    /// Panels' shares, in order.
    pub shares: Vec<PanelShare>,
    /// Panels' capture curves, in order.
    pub captures: Vec<Vec<[f64; 2]>>,
    /// Tests of homogeneity: the groups, and the result.
    pub tests: Vec<(&'static str, Homogeneity)>,
    /// Fig. 7's and fig. 8's panels together.
    pub together: [Together; 2],
    /// Kinds at the end by method and by tolerance, with their names.
    pub ways: Vec<(String, [u64; 6])>,
    /// Kinds of runs that were not followed to the end: method, end time, counts.
    pub shorter: Vec<(String, f64, [u64; 6])>,
    /// Support of each panel's claim under other limits, in the order of [`LIMITS`].
    pub influence: Vec<[u64; 5]>,
}

/// Names of the tests in [`Found::tests`].
pub const TESTS: [&str; 7] = [
    "intervals 20, 40, 100",
    "sigma 0.01, 0.1, 0.13",
    "all six panels",
    "methods",
    "tolerances",
    "tolerances below 1e-6",
    "ordinary and small local errors",
];

/// Limits by which a claim may be judged: the rules', and others.
pub const LIMITS: [&str; 5] = [
    "as ruled",
    "periodic from 5e4 on",
    "periodic from 1.5e5 on",
    "chaos until 1e5 is enough",
    "undecided is chaos",
];

/// Number of a panel's runs that support the claim, for each limit in [`LIMITS`].
pub fn influence(said: Said, runs: &[CensusRun], rules: &Rules) -> [u64; 5] {
    let from = |shown_from: f64| supporting(said, runs, &Rules { shown_from, ..*rules });
    let undecided = if said == Said::Chaos { tally(runs, rules.end)[5] } else { 0 };
    [
        supporting(said, runs, rules),
        from(0.5 * rules.shown_from),
        from(1.5 * rules.shown_from),
        supporting(said, runs, &Rules { end: rules.shown_from, ..*rules }),
        supporting(said, runs, rules) + undecided,
    ]
}

impl Found {
    /// Evaluates the sweeps.
    pub fn of(reading: Reading, data: &Data, rules: &Rules) -> Self {
        let alpha = Entry::Number(reading.caricature().alpha);
        let (mut shares, mut captured, mut groups, mut influences) =
            (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for (i, panel) in PANELS.iter().enumerate() {
            let runs =
                panel.runs([&data.fig7, &data.fig8][i / 3], vec![("params.alpha", alpha.clone())]);
            shares.push(share(panel, reading, &runs, rules));
            captured.push(captures(&runs, |_| true));
            influences.push(influence(panel.said, &runs, rules));
            groups.push(runs);
        }
        let chosen = [("params.alpha", alpha)];
        let in_parts = |parts: &[Table], column: &str| -> Vec<(Entry, Vec<CensusRun>)> {
            let groups = parts.iter().flat_map(|part| grouped(part, column, &chosen));
            let mut groups: Vec<_> = groups.filter(|(_, runs)| !runs.is_empty()).collect();
            if column == "tolerance" {
                groups.sort_by(|a, b| b.0.value().total_cmp(&a.0.value()));
            }
            groups
        };
        let mut by_method = in_parts(&data.methods, "method");
        by_method.insert(0, ("lsoda".into(), groups[2].clone()));
        let by_tolerance = in_parts(&data.tolerances, "tolerance");
        let below: Vec<_> = by_tolerance
            .iter()
            .filter(|(tolerance, _)| tolerance.value() < 1e-6)
            .cloned()
            .collect();
        let shorter: Vec<(&Shorter, Vec<CensusRun>)> = data
            .shorter
            .iter()
            .map(|s| (s, runs(&s.table, &chosen)))
            .filter(|(_, runs)| !runs.is_empty())
            .collect();
        let only = |g: &[(Entry, Vec<CensusRun>)]| {
            g.iter().map(|(_, runs)| runs.clone()).collect::<Vec<_>>()
        };
        let between = [
            groups[..3].to_vec(),
            groups[3..].to_vec(),
            groups.clone(),
            only(&by_method),
            only(&by_tolerance),
            only(&below),
            shorter.iter().map(|(_, runs)| runs.clone()).collect(),
        ];
        let tests = TESTS
            .into_iter()
            .zip(between)
            .map(|(name, groups)| (name, same_odds(&groups, rules)))
            .collect();
        let ways = by_method
            .iter()
            .chain(&by_tolerance)
            .map(|(value, runs)| {
                let name = match value {
                    Entry::Word(w) => w.clone(),
                    other => format!("{:e}", other.value()),
                };
                (name, tally(runs, rules.end))
            })
            .collect();
        let shorter = shorter
            .into_iter()
            .map(|(s, runs)| (s.name.to_owned(), s.end, tally(&runs, s.end)))
            .collect();
        let together = [together(&shares[..3], rules), together(&shares[3..], rules)];
        Self {
            reading,
            shares,
            captures: captured,
            tests,
            together,
            ways,
            shorter,
            influence: influences,
        }
    }

    /// As tables: panels, tests and figures together, capture curves, methods and tolerances,
    /// shorter runs.
    pub fn tables(&self) -> Vec<Table> {
        let mut curves = Table::new(
            "captures",
            [Column::words("panel"), Column::numbers("t"), Column::numbers("share")],
        );
        for (panel, points) in self.shares.iter().zip(&self.captures) {
            for [t, share] in points {
                curves.push([panel.panel.as_str().into(), (*t).into(), (*share).into()]);
            }
        }
        let names = ["value", "low", "high", "p_permutation", "p_asymptotic"].map(Column::numbers);
        let mut found = Table::new("tests", [Column::words("what")].into_iter().chain(names));
        let blank = f64::NAN;
        for (what, h) in &self.tests {
            // Without a second group or a second outcome there is nothing to test.
            let [permuted, asymptotic] =
                [h.p_permutation, h.p_asymptotic].map(|p| if h.freedom > 0 { p } else { blank });
            found.push(
                [Entry::from(*what)]
                    .into_iter()
                    .chain([h.chi_square, blank, blank, permuted, asymptotic].map(Entry::Number)),
            );
        }
        for (figure, together) in ["7", "8"].iter().zip(&self.together) {
            for (what, p) in [
                ("all as claimed", together.as_claimed),
                ("not all the same", together.differ),
                ("both regimes", together.both_regimes),
            ] {
                let what = format!("fig. {figure}: {what}");
                found.push([Entry::Word(what)].into_iter().chain(
                    [p.mean, p.interval[0], p.interval[1], blank, blank].map(Entry::Number),
                ));
            }
        }
        let kinds = || MotionKind::ALL.map(|k| Column::integers(&k.words().replace(' ', "_")));
        let mut ways = Table::new("ways", [Column::words("group")].into_iter().chain(kinds()));
        for (name, counts) in &self.ways {
            ways.push(
                [Entry::Word(name.clone())]
                    .into_iter()
                    .chain(counts.map(|n| Entry::Integer(n as i64))),
            );
        }
        let mut shorter = Table::new(
            "shorter",
            [Column::words("group"), Column::numbers("t")].into_iter().chain(kinds()),
        );
        for (name, end, counts) in &self.shorter {
            let head = [Entry::Word(name.clone()), Entry::Number(*end)];
            shorter.push(head.into_iter().chain(counts.map(|n| Entry::Integer(n as i64))));
        }
        vec![panel_table(&self.shares), found, curves, ways, shorter]
    }
}

/// Stands before the text about the census in docs/census.md.
pub const BEGIN: &str =
    "<!-- census: what code/census says; tests/it/census.rs compares it; do not edit -->";
/// Stands after it.
pub const END: &str = "<!-- end of census -->";

/// "p = 0.012", or "p < 0.001"; not-a-number where there was nothing to test.
pub fn p_in_words(p: f64) -> String {
    if p.is_nan() {
        "all alike".to_owned()
    } else if p < 0.001 {
        "p < 0.001".to_owned()
    } else {
        format!("p = {p:.3}")
    }
}

pub(super) fn percent(share: f64, interval: [f64; 2]) -> String {
    format!("{:.0} % [{:.0}, {:.0}]", 100.0 * share, 100.0 * interval[0], 100.0 * interval[1])
}

/// The text about the census in docs/census.md: the table of shares, the figures as groups, the
/// tests. `reference` has the committed manifest of each figure, as text.
pub fn text(found: &[Found; 2], reference: impl Fn(&str) -> Option<&'static str>) -> String {
    use std::fmt::Write as _;
    let mut text = String::from(
        "| panel | the paper says | printed reading | reconstructed reading |\n|---|---|---|---|\n",
    );
    let [printed, reconstructed] = found;
    // Writing to a String cannot fail.
    for (a, b) in printed.shares.iter().zip(&reconstructed.shares) {
        let cell = |s: &PanelShare| {
            // Not captured, and not shown to be chaotic: whether they count is said, not decided.
            let open = if s.said == Said::Chaos { s.at_end[5] } else { 0 };
            let more = if open > 0 { format!(", {open} more undecided") } else { String::new() };
            let single = match single_run(s.panel.as_str(), s.reading, &reference) {
                Some(true) => "; the figure's run agrees",
                Some(false) => "; the figure's run differs",
                None => "",
            };
            let share = percent(s.hits as f64 / s.runs.max(1) as f64, s.interval);
            format!("{share}, {} of {}{more}{single}", s.hits, s.runs)
        };
        let _ = writeln!(text, "| {} | {} | {} | {} |", a.panel, a.said.words(), cell(a), cell(b));
    }
    let group = |f: fn(&Together) -> Probability, i: usize| {
        found
            .iter()
            .map(|one| f(&one.together[i]))
            .map(|p| percent(p.mean, p.interval))
            .collect::<Vec<_>>()
    };
    for (i, figure) in ["7", "8"].iter().enumerate() {
        let (all, differ) = (group(|t| t.as_claimed, i), group(|t| t.differ, i));
        let _ =
            writeln!(text, "| fig. {figure}, three runs | all as said | {} | {} |", all[0], all[1]);
        let _ = writeln!(text, "| | different attractors | {} | {} |", differ[0], differ[1]);
    }
    let kinds = MotionKind::ALL.map(MotionKind::words).join(" | ");
    let numbers = |n: &[u64; 6]| n.map(|n| n.to_string()).join(" | ");
    // A paragraph before a table, and the table's head.
    let begin = |text: &mut String, what: &str, first: &str| {
        let columns = first.matches('|').count() + 1 + MotionKind::ALL.len();
        let _ = writeln!(text, "\n{what}\n\n| {first} | {kinds} |\n|{}", "---|".repeat(columns));
    };
    begin(&mut text, "Where runs end, at t = 2·10⁵:", "reading | panel");
    for one in found {
        for s in &one.shares {
            let _ =
                writeln!(text, "| {} | {} | {} |", one.reading.word(), s.panel, numbers(&s.at_end));
        }
    }
    begin(
        &mut text,
        "Where runs with interval 100 end, by method, and by Dormand-Prince at other tolerances:",
        "reading | method or tolerance",
    );
    for one in found {
        for (name, n) in &one.ways {
            let _ = writeln!(text, "| {} | {name} | {} |", one.reading.word(), numbers(n));
        }
    }
    begin(
        &mut text,
        "Shorter runs: the share seen to be captured by their end, and where they are then:",
        "reading | method | until | captured",
    );
    for one in found {
        for (name, end, n) in &one.shorter {
            let of = n.iter().sum();
            let captured = of - n[3] - n[5];
            let share = percent(captured as f64 / of as f64, wilson(captured, of, 0.95));
            let reading = one.reading.word();
            let _ = writeln!(text, "| {reading} | {name} | {end} | {share} | {} |", numbers(n));
        }
    }
    let _ = writeln!(
        text,
        "\nWhether groups have the same odds, by permutation tests:\n\n| groups | printed reading \
            | reconstructed reading |\n|---|---|---|"
    );
    for ((name, a), (_, b)) in printed.tests.iter().zip(&reconstructed.tests) {
        let said = |h: &Homogeneity| {
            if h.freedom > 0 { p_in_words(h.p_permutation) } else { "one outcome only".to_owned() }
        };
        let _ = writeln!(text, "| {name} | {} | {} |", said(a), said(b));
    }
    text
}

/// Whether the one run that a panel shows supports the claim, by the committed reference of its
/// figure.
fn single_run(
    panel: &str,
    reading: Reading,
    reference: impl Fn(&str) -> Option<&'static str>,
) -> Option<bool> {
    let (figure, label) = panel.trim_end_matches(')').split_once('(')?;
    let id = format!("fig{figure}");
    let manifest = Manifest::parse(reference(&id)?, &id).ok()?;
    let picture = manifest.picture(&format!("{id}-{}", reading.word()))?;
    Some(picture.panels.iter().find(|p| p.label == label)?.verdict.as_ref()?.agrees)
}

/// Stands before the text about other limits in docs/census-sweeps.md.
pub const LIMITS_BEGIN: &str =
    "<!-- limits: what code/census says; tests/it/census.rs compares it; do not edit -->";
/// Stands after it.
pub const LIMITS_END: &str = "<!-- end of limits -->";

/// Support of the claims under other limits, as a table.
pub fn limits_text(found: &[Found; 2]) -> String {
    use std::fmt::Write as _;
    let mut text = format!(
        "| panel | reading | runs | {} |\n|---|---|---|{}",
        LIMITS.join(" | "),
        "---|".repeat(5)
    );
    for one in found {
        for (share, counts) in one.shares.iter().zip(&one.influence) {
            let counts: Vec<String> = counts.iter().map(u64::to_string).collect();
            // Writing to a String cannot fail.
            let _ = write!(
                text,
                "\n| {} {} | {} | {} | {} |",
                share.panel,
                share.said.words(),
                one.reading.word(),
                share.runs,
                counts.join(" | ")
            );
        }
    }
    text
}

/// Counts by kind, for texts: "12 period one, 3 irregular".
pub fn in_words(counts: &[u64; 6]) -> String {
    let said: BTreeMap<usize, String> = MotionKind::ALL
        .iter()
        .enumerate()
        .filter(|(i, _)| counts[*i] > 0)
        .map(|(i, k)| (i, format!("{} {}", counts[i], k.words())))
        .collect();
    said.into_values().collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::super::claims::claims;
    use super::*;

    fn run(outcome: &str, period: i64, captured_at: f64) -> CensusRun {
        CensusRun { outcome: outcome.into(), period, captured_at }
    }

    #[test]
    fn what_a_run_is_depends_on_when_it_is_looked_at() {
        let late = run("period-3", 3, 1.5e5);
        assert_eq!(
            (late.kind(1e5), late.kind(2e5)),
            (MotionKind::Irregular, MotionKind::PeriodThree)
        );
        assert_eq!(run("quasi-periodic", 3, 5.0).kind(1e5), MotionKind::OtherRegular);
        assert_eq!(run("period-18", 18, 5.0).kind(1e5), MotionKind::OtherRegular);
        assert_eq!(run("irregular", 0, f64::NAN).kind(2e5), MotionKind::Irregular);
        assert_eq!(run("failed", 0, f64::NAN).kind(2e5), MotionKind::Undecided);
        assert_eq!(
            (run("far", 0, 30.0).kind(10.0), run("far", 0, 30.0).kind(1e5)),
            (MotionKind::Irregular, MotionKind::Far)
        );
    }

    #[test]
    fn sentences_are_borne_out_as_the_rules_say() {
        let rules = claims().rules;
        let runs = [
            run("period-1", 1, 10.0),
            run("period-3", 3, 9e4),
            run("period-18", 18, 10.0),
            run("period-3", 3, 1.1e5),
            run("quasi-periodic", 3, 10.0),
            run("leaving-period-1", 1, 10.0),
            run("irregular", 0, f64::NAN),
        ];
        // Period three is periodic; captured too late, rings and orbits that leave are not.
        assert_eq!(supporting(Said::Periodic, &runs, &rules), 3);
        assert_eq!(supporting(Said::PeriodThree, &runs, &rules), 1);
        assert_eq!(supporting(Said::Chaos, &runs, &rules), 1);
        assert_eq!(tally(&runs, rules.end), [1, 2, 3, 1, 0, 0]);
    }

    #[test]
    fn gamma_variates_have_their_moments() {
        let mut random = RandomStream::new(3, 0);
        for shape in [0.5, 1.0, 7.5] {
            let values: Vec<f64> = (0..20_000).map(|_| gamma(shape, &mut random)).collect();
            let (mean, error) = twofold_num::fit::mean(&values);
            assert!((mean - shape).abs() < 5.0 * error, "{shape}: {mean} +- {error}");
        }
    }

    #[test]
    fn panels_together() {
        let rules = claims().rules;
        let panel = |at_end: [u64; 6], hits| PanelShare {
            panel: "x".into(),
            reading: Reading::Printed,
            said: Said::Periodic,
            runs: at_end.iter().sum(),
            hits,
            interval: [0.0, 1.0],
            at_shown: at_end,
            at_end,
            intervals_at_end: Vec::new(),
            capture_quartiles: [0.0; 3],
        };
        // All on one orbit: they do not differ.
        let same = together(
            &[panel([3000, 0, 0, 0, 0, 0], 3000), panel([3000, 0, 0, 0, 0, 0], 0)],
            &rules,
        );
        assert!(
            same.differ.mean < 0.01
                && same.as_claimed.mean < 0.001
                && same.both_regimes.mean < 0.01,
            "{same:?}"
        );
        // A fair coin each, three times: 1 - 2/8.
        let fair = [500, 0, 0, 500, 0, 0];
        let coins = together(&[panel(fair, 500), panel(fair, 500), panel(fair, 500)], &rules);
        assert!((coins.differ.mean - 0.75).abs() < 0.01, "{coins:?}");
        assert!(
            (coins.both_regimes.mean - 0.75).abs() < 0.01
                && (coins.as_claimed.mean - 0.125).abs() < 0.01
        );
        assert!(
            coins.differ.interval[0] < coins.differ.mean
                && coins.differ.mean < coins.differ.interval[1],
            "{coins:?}"
        );
    }
}
