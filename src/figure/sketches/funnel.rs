//! Fig. 4: a funnel and its re-injection: the futures of one point, followed until they come back to it.

use nalgebra::SVector;

use super::{Mark3, MarkKind, Scene3};
use crate::integrate::filippov::{FilippovError, Funnel, FunnelGrid, Settings, funnel};
use crate::model::Caricature;

/// What fig. 4 shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FunnelPicture {
    /// The system.
    pub system: Caricature,
    /// Start of the one orbit that leads to the singularity.
    pub start: [f64; 3],
    /// Give up if it has not come there by this time.
    pub t_end: f64,
    /// The futures.
    pub grid: FunnelGrid,
    /// Half the side of the square of x = 0 that is shown.
    pub size: f64,
}

impl Default for FunnelPicture {
    /// The reconstructed reading from the paper's start; exits spaced over one factor of the crossing map's growth.
    fn default() -> Self {
        Self {
            system: Caricature::with_reinjection(1e-1, 1e-5),
            start: [0.2, 0.0, -1.0],
            t_end: 50.0,
            grid: FunnelGrid {
                shortest: 0.4,
                longest: 1.8,
                times: 8,
                horizon: 60.0,
                until_two_fold: true,
                per_step: 4,
            },
            size: 2.2,
        }
    }
}

/// Fig. 4 as a scene, with the funnel it was made from. Orbit 0 is the approach; the futures follow, two an exit time. The last
/// value says how many of them came back to the singularity within the horizon.
///
/// # Errors
/// Those of [`funnel`].
pub fn funnel_scene(picture: &FunnelPicture) -> Result<(Scene3, Funnel<3>, usize), FilippovError> {
    let settings = Settings { max_step: 0.05, ..Settings::default() };
    let family = funnel(&picture.system, SVector::from(picture.start), picture.t_end, &settings, &picture.grid)?;
    let mut scene = Scene3 { view: [-60.0, 22.0], ..Scene3::default() };
    scene.quadrants(picture.size);
    scene.add(&family.approach, 0, true);
    let mut returned = 0;
    for (k, member) in family.members.iter().enumerate() {
        scene.add(&member.trajectory, k + 1, false);
        if member.summary.mode.is_none() {
            returned += 1;
        }
        for event in &member.trajectory.events {
            super::passages::mark(&mut scene, event);
        }
    }
    scene.marks.push(Mark3 { at: family.point.into(), kind: MarkKind::Singularity });
    scene.fit();
    Ok((scene, family, returned))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn futures_leave_one_point_and_most_return() {
        let (scene, family, returned) = funnel_scene(&FunnelPicture::default()).unwrap();
        assert_eq!(family.members.len(), 16);
        assert!(returned >= 8, "{returned}");
        for k in 1..=16 {
            let first = scene.lines.iter().find(|l| l.orbit == k).unwrap();
            assert!(first.points[0].iter().all(|c| c.abs() < 1e-12));
        }
    }
}
