//! A piecewise-smooth system as data, from a file.
//!
//! ```toml
//! name = "stick-slip"                     # letters, digits, - and _
//! title = "A block on a moving belt"      # optional, as are about, references, start, axes
//! states = [
//!     { name = "x", meaning = "position" },
//!     { name = "v", meaning = "speed" },  # or only "v"
//! ]
//! start = [0, 0]
//! h = "v - belt"                          # f+ holds where h > 0, f- where h < 0
//! plus = ["v", "push - friction"]         # one expression a state: the derivatives
//! minus = ["v", "push + friction"]
//!
//! [parameters]
//! belt = { value = 0.3, meaning = "speed of the belt" }   # or only belt = 0.3
//! friction = { value = 1, above = 0 }                     # or below: other values are refused
//!
//! [let]                                   # intermediate terms, in any order
//! push = "-x"
//! ```
//!
//! A system may switch at a second surface: `plus` and `minus` above are then the fields where its
//! h is positive, and the table `second` has those where it is negative.
//!
//! ```toml
//! [second]
//! h = "w - belt"
//! plus = ["v", "push - friction", "w", "pull + friction"]     # where the first h > 0
//! minus = ["v", "push + friction", "w", "pull + friction"]    # where the first h < 0
//! ```
//!
//! Expressions are described in [`expression`](super::expression). Parameters are decimal numbers;
//! digits beyond double precision, given as a string, are used by extended precision.

// A diagnostic is made once, when a file is read; boxing it would show in every signature and save
// nothing.
#![allow(clippy::result_large_err)]

use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};

use super::diagnostic::{Diagnostic, nearest};
use super::document::{Canonical, Document, Ordered, ParameterEntry, SecondEntry, StateEntry};
use super::expression::{Expression, ExpressionError, is_name, is_reserved};
use super::own_side::on_own_sides;
use twofold_num::tape::{Recorded, Tape};
use twofold_num::{Arithmetic, Decimal};

pub use super::document::{About, Bounds};

/// Maximum number of states of a system.
pub const MAX_STATES: usize = 100;
/// Maximum number of parameters, and of intermediate terms.
pub const MAX_NAMES: usize = 100;
/// Maximum length of a file, in bytes.
pub const MAX_FILE: usize = 100_000;
/// Maximum number of operations in h, f+ and f- together.
pub const MAX_OPERATIONS: usize = 10_000;

/// A piecewise-smooth system x' = f+(x) where h(x) > 0, x' = f-(x) where h(x) < 0, as expressions.
/// See the [module](self).
///
/// A definition that exists is sound: names are known, counts fit, terms do not depend on
/// themselves.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(into = "Document", try_from = "Document")]
pub struct Definition {
    name: String,
    title: String,
    about: String,
    references: Vec<String>,
    states: Vec<State>,
    parameters: Vec<ParameterDefinition>,
    start: Option<Vec<f64>>,
    axes: Vec<usize>,
    terms: Vec<(String, Expression)>,
    switching: Expression,
    plus: Vec<Expression>,
    minus: Vec<Expression>,
    second: Option<Second>,
}

/// A second switching surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Second {
    /// Its switching function.
    pub switching: Expression,
    /// f+ where that is negative, component by component.
    pub plus: Vec<Expression>,
    /// f- where that is negative.
    pub minus: Vec<Expression>,
}

/// A state of a system.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct State {
    /// Its name.
    pub name: String,
    /// Its meaning and unit.
    pub about: About,
}

/// A parameter of a system.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterDefinition {
    /// Its name.
    pub name: String,
    /// Its default value.
    pub value: Decimal,
    /// Its meaning and unit.
    pub about: About,
    /// The range of values that it may have.
    pub bounds: Bounds,
}

impl Definition {
    /// Reads a definition in TOML; `origin` names the text in errors.
    ///
    /// # Errors
    /// Points to the first thing that is wrong and says what to do.
    ///
    /// ```
    /// use twofold_system::Definition;
    /// let text = "states = ['x']\nh = 'x'\nplus = ['-1']\nminus = ['y']";
    /// let error = Definition::from_toml(text, "my.toml").unwrap_err();
    /// assert_eq!(error.to_string().lines().nth(1), Some("  --> my.toml:4:11"));
    /// assert_eq!(error.help.as_deref(), Some("known here: x"));
    /// ```
    pub fn from_toml(text: &str, origin: &str) -> Result<Self, Diagnostic> {
        let error = |message: String, span: Range<usize>, help: Option<String>| {
            Err(Diagnostic::new(message, origin, text, span, help))
        };
        if text.len() > MAX_FILE {
            return error(
                format!("a file of {} bytes; the limit is {MAX_FILE}", text.len()),
                0..0,
                None,
            );
        }
        let document: Document = match toml::from_str(text) {
            Ok(document) => document,
            Err(e) => {
                let help = advice(e.message());
                return error(e.message().to_string(), e.span().unwrap_or(0..0), help);
            }
        };
        Self::from_document(document).map_err(|mut problem| {
            let mut span = span_of(text, &problem.place).unwrap_or(0..0);
            if let Some((expression, part)) =
                problem.within.take().filter(|(text, _)| !text.is_empty())
            {
                // The expression's own text, if it stands in the file as it is.
                if let Some(at) =
                    text.get(span.clone()).and_then(|literal| literal.rfind(&expression))
                {
                    span = span.start + at + part.start..span.start + at + part.end;
                }
            }
            Diagnostic::new(problem.message, origin, text, span, problem.help)
        })
    }

