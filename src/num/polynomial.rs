//! Polynomial equations, and the Taylor series of their solutions at a small cost.
//!
//! A smoothed switch, tanh u, is a constant outside its layer. What is left of many equations is then a polynomial, and a [`Flow`] is
//! that polynomial as it is cheapest: sums of states and of products of such sums, equal ones only once, terms that cancel gone. So
//! it is another rounding of the equation than its tape, for methods whose bits are their own. The series come by the Cauchy
//! product alone (Moore 1966, ch. 11).

use super::decimal::Decimal;
use super::tape::{Operation, Tape};

/// constant + sum of factor * quantity: quantities are the states, then the products.
#[derive(Clone, Debug, Default, PartialEq)]
struct Affine {
    constant: f64,
    /// By quantity, no factor zero.
    terms: Vec<(usize, f64)>,
}

impl Affine {
    fn constant(value: f64) -> Self {
        Self { constant: value, terms: Vec::new() }
    }

    fn quantity(index: usize) -> Self {
        Self { constant: 0.0, terms: vec![(index, 1.0)] }
    }

    /// self + factor * other.
    fn plus(&self, factor: f64, other: &Self) -> Self {
        let mut terms = self.terms.clone();
        for &(quantity, f) in &other.terms {
            match terms.binary_search_by_key(&quantity, |term| term.0) {
                Ok(i) => terms[i].1 += factor * f,
                Err(i) => terms.insert(i, (quantity, factor * f)),
            }
        }
        terms.retain(|term| term.1 != 0.0);
        Self { constant: self.constant + factor * other.constant, terms }
    }

    fn scaled(&self, factor: f64) -> Self {
        Self::default().plus(factor, self)
    }

    /// The number that it is, if it is one.
    fn number(&self) -> Option<f64> {
        self.terms.is_empty().then_some(self.constant)
    }

    /// factor * quantity, if it is that.
    fn single(&self) -> Option<(usize, f64)> {
        match self.terms[..] {
            [term] if self.constant == 0.0 => Some(term),
            _ => None,
        }
    }
}

/// What an equation outside its layer is, and where the layer is.
#[derive(Clone, Debug, Default, PartialEq)]
struct Reduced {
    /// The factors of each product.
    products: Vec<(Affine, Affine)>,
    derivatives: Vec<Affine>,
    argument: Option<Affine>,
}

/// Why an equation is no polynomial outside a layer. Said of a tape by [`Flow::new`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotPolynomial {
    /// It has operations that are neither sums nor products.
    #[error("outside the layer it is no polynomial: it has an operation {0}")]
    Operation(&'static str),
    /// It has several tanh.
    #[error("it has more than one tanh, and so more than one layer")]
    Layers,
}

impl Reduced {
    fn new(tape: &Tape, tanh: f64) -> Result<Self, NotPolynomial> {
        let (needed, fixed) = (tape.needed(), tape.fixed(Decimal::value));
        let mut reduced = Self::default();
        let mut layer = None;
        let mut values: Vec<Affine> = Vec::with_capacity(tape.operations().len());
        for (node, operation) in tape.operations().iter().enumerate() {
            let refused = |name| Err(NotPolynomial::Operation(name));
            let value = match (*operation, fixed[node]) {
                (_, Some(value)) => Affine::constant(value),
                _ if !needed[node] => Affine::default(),
                (Operation::Variable(i), _) => Affine::quantity(i),
                (Operation::Add(a, b), _) => values[a].plus(1.0, &values[b]),
                (Operation::Sub(a, b), _) => values[a].plus(-1.0, &values[b]),
                (Operation::Neg(a), _) => values[a].scaled(-1.0),
                (Operation::Mul(a, b), _) => reduced.product(tape.variables(), &values[a], &values[b]),
                (Operation::Div(a, b), _) => match values[b].number() {
                    Some(divisor) => values[a].scaled(1.0 / divisor),
                    None => return refused("/"),
                },
                (Operation::Tanh(a), _) => {
                    if layer.is_some_and(|known| known != a) {
                        return Err(NotPolynomial::Layers);
                    }
                    layer = Some(a);
                    Affine::constant(tanh)
                }
                (Operation::Exp(_), _) => return refused("exp"),
                (Operation::Ln(_), _) => return refused("ln"),
                (Operation::Sin(_), _) => return refused("sin"),
                (Operation::Cos(_), _) => return refused("cos"),
                (Operation::Sqrt(_), _) => return refused("sqrt"),
                (Operation::Atan(_), _) => return refused("atan"),
                (Operation::Erf(_), _) => return refused("erf"),
                (Operation::Sign(_), _) => return refused("sign"),
                (Operation::Constant(_) | Operation::Parameter(_) | Operation::Pi, None) => Affine::default(),
            };
            values.push(value);
        }
        reduced.derivatives = tape.outputs().iter().map(|node| values[*node].clone()).collect();
        reduced.argument = layer.map(|node| values[node].clone());
        Ok(reduced)
    }

