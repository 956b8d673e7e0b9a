//! The claims of a paper, and the checks that score them.

mod read;
mod sets;
mod written;

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use self::read::{Measured, Read, Take, short};
use self::sets::{LONGEST, apart, approached, blurred, later_half, narrows, period, section};
pub(super) use self::written::ClaimFile;
use super::words::Ask;
use super::{Folder, FolderError, Source};
use crate::analyse::counts::wilson;
use crate::job::general::MeanRate;
use crate::job::{Answer, AnyQuestion, Column, Executor, JobError, Table};
use crate::num::random::RandomStream;
use crate::record::Hash;

/// Repetitions of a check.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
struct OddsFile {
    /// Number of starts.
    starts: u64,
    /// Each state of the start moves by at most so much, uniformly.
    spread: f64,
    /// Of the random numbers [default: 2013].
    #[serde(default = "seed")]
    seed: u64,
    /// The share of runs in which the check has to hold, at the lower end of its 95 % interval;
    /// without it the run of the file alone decides.
    at_least: Option<f64>,
}

fn seed() -> u64 {
    2013
}

/// A claim with its check.
#[derive(Clone, Debug)]
pub struct Claim {
    /// A name of its own.
    pub id: String,
    /// Place in the paper.
    pub place: String,
    /// The claim, in our words.
    pub says: String,
    /// Its own words.
    pub quote: String,
    /// The day on which the rule was fixed.
    pub decided: String,
    /// Remarks beside the outcome.
    pub note: String,
    /// Digest of the rule: the check and all its numbers.
    pub rule: Hash,
    /// Digest of the claim's words: what it says, its quote and its place.
    pub words: Hash,
    check: Check,
    odds: Option<OddsFile>,
    of: String,
    and: Option<String>,
}

/// The check.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "check", rename_all = "kebab-case")]
enum Check {
    /// A number is the paper's.
    Value { read: Read, equals: f64, within: f64 },
    /// A number of one answer over that of another one is the paper's: an exponent, from two values
    /// of a parameter.
    Ratio { read: Read, other: Read, equals: f64, within: f64 },
    /// A number is less or greater than another one, or than another answer's.
    Order { read: Read, less: bool, than: Option<f64>, other: Option<Read> },
    /// The later half of a section repeats itself after so many crossings, and after no fewer.
    Period { is: u64, within: f64 },
    /// The largest exponent's 95 % interval lies above zero.
    Chaos,
    /// The later halves of two sections fill the same places.
    Attractors { same: bool, within: f64 },
    /// A branch changes its stability at a value of its parameter.
    Bifurcation { kind: String, at: f64, within: f64 },
}

/// Sections that come nearer than this share of their extent are the same.
const ALIKE: f64 = 0.05;

/// The result of a check.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct Verdict {
    /// The claim.
    pub claim: String,
    /// Digest of its rule.
    pub rule: Hash,
    /// The day on which the rule was fixed.
    pub decided: String,
    /// Digest of the answers that were read.
    pub data: Hash,
    /// Digest of the answers from the file's own start, if there are others.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub own_data: Option<Hash>,
    /// Whether the claim holds.
    pub agrees: bool,
    /// The finding.
    pub found: String,
    /// Repeated runs in which it holds, and all of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub odds: Option<[u64; 2]>,
    /// Whether the rule was changed when these data were already known.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub rule_after_data: bool,
    /// Digest of the claim's words; files of older versions have none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub words: Option<Hash>,
    /// Whether the words were changed when these data were already known.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub words_after_data: bool,
}

impl Verdict {
    /// Whether it was found in the data of another one, whatever other starts gave.
    pub fn has_data_of(&self, other: &Self) -> bool {
        let own = |v: &Self| v.own_data.clone().unwrap_or_else(|| v.data.clone());
        self.data == other.data || own(self) == own(other)
    }
}

type Origin = Arc<(String, String)>;

