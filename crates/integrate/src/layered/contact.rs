//! The first zero of a polynomial on [0, 1].

use crate::roots::brent;

/// Most coefficients of a polynomial here.
pub(super) const MOST: usize = 40;

/// Finds first zeros of polynomials of one degree.
#[derive(Clone, Debug)]
pub(super) struct Contact {
    /// Coefficients of a polynomial.
    count: usize,
    /// C(j, k)/C(degree, k), row after row.
    to_bernstein: Vec<f64>,
}

impl Contact {
    /// For polynomials with `count` coefficients, at most [`MOST`].
    pub fn new(count: usize) -> Self {
        let mut to_bernstein = Vec::with_capacity(count * count);
        for j in 0..count {
            // C(j, k)/C(n, k) = product over i < k of (j - i)/(n - i).
            let mut ratio = 1.0;
            for k in 0..count {
                to_bernstein.push(ratio);
                if k + 1 < count {
                    ratio *= (j as f64 - k as f64) / ((count - 1) as f64 - k as f64);
                }
            }
        }
        Self { count, to_bernstein }
    }

    /// The first zero in (0, 1] of the polynomial with the coefficients `c`, positive at 0 (or zero
    /// there and then positive: then the next one), to the last bits; none if it stays positive.
    /// Two zeros closer together than rounding can tell may be missed.
    ///
    /// Bernstein coefficients of one sign prove that there is none, one change of sign that there
    /// is exactly one (Lane & Riesenfeld 1981); else the interval is halved, left half first.
    pub fn first(&self, c: &[f64]) -> Option<f64> {
        let rest = |from: usize| c[from..].iter().map(|c| c.abs()).sum::<f64>();
        let simple = c[0] == 0.0;
        if if simple { c[1] > rest(2) } else { c[0] > rest(1) } {
            return None;
        }
        // The zero at the start divided out.
        let mut reduced = [0.0; MOST];
        let from = usize::from(simple);
        reduced[..self.count - from].copy_from_slice(&c[from..self.count]);
        let mut bernstein = [0.0; MOST];
        for (j, b) in bernstein[..self.count].iter_mut().enumerate() {
            let row = &self.to_bernstein[j * self.count..][..=j];
            *b = row.iter().zip(&reduced).map(|(a, b)| a * b).sum();
        }
        self.first_in(&reduced, bernstein, 0.0, 1.0, 0)
    }

    fn first_in(
        &self,
        c: &[f64; MOST],
        bernstein: [f64; MOST],
        a: f64,
        b: f64,
        depth: usize,
    ) -> Option<f64> {
        let used = &bernstein[..self.count];
        let signs = used.iter().filter(|v| **v != 0.0).map(|v| *v > 0.0);
        let changes = signs.clone().zip(signs.skip(1)).filter(|(x, y)| x != y).count();
        if changes == 0 {
            return (used[self.count - 1] == 0.0).then_some(b);
        }
        let value = |s: f64| c[..self.count].iter().rev().fold(0.0, |sum, c| sum * s + c);
        if changes == 1 {
            let (left, right) = (value(a), value(b));
            if left > 0.0 && right <= 0.0 {
                return Some(brent(value, a, b, left, right));
            }
        }
        if depth >= 45 {
            return Some(a);
        }
        // De Casteljau.
        let (mut work, mut left, mut right) = (bernstein, [0.0; MOST], [0.0; MOST]);
        let last = self.count - 1;
        for k in 0..=last {
            left[k] = work[0];
            right[last - k] = work[last - k];
            for i in 0..last - k {
                work[i] = 0.5 * (work[i] + work[i + 1]);
            }
        }
        let middle = 0.5 * (a + b);
        self.first_in(c, left, a, middle, depth + 1)
            .or_else(|| self.first_in(c, right, middle, b, depth + 1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// scale times the product of (s - zero).
    fn polynomial(scale: f64, zeros: &[f64]) -> Vec<f64> {
        let mut c = vec![scale];
        for zero in zeros {
            let mut next = vec![0.0; c.len() + 1];
            for (i, v) in c.iter().enumerate() {
                next[i + 1] += v;
                next[i] -= zero * v;
            }
            c = next;
        }
        c
    }

    #[test]
    fn finds_the_first() {
        let first = |scale: f64, zeros: &[f64]| {
            let c = polynomial(scale, zeros);
            Contact::new(c.len()).first(&c)
        };
        let near = |found: Option<f64>, want: f64| {
            assert!((found.unwrap() - want).abs() < 1e-9, "{found:?} {want}")
        };
        near(first(-1.0, &[0.4]), 0.4);
        near(first(1.0, &[0.4, 0.3]), 0.3);
        near(first(-1.0, &[0.8, 0.401, 0.4]), 0.4);
        near(first(1.0, &[0.7, 0.700_001, -0.3, 2.0, 3.0, -4.0]), 0.7);
        near(first(-1.0, &[1.0]), 1.0);
        assert_eq!(first(-1.0, &[1.1]), None);
        assert_eq!(first(1.0, &[1.1, -0.3, -2.0, 5.0, 7.0, 7.5, -1.0]), None);
        // A zero at the start is not the one.
        near(first(-1.0, &[0.0, 0.6]), 0.6);
        assert_eq!(first(-1.0, &[0.0, 1.6]), None);
        near(first(1.0, &[0.0, 0.6, 0.9]), 0.6);
    }
}
