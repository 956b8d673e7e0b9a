//! The one loop that runs a method over a schedule.

use nalgebra::SVector;

use super::schedule::{Kicker, Schedule, StepCap};
use super::step::{Failure, Flow, Statistics, Step, Stepper};
use crate::system::VectorField;

/// Receives a run as it happens.
pub trait Observer<const N: usize> {
    /// An accepted step.
    fn step(&mut self, step: &Step<'_, N>) -> Flow;
    /// The state jumped at time `t` (a kick).
    fn kick(&mut self, _t: f64, _before: &SVector<f64, N>, _after: &SVector<f64, N>) {}
}

/// An observer that ignores everything.
#[derive(Clone, Copy, Debug, Default)]
pub struct Ignore;

impl<const N: usize> Observer<N> for Ignore {
    fn step(&mut self, _: &Step<'_, N>) -> Flow {
        Flow::Continue
    }
}

/// Receives how far a run has come, for progress displays. Called often; must be cheap.
pub trait Watch: Sync {
    /// The run has reached time `t`. `false` asks it to stop.
    fn reached(&self, t: f64) -> bool;
}

impl Watch for () {
    fn reached(&self, _: f64) -> bool {
        true
    }
}

/// How a run ended.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary<const N: usize> {
    /// Final time.
    pub t: f64,
    /// Final state.
    pub x: SVector<f64, N>,
    /// Work done.
    pub statistics: Statistics,
    /// The largest number of steps in one segment. NDSolve would have stopped at 10,000.
    pub most_steps_in_segment: u64,
}

/// Runs `stepper` from (0, x0) to `t_end` over `schedule`, at most `max_steps` steps.
#[allow(clippy::too_many_arguments)]
pub fn drive<const N: usize, F, M, O>(
    field: &F,
    x0: SVector<f64, N>,
    t_end: f64,
    stepper: &mut M,
    schedule: &Schedule,
    cap: StepCap,
    max_steps: u64,
    observer: &mut O,
    watch: &dyn Watch,
) -> Result<Summary<N>, Failure>
where
    F: VectorField<N>,
    M: Stepper<N>,
    O: Observer<N>,
{
    let mut kicker = schedule.kick.map(Kicker::new);
    let (mut t, mut x) = (0.0, x0);
    let mut most_steps_in_segment = 0;
    'run: for segment in schedule.segments(0.0, t_end) {
        let steps_before = stepper.statistics().steps;
        stepper.restart(field, t, x, segment.end, cap.for_segment(segment.end - t))?;
        while t < segment.end {
            let step = stepper.step(field)?;
            (t, x) = (step.t1, step.x1);
            let flow = observer.step(&step);
            let steps = stepper.statistics().steps;
            if steps.is_multiple_of(4096) && !watch.reached(t) || flow == Flow::Stop {
                break 'run;
            }
            if steps >= max_steps && t < t_end {
                return Err(Failure::TooManySteps { t, limit: max_steps, state: Failure::state(&x) });
            }
        }
        most_steps_in_segment = most_steps_in_segment.max(stepper.statistics().steps - steps_before);
        if let (true, Some(kicker)) = (segment.kick, kicker.as_mut()) {
            let kicked = kicker.apply(x);
            observer.kick(t, &x, &kicked);
            x = kicked;
        }
    }
    watch.reached(t);
    Ok(Summary { t, x, statistics: stepper.statistics().clone(), most_steps_in_segment })
}
