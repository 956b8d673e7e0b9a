//! A general system as data, from a file.
//!
//! ```toml
//! name = "bouncing-ball"
//! states = ["x", { name = "v", meaning = "speed" }]
//! start = [1, 0]
//! f = ["v", "-g - drag*v*abs(v)"]        # one expression a state; t is the time
//!
//! [parameters]
//! g = 9.81
//! drag = "1/100"                         # constants may be expressions
//!
//! [[event]]
//! name = "impact"                        # optional, as all but when, at or every
//! when = "x"                             # where this is met ...
//! direction = "down"                     # in this direction; a condition fires as it becomes true
//! set = { v = "-0.8*v" }                 # right-hand sides see the old values
//! after_zeno = "stick"                   # where impacts accumulate: motion rests on the surface
//!
//! [modes.NAME]                           # instead of f; the first is where motion begins
//! f = ["..."]
//!
//! [tables.wind]                          # `wind` is then its value at time t
//! file = "wind.csv"                      # beside the system's file
//! time = "t"                             # names of its columns
//! column = "speed"
//! interpolation = "linear"               # previous, linear, cubic or pchip
//! ```
//!
//! `h`, `plus` and `minus` may stand instead of `f`, as in a [system with one
//! switch](twofold_system::definition).

// A diagnostic is made once, when a file is read.
#![allow(clippy::result_large_err)]

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

use serde::{Deserialize, Serialize};
use twofold_num::Decimal;
use twofold_system::diagnostic::{Diagnostic, nearest};
use twofold_system::document::{About, Ordered, StateEntry};
use twofold_system::expression::{
    ExpressionError, Function, General, is_name, is_reserved_in_general,
};
use twofold_system::{Expression, definition::State};

use crate::value::evaluate;

/// An error in a table's data.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{why}")]
pub struct BadTable {
    pub(crate) why: String,
    /// The key of the table's entry that it is about.
    pub(crate) key: &'static str,
    /// Remedy.
    pub(crate) help: &'static str,
}

impl BadTable {
    /// A file that could not be read, and why.
    pub fn unread(why: String) -> Self {
        Self { why, key: "file", help: "put the table's CSV file beside the system's file" }
    }

    pub(crate) fn data(why: String) -> Self {
        let help = "give a line of column names, then rows of finite numbers, times increasing";
        Self { why, key: "file", help }
    }
}

/// Most states of a general system.
pub const MAX_STATES: usize = 100;
/// Most parameters, terms, events, modes or tables each.
pub const MAX_NAMES: usize = 100;
/// Longest file, in bytes.
pub const MAX_FILE: usize = 200_000;

/// A constant: a number or an expression of numbers and parameters.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a number is wanted here, or an expression as a string")]
pub enum Constant {
    /// A number.
    Number(f64),
    /// An expression.
    Text(String),
}

impl Constant {
    fn text(&self) -> String {
        match self {
            Constant::Number(value) => Decimal::from(*value).to_string(),
            Constant::Text(text) => text.clone(),
        }
    }
}

/// A constant, or several.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "a number is wanted here, or an expression as a string, or a list of them"
)]
pub enum Constants {
    /// One.
    One(Constant),
    /// Several.
    List(Vec<Constant>),
}

/// A parameter: a constant, or a table with more.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(
    untagged,
    deny_unknown_fields,
    expecting = "a parameter is a number, an expression as a string, or a table of value, above, \
        below, meaning and unit"
)]
pub enum ParameterEntry {
    /// Its value.
    Plain(Constant),
    /// Its value, and what is said of it.
    Table {
        /// Its value.
        value: Constant,
        /// Its meaning, in words.
        #[serde(default)]
        meaning: String,
        /// Its unit.
        #[serde(default)]
        unit: String,
        /// Values that are not above this bound are refused.
        #[serde(default)]
        above: Option<f64>,
        /// Values that are not below this bound are refused.
        #[serde(default)]
        below: Option<f64>,
    },
}

/// In which direction an expression passes zero.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Direction {
    /// From below.
    Up,
    /// From above.
    Down,
    /// Either.
    #[default]
    Both,
}

/// Motion after infinitely many impacts in finite time (Zeno).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum AfterZeno {
    /// Motion goes on at rest on the surface.
    Stick,
}

/// Interpolation of a table between its rows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Interpolation {
    /// The last row's value.
    Previous,
    /// Straight lines.
    #[default]
    Linear,
    /// A cubic spline with two continuous derivatives (not-a-knot ends: de Boor 1978, ch. IV).
    Cubic,
    /// Piecewise cubics that overshoot nowhere (Fritsch & Butland 1984).
    Pchip,
}

