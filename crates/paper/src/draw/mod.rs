//! Drawings of answers, and surfaces, made of plain data.
//!
//! ```
//! use twofold_paper::draw::surface;
//! use twofold_system::System;
//! let system = System::builtin("two-fold").expect("a built-in name");
//! let cube = [(-1.0, 1.0); 3];
//! let at = surface::singularity(&system, &cube).expect("the origin");
//! assert!(at.iter().all(|x| x.abs() < 1e-12));
//! ```

pub mod level;
pub mod plot;
pub mod scan;
pub mod surface;
