//! The nouns every method shares: an accepted step with its interpolant, tolerances, statistics,
//! failures.

use std::sync::Arc;

use nalgebra::{SMatrix, SVector};
use serde::{Deserialize, Serialize};

use twofold_num::{Short, Tape};
use twofold_system::singular::{Ends, undefined};
use twofold_system::{VectorField, jacobian};

/// Continuous extension of a method over one step (dense output).
pub trait Interpolant<const N: usize> {
    /// The state at the fraction `theta` of the step, in [0, 1].
    fn at(&self, theta: f64) -> SVector<f64, N>;
    /// One coordinate of that state, to the same bits.
    fn coordinate(&self, theta: f64, coordinate: usize) -> f64 {
        self.at(theta)[coordinate]
    }
    /// The degree of the interpolant as a polynomial in `theta`.
    fn degree(&self) -> usize;
    /// A bound, up to rounding, on how far the coordinate leaves the range between its values at
    /// the step's two ends. Infinite where no cheap one is known.
    fn reach(&self, _coordinate: usize) -> f64 {
        f64::INFINITY
    }
    /// The Bernstein coefficients, less the state at the start, of an interpolant that is a
    /// polynomial of degree 4 or less.
    fn bernstein(&self) -> Option<[SVector<f64, N>; 5]> {
        None
    }
    /// A bound, up to rounding and the error of the step, on how far the coordinate leaves the
    /// chord between the step's two ends.
    fn bend(&self, coordinate: usize) -> f64 {
        self.reach(coordinate)
    }
    /// Whether the coordinate is known to grow all along the step, or to fall all along it.
    fn is_monotone(&self, _coordinate: usize) -> bool {
        false
    }
}

/// One accepted step from (t0, x0) to (t1, x1).
#[derive(Clone, Copy)]
pub struct Step<'a, const N: usize> {
    /// Time at the start.
    pub t0: f64,
    /// Time at the end.
    pub t1: f64,
    /// State at the start.
    pub x0: SVector<f64, N>,
    /// State at the end.
    pub x1: SVector<f64, N>,
    /// The continuous extension between them.
    pub interpolant: &'a dyn Interpolant<N>,
}

impl<const N: usize> Step<'_, N> {
    /// End of an equation's domain in the step, as a fraction, and the operation that has no value
    /// there.
    pub(crate) fn domain_end(&self, ends: &Ends) -> Option<(f64, String)> {
        ends.first(&|theta| self.at(theta).as_slice().to_vec(), &[0.0, 0.25, 0.5, 0.75, 1.0])
    }

    /// The end of the domain in the step as a failure.
    pub(crate) fn stays_in_domain(&self, ends: Option<&Ends>) -> Result<(), Failure> {
        match ends.and_then(|ends| self.domain_end(ends)) {
            None => Ok(()),
            Some((theta, what)) => Err(Failure::Undefined {
                t: self.time(theta),
                state: Failure::state(&self.at(theta)),
                what,
            }),
        }
    }

    /// The state at the fraction `theta` of the step; exactly `x0` at 0 and `x1` at 1.
    pub fn at(&self, theta: f64) -> SVector<f64, N> {
        if theta <= 0.0 {
            self.x0
        } else if theta >= 1.0 {
            self.x1
        } else {
            self.interpolant.at(theta)
        }
    }

    /// One coordinate of the state at the fraction `theta`: [`Step::at`]'s, to the same bits.
    pub fn coordinate(&self, theta: f64, coordinate: usize) -> f64 {
        if theta <= 0.0 {
            self.x0[coordinate]
        } else if theta >= 1.0 {
            self.x1[coordinate]
        } else {
            self.interpolant.coordinate(theta, coordinate)
        }
    }

    /// The time at the fraction `theta` of the step.
    pub fn time(&self, theta: f64) -> f64 {
        if theta >= 1.0 { self.t1 } else { self.t0 + theta * (self.t1 - self.t0) }
    }

    /// The length of the step in time.
    pub fn length(&self) -> f64 {
        self.t1 - self.t0
    }
}

