//! Floating-point numbers of 192 bits and more, where 32 digits are not enough.
//!
//! A number is sign, exponent and `L` limbs of 64 bits, most significant bit set: +- 0.mmm 2^e.
//! Sums and products are those of paper and pencil (Knuth, TAOCP vol. 2, 4.3.1) with one guard
//! limb, quotients and roots are Newton's, each within one or two units in the last place;
//! elementary functions are series after reduction (Brent & Zimmermann 2010, ch. 4), within some
//! tens of units. Everything is whole-number arithmetic, so the bits are the same on every machine.
//! There is no infinity: what leaves the exponent's range of 2^40 is not a number, and stays so.
//!
//! Why not a library: the series of the equation need a number that is copied like an `f64`; the
//! pure Rust crates for such precisions allocate for every number. A product and a sum took 22, 27,
//! 57 and 109 ns here (192, 256, 384, 512 bits), 331 to 403 ns with astro-float 0.9, 0.9 to 1.3 us
//! with dashu-float 0.4 and 18.5 ns in double-double (one run, x86-64, 2026-11-21).

use std::cmp::Ordering;

use super::scalar::operators;
use super::{Arithmetic, Elementary, Scalar, elementary};

/// Most limbs of a number.
const MOST: usize = 8;
/// Exponents beyond this are out of range.
const RANGE: i64 = 1 << 40;
/// pi as 0.mmm 2^2, least significant limb first.
const PI: ([u64; MOST], i64) = (
    [
        0x4fe1_356d_6d51_c246,
        0x302b_0a6d_f25f_1437,
        0xef95_19b3_cd3a_431b,
        0x514a_0879_8e34_04dd,
        0x020b_bea6_3b13_9b22,
        0x2902_4e08_8a67_cc74,
        0xc4c6_628b_80dc_1cd1,
        0xc90f_daa2_2168_c234,
    ],
    2,
);
/// ln 2 as 0.mmm 2^0.
const LN_2: ([u64; MOST], i64) = (
    [
        0x2757_3b29_1169_b825,
        0xed2e_ae35_c138_2144,
        0x5595_52fb_4afa_1b10,
        0xe7b8_7620_6deb_ac98,
        0x8a0d_175b_8baa_fa2b,
        0x40f3_4326_7298_b62d,
        0xc9e3_b398_03f2_f6af,
        0xb172_17f7_d1cf_79ab,
    ],
    0,
);

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum NumberClass {
    Zero,
    Finite,
    NotANumber,
}

/// A number of `64 L` bits, 3 <= L <= 8. See the [module](self).
///
/// ```
/// use twofold_num::{Arithmetic, Elementary, MultiFloat};
/// let third = MultiFloat::<4>::from_f64(1.0) / MultiFloat::from_f64(3.0);
/// let rest = MultiFloat::from_f64(1.0) - third.scale(3.0);
/// assert!(rest.abs() < MultiFloat::from_f64(1e-76));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct MultiFloat<const L: usize> {
    kind: NumberClass,
    negative: bool,
    exponent: i64,
    /// Least significant first.
    limbs: [u64; L],
}

impl<const L: usize> MultiFloat<L> {
    /// Bits of a number.
    pub const BITS: u32 = 64 * L as u32;
    /// Spacing of numbers near 1: 2^(1 - 64 L).
    pub const EPSILON: f64 = f64::from_bits(((1024 - 64 * L) as u64) << 52);
    /// tanh is 1 to all digits beyond this argument: 2 exp(-2 w) < EPSILON/4.
    pub const TANH_SATURATION: f64 = 22.2 * L as f64 + 1.5;

    const ZERO: Self =
        Self { kind: NumberClass::Zero, negative: false, exponent: 0, limbs: [0; L] };
    const NAN: Self = Self { kind: NumberClass::NotANumber, ..Self::ZERO };

    /// From a significand whose top bit is set, and a guard limb to be rounded away.
    fn rounded(negative: bool, mut exponent: i64, mut limbs: [u64; L], guard: u64) -> Self {
        if guard >> 63 == 1 && increment(&mut limbs) {
            limbs[L - 1] = 1 << 63;
            exponent += 1;
        }
        if exponent < -RANGE {
            return Self::ZERO;
        }
        if exponent > RANGE {
            return Self::NAN;
        }
        Self { kind: NumberClass::Finite, negative, exponent, limbs }
    }

    fn constant((limbs, exponent): ([u64; MOST], i64)) -> Self {
        let mut own = [0; L];
        own.copy_from_slice(&limbs[MOST - L..]);
        let guard = if L < MOST { limbs[MOST - L - 1] } else { 0 };
        Self::rounded(false, exponent, own, guard)
    }

    /// The whole number `n`.
    fn whole(n: u64) -> Self {
        if n == 0 {
            return Self::ZERO;
        }
        let zeros = n.leading_zeros();
        let mut limbs = [0; L];
        limbs[L - 1] = n << zeros;
        Self { kind: NumberClass::Finite, negative: false, exponent: 64 - i64::from(zeros), limbs }
    }

