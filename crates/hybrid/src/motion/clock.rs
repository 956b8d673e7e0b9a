//! Times at which something is known to happen.

use super::*;

/// Multiples of a period are known to this part of themselves: 3 times 0.1 is not 0.3.
const ROUNDING: f64 = 4.0 * f64::EPSILON;

/// Whether two times that are finite, and not 0, are the same to rounding.
fn same(a: f64, b: f64) -> bool {
    (a - b).abs() < ROUNDING * a.abs().max(b.abs())
}

/// Times at which something is known to happen: events' and tables' knots.
pub(super) struct Clock {
    /// The run's end: a multiple of a period that is the same to rounding is reached.
    end: f64,
    /// Times to come, latest first, each with its event.
    once: Vec<(f64, Option<usize>)>,
    /// Period, next multiple, event.
    periodic: Vec<(f64, f64, usize)>,
}

impl Clock {
    /// The clock of a run, which begins with the events `at_start`.
    pub(super) fn new(follower: &Follower, at_start: &[usize]) -> Result<Self, HybridError> {
        let constant = |e: &Expression| {
            crate::value::evaluate(e, &|name| follower.equation.values().get(name).copied())
        };
        let end = follower.options.t_end;
        let mut clock = Self { end, once: Vec::new(), periodic: Vec::new() };
        for (i, event) in follower.model.definition().events().iter().enumerate() {
            match &event.when {
                When::At(times) => {
                    for time in times {
                        let time = constant(time);
                        if !time.is_finite() {
                            return Err(HybridError::Bad(format!(
                                "{}: `at` is {time}; give a finite time",
                                event.name
                            )));
                        }
                        if time > follower.t || time == follower.options.t_start {
                            clock.once.push((time, Some(i)));
                        }
                    }
                }
                When::Every(period) => {
                    let period = constant(period);
                    if !(period.is_finite() && period > 0.0) {
                        return Err(HybridError::Bad(format!(
                            "{}: `every` is {period}; give a time above 0",
                            event.name
                        )));
                    }
                    // Each ends a step.
                    let count = (follower.options.t_end - follower.t) / period;
                    if count > follower.options.max_steps as f64 {
                        return Err(HybridError::Bad(format!(
                            "{}: `every` is {period:e}, {count:.1e} times until t = {}, of which \
                                each ends a step: give a longer time, or an earlier end (--t-end)",
                            event.name, follower.options.t_end
                        )));
                    }
                    let mut next = (follower.t / period).floor() + 1.0;
                    if same(period * next, follower.t) {
                        next += 1.0;
                    }
                    clock.periodic.push((period, next, i));
                }
                _ => {}
            }
        }
        for table in &follower.equation.tables {
            clock.once.extend(table.knots.iter().filter(|k| **k > follower.t).map(|k| (*k, None)));
        }
        clock.once.extend(at_start.iter().map(|event| (follower.t, Some(*event))));
        clock.once.sort_by(|a, b| b.0.total_cmp(&a.0));
        Ok(clock)
    }

    pub(super) fn next(&self) -> Option<f64> {
        let once = self.once.last().map(|(t, _)| *t);
        let periodic = self.periodic.iter().map(|(p, k, _)| p * k).fold(f64::INFINITY, f64::min);
        let periodic = if same(periodic, self.end) { periodic.min(self.end) } else { periodic };
        Some(once.unwrap_or(f64::INFINITY).min(periodic)).filter(|t| t.is_finite())
    }

    /// The events that happen by `t`, in the file's order.
    pub(super) fn take(&mut self, t: f64) -> Vec<usize> {
        let mut happening = Vec::new();
        while let Some((_, event)) = self.once.pop_if(|(time, _)| *time <= t) {
            happening.extend(event);
        }
        for (period, multiple, event) in &mut self.periodic {
            while *period * *multiple <= t || same(*period * *multiple, t) {
                *multiple += 1.0;
                happening.push(*event);
            }
        }
        happening.sort_unstable();
        happening.dedup();
        happening
    }
}
