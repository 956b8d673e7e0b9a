//! Balls: double-double midpoints with rigorous radii, about 32 digits.
//!
//! A [`Ball`] is the set of all real numbers within `radius` of a [`DoubleDouble`] midpoint
//! (midpoint-radius arithmetic: Rump 1999; Johansson 2017). Each operation on midpoints has a
//! proven bound on its rounding error, which goes into the radius together with the radii of the
//! arguments; radii are computed in `f64` and rounded up.
//!
//! With u = 2^-53: the accurate sum errs by at most 3 u^2 + 13 u^3 of the result and the product by
//! at most 7 u^2 (Joldes, Muller & Popescu 2017, AccurateDWPlusDW and DWTimesDW1; 5 u^2 by Muller &
//! Rideau 2022), as long as nothing overflows; what underflow can add is below 2^-1022. Quotients
//! and roots are bounded by their own residuals, and the elementary functions are computed in ball
//! arithmetic, so that their bounds follow from those two and a bound on the truncated series.

use super::interval::{Enclosure, Interval};
use super::scalar::operators;
use super::{Arithmetic, Decimal, DoubleDouble, Elementary, FromDecimal};

/// All real numbers within `radius` of `midpoint`. An infinite radius means that nothing is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    midpoint: DoubleDouble,
    radius: f64,
}

/// 2^k, for constants.
const fn two_to(k: i64) -> f64 {
    f64::from_bits(((1023 + k) as u64) << 52)
}

/// Bound on the relative error of a sum: 4 u^2.
const SUM_ERROR: f64 = two_to(-104);
/// Bound on the relative error of a product: 8 u^2.
const PRODUCT_ERROR: f64 = two_to(-103);

/// An upper bound of a sum of at most 16 products of non-negative numbers that was computed as `x`.
#[inline]
fn up(x: f64) -> f64 {
    // Each operation loses at most 2^-53 relatively, and at most the least positive number when it
    // underflows.
    (x * (1.0 + two_to(-47))).next_up()
}

impl Ball {
    /// Nothing is known.
    pub const ENTIRE: Self = Self { midpoint: DoubleDouble::ZERO, radius: f64::INFINITY };
    /// pi/2. The double-double differs from it by 1.4974e-33.
    pub(super) const HALF_PI: Self = Self { midpoint: DoubleDouble::HALF_PI, radius: 1.5e-33 };
    /// ln 2. The double-double differs from it by 5.708e-34.
    const LN_2: Self = Self { midpoint: DoubleDouble::LN_2, radius: 5.8e-34 };

    /// The numbers within `radius` of `midpoint`; everything, unless both are finite and `radius >=
    /// 0`.
    #[inline]
    pub fn new(midpoint: DoubleDouble, radius: f64) -> Self {
        if (0.0..f64::INFINITY).contains(&radius) && midpoint.high().is_finite() {
            Self { midpoint, radius }
        } else {
            Self::ENTIRE
        }
    }

    /// The midpoint.
    #[inline]
    pub fn midpoint(self) -> DoubleDouble {
        self.midpoint
    }

    /// The radius.
    #[inline]
    pub fn radius(self) -> f64 {
        self.radius
    }

    /// Whether nothing is known.
    #[inline]
    pub fn is_entire(self) -> bool {
        self.radius == f64::INFINITY
    }

    /// An upper bound of |midpoint|.
    #[inline]
    fn size(self) -> f64 {
        self.midpoint.high().abs().next_up()
    }

    /// Exactly zero.
    #[inline]
    fn is_zero(self) -> bool {
        self.radius == 0.0 && self.midpoint.high() == 0.0
    }

    /// The ball with the same midpoint and a radius larger by `more`.
    #[inline]
    fn widened(self, more: f64) -> Self {
        Self::new(self.midpoint, up(self.radius + more))
    }

    /// The midpoint alone.
    #[inline]
    fn thin(self) -> Self {
        Self { midpoint: self.midpoint, radius: 0.0 }
    }