/// An event as the file has it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EventEntry {
    /// Its name [default: event 1, event 2, ...].
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// An expression whose zero is met, or a condition that becomes true.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub when: Option<String>,
    /// The direction in which `when` passes zero: up, down or both [default: both; a condition
    /// fires when it becomes true].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub direction: Option<Direction>,
    /// New values of states, by name; they see the values before this event.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub set: Option<Ordered<Constant>>,
    /// The mode that holds from then on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<String>,
    /// The only mode in which it fires.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub from: Option<String>,
    /// Whether the run ends there.
    #[serde(default)]
    pub stop: bool,
    /// Fires at the multiples of this time, counted from t = 0, that come after the run's start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub every: Option<Constant>,
    /// Fires at this time, or at these, the run's start included.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at: Option<Constants>,
    /// Motion after it fires infinitely often in finite time: "stick", or else the run ends there.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub after_zeno: Option<AfterZeno>,
}

/// A mode as the file has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ModeEntry {
    /// One expression a state.
    pub f: Vec<Constant>,
}

/// A table as the file has it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TableEntry {
    /// A CSV file beside the system's.
    pub file: String,
    /// The name of its column of times.
    pub time: String,
    /// The name of its column of values.
    pub column: String,
    /// Interpolation between its rows: `previous` value, `linear` (the default), `cubic` spline
    /// (not a knot at the ends), or `pchip`, which overshoots nowhere.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// A general system's file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// The system's name: letters, digits, `-` and `_`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// One line for headings of pictures.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub title: String,
    /// Description of the system, in sentences.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub about: String,
    /// Sources of the system, a string each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<String>,
    /// The states, in order: a name, or a table.
    pub states: Vec<StateEntry>,
    /// Start of runs: a number or expression for each state.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Vec<Constant>>,
    /// The two or three states that pictures show.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axes: Vec<String>,
    /// The derivative of each state, an expression each.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub f: Option<Vec<Constant>>,
    /// A switching function, with `plus` and `minus`, instead of `f`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub h: Option<String>,
    /// The derivatives where h > 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plus: Option<Vec<Constant>>,
    /// The derivatives where h < 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub minus: Option<Vec<Constant>>,
    /// Parameters by name: a constant, or a table with `value`, `above`, `below`, `meaning` and
    /// `unit`.
    #[serde(default)]
    pub parameters: Ordered<ParameterEntry>,
    /// Expressions by name, in any order.
    #[serde(default, rename = "let")]
    pub terms: Ordered<Constant>,
    /// Modes by name, a table `[modes.NAME]` each, instead of `f`; motion begins in the first.
    #[serde(default)]
    pub modes: Ordered<ModeEntry>,
    /// Events, a table `[[event]]` each: what happens at moments.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub event: Vec<EventEntry>,
    /// Tables of data by name; expressions use the bare name, its value at the time t.
    #[serde(default)]
    pub tables: Ordered<TableEntry>,
}

/// A parameter of a general system.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Its name.
    pub name: String,
    /// Its value: an expression of numbers and of parameters before it.
    pub value: Expression,
    /// Its meaning and unit.
    pub about: About,
    /// Values that are not above the first and below the second are refused.
    pub bounds: (Option<f64>, Option<f64>),
}

/// A mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Mode {
    /// Its name; empty if the system has only `f`.
    pub name: String,
    /// The derivative of each state.
    pub field: Vec<Expression>,
}

/// When an event fires.
#[derive(Clone, Debug, PartialEq)]
pub enum When {
    /// An expression passes zero in a direction.
    Zero(Expression, Direction),
    /// When a condition becomes true.
    Becomes(Expression),
    /// At times: expressions of parameters.
    At(Vec<Expression>),
    /// At the multiples of a time.
    Every(Expression),
}

/// An event.
#[derive(Clone, Debug, PartialEq)]
pub struct Event {
    /// Its name.
    pub name: String,
    /// When it fires.
    pub when: When,
    /// New values of states, by the states' numbers.
    pub set: Vec<(usize, Expression)>,
    /// The mode from then on.
    pub mode: Option<usize>,
    /// The only mode in which it fires.
    pub from: Option<usize>,
    /// Whether the run ends there.
    pub stop: bool,
    /// Whether motion rests on the surface where it accumulates.
    pub sticks: bool,
}

/// A general system as expressions. One that exists is sound: names are known, counts fit, terms do
/// not depend on themselves.
#[derive(Clone, Debug, PartialEq)]
pub struct Definition {
    pub(crate) document: Document,
    pub(crate) states: Vec<State>,
    pub(crate) parameters: Vec<Parameter>,
    pub(crate) start: Option<Vec<Expression>>,
    pub(crate) axes: Vec<usize>,
    pub(crate) terms: Vec<(String, Expression)>,
    pub(crate) modes: Vec<Mode>,
    pub(crate) events: Vec<Event>,
    pub(crate) tables: Vec<(String, TableEntry)>,
}

