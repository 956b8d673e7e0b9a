//! The committed census: its sweeps are those of the figures, its rows come out the same today, and
//! docs/census.md says what it says.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use twofold::cli::Exit;
use twofold::cli::progress::Progress;
use twofold::cli::recompute::recompute;
use twofold::cli::rows::journal_of;
use twofold::integrate::Schedule;
use twofold::jeffrey_2013::Reading;
use twofold::jeffrey_2013::study::census;
use twofold::jeffrey_2013::study::claims::claims;
use twofold::job::JobError;
use twofold::job::spec::*;
use twofold::job::sweep::{Axis, Rows, Sweep};
use twofold::job::table::Entry;
use twofold::paper::figures;
use twofold::record::Journal;
use twofold::system::Caricature;

pub fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

/// Files of a figure as they stand, so that texts can be compared with data before the library has
/// taken them in.
fn on_disk(folder: &str) -> impl Fn(&str) -> Result<Vec<u8>, JobError> {
    move |name| {
        fs::read(path(folder).join(name)).map_err(|e| JobError::Other(format!("{name}: {e}")))
    }
}

pub fn rows(name: &str) -> Rows {
    Rows::from_csv(&fs::read(path(name)).unwrap()).unwrap()
}

/// The rows' run is that of the figure's panels, but for what is varied; starts stay within the
/// rules' shift.
#[test]
fn the_sweeps_are_those_of_the_figures() {
    let all = figures::all();
    for (id, column) in [("fig7", "interval"), ("fig8", "sigma")] {
        let rows = rows(&format!("papers/jeffrey-2013/code/census/{id}.csv"));
        let figure = all.iter().find(|f| f.id == id).unwrap();
        let panels: Vec<_> = figure.pictures.iter().flat_map(|p| &p.panels).collect();
        let axes: Vec<String> =
            rows.sweep().axes().iter().map(|a: &Axis| a.coordinate.to_string()).collect();
        assert_eq!(axes, ["params.alpha", column, "shift.x", "shift.y", "shift.z"]);
        // One row for each panel of both readings is a whole draw.
        let mut seen = Vec::new();
        for row in 0..6 {
            let run = rows.sweep().question(row).unwrap().0.run;
            let start = run.start.clone();
            let near = panels.iter().position(|panel| {
                let mut there = panel.run.clone();
                let shift =
                    there.start.iter().zip(&start).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                there.start.clone_from(&start);
                there == run && shift <= claims().rules.shift * (1.0 + 1e-6)
            });
            seen.push(near.unwrap_or_else(|| panic!("{id}: row {row} is no panel's run")));
        }
        seen.sort_unstable();
        assert_eq!(seen, [0, 1, 2, 3, 4, 5]);
    }
}

/// `make census` and `make capture` ask for the sweeps that are committed: a part without rows of
/// each is a file that says which sweep it is of. All committed files are among them.
#[test]
fn make_census_goes_on_with_what_is_committed() {
    asks_for_what_is_committed("census", &["census", "audit", "basin", "control"]);
    asks_for_what_is_committed("capture", &["capture"]);
}

fn asks_for_what_is_committed(target: &str, folders: &[&str]) {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let make = Command::new("make")
        .current_dir(root)
        .args(["-n", target])
        .output()
        .expect("make is there");
    assert!(make.status.success(), "{}", String::from_utf8_lossy(&make.stderr));
    let folder = tempfile::tempdir().unwrap();
    let mut found = Vec::new();
    for line in String::from_utf8(make.stdout).unwrap().lines() {
        let Some((_, flags)) = line.split_once(" sweep ") else { continue };
        let mut words = flags.split_whitespace();
        let (mut kept, mut name) = (Vec::new(), None);
        while let Some(word) = words.next() {
            match word {
                "--resume" => {}
                "--threads" | "--recheck" => {
                    words.next();
                }
                "--out" => name = words.next(),
                other => kept.push(other),
            }
        }
        let name = name.unwrap_or_else(|| panic!("{line} names no file"));
        let part = folder.path().join("part.csv");
        let run = Command::new(env!("CARGO_BIN_EXE_twofold"))
            .arg("sweep")
            .args(kept)
            .args(["--quiet", "--shard", "999999999/999999999", "--out"])
            .arg(&part)
            .output()
            .unwrap();
        assert!(run.status.success(), "{name}: {}", String::from_utf8_lossy(&run.stderr));
        let asked = Rows::from_csv(&fs::read(&part).unwrap()).unwrap();
        assert_eq!(asked.len(), 0);
        assert!(
            asked.sweep() == rows(name).sweep(),
            "make {target} asks for another sweep than {name} holds"
        );
        found.push(name.to_owned());
    }
    found.sort();
    let mut committed: Vec<String> = folders
        .iter()
        .flat_map(|figure| {
            fs::read_dir(root.join("papers/jeffrey-2013/code").join(figure)).unwrap()
        })
        .map(|entry| entry.unwrap().path().strip_prefix(root).unwrap().display().to_string())
        .filter(|name| name.ends_with(".csv") && !name.ends_with("visits.csv"))
        .collect();
    committed.sort();
    assert_eq!(found, committed);
}

