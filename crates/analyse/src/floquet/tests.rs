use super::*;
use twofold_num::Elementary;

/// r' = a r (1 - r^2), angle' = 1: period 2 pi, multiplier exp(-4 pi a).
struct Hopf(f64);
impl VectorField<2> for Hopf {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        let g = (S::one() - x[0] * x[0] - x[1] * x[1]).scale(self.0);
        SVector::from([g * x[0] - x[1], g * x[1] + x[0]])
    }
}

#[test]
fn hopf_normal_form_is_exact() {
    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    for a in [0.05, 0.5, -0.03] {
        let o = closed_orbit::<2, 6, _>(
            &Hopf(a),
            plane,
            1,
            SVector::from([1.2, 0.0]),
            &FloquetOptions::default(),
        )
        .unwrap();
        assert!((o.period - std::f64::consts::TAU).abs() < 1e-9, "{o:?}");
        assert!((o.rate - 2.0 * a).abs() < 1e-8, "{o:?}");
        assert!((o.points[0][0] - 1.0).abs() < 1e-8 && (o.opposite[0][0] + 1.0).abs() < 1e-8);
    }
}

#[test]
fn no_returns_are_refused() {
    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    let found = closed_orbit::<2, 6, _>(
        &Hopf(0.5),
        plane,
        0,
        SVector::from([1.2, 0.0]),
        &FloquetOptions::default(),
    );
    assert_eq!(found, Err(Error::NoReturns));
}

#[test]
fn cubic_eigenvalues() {
    // Companion form of (l - 0.9)(l^2 - 0.2 l + 0.5), surrounded by the axis.
    let mut m = SMatrix::<f64, 4, 4>::zeros();
    let (c2, c1, c0) = (1.1, -0.68, 0.45);
    for (i, j, v) in [(0, 0, c2), (0, 2, c1), (0, 3, c0), (2, 0, 1.0), (3, 2, 1.0)] {
        m[(i, j)] = v;
    }
    let e = multipliers(&m, 1);
    assert!((e[0][0] - 0.9).abs() < 1e-12 && e[0][1] == 0.0, "{e:?}");
    assert!((e[1][0] - 0.1).abs() < 1e-12 && (e[1][1].abs() - 0.7).abs() < 1e-12, "{e:?}");
    assert!(e[2][0] == e[1][0] && e[2][1] == -e[1][1], "a pair: {e:?}");
}

/// s' = 1, y' = q'(s) with q(s) = s (s^2 - 1)(s^2 - 4): so y - q(s) stays what it is, and a
/// return of a plane of y is a root of a polynomial.
struct Quintic;
impl VectorField<2> for Quintic {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        let s2 = x[0] * x[0];
        SVector::from([S::one(), (s2 * s2).scale(5.0) - s2.scale(15.0) + S::one().scale(4.0)])
    }
}

#[test]
fn returns_of_a_polynomial_are_its_roots() {
    // The method is exact for it and its dense output is not: the crossing is landed on, and
    // what is left is mended.
    let settings = FloquetOptions {
        tolerance: Tolerance { rtol: 1e-5, atol: 1e-5 },
        ..FloquetOptions::default()
    };
    for value in [0.0, 0.7, -3.0] {
        let plane = ReturnPlane { axis: 1, value, upward: true };
        let of = |returns| {
            let start = SVector::from([-2.0, value]);
            return_map::<2, 6, _>(
                &Tangent::<Quintic, 2>(&Quintic),
                plane,
                returns,
                &start,
                &settings,
            )
            .unwrap()
        };
        // Upwards at -2, 0, 2 with the slopes 24, 4, 24; the derivative is the slope at the
        // start over that at the end.
        for (returns, s, derivative) in [(1, 0.0, 6.0), (2, 2.0, 1.0)] {
            let r = of(returns);
            assert!((r.point[0] - s).abs() < 1e-9 && r.point[1] == value, "{r:?}");
            assert!((r.time - (s + 2.0)).abs() < 1e-9, "{r:?}");
            assert!(
                (r.derivative[0] - derivative).abs() < 1e-6 && r.derivative[1..] == [0.0; 3],
                "{r:?}"
            );
            assert_eq!((r.same.len(), r.opposite.len()), (returns, returns));
            assert!(
                r.opposite.iter().zip([-1.0, 1.0]).all(|(x, s)| (x[0] - s).abs() < 1e-3),
                "{r:?}"
            );
        }
    }
}

