//! Dormand-Prince 5(4): the explicit Runge-Kutta pair RK5(4)7M of Dormand & Prince (1980), with the
//! dense output and step control of Hairer, Norsett & Wanner, Solving ODEs I (2nd ed. 1993), secs
//! II.4-II.6.

use nalgebra::SVector;

use super::guard::Redoable;
use super::starting_step::starting_step;
use super::step::{
    Driven, DrivenStepper, Failure, Interpolant, Statistics, Steady, Step, Stepper, Tolerance,
    finite, is_last,
};
use twofold_num::elementary::{rough_exp2, rough_log2, sqrt};
use twofold_system::VectorField;

/// Dormand & Prince (1980), table 2.
pub(super) mod tableau {
    pub const C2: f64 = 1.0 / 5.0;
    pub const C3: f64 = 3.0 / 10.0;
    pub const C4: f64 = 4.0 / 5.0;
    pub const C5: f64 = 8.0 / 9.0;
    pub const A21: f64 = 1.0 / 5.0;
    pub const A31: f64 = 3.0 / 40.0;
    pub const A32: f64 = 9.0 / 40.0;
    pub const A41: f64 = 44.0 / 45.0;
    pub const A42: f64 = -56.0 / 15.0;
    pub const A43: f64 = 32.0 / 9.0;
    pub const A51: f64 = 19372.0 / 6561.0;
    pub const A52: f64 = -25360.0 / 2187.0;
    pub const A53: f64 = 64448.0 / 6561.0;
    pub const A54: f64 = -212.0 / 729.0;
    pub const A61: f64 = 9017.0 / 3168.0;
    pub const A62: f64 = -355.0 / 33.0;
    pub const A63: f64 = 46732.0 / 5247.0;
    pub const A64: f64 = 49.0 / 176.0;
    pub const A65: f64 = -5103.0 / 18656.0;
    // The seventh stage is the fifth-order solution itself: its derivative is the next step's first
    // ("fsal").
    pub const A71: f64 = 35.0 / 384.0;
    pub const A73: f64 = 500.0 / 1113.0;
    pub const A74: f64 = 125.0 / 192.0;
    pub const A75: f64 = -2187.0 / 6784.0;
    pub const A76: f64 = 11.0 / 84.0;
    // Fifth- minus fourth-order weights: the error estimate.
    pub const E1: f64 = 71.0 / 57600.0;
    pub const E3: f64 = -71.0 / 16695.0;
    pub const E4: f64 = 71.0 / 1920.0;
    pub const E5: f64 = -17253.0 / 339200.0;
    pub const E6: f64 = 22.0 / 525.0;
    pub const E7: f64 = -1.0 / 40.0;
    // Dense output of fourth order, Hairer et al. (1993), eq. (II.6.12) in the arrangement of their
    // DOPRI5.
    pub const D1: f64 = -12715105075.0 / 11282082432.0;
    pub const D3: f64 = 87487479700.0 / 32700410799.0;
    pub const D4: f64 = -10690763975.0 / 1880347072.0;
    pub const D5: f64 = 701980252875.0 / 199316789632.0;
    pub const D6: f64 = -1453857185.0 / 822651844.0;
    pub const D7: f64 = 69997945.0 / 29380423.0;
}
use tableau::*;

/// Step control, Hairer et al. (1993), sec. IV.2 (PI control after Gustafsson 1991): h_new = h
/// safety err^-alpha err_old^beta. Errors are kept squared, as the norm's sum gives them, and their
/// powers are made of one logarithm a step.
pub(super) mod control {
    pub const SAFETY: f64 = 0.9;
    pub const BETA: f64 = 0.04;
    pub const ALPHA: f64 = 0.2 - BETA * 0.75;
    /// log2 of the smallest error that the next step is told of, squared: 1e-4^2.
    pub const LEAST_LOG: f64 = -26.575_424_759_098_897;
    /// Squares below this are taken for it: the step then grows by as much as it may.
    pub const LEAST_SQUARE: f64 = 1e-40;
    /// Least factor by which h changes.
    pub const SHRINK: f64 = 0.2;
    /// Largest factor by which h changes.
    pub const GROW: f64 = 10.0;
}

