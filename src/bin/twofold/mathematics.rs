//! The only module with an unsafe attribute: names of the platform's library of mathematics,
//! defined as our own functions.
//!
//! Some dependencies name such functions through the standard library: indicatif (the time left
//! beside a bar), num-bigint (how much memory digits will take), plotters (ticks that are not used
//! here), read-fonts (slanted and composite glyphs, which the embedded fonts do not have). None of
//! it reaches a hash. Defined here, in the program itself, the linker has no need of the
//! platform's, so that a program cannot compute differently where that library is another one;
//! `tests/it/binary.rs` looks that none is asked for. What is unsafe about it is the promise that
//! these names have the types and meanings that C gives them (C17, 7.12), which they have.
//!
//! Only on Linux, where that is tested; not in the library, which must not change the functions
//! that other programs call. The Python module defines them too, with local binding
//! (`python/build.rs`).
#![allow(unsafe_code)]

use twofold::num::elementary;

/// Natural logarithm.
#[unsafe(no_mangle)]
extern "C" fn log(x: f64) -> f64 {
    elementary::ln(x)
}

/// Logarithm to base 10.
#[unsafe(no_mangle)]
extern "C" fn log10(x: f64) -> f64 {
    elementary::log10(x)
}

/// Logarithm to base 2.
#[unsafe(no_mangle)]
extern "C" fn log2(x: f64) -> f64 {
    elementary::log2(x)
}

/// `x` to the power `y`.
#[unsafe(no_mangle)]
extern "C" fn pow(x: f64, y: f64) -> f64 {
    elementary::pow(x, y)
}

/// Tangent of an angle in radians.
#[unsafe(no_mangle)]
extern "C" fn tanf(x: f32) -> f32 {
    let x = f64::from(x);
    (elementary::sin(x) / elementary::cos(x)) as f32
}

/// Sine and cosine of an angle in radians (GNU): what the compiler makes of asking for both. C's
/// pointers are never null here, so they are references.
#[unsafe(no_mangle)]
extern "C" fn sincosf(x: f32, sine: &mut f32, cosine: &mut f32) {
    let x = f64::from(x);
    (*sine, *cosine) = (elementary::sin(x) as f32, elementary::cos(x) as f32);
}

/// Length of the vector (x, y).
#[unsafe(no_mangle)]
extern "C" fn hypotf(x: f32, y: f32) -> f32 {
    let (x, y) = (f64::from(x), f64::from(y));
    elementary::sqrt(x * x + y * y) as f32
}
