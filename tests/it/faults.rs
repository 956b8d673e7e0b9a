//! Bad input, bad places, bad moments: one clear message that says what to change, the exit code
//! that the help names, nothing half written, existing files intact, no litter. No test aims at a
//! real device: code that is wrong on purpose (make mutants) would replace it.

use std::fs;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Output, Stdio};
use std::time::{Duration, Instant};

use assert_cmd::Command;
use serde_json::Value;

/// Long enough for anything that is refused at once, on any machine; far too short for what is
/// refused.
const AT_ONCE: Duration = Duration::from_secs(60);

/// A program under way. A test that fails does not leave it running.
struct Running(Option<Child>);

impl Running {
    fn start(arguments: &[&str]) -> Self {
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("twofold"));
        command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        Self(Some(command.spawn().unwrap()))
    }

    fn child(&mut self) -> &mut Child {
        self.0.as_mut().unwrap()
    }

    /// Standard error has no reader any more.
    fn unread(mut self) -> Self {
        self.child().stdout = None;
        self.child().stderr = None;
        self
    }

    fn ended(&mut self) -> bool {
        self.child().try_wait().unwrap().is_some()
    }

    /// Waits for its end, for a minute.
    fn output(mut self) -> Output {
        let child = self.0.take().unwrap();
        let id = child.id().to_string();
        let (done, waits) = std::sync::mpsc::channel::<()>();
        let guard = std::thread::spawn(move || {
            if waits.recv_timeout(AT_ONCE) == Err(std::sync::mpsc::RecvTimeoutError::Timeout) {
                std::process::Command::new("kill").args(["-KILL", &id]).status().ok();
            }
        });
        let output = child.wait_with_output().unwrap();
        drop(done);
        guard.join().unwrap();
        output
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        if let Some(child) = &mut self.0 {
            child.kill().ok();
            child.wait().ok();
        }
    }
}

fn twofold(arguments: &[&str]) -> Output {
    Command::cargo_bin("twofold").unwrap().args(arguments).timeout(AT_ONCE).output().unwrap()
}

/// Fails with `code`; the message is one line on standard error, has no panic in it, and contains
/// each of `words`.
fn refuses(output: &Output, code: i32, words: &[&str]) {
    let text = String::from_utf8_lossy(&output.stderr).into_owned()
        + &String::from_utf8_lossy(&output.stdout);
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
        (vec!["--atol", "1e-320"], vec!["--atol", "1e-320", "1e-140"]),
        (vec!["--t-end", "1e300"], vec!["--t-end", "1e12"]),
        (vec!["--seed", "-1"], vec!["--seed", "-1"]),
        (vec!["--max-steps", "-1"], vec!["--max-steps", "-1"]),
        (vec!["--restart", "1e-9"], vec!["--restart", "10^9"]),
        (vec!["--max-step", "0"], vec!["--max-step"]),
        (vec!["--max-steps", "0"], vec!["--max-steps"]),
        (vec!["--restart", "-20"], vec!["--restart"]),
        (vec!["--kick-every", "0"], vec!["--kick-every"]),
        (vec!["--kick-every", "0.3", "--kick-size", "-1"], vec!["--kick-size"]),
        (vec!["--start", "1,2"], vec!["--start", "3 wanted, a number for each of x, y, z"]),
        (vec!["--start", "1,2,NaN"], vec!["--start"]),
        (vec!["--section", "q=0"], vec!["--section", "x, y, z", "y=0"]),
        (vec!["--section", "y"], vec!["--section", "y=0"]),
        (vec!["--section", "y=zero"], vec!["--section", "number"]),
        (
            vec!["--system", "wheel", "--alpha", "1"],
            vec!["--alpha", "belongs to the caricature", "--set"],
        ),
        (vec!["--switch", "hysteretic", "--sigma", "0.1"], vec!["--sigma"]),
        (vec!["--exit", "nonsense", "--eps-prime", "5"], vec!["no effect", "--switch"]),
        (
            vec!["--switch", "filippov", "--exit", "all", "--eps", "1e-3"],
            vec!["--eps", "no effect"],
        ),
        (vec!["--system", "wheel", "--reading", "printed"], vec!["--reading", "no effect"]),
        (vec!["--reading", "other"], vec!["--reading other", "printed, reconstructed"]),
        (vec!["--seed", "5"], vec!["--seed", "random"]),
        (vec!["--section", "y=0", "--chord", "0.1"], vec!["--chord", "crossings"]),
        (vec!["--print-spec", "--format", "json"], vec!["--print-spec", "--format"]),
        (vec!["--method", "taylor-extended", "--rtol", "1e-40"], vec!["--rtol", "32 digits"]),
        (vec!["--switch", "filippov", "--exit", "at-once:up"], vec!["--exit", "at-once:plus"]),
        (
            vec!["--switch", "filippov", "--exit", "after-time:-1:plus"],
            vec!["--exit is after-time:-1.0:plus"],
        ),
        (
            vec!["--switch", "filippov", "--exit", "all", "--funnel-times", "0"],
            vec!["--funnel-times"],
        ),
        (
            vec!["--switch", "filippov", "--exit", "all", "--section", "y=0"],
            vec!["--exit", "--section"],
        ),
        (
            vec!["--switch", "filippov", "--exit", "at-once:plus", "--method", "lsoda"],
            vec!["--method", "dopri5"],
        ),
        (
            vec!["--switch", "filippov", "--exit", "at-once:plus", "--restart", "20"],
            vec!["--restart", "--switch", "restarts"],
        ),
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
    let output =
        twofold(&["run", "--quiet", "--t-end", "1", "--out", folder.path().to_str().unwrap()]);
    refuses(&output, 2, &["cannot write"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1, "litter");
}

#[test]
fn a_finished_file_replaces_its_predecessor_whole() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    fs::write(&path, "old").unwrap();
    // A run that fails leaves the old file, and its rows beside it.
    let to = path.to_str().unwrap();
    let output = twofold(&["run", "--quiet", "--t-end", "100", "--max-steps", "50", "--out", to]);
    refuses(&output, 3, &["50 steps were not enough", "t = ", "state ["]);
    assert_eq!(fs::read_to_string(&path).unwrap(), "old");
    // A run that finishes says that those rows are of another.
    let finished = twofold(&["run", "--quiet", "--t-end", "1", "--out", to]);
    assert!(finished.status.success());
    let said = String::from_utf8(finished.stderr).unwrap();
    assert!(said.contains("run.csv.part is of an earlier run that did not finish"), "{said}");
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains("t,x,y,z\n0.0,0.2,0.0,-1.0\n") && text.ends_with('\n'), "{text}");
    // A longer predecessor leaves no rest.
    fs::write(&path, "x".repeat(100_000)).unwrap();
    assert!(twofold(&["run", "--quiet", "--t-end", "1", "--out", to]).status.success());
    assert_eq!(fs::read_to_string(&path).unwrap(), text);
    assert_eq!(files(folder.path()), ["run.csv", "run.csv.part"]);
}

