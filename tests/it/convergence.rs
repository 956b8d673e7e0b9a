//! The controlled methods on linear systems with known solutions, over many decades of stiffness.
//!
//! Orders at held step sizes are tested beside the methods, where step and order can be held.
#![allow(clippy::disallowed_methods)] // exact solutions are compared to tolerances, not hashed

use nalgebra::{Matrix3, SVector, Vector1, Vector2, Vector3, Vector4};
use proptest::prelude::*;
use twofold::integrate::{Dopri5, Failure, Lsoda, Radau5, Statistics, Stepper, Tolerance};
use twofold::num::Elementary;
use twofold::system::{Caricature, Hysteretic, Relaxation, VectorField};

/// x' = S diag(-rates) S^-1 x, with a well-conditioned S.
struct Linear {
    matrix: Matrix3<f64>,
}

const S: Matrix3<f64> = Matrix3::new(1.0, 0.4, -0.2, -0.3, 1.0, 0.5, 0.1, -0.6, 1.0);

impl Linear {
    fn with_rates(rates: [f64; 3]) -> Self {
        let inverse = S.try_inverse().unwrap();
        Self {
            matrix: S
                * Matrix3::from_diagonal(&Vector3::new(-rates[0], -rates[1], -rates[2]))
                * inverse,
        }
    }
}

impl VectorField<3> for Linear {
    fn eval<T: Elementary>(&self, x: &SVector<T, 3>) -> SVector<T, 3> {
        SVector::from_fn(|i, _| {
            let m = |j: usize| x[j].scale(self.matrix[(i, j)]);
            m(0) + m(1) + m(2)
        })
    }
}

fn solve<M: Stepper<3>>(
    mut stepper: M,
    field: &Linear,
    start: SVector<f64, 3>,
    t_end: f64,
) -> Result<(SVector<f64, 3>, Statistics), Failure> {
    stepper.restart(field, 0.0, start, t_end, f64::INFINITY)?;
    loop {
        let step = stepper.step(field)?;
        if step.t1 == t_end {
            let x = step.x1;
            return Ok((x, stepper.statistics().clone()));
        }
        assert!(stepper.statistics().steps < 20_000, "{:?}", stepper.statistics());
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// One slow mode, one in between, one up to 1e9 times faster: correct, and at a cost that
    /// stiffness hardly shows in.
    #[test]
    fn stiffness_costs_little(
        slow in 0.05..1.0_f64, middle in 0.0..4.0_f64, fast in 0.0..9.0_f64,
            tolerance in 4.0..9.0_f64,
        weights in prop::array::uniform3(-1.0..1.0_f64),
    ) {
        let rates = [slow, slow * 10_f64.powf(middle), slow * 10_f64.powf(fast)];
        let field = Linear::with_rates(rates);
        let start = S * SVector::from(weights);
        let t_end = 5.0;
        let exact = S * SVector::<f64, 3>::from_fn(|i, _| weights[i] * (-rates[i] * t_end).exp());
        let tol = 10_f64.powf(-tolerance);
        let tolerance = Tolerance { rtol: tol, atol: tol };
        let (x, s) = solve(Lsoda::new(tolerance), &field, start, t_end).unwrap();
        prop_assert!((x - exact).amax() < 100.0 * tol, "LSODA {:e} {s:?}", (x - exact).amax());
        prop_assert!(s.evaluations < 3000, "LSODA {s:?}");
        let (x, s) = solve(Radau5::new(tolerance), &field, start, t_end).unwrap();
        prop_assert!((x - exact).amax() < 10.0 * tol, "Radau5 {:e} {s:?}", (x - exact).amax());
        prop_assert!(s.steps < 1500, "Radau5 {s:?}");
    }
}

/// Purely imaginary spectrum, where BDF of order 3 to 5 is not stable and nothing may be gained by
/// pretending.
#[test]
fn oscillations_stay_with_adams() {
    struct Oscillator;
    impl VectorField<2> for Oscillator {
        fn eval<T: Elementary>(&self, x: &SVector<T, 2>) -> SVector<T, 2> {
            Vector2::new(x[1].scale(50.0), x[0].scale(-50.0))
        }
    }
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-8, atol: 1e-8 });
    lsoda.restart(&Oscillator, 0.0, Vector2::new(1.0, 0.0), 10.0, f64::INFINITY).unwrap();
    let x = loop {
        let step = lsoda.step(&Oscillator).unwrap();
        if step.t1 == 10.0 {
            break step.x1;
        }
    };
    assert_eq!(lsoda.statistics().stiff_steps, 0);
    assert!(lsoda.statistics().highest_order >= 7);
    assert!((x - Vector2::new(500_f64.cos(), -500_f64.sin())).amax() < 1e-5);
}

