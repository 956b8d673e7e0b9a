//! Switching functions found in plain equations.
//!
//! Every `sign`, `abs`, `min`, `max`, `if`, `heaviside`, `clip` and comparison asks on which side
//! of zero some expression is; `floor` and `mod` ask between which whole numbers. These expressions
//! are the system's switching functions. For fixed answers (a [`Configuration`]) the equations are
//! smooth, and that is what is written on a [`Tape`] and evaluated: only the branches that hold are
//! computed.

use std::borrow::Cow;
use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap, HashSet};
use std::rc::Rc;

use twofold_num::random::RandomStream;
use twofold_num::tape::{Program, Recorded, Replay};
use twofold_num::{Arithmetic, Decimal, Dual, Elementary, Scalar, Tape};
use twofold_system::Expression;
use twofold_system::expression::{Function, General, MAX_EXPONENT};

use crate::data::Table;
use crate::definition::{Definition, Direction, When, asks};
use crate::model::{Model, ModelError};
use crate::value::{evaluate, power, smooth};

/// A switching function.
#[derive(Clone, Debug, PartialEq)]
pub struct Guard {
    /// The expression whose sign, or whose whole part, is asked for.
    pub expression: Expression,
    /// Whether the whole part is asked for.
    pub whole: bool,
    /// Whether it chooses between expressions; otherwise its answer is a number in one.
    chooses: bool,
    /// Whether the equations are continuous where it is zero: it is asked by `abs`, `min`, `max`
    /// and `clip` alone, in sums, products and smooth functions.
    pub kink: bool,
    /// Whether nothing moves it but the sides of others.
    pub(crate) fixed: bool,
    /// Whether it is a kink or a whole part that only the sides of others move: that of
    /// clip(sign(x), 0, 1) is no surface, nor is floor(floor(t)/2).
    pub(crate) of_sides: bool,
}

/// The answers to all switching functions, the mode, and the pieces of tables that hold.
#[derive(Clone, Debug, PartialEq)]
pub struct Configuration {
    /// The mode's number.
    pub mode: usize,
    /// For each guard -1 or +1, 0 if it rests at zero; of whole parts a whole number.
    pub sides: Vec<f64>,
    /// For each table the piece.
    pub pieces: Vec<usize>,
    /// The guards whose zero is slid upon, if the equations have roots.
    pub(crate) slid: Vec<usize>,
    /// The states that rest, whatever else moves.
    pub(crate) still: Vec<usize>,
    /// The guards that are slid upon in higher order: on their zero and that of their derivatives
    /// along the motion which the sides of the guard do not change (Levant 1993).
    pub(crate) higher: Vec<usize>,
}

/// The equations for one structure of answers, ready for evaluation. Variables: states, time,
/// answers, then for each table its knot and coefficients.
#[derive(Debug)]
pub struct Compiled {
    /// The derivatives.
    pub field: Program,
    /// The guards that matter ([`Compiled::active`]), then every watched expression.
    pub watched: Program,
    /// The guards that the equations ask in this structure.
    pub active: Vec<usize>,
    /// Those among them that the field asks, by itself or through others; the rest are asked by
    /// events alone.
    pub deciding: Vec<usize>,
    /// Number of values of `watched`.
    pub outputs: usize,
    /// The place of each guard among the active ones.
    place: Vec<Option<usize>>,
    /// Bit sets of the variables that each value depends on: derivatives, then watched values.
    depends: Vec<Vec<u64>>,
    /// The states and the time that each watched value depends on, and for each of those variables
    /// a colour: no value depends on two of one colour, so that one derivative a colour gives all
    /// gradients (Curtis, Powell & Reid 1974).
    pub(crate) touches: Vec<Vec<usize>>,
    colours: Vec<usize>,
    /// Watched values that are sums of variables with constant factors.
    pub(crate) affine: Vec<Option<Affine>>,
    /// Whether there are others.
    pub(crate) is_curved: bool,
    /// Functions that can be flat where a step evaluates them and steep elsewhere, and the program
    /// of their arguments.
    pub(crate) gates: Vec<Gate>,
    pub(crate) gate_arguments: Program,
    /// The same of the watched values.
    pub(crate) watched_gates: Vec<Gate>,
    pub(crate) watched_gate_arguments: Program,
    /// Of each guard in [`Configuration::higher`] its value and its derivatives along the motion
    /// up to the one that stands among the active ones for it, and their number; none where the
    /// first derivative depends on its side.
    pub(crate) derivatives: Vec<Option<(Program, usize)>>,
    pub(crate) tape: Tape,
}

/// A system's equations with its switching functions.
#[derive(Debug)]
pub struct Equation {
    pub(crate) definition: Definition,
    values: BTreeMap<String, f64>,
    /// The switching functions, each once.
    pub guards: Vec<Guard>,
    /// The first of the guards that the conditions of events alone ask.
    of_fields: usize,
    /// For each event its condition as the guards are made from it: what parameters decide are
    /// numbers. The definition's own asks for guards that there are none of.
    pub(crate) conditions: Vec<Option<Rc<Expression>>>,
    /// For each event the guards that its condition asks.
    pub(crate) of_events: Vec<Vec<usize>>,
    /// Whether any equation has a root, a logarithm or a division.
    pub(crate) has_domain_ends: bool,
    by_text: HashMap<String, (usize, bool)>,
    /// The tables' data.
    pub tables: Vec<Table>,
    /// Expressions whose zeros are looked for: events', then a section's.
    pub watched: Vec<Expression>,
    /// For each event its new values as a program, where no switching function decides them.
    pub(crate) resets: Vec<Option<Program>>,
    known: RefCell<HashMap<Vec<i8>, Rc<Compiled>>>,
}

/// Why an equation cannot be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EquationError {
    /// Wrong parameters or data.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// A name in the place of a condition is none.
    #[error(
        "`{0}` stands where a condition is wanted, and is a number: compare it with something, \
            such as {0} > 0"
    )]
    NoCondition(String),
    /// The ends of a `clip` are exchanged, by the values of parameters.
    #[error(
        "the lower end of {0} is {1} here, above its upper end {2}: write clip(x, low, high), or \
            give the parameters other values"
    )]
    Clip(String, f64, f64),
    /// A `mod` by a parameter that is zero.
    #[error("{0} is by 0 here, and has no value: give the parameter another value")]
    Mod(String),
}

/// The same function with the other sign, as it would be written.
fn mirrored(e: &Expression) -> Expression {
    match e {
        Expression::Sub(a, b) => Expression::Sub(b.clone(), a.clone()),
        Expression::Neg(a) => (**a).clone(),
        other => Expression::Neg(Box::new(other.clone())),
    }
}

/// An expression over a divisor.
struct Fraction {
    above: Expression,
    /// The factors of the divisor that change their sign.
    below: Option<Expression>,
    /// All of it.
    full: Option<Expression>,
}

fn product(a: Expression, b: Option<Expression>) -> Expression {
    match b {
        Some(b) => Expression::Mul(Box::new(a), Box::new(b)),
        None => a,
    }
}

/// The product of what there is.
fn both(a: Option<Expression>, b: Option<Expression>) -> Option<Expression> {
    match (a, b) {
        (Some(a), b) => Some(product(a, b)),
        (None, b) => b,
    }
}

/// Whether an expression has a root, a power that is none of a whole number, a logarithm or a
/// division.
fn has_domain_ends(e: &Expression) -> bool {
    let itself = match e {
        Expression::Div(..) | Expression::RealPower(..) => true,
        Expression::Power(_, exponent) => *exponent < 0,
        Expression::Call(Function::Sqrt | Function::Ln | Function::Tan, _) => true,
        Expression::Apply(
            General::Asin | General::Acos | General::Log | General::Log10 | General::Atan2,
            _,
        ) => true,
        _ => false,
    };
    itself || e.parts().into_iter().any(has_domain_ends)
}

fn is_zero(e: &Expression) -> bool {
    matches!(e, Expression::Number(n) if n.value() == 0.0)
}

/// a - b without needless parts.
fn difference(a: &Expression, b: &Expression) -> Expression {
    match (a, b) {
        (a, b) if is_zero(b) => a.clone(),
        (a, b) if is_zero(a) => mirrored(b),
        (a, Expression::Neg(b)) => Expression::Add(Box::new(a.clone()), b.clone()),
        (a, b) => Expression::Sub(Box::new(a.clone()), Box::new(b.clone())),
    }
}

