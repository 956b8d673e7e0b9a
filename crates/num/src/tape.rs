//! Equations as data: a function recorded as a list of operations.
//!
//! A [`Tape`] holds a function of any number of variables as a list of operations with shared
//! subterms. Constants and named parameters are operations of their own, so that extended precision
//! can read them as the decimal numbers that they were given as. A tape is written by running an
//! equation on [`Recorded`] numbers ([`Tape::record`]); it is read in three ways:
//!
//! - [`Program`] evaluates it over any [`Elementary`] number, made to be called millions of times;
//! - [`Solution`](super::series::Solution) makes the Taylor series of the differential equation
//!   that it is the right-hand side of;
//! - [`Replay`] writes it again inside another recording. That is how a transform makes a new
//!   equation from an old one, and how derivatives are taken symbolically.
//!
//! **What decides bits.** Every operation of the equation is one operation of the number type, in
//! the order and association in which it was written; nothing is reassociated, fused or cancelled.
//! Only two things are done once instead of each time: equal subterms, and terms without variables,
//! which in plain arithmetic are computed in `f64` (an equation in Rust does the same with its own
//! `f64` parameters).
//!
//! ```
//! use twofold_num::{Elementary, Tape, tape::Program};
//! // (x^2 + y^2) x, -(x^2 + y^2)
//! let tape = Tape::record(2, |v| {
//!     let r2 = v[0].squared() + v[1].squared();
//!     vec![r2 * v[0], -r2]
//! });
//! // Two variables, two squares, a sum used twice, a product, a sign.
//! assert_eq!(tape.operations().len(), 7);
//! let mut out = [0.0; 2];
//! Program::new(&tape).evaluate(&[1.0, 2.0], &mut out);
//! assert_eq!(out, [5.0, -5.0]);
//! # use twofold_num::Arithmetic;
//! ```

mod choice;
mod program;
mod side_by_side;

use std::cell::RefCell;
use std::collections::HashMap;

use super::decimal::{Decimal, FromDecimal};
use super::scalar::operators;
use super::{Arithmetic, Elementary};
pub use program::Program;

/// Index of an operation on its tape; arguments stand before their users.
pub type Node = usize;

/// One operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Operation {
    /// The variable with this index.
    Variable(usize),
    /// The constant with this index in [`Tape::constants`].
    Constant(usize),
    /// The parameter with this index in [`Tape::parameters`].
    Parameter(usize),
    /// pi.
    Pi,
    /// Sum.
    Add(Node, Node),
    /// Difference.
    Sub(Node, Node),
    /// Product.
    Mul(Node, Node),
    /// Quotient.
    Div(Node, Node),
    /// Negative.
    Neg(Node),
    /// Hyperbolic tangent.
    Tanh(Node),
    /// Exponential.
    Exp(Node),
    /// Natural logarithm.
    Ln(Node),
    /// Sine.
    Sin(Node),
    /// Cosine.
    Cos(Node),
    /// Square root.
    Sqrt(Node),
    /// Arc tangent.
    Atan(Node),
    /// Error function.
    Erf(Node),
    /// -1 below zero, +1 from zero on.
    Sign(Node),
}

impl Operation {
    /// The operation's arguments.
    pub fn arguments(self) -> impl Iterator<Item = Node> {
        use Operation::*;
        let (a, b) = match self {
            Variable(_) | Constant(_) | Parameter(_) | Pi => (None, None),
            Add(a, b) | Sub(a, b) | Mul(a, b) | Div(a, b) => (Some(a), Some(b)),
            Neg(a) | Tanh(a) | Exp(a) | Ln(a) | Sin(a) | Cos(a) | Sqrt(a) | Atan(a) | Erf(a)
            | Sign(a) => (Some(a), None),
        };
        a.into_iter().chain(b)
    }
}

/// A named number of an equation.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// The name.
    pub name: String,
    /// The value.
    pub value: Decimal,
}

