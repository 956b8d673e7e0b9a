//! The sharp rule, f+ while h(x(t - delay)) > 0, f- otherwise, and the relay, f+ until h falls to
//! -band, f- until it rises to band.

use std::collections::VecDeque;

use nalgebra::SVector;

use super::past::shortened;
use super::tangent::{Carry, Shift, TangentStepper, square};
use super::{
    Backwards, DelayError, Delayed, History, LEAST_DELAY, LateSwitch, ONE_TIME, Sides, is_due,
    resolves,
};
use crate::guard::{Gates, Undone, longest_towards};
use crate::roots::{Crossing, CrossingFinder};
use crate::step::{Failure, Statistics, Step, Stepper, Tolerance};
use crate::taylor::Cuttable;
use crate::taylor::Precision;
use twofold_num::elementary::sqrt;
use twofold_num::{Arithmetic, Scalar};
use twofold_system::filippov::lie_derivatives;
use twofold_system::{PiecewiseSmooth, VectorField};

/// A mode that the switch will have.
#[derive(Clone, Copy, Debug)]
struct Coming<S> {
    /// From when on.
    at: S,
    plus: bool,
    /// The effect of a disturbance on it.
    shift: Shift,
}

/// The stepper of the sharp rule, which has one method for each mode. A relay is one whose passages
/// are those of the band's far edge, and switch at once.
pub(super) struct Sharp<'a, P, M: Cuttable<N>, const N: usize> {
    sides: Sides<'a, P>,
    /// The quantity carried along with the orbit.
    carry: Option<&'a dyn Carry<N>>,
    /// Zero for a relay.
    delay: f64,
    /// Zero for a delayed switch.
    band: f64,
    methods: [M; 2],
    /// Whether the method has met its field.
    met: [bool; 2],
    /// Time and state reached.
    reached: (M::Number, SVector<M::Number, N>),
    plus: bool,
    /// Switches that are known to come, in their order.
    queue: VecDeque<Coming<M::Number>>,
    /// On which side of the surface, or of the band's far edge, the orbit was last.
    positive: bool,
    t_end: f64,
    max_step: f64,
    /// Time at which the method under way ends, if it goes on.
    end: Option<M::Number>,
    /// Since when the present mode lasts, and how long each lasted before.
    since: f64,
    lasted: [f64; 2],
    statistics: Statistics,
    /// Steps, and steps made again.
    steps: u64,
    again: u64,
    /// The structure of the switching function that a step may jump over.
    gates: Option<Gates>,
}

/// A step that was cut to less than this part of itself is made again, shorter, by a method whose
/// dense output is less exact than its steps.
const KEPT: f64 = 0.5;
/// So much longer than need be a step is asked to be.
const LONGER: f64 = 1.02;
/// First guess of the longest duration of a mode, relative to the time before.
const AS_BEFORE: f64 = 1.25;

impl<'a, P: PiecewiseSmooth<N> + Clone, M: Cuttable<N>, const N: usize> Sharp<'a, P, M, N> {
    pub(super) fn new(delayed: &Delayed<'a, P, N>, methods: [M; 2]) -> Result<Self, DelayError> {
        let Delayed { sides, switch, x0 } = delayed;
        let h = sides.h(x0);
        let (delay, band, history, positive) = match *switch {
            LateSwitch::Delayed { delay, history, .. } => (delay, 0.0, history, h > 0.0),
            LateSwitch::Relay { band, inside } => {
                (0.0, band, History::Constant, inside.begins_with_plus(h, band))
            }
        };
        let mut sharp = Self {
            reached: methods[0].exactly(0.0, *x0),
            sides: sides.clone(),
            carry: None,
            delay,
            band,
            methods,
            met: [false; 2],
            plus: positive,
            queue: VecDeque::new(),
            positive,
            t_end: 0.0,
            max_step: f64::INFINITY,
            end: None,
            since: 0.0,
            lasted: [f64::INFINITY; 2],
            statistics: Statistics::default(),
            steps: 0,
            again: 0,
            gates: Gates::with_switch(&[], &sides.h, &[-band, band]),
        };
        if history == History::Flow {
            sharp.look_back()?;
        }
        Ok(sharp)
    }

