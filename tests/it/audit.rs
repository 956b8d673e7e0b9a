//! `twofold audit` from outside: what is true passes, and what was changed ends with exit code 1 and a line that says where.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::Value;
use twofold::job::spec::RunSpec;
use twofold::job::sweep::{Rows, Sweep};
use twofold::paper::checkpoints::{Checkpoints, Place, choose};
use twofold::paper::figures;
use twofold::record::Hash;

/// Exit code, standard output, standard error.
fn audit(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::cargo_bin("twofold").unwrap().arg("audit").arg("--quiet").args(arguments).output().unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

fn committed(figure: &str) -> Checkpoints {
    Checkpoints::parse(figures::checkpoints(figure).unwrap()).unwrap()
}

/// The checkpoints of the printed reading's first panel, changed as told and with a root that fits; a seed with which the first stretch to be recomputed is `place`.
fn forged(place: Place, change: impl FnOnce(&mut Checkpoints)) -> (Checkpoints, String) {
    let mut points = committed("fig7");
    change(&mut points);
    let points = Checkpoints::of("fig7", points.runs);
    let places = points.places();
    let seed = (0..).find(|seed| choose(&places, 1, &points.root, *seed) == [place]).unwrap();
    (points, seed.to_string())
}

#[test]
fn what_is_committed_passes() {
    let root = committed("fig7").root.as_str().to_owned();
    let (code, out, err) = audit(&["fig7", "--segments", "2"]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert_eq!(out, format!("fig7: 2 of 240 stretches recomputed, all the same; root {root}\n"));
    // Another seed, other stretches, and each with its way to the root.
    let parts = |seed: &str| {
        let (code, out, err) = audit(&["fig7", "--segments", "3", "--seed", seed, "--json"]);
        assert_eq!(code, Some(0), "{out}{err}");
        let found: Value = serde_json::from_str(&out).unwrap();
        assert_eq!((&found["all_the_same"], &found["findings"][0]["root"]), (&true.into(), &root.as_str().into()));
        found["findings"][0]["parts"].clone()
    };
    let (a, b) = (parts("1"), parts("2"));
    assert_eq!((a.as_array().unwrap().len(), b.as_array().unwrap().len()), (3, 3));
    assert_ne!(a, b);
    assert_eq!(a, parts("1"));
    assert!(a[0]["path"].as_array().is_some_and(|path| path.len() >= 7), "{a}");
}

#[test]
fn every_lie_has_its_line() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("points.json");
    let path = file.to_str().unwrap();
    let with = |text: &[u8], seed: &str| {
        fs::write(&file, text).unwrap();
        audit(&["fig7", "--checkpoints", path, "--segments", "1", "--seed", seed])
    };
    let honest = committed("fig7");
    let text = String::from_utf8(honest.to_json()).unwrap();
    assert_eq!(with(text.as_bytes(), "0").0, Some(0), "a copy is as good");

    // A changed bit, and a changed root: the tree is not that of its root.
    let mut bit = honest.clone();
    let state = &mut bit.runs[0].ends[7].state[0];
    *state = f64::from_bits(state.to_bits() ^ 1);
    let mut root = honest.clone();
    root.root = Hash::of(b"another");
    for bad in [bit, root] {
        let (code, out, err) = with(&bad.to_json(), "0");
        assert_eq!(code, Some(1), "{out}{err}");
        assert!(out.starts_with("fig7: DIFFERS: the root is not that of the checkpoints"), "{out}");
    }

    // Everything made to fit: it is another root than the committed one, and the stretch that begins or ends there comes out otherwise.
    let place = Place { run: 0, stretch: 7 };
    let (points, seed) = forged(place, |points| {
        let state = &mut points.runs[0].ends[7].state[0];
        *state = f64::from_bits(state.to_bits() ^ 1);
    });
    let (code, out, err) = with(&points.to_json(), &seed);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(out.contains(&format!("the root is {}, and not {}", points.root.as_str(), honest.root.as_str())), "{out}");
    assert!(out.contains("fig7: DIFFERS: fig7-printed (i), stretch 8: it ends in"), "{out}");
    let (points, seed) = forged(place, |points| points.runs[0].ends[7].rows = Hash::of(b"other passages"));
    let (code, out, err) = with(&points.to_json(), &seed);
    assert_eq!(code, Some(1), "{out}{err}");
    assert!(out.contains("fig7-printed (i), stretch 8: the passages in it are others"), "{out}");

    // Checkpoints of other runs, and what is none.
    let others = committed("fig8").to_json();
    let (code, out, _) = with(&others, "0");
    assert_eq!((code, out.contains("these are 6 runs of fig8")), (Some(1), true), "{out}");
    let (code, _, err) = with(b"{}", "0");
    assert_eq!((code, err.contains("points.json: not checkpoints of this version")), (Some(2), true), "{err}");
}

#[test]
fn rows_of_sweeps_are_recomputed() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("lottery.csv");
    let path = file.to_str().unwrap();
    let made = Command::cargo_bin("twofold")
        .unwrap()
        .args(["sweep", "--t-end", "60", "--runs", "6", "--quiet", "--out", path])
        .output()
        .unwrap();
    assert!(made.status.success());
    let (code, out, err) = audit(&[path, "--segments", "4"]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("4 of 6 rows recomputed, all the same; root "), "{out}");
    // A file, sound as such, whose rows say another end than is computed: each comes out otherwise.
    let rows = Rows::from_csv(&fs::read(&file).unwrap()).unwrap();
    let journal: Vec<String> = rows.journal().iter().map(|line| line.replace(",60.0,", ",60.5,")).collect();
    assert_ne!(journal, rows.journal());
    fs::write(&file, Rows::from_journal(&journal).unwrap().csv()).unwrap();
    let (code, out, err) = audit(&[path, "--segments", "2"]);
    assert_eq!(code, Some(1), "{out}{err}");
    assert_eq!(out.matches("DIFFERS: row ").count(), 2, "{out}");
    // A file, sound as such, whose rows answer another question than it says.
    let run = RunSpec { t_end: 61.0, ..rows.sweep().run().clone() };
    let mut others = Rows::of(Sweep::new(run, rows.sweep().axes().to_vec(), None).unwrap());
    rows.iter().for_each(|row| others.insert(row).unwrap());
    fs::write(&file, others.csv()).unwrap();
    let (code, _, err) = audit(&[path, "--segments", "2"]);
    assert_eq!((code, err.contains("row 0 has the key of another question")), (Some(2), true), "{err}");
    // A changed digit of a row is not even read: the file has a digest of its rows.
    let text = String::from_utf8(rows.csv()).unwrap();
    fs::write(&file, text.replacen(",60.0,", ",60.5,", 1)).unwrap();
    let (code, _, err) = audit(&[path, "--all"]);
    assert_eq!((code, err.contains("not those that it was written with")), (Some(2), true), "{err}");
}

#[test]
fn what_cannot_be_audited_is_said() {
    for (arguments, words) in [
        (vec!["fig3"], "no runs so long that parts of them must do"),
        (vec!["fig77"], "fig77"),
        (vec!["nowhere.csv"], "nowhere.csv"),
        (vec!["fig3", "--make", "points.json"], "--make"),
        (vec!["fig7", "fig8", "--make", "points.json"], "name one"),
        (vec!["census", "--checkpoints", "points.json"], "--checkpoints"),
    ] {
        let (code, out, err) = audit(&arguments);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments:?}: {err}");
        assert!(err.contains(words), "{arguments:?}: {err}");
    }
    assert!(!Path::new("points.json").exists());
}

#[test]
fn the_book_names_the_roots() {
    let book = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/audit.md")).unwrap();
    for figure in ["fig7", "fig8", "fig9", "lottery"] {
        let line = format!("| {figure} | `{}` |", committed(figure).root.as_str());
        assert!(book.contains(&line), "docs/audit.md lacks: {line}");
    }
}
