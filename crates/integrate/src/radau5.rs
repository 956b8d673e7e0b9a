//! Radau IIA of order 5: the implicit Runge-Kutta method of Hairer & Wanner, Solving ODEs II (2nd
//! ed. 1996), secs IV.5 and IV.8. L-stable, three stages, collocation. An independent witness for
//! what the multistep methods find on the stiff systems.
//!
//! Its error estimate is of order 3, so the true error at a given tolerance is smaller than with a
//! method that estimates the error of the solution it goes on with. Tolerances are taken literally;
//! Hairer & Wanner's own program replaces rtol by 0.1 rtol^(2/3) to compensate.

use nalgebra::{Complex, Const, Matrix3, SMatrix, SVector, Vector3};

use super::guard::Redoable;
use super::linear::Lu;
use super::starting_step::starting_step;
use super::step::{
    Driven, DrivenStepper, Failure, Interpolant, Statistics, Steady, Step, Stepper, Tolerance,
    finite, is_last,
};
use twofold_num::elementary::{rough_pow, sqrt};
use twofold_system::VectorField;

/// The method's numbers, each from its definition.
#[derive(Clone, Debug)]
struct Tableau {
    /// Collocation points: the zeros of d^2/dx^2 [x^2 (x - 1)^3].
    c: [f64; 3],
    /// The real eigenvalue of A^-1.
    real: f64,
    /// One of its pair of complex eigenvalues.
    complex: Complex<f64>,
    /// Their eigenvectors (columns of T in eq. IV.8.12).
    v_real: [f64; 3],
    v_complex: [Complex<f64>; 3],
    /// The matching rows of T^-1.
    l_real: [f64; 3],
    l_complex: [Complex<f64>; 3],
    /// Weights of the stages in the error estimate, eq. (IV.8.17), times the real eigenvalue.
    error: [f64; 3],
    /// From stage values to the collocation polynomial's coefficients of theta, theta^2, theta^3.
    polynomial: [[f64; 3]; 3],
}

impl Tableau {
    fn new() -> Self {
        let r = sqrt(6.0);
        let c = [(4.0 - r) / 10.0, (4.0 + r) / 10.0, 1.0];
        // Hairer & Wanner (1996), table IV.5.6, but for its last row: two are what an eigenvector
        // takes.
        let a = [
            [(88.0 - 7.0 * r) / 360.0, (296.0 - 169.0 * r) / 1800.0, (-2.0 + 3.0 * r) / 225.0],
            [(296.0 + 169.0 * r) / 1800.0, (88.0 + 7.0 * r) / 360.0, (-2.0 - 3.0 * r) / 225.0],
        ];
        // det(z - A^-1): the denominator of the stability function, the (2, 3)-Pade approximation
        // of exp.
        let mut real = 3.6;
        for _ in 0..8 {
            let p = ((real - 9.0) * real + 36.0) * real - 60.0;
            real -= p / ((3.0 * real - 18.0) * real + 36.0);
        }
        let half = 0.5 * (9.0 - real);
        let complex = Complex::new(half, sqrt(60.0 / real - half * half));

        // An eigenvector is orthogonal to the rows of A - 1/lambda: their cross product, scaled to
        // end in 1.
        let eigenvector = |lambda: Complex<f64>| {
            let row = |i: usize| {
                Vector3::from_fn(|j, _| {
                    Complex::new(a[i][j], 0.0) - if i == j { lambda.inv() } else { Complex::ZERO }
                })
            };
            let v = row(0).cross(&row(1));
            [v[0] / v[2], v[1] / v[2], Complex::new(1.0, 0.0)]
        };
        let v_real = eigenvector(Complex::new(real, 0.0));
        let v_complex = eigenvector(complex);
        let t = Matrix3::from_fn(|i, j| match j {
            0 => v_real[i],
            1 => v_complex[i],
            _ => v_complex[i].conj(),
        });
        let columns = inverse(t);
        let vandermonde = Matrix3::from_fn(|i, j| [c[i], c[i] * c[i], c[i] * c[i] * c[i]][j]);
        let polynomial = inverse(vandermonde);
        Self {
            c,
            real,
            complex,
            v_real: v_real.map(|z| z.re),
            v_complex,
            l_real: [0, 1, 2].map(|j| columns[(0, j)].re),
            l_complex: [0, 1, 2].map(|j| columns[(1, j)]),
            error: [-(13.0 + 7.0 * r) / 3.0, (-13.0 + 7.0 * r) / 3.0, -1.0 / 3.0],
            polynomial: [0, 1, 2].map(|i| [0, 1, 2].map(|j| polynomial[(i, j)])),
        }
    }
}

