//! Every equation by every method, compiled once: orbits.
//!
//! Methods are generic over the equation and its number of states, and so are observers and
//! estimates: each pair is machine code of its own, and all of it together is most of what the
//! compiler has to write. This crate and its two neighbours hold the pairs that the program needs,
//! behind traits; the crates above call them and are compiled without them. They are three so that
//! the compiler writes them side by side: orbits of smooth equations (here), with tangent vectors
//! (`instances-tangent`), and of discontinuous systems (`instances-switched`).
//!
//! Equations are a file's, recorded as a program ([`BoundField`]), in one to four states (five
//! with a hysteretic phi). The paper's own are there as Rust code, too, which gives the same bits
//! sooner: [`smoothed`] and [`hysteretic`] choose. Systems of more states are followed by
//! `twofold-hybrid`, which knows their number at run time.
#![forbid(unsafe_code)]

mod lanes;
mod orbit;

pub use lanes::{Lanes, Section, smoothed_in_lanes};
#[doc(hidden)]
pub use orbit::Waiting;
pub use orbit::{How, Orbits, Visits, hysteretic, smoothed};
#[cfg(doc)]
use twofold_system::BoundField;
