//! The motion of a Filippov system: a path in pieces, each in one mode, and the events between
//! them.

use twofold_integrate::filippov::{FilippovObserver, Mode, ModeEvent};
use twofold_integrate::{Extents, Flow, Observer, Step};

use super::path::{MOST_POINTS, TimesRecorder};
use super::{PathRecorder, Sample};

/// A recorded Filippov motion of a system with `D` states.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion<const D: usize = 3> {
    /// Consecutive points in one mode; a piece begins where the one before ends.
    pub pieces: Vec<(Mode, Vec<Sample<D>>)>,
    /// Changes of mode.
    pub events: Vec<ModeEvent<D>>,
}

impl<const D: usize> Default for Motion<D> {
    fn default() -> Self {
        Self { pieces: Vec::new(), events: Vec::new() }
    }
}

impl<const D: usize> Motion<D> {
    /// Number of points.
    pub fn len(&self) -> usize {
        self.pieces.iter().map(|(_, samples)| samples.len()).sum()
    }

    /// Whether nothing was recorded.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All points, in time order, with their modes.
    pub fn samples(&self) -> impl Iterator<Item = (Mode, &Sample<D>)> {
        self.pieces.iter().flat_map(|(mode, samples)| samples.iter().map(move |s| (*mode, s)))
    }
}

/// Records a [`Motion`] whose pieces stay within `chord` of the dense output.
///
/// ```
/// use nalgebra::Vector2;
/// use twofold_analyse::MotionRecorder;
/// use twofold_integrate::filippov::{ExitRule, FilippovOptions, run};
/// use twofold_system::System;
/// let block = System::builtin("stick-slip").expect("built in").bind::<2>()?;
/// let mut recorder = MotionRecorder::<2>::new(1e-3);
/// let options = FilippovOptions::default();
/// let start = Vector2::new(0.0, 0.0);
/// let _ = run(&block, start, 20.0, &options, ExitRule::Undecided, &mut recorder)?;
/// let motion = recorder.into_motion();
/// assert!(motion.pieces.len() > 2 && !motion.events.is_empty());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct MotionRecorder<const D: usize = 3> {
    chord: f64,
    extents: Extents,
    pieces: Vec<(Mode, PathRecorder<D>)>,
    events: Vec<ModeEvent<D>>,
    new_piece: bool,
    /// Points in the pieces before the last.
    points: usize,
}

impl<const D: usize> MotionRecorder<D> {
    /// An empty recording; `chord` is the largest distance between polyline and dense output.
    pub fn new(chord: f64) -> Self {
        Self {
            chord,
            extents: Extents::default(),
            pieces: Vec::new(),
            events: Vec::new(),
            new_piece: true,
            points: 0,
        }
    }

    /// As [`PathRecorder::over`].
    pub fn over(mut self, extents: Extents) -> Self {
        self.extents = extents;
        self
    }

    /// Extents of the motion so far.
    pub fn extents(&self) -> Extents {
        let all = || self.pieces.iter().flat_map(|(_, path)| path.samples());
        Extents::of((0..D).map(|i| all().map(move |s| s.x[i])))
    }

    /// Number of points that are kept now.
    pub fn kept(&self) -> usize {
        self.pieces.iter().map(|(_, path)| path.len()).sum()
    }

    /// Takes the points recorded so far and clears the recorder, except for the mode of the
    /// unfinished piece, which becomes the first piece.
    pub fn take(&mut self) -> Motion<D> {
        let unfinished =
            self.pieces.pop().map(|(mode, mut path)| ((mode, path.take()), (mode, path)));
        let mut pieces: Vec<(Mode, Vec<Sample<D>>)> = std::mem::take(&mut self.pieces)
            .into_iter()
            .map(|(mode, path)| (mode, path.into_samples()))
            .collect();
        if let Some((done, rest)) = unfinished {
            pieces.push(done);
            self.pieces.push(rest);
        }
        self.points = 0;
        Motion { pieces, events: std::mem::take(&mut self.events) }
    }

    /// The recorded motion.
    pub fn into_motion(mut self) -> Motion<D> {
        self.take()
    }
}

