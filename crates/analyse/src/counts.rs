//! Counts of outcomes: shares with intervals, and whether several rows of counts come from one
//! distribution.
//!
//! ```
//! use twofold_analyse::counts::{homogeneity, wilson};
//! let [low, high] = wilson(8, 10, 0.95);
//! assert!(low > 0.49 && low < 0.50 && high > 0.94 && high < 0.95);
//! let same = homogeneity(&[vec![30, 10], vec![28, 12], vec![33, 7]], 2000, 1);
//! assert!(same.p_permutation > 0.2);
//! ```

use serde::{Deserialize, Serialize};

use twofold_num::elementary::{erf, exp, ln, sqrt};
use twofold_num::random::RandomStream;

/// The standard normal distribution's quantile: z with P(Z <= z) = p, found by halving on the error
/// function; not-a-number outside (0, 1).
pub fn normal_quantile(p: f64) -> f64 {
    if !(p > 0.0 && p < 1.0) {
        return f64::NAN;
    }
    let (mut low, mut high) = (-40.0, 40.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if 0.5 * (1.0 + erf(middle / std::f64::consts::SQRT_2)) < p {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

/// Wilson's (1927, J. Am. Stat. Assoc. 22, 209) score interval for a share, `hits` of `of`, at the
/// given confidence. Without any count it is [0, 1].
///
/// ```
/// use twofold_analyse::counts::wilson;
/// let [low, high] = wilson(156, 300, 0.95); // 52 %
/// assert!((low - 0.464).abs() < 1e-3 && (high - 0.576).abs() < 1e-3);
/// ```
pub fn wilson(hits: u64, of: u64, confidence: f64) -> [f64; 2] {
    score(hits, of, normal_quantile(0.5 * (1.0 + confidence)))
}

/// Goodman's (1965, Technometrics 7, 247) simultaneous intervals for the shares of a multinomial:
/// each holds, and with the given confidence all hold at once (Bonferroni over the categories).
pub fn goodman(counts: &[u64], confidence: f64) -> Vec<[f64; 2]> {
    let of = counts.iter().sum();
    let categories = counts.len().max(1) as f64;
    let z = normal_quantile(1.0 - 0.5 * (1.0 - confidence) / categories);
    counts.iter().map(|hits| score(*hits, of, z)).collect()
}

fn score(hits: u64, of: u64, z: f64) -> [f64; 2] {
    if of == 0 {
        return [0.0, 1.0];
    }
    let n = of as f64;
    let p = hits as f64 / n;
    let square = z * z;
    let centre = (p + square / (2.0 * n)) / (1.0 + square / n);
    let half = z / (1.0 + square / n) * sqrt(p * (1.0 - p) / n + square / (4.0 * n * n));
    // At the ends rounding would leave a share of 1e-17.
    let low = if hits == 0 { 0.0 } else { (centre - half).max(0.0) };
    let high = if hits == of { 1.0 } else { (centre + half).min(1.0) };
    [low, high]
}

/// Whether rows of counts come from one distribution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Homogeneity {
    /// Pearson's (1900) chi-square of the table.
    pub chi_square: f64,
    /// Degrees of freedom: (rows - 1) (columns - 1), without empty rows and columns.
    pub freedom: usize,
    /// Probability of so large a value under homogeneity, from the chi-square distribution: good
    /// where expected counts are 5 or more.
    pub p_asymptotic: f64,
    /// The same, from random permutations of the outcomes over the rows: good for any counts. (hits
    /// + 1)/(permutations + 1).
    pub p_permutation: f64,
    /// Permutations drawn.
    pub permutations: u64,
}

/// Tests rows of counts (one row a group, one column an outcome) for homogeneity. `permutations`
/// are drawn from the generator of [`num::random`](twofold_num::random) with `seed`: the same
/// answer everywhere.
pub fn homogeneity(rows: &[Vec<u64>], permutations: u64, seed: u64) -> Homogeneity {
    let columns = rows.iter().map(Vec::len).max().unwrap_or(0);
    let at = |row: &Vec<u64>, c: usize| row.get(c).copied().unwrap_or(0);
    let column_sums: Vec<u64> = (0..columns).map(|c| rows.iter().map(|r| at(r, c)).sum()).collect();
    let kept: Vec<usize> = (0..columns).filter(|c| column_sums[*c] > 0).collect();
    let table: Vec<Vec<u64>> = rows
        .iter()
        .map(|r| kept.iter().map(|c| at(r, *c)).collect::<Vec<_>>())
        .filter(|r| r.iter().sum::<u64>() > 0)
        .collect();
    let observed = chi_square(&table);
    let freedom = table.len().saturating_sub(1) * kept.len().saturating_sub(1);
    // Every single outcome, row by row; a shuffle deals them out anew.
    let mut outcomes: Vec<usize> = Vec::new();
    for row in &table {
        for (c, count) in row.iter().enumerate() {
            outcomes.extend((0..*count).map(|_| c));
        }
    }
    let sizes: Vec<usize> = table.iter().map(|r| r.iter().sum::<u64>() as usize).collect();
    let mut random = RandomStream::new(seed, 0);
    let mut as_large = 0_u64;
    for _ in 0..permutations {
        for i in (1..outcomes.len()).rev() {
            // Fisher & Yates; the bias of a scaled uniform number is below 2^-40 here.
            let j = (random.uniform() * (i + 1) as f64) as usize;
            outcomes.swap(i, j.min(i));
        }
        let mut from = 0;
        let dealt: Vec<Vec<u64>> = sizes
            .iter()
            .map(|size| {
                let mut counts = vec![0; kept.len()];
                outcomes[from..from + size].iter().for_each(|c| counts[*c] += 1);
                from += size;
                counts
            })
            .collect();
        // Equal tables must count as equal whatever the rounding.
        as_large += u64::from(chi_square(&dealt) >= observed * (1.0 - 1e-12));
    }
    Homogeneity {
        chi_square: observed,
        freedom,
        p_asymptotic: if freedom == 0 { 1.0 } else { chi_square_above(observed, freedom) },
        p_permutation: (as_large + 1) as f64 / (permutations + 1) as f64,
        permutations,
    }
}

fn chi_square(table: &[Vec<u64>]) -> f64 {
    let total: u64 = table.iter().flatten().sum();
    let columns = table.first().map_or(0, Vec::len);
    let column: Vec<u64> = (0..columns).map(|c| table.iter().map(|r| r[c]).sum()).collect();
    let mut sum = 0.0;
    for row in table {
        let size: u64 = row.iter().sum();
        for (c, count) in row.iter().enumerate() {
            let expected = size as f64 * column[c] as f64 / total as f64;
            if expected > 0.0 {
                let d = *count as f64 - expected;
                sum += d * d / expected;
            }
        }
    }
    sum
}

/// P(X > x) for the chi-square distribution: the regularised incomplete gamma function Q(freedom/2,
/// x/2) by its finite sums (Abramowitz & Stegun 1964, 26.4.4 and 26.4.5), exact for whole degrees
/// of freedom.
pub fn chi_square_above(x: f64, freedom: usize) -> f64 {
    if x <= 0.0 || freedom == 0 {
        return 1.0;
    }
    let half = 0.5 * x;
    let term = |power: f64, log_gamma: f64| exp(power * ln(half) - half - log_gamma);
    // Q(a + 1, z) = Q(a, z) + z^a e^-z / Gamma(a + 1), from Q(1/2, z) = erfc(sqrt z) or Q(1, z) =
    // e^-z.
    let (mut a, mut log_gamma, mut sum) = if freedom % 2 == 1 {
        // ln Gamma(3/2)
        (0.5, 0.5 * ln(std::f64::consts::PI) - ln(2.0), (1.0 - erf(sqrt(half))).max(0.0))
    } else {
        (1.0, 0.0, exp(-half))
    };
    while 2.0 * a < freedom as f64 {
        sum += term(a, log_gamma);
        a += 1.0;
        log_gamma += ln(a);
    }
    sum.clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_the_normal_distribution() {
        for (p, z) in [
            (0.975, 1.959_963_984_540_054),
            (0.5, 0.0),
            (0.995, 2.575_829_303_548_901),
            (0.1, -1.281_551_565_544_600_5),
        ] {
            assert!((normal_quantile(p) - z).abs() < 1e-9, "{p}");
        }
        assert!(normal_quantile(1.0).is_nan());
    }

    #[test]
    fn score_intervals() {
        // R: prop.test(15, 40, correct = FALSE): 0.2422, 0.5297; binom::binom.wilson(0, 20): 0,
        // 0.1611252.
        let [low, high] = wilson(15, 40, 0.95);
        assert!((low - 0.2422).abs() < 1e-4 && (high - 0.5297).abs() < 1e-4, "{low} {high}");
        let [low, high] = wilson(0, 20, 0.95);
        assert!(low == 0.0 && (high - 0.161_125_2).abs() < 1e-6);
        assert_eq!(wilson(0, 0, 0.95), [0.0, 1.0]);
        // One of two categories: Bonferroni widens.
        let both = goodman(&[15, 25], 0.95);
        assert!(both[0][0] < low.max(0.2422) && both[0][1] > 0.5297);
        assert!((both[0][0] - (1.0 - both[1][1])).abs() < 1e-12);
    }

    #[test]
    fn the_interval_covers_as_often_as_it_says() {
        let mut random = RandomStream::new(11, 0);
        for share in [0.1, 0.5] {
            let covered = (0..2000)
                .filter(|_| {
                    let hits = (0..60).filter(|_| random.uniform() < share).count() as u64;
                    let [low, high] = wilson(hits, 60, 0.95);
                    low <= share && share <= high
                })
                .count();
            assert!((1850..1960).contains(&covered), "{share}: {covered} of 2000");
        }
    }

    #[test]
    fn tails_of_chi_square() {
        // R: pchisq(x, df, lower.tail = FALSE).
        for (x, df, p) in [
            (3.841_458_820_694_124, 1, 0.05),
            (5.991_464_547_107_979, 2, 0.05),
            (9.487_729_036_781_154, 4, 0.05),
            (20.0, 5, 0.001_249_730_6),
            (2.0, 7, 0.959_840_4),
        ] {
            assert!(
                (chi_square_above(x, df) - p).abs() < 1e-7,
                "{x} {df}: {}",
                chi_square_above(x, df)
            );
        }
        // Nothing is below zero; without freedom there is nothing to test.
        assert_eq!(
            (chi_square_above(0.0, 3), chi_square_above(-1.0, 3), chi_square_above(3.0, 0)),
            (1.0, 1.0, 1.0)
        );
    }

    #[test]
    fn homogeneity_of_known_tables() {
        // R: chisq.test(matrix(c(10, 20, 30, 40), 2, byrow = TRUE), correct = FALSE): 0.7937, p =
        // 0.373.
        let h = homogeneity(&[vec![10, 20], vec![30, 40]], 5000, 3);
        assert!((h.chi_square - 0.793_650_79).abs() < 1e-6 && h.freedom == 1);
        assert!((h.p_asymptotic - 0.372_998).abs() < 1e-4);
        // Discrete: the permutation test counts ties, fisher.test gives 0.5.
        assert!((0.35..0.60).contains(&h.p_permutation), "{h:?}");
        let apart = homogeneity(&[vec![40, 0, 0], vec![0, 40, 0]], 2000, 3);
        assert!(apart.p_permutation < 1e-3 && apart.p_asymptotic < 1e-12 && apart.freedom == 1);
        let one = homogeneity(&[vec![5, 5]], 100, 3);
        assert_eq!((one.freedom, one.p_asymptotic, one.p_permutation), (0, 1.0, 1.0));
    }

    #[test]
    fn under_homogeneity_p_values_are_uniform() {
        let mut random = RandomStream::new(13, 0);
        let small = (0..400)
            .filter(|k| {
                let rows: Vec<Vec<u64>> = (0..3)
                    .map(|_| {
                        let mut counts = vec![0; 3];
                        (0..15).for_each(|_| counts[(random.uniform() * 3.0) as usize] += 1);
                        counts
                    })
                    .collect();
                homogeneity(&rows, 199, *k).p_permutation <= 0.1
            })
            .count();
        assert!((20..=60).contains(&small), "{small} of 400 at the 10 % level");
    }

    #[test]
    fn permutations_tend_to_the_exact_probability() {
        // Of the 20 ways to deal three and three outcomes over two rows of three, two are as far
        // apart as this one.
        let h = homogeneity(&[vec![3, 0], vec![0, 3]], 20_000, 5);
        assert!((h.chi_square - 6.0).abs() < 1e-12 && h.freedom == 1 && h.permutations == 20_000);
        assert!((h.p_permutation - 0.1).abs() < 0.009, "{h:?}");
        // Rows of two and four: one way of fifteen, and chi-square is 6 again.
        let h = homogeneity(&[vec![2, 0], vec![0, 4]], 20_000, 5);
        assert!(
            (h.chi_square - 6.0).abs() < 1e-12 && (h.p_permutation - 1.0 / 15.0).abs() < 0.007,
            "{h:?}"
        );
        // R: pchisq(6, 1, lower.tail = FALSE).
        assert!((h.p_asymptotic - 0.014_305_878).abs() < 1e-8, "{h:?}");
    }

    #[test]
    fn empty_rows_and_columns_count_for_nothing() {
        let full = homogeneity(&[vec![5, 5], vec![2, 8]], 500, 1);
        assert_eq!(homogeneity(&[vec![5, 0, 5], vec![0, 0, 0], vec![2, 0, 8]], 500, 1), full);
        // 5, 5 and 2, 8 of expected 3.5 and 6.5: 2 (2.25/3.5 + 2.25/6.5).
        assert!(
            (full.chi_square - 4.5 * (1.0 / 3.5 + 1.0 / 6.5)).abs() < 1e-12 && full.freedom == 1,
            "{full:?}"
        );
        assert_eq!(
            homogeneity(&[vec![1, 2, 3], vec![3, 2, 1], vec![1, 1, 1], vec![2, 2, 2]], 1, 1)
                .freedom,
            6
        );
        // A row that ends early has nothing in the columns after.
        assert_eq!(
            homogeneity(&[vec![5], vec![2, 8]], 1, 1),
            homogeneity(&[vec![5, 0], vec![2, 8]], 1, 1)
        );
    }

    #[test]
    fn simultaneous_intervals_divide_the_risk_among_the_categories() {
        // Three categories at 95 %: each at 1 - 0.05/3, two-sided.
        let one = goodman(&[10, 20, 30], 0.95);
        for (interval, hits) in one.iter().zip([10, 20, 30]) {
            let alone = wilson(hits, 60, 1.0 - 0.05 / 3.0);
            assert!(
                (0..2).all(|k| (interval[k] - alone[k]).abs() < 1e-12),
                "{interval:?} {alone:?}"
            );
        }
        // Wilson's interval ends where the share is z standard errors away: (p - h)^2 = z^2 p (1 -
        // p)/n.
        let z = normal_quantile(0.975);
        for p in wilson(15, 40, 0.95) {
            assert!(
                ((p - 0.375) * (p - 0.375) - z * z * p * (1.0 - p) / 40.0).abs() < 1e-12,
                "{p}"
            );
        }
        assert!(goodman(&[], 0.95).is_empty() && normal_quantile(0.0).is_nan());
        let [low, high] = wilson(20, 20, 0.95);
        assert!(high == 1.0 && (low - (1.0 - wilson(0, 20, 0.95)[1])).abs() < 1e-12);
    }
}
