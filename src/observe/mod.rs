//! What is made of steps: the character of an attractor, its exponents and its multipliers.

pub mod attractor;
pub mod floquet;
pub mod lyapunov;
pub mod tangent;