fn inverse<T: nalgebra::ComplexField<RealField = f64> + Copy>(m: Matrix3<T>) -> Matrix3<T> {
    let lu = Lu::new(m).expect("the method's own matrices are regular");
    let unit = |j: usize| Vector3::from_fn(|i, _| if i == j { T::one() } else { T::zero() });
    Matrix3::from_columns(&[0, 1, 2].map(|j| lu.solve(unit(j))))
}

/// Step control and Newton iteration, Hairer & Wanner (1996), sec. IV.8.
mod control {
    pub const SAFETY: f64 = 0.9;
    /// Least factor by which h changes.
    pub const SHRINK: f64 = 0.2;
    /// Largest factor by which h changes.
    pub const GROW: f64 = 8.0;
    /// Newton iterations.
    pub const MOST_ITERATIONS: u32 = 7;
    /// A Jacobian with which the iteration converges at this rate or faster is kept.
    pub const KEEP_JACOBIAN: f64 = 1e-3;
    /// A growth up to this is not worth a new factorisation.
    pub const KEEP_STEP: f64 = 1.2;
    /// Failed attempts at one step before it is given up.
    pub const MOST_FAILURES: u32 = 60;
}

/// The two factorised matrices real/h - J and complex/h - J.
#[derive(Clone, Debug)]
struct Matrices<const N: usize> {
    real: Lu<f64, Const<N>>,
    complex: Lu<Complex<f64>, Const<N>>,
}

/// The collocation polynomial of one step: x0 + theta (p1 + theta (p2 + theta p3)).
#[derive(Clone, Debug)]
struct Collocation<const N: usize> {
    x0: SVector<f64, N>,
    p: [SVector<f64, N>; 3],
    /// The step's length.
    h: f64,
}

impl<const N: usize> Interpolant<N> for Collocation<N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        let [p1, p2, p3] = &self.p;
        self.x0 + (p1 + (p2 + p3 * theta) * theta) * theta
    }
    fn coordinate(&self, theta: f64, i: usize) -> f64 {
        let [p1, p2, p3] = self.p.each_ref().map(|p| p[i]);
        self.x0[i] + (p1 + (p2 + p3 * theta) * theta) * theta
    }
    fn degree(&self) -> usize {
        3
    }
    fn bernstein(&self) -> Option<[SVector<f64, N>; 5]> {
        let [p1, p2, p3] = &self.p;
        // theta^k has the coefficients C(i, k)/C(4, k).
        let at = |a: f64, b: f64, c: f64| p1 * a + p2 * b + p3 * c;
        Some([
            SVector::zeros(),
            at(0.25, 0.0, 0.0),
            at(0.5, 1.0 / 6.0, 0.0),
            at(0.75, 0.5, 0.25),
            at(1.0, 1.0, 1.0),
        ])
    }
    /// The polynomial's distance from its start, term by term.
    fn reach(&self, coordinate: usize) -> f64 {
        self.p.iter().map(|p| p[coordinate].abs()).sum()
    }
    /// theta - theta^2 is at most 1/4, theta - theta^3 at most 2/sqrt(27).
    fn bend(&self, coordinate: usize) -> f64 {
        0.25 * self.p[1][coordinate].abs() + 0.385 * self.p[2][coordinate].abs()
    }
}

/// The Radau IIA stepper.
#[derive(Clone, Debug)]
pub struct Radau5<const N: usize> {
    tolerance: Tolerance,
    statistics: Statistics,
    tableau: Tableau,
    t: f64,
    x: SVector<f64, N>,
    /// f(x).
    derivative: SVector<f64, N>,
    t_end: f64,
    max_step: f64,
    /// Step to try next.
    h: f64,
    jacobian: SMatrix<f64, N, N>,
    /// The Jacobian is that of the present x.
    jacobian_is_new: bool,
    renew_jacobian: bool,
    /// Kept factorisations, and the step they were made for.
    matrices: Option<(f64, Matrices<N>)>,
    /// Step and error of the last accepted step, for the predictive controller; `None` at the
    /// start.
    last: Option<(f64, f64)>,
    rejected_before: bool,
    /// theta/(1 - theta) of the last Newton iteration.
    eta: f64,
    dense: Option<Collocation<N>>,
}

