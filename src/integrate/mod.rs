//! Time stepping: from an equation and a start to a sequence of accepted steps.
//!
//! A method is a [`Stepper`]: it makes one accepted [`Step`] at a time, and every step carries its interpolant (dense
//! output). The one driver loop, [`drive`], runs a stepper over a [`Course`] (an end time, a [`Schedule`] of restarts and kicks, bounds on steps) and hands each
//! step to an [`Observer`]. What is made of the steps (a path, a section) is not decided here.

pub mod dopri5;
pub mod driver;
pub mod ensemble;
pub mod filippov;
mod linear;
pub mod lsoda;
pub mod method;
pub mod radau5;
pub mod roots;
pub mod schedule;
mod starting_step;
pub mod step;
pub mod taylor;

pub use dopri5::Dopri5;
pub use driver::{Course, Ignore, Observer, Summary, Watch, drive};
pub use lsoda::Lsoda;
pub use method::{Method, WithStepper};
pub use radau5::Radau5;
pub use schedule::{Kick, KickLaw, Kicker, Schedule, StepCap};
pub use step::{Failure, Flow, Interpolant, Statistics, Step, Stepper, StopReason, Tolerance};
pub use taylor::Taylor;
