//! Time reversed.

use nalgebra::SVector;

use super::PiecewiseSmooth;
use twofold_num::Elementary;

/// The same system with time running backwards: -f+ and -f-. Attracting and repelling regions
/// change places, and the future of a reversed orbit is the past of the original.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reversed<P>(pub P);

impl<P: PiecewiseSmooth<N>, const N: usize> PiecewiseSmooth<N> for Reversed<P> {
    const INTERPRETED: bool = P::INTERPRETED;
    fn switching<S: Elementary>(&self, x: &SVector<S, N>) -> S {
        self.0.switching(x)
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.0.plus(x).map(|c| -c)
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, N>) -> SVector<S, N> {
        self.0.minus(x).map(|c| -c)
    }
}
