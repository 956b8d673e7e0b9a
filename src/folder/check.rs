//! The claims of a paper, and the checks that score them.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use toml::Spanned;
use toml::value::Datetime;

use super::words::Ask;
use super::{Folder, FolderError, Source};
use crate::analyse::branch::Change;
use crate::analyse::counts::wilson;
use crate::job::general::MeanRate;
use crate::job::sweep::{is_open, is_outcome};
use crate::job::{Answer, AnyQuestion, Column, Executor, JobError, Table};
use crate::num::elementary::pow;
use crate::num::random::RandomStream;
use crate::paper::tables;
use crate::record::Hash;
use crate::system::diagnostic::nearest;

/// A claim as it is written.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename_all = "kebab-case")]
pub struct ClaimFile {
    /// A name of its own.
    pub id: Spanned<String>,
    /// Place in the paper: "sec. 4.2, fig. 7(ii)".
    place: String,
    /// The claim in our words, so that it can be measured.
    says: String,
    /// Its own words, a few of them.
    #[serde(default)]
    quote: String,
    /// The day on which the rule was fixed, as a date of TOML: 2026-11-27, without quotes.
    decided: Spanned<Datetime>,
    /// Remarks beside the outcome: what was tried, what the paper leaves open.
    #[serde(default)]
    note: String,
    /// The kind of check.
    check: Spanned<String>,
    /// The panel or measure that is read.
    of: Spanned<String>,
    /// A second one.
    and: Option<Spanned<String>>,
    /// A fact of the answer: "period", "multipliers/0/1".
    read: Option<Spanned<String>>,
    /// The same of the second one.
    and_read: Option<Spanned<String>>,
    /// Or a column of a table.
    column: Option<Spanned<String>>,
    /// The table [default: the first].
    table: Option<Spanned<String>>,
    /// Quantity of the column, or of a complex fact: last, first, max, min, mean, span, count,
    /// modulus. A mean of a path is one over its time, of other tables one over rows; with `every`
    /// in the run a count leaves out rows of events. Of a scan or sweep also share, of rows with
    /// this `word`, and onset, the column's value from which on the outcome is this `word`.
    take: Option<Spanned<String>>,
    /// The word of share and onset: an outcome of a sweep, "period-1".
    word: Option<Spanned<String>>,
    /// The paper's value.
    equals: Option<Spanned<f64>>,
    /// Largest difference that still agrees.
    within: Option<Spanned<f64>>,
    /// `less` or `greater`.
    relation: Option<Spanned<String>>,
    /// Number with which the value is compared.
    than: Option<Spanned<f64>>,
    /// A period of a section, in crossings.
    is: Option<Spanned<u64>>,
    /// Whether two attractors are the same.
    same: Option<Spanned<bool>>,
    /// The kind of a bifurcation: period-doubling, fold, branching, torus, hopf, vanishing,
    /// grazing, discontinuity-induced or set-valued.
    kind: Option<Spanned<String>>,
    /// The parameter's value at it.
    at: Option<Spanned<f64>>,
    /// Repeated from other starts.
    odds: Option<Spanned<OddsFile>>,
}

/// A name with its place.
type Name = Spanned<String>;

impl ClaimFile {
    /// The column that it reads with its table, and the panels or measures whose it is.
    pub(super) fn column(&self) -> Option<(Name, Option<Name>, Vec<Name>)> {
        let of = std::iter::once(&self.of).chain(&self.and).cloned().collect();
        Some((self.column.clone()?, self.table.clone(), of))
    }

    /// Whether that is a column of words.
    pub(super) fn counts_words(&self) -> bool {
        self.take.as_ref().is_some_and(|take| take.get_ref() == "share")
    }
}

impl ClaimFile {
    /// The fault of a share or onset that is taken of this source, with its place and advice.
    fn misread(&self, name: &Name, source: &Source) -> Option<(Range<usize>, String, String)> {
        let take = self.take.as_ref()?;
        let (column, word) = (self.column.as_ref()?, self.word.as_ref()?);
        let of = name.get_ref();
        let taken = take.get_ref().as_str();
        if !["share", "onset"].contains(&taken) {
            return None;
        }
        let json = source.question.json();
        let settings = json["sweep"]["over"].as_array().map_or(0, Vec::len);
        let is_diagram = source.ask == Ask::Scan && settings == 1;
        let sweep = "name a measure with sweep = { ... }".to_owned();
        if !matches!(source.ask, Ask::Scan | Ask::Sweep) || taken == "share" && is_diagram {
            let why =
                format!("`{of}` asks for {}, of which no {taken} is taken", source.ask.asked());
            return Some((name.span(), why, sweep));
        }
        if taken == "onset" && json["follow"] == "both" {
            let why = format!("`{of}` goes up and down, and has two onsets");
            return Some((name.span(), why, "follow up or down in a measure of its own".into()));
        }
        let given = word.get_ref();
        let wrong = |why: String, help: &str| Some((word.span(), why, help.to_owned()));
        if is_diagram && period_of(given).is_none_or(|period| period < 2) {
            let why = format!("an orbit diagram does not tell where `{given}` begins");
            return wrong(why, &format!("give period-2 to period-{LONGEST}, or {sweep}"));
        }
        if taken == "onset" && is_open(given) {
            return wrong(format!("`{given}` leaves open what a run ends on"), "give an outcome");
        }
        let outcome =
            taken == "onset" || ["outcome", "ending"].contains(&column.get_ref().as_str());
        let by_event = source.ask == Ask::Scan
            && (given.starts_with("stopped by ") || given.ends_with(" accumulates"));
        if outcome && !is_outcome(given) && !by_event {
            let help = "give rest, period-K, irregular or another word of a sweep's outcomes";
            return wrong(format!("there is no outcome `{given}`"), help);
        }
        None
    }
}

/// The K of "period-K".
fn period_of(word: &str) -> Option<usize> {
    let period = word.strip_prefix("period-")?.parse().ok()?;
    (is_outcome(word) && period <= LONGEST).then_some(period)
}

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

