//! Numbers with a bound on how far they may be from a middle: what an expression can be along a
//! step, by one evaluation.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

use twofold_num::{Arithmetic, Elementary};

/// All numbers within `radius` of `middle`; rounding is in the radius, so that a value computed in
/// `f64` is one of them, too. Where nothing is known the radius is infinite or not-a-number.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Range {
    middle: f64,
    radius: f64,
}

/// More than an operation's rounding, relative to its result.
const ROUNDING: f64 = 8.0 * f64::EPSILON;

impl Range {
    /// All numbers this near to `middle`, and the rounding of both.
    pub fn new(middle: f64, radius: f64) -> Self {
        Self {
            middle,
            radius: radius * (1.0 + ROUNDING) + ROUNDING * middle.abs() + f64::MIN_POSITIVE,
        }
    }

    /// Range between Bernstein coefficients that carry the rounding of a few sums.
    pub fn between(b: &[f64; 5]) -> Self {
        let (low, high) = b.iter().fold((b[0], b[0]), |(low, high), b| (low.min(*b), high.max(*b)));
        Self::new(
            0.5 * (low + high),
            0.5 * (high - low) + 16.0 * ROUNDING * low.abs().max(high.abs()),
        )
    }

    /// The middle.
    pub fn middle(self) -> f64 {
        self.middle
    }

    /// The distance from the middle up to which they are.
    pub fn radius(self) -> f64 {
        self.radius
    }

    /// Whether all numbers are on this side of `boundary`.
    pub fn is_beyond(self, boundary: f64, side: f64) -> bool {
        (self.middle - boundary) * side > self.radius + ROUNDING * boundary.abs()
    }

    /// A function of this value in the middle, which is nowhere steeper than `slope`, and whose
    /// values lie within `most` of zero.
    fn within(self, middle: f64, slope: f64, most: f64) -> Self {
        let radius = slope * self.radius;
        // Not-a-number stays.
        Self::new(middle, if radius > most + middle.abs() { most + middle.abs() } else { radius })
    }

    /// A rising function: flat where it is flat, however far its argument reaches.
    fn rising(self, f: impl Fn(f64) -> f64) -> Self {
        let [low, middle, high] = [-self.radius, 0.0, self.radius].map(|r| f(self.middle + r));
        // Not-a-number stays.
        let radius = if low <= high { (high - middle).max(middle - low) } else { low + high };
        Self::new(middle, radius + ROUNDING * middle.abs())
    }

    /// The least number, if all are positive; else not-a-number.
    fn positive(self) -> f64 {
        let least = self.middle - self.radius;
        if least > 0.0 { least } else { f64::NAN }
    }
}

impl Add for Range {
    type Output = Self;
    #[inline]
    fn add(self, other: Self) -> Self {
        Self::new(self.middle + other.middle, self.radius + other.radius)
    }
}

