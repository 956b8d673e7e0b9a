//! The one loop that runs a method over a schedule.

use nalgebra::SVector;
use serde::{Deserialize, Serialize};
use std::ops::ControlFlow;

use super::schedule::{Kicker, Schedule, StepCap};
use super::step::{Failure, Flow, Statistics, Step, Stepper, StopReason};
use twofold_system::VectorField;

/// Receives a run as it happens.
pub trait Observer<const N: usize> {
    /// An accepted step.
    fn step(&mut self, step: &Step<'_, N>) -> Flow;
    /// The state jumped at time `t` (a kick).
    fn kick(&mut self, _t: f64, _before: &SVector<f64, N>, _after: &SVector<f64, N>) {}
    /// Of runs side by side that carry a vector along ([`Carried`](super::ensemble::Carried)): its
    /// length was `length`, and is 1 again.
    fn rescaled(&mut self, _t: f64, _length: f64) {}
    /// Of the same: one of their stops is reached, in the state `x`.
    fn stopped(&mut self, _t: f64, _x: &SVector<f64, N>) {}
}

/// An observer that ignores everything.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ignore;

impl<const N: usize> Observer<N> for Ignore {
    fn step(&mut self, _: &Step<'_, N>) -> Flow {
        Flow::Continue
    }
}

/// Receives a run's progress and may stop it. Called often; must be cheap.
pub trait Monitor: Sync {
    /// The run has reached time `t`. [`ControlFlow::Break`] asks it to stop.
    fn reached(&self, t: f64) -> ControlFlow<()>;
}

impl Monitor for () {
    fn reached(&self, _: f64) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }
}

/// Duration and rules of a run, independent of equation and method.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveOptions {
    /// The end time; a run starts at 0.
    pub t_end: f64,
    /// Restarts and kicks.
    pub schedule: Schedule,
    /// The longest step.
    pub step_cap: StepCap,
    /// Most steps of the whole run; with them it ends as [`StopReason::StepBudget`].
    pub max_steps: u64,
    /// Number of leading components of the state that a kick perturbs: the states of the system,
    /// but not a hysteretic phi.
    pub kicked_states: usize,
}

impl DriveOptions {
    /// Straight to `t_end`: no restarts, no kicks, steps as long and as many as the method wants.
    pub fn to(t_end: f64) -> Self {
        Self {
            t_end,
            schedule: Schedule::default(),
            step_cap: StepCap::None,
            max_steps: u64::MAX,
            kicked_states: 3,
        }
    }
}

/// Result of a run.
#[derive(Clone, Debug, PartialEq)]
#[must_use = "a run may have been cut short: look at `stop`"]
pub struct Summary<const N: usize> {
    /// Final time.
    pub t: f64,
    /// Final state.
    pub x: SVector<f64, N>,
    /// Work done.
    pub statistics: Statistics,
    /// The largest number of steps in one segment between restarts or kicks.
    pub most_steps_in_segment: u64,
    /// Why it ended.
    pub stop: StopReason,
}

impl<const N: usize> Summary<N> {
    /// This summary, unless the budget of steps ended the run.
    ///
    /// # Errors
    /// [`Failure::TooManySteps`], for callers to whom a run cut short by its budget is worth
    /// nothing.
    pub fn within_budget(self) -> Result<Self, Failure> {
        match self.stop {
            StopReason::StepBudget => Err(Failure::TooManySteps {
                t: self.t,
                limit: self.statistics.steps,
                state: Failure::state(&self.x),
            }),
            _ => Ok(self),
        }
    }
}

/// Runs `stepper` from (0, x0) over `options`.
///
/// # Errors
/// The method's failure. Running out of steps is no error but a [`StopReason`]: what was observed
/// until then stands.
pub fn drive<const N: usize, F, M>(
    field: &F,
    x0: SVector<f64, N>,
    options: &DriveOptions,
    stepper: &mut M,
    observer: &mut dyn Observer<N>,
    monitor: &dyn Monitor,
) -> Result<Summary<N>, Failure>
where
    F: VectorField<N>,
    M: Stepper<N>,
{
    drive_any(&mut Pair { field, stepper }, x0, options, observer, monitor)
}

/// A method with its equation: what the loop asks of both, whichever they are, so that it is
/// compiled once a dimension.
trait Driving<const N: usize> {
    /// [`Stepper::restart`], or [`Stepper::restart_again`].
    fn restart(
        &mut self,
        again: bool,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure>;
    /// [`Stepper::step`].
    fn step(&mut self) -> Result<Step<'_, N>, Failure>;
    /// [`Stepper::statistics`].
    fn statistics(&self) -> &Statistics;
    /// The failure with its cause in the equation.
    fn diagnosed(&self, failure: Failure) -> Failure;
}

struct Pair<'a, F, M> {
    field: &'a F,
    stepper: &'a mut M,
}

