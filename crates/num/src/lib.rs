//! Arithmetic that results depend on.
//!
//! The only crate that names a math library. Everything that ends in a published number goes
//! through [`elementary`] (functions with the same bits on every machine), [`Elementary`] (what an
//! equation may do with a number, so that one definition serves plain evaluation, differentiation,
//! power series and extended precision), and [`random`] (a named generator and our own map from
//! bits to numbers).
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod decimal;
pub mod double_double;
pub mod dual;
pub mod elementary;
pub mod fit;
pub mod given;
pub mod interval;
pub mod interval_extended;
mod interval_functions;
pub mod jet;
pub mod lanes;
pub mod linear;
pub mod multi;
pub mod polynomial;
pub mod random;
pub mod registers;
pub mod scalar;
pub mod series;
mod short;
pub mod tape;

pub use decimal::{Decimal, FromDecimal};
pub use double_double::DoubleDouble;
pub use dual::Dual;
pub use given::Given;
pub use interval::{Enclosure, Interval};
pub use interval_extended::Ball;
pub use lanes::Lanes;
pub use multi::MultiFloat;
/// An instruction set, for crates that hand numbers on in registers and compute nothing with them.
pub use pulp::Simd;
pub use registers::{Aligned, Mask, Registers};
pub use scalar::{Arithmetic, Elementary, Scalar};
pub use short::Short;
pub use tape::Tape;