    /// self * 2^k: exact, for results that neither over- nor underflow (those become `ENTIRE`).
    fn times_power_of_two(self, k: i32) -> Self {
        let m = self.midpoint.times_power_of_two(k);
        let size = m.high().abs();
        if size != 0.0 && !(two_to(-900)..two_to(1000)).contains(&size) || k.abs() > 1000 {
            return Self::ENTIRE;
        }
        Self::new(m, up(self.radius * two_to(i64::from(k))))
    }

    /// exp(self) - 1 for a point |self| < 0.36, as [`DoubleDouble::exp`] does it, in balls.
    fn small_exp_m1(self) -> Self {
        if self.size() < two_to(-200) {
            // exp(r) - 1 = r + r^2/2 + ...
            return self.widened(self.size() * self.size());
        }
        let r = self.times_power_of_two(-9);
        let (mut term, mut sum) = (r, r);
        for n in 2..11 {
            term = term * r / Self::from_f64(f64::from(n));
            sum += term;
        }
        // The rest of the series: |r|^11/11! 1.001 < |r| (7.04e-4)^10/11! 1.001 < |r| 2^-128.
        sum = sum.widened(r.size() * two_to(-128));
        for _ in 0..9 {
            sum = sum + sum + sum * sum;
        }
        sum
    }

    /// exp of a point.
    fn exp_point(self) -> Self {
        let x = self.midpoint.high();
        if x.abs() > 620.0 {
            return Self::ENTIRE;
        }
        let k = (x / DoubleDouble::LN_2.high()).round();
        // |r| <= ln(2)/2 + rounding < 0.36
        let r = self - Self::LN_2 * Self::from_f64(k);
        // The reduced argument's radius is carried by the arithmetic itself only if the kernel sees
        // it as a ball.
        let e = r.thin().small_exp_m1() + Self::one();
        // |exp(r + d) - exp(r)| <= exp(r) (|d| + d^2) for |d| <= 1, and exp(r) < 1.5
        e.widened(1.6 * (r.radius + r.radius * r.radius)).times_power_of_two(k as i32)
    }

    /// tanh of a point.
    fn tanh_point(self) -> Self {
        let x = self.midpoint.high();
        if self.is_zero() {
            return self;
        }
        if x.abs() > 300.0 {
            // 1 - tanh(300) = 2 exp(-600)/(1 + exp(-600)) < 1e-260
            return Self::new(DoubleDouble::from_f64(1.0_f64.copysign(x)), 1e-260);
        }
        if x.abs() < 0.17 {
            let e = (self + self).small_exp_m1();
            return e / (e + Self::from_f64(2.0));
        }
        let w = if x < 0.0 { -self } else { self };
        let t = Self::one() - Self::from_f64(2.0) / ((w + w).thin_exp() + Self::one());
        if x < 0.0 { -t } else { t }
    }

    /// exp of a sum that is exact or almost: a point with a radius of rounding size.
    fn thin_exp(self) -> Self {
        let e = self.thin().exp_point();
        let d = self.radius;
        if d > 1.0 {
            return Self::ENTIRE;
        }
        e.widened(up(e.size() + e.radius) * (d + d * d))
    }

    /// 1 - tanh^2, with a small relative error also where it is tiny: 4 e/(1 + e)^2 with e = exp(-2
    /// |x|).
    pub(super) fn sech_squared_ball(self) -> Self {
        if self.is_entire() {
            return Self::ENTIRE;
        }
        let x = self.midpoint.high().abs();
        if x > 300.0 {
            // At most 4 exp(-600) < 1.1e-260, also within a radius below 1; at most 1 in any case.
            return Self::new(DoubleDouble::ZERO, if self.radius < 1.0 { 1e-259 } else { 1.0 });
        }
        let point = self.thin();
        let w = if self.midpoint.high() < 0.0 { -point } else { point };
        let e = (-(w + w)).thin_exp();
        let f = e + Self::one();
        let slope = e / (f * f) * Self::from_f64(4.0);
        // Its logarithm's slope is at most 2 in modulus: within d, it changes by at most exp(2 d) -
        // 1 <= 2 d exp(2) of itself for d <= 1.
        let relative = if self.radius <= 1.0 {
            14.8 * self.radius
        } else {
            return Self::new(DoubleDouble::ZERO, 1.0);
        };
        slope.widened(up(slope.size() + slope.radius) * relative)
    }

