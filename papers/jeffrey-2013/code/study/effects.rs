//! Effect sizes: times to an event in groups of runs, some of which are followed to their end
//! without it, and differences of shares.

use twofold_analyse::counts::{chi_square_above, normal_quantile, wilson};
use twofold_num::elementary::{exp, ln, sqrt};

/// The duration of a run, and whether the event ended it.
pub type Time = (f64, bool);

/// A value with the ends of its interval.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    /// The value.
    pub value: f64,
    /// Ends of the interval.
    pub interval: [f64; 2],
}

/// The log-rank test of one group against another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LogRank {
    /// Events in the first group.
    pub observed: f64,
    /// Events expected there if both groups had the same hazard.
    pub expected: f64,
    /// Variance of their difference (hypergeometric).
    pub variance: f64,
}

impl LogRank {
    /// Compares `group` with `other` (Mantel 1966, Cancer Chemother. Rep. 50, 163).
    pub fn of(group: &[Time], other: &[Time]) -> Self {
        let both: Vec<Time> = group.iter().chain(other).copied().collect();
        let mut test = Self { observed: 0.0, expected: 0.0, variance: 0.0 };
        for t in event_times(&both) {
            let ([n, d], [own, own_events]) = (at(&both, t), at(group, t));
            let share = own / n;
            test.observed += own_events;
            test.expected += d * share;
            if n > 1.0 {
                test.variance += d * share * (1.0 - share) * (n - d) / (n - 1.0);
            }
        }
        test
    }

    /// Two-sided probability of so large a difference under equal hazards, from the chi-square
    /// distribution with one degree of freedom.
    pub fn p(&self) -> f64 {
        let difference = self.observed - self.expected;
        if self.variance > 0.0 {
            chi_square_above(difference * difference / self.variance, 1)
        } else {
            1.0
        }
    }

    /// The group's hazard over the other's, exp((O - E)/V) (Peto et al. 1977, Br. J. Cancer 35, 1).
    pub fn hazard_ratio(&self, confidence: f64) -> Estimate {
        let (middle, half) =
            ((self.observed - self.expected) / self.variance, z(confidence) / sqrt(self.variance));
        Estimate { value: exp(middle), interval: [exp(middle - half), exp(middle + half)] }
    }
}

/// Share of runs in which the event occurred by `t` (Kaplan & Meier 1958, J. Am. Stat. Assoc. 53,
/// 457), with the log-log interval of Greenwood's variance (Kalbfleisch & Prentice 1980); [0, 1]
/// without an event or without a run left.
pub fn share_by(times: &[Time], t: f64, confidence: f64) -> Estimate {
    let (mut left, mut greenwood) = (1.0, 0.0);
    for [n, d] in event_times(times).into_iter().take_while(|s| *s <= t).map(|s| at(times, s)) {
        left *= 1.0 - d / n;
        greenwood += d / (n * (n - d));
    }
    if !(left > 0.0 && left < 1.0) {
        return Estimate { value: 1.0 - left, interval: [0.0, 1.0] };
    }
    let half = z(confidence) * sqrt(greenwood) / ln(left);
    let bound = |half: f64| 1.0 - exp(ln(left) * exp(half));
    Estimate { value: 1.0 - left, interval: [bound(half), bound(-half)] }
}

/// Events over the time at risk, with the exact interval of a Poisson count (Garwood 1936,
/// Biometrika 28, 437).
pub fn rate(times: &[Time], confidence: f64) -> Estimate {
    let events = times.iter().filter(|(_, event)| *event).count();
    let at_risk: f64 = times.iter().map(|(t, _)| t).sum();
    let tail = 0.5 * (1.0 - confidence);
    let low = if events == 0 { 0.0 } else { 0.5 * chi_square_quantile(tail, 2 * events) };
    let high = 0.5 * chi_square_quantile(1.0 - tail, 2 * events + 2);
    Estimate { value: events as f64 / at_risk, interval: [low / at_risk, high / at_risk] }
}

