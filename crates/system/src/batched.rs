//! Equations that differ only in numbers, as in a sweep over a parameter, and can be evaluated side
//! by side.

use super::{BoundField, VectorField};
use twofold_num::{Aligned, Simd};

/// The equations of several runs that consist of the same operations.
///
/// A [`VectorField`] is one: all runs share it. [`ParameterBatch`] serves runs that differ in the
/// values of parameters.
pub trait BatchedField<const N: usize>: Sync {
    /// One run's.
    type One: VectorField<N>;
    /// The equations of run `run`, counted from 0.
    fn of(&self, run: usize) -> &Self::One;
    /// The numbers in that of run `run`, as [`BatchedField::eval_in_registers`] wants them; none if
    /// all runs have the same.
    #[doc(hidden)]
    fn numbers(&self, run: usize) -> &[f64];
    /// As [`VectorField::scratch_len`].
    #[doc(hidden)]
    fn scratch_len(&self) -> usize;
    /// In every lane, the value of that run's equation whose numbers are in the lane.
    #[doc(hidden)]
    fn eval_in_registers<S: Simd, const K: usize>(
        &self,
        set: S,
        x: [[S::f64s; K]; N],
        numbers: &[Aligned<[S::f64s; K]>],
        scratch: &mut [Aligned<[S::f64s; K]>],
    ) -> [[S::f64s; K]; N];
}

impl<F: VectorField<N>, const N: usize> BatchedField<N> for F {
    type One = F;
    fn of(&self, _: usize) -> &F {
        self
    }
    fn numbers(&self, _: usize) -> &[f64] {
        &[]
    }
    fn scratch_len(&self) -> usize {
        VectorField::scratch_len(self)
    }
    #[inline(always)]
    fn eval_in_registers<S: Simd, const K: usize>(
        &self,
        set: S,
        x: [[S::f64s; K]; N],
        _: &[Aligned<[S::f64s; K]>],
        scratch: &mut [Aligned<[S::f64s; K]>],
    ) -> [[S::f64s; K]; N] {
        VectorField::eval_in_registers(self, set, x, scratch)
    }
}

/// An equation for each run, that differ in numbers alone: in the values of parameters, in the
/// width of a layer.
///
/// ```
/// use twofold_integrate::ensemble::{EnsembleRun, ensemble};
/// use twofold_integrate::{DriveOptions, Ignore, Tolerance};
/// use twofold_system::{ParameterBatch, Field, System, Transition};
/// let caricature = System::builtin("caricature").expect("built in");
/// let widths = [1e-2, 3e-3, 1e-3];
/// let smoothed = |eps| Field::smoothed(&caricature, Transition::Tanh, eps);
/// let fields = widths.map(|eps| smoothed(eps).bind::<3>().expect("three states"));
/// let batch = ParameterBatch::new(fields.to_vec()).expect("one system");
/// let run = EnsembleRun { start: [0.2, 0.0, -1.0].into(), options: DriveOptions::to(5.0) };
/// let ends = ensemble(&batch, &[run; 3], Tolerance { rtol: 1e-8, atol: 1e-8 }, None, |_| Ignore);
/// assert!(ends.iter().all(|end| end.summary.is_ok()));
/// ```
#[derive(Clone, Debug)]
pub struct ParameterBatch<const N: usize> {
    fields: Vec<BoundField<N>>,
    numbers: Vec<Vec<f64>>,
}

impl<const N: usize> ParameterBatch<N> {
    /// The runs' equations in the runs' order. `None` if there are none, or they differ in more
    /// than numbers.
    pub fn new(fields: Vec<BoundField<N>>) -> Option<Self> {
        let first = fields.first()?.program();
        fields.iter().all(|field| field.program().is_like(first)).then(|| {
            let numbers = fields.iter().map(|field| field.program().numbers()).collect();
            Self { fields, numbers }
        })
    }
}

impl<const N: usize> BatchedField<N> for ParameterBatch<N> {
    type One = BoundField<N>;
    fn of(&self, run: usize) -> &BoundField<N> {
        &self.fields[run]
    }
    fn numbers(&self, run: usize) -> &[f64] {
        &self.numbers[run]
    }
    fn scratch_len(&self) -> usize {
        VectorField::scratch_len(&self.fields[0])
    }
    #[inline(always)]
    fn eval_in_registers<S: Simd, const K: usize>(
        &self,
        set: S,
        x: [[S::f64s; K]; N],
        numbers: &[Aligned<[S::f64s; K]>],
        scratch: &mut [Aligned<[S::f64s; K]>],
    ) -> [[S::f64s; K]; N] {
        self.fields[0].program().evaluate_with_numbers(set, x, numbers, scratch)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Field, System, Transition};
    use nalgebra::SVector;
    use twofold_num::Elementary;

    #[test]
    fn other_numbers_are_alike_and_other_operations_are_not() {
        let bound = |f: Field| f.bind::<3>().unwrap();
        let with = |transition, eps| {
            bound(Field::smoothed(&System::builtin("caricature").unwrap(), transition, eps))
        };
        let (a, b) = (with(Transition::Tanh, 1e-2), with(Transition::Tanh, 1e-3));
        let batch = ParameterBatch::new(vec![a.clone(), b.clone()]).unwrap();
        let differing =
            batch.numbers(0).iter().zip(batch.numbers(1)).filter(|(a, b)| a != b).count();
        assert_eq!(differing, 1, "eps stands in one place");
        assert!(ParameterBatch::new(vec![a.clone(), with(Transition::Arctan, 1e-2)]).is_none());
        let other = Field::smoothed(&System::builtin("two-fold").unwrap(), Transition::Tanh, 1e-2);
        assert!(ParameterBatch::new(vec![a, bound(other)]).is_none());
        assert!(ParameterBatch::<3>::new(Vec::new()).is_none());
    }

    /// x' = c, or x' = x.
    struct Drift(Option<f64>);
    impl VectorField<1> for Drift {
        fn eval<S: Elementary>(&self, x: &SVector<S, 1>) -> SVector<S, 1> {
            SVector::from([self.0.map_or(x[0], S::from_f64)])
        }
    }

    #[test]
    fn a_value_may_be_a_number_in_all_or_in_none() {
        let of = |c| Field::record(["x"], &Drift(c)).bind::<1>().unwrap();
        assert!(ParameterBatch::new(vec![of(Some(2.0)), of(None)]).is_none());
        let batch = ParameterBatch::new(vec![of(Some(2.0)), of(Some(3.0))]).unwrap();
        assert_eq!((batch.numbers(0), batch.numbers(1)), (&[2.0][..], &[3.0][..]));
        assert_eq!(batch.of(1).eval(&SVector::from([0.0]))[0], 3.0);
        assert!(Drift(None).numbers(5).is_empty(), "one equation for all runs");
    }
}