/// A solved stage system.
struct Solved<const N: usize> {
    z: [SVector<f64, N>; 3],
    iterations: u32,
    /// Observed rate of convergence.
    rate: f64,
}

impl<const N: usize> Radau5<N> {
    /// A stepper with the given tolerances.
    pub fn new(tolerance: Tolerance) -> Self {
        Self {
            tolerance,
            statistics: Statistics::default(),
            tableau: Tableau::new(),
            t: 0.0,
            x: SVector::zeros(),
            derivative: SVector::zeros(),
            t_end: 0.0,
            max_step: f64::INFINITY,
            h: 0.0,
            jacobian: SMatrix::zeros(),
            jacobian_is_new: false,
            renew_jacobian: true,
            matrices: None,
            last: None,
            rejected_before: false,
            eta: 1.0,
            dense: None,
        }
    }

    /// 1 / (atol + rtol |x_i|).
    fn weights(&self) -> SVector<f64, N> {
        let Tolerance { rtol, atol } = self.tolerance;
        self.x.map(|x| 1.0 / (atol + rtol * x.abs()))
    }

    /// A first step size, for an error estimate of order 3.
    fn first_step(&mut self, field: &dyn Driven<N>) -> f64 {
        let (t, weights) = (self.t, self.weights());
        let longest = self.max_step.min(self.t_end - t);
        let norm = |v: &SVector<f64, N>| norm(v, &weights);
        let h =
            starting_step(&self.x, &self.derivative, &norm, 0.25, longest, &|y| field.eval(t, y));
        self.statistics.evaluations += 1;
        h
    }

    /// Factorises for the step `h`, unless that is done already. `None`: singular.
    fn factorise(&mut self, h: f64) -> Option<()> {
        if matches!(&self.matrices, Some((made_for, _)) if *made_for == h) {
            return Some(());
        }
        self.statistics.factorisations += 1;
        let shifted = |shift: Complex<f64>| {
            SMatrix::<Complex<f64>, N, N>::from_fn(|i, j| {
                let entry = Complex::new(-self.jacobian[(i, j)], 0.0);
                if i == j { entry + shift } else { entry }
            })
        };
        let real = Lu::new(SMatrix::identity() * (self.tableau.real / h) - self.jacobian)?;
        let complex = Lu::new(shifted(self.tableau.complex / h))?;
        self.matrices = Some((h, Matrices { real, complex }));
        Some(())
    }

    /// Solves Z = h A F(x + Z) by simplified Newton iteration in the coordinates that split A^-1
    /// (eq. IV.8.12-13).
    fn solve<D: Driven<N> + ?Sized>(
        &mut self,
        field: &D,
        h: f64,
        weights: &SVector<f64, N>,
    ) -> Option<Solved<N>> {
        self.factorise(h)?;
        let (_, matrices) = self.matrices.as_ref()?;
        let t = &self.tableau;
        // Start: the last step's polynomial, continued (sec. IV.8, "Starting values").
        let mut z = match &self.dense {
            Some(last) => {
                let at = |c: f64| last.at(1.0 + c * h / last.h) - self.x;
                [at(t.c[0]), at(t.c[1]), at(t.c[2])]
            }
            None => [SVector::zeros(); 3],
        };
        let mut w_real = combine(&z, &t.l_real);
        let mut w_complex = combine_complex(&z, &t.l_complex);
        let times = t.c.map(|c| self.t + c * h);
        let rtol = self.tolerance.rtol.max(1e-14);
        let kappa = (10.0 * f64::EPSILON / rtol).max(sqrt(rtol).min(0.03));
        let mut eta = rough_pow(self.eta.max(f64::EPSILON), 0.8);
        let mut rate = 0.0;
        let mut size_before = 0.0;
        for iteration in 1..=control::MOST_ITERATIONS {
            let [z1, z2, z3] = &z;
            let at = |s: usize, z: &SVector<f64, N>| field.eval(times[s], &(self.x + z));
            let f = [at(0, z1), at(1, z2), at(2, z3)];
            self.statistics.evaluations += 3;
            let right_real = combine(&f, &t.l_real) - w_real * (t.real / h);
            let delta_real = matrices.real.solve(right_real);
            let f_complex = combine_complex(&f, &t.l_complex);
            let shift = t.complex / h;
            let right_complex = SVector::from_fn(|i, _| f_complex[i] - w_complex[i] * shift);
            let delta_complex = matrices.complex.solve(right_complex);
            let expand = |real: &SVector<f64, N>, complex: &SVector<Complex<f64>, N>| {
                let stage = |s: usize| {
                    SVector::<f64, N>::from_fn(|i, _| {
                        t.v_real[s] * real[i]
                            + 2.0
                                * (t.v_complex[s].re * complex[i].re
                                    - t.v_complex[s].im * complex[i].im)
                    })
                };
                [stage(0), stage(1), stage(2)]
            };
            let delta = expand(&delta_real, &delta_complex);
            let mut sum = 0.0;
            for d in &delta {
                let n = norm(d, weights);
                sum += n * n;
            }
            let size = sqrt(sum / 3.0);
            if !size.is_finite() {
                return None;
            }
            if iteration > 1 {
                rate = size / size_before;
                if rate >= 0.99 {
                    return None;
                }
                eta = rate / (1.0 - rate);
                let left = control::MOST_ITERATIONS - iteration;
                if (0..left).fold(eta * size, |expected, _| expected * rate) > kappa {
                    return None;
                }
            }
            w_real += delta_real;
            w_complex += delta_complex;
            z = expand(&w_real, &w_complex);
            if eta * size <= kappa || size == 0.0 {
                self.eta = eta;
                return Some(Solved { z, iterations: iteration, rate });
            }
            size_before = size;
        }
        None
    }