/// Whether a file in TOML or JSON is read as a general system: it has a key that systems with one
/// switch have not, or is neither, which the reader says with its place.
pub fn is_general(text: &str, json: bool) -> bool {
    const KEYS: [&str; 4] = ["f", "event", "modes", "tables"];
    if json {
        let value: Result<serde_json::Value, _> = serde_json::from_str(text);
        return value.map_or(true, |v| KEYS.iter().any(|k| v.get(k).is_some()));
    }
    let table = toml::de::DeTable::parse(text);
    table.map_or(true, |table| {
        // A field below the line [parameters] is meant for the top.
        let parameters = table.get_ref().get("parameters").and_then(|p| p.get_ref().as_table());
        KEYS.iter().any(|k| table.get_ref().get(*k).is_some())
            || parameters
                .is_some_and(|p| p.get("f").is_some_and(|f| f.get_ref().as_array().is_some()))
    })
}

/// A step of the way to a place in a document.
#[derive(Clone, Debug, PartialEq)]
enum Part {
    Key(String),
    Item(usize),
}

type Place = Vec<Part>;

fn key(name: &str) -> Place {
    vec![Part::Key(name.into())]
}

fn inside(place: &Place, name: &str) -> Place {
    let mut place = place.clone();
    place.push(Part::Key(name.into()));
    place
}

fn item(place: &Place, i: usize) -> Place {
    let mut place = place.clone();
    place.push(Part::Item(i));
    place
}

/// An error in a document, with its place.
pub(crate) struct Problem {
    place: Place,
    within: Option<(String, Range<usize>)>,
    pub(crate) message: String,
    help: Option<String>,
}

fn problem<T>(place: Place, message: impl Into<String>, help: Option<&str>) -> Result<T, Problem> {
    Err(Problem { place, within: None, message: message.into(), help: help.map(Into::into) })
}

/// The bytes of a TOML text that a place stands for.
fn span_of(text: &str, place: &Place) -> Option<Range<usize>> {
    let table = toml::de::DeTable::parse(text).ok()?;
    let Part::Key(first) = place.first()? else { return None };
    let mut at = table.get_ref().get(first.as_str())?;
    let mut span = at.span();
    for part in &place[1..] {
        let next = match part {
            Part::Key(name) => at.get_ref().as_table().and_then(|t| t.get(name.as_str())),
            Part::Item(i) => at.get_ref().as_array().and_then(|a| a.get(*i)),
        };
        // A key that is not there: the table that lacks it.
        let Some(next) = next else { break };
        at = next;
        span = at.span();
    }
    Some(span)
}

/// Advice for an event that is to fire where two sides are equal.
fn met(text: &str, mut problem: Problem) -> Problem {
    if let Some((left, right)) = text.split_once('=')
        && !text.contains(['<', '>', '!'])
    {
        let (left, right) = (left.trim(), right.trim_start_matches('=').trim());
        problem.help = Some(match (left, right) {
            ("t", time) => format!("at a time: at = {time}; at each of several: at = [1, 2]"),
            (left, "0") => {
                format!("an event fires where its expression is zero: when = \"{left}\"")
            }
            _ => {
                format!("an event fires where its expression is zero: when = \"{left} - {right}\"")
            }
        });
    }
    problem
}

/// Advice for a value of another kind than its key wants, by the line that it stands on.
fn remedy(text: &str, span: Range<usize>) -> Option<String> {
    let before = text.get(..span.start)?;
    let line = before.rsplit('\n').next()?;
    let (rest, table) = (text.get(span.start..)?, before.rsplit("\n[").next()?);
    let within = (before.contains("\n[") || before.starts_with('['))
        .then(|| table.trim_start_matches('[').split(']').next().unwrap_or("").to_owned());
    // A table's own line is no key of the table before it.
    if rest.starts_with("[event]") {
        return Some("write [[event]]: there may be several".into());
    }
    let key = line.split('=').next()?.trim();
    let of_the_top = ["f", "states", "start", "axes", "h", "plus", "minus", "name", "title"];
    Some(match (key, within) {
        (key, Some(table)) if of_the_top.contains(&key) && !table.contains("modes") => format!(
            "`{key}` stands in the table [{table}] here: write it above the file's first [table]"
        ),
        ("f", _) => "write an expression for each state: f = [\"v\", \"-x\"]".into(),
        ("states", _) => "write a list of names: states = [\"x\", \"v\"]".into(),
        ("start", _) => "write a number for each state, in their order: start = [1, 0]".into(),
        ("direction", _) => "write \"up\", \"down\" or \"both\"".into(),
        ("stop", _) => "write true or false".into(),
        _ => return None,
    })
}

impl Definition {
    /// Changes each expression of fields, terms and events, but for times.
    pub(crate) fn change_expressions(&mut self, change: impl Fn(&mut Expression)) {
        let terms = self.terms.iter_mut().map(|(_, e)| e);
        terms.chain(self.modes.iter_mut().flat_map(|mode| &mut mode.field)).for_each(&change);
        for event in &mut self.events {
            if let When::Zero(e, _) | When::Becomes(e) = &mut event.when {
                change(e);
            }
            event.set.iter_mut().for_each(|(_, e)| change(e));
        }
    }

