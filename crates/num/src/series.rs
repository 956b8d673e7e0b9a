//! Taylor coefficients of solutions, from the equation itself.
//!
//! A [`Solution`] yields, for the equation on a [`Tape`] and any [`Elementary`] number, the
//! coefficients of the solution's power series one degree after another, each operation by its own
//! recurrence (Moore 1966, ch. 11; Griewank & Walther 2008, table 13.2; Jorba & Zou 2005, sec. 2).
//! Degree K costs O(K^2) per nonlinear operation. A truncated series that is itself a number would
//! have to be evaluated anew at every degree, O(K^3)/3; that is why there is none.
//!
//! The tape also knows the arguments of every tanh and erf. That is how an integrator learns where
//! an equation has a layer, without being told (see [`Solution::layer_arguments`]).

mod compiled;
mod instruction;
#[cfg(test)]
mod plain;
mod plan;
mod table;

use std::any::{Any, TypeId};

use super::Elementary;
use super::decimal::{Decimal, FromDecimal};
use super::tape::{Node, Operation, Tape};
use compiled::Opening;
use plan::{Equation, SeriesPlan, advance, advance_rows, start};
use table::{Columns, LONGEST, ROW, start_rows};

/// A series: the state's components come first, then one for each recurrence.
type Series = usize;

/// A series of [`Recurrence::Weighted`].
type Weights = usize;

/// The recurrence of one series: its coefficients from those of others.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Recurrence<S> {
    Constant(S),
    Add(Series, Series),
    Sub(Series, Series),
    Neg(Series),
    /// Sum with a constant.
    Shift(Series, S),
    /// A constant less a series.
    Minus(Series, S),
    /// Product with a constant.
    Scale(Series, S),
    /// Quotient by a constant.
    Over(Series, S),
    Mul(Series, Series),
    Div(Series, Series),
    /// Of the first series, whose weights are the second.
    Exp(Series, Weights),
    /// u = ln a: u' = a'/a. Its own weights are the next series.
    Ln(Series),
    Sqrt(Series),
    /// -1 or +1, by the value at the start of the series.
    Sign(Series),
    /// The coefficients j a_j, those of t a'(t).
    Weighted(Series),
    /// tanh; its companion 1 - tanh^2 is the next series.
    Tanh(Series, Weights),
    /// 1 - u^2 of the tanh u before it, the first series; the second is u's argument.
    TanhSlope(Series, Series),
    /// Sine; the cosine is the next series.
    Sin(Series, Weights),
    /// Cosine; the sine is the series before.
    Cos(Series, Weights),
    /// 1 + a^2, for the arc tangent.
    OnePlusSquare(Series),
    /// u = atan a: u' = a'/w, the series w = 1 + a^2 being the one before. Its own weights are the
    /// next series.
    Atan(Series),
    /// u = erf a: u' = a' g, the series g = 2/sqrt(pi) exp(-a^2) being the one before.
    Erf(Series, Weights),
}

impl<S: Elementary> Recurrence<S> {
    /// The number in it; zero if there is none.
    fn number(&self) -> S {
        match *self {
            Self::Constant(c)
            | Self::Shift(_, c)
            | Self::Minus(_, c)
            | Self::Scale(_, c)
            | Self::Over(_, c) => c,
            _ => S::zero(),
        }
    }
}

/// The interpretation of an equation's constants and parameters, given in decimal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Constants {
    /// The nearest `f64`, and terms without variables are computed in `f64`: the same equation that
    /// `f64` methods solve.
    #[default]
    Binary,
    /// Themselves: 0.1 is one tenth. In extended precision, that is another equation: near a
    /// two-fold, the 1e-17 between the two has grown to 1e-12 a hundred units of time later.
    Decimal,
}

/// A transition function that is constant, to working precision, far from the zero of its argument.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LayerKind {
    /// tanh.
    Tanh,
    /// The error function.
    Erf,
}

/// The way in which an operation is not analytic, or nearly constant far from a structure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum MarkKind {
    /// A sign: jumps where its argument changes sign.
    Sign,
    /// A root, a logarithm or a quotient: singular where its argument, or divisor, is zero.
    Singular,
    /// An exponential: nothing where its argument is very negative.
    Exp,
    /// A power of at least [`HIGH_POWER`]: nothing where its base is small.
    Power(u32),
    /// A transition function (of [`Solution::layer_arguments`]) whose argument is no linear
    /// function of the state.
    Curved,
}

