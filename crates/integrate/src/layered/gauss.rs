//! Gauss collocation with eight stages: order 16 at the end of a step (Kuntzmann 1961; Butcher
//! 1964; Hairer, Norsett & Wanner 1993, sec. II.7), and the polynomial of degree 8 in between.

use std::sync::OnceLock;

use twofold_num::elementary::cos;

/// Stages.
pub(super) const STAGES: usize = 8;

/// Ratio of the integral's error between the stages to the last Legendre coefficients: the next
/// coefficient, some six times smaller, times the integral of its polynomial, at most 1.5/(2 k +
/// 1).
pub(super) const BETWEEN: f64 = 0.25 / (2 * STAGES + 1) as f64;

/// A number for each stage.
pub(super) type Stages = [f64; STAGES];

/// The method's numbers, for steps from -1 to 1.
pub(super) struct Gauss {
    /// Nodes of the stages: zeros of the Legendre polynomial of degree 8.
    pub nodes: Stages,
    /// Integrals from -1 to 1 of the Lagrange polynomials.
    pub weights: Stages,
    /// `integrals[m][j]`: integral from -1 to node j of the Lagrange polynomial of node m.
    pub integrals: [Stages; STAGES],
    /// `legendre[k][m]`: what a value at node m contributes to the Legendre coefficient k of the
    /// polynomial through the values.
    pub legendre: [Stages; STAGES],
    /// Largest absolute value on [-1, 1] of a polynomial whose values at the nodes are at most 1.
    pub lebesgue: f64,
}

/// Legendre's polynomials of degrees 0 to 8 at x, by their recurrence.
fn legendre(x: f64) -> [f64; STAGES + 1] {
    let mut p = [1.0; STAGES + 1];
    p[1] = x;
    for k in 1..STAGES {
        let n = k as f64;
        p[k + 1] = ((2.0 * n + 1.0) * x * p[k] - n * p[k - 1]) / (n + 1.0);
    }
    p
}

impl Gauss {
    /// The method.
    pub fn get() -> &'static Self {
        static GAUSS: OnceLock<Gauss> = OnceLock::new();
        GAUSS.get_or_init(Self::made)
    }

    fn made() -> Self {
        let n = STAGES as f64;
        let slope =
            |x: f64, p: &[f64; STAGES + 1]| n * (x * p[STAGES] - p[STAGES - 1]) / (x * x - 1.0);
        let nodes: Stages = std::array::from_fn(|j| {
            let mut x = -cos(std::f64::consts::PI * (j as f64 + 0.75) / (n + 0.5));
            for _ in 0..10 {
                let p = legendre(x);
                x -= p[STAGES] / slope(x, &p);
            }
            x
        });
        let weights = nodes.map(|x| {
            let d = slope(x, &legendre(x));
            2.0 / ((1.0 - x * x) * d * d)
        });
        // The Lagrange polynomial of node m is the sum over k of (k + 1/2) w_m P_k(x_m) P_k.
        let coefficients: [Stages; STAGES] = std::array::from_fn(|k| {
            std::array::from_fn(|m| (k as f64 + 0.5) * weights[m] * legendre(nodes[m])[k])
        });
        let integrals = std::array::from_fn(|m| {
            nodes.map(|x| {
                let basis = antiderivatives(x);
                (0..STAGES).map(|k| coefficients[k][m] * basis[k]).sum()
            })
        });
        // The largest value is at the ends, where every P_k is 1 (or +-1).
        let at_end = |m: usize| (0..STAGES).map(|k| coefficients[k][m]).sum::<f64>().abs();
        Self {
            nodes,
            weights,
            integrals,
            legendre: coefficients,
            lebesgue: (0..STAGES).map(at_end).sum(),
        }
    }

    /// The Legendre coefficients of the polynomial through the `values` at the nodes.
    pub fn coefficients(&self, values: &Stages) -> Stages {
        self.legendre.map(|row| row.iter().zip(values).map(|(a, b)| a * b).sum())
    }

    /// The last two Legendre coefficients, the larger one's size: how far the values are from a
    /// polynomial of smaller degree.
    pub fn roughness(&self, values: &Stages) -> f64 {
        let [a, b] = [STAGES - 2, STAGES - 1]
            .map(|k| self.legendre[k].iter().zip(values).map(|(a, b)| a * b).sum::<f64>().abs());
        a.max(b)
    }
}

/// Integrals from -1 to x of Legendre's polynomials of degrees 0 to 7.
pub(super) fn antiderivatives(x: f64) -> Stages {
    let p = legendre(x);
    std::array::from_fn(
        |k| if k == 0 { x + 1.0 } else { (p[k + 1] - p[k - 1]) / (2 * k + 1) as f64 },
    )
}

/// The sum of Legendre's polynomials at x.
pub(super) fn sum(coefficients: &Stages, x: f64) -> f64 {
    coefficients.iter().zip(legendre(x)).map(|(c, p)| c * p).sum()
}

/// The integral from -1 to x of that sum.
pub(super) fn integral(coefficients: &Stages, x: f64) -> f64 {
    coefficients.iter().zip(antiderivatives(x)).map(|(c, p)| c * p).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integrates_polynomials_exactly() {
        let gauss = Gauss::get();
        // Degree 15 over the whole interval.
        let whole = |f: fn(f64) -> f64| {
            gauss.nodes.iter().zip(gauss.weights).map(|(x, w)| f(*x) * w).sum::<f64>()
        };
        assert!((whole(|x| x.powi(14)) - 2.0 / 15.0).abs() < 1e-15);
        assert!(whole(|x| x.powi(15)).abs() < 1e-15);
        // Degree 7 to every node: x^7 + x^2.
        let values = gauss.nodes.map(|x| x.powi(7) + x * x);
        let primitive = |x: f64| x.powi(8) / 8.0 + x.powi(3) / 3.0 - 1.0 / 8.0 + 1.0 / 3.0;
        for j in 0..STAGES {
            let found: f64 = (0..STAGES).map(|m| gauss.integrals[m][j] * values[m]).sum();
            assert!((found - primitive(gauss.nodes[j])).abs() < 1e-15, "{j}");
        }
        let coefficients = gauss.coefficients(&values);
        for x in [-1.0, -0.3, 0.7, 1.0] {
            assert!((sum(&coefficients, x) - (x.powi(7) + x * x)).abs() < 1e-14);
            assert!((integral(&coefficients, x) - primitive(x)).abs() < 1e-14);
        }
    }

    #[test]
    fn knows_its_lebesgue_constant() {
        let gauss = Gauss::get();
        let largest = (0..=1000)
            .map(|i| {
                let x = f64::from(i) / 500.0 - 1.0;
                (0..STAGES)
                    .map(|m| {
                        let mut unit = [0.0; STAGES];
                        unit[m] = 1.0;
                        sum(&gauss.coefficients(&unit), x).abs()
                    })
                    .sum::<f64>()
            })
            .fold(0.0, f64::max);
        assert!((largest - gauss.lebesgue).abs() < 1e-12, "{largest} {}", gauss.lebesgue);
    }
}