    /// self * 2^k, exactly.
    fn times_power_of_two(self, k: i64) -> Self {
        if self.kind == NumberClass::Finite {
            Self::rounded(self.negative, self.exponent.saturating_add(k), self.limbs, 0)
        } else {
            self
        }
    }

    /// log2 of the absolute value, to the digits of `f64`; minus infinity for zero.
    pub fn log2(self) -> f64 {
        match self.kind {
            NumberClass::Zero => f64::NEG_INFINITY,
            NumberClass::NotANumber => f64::NAN,
            NumberClass::Finite => {
                let significand = Self { negative: false, exponent: 0, ..self }.to_f64();
                self.exponent as f64 + elementary::ln(significand) * std::f64::consts::LOG2_E
            }
        }
    }

    fn magnitude(self) -> Self {
        Self { negative: false, ..self }
    }

    /// The decimal number written as `text`: digits, point, exponent. `None` if it is not one.
    /// Digits beyond the type's are rounded.
    pub fn from_digits(text: &str) -> Option<Self> {
        let (digits, exponent) = match text.split_once(['e', 'E']) {
            Some((digits, exponent)) => (digits, exponent.parse::<i64>().ok()?),
            None => (text, 0),
        };
        let unsigned = digits.strip_prefix(['-', '+']).unwrap_or(digits);
        let mut exponent = exponent.clamp(-10_000, 10_000);
        let (mut number, mut after_point, mut any) = (Self::ZERO, false, false);
        for c in unsigned.chars() {
            match c {
                '0'..='9' => {
                    number = number * Self::whole(10) + Self::whole(u64::from(c as u8 - b'0'));
                    exponent -= i64::from(after_point);
                    any = true;
                }
                '.' if !after_point => after_point = true,
                _ => return None,
            }
        }
        // The power of ten by squaring.
        let (mut power, mut base, mut n) =
            (Self::whole(1), Self::whole(10), exponent.unsigned_abs());
        while n > 0 {
            if n % 2 == 1 {
                power = power * base;
            }
            base = base * base;
            n /= 2;
        }
        let number = if exponent < 0 { number / power } else { number * power };
        any.then(|| if digits.starts_with('-') { -number } else { number })
    }

    /// Ordering of the magnitudes of two finite numbers.
    fn compare_magnitudes(&self, other: &Self) -> Ordering {
        self.exponent
            .cmp(&other.exponent)
            .then_with(|| self.limbs.iter().rev().cmp(other.limbs.iter().rev()))
    }

    /// |a| + |b| or |a| - |b| for finite |a| >= |b|, with the sign of a.
    fn combine(a: &Self, b: &Self, subtract: bool) -> Self {
        let distance = a.exponent - b.exponent;
        let (mut small, small_guard) = shifted_right(&b.limbs, distance);
        let mut limbs = a.limbs;
        let mut exponent = a.exponent;
        if subtract {
            // The guard limb of a is zero.
            let (guard, borrow) = 0_u64.overflowing_sub(small_guard);
            let mut borrow = u64::from(borrow);
            for (x, y) in limbs.iter_mut().zip(&mut small) {
                let (d, first) = x.overflowing_sub(*y);
                let (d, second) = d.overflowing_sub(borrow);
                (*x, borrow) = (d, u64::from(first | second));
            }
            // Leading zeros, in whole limbs first.
            let mut guard = guard;
            let mut moved = 0;
            while limbs[L - 1] == 0 {
                if moved > L as i64 {
                    return Self::ZERO;
                }
                limbs.copy_within(0..L - 1, 1);
                limbs[0] = guard;
                guard = 0;
                moved += 1;
            }
            let zeros = limbs[L - 1].leading_zeros();
            if zeros > 0 {
                for i in (1..L).rev() {
                    limbs[i] = limbs[i] << zeros | limbs[i - 1] >> (64 - zeros);
                }
                limbs[0] = limbs[0] << zeros | guard >> (64 - zeros);
                guard <<= zeros;
            }
            exponent -= 64 * moved + i64::from(zeros);
            return Self::rounded(a.negative, exponent, limbs, guard);
        }
        let mut carry = 0;
        for (x, y) in limbs.iter_mut().zip(&small) {
            let sum = u128::from(*x) + u128::from(*y) + carry;
            *x = sum as u64;
            carry = sum >> 64;
        }
        let mut guard = small_guard;
        if carry > 0 {
            guard = guard >> 1 | limbs[0] << 63;
            for i in 0..L - 1 {
                limbs[i] = limbs[i] >> 1 | limbs[i + 1] << 63;
            }
            limbs[L - 1] = limbs[L - 1] >> 1 | 1 << 63;
            exponent += 1;
        }
        Self::rounded(a.negative, exponent, limbs, guard)
    }

    /// 1/self by Newton's method from the quotient of the leading digits.
    fn reciprocal(self) -> Self {
        let b = Self { negative: false, exponent: 1, ..self };
        let mut r = Self::from_f64(1.0 / b.to_f64());
        let mut right = 50;
        while right < Self::BITS + 8 {
            r = r + r * (Self::whole(1) - b * r);
            right *= 2;
        }
        Self { negative: self.negative, ..r }.times_power_of_two(1 - self.exponent)
    }

