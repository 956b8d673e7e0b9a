//! Expressions as people write them: `(alpha - beta*y)*(x^2 + y^2 + z^2)`.
//!
//! ```text
//! sum      = product { ("+" | "-") product }          from the left: a - b + c = (a - b) + c
//! product  = unary { ("*" | "/") unary }              from the left: a/b*c = (a/b)*c
//! unary    = ("-" | "+") unary | power                -x^2 = -(x^2),  -a*b = (-a)*b
//! power    = atom [ "^" unary ]                       from the right: x^2^3 = x^(2^3);
//!                                                     whole-number exponents only
//! atom     = number | name | "pi" | function "(" sum ")" | "(" sum ")"
//! ```
//!
//! The expressions of a [general system](Expression::parse_general) also compare, choose and round:
//!
//! ```text
//! either   = both { "or" both }                       begins a general expression, also in ( )
//! both     = negation { "and" negation }
//! negation = "not" negation | compare
//! compare  = sum [ ("<" | "<=" | ">" | ">=") sum ]    as a number: true is 1, false is 0
//! atom     = ... | function "(" either { "," either } ")"
//! ```
//!
//! **Order of operations decides bits**, so it is part of the format: exactly the operations that
//! are written are done, in this order, each rounded once. Powers are products in the order of
//! [`Elementary::power`], `abs(a)` is a times its sign, `tan(a)` is sin(a)/cos(a). Terms without
//! state variables are computed once, in double precision.

use std::fmt;
use std::ops::Range;

use super::diagnostic::nearest;
use twofold_num::{Decimal, Elementary};

/// Maximum length of an expression, in bytes.
pub const MAX_LENGTH: usize = 4096;
/// Maximum number of operations, numbers and names in an expression.
pub const MAX_TERMS: usize = 1000;
/// Maximum nesting of parentheses, signs and exponents.
pub const MAX_DEPTH: usize = 64;
/// Maximum modulus of an exponent.
pub const MAX_EXPONENT: i32 = 64;

/// A function of one argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    /// Hyperbolic tangent.
    Tanh,
    /// Exponential.
    Exp,
    /// Natural logarithm.
    Ln,
    /// Sine of an angle in radians.
    Sin,
    /// Cosine of an angle in radians.
    Cos,
    /// Tangent of an angle in radians.
    Tan,
    /// Square root.
    Sqrt,
    /// Arc tangent.
    Atan,
    /// Error function.
    Erf,
    /// Absolute value.
    Abs,
    /// -1 below zero, +1 from zero on.
    Sign,
}

impl Function {
    /// Every function with its name.
    pub const ALL: [(&'static str, Function); 11] = [
        ("tanh", Function::Tanh),
        ("exp", Function::Exp),
        ("ln", Function::Ln),
        ("sin", Function::Sin),
        ("cos", Function::Cos),
        ("tan", Function::Tan),
        ("sqrt", Function::Sqrt),
        ("atan", Function::Atan),
        ("erf", Function::Erf),
        ("abs", Function::Abs),
        ("sign", Function::Sign),
    ];

    fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().find(|(n, _)| *n == name).map(|(_, f)| *f)
    }

    fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, f)| *f == self).map_or("", |(n, _)| *n)
    }

    /// Its value.
    pub fn apply<S: Elementary>(self, a: S) -> S {
        match self {
            Function::Tanh => a.tanh(),
            Function::Exp => a.exp(),
            Function::Ln => a.ln(),
            Function::Sin => a.sin(),
            Function::Cos => a.cos(),
            Function::Tan => a.sin() / a.cos(),
            Function::Sqrt => a.sqrt(),
            Function::Atan => a.atan(),
            Function::Erf => a.erf(),
            Function::Abs => a.abs(),
            Function::Sign => a.sign(),
        }
    }
}

/// A function of general systems ([`Expression::parse_general`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum General {
    /// The least of two or more.
    Min,
    /// The greatest of two or more.
    Max,
    /// `if(condition, a, b)`: a where the condition holds, else b.
    If,
    /// 1 from zero on, else 0.
    Heaviside,
    /// The greatest whole number that is not greater.
    Floor,
    /// `mod(a, b)` = a - b floor(a/b), from 0 to b.
    Mod,
    /// `clip(x, low, high)`: the number between the bounds that is nearest to x.
    Clip,
    /// `atan2(y, x)`: the angle of the point (x, y), from -pi to pi.
    Atan2,
    /// Hyperbolic sine.
    Sinh,
    /// Hyperbolic cosine.
    Cosh,
    /// Arc sine.
    Asin,
    /// Arc cosine.
    Acos,
    /// Logarithm to base 10.
    Log10,
    /// Natural logarithm, as [`Function::Ln`].
    Log,
}

