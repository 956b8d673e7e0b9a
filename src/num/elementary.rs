//! Elementary functions with the same bits on every machine.
//!
//! The platform's `tanh` differs by an ulp or two between C libraries, and one ulp made near a two-fold
//! singularity is visible in a picture after the first visit. Everything here is the pure-Rust translation of
//! musl's functions in the `libm` crate, pinned by `Cargo.lock`.
//!
//! Why not the correctly rounded `pxfm`? Because it chooses between code with and without fused multiply-add by
//! looking at the CPU at run time; equal results are then a hope about rounding, not a property of the code. `libm`
//! has one code path. Its last-bit error is a fact of the computation, the same everywhere.

/// Hyperbolic tangent.
#[inline]
pub fn tanh(x: f64) -> f64 {
    // Beyond 22 the result rounds to +-1 in f64 (musl takes the same branch, but only after bit inspection).
    if x > 22.0 {
        1.0
    } else if x < -22.0 {
        -1.0
    } else {
        libm::tanh(x)
    }
}

/// Exponential, base e.
#[inline]
pub fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Natural logarithm.
#[inline]
pub fn ln(x: f64) -> f64 {
    libm::log(x)
}

/// Arc tangent, in radians, in [-pi/2, pi/2].
#[inline]
pub fn atan(x: f64) -> f64 {
    libm::atan(x)
}

/// Error function, 2/sqrt(pi) times the integral of exp(-s^2) from 0 to x.
#[inline]
pub fn erf(x: f64) -> f64 {
    libm::erf(x)
}

/// Base-10 logarithm.
#[inline]
pub fn log10(x: f64) -> f64 {
    libm::log10(x)
}

/// Sine of an angle in radians.
#[inline]
pub fn sin(x: f64) -> f64 {
    libm::sin(x)
}

/// Cosine of an angle in radians.
#[inline]
pub fn cos(x: f64) -> f64 {
    libm::cos(x)
}

/// Angle of the point `(x, y)`, in radians, in (-pi, pi].
#[inline]
pub fn atan2(y: f64, x: f64) -> f64 {
    libm::atan2(y, x)
}

/// `base` to the power `exponent`.
#[inline]
pub fn pow(base: f64, exponent: f64) -> f64 {
    libm::pow(base, exponent)
}

/// Square root. IEEE 754 requires the correctly rounded result, so the hardware instruction is portable.
#[inline]
pub fn sqrt(x: f64) -> f64 {
    x.sqrt()
}

/// The point 10^x, for tolerances such as NDSolve's 10^-7.97727.
#[inline]
pub fn exp10(x: f64) -> f64 {
    libm::exp10(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tanh_saturates_exactly_outside_the_layer() {
        // SCIENCE: in f64, tanh is exactly +-1 for arguments beyond 19.1; the field there is a polynomial.
        for x in [19.1, 20.0, 22.0, 22.5, 1e300] {
            assert_eq!(tanh(x), 1.0);
            assert_eq!(tanh(-x), -1.0);
        }
        assert!(tanh(18.7) < 1.0);
    }

    #[test]
    fn known_bits() {
        // Frozen bits: a change of library or version shows here before it shows in a picture.
        assert_eq!(tanh(0.5).to_bits(), 0.46211715726000973_f64.to_bits());
        // One ulp above the correctly rounded e: libm promises an error below one ulp, not correct rounding.
        assert_eq!(exp(1.0).to_bits(), std::f64::consts::E.to_bits() + 1);
        assert_eq!(ln(2.0).to_bits(), std::f64::consts::LN_2.to_bits());
        assert_eq!(atan(1.0).to_bits(), std::f64::consts::FRAC_PI_4.to_bits());
        assert_eq!(erf(0.5).to_bits(), 0.520_499_877_813_046_5_f64.to_bits());
    }
}