/// A number of an answer.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Read {
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
enum Take {
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

/// Kinds of checks, the keys that each needs beside `of`, and those that it may have.
const KINDS: [(&str, &[&str], &[&str]); 7] = [
    ("value", &["equals", "within"], &["read", "column", "table", "take", "word"]),
    (
        "ratio",
        &["equals", "within", "and"],
        &["read", "column", "table", "take", "word", "and-read"],
    ),
    (
        "order",
        &["relation"],
        &["read", "column", "table", "take", "word", "than", "and", "and-read"],
    ),
    ("period", &["is"], &["within"]),
    ("chaos", &[], &[]),
    ("attractors", &["and", "same"], &["within"]),
    ("bifurcation", &["kind", "at", "within"], &[]),
];

/// Distances in a section are compared with its extent.
const REPEATS: f64 = 1e-6;
/// Sections that come nearer than this share of their extent are the same.
const ALIKE: f64 = 0.05;
/// The longest period that is looked for.
const LONGEST: usize = 64;

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
    /// Checks a claim as it is written; `known` gives the panel or measure of a name.
    pub(super) fn read<'a>(
        origin: &Origin,
        claim: Spanned<ClaimFile>,
        known: &dyn Fn(&Spanned<String>) -> Result<&'a Source, FolderError>,
    ) -> Result<Self, FolderError> {
        let place = claim.span();
        let c = claim.into_inner();
        let wrong = |at: Range<usize>, why: String, help: String| {
            FolderError::at(origin, at, why, (!help.is_empty()).then_some(help))
        };
        let kinds = KINDS.map(|(kind, ..)| kind);
        let Some((kind, needs, may)) = KINDS.iter().find(|(kind, ..)| kind == c.check.get_ref())
        else {
            let given = c.check.get_ref();
            let why = format!("there is no check `{given}`");
            return Err(wrong(c.check.span(), why, one_of(given, &kinds)));
        };
        let given = [
            ("read", c.read.as_ref().map(Spanned::span)),
            ("and-read", c.and_read.as_ref().map(Spanned::span)),
            ("column", c.column.as_ref().map(Spanned::span)),
            ("table", c.table.as_ref().map(Spanned::span)),
            ("take", c.take.as_ref().map(Spanned::span)),
            ("word", c.word.as_ref().map(Spanned::span)),
            ("equals", c.equals.as_ref().map(Spanned::span)),
            ("within", c.within.as_ref().map(Spanned::span)),
            ("relation", c.relation.as_ref().map(Spanned::span)),
            ("than", c.than.as_ref().map(Spanned::span)),
            ("is", c.is.as_ref().map(Spanned::span)),
            ("same", c.same.as_ref().map(Spanned::span)),
            ("kind", c.kind.as_ref().map(Spanned::span)),
            ("at", c.at.as_ref().map(Spanned::span)),
            ("and", c.and.as_ref().map(Spanned::span)),
        ];
        if let Some((key, Some(at))) = given
            .iter()
            .find(|(key, at)| at.is_some() && ![needs, may].iter().any(|l| l.contains(key)))
        {
            return Err(wrong(
                at.clone(),
                format!("`{key}` has no effect on a check of {kind}"),
                "leave it out".into(),
            ));
        }
        let missing = |what: &str| {
            wrong(place.clone(), format!("a check of {kind} needs {what}"), String::new())
        };
        if let Some((key, _)) = given.iter().find(|(key, at)| at.is_none() && needs.contains(key)) {
            return Err(missing(&format!("`{key}`")));
        }
        let of = known(&c.of)?;
        let and = c.and.as_ref().map(known).transpose()?;
        let facts = [(&c.read, of), (&c.read, and.unwrap_or(of)), (&c.and_read, and.unwrap_or(of))];
        for (path, source) in facts {
            let Some(path) = path else { continue };
            let modulus = c.take.as_ref().is_some_and(|take| take.get_ref() == "modulus");
            if !source.ask.has_number(path.get_ref(), modulus) {
                let (why, help) = no_number(source.ask, path.get_ref(), modulus);
                return Err(wrong(path.span(), why, help));
            }
        }
        super::day(origin, "decided", &c.decided)?;
        for (name, source) in std::iter::once((&c.of, of)).chain(c.and.as_ref().zip(and)) {
            if let Some((at, why, help)) = c.misread(name, source) {
                return Err(wrong(at, why, help));
            }
        }
        let reads = [(Some(&c.of), Some(of)), (c.and.as_ref(), and)];
        for (name, source) in reads.iter().filter_map(|(name, source)| Some(((*name)?, (*source)?)))
        {
            let (fits, needs) = match *kind {
                "chaos" => (source.ask == Ask::Lyapunov, "lyapunov = { ... }"),
                "period" | "attractors" => {
                    (source.ask == Ask::Run, "run = { ..., section = \"y=0\" }")
                }
                _ => continue,
            };
            let is_run = fits && source.ask == Ask::Run;
            if !fits {
                let why = format!(
                    "`{}` asks for {}, of which there is no check of {kind}",
                    name.get_ref(),
                    source.ask.asked()
                );
                return Err(wrong(name.span(), why, format!("name one with {needs}")));
            }
            if is_run && !source.said.gives("section") {
                let why = format!("`{}` records no crossings", name.get_ref());
                return Err(wrong(name.span(), why, format!("give it {needs}")));
            }
            let states = source.question.json()["start"].as_array().map(Vec::len);
            if is_run && states == Some(1) && !source.said.has_section_in_time() {
                let why = format!(
                    "`{}` is a section of a system with one state: one point, which says nothing \
                        of its motion",
                    name.get_ref()
                );
                let help = "read an orbit's period, or a column".to_owned();
                return Err(wrong(name.span(), why, help));
            }
        }
        let asks = |source: &Source| (source.ask, source.question.json());
        let same_read = c.and_read.as_ref().is_none_or(|r| c.read.as_ref() == Some(r));
        if let (Some(name), Some(other)) = (&c.and, and)
            && same_read
            && asks(of) == asks(other)
        {
            let why = format!("`{}` is the same as `of`: the check is of nothing", name.get_ref());
            return Err(wrong(name.span(), why, "name another panel or measure".into()));
        }
        let number = |value: &Option<Spanned<f64>>, what: &str| match value {
            Some(v) if v.get_ref().is_finite() => Ok(*v.get_ref()),
            Some(v) => {
                Err(wrong(v.span(), format!("{what} is not a finite number"), String::new()))
            }
            None => Err(missing(what)),
        };
        let tolerance = |default: Option<f64>| match (&c.within, default) {
            (Some(v), _) if v.get_ref().is_finite() && *v.get_ref() >= 0.0 => Ok(*v.get_ref()),
            (Some(v), _) => {
                Err(wrong(v.span(), "`within` is a finite number, 0 or more".into(), String::new()))
            }
            (None, Some(default)) => Ok(default),
            (None, None) => Err(missing("`within`")),
        };
        let check = match *kind {
            "value" => Check::Value {
                read: reading(origin, &place, &c)?,
                equals: number(&c.equals, "`equals`")?,
                within: tolerance(None)?,
            },
            "ratio" => {
                let read = reading(origin, &place, &c)?;
                let other = read.of_the_other(c.and_read.as_ref());
                Check::Ratio {
                    read,
                    other,
                    equals: number(&c.equals, "`equals`")?,
                    within: tolerance(None)?,
                }
            }
            "order" => {
                let less = match c.relation.as_ref().map(|r| (r.get_ref().as_str(), r.span())) {
                    Some(("less" | "<", _)) => true,
                    Some(("greater" | ">", _)) => false,
                    Some((other, at)) => {
                        let why = format!("there is no relation `{other}`");
                        return Err(wrong(at, why, "give less or greater".into()));
                    }
                    None => return Err(missing("`relation`")),
                };
                let read = reading(origin, &place, &c)?;
                let other = match (&c.and, &c.and_read, &c.than) {
                    (Some(_), path, None) => Some(read.of_the_other(path.as_ref())),
                    (None, None, Some(_)) => None,
                    (Some(_), _, Some(than)) => {
                        let why = "`than` and `and` are both given";
                        return Err(wrong(than.span(), why.into(), "leave one of them out".into()));
                    }
                    _ => {
                        return Err(missing(
                            "`than`, a number, or `and`, another panel or measure",
                        ));
                    }
                };
                let than = if other.is_none() { Some(number(&c.than, "`than`")?) } else { None };
                Check::Order { read, less, than, other }
            }
            "period" => Check::Period {
                is: match &c.is {
                    Some(n) if (1..=LONGEST as u64).contains(n.get_ref()) => *n.get_ref(),
                    Some(n) => {
                        return Err(wrong(
                            n.span(),
                            format!("a period is 1 to {LONGEST} crossings"),
                            String::new(),
                        ));
                    }
                    None => return Err(missing("`is`")),
                },
                within: tolerance(Some(REPEATS))?,
            },
            "chaos" => Check::Chaos,
            "attractors" => {
                let same = c.same.as_ref().ok_or_else(|| missing("`same`"))?;
                Check::Attractors { same: *same.get_ref(), within: tolerance(Some(ALIKE))? }
            }
            _ => {
                let kind = c.kind.as_ref().ok_or_else(|| missing("`kind`"))?;
                let kinds = Change::ALL.map(Change::word);
                if !kinds.contains(&kind.get_ref().as_str()) {
                    let why = format!("there is no bifurcation `{}`", kind.get_ref());
                    return Err(wrong(kind.span(), why, one_of(kind.get_ref(), &kinds)));
                }
                if !of.said.gives("along") {
                    return Err(wrong(
                        c.of.span(),
                        format!("`{}` follows no branch", c.of.get_ref()),
                        "give the orbit along = \"PARAMETER=FROM..TO\"".into(),
                    ));
                }
                Check::Bifurcation {
                    kind: kind.get_ref().clone(),
                    at: number(&c.at, "`at`")?,
                    within: tolerance(None)?,
                }
            }
        };
        if let Some(odds) = &c.odds {
            let OddsFile { starts, spread, at_least, .. } = odds.get_ref();
            let share = at_least.is_none_or(|s| s > 0.0 && s < 1.0);
            if !((1..=1_000_000).contains(starts) && spread.is_finite() && *spread > 0.0 && share) {
                let why =
                    "odds have 1 to 1000000 starts, a spread above 0, and at-least between 0 and 1"
                        .to_owned();
                return Err(wrong(odds.span(), why, String::new()));
            }
        }
        let odds = c.odds.map(Spanned::into_inner);
        let rule = Hash::of_json(&json!({
            "check": check, "odds": odds, "of": c.of.get_ref(),
                "and": c.and.as_ref().map(Spanned::get_ref),
        }));
        let words = Hash::of_json(&json!([c.says, c.quote, c.place]));
        Ok(Self {
            id: c.id.into_inner(),
            place: c.place,
            says: c.says,
            quote: c.quote,
            decided: c.decided.get_ref().to_string(),
            note: c.note,
            rule,
            words,
            check,
            odds,
            of: c.of.into_inner(),
            and: c.and.map(Spanned::into_inner),
        })
    }

    /// The panels and measures that it reads.
    pub fn reads(&self) -> impl Iterator<Item = &str> {
        std::iter::once(self.of.as_str()).chain(self.and.as_deref())
    }

    /// The odds in words, if it has any.
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