/// A power whose series shows little of it from afar, as its first terms vanish.
pub const HIGH_POWER: u32 = 16;

/// An operation on the tape that a Taylor method must watch: its kind and place, and the series of
/// its argument (divisor).
#[derive(Clone, Copy, Debug)]
struct Mark {
    kind: MarkKind,
    node: Node,
    argument: Series,
}

/// Power series in t, of the solution of x' = f(x) and of everything computed on the way.
#[derive(Clone, Debug)]
pub struct Solution<S> {
    degree: usize,
    dimension: usize,
    /// The series, `degree + 1` coefficients each; if there are rows, only those that are read.
    coefficients: Vec<S>,
    /// The same by degrees, if they are `f64`s and not too many: so cheap are these that where they
    /// lie matters.
    rows: Vec<[f64; ROW]>,
    recurrences: Vec<Recurrence<S>>,
    /// The series of the components' derivatives.
    outputs: Vec<Series>,
    layer_arguments: Vec<(LayerKind, Series)>,
    marks: Vec<Mark>,
    /// The first coefficients compiled, if that is so.
    opening: Option<Opening>,
    /// The plans that were needed so far.
    plans: Vec<SeriesPlan<S>>,
}

impl<S: Elementary + FromDecimal> Solution<S> {
    /// Room for series up to `degree`, of solutions of x' = f(x), f being `tape`.
    ///
    /// # Panics
    /// If `tape` has not as many values as variables.
    pub fn new(degree: usize, tape: &Tape, constants: Constants) -> Self {
        let mut solution = Self {
            degree,
            dimension: 0,
            coefficients: Vec::new(),
            rows: Vec::new(),
            recurrences: Vec::new(),
            outputs: Vec::new(),
            layer_arguments: Vec::new(),
            marks: Vec::new(),
            opening: None,
            plans: Vec::new(),
        };
        solution.set_tape(tape, constants);
        solution
    }

    /// Replaces the equation.
    ///
    /// # Panics
    /// If `tape` has not as many values as variables.
    pub fn set_tape(&mut self, tape: &Tape, constants: Constants) {
        assert_eq!(tape.variables(), tape.outputs().len(), "an equation x' = f(x)");
        let fixed: Vec<Option<S>> = match constants {
            Constants::Binary => {
                tape.fixed(Decimal::value).into_iter().map(|v| v.map(S::from_f64)).collect()
            }
            Constants::Decimal => tape.fixed(S::from_decimal),
        };
        let mut compiler = Compiler {
            dimension: tape.variables(),
            recurrences: std::mem::take(&mut self.recurrences),
            series: vec![None; tape.operations().len()],
            fixed,
        };
        compiler.recurrences.clear();
        self.layer_arguments.clear();
        self.marks.clear();
        let (needed, powers) = (tape.needed(), tape.powers());
        let mut linear: Vec<bool> = Vec::with_capacity(tape.operations().len());
        for (node, operation) in tape.operations().iter().enumerate() {
            let fixed = |node: Node| compiler.fixed[node].is_some();
            linear.push(match *operation {
                Operation::Variable(_) => true,
                _ if fixed(node) => true,
                Operation::Add(a, b) | Operation::Sub(a, b) => linear[a] && linear[b],
                Operation::Neg(a) => linear[a],
                Operation::Mul(a, b) => linear[a] && fixed(b) || fixed(a) && linear[b],
                Operation::Div(a, b) => linear[a] && fixed(b),
                _ => false,
            });
        }
        for (node, operation) in tape.operations().iter().enumerate() {
            if let Operation::Variable(i) = operation {
                compiler.series[node] = Some(*i);
            } else if needed[node] && compiler.fixed[node].is_none() {
                let series = compiler.compile(*operation);
                compiler.series[node] = Some(series);
                let mark = match *operation {
                    Operation::Mul(..) if powers[node].1 >= HIGH_POWER => {
                        Some((MarkKind::Power(powers[node].1), powers[node].0))
                    }
                    Operation::Sign(a) => Some((MarkKind::Sign, a)),
                    Operation::Sqrt(a) | Operation::Ln(a) => Some((MarkKind::Singular, a)),
                    Operation::Div(_, b) if compiler.fixed[b].is_none() => {
                        Some((MarkKind::Singular, b))
                    }
                    Operation::Exp(a) => Some((MarkKind::Exp, a)),
                    Operation::Tanh(a) | Operation::Erf(a) if !linear[a] => {
                        Some((MarkKind::Curved, a))
                    }
                    _ => None,
                };
                if let Some((kind, argument)) = mark {
                    self.marks.push(Mark { kind, node, argument: compiler.of(argument) });
                }
                match operation {
                    Operation::Tanh(a) => {
                        self.layer_arguments.push((LayerKind::Tanh, compiler.of(*a)))
                    }
                    Operation::Erf(a) => {
                        self.layer_arguments.push((LayerKind::Erf, compiler.of(*a)))
                    }
                    _ => {}
                }
            }
        }
        self.outputs.clear();
        self.outputs.extend(tape.outputs().iter().map(|node| compiler.of(*node)));
        self.dimension = tape.variables();
        self.recurrences = compiler.recurrences;
        self.plans.clear();
        let count = self.dimension + self.recurrences.len();
        self.coefficients.clear();
        self.coefficients.resize(count * (self.degree + 1), S::zero());
        self.rows.clear();
        self.opening = None;
        if TypeId::of::<S>() == TypeId::of::<f64>() && count <= ROW && self.degree <= LONGEST {
            self.rows.resize(self.degree + 1, [0.0; ROW]);
            self.opening = (&self.recurrences as &dyn Any)
                .downcast_ref::<Vec<Recurrence<f64>>>()
                .and_then(|recurrences| Opening::of(self.dimension, recurrences, &self.outputs));
        }
    }

