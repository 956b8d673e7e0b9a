//! Numbers with a bound on their error (midpoint and radius: Rump 1999), in two precisions, and
//! with derivatives.
//!
//! Sums of products are the only operation that matters for a Taylor series. Their rounding errors
//! are bounded once a sum, after Higham 2002, sec. 3.1: |fl(sum of n products) - sum| <= n u/(1 - n
//! u) times the sum of absolute values.

use num_bigint::{BigInt, Sign};

use super::rational::{Range, Rational};

/// Twice the unit roundoff of `f64`, so that bounds made of a few rounded operations hold without
/// care for their own rounding.
const U: f64 = f64::EPSILON;
/// Above the rounding error of any operation whose result is subnormal.
const TINY: f64 = 1e-300;
/// Binary places of a [`Fixed`].
const PLACES: u32 = 192;
/// A unit in the last of them: 2^-192.
const UNIT: f64 = 1.593_091_911_132_452_3e-58;

/// Coefficient type of a Taylor series.
pub(super) trait Number: Clone {
    /// An enclosure of a range.
    fn of(range: &Range) -> Self;
    /// The sum of a[i] b[n - 1 - i], both slices having n elements.
    fn convolve(a: &[Self], b: &[Self]) -> Self;
    fn plus(&self, o: &Self) -> Self;
    fn minus(&self, o: &Self) -> Self;
    /// A whole number over which it is divided.
    fn over(&self, n: usize) -> Self;
    /// phi = (1 + tanh(a/2))/2 = 1/(1 + exp(-a)) and phi (1 - phi), its derivative by a.
    fn logistic(&self) -> (Self, Self);
    fn times(&self, o: &Self) -> Self {
        Self::convolve(std::slice::from_ref(self), std::slice::from_ref(o))
    }
}

/// All numbers within `r` of `m`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ball {
    pub m: f64,
    pub r: f64,
}

impl Ball {
    pub const ZERO: Self = Self { m: 0.0, r: 0.0 };
    pub const ONE: Self = Self { m: 1.0, r: 0.0 };

    pub fn exactly(m: f64) -> Self {
        Self { m, r: 0.0 }
    }

    /// All numbers between two.
    pub fn between(low: f64, high: f64) -> Self {
        let m = 0.5 * low + 0.5 * high;
        Self { m, r: (high - m).max(m - low) * (1.0 + U) + U * m.abs() + TINY }
    }

    /// Not below any of its absolute values.
    pub fn magnitude(&self) -> f64 {
        (self.m.abs() + self.r) * (1.0 + U)
    }

    /// Not above any of its absolute values.
    pub fn least(&self) -> f64 {
        ((self.m.abs() - self.r) * (1.0 - U) - TINY).max(0.0)
    }

    /// Whether zero is none of its numbers; not a number is anything.
    pub fn excludes_zero(&self) -> bool {
        self.m.abs() * (1.0 - U) > self.r
    }

    pub fn widened(&self, by: f64) -> Self {
        Self { m: self.m, r: (self.r + by) * (1.0 + U) }
    }

    /// Whether all of it lies in `o`.
    pub fn within(&self, o: &Self) -> bool {
        ((self.m - o.m).abs() + self.r) * (1.0 + 2.0 * U) + TINY <= o.r
    }

    /// The quotients; `None` if zero may be a divisor.
    pub fn divided(&self, o: &Self) -> Option<Self> {
        if !o.excludes_zero() {
            return None;
        }
        let q = self.m / o.m;
        let r = (self.r + q.abs() * o.r) / ((o.m.abs() - o.r) * (1.0 - U));
        Some(Self { m: q, r: r * (1.0 + 4.0 * U) + U * q.abs() + TINY })
    }

    /// The lower and the upper end, rounded outward.
    fn ends(&self) -> [f64; 2] {
        let slack = U * (self.m.abs() + self.r) + TINY;
        [self.m - self.r - slack, self.m + self.r + slack]
    }

