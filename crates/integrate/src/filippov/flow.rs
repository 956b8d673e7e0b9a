//! The vector fields that are integrated between events, and projection onto the surface.

use nalgebra::SVector;

use super::exit::Side;
use crate::roots::{OfState, brent};
use crate::step::Interpolant;
use twofold_num::Elementary;
use twofold_system::filippov::{dot, gradient};
use twofold_system::{PiecewiseSmooth, VectorField};

/// A system whose fields may be defined on their own sides only. With a `depth`, a field is asked
/// no nearer to the surface than |h| = `depth` on its own side: beyond, it is continued by its
/// values there, along grad h. Motion on the field's own side does not depend on that.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sided<'a, P> {
    pub system: &'a P,
    pub depth: Option<f64>,
}

impl<P> Sided<'_, P> {
    #[inline]
    pub fn inside<S: Elementary, const N: usize>(
        &self,
        x: &SVector<S, N>,
        side: Side,
    ) -> SVector<S, N>
    where
        P: PiecewiseSmooth<N>,
    {
        match self.depth {
            None => *x,
            Some(depth) => self.moved_inside(x, side, depth),
        }
    }

    // Out of line: mostly there is no depth, and every evaluation of a field asks.
    #[inline(never)]
    fn moved_inside<S: Elementary, const N: usize>(
        &self,
        x: &SVector<S, N>,
        side: Side,
        depth: f64,
    ) -> SVector<S, N>
    where
        P: PiecewiseSmooth<N>,
    {
        let mut y = *x;
        // Newton's method, with steps a little too long: from outside of a convex side it would
        // stay outside.
        for _ in 0..4 {
            let height = self.system.switching(&y).scale(side.sign()) - S::from_f64(depth);
            let short = (height - height.abs()).scale(0.5 * (1.0 + 1.0 / 1024.0) * side.sign());
            let slope = gradient(self.system, &y);
            let square = (0..N).fold(S::zero(), |sum, i| sum + slope[i] * slope[i]);
            y = SVector::from_fn(|i, _| y[i] - slope[i] * (short / square));
        }
        y
    }
}

impl<P: PiecewiseSmooth<N>, const N: usize> PiecewiseSmooth<N> for Sided<'_, P> {
    const INTERPRETED: bool = P::INTERPRETED;
    fn switching<S: Elementary>(&self, x: &SVector<S, N>) -> S {
        self.system.switching(x)
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.system.plus(&self.inside(x, Side::Plus))
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.system.minus(&self.inside(x, Side::Minus))
    }
}

/// f+ or f-, continued across the surface.
#[derive(Clone, Copy, Debug)]
pub(super) struct FreeFlow<'a, P> {
    pub system: Sided<'a, P>,
    pub side: Side,
}

impl<P: PiecewiseSmooth<N>, const N: usize> VectorField<N> for FreeFlow<'_, P> {
    const INTERPRETED: bool = P::INTERPRETED;
    fn eval<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        match self.side {
            Side::Plus => self.system.plus(x),
            Side::Minus => self.system.minus(x),
        }
    }
}

/// h times a sign.
pub(super) struct Height<'a, P> {
    pub system: &'a P,
    pub sign: f64,
}

impl<P: PiecewiseSmooth<N>, const N: usize> OfState<N> for Height<'_, P> {
    fn at<S: Elementary>(&self, x: &SVector<S, N>) -> S {
        self.system.switching(x).scale(self.sign)
    }
}

/// The Lie derivative of h along the field of `side`: one of the two of
/// [`lie_derivatives`](twofold_system::filippov::lie_derivatives).
pub(super) fn lie_derivative<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    system: &P,
    x: &SVector<S, N>,
    side: Side,
) -> S {
    let slope = gradient(system, x);
    let field = match side {
        Side::Plus => system.plus(x),
        Side::Minus => system.minus(x),
    };
    dot(&slope, &field)
}

/// The desingularised sliding field F = L-h f+ - L+h f-: the sliding field multiplied by L-h - L+h.
///
/// It is smooth everywhere, vanishes at a two-fold, and leaves h unchanged exactly: L_F h = L-h L+h
/// - L+h L-h = 0.
pub(super) fn desingularised<P: PiecewiseSmooth<N>, S: Elementary, const N: usize>(
    system: &P,
    x: &SVector<S, N>,
) -> (SVector<S, N>, S) {
    let slope = gradient(system, x);
    let with_rate = |field: SVector<S, N>| (dot(&slope, &field), field);
    let (p, plus) = with_rate(system.plus(x));
    let (q, minus) = with_rate(system.minus(x));
    (SVector::from_fn(|i, _| q * plus[i] - p * minus[i]), q - p)
}

/// The desingularised sliding flow with physical time as an extra state: (x, t)' = +-(F(x), L-h -
/// L+h) times a factor. `M` is `N + 1`. The sign is + in the attracting region and - in the
/// repelling one, so that time always runs forward.
#[derive(Clone, Copy, Debug)]
pub struct SlidingFlow<'a, P, const N: usize> {
    pub(super) system: Sided<'a, P>,
    pub(super) direction: f64,
}