impl General {
    /// Every function with its name and the numbers of arguments that it takes.
    pub const ALL: [(&'static str, General, Range<usize>); 14] = [
        ("min", General::Min, 2..64),
        ("max", General::Max, 2..64),
        ("if", General::If, 3..4),
        ("heaviside", General::Heaviside, 1..2),
        ("floor", General::Floor, 1..2),
        ("mod", General::Mod, 2..3),
        ("clip", General::Clip, 3..4),
        ("atan2", General::Atan2, 2..3),
        ("sinh", General::Sinh, 1..2),
        ("cosh", General::Cosh, 1..2),
        ("asin", General::Asin, 1..2),
        ("acos", General::Acos, 1..2),
        ("log10", General::Log10, 1..2),
        ("log", General::Log, 1..2),
    ];

    fn entry(name: &str) -> Option<&'static (&'static str, General, Range<usize>)> {
        Self::ALL.iter().find(|(n, ..)| *n == name)
    }

    /// Its name.
    pub fn name(self) -> &'static str {
        Self::ALL.iter().find(|(_, f, _)| *f == self).map_or("", |(n, ..)| *n)
    }
}

/// Dialect of expressions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Dialect {
    /// Of h, f+ and f-.
    Smooth,
    /// Of general systems.
    General,
}

const COMMA: &str = "a comma has no meaning here";

/// Functions that other languages have, and how they are written here.
const INSTEAD: [(&str, &str); 30] = [
    ("max", "max(a, b) = (a + b + abs(a - b))/2"),
    ("min", "min(a, b) = (a + b - abs(a - b))/2"),
    ("mod", PHASE),
    ("fmod", PHASE),
    ("rem", PHASE),
    ("floor", PHASE),
    ("ceil", PHASE),
    ("round", PHASE),
    ("log", "ln(x) is the natural logarithm"),
    ("log10", "log10(x) = ln(x)/ln(10)"),
    ("log2", "log2(x) = ln(x)/ln(2)"),
    ("sinh", "sinh(x) = (exp(x) - exp(-x))/2"),
    ("cosh", "cosh(x) = (exp(x) + exp(-x))/2"),
    ("arctan", "write atan(x)"),
    ("atan2", "atan2(y, x) = 2*atan(y/(sqrt(x^2 + y^2) + x)), away from the negative x axis"),
    ("asin", "asin(x) = atan(x/sqrt(1 - x^2))"),
    ("arcsin", "asin(x) = atan(x/sqrt(1 - x^2))"),
    ("acos", "acos(x) = pi/2 - atan(x/sqrt(1 - x^2))"),
    ("arccos", "acos(x) = pi/2 - atan(x/sqrt(1 - x^2))"),
    ("sgn", "write sign(x)"),
    ("signum", "write sign(x)"),
    ("fabs", "write abs(x)"),
    ("pow", "powers are written x^2, or exp(p*ln(x)) where p is no whole number"),
    ("cbrt", "cbrt(x) = sign(x)*exp(ln(abs(x))/3)"),
    ("hypot", "hypot(a, b) = sqrt(a^2 + b^2)"),
    ("heaviside", "heaviside(x) = (1 + sign(x))/2; better: make x the switching function h"),
    ("step", "step(x) = (1 + sign(x))/2; better: make x the switching function h"),
    ("if", BRANCH),
    ("sat", "the saturation of x at -1 and 1 is (abs(x + 1) - abs(x - 1))/2"),
    ("clip", "x between a and b: (a + b + abs(x - a) - abs(x - b))/2"),
];
const BRANCH: &str = "expressions do not branch: f+ and f- are given apart, h says which one holds";
const PHASE: &str = "carry a phase as two states, its cosine c and sine s (c' = -w*s, s' = w*c); \
    the angle is 2*atan(s/(1 + c))";

/// The same in general systems, which have most of them.
const INSTEAD_IN_GENERAL: [(&str, &str); 14] = [
    ("fmod", "write mod(a, b), which has the sign of b"),
    ("rem", "write mod(a, b), which has the sign of b"),
    ("ceil", "ceil(x) = -floor(-x)"),
    ("round", "round(x) = floor(x + 0.5)"),
    ("log2", "log2(x) = ln(x)/ln(2)"),
    ("arctan", "write atan(x)"),
    ("arcsin", "write asin(x)"),
    ("arccos", "write acos(x)"),
    ("sgn", "write sign(x)"),
    ("signum", "write sign(x)"),
    ("fabs", "write abs(x)"),
    ("pow", "powers are written x^p"),
    ("step", "write heaviside(x)"),
    ("sat", "write clip(x, -1, 1)"),
];

/// Whether `name` means something in every expression.
pub fn is_reserved(name: &str) -> bool {
    name == "pi" || Function::named(name).is_some()
}

/// Whether `name` means something in every expression of a general system.
pub fn is_reserved_in_general(name: &str) -> bool {
    is_reserved(name) || General::entry(name).is_some() || ["t", "and", "or", "not"].contains(&name)
}

/// Whether `name` is a letter followed by letters, digits and underscores.
pub fn is_name(name: &str) -> bool {
    name.starts_with(|c: char| c.is_ascii_alphabetic())
        && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
}