impl Equation {
    /// Finds the switching functions of a system; `section` is watched beside its events.
    ///
    /// # Errors
    /// If the model is not complete, or a condition is none.
    pub fn new(model: &Model, section: Option<&Expression>) -> Result<Self, EquationError> {
        let (mut definition, values) = (model.definition().clone(), model.values()?);
        let value = |e: &Expression| {
            let known = e.names().into_iter().all(|name| values.contains_key(name)) && !asks(e);
            known.then(|| evaluate(e, &|name| values.get(name).copied()))
        };
        // Parameters decide powers with a whole exponent, and kinks of constants.
        let decided = |e: Expression| match &e {
            Expression::RealPower(base, exponent) => match value(exponent) {
                Some(n) if n.fract() == 0.0 && n.abs() <= f64::from(MAX_EXPONENT) => {
                    Expression::Power(base.clone(), n as i32)
                }
                _ => e,
            },
            Expression::Call(Function::Abs, _)
            | Expression::Apply(General::Min | General::Max | General::Clip, _)
                if e.parts().into_iter().all(|part| value(part).is_some()) =>
            {
                // Bounds in the wrong order are refused below.
                let ordered = match &e {
                    Expression::Apply(General::Clip, list) => value(&list[1]) <= value(&list[2]),
                    _ => true,
                };
                let v = evaluate(&e, &|name| values.get(name).copied());
                if ordered && v.is_finite() { Expression::Number(v.into()) } else { e }
            }
            _ => e,
        };
        definition.change_expressions(|e| *e = e.map(&decided));
        let section = section.map(|e| e.map(&decided));
        let tables = model.tables()?.into_iter().map(|(_, t)| t.clone()).collect();
        let mut watched: Vec<Expression> = Vec::new();
        let mut conditions: Vec<Expression> = Vec::new();
        for event in &definition.events {
            match &event.when {
                When::Zero(e, _) => watched.push(e.clone()),
                When::Becomes(e) => conditions.push(e.clone()),
                _ => {}
            }
        }
        watched.extend(section);
        let mut equation = Self {
            values,
            guards: Vec::new(),
            of_fields: 0,
            conditions: Vec::new(),
            of_events: Vec::new(),
            has_domain_ends: false,
            by_text: HashMap::new(),
            tables,
            watched: watched.clone(),
            resets: Vec::new(),
            known: Default::default(),
            definition,
        };
        let fields: Vec<Expression> =
            equation.definition.modes.iter().flat_map(|m| m.field.clone()).collect();
        let terms: Vec<Expression> =
            equation.definition.terms.iter().map(|(_, e)| e.clone()).collect();
        if equation.definition.document().h.is_some() {
            equation.register_h();
        }
        let rough = equation.rough_terms(fields.iter().chain(&watched).chain(&conditions));
        for e in fields.iter().chain(&watched) {
            equation.find(e, false, true)?;
        }
        let named = equation.definition.terms.iter().map(|(name, _)| rough.contains(name));
        for (e, rough) in terms.iter().zip(named.collect::<Vec<_>>()) {
            equation.find(e, false, !rough)?;
        }
        let fixed = |g: &Guard| !g.whole && equation.is_of_sides(&g.expression);
        let fixed: Vec<bool> = equation.guards.iter().map(fixed).collect();
        equation.guards.iter_mut().zip(fixed).for_each(|(guard, fixed)| guard.fixed = fixed);
        equation.of_fields = equation.guards.len();
        equation.has_domain_ends = fields.iter().chain(&terms).any(has_domain_ends);
        for e in &conditions {
            equation.find(e, true, true)?;
        }
        let of_sides = |g: &Guard| {
            if g.whole { equation.is_of_sides(&g.expression) } else { g.kink && g.fixed }
        };
        let of_sides: Vec<bool> = equation.guards.iter().map(of_sides).collect();
        equation.guards.iter_mut().zip(of_sides).for_each(|(guard, of)| guard.of_sides = of);
        let condition = |event: &crate::definition::Event| match &event.when {
            When::Becomes(e) => Some(Rc::new(e.clone())),
            _ => None,
        };
        equation.conditions = equation.definition.events.iter().map(condition).collect();
        let asked = |condition: &Option<Rc<Expression>>| {
            condition.as_ref().map_or_else(Vec::new, |e| equation.guards_of(e))
        };
        equation.of_events = equation.conditions.iter().map(asked).collect();
        let sets = equation.definition.events.iter().flat_map(|event| &event.set);
        for e in
            fields.iter().chain(&terms).chain(&watched).chain(&conditions).chain(sets.map(|s| &s.1))
        {
            equation.has_meaning(e)?;
        }
        equation.resets =
            equation.definition.events.iter().map(|event| equation.reset(&event.set)).collect();
        Ok(equation)
    }

    /// Refuses functions to which the values of parameters give no meaning. (Numbers are refused
    /// where the file is read.)
    fn has_meaning(&self, e: &Expression) -> Result<(), EquationError> {
        let number = |e: &Expression| evaluate(e, &|name| self.values.get(name).copied());
        match e {
            Expression::Apply(General::Clip, list) => {
                let (low, high) = (number(&list[1]), number(&list[2]));
                if low > high {
                    return Err(EquationError::Clip(e.to_string(), low, high));
                }
            }
            Expression::Apply(General::Mod, list) if number(&list[1]) == 0.0 => {
                return Err(EquationError::Mod(e.to_string()));
            }
            _ => {}
        }
        e.parts().into_iter().try_for_each(|part| self.has_meaning(part))
    }

    /// Whether an expression is one of states, time and parameters, by itself or through terms,
    /// which no switching function decides.
    fn is_plain(&self, e: &Expression) -> bool {
        let is_table = |name: &str| self.definition.tables.iter().any(|(table, _)| table == name);
        let (mut open, mut seen) = (vec![e], HashSet::new());
        while let Some(e) = open.pop() {
            if asks(e) || e.names().into_iter().any(is_table) {
                return false;
            }
            let new = e.names().into_iter().filter(|name| seen.insert(*name));
            open.extend(new.filter_map(|name| self.term(name)));
        }
        true
    }

    /// Plain expressions as a tape.
    fn record(&self, plain: &[&Expression]) -> Tape {
        let at = Configuration {
            mode: 0,
            sides: vec![1.0; self.guards.len()],
            pieces: Vec::new(),
            slid: Vec::new(),
            still: Vec::new(),
            higher: Vec::new(),
        };
        Tape::record(self.variables(), |v| {
            let mut writer = Writer {
                equation: self,
                at: &at,
                v,
                terms: HashMap::new(),
                conditions: HashMap::new(),
                guards: BTreeMap::new(),
                positive: Vec::new(),
            };
            plain.iter().map(|e| writer.number(e)).collect()
        })
    }

    /// An expression as a tape, if no switching function decides it.
    pub(crate) fn plain_tape(&self, e: &Expression) -> Option<Tape> {
        self.is_plain(e).then(|| self.record(&[e]))
    }

    fn reset(&self, set: &[(usize, Expression)]) -> Option<Program> {
        self.reset_tape(set).map(|tape| Program::new(&tape))
    }

    /// The new values that an event sets as a tape, where no switching function decides them.
    pub(crate) fn reset_tape(&self, set: &[(usize, Expression)]) -> Option<Tape> {
        let values: Vec<&Expression> = set.iter().map(|(_, e)| e).collect();
        values.iter().all(|e| self.is_plain(e)).then(|| self.record(&values))
    }

    /// Number of states.
    pub fn dimension(&self) -> usize {
        self.definition.states.len()
    }

    /// Whether a guard chooses between expressions, so that its side changes the structure of the
    /// equations.
    pub(crate) fn chooses(&self, guard: usize) -> bool {
        self.guards[guard].chooses
    }

    /// Number of variables of every program.
    pub fn variables(&self) -> usize {
        self.dimension() + 1 + self.guards.len() + 5 * self.tables.len()
    }

    /// Whether a field depends on the time, by itself or through a table.
    pub fn depends_on_time(&self) -> bool {
        self.definition.modes.iter().flat_map(|m| &m.field).any(|e| self.sees_time(e))
    }

    /// Whether the expression of an event or of the section depends on the time.
    pub fn events_see_time(&self) -> bool {
        let conditions = self.definition.events.iter().filter_map(|event| match &event.when {
            When::Becomes(e) => Some(e),
            _ => None,
        });
        self.watched.iter().chain(conditions).any(|e| self.sees_time(e))
    }

    fn sees_time(&self, e: &Expression) -> bool {
        let is_table = |name: &str| self.definition.tables.iter().any(|(table, _)| table == name);
        self.sees(e, &|name| name == "t" || is_table(name))
    }

    /// Whether an expression has one of these names, by itself or in a term.
    fn sees(&self, e: &Expression, wanted: &dyn Fn(&str) -> bool) -> bool {
        self.seen(e).into_iter().any(wanted)
    }

    /// The names that an expression has, by itself or in its terms.
    fn seen<'a>(&'a self, e: &'a Expression) -> HashSet<&'a str> {
        let (mut open, mut seen) = (e.names(), HashSet::new());
        while let Some(name) = open.pop() {
            if seen.insert(name) {
                open.extend(self.term(name).into_iter().flat_map(Expression::names));
            }
        }
        seen
    }

    /// The states that an expression sees.
    pub(crate) fn states_seen(&self, e: &Expression) -> Vec<bool> {
        let seen = self.seen(e);
        self.definition.states().iter().map(|state| seen.contains(state.name.as_str())).collect()
    }

    /// The states that decide, in a mode, how these guards move: those that they see, and that the
    /// equations of such states see. None if the time or a table is among it.
    pub(crate) fn core(&self, guards: &[usize], mode: usize) -> Option<Vec<bool>> {
        let (core, sees_time) = self.core_and_time(guards, mode);
        (!sees_time).then_some(core)
    }

    /// The same, and whether the time or a table is among it.
    pub(crate) fn core_and_time(&self, guards: &[usize], mode: usize) -> (Vec<bool>, bool) {
        let states = self.definition.states();
        let (mut core, mut sees_time) = (vec![false; states.len()], false);
        let mut open: Vec<&Expression> =
            guards.iter().map(|guard| &self.guards[*guard].expression).collect();
        while let Some(e) = open.pop() {
            sees_time |= self.sees_time(e);
            for name in self.seen(e) {
                if let Some(i) = states.iter().position(|s| s.name == name)
                    && !std::mem::replace(&mut core[i], true)
                {
                    open.push(&self.definition.modes[mode].field[i]);
                }
            }
        }
        (core, sees_time)
    }

    /// Whether a state's equation in a mode is zero, as of a counter.
    pub(crate) fn stands_still(&self, state: usize, mode: usize) -> bool {
        is_zero(&self.definition.modes[mode].field[state])
    }

    /// Whether anything depends on the time, events of the clock included.
    pub fn is_driven(&self) -> bool {
        self.depends_on_time()
            || self.events_see_time()
            || self.definition.events.iter().any(|event| {
                matches!(event.when, When::At(_) | When::Every(_))
                    || event.set.iter().any(|(_, e)| self.sees_time(e))
            })
    }

