//! Results of capture, by its rules: times of capture by method, effect sizes of the
//! census, the map of the parameters by LSODA, and the likelihood of the published outcomes at each
//! candidate for alpha and beta. Writes the tables of docs/capture.md and docs/parameters.md.

use std::fmt::Write as _;

use super::audit::{self, Cell, Sweeps};
use super::census::{self, CensusRun, MotionKind, PANELS, tally};
use super::claims::Rules;
use super::effects::{self, Estimate, LogRank, Time};
use crate::Reading;
use twofold_analyse::counts::wilson;
use twofold_job::table::{Column, Entry, Table};
use twofold_num::elementary::{exp10, log10};
use twofold_num::random::RandomStream;

/// Stands before each text in docs/capture.md and docs/parameters.md.
pub const BEGIN: &str =
    "<!-- capture: what code/capture says; tests/it/capture.rs compares it; do not edit -->";
/// Stands after it.
pub const END: &str = "<!-- end of capture -->";

/// Runs of fig. 7(iii) by one method in one reading.
#[derive(Clone, Debug)]
pub struct ByMethod {
    /// The method, in words.
    pub name: &'static str,
    /// Its runs.
    pub runs: Vec<CensusRun>,
}

/// When a run was captured, or that it was not until `end`. An undecided run counts as not
/// captured.
pub fn time(run: &CensusRun, end: f64) -> Time {
    match run.kind(end) {
        MotionKind::Irregular | MotionKind::Undecided => (end, false),
        _ => run.captured().map_or((end, false), |t| (t, true)),
    }
}

/// Until when the share of captured runs is stated, by reading: about half of LSODA's are captured
/// then.
fn shown_by(reading: Reading) -> f64 {
    match reading {
        Reading::Printed => 2e3,
        Reading::Reconstructed => 1e5,
    }
}

/// Two significant digits, and as many of the interval's ends.
fn spread(e: Estimate, scale: f64) -> String {
    let largest = [e.value, e.interval[0], e.interval[1]]
        .map(|v| (scale * v).abs())
        .into_iter()
        .fold(0.0, f64::max);
    let digits = if largest >= 10.0 { 0 } else { 2 };
    format!(
        "{:.digits$} [{:.digits$}, {:.digits$}]",
        scale * e.value,
        scale * e.interval[0],
        scale * e.interval[1]
    )
}

/// The table of rates, hazard ratios and tests; in each reading the first method is the one that
/// the others are compared with.
pub fn capture_text(readings: &[(Reading, Vec<ByMethod>)], rules: &Rules) -> String {
    let times = |m: &ByMethod| -> Vec<Time> { m.runs.iter().map(|r| time(r, rules.end)).collect() };
    let tests: Vec<LogRank> = readings
        .iter()
        .flat_map(|(_, methods)| {
            methods[1..].iter().map(|m| LogRank::of(&times(m), &times(&methods[0])))
        })
        .collect();
    let adjusted = effects::holm(&tests.iter().map(LogRank::p).collect::<Vec<_>>());
    let mut tested = tests.iter().zip(adjusted);
    let mut text = String::from(
        "| reading | method | runs | captured | undecided | captures in 10⁵ units of time | \
            captured by t | hazard ratio to LSODA | log-rank p |\n\
         |---|---|---|---|---|---|---|---|---|\n",
    );
    for (reading, methods) in readings {
        for (i, method) in methods.iter().enumerate() {
            let times = times(method);
            let by = effects::share_by(&times, shown_by(*reading), rules.confidence);
            let test = if i == 0 { None } else { tested.next() };
            let compared = match test {
                Some((test, p)) => format!(
                    "{} | {}",
                    spread(test.hazard_ratio(rules.confidence), 1.0),
                    census::p_in_words(p).trim_start_matches("p = ").trim_start_matches("p ")
                ),
                None => "1 | ".to_owned(),
            };
            // Writing to a String cannot fail.
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} | {} | {} by {:e} | {compared} |",
                reading.word(),
                method.name,
                times.len(),
                times.iter().filter(|(_, captured)| *captured).count(),
                tally(&method.runs, rules.end)[5],
                spread(effects::rate(&times, rules.confidence), 1e5),
                census::percent(by.value, by.interval),
                shown_by(*reading),
            );
        }
    }
    text
}

