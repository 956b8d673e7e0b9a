//! A Filippov run as points: pieces by mode, and the events between them.

use nalgebra::SVector;

use super::{FilippovObserver, Mode, ModeEvent};
use crate::step::{Flow, Step};

/// Consecutive points in one mode.
#[derive(Clone, Debug, PartialEq)]
pub struct Piece<const N: usize> {
    /// The mode.
    pub mode: Mode,
    /// Times and states, from the event that began the piece to the event that ended it, both
    /// included.
    pub points: Vec<(f64, SVector<f64, N>)>,
}

/// Records a run: each step at a fixed number of points of its dense output.
#[derive(Clone, Debug, PartialEq)]
pub struct Trajectory<const N: usize> {
    /// The pieces, in order of time.
    pub pieces: Vec<Piece<N>>,
    /// The events, in order of time.
    pub events: Vec<ModeEvent<N>>,
    per_step: usize,
    new_piece: bool,
    stop_at_two_fold: bool,
    most_events: usize,
}

impl<const N: usize> Trajectory<N> {
    /// An empty recording with `per_step` points a step (at least one).
    pub fn new(per_step: usize) -> Self {
        Self {
            pieces: Vec::new(),
            events: Vec::new(),
            per_step: per_step.max(1),
            new_piece: true,
            stop_at_two_fold: false,
            most_events: usize::MAX,
        }
    }

    /// Asks the run to stop when it has come to a two-fold.
    pub fn until_two_fold(mut self) -> Self {
        self.stop_at_two_fold = true;
        self
    }

    /// Asks the run to stop at the `count`-th event.
    pub fn until_events(mut self, count: usize) -> Self {
        self.most_events = count;
        self
    }

    /// The trajectory of the reversed system ([`Reversed`](twofold_system::Reversed)) as one of the
    /// original: order turned round, time t becomes `origin` - t, attracting and repelling change
    /// places. Events are dropped: an end is not a beginning.
    pub fn turned(mut self, origin: f64) -> Self {
        self.events.clear();
        self.pieces.reverse();
        for piece in &mut self.pieces {
            piece.points.reverse();
            for (t, _) in &mut piece.points {
                *t = origin - *t;
            }
            piece.mode = match piece.mode {
                Mode::SlidingAttracting => Mode::SlidingRepelling,
                Mode::SlidingRepelling => Mode::SlidingAttracting,
                flight => flight,
            };
        }
        self
    }

    /// All points in order of time.
    pub fn points(&self) -> impl Iterator<Item = &(f64, SVector<f64, N>)> {
        self.pieces.iter().flat_map(|p| &p.points)
    }
}

impl<const N: usize> FilippovObserver<N> for Trajectory<N> {
    fn step(&mut self, mode: Mode, step: &Step<'_, N>) -> Flow {
        if self.new_piece || self.pieces.last().is_none_or(|p| p.mode != mode) {
            self.pieces.push(Piece { mode, points: vec![(step.t0, step.x0)] });
            self.new_piece = false;
        }
        if let Some(piece) = self.pieces.last_mut() {
            let n = self.per_step;
            piece.points.extend((1..=n).map(|k| {
                let theta = k as f64 / n as f64;
                (step.time(theta), step.at(theta))
            }));
        }
        Flow::Continue
    }

    fn event(&mut self, event: &ModeEvent<N>) -> Flow {
        self.events.push(*event);
        self.new_piece = true;
        let reached = matches!(event.kind, super::EventKind::TwoFoldReached { .. });
        if self.stop_at_two_fold && reached || self.events.len() >= self.most_events {
            Flow::Stop
        } else {
            Flow::Continue
        }
    }
}
