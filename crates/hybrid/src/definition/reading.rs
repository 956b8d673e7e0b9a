//! A definition from what its file holds, key by key, with the place of what is wrong.

use std::collections::{BTreeMap, HashSet};
use std::ops::Range;

use twofold_system::expression::{ExpressionError, is_name, is_reserved_in_general};

use super::*;
use crate::value::evaluate;

impl Definition {
    pub(crate) fn from_document(document: Document) -> Result<Self, Problem> {
        limits(&document)?;
        let all = names(&document)?;
        let conditions = conditions(&document, &all);
        let mut reader = Reader { d: &document, all, conditions, values: BTreeMap::new() };
        let parameters = reader.parameters()?;
        let terms = reader.terms()?;
        let modes = reader.modes()?;
        let mut events: Vec<Event> = Vec::new();
        for i in 0..document.event.len() {
            let event = reader.event(i, &modes, &terms)?;
            if events.iter().any(|other| other.name == event.name) {
                let message = format!("the name `{}` is given to two events", event.name);
                let help = "tables and `stopped by` tell events by their names: give each its own";
                let place = inside(&item(&key("event"), i), "name");
                return problem(place, message, Some(help));
            }
            events.push(event);
        }
        let start = reader.start()?;
        let axes = reader.axes()?;
        files_of_tables(&document)?;
        let state = |s: &StateEntry| State { name: s.name.clone(), about: s.about.clone() };
        let states = document.states.iter().map(state).collect();
        let tables = document.tables.0.clone();
        Ok(Self { states, parameters, start, axes, terms, modes, events, tables, document })
    }
}

/// Refuses a file that defines more than a system may.
fn limits(d: &Document) -> Result<(), Problem> {
    let sound = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
    if d.name.len() > 64 || !d.name.chars().all(sound) {
        let help = "letters, digits, - and _, at most 64";
        return problem(key("name"), "this cannot be a system's name", Some(help));
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
    match counts.iter().find(|(_, count)| *count > MAX_NAMES) {
        Some((name, count)) => {
            problem(key(name), format!("{count} entries; the limit is {MAX_NAMES}"), None)
        }
        None => Ok(()),
    }
}

fn files_of_tables(d: &Document) -> Result<(), Problem> {
    for (name, table) in &d.tables.0 {
        let place = inside(&inside(&key("tables"), name), "file");
        let file = std::path::Path::new(&table.file);
        let plain = file.components().count() == 1
            && file.file_name().is_some_and(|f| f == file.as_os_str());
        if !plain {
            let message = "a table's file stands beside the system's, without folders";
            return problem(place, message, None);
        }
    }
    Ok(())
}

/// A file whose expressions are being read, and its names.
struct Reader<'a> {
    d: &'a Document,
    /// The names that expressions may use.
    all: Vec<&'a str>,
    /// Those of `[let]` that stand for conditions.
    conditions: Vec<&'a str>,
    /// The parameters' values, as far as they are read.
    values: BTreeMap<String, f64>,
}

impl<'a> Reader<'a> {
    /// An expression that may use these names.
    fn parse(&self, place: Place, text: &str, known: &[&str]) -> Result<Expression, Problem> {
        let parsed = Expression::parse_general_with(text, known, &self.conditions);
        let checked = parsed.and_then(|parsed| match wrong_constants(&parsed, text) {
            Some(error) => Err(error),
            None => Ok(parsed),
        });
        checked.map_err(|mut error| {
            let (before, from) = text.split_at(error.span.start.min(text.len()));
            let tables = self.d.tables.0.iter().map(|(name, _)| name);
            let mut called = tables.filter(|name| before.ends_with(*name));
            if from.starts_with('(')
                && let Some(name) = called.next()
            {
                error.message = format!("{name} is a table, and no function");
                error.help = Some(format!("write {name} alone: that is its value at t"));
            }
            let within = Some((text.to_owned(), error.span));
            Problem { place, within, message: error.message, help: error.help }
        })
    }

