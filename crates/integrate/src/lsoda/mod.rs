//! LSODA: variable-order, variable-step multistep integration that chooses by itself between the
//! Adams-Moulton family (orders 1 to 12, functional iteration) for non-stiff stretches and the BDF
//! family (orders 1 to 5, Newton iteration) for stiff ones.
//!
//! Written from the literature: Hindmarsh, ODEPACK, a systematized collection of ODE solvers
//! (1983); Petzold, Automatic selection of methods for solving stiff and nonstiff systems (1983);
//! Radhakrishnan & Hindmarsh, Description and use of LSODE (1993); Gear (1971); Hairer, Norsett &
//! Wanner (1993), ch. III; Hairer & Wanner (1996), ch. V. Names there and here:
//!
//! | here | there |
//! |---|---|
//! | `coefficients` | EL, TESCO, SM1 |
//! | `nordsieck` | YH, the scaled history |
//! | `selection` | step, order and method selection |
//! | `correction` | ACOR |
//! | `lipschitz` | PDEST, PDLAST: the Lipschitz constant seen by the iteration |
//!
//! Errors are measured in the norm max_i |e_i| / (rtol |x_i| + atol). The dense output is the
//! Nordsieck polynomial of the step just made. No evaluation is made beyond the end of the run
//! (ODEPACK's ITASK 4 and 5), which also sets the scale of the first step, as TOUT does there.
//!
//! tests/it/odepack.rs compares this stepper with ODEPACK's LSODA in 62 runs on ten problems. In 27
//! of them ODEPACK makes the same decisions from starts 1e-12 apart; there steps, evaluations,
//! Jacobians, orders and switches agree one by one. In the others rounding decides, and the counts
//! differ from ODEPACK's by as much as ODEPACK's own counts scatter: steps by at most 14.6 %,
//! evaluations by at most 11.4 %.
//!
//! Every constant and decision of step, order and method selection, of the corrector's convergence
//! and of the failures was also compared, line by line, with ODEPACK's own text (LSODA, STODA;
//! public domain). They are the same, but for three things that are meant: the Jacobian is exact
//! and not a difference quotient, powers in the selection are taken to about 1e-14 (`rough_pow`),
//! and a change that a step decides on is carried out when the next one begins.

mod coefficients;
mod nordsieck;
mod selection;

use nalgebra::allocator::Allocator;
use nalgebra::{Const, DefaultAllocator, Dim, OMatrix, OVector, SVector, U1};
use serde::{Deserialize, Serialize};

use super::guard::Redoable;
use super::linear::Lu;
use super::step::{Driven, Failure, Interpolant, Statistics, Steady, Step, Stepper, Tolerance};
use coefficients::{ADAMS, ADAMS_ORDERS, ADAMS_STABILITY, BDF, BDF_ORDERS, ERROR_RATIO, Formula};
use nordsieck::Nordsieck;
use selection::*;
use twofold_num::elementary::{rough_pow, sqrt};
use twofold_system::VectorField;

const EPSILON: f64 = f64::EPSILON;

/// The two families of linear multistep methods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Family {
    /// Adams-Moulton: for non-stiff problems.
    Adams,
    /// Backward differentiation: for stiff ones.
    Bdf,
}

impl Family {
    fn formula(self, order: usize) -> &'static Formula {
        match self {
            Family::Adams => &ADAMS[order - 1],
            Family::Bdf => &BDF[order - 1],
        }
    }

    /// The highest order of the family.
    pub fn highest_order(self) -> usize {
        match self {
            Family::Adams => ADAMS_ORDERS,
            Family::Bdf => BDF_ORDERS,
        }
    }
}

/// A change of family.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switch {
    /// When: the end of the last step of the old family.
    pub t: f64,
    /// To which family.
    pub to: Family,
}

/// Switches kept for [`Lsoda::switches`]; a long hysteretic run has millions, and a step must not
/// allocate.
const SWITCHES_KEPT: usize = 256;

/// Decision of the selection at the end of a step. Carried out when the next step begins, so that
/// until then the history is the dense output of the step that was made.
#[derive(Clone, Copy, Debug)]
struct Change {
    family: Family,
    order: usize,
    ratio: f64,
}

