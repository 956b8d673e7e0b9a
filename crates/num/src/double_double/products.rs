//! Sums of many products, eight side by side in vector registers.
//!
//! A sum of double-double numbers is a chain of dependent additions. Here lane i adds the terms i,
//! i + 8, i + 16, ... : their products' and partial sums' errors are known exactly (Dekker 1971,
//! Knuth 1969) and are added up beside them, as in the algorithm Dot2 of Ogita, Rump & Oishi
//! (2005), whose error is that of twice the working precision. There are eight lanes whatever the
//! machine has, so the bits are the same everywhere.

// Loops by number over registers and lanes: iterators and closures may stay calls, compiled for the
// wrong instruction set.
#![allow(clippy::needless_range_loop)]

use pulp::bytemuck::cast_slice;
use pulp::{Simd, WithSimd};

use super::{DoubleDouble, SPLITTER, quick_two_sum, two_sum};
use crate::Registers;

/// Number of sums side by side.
const LANES: usize = 8;

/// Fewer terms than this are sooner added one after the other.
const FEW: usize = 2;

/// The sum of a_i b_(n-1-i) over the n terms.
pub(super) fn sum_of_products(a: &[DoubleDouble], b: &[DoubleDouble]) -> DoubleDouble {
    if a.len() <= FEW {
        return a.iter().zip(b.iter().rev()).fold(DoubleDouble::ZERO, |sum, (a, b)| sum + *a * *b);
    }
    // Eight lanes are one register, two, or a number each.
    #[cfg(target_arch = "x86_64")]
    if let Some(set) = pulp::x86::V4::try_new() {
        return Simd::vectorize(set, In::<1> { a, b });
    } else if let Some(set) = pulp::x86::V3::try_new() {
        return Simd::vectorize(set, In::<2> { a, b });
    }
    In::<LANES> { a, b }.with_simd(pulp::Scalar)
}

/// The sum in `K` registers.
struct In<'a, const K: usize> {
    a: &'a [DoubleDouble],
    b: &'a [DoubleDouble],
}