impl<F: VectorField<N>, M: Stepper<N>, const N: usize> Driving<N> for Pair<'_, F, M> {
    fn restart(
        &mut self,
        again: bool,
        t: f64,
        x: SVector<f64, N>,
        t_end: f64,
        max_step: f64,
    ) -> Result<(), Failure> {
        if again {
            self.stepper.restart_again(self.field, t, x, t_end, max_step)
        } else {
            self.stepper.restart(self.field, t, x, t_end, max_step)
        }
    }
    fn step(&mut self) -> Result<Step<'_, N>, Failure> {
        self.stepper.step(self.field)
    }
    fn statistics(&self) -> &Statistics {
        self.stepper.statistics()
    }
    fn diagnosed(&self, failure: Failure) -> Failure {
        failure.diagnosed(&self.field.tape())
    }
}

fn drive_any<const N: usize>(
    pair: &mut dyn Driving<N>,
    x0: SVector<f64, N>,
    options: &DriveOptions,
    observer: &mut dyn Observer<N>,
    monitor: &dyn Monitor,
) -> Result<Summary<N>, Failure> {
    let DriveOptions { t_end, ref schedule, step_cap, max_steps, kicked_states } = *options;
    let mut kicker = schedule.kick.map(|kick| Kicker::new(kick, kicked_states));
    let (mut t, mut x) = (0.0, x0);
    let mut begun = false;
    let mut most_steps_in_segment = 0;
    let mut stop = StopReason::EndTime;
    'run: for segment in schedule.segments(0.0, t_end) {
        let steps_before = pair.statistics().steps;
        let longest = step_cap.for_segment(segment.end - t);
        let again = std::mem::replace(&mut begun, true);
        pair.restart(again, t, x, segment.end, longest).map_err(|f| pair.diagnosed(f))?;
        while t < segment.end {
            // Looked at where it was made: `?` would move it, in other pieces than it was written
            // in, which waits until all are written.
            let flow = match &pair.step() {
                Ok(step) => {
                    (t, x) = (step.t1, step.x1);
                    observer.step(step)
                }
                Err(failure) => {
                    let failure = failure.clone();
                    return Err(pair.diagnosed(failure));
                }
            };
            let steps = pair.statistics().steps;
            if flow == Flow::Stop {
                stop = StopReason::Observer;
            } else if steps.is_multiple_of(4096) && monitor.reached(t).is_break() && t < t_end {
                stop = StopReason::Cancelled;
            } else if steps >= max_steps && t < t_end {
                stop = StopReason::StepBudget;
            }
            if stop != StopReason::EndTime {
                most_steps_in_segment = most_steps_in_segment.max(steps - steps_before);
                break 'run;
            }
        }
        most_steps_in_segment = most_steps_in_segment.max(pair.statistics().steps - steps_before);
        if let (true, Some(kicker)) = (segment.kick, kicker.as_mut()) {
            let kicked = kicker.apply(x);
            observer.kick(t, &x, &kicked);
            x = kicked;
        }
    }
    let _ = monitor.reached(t);
    Ok(Summary { t, x, statistics: pair.statistics().clone(), most_steps_in_segment, stop })
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicBool, Ordering};

    use nalgebra::Vector2;

    use super::*;
    use crate::{Dopri5, Tolerance};
    use twofold_num::Elementary;

    /// x'' = -x.
    struct Turning;
    impl VectorField<2> for Turning {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            SVector::from([x[1], -x[0]])
        }
    }

    /// Stops after so many steps.
    struct After(u64);
    impl Observer<2> for After {
        fn step(&mut self, _: &Step<'_, 2>) -> Flow {
            self.0 -= 1;
            if self.0 == 0 { Flow::Stop } else { Flow::Continue }
        }
    }

    struct Refuses(AtomicBool);
    impl Monitor for Refuses {
        fn reached(&self, _: f64) -> ControlFlow<()> {
            self.0.store(true, Ordering::Relaxed);
            ControlFlow::Break(())
        }
    }

    fn run(
        options: DriveOptions,
        observer: &mut dyn Observer<2>,
        monitor: &dyn Monitor,
    ) -> Summary<2> {
        let mut stepper = Dopri5::new(Tolerance { rtol: 1e-9, atol: 1e-9 });
        drive(&Turning, Vector2::new(1.0, 0.0), &options, &mut stepper, observer, monitor).unwrap()
    }

    #[test]
    fn every_end_has_its_reason() {
        let whole = run(DriveOptions::to(10.0), &mut Ignore, &());
        assert_eq!((whole.stop, whole.t), (StopReason::EndTime, 10.0));
        assert_eq!(whole.most_steps_in_segment, whole.statistics.steps);

        let seen = run(DriveOptions::to(10.0), &mut After(7), &());
        assert_eq!((seen.stop, seen.statistics.steps), (StopReason::Observer, 7));
        assert!(seen.t < 10.0 && seen.most_steps_in_segment == 7);
        // Three segments, the last of them hardly begun.
        let often = DriveOptions {
            schedule: Schedule { restart_every: Some(1.0), kick: None },
            ..DriveOptions::to(10.0)
        };
        let first = run(DriveOptions { t_end: 1.0, ..often }, &mut Ignore, &()).statistics.steps;
        let second =
            run(DriveOptions { t_end: 2.0, ..often }, &mut Ignore, &()).statistics.steps - first;
        let third = run(often, &mut After(first + second + 1), &());
        assert_eq!(
            (third.stop, third.most_steps_in_segment),
            (StopReason::Observer, first.max(second))
        );

        let poor = run(DriveOptions { max_steps: 5, ..DriveOptions::to(10.0) }, &mut Ignore, &());
        assert_eq!((poor.stop, poor.statistics.steps), (StopReason::StepBudget, 5));
        assert!(matches!(poor.within_budget(), Err(Failure::TooManySteps { limit: 5, .. })));

        let refuses = Refuses(AtomicBool::new(false));
        let cut = run(
            DriveOptions { step_cap: StepCap::Absolute(1e-3), ..DriveOptions::to(10.0) },
            &mut Ignore,
            &refuses,
        );
        assert_eq!((cut.stop, cut.statistics.steps), (StopReason::Cancelled, 4096));
        assert!(cut.clone().within_budget().is_ok(), "only the budget is an error");

        // A budget that is just enough is enough, and a monitor that refuses at the very end has
        // cut nothing short.
        let just = run(
            DriveOptions { max_steps: whole.statistics.steps, ..DriveOptions::to(10.0) },
            &mut Ignore,
            &refuses,
        );
        assert_eq!(just.stop, StopReason::EndTime);
        assert_eq!(just.x, whole.x);

        // Neither has one that is asked when the last step is the 4096th.
        let last = run(
            DriveOptions { step_cap: StepCap::Absolute(1e-3), ..DriveOptions::to(cut.t) },
            &mut Ignore,
            &refuses,
        );
        assert_eq!((last.stop, last.statistics.steps, last.t), (StopReason::EndTime, 4096, cut.t));
    }

    /// Van der Pol's oscillator; counts how often it is asked.
    struct Counted(std::sync::atomic::AtomicU64);
    impl VectorField<2> for Counted {
        fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
            self.0.fetch_add(1, Ordering::Relaxed);
            SVector::from([x[1], ((S::one() - x[0] * x[0]) * x[1]).scale(20.0) - x[0]])
        }
    }

    #[test]
    fn what_is_counted_was_done() {
        let field = Counted(Default::default());
        let mut stepper = Dopri5::new(Tolerance { rtol: 1e-6, atol: 1e-6 });
        let options = DriveOptions {
            schedule: Schedule { restart_every: Some(30.0), kick: None },
            ..DriveOptions::to(100.0)
        };
        let mut seen = Lengths::default();
        let end =
            drive(&field, Vector2::new(2.0, 0.0), &options, &mut stepper, &mut seen, &()).unwrap();
        let s = &end.statistics;
        assert_eq!((s.restarts, s.highest_order), (4, 5));
        assert!(s.rejected > 20, "the orbit has fast parts: {} rejected", s.rejected);
        assert_eq!(s.steps, seen.0.len() as u64);
        // A restart asks twice, a trial six times, whether it is accepted or not.
        assert_eq!(s.evaluations, field.0.into_inner());
        assert_eq!(s.evaluations, 2 * s.restarts + 6 * (s.steps + s.rejected));
    }

    #[derive(Default)]
    struct Lengths(Vec<f64>);
    impl Observer<2> for Lengths {
        fn step(&mut self, step: &Step<'_, 2>) -> Flow {
            self.0.push(step.t1 - step.t0);
            Flow::Continue
        }
    }
}
