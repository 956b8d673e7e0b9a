//! What is made of steps: paths, Poincare sections, verdicts about attractors.
//!
//! Everything here looks at accepted steps and their interpolants from outside; no solver knows that it is observed.

pub mod digits;
pub mod path;
pub mod section;

pub use path::{PathRecorder, Sample};
pub use section::{Crossing, Direction, SectionRecorder};
