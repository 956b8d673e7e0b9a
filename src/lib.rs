//! `twofold`: reference software for the breakdown of determinism at a two-fold singularity.

pub mod model;
pub mod num;
pub mod render;