    /// The definition in TOML, as [`Definition::from_toml`] reads it.
    pub fn to_toml(&self) -> String {
        let quoted =
            |text: &str| serde_json::Value::from(text).to_string().replace('\u{7f}', "\\u007F");
        let list = |items: &mut dyn Iterator<Item = String>| items.collect::<Vec<_>>().join(", ");
        let about = |about: &About| {
            let mut text = String::new();
            for (key, value) in [("meaning", &about.meaning), ("unit", &about.unit)] {
                if !value.is_empty() {
                    text += &format!(", {key} = {}", quoted(value));
                }
            }
            text
        };
        let mut text = String::new();
        for (key, value) in [("name", &self.name), ("title", &self.title), ("about", &self.about)] {
            if !value.is_empty() {
                text += &format!("{key} = {}\n", quoted(value));
            }
        }
        if !self.references.is_empty() {
            text += &format!(
                "references = [{}]\n",
                list(&mut self.references.iter().map(|r| quoted(r)))
            );
        }
        text += "states = [\n";
        for state in &self.states {
            text += &format!("    {{ name = {}{} }},\n", quoted(&state.name), about(&state.about));
        }
        text += "]\n";
        if let Some(start) = &self.start {
            text += &format!(
                "start = [{}]\n",
                list(&mut start.iter().map(|x| number(&Decimal::from(*x))))
            );
        }
        if !self.axes.is_empty() {
            text += &format!(
                "axes = [{}]\n",
                list(&mut self.axes.iter().map(|i| quoted(&self.states[*i].name)))
            );
        }
        text += &format!("h = {}\n", quoted(&self.switching.to_string()));
        for (key, field) in [("plus", &self.plus), ("minus", &self.minus)] {
            text +=
                &format!("{key} = [{}]\n", list(&mut field.iter().map(|e| quoted(&e.to_string()))));
        }
        if let Some(second) = &self.second {
            text += &format!("\n[second]\nh = {}\n", quoted(&second.switching.to_string()));
            for (key, field) in [("plus", &second.plus), ("minus", &second.minus)] {
                text += &format!(
                    "{key} = [{}]\n",
                    list(&mut field.iter().map(|e| quoted(&e.to_string())))
                );
            }
        }
        if !self.parameters.is_empty() {
            text += "\n[parameters]\n";
            for p in &self.parameters {
                let mut bounds = String::new();
                for (key, bound) in [("above", &p.bounds.above), ("below", &p.bounds.below)] {
                    if let Some(bound) = bound {
                        bounds += &format!(", {key} = {}", number(bound));
                    }
                }
                text += &format!(
                    "{} = {{ value = {}{bounds}{} }}\n",
                    p.name,
                    number(&p.value),
                    about(&p.about)
                );
            }
        }
        if !self.terms.is_empty() {
            text += "\n[let]\n";
            for (name, term) in &self.terms {
                text += &format!("{name} = {}\n", quoted(&term.to_string()));
            }
        }
        text
    }

    /// The system's name; empty if it has none.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// One line about the system; its name if there is no title.
    pub fn title(&self) -> &str {
        if self.title.is_empty() { &self.name } else { &self.title }
    }

    /// More about the system.
    pub fn about(&self) -> &str {
        &self.about
    }

    /// Sources of the system.
    pub fn references(&self) -> &[String] {
        &self.references
    }

    /// Number of states.
    pub fn dimension(&self) -> usize {
        self.states.len()
    }

    /// The states, in order.
    pub fn states(&self) -> &[State] {
        &self.states
    }

    /// The parameters, as they were listed.
    pub fn parameters(&self) -> &[ParameterDefinition] {
        &self.parameters
    }

    /// A suggested initial state.
    pub fn start(&self) -> Option<&[f64]> {
        self.start.as_deref()
    }

    /// States that a picture shows, at most three: horizontal, depth (of three), vertical. Empty:
    /// the first ones.
    pub fn axes(&self) -> &[usize] {
        &self.axes
    }

    /// The switching function h.
    pub fn switching(&self) -> &Expression {
        &self.switching
    }

    /// f+, component by component.
    pub fn plus(&self) -> &[Expression] {
        &self.plus
    }

    /// f-, component by component.
    pub fn minus(&self) -> &[Expression] {
        &self.minus
    }

    /// The second switching surface, if there is one.
    pub fn second(&self) -> Option<&Second> {
        self.second.as_ref()
    }

