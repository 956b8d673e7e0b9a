//! Orders of convergence with step and order held, and what the controlled method conserves, damps
//! and forgets.

use super::*;
use nalgebra::{Vector1, Vector2, Vector3, Vector4};
use twofold_num::Elementary;
use twofold_system::{Caricature, Hysteretic, Relaxation};

/// (c, s)' = (-s, c): the circle, on which every derivative is known.
struct Circle;

impl VectorField<2> for Circle {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        Vector2::new(-x[1], x[0])
    }
}

/// x' = -x^2, x = 1/(1 + t): nonlinear, x^(j)/j! = (-1)^j (1 + t)^(-j - 1).
struct Hyperbola;

impl VectorField<1> for Hyperbola {
    fn eval<S: Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
        Vector1::new(-x[0].squared())
    }
}

/// A stepper held to one formula and one step, with the exact history of the hyperbola at t = 0.
fn held(family: Family, order: usize, h: f64) -> Lsoda<1> {
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-14, atol: 1e-14 });
    lsoda.restart(&Hyperbola, 0.0, Vector1::new(1.0), 1e9, f64::INFINITY).unwrap();
    let mut power = 1.0;
    for j in 0..=order {
        lsoda.history.set_column(j, Vector1::new(power));
        power *= -h;
    }
    (lsoda.family, lsoda.order, lsoda.h, lsoda.held) = (family, order, h, true);
    lsoda
}

/// The largest error over [0, 2] and the error between steps, with `n` steps of 2/n.
fn held_errors(family: Family, order: usize, n: u32) -> (f64, f64) {
    let mut lsoda = held(family, order, 2.0 / f64::from(n));
    let (mut at_steps, mut between) = (0.0_f64, 0.0_f64);
    for _ in 0..n {
        let step = lsoda.step(&Hyperbola).unwrap();
        let error = |theta: f64| (step.at(theta)[0] - 1.0 / (1.0 + step.time(theta))).abs();
        at_steps = at_steps.max(error(1.0));
        between = between.max(error(0.3)).max(error(0.7));
    }
    assert_eq!(lsoda.statistics().highest_order, order as u64);
    (at_steps, between)
}

fn observed_order(family: Family, order: usize, coarse: u32) -> (f64, f64) {
    let (a, a_between) = held_errors(family, order, coarse);
    let (b, b_between) = held_errors(family, order, 2 * coarse);
    assert!(b > 2e-15, "order {order}: the error {b} is rounding; take fewer steps");
    ((a / b).log2(), (a_between / b_between).log2())
}

#[test]
fn every_adams_order_converges_at_its_order() {
    let coarse = [2000, 200, 200, 100, 80, 60, 50, 45, 40, 36, 34, 32];
    for (order, n) in (1..=12).zip(coarse) {
        let (p, dense) = observed_order(Family::Adams, order, n);
        // Close to the order from either side: neither a lower-order slip nor a test that sees only
        // rounding.
        assert!(
            (p - order as f64).abs() < 0.1 * order as f64 + 0.15,
            "order {order}: observed {p}"
        );
        assert!(dense > 0.85 * order as f64, "order {order}: dense output {dense}");
    }
}

#[test]
fn every_bdf_order_converges_at_its_order() {
    let coarse = [2000, 400, 400, 200, 200];
    for (order, n) in (1..=5).zip(coarse) {
        let (p, dense) = observed_order(Family::Bdf, order, n);
        assert!((p - order as f64).abs() < 0.1 * order as f64 + 0.1, "order {order}: observed {p}");
        assert!(dense > 0.85 * order as f64, "order {order}: dense output {dense}");
    }
}

/// The families differ: with the same history, order 2 is the trapezoidal rule or BDF2, by hand.
#[test]
fn second_order_formulas_by_hand() {
    let h = 0.1;
    for (family, l0) in [(Family::Adams, 0.5), (Family::Bdf, 2.0 / 3.0)] {
        let mut lsoda = held(family, 2, h);
        let x1 = lsoda.step(&Hyperbola).unwrap().x1[0];
        // x1 = p + l0 (h f(x1) - q) with the predictions p = 1 - h + h^2, q = -h + 2 h^2.
        let residual = x1 - (1.0 - h + h * h) - l0 * (-h * x1 * x1 - (-h + 2.0 * h * h));
        assert!(residual.abs() < 1e-15, "{family:?}: {residual}");
    }
}

