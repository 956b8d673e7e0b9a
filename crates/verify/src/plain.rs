//! A plain orbit, followed without any claim to rigour: it tells an enclosure of another orbit, or of nothing, from one that may be right.
//!
//! Everything is written here once more, the equation and the hyperbolic tangent too: what the prover has wrong must not be wrong here.

/// The caricature's equation with tanh smoothing, in plain numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Equation {
    pub alpha: f64,
    pub beta: f64,
    pub eps: f64,
    pub v_plus: f64,
    pub v_minus: f64,
}

/// exp for arguments from -40 to 0: the series of a 64th, squared six times.
fn exponential(x: f64) -> f64 {
    let r = x / 64.0;
    let (mut term, mut sum) = (1.0, 1.0);
    for n in 1..18 {
        term *= r / f64::from(n);
        sum += term;
    }
    (0..6).fold(sum, |s, _| s * s)
}

fn hyperbolic_tangent(x: f64) -> f64 {
    if x.abs() > 19.5 {
        return x.signum();
    }
    let e = exponential(-2.0 * x.abs());
    x.signum() * (1.0 - e) / (1.0 + e)
}

/// Most steps of an orbit, many times what any of the theorems' takes: a certificate may claim one so far away that steps no longer bring it on.
const MOST_STEPS: u32 = 1_000_000;

impl Equation {
    fn at(&self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        let r2 = x * x + y * y + z * z;
        let (dy, dz) = ((self.alpha - self.beta * y) * r2, (self.alpha - self.beta * z) * r2);
        let phi = 0.5 * (1.0 + hyperbolic_tangent(x / self.eps));
        [z - (y + z) * phi, self.v_minus + dy + (1.0 - self.v_minus) * phi, 1.0 + dz + (self.v_plus - 1.0) * phi]
    }

    /// One step of the classical Runge-Kutta method.
    fn step(&self, s: [f64; 3], h: f64) -> [f64; 3] {
        let moved = |k: [f64; 3], c: f64| -> [f64; 3] { std::array::from_fn(|i| s[i] + c * k[i]) };
        let k1 = self.at(s);
        let k2 = self.at(moved(k1, 0.5 * h));
        let k3 = self.at(moved(k2, 0.5 * h));
        let k4 = self.at(moved(k3, h));
        std::array::from_fn(|i| s[i] + h / 6.0 * (k1[i] + 2.0 * (k2[i] + k3[i]) + k4[i]))
    }

    /// The first `count` crossings (t, x, z) of y = 0 by the orbit from (x, 0, z); fewer if they take longer than 100, or too many steps.
    pub fn crossings(&self, x: f64, z: f64, count: usize) -> Vec<[f64; 3]> {
        let (mut s, mut t, mut steps) = ([x, 0.0, z], 0.0, 0);
        let mut found = Vec::new();
        while found.len() < count && t < 100.0 && steps < MOST_STEPS {
            steps += 1;
            // Outside the layer the field is a polynomial; inside, a step moves x by a fiftieth of eps.
            let outside = (s[0].abs() - 15.0 * self.eps).max(0.0);
            let mut h = ((0.02 * self.eps).max(0.3 * outside) / self.at(s)[0].abs().max(1e-9)).min(0.002);
            let mut next = self.step(s, h);
            if t > 0.0 && (s[1] < 0.0) != (next[1] < 0.0) {
                for _ in 0..5 {
                    h -= next[1] / self.at(next)[1];
                    next = self.step(s, h);
                }
                found.push([t + h, next[0], next[2]]);
                h += 1e-9;
                next = self.step(s, h);
            }
            (s, t) = (next, t + h);
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wherever a certificate says that it starts, and whatever the equation.
    #[test]
    fn no_orbit_takes_for_ever() {
        let theirs = Equation { alpha: 0.1, beta: 1e-5, eps: 1e-3, v_plus: -1.2, v_minus: -1.4 };
        assert_eq!(theirs.crossings(0.2, -1.0, 4).len(), 4);
        for far in [1e3, 1e9, -1e9, 1e200, f64::NAN] {
            assert!(
                theirs.crossings(far, 1.0, 1000).len() < 1000 && theirs.crossings(0.2, far, 1000).len() < 1000,
                "{far}"
            );
        }
        for eps in [1e-9, 1e-300, f64::NAN] {
            assert!(Equation { eps, ..theirs }.crossings(0.2, -1.0, 1000).len() < 1000, "{eps}");
        }
    }

    #[test]
    fn tanh_is_tanh() {
        for k in -400..=400 {
            let x = f64::from(k) * 0.05;
            assert!((hyperbolic_tangent(x) - x.tanh()).abs() < 1e-14, "{x}");
        }
    }
}