    /// The system near one of its two surfaces (0 or 1) and off the other: it switches at that one,
    /// and the other's function is positive, or `below` zero. None for a system with one surface.
    pub fn face(&self, surface: usize, below: bool) -> Option<Self> {
        let second = self.second.as_ref()?;
        let mut face = Self { second: None, ..self.clone() };
        match (surface, below) {
            (0, false) => {}
            (0, true) => (face.plus, face.minus) = (second.plus.clone(), second.minus.clone()),
            (_, false) => {
                (face.switching, face.minus) = (second.switching.clone(), second.plus.clone())
            }
            (_, true) => {
                (face.switching, face.plus) = (second.switching.clone(), self.minus.clone());
                face.minus = second.minus.clone();
            }
        }
        Some(face)
    }

    /// The data that determine the system's numbers, with these values of its parameters (in their
    /// order).
    pub(super) fn canonical(&self, values: &[Decimal]) -> Canonical {
        let printed = |e: &[Expression]| e.iter().map(Expression::to_string).collect();
        Canonical {
            states: self.states.iter().map(|s| s.name.clone()).collect(),
            parameters: self
                .parameters
                .iter()
                .zip(values)
                .map(|(p, v)| (p.name.clone(), v.clone()))
                .collect(),
            terms: self.terms.iter().map(|(name, term)| (name.clone(), term.to_string())).collect(),
            h: self.switching.to_string(),
            plus: printed(&self.plus),
            minus: printed(&self.minus),
            second: self.second.as_ref().map(Second::entry),
        }
    }

    /// Whether both do the same operations for the same names: equal but for texts and values.
    pub(super) fn same_equations(&self, other: &Self) -> bool {
        let sorted = |d: &Self| {
            let mut parameters: Vec<String> = d.parameters.iter().map(|p| p.name.clone()).collect();
            parameters.sort();
            let mut terms = d.terms.clone();
            terms.sort_by(|a, b| a.0.cmp(&b.0));
            (parameters, terms)
        };
        self.switching == other.switching
            && self.plus == other.plus
            && self.minus == other.minus
            && self.second == other.second
            && self.states.iter().map(|s| &s.name).eq(other.states.iter().map(|s| &s.name))
            && sorted(self) == sorted(other)
    }

    /// The same system with time running backwards: -f+ and -f-.
    pub fn reversed(&self) -> Self {
        let negative =
            |e: &Vec<Expression>| e.iter().map(|e| Expression::Neg(Box::new(e.clone()))).collect();
        Self {
            name: if self.name.is_empty() {
                String::new()
            } else {
                format!("{}-reversed", self.name)
            },
            title: format!("{}, time reversed", self.title()),
            plus: negative(&self.plus),
            minus: negative(&self.minus),
            second: self.second.as_ref().map(|s| Second {
                switching: s.switching.clone(),
                plus: negative(&s.plus),
                minus: negative(&s.minus),
            }),
            ..self.clone()
        }
    }

    /// The equations on a tape: h, then f+, then f-; of a system with two surfaces then the same
    /// three of the second. `values` are the parameters', in their order.
    pub(super) fn tape(&self, values: &[Decimal]) -> Tape {
        let tape = Tape::record(self.dimension(), |x| {
            let mut known: BTreeMap<&str, Recorded> = BTreeMap::new();
            for (state, x) in self.states.iter().zip(x) {
                known.insert(&state.name, *x);
            }
            for (parameter, value) in self.parameters.iter().zip(values) {
                known.insert(&parameter.name, Recorded::parameter(&parameter.name, value));
            }
            // `terms` stand in an order in which each comes after those that it names.
            let record = |expression: &Expression, known: &BTreeMap<&str, Recorded>| {
                let mut name = |name: &str| known.get(name).copied().unwrap_or(Recorded::zero());
                expression.evaluate(&mut name, &Recorded::constant)
            };
            for (name, term) in &self.terms {
                let value = record(term, &known);
                known.insert(name, value);
            }
            let second = self
                .second
                .iter()
                .flat_map(|s| std::iter::once(&s.switching).chain(&s.plus).chain(&s.minus));
            let all =
                std::iter::once(&self.switching).chain(&self.plus).chain(&self.minus).chain(second);
            all.map(|e| record(e, &known)).collect()
        });
        let tape = if self.second.is_none() { on_own_sides(tape) } else { tape };
        tape.with_names(self.states.iter().map(|s| s.name.clone()))
    }