/// An expression.
///
/// ```
/// use twofold_num::Decimal;
/// use twofold_system::Expression;
/// let e = Expression::parse("a*x^2 - 1", &["a", "x"]).unwrap();
/// let mut names = |name: &str| if name == "a" { 2.0 } else { 3.0 };
/// let value = e.evaluate(&mut names, &|n: &Decimal| n.value());
/// assert_eq!(value, 17.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub enum Expression {
    /// A number without a sign.
    Number(Decimal),
    /// pi.
    Pi,
    /// A state, parameter or intermediate term.
    Name(String),
    /// Negative.
    Neg(Box<Expression>),
    /// Sum.
    Add(Box<Expression>, Box<Expression>),
    /// Difference.
    Sub(Box<Expression>, Box<Expression>),
    /// Product.
    Mul(Box<Expression>, Box<Expression>),
    /// Quotient.
    Div(Box<Expression>, Box<Expression>),
    /// Integer power.
    Power(Box<Expression>, i32),
    /// A function's value.
    Call(Function, Box<Expression>),
    /// A power whose exponent is no whole number (general systems only, as all that follow).
    RealPower(Box<Expression>, Box<Expression>),
    /// A function of general systems.
    Apply(General, Vec<Expression>),
    /// Whether the first is greater than the second.
    Greater(Box<Expression>, Box<Expression>),
    /// Whether both hold.
    And(Box<Expression>, Box<Expression>),
    /// Whether one holds.
    Or(Box<Expression>, Box<Expression>),
    /// Whether it does not hold.
    Not(Box<Expression>),
}

/// An error of an expression, and its place in the text.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{message}")]
pub struct ExpressionError {
    /// The message.
    pub message: String,
    /// Place of the error: bytes of the expression's text.
    pub span: Range<usize>,
    /// Advice.
    pub help: Option<String>,
}

impl Expression {
    /// Reads an expression in which the given names may appear.
    ///
    /// # Errors
    /// If the text is no expression, names something unknown, or is beyond the bounds of this
    /// module.
    pub fn parse(text: &str, names: &[&str]) -> Result<Self, ExpressionError> {
        Self::parse_in(text, names, &[], Dialect::Smooth)
    }

    /// Reads an expression of a general system, in which names, `t`, [`General`] functions,
    /// comparisons and `and`, `or`, `not` may appear.
    ///
    /// # Errors
    /// As [`Expression::parse`]; also if a condition stands where a number is wanted by `and`,
    /// `or`, `not` or `if`, or the other way round.
    ///
    /// ```
    /// use twofold_system::Expression;
    /// let text = "if(x > 0 and t < 1, min(x, 1), -x^0.5)";
    /// let clamped = Expression::parse_general(text, &["x"]).unwrap();
    /// assert_eq!(clamped.to_string(), "if(x > 0 and 1 > t, min(x, 1), -x^0.5)");
    /// ```
    pub fn parse_general(text: &str, names: &[&str]) -> Result<Self, ExpressionError> {
        Self::parse_in(text, names, &[], Dialect::General)
    }

    /// As [`Expression::parse_general`], where some of the names stand for conditions.
    ///
    /// # Errors
    /// As [`Expression::parse_general`].
    pub fn parse_general_with(
        text: &str,
        names: &[&str],
        conditions: &[&str],
    ) -> Result<Self, ExpressionError> {
        Self::parse_in(text, names, conditions, Dialect::General)
    }

    fn parse_in(
        text: &str,
        names: &[&str],
        conditions: &[&str],
        dialect: Dialect,
    ) -> Result<Self, ExpressionError> {
        if text.len() > MAX_LENGTH {
            return Err(ExpressionError {
                message: format!(
                    "an expression of {} bytes; the limit is {MAX_LENGTH}",
                    text.len()
                ),
                span: 0..1,
                help: Some("name parts of it in [let]".into()),
            });
        }
        let mut parser = Parser {
            text,
            tokens: tokens(text, dialect)?,
            at: 0,
            depth: 0,
            terms: 0,
            names,
            conditions,
            dialect,
        };
        if parser.peek() == &Token::End {
            return Err(parser.error(
                "an empty expression",
                Some("write 0 for a component that vanishes".into()),
            ));
        }
        let expression = parser.whole_expression()?;
        match parser.peek() {
            Token::End => Ok(expression),
            Token::Close => Err(parser.error("this parenthesis was never opened", None)),
            Token::Comma => {
                Err(parser.error(COMMA, Some("the decimal sign is a point: 1.5".into())))
            }
            _ => Err(parser.error("an operator is missing here", Some(parser.missing_operator()))),
        }
    }

    /// The value, with `name` giving the value of each name and `number` that of each number.
    pub fn evaluate<S: Elementary>(
        &self,
        name: &mut dyn FnMut(&str) -> S,
        number: &dyn Fn(&Decimal) -> S,
    ) -> S {
        match self {
            Expression::Number(n) => number(n),
            Expression::Pi => S::pi(),
            Expression::Name(n) => name(n),
            Expression::Neg(a) => -a.evaluate(name, number),
            Expression::Add(a, b) => a.evaluate(name, number) + b.evaluate(name, number),
            Expression::Sub(a, b) => a.evaluate(name, number) - b.evaluate(name, number),
            Expression::Mul(a, b) => a.evaluate(name, number) * b.evaluate(name, number),
            Expression::Div(a, b) => a.evaluate(name, number) / b.evaluate(name, number),
            Expression::Power(a, n) => a.evaluate(name, number).power(*n),
            Expression::Call(f, a) => f.apply(a.evaluate(name, number)),
            // Those of general systems are evaluated where it is known which way they go.
            _ => S::from_f64(f64::NAN),
        }
    }

