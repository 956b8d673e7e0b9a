//! A claim as it is written in a file, and how it is read and checked.

use std::ops::Range;

use serde::Deserialize;
use serde_json::json;
use toml::Spanned;
use toml::value::Datetime;

use super::read::{Read, Take, period_of};
use super::sets::{LONGEST, REPEATS};
use super::{ALIKE, Check, Claim, OddsFile, Origin};
use crate::analyse::branch::Change;
use crate::folder::words::Ask;
use crate::folder::{FolderError, Source, day};
use crate::job::sweep::{is_open, is_outcome};
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
    /// The keys that only some kinds of checks have, and where they stand.
    fn keys(&self) -> [(&'static str, Option<Range<usize>>); 15] {
        fn at<T>(key: &Option<Spanned<T>>) -> Option<Range<usize>> {
            key.as_ref().map(Spanned::span)
        }
        [
            ("read", at(&self.read)),
            ("and-read", at(&self.and_read)),
            ("column", at(&self.column)),
            ("table", at(&self.table)),
            ("take", at(&self.take)),
            ("word", at(&self.word)),
            ("equals", at(&self.equals)),
            ("within", at(&self.within)),
            ("relation", at(&self.relation)),
            ("than", at(&self.than)),
            ("is", at(&self.is)),
            ("same", at(&self.same)),
            ("kind", at(&self.kind)),
            ("at", at(&self.at)),
            ("and", at(&self.and)),
        ]
    }

    /// The column that it reads with its table, and the panels or measures whose it is.
    pub(in crate::folder) fn column(&self) -> Option<(Name, Option<Name>, Vec<Name>)> {
        let of = std::iter::once(&self.of).chain(&self.and).cloned().collect();
        Some((self.column.clone()?, self.table.clone(), of))
    }

    /// Whether that is a column of words.
    pub(in crate::folder) fn counts_words(&self) -> bool {
        self.take.as_ref().is_some_and(|take| take.get_ref() == "share")
    }

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

impl Claim {
    /// Checks a claim as it is written; `known` gives the panel or measure of a name.
    pub(in crate::folder) fn read<'a>(
        origin: &Origin,
        claim: Spanned<ClaimFile>,
        known: &dyn Fn(&Name) -> Result<&'a Source, FolderError>,
    ) -> Result<Self, FolderError> {
        let reader = Reader::new(origin, &claim)?;
        let c = claim.get_ref();
        let of = known(&c.of)?;
        let and = c.and.as_ref().map(known).transpose()?;
        reader.numbers_are_there(of, and.unwrap_or(of))?;
        day(origin, "decided", &c.decided)?;
        let named: Vec<(&Name, &Source)> =
            std::iter::once((&c.of, of)).chain(c.and.as_ref().zip(and)).collect();
        for (name, source) in &named {
            if let Some((at, why, help)) = c.misread(name, source) {
                return Err(reader.wrong(at, why, help));
            }
        }
        for (name, source) in &named {
            reader.suits(name, source)?;
        }
        if let [(_, of), (name, and)] = named[..] {
            reader.differ(of, name, and)?;
        }
        let check = reader.check(of)?;
        reader.odds_are_possible()?;
        let c = claim.into_inner();
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
}

/// A claim while it is read.
struct Reader<'a> {
    origin: &'a Origin,
    place: Range<usize>,
    claim: &'a ClaimFile,
    kind: &'static str,
}

impl<'a> Reader<'a> {
    /// Finds the kind of check; every key that is given has an effect on it, and none is missing.
    fn new(origin: &'a Origin, claim: &'a Spanned<ClaimFile>) -> Result<Self, FolderError> {
        let c = claim.get_ref();
        let given = c.check.get_ref().as_str();
        let reader = |kind| Self { origin, place: claim.span(), claim: c, kind };
        let Some((kind, needs, may)) = KINDS.iter().find(|(kind, ..)| *kind == given) else {
            let why = format!("there is no check `{given}`");
            let kinds = KINDS.map(|(kind, ..)| kind);
            return Err(reader("").wrong(c.check.span(), why, one_of(given, &kinds)));
        };
        let reader = reader(kind);
        let keys = c.keys();
        for (key, at) in &keys {
            if let Some(at) = at.as_ref().filter(|_| !needs.contains(key) && !may.contains(key)) {
                let why = format!("`{key}` has no effect on a check of {kind}");
                return Err(reader.wrong(at.clone(), why, "leave it out"));
            }
        }
        match keys.iter().find(|(key, at)| at.is_none() && needs.contains(key)) {
            Some((key, _)) => Err(reader.missing(&format!("`{key}`"))),
            None => Ok(reader),
        }
    }

    fn wrong(
        &self,
        at: Range<usize>,
        why: impl Into<String>,
        help: impl Into<String>,
    ) -> FolderError {
        let help = help.into();
        FolderError::at(self.origin, at, why.into(), (!help.is_empty()).then_some(help))
    }

    fn missing(&self, what: &str) -> FolderError {
        self.wrong(self.place.clone(), format!("a check of {} needs {what}", self.kind), "")
    }