    /// exp(t) for one t <= 0.
    fn exponential(t: f64) -> Self {
        /// ln 2 in two parts, the first with 32 bits; the rest is below 1e-25.
        const LN2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];
        if t < -690.0 {
            return Self::between(0.0, 1.1e-299);
        }
        if t.is_nan() || t > 0.0 {
            return Self { m: 0.0, r: f64::INFINITY };
        }
        let k = (t / (LN2[0] + LN2[1])).round();
        // k has ten bits: its product with the first part is exact, and so is the difference, both
        // being multiples of a bit that is small enough.
        let r = Self::exactly(t - k * LN2[0])
            .minus(&Self::exactly(k).times(&Self { m: LN2[1], r: 1e-25 }));
        let mut sum = Self::ONE;
        for n in (1..=18).rev() {
            sum = Self::ONE.plus(&sum.times(&r).over(n));
        }
        // The remainder: |r| < 0.36, and 0.36^19/19! < 1e-25.
        let sum = sum.widened(1e-24);
        let power = f64::from_bits(((k as i64 + 1023) as u64) << 52);
        Self { m: sum.m * power, r: sum.r * power + TINY }
    }

    /// The function's values at one number.
    fn logistic_at(t: f64) -> (Self, Self) {
        let e = Self::exponential(-t.abs());
        let sum = Self::ONE.plus(&e);
        // The divisor is at least 1.
        let inverse = Self::ONE.divided(&sum).unwrap_or(Self::between(0.0, 1.0));
        let other = e.times(&inverse);
        (if t < 0.0 { other } else { inverse }, other.times(&inverse))
    }

    pub fn range(&self) -> Option<Range> {
        let (m, r) = (Rational::exactly(self.m)?, Rational::exactly(self.r)?);
        Some(Range::point(&m).widened(&r))
    }
}

impl Number for Ball {
    fn of(range: &Range) -> Self {
        let [low, high] = [&range.low, &range.high].map(Rational::approximately);
        // `approximately` is good to a few units of the last place.
        Self::between(low, high).widened(4.0 * U * low.abs().max(high.abs()))
    }

    fn convolve(a: &[Self], b: &[Self]) -> Self {
        let (mut m, mut size, mut r) = (0.0, 0.0, 0.0);
        for (a, b) in a.iter().zip(b.iter().rev()) {
            let product = a.m * b.m;
            m += product;
            size += product.abs();
            r += a.m.abs() * b.r + a.r * (b.m.abs() + b.r);
        }
        let n = (a.len() + 4) as f64;
        Self { m, r: (r + n * U * size) * (1.0 + n * U) + TINY }
    }

    fn plus(&self, o: &Self) -> Self {
        let m = self.m + o.m;
        Self { m, r: (self.r + o.r + U * m.abs()) * (1.0 + 4.0 * U) }
    }

    fn minus(&self, o: &Self) -> Self {
        let m = self.m - o.m;
        Self { m, r: (self.r + o.r + U * m.abs()) * (1.0 + 4.0 * U) }
    }

    fn over(&self, n: usize) -> Self {
        let (m, n) = (self.m / n as f64, n as f64);
        Self { m, r: (self.r / n + U * m.abs()) * (1.0 + 4.0 * U) + TINY }
    }

    fn logistic(&self) -> (Self, Self) {
        let [low, high] = self.ends();
        let ((phi_low, at_low), (phi_high, at_high)) =
            (Self::logistic_at(low), Self::logistic_at(high));
        let phi = Self::between(phi_low.ends()[0].max(0.0), phi_high.ends()[1].min(1.0));
        // The derivative has its largest value, a quarter, at 0, and falls on both sides.
        let least = at_low.ends()[0].min(at_high.ends()[0]).max(0.0);
        let largest =
            if low < 0.0 && high > 0.0 { 0.25 } else { at_low.ends()[1].max(at_high.ends()[1]) };
        (phi, Self::between(least, largest))
    }
}