    /// sin(self + quarters pi/2).
    pub(super) fn sine(self, quarters: i64) -> Self {
        let x = self.midpoint.high();
        if self.is_entire() || x.abs() > 1e12 {
            return if self.is_entire() { self } else { Self::new(DoubleDouble::ZERO, 1.0) };
        }
        let q = (x / DoubleDouble::HALF_PI.high()).round();
        // pi/2 in three parts, the third known to 1e-49.
        let third = Self::new(DoubleDouble::from_f64(DoubleDouble::HALF_PI_REST), 1e-48);
        let half_pi = Self { midpoint: DoubleDouble::HALF_PI, radius: 0.0 };
        let turns = Self::from_f64(q);
        let r = self.thin() - half_pi * turns - third * turns;
        let quadrant = (q as i64 + quarters).rem_euclid(4);
        let value = if quadrant % 2 == 0 { r.thin().small_sin() } else { r.thin().small_cos() };
        let value = value.widened(r.radius + self.radius);
        if quadrant < 2 { value } else { -value }
    }

    /// sin of a point |self| < 0.8.
    fn small_sin(self) -> Self {
        let square = self * self;
        let (mut term, mut sum) = (self, self);
        for n in 1..15 {
            let k = f64::from(2 * n);
            term = -(term * square) / Self::from_f64(k * (k + 1.0));
            sum += term;
        }
        // Alternating: at most the first term left out, |x| 0.8^30/31! < |x| 1.6e-37.
        sum.widened(self.size() * 2e-37)
    }

    /// cos of a point |self| < 0.8.
    fn small_cos(self) -> Self {
        let square = self * self;
        let (mut term, mut sum) = (Self::one(), Self::one());
        for n in 1..15 {
            let k = f64::from(2 * n);
            term = -(term * square) / Self::from_f64(k * (k - 1.0));
            sum += term;
        }
        // 0.8^30/30! < 4.7e-36
        sum.widened(5e-36)
    }
}

operators! {
    impl [] Ball, inline:
    Add add(self, other) {
        if self.is_zero() {
            return other;
        }
        if other.is_zero() {
            return self;
        }
        let m = self.midpoint + other.midpoint;
        Self::new(m, up(self.radius + other.radius + m.high().abs() * SUM_ERROR))
    }
    Sub sub(self, other) { self + -other }
    Mul mul(self, other) {
        if self.is_entire() || other.is_entire() {
            return Self::ENTIRE;
        }
        if self.is_zero() || other.is_zero() {
            return Self::zero();
        }
        let m = self.midpoint * other.midpoint;
        let (a, b) = (self.midpoint.high().abs(), other.midpoint.high().abs());
        // |a| + 2^-53 |a| stands for the midpoint; `up` covers that factor too.
        let radius = a * other.radius + b * self.radius + self.radius * other.radius;
        Self::new(m, up(radius + m.high().abs() * PRODUCT_ERROR + f64::MIN_POSITIVE))
    }
    Div div(self, other) {
        let least = other.midpoint.high().abs().next_down() - up(other.radius);
        if self.is_entire() || least.is_nan() || least <= 0.0 {
            return Self::ENTIRE;
        }
        let least = least.next_down();
        if self.is_zero() {
            return self;
        }
        let q = Self::new(self.midpoint / other.midpoint, 0.0);
        // |a'/b' - q| = |a' - q b'|/|b'|, with a' = a + da and b' = b + db.
        let rest = self.thin() - q * other.thin();
        let error = up(rest.size() + rest.radius + self.radius + q.size() * other.radius);
        Self::new(q.midpoint, up(error / least))
    }
    -(self) { Self { midpoint: -self.midpoint, radius: self.radius } }
}

