//! A run as a question.

use serde_json::Value;

use super::answer::Answer;
use super::question::{Ask, JobError, Question};
use super::simulate;
use super::spec::{Method, RunSpec, SwitchSpec};
use twofold_integrate::Monitor;

/// A run, and what is recorded of it: see [`Recording`](super::Recording) for the answer's tables.
/// Facts: `t` and `state` at the end, `most_steps_in_segment`; of a delayed switch its `history`;
/// of a relay what it takes `inside` its band, and whether it `begins` with f+ or f-.
///
/// ```
/// use twofold_job::{Executor, Run, spec::*};
/// use twofold_system::System;
/// let run = RunSpec {
///     system: System::builtin("stick-slip").expect("built in"),
///     switch: SwitchSpec::Filippov { exit: ExitRule::Undecided, funnel: None },
///     start: vec![0.0, 0.0],
///     t_end: 20.0,
///     method: MethodSpec::ndsolve_defaults(Method::Dopri5),
///     schedule: Default::default(),
///     observe: Observation::Path { chord: 1e-3 },
/// };
/// let answer = Executor::quiet().ask(&Run(run))?;
/// let motion = answer.table("motion").expect("a Filippov motion");
/// assert!(motion.words("mode").any(|mode| mode == "sliding-attracting"));
/// # use twofold_integrate::filippov::ExitRule;
/// # Ok::<(), twofold_job::JobError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Run(pub RunSpec);

impl Question for Run {
    fn kind(&self) -> &'static str {
        "run"
    }

    fn json(&self) -> Value {
        serde_json::to_value(&self.0).expect("specs are plain data")
    }

    fn label(&self) -> String {
        let every = self
            .0
            .schedule
            .restart_every
            .map_or_else(String::new, |t| format!(", restarts every {t}"));
        let method = &self.0.method;
        let bits = method.precision.map_or_else(String::new, |bits| format!(" ({bits} bits)"));
        format!("{}{bits} to t = {}{every}", method.name.name(), self.0.t_end)
    }

    fn extent(&self) -> f64 {
        self.0.t_end
    }

    fn cost(&self) -> f64 {
        // Ratios of measured times per unit of time; they order the work and decide nothing else.
        let switch = match self.0.switch {
            SwitchSpec::Hysteretic { .. } => 6.0,
            SwitchSpec::Smoothed { .. } => 1.0,
            SwitchSpec::Delayed { .. } | SwitchSpec::Relay { .. } => 2.0,
            SwitchSpec::Filippov { .. } => 0.1,
        };
        let method = match self.0.method.name {
            Method::Lsoda => 2.0,
            Method::Radau5 => 6.0,
            Method::Dopri5 => 1.0,
            Method::Taylor => 10.0,
            Method::TaylorExtended => 500.0,
            Method::Layered => 0.3,
        };
        self.0.t_end * switch * method
    }

    fn compute(&self, _: &dyn Ask, monitor: &dyn Monitor) -> Result<Answer, JobError> {
        simulate::answer(&self.0, monitor)
    }
}