    /// An expression of parameters and numbers.
    fn parse_constant(&self, place: Place, text: &Constant) -> Result<Expression, Problem> {
        let known: Vec<&str> = self.d.parameters.0.iter().map(|(name, _)| name.as_str()).collect();
        self.parse(place, &text.text(), &known)
    }

    fn value(&self, e: &Expression) -> f64 {
        evaluate(e, &|name| self.values.get(name).copied())
    }

    /// One expression a state.
    fn field(&self, place: Place, texts: &[Constant]) -> Result<Vec<Expression>, Problem> {
        let n = self.d.states.len();
        if texts.len() != n {
            let names: Vec<&str> = self.d.states.iter().map(|s| s.name.as_str()).collect();
            let message =
                format!("{} expressions for {n} states ({})", texts.len(), names.join(", "));
            return problem(place, message, Some("give one for each state, in their order"));
        }
        let read = |(i, c): (usize, &Constant)| self.parse(item(&place, i), &c.text(), &self.all);
        texts.iter().enumerate().map(read).collect()
    }

    fn parameters(&mut self) -> Result<Vec<Parameter>, Problem> {
        let d = self.d;
        let mut parameters: Vec<Parameter> = Vec::new();
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
            let read = self.parse(place.clone(), &value.text(), &known);
            let value = read.map_err(|mut problem| {
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
                let message = "a parameter does not depend on the time";
                return problem(place, message, Some("put it into [let]"));
            }
            let number = self.value(&value);
            if !number.is_finite() {
                let message = format!("`{name}` is {number}");
                return problem(place, message, Some("give a value that is a finite number"));
            }
            self.values.insert(name.clone(), number);
            parameters.push(Parameter { name: name.clone(), value, about, bounds });
        }
        Ok(parameters)
    }

    fn terms(&self) -> Result<Vec<(String, Expression)>, Problem> {
        let read = |(name, text): &(String, Constant)| {
            let parsed = self.parse(inside(&key("let"), name), &text.text(), &self.all)?;
            Ok((name.clone(), parsed))
        };
        in_order(self.d.terms.0.iter().map(read).collect::<Result<_, _>>()?)
    }

    /// The equations in each mode; f alone, or h with its two fields, is one without a name.
    fn modes(&self) -> Result<Vec<Mode>, Problem> {
        let d = self.d;
        let only = |field| vec![Mode { name: String::new(), field }];
        let modes = match (&d.f, &d.h, d.modes.0.is_empty()) {
            (Some(f), None, true) => only(self.field(key("f"), f)?),
            (None, Some(h), true) => only(self.field_by_side(h)?),
            (None, None, false) => {
                let mode = |(name, mode): &(String, ModeEntry)| {
                    let place = inside(&inside(&key("modes"), name), "f");
                    Ok(Mode { name: name.clone(), field: self.field(place, &mode.f)? })
                };
                d.modes.0.iter().map(mode).collect::<Result<_, _>>()?
            }
            (None, None, true) => {
                let help = "give f, one expression a state: f = [\"-x\"]";
                return problem(key("states"), "there are no equations", Some(help));
            }
            _ => {
                let place = key(if d.h.is_some() { "h" } else { "modes" });
                let help = "give one of f, h with plus and minus, or modes";
                return problem(place, "the equations are given twice", Some(help));
            }
        };
        if d.h.is_none() && (d.plus.is_some() || d.minus.is_some()) {
            return problem(key("plus"), "`plus` and `minus` need the switching function h", None);
        }
        Ok(modes)
    }

    /// One field where h is positive and another where it is not.
    fn field_by_side(&self, h: &str) -> Result<Vec<Expression>, Problem> {
        let h = self.parse(key("h"), h, &self.all)?;
        let (Some(plus), Some(minus)) = (&self.d.plus, &self.d.minus) else {
            return problem(key("h"), "h needs both `plus` and `minus`", None);
        };
        let (plus, minus) = (self.field(key("plus"), plus)?, self.field(key("minus"), minus)?);
        let choose = |(a, b)| {
            let zero = Box::new(Expression::Number(0.0.into()));
            let condition = Expression::Greater(Box::new(h.clone()), zero);
            Expression::Apply(General::If, vec![condition, a, b])
        };
        Ok(plus.into_iter().zip(minus).map(choose).collect())
    }