fn run<F: VectorField<N>, const N: usize>(
    lsoda: &mut Lsoda<N>,
    field: &F,
    x: SVector<f64, N>,
    t0: f64,
    t_end: f64,
) -> SVector<f64, N> {
    lsoda.restart(field, t0, x, t_end, f64::INFINITY).unwrap();
    loop {
        let step = lsoda.step(field).unwrap();
        if step.t1 == t_end {
            return step.x1;
        }
        assert!(step.t1 < t_end);
    }
}

/// The global error of the controlled method is proportional to the tolerance.
#[test]
fn error_follows_tolerance() {
    for k in 4..=11 {
        let tolerance = 10_f64.powi(-k);
        let mut lsoda = Lsoda::new(Tolerance { rtol: tolerance, atol: tolerance });
        let x = run(&mut lsoda, &Circle, Vector2::new(1.0, 0.0), 0.0, 20.0);
        let error = (x - Vector2::new(20_f64.cos(), 20_f64.sin())).amax();
        assert!(error < 200.0 * tolerance && error > 0.05 * tolerance, "{tolerance}: {error}");
        assert_eq!(lsoda.statistics().method_switches, 0);
    }
}

/// Linear invariants survive: the correction of a linear multistep method inherits f's sum.
#[test]
fn conserves_linear_invariants() {
    /// Robertson (1966).
    struct Reactions;
    impl VectorField<3> for Reactions {
        fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
            let (slow, back, fast) =
                (x[0].scale(0.04), x[1].scale(1e4) * x[2], x[1].squared().scale(3e7));
            Vector3::new(back - slow, slow - back - fast, fast)
        }
    }
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-6, atol: 1e-10 });
    let x = run(&mut lsoda, &Reactions, Vector3::new(1.0, 0.0, 0.0), 0.0, 1e5);
    assert!((x.sum() - 1.0).abs() < 1e-12, "{}", x.sum());
    assert!(x.iter().all(|x| *x > 0.0));
    assert!(lsoda.statistics().stiff_steps > 0);
}

/// A fast transient onto a slow curve: Adams through the first, BDF along the second with steps far
/// beyond 1/lambda.
#[test]
fn stiff_decay_is_left_to_bdf() {
    /// Prothero & Robinson (1974): x' = -lambda (x - cos t) - sin t with t as a state; x = cos t
    /// after the transient.
    struct ProtheroRobinson;
    impl VectorField<2> for ProtheroRobinson {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            Vector2::new((x[1].cos() - x[0]).scale(1e6) - x[1].sin(), S::one())
        }
    }
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-6, atol: 1e-6 });
    let x = run(&mut lsoda, &ProtheroRobinson, Vector2::new(2.0, 0.0), 0.0, 10.0);
    assert!((x[0] - 10_f64.cos()).abs() < 1e-5);
    let [first, ..] = lsoda.switches() else { panic!("no switch") };
    assert_eq!(first.to, Family::Bdf);
    assert!(first.t < 1e-2, "{first:?}");
    assert!(lsoda.statistics().steps < 500, "{:?}", lsoda.statistics());
    assert_eq!(lsoda.family(), Family::Bdf);
}

