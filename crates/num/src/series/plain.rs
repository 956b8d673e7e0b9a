//! Reference implementation for tests: every recurrence at every degree, as in the literature.

use super::instruction::start_of;
use super::*;
use crate::Arithmetic;
use crate::tape::Recorded;

/// The solution through `x`, by the recurrences of `solution` alone.
pub(super) fn expanded<S: Elementary + FromDecimal>(
    solution: &Solution<S>,
    x: &[S],
) -> Solution<S> {
    let mut plain = solution.clone();
    let width = plain.degree + 1;
    plain.coefficients.fill(S::zero());
    for (i, value) in x.iter().enumerate() {
        plain.coefficients[i * width] = *value;
    }
    for k in 0..plain.degree {
        for (i, recurrence) in solution.recurrences.iter().enumerate() {
            let this = plain.dimension + i;
            plain.coefficients[this * width + k] = coefficient(&plain, recurrence, this, k);
        }
        for i in 0..plain.dimension {
            let slope = plain.series(plain.outputs[i])[k];
            plain.coefficients[i * width + k + 1] = slope.over((k + 1) as f64);
        }
    }
    plain
}

/// Coefficient `k` of a series, those below `k` of itself and up to `k` of its arguments being
/// known, all others zero.
fn coefficient<S: Elementary + FromDecimal>(
    solution: &Solution<S>,
    recurrence: &Recurrence<S>,
    this: Series,
    k: usize,
) -> S {
    let series = |n: Series| solution.series(n);
    let at = |n: Series| series(n)[k];
    if k == 0 {
        return match *recurrence {
            Recurrence::Mul(a, b) if a == b => square(series(a), 0),
            Recurrence::Mul(a, b) => convolution(series(a), series(b), 0, 0),
            Recurrence::Div(a, b) => (at(a) - tail(series(this), series(b), 0)) / at(b),
            _ => start_of(recurrence, at),
        };
    }
    // Coefficient k of the integral of a' b.
    let integral = |weights: Weights, b: &[S]| weighted(series(weights), b, k).over(k as f64);
    match *recurrence {
        Recurrence::Constant(_) | Recurrence::Sign(_) => S::zero(),
        Recurrence::Add(a, b) => at(a) + at(b),
        Recurrence::Sub(a, b) => at(a) - at(b),
        Recurrence::Neg(a) | Recurrence::Minus(a, _) => -at(a),
        Recurrence::Shift(a, _) => at(a),
        Recurrence::Scale(a, c) => at(a) * c,
        Recurrence::Over(a, c) => at(a) / c,
        Recurrence::Mul(a, b) if a == b => square(series(a), k),
        Recurrence::Mul(a, b) => convolution(series(a), series(b), 0, k),
        Recurrence::Div(a, b) => (at(a) - tail(series(this), series(b), k)) / series(b)[0],
        Recurrence::Weighted(a) => at(a).scale(k as f64),
        Recurrence::Exp(_, weights) => integral(weights, series(this)),
        // The coefficient asked for is still zero, so that the sum lacks exactly its term.
        Recurrence::Ln(a) => (at(a) - integral(this + 1, series(a))) / series(a)[0],
        Recurrence::Sqrt(a) => (at(a) - square(series(this), k)) / series(this)[0].scale(2.0),
        Recurrence::Tanh(_, weights) | Recurrence::Sin(_, weights) => {
            integral(weights, series(this + 1))
        }
        Recurrence::TanhSlope(u, _) => -square(series(u), k),
        Recurrence::Cos(_, weights) => -integral(weights, series(this - 1)),
        Recurrence::OnePlusSquare(a) => square(series(a), k),
        Recurrence::Atan(a) => (at(a) - integral(this + 1, series(this - 1))) / series(this - 1)[0],
        Recurrence::Erf(_, weights) => integral(weights, series(this - 1)),
    }
}

/// sum over j from `first` to k of a_j b_(k-j).
#[inline]
fn convolution<S: Arithmetic>(a: &[S], b: &[S], first: usize, k: usize) -> S {
    if k < first {
        return S::zero();
    }
    S::sum_of_products(&a[first..=k], &b[..=k - first])
}

/// sum over j from 1 to k of c_(k-j) b_j: what the known part of a quotient c = a/b contributes to
/// a.
#[inline]
fn tail<S: Arithmetic>(c: &[S], b: &[S], k: usize) -> S {
    convolution(b, c, 1, k)
}

/// Coefficient k of a^2, each product once.
#[inline]
fn square<S: Arithmetic>(a: &[S], k: usize) -> S {
    let half = k.div_ceil(2);
    let mut sum = S::sum_of_products(&a[..half], &a[k + 1 - half..=k]);
    sum += sum;
    if k.is_multiple_of(2) {
        sum += a[k / 2].squared();
    }
    sum
}

/// sum over j from 1 to k of j a_j b_(k-j), from the `weights` j a_j: k times the coefficient k of
/// the integral of a' b.
#[inline]
fn weighted<S: Arithmetic>(weights: &[S], b: &[S], k: usize) -> S {
    S::sum_of_products(&weights[1..=k], &b[..k])
}

/// A number that stands for one of `count` choices.
pub(super) fn one_of(count: usize, choice: usize) -> usize {
    choice % count
}

/// An equation made of these operations, each on results before it.
pub(super) fn equation(variables: usize, operations: &[(u8, usize, usize, f64)]) -> Tape {
    Tape::record(variables, |x| {
        let number = Recorded::from_f64;
        let mut known = x.to_vec();
        known.push(number(0.75));
        for &(kind, a, b, c) in operations {
            let (a, b) = (known[one_of(known.len(), a)], known[one_of(known.len(), b)]);
            // An argument for which a logarithm, a root or a quotient exists.
            let positive = |a: Recorded| a.squared() + number(0.5);
            known.push(match kind {
                0 => a + b,
                1 => a - b,
                2 => a * b,
                3 => a / positive(b),
                4 => -a,
                5 => a + number(c),
                6 => number(c) - a,
                7 => a * number(c),
                8 => a / number(c + 3.0),
                9 => a.squared(),
                10 => a.sin().exp(),
                11 => positive(a).ln(),
                12 => positive(a).sqrt(),
                13 => a.abs(),
                // Mostly saturated.
                14 => (a / number(0.01)).tanh(),
                15 => a.tanh(),
                16 => a.cos() + b.sin(),
                17 => a.atan(),
                18 => (a * number(c)).erf(),
                // A difference that is constant.
                _ => (a + number(c)) - (a + number(0.25)),
            });
        }
        known[known.len() - variables..].to_vec()
    })
}

#[test]
fn a_square_is_a_product_to_the_last_bits() {
    let c: Vec<f64> = (0..12).map(|i| 1.0 / f64::from(i + 3)).collect();
    for k in 0..12 {
        assert!((square(&c, k) - convolution(&c, &c, 0, k)).abs() < 1e-15, "{k}");
    }
    assert_eq!(convolution(&c, &c, 3, 2), 0.0);
    assert_eq!(square(&[1.0, 2.0, 3.0], 2), 10.0);
}