#[test]
fn a_plane_beside_the_centre_sees_the_same_orbit() {
    let settings = FloquetOptions::default();
    let root = sqrt(0.75);
    for (upward, z) in [(true, -root), (false, root)] {
        let plane = ReturnPlane { axis: 0, value: 0.5, upward };
        for returns in [1, 2] {
            let guess = SVector::from([0.3, 1.1 * z]);
            let o = closed_orbit::<2, 6, _>(&Hopf(0.05), plane, returns, guess, &settings).unwrap();
            let turns = [0.0, 1.0, 2.0][returns];
            assert!((o.period - turns * std::f64::consts::TAU).abs() < 1e-8, "{o:?}");
            assert!(
                (ln(o.multipliers[0][0]) + turns * 0.2 * std::f64::consts::PI).abs() < 1e-7,
                "{o:?}"
            );
            assert!((o.rate - 0.1).abs() < 1e-8, "{o:?}");
            assert_eq!(
                (o.points.len(), o.opposite.len(), o.multipliers.len()),
                (returns, returns, 1)
            );
            assert!(
                o.points.iter().all(|p| (p[0] - 0.5).abs() < 1e-7 && (p[1] - z).abs() < 1e-7),
                "{o:?}"
            );
            assert!(
                o.opposite.iter().all(|p| (p[0] - 0.5).abs() < 1e-7 && (p[1] + z).abs() < 1e-7),
                "{o:?}"
            );
        }
    }
}

#[test]
fn what_does_not_return_or_converge_is_told() {
    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    let of = |settings| {
        closed_orbit::<2, 6, _>(&Hopf(0.05), plane, 1, SVector::from([1.2, 0.0]), &settings)
    };
    let short = of(FloquetOptions { longest_return: 6.0, ..FloquetOptions::default() });
    assert_eq!(short, Err(Error::NoReturn { from: vec![1.2, 0.0], within: 6.0 }));
    let few = of(FloquetOptions { most_steps: 10, ..FloquetOptions::default() });
    assert_eq!(few, Err(Error::TooLong { from: vec![1.2, 0.0], steps: 10 }));
    // After one iteration it still misses itself, by what Newton's method makes of a start 0.2
    // off.
    let Err(Error::NotConverged { residual, iterations: 1 }) =
        of(FloquetOptions { iterations: 1, ..FloquetOptions::default() })
    else {
        panic!("one iteration is not enough")
    };
    // r^2/(1 - r^2) grows by exp(4 pi a) a turn, which says where 1.2 goes.
    let ratio = 1.44 / 0.44 * twofold_num::elementary::exp(0.2 * std::f64::consts::PI);
    let there = sqrt(ratio / (ratio - 1.0));
    assert!((residual - (1.2 - there)).abs() < 1e-8, "{residual} {there}");
}

