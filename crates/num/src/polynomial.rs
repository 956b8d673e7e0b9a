//! Polynomial equations, and the Taylor series of their solutions at a small cost.
//!
//! A smoothed switch, tanh u, is a constant outside its layer. What is left of many equations is
//! then a polynomial, and a [`Flow`] is that polynomial as it is cheapest: sums of states and of
//! products of such sums, equal ones only once, terms that cancel gone. So it is another rounding
//! of the equation than its tape, for methods whose bits are their own. The series come by the
//! Cauchy product alone (Moore 1966, ch. 11).

mod radial;

use self::radial::Radial;
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

/// An equation outside its layer, and the argument of the layer.
#[derive(Clone, Debug, Default, PartialEq)]
struct Reduced {
    /// The factors of each product.
    products: Vec<(Affine, Affine)>,
    derivatives: Vec<Affine>,
    argument: Option<Affine>,
}

/// Why an equation is not a polynomial outside a layer: the error of [`Flow::new`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NotPolynomial {
    /// It has operations that are neither sums nor products.
    #[error("outside the layer it is no polynomial: it has an operation {0}")]
    Operation(&'static str),
    /// It has several tanh.
    #[error("it has more than one tanh, and so more than one layer")]
    Layers,
    /// It is too long.
    #[error("it has too many different products")]
    Size,
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
                (Operation::Mul(a, b), _) => {
                    reduced.product(tape.variables(), &values[a], &values[b])
                }
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
                (Operation::Constant(_) | Operation::Parameter(_) | Operation::Pi, None) => {
                    Affine::default()
                }
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
        let same = |known: &(Affine, Affine)| {
            *known == (a.clone(), b.clone()) || *known == (b.clone(), a.clone())
        };
        let index = self.products.iter().position(same).unwrap_or_else(|| {
            self.products.push((a.clone(), b.clone()));
            self.products.len() - 1
        });
        Affine::quantity(states + index).scaled(f * g)
    }
}

/// A sum as it is computed: constant + terms + products.
#[derive(Clone, Debug)]
struct Sum {
    constant: f64,
    /// Series and their factors.
    terms: Vec<(usize, f64)>,
    /// Pairs of series and the factors of their products.
    products: Vec<(usize, usize, f64)>,
}

/// Most series of an equation.
const MANY: usize = 64;

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

/// Coefficients of the series while they are computed. Products are sums over two rows, one of them
/// reversed, eight lanes at a time; coefficients beyond the degree reached are zero.
#[derive(Clone, Debug)]
pub struct Series {
    /// Row s: coefficients 0, 1, ... of series s.
    forward: Box<[[f64; 2 * LONG]; MANY]>,
    /// Row s: coefficient k of series s, for k > 0, at `LONG - k`; zeros from `LONG` on.
    backward: Box<[[f64; 2 * LONG]; MANY]>,
}

impl Series {
    /// Maximum degree of a series.
    pub const MOST: usize = LONG - 1;

    /// The series of the state's `i`-th component, from the coefficient of degree 0 on.
    #[inline]
    pub fn component(&self, i: usize) -> &[f64] {
        &self.forward[i]
    }
}

impl Default for Series {
    fn default() -> Self {
        let rows = || Box::new([[0.0; 2 * LONG]; MANY]);
        Self { forward: rows(), backward: rows() }
    }
}

/// A polynomial equation x' = f(x), made ready for series of its solutions.
#[derive(Clone, Debug)]
pub struct Flow {
    dimension: usize,
    /// Series number `dimension + i` is sum i.
    sums: Vec<Sum>,
    derivatives: Vec<Sum>,
    argument: Option<Sum>,
    /// The argument's gradient and value at 0, if it is a sum of states.
    linear: Option<(Vec<f64>, f64)>,
    /// The equation in a form that has a faster way.
    radial: Option<Radial>,
}

