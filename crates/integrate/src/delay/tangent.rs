//! Small disturbances of an orbit whose switch depends on the past.
//!
//! Between switches v' = Df v. A neighbour of the orbit makes a passage of the surface later by dt
//! = -(dh v)/(dh f), and the switch that this passage causes as much later; at the switch v grows
//! by (f before - f after) dt (Aizerman & Gantmakher 1958). So under the sharp rule and a relay the
//! disturbed state is v and the dt of each switch in the queue: a number for each, no
//! approximation.
//!
//! Under the smooth rule v' = (phi Df+ + (1 - phi) Df-) v + (f+ - f-) phi' dh v(t - delay): orbit
//! and vector are followed together by the method of steps. The disturbed state is v during one
//! delay, on the dense output of the steps; its length is read at the present and at [`NODES`]
//! Chebyshev points of the delay (Farmer 1982, Physica D 4, 366-393; Breda & Van Vleck 2014,
//! Numerische Mathematik 126, 225-257).

use std::f64::consts::PI;

use nalgebra::SVector;

use super::past::{Look, Past};
use crate::step::Stepper;
use twofold_num::elementary::cos;
use twofold_num::{Dual, Elementary};
use twofold_system::filippov::gradient;
use twofold_system::{PiecewiseSmooth, Transition};

/// A system of n states with one tangent vector, in 2 n dimensions: f+ and f- come with Df+ v and
/// Df- v.
#[derive(Clone, Copy, Debug)]
pub struct Varied<'a, P>(pub &'a P);

/// The effect of a disturbance on one passage of the surface.
#[derive(Clone, Copy, Debug, Default)]
pub struct Shift {
    /// By how much later it comes.
    later: f64,
    /// The speed of the orbit there, which makes a length of it.
    speed: f64,
}

impl Shift {
    pub(super) fn length(self) -> f64 {
        self.later * self.speed
    }

    pub(super) fn shorten(&mut self, by: f64) {
        self.later /= by;
    }
}

/// A quantity carried along an orbit beside its state: the second half of the components.
pub trait Carry<const N: usize>: Sync {
    /// Of a passage of the surface at `x` under f+ or f-.
    fn shift(&self, x: &SVector<f64, N>, plus: bool) -> Shift;
    /// The state after a switch at `x` to f+ or f-.
    fn switched(&self, x: &SVector<f64, N>, to_plus: bool, shift: Shift) -> SVector<f64, N>;
    /// Change of the derivative at `x` by the disturbed past under the smooth rule.
    fn feedback(
        &self,
        x: &SVector<f64, N>,
        past: &SVector<f64, N>,
        transition: Transition,
        eps: f64,
    ) -> SVector<f64, N>;
}

