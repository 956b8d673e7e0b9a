//! `twofold` integrates, draws and examines piecewise-smooth systems, and checks papers about them.
//!
//! It regenerates every figure of M. R. Jeffrey, *Singularities that induce a breakdown of
//! determinism in mechanics* (2013), byte for byte the same on every machine tried, and says panel
//! by panel whether the paper's claim holds.
//!
//! | I want to ... | use | in `examples/` |
//! |---|---|---|
//! | integrate my vector field | [`integrate::drive`] | `own_method.rs` |
//! | follow Filippov motion | [`integrate::filippov::run`] | `own_system.rs` |
//! | follow a text with events | [`hybrid::follow`] | `hybrid_from_text.rs` |
//! | ask, and keep the answer | [`job::Executor`] | below |
//! | draw | [`render`] | `render_gallery.rs` |
//! | add a figure | [`paper`] | `own_figure.rs` |
//!
//! # Parts
//!
//! Each is a crate of its own (`twofold-num` and so on) that this one re-exports;
//! docs/architecture.md says what may import what.
//!
//! - [`num`]: arithmetic that results depend on. Elementary functions with the same bits
//!   everywhere, the scalar traits over which equations are written, tapes of recorded equations,
//!   dual numbers, series, intervals, random numbers.
//! - [`system`]: piecewise-smooth systems as data, their transforms, compiled fast paths; no time
//!   stepping.
//! - [`integrate`]: time stepping. One file a method; a step carries its interpolant; one driver
//!   loop; restarts and kicks are a schedule around a run.
//! - [`hybrid`]: systems as plain equations with switches, events, modes and tables, followed from
//!   switch to switch.
//! - [`rigor`]: validated steps, sets, Poincaré maps, closed orbits: enclosures that are theorems.
//!   The theorems: `proofs/`.
//! - [`verify`]: checks the theorems' certificates in exact arithmetic; shares nothing with
//!   [`rigor`].
//! - [`analyse`]: analysis of trajectories: paths, Poincaré sections, exponents, closed orbits.
//! - [`job`]: a question as data, its computation, its answer. [`record`]: files, hashes,
//!   manifests, all-or-nothing writes.
//! - [`render`]: the only user of plotters: one drawing, three formats.
//! - [`paper`]: figures, readings, claims and verdicts of any paper, as data.
//! - [`draw`]: drawings from answers. [`compare`]: two pictures, point by point.
//! - [`jeffrey_2013`]: everything specific to this paper: its readings, rules and studies.
//!   [`report`]: the page about everything.
//! - [`cli`]: flags, progress, error messages.
//!
//! # Why isn't there ...?
//!
//! - *a platform `tanh`?* It differs by an ulp between C libraries, and an ulp near the singularity
//!   is visible in a picture.
//! - *noise inside a system?* Noise and restarts happen around a run; see [`integrate::Schedule`].
//! - *an integer for a crossing's direction?* `Up` and `Down` cannot be mixed up.
//! - *an error when two runs differ in the last digit?* That they do is the paper's subject; what
//!   must not differ is the same run on two machines, and that is what the hashes are for.
//!
//! # An example
//!
//! ```
//! use twofold::job::{Executor, Run, spec::*};
//! use twofold::system::Caricature;
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
//! assert!(answer.table("section").is_some_and(|section| section.len() >= 3));
//! # Ok::<(), twofold::job::JobError>(())
//! ```
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

/// The linear algebra in public signatures: states are `nalgebra::SVector`.
pub use nalgebra;

pub use twofold_analyse as analyse;
pub use twofold_hybrid as hybrid;
pub use twofold_integrate as integrate;
#[cfg(feature = "cli")]
pub use twofold_jeffrey_2013::{self as jeffrey_2013, report};
pub use twofold_job as job;
pub use twofold_job::record;
pub use twofold_num as num;
#[cfg(feature = "cli")]
pub use twofold_paper::{compare, draw};
#[cfg(feature = "cli")]
pub use twofold_render as render;
pub use twofold_rigor as rigor;
pub use twofold_system as system;
pub use twofold_verify as verify;

/// Figures, readings, claims and verdicts of any paper; and the figures of Jeffrey (2013).
///
/// ```
/// use twofold::job::Executor;
/// use twofold::paper::{figures, pipeline};
/// let figure = figures::all().into_iter().find(|f| f.id == "fig1").expect("the first figure");
/// let picture = pipeline::compute(&figure.pictures[0], &Executor::quiet())?;
/// assert!(picture.rendered.png.starts_with(b"\x89PNG"));
/// // The committed reference holds the same hashes.
/// let reference = figures::reference("fig1").expect("every figure has one");
/// assert!(reference.contains(picture.record.hashes.pixels.as_str()));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[cfg(feature = "cli")]
pub mod paper {
    pub use twofold_paper::*;

    pub mod code;
    pub mod figures;
}

#[cfg(feature = "cli")]
pub mod cli;
#[cfg(feature = "cli")]
pub mod folder;
