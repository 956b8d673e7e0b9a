//! The committed census: its sweeps are those of the figures, its rows come out the same today, and README says what it says.

use std::fs;
use std::path::{Path, PathBuf};

use twofold::job::sweep::{Axis, Rows};
use twofold::paper::claims::claims;
use twofold::paper::{Reading, census, figures};

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn rows(name: &str) -> Rows {
    Rows::from_parquet(&fs::read(path(name)).unwrap()).unwrap()
}

/// The rows' run is that of the figure's panels, but for what is varied; starts stay within the rules' shift.
#[test]
fn the_sweeps_are_those_of_the_figures() {
    let all = figures::all();
    for (id, column) in [("fig7", "interval"), ("fig8", "sigma")] {
        let rows = rows(&format!("figures/census/{id}.parquet"));
        let figure = all.iter().find(|f| f.id == id).unwrap();
        let panels: Vec<_> = figure.pictures.iter().flat_map(|p| &p.panels).collect();
        let axes: Vec<String> = rows.sweep().axes().iter().map(|a: &Axis| a.coordinate.to_string()).collect();
        assert_eq!(axes, ["params.alpha", column, "shift.x", "shift.y", "shift.z"]);
        // One row for each panel of both readings is a whole draw.
        let mut seen = Vec::new();
        for row in 0..6 {
            let run = rows.sweep().question(row).unwrap().0.run;
            let start = run.start.clone();
            let near = panels.iter().position(|panel| {
                let mut there = panel.run.clone();
                let shift = there.start.iter().zip(&start).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                there.start.clone_from(&start);
                there == run && shift <= claims().rules.shift * (1.0 + 1e-6)
            });
            seen.push(near.unwrap_or_else(|| panic!("{id}: row {row} is no panel's run")));
        }
        seen.sort_unstable();
        assert_eq!(seen, [0, 1, 2, 3, 4, 5]);
    }
}

/// Rows of the printed reading and of the basins, which are quick, computed anew: the same to the last bit.
#[test]
fn committed_rows_come_out_the_same() {
    for (name, wanted) in [
        ("figures/census/fig7.parquet", vec![0, 7]),
        ("figures/census/fig8.parquet", vec![1, 8]),
        ("figures/basin/printed.parquet", vec![0, 312, 320]),
        ("figures/basin/reconstructed.parquet", vec![5, 312]),
    ] {
        let rows = rows(name);
        for number in wanted {
            let row = rows.get(number).unwrap_or_else(|| panic!("{name} has no row {number}"));
            assert_eq!(rows.sweep().row(number, &()).unwrap().line(), row.line(), "{name}");
        }
    }
}

#[test]
fn readme_says_what_the_census_says() {
    let found = Reading::ALL.map(|reading| figures::census::found(reading).unwrap());
    let text = census::text(&found);
    let readme = fs::read_to_string(path("README.md")).unwrap();
    let (_, rest) = readme.split_once(census::BEGIN).expect("README has a place for the census");
    let (said, _) = rest.split_once(census::END).expect("README's text about the census ends");
    assert!(said.trim() == text.trim(), "README does not say what figures/census says:\n{}\n\n{text}\n", census::BEGIN);
}
