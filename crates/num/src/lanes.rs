//! Several numbers side by side, for many independent runs at once.
//!
//! Portable: an array and loops over it, which the compiler turns into whatever vector instructions
//! the machine has. Every operation rounds each lane as it rounds a number by itself, so a lane's
//! result does not depend on the width or on its neighbours.

use super::elementary::kernels::{self, Pointwise, TANH_IS_ONE};
use super::scalar::{Arithmetic, Elementary, by_parts, operators};

/// `W` numbers side by side.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(transparent)]
pub struct Lanes<const W: usize>(pub [f64; W]);

impl<const W: usize> Pointwise for Lanes<W> {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        let mut lanes = self.0;
        for lane in &mut lanes {
            *lane = f(*lane);
        }
        Self(lanes)
    }
    #[inline(always)]
    fn map2(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        let mut lanes = self.0;
        for (lane, other) in lanes.iter_mut().zip(other.0) {
            *lane = f(*lane, other);
        }
        Self(lanes)
    }
}

operators! {
    impl [const W: usize] Lanes<W>, inline(always):
    Add add(self, other) { self.map2(other, |a, b| a + b) }
    Sub sub(self, other) { self.map2(other, |a, b| a - b) }
    Mul mul(self, other) { self.map2(other, |a, b| a * b) }
    Div div(self, other) { self.map2(other, |a, b| a / b) }
    -(self) { self.map(|a| -a) }
}

impl<const W: usize> Arithmetic for Lanes<W> {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self([value; W])
    }
}

impl<const W: usize> Elementary for Lanes<W> {
    #[inline(always)]
    fn tanh(self) -> Self {
        // The kernel gives +-1 there as well; most steps have every lane outside its layer.
        if self.0.iter().all(|lane| lane.abs() >= TANH_IS_ONE) {
            self.map(|lane| 1.0_f64.copysign(lane))
        } else {
            kernels::tanh(self)
        }
    }
    #[inline(always)]
    fn exp(self) -> Self {
        kernels::exp(self)
    }
    #[inline(always)]
    fn pi() -> Self {
        Self::from_f64(f64::pi())
    }
    by_parts!(sin cos ln atan erf sqrt sign);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_lane_is_added_and_subtracted_by_itself() {
        let (a, b) = (Lanes([1.5, -2.0]), Lanes([0.25, 8.0]));
        let (mut sum, mut difference) = (a, a);
        sum += b;
        difference -= b;
        assert_eq!((sum.0, difference.0, (-a).0), ([1.75, 6.0], [1.25, -10.0], [-1.5, 2.0]));
    }
}
