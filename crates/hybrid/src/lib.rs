//! General piecewise-smooth and hybrid systems.
//!
//! A system is written as plain equations: `f = [...]`, in which `sign`, `abs`, `min`, `max`, `if`,
//! `heaviside`, `floor`, `mod`, `clip` and comparisons are [switching functions](definition). They
//! are found in the expressions ([`equation`]), located as motion meets them, crossed or slid upon
//! as Filippov's convention says ([`selection`]). Events reset states and change modes; tables
//! bring data. [`motion`] follows all of it exactly: no step runs across a switch.
//!
//! ```
//! use twofold_hybrid::{Definition, Model, Options, follow};
//! let text = r#"
//!     states = ["x", "v"]
//!     start = [1, 0]
//!     f = ["v", "-2"]
//!     [[event]]
//!     when = "x"
//!     direction = "down"
//!     set = { v = "-0.5*v" }
//! "#;
//! let ball = Model::new(Definition::from_toml(text, "ball.toml")?);
//! let mut impacts = Vec::new();
//! follow(&ball, &Options { t_end: 2.5, ..Options::default() }, &mut |point| {
//!     impacts.extend(point.event.map(|_| point.t));
//!     true
//! })?;
//! // Before and after the reset.
//! assert!((impacts[0] - 1.0).abs() < 1e-12 && (impacts[1] - 1.0).abs() < 1e-12);
//! assert!((impacts[2] - 2.0).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

// Indices are those of states; comparisons that fail for what is no number are meant so.
#![allow(clippy::needless_range_loop, clippy::neg_cmp_op_on_partial_ord, clippy::nonminimal_bool)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]
#![forbid(unsafe_code)]

mod cells;
pub mod data;
pub mod definition;
pub mod equation;
mod history;
pub mod model;
pub mod motion;
mod range;
pub mod rests;
mod roots;
pub mod selection;
mod step;
#[cfg(test)]
mod tests;
mod value;

pub use definition::Definition;
pub use equation::Equation;
pub use model::Model;
pub use motion::{Ending, HybridError, Options, Point, follow, follow_watched};