    /// exp(self) - 1 for |self| < 0.36: series of self/2^12, then e^(2a) - 1 = (e^a - 1) (e^a + 1)
    /// twelve times.
    fn small_exp_m1(self) -> Self {
        const HALVINGS: i64 = 12;
        let r = self.times_power_of_two(-HALVINGS);
        let (mut term, mut sum) = (r, r);
        let mut n = 2;
        while term.is_felt_by(&sum) {
            term = term * r / Self::whole(n);
            sum += term;
            n += 1;
        }
        for _ in 0..HALVINGS {
            sum = sum * (sum + Self::whole(2));
        }
        sum
    }

    /// Whether adding this to `sum` would change it.
    fn is_felt_by(&self, sum: &Self) -> bool {
        self.kind == NumberClass::Finite
            && self.exponent >= sum.exponent - i64::from(Self::BITS) - 1
    }

    /// (sin, cos) by reduction modulo pi/2 and series.
    fn sin_cos(self) -> (Self, Self) {
        let quotient = self.to_f64() / std::f64::consts::FRAC_PI_2;
        // The error from the digits of pi/2 that are missing grows with the quadrant's number.
        if quotient.is_nan() || quotient.abs() >= 1e15 {
            return (Self::NAN, Self::NAN);
        }
        let quadrant = quotient.round();
        let r = self - Self::constant(PI).times_power_of_two(-1) * Self::from_f64(quadrant);
        let square = r * r;
        let (mut sin, mut cos) = (r, Self::whole(1));
        let (mut sin_term, mut cos_term) = (r, Self::whole(1));
        let mut k = 2;
        while cos_term.is_felt_by(&cos) || sin_term.is_felt_by(&sin) {
            cos_term = -(cos_term * square) / Self::whole(k * (k - 1));
            sin_term = -(sin_term * square) / Self::whole(k * (k + 1));
            cos += cos_term;
            sin += sin_term;
            k += 2;
        }
        match quadrant.rem_euclid(4.0) as u8 {
            0 => (sin, cos),
            1 => (cos, -sin),
            2 => (-sin, -cos),
            _ => (-cos, sin),
        }
    }
}

/// Adds one in the last place; whether it was carried out at the top.
fn increment<const L: usize>(limbs: &mut [u64; L]) -> bool {
    for limb in limbs.iter_mut() {
        let (next, carried) = limb.overflowing_add(1);
        *limb = next;
        if !carried {
            return false;
        }
    }
    true
}

/// The limbs moved right by some bits, and what falls into the guard limb.
fn shifted_right<const L: usize>(limbs: &[u64; L], bits: i64) -> ([u64; L], u64) {
    let (whole, part) = ((bits / 64) as usize, (bits % 64) as u32);
    // Limb i of the number with the guard limb as limb -1.
    let at = |i: usize| if i < L { limbs[i] } else { 0 };
    let moved = |i: usize| if part == 0 { at(i) } else { at(i) >> part | at(i + 1) << (64 - part) };
    if bits > 64 * (L as i64 + 1) {
        return ([0; L], 0);
    }
    let guard = match whole {
        0 if part == 0 => 0,
        0 => limbs[0] << (64 - part),
        _ => moved(whole - 1),
    };
    (std::array::from_fn(|i| moved(i + whole)), guard)
}

impl<const L: usize> PartialEq for MultiFloat<L> {
    fn eq(&self, other: &Self) -> bool {
        self.partial_cmp(other) == Some(Ordering::Equal)
    }
}

impl<const L: usize> PartialOrd for MultiFloat<L> {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        let sign = |x: &Self| match x.kind {
            NumberClass::NotANumber => None,
            NumberClass::Zero => Some(0),
            NumberClass::Finite => Some(if x.negative { -1 } else { 1 }),
        };
        let (a, b) = (sign(self)?, sign(other)?);
        Some(a.cmp(&b).then_with(|| match a {
            0 => Ordering::Equal,
            1 => self.compare_magnitudes(other),
            _ => other.compare_magnitudes(self),
        }))
    }
}