/// Local error control: a component's error is measured against `atol + rtol |x|`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// Relative tolerance.
    pub rtol: f64,
    /// Absolute tolerance.
    pub atol: f64,
}

/// A one-step-at-a-time method.
pub trait Stepper<const N: usize> {
    /// Starts afresh at (t, x) towards `t_end` with steps no longer than `max_step`. Everything
    /// learnt before (step size, order, saved derivatives, factorised Jacobians) is forgotten; only
    /// [`Statistics`] go on counting.
    ///
    /// # Errors
    ///
    /// [`Failure`]: the field is not finite at `x`, or no first step can be found.
    fn restart<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure>;

    /// [`Stepper::restart`] with the field of the last restart: what a method has found out about
    /// the equation itself still holds.
    ///
    /// # Errors
    ///
    /// As of [`Stepper::restart`].
    fn restart_again<F: VectorField<N>>(
        &mut self,
        field: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        self.restart(field, t, x, t_end, max_step)
    }

    /// Makes one accepted step. Never passes `t_end`; the step that reaches it has `t1 == t_end`
    /// exactly. Must not be called again after that without [`Stepper::restart`].
    ///
    /// # Errors
    ///
    /// [`Failure`]: the step shrank below rounding, an iteration did not converge, or the state is
    /// no longer finite. The stepper must be restarted before it is used again.
    fn step<F: VectorField<N>>(&mut self, field: &F) -> Result<Step<'_, N>, Failure>;

    /// Work of the method since it was made.
    fn statistics(&self) -> &Statistics;
}

/// A right-hand side that depends on time, x' = f(t, x); methods call it without knowing which it
/// is, so that each is compiled once a dimension.
pub(crate) trait Driven<const N: usize> {
    /// f(t, x).
    fn eval(&self, t: f64, x: &SVector<f64, N>) -> SVector<f64, N>;
    /// The Jacobian matrix df/dx at (t, x).
    fn jacobian(&self, t: f64, x: &SVector<f64, N>) -> SMatrix<f64, N, N>;
}

/// A field that does not depend on time.
pub(crate) struct Steady<'a, F>(pub(crate) &'a F);

impl<F: VectorField<N>, const N: usize> Driven<N> for Steady<'_, F> {
    #[inline(always)]
    fn eval(&self, _: f64, x: &SVector<f64, N>) -> SVector<f64, N> {
        self.0.eval(x)
    }
    #[inline(always)]
    fn jacobian(&self, _: f64, x: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        jacobian(self.0, x)
    }
}

/// A one-step method for right-hand sides that depend on time: [`Stepper::restart`] and
/// [`Stepper::step`] for them.
pub(crate) trait DrivenStepper<const N: usize>: Stepper<N> {
    /// [`Stepper::restart`].
    fn restart_driven(
        &mut self,
        field: &dyn Driven<N>,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure>;
    /// [`Stepper::step`].
    fn step_driven(&mut self, field: &dyn Driven<N>) -> Result<Step<'_, N>, Failure>;
}

/// Work done by a method. Counts that a method does not have stay zero.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Statistics {
    /// Accepted steps.
    pub steps: u64,
    /// Steps rejected by the error test.
    pub rejected: u64,
    /// Evaluations of the right-hand side, without those made for Jacobians.
    pub evaluations: u64,
    /// Jacobian evaluations.
    pub jacobians: u64,
    /// LU factorisations.
    pub factorisations: u64,
    /// Corrector iterations that failed to converge.
    pub convergence_failures: u64,
    /// Changes between the non-stiff and the stiff family.
    pub method_switches: u64,
    /// Accepted steps made by the stiff family.
    pub stiff_steps: u64,
    /// Starts and restarts.
    pub restarts: u64,
    /// The highest order used.
    pub highest_order: u64,
}