    /// [`Stepper::step`].
    fn advance<D: Driven<N> + ?Sized>(&mut self, field: &D) -> Result<Step<'_, N>, Failure> {
        let (t0, x0) = (self.t, self.x);
        let weights = self.weights();
        let mut failures = 0;
        loop {
            if failures > control::MOST_FAILURES {
                return Err(Failure::NotConverged { t: t0, h: self.h, state: Failure::state(&x0) });
            }
            let remaining = self.t_end - t0;
            // Reach the end exactly; do not leave a remainder too small to step over.
            let last = is_last(t0, self.h, self.t_end, 1.000_1);
            let h = if last { remaining } else { self.h };
            if h.abs() <= t0.abs() * f64::EPSILON || h < f64::MIN_POSITIVE {
                return Err(Failure::StepUnderflow { t: t0, h, state: Failure::state(&x0) });
            }
            if self.renew_jacobian {
                self.jacobian = field.jacobian(t0, &x0);
                self.statistics.jacobians += 1;
                self.jacobian_is_new = true;
                self.renew_jacobian = false;
                self.matrices = None;
            }
            let Some(solved) = self.solve(field, h, &weights) else {
                self.statistics.convergence_failures += 1;
                failures += 1;
                // An old Jacobian may be to blame: renew it at this step first, else the step is
                // too long.
                if self.jacobian_is_new {
                    self.h = h * 0.5;
                } else {
                    self.renew_jacobian = true;
                    self.h = h;
                }
                self.eta = 1.0;
                continue;
            };
            let x1 = x0 + solved.z[2];
            let combined = combine(&solved.z, &self.tableau.error) / h;
            let Some((_, matrices)) = &self.matrices else { continue };
            let mut e = matrices.real.solve(self.derivative + combined);
            let mut error = norm(&e, &weights);
            if error >= 1.0 && (self.last.is_none() || self.rejected_before) {
                // Eq. (IV.8.20): at a start or after a rejection the estimate may be far too large
                // for stiff components.
                let f = field.eval(t0, &(x0 + e));
                self.statistics.evaluations += 1;
                e = matrices.real.solve(f + combined);
                error = norm(&e, &weights);
            }
            if !error.is_finite() || !finite(&x1) {
                self.statistics.rejected += 1;
                failures += 1;
                self.h = h * 0.1;
                if self.h <= t0.abs() * f64::EPSILON || self.h < 1e-300 {
                    return Err(Failure::NotFinite { t: t0, state: Failure::state(&x0) });
                }
                continue;
            }
            let error = error.max(1e-10);
            let most = control::MOST_ITERATIONS as f64;
            let safety =
                control::SAFETY * (2.0 * most + 1.0) / (2.0 * most + solved.iterations as f64);
            let mut factor = safety / sqrt(sqrt(error));
            if error > 1.0 {
                self.statistics.rejected += 1;
                failures += 1;
                self.rejected_before = true;
                self.h =
                    h * if self.last.is_none() { 0.1 } else { factor.clamp(control::SHRINK, 1.0) };
                self.renew_jacobian = !self.jacobian_is_new;
                continue;
            }
            let t1 = if last { self.t_end } else { t0 + h };
            let derivative = field.eval(t1, &x1);
            self.statistics.evaluations += 1;
            if !finite(&derivative) {
                return Err(Failure::NotFinite { t: t0, state: Failure::state(&x0) });
            }
            if let Some((h_before, error_before)) = self.last {
                // Gustafsson (1994), eq. (IV.8.25): predict from the trend of the last two steps.
                let trend = sqrt(sqrt(error_before / error)) * h / h_before;
                factor = factor.min(factor * trend);
            }
            let mut factor = factor.clamp(control::SHRINK, control::GROW);
            if self.rejected_before {
                factor = factor.min(1.0);
            }
            self.last = Some((h, error.max(1e-2)));
            self.rejected_before = false;
            self.renew_jacobian = solved.rate > control::KEEP_JACOBIAN;
            self.jacobian_is_new = false;
            // Keep the step, and with it the factorisations, if little is to be gained.
            self.h = if !self.renew_jacobian && (1.0..=control::KEEP_STEP).contains(&factor) {
                h
            } else {
                (h * factor).min(self.max_step)
            };
            let [first, second, third] = &self.tableau.polynomial;
            let p =
                [combine(&solved.z, first), combine(&solved.z, second), combine(&solved.z, third)];
            self.t = t1;
            self.x = x1;
            self.derivative = derivative;
            self.statistics.steps += 1;
            self.statistics.stiff_steps += 1;
            let dense = self.dense.insert(Collocation { x0, p, h });
            return Ok(Step { t0, t1: self.t, x0, x1, interpolant: dense });
        }
    }
}

