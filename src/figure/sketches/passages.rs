//! Fig. 5: one trajectory of the discontinuous system (5), several passages through the two-fold.

use nalgebra::SVector;

use super::{Mark3, MarkKind, Scene3};
use crate::integrate::filippov::{
    EventKind, ExitRule, FilippovError, ModeEvent, Settings, SlidingLaw, Trajectory, run,
};
use crate::model::Caricature;

/// What fig. 5 shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassagePicture {
    /// The system.
    pub system: Caricature,
    /// Start of the orbit.
    pub start: [f64; 3],
    /// Its length in time.
    pub t_end: f64,
    /// How it leaves the singularity.
    pub rule: ExitRule,
    /// Half the side of the square of x = 0 that is shown.
    pub size: f64,
}

impl PassagePicture {
    /// The paper's orbit in the reading with the given `alpha` (beta = 1e-5). Good windows, six passages each: alpha = 1e-1 with
    /// t_end 90, seed 3, size 2.2; alpha = 1e-3 with t_end 300, seed 9, size 10. Exits at random: uniform times up to 2, either
    /// side with the same chance.
    pub fn of_reading(alpha: f64, t_end: f64, seed: u64, size: f64) -> Self {
        Self {
            system: Caricature::with_reinjection(alpha, 1e-5),
            start: [0.2, 0.0, -1.0],
            t_end,
            rule: ExitRule::Random {
                law: SlidingLaw::Uniform { longest: 2.0 },
                plus_probability: 0.5,
                seed,
                stream: 0,
            },
            size,
        }
    }
}

/// Fig. 5 as a scene, with the run it was made from. Each passage begins a new orbit number, so that the stretches between
/// visits can be told apart.
///
/// # Errors
/// Those of [`run`].
pub fn passages(picture: &PassagePicture) -> Result<(Scene3, Trajectory<3>), FilippovError> {
    let settings = Settings { max_step: 0.05, ..Settings::default() };
    let mut trajectory = Trajectory::new(4);
    run(&picture.system, SVector::from(picture.start), picture.t_end, &settings, picture.rule, &mut trajectory)?;
    let mut scene = Scene3 { view: [-60.0, 22.0], ..Scene3::default() };
    scene.quadrants(picture.size);
    let visits: Vec<f64> =
        trajectory.events.iter().filter(|e| matches!(e.kind, EventKind::TwoFoldReached { .. })).map(|e| e.t).collect();
    let first = scene.lines.len();
    scene.add(&trajectory, 0, false);
    for (line, piece) in scene.lines[first..].iter_mut().zip(&trajectory.pieces) {
        line.orbit = visits.iter().filter(|t| **t <= piece.points[0].0).count();
    }
    scene.marks.push(Mark3 { at: picture.start, kind: MarkKind::Start });
    for event in &trajectory.events {
        mark(&mut scene, event);
    }
    scene.marks.push(Mark3 { at: [0.0; 3], kind: MarkKind::Singularity });
    scene.fit();
    Ok((scene, trajectory))
}

/// Marks landings and exits.
pub(super) fn mark(scene: &mut Scene3, event: &ModeEvent<3>) {
    let kind = match event.kind {
        EventKind::Landing { .. } => MarkKind::Landing,
        EventKind::Exit { to, .. } => MarkKind::Exit(to),
        EventKind::ExitAtBoundary { to, .. } => MarkKind::ExitAtBoundary(to),
        _ => return,
    };
    scene.marks.push(Mark3 { at: event.state.into(), kind });
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::integrate::filippov::Side;

    #[test]
    fn several_passages_in_both_readings() {
        // The pictures' own windows: (alpha, t_end, seed, size).
        for (alpha, t_end, seed, size) in [(1e-1, 90.0, 3, 2.2), (1e-3, 300.0, 9, 10.0)] {
            let (scene, run) = passages(&PassagePicture::of_reading(alpha, t_end, seed, size)).unwrap();
            let visits = run.events.iter().filter(|e| matches!(e.kind, EventKind::TwoFoldReached { .. })).count();
            assert_eq!(visits, 6);
            let exits = |s| scene.marks.iter().filter(|m| m.kind == MarkKind::Exit(s)).count();
            assert!(exits(Side::Plus) >= 2 && exits(Side::Minus) >= 2);
            assert_eq!(scene.lines.iter().map(|l| l.orbit).max(), Some(6));
            assert!(scene.lines.iter().flat_map(|l| &l.points).flatten().all(|c| c.abs() < 40.0));
        }
    }
}
