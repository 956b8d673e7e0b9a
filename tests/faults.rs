//! Bad input, bad places: one clear message that says what to change, exit code 2 (1 for a failed check), nothing half
//! written, existing files intact.

use std::fs;
use std::path::Path;
use std::process::Output;

use assert_cmd::Command;

fn twofold(arguments: &[&str]) -> Output {
    Command::cargo_bin("twofold").unwrap().args(arguments).output().unwrap()
}

/// Fails with `code`; the message is one line on standard error, has no panic in it, and contains each of `words`.
fn refuses(output: &Output, code: i32, words: &[&str]) {
    let text = String::from_utf8_lossy(&output.stderr).into_owned() + &String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(code), "{text}");
    assert!(!text.contains("panicked"), "{text}");
    for word in words {
        assert!(text.contains(word), "no \"{word}\" in: {text}");
    }
}

#[test]
fn wrong_numbers_are_named() {
    for (arguments, words) in [
        (vec!["--eps", "-1e-3"], vec!["--eps", "-0.001", "above zero"]),
        (vec!["--eps", "0"], vec!["--eps", "above zero"]),
        (vec!["--alpha", "NaN"], vec!["--alpha", "NaN", "finite"]),
        (vec!["--beta", "inf"], vec!["--beta", "finite"]),
        (vec!["--t-end", "0"], vec!["--t-end", "above zero"]),
        (vec!["--t-end", "-5"], vec!["--t-end"]),
        (vec!["--rtol", "0"], vec!["--rtol"]),
        (vec!["--rtol", "1e-18"], vec!["--rtol", "1e-15"]),
        (vec!["--atol", "-1"], vec!["--atol"]),
        (vec!["--max-step", "0"], vec!["--max-step"]),
        (vec!["--max-steps", "0"], vec!["--max-steps"]),
        (vec!["--restart", "-20"], vec!["--restart"]),
        (vec!["--kick-every", "0"], vec!["--kick-every"]),
        (vec!["--kick-every", "0.3", "--kick-size", "-1"], vec!["--kick-size"]),
        (vec!["--start", "1,2"], vec!["--start", "three"]),
        (vec!["--start", "1,2,NaN"], vec!["--start"]),
        (vec!["--section", "q=0"], vec!["--section", "x, y, z", "y=0"]),
        (vec!["--section", "y"], vec!["--section", "y=0"]),
        (vec!["--section", "y=zero"], vec!["--section", "number"]),
        (vec!["--system", "wheel", "--alpha", "1"], vec!["--alpha", "wheel"]),
        (vec!["--switch", "hysteretic", "--sigma", "0.1"], vec!["--sigma"]),
        (vec!["--method", "taylor-extended", "--rtol", "1e-40"], vec!["--rtol", "32 digits"]),
        (vec!["--switch", "filippov"], vec!["--exit", "nothing is chosen silently"]),
        (vec!["--switch", "filippov", "--exit", "at-once:up"], vec!["--exit", "at-once:plus"]),
        (vec!["--switch", "filippov", "--exit", "after-time:-1:plus"], vec!["--exit"]),
        (vec!["--switch", "filippov", "--exit", "all", "--funnel-times", "0"], vec!["--funnel-times"]),
        (vec!["--switch", "filippov", "--exit", "all", "--section", "y=0"], vec!["--exit", "--section"]),
        (vec!["--switch", "filippov", "--exit", "at-once:plus", "--method", "lsoda"], vec!["--method", "dopri5"]),
        (vec!["--switch", "filippov", "--exit", "at-once:plus", "--restart", "20"], vec!["--switch", "restarts"]),
        (vec!["--epsilon", "1"], vec!["--epsilon"]),
        (vec!["--method", "euler"], vec!["euler", "dopri5"]),
        (vec!["--t-end", "ten"], vec!["ten"]),
    ] {
        let mut all = vec!["run", "--quiet"];
        all.extend(arguments);
        let output = twofold(&all);
        refuses(&output, 2, &words);
        assert!(output.stdout.is_empty(), "{all:?} printed data");
    }
}

#[test]
fn a_place_that_cannot_be_written_leaves_what_is_there() {
    let folder = tempfile::tempdir().unwrap();
    let blocker = folder.path().join("notes.txt");
    fs::write(&blocker, "keep me").unwrap();
    let below = blocker.join("run.csv");
    let output = twofold(&["run", "--quiet", "--t-end", "1", "--out", below.to_str().unwrap()]);
    refuses(&output, 2, &["notes.txt", "--out"]);
    assert_eq!(fs::read_to_string(&blocker).unwrap(), "keep me");
    let output = twofold(&["run", "--quiet", "--t-end", "1", "--out", folder.path().to_str().unwrap()]);
    refuses(&output, 2, &["cannot write"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "litter");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    refuses(
        &twofold(&["run", "--quiet", "--t-end", "1", "--out", "/dev/full"]),
        2,
        &["cannot write", "free some space"],
    );
}

#[test]
fn a_finished_file_replaces_its_predecessor_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    fs::write(&path, "old").unwrap();
    // A run that fails leaves the old file.
    let to = path.to_str().unwrap();
    let output = twofold(&["run", "--quiet", "--t-end", "100", "--max-steps", "50", "--out", to]);
    refuses(&output, 2, &["50 steps were not enough", "t = ", "state ["]);
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    assert!(twofold(&["run", "--quiet", "--t-end", "1", "--out", to]).status.success());
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.starts_with("t,x,y,z\n0.0,0.2,0.0,-1.0\n"), "{text}");
}