    /// The facts that are read are numbers of what the sources ask for.
    fn numbers_are_there(&self, of: &Source, other: &Source) -> Result<(), FolderError> {
        let c = self.claim;
        let modulus = c.take.as_ref().is_some_and(|take| take.get_ref() == "modulus");
        for (path, source) in [(&c.read, of), (&c.read, other), (&c.and_read, other)] {
            let Some(path) = path else { continue };
            if !source.ask.has_number(path.get_ref(), modulus) {
                let (why, help) = no_number(source.ask, path.get_ref(), modulus);
                return Err(self.wrong(path.span(), why, help));
            }
        }
        Ok(())
    }

    /// A source asks for what this kind of check scores.
    fn suits(&self, name: &Name, source: &Source) -> Result<(), FolderError> {
        let of = name.get_ref();
        let wrong = |why: String, help: String| Err(self.wrong(name.span(), why, help));
        let (ask, needs) = match self.kind {
            "chaos" => (Ask::Lyapunov, "lyapunov = { ... }"),
            "period" | "attractors" => (Ask::Run, "run = { ..., section = \"y=0\" }"),
            _ => return Ok(()),
        };
        if source.ask != ask {
            let asked = source.ask.asked();
            let why =
                format!("`{of}` asks for {asked}, of which there is no check of {}", self.kind);
            return wrong(why, format!("name one with {needs}"));
        }
        if ask != Ask::Run {
            return Ok(());
        }
        if !source.said.gives("section") {
            return wrong(format!("`{of}` records no crossings"), format!("give it {needs}"));
        }
        let states = source.question.json()["start"].as_array().map(Vec::len);
        if states == Some(1) && !source.said.has_section_in_time() {
            let why = format!(
                "`{of}` is a section of a system with one state: one point, which says nothing of \
                    its motion"
            );
            return wrong(why, "read an orbit's period, or a column".into());
        }
        Ok(())
    }

    /// Two sources of which one number is read are not the same.
    fn differ(&self, of: &Source, name: &Name, and: &Source) -> Result<(), FolderError> {
        let asks = |source: &Source| (source.ask, source.question.json());
        let c = self.claim;
        let same_read = c.and_read.as_ref().is_none_or(|r| c.read.as_ref() == Some(r));
        if same_read && asks(of) == asks(and) {
            let why = format!("`{}` is the same as `of`: the check is of nothing", name.get_ref());
            return Err(self.wrong(name.span(), why, "name another panel or measure"));
        }
        Ok(())
    }

    fn odds_are_possible(&self) -> Result<(), FolderError> {
        let Some(odds) = &self.claim.odds else { return Ok(()) };
        let OddsFile { starts, spread, at_least, .. } = odds.get_ref();
        let share = at_least.is_none_or(|s| s > 0.0 && s < 1.0);
        if (1..=1_000_000).contains(starts) && spread.is_finite() && *spread > 0.0 && share {
            return Ok(());
        }
        let why = "odds have 1 to 1000000 starts, a spread above 0, and at-least between 0 and 1";
        Err(self.wrong(odds.span(), why, ""))
    }

    fn number(&self, value: &Option<Spanned<f64>>, what: &str) -> Result<f64, FolderError> {
        match value {
            Some(v) if v.get_ref().is_finite() => Ok(*v.get_ref()),
            Some(v) => Err(self.wrong(v.span(), format!("{what} is not a finite number"), "")),
            None => Err(self.missing(what)),
        }
    }

    fn tolerance(&self, default: Option<f64>) -> Result<f64, FolderError> {
        match (&self.claim.within, default) {
            (Some(v), _) if v.get_ref().is_finite() && *v.get_ref() >= 0.0 => Ok(*v.get_ref()),
            (Some(v), _) => Err(self.wrong(v.span(), "`within` is a finite number, 0 or more", "")),
            (None, Some(default)) => Ok(default),
            (None, None) => Err(self.missing("`within`")),
        }
    }

    /// The fact of the second source.
    fn other_path(&self) -> Option<&str> {
        self.claim.and_read.as_ref().map(|path| path.get_ref().as_str())
    }

    fn check(&self, of: &Source) -> Result<Check, FolderError> {
        let c = self.claim;
        Ok(match self.kind {
            "value" => Check::Value {
                read: self.reading()?,
                equals: self.number(&c.equals, "`equals`")?,
                within: self.tolerance(None)?,
            },
            "ratio" => {
                let read = self.reading()?;
                let other = read.of_the_other(self.other_path());
                let equals = self.number(&c.equals, "`equals`")?;
                Check::Ratio { read, other, equals, within: self.tolerance(None)? }
            }
            "order" => self.order()?,
            "period" => {
                let n = c.is.as_ref().ok_or_else(|| self.missing("`is`"))?;
                if !(1..=LONGEST as u64).contains(n.get_ref()) {
                    let why = format!("a period is 1 to {LONGEST} crossings");
                    return Err(self.wrong(n.span(), why, ""));
                }
                Check::Period { is: *n.get_ref(), within: self.tolerance(Some(REPEATS))? }
            }
            "chaos" => Check::Chaos,
            "attractors" => {
                let same = c.same.as_ref().ok_or_else(|| self.missing("`same`"))?;
                Check::Attractors { same: *same.get_ref(), within: self.tolerance(Some(ALIKE))? }
            }
            _ => self.bifurcation(of)?,
        })
    }