/// The operations of a function of some variables with some values. See the [module](self).
#[derive(Clone, Debug, Default)]
pub struct Tape {
    variables: usize,
    /// The variables' names, for messages; empty if none were given.
    names: Vec<String>,
    operations: Vec<Operation>,
    constants: Vec<Decimal>,
    parameters: Vec<Parameter>,
    outputs: Vec<Node>,
}

impl PartialEq for Tape {
    /// The same operations; names of variables decide nothing.
    fn eq(&self, other: &Self) -> bool {
        self.variables == other.variables
            && self.operations == other.operations
            && self.constants == other.constants
            && self.parameters == other.parameters
            && self.outputs == other.outputs
    }
}

impl Tape {
    /// Records the operations that `function` applies to `variables` symbolic numbers.
    pub fn record(variables: usize, function: impl FnOnce(&[Recorded]) -> Vec<Recorded>) -> Self {
        let recorder = Recorder {
            tape: Tape {
                variables,
                operations: (0..variables).map(Operation::Variable).collect(),
                ..Tape::default()
            },
            index: HashMap::new(),
        };
        // A recording inside a recording gets a sheet of its own, and the outer one its sheet back.
        let outer = RECORDER.replace(recorder);
        let inputs: Vec<Recorded> = (0..variables).map(|node| Recorded { node }).collect();
        let values = function(&inputs);
        let mut tape = RECORDER.replace(outer).tape;
        tape.outputs = values.iter().map(|v| v.node).collect();
        tape
    }

    /// Number of variables.
    pub fn variables(&self) -> usize {
        self.variables
    }

    /// The same function with names for its variables, which messages use.
    pub fn with_names(self, names: impl IntoIterator<Item = String>) -> Self {
        Self { names: names.into_iter().collect(), ..self }
    }

    /// The name of variable `i`: x1, x2, ... where none was given.
    pub fn name(&self, i: usize) -> String {
        self.names.get(i).cloned().unwrap_or_else(|| format!("x{}", i + 1))
    }

    /// The operations in order; the variables come first.
    pub fn operations(&self) -> &[Operation] {
        &self.operations
    }

    /// The constants that appear in the equation.
    pub fn constants(&self) -> &[Decimal] {
        &self.constants
    }

    /// The parameters that appear in the equation.
    pub fn parameters(&self) -> &[Parameter] {
        &self.parameters
    }

    /// The operations that give the function's values.
    pub fn outputs(&self) -> &[Node] {
        &self.outputs
    }

    /// Number of different tanh in the function.
    pub fn tanh_count(&self) -> usize {
        self.operations.iter().filter(|o| matches!(o, Operation::Tanh(_))).count()
    }

    /// The same function with only the values at these places, in this order.
    pub fn select(&self, outputs: impl IntoIterator<Item = usize>) -> Self {
        Self { outputs: outputs.into_iter().map(|i| self.outputs[i]).collect(), ..self.clone() }
    }

    /// Whether the outputs need each operation.
    pub fn needed(&self) -> Vec<bool> {
        let mut needed = vec![false; self.operations.len()];
        for output in &self.outputs {
            needed[*output] = true;
        }
        for node in (0..self.operations.len()).rev() {
            if needed[node] {
                for argument in self.operations[node].arguments() {
                    needed[argument] = true;
                }
            }
        }
        needed
    }

    /// Each operation as a power of another: base and exponent. An operation that is not a power
    /// has itself and 1.
    pub fn powers(&self) -> Vec<(Node, u32)> {
        let mut powers: Vec<(Node, u32)> = Vec::with_capacity(self.operations.len());
        for (node, operation) in self.operations.iter().enumerate() {
            let power = match *operation {
                Operation::Mul(a, b) if powers[a].0 == powers[b].0 => {
                    (powers[a].0, powers[a].1.saturating_add(powers[b].1))
                }
                _ => (node, 1),
            };
            powers.push(power);
        }
        powers
    }

