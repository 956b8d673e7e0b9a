//! Numbers of an answer that a claim reads.

use serde::Serialize;
use serde_json::Value;

use super::sets::{LONGEST, REPEATS, approached, blurred, period};
use crate::analyse::counts::wilson;
use crate::job::sweep::{is_open, is_outcome};
use crate::job::{Answer, Table};
use crate::paper::tables;

/// A number of an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Read {
    Fact {
        path: String,
        modulus: bool,
    },
    Column {
        table: Option<String>,
        column: String,
        take: Take,
        #[serde(skip_serializing_if = "Option::is_none")]
        word: Option<String>,
    },
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Take {
    Last,
    First,
    Max,
    Min,
    Mean,
    Span,
    Count,
    Share,
    Onset,
}

impl Read {
    /// The number of the second source: the fact that is named for it (`and-read`), taken as the
    /// first one's, or else the same.
    pub(super) fn of_the_other(&self, path: Option<&str>) -> Self {
        let modulus = matches!(self, Read::Fact { modulus: true, .. });
        path.map_or_else(|| self.clone(), |path| Read::Fact { path: path.to_owned(), modulus })
    }

    pub(super) fn of(&self, answer: &Answer) -> Result<f64, String> {
        match self {
            Read::Fact { path, modulus } => {
                let mut parts = path.split('/');
                let name = parts.next().unwrap_or_default();
                let known = || answer.facts.keys().cloned().collect::<Vec<_>>().join(", ");
                let mut at = answer.facts.get(name).ok_or_else(|| {
                    format!("the answer has no fact \"{name}\"; it has {}", known())
                })?;
                for part in parts {
                    let inner = match at {
                        Value::Array(list) => part.parse::<usize>().ok().and_then(|i| list.get(i)),
                        Value::Object(map) => map.get(part),
                        _ => None,
                    };
                    at = inner
                        .ok_or_else(|| format!("\"{path}\": there is no \"{part}\" in {at}"))?;
                }
                let number = |v: &Value| v.as_f64();
                match (at, modulus) {
                    (Value::Array(pair), true) if pair.len() == 2 => {
                        match (number(&pair[0]), number(&pair[1])) {
                            (Some(re), Some(im)) => Ok((re * re + im * im).sqrt()),
                            _ => Err(format!("\"{path}\" is {at}, which is no complex number")),
                        }
                    }
                    (value, false) if number(value).is_some() => {
                        Ok(number(value).unwrap_or(f64::NAN))
                    }
                    _ => Err(format!("\"{path}\" is {at}, which is no number")),
                }
            }
            Read::Column { table, column, take, .. } => {
                let table = tables::table(answer, table.as_deref())?;
                let values = tables::column(table, column)?;
                // Blank cells are no numbers.
                let numbers: Vec<f64> = values.iter().copied().filter(|v| !v.is_nan()).collect();
                let (low, high) = numbers
                    .iter()
                    .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(*v), b.max(*v)));
                let taken = match take {
                    Take::Count => values.len() as f64,
                    _ if values.is_empty() => {
                        return Err(format!("column \"{column}\" has no rows"));
                    }
                    _ if numbers.is_empty() => {
                        return Err(format!("column \"{column}\" is blank in every row"));
                    }
                    Take::Last => values[values.len() - 1],
                    Take::First => values[0],
                    Take::Max => high,
                    Take::Min => low,
                    Take::Mean => mean_over_time(table, &values)
                        .unwrap_or_else(|| numbers.iter().sum::<f64>() / numbers.len() as f64),
                    Take::Span => high - low,
                    // They are measured with an interval.
                    Take::Share | Take::Onset => return Err("it is no number of a row".into()),
                };
                if taken.is_nan() {
                    return Err(format!("column \"{column}\" is blank in that row"));
                }
                Ok(taken)
            }
        }
    }
}

