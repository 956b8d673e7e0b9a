//! A figure of your own: a picture of two runs, computed, drawn and written like the paper's, with
//! its numbers and hashes beside it.
//!
//! `cargo run --example own_figure [FOLDER]`

use std::path::PathBuf;

use twofold::cli::{CliError, make};
use twofold::integrate::Schedule;
use twofold::jeffrey_2013::Reading;
use twofold::job::Executor;
use twofold::job::spec::*;
use twofold::paper::{Figure, FigurePanel, Picture, View};

/// The figure's specification.
pub fn figure() -> Figure {
    // Everything that a panel depends on stands in its run.
    let panel = |label, eps: f64| {
        let run = RunSpec {
            system: Reading::Reconstructed.caricature().into(),
            switch: SwitchSpec::tanh(eps),
            start: vec![0.2, 0.0, -1.0],
            t_end: 500.0,
            method: MethodSpec::ndsolve_defaults(Method::Dopri5),
            schedule: Schedule { restart_every: Some(100.0), kick: None },
            observe: Observation::Section { coordinate: 1, value: 0.0 },
        };
        FigurePanel::new(label, format!("*ε* = {eps}"), run)
    };
    Figure {
        id: "own".into(),
        title: "Two stiffnesses".into(),
        pictures: vec![Picture {
            name: "own".into(),
            reading: Some(Reading::Reconstructed.into()),
            title: "Two stiffnesses".into(),
            caption: "Poincaré sections y = 0 of the smoothed system for two values of ε.".into(),
            view: View::Section { horizontal: 0, vertical: 2 },
            panels: vec![panel("a", 1e-2), panel("b", 1e-3)],
            alterations: Vec::new(),
        }],
    }
}

fn main() -> Result<(), CliError> {
    let out = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("target/own"), PathBuf::from);
    for record in make(&[figure()], &out, &Executor::quiet())? {
        println!(
            "{}: data {}, pixels {}",
            record.hashes.name,
            record.hashes.data.short(),
            record.hashes.pixels.short()
        );
    }
    println!("written to {}", out.display());
    Ok(())
}