    /// The degree of the function's values as polynomials of the variables, without regard to terms
    /// that cancel; `None` if one of them is no polynomial.
    pub fn degree(&self) -> Option<u32> {
        let mut degrees: Vec<Option<u32>> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let of = |a: Node| degrees[a];
            let degree = match *operation {
                Operation::Variable(_) => Some(1),
                Operation::Add(a, b) | Operation::Sub(a, b) => {
                    of(a).zip(of(b)).map(|(a, b)| a.max(b))
                }
                Operation::Mul(a, b) => of(a).zip(of(b)).map(|(a, b)| a.saturating_add(b)),
                Operation::Div(a, b) if of(b) == Some(0) => of(a),
                Operation::Neg(a) => of(a),
                other => other.arguments().all(|a| of(a) == Some(0)).then_some(0),
            };
            degrees.push(degree);
        }
        self.outputs.iter().try_fold(0, |most, node| Some(degrees[*node]?.max(most)))
    }

    /// The values of all operations at `x`, in double precision.
    ///
    /// # Panics
    /// If `x` has not as many numbers as the function has variables.
    pub fn values(&self, x: &[f64]) -> Vec<f64> {
        assert_eq!(x.len(), self.variables, "one number a variable");
        let mut values: Vec<f64> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let value = match *operation {
                Operation::Variable(i) => x[i],
                other => self.apply(other, Decimal::value, |node| values[node]),
            };
            values.push(value);
        }
        values
    }

    /// The values of the operations that depend on no variable, `None` for the others. `number`
    /// reads constants and parameters.
    pub(super) fn fixed<S: Elementary>(&self, number: impl Fn(&Decimal) -> S) -> Vec<Option<S>> {
        let mut values: Vec<Option<S>> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let fixed = !matches!(operation, Operation::Variable(_))
                && operation.arguments().all(|argument| values[argument].is_some());
            let value = fixed
                .then(|| self.apply(*operation, &number, |node| values[node].unwrap_or(S::zero())));
            values.push(value);
        }
        values
    }

    /// The value of one operation: `number` reads constants and parameters, `at` gives the values
    /// of arguments and variables.
    pub fn apply<S: Elementary>(
        &self,
        operation: Operation,
        number: impl Fn(&Decimal) -> S,
        at: impl Fn(Node) -> S,
    ) -> S {
        match operation {
            Operation::Variable(i) => at(i),
            Operation::Constant(i) => number(&self.constants[i]),
            Operation::Parameter(i) => number(&self.parameters[i].value),
            Operation::Pi => S::pi(),
            Operation::Add(a, b) => at(a) + at(b),
            Operation::Sub(a, b) => at(a) - at(b),
            Operation::Mul(a, b) => at(a) * at(b),
            Operation::Div(a, b) => at(a) / at(b),
            Operation::Neg(a) => -at(a),
            Operation::Tanh(a) => at(a).tanh(),
            Operation::Exp(a) => at(a).exp(),
            Operation::Ln(a) => at(a).ln(),
            Operation::Sin(a) => at(a).sin(),
            Operation::Cos(a) => at(a).cos(),
            Operation::Sqrt(a) => at(a).sqrt(),
            Operation::Atan(a) => at(a).atan(),
            Operation::Erf(a) => at(a).erf(),
            Operation::Sign(a) => at(a).sign(),
        }
    }

    /// The function's values at `x`, with constants and parameters read as decimal numbers in `S`,
    /// and every term computed in `S`. For occasional use; [`Program`] is for loops.
    ///
    /// # Panics
    /// If `x` has not as many numbers as the function has variables.
    pub fn evaluate_decimal<S: Elementary + FromDecimal>(&self, x: &[S]) -> Vec<S> {
        assert_eq!(x.len(), self.variables, "one number a variable");
        let mut values: Vec<S> = Vec::with_capacity(self.operations.len());
        for operation in &self.operations {
            let value = match *operation {
                Operation::Variable(i) => x[i],
                other => self.apply(other, S::from_decimal, |node| values[node]),
            };
            values.push(value);
        }
        self.outputs.iter().map(|node| values[*node]).collect()
    }
}

/// A tape being written.
#[derive(Debug, Default)]
struct Recorder {
    tape: Tape,
    index: HashMap<Operation, Node>,
}