/// A right-hand side of as many states as `D` says, which may be known only at run time.
pub trait RightHandSide<D: Dim>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    /// f(t, x).
    fn eval(&self, t: f64, x: &OVector<f64, D>) -> OVector<f64, D>;
    /// The Jacobian matrix df/dx at (t, x).
    fn jacobian(&self, t: f64, x: &OVector<f64, D>) -> OMatrix<f64, D, D>;
}

impl<F: VectorField<N>, const N: usize> RightHandSide<Const<N>> for Steady<'_, F> {
    #[inline(always)]
    fn eval(&self, t: f64, x: &SVector<f64, N>) -> SVector<f64, N> {
        Driven::eval(self, t, x)
    }
    #[inline(always)]
    fn jacobian(&self, t: f64, x: &SVector<f64, N>) -> OMatrix<f64, Const<N>, Const<N>> {
        Driven::jacobian(self, t, x)
    }
}

/// The LSODA stepper of a number of states that is known when it is compiled.
pub type Lsoda<const N: usize> = LsodaOf<Const<N>>;

/// The LSODA stepper, of a number of states that is known when it is compiled ([`Lsoda`]) or only
/// at run time ([`nalgebra::Dyn`]; [`LsodaOf::start`], [`LsodaOf::advance`]).
///
/// ```
/// # use nalgebra::{SVector, Vector2};
/// # use twofold_num::Elementary;
/// # use twofold_system::VectorField;
/// # struct Oscillator;
/// # impl VectorField<2> for Oscillator {
/// #     fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
/// #         Vector2::new(x[1], -x[0])
/// #     }
/// # }
/// use twofold_integrate::{DriveOptions, Ignore, Lsoda, Tolerance, drive};
/// // x'' = -x from (1, 0).
/// let mut lsoda = Lsoda::new(Tolerance { rtol: 1e-10, atol: 1e-10 });
/// let to = DriveOptions::to(1.0);
/// let end = drive(&Oscillator, Vector2::new(1.0, 0.0), &to, &mut lsoda, &mut Ignore, &())?;
/// assert!((end.x[0] - 0.540_302_305_868).abs() < 1e-8);
/// # Ok::<(), twofold_integrate::Failure>(())
/// ```
#[derive(Clone, Debug)]
pub struct LsodaOf<D: Dim>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    tolerance: Tolerance,
    statistics: Statistics,
    switches: Vec<Switch>,
    t: f64,
    t_end: f64,
    max_step: f64,

    family: Family,
    order: usize,
    /// The step that the history is scaled with.
    h: f64,
    history: Nordsieck<D>,
    /// 1 / (rtol |x_i| + atol) at the start of the step.
    weights: OVector<f64, D>,
    /// e of the corrector formula y <- y + l e.
    correction: OVector<f64, D>,
    /// Norm of the predicted state: the scale of rounding errors in this step.
    predicted_size: f64,
    /// e of an earlier step, for the error at the next higher order.
    correction_before: OVector<f64, D>,

    /// Accepted steps to go until step and order are thought over.
    until_selection: usize,
    /// Accepted steps to go until a switch of family is thought over.
    until_switch_test: i32,
    growth_limit: f64,
    pending: Option<Change>,

    /// Smoothed rate of convergence of the corrector.
    rate: f64,
    /// Largest Lipschitz constant that the functional iteration has shown since the last selection.
    lipschitz_seen: f64,
    /// The last one that was not zero.
    lipschitz: f64,
    /// The step is limited by the Adams formula's stability, not by accuracy.
    stability_bound: bool,

    /// I - h l_0 J, factorised.
    matrix: Option<Lu<f64, D>>,
    /// The h l_0 it was made with.
    matrix_h: f64,
    /// The step it was made in.
    matrix_step: u64,
    /// Norm of its J, consistent with the error norm.
    jacobian_norm: f64,
    renew_matrix: bool,
    /// Accepted steps in a row that were too short to change t.
    standing_still: u32,
    /// Test hook: keep family, order and step, and iterate the corrector to the end.
    held: bool,
}

/// The corrector iteration diverged or was too slow.
struct NotConverged;

impl<const N: usize> Lsoda<N> {
    /// A stepper with the given tolerances.
    pub fn new(tolerance: Tolerance) -> Self {
        Self { switches: Vec::with_capacity(SWITCHES_KEPT), ..Self::blank(tolerance, Const) }
    }
}