    fn series(&self, series: Series) -> &[S] {
        let width = self.degree + 1;
        &self.coefficients[series * width..(series + 1) * width]
    }

    /// The series of the `i`-th component of the state: coefficient j belongs to t^j.
    pub fn component(&self, i: usize) -> &[S] {
        self.series(i)
    }

    /// The series of the arguments of every tanh and every erf in the equation, up to degree
    /// `degree - 1`.
    pub fn layer_arguments(&self) -> impl Iterator<Item = (LayerKind, &[S])> {
        self.layer_arguments
            .iter()
            .map(|(kind, series)| (*kind, &self.series(*series)[..self.degree]))
    }

    /// The operations that are not analytic everywhere or that hide: kind and place on the tape,
    /// and the series of the argument (of a quotient the divisor's) up to degree `degree - 1`.
    pub fn marks(&self) -> impl Iterator<Item = (MarkKind, Node, &[S])> {
        self.marks.iter().map(|m| (m.kind, m.node, &self.series(m.argument)[..self.degree]))
    }

    /// Computes the series of the solution that passes through `x` at t = 0.
    ///
    /// # Panics
    /// If `x` has not as many components as the equation.
    pub fn expand(&mut self, x: &[S]) {
        assert_eq!(x.len(), self.dimension, "one number a component");
        let width = self.degree + 1;
        for (i, value) in x.iter().enumerate() {
            self.coefficients[i * width] = *value;
        }
        // A test of the type, not of a constant of it, so that the code for each degree is compiled
        // for this type alone.
        if let Some(solution) =
            (self as &mut dyn Any).downcast_mut::<Solution<f64>>().filter(|s| !s.rows.is_empty())
        {
            solution.expand_rows();
        } else {
            self.expand_columns();
        }
    }

    /// Whether all that was expanded so far is compiled.
    #[doc(hidden)]
    pub fn is_compiled(&self) -> bool {
        self.opening.is_some() && self.plans.iter().all(|plan| plan.compiled.is_some())
    }

    fn expand_columns(&mut self) {
        if self.degree == 0 {
            return;
        }
        let width = self.degree + 1;
        let mut coefficients = std::mem::take(&mut self.coefficients);
        let mut table = Columns { coefficients: &mut coefficients, width, k: 0 };
        let saturated = start(&self.equation(), &mut table);
        let plan = self.plan(saturated);
        for k in 1..self.degree {
            table.k = k;
            advance(&self.plans[plan], &mut table);
        }
        self.coefficients = coefficients;
    }

    fn equation(&self) -> Equation<'_, S> {
        Equation {
            dimension: self.dimension,
            recurrences: &self.recurrences,
            outputs: &self.outputs,
            layer_arguments: &self.layer_arguments,
            marks: &self.marks,
        }
    }

    /// The index of the plan for these saturated tanh.
    fn plan(&mut self, saturated: u64) -> usize {
        self.plans.iter().position(|plan| plan.saturated == saturated).unwrap_or_else(|| {
            let plan = SeriesPlan::new(&self.equation(), saturated);
            self.plans.push(plan);
            self.plans.len() - 1
        })
    }
}

