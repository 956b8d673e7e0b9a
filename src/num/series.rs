//! Taylor coefficients of solutions, from the equation itself.
//!
//! [`Program::record`] runs an equation once on numbers that write down what is done with them. A [`Solution`] then yields,
//! for any [`Elementary`] number, the coefficients of the solution's power series one degree after another, each operation by its
//! own recurrence (Moore 1966, ch. 11; Griewank & Walther 2008, table 13.2; Jorba & Zou 2005, sec. 2). Degree K costs
//! O(K^2) per nonlinear operation. A truncated series that is itself a number would have to be evaluated anew at
//! every degree, O(K^3)/3; that is why there is none.
//!
//! The recording also knows the arguments of every tanh. That is how an integrator learns where an equation has a
//! layer, without being told (see [`Solution::tanh_arguments`]).

use std::cell::RefCell;
use std::ops::{Add, AddAssign, Div, Mul, Neg, Range, Sub, SubAssign};

use nalgebra::SVector;

use super::{Arithmetic, DoubleDouble, Elementary};

/// Index of an operation in a program.
type Node = usize;

/// One operation of a program. `Tanh`, `Sin` and `Cos` name the companion series that their recurrences need.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Operation {
    Variable(usize),
    Constant(f64),
    Add(Node, Node),
    Sub(Node, Node),
    Neg(Node),
    /// Product with a constant.
    Scale(Node, f64),
    /// Quotient by a constant.
    Over(Node, f64),
    Mul(Node, Node),
    Div(Node, Node),
    Exp(Node),
    Sqrt(Node),
    /// -1 or +1, by the value at the start of the series.
    Sign(Node),
    /// tanh of the node; its companion 1 - tanh^2 is the next operation.
    Tanh(Node),
    /// 1 - u^2 of the tanh u before it.
    TanhSlope(Node),
    /// Sine of the node; the cosine is the next operation.
    Sin(Node),
    /// Cosine of the node; the sine is the operation before.
    Cos(Node),
}

impl Operation {
    /// The operation's constant.
    fn constant(self) -> Option<f64> {
        match self {
            Operation::Constant(c) | Operation::Scale(_, c) | Operation::Over(_, c) => Some(c),
            _ => None,
        }
    }
}

/// Numbers that can stand for a decimal number more exactly than `f64`.
pub trait FromDecimal {
    /// The shortest decimal number that reads as `value`.
    fn from_decimal(value: f64) -> Self;
}

impl FromDecimal for f64 {
    fn from_decimal(value: f64) -> Self {
        value
    }
}

impl FromDecimal for DoubleDouble {
    fn from_decimal(value: f64) -> Self {
        DoubleDouble::from_decimal(value)
    }
}

thread_local! {
    /// The operations of the recording under way on this thread. `Elementary` is `Copy + 'static`, so that a recorded number
    /// cannot carry a reference to its recording.
    static OPERATIONS: RefCell<Vec<Operation>> = const { RefCell::new(Vec::new()) };
}

/// Appends `operation` unless the same one is there already (f+ and f- share the re-injection term).
fn record(operation: Operation) -> Recorded {
    OPERATIONS.with_borrow_mut(|operations| {
        if let Some(node) = operations.iter().position(|o| *o == operation) {
            return Recorded { node };
        }
        operations.push(operation);
        let node = operations.len() - 1;
        match operation {
            Operation::Tanh(_) => operations.push(Operation::TanhSlope(node)),
            Operation::Sin(a) => operations.push(Operation::Cos(a)),
            _ => {}
        }
        Recorded { node }
    })
}

fn constant(node: Node) -> Option<f64> {
    OPERATIONS.with_borrow(|operations| match operations[node] {
        Operation::Constant(c) => Some(c),
        _ => None,
    })
}

/// A number that writes down what is done with it. It has no value: an equation cannot look.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Recorded {
    node: Node,
}

impl Add for Recorded {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        record(Operation::Add(self.node, other.node))
    }
}

impl Sub for Recorded {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        record(Operation::Sub(self.node, other.node))
    }
}