    fn from_document(document: Document) -> Result<Self, Problem> {
        let states = checked_states(&document)?;
        let names = checked_names(&document)?;
        let dimension = states.len();
        let parse = |place: Place, text: &str| {
            Expression::parse(text, &names)
                .map_err(|error| Problem::in_expression(place, text, error))
        };
        let field = |key: &'static str, texts: &[String]| -> Result<Vec<Expression>, Problem> {
            if texts.len() != dimension {
                return Err(wrong_count(key, texts.len(), &states));
            }
            texts.iter().enumerate().map(|(i, text)| parse(Place::item(key, i), text)).collect()
        };
        let mut terms = Vec::new();
        for (name, text) in &document.terms.0 {
            terms.push((name.clone(), parse(Place::entry("let", name), text)?));
        }
        let terms = in_order(terms)?;
        let switching = parse(Place::key("h"), &document.h)?;
        let (plus, minus) = (field("plus", &document.plus)?, field("minus", &document.minus)?);
        let second = match &document.second {
            None => None,
            Some(entry) => {
                let part =
                    |key: &'static str, texts: &[String]| -> Result<Vec<Expression>, Problem> {
                        if texts.len() != dimension {
                            let problem = wrong_count(key, texts.len(), &states);
                            return Err(Problem {
                                place: Place::part(key, None),
                                message: format!("second.{}", problem.message),
                                ..problem
                            });
                        }
                        texts
                            .iter()
                            .enumerate()
                            .map(|(i, text)| parse(Place::part(key, Some(i)), text))
                            .collect()
                    };
                Some(Second {
                    switching: parse(Place::part("h", None), &entry.h)?,
                    plus: part("plus", &entry.plus)?,
                    minus: part("minus", &entry.minus)?,
                })
            }
        };
        let start = match &document.start {
            Some(start) if start.len() != dimension => {
                return Err(wrong_count("start", start.len(), &states));
            }
            start => start.as_ref().map(|s| s.iter().map(Decimal::value).collect()),
        };
        let definition = Self {
            axes: checked_axes(&document, &states)?,
            name: checked_title(&document)?,
            title: document.title,
            about: document.about,
            references: document.references,
            parameters: document
                .parameters
                .0
                .into_iter()
                .map(|(name, ParameterEntry { value, about, bounds })| ParameterDefinition {
                    name,
                    value,
                    about,
                    bounds,
                })
                .collect(),
            states,
            start,
            terms,
            switching,
            plus,
            minus,
            second,
        };
        for p in &definition.parameters {
            if let Some(rule) = p.bounds.refuse(p.value.value()) {
                let message = format!("`{}` is {}, and its values are {rule}", p.name, p.value);
                return Err(Problem::new(Place::entry("parameters", &p.name), message, None));
            }
        }
        let values: Vec<Decimal> = definition.parameters.iter().map(|p| p.value.clone()).collect();
        let operations = definition.tape(&values).operations().len();
        if operations > MAX_OPERATIONS {
            let message = format!(
                "the equations take {operations} operations; the limit is {MAX_OPERATIONS}"
            );
            return Err(Problem::new(Place::key("plus"), message, None));
        }
        let depends = |e: &Expression| definition.depends_on_state(e);
        if !depends(&definition.switching) {
            let help = Some(format!("for example h = \"{}\"", definition.states[0].name));
            return Err(Problem::new(
                Place::key("h"),
                "h depends on no state, so that nothing ever switches",
                help,
            ));
        }
        if let Some(second) = &definition.second {
            if !depends(&second.switching) {
                let message =
                    "the second h depends on no state, so that nothing ever switches at it";
                return Err(Problem::new(Place::part("h", None), message, None));
            }
            if second.switching == definition.switching {
                let message = "both surfaces are the same: every point of one is a point of both";
                return Err(Problem::new(
                    Place::part("h", None),
                    message,
                    Some("leave [second] out".into()),
                ));
            }
        }
        Ok(definition)
    }

    /// The states on which h depends, by their numbers.
    pub fn switching_states(&self) -> Vec<usize> {
        fn reaches(d: &Definition, expression: &Expression, state: &str) -> bool {
            expression.names().into_iter().any(|name| {
                name == state
                    || d.terms.iter().any(|(n, term)| n == name && reaches(d, term, state))
            })
        }
        (0..self.dimension())
            .filter(|i| reaches(self, &self.switching, &self.states[*i].name))
            .collect()
    }

    fn depends_on_state(&self, expression: &Expression) -> bool {
        expression.names().into_iter().any(|name| {
            self.states.iter().any(|s| s.name == name)
                || self.terms.iter().any(|(n, term)| n == name && self.depends_on_state(term))
        })
    }
}

impl Second {
    fn entry(&self) -> SecondEntry {
        let printed = |e: &[Expression]| e.iter().map(Expression::to_string).collect();
        SecondEntry {
            h: self.switching.to_string(),
            plus: printed(&self.plus),
            minus: printed(&self.minus),
        }
    }
}

/// A number as TOML and JSON write it.
fn number(value: &Decimal) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

impl From<Definition> for Document {
    fn from(d: Definition) -> Self {
        let axes = d.axes.iter().map(|i| d.states[*i].name.clone()).collect();
        Self {
            name: d.name,
            title: d.title,
            about: d.about,
            references: d.references,
            start: d.start.map(|s| s.into_iter().map(Decimal::from).collect()),
            axes,
            h: d.switching.to_string(),
            plus: d.plus.iter().map(Expression::to_string).collect(),
            minus: d.minus.iter().map(Expression::to_string).collect(),
            second: d.second.as_ref().map(Second::entry),
            states: d
                .states
                .into_iter()
                .map(|State { name, about }| StateEntry { name, about })
                .collect(),
            parameters: Ordered(
                d.parameters
                    .into_iter()
                    .map(|ParameterDefinition { name, value, about, bounds }| {
                        (name, ParameterEntry { value, about, bounds })
                    })
                    .collect(),
            ),
            terms: Ordered(
                d.terms.iter().map(|(name, term)| (name.clone(), term.to_string())).collect(),
            ),
        }
    }
}