/// Differences of the shares of each kind of outcome at the end, reconstructed reading: the
/// intervals 20 and 40 against 100, and tanh against its perturbation. `fig7` and `fig8` are the
/// census' sweeps.
pub fn effects_text(fig7: &Table, fig8: &Table, rules: &Rules) -> String {
    let alpha = || ("params.alpha", Entry::Number(Reading::Reconstructed.caricature().alpha));
    let panels: Vec<Vec<CensusRun>> = PANELS
        .iter()
        .enumerate()
        .map(|(i, p)| p.runs([fig7, fig8][i / 3], vec![alpha()]))
        .collect();
    let contrasts = [
        (panels[0].clone(), panels[2].clone()),
        (panels[1].clone(), panels[2].clone()),
        (panels[..3].concat(), panels[3..].concat()),
    ];
    let mut text = String::from(
        "| kind at t = 2·10⁵ | interval 20 less interval 100 | 40 less 100 | fig. 7 less fig. 8 \
            |\n|---|---|---|---|\n",
    );
    for (i, kind) in MotionKind::ALL.into_iter().enumerate() {
        let cells: Vec<String> = contrasts
            .iter()
            .map(|(a, b)| {
                let of = |runs: &[CensusRun]| [tally(runs, rules.end)[i], runs.len() as u64];
                let d = effects::difference(of(a), of(b), rules.confidence);
                let [v, low, high] = [d.value, d.interval[0], d.interval[1]].map(|v| 100.0 * v);
                format!("{v:+.1} [{low:+.1}, {high:+.1}]")
            })
            .collect();
        if contrasts.iter().any(|(a, b)| tally(a, rules.end)[i] + tally(b, rules.end)[i] > 0) {
            let _ = writeln!(text, "| {} | {} |", kind.words(), cells.join(" | "));
        }
    }
    let rows: Vec<Vec<u64>> = panels[..3]
        .iter()
        .map(|runs| {
            let undecided = tally(runs, rules.end)[5];
            vec![undecided, runs.len() as u64 - undecided]
        })
        .collect();
    let test =
        twofold_analyse::counts::homogeneity(&rows, rules.permutations, rules.permutation_seed);
    let counts: Vec<String> = rows.iter().map(|r| r[0].to_string()).collect();
    let _ = write!(
        text,
        "\nPercentage points with 95 % intervals. Undecided runs of the intervals 20, 40 and 100: \
            {}; the same share in all three: {}.",
        counts.join(", "),
        census::p_in_words(test.p_permutation)
    );
    text
}

/// A candidate for alpha and beta: runs, and those that show the outcome, for each of the audit's
/// seven panels and for the visits by t = 150.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Candidate {
    /// Its alpha and beta.
    pub at: [f64; 2],
    /// Runs of each outcome.
    pub runs: [u64; 8],
    /// Those that show it.
    pub hits: [u64; 8],
}

/// Visits by t = 150 that the eighth outcome needs.
const VISITS: f64 = 2.0;

impl Candidate {
    /// The candidates that the sweeps have runs of: as many of each panel as the one with the
    /// fewest has. `visits` has a row a run, with `params.alpha`, `params.beta` and `visits`.
    pub fn all(sweeps: &Sweeps, visits: &Table, rules: &Rules) -> Vec<Self> {
        let whole = audit::cells(sweeps, audit::ALL, rules);
        let fewest = std::array::from_fn(|panel| {
            usize::try_from(whole.iter().map(|cell| cell.runs[panel]).min().unwrap_or(0))
                .unwrap_or(usize::MAX)
        });
        let candidate = |cell: &Cell| {
            let here = |row: &usize| {
                visits.numbers("params.alpha")[*row] == cell.alpha
                    && visits.numbers("params.beta")[*row] == cell.beta
            };
            let rows: Vec<usize> = (0..visits.len()).filter(here).collect();
            let often =
                rows.iter().filter(|row| visits.numbers("visits")[**row] >= VISITS).count() as u64;
            let with = |seven: [u64; 7], last: u64| {
                std::array::from_fn(|i| if i < 7 { seven[i] } else { last })
            };
            Self {
                at: [cell.alpha, cell.beta],
                runs: with(cell.runs, rows.len() as u64),
                hits: with(cell.hits, often),
            }
        };
        audit::cells(sweeps, fewest, rules).iter().map(candidate).collect()
    }