/// Root mean square of v_i w_i.
fn norm<const N: usize>(v: &SVector<f64, N>, weights: &SVector<f64, N>) -> f64 {
    let mut sum = 0.0;
    for i in 0..N {
        let q = v[i] * weights[i];
        sum += q * q;
    }
    sqrt(sum / N as f64)
}

fn combine<const N: usize>(z: &[SVector<f64, N>; 3], row: &[f64; 3]) -> SVector<f64, N> {
    z[0] * row[0] + z[1] * row[1] + z[2] * row[2]
}

fn combine_complex<const N: usize>(
    z: &[SVector<f64, N>; 3],
    row: &[Complex<f64>; 3],
) -> SVector<Complex<f64>, N> {
    let re = combine(z, &row.map(|c| c.re));
    let im = combine(z, &row.map(|c| c.im));
    SVector::from_fn(|i, _| Complex::new(re[i], im[i]))
}

impl<const N: usize> Stepper<N> for Radau5<N> {
    fn restart<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        self.restart_driven(&Steady(field), t, x, t_end, max_step)
    }

    fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure> {
        if F::INTERPRETED { self.step_driven(&Steady(field)) } else { self.advance(&Steady(field)) }
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}

impl<const N: usize> DrivenStepper<N> for Radau5<N> {
    fn restart_driven(
        &mut self,
        field: &dyn Driven<N>,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        self.t = t;
        self.x = x;
        self.t_end = t_end;
        self.max_step = max_step;
        self.derivative = field.eval(t, &x);
        self.statistics.evaluations += 1;
        self.statistics.restarts += 1;
        self.statistics.highest_order = 5;
        self.jacobian_is_new = false;
        self.renew_jacobian = true;
        self.matrices = None;
        self.last = None;
        self.rejected_before = false;
        self.eta = 1.0;
        self.dense = None;
        if !finite(&x) || !finite(&self.derivative) {
            return Err(Failure::NotFinite { t, state: Failure::state(&x) });
        }
        self.h = self.first_step(field).min(max_step);
        if t + self.h == t {
            // The shortest step that advances the time: the error test then decides.
            self.h = (2.0 * f64::EPSILON * t.abs()).min(max_step);
        }
        Ok(())
    }

    fn step_driven(&mut self, field: &dyn Driven<N>) -> Result<Step<'_, N>, Failure> {
        self.advance(field)
    }
}