impl Mul for Recorded {
    type Output = Self;
    fn mul(self, other: Self) -> Self {
        record(match (constant(self.node), constant(other.node)) {
            (_, Some(c)) => Operation::Scale(self.node, c),
            (Some(c), None) => Operation::Scale(other.node, c),
            (None, None) => Operation::Mul(self.node, other.node),
        })
    }
}

impl Div for Recorded {
    type Output = Self;
    fn div(self, other: Self) -> Self {
        record(match constant(other.node) {
            Some(c) => Operation::Over(self.node, c),
            None => Operation::Div(self.node, other.node),
        })
    }
}

impl Neg for Recorded {
    type Output = Self;
    fn neg(self) -> Self {
        record(Operation::Neg(self.node))
    }
}

impl AddAssign for Recorded {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Recorded {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Arithmetic for Recorded {
    fn from_f64(value: f64) -> Self {
        record(Operation::Constant(value))
    }
}

impl Elementary for Recorded {
    fn tanh(self) -> Self {
        record(Operation::Tanh(self.node))
    }
    fn exp(self) -> Self {
        record(Operation::Exp(self.node))
    }
    fn sin(self) -> Self {
        record(Operation::Sin(self.node))
    }
    fn cos(self) -> Self {
        // The sine is recorded with its companion cosine.
        Self { node: record(Operation::Sin(self.node)).node + 1 }
    }
    fn sqrt(self) -> Self {
        record(Operation::Sqrt(self.node))
    }
    fn sign(self) -> Self {
        record(Operation::Sign(self.node))
    }
}

/// The operations of a function of `N` variables with `N` values, in order.
#[derive(Clone, Debug, Default)]
pub struct Program<const N: usize> {
    operations: Vec<Operation>,
    outputs: Vec<Node>,
    tanh_arguments: Vec<Node>,
}

impl<const N: usize> Program<N> {
    /// Records `function`.
    pub fn record(function: impl FnOnce(&SVector<Recorded, N>) -> SVector<Recorded, N>) -> Self {
        OPERATIONS.with_borrow_mut(|o| {
            o.clear();
            o.extend((0..N).map(Operation::Variable));
        });
        let values = function(&SVector::from_fn(|node, _| Recorded { node }));
        let operations = OPERATIONS.take();
        let mut tanh_arguments = Vec::new();
        for operation in &operations {
            if let Operation::Tanh(argument) = operation {
                tanh_arguments.push(*argument);
            }
        }
        Self { operations, outputs: values.iter().map(|v| v.node).collect(), tanh_arguments }
    }

    /// How many tanh the function has.
    pub fn tanh_count(&self) -> usize {
        self.tanh_arguments.len()
    }
}

/// What an equation's constants, given as `f64`, stand for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Constants {
    /// Themselves: the same equation that `f64` methods solve.
    #[default]
    Binary,
    /// The shortest decimal number that reads as this `f64`: 0.1 is one tenth. In extended precision, that is another
    /// equation: on the paper's orbits, the 1e-17 between the two has grown to 1e-12 a hundred units of time later.
    Decimal,
}

/// Power series in t, of the solution of x' = f(x) and of everything computed on the way.
#[derive(Clone, Debug)]
pub struct Solution<S, const N: usize> {
    degree: usize,
    /// The series of all operations, `degree + 1` coefficients each.
    coefficients: Vec<S>,
    program: Program<N>,
    /// The constant in each operation of the program (zero if it has none).
    constants: Vec<S>,
}

impl<S: Elementary + FromDecimal, const N: usize> Solution<S, N> {
    /// Room for series up to `degree`, of solutions of x' = f(x), f being `program`.
    pub fn new(degree: usize, program: Program<N>, constants: Constants) -> Self {
        let mut solution =
            Self { degree, coefficients: Vec::new(), program: Program::default(), constants: Vec::new() };
        solution.set_program(program, constants);
        solution
    }