impl Solution<f64> {
    fn expand_rows(&mut self) {
        if self.degree == 0 {
            return;
        }
        let width = self.degree + 1;
        let mut rows = std::mem::take(&mut self.rows);
        for (start, series) in
            rows[0].iter_mut().zip(self.coefficients.chunks(width)).take(self.dimension)
        {
            *start = series[0];
        }
        let saturated = match &self.opening {
            Some(opening) => start_rows(&mut rows, |table| opening.start(table)),
            None => start_rows(&mut rows, |table| start(&self.equation(), table)),
        };
        let plan = self.plan(saturated);
        for k in 1..self.degree {
            advance_rows(&self.plans[plan], &mut rows, k);
        }
        let layers = self.layer_arguments.iter().map(|(_, series)| *series);
        for series in (0..self.dimension).chain(layers).chain(self.marks.iter().map(|m| m.argument))
        {
            let column = &mut self.coefficients[series * width..(series + 1) * width];
            for (coefficient, row) in column.iter_mut().zip(rows.iter()) {
                *coefficient = row[series % ROW];
            }
        }
        self.rows = rows;
    }
}

/// From a tape's operations to recurrences: terms without variables become numbers, and some
/// functions get companions.
struct Compiler<S> {
    dimension: usize,
    recurrences: Vec<Recurrence<S>>,
    /// The series of each operation, if it has one.
    series: Vec<Option<Series>>,
    fixed: Vec<Option<S>>,
}

impl<S: Elementary> Compiler<S> {
    fn push(&mut self, recurrence: Recurrence<S>) -> Series {
        self.recurrences.push(recurrence);
        self.at(self.recurrences.len() - 1)
    }

    /// The series of a recurrence.
    fn at(&self, recurrence: usize) -> Series {
        self.dimension + recurrence
    }

    /// The series of an operation. A term without variables gets one where it is needed as such.
    fn of(&mut self, node: usize) -> Series {
        match self.series[node] {
            Some(series) => series,
            None => {
                let value = self.fixed[node].unwrap_or(S::zero());
                let series = self.push(Recurrence::Constant(value));
                self.series[node] = Some(series);
                series
            }
        }
    }

    fn compile(&mut self, operation: Operation) -> Series {
        let recurrence = match operation {
            Operation::Add(a, b) => match (self.fixed[a], self.fixed[b]) {
                (Some(c), _) => Recurrence::Shift(self.of(b), c),
                (None, Some(c)) => Recurrence::Shift(self.of(a), c),
                (None, None) => Recurrence::Add(self.of(a), self.of(b)),
            },
            Operation::Sub(a, b) => match (self.fixed[a], self.fixed[b]) {
                (Some(c), _) => Recurrence::Minus(self.of(b), c),
                (None, Some(c)) => Recurrence::Shift(self.of(a), -c),
                (None, None) => Recurrence::Sub(self.of(a), self.of(b)),
            },
            Operation::Mul(a, b) => match (self.fixed[a], self.fixed[b]) {
                (_, Some(c)) => Recurrence::Scale(self.of(a), c),
                (Some(c), None) => Recurrence::Scale(self.of(b), c),
                (None, None) => Recurrence::Mul(self.of(a), self.of(b)),
            },
            Operation::Div(a, b) => match self.fixed[b] {
                Some(c) => Recurrence::Over(self.of(a), c),
                None => Recurrence::Div(self.of(a), self.of(b)),
            },
            Operation::Neg(a) => Recurrence::Neg(self.of(a)),
            Operation::Exp(a) => {
                let (a, weights) = self.weighted(a);
                Recurrence::Exp(a, weights)
            }
            Operation::Ln(a) => {
                let ln = Recurrence::Ln(self.of(a));
                return self.push_with_weights(ln);
            }
            Operation::Sqrt(a) => Recurrence::Sqrt(self.of(a)),
            Operation::Sign(a) => Recurrence::Sign(self.of(a)),
            Operation::Tanh(a) => {
                let (a, weights) = self.weighted(a);
                let tanh = self.push(Recurrence::Tanh(a, weights));
                self.push(Recurrence::TanhSlope(tanh, a));
                return tanh;
            }
            Operation::Sin(a) => return self.sine(a),
            Operation::Cos(a) => return self.sine(a) + 1,
            Operation::Atan(a) => {
                let a = self.of(a);
                self.push(Recurrence::OnePlusSquare(a));
                return self.push_with_weights(Recurrence::Atan(a));
            }
            Operation::Erf(a) => {
                let (a, weights) = self.weighted(a);
                let square = self.push(Recurrence::Mul(a, a));
                let minus = self.push(Recurrence::Neg(square));
                let minus_weights = self.push(Recurrence::Weighted(minus));
                let bell = self.push(Recurrence::Exp(minus, minus_weights));
                self.push(Recurrence::Scale(bell, S::from_f64(2.0) / S::pi().sqrt()));
                Recurrence::Erf(a, weights)
            }
            Operation::Variable(_)
            | Operation::Constant(_)
            | Operation::Parameter(_)
            | Operation::Pi => {
                unreachable!(
                    "variables have series from the start, terms without variables are numbers"
                )
            }
        };
        self.push(recurrence)
    }