/// Meaning of each exit code, on the real programs. 130 and 143:
/// `signals_leave_at_once_and_keep_what_is_finished`.
#[test]
fn exit_codes_are_those_of_the_help() {
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path().to_str().unwrap();
    assert_eq!(twofold(&["run", "--quiet", "--t-end", "1"]).status.code(), Some(0));
    assert_eq!(twofold(&["check", "--quiet", "fig1", "--expected", here]).status.code(), Some(1));
    assert_eq!(twofold(&["run", "--t-end", "0"]).status.code(), Some(2));
    assert_eq!(twofold(&["run", "--no-such-flag"]).status.code(), Some(2));
    assert_eq!(twofold(&["run", "--spec", "/nowhere"]).status.code(), Some(2));
    assert_eq!(twofold(&["run", "--quiet", "--max-steps", "5"]).status.code(), Some(3));
    let sweep = twofold(&["sweep", "--quiet", "--runs", "2", "--t-end", "5", "--max-steps", "5"]);
    refuses(&sweep, 3, &["2 of 2 runs failed", "5 steps were not enough"]);
    let rows = String::from_utf8(sweep.stdout).unwrap();
    assert_eq!(rows.lines().filter(|l| l.contains(",failed,")).count(), 2, "{rows}");
    assert_eq!(figure("fig1", &["--quiet", "--out", here]).status.code(), Some(0));
    assert_eq!(figure("fig1", &["--quiet", "--out", here, "--only", "i"]).status.code(), Some(2));
    assert_eq!(twofold(&["figure", "fig7", "--print-spec", "--out", here]).status.code(), Some(2));
    for text in [
        twofold(&["--help"]).stdout,
        twofold(&["run", "--help"]).stdout,
        figure("fig7", &["--help"]).stdout,
    ] {
        let text = String::from_utf8(text).unwrap();
        assert!(text.contains("Example") || text.contains("Exit codes"), "{text}");
    }
    let help = String::from_utf8(twofold(&["--help"]).stdout)
        .unwrap()
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ");
    assert!(help.contains(twofold::cli::Exit::HELP), "{help}");
    let readme = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/README.md")).unwrap();
    let readme = readme.split_whitespace().collect::<Vec<_>>().join(" ");
    assert!(readme.contains(twofold::cli::Exit::HELP), "README names other exit codes");
}

/// `--out /dev/stdout >> log` writes after what the log holds, `--out -` to whatever standard
/// output is.
#[cfg(target_os = "linux")]
#[test]
fn standard_output_is_written_to_and_never_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let plain = twofold(&["run", "--quiet", "--t-end", "1"]).stdout;
    let itself = std::process::id();
    for (name, after) in [
        ("-", true),
        ("/dev/stdout", true),
        ("/proc/self/fd/1", true),
        ("/dev/fd/1", true),
        // Through another process's descriptor: a log that this test holds open.
        ("descriptor", false),
    ] {
        let log = folder.path().join("log");
        fs::write(&log, "keep\n").unwrap();
        let open = fs::OpenOptions::new().append(true).open(&log).unwrap();
        let descriptor = format!("/proc/{itself}/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&open));
        let to = if after { name } else { &descriptor };
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin("twofold"));
        command.args(["run", "--quiet", "--t-end", "1", "--out", to]);
        command.stdout(if after { Stdio::from(open.try_clone().unwrap()) } else { Stdio::null() });
        assert!(command.status().unwrap().success(), "{name}");
        assert_eq!(fs::read(&log).unwrap(), [b"keep\n", &plain[..]].concat(), "{name}");
        assert_eq!(files(folder.path()), ["log"], "{name}");
    }
}