#[test]
fn specs_round_trip_and_wrong_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("spec.json");
    let flags = ["--reading", "reconstructed", "--t-end", "20", "--kick-every", "0.3", "--section", "y=0", "--quiet"];
    let direct = twofold(&[&["run"], &flags[..]].concat());
    assert!(direct.status.success());
    let printed = twofold(&[&["run", "--print-spec"], &flags[..]].concat());
    fs::write(&spec, &printed.stdout).unwrap();
    let path = spec.to_str().unwrap();
    let again = twofold(&["run", "--quiet", "--spec", path]);
    assert_eq!(String::from_utf8_lossy(&direct.stdout), String::from_utf8_lossy(&again.stdout));
    assert!(direct.stdout.starts_with(b"t,x,y,z,direction\n"));

    refuses(&twofold(&["run", "--spec", path, "--eps", "1"]), 2, &["--spec", "--eps"]);
    fs::write(&spec, "not json").unwrap();
    refuses(&twofold(&["run", "--quiet", "--spec", path]), 2, &["spec.json", "not a spec"]);
    let wrong = String::from_utf8(printed.stdout).unwrap().replace("\"t_end\"", "\"t_ende\"");
    fs::write(&spec, wrong).unwrap();
    refuses(&twofold(&["run", "--quiet", "--spec", path]), 2, &["t_ende"]);
    refuses(&twofold(&["run", "--quiet", "--spec", "/nowhere/spec.json"]), 2, &["/nowhere/spec.json"]);
}

#[test]
fn manifests_are_checked_before_anything_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = folder.path().join("expected.json");
    let path = manifest.to_str().unwrap();
    fs::write(&manifest, "PNG").unwrap();
    refuses(&twofold(&["check", "--quiet", "--against", path]), 2, &["expected.json", "not a manifest"]);
    fs::write(&manifest, "{\"version\": 99}").unwrap();
    refuses(&twofold(&["check", "--quiet", "--against", path]), 2, &["version 99"]);
    fs::write(&manifest, "{\"version\":1,\"figure\":\"fig77\",\"made_by\":\"0\",\"pictures\":[]}").unwrap();
    refuses(&twofold(&["check", "--quiet", "--against", path]), 2, &["fig77"]);
    refuses(&twofold(&["check", "--quiet", "fig77"]), 2, &["fig77", "fig7"]);
}

#[test]
fn a_missing_reference_is_a_failed_check() {
    let folder = tempfile::tempdir().unwrap();
    let output = twofold(&["check", "--quiet", "fig7", "--expected", folder.path().to_str().unwrap()]);
    refuses(&output, 1, &["fig7: MISSING REFERENCE", "expected.json"]);
}

#[test]
fn blessing_needs_a_reason() {
    refuses(&twofold(&["bless", "--reason", " "]), 2, &["--reason"]);
    refuses(&twofold(&["bless"]), 2, &["--reason"]);
}

fn figure(name: &str, arguments: &[&str]) -> Output {
    Command::cargo_bin("twofold").unwrap().args(["figure", name, "--fresh"]).args(arguments).output().unwrap()
}

#[test]
fn figure_binaries_refuse_the_same_way() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    refuses(&figure("fig7", &["--quiet", "--out", out, "--only", "iv"]), 2, &["iv", "i, ii, iii"]);
    refuses(&figure("fig7", &["--quiet", "--out", out, "--t-end", "0"]), 2, &["--t-end"]);
    refuses(&figure("fig7", &["--quiet", "--out", out, "--reading", "other"]), 2, &["printed", "reconstructed", "all"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written on bad usage");
    let blocker = folder.path().join("file");
    fs::write(&blocker, "").unwrap();
    let output = figure("fig6", &["--quiet", "--out", blocker.to_str().unwrap(), "--t-end", "1", "--only", "i"]);
    refuses(&output, 2, &["file", "--out"]);
}

#[test]
fn a_shortened_picture_has_another_name_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let output =
        figure("fig7", &["--quiet", "--json", "--out", out, "--t-end", "50", "--reading", "printed", "--only", "(ii)"]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let records: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let record = &records[0];
    assert_eq!(record["hashes"]["name"], "fig7-printed-only-ii-shortened");
    assert!(record["alterations"][1].as_str().unwrap().contains("t = 50 instead of 200000"));
    let names: Vec<String> = files(&folder.path().join("fig7"));
    let expected = ["-ii.csv", ".json", ".pdf", ".png", ".svg"].map(|s| format!("fig7-printed-only-ii-shortened{s}"));
    assert_eq!(names, expected);
}

#[test]
fn a_killed_run_leaves_only_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    let program = assert_cmd::cargo::cargo_bin("twofold");
    let mut child = std::process::Command::new(program)
        .args(["figure", "fig6", "--fresh", "--quiet", "--out", folder.path().to_str().unwrap(), "--threads", "1"])
        .spawn()
        .unwrap();
    // Kill it as soon as its first picture's files begin to appear.
    let out = folder.path().join("fig6");
    for _ in 0..6000 {
        if out.exists() && !files(&out).is_empty() || child.try_wait().unwrap().is_some() {
            break;
        }
        std::thread::sleep(std::time::Duration::from_millis(10));
    }
    child.kill().ok();
    child.wait().unwrap();
    for name in files(&out).iter().filter(|n| !n.starts_with(".twofold-")) {
        let bytes = fs::read(out.join(name)).unwrap();
        let whole = match Path::new(name).extension().unwrap().to_str().unwrap() {
            "png" => bytes.ends_with(b"IEND\xaeB`\x82"),
            "svg" => bytes.ends_with(b"</svg>\n") || bytes.ends_with(b"</svg>"),
            "pdf" => bytes.trim_ascii_end().ends_with(b"%%EOF"),
            _ => bytes.ends_with(b"\n"),
        };
        assert!(whole, "{name} is not whole");
    }
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .map(|entries| entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect())
        .unwrap_or_default();
    names.sort();
    names
}
