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
        let scaled: Vec<f64> = (0..9).map(|k| plain[k] * (units[k / 3] / units[k % 3])).collect();
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
    assert!(solve(Matrix2::new(f64::NAN, 2.0, 2.0, 4.0), Vector2::new(1.0, 1.0), 0.0).is_none());
}

/// Pseudo-random whole numbers from -3 to 3.
fn digits(seed: u64) -> impl Iterator<Item = f64> {
    let mut state = seed;
    std::iter::repeat_with(move || {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
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
            let entry =
                |i: usize, j: usize| f64::from((i + 1) % n == j) + if i == j { shift } else { 0.0 };
            let matrix: Vec<f64> = (0..n * n).map(|at| entry(at / n, at % n)).collect();
            let found = eigenvalues(&matrix, n).unwrap();
            assert_eq!(found.len(), n);
            for k in 0..n {
                let turn = std::f64::consts::TAU * k as f64 / n as f64;
                let root = [shift + turn.cos(), turn.sin()];
                let near = |e: &&[f64; 2]| (e[0] - root[0]).abs() + (e[1] - root[1]).abs() < 1e-13;
                assert_eq!(found.iter().filter(near).count(), 1, "{n} {shift} {root:?} {found:?}");
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
