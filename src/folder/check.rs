//! The claims of a paper, and the checks that score them.

mod read;
mod sets;

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use toml::Spanned;
use toml::value::Datetime;

use self::read::{Measured, Read, Take, period_of, short};
use self::sets::{
    LONGEST, REPEATS, apart, approached, blurred, later_half, narrows, period, section,
};
use super::words::Ask;
use super::{Folder, FolderError, Source};
use crate::analyse::branch::Change;
use crate::analyse::counts::wilson;
use crate::job::general::MeanRate;
use crate::job::sweep::{is_open, is_outcome};
use crate::job::{Answer, AnyQuestion, Column, Executor, JobError, Table};
use crate::num::random::RandomStream;
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
                let other =
                    read.of_the_other(c.and_read.as_ref().map(|path| path.get_ref().as_str()));
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
                    (Some(_), path, None) => {
                        Some(read.of_the_other(path.as_ref().map(|path| path.get_ref().as_str())))
                    }
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
