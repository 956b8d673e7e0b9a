//! Solution of small linear systems, and eigenvalues of small matrices.
//!
//! Methods that solve many systems with one matrix keep its factors: see `integrate::linear`. This
//! module keeps none and divides instead of multiplying by reciprocals, so the last bits of the two
//! differ; published numbers depend on both.

use nalgebra::{SMatrix, SVector};

use super::elementary::sqrt;

/// The solution of a x = b by elimination with row pivoting; `None` when no pivot is above
/// `smallest` in size (0: exactly singular matrices only) or one is not a number.
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

/// The solution of a x = b for `n` equations by [`solve`]'s algorithm, `a` row by row, for a size
/// known only at run time.
pub fn solve_any(a: &[f64], b: &[f64], smallest: f64) -> Option<Vec<f64>> {
    let n = b.len();
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| a[i * n + k].abs().total_cmp(&a[j * n + k].abs()))?;
        if a[pivot * n + k].abs() <= smallest || a[pivot * n + k].is_nan() {
            return None;
        }
        (0..n).for_each(|j| a.swap(k * n + j, pivot * n + j));
        b.swap(k, pivot);
        for i in k + 1..n {
            let factor = a[i * n + k] / a[k * n + k];
            for j in k..n {
                a[i * n + j] -= factor * a[k * n + j];
            }
            b[i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k * n + j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k * n + k];
    }
    b.iter().all(|x| x.is_finite()).then_some(b)
}

/// A matrix in triangular factors, block by block: groups of unknowns that need each other (the
/// strongly connected components of the pattern, Tarjan 1972) are solved after those that they
/// need. What does not depend on a large coefficient has no rounding error of its.
///
/// ```
/// use twofold_num::linear::Blocks;
/// let blocks = Blocks::new(vec![1.0, -1e9, 0.0, 3.0], 2).unwrap();
/// assert_eq!(blocks.solve(&[1.0, 0.0]).unwrap(), [1.0, 0.0]);
/// ```
pub struct Blocks {
    matrix: Vec<f64>,
    blocks: Vec<Block>,
}

/// Unknowns that need each other, the rows in the order of elimination, and both factors.
struct Block {
    unknowns: Vec<usize>,
    rows: Vec<usize>,
    factors: Vec<f64>,
}

impl Blocks {
    /// The factors of a matrix of `n` rows; none if a pivot is zero or no number.
    pub fn new(matrix: Vec<f64>, n: usize) -> Option<Self> {
        let needs = |i: usize, j: usize| matrix[i * n + j] != 0.0;
        let factors = |unknowns: Vec<usize>| Block::new(&matrix, n, unknowns);
        let blocks = components(n, &needs).into_iter().map(factors).collect::<Option<_>>()?;
        Some(Self { matrix, blocks })
    }

    /// The solution for a right-hand side; none if it is not finite.
    pub fn solve(&self, b: &[f64]) -> Option<Vec<f64>> {
        let n = b.len();
        let mut x = vec![0.0; n];
        let mut known: Vec<usize> = Vec::new();
        for block in &self.blocks {
            let right = |row: &usize| {
                let i = block.unknowns[*row];
                known.iter().fold(b[i], |sum, j| match self.matrix[i * n + j] {
                    0.0 => sum,
                    a => sum - a * x[*j],
                })
            };
            let found = block.solve(block.rows.iter().map(right).collect());
            block.unknowns.iter().zip(found).for_each(|(i, found)| x[*i] = found);
            known.extend(&block.unknowns);
        }
        x.iter().all(|x| x.is_finite()).then_some(x)
    }
}