impl<D: Dim> LsodaOf<D>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    /// A stepper with the given tolerances, of so many states.
    pub fn of(tolerance: Tolerance, states: D) -> Self {
        Self::blank(tolerance, states)
    }

    /// A stepper that knows nothing yet.
    fn blank(tolerance: Tolerance, states: D) -> Self {
        let zero = OVector::zeros_generic(states, U1);
        Self {
            tolerance,
            statistics: Statistics::default(),
            switches: Vec::new(),
            t: 0.0,
            t_end: 0.0,
            max_step: f64::INFINITY,
            family: Family::Adams,
            order: 1,
            h: 0.0,
            history: Nordsieck::new(zero.clone(), zero.clone()),
            weights: zero.clone(),
            correction: zero.clone(),
            predicted_size: 0.0,
            correction_before: zero,
            until_selection: 2,
            until_switch_test: STEPS_BEFORE_SWITCH,
            growth_limit: GROWTH_FIRST,
            pending: None,
            rate: FIRST_RATE,
            lipschitz_seen: 0.0,
            lipschitz: 0.0,
            stability_bound: false,
            matrix: None,
            matrix_h: 0.0,
            matrix_step: 0,
            jacobian_norm: 0.0,
            renew_matrix: false,
            standing_still: 0,
            held: false,
        }
    }

    /// The order of the next step (of the last one until that begins).
    pub fn order(&self) -> usize {
        self.pending.map_or(self.order, |change| change.order)
    }

    /// The family of the next step.
    pub fn family(&self) -> Family {
        self.pending.map_or(self.family, |change| change.family)
    }

    /// The first switches of family since the stepper was made (at most 256); their full number is
    /// in the statistics.
    pub fn switches(&self) -> &[Switch] {
        &self.switches
    }

    fn formula(&self) -> &'static Formula {
        self.family.formula(self.order)
    }

    /// The weighted maximum norm.
    #[inline]
    fn norm(&self, v: &OVector<f64, D>) -> f64 {
        let (mut largest, mut sum) = (0.0_f64, 0.0);
        for (v, w) in v.iter().zip(&self.weights) {
            let size = v.abs() * w;
            largest = larger(largest, size);
            sum += size;
        }
        // A NaN is lost in a comparison, and kept in a sum.
        if sum.is_nan() { not_a_number() } else { largest }
    }

    /// The matrix norm that belongs to it: max_i w_i sum_j |J_ij| / w_j.
    fn matrix_norm(&self, j: &OMatrix<f64, D, D>) -> f64 {
        let mut largest = 0.0_f64;
        let n = self.weights.len();
        for i in 0..n {
            let mut sum = 0.0;
            for k in 0..n {
                sum += j[(i, k)].abs() / self.weights[k];
            }
            largest = largest.max(sum * self.weights[i]);
        }
        largest
    }

    /// Begins at `x`, of whose past nothing is known.
    #[inline]
    fn forget(
        &mut self,
        t: f64,
        x: OVector<f64, D>,
        derivative: &OVector<f64, D>,
        t_end: f64,
        max_step: f64,
    ) {
        let fresh = Self::blank(self.tolerance, x.shape_generic().0);
        *self = Self {
            statistics: std::mem::take(&mut self.statistics),
            switches: std::mem::take(&mut self.switches),
            t,
            t_end,
            max_step,
            history: Nordsieck::new(x, derivative.clone()),
            ..fresh
        };
    }

    /// Takes the first step's length from the weights.
    #[inline]
    fn begin(&mut self, derivative: OVector<f64, D>) {
        self.h = self.first_step(&derivative);
        self.history.set_column(1, derivative * self.h);
    }

    /// Starts at `x` with the `derivative` there, towards `t_end`. An error as large as `scale` is
    /// the largest that a step may make; the tolerances say no more than how carefully the first
    /// step is chosen.
    pub fn start(
        &mut self,
        t: f64,
        x: OVector<f64, D>,
        derivative: OVector<f64, D>,
        scale: &OVector<f64, D>,
        t_end: f64,
    ) {
        self.statistics.restarts += 1;
        self.forget(t, x, &derivative, t_end, f64::INFINITY);
        self.weights = scale.map(|scale| 1.0 / scale);
        // The time moves.
        let least = (16.0 * f64::EPSILON * t.abs()).min(t_end - t);
        self.h = self.first_step(&derivative).max(least);
        self.history.set_column(1, derivative * self.h);
    }

    /// Makes a step from `x` at the time `t`, where the last one ended but for the rounding of
    /// either, to `t_end` at the latest. Errors count as in [`LsodaOf::start`].
    ///
    /// # Errors
    /// If no step is short enough; the stepper is then to be started again.
    pub fn advance(
        &mut self,
        rhs: &dyn RightHandSide<D>,
        t: f64,
        x: &OVector<f64, D>,
        scale: &OVector<f64, D>,
        t_end: f64,
    ) -> Result<(), Failure> {
        (self.t, self.t_end) = (t, t_end);
        self.history.set_column(0, x.clone());
        self.prepare();
        self.weights = scale.map(|scale| 1.0 / scale);
        self.accepted(rhs)
    }

    /// The length of the last step, or of one that failed.
    pub fn length(&self) -> f64 {
        self.h
    }

    /// The order and family of the last step.
    pub fn made_by(&self) -> (usize, Family) {
        (self.order, self.family)
    }

    /// The end of the last step.
    pub fn time(&self) -> f64 {
        self.t
    }

    /// The dense output of the last step: coefficients of the powers of s, which goes from -1 to 0.
    pub fn polynomial(&self) -> &[OVector<f64, D>] {
        self.history.polynomial()
    }

    fn weigh(&mut self) {
        let Tolerance { rtol, atol } = self.tolerance;
        self.weights = self.history.x().map(|x| 1.0 / (rtol * x.abs() + atol));
    }

    /// The first step, Radhakrishnan & Hindmarsh (1993), sec. 3.5: such that an Euler step would
    /// make an error well below the tolerance, for a solution that varies either on the scale of
    /// `t` or as fast as f says.
    fn first_step(&self, derivative: &OVector<f64, D>) -> f64 {
        let Tolerance { rtol, atol } = self.tolerance;
        let mut tolerance = rtol;
        if tolerance <= 0.0 {
            for x in self.history.x() {
                if *x != 0.0 {
                    tolerance = tolerance.max(atol / x.abs());
                }
            }
        }
        let tolerance = tolerance.clamp(100.0 * EPSILON, 1e-3);
        let scale = self.t.abs().max(self.t_end.abs());
        let slope = self.norm(derivative);
        let h = 1.0 / sqrt(1.0 / (tolerance * scale * scale) + tolerance * slope * slope);
        h.min(self.t_end - self.t).min(self.max_step)
    }

    /// The longest growth that the stability of the Adams formula of `order` allows (Petzold 1983).
    fn stability_growth(&self, order: usize) -> f64 {
        ADAMS_STABILITY[order - 1] / (self.h * self.lipschitz).max(1e-6)
    }

    /// Goes over to a step `ratio` times as long, within all limits.
    fn change_step(&mut self, ratio: f64) {
        let mut ratio = ratio.min(self.growth_limit);
        ratio /= (self.h * ratio / self.max_step).max(1.0);
        if self.family == Family::Adams {
            let limit = self.stability_growth(self.order);
            self.stability_bound = ratio * 1.00001 >= limit;
            if self.stability_bound {
                ratio = limit;
            }
        }
        self.history.rescale(self.order, ratio);
        self.h *= ratio;
        self.until_selection = self.order + 1;
    }

    /// Goes over to another order; a higher one gets its column from the last correction: the
    /// change of y_q over a step, l_q e, is h^(q+1) x^(q+1)/q!.
    fn change_order(&mut self, order: usize) {
        if order > self.order {
            let scale = self.formula().l[self.order] / order as f64;
            self.history.set_column(order, &self.correction * scale);
        }
        self.order = order;
    }

    fn carry_out_pending(&mut self) {
        let Some(change) = self.pending.take() else { return };
        if change.family == self.family {
            self.change_order(change.order);
        } else {
            self.family = change.family;
            self.order = change.order;
            self.renew_matrix = true;
            self.until_switch_test = STEPS_BEFORE_SWITCH;
            self.lipschitz = 0.0;
        }
        self.change_step(change.ratio);
        self.growth_limit = GROWTH;
    }

    /// Shortens the step if it would pass the end.
    fn stop_at_end(&mut self) {
        if self.t + self.h * (1.0 + 4.0 * EPSILON) > self.t_end {
            let ratio = (self.t_end - self.t) * (1.0 - 4.0 * EPSILON) / self.h;
            self.change_step(ratio);
        }
    }

    /// Evaluates the Jacobian and factorises I - h l_0 J.
    fn make_matrix(
        &mut self,
        field: &dyn RightHandSide<D>,
        x: &OVector<f64, D>,
    ) -> Result<(), NotConverged> {
        let j = field.jacobian(self.t + self.h, x);
        let h = self.h * self.formula().l[0];
        self.statistics.jacobians += 1;
        self.statistics.factorisations += 1;
        self.jacobian_norm = self.matrix_norm(&j);
        self.renew_matrix = false;
        self.matrix_h = h;
        self.matrix_step = self.statistics.steps;
        self.rate = FIRST_RATE;
        let (rows, columns) = j.shape_generic();
        self.matrix = Lu::new(OMatrix::identity_generic(rows, columns) - j * h);
        if self.matrix.is_some() { Ok(()) } else { Err(NotConverged) }
    }

    /// Solves the corrector equation e = h f(y_0 + l_0 e) - y_1 from e = 0, by functional iteration
    /// (Adams) or Newton iteration with a kept matrix (BDF). Returns the error of the step in units
    /// of the tolerance.
    fn correct(&mut self, field: &dyn RightHandSide<D>) -> Result<f64, NotConverged> {
        let formula = self.formula();
        let l0 = formula.l[0];
        let t = self.t + self.h;
        let (y0, y1) = (self.history.x().clone(), self.history.column(1).clone());
        let size = self.norm(&y0);
        self.predicted_size = size;
        let tolerance = formula.converged;
        let most = if self.held { 200 } else { MOST_ITERATIONS };
        let mut new_matrix = false;
        'start: loop {
            let mut x = y0.clone();
            let mut derivative = field.eval(t, &x);
            self.statistics.evaluations += 1;
            if self.family == Family::Bdf && self.renew_matrix {
                self.make_matrix(field, &x)?;
                new_matrix = true;
            }
            self.correction.fill(0.0);
            let (mut change_before, mut largest_rate) = (0.0, 0.0_f64);
            let mut iteration = 0;
            loop {
                let change = match self.family {
                    Family::Adams => {
                        let e = derivative * self.h - &y1;
                        let change = self.norm(&(&e - &self.correction));
                        self.correction = e;
                        change
                    }
                    Family::Bdf => {
                        let residual = derivative * self.h - (&y1 + &self.correction);
                        let Some(matrix) = &self.matrix else { return Err(NotConverged) };
                        let delta = matrix.solve(residual);
                        self.correction += &delta;
                        self.norm(&delta)
                    }
                };
                x = &y0 + &self.correction * l0;
                let mut converged = change <= 100.0 * size * EPSILON;
                // Functional iteration may not stop on the first pass: a rate is known only from
                // the second on.
                if !converged && !self.held && (iteration > 0 || self.family == Family::Bdf) {
                    if iteration > 0 {
                        let rate = if change <= 1024.0 * change_before {
                            change / change_before
                        } else {
                            1024.0
                        };
                        largest_rate = larger(largest_rate, rate);
                        self.rate = larger(0.2 * self.rate, rate);
                    }
                    if change * (1.5 * self.rate).min(1.0) <= tolerance {
                        converged = true;
                        self.lipschitz_seen =
                            larger(self.lipschitz_seen, largest_rate / (self.h * l0));
                        if self.lipschitz_seen != 0.0 {
                            self.lipschitz = self.lipschitz_seen;
                        }
                    }
                }
                if converged {
                    let error = if iteration == 0 { change } else { self.norm(&self.correction) };
                    return Ok(error / formula.same);
                }
                iteration += 1;
                // Written so that a NaN counts as divergence.
                let shrinking = change <= 2.0 * change_before || self.held;
                if iteration == most || iteration >= 2 && !shrinking {
                    if self.family == Family::Adams || new_matrix {
                        return Err(NotConverged);
                    }
                    self.renew_matrix = true;
                    continue 'start;
                }
                change_before = change;
                derivative = field.eval(t, &x);
                self.statistics.evaluations += 1;
            }
        }
    }

    /// Whether no order allows a step that is worth it, by the errors at the next lower, this and
    /// the next higher order, and stability is far from dictating one: so most selections end,
    /// without a root. False may also mean that it is not known.
    fn nothing_to_gain(&self, lower: f64, same: f64, higher: f64) -> bool {
        let q = self.order;
        let stable = || {
            let least = 1.1 * LEAST_GAIN * (self.h * self.lipschitz).max(1e-6);
            ADAMS_STABILITY[q.max(2) - 2..ADAMS_ORDERS.min(q + 1)]
                .iter()
                .all(|limit| *limit > least)
        };
        lower > NO_GAIN_LOWER[q - 1]
            && same > NO_GAIN_SAME[q]
            && higher > NO_GAIN_HIGHER[q + 1]
            && (self.family == Family::Bdf || stable())
    }

    /// The order and the step ratio for going on, from `error` at the present order. After a failed
    /// step (`failures` > 0) no higher order is considered. `None`: leave both as they are.
    fn select(&mut self, error: f64, failures: u32) -> Option<Change> {
        let (q, formula) = (self.order, self.formula());
        let may_rise = failures == 0 && q < self.family.highest_order();
        let higher_error = if may_rise {
            self.norm(&(&self.correction - &self.correction_before)) / formula.higher
        } else {
            f64::INFINITY
        };
        let lower_error =
            if q > 1 { self.norm(self.history.column(q)) / formula.lower } else { f64::INFINITY };
        if failures == 0 && self.nothing_to_gain(lower_error, error, higher_error) {
            if self.family == Family::Adams {
                self.lipschitz_seen = 0.0;
            }
            self.until_selection = 3;
            return None;
        }
        let mut higher = if may_rise { growth(BIAS_HIGHER, higher_error, q + 1) } else { 0.0 };
        let mut same = growth(BIAS_SAME, error, q);
        let mut lower = if q > 1 { growth(BIAS_LOWER, lower_error, q - 1) } else { 0.0 };
        let mut stability = f64::INFINITY;
        if self.family == Family::Adams {
            if q < ADAMS_ORDERS {
                higher = higher.min(self.stability_growth(q + 1));
            }
            same = same.min(self.stability_growth(q));
            if q > 1 {
                lower = lower.min(self.stability_growth(q - 1));
            }
            self.lipschitz_seen = 0.0;
        }
        let (order, mut ratio) = if same >= higher && same >= lower {
            (q, same)
        } else if higher > same && higher > lower {
            (q + 1, higher)
        } else {
            (q - 1, if failures > 0 { lower.min(1.0) } else { lower })
        };
        if self.family == Family::Adams {
            stability = self.stability_growth(order);
        }
        // A small gain is not worth it, except where stability dictates the step.
        let dictated = order <= q && ratio * 1.00001 >= stability;
        if failures == 0 && ratio < LEAST_GAIN && !dictated {
            self.until_selection = 3;
            return None;
        }
        if failures >= 2 {
            ratio = ratio.min(SHRINK_REPEATED);
        }
        Some(Change { family: self.family, order, ratio })
    }

    /// Petzold's test: the longest steps that the two families could take now, and which is worth
    /// it.
    fn consider_switch(&self, error: f64) -> Option<Change> {
        let (q, size) = (self.order, self.predicted_size);
        match self.family {
            Family::Adams => {
                if q > SWITCH_ORDERS {
                    return None;
                }
                if error <= 100.0 * size * EPSILON || self.lipschitz_seen == 0.0 {
                    // The estimates are lost in rounding. Only a step that stability holds down is
                    // a sign.
                    return self.stability_bound.then_some(Change {
                        family: Family::Bdf,
                        order: q,
                        ratio: 2.0,
                    });
                }
                // The same derivative, through the other formula's constants.
                let bdf_error = error * ERROR_RATIO[q - 1];
                // At equal accuracy BDF is never the longer step by SWITCH_RATIO (see
                // [`ERROR_RATIO`]), so stability must decide: BDF's growth, at most 1/(bias
                // error^(1/(q+1))), against SWITCH_RATIO times the stable growth. Raised to the
                // power q + 1 this needs no root; nearly every step ends here.
                let bound =
                    self.lipschitz * self.h / (SWITCH_RATIO * BIAS_SAME * ADAMS_STABILITY[q - 1]);
                let mut power = 1.000_001 * bound;
                for _ in 0..q {
                    power *= bound;
                }
                if bdf_error > power {
                    return None;
                }
                let adams = self.adams_growth(error, q, self.lipschitz);
                let bdf = growth(BIAS_SAME, bdf_error, q);
                (bdf >= SWITCH_RATIO * adams).then_some(Change {
                    family: Family::Bdf,
                    order: q,
                    ratio: bdf,
                })
            }
            Family::Bdf => {
                let adams_error = error / ERROR_RATIO[q - 1];
                let adams = self.adams_growth(adams_error, q, self.jacobian_norm);
                let bdf = growth(BIAS_SAME, error, q);
                if adams * SWITCH_RATIO < 5.0 * bdf {
                    return None;
                }
                // Would the error estimate drown in rounding at that step?
                let predicted = rough_pow(adams.max(1e-3), 1.0 / (q + 1) as f64) * adams_error;
                (predicted > 1000.0 * EPSILON * size).then_some(Change {
                    family: Family::Adams,
                    order: q,
                    ratio: adams,
                })
            }
        }
    }

    /// The growth that accuracy and stability allow the Adams formula.
    fn adams_growth(&self, error: f64, q: usize, lipschitz: f64) -> f64 {
        let accurate = growth(BIAS_SAME, error, q);
        let scaled = lipschitz * self.h;
        let stable =
            if scaled * accurate > 1e-5 { ADAMS_STABILITY[q - 1] / scaled } else { 2.0 * accurate };
        accurate.min(stable)
    }

    /// Carries out what the step before has decided.
    #[inline]
    fn prepare(&mut self) {
        if !self.held {
            self.carry_out_pending();
            self.stop_at_end();
        }
    }

    /// One accepted step.
    fn accepted(&mut self, field: &dyn RightHandSide<D>) -> Result<(), Failure> {
        let (t0, x0) = (self.t, self.history.x().clone());
        let underflow = |h: f64| Failure::StepUnderflow { t: t0, h, state: state(&x0) };
        // Tolerances below the rounding of x itself (or zero: a NaN here).
        let rounding = self.norm(&x0) * EPSILON;
        if rounding > 1.0 || rounding.is_nan() {
            return Err(underflow(self.h));
        }
        let (mut not_converged, mut too_inaccurate) = (0, 0);
        let error = loop {
            if self.family == Family::Bdf {
                let drift = self.h * self.formula().l[0] / self.matrix_h - 1.0;
                let age = self.statistics.steps - self.matrix_step;
                if drift.abs() > MATRIX_DRIFT || age >= MATRIX_LIFETIME || self.held {
                    self.renew_matrix = true;
                }
            }
            self.history.predict(self.order);
            let corrected = self.correct(field);
            match corrected {
                Ok(error) if error <= 1.0 || self.held => break error,
                _ => {}
            }
            self.history.retract(self.order);
            self.history.set_column(0, x0.clone());
            self.growth_limit = GROWTH_AFTER_FAILURE;
            match corrected {
                Err(NotConverged) => {
                    self.statistics.convergence_failures += 1;
                    not_converged += 1;
                    if not_converged == MOST_FAILURES {
                        let x = &x0 + self.history.column(1);
                        return Err(if finite(&field.eval(t0 + self.h, &x)) {
                            Failure::NotConverged { t: t0, h: self.h, state: state(&x0) }
                        } else {
                            Failure::NotFinite { t: t0, state: state(&x0) }
                        });
                    }
                    self.renew_matrix = true;
                    self.change_step(SHRINK_NOT_CONVERGED);
                }
                Ok(error) => {
                    self.statistics.rejected += 1;
                    too_inaccurate += 1;
                    if too_inaccurate == MOST_FAILURES {
                        return Err(underflow(self.h));
                    }
                    if too_inaccurate >= 3 {
                        self.start_over(field);
                    } else if let Some(change) = self.select(error, too_inaccurate) {
                        self.change_order(change.order);
                        self.change_step(change.ratio);
                    }
                }
            }
            if self.h < f64::MIN_POSITIVE {
                return Err(underflow(self.h));
            }
        };

        self.history.correct(self.order, self.formula(), &self.correction);
        self.t = t0 + self.h;
        if (self.t - self.t_end).abs() <= 100.0 * EPSILON * (self.t.abs() + self.h) {
            self.t = self.t_end;
        }
        let statistics = &mut self.statistics;
        statistics.steps += 1;
        statistics.stiff_steps += u64::from(self.family == Family::Bdf);
        statistics.highest_order = statistics.highest_order.max(self.order as u64);

        // A first step may be below the spacing of numbers at t and soon grows; a run of such steps
        // will not, as before the end of a domain, where no state moves any more.
        let moves = self.t - t0 > 4.0 * EPSILON * self.t.abs();
        self.standing_still = if moves { 0 } else { self.standing_still + 1 };
        if !finite(self.history.x()) {
            return Err(Failure::NotFinite { t: t0, state: state(&x0) });
        }
        if self.standing_still > 100 {
            return Err(underflow(self.h));
        }
        if !self.held {
            self.look_ahead(error);
        }
        Ok(())
    }

    /// After repeated failures the history is not to be believed: keep x alone, at order 1 and a
    /// tenth of the step.
    fn start_over(&mut self, field: &dyn RightHandSide<D>) {
        self.h *= SHRINK_RESET;
        let x = self.history.x().clone();
        self.history.set_column(1, field.eval(self.t, &x) * self.h);
        self.statistics.evaluations += 1;
        self.order = 1;
        self.renew_matrix = true;
        self.until_selection = 5;
    }
}

