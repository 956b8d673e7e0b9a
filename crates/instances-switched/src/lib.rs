//! Every discontinuous system by every method, compiled once: Filippov motion, and switches that
//! act late or have a memory (see `twofold-instances`).
//!
//! Systems are a file's ([`Bound`]), in one to four states. The paper's own is there as Rust code,
//! too: [`late`] and [`sliding`] choose.
#![forbid(unsafe_code)]

mod delayed;
mod motion;

pub use delayed::{Late, late};
pub use motion::{Crossing, Motions, TwoSurfaces, Visited, sliding};
#[cfg(doc)]
use twofold_system::Bound;
