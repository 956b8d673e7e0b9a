//! Instructions of a plan, and how one is carried out.

use super::table::Table;
use super::{Recurrence, Series, Weights};
use crate::Elementary;

/// Action of an instruction at degree k >= 1. The current number is the result of the instruction
/// before.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Action<S> {
    /// Zero.
    Clear,
    Copy(Series),
    /// The current number.
    Keep,
    Neg(Series),
    NegThis,
    /// -(a c). As with all that follow which do two things, what lies between has no series of its
    /// own.
    NegScale(Series, S),
    /// -a - b.
    NegLess(Series, Series),
    Add(Series, Series),
    /// The current number + a.
    ThisPlus(Series),
    PlusThis(Series),
    Sub(Series, Series),
    ThisLess(Series),
    LessThis(Series),
    Scale(Series, S),
    ScaleThis(S),
    /// a + b c.
    PlusScale(Series, Series, S),
    /// a - b c.
    LessScale(Series, Series, S),
    Over(Series, S),
    ThisOver(S),
    Mul(Series, Series),
    /// a + b c.
    PlusMul(Series, Series, Series),
    /// a - b c.
    LessMul(Series, Series, Series),
    /// a b + c.
    MulPlus(Series, Series, Series),
    /// a b - c.
    MulLess(Series, Series, Series),
    Square(Series),
    /// a + b^2.
    PlusSquare(Series, Series),
    /// a^2 + b^2.
    Squares(Series, Series),
    /// (a^2 + b^2) + c^2.
    ThreeSquares(Series, Series, Series),
    /// Product of a constant series, the first, with another.
    Lift(Series, Series),
    LiftThis(Series),
    /// A series and the product of a constant series, the second, with another.
    PlusLift(Series, Series, Series),
    PlusLiftThis(Series, Series),
    Div(Series, Series),
    /// Of the first series, whose weights are the second.
    Exp(Series, Weights),
    /// Its weights are the series after it.
    Ln(Series),
    Sqrt(Series),
    /// tanh, and its slope, the series after it.
    Tanh(Series, Weights),
    /// Of the current number.
    TanhThis(Weights),
    /// Sine, and cosine, the series after it.
    Sin(Series, Weights),
    /// The series before it is 1 + a^2, its weights are the series after it.
    Atan(Series),
    /// The series before it is the argument's slope.
    Erf(Series, Weights),
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Instruction<S> {
    pub action: Action<S>,
    /// The series that the result belongs to.
    pub to: Series,
}

impl<S: Elementary> Instruction<S> {
    /// The number in it; zero if there is none.
    pub fn number(&self) -> S {
        match self.action {
            Action::NegScale(_, c)
            | Action::Scale(_, c)
            | Action::ScaleThis(c)
            | Action::PlusScale(_, _, c)
            | Action::LessScale(_, _, c)
            | Action::Over(_, c)
            | Action::ThisOver(c) => c,
            _ => S::zero(),
        }
    }
}

/// Coefficient k of a^2, each product once.
#[inline(always)]
pub(super) fn square<S: Elementary>(table: &impl Table<S>, a: Series) -> S {
    let k = table.degree();
    let mut sum = table.products(a, a, 0, k.div_ceil(2));
    sum += sum;
    if k.is_multiple_of(2) {
        sum += table.get(a, k / 2).squared();
    }
    sum
}

/// Coefficient k of a b.
#[inline(always)]
fn product<S: Elementary>(table: &impl Table<S>, a: Series, b: Series) -> S {
    table.products(a, b, 0, table.degree() + 1)
}

/// Coefficient k of the integral of a' b, from the weights j a_j.
#[inline(always)]
fn integral<S: Elementary>(table: &impl Table<S>, weights: Weights, b: Series) -> S {
    let k = table.degree();
    table.products(weights, b, 1, k + 1).over(k as f64)
}

/// Saturated tanh of an equation, as far as they have been computed.
#[derive(Default)]
pub(super) struct Saturated {
    /// A bit each.
    pub bits: u64,
    count: u32,
}

/// The coefficient of degree 0 of one series, those of its arguments being known.
#[inline(always)]
pub(super) fn begin<S: Elementary>(
    recurrence: &Recurrence<S>,
    to: Series,
    table: &mut impl Table<S>,
    saturated: &mut Saturated,
) {
    let value = start_of(recurrence, |series| table.get(series, 0));
    if matches!(recurrence, Recurrence::TanhSlope(..)) && S::EXACT_ZEROS {
        saturated.bits |= u64::from(value == S::zero()) << saturated.count;
        saturated.count += 1;
    }
    table.set(to, value);
}

/// Coefficient 0 of a recurrence; `at` gives those of its arguments.
#[inline(always)]
pub(super) fn start_of<S: Elementary>(recurrence: &Recurrence<S>, at: impl Fn(Series) -> S) -> S {
    match *recurrence {
        Recurrence::Constant(c) => c,
        Recurrence::Add(a, b) => at(a) + at(b),
        Recurrence::Sub(a, b) => at(a) - at(b),
        Recurrence::Neg(a) => -at(a),
        Recurrence::Shift(a, c) => at(a) + c,
        Recurrence::Minus(a, c) => c - at(a),
        Recurrence::Scale(a, c) => at(a) * c,
        Recurrence::Over(a, c) => at(a) / c,
        Recurrence::Mul(a, b) if a == b => S::zero() + S::zero() + at(a).squared(),
        Recurrence::Mul(a, b) => S::sum_of_products(&[at(a)], &[at(b)]),
        Recurrence::Div(a, b) => (at(a) - S::zero()) / at(b),
        Recurrence::Weighted(_) => S::zero(),
        Recurrence::Exp(a, _) => at(a).exp(),
        Recurrence::Ln(a) => at(a).ln(),
        Recurrence::Sqrt(a) => at(a).sqrt(),
        Recurrence::Sign(a) => at(a).sign(),
        Recurrence::Tanh(a, _) => at(a).tanh(),
        // As (1 - u)(1 + u): exactly zero where tanh is saturated, and accurate near it.
        Recurrence::TanhSlope(u, a) => {
            at(a).sech_squared().unwrap_or_else(|| (S::one() - at(u)) * (S::one() + at(u)))
        }
        Recurrence::Sin(a, _) => at(a).sin(),
        Recurrence::Cos(a, _) => at(a).cos(),
        Recurrence::OnePlusSquare(a) => S::one() + at(a).squared(),
        Recurrence::Atan(a) => at(a).atan(),
        Recurrence::Erf(a, _) => at(a).erf(),
    }
}