/// The difference of two shares, each `[hits, of]`, with its interval (Newcombe 1998, Stat. Med.
/// 17, 873, method 10).
pub fn difference(a: [u64; 2], b: [u64; 2], confidence: f64) -> Estimate {
    let share = |[hits, of]: [u64; 2]| hits as f64 / of as f64;
    let ends = |[hits, of]: [u64; 2]| wilson(hits, of, confidence);
    let (p, q, [l, u], [m, v]) = (share(a), share(b), ends(a), ends(b));
    let root = |x: f64, y: f64| sqrt(x * x + y * y);
    Estimate { value: p - q, interval: [p - q - root(p - l, v - q), p - q + root(u - p, q - m)] }
}

/// Probabilities of several tests, so that all hold at once (Holm 1979, Scand. J. Stat. 6, 65), in
/// the given order.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let (mut adjusted, mut largest) = (vec![0.0; p.len()], 0.0_f64);
    for (rank, i) in order.into_iter().enumerate() {
        largest = largest.max((p.len() - rank) as f64 * p[i]).min(1.0);
        adjusted[i] = largest;
    }
    adjusted
}

fn z(confidence: f64) -> f64 {
    normal_quantile(0.5 * (1.0 + confidence))
}

/// Times at which an event occurs, ascending, each once.
fn event_times(times: &[Time]) -> Vec<f64> {
    let mut found: Vec<f64> = times.iter().filter(|(_, event)| *event).map(|(t, _)| *t).collect();
    found.sort_by(f64::total_cmp);
    found.dedup();
    found
}

/// Runs at risk just before `t`, and events at `t`.
fn at(times: &[Time], t: f64) -> [f64; 2] {
    [
        times.iter().filter(|(s, _)| *s >= t).count() as f64,
        times.iter().filter(|(s, e)| *e && *s == t).count() as f64,
    ]
}

