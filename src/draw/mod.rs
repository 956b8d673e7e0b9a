//! From answers to drawings: sketches and surfaces made of plain data.

pub mod sketch;
pub mod surface;
