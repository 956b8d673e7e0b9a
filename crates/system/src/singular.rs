//! Names the operation at which an equation is undefined or not smooth, in the notation of its
//! file.

use std::sync::Arc;

use super::expression::{Expression, Function};
use twofold_num::Decimal;
use twofold_num::tape::{Node, Operation, Tape};

/// Operations that a text may have before it is cut.
const LONGEST: usize = 40;

/// An operation of an equation as a text: `sqrt(x^2 + 1)`, `abs(v - belt)`.
pub fn written(tape: &Tape, node: Node) -> String {
    expression(tape, node, &mut LONGEST.clone()).to_string()
}

/// The same of a sign; where it makes an absolute value, that.
pub fn written_sign(tape: &Tape, sign: Node) -> String {
    let makes = |operation: &Operation| match *operation {
        Operation::Mul(a, b) => b == sign && tape.operations()[sign] == Operation::Sign(a),
        _ => false,
    };
    written(tape, tape.operations().iter().position(makes).unwrap_or(sign))
}

fn expression(tape: &Tape, node: Node, left: &mut usize) -> Expression {
    if *left == 0 {
        return Expression::Name("...".into());
    }
    *left -= 1;
    let mut of = |node: Node| Box::new(expression(tape, node, left));
    let call = |function, a| Expression::Call(function, a);
    match tape.operations()[node] {
        Operation::Variable(i) => Expression::Name(tape.name(i)),
        Operation::Constant(i) => number(&tape.constants()[i]),
        Operation::Parameter(i) => Expression::Name(tape.parameters()[i].name.clone()),
        Operation::Pi => Expression::Pi,
        Operation::Add(a, b) => Expression::Add(of(a), of(b)),
        Operation::Sub(a, b) => Expression::Sub(of(a), of(b)),
        Operation::Mul(a, b) if tape.operations()[b] == Operation::Sign(a) => {
            call(Function::Abs, of(a))
        }
        Operation::Mul(a, b) => product(*of(a), *of(b)),
        Operation::Div(a, b) => match (tape.operations()[a], tape.operations()[b]) {
            (Operation::Sin(c), Operation::Cos(d)) if c == d => call(Function::Tan, of(c)),
            _ => Expression::Div(of(a), of(b)),
        },
        Operation::Neg(a) => Expression::Neg(of(a)),
        Operation::Tanh(a) => call(Function::Tanh, of(a)),
        Operation::Exp(a) => call(Function::Exp, of(a)),
        Operation::Ln(a) => call(Function::Ln, of(a)),
        Operation::Sin(a) => call(Function::Sin, of(a)),
        Operation::Cos(a) => call(Function::Cos, of(a)),
        Operation::Sqrt(a) => call(Function::Sqrt, of(a)),
        Operation::Atan(a) => call(Function::Atan, of(a)),
        Operation::Erf(a) => call(Function::Erf, of(a)),
        Operation::Sign(a) => call(Function::Sign, of(a)),
    }
}

fn number(value: &Decimal) -> Expression {
    if value.value() < 0.0 {
        Expression::Neg(Box::new(Expression::Number(Decimal::from(-value.value()))))
    } else {
        Expression::Number(value.clone())
    }
}

/// A product; powers are recorded as such.
fn product(a: Expression, b: Expression) -> Expression {
    let parts = |e: Expression| match e {
        Expression::Power(base, n) if n > 0 => (*base, n),
        other => (other, 1),
    };
    let ((base, n), (other, m)) = (parts(a.clone()), parts(b.clone()));
    if base == other && !matches!(base, Expression::Number(_)) {
        Expression::Power(Box::new(base), n + m)
    } else {
        Expression::Mul(Box::new(a), Box::new(b))
    }
}

/// The first operation that is undefined in the state `x` although its arguments are defined, as
/// text.
pub fn undefined(tape: &Tape, x: &[f64]) -> Option<String> {
    let (values, needed) = (tape.values(x), tape.needed());
    let sound = |node: &Node| values[*node].is_finite();
    let culprit = (0..values.len()).find(|node| {
        needed[*node]
            && !sound(node)
            && tape.operations()[*node].arguments().all(|argument| sound(&argument))
    })?;
    match tape.operations()[culprit] {
        Operation::Variable(_) => None,
        Operation::Div(_, b) if values[b] != 0.0 => Some(too_large(tape, culprit)),
        _ => Some(without_value(tape, culprit)),
    }
}

fn too_large(tape: &Tape, node: Node) -> String {
    format!("{} is beyond the range of numbers", written(tape, node))
}

/// Condition under which an operation has no value, in words.
fn without_value(tape: &Tape, node: Node) -> String {
    let text = |node| written(tape, node);
    match tape.operations()[node] {
        Operation::Sqrt(a) => format!("{} has no value where {} is negative", text(node), text(a)),
        Operation::Ln(a) => {
            format!("{} has no value where {} is not positive", text(node), text(a))
        }
        Operation::Div(_, b) => {
            format!("{} has no value: division by zero, {} being 0", text(node), text(b))
        }
        _ => too_large(tape, node),
    }
}