/// Detection of stiffness, Hairer & Wanner (1996), sec. IV.2, with the numbers of their DOPRI5:
/// stages 6 and 7 belong to one time, so h |k7 - k6| / |x7 - x6| estimates h |lambda|, which is
/// near the boundary of the stability region where that bounds the step.
mod stiffness {
    /// The boundary of the stability region on the negative axis.
    pub const BOUNDARY: f64 = 3.25;
    /// Steps at the boundary of stability before the equation is called stiff.
    pub const AT_IT: u32 = 15;
    /// Steps in a row away from it that begin the count again.
    pub const INSIDE: u32 = 6;
    /// Steps between two looks where none was at the boundary lately.
    pub const EVERY: u64 = 64;
    /// Differences of the stages below this share of the tolerances, squared, are rounding.
    pub const ROUNDING: f64 = 1e-6;
}

/// The Dormand-Prince stepper.
#[derive(Clone, Debug)]
pub struct Dopri5<const N: usize> {
    tolerance: Tolerance,
    pub(super) statistics: Statistics,
    pub(super) t: f64,
    pub(super) x: SVector<f64, N>,
    /// f(x): the last stage of the previous step.
    pub(super) fsal: SVector<f64, N>,
    pub(super) t_end: f64,
    pub(super) max_step: f64,
    /// Step to try next.
    pub(super) h: f64,
    /// log2 of the square of the last accepted step's error, for the PI controller.
    pub(super) last_log: f64,
    pub(super) dense: Dense<N>,
    /// Steps found at the boundary of the stability region, and steps inside it since the last.
    at_boundary: u32,
    inside: u32,
}

/// The interpolant of one step, Hairer et al. (1993), sec. II.6: what it is made of. Most steps are
/// never looked into, so its coefficients are computed when asked for.
#[derive(Clone, Debug)]
pub(super) struct Dense<const N: usize> {
    pub(super) h: f64,
    pub(super) x0: SVector<f64, N>,
    pub(super) x1: SVector<f64, N>,
    /// The derivatives of stages 1, 3, 4, 5, 6, 7.
    pub(super) k: [SVector<f64, N>; 6],
}

impl<const N: usize> Interpolant<N> for Dense<N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        let Self { h, x0, x1, k: [k1, k3, k4, k5, k6, k7] } = self;
        let one_minus = 1.0 - theta;
        let r2 = x1 - x0;
        let r3 = k1 * *h - r2;
        let r4 = r2 - k7 * *h - r3;
        let r5 = (k1 * D1 + k3 * D3 + k4 * D4 + k5 * D5 + k6 * D6 + k7 * D7) * *h;
        x0 + (r2 + (r3 + (r4 + r5 * one_minus) * theta) * one_minus) * theta
    }
    fn coordinate(&self, theta: f64, i: usize) -> f64 {
        let (h, x0, [k1, k3, k4, k5, k6, k7]) =
            (self.h, self.x0[i], self.k.each_ref().map(|k| k[i]));
        let one_minus = 1.0 - theta;
        let r2 = self.x1[i] - x0;
        let r3 = k1 * h - r2;
        let r4 = r2 - k7 * h - r3;
        let r5 = (k1 * D1 + k3 * D3 + k4 * D4 + k5 * D5 + k6 * D6 + k7 * D7) * h;
        x0 + (r2 + (r3 + (r4 + r5 * one_minus) * theta) * one_minus) * theta
    }
    fn degree(&self) -> usize {
        4
    }
    fn bernstein(&self) -> Option<[SVector<f64, N>; 5]> {
        let Self { h, x0, x1, k: [k1, k3, k4, k5, k6, k7] } = self;
        let r2 = x1 - x0;
        let r3 = k1 * *h - r2;
        let r4 = r2 - k7 * *h - r3;
        let r5 = (k1 * D1 + k3 * D3 + k4 * D4 + k5 * D5 + k6 * D6 + k7 * D7) * *h;
        let middle = r2 * 0.5 + r3 / 3.0 + (r4 + r5) / 6.0;
        Some([SVector::zeros(), k1 * (0.25 * h), middle, r2 - k7 * (0.25 * h), r2])
    }
    /// The distance from the chord: theta (1 - theta) [r3 + theta r4 + theta (1 - theta) r5].
    fn reach(&self, coordinate: usize) -> f64 {
        let [k1, k3, k4, k5, k6, k7] = self.k.each_ref().map(|k| k[coordinate]);
        let r2 = self.x1[coordinate] - self.x0[coordinate];
        let r3 = k1 * self.h - r2;
        let r3_and_r4 = r2 - k7 * self.h;
        let r5 = (k1 * D1 + k3 * D3 + k4 * D4 + k5 * D5 + k6 * D6 + k7 * D7) * self.h;
        0.25 * (r3.abs().max(r3_and_r4.abs()) + 0.25 * r5.abs())
    }
}

