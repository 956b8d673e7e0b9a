//! Analysis of trajectories: paths, Poincare sections, kinds of attractors, Lyapunov exponents and
//! Floquet multipliers.
//!
//! Everything here observes accepted steps and their interpolants from outside; no solver depends
//! on it.
//!
//! ```
//! use nalgebra::{SVector, Vector2};
//! use twofold_analyse::{Direction, SectionRecorder};
//! use twofold_integrate::{DriveOptions, Dopri5, Tolerance, drive};
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
//! // Its passages through x = 0: downwards at pi/2, upwards at 3 pi/2.
//! let mut section = SectionRecorder::<2>::new(0, 0.0);
//! let mut method = Dopri5::new(Tolerance { rtol: 1e-9, atol: 1e-9 });
//! let to = DriveOptions::to(6.0);
//! let _ = drive(&Oscillator, Vector2::new(1.0, 0.0), &to, &mut method, &mut section, &())?;
//! let [down, up] = section.crossings() else { panic!("two passages") };
//! assert_eq!((down.direction, up.direction), (Direction::Down, Direction::Up));
//! assert!((up.t - 4.712_388_98).abs() < 1e-7);
//! # Ok::<(), twofold_integrate::Failure>(())
//! ```
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod attractor;
pub mod branch;
pub mod counts;
pub mod delay;
pub mod digits;
pub mod divider;
pub mod filippov_return;
pub mod floquet;
pub mod late_lyapunov;
pub mod limit;
pub mod lyapunov;
pub mod motion;
pub mod passage;
pub mod path;
pub mod reference;
pub mod section;
pub mod tangent;

pub mod work_precision;

pub use motion::{Motion, MotionRecorder, TimedMotion};
pub use path::{PathRecorder, Sample, TimesRecorder};
pub use section::{Crossing, Direction, SectionRecorder};