impl Block {
    /// By elimination with partial pivoting.
    fn new(matrix: &[f64], n: usize, unknowns: Vec<usize>) -> Option<Self> {
        let m = unknowns.len();
        let row = |i: &usize| unknowns.iter().map(|j| matrix[i * n + j]).collect::<Vec<_>>();
        let mut a: Vec<f64> = unknowns.iter().flat_map(row).collect();
        let mut rows: Vec<usize> = (0..m).collect();
        for k in 0..m {
            let pivot =
                (k..m).max_by(|&i, &j| a[i * m + k].abs().total_cmp(&a[j * m + k].abs()))?;
            if a[pivot * m + k] == 0.0 || a[pivot * m + k].is_nan() {
                return None;
            }
            (0..m).for_each(|j| a.swap(k * m + j, pivot * m + j));
            rows.swap(k, pivot);
            let (above, below) = a.split_at_mut((k + 1) * m);
            let above = &above[k * m..];
            for row in below.chunks_exact_mut(m).filter(|row| row[k] != 0.0) {
                row[k] /= above[k];
                let factor = row[k];
                row[k + 1..].iter_mut().zip(&above[k + 1..]).for_each(|(a, b)| *a -= factor * b);
            }
        }
        Some(Self { unknowns, rows, factors: a })
    }

    fn solve(&self, mut b: Vec<f64>) -> Vec<f64> {
        let m = b.len();
        let product = |from: &[f64], x: &[f64]| from.iter().zip(x).map(|(a, x)| a * x).sum::<f64>();
        for k in 0..m {
            b[k] -= product(&self.factors[k * m..k * m + k], &b[..k]);
        }
        for k in (0..m).rev() {
            let row = &self.factors[k * m..(k + 1) * m];
            b[k] = (b[k] - product(&row[k + 1..], &b[k + 1..])) / row[k];
        }
        b
    }
}

/// Groups of unknowns each of which needs all others of its group, on the way or at once; a group
/// comes after those that it needs. Each is in the unknowns' order.
fn components(n: usize, needs: &dyn Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    const UNSEEN: usize = usize::MAX;
    let (mut index, mut low, mut done) = (vec![UNSEEN; n], vec![0; n], vec![false; n]);
    let (mut stack, mut found, mut count) = (Vec::new(), Vec::new(), 0);
    for root in 0..n {
        // Unknowns on the way, and those that each has still to look at.
        let mut way = if index[root] == UNSEEN { vec![(root, 0)] } else { Vec::new() };
        while let Some((i, next)) = way.last_mut() {
            let i = *i;
            if index[i] == UNSEEN {
                (index[i], low[i]) = (count, count);
                count += 1;
                stack.push(i);
            }
            match (*next..n).find(|j| *j != i && !done[*j] && needs(i, *j)) {
                Some(j) => {
                    *next = j + 1;
                    if index[j] == UNSEEN {
                        way.push((j, 0));
                    } else {
                        low[i] = low[i].min(index[j]);
                    }
                }
                None => {
                    way.pop();
                    if let Some((before, _)) = way.last() {
                        low[*before] = low[*before].min(low[i]);
                    }
                    if low[i] == index[i] {
                        let from = stack.iter().position(|s| *s == i).unwrap_or(0);
                        let mut group = stack.split_off(from);
                        group.iter().for_each(|i| done[*i] = true);
                        group.sort_unstable();
                        found.push(group);
                    }
                }
            }
        }
    }
    found
}