impl<const N: usize> Redoable<N> for Radau5<N> {
    fn last(&self) -> &dyn Interpolant<N> {
        self.dense.as_ref().expect("a step was made")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::Elementary;

    /// The numbers that Hairer & Wanner (1996), sec. IV.8, print.
    #[test]
    fn eigenvalues_by_the_book() {
        let t = Tableau::new();
        assert!((t.real - 3.637_834_252_744_496).abs() < 1e-14);
        assert!((t.complex.re - 2.681_082_873_627_752).abs() < 1e-14);
        assert!((t.complex.im - 3.050_430_199_247_410_5).abs() < 1e-14);
        assert!((t.v_real[0] - 0.094_438_762_488_975_24).abs() < 1e-14, "{:?}", t.v_real);
        assert!((t.v_real[1] - 0.250_213_122_965_333_3).abs() < 1e-14, "{:?}", t.v_real);
    }

    /// The polynomial goes through the stages.
    #[test]
    fn collocation_interpolates() {
        let t = Tableau::new();
        let z = [0.3, -0.7, 1.1].map(|v| SVector::from([v]));
        let p = t.polynomial.map(|row| combine(&z, &row));
        let dense = Collocation { x0: SVector::from([2.0]), p, h: 1.0 };
        for (c, z) in t.c.iter().zip(z) {
            assert!(((dense.at(*c) - z)[0] - 2.0).abs() < 1e-14);
        }
    }

    /// x' = -x^2, x = 1/(1 + t).
    struct Hyperbola;
    impl VectorField<1> for Hyperbola {
        fn eval<S: Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
            SVector::from([-x[0].squared()])
        }
    }

