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
mod tests;