/// A number of [`PLACES`] binary places with an error of at most `r`.
#[derive(Clone, Debug)]
pub(super) struct Fixed {
    m: BigInt,
    /// Not below the absolute value of the midpoint.
    size: f64,
    pub r: f64,
}

impl Fixed {
    pub fn zero() -> Self {
        Self { m: BigInt::from(0), size: 0.0, r: 0.0 }
    }

    fn new(m: BigInt, r: f64) -> Self {
        let value = value(&m).abs();
        Self { m, size: value * (1.0 + 4.0 * U), r }
    }

    /// Exactly a number whose last bit is not below 2^-192; others are rounded.
    pub fn exactly(x: f64) -> Self {
        Rational::exactly(x)
            .map_or(Self::new(BigInt::from(0), f64::INFINITY), |x| Self::of(&Range::point(&x)))
    }

    /// The midpoint, rounded.
    pub fn midpoint(&self) -> f64 {
        value(&self.m)
    }

    /// The same midpoint without the error.
    pub fn centre(&self) -> Self {
        Self { r: 0.0, ..self.clone() }
    }

    pub fn ball(&self) -> Ball {
        let m = self.midpoint();
        Ball { m, r: (self.r + 2.0 * U * m.abs()) * (1.0 + U) }
    }

    pub fn range(&self, r: f64) -> Option<Range> {
        let m = Rational::dyadic(self.m.clone(), PLACES);
        Some(Range::point(&m).widened(&Rational::exactly(self.r)?).widened(&Rational::exactly(r)?))
    }

    fn one() -> BigInt {
        BigInt::from(1) << PLACES
    }
}

/// The number m 2^-192, to within two units in the last place.
fn value(m: &BigInt) -> f64 {
    let digits = m.magnitude().iter_u64_digits();
    let (mut sum, mut power) = (0.0, UNIT);
    for digit in digits {
        sum += digit as f64 * power;
        power *= 18_446_744_073_709_551_616.0;
    }
    if m.sign() == Sign::Minus { -sum } else { sum }
}

impl Number for Fixed {
    fn of(range: &Range) -> Self {
        let mid = &(&range.low + &range.high) * &Rational::dyadic(BigInt::from(1), 1);
        let m = mid.scaled_down(PLACES);
        let off = &(&range.high - &range.low) * &Rational::dyadic(BigInt::from(1), 1);
        let exact = Rational::dyadic(m.clone(), PLACES) == mid;
        let rounding = if exact { 0.0 } else { UNIT };
        Self::new(m, off.approximately() * (1.0 + 8.0 * U) + rounding)
    }

    fn convolve(a: &[Self], b: &[Self]) -> Self {
        let (mut m, mut r) = (BigInt::from(0), 0.0);
        for (a, b) in a.iter().zip(b.iter().rev()) {
            if a.m.sign() != Sign::NoSign && b.m.sign() != Sign::NoSign {
                m += &a.m * &b.m;
            }
            r += a.size * b.r + a.r * (b.size + b.r);
        }
        let rounding = if m.sign() == Sign::NoSign { 0.0 } else { UNIT };
        let n = (a.len() + 4) as f64;
        Self::new(m >> PLACES, (r + rounding) * (1.0 + n * U) + TINY)
    }

    fn plus(&self, o: &Self) -> Self {
        Self::new(&self.m + &o.m, (self.r + o.r) * (1.0 + U))
    }

    fn minus(&self, o: &Self) -> Self {
        Self::new(&self.m - &o.m, (self.r + o.r) * (1.0 + U))
    }

    fn over(&self, n: usize) -> Self {
        let rounding = if self.m.sign() == Sign::NoSign { 0.0 } else { UNIT };
        Self::new(&self.m / BigInt::from(n), (self.r / n as f64 + rounding) * (1.0 + 2.0 * U))
    }