impl Sub for Range {
    type Output = Self;
    #[inline]
    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl Neg for Range {
    type Output = Self;
    #[inline]
    fn neg(self) -> Self {
        Self { middle: -self.middle, ..self }
    }
}

impl Mul for Range {
    type Output = Self;
    #[inline]
    fn mul(self, other: Self) -> Self {
        let radius =
            self.middle.abs() * other.radius + self.radius * (other.middle.abs() + other.radius);
        Self::new(self.middle * other.middle, radius)
    }
}

impl Div for Range {
    type Output = Self;
    #[inline]
    fn div(self, other: Self) -> Self {
        // |a/b - A/B| = |(a - A) B - A (b - B)| / |b B|.
        let divisor = Self { middle: other.middle.abs(), ..other };
        let quotient = self.middle / other.middle;
        Self::new(quotient, (self.radius + quotient.abs() * other.radius) / divisor.positive())
    }
}

impl AddAssign for Range {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl SubAssign for Range {
    fn sub_assign(&mut self, other: Self) {
        *self = *self - other;
    }
}

impl Arithmetic for Range {
    #[inline]
    fn from_f64(value: f64) -> Self {
        Self { middle: value, radius: 0.0 }
    }
}

impl Elementary for Range {
    fn tanh(self) -> Self {
        self.rising(Elementary::tanh)
    }
    fn exp(self) -> Self {
        // e^r - 1 is at most r + r^2 up to r = 1.79.
        let e = Elementary::exp(self.middle);
        let grows = if self.radius <= 1.0 {
            self.radius + self.radius * self.radius
        } else {
            f64::INFINITY
        };
        Self::new(e, e * grows)
    }
    fn sin(self) -> Self {
        self.within(Elementary::sin(self.middle), 1.0, 1.0)
    }
    fn cos(self) -> Self {
        self.within(Elementary::cos(self.middle), 1.0, 1.0)
    }
    fn sqrt(self) -> Self {
        // |a - A| / (sqrt a + sqrt A).
        let root = Elementary::sqrt(self.middle);
        Self::new(root, self.radius / root + 0.0 * self.positive())
    }
    fn ln(self) -> Self {
        self.within(Elementary::ln(self.middle), 1.0 / self.positive(), f64::INFINITY)
    }
    fn atan(self) -> Self {
        self.rising(Elementary::atan)
    }
    fn erf(self) -> Self {
        self.rising(Elementary::erf)
    }
    fn pi() -> Self {
        Self::new(std::f64::consts::PI, 0.0)
    }
    fn sign(self) -> Self {
        let flat = self.middle.abs() > self.radius;
        Self {
            middle: if flat { self.middle.signum() } else { 0.0 },
            radius: if flat { 0.0 } else { 1.0 },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_holds_what_a_function_takes_on_it() {
        fn functions<S: Elementary>(x: S, y: S) -> Vec<S> {
            let two = S::from_f64(2.0);
            vec![
                x + y,
                x - y,
                x * y,
                x / y,
                y.sqrt() * x,
                x.exp() - y.ln(),
                (two * x).tanh() + (two * x).erf(),
                x.sin() * (two * y).cos(),
                (x * x / y).atan(),
                (x - y).power(3) * y.power(-2),
                (x * x - y).sign() * (y + S::pi()),
            ]
        }
        let (mut tight, mut all) = (0, 0);
        for center in [[0.3, 0.7], [-1.2, 2.0], [4.0, 0.4], [-0.01, 30.0]] {
            for width in [0.0, 1e-9, 0.01, 0.3] {
                let span = |c: f64| [c - width, c - 0.4 * width, c, c + 0.7 * width, c + width];
                let [xs, ys] = center.map(span);
                let ranges = functions(Range::between(&xs), Range::between(&ys));
                for x in xs {
                    for y in ys {
                        for (i, (value, range)) in
                            functions(x, y).into_iter().zip(&ranges).enumerate()
                        {
                            let inside = (value - range.middle).abs() <= range.radius;
                            assert!(inside || !range.radius.is_finite(), "{i}: {value} {range:?}");
                            all += 1;
                            tight += usize::from(
                                range.radius <= 10.0 * width * (1.0 + value.abs()) + 1e-12,
                            );
                        }
                    }
                }
            }
        }
        assert!(tight * 10 > all * 7, "{tight} of {all}");
    }

    #[test]
    fn where_nothing_is_known_nothing_is_excluded() {
        let x = Range::between(&[-0.1, 0.0, 0.1, 0.2, 0.3]);
        let one = Range::from_f64(1.0);
        for range in [
            one / x,
            x.sqrt(),
            x.ln(),
            x.power(-2),
            (x * Range::from_f64(1e4)).exp(),
            one / (x - x),
            Range::from_f64(f64::NAN),
        ] {
            let all = range + Range::from_f64(1e300);
            assert!(!all.is_beyond(0.0, 1.0) && !all.is_beyond(0.0, -1.0), "{range:?}");
        }
        assert!(one.is_beyond(0.5, 1.0) && !one.is_beyond(1.0, 1.0) && one.is_beyond(2.0, -1.0));
        // Bounded functions stay what they are.
        assert!((x * Range::from_f64(1e9)).sin().is_beyond(-1.1, 1.0));
    }
}
