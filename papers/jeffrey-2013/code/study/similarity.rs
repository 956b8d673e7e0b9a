//! In which ways a delayed switch is similar to hysteresis (sentence 4.8), scored from committed
//! runs by the rules that `sentences.toml` fixes.

use twofold_analyse::counts::wilson;

use super::claims::claims;
use crate::Reading;

/// The switching rule.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Eq. (8).
    Smoothed,
    /// Eq. (10), read literally.
    Literal,
    /// Eq. (10) with a single division.
    Single,
    /// A sharp delay of eps.
    Delayed,
    /// A sharp delay of eps'.
    DelayedLong,
}

/// Every rule: the three that distances are taken to, then the delayed ones.
pub const RULES: [Rule; 5] =
    [Rule::Smoothed, Rule::Literal, Rule::Single, Rule::Delayed, Rule::DelayedLong];

impl Rule {
    /// The name in sentences.toml and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Smoothed => "smoothed",
            Self::Literal => "literal",
            Self::Single => "single",
            Self::Delayed => "delayed",
            Self::DelayedLong => "delayed-long",
        }
    }
}

/// The ways, in the order of the table's columns.
pub const WAYS: [&str; 4] = ["settles", "occupancy", "chatter", "exits"];

/// The table's columns: of each way the distance from the runs of eq. (8), and of both readings of
/// eq. (10).
pub const HEADER: &str = "reading,rule,run,outcome,captured_at,\
settles_smoothed,settles_literal,settles_single,occupancy_smoothed,occupancy_literal,occupancy_single,\
chatter_smoothed,chatter_literal,chatter_single,exits_smoothed,exits_literal,exits_single";

/// One run.
#[derive(Clone, Debug, PartialEq)]
pub struct RuleRun {
    /// "printed" or "reconstructed".
    pub reading: String,
    /// A rule's name.
    pub rule: String,
    /// The attractor that captured it.
    pub outcome: String,
    /// Its distances in each way from eq. (8) and from both readings of eq. (10).
    pub distances: [[f64; 3]; 4],
}

/// Reads the table that `make delay-data` writes; `None` if it is not such a table.
pub fn runs(csv: &str) -> Option<Vec<RuleRun>> {
    let mut lines = csv.lines();
    if lines.next() != Some(HEADER) {
        return None;
    }
    lines
        .map(|line| {
            let cells: Vec<&str> = line.split(',').collect();
            let mut distances = [[f64::NAN; 3]; 4];
            for (k, cell) in cells.get(5..17)?.iter().enumerate() {
                distances[k / 3][k % 3] = cell.parse().ok()?;
            }
            let word = |i: usize| cells[i].to_owned();
            Some(RuleRun { reading: word(0), rule: word(1), outcome: word(3), distances })
        })
        .collect()
}

/// The result of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Similar {
    /// As near to hysteresis as its runs are to each other, and nearer than to smoothing.
    Yes,
    /// One of the two fails.
    No,
    /// Neither.
    Undecided,
}

impl Similar {
    /// The result in words.
    pub fn word(self) -> &'static str {
        match self {
            Self::Yes => "similar",
            Self::No => "not similar",
            Self::Undecided => "not decided",
        }
    }
}

/// A way's score in a reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Runs of the delayed rule.
    pub of: u64,
    /// Those nearer to hysteresis than to smoothing, with the share's interval.
    pub near: (u64, [f64; 2]),
    /// Those within the yardstick, with the share's interval.
    pub within: (u64, [f64; 2]),
    /// The yardstick: a quantile of the distances of hysteretic runs from each other.
    pub yardstick: f64,
    /// The median distances of delayed runs from smoothing and from hysteresis.
    pub medians: [f64; 2],
    /// The conclusion.
    pub similar: Similar,
}

/// Scores the `delayed` runs against those of `hysteresis` in a way, an index of [`WAYS`].
pub fn score(
    runs: &[RuleRun],
    reading: Reading,
    way: usize,
    delayed: Rule,
    hysteresis: Rule,
) -> Score {
    let (rules, confidence) = (claims().similarity, claims().rules.confidence);
    let to = RULES.iter().position(|r| *r == hysteresis).unwrap_or_default();
    let of = |rule: Rule| {
        runs.iter().filter(move |r| r.reading == reading.word() && r.rule == rule.name())
    };
    let sorted = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        values
    };
    let among = sorted(of(hysteresis).map(|r| r.distances[way][to]).collect());
    // The smallest distance that at least such a share of the runs does not exceed.
    let rank = (rules.yardstick * among.len() as f64).ceil() as usize;
    let yardstick = among.get(rank.max(1) - 1).copied().unwrap_or(f64::NAN);
    let all: Vec<[f64; 3]> = of(delayed).map(|r| r.distances[way]).collect();
    let total = all.len() as u64;
    let counted = |hits: usize| (hits as u64, wilson(hits as u64, total, confidence));
    let near = counted(all.iter().filter(|d| d[to] < d[0]).count());
    let within = counted(all.iter().filter(|d| d[to] <= yardstick).count());
    let median = |which: usize| {
        let values = sorted(all.iter().map(|d| d[which]).collect());
        values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
    };
    let above = |(_, [low, _]): (u64, [f64; 2])| low > 0.5;
    let below = |(_, [_, high]): (u64, [f64; 2])| high < 0.5;
    let similar = if total.min(among.len() as u64) < rules.runs {
        Similar::Undecided
    } else if below(near) || below(within) {
        Similar::No
    } else if above(near) && above(within) {
        Similar::Yes
    } else {
        Similar::Undecided
    };
    Score { of: total, near, within, yardstick, medians: [median(0), median(to)], similar }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(rule: Rule, number: usize, distances: [f64; 3]) -> String {
        let cells: Vec<String> = (0..4).flat_map(|_| distances.map(|d| d.to_string())).collect();
        format!("printed,{},{number},period-1,1.0,{}", rule.name(), cells.join(","))
    }

    /// A hundred runs of hysteresis at distances 0.01 .. 1 from each other, and as many delayed
    /// ones of which `near` are at 0.5 from it and 0.6 from smoothing, and the others the other way
    /// round.
    fn table(near: usize) -> Vec<RuleRun> {
        let hysteresis =
            (0..100).map(|k| run(Rule::Literal, k, [1.0, (k + 1) as f64 / 100.0, 1.0]));
        let delayed = (0..100).map(|k| {
            run(Rule::Delayed, k, if k < near { [0.6, 0.5, 1.0] } else { [0.5, 0.6, 1.0] })
        });
        let lines: Vec<String> = hysteresis.chain(delayed).collect();
        runs(&format!("{HEADER}\n{}\n", lines.join("\n"))).unwrap()
    }

    #[test]
    fn scores_follow_the_rules() {
        for (near, similar) in
            [(100, Similar::Yes), (61, Similar::Yes), (50, Similar::Undecided), (39, Similar::No)]
        {
            let found = score(&table(near), Reading::Printed, 2, Rule::Delayed, Rule::Literal);
            assert_eq!((found.of, found.near.0, found.within.0), (100, near as u64, 100));
            assert_eq!((found.yardstick, found.similar), (0.95, similar), "{near}");
        }
        let without = score(&table(100), Reading::Printed, 0, Rule::Delayed, Rule::Single);
        assert_eq!(without.similar, Similar::Undecided, "no runs of that rule, no yardstick");
        assert_eq!(
            score(&table(100)[..150], Reading::Printed, 0, Rule::Delayed, Rule::Literal).similar,
            Similar::Undecided
        );
        assert_eq!(runs("reading,rule\n"), None);
    }
}