/// And back: once the fast mode is switched off, Adams returns.
#[test]
fn adams_returns_when_stiffness_ends() {
    /// x' = -1e4 s(t) (x - cos t) - sin t with s going smoothly from 1 to 0 at t = 5, and t as a
    /// state.
    struct Fading;
    impl VectorField<2> for Fading {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            let s = (S::one() - (x[1] - S::from_f64(5.0)).scale(4.0).tanh()).scale(0.5);
            Vector2::new((x[1].cos() - x[0]).scale(1e4) * s - x[1].sin(), S::one())
        }
    }
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-7, atol: 1e-7 });
    let x = run(&mut lsoda, &Fading, Vector2::new(1.5, 0.0), 0.0, 30.0);
    assert!((x[0] - 30_f64.cos()).abs() < 1e-5, "{x}");
    let to: Vec<_> = lsoda.switches().iter().map(|s| s.to).collect();
    assert_eq!(to, [Family::Bdf, Family::Adams], "{:?}", lsoda.switches());
    assert!((5.0..9.0).contains(&lsoda.switches()[1].t));
}

/// A restart forgets everything but the statistics: the second half is, bit for bit, a new
/// stepper's.
#[test]
fn restart_forgets() {
    let field = Hysteretic {
        system: Caricature::with_reinjection(1e-1, 1e-5),
        eps: 1e-3,
        eps_prime: 1e-2,
        relaxation: Relaxation::Literal,
    };
    let tolerance = Tolerance { rtol: 1e-8, atol: 1e-8 };
    let start = Vector4::new(0.2, 0.0, -1.0, 1.0);
    let mut used = Lsoda::new(tolerance);
    let middle = run(&mut used, &field, start, 0.0, 7.3);
    let before = used.statistics().clone();
    let end = run(&mut used, &field, middle, 7.3, 9.1);
    let mut fresh = Lsoda::new(tolerance);
    let end_fresh = run(&mut fresh, &field, middle, 7.3, 9.1);
    assert_eq!(end.map(f64::to_bits), end_fresh.map(f64::to_bits));
    assert_eq!(used.statistics().steps - before.steps, fresh.statistics().steps);
    assert_eq!(used.statistics().evaluations - before.evaluations, fresh.statistics().evaluations);
    assert_eq!(used.statistics().restarts, 2);
}

/// NDSolve's restarts at t of order 1e5, where the first step can be below the spacing of numbers.
#[test]
fn starts_late() {
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-8, atol: 1e-8 });
    let x = run(&mut lsoda, &Circle, Vector2::new(1.0, 0.0), 199_980.0, 200_000.0);
    assert!((x - Vector2::new(20_f64.cos(), 20_f64.sin())).amax() < 1e-6);
}

/// Both families' formulas vanish at the step's start, so that the dense output goes through it.
#[test]
fn the_dense_output_begins_at_the_step() {
    for tolerance in [1e-4, 1e-8, 1e-11] {
        let mut lsoda = Lsoda::new(Tolerance { rtol: tolerance, atol: tolerance });
        lsoda.restart(&Circle, 0.0, Vector2::new(1.0, 0.0), 20.0, f64::INFINITY).unwrap();
        loop {
            let step = lsoda.step(&Circle).unwrap();
            assert!((step.at(0.0) - step.x0).amax() < 1e-14 && step.at(1.0) == step.x1);
            if step.t1 == 20.0 {
                break;
            }
        }
    }
}

#[test]
fn keeps_the_cap() {
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-4, atol: 1e-4 });
    lsoda.restart(&Circle, 0.0, Vector2::new(1.0, 0.0), 10.0, 0.01).unwrap();
    loop {
        let step = lsoda.step(&Circle).unwrap();
        assert!(step.length() <= 0.01 * (1.0 + 1e-12));
        if step.t1 == 10.0 {
            break;
        }
    }
}

/// The dense output is as good as the steps, at every order the control chooses.
#[test]
fn dense_output_is_accurate() {
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-9, atol: 1e-9 });
    lsoda.restart(&Circle, 0.0, Vector2::new(1.0, 0.0), 20.0, f64::INFINITY).unwrap();
    loop {
        let step = lsoda.step(&Circle).unwrap();
        for theta in [0.01, 0.25, 0.5, 0.75, 0.99] {
            let t = step.time(theta);
            assert!((step.at(theta) - Vector2::new(t.cos(), t.sin())).amax() < 1e-7, "t = {t}");
        }
        assert!(step.interpolant.degree() <= 12);
        if step.t1 == 20.0 {
            break;
        }
    }
}

