//! Fig. 3: the regions of x = 0 at the two-fold of normal form (4), with computed crossing and sliding orbits.

use nalgebra::vector;

use super::{Mark3, MarkKind, Scene3};
use crate::integrate::filippov::{ExitRule, FilippovError, Settings, Side, Trajectory, history, run};
use crate::model::TwoFoldNormalForm;

/// What fig. 3 shows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RegionPicture {
    /// The normal form's v.
    pub v: f64,
    /// The normal form's w.
    pub w: f64,
    /// Half the side of the square of x = 0 that is shown.
    pub size: f64,
    /// Sliding orbits in each sliding region.
    pub sliding_orbits: usize,
}

impl Default for RegionPicture {
    /// The paper's v+ = -1.2 and v- = -1.4.
    fn default() -> Self {
        Self { v: -1.2, w: -1.4, size: 1.0, sliding_orbits: 7 }
    }
}

/// Fig. 3 as a scene: arcs of f+ above and of f- below the surface through all regions, sliding orbits from the edge of the
/// attracting region into the two-fold and from the two-fold to the edge of the repelling region.
///
/// # Errors
/// Those of the integrator.
pub fn regions(picture: &RegionPicture) -> Result<Scene3, FilippovError> {
    let size = picture.size;
    let system = TwoFoldNormalForm::invisible(picture.v, picture.w);
    let settings = Settings { max_step: 0.02 * size, ..Settings::default() };
    let mut scene = Scene3 { view: [-60.0, 22.0], ..Scene3::default() };
    scene.quadrants(size);
    let mut orbit = 0;

    // Arcs of flight: from a point where the field points away to the next meeting with the surface.
    let arcs = [
        // From crossing to attracting, from crossing to crossing, from repelling to crossing.
        (Side::Plus, -0.30, 0.95),
        (Side::Plus, -0.75, 0.90),
        (Side::Plus, -0.50, 0.40),
        (Side::Plus, -0.35, -0.10),
        (Side::Minus, 0.95, -0.30),
        (Side::Minus, 0.92, -0.65),
        (Side::Minus, 0.45, -0.45),
        (Side::Minus, -0.10, -0.30),
    ];
    for (side, y, z) in arcs {
        let mut arc = Trajectory::new(1).until_events(2);
        let start = vector![0.0, y * size, z * size];
        run(&system, start, 10.0 * size, &settings, ExitRule::AtOnce { side }, &mut arc)?;
        // In the crossing region the run starts in flight; in the repelling region it enters and leaves at once (two events).
        if arc.pieces.is_empty() {
            arc = Trajectory::new(1).until_events(3);
            run(&system, start, 10.0 * size, &settings, ExitRule::AtOnce { side }, &mut arc)?;
        }
        scene.add(&arc, orbit, false);
        scene.arrow_on_last(0.55);
        orbit += 1;
    }

    // Sliding orbits from points on the two outer edges of the attracting square, and the pasts of the opposite points.
    let n = picture.sliding_orbits.max(1);
    let edge = |k: usize| {
        let u = 2.0 * (k as f64 + 0.5) / n as f64;
        if u < 1.0 { (size, u * size) } else { ((2.0 - u) * size, size) }
    };
    for k in 0..n {
        let (y, z) = edge(k);
        let mut line = Trajectory::new(4);
        run(&system, vector![0.0, y, z], 100.0 * size, &settings, ExitRule::All, &mut line)?;
        scene.add(&line, orbit, false);
        scene.arrow_on_last(0.4);
        orbit += 1;

        let line = history(&system, vector![0.0, -y, -z], 100.0 * size, &settings, 4)?;
        scene.add(&line, orbit, false);
        scene.arrow_on_last(0.6);
        orbit += 1;
    }
    scene.marks.push(Mark3 { at: [0.0; 3], kind: MarkKind::Singularity });
    scene.fit();
    Ok(scene)
}

#[cfg(test)]
mod tests {
    use super::super::Role;
    use super::*;
    use crate::integrate::filippov::Mode;

    #[test]
    fn sliding_orbits_meet_at_the_singularity() {
        let scene = regions(&RegionPicture::default()).unwrap();
        let of = |mode| scene.lines.iter().filter(move |l| l.role == Role::Orbit(mode));
        assert_eq!((of(Mode::SlidingAttracting).count(), of(Mode::SlidingRepelling).count()), (7, 7));
        for line in of(Mode::SlidingAttracting) {
            let end = line.points.last().unwrap();
            assert!(end.iter().all(|c| c.abs() < 1e-12), "{end:?}");
            assert!(line.points.iter().all(|p| p[0].abs() <= 1e-12 && p[1] >= -1e-12 && p[2] >= -1e-12));
        }
        for line in of(Mode::SlidingRepelling) {
            assert!(line.points[0].iter().all(|c| c.abs() < 1e-12));
            assert!(line.points.iter().all(|p| p[1] <= 1e-12 && p[2] <= 1e-12));
        }
        // Flight arcs keep to their side and end on the surface.
        assert_eq!(of(Mode::Plus).count() + of(Mode::Minus).count(), 8);
        for line in of(Mode::Plus) {
            assert!(line.points.len() > 5 && line.points.iter().all(|p| p[0] >= -1e-13));
            assert_eq!(line.points.last().unwrap()[0], 0.0);
            // f+ returns at the mirror image of y.
            assert!((line.points[0][1] + line.points.last().unwrap()[1]).abs() < 1e-9);
        }
        assert!(scene.arrows.iter().any(|a| a.heads == 2) && scene.arrows.iter().any(|a| a.heads == 1));
    }
}
