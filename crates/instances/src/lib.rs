//! Every equation by every method, compiled once.
//!
//! The methods are generic over the equation and its number of states, and so are the computations
//! on orbits: each pair is machine code of its own, and all of it together is most of what the
//! compiler has to write. Here are the pairs that the program needs, behind traits; the crates
//! above call them, and are compiled without them.
//!
//! Equations are a file's, recorded as a program ([`BoundField`], [`Bound`]), in one to eight
//! states (nine with a hysteretic phi). The paper's own are there as Rust code, too, which gives
//! the same bits sooner: [`smoothed`], [`hysteretic`], [`late`] and [`sliding`] choose.
#![forbid(unsafe_code)]

mod delayed;
mod lanes;
mod motion;
mod orbit;
mod tangent;

pub use delayed::{Late, late};
pub use lanes::{Exponents, Lanes, Section, smoothed_in_lanes};
pub use motion::{Crossing, Motions, TwoSurfaces, Visited, sliding};
pub use orbit::{How, Orbits, Visits, hysteretic, smoothed};
pub use tangent::{Growth, Returns};
#[cfg(doc)]
use twofold_system::{Bound, BoundField};
