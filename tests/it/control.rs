//! The control for what the paper puts down to the singularity: the runs of fig. 7 in the
//! reconstructed reading once more, with the two-fold moved away from the orbits
//! (control/shifted.toml), and with a switch so wide, eps = 0.1, that nothing is singular.

use std::fs;
use std::path::{Path, PathBuf};

use nalgebra::{SVector, Vector3};
use twofold::integrate::Schedule;
use twofold::jeffrey_2013::Reading;
use twofold::jeffrey_2013::study::census::{CensusRun, MotionKind, PANELS, tally};
use twofold::jeffrey_2013::study::claims::claims;
use twofold::job::recording::Data;
use twofold::job::simulate::simulate;
use twofold::job::spec::*;
use twofold::job::sweep::Rows;
use twofold::paper::figures;
use twofold::system::filippov::two_fold;
use twofold::system::{Definition, System};

use crate::claims::Reads;

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn rows(name: &str) -> Rows {
    Rows::from_csv(&fs::read(path(name)).unwrap()).unwrap()
}

/// The runs of all three intervals.
fn runs(name: &str) -> Vec<CensusRun> {
    let table = rows(name).table();
    PANELS[..3].iter().flat_map(|panel| panel.runs(&table, Vec::new())).collect()
}

fn with_singularity() -> Vec<CensusRun> {
    PANELS[..3]
        .iter()
        .flat_map(|p| twofold::jeffrey_2013::census::runs(p.name, Reading::Reconstructed).unwrap())
        .collect()
}

const SHIFTED: &str = "papers/jeffrey-2013/code/control/shifted.csv";
const WIDE: &str = "papers/jeffrey-2013/code/control/wide.csv";

fn shifted() -> System {
    let text = fs::read_to_string(path("papers/jeffrey-2013/code/control/shifted.toml")).unwrap();
    System::new(Definition::from_toml(&text, "shifted.toml").unwrap_or_else(|e| panic!("{e}")))
}

/// The kinds of outcome among runs, undecided ones aside.
fn kinds(runs: &[CensusRun]) -> usize {
    let counts = tally(runs, claims().rules.end);
    MotionKind::ALL
        .into_iter()
        .zip(counts)
        .filter(|(kind, n)| *kind != MotionKind::Undecided && *n > 0)
        .count()
}

#[test]
fn what_remains_without_the_singularity() {
    let mut reads = Reads::by("control::what_remains_without_the_singularity");
    let (with, without, wide) = (with_singularity(), runs(SHIFTED), runs(WIDE));
    assert_eq!((without.len(), wide.len()), (90, 90));
    reads.read("5.8", "kinds of outcome with the singularity", kinds(&with) as f64);
    reads.read(
        "5.8",
        "kinds of outcome with the two-fold moved off the orbits",
        kinds(&without) as f64,
    );
    reads.read("5.8", "kinds of outcome with eps = 0.1", kinds(&wide) as f64);
    // The findings say these numbers.
    let page = fs::read_to_string(path("docs/findings.md")).unwrap();
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    let latest = |runs: &[CensusRun]| runs.iter().map(|r| r.captured_at).fold(0.0, f64::max).ceil();
    let ends =
        |runs: &[CensusRun], outcome: &str| runs.iter().filter(|r| r.outcome == outcome).count();
    let returns = |runs: &[CensusRun], period: i64| runs.iter().all(|r| r.period == period);
    assert!(ends(&without, "period-1") == 90 && returns(&without, 1) && returns(&wide, 2));
    let radii = rows(WIDE).table().numbers("radius").to_vec();
    for said in [
        format!(
            "all {} runs end on one closed orbit of one return, captured by t = {}",
            without.len(),
            latest(&without)
        ),
        format!("all {} end on or around one orbit of two returns", wide.len()),
        format!(
            "({} by the rules in period two, {} on a ring)",
            ends(&wide, "period-2"),
            ends(&wide, "quasi-periodic")
        ),
        format!("within {:.4} of it", radii.iter().copied().fold(0.0, f64::max)),
    ] {
        assert!(page.contains(&said), "docs/findings.md does not say \"{said}\"");
    }
}

/// The sweeps are those of fig. 7, but for the one thing that is changed, and their rows come out
/// the same today.
#[test]
fn the_controls_are_the_runs_of_fig_7_with_one_change() {
    let census = rows("papers/jeffrey-2013/code/census/fig7.csv");
    let paper = figures::named("fig7")
        .pictures
        .into_iter()
        .find(|p| p.reading == Some(Reading::Reconstructed.into()))
        .unwrap();
    for (name, system, switch) in [
        (SHIFTED, shifted(), SwitchSpec::tanh(1e-3)),
        (WIDE, Reading::Reconstructed.caricature().into(), SwitchSpec::tanh(0.1)),
    ] {
        let rows = rows(name);
        let axes: Vec<String> = rows.sweep().axes().iter().map(ToString::to_string).collect();
        let theirs: Vec<String> = census.sweep().axes().iter().map(ToString::to_string).collect();
        assert_eq!(axes, theirs[1..], "{name}: the axes of fig. 7's census but for alpha");
        for (row, panel) in paper.panels.iter().enumerate() {
            let run = rows.sweep().question(row as u64).unwrap().0.run;
            let expected = RunSpec {
                system: system.clone(),
                switch,
                start: run.start.clone(),
                schedule: Schedule { restart_every: panel.run.schedule.restart_every, kick: None },
                ..panel.run.clone()
            };
            assert!(
                run == expected,
                "{name}: row {row} is another run than fig. 7({})",
                panel.label
            );
        }
        assert_eq!(rows.sweep().row(1, &()).unwrap().line(), rows.get(1).unwrap().line(), "{name}");
    }
}

/// The system has its two-fold at (0, 0, -s), and no orbit from the start comes within 0.35 of it.
#[test]
fn no_orbit_comes_near_the_moved_two_fold() {
    let system = shifted();
    let fold =
        two_fold(&system.bind::<3>().unwrap(), &Vector3::new(0.01, 0.01, -0.6)).unwrap().point;
    assert!((fold - Vector3::new(0.0, 0.0, -0.7)).norm() < 1e-12, "{fold}");
    let run = RunSpec {
        system,
        t_end: 500.0,
        observe: Observation::Path { chord: 1e-3 },
        ..figures::named("fig7").pictures.remove(1).panels.remove(2).run
    };
    let Data::Path(samples) = simulate(&run, &()).unwrap().data else {
        panic!("a path was asked for")
    };
    let closest =
        samples.iter().map(|s| (SVector::from(s.x) - fold).norm()).fold(f64::INFINITY, f64::min);
    assert!(closest > 0.35, "{closest}");
}
