//! Parts of steps as polynomials, and the history composed of them.

use std::collections::VecDeque;

use nalgebra::SVector;

use crate::step::{Failure, Interpolant, Statistics, Step, Stepper};
use crate::taylor::Cuttable;
use twofold_system::VectorField;

/// A polynomial of degree 4 by its Bernstein coefficients, less the state at the start.
#[derive(Clone, Debug)]
pub(super) struct Polynomial<const N: usize> {
    x0: SVector<f64, N>,
    coefficients: [SVector<f64, N>; 5],
}

impl<const N: usize> Polynomial<N> {
    /// The polynomial of a step; `None` if its interpolant is none of this degree.
    pub(super) fn of(step: &Step<'_, N>) -> Option<Self> {
        Some(Self { x0: step.x0, coefficients: step.interpolant.bernstein()? })
    }

    /// The part up to the fraction `theta`: de Casteljau's subdivision.
    fn until(&self, theta: f64) -> Self {
        let mut work = self.coefficients;
        let mut left = work;
        for (k, point) in left.iter_mut().enumerate() {
            *point = work[0];
            for i in 0..4 - k {
                work[i] += (work[i + 1] - work[i]) * theta;
            }
        }
        Self { x0: self.x0, coefficients: left }
    }

    /// The same polynomial from its end to its start.
    fn backwards(&self) -> Self {
        let mut coefficients = self.coefficients;
        coefficients.reverse();
        let end = coefficients[0];
        Self { x0: self.x0 + end, coefficients: coefficients.map(|c| c - end) }
    }
}

/// C(4, k).
const BINOMIALS: [f64; 5] = [1.0, 4.0, 6.0, 4.0, 1.0];

impl<const N: usize> Interpolant<N> for Polynomial<N> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        SVector::from_fn(|i, _| self.coordinate(theta, i))
    }
    /// Horner's scheme in theta/(1 - theta), or in its inverse.
    fn coordinate(&self, theta: f64, i: usize) -> f64 {
        let c = |k: usize| BINOMIALS[k] * self.coefficients[k][i];
        let rest = 1.0 - theta;
        let sum = if theta <= 0.5 {
            let u = theta / rest;
            let power = (rest * rest) * (rest * rest);
            ((((c(4) * u + c(3)) * u + c(2)) * u + c(1)) * u + c(0)) * power
        } else {
            let u = rest / theta;
            let power = (theta * theta) * (theta * theta);
            ((((c(0) * u + c(1)) * u + c(2)) * u + c(3)) * u + c(4)) * power
        };
        self.x0[i] + sum
    }
    fn degree(&self) -> usize {
        4
    }
    fn bernstein(&self) -> Option<[SVector<f64, N>; 5]> {
        Some(self.coefficients)
    }
    /// The polynomial lies between its least and its largest coefficient.
    fn reach(&self, i: usize) -> f64 {
        let c = self.coefficients.each_ref().map(|c| c[i]);
        let (low, high) = (c[0].min(c[4]), c[0].max(c[4]));
        c.iter().fold(0.0_f64, |reach, c| reach.max(c - high).max(low - c))
    }
    /// So does its distance from the chord, whose coefficients are equidistant.
    fn bend(&self, i: usize) -> f64 {
        let c = self.coefficients.each_ref().map(|c| c[i]);
        (1..4).fold(0.0_f64, |bend, k| {
            bend.max((c[k] - (c[0] + 0.25 * k as f64 * (c[4] - c[0]))).abs())
        })
    }
    /// Differences of coefficients are those of the derivative.
    fn is_monotone(&self, i: usize) -> bool {
        let c = self.coefficients.each_ref().map(|c| c[i]);
        c.windows(2).all(|w| w[0] <= w[1]) || c.windows(2).all(|w| w[0] >= w[1])
    }
}

/// A Runge-Kutta method whose steps can be ended earlier, on their dense output.
#[derive(Clone, Debug)]
pub(super) struct Cut<M, const N: usize> {
    method: M,
    /// The last step.
    t0: f64,
    t1: f64,
    x1: SVector<f64, N>,
    polynomial: Polynomial<N>,
}

impl<M, const N: usize> Cut<M, N> {
    pub(super) fn new(method: M) -> Self {
        let zero = SVector::zeros();
        let polynomial = Polynomial { x0: zero, coefficients: [zero; 5] };
        Self { method, t0: 0.0, t1: 0.0, x1: zero, polynomial }
    }
}

impl<M: Stepper<N>, const N: usize> Cuttable<N> for Cut<M, N> {
    type Number = f64;
    const CUTS_EXACTLY: bool = false;

    fn exactly(&self, t: f64, x: SVector<f64, N>) -> (f64, SVector<f64, N>) {
        (t, x)
    }