    /// The series of an operation, and that of its weights.
    fn weighted(&mut self, node: usize) -> (Series, Weights) {
        let a = self.of(node);
        let weights = match self.recurrences.iter().position(|r| *r == Recurrence::Weighted(a)) {
            Some(known) => self.at(known),
            None => self.push(Recurrence::Weighted(a)),
        };
        (a, weights)
    }

    /// A recurrence that asks for its own weights, which follow it.
    fn push_with_weights(&mut self, recurrence: Recurrence<S>) -> Series {
        let series = self.push(recurrence);
        self.push(Recurrence::Weighted(series));
        series
    }

    /// The sine of an operation, followed by its cosine; both from one pair.
    fn sine(&mut self, node: usize) -> Series {
        let (a, weights) = self.weighted(node);
        if let Some(i) = self.recurrences.iter().position(|r| *r == Recurrence::Sin(a, weights)) {
            return self.at(i);
        }
        let sine = self.push(Recurrence::Sin(a, weights));
        self.push(Recurrence::Cos(a, weights));
        sine
    }
}

#[cfg(test)]
mod tests {
    use super::super::tape::Recorded;
    use super::*;
    use crate::{Arithmetic, DoubleDouble, Scalar};

    fn expand<const N: usize>(
        degree: usize,
        x: [f64; N],
        f: impl Fn(&[Recorded]) -> Vec<Recorded>,
    ) -> Solution<DoubleDouble> {
        let mut solution = Solution::new(degree, &Tape::record(N, f), Constants::Binary);
        solution.expand(&x.map(DoubleDouble::from_f64));
        solution
    }

    /// The coefficients of the first component against known ones.
    #[track_caller]
    fn first_is(solution: &Solution<DoubleDouble>, want: impl Fn(usize) -> f64) {
        for (j, c) in solution.component(0).iter().enumerate() {
            let w = want(j);
            assert!(
                (c.to_f64() - w).abs() <= 4e-16 * w.abs().max(1e-3),
                "coefficient {j}: {c:?}, expected {w}"
            );
        }
    }

    fn factorial(n: usize) -> f64 {
        (1..=n).map(|k| k as f64).product()
    }

    // Equations whose solutions have known series; each names the recurrence it tests.

    #[test]
    fn linear() {
        first_is(&expand(25, [1.0], |x| vec![x[0]]), |j| 1.0 / factorial(j));
        // x' = 1 - 2x/4 - x/2 = 1 - x from 0: 1 - exp(-t)
        let s = expand(20, [0.0], |x| {
            vec![Recorded::one() - x[0].scale(2.0) / Recorded::from_f64(4.0) - x[0].scale(0.5)]
        });
        first_is(&s, |j| {
            if j == 0 { 0.0 } else { -(if j % 2 == 0 { 1.0 } else { -1.0 }) / factorial(j) }
        });
    }

    #[test]
    fn products_and_squares() {
        // x' = x^2: 1/(1 - t)
        first_is(&expand(25, [1.0], |x| vec![x[0].squared()]), |_| 1.0);
        // x' = x y, y' = y: x = exp(exp(t) - 1), Bell numbers over factorials
        let bell = [1.0, 1.0, 2.0, 5.0, 15.0, 52.0, 203.0, 877.0, 4140.0];
        first_is(&expand(8, [1.0, 1.0], |x| vec![x[0] * x[1], x[1]]), |j| bell[j] / factorial(j));
    }

