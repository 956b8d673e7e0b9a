//! The Nordsieck array: x and its scaled derivatives h^j x^(j)/j!.

use nalgebra::allocator::Allocator;
use nalgebra::{Const, DefaultAllocator, Dim, OVector, SVector, U1};

use super::coefficients::{COLUMNS, Formula};
use crate::step::Interpolant;

/// Scaled derivatives y_j = h^j x^(j)/j! at one time, j = 0..=q used.
#[derive(Clone, Debug)]
pub(super) struct Nordsieck<D: Dim>
where
    DefaultAllocator: Allocator<D>,
{
    y: [OVector<f64, D>; COLUMNS],
    /// The order of the step that led here: the degree of the polynomial that is its dense output.
    degree: usize,
}

impl<D: Dim> Nordsieck<D>
where
    DefaultAllocator: Allocator<D>,
{
    pub fn new(x: OVector<f64, D>, h_derivative: OVector<f64, D>) -> Self {
        let states = x.shape_generic().0;
        let mut y = [(); COLUMNS].map(|()| OVector::zeros_generic(states, U1));
        y[0] = x;
        y[1] = h_derivative;
        Self { y, degree: 1 }
    }

    pub fn column(&self, j: usize) -> &OVector<f64, D> {
        &self.y[j]
    }

    pub fn set_column(&mut self, j: usize, value: OVector<f64, D>) {
        self.y[j] = value;
    }

    /// The columns of the dense output.
    pub fn polynomial(&self) -> &[OVector<f64, D>] {
        &self.y[..=self.degree]
    }

    /// The state.
    pub fn x(&self) -> &OVector<f64, D> {
        &self.y[0]
    }

    /// Taylor's formula one step ahead: multiplication by Pascal's triangle, by additions alone.
    pub fn predict(&mut self, order: usize) {
        match order {
            1 => self.predict_of::<1>(),
            2 => self.predict_of::<2>(),
            3 => self.predict_of::<3>(),
            4 => self.predict_of::<4>(),
            5 => self.predict_of::<5>(),
            6 => self.predict_of::<6>(),
            7 => self.predict_of::<7>(),
            8 => self.predict_of::<8>(),
            9 => self.predict_of::<9>(),
            10 => self.predict_of::<10>(),
            11 => self.predict_of::<11>(),
            _ => self.predict_of::<12>(),
        }
    }

    /// For one order, so that columns whose size is known when this is compiled stay in registers
    /// from the first addition to the last: through memory each would wait for the one before to be
    /// written and read again.
    #[inline]
    fn predict_of<const ORDER: usize>(&mut self) {
        if D::try_to_usize().is_none() {
            for start in (0..ORDER).rev() {
                for j in start..ORDER {
                    let (low, high) = self.y.split_at_mut(j + 1);
                    low[j] += &high[0];
                }
            }
            return;
        }
        let mut y = self.y.clone();
        for start in (0..ORDER).rev() {
            for j in start..ORDER {
                let next = y[j + 1].clone();
                y[j] += next;
            }
        }
        self.y[..=ORDER].clone_from_slice(&y[..=ORDER]);
    }

    /// Undoes [`Nordsieck::predict`] up to rounding.
    pub fn retract(&mut self, order: usize) {
        for start in (0..order).rev() {
            for j in start..order {
                let (low, high) = self.y.split_at_mut(j + 1);
                low[j] -= &high[0];
            }
        }
    }

    /// y <- y + l e.
    pub fn correct(&mut self, order: usize, formula: &Formula, e: &OVector<f64, D>) {
        for (y, l) in self.y[..=order].iter_mut().zip(formula.l) {
            *y += e * l;
        }
        self.degree = order;
    }

    /// Goes over to the step `ratio` times as long.
    pub fn rescale(&mut self, order: usize, ratio: f64) {
        let mut power = 1.0;
        for y in &mut self.y[1..=order] {
            power *= ratio;
            *y *= power;
        }
    }
}

/// The Nordsieck polynomial, over the step that was corrected last and has not been rescaled since.
/// What a correction adds vanishes at that step's start, which it misses by rounding alone.
impl<const N: usize> Interpolant<N> for Nordsieck<Const<N>> {
    fn at(&self, theta: f64) -> SVector<f64, N> {
        let s = theta - 1.0;
        let mut x = self.y[self.degree];
        for y in self.y[..self.degree].iter().rev() {
            x = x * s + y;
        }
        x
    }
    fn coordinate(&self, theta: f64, i: usize) -> f64 {
        let s = theta - 1.0;
        self.y[..self.degree].iter().rev().fold(self.y[self.degree][i], |x, y| x * s + y[i])
    }
    fn degree(&self) -> usize {
        self.degree
    }
    /// The polynomial's distance from its end, term by term.
    fn reach(&self, coordinate: usize) -> f64 {
        self.y[1..=self.degree].iter().map(|y| y[coordinate].abs()).sum()
    }
    /// Term by term, s from -1 to 0: s + s^2 is at most 1/4 in size, s^k and its chord differ by
    /// less than 1.
    fn bend(&self, coordinate: usize) -> f64 {
        let y = &self.y[..=self.degree];
        let second = y.get(2).map_or(0.0, |y| 0.25 * y[coordinate].abs());
        second + y.iter().skip(3).map(|y| y[coordinate].abs()).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// x = t^3 at t = 1 with h = 0.5: exact at 1.5 after one prediction, and back.
    #[test]
    fn prediction_is_taylors_formula() {
        let mut y = Nordsieck::new(SVector::from([1.0]), SVector::from([1.5]));
        y.set_column(2, SVector::from([0.75]));
        y.set_column(3, SVector::from([0.125]));
        y.degree = 3;
        assert_eq!(y.at(2.0)[0], 3.375);
        y.predict(3);
        assert_eq!([0, 1, 2, 3].map(|j| y.column(j)[0]), [3.375, 3.375, 1.125, 0.125]);
        assert_eq!(y.at(0.0)[0], 1.0);
        y.retract(3);
        assert_eq!([0, 1, 2, 3].map(|j| y.column(j)[0]), [1.0, 1.5, 0.75, 0.125]);
        y.rescale(3, 2.0);
        assert_eq!(y.at(2.0)[0], 8.0);
    }
}