/// Carries one instruction out, `this` being the current number. Returns the next.
#[inline(always)]
pub(super) fn carry_out<S: Elementary, T: Table<S>>(
    instruction: Instruction<S>,
    this: S,
    table: &mut T,
) -> S {
    let Instruction { action, to } = instruction;
    let k = table.degree();
    let degree = k as f64;
    let this = match action {
        Action::Clear => S::zero(),
        Action::Copy(a) => table.at(a),
        Action::Keep => this,
        Action::Neg(a) => -table.at(a),
        Action::NegThis => -this,
        Action::NegScale(a, c) => -(table.at(a) * c),
        Action::NegLess(a, b) => -table.at(a) - table.at(b),
        Action::Add(a, b) => table.at(a) + table.at(b),
        Action::ThisPlus(a) => this + table.at(a),
        Action::PlusThis(a) => table.at(a) + this,
        Action::Sub(a, b) => table.at(a) - table.at(b),
        Action::ThisLess(a) => this - table.at(a),
        Action::LessThis(a) => table.at(a) - this,
        Action::Scale(a, c) => table.at(a) * c,
        Action::ScaleThis(c) => this * c,
        Action::PlusScale(a, b, c) => table.at(a) + table.at(b) * c,
        Action::LessScale(a, b, c) => table.at(a) - table.at(b) * c,
        Action::Over(a, c) => table.at(a) / c,
        Action::ThisOver(c) => this / c,
        Action::Mul(a, b) => product(table, a, b),
        Action::PlusMul(a, b, c) => table.at(a) + product(table, b, c),
        Action::LessMul(a, b, c) => table.at(a) - product(table, b, c),
        Action::MulPlus(a, b, c) => product(table, a, b) + table.at(c),
        Action::MulLess(a, b, c) => product(table, a, b) - table.at(c),
        Action::Square(a) => square(table, a),
        Action::PlusSquare(a, b) => table.at(a) + square(table, b),
        Action::Squares(a, b) => square(table, a) + square(table, b),
        Action::ThreeSquares(a, b, c) => (square(table, a) + square(table, b)) + square(table, c),
        Action::Lift(c, a) => lifted(table.get(c, 0), table.at(a)),
        Action::PlusLift(a, c, b) => table.at(a) + lifted(table.get(c, 0), table.at(b)),
        Action::LiftThis(c) => lifted(table.get(c, 0), this),
        Action::PlusLiftThis(a, c) => table.at(a) + lifted(table.get(c, 0), this),
        Action::Div(a, b) => (table.at(a) - table.products(b, to, 1, k + 1)) / table.get(b, 0),
        Action::Exp(a, weights) => {
            table.set(weights, table.at(a).scale(degree));
            integral(table, weights, to)
        }
        Action::Ln(a) => {
            // The sum lacks exactly the term of the coefficient asked for.
            table.set(to + 1, S::zero());
            let u = (table.at(a) - integral(table, to + 1, a)) / table.get(a, 0);
            table.set(to + 1, u.scale(degree));
            u
        }
        Action::Sqrt(a) => {
            // The square's coefficient lacks exactly 2 r_0 r_k.
            table.set(to, S::zero());
            (table.at(a) - square(table, to)) / table.get(to, 0).scale(2.0)
        }
        Action::Tanh(a, weights) => {
            let a = table.at(a);
            tanh(table, a, weights, to)
        }
        Action::TanhThis(weights) => tanh(table, this, weights, to),
        Action::Sin(a, weights) => {
            table.set(weights, table.at(a).scale(degree));
            let cosine = -integral(table, weights, to);
            let sine = integral(table, weights, to + 1);
            table.set(to + 1, cosine);
            sine
        }
        Action::Atan(a) => {
            table.set(to + 1, S::zero());
            let u = (table.at(a) - integral(table, to + 1, to - 1)) / table.get(to - 1, 0);
            table.set(to + 1, u.scale(degree));
            u
        }
        Action::Erf(a, weights) => {
            table.set(weights, table.at(a).scale(degree));
            integral(table, weights, to - 1)
        }
    };
    table.set(to, this);
    this
}

/// A constant times a coefficient, as the only term of a product's sum.
#[inline(always)]
fn lifted<S: Elementary>(constant: S, coefficient: S) -> S {
    S::sum_of_products(&[constant], &[coefficient])
}

/// u = tanh a and its slope: u' = a' (1 - u^2).
#[inline(always)]
fn tanh<S: Elementary>(table: &mut impl Table<S>, a: S, weights: Weights, to: Series) -> S {
    table.set(weights, a.scale(table.degree() as f64));
    let u = integral(table, weights, to + 1);
    table.set(to, u);
    table.set(to + 1, -square(table, to));
    u
}