impl Recorder {
    fn push(&mut self, operation: Operation) -> Node {
        let operations = &mut self.tape.operations;
        *self.index.entry(operation).or_insert_with(|| {
            operations.push(operation);
            operations.len() - 1
        })
    }
}

thread_local! {
    /// The recording under way on this thread. `Elementary` is `Copy + 'static`, so that a recorded
    /// number cannot carry a reference to its recording.
    static RECORDER: RefCell<Recorder> = RefCell::new(Recorder::default());
}

fn record(operation: Operation) -> Recorded {
    RECORDER.with_borrow_mut(|recorder| Recorded { node: recorder.push(operation) })
}

/// A symbolic number: every operation on it appends an instruction to the tape being recorded. It
/// holds no value, so an equation cannot branch on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recorded {
    node: Node,
}

impl Recorded {
    /// A constant.
    pub fn constant(value: &Decimal) -> Self {
        RECORDER.with_borrow_mut(|recorder| {
            let constants = &mut recorder.tape.constants;
            let same = |c: &Decimal| c == value && c.value().to_bits() == value.value().to_bits();
            let i = constants.iter().position(same).unwrap_or_else(|| {
                constants.push(value.clone());
                constants.len() - 1
            });
            Self { node: recorder.push(Operation::Constant(i)) }
        })
    }

    /// A named parameter. Two parameters are the same if name and value are.
    pub fn parameter(name: &str, value: &Decimal) -> Self {
        RECORDER.with_borrow_mut(|recorder| {
            let parameters = &mut recorder.tape.parameters;
            let i = parameters
                .iter()
                .position(|p| p.name == name && p.value == *value)
                .unwrap_or_else(|| {
                    parameters.push(Parameter { name: name.into(), value: value.clone() });
                    parameters.len() - 1
                });
            Self { node: recorder.push(Operation::Parameter(i)) }
        })
    }
}

operators! {
    impl [] Recorded, inline:
    Add add(self, other) { record(Operation::Add(self.node, other.node)) }
    Sub sub(self, other) { record(Operation::Sub(self.node, other.node)) }
    Mul mul(self, other) { record(Operation::Mul(self.node, other.node)) }
    Div div(self, other) { record(Operation::Div(self.node, other.node)) }
    -(self) { record(Operation::Neg(self.node)) }
}

impl Arithmetic for Recorded {
    fn from_f64(value: f64) -> Self {
        Self::constant(&value.into())
    }
}

macro_rules! recorded {
    ($($function:ident $operation:ident),*) => {$(
        fn $function(self) -> Self {
            record(Operation::$operation(self.node))
        }
    )*};
}

impl Elementary for Recorded {
    recorded!(tanh Tanh, exp Exp, sin Sin, cos Cos, sqrt Sqrt);
    recorded!(ln Ln, atan Atan, erf Erf, sign Sign);

    fn pi() -> Self {
        record(Operation::Pi)
    }
}

/// Replays a tape inside another recording: applies its function to symbolic numbers, keeps
/// parameters by name, and records only the operations that are asked for.
#[derive(Debug)]
pub struct Replay<'a> {
    tape: &'a Tape,
    values: Vec<Option<Recorded>>,
}

impl<'a> Replay<'a> {
    /// The function of `tape` at `x`.
    ///
    /// # Panics
    /// If `x` has not as many numbers as the function has variables.
    pub fn new(tape: &'a Tape, x: &[Recorded]) -> Self {
        assert_eq!(x.len(), tape.variables, "one number a variable");
        let mut values = vec![None; tape.operations.len()];
        for (value, x) in values.iter_mut().zip(x) {
            *value = Some(*x);
        }
        Self { tape, values }
    }

    /// Value `i` of the function.
    pub fn output(&mut self, i: usize) -> Recorded {
        self.node(self.tape.outputs[i])
    }

    /// The value of one operation of the tape.
    pub fn operation(&mut self, node: Node) -> Recorded {
        self.node(node)
    }