    /// Reads a definition in TOML; `origin` names the text in errors.
    ///
    /// # Errors
    /// Points to the first thing that is wrong and says what to do.
    ///
    /// ```
    /// use twofold_hybrid::Definition;
    /// let text = "states = ['x']\nf = ['if(x, 1, 2)']";
    /// let error = Definition::from_toml(text, "my.toml").unwrap_err();
    /// assert_eq!(error.to_string().lines().nth(1), Some("  --> my.toml:2:10"));
    /// ```
    pub fn from_toml(text: &str, origin: &str) -> Result<Self, Diagnostic> {
        let at = |message: String, span: Range<usize>, help| {
            Diagnostic::new(message, origin, text, span, help)
        };
        if text.len() > MAX_FILE {
            return Err(at(
                format!("a file of {} bytes; the limit is {MAX_FILE}", text.len()),
                0..0,
                None,
            ));
        }
        let document: Document = toml::from_str(text).map_err(|e| {
            let quoted: Vec<&str> = e.message().split('`').skip(1).step_by(2).collect();
            let near = quoted.split_first().and_then(|(unknown, known)| nearest(unknown, known));
            let span = e.span().unwrap_or(0..0);
            let help = near.map(|n| format!("did you mean `{n}`?"));
            at(e.message().to_owned(), span.clone(), help.or_else(|| remedy(text, span)))
        })?;
        Self::from_document(document).map_err(|problem| {
            let mut span = span_of(text, &problem.place).unwrap_or(0..0);
            if let Some((expression, part)) = problem.within
                && let Some(start) =
                    text.get(span.clone()).and_then(|literal| literal.rfind(&expression))
            {
                span = span.start + start + part.start..span.start + start + part.end;
            }
            at(problem.message, span, problem.help)
        })
    }

    /// Reads a definition in JSON with the same fields.
    ///
    /// # Errors
    /// Names the first thing that is wrong.
    pub fn from_json(text: &str, origin: &str) -> Result<Self, Diagnostic> {
        if text.len() > MAX_FILE {
            let message = format!("a file of {} bytes; the limit is {MAX_FILE}", text.len());
            return Err(Diagnostic::new(message, origin, text, 0..0, None));
        }
        let document: Document = serde_json::from_str(text)
            .map_err(|e| Diagnostic::new(e.to_string(), origin, text, 0..0, None))?;
        Self::from_document(document).map_err(|problem| {
            let place: Vec<String> = problem
                .place
                .iter()
                .map(|part| match part {
                    Part::Key(name) => name.clone(),
                    Part::Item(i) => (i + 1).to_string(),
                })
                .collect();
            let place = format!("{origin}, {}", place.join("."));
            let (text, span) = problem.within.unwrap_or((String::new(), 0..0));
            Diagnostic::new(problem.message, &place, &text, span, problem.help)
        })
    }

    /// An error of a table's data, at its place in the text of the system's file.
    pub fn about_table(text: &str, origin: &str, table: &str, error: &BadTable) -> Diagnostic {
        let place = inside(&inside(&key("tables"), table), error.key);
        let help = Some(error.help.to_owned());
        match span_of(text, &place) {
            Some(span) => Diagnostic::new(error.to_string(), origin, text, span, help),
            None => {
                let origin = format!("{origin}, tables.{table}.{}", error.key);
                Diagnostic::new(error.to_string(), &origin, "", 0..0, help)
            }
        }
    }

    /// The system's name; empty if it has none.
    pub fn name(&self) -> &str {
        &self.document.name
    }

    /// One line about the system; its name if there is no title.
    pub fn title(&self) -> &str {
        if self.document.title.is_empty() { self.name() } else { &self.document.title }
    }

    /// The file's content, as data.
    pub fn document(&self) -> &Document {
        &self.document
    }

    /// The states, in order.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// The parameters, in order.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// The modes; one without a name if the system has only `f`.
    pub fn modes(&self) -> &[Mode] {
        &self.modes
    }

    /// The events, in order.
    pub fn events(&self) -> &[Event] {
        &self.events
    }

    /// The tables, by name.
    pub fn tables(&self) -> &[(String, TableEntry)] {
        &self.tables
    }

    /// The states that pictures show.
    pub fn axes(&self) -> &[usize] {
        &self.axes
    }

