//! The smooth rule: phi(h(x(t - delay))/eps), by the method of steps.

use nalgebra::{SMatrix, SVector};

use super::past::{Look, Past, shortened};
use super::tangent::{Carry, TangentStepper, square, square_of_past};
use super::{Backwards, DelayError, Delayed, History, ONE_TIME, Sides, is_due, resolves};
use crate::driver::{DriveOptions, Observer, drive};
use crate::guard::{Gates, Redoable, Stage, Stages, Undone};
use crate::roots::CrossingFinder;
use crate::step::{Driven, DrivenStepper, Failure, Flow, Statistics, Step, Stepper, Tolerance};
use crate::{Dopri5, Guarded};
use twofold_num::elementary::sqrt;
use twofold_system::filippov::gradient;
use twofold_system::{Blended, PiecewiseSmooth, Smoothed, Transition, VectorField, jacobian};

/// The stepper of the smooth rule.
pub(super) struct Smooth<'a, P, M, const N: usize> {
    sides: Sides<'a, P>,
    /// The quantity carried along with the orbit.
    carry: Option<&'a dyn Carry<N>>,
    delay: f64,
    transition: Transition,
    eps: f64,
    method: M,
    past: Past<N>,
    /// Ends of steps, in order: jumps of derivatives that arrive, and passages of the delayed orbit
    /// through the layer.
    ends: Vec<f64>,
    /// On which side of the surface the orbit was last.
    passages: CrossingFinder,
    reached: (f64, SVector<f64, N>),
    t_end: f64,
    max_step: f64,
    /// Time at which the method under way ends.
    end: Option<f64>,
    /// The structure that a step may jump over, and the way through what one has.
    gates: Option<Gates>,
    stages: Stages,
    tolerance: Tolerance,
    statistics: Statistics,
    /// Steps that were taken back.
    again: u64,
}

/// A jump of a derivative is seen by a method of order 5 until it is one of the sixth.
const SEEN: u32 = 5;
/// No step is longer than this part of the delay: methods lengthen a last step a little.
const LONGEST: f64 = 0.999;
/// The layer's half-width in eps: tanh differs from 1 by 4e-9 there.
const LAYER: f64 = 10.0;
/// Values of h, in eps, between which transition functions are told apart.
const LEVELS: [f64; 15] =
    [-LAYER, -8.0, -6.0, -4.0, -2.0, -1.0, -0.5, 0.0, 0.5, 1.0, 2.0, 4.0, 6.0, 8.0, LAYER];
/// Parts of a structure of h at which steps end one delay later.
const PARTS: u32 = 16;
/// A change of h smaller than this part of eps ends no step: phi feels it less than any step does.
/// Where h is at rest, rounding turns it in every step, and every turn would end a step one delay
/// later, which would turn again.
const STILL: f64 = 1e-9;
/// Places in a step at which its distance from the layer is looked at.
const LOOKS: usize = 8;

/// The equation while its past is known: a field that depends on time.
struct Weighted<'a, P, const N: usize> {
    system: &'a P,
    carry: Option<&'a dyn Carry<N>>,
    transition: Transition,
    eps: f64,
    delay: f64,
    past: &'a Past<N>,
    /// The end of the stretch under way, up to which the past is looked at from before.
    end: f64,
}

impl<P: PiecewiseSmooth<N>, const N: usize> Weighted<'_, P, N> {
    /// The state one delay ago.
    fn past(&self, t: f64) -> SVector<f64, N> {
        let slack = 2.0 * ONE_TIME * t.abs();
        let look = if is_due(self.end, t) { Look::Before } else { Look::After };
        self.past.at(t - self.delay, look, slack)
    }

    fn under(&self, past: &SVector<f64, N>) -> Blended<'_, P> {
        Blended {
            system: self.system,
            phi: self.transition.eval(self.system.switching(past), self.eps),
        }
    }
}

impl<P: PiecewiseSmooth<N>, const N: usize> Driven<N> for Weighted<'_, P, N> {
    fn eval(&self, t: f64, x: &SVector<f64, N>) -> SVector<f64, N> {
        let past = self.past(t);
        let f = self.under(&past).eval(x);
        match self.carry {
            Some(carry) => f + carry.feedback(x, &past, self.transition, self.eps),
            None => f,
        }
    }
    fn jacobian(&self, t: f64, x: &SVector<f64, N>) -> SMatrix<f64, N, N> {
        jacobian(&self.under(&self.past(t)), x)
    }
}