impl Claim {
    /// The panels and measures that it reads.
    pub fn reads(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.of.as_str()).chain(self.and.as_deref())
    }

    /// The kind of its check.
    pub fn kind(&self) -> &'static str {
        match &self.check {
            Check::Value { .. } => "value",
            Check::Ratio { .. } => "ratio",
            Check::Order { .. } => "order",
            Check::Period { .. } => "period",
            Check::Chaos => "chaos",
            Check::Attractors { .. } => "attractors",
            Check::Bifurcation { .. } => "bifurcation",
        }
    }

    /// Everything that scoring it asks, and for what: a panel, a measure, or a repetition.
    ///
    /// # Errors
    /// If a repeated run cannot be asked for.
    pub fn questions(&self, folder: &Folder) -> Result<Vec<(String, AnyQuestion)>, FolderError> {
        let own = |name: &str| (name.to_owned(), folder.sources[name].question.clone());
        let mut all: Vec<_> = self.reads().map(own).collect();
        let repeated = self.repeated(folder)?;
        let runs = repeated.len();
        for (i, questions) in repeated.into_iter().enumerate() {
            let purpose = format!("odds of {}, run {} of {runs}", self.id, i + 1);
            all.extend(questions.into_iter().map(|question| (purpose.clone(), question)));
        }
        Ok(all)
    }

    /// The questions of each repetition: those of the sources from starts that are moved by the
    /// same numbers.
    fn repeated(&self, folder: &Folder) -> Result<Vec<Vec<AnyQuestion>>, FolderError> {
        let Some(odds) = &self.odds else { return Ok(Vec::new()) };
        let sources: Vec<&Source> = self.reads().map(|name| &folder.sources[name]).collect();
        let starts = sources.iter().map(|source| start(source)).collect::<Result<Vec<_>, _>>()?;
        let mut all = Vec::new();
        for stream in 0..odds.starts {
            let mut random = RandomStream::new(odds.seed, stream);
            let longest = starts.iter().map(Vec::len).max().unwrap_or(0);
            let moves: Vec<f64> =
                (0..longest).map(|_| random.uniform_in(-odds.spread, odds.spread)).collect();
            let asked = sources.iter().zip(&starts).map(|(source, start)| {
                let moved: Vec<f64> = start.iter().zip(&moves).map(|(x, d)| x + d).collect();
                source.said.from_start(&moved).question(source.ask, &folder.root)
            });
            all.push(asked.collect::<Result<Vec<_>, _>>()?);
        }
        Ok(all)
    }

    /// Scores it.
    ///
    /// # Errors
    /// If an answer could not be computed, or has nothing of what is read.
    pub fn judge(&self, folder: &Folder, executor: &Executor<'_>) -> Result<Verdict, JobError> {
        let ask = |questions: &[AnyQuestion]| {
            questions
                .iter()
                .map(|q| executor.ask(&**q))
                .collect::<Result<Vec<Arc<Answer>>, JobError>>()
        };
        let own: Vec<AnyQuestion> =
            self.reads().map(|name| folder.sources[name].question.clone()).collect();
        let answers = ask(&own)?;
        let rtol = own.iter().map(|question| rtol(&question.json())).fold(0.0, f64::max);
        let judge = |questions: &[AnyQuestion], answers: &[Arc<Answer>]| {
            let answers = self.check.rows_of(questions, answers);
            self.check.of(&answers, rtol).map_err(JobError::Other)
        };
        let (mut agrees, mut found) = judge(&own, &answers)?;
        let mut hashes: Vec<String> =
            answers.iter().map(|a| a.hash().as_str().to_owned()).collect();
        let digest = |hashes: &[String]| Hash::of(hashes.join("\n").as_bytes());
        let own_data = self.odds.is_some().then(|| digest(&hashes));
        let mut odds = None;
        if let Some(rule) = &self.odds {
            let (mut hits, mut failed) = (0, 0);
            for questions in self.repeated(folder).map_err(|e| JobError::Other(e.to_string()))? {
                let judged = ask(&questions).and_then(|answers| {
                    hashes.extend(answers.iter().map(|a| a.hash().as_str().to_owned()));
                    judge(&questions, &answers)
                });
                match judged {
                    Ok((holds, _)) => hits += u64::from(holds),
                    Err(JobError::Interrupted) => return Err(JobError::Interrupted),
                    // It does not hold of a run that cannot be scored.
                    Err(_) => failed += 1,
                }
                executor.forget();
            }
            let [low, high] = wilson(hits, rule.starts, 0.95);
            found += &format!(
                "; the claim holds in {hits} of {} runs ({:.0} to {:.0} %)",
                rule.starts,
                100.0 * low,
                100.0 * high
            );
            if failed > 0 {
                found += &format!(", {failed} of them cannot be scored and count as against it");
            }
            if let Some(least) = rule.at_least {
                agrees = low >= least;
            }
            odds = Some([hits, rule.starts]);
        }
        Ok(Verdict {
            claim: self.id.clone(),
            rule: self.rule.clone(),
            decided: self.decided.clone(),
            data: digest(&hashes),
            own_data,
            agrees,
            found,
            odds,
            rule_after_data: false,
            words: Some(self.words.clone()),
            words_after_data: false,
        })
    }
}

