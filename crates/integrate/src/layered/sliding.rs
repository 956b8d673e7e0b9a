//! Steps in time inside a layer, with w = tanh u for a state.
//!
//! Inside a layer the cost of an explicit method is one tanh a stage. But w' = (1 - w^2) u' with u'
//! a sum of the field's components: with w beside x the equation is a polynomial (Kerner 1981), and
//! a stage costs what it does outside. [`Dopri5`] on both keeps its order and nearly its stability.
//! At each step's end w is set to tanh u (a projection on the invariant w - tanh u, Hairer, Lubich
//! & Wanner 2006, sec. IV.4), so that errors of w do not accumulate.
//!
//! Along an orbit that is held in the layer u hardly moves in a step. Where it does, and near the
//! edge, where 1 - w^2 grows like an exponential, w would need shorter steps than x: there each
//! stage takes its own tanh.

use nalgebra::SVector;

use super::STRIDE;
use super::crossing::Layer;
use crate::Dopri5;
use crate::dopri5::tableau::*;
use crate::dopri5::{Dense, control};
use crate::step::{Failure, finite, is_last};
use twofold_num::Given;
use twofold_num::elementary::{rough_exp2, rough_log2, tanh};
use twofold_system::VectorField;

/// Largest apparent motion of u in a step with w for a state. With 0.5 steps are a twentieth more,
/// and the error is larger; with 0.1 nothing is gained.
const NEAR: f64 = 0.25;

/// Up to which |w| such steps begin.
const MIDDLE: f64 = 0.9;

/// The part of the tolerance that a step may err by: with all of it the error at the end is now
/// below, now a fifth above that of [`Dopri5`] alone; with this it is about half of that, for a
/// tenth more steps.
const SHARE: f64 = 0.5;

/// State of an orbit inside a layer, in addition to that of [`Dopri5`].
#[derive(Clone, Copy, Default)]
pub(super) struct Sliding {
    /// u and tanh u.
    pub u: f64,
    w: f64,
    /// The longest step that moves u by [`STRIDE`] at most, whatever tanh is.
    longest: f64,
}

impl Sliding {
    /// At the state of `inner`, which has just been restarted.
    pub fn begin<F: VectorField<N>, const N: usize>(
        inner: &Dopri5<N>,
        field: &F,
        layer: &Layer<N>,
    ) -> Self {
        let u = layer.gradient.dot(&inner.x) + layer.constant;
        Self { u, w: tanh(u), longest: longest(field, layer, &inner.x) }
    }

    /// A step of `inner`, at most `max_step` long.
    pub fn step<F: VectorField<N>, const N: usize>(
        &mut self,
        inner: &mut Dopri5<N>,
        field: &F,
        layer: &Layer<N>,
        max_step: f64,
    ) -> Result<(), Failure> {
        let (t0, x0, k1) = (inner.t, inner.x, inner.fsal);
        let start = Start { field, layer, x0, w0: self.w, k1 };
        let speed = layer.gradient.dot(&k1).abs();
        inner.h = inner.h.min(max_step).min(self.longest);
        let mut rejected_before = false;
        loop {
            let remaining = inner.t_end - t0;
            // As Dopri5 does: reach the end exactly, leave no tiny remainder.
            let last = is_last(t0, inner.h, inner.t_end, 1.000_000_1);
            let h = if last { remaining } else { inner.h };
            if h.abs() <= t0.abs() * f64::EPSILON || h < f64::MIN_POSITIVE {
                return Err(Failure::StepUnderflow { t: t0, h, state: Failure::state(&x0) });
            }
            let ([k3, k4, k5, k6], way) = if h * speed <= NEAR && self.w.abs() <= MIDDLE {
                start.stages::<false>(h)
            } else {
                start.stages::<true>(h)
            };
            let x1 = x0 + way;
            let u = layer.gradient.dot(&x1) + layer.constant;
            // Asked for before tanh is there: nothing waits for it.
            let longest = longest(field, layer, &x1);
            let w = moved(self.w, layer.gradient.dot(&way), u);
            let k7 = at(field, &x1, w);
            inner.statistics.evaluations += 6;

            let e = k1 * (h * E1)
                + k3 * (h * E3)
                + k4 * (h * E4)
                + k5 * (h * E5)
                + k6 * (h * E6)
                + k7 * (h * E7);
            let square =
                inner.mean_square(&e, |i| x0[i].abs().max(x1[i].abs())) * (1.0 / (SHARE * SHARE));
            if !square.is_finite() || !finite(&x1) || !finite(&k7) {
                inner.statistics.rejected += 1;
                inner.h = h * 0.1;
                rejected_before = true;
                if inner.h <= t0.abs() * f64::EPSILON || inner.h < 1e-300 {
                    return Err(Failure::NotFinite { t: t0, state: Failure::state(&x0) });
                }
                continue;
            }
            let log = rough_log2(square.max(control::LEAST_SQUARE));
            if square <= 1.0 {
                let factor =
                    (rough_exp2(0.5 * (control::ALPHA * log - control::BETA * inner.last_log))
                        / control::SAFETY)
                        .clamp(1.0 / control::GROW, 1.0 / control::SHRINK);
                let next = h / factor;
                inner.h = if rejected_before { next.min(h) } else { next };
                inner.last_log = log.max(control::LEAST_LOG);
                inner.dense = Dense { h, x0, x1, k: [k1, k3, k4, k5, k6, k7] };
                inner.t = if last { inner.t_end } else { t0 + h };
                (inner.x, inner.fsal) = (x1, k7);
                inner.statistics.steps += 1;
                *self = Self { u, w, longest };
                return Ok(());
            }
            inner.statistics.rejected += 1;
            rejected_before = true;
            let factor = rough_exp2(0.5 * control::ALPHA * log) / control::SAFETY;
            inner.h = h / factor.min(1.0 / control::SHRINK);
        }
    }
}