    pub(crate) fn from_document(document: Document) -> Result<Self, Problem> {
        let d = &document;
        let sound = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if d.name.len() > 64 || !d.name.chars().all(sound) {
            return problem(
                key("name"),
                "this cannot be a system's name",
                Some("letters, digits, - and _, at most 64"),
            );
        }
        if d.states.is_empty() || d.states.len() > MAX_STATES {
            let message = format!("{} states; a system has 1 to {MAX_STATES}", d.states.len());
            return problem(key("states"), message, None);
        }
        let counts = [
            ("parameters", d.parameters.0.len()),
            ("let", d.terms.0.len()),
            ("modes", d.modes.0.len()),
            ("event", d.event.len()),
            ("tables", d.tables.0.len()),
        ];
        if let Some((name, count)) = counts.iter().find(|(_, count)| *count > MAX_NAMES) {
            return problem(key(name), format!("{count} entries; the limit is {MAX_NAMES}"), None);
        }
        let names = names(d)?;
        let all: Vec<&str> = names.iter().map(|(_, n)| *n).collect();
        let conditions = conditions(d, &all);
        let parse = |place: Place, text: &str, known: &[&str]| {
            let refused = |mut error: ExpressionError, place| {
                let (before, from) = text.split_at(error.span.start.min(text.len()));
                let tables = d.tables.0.iter().map(|(name, _)| name);
                let mut called = tables.filter(|name| before.ends_with(*name));
                if from.starts_with('(')
                    && let Some(name) = called.next()
                {
                    error.message = format!("{name} is a table, and no function");
                    error.help = Some(format!("write {name} alone: that is its value at t"));
                }
                let within = Some((text.to_owned(), error.span));
                Problem { place, within, message: error.message, help: error.help }
            };
            match Expression::parse_general_with(text, known, &conditions) {
                Err(error) => Err(refused(error, place)),
                Ok(parsed) => match wrong_constants(&parsed, text) {
                    Some(error) => Err(refused(error, place)),
                    None => Ok(parsed),
                },
            }
        };
        let n = d.states.len();
        let list = |place: Place, texts: &[Constant]| -> Result<Vec<Expression>, Problem> {
            if texts.len() != n {
                let names: Vec<&str> = d.states.iter().map(|s| s.name.as_str()).collect();
                let message =
                    format!("{} expressions for {n} states ({})", texts.len(), names.join(", "));
                return problem(place, message, Some("give one for each state, in their order"));
            }
            texts.iter().enumerate().map(|(i, c)| parse(item(&place, i), &c.text(), &all)).collect()
        };
        let mut parameters: Vec<Parameter> = Vec::new();
        let mut values: BTreeMap<String, f64> = BTreeMap::new();
        for (name, entry) in &d.parameters.0 {
            let place = inside(&key("parameters"), name);
            let known: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
            let (value, about, bounds) = match entry {
                ParameterEntry::Plain(value) => (value, About::default(), (None, None)),
                ParameterEntry::Table { value, meaning, unit, above, below } => (
                    value,
                    About { meaning: meaning.clone(), unit: unit.clone() },
                    (*above, *below),
                ),
            };
            let value = parse(place.clone(), &value.text(), &known).map_err(|mut problem| {
                let later = |p: &&(String, ParameterEntry)| {
                    let named = format!("`{}`", p.0);
                    !known.contains(&p.0.as_str()) && problem.message.contains(&named)
                };
                if d.parameters.0.iter().any(|p| later(&p)) {
                    problem.help =
                        Some("a parameter may name those that stand before it".to_owned());
                }
                problem
            })?;
            if value.names().contains(&"t") {
                return problem(
                    place,
                    "a parameter does not depend on the time",
                    Some("put it into [let]"),
                );
            }
            let number = evaluate(&value, &|name| values.get(name).copied());
            if !number.is_finite() {
                let message = format!("`{name}` is {number}");
                return problem(place, message, Some("give a value that is a finite number"));
            }
            values.insert(name.clone(), number);
            parameters.push(Parameter { name: name.clone(), value, about, bounds });
        }
        let mut terms = Vec::new();
        for (name, text) in &d.terms.0 {
            terms.push((name.clone(), parse(inside(&key("let"), name), &text.text(), &all)?));
        }
        let terms = in_order(terms)?;
        let modes = match (&d.f, &d.h, d.modes.0.is_empty()) {
            (Some(f), None, true) => vec![Mode { name: String::new(), field: list(key("f"), f)? }],
            (None, Some(h), true) => {
                let switching = parse(key("h"), h, &all)?;
                let missing = || problem(key("h"), "h needs both `plus` and `minus`", None);
                let Some(plus) = &d.plus else { return missing() };
                let Some(minus) = &d.minus else { return missing() };
                let (plus, minus) = (list(key("plus"), plus)?, list(key("minus"), minus)?);
                let zero = || Box::new(Expression::Number(0.0.into()));
                let choose = |(a, b)| {
                    let condition = Expression::Greater(Box::new(switching.clone()), zero());
                    Expression::Apply(
                        twofold_system::expression::General::If,
                        vec![condition, a, b],
                    )
                };
                vec![Mode {
                    name: String::new(),
                    field: plus.into_iter().zip(minus).map(choose).collect(),
                }]
            }
            (None, None, false) => {
                let mut modes = Vec::new();
                for (name, mode) in &d.modes.0 {
                    let field = list(inside(&inside(&key("modes"), name), "f"), &mode.f)?;
                    modes.push(Mode { name: name.clone(), field });
                }
                modes
            }
            (None, None, true) => {
                return problem(
                    key("states"),
                    "there are no equations",
                    Some("give f, one expression a state: f = [\"-x\"]"),
                );
            }
            _ => {
                return problem(
                    key(if d.h.is_some() { "h" } else { "modes" }),
                    "the equations are given twice",
                    Some("give one of f, h with plus and minus, or modes"),
                );
            }
        };
        if d.h.is_none() && (d.plus.is_some() || d.minus.is_some()) {
            return problem(key("plus"), "`plus` and `minus` need the switching function h", None);
        }
        let mode_named = |place: Place, name: &Option<String>| -> Result<Option<usize>, Problem> {
            let Some(name) = name else { return Ok(None) };
            let known: Vec<&str> = modes.iter().map(|m| m.name.as_str()).collect();
            match known.iter().position(|n| n == name && !n.is_empty()) {
                Some(i) => Ok(Some(i)),
                None => {
                    let help = match nearest(name, &known) {
                        Some(near) => format!("did you mean `{near}`?"),
                        None if known.iter().all(|name| name.is_empty()) => {
                            "it has no modes: write [modes.NAME] with its f".into()
                        }
                        None => format!("modes are {}", known.join(", ")),
                    };
                    problem(place, format!("there is no mode `{name}`"), Some(&help))
                }
            }
        };
        let mut events = Vec::new();
        for (i, entry) in d.event.iter().enumerate() {
            let place = item(&key("event"), i);
            let constants: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
            let constant = |e: &Expression| evaluate(e, &|name| values.get(name).copied());
            let when = match (&entry.when, &entry.at, &entry.every) {
                (Some(text), None, None) => {
                    let at = inside(&place, "when");
                    let parsed =
                        parse(at.clone(), text, &all).map_err(|problem| met(text, problem))?;
                    let named = matches!(&parsed, Expression::Name(name)
                        if conditions.contains(&name.as_str()));
                    if !moves(&parsed, d, &terms) {
                        let help = "name a state or t, or give the times of the event by at = [1]";
                        let message = "this does not change, and so never passes zero or becomes \
                            true";
                        return problem(at, message, Some(help));
                    }
                    if parsed.is_condition() || named {
                        if entry.direction.is_some() {
                            let help =
                                "leave direction out, or give an expression whose zero is met";
                            return problem(
                                inside(&place, "direction"),
                                "a condition fires when it becomes true",
                                Some(help),
                            );
                        }
                        When::Becomes(parsed)
                    } else {
                        When::Zero(parsed, entry.direction.unwrap_or_default())
                    }
                }
                (None, Some(times), None) => {
                    let times = match times {
                        Constants::One(one) => vec![one.clone()],
                        Constants::List(list) => list.clone(),
                    };
                    let at = inside(&place, "at");
                    let listed = |mut problem: Problem| {
                        let comma =
                            problem.within.as_ref().is_some_and(|(text, _)| text.contains(','));
                        if comma {
                            problem.help = Some("several times are a list: at = [1, 2]".into());
                        }
                        problem
                    };
                    let read = times.iter().map(|c| parse(at.clone(), &c.text(), &constants));
                    let read: Vec<Expression> = read.collect::<Result<_, _>>().map_err(listed)?;
                    if read.is_empty() {
                        return problem(at, "`at` names no time", Some("give one time or more"));
                    }
                    let moments: Vec<f64> = read.iter().map(constant).collect();
                    for (k, time) in moments.iter().enumerate() {
                        if !time.is_finite() {
                            let message = format!("`at` is {time}");
                            return problem(at, message, Some("give a finite time"));
                        }
                        if moments[..k].contains(time) {
                            let message = format!("the time {time} stands twice");
                            let help = "an event fires once at a time: give each time once";
                            return problem(at, message, Some(help));
                        }
                    }
                    When::At(read)
                }
                (None, None, Some(period)) => {
                    let at = inside(&place, "every");
                    let read = parse(at.clone(), &period.text(), &constants)?;
                    let period = constant(&read);
                    if !(period.is_finite() && period > 0.0) {
                        let message = format!("`every` is {period}");
                        return problem(at, message, Some("give a time above 0"));
                    }
                    When::Every(read)
                }
                (None, None, None) => {
                    return problem(
                        place,
                        "it is not said when the event fires",
                        Some("give when, at or every"),
                    );
                }
                _ => {
                    return problem(
                        place,
                        "an event has one of when, at and every",
                        Some("write one [[event]] for each"),
                    );
                }
            };
            if entry.direction.is_some() && entry.when.is_none() {
                return problem(inside(&place, "direction"), "`direction` belongs to `when`", None);
            }
            let mut set = Vec::new();
            for (name, value) in entry.set.iter().flat_map(|s| &s.0) {
                let at = inside(&inside(&place, "set"), name);
                let Some(state) = d.states.iter().position(|s| s.name == *name) else {
                    let known: Vec<&str> = d.states.iter().map(|s| s.name.as_str()).collect();
                    let help = nearest(name, &known)
                        .map_or(format!("states are {}", known.join(", ")), |n| {
                            format!("did you mean `{n}`?")
                        });
                    return problem(at, format!("there is no state `{name}` to set"), Some(&help));
                };
                set.push((state, parse(at, &value.text(), &all)?));
            }
            let mode = mode_named(inside(&place, "mode"), &entry.mode)?;
            let from = mode_named(inside(&place, "from"), &entry.from)?;
            let sticks = entry.after_zeno == Some(AfterZeno::Stick);
            if sticks && (set.is_empty() || !matches!(when, When::Zero(..))) {
                let help = "give when = \"x\" (its zero is the surface) and set = { v = \"-r*v\" \
                    }; where two bodies strike each other, the speeds of both";
                return problem(
                    inside(&place, "after_zeno"),
                    "only an event that sets speeds where an expression is zero can stick",
                    Some(help),
                );
            }
            let name =
                if entry.name.is_empty() { format!("event {}", i + 1) } else { entry.name.clone() };
            if events.iter().any(|other: &Event| other.name == name) {
                let message = format!("the name `{name}` is given to two events");
                let help = "tables and `stopped by` tell events by their names: give each its own";
                return problem(inside(&place, "name"), message, Some(help));
            }
            events.push(Event { name, when, set, mode, from, stop: entry.stop, sticks });
        }
        let start = match &d.start {
            None => None,
            Some(start) if start.len() != n => {
                let message = format!("{} numbers for {n} states", start.len());
                return problem(
                    key("start"),
                    message,
                    Some("give one for each state, in their order"),
                );
            }
            Some(start) => {
                let known: Vec<&str> = parameters.iter().map(|p| p.name.as_str()).collect();
                let read = start
                    .iter()
                    .enumerate()
                    .map(|(i, c)| parse(item(&key("start"), i), &c.text(), &known));
                Some(read.collect::<Result<_, _>>()?)
            }
        };
        let mut axes = Vec::new();
        for (i, axis) in d.axes.iter().enumerate() {
            let Some(state) = d.states.iter().position(|s| s.name == *axis) else {
                return problem(item(&key("axes"), i), format!("there is no state `{axis}`"), None);
            };
            axes.push(state);
        }
        for (name, table) in &d.tables.0 {
            let place = inside(&inside(&key("tables"), name), "file");
            let file = std::path::Path::new(&table.file);
            let plain = file.components().count() == 1
                && file.file_name().is_some_and(|f| f == file.as_os_str());
            if !plain {
                return problem(
                    place,
                    "a table's file stands beside the system's, without folders",
                    None,
                );
            }
        }
        let states = d
            .states
            .iter()
            .map(|s| State { name: s.name.clone(), about: s.about.clone() })
            .collect();
        let tables = d.tables.0.clone();
        Ok(Self { states, parameters, start, axes, terms, modes, events, tables, document })
    }
}

