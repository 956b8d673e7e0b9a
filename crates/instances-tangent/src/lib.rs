//! Every equation with tangent vectors by every method, compiled once (see `twofold-instances`).
#![forbid(unsafe_code)]

mod lanes;
mod tangent;

pub use lanes::Exponents;
pub use tangent::{Growth, Returns};