impl Arithmetic for Ball {
    #[inline]
    fn from_f64(value: f64) -> Self {
        Self::new(DoubleDouble::from_f64(value), 0.0)
    }
}

impl Elementary for Ball {
    fn tanh(self) -> Self {
        if self.is_entire() {
            return Self::ENTIRE;
        }
        let t = self.thin().tanh_point();
        // Its slope is at most sech^2 at the member nearest to zero.
        let slope = self.interval().sech_squared().map_or(1.0, Interval::upper);
        t.widened(self.radius * slope)
    }
    fn sech_squared(self) -> Option<Self> {
        Some(self.sech_squared_ball())
    }
    fn exp(self) -> Self {
        if self.is_entire() { Self::ENTIRE } else { self.thin_exp() }
    }
    fn sin(self) -> Self {
        self.sine(0)
    }
    fn cos(self) -> Self {
        self.sine(1)
    }
    fn ln(self) -> Self {
        let least = self.interval().lower();
        if self.is_entire() || least <= 0.0 {
            return Self::ENTIRE;
        }
        // ln x = y + ln(1 + d) with x exp(-y) = 1 + d, and |ln(1 + d) - d| <= d^2 for |d| <= 1/2.
        let y = Self::new(self.midpoint.ln(), 0.0);
        let d = self.thin() * (-y).exp() - Self::one();
        let size = up(d.size() + d.radius);
        if size > 0.5 {
            return Self::ENTIRE;
        }
        (y + d).widened(up(size * size + self.radius / least))
    }
    fn atan(self) -> Self {
        if self.is_entire() || self.is_zero() {
            return self;
        }
        // atan x = y + atan d with d = (x - tan y)/(1 + x tan y), and |atan d - d| <= |d|^3.
        let y = Self::new(self.midpoint.atan(), 0.0);
        let (s, c, x) = (y.sin(), y.cos(), self.thin());
        let d = (x * c - s) / (c + x * s);
        let size = up(d.size() + d.radius);
        (y + d).widened(up(size * size * size + self.radius))
    }
    fn erf(self) -> Self {
        if self.is_entire() || self.is_zero() {
            return self;
        }
        let x = self.thin();
        let size = x.size();
        // erf' = 2/sqrt(pi) exp(-x^2) < 1.13
        let spread = self.radius * 1.13;
        if size > 12.0 {
            // 1 - erf x < exp(-x^2)/x
            return Self::new(DoubleDouble::from_f64(1.0_f64.copysign(x.midpoint.high())), 1e-62)
                .widened(spread);
        }
        if size < 1e-50 {
            // |erf x - 2 x/sqrt(pi)| < |x|^3; the terms of a series would soon be below all numbers, and never small beside x.
            let line = x * Self::from_f64(2.0) / Self::pi().sqrt();
            return line.widened(up(size * 1e-100)).widened(spread);
        }
        // 2/sqrt(pi) exp(-x^2) sum of 2^n x^(2n+1)/(1 3 5 ... (2n+1)), all terms of one sign
        // (Abramowitz & Stegun 7.1.6).
        let square = x * x;
        let (mut term, mut sum, mut n) = (x, x, 0.0);
        // Until the terms are at most half of the one before, and negligible; the rest is then at
        // most the last one.
        while 2.0 * size * size > 0.49 * (2.0 * n + 3.0) || term.size() > sum.size() * 1e-33 {
            n += 1.0;
            term = term * square * Self::from_f64(2.0) / Self::from_f64(2.0 * n + 1.0);
            sum += term;
        }
        let sum = sum.widened(up(term.size() + term.radius));
        (sum * (-square).exp() * Self::from_f64(2.0) / Self::pi().sqrt()).widened(spread)
    }
    fn pi() -> Self {
        Self::HALF_PI + Self::HALF_PI
    }
    fn sqrt(self) -> Self {
        if self.is_zero() {
            return self;
        }
        if self.is_entire() || !self.interval().is_positive() {
            return Self::ENTIRE;
        }
        let s = Self::new(self.midpoint.sqrt(), 0.0);
        // |sqrt(a') - s| <= |a' - s^2|/s
        let rest = self.thin() - s * s;
        let error = up(rest.size() + rest.radius + self.radius);
        Self::new(s.midpoint, up(error / s.midpoint.high().next_down()))
    }
    fn sign(self) -> Self {
        let sign = self.interval().sign();
        if sign.is_entire() { Self::ENTIRE } else { Self::from_f64(sign.midpoint()) }
    }
}

