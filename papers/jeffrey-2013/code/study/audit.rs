//! The parameter map: the likelihood of the paper's outcomes of figs 7, 8 and 9(i) over alpha and
//! beta, and the printed digit that is most likely wrong.

use serde::{Deserialize, Serialize};

use super::census::{self, CensusPanel, CensusRun, Probability, Said};
use super::claims::Rules;
use crate::Reading;
use twofold_job::table::{Column, Entry, Table};
use twofold_num::elementary::{exp10, log10};
use twofold_num::random::RandomStream;

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

/// A pair of parameters, and the likelihood of the paper's seven outcomes there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Strength of the drift.
    pub alpha: f64,
    /// Strength of the attraction.
    pub beta: f64,
    /// Runs of each panel.
    pub runs: [u64; 7],
    /// Number of runs that support the claim.
    pub hits: [u64; 7],
    /// Runs that go to the far state, all panels together.
    pub far: u64,
    /// Decimal logarithm of the probability that one new run of each panel comes out as the paper
    /// says: the product over panels of (hits + 1/2)/(runs + 1), the predictive probability under
    /// Jeffreys' prior.
    pub log_likelihood: f64,
}

impl Cell {
    fn of(alpha: f64, beta: f64, found: [(u64, u64, u64); 7]) -> Self {
        let log_likelihood =
            found.iter().map(|(n, k, _)| log10((*k as f64 + 0.5) / (*n as f64 + 1.0))).sum();
        Self {
            alpha,
            beta,
            runs: found.map(|f| f.0),
            hits: found.map(|f| f.1),
            far: found.iter().map(|f| f.2).sum(),
            log_likelihood,
        }
    }

    /// A draw of the decimal logarithm of the seven outcomes' probability, each panel's share
    /// having the posterior that Jeffreys' prior gives.
    fn draw(&self, random: &mut RandomStream) -> f64 {
        let share = |(n, k): (&u64, &u64)| {
            let weights = [*k as f64 + 0.5, (*n - *k) as f64 + 0.5];
            log10(census::dirichlet(&weights, random)[0].max(f64::MIN_POSITIVE))
        };
        self.runs.iter().zip(&self.hits).map(share).sum()
    }

    /// Whether every panel has a run.
    pub fn is_whole(&self) -> bool {
        self.runs.iter().all(|n| *n > 0)
    }
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
    let cell = |at: [f64; 2]| {
        let mut found = [(0, 0, 0); 7];
        for (i, (panel, found)) in PANELS.iter().zip(&mut found).enumerate() {
            let runs = sweeps[i / 3].iter().flat_map(|table| runs_at(table, at, panel));
            let runs: Vec<CensusRun> = runs.take(most[i]).collect();
            let far = runs.iter().filter(|r| r.outcome == "far").count() as u64;
            *found = (runs.len() as u64, census::supporting(panel.said, &runs, rules), far);
        }
        Cell::of(at[0], at[1], found)
    };
    // A panel without a run says nothing, and its cell would look better than it is.
    pairs.into_iter().map(cell).filter(Cell::is_whole).collect()
}

/// A reading of the paper's two numbers: as printed, or with one digit of an exponent changed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The cell.
    pub cell: Cell,
    /// Likelihood over that of the printed numbers.
    pub bayes_factor: f64,
    /// Central interval of that ratio under the panels' posteriors.
    pub factor_interval: [f64; 2],
    /// Probability if the printed numbers are right with probability `PRIORS[0]` before
    /// (`PRIORS[1]`), and the other candidates share the rest evenly: from the predictive
    /// likelihoods, with the central interval under the panels' posteriors.
    pub posterior: [Probability; 2],
}

/// Draws from the panels' posteriors.
const DRAWS: usize = 20_000;

/// Probabilities, before any run, that the printed numbers are right.
pub const PRIORS: [f64; 2] = [0.5, 0.99];

