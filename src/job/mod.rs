//! The job: a question as data, its computation, and its answer.

pub mod encode;
pub mod simulate;
pub mod spec;
pub mod table;
