//! Figures as plain data.

pub mod sketches;
