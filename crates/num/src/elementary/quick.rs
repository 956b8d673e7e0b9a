//! The hyperbolic tangent of one number by table look-up: the kernel's bits in half of its latency.
//!
//! An integration step evaluates tanh several times, and the kernel is a chain of dependent
//! operations: reduction, polynomial, quotient, correction. Lanes hide this latency; a single
//! number does not. Here tanh is looked up at the nearest multiple of 1/128 and corrected by a
//! short polynomial, which is a second approximation with an error of its own. Where both errors
//! together cannot change the rounded `f64`, the kernel's result is known without evaluating it
//! (the rounding test of Ziv, ACM TOMS 17, 410 (1991)); in the other few per cent of cases the
//! kernel is evaluated. So the bits are always the kernel's, provided that the bounds hold:
//! `tests.rs` compares both results, and the kernel's error with its bound.

use super::super::DoubleDouble;
use super::kernels;

/// Up to here the kernel reduces by nothing: |x| 2/ln 2 rounds to 0 up to 0.17328.
const UNREDUCED: f64 = 0.173;
/// From there to here multiples of 1/128 are tabled, and then, where tanh hardly differs from 1,
/// multiples of 1/16.
const CLOSE: f64 = 7.99;

/// A table of tanh about the multiples of 1/`PER_UNIT` from the `FIRST` one on; `LENGTH` is a power
/// of two.
struct Table<const PER_UNIT: usize, const FIRST: usize, const LENGTH: usize>([Entry; LENGTH]);

/// tanh about a: tanh(a + r) = value + value_rest + (slope + slope_rest) r + c2 r^2 + ... + c7 r^7,
/// in one line of a cache.
///
/// Coefficients of high powers of r need few bits. `slope` has six, so that its product with r,
/// which has 47, is exact.
#[derive(Clone, Copy)]
#[repr(C, align(64))]
struct Entry {
    value: f64,
    slope_rest: f64,
    c2: f64,
    c3: f64,
    c4: f64,
    value_rest: f32,
    slope: f32,
    c5: f32,
    c6: f32,
    c7: f32,
    /// Largest difference between the sum above and the kernel's last sum before it is rounded.
    apart: f32,
}

// exp(-2/128) and exp(-2/16). The sum above is then off by less than 2^-63 and 2^-46 of the slope,
// which at 8 is 2^-21.
static CLOSE_BY: Table<128, 0, 1024> = Table::of(
    DoubleDouble::new(0.984_496_437_005_408_5, -4.749_302_656_635_618_6e-17),
    1.084_202_172_485_504_4e-19,
);
static FAR_OUT: Table<16, 128, 256> = Table::of(
    DoubleDouble::new(0.8824969025845955, -5.224526916735663e-17),
    1.421_085_471_520_200_4e-14,
);

impl<const PER_UNIT: usize, const FIRST: usize, const LENGTH: usize>
    Table<PER_UNIT, FIRST, LENGTH>
{
    /// 1.5 * 2^52 / PER_UNIT: added to a number it leaves the nearest multiple in the last bits of
    /// the sum.
    const ROUNDER: f64 = 6_755_399_441_055_744.0 / PER_UNIT as f64;

    /// `ratio` is exp(-2/PER_UNIT), `error` what the sum of an entry is off by at most, in units of
    /// its slope.
    const fn of(ratio: DoubleDouble, error: f64) -> Self {
        let one = DoubleDouble::new(1.0, 0.0);
        let mut table = [Entry::NONE; LENGTH];
        // exp(-2 a): some 2^-96 of it off at the end.
        let mut e = one;
        let mut i = 0;
        while i < FIRST + LENGTH {
            if i >= FIRST {
                let sum = one.plus(e);
                let value = one.plus(e.negative()).divided_by(sum);
                let slope = DoubleDouble::new(4.0, 0.0).times(e).divided_by(sum.times(sum));
                let apart =
                    kernel_error(i as f64 / PER_UNIT as f64, 0.5 / PER_UNIT as f64, slope.high())
                        + error * slope.high();
                table[i - FIRST] = Entry::of(value, slope, apart);
            }
            e = e.times(ratio);
            i += 1;
        }
        Self(table)
    }

    /// The kernel's tanh, where it can be told.
    #[inline(always)]
    fn tanh(&self, a: f64) -> Option<f64> {
        let rounded = a + Self::ROUNDER;
        let r = a - (rounded - Self::ROUNDER);
        self.0[(rounded.to_bits() as usize).wrapping_sub(FIRST) % LENGTH].tanh(r)
    }
}