    /// The first part of the equations that is not the same a time `period` later, at times from
    /// `from` on and states up to these sizes. What follows a table that ends before is not looked
    /// at.
    pub fn not_the_same_after(&self, period: f64, from: f64, sizes: &[f64]) -> Option<String> {
        /// Times and states at which the equations are compared, and the part of an expression's
        /// largest size by which it may differ.
        const TRIED: usize = 32;
        const SAME: f64 = 1e-6;
        let d = &self.definition;
        let ends = |table: &str| {
            let at = d.tables.iter().position(|(name, _)| name == table);
            let last = at.and_then(|at| self.tables[at].knots.last());
            last.is_some_and(|last| *last < from + 2.0 * period)
        };
        let mut chance = RandomStream::new(0, 0);
        let mut drawn = |width: f64| (2.0 * chance.uniform() - 1.0) * width;
        let places: Vec<(f64, Vec<f64>)> = (0..TRIED)
            .map(|_| (from + period * drawn(1.0).abs(), sizes.iter().map(|s| drawn(*s)).collect()))
            .collect();
        let differs_from = |e: &Expression, sign: f64| {
            if !self.sees_time(e) || self.sees(e, &ends) {
                return false;
            }
            let pairs = places
                .iter()
                .map(|(t, x)| [*t, t + period].map(|t| self.value(e, t, x)))
                .filter(|pair| pair.iter().all(|v| v.is_finite()));
            let pairs: Vec<[f64; 2]> = pairs.collect();
            let size = pairs.iter().flatten().fold(0.0_f64, |most, v| most.max(v.abs()));
            pairs.iter().any(|[now, later]| (now - sign * later).abs() > SAME * size)
        };
        let differs = |e: &Expression| differs_from(e, 1.0);
        let fields = d.modes.iter().flat_map(|mode| d.states.iter().zip(&mode.field));
        if let Some((state, e)) = fields.into_iter().find(|(_, e)| differs(e)) {
            return Some(format!("{}' = {e}", state.name));
        }
        // Sides of what decides between fields, of which the states that are tried may see one.
        if let Some(guard) = self.guards.iter().find(|g| !g.whole && differs(&g.expression)) {
            return Some(format!("the switching function {}", guard.expression));
        }
        for event in &d.events {
            let start = &places[0].1;
            let clock = match &event.when {
                // An event in both directions has the same zeros with the other sign.
                When::Zero(e, Direction::Both) if !differs_from(e, -1.0) => None,
                When::Zero(e, _) | When::Becomes(e) => differs(e).then(|| format!("when {e}")),
                When::At(times) => {
                    let within = |e: &&Expression| {
                        let t = self.value(e, from, start);
                        t > from && t <= from + period
                    };
                    times.iter().find(within).map(|e| format!("at {e}, once"))
                }
                When::Every(e) => {
                    let count = period / self.value(e, from, start);
                    let whole = (count - count.round()).abs() <= SAME * count;
                    (!whole).then(|| format!("every {e}"))
                }
            };
            let set = event.set.iter().find(|(_, e)| differs(e));
            let set = set.map(|(i, e)| format!("sets {} = {e}", d.states[*i].name));
            if let Some(what) = clock.or(set) {
                return Some(format!("{} ({what})", event.name));
            }
        }
        None
    }

    /// The parameters' values.
    pub fn values(&self) -> &BTreeMap<String, f64> {
        &self.values
    }

    /// The definition of a name under `[let]`.
    pub(crate) fn term(&self, name: &str) -> Option<&Expression> {
        self.definition.terms.iter().find(|(n, _)| n == name).map(|(_, e)| e)
    }