operators! {
    impl [const L: usize] MultiFloat<L>, inline:
    Add add(self, other) {
        match (self.kind, other.kind) {
            (NumberClass::NotANumber, _) | (_, NumberClass::NotANumber) => Self::NAN,
            (NumberClass::Zero, _) => other,
            (_, NumberClass::Zero) => self,
            _ => {
                let subtract = self.negative != other.negative;
                match self.compare_magnitudes(&other) {
                    Ordering::Less => Self::combine(&other, &self, subtract),
                    _ => Self::combine(&self, &other, subtract),
                }
            }
        }
    }
    Sub sub(self, other) { self + -other }
    Mul mul(self, other) {
        match (self.kind, other.kind) {
            (NumberClass::NotANumber, _) | (_, NumberClass::NotANumber) => return Self::NAN,
            (NumberClass::Zero, _) | (_, NumberClass::Zero) => return Self::ZERO,
            _ => {}
        }
        let mut product = [0_u64; 2 * MOST];
        for (i, x) in self.limbs.iter().enumerate() {
            let mut carry = 0_u128;
            for (j, y) in other.limbs.iter().enumerate() {
                let sum = u128::from(*x) * u128::from(*y) + u128::from(product[i + j]) + carry;
                product[i + j] = sum as u64;
                carry = sum >> 64;
            }
            product[i + L] = carry as u64;
        }
        let mut exponent = self.exponent + other.exponent;
        // The product of two significands in [1/2, 1) is at least 1/4: at most one zero leads.
        let lead = product[2 * L - 1] >> 63 == 0;
        if lead {
            exponent -= 1;
            for i in (1..2 * L).rev() {
                product[i] = product[i] << 1 | product[i - 1] >> 63;
            }
        }
        let mut limbs = [0; L];
        limbs.copy_from_slice(&product[L..2 * L]);
        Self::rounded(self.negative != other.negative, exponent, limbs, product[L - 1])
    }
    // The product with the reciprocal, corrected once.
    Div div(self, other) {
        match (self.kind, other.kind) {
            (NumberClass::NotANumber, _) | (_, NumberClass::NotANumber | NumberClass::Zero) => {
                return Self::NAN;
            }
            (NumberClass::Zero, _) => return Self::ZERO,
            _ => {}
        }
        let r = other.reciprocal();
        let q = self * r;
        q + r * (self - q * other)
    }
    -(self) { Self { negative: !self.negative, ..self } }
}

impl<const L: usize> Arithmetic for MultiFloat<L> {
    fn from_f64(value: f64) -> Self {
        if !value.is_finite() {
            return Self::NAN;
        }
        let bits = value.to_bits();
        let (biased, fraction) = ((bits >> 52 & 0x7ff) as i64, bits & ((1 << 52) - 1));
        let (mantissa, exponent) =
            if biased == 0 { (fraction, -1074) } else { (fraction | 1 << 52, biased - 1075) };
        let magnitude = Self::whole(mantissa).times_power_of_two(exponent);
        if value < 0.0 { -magnitude } else { magnitude }
    }
}

impl<const L: usize> Scalar for MultiFloat<L> {
    /// Rounded to nearest; beyond the range of `f64` to an infinity or, below its normal numbers,
    /// to zero.
    fn to_f64(self) -> f64 {
        let sign = if self.negative { -1.0 } else { 1.0 };
        match self.kind {
            NumberClass::Zero => return 0.0,
            NumberClass::NotANumber => return f64::NAN,
            NumberClass::Finite => {}
        }
        let top = self.limbs[L - 1];
        let sticky = u64::from(self.limbs[..L - 1].iter().any(|x| *x != 0));
        // 54 bits and whether anything follows: rounding to 53 then is correct.
        let short = (top >> 10) << 1 | u64::from(top & 0x3ff != 0) | sticky;
        let mantissa = short as f64;
        let exponent = self.exponent - 55;
        if self.exponent > 1024 {
            return sign * f64::INFINITY;
        }
        if self.exponent < -1021 {
            return 0.0 * sign;
        }
        // In two halves, each of them a normal power of two; the product is rounded once.
        let half = exponent / 2;
        let power = |k: i64| f64::from_bits(((1023 + k) as u64) << 52);
        sign * (mantissa * power(half)) * power(exponent - half)
    }
}

impl<const L: usize> Elementary for MultiFloat<L> {
    fn tanh(self) -> Self {
        if self.kind != NumberClass::Finite {
            return self;
        }
        if self.magnitude().to_f64() > Self::TANH_SATURATION {
            return if self.negative { -Self::whole(1) } else { Self::whole(1) };
        }
        let w = self.magnitude().times_power_of_two(1);
        let e = if w.to_f64() < 0.3 { w.small_exp_m1() } else { w.exp() - Self::whole(1) };
        let t = e / (e + Self::whole(2));
        if self.negative { -t } else { t }
    }

    fn exp(self) -> Self {
        let k = (self.to_f64() * std::f64::consts::LOG2_E).round();
        if k.is_nan() || k.abs() > RANGE as f64 {
            return if k < 0.0 { Self::ZERO } else { Self::NAN };
        }
        let r = self - Self::constant(LN_2) * Self::from_f64(k);
        (r.small_exp_m1() + Self::whole(1)).times_power_of_two(k as i64)
    }

    fn sin(self) -> Self {
        self.sin_cos().0
    }

    fn cos(self) -> Self {
        self.sin_cos().1
    }

    fn ln(self) -> Self {
        if self.kind != NumberClass::Finite || self.negative {
            return Self::NAN;
        }
        // 2 atanh z, z = (m - 1)/(m + 1), of the significand between 1/sqrt 2 and sqrt 2: nothing
        // is lost near 1.
        let mut m = Self { exponent: 0, ..self };
        let mut exponent = self.exponent;
        if m < Self::from_f64(std::f64::consts::FRAC_1_SQRT_2) {
            m = m.times_power_of_two(1);
            exponent -= 1;
        }
        let z = (m - Self::whole(1)) / (m + Self::whole(1));
        let square = z * z;
        let (mut power, mut sum, mut n) = (z, z, 3);
        loop {
            power = power * square;
            let term = power / Self::whole(n);
            if !term.is_felt_by(&sum) {
                break;
            }
            sum += term;
            n += 2;
        }
        sum.times_power_of_two(1) + Self::constant(LN_2) * Self::from_f64(exponent as f64)
    }

