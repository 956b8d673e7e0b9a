//! Linear systems of a small size, mostly a fixed one, for the implicit methods: LU with partial
//! pivoting.
//!
//! `nalgebra`'s own `LU` type asks every caller to carry its dimension bounds (`DimMin`), up to the
//! figure that only wants a `Stepper<N>`, and its elimination step finds the size out only when it
//! runs.

use nalgebra::allocator::Allocator;
use nalgebra::{ComplexField, DefaultAllocator, Dim, OMatrix, OVector, Scalar, U1};

/// P A = L U.
#[derive(Clone, Debug)]
pub(super) struct Lu<T: Scalar, D: Dim>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    /// L below the diagonal (its unit diagonal is not stored), U on and above it.
    factors: OMatrix<T, D, D>,
    /// Row exchanged with row i at elimination step i.
    exchanged: OVector<usize, D>,
}

impl<T: ComplexField<RealField = f64> + Copy, D: Dim> Lu<T, D>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    /// Factorises `a`; `None` if it is singular to working precision or not finite.
    #[inline(always)]
    pub fn new(a: OMatrix<T, D, D>) -> Option<Self> {
        let mut factors = a;
        let (states, n) = (factors.shape_generic().0, factors.nrows());
        let mut exchanged = OVector::from_element_generic(states, U1, 0);
        for i in 0..n {
            let mut pivot = i;
            for row in i + 1..n {
                if factors[(row, i)].norm1() > factors[(pivot, i)].norm1() {
                    pivot = row;
                }
            }
            exchanged[i] = pivot;
            // By numbers that are known when this is compiled, so that the matrix stays in
            // registers: a row that is looked up sends it through memory, where it is read before
            // it is written.
            for row in i + 1..n {
                if row == pivot {
                    factors.swap_rows(i, row);
                }
            }
            let diagonal = factors[(i, i)];
            // Written so that a NaN is refused as well.
            if !(diagonal.norm1() > 0.0 && diagonal.norm1().is_finite()) {
                return None;
            }
            let inverse = T::one() / diagonal;
            for row in i + 1..n {
                factors[(row, i)] *= inverse;
            }
            for column in i + 1..n {
                let above = -factors[(i, column)];
                for row in i + 1..n {
                    let eliminated = above * factors[(row, i)];
                    factors[(row, column)] = eliminated + factors[(row, column)];
                }
            }
        }
        Some(Self { factors, exchanged })
    }

    /// The solution of A x = b.
    #[inline(always)]
    pub fn solve(&self, mut b: OVector<T, D>) -> OVector<T, D> {
        let n = b.len();
        for i in 0..n {
            for row in i + 1..n {
                if row == self.exchanged[i] {
                    b.swap_rows(i, row);
                }
            }
        }
        for i in 1..n {
            for j in 0..i {
                let known = self.factors[(i, j)] * b[j];
                b[i] -= known;
            }
        }
        for i in (0..n).rev() {
            for j in i + 1..n {
                let known = self.factors[(i, j)] * b[j];
                b[i] -= known;
            }
            b[i] /= self.factors[(i, i)];
        }
        b
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Complex, Matrix2, Matrix3, SMatrix, SVector, Vector3};
    use proptest::prelude::*;

    #[test]
    fn pivots() {
        let a = Matrix3::new(0.0, 2.0, 1.0, 1.0, 0.0, 3.0, 4.0, -1.0, 0.0);
        let x = Vector3::new(1.0, -2.0, 3.0);
        assert!((Lu::new(a).unwrap().solve(a * x) - x).norm() < 1e-14);
    }

    #[test]
    fn refuses_singular_and_nan() {
        assert!(Lu::new(Matrix2::new(1.0, 2.0, 2.0, 4.0)).is_none());
        assert!(Lu::new(Matrix2::new(f64::NAN, 2.0, 2.0, 4.0)).is_none());
    }

    proptest! {
        #[test]
        fn solves_complex(entries in prop::collection::vec(-1.0..1.0_f64, 32),
            rhs in prop::collection::vec(-1.0..1.0_f64, 8)) {
            let a = SMatrix::<Complex<f64>, 4, 4>::from_fn(|i, j| {
                let k = 8 * i + 2 * j;
                // Diagonally dominant enough to be well conditioned.
                Complex::new(entries[k] + if i == j { 6.0 } else { 0.0 }, entries[k + 1])
            });
            let b = SVector::<Complex<f64>, 4>::from_fn(|i, _| Complex::new(rhs[2 * i],
                rhs[2 * i + 1]));
            let x = Lu::new(a).unwrap().solve(b);
            prop_assert!((a * x - b).iter().all(|r| r.norm1() < 1e-13));
        }
    }
}