impl<const N: usize> Dopri5<N> {
    /// A stepper with the given tolerances.
    pub fn new(tolerance: Tolerance) -> Self {
        let zero = SVector::zeros();
        Self {
            tolerance,
            statistics: Statistics { highest_order: 5, ..Statistics::default() },
            t: 0.0,
            x: zero,
            fsal: zero,
            t_end: 0.0,
            max_step: f64::INFINITY,
            h: 0.0,
            last_log: control::LEAST_LOG,
            dense: Dense { h: 0.0, x0: zero, x1: zero, k: [zero; 6] },
            at_boundary: 0,
            inside: 0,
        }
    }

    /// Whether the steps are bounded by stability, not by accuracy: an implicit method is then
    /// better.
    pub fn is_stiff(&self) -> bool {
        self.at_boundary >= stiffness::AT_IT
    }

    /// Looks at a step for [`Dopri5::is_stiff`]: the differences of its last two stages and of
    /// their derivatives times h.
    fn look_for_stiffness(&mut self, apart: &SVector<f64, N>, derivatives: &SVector<f64, N>) {
        let x1 = self.x;
        let [states, derivatives] =
            [apart, derivatives].map(|d| self.mean_square(d, |i| x1[i].abs()));
        if states > stiffness::ROUNDING
            && derivatives > stiffness::BOUNDARY * stiffness::BOUNDARY * states
        {
            (self.at_boundary, self.inside) = (self.at_boundary + 1, 0);
        } else {
            self.inside += 1;
            if self.inside >= stiffness::INSIDE {
                self.at_boundary = 0;
            }
        }
    }

    /// Root mean square of e_i / (atol + rtol |x_i|).
    fn norm(&self, e: &SVector<f64, N>, x: impl Fn(usize) -> f64) -> f64 {
        sqrt(self.mean_square(e, x))
    }

    /// Its square.
    #[inline]
    pub(super) fn mean_square(&self, e: &SVector<f64, N>, x: impl Fn(usize) -> f64) -> f64 {
        let mut sum = 0.0;
        for i in 0..N {
            let q = e[i] / (self.tolerance.atol + self.tolerance.rtol * x(i));
            sum += q * q;
        }
        sum / N as f64
    }

    fn first_step<D: Driven<N> + ?Sized>(&mut self, field: &D) -> f64 {
        let (t, x) = (self.t, self.x);
        let longest = self.max_step.min(self.t_end - t);
        let norm = |v: &SVector<f64, N>| self.norm(v, |i| x[i].abs());
        let h = starting_step(&x, &self.fsal, &norm, 0.2, longest, &|y| field.eval(t, y));
        // The time moves.
        let h = h.max((8.0 * f64::EPSILON * t.abs()).min(longest));
        self.statistics.evaluations += 1;
        h
    }

