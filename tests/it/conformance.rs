//! Contract of a stepper, checked on every stepper.
#![allow(clippy::disallowed_methods)] // exact solutions are compared to tolerances, not hashed

use nalgebra::{SVector, Vector1, Vector2, Vector3, Vector4};
use proptest::prelude::*;
use twofold::integrate::*;
use twofold::num::Elementary;
use twofold::system::{Caricature, Hysteretic, Relaxation, Smoothed, Transition, VectorField};

/// x' = y, y' = -x.
struct Oscillator;
impl VectorField<2> for Oscillator {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        Vector2::new(x[1], -x[0])
    }
}

/// x' = x^2: leaves every bound at t = 1/x(0).
struct Explosion;
impl VectorField<1> for Explosion {
    fn eval<S: Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
        Vector1::new(x[0] * x[0])
    }
}

fn smoothed() -> Smoothed<Caricature> {
    Smoothed {
        system: Caricature::with_reinjection(1e-1, 1e-5),
        transition: Transition::Tanh,
        eps: 1e-3,
    }
}

fn hysteretic() -> Hysteretic<Caricature> {
    Hysteretic {
        system: Caricature::with_reinjection(1e-1, 1e-5),
        eps: 1e-3,
        eps_prime: 1e-2,
        relaxation: Relaxation::Literal,
    }
}

const TOLERANCE: Tolerance = Tolerance { rtol: 1e-8, atol: 1e-8 };

/// Steps from (t0, x0) to t_end: (t1, x1 bits) of each, with the promises of a step checked on the
/// way.
fn walk<const N: usize, F: VectorField<N>, M: Stepper<N>>(
    m: &mut M,
    f: &F,
    t0: f64,
    x0: SVector<f64, N>,
    t_end: f64,
    cap: f64,
) -> Vec<(f64, [u64; N])> {
    m.restart(f, t0, x0, t_end, cap).unwrap();
    let (mut t, mut x) = (t0, x0);
    let mut trace = Vec::new();
    while t < t_end {
        let step = m.step(f).unwrap();
        assert_eq!(step.t0, t, "steps join in time");
        assert_eq!(step.x0, x, "steps join in state");
        assert!(step.t1 > step.t0 && step.t1 <= t_end);
        assert!(step.length() <= cap * (1.0 + 1e-12), "cap {cap}, step {}", step.length());
        // The interpolant meets both ends, as a limit too.
        let scale = 1.0 + x.amax();
        for (theta, end) in [(1e-13, step.x0), (1.0 - 1e-13, step.x1)] {
            let gap = (step.interpolant.at(theta) - end).amax();
            assert!(gap <= 1e-9 * scale, "gap {gap:e} at theta {theta} of the step at t = {t}");
        }
        // One coordinate by itself is the same number.
        for theta in [0.0, 0.3, 0.77, 1.0] {
            let whole = step.at(theta);
            for i in 0..N {
                assert_eq!(
                    step.coordinate(theta, i).to_bits(),
                    whole[i].to_bits(),
                    "coordinate {i} at {theta}"
                );
            }
        }
        (t, x) = (step.t1, step.x1);
        trace.push((t, std::array::from_fn(|i| x[i].to_bits())));
        assert!(trace.len() < 2_000_000, "no end in sight");
    }
    assert_eq!(t, t_end, "the end is reached exactly");
    trace
}

