//! The shortest text that reads as a number.

use std::io::Write as _;

/// Appends what `Debug` writes of a number: the fewest digits that read as it, and of those the
/// nearest. Nothing for a blank (NaN).
///
/// The crate `zmij` finds the same digits several times faster, but where two texts of fewest
/// digits are equally near it takes another one than the standard library. So it is asked only
/// where that cannot be.
///
/// Let x = m 2^-k, 2^52 <= m < 2^53, be below 2^32, hence k >= 21, and let c/10^d and (c + 1)/10^d
/// be its two shortest texts, equally far from it. Then x = (2c + 1)/(2 10^d), and m 5^d 2^(d+1) =
/// (2c + 1) 2^k: m ends in k - d - 1 zeros. No text with a digit less reads as x, though every
/// number does that is less than 2^-k/2 above it or 2^-k/4 below; so 10^-(d-1) is at least 3/4
/// 2^-k, and d at most 0.302 k + 1.13. Hence m ends in 0.698 k - 2.13 zeros or more: thirteen at
/// least.
pub(super) fn shortest(text: &mut Vec<u8>, value: f64) {
    const ORDINARY: std::ops::Range<f64> = 1e-4..4_294_967_296.0;
    if ORDINARY.contains(&value.abs()) && value.to_bits().trailing_zeros() < 13 {
        text.extend_from_slice(zmij::Buffer::new().format_finite(value).as_bytes());
    } else if !value.is_nan() {
        // Memory takes what is written to it.
        let _ = write!(text, "{value:?}");
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use twofold_num::random::RandomStream;

    fn check(value: f64) {
        let mut text = Vec::new();
        shortest(&mut text, value);
        assert_eq!(String::from_utf8(text).unwrap(), format!("{value:?}"));
    }

    #[test]
    fn as_the_standard_library() {
        let mut random = RandomStream::new(20, 13);
        for _ in 0..200_000 {
            // Every size from 2^-20 to 2^60, random digits, and mantissas that end in any number of
            // zeros or ones.
            let exponent = 1023 - 20 + (random.uniform() * 80.0) as u64;
            let mantissa = (random.uniform() * 2.0_f64.powi(52)) as u64;
            let short = (random.uniform() * 53.0) as u32;
            for mantissa in [mantissa, mantissa >> short << short, mantissa | ((1 << short) - 1)] {
                let value = f64::from_bits(exponent << 52 | mantissa & ((1 << 52) - 1));
                check(value);
                check(-value);
            }
        }
        for value in [
            0.0,
            -0.0,
            1.0,
            0.1,
            1e-4,
            9.999999999999999e-5,
            1e-5,
            1e16,
            5e-324,
            f64::MAX,
            f64::INFINITY,
        ] {
            check(value);
            check(-value);
        }
        let mut text = Vec::new();
        shortest(&mut text, f64::NAN);
        assert!(text.is_empty());
    }

    /// Values for which the two writers differ, which is why the one is not simply the other: both
    /// neighbours are equally near.
    #[test]
    fn where_two_texts_are_equally_near() {
        let mut ties = 0;
        // 2^50 + j/4: half way between two texts of seventeen digits.
        for j in 0..1000 {
            let value = 2.0_f64.powi(50) + f64::from(j) * 0.25;
            check(value);
            ties += usize::from(zmij::Buffer::new().format_finite(value) != format!("{value:?}"));
        }
        assert!(ties > 0, "zmij and the standard library agree by now: this module can go");
    }
}