/// Advice where a word is none of those that are known.
fn one_of(word: &str, known: &[&str]) -> String {
    nearest(word, known).map_or_else(
        || format!("there are {}", known.join(", ")),
        |near| format!("did you mean `{near}`?"),
    )
}

/// The fault of a fact's path that leads to no number, and advice.
fn no_number(ask: Ask, path: &str, modulus: bool) -> (String, String) {
    fn head(path: &str) -> &str {
        path.split('/').next().unwrap_or_default()
    }
    let (name, all) = (head(path), ask.numbers());
    if all.is_empty() {
        let why = format!("{} has no facts to read", ask.asked());
        return (why, "give column = \"NAME\" with take".to_owned());
    }
    let mut heads: Vec<&str> = all.iter().map(|known| head(known)).collect();
    heads.dedup();
    if !heads.contains(&name) {
        return (format!("no answer has a number `{name}`"), one_of(name, &heads));
    }
    let of_name = all.iter().filter(|known| head(known) == name);
    let known: Vec<String> = of_name
        .filter_map(|known| if modulus { known.strip_suffix("/0") } else { Some(known) })
        .map(|known| known.replace('*', "N"))
        .collect();
    let kind = if modulus { "complex number" } else { "number" };
    let help = match known.as_slice() {
        [] => "leave out take".to_owned(),
        known => format!("give {}", known.join(" or ")),
    };
    (format!("`{path}` is no {kind} of an answer"), help)
}

/// The number that a claim reads of its first source.
fn reading(origin: &Origin, place: &Range<usize>, c: &ClaimFile) -> Result<Read, FolderError> {
    let wrong = |at: Range<usize>, why: String, help: &str| {
        FolderError::at(origin, at, why, Some(help.to_owned()))
    };
    match (&c.read, &c.column) {
        (Some(path), None) => {
            let modulus = match c.take.as_ref().map(|t| (t.get_ref().as_str(), t.span())) {
                None => false,
                Some(("modulus", _)) => true,
                Some((other, at)) => {
                    return Err(wrong(
                        at,
                        format!("`{other}` is taken of a column"),
                        "give modulus, or leave it out",
                    ));
                }
            };
            if let Some(word) = &c.word {
                let why = "`word` has no effect on a fact".into();
                return Err(wrong(word.span(), why, "leave it out, or give column"));
            }
            if let Some(table) = &c.table {
                return Err(wrong(
                    table.span(),
                    "`table` has no effect on a fact".into(),
                    "leave it out, or give column",
                ));
            }
            Ok(Read::Fact { path: path.get_ref().clone(), modulus })
        }
        (None, Some(column)) => {
            let take = match c.take.as_ref().map(|t| (t.get_ref().as_str(), t.span())) {
                Some(("last", _)) => Take::Last,
                Some(("first", _)) => Take::First,
                Some(("max", _)) => Take::Max,
                Some(("min", _)) => Take::Min,
                Some(("mean", _)) => Take::Mean,
                Some(("span", _)) => Take::Span,
                Some(("count", _)) => Take::Count,
                Some(("share", _)) => Take::Share,
                Some(("onset", _)) => Take::Onset,
                Some((other, at)) => {
                    let help = "give last, first, max, min, mean, span, count, share or onset";
                    return Err(wrong(at, format!("`{other}` cannot be taken of a column"), help));
                }
                None => {
                    return Err(wrong(
                        column.span(),
                        "what of the column?".into(),
                        "give take, such as take = \"last\"",
                    ));
                }
            };
            let counts = matches!(take, Take::Share | Take::Onset);
            if let Some(word) = c.word.as_ref().filter(|_| !counts) {
                let why = "`word` has an effect on share and onset alone".into();
                return Err(wrong(word.span(), why, "leave it out"));
            }
            if counts && c.word.is_none() {
                let help = "give word, such as word = \"period-1\"";
                return Err(wrong(column.span(), "of which word?".into(), help));
            }
            let table = c.table.as_ref().map(|t| t.get_ref().clone());
            let word = c.word.as_ref().map(|w| w.get_ref().clone());
            Ok(Read::Column { table, column: column.get_ref().clone(), take, word })
        }
        (Some(_), Some(column)) => {
            let why = "the claim reads a fact and a column".into();
            Err(wrong(column.span(), why, "leave out read or column"))
        }
        (None, None) => {
            let help = "give read = \"FACT\", such as period, or column = \"NAME\" with take";
            Err(wrong(place.clone(), "the claim reads nothing".into(), help))
        }
    }
}

