//! Time stepping: from an equation and a start to a sequence of accepted steps.
//!
//! A method is a [`Stepper`]: it makes one accepted [`Step`] at a time, and every step carries its
//! interpolant (dense output). The one driver loop, [`drive`], runs a stepper over a
//! [`DriveOptions`] (an end time, a [`Schedule`] of restarts and kicks, bounds on steps) and hands
//! each step to an [`Observer`]. What is made of the steps (a path, a section) is not decided here.
//!
//! ```
//! use nalgebra::{SVector, Vector2};
//! use twofold_integrate::{DriveOptions, Dopri5, Ignore, StopReason, Tolerance, drive};
//! use twofold_num::Elementary;
//! use twofold_system::VectorField;
//!
//! /// x'' = -x.
//! struct Oscillator;
//! impl VectorField<2> for Oscillator {
//!     fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
//!         Vector2::new(x[1], -x[0])
//!     }
//! }
//!
//! let mut method = Dopri5::new(Tolerance { rtol: 1e-9, atol: 1e-9 });
//! let to = DriveOptions::to(1.0);
//! let end = drive(&Oscillator, Vector2::new(1.0, 0.0), &to, &mut method, &mut Ignore, &())?;
//! assert_eq!(end.stop, StopReason::EndTime);
//! assert!((end.x[0] - 0.540_302_305_868).abs() < 1e-8); // cos 1
//! # Ok::<(), twofold_integrate::Failure>(())
//! ```
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod delay;
pub mod dopri5;
pub mod driver;
pub mod ensemble;
pub mod extents;
pub mod filippov;
pub mod guard;
pub mod layered;
mod linear;
pub mod lsoda;
pub mod method;
pub mod radau5;
pub mod roots;
pub mod schedule;
mod starting_step;
pub mod step;
pub mod taylor;
#[cfg(test)]
mod tests;

pub use dopri5::Dopri5;
pub use driver::{DriveOptions, Ignore, Monitor, Observer, Summary, drive};
pub use extents::Extents;
pub use guard::Guarded;
pub use layered::Layered;
pub use lsoda::{Lsoda, LsodaOf};
pub use method::{Method, PRECISIONS, WithStepper, with_extended};
pub use radau5::Radau5;
pub use schedule::{Kick, KickLaw, Kicker, Schedule, StepCap};
pub use step::{Failure, Flow, Interpolant, Statistics, Step, Stepper, StopReason, Tolerance};
pub use taylor::Taylor;
