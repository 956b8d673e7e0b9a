//! The audit: at which alpha and beta would the paper's outcomes of figs 7 and 8 be likely, and which printed digit is then most likely wrong.

use serde::{Deserialize, Serialize};

use super::census::{self, PANELS};
use super::claims::Rules;
use crate::job::table::{Column, Entry, Table};
use crate::num::elementary::{exp10, log10};

/// A pair of parameters, and how likely the paper's six outcomes are there.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    /// Strength of the drift.
    pub alpha: f64,
    /// Strength of the attraction.
    pub beta: f64,
    /// Runs of each panel.
    pub runs: [u64; 6],
    /// Runs that bear the paper out.
    pub hits: [u64; 6],
    /// Runs that go to the far state, all panels together.
    pub far: u64,
    /// Decimal logarithm of the probability that one new run of each panel comes out as the paper says: the product over panels of
    /// (hits + 1/2)/(runs + 1), the predictive probability under Jeffreys' prior.
    pub log_likelihood: f64,
}

impl Cell {
    fn of(alpha: f64, beta: f64, found: [(u64, u64, u64); 6]) -> Self {
        let log_likelihood = found.iter().map(|(n, k, _)| log10((*k as f64 + 0.5) / (*n as f64 + 1.0))).sum();
        Self {
            alpha,
            beta,
            runs: found.map(|f| f.0),
            hits: found.map(|f| f.1),
            far: found.iter().map(|f| f.2).sum(),
            log_likelihood,
        }
    }

    /// Whether every panel has a run.
    pub fn is_whole(&self) -> bool {
        self.runs.iter().all(|n| *n > 0)
    }
}