    /// Replaces the equation.
    pub fn set_program(&mut self, program: Program<N>, constants: Constants) {
        self.constants.clear();
        self.constants.extend(program.operations.iter().map(|operation| match (operation.constant(), constants) {
            (None, _) => S::zero(),
            (Some(c), Constants::Binary) => S::from_f64(c),
            (Some(c), Constants::Decimal) => S::from_decimal(c),
        }));
        self.coefficients.clear();
        self.coefficients.resize(program.operations.len() * (self.degree + 1), S::zero());
        self.program = program;
    }

    /// The equation.
    pub fn program(&self) -> &Program<N> {
        &self.program
    }

    fn range(&self, node: Node) -> Range<usize> {
        node * (self.degree + 1)..(node + 1) * (self.degree + 1)
    }

    /// The series of the `i`-th component of the state: coefficient j belongs to t^j.
    pub fn component(&self, i: usize) -> &[S] {
        &self.coefficients[self.range(i)]
    }

    /// The series of the arguments of every tanh in the equation, up to degree `degree - 1`.
    pub fn tanh_arguments(&self) -> impl Iterator<Item = &[S]> {
        self.program.tanh_arguments.iter().map(|node| {
            let range = self.range(*node);
            &self.coefficients[range.start..range.end - 1]
        })
    }

    /// Computes the series of the solution that passes through `x` at t = 0.
    pub fn expand(&mut self, x: &SVector<S, N>) {
        let width = self.degree + 1;
        // Recurrences rely on coefficients not yet computed being zero.
        self.coefficients.fill(S::zero());
        for (i, value) in x.iter().enumerate() {
            self.coefficients[i * width] = *value;
        }
        for k in 0..self.degree {
            for node in N..self.program.operations.len() {
                self.coefficients[node * width + k] = self.coefficient(self.program.operations[node], node, k);
            }
            for i in 0..N {
                let output = self.program.outputs[i];
                self.coefficients[i * width + k + 1] =
                    self.coefficients[output * width + k] / S::from_f64((k + 1) as f64);
            }
        }
    }

