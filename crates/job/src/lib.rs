//! The job: a question as data, its computation, and its answer.
//!
//! A [`Question`] says everything that a computation depends on. Its [`Answer`] is named columns
//! with units, facts, the work that it took, and why it ended. An [`Executor`] computes each
//! question once and keeps answers in a [`Store`]. Everything that is shown, checked or published
//! is a view of answers.
//!
//! | question | asks |
//! |---|---|
//! | [`Run`] | what happens from a start: a path, a section, a Filippov motion, a funnel of futures |
//! | [`Classification`] | what a run settles on |
//! | [`OutcomeQuestion`](sweep::OutcomeQuestion) | the same, or that the run leaves for good: a cell of a [`Sweep`](sweep::Sweep) |
//! | [`LargestExponent`] | how fast neighbours part |
//! | [`ClosedOrbit`] | where an orbit closes up, its stability, and its branch along a parameter |
//! | [`PathComparison`] | how alike two paths are |
//! | [`MethodDigits`] | how many digits of an orbit methods get right |
//! | [`TwoFoldPassage`] | how a smoothed orbit passes a two-fold: visit, leaving, exits, growth of disturbances |
//! | [`Leaving`] | where an orbit under any switching rule leaves the surface behind a two-fold |
//! | [`SmoothingLimit`], [`AfterVisit`] | what smoothed orbits tend to as the switch steepens, before and after a visit |
//!
//! Crates above add their own by implementing [`Question`].
//!
//! ```
//! use twofold_job::{Executor, Run, Recording, spec::*};
//! use twofold_system::Caricature;
//! let run = RunSpec {
//!     system: Caricature::with_reinjection(1e-1, 1e-5).into(),
//!     switch: SwitchSpec::tanh(1e-3),
//!     start: vec![0.2, 0.0, -1.0],
//!     t_end: 20.0,
//!     method: MethodSpec::ndsolve_defaults(Method::Dopri5),
//!     schedule: Default::default(),
//!     observe: Observation::Section { coordinate: 1, value: 0.0 },
//! };
//! let answer = Executor::quiet().ask(&Run(run))?;
//! let section = answer.table("section").expect("a section was asked for");
//! assert_eq!(section.numbers("t").len(), section.len());
//! assert_eq!(answer.stop, twofold_job::Stop::Finished);
//! # Ok::<(), twofold_job::JobError>(())
//! ```
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod answer;
pub mod classification;
pub mod comparison;
pub mod digits;
pub mod encode;
pub mod executor;
pub mod exponent;
pub mod general;
pub mod general_orbit;
pub mod horizon;
pub mod limit;
pub mod orbit;
pub mod passage;
mod plan;
pub mod question;
pub mod record;
pub mod recording;
pub mod rest;
pub mod run;
pub mod scan;
mod shortest;
pub mod simulate;
pub mod spec;
pub mod store;
pub mod sweep;
pub mod table;
pub mod translation;

pub use answer::{Answer, Stop};
pub use classification::Classification;
pub use comparison::PathComparison;
pub use digits::MethodDigits;
pub use executor::{Executor, JobMonitor, Progress};
pub use exponent::LargestExponent;
pub use horizon::Horizon;
pub use limit::{AfterVisit, SmoothingLimit};
pub use orbit::ClosedOrbit;
pub use passage::{Leaving, TwoFoldPassage};
pub use question::{AnyQuestion, Ask, JobError, Question};
pub use recording::{Data, Recording};
pub use run::Run;
pub use store::Store;
pub use table::{Column, Entry, Table};

/// Systems and runs for the tests of this crate.
#[cfg(test)]
mod cases {
    use super::spec::*;
    use twofold_integrate::{Schedule, StepCap, Tolerance};
    use twofold_system::{Definition, System};

    /// The system x' = `field` on both sides of h = 0.
    pub fn smooth(states: &[&str], h: &str, field: &[&str]) -> System {
        of(&format!("states = {states:?}\nh = {h:?}\nplus = {field:?}\nminus = {field:?}"))
    }

    /// The system of a file.
    pub fn of(text: &str) -> System {
        System::new(Definition::from_toml(text, "f").unwrap())
    }

    /// a1' = -a1, a2' = -2 a2 and so on, so many states: the k-th is exp(-k t). h stays above 0.
    pub fn decays(states: usize) -> System {
        let names: Vec<String> = (1..=states).map(|k| format!("a{k}")).collect();
        let field: Vec<String> = (1..=states).map(|k| format!("-{k}*a{k}")).collect();
        of(&format!("states = {names:?}\nh = \"a1 + 1\"\nplus = {field:?}\nminus = {field:?}"))
    }

    /// A run from all ones by Dormand-Prince to twelve digits.
    pub fn run(system: System, switch: SwitchSpec, t_end: f64, observe: Observation) -> RunSpec {
        let method = MethodSpec {
            name: Method::Dopri5,
            tolerance: Tolerance { rtol: 1e-12, atol: 1e-12 },
            step_cap: StepCap::None,
            max_steps: 1_000_000,
            precision: None,
            order: None,
        };
        let start = vec![1.0; system.dimension()];
        RunSpec { system, switch, start, t_end, method, schedule: Schedule::default(), observe }
    }
}