#[test]
fn failures_are_named() {
    struct Explosion;
    impl VectorField<1> for Explosion {
        fn eval<S: Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
            Vector1::new(x[0].squared())
        }
    }
    // x = 1/(1 - t) has no value at t = 1.
    let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-8, atol: 1e-8 });
    lsoda.restart(&Explosion, 0.0, Vector1::new(1.0), 2.0, f64::INFINITY).unwrap();
    let failure = (0..100_000)
        .find_map(|_| lsoda.step(&Explosion).err())
        .expect("the solution ends at t = 1");
    let (Failure::StepUnderflow { t, .. }
    | Failure::NotFinite { t, .. }
    | Failure::NotConverged { t, .. }) = failure
    else {
        panic!("{failure}")
    };
    assert!((t - 1.0).abs() < 1e-6, "{failure}");
    let nan = lsoda.restart(&Explosion, 0.0, Vector1::new(f64::NAN), 2.0, f64::INFINITY);
    assert!(matches!(nan, Err(Failure::NotFinite { .. })));
}

/// Premise of the shortcut in the stiffness test.
#[test]
fn bdf_is_never_the_more_accurate_formula() {
    for q in 1..=BDF_ORDERS {
        assert!(ERROR_RATIO[q - 1] >= 1.0, "order {q}: {}", ERROR_RATIO[q - 1]);
    }
}

/// Stability limits a step to a length, |lambda| h = Petzold's bound, independent of the step at
/// which it is evaluated; a smaller limit is that of accuracy.
#[test]
fn the_longest_stable_step_does_not_depend_on_the_step_at_hand() {
    for (lipschitz, h) in
        [(20.0, 1e-4), (20.0, 2e-3), (20.0, 0.5), (3e3, 1e-4), (3e3, 2e-3), (3e3, 0.5)]
    {
        let longest = held(Family::Adams, 3, h).adams_growth(1e-18, 3, lipschitz) * h;
        assert!((longest * lipschitz / 0.55 - 1.0).abs() < 1e-14, "{lipschitz} {h}: {longest}");
    }
    for lipschitz in [1.0, 1e-3] {
        assert_eq!(
            held(Family::Adams, 3, 1e-4).adams_growth(1e-4, 3, lipschitz),
            growth(BIAS_SAME, 1e-4, 3)
        );
    }
}

/// Petzold's test, said once more without its shortcut: BDF takes over where the step that accuracy
/// leaves it is five times what accuracy and stability leave Adams.
#[test]
fn bdf_takes_over_where_its_step_is_five_times_as_long() {
    let (mut stays, mut switches) = (0, 0);
    for order in 1..=5 {
        for h in [1e-3, 1.0, 30.0] {
            // |lambda| h.
            for reach in [0.02, 0.3, 2.0, 20.0, 300.0] {
                for error in [1e-9, 1e-4, 0.1, 0.9] {
                    let mut lsoda = held(Family::Adams, order, h);
                    (lsoda.lipschitz, lsoda.lipschitz_seen, lsoda.predicted_size) =
                        (reach / h, 1.0, 1.0);
                    let adams =
                        growth(BIAS_SAME, error, order).min(ADAMS_STABILITY[order - 1] / reach);
                    let bdf = growth(BIAS_SAME, error * ERROR_RATIO[order - 1], order);
                    let change = lsoda.consider_switch(error);
                    let said = format!(
                        "order {order}, h {h}, |lambda| h {reach}, error {error}: {adams} {bdf}"
                    );
                    assert_eq!(change.is_some(), bdf >= SWITCH_RATIO * adams, "{said}");
                    match change {
                        Some(change) => {
                            assert_eq!(
                                (change.family, change.order, change.ratio),
                                (Family::Bdf, order, bdf),
                                "{said}"
                            );
                            switches += 1;
                        }
                        None => stays += 1,
                    }
                }
            }
        }
    }
    assert!(stays > 30 && switches > 30, "{stays} {switches}");
}