impl<const K: usize> WithSimd for In<'_, K> {
    type Output = DoubleDouble;

    #[inline(always)]
    fn with_simd<S: Simd>(self, set: S) -> DoubleDouble {
        let Self { a, b } = self;
        let count = a.len().min(b.len());
        let number = |value: f64| Registers::<S, K>::splat(set, value);
        let (mut sum, mut rest) = (number(0.0), number(0.0));
        let mut from = 0;
        while from < count {
            let used = (count - from).min(LANES);
            let (mut a_high, mut a_low, mut b_high, mut b_low) =
                ([0.0; LANES], [0.0; LANES], [0.0; LANES], [0.0; LANES]);
            let (a, b) = (&a[from..from + used], &b[count - from - used..count - from]);
            if used == LANES {
                for i in 0..LANES {
                    (a_high[i], a_low[i]) = (a[i].high, a[i].low);
                    (b_high[i], b_low[i]) = (b[LANES - 1 - i].high, b[LANES - 1 - i].low);
                }
            } else {
                for i in 0..used {
                    (a_high[i], a_low[i]) = (a[i].high, a[i].low);
                    (b_high[i], b_low[i]) = (b[used - 1 - i].high, b[used - 1 - i].low);
                }
            }
            let lanes = |values: &[f64; LANES]| Registers::<S, K>::load(set, values);
            let (a, a_low, b, b_low) =
                (lanes(&a_high), lanes(&a_low), lanes(&b_high), lanes(&b_low));
            let split = |a: Registers<S, K>| {
                let t = number(SPLITTER) * a;
                let high = t - (t - a);
                (high, a - high)
            };
            let product = a * b;
            let ((a1, a2), (b1, b2)) = (split(a), split(b));
            let error = ((a1 * b1 - product) + a1 * b2 + a2 * b1) + a2 * b2;
            let next = sum + product;
            let back = next - sum;
            let lost = (sum - (next - back)) + (product - back);
            rest += lost + (error + (a * b_low + a_low * b));
            sum = next;
            from += LANES;
        }
        let (mut sums, mut rests) = ([0.0; LANES], [0.0; LANES]);
        sums.copy_from_slice(cast_slice::<_, f64>(&sum.parts()));
        rests.copy_from_slice(cast_slice::<_, f64>(&rest.parts()));
        // Pairs, pairs of pairs, and so on.
        let mut width = LANES / 2;
        while width > 0 {
            for i in 0..width {
                let (sum, lost) = two_sum(sums[i], sums[i + width]);
                sums[i] = sum;
                rests[i] = (rests[i] + rests[i + width]) + lost;
            }
            width /= 2;
        }
        let (high, low) = quick_two_sum(sums[0], rests[0]);
        DoubleDouble { high, low }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::{Arithmetic, MultiFloat, Scalar};

    fn numbers(parts: &[(f64, f64)]) -> Vec<DoubleDouble> {
        parts.iter().map(|(high, low)| DoubleDouble::new(*high, high * low * 1e-16)).collect()
    }

    /// The bits by every way to compute them that this machine has.
    fn every_way(a: &[DoubleDouble], b: &[DoubleDouble]) -> Vec<(&'static str, [u64; 2])> {
        let bits = |sum: DoubleDouble| [sum.high.to_bits(), sum.low.to_bits()];
        let mut ways = vec![("portable", bits(In::<LANES> { a, b }.with_simd(pulp::Scalar)))];
        #[cfg(target_arch = "x86_64")]
        {
            match pulp::x86::V3::try_new() {
                Some(set) => ways.push(("AVX2", bits(Simd::vectorize(set, In::<2> { a, b })))),
                None => println!("AVX2: not run, this machine has none"),
            }
            match pulp::x86::V4::try_new() {
                Some(set) => ways.push(("AVX-512", bits(Simd::vectorize(set, In::<1> { a, b })))),
                None => println!("AVX-512: not run, this machine has none"),
            }
        }
        ways
    }

    proptest! {
        #[test]
        fn are_what_they_are_one_after_the_other(
            a in prop::collection::vec((-2.0..2.0_f64, -1.0..1.0_f64), 0..70),
            b in prop::collection::vec((-2.0..2.0_f64, -1.0..1.0_f64), 70),
        ) {
            let (a, b) = (numbers(&a), numbers(&b[..a.len()]));
            let exact = |x: &DoubleDouble| MultiFloat::<4>::from_f64(x.high)
                + MultiFloat::from_f64(x.low);
            let pairs = || a.iter().zip(b.iter().rev());
            let wanted = pairs().fold(MultiFloat::<4>::from_f64(0.0), |sum, (a,
                b)| sum + exact(a) * exact(b));
            let size: f64 = pairs().map(|(a, b)| (a.high * b.high).abs()).sum();
            let sum = sum_of_products(&a, &b);
            let error = (exact(&sum) - wanted).to_f64().abs();
            // Each of at most 9 terms a lane loses a few units of the rests, which are 2^-53 of
            // what they belong to.
            prop_assert!(error <= 8.0 * DoubleDouble::EPSILON * size, "{error:e} of {size}");
            let ways = every_way(&a, &b);
            for (way, bits) in &ways[1..] {
                prop_assert_eq!(*bits, ways[0].1, "{}", way);
            }
            if a.len() > FEW {
                prop_assert_eq!([sum.high.to_bits(), sum.low.to_bits()], ways[0].1);
            }
        }
    }

    #[test]
    fn infinity_and_nan_are_not_lost() {
        for bad in [f64::INFINITY, f64::NAN] {
            for place in [0, 3, 9, 19] {
                let mut a = vec![DoubleDouble::from_f64(1.0); 20];
                a[place] = DoubleDouble::from_f64(bad);
                let sum = sum_of_products(&a, &vec![DoubleDouble::from_f64(0.5); 20]);
                assert!(!sum.high.is_finite(), "{bad} at {place}: {sum:?}");
            }
        }
    }

    #[test]
    fn what_cancels_is_exact() {
        // 2^60 + 1 - 2^60, far apart, and a term too small for one f64 beside them.
        let mut a = vec![DoubleDouble::ZERO; 24];
        a[0] = DoubleDouble::from_f64(2.0_f64.powi(60));
        a[5] = DoubleDouble::from_decimal(1.0);
        a[13] = DoubleDouble::from_f64(-(2.0_f64.powi(60)));
        a[23] = DoubleDouble::from_f64(2.0_f64.powi(-40));
        let sum = sum_of_products(&a, &vec![DoubleDouble::from_f64(1.0); 24]);
        assert_eq!(sum.to_f64(), 1.0 + 2.0_f64.powi(-40));
    }
}
