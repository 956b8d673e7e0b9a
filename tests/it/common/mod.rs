//! Fixtures that several tests share: a small figure, made once, and references for it.
#![allow(dead_code)] // each test uses its part

pub mod schema;

use std::fs;
use std::path::Path;
use std::sync::OnceLock;

use twofold::cli;
use twofold::integrate::Schedule;
use twofold::jeffrey_2013::reading::in_both_readings;
use twofold::job::Executor;
use twofold::job::spec::*;
use twofold::paper::verdict::{Claim, SectionClaim};
use twofold::paper::{Figure, FigurePanel, View};
use twofold::record::manifest::VERSION;
use twofold::record::{Manifest, PictureEntry};

/// Two pictures of two panels, as fig. 7 but short.
pub fn small_figure(t_end: f64) -> Figure {
    in_both_readings(
        "fig7",
        "A small figure",
        View::Section { horizontal: 0, vertical: 2 },
        |_| "Sections *y* = 0 of short runs, ε = 10^{-3}.".into(),
        |reading| {
            let panel = |label, every: f64, claim| {
                let run = RunSpec {
                    system: reading.caricature().into(),
                    switch: SwitchSpec::tanh(1e-3),
                    start: vec![0.2, 0.0, -1.0],
                    t_end,
                    method: MethodSpec::ndsolve_defaults(Method::Lsoda),
                    schedule: Schedule { restart_every: Some(every), kick: None },
                    observe: Observation::Section { coordinate: 1, value: 0.0 },
                };
                FigurePanel::new(label, format!("interval {every}"), run)
                    .claimed(Claim::Section(claim))
            };
            vec![panel("i", 20.0, SectionClaim::Period(1)), panel("ii", 40.0, SectionClaim::Chaos)]
        },
    )
}

/// A folder that holds the small figure with its records and verdicts. Made once; copy it before
/// changing anything.
pub fn figures() -> &'static Path {
    static MADE: OnceLock<tempfile::TempDir> = OnceLock::new();
    let made = MADE.get_or_init(|| {
        let folder = tempfile::tempdir().unwrap();
        cli::make(&[small_figure(60.0)], folder.path(), &Executor::quiet()).unwrap();
        folder
    });
    made.path()
}

/// Copies a folder.
pub fn copy(from: &Path, to: &Path) {
    fs::create_dir_all(to).unwrap();
    for entry in fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copy(&entry.path(), &target);
        } else {
            fs::copy(entry.path(), target).unwrap();
        }
    }
}

/// References for the pictures in `made`, as `twofold bless` would leave them: figN/expected.json
/// and the PNG files.
pub fn write_references(made: &Path, expected: &Path) {
    for folder in fs::read_dir(made).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_dir()) {
        let id = folder.file_name().unwrap().to_str().unwrap().to_owned();
        let target = expected.join(&id);
        fs::create_dir_all(&target).unwrap();
        let mut files: Vec<_> = fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()).collect();
        files.sort();
        let mut pictures: Vec<PictureEntry> = Vec::new();
        for file in files {
            match file.extension().and_then(|e| e.to_str()) {
                Some("json") => {
                    let record: serde_json::Value =
                        serde_json::from_slice(&fs::read(&file).unwrap()).unwrap();
                    pictures.push(serde_json::from_value(record["hashes"].clone()).unwrap());
                }
                Some("png") => {
                    fs::copy(&file, target.join(file.file_name().unwrap())).unwrap();
                }
                _ => {}
            }
        }
        let manifest = Manifest { version: VERSION, figure: id, made_by: "0.1.0".into(), pictures };
        fs::write(target.join("expected.json"), manifest.to_json()).unwrap();
    }
}

/// Crossings of y = 0 by the paper's orbits, computed in 113-bit arithmetic outside this project.
pub const CROSSINGS_PRINTED: &str =
    include_str!("../../../papers/jeffrey-2013/reference/crossings-printed.csv");
/// The same in the other reading.
pub const CROSSINGS_RECONSTRUCTED: &str =
    include_str!("../../../papers/jeffrey-2013/reference/crossings-reconstructed.csv");