/// Records a Filippov motion at the multiples of an interval, with its events.
#[derive(Clone, Debug)]
pub struct TimedMotion<const D: usize = 3> {
    times: TimesRecorder<D>,
    /// The pieces: (mode, how many samples). A piece between two samples has none and is counted
    /// all the same, so that pieces have the numbers that [`MotionRecorder`] gives them.
    modes: Vec<(Mode, usize)>,
    start: bool,
    new_piece: bool,
    events: Vec<ModeEvent<D>>,
}

impl<const D: usize> TimedMotion<D> {
    /// A recorder that begins with `x0` at time 0.
    pub fn new(x0: &nalgebra::SVector<f64, D>, every: f64) -> Self {
        let times = TimesRecorder::new(x0, every);
        Self { times, modes: Vec::new(), start: true, new_piece: true, events: Vec::new() }
    }

    /// As [`TimesRecorder::at_most`].
    pub fn at_most(mut self, samples: usize) -> Self {
        self.times = self.times.at_most(samples);
        self
    }

    /// As [`TimesRecorder::is_behind`].
    pub fn is_behind(&self, t: f64) -> bool {
        self.times.is_behind(t)
    }

    /// Number of points, or pieces without one, that are kept now.
    pub fn kept(&self) -> usize {
        let empty = self.modes.iter().rev().skip(1).filter(|(_, count)| *count == 0).count();
        self.modes.iter().map(|(_, count)| count).sum::<usize>() + empty
    }

    /// Takes the points recorded so far and clears the recorder, except for the mode of the
    /// unfinished piece.
    pub fn take(&mut self) -> Motion<D> {
        let last = self.modes.last().map(|(mode, _)| (*mode, 0));
        let modes = std::mem::replace(&mut self.modes, last.into_iter().collect());
        let mut samples = self.times.take().into_iter();
        let pieces = modes
            .into_iter()
            .map(|(mode, count)| (mode, samples.by_ref().take(count).collect()))
            .collect();
        Motion { pieces, events: std::mem::take(&mut self.events) }
    }

    /// The recorded motion.
    pub fn into_motion(mut self) -> Motion<D> {
        self.take()
    }
}

impl<const D: usize> FilippovObserver<D> for TimedMotion<D> {
    fn step(&mut self, mode: Mode, step: &Step<'_, D>) -> Flow {
        let more = self.times.record(step) + usize::from(std::mem::take(&mut self.start));
        match self.modes.last_mut() {
            Some((last, count)) if *last == mode && !self.new_piece => *count += more,
            _ => self.modes.push((mode, more)),
        }
        self.new_piece = false;
        if self.kept() < MOST_POINTS { Flow::Continue } else { Flow::Stop }
    }

    fn event(&mut self, event: &ModeEvent<D>) -> Flow {
        self.events.push(*event);
        self.new_piece = true;
        Flow::Continue
    }
}

impl<const D: usize> FilippovObserver<D> for MotionRecorder<D> {
    fn step(&mut self, mode: Mode, step: &Step<'_, D>) -> Flow {
        if self.new_piece || self.pieces.last().is_none_or(|(m, _)| *m != mode) {
            self.points += self.pieces.last().map_or(0, |(_, path)| path.len());
            if let Some((_, before)) = self.pieces.last() {
                self.extents = before.known().clone();
            }
            let path =
                PathRecorder::starting(step.t0, &step.x0, self.chord).over(self.extents.clone());
            self.pieces.push((mode, path.at_most(MOST_POINTS.saturating_sub(self.points))));
            self.new_piece = false;
        }
        match self.pieces.last_mut() {
            Some((_, path)) => path.step(step),
            None => Flow::Continue,
        }
    }

