//! `twofold`: reference software for the breakdown of determinism at a two-fold singularity.

pub mod figure;
pub mod integrate;
pub mod model;
pub mod num;
