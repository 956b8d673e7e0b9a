//! Our own elementary functions, written once for a number and for a bundle of lanes.
//!
//! Everything here is straight-line code: no branch on a value, no table, no fused multiply-add,
//! only additions, products, quotients (each rounded once, as IEEE 754 demands) and operations on
//! the bits of single numbers. Hence the same bits on every machine, with every instruction set,
//! and in a lane as in a number by itself; and hence code that a compiler turns into vector
//! instructions.
//!
//! Literature. Cody & Waite, Software Manual for the Elementary Functions (1980): reduction by a
//! constant in two pieces. Dekker (1971): the exact sum of two numbers of known order. Tang, ACM
//! TOMS 15, 144 (1989) and 18, 211 (1992): exp and expm1, where the error goes and how to keep it
//! small. Muller, Elementary Functions (3rd ed. 2016), chs. 3, 11. Beebe, The Mathematical-Function
//! Computation Handbook (2017), ch. 12: tanh. The polynomials interpolate at Chebyshev nodes,
//! computed with 300 bits (`scripts/elementary.py`).

use super::super::scalar::Arithmetic;

/// A number, or several side by side, whose parts can be treated one by one.
pub trait Pointwise: Arithmetic {
    /// `f` of every part.
    fn map(self, f: impl Fn(f64) -> f64) -> Self;
    /// `f` of every pair of parts.
    fn map2(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self;
}

impl Pointwise for f64 {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        f(self)
    }
    #[inline(always)]
    fn map2(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        f(self, other)
    }
}

/// 1.5 * 2^52: added to a number below 2^51 in size it leaves the nearest integer in the last bits
/// of the sum.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// From here on tanh rounds to 1: 1 - tanh x < 2 exp(-2 x) < 2^-54 from x = 19.0615 on.
pub const TANH_IS_ONE: f64 = 19.1;

/// The polynomial with the coefficients `c`, lowest first, by Estrin's scheme for 7 coefficients.
#[inline(always)]
fn polynomial7<T: Pointwise>(u: T, c: [f64; 7]) -> T {
    // Written out: `map` would stay a call, compiled for another instruction set than the lanes
    // around it.
    let [c0, c1, c2, c3] =
        [T::from_f64(c[0]), T::from_f64(c[1]), T::from_f64(c[2]), T::from_f64(c[3])];
    let [c4, c5, c6] = [T::from_f64(c[4]), T::from_f64(c[5]), T::from_f64(c[6])];
    let u2 = u * u;
    let (low, middle, high) = (c0 + c1 * u, c2 + c3 * u, c4 + c5 * u);
    (low + u2 * middle) + (u2 * u2) * (high + u2 * c6)
}

/// The upper 26 bits: products of two such numbers are exact.
#[inline(always)]
fn head<T: Pointwise>(x: T) -> T {
    x.map(|v| f64::from_bits(v.to_bits() & !((1 << 27) - 1)))
}

/// (tanh s - s)/s^3 on |s| <= ln(2)/4 as a polynomial in s^2: with it tanh s is approximated to
/// 2^-60, relatively.
const TANH: [f64; 7] = [
    -0.333_333_333_333_333_3,
    0.133_333_333_333_328_36,
    -0.053_968_253_965_606_51,
    0.021_869_488_006_597_864,
    -0.008_863_185_040_949_143,
    0.003_589_652_526_481_452_7,
    -0.001_395_382_800_521_272,
];

/// Hyperbolic tangent.
///
/// With a = |x| = k ln(2)/2 + r, |r| <= ln(2)/4, T = tanh r and m = 2^-k: tanh a = [(1 - m) + (1 +
/// m) T] / [(1 + m) + (1 - m) T]. T is an odd polynomial; numerator and denominator are kept as
/// sums of two numbers, and one step of long division with exact products corrects the quotient. So
/// the only error of size is the last rounding.
#[inline(always)]
pub fn tanh<T: Pointwise>(x: T) -> T {
    // The comparison is false for NaN, which goes through.
    let (quotient, correction) =
        unrounded_tanh(x.map(|v| if v.abs() > TANH_IS_ONE { TANH_IS_ONE } else { v.abs() }));
    (quotient + correction).map2(x, f64::copysign)
}

