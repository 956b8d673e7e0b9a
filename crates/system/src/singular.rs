//! Where an equation has no value, or is not smooth: which of its operations is to blame, in the words of its file.

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
        Operation::Mul(a, b) if tape.operations()[b] == Operation::Sign(a) => call(Function::Abs, of(a)),
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

/// What has no value in the state `x`, in words: the first operation whose arguments have one and that has none itself.
pub fn undefined(tape: &Tape, x: &[f64]) -> Option<String> {
    let (values, needed) = (tape.values(x), tape.needed());
    let sound = |node: &Node| values[*node].is_finite();
    let culprit = (0..values.len()).find(|node| {
        needed[*node] && !sound(node) && tape.operations()[*node].arguments().all(|argument| sound(&argument))
    })?;
    let text = |node| written(tape, node);
    Some(match tape.operations()[culprit] {
        Operation::Sqrt(a) => format!("{} has no value where {} is negative", text(culprit), text(a)),
        Operation::Ln(a) => format!("{} has no value where {} is not positive", text(culprit), text(a)),
        Operation::Div(_, b) if values[b] == 0.0 => {
            format!("{} has no value: division by zero, {} being 0", text(culprit), text(b))
        }
        Operation::Variable(_) => return None,
        _ => return Some(format!("{} is beyond the range of numbers", text(culprit))),
    })
}

/// Whether an operation is undefined beyond a value of its argument, and not only too large.
pub fn leaves_domain(tape: &Tape, x: &[f64]) -> Option<String> {
    let values = tape.values(x);
    let ends = tape.operations().iter().any(|operation| match *operation {
        Operation::Sqrt(a) => values[a] < 0.0,
        Operation::Ln(a) => values[a] <= 0.0,
        Operation::Div(a, b) => values[b] == 0.0 && values[a].is_finite(),
        _ => false,
    });
    if ends { undefined(tape, x) } else { None }
}