/// Rows of the printed reading and of the basins, which are quick, computed anew: the same to the
/// last bit.
#[test]
fn committed_rows_come_out_the_same() {
    for (name, wanted) in [
        ("papers/jeffrey-2013/code/census/fig7.csv", vec![0, 7]),
        ("papers/jeffrey-2013/code/census/fig8.csv", vec![1, 8]),
        ("papers/jeffrey-2013/code/basin/printed.csv", vec![0, 312, 320]),
        ("papers/jeffrey-2013/code/basin/reconstructed.csv", vec![5, 312]),
    ] {
        let rows = rows(name);
        for number in wanted {
            let row = rows.get(number).unwrap_or_else(|| panic!("{name} has no row {number}"));
            assert_eq!(rows.sweep().row(number, &()).unwrap().line(), row.line(), "{name}");
        }
    }
}

#[test]
fn the_page_says_what_the_census_says() {
    let found = Reading::ALL.map(|reading| {
        twofold::jeffrey_2013::census::found_in(
            reading,
            &on_disk("papers/jeffrey-2013/code/census"),
        )
        .unwrap()
    });
    let text = census::text(&found, figures::reference);
    let page = fs::read_to_string(path("docs/census.md")).unwrap();
    let (_, rest) = page.split_once(census::BEGIN).expect("the page has a place for the census");
    let (said, _) = rest.split_once(census::END).expect("its text about the census ends");
    assert!(
        said.trim() == text.trim(),
        "docs/census.md does not say what code/census says:\n{}\n\n{text}\n",
        census::BEGIN
    );
}

#[test]
fn the_book_says_what_other_limits_would_do() {
    let found = Reading::ALL.map(|reading| {
        twofold::jeffrey_2013::census::found_in(
            reading,
            &on_disk("papers/jeffrey-2013/code/census"),
        )
        .unwrap()
    });
    let text = census::limits_text(&found);
    let book = fs::read_to_string(path("docs/census-sweeps.md")).unwrap();
    let (_, rest) = book
        .split_once(census::LIMITS_BEGIN)
        .expect("docs/census-sweeps.md has a place for the limits");
    let (said, _) = rest.split_once(census::LIMITS_END).expect("its text about the limits ends");
    assert!(
        said.trim() == text.trim(),
        "docs/census-sweeps.md does not say what code/census says:\n{}\n\n{text}\n",
        census::LIMITS_BEGIN
    );
}

/// More draws go on with the rows of fewer: the file is that of a sweep made at once. Fewer draws
/// are another sweep.
#[test]
fn a_sweep_is_gone_on_with_for_more_draws() {
    let folder = tempfile::tempdir().unwrap();
    let sweep = |draws: &str, name: &str, more: &[&str]| {
        let run = Command::new(env!("CARGO_BIN_EXE_twofold"))
            .args([
                "sweep",
                "--t-end",
                "30",
                "--over",
                "params.alpha=0.1,0.2",
                "--over",
                "shift.x=-1e-9..1e-9",
                "--random",
                draws,
            ])
            .args(more)
            .args(["--out", name])
            .current_dir(folder.path())
            .output()
            .unwrap();
        (run.status.code(), String::from_utf8(run.stderr).unwrap())
    };
    assert_eq!(sweep("2", "grown.csv", &[]).0, Some(0));
    assert_eq!(sweep("5", "whole.csv", &[]).0, Some(0));
    let (code, said) = sweep("5", "grown.csv", &["--resume"]);
    assert!(code == Some(0) && said.contains("4 rows are there, 6 to compute"), "{said}");
    let bytes = |name: &str| fs::read(folder.path().join(name)).unwrap();
    assert!(bytes("grown.csv") == bytes("whole.csv"));
    let (code, said) = sweep("3", "whole.csv", &["--resume"]);
    assert!(code == Some(2) && said.contains("different sweeps"), "{said}");
    assert!(bytes("grown.csv") == bytes("whole.csv"));
}

