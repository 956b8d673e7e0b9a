//! Sets of states, and of derivatives, in shapes that follow the flow.
//!
//! A [`Set`] is { c + C p + B r : p in P, r in R }: a point, the image of the initial box P under
//! the linearised flow, and all errors made on the way, in an orthogonal frame B that is turned
//! after every step so that its first axis lies along the longest side of what is enclosed (the
//! doubleton of Mrozek & Zgliczynski 2000, after Lohner 1987). A box in fixed axes would be wrapped
//! anew at each step and grow exponentially in a flow that merely rotates.
//!
//! Beside it goes, if asked for, the derivative of the state with respect to the initial state, in
//! the same form, column by column: V = D + B E (the C1 algorithm of Zgliczynski 2002).

use nalgebra::{SMatrix, SVector};

use super::Error;
use super::linear::{self, IMatrix, IVector, Inverse};
use twofold_num::{Arithmetic, Enclosure, Interval};

/// A set of states at a time. See the [module](self).
#[derive(Clone, Debug)]
pub struct Set<S, const N: usize> {
    centre: SVector<S, N>,
    stretch: SMatrix<f64, N, N>,
    initial: IVector<N>,
    frame: SMatrix<f64, N, N>,
    errors: IVector<N>,
    derivative: Option<Derivative<N>>,
    time: S,
    /// A coordinate that all states of the set have exactly.
    on: Option<(usize, f64)>,
}

/// D + B E.
#[derive(Clone, Debug)]
struct Derivative<const N: usize> {
    centre: SMatrix<f64, N, N>,
    errors: IMatrix<N>,
}

impl<S: Enclosure, const N: usize> Set<S, N> {
    /// A box at t = 0. With `derivative`, the derivative with respect to the state is carried
    /// along.
    pub fn new(states: SVector<S, N>, derivative: bool) -> Self {
        let split = states.map(|x| x.split().0);
        let initial = IVector::from_fn(|i, _| states[i].split().1);
        Self {
            centre: split,
            stretch: SMatrix::identity(),
            initial,
            frame: SMatrix::identity(),
            errors: IVector::from_element(Interval::zero()),
            derivative: derivative.then(|| Derivative {
                centre: SMatrix::identity(),
                errors: IMatrix::from_element(Interval::zero()),
            }),
            time: S::zero(),
            on: None,
        }
    }

    /// A box in the plane where a coordinate has a value, at t = 0; that coordinate of `states` is
    /// replaced.
    pub fn on_plane(mut states: SVector<S, N>, axis: usize, value: f64, derivative: bool) -> Self {
        states[axis] = S::from_f64(value);
        Self { on: Some((axis, value)), ..Self::new(states, derivative) }
    }

    /// A parallelepiped { centre + stretch w : w in `weights` } in the plane where a coordinate has
    /// a value, at t = 0; that coordinate's weight is replaced by zero, the coordinate of `centre`
    /// by the value.
    pub fn parallelepiped(
        mut centre: SVector<S, N>,
        stretch: SMatrix<f64, N, N>,
        mut weights: IVector<N>,
        (axis, value): (usize, f64),
    ) -> Self {
        centre[axis] = S::from_f64(value);
        weights[axis] = Interval::zero();
        let rounding = IVector::from_fn(|i, _| centre[i].split().1);
        let point = Self::on_plane(centre.map(|x| x.split().0), axis, value, false);
        Self { stretch, initial: weights, errors: rounding, ..point }
    }

    /// The coordinate that all states have exactly.
    pub fn on(&self) -> Option<(usize, f64)> {
        self.on
    }

    /// The time at which the set is reached.
    pub fn time(&self) -> S {
        self.time
    }

    /// The point that the set surrounds.
    pub fn centre(&self) -> &SVector<S, N> {
        &self.centre
    }

    /// The set relative to its centre, as a box.
    pub fn spread(&self) -> IVector<N> {
        let mut box_ = linear::sum(
            &linear::apply(&linear::exactly(&self.stretch), &self.initial),
            &linear::apply(&linear::exactly(&self.frame), &self.errors),
        );
        if let Some((axis, _)) = self.on {
            box_[axis] = Interval::zero();
        }
        box_
    }