    /// The names of terms that a quotient, a root or a logarithm is taken of, themselves or in
    /// another one: a kink in them may be a jump, or have no slope.
    fn rough_terms<'a>(&self, asked: impl Iterator<Item = &'a Expression>) -> HashSet<String> {
        fn collect(own: &Equation, e: &Expression, rough: bool, names: &mut Vec<(String, bool)>) {
            if let Expression::Name(name) = e {
                names.push((name.clone(), rough));
            }
            for (i, part) in e.parts().into_iter().enumerate() {
                collect(own, part, rough || !own.is_smooth_in(e, i), names);
            }
        }
        let (mut open, mut found, mut smooth) = (Vec::new(), HashSet::new(), HashSet::new());
        asked.for_each(|e| collect(self, e, false, &mut open));
        while let Some((name, rough)) = open.pop() {
            let new = if rough { found.insert(name.clone()) } else { smooth.insert(name.clone()) };
            if let (true, Some(term)) = (new, self.term(&name)) {
                collect(self, term, rough, &mut open);
            }
        }
        found
    }

    /// Whether an expression has a bounded slope in its part of that number, wherever it is taken:
    /// |x|/x and |x| (1/x) jump, although |x| does not.
    fn is_smooth_in(&self, e: &Expression, part: usize) -> bool {
        match e {
            Expression::Mul(a, b) => !self.has_pole(if part == 0 { b } else { a }),
            Expression::Div(_, b) => part == 0 && self.constant(b).is_some(),
            Expression::Power(_, exponent) => *exponent > 0,
            Expression::RealPower(base, exponent) => {
                part == 0 && self.is_power_of_size(base, exponent)
            }
            Expression::Call(Function::Ln | Function::Sqrt | Function::Tan, _) => false,
            Expression::Apply(
                General::Asin | General::Acos | General::Log | General::Log10 | General::Atan2,
                _,
            ) => false,
            _ => true,
        }
    }

    /// Whether an expression, or a term that it names, may grow without bound at a finite state.
    fn has_pole(&self, e: &Expression) -> bool {
        let (mut open, mut seen) = (vec![e], HashSet::new());
        while let Some(e) = open.pop() {
            let found = match e {
                Expression::Name(name) => {
                    open.extend(self.term(name).filter(|_| seen.insert(name)));
                    false
                }
                Expression::Div(_, b) => self.constant(b).is_none(),
                Expression::Power(_, exponent) => *exponent < 0,
                Expression::RealPower(_, exponent) => {
                    !self.constant(exponent).is_some_and(|v| v > 0.0)
                }
                Expression::Call(Function::Ln | Function::Tan, _)
                | Expression::Apply(General::Log | General::Log10, _) => true,
                _ => false,
            };
            if found {
                return true;
            }
            open.extend(e.parts());
        }
        false
    }

    /// Whether an expression is never negative, whatever states and time are.
    fn is_never_negative(&self, e: &Expression) -> bool {
        let is = |e: &Expression| self.is_never_negative(e);
        match e {
            _ if self.constant(e).is_some_and(|v| v >= 0.0) => true,
            Expression::Name(name) => self.term(name).is_some_and(is),
            Expression::Call(Function::Abs | Function::Sqrt | Function::Exp, _)
            | Expression::Apply(General::Cosh, _) => true,
            Expression::Apply(General::Max, list) => list.iter().any(is),
            Expression::Apply(General::Min, list) => list.iter().all(is),
            Expression::Apply(General::Clip, list) => is(&list[1]),
            Expression::Add(a, b) | Expression::Mul(a, b) | Expression::Div(a, b) => is(a) && is(b),
            Expression::Power(a, n) => n % 2 == 0 || is(a),
            _ => false,
        }
    }

    /// Whether a power, of what is never negative by an exponent of at least one, is taken of its
    /// size: rounding beyond the end of its domain makes it no other number.
    fn is_power_of_size(&self, base: &Expression, exponent: &Expression) -> bool {
        self.is_never_negative(base) && self.constant(exponent).is_some_and(|v| v >= 1.0)
    }

    /// Whether an expression is constant while no switching function in it changes its side.
    fn is_of_sides(&self, e: &Expression) -> bool {
        let is = |e: &Expression| self.is_of_sides(e);
        match e {
            Expression::Name(name) => match self.term(name) {
                Some(term) => is(term),
                None => self.values.contains_key(name),
            },
            Expression::Call(Function::Sign, _)
            | Expression::Apply(General::Heaviside | General::Floor, _)
            | Expression::Greater(..)
            | Expression::And(..)
            | Expression::Or(..)
            | Expression::Not(_) => true,
            Expression::Apply(General::If, list) => list[1..].iter().all(is),
            other => other.parts().into_iter().all(is),
        }
    }

    /// The value of an expression of numbers and parameters.
    fn constant(&self, e: &Expression) -> Option<f64> {
        let fixed = |name: &str| self.values.contains_key(name);
        let known = e.names().into_iter().all(fixed) && !asks(e);
        known.then(|| self.value(e, 0.0, &[])).filter(|v| v.is_finite())
    }

    /// The expressions of which one is the least or the greatest, itself, as a term or as the
    /// limits of `clip`: from above (`least`) clip(x, l, h) is min(max(x, l), h), else
    /// max(min(x, h), l).
    fn least_or_greatest<'a>(
        &'a self,
        e: &'a Expression,
        least: bool,
    ) -> Option<(General, Cow<'a, [Expression]>)> {
        match e {
            Expression::Name(name) => self.least_or_greatest(self.term(name)?, least),
            Expression::Apply(f @ (General::Min | General::Max), list) => {
                Some((*f, Cow::Borrowed(list)))
            }
            // Bounds that change may exchange their order.
            Expression::Apply(General::Clip, list)
                if list[1..].iter().all(|bound| self.constant(bound).is_some()) =>
            {
                let (outer, inner) =
                    if least { (General::Min, General::Max) } else { (General::Max, General::Min) };
                let (near, far) = if least { (1, 2) } else { (2, 1) };
                let inner = Expression::Apply(inner, vec![list[0].clone(), list[near].clone()]);
                Some((outer, Cow::Owned(vec![inner, list[far].clone()])))
            }
            _ => None,
        }
    }

    /// Comparison a > b of the least or the greatest of several as one for each of them; none if it
    /// is of no such. So equations have the surfaces on which they change, and no other ones: what
    /// is limited stays at its limit, where its comparison with that would see nothing.
    fn of_each(&self, a: &Expression, b: &Expression) -> Option<Expression> {
        /// No more comparisons for one.
        const MOST: usize = 64;
        fn count(own: &Equation, e: &Expression) -> usize {
            own.least_or_greatest(e, true).map_or(1, |(_, list)| {
                list.iter().map(|e| count(own, e)).fold(0, usize::saturating_add)
            })
        }
        match (a, b) {
            (Expression::Sub(a, b), c) if is_zero(c) => return self.of_each(a, b),
            (c, Expression::Sub(a, b)) if is_zero(c) => return self.of_each(b, a),
            _ => {}
        }
        let (all, parts): (bool, Vec<[&Expression; 2]>);
        let (from_above, from_below);
        if let Some((f, list)) = self.least_or_greatest(a, true) {
            from_above = list;
            (all, parts) = (f == General::Min, from_above.iter().map(|one| [one, b]).collect());
        } else {
            let (f, list) = self.least_or_greatest(b, false)?;
            from_below = list;
            (all, parts) = (f == General::Max, from_below.iter().map(|one| [a, one]).collect());
        }
        if count(self, a).saturating_mul(count(self, b)) > MOST {
            return None;
        }
        let known = |[a, b]: &[&Expression; 2]| Some(self.constant(a)? > self.constant(b)?);
        // Of constants one may decide all.
        if parts.iter().any(|part| known(part) == Some(!all)) {
            return None;
        }
        let open = parts.into_iter().filter(|part| known(part).is_none());
        open.map(|[a, b]| Expression::Greater(Box::new(a.clone()), Box::new(b.clone()))).reduce(
            |one, other| {
                let (one, other) = (Box::new(one), Box::new(other));
                if all { Expression::And(one, other) } else { Expression::Or(one, other) }
            },
        )
    }

    /// Registers the switching functions of an expression; `smooth`: nothing around it has a pole
    /// or a root.
    fn find(
        &mut self,
        e: &Expression,
        wants_condition: bool,
        smooth: bool,
    ) -> Result<(), EquationError> {
        if let Expression::Greater(a, b) = e
            && let Some(each) = self.of_each(a, b)
        {
            return self.find(&each, true, smooth);
        }
        match e {
            Expression::Name(name) if wants_condition => match self.term(name).cloned() {
                Some(term) if term.is_condition() => return Ok(()),
                Some(Expression::Name(other)) => {
                    return self.find(&Expression::Name(other), true, smooth);
                }
                _ => return Err(EquationError::NoCondition(name.clone())),
            },
            Expression::Greater(a, b) => self.register(difference(a, b), false, true, false),
            Expression::Call(f @ (Function::Sign | Function::Abs), a) => {
                let kink = smooth && *f == Function::Abs && !self.has_pole(a);
                self.register((**a).clone(), false, false, kink)
            }
            Expression::Apply(f, list) => match f {
                General::Min | General::Max => {
                    let kink = smooth && !list.iter().any(|e| self.has_pole(e));
                    // Each with the least or greatest before it.
                    for i in 1..list.len() {
                        self.register(
                            difference(&list[i], &self.folded(*f, &list[..i])),
                            false,
                            true,
                            kink,
                        );
                    }
                }
                General::Clip => {
                    // Bounds that change may exchange their order, at which it jumps.
                    let bounded = list[1..].iter().all(|e| self.constant(e).is_some());
                    let kink = smooth && bounded && !self.has_pole(&list[0]);
                    self.register(difference(&list[0], &list[1]), false, true, kink);
                    self.register(difference(&list[0], &list[2]), false, true, kink);
                }
                General::Heaviside => self.register(list[0].clone(), false, false, false),
                General::Floor => self.register(list[0].clone(), true, false, false),
                General::Mod => self.register(quotient(list), true, false, false),
                General::Atan2 => {
                    self.register(list[1].clone(), false, true, false);
                    self.register(list[0].clone(), false, true, false);
                }
                _ => {}
            },
            _ => {}
        }
        let conditions = |i: usize| match e {
            Expression::And(..) | Expression::Or(..) | Expression::Not(_) => true,
            Expression::Apply(General::If, _) => i == 0,
            _ => false,
        };
        for (i, part) in e.parts().into_iter().enumerate() {
            self.find(part, conditions(i), smooth && self.is_smooth_in(e, i))?;
        }
        Ok(())
    }

    fn folded(&self, f: General, list: &[Expression]) -> Expression {
        if list.len() == 1 { list[0].clone() } else { Expression::Apply(f, list.to_vec()) }
    }

    fn register(&mut self, expression: Expression, whole: bool, chooses: bool, kink: bool) {
        let (expression, _) = if whole { (expression, false) } else { self.bare(&expression) };
        self.enter(expression, whole, chooses, kink);
    }

    /// The switching function h of a system with plus and minus, which keeps its sign: plus is
    /// where it is positive.
    fn register_h(&mut self) {
        let field = self.definition.modes.first().and_then(|mode| mode.field.first());
        let Some(Expression::Apply(General::If, list)) = field else { return };
        let Expression::Greater(h, _) = &list[0] else { return };
        let (bare, flipped) = self.bare(h);
        self.enter(if flipped { mirrored(&bare) } else { bare }, false, true, false);
    }

    fn enter(&mut self, expression: Expression, whole: bool, chooses: bool, kink: bool) {
        let key = |e: &Expression| format!("{}{e}", if whole { "whole " } else { "" });
        if let Some((i, _)) = self.by_text.get(&key(&expression)) {
            self.guards[*i].chooses |= chooses;
            self.guards[*i].kink &= kink;
            return;
        }
        let i = self.guards.len();
        if whole {
            // One surface, as that of floor(x) beside mod(x, 1).
            if let Some(sum) = self.whole_key(&expression) {
                if let Some((other, _)) = self.by_text.get(&sum).copied() {
                    self.guards[other].chooses |= chooses;
                    self.guards[other].kink &= kink;
                    self.by_text.insert(key(&expression), (other, false));
                    return;
                }
                self.by_text.insert(sum, (i, false));
            }
        } else {
            self.by_text.insert(key(&mirrored(&expression)), (i, true));
            if let Some((sum, flipped)) = self.sum_key(&expression) {
                if let Some((other, opposite)) = self.by_text.get(&sum).copied() {
                    // Written before in another scale.
                    self.guards[other].chooses |= chooses;
                    self.guards[other].kink &= kink;
                    self.by_text.insert(key(&mirrored(&expression)), (other, opposite == flipped));
                    self.by_text.insert(key(&expression), (other, opposite != flipped));
                    return;
                }
                self.by_text.insert(sum, (i, flipped));
            }
        }
        self.by_text.insert(key(&expression), (i, false));
        self.guards.push(Guard { expression, whole, chooses, kink, fixed: false, of_sides: false });
    }

    /// The guard of an expression, and whether it is the expression's negative.
    fn guard(&self, e: &Expression, whole: bool) -> (usize, bool) {
        let (e, flipped) = if whole { (e.clone(), false) } else { self.bare(e) };
        let key = format!("{}{e}", if whole { "whole " } else { "" });
        self.by_text.get(&key).map_or((0, flipped), |(i, other)| (*i, *other != flipped))
    }

    /// An expression that has the same sign everywhere, or the other one, without what changes
    /// nothing about that: constant factors, odd powers, odd rising functions, absolute values
    /// beside what they are of, divisors instead of factors.
    fn bare(&self, e: &Expression) -> (Expression, bool) {
        let constant = |e: &Expression| self.constant(e).filter(|v| *v != 0.0);
        let scaled = |e: &Expression, factor: f64| {
            let (e, flipped) = self.bare(e);
            (e, flipped != (factor < 0.0))
        };
        match e {
            Expression::Neg(a) => scaled(a, -1.0),
            Expression::Mul(a, b) => match (constant(a), constant(b)) {
                (Some(factor), _) => scaled(b, factor),
                (_, Some(factor)) => scaled(a, factor),
                _ => match (&**a, &**b) {
                    (x, Expression::Call(Function::Abs, y))
                    | (Expression::Call(Function::Abs, y), x)
                        if x == &**y =>
                    {
                        self.bare(x)
                    }
                    _ => (e.clone(), false),
                },
            },
            Expression::Div(a, b) => match (constant(a), constant(b)) {
                (_, Some(factor)) => scaled(a, factor),
                (Some(factor), _) => scaled(b, factor),
                _ => (Expression::Mul(a.clone(), b.clone()), false),
            },
            Expression::Sub(a, b) if **a == mirrored(b) => self.bare(a),
            Expression::Add(a, b) if a == b => self.bare(a),
            Expression::Power(a, n) if n % 2 != 0 => self.bare(a),
            Expression::Call(Function::Tanh | Function::Atan | Function::Erf, a) => self.bare(a),
            Expression::Apply(General::Sinh | General::Asin, list) if list.len() == 1 => {
                self.bare(&list[0])
            }
            Expression::Add(..) | Expression::Sub(..) | Expression::Call(Function::Tan, _) => {
                match self.fraction(e) {
                    // At a pole it changes its sign, too.
                    Some(Fraction { above, below, .. }) => (product(above, below), false),
                    None => (e.clone(), false),
                }
            }
            other => (other.clone(), false),
        }
    }

    /// An expression over a common divisor, if one in it may be zero.
    fn fraction(&self, e: &Expression) -> Option<Fraction> {
        let whole = |e: &Expression| Fraction { above: e.clone(), below: None, full: None };
        let of = |e: &Expression| self.fraction(e);
        match e {
            Expression::Name(name) => of(self.term(name)?),
            Expression::Neg(a) => {
                let a = of(a)?;
                Some(Fraction { above: Expression::Neg(Box::new(a.above)), ..a })
            }
            Expression::Add(a, b) | Expression::Sub(a, b) => {
                let (p, q) = (of(a), of(b));
                if p.is_none() && q.is_none() {
                    return None;
                }
                let (p, q) = (p.unwrap_or_else(|| whole(a)), q.unwrap_or_else(|| whole(b)));
                let (left, right) = if p.full == q.full {
                    (p.above, q.above)
                } else {
                    (product(p.above, q.full.clone()), product(q.above, p.full.clone()))
                };
                let sum = if matches!(e, Expression::Add(..)) {
                    Expression::Add
                } else {
                    Expression::Sub
                };
                let above = sum(Box::new(left), Box::new(right));
                if p.full == q.full {
                    return Some(Fraction { above, ..p });
                }
                Some(Fraction { above, below: both(p.below, q.below), full: both(p.full, q.full) })
            }
            Expression::Mul(a, b) => {
                let (p, q) = (of(a), of(b));
                if p.is_none() && q.is_none() {
                    return None;
                }
                let (p, q) = (p.unwrap_or_else(|| whole(a)), q.unwrap_or_else(|| whole(b)));
                Some(Fraction {
                    above: product(p.above, Some(q.above)),
                    below: both(p.below, q.below),
                    full: both(p.full, q.full),
                })
            }
            Expression::Div(a, b) if self.constant(b).is_none() => {
                let p = of(a).unwrap_or_else(|| whole(a));
                if of(b).is_some() {
                    return None;
                }
                let below = (!self.is_never_negative(b)).then(|| (**b).clone());
                Some(Fraction {
                    above: p.above,
                    below: both(p.below, below),
                    full: both(p.full, Some((**b).clone())),
                })
            }
            Expression::Div(a, b) => {
                let a = of(a)?;
                let above = Expression::Div(Box::new(a.above), b.clone());
                Some(Fraction { above, ..a })
            }
            Expression::Call(Function::Tan, a) => {
                let [above, below] =
                    [Function::Sin, Function::Cos].map(|f| Expression::Call(f, a.clone()));
                Some(Fraction { above, below: Some(below.clone()), full: Some(below) })
            }
            _ => None,
        }
    }

    /// A key that sums of the same states and time share in whatever scale and order they are
    /// written, and whether the sum is the key's negative.
    fn sum_key(&self, e: &Expression) -> Option<(String, bool)> {
        let sum = self.sum(e)?;
        let first = sum.factors.first()?.1;
        Some((sum.key(first), first < 0.0))
    }

    /// The same of a sum whose whole part is asked for, which has its scale.
    fn whole_key(&self, e: &Expression) -> Option<String> {
        let sum = self.sum(e).filter(|sum| !sum.factors.is_empty())?;
        Some(format!("whole {}", sum.key(1.0)))
    }

    /// A plain expression that is a sum of variables with constant factors.
    fn sum(&self, e: &Expression) -> Option<Affine> {
        if !self.is_plain(e) {
            return None;
        }
        let mut sum = affine(&self.record(&[e])).pop()??;
        sum.factors.retain(|(_, factor)| *factor != 0.0);
        sum.factors.sort_unstable_by_key(|(variable, _)| *variable);
        Some(sum)
    }

    /// The switching functions as text, in the order of a point's signs.
    pub fn switching_functions(&self) -> Vec<String> {
        let text = |g: &Guard| {
            if g.whole { format!("floor({})", g.expression) } else { g.expression.to_string() }
        };
        self.guards.iter().map(text).collect()
    }

    /// The switching function that an expression or its negative is.
    pub fn switching(&self, e: &Expression) -> Option<usize> {
        let key = match e {
            Expression::Greater(a, b) => self.bare(&difference(a, b)).0.to_string(),
            Expression::Not(inner) => return self.switching(inner),
            other => self.bare(other).0.to_string(),
        };
        self.by_text
            .get(&key)
            .or_else(|| self.by_text.get(&format!("whole {key}")))
            .map(|(i, _)| *i)
    }

    /// Whether a condition holds in a configuration.
    pub fn holds(&self, e: &Expression, at: &Configuration) -> bool {
        self.holds_with(e, at, &mut HashMap::new())
    }

    /// The same; conditions in terms are asked once each.
    fn holds_with<'a>(
        &'a self,
        e: &'a Expression,
        at: &Configuration,
        known: &mut HashMap<&'a str, bool>,
    ) -> bool {
        match e {
            Expression::Greater(a, b) => match self.of_each(a, b) {
                Some(each) => self.holds(&each, at),
                None => self.positive(&difference(a, b), at),
            },
            Expression::And(a, b) => self.holds_with(a, at, known) && self.holds_with(b, at, known),
            Expression::Or(a, b) => self.holds_with(a, at, known) || self.holds_with(b, at, known),
            Expression::Not(a) => !self.holds_with(a, at, known),
            Expression::Name(name) => {
                if let Some(holds) = known.get(name.as_str()) {
                    return *holds;
                }
                let holds = self.term(name).is_some_and(|term| self.holds_with(term, at, known));
                known.insert(name, holds);
                holds
            }
            _ => false,
        }
    }

    fn positive(&self, e: &Expression, at: &Configuration) -> bool {
        let (i, flipped) = self.guard(e, false);
        !self.rests(i, at) && (at.sides[i] > 0.0) != flipped
    }

    /// The guards that a condition asks.
    fn guards_of(&self, condition: &Expression) -> Vec<usize> {
        let (mut open, mut found, mut seen) = (vec![condition.clone()], Vec::new(), HashSet::new());
        while let Some(e) = open.pop() {
            match &e {
                Expression::Greater(a, b) => match self.of_each(a, b) {
                    Some(each) => open.push(each),
                    None => found.push(self.guard(&difference(a, b), false).0),
                },
                Expression::Name(name) if seen.insert(name.clone()) => {
                    open.extend(self.term(name).cloned());
                }
                e => open.extend(e.parts().into_iter().cloned()),
            }
        }
        found
    }

    /// Whether a guard is asked by the conditions of events alone.
    pub(crate) fn is_of_conditions(&self, guard: usize) -> bool {
        guard >= self.of_fields
    }

    /// Whether a guard rests at zero: comparisons see equality, and a sign is 0.
    pub(crate) fn rests(&self, guard: usize, at: &Configuration) -> bool {
        at.sides[guard] == 0.0 && !self.guards[guard].whole
    }

    /// The value of an expression at a state, following conditions by the numbers themselves.
    pub fn value<S: Scalar>(&self, e: &Expression, t: S, x: &[S]) -> S {
        self.value_with(e, t, x, &RefCell::new(Vec::new()))
    }

    /// Gives what decides between the pieces of an expression: whether conditions hold, signs, the
    /// levels of steps, in the order in which they stand; of a term once.
    pub(crate) fn pieces(&self, e: &Expression, t: f64, x: &[f64], note: &mut dyn FnMut(i64)) {
        self.pieces_beyond(e, (t, x), note, &mut HashSet::new());
    }

    fn pieces_beyond<'a>(
        &'a self,
        e: &'a Expression,
        (t, x): (f64, &[f64]),
        note: &mut dyn FnMut(i64),
        seen: &mut HashSet<&'a str>,
    ) {
        let value = |e: &Expression| self.value(e, t, x);
        let mut parts = e.parts();
        match e {
            Expression::Name(name) => {
                parts.extend(self.term(name).filter(|_| seen.insert(name)));
            }
            Expression::Apply(General::If, list) => {
                let holds = value(&list[0]) != 0.0;
                note(i64::from(holds));
                parts = vec![&list[if holds { 1 } else { 2 }]];
            }
            _ if e.is_condition() => {
                note(i64::from(value(e) != 0.0));
                parts.clear();
            }
            Expression::Apply(General::Heaviside | General::Floor, _) => {
                note(value(e) as i64);
                parts.clear();
            }
            Expression::Call(Function::Sign | Function::Abs, a) => {
                note(i64::from(value(a) > 0.0) - i64::from(value(a) < 0.0));
            }
            Expression::Apply(General::Mod, list) => {
                note((value(&list[0]) / value(&list[1])).floor() as i64);
            }
            Expression::Apply(General::Min | General::Max | General::Clip, list) => {
                let chosen = list.iter().position(|part| value(part) == value(e));
                note(chosen.map_or(-1, |i| i as i64));
                parts = chosen.map(|i| &list[i]).into_iter().collect();
            }
            _ => {}
        }
        for part in parts {
            self.pieces_beyond(part, (t, x), note, seen);
        }
    }

    /// The value; terms are evaluated once each.
    fn value_with<S: Scalar>(
        &self,
        e: &Expression,
        t: S,
        x: &[S],
        known: &RefCell<Vec<Option<S>>>,
    ) -> S {
        let terms = &self.definition.terms;
        let name = |name: &str| -> Option<S> {
            if name == "t" {
                return Some(t);
            }
            if let Some(i) = self.definition.states.iter().position(|s| s.name == name) {
                return Some(x[i]);
            }
            if let Some(value) = self.values.get(name) {
                return Some(S::from_f64(*value));
            }
            if let Some(i) = terms.iter().position(|(n, _)| n == name) {
                known.borrow_mut().resize(terms.len(), None);
                let value = known.borrow()[i];
                let value = value.unwrap_or_else(|| self.value_with(&terms[i].1, t, x, known));
                known.borrow_mut()[i] = Some(value);
                return Some(value);
            }
            let table = self.definition.tables.iter().position(|(n, _)| n == name)?;
            let table = &self.tables[table];
            Some(table.value(table.piece(t.to_f64()), t))
        };
        crate::value::evaluate(e, &name)
    }

    /// The equations for the structure of this configuration.
    pub fn compiled(&self, at: &Configuration) -> Rc<Compiled> {
        self.compiled_with(at, &[])
    }

    /// The same, with these guards among the active ones even where the equations do not ask them.
    pub fn compiled_with(&self, at: &Configuration, also: &[usize]) -> Rc<Compiled> {
        let numbers = |guards: &[usize]| -> Vec<i8> {
            guards.iter().flat_map(|g| (*g as u32).to_le_bytes()).map(|b| b as i8).collect()
        };
        let mut key = numbers(&[at.mode, at.slid.len(), at.still.len(), at.higher.len()]);
        for list in [&at.slid, &at.still, &at.higher] {
            key.extend(numbers(list));
        }
        key.extend(
            self.guards.iter().zip(&at.sides).filter(|(g, _)| g.chooses).map(|(_, s)| *s as i8),
        );
        let rest: Vec<usize> = (0..self.guards.len()).filter(|g| self.rests(*g, at)).collect();
        if !rest.is_empty() {
            key.push(i8::MAX);
            key.extend(numbers(&rest));
        }
        if !also.is_empty() {
            key.push(i8::MIN);
            key.extend(numbers(also));
        }
        if let Some(found) = self.known.borrow().get(&key) {
            return found.clone();
        }
        // Guards that the equations ask by themselves are compiled once.
        let plain = (!also.is_empty()).then(|| self.compiled(at));
        let made = plain
            .filter(|plain| also.iter().all(|guard| plain.place(*guard).is_some()))
            .unwrap_or_else(|| Rc::new(self.compile(at, also)));
        let mut known = self.known.borrow_mut();
        // A long run among very many structures keeps memory flat.
        if known.len() >= 4096 {
            known.clear();
        }
        known.insert(key, made.clone());
        made
    }

    fn compile(&self, at: &Configuration, also: &[usize]) -> Compiled {
        let (mut active, mut deciding) = (Vec::new(), Vec::new());
        let n = self.dimension();
        let tape = Tape::record(self.variables(), |v| {
            let mut writer = Writer {
                equation: self,
                at,
                v,
                terms: HashMap::new(),
                conditions: HashMap::new(),
                guards: BTreeMap::new(),
                positive: Vec::new(),
            };
            let fields = self.definition.modes[at.mode].field.iter().enumerate();
            let mut outputs: Vec<Recorded> = fields
                .map(|(i, e)| match at.still.contains(&i) {
                    true => Recorded::zero(),
                    false => writer.number(e),
                })
                .collect();
            writer.write_guards();
            deciding.extend(writer.guards.keys());
            let watched: Vec<Recorded> = self.watched.iter().map(|e| writer.number(e)).collect();
            for event in &self.definition.events {
                if let When::Becomes(e) = &event.when {
                    writer.condition(e);
                }
            }
            for guard in also {
                writer.guards.entry(*guard).or_insert(None);
            }
            writer.write_guards();
            for (i, guard) in &writer.guards {
                active.push(*i);
                outputs.extend(guard);
            }
            outputs.extend(watched);
            outputs
        });
        let tape = if at.higher.is_empty() { tape } else { without_zeros(&tape) };
        let outputs = n + active.len() + self.watched.len();
        let raise = |guard: &usize| {
            let place = active.iter().position(|a| a == guard)?;
            Some((n + place, raised(&tape, n, n + place, n + 1 + guard)?))
        };
        let higher: Vec<_> = at.higher.iter().map(raise).collect();
        let tape = if higher.iter().any(Option::is_some) {
            Tape::record(tape.variables(), |v| {
                let mut replay = Replay::new(&tape, v);
                let mut values: Vec<_> = (0..outputs).map(|i| replay.output(i)).collect();
                for (place, of) in higher.iter().flatten() {
                    values[*place] = Replay::new(of, v).output(of.outputs().len() - 1);
                }
                values
            })
        } else {
            tape
        };
        let derivatives = higher.iter().map(|of| {
            let (_, tape) = of.as_ref()?;
            Some((Program::new(tape), tape.outputs().len()))
        });
        let depends = dependencies(&tape);
        let on = |value: usize, variable: usize| {
            depends[value][variable / 64] & (1 << (variable % 64)) != 0
        };
        let touches: Vec<Vec<usize>> =
            (n..outputs).map(|o| (0..=n).filter(|v| on(o, *v)).collect()).collect();
        let (gates, watched_gates) = (gates(&tape.select(0..n)), gates(&tape.select(n..outputs)));
        let affine = affine(&tape).split_off(n);
        Compiled {
            field: Program::new(&tape.select(0..n)),
            watched: Program::new(&tape.select(n..outputs)),
            outputs: outputs - n,
            place: (0..self.guards.len())
                .map(|guard| active.iter().position(|a| *a == guard))
                .collect(),
            is_curved: affine.contains(&None),
            affine,
            colours: colours(&touches, n + 1),
            touches,
            depends,
            gate_arguments: Program::new(&with_outputs(
                &tape,
                gates.iter().map(|(_, a)| *a).collect(),
            )),
            watched_gate_arguments: Program::new(&with_outputs(
                &tape,
                watched_gates.iter().map(|(_, a)| *a).collect(),
            )),
            watched_gates: watched_gates.into_iter().map(|(gate, _)| gate).collect(),
            gates: gates.into_iter().map(|(gate, _)| gate).collect(),
            derivatives: derivatives.collect(),
            active,
            deciding,
            tape,
        }
    }

    /// The domain that is left at a point: the first root, logarithm or division there whose value
    /// is no finite number, as words.
    pub fn broken(&self, compiled: &Compiled, variables: &[f64]) -> Option<String> {
        use twofold_num::tape::Operation;
        let n = self.dimension();
        let deciding = compiled.deciding.iter().filter_map(|guard| compiled.place(*guard));
        let tape = compiled.tape.select((0..n).chain(deciding.map(|place| n + place)));
        let values = tape.values(variables);
        let needed = tape.needed();
        let names: Vec<String> = self.definition.states.iter().map(|s| s.name.clone()).collect();
        for (node, operation) in tape.operations().iter().enumerate() {
            if !needed[node] || values[node].is_finite() {
                continue;
            }
            if operation.arguments().all(|a| values[a].is_finite()) {
                let what = match operation {
                    Operation::Sqrt(_) => "the square root of a negative number",
                    Operation::Ln(_) if makes_a_power(&tape, node) => {
                        "a power whose exponent is no whole number, of a number that is not \
                            positive (an odd root of one is sign(x)*abs(x)^(1/3))"
                    }
                    Operation::Ln(_) => "the logarithm of a number that is not positive",
                    Operation::Div(..) => "a division by zero",
                    _ => OVERFLOW,
                };
                // The component that it spoils, and the expression that is written there.
                let (fields, guards) = tape.outputs().split_at(n);
                let spoilt = self.definition.modes.iter().flat_map(|m| m.field.iter().enumerate());
                let place =
                    spoilt.zip(fields.iter().cycle()).find(|(_, out)| !values[**out].is_finite());
                if let Some(((i, e), _)) = place {
                    return Some(format!("{what}, in the equation of {}, `{e}`", names[i]));
                }
                let guard =
                    compiled.deciding.iter().zip(guards).find(|(_, out)| values[**out].is_nan());
                // No output is spoilt, and no domain left: 0^1.5 is exp(1.5 ln 0), which is zero.
                let (guard, _) = guard?;
                let function = &self.guards[*guard].expression;
                return Some(format!("{what}, in the switching function {function}"));
            }
        }
        None
    }
}

