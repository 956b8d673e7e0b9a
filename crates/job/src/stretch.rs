//! A run in stretches: each is computed from the state at its beginning alone, and together they are the run, bit for bit.
//!
//! A run may be cut at its restarts and kicks. There the equation's state (with phi, if it is hysteretic) is the whole state of the run:
//! the method forgets everything ([`Stepper::restart`](twofold_integrate::Stepper::restart)), the kicks drawn so far are counted by the schedule, and who
//! looks for passages needs to remember nothing, unless the state lies exactly on the plane. So somebody who has the states at the cuts can compute any
//! stretch of a long run again without the rest of it.
//!
//! ```
//! use twofold_job::{spec::*, stretch};
//! use twofold_integrate::{Part, Schedule};
//! use twofold_system::Caricature;
//! let run = RunSpec {
//!     system: Caricature::with_reinjection(1e-1, 1e-5).into(),
//!     switch: SwitchSpec::tanh(1e-3),
//!     start: vec![0.2, 0.0, -1.0],
//!     t_end: 60.0,
//!     method: MethodSpec::ndsolve_defaults(Method::Dopri5),
//!     schedule: Schedule { restart_every: Some(20.0), kick: None },
//!     observe: Observation::Section { coordinate: 1, value: 0.0 },
//! };
//! let first = stretch::compute(&run, Part { from: 0, to: 2 }, &stretch::start(&run), &())?;
//! let second = stretch::compute(&run, Part { from: 2, to: 3 }, &first.state, &())?;
//! assert_eq!((first.t, second.t), (40.0, 60.0));
//! # Ok::<(), twofold_job::JobError>(())
//! ```

use super::question::JobError;
use super::simulate;
use super::spec::{Observation, RunSpec, SpecError, SwitchSpec};
use super::table::Table;
use twofold_integrate::{Part, Watch};

/// What came of a stretch.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// The passages in it.
    pub rows: Table,
    /// The time at its end.
    pub t: f64,
    /// The equation's state there, behind the kick if there is one: with phi, if the switch is hysteretic.
    pub state: Vec<f64>,
}

/// Whether a run can be computed in stretches: it records a section, its switch is not Filippov's, and there are restarts or kicks to cut it at.
pub fn can_be_cut(run: &RunSpec) -> bool {
    let section = matches!(run.observe, Observation::Section { .. });
    let filippov = matches!(run.switch, SwitchSpec::Filippov { .. });
    section && !filippov && (run.schedule.restart_every.is_some() || run.schedule.kick.is_some())
}

/// The equation's state at the start.
pub fn start(run: &RunSpec) -> Vec<f64> {
    let mut state = run.start.clone();
    if let SwitchSpec::Hysteretic { phi0, .. } = run.switch {
        state.push(phi0);
    }
    state
}

/// How many segments a run's schedule has: a run can be cut between any two.
pub fn segments(run: &RunSpec) -> u64 {
    run.schedule.count(run.t_end)
}

/// Whether a run may be cut where it is in this state. Not exactly on the plane: which side the orbit came from would be lost.
pub fn may_be_cut_at(run: &RunSpec, state: &[f64]) -> bool {
    match run.observe {
        Observation::Section { coordinate, value } => state.get(coordinate).is_some_and(|x| *x != value),
        _ => true,
    }
}