    fn atan(self) -> Self {
        if self.kind != NumberClass::Finite {
            return self;
        }
        if self.exponent > i64::from(Self::BITS) + 2 {
            let quarter = Self::constant(PI).times_power_of_two(-1);
            return if self.negative { -quarter } else { quarter };
        }
        if self.exponent < -i64::from(Self::BITS) {
            return self;
        }
        // tan(atan x - y) = (x cos y - sin y)/(cos y + x sin y): adding that to y triples the right
        // digits.
        let mut y = Self::from_f64(elementary::atan(self.to_f64()));
        let mut right = 45;
        while right < Self::BITS + 8 {
            let (sin, cos) = y.sin_cos();
            y += (self * cos - sin) / (cos + self * sin);
            right *= 3;
        }
        y
    }

    fn erf(self) -> Self {
        if self.kind != NumberClass::Finite {
            return self;
        }
        // 1 - erf x < exp(-x^2)/x: beyond this the nearest number is +-1.
        let saturation = elementary::sqrt(0.6932 * f64::from(Self::BITS) + 2.0);
        if self.magnitude().to_f64() > saturation {
            return if self.negative { -Self::whole(1) } else { Self::whole(1) };
        }
        // 2/sqrt(pi) exp(-x^2) sum of 2^n x^(2n+1)/(1 3 5 ... (2n+1)): no cancellation (Abramowitz
        // & Stegun 7.1.6).
        let square = self * self;
        let (mut term, mut sum, mut n) = (self, self, 1);
        while term.is_felt_by(&sum) {
            term = (term * square).times_power_of_two(1) / Self::whole(2 * n + 1);
            sum += term;
            n += 1;
        }
        (-square).exp() * sum * (Self::whole(2) / Self::constant(PI).sqrt())
    }

    fn pi() -> Self {
        Self::constant(PI)
    }

    fn sign(self) -> Self {
        match self.kind {
            NumberClass::NotANumber => self,
            _ if self.negative && self.kind == NumberClass::Finite => -Self::whole(1),
            _ => Self::whole(1),
        }
    }