/// Words for an expression that overflows.
pub(crate) const OVERFLOW: &str = "a number beyond the range of double precision";

/// Whether a logarithm stands in a power, exp(b ln a).
fn makes_a_power(tape: &Tape, logarithm: usize) -> bool {
    use twofold_num::tape::Operation::{Exp, Mul};
    let operations = tape.operations();
    let is_factor = |product: usize| {
        matches!(operations[product], Mul(a,
        b) if a == logarithm || b == logarithm)
    };
    operations.iter().any(|o| matches!(o, Exp(product) if is_factor(*product)))
}

/// An operation that can be flat where a step looks and steep elsewhere, by its argument.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Gate {
    /// tanh, erf, atan: flat beyond this argument.
    Step(f64),
    /// Nothing below this argument.
    Exp,
    /// Sine and cosine.
    Wave,
    /// The argument of a root or logarithm: smooth in its own scale.
    Scale,
    /// A divisor: the same, and a pole where it is zero.
    Divisor,
}

/// Whether numbers have one sign: their product may be too small to have one.
pub(crate) fn same_sign(a: f64, b: f64) -> bool {
    a > 0.0 && b > 0.0 || a < 0.0 && b < 0.0
}

impl Gate {
    /// Whether it does nothing that a step could miss while its argument is between these numbers.
    pub fn is_quiet(self, low: f64, high: f64) -> bool {
        let width = high - low;
        match self {
            Gate::Step(flat) => width <= 1.0 || low >= flat || high <= -flat,
            Gate::Exp => width <= 1.0 || high <= -40.0,
            Gate::Wave => width <= 3.0,
            Gate::Scale | Gate::Divisor => {
                let (most, least) = (low.abs().max(high.abs()), low.abs().min(high.abs()));
                width <= 0.0 || (most <= 8.0 * least && same_sign(low, high))
            }
        }
    }
}