/// Computes a stretch of a run from the equation's state at its beginning.
///
/// # Errors
///
/// If the run cannot be cut, the state is not one of this equation, or the orbit cannot be followed.
pub fn compute(run: &RunSpec, part: Part, from: &[f64], watch: &dyn Watch) -> Result<Stretch, JobError> {
    if !can_be_cut(run) {
        let value = "one that cannot be computed in stretches".into();
        return Err(
            SpecError { field: "run", value, rule: "give one with a section and with restarts or kicks" }.into()
        );
    }
    let mut spec = run.clone();
    let states = run.system.dimension();
    if from.len() != start(run).len() {
        let rule = "give the equation's whole state, with phi if the switch is hysteretic";
        return Err(SpecError { field: "start", value: format!("{from:?}"), rule }.into());
    }
    spec.start = from[..states].to_vec();
    if let (SwitchSpec::Hysteretic { phi0, .. }, Some(phi)) = (&mut spec.switch, from.get(states)) {
        *phi0 = *phi;
    }
    let (rows, t, state) = simulate::part(&spec, part, watch)?;
    Ok(Stretch { rows, t, state })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::spec::*;
    use crate::{Executor, Run};
    use twofold_integrate::{Kick, KickLaw, Schedule};
    use twofold_system::{Caricature, Relaxation};

    fn run(switch: SwitchSpec, method: Method, kick: Option<Kick>) -> RunSpec {
        RunSpec {
            system: Caricature::with_reinjection(1e-1, 1e-5).into(),
            switch,
            start: vec![0.2, 0.0, -1.0],
            t_end: 30.0,
            method: MethodSpec::ndsolve_defaults(method),
            schedule: Schedule { restart_every: Some(7.0), kick },
            observe: Observation::Section { coordinate: 1, value: 0.0 },
        }
    }

    #[test]
    fn stretches_are_the_run() {
        let kick = |law| Some(Kick { every: 0.3, size: 1e-3, law, seed: 2013, stream: 1 });
        let tanh = SwitchSpec::tanh(1e-3);
        for run in [
            run(tanh, Method::Lsoda, None),
            run(tanh, Method::Dopri5, None),
            run(tanh, Method::Radau5, None),
            run(tanh, Method::Taylor, None),
            run(tanh, Method::TaylorExtended, None),
            run(tanh, Method::Lsoda, kick(KickLaw::Sphere)),
            run(tanh, Method::Dopri5, kick(KickLaw::Cube)),
            run(SwitchSpec::hysteretic(1e-3, Relaxation::Literal), Method::Lsoda, None),
            run(SwitchSpec::hysteretic(1e-3, Relaxation::Single), Method::Lsoda, kick(KickLaw::Normal)),
        ] {
            let whole = Executor::quiet().ask(&Run(run.clone())).unwrap();
            let n = segments(&run);
            let (mut state, mut t) = (start(&run), 0.0);
            let mut rows = Vec::new();
            for from in 0..n {
                let stretch = compute(&run, Part { from, to: from + 1 }, &state, &()).unwrap();
                assert!(stretch.t > t && may_be_cut_at(&run, &stretch.state));
                rows.extend(stretch.rows.rows());
                (state, t) = (stretch.state, stretch.t);
            }
            assert!(rows.len() > 3);
            assert_eq!(rows, whole.table("section").unwrap().rows(), "{:?} {:?}", run.switch, run.method.name);
            assert_eq!(whole.fact::<Vec<f64>>("state").unwrap(), state[..3]);
            assert_eq!(whole.fact::<f64>("t").unwrap(), t);
        }
    }

    #[test]
    fn what_cannot_be_cut_is_refused() {
        let good = run(SwitchSpec::tanh(1e-3), Method::Dopri5, None);
        let part = Part { from: 0, to: 1 };
        assert!(compute(&good, part, &[0.2, 0.0], &()).is_err(), "a state too few");
        assert!(compute(&good, part, &[0.2, f64::NAN, 0.0], &()).is_err());
        let path = RunSpec { observe: Observation::Path { chord: 1e-3 }, ..good.clone() };
        let smooth = RunSpec { schedule: Schedule::default(), ..good.clone() };
        for run in [path, smooth] {
            assert!(!can_be_cut(&run) && compute(&run, part, &start(&run), &()).is_err());
        }
        assert!(!may_be_cut_at(&good, &[1.0, 0.0, 2.0]) && may_be_cut_at(&good, &[1.0, 1e-300, 2.0]));
    }
}
