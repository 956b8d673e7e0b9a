//! Results of resolved, by its rules: the outcomes of figs 7 and 8 that occur in runs which
//! resolve the passage of the singularity, and those that occur only under LSODA. Writes the tables
//! of docs/resolved.md.

use std::fmt::Write as _;

use super::capture::time;
use super::census::{
    self, CensusPanel, CensusRun, MotionKind, PANELS, p_in_words, percent, supporting, tally,
};
use super::claims::Rules;
use super::effects::{self, LogRank};
use crate::Reading;
use twofold_analyse::counts::{homogeneity, wilson};
use twofold_job::table::{Entry, Table};

/// Stands before each text in docs/resolved.md.
pub const BEGIN: &str =
    "<!-- resolved: what code/resolved says; tests/it/resolved.rs compares it; do not edit -->";
/// Stands after it.
pub const END: &str = "<!-- end of resolved -->";

/// Runs of a panel by two methods.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The reading.
    pub reading: Reading,
    /// The panel.
    pub panel: CensusPanel,
    /// Runs of the method that the other is compared with.
    pub reference: Vec<CensusRun>,
    /// Runs of the other.
    pub runs: Vec<CensusRun>,
}

/// Every panel in both readings: `reference` and `runs` are sweeps of fig. 7, and of fig. 8 if
/// there are two.
pub fn compared(reference: &[Table], runs: &[Table]) -> Vec<Compared> {
    let of = |reading: Reading| {
        let chosen = move || vec![("params.alpha", Entry::Number(reading.caricature().alpha))];
        let panels = PANELS.iter().enumerate().filter(|(i, _)| i / 3 < runs.len());
        panels.map(move |(i, panel)| Compared {
            reading,
            panel: *panel,
            reference: panel.runs(&reference[i / 3], chosen()),
            runs: panel.runs(&runs[i / 3], chosen()),
        })
    };
    Reading::ALL.into_iter().flat_map(of).collect()
}

/// Attribution of an outcome: to the system, or to the method.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Belongs {
    /// Resolved runs show it as often as LSODA's, as far as a test tells.
    System,
    /// They show it, but not as often.
    OtherOdds,
    /// None of them shows it, and a test tells them apart from LSODA's.
    Method,
    /// None of them shows it, and no test tells them apart from LSODA's.
    Open,
    /// No run shows it.
    Neither,
}

impl Belongs {
    /// By the rule: `[hits, of]` by LSODA and by runs that resolve the passage, and the probability
    /// of so large a difference.
    pub fn of(lsoda: [u64; 2], resolved: [u64; 2], p: f64, rules: &Rules) -> Self {
        match (resolved[0] > 0, lsoda[0] > 0, p < rules.significance) {
            (true, _, false) => Belongs::System,
            (true, _, true) => Belongs::OtherOdds,
            (false, true, true) => Belongs::Method,
            (false, true, false) => Belongs::Open,
            (false, false, _) => Belongs::Neither,
        }
    }

    /// For tables.
    pub fn words(self) -> &'static str {
        match self {
            Belongs::System => "the system's, with these odds",
            Belongs::OtherOdds => "the system's, with other odds",
            Belongs::Method => "the method's",
            Belongs::Open => "open",
            Belongs::Neither => "of neither",
        }
    }
}

/// Runs that show the panel's outcome, and all.
fn shown(panel: &CensusPanel, runs: &[CensusRun], rules: &Rules) -> [u64; 2] {
    [supporting(panel.said, runs, rules), runs.len() as u64]
}

/// Each panel's outcome by both methods, and its attribution.
pub fn belongs(all: &[Compared], rules: &Rules) -> Vec<(Belongs, f64)> {
    let counts: Vec<[[u64; 2]; 2]> = all
        .iter()
        .map(|c| [&c.reference, &c.runs].map(|runs| shown(&c.panel, runs, rules)))
        .collect();
    let test = |counts: &[[u64; 2]; 2]| {
        let rows = counts.map(|[hits, of]| vec![hits, of - hits]);
        let p = homogeneity(&rows, rules.permutations, rules.permutation_seed).p_permutation;
        // If all runs are alike, there is nothing to tell apart.
        if p.is_nan() { 1.0 } else { p }
    };
    let adjusted = effects::holm(&counts.iter().map(test).collect::<Vec<_>>());
    counts.iter().zip(adjusted).map(|(c, p)| (Belongs::of(c[0], c[1], p, rules), p)).collect()
}

