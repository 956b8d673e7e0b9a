//! The law of the passage as a theorem (proofs/inner_law.rs), against plain orbits of the inner
//! problem, which know nothing of its proof.
#![allow(clippy::disallowed_methods)] // std functions give expected values

use serde_json::Value;
use twofold::analyse::passage::Predicted;

const V: [f64; 2] = [-1.2, -1.4];

/// The inner problem's constants, from its equations.
struct Inner {
    weak: f64,
    strong: f64,
    phi: f64,
}

impl Inner {
    fn new() -> Self {
        let p = Predicted::of(V[0], V[1]);
        Self { weak: p.weak, strong: p.weak / p.mu, phi: p.phi }
    }

    /// (p', q', s').
    fn slope(&self, [p, q, s]: [f64; 3]) -> [f64; 3] {
        let f = 2.0 * (self.phi + p) * (1.0 - self.phi - p);
        [f * (q - s * p), self.strong * p, self.weak + (V[0] - V[1]) * p]
    }

    fn step(&self, y: [f64; 3], h: f64) -> [f64; 3] {
        let at = |k: [f64; 3], c: f64| -> [f64; 3] { std::array::from_fn(|i| y[i] + c * k[i]) };
        let k1 = self.slope(y);
        let k2 = self.slope(at(k1, 0.5 * h));
        let k3 = self.slope(at(k2, 0.5 * h));
        let k4 = self.slope(at(k3, h));
        std::array::from_fn(|i| y[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
    }

    /// From a state until `done`; the last step is shortened, by secants, until `done`'s function
    /// is zero.
    fn until(&self, mut y: [f64; 3], zero: impl Fn([f64; 3]) -> f64) -> [f64; 3] {
        loop {
            let h = (0.05 / y[2].abs()).min(2e-3);
            let next = self.step(y, h);
            if zero(next) <= 0.0 {
                let (mut low, mut high) = (0.0, h);
                for _ in 0..60 {
                    let middle = 0.5 * (low + high);
                    if zero(self.step(y, middle)) > 0.0 { low = middle } else { high = middle }
                }
                return self.step(y, high);
            }
            y = next;
        }
    }
}

fn certificate() -> Value {
    serde_json::from_str(include_str!("../../proofs/certificates/inner-law.json")).unwrap()
}

fn bounds(v: &Value) -> (f64, f64) {
    (v[0].as_f64().unwrap(), v[1].as_f64().unwrap())
}

#[test]
fn the_polynomial_form_is_the_inner_problem() {
    // u' = -Y phi + Z (1 - phi), Y' = phi + v- (1 - phi), Z' = v+ phi + 1 - phi at any state.
    let inner = Inner::new();
    for (u, y, z) in [(0.3_f64, 1.2, 0.7), (-0.9, -2.0, 0.4), (0.02, 5.0, 6.0)] {
        let phi = 0.5 * (1.0 + u.tanh());
        let (du, dy, dz) = (z - (y + z) * phi, phi + V[1] * (1.0 - phi), V[0] * phi + 1.0 - phi);
        let got = inner.slope([phi - inner.phi, (1.0 - inner.phi) * z - inner.phi * y, y + z]);
        let want = [2.0 * phi * (1.0 - phi) * du, (1.0 - inner.phi) * dz - inner.phi * dy, dy + dz];
        for (g, w) in got.into_iter().zip(want) {
            assert!((g - w).abs() < 1e-14, "{g} {w}");
        }
    }
}

#[test]
fn plain_orbits_keep_the_law() {
    let (inner, data) = (Inner::new(), &certificate()["data"]);
    let number = |name: &str| data[name].as_str().unwrap().parse::<f64>().unwrap();
    let (exit, growth) =
        (bounds(&data["exit"]), [bounds(&data["growth"][0]), bounds(&data["growth"][1])]);
    let (f, inverse_mu, p2) = (bounds(&data["f"]).0, bounds(&data["mu_inverse"]).0, number("p2"));
    assert!((inverse_mu - inner.strong / inner.weak).abs() < 1e-11);
    let mut constants = Vec::new();
    for (s, p) in [(110.0_f64, 0.05_f64), (110.0, -0.05), (220.0, 0.01), (220.0, -1e-4)] {
        assert!(s >= number("least_s"));
        let zero = inner.until([p, p * (s - 2.0 / s), s], |y| y[2]);
        let leave = |from: [f64; 3]| inner.until(from, |y| p2 - y[0].abs());
        let end = leave(zero);
        let x = -end[2];
        let common = (inverse_mu - 1.0) * s.ln() - p.abs().ln();
        let c = f * x * x / 2.0 - inverse_mu * x.ln() - common;
        assert!(exit.0 < c && c < exit.1, "S = {s}, p = {p}: C = {c} not in {exit:?}");
        // The proof says that the side changes.
        assert!(end[0] * p < 0.0, "{end:?}");
        constants.push(c);
        for (j, (low, high)) in growth.into_iter().enumerate() {
            // The state at s = 0 is what a disturbance is small against.
            let d = 1e-4 * zero[1];
            let moved =
                |d: f64| -leave(std::array::from_fn(|i| zero[i] + if i == j { d } else { 0.0 }))[2];
            let slope = (moved(d) - moved(-d)) / (2.0 * d);
            let k = slope.abs().ln() - common + x.ln();
            assert!(
                low < k && k < high,
                "S = {s}, p = {p}, disturbance {j}: K = {k} not in {low}, {high}"
            );
        }
    }
    // The constant is one, nearly: the intervals are bounds and not spread.
    let (least, most) =
        constants.iter().fold((f64::MAX, f64::MIN), |(a, b), c| (a.min(*c), b.max(*c)));
    println!("C from {least} to {most}");
    assert!(most - least < 0.25, "{constants:?}");
}