/// A solution of a x = b for `n` equations of which some say nothing new: by elimination with full
/// pivoting, with zeros for the unknowns that are left open. `None` if the equations contradict
/// each other, or no pivot is above `smallest`.
///
/// ```
/// use twofold_num::linear::solve_some;
/// let twice = [1.0, 1.0, 2.0, 2.0];
/// let x = solve_some(&twice, &[3.0, 6.0], 1e-12).unwrap();
/// assert_eq!(x[0] + x[1], 3.0);
/// assert!(solve_some(&twice, &[3.0, 7.0], 1e-12).is_none());
/// ```
pub fn solve_some(a: &[f64], b: &[f64], smallest: f64) -> Option<Vec<f64>> {
    let n = b.len();
    let (mut a, mut b) = (a.to_vec(), b.to_vec());
    let size = b.iter().fold(0.0_f64, |most, b| most.max(b.abs()));
    let mut unknowns: Vec<usize> = (0..n).collect();
    let mut rank = 0;
    while rank < n {
        let places = (rank..n).flat_map(|i| (rank..n).map(move |j| (i, j)));
        let (i, j) =
            places.max_by(|p, q| a[p.0 * n + p.1].abs().total_cmp(&a[q.0 * n + q.1].abs()))?;
        if a[i * n + j].is_nan() {
            return None;
        }
        if a[i * n + j].abs() <= smallest {
            break;
        }
        (0..n).for_each(|k| a.swap(rank * n + k, i * n + k));
        b.swap(rank, i);
        (0..n).for_each(|k| a.swap(k * n + rank, k * n + j));
        unknowns.swap(rank, j);
        for i in rank + 1..n {
            let factor = a[i * n + rank] / a[rank * n + rank];
            (rank..n).for_each(|k| a[i * n + k] -= factor * a[rank * n + k]);
            b[i] -= factor * b[rank];
        }
        rank += 1;
    }
    if rank == 0 || b[rank..].iter().any(|left| left.abs() > CONTRADICTS * size) {
        return None;
    }
    let mut x = vec![0.0; n];
    for k in (0..rank).rev() {
        let known: f64 = (k + 1..rank).map(|j| a[k * n + j] * x[unknowns[j]]).sum();
        x[unknowns[k]] = (b[k] - known) / a[k * n + k];
    }
    x.iter().all(|x| x.is_finite()).then_some(x)
}

/// Remainders of the right side beyond this share of it contradict.
const CONTRADICTS: f64 = 1e-3;

/// Iterations of the QR algorithm for one eigenvalue; some three are usual.
const MOST_ITERATIONS: usize = 60;

/// The eigenvalues (real part, imaginary part) of a real matrix of `n` rows, given row by row:
/// balanced (Parlett & Reinsch 1969), brought to Hessenberg form by elimination, and then the
/// shifted QR algorithm (Martin, Peters & Wilkinson 1970; EISPACK's `elmhes` and `hqr`). `None` if
/// an entry is not finite, or an eigenvalue does not settle.
///
/// ```
/// use twofold_num::linear::eigenvalues;
/// let of = eigenvalues(&[0.0, 1.0, -1.0, 0.0], 2).unwrap(); // a rotation by 90 degrees
/// assert!(of.iter().all(|[re, im]| re.abs() < 1e-15 && (im.abs() - 1.0).abs() < 1e-15));
/// ```
pub fn eigenvalues(matrix: &[f64], n: usize) -> Option<Vec<[f64; 2]>> {
    if matrix.len() != n * n || !matrix.iter().all(|v| v.is_finite()) {
        return None;
    }
    let units = balance(matrix, n);
    let entry = |(k, v): (usize, &f64)| v * (units[k % n] / units[k / n]);
    let balanced: Vec<f64> = matrix.iter().enumerate().map(entry).collect();
    let mut a: Vec<Vec<f64>> = balanced.chunks(n.max(1)).map(<[f64]>::to_vec).collect();
    hessenberg(&mut a);
    let norm: f64 = a.iter().flatten().map(|v| v.abs()).sum();
    let mut found = vec![[0.0; 2]; n];
    let mut shifts = 0.0;
    // Eigenvalues are split off from the end; `end` rows are left.
    let mut end = n;
    while end > 0 {
        let last = end - 1;
        let mut settled = false;
        for iteration in 0..MOST_ITERATIONS {
            let small = |l: usize| {
                let size = a[l - 1][l - 1].abs() + a[l][l].abs();
                let size = if size == 0.0 { norm } else { size };
                a[l][l - 1].abs() <= f64::EPSILON * size
            };
            let low = (1..end).rev().find(|l| small(*l)).unwrap_or(0);
            let x = a[last][last];
            if low == last {
                found[last] = [x + shifts, 0.0];
                end -= 1;
                settled = true;
                break;
            }
            let (y, w) = (a[last - 1][last - 1], a[last][last - 1] * a[last - 1][last]);
            if low + 1 == last {
                let half = 0.5 * (y - x);
                let discriminant = half * half + w;
                let x = x + shifts;
                let root = sqrt(discriminant.abs());
                if discriminant >= 0.0 {
                    let z = half + root.copysign(half);
                    found[last - 1] = [x + z, 0.0];
                    found[last] = [if z == 0.0 { x } else { x - w / z }, 0.0];
                } else {
                    found[last - 1] = [x + half, root];
                    found[last] = [x + half, -root];
                }
                end -= 2;
                settled = true;
                break;
            }
            let mut pair = (x, y, w);
            if iteration > 0 && iteration % 10 == 0 {
                // An exceptional shift, against cycling.
                shifts += x;
                (0..end).for_each(|i| a[i][i] -= x);
                let s = a[last][last - 1].abs() + a[last - 1][last - 2].abs();
                pair = (0.75 * s, 0.75 * s, -0.4375 * s * s);
            }
            double_step(&mut a, low, last, pair);
        }
        if !settled {
            return None;
        }
    }
    Some(found)
}

