//! The figures of Jeffrey (2013) and our own about it: every number of the captions, the committed
//! references and the data they rest on, what is counted in them ([`study`]), and the report.
//!
//! A figure's file calls the library by its public name and paths, as a user's figure does
//! (`examples/own_figure.rs`).
#![forbid(unsafe_code)]
// tests compare with tolerances, not with hashes
#![cfg_attr(test, allow(clippy::disallowed_methods))]

extern crate self as twofold;
#[rustfmt::skip]
use {
    twofold_analyse as analyse, twofold_integrate as integrate, twofold_job as job,
        twofold_job::record, twofold_num as num,
    twofold_paper as paper, twofold_render as render, twofold_system as system,
};

mod computed;
mod figures;
pub mod reading;
pub mod report;
mod sketch;
pub mod study;

pub use figures::*;
pub use reading::Reading;