impl<'a, P: PiecewiseSmooth<N> + Clone, M, const N: usize> Smooth<'a, P, M, N> {
    pub(super) fn new(
        delayed: &Delayed<'a, P, N>,
        ((transition, eps), delay, history): ((Transition, f64), f64, History),
        method: M,
        tolerance: Tolerance,
    ) -> Result<Self, DelayError> {
        let Delayed { sides, x0, .. } = delayed;
        let mut smooth = Self {
            sides: sides.clone(),
            carry: None,
            delay,
            transition,
            eps,
            method,
            past: Past::constant(*x0),
            ends: Vec::new(),
            passages: CrossingFinder::starting(sides.h(x0) > 0.0),
            reached: (0.0, *x0),
            t_end: 0.0,
            max_step: f64::INFINITY,
            end: None,
            gates: Gates::with_switch(
                &sides.fields.each_ref().map(|side| side.tape.clone()),
                &sides.h,
                &LEVELS.map(|level| level * eps),
            ),
            stages: Stages::new(0.0, f64::INFINITY),
            tolerance,
            statistics: Statistics::default(),
            again: 0,
        };
        if history == History::Flow {
            smooth.look_back(tolerance)?;
        }
        for k in 1..=SEEN {
            smooth.end_at(f64::from(k) * delay);
        }
        Ok(smooth)
    }

    /// Carries a disturbance along.
    pub(super) fn carrying(self, carry: &'a dyn Carry<N>) -> Self {
        Self { carry: Some(carry), ..self }
    }

    /// Follows the orbit without delay backwards from the start for one delay.
    fn look_back(&mut self, tolerance: Tolerance) -> Result<(), DelayError> {
        let Self { sides, transition, eps, .. } = self;
        let smoothed =
            Smoothed { system: sides.system.clone(), transition: *transition, eps: *eps };
        let (mut dopri5, mut ends) = (Guarded::new(Dopri5::new(tolerance), tolerance), Vec::new());
        let (past, mut passages) = (&mut self.past, self.passages);
        let mut back = |step: &Step<'_, N>| {
            past.put_before(step);
            ends.extend(in_layer(sides, *eps, &mut passages, step));
        };
        let mut back = Each(&mut back);
        let end = drive(
            &Backwards(&smoothed),
            self.reached.1,
            &DriveOptions::to(self.delay),
            &mut dopri5,
            &mut back,
            &(),
        );
        if let Err(failure) = end {
            return Err(DelayError::NoHistory {
                t: -self.delay,
                what: format!("cannot be followed ({failure})"),
            });
        }
        ends.into_iter().for_each(|t| self.end_at(self.delay - t));
        Ok(())
    }
}

impl<P, M, const N: usize> Smooth<'_, P, M, N> {
    /// A step will end at the time `t`.
    fn end_at(&mut self, t: f64) {
        let index = self.ends.partition_point(|end| *end < t);
        self.ends.insert(index, t);
    }
}

/// An observer that is a function.
struct Each<'a, const N: usize>(&'a mut dyn FnMut(&Step<'_, N>));

impl<const N: usize> Observer<N> for Each<'_, N> {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        (self.0)(step);
        Flow::Continue
    }
}

/// Rounding error of h at `x`, if h is a sum or a product of coordinates.
fn rounding<P: PiecewiseSmooth<N>, const N: usize>(
    sides: &Sides<'_, P>,
    x: &SVector<f64, N>,
) -> f64 {
    if sides.plane.is_some() {
        return 0.0;
    }
    64.0 * f64::EPSILON * gradient(sides.system, x).component_mul(x).abs().sum()
}

/// When the orbit passes the surface in `step`, or comes nearest to it within the layer.
fn in_layer<P: PiecewiseSmooth<N>, const N: usize>(
    sides: &Sides<'_, P>,
    eps: f64,
    passages: &mut CrossingFinder,
    step: &Step<'_, N>,
) -> Vec<f64> {
    let mut times: Vec<f64> =
        sides.passages(passages, step, 0.0).iter().map(|p| step.time(p.theta)).collect();
    let edge = LAYER * eps;
    let (h0, h1) = (sides.h(&step.x0), sides.h(&step.x1));
    let is_far = |i: usize| h0.abs().min(h1.abs()) - step.interpolant.reach(i) > edge;
    if sides.plane.is_some_and(|i| (h0 > 0.0) == (h1 > 0.0) && is_far(i)) {
        return times;
    }
    let fraction = |k: usize| k as f64 / LOOKS as f64;
    let looks: [f64; LOOKS + 1] = std::array::from_fn(|k| sides.h(&step.at(fraction(k))));
    let still = (STILL * eps).max(rounding(sides, &step.x0));
    if looks.iter().all(|h| h.abs() <= still) {
        return Vec::new();
    }
    for k in 1..LOOKS {
        let [a, b, c] = [looks[k - 1], looks[k], looks[k + 1]].map(f64::abs);
        let one_side = looks[k - 1] * looks[k] > 0.0 && looks[k] * looks[k + 1] > 0.0;
        if one_side && b <= a && b <= c && a.max(c) - b > still {
            // The vertex of the parabola through the three.
            let (slope, bend) = (0.5 * (c - a), c - 2.0 * b + a);
            let shift = if bend > 0.0 { (-slope / bend).clamp(-1.0, 1.0) } else { 0.0 };
            if b + 0.5 * slope * shift <= edge {
                times.push(step.time(fraction(k) + shift / LOOKS as f64));
            }
        }
    }
    times
}