/// Implemented for each dimension, because `N + 1` cannot yet be written in stable Rust's const
/// generics.
macro_rules! sliding_in_dimension {
    ($n:literal, $m:literal) => {
        impl<P: PiecewiseSmooth<$n>> VectorField<$m> for SlidingFlow<'_, P, $n> {
            const INTERPRETED: bool = P::INTERPRETED;
            fn eval<S: Elementary>(&self, state: &SVector<S, $m>) -> SVector<S, $m> {
                let x = SVector::<S, $n>::from_fn(|i, _| state[i]);
                let (field, rate) = desingularised(&self.system, &x);
                SVector::from_fn(|i, _| if i < $n { field[i] } else { rate }.scale(self.direction))
            }
        }
    };
}

sliding_in_dimension!(1, 2);
sliding_in_dimension!(2, 3);
sliding_in_dimension!(3, 4);
sliding_in_dimension!(4, 5);
sliding_in_dimension!(5, 6);
sliding_in_dimension!(6, 7);
sliding_in_dimension!(7, 8);
sliding_in_dimension!(8, 9);

/// The point of h = 0 that Newton's method along grad h finds from `x`. For h linear in one
/// coordinate it is exact.
pub(super) fn project<P: PiecewiseSmooth<N>, const N: usize>(
    system: &P,
    x: &SVector<f64, N>,
) -> SVector<f64, N> {
    let mut y = *x;
    let mut h = system.switching(&y);
    for _ in 0..8 {
        if h == 0.0 {
            break;
        }
        let g = gradient(system, &y);
        let square = g.norm_squared();
        // A function of very small or large numbers has a gradient whose square is none.
        let by = if square.is_normal() {
            g * (h / square)
        } else {
            let (unit, largest) = (g / g.amax(), g.amax());
            unit * (h / largest / unit.norm_squared())
        };
        let next = y - by;
        let there = system.switching(&next);
        if there.is_nan() || there.abs() >= h.abs() {
            break;
        }
        (y, h) = (next, there);
    }
    y
}

/// A vector's length, also where its square is no number.
pub(super) fn length<const N: usize>(v: &SVector<f64, N>) -> f64 {
    let largest = v.amax();
    if v.norm_squared().is_normal() || largest == 0.0 {
        v.norm()
    } else {
        largest * (v / largest).norm()
    }
}

/// The first part, up to the fraction `end`, of a step.
pub(super) struct Truncated<'a, const N: usize> {
    pub inner: &'a dyn Interpolant<N>,
    pub end: f64,
}

impl<const N: usize> Interpolant<N> for Truncated<'_, N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        self.inner.at(theta * self.end)
    }
    fn degree(&self) -> usize {
        self.inner.degree()
    }
    /// De Casteljau's subdivision.
    fn bernstein(&self) -> Option<[SVector<f64, N>; 5]> {
        let mut work = self.inner.bernstein()?;
        let mut left = work;
        for (k, point) in left.iter_mut().enumerate() {
            *point = work[0];
            for i in 0..4 - k {
                work[i] += (work[i + 1] - work[i]) * self.end;
            }
        }
        Some(left)
    }
}

/// A step of the sliding flow seen in physical time: finds the rescaled time for a physical one,
/// and projects.
pub(super) struct InPhysicalTime<'a, P, const N: usize, const M: usize> {
    pub system: &'a P,
    pub inner: &'a dyn Interpolant<M>,
    pub end: f64,
    /// Physical time at the start and at `end`, on the flow's own clock.
    pub clock: (f64, f64),
}

impl<P: PiecewiseSmooth<N>, const N: usize, const M: usize> Interpolant<N>
    for InPhysicalTime<'_, P, N, M>
{
    fn at(&self, theta: f64) -> SVector<f64, N> {
        let (from, to) = self.clock;
        let wanted = from + theta * (to - from);
        let clock = |s: f64| self.inner.at(s)[N] - wanted;
        let (a, b) = (from - wanted, to - wanted);
        let s = if a >= 0.0 {
            0.0
        } else if b <= 0.0 {
            self.end
        } else {
            brent(clock, 0.0, self.end, a, b)
        };
        let state = self.inner.at(s);
        project(self.system, &SVector::from_fn(|i, _| state[i]))
    }
    fn degree(&self) -> usize {
        // Not a polynomial in time; a step of the method is smooth enough for twice the degree to
        // resolve it.
        2 * self.inner.degree()
    }
}

/// A straight stretch at constant speed, projected: the last leg into a two-fold.
pub(super) struct Straight<'a, P, const N: usize> {
    pub system: &'a P,
    pub from: SVector<f64, N>,
    pub to: SVector<f64, N>,
}

impl<P: PiecewiseSmooth<N>, const N: usize> Interpolant<N> for Straight<'_, P, N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        project(self.system, &(self.from + (self.to - self.from) * theta))
    }
    fn degree(&self) -> usize {
        1
    }
}