/// The mean of a path's column over its time, by the trapezoidal rule; none of other tables.
fn mean_over_time(table: &Table, values: &[f64]) -> Option<f64> {
    let t = table.numbers("t");
    if table.name != "path" || t.len() != values.len() {
        return None;
    }
    let known: Vec<(f64, f64)> =
        t.iter().copied().zip(values.iter().copied()).filter(|(_, v)| !v.is_nan()).collect();
    let (time, sum) = known.windows(2).fold((0.0, 0.0), |(time, sum), rows| {
        let passed = rows[1].0 - rows[0].0;
        (time + passed, sum + 0.5 * passed * (rows[0].1 + rows[1].1))
    });
    (time > 0.0).then(|| sum / time)
}

/// A number with half of its 95 % interval, if it has one, or of the interval in which it lies.
pub(super) struct Measured {
    pub value: f64,
    pub half: f64,
    /// The finding before the number, in words.
    pub how: String,
}

impl Measured {
    pub(super) fn of(value: f64, half: f64) -> Self {
        Self { value, half, how: String::new() }
    }
}

impl std::fmt::Display for Measured {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.how)?;
        f.write_str(&short(self.value))?;
        if self.half > 0.0 { write!(f, " ± {}", short(self.half)) } else { Ok(()) }
    }
}

impl Read {
    /// The number with the interval that stands beside it, of runs at this tolerance.
    pub(super) fn measured(&self, answer: &Answer, rtol: f64) -> Result<Measured, String> {
        let beside = match self {
            Read::Column { table, column, take: Take::Share, word } => {
                let table = tables::table(answer, table.as_deref())?;
                return share(table, column, word.as_deref().unwrap_or_default());
            }
            Read::Column { table, column, take: Take::Onset, word } => {
                let table = tables::table(answer, table.as_deref())?;
                let word = word.as_deref().unwrap_or_default();
                let Onset::Between(a, b) = onset(table, column, word, rtol)? else {
                    return Err(format!("{word} does not begin in these rows"));
                };
                let how = format!("{word} begins from {} to {}: ", short(a), short(b));
                return Ok(Measured { value: 0.5 * (a + b), half: 0.5 * (b - a).abs(), how });
            }
            Read::Fact { path, modulus: false } => match path.strip_suffix("/value") {
                Some("exponent") => Some("half_width".to_owned()),
                Some(of) => Some(format!("{of}/half_width")),
                None => None,
            },
            _ => None,
        };
        let half = beside.map(|path| Read::Fact { path, modulus: false }.of(answer));
        Ok(Measured::of(self.of(answer)?, half.and_then(Result::ok).unwrap_or(0.0)))
    }

    /// The finding if it does not begin within `within` of `equals`, though rows reach so far on
    /// both sides.
    pub(super) fn never(
        &self,
        answer: &Answer,
        rtol: f64,
        [equals, within]: [f64; 2],
    ) -> Result<Option<String>, String> {
        let Read::Column { table, column, take: Take::Onset, word: Some(word) } = self else {
            return Ok(None);
        };
        let table = tables::table(answer, table.as_deref())?;
        let Onset::Never(a, b) = onset(table, column, word, rtol)? else { return Ok(None) };
        let said = format!("no {word} from {} to {} ({equals} claimed)", short(a), short(b));
        if a.min(b) <= equals - within && a.max(b) >= equals + within {
            return Ok(Some(said));
        }
        Err(format!("{said}: the rows do not reach so far"))
    }
}

/// The share of rows with this word, with the wider half of its 95 % interval (Wilson 1927), as if
/// rows were drawn at random. Of rows whose outcome is open any number may have the word.
pub(super) fn share(table: &Table, column: &str, word: &str) -> Result<Measured, String> {
    let words = tables::words(table, column)?;
    let outcomes = outcomes(table).unwrap_or_else(|| words.clone());
    let rows = words.len() as u64;
    if rows == 0 {
        return Err(format!("column \"{column}\" has no rows"));
    }
    let hits = words.iter().filter(|w| **w == word).count() as u64;
    let open =
        words.iter().zip(&outcomes).filter(|(w, o)| **w != word && is_open(o)).count() as u64;
    let (low, high) = (wilson(hits, rows, 0.95)[0], wilson(hits + open, rows, 0.95)[1]);
    let value = hits as f64 / rows as f64;
    let left = if open > 0 { format!(" ({open} are open)") } else { String::new() };
    let how = format!("{hits} of {rows} rows are {word}{left}: ");
    Ok(Measured { value, half: (high - value).max(value - low), how })
}