    fn counts(&self) -> impl Iterator<Item = (u64, u64)> {
        self.hits.into_iter().zip(self.runs)
    }

    /// Decimal logarithm of the probability that one new run of each comes out as published: (hits
    /// + a)/(runs + 2 a) a share.
    fn predictive(&self, a: f64) -> f64 {
        self.counts().map(|(k, n)| log10((k as f64 + a) / (n as f64 + 2.0 * a))).sum()
    }

    /// A draw of the same, each share from its posterior with that pseudo-count.
    fn draw(&self, a: f64, random: &mut RandomStream) -> f64 {
        let share = |(k, n): (u64, u64)| {
            let weights = [k as f64 + a, (n - k) as f64 + a];
            log10(census::dirichlet(&weights, random)[0].max(f64::MIN_POSITIVE))
        };
        self.counts().map(share).sum()
    }

    fn name(&self) -> String {
        let reading = Reading::ALL.iter().find(|r| r.parameters() == self.at);
        let reading = reading.map_or(String::new(), |r| format!(" ({})", r.word()));
        format!("{:.3e}, {:.3e}{reading}", self.at[0], self.at[1]).replace(".000e", "e")
    }
}

/// The eight outcomes, in the candidates' order.
fn outcomes() -> impl Iterator<Item = &'static str> {
    audit::PANELS.iter().map(|p| p.name).chain(["visits"])
}

/// The numbers of runs that show each outcome, as a table: a row for each candidate and outcome.
pub fn count_table(candidates: &[Candidate]) -> Table {
    let head = [Column::numbers("alpha"), Column::numbers("beta"), Column::words("outcome")];
    let mut table =
        Table::new("counts", head.into_iter().chain(["runs", "hits"].map(Column::integers)));
    for c in candidates {
        for (outcome, (hits, runs)) in outcomes().zip(c.counts()) {
            table.push([
                c.at[0].into(),
                c.at[1].into(),
                outcome.into(),
                Entry::Integer(runs as i64),
                Entry::Integer(hits as i64),
            ]);
        }
    }
    table
}

/// The table of likelihoods: the number of runs that show each outcome.
pub fn likelihood_text(candidates: &[Candidate], rules: &Rules) -> String {
    let names = outcomes().collect::<Vec<_>>().join(" | ");
    let mut text = format!(
        "| α, β | {names} | outcomes in no run | all eight, by the shares | at most \
            |\n|---|{}---|---|---|\n",
        "---|".repeat(8)
    );
    for c in candidates {
        let counts = c.counts().map(|(k, n)| format!("{k}/{n}")).collect::<Vec<_>>().join(" | ");
        let most: f64 = c.counts().map(|(k, n)| wilson(k, n, rules.confidence)[1]).product();
        let likely: f64 = c.counts().map(|(k, n)| k as f64 / n as f64).product();
        let likely = if likely > 0.0 { format!("{likely:.0e}") } else { "0".into() };
        let never = c.hits.iter().filter(|k| **k == 0).count();
        let _ = writeln!(text, "| {} | {counts} | {never} | {likely} | {most:.0e} |", c.name());
    }
    text
}

/// Pseudo-counts, and probabilities of the printed numbers before any run.
const PSEUDO_COUNTS: [f64; 3] = [0.05, 0.5, 1.0];
const PRIORS: [f64; 4] = [0.5, 0.9, 0.99, 0.999];