/// x' = -sqrt(x) leaves its domain at t = 2: a trial point outside is a failed trial, and the end
/// is a named failure.
#[test]
fn leaving_the_domain_is_named() {
    struct Draining;
    impl VectorField<1> for Draining {
        fn eval<T: Elementary>(&self, x: &SVector<T, 1>) -> SVector<T, 1> {
            Vector1::new(-x[0].sqrt())
        }
    }
    fn failure<M: Stepper<1>>(mut stepper: M) -> Failure {
        stepper.restart(&Draining, 0.0, Vector1::new(1.0), 4.0, f64::INFINITY).unwrap();
        (0..100_000)
            .find_map(|_| stepper.step(&Draining).err())
            .expect("there is no solution beyond t = 2")
    }
    let tolerance = Tolerance { rtol: 1e-8, atol: 1e-8 };
    for failure in [failure(Lsoda::new(tolerance)), failure(Radau5::new(tolerance))] {
        let (Failure::StepUnderflow { t, .. }
        | Failure::NotFinite { t, .. }
        | Failure::NotConverged { t, .. }) = &failure
        else {
            panic!("{failure}")
        };
        assert!((t - 2.0).abs() < 0.01, "{failure}");
    }
}

/// Why no method makes the literal hysteretic system cheap. On the attracting part of the surface
/// phi never comes to rest: it swings between 0 and 1, and x through layers of width eps'^2 = 1e-4
/// with it. The swings are the solution (every method and tolerance finds the same number of them),
/// not a fast mode that an implicit method could step over.
#[test]
fn hysteretic_chatter_is_the_solution() {
    fn swings<M: Stepper<4>>(mut stepper: M) -> (usize, u64) {
        let field = Hysteretic {
            system: Caricature::with_reinjection(1e-1, 1e-5),
            eps: 1e-3,
            eps_prime: 1e-2,
            relaxation: Relaxation::Literal,
        };
        // Up to shortly before the first visit of the singularity, after which no two methods
        // agree.
        stepper.restart(&field, 0.0, Vector4::new(0.2, 0.0, -1.0, 1.0), 10.0, 0.25).unwrap();
        let (mut t, mut swings) = (0.0, 0);
        while t < 10.0 {
            let step = stepper.step(&field).unwrap();
            swings += usize::from((step.x0[3] > 0.5) != (step.x1[3] > 0.5));
            t = step.t1;
        }
        (swings, stepper.statistics().evaluations)
    }
    let tolerance = |tol: f64| Tolerance { rtol: tol, atol: tol };
    let found = [
        swings(Dopri5::new(tolerance(1e-8))),
        swings(Lsoda::new(tolerance(1e-8))),
        swings(Radau5::new(tolerance(1e-8))),
        swings(Dopri5::new(tolerance(1e-11))),
        swings(Radau5::new(tolerance(1e-11))),
    ];
    println!("{found:?}");
    assert!(found[0].0 > 100, "{found:?}");
    assert!(found.iter().all(|f| f.0 == found[0].0), "{found:?}");
}

/// Frozen bits: debug and release, any machine. A changed library, compiler or line of arithmetic
/// shows here first.
#[test]
fn known_bits() {
    struct Lorenz;
    impl VectorField<3> for Lorenz {
        fn eval<T: Elementary>(&self, x: &SVector<T, 3>) -> SVector<T, 3> {
            Vector3::new(
                (x[1] - x[0]).scale(10.0),
                x[0] * (T::from_f64(28.0) - x[2]) - x[1],
                x[0] * x[1] - x[2].scale(8.0 / 3.0),
            )
        }
    }
    fn bits<M: Stepper<3>>(mut stepper: M) -> [u64; 3] {
        stepper.restart(&Lorenz, 0.0, Vector3::new(1.0, 1.0, 1.0), 10.0, f64::INFINITY).unwrap();
        loop {
            let step = stepper.step(&Lorenz).unwrap();
            if step.t1 == 10.0 {
                return step.x1.map(f64::to_bits).into();
            }
        }
    }
    let tolerance = Tolerance { rtol: 1e-10, atol: 1e-10 };
    assert_eq!(
        bits(Lsoda::new(tolerance)),
        [13840577990766353957, 13838984908577566007, 4627643076306687792]
    );
    assert_eq!(
        bits(Radau5::new(tolerance)),
        [13840577990728012982, 13838984908002722052, 4627643076391553882]
    );
}

/// Tolerances of zero cannot be met; they must not run for ever or return nonsense.
#[test]
fn zero_tolerance_is_a_named_failure() {
    let field = Linear::with_rates([1.0, 2.0, 3.0]);
    let zero = Tolerance { rtol: 0.0, atol: 0.0 };
    for start in [Vector3::new(1.0, 1.0, 1.0), Vector3::new(0.0, 1.0, 0.0)] {
        let lsoda = solve(Lsoda::new(zero), &field, start, 1.0);
        assert!(matches!(lsoda, Err(Failure::StepUnderflow { .. })), "{lsoda:?}");
        let radau = solve(Radau5::new(zero), &field, start, 1.0);
        assert!(
            matches!(radau, Err(Failure::StepUnderflow { .. } | Failure::NotConverged { .. })),
            "{radau:?}"
        );
    }
}