    /// With these switches to come, having just passed the surface.
    #[cfg(test)]
    pub(super) fn with_queue(mut self, plus: bool, positive: bool, queue: &[(f64, bool)]) -> Self {
        let coming = |(at, plus): &(f64, bool)| Coming {
            at: M::Number::from_f64(*at),
            plus: *plus,
            shift: Shift::default(),
        };
        self.queue = queue.iter().map(coming).collect();
        (self.plus, self.positive) = (plus, positive);
        self
    }

    /// Carries a disturbance along.
    pub(super) fn carrying(self, carry: &'a dyn Carry<N>) -> Self {
        Self { carry: Some(carry), ..self }
    }
}

impl<P: PiecewiseSmooth<N>, M: Cuttable<N>, const N: usize> Sharp<'_, P, M, N> {
    /// Follows the orbit without delay backwards from the start for one delay: the switches that
    /// its passages cause, and the first mode.
    fn look_back(&mut self) -> Result<(), DelayError> {
        let none = |t: f64, what: String| DelayError::NoHistory { t: 0.0 - t, what };
        let delay = M::Number::from_f64(self.delay);
        let mut from = self.reached;
        let (x0, mut positive) = (from.1.map(M::Number::to_f64), self.positive);
        if self.sides.h(&x0) == 0.0 {
            positive = !self
                .crosses(&x0)
                .ok_or_else(|| none(0.0, "is on the surface where it may slide".into()))?;
        }
        let mut crossed_at: Option<f64> = None;
        while !is_due(self.delay, from.0.to_f64()) {
            let field = Backwards(self.sides.field(positive));
            let method = &mut self.methods[usize::from(positive)];
            let failed =
                |failure: Failure| none(from.0.to_f64(), format!("cannot be followed ({failure})"));
            method.begin(&field, from, delay, f64::INFINITY, false).map_err(failed)?;
            let mut passages = CrossingFinder::starting(positive);
            let next = loop {
                let method = &mut self.methods[usize::from(positive)];
                method.advance(&field).map_err(failed)?;
                let step = method.last();
                let found = self.sides.passages(&mut passages, &step, 0.0);
                // Of the passage that it has just come from it must not be seen again.
                let is_new = |theta: f64| {
                    crossed_at.is_none_or(|t| step.time(theta) - t > SAME_PASSAGE * self.delay)
                };
                if let Some(passage) = found.into_iter().find(|p| is_new(p.theta)) {
                    let at = self.refined(positive, passage.theta);
                    let method = &mut self.methods[usize::from(positive)];
                    method.cut(at);
                    break Some(method.reached());
                }
                if is_due(self.delay, method.reached().0.to_f64()) {
                    break None;
                }
            };
            let Some((t, x)) = next else { break };
            let point = x.map(M::Number::to_f64);
            if self.crosses(&point) != Some(positive) {
                return Err(none(
                    t.to_f64(),
                    "comes to a part of the surface that is not crossed".into(),
                ));
            }
            self.queue.push_front(Coming {
                at: delay - t,
                plus: positive,
                shift: Shift::default(),
            });
            positive = !positive;
            (from, crossed_at) = ((t, x), Some(t.to_f64()));
        }
        self.plus = positive;
        Ok(())
    }

    /// The value of h whose passage matters next.
    fn edge(&self) -> f64 {
        if self.positive { -self.band } else { self.band }
    }

    /// Whether orbits cross the surface at `x` upwards; `None` where they do not cross.
    fn crosses(&self, x: &SVector<f64, N>) -> Option<bool> {
        let (p, q) = lie_derivatives(self.sides.system, x);
        if p > 0.0 && q > 0.0 {
            Some(true)
        } else if p < 0.0 && q < 0.0 {
            Some(false)
        } else {
            None
        }
    }

    /// The time at which h passes the edge near the fraction `theta` of the last step, in the
    /// method's numbers: by the secant method.
    fn refined(&self, plus: bool, theta: f64) -> M::Number {
        let method = &self.methods[usize::from(plus)];
        let (from, to) = (method.start(), method.reached().0);
        let time = |theta: M::Number| from + (to - from) * theta;
        let first = M::Number::from_f64(theta);
        if M::Number::EPSILON >= f64::EPSILON {
            return time(first);
        }
        let edge = M::Number::from_f64(self.edge());
        let h =
            |theta: M::Number| self.sides.h.evaluate_decimal(method.at(theta).as_slice())[0] - edge;
        let mut a = M::Number::from_f64(if theta > 0.5 { theta - NEAR } else { theta + NEAR });
        let (mut b, mut ha, mut hb) = (first, h(a), h(first));
        for _ in 0..8 {
            if hb == M::Number::zero() || ha == hb {
                break;
            }
            let next = b - hb * (b - a) / (hb - ha);
            if (next - first).to_f64().abs().is_nan() || (next - first).to_f64().abs() > NEAR {
                return time(first);
            }
            (a, ha) = (b, hb);
            (b, hb) = (next, h(next));
        }
        time(b)
    }

    /// The effect of a disturbance on a passage at the fraction `theta` of the last step.
    fn shift(&self, theta: f64) -> Shift {
        let at = || self.methods[usize::from(self.plus)].last().at(theta);
        self.carry.map_or_else(Shift::default, |carry| carry.shift(&at(), self.plus))
    }

    /// Passages of the edge in the last step. An orbit that begins the step beyond the edge has
    /// passed it: where a passage and a switch come at one time, rounding may put it behind the end
    /// of the step before.
    fn passages(&self) -> Vec<Crossing> {
        let step = self.methods[usize::from(self.plus)].last();
        let mut found =
            self.sides.passages(&mut CrossingFinder::starting(self.positive), &step, self.edge());
        let beyond = self.sides.h(&step.x0) - self.edge();
        if beyond != 0.0 && (beyond > 0.0) != self.positive {
            found.insert(0, Crossing { theta: 0.0, upward: !self.positive });
        }
        found
    }

    /// Begins where the orbit has come to, towards the next switch or the end.
    fn begin(&mut self, longest: f64) -> Result<(), Failure> {
        let i = usize::from(self.plus);
        let t_end = M::Number::from_f64(self.t_end);
        // A switch that is at the end for a step is left for what comes then.
        let next = self
            .queue
            .front()
            .map(|next| next.at)
            .filter(|at| (t_end - *at).to_f64() > ONE_TIME * self.t_end);
        let end = next.unwrap_or(t_end);
        self.methods[i].begin(
            self.sides.field(self.plus),
            self.reached,
            end,
            longest,
            self.met[i],
        )?;
        (self.met[i], self.end) = (true, Some(end));
        Ok(())
    }

    /// Makes the switches that are due.
    fn switch(&mut self) {
        let t = self.reached.0.to_f64();
        while let Some(next) = self.queue.front()
            && is_due(next.at.to_f64(), t)
        {
            // A mode between two passages that rounding has made of one says nothing of the next.
            if t - self.since > LEAST_DELAY * t {
                self.lasted[usize::from(self.plus)] = t - self.since;
            }
            if let Some(carry) = self.carry.filter(|_| next.plus != self.plus) {
                let x =
                    carry.switched(&self.reached.1.map(M::Number::to_f64), next.plus, next.shift);
                self.reached.1 = self.methods[0].exactly(t, x).1;
            }
            (self.plus, self.since, self.end) = (next.plus, t, None);
            self.queue.pop_front();
        }
    }

    /// A step of the present mode, which ends at the next switch at the latest.
    fn advance(&mut self) -> Result<(), Failure> {
        self.switch();
        if self.end.is_none() {
            let i = usize::from(self.plus);
            let guess = AS_BEFORE * self.lasted[i];
            let alone =
                self.queue.is_empty() && !M::CUTS_EXACTLY && self.since == self.reached.0.to_f64();
            self.begin(if alone { self.max_step.min(guess) } else { self.max_step })?;
            if alone && guess < self.max_step {
                // The next step need not be short, although the mode was.
                self.end = None;
            }
        }
        let delay = M::Number::from_f64(self.delay);
        loop {
            let i = usize::from(self.plus);
            self.methods[i].advance(self.sides.field(self.plus))?;
            if let Some(gates) = &mut self.gates {
                let step = self.methods[i].last();
                // No field is looked at: the tolerance does not matter.
                let tolerance = Tolerance { rtol: 0.0, atol: 0.0 };
                if let Some(Undone::Structure(times)) = gates.missed(&step, tolerance)? {
                    let longest = longest_towards((step.t0, &step.x0), times)?;
                    self.again += 1;
                    self.begin(longest)?;
                    // The next step need not be short.
                    self.end = None;
                    continue;
                }
            }
            let mut found = self.passages();
            if self.band > 0.0 {
                // Beyond a switch the step is not the orbit's.
                found.truncate(1);
            }
            let Some(first) = found.first() else { return Ok(()) };
            let (from, (to, _)) = (self.methods[i].start(), self.methods[i].reached());
            let due = self.refined(self.plus, first.theta) + delay;
            // If no switch is queued, the next one is due to this passage: it may lie within this
            // very step.
            let cut = self.queue.is_empty() && (to - due).to_f64() > ONE_TIME * to.to_f64().abs();
            if cut && is_due(due.to_f64(), from.to_f64()) {
                // A relay on the edge of its band: the switch comes before the step.
                self.queue.push_back(Coming {
                    at: from,
                    plus: first.upward,
                    shift: self.shift(first.theta),
                });
                self.positive = first.upward;
                self.switch();
                self.begin(self.max_step)?;
                continue;
            }
            if cut && !M::CUTS_EXACTLY && ((due - from) / (to - from)).to_f64() < KEPT {
                self.again += 1;
                self.begin(LONGER * (due - from).to_f64())?;
                // The next step need not be short, although this one is.
                self.end = None;
                continue;
            }
            if self.queue.is_empty() {
                self.end = None;
            }
            for passage in &found {
                let at = self.refined(self.plus, passage.theta);
                if cut && at > due {
                    break;
                }
                let shift = self.shift(passage.theta);
                self.queue.push_back(Coming { at: at + delay, plus: passage.upward, shift });
                self.positive = passage.upward;
            }
            if cut {
                self.methods[i].cut(due);
            }
            return Ok(());
        }
    }
}