/// Draws from the shares' posteriors.
const DRAWS: usize = 4000;

/// The table of posteriors: of the printed and the reconstructed numbers and of the best of the
/// others, for each pseudo-count and prior.
pub fn priors_text(candidates: &[Candidate], rules: &Rules) -> String {
    let place = |r: Reading| candidates.iter().position(|c| c.at == r.parameters());
    let [Some(printed), Some(reconstructed)] = Reading::ALL.map(place) else {
        return String::new();
    };
    let mut text = String::from(
        "| pseudo-count | printed before | printed after | reconstructed after | all others after \
            |\n|---|---|---|---|---|\n",
    );
    for a in PSEUDO_COUNTS {
        let mut random = RandomStream::new(rules.permutation_seed, 3);
        let means: Vec<f64> = candidates.iter().map(|c| c.predictive(a)).collect();
        let drawn: Vec<Vec<f64>> = (0..DRAWS)
            .map(|_| candidates.iter().map(|c| c.draw(a, &mut random)).collect())
            .collect();
        for prior in PRIORS {
            let others = (1.0 - prior) / (candidates.len() - 1) as f64;
            let posterior = |logs: &[f64]| -> [f64; 3] {
                let top = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                let weight = |(i, l): (usize, &f64)| {
                    exp10(l - top) * if i == printed { prior } else { others }
                };
                let weights: Vec<f64> = logs.iter().enumerate().map(weight).collect();
                let sum: f64 = weights.iter().sum();
                let [p, r] = [printed, reconstructed].map(|i| weights[i] / sum);
                [p, r, 1.0 - p - r]
            };
            let mean = posterior(&means);
            let draws: Vec<[f64; 3]> = drawn.iter().map(|logs| posterior(logs)).collect();
            let cell = |k: usize| {
                let mut values: Vec<f64> = draws.iter().map(|d| d[k]).collect();
                values.sort_by(f64::total_cmp);
                let tail = 0.5 * (1.0 - rules.confidence);
                let ends =
                    [tail, 1.0 - tail].map(|q| values[((values.len() - 1) as f64 * q) as usize]);
                census::percent(mean[k], ends)
            };
            let _ = writeln!(
                text,
                "| {a} | {} % | {} | {} | {} |",
                100.0 * prior,
                cell(0),
                cell(1),
                cell(2)
            );
        }
    }
    text
}

/// The six panels' runs in a cell of a map.
struct Mapped {
    at: [f64; 2],
    log_likelihood: f64,
    runs: Vec<CensusRun>,
}

fn mapped([fig7, fig8]: [&Table; 2], rules: &Rules) -> Vec<Mapped> {
    let values = |name: &str| {
        let mut found = fig7.numbers(name).to_vec();
        found.sort_by(f64::total_cmp);
        found.dedup();
        found
    };
    let pairs = values("params.alpha")
        .into_iter()
        .flat_map(|a| values("params.beta").into_iter().map(move |b| [a, b]));
    let cell = |at: [f64; 2]| {
        let chosen =
            || vec![("params.alpha", Entry::Number(at[0])), ("params.beta", Entry::Number(at[1]))];
        let panels: Vec<Vec<CensusRun>> =
            PANELS.iter().enumerate().map(|(i, p)| p.runs([fig7, fig8][i / 3], chosen())).collect();
        let share = |(panel, runs): (&census::CensusPanel, &Vec<CensusRun>)| {
            let hits = census::supporting(panel.said, runs, rules);
            log10((hits as f64 + 0.5) / (runs.len() as f64 + 1.0))
        };
        Mapped {
            at,
            log_likelihood: PANELS.iter().zip(&panels).map(share).sum(),
            runs: panels.concat(),
        }
    };
    pairs.map(cell).collect()
}