/// The table of outcomes.
pub fn outcomes_text(all: &[Compared], rules: &Rules) -> String {
    let mut text = String::from(
        "| reading | panel | the paper says | LSODA | resolved | difference in points | p \
            | verdict by the rule (p ≥ 0.05: these odds) |\n|---|---|---|---|---|---|---|---|\n",
    );
    for (c, (whose, p)) in all.iter().zip(belongs(all, rules)) {
        let [a, b] = [&c.reference, &c.runs].map(|runs| shown(&c.panel, runs, rules));
        let share = |[hits, of]: [u64; 2]| {
            percent(hits as f64 / of as f64, wilson(hits, of, rules.confidence))
        };
        let d = effects::difference(b, a, rules.confidence);
        let [v, low, high] = [d.value, d.interval[0], d.interval[1]].map(|v| 100.0 * v);
        // Writing to a String cannot fail.
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {v:+.0} [{low:+.0}, {high:+.0}] | {} | {} |",
            c.reading.word(),
            c.panel.name,
            c.panel.said.words(),
            share(a),
            share(b),
            short(p),
            whose.words(),
        );
    }
    text
}

/// Kinds of ends and times of capture of both methods, `named` so.
pub fn kinds_text(all: &[Compared], named: [&str; 2], rules: &Rules) -> String {
    let odds: Vec<f64> = all
        .iter()
        .map(|c| census::same_odds(&[c.reference.clone(), c.runs.clone()], rules).p_permutation)
        .map(|p| if p.is_nan() { 1.0 } else { p })
        .collect();
    let times = |runs: &[CensusRun]| runs.iter().map(|r| time(r, rules.end)).collect::<Vec<_>>();
    let ranks: Vec<LogRank> =
        all.iter().map(|c| LogRank::of(&times(&c.runs), &times(&c.reference))).collect();
    let [odds, hazards] = [odds, ranks.iter().map(LogRank::p).collect()].map(|p| effects::holm(&p));
    let mut text = format!(
        "| reading | panel | ends by {} | ends by {} | same odds, p | hazard of capture, over {} | \
            log-rank p |\n|---|---|---|---|---|---|---|\n",
        named[0], named[1], named[0]
    );
    for (i, c) in all.iter().enumerate() {
        let ends = |runs: &[CensusRun]| {
            let counts = tally(runs, rules.end);
            let said = MotionKind::ALL.iter().zip(counts).filter(|(_, n)| *n > 0);
            said.map(|(kind, n)| format!("{n} {}", kind.words())).collect::<Vec<_>>().join(", ")
        };
        let ratio = ranks[i].hazard_ratio(rules.confidence);
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {} | {:.2} [{:.2}, {:.2}] | {} |",
            c.reading.word(),
            c.panel.name,
            ends(&c.reference),
            ends(&c.runs),
            short(odds[i]),
            ratio.value,
            ratio.interval[0],
            ratio.interval[1],
            short(hazards[i]),
        );
    }
    text
}

/// Whether runs at 1e-13 are captured as those at 1e-15 are: by reading, the runs at 1e-13 and at
/// 1e-15.
pub fn tolerance_text(
    readings: &[(Reading, Vec<CensusRun>, Vec<CensusRun>)],
    rules: &Rules,
) -> String {
    let times = |runs: &[CensusRun]| runs.iter().map(|r| time(r, rules.end)).collect::<Vec<_>>();
    let ranks: Vec<LogRank> = readings
        .iter()
        .map(|(_, loose, tight)| LogRank::of(&times(loose), &times(tight)))
        .collect();
    let adjusted = effects::holm(&ranks.iter().map(LogRank::p).collect::<Vec<_>>());
    let said =
        readings.iter().zip(&ranks).zip(adjusted).map(|(((reading, loose, tight), rank), p)| {
            let ratio = rank.hazard_ratio(rules.confidence);
            let [low, high] = ratio.interval;
            format!(
                "{} reading {:.2} [{low:.2}, {high:.2}], {} ({} and {} runs)",
                reading.word(),
                ratio.value,
                p_in_words(p),
                loose.len(),
                tight.len()
            )
        });
    format!(
        "Hazard of capture in fig. 7(iii) at 10⁻¹³ over that at 10⁻¹⁵: {}.",
        said.collect::<Vec<_>>().join("; ")
    )
}

fn short(p: f64) -> String {
    p_in_words(p).trim_start_matches("p = ").trim_start_matches("p ").to_owned()
}

#[cfg(test)]
mod tests {
    use super::super::claims::claims;
    use super::*;

    #[test]
    fn whose_an_outcome_is() {
        let rules = &claims().rules;
        let of = |lsoda, resolved, p| Belongs::of(lsoda, resolved, p, rules);
        assert_eq!(of([50, 100], [45, 100], 0.4), Belongs::System);
        assert_eq!(of([0, 100], [1, 100], 0.4), Belongs::System);
        assert_eq!(of([50, 100], [5, 100], 0.001), Belongs::OtherOdds);
        assert_eq!(of([50, 100], [0, 100], 0.001), Belongs::Method);
        assert_eq!(of([1, 100], [0, 100], 1.0), Belongs::Open);
        assert_eq!(of([0, 100], [0, 100], 1.0), Belongs::Neither);
    }
}