impl TryFrom<Document> for Definition {
    type Error = Diagnostic;

    fn try_from(document: Document) -> Result<Self, Diagnostic> {
        Self::from_document(document).map_err(|problem| {
            let place = problem.place.to_string();
            let (text, span) = problem.within.unwrap_or((place.clone(), 0..place.len()));
            Diagnostic::new(problem.message, &place, &text, span, problem.help)
        })
    }
}

/// A place in a document.
#[derive(Clone, Debug, PartialEq)]
struct Place {
    key: &'static str,
    within: Within,
}

#[derive(Clone, Debug, PartialEq)]
enum Within {
    Whole,
    Item(usize),
    Entry(String),
    /// An entry of a table of fixed keys, or an item of that entry.
    Part(&'static str, Option<usize>),
}

impl Place {
    fn key(key: &'static str) -> Self {
        Self { key, within: Within::Whole }
    }
    fn item(key: &'static str, i: usize) -> Self {
        Self { key, within: Within::Item(i) }
    }
    fn part(part: &'static str, item: Option<usize>) -> Self {
        Self { key: "second", within: Within::Part(part, item) }
    }
    fn entry(key: &'static str, name: &str) -> Self {
        Self { key, within: Within::Entry(name.into()) }
    }
}

impl std::fmt::Display for Place {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match &self.within {
            Within::Whole => f.write_str(self.key),
            Within::Item(i) => write!(f, "{}[{}]", self.key, i + 1),
            Within::Entry(name) => write!(f, "{}.{name}", self.key),
            Within::Part(part, None) => write!(f, "{}.{part}", self.key),
            Within::Part(part, Some(i)) => write!(f, "{}.{part}[{}]", self.key, i + 1),
        }
    }
}

/// An error of a document.
struct Problem {
    place: Place,
    /// An expression's text and the part of it that is wrong.
    within: Option<(String, Range<usize>)>,
    message: String,
    help: Option<String>,
}

impl Problem {
    fn new(place: Place, message: impl Into<String>, help: Option<String>) -> Self {
        Self { place, within: None, message: message.into(), help }
    }

    fn in_expression(place: Place, text: &str, error: ExpressionError) -> Self {
        Self {
            place,
            within: Some((text.into(), error.span)),
            message: error.message,
            help: error.help,
        }
    }
}

/// The bytes of a TOML text that a place stands for.
fn span_of(text: &str, place: &Place) -> Option<Range<usize>> {
    let table = toml::de::DeTable::parse(text).ok()?;
    let value = table.get_ref().get(place.key)?;
    let span = match &place.within {
        Within::Whole => value.span(),
        Within::Item(i) => value.get_ref().as_array()?.get(*i)?.span(),
        Within::Part(part, item) => {
            let entry = value.get_ref().as_table()?.get(*part)?;
            match item {
                None => entry.span(),
                Some(i) => entry.get_ref().as_array()?.get(*i)?.span(),
            }
        }
        // The name: for a term's text, the whole line from there.
        Within::Entry(name) => {
            let (key, entry) = value.get_ref().as_table()?.get_key_value(name.as_str())?;
            key.span().start..entry.span().end
        }
    };
    Some(span)
}

/// Help for an error of the outer form.
fn advice(message: &str) -> Option<String> {
    let quoted: Vec<&str> = message.split('`').skip(1).step_by(2).collect();
    if message.starts_with("unknown field") {
        let (unknown, known) = quoted.split_first()?;
        return nearest(unknown, known).map(|near| format!("did you mean `{near}`?"));
    }
    if message.starts_with("missing field") {
        return Some(
            match *quoted.first()? {
                "states" => "name the states: states = [\"x\", \"y\"]",
                "h" => "give the switching function: h = \"x\"; f+ holds where it is positive",
                "plus" => "give f+, one expression a state: plus = [\"-y\", \"1\"]",
                "minus" => "give f-, one expression a state: minus = [\"z\", \"1\"]",
                "value" => "give the parameter's value: { value = 0.1 }",
                "name" => "give the state's name: { name = \"x\" }",
                _ => return None,
            }
            .into(),
        );
    }
    None
}

fn checked_title(document: &Document) -> Result<String, Problem> {
    let sound = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if document.name.len() > 64 || !document.name.chars().all(sound) {
        let help = Some("letters, digits, - and _, at most 64; anything may stand in title".into());
        return Err(Problem::new(Place::key("name"), "this cannot be a system's name", help));
    }
    Ok(document.name.clone())
}

fn checked_states(document: &Document) -> Result<Vec<State>, Problem> {
    if document.states.is_empty() || document.states.len() > MAX_STATES {
        let message = format!("{} states; a system has 1 to {MAX_STATES}", document.states.len());
        return Err(Problem::new(Place::key("states"), message, None));
    }
    Ok(document
        .states
        .iter()
        .map(|s| State { name: s.name.clone(), about: s.about.clone() })
        .collect())
}

