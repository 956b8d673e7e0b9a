//! How a disturbance grows in one passage of the two-fold when the switch acts late: growth against the delay, and the exponents that fit it.
//!
//! `cargo run --release --example delay_growth`

use twofold::analyse::delay::{LateGrowth, LatePassageQuestion, late_growth};
use twofold::integrate::Failure;
use twofold::num::elementary::{exp10, log10};
use twofold::num::fit::line;
use twofold::system::{Caricature, System};

/// Starts in attracting sliding, whose chatter comes to the two-fold in different phases.
pub const STARTS: [[f64; 3]; 6] =
    [[0.0, 0.3, 0.2], [0.0, 0.25, 0.25], [0.0, 0.2, 0.3], [0.0, 0.28, 0.26], [0.0, 0.31, 0.22], [0.0, 0.22, 0.27]];

/// The growth in a passage of the caricature's two-fold, from each start.
///
/// # Errors
///
/// If an orbit cannot be followed.
pub fn growth(delay: f64, starts: &[[f64; 3]]) -> Result<Vec<LateGrowth>, Failure> {
    let caricature = Caricature::with_reinjection(1e-1, 1e-5);
    let data = System::from(caricature);
    starts
        .iter()
        .map(|start| {
            let question = LatePassageQuestion { delay, start: *start, two_fold: [0.0; 3], beyond: 3.0, by: 20.0 };
            late_growth(&caricature, &data, &question)
        })
        .collect()
}

/// Slopes of log growth against log delay, with their standard errors: across, along, carried in.
pub fn exponents(found: &[(f64, Vec<LateGrowth>)]) -> [(f64, f64); 3] {
    [|g: &LateGrowth| g.across, |g: &LateGrowth| g.along, |g: &LateGrowth| g.carried_in].map(|of| {
        let points: Vec<_> =
            found.iter().flat_map(|(delay, growth)| growth.iter().map(|g| (log10(*delay), log10(of(g))))).collect();
        line(&points).map_or((f64::NAN, f64::NAN), |line| (line.slope, line.slope_error))
    })
}

#[allow(dead_code)] // a test takes the rest
fn main() -> Result<(), Failure> {
    println!("delay,y0,z0,across,along,carried_in,exit_y,exit_z");
    let mut all = Vec::new();
    for k in 0..13 {
        let delay = exp10(-2.0 - 0.25 * f64::from(k));
        let found = growth(delay, &STARTS)?;
        for (start, g) in STARTS.iter().zip(&found) {
            let [_, y, z] = g.exit;
            println!(
                "{delay:.3e},{},{},{:.4e},{:.4},{:.4},{y:.4},{z:.4}",
                start[1], start[2], g.across, g.along, g.carried_in
            );
        }
        all.push((delay, found));
    }
    let [across, along, carried_in] = exponents(&all);
    for (name, (slope, error)) in [("across", across), ("along", along), ("carried in", carried_in)] {
        println!("# {name}: growth ~ delay^s with s = {slope:.3} +- {error:.3}");
    }
    Ok(())
}