    /// [`Stepper::step`].
    fn advance<D: Driven<N> + ?Sized>(&mut self, field: &D) -> Result<Step<'_, N>, Failure> {
        let (t0, x0, k1) = (self.t, self.x, self.fsal);
        let mut rejected_before = false;
        loop {
            let remaining = self.t_end - t0;
            // Reach the end exactly; do not leave a remainder too small to step over.
            let last = is_last(t0, self.h, self.t_end, 1.000_000_1);
            let h = if last { remaining } else { self.h };
            if h.abs() <= t0.abs() * f64::EPSILON || h < f64::MIN_POSITIVE {
                return Err(Failure::StepUnderflow { t: t0, h, state: Failure::state(&x0) });
            }
            let t1 = if last { self.t_end } else { t0 + h };
            // Each sum ends with the derivative that was computed last: nothing but it is waited
            // for.
            let k2 = field.eval(t0 + h * C2, &(x0 + k1 * (h * A21)));
            let k3 = field.eval(t0 + h * C3, &(x0 + k1 * (h * A31) + k2 * (h * A32)));
            let k4 =
                field.eval(t0 + h * C4, &(x0 + k1 * (h * A41) + k2 * (h * A42) + k3 * (h * A43)));
            let x5 = x0 + k1 * (h * A51) + k2 * (h * A52) + k3 * (h * A53) + k4 * (h * A54);
            let k5 = field.eval(t0 + h * C5, &x5);
            let x6 = x0
                + k1 * (h * A61)
                + k2 * (h * A62)
                + k3 * (h * A63)
                + k4 * (h * A64)
                + k5 * (h * A65);
            let k6 = field.eval(t1, &x6);
            // The increment by itself: one rounding at the size of the state, not five.
            let x1 = x0
                + (k1 * (h * A71)
                    + k3 * (h * A73)
                    + k4 * (h * A74)
                    + k5 * (h * A75)
                    + k6 * (h * A76));
            let k7 = field.eval(t1, &x1);
            self.statistics.evaluations += 6;

            let e = k1 * (h * E1)
                + k3 * (h * E3)
                + k4 * (h * E4)
                + k5 * (h * E5)
                + k6 * (h * E6)
                + k7 * (h * E7);
            let square = self.mean_square(&e, |i| x0[i].abs().max(x1[i].abs()));
            if !square.is_finite() || !finite(&x1) || !finite(&k7) {
                // A trial point may leave the domain although the orbit does not: retry much
                // shorter, then give up.
                self.statistics.rejected += 1;
                self.h = h * 0.1;
                rejected_before = true;
                if self.h <= t0.abs() * f64::EPSILON || self.h < 1e-300 {
                    return Err(Failure::NotFinite { t: t0, state: Failure::state(&x0) });
                }
                continue;
            }
            let log = rough_log2(square.max(control::LEAST_SQUARE));
            if square <= 1.0 {
                let factor =
                    (rough_exp2(0.5 * (control::ALPHA * log - control::BETA * self.last_log))
                        / control::SAFETY)
                        .clamp(1.0 / control::GROW, 1.0 / control::SHRINK);
                let mut next = h / factor;
                if rejected_before {
                    next = next.min(h);
                }
                // A step shortened only to reach the end says nothing about the size to go on with.
                self.h = next.min(self.max_step);
                self.last_log = log.max(control::LEAST_LOG);
                self.dense = Dense { h, x0, x1, k: [k1, k3, k4, k5, k6, k7] };
                self.t = t1;
                self.x = x1;
                self.fsal = k7;
                self.statistics.steps += 1;
                if self.at_boundary > 0 || self.statistics.steps.is_multiple_of(stiffness::EVERY) {
                    self.look_for_stiffness(&(x1 - x6), &((k7 - k6) * h));
                }
                return Ok(Step { t0, t1: self.t, x0, x1, interpolant: &self.dense });
            }
            self.statistics.rejected += 1;
            rejected_before = true;
            let factor = rough_exp2(0.5 * control::ALPHA * log) / control::SAFETY;
            self.h = h / factor.min(1.0 / control::SHRINK);
        }
    }
}

impl<const N: usize> Stepper<N> for Dopri5<N> {
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

impl<const N: usize> DrivenStepper<N> for Dopri5<N> {
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
        self.last_log = control::LEAST_LOG;
        self.fsal = field.eval(t, &x);
        self.statistics.evaluations += 1;
        self.statistics.restarts += 1;
        if !finite(&x) || !finite(&self.fsal) {
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

impl<const N: usize> Redoable<N> for Dopri5<N> {
    fn last(&self) -> &dyn Interpolant<N> {
        &self.dense
    }
}
