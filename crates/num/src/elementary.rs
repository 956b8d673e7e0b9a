//! Elementary functions with the same bits on every machine.
//!
//! The platform's `tanh` differs by an ulp or two between C libraries, and one ulp made near a
//! two-fold singularity is visible in a picture after the first visit. [`tanh`] and [`exp`] are our
//! own (`elementary/kernels.rs`): straight-line code that a compiler can vectorise, with the same
//! bits in a lane as alone. The others are the pure-Rust translation of musl's functions in the
//! `libm` crate, pinned by `Cargo.lock`.
//!
//! Why not the correctly rounded `pxfm`? Because it chooses between code with and without fused
//! multiply-add by looking at the CPU at run time; equal results are then a hope about rounding,
//! not a property of the code. Ours and `libm`'s have one code path. A tanh by itself is first
//! looked for in a table (`elementary/quick.rs`), with an answer only where it is proved to be that
//! one path's. Their last-bit error is a fact of the computation, the same everywhere; how large it
//! is stands beside each function: the worst of 2^24 points, in units of the result's last place
//! (`elementary/others.rs`, `make elementary`).

#[doc(hidden)]
pub mod kernels;
mod quick;

/// Hyperbolic tangent. Odd to the bit; exactly +-1 from 19.1 on; NaN gives NaN.
///
/// Largest error found: 0.531 units in the last place, on 2^24 points (`make elementary`, which can
/// also go to 2^30).
#[inline]
pub fn tanh(x: f64) -> f64 {
    // The kernel gives the same; this only saves its work, and outside the layer there is no other.
    // Two comparisons and no sign copied, so that a processor that has guessed where an orbit is
    // goes on without waiting for x.
    if x >= kernels::TANH_IS_ONE {
        1.0
    } else if x <= -kernels::TANH_IS_ONE {
        -1.0
    } else {
        tanh_inside(x)
    }
}

/// Out of line, so that an equation stays small enough to be inlined.
#[inline(never)]
fn tanh_inside(x: f64) -> f64 {
    quick::tanh(x)
}

/// Exponential, base e.
///
/// Largest error found: 0.716 units in the last place where the result is a normal number, on 2^24
/// points (`make elementary`, which can also go to 2^30); at most one in a subnormal one.
///
/// Out of line, as [`tanh`]'s work is: straight-line code beside a branch would be computed whether
/// its result is wanted or not.
#[inline(never)]
pub fn exp(x: f64) -> f64 {
    kernels::exp(x)
}

/// `base` to the power `exponent` for step control: to about 1e-14 for a `base` that is not
/// negative and an exponent between -1 and 1. Base 0 counts as 2^-1077; results are kept between
/// 2^-1022 and 2^1023; NaN gives NaN.
///
/// A step size need not be accurate to the last digit, only equal on every machine: this is several
/// times cheaper than [`pow`].
#[inline]
pub fn rough_pow(base: f64, exponent: f64) -> f64 {
    kernels::rough_exp2(exponent * kernels::rough_log2(base))
}

/// Logarithm, base 2, for step control: see [`rough_pow`].
#[inline]
pub fn rough_log2(x: f64) -> f64 {
    kernels::rough_log2(x)
}

/// 2^x for step control: see [`rough_pow`].
#[inline]
pub fn rough_exp2(x: f64) -> f64 {
    kernels::rough_exp2(x)
}

/// Natural logarithm. Largest error found: 0.811 units.
#[inline]
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// Arc tangent, in radians, in [-pi/2, pi/2]. Odd to the bit. Largest error found: 0.850 units.
#[inline]
pub fn atan(x: f64) -> f64 {
    libm::atan(x)
}

/// Error function, 2/sqrt(pi) times the integral of exp(-s^2) from 0 to x. Odd to the bit. Largest
/// error found: 0.977 units.
#[inline]
pub fn erf(x: f64) -> f64 {
    libm::erf(x)
}

/// Base-2 logarithm; exact for powers of two. Largest error found: 0.780 units.
#[inline]
pub fn log2(x: f64) -> f64 {
    libm::log2(x)
}

/// Base-10 logarithm; exact for 1 to 10^22. Largest error found: 0.707 units.
#[inline]
pub fn log10(x: f64) -> f64 {
    libm::log10(x)
}

/// Sine of an angle in radians. Odd to the bit. Largest error found: 0.781 units.
#[inline]
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// Cosine of an angle in radians. Even to the bit. Largest error found: 0.785 units.
#[inline]
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// Angle of the point `(x, y)`, in radians, in (-pi, pi]. Odd in y to the bit. Largest error found:
/// 1.501 units.
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// `base` to the power `exponent`. Largest error found: 0.846 units for exponents below 2^31 in
/// size; beyond, 145 units were seen (no computation here asks for that).
#[inline]
pub fn pow(base: f64, exponent: f64) -> f64 {
    libm::pow(base, exponent)
}

/// Square root. IEEE 754 requires the correctly rounded result, so the hardware instruction is
/// portable.
#[inline]
pub fn sqrt(x: f64) -> f64 {
    x.sqrt()
}

/// The point 10^x, for tolerances such as 10^-7.97727; exact for whole numbers from 0 to 22.
/// Largest error found: 3.757 units.
#[inline]
pub fn exp10(x: f64) -> f64 {
    libm::exp10(x)
}

#[cfg(test)]
mod others;
#[cfg(test)]
mod tests;