impl Entry {
    const NONE: Self = Self {
        value: 0.0,
        slope_rest: 0.0,
        c2: 0.0,
        c3: 0.0,
        c4: 0.0,
        value_rest: 0.0,
        slope: 0.0,
        c5: 0.0,
        c6: 0.0,
        c7: 0.0,
        apart: 0.0,
    };

    /// From y' = 1 - y^2: (n + 1) c_(n+1) = - (c_0 c_n + ... + c_n c_0).
    const fn of(value: DoubleDouble, slope: DoubleDouble, apart: f64) -> Self {
        let (c0, c1) = (value.high(), slope.high());
        let c2 = -(c0 * c1);
        let c3 = -(2.0 * c0 * c2 + c1 * c1) / 3.0;
        let c4 = -(c0 * c3 + c1 * c2) / 2.0;
        let c5 = -(2.0 * (c0 * c4 + c1 * c3) + c2 * c2) / 5.0;
        let c6 = -(c0 * c5 + c1 * c4 + c2 * c3) / 3.0;
        let c7 = -(2.0 * (c0 * c6 + c1 * c5 + c2 * c4) + c3 * c3) / 7.0;
        let few = f64::from_bits(c1.to_bits() & !((1 << 47) - 1));
        Self {
            value: c0,
            slope_rest: (c1 - few) + slope.low(),
            c2,
            c3,
            c4,
            value_rest: value.low() as f32,
            slope: few as f32,
            c5: c5 as f32,
            c6: c6 as f32,
            c7: c7 as f32,
            // A tenth more for the roundings of what it is added to, and of itself.
            apart: (1.1 * apart) as f32,
        }
    }

    #[inline(always)]
    fn tanh(&self, r: f64) -> Option<f64> {
        let (r2, p) = (r * r, r * f64::from(self.slope));
        let high = (f64::from(self.c5) + f64::from(self.c6) * r) + f64::from(self.c7) * r2;
        let tail = r2 * (self.c2 + self.c3 * r) + (r2 * r2) * (self.c4 + r * high);
        // |value| > |p|: the error of their sum is exact (Dekker 1971).
        let sum = self.value + p;
        let rest =
            ((self.value - sum) + p) + ((f64::from(self.value_rest) + r * self.slope_rest) + tail);
        let apart = f64::from(self.apart);
        (sum + (rest - apart) == sum + (rest + apart)).then_some(sum + rest)
    }
}

/// A bound on the kernel's error before its last rounding, within `reach` of `a`, where tanh has
/// the given slope.
///
/// With s the reduced argument, at most 0.1733, u = 2^-53 and T = s + c as in [`kernels::tanh`]: r
/// has an error of u |s|, hence c = r^3 P one of u |s|^3; the roundings of c, six in product and
/// polynomial and one in the difference, come to less than 2.4 u |s|^3, as |P| <= 1/3, and P itself
/// is right to 2^-60 |s|. What T errs by, tanh errs by 1.05 times the slope of. In numerator and
/// denominator two roundings each of (1 +- m) c follow, whose effect is at most 2.42 of 2/3 u
/// |s|^3, for |1 +- m| and tanh go together; those of the quotient's correction are below 2^-78.
const fn kernel_error(a: f64, reach: f64, slope: f64) -> f64 {
    const HALF_LN_2: f64 = std::f64::consts::LN_2 / 2.0;
    const UNIT: f64 = f64::EPSILON / 2.0;
    let k = (a / HALF_LN_2 + 0.5) as u32 as f64;
    let offset = a - k * HALF_LN_2;
    let s = (if offset < 0.0 { -offset } else { offset }) + reach;
    let s = if s < 0.1734 { s } else { 0.1734 };
    UNIT * s * s * s * (3.6 * slope + 2.5) + 1.1 * UNIT / 128.0 * s * slope
}

/// The kernel's tanh of a number below [`kernels::TANH_IS_ONE`] in size.
#[inline(always)]
pub(super) fn tanh(x: f64) -> f64 {
    let a = x.abs();
    if a < UNREDUCED {
        return kernels::unreduced_tanh(a).copysign(x);
    }
    match told(a) {
        Some(result) => result.copysign(x),
        None => asked(x),
    }
}

/// The kernel's tanh of a number from [`UNREDUCED`] on, where it is known without it.
#[inline(always)]
fn told(a: f64) -> Option<f64> {
    if a < CLOSE {
        CLOSE_BY.tanh(a)
    } else if a < kernels::TANH_IS_ONE {
        FAR_OUT.tanh(a)
    } else {
        // NaN.
        None
    }
}

