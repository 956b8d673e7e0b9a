//! What is made of steps: paths, Poincare sections, and the character of an attractor with its exponents and multipliers.
//!
//! Everything here looks at accepted steps and their interpolants from outside; no solver knows that it is observed.

pub mod attractor;
pub mod digits;
pub mod divider;
pub mod floquet;
pub mod growth;
pub mod limit;
pub mod lyapunov;
pub mod motion;
pub mod path;
pub mod reference;
pub mod section;
pub mod tangent;

pub mod work_precision;

pub use motion::{Motion, MotionRecorder};
pub use path::{PathRecorder, Sample};
pub use section::{Crossing, Direction, SectionRecorder};
