//! What is made of steps: paths, Poincare sections, and the character of an attractor with its exponents and multipliers.
//!
//! Everything here looks at accepted steps and their interpolants from outside; no solver knows that it is observed.
//!
//! ```
//! use nalgebra::vector;
//! use twofold::analyse::SectionRecorder;
//! use twofold::integrate::{Course, Dopri5, Tolerance, drive};
//! use twofold::system::{Caricature, Smoothed, Transition};
//!
//! // The passages of a smoothed two-fold through y = 0.
//! let field = Smoothed { system: Caricature::with_reinjection(1e-1, 1e-5), transition: Transition::Tanh, eps: 1e-2 };
//! let mut section = SectionRecorder::<3>::new(1, 0.0);
//! let mut method = Dopri5::new(Tolerance { rtol: 1e-8, atol: 1e-8 });
//! let _ = drive(&field, vector![0.2, 0.0, -1.0], &Course::to(20.0), &mut method, &mut section, &())?;
//! assert!(section.crossings().windows(2).all(|pair| pair[0].t < pair[1].t && pair[0].direction != pair[1].direction));
//! # Ok::<(), twofold::integrate::Failure>(())
//! ```

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
