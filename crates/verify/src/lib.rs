//! Checks certificates of theorems by computing what they claim anew.
//!
//! A proof (`proofs/`) encloses orbits and writes down the boxes and numbers on which its statement
//! rests. From a certificate this crate takes the starting points alone, follows the orbits with a
//! validated integrator of its own (`orbit`, in an arithmetic of its own, `ball`) and refuses every
//! claimed enclosure that does not hold what it finds. What follows from the enclosures is decided
//! in fractions of whole numbers (`rational`). Nothing is shared with the prover: neither its
//! intervals nor its integrator nor the equation.
//!
//! A theorem's words and numbers are data ([`Theorem`]). A certificate has to say the same ones.
//!
//! Everything on which a statement rests is rigorous. Two kinds of claimed numbers that no
//! statement rests on, derivatives and images of whole sets, are wider than they need be; they are
//! compared with quotients of differences and with images of points, to more digits than are
//! claimed. See proofs/README.md.
//!
//! ```
//! use twofold_verify::{Checker, Refused};
//! let checker = Checker::new(Vec::new());
//! assert!(matches!(checker.verify("{}"), Err(Refused::Unreadable(_))));
//! ```
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

mod ball;
mod certificate;
mod check;
mod inner;
mod orbit;
mod rational;
mod recompute;
mod strict;
mod theorem;

pub use certificate::Checker;
pub use theorem::Theorem;

/// Result of a verified certificate.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verified {
    /// The theorem's name.
    pub theorem: String,
    /// Its statement.
    pub statement: String,
    /// Verified facts, a line each.
    pub findings: Vec<String>,
}

/// Why a certificate shows nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// It is no certificate that this crate knows.
    #[error("not a certificate of a theorem known here: {0}")]
    Unreadable(String),
    /// The statement does not follow from it.
    #[error("{theorem}: {what}: this does not hold")]
    Wrong {
        /// The theorem.
        theorem: String,
        /// The condition that should hold.
        what: String,
    },
}