    fn product(&mut self, states: usize, a: &Affine, b: &Affine) -> Affine {
        if let Some(c) = a.number() {
            return b.scaled(c);
        }
        if let Some(c) = b.number() {
            return a.scaled(c);
        }
        // c x times d y is c d times the product of x and y.
        let bare = |factor: &Affine| match factor.single() {
            Some((quantity, f)) => (Affine::quantity(quantity), f),
            None => (factor.clone(), 1.0),
        };
        let ((a, f), (b, g)) = (bare(a), bare(b));
        let same = |known: &(Affine, Affine)| *known == (a.clone(), b.clone()) || *known == (b.clone(), a.clone());
        let index = self.products.iter().position(same).unwrap_or_else(|| {
            self.products.push((a.clone(), b.clone()));
            self.products.len() - 1
        });
        Affine::quantity(states + index).scaled(f * g)
    }
}

/// A sum as it is computed.
#[derive(Clone, Copy, Debug)]
struct Sum {
    constant: f64,
    /// Its terms: a range of [`Flow::terms`].
    first: usize,
    last: usize,
}

/// How the next coefficient of a series comes from those of others.
#[derive(Clone, Copy, Debug)]
enum Rule {
    Sum(Sum),
    Product(usize, usize),
}

/// Most coefficients of a series.
const LONG: usize = 32;

/// 1/(k + 1).
const RECIPROCALS: [f64; LONG] = {
    let mut table = [1.0; LONG];
    let mut k = 0;
    while k < LONG {
        table[k] = 1.0 / (k + 1) as f64;
        k += 1;
    }
    table
};

/// Series being computed. Products are sums over two rows, one of them backwards, in eight lanes at a time: what lies beyond
/// the degree reached is multiplied by zeros.
#[derive(Clone, Debug, Default)]
pub struct Series {
    /// Row s: coefficients 0, 1, ... of series s.
    forward: Vec<[f64; LONG + 8]>,
    /// Row s: coefficient k of series s, for k > 0, at `LONG - k`; zeros from `LONG` on.
    backward: Vec<[f64; 2 * LONG]>,
    /// The coefficients of the degree that is being computed.
    now: Vec<f64>,
}

impl Series {
    /// Largest degree.
    pub const MOST: usize = LONG - 1;

    /// The series of the state's `i`-th component, from the coefficient of degree 0 on.
    #[inline]
    pub fn component(&self, i: usize) -> &[f64] {
        &self.forward[i]
    }
}

/// A polynomial equation x' = f(x), made ready for series of its solutions.
#[derive(Clone, Debug)]
pub struct Flow {
    dimension: usize,
    /// Series number `dimension + i` comes by rule i.
    rules: Vec<Rule>,
    terms: Vec<(usize, f64)>,
    derivatives: Vec<Sum>,
    argument: Option<Sum>,
    /// The argument's gradient and value at 0, if it is a sum of states.
    linear: Option<(Vec<f64>, f64)>,
}

