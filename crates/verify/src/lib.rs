//! Checks certificates of theorems in exact rational arithmetic.
//!
//! A proof (`proofs/`) encloses orbits and writes down the boxes and numbers on which its statement rests. This room reads such a certificate and
//! decides whether the statement follows from the numbers, in fractions of whole numbers: nothing is rounded, and nothing is shared with the prover, neither
//! its intervals nor its integrator nor the equation.
//!
//! What a certificate cannot show by itself is that its enclosures hold the flow. Two things are done about that. Numbers that the prover derived from others are
//! derived again and must be as tight as they can be, so that none can be altered alone; and closed orbits are followed by a plain integrator of this room's
//! own, orbits from a start are compared with tables computed elsewhere. Then an altered number is noticed from about the sixth digit on, or by the
//! numbers that rest on it; `tests/it/verify.rs` alters each in turn and lists what can pass.
//!
//! ```
//! use twofold_verify::{Refused, verify};
//! assert!(matches!(verify("{}"), Err(Refused::Unreadable(_))));
//! ```
#![forbid(unsafe_code)]
#![cfg_attr(test, allow(clippy::disallowed_methods))] // tests compare with tolerances, not with hashes

mod certificate;
mod inner;
mod plain;
mod rational;

pub use certificate::verify;

/// What a certificate shows.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Verified {
    /// The theorem's name.
    pub theorem: String,
    /// Its statement.
    pub statement: String,
    /// What was verified, a line each.
    pub findings: Vec<String>,
}

/// Why a certificate shows nothing.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refused {
    /// It is no certificate that this room knows.
    #[error("not a certificate of a theorem known here: {0}")]
    Unreadable(String),
    /// The statement does not follow from it.
    #[error("{theorem}: {what}: this does not hold")]
    Wrong {
        /// The theorem.
        theorem: String,
        /// What should hold.
        what: String,
    },
}
