//! Number of orbits that come back to the two-fold of the paper's caricature after they leave its
//! repelling sliding region: starts drawn evenly from a box of that region, left at once to either
//! side in turn, followed for 300 units of time or until they are back. (The paper says that all
//! come back.)
//!
//! `make returns`, or `cargo run --release --example returns`

use nalgebra::{SVector, Vector3};
use twofold::analyse::counts::wilson;
use twofold::integrate::filippov::{
    EventKind, ExitRule, FilippovError, FilippovObserver, FilippovOptions, Mode, ModeEvent, Side,
    run,
};
use twofold::integrate::{Flow, Step, Tolerance};
use twofold::num::random::RandomStream;
use twofold::system::Caricature;

/// Longest time that an orbit may take.
const WITHIN: f64 = 300.0;

/// Ends the run where the orbit comes to a two-fold.
#[derive(Default)]
struct Back(bool);

impl FilippovObserver<3> for Back {
    fn step(&mut self, _: Mode, _: &Step<'_, 3>) -> Flow {
        Flow::Continue
    }

    fn event(&mut self, event: &ModeEvent<3>) -> Flow {
        self.0 = matches!(event.kind, EventKind::TwoFoldReached { .. });
        if self.0 { Flow::Stop } else { Flow::Continue }
    }
}

/// Number of orbits, of `starts`, that come back: y and z down to `-box_size`, where both fields
/// point away from x = 0.
///
/// # Errors
///
/// If an orbit cannot be followed.
pub fn back(system: &Caricature, box_size: f64, starts: u64) -> Result<u64, FilippovError> {
    let settings = FilippovOptions {
        tolerance: Tolerance { rtol: 1e-12, atol: 1e-12 },
        ..FilippovOptions::default()
    };
    let mut count = 0;
    for k in 0..starts {
        let mut random = RandomStream::new(2013, k);
        let start: SVector<f64, 3> =
            Vector3::new(0.0, random.uniform_in(-box_size, 0.0), random.uniform_in(-box_size, 0.0));
        let side = if k % 2 == 0 { Side::Plus } else { Side::Minus };
        let mut seen = Back::default();
        let _ = run(system, start, WITHIN, &settings, ExitRule::AtOnce { side }, &mut seen)?;
        count += u64::from(seen.0);
    }
    Ok(count)
}

fn main() -> Result<(), FilippovError> {
    let starts = 400;
    for (reading, alpha) in [("printed", 1e-3), ("reconstructed", 1e-1)] {
        for box_size in [0.3, 1.0, 3.0] {
            let back = back(&Caricature::with_reinjection(alpha, 1e-5), box_size, starts)?;
            let [low, high] = wilson(back, starts, 0.95).map(|share| 100.0 * share);
            println!(
                "{reading}, y and z down to -{box_size}: {back} of {starts} ({low:.0} % to \
                    {high:.0} %)"
            );
        }
    }
    Ok(())
}