/// For 0 <= a <= [`TANH_IS_ONE`], as the sum of two numbers.
#[inline(always)]
pub(super) fn unrounded_tanh<T: Pointwise>(a: T) -> (T, T) {
    const TWO_OVER_LN_2: f64 = 2.885_390_081_777_926_8;
    // ln(2)/2 = C1 + C2: C1 has 44 bits, so that k C1 is exact for k <= 56.
    const C1: f64 = 0.346_573_590_279_945_17;
    const C2: f64 = 2.748_961_509_354_185_6e-14;
    let one = T::from_f64(1.0);
    let rounded = a * T::from_f64(TWO_OVER_LN_2) + T::from_f64(ROUNDER);
    let k = rounded - T::from_f64(ROUNDER);
    let m = rounded.map(|v| f64::from_bits(1023_u64.wrapping_sub(v.to_bits()) << 52));
    // T = s + c: s is exact, c at most s^2/3 of it. The cube wants the whole argument, s - k C2.
    let s = a - k * T::from_f64(C1);
    let low = k * T::from_f64(C2);
    let r = s - low;
    let u = r * r;
    let c = (r * u) * polynomial7(u, TANH) - low;

    // 1 - m and 1 + m, exact sums of two.
    let (minus, plus) = (one - m, one + m);
    let (minus_rest, plus_rest) = ((one - minus) - m, (one - plus) + m);
    let (ms, mc) = (m * s, m * c);
    // (1 - m) + s + m s + (1 + m) c: each sum's first term is zero or the larger one, so that its
    // error is exact (Dekker 1971).
    let n1 = minus + s;
    let n2 = n1 + ms;
    let rest = (((minus - n1) + s) + ((n1 - n2) + ms)) + ((c + mc) + minus_rest);
    let n = n2 + rest;
    let n_rest = (n2 - n) + rest;
    let d1 = plus + s;
    let d2 = d1 - ms;
    let rest = (((plus - d1) + s) + ((d1 - d2) - ms)) + ((c - mc) + plus_rest);
    let d = d2 + rest;
    let d_rest = (d2 - d) + rest;

    let inverse = one / d;
    let quotient = n * inverse;
    let (d_head, q_head) = (head(d), head(quotient));
    let d_tail = (d - d_head) + d_rest;
    let q_tail = quotient - q_head;
    let remainder = (((n - q_head * d_head) - q_tail * d_head) - quotient * d_tail) + n_rest;
    (quotient, remainder * inverse)
}

/// The same for 0 <= a <= ln(2)/4, to the bit: there k = 0 and m = 1, hence d = 2 without a rest, n
/// and its rest are twice s + c, rounded, and what that leaves, and the quotient is s + c rounded.
#[inline(always)]
pub(super) fn unreduced_tanh(a: f64) -> f64 {
    let u = a * a;
    a + (a * u) * polynomial7(u, TANH)
}

/// Exponential, base e.
///
/// With x = k ln 2 + r, |r| <= ln(2)/2: e^x = 2^k e^r, e^r = 1 + r + r^2 Q(r), summed so that only
/// the last rounding is of size (Tang 1989). The power of two is applied in two factors, so that
/// results may be subnormal or overflow.
#[inline(always)]
pub fn exp<T: Pointwise>(x: T) -> T {
    const ONE_OVER_LN_2: f64 = std::f64::consts::LOG2_E;
    // ln 2 = L1 + L2: L1 has 40 bits, so that k L1 is exact for |k| <= 2048.
    const L1: f64 = 0.693_147_180_559_663;
    const L2: f64 = 2.823_529_056_303_157_7e-13;
    // (exp r - 1 - r)/r^2 on |r| <= ln(2)/2, to 2^-61 of exp r.
    const Q: [f64; 7] = [
        0.5,
        0.166_666_666_666_666_7,
        0.041_666_666_666_666_67,
        0.008_333_333_333_326_136,
        0.001_388_888_888_888_374_8,
        1.984_126_987_482_062_7e-4,
        2.480_158_732_554_774_3e-5,
    ];
    const Q_HIGH: [f64; 4] = [
        2.755_725_540_020_642_2e-6,
        2.755_727_364_311_03e-7,
        2.510_521_700_472_074_5e-8,
        2.091_468_696_808_687_6e-9,
    ];
    let one = T::from_f64(1.0);
    // Beyond these the result is 0 or infinite anyway. NaN goes through.
    let x = x.map(|v| if v > 710.0 { 710.0 } else { v });
    let x = x.map(|v| if v < -746.0 { -746.0 } else { v });
    let rounded = x * T::from_f64(ONE_OVER_LN_2) + T::from_f64(ROUNDER);
    let k = rounded - T::from_f64(ROUNDER);
    let high = x - k * T::from_f64(L1);
    let low = k * T::from_f64(L2);
    let r = high - low;
    let r2 = r * r;
    let [h0, h1] = [T::from_f64(Q_HIGH[0]), T::from_f64(Q_HIGH[1])];
    let [h2, h3] = [T::from_f64(Q_HIGH[2]), T::from_f64(Q_HIGH[3])];
    let r4 = r2 * r2;
    let top = (h0 + h1 * r) + r2 * (h2 + h3 * r);
    let q = r2 * (polynomial7(r, Q) + ((r4 * r2) * r) * top);
    let sum = one + high;
    let e = sum + (((one - sum) + high) + (q - low));
    // k + 2048, halved; the exponent fields of 2^floor(k/2) and 2^ceil(k/2).
    let lower = rounded.map(|v| {
        let t = v.to_bits().wrapping_add(2048) & 0xfff;
        f64::from_bits(((t >> 1).wrapping_sub(1) & 0x7ff) << 52)
    });
    let upper = rounded.map(|v| {
        let t = v.to_bits().wrapping_add(2048) & 0xfff;
        f64::from_bits((t.wrapping_sub(t >> 1).wrapping_sub(1) & 0x7ff) << 52)
    });
    e * lower * upper
}