fn finite<D: Dim>(x: &OVector<f64, D>) -> bool
where
    DefaultAllocator: Allocator<D>,
{
    x.iter().all(|v| v.is_finite())
}

/// A state as an error's list.
fn state<D: Dim>(x: &OVector<f64, D>) -> Vec<f64>
where
    DefaultAllocator: Allocator<D>,
{
    x.iter().copied().collect()
}

/// The larger of two numbers, the first if the second is none. `f64::max` minds a NaN in the first
/// too, which takes four more instructions in a chain that every iteration waits for.
#[inline(always)]
fn larger(known: f64, new: f64) -> f64 {
    if new > known { new } else { known }
}

/// In a function of its own, so that it is jumped to and not computed and masked in every norm.
#[cold]
#[inline(never)]
fn not_a_number() -> f64 {
    f64::NAN
}

impl<const N: usize> Lsoda<N> {
    /// One accepted step.
    fn step_of(&mut self, field: &dyn RightHandSide<Const<N>>) -> Result<Step<'_, N>, Failure> {
        self.prepare();
        self.weigh();
        let (t0, x0) = (self.t, *self.history.x());
        self.accepted(field)?;
        Ok(Step { t0, t1: self.t, x0, x1: *self.history.x(), interpolant: &self.history })
    }
}

