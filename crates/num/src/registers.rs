//! Several numbers side by side in the registers of an instruction set that is chosen at run time
//! (crate `pulp`).
//!
//! [`Lanes`](super::Lanes) leaves it to the compiler to find vector instructions; here every
//! operation is one. Each rounds every lane as it rounds a number by itself, and none is fused with
//! another, so the instruction set decides how fast a result comes and not what it is.

// Loops by number over registers and components: iterators and closures may stay calls, compiled
// for the wrong instruction set.
#![allow(clippy::needless_range_loop)]

use pulp::Simd;
use pulp::bytemuck::{Zeroable, cast_slice, cast_slice_mut};

use super::elementary::kernels::{self, Pointwise, TANH_IS_ONE};
use super::scalar::{Arithmetic, Elementary, by_parts, operators};

/// The numbers in `K` registers of the instruction set `S`; with several registers the latency of
/// one operation is hidden by the others.
///
/// A constant ([`Arithmetic::from_f64`]) has no instruction set, since it may be made before one is
/// chosen; it takes that of the first number it is combined with.
#[derive(Clone, Copy, Debug)]
pub struct Registers<S: Simd, const K: usize> {
    set: Option<S>,
    constant: f64,
    parts: [S::f64s; K],
}

/// Registers in memory, from the beginning of a cache line on: where one lies across two lines, it
/// is read and written in two parts.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub struct Aligned<T>(pub T);

/// A truth value for each lane.
#[derive(Clone, Copy, Debug)]
pub struct Mask<S: Simd, const K: usize> {
    set: S,
    parts: [S::m64s; K],
}

impl<S: Simd, const K: usize> Registers<S, K> {
    /// Number of lanes.
    pub const WIDTH: usize = K * S::F64_LANES;

    /// The numbers in `parts`.
    #[inline(always)]
    pub fn new(set: S, parts: [S::f64s; K]) -> Self {
        Self { set: Some(set), constant: 0.0, parts }
    }

    /// The number `value` in every lane.
    #[inline(always)]
    pub fn splat(set: S, value: f64) -> Self {
        Self::new(set, [set.splat_f64s(value); K])
    }

    /// The numbers at the start of `values`, one for each lane.
    ///
    /// # Panics
    /// If there are fewer.
    #[inline(always)]
    pub fn load(set: S, values: &[f64]) -> Self {
        let mut parts = [set.splat_f64s(0.0); K];
        cast_slice_mut::<_, f64>(&mut parts).copy_from_slice(&values[..Self::WIDTH]);
        Self::new(set, parts)
    }

    /// The number in the first lane.
    #[inline(always)]
    pub fn first(self) -> f64 {
        cast_slice::<_, f64>(&self.parts())[0]
    }

    /// Moves every lane's number to the lane before it; the last lane becomes zero.
    #[inline(always)]
    pub fn shifted(self, set: S) -> Self {
        let mut end = set.splat_f64s(0.0);
        if let Some(last) = cast_slice_mut::<_, f64>(std::slice::from_mut(&mut end)).last_mut() {
            *last = 1.0;
        }
        let end = set.less_than_f64s(set.splat_f64s(0.5), end);
        let mut parts = self.parts();
        for k in 0..K {
            parts[k] = set.rotate_left_f64s(parts[k], 1);
        }
        for k in 0..K {
            let after = if k + 1 < K { parts[k + 1] } else { set.splat_f64s(0.0) };
            parts[k] = set.select_f64s(end, after, parts[k]);
        }
        Self::new(set, parts)
    }

    /// The registers.
    #[inline(always)]
    pub fn parts(self) -> [S::f64s; K] {
        match self.set {
            Some(_) => self.parts,
            None => {
                let mut parts = self.parts;
                cast_slice_mut(&mut parts).fill(self.constant);
                parts
            }
        }
    }

    #[inline(always)]
    fn with(self, set: S) -> [S::f64s; K] {
        if self.set.is_some() { self.parts } else { [set.splat_f64s(self.constant); K] }
    }

    /// `many` of the lanes of both, or `one` of two constants.
    #[inline(always)]
    fn combine(
        self,
        other: Self,
        many: impl Fn(S, S::f64s, S::f64s) -> S::f64s,
        one: impl Fn(f64, f64) -> f64,
    ) -> Self {
        match self.set.or(other.set) {
            Some(set) => {
                let (a, b) = (self.with(set), other.with(set));
                let mut parts = a;
                for k in 0..K {
                    parts[k] = many(set, a[k], b[k]);
                }
                Self::new(set, parts)
            }
            None => Self { constant: one(self.constant, other.constant), ..self },
        }
    }

    /// `many` of the lanes, or `one` of a constant.
    #[inline(always)]
    fn each(mut self, many: impl Fn(S, S::f64s) -> S::f64s, one: impl Fn(f64) -> f64) -> Self {
        match self.set {
            Some(set) => {
                for k in 0..K {
                    self.parts[k] = many(set, self.parts[k]);
                }
            }
            None => self.constant = one(self.constant),
        }
        self
    }

    /// The lanes in which this number is less than `other`; false for NaN.
    #[inline(always)]
    pub fn less(self, other: Self, set: S) -> Mask<S, K> {
        let (a, b) = (self.with(set), other.with(set));
        let mut parts = [S::m64s::zeroed(); K];
        for k in 0..K {
            parts[k] = set.less_than_f64s(a[k], b[k]);
        }
        Mask { set, parts }
    }

    /// The lanes in which this number is at most `other`; false for NaN.
    #[inline(always)]
    pub fn at_most(self, other: Self, set: S) -> Mask<S, K> {
        let (a, b) = (self.with(set), other.with(set));
        let mut parts = [S::m64s::zeroed(); K];
        for k in 0..K {
            parts[k] = set.less_than_or_equal_f64s(a[k], b[k]);
        }
        Mask { set, parts }
    }