/// A pipe by name is written to and stays a pipe.
#[cfg(unix)]
#[test]
fn a_named_pipe_is_written_to() {
    use std::os::unix::fs::FileTypeExt;
    let folder = tempfile::tempdir().unwrap();
    let pipe = folder.path().join("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut reader =
        std::process::Command::new("cat").arg(&pipe).stdout(Stdio::piped()).spawn().unwrap();
    let output = twofold(&["run", "--quiet", "--t-end", "1", "--out", pipe.to_str().unwrap()]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let mut read = Vec::new();
    std::io::Read::read_to_end(&mut reader.stdout.take().unwrap(), &mut read).unwrap();
    reader.wait().unwrap();
    assert_eq!(read, twofold(&["run", "--quiet", "--t-end", "1"]).stdout);
    assert!(fs::symlink_metadata(&pipe).unwrap().file_type().is_fifo());
}

#[test]
fn a_spec_can_come_from_standard_input() {
    let flags = ["run", "--quiet", "--t-end", "3", "--reading", "reconstructed"];
    let spec = twofold(&[&flags[..], &["--print-spec"]].concat()).stdout;
    let mut command = Command::cargo_bin("twofold").unwrap();
    let output =
        command.args(["run", "--quiet", "--spec", "-"]).write_stdin(spec).output().unwrap();
    assert_eq!(
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&twofold(&flags).stdout)
    );
    let mut command = Command::cargo_bin("twofold").unwrap();
    refuses(
        &command.args(["run", "--spec", "-"]).write_stdin("{").output().unwrap(),
        2,
        &["standard input", "not a spec"],
    );
}

/// The place is tried before a computation that would take minutes.
#[cfg(target_os = "linux")]
#[test]
fn a_bad_place_is_found_before_computing() {
    let begun = Instant::now();
    refuses(&figure("fig7", &["--out", "/proc"]), 2, &["/proc", "--out"]);
    refuses(&twofold(&["run", "--t-end", "1e9", "--out", "/proc/x/y.csv"]), 2, &["/proc", "--out"]);
    refuses(&twofold(&["sweep", "--t-end", "1e9", "--out", "/"]), 2, &["a folder"]);
    assert!(begun.elapsed() < AT_ONCE);
}

/// A file grown beyond the limit of its size stands for a full disk: an error with a message, the
/// old file whole, no litter.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.csv");
    fs::write(&path, "old").unwrap();
    let program = assert_cmd::cargo::cargo_bin("twofold");
    // The signal may be ignored already where the tests run (by Python's children): then it proves
    // nothing.
    for disposition in ["", "env --default-signal=XFSZ "] {
        let script =
            format!("ulimit -f 16; exec {disposition}\"$0\" run --quiet --t-end 100 --out \"$1\"");
        let output = Command::new("sh")
            .args(["-c", &script])
            .arg(&program)
            .arg(&path)
            .timeout(AT_ONCE)
            .output()
            .unwrap();
        refuses(&output, 2, &["cannot write", "run.csv", "free some space"]);
        assert_eq!(fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(files(folder.path()), ["run.csv"]);
    }
}

/// Standard error has no reader any more (`2>&1 | head -1`): every file is there all the same.
#[test]
fn an_unread_standard_error_costs_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let output = Running::start(&["figure", "fig3", "--fresh", "--out", out]).unread().output();
    assert_eq!(output.status.code(), Some(0));
    let made = files(&folder.path().join("fig3"));
    assert!(
        ["fig3.json", "fig3.pdf", "fig3.png", "fig3.svg"]
            .iter()
            .all(|f| made.contains(&f.to_string())),
        "{made:?}"
    );
    // Errors cannot be said, but are.
    assert_eq!(Running::start(&["run", "--t-end", "0"]).unread().output().status.code(), Some(2));
    assert_eq!(Running::start(&["run", "--t-end", "50"]).unread().output().status.code(), Some(0));
    assert_eq!(Running::start(&["--help"]).unread().output().status.code(), Some(0));
}

#[cfg(unix)]
fn signal(running: &mut Running, name: &str) {
    let id = running.child().id().to_string();
    assert!(
        std::process::Command::new("kill")
            .args([format!("-{name}"), id])
            .status()
            .unwrap()
            .success()
    );
}