    /// Replaces the value of an operation, for all operations recorded after this call.
    pub fn set(&mut self, node: Node, value: Recorded) {
        self.values[node] = Some(value);
    }

    fn node(&mut self, wanted: Node) -> Recorded {
        // Depth first without recursion: a node is written when its arguments have been.
        let mut open = vec![wanted];
        while let Some(&node) = open.last() {
            if self.values[node].is_none() {
                let operation = self.tape.operations[node];
                // The left argument first, as the equation was written.
                if let Some(missing) = operation.arguments().find(|a| self.values[*a].is_none()) {
                    open.push(missing);
                    continue;
                }
                self.values[node] = Some(self.write(operation));
            }
            open.pop();
        }
        self.known(wanted)
    }

    fn known(&self, node: Node) -> Recorded {
        self.values[node].unwrap_or(Recorded { node })
    }

    fn write(&self, operation: Operation) -> Recorded {
        match operation {
            Operation::Parameter(i) => {
                let parameter = &self.tape.parameters[i];
                Recorded::parameter(&parameter.name, &parameter.value)
            }
            other => self.tape.apply(other, Recorded::constant, |node| self.known(node)),
        }
    }

    /// The derivatives of the function's values in the direction `dx` at the same point,
    /// symbolically, with the operations of [`Dual`](super::Dual) in their order; `None` is a
    /// derivative that is zero everywhere.
    ///
    /// # Panics
    /// If `dx` has not as many numbers as the function has variables.
    pub fn derivatives(&mut self, dx: &[Option<Recorded>]) -> Vec<Option<Recorded>> {
        assert_eq!(dx.len(), self.tape.variables, "one number a variable");
        let needed = self.tape.needed();
        let mut slopes: Vec<Option<Recorded>> = vec![None; self.tape.operations.len()];
        for node in 0..self.tape.operations.len() {
            if !needed[node] {
                continue;
            }
            let value = self.node(node);
            slopes[node] = match self.tape.operations[node] {
                Operation::Variable(i) => dx[i],
                operation => self.slope(operation, value, &slopes),
            };
        }
        self.tape.outputs.iter().map(|node| slopes[*node]).collect()
    }