    /// The smallest box found that holds the set.
    pub fn hull(&self) -> IVector<N> {
        let spread = self.spread();
        IVector::from_fn(|i, _| self.centre[i].interval() + spread[i])
    }

    /// M (x - `origin`) for all states x, as a box: the set in other axes.
    pub fn seen(&self, origin: &SVector<f64, N>, m: &IMatrix<N>) -> IVector<N> {
        let middle = IVector::from_fn(|i, _| (self.centre[i] - S::from_f64(origin[i])).interval());
        let stretch = linear::product(m, &linear::exactly(&self.stretch));
        let frame = linear::product(m, &linear::exactly(&self.frame));
        let spread = linear::sum(
            &linear::apply(&stretch, &self.initial),
            &linear::apply(&frame, &self.errors),
        );
        linear::sum(&linear::apply(m, &middle), &spread)
    }

    /// Enclosures of the states in the precision of the arithmetic.
    pub fn states(&self) -> SVector<S, N> {
        let spread = self.spread();
        SVector::from_fn(|i, _| self.centre[i] + S::from_interval(spread[i]))
    }

    /// The derivative of the state with respect to the initial state, if it is carried along.
    pub fn derivative(&self) -> Option<IMatrix<N>> {
        self.derivative.as_ref().map(|d| {
            linear::sum(
                &linear::exactly(&d.centre),
                &linear::product(&linear::exactly(&self.frame), &d.errors),
            )
        })
    }

    /// Whether the derivative is carried along.
    pub fn has_derivative(&self) -> bool {
        self.derivative.is_some()
    }

    /// The image under a map with the given value at the centre and derivative on the hull
    /// (`jacobian`); `full` is what the derivative of states with respect to initial states is
    /// multiplied with (the same, unless `jacobian` is that of a truncated series).
    pub(super) fn image(
        &self,
        value: SVector<S, N>,
        jacobian: &IMatrix<N>,
        full: &IMatrix<N>,
        elapsed: S,
        on: Option<(usize, f64)>,
    ) -> Result<Self, Error> {
        let centre = value.map(|x| x.split().0);
        let rounding = IVector::from_fn(|i, _| value[i].split().1);
        let stretched = linear::product(jacobian, &linear::exactly(&self.stretch));
        let stretch = linear::midpoints(&stretched);
        let residue = linear::apply(
            &linear::difference(&stretched, &linear::exactly(&stretch)),
            &self.initial,
        );
        let turned = linear::product(jacobian, &linear::exactly(&self.frame));
        let weights = self.errors.map(Interval::magnitude);
        let frame = linear::orthogonal(&linear::midpoints(&turned), &weights);
        let inverse = Inverse::new(&frame).ok_or(Error::Singular)?;
        let mut errors = linear::sum(
            &linear::apply(&inverse.product(&turned), &self.errors),
            &inverse.apply(&linear::sum(&residue, &rounding)),
        );
        let mut derivative = match &self.derivative {
            None => None,
            Some(d) => {
                let moved = linear::product(full, &linear::exactly(&d.centre));
                let centre = linear::midpoints(&moved);
                let rest = linear::difference(&moved, &linear::exactly(&centre));
                let turned = linear::product(full, &linear::exactly(&self.frame));
                let errors = linear::sum(
                    &linear::product(&inverse.product(&turned), &d.errors),
                    &inverse.product(&rest),
                );
                Some(Derivative { centre, errors })
            }
        };
        if let Some((axis, _)) = on {
            // All else lying in the plane, a frame vector that is the plane's normal has no part in
            // any state.
            let leaning = (0..N).filter(|j| frame[(axis, *j)] != 0.0).count();
            for j in 0..N {
                if leaning == 1 && (0..N).all(|i| (i == axis) == (frame[(i, j)] != 0.0)) {
                    errors[j] = Interval::zero();
                    if let Some(d) = &mut derivative {
                        d.errors.row_mut(j).fill(Interval::zero());
                    }
                }
            }
        }
        Ok(Self {
            centre,
            stretch,
            initial: self.initial,
            frame,
            errors,
            derivative,
            time: self.time + elapsed,
            on,
        })
    }
}