impl Flow {
    /// The equation on `tape` with every tanh replaced by the number `tanh`.
    ///
    /// # Errors
    /// If that is no polynomial, or if there are tanh of two arguments.
    pub fn new(tape: &Tape, tanh: f64) -> Result<Self, NotPolynomial> {
        let reduced = Reduced::new(tape, tanh)?;
        let dimension = tape.variables();
        let mut flow = Self {
            dimension,
            rules: Vec::new(),
            terms: Vec::new(),
            derivatives: Vec::new(),
            argument: None,
            linear: None,
        };
        // The series of each quantity, and those of the sums that are factors.
        let mut series: Vec<usize> = (0..dimension).collect();
        let mut sums: Vec<(Affine, usize)> = Vec::new();
        for (a, b) in &reduced.products {
            let [a, b] = [a, b].map(|factor| match factor.single() {
                Some((quantity, _)) => series[quantity],
                None => match sums.iter().find(|(known, _)| known == factor) {
                    Some((_, at)) => *at,
                    None => {
                        let sum = flow.sum(factor, &series);
                        let at = flow.push(Rule::Sum(sum));
                        sums.push((factor.clone(), at));
                        at
                    }
                },
            });
            let product = flow.push(Rule::Product(a, b));
            series.push(product);
        }
        flow.derivatives = reduced.derivatives.iter().map(|sum| flow.sum(sum, &series)).collect();
        if let Some(argument) = &reduced.argument {
            flow.argument = Some(flow.sum(argument, &series));
            if argument.terms.iter().all(|(quantity, _)| *quantity < dimension) {
                let mut gradient = vec![0.0; dimension];
                argument.terms.iter().for_each(|&(state, factor)| gradient[state] = factor);
                flow.linear = Some((gradient, argument.constant));
            }
        }
        Ok(flow)
    }

    fn push(&mut self, rule: Rule) -> usize {
        self.rules.push(rule);
        self.dimension + self.rules.len() - 1
    }

    fn sum(&mut self, sum: &Affine, series: &[usize]) -> Sum {
        let first = self.terms.len();
        self.terms.extend(sum.terms.iter().map(|&(quantity, factor)| (series[quantity], factor)));
        Sum { constant: sum.constant, first, last: self.terms.len() }
    }

    /// Whether the equation has a layer.
    pub fn has_layer(&self) -> bool {
        self.argument.is_some()
    }

    /// The gradient of the tanh's argument, and its value at 0, if it is a sum of states.
    pub fn linear_argument(&self) -> Option<(&[f64], f64)> {
        self.linear.as_ref().map(|(gradient, constant)| (&gradient[..], *constant))
    }

    /// Room for series up to `degree`, at most [`Series::MOST`].
    ///
    /// # Panics
    /// If that is too much.
    pub fn room(&self, degree: usize) -> Series {
        assert!(degree <= Series::MOST, "series have {} coefficients at most", LONG);
        let count = self.dimension + self.rules.len();
        Series { forward: vec![[0.0; LONG + 8]; count], backward: vec![[0.0; 2 * LONG]; count], now: vec![0.0; count] }
    }

    /// Computes the Taylor coefficients, up to `degree`, of the solution through `x` at t = 0.
    ///
    /// # Panics
    /// If `series` is not this equation's [`Flow::room`], or `x` not as long as the equation.
    #[inline]
    pub fn expand(&self, x: &[f64], degree: usize, series: &mut Series) {
        assert!(
            x.len() == self.dimension && series.now.len() == self.dimension + self.rules.len(),
            "one number a component"
        );
        pulp::Arch::new().dispatch(Expansion { flow: self, x, degree, series });
    }

