//! The job: a question as data, its computation, and its answer.
//!
//! A [`Question`] says everything that a computation depends on. Its [`Answer`] is named columns with units, facts, the work that
//! it took, and why it ended. A [`Desk`] computes each question once and keeps answers in a [`Store`]. Everything that is shown, checked
//! or published is a view of answers.
//!
//! Kinds of questions: a run ([`Run`]), what it settles on ([`Classification`]), its largest exponent ([`LargestExponent`]), how alike two paths
//! are ([`PathComparison`]). Rooms above add their own by implementing [`Question`].
//!
//! ```
//! use twofold::job::{Desk, Run, Recording, spec::*};
//! use twofold::paper::Reading;
//! let run = RunSpec {
//!     system: SystemSpec::Caricature(Reading::Reconstructed.caricature()),
//!     switch: SwitchSpec::tanh(1e-3),
//!     start: [0.2, 0.0, -1.0],
//!     t_end: 20.0,
//!     method: MethodSpec::ndsolve_defaults(Method::Dopri5),
//!     schedule: Default::default(),
//!     observe: Observation::Section { coordinate: 1, value: 0.0 },
//! };
//! let answer = Desk::quiet().ask(&Run(run))?;
//! let section = answer.table("section").expect("a section was asked for");
//! assert_eq!(section.numbers("t").len(), section.len());
//! assert_eq!(answer.stop, twofold::job::Stop::Finished);
//! # Ok::<(), twofold::job::JobError>(())
//! ```

pub mod answer;
pub mod classification;
pub mod comparison;
pub mod desk;
pub mod encode;
pub mod exponent;
#[cfg(feature = "parquet")]
pub mod parquet;
pub mod question;
pub mod recording;
pub mod run;
pub mod simulate;
pub mod spec;
pub mod store;
pub mod table;

pub use answer::{Answer, Stop};
pub use classification::Classification;
pub use comparison::PathComparison;
pub use desk::{Desk, JobWatch, Progress};
pub use exponent::LargestExponent;
pub use question::{AnyQuestion, JobError, Question};
pub use recording::{Data, Recording};
pub use run::Run;
pub use store::Store;
pub use table::{Column, Entry, Table};