/// The map of the six panels' likelihood as a table, from sweeps of figs 7 and 8 over both
/// parameters.
pub fn map_table(sweeps: [&Table; 2], rules: &Rules) -> Table {
    let numbers = ["alpha", "beta", "log10_likelihood"].map(Column::numbers);
    let mut table = Table::new("map", numbers.into_iter().chain([Column::integers("runs")]));
    for Mapped { at, log_likelihood, runs } in mapped(sweeps, rules) {
        table.push([
            at[0].into(),
            at[1].into(),
            log_likelihood.into(),
            Entry::Integer(runs.len() as i64),
        ]);
    }
    table
}

/// The map of the six panels' likelihood by LSODA, and how it differs from that by Dormand-Prince.
pub fn map_text(lsoda: [&Table; 2], dopri5: [&Table; 2], rules: &Rules) -> String {
    let [ours, other] = [lsoda, dopri5].map(|tables| mapped(tables, rules));
    let mixed = |cell: &Mapped| tally(&cell.runs, rules.end).iter().filter(|n| **n > 0).count() > 1;
    let name = |[a, b]: [f64; 2]| format!("({a:.2e}, {b:.2e})").replace(".00e", "e");
    let mut betas: Vec<f64> = ours.iter().map(|c| c.at[1]).collect();
    betas.sort_by(f64::total_cmp);
    betas.dedup();
    let head: Vec<String> = betas.iter().map(|b| format!("{b:.2e}").replace(".00e", "e")).collect();
    let mut text =
        format!("| α \\ β | {} |\n|---|{}\n", head.join(" | "), "---|".repeat(betas.len()));
    for row in ours.chunks(betas.len()) {
        let cells: Vec<String> = row
            .iter()
            .map(|c| format!("{:.1}{}", c.log_likelihood, if mixed(c) { "*" } else { "" }))
            .collect();
        let _ = writeln!(
            text,
            "| {} | {} |",
            format!("{:.2e}", row[0].at[0]).replace(".00e", "e"),
            cells.join(" | ")
        );
    }
    // The largest, and how many others are within a factor of 10 of it.
    let top = |cells: &[Mapped]| -> Option<(String, usize)> {
        let best = cells.iter().max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))?;
        let near =
            cells.iter().filter(|c| c.log_likelihood > best.log_likelihood - 1.0).count() - 1;
        Some((format!("{:.1} at {}", best.log_likelihood, name(best.at)), near))
    };
    let [(ours_best, ours_near), (other_best, other_near)] =
        [&ours, &other].map(|cells| top(cells).unwrap_or_default());
    let runs = |cells: &[Mapped]| cells.iter().map(|c| c.runs.len()).min().unwrap_or(0);
    let pairs: Vec<(&Mapped, &Mapped)> = ours
        .iter()
        .zip(&other)
        .filter(|(a, b)| {
            mixed(a) || mixed(b) || {
                tally(&a.runs, rules.end).map(|n| n > 0) != tally(&b.runs, rules.end).map(|n| n > 0)
            }
        })
        .collect();
    let tests: Vec<f64> = pairs
        .iter()
        .map(|(a, b)| census::same_odds(&[a.runs.clone(), b.runs.clone()], rules).p_permutation)
        .collect();
    let adjusted = effects::holm(&tests);
    let differ: Vec<String> = pairs
        .iter()
        .zip(&adjusted)
        .filter(|(_, p)| **p < rules.significance)
        .map(|((a, _), _)| name(a.at))
        .collect();
    let _ = write!(
        text,
        "\nDecimal logarithm of the likelihood of the six outcomes of figs 7 and 8, LSODA, {} runs \
            a cell; * marks the {} of {} cells whose runs are not all \
         of one kind. The largest is {ours_best}, and {ours_near} others are within a factor of 10 \
         of it; by Dormand-Prince, with {} runs a cell: \
         {other_best}, and {other_near} others. Of {} cells in which there is something to \
         test, the two methods' kinds of outcome differ in {} (permutation test, Holm){}.",
        runs(&ours),
        ours.iter().filter(|c| mixed(c)).count(),
        ours.len(),
        runs(&other),
        pairs.len(),
        differ.len(),
        if differ.is_empty() { String::new() } else { format!(": {}", differ.join(", ")) }
    );
    text
}