    #[test]
    fn quotients_and_roots() {
        // x' = 1/(2x): sqrt(1 + t); and x' = sqrt(x): (1 + t/2)^2
        let binomial = |j: usize| (0..j).fold(1.0, |b, i| b * (0.5 - i as f64) / (i + 1) as f64);
        first_is(&expand(20, [1.0], |x| vec![Recorded::one() / x[0].scale(2.0)]), binomial);
        first_is(&expand(20, [1.0], |x| vec![x[0].sqrt()]), |j| {
            [1.0, 1.0, 0.25].get(j).copied().unwrap_or(0.0)
        });
    }

    #[test]
    fn exponential_sine_cosine() {
        // x' = exp(-x): ln(1 + t)
        first_is(&expand(20, [0.0], |x| vec![(-x[0]).exp()]), |j| match j {
            0 => 0.0,
            _ => (if j % 2 == 0 { -1.0 } else { 1.0 }) / j as f64,
        });
        // x' = cos y, y' = 1: sin t; x' = sin y: 1 - cos t
        let sine = |j: usize| match j % 4 {
            1 => 1.0 / factorial(j),
            3 => -1.0 / factorial(j),
            _ => 0.0,
        };
        first_is(&expand(20, [0.0, 0.0], |x| vec![x[1].cos(), Recorded::one()]), sine);
        first_is(&expand(20, [0.0, 0.0], |x| vec![x[1].sin(), Recorded::one()]), |j| match j {
            0 => 0.0,
            _ => sine(j - 1) / j as f64,
        });
    }

    #[test]
    fn hyperbolic_tangent() {
        // x' = tanh(y), y' = 1: ln cosh t = t^2/2 - t^4/12 + t^6/45 - 17 t^8/2520 + 31 t^10/14175
        let want = [
            0.0,
            0.0,
            0.5,
            0.0,
            -1.0 / 12.0,
            0.0,
            1.0 / 45.0,
            0.0,
            -17.0 / 2520.0,
            0.0,
            31.0 / 14175.0,
        ];
        let s = expand(10, [0.0, 0.0], |x| vec![x[1].tanh(), Recorded::one()]);
        first_is(&s, |j| want[j]);
        assert_eq!(s.layer_arguments().count(), 1);
        assert_eq!(s.layer_arguments().next().unwrap().1[1], DoubleDouble::one());
    }

    #[test]
    fn a_saturated_tanh_is_exactly_constant() {
        let s = expand(12, [0.0, 40.0], |x| vec![x[1].tanh(), x[0]]);
        let c = s.component(0);
        assert_eq!(c[1], DoubleDouble::one());
        assert!(c[2..].iter().all(|c| *c == DoubleDouble::zero()));
    }

    #[test]
    fn decimal_constants_are_decimal() {
        let tape = Tape::record(1, |x| {
            let eps = Recorded::parameter("eps", &1e-3.into());
            vec![x[0].scale(0.1) / eps + Recorded::from_f64(-1.2)]
        });
        let slope = |constants| {
            let mut s = Solution::<DoubleDouble>::new(1, &tape, constants);
            s.expand(&[DoubleDouble::one()]);
            (s.component(0)[1] - DoubleDouble::from_decimal(98.8)).to_f64().abs()
        };
        assert!(slope(Constants::Decimal) < 1e-29);
        assert!(slope(Constants::Binary) > 1e-16);
    }

    #[test]
    fn logarithm_arc_tangent_error_function() {
        let sign = |j: usize| if j.is_multiple_of(2) { 1.0 } else { -1.0 };
        // x' = ln y, y' = 1 from y = 1: y ln y - y + 1; coefficients of t^j for j > 1: (-1)^j/(j (j
        // - 1))
        first_is(&expand(20, [0.0, 1.0], |x| vec![x[1].ln(), Recorded::one()]), |j| match j {
            0 | 1 => 0.0,
            _ => sign(j) / (j * (j - 1)) as f64,
        });
        // x' = atan t: t^(2n+2) (-1)^n/((2n + 1)(2n + 2))
        first_is(&expand(20, [0.0, 0.0], |x| vec![x[1].atan(), Recorded::one()]), |j| match j {
            0 => 0.0,
            j if j % 2 == 0 => sign(j / 2 - 1) / (j * (j - 1)) as f64,
            _ => 0.0,
        });
        // x' = erf t: 2/sqrt(pi) t^(2n+2) (-1)^n/(n! (2n + 1)(2n + 2))
        first_is(&expand(20, [0.0, 0.0], |x| vec![x[1].erf(), Recorded::one()]), |j| match j {
            0 => 0.0,
            j if j % 2 == 0 => {
                std::f64::consts::FRAC_2_SQRT_PI * sign(j / 2 - 1)
                    / (factorial(j / 2 - 1) * (j * (j - 1)) as f64)
            }
            _ => 0.0,
        });
    }

