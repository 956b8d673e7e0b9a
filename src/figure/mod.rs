//! Figures as data: specs, simulation, pipeline, drawing.

pub mod simulate;
pub mod spec;