    /// The circle, on which energy is conserved and every derivative is known.
    struct Circle;
    impl VectorField<2> for Circle {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            SVector::from([-x[1], x[0]])
        }
    }

    /// Prothero & Robinson (1974): x' = -lambda (x - cos t) - sin t, with t as a state.
    struct ProtheroRobinson(f64);
    impl VectorField<2> for ProtheroRobinson {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            SVector::from([(x[1].cos() - x[0]).scale(self.0) - x[1].sin(), S::one()])
        }
    }

    /// x' = 1.
    struct Clock;
    impl VectorField<1> for Clock {
        fn eval<S: Elementary>(&self, _: &SVector<S, 1>) -> SVector<S, 1> {
            SVector::from([S::one()])
        }
    }

    /// Less than a ten thousandth of a step is not left for a step of its own; more is.
    #[test]
    fn small_remainders_belong_to_the_last_step() {
        let steps = |t_end: f64| {
            let mut radau = Radau5::new(Tolerance { rtol: 1e-8, atol: 1e-8 });
            radau.restart(&Clock, 0.0, [0.0].into(), t_end, 1.0).unwrap();
            radau.h = 1.0;
            let steps =
                std::iter::from_fn(|| (radau.t < t_end).then(|| radau.step(&Clock).unwrap().t1))
                    .collect::<Vec<_>>();
            assert_eq!(steps.last(), Some(&t_end));
            steps.len()
        };
        assert_eq!([2.9999, 3.0, 3.000_05, 3.0002].map(steps), [3, 3, 3, 4]);
    }

    /// `n` equal steps over [0, t_end], the stages solved to a hundredth of `resolution`, no step
    /// control.
    fn equal_steps<F: VectorField<N>, const N: usize>(
        field: &F,
        x: SVector<f64, N>,
        t_end: f64,
        n: u32,
        resolution: f64,
        mut see: impl FnMut(&Step<'_, N>),
    ) {
        let mut radau = Radau5::new(Tolerance { rtol: 1e-13, atol: 1e-13 });
        radau.restart(field, 0.0, x, t_end, f64::INFINITY).unwrap();
        let h = t_end / f64::from(n);
        let weights = SVector::repeat(resolution.recip());
        for k in 0..n {
            radau.jacobian = twofold_system::jacobian(field, &radau.x);
            radau.matrices = None;
            radau.dense = None;
            radau.eta = 1.0;
            let solved = radau.solve(&Steady(field), h, &weights).expect("converges");
            let p = radau.tableau.polynomial.map(|row| combine(&solved.z, &row));
            let dense = Collocation { x0: radau.x, p, h };
            let (t0, t1) = (f64::from(k) * h, f64::from(k + 1) * h);
            let (x0, x1) = (radau.x, radau.x + solved.z[2]);
            see(&Step { t0, t1, x0, x1, interpolant: &dense });
            radau.x = x1;
        }
    }

    #[test]
    fn converges_at_order_five_and_three_between() {
        let errors = |n| {
            let (mut at_steps, mut between) = (0.0_f64, 0.0_f64);
            equal_steps(&Hyperbola, SVector::from([1.0]), 2.0, n, 1e-12, |step| {
                let error = |theta: f64| (step.at(theta)[0] - 1.0 / (1.0 + step.time(theta))).abs();
                at_steps = at_steps.max(error(1.0));
                between = between.max(error(0.3));
            });
            (at_steps, between)
        };
        let (a, b) = (errors(16), errors(32));
        let order = (a.0 / b.0).log2();
        assert!((order - 5.0).abs() < 0.3, "{order}");
        // The polynomial of degree 3 leaves h^4 locally.
        let dense = (a.1 / b.1).log2();
        assert!(dense > 3.5, "{dense}");
    }

    /// Stiff order: on Prothero & Robinson's problem with h lambda -> infinity, the stage order 3
    /// rules (sec. IV.15).
    #[test]
    fn keeps_its_stiff_order() {
        let error = |n| {
            let mut worst = 0.0_f64;
            equal_steps(&ProtheroRobinson(1e3), SVector::from([1.0, 0.0]), 2.0, n, 1e-9, |step| {
                worst = worst.max((step.x1[0] - step.t1.cos()).abs());
            });
            worst
        };
        let order = (error(40) / error(80)).log2();
        assert!(order > 2.7 && error(80) > 1e-10, "{order} {}", error(80));
    }

    fn run<F: VectorField<N>, const N: usize>(
        radau: &mut Radau5<N>,
        field: &F,
        x: SVector<f64, N>,
        t_end: f64,
        cap: f64,
    ) -> SVector<f64, N> {
        radau.restart(field, 0.0, x, t_end, cap).unwrap();
        loop {
            let step = radau.step(field).unwrap();
            assert!(step.length() <= cap * (1.0 + 1e-12));
            if step.t1 == t_end {
                return step.x1;
            }
            assert!(step.t1 < t_end);
        }
    }

    #[test]
    fn error_follows_tolerance() {
        for k in 4..=11 {
            let tolerance = 10_f64.powi(-k);
            let mut radau = Radau5::new(Tolerance { rtol: tolerance, atol: tolerance });
            let x = run(&mut radau, &Circle, SVector::from([1.0, 0.0]), 20.0, f64::INFINITY);
            let error = (x - SVector::from([20_f64.cos(), 20_f64.sin()])).amax();
            assert!(error < 10.0 * tolerance, "{tolerance}: {error}");
        }
    }

    #[test]
    fn stiff_decay_is_cheap() {
        let mut radau = Radau5::new(Tolerance { rtol: 1e-6, atol: 1e-6 });
        let x =
            run(&mut radau, &ProtheroRobinson(1e8), SVector::from([2.0, 0.0]), 10.0, f64::INFINITY);
        assert!((x[0] - 10_f64.cos()).abs() < 1e-6);
        assert!(radau.statistics.steps < 200, "{:?}", radau.statistics);
    }

    #[test]
    fn keeps_the_cap_and_forgets() {
        let mut used = Radau5::new(Tolerance { rtol: 1e-5, atol: 1e-5 });
        let start = SVector::from([1.0, 0.0]);
        run(&mut used, &Circle, start, 3.0, 0.05);
        let again = run(&mut used, &Circle, start, 3.0, 0.05);
        let fresh =
            run(&mut Radau5::new(Tolerance { rtol: 1e-5, atol: 1e-5 }), &Circle, start, 3.0, 0.05);
        assert_eq!(again.map(f64::to_bits), fresh.map(f64::to_bits));
    }

    #[test]
    fn a_pole_is_a_named_failure() {
        struct Explosion;
        impl VectorField<1> for Explosion {
            fn eval<S: Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
                SVector::from([x[0].squared()])
            }
        }
        let mut radau = Radau5::new(Tolerance { rtol: 1e-8, atol: 1e-8 });
        radau.restart(&Explosion, 0.0, SVector::from([1.0]), 2.0, f64::INFINITY).unwrap();
        let failure = (0..100_000)
            .find_map(|_| radau.step(&Explosion).err())
            .expect("the solution ends at t = 1");
        let (Failure::StepUnderflow { t, .. }
        | Failure::NotFinite { t, .. }
        | Failure::NotConverged { t, .. }) = failure
        else {
            panic!("{failure}")
        };
        assert!((t - 1.0).abs() < 1e-6, "{failure}");
    }
}