impl std::ops::AddAssign<&Statistics> for Statistics {
    /// Counts add; the highest order is the higher one.
    fn add_assign(&mut self, more: &Statistics) {
        let Statistics {
            steps,
            rejected,
            evaluations,
            jacobians,
            factorisations,
            convergence_failures,
            method_switches,
            stiff_steps,
            restarts,
            highest_order,
        } = more;
        self.steps += steps;
        self.rejected += rejected;
        self.evaluations += evaluations;
        self.jacobians += jacobians;
        self.factorisations += factorisations;
        self.convergence_failures += convergence_failures;
        self.method_switches += method_switches;
        self.stiff_steps += stiff_steps;
        self.restarts += restarts;
        self.highest_order = self.highest_order.max(*highest_order);
    }
}

/// Whether an observer wants more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Flow {
    /// Go on.
    Continue,
    /// Stop after this step.
    Stop,
}

/// Why a run ended. It is part of every summary, so that a run cut short is never taken for a whole
/// one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum StopReason {
    /// The end time was reached.
    EndTime,
    /// The observer asked to stop: it has what it wanted.
    Observer,
    /// The monitor asked to stop: the user interrupted the run.
    #[serde(rename = "watch")]
    Cancelled,
    /// The budget of steps is used up.
    StepBudget,
    /// The future is a set and nothing says which member to follow (Filippov motion only).
    SetValued,
}

/// Why an integration could not go on. Each names the time and the state; the caller adds the run's
/// name.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The state or the right-hand side is infinite or not a number.
    #[error(
        "the right-hand side or the state is no longer finite at t = {t}, state {state:?}: check \
            the parameters and the start",
        t = Short(*t)
    )]
    NotFinite {
        /// Time of the last good state.
        t: f64,
        /// The last good state.
        state: Vec<f64>,
    },
    /// The orbit came to a place where the equation has no value.
    #[error(
        "the orbit comes to the end of the field's domain at t = {t}, state {state:?}: {what}; \
            change the expression, or end the run before (--t-end)",
        t = Short(*t)
    )]
    Undefined {
        /// Time of the last good state.
        t: f64,
        /// The last good state.
        state: Vec<f64>,
        /// The part of the equation that has no value.
        what: String,
    },
    /// The solution ends in finite time, or beyond the range of numbers.
    #[error(
        "the solution grows without bound near t = {t}, state {state:?}: end the run before \
            (--t-end)",
        t = Short(*t)
    )]
    Unbounded {
        /// When.
        t: f64,
        /// The last state.
        state: Vec<f64>,
    },
    /// A method that needs smooth equations has come to a place where this one is not.
    #[error(
        "the equation is not smooth at t = {t}, state {state:?}: {what}; a series cannot go on \
            there: use --method dopri5, lsoda or radau5, or make the argument the switching \
            function h",
        t = Short(*t)
    )]
    NotSmooth {
        /// When.
        t: f64,
        /// The state.
        state: Vec<f64>,
        /// The part of the equation that is not smooth.
        what: String,
    },
    /// A jump of the equation attracts the motion from both sides.
    #[error(
        "the motion stays on the jump of {what} from t = {t} on, state {state:?}, where the \
            equation has no value to go on with: make the argument the switching function h \
            (--switch filippov), or write the system as f = [...] alone, which is followed there",
        t = Short(*t)
    )]
    StaysOnJump {
        /// From when on.
        t: f64,
        /// The state there.
        state: Vec<f64>,
        /// The function that jumps.
        what: String,
    },
    /// The step became too small to advance time.
    #[error(
        "step size underflow ({h:e}) at t = {t}, state {state:?}: the tolerances ask for more than \
            f64 can give here; loosen them (--rtol, --atol) or compare with another --method",
        t = Short(*t)
    )]
    StepUnderflow {
        /// Time reached.
        t: f64,
        /// The step that was asked for.
        h: f64,
        /// State reached.
        state: Vec<f64>,
    },
    /// The budget of steps is used up.
    #[error(
        "{limit} steps were not enough: stopped at t = {t}, state {state:?}. If the last steps \
            were tiny, the equation is stiff or not smooth there: compare with another --method; \
            otherwise raise the limit of steps (--max-steps)",
        t = Short(*t)
    )]
    TooManySteps {
        /// Time reached.
        t: f64,
        /// The limit.
        limit: u64,
        /// State reached.
        state: Vec<f64>,
    },
    /// The method is made for another kind of equation.
    #[error("the method {method} cannot integrate this equation: {why}; take another method")]
    NotApplicable {
        /// The method's name.
        method: &'static str,
        /// The reason, in words.
        why: String,
    },
    /// An implicit method's nonlinear equations could not be solved even with tiny steps.
    #[error(
        "the implicit equations did not converge at t = {t}, step {h:e}, state {state:?}: the \
            right-hand side is too rough for this method; compare with another --method",
        t = Short(*t)
    )]
    NotConverged {
        /// Time reached.
        t: f64,
        /// The step that was tried last.
        h: f64,
        /// State reached.
        state: Vec<f64>,
    },
}