/// All names, each sound and given once.
fn checked_names(document: &Document) -> Result<Vec<&str>, Problem> {
    for (key, count) in
        [("parameters", document.parameters.0.len()), ("let", document.terms.0.len())]
    {
        if count > MAX_NAMES {
            return Err(Problem::new(
                Place::key(key),
                format!("{count} entries; the limit is {MAX_NAMES}"),
                None,
            ));
        }
    }
    let states = document
        .states
        .iter()
        .enumerate()
        .map(|(i, s)| (Place::item("states", i), s.name.as_str()));
    let parameters =
        document.parameters.0.iter().map(|(n, _)| (Place::entry("parameters", n), n.as_str()));
    let terms = document.terms.0.iter().map(|(n, _)| (Place::entry("let", n), n.as_str()));
    let mut names: Vec<(Place, &str)> = Vec::new();
    for (place, name) in states.chain(parameters).chain(terms) {
        let problem = |message: String, help: &str| {
            Err(Problem::new(place.clone(), message, Some(help.into())))
        };
        if !is_name(name) || name.len() > 64 {
            return problem(
                format!("{name:?} cannot be a name"),
                "a letter, then letters, digits and _, at most 64",
            );
        }
        if is_reserved(name) {
            return problem(
                format!("`{name}` has a meaning of its own in expressions"),
                "choose another name",
            );
        }
        if let Some((first, _)) = names.iter().find(|(_, n)| *n == name) {
            return problem(
                format!("`{name}` is already in {}", first.key),
                "give every state, parameter and term its own name",
            );
        }
        names.push((place, name));
    }
    Ok(names.into_iter().map(|(_, n)| n).collect())
}

fn checked_axes(document: &Document, states: &[State]) -> Result<Vec<usize>, Problem> {
    if document.axes.len() > 3 {
        return Err(Problem::new(Place::key("axes"), "a picture has at most three axes", None));
    }
    let names: Vec<&str> = states.iter().map(|s| s.name.as_str()).collect();
    let index = |(i, axis): (usize, &String)| {
        names.iter().position(|n| n == axis).ok_or_else(|| {
            let help = nearest(axis, &names)
                .map_or(format!("states are {}", names.join(", ")), |near| {
                    format!("did you mean `{near}`?")
                });
            Problem::new(Place::item("axes", i), format!("there is no state `{axis}`"), Some(help))
        })
    };
    document.axes.iter().enumerate().map(index).collect()
}

fn wrong_count(key: &'static str, count: usize, states: &[State]) -> Problem {
    let dimension = states.len();
    let names: Vec<&str> = states.iter().map(|s| s.name.as_str()).collect();
    let plural = |n: usize| if n == 1 { "" } else { "s" };
    let message = format!(
        "{key} has {count} component{}, but there {} {dimension} state{}",
        plural(count),
        if dimension == 1 { "is" } else { "are" },
        plural(dimension)
    );
    let help = if count < dimension {
        format!("missing: {}", names[count..].join(", "))
    } else {
        format!("one for each of {}", names.join(", "))
    };
    Problem::new(Place::key(key), message, Some(help))
}