/// Waits until `ready`, or fails after a minute.
fn wait_until(what: &str, mut ready: impl FnMut() -> bool) {
    let begun = Instant::now();
    while !ready() {
        assert!(begun.elapsed() < AT_ONCE, "{what}: not within a minute");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// Waits until it has worked for a second; on a loaded machine that takes longer.
#[cfg(unix)]
fn let_it_work(running: &mut Running) {
    let stat = format!("/proc/{}/stat", running.child().id());
    if !Path::new(&stat).exists() {
        return std::thread::sleep(Duration::from_millis(1500));
    }
    // Fields 14 and 15, counted from the name's end, which is the second: hundredths of a second of
    // the processor.
    let used = || -> u64 {
        let text = fs::read_to_string(&stat).unwrap_or_default();
        let fields =
            text.rsplit(')').next().unwrap_or_default().split_whitespace().skip(11).take(2);
        fields.map(|field| field.parse::<u64>().unwrap_or(0)).sum()
    };
    wait_until("a second of work", || used() >= 100);
}

/// Ctrl-C, SIGTERM and, on Linux, a closed terminal: within a second (and what a loaded machine
/// adds), one line, what is finished stays, nothing else does.
#[cfg(unix)]
#[test]
fn signals_leave_at_once_and_keep_what_is_finished() {
    let signals = [("INT", 130), ("TERM", 143), ("HUP", 143)];
    // Under `nohup` the programs started here are to ignore the last one, too.
    let count = if twofold::record::files::closed_terminal_ends() { 3 } else { 2 };
    for (name, code) in signals.into_iter().take(count) {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("orbit.csv");
        fs::write(&out, "the last whole one").unwrap();
        let ends = |mut running: Running, words: &[&str]| {
            let_it_work(&mut running);
            let begun = Instant::now();
            signal(&mut running, name);
            let output = running.output();
            assert!(begun.elapsed() < Duration::from_secs(4), "{name}: {:?}", begun.elapsed());
            refuses(&output, code, words);
            let said = String::from_utf8(output.stderr.clone()).unwrap();
            assert_eq!(said.lines().count(), 1, "{said}");
            output
        };
        // A run: its points so far beside the place, and the old file as it was.
        let long = ["run", "--quiet", "--t-end", "1e9", "--section"];
        let run = Running::start(&[&long[..], &["y=0", "--out", out.to_str().unwrap()]].concat());
        ends(run, &["interrupted at t = ", "orbit.csv.part"]);
        assert_eq!(fs::read_to_string(&out).unwrap(), "the last whole one");
        let part = fs::read_to_string(folder.path().join("orbit.csv.part")).unwrap();
        assert!(part.ends_with("\n# stop: interrupted\n") && part.lines().count() > 50, "{part}");
        assert_eq!(files(folder.path()), ["orbit.csv", "orbit.csv.part"]);
        // The same on standard output.
        let output = ends(
            Running::start(&[&long[..], &["y=1e9"]].concat()),
            &["interrupted at", "standard output"],
        );
        assert!(String::from_utf8(output.stdout).unwrap().contains("interrupted"));
        // A figure: what is finished is there, and nothing else.
        let figures = folder.path().join("figures");
        let made = Running::start(&[
            "figure",
            "fig7",
            "--fresh",
            "--quiet",
            "--out",
            figures.to_str().unwrap(),
        ]);
        ends(made, &[if name == "INT" { "interrupted" } else { "terminated" }]);
        assert!(files(&figures.join("fig7")).is_empty());
    }
}

/// A sweep that is interrupted keeps the rows of the runs that are finished.
#[cfg(unix)]
#[test]
fn an_interrupted_sweep_keeps_its_rows() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("sweep.csv");
    let to = out.to_str().unwrap();
    let mut sweep = Running::start(&[
        "sweep",
        "--runs",
        "1000000",
        "--t-end",
        "300",
        "--threads",
        "1",
        "--out",
        to,
    ]);
    let mut lines =
        std::io::BufRead::lines(std::io::BufReader::new(sweep.child().stderr.take().unwrap()));
    let finished = lines
        .by_ref()
        .map(Result::unwrap)
        .filter(|l| l.contains("of 1000000 rows"))
        .take(3)
        .count();
    assert_eq!(finished, 3);
    signal(&mut sweep, "INT");
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    assert_eq!(sweep.output().status.code(), Some(130), "{rest:?}");
    assert!(rest.last().unwrap().contains("runs are finished"), "{rest:?}");
    assert_eq!(files(folder.path()), ["sweep.csv.journal"]);
    // The rows so far can be read, and a sweep without --resume leaves them alone.
    let journal = folder.path().join("sweep.csv.journal");
    let part = twofold(&["sweep", "merge", journal.to_str().unwrap(), "--quiet"]);
    assert!(String::from_utf8(part.stdout).unwrap().lines().count() >= 5);
    refuses(&twofold(&["sweep", "--t-end", "300", "--out", to]), 2, &["--resume"]);
}

/// A table of another sweep is not gone on with, and nothing is left beside it that would be in the
/// way of its own sweep.
#[test]
fn a_refused_resume_leaves_nothing_behind() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("sweep.csv");
    let to = out.to_str().unwrap();
    let sweep = |alphas: &str, resume: &[&str]| {
        let over = format!("params.alpha={alphas}");
        let own = ["sweep", "--t-end", "5", "--quiet", "--over", &over, "--out", to];
        twofold(&[&own, resume].concat())
    };
    assert!(sweep("0.1,0.2", &[]).status.success());
    let table = std::fs::read(&out).unwrap();
    refuses(&sweep("0.1,0.3", &["--resume"]), 2, &["sweep.csv", "different sweeps"]);
    assert_eq!(files(folder.path()), ["sweep.csv"]);
    assert!(sweep("0.1,0.2", &["--resume"]).status.success());
    assert_eq!(std::fs::read(&out).unwrap(), table);
    // A table in JSON is not read again.
    let json = folder.path().join("sweep.json");
    let again =
        ["sweep", "--t-end", "5", "--runs", "2", "--quiet", "--out", json.to_str().unwrap()];
    assert!(twofold(&again).status.success());
    refuses(&twofold(&[&again[..], &["--resume"]].concat()), 2, &["sweep.json", "JSON"]);
    assert_eq!(files(folder.path()), ["sweep.csv", "sweep.json"]);
    refuses(&twofold(&["audit", json.to_str().unwrap()]), 2, &["FILE.csv"]);
    refuses(&twofold(&["audit", to, "--rows", "0"]), 2, &["--rows 0"]);
    // Nor does a flag that is refused after the journal was begun.
    let many = folder.path().join("many.csv");
    let many = ["sweep", "--t-end", "5", "--threads", "2000", "--out", many.to_str().unwrap()];
    refuses(&twofold(&many), 2, &["--threads"]);
    assert_eq!(files(folder.path()), ["sweep.csv", "sweep.json"]);
}

/// Killed without warning and gone on with, whole or in parts: the same bytes.
#[cfg(unix)]
#[test]
fn a_killed_sweep_goes_on_to_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let axes = [
        "--over",
        "params.alpha=0.1,0.2",
        "--over",
        "shift.x=0..1e-9",
        "--random",
        "30",
        "--t-end",
        "120",
        "--threads",
        "1",
    ];
    let sweep = |more: &[&str]| {
        [&["sweep"], &axes[..], more].concat().iter().map(|s| s.to_string()).collect::<Vec<_>>()
    };
    let run = |more: &[&str]| {
        let arguments = sweep(more);
        let done = twofold(&arguments.iter().map(String::as_str).collect::<Vec<_>>());
        assert_eq!(done.status.code(), Some(0), "{}", String::from_utf8_lossy(&done.stderr));
    };
    let whole = file("whole.csv");
    run(&["--out", &whole]);
    let cut = file("cut.csv");
    let arguments = sweep(&["--out", &cut]);
    for _ in 0..3 {
        let resumed: Vec<&str> = arguments.iter().map(String::as_str).chain(["--resume"]).collect();
        let mut running = Running::start(&resumed);
        std::thread::sleep(std::time::Duration::from_millis(150));
        let _ = running.child().kill();
        drop(running);
    }
    run(&["--out", &cut, "--resume"]);
    assert!(fs::read(&whole).unwrap() == fs::read(&cut).unwrap());
    let (a, b, c) = (file("a.csv"), file("b.csv"), file("c.csv"));
    run(&["--out", &a, "--shard", "1/3"]);
    run(&["--out", &b, "--shard", "2/3"]);
    run(&["--out", &c, "--shard", "3/3"]);
    let merged = file("merged.csv");
    assert_eq!(
        twofold(&["sweep", "merge", &c, &a, &b, "--out", &merged, "--quiet"]).status.code(),
        Some(0)
    );
    assert!(fs::read(&whole).unwrap() == fs::read(&merged).unwrap());
    // Another sweep's file is refused.
    refuses(
        &twofold(&["sweep", "--t-end", "9", "--resume", "--out", &whole]),
        2,
        &["different sweeps"],
    );
}