    fn logistic(&self) -> (Self, Self) {
        /// Halvings of the argument before its exponential series, and as many squarings after.
        const HALVINGS: u32 = 8;
        /// Terms of the series for arguments below 0.6: 0.6^44/44! < 2^-192.
        const TERMS: usize = 44;
        let one = Self::new(Self::one(), 0.0);
        let negative = self.m.sign() == Sign::Minus;
        let size = Self::new(BigInt::from(self.m.magnitude().clone()), self.r);
        let e = if size.size > 140.0 {
            // Below the last place: a radius says all.
            let e = Ball::exponential(-(size.size * (1.0 - 8.0 * U) - size.r));
            Self::new(BigInt::from(0), e.magnitude())
        } else {
            let part = Self::new(-size.m >> HALVINGS, size.r / 256.0 + UNIT);
            let mut sum = one.clone();
            for n in (1..=TERMS).rev() {
                sum = one.plus(&sum.times(&part).over(n));
            }
            sum.r += UNIT;
            (0..HALVINGS).fold(sum, |s, _| s.times(&s))
        };
        // 1/(1 + e): the error of the quotient is that of the divisor, which is above 1 - r.
        let sum = one.plus(&e);
        let inverse = Self::new(
            (Self::one() << PLACES) / &sum.m,
            sum.r / (1.0 - sum.r).max(TINY) * (1.0 + 8.0 * U) + UNIT,
        );
        let other = e.times(&inverse);
        let slope = other.times(&inverse);
        (if negative { other } else { inverse }, slope)
    }
}

/// A function's enclosure with its derivatives by three variables.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dual {
    pub value: Ball,
    pub by: [Ball; 3],
}

impl Number for Dual {
    fn of(range: &Range) -> Self {
        Self { value: Ball::of(range), by: [Ball::ZERO; 3] }
    }

    fn convolve(a: &[Self], b: &[Self]) -> Self {
        let (mut m, mut size, mut r) = ([0.0; 4], [0.0; 4], [0.0; 4]);
        for (a, b) in a.iter().zip(b.iter().rev()) {
            let (am, bm) = (a.value.m.abs(), b.value.m.abs());
            let product = a.value.m * b.value.m;
            m[3] += product;
            size[3] += product.abs();
            r[3] += am * b.value.r + a.value.r * (bm + b.value.r);
            for j in 0..3 {
                let (da, db) = (a.by[j], b.by[j]);
                let (p, q) = (da.m * b.value.m, a.value.m * db.m);
                m[j] += p + q;
                size[j] += p.abs() + q.abs();
                r[j] += da.m.abs() * b.value.r
                    + da.r * (bm + b.value.r)
                    + am * db.r
                    + a.value.r * (db.m.abs() + db.r);
            }
        }
        let n = (2 * a.len() + 6) as f64;
        let ball = |j: usize| Ball { m: m[j], r: (r[j] + n * U * size[j]) * (1.0 + n * U) + TINY };
        Self { value: ball(3), by: [ball(0), ball(1), ball(2)] }
    }

    fn plus(&self, o: &Self) -> Self {
        Self {
            value: self.value.plus(&o.value),
            by: std::array::from_fn(|j| self.by[j].plus(&o.by[j])),
        }
    }

    fn minus(&self, o: &Self) -> Self {
        Self {
            value: self.value.minus(&o.value),
            by: std::array::from_fn(|j| self.by[j].minus(&o.by[j])),
        }
    }

    fn over(&self, n: usize) -> Self {
        Self { value: self.value.over(n), by: self.by.map(|d| d.over(n)) }
    }

    fn logistic(&self) -> (Self, Self) {
        let (phi, slope) = self.value.logistic();
        let bend = slope.times(&Ball::ONE.minus(&phi.plus(&phi)));
        (
            Self { value: phi, by: self.by.map(|d| slope.times(&d)) },
            Self { value: slope, by: self.by.map(|d| bend.times(&d)) },
        )
    }
}