impl Failure {
    /// The failure with its cause, as far as the equation on `tape` shows it: a place where it has
    /// no value, or a solution that grows without bound.
    pub fn diagnosed(self, tape: &Tape) -> Self {
        self.diagnosed_along(tape, None)
    }

    /// The same where the motion has another velocity than the equation's own, as sliding has.
    pub(crate) fn diagnosed_along(self, tape: &Tape, velocity: Option<&[f64]>) -> Self {
        let (t, state, far) = match &self {
            Self::NotFinite { t, state } => (*t, state.clone(), 1.0),
            // Steps were found too long for another reason, perhaps: only what is near is to blame.
            Self::StepUnderflow { t, state, .. } | Self::NotConverged { t, state, .. } => {
                (*t, state.clone(), 1e-3)
            }
            Self::NotSmooth { t, state, .. } => (*t, state.clone(), 1e-6),
            _ => return self,
        };
        if state.len() != tape.variables() || state.iter().any(|x| !x.is_finite()) {
            return self;
        }
        if let (Some(what), false) =
            (undefined(tape, &state), matches!(self, Self::NotSmooth { .. }))
        {
            return Self::Undefined { t, state, what };
        }
        let field = |x: &[f64]| -> Vec<f64> {
            let values = tape.values(x);
            tape.outputs().iter().map(|node| values[*node]).collect()
        };
        let derivative = velocity.map_or_else(|| field(&state), <[f64]>::to_vec);
        let ahead = |time: f64| -> Vec<f64> {
            state.iter().zip(&derivative).map(|(x, f)| x + time * f).collect()
        };
        // The component that grows fastest, in its own size.
        let growth = |x: &[f64], f: &[f64]| {
            x.iter().zip(f).map(|(x, f)| if *x == 0.0 { 0.0 } else { f / x }).fold(0.0, f64::max)
        };
        let rate = growth(&state, &derivative);
        let size = state.iter().fold(0.0_f64, |a, x| a.max(x.abs()));
        let scale = 1.0 + t.abs();
        // Faster in each of so many growths by a half, or until it is nearly beyond the numbers.
        let accelerates = |growths: usize| {
            let (mut x, mut f, mut rate) = (state.clone(), derivative.clone(), rate);
            (0..growths).all(|_| {
                if rate > HUGE {
                    return true;
                }
                x.iter_mut().zip(&f).for_each(|(x, f)| *x += 0.5 / rate * f);
                f = field(&x);
                let before = std::mem::replace(&mut rate, growth(&x, &f));
                rate > 1.2 * before
            })
        };
        let unbounded = size > HUGE
            || size > 1e3 && rate * scale > 1e3 && accelerates(1)
            || rate * scale > AT_ONCE && accelerates(LONG);
        // Powers of 2 times the spacing of numbers. What grows without bound comes to the end of
        // some domain, too, but later.
        let last = if unbounded { (GROWTHS / rate).min(far * scale) } else { far * scale };
        let next = |time: &f64| Some(2.0 * time).filter(|time| *time < 2.0 * last);
        let places: Vec<f64> = std::iter::successors(Some(1e-16 * scale), next).collect();
        let ends = Ends::new(Arc::new(tape.clone()));
        let end = ends.and_then(|ends| {
            let first = ends.first(&ahead, &[&[0.0], &places[..]].concat());
            // One just behind was stepped over.
            first.or_else(|| ends.first(&|time| ahead(-time), &[0.0, BEHIND * scale]))
        });
        match end {
            Some((_, what)) => Self::Undefined { t, state, what },
            None if unbounded && !matches!(self, Self::NotSmooth { .. }) => {
                Self::Unbounded { t: t + 1.0 / rate, state }
            }
            None => self,
        }
    }