/// The gates of a function's needed operations that depend on a variable, with their arguments.
fn gates(tape: &Tape) -> Vec<(Gate, usize)> {
    use twofold_num::tape::Operation::{Atan, Cos, Div, Erf, Exp, Ln, Sin, Sqrt, Tanh, Variable};
    let needed = tape.needed();
    let mut varies = vec![false; tape.operations().len()];
    let mut found: Vec<(Gate, usize)> = Vec::new();
    for (node, operation) in tape.operations().iter().enumerate() {
        varies[node] = matches!(operation, Variable(_)) || operation.arguments().any(|a| varies[a]);
        if let Div(_, a) = *operation {
            let mut factors = Vec::new();
            factors_of(tape, a, &mut factors);
            let open = factors.into_iter().filter(|a| varies[*a]).map(|a| (Gate::Divisor, a));
            let new: Vec<_> = open.filter(|gate| needed[node] && !found.contains(gate)).collect();
            found.extend(new);
            continue;
        }
        let gate = match *operation {
            Tanh(a) => (Gate::Step(10.0), a),
            Erf(a) => (Gate::Step(4.2), a),
            Atan(a) => (Gate::Step(1e3), a),
            Exp(a) => (Gate::Exp, a),
            Sin(a) | Cos(a) => (Gate::Wave, a),
            Sqrt(a) | Ln(a) => (Gate::Scale, a),
            _ => continue,
        };
        if needed[node] && varies[gate.1] && !found.contains(&gate) {
            found.push(gate);
        }
    }
    found
}

/// The factors of a product: a square is zero where its root is, and shows no change of sign there.
fn factors_of(tape: &Tape, node: usize, found: &mut Vec<usize>) {
    use twofold_num::tape::Operation::{Div, Mul, Neg};
    match tape.operations()[node] {
        Mul(a, b) => {
            factors_of(tape, a, found);
            if a != b {
                factors_of(tape, b, found);
            }
        }
        Neg(a) | Div(a, _) => factors_of(tape, a, found),
        _ => found.push(node),
    }
}

/// For each value the variables that it depends on, as bits.
pub(crate) fn dependencies(tape: &Tape) -> Vec<Vec<u64>> {
    let words = tape.variables().div_ceil(64);
    let mut of: Vec<Vec<u64>> = Vec::with_capacity(tape.operations().len());
    for operation in tape.operations() {
        let mut bits = vec![0; words];
        if let twofold_num::tape::Operation::Variable(i) = operation {
            bits[i / 64] |= 1 << (i % 64);
        }
        for argument in operation.arguments() {
            bits.iter_mut().zip(&of[argument]).for_each(|(bits, more)| *bits |= more);
        }
        of.push(bits);
    }
    tape.outputs().iter().map(|node| of[*node].clone()).collect()
}

