//! A method of your own: the classical Runge-Kutta method with a fixed step, as a stepper that
//! everything else can use. Here it makes a Poincaré section beside Dormand-Prince.
//!
//! `cargo run --example own_method`

use nalgebra::{SVector, Vector2};
use twofold::analyse::SectionRecorder;
use twofold::integrate::{
    Dopri5, DriveOptions, Failure, Interpolant, Statistics, Step, Stepper, Tolerance, drive,
};
use twofold::num::Elementary;
use twofold::system::VectorField;

/// Kutta (1901), with cubic Hermite dense output between the ends of a step.
struct ClassicalRungeKutta<const N: usize> {
    h: f64,
    t: f64,
    x: SVector<f64, N>,
    t_end: f64,
    dense: Hermite<N>,
    statistics: Statistics,
}

/// The cubic through both ends of a step with both slopes.
struct Hermite<const N: usize> {
    ends: [SVector<f64, N>; 2],
    /// Slopes times the step.
    slopes: [SVector<f64, N>; 2],
}

impl<const N: usize> Interpolant<N> for Hermite<N> {
    fn at(&self, s: f64) -> SVector<f64, N> {
        let ([a, b], [p, q]) = (self.ends, self.slopes);
        let d = b - a;
        a + (p + ((d - p) + (d * -2.0 + p + q) * (s - 1.0)) * s) * s
    }
    fn degree(&self) -> usize {
        3
    }
}

impl<const N: usize> ClassicalRungeKutta<N> {
    fn new(h: f64) -> Self {
        let zero = SVector::zeros();
        let dense = Hermite { ends: [zero; 2], slopes: [zero; 2] };
        Self {
            h,
            t: 0.0,
            x: zero,
            t_end: 0.0,
            dense,
            statistics: Statistics { highest_order: 4, ..Default::default() },
        }
    }
}

impl<const N: usize> Stepper<N> for ClassicalRungeKutta<N> {
    fn restart<F: VectorField<N>>(
        &mut self,
        _: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        // A fixed step still keeps the promise of a longest one.
        self.h = self.h.min(max_step);
        (self.t, self.x, self.t_end) = (t, x, t_end);
        self.statistics.restarts += 1;
        Ok(())
    }

    fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure> {
        let (t0, x0) = (self.t, self.x);
        // The step that reaches the end ends there exactly.
        let last = t0 + self.h * 1.000_001 >= self.t_end;
        let h = if last { self.t_end - t0 } else { self.h };
        let k1 = field.eval(&x0);
        let k2 = field.eval(&(x0 + k1 * (0.5 * h)));
        let k3 = field.eval(&(x0 + k2 * (0.5 * h)));
        let k4 = field.eval(&(x0 + k3 * h));
        let x1 = x0 + (k1 + (k2 + k3) * 2.0 + k4) * (h / 6.0);
        let end = field.eval(&x1);
        if !x1.iter().chain(end.iter()).all(|v| v.is_finite()) {
            return Err(Failure::NotFinite { t: t0, state: Failure::state(&x0) });
        }
        self.dense = Hermite { ends: [x0, x1], slopes: [k1 * h, end * h] };
        (self.t, self.x) = (if last { self.t_end } else { t0 + h }, x1);
        self.statistics.steps += 1;
        self.statistics.evaluations += 5;
        Ok(Step { t0, t1: self.t, x0, x1, interpolant: &self.dense })
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}

/// A pendulum: (angle, speed).
struct Pendulum;

impl VectorField<2> for Pendulum {
    fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        Vector2::new(x[1], -x[0].sin())
    }
}

/// When the pendulum passes its lowest point.
fn passages<M: Stepper<2>>(mut method: M) -> Result<Vec<f64>, Failure> {
    let mut section = SectionRecorder::<2>::new(0, 0.0);
    let _ = drive(
        &Pendulum,
        Vector2::new(1.0, 0.0),
        &DriveOptions::to(30.0),
        &mut method,
        &mut section,
        &(),
    )?;
    Ok(section.into_crossings().iter().map(|c| c.t).collect())
}

/// Compares the two, passage by passage.
///
/// # Errors
///
/// If either orbit cannot be followed.
pub fn compare() -> Result<Vec<[f64; 2]>, Failure> {
    let ours = passages(ClassicalRungeKutta::new(0.01))?;
    let theirs = passages(Dopri5::new(Tolerance { rtol: 1e-10, atol: 1e-10 }))?;
    Ok(ours.into_iter().zip(theirs).map(|(a, b)| [a, b]).collect())
}

fn main() -> Result<(), Failure> {
    for [ours, theirs] in compare()? {
        println!("passes at t = {ours:.9}, Dormand-Prince says {theirs:.9}");
    }
    Ok(())
}