    /// The failure of an orbit of `n` states alone, without what is integrated beside them.
    pub fn of_states(mut self, n: usize) -> Self {
        if let Some((_, state)) = self.place() {
            state.truncate(n);
        }
        self
    }

    /// The time and the state that it names.
    pub(crate) fn place(&mut self) -> Option<(&mut f64, &mut Vec<f64>)> {
        match self {
            Self::NotFinite { t, state }
            | Self::Undefined { t, state, .. }
            | Self::Unbounded { t, state }
            | Self::NotSmooth { t, state, .. }
            | Self::StaysOnJump { t, state, .. }
            | Self::StepUnderflow { t, state, .. }
            | Self::TooManySteps { t, state, .. }
            | Self::NotConverged { t, state, .. } => Some((t, state)),
            Self::NotApplicable { .. } => None,
        }
    }

    /// The state as the errors carry it.
    pub fn state<const N: usize>(x: &SVector<f64, N>) -> Vec<f64> {
        x.iter().copied().collect()
    }
}

/// A number of this size is on its way out of the numbers.
const HUGE: f64 = 1e100;
/// Growths of a state by itself in a time of 1 + t that leave no steps to be made, whatever its
/// size is; and in how many of them by a half a solution that ends there accelerates.
const AT_ONCE: f64 = 1e10;
const LONG: usize = 20;
/// In so many times of its growth a solution that grows without bound beside the end of a domain
/// comes there.
const GROWTHS: f64 = 20.0;
/// Part of 1 + t in which a method may have stepped over the end of a domain.
const BEHIND: f64 = 1e-12;

/// Whether a step of `h` from `t` is the last one before `t_end`: made longer by the factor `share`
/// it would reach it, or it leaves so little that no step can be made of it.
pub(crate) fn is_last(t: f64, h: f64, t_end: f64, share: f64) -> bool {
    let t1 = t + h;
    h * share >= t_end - t || t_end - t1 <= t1.abs() * f64::EPSILON
}

/// Whether every component is finite.
pub(crate) fn finite<const N: usize>(x: &SVector<f64, N>) -> bool {
    x.iter().all(|v| v.is_finite())
}

#[cfg(test)]
mod tests {
    use nalgebra::Vector2;

    use super::*;
    use twofold_num::tape::Recorded;
    use twofold_num::{Arithmetic, Elementary};

