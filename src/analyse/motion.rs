//! The motion of a Filippov system: a path in pieces, each in one mode, and the events between them.

use crate::integrate::filippov::{FilippovObserver, Mode, ModeEvent};
use crate::integrate::{Flow, Observer, Step};

use super::path::MOST_POINTS;
use super::{PathRecorder, Sample};

/// A recorded Filippov motion in three dimensions.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Motion {
    /// Consecutive points in one mode; a piece begins where the one before ends.
    pub pieces: Vec<(Mode, Vec<Sample>)>,
    /// Changes of mode.
    pub events: Vec<ModeEvent<3>>,
}

impl Motion {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.pieces.iter().map(|(_, samples)| samples.len()).sum()
    }

    /// Whether nothing was recorded.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All points, in time order, with their modes.
    pub fn samples(&self) -> impl Iterator<Item = (Mode, &Sample)> {
        self.pieces.iter().flat_map(|(mode, samples)| samples.iter().map(move |s| (*mode, s)))
    }
}

/// Records a [`Motion`] whose pieces stay within `chord` of the dense output.
#[derive(Clone, Debug)]
pub struct MotionRecorder {
    chord: f64,
    pieces: Vec<(Mode, PathRecorder)>,
    events: Vec<ModeEvent<3>>,
    new_piece: bool,
    /// Points in the pieces before the last.
    points: usize,
}

impl MotionRecorder {
    /// An empty recording; `chord` is the largest distance between polyline and dense output.
    pub fn new(chord: f64) -> Self {
        Self { chord, pieces: Vec::new(), events: Vec::new(), new_piece: true, points: 0 }
    }

    /// What was recorded.
    pub fn into_motion(self) -> Motion {
        let pieces = self.pieces.into_iter().map(|(mode, path)| (mode, path.into_samples())).collect();
        Motion { pieces, events: self.events }
    }
}

impl FilippovObserver<3> for MotionRecorder {
    fn step(&mut self, mode: Mode, step: &Step<'_, 3>) -> Flow {
        if self.new_piece || self.pieces.last().is_none_or(|(m, _)| *m != mode) {
            self.points += self.pieces.last().map_or(0, |(_, path)| path.len());
            let path = PathRecorder::starting(step.t0, &step.x0, self.chord);
            self.pieces.push((mode, path.at_most(MOST_POINTS.saturating_sub(self.points))));
            self.new_piece = false;
        }
        match self.pieces.last_mut() {
            Some((_, path)) => path.step(step),
            None => Flow::Continue,
        }
    }

    fn event(&mut self, event: &ModeEvent<3>) -> Flow {
        self.events.push(*event);
        self.new_piece = true;
        Flow::Continue
    }
}