    fn order(&self) -> Result<Check, FolderError> {
        let c = self.claim;
        let relation = c.relation.as_ref().ok_or_else(|| self.missing("`relation`"))?;
        let less = match relation.get_ref().as_str() {
            "less" | "<" => true,
            "greater" | ">" => false,
            other => {
                let why = format!("there is no relation `{other}`");
                return Err(self.wrong(relation.span(), why, "give less or greater"));
            }
        };
        let read = self.reading()?;
        let (than, other) = match (&c.and, &c.and_read, &c.than) {
            (Some(_), _, None) => (None, Some(read.of_the_other(self.other_path()))),
            (None, None, Some(_)) => (Some(self.number(&c.than, "`than`")?), None),
            (Some(_), _, Some(than)) => {
                let why = "`than` and `and` are both given";
                return Err(self.wrong(than.span(), why, "leave one of them out"));
            }
            _ => {
                return Err(self.missing("`than`, a number, or `and`, another panel or measure"));
            }
        };
        Ok(Check::Order { read, less, than, other })
    }

    fn bifurcation(&self, of: &Source) -> Result<Check, FolderError> {
        let c = self.claim;
        let kind = c.kind.as_ref().ok_or_else(|| self.missing("`kind`"))?;
        let kinds = Change::ALL.map(Change::word);
        if !kinds.contains(&kind.get_ref().as_str()) {
            let why = format!("there is no bifurcation `{}`", kind.get_ref());
            return Err(self.wrong(kind.span(), why, one_of(kind.get_ref(), &kinds)));
        }
        if !of.said.gives("along") {
            let why = format!("`{}` follows no branch", c.of.get_ref());
            let help = "give the orbit along = \"PARAMETER=FROM..TO\"";
            return Err(self.wrong(c.of.span(), why, help));
        }
        Ok(Check::Bifurcation {
            kind: kind.get_ref().clone(),
            at: self.number(&c.at, "`at`")?,
            within: self.tolerance(None)?,
        })
    }

    /// The number that is read of the first source.
    fn reading(&self) -> Result<Read, FolderError> {
        let c = self.claim;
        match (&c.read, &c.column) {
            (Some(path), None) => {
                let modulus = match &c.take {
                    None => false,
                    Some(take) if take.get_ref() == "modulus" => true,
                    Some(other) => {
                        let why = format!("`{}` is taken of a column", other.get_ref());
                        return Err(self.wrong(other.span(), why, "give modulus, or leave it out"));
                    }
                };
                for (key, given) in [("word", &c.word), ("table", &c.table)] {
                    if let Some(given) = given {
                        let why = format!("`{key}` has no effect on a fact");
                        return Err(self.wrong(given.span(), why, "leave it out, or give column"));
                    }
                }
                Ok(Read::Fact { path: path.get_ref().clone(), modulus })
            }
            (None, Some(column)) => self.column(column),
            (Some(_), Some(column)) => {
                let why = "the claim reads a fact and a column";
                Err(self.wrong(column.span(), why, "leave out read or column"))
            }
            (None, None) => {
                let help = "give read = \"FACT\", such as period, or column = \"NAME\" with take";
                Err(self.wrong(self.place.clone(), "the claim reads nothing", help))
            }
        }
    }

    fn column(&self, column: &Name) -> Result<Read, FolderError> {
        let c = self.claim;
        let Some(taken) = &c.take else {
            let help = "give take, such as take = \"last\"";
            return Err(self.wrong(column.span(), "what of the column?", help));
        };
        let take = match taken.get_ref().as_str() {
            "last" => Take::Last,
            "first" => Take::First,
            "max" => Take::Max,
            "min" => Take::Min,
            "mean" => Take::Mean,
            "span" => Take::Span,
            "count" => Take::Count,
            "share" => Take::Share,
            "onset" => Take::Onset,
            other => {
                let why = format!("`{other}` cannot be taken of a column");
                let help = "give last, first, max, min, mean, span, count, share or onset";
                return Err(self.wrong(taken.span(), why, help));
            }
        };
        let counts = matches!(take, Take::Share | Take::Onset);
        if let Some(word) = c.word.as_ref().filter(|_| !counts) {
            let why = "`word` has an effect on share and onset alone";
            return Err(self.wrong(word.span(), why, "leave it out"));
        }
        if counts && c.word.is_none() {
            let help = "give word, such as word = \"period-1\"";
            return Err(self.wrong(column.span(), "of which word?", help));
        }
        let of = |name: &Option<Name>| name.as_ref().map(|name| name.get_ref().clone());
        let (table, word) = (of(&c.table), of(&c.word));
        Ok(Read::Column { table, column: column.get_ref().clone(), take, word })
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