/// Whether an expression depends on a state, the time or a table.
fn moves(e: &Expression, d: &Document, terms: &[(String, Expression)]) -> bool {
    let (mut open, mut seen) = (e.names(), HashSet::new());
    while let Some(name) = open.pop() {
        let itself = name == "t"
            || d.states.iter().any(|s| s.name == name)
            || d.tables.0.iter().any(|(table, _)| table == name);
        if itself {
            return true;
        }
        if seen.insert(name) {
            let term = terms.iter().find(|(term, _)| term == name);
            open.extend(term.into_iter().flat_map(|(_, e)| e.names()));
        }
    }
    false
}

/// A function with constants that give it no meaning: `clip` with its ends exchanged, `mod` by 0.
fn wrong_constants(e: &Expression, text: &str) -> Option<ExpressionError> {
    fn all<'a>(e: &'a Expression, of: General, found: &mut Vec<&'a [Expression]>) {
        match e {
            Expression::Apply(f, list) if *f == of => found.push(list),
            _ => {}
        }
        e.parts().into_iter().for_each(|part| all(part, of, found));
    }
    let number = |e: &Expression| -> f64 { evaluate(e, &|_| None) };
    // Calls stand in the text in the order in which they are found.
    let calls = |name: &'static str, of: General| {
        let mut found = Vec::new();
        all(e, of, &mut found);
        let part_of_a_name = |c: char| c.is_ascii_alphanumeric() || c == '_';
        let whole = |at: &usize| {
            !text[..*at].ends_with(part_of_a_name)
                && text[at + name.len()..].trim_start().starts_with('(')
        };
        let places: Vec<usize> = text.match_indices(name).map(|(at, _)| at).filter(whole).collect();
        let span = move |i: usize| places.get(i).map_or(0..text.len(), |at| *at..at + name.len());
        (found, span)
    };
    let (clips, span) = calls("clip", General::Clip);
    if let Some(i) = clips.iter().position(|list| number(&list[1]) > number(&list[2])) {
        let (low, high) = (&clips[i][1], &clips[i][2]);
        return Some(ExpressionError {
            span: span(i),
            message: format!("clip's lower end {low} is above its upper end {high}"),
            help: Some("write clip(x, low, high)".into()),
        });
    }
    let (mods, span) = calls("mod", General::Mod);
    let i = mods.iter().position(|list| number(&list[1]) == 0.0)?;
    Some(ExpressionError {
        span: span(i),
        message: "mod by 0 has no value".into(),
        help: Some("write mod(x, m) with m other than 0".into()),
    })
}