/// Relative tolerance of a question's runs; 0 if it has none.
fn rtol(question: &Value) -> f64 {
    let own = |run: &Value| {
        let method = &run["method"];
        method["rtol"].as_f64().or(method["tolerance"]["rtol"].as_f64())
    };
    own(question).or(own(&question["sweep"]["run"])).unwrap_or(0.0)
}

/// Start of a source's run.
fn start(source: &Source) -> Result<Vec<f64>, FolderError> {
    let json = source.question.json();
    let numbers = json["start"]
        .as_array()
        .map(|list| list.iter().filter_map(Value::as_f64).collect::<Vec<_>>());
    match numbers {
        Some(start) if !start.is_empty() && source.ask != Ask::Rests => Ok(start),
        _ => {
            Err(source.said.complain("odds move the start of a run, and this has none; give start"))
        }
    }
}

/// Whether a number is off by at most `within`, if its interval does not leave that open.
fn is_within(off: f64, half: f64, within: f64, said: &str) -> Result<bool, String> {
    if off <= within && off + half > within || off > within && off - half <= within {
        return Err(undecided(said));
    }
    Ok(off <= within)
}

fn undecided(said: &str) -> String {
    format!("{said}: the interval does not decide it; compute it more exactly")
}

impl Check {
    /// The answers as they are read: beside the multiples of a time, a count has no rows of events.
    fn rows_of(&self, questions: &[AnyQuestion], answers: &[Arc<Answer>]) -> Vec<Arc<Answer>> {
        let (Self::Value { read, .. } | Self::Ratio { read, .. } | Self::Order { read, .. }) = self
        else {
            return answers.to_vec();
        };
        if !matches!(read, Read::Column { take: Take::Count, .. }) {
            return answers.to_vec();
        }
        let pairs = questions.iter().zip(answers);
        pairs
            .map(|(question, answer)| {
                let json = question.json();
                if question.kind() == "general-run" && json["observe"].get("times").is_some() {
                    Arc::new(without_events(answer))
                } else {
                    answer.clone()
                }
            })
            .collect()
    }

