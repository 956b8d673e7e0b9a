//! Poincare sections: where an orbit passes through a plane.

use serde::{Deserialize, Serialize};

use super::path::{MOST_POINTS, leading};
use crate::integrate::roots::Passages;
use crate::integrate::{Flow, Observer, Step};

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
    /// The sense of a passage.
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

/// A passage through the section plane.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Crossing<const D: usize = 3> {
    /// Time.
    pub t: f64,
    /// State; the hysteretic phi is not part of it.
    pub x: [f64; D],
    /// Sense.
    pub direction: Direction,
}

/// Records every passage through the plane `state[coordinate] = value`, in both senses, located on the dense output.
/// What a passage is, [`Passages`] says.
///
/// A kick that throws the state across the plane is not a passage of the flow and is not recorded. In a kicked run two
/// neighbouring rows can therefore have the same sense: up to some 0.2 % were seen to.
#[derive(Clone, Debug)]
pub struct SectionRecorder<const D: usize = 3> {
    coordinate: usize,
    value: f64,
    passages: Passages,
    crossings: Vec<Crossing<D>>,
}

impl<const D: usize> SectionRecorder<D> {
    /// A recorder for the plane `state[coordinate] = value`.
    pub fn new(coordinate: usize, value: f64) -> Self {
        Self { coordinate, value, passages: Passages::default(), crossings: Vec::new() }
    }

    /// The passages so far, in time order.
    pub fn crossings(&self) -> &[Crossing<D>] {
        &self.crossings
    }

    /// The passages so far, which are forgotten.
    pub fn take(&mut self) -> Vec<Crossing<D>> {
        std::mem::take(&mut self.crossings)
    }

    /// The passages, in time order.
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