impl FromDecimal for Ball {
    fn from_decimal(number: &Decimal) -> Self {
        let value = number.value();
        if value == value.trunc() && value.abs() < 9e15 && *number == Decimal::from(value) {
            return Self::from_f64(value);
        }
        // Printed digits read back as the same number.
        let text = number.to_string();
        let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((&text, "0"));
        let Ok(mut exponent) = exponent.parse::<i32>() else { return Self::ENTIRE };
        let ten = Self::from_f64(10.0);
        // The first 15 digits at once: exact.
        let (mut leading, mut count, mut number, mut after_point) = (0.0, 0, Self::zero(), false);
        for c in mantissa.chars() {
            if let Some(digit) = c.to_digit(10) {
                count += 1;
                if count <= 15 {
                    leading = leading * 10.0 + f64::from(digit);
                    number = Self::from_f64(leading);
                } else {
                    number = number * ten + Self::from_f64(f64::from(digit));
                }
                exponent -= i32::from(after_point);
            } else {
                after_point |= c == '.';
            }
        }
        let power = (0..exponent.abs()).fold(Self::one(), |power, _| power * ten);
        let number = if exponent < 0 { number / power } else { number * power };
        if mantissa.starts_with('-') { -number } else { number }
    }
}

impl Enclosure for Ball {
    fn from_interval(interval: Interval) -> Self {
        let c = interval.midpoint();
        Self::new(DoubleDouble::from_f64(c), (interval - Interval::from_f64(c)).magnitude())
    }
    fn interval(self) -> Interval {
        if self.is_entire() {
            return Interval::ENTIRE;
        }
        // high + low, exactly enclosed, then the radius.
        Interval::from_f64(self.midpoint.high())
            + (Interval::from_f64(self.midpoint.low()) + Interval::symmetric(self.radius))
    }
    fn split(self) -> (Self, Interval) {
        if self.is_entire() {
            return (Self::zero(), Interval::ENTIRE);
        }
        (self.thin(), Interval::symmetric(self.radius))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{MultiFloat, Scalar};

    /// 150 digits.
    type Fine = MultiFloat<8>;

    /// A function in balls and in many digits.
    struct Function {
        name: &'static str,
        ball: fn(Ball) -> Ball,
        fine: fn(Fine) -> Fine,
        /// Bound on the contribution of a radius about `x` to the result's, the value there being
        /// `y` in modulus.
        spread: fn(x: f64, radius: f64, y: f64) -> f64,
        /// Bound on the contribution of rounding to it, in units of 1e-30 y; `x` in modulus.
        rounding: fn(x: f64, y: f64) -> f64,
        /// Arguments from which on it is given.
        from: f64,
    }

    fn sech_squared(x: Fine) -> Fine {
        let e = (-(x.abs() + x.abs())).exp();
        let f = e + Fine::one();
        e / (f * f) * Fine::from_f64(4.0)
    }

    fn functions() -> [Function; 9] {
        let all = f64::NEG_INFINITY;
        let f = |name, ball, fine, spread, rounding, from| Function {
            name,
            ball,
            fine,
            spread,
            rounding,
            from,
        };
        // Beyond the first quadrant, pi's own error, whatever the value is.
        let reduced = |x: f64, y: f64| (0.73 + 0.11 * x) / if x > 1.0 { y } else { 1.0 };
        [
            f("exp", Ball::exp, Fine::exp, |_, r, y| y * (r + r * r), |x, _| 0.9 + 0.25 * x, all),
            f(
                "tanh",
                Ball::tanh,
                Fine::tanh,
                |x, r, _| r / cosh((x.abs() - r).max(0.0)).powi(2),
                |_, _| 3.7,
                all,
            ),
            f(
                "sech^2",
                Ball::sech_squared_ball,
                sech_squared,
                |_, r, y| 14.8 * r * y,
                |x, _| 2.1 + 0.48 * x,
                all,
            ),
            f("sin", Ball::sin, Fine::sin, |_, r, _| r, reduced, all),
            f("cos", Ball::cos, Fine::cos, |_, r, _| r, reduced, all),
            f("ln", Ball::ln, Fine::ln, |x, r, _| r / (x - r), |_, y| (1.2 + 0.75 * y) / y, 0.01),
            f("sqrt", Ball::sqrt, Fine::sqrt, |x, r, _| r / x.sqrt(), |_, _| 0.125, 0.01),
            f("atan", Ball::atan, Fine::atan, |_, r, _| r, |_, _| 1.6, all),
            f(
                "erf",
                Ball::erf,
                Fine::erf,
                |_, r, _| 1.13 * r,
                |x, _| 1.15 + 1.3 * x + 0.62 * x * x,
                all,
            ),
        ]
    }

    fn cosh(x: f64) -> f64 {
        let e = Elementary::exp(x);
        0.5 * (e + 1.0 / e)
    }

    const POINTS: [f64; 15] =
        [1e-70, 1e-20, 0.003, 0.05, 0.11, 0.169, 0.18, 0.34, 0.7, 1.6, 2.9, 6.5, 11.5, 40.3, 150.1];

    #[test]
    fn a_ball_of_an_interval_covers_it_and_hardly_more() {
        for (low, high) in
            [(2.9, 3.1), (-3.1, -2.9), (-0.5, 4.0), (1e-9, 2e-9), (7.0, 7.0), (0.0, 0.0)]
        {
            let interval = Interval::new(low, high).unwrap();
            let ball = Ball::from_interval(interval).interval();
            assert!(
                ball.lower() <= low && high <= ball.upper(),
                "{ball:?} leaves out some of {interval:?}"
            );
            let spare = 1e-15 * high.abs().max(low.abs());
            assert!(
                ball.lower() >= low - spare && ball.upper() <= high + spare,
                "{ball:?} is wider than {interval:?}"
            );
        }
    }

    #[test]
    fn a_function_of_a_ball_contains_its_values_and_little_else() {
        for Function { name, ball, fine, spread, rounding, from } in functions() {
            for x in POINTS.iter().flat_map(|x| [*x, -x]).filter(|x| *x >= from) {
                // A midpoint with a second part.
                let midpoint = DoubleDouble::from_f64(x) + DoubleDouble::from_f64(x * 3e-18);
                let center = Fine::from_f64(midpoint.high()) + Fine::from_f64(midpoint.low());
                for radius in [0.0, 1e-25, 1e-14, 1e-6, 2e-3] {
                    if x.abs() < 1e-3 && radius > 1e-9 {
                        continue;
                    }
                    let found = ball(Ball::new(midpoint, radius));
                    let y = fine(center).to_f64().abs();
                    for part in [-1.0, -0.4, 0.0, 0.7, 1.0] {
                        let value = fine(center + Fine::from_f64(radius) * Fine::from_f64(part));
                        let away = value
                            - Fine::from_f64(found.midpoint().high())
                            - Fine::from_f64(found.midpoint().low());
                        assert!(
                            away.abs() <= Fine::from_f64(found.radius()),
                            "{name} of {x} ± {radius}, {part}: {found:?}"
                        );
                    }
                    let most =
                        spread(x, radius, y) * (1.0 + 1e-9) + rounding(x.abs(), y) * 1e-30 * y;
                    assert!(
                        found.radius() <= most,
                        "{name} of {x} ± {radius}: {found:?}, wanted {most:e}"
                    );
                }
            }
        }
    }

    #[test]
    fn beyond_what_it_knows_a_ball_says_so() {
        let point = |x: f64| Ball::from_f64(x);
        let thick = |x: f64, radius: f64| Ball::new(DoubleDouble::from_f64(x), radius);
        assert!(Ball::ENTIRE.is_entire() && !thick(1.0, 1e300).is_entire());
        for f in [
            Ball::tanh,
            Ball::exp,
            Ball::ln,
            Ball::atan,
            Ball::erf,
            Ball::sqrt,
            Ball::sin,
            Ball::cos,
        ] {
            assert!(f(Ball::ENTIRE).is_entire());
        }
        for entire in [
            point(621.0).exp(),
            thick(0.0, 1.1).exp(),
            point(-1.0).ln(),
            thick(1.0, 1.0).ln(),
            point(-1.0).sqrt(),
            thick(1.0, 1.5).sqrt(),
            point(1e-280).times_power_of_two(-20),
            point(1.0).times_power_of_two(1001),
            point(1.0) / thick(1.0, 1.0),
            thick(0.0, 0.5).sign(),
        ] {
            assert!(entire.is_entire(), "{entire:?}");
        }
        // Far out, all that is known is within 1.
        for known in [
            point(1e13).sin(),
            thick(0.5, 1.5).sech_squared_ball(),
            thick(301.0, 2.0).sech_squared_ball(),
        ] {
            assert_eq!((known.midpoint().high(), known.radius()), (0.0, 1.0));
        }
        for x in [-301.0, 301.0] {
            let (tanh, slope) = (thick(x, 0.5).tanh(), thick(x, 0.5).sech_squared_ball());
            assert_eq!(tanh.midpoint().high(), x.signum());
            assert!((1e-260..1e-100).contains(&tanh.radius()), "{tanh:?}");
            assert!(slope.midpoint().high() == 0.0 && slope.radius() == 1e-259, "{slope:?}");
        }
        let erf = point(-12.5).erf();
        assert!(
            erf.midpoint().high() == -1.0 && (1e-62..1.1e-62).contains(&erf.radius()),
            "{erf:?}"
        );
        assert_eq!(thick(3.0, 0.5).times_power_of_two(-1).midpoint().high(), 1.5);
        assert_eq!(thick(-3.0, 0.5).sign(), point(-1.0));
    }

    /// Its series never came to an end about zero: no term is small beside a sum that is below all
    /// numbers.
    #[test]
    fn erf_is_a_line_about_zero() {
        let thick = |x: f64, radius: f64| Ball::new(DoubleDouble::from_f64(x), radius);
        for size in [5e-324, 1e-310, 1e-300, 1e-291, 1e-150, 0.99e-50, 1.01e-50, 1e-40] {
            for x in [size, -size] {
                let (erf, line) = (thick(x, 0.0).erf(), x * std::f64::consts::FRAC_2_SQRT_PI);
                let away = (erf.midpoint().high() - line).abs();
                assert!(away <= 1e-15 * size + 1e-320 && erf.radius() >= 0.0, "{x}: {erf:?}");
                assert!(erf.radius() <= 1e-30 * size + 1e-300, "{x}: {erf:?}");
            }
        }
        for radius in [5e-324, 1e-300, 1e-20, 0.5] {
            let erf = thick(0.0, radius).erf();
            assert!(
                erf.midpoint().high() == 0.0
                    && (1.12 * radius..=1.14 * radius + 1e-300).contains(&erf.radius())
            );
        }
    }

    #[test]
    fn a_ball_is_subtracted_in_place() {
        let (a, b) = (
            Ball::new(DoubleDouble::from_f64(1.5), 0.25),
            Ball::new(DoubleDouble::from_f64(0.5), 0.125),
        );
        let mut difference = a;
        difference -= b;
        assert_eq!(difference, a - b);
        assert_eq!(difference.midpoint.to_f64(), 1.0);
        assert!(difference.radius >= 0.375 && difference.radius < 0.3751);
    }
}
