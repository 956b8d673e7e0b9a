//! Series of equations whose only products are with the squared distance from the origin, by
//! relaxed products.
//!
//! The series of a product is wanted one degree at a time, and its newest coefficient is made of
//! the newest of its factors; computed when it is wanted, it waits for all of them. Here it is
//! computed before: as soon as x_k is known, its products with x_1, ..., x_k are added to the
//! coefficients k + 1, ..., 2k in which they belong (van der Hoeven 2002: relaxed products), all at
//! once in the lanes of a register. What is left for degree k itself are its products with x_0. A
//! pair (j, k - j) is thus added when its later member is known, so that of `D` degrees only the
//! first `D`/2 are ever multiplied by a later one: eight lanes do for degree 17.

use pulp::{Simd, WithSimd};

use super::{Affine, LONG, RECIPROCALS, Reduced, Series};
use crate::Registers;

/// x_0' = c_0 + l . x, x_i' = c_i + (a_i + b_i x_i) |x|^2 for i = 1, 2, where |x|^2 is the sum of
/// the three squares.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Radial {
    constants: [f64; 3],
    /// l.
    slopes: [f64; 3],
    /// a_1, a_2.
    gains: [f64; 2],
    /// b_1, b_2.
    bends: [f64; 2],
}

impl Radial {
    /// The equation, if it has this form.
    pub fn new(of: &Reduced) -> Option<Self> {
        const STATES: usize = 3;
        if of.derivatives.len() != STATES {
            return None;
        }
        // Whether a product is the square of a state.
        let is_square = |quantity: usize, state: usize| {
            let square = |factor: &Affine| factor.single() == Some((state, 1.0));
            quantity
                .checked_sub(STATES)
                .is_some_and(|p| square(&of.products[p].0) && square(&of.products[p].1))
        };
        // factor |x|^2.
        let distance = |sum: &Affine| match sum.terms[..] {
            [(a, f), (b, g), (c, h)] if sum.constant == 0.0 && f == g && g == h => {
                let each = (0..STATES).all(|state| [a, b, c].iter().any(|q| is_square(*q, state)));
                each.then_some(f)
            }
            _ => None,
        };
        let mut radial =
            Self { constants: [0.0; 3], slopes: [0.0; 3], gains: [0.0; 2], bends: [0.0; 2] };
        for (i, sum) in of.derivatives.iter().enumerate() {
            radial.constants[i] = sum.constant;
            if i == 0 {
                for &(quantity, factor) in &sum.terms {
                    *radial.slopes.get_mut(quantity)? = factor;
                }
                continue;
            }
            let bare = Affine { constant: 0.0, terms: sum.terms.clone() };
            if let Some(factor) = distance(&bare) {
                radial.gains[i - 1] = factor;
                continue;
            }
            let [(quantity, factor)] = sum.terms[..] else { return None };
            let (a, b) = &of.products[quantity.checked_sub(STATES)?];
            let other = if distance(a) == Some(1.0) {
                b
            } else if distance(b) == Some(1.0) {
                a
            } else {
                return None;
            };
            let [(state, bend)] = other.terms[..] else { return None };
            if state != i {
                return None;
            }
            (radial.gains[i - 1], radial.bends[i - 1]) = (factor * other.constant, factor * bend);
        }
        Some(radial)
    }

    /// See [`Flow::expand`](super::Flow::expand).
    #[inline]
    pub fn expand(&self, x: [f64; 3], degree: usize, series: &mut Series) {
        let task = Task { of: self, x, degree, series };
        // Eight lanes, or sixteen.
        #[cfg(target_arch = "x86_64")]
        if let Some(set) = pulp::x86::V4::try_new() {
            return if degree <= 17 {
                Simd::vectorize(set, In::<_, 1>(task))
            } else {
                Simd::vectorize(set, In::<_, 2>(task))
            };
        } else if let Some(set) = pulp::x86::V3::try_new() {
            return if degree <= 17 {
                Simd::vectorize(set, In::<_, 2>(task))
            } else {
                Simd::vectorize(set, In::<_, 4>(task))
            };
        }
        if degree <= 17 {
            In::<_, 8>(task).with_simd(pulp::Scalar)
        } else {
            In::<_, 16>(task).with_simd(pulp::Scalar)
        }
    }
}