/// A matrix whose rows and columns differ in size by less than this factor is left as it is: a
/// thousand in the units costs three digits of sixteen.
const UNBALANCED: f64 = 1_048_576.0;

/// Units for the states, powers of two, in which each row of a matrix of `n` rows is as large as
/// its column, without the diagonal, to a factor of four (Parlett & Reinsch 1969): for linearised
/// motion whose states have very different units. In them the entry of row i and column j is
/// `units[j] / units[i]` times what it was. All 1 where no row is a million times as large or as
/// small as its column.
fn balance(matrix: &[f64], n: usize) -> Vec<f64> {
    let mut units = vec![1.0; n];
    let mut most = UNBALANCED;
    for _ in 0..MOST_ITERATIONS {
        let mut settled = true;
        for i in 0..n {
            let beside = |entry: &dyn Fn(usize) -> f64| -> f64 {
                (0..n).filter(|j| *j != i).map(|j| entry(j).abs()).sum()
            };
            let row = beside(&|j| matrix[i * n + j] * (units[j] / units[i]));
            let column = beside(&|j| matrix[j * n + i] * (units[i] / units[j]));
            let lopsided = row / column >= most || column / row >= most;
            // Where one is zero the matrix falls apart, and nothing is gained.
            if row > 0.0 && column > 0.0 && lopsided {
                let mut by = 1.0;
                while column * by * by < 0.5 * row {
                    by *= 2.0;
                }
                while column * by * by >= 2.0 * row {
                    by *= 0.5;
                }
                units[i] *= by;
                (settled, most) = (false, 4.0);
            }
        }
        if settled {
            break;
        }
    }
    units
}

/// Similar to the matrix, and zero below the first subdiagonal.
fn hessenberg(a: &mut [Vec<f64>]) {
    let n = a.len();
    for m in 1..n.saturating_sub(1) {
        let Some(pivot) = (m..n).max_by(|i, j| a[*i][m - 1].abs().total_cmp(&a[*j][m - 1].abs()))
        else {
            return;
        };
        let x = a[pivot][m - 1];
        if pivot != m {
            a.swap(pivot, m);
            a.iter_mut().for_each(|row| row.swap(pivot, m));
        }
        if x == 0.0 {
            continue;
        }
        for i in m + 1..n {
            let y = a[i][m - 1] / x;
            if y == 0.0 {
                continue;
            }
            let row = a[m].clone();
            (m - 1..n).for_each(|j| a[i][j] -= y * row[j]);
            a[i][m - 1] = 0.0;
            a.iter_mut().for_each(|r| r[m] += y * r[i]);
        }
    }
}