#[test]
fn multipliers_come_by_falling_modulus() {
    let of = |rows: &[f64], n, axis| multipliers_of(rows, n, axis);
    let close = |got: &[[f64; 2]], want: &[[f64; 2]]| {
        let near = |(g, w): (&[f64; 2], &[f64; 2])| {
            (g[0] - w[0]).abs() < 1e-10 && (g[1].abs() - w[1]).abs() < 1e-10
        };
        assert!(got.len() == want.len() && got.iter().zip(want).all(near), "{got:?} {want:?}");
    };
    assert!(of(&[0.0], 1, 0).is_empty());
    close(&of(&[0.0, 0.0, 0.0, -0.7], 2, 0), &[[-0.7, 0.0]]);
    // l^2 - s l + p, as ((s, -p), (1, 0)) around an axis in the middle.
    let two = |s: f64, p: f64| of(&[s, 0.0, -p, 0.0, 9.0, 0.0, 1.0, 0.0, 0.0], 3, 1);
    close(&two(3.0, 2.0), &[[2.0, 0.0], [1.0, 0.0]]);
    close(&two(-3.0, 2.0), &[[-2.0, 0.0], [-1.0, 0.0]]);
    close(&two(-1.0, -6.0), &[[-3.0, 0.0], [2.0, 0.0]]);
    close(&two(2.0, 5.0), &[[1.0, 2.0], [1.0, 2.0]]);
    close(&two(0.0, 0.0), &[[0.0, 0.0], [0.0, 0.0]]);
    close(&two(2.0, 1.0), &[[1.0, 0.0], [1.0, 0.0]]);
    // The small one keeps its digits beside a large one.
    assert!((two(1e9 + 1e-9, 1.0)[1][0] * 1e9 - 1.0).abs() < 1e-12);
    // (l - 0.5)(l^2 - 0.2 l + 0.82): the pair has the larger modulus. Not a companion: similar
    // to one, with full rows.
    let three = |rows: [[f64; 3]; 3]| {
        let shear = [[1.0, 2.0, -1.0], [1.0, 3.0, 2.0], [0.0, 1.0, 4.0]];
        let back = [[10.0, -9.0, 7.0], [-4.0, 4.0, -3.0], [1.0, -1.0, 1.0]];
        let times = |a: [[f64; 3]; 3], b: [[f64; 3]; 3]| -> [[f64; 3]; 3] {
            std::array::from_fn(|i| {
                std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum())
            })
        };
        let m = times(times(shear, rows), back);
        let full: Vec<f64> =
            (0..16).map(|k| if k / 4 == 3 || k % 4 == 3 { 0.0 } else { m[k / 4][k % 4] }).collect();
        of(&full, 4, 3)
    };
    close(
        &three([[0.7, -0.92, 0.41], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]),
        &[[0.1, 0.9], [0.1, 0.9], [0.5, 0.0]],
    );
    // The tribonacci constant is larger than any coefficient of its polynomial.
    let pair = [-0.419_643_377_607_080_6, 0.606_290_729_207_199_4];
    let tribonacci = three([[1.0, 1.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    close(&tribonacci, &[[1.839_286_755_214_161, 0.0], pair, pair]);
    // Four of five states: (l - 0.5)(l + 0.3) and a pair, the first of which feeds the others.
    let pair_first =
        [[0.2, -0.82, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [5.0, 0.0, 0.2, 0.15], [0.0, 7.0, 1.0, 0.0]];
    let pair_last =
        [[0.2, 0.15, 0.0, 0.0], [1.0, 0.0, 0.0, 0.0], [5.0, 0.0, 0.2, -0.82], [0.0, 7.0, 1.0, 0.0]];
    for four in [pair_first, pair_last] {
        let entry = |k: usize| {
            if k / 5 == 0 || k.is_multiple_of(5) { 9.0 } else { four[k / 5 - 1][k % 5 - 1] }
        };
        let full: Vec<f64> = (0..25).map(entry).collect();
        close(&of(&full, 5, 0), &[[0.1, 0.9], [0.1, 0.9], [0.5, 0.0], [-0.3, 0.0]]);
    }
    close(
        &three([[0.2, 0.0, 0.0], [0.0, -0.9, 0.0], [0.0, 0.0, 0.5]]),
        &[[-0.9, 0.0], [0.5, 0.0], [0.2, 0.0]],
    );
}

#[test]
fn a_pair_of_complex_multipliers_has_the_rate_of_its_modulus() {
    /// With d = r^2 - 1: (d, z)' = ((-0.02, -0.3), (0.3, -0.02)) (d, z), angle' = 1.
    struct Ring;
    impl VectorField<3> for Ring {
        fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
            let square = x[0] * x[0] + x[1] * x[1];
            let d = square - S::one();
            let g = (-d.scale(0.02) - x[2].scale(0.3)) / square.scale(2.0);
            SVector::from([g * x[0] - x[1], g * x[1] + x[0], d.scale(0.3) - x[2].scale(0.02)])
        }
    }
    let plane = ReturnPlane { axis: 1, value: 0.0, upward: true };
    let guess = SVector::from([1.1, 0.0, 0.05]);
    let o = closed_orbit::<3, 12, _>(&Ring, plane, 1, guess, &FloquetOptions::default()).unwrap();
    assert!((o.rate - 0.02).abs() < 1e-8 && o.multipliers[0][1] != 0.0, "{o:?}");
}