/// A short fig. 7 on one thread, into `folder`.
fn short_fig7(folder: &Path, t_end: &str) -> Running {
    let to = folder.to_str().unwrap();
    Running::start(&[
        "figure",
        "fig7",
        "--fresh",
        "--quiet",
        "--threads",
        "1",
        "--t-end",
        t_end,
        "--out",
        to,
    ])
}

/// Figures are not lost without a word when something removes their folder meanwhile.
#[test]
fn a_folder_removed_meanwhile_is_noticed() {
    let made = std::iter::repeat_with(|| {
        let folder = tempfile::tempdir().unwrap();
        let (out, away) = (folder.path().join("fig7"), folder.path().join("away"));
        let mut made = short_fig7(folder.path(), "1000");
        let records = |folder: &Path| {
            ["printed", "reconstructed"]
                .map(|r| folder.join(format!("fig7-{r}-shortened.json")).exists())
        };
        wait_until("the first picture", || records(&out) != [false; 2] || made.ended());
        // At one stroke, so that what is away tells what was there: with one picture still to come,
        // its end is yet to be written.
        fs::rename(&out, &away).unwrap();
        (made.output(), records(&away))
    });
    // On a loaded machine both may be done before this test has its turn: then there may be nothing
    // to notice.
    let in_time = |(_, records): &(Output, [bool; 2])| *records != [true; 2];
    let (made, _) =
        made.take(5).find(in_time).expect("five times all was done before the folder was away");
    refuses(&made, 2, &["fig7", "run this again"]);
}

#[test]
fn too_much_is_refused_before_it_is_tried() {
    let begun = Instant::now();
    for (arguments, words) in [
        (vec!["sweep", "--threads", "1000000000"], vec!["--threads", "1024"]),
        (vec!["check", "fig1", "--threads", "20000"], vec!["--threads", "1024"]),
        (vec!["sweep", "--runs", "4294967295"], vec!["--runs", "1000000"]),
        (vec!["sweep", "--runs", "0"], vec!["--runs"]),
        (vec!["sweep", "--switch", "filippov", "--exit", "all"], vec!["--exit", "sweep"]),
        (vec!["run", "--t-end", "1e300"], vec!["--t-end"]),
    ] {
        refuses(&twofold(&arguments), 2, &words);
    }
    refuses(&figure("fig7", &["--threads", "1000000000"]), 2, &["--threads", "1024"]);
    // A gigabyte of nothing, and brackets in brackets in brackets.
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("spec.json");
    let path = spec.to_str().unwrap();
    fs::File::create(&spec).unwrap().set_len(1 << 30).unwrap();
    refuses(&twofold(&["run", "--spec", path]), 2, &["spec.json", "larger than 16 MiB"]);
    refuses(&twofold(&["check", "--against", path]), 2, &["spec.json", "larger than 16 MiB"]);
    refuses(&twofold(&["inspect", path]), 2, &["spec.json", "larger than 512 MiB"]);
    for text in ["[".repeat(100_000), "{\"system\":".repeat(100_000)] {
        fs::write(&spec, text).unwrap();
        refuses(&twofold(&["run", "--spec", path]), 2, &["spec.json", "not a spec"]);
        refuses(&twofold(&["check", "--against", path]), 2, &["spec.json", "not a manifest"]);
    }
    // The same as a system's file, a certificate, a table; and 10^18 cells.
    for (name, text) in [
        ("deep.toml", format!("name = \"deep\"\nx = {}", "[".repeat(100_000))),
        ("deep-table.toml", format!("name = \"deep\"\n{}", "a.".repeat(100_000))),
        (
            "deep-expression.toml",
            fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/systems/relay-linear.toml"))
                .unwrap()
                .replacen("= \"", &format!("= \"{}", "(".repeat(100_000)), 1),
        ),
    ] {
        let file = folder.path().join(name);
        fs::write(&file, text).unwrap();
        refuses(&twofold(&["run", "--system", file.to_str().unwrap(), "--t-end", "1"]), 2, &[name]);
    }
    for (name, text) in [
        ("deep.json", "[".repeat(100_000)),
        (
            "wide.json",
            format!(
                "{{\"theorem\":\"printed-cycle\",\"statement\":\"{}\"}}",
                "x".repeat(10_000_000)
            ),
        ),
    ] {
        let file = folder.path().join(name);
        fs::write(&file, text).unwrap();
        refuses(&twofold(&["verify", file.to_str().unwrap()]), 2, &[name, "not a certificate"]);
    }
    let table = folder.path().join("deep.csv");
    fs::write(&table, format!("# {}\nt\n1\n", "{\"about\":".repeat(100_000))).unwrap();
    refuses(&twofold(&["sweep", "merge", table.to_str().unwrap()]), 2, &["deep.csv"]);
    let cells = ["sweep", "--over", "start.x=0..1:1000000000", "--over", "start.z=0..1:1000000000"];
    refuses(&twofold(&cells), 2, &["--over", "1000000000000000000 rows"]);
    assert!(begun.elapsed() < 3 * AT_ONCE);
}

