//! Linear systems of a fixed small size, solved once.
//!
//! Methods that solve many systems with one matrix, real or complex, keep its factors: see `integrate::linear`. Here nothing is kept, and
//! the quotients are taken as they stand, so that both have their own last bits; published numbers rest on each.

use nalgebra::{SMatrix, SVector};

/// The solution of a x = b by elimination with row pivoting; `None` when no pivot is above `smallest` in size (0: exactly
/// singular matrices only) or one is not a number.
pub fn solve<const N: usize>(
    mut a: SMatrix<f64, N, N>,
    mut b: SVector<f64, N>,
    smallest: f64,
) -> Option<SVector<f64, N>> {
    for k in 0..N {
        let pivot = (k..N).max_by(|&i, &j| a[(i, k)].abs().total_cmp(&a[(j, k)].abs()))?;
        if a[(pivot, k)].abs() <= smallest || a[(pivot, k)].is_nan() {
            return None;
        }
        a.swap_rows(k, pivot);
        b.swap_rows(k, pivot);
        for i in k + 1..N {
            let factor = a[(i, k)] / a[(k, k)];
            for j in k..N {
                a[(i, j)] -= factor * a[(k, j)];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..N).rev() {
        let known: f64 = (k + 1..N).map(|j| a[(k, j)] * b[j]).sum();
        b[k] = (b[k] - known) / a[(k, k)];
    }
    Some(b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{matrix, vector};

    #[test]
    fn exchanges_rows() {
        let a = matrix![0.0, 2.0, 1.0; 1.0, 0.0, 3.0; 4.0, -1.0, 0.0];
        let x = vector![1.0, -2.0, 3.0];
        assert!((solve(a, a * x, 0.0).unwrap() - x).norm() < 1e-14);
    }

    #[test]
    fn refuses_what_has_no_solution() {
        assert!(solve(matrix![1.0, 2.0; 2.0, 4.0], vector![1.0, 1.0], 0.0).is_none());
        assert!(solve(matrix![1.0, 0.0; 0.0, 1e-20], vector![1.0, 1.0], 0.0).is_some());
        assert!(solve(matrix![1.0, 0.0; 0.0, 1e-20], vector![1.0, 1.0], 1e-14).is_none());
        assert!(solve(matrix![f64::NAN, 2.0; 2.0, 4.0], vector![1.0, 1.0], 0.0).is_none());
    }
}