    /// Coefficient `k` of an operation, those below `k` of itself and up to `k` of its arguments being known.
    #[inline]
    fn coefficient(&self, operation: Operation, node: Node, k: usize) -> S {
        let series = |n: Node| &self.coefficients[self.range(n)];
        let one_over = |sum: S| sum / S::from_f64(k as f64);
        match operation {
            Operation::Variable(i) => series(i)[k],
            Operation::Constant(_) => {
                if k == 0 {
                    self.constants[node]
                } else {
                    S::zero()
                }
            }
            Operation::Add(a, b) => series(a)[k] + series(b)[k],
            Operation::Sub(a, b) => series(a)[k] - series(b)[k],
            Operation::Neg(a) => -series(a)[k],
            Operation::Scale(a, _) => series(a)[k] * self.constants[node],
            Operation::Over(a, _) => series(a)[k] / self.constants[node],
            Operation::Mul(a, b) if a == b => square(series(a), k),
            Operation::Mul(a, b) => convolution(series(a), series(b), 0, k),
            Operation::Div(a, b) => {
                let (a, b) = (series(a), series(b));
                (a[k] - tail(series(node), b, k)) / b[0]
            }
            Operation::Exp(a) if k == 0 => series(a)[0].exp(),
            Operation::Exp(a) => one_over(weighted(series(a), series(node), k)),
            Operation::Sqrt(a) if k == 0 => series(a)[0].sqrt(),
            Operation::Sqrt(a) => {
                let r = series(node);
                // r_k is still zero, so that the square's coefficient lacks exactly 2 r_0 r_k.
                (series(a)[k] - square(r, k)) / r[0].scale(2.0)
            }
            Operation::Sign(a) if k == 0 => series(a)[0].sign(),
            Operation::Sign(_) => S::zero(),
            Operation::Tanh(a) if k == 0 => series(a)[0].tanh(),
            // u' = a' (1 - u^2)
            Operation::Tanh(a) => one_over(weighted(series(a), series(node + 1), k)),
            // As (1 - u)(1 + u): exactly zero where tanh is saturated, and accurate near it.
            Operation::TanhSlope(u) if k == 0 => (S::one() - series(u)[0]) * (S::one() + series(u)[0]),
            Operation::TanhSlope(u) => -square(series(u), k),
            Operation::Sin(a) if k == 0 => series(a)[0].sin(),
            Operation::Sin(a) => one_over(weighted(series(a), series(node + 1), k)),
            Operation::Cos(a) if k == 0 => series(a)[0].cos(),
            Operation::Cos(a) => -one_over(weighted(series(a), series(node - 1), k)),
        }
    }
}

/// sum over j from `first` to k of a_j b_(k-j).
#[inline]
fn convolution<S: Arithmetic>(a: &[S], b: &[S], first: usize, k: usize) -> S {
    let mut sum = S::zero();
    for j in first..=k {
        sum += a[j] * b[k - j];
    }
    sum
}

/// sum over j from 1 to k of c_(k-j) b_j: what the known part of a quotient c = a/b contributes to a.
#[inline]
fn tail<S: Arithmetic>(c: &[S], b: &[S], k: usize) -> S {
    convolution(b, c, 1, k)
}

/// Coefficient k of a^2, each product once.
#[inline]
fn square<S: Arithmetic>(a: &[S], k: usize) -> S {
    let mut sum = S::zero();
    for j in 0..k.div_ceil(2) {
        sum += a[j] * a[k - j];
    }
    sum += sum;
    if k.is_multiple_of(2) {
        sum += a[k / 2].squared();
    }
    sum
}

/// sum over j from 1 to k of j a_j b_(k-j): k times the coefficient k of the integral of a' b.
#[inline]
fn weighted<S: Arithmetic>(a: &[S], b: &[S], k: usize) -> S {
    let mut sum = S::zero();
    for j in 1..=k {
        sum += a[j].scale(j as f64) * b[k - j];
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::Scalar;
    use nalgebra::vector;

    fn expand<const N: usize>(
        degree: usize,
        x: SVector<f64, N>,
        f: impl Fn(&SVector<Recorded, N>) -> SVector<Recorded, N>,
    ) -> Solution<DoubleDouble, N> {
        let mut solution = Solution::new(degree, Program::record(f), Constants::Binary);
        solution.expand(&x.map(DoubleDouble::from_f64));
        solution
    }

    /// The coefficients of the first component against known ones.
    #[track_caller]
    fn first_is<const N: usize>(solution: &Solution<DoubleDouble, N>, want: impl Fn(usize) -> f64) {
        for (j, c) in solution.component(0).iter().enumerate() {
            let w = want(j);
            assert!((c.to_f64() - w).abs() <= 4e-16 * w.abs().max(1e-3), "coefficient {j}: {c:?}, expected {w}");
        }
    }

    fn factorial(n: usize) -> f64 {
        (1..=n).map(|k| k as f64).product()
    }

    // Equations whose solutions have known series; each names the recurrence it tests.

    #[test]
    fn linear() {
        first_is(&expand(25, vector![1.0], |x| vector![x[0]]), |j| 1.0 / factorial(j));
        // x' = 1 - 2x/4 - x/2 = 1 - x from 0: 1 - exp(-t)
        let s = expand(20, vector![0.0], |x| {
            vector![Recorded::one() - x[0].scale(2.0) / Recorded::from_f64(4.0) - x[0].scale(0.5)]
        });
        first_is(&s, |j| if j == 0 { 0.0 } else { -(if j % 2 == 0 { 1.0 } else { -1.0 }) / factorial(j) });
    }

    #[test]
    fn products_and_squares() {
        // x' = x^2: 1/(1 - t)
        first_is(&expand(25, vector![1.0], |x| vector![x[0].squared()]), |_| 1.0);
        // x' = x y, y' = y: x = exp(exp(t) - 1), Bell numbers over factorials
        let bell = [1.0, 1.0, 2.0, 5.0, 15.0, 52.0, 203.0, 877.0, 4140.0];
        first_is(&expand(8, vector![1.0, 1.0], |x| vector![x[0] * x[1], x[1]]), |j| bell[j] / factorial(j));
    }

    #[test]
    fn quotients_and_roots() {
        // x' = 1/(2x): sqrt(1 + t); and x' = sqrt(x): (1 + t/2)^2
        let binomial = |j: usize| (0..j).fold(1.0, |b, i| b * (0.5 - i as f64) / (i + 1) as f64);
        first_is(&expand(20, vector![1.0], |x| vector![Recorded::one() / x[0].scale(2.0)]), binomial);
        first_is(&expand(20, vector![1.0], |x| vector![x[0].sqrt()]), |j| {
            [1.0, 1.0, 0.25].get(j).copied().unwrap_or(0.0)
        });
    }

    #[test]
    fn exponential_sine_cosine() {
        // x' = exp(-x): ln(1 + t)
        first_is(&expand(20, vector![0.0], |x| vector![(-x[0]).exp()]), |j| match j {
            0 => 0.0,
            _ => (if j % 2 == 0 { -1.0 } else { 1.0 }) / j as f64,
        });
        // x' = cos y, y' = 1: sin t; x' = sin y: 1 - cos t
        let sine = |j: usize| match j % 4 {
            1 => 1.0 / factorial(j),
            3 => -1.0 / factorial(j),
            _ => 0.0,
        };
        first_is(&expand(20, vector![0.0, 0.0], |x| vector![x[1].cos(), Recorded::one()]), sine);
        first_is(&expand(20, vector![0.0, 0.0], |x| vector![x[1].sin(), Recorded::one()]), |j| match j {
            0 => 0.0,
            _ => sine(j - 1) / j as f64,
        });
    }

    #[test]
    fn hyperbolic_tangent() {
        // x' = tanh(y), y' = 1: ln cosh t = t^2/2 - t^4/12 + t^6/45 - 17 t^8/2520 + 31 t^10/14175
        let want = [0.0, 0.0, 0.5, 0.0, -1.0 / 12.0, 0.0, 1.0 / 45.0, 0.0, -17.0 / 2520.0, 0.0, 31.0 / 14175.0];
        let s = expand(10, vector![0.0, 0.0], |x| vector![x[1].tanh(), Recorded::one()]);
        first_is(&s, |j| want[j]);
        assert_eq!(s.tanh_arguments().count(), 1);
        assert_eq!(s.tanh_arguments().next().unwrap()[1], DoubleDouble::one());
    }

    #[test]
    fn a_saturated_tanh_is_exactly_constant() {
        let s = expand(12, vector![0.0, 40.0], |x| vector![x[1].tanh(), x[0]]);
        let c = s.component(0);
        assert_eq!(c[1], DoubleDouble::one());
        assert!(c[2..].iter().all(|c| *c == DoubleDouble::zero()));
    }

    #[test]
    fn decimal_constants_are_decimal() {
        let p =
            Program::<1>::record(|x| vector![x[0].scale(0.1) / Recorded::from_f64(1e-3) + Recorded::from_f64(-1.2)]);
        let slope = |constants| {
            let mut s = Solution::<DoubleDouble, 1>::new(1, p.clone(), constants);
            s.expand(&vector![DoubleDouble::one()]);
            (s.component(0)[1] - DoubleDouble::from_decimal(98.8)).to_f64().abs()
        };
        assert!(slope(Constants::Decimal) < 1e-29);
        assert!(slope(Constants::Binary) > 1e-16);
    }

    #[test]
    fn shared_terms_are_computed_once() {
        let p = Program::<2>::record(|x| vector![x[0] * x[1] + x[0], x[0] * x[1] - x[0].tanh()]);
        // Two variables, product, sum, tanh with its slope, difference.
        assert_eq!(p.operations.len(), 7);
    }

    #[test]
    fn absolute_value_by_the_sign_at_the_start() {
        // x' = -|x| from -1: -exp(t); from 1: exp(-t)
        for (start, sign) in [(-1.0, 1.0), (1.0, -1.0_f64)] {
            let s = expand(12, vector![start], |x| vector![-x[0].abs()]);
            first_is(&s, |j| start * (if j % 2 == 0 { 1.0 } else { sign }) / factorial(j));
        }
    }
}
