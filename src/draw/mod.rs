//! From answers to drawings: sketches and surfaces made of plain data.

pub mod level;
pub mod plot;
pub mod scan;
pub mod sketch;
pub mod surface;
