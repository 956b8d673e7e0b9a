//! A piecewise-smooth system of your own, run by the event-driven integrator: a planar
//! predator-prey model in which the predator hunts the prey only while it is plentiful: h = prey -
//! refuge.
//!
//! `cargo run --example own_system`

use nalgebra::{SVector, Vector2};
use twofold::integrate::filippov::{
    ExitRule, FilippovError, FilippovOptions, ModeEvent, Side, Trajectory, run,
};
use twofold::num::Elementary;
use twofold::system::PiecewiseSmooth;

struct Refuge {
    prey_needed: f64,
}

impl PiecewiseSmooth<2> for Refuge {
    fn switching<S: Elementary>(&self, x: &SVector<S, 2>) -> S {
        x[0] - S::from_f64(self.prey_needed)
    }
    fn plus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        Vector2::new(x[0] - x[0] * x[1], x[0] * x[1] - x[1].scale(0.5))
    }
    fn minus<S: Elementary>(&self, x: &SVector<S, 2>) -> SVector<S, 2> {
        Vector2::new(x[0], -x[1].scale(0.5))
    }
}

/// The events of an orbit.
///
/// # Errors
///
/// If the orbit cannot be followed.
pub fn follow() -> Result<Vec<ModeEvent<2>>, FilippovError> {
    // Continuation where the future is not unique: must be chosen.
    let rule = ExitRule::AtOnce { side: Side::Plus };
    let mut record = Trajectory::new(4);
    let _ = run(
        &Refuge { prey_needed: 1.0 },
        Vector2::new(2.0, 0.8),
        40.0,
        &FilippovOptions::default(),
        rule,
        &mut record,
    )?;
    Ok(record.events)
}

fn main() -> Result<(), FilippovError> {
    for event in follow()? {
        println!(
            "t = {:8.4}  prey {:.4}  predator {:.4}  {:?}",
            event.t, event.state[0], event.state[1], event.kind
        );
    }
    Ok(())
}