impl Flow {
    /// Compiles the equation on `tape` with every tanh replaced by the number `tanh`.
    ///
    /// # Errors
    /// If the result is not a polynomial, if the tanh have different arguments, or if it has too
    /// many terms.
    pub fn new(tape: &Tape, tanh: f64) -> Result<Self, NotPolynomial> {
        let reduced = Reduced::new(tape, tanh)?;
        let dimension = tape.variables();
        // Factors that are no single quantity are series of their own, and so are products that are
        // wanted more than once.
        let mut factors: Vec<&Affine> = Vec::new();
        for factor in reduced.products.iter().flat_map(|(a, b)| [a, b]) {
            if factor.single().is_none() && !factors.contains(&factor) {
                factors.push(factor);
            }
        }
        let mut wanted = vec![0; dimension + reduced.products.len()];
        for sum in factors.iter().copied().chain(&reduced.derivatives).chain(&reduced.argument) {
            sum.terms.iter().for_each(|(quantity, _)| wanted[*quantity] += 1);
        }
        for factor in reduced.products.iter().flat_map(|(a, b)| [a, b]) {
            if let Some((quantity, _)) = factor.single() {
                wanted[quantity] += 2;
            }
        }
        let mut writer =
            Writer { reduced: &reduced, wanted, places: Vec::new(), sums: Vec::new(), dimension };
        let derivatives = reduced.derivatives.iter().map(|sum| writer.sum(sum)).collect();
        let argument = reduced.argument.as_ref().map(|sum| writer.sum(sum));
        let linear = reduced
            .argument
            .as_ref()
            .filter(|sum| sum.terms.iter().all(|(q, _)| *q < dimension))
            .map(|sum| {
                let mut gradient = vec![0.0; dimension];
                sum.terms.iter().for_each(|&(state, factor)| gradient[state] = factor);
                (gradient, sum.constant)
            });
        let sums = writer.sums;
        if dimension + sums.len() > MANY {
            return Err(NotPolynomial::Size);
        }
        // A layer's argument that is no sum of states needs its own products for its series.
        let radial = Radial::new(&reduced).filter(|_| argument.is_none() || linear.is_some());
        Ok(Self { dimension, sums, derivatives, argument, linear, radial })
    }

    /// Whether the equation has a layer.
    pub fn has_layer(&self) -> bool {
        self.argument.is_some()
    }

    /// The gradient of the tanh's argument, and its value at 0, if it is a sum of states.
    pub fn linear_argument(&self) -> Option<(&[f64], f64)> {
        self.linear.as_ref().map(|(gradient, constant)| (&gradient[..], *constant))
    }

    /// Computes the Taylor coefficients, up to `degree`, of the solution through `x` at t = 0.
    ///
    /// # Panics
    /// If `x` is not as long as the equation, or `degree` more than [`Series::MOST`].
    #[inline]
    pub fn expand(&self, x: &[f64], degree: usize, series: &mut Series) {
        assert!(
            x.len() == self.dimension && degree <= Series::MOST,
            "one number a component, and a degree that there is room for"
        );
        if let (Some(radial), &[x, y, z]) = (&self.radial, x) {
            return radial.expand([x, y, z], degree, series);
        }
        pulp::Arch::new().dispatch(Expansion { flow: self, x, degree, series });
    }

    #[inline(always)]
    fn expand_here(&self, x: &[f64], degree: usize, series: &mut Series) {
        let Series { forward, backward } = series;
        let mut now = [0.0; MANY];
        now[..x.len()].copy_from_slice(x);
        let mut next = [0.0; MANY];
        for k in 0..degree {
            for (i, sum) in self.sums.iter().enumerate() {
                now[(self.dimension + i) % MANY] = sum.coefficient(k, &now, forward, backward);
            }
            for (i, sum) in self.derivatives.iter().enumerate() {
                next[i % MANY] =
                    sum.coefficient(k, &now, forward, backward) * RECIPROCALS[k % LONG];
            }
            for s in 0..(self.dimension + self.sums.len()).min(MANY) {
                forward[s][k % LONG] = now[s];
                // The entry of coefficient 0 is never read.
                backward[s][(LONG - k.max(1)) % LONG] = now[s];
            }
            now[..x.len()].copy_from_slice(&next[..x.len()]);
        }
        for (i, now) in now[..x.len()].iter().enumerate() {
            forward[i][degree % LONG] = *now;
        }
    }

