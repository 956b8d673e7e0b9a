//! Random numbers that are the same on every machine and in every release.
//!
//! The generator is ChaCha8, named in the spec; its output stream is fixed by its definition,
//! unlike `rand`'s `StdRng`, which is documented as free to change. The maps from bits to numbers
//! are our own, because library distributions may change between releases or reach the platform's
//! math functions.

use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};

use super::elementary::{cos, ln, sin, sqrt};

/// A stream of random numbers: ChaCha8 with a 64-bit seed and a 64-bit stream number.
///
/// One stream per run: runs computed side by side never share or reorder numbers.
///
/// ```
/// use twofold_num::random::RandomStream;
/// let mut one = RandomStream::new(2013, 0);
/// let mut same = RandomStream::new(2013, 0);
/// let mut other = RandomStream::new(2013, 1);
/// let u = one.uniform();
/// assert_eq!(u, same.uniform());
/// assert_ne!(u, other.uniform());
/// ```
#[derive(Debug)]
pub struct RandomStream {
    generator: ChaCha8Rng,
}

/// The copy gives the numbers that the stream has still to give.
impl Clone for RandomStream {
    fn clone(&self) -> Self {
        let mut generator = ChaCha8Rng::from_seed(self.generator.get_seed());
        generator.set_stream(self.generator.get_stream());
        generator.set_word_pos(self.generator.get_word_pos());
        Self { generator }
    }
}

impl RandomStream {
    /// The stream `stream` of the generator seeded with `seed`.
    pub fn new(seed: u64, stream: u64) -> Self {
        let mut key = [0_u8; 32];
        key[..8].copy_from_slice(&seed.to_le_bytes());
        let mut generator = ChaCha8Rng::from_seed(key);
        generator.set_stream(stream);
        Self { generator }
    }

    /// Uniform on [0, 1): the upper 53 bits of a 64-bit word, divided by 2^53.
    pub fn uniform(&mut self) -> f64 {
        const TWO_TO_MINUS_53: f64 = 1.0 / 9_007_199_254_740_992.0;
        (self.generator.next_u64() >> 11) as f64 * TWO_TO_MINUS_53
    }

    /// Uniform on [low, high).
    pub fn uniform_in(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.uniform()
    }

    /// Standard normal, by the trigonometric method of Box & Muller (1958); the second value of a
    /// pair is dropped so that the count of words per number is fixed.
    pub fn normal(&mut self) -> f64 {
        let u = 1.0 - self.uniform();
        let v = self.uniform();
        sqrt(-2.0 * ln(u)) * cos(std::f64::consts::TAU * v)
    }

    /// A unit vector with uniform direction on the sphere in three dimensions (Archimedes: the
    /// height is uniform).
    pub fn direction(&mut self) -> [f64; 3] {
        let height = self.uniform_in(-1.0, 1.0);
        let angle = std::f64::consts::TAU * self.uniform();
        let radius = sqrt(1.0 - height * height);
        [radius * cos(angle), radius * sin(angle), height]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STREAM_0: [u64; 3] =
        [0x0eda_eda7_02cc_bb80, 0x1fb6_f0df_1efd_38ac, 0x22b8_2cd4_e4f6_87bf];
    const STREAM_1: [u64; 3] =
        [0x428c_389f_ec6a_f3bc, 0x46a5_217c_8306_523d, 0x1250_c060_17f8_ad79];

    #[test]
    fn stream_is_frozen() {
        // ChaCha8 with the key 2013, 0, 0, ... in little-endian order, computed outside this
        // project from its definition (Bernstein 2008): the first words of 64 bits of streams 0 and
        // 1, without their lowest 11 bits.
        for (stream, words) in [(0, STREAM_0), (1, STREAM_1)] {
            let mut r = RandomStream::new(2013, stream);
            for word in words {
                assert_eq!(r.uniform(), (word >> 11) as f64 / 9_007_199_254_740_992.0);
            }
        }
    }

    #[test]
    fn a_copy_gives_the_numbers_that_follow() {
        let mut one = RandomStream::new(2013, 7);
        for _ in 0..100 {
            let mut copy = one.clone();
            for number in [one.uniform(), one.uniform(), one.uniform()] {
                assert_eq!(copy.uniform(), number);
            }
        }
    }

    #[test]
    fn directions_are_unit_and_balanced() {
        let mut r = RandomStream::new(1, 0);
        let n = 20_000;
        let mut mean = [0.0; 3];
        let mut second = [0.0; 3];
        for _ in 0..n {
            let d = r.direction();
            assert!((d.iter().map(|c| c * c).sum::<f64>() - 1.0).abs() < 1e-14);
            for i in 0..3 {
                mean[i] += d[i] / n as f64;
                second[i] += d[i] * d[i] / n as f64;
            }
        }
        // Standard errors: sqrt(1/3/n) = 0.004 and sqrt(4/45/n) = 0.002; five of them.
        for i in 0..3 {
            assert!(mean[i].abs() < 0.02, "{mean:?}");
            assert!((second[i] - 1.0 / 3.0).abs() < 0.011, "{second:?}");
        }
    }

    #[test]
    fn normal_moments() {
        let mut r = RandomStream::new(7, 3);
        let n = 40_000;
        let (mut m1, mut m2, mut m4) = (0.0, 0.0, 0.0);
        for _ in 0..n {
            let x = r.normal();
            m1 += x / n as f64;
            m2 += x * x / n as f64;
            m4 += x * x * x * x / n as f64;
        }
        assert!(
            m1.abs() < 0.025 && (m2 - 1.0).abs() < 0.04 && (m4 - 3.0).abs() < 0.25,
            "{m1} {m2} {m4}"
        );
    }
}
