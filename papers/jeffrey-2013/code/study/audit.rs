//! The parameter map: how many runs show the paper's outcomes of figs 7, 8 and 9(i) over alpha and
//! beta.

use super::census::{self, CensusPanel, CensusRun, Said};
use super::claims::Rules;
use crate::Reading;
use twofold_job::table::{Entry, Table};

/// The panels whose outcomes are judged: the six of the census, and 9(i), fig. 7(iii) with
/// hysteresis.
pub const PANELS: [CensusPanel; 7] = {
    let [a, b, c, d, e, f] = census::PANELS;
    [a, b, c, d, e, f, CensusPanel { name: "9(i)", said: Said::Chaos, column: None }]
};

/// Sweeps of the three figures, in their order: of fig. 7's intervals, of fig. 8's sigmas, and of
/// fig. 9's first panel.
pub type Sweeps = [Vec<Table>; 3];

/// All runs of every panel, for [`cells`].
pub const ALL: [usize; 7] = [usize::MAX; 7];

/// A pair of parameters, and the runs of each panel there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cell {
    /// Strength of the drift.
    pub alpha: f64,
    /// Strength of the attraction.
    pub beta: f64,
    /// Runs of each panel.
    pub runs: [u64; 7],
    /// Number of runs that support the claim.
    pub hits: [u64; 7],
}

/// Runs of a table at a pair of parameters. What a table does not vary has the paper's value in it.
fn runs_at(table: &Table, [alpha, beta]: [f64; 2], panel: &CensusPanel) -> Vec<CensusRun> {
    let mut chosen = Vec::new();
    let printed = Reading::Printed.parameters();
    for (name, wanted, printed) in
        [("params.alpha", alpha, printed[0]), ("params.beta", beta, printed[1])]
    {
        if table.column(name).is_some() {
            chosen.push((name, Entry::Number(wanted)));
        } else if wanted != printed {
            return Vec::new();
        }
    }
    panel.runs(table, chosen)
}

/// The cells of sweeps over `params.alpha` and `params.beta`, or over one of them at the paper's
/// value of the other, in order; those in which every panel has a run. Of each panel at most so
/// many of the first runs count as `most` says, in the panels' order.
pub fn cells(sweeps: &Sweeps, most: [usize; 7], rules: &Rules) -> Vec<Cell> {
    let mut pairs: Vec<[f64; 2]> = Vec::new();
    let printed = Reading::Printed.parameters();
    for table in sweeps.iter().flatten() {
        let values = |name: &str, printed: f64| -> Vec<f64> {
            table.column(name).map_or(vec![printed; table.len()], |_| table.numbers(name).to_vec())
        };
        for (alpha, beta) in
            values("params.alpha", printed[0]).into_iter().zip(values("params.beta", printed[1]))
        {
            if !pairs.contains(&[alpha, beta]) {
                pairs.push([alpha, beta]);
            }
        }
    }
    pairs.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let cell = |[alpha, beta]: [f64; 2]| {
        let mut cell = Cell { alpha, beta, runs: [0; 7], hits: [0; 7] };
        for (i, panel) in PANELS.iter().enumerate() {
            let runs = sweeps[i / 3].iter().flat_map(|table| runs_at(table, [alpha, beta], panel));
            let runs: Vec<CensusRun> = runs.take(most[i]).collect();
            cell.runs[i] = runs.len() as u64;
            cell.hits[i] = census::supporting(panel.said, &runs, rules);
        }
        cell
    };
    // A panel without a run says nothing, and its cell would look better than it is.
    pairs.into_iter().map(cell).filter(|cell| cell.runs.iter().all(|n| *n > 0)).collect()
}

#[cfg(test)]
mod tests {
    use super::super::claims::claims;
    use super::*;
    use twofold_job::table::Column;

    #[test]
    fn a_table_that_varies_one_number_has_the_printed_value_of_the_other() {
        let sweep = |columns: &[(&str, f64)]| {
            let names = columns
                .iter()
                .map(|(name, _)| Column::numbers(name))
                .chain([Column::words("outcome")]);
            let mut table = Table::new(
                "sweep",
                names.chain([Column::integers("period"), Column::numbers("captured_at")]),
            );
            let head: Vec<Entry> = columns.iter().map(|(_, v)| Entry::Number(*v)).collect();
            table.push(head.into_iter().chain([
                "period-1".into(),
                Entry::Integer(1),
                Entry::Number(10.0),
            ]));
            table
        };
        let of = |axis: (&str, f64), panel: &CensusPanel| {
            sweep(&[axis].into_iter().chain(panel.column).collect::<Vec<_>>())
        };
        let all = |axis, range: std::ops::Range<usize>| {
            PANELS[range].iter().map(|p| of(axis, p)).collect::<Vec<_>>()
        };
        for (axis, expected) in
            [(("params.alpha", 0.1), [0.1, 1e-5]), (("params.beta", 1e-4), [1e-3, 1e-4])]
        {
            let sweeps = [all(axis, 0..3), all(axis, 3..6), all(axis, 6..7)];
            let found = cells(&sweeps, ALL, &claims().rules);
            assert_eq!(found.len(), 1);
            assert_eq!(([found[0].alpha, found[0].beta], found[0].runs), (expected, [1; 7]));
            assert_eq!(found[0].hits, [1, 0, 0, 0, 1, 1, 0]);
        }
    }
}