    /// Whether it holds of these answers of runs at this tolerance, and what was found.
    fn of(&self, answers: &[Arc<Answer>], rtol: f64) -> Result<(bool, String), String> {
        let first = &answers[0];
        match self {
            Check::Value { read, equals, within } => {
                if let Some(said) = read.never(first, rtol, [*equals, *within])? {
                    return Ok((false, said));
                }
                let found = read.measured(first, rtol)?;
                let off = (found.value - equals).abs();
                let said = format!("{found} ({equals} claimed, {} off)", short(off));
                Ok((is_within(off, found.half, *within, &said)?, said))
            }
            Check::Ratio { read, other, equals, within } => {
                let over = read.measured(first, rtol)?;
                let under = other.measured(answers.last().unwrap_or(first), rtol)?;
                let ratio = over.value / under.value;
                let off = (ratio - equals).abs();
                let said = format!(
                    "{over} / {under} = {} ({equals} claimed, {} off)",
                    short(ratio),
                    short(off)
                );
                let both = over.half + ratio.abs() * under.half;
                // Without end if 0 may divide.
                let least = (under.value.abs() - under.half).max(0.0);
                let half = if both > 0.0 { both / least } else { 0.0 };
                Ok((is_within(off, half, *within, &said)?, said))
            }
            Check::Order { read, less, than, other } => {
                let value = read.measured(first, rtol)?;
                let than = match (than, other) {
                    (Some(than), _) => Measured::of(*than, 0.0),
                    (None, Some(other)) => other.measured(answers.last().unwrap_or(first), rtol)?,
                    (None, None) => return Err("nothing to compare with".into()),
                };
                let more = value.value - than.value;
                let (holds, word) = match more {
                    _ if value.half + than.half > 0.0 && more.abs() <= value.half + than.half => {
                        return Err(undecided(&format!("{value} beside {than}")));
                    }
                    m if m < 0.0 => (*less, "less than"),
                    m if m > 0.0 => (!*less, "greater than"),
                    _ => (false, "not different from"),
                };
                Ok((holds, format!("{value}, {word} {than}")))
            }
            Check::Period { is, within } => {
                let (points, direction) = section(first, None)?;
                let longest = LONGEST.min(points.len() / 3);
                let reached = period(&points, *within);
                let found = reached.or_else(|| {
                    approached(&points).filter(|_| !narrows(first, &points, direction))
                });
                if found.is_none() && longest < *is as usize {
                    return Err(format!(
                        "the section is crossed {} times in the later half, and three times around \
                            a period of {is} are {}; give a later t-end",
                        points.len(),
                        3 * is
                    ));
                }
                let none = || format!("no period up to {longest}");
                if let Some(n) = blurred(&points, *within, rtol, found) {
                    return Err(format!(
                        "{}, and period {n} but for distances that errors of a run at rtol \
                            {rtol:e} may have; give a smaller rtol",
                        found.map_or_else(none, |n| format!("period {n}"))
                    ));
                }
                let still = if reached.is_none() { ", still approached" } else { "" };
                let said = found.map_or_else(none, |n| format!("period {n}{still}"));
                Ok((found == Some(*is as usize), said))
            }
            Check::Chaos => {
                let (value, half) = largest_exponent(first)?;
                let said = format!("largest exponent {} ± {}", short(value), short(half));
                match (value - half > 0.0, value + half < 0.0) {
                    (false, false) => Err(undecided(&said)),
                    (above, _) => Ok((above, said)),
                }
            }
            Check::Attractors { same, within } => {
                // Both by crossings in one direction, that of the first.
                let (a, direction) = section(first, None).map_err(|e| format!("`of`: {e}"))?;
                let second = answers.last().unwrap_or(first);
                let (b, _) = section(second, direction).map_err(|e| format!("`and`: {e}"))?;
                let both_ways = |answer| later_half(answer, &|_| true);
                let distance = apart([&a, &b], [&both_ways(first)?, &both_ways(second)?])?;
                let alike = distance <= *within;
                let word = if alike { "the same attractor" } else { "different attractors" };
                Ok((alike == *same, format!("{word}: {} of their extent apart", short(distance))))
            }
            Check::Bifurcation { kind, at, within } => {
                let table = first
                    .table("bifurcations")
                    .ok_or("the measure follows no branch; give along")?;
                let parameter = &table.columns[1].name;
                let values = table.numbers(parameter);
                let mut near: Option<(f64, f64)> = None;
                let rows = table.words("change").zip(values).zip(table.numbers("uncertainty"));
                for ((word, value), half) in rows {
                    let off = (value - at).abs();
                    if word == kind && near.is_none_or(|(old, _)| off < (old - at).abs()) {
                        near = Some((*value, half.max(0.0)));
                    }
                }
                Ok(match near {
                    Some((value, half)) => {
                        let off = (value - at).abs();
                        let said = format!(
                            "{kind} at {parameter} = {} ({at} claimed, {} off)",
                            short(value),
                            short(off)
                        );
                        let open = format!("{said}, ± {}", short(half));
                        (is_within(off, half, *within, &open)?, said)
                    }
                    None => (false, format!("no {kind} on the branch")),
                })
            }
        }
    }
}

/// An answer without its tables' rows of events.
fn without_events(answer: &Answer) -> Answer {
    let mut answer = answer.clone();
    for table in &mut answer.tables {
        let is_event: Vec<bool> = table.words("event").map(|word| !word.is_empty()).collect();
        if is_event.is_empty() {
            continue;
        }
        let columns = table.columns.iter().map(|c| Column::new(&c.name, &c.unit, c.kind()));
        let mut kept = Table::new(&table.name, columns);
        kept.extend(table.rows().into_iter().zip(is_event).filter(|r| !r.1).map(|r| r.0));
        *table = kept;
    }
    answer
}

fn largest_exponent(answer: &Answer) -> Result<(f64, f64), String> {
    let no = |e: &dyn std::fmt::Display| format!("there is no exponent with an interval: {e}");
    if answer.facts.contains_key("exponents") {
        let all: Vec<MeanRate> = answer.fact("exponents").map_err(|e| no(&e))?;
        let first = all.first().ok_or("there is no exponent")?;
        return Ok((first.value.unwrap_or(f64::NEG_INFINITY), first.half_width));
    }
    // Of the largest alone, with its error and duration, or a number.
    let exponent: Value = answer.fact("exponent").map_err(|e| no(&e))?;
    let value = exponent.get("value").unwrap_or(&exponent).as_f64();
    let value = value.ok_or_else(|| no(&format!("it is {exponent}")))?;
    let half: f64 = answer.fact("half_width").map_err(|e| no(&e))?;
    Ok((value, half))
}

/// Verdicts by claim.
pub type Verdicts = BTreeMap<String, Verdict>;

#[cfg(test)]
mod tests;