/// A small sweep, two of whose three rows are there: what is committed need not be whole.
fn small(t_end: f64) -> Rows {
    let run = RunSpec {
        system: Caricature::with_reinjection(1e-1, 1e-5).into(),
        switch: SwitchSpec::tanh(1e-3),
        start: vec![0.2, 0.0, -1.0],
        t_end,
        method: MethodSpec::ndsolve_defaults(Method::Dopri5),
        schedule: Schedule::default(),
        observe: Observation::Section { coordinate: 1, value: 0.0 },
    };
    let sweep = Sweep::new(run, vec!["shift.x=1e-9*3".parse().unwrap()], None).unwrap();
    let mut rows = Rows::of(sweep.clone());
    for number in 0..2 {
        rows.insert(sweep.row(number, &()).unwrap()).unwrap();
    }
    rows
}

/// A row's line with another end.
fn planted(line: &str) -> String {
    assert!(line.contains(",30.0,"), "{line}");
    line.replace(",30.0,", ",29.0,")
}

#[test]
fn rows_that_come_out_the_same_pass_and_others_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let progress = Progress::new(true);
    let committed = small(30.0).csv();
    // Into a folder that is not there yet.
    let new = folder.path().join("figures").join("census");
    recompute(&[("a.csv", &committed)], &new, 1, &progress).unwrap();
    assert_eq!(std::fs::read(new.join("a.csv")).unwrap(), committed);
    assert!(!journal_of(&new.join("a.csv")).exists());

    // The same sweep with one row that ends elsewhere.
    let mut journal = small(30.0).journal();
    journal[2] = planted(&journal[2]);
    let forged = Rows::from_journal(&journal).unwrap();
    let error = recompute(&[("b.csv", &forged.csv())], folder.path(), 1, &progress).unwrap_err();
    assert_eq!(error.exit(), Exit::CheckFailed);
    let text = error.to_string();
    assert!(text.starts_with("1 committed rows") && text.contains("row 1 of b.csv"), "{text}");
}

#[test]
fn a_journal_is_gone_on_with() {
    let folder = tempfile::tempdir().unwrap();
    let whole = small(30.0);
    let (mut journal, _) = Journal::open(&journal_of(&folder.path().join("a.csv"))).unwrap();
    // A row that no computation gives: it stays, so it was not computed again.
    journal.append(&whole.journal_heading()).unwrap();
    journal.append(&planted(&whole.journal()[1])).unwrap();
    drop(journal);
    let error =
        recompute(&[("a.csv", &whole.csv())], folder.path(), 1, &Progress::new(true)).unwrap_err();
    assert!(error.to_string().contains("row 0 of a.csv"), "{error}");
}

/// Two groups alone, as the page has them: LSODA and the Taylor method to t = 5000, and fig. 7(iii)
/// beside fig. 8.
#[test]
fn groups_of_two_differ_as_the_page_says() {
    let rules = &claims().rules;
    let of = |name: &str, alpha: f64, interval: Option<f64>| {
        let mut chosen = vec![("params.alpha", Entry::Number(alpha))];
        chosen.extend(interval.map(|v| ("interval", Entry::Number(v))));
        census::runs(&rows(&format!("papers/jeffrey-2013/code/census/{name}.csv")).table(), &chosen)
    };
    let page = fs::read_to_string(path("docs/census.md")).unwrap();
    for (groups, said) in [
        ([of("ordinary-printed", 1e-3, None), of("taylor-printed", 1e-3, None)], "alone: "),
        ([of("fig7", 0.1, Some(100.0)), of("fig8", 0.1, None)], "with interval 100, "),
    ] {
        let p = census::same_odds(&groups, rules).p_permutation;
        let said = format!("{said}{}", census::p_in_words(p));
        assert!(page.split_whitespace().collect::<Vec<_>>().join(" ").contains(&said), "{said}");
    }
}