macro_rules! varied {
    ($($n:literal)*) => { $(
        impl<P: PiecewiseSmooth<$n>> PiecewiseSmooth<{ 2 * $n }> for Varied<'_, P> {
        const INTERPRETED: bool = P::INTERPRETED;
            fn switching<S: Elementary>(&self, z: &SVector<S, { 2 * $n }>) -> S {
                self.0.switching(&SVector::<S, $n>::from_fn(|i, _| z[i]))
            }
            fn plus<S: Elementary>(&self, z: &SVector<S, { 2 * $n }>) -> SVector<S, { 2 * $n }> {
                joined(&self.0.plus(&dual(z)))
            }
            fn minus<S: Elementary>(&self, z: &SVector<S, { 2 * $n }>) -> SVector<S, { 2 * $n }> {
                joined(&self.0.minus(&dual(z)))
            }
            fn names(&self) -> Vec<String> {
                let names = self.0.names();
                let varied: Vec<_> = names.iter().map(|name| format!("d_{name}")).collect();
                [names, varied].concat()
            }
        }

        impl<P: PiecewiseSmooth<$n>> Carry<{ 2 * $n }> for Varied<'_, P> {
            fn shift(&self, z: &SVector<f64, { 2 * $n }>, plus: bool) -> Shift {
                let [x, v] = halves::<$n, { 2 * $n }>(z);
                let gradient = gradient(self.0, &x);
                let f = if plus { self.0.plus(&x) } else { self.0.minus(&x) };
                Shift { later: -gradient.dot(&v) / gradient.dot(&f), speed: f.norm() }
            }
            fn switched(&self, z: &SVector<f64, { 2 * $n }>, to_plus: bool,
                shift: Shift) -> SVector<f64, { 2 * $n }> {
                let [x, v] = halves::<$n, { 2 * $n }>(z);
                let [plus, minus] = [self.0.plus(&x), self.0.minus(&x)];
                let v = v + (if to_plus { minus - plus } else { plus - minus }) * shift.later;
                SVector::from_fn(|i, _| if i < $n { x[i] } else { v[i - $n] })
            }
            fn feedback(
                &self,
                z: &SVector<f64, { 2 * $n }>,
                past: &SVector<f64, { 2 * $n }>,
                transition: Transition,
                eps: f64,
            ) -> SVector<f64, { 2 * $n }> {
                let h = self.0.switching(&dual::<f64, $n, { 2 * $n }>(past));
                let [weight] = transition.eval(h, eps).partials;
                let [x, _] = halves::<$n, { 2 * $n }>(z);
                let jump = (self.0.plus(&x) - self.0.minus(&x)) * weight;
                SVector::from_fn(|i, _| if i < $n { 0.0 } else { jump[i - $n] })
            }
        }
    )* };
}

varied!(1 2 3 4 5 6 7 8);

fn dual<S: Elementary, const N: usize, const M: usize>(
    z: &SVector<S, M>,
) -> SVector<Dual<S, 1>, N> {
    SVector::from_fn(|i, _| Dual { value: z[i], partials: [z[N + i]] })
}

fn joined<S: Elementary, const N: usize, const M: usize>(
    f: &SVector<Dual<S, 1>, N>,
) -> SVector<S, M> {
    SVector::from_fn(|i, _| if i < N { f[i].value } else { f[i - N].partials[0] })
}

fn halves<const N: usize, const M: usize>(z: &SVector<f64, M>) -> [SVector<f64, N>; 2] {
    [SVector::from_fn(|i, _| z[i]), SVector::from_fn(|i, _| z[N + i])]
}

/// The square of a disturbance's length.
pub(super) fn square<const M: usize>(z: &SVector<f64, M>) -> f64 {
    z.iter().skip(M / 2).map(|v| v * v).sum()
}

/// Points of the delay at which a disturbance of the past is read.
const NODES: usize = 16;

/// The square of the length of a disturbed past: the mean of the squares at Chebyshev's points,
/// with equal weights.
pub(super) fn square_of_past<const M: usize>(past: &Past<M>, t: f64, delay: f64) -> f64 {
    let node = |k: usize| 0.5 * (1.0 - cos(PI * (k as f64 + 0.5) / NODES as f64));
    let at = |k: usize| square(&past.at(t - delay * node(k), Look::After, 0.0));
    (0..NODES).map(at).sum::<f64>() / NODES as f64
}

/// A method with the equation inside that carries a disturbance along.
pub trait TangentStepper<const M: usize>: Stepper<M> {
    /// Time and state reached.
    fn reached(&self) -> (f64, SVector<f64, M>);
    /// The length of the disturbance: of the vector, with those of coming switches or of its past.
    fn length(&self) -> f64;
    /// Divides the disturbance by a number. The method must then be restarted.
    fn shorten(&mut self, by: f64);
}

/// A computation over any [`TangentStepper`].
pub trait WithTangent<const M: usize> {
    /// The result.
    type Answer;
    /// Does it.
    fn with<S: TangentStepper<M>>(self, stepper: S) -> Self::Answer;
}
