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

mod reading;

use std::ops::Range;

use reading::remedy;
use serde::{Deserialize, Serialize};
use twofold_num::Decimal;
use twofold_system::diagnostic::{Diagnostic, nearest};
use twofold_system::document::{About, Ordered, StateEntry};
use twofold_system::expression::{Function, General};
use twofold_system::{Expression, definition::State};

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
