//! Poincare sections: where an orbit passes through a plane.

use serde::{Deserialize, Serialize};

use super::path::{MOST_POINTS, leading};
use twofold_integrate::roots::CrossingFinder;
use twofold_integrate::{Flow, Observer, Step};

/// The sense in which an orbit passes through the section plane.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// The section's coordinate increases.
    Up,
    /// The section's coordinate decreases.
    Down,
}

impl Direction {
    /// The sense of a crossing.
    pub(super) fn of(upward: bool) -> Self {
        if upward { Direction::Up } else { Direction::Down }
    }

    /// The word used in data files.
    pub fn word(self) -> &'static str {
        match self {
            Direction::Up => "up",
            Direction::Down => "down",
        }
    }
}

/// A crossing of the section plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing<const D: usize = 3> {
    /// Time.
    pub t: f64,
    /// State; the hysteretic phi is not part of it.
    pub x: [f64; D],
    /// Sense.
    pub direction: Direction,
}

/// Records every crossing of the plane `state[coordinate] = value`, in both senses, located on the
/// dense output. What a crossing is, [`CrossingFinder`] says.
///
/// A kick that throws the state across the plane is not a crossing of the flow and is not recorded.
/// In a kicked run two neighbouring rows can therefore have the same sense: up to some 0.2 % were
/// seen to.
///
/// ```
/// # use nalgebra::{SVector, Vector2};
/// # use twofold_integrate::{DriveOptions, Dopri5, Tolerance, drive};
/// # use twofold_num::Elementary;
/// # use twofold_system::VectorField;
/// # struct Oscillator;
/// # impl VectorField<2> for Oscillator {
/// #     fn eval<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
/// #         Vector2::new(x[1], -x[0])
/// #     }
/// # }
/// # let mut method = Dopri5::new(Tolerance { rtol: 1e-9, atol: 1e-9 });
/// # let x0 = Vector2::new(1.0, 0.0);
/// use twofold_analyse::SectionRecorder;
/// // x'' = -x from (1, 0): crossings of x = 0 at pi/2 and 3 pi/2.
/// let mut section = SectionRecorder::<2>::new(0, 0.0);
/// let to = DriveOptions::to(6.0);
/// let _ = drive(&Oscillator, x0, &to, &mut method, &mut section, &())?;
/// assert_eq!(section.crossings().len(), 2);
/// assert!((section.crossings()[0].t - std::f64::consts::FRAC_PI_2).abs() < 1e-8);
/// # Ok::<(), twofold_integrate::Failure>(())
/// ```
#[derive(Clone, Debug)]
pub struct SectionRecorder<const D: usize = 3> {
    coordinate: usize,
    value: f64,
    passages: CrossingFinder,
    crossings: Vec<Crossing<D>>,
}

impl<const D: usize> SectionRecorder<D> {
    /// A recorder for the plane `state[coordinate] = value`.
    pub fn new(coordinate: usize, value: f64) -> Self {
        Self { coordinate, value, passages: CrossingFinder::default(), crossings: Vec::new() }
    }

    /// The crossings so far, in time order.
    pub fn crossings(&self) -> &[Crossing<D>] {
        &self.crossings
    }

    /// Takes the crossings so far and clears the recorder.
    pub fn take(&mut self) -> Vec<Crossing<D>> {
        std::mem::take(&mut self.crossings)
    }

    /// The crossings, in time order.
    pub fn into_crossings(self) -> Vec<Crossing<D>> {
        self.crossings
    }
}

impl<const N: usize, const D: usize> Observer<N> for SectionRecorder<D> {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        for passage in self.passages.through_plane(step, self.coordinate, self.value) {
            let (t, x) = (step.time(passage.theta), leading(&step.at(passage.theta)));
            self.crossings.push(Crossing { t, x, direction: Direction::of(passage.upward) });
        }
        if self.crossings.len() < MOST_POINTS { Flow::Continue } else { Flow::Stop }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::SVector;

    use super::*;
    use twofold_integrate::Interpolant;

    /// Once around the unit circle in one step, from the angle 0.
    struct Circle;
    impl Interpolant<3> for Circle {
        fn at(&self, s: f64) -> SVector<f64, 3> {
            use twofold_num::elementary::{cos, sin};
            let a = std::f64::consts::TAU * s;
            SVector::from([cos(a), sin(a), 3.0 * s])
        }
        fn degree(&self) -> usize {
            8
        }
    }

    #[test]
    fn passages_have_their_moment_their_place_and_their_sense() {
        let step =
            Step { t0: 2.0, t1: 6.0, x0: Circle.at(0.0), x1: Circle.at(1.0), interpolant: &Circle };
        let mut r = SectionRecorder::<3>::new(0, 0.5);
        assert_eq!(r.step(&step), Flow::Continue);
        // cos = 1/2 at a sixth of the turn, going down, and at five sixths, going up.
        let want = [(1.0 / 6.0, Direction::Down), (5.0 / 6.0, Direction::Up)];
        assert_eq!(r.crossings().len(), 2);
        for (c, (s, direction)) in r.crossings().iter().zip(want) {
            assert!((c.t - (2.0 + 4.0 * s)).abs() < 1e-12 && c.direction == direction, "{c:?}");
            assert!((SVector::from(c.x) - Circle.at(s)).amax() < 1e-12, "{c:?}");
        }
        assert_eq!([Direction::Down, Direction::Up].map(Direction::word), ["down", "up"]);
        let taken = r.take();
        assert!(taken.len() == 2 && r.crossings().is_empty() && r.into_crossings().is_empty());
    }
}