/// The field where tanh is `w`.
#[inline(always)]
fn at<F: VectorField<N>, const N: usize>(
    field: &F,
    x: &SVector<f64, N>,
    w: f64,
) -> SVector<f64, N> {
    let f = field.eval(&x.map(|x| Given::new(x, w)));
    SVector::from_fn(|i, _| f[i].value())
}

/// The longest step from `x` that moves u by [`STRIDE`] at most, whatever tanh is.
#[inline(always)]
fn longest<F: VectorField<N>, const N: usize>(
    field: &F,
    layer: &Layer<N>,
    x: &SVector<f64, N>,
) -> f64 {
    let [minus, plus] = [-1.0, 1.0].map(|w| layer.gradient.dot(&at(field, x, w)).abs());
    STRIDE / minus.max(plus)
}

/// Start of a step.
struct Start<'a, F, const N: usize> {
    field: &'a F,
    layer: &'a Layer<N>,
    x0: SVector<f64, N>,
    w0: f64,
    /// The field there.
    k1: SVector<f64, N>,
}

impl<F: VectorField<N>, const N: usize> Start<'_, F, N> {
    /// The derivatives of x and w, so far away; of w nothing is taken if tanh is to be `EXACT`.
    #[inline(always)]
    fn derivative<const EXACT: bool>(
        &self,
        dx: SVector<f64, N>,
        dw: f64,
    ) -> (SVector<f64, N>, f64) {
        let Self { field, layer, x0, w0, .. } = self;
        let x = x0 + dx;
        let w = if EXACT {
            moved(*w0, layer.gradient.dot(&dx), layer.gradient.dot(&x) + layer.constant)
        } else {
            w0 + dw
        };
        let k = at(*field, &x, w);
        (k, (1.0 - w * w) * layer.gradient.dot(&k))
    }

    /// The derivatives of x in stages 3 to 6 of a step of length `h`, and how far it goes.
    #[inline(always)]
    fn stages<const EXACT: bool>(&self, h: f64) -> ([SVector<f64, N>; 4], SVector<f64, N>) {
        let k1 = self.k1;
        let q1 = (1.0 - self.w0 * self.w0) * self.layer.gradient.dot(&k1);
        let (k2, q2) = self.derivative::<EXACT>(k1 * (h * A21), q1 * (h * A21));
        let (k3, q3) = self
            .derivative::<EXACT>(k1 * (h * A31) + k2 * (h * A32), q1 * (h * A31) + q2 * (h * A32));
        let (k4, q4) = self.derivative::<EXACT>(
            k1 * (h * A41) + k2 * (h * A42) + k3 * (h * A43),
            q1 * (h * A41) + q2 * (h * A42) + q3 * (h * A43),
        );
        let (k5, q5) = self.derivative::<EXACT>(
            k1 * (h * A51) + k2 * (h * A52) + k3 * (h * A53) + k4 * (h * A54),
            q1 * (h * A51) + q2 * (h * A52) + q3 * (h * A53) + q4 * (h * A54),
        );
        let (k6, _) = self.derivative::<EXACT>(
            k1 * (h * A61) + k2 * (h * A62) + k3 * (h * A63) + k4 * (h * A64) + k5 * (h * A65),
            q1 * (h * A61) + q2 * (h * A62) + q3 * (h * A63) + q4 * (h * A64) + q5 * (h * A65),
        );
        let way =
            k1 * (h * A71) + k3 * (h * A73) + k4 * (h * A74) + k5 * (h * A75) + k6 * (h * A76);
        ([k3, k4, k5, k6], way)
    }
}

/// tanh u, `d` away from where tanh is `w`: near by from tanh d, whose series is soon at an end,
/// and the addition theorem, else anew. Roundings of 1 add up from step to step, but in u they are
/// at most some 1e-12 each, and x is eps times that.
#[inline(always)]
fn moved(w: f64, d: f64, u: f64) -> f64 {
    let d2 = d * d;
    let d4 = d2 * d2;
    let low = (-1.0 / 3.0 + d2 * (2.0 / 15.0)) + d4 * (-17.0 / 315.0 + d2 * (62.0 / 2835.0));
    let step = if w.abs() <= 0.9999 && d.abs() <= 1.0 / 32.0 {
        d + d * d2 * low
    } else if w.abs() <= 0.9999 && d.abs() <= 0.25 {
        let high = (-1382.0 / 155_925.0 + d2 * (21_844.0 / 6_081_075.0))
            + d4 * (-929_569.0 / 638_512_875.0 + d2 * (6_404_582.0 / 10_854_718_875.0));
        d + d * d2 * (low + d4 * d4 * high)
    } else {
        return tanh(u);
    };
    (w + step) / (1.0 + w * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tanh_is_moved_to_some_roundings() {
        for i in -300..=300 {
            let u = f64::from(i) * 0.02;
            for d in [0.0, 1e-9, 0.01, 1.0 / 32.0, 0.0313, 0.1, 0.2, 0.25, 0.26, 3.0] {
                for d in [d, -d] {
                    let (found, want) = (moved(tanh(u), d, u + d), tanh(u + d));
                    assert!((found - want).abs() <= 1e-15, "{u} {d}: {found} {want}");
                }
            }
        }
        assert!(moved(0.5, f64::NAN, f64::NAN).is_nan());
    }
}
