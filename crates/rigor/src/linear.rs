//! Small matrices of intervals.

use nalgebra::{SMatrix, SVector};

use twofold_num::{Arithmetic, Interval, elementary};

/// Vector of intervals: a box.
pub type IVector<const N: usize> = SVector<Interval, N>;
/// Matrix of intervals.
pub type IMatrix<const N: usize> = SMatrix<Interval, N, N>;

/// {m}.
pub fn exactly<const N: usize>(m: &SMatrix<f64, N, N>) -> IMatrix<N> {
    m.map(Interval::from_f64)
}

/// The identity.
pub fn identity<const N: usize>() -> IMatrix<N> {
    exactly(&SMatrix::identity())
}

/// a b.
pub fn product<const N: usize>(a: &IMatrix<N>, b: &IMatrix<N>) -> IMatrix<N> {
    IMatrix::from_fn(|i, j| (0..N).fold(Interval::zero(), |s, k| s + a[(i, k)] * b[(k, j)]))
}

/// a v.
pub fn apply<const N: usize>(a: &IMatrix<N>, v: &IVector<N>) -> IVector<N> {
    IVector::from_fn(|i, _| (0..N).fold(Interval::zero(), |s, k| s + a[(i, k)] * v[k]))
}

/// a + b, element by element.
pub fn sum<const R: usize, const C: usize>(
    a: &SMatrix<Interval, R, C>,
    b: &SMatrix<Interval, R, C>,
) -> SMatrix<Interval, R, C> {
    SMatrix::from_fn(|i, j| a[(i, j)] + b[(i, j)])
}

/// a - b, element by element.
pub fn difference<const R: usize, const C: usize>(
    a: &SMatrix<Interval, R, C>,
    b: &SMatrix<Interval, R, C>,
) -> SMatrix<Interval, R, C> {
    SMatrix::from_fn(|i, j| a[(i, j)] - b[(i, j)])
}

/// The midpoints.
pub fn midpoints<const R: usize, const C: usize>(
    a: &SMatrix<Interval, R, C>,
) -> SMatrix<f64, R, C> {
    a.map(Interval::midpoint)
}

/// A bound of the largest sum of a row's absolute values, which is a norm.
pub fn norm<const R: usize, const C: usize>(a: &SMatrix<Interval, R, C>) -> f64 {
    (0..R).fold(0.0, |largest: f64, i| {
        let row =
            (0..C).fold(Interval::zero(), |s, j| s + Interval::from_f64(a[(i, j)].magnitude()));
        largest.max(row.upper())
    })
}

/// An orthogonal matrix (to rounding) whose first columns span what the first columns of `m` span,
/// by falling weight: the columns are taken in the order of |column| times its weight (Lohner
/// 1987), and orthogonalised twice (Kahan's "twice is enough"). A column that the others span is
/// replaced by a unit vector.
pub fn orthogonal<const N: usize>(
    m: &SMatrix<f64, N, N>,
    weights: &SVector<f64, N>,
) -> SMatrix<f64, N, N> {
    let length = |v: &SVector<f64, N>| elementary::sqrt(v.iter().fold(0.0, |s, x| s + x * x));
    let dot = |a: &SVector<f64, N>, b: &SVector<f64, N>| (0..N).fold(0.0, |s, i| s + a[i] * b[i]);
    let mut columns: Vec<(f64, SVector<f64, N>)> = (0..N)
        .map(|j| {
            let column: SVector<f64, N> = m.column(j).into_owned();
            (length(&column) * weights[j], column)
        })
        .collect();
    // A stable sort: ties keep their order.
    columns.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut q = SMatrix::<f64, N, N>::zeros();
    let mut done = 0;
    let units = (0..N).map(|i| SVector::<f64, N>::from_fn(|k, _| f64::from(u8::from(k == i))));
    for candidate in columns.into_iter().map(|c| c.1).chain(units) {
        if done == N {
            break;
        }
        let before = length(&candidate);
        let mut v = candidate;
        for _ in 0..2 {
            for j in 0..done {
                let u: SVector<f64, N> = q.column(j).into_owned();
                let along = dot(&u, &v);
                v -= u * along;
            }
        }
        let after = length(&v);
        if after > 1e-10 * before && after.is_finite() && after > 0.0 {
            // 1e-10: what is left of a nearly dependent column still has six good digits, and is
            // orthogonal to the others.
            q.set_column(done, &(v / after));
            done += 1;
        }
    }
    q
}

/// The inverse of a matrix that is orthogonal to rounding, as something to multiply with.
pub struct Inverse<const N: usize> {
    transposed: IMatrix<N>,
    /// With G = Q^T Q - 1 and |G| <= e < 1, the inverse is (1 + G)^-1 Q^T, and |(1 + G)^-1 - 1| <=
    /// e/(1 - e).
    excess: Interval,
}

impl<const N: usize> Inverse<N> {
    /// Of `q`; `None` if `q` is not nearly orthogonal.
    pub fn new(q: &SMatrix<f64, N, N>) -> Option<Self> {
        let transposed = exactly(&q.transpose());
        let g = difference(&product(&transposed, &exactly(q)), &identity());
        let e = norm(&g);
        if e.is_nan() || e >= 0.5 {
            return None;
        }
        let e = Interval::from_f64(e);
        let excess = Interval::symmetric((e / (Interval::one() - e)).upper());
        Some(Self { transposed, excess })
    }

    /// Q^-1 v.
    pub fn apply(&self, v: &IVector<N>) -> IVector<N> {
        let w = apply(&self.transposed, v);
        let largest = w.iter().fold(0.0, |m: f64, x| m.max(x.magnitude()));
        w.map(|x| x + self.excess * Interval::from_f64(largest))
    }

    /// Q^-1 m.
    pub fn product(&self, m: &IMatrix<N>) -> IMatrix<N> {
        let mut result = *m;
        for j in 0..N {
            result.set_column(j, &self.apply(&m.column(j).into_owned()));
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn orthogonal_frames_are_inverted_rigorously() {
        let m = SMatrix::<f64, 3, 3>::new(1.0, 2.0, 2.0, 0.5, 1.0, -3.0, 0.25, 0.5, 7.0);
        // The first two columns are parallel: one gives way to a unit vector.
        let q = orthogonal(&m, &SVector::from([1.0, 1.0, 1.0]));
        let inverse = Inverse::new(&q).unwrap();
        let unit = inverse.product(&exactly(&q));
        for i in 0..3 {
            for j in 0..3 {
                let x = unit[(i, j)];
                assert!(x.contains(f64::from(u8::from(i == j))) && x.width() < 1e-14, "{x:?}");
            }
        }
        assert!(Inverse::new(&SMatrix::<f64, 3, 3>::zeros()).is_none());
    }
}