    /// The absolute value.
    #[inline(always)]
    pub fn size(self) -> Self {
        self.each(|set, part| set.abs_f64s(part), f64::abs)
    }
}

impl<S: Simd, const K: usize> Mask<S, K> {
    /// The lanes in which both hold.
    #[inline(always)]
    pub fn and(mut self, other: Self) -> Self {
        for k in 0..K {
            self.parts[k] = self.set.and_m64s(self.parts[k], other.parts[k]);
        }
        self
    }

    /// The lanes in which either holds.
    #[inline(always)]
    pub fn or(mut self, other: Self) -> Self {
        for k in 0..K {
            self.parts[k] = self.set.or_m64s(self.parts[k], other.parts[k]);
        }
        self
    }

    /// `yes` in the lanes in which this holds, `no` in the others.
    #[inline(always)]
    pub fn select(self, yes: Registers<S, K>, no: Registers<S, K>) -> Registers<S, K> {
        let (mut yes, no) = (yes.with(self.set), no.with(self.set));
        for k in 0..K {
            yes[k] = self.set.select_f64s(self.parts[k], yes[k], no[k]);
        }
        Registers::new(self.set, yes)
    }

    /// Whether it holds in any lane.
    #[inline(always)]
    pub fn any(self) -> bool {
        let mut any = false;
        for part in self.parts {
            any |= self.set.first_true_m64s(part) < S::F64_LANES;
        }
        any
    }
}

impl<S: Simd, const K: usize> PartialEq for Registers<S, K> {
    fn eq(&self, other: &Self) -> bool {
        cast_slice::<_, f64>(&self.parts()) == cast_slice::<_, f64>(&other.parts())
    }
}

impl<S: Simd, const K: usize> Pointwise for Registers<S, K> {
    #[inline(always)]
    fn map(self, f: impl Fn(f64) -> f64) -> Self {
        if self.set.is_none() {
            return Self { constant: f(self.constant), ..self };
        }
        let mut parts = self.parts;
        for part in &mut parts {
            for lane in cast_slice_mut::<_, f64>(std::slice::from_mut(part)) {
                *lane = f(*lane);
            }
        }
        Self { parts, ..self }
    }
    #[inline(always)]
    fn map2(self, other: Self, f: impl Fn(f64, f64) -> f64) -> Self {
        self.combine(
            other,
            |_, mut a, b| {
                let b = cast_slice::<_, f64>(std::slice::from_ref(&b));
                for (a, b) in
                    cast_slice_mut::<_, f64>(std::slice::from_mut(&mut a)).iter_mut().zip(b)
                {
                    *a = f(*a, *b);
                }
                a
            },
            &f,
        )
    }
}

operators! {
    impl [S: Simd, const K: usize] Registers<S, K>, inline(always):
    Add add(self, other) { self.combine(other, |set, a, b| set.add_f64s(a, b), |a, b| a + b) }
    Sub sub(self, other) { self.combine(other, |set, a, b| set.sub_f64s(a, b), |a, b| a - b) }
    Mul mul(self, other) { self.combine(other, |set, a, b| set.mul_f64s(a, b), |a, b| a * b) }
    Div div(self, other) { self.combine(other, |set, a, b| set.div_f64s(a, b), |a, b| a / b) }
    -(self) { self.each(|set, part| set.neg_f64s(part), |v| -v) }
}

impl<S: Simd, const K: usize> Arithmetic for Registers<S, K> {
    #[inline(always)]
    fn from_f64(value: f64) -> Self {
        Self { set: None, constant: value, parts: [S::f64s::zeroed(); K] }
    }
}

impl<S: Simd, const K: usize> Elementary for Registers<S, K> {
    #[inline(always)]
    fn tanh(self) -> Self {
        let Some(set) = self.set else {
            return Self { constant: Elementary::tanh(self.constant), ..self };
        };
        // A number by itself is sooner looked up.
        if S::F64_LANES == 1 {
            return self.map(Elementary::tanh);
        }
        // The kernel gives +-1 there as well; this only saves its work where every lane is outside
        // its layer.
        let inside = self.size().less(Self::splat(set, TANH_IS_ONE), set);
        let nan = self.map(|v| if v.is_nan() { 0.0 } else { 1.0 }).less(Self::splat(set, 0.5), set);
        if inside.or(nan).any() {
            kernels::tanh(self)
        } else {
            self.map(|lane| 1.0_f64.copysign(lane))
        }
    }
    #[inline(always)]
    fn exp(self) -> Self {
        if self.set.is_none() {
            Self { constant: Elementary::exp(self.constant), ..self }
        } else {
            kernels::exp(self)
        }
    }
    by_parts!(sin cos ln atan erf sign);
    #[inline(always)]
    fn pi() -> Self {
        Self::from_f64(f64::pi())
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        self.each(|set, part| set.sqrt_f64s(part), Elementary::sqrt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_lane_is_added_and_subtracted_by_itself() {
        let set = pulp::Scalar;
        let of = |values: [f64; 2]| Registers::<_, 2>::load(set, &values);
        let (a, b) = (of([1.5, -2.0]), of([0.25, 8.0]));
        let (mut sum, mut difference) = (a, a);
        sum += b;
        difference -= b;
        assert_eq!((sum, difference, -a), (of([1.75, 6.0]), of([1.25, -10.0]), of([-1.5, 2.0])));
        assert_ne!(a, of([1.5, 2.0]));
        // A constant has no lanes until it is combined with a number that has.
        assert_eq!(a + -Registers::from_f64(0.5), of([1.0, -2.5]));
    }
}