/// A sum of variables with constant factors.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Affine {
    pub constant: f64,
    pub factors: Vec<(usize, f64)>,
}

impl Affine {
    /// Its speed along a field of the states, while the time goes on, and the size of what this is
    /// a sum of.
    pub(crate) fn speed(&self, field: &[f64]) -> (f64, f64) {
        self.factors.iter().fold((0.0, 0.0), |(slope, size), (variable, factor)| {
            let change = match *variable {
                i if i < field.len() => factor * field[i],
                i if i == field.len() => *factor,
                _ => 0.0,
            };
            (slope + change, size + change.abs())
        })
    }

    /// The part that sums of the same states and time share, each divided by a scale, without the
    /// last digit, in which the same ratio may differ.
    fn key(&self, scale: f64) -> String {
        let scaled = |v: f64| format!("{:.14e}", v / scale + 0.0);
        let terms: Vec<String> =
            self.factors.iter().map(|(variable, f)| format!("{variable} {}", scaled(*f))).collect();
        format!("sum {} {}", terms.join(" "), scaled(self.constant))
    }

    fn plus(mut self, other: &Self, factor: f64) -> Self {
        self.constant += factor * other.constant;
        for (variable, f) in &other.factors {
            match self.factors.iter_mut().find(|(v, _)| v == variable) {
                Some((_, own)) => *own += factor * f,
                None => self.factors.push((*variable, factor * f)),
            }
        }
        self
    }
}

/// The same function without terms that are zero everywhere, so that values depend on no variable
/// by them.
fn without_zeros(tape: &Tape) -> Tape {
    use twofold_num::tape::Operation::{Add, Div, Mul, Neg, Sqrt, Sub};
    // A value that depends on no variable is a number even if all variables are not-a-number.
    let fixed = tape.values(&vec![f64::NAN; tape.variables()]);
    Tape::record(tape.variables(), |v| {
        let mut replay = Replay::new(tape, v);
        let mut zero: Vec<bool> = fixed.iter().map(|value| *value == 0.0).collect();
        for (node, operation) in tape.operations().iter().enumerate() {
            let same = match *operation {
                Add(a, b) if zero[a] => Some(b),
                Add(a, b) | Sub(a, b) if zero[b] => Some(a),
                _ => None,
            };
            zero[node] |= match *operation {
                Sub(a, b) => replay.operation(a) == replay.operation(b),
                Mul(a, b) => zero[a] || zero[b],
                Div(a, _) | Neg(a) | Sqrt(a) => zero[a],
                _ => same.is_some_and(|a| zero[a]),
            };
            if zero[node] {
                replay.set(node, Recorded::zero());
            } else if let Some(same) = same {
                let value = replay.operation(same);
                replay.set(node, value);
            }
        }
        tape.outputs().iter().map(|node| replay.operation(*node)).collect()
    })
}

/// Value `of` of a tape whose first `n` ones are the speeds of its first `n` variables (variable
/// `n` is the time), and its derivatives along that motion, up to the last one that does not depend
/// on the variable `side`; none if the first one does, or none of a few.
fn raised(tape: &Tape, n: usize, of: usize, side: usize) -> Option<Tape> {
    /// No higher order.
    const MOST: usize = 6;
    let mut known = Tape::record(tape.variables(), |v| vec![Replay::new(tape, v).output(of)]);
    for order in 0..MOST {
        let next = Tape::record(tape.variables(), |v| {
            let mut fields = Replay::new(tape, v);
            let mut direction: Vec<_> = (0..n).map(|i| Some(fields.output(i))).collect();
            direction.resize(tape.variables(), None);
            direction[n] = Some(Recorded::one());
            let mut values = Replay::new(&known, v);
            let mut all: Vec<_> = (0..=order).map(|i| values.output(i)).collect();
            all.push(values.derivatives(&direction)[order].unwrap_or(Recorded::zero()));
            all
        });
        if dependencies(&next)[order + 1][side / 64] & (1 << (side % 64)) != 0 {
            return (order > 0).then_some(known);
        }
        known = next;
    }
    None
}

/// The values of a tape that are sums of variables with constant factors.
fn affine(tape: &Tape) -> Vec<Option<Affine>> {
    use twofold_num::tape::Operation::{Add, Div, Mul, Neg, Sub, Variable};
    // A value that depends on no variable is a number even if all variables are not-a-number.
    let fixed = tape.values(&vec![f64::NAN; tape.variables()]);
    let number = |constant: f64| Affine { constant, factors: Vec::new() };
    let mut of: Vec<Option<Affine>> = Vec::with_capacity(tape.operations().len());
    for (node, operation) in tape.operations().iter().enumerate() {
        let scaled = |a: usize, factor: f64| of[a].as_ref().map(|a| number(0.0).plus(a, factor));
        let value = match *operation {
            _ if fixed[node].is_finite() => Some(number(fixed[node])),
            Variable(i) => Some(Affine { constant: 0.0, factors: vec![(i, 1.0)] }),
            Neg(a) => scaled(a, -1.0),
            Add(a, b) => of[b].as_ref().and_then(|b| Some(of[a].clone()?.plus(b, 1.0))),
            Sub(a, b) => of[b].as_ref().and_then(|b| Some(of[a].clone()?.plus(b, -1.0))),
            Mul(a, b) if fixed[a].is_finite() => scaled(b, fixed[a]),
            Mul(a, b) if fixed[b].is_finite() => scaled(a, fixed[b]),
            Div(a, b) if fixed[b].is_finite() => scaled(a, 1.0 / fixed[b]),
            _ => None,
        };
        // Long sums are as fast by the program.
        of.push(value.filter(|v| v.factors.len() <= 8));
    }
    tape.outputs().iter().map(|node| of[*node].clone()).collect()
}

/// Colours of variables, so that no list has two of one colour: the smallest that is free, one
/// variable after the other.
fn colours(lists: &[Vec<usize>], variables: usize) -> Vec<usize> {
    let mut member = vec![Vec::new(); variables];
    lists.iter().enumerate().for_each(|(i, list)| list.iter().for_each(|v| member[*v].push(i)));
    let mut taken = vec![Vec::new(); lists.len()];
    let free = |of: &Vec<usize>| {
        let colour = (0..).find(|c| of.iter().all(|i| !taken[*i].contains(c))).unwrap_or(0);
        of.iter().for_each(|i| taken[*i].push(colour));
        colour
    };
    member.iter().map(free).collect()
}

/// Derivatives in so many directions at once.
const WIDE: usize = 4;

impl Compiled {
    /// The place of a guard among the active ones.
    pub(crate) fn place(&self, guard: usize) -> Option<usize> {
        self.place[guard]
    }

    /// The derivatives of the watched values by the variables that each [touches](Self::touches).
    pub(crate) fn gradients(&self, variables: &[f64]) -> Vec<Vec<f64>> {
        let mut gradients: Vec<Vec<f64>> =
            self.touches.iter().map(|list| vec![0.0; list.len()]).collect();
        let colours = self.colours.iter().max().map_or(0, |most| most + 1);
        let mut out = vec![Dual::<f64, WIDE>::constant(0.0); self.outputs];
        for from in (0..colours).step_by(WIDE) {
            let mut duals: Vec<Dual<f64, WIDE>> =
                variables.iter().map(|v| Dual::constant(*v)).collect();
            for (dual, colour) in duals.iter_mut().zip(&self.colours) {
                if (from..from + WIDE).contains(colour) {
                    dual.partials[colour - from] = 1.0;
                }
            }
            self.watched.evaluate(&duals, &mut out);
            for ((gradient, touches), value) in gradients.iter_mut().zip(&self.touches).zip(&out) {
                for (slope, variable) in gradient.iter_mut().zip(touches) {
                    let colour = self.colours[*variable];
                    if (from..from + WIDE).contains(&colour) {
                        *slope = value.partials[colour - from];
                    }
                }
            }
        }
        gradients
    }

    /// Whether a value (derivatives, then watched values) depends on a variable.
    pub(crate) fn depends(&self, value: usize, variable: usize) -> bool {
        self.depends[value][variable / 64] & (1 << (variable % 64)) != 0
    }
}

/// The same operations with these as values.
fn with_outputs(tape: &Tape, nodes: Vec<usize>) -> Tape {
    Tape::record(tape.variables(), |v| {
        let mut values = Vec::new();
        let mut replay = twofold_num::tape::Replay::new(tape, v);
        values.extend(nodes.into_iter().map(|node| replay.operation(node)));
        values
    })
}

fn quotient(list: &[Expression]) -> Expression {
    Expression::Div(Box::new(list[0].clone()), Box::new(list[1].clone()))
}

/// Writes expressions on a tape for a configuration.
struct Writer<'a> {
    equation: &'a Equation,
    at: &'a Configuration,
    v: &'a [Recorded],
    terms: HashMap<String, Recorded>,
    conditions: HashMap<String, bool>,
    /// Guards that were asked, with their values once written.
    guards: BTreeMap<usize, Option<Recorded>>,
    /// Differences that the conditions around what is written say to be positive.
    positive: Vec<Expression>,
}