/// Fraction of a step within which a zero is refined.
const NEAR: f64 = 1e-6;
/// Part of the delay after a passage in which that passage is still seen, by the rounding of its
/// place.
const SAME_PASSAGE: f64 = 1e-6;

impl<P: PiecewiseSmooth<N>, M: Cuttable<N>, const N: usize> Stepper<N> for Sharp<'_, P, M, N> {
    fn restart<F: VectorField<N>>(
        &mut self,
        _: &F,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        resolves(self.delay, t, &x, t_end)?;
        // The past stays: it is part of the equation's state, not of the method's. Who moves the
        // state across the surface moves it for the switch, too.
        let (h, edge) = (self.sides.h(&x), self.edge());
        let positive = h > edge || (h == edge && edge < 0.0);
        let here = self.methods[0].exactly(t, x);
        if t > 0.0 && x != self.reached.1.map(M::Number::to_f64) && positive != self.positive {
            // It is moved when it is, whatever the disturbance.
            let shift = Shift::default();
            self.queue.push_back(Coming {
                at: here.0 + M::Number::from_f64(self.delay),
                plus: positive,
                shift,
            });
            self.positive = positive;
        }
        (self.reached, self.t_end, self.max_step, self.end) = (here, t_end, max_step, None);
        Ok(())
    }

    fn step<F: VectorField<N>>(&mut self, _: &F) -> Result<Step<'_, N>, Failure> {
        if let Err(failure) = self.advance() {
            return Err(self.sides.diagnosed(failure, [!self.plus, self.plus]));
        }
        let method = &self.methods[usize::from(self.plus)];
        self.reached = method.reached();
        self.steps += 1;
        self.statistics = self.methods[0].statistics().clone();
        self.statistics += self.methods[1].statistics();
        (self.statistics.steps, self.statistics.rejected) =
            (self.steps, self.statistics.rejected + self.again);
        Ok(method.last())
    }

    fn statistics(&self) -> &Statistics {
        &self.statistics
    }
}

impl<P: PiecewiseSmooth<N>, M: Cuttable<N>, const N: usize> TangentStepper<N>
    for Sharp<'_, P, M, N>
{
    fn reached(&self) -> (f64, SVector<f64, N>) {
        (self.reached.0.to_f64(), self.reached.1.map(M::Number::to_f64))
    }

    fn length(&self) -> f64 {
        let coming = self.queue.iter().map(|coming| coming.shift.length());
        sqrt(square(&TangentStepper::reached(self).1) + coming.map(|l| l * l).sum::<f64>())
    }

    fn shorten(&mut self, by: f64) {
        let (t, x) = TangentStepper::reached(self);
        self.reached.1 = self.methods[0].exactly(t, shortened(&x, by)).1;
        self.queue.iter_mut().for_each(|coming| coming.shift.shorten(by));
    }
}