    /// Coefficient `k` of the tanh's argument, from the series that [`Flow::expand`] has made; `k`
    /// below its degree, or equal if the argument is a sum of states.
    #[inline]
    pub fn argument(&self, k: usize, series: &Series) -> f64 {
        let Some(sum) = &self.argument else { return 0.0 };
        let at = |s: usize, k: usize| series.forward[s][k];
        let mut value = if k == 0 { sum.constant } else { 0.0 };
        for (s, factor) in &sum.terms {
            value += at(*s, k) * factor;
        }
        for (a, b, factor) in &sum.products {
            value += (0..=k).map(|j| at(*a, j) * at(*b, k - j)).sum::<f64>() * factor;
        }
        value
    }
}

impl Sum {
    /// The coefficient of degree `k`, those of all factors being known in rows below that degree,
    /// and at it in `now`.
    #[inline(always)]
    fn coefficient(
        &self,
        k: usize,
        now: &[f64; MANY],
        forward: &[[f64; 2 * LONG]; MANY],
        backward: &[[f64; 2 * LONG]; MANY],
    ) -> f64 {
        // The remainders change nothing, since there are fewer than MANY series, and spare the
        // checks.
        let mut value = if k == 0 { self.constant } else { 0.0 };
        for (s, factor) in &self.terms {
            value += now[s % MANY] * factor;
        }
        for (a, b, factor) in &self.products {
            let (a, b) = (a % MANY, b % MANY);
            let product = if k == 0 {
                now[a] * now[b]
            } else {
                middle(&forward[a], &backward[b], k)
                    + (forward[a][0] * now[b] + now[a] * forward[b][0])
            };
            value += product * factor;
        }
        value
    }
}

/// Puts sums into the order in which they can be computed.
struct Writer<'a> {
    reduced: &'a Reduced,
    /// Number of uses of each quantity.
    wanted: Vec<usize>,
    /// Factors that have become series.
    places: Vec<(Affine, usize)>,
    sums: Vec<Sum>,
    dimension: usize,
}

impl Writer<'_> {
    fn sum(&mut self, of: &Affine) -> Sum {
        let mut sum = Sum { constant: of.constant, terms: Vec::new(), products: Vec::new() };
        for &(quantity, factor) in &of.terms {
            if quantity < self.dimension {
                sum.terms.push((quantity, factor));
            } else if self.wanted[quantity] > 1 {
                sum.terms.push((self.place(&Affine::quantity(quantity)), factor));
            } else {
                let (a, b) = self.factors(quantity);
                sum.products.push((a, b, factor));
            }
        }
        sum
    }

    fn factors(&mut self, product: usize) -> (usize, usize) {
        let reduced = self.reduced;
        let (a, b) = &reduced.products[product - self.dimension];
        (self.place(a), self.place(b))
    }

    /// The series of a factor.
    fn place(&mut self, factor: &Affine) -> usize {
        let factor = match factor.single() {
            Some((quantity, _)) if quantity < self.dimension => return quantity,
            Some((quantity, _)) => Affine::quantity(quantity),
            None => factor.clone(),
        };
        if let Some((_, place)) = self.places.iter().find(|(known, _)| *known == factor) {
            return *place;
        }
        let sum = match factor.single() {
            Some((product, _)) => {
                let (a, b) = self.factors(product);
                Sum { constant: 0.0, terms: Vec::new(), products: vec![(a, b, 1.0)] }
            }
            None => self.sum(&factor),
        };
        self.sums.push(sum);
        let place = self.dimension + self.sums.len() - 1;
        self.places.push((factor, place));
        place
    }
}

/// [`Flow::expand`], in the machine's own instructions: each lane rounds by itself and sums have
/// one order, so that they change no bit.
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

/// sum of a_j b_(k-j) over 0 < j < k, for 0 < k < LONG, from a row and a backward row.
#[inline(always)]
fn middle(a: &[f64; 2 * LONG], b: &[f64; 2 * LONG], k: usize) -> f64 {
    // Term m = j - 1; from m = k - 1 on they are zero.
    let (a, b) = (&a[1..=LONG], &b[(LONG + 1 - k) % (LONG + 1)..][..LONG]);
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
mod tests;