/// Logarithm, base 2, of a number that is not negative, for step control: to 2^-50 absolutely or
/// relatively, whichever is larger. 0 counts as 2^-1077; infinity and NaN go through.
#[inline(always)]
pub fn rough_log2<T: Pointwise>(x: T) -> T {
    // log2((1 + s)/(1 - s))/s as a polynomial in s^2, |s| <= (sqrt 2 - 1)/(sqrt 2 + 1).
    const L: [f64; 7] = [
        2.885_390_081_777_927,
        0.961_796_693_924_332_5,
        0.577_078_017_247_236,
        0.412_198_401_900_165_77,
        0.320_616_398_922_117_7,
        0.261_443_890_737_714_35,
        0.242_920_517_553_120_75,
    ];
    const TWO_54: f64 = 18_014_398_509_481_984.0;
    /// The bits of sqrt(1/2): mantissas are taken from there to sqrt 2.
    const FIRST: u64 = 0x3fe6_a09e_667f_3bcd;
    const FIELD: u64 = 0xfff0_0000_0000_0000;
    let one = T::from_f64(1.0);
    let normal = x.map(|v| if v < f64::MIN_POSITIVE { v * TWO_54 } else { v });
    let shift = x.map(|v| if v < f64::MIN_POSITIVE { -54.0 } else { 0.0 });
    // The exponent as a number: its bits, biased to stay positive, in the last bits of 2^52.
    let exponent = normal.map(|v| {
        let biased = (v.to_bits().wrapping_sub(FIRST) >> 52).wrapping_add(2048) & 0xfff;
        f64::from_bits(4_503_599_627_370_496.0_f64.to_bits() | biased)
    });
    // The difference above is negative for v < sqrt(1/2); two's complement in 12 bits makes 2048 +
    // k of both.
    let exponent = exponent - T::from_f64(4_503_599_627_370_496.0 + 2048.0);
    let mantissa = normal
        .map(|v| f64::from_bits(v.to_bits().wrapping_sub(v.to_bits().wrapping_sub(FIRST) & FIELD)));
    let s = (mantissa - one) / (mantissa + one);
    let result = (exponent + shift) + s * polynomial7(s * s, L);
    result.map2(x, |r, v| if v < f64::INFINITY { r } else { v })
}

/// 2^x for step control, to 2^-49 relatively. Results are kept between 2^-1022 and 2^1023; NaN goes
/// through.
#[inline(always)]
pub fn rough_exp2<T: Pointwise>(x: T) -> T {
    // (2^f - 1)/f on |f| <= 1/2.
    const G: [f64; 7] = [
        0.693_147_180_559_946_2,
        0.240_226_506_959_100_75,
        0.055_504_108_664_651_54,
        0.009_618_129_107_618_658,
        0.001_333_355_820_082_724,
        1.540_353_042_479_538e-4,
        1.525_267_290_047_53e-5,
    ];
    const G_HIGH: [f64; 3] =
        [1.321_545_161_914_660_7e-6, 1.020_591_098_488_986_2e-7, 7.070_981_083_365_768e-9];
    let x = x.map(|v| if v > 1023.0 { 1023.0 } else { v });
    let x = x.map(|v| if v < -1022.0 { -1022.0 } else { v });
    let rounded = x + T::from_f64(ROUNDER);
    let f = x - (rounded - T::from_f64(ROUNDER));
    let power = rounded.map(|v| f64::from_bits(v.to_bits().wrapping_add(1023) << 52));
    let f2 = f * f;
    let [g0, g1, g2] = [T::from_f64(G_HIGH[0]), T::from_f64(G_HIGH[1]), T::from_f64(G_HIGH[2])];
    let top = (g0 + g1 * f) + f2 * g2;
    let f4 = f2 * f2;
    (T::from_f64(1.0) + f * (polynomial7(f, G) + ((f4 * f2) * f) * top)) * power
}
