//! A piecewise-smooth system of your own as text (it could stand in a file), run by the
//! event-driven integrator: a planar predator-prey model in which the predator hunts the prey only
//! while it is plentiful: h = prey - refuge.
//!
//! `cargo run --example system_from_text`

use nalgebra::Vector2;
use twofold::integrate::filippov::{ExitRule, FilippovOptions, Side, Trajectory, run};
use twofold::system::{Definition, System};

const REFUGE: &str = r#"
title = "Predators that spare rare prey"
states = ["prey", "predator"]
start = [2, 0.8]
h = "prey - refuge"
plus = ["prey - caught", "caught - 0.5*predator"]   # plenty: hunting
minus = ["prey", "-0.5*predator"]                   # rare: none

[parameters]
refuge = { value = 0.8, meaning = "prey below which the predator does not hunt" }

[let]
caught = "prey*predator"
"#;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let system = System::new(Definition::from_toml(REFUGE, "refuge.toml")?).with("refuge", 1.0)?;
    // Continuation where the future is not unique: must be chosen.
    let rule = ExitRule::AtOnce { side: Side::Plus };
    // Four points of the path for each step.
    let mut record = Trajectory::new(4);
    let end = run(
        &system.bind::<2>()?,
        Vector2::new(2.0, 0.8),
        40.0,
        &FilippovOptions::default(),
        rule,
        &mut record,
    )?;
    for event in &record.events {
        println!(
            "t = {:8.4}  prey {:.4}  predator {:.4}  {:?}",
            event.t, event.state[0], event.state[1], event.kind
        );
    }
    println!("t = {} in {:?}: {:?}", end.t, end.mode, end.x.as_slice());
    Ok(())
}