/// A picture that grows a thousandfold when it is unpacked, and one whose text does: neither is
/// unpacked further than its header allows.
#[test]
fn decompression_bombs_stay_packed() {
    let folder = tempfile::tempdir().unwrap();
    // Zeros pack 1000:1: 128 MiB of them in the data, and in a text, of an image of one pixel.
    let zeros = miniz_oxide::deflate::compress_to_vec_zlib(&vec![0_u8; 1 << 27], 9);
    assert!(zeros.len() < 1 << 18);
    let chunk = |kind: &[u8; 4], data: &[u8]| {
        let mut chunk = (data.len() as u32).to_be_bytes().to_vec();
        chunk.extend_from_slice(kind);
        chunk.extend_from_slice(data);
        chunk.extend_from_slice(&crc(&chunk[4..]).to_be_bytes());
        chunk
    };
    let head = [&[0, 0, 0, 1, 0, 0, 0, 1][..], &[8, 6, 0, 0, 0]].concat();
    let text = [b"twofold:Picture\0\x01\0\0\0".as_slice(), &zeros].concat();
    let mut bomb = b"\x89PNG\r\n\x1a\n".to_vec();
    bomb.extend(chunk(b"IHDR", &head));
    bomb.extend(chunk(b"iTXt", &text));
    bomb.extend(chunk(b"IDAT", &zeros));
    bomb.extend(chunk(b"IEND", b""));
    let file = folder.path().join("fig1.png");
    fs::write(&file, bomb).unwrap();
    let begun = Instant::now();
    refuses(
        &twofold(&["inspect", file.to_str().unwrap()]),
        1,
        &["Made by twofold, and changed since"],
    );
    let against =
        twofold(&["check", "fig1", "--quiet", "--against", folder.path().to_str().unwrap()]);
    refuses(&against, 1, &["fig1.png: DIFFERS"]);
    assert!(begun.elapsed() < 2 * AT_ONCE);
}

/// The checksum of PNG's chunks (ISO 3309).
fn crc(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0_u32, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b), |crc, _| {
            if crc & 1 == 1 { crc >> 1 ^ 0xedb8_8320 } else { crc >> 1 }
        })
    })
}

/// 46 bytes that claim a picture of 100000 by 100000 pixels; a link to nothing; a name that steers
/// terminals: each costs one line.
#[test]
fn hostile_pictures_cost_one_line_each() {
    let hex = "89504e470d0a1a0a0000000d49484452000186a0000186a00806000000a8520bc800000001494441547876e684e6";
    let bytes: Vec<u8> = (0..hex.len())
        .step_by(2)
        .map(|i| u8::from_str_radix(&hex[i..i + 2], 16).unwrap())
        .collect();
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("fig1.png"), &bytes).unwrap();
    let nothing = at("nothing");
    fs::create_dir(&nothing).unwrap();
    let inspected = twofold(&[
        "inspect",
        at("fig1.png").to_str().unwrap(),
        "--expected",
        nothing.to_str().unwrap(),
    ]);
    refuses(&inspected, 1, &["Not made by twofold"]);
    let here = folder.path().to_str().unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink("nowhere", at("gone.png")).unwrap();
    #[cfg(unix)]
    fs::write(at("a\u{1b}[2Jb.png"), b"").unwrap();
    let output = twofold(&["check", "fig1", "--quiet", "--against", here]);
    refuses(
        &output,
        1,
        &["fig1.png: DIFFERS: ours and theirs cannot be compared", "100000 by 100000", "1 of 1"],
    );
    #[cfg(unix)]
    refuses(&output, 1, &["gone.png: a broken link, skipped", "a\u{fffd}[2Jb.png"]);
    assert!(!output.stdout.contains(&0x1b));
    let json = twofold(&["check", "fig1", "--quiet", "--json", "--against", here]);
    let said: Value = serde_json::from_slice(&json.stdout).unwrap();
    assert_eq!(
        (said["checked"].as_u64(), said["hold_on_no_rung"].as_u64()),
        (Some(1), Some(1)),
        "{said}"
    );
    assert!(!json.stdout.contains(&0x1b));
}

/// Names from foreign files neither leave their folder nor reach the terminal as they are.
#[test]
fn names_in_manifests_are_names() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = folder.path().join("expected.json");
    let path = manifest.to_str().unwrap();
    assert!(
        figure("fig1", &["--quiet", "--out", folder.path().to_str().unwrap()]).status.success()
    );
    let record: Value =
        serde_json::from_slice(&fs::read(folder.path().join("fig1/fig1.json")).unwrap()).unwrap();
    let whole = serde_json::json!({
        "version": twofold::record::manifest::VERSION, "figure": "fig1", "made_by": "0",
            "pictures": [record["hashes"]],
    });
    let committed = serde_json::to_string_pretty(&whole).unwrap();
    fs::write(&manifest, &committed).unwrap();
    refuses(&twofold(&["check", "--quiet", "--against", path]), 0, &["all the same"]);
    for bad in ["../../fig1", "fig1\\u001b[2J", "/etc/passwd", ""] {
        fs::write(
            &manifest,
            committed.replace("\"name\": \"fig1\"", &format!("\"name\": \"{bad}\"")),
        )
        .unwrap();
        let output = twofold(&["check", "--quiet", "--against", path]);
        refuses(&output, 2, &["expected.json", "a name has letters"]);
        assert!(!output.stderr.contains(&0x1b));
    }
    // Not only names: a hash is 64 digits, and an unknown field's name is printed harmlessly.
    let hash = committed.split("\"png\": \"").nth(1).unwrap().split('"').next().unwrap();
    fs::write(&manifest, committed.replace(hash, "0123")).unwrap();
    refuses(
        &twofold(&["check", "--quiet", "--against", path]),
        2,
        &["expected.json", "not a SHA-256"],
    );
    fs::write(&manifest, committed.replace("\"png\"", "\"\\u001b[2Jpng\"")).unwrap();
    let output = twofold(&["check", "--quiet", "--against", path]);
    refuses(&output, 2, &["expected.json", "[2Jpng"]);
    assert!(!output.stderr.contains(&0x1b));
}