    /// Whether it is a condition: true or false.
    pub fn is_condition(&self) -> bool {
        matches!(
            self,
            Expression::Greater(..) | Expression::And(..) | Expression::Or(..) | Expression::Not(_)
        )
    }

    /// Its parts, in order.
    pub fn parts(&self) -> Vec<&Expression> {
        match self {
            Expression::Number(_) | Expression::Pi | Expression::Name(_) => Vec::new(),
            Expression::Neg(a)
            | Expression::Power(a, _)
            | Expression::Call(_, a)
            | Expression::Not(a) => vec![a],
            Expression::Add(a, b)
            | Expression::Sub(a, b)
            | Expression::Mul(a, b)
            | Expression::Div(a, b) => vec![a, b],
            Expression::RealPower(a, b)
            | Expression::Greater(a, b)
            | Expression::And(a, b)
            | Expression::Or(a, b) => {
                vec![a, b]
            }
            Expression::Apply(_, list) => list.iter().collect(),
        }
    }

    /// The same, with each part, from the innermost on, as `change` makes it.
    #[must_use]
    pub fn map(&self, change: &dyn Fn(Self) -> Self) -> Self {
        let of = |e: &Expression| Box::new(e.map(change));
        change(match self {
            Expression::Number(_) | Expression::Pi | Expression::Name(_) => self.clone(),
            Expression::Neg(a) => Expression::Neg(of(a)),
            Expression::Power(a, n) => Expression::Power(of(a), *n),
            Expression::Call(f, a) => Expression::Call(*f, of(a)),
            Expression::Not(a) => Expression::Not(of(a)),
            Expression::Add(a, b) => Expression::Add(of(a), of(b)),
            Expression::Sub(a, b) => Expression::Sub(of(a), of(b)),
            Expression::Mul(a, b) => Expression::Mul(of(a), of(b)),
            Expression::Div(a, b) => Expression::Div(of(a), of(b)),
            Expression::RealPower(a, b) => Expression::RealPower(of(a), of(b)),
            Expression::Greater(a, b) => Expression::Greater(of(a), of(b)),
            Expression::And(a, b) => Expression::And(of(a), of(b)),
            Expression::Or(a, b) => Expression::Or(of(a), of(b)),
            Expression::Apply(f, list) => {
                Expression::Apply(*f, list.iter().map(|e| e.map(change)).collect())
            }
        })
    }

    /// The names in the expression, in order of appearance, repeated where they are.
    pub fn names(&self) -> Vec<&str> {
        match self {
            Expression::Name(name) => vec![name],
            _ => self.parts().into_iter().flat_map(Expression::names).collect(),
        }
    }

    /// The precedence of the expression's outermost operation.
    fn level(&self) -> u8 {
        match self {
            Expression::Or(..) => 1,
            Expression::And(..) => 2,
            Expression::Not(_) => 3,
            Expression::Greater(..) => 4,
            Expression::Add(..) | Expression::Sub(..) => SUM,
            Expression::Mul(..) | Expression::Div(..) => PRODUCT,
            Expression::Neg(_) => SIGN,
            Expression::Power(..) | Expression::RealPower(..) => SIGN + 1,
            _ => ATOM,
        }
    }
}

/// Precedences of sums, products, signs and atoms.
const SUM: u8 = 5;
const PRODUCT: u8 = 6;
const SIGN: u8 = 7;
const ATOM: u8 = 9;

impl fmt::Display for Expression {
    /// The expression with the fewest parentheses. Parsing it gives the expression back.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let part = |f: &mut fmt::Formatter<'_>, e: &Expression, level: u8| {
            if e.level() < level { write!(f, "({e})") } else { write!(f, "{e}") }
        };
        let pair =
            |f: &mut fmt::Formatter<'_>, a: &Expression, sign: &str, b: &Expression, level: u8| {
                part(f, a, level)?;
                f.write_str(sign)?;
                part(f, b, level + 1)
            };
        match self {
            Expression::Number(n) => write!(f, "{n}"),
            Expression::Pi => f.write_str("pi"),
            Expression::Name(name) => f.write_str(name),
            Expression::Neg(a) => {
                f.write_str("-")?;
                part(f, a, SIGN)
            }
            Expression::Add(a, b) => pair(f, a, " + ", b, SUM),
            Expression::Sub(a, b) => pair(f, a, " - ", b, SUM),
            Expression::Mul(a, b) => pair(f, a, "*", b, PRODUCT),
            Expression::Div(a, b) => pair(f, a, "/", b, PRODUCT),
            Expression::Power(a, n) => {
                part(f, a, ATOM)?;
                write!(f, "^{n}")
            }
            Expression::RealPower(a, b) => {
                part(f, a, ATOM)?;
                f.write_str("^")?;
                part(f, b, SIGN)
            }
            Expression::Call(function, a) => write!(f, "{}({a})", function.name()),
            Expression::Apply(function, list) => {
                let list: Vec<String> = list.iter().map(Expression::to_string).collect();
                write!(f, "{}({})", function.name(), list.join(", "))
            }
            Expression::Greater(a, b) => {
                part(f, a, SUM)?;
                f.write_str(" > ")?;
                part(f, b, SUM)
            }
            Expression::And(a, b) => pair(f, a, " and ", b, 2),
            Expression::Or(a, b) => pair(f, a, " or ", b, 1),
            Expression::Not(a) => {
                f.write_str("not ")?;
                part(f, a, 3)
            }
        }
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Token {
    Number(Decimal),
    Name,
    Plus,
    Minus,
    Times,
    Over,
    Hat,
    Open,
    Close,
    Comma,
    Compare { less: bool, equal: bool },
    End,
}

