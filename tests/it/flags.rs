//! No flag is ever ignored silently, looked at from outside: every command with each of its own
//! flags. Either the flag is refused by name, or something comes out otherwise: a stream, an exit
//! code, a file. The flags that describe a run, which eight commands share, have a test of their
//! own on every kind of run (src/cli/flags.rs).

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;

use assert_cmd::Command;

/// Result of a call.
#[derive(Debug, PartialEq, Eq)]
struct Outcome {
    code: Option<i32>,
    stdout: Vec<u8>,
    /// Without digits: times differ from call to call.
    stderr: String,
    files: BTreeMap<String, Vec<u8>>,
}

fn call(folder: &Path, arguments: &[String]) -> Outcome {
    let output = Command::cargo_bin("twofold")
        .unwrap()
        .current_dir(folder)
        .args(arguments)
        .output()
        .unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    Outcome {
        code: output.status.code(),
        stdout: output.stdout,
        stderr: stderr.chars().filter(|c| !c.is_ascii_digit() && *c != '.').collect(),
        files: files(folder, folder),
    }
}

fn files(root: &Path, folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            found.extend(files(root, &path));
        } else if !path.ends_with("making.json") {
            // making.json holds times.
            found.insert(
                path.strip_prefix(root).unwrap().display().to_string(),
                fs::read(&path).unwrap(),
            );
        }
    }
    found
}

fn words(text: &str) -> Vec<String> {
    let repository = env!("CARGO_MANIFEST_DIR");
    text.split_whitespace().map(|w| w.replace("REPOSITORY", repository)).collect()
}