    fn begin<F: VectorField<N>>(
        &mut self,
        field: &F,
        (t, x): (f64, SVector<f64, N>),
        end: f64,
        longest: f64,
        again: bool,
    ) -> Result<(), Failure> {
        (self.t0, self.t1, self.x1) = (t, t, x);
        if again {
            self.method.restart_again(field, t, x, end, longest)
        } else {
            self.method.restart(field, t, x, end, longest)
        }
    }

    fn advance<F: VectorField<N>>(&mut self, field: &F) -> Result<(), Failure> {
        let step = self.method.step(field)?;
        (self.t0, self.t1, self.x1) = (step.t0, step.t1, step.x1);
        self.polynomial = Polynomial::of(&step)
            .expect("this method's interpolant is a polynomial of degree 4 or less");
        Ok(())
    }

    fn last(&self) -> Step<'_, N> {
        Step {
            t0: self.t0,
            t1: self.t1,
            x0: self.polynomial.x0,
            x1: self.x1,
            interpolant: &self.polynomial,
        }
    }

    fn start(&self) -> f64 {
        self.t0
    }

    fn reached(&self) -> (f64, SVector<f64, N>) {
        (self.t1, self.x1)
    }

    fn at(&self, theta: f64) -> SVector<f64, N> {
        self.last().at(theta)
    }

    fn cut(&mut self, end: f64) {
        let theta = (end - self.t0) / (self.t1 - self.t0);
        self.x1 = self.at(theta);
        self.polynomial = self.polynomial.until(theta);
        self.t1 = end;
    }

    fn statistics(&self) -> &Statistics {
        self.method.statistics()
    }
}

/// A step that is over.
#[derive(Clone, Debug)]
struct Piece<const N: usize> {
    t0: f64,
    t1: f64,
    polynomial: Polynomial<N>,
}

/// The orbit in the last delay.
#[derive(Clone, Debug)]
pub(super) struct Past<const N: usize> {
    /// State before all pieces.
    before: SVector<f64, N>,
    pieces: VecDeque<Piece<N>>,
}

/// From which side a moment is looked at where the orbit has jumped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Look {
    Before,
    After,
}

impl<const N: usize> Past<N> {
    pub(super) fn constant(x0: SVector<f64, N>) -> Self {
        Self { before: x0, pieces: VecDeque::new() }
    }

    /// Of steps made backwards from the time 0 on.
    pub(super) fn put_before(&mut self, step: &Step<'_, N>) {
        let Some(polynomial) = Polynomial::of(step) else { return };
        self.before = step.x1;
        self.pieces.push_front(Piece {
            t0: -step.t1,
            t1: -step.t0,
            polynomial: polynomial.backwards(),
        });
    }

    /// Adds a step, and forgets what was over at the time `until`.
    pub(super) fn put(&mut self, step: &Step<'_, N>, until: f64) {
        while let Some(first) = self.pieces.front()
            && first.t1 < until
        {
            self.before = first.polynomial.at(1.0);
            self.pieces.pop_front();
        }
        if let Some(polynomial) = Polynomial::of(step) {
            self.pieces.push_back(Piece { t0: step.t0, t1: step.t1, polynomial });
        }
    }

    /// The state at the time `t`; `slack` is how far a time may be from the one that it stands for.
    pub(super) fn at(&self, t: f64, look: Look, slack: f64) -> SVector<f64, N> {
        let index = match look {
            Look::Before => self.pieces.partition_point(|p| p.t1 < t - slack),
            Look::After => self.pieces.partition_point(|p| p.t0 <= t + slack).wrapping_sub(1),
        };
        let Some(piece) =
            self.pieces.get(index).or(if index == usize::MAX { None } else { self.pieces.back() })
        else {
            return self.before;
        };
        if t < piece.t0 - slack && index == 0 {
            return self.before;
        }
        let theta = ((t - piece.t0) / (piece.t1 - piece.t0)).clamp(0.0, 1.0);
        piece.polynomial.at(theta)
    }

    /// Divides the disturbance, the second half of the components, by a number.
    pub(super) fn shorten(&mut self, by: f64) {
        self.before = shortened(&self.before, by);
        for Piece { polynomial, .. } in &mut self.pieces {
            polynomial.x0 = shortened(&polynomial.x0, by);
            polynomial.coefficients = polynomial.coefficients.map(|c| shortened(&c, by));
        }
    }

    #[cfg(test)]
    pub(super) fn len(&self) -> usize {
        self.pieces.len()
    }
}

/// The state with a shorter disturbance.
pub(super) fn shortened<const M: usize>(z: &SVector<f64, M>, by: f64) -> SVector<f64, M> {
    SVector::from_fn(|i, _| if i < M / 2 { z[i] } else { z[i] / by })
}