impl<P: PiecewiseSmooth<N>, M: DrivenStepper<N> + Redoable<N>, const N: usize> Smooth<'_, P, M, N> {
    fn advance(&mut self) -> Result<(), Failure> {
        let t = self.reached.0;
        while self.ends.first().is_some_and(|end| is_due(*end, t)) {
            self.ends.remove(0);
            self.end = None;
        }
        let next =
            self.ends.first().copied().filter(|end| self.t_end - end > ONE_TIME * self.t_end);
        let end = next.unwrap_or(self.t_end);
        let Self {
            sides,
            carry,
            delay,
            transition,
            eps,
            past,
            method,
            gates,
            stages,
            tolerance,
            again,
            ..
        } = self;
        let (system, carry) = (sides.system, *carry);
        let field = Weighted {
            system,
            carry,
            transition: *transition,
            eps: *eps,
            delay: *delay,
            past,
            end,
        };
        if self.end != Some(end) {
            let longest = self.max_step.min(LONGEST * *delay);
            method.restart_driven(&field, t, self.reached.1, end, longest)?;
            (self.end, *stages) = (Some(end), Stages::new(end, longest));
        }
        if stages.end_at(t) {
            let Stage { end, max_step } = stages.now();
            method.restart_driven(&field, t, self.reached.1, end, max_step)?;
        }
        let mut late = Vec::new();
        let step = loop {
            let step = method.step_driven(&field)?;
            let Step { t0, t1, x0, x1, .. } = step;
            let undone = gates.as_mut().map_or(Ok(None), |g| g.missed(&step, *tolerance))?;
            if !undone.map_or(Ok(false), |undone| stages.take_back((t0, &x0), undone))? {
                break Step { t0, t1, x0, x1, interpolant: method.last() };
            }
            *again += 1;
            if let Some(Undone::Structure([from, to])) = undone {
                let part = (to - from) / f64::from(PARTS);
                late.extend((0..=PARTS).map(|k| from + f64::from(k) * part));
            }
            let Stage { end, max_step } = stages.now();
            method.restart_driven(&field, t0, x0, end, max_step)?;
        };
        sides.fields.iter().try_for_each(|side| step.stays_in_domain(side.ends.as_ref()))?;
        let times = in_layer(sides, *eps, &mut self.passages, &step);
        self.reached = (step.t1, step.x1);
        self.past.put(&step, step.t1 - 1.5 * self.delay);
        times.into_iter().chain(late).for_each(|t| self.end_at(t + self.delay));
        Ok(())
    }
}

impl<P: PiecewiseSmooth<N>, M: DrivenStepper<N> + Redoable<N>, const N: usize> Stepper<N>
    for Smooth<'_, P, M, N>
{
    fn restart<F: VectorField<N>>(
        &mut self,
        _: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        resolves(self.delay, t, &x, t_end)?;
        // The past stays: it is part of the equation's state, not of the method's. A jump of the
        // state is one of the field a delay later, and of each next derivative at each next delay.
        if t > 0.0 && x != self.reached.1 {
            for k in 1..=SEEN + 1 {
                self.end_at(t + f64::from(k) * self.delay);
            }
            self.passages = CrossingFinder::starting(self.sides.h(&x) > 0.0);
        }
        (self.reached, self.t_end, self.max_step, self.end) = ((t, x), t_end, max_step, None);
        Ok(())
    }

    fn step<F: VectorField<N>>(&mut self, _: &F) -> Result<Step<'_, N>, Failure> {
        let (t0, x0) = self.reached;
        self.advance().map_err(|failure| self.sides.diagnosed(failure, [true; 2]))?;
        let (t1, x1) = self.reached;
        self.statistics = self.method.statistics().clone();
        self.statistics.steps -= self.again;
        self.statistics.rejected += self.again;
        Ok(Step { t0, t1, x0, x1, interpolant: self.method.last() })
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}

impl<P: PiecewiseSmooth<N>, M: DrivenStepper<N> + Redoable<N>, const N: usize> TangentStepper<N>
    for Smooth<'_, P, M, N>
{
    fn reached(&self) -> (f64, SVector<f64, N>) {
        self.reached
    }

    fn length(&self) -> f64 {
        let (t, x) = &self.reached;
        sqrt(square(x) + square_of_past(&self.past, *t, self.delay))
    }

    fn shorten(&mut self, by: f64) {
        self.reached.1 = shortened(&self.reached.1, by);
        self.past.shorten(by);
    }
}