impl Writer<'_> {
    /// Asks on which side of zero an expression is: the answer's variable and whether it is to be
    /// mirrored.
    fn ask(&mut self, e: &Expression, whole: bool) -> (usize, bool) {
        let (i, flipped) = self.equation.guard(e, whole);
        self.guards.entry(i).or_insert(None);
        (i, flipped)
    }

    /// Writes all guards that were asked. One may ask others: until no new one is found.
    fn write_guards(&mut self) {
        loop {
            let open: Vec<usize> =
                self.guards.iter().filter(|(_, g)| g.is_none()).map(|(i, _)| *i).collect();
            if open.is_empty() {
                break;
            }
            for i in open {
                let value = self.number(&self.equation.guards[i].expression.clone());
                self.guards.insert(i, Some(value));
            }
        }
    }

    /// The sign of an expression; none if it rests at zero.
    fn side(&mut self, e: &Expression) -> Option<Recorded> {
        let (i, flipped) = self.ask(e, false);
        let side = self.v[self.equation.dimension() + 1 + i];
        (!self.equation.rests(i, self.at)).then_some(if flipped { -side } else { side })
    }

    fn whole(&mut self, e: &Expression) -> Recorded {
        let (i, _) = self.ask(e, true);
        self.v[self.equation.dimension() + 1 + i]
    }

    fn is_positive(&mut self, e: &Expression) -> bool {
        self.ask(e, false);
        self.equation.positive(e, self.at)
    }

    fn condition(&mut self, e: &Expression) -> bool {
        match e {
            Expression::Greater(a, b) => match self.equation.of_each(a, b) {
                Some(each) => self.condition(&each),
                None => self.is_positive(&difference(a, b)),
            },
            Expression::And(a, b) => self.condition(a) && self.condition(b),
            Expression::Or(a, b) => self.condition(a) || self.condition(b),
            Expression::Not(a) => !self.condition(a),
            Expression::Name(name) => {
                if let Some(holds) = self.conditions.get(name) {
                    return *holds;
                }
                let equation = self.equation;
                let holds = equation.term(name).is_some_and(|term| self.condition(term));
                self.conditions.insert(name.clone(), holds);
                holds
            }
            _ => false,
        }
    }

    fn name(&mut self, name: &str) -> Recorded {
        let equation = self.equation;
        let n = equation.dimension();
        if name == "t" {
            return self.v[n];
        }
        if let Some(i) = equation.definition.states.iter().position(|s| s.name == name) {
            return self.v[i];
        }
        if let Some(value) = equation.values.get(name) {
            return Recorded::parameter(name, &Decimal::from(*value));
        }
        if let Some(known) = self.terms.get(name) {
            return *known;
        }
        if let Some(term) = equation.term(name).cloned() {
            // A term is the same in every branch.
            let around = std::mem::take(&mut self.positive);
            let value = self.number(&term);
            self.positive = around;
            self.terms.insert(name.to_owned(), value);
            return value;
        }
        let table = equation.definition.tables.iter().position(|(n, _)| n == name).unwrap_or(0);
        let first = n + 1 + equation.guards.len() + 5 * table;
        let s = self.v[n] - self.v[first];
        let [a, b, c, d] = [1, 2, 3, 4].map(|i| self.v[first + i]);
        a + s * (b + s * (c + s * d))
    }

    /// Whether the zero of an expression is slid upon in higher order: then it is a number in the
    /// fields, and not only in what decides them.
    fn is_zero_of_higher(&self, e: &Expression) -> bool {
        !self.at.higher.is_empty()
            && self.equation.switching(e).is_some_and(|guard| self.at.higher.contains(&guard))
    }

    /// Whether an expression is zero by that, as its size is.
    fn vanishes(&self, e: &Expression) -> bool {
        match e {
            _ if self.at.higher.is_empty() => false,
            Expression::Call(Function::Abs, a) => self.is_zero_of_higher(a) || self.vanishes(a),
            Expression::Mul(a, b) => self.vanishes(a) || self.vanishes(b),
            Expression::Neg(a)
            | Expression::Div(a, _)
            | Expression::Power(a, 1..)
            | Expression::RealPower(a, _)
            | Expression::Call(Function::Sqrt, a) => self.vanishes(a),
            Expression::Name(name) => self.equation.term(name).is_some_and(|e| self.vanishes(e)),
            Expression::Apply(General::Min | General::Max, list) => {
                matches!(&list[..], [a, b] if self.is_zero_of_higher(&difference(b, a))
                    && (is_zero(a) || is_zero(b)))
            }
            other => self.is_zero_of_higher(other),
        }
    }

    /// The argument of a root. While the motion slides on x = 0 rounding beyond zero is zero: of
    /// what is never negative, as |x|, and of x where a condition says that it is positive.
    fn of_root(&mut self, e: &Expression) -> Recorded {
        let value = self.number(e);
        let is_positive = || self.equation.is_never_negative(e) || self.positive.contains(e);
        if self.is_zero_of_sliding(e) && is_positive() {
            (value + value * value.sign()).scale(0.5)
        } else {
            value
        }
    }

    /// Whether a function whose zero is slid upon is an expression, or decides in it.
    fn is_zero_of_sliding(&self, e: &Expression) -> bool {
        let slides = |e: &Expression| {
            self.equation.switching(e).is_some_and(|guard| self.at.slid.contains(&guard))
        };
        if self.at.slid.is_empty() {
            return false;
        }
        let decides = match e {
            Expression::Call(Function::Abs, a) => slides(a),
            Expression::Apply(General::Min | General::Max | General::Clip, list) => {
                list[1..].iter().any(|other| slides(&difference(other, &list[0])))
            }
            Expression::Name(name) => {
                self.equation.term(name).is_some_and(|term| self.is_zero_of_sliding(term))
            }
            _ => false,
        };
        decides || slides(e) || e.parts().into_iter().any(|part| self.is_zero_of_sliding(part))
    }

    fn number(&mut self, e: &Expression) -> Recorded {
        match e {
            Expression::Number(n) => Recorded::constant(n),
            Expression::Pi => Recorded::pi(),
            Expression::Name(name) => self.name(name),
            Expression::RealPower(a, _) | Expression::Call(Function::Sqrt, a)
                if self.vanishes(a) =>
            {
                Recorded::zero()
            }
            Expression::Neg(a) => -self.number(a),
            Expression::Add(a, b) => self.number(a) + self.number(b),
            Expression::Sub(a, b) => self.number(a) - self.number(b),
            Expression::Mul(a, b) => self.number(a) * self.number(b),
            Expression::Div(a, b) => self.number(a) / self.number(b),
            Expression::Power(a, n) => self.number(a).power(*n),
            Expression::RealPower(a, b) if self.equation.is_power_of_size(a, b) => {
                let (a, b) = (self.number(a), self.number(b));
                power(a * a, b.scale(0.5))
            }
            Expression::RealPower(a, b) => power(self.of_root(a), self.number(b)),
            Expression::Call(Function::Sqrt, a) => self.of_root(a).sqrt(),
            Expression::Call(Function::Sign, a) => self.side(a).unwrap_or(Recorded::zero()),
            Expression::Call(Function::Abs, a) => match self.side(a) {
                Some(side) if !self.is_zero_of_higher(a) => side * self.number(a),
                _ => Recorded::zero(),
            },
            Expression::Call(f, a) => {
                let value = self.number(a);
                f.apply(value)
            }
            Expression::Greater(..)
            | Expression::And(..)
            | Expression::Or(..)
            | Expression::Not(_) => Recorded::from_f64(if self.condition(e) { 1.0 } else { 0.0 }),
            Expression::Apply(f, list) => self.apply(*f, list),
        }
    }

    /// One of the two values of `if`.
    fn branch(&mut self, list: &[Expression], holds: bool) -> Recorded {
        let positive = match (&list[0], holds) {
            (Expression::Greater(a, b), true) => Some(difference(a, b)),
            (Expression::Greater(a, b), false) => Some(difference(b, a)),
            _ => None,
        };
        let kept = self.positive.len();
        self.positive.extend(positive);
        let value = self.number(&list[if holds { 1 } else { 2 }]);
        self.positive.truncate(kept);
        value
    }

    fn apply(&mut self, f: General, list: &[Expression]) -> Recorded {
        match f {
            General::If => match &list[0] {
                Expression::Greater(a, b) if self.is_zero_of_higher(&difference(a, b)) => {
                    let [yes, no] = [true, false].map(|holds| self.branch(list, holds));
                    match self.side(&difference(a, b)) {
                        Some(side) => (yes + no).scale(0.5) + side * (yes - no).scale(0.5),
                        None => no,
                    }
                }
                condition => {
                    let holds = self.condition(condition);
                    self.branch(list, holds)
                }
            },
            General::Min | General::Max => {
                let last = list.len() - 1;
                if last == 0 {
                    return self.number(&list[0]);
                }
                let before = self.equation.folded(f, &list[..last]);
                let between = difference(&list[last], &before);
                let greater = self.is_positive(&between);
                if greater == (f == General::Max) && !self.is_zero_of_higher(&between) {
                    self.number(&list[last])
                } else {
                    self.number(&before)
                }
            }
            General::Clip => {
                if !self.is_positive(&difference(&list[0], &list[1])) {
                    self.number(&list[1])
                } else if self.is_positive(&difference(&list[0], &list[2])) {
                    self.number(&list[2])
                } else {
                    self.number(&list[0])
                }
            }
            General::Heaviside => match self.side(&list[0]) {
                Some(side) => (side + Recorded::one()).scale(0.5),
                None => Recorded::one(),
            },
            General::Floor => self.whole(&list[0]),
            // Of constants it is a number, never beyond zero by the rounding of a product.
            General::Mod if list.iter().all(|e| self.equation.constant(e).is_some()) => {
                let value = self.equation.value(&Expression::Apply(f, list.to_vec()), 0.0, &[]);
                Recorded::from_f64(value)
            }
            General::Mod => {
                let whole = self.whole(&quotient(list));
                let (a, b) = (self.number(&list[0]), self.number(&list[1]));
                a - b * whole
            }
            General::Atan2 => {
                let right = self.is_positive(&list[1]);
                // On the axis to the left the angle is pi, as a number's is.
                let up = right || !self.is_positive(&mirrored(&list[0]));
                let (y, x) = (self.number(&list[0]), self.number(&list[1]));
                // To the right the half angle keeps away from its branch; to the left it is
                // measured from the axis.
                let r = (x * x + y * y).sqrt();
                match (right, up) {
                    (true, _) => (y / (r + x)).atan().scale(2.0),
                    (false, true) => Recorded::pi() - (y / (r - x)).atan().scale(2.0),
                    (false, false) => -Recorded::pi() - (y / (r - x)).atan().scale(2.0),
                }
            }
            other => smooth(other, self.number(&list[0])),
        }
    }
}
