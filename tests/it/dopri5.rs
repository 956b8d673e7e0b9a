//! Order of Dormand-Prince and of its dense output, by halving fixed steps.
#![allow(clippy::disallowed_methods)] // exact solutions are compared to tolerances, not hashed

use nalgebra::{SVector, Vector2};
use twofold::integrate::{Dopri5, Stepper, Tolerance};
use twofold::num::Elementary;
use twofold::system::VectorField;

/// x' = -2 s x, s' = 1: x = exp(-s^2).
struct Bell;
impl VectorField<2> for Bell {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        Vector2::new((-x[1] * x[0]).scale(2.0), S::one())
    }
}

/// (largest error at the ends of steps, largest error inside steps) on [0, 2] with steps of 1/n.
fn errors(n: u32) -> (f64, f64) {
    // A tolerance that accepts everything leaves the cap to set the step, after a few tiny first
    // ones.
    let mut m = Dopri5::new(Tolerance { rtol: 1e3, atol: 1e3 });
    let mut worst = (0.0_f64, 0.0_f64);
    let mut t = 0.0;
    m.restart(&Bell, t, Vector2::new(1.0, 0.0), 2.0, 1.0 / f64::from(n)).unwrap();
    while t < 2.0 {
        let step = m.step(&Bell).unwrap();
        let error = |s: f64, x: SVector<f64, 2>| (x[0] - (-s * s).exp()).abs();
        worst.0 = worst.0.max(error(step.t1, step.x1));
        for i in 1..10 {
            let theta = f64::from(i) / 10.0;
            worst.1 = worst.1.max(error(step.time(theta), step.at(theta)));
        }
        t = step.t1;
    }
    worst
}

#[test]
fn order_five_at_the_ends_and_inside() {
    let orders: Vec<(f64, f64)> = [8, 16, 32, 64]
        .windows(2)
        .map(|w| {
            let (a, b) = (errors(w[0]), errors(w[1]));
            ((a.0 / b.0).log2(), (a.1 / b.1).log2())
        })
        .collect();
    println!("{orders:?}");
    for (ends, inside) in orders {
        assert!((4.6..5.6).contains(&ends), "order at the ends: {ends}");
        // The interpolant is of fourth order: local error h^5, the same global order.
        assert!((4.4..5.6).contains(&inside), "order inside: {inside}");
    }
}