    #[inline(always)]
    fn expand_here(&self, x: &[f64], degree: usize, series: &mut Series) {
        // As slices, whose places stay in registers.
        let (forward, backward) = (series.forward.as_mut_slice(), series.backward.as_mut_slice());
        let (now, terms, dimension) = (series.now.as_mut_slice(), self.terms.as_slice(), self.dimension);
        now[..x.len()].copy_from_slice(x);
        for k in 0..degree.min(Series::MOST) {
            for (i, rule) in self.rules.iter().enumerate() {
                now[dimension + i] = match *rule {
                    Rule::Sum(sum) => total(sum, terms, k, |at| now[at]),
                    Rule::Product(a, b) if k == 0 => now[a] * now[b],
                    Rule::Product(a, b) => {
                        let (left, right) = (&forward[a], &backward[b]);
                        left[0] * now[b] + now[a] * forward[b][0] + middle(left, right, k)
                    }
                };
            }
            for ((now, forward), backward) in now.iter().zip(forward.iter_mut()).zip(backward.iter_mut()) {
                forward[k] = *now;
                // What would be the coefficient 0 is never read.
                backward[LONG - k.max(1)] = *now;
            }
            for (i, sum) in self.derivatives.iter().enumerate() {
                forward[i][k + 1] = total(*sum, terms, k, |at| now[at]) * RECIPROCALS[k];
            }
            for (now, forward) in now[..dimension].iter_mut().zip(forward.iter()) {
                *now = forward[k + 1];
            }
        }
    }

    /// Coefficient `k` of the tanh's argument, from the series that [`Flow::expand`] has made; `k` below its degree, or equal if
    /// the argument is a sum of states.
    #[inline]
    pub fn argument(&self, k: usize, series: &Series) -> f64 {
        self.argument.map_or(0.0, |sum| total(sum, &self.terms, k, |at| series.forward[at][k]))
    }
}

/// A sum's coefficient of degree `k`.
#[inline(always)]
fn total(sum: Sum, terms: &[(usize, f64)], k: usize, coefficient: impl Fn(usize) -> f64) -> f64 {
    let mut value = if k == 0 { sum.constant } else { 0.0 };
    for (at, factor) in &terms[sum.first..sum.last] {
        value += coefficient(*at) * factor;
    }
    value
}

/// [`Flow::expand`], in the machine's own instructions: each lane rounds by itself and sums have one order, so that they change no bit.
struct Expansion<'a> {
    flow: &'a Flow,
    x: &'a [f64],
    degree: usize,
    series: &'a mut Series,
}

impl pulp::WithSimd for Expansion<'_> {
    type Output = ();
    #[inline(always)]
    fn with_simd<S: pulp::Simd>(self, _: S) {
        let Self { flow, x, degree, series } = self;
        flow.expand_here(x, degree, series);
    }
}

/// sum of a_j b_(k-j) over 0 < j < k, for 0 < k < LONG.
#[inline(always)]
fn middle(a: &[f64; LONG + 8], b: &[f64; 2 * LONG], k: usize) -> f64 {
    // Term m = j - 1; from m = k - 1 on they are zero.
    let (a, b) = (&a[1..=LONG], &b[LONG + 1 - k..][..LONG]);
    let mut sums = [0.0; 8];
    for j in 0..8 {
        sums[j] = a[j] * b[j];
    }
    if k > 9 {
        for j in 0..8 {
            sums[j] += a[8 + j] * b[8 + j];
        }
        if k > 17 {
            for j in 0..8 {
                sums[j] += a[16 + j] * b[16 + j] + a[24 + j] * b[24 + j];
            }
        }
    }
    let [s0, s1, s2, s3, s4, s5, s6, s7] = sums;
    ((s0 + s4) + (s2 + s6)) + ((s1 + s5) + (s3 + s7))
}

#[cfg(test)]
mod tests {
    use super::super::Elementary;
    use super::super::series::{Constants, Solution};
    use super::super::tape::Recorded;
    use super::*;
    use crate::num::Arithmetic;

