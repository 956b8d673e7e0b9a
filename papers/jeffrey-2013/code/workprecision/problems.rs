//! The test problems of the work-precision picture and of tests/it/odepack.rs: the same equations,
//! starts and ends as in scripts/odepack_reference.py.

use nalgebra::{SVector, Vector2, Vector3};
use twofold::num::Elementary;
use twofold::system::{
    BoundField, Caricature, Field, Hysteretic, Relaxation, Smoothed, Transition, VectorField,
};

/// An initial value problem with a name.
pub struct Problem<const N: usize> {
    /// Its name in workprecision/odepack/reference.json.
    pub name: &'static str,
    /// The equation, recorded: the same bits, and no method is compiled for it alone.
    pub field: BoundField<N>,
    /// The start, at t = 0.
    pub start: SVector<f64, N>,
}

/// Something to be done with every problem, whatever its dimension.
pub trait Visit {
    /// Does it with one.
    fn visit<const N: usize>(&mut self, problem: &Problem<N>);
}

/// Robertson (1966): three reactions with rates 0.04, 3e7, 1e4. Its components sum to 1 for ever.
pub struct Robertson;

impl VectorField<3> for Robertson {
    fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        let [a, b, c] = [x[0], x[1], x[2]];
        let slow = a.scale(0.04);
        let back = b.scale(1e4) * c;
        let fast = b.scale(3e7) * b;
        Vector3::new(back - slow, slow - back - fast, fast)
    }
}

/// Van der Pol (1926): x'' = mu (1 - x^2) x' - x.
pub struct VanDerPol {
    /// Strength of the damping.
    pub mu: f64,
}

impl VectorField<2> for VanDerPol {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        Vector2::new(x[1], (S::one() - x[0] * x[0]).scale(self.mu) * x[1] - x[0])
    }
}

/// The Oregonator of Field & Noyes (1974), scaled as in Hairer & Wanner (1996), eq. (IV.10.15).
pub struct Oregonator;

impl VectorField<3> for Oregonator {
    fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        let [a, b, c] = [x[0], x[1], x[2]];
        Vector3::new(
            (b + a * (S::one() - a.scale(8.375e-6) - b)).scale(77.27),
            (c - (S::one() + a) * b) / S::from_f64(77.27),
            (a - c).scale(0.161),
        )
    }
}

/// HIRES, "high irradiance response": Schafer (1975), as in Hairer & Wanner (1996), sec. IV.10.
pub struct Hires;

impl VectorField<8> for Hires {
    fn eval<S: Elementary>(&self, y: &SVector<S, 8>) -> SVector<S, 8> {
        let r = y[5].scale(280.0) * y[7];
        SVector::from([
            y[1].scale(0.43) - y[0].scale(1.71) + y[2].scale(8.32) + S::from_f64(0.0007),
            y[0].scale(1.71) - y[1].scale(8.75),
            y[3].scale(0.43) - y[2].scale(10.03) + y[4].scale(0.035),
            y[1].scale(8.32) + y[2].scale(1.71) - y[3].scale(1.12),
            y[5].scale(0.43) + y[6].scale(0.43) - y[4].scale(1.745),
            y[3].scale(0.69) + y[4].scale(1.71) - y[5].scale(0.43) + y[6].scale(0.69) - r,
            r - y[6].scale(1.81),
            y[6].scale(1.81) - r,
        ])
    }
}

/// Lorenz (1963) with sigma = 10, rho = 28, beta = 8/3.
pub struct Lorenz;

impl VectorField<3> for Lorenz {
    fn eval<S: Elementary>(&self, x: &SVector<S, 3>) -> SVector<S, 3> {
        Vector3::new(
            (x[1] - x[0]).scale(10.0),
            x[0] * (S::from_f64(28.0) - x[2]) - x[1],
            x[0] * x[1] - x[2].scale(8.0 / 3.0),
        )
    }
}

/// alpha of the two readings of the caricature's parameters.
const READINGS: [(&str, &str, f64); 2] = [
    ("smoothed-printed", "hysteretic-printed", 1e-3),
    ("smoothed-reconstructed", "hysteretic-reconstructed", 1e-1),
];

/// The smoothed caricature, eq. (8), with beta = 1e-5 and eps = 1e-3.
pub fn smoothed(alpha: f64) -> Smoothed<Caricature> {
    Smoothed {
        system: Caricature::with_reinjection(alpha, 1e-5),
        transition: Transition::Tanh,
        eps: 1e-3,
    }
}

/// The hysteretic caricature, eq. (10) read literally, with beta = 1e-5, eps = 1e-3 and eps' =
/// 1e-2.
pub fn hysteretic(alpha: f64) -> Hysteretic<Caricature> {
    Hysteretic {
        system: Caricature::with_reinjection(alpha, 1e-5),
        eps: 1e-3,
        eps_prime: 1e-2,
        relaxation: Relaxation::Literal,
    }
}

/// A problem whose equation exists as Rust.
fn problem<const N: usize>(
    name: &'static str,
    field: &impl VectorField<N>,
    start: [f64; N],
) -> Problem<N> {
    const NAMES: [&str; 8] = ["a", "b", "c", "d", "e", "f", "g", "h"];
    let field = Field::record(std::array::from_fn(|i| NAMES[i]), field);
    Problem {
        name,
        field: field.bind().expect("as many states as it was recorded with"),
        start: start.into(),
    }
}

/// Shows every problem to `visitor`.
pub fn for_each(visitor: &mut impl Visit) {
    visitor.visit(&problem("robertson", &Robertson, [1.0, 0.0, 0.0]));
    visitor.visit(&problem("van-der-pol-1", &VanDerPol { mu: 1.0 }, [2.0, 0.0]));
    visitor.visit(&problem("van-der-pol-1000", &VanDerPol { mu: 1000.0 }, [2.0, 0.0]));
    visitor.visit(&problem("oregonator", &Oregonator, [1.0, 2.0, 3.0]));
    visitor.visit(&problem("hires", &Hires, [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0057]));
    visitor.visit(&problem("lorenz", &Lorenz, [1.0, 1.0, 1.0]));
    for (name, _, alpha) in READINGS {
        visitor.visit(&problem(name, &smoothed(alpha), [0.2, 0.0, -1.0]));
    }
    for (_, name, alpha) in READINGS {
        visitor.visit(&problem(name, &hysteretic(alpha), [0.2, 0.0, -1.0, 1.0]));
    }
}