#[test]
fn what_was_found_can_be_read_by_programs() {
    let json = |arguments: &[&str]| -> Value {
        let output = twofold(arguments);
        assert_eq!(output.status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
        serde_json::from_slice(&output.stdout).unwrap()
    };
    let folder = tempfile::tempdir().unwrap();
    let here = folder.path().to_str().unwrap();
    // Without a reference, so that this does not wait for a blessing.
    let check = twofold(&["check", "fig1", "--quiet", "--json", "--expected", here]);
    assert_eq!(check.status.code(), Some(1));
    let check: Value = serde_json::from_slice(&check.stdout).unwrap();
    assert_eq!(
        (&check["all_the_same"], &check["findings"][0]["state"]),
        (&false.into(), &"missing-reference".into())
    );
    let sweep = json(&["sweep", "--runs", "2", "--t-end", "50", "--quiet", "--json"]);
    assert_eq!(
        (&sweep["finished"], sweep["rows"].as_array().unwrap().len()),
        (&2.into(), 2),
        "{sweep}"
    );
    assert_eq!(sweep["spec"]["t_end"], 50.0);
    assert!(figure("fig1", &["--quiet", "--out", here]).status.success());
    let report = json(&["report", "--figures", here, "--expected", here, "--json"]);
    assert_eq!(
        (&report["summary"]["pictures"], &report["problems"]),
        (&1.into(), &Value::Array(vec![])),
        "{report}"
    );
}

/// Help and version are output as any other: a full device is exit code 2.
#[test]
#[cfg(target_os = "linux")]
fn help_that_cannot_be_written_is_an_error() {
    for argument in ["help", "--version"] {
        let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
        let program = env!("CARGO_BIN_EXE_twofold");
        let output = std::process::Command::new(program)
            .arg(argument)
            .stdout(full)
            .stderr(std::process::Stdio::piped())
            .output();
        let output = output.unwrap();
        let said = String::from_utf8(output.stderr).unwrap();
        assert!(
            output.status.code() == Some(2) && said.starts_with("error: "),
            "{argument}: {said}"
        );
    }
}

#[test]
fn help_fits_a_terminal_and_has_its_companions() {
    let text = |arguments: &[&str]| {
        let output = Command::cargo_bin("twofold")
            .unwrap()
            .args(arguments)
            .env("COLUMNS", "80")
            .output()
            .unwrap();
        assert!(output.status.success());
        String::from_utf8(output.stdout).unwrap()
    };
    for arguments in [vec!["run", "--help"], vec!["figure", "--help"], vec!["-h"]] {
        // Examples are for copying and keep their lines.
        for line in text(&arguments)
            .lines()
            .filter(|l| !l.trim_start().starts_with("twofold") && !l.contains(" | "))
        {
            assert!(line.chars().count() <= 100, "{line}");
        }
    }
    let version = text(&["--version"]);
    for word in [env!("CARGO_PKG_VERSION"), "commit ", "compiler rustc 1.", "target "] {
        assert!(version.contains(word), "{version}");
    }
    assert_eq!(text(&["-V"]), format!("twofold {}\n", env!("CARGO_PKG_VERSION")));
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(text(&["completions", shell]).contains("plus-probability"), "{shell}");
    }
    let folder = tempfile::tempdir().unwrap();
    text(&["man", folder.path().to_str().unwrap()]);
    let pages = files(folder.path());
    assert!(
        pages.contains(&"twofold.1".into()) && pages.contains(&"twofold-run.1".into()),
        "{pages:?}"
    );
    let page = fs::read_to_string(folder.path().join("twofold-run.1")).unwrap();
    assert!(page.contains("funnel") && page.contains("Exit") | page.contains("EXTRA"), "{page}");
}

#[test]
fn specs_round_trip_and_wrong_ones_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let spec = folder.path().join("spec.json");
    let flags = [
        "--reading",
        "reconstructed",
        "--t-end",
        "20",
        "--kick-every",
        "0.3",
        "--section",
        "y=0",
        "--quiet",
    ];
    let direct = twofold(&[&["run"], &flags[..]].concat());
    assert!(direct.status.success());
    let printed = twofold(&[&["run", "--print-spec"], &flags[..]].concat());
    fs::write(&spec, &printed.stdout).unwrap();
    let path = spec.to_str().unwrap();
    let again = twofold(&["run", "--quiet", "--spec", path]);
    assert_eq!(String::from_utf8_lossy(&direct.stdout), String::from_utf8_lossy(&again.stdout));
    assert!(String::from_utf8_lossy(&direct.stdout).contains("t,x,y,z,direction\n"));

    refuses(&twofold(&["run", "--spec", path, "--eps", "1"]), 2, &["--spec", "--eps"]);
    fs::write(&spec, "not json").unwrap();
    refuses(&twofold(&["run", "--quiet", "--spec", path]), 2, &["spec.json", "not a spec"]);
    let wrong = String::from_utf8(printed.stdout).unwrap().replace("\"t_end\"", "\"t_ende\"");
    fs::write(&spec, wrong).unwrap();
    refuses(&twofold(&["run", "--quiet", "--spec", path]), 2, &["t_ende"]);
    refuses(
        &twofold(&["run", "--quiet", "--spec", "/nowhere/spec.json"]),
        2,
        &["/nowhere/spec.json"],
    );
}

#[test]
fn manifests_are_checked_before_anything_is_computed() {
    let folder = tempfile::tempdir().unwrap();
    let manifest = folder.path().join("expected.json");
    let path = manifest.to_str().unwrap();
    fs::write(&manifest, "PNG").unwrap();
    refuses(
        &twofold(&["check", "--quiet", "--against", path]),
        2,
        &["expected.json", "not a manifest"],
    );
    fs::write(&manifest, "{\"version\": 99}").unwrap();
    refuses(&twofold(&["check", "--quiet", "--against", path]), 2, &["version 99"]);
    let version = twofold::record::manifest::VERSION;
    let text =
        format!("{{\"version\":{version},\"figure\":\"fig77\",\"made_by\":\"0\",\"pictures\":[]}}");
    fs::write(&manifest, text).unwrap();
    refuses(&twofold(&["check", "--quiet", "--against", path]), 2, &["fig77"]);
    refuses(&twofold(&["check", "--quiet", "fig77"]), 2, &["fig77", "fig7"]);
}