/// x with P(X <= x) = p for the chi-square distribution, by halving.
fn chi_square_quantile(p: f64, freedom: usize) -> f64 {
    let (mut low, mut high) = (0.0, 10.0 * (freedom as f64 + 10.0));
    for _ in 0..100 {
        let middle = 0.5 * (low + high);
        if 1.0 - chi_square_above(middle, freedom) < p { low = middle } else { high = middle }
    }
    0.5 * (low + high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::random::RandomStream;

    /// Weeks in remission: 6-mercaptopurine and placebo (Freireich et al. 1963, Blood 21, 699).
    fn remissions() -> [Vec<Time>; 2] {
        let weeks = [6, 6, 6, 6, 7, 9, 10, 10, 11, 13, 16, 17, 19, 20, 22, 23, 25, 32, 32, 34, 35]
            .map(f64::from)
            .into_iter();
        let relapsed =
            [1, 1, 1, 0, 1, 0, 1, 0, 0, 1, 1, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0].map(|v| v == 1);
        let placebo = [1, 1, 2, 2, 3, 4, 4, 5, 5, 8, 8, 8, 8, 11, 11, 12, 12, 15, 17, 22, 23];
        [weeks.zip(relapsed).collect(), placebo.map(|t| (f64::from(t), true)).to_vec()]
    }

    fn close(a: f64, b: f64) {
        assert!((a - b).abs() <= 1e-8 * b.abs(), "{a} is not {b}");
    }

    #[test]
    fn log_rank_of_known_times() {
        let [drug, placebo] = remissions();
        let test = LogRank::of(&drug, &placebo);
        // SciPy 1.17.1: logrank(CensoredData(...), placebo): statistic^2 and pvalue.
        close(
            (test.observed - test.expected) * (test.observed - test.expected) / test.variance,
            16.792_940_989_216_536,
        );
        close(test.p(), 4.168_809_109_334_529e-5);
        close(test.expected, 19.250_500_948_031_13);
        // The other way about: the inverse ratio, the same probability.
        let back = LogRank::of(&placebo, &drug);
        close(back.p(), test.p());
        let ([there, back], of) = ([test, back].map(|t| t.hazard_ratio(0.95)), 1.0);
        close(there.value * back.value, of);
        close(there.interval[0] * back.interval[1], of);
        assert_eq!(LogRank::of(&[(1.0, false)], &[(1.0, false)]).p(), 1.0);
    }

    #[test]
    fn shares_of_known_times() {
        let [drug, _] = remissions();
        // SciPy 1.17.1: ecdf(CensoredData(...)).sf.evaluate(t),
        // .confidence_interval(method="log-log").
        for (t, left, low, high) in [
            (10.0, 0.752_941_18, 0.503_199_51, 0.889_362_84),
            (23.0, 0.448_179_27, 0.188_052_01, 0.680_142_63),
        ] {
            let found = share_by(&drug, t, 0.95);
            let found = [found.value, found.interval[1], found.interval[0]].map(|v| 1.0 - v);
            for (a, b) in found.into_iter().zip([left, low, high]) {
                assert!((a - b).abs() < 2e-6, "{t}: {a} is not {b}");
            }
        }
        assert_eq!(share_by(&drug, 1.0, 0.95), Estimate { value: 0.0, interval: [0.0, 1.0] });
    }

    #[test]
    fn rates_of_known_counts() {
        // SciPy 1.17.1: chi2.ppf(0.025, 2 d)/2, chi2.ppf(0.975, 2 d + 2)/2.
        for (events, low, high) in [
            (0, 0.0, 3.688_879_454_113_935_4),
            (9, 4.115_373_097_378_334, 17.084_803_451_419_166),
            (200, 173.240_882_681_457_32, 229.721_981_665_449_87),
        ] {
            let times: Vec<Time> = (0..400).map(|i| (2.0, i < events)).collect();
            let found = rate(&times, 0.95);
            close(found.value, events as f64 / 800.0);
            close(found.interval[0] * 800.0, low);
            close(found.interval[1] * 800.0, high);
        }
    }

    #[test]
    fn differences_of_known_shares() {
        // Newcombe 1998, table II, method 10: 56/70 - 48/80 and 9/10 - 3/10; 0/20 - 0/10 by the
        // same formula.
        for (a, b, low, high) in [
            ([56, 70], [48, 80], 0.0524, 0.3339),
            ([9, 10], [3, 10], 0.1705, 0.8090),
            ([0, 20], [0, 10], -0.2775, 0.1611),
        ] {
            let [l, h] = difference(a, b, 0.95).interval;
            assert!((l - low).abs() < 6e-5 && (h - high).abs() < 6e-5, "{l} {h}");
        }
    }

    #[test]
    fn many_tests_are_adjusted_together() {
        let adjusted = holm(&[0.01, 0.04, 0.03, 0.005]);
        // R: p.adjust(c(0.01, 0.04, 0.03, 0.005), "holm").
        for (a, b) in adjusted.into_iter().zip([0.03, 0.06, 0.06, 0.02]) {
            assert!((a - b).abs() < 1e-12, "{a} {b}");
        }
    }

    #[test]
    fn exponential_times_give_their_hazards() {
        let mut random = RandomStream::new(17, 0);
        let mut draw = |hazard: f64, n: usize| -> Vec<Time> {
            let times = (0..n).map(|_| -ln(1.0 - random.uniform()) / hazard);
            times.map(|t| if t < 2.0 { (t, true) } else { (2.0, false) }).collect()
        };
        let (slow, fast) = (draw(0.44, 4000), draw(1.0, 4000));
        let ratio = LogRank::of(&slow, &fast).hazard_ratio(0.95);
        assert!((ratio.value - 0.44).abs() < 0.04 && ratio.interval[0] < ratio.value, "{ratio:?}");
        // The nominal level: 5 % of tests between equal groups reject.
        let rejected =
            (0..400).filter(|_| LogRank::of(&draw(1.0, 40), &draw(1.0, 60)).p() < 0.05).count();
        assert!((9..=33).contains(&rejected), "{rejected} of 400");
    }
}
