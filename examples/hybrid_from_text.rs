//! A general system as text, followed from Rust: a block on a shaken table, held by dry friction,
//! between two walls from which it bounces. Friction is a switch on which motion can slide (the
//! block sticks); a wall is an event that sets the velocity.
//!
//! `cargo run --example hybrid_from_text`

use std::error::Error;

use twofold::hybrid::{Definition, Model, Options, Point, follow};

const BLOCK: &str = r#"
title = "A block on a shaken table between two walls"
states = ["x", "v"]
start = [0, 0]
f = ["v", "push*sin(t) - friction*sign(v)"]

[[event]]
name = "right wall"
when = "x - wall"
direction = "up"
set = { v = "-bounce*v" }

[[event]]
name = "left wall"
when = "x + wall"
direction = "down"
set = { v = "-bounce*v" }

[parameters]
push = 1
friction = 0.5
wall = 0.4
bounce = 0.5
"#;

/// The block's bounces and release.
#[derive(Debug, Default)]
pub struct Story {
    /// Times and walls of its bounces.
    pub bounces: Vec<(f64, String)>,
    /// The time of the first point at which it does not stick.
    pub free: Option<f64>,
}

/// Follows the block until `t_end`.
///
/// # Errors
/// If the text is no system, or its motion cannot be followed.
pub fn follow_block(t_end: f64) -> Result<Story, Box<dyn Error>> {
    let model = Model::new(Definition::from_toml(BLOCK, "block.toml")?);
    let mut story = Story::default();
    let mut before = None;
    follow(&model, &Options { t_end, ..Options::default() }, &mut |point: &Point<'_>| {
        // A point before the event's reset, and one after it.
        match (point.event, before.take()) {
            (Some(wall), None) => {
                story.bounces.push((point.t, wall.to_owned()));
                before = Some(point.t);
            }
            // The only switching function is the velocity; it is slid upon where the block sticks.
            _ if point.signs != "0" => {
                story.free.get_or_insert(point.t);
            }
            _ => {}
        }
        // Go on.
        true
    })?;
    Ok(story)
}

fn main() -> Result<(), Box<dyn Error>> {
    let story = follow_block(30.0)?;
    if let Some(t) = story.free {
        println!("t = {t:8.4}  the block begins to move");
    }
    for (t, wall) in &story.bounces {
        println!("t = {t:8.4}  {wall}");
    }
    Ok(())
}