    /// The derivative of one operation, whose value is `value`.
    fn slope(
        &self,
        operation: Operation,
        value: Recorded,
        slopes: &[Option<Recorded>],
    ) -> Option<Recorded> {
        let at = |node: Node| self.known(node);
        let one = Recorded::one;
        let two_over_root_pi = || Recorded::from_f64(2.0) / Recorded::pi().sqrt();
        let chain =
            |a: Node, factor: &dyn Fn(Recorded) -> Recorded| slopes[a].map(|p| p * factor(at(a)));
        match operation {
            Operation::Variable(_)
            | Operation::Constant(_)
            | Operation::Parameter(_)
            | Operation::Pi => None,
            Operation::Add(a, b) => match (slopes[a], slopes[b]) {
                (Some(p), Some(q)) => Some(p + q),
                (p, q) => p.or(q),
            },
            Operation::Sub(a, b) => match (slopes[a], slopes[b]) {
                // Of two fields that differ by a number, say.
                (Some(p), Some(q)) => (p != q).then(|| p - q),
                (p, q) => p.or(q.map(|q| -q)),
            },
            Operation::Mul(a, b) => match (slopes[a], slopes[b]) {
                (Some(p), Some(q)) => Some(p * at(b) + at(a) * q),
                (p, q) => p.map(|p| p * at(b)).or(q.map(|q| at(a) * q)),
            },
            Operation::Div(a, b) => match (slopes[a], slopes[b]) {
                (Some(p), Some(q)) => Some((p - value * q) / at(b)),
                (p, q) => p.map(|p| p / at(b)).or(q.map(|q| -(value * q) / at(b))),
            },
            Operation::Neg(a) => slopes[a].map(|p| -p),
            Operation::Tanh(a) => chain(a, &|_| one() - value * value),
            Operation::Exp(a) => chain(a, &|_| value),
            Operation::Ln(a) => chain(a, &|x| one() / x),
            Operation::Sin(a) => chain(a, &|x| x.cos()),
            Operation::Cos(a) => chain(a, &|x| -x.sin()),
            Operation::Sqrt(a) => chain(a, &|_| Recorded::from_f64(0.5) / value),
            Operation::Atan(a) => chain(a, &|x| one() / (one() + x * x)),
            Operation::Erf(a) => chain(a, &|x| (-(x * x)).exp() * two_over_root_pi()),
            Operation::Sign(_) => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{DoubleDouble, Dual, Scalar};
    use proptest::prelude::*;

    fn everything<S: Elementary>(x: S, y: S) -> [S; 3] {
        // In programs, pi is the f64.
        let pi = S::from_f64(std::f64::consts::PI);
        let c = S::from_f64(0.1);
        let r = x.squared() + y.squared();
        let shared = (c - y.scale(1e-3)) * r + S::one();
        let mut a = (x / S::from_f64(0.3)).tanh() * shared - (y.exp() / (r + S::one()).sqrt())
            + S::one() / (r + c);
        a += c * x;
        a -= y;
        let b = -(x * y).sin() + y.cos() * (r + c).ln() - x.atan() + (x - y).erf() + y.abs();
        [a, b + (pi - x).power(5) - S::one(), S::from_f64(2.5)]
    }

    fn tape() -> Tape {
        Tape::record(2, |v| everything(v[0], v[1]).to_vec())
    }

    fn program<S: Elementary>(program: &Program, x: S, y: S) -> [S; 3] {
        let mut out = [S::zero(); 3];
        program.evaluate(&[x, y], &mut out);
        out
    }

    proptest! {
        #[test]
        fn a_program_gives_the_bits_of_the_equation(x in -3.0..3.0_f64, y in -3.0..3.0_f64) {
            let p = Program::new(&tape());
            prop_assert_eq!(program(&p, x, y).map(f64::to_bits), everything(x,
                y).map(f64::to_bits));
            let (u, v) = (DoubleDouble::new(x, x * 1e-17), DoubleDouble::new(y, y * 1e-17));
            prop_assert_eq!(program(&p, u, v), everything(u, v));
            let (u, v) = (Dual::<f64, 2>::variable(x, 0), Dual::variable(y, 1));
            for (got, want) in program(&p, u, v).iter().zip(everything(u, v)) {
                prop_assert_eq!(got.value.to_bits(), want.value.to_bits());
                // Equal, but for the sign of a zero.
                prop_assert_eq!(got.partials, want.partials);
            }
        }

        #[test]
        fn symbolic_derivatives_are_those_of_dual_numbers(x in -3.0..3.0_f64, y in -3.0..3.0_f64) {
            let t = tape();
            let slopes = Tape::record(2, |v| {
                let d = Replay::new(&t, v).derivatives(&[Some(v[1]), Some(v[0] * v[1])]);
                d.into_iter().map(|d| d.unwrap_or(Recorded::zero())).collect()
            });
            let got = program(&Program::new(&slopes), x, y);
            let dual = |value, slope| Dual::<f64, 1> { value, partials: [slope] };
            let want = everything(dual(x, y), dual(y, x * y));
            for (got, want) in got.iter().zip(want) {
                prop_assert_eq!(*got, want.partials[0]);
            }
        }

        #[test]
        fn decimal_reading_is_close_to_binary(x in -3.0..3.0_f64, y in -3.0..3.0_f64) {
            for (d, b) in tape().evaluate_decimal(&[DoubleDouble::from_f64(x),
                DoubleDouble::from_f64(y)]).iter().zip(everything(x, y)) {
                prop_assert!((d.to_f64() - b).abs() < 1e-11 * (1.0 + b.abs()), "{:?} {}", d, b);
            }
        }
    }

    #[test]
    fn shared_terms_are_written_once() {
        let t = Tape::record(2, |x| vec![x[0] * x[1] + x[0], x[0] * x[1] - x[0].tanh()]);
        // Two variables, product, sum, tanh, difference.
        assert_eq!(t.operations().len(), 6);
        assert_eq!(t.tanh_count(), 1);
    }

    #[test]
    fn degrees_are_those_of_the_factors() {
        let degree = |f: fn(Recorded, Recorded) -> Recorded| {
            Tape::record(2, |v| vec![v[0], f(v[0], v[1])]).degree()
        };
        fn two() -> Recorded {
            Recorded::from_f64(2.0)
        }
        assert_eq!(degree(|x, y| x * (y + x * x) / two().sqrt() - y), Some(3));
        assert_eq!(degree(|x, _| (x - x) * x), Some(2));
        assert_eq!(degree(|_, _| two()), Some(1));
        assert_eq!(degree(|x, y| x / y), None);
        assert_eq!(degree(|x, _| x + x.sign()), None);
    }

    #[test]
    fn programs_leave_out_what_is_not_asked_for() {
        let t = tape();
        assert!(Program::new(&t.select([0])).instructions() < Program::new(&t).instructions());
        let constant = Program::new(&t.select([2]));
        assert_eq!((constant.instructions(), constant.registers()), (0, 2));
        let mut out = [0.0];
        constant.evaluate(&[1.0, 1.0], &mut out);
        assert_eq!(out, [2.5]);
        let coordinates = Program::new(&Tape::record(2, |x| vec![x[1], Recorded::one(), x[0]]));
        assert_eq!(program(&coordinates, 3.0, 5.0), [5.0, 1.0, 3.0]);
    }

    #[test]
    fn terms_without_variables_are_computed_once() {
        let t = Tape::record(1, |x| {
            let (m, g) =
                (Recorded::parameter("m", &2.0.into()), Recorded::parameter("gamma", &0.5.into()));
            vec![x[0] * (Recorded::from_f64(2.0) * m) + g.sin() / m]
        });
        // x times a number, plus a number: two operations, one instruction.
        assert_eq!(Program::new(&t).instructions(), 1);
        assert_eq!(t.parameters().len(), 2);
    }

    #[test]
    fn many_live_results_go_to_the_heap() {
        let sum = |x: &[f64]| x.iter().rev().fold(0.0, |s, x| s + x);
        let t = Tape::record(1, |x| {
            let mut terms = vec![x[0]];
            for i in 0..100 {
                terms.push(terms[i] * x[0] + Recorded::from_f64(i as f64));
            }
            vec![terms.iter().rev().fold(Recorded::zero(), |s, x| s + *x)]
        });
        let p = Program::new(&t);
        assert!(p.registers() > Program::ON_STACK);
        let mut terms = vec![0.7];
        for i in 0..100 {
            terms.push(terms[i] * 0.7 + i as f64);
        }
        let mut out = [0.0];
        p.evaluate(&[0.7], &mut out);
        assert_eq!(out[0].to_bits(), sum(&terms).to_bits());
    }

    #[test]
    fn a_recording_inside_a_recording() {
        let t = Tape::record(1, |x| {
            let inner = Tape::record(2, |y| vec![y[0] * y[1]]);
            let p = Recorded::parameter("p", &"0.1".parse().unwrap());
            let mut replay = Replay::new(&inner, &[x[0], p]);
            vec![replay.output(0) + x[0]]
        });
        let mut out = [0.0];
        Program::new(&t).evaluate(&[3.0], &mut out);
        assert_eq!(out[0], 3.0 * 0.1 + 3.0);
        assert_eq!(t.parameters()[0].name, "p");
    }

    /// The order in which an instruction takes its number and its register, for every operation and
    /// both sides.
    #[test]
    fn a_number_may_stand_on_either_side() {
        fn all<S: Elementary>(x: S) -> Vec<S> {
            let c = S::from_f64(2.5);
            vec![c + x, x + c, c - x, x - c, c * x, x * c, c / x, x / c, -(c / (x * x))]
        }
        let t = Tape::record(1, |v| all(v[0]));
        let slopes = Tape::record(1, |v| {
            let d = Replay::new(&t, v).derivatives(&[Some(Recorded::one())]);
            d.into_iter().map(|d| d.unwrap_or(Recorded::zero())).collect()
        });
        for x in [0.7, -3.0] {
            let mut out = [0.0; 9];
            Program::new(&t).evaluate(&[x], &mut out);
            assert_eq!(out.as_slice(), all(x));
            assert_eq!(t.evaluate_decimal(&[DoubleDouble::from_f64(x)]).len(), 9);
            for (d, v) in t.evaluate_decimal(&[DoubleDouble::from_f64(x)]).iter().zip(out) {
                assert!((d.to_f64() - v).abs() < 1e-15 * (1.0 + v.abs()));
            }
            Program::new(&slopes).evaluate(&[x], &mut out);
            let (one, square) = (1.0, x * x);
            let want = [one, one, -one, one, 2.5, 2.5, -2.5 / square, 0.4, 5.0 / (square * x)];
            for (got, want) in out.iter().zip(want) {
                assert!((got - want).abs() < 1e-14 * (1.0 + want.abs()), "{x}: {out:?}");
            }
        }
    }

    #[test]
    fn what_is_the_same_is_written_once_and_nothing_else() {
        let t = Tape::record(1, |v| {
            let number = |text: &str| Recorded::constant(&text.parse().unwrap());
            // 0 and -0 are two numbers; parameters of one name or of one value alone are two.
            let parameter = |name: &str, value: f64| Recorded::parameter(name, &value.into());
            let mut sum = v[0] * number("0.1");
            sum += number("0.1") * number("0.2");
            sum -= number("0") * number("-0");
            vec![
                sum,
                parameter("a", 1.0)
                    * parameter("a", 2.0)
                    * parameter("b", 1.0)
                    * parameter("a", 1.0),
                sum.tanh() + v[0].tanh(),
            ]
        });
        let constants: Vec<f64> = t.constants().iter().map(Decimal::value).collect();
        assert_eq!(
            constants.iter().map(|c| c.to_bits()).collect::<Vec<_>>(),
            [0.1, 0.2, 0.0, -0.0_f64].map(f64::to_bits)
        );
        let parameters: Vec<_> =
            t.parameters().iter().map(|p| (p.name.as_str(), p.value.value())).collect();
        assert_eq!(parameters, [("a", 1.0), ("a", 2.0), ("b", 1.0)]);
        assert_eq!((t.tanh_count(), t.variables()), (2, 1));
        let mut out = [0.0; 3];
        Program::new(&t).evaluate(&[3.0], &mut out);
        assert_eq!(out[..2], [3.0 * 0.1 + 0.1 * 0.2 - 0.0, 2.0]);
    }

    #[test]
    fn programs_are_alike_that_differ_in_numbers_alone() {
        let number = Recorded::from_f64;
        let program = |f: &dyn Fn(&[Recorded]) -> Vec<Recorded>| Program::new(&Tape::record(2, f));
        let one = program(&|v| vec![v[0] * number(0.3) + v[1], number(2.0)]);
        assert!(one.is_like(&program(&|v| vec![v[0] * number(0.4) + v[1], number(3.0)])));
        for other in [
            // Another operation, another variable, a value where there was a number, the values the
            // other way round.
            program(&|v| vec![v[0] * number(0.3) - v[1], number(2.0)]),
            program(&|v| vec![v[1] * number(0.3) + v[0], number(2.0)]),
            program(&|v| vec![v[0] * number(0.3) + v[1], v[0]]),
            program(&|v| vec![number(2.0), v[0] * number(0.3) + v[1]]),
            program(&|v| vec![v[0] * number(0.3) + v[1], number(2.0), number(1.0)]),
        ] {
            assert!(!one.is_like(&other) && !other.is_like(&one), "{other:?}");
        }
        assert!(!one.is_like(&Program::new(&Tape::record(3, |v| vec![
            v[0] * number(0.3) + v[1],
            number(2.0)
        ]))));
    }
}