/// The names in `[let]` that stand for conditions.
fn conditions<'a>(d: &'a Document, names: &[&str]) -> Vec<&'a str> {
    // Read as if every term were a condition where one is wanted: what a term is does not depend on
    // that.
    let terms: Vec<&str> = d.terms.0.iter().map(|(n, _)| n.as_str()).collect();
    let read = |text: &Constant| Expression::parse_general_with(&text.text(), names, &terms).ok();
    let parsed: Vec<Option<Expression>> = d.terms.0.iter().map(|(_, text)| read(text)).collect();
    let mut found: Vec<&str> = Vec::new();
    for _ in 0..=terms.len() {
        for (name, e) in terms.iter().zip(&parsed) {
            let holds = match e {
                Some(Expression::Name(other)) => found.contains(&other.as_str()),
                Some(e) => e.is_condition(),
                None => false,
            };
            if holds && !found.contains(name) {
                found.push(name);
            }
        }
    }
    found
}

/// Columns of a recorded table beside the time and the states.
const COLUMNS_OF_WORDS: [&str; 4] = ["mode", "signs", "direction", "event"];

/// All names that expressions may use, each sound and given once, with its place.
fn names(d: &Document) -> Result<Vec<(Place, &str)>, Problem> {
    let states =
        d.states.iter().enumerate().map(|(i, s)| (item(&key("states"), i), s.name.as_str()));
    let under = |table: &'static str| move |n: &'_ str| inside(&key(table), n);
    let (of_parameters, of_terms, of_tables) = (under("parameters"), under("let"), under("tables"));
    let parameters = d.parameters.0.iter().map(|(n, _)| (of_parameters(n), n.as_str()));
    let terms = d.terms.0.iter().map(|(n, _)| (of_terms(n), n.as_str()));
    let tables = d.tables.0.iter().map(|(n, _)| (of_tables(n), n.as_str()));
    let mut names: Vec<(Place, &str)> = Vec::new();
    for (place, name) in states.chain(parameters).chain(terms).chain(tables) {
        if !is_name(name) || name.len() > 64 {
            return problem(
                place,
                format!("{name:?} cannot be a name"),
                Some("a letter, then letters, digits and _, at most 64"),
            );
        }
        if is_reserved_in_general(name) {
            let message = format!("`{name}` has a meaning of its own in expressions");
            return problem(place, message, Some("choose another name"));
        }
        if d.states.iter().any(|s| s.name == name) && COLUMNS_OF_WORDS.contains(&name) {
            let message = format!("recorded tables have a column `{name}` of their own");
            return problem(place, message, Some("rename the state"));
        }
        if names.iter().any(|(_, n)| *n == name) {
            let message = format!("the name `{name}` is given twice");
            return problem(
                place,
                message,
                Some("give every state, parameter, term and table its own name"),
            );
        }
        names.push((place, name));
    }
    Ok(names)
}