impl Read {
    /// The number of the second source: the fact that is named for it (`and-read`), taken as the
    /// first one's, or else the same.
    fn of_the_other(&self, path: Option<&Name>) -> Self {
        let modulus = matches!(self, Read::Fact { modulus: true, .. });
        path.map_or_else(
            || self.clone(),
            |path| Read::Fact { path: path.get_ref().clone(), modulus },
        )
    }

    fn of(&self, answer: &Answer) -> Result<f64, String> {
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
struct Measured {
    value: f64,
    half: f64,
    /// The finding before the number, in words.
    how: String,
}

impl Measured {
    fn of(value: f64, half: f64) -> Self {
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
    fn measured(&self, answer: &Answer, rtol: f64) -> Result<Measured, String> {
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
    fn never(
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
fn share(table: &Table, column: &str, word: &str) -> Result<Measured, String> {
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
fn outcomes(table: &Table) -> Option<Vec<&str>> {
    ["outcome", "ending"].iter().find_map(|name| tables::words(table, name).ok())
}

/// Place of an onset.
#[derive(Debug, PartialEq)]
enum Onset {
    /// Between the last value without it and the first one with it.
    Between(f64, f64),
    /// Not from this value to that one.
    Never(f64, f64),
}

/// Place where the outcome becomes this word, along a column whose values go one way. Rows whose
/// outcome is open make it wider.
fn onset(table: &Table, column: &str, word: &str, rtol: f64) -> Result<Onset, String> {
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
fn periods(table: &Table, values: &[f64], rtol: f64) -> Vec<(f64, Option<usize>)> {
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

/// So many digits as a reader wants.
fn short(value: f64) -> String {
    let text = format!("{value:.6e}");
    match text.parse::<f64>() {
        Ok(rounded) if rounded == 0.0 || (1e-4..1e6).contains(&rounded.abs()) => {
            format!("{rounded}")
        }
        Ok(rounded) => format!("{rounded:e}"),
        Err(_) => text,
    }
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

/// The later half of a section's crossings, by rows, and their direction: `direction`, or that of
/// the first of all if the section knows it.
fn section<'a>(
    answer: &'a Answer,
    direction: Option<&'a str>,
) -> Result<(Vec<Vec<f64>>, Option<&'a str>), String> {
    let table = answer
        .table("section")
        .ok_or("the run has no section; give section, such as section = \"y=0\"")?;
    let wanted = direction.or(table.words("direction").next());
    Ok((later_half(answer, &|word| word == wanted)?, wanted))
}

/// The later half of a section's crossings in directions that are `wanted`, by rows.
fn later_half(
    answer: &Answer,
    wanted: &dyn Fn(Option<&str>) -> bool,
) -> Result<Vec<Vec<f64>>, String> {
    let table = answer
        .table("section")
        .ok_or("the run has no section; give section, such as section = \"y=0\"")?;
    let t = table.numbers("t");
    let (Some(first), Some(last)) = (t.first(), t.last()) else {
        return Err("the section was never crossed".into());
    };
    let half = 0.5 * (first + last);
    let columns: Vec<&[f64]> = states(table);
    let directions: Vec<&str> = table.words("direction").collect();
    let rows = (0..t.len()).filter(|i| t[*i] > half && wanted(directions.get(*i).copied()));
    let found: Vec<Vec<f64>> = rows.map(|i| columns.iter().map(|c| c[i]).collect()).collect();
    if found.is_empty() {
        return Err("the section was never crossed in the later half".into());
    }
    Ok(found)
}

fn states(table: &Table) -> Vec<&[f64]> {
    let names = table.columns.iter().map(|c| c.name.as_str()).filter(|n| *n != "t");
    names.map(|n| table.numbers(n)).filter(|v| v.len() == table.len()).collect()
}

/// Points that lie within this part of their size are one, to the errors of a run.
const ONE_POINT: f64 = 1e-6;

/// A state that moves over less than this part of the largest extent is measured by its own.
const LITTLE: f64 = 0.05;

/// Such a state repeats itself if it comes back to within this part of its extent.
const LITTLE_REPEATS: f64 = 1e-3;

/// The same to rounding.
const ROUNDING: f64 = 1e-9;

/// Extents of points.
struct Extents {
    /// Along each state.
    spans: Vec<f64>,
    /// The largest of them.
    span: f64,
    /// The largest size of a state.
    size: f64,
}

impl Extents {
    fn of(points: &[Vec<f64>]) -> Self {
        let along = |i: usize| {
            points
                .iter()
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), p| (a.min(p[i]), b.max(p[i])))
        };
        let ranges: Vec<(f64, f64)> = (0..points[0].len()).map(along).collect();
        let spans: Vec<f64> = ranges.iter().map(|(low, high)| high - low).collect();
        let span = spans.iter().copied().fold(0.0, f64::max);
        let size = ranges.iter().fold(0.0, |most, (a, b)| f64::max(most, a.abs().max(b.abs())));
        Self { spans, span, size }
    }

    /// Units of the states: 1, but of one that moves little beside the largest, and by more than
    /// errors, `small` of its extent.
    fn units(&self, small: impl Fn(f64) -> f64) -> Vec<f64> {
        let unit = |span: &f64| if self.moves_little(*span) { small(*span) } else { 1.0 };
        self.spans.iter().map(unit).collect()
    }

    fn moves_little(&self, span: f64) -> bool {
        span > ONE_POINT * self.size && span < LITTLE * self.span
    }
}

fn distance(a: &[f64], b: &[f64], units: &[f64]) -> f64 {
    a.iter().zip(b).zip(units).fold(0.0, |most, ((a, b), unit)| most.max((a - b).abs() / unit))
}

/// After how many points a section repeats itself, if it does.
fn period(points: &[Vec<f64>], within: f64) -> Option<usize> {
    let extents = Extents::of(points);
    let Extents { span, size, .. } = extents;
    let units = extents.units(|own| (LITTLE_REPEATS * own / (within * span)).min(1.0));
    // At least three times around.
    let repeats = |near: f64| {
        (1..=LONGEST.min(points.len() / 3))
            .find(|n| points.iter().zip(&points[*n..]).all(|(a, b)| distance(a, b, &units) <= near))
    };
    if span <= ROUNDING * size {
        return repeats(within * size);
    }
    // A small orbit that is resolved has its period; of a run's errors alone none repeats.
    repeats(within * span).or_else(|| repeats(within * size).filter(|_| span <= ONE_POINT * size))
}

/// A shorter period than was found, or one where none was, of points that are the same but for
/// errors that a run at this tolerance can have: its steps may settle to a cycle of their own, or
/// to none.
fn blurred(points: &[Vec<f64>], within: f64, rtol: f64, found: Option<usize>) -> Option<usize> {
    let extents = Extents::of(points);
    let near: Vec<f64> = (0..points[0].len())
        .map(|i| {
            let moves_little = extents.moves_little(extents.spans[i]);
            let own = points.iter().fold(0.0, |most: f64, p| most.max(p[i].abs()));
            let size = if moves_little { own } else { extents.size };
            let fine = if moves_little { LITTLE_REPEATS * extents.spans[i] } else { f64::INFINITY };
            fine.min(within * extents.span).max(BLUR * rtol * size)
        })
        .collect();
    let same =
        |a: &[f64], b: &[f64]| a.iter().zip(b).zip(&near).all(|((a, b), n)| (a - b).abs() <= *n);
    let longest = found.map_or(LONGEST.min(points.len() / 3), |n| n - 1);
    (1..=longest).find(|n| points.iter().zip(&points[*n..]).all(|(a, b)| same(a, b)))
}

/// Errors of a run on a closed orbit, in units of its relative tolerance: of van der Pol's, by
/// three methods at 1e-3 to 1e-8, they are up to 11.
const BLUR: f64 = 100.0;

/// The period of an orbit that points still approach: each comes nearer to the one a period before,
/// quarter by quarter of the section, as evenly as a geometric series (a power of the time slows
/// down); what is then left of the way is short beside the distances of the orbit's own points.
fn approached(points: &[Vec<f64>]) -> Option<usize> {
    const QUARTER: f64 = 0.7;
    const EVENLY: f64 = 0.8;
    const SHORT: f64 = 0.25;
    let extents = Extents::of(points);
    let units = extents.units(|own| own / extents.span);
    (1..=LONGEST.min(points.len() / 8)).find(|&n| {
        let moved: Vec<f64> =
            points.iter().zip(&points[n..]).map(|(a, b)| distance(a, b, &units)).collect();
        let length = moved.len() / 4;
        let [a, b, c, d] = [0, 1, 2, 3]
            .map(|k| moved[k * length..(k + 1) * length].iter().fold(0.0, |m: f64, x| m.max(*x)));
        let evenly =
            b < QUARTER * a && c < QUARTER * b && d < QUARTER * c && d / c < pow(c / b, EVENLY);
        let last = &points[points.len() - n..];
        let apart = (0..n)
            .flat_map(|i| (0..i).map(move |k| (i, k)))
            .map(|(i, k)| distance(&last[i], &last[k], &units))
            .fold(f64::INFINITY, f64::min);
        let left = d / (1.0 - pow(d / c, n as f64 / length as f64));
        evenly && left < SHORT * apart
    })
}

/// Whether crossings in the two directions come together, as they do on the way to a rest.
fn narrows(answer: &Answer, points: &[Vec<f64>], direction: Option<&str>) -> bool {
    let mut words = answer.table("section").into_iter().flat_map(|table| table.words("direction"));
    let other = words.find(|word| Some(*word) != direction);
    other.and_then(|other| section(answer, Some(other)).ok()).is_some_and(|(back, _)| {
        let units = vec![1.0; points[0].len()];
        let [first, last] =
            [(&points[0], &back[0]), (&points[points.len() - 1], &back[back.len() - 1])]
                .map(|(a, b)| distance(a, b, &units));
        last < 0.7 * first
    })
}

/// Hausdorff's distance of two sets of points, relative to their extent: that of the crossings in
/// `both_ways`, since those in one direction may be one point, with a run's errors for an extent.
fn apart(sets: [&[Vec<f64>]; 2], both_ways: [&[Vec<f64>]; 2]) -> Result<f64, String> {
    let n = sets[0][0].len();
    if sets[1][0].len() != n {
        return Err("the two sections have other states".into());
    }
    let extents = both_ways.map(Extents::of);
    let most = |of: &dyn Fn(&Extents) -> f64| extents.iter().map(of).fold(0.0, f64::max);
    let size = most(&|e| e.size).max(f64::MIN_POSITIVE);
    let span = most(&|e| e.span);
    let moves = span > ERRORS * size;
    let whole = if moves { span } else { size };
    // A state that moves little beside the others, and goes on to, is measured by its own extent;
    // one that does not move, by its size.
    let own = |i: usize| {
        let span = most(&|e| e.spans[i]);
        let size_of = |p: &Vec<f64>| p[i].abs();
        let all = both_ways.iter().flat_map(|points| points.iter().map(size_of));
        if moves && span > ONE_POINT * size { span } else { all.fold(0.0, f64::max) }
    };
    let goes_on = |i: usize| {
        both_ways.iter().all(|points| {
            let (early, late) = points.split_at(points.len() / 2);
            early.is_empty() || Extents::of(late).spans[i] >= STEADY * Extents::of(early).spans[i]
        })
    };
    let unit = |i: usize| {
        let own = own(i);
        let counts = own > ONE_POINT * size && own < LITTLE * whole && goes_on(i);
        if counts { own } else { whole }
    };
    let units: Vec<f64> = (0..n).map(unit).collect();
    let [a, b] = sets.map(|points| {
        let step = points.len().div_ceil(MOST_COMPARED);
        points.iter().step_by(step).collect::<Vec<_>>()
    });
    let one_way = |from: &[&Vec<f64>], to: &[&Vec<f64>]| {
        from.iter()
            .map(|p| to.iter().map(|q| distance(p, q, &units)).fold(f64::INFINITY, f64::min))
            .fold(0.0, f64::max)
    };
    Ok(one_way(&a, &b).max(one_way(&b, &a)))
}

/// Sets that lie within this part of their size have none but errors of a run for an extent.
const ERRORS: f64 = 1e-4;

/// A state's extent that shrinks by more is on its way to something else.
const STEADY: f64 = 0.8;

/// Points of a section that are compared with another one's.
const MOST_COMPARED: usize = 2000;

/// Verdicts by claim.
pub type Verdicts = BTreeMap<String, Verdict>;

#[cfg(test)]
mod tests {
    use super::*;

    fn circle(count: usize, turn: f64) -> Vec<Vec<f64>> {
        (0..count).map(|i| vec![(turn * i as f64).cos(), (turn * i as f64).sin()]).collect()
    }

    #[test]
    fn a_period_is_the_shortest_one_and_needs_three_turns() {
        let third = std::f64::consts::TAU / 3.0;
        assert_eq!(period(&circle(300, third), 1e-6), Some(3));
        assert_eq!(period(&circle(8, third), 1e-6), None);
        assert_eq!(period(&circle(300, 1.0), 1e-6), None);
        assert_eq!(period(&vec![vec![2.0, 3.0]; 9], 1e-6), Some(1));
    }

    /// Nine crossings of a period of two, of which the later half is looked at.
    #[test]
    fn a_section_that_is_too_short_for_a_period_is_not_judged() {
        let columns = ["t", "x"].map(crate::job::Column::numbers);
        let mut table = Table::new("section", columns);
        for i in 0..9 {
            let cells = [f64::from(i), f64::from(i % 2)];
            table.push(Vec::from(cells.map(crate::job::Entry::Number)));
        }
        let answer = [Arc::new(Answer::of_tables(vec![table]))];
        let judged = |is| Check::Period { is, within: 1e-6 }.of(&answer, 1e-9);
        assert_eq!(judged(1), Ok((false, "no period up to 1".into())));
        assert!(judged(2).unwrap_err().contains("4 times in the later half"));
    }

    /// A multiplier of -0.92 a turn around four points; of -0.95 around one; what comes to a torus.
    #[test]
    fn an_orbit_that_is_still_approached_has_its_period() {
        let four = [1.0, -2.0, 3.0, -5.0];
        let way = |places: &[f64], q: f64, turns: usize| -> Vec<Vec<f64>> {
            let n = places.len();
            let at = |i: usize| places[i % n] * (1.0 + 0.1 * q.powi((i / n) as i32));
            (0..n * turns).map(|i| vec![at(i), 1.0]).collect()
        };
        for (points, want) in [(way(&four, -0.92, 60), 4), (way(&[1.0], -0.95, 120), 1)] {
            assert_eq!((period(&points, 1e-6), approached(&points)), (None, Some(want)));
        }
        // Too little of the way is seen, or it leads to a ring of its own.
        assert_eq!(approached(&way(&four, -0.92, 12)), None);
        assert_eq!(approached(&way(&four, -0.999, 100)), None);
        assert_eq!(approached(&circle(500, 1.0)), None);
        let slow: Vec<Vec<f64>> = (100..300).map(|i| vec![100.0 / f64::from(i), 1.0]).collect();
        assert_eq!(approached(&slow), None);
        let ring: Vec<Vec<f64>> = (0..500)
            .map(|i| vec![0.98_f64.powi(i) + 0.05 * f64::from(i).cos(), f64::from(i).sin() * 0.05])
            .collect();
        assert_eq!(approached(&ring), None);
    }

    /// Crossings up and down of a focus at 0, and of an orbit of radius 1 with the same approach.
    #[test]
    fn a_rest_that_is_approached_has_no_period() {
        for (radius, found) in [(0.0, "no period up to 64"), (1.0, "period 1, still approached")] {
            let columns = [crate::job::Column::numbers("t"), crate::job::Column::numbers("x")];
            let direction = crate::job::Column::words("direction");
            let mut table = Table::new("section", columns.into_iter().chain([direction]));
            for i in 0..800 {
                let x = radius + 0.99_f64.powi(i);
                let word = ["up", "down"][i as usize % 2];
                table.push([
                    crate::job::Entry::Number(f64::from(i)),
                    crate::job::Entry::Number(if i % 2 == 0 { x } else { -x }),
                    crate::job::Entry::Word(word.into()),
                ]);
            }
            let answer = [Arc::new(Answer::of_tables(vec![table]))];
            let judged = Check::Period { is: 1, within: 1e-6 }.of(&answer, 0.0).unwrap();
            assert_eq!(judged, (radius > 0.0, found.into()));
        }
    }

    #[test]
    fn sets_are_as_far_apart_as_their_farthest_points() {
        let (a, b) = (circle(2000, 1.0), circle(1500, 0.7));
        let apart = |a: &[Vec<f64>], b: &[Vec<f64>]| apart([a, b], [a, b]).unwrap();
        assert!(apart(&a, &b) < 0.02);
        let moved: Vec<Vec<f64>> = b.iter().map(|p| vec![p[0] + 1.0, p[1]]).collect();
        assert!((apart(&a, &moved) - 0.5).abs() < 0.02);
    }

    /// A state that moves little beside another one counts as much; one that moves by errors not.
    #[test]
    fn each_state_is_measured_by_its_own_extent() {
        let points = |z: &dyn Fn(f64) -> f64| -> Vec<Vec<f64>> {
            (0..64).map(|i| vec![1000.0 * f64::from(i % 2), z(f64::from(i))]).collect()
        };
        let apart = |a: &[Vec<f64>], b: &[Vec<f64>]| apart([a, b], [a, b]).unwrap();
        assert_eq!(apart(&points(&|_| 1.0), &points(&|_| 2.0)), 0.5);
        let noisy = |i: f64| 1.0 + 1e-4 * (i * i).sin();
        assert!(apart(&points(&|_| 1.0), &points(&noisy)) < 1e-3);
        // A state that shrinks is on its way, and its extent no measure.
        let on_its_way = |way: f64| points(&|i| way * (-0.05 * i).exp() * i.cos());
        assert!(apart(&on_its_way(10.0), &on_its_way(4.0)) < 0.01);
        assert_eq!(period(&points(&|_| 1.0), 1e-6), Some(2));
        assert_eq!(period(&points(&noisy), 1e-6), Some(2));
        assert_eq!(period(&points(&|i| 0.01 * (i % 4.0)), 1e-3), Some(4));
        assert_eq!(period(&points(&|i| 0.01 * (i % 4.0) + 1e-6 * (i * i).sin()), 1e-3), Some(4));
    }

    #[test]
    fn numbers_are_read_by_path_and_by_column() {
        let mut table = Table::new("branch", vec![crate::job::Column::numbers("p")]);
        for v in [3.0, 1.0, 2.0] {
            table.push(vec![crate::job::Entry::Number(v)]);
        }
        let answer =
            Answer::of_tables(vec![table]).with_fact("multipliers", &[[3.0, 4.0], [0.5, 0.0]]);
        let fact = |path: &str, modulus| Read::Fact { path: path.into(), modulus }.of(&answer);
        assert_eq!(fact("multipliers/1/0", false), Ok(0.5));
        assert_eq!(fact("multipliers/0", true), Ok(5.0));
        assert!(fact("multiplier", false).unwrap_err().contains("it has multipliers"));
        assert!(fact("multipliers/7/0", false).unwrap_err().contains("no \"7\""));
        let column = |take| {
            Read::Column { table: None, column: "p".into(), take, word: None }.of(&answer).unwrap()
        };
        let found =
            [Take::Last, Take::First, Take::Max, Take::Min, Take::Mean, Take::Span, Take::Count]
                .map(column);
        assert_eq!(found, [2.0, 3.0, 3.0, 1.0, 2.0, 2.0, 3.0]);
    }

    /// A bouncing ball to t = 4, whose mean height 0.233163 follows from its parabolas; its rows of
    /// events crowd where it comes to rest.
    #[test]
    fn a_mean_is_one_over_time_and_a_count_has_no_rows_of_events() {
        use crate::hybrid::motion::Record;
        use crate::hybrid::{Definition, Model, Options};
        use crate::job::general::GeneralRun;
        let text = "states = ['x', 'v']\nstart = [1, 0]\nf = ['v', '-9.81']\n[[event]]\n\
            when = 'x'\ndirection = 'down'\nset = { v = '-0.8*v' }\nafter_zeno = 'stick'";
        let model = Model::new(Definition::from_toml(text, "ball").unwrap());
        let found = |record: Record, take, equals: f64, within: f64| {
            let options = Options { t_end: 4.0, record, ..Options::default() };
            let run: AnyQuestion = Arc::new(GeneralRun { model: model.clone(), options });
            let (answer, run) = (Executor::quiet().ask(&*run).unwrap(), [run]);
            let column = "x".to_owned();
            let read = Read::Column { table: None, column, take, word: None };
            let check = Check::Value { read, equals, within };
            check.of(&check.rows_of(&run, &[answer]), 0.0).unwrap()
        };
        let times = || Record::Times { every: 0.01 };
        // The trapezoidal rule errs by 9.81*0.01^2/12 = 8.2e-5, or by two thirds of the chord.
        for record in [times(), Record::Path { chord: 1e-4 }] {
            let mean = found(record, Take::Mean, 0.233163, 1e-4);
            assert!(mean.0, "{}", mean.1);
        }
        let count = found(times(), Take::Count, 401.0, 0.0);
        assert!(count.0, "{}", count.1);
        // The last impact stays the lowest point, and a path has the rows that it has.
        let lowest = found(times(), Take::Min, 0.0, 1e-12);
        assert!(lowest.0, "{}", lowest.1);
        let path = found(Record::Path { chord: 1e-3 }, Take::Count, 401.0, 0.0);
        assert!(!path.0, "{}", path.1);
    }

    #[test]
    fn blank_cells_are_no_numbers() {
        let read = |cells: &[f64], take| {
            let mut table = Table::new("path", vec![crate::job::Column::numbers("p")]);
            cells.iter().for_each(|v| table.push(vec![crate::job::Entry::Number(*v)]));
            Read::Column { table: None, column: "p".into(), take, word: None }
                .of(&Answer::of_tables(vec![table]))
        };
        for take in [Take::Last, Take::First, Take::Max, Take::Min, Take::Mean, Take::Span] {
            assert!(read(&[f64::NAN; 2], take).unwrap_err().contains("blank in every row"));
        }
        assert_eq!(read(&[1.0, f64::NAN, 3.0], Take::Mean), Ok(2.0));
        assert_eq!(read(&[1.0, f64::NAN, 3.0], Take::Last), Ok(3.0));
        assert!(read(&[1.0, f64::NAN], Take::Last).unwrap_err().contains("blank in that row"));
    }

    fn rows(outcomes: &[(f64, &str)]) -> Table {
        let columns = [crate::job::Column::numbers("p"), crate::job::Column::words("outcome")];
        let mut table = Table::new("sweep", columns);
        for (p, outcome) in outcomes {
            let word = crate::job::Entry::Word((*outcome).into());
            table.push([crate::job::Entry::Number(*p), word]);
        }
        table
    }

    /// The outcome changes between two rows that have one; what is open between them leaves open
    /// where.
    #[test]
    fn an_onset_lies_between_rows_that_are_decided() {
        let [one, two, open] = ["period-1", "period-2", "undecided"];
        let of = |outcomes: &[(f64, &str)]| onset(&rows(outcomes), "p", two, 0.0);
        assert_eq!(of(&[(1.0, one), (2.0, two), (3.0, one)]), Ok(Onset::Between(1.0, 2.0)));
        let widened = of(&[(4.0, one), (3.0, open), (2.0, "failed"), (1.0, two)]);
        assert_eq!(widened, Ok(Onset::Between(4.0, 1.0)));
        assert_eq!(of(&[(1.0, one), (2.0, "rest")]), Ok(Onset::Never(1.0, 2.0)));
        for (outcomes, why) in [
            (&[(1.0, open), (2.0, two)][..], "no outcome before it"),
            (&[(1.0, one), (2.0, open)], "some are open"),
            (&[(1.0, one), (3.0, one), (2.0, two)], "do not go one way"),
            (&[(1.0, one), (1.0, two)], "do not go one way"),
            (&[], "has no rows"),
        ] {
            let found = of(outcomes).unwrap_err();
            assert!(found.contains(why), "{found}");
        }
        // A claim differs if it never begins in rows that reach far enough, and on those alone.
        let (table, word) = (None, Some(two.to_owned()));
        let read = Read::Column { table, column: "p".into(), take: Take::Onset, word };
        let answer = [Arc::new(Answer::of_tables(vec![rows(&[(1.0, one), (2.0, one)])]))];
        let judged =
            |equals| Check::Value { read: read.clone(), equals, within: 0.25 }.of(&answer, 0.0);
        assert_eq!(judged(1.5).map(|(agrees, _)| agrees), Ok(false));
        assert!(judged(1.9).unwrap_err().contains("do not reach so far"));
        let order = Check::Order { read, less: false, than: Some(1.5), other: None };
        assert!(order.of(&answer, 0.0).unwrap_err().contains("does not begin"));
    }

    /// Wilson's interval of 9 of 10 is 0.596 to 0.982; rows that are open may be of either kind.
    #[test]
    fn a_share_has_an_interval_that_open_rows_widen() {
        let of = |hits: usize, open: usize| {
            let words = |i| {
                if i < hits {
                    "rest"
                } else if i < hits + open {
                    "failed"
                } else {
                    "far"
                }
            };
            let outcomes: Vec<(f64, &str)> = (0..10).map(|i| (i as f64, words(i))).collect();
            share(&rows(&outcomes), "outcome", "rest").unwrap()
        };
        let Measured { value, half, how } = of(9, 0);
        assert_eq!((value, how.as_str()), (0.9, "9 of 10 rows are rest: "));
        assert!((half - (0.9 - 0.59585)).abs() < 1e-4, "{half}");
        let Measured { value, half, how } = of(4, 2);
        assert_eq!((value, how.as_str()), (0.4, "4 of 10 rows are rest (2 are open): "));
        assert!((half - (wilson(6, 10, 0.95)[1] - 0.4)).abs() < 1e-12, "{half}");
    }

    /// Two points in turn, one, and none that come back; a value that was not crossed has no row.
    #[test]
    fn an_orbit_diagram_has_a_period_at_each_value() {
        let columns = ["params.p", "t", "x"].map(crate::job::Column::numbers);
        let mut table = Table::new("passages", columns);
        let x = |p: i32, i: i32| match p {
            1 => 0.5,
            2 => f64::from(i % 2),
            _ => f64::from(i * i % 97),
        };
        for (p, i) in [1, 2, 4].into_iter().flat_map(|p| (0..30).map(move |i| (p, i))) {
            let cells = [f64::from(p), f64::from(i), x(p, i)];
            table.push(cells.map(crate::job::Entry::Number));
        }
        let values = table.numbers("params.p").to_vec();
        assert_eq!(periods(&table, &values, 1e-9), [(1.0, Some(1)), (2.0, Some(2)), (4.0, None)]);
        assert_eq!(onset(&table, "params.p", "period-2", 1e-9), Ok(Onset::Between(1.0, 2.0)));
    }

    /// Steps that settle to a cycle of three turns, or to none, on an orbit of one: van der Pol's
    /// at rtol 1e-3 to 1e-8 (mu = 1, 3, 8) by dopri5, lsoda and radau5 have such errors.
    #[test]
    fn errors_of_a_run_have_no_period() {
        let section = |x: &dyn Fn(i32) -> f64| {
            let columns = ["t", "x", "v"].map(crate::job::Column::numbers);
            let mut table = Table::new("section", columns);
            for i in 0..60 {
                table.push([f64::from(i), x(i), 0.0].map(crate::job::Entry::Number));
            }
            [Arc::new(Answer::of_tables(vec![table]))]
        };
        let judged = |answer: &[Arc<Answer>; 1], is, rtol| {
            Check::Period { is, within: 1e-6 }.of(answer, rtol)
        };
        let locked = section(&|i| 2.0086 + 2e-5 * f64::from(i % 3));
        let unsettled = section(&|i| 2.0086 + 1e-5 * f64::from(i * i).sin());
        for answer in [&locked, &unsettled] {
            for is in [1, 3] {
                let why = judged(answer, is, 1e-4).unwrap_err();
                assert!(why.contains("period 1 but") && why.contains("rtol 1e-4"), "{why}");
            }
        }
        assert_eq!(judged(&locked, 3, 1e-9), Ok((true, "period 3".into())));
        assert!(judged(&unsettled, 1, 1e-9).unwrap().1.starts_with("no period"));
        // Points that are farther apart than errors are an orbit's.
        let apart = section(&|i| 2.0 + 0.5 * f64::from(i % 3));
        assert_eq!(judged(&apart, 3, 1e-4), Ok((true, "period 3".into())));
        let still = section(&|i| 2.0 + 1e-15 * f64::from(i % 2));
        assert_eq!(judged(&still, 1, 1e-3), Ok((true, "period 1".into())));
        let mut table = locked[0].tables[0].clone();
        table.name = "passages".into();
        assert_eq!(periods(&table, &[0.0; 60], 1e-4), [(0.0, None)]);
        assert_eq!(periods(&table, &[0.0; 60], 1e-9), [(0.0, Some(3))]);
    }

    /// Crossings that differ by the errors of a run are one point.
    #[test]
    fn errors_of_a_run_are_no_extent() {
        let points = |noise: &dyn Fn(f64) -> f64| -> Vec<Vec<f64>> {
            (0..30).map(|i| vec![1.0, 0.3 + noise(f64::from(i))]).collect()
        };
        let errors = points(&|i| 1e-8 * (i * i).sin());
        assert_eq!(period(&errors, 1e-3), Some(1));
        let others = points(&|i| 1e-8 * (3.0 * i * i).cos());
        assert!(apart([&errors, &others], [&errors, &others]).unwrap() < 1e-6);
        // Also of a run with larger ones, and beside the crossings on the way back.
        let [a, b] = [1.0, 3.0].map(|k| points(&|i| 1e-5 * (k * i * i).sin()));
        assert!(apart([&a, &b], [&a, &b]).unwrap() < 1e-3);
        let both = |points: &[Vec<f64>]| [points, &[vec![-1.0, -0.3]]].concat();
        let [a, b] = [1.0, 3.0].map(|k| points(&|i| 1e-3 * (k * i * i).sin()));
        assert!(apart([&a, &b], [&both(&a), &both(&b)]).unwrap() < 0.01);
        // Rounding that repeats is none, a small orbit that repeats is one.
        assert_eq!(period(&points(&|i| 1e-16 * (i % 2.0)), 1e-3), Some(1));
        assert_eq!(period(&points(&|i| 1e-7 * (i % 2.0)), 1e-3), Some(2));
        assert_eq!(period(&points(&|i| 1e-5 * (i * i).sin()), 1e-3), None);
    }

    /// 0.902 beside 0.909, each +- 0.05, and an exponent that is 0 within its interval.
    #[test]
    fn intervals_that_overlap_decide_nothing() {
        let of = |value: f64| {
            let rate = |value, half_width| MeanRate { value: Some(value), half_width };
            let rates = [rate(value, 0.052), rate(5e-6, 0.01)];
            Arc::new(Answer::of_tables(Vec::new()).with_fact("exponents", &rates))
        };
        let read = |i: usize| Read::Fact { path: format!("exponents/{i}/value"), modulus: false };
        let judged = |check: Check, other: f64| check.of(&[of(0.902), of(other)], 0.0);
        let order = |i, less, than, other| Check::Order { read: read(i), less, than, other };
        for less in [true, false] {
            let found = judged(order(0, less, None, Some(read(0))), 0.909).unwrap_err();
            assert!(found.starts_with("0.902 ± 0.052 beside 0.909 ± 0.052: the int"), "{found}");
            assert!(judged(order(1, less, Some(0.0), None), 0.909).is_err());
            let found = judged(order(0, less, Some(0.5), None), 0.909);
            assert_eq!(found, Ok((!less, "0.902 ± 0.052, greater than 0.5".into())));
            assert_eq!(judged(order(0, less, None, Some(read(0))), 1.1).unwrap().0, less);
        }
        let value = |equals, within| Check::Value { read: read(0), equals, within };
        assert!(judged(value(0.9056, 0.001), 0.9).is_err());
        assert!(judged(value(0.9056, 0.1), 0.9).unwrap().0);
        assert!(!judged(value(0.7, 0.1), 0.9).unwrap().0);
        let ratio = |i, equals| Check::Ratio { read: read(0), other: read(i), equals, within: 0.2 };
        assert!(judged(ratio(1, 1.0), 0.9).is_err() && judged(ratio(0, 1.2), 0.9).is_err());
        assert!(judged(ratio(0, 1.0), 0.9).unwrap().0 && !judged(ratio(0, 2.0), 0.9).unwrap().0);
    }

    #[test]
    fn an_exponent_whose_interval_holds_zero_is_no_verdict() {
        let judged = |value: f64, half_width| {
            let rates = [MeanRate { value: Some(value), half_width }];
            let answer = Answer::of_tables(Vec::new()).with_fact("exponents", &rates);
            Check::Chaos.of(&[Arc::new(answer)], 0.0).map(|(agrees, _)| agrees)
        };
        assert_eq!((judged(0.5, 0.1), judged(-0.5, 0.1)), (Ok(true), Ok(false)));
        for value in [0.0031, -0.0031, 0.0] {
            let why = judged(value, 0.3).unwrap_err();
            assert!(why.contains("the interval does not decide it"), "{why}");
        }
        assert!(judged(0.1, 0.1).is_err());
    }

    /// `take = "modulus"` of a complex number and of the one that it is compared with.
    #[test]
    fn a_modulus_is_taken_of_both_numbers() {
        let answer = |pair: [f64; 2]| {
            Arc::new(
                Answer::of_tables(Vec::new())
                    .with_fact("multipliers", &[pair, pair.map(|x| 2.0 * x)]),
            )
        };
        let read = Read::Fact { path: "multipliers/0".into(), modulus: true };
        let path = toml::Spanned::new(0..0, "multipliers/1".to_owned());
        let other = read.of_the_other(Some(&path));
        let check = Check::Ratio { read: read.clone(), other, equals: 0.25, within: 1e-12 };
        let answers = [answer([3.0, 4.0]), answer([6.0, 8.0])];
        assert_eq!(check.of(&answers, 0.0).map(|(agrees, _)| agrees), Ok(true));
        assert_eq!(read.of_the_other(None), read);
    }

    #[test]
    fn the_largest_exponent_alone_is_read_too() {
        let alone = Answer::of_tables(Vec::new())
            .with_fact("exponent", &serde_json::json!({ "value": 0.3, "duration": 9.0 }))
            .with_fact("half_width", &0.1);
        assert_eq!(largest_exponent(&alone), Ok((0.3, 0.1)));
        let none = Answer::of_tables(Vec::new()).with_fact("exponent", &"none");
        assert!(largest_exponent(&none).is_err());
    }
}