/// A double QR step on rows `low` to `last` with the shifts that `pair` describes.
fn double_step(a: &mut [Vec<f64>], low: usize, last: usize, (x, y, w): (f64, f64, f64)) {
    let start = |a: &[Vec<f64>], m: usize| {
        let z = a[m][m];
        let (r, s) = (x - z, y - z);
        let p = (r * s - w) / a[m + 1][m] + a[m][m + 1];
        let q = a[m + 1][m + 1] - z - r - s;
        let r = a[m + 2][m + 1];
        let scale = p.abs() + q.abs() + r.abs();
        (p / scale, q / scale, r / scale)
    };
    let mut m = last - 2;
    let (mut p, mut q, mut r) = start(a, m);
    while m > low {
        let u = a[m][m - 1].abs() * (q.abs() + r.abs());
        let v = p.abs() * (a[m - 1][m - 1].abs() + a[m][m].abs() + a[m + 1][m + 1].abs());
        if u <= f64::EPSILON * v {
            break;
        }
        m -= 1;
        (p, q, r) = start(a, m);
    }
    for i in m + 2..=last {
        a[i][i - 2] = 0.0;
        if i > m + 2 {
            a[i][i - 3] = 0.0;
        }
    }
    for k in m..last {
        let mut x = 0.0;
        if k > m {
            (p, q) = (a[k][k - 1], a[k + 1][k - 1]);
            r = if k + 1 < last { a[k + 2][k - 1] } else { 0.0 };
            x = p.abs() + q.abs() + r.abs();
            if x == 0.0 {
                continue;
            }
            (p, q, r) = (p / x, q / x, r / x);
        }
        let s = sqrt(p * p + q * q + r * r).copysign(p);
        if s == 0.0 {
            continue;
        }
        if k > m {
            a[k][k - 1] = -s * x;
        } else if low != m {
            a[k][k - 1] = -a[k][k - 1];
        }
        p += s;
        let (x, y, z) = (p / s, q / s, r / s);
        (q, r) = (q / p, r / p);
        let three = k + 1 < last;
        // Three rows at once, column by column.
        #[allow(clippy::needless_range_loop)]
        for j in k..=last {
            let mut t = a[k][j] + q * a[k + 1][j];
            if three {
                t += r * a[k + 2][j];
                a[k + 2][j] -= t * z;
            }
            a[k + 1][j] -= t * y;
            a[k][j] -= t * x;
        }
        for row in a.iter_mut().take(last.min(k + 3) + 1).skip(low) {
            let mut t = x * row[k] + y * row[k + 1];
            if three {
                t += z * row[k + 2];
                row[k + 2] -= t * r;
            }
            row[k + 1] -= t * q;
            row[k] -= t;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomStream;
    use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

    #[test]
    fn units_are_balanced_where_they_lie_far_apart() {
        let units = balance(&[0.2, -1e18, 1e-18, 0.2], 2);
        assert!((0.5..=2.0).contains(&(1e-18 * units[0] / units[1])));
        assert_eq!(balance(&[0.2, -1e3, 1e-2, 0.2], 2), [1.0, 1.0]);
    }

    #[test]
    fn exchanges_rows() {
        let a = Matrix3::new(0.0, 2.0, 1.0, 1.0, 0.0, 3.0, 4.0, -1.0, 0.0);
        let x = Vector3::new(1.0, -2.0, 3.0);
        assert!((solve(a, a * x, 0.0).unwrap() - x).norm() < 1e-14);
    }

    #[test]
    fn any_size_as_a_fixed_one() {
        let a = [0.0, 2.0, 1.0, 1.0, 0.0, 3.0, 4.0, -1.0, 0.0];
        let x = solve_any(&a, &[-1.0, 10.0, 6.0], 0.0).unwrap();
        assert!(x.iter().zip([1.0, -2.0, 3.0]).all(|(x, w)| (x - w).abs() < 1e-14), "{x:?}");
        assert!(solve_any(&[1.0, 2.0, 2.0, 4.0], &[1.0, 1.0], 0.0).is_none());
    }

    #[test]
    fn eigenvalues_of_known_matrices() {
        let sorted = |m: &[f64], n: usize| {
            let mut e = eigenvalues(m, n).unwrap();
            e.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            e
        };
        // Companion of (l - 1)(l - 2)(l - 3)(l^2 + 1)(l + 4), whose coefficients are whole numbers.
        let mut polynomial = vec![1.0];
        for root in [1.0, 2.0, 3.0, -4.0] {
            let mut next = polynomial.clone();
            next.push(0.0);
            polynomial.iter().enumerate().for_each(|(i, c)| next[i + 1] -= root * c);
            polynomial = next;
        }
        let mut next = polynomial.clone();
        next.extend([0.0, 0.0]);
        polynomial.iter().enumerate().for_each(|(i, c)| next[i + 2] += c);
        let n = 6;
        let mut companion = vec![0.0; n * n];
        for i in 0..n {
            companion[i] = -next[i + 1];
            if i > 0 {
                companion[i * n + i - 1] = 1.0;
            }
        }
        let want = [[-4.0, 0.0], [0.0, -1.0], [0.0, 1.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]];
        for (found, want) in sorted(&companion, n).iter().zip(want) {
            assert!(
                (found[0] - want[0]).abs() < 1e-10 && (found[1] - want[1]).abs() < 1e-10,
                "{found:?} {want:?}"
            );
        }
        // A cyclic permutation: the seventh roots of one, all of one modulus; plain shifts would
        // cycle.
        let n = 7;
        let cycle: Vec<f64> =
            (0..n * n).map(|k| if (k / n + 1) % n == k % n { 1.0 } else { 0.0 }).collect();
        for [re, im] in sorted(&cycle, n) {
            assert!((re * re + im * im - 1.0).abs() < 1e-12);
        }
        assert_eq!(sorted(&[0.0; 16], 4), [[0.0; 2]; 4]);
        assert_eq!(eigenvalues(&[f64::NAN], 1), None);
    }

    /// Of one matrix in units that differ by up to 1e18: 0.2 +- i and -3; and a ring.
    #[test]
    fn eigenvalues_have_no_units() {
        for (a, b) in [(1.0, 1.0), (1e9, 1e-9), (1e-6, 1e12), (1e-150, 1.0)] {
            let units = [a, b, a * b];
            let plain = [0.2, -1.0, 0.5, 1.0, 0.2, 0.25, 0.0, 0.0, -3.0];
            let scaled: Vec<f64> =
                (0..9).map(|k| plain[k] * (units[k / 3] / units[k % 3])).collect();
            let mut found = eigenvalues(&scaled, 3).unwrap();
            found.sort_by(|x, y| x[0].total_cmp(&y[0]).then(x[1].total_cmp(&y[1])));
            for (found, want) in found.iter().zip([[-3.0, 0.0], [0.2, -1.0], [0.2, 1.0]]) {
                let off = (found[0] - want[0]).abs().max((found[1] - want[1]).abs());
                assert!(off < 1e-13, "{a:e} {b:e}: {found:?}");
            }
        }
        // x' = y, y' = z, z' = x with z in a unit of 1e-9: the third roots of one.
        let ring = [0.0, 1.0, 0.0, 0.0, 0.0, 1e9, 1e-9, 0.0, 0.0];
        for e in eigenvalues(&ring, 3).unwrap() {
            assert!((e[0] * e[0] + e[1] * e[1] - 1.0).abs() < 1e-13, "{e:?}");
        }
    }

    #[test]
    fn refuses_what_has_no_solution() {
        assert!(solve(Matrix2::new(1.0, 2.0, 2.0, 4.0), Vector2::new(1.0, 1.0), 0.0).is_none());
        assert!(solve(Matrix2::new(1.0, 0.0, 0.0, 1e-20), Vector2::new(1.0, 1.0), 0.0).is_some());
        assert!(solve(Matrix2::new(1.0, 0.0, 0.0, 1e-20), Vector2::new(1.0, 1.0), 1e-14).is_none());
        assert!(
            solve(Matrix2::new(f64::NAN, 2.0, 2.0, 4.0), Vector2::new(1.0, 1.0), 0.0).is_none()
        );
    }

    /// Pseudo-random whole numbers from -3 to 3.
    fn digits(seed: u64) -> impl Iterator<Item = f64> {
        let mut state = seed;
        std::iter::repeat_with(move || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 33) % 7) as f64 - 3.0
        })
    }

    /// Both eliminations do the same operations in the same order.
    #[test]
    fn the_two_eliminations_agree_bit_for_bit() {
        let mut solved = 0;
        for seed in 0..200 {
            let numbers: Vec<f64> = digits(seed).take(30).collect();
            let (a, b) = numbers.split_at(25);
            let fixed = solve(
                SMatrix::<f64, 5, 5>::from_row_slice(a),
                SVector::<f64, 5>::from_column_slice(b),
                1e-9,
            );
            let any = solve_any(a, b, 1e-9);
            let bits = |x: &[f64]| x.iter().map(|v| v.to_bits()).collect::<Vec<_>>();
            assert_eq!(fixed.as_ref().map(|x| bits(x.as_slice())), any.as_ref().map(|x| bits(x)));
            let Some(x) = any else { continue };
            solved += 1;
            for (row, b) in a.chunks(5).zip(b) {
                let sum: f64 = row.iter().zip(&x).map(|(a, x)| a * x).sum();
                assert!((sum - b).abs() < 1e-9, "{sum} {b}");
            }
        }
        assert!(solved > 150);
        assert!(solve_any(&[f64::NAN, 1.0, 1.0, f64::NAN], &[1.0, 1.0], 0.0).is_none());
        assert!(
            solve_any(&[1e-200, 0.0, 0.0, 1.0], &[1e200, 1.0], 0.0).is_none(),
            "the solution is infinite"
        );
    }

    /// Full matrices, similar to ones whose eigenvalues are seen.
    #[test]
    fn eigenvalues_survive_a_change_of_coordinates() {
        // Reals, then pairs a +- ib.
        let (reals, pairs) = ([5.0, -3.0, 1.0, 0.5], [(2.0, 1.0), (-1.0, 3.0)]);
        for (seed, (reals, pairs)) in [
            (&reals[..0], &pairs[..1]),
            (&reals[..3], &pairs[..0]),
            (&reals[..1], &pairs[..1]),
            (&reals[..2], &pairs[..1]),
            (&reals[..1], &pairs[..2]),
            (&reals[..], &pairs[..0]),
            (&reals[..], &pairs[..]),
        ]
        .into_iter()
        .enumerate()
        .flat_map(|(i, case)| (0..8).map(move |j| (8 * i + j, case)))
        {
            let n = reals.len() + 2 * pairs.len();
            let mut a = vec![0.0; n * n];
            let mut want = Vec::new();
            for (i, v) in reals.iter().enumerate() {
                a[i * n + i] = *v;
                want.push([*v, 0.0]);
            }
            for (i, (re, im)) in pairs.iter().enumerate() {
                let k = reals.len() + 2 * i;
                (a[k * n + k], a[(k + 1) * n + k + 1], a[k * n + k + 1], a[(k + 1) * n + k]) =
                    (*re, *re, *im, -im);
                want.extend([[*re, -im], [*re, *im]]);
            }
            // Row i plus c times row j, column j minus c times column i: the eigenvalues stay, and
            // all numbers are exact.
            let mut c = digits(seed as u64).filter(|c| c.abs() == 1.0);
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).filter(|(i, j)| i != j) {
                let c = c.next().unwrap();
                (0..n).for_each(|k| a[i * n + k] += c * a[j * n + k]);
                (0..n).for_each(|k| a[k * n + j] -= c * a[k * n + i]);
            }
            let mut found = eigenvalues(&a, n).unwrap();
            for e in [&mut found, &mut want] {
                e.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
            }
            // Pairs have the same real part to the last bit, so sorting by it and then by the other
            // is safe.
            let size = a.iter().fold(1.0_f64, |m, v| m.max(v.abs()));
            for (f, w) in found.iter().zip(&want) {
                let error = (f[0] - w[0]).abs().max((f[1] - w[1]).abs());
                assert!(
                    error < 1e-11 * size * size,
                    "case {seed}, entries up to {size}: {found:?}, not {want:?}"
                );
            }
        }
    }

    /// A cycle and twice the identity: every double step changes nothing, until the exceptional
    /// shift comes, which has something to shift by.
    #[test]
    fn what_goes_round_in_circles_is_shaken() {
        for n in 3..9 {
            for shift in [2.0, -0.5] {
                let entry = |i: usize, j: usize| {
                    f64::from((i + 1) % n == j) + if i == j { shift } else { 0.0 }
                };
                let matrix: Vec<f64> = (0..n * n).map(|at| entry(at / n, at % n)).collect();
                let found = eigenvalues(&matrix, n).unwrap();
                assert_eq!(found.len(), n);
                for k in 0..n {
                    let turn = std::f64::consts::TAU * k as f64 / n as f64;
                    let root = [shift + turn.cos(), turn.sin()];
                    let near =
                        |e: &&[f64; 2]| (e[0] - root[0]).abs() + (e[1] - root[1]).abs() < 1e-13;
                    assert_eq!(
                        found.iter().filter(near).count(),
                        1,
                        "{n} {shift} {root:?} {found:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn roots_of_one() {
        for n in [3, 4, 5, 7, 8] {
            let cycle: Vec<f64> =
                (0..n * n).map(|k| if (k / n + 1) % n == k % n { 1.0 } else { 0.0 }).collect();
            let found = eigenvalues(&cycle, n).unwrap();
            for k in 0..n {
                let angle = std::f64::consts::TAU * k as f64 / n as f64;
                let near = |e: &&[f64; 2]| (e[0] - angle.cos()).hypot(e[1] - angle.sin()) < 1e-10;
                assert_eq!(found.iter().filter(near).count(), 1, "root {k} of {n}: {found:?}");
            }
        }
        assert_eq!(eigenvalues(&[], 0), Some(vec![]));
        assert_eq!(eigenvalues(&[1.0, 2.0], 1), None);
    }

    #[test]
    fn blocks_are_solved_in_the_order_of_their_needs() {
        // 4 needs 0 and 2, which need each other; 1 needs 4, and 3 nothing.
        let pattern = [(0, 2), (2, 0), (4, 0), (4, 2), (1, 4)];
        let needs = |i: usize, j: usize| pattern.contains(&(i, j));
        assert_eq!(super::components(5, &needs), [vec![0, 2], vec![4], vec![1], vec![3]]);
        let ring = |i: usize, j: usize| j == (i + 1) % 5;
        assert_eq!(super::components(5, &ring), [vec![0, 1, 2, 3, 4]]);
        // Random ones agree with elimination of the whole.
        let mut chance = RandomStream::new(1, 0);
        for n in 1..12 {
            let mut a = vec![0.0; n * n];
            for i in 0..n {
                for j in 0..n {
                    let some = i == j || chance.uniform() < 0.25;
                    a[i * n + j] = if some { chance.uniform_in(-1.0, 1.0) } else { 0.0 };
                }
            }
            let b: Vec<f64> = (0..n).map(|_| chance.uniform_in(-1.0, 1.0)).collect();
            let found = Blocks::new(a.clone(), n).and_then(|blocks| blocks.solve(&b));
            let (Some(x), Some(y)) = (found, solve_any(&a, &b, 0.0)) else { panic!("regular") };
            let size = y.iter().fold(1.0_f64, |most, y| most.max(y.abs()));
            assert!(x.iter().zip(&y).all(|(x, y)| (x - y).abs() < 1e-11 * size), "{x:?} {y:?}");
        }
        assert!(Blocks::new(vec![1.0, 2.0, 2.0, 4.0], 2).is_none());
        assert!(Blocks::new(vec![f64::NAN; 4], 2).is_none());
    }
}