/// The text cut into tokens, each with its place; an [`Token::End`] closes them.
fn tokens(text: &str, dialect: Dialect) -> Result<Vec<(Token, Range<usize>)>, ExpressionError> {
    let mut tokens = Vec::new();
    let bytes = text.as_bytes();
    let run = |from: usize, in_run: &dyn Fn(u8) -> bool| {
        from + bytes[from..].iter().take_while(|b| in_run(**b)).count()
    };
    let digits = |from: usize| run(from, &|b| b.is_ascii_digit());
    let mut at = 0;
    while at < bytes.len() {
        let (token, end) = match bytes[at] {
            b' ' | b'\t' | b'\n' | b'\r' => {
                at += 1;
                continue;
            }
            b'+' => (Token::Plus, at + 1),
            b'-' => (Token::Minus, at + 1),
            b'*' if bytes.get(at + 1) == Some(&b'*') => {
                return Err(ExpressionError {
                    message: "`**` is not an operator".into(),
                    span: at..at + 2,
                    help: Some("powers are written x^2".into()),
                });
            }
            b'*' => (Token::Times, at + 1),
            b'/' => (Token::Over, at + 1),
            b'^' => (Token::Hat, at + 1),
            b'(' => (Token::Open, at + 1),
            b')' => (Token::Close, at + 1),
            b',' => (Token::Comma, at + 1),
            b @ (b'<' | b'>') if dialect == Dialect::General => {
                let equal = bytes.get(at + 1) == Some(&b'=');
                (Token::Compare { less: b == b'<', equal }, at + 1 + usize::from(equal))
            }
            b'=' | b'!' if dialect == Dialect::General => {
                return Err(ExpressionError {
                    message: "equality is met for a moment only and decides no motion".into(),
                    span: at..at + 1,
                    help: Some(
                        "compare with < or >; for what happens where a number is met, write an \
                            [[event]]"
                            .into(),
                    ),
                });
            }
            b'0'..=b'9' | b'.' => {
                let mut end = digits(at);
                if bytes.get(end) == Some(&b'.') {
                    end = digits(end + 1);
                }
                if matches!(bytes.get(end), Some(b'e' | b'E')) {
                    let sign = usize::from(matches!(bytes.get(end + 1), Some(b'+' | b'-')));
                    let exponent = digits(end + 1 + sign);
                    if exponent > end + 1 + sign {
                        end = exponent;
                    } else {
                        return Err(ExpressionError {
                            message: "a number without the digits of its exponent".into(),
                            span: at..end + 1 + sign,
                            help: Some(
                                "write 1e-3 for one thousandth, 2*e for the product with a name e"
                                    .into(),
                            ),
                        });
                    }
                }
                match text[at..end].parse() {
                    Ok(number) => (Token::Number(number), end),
                    Err(error) => {
                        return Err(ExpressionError {
                            message: error.to_string(),
                            span: at..end.max(at + 1),
                            help: None,
                        });
                    }
                }
            }
            b if b.is_ascii_alphabetic() || b == b'_' => {
                (Token::Name, run(at, &|b| b.is_ascii_alphanumeric() || b == b'_'))
            }
            _ => {
                let c = text[at..].chars().next().unwrap_or(' ');
                let help = match c {
                    '|' | '&' if dialect == Dialect::General => {
                        Some("write abs(x) for |x|; conditions are joined by `and` and `or`")
                    }
                    '?' if dialect == Dialect::General => Some("write if(condition, a, b)"),
                    '|' => Some("write abs(x) for |x|"),
                    '\'' => Some(
                        "components are given in the order of the states; write no derivatives",
                    ),
                    '[' | ']' | '{' | '}' => Some("only round parentheses group"),
                    '<' | '>' | '=' | '?' => Some(BRANCH),
                    '·' | '×' => Some("products are written a*b"),
                    '−' => Some("this is a typographic minus; write -"),
                    'π' => Some("write pi"),
                    '²' | '³' => Some("write x^2, x^3"),
                    c if c.is_alphabetic() => {
                        Some("names are made of the letters a-z and A-Z, digits and _")
                    }
                    _ => None,
                };
                return Err(ExpressionError {
                    message: format!("the character {c:?} has no meaning here"),
                    span: at..at + c.len_utf8(),
                    help: help.map(Into::into),
                });
            }
        };
        tokens.push((token, at..end));
        at = end;
    }
    tokens.push((Token::End, text.len()..text.len()));
    Ok(tokens)
}