    /// The mode of a name, if one is given.
    fn mode(
        &self,
        place: Place,
        name: &Option<String>,
        modes: &[Mode],
    ) -> Result<Option<usize>, Problem> {
        let Some(name) = name else { return Ok(None) };
        let known: Vec<&str> = modes.iter().map(|m| m.name.as_str()).collect();
        if let Some(i) = known.iter().position(|n| n == name && !n.is_empty()) {
            return Ok(Some(i));
        }
        let help = match nearest(name, &known) {
            Some(near) => format!("did you mean `{near}`?"),
            None if known.iter().all(|name| name.is_empty()) => {
                "it has no modes: write [modes.NAME] with its f".into()
            }
            None => format!("modes are {}", known.join(", ")),
        };
        problem(place, format!("there is no mode `{name}`"), Some(&help))
    }

    /// The event at a place of the file's list.
    fn event(
        &self,
        i: usize,
        modes: &[Mode],
        terms: &[(String, Expression)],
    ) -> Result<Event, Problem> {
        let (entry, place) = (&self.d.event[i], item(&key("event"), i));
        let when = match (&entry.when, &entry.at, &entry.every) {
            (Some(text), None, None) => self.when(entry, &place, text, terms)?,
            (None, Some(times), None) => self.at(inside(&place, "at"), times)?,
            (None, None, Some(period)) => {
                let at = inside(&place, "every");
                let read = self.parse_constant(at.clone(), period)?;
                let period = self.value(&read);
                if !(period.is_finite() && period > 0.0) {
                    let message = format!("`every` is {period}");
                    return problem(at, message, Some("give a time above 0"));
                }
                When::Every(read)
            }
            (None, None, None) => {
                let message = "it is not said when the event fires";
                return problem(place, message, Some("give when, at or every"));
            }
            _ => {
                let message = "an event has one of when, at and every";
                return problem(place, message, Some("write one [[event]] for each"));
            }
        };
        if entry.direction.is_some() && entry.when.is_none() {
            return problem(inside(&place, "direction"), "`direction` belongs to `when`", None);
        }
        let mut set = Vec::new();
        for (name, value) in entry.set.iter().flat_map(|s| &s.0) {
            let at = inside(&inside(&place, "set"), name);
            let Some(state) = self.d.states.iter().position(|s| s.name == *name) else {
                let known: Vec<&str> = self.d.states.iter().map(|s| s.name.as_str()).collect();
                let help = match nearest(name, &known) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("states are {}", known.join(", ")),
                };
                return problem(at, format!("there is no state `{name}` to set"), Some(&help));
            };
            set.push((state, self.parse(at, &value.text(), &self.all)?));
        }
        let mode = self.mode(inside(&place, "mode"), &entry.mode, modes)?;
        let from = self.mode(inside(&place, "from"), &entry.from, modes)?;
        let sticks = entry.after_zeno == Some(AfterZeno::Stick);
        if sticks && (set.is_empty() || !matches!(when, When::Zero(..))) {
            let message = "only an event that sets speeds where an expression is zero can stick";
            let help = "give when = \"x\" (its zero is the surface) and set = { v = \"-r*v\" }; \
                where two bodies strike each other, the speeds of both";
            return problem(inside(&place, "after_zeno"), message, Some(help));
        }
        let name =
            if entry.name.is_empty() { format!("event {}", i + 1) } else { entry.name.clone() };
        Ok(Event { name, when, set, mode, from, stop: entry.stop, sticks })
    }

    /// An event that fires by an expression: at its zeros, or as a condition becomes true.
    fn when(
        &self,
        entry: &EventEntry,
        place: &Place,
        text: &str,
        terms: &[(String, Expression)],
    ) -> Result<When, Problem> {
        let at = inside(place, "when");
        let parsed =
            self.parse(at.clone(), text, &self.all).map_err(|problem| met(text, problem))?;
        let named = matches!(&parsed, Expression::Name(name)
            if self.conditions.contains(&name.as_str()));
        if !moves(&parsed, self.d, terms) {
            let help = "name a state or t, or give the times of the event by at = [1]";
            let message = "this does not change, and so never passes zero or becomes true";
            return problem(at, message, Some(help));
        }
        if !parsed.is_condition() && !named {
            return Ok(When::Zero(parsed, entry.direction.unwrap_or_default()));
        }
        if entry.direction.is_some() {
            let help = "leave direction out, or give an expression whose zero is met";
            let message = "a condition fires when it becomes true";
            return problem(inside(place, "direction"), message, Some(help));
        }
        Ok(When::Becomes(parsed))
    }

    /// An event that fires at known times.
    fn at(&self, at: Place, times: &Constants) -> Result<When, Problem> {
        let times = match times {
            Constants::One(one) => std::slice::from_ref(one),
            Constants::List(list) => list,
        };
        let listed = |mut problem: Problem| {
            if problem.within.as_ref().is_some_and(|(text, _)| text.contains(',')) {
                problem.help = Some("several times are a list: at = [1, 2]".into());
            }
            problem
        };
        let read = times.iter().map(|time| self.parse_constant(at.clone(), time));
        let read: Vec<Expression> = read.collect::<Result<_, _>>().map_err(listed)?;
        if read.is_empty() {
            return problem(at, "`at` names no time", Some("give one time or more"));
        }
        let moments: Vec<f64> = read.iter().map(|e| self.value(e)).collect();
        for (k, time) in moments.iter().enumerate() {
            if !time.is_finite() {
                return problem(at, format!("`at` is {time}"), Some("give a finite time"));
            }
            if moments[..k].contains(time) {
                let message = format!("the time {time} stands twice");
                let help = "an event fires once at a time: give each time once";
                return problem(at, message, Some(help));
            }
        }
        Ok(When::At(read))
    }

    fn start(&self) -> Result<Option<Vec<Expression>>, Problem> {
        let Some(start) = &self.d.start else { return Ok(None) };
        if start.len() != self.d.states.len() {
            let message = format!("{} numbers for {} states", start.len(), self.d.states.len());
            let help = "give one for each state, in their order";
            return problem(key("start"), message, Some(help));
        }
        let read = |(i, c)| self.parse_constant(item(&key("start"), i), c);
        start.iter().enumerate().map(read).collect::<Result<_, _>>().map(Some)
    }

    fn axes(&self) -> Result<Vec<usize>, Problem> {
        let place = |(i, axis): (usize, &String)| {
            self.d.states.iter().position(|s| s.name == *axis).map_or_else(
                || problem(item(&key("axes"), i), format!("there is no state `{axis}`"), None),
                Ok,
            )
        };
        self.d.axes.iter().enumerate().map(place).collect()
    }
}