/// Outcomes of a sweep's rows, or of a map's.
pub(super) fn outcomes(table: &Table) -> Option<Vec<&str>> {
    ["outcome", "ending"].iter().find_map(|name| tables::words(table, name).ok())
}

/// Place of an onset.
#[derive(Debug, PartialEq)]
pub(super) enum Onset {
    /// Between the last value without it and the first one with it.
    Between(f64, f64),
    /// Not from this value to that one.
    Never(f64, f64),
}

/// Place where the outcome becomes this word, along a column whose values go one way. Rows whose
/// outcome is open make it wider.
pub(super) fn onset(table: &Table, column: &str, word: &str, rtol: f64) -> Result<Onset, String> {
    let values = tables::column(table, column)?;
    let rows: Vec<(f64, Option<bool>)> = match outcomes(table) {
        Some(outcomes) => {
            let is = |o: &&str| if is_open(o) { None } else { Some(*o == word) };
            values.iter().copied().zip(outcomes.iter().map(is)).collect()
        }
        None => periods(table, &values, rtol)
            .into_iter()
            .map(|(value, found)| (value, found.map(|n| Some(n) == period_of(word))))
            .collect(),
    };
    let rises = |a: f64, b: f64| rows.windows(2).all(|w| (b - a) * (w[1].0 - w[0].0) > 0.0);
    let (Some((first, _)), Some((last, _))) = (rows.first(), rows.last()) else {
        return Err(format!("column \"{column}\" has no rows"));
    };
    if !rises(*first, *last) {
        let why = "its values do not go one way; vary it alone, and give its values in order";
        return Err(format!("column \"{column}\" has no onset: {why}"));
    }
    let begins = rows.iter().position(|(_, is)| *is == Some(true));
    let before = &rows[..begins.unwrap_or(rows.len())];
    let without = before.iter().rev().find(|(_, is)| *is == Some(false));
    match (begins, without) {
        (Some(at), Some((without, _))) => Ok(Onset::Between(*without, rows[at].0)),
        (Some(at), None) => Err(format!(
            "{word} at {}, and no outcome before it: begin with a value that has another one",
            short(rows[at].0)
        )),
        (None, _) if rows.iter().all(|(_, is)| is.is_some()) => Ok(Onset::Never(*first, *last)),
        (None, _) => Err(format!("no row is {word}, and some are open; give a later t-end")),
    }
}

/// Periods of an orbit diagram's points, value by value; none if they do not come back, or errors
/// of a run may be what tells them apart.
pub(super) fn periods(table: &Table, values: &[f64], rtol: f64) -> Vec<(f64, Option<usize>)> {
    let states = table.columns.iter().skip_while(|c| c.name != "t").skip(1);
    let states: Vec<&[f64]> = states.map(|c| table.numbers(&c.name)).collect();
    let mut found = Vec::new();
    let mut from = 0;
    for group in values.chunk_by(|a, b| a == b) {
        let rows = from..from + group.len();
        from = rows.end;
        let points: Vec<Vec<f64>> = rows.map(|i| states.iter().map(|s| s[i]).collect()).collect();
        let period = period(&points, REPEATS).or_else(|| approached(&points));
        let is_told = blurred(&points, REPEATS, rtol, period).is_none();
        found.push((group[0], period.filter(|_| is_told)));
    }
    found
}

/// The K of "period-K".
pub(super) fn period_of(word: &str) -> Option<usize> {
    let period = word.strip_prefix("period-")?.parse().ok()?;
    (is_outcome(word) && period <= LONGEST).then_some(period)
}

/// So many digits as a reader wants.
pub(super) fn short(value: f64) -> String {
    let text = format!("{value:.6e}");
    match text.parse::<f64>() {
        Ok(rounded) if rounded == 0.0 || (1e-4..1e6).contains(&rounded.abs()) => {
            format!("{rounded}")
        }
        Ok(rounded) => format!("{rounded:e}"),
        Err(_) => text,
    }
}