    #[test]
    fn sine_and_cosine_share_a_pair() {
        let s = expand(3, [0.3, 0.4], |x| vec![x[1].cos(), x[1].sin() + x[1].cos()]);
        // Weights, sine, cosine, their sum.
        assert_eq!(s.recurrences.len(), 4);
    }

    #[test]
    fn a_series_of_degree_zero_is_the_state() {
        let s = expand(0, [0.25, 3.0], |x| vec![x[0] * x[1], x[1].tanh()]);
        assert_eq!(
            (s.component(0), s.component(1)),
            (&[DoubleDouble::from_f64(0.25)][..], &[DoubleDouble::from_f64(3.0)][..])
        );
        assert!(s.layer_arguments().all(|(_, series)| series.is_empty()));
    }

    #[test]
    fn absolute_value_by_the_sign_at_the_start() {
        // x' = -|x| from -1: -exp(t); from 1: exp(-t)
        for (start, sign) in [(-1.0, 1.0), (1.0, -1.0_f64)] {
            let s = expand(12, [start], |x| vec![-x[0].abs()]);
            first_is(&s, |j| start * (if j % 2 == 0 { 1.0 } else { sign }) / factorial(j));
        }
    }

    /// Whatever the equation: the series, put into it, satisfies it up to terms that were left out.
    #[test]
    fn the_series_satisfies_its_equation() {
        fn f<S: Elementary>(x: &[S]) -> Vec<S> {
            let c = S::from_f64;
            vec![
                x[1].ln() * x[0].atan() + x[2] / (x[0] + c(2.0)),
                (x[0] * x[1]).sin() + x[2].cos() - x[1].sin() / c(3.0),
                x[0].erf() - (x[1] + x[2]).tanh() + x[2].squared().scale(0.25)
                    - x[0].squared() * x[0],
                (-x[3]).exp() * (x[0] + c(1.5)).sqrt() - c(0.5) / x[1] + c(2.0) - x[3].abs()
                    + (x[2] * x[3]).cos(),
            ]
        }
        for start in [[0.4, 1.3, -0.2, 0.7], [-0.7, 2.1, 0.9, 1.1], [0.0, 0.8, 0.0, 0.6]] {
            let s = expand(24, start, f);
            let at = |c: &[DoubleDouble], t: f64| {
                c.iter()
                    .rev()
                    .fold(DoubleDouble::zero(), |sum, c| sum * DoubleDouble::from_f64(t) + *c)
            };
            let t = 1.0 / 256.0;
            let x: Vec<_> = (0..4).map(|i| at(s.component(i), t)).collect();
            for (i, want) in f(&x).into_iter().enumerate() {
                let slopes: Vec<_> = s
                    .component(i)
                    .iter()
                    .enumerate()
                    .skip(1)
                    .map(|(k, c)| *c * DoubleDouble::from_f64(k as f64))
                    .collect();
                let gap = (at(&slopes, t) - want).to_f64().abs();
                assert!(gap < 1e-27, "{start:?}, {i}: {gap:e}");
            }
            // The arguments of the layers, as far as they are known: those of the error function
            // and of tanh.
            let layers: Vec<_> = s.layer_arguments().collect();
            assert_eq!(layers.len(), 2);
            for ((kind, layer), (wanted, of)) in
                layers.iter().zip([(LayerKind::Erf, &x[..1]), (LayerKind::Tanh, &x[1..3])])
            {
                assert_eq!((*kind, layer.len()), (wanted, 24));
                let gap = (at(layer, t) - of.iter().fold(DoubleDouble::zero(), |sum, x| sum + *x))
                    .to_f64()
                    .abs();
                assert!(gap < 1e-27, "{start:?}: {gap:e}");
            }
        }
    }
}