    fn event(&mut self, event: &ModeEvent<D>) -> Flow {
        self.events.push(*event);
        self.new_piece = true;
        Flow::Continue
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::SVector;

    use super::*;
    use twofold_integrate::Interpolant;
    use twofold_integrate::filippov::EventKind;

    /// x = t, in one straight step after another.
    struct Straight(f64, f64);
    impl Interpolant<1> for Straight {
        fn at(&self, s: f64) -> SVector<f64, 1> {
            SVector::from([self.0 + s * (self.1 - self.0)])
        }
        fn degree(&self) -> usize {
            1
        }
    }

    fn step(to: &mut impl FilippovObserver<1>, mode: Mode, from: f64, until: f64) {
        let straight = Straight(from, until);
        let step = Step {
            t0: from,
            t1: until,
            x0: [from].into(),
            x1: [until].into(),
            interpolant: &straight,
        };
        assert_eq!(to.step(mode, &step), Flow::Continue);
    }

    fn event(to: &mut impl FilippovObserver<1>, t: f64) {
        let kind = EventKind::StartedOnSurface;
        let _ = to.event(&ModeEvent { t, state: [t].into(), kind, from: None, to: None });
    }

    fn times(motion: &Motion<1>) -> Vec<(Mode, Vec<f64>)> {
        assert_eq!(motion.len(), motion.samples().count());
        assert!(motion.samples().all(|(_, s)| s.x == [s.t]));
        motion
            .pieces
            .iter()
            .map(|(mode, samples)| (*mode, samples.iter().map(|s| s.t).collect()))
            .collect()
    }

    #[test]
    fn a_piece_ends_where_the_mode_changes_or_something_happens() {
        let mut r = MotionRecorder::<1>::new(0.1);
        assert!(r.kept() == 0 && r.clone().into_motion().is_empty());
        step(&mut r, Mode::Plus, 0.0, 1.0);
        step(&mut r, Mode::Plus, 1.0, 2.0);
        step(&mut r, Mode::Minus, 2.0, 3.0);
        event(&mut r, 3.0);
        step(&mut r, Mode::Minus, 3.0, 4.0);
        assert_eq!(r.kept(), 7);
        let want = [
            (Mode::Plus, vec![0.0, 1.0, 2.0]),
            (Mode::Minus, vec![2.0, 3.0]),
            (Mode::Minus, vec![3.0, 4.0]),
        ];
        assert_eq!(times(&r.clone().into_motion()), want);
        let taken = r.take();
        assert!(
            times(&taken) == want
                && taken.len() == 7
                && !taken.is_empty()
                && taken.events.len() == 1
        );
        // Later steps continue the last piece.
        assert_eq!(r.kept(), 0);
        step(&mut r, Mode::Minus, 4.0, 5.0);
        step(&mut r, Mode::SlidingAttracting, 5.0, 6.0);
        assert_eq!(r.kept(), 3);
        let rest = r.into_motion();
        assert_eq!(
            times(&rest),
            [(Mode::Minus, vec![5.0]), (Mode::SlidingAttracting, vec![5.0, 6.0])]
        );
        assert!(rest.events.is_empty());
    }

    #[test]
    fn the_pieces_of_a_motion_share_the_room_there_is() {
        // Room for ten points: two are in the first piece and four in the second, so the third ends
        // at its fourth.
        let mut r = MotionRecorder::<1>::new(0.1);
        step(&mut r, Mode::Plus, 0.0, 1.0);
        r.points = MOST_POINTS - 10;
        let full = (1..9).find(|&k| {
            let (from, until, mode) =
                (f64::from(k), f64::from(k + 1), if k > 3 { Mode::Plus } else { Mode::Minus });
            let straight = Straight(from, until);
            let step = Step {
                t0: from,
                t1: until,
                x0: [from].into(),
                x1: [until].into(),
                interpolant: &straight,
            };
            r.step(mode, &step) == Flow::Stop
        });
        assert_eq!((full, r.kept()), (Some(6), 10));
    }

    #[test]
    fn samples_at_multiples_know_their_modes() {
        let mut r = TimedMotion::<1>::new(&[0.0].into(), 0.5);
        step(&mut r, Mode::Plus, 0.0, 1.0);
        step(&mut r, Mode::Plus, 1.0, 1.2);
        event(&mut r, 1.2);
        step(&mut r, Mode::Plus, 1.2, 1.6);
        step(&mut r, Mode::Minus, 1.6, 1.9);
        step(&mut r, Mode::Minus, 1.9, 2.5);
        step(&mut r, Mode::Minus, 2.5, 3.1);
        assert_eq!(r.kept(), 7);
        let want = [
            (Mode::Plus, vec![0.0, 0.5, 1.0]),
            (Mode::Plus, vec![1.5]),
            (Mode::Minus, vec![2.0, 2.5, 3.0]),
        ];
        assert_eq!(times(&r.clone().into_motion()), want);
        let taken = r.take();
        assert!(times(&taken) == want && taken.events.len() == 1);
        assert_eq!(r.kept(), 0);
        step(&mut r, Mode::Minus, 3.1, 3.6);
        assert_eq!((r.kept(), times(&r.into_motion())), (1, vec![(Mode::Minus, vec![3.5])]));
    }
}