    fn blend(x: &[Recorded]) -> Vec<Recorded> {
        let c = |v: f64| Recorded::from_f64(v);
        let r2 = x[0].squared() + x[1].squared() + x[2].squared();
        let (dy, dz) = ((c(0.1) - x[1].scale(1e-2)) * r2, (c(0.1) - x[2].scale(1e-2)) * r2);
        let plus = [-x[1], c(1.0) + dy, c(-1.2) + dz];
        let minus = [x[2], c(-1.4) + dy, c(1.0) + dz];
        let phi = (c(1.0) + (x[0] / c(1e-3)).tanh()).scale(0.5);
        plus.into_iter().zip(minus).map(|(p, m)| m + (p - m) * phi).collect()
    }

    #[test]
    fn outside_the_layer_the_series_are_those_of_the_tape() {
        let tape = Tape::record(3, blend);
        for (side, x) in [(1.0, [0.3, -0.7, 0.4]), (-1.0, [-0.3, 0.9, 0.2])] {
            let flow = Flow::new(&tape, side).unwrap();
            // Three squares, their sum, two factors, two products; the other field has cancelled.
            assert_eq!(flow.rules.len(), 8, "{flow:?}");
            let mut found = flow.room(12);
            for degree in [7, 12, 13, 15, 16, 17, 31] {
                found = flow.room(degree);
                let mut solution = Solution::new(degree, &tape, Constants::Binary);
                // What an earlier expansion has left is not in the way.
                for x in [[1e3, 7.0, -2.0], x] {
                    flow.expand(&x, degree, &mut found);
                    solution.expand(&x);
                }
                for i in 0..3 {
                    for (k, want) in solution.component(i).iter().enumerate() {
                        let got = found.component(i)[k];
                        assert!((got - want).abs() <= 1e-13 * (1.0 + want.abs()), "{degree} {i} {k}: {got} {want}");
                    }
                }
            }
            let (gradient, constant) = flow.linear_argument().unwrap();
            assert_eq!((gradient, constant), (&[1.0 / 1e-3, 0.0, 0.0][..], 0.0));
            assert_eq!(flow.argument(1, &found), found.component(0)[1] * (1.0 / 1e-3));
        }
    }

    #[test]
    fn instructions_change_no_bit() {
        use pulp::WithSimd;
        let flow = Flow::new(&Tape::record(3, blend), 1.0).unwrap();
        for degree in [9, 14, 25] {
            let (mut plain, mut here) = (flow.room(degree), flow.room(degree));
            let x = [0.3, -0.7, 0.4];
            Expansion { flow: &flow, x: &x, degree, series: &mut plain }.with_simd(pulp::Scalar);
            flow.expand(&x, degree, &mut here);
            for i in 0..3 {
                let bits = |series: &Series| series.component(i).iter().map(|c| c.to_bits()).collect::<Vec<_>>();
                assert_eq!(bits(&plain), bits(&here), "{degree}");
            }
        }
    }

    #[test]
    fn what_is_no_polynomial_is_refused() {
        let refused = |f: fn(&[Recorded]) -> Recorded| Flow::new(&Tape::record(1, |x| vec![f(x)]), 1.0).err();
        assert_eq!(refused(|x| x[0] * x[0] / Recorded::from_f64(3.0)), None);
        assert_eq!(refused(|x| x[0] * x[0] / x[0]), Some(NotPolynomial::Operation("/")));
        assert_eq!(refused(|x| x[0].exp()), Some(NotPolynomial::Operation("exp")));
        assert_eq!(refused(|x| x[0].tanh() + (x[0] + x[0]).tanh()), Some(NotPolynomial::Layers));
        // tanh of a number is a number.
        assert_eq!(refused(|x| x[0] * Recorded::from_f64(0.3).tanh()), None);
    }
}