/// Commands to run before, the call, and flags to be added to it one at a time ("--flag value").
const TABLE: &[(&str, &str, &[&str])] = &[
    (
        "",
        "run --system stick-slip --t-end 3",
        &["--print-spec", "--format json", "--out run.csv", "--quiet", "--spec nowhere.json"],
    ),
    ("", "run --system stick-slip --t-end 1", &["--horizon", "--horizon --method taylor-extended"]),
    (
        "run --system stick-slip --t-end 3 --out run.csv",
        "plot --system stick-slip --t-end 3 --out p.png",
        &[
            "--kind series",
            "--searchable",
            "--kind space",
            "--axes v,x",
            "--axes x,y,z",
            "--camera 10,20",
            "--title Stick",
            "--format svg",
            "--out q.png",
            "--quiet",
            "--from run.csv",
            "--spec nowhere.json",
        ],
    ),
    (
        "run --system chua --t-end 3 --out run.csv",
        "plot --from run.csv --out p.svg",
        &[
            "--kind plane",
            "--camera 10,20",
            "--title Path",
            "--axes x,y",
            "--t-end 4",
            "--eps 0.1",
            "--searchable",
            "--quiet",
            "--format pdf",
        ],
    ),
    (
        "",
        "orbit --system stick-slip --switch filippov --section v=0",
        &[
            "--downward",
            "--returns 2",
            "--settle 0",
            "--period 1",
            "--longest-return 0.1",
            "--along belt=0.3..0.32:2",
            "--format json",
            "--format csv",
            "--out orbit.json",
            "--quiet",
            "--spec nowhere.json",
        ],
    ),
    (
        "",
        "rests --system chua --within x=-3..3",
        &[
            "--system wheel",
            "--set alpha=8",
            "--within q=0..1",
            "--format json",
            "--out r.txt",
            "--quiet",
        ],
    ),
    (
        "",
        "lyapunov --system chua --t-end 20",
        &["--transient 5", "--format json", "--out l.json", "--quiet", "--spec nowhere.json"],
    ),
    (
        "",
        "sweep --system impact-oscillator --over params.r=0.7,0.8 --t-end 5",
        &["--period 2.243994752564138", "--section x=0.1"],
    ),
    (
        "",
        "scan --system stick-slip --section x=0.5 --over params.belt=0.3,0.4 --t-end 20 --out \
            d.csv",
        &[
            "--plot p.png",
            "--show v",
            "--alike 0.5",
            "--threads 2000",
            "--out e.csv",
            "--over params.friction=1,2",
            "--quiet",
            "--spec nowhere.json",
        ],
    ),
    (
        "",
        "scan --system stick-slip --section x=0.5 --over params.belt=0.3,0.4 --t-end 20 --plot \
            p.png",
        &["--show x", "--alike 0.5"],
    ),
    (
        "",
        "scan --system chua --section y=0 --over params.alpha=8,8.5 --t-end 30 --plot p.png",
        &["--show z"],
    ),
    (
        "",
        "scan --system chua --section y=0 --over params.alpha=8,8.5 --t-end 30",
        &["--follow down", "--period 1"],
    ),
    (
        "",
        "scan --system impact-oscillator --period 2.243994752564138 --over params.r=0.7,0.8 \
            --t-end 60",
        &["--period 4.487989505128276", "--follow up"],
    ),
    (
        "",
        "sensitivities --system bouncing-ball --t-end 1",
        &["--by r", "--format json", "--out s.csv", "--quiet", "--spec nowhere.json"],
    ),
    (
        "",
        "scan --system stick-slip --section x=0.5 --over params.belt=0.3,0.4 --over \
            params.friction=1,2 --t-end 20 --plot p.png",
        &["--show v", "--alike 0.5"],
    ),
    ("", "new a.toml", &["--from chua", "--list"]),
    ("new a.toml", "new a.toml", &["--force"]),
    ("", "new --list", &["--from chua", "--force"]),
    (
        "",
        "figure fig1 --out o",
        &[
            "--fresh",
            "--store s",
            "--reading printed",
            "--only i",
            "--threads 2000",
            "--seed 3",
            "--t-end 5",
            "--method radau5",
            "--json",
            "--quiet",
            "--print-spec",
            "--late",
            "--recompute",
            "--out p",
        ],
    ),
    (
        "",
        "figure fig7 --t-end 30 --fresh --out o",
        &["--late", "--recompute", "--print-spec --late"],
    ),
    (
        "",
        "figure fig5 --t-end 2 --fresh --out o",
        &[
            "--reading printed",
            "--only i",
            "--only iii",
            "--seed 3",
            "--method radau5",
            "--store s",
            "--print-spec",
            "--json",
            "--quiet",
        ],
    ),
    (
        "",
        "sweep --t-end 30 --over params.alpha=0.1,0.2 --out s.csv",
        &[
            "--random 1",
            "--random-seed 4",
            "--runs 3",
            "--shift 1e-9",
            "--shard 1/2",
            "--recheck 2",
            "--threads 2000",
            "--json",
            "--quiet",
            "--out t.csv",
            "--over params.beta=1e-5,1e-4",
            "--spec nowhere.json",
        ],
    ),
    (
        "",
        "sweep --t-end 30 --over params.alpha=0.1..0.2 --random 2 --out s.csv",
        &["--random-seed 4", "--resume"],
    ),
    (
        "sweep --t-end 30 --over params.alpha=0.1,0.2 --out s.csv",
        "sweep --t-end 30 --over params.alpha=0.1,0.2 --out s.csv",
        &["--resume"],
    ),
    ("", "sweep --t-end 30 --runs 2", &["--shift 2e-9", "--resume", "--runs 3"]),
    (
        "",
        "check fig1",
        &["--json", "--quiet", "--threads 2000", "--expected nowhere", "--against nowhere.json"],
    ),
    (
        "figure fig1 --fresh --out made",
        "check fig1 --against made",
        &["--json", "--quiet", "--threads 2000", "--expected nowhere"],
    ),
    (
        "sweep --t-end 30 --runs 12 --out s.csv",
        "audit s.csv --rows 1",
        &["--all", "--rows 2", "--seed 3 --json", "--threads 2000"],
    ),
    (
        // So many rows that the time left is said now and then.
        "sweep --t-end 1e5 --runs 6 --out s.csv",
        "audit s.csv --all --threads 1",
        &["--quiet"],
    ),
    (
        "",
        "bless fig1",
        &[
            "--reason why",
            "--json --quiet --reason=",
            "--threads 2000 --reason why",
            "--expected nowhere --reason why",
        ],
    ),
    (
        "figure fig1 --fresh --out made",
        "report --figures made",
        &["--expected nowhere", "--out page.html", "--json", "--figures nowhere"],
    ),
    (
        "figure fig1 --fresh --out made",
        "inspect made/fig1/fig1.png",
        &["--json", "--expected nowhere"],
    ),
    ("", "verify REPOSITORY/proofs/certificates/printed-cycle.json", &["--json"]),
    (
        "figure fig1 --store s --out made",
        "store --store s",
        &["--clear", "--prune", "--store nowhere"],
    ),
];