#[test]
fn a_missing_reference_is_a_failed_check() {
    let folder = tempfile::tempdir().unwrap();
    let output =
        twofold(&["check", "--quiet", "fig7", "--expected", folder.path().to_str().unwrap()]);
    refuses(&output, 1, &["fig7: MISSING REFERENCE", "expected.json"]);
}

#[test]
fn blessing_needs_a_reason() {
    refuses(&twofold(&["bless", "--reason", " "]), 2, &["--reason"]);
    refuses(&twofold(&["bless"]), 2, &["--reason"]);
}

fn figure(name: &str, arguments: &[&str]) -> Output {
    let mut command = Command::cargo_bin("twofold").unwrap();
    command.args(["figure", name, "--fresh"]).args(arguments).timeout(AT_ONCE).output().unwrap()
}

#[test]
fn figure_binaries_refuse_the_same_way() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    refuses(&figure("fig7", &["--quiet", "--out", out, "--only", "iv"]), 2, &["iv", "i, ii, iii"]);
    refuses(&figure("fig7", &["--quiet", "--out", out, "--t-end", "0"]), 2, &["--t-end"]);
    refuses(
        &figure("fig7", &["--quiet", "--out", out, "--reading", "other"]),
        2,
        &["printed", "reconstructed", "all"],
    );
    // Flags without effect: on figures made in one piece, without readings, without chance.
    for (name, flags) in [
        ("fig1", ["--only", "i"]),
        ("fig1", ["--method", "dopri5"]),
        ("digits", ["--t-end", "5"]),
        ("fig1", ["--reading", "printed"]),
        ("fig3", ["--reading", "printed"]),
        ("fig7", ["--seed", "5"]),
        ("lottery", ["--seed", "5"]),
    ] {
        refuses(
            &figure(name, &[&["--quiet", "--out", out], &flags[..]].concat()),
            2,
            &[flags[0], "no effect", name],
        );
    }
    let still = ["--quiet", "--out", out, "--only", "i", "--seed", "5"];
    refuses(&figure("fig9", &still), 2, &["--seed", "random"]);
    refuses(&twofold(&["figure", "fig1", "--print-spec"]), 2, &["--print-spec", "no effect"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written on bad usage");
    let blocker = folder.path().join("file");
    fs::write(&blocker, "").unwrap();
    let output = figure(
        "fig6",
        &["--quiet", "--out", blocker.to_str().unwrap(), "--t-end", "1", "--only", "i"],
    );
    refuses(&output, 2, &["file", "--out"]);
}

#[test]
fn a_shortened_picture_has_another_name_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().to_str().unwrap();
    let output = figure(
        "fig7",
        &[
            "--quiet",
            "--json",
            "--out",
            out,
            "--t-end",
            "50",
            "--reading",
            "printed",
            "--only",
            "(ii)",
        ],
    );
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let records: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    let record = &records[0];
    assert_eq!(record["hashes"]["name"], "fig7-printed-only-ii-shortened");
    assert!(record["alterations"][1].as_str().unwrap().contains("t = 50 instead of 200000"));
    let names: Vec<String> = files(&folder.path().join("fig7"));
    let expected = ["-ii.csv", ".json", ".pdf", ".png", ".svg"]
        .map(|s| format!("fig7-printed-only-ii-shortened{s}"));
    assert_eq!(names, expected);
}

/// Whether a file of a figure is whole, as far as its end tells.
fn is_whole(path: &Path) -> bool {
    let bytes = fs::read(path).unwrap();
    match path.extension().unwrap().to_str().unwrap() {
        "png" => bytes.ends_with(b"IEND\xaeB`\x82"),
        "svg" => bytes.ends_with(b"</svg>\n") || bytes.ends_with(b"</svg>"),
        "pdf" => bytes.trim_ascii_end().ends_with(b"%%EOF"),
        _ => bytes.ends_with(b"\n"),
    }
}

/// Killed without warning: whole files only. What a kill between two instructions leaves, the next
/// run sweeps away. (`make torture` kills at many random moments.)
#[test]
fn a_killed_run_leaves_only_whole_files() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("fig7");
    let mut made = short_fig7(folder.path(), "1000");
    wait_until("the first file", || files(&out).iter().any(|n| !n.starts_with('.')));
    made.child().kill().unwrap();
    made.output();
    let left: Vec<PathBuf> =
        files(&out).iter().filter(|n| !n.starts_with('.')).map(|n| out.join(n)).collect();
    assert!(!left.is_empty());
    assert!(left.iter().all(|f| is_whole(f)), "{left:?}");
    // As if it had been killed in the middle of a write; and a file of that kind that a living
    // process writes.
    fs::write(out.join(".twofold-aaaaaa.tmp"), "half").unwrap();
    let mut living = fs::File::create(out.join(".twofold-bbbbbb.tmp")).unwrap();
    living.write_all(b"half").unwrap();
    living.lock().unwrap();
    let again = short_fig7(folder.path(), "30").output();
    assert!(again.status.success(), "{}", String::from_utf8_lossy(&again.stderr));
    let hidden: Vec<String> = files(&out).into_iter().filter(|n| n.starts_with('.')).collect();
    assert_eq!(hidden, [".twofold-bbbbbb.tmp"]);
}

fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> = fs::read_dir(folder)
        .map(|entries| entries.map(|e| e.unwrap().file_name().into_string().unwrap()).collect())
        .unwrap_or_default();
    names.sort();
    names
}