/// The terms in an order in which each comes after those that it names; else as they were listed.
fn in_order(terms: Vec<(String, Expression)>) -> Result<Vec<(String, Expression)>, Problem> {
    let mut left = terms;
    let mut ordered: Vec<(String, Expression)> = Vec::new();
    while !left.is_empty() {
        let free = |(_, term): &&(String, Expression)| {
            !term.names().iter().any(|n| left.iter().any(|(other, _)| other == n))
        };
        let Some(at) = left.iter().position(|entry| free(&entry)) else {
            let (name, term) = &left[0];
            let others = term
                .names()
                .into_iter()
                .filter(|n| left.iter().any(|(other, _)| other == n))
                .collect::<Vec<_>>();
            let message = format!("`{name}` depends on itself, through `{}`", others.join("`, `"));
            return Err(Problem::new(
                Place::entry("let", name),
                message,
                Some("terms are computed one after another".into()),
            ));
        };
        ordered.push(left.remove(at));
    }
    Ok(ordered)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::System;

    /// A file, the same in another order and with other texts, and what is kept of it are one
    /// system.
    #[test]
    fn order_and_texts_of_a_file_make_no_other_system() {
        let read = |title: &str, [a, b, c, d]: [&str; 4]| {
            let text = format!(
                "title = '{title}'\nstates = ['x', 'v']\nh = 'x'\nplus = ['p*v', 's + t']\nminus = \
                    ['v', 's + t + 1']\n\
                 [let]\n{a}\n{b}\n[parameters]\n{c}\n{d}"
            );
            System::new(Definition::from_toml(&text, "").unwrap())
        };
        let one = read("One", ["t = 'p*x*v'", "s = 'q*v*v'", "q = 2", "p = 3"]);
        let other = read("The same", ["s = 'q*v*v'", "t = 'p*x*v'", "p = 3", "q = 2"]);
        let kept: System = serde_json::from_str(&serde_json::to_string(&one).unwrap()).unwrap();
        assert_eq!([&other, &kept], [&one, &one]);
        assert_ne!(read("One", ["t = 'p*x*v'", "s = 'q*v*v'", "q = 3", "p = 2"]), one);
        assert_ne!(read("One", ["t = 'p*v*x'", "s = 'q*v*v'", "q = 2", "p = 3"]), one);
    }

    const GOOD: &str = r#"name = "block"
states = ["x", { name = "v", meaning = "speed" }]
start = [0, 0.5]
axes = ["v"]
h = "slip"
plus = ["v", "a*slip - x - 1"]
minus = ["v", "a*slip - x + 1"]

[parameters]
a = { value = 0.2, unit = "1/s", below = 1 }
belt = 0.3

[let]
twice = "2*slip"
slip = "v - belt"
"#;

    #[test]
    fn what_is_read() {
        let d = Definition::from_toml(GOOD, "block.toml").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!((d.name(), d.title(), d.dimension()), ("block", "block", 2));
        assert_eq!(d.states()[1].about.meaning, "speed");
        assert_eq!((d.start(), d.axes()), (Some([0.0, 0.5].as_slice()), [1].as_slice()));
        assert_eq!(d.parameters()[0].about.unit, "1/s");
        // Terms may stand in any order.
        assert_eq!(d.plus()[1].to_string(), "a*slip - x - 1");
        assert_eq!(d.switching_states(), [1]);
    }

    #[test]
    fn toml_and_json_come_back() {
        for text in
            [GOOD].into_iter().chain(crate::library::names().filter_map(crate::library::text))
        {
            let d = Definition::from_toml(text, "f").unwrap();
            assert_eq!(
                Definition::from_toml(&d.to_toml(), "f").unwrap_or_else(|e| panic!("{e}")),
                d
            );
            let json = serde_json::to_string(&d).unwrap();
            assert_eq!(serde_json::from_str::<Definition>(&json).unwrap(), d);
        }
    }

    #[test]
    fn the_canonical_form_leaves_texts_out_and_spaces() {
        let canonical =
            |text: &str| System::new(Definition::from_toml(text, "f").unwrap()).canonical();
        let other = GOOD
            .replace("block", "other")
            .replace(", meaning = \"speed\"", "")
            .replace("start = [0, 0.5]\n", "title = \"A title\"\n")
            .replace("a*slip - x - 1", "  a * (slip)-x -1.0 ")
            .replace(
                "[parameters]\na = { value = 0.2, unit = \"1/s\", below = 1 }\nbelt = 0.3",
                "[parameters]\nbelt = 0.3\na = 0.2",
            );
        assert_eq!(canonical(&other), canonical(GOOD));
        assert_ne!(canonical(&GOOD.replace("belt = 0.3", "belt = 0.31")), canonical(GOOD));
        assert_ne!(canonical(&GOOD.replace("x - 1", "x - 2")), canonical(GOOD));
    }

    const TWO: &str = r#"states = ["x", "y"]
h = "x"
plus = ["1", "2"]
minus = ["3", "4"]

[second]
h = "y"
plus = ["5", "6"]
minus = ["7", "8 + a"]

[parameters]
a = 0
"#;

    #[test]
    fn a_second_surface_makes_four_faces() {
        let d = Definition::from_toml(TWO, "two.toml").unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(Definition::from_toml(&d.to_toml(), "f").unwrap_or_else(|e| panic!("{e}")), d);
        let json = serde_json::to_string(&d).unwrap();
        assert_eq!(serde_json::from_str::<Definition>(&json).unwrap(), d);
        let said = |surface, below| {
            let face = d.face(surface, below).unwrap();
            assert!(face.second().is_none());
            format!("{} {} {}", face.switching(), face.plus()[0], face.minus()[0])
        };
        assert_eq!(
            [said(0, false), said(0, true), said(1, false), said(1, true)],
            ["x 1 3", "x 5 7", "y 1 5", "y 3 7"]
        );
        assert_eq!(d.tape(&[0.0.into()]).outputs().len(), 10);
        for (from, to, place, message) in [
            ("8 + a", "8 + b", "9:20", "unknown name `b`"),
            (
                "[\"5\", \"6\"]",
                "[\"5\"]",
                "8:8",
                "second.plus has 1 component, but there are 2 states",
            ),
            ("h = \"y\"", "h = \"a\"", "7:5", "nothing ever switches at it"),
            ("h = \"y\"", "h = \"x\"", "7:5", "both surfaces are the same"),
            ("[second]\nh = \"y\"", "[second]", "6:1", "missing field `h`"),
        ] {
            let error = Definition::from_toml(&TWO.replacen(from, to, 1), "f").expect_err(to);
            assert_eq!(format!("{}:{}", error.line, error.column), place, "{error}");
            assert!(error.message.contains(message), "{error}");
        }
        assert!(Definition::from_toml(GOOD, "f").unwrap().face(0, false).is_none());
    }

    /// (changed, into, place, message, help)
    const WRONG: [(&str, &str, &str, &str, &str); 26] = [
        ("value = 0.2", "value = 1", "10:1", "`a` is 1, and its values are below 1", ""),
        ("a*slip - x - 1", "a*slpi - x - 1", "6:17", "unknown name `slpi`", "did you mean `slip`?"),
        ("a*slip - x + 1", "a*slip - x + 1)", "7:30", "never opened", ""),
        ("h = \"slip\"", "h = \"\"", "5:5", "empty", ""),
        (
            "\"v\", \"a*slip - x - 1\"",
            "\"v\"",
            "6:8",
            "plus has 1 component, but there are 2 states",
            "missing: v",
        ),
        (
            "\"v\", \"a*slip - x + 1\"",
            "\"v\", \"1\", \"2\"",
            "7:9",
            "minus has 3 components",
            "one for each of x, v",
        ),
        ("start = [0, 0.5]", "start = [0]", "3:9", "start has 1 component", "missing: v"),
        ("axes = [\"v\"]", "axes = [\"x\", \"w\"]", "4:14", "no state `w`", "states are x, v"),
        ("minus =", "mnius =", "7:1", "unknown field `mnius`", "did you mean `minus`?"),
        ("h = \"slip\"\n", "", "1:1", "missing field `h`", "f+ holds where it is positive"),
        ("belt = 0.3", "belt = \"0.3x\"", "11:8", "not a decimal number", ""),
        ("belt = 0.3", "belt = inf", "11:8", "finite", ""),
        ("belt = 0.3", "x = 0.3", "11:1", "`x` is already in states", ""),
        ("belt = 0.3", "belt = 0.3\nbelt = 0.4", "12:1", "duplicate key", ""),
        ("belt = 0.3", "sin = 0.3", "11:1", "meaning of its own", ""),
        ("belt = 0.3", "\"1x\" = 0.3", "11:1", "cannot be a name", ""),
        ("v - belt", "v - belt + twice", "14:1", "`twice` depends on itself, through `slip`", ""),
        ("value = 0.2", "valeu = 0.2", "10:7", "unknown field `valeu`", "did you mean `value`?"),
        ("name = \"block\"", "name = \"a/b\"", "1:8", "system's name", ""),
        ("[let]", "[let", "13:5", "", ""),
        ("h = \"slip\"", "h = \"a\"", "5:5", "nothing ever switches", "for example"),
        ("h = \"slip\"", "h = 3", "5:5", "expected a string", ""),
        ("states = [\"x\", ", "states = [3, ", "2:11", "a state's name", ""),
        ("slip = \"v - belt\"", "slip = \"v - belt + v^a\"", "15:22", "whole number", ""),
        ("slip = \"v - belt\"", "slip = 'v - '", "15:13", "ends where", ""),
        (
            "slip = \"v - belt\"",
            "slip = \"\"\"\n  v -\n  blet\"\"\"",
            "17:3",
            "unknown name `blet`",
            "`belt`",
        ),
    ];

    #[test]
    fn errors_point_into_the_file() {
        let mut wrong = Vec::new();
        for (from, to, place, message, help) in WRONG {
            assert!(GOOD.contains(from), "{from}");
            let error = Definition::from_toml(&GOOD.replacen(from, to, 1), "f").expect_err(to);
            let found = format!("{}:{}", error.line, error.column) == place
                && error.message.contains(message)
                && error.help.clone().unwrap_or_default().contains(help);
            if !found {
                wrong.push(format!("{error}\nexpected {place}, {message}, {help}"));
            }
        }
        assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
    }

    #[test]
    fn errors_in_json_name_the_place() {
        let json = serde_json::to_string(&Definition::from_toml(GOOD, "f").unwrap()).unwrap();
        let error =
            serde_json::from_str::<Definition>(&json.replace("a*slip - x + 1", "a*slip - x + y"))
                .unwrap_err();
        assert!(error.to_string().contains("minus[2]:1:14"), "{error}");
    }

    #[test]
    fn long_files_and_many_names_are_refused() {
        let long = format!("{GOOD}# {}", "x".repeat(MAX_FILE));
        assert!(Definition::from_toml(&long, "f").unwrap_err().message.contains("limit"));
        let many: String = (0..=MAX_NAMES).map(|i| format!("t{i} = \"x\"\n")).collect();
        assert!(
            Definition::from_toml(&format!("{GOOD}{many}"), "f")
                .unwrap_err()
                .message
                .contains("limit")
        );
        // Terms that double in size are shared, not multiplied out.
        let doubling: String =
            (1..90).map(|i| format!("t{i} = \"t{} + t{}\"\n", i - 1, i - 1)).collect();
        let text = GOOD.replace("a*slip - x - 1", "t89") + "t0 = \"x*v\"\n" + &doubling;
        let system = System::new(Definition::from_toml(&text, "f").unwrap());
        assert!(system.tape().operations().len() < 120);
        let deep = GOOD.replace("a*slip - x - 1", &"[".repeat(5000));
        assert!(Definition::from_toml(&deep, "f").is_err());
    }
}