/// The cells of two sweeps over `params.alpha` and `params.beta`, of fig. 7's intervals and of fig. 8's sigmas, in order; those in which every panel has a run.
pub fn cells(fig7: &Table, fig8: &Table, rules: &Rules) -> Vec<Cell> {
    let mut pairs: Vec<[f64; 2]> = Vec::new();
    for table in [fig7, fig8] {
        for (alpha, beta) in table.numbers("params.alpha").iter().zip(table.numbers("params.beta")) {
            if !pairs.contains(&[*alpha, *beta]) {
                pairs.push([*alpha, *beta]);
            }
        }
    }
    pairs.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    let cell = |[alpha, beta]: [f64; 2]| {
        let mut found = [(0, 0, 0); 6];
        for (i, (panel, found)) in PANELS.iter().zip(&mut found).enumerate() {
            let chosen = [
                ("params.alpha", Entry::Number(alpha)),
                ("params.beta", Entry::Number(beta)),
                (panel.column, Entry::Number(panel.value)),
            ];
            let runs = census::runs([fig7, fig8][i / 3], &chosen);
            let far = runs.iter().filter(|r| r.outcome == "far").count() as u64;
            *found = (runs.len() as u64, census::bears_out(panel.said, &runs, rules), far);
        }
        Cell::of(alpha, beta, found)
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
    /// Probability if the printed numbers are right with probability `PRIORS[0]` before, and the other candidates share the rest evenly ...
    pub posterior: [f64; 2],
}

/// Probabilities, before any run, that the printed numbers are right.
pub const PRIORS: [f64; 2] = [0.5, 0.99];

/// The paper's alpha and beta.
const PRINTED: [f64; 2] = [1e-3, 1e-5];

/// The candidates among the cells: the printed pair, and those in which one exponent has another digit. `None` without the printed pair.
pub fn candidates(cells: &[Cell]) -> Option<Vec<Candidate>> {
    let is_power = |v: f64| {
        let e = log10(v);
        (e - e.round()).abs() < 1e-9 && (-9.5..0.5).contains(&e)
    };
    let printed = cells.iter().find(|c| [c.alpha, c.beta] == PRINTED && c.is_whole())?;
    let mut chosen: Vec<Cell> = vec![*printed];
    chosen.extend(cells.iter().filter(|c| {
        let changed = [c.alpha != PRINTED[0], c.beta != PRINTED[1]];
        c.is_whole() && changed[0] != changed[1] && is_power(c.alpha) && is_power(c.beta)
    }));
    let factors: Vec<f64> = chosen.iter().map(|c| exp10(c.log_likelihood - printed.log_likelihood)).collect();
    let others = (chosen.len() - 1).max(1) as f64;
    let posterior = |prior: f64| -> Vec<f64> {
        let weight = |i: usize| if i == 0 { prior } else { (1.0 - prior) / others };
        let weights: Vec<f64> = factors.iter().enumerate().map(|(i, f)| f * weight(i)).collect();
        let sum: f64 = weights.iter().sum();
        weights.into_iter().map(|w| w / sum).collect()
    };
    let posteriors = PRIORS.map(posterior);
    let candidate = |(i, cell): (usize, Cell)| Candidate {
        cell,
        bayes_factor: factors[i],
        posterior: [posteriors[0][i], posteriors[1][i]],
    };
    Some(chosen.into_iter().enumerate().map(candidate).collect())
}

/// Cells as a table.
pub fn cell_table(cells: &[Cell]) -> Table {
    let mut columns = vec![
        Column::numbers("alpha"),
        Column::numbers("beta"),
        Column::numbers("log10_likelihood"),
        Column::integers("far"),
    ];
    columns.extend(PANELS.iter().flat_map(|p| {
        let name = p.name.replace(['(', ')'], "_");
        [Column::integers(&format!("runs_{name}")), Column::integers(&format!("hits_{name}"))]
    }));
    let mut table = Table::new("audit", columns);
    for cell in cells {
        let counts = cell.runs.iter().zip(&cell.hits).flat_map(|(n, k)| [*n, *k]).map(|v| Entry::Integer(v as i64));
        let head: [Entry; 4] =
            [cell.alpha.into(), cell.beta.into(), cell.log_likelihood.into(), Entry::Integer(cell.far as i64)];
        table.push(head.into_iter().chain(counts));
    }
    table
}

/// Candidates as a table.
pub fn candidate_table(candidates: &[Candidate]) -> Table {
    let names = ["alpha", "beta", "log10_likelihood", "bayes_factor", "posterior_prior_0.5", "posterior_prior_0.99"];
    let mut table = Table::new("candidates", names.map(Column::numbers));
    for c in candidates {
        let row = [c.cell.alpha, c.cell.beta, c.cell.log_likelihood, c.bayes_factor, c.posterior[0], c.posterior[1]];
        table.push(row.map(Entry::Number));
    }
    table
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(alpha: f64, beta: f64, hits: u64) -> Cell {
        Cell::of(alpha, beta, [(9, hits, 0); 6])
    }

    #[test]
    fn candidates_differ_from_the_printed_numbers_in_one_exponent() {
        let cells =
            [cell(1e-3, 1e-5, 0), cell(1e-1, 1e-5, 9), cell(1e-3, 1e-4, 0), cell(1e-1, 1e-4, 9), cell(3e-3, 1e-5, 9)];
        let found = candidates(&cells).unwrap();
        let pairs: Vec<[f64; 2]> = found.iter().map(|c| [c.cell.alpha, c.cell.beta]).collect();
        assert_eq!(pairs, [[1e-3, 1e-5], [1e-1, 1e-5], [1e-3, 1e-4]]);
        // (9.5/10)^6 against (0.5/10)^6.
        assert!((found[1].bayes_factor / 19_f64.powi(6) - 1.0).abs() < 1e-9);
        for k in 0..2 {
            let sum: f64 = found.iter().map(|c| c.posterior[k]).sum();
            assert!((sum - 1.0).abs() < 1e-12);
        }
        assert!(found[1].posterior[1] > 0.999 && found[1].posterior[0] > found[1].posterior[1]);
        assert_eq!(candidates(&cells[1..]), None);
    }
}