    #[test]
    fn work_adds_up() {
        let work = |first: u64| Statistics {
            steps: first,
            rejected: first + 1,
            evaluations: first + 2,
            jacobians: first + 3,
            factorisations: first + 4,
            convergence_failures: first + 5,
            method_switches: first + 6,
            stiff_steps: first + 7,
            restarts: first + 8,
            highest_order: first % 7,
        };
        for (a, b) in [(100, 20), (20, 100)] {
            let mut sum = work(a);
            sum += &work(b);
            let all = Statistics {
                steps: 120,
                rejected: 122,
                evaluations: 124,
                jacobians: 126,
                factorisations: 128,
                convergence_failures: 130,
                method_switches: 132,
                stiff_steps: 134,
                restarts: 136,
                highest_order: 6,
            };
            assert_eq!(sum, all);
        }
    }

    /// exp(x), 1 + exp(x/3) and x^2 leave the numbers; the others have a bound, however fast they
    /// come to it.
    #[test]
    fn what_grows_without_bound_is_told_from_what_is_fast() {
        type Right = fn(Recorded, fn(f64) -> Recorded) -> Recorded;
        let cases: [(Right, f64, bool); 8] = [
            (|x, _| x.exp(), 36.0, true),
            (|x, c| c(1.0) + (x / c(3.0)).exp(), 105.0, true),
            // Mixed as a smooth switch mixes fields: beyond the numbers infinities cancel.
            (|x, c| x.exp() + (x.exp() - x.exp()) * c(0.5), 36.0, true),
            (|x, _| x * x, 1e14, true),
            (|x, c| c(1e16) * x * x, 1e-3, true),
            (|x, c| c(1e16) * x * x * (c(1.0) - x), 1e-3, false),
            (|x, c| c(1e16) * (c(1.0) - x), 0.5, false),
            (|x, c| c(1e16) * x.sin(), 36.0, false),
        ];
        for (k, (f, x, wanted)) in cases.into_iter().enumerate() {
            let tape = Tape::record(1, |x| vec![f(x[0], Recorded::from_f64)]);
            let failure = Failure::StepUnderflow { t: 0.6, h: 1e-16, state: vec![x] };
            let found = failure.diagnosed(&tape);
            assert_eq!(matches!(found, Failure::Unbounded { .. }), wanted, "{k}: {found:?}");
        }
    }

    /// t^2 and -t over [0, 1]; wrong at both ends, which a step knows better.
    struct Wrong;
    impl Interpolant<2> for Wrong {
        fn at(&self, theta: f64) -> SVector<f64, 2> {
            Vector2::new(theta * theta + 0.125, -theta)
        }
        fn degree(&self) -> usize {
            2
        }
    }

    #[test]
    fn a_step_has_its_own_ends() {
        let step = Step {
            t0: 3.0,
            t1: 5.0,
            x0: Vector2::new(0.0, 0.0),
            x1: Vector2::new(1.0, -1.0),
            interpolant: &Wrong,
        };
        assert_eq!(
            (step.length(), step.time(0.0), step.time(0.25), step.time(1.0)),
            (2.0, 3.0, 3.5, 5.0)
        );
        for (theta, want) in [
            (-0.5, [0.0, 0.0]),
            (0.0, [0.0, 0.0]),
            (0.5, [0.375, -0.5]),
            (1.0, [1.0, -1.0]),
            (1.5, [1.0, -1.0]),
        ] {
            assert_eq!(step.at(theta), SVector::from(want));
            assert_eq!([0, 1].map(|i| step.coordinate(theta, i)), want);
        }
        // 0.1 + 1 (0.3 - 0.1) is not 0.3.
        let step = Step { t0: 0.1, t1: 0.3, ..step };
        assert_eq!(step.time(1.0), 0.3);
        // An interpolant that says nothing of itself is not thought to be near, nor to be monotone.
        assert!(Wrong.reach(0) == f64::INFINITY && !Wrong.is_monotone(0));
        assert!(
            finite(&Vector2::new(1.0, -2.0))
                && !finite(&Vector2::new(1.0, f64::NAN))
                && !finite(&Vector2::new(f64::INFINITY, 0.0))
        );
        assert_eq!(Failure::state(&Vector2::new(1.0, 2.0)), [1.0, 2.0]);
    }
}