/// All promises for one method. `make` makes a fresh stepper in any dimension.
macro_rules! conforms {
    ($module:ident, $method:ident) => {
        mod $module {
            use super::*;

            #[test]
            fn steps_keep_their_promises() {
                let start = Vector2::new(1.0, 0.0);
                walk(&mut $method::new(TOLERANCE), &Oscillator, 0.0, start, 25.0, 0.7);
                walk(
                    &mut $method::new(TOLERANCE),
                    &smoothed(),
                    0.0,
                    Vector3::new(0.2, 0.0, -1.0),
                    20.0,
                    2.0,
                );
                walk(
                    &mut $method::new(TOLERANCE),
                    &hysteretic(),
                    0.0,
                    Vector4::new(0.2, 0.0, -1.0, 1.0),
                    5.0,
                    0.5,
                );
            }

            #[test]
            fn oscillator_is_accurate() {
                let mut m = $method::new(TOLERANCE);
                let start = Vector2::new(1.0, 0.0);
                let end = walk(&mut m, &Oscillator, 0.0, start, 10.0, f64::INFINITY);
                let x = end.last().unwrap().1.map(f64::from_bits);
                let error = (x[0] - 10.0_f64.cos()).abs().max((x[1] + 10.0_f64.sin()).abs());
                // Global error: local tolerance times a modest number of steps.
                assert!(error < 1e-5 && error > 0.0, "{error:e}");
            }

            #[test]
            fn the_interpolant_is_accurate_inside() {
                let mut m = $method::new(TOLERANCE);
                m.restart(&Oscillator, 0.0, Vector2::new(1.0, 0.0), 10.0, f64::INFINITY).unwrap();
                let mut t = 0.0;
                while t < 10.0 {
                    let step = m.step(&Oscillator).unwrap();
                    for theta in [0.1, 0.5, 0.9] {
                        let s = step.time(theta);
                        let error = (step.at(theta) - Vector2::new(s.cos(), -s.sin())).amax();
                        assert!(error < 2e-5, "{error:e} at {s}");
                    }
                    t = step.t1;
                }
            }

            #[test]
            fn restart_forgets_everything() {
                let (f, x0) = (smoothed(), Vector3::new(0.2, 0.0, -1.0));
                let fresh = walk(&mut $method::new(TOLERANCE), &f, 0.0, x0, 12.0, 1.0);
                let mut used = $method::new(TOLERANCE);
                walk(&mut used, &f, 3.0, Vector3::new(-0.4, 1.1, 0.2), 9.0, 0.1);
                let before = Stepper::<3>::statistics(&used).steps;
                let again = walk(&mut used, &f, 0.0, x0, 12.0, 1.0);
                assert_eq!(fresh, again);
                assert_eq!(
                    Stepper::<3>::statistics(&used).steps,
                    before + again.len() as u64,
                    "statistics go on"
                );
            }

            #[test]
            fn an_explosion_is_an_error_with_time_and_state() {
                let mut m = $method::new(TOLERANCE);
                m.restart(&Explosion, 0.0, Vector1::new(1.0), 2.0, f64::INFINITY).unwrap();
                let failure = loop {
                    match m.step(&Explosion) {
                        Ok(step) => assert!(step.t1 < 1.001, "walked through the pole"),
                        Err(failure) => break failure,
                    }
                };
                let text = failure.to_string();
                assert!(text.contains("t = 0.99") || text.contains("t = 1"), "{text}");
                assert!(text.contains("state ["), "{text}");
            }

            #[test]
            fn not_a_number_is_refused_at_the_start() {
                let mut m = $method::new(TOLERANCE);
                let result = m.restart(&Oscillator, 0.0, Vector2::new(f64::NAN, 0.0), 1.0, 1.0);
                assert!(matches!(result, Err(Failure::NotFinite { .. })), "{result:?}");
            }

            proptest! {
                #![proptest_config(ProptestConfig::with_cases(24))]
                #[test]
                fn any_oscillation_keeps_its_radius(
                    a in -50.0..50.0_f64, b in -50.0..50.0_f64, t_end in 0.01..20.0_f64,
                        cap in 0.05..5.0_f64,
                ) {
                    let start = Vector2::new(a, b);
                    let mut method = $method::new(TOLERANCE);
                    let end = walk(&mut method, &Oscillator, 0.0, start, t_end, cap);
                    let x = end.last().unwrap().1.map(f64::from_bits);
                    let (r0, r) = (a.hypot(b), x[0].hypot(x[1]));
                    prop_assert!((r - r0).abs() <= 1e-5 * (1.0 + r0), "{r0} {r}");
                }
            }
        }
    };
}

conforms!(dopri5, Dopri5);
conforms!(lsoda, Lsoda);
conforms!(radau5, Radau5);
conforms!(taylor, Taylor);
conforms!(taylor_extended, Extended);
conforms!(layered, Layered);

/// The same promises in double-double arithmetic.
struct Extended;
impl Extended {
    #[allow(clippy::new_ret_no_self)] // takes the place of a stepper's type in the macro
    fn new<const N: usize>(tolerance: Tolerance) -> Taylor<N, twofold::num::DoubleDouble> {
        Taylor::extended(tolerance)
    }
}