impl<const N: usize> Stepper<N> for Lsoda<N> {
    fn restart<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        let derivative = field.eval(&x);
        self.statistics.evaluations += 1;
        self.statistics.restarts += 1;
        if !finite(&x) || !finite(&derivative) {
            return Err(Failure::NotFinite { t, state: state(&x) });
        }
        self.forget(t, x, &derivative, t_end, max_step);
        self.weigh();
        self.begin(derivative);
        Ok(())
    }

    fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure> {
        self.step_of(&Steady(field))
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}

impl<const N: usize> Redoable<N> for Lsoda<N> {
    fn last(&self) -> &dyn Interpolant<N> {
        &self.history
    }
}

impl<D: Dim> LsodaOf<D>
where
    DefaultAllocator: Allocator<D> + Allocator<D, D>,
{
    /// After an accepted step: switch the family, or think over step and order, or leave things as
    /// they are.
    fn look_ahead(&mut self, error: f64) {
        self.until_switch_test -= 1;
        if self.until_switch_test < 0
            && let Some(change) = self.consider_switch(error)
        {
            self.statistics.method_switches += 1;
            if self.switches.len() < SWITCHES_KEPT {
                self.switches.push(Switch { t: self.t, to: change.family });
            }
            self.pending = Some(change);
            return;
        }
        self.until_selection -= 1;
        match self.until_selection {
            0 => self.pending = self.select(error, 0),
            1 if self.order < self.family.highest_order() => {
                self.correction_before.copy_from(&self.correction)
            }
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests;
