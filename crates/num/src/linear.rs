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
mod tests;
