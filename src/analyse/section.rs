//! Poincare sections: where an orbit passes through a plane.

use serde::{Deserialize, Serialize};

use super::path::{MOST_POINTS, first_three};
use crate::integrate::{Flow, Observer, Step, roots};

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
pub struct Crossing {
    /// Time.
    pub t: f64,
    /// State (first three components).
    pub x: [f64; 3],
    /// Sense.
    pub direction: Direction,
}

/// Records every passage through the plane `state[coordinate] = value`, in both senses, located on the dense output.
///
/// A kick that throws the state across the plane is not a passage of the flow and is not recorded. In a kicked run two
/// neighbouring rows can therefore have the same sense: in fig. 9 some 30 (printed) and 200 (reconstructed) of 20,000 and 120,000.
#[derive(Clone, Debug)]
pub struct SectionRecorder {
    coordinate: usize,
    value: f64,
    crossings: Vec<Crossing>,
}

impl SectionRecorder {
    /// A recorder for the plane `state[coordinate] = value`.
    pub fn new(coordinate: usize, value: f64) -> Self {
        Self { coordinate, value, crossings: Vec::new() }
    }

    /// The passages so far, in time order.
    pub fn crossings(&self) -> &[Crossing] {
        &self.crossings
    }

    /// The passages, in time order.
    pub fn into_crossings(self) -> Vec<Crossing> {
        self.crossings
    }
}

impl<const N: usize> Observer<N> for SectionRecorder {
    fn step(&mut self, step: &Step<'_, N>) -> Flow {
        let (c, v) = (self.coordinate, self.value);
        let height = |x: &nalgebra::SVector<f64, N>| x[c] - v;
        let mut before = height(&step.x0);
        for theta in roots::sign_changes(step, height) {
            // The sense follows from the side the orbit comes from; signs alternate between successive zeros.
            let direction = if before < 0.0 { Direction::Up } else { Direction::Down };
            before = if before < 0.0 { 1.0 } else { -1.0 };
            self.crossings.push(Crossing { t: step.time(theta), x: first_three(&step.at(theta)), direction });
        }
        if self.crossings.len() < MOST_POINTS { Flow::Continue } else { Flow::Stop }
    }
}