    fn sqrt(self) -> Self {
        match self.kind {
            NumberClass::Finite if self.negative => return Self::NAN,
            NumberClass::Finite => {}
            _ => return self,
        }
        // 1/sqrt a by Newton's method for a in [1/2, 2), then a/sqrt a, corrected once.
        let odd = self.exponent.rem_euclid(2);
        let a = Self { exponent: odd, ..self };
        let mut r = Self::from_f64(1.0 / elementary::sqrt(a.to_f64()));
        let mut right = 50;
        while right < Self::BITS + 8 {
            r += (r * (Self::whole(1) - a * r * r)).times_power_of_two(-1);
            right *= 2;
        }
        let root = a * r;
        let root = root + (r * (a - root * root)).times_power_of_two(-1);
        root.times_power_of_two((self.exponent - odd) / 2)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::DoubleDouble;
    use proptest::prelude::*;

    type M = MultiFloat<4>;
    type Long = MultiFloat<8>;

    /// Values from mpmath 1.3 at 1200 bits, rounded to 160 digits.
    const KNOWN: [(&str, &str); 12] = [
        (
            "exp 1.5",
            "4.481689070338064822602055460119275819005749868369667056772650082785936674466713772981053831382453391388616350651830195768962746477220408606961759644973693538179",
        ),
        (
            "exp -30.5",
            "5.675685232632722461872788723806651277147710851207511617132619384017875667494794052955798115036489464522360518016802722117420915113952656379420684445909397502067e-14",
        ),
        (
            "ln 3",
            "1.098612288668109691395245236922525704647490557822749451734694333637494293218608966873615754813732088787970029065957865742368004225930519821052801870767277410603",
        ),
        (
            "ln 1.0625",
            "0.06062462181643484258060613204042026328620247514472377081451769990871808792215241848864156005182819735034233796490431435665551189891421613616907155920171742353700",
        ),
        (
            "sin 1.25",
            "0.9489846193555862143484908470360492503780160345238922201355570321801262421757229067546662274022547384630474560746996111368907619247915011486409344866565293827789",
        ),
        (
            "cos 100",
            "0.8623188722876839341019385139508425355100840085355108292801621126927210880509266241030951056842772850671356075551623304811055280680193385410934462069488849310159",
        ),
        (
            "atan 2.5",
            "1.190289949682531732927733774829318337601178986029452072911166673829707745314101396955153966575185598813039185930215474374731346631935461523427472855902050360507",
        ),
        (
            "erf 0.75",
            "0.7111556336535151315989378345914107773742059540965372322781333971250363687640495611107932538900989000435303453704186427479134901953460048921078498500845940929269",
        ),
        (
            "erf 3",
            "0.9999779095030014145586272238704176796201522929126007503427610451570575433163798677321837453491846837128565538002718387647429960972462032505343392848941651621873",
        ),
        (
            "tanh 0.125",
            "0.1243530017715962080546472758058927076759187925153387504146699908722562482843299775709592649759634387354030275100726304224517856926000871010422461354651858073931",
        ),
        (
            "tanh 5.5",
            "0.9999665971563038096384895294175687063977326393444471898909827255388879544792153853305390092086233975375979700679731179905905545276803134563734221324219819011756",
        ),
        (
            "sqrt 7",
            "2.645751311064590590501615753639260425710259183082450180368334459201068823230283627760392886474543610615064578338497463095743529888627214784427390555880107722717",
        ),
    ];

    fn agrees<const L: usize>(units: f64) {
        for (what, digits) in KNOWN {
            let (name, x) = what.split_once(' ').unwrap();
            let x = MultiFloat::<L>::from_digits(x).unwrap();
            let x = if what.contains(" -") { -x.magnitude() } else { x };
            let got = match name {
                "exp" => x.exp(),
                "ln" => x.ln(),
                "sin" => x.sin(),
                "cos" => x.cos(),
                "atan" => x.atan(),
                "erf" => x.erf(),
                "tanh" => x.tanh(),
                _ => x.sqrt(),
            };
            let want = MultiFloat::<L>::from_digits(digits).unwrap();
            let off = ((got - want) / want).to_f64().abs();
            // 160 digits are given.
            assert!(
                off < units * MultiFloat::<L>::EPSILON + 1e-158,
                "{what} at {} bits: {off:e}",
                64 * L
            );
        }
    }

    #[test]
    fn functions_agree_with_known_digits() {
        agrees::<3>(64.0);
        agrees::<4>(64.0);
        agrees::<6>(64.0);
        agrees::<8>(64.0);
    }

    #[test]
    fn constants_are_what_they_are_called() {
        // Machin (1706): pi = 16 atan(1/5) - 4 atan(1/239); ln 2 = 2 atanh(1/3).
        let inverse = |n: u64, sign: f64| {
            let square = Long::whole(1) / Long::whole(n * n);
            let (mut power, mut sum) = (Long::whole(1) / Long::whole(n), Long::ZERO);
            for k in 0..400 {
                let term = power / Long::whole(2 * k + 1);
                sum += if k % 2 == 1 { term * Long::from_f64(sign) } else { term };
                power = power * square;
            }
            sum
        };
        let pi = inverse(5, -1.0) * Long::whole(16) - inverse(239, -1.0) * Long::whole(4);
        let ln_2 = inverse(3, 1.0).times_power_of_two(1);
        for (found, constant) in [(pi, PI), (ln_2, LN_2)] {
            let off = (found - Long::constant(constant)).to_f64().abs();
            assert!(off < 64.0 * Long::EPSILON, "{off:e}");
        }
    }

    #[test]
    fn ends_of_the_range() {
        let tiny = M::from_f64(5e-324);
        assert_eq!(tiny.times_power_of_two(1074), M::whole(1));
        assert_eq!(M::from_f64(f64::MAX).to_f64(), f64::MAX);
        assert_eq!((M::from_f64(f64::MAX) * M::whole(4)).to_f64(), f64::INFINITY);
        assert_eq!(M::whole(1).times_power_of_two(-RANGE - 5), M::ZERO);
        for nan in [
            M::from_f64(f64::NAN),
            M::from_f64(f64::INFINITY),
            M::whole(1) / M::ZERO,
            M::whole(1).times_power_of_two(RANGE + 1),
            (-M::whole(1)).ln(),
            (-M::whole(1)).sqrt(),
            M::ZERO.ln(),
            M::from_f64(1e30).sin(),
            M::from_f64(1e13).exp(),
        ] {
            assert!(nan.to_f64().is_nan() && nan.partial_cmp(&nan).is_none(), "{nan:?}");
        }
        assert_eq!(M::from_f64(-1e13).exp(), M::ZERO);
        assert_eq!((M::from_f64(1e3).tanh(), M::from_f64(-1e3).erf()), (M::whole(1), -M::whole(1)));
        let (half_pi, far) = (M::pi().times_power_of_two(-1), M::whole(1).times_power_of_two(400));
        assert_eq!((far.atan(), (-far).atan()), (half_pi, -half_pi));
        assert!(
            M::from_digits("1.5.2").is_none()
                && M::from_digits("-").is_none()
                && M::from_digits("").is_none()
        );
    }

    #[test]
    fn rounding_to_f64_is_to_nearest() {
        // Half a unit beyond 1 goes to the even neighbour, a bit more goes up.
        let unit = f64::EPSILON;
        let half = M::whole(1) + M::from_f64(unit / 2.0);
        assert_eq!(half.to_f64(), 1.0);
        assert_eq!((half + M::from_f64(1e-60)).to_f64(), 1.0 + unit);
        assert_eq!((M::from_f64(1.0 + unit) + M::from_f64(unit / 2.0)).to_f64(), 1.0 + 2.0 * unit);
    }

    fn number() -> impl Strategy<Value = M> {
        // Sums of parts of very different size fill all limbs.
        (-1e3..1e3_f64, -1.0..1.0_f64, -1.0..1.0_f64, -40..40_i64).prop_map(|(a, b, c, k)| {
            let x = M::from_f64(a)
                + M::from_f64(b).times_power_of_two(-60)
                + M::from_f64(c).times_power_of_two(-140);
            x.times_power_of_two(k)
        })
    }

    /// The distance in units of the last place of `scale`.
    fn units(a: M, b: M, scale: M) -> f64 {
        ((a - b) / scale).to_f64().abs() / M::EPSILON
    }

    proptest! {
        #[test]
        fn f64_comes_back(x in any::<f64>().prop_filter("normal", |x| x.is_normal())) {
            prop_assert_eq!(M::from_f64(x).to_f64().to_bits(), x.to_bits());
            let text = format!("{:e}", x);
            prop_assert_eq!(M::from_digits(&text).unwrap().to_f64(), x);
        }

        #[test]
        fn field_identities(a in number(), b in number(), c in number()) {
            let largest = |x: M, y: M| if x.magnitude() > y.magnitude() { x.magnitude() } else {
                y.magnitude() };
            prop_assume!(b != M::ZERO && a != M::ZERO);
            prop_assert_eq!(a + b, b + a);
            prop_assert_eq!(a * b, b * a);
            prop_assert_eq!(a - a, M::ZERO);
            prop_assert!(units((a + b) - b, a, largest(a, b)) <= 2.0);
            prop_assert!(units((a + b) + c, a + (b + c), largest(largest(a, b), c)) <= 4.0);
            prop_assert!(units(a * (b + c), a * b + a * c, a * largest(b, c)) <= 6.0);
            prop_assert!(units(a / b * b, a, a) <= 4.0);
            let root = a.magnitude().sqrt();
            prop_assert!(units(root * root, a.magnitude(), a.magnitude()) <= 4.0);
        }

        /// The first 30 digits are those of the other extended arithmetic.
        #[test]
        fn agrees_with_double_double(x in -8.0..8.0_f64, y in 0.01..8.0_f64) {
            let (m, d) = (M::from_f64, DoubleDouble::from_f64);
            for (a, b) in [
                (m(x).exp(), d(x).exp()), (m(x).sin(), d(x).sin()), (m(x).cos(), d(x).cos()),
                    (m(x).tanh(), d(x).tanh()),
                (m(x).atan(), d(x).atan()), (m(x).erf(), d(x).erf()), (m(y).ln(), d(y).ln()),
                    (m(y).sqrt(), d(y).sqrt()),
                (m(x) / m(y), d(x) / d(y)), (m(x) * m(y) + m(x), d(x) * d(y) + d(x)), (m(x) - m(y),
                    d(x) - d(y)),
            ] {
                let b = M::from_f64(b.high()) + M::from_f64(b.low());
                prop_assert!((a - b).to_f64().abs() <= 2e-30 * (1.0 + a.to_f64().abs()),
                    "{:?} {:?}", a, b);
            }
        }

        /// Four limbs are eight limbs, rounded.
        #[test]
        fn a_short_number_is_a_long_one_rounded(x in 0.02..20.0_f64, y in -3.0..3.0_f64) {
            let text = |f: fn(Long) -> Long, g: fn(M) -> M, x: f64| {
                let (long, short) = (f(Long::from_f64(x)), g(M::from_f64(x)));
                let mut limbs = [0; 4];
                limbs.copy_from_slice(&long.limbs[4..]);
                units(M { kind: long.kind, negative: long.negative, exponent: long.exponent,
                    limbs }, short, short)
            };
            prop_assert!(text(Long::ln, M::ln, x) < 64.0);
            prop_assert!(text(Long::exp, M::exp, y) < 64.0);
            prop_assert!(text(Long::tanh, M::tanh, y) < 64.0);
            prop_assert!(text(Long::erf, M::erf, y) < 64.0);
            prop_assert!(text(Long::atan, M::atan, y) < 64.0);
        }
    }

    /// In one limb, whole numbers of 64 bits: sums are rounded as integers are, half away from
    /// zero, differences are exact.
    #[test]
    fn one_limb_is_rounded_like_an_integer() {
        let integer = |x: MultiFloat<1>| {
            assert!(x.kind != NumberClass::NotANumber);
            let shift = x.exponent - 64;
            let size = u128::from(x.limbs[0]);
            let size = if shift >= 0 { size << shift } else { size >> -shift } as i128;
            if x.kind == NumberClass::Zero {
                0
            } else if x.negative {
                -size
            } else {
                size
            }
        };
        let numbers = [
            1,
            2,
            3,
            5,
            1 << 40,
            1 << 63,
            (1 << 63) + 1,
            u64::MAX,
            u64::MAX - 1,
            u64::MAX / 3,
            0x0123_4567_89ab_cdef,
        ];
        for a in numbers {
            for b in numbers {
                let [x, y] = [a, b].map(MultiFloat::<1>::whole);
                let sum = i128::from(a) + i128::from(b);
                let rounded = if sum >= 1 << 64 { (sum + 1) / 2 * 2 } else { sum };
                assert_eq!(integer(x + y), rounded, "{a} + {b}");
                assert_eq!(integer(-x - y), -rounded, "-{a} - {b}");
                assert_eq!(integer(x - y), i128::from(a) - i128::from(b), "{a} - {b}");
                assert_eq!(x.partial_cmp(&y), Some(a.cmp(&b)));
                assert_eq!((-x).partial_cmp(&-y), Some(b.cmp(&a)));
                assert_eq!((-x).partial_cmp(&y), Some(Ordering::Less));
                // Two limbs hold the sum whole.
                let [x, y] = [a, b].map(MultiFloat::<2>::whole);
                assert_eq!((x + y - x).partial_cmp(&y), Some(Ordering::Equal), "{a} + {b} - {a}");
            }
        }
        let zero = MultiFloat::<1>::ZERO;
        assert_eq!(zero.partial_cmp(&-zero), Some(Ordering::Equal));
        assert!(zero < MultiFloat::whole(1) && -MultiFloat::<1>::whole(1) < zero);
        assert_eq!(zero.partial_cmp(&MultiFloat::NAN), None);
    }

    #[test]
    fn functions_are_those_of_f64_in_every_quadrant() {
        for i in -40..=40 {
            let x = f64::from(i) * 0.3;
            let long = MultiFloat::<3>::from_f64(x);
            assert!((long.sin().to_f64() - Elementary::sin(x)).abs() < 4e-16, "sin {x}");
            assert!((long.cos().to_f64() - Elementary::cos(x)).abs() < 4e-16, "cos {x}");
            if x != 0.0 {
                assert!(
                    (long.log2() - Elementary::ln(x.abs()) * std::f64::consts::LOG2_E).abs()
                        < 4e-15,
                    "log2 {x}"
                );
            }
        }
        let large = MultiFloat::<2>::whole(1).times_power_of_two(5000);
        assert_eq!((large.log2(), MultiFloat::<2>::ZERO.log2()), (5000.0, f64::NEG_INFINITY));
        assert!(
            MultiFloat::<2>::NAN.log2().is_nan()
                && MultiFloat::<2>::from_f64(1e16).sin().to_f64().is_nan()
        );
    }

    #[test]
    fn edges() {
        type X = MultiFloat<2>;
        let (one, zero, nan) = (X::whole(1), X::ZERO, X::NAN);
        let not = |x: X| x.to_f64().is_nan();
        for x in [one, zero, nan, -one] {
            assert!(
                not(x + nan)
                    && not(nan - x)
                    && not(x * nan)
                    && not(nan * x)
                    && not(x / nan)
                    && not(nan / x)
            );
            assert!(not(x / zero));
            assert!(
                not(x) || (x + zero == x && zero + x == x && (x * zero).kind == NumberClass::Zero)
            );
        }
        assert_eq!((zero / one).to_f64(), 0.0);
        let mut difference = one;
        difference -= X::whole(3);
        assert_eq!(difference.to_f64(), -2.0);
        // The ends of f64.
        let power = |k: i64| one.times_power_of_two(k);
        assert_eq!(
            (power(1024).to_f64(), (-power(1024)).to_f64()),
            (f64::INFINITY, f64::NEG_INFINITY)
        );
        assert_eq!(
            (power(1023).to_f64(), (-power(-1022)).to_f64()),
            (2.0_f64.powi(1023), -f64::MIN_POSITIVE)
        );
        assert_eq!(power(-1023).to_f64(), 0.0);
        assert_eq!(X::from_f64(-5e-324).times_power_of_two(1074), -one);
        // Signs, and where functions end.
        let signs = [X::whole(2), -X::whole(2), zero, -zero].map(|x| x.sign().to_f64());
        assert_eq!(signs, [1.0, -1.0, 1.0, 1.0]);
        assert!(not(nan.sign()) && not((-one).sqrt()) && not((-one).ln()) && not(zero.ln()));
        assert_eq!((zero.sqrt().to_f64(), zero.tanh().to_f64()), (0.0, 0.0));
        for (x, tanh, erf) in [(1e5, 1.0, 1.0), (-1e5, -1.0, -1.0)] {
            let x = X::from_f64(x);
            assert_eq!((x.tanh().to_f64(), x.erf().to_f64()), (tanh, erf));
        }
        for x in [-3.0, -0.1, 0.1, 3.0] {
            assert!((X::from_f64(x).tanh().to_f64() - Elementary::tanh(x)).abs() < 2e-16, "{x}");
        }
        assert_eq!(power(5000).atan(), X::pi().times_power_of_two(-1));
        assert_eq!((-power(5000)).atan(), -X::pi().times_power_of_two(-1));
        assert_eq!(power(-5000).atan(), power(-5000));
        assert_eq!(X::from_f64(-1e30).exp().to_f64(), 0.0);
        assert!(not(X::from_f64(1e30).exp()) && X::from_digits("1.2.3").is_none());
    }
}