/// Flags that promise what is so anyway in a case where nothing else can be seen: given there, they
/// are neither refused nor ignored.
const KEPT_PROMISES: &[(&str, &str)] = &[
    ("rests --system chua --within x=-3..3", "--quiet"), // done before progress would be shown
    ("sensitivities --system bouncing-ball --t-end 1", "--quiet"),
    (
        "plot --from run.csv --out \
        p.svg",
        "--quiet",
    ), // nothing is computed, so there is no progress to keep quiet about
];

#[test]
fn no_flag_is_ignored_on_any_command() {
    let mut ignored = Vec::new();
    let mut tried = 0;
    for (before, base, flags) in TABLE {
        let outcome = |flag: &str| {
            let folder = tempfile::tempdir().unwrap();
            if !before.is_empty() {
                let prepared = call(folder.path(), &words(before));
                assert_eq!(prepared.code, Some(0), "{before}: {}", prepared.stderr);
            }
            // A flag given once more takes the place of the first.
            let name = flag.split_whitespace().next().unwrap_or_default();
            let mut arguments = words(base);
            if let Some(at) = arguments.iter().position(|a| a == name).filter(|_| name != "--over")
            {
                arguments.drain(at..at + 2);
            }
            arguments.extend(words(flag));
            call(folder.path(), &arguments)
        };
        let plain = outcome("");
        for flag in *flags {
            tried += 1;
            let name = flag.split_whitespace().next().unwrap();
            let with = outcome(flag);
            let refused =
                with.code == Some(2) && (with.stderr.contains(name) || with.stderr != plain.stderr);
            if !refused && with == plain && !KEPT_PROMISES.contains(&(base, name)) {
                ignored.push(format!("twofold {base} {flag}"));
            }
        }
    }
    assert!(ignored.is_empty(), "accepted without effect:\n{}", ignored.join("\n"));
    assert!(tried > 100, "{tried}");
}

/// The table has every flag of every command that is not one of those that describe a run.
#[test]
fn the_table_knows_every_command_and_flag() {
    let folder = tempfile::tempdir().unwrap();
    let help = |command: &[&str]| {
        let arguments: Vec<String> =
            command.iter().chain(&["--help"]).map(|s| (*s).to_owned()).collect();
        String::from_utf8(call(folder.path(), &arguments).stdout).unwrap()
    };
    let flags = |text: &str| -> BTreeSet<String> {
        text.lines()
            .filter_map(|line| {
                let at = line.trim_start();
                let at = at.strip_prefix("-h, ").or(at.strip_prefix("-V, ")).unwrap_or(at);
                at.starts_with("--").then(|| at.split([' ', '=', ',']).next().unwrap().to_owned())
            })
            .filter(|flag| !["--help", "--version"].contains(&flag.as_str()))
            .collect()
    };
    let commands: Vec<String> = help(&[])
        .lines()
        .skip_while(|l| *l != "Systems:")
        .take_while(|l| !l.starts_with("  -h,"))
        .filter(|l| l.starts_with("  "))
        .filter_map(|l| l.split_whitespace().next().map(str::to_owned))
        .filter(|c| c != "help")
        .collect();
    assert!(commands.len() >= 15, "{commands:?}");
    // The flags that `lyapunov` and `scan` share are those of runs: `run` has them too.
    let of = |command: &str| flags(&help(&[command]));
    let shared: BTreeSet<String> = of("lyapunov")
        .intersection(&of("scan"))
        .filter(|f| !["--spec", "--out", "--quiet"].contains(&f.as_str()))
        .cloned()
        .collect();
    assert!(shared.len() > 25, "{shared:?}");
    for command in &commands {
        let tabled: BTreeSet<String> = TABLE
            .iter()
            .filter(|(_, base, _)| base.split_whitespace().next() == Some(command))
            .flat_map(|(_, _, flags)| flags.iter().flat_map(|f| f.split_whitespace()))
            .filter(|word| word.starts_with("--"))
            .map(|word| word.split('=').next().unwrap().to_owned())
            .collect();
        let missing: Vec<String> = of(command)
            .into_iter()
            .filter(|flag| !shared.contains(flag) && !tabled.contains(flag))
            .collect();
        assert!(missing.is_empty(), "twofold {command}: no row tries {missing:?}");
    }
}
