//! `twofold audit` from outside: what is true passes, and what was changed ends with exit code 1
//! and a line that says where.

use std::fs;

use assert_cmd::Command;
use serde_json::Value;
use twofold::job::spec::RunSpec;
use twofold::job::sweep::{Base, Rows, Sweep};

/// Exit code, standard output, standard error.
fn audit(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = Command::cargo_bin("twofold")
        .unwrap()
        .arg("audit")
        .arg("--quiet")
        .args(arguments)
        .output()
        .unwrap();
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    (output.status.code(), text(&output.stdout), text(&output.stderr))
}

#[test]
fn committed_rows_are_chosen_by_their_digest_and_the_seed() {
    let parts = |seed: &str| {
        let (code, out, err) = audit(&["basin", "--rows", "1", "--seed", seed, "--json"]);
        assert_eq!(code, Some(0), "{out}{err}");
        let found: Value = serde_json::from_str(&out).unwrap();
        assert_eq!(
            (&found["all_the_same"], &found["findings"][0]["of"]),
            (&true.into(), &1250.into())
        );
        found["findings"][0]["parts"].clone()
    };
    let (a, b) = (parts("1"), parts("2"));
    assert_eq!((a.as_array().unwrap().len(), b.as_array().unwrap().len()), (1, 1));
    assert_ne!(a, b);
    assert_eq!(a, parts("1"));
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
    let (code, out, err) = audit(&[path, "--rows", "4"]);
    assert_eq!(code, Some(0), "{out}{err}");
    assert!(out.contains("4 of 6 rows recomputed, all the same"), "{out}");
    // A file, sound as such, whose rows say another end than is computed: each comes out otherwise.
    let rows = Rows::from_csv(&fs::read(&file).unwrap()).unwrap();
    let journal: Vec<String> =
        rows.journal().iter().map(|line| line.replace(",60.0,", ",60.5,")).collect();
    assert_ne!(journal, rows.journal());
    fs::write(&file, Rows::from_journal(&journal).unwrap().csv()).unwrap();
    let (code, out, err) = audit(&[path, "--rows", "2"]);
    assert_eq!(code, Some(1), "{out}{err}");
    assert_eq!(out.matches("DIFFERS: row ").count(), 2, "{out}");
    // A file, sound as such, whose rows answer another question than it says.
    let Base::Surfaces(run) = rows.sweep().run() else {
        panic!("of a system with h, plus and minus")
    };
    let run = RunSpec { t_end: 61.0, ..(**run).clone() };
    let mut others = Rows::of(Sweep::new(run, rows.sweep().axes().to_vec(), None).unwrap());
    rows.iter().for_each(|row| others.insert(row).unwrap());
    fs::write(&file, others.csv()).unwrap();
    let (code, _, err) = audit(&[path, "--rows", "2"]);
    assert_eq!(
        (code, err.contains("row 0 has the key of another question")),
        (Some(2), true),
        "{err}"
    );
    // A changed digit of a row is not even read: the file has a digest of its rows.
    let text = String::from_utf8(rows.csv()).unwrap();
    fs::write(&file, text.replacen(",60.0,", ",60.5,", 1)).unwrap();
    let (code, _, err) = audit(&[path, "--all"]);
    assert_eq!(
        (code, err.contains("not those that it was written with")),
        (Some(2), true),
        "{err}"
    );
}

#[test]
fn what_cannot_be_audited_is_said() {
    for (arguments, words) in [
        (vec!["fig3"], "twofold check fig3"),
        (vec!["fig77"], "fig77"),
        (vec!["nowhere.csv"], "nowhere.csv"),
    ] {
        let (code, out, err) = audit(&arguments);
        assert_eq!((code, out.as_str()), (Some(2), ""), "{arguments:?}: {err}");
        assert!(err.contains(words), "{arguments:?}: {err}");
    }
}