pub(super) struct Task<'a> {
    pub of: &'a Radial,
    pub x: [f64; 3],
    pub degree: usize,
    pub series: &'a mut Series,
}

/// A task in `K` registers.
pub(super) struct In<T, const K: usize>(pub T);

/// Row k: one in lane k - 1, zeros else.
const UNITS: [[f64; 16]; 17] = {
    let mut rows = [[0.0; 16]; 17];
    let mut k = 1;
    while k < 17 {
        rows[k][k - 1] = 1.0;
        k += 1;
    }
    rows
};

impl<const K: usize> WithSimd for In<Task<'_>, K> {
    type Output = ();

    // Loops by number: iterators and closures may stay calls, compiled for the wrong instruction
    // set.
    #[allow(clippy::needless_range_loop)]
    #[inline(always)]
    fn with_simd<S: Simd>(self, set: S) {
        let Task { of: Radial { constants, slopes, gains, bends }, x: start, degree, series } =
            self.0;
        let number = |value: f64| Registers::<S, K>::splat(set, value);
        let zero = number(0.0);
        // Lane m: coefficient m + 1 of x_0, x_1, x_2 and of r = |x|^2.
        let (mut known, mut known_r) = ([zero; 3], zero);
        // Lane m: what is known of the coefficient of degree k + m of |x|^2, and of x_1 |x|^2 and
        // x_2 |x|^2.
        let (mut sum_r, mut sums) = (zero, [zero; 2]);
        let mut x = start;
        let twice = [2.0 * start[0], 2.0 * start[1], 2.0 * start[2]];
        let r_start = (start[0] * start[0] + start[1] * start[1]) + start[2] * start[2];
        let steep = [gains[0] + bends[0] * start[1], gains[1] + bends[1] * start[2]];
        for k in 0..degree {
            let mut next = slopes[0] * x[0] + (slopes[1] * x[1] + slopes[2] * x[2]);
            let mut outer = [0.0; 2];
            let r;
            if k == 0 {
                r = r_start;
                next += constants[0];
                outer.copy_from_slice(&constants[1..]);
            } else {
                r = (twice[0] * x[0] + sum_r.first()) + (twice[1] * x[1] + twice[2] * x[2]);
                for i in 0..2 {
                    outer[i] = bends[i] * (sums[i].first() + x[i + 1] * r_start);
                }
            }
            for i in 0..3 {
                series.forward[i][k % LONG] = x[i];
            }
            sum_r = sum_r.shifted(set);
            for i in 0..2 {
                sums[i] = sums[i].shifted(set);
            }
            if k > 0 {
                if k <= degree / 2 {
                    let unit = Registers::<S, K>::load(set, &UNITS[k]);
                    known_r += number(r) * unit;
                    for i in 0..3 {
                        // Half of the newest: its square is one product and not two.
                        sum_r += number(2.0 * x[i]) * (known[i] + number(0.5 * x[i]) * unit);
                    }
                    for i in 0..2 {
                        sums[i] += number(x[i + 1]) * known_r + number(r) * known[i + 1];
                    }
                    for i in 0..3 {
                        known[i] += number(x[i]) * unit;
                    }
                } else {
                    for i in 0..3 {
                        sum_r += number(2.0 * x[i]) * known[i];
                    }
                    for i in 0..2 {
                        sums[i] += number(x[i + 1]) * known_r + number(r) * known[i + 1];
                    }
                }
            }
            let reciprocal = RECIPROCALS[k % LONG];
            x = [
                next * reciprocal,
                (outer[0] + steep[0] * r) * reciprocal,
                (outer[1] + steep[1] * r) * reciprocal,
            ];
        }
        for i in 0..3 {
            series.forward[i][degree % LONG] = x[i];
        }
    }
}