struct Parser<'a> {
    text: &'a str,
    tokens: Vec<(Token, Range<usize>)>,
    at: usize,
    depth: usize,
    terms: usize,
    names: &'a [&'a str],
    /// Those that stand for conditions.
    conditions: &'a [&'a str],
    dialect: Dialect,
}

type Parsed = Result<Expression, ExpressionError>;

impl Parser<'_> {
    fn peek(&self) -> &Token {
        &self.tokens[self.at].0
    }

    fn span(&self) -> Range<usize> {
        self.tokens[self.at].1.clone()
    }

    fn advance(&mut self) {
        self.at = (self.at + 1).min(self.tokens.len() - 1);
    }

    fn error(&self, message: impl Into<String>, help: Option<String>) -> ExpressionError {
        ExpressionError { message: message.into(), span: self.span(), help }
    }

    fn deeper<T>(
        &mut self,
        f: impl FnOnce(&mut Self) -> Result<T, ExpressionError>,
    ) -> Result<T, ExpressionError> {
        if self.depth == MAX_DEPTH {
            let help = Some("name parts of the expression in [let]".into());
            return Err(self.error(format!("more than {MAX_DEPTH} levels of nesting"), help));
        }
        self.depth += 1;
        let result = f(self);
        self.depth -= 1;
        result
    }

    fn term(&mut self) -> Result<(), ExpressionError> {
        self.terms += 1;
        if self.terms > MAX_TERMS {
            let help = Some("name parts of the expression in [let]".into());
            return Err(self.error(format!("more than {MAX_TERMS} terms in one expression"), help));
        }
        Ok(())
    }

    fn whole_expression(&mut self) -> Parsed {
        if self.dialect == Dialect::General { self.either() } else { self.sum() }
    }

    /// Whether the next token is this word; passes it if so.
    fn word(&mut self, word: &str) -> bool {
        let found = self.peek() == &Token::Name && self.text[self.span()] == *word;
        if found {
            self.advance();
        }
        found
    }

    /// An expression that must be a condition, or must be a number.
    fn wanted(&mut self, condition: bool, read: impl FnOnce(&mut Self) -> Parsed) -> Parsed {
        let start = self.span().start;
        let found = read(self)?;
        let end = self.tokens[self.at.saturating_sub(1)].1.end;
        if condition && !self.is_condition(&found) {
            return Err(ExpressionError {
                message: "a condition is wanted here, not a number".into(),
                span: start..end,
                help: Some("compare it with something: x > 0".into()),
            });
        }
        Ok(found)
    }

    fn either(&mut self) -> Parsed {
        let start = self.at;
        let mut left = self.both()?;
        while self.word("or") {
            self.term()?;
            self.must_be_condition(&left, start)?;
            let right = self.wanted(true, Self::both)?;
            left = Expression::Or(Box::new(left), Box::new(right));
        }
        Ok(left)
    }

    fn both(&mut self) -> Parsed {
        let start = self.at;
        let mut left = self.negation()?;
        while self.word("and") {
            self.term()?;
            self.must_be_condition(&left, start)?;
            let right = self.wanted(true, Self::negation)?;
            left = Expression::And(Box::new(left), Box::new(right));
        }
        Ok(left)
    }

    fn is_condition(&self, e: &Expression) -> bool {
        e.is_condition()
            || matches!(e, Expression::Name(name) if self.conditions.contains(&name.as_str()))
    }

    fn must_be_condition(&self, left: &Expression, start: usize) -> Result<(), ExpressionError> {
        if self.is_condition(left) {
            return Ok(());
        }
        Err(ExpressionError {
            message: "a condition is wanted here, not a number".into(),
            span: self.tokens[start].1.start..self.tokens[self.at.saturating_sub(2)].1.end,
            help: Some("compare it with something: x > 0".into()),
        })
    }

    fn negation(&mut self) -> Parsed {
        if self.word("not") {
            self.term()?;
            let inner = self.deeper(|p| p.wanted(true, Self::negation))?;
            return Ok(Expression::Not(Box::new(inner)));
        }
        self.comparison()
    }

    fn comparison(&mut self) -> Parsed {
        let left = self.sum()?;
        let Token::Compare { less, equal } = *self.peek() else { return Ok(left) };
        self.advance();
        self.term()?;
        let right = self.sum()?;
        if matches!(self.peek(), Token::Compare { .. }) {
            return Err(
                self.error("two comparisons in a row", Some("join them: 0 < x and x < 1".into()))
            );
        }
        // a >= b is that b is not greater than a: the same where something moves, and what it says
        // where all rests at equality.
        let (left, right) = if less != equal { (right, left) } else { (left, right) };
        let greater = Expression::Greater(Box::new(left), Box::new(right));
        Ok(if equal { Expression::Not(Box::new(greater)) } else { greater })
    }

    fn sum(&mut self) -> Parsed {
        let mut left = self.product()?;
        loop {
            let make = match self.peek() {
                Token::Plus => Expression::Add,
                Token::Minus => Expression::Sub,
                _ => return Ok(left),
            };
            self.advance();
            self.term()?;
            left = make(Box::new(left), Box::new(self.product()?));
        }
    }

    fn product(&mut self) -> Parsed {
        let mut left = self.unary()?;
        loop {
            let make = match self.peek() {
                Token::Times => Expression::Mul,
                Token::Over => Expression::Div,
                _ => return Ok(left),
            };
            self.advance();
            self.term()?;
            left = make(Box::new(left), Box::new(self.unary()?));
        }
    }

    fn unary(&mut self) -> Parsed {
        match self.peek() {
            Token::Minus => {
                self.advance();
                self.term()?;
                let inner = self.deeper(Self::unary)?;
                Ok(Expression::Neg(Box::new(inner)))
            }
            Token::Plus => {
                self.advance();
                self.deeper(Self::unary)
            }
            _ => self.power(),
        }
    }

    fn power(&mut self) -> Parsed {
        let base = self.atom()?;
        if self.peek() != &Token::Hat {
            return Ok(base);
        }
        self.advance();
        self.term()?;
        let start = self.span().start;
        let exponent = self.deeper(Self::unary)?;
        let end = self.tokens[self.at.saturating_sub(1)].1.end;
        match whole(&exponent) {
            Some(n) if (-i64::from(MAX_EXPONENT)..=i64::from(MAX_EXPONENT)).contains(&n) => {
                Ok(Expression::Power(Box::new(base), n as i32))
            }
            Some(n) => Err(ExpressionError {
                message: format!("the exponent {n} is too large; the limit is {MAX_EXPONENT}"),
                span: start..end,
                help: None,
            }),
            None if self.dialect == Dialect::General => {
                Ok(Expression::RealPower(Box::new(base), Box::new(exponent)))
            }
            None => Err(ExpressionError {
                message: "an exponent must be a whole number".into(),
                span: start..end,
                help: Some("write sqrt(x) for x^(1/2), exp(p*ln(x)) for other powers".into()),
            }),
        }
    }

    fn atom(&mut self) -> Parsed {
        self.term()?;
        match self.peek().clone() {
            Token::Number(number) => {
                self.advance();
                Ok(Expression::Number(number))
            }
            Token::Name => self.name(),
            Token::Open => self.parenthesis(),
            Token::End => Err(self.error(
                "the expression ends where a number, a name or a parenthesis should follow",
                None,
            )),
            Token::Close | Token::Comma => {
                Err(self.error("a number, a name or a parenthesis is missing before this", None))
            }
            _ => Err(self.error(
                "two operators in a row; a number, a name or a parenthesis is missing before this",
                None,
            )),
        }
    }

    fn parenthesis(&mut self) -> Parsed {
        let open = self.span();
        self.advance();
        let inner = self.deeper(Self::whole_expression)?;
        match self.peek() {
            Token::Close => {
                self.advance();
                Ok(inner)
            }
            Token::End => Err(ExpressionError {
                message: "this parenthesis is never closed".into(),
                span: open,
                help: Some("add a `)`".into()),
            }),
            Token::Comma => Err(self.error(COMMA, Some("the decimal sign is a point: 1.5".into()))),
            _ => {
                Err(self
                    .error("an operator or a `)` is missing here", Some(self.missing_operator())))
            }
        }
    }

    fn name(&mut self) -> Parsed {
        let span = self.span();
        let name = &self.text[span.clone()];
        self.advance();
        let error = |message: String, help: Option<String>| {
            Err(ExpressionError { message, span: span.clone(), help })
        };
        if name == "pi" {
            return Ok(Expression::Pi);
        }
        if self.dialect == Dialect::General {
            if name == "t" {
                return Ok(Expression::Name("t".into()));
            }
            if let Some((name, function, counts)) = General::entry(name) {
                return self.apply(name, *function, counts, span);
            }
        }
        if let Some(function) = Function::named(name) {
            if self.peek() != &Token::Open {
                return error(
                    format!("the function `{name}` needs its argument in parentheses"),
                    Some(format!("{name}(...)")),
                );
            }
            if let Some(count) = self.arguments().filter(|count| *count != 1) {
                let given = if count == 0 { "none".into() } else { count.to_string() };
                let are = if count > 1 { "are" } else { "is" };
                return error(
                    format!("`{name}` has one argument; {given} {are} given"),
                    Some(format!("write {name}(a), with one expression for a")),
                );
            }
            return Ok(Expression::Call(function, Box::new(self.parenthesis()?)));
        }
        if self.names.contains(&name) {
            return Ok(Expression::Name(name.into()));
        }
        if self.peek() == &Token::Open {
            return error(format!("there is no function `{name}`"), Some(self.function_help(name)));
        }
        let help = match nearest(name, self.names) {
            Some(near) => format!("did you mean `{near}`?"),
            None if name == "t" => {
                "equations do not see the time; a forced system carries it as a state with \
                    derivative 1, or is written as f = [...]"
                    .into()
            }
            None if name == "e" => "write exp(1) for the base of natural logarithms".into(),
            None if self.names.is_empty() => {
                "no names are known here; write numbers and functions of them".into()
            }
            None => format!("known here: {}", self.names.join(", ")),
        };
        error(format!("unknown name `{name}`"), Some(help))
    }

    /// Advice for a function that there is not.
    fn function_help(&self, name: &str) -> String {
        let general = self.dialect == Dialect::General;
        let mut functions: Vec<&str> = Function::ALL.iter().map(|(n, _)| *n).collect();
        if general {
            functions.extend(General::ALL.iter().map(|(n, ..)| *n));
        }
        let list = format!("supported functions are {}", functions.join(", "));
        let lower = name.to_ascii_lowercase();
        let among = |table: &'static [(&str, &'static str)]| {
            table.iter().find(|(n, _)| *n == lower).map(|(_, i)| *i)
        };
        let instead = match general {
            true => among(&INSTEAD_IN_GENERAL)
                .or_else(|| among(&INSTEAD).filter(|_| General::entry(&lower).is_none())),
            false => among(&INSTEAD),
        };
        match (instead, nearest(name, &functions)) {
            (Some(instead), _) if !general && General::entry(&lower).is_some() => {
                format!(
                    "{name} is not supported here: {instead}; a system written as f = [...] has \
                        {lower}; {list}"
                )
            }
            (Some(instead), _) => format!("{name} is not supported: {instead}; {list}"),
            (None, Some(near)) => format!("did you mean `{near}`? {list}"),
            (None, None) => list,
        }
    }

    /// The arguments of a function of general systems.
    fn apply(
        &mut self,
        name: &str,
        function: General,
        counts: &Range<usize>,
        span: Range<usize>,
    ) -> Parsed {
        if self.peek() != &Token::Open {
            return Err(ExpressionError {
                message: format!("the function `{name}` needs its arguments in parentheses"),
                span,
                help: Some(format!("{name}(...)")),
            });
        }
        let given = self.arguments().unwrap_or(counts.start);
        if !counts.contains(&given) {
            let wanted = match (counts.start, counts.end - 1) {
                (1, 1) => "one argument".into(),
                (least, most) if least == most => format!("{least} arguments"),
                (least, _) => format!("{least} arguments or more"),
            };
            return Err(ExpressionError {
                message: format!("`{name}` has {wanted}; {given} given"),
                span,
                help: (function == General::If)
                    .then(|| "if(x > 0, a, b): a where x > 0, else b".into()),
            });
        }
        let open = self.span();
        self.advance();
        let mut list = Vec::new();
        loop {
            let condition = function == General::If && list.is_empty();
            let argument = self.deeper(|p| p.wanted(condition, Self::either))?;
            list.push(argument);
            match self.peek() {
                Token::Comma => self.advance(),
                Token::Close => break,
                Token::End => {
                    return Err(ExpressionError {
                        message: "this parenthesis is never closed".into(),
                        span: open,
                        help: Some("add a `)`".into()),
                    });
                }
                _ => {
                    return Err(self.error(
                        "an operator or a `)` is missing here",
                        Some(self.missing_operator()),
                    ));
                }
            }
        }
        self.advance();
        Ok(Expression::Apply(function, list))
    }

    /// Number of arguments in the parentheses that open here; `None` if they are not closed.
    fn arguments(&self) -> Option<usize> {
        let (mut depth, mut commas) = (0, 0);
        for (i, (token, _)) in self.tokens[self.at..].iter().enumerate() {
            match token {
                Token::Open => depth += 1,
                Token::Comma if depth == 1 => commas += 1,
                Token::Close if depth == 1 => return Some(if i == 1 { 0 } else { commas + 1 }),
                Token::Close => depth -= 1,
                Token::End => return None,
                _ => {}
            }
        }
        None
    }

    /// Advice for a token that follows another without an operator.
    fn missing_operator(&self) -> String {
        let before = self.at.checked_sub(1).map_or("a", |i| &self.text[self.tokens[i].1.clone()]);
        let here = &self.text[self.span()];
        let is_time =
            self.tokens.get(self.at + 1).is_some_and(|(_, span)| &self.text[span.clone()] == "t");
        match before {
            before if here == "(" && is_time => {
                format!("states are written without their time: {before}")
            }
            ")" => format!("products are written with a star: (...)*{here}"),
            _ => format!("products are written with a star: {before}*{here}"),
        }
    }
}

/// The whole number that an exponent is made of.
fn whole(exponent: &Expression) -> Option<i64> {
    let small = |n: i64| (n.abs() <= 1_000_000).then_some(n);
    match exponent {
        Expression::Number(n) => {
            let value = n.value();
            (value.fract() == 0.0 && value <= 1e6).then_some(value as i64)
        }
        Expression::Neg(a) => whole(a).map(|n| -n),
        Expression::Add(a, b) => small(whole(a)? + whole(b)?),
        Expression::Sub(a, b) => small(whole(a)? - whole(b)?),
        Expression::Mul(a, b) => small(whole(a)? * whole(b)?),
        Expression::Power(a, n) => {
            let base = whole(a)?;
            (0..*n).try_fold(1_i64, |power, _| small(power * base)).filter(|_| *n >= 0)
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests;