/// The operations that have no value beyond a zero of some number: a root's or a logarithm's
/// argument, and of a quotient the divisor or what it is a power of.
#[derive(Clone, Debug)]
pub struct Ends {
    tape: Arc<Tape>,
    /// Each with that number.
    ends: Vec<(Node, Node)>,
}

/// Halvings that find the end of a domain between two places.
const HALVINGS: usize = 60;
/// Of two places before a zero one is so many times nearer than the other.
const NEARER: f64 = 64.0;
/// An equation that is by so much larger at the nearer one is not bounded at the zero.
const LARGER: f64 = 4.0;

impl Ends {
    /// Of the equation on a tape. None, if its domain has no such ends.
    pub fn new(tape: Arc<Tape>) -> Option<Self> {
        let (needed, powers) = (tape.needed(), tape.powers());
        let number = |node: Node| match tape.operations()[node] {
            Operation::Sqrt(a) | Operation::Ln(a) => Some((node, a)),
            Operation::Div(_, b) => Some((node, powers[b].0)),
            _ => None,
        };
        let fixed = |node: Node| {
            matches!(tape.operations()[node], Operation::Constant(_) | Operation::Parameter(_))
        };
        let nodes = (0..tape.operations().len()).filter(|node| needed[*node]);
        let ends: Vec<_> = nodes.filter_map(number).filter(|(_, a)| !fixed(*a)).collect();
        (!ends.is_empty()).then_some(Self { tape, ends })
    }

    /// First end of the domain on a path of states, between neighbouring `places`, and the
    /// operation that has no value there, in words. A zero of a divisor is no end where the
    /// equation is bounded about it.
    pub fn first(&self, path: &dyn Fn(f64) -> Vec<f64>, places: &[f64]) -> Option<(f64, String)> {
        let at = |place: f64| self.tape.values(&path(place));
        let mut before = at(*places.first()?);
        for pair in places.windows(2) {
            let after = at(pair[1]);
            let changes = |(node, a): &&(Node, Node)| {
                let sides = [before[*a], after[*a]];
                !sides.iter().any(|v| v.is_nan())
                    && self.inside(*node, sides[0]) != self.inside(*node, sides[1])
            };
            let ends = self.ends.iter().filter(changes);
            let ends = ends.filter_map(|(node, a)| {
                Some((self.end((*node, *a), &at, pair[0], pair[1])?, *node))
            });
            if let Some((place, node)) = ends.min_by(|(a, _), (b, _)| a.total_cmp(b)) {
                return Some((place, without_value(&self.tape, node)));
            }
            before = after;
        }
        None
    }

    /// Whether an operation has a value where the number is `v`; of a quotient, on which side of
    /// the pole it is.
    fn inside(&self, node: Node, v: f64) -> bool {
        v > 0.0 || v == 0.0 && matches!(self.tape.operations()[node], Operation::Sqrt(_))
    }

    /// The last place before the number `a` leaves its side, if the operation's domain ends there.
    fn end(
        &self,
        (node, a): (Node, Node),
        at: &dyn Fn(f64) -> Vec<f64>,
        from: f64,
        to: f64,
    ) -> Option<f64> {
        let side = self.inside(node, at(from)[a]);
        let (mut low, mut high) = (from, to);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            if self.inside(node, at(middle)[a]) == side {
                low = middle;
            } else {
                high = middle;
            }
        }
        let sizes = |values: &[f64]| -> Vec<f64> {
            self.tape.outputs().iter().map(|o| values[*o].abs()).collect()
        };
        let beyond = at(high);
        if !matches!(self.tape.operations()[node], Operation::Div(..)) {
            return sizes(&at(to))
                .iter()
                .chain(&sizes(&beyond))
                .any(|size| size.is_nan())
                .then_some(low);
        }
        let is_pole = |values: &[f64]| {
            values[node].is_infinite() && sizes(values).iter().any(|size| !size.is_finite())
        };
        if is_pole(&at(low)) || is_pole(&beyond) {
            return Some(low);
        }
        // Two places before the zero, one well nearer than the other, as far as numbers tell them
        // apart.
        let mut back = high - low;
        let mut near = at(low);
        loop {
            let place = (high - back).max(from);
            let far = at(place);
            if near[a] == 0.0 && place > from {
                near = far;
            } else if far[a].abs() >= NEARER * near[a].abs() || place <= from {
                return sizes(&near)
                    .iter()
                    .zip(&sizes(&far))
                    .any(|(near, far)| *near > LARGER * far)
                    .then_some(low);
            }
            back *= 2.0;
        }
    }
}