/// The candidates among the cells: the printed pair, and those in which one exponent has another
/// digit. `None` without the printed pair.
pub fn candidates(cells: &[Cell], rules: &Rules) -> Option<Vec<Candidate>> {
    let at = Reading::Printed.parameters();
    let is_power = |v: f64| {
        let e = log10(v);
        (e - e.round()).abs() < 1e-9 && (-9.5..0.5).contains(&e)
    };
    let printed = cells.iter().find(|c| [c.alpha, c.beta] == at && c.is_whole())?;
    let mut chosen: Vec<Cell> = vec![*printed];
    chosen.extend(cells.iter().filter(|c| {
        let changed = [c.alpha != at[0], c.beta != at[1]];
        c.is_whole() && changed[0] != changed[1] && is_power(c.alpha) && is_power(c.beta)
    }));
    let factors: Vec<f64> =
        chosen.iter().map(|c| exp10(c.log_likelihood - printed.log_likelihood)).collect();
    let others = (chosen.len() - 1).max(1) as f64;
    let posterior = |prior: f64, factors: &[f64]| -> Vec<f64> {
        let weight = |i: usize| if i == 0 { prior } else { (1.0 - prior) / others };
        let weights: Vec<f64> = factors.iter().enumerate().map(|(i, f)| f * weight(i)).collect();
        let sum: f64 = weights.iter().sum();
        weights.into_iter().map(|w| w / sum).collect()
    };
    let means = PRIORS.map(|prior| posterior(prior, &factors));
    let mut random = RandomStream::new(rules.permutation_seed, 2);
    let (mut drawn, mut drawn_posteriors) =
        (vec![Vec::new(); chosen.len()], vec![[Vec::new(), Vec::new()]; chosen.len()]);
    for _ in 0..DRAWS {
        let logs: Vec<f64> = chosen.iter().map(|c| c.draw(&mut random)).collect();
        let factors: Vec<f64> = logs.iter().map(|l| exp10(l - logs[0])).collect();
        let posteriors = PRIORS.map(|prior| posterior(prior, &factors));
        for (i, factor) in factors.iter().enumerate() {
            drawn[i].push(*factor);
            for (k, all) in posteriors.iter().enumerate() {
                drawn_posteriors[i][k].push(all[i]);
            }
        }
    }
    let central = |values: &mut Vec<f64>| {
        values.sort_by(f64::total_cmp);
        let tail = 0.5 * (1.0 - rules.confidence);
        [tail, 1.0 - tail].map(|q| values[((values.len() - 1) as f64 * q) as usize])
    };
    let candidate = |(i, cell): (usize, Cell)| Candidate {
        cell,
        bayes_factor: factors[i],
        factor_interval: central(&mut drawn[i]),
        posterior: [0, 1].map(|k| Probability {
            mean: means[k][i],
            interval: central(&mut drawn_posteriors[i][k]),
        }),
    };
    Some(chosen.into_iter().enumerate().map(candidate).collect())
}

/// Candidates as a table.
pub fn candidate_table(candidates: &[Candidate]) -> Table {
    let mut columns =
        vec![Column::numbers("alpha"), Column::numbers("beta"), Column::integers("fewest_runs")];
    let names = ["log10_likelihood", "bayes_factor", "bayes_factor_low", "bayes_factor_high"];
    columns.extend(names.map(Column::numbers));
    for prior in PRIORS {
        columns.extend(
            ["", "_low", "_high"]
                .map(|end| Column::numbers(&format!("posterior_prior_{prior}{end}"))),
        );
    }
    let mut table = Table::new("candidates", columns);
    for c in candidates {
        let fewest = c.cell.runs.iter().min().copied().unwrap_or(0);
        let head: [Entry; 3] =
            [c.cell.alpha.into(), c.cell.beta.into(), Entry::Integer(fewest as i64)];
        let numbers =
            [c.cell.log_likelihood, c.bayes_factor, c.factor_interval[0], c.factor_interval[1]];
        let posteriors = c.posterior.iter().flat_map(|p| [p.mean, p.interval[0], p.interval[1]]);
        table
            .push(head.into_iter().chain(numbers.into_iter().chain(posteriors).map(Entry::Number)));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::super::claims::claims;
    use super::*;

    fn cell(alpha: f64, beta: f64, hits: u64) -> Cell {
        Cell::of(alpha, beta, [(9, hits, 0); 7])
    }

    #[test]
    fn candidates_differ_from_the_printed_numbers_in_one_exponent() {
        let cells = [
            cell(1e-3, 1e-5, 0),
            cell(1e-1, 1e-5, 9),
            cell(1e-3, 1e-4, 0),
            cell(1e-1, 1e-4, 9),
            cell(3e-3, 1e-5, 9),
        ];
        let rules = &claims().rules;
        let found = candidates(&cells, rules).unwrap();
        let pairs: Vec<[f64; 2]> = found.iter().map(|c| [c.cell.alpha, c.cell.beta]).collect();
        assert_eq!(pairs, [[1e-3, 1e-5], [1e-1, 1e-5], [1e-3, 1e-4]]);
        // (9.5/10)^7 against (0.5/10)^7.
        assert!((found[1].bayes_factor / 19_f64.powi(7) - 1.0).abs() < 1e-9);
        for k in 0..2 {
            let sum: f64 = found.iter().map(|c| c.posterior[k].mean).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
        assert!(
            found[1].posterior[1].mean > 0.999
                && found[1].posterior[0].mean > found[1].posterior[1].mean
        );
        assert_eq!(candidates(&cells[1..], rules), None);
        // The printed numbers' own ratio is 1 in every draw; that of nine hits of nine has an
        // interval around it.
        assert_eq!(found[0].factor_interval, [1.0, 1.0]);
        let [low, high] = found[1].factor_interval;
        assert!(
            1.0 < low && low < found[1].bayes_factor && found[1].bayes_factor < high,
            "{low} {high}"
        );
    }

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