/// Columns of a recorded table beside the time and the states.
const COLUMNS_OF_WORDS: [&str; 4] = ["mode", "signs", "direction", "event"];

/// All names that expressions may use, each sound and given once.
fn names(d: &Document) -> Result<Vec<&str>, Problem> {
    let states =
        d.states.iter().enumerate().map(|(i, s)| (item(&key("states"), i), s.name.as_str()));
    let under = |table: &'static str| move |n: &'_ str| inside(&key(table), n);
    let (of_parameters, of_terms, of_tables) = (under("parameters"), under("let"), under("tables"));
    let parameters = d.parameters.0.iter().map(|(n, _)| (of_parameters(n), n.as_str()));
    let terms = d.terms.0.iter().map(|(n, _)| (of_terms(n), n.as_str()));
    let tables = d.tables.0.iter().map(|(n, _)| (of_tables(n), n.as_str()));
    let mut names: Vec<&str> = Vec::new();
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
        if names.contains(&name) {
            let message = format!("the name `{name}` is given twice");
            return problem(
                place,
                message,
                Some("give every state, parameter, term and table its own name"),
            );
        }
        names.push(name);
    }
    Ok(names)
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

/// Advice for a value of another kind than its key wants, by the line that it stands on.
pub(super) fn remedy(text: &str, span: Range<usize>) -> Option<String> {
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