#[cold]
#[inline(never)]
fn asked(x: f64) -> f64 {
    kernels::tanh(x)
}

#[cfg(test)]
mod tests {
    use super::super::tests::mixed;
    use super::*;
    use crate::{Arithmetic, Elementary, Scalar};

    /// Uniform between two numbers.
    fn between(low: f64, high: f64, index: u64) -> f64 {
        low + (high - low) * (mixed(index) >> 11) as f64 / (1_u64 << 53) as f64
    }

    fn same(x: f64) {
        let (quick, kernel) = (tanh(x), kernels::tanh(x));
        assert_eq!(quick.to_bits(), kernel.to_bits(), "{x:e}: {quick:e} and {kernel:e}");
    }

    /// Seams between entries, tables and formulas, and the kernel's own changes.
    #[test]
    fn the_kernels_bits_at_every_seam() {
        let seams =
            (0..2048).map(|i| f64::from(i) / 256.0).chain((0..640).map(|i| f64::from(i) / 32.0));
        let reductions = (0..56).map(|k| (f64::from(k) + 0.5) * std::f64::consts::LN_2 / 2.0);
        for seam in seams.chain(reductions).chain([UNREDUCED, CLOSE, 1e-300, 1e-160, 1e-8]) {
            for shift in 0..32 {
                let x = f64::from_bits(seam.to_bits() + shift);
                same(x);
                same(-f64::from_bits(seam.to_bits().saturating_sub(shift)));
            }
        }
        for x in [0.0, -0.0, f64::MIN_POSITIVE, 5e-324, f64::INFINITY] {
            same(x);
            same(-x);
        }
        assert!(tanh(f64::NAN).is_nan());
    }

    fn the_kernels_bits(exponent: u32) {
        use rayon::prelude::*;
        (0..1_u64 << exponent).into_par_iter().for_each(|i| same(between(-19.1, 19.1, i)));
        (0..1_u64 << exponent).into_par_iter().for_each(|i| same(between(0.1, 1.1, i)));
    }

    #[test]
    fn the_kernels_bits_at_random() {
        the_kernels_bits(16);
    }

    #[test]
    #[ignore = "2 minutes: make elementary"]
    fn the_kernels_bits_at_random_2_30() {
        the_kernels_bits(30);
    }

    /// The two sums apart, in units of what they are allowed to be apart: the worst of 2^`exponent`
    /// arguments.
    fn furthest_apart(exponent: u32, low: f64, high: f64) -> f64 {
        (0..1_u64 << exponent)
            .map(|i| {
                let a = between(low, high, i);
                let exact = DoubleDouble::from_f64(a).tanh();
                let (quotient, correction) = kernels::unrounded_tanh(a);
                let error = (DoubleDouble::from_f64(quotient) + DoubleDouble::from_f64(correction)
                    - exact)
                    .to_f64()
                    .abs();
                let allowed = if a < CLOSE {
                    CLOSE_BY.0[(a * 128.0).round() as usize].apart
                } else {
                    FAR_OUT.0[(a * 16.0).round() as usize - 128].apart
                };
                error / f64::from(allowed)
            })
            .fold(0.0, f64::max)
    }

    /// The bounds hold, and are no larger than they must be by so much that nothing is told.
    #[test]
    fn the_kernel_errs_by_no_more_than_its_bound() {
        for (low, high) in [
            (UNREDUCED, 0.25),
            (0.25, 0.5),
            (0.5, 1.0),
            (1.0, 4.0),
            (4.0, CLOSE),
            (CLOSE, 12.0),
            (12.0, 19.1),
        ] {
            let worst = furthest_apart(14, low, high);
            println!("{low} to {high}: {worst:.3} of the bound");
            assert!(worst < 0.9, "{low} to {high}: {worst}");
            assert!(worst > 0.1, "{low} to {high}: {worst} is too good to be true");
        }
    }

    /// If the table were wrong, or the bounds too large, every bit would still be right: the kernel
    /// would be asked for it.
    #[test]
    fn the_kernel_is_hardly_ever_asked() {
        for (low, high, share) in
            [(UNREDUCED, 0.25, 0.2), (0.25, 0.55, 0.05), (0.55, CLOSE, 0.02), (CLOSE, 19.1, 0.02)]
        {
            let arguments = 1 << 14;
            let asked = (0..arguments).filter(|i| told(between(low, high, *i)).is_none()).count();
            let found = asked as f64 / arguments as f64;
            println!("{low} to {high}: {found:.4}");
            assert!(found < share && asked > 0, "{low} to {high}: {found}");
        }
    }
}
