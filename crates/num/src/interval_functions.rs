//! Elementary functions of intervals, and intervals of decimal numbers, by numbers of about 32
//! digits with a radius ([`Ball`]).

use super::interval::{Enclosure, Interval, Side, side, sqrt_bounds};
use super::interval_extended::Ball;
use super::{Arithmetic, Decimal, Elementary, FromDecimal};

impl Interval {
    /// sin(self + quarters pi/2).
    fn sine(self, quarters: f64) -> Self {
        if self.is_entire() {
            return Self::ENTIRE;
        }
        // Beyond this the reduction keeps too few digits to tell one wave from the next.
        if self.magnitude() > 1e9 || self.width() >= 6.5 {
            return Self::UNIT;
        }
        // In quarter waves: maxima at 1 + 4 k, minima at 3 + 4 k. Floors differ if an extremum may
        // lie between the ends.
        let quarter = Ball::HALF_PI.interval();
        let place = |x: f64| Self::from_f64(x) / quarter + Self::from_f64(quarters);
        let (from, to) = (place(self.lower).lower, place(self.upper).upper);
        let holds = |at: f64| ((to - at) * 0.25).floor() != ((from - at) * 0.25).floor();
        let value = |x: f64| Ball::from_f64(x).sine(quarters as i64).interval();
        let ends = value(self.lower).hull(value(self.upper));
        // A floor is reached exactly at an extremum: the neighbouring case is included by rounding
        // outward first.
        Self {
            lower: if holds(3.0) { -1.0 } else { ends.lower.max(-1.0) },
            upper: if holds(1.0) { 1.0 } else { ends.upper.min(1.0) },
        }
    }
}

impl Elementary for Interval {
    fn tanh(self) -> Self {
        self.increasing(|x| match x.is_infinite() {
            true => Self::from_f64(x.signum()),
            false => {
                Ball::from_f64(x).tanh().interval().intersection(Self::UNIT).unwrap_or(Self::UNIT)
            }
        })
    }
    fn sech_squared(self) -> Option<Self> {
        if self.is_entire() {
            return Some(Self::ENTIRE);
        }
        // Decreasing in |x|.
        let at = |x: f64| match x.is_infinite() {
            true => Self::zero(),
            false => Ball::from_f64(x).sech_squared_ball().interval(),
        };
        let (least, most) = (at(self.magnitude()), at(self.mignitude()));
        Some(Self { lower: least.lower.max(0.0), upper: most.upper.min(1.0) })
    }
    fn exp(self) -> Self {
        self.increasing(|x| {
            let e = Ball::from_f64(x).exp().interval();
            if x == f64::NEG_INFINITY {
                Self::zero()
            } else if e.is_entire() {
                // Beyond the range of the extended numbers.
                Self {
                    lower: if x > 0.0 { 1e300 } else { 0.0 },
                    upper: if x > 0.0 { f64::INFINITY } else { 1e-250 },
                }
            } else {
                Self { lower: e.lower.max(0.0), upper: e.upper }
            }
        })
    }
    fn sin(self) -> Self {
        self.sine(0.0)
    }
    fn cos(self) -> Self {
        self.sine(1.0)
    }
    fn sqrt(self) -> Self {
        if self.lower < 0.0 {
            return Self::ENTIRE;
        }
        let upper = if self.upper.is_infinite() { self.upper } else { sqrt_bounds(self.upper).1 };
        Self { lower: sqrt_bounds(self.lower).0, upper }
    }
    fn ln(self) -> Self {
        if self.lower <= 0.0 {
            return Self::ENTIRE;
        }
        self.increasing(|x| match x.is_infinite() {
            true => Self { lower: 709.0, upper: f64::INFINITY },
            false => Ball::from_f64(x).ln().interval(),
        })
    }
    fn atan(self) -> Self {
        self.increasing(|x| match x.is_infinite() {
            true => Ball::HALF_PI.interval() * Self::from_f64(x.signum()),
            false => Ball::from_f64(x).atan().interval(),
        })
    }
    fn erf(self) -> Self {
        self.increasing(|x| match x.is_infinite() {
            true => Self::from_f64(x.signum()),
            false => {
                Ball::from_f64(x).erf().interval().intersection(Self::UNIT).unwrap_or(Self::UNIT)
            }
        })
    }
    fn pi() -> Self {
        Ball::pi().interval()
    }
    /// `ENTIRE` if the interval holds numbers of both signs: the sign is not smooth there, and an
    /// enclosure by [-1, 1] would let a series through that does not exist.
    fn sign(self) -> Self {
        if self.lower >= 0.0 {
            Self::one()
        } else if self.upper < 0.0 {
            -Self::one()
        } else {
            Self::ENTIRE
        }
    }
}

impl FromDecimal for Interval {
    /// The best enclosure of a decimal number of up to 17 digits, a very tight one of longer ones.
    fn from_decimal(number: &Decimal) -> Self {
        let value = number.value();
        if *number != Decimal::from(value) {
            let near = Self::ordered(value.next_down(), value.next_up());
            return Ball::from_decimal(number).interval().intersection(near).unwrap_or(near);
        }
        match side(value) {
            Side::Exact => Self::from_f64(value),
            Side::Above => Self::ordered(value, value.next_up()),
            Side::Below => Self::ordered(value.next_down(), value),
            Side::Near => Self::ordered(value.next_down(), value.next_up()),
        }
    }
}