/// Terms in an order in which each comes after those that it names.
fn in_order(mut terms: Vec<(String, Expression)>) -> Result<Vec<(String, Expression)>, Problem> {
    let mut done: Vec<(String, Expression)> = Vec::new();
    while !terms.is_empty() {
        let open: Vec<String> = terms.iter().map(|(n, _)| n.clone()).collect();
        let ready =
            terms.iter().position(|(_, e)| !e.names().iter().any(|n| open.iter().any(|o| o == n)));
        match ready {
            Some(i) => done.push(terms.remove(i)),
            None => {
                let message = format!("`{}` depends on itself", terms[0].0);
                return problem(inside(&key("let"), &terms[0].0), message, None);
            }
        }
    }
    Ok(done)
}

/// Whether an expression itself has a switching function.
pub(crate) fn asks(e: &Expression) -> bool {
    let itself = match e {
        Expression::Greater(..) | Expression::Call(Function::Sign | Function::Abs, _) => true,
        Expression::Apply(f, _) => {
            use General::{Atan2, Clip, Floor, Heaviside, If, Max, Min, Mod};
            matches!(f, Min | Max | If | Heaviside | Floor | Mod | Clip | Atan2)
        }
        _ => false,
    };
    itself || e.parts().into_iter().any(asks)
}

/// Whether any equation of a system has a switching function.
pub(crate) fn has_switches(definition: &Definition) -> bool {
    let fields = definition.modes.iter().flat_map(|m| &m.field);
    let terms = definition.terms.iter().map(|(_, e)| e);
    let events = definition.events.iter().filter_map(|e| match &e.when {
        When::Zero(e, _) | When::Becomes(e) => Some(e),
        _ => None,
    });
    fields.chain(terms).chain(events).any(asks)
}
