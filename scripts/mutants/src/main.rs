//! Mutation testing with every mutant in one build: mutant schemata (Untch, Offutt, Harrold 1993). See docs/mutants.md.
//!
//! `mutants --rooms record,compare --scratch DIR [--jobs 1] [--slow 5] [--user 65534] [--only TEXT] [--tests units,NAME,...] [--keep ROOMS] [--units ROOMS] [--among FILE]`, from the package's root.

mod schema;

use std::collections::{BTreeMap, BTreeSet, HashMap};
use std::fs;
use std::hash::{Hash, Hasher};
use std::io::{Read, Write};
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::{Duration, Instant};

use schema::{File, Mutant};
use serde_json::{Value, json};

type Failure = Box<dyn std::error::Error>;

struct Options {
    rooms: Vec<String>,
    scratch: PathBuf,
    jobs: usize,
    /// Tests that took longer than this, in seconds, are left for a later call.
    slow: f64,
    /// The user that tests run as: a mutant of code that writes files must not run as root.
    user: Option<u32>,
    /// Only mutants whose name contains this.
    only: String,
    /// The library's own unit tests and these programs of `tests`; `None`: all tests.
    programs: Option<Vec<String>>,
    /// With only these rooms in the library, if any are named: what stands above them is not built, and its tests are not run.
    keep: Vec<String>,
    /// Of the library's unit tests only those of these rooms, if any are named.
    units: Vec<String>,
    /// Only the mutants that this file lists, a line each (or a source file for all of its own), as `left.txt` does: what other tests left, to be tried on more tests. The others are not built.
    among: Option<PathBuf>,
    /// The library's unit tests as an earlier call built them, to go on without building: nothing that is mutated may have changed since.
    built: Option<PathBuf>,
}

fn options() -> Result<Options, Failure> {
    let mut options = Options {
        rooms: Vec::new(),
        scratch: "target/mutants".into(),
        jobs: 1,
        slow: 5.0,
        user: None,
        only: String::new(),
        programs: None,
        keep: Vec::new(),
        units: Vec::new(),
        among: None,
        built: None,
    };
    let list =
        |text: &str| text.split([',', ' ']).filter(|r| !r.is_empty()).map(str::to_owned).collect::<Vec<String>>();
    let mut arguments = std::env::args().skip(1);
    while let Some(flag) = arguments.next() {
        let value = arguments.next().ok_or_else(|| format!("{flag} needs a value"))?;
        match flag.as_str() {
            "--rooms" => options.rooms = list(&value),
            "--keep" => options.keep = list(&value),
            "--units" => options.units = list(&value),
            "--among" => options.among = Some(value.into()),
            "--built" => options.built = Some(PathBuf::from(value).canonicalize()?),
            "--scratch" => options.scratch = value.into(),
            "--jobs" => options.jobs = value.parse()?,
            "--slow" => options.slow = value.parse()?,
            "--user" => options.user = Some(value.parse()?),
            "--only" => options.only = value,
            "--tests" => {
                options.programs =
                    (value != "all").then(|| list(&value).into_iter().filter(|p| p != "units").collect());
            }
            _ => return Err(format!("unknown flag {flag}").into()),
        }
    }
    if options.rooms.is_empty() {
        return Err("--rooms says which folders of src to mutate".into());
    }
    fs::create_dir_all(&options.scratch)?;
    options.scratch = options.scratch.canonicalize()?;
    Ok(options)
}

/// A test, and what it reached.
#[derive(Clone)]
struct Test {
    program: String,
    name: String,
    seconds: f64,
    reached: BTreeSet<usize>,
    /// Whether it, or the file it stands in, is new since the last call.
    new: bool,
}

/// The outcome of one mutant.
#[derive(Clone)]
struct Outcome {
    /// "caught", "timeout", "survived", "not reached".
    state: String,
    by: String,
    /// Tests up to this many seconds were run.
    slow: f64,
    runs: usize,
}

fn main() -> Result<(), Failure> {
    let options = options()?;
    let tree = options.scratch.join("tree");
    let state = options.scratch.join(format!("state-{}", options.rooms.join("-").replace('/', "_")));
    fs::create_dir_all(&state)?;

    let mut files: Vec<(String, File)> = Vec::new();
    for path in copy(&tree, &options)? {
        let inside =
            options.rooms.iter().any(|r| path.starts_with(&format!("src/{r}/")) || path == format!("src/{r}.rs"));
        if inside && path.ends_with(".rs") {
            files.push((
                path.clone(),
                File::scan(&path, fs::read_to_string(&path)?).map_err(|e| format!("{path}: {e}"))?,
            ));
        }
    }
    let tests: BTreeSet<String> = files
        .iter()
        .flat_map(|(path, file)| {
            let folder = path.trim_end_matches("/mod.rs").trim_end_matches(".rs");
            file.tests.iter().map(move |name| format!("{folder}/{name}.rs"))
        })
        .collect();
    files.retain(|(path, _)| !tests.contains(path));
    let mut offsets = Vec::new();
    let mut mutants: Vec<Mutant> = Vec::new();
    for (_, file) in &files {
        offsets.push(mutants.len());
        mutants.extend(file.mutants.iter().cloned());
    }
    let keys: Vec<String> = mutants.iter().map(Mutant::key).collect();
    let unasked = unasked(options.among.as_deref(), &keys)?;
    println!("{} mutants in {} files", mutants.len() - unasked.len(), files.len());

    let (mut dropped, programs) = match &options.built {
        Some(program) => (known(&state, &keys), BTreeMap::from([("lib".to_owned(), program.clone())])),
        None => (compile(&options, &tree, &state, &files, &offsets, &keys, &unasked)?, build(&options, &tree)?),
    };
    println!("{} do not compile", dropped.len());
    dropped.extend(&unasked);
    let tests = reach(&options, &tree, &state, &programs, &keys, &dropped)?;
    run(&options, &tree, &state, &mutants, &keys, &dropped, &unasked, &programs, &tests)
}

/// Copies every tracked file that changed; returns their paths.
fn copy(tree: &Path, options: &Options) -> Result<Vec<String>, Failure> {
    let keep = &options.keep;
    let listed = Command::new("git").args(["ls-files", "-z", "--cached", "--others", "--exclude-standard"]).output()?;
    let paths: Vec<String> =
        String::from_utf8(listed.stdout)?.split('\0').filter(|p| !p.is_empty()).map(str::to_owned).collect();
    for path in &paths {
        // Mutated files are written by `write` alone, so that unchanged ones keep their times.
        if !path.starts_with("src/") && options.built.is_none() {
            let mut bytes = fs::read(path).unwrap_or_default();
            // The programs need all rooms; and tests in `tests` would have them built.
            if path == "Cargo.toml" && !keep.is_empty() {
                let text = String::from_utf8(bytes)?;
                let parts = text.split("\n[[bin]]\n").enumerate();
                bytes = parts
                    .map(|(i, p)| if i == 0 { p } else { p.find("\n[").map_or("", |at| &p[at..]) })
                    .collect::<String>()
                    .into();
            }
            place(&tree.join(path), &bytes)?;
        }
    }
    Ok(paths)
}

fn place(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    if fs::read(path).is_ok_and(|old| old == bytes) {
        return Ok(());
    }
    fs::create_dir_all(path.parent().ok_or("no folder")?)?;
    fs::write(path, bytes)?;
    if let Some(source) = path.to_str().and_then(|p| p.split_once("/tree/")).map(|(_, p)| p)
        && let Ok(of) = fs::metadata(source)
    {
        fs::set_permissions(path, of.permissions())?;
    }
    Ok(())
}

/// Writes all sources, mutated where they are to be.
fn write(
    tree: &Path,
    keep: &[String],
    files: &[(String, File)],
    offsets: &[usize],
    dropped: &BTreeSet<usize>,
) -> Result<(), Failure> {
    let listed =
        Command::new("git").args(["ls-files", "-z", "--cached", "--others", "--exclude-standard", "src"]).output()?;
    for path in String::from_utf8(listed.stdout)?.split('\0').filter(|p| !p.is_empty()) {
        let bytes = match files.iter().position(|(p, _)| p == path) {
            Some(i) => {
                let (offset, count) = (offsets[i], files[i].1.mutants.len());
                let local = dropped.range(offset..offset + count).map(|m| m - offset).collect();
                files[i].1.render(offset, &local).into_bytes()
            }
            None if path == "src/lib.rs" => library(&fs::read_to_string(path)?, keep).into_bytes(),
            None => fs::read(path).unwrap_or_default(),
        };
        place(&tree.join(path), &bytes)?;
    }
    let count: usize = files.iter().map(|(_, f)| f.mutants.len()).sum();
    let runtime =
        include_str!("runtime.rs").replace("const COUNT: usize = 0;", &format!("const COUNT: usize = {count};"));
    place(&tree.join("src/mutation.rs"), runtime.as_bytes())
}

/// The root of the library with the module that says which mutant is on, and without the rooms that are not kept.
fn library(text: &str, keep: &[String]) -> String {
    let mut lines: Vec<&str> = Vec::new();
    for line in text.lines() {
        if let Some(room) = line.strip_prefix("pub mod ").and_then(|l| l.strip_suffix(';'))
            && !keep.is_empty()
            && !keep.iter().any(|k| k == room)
        {
            if lines.last().is_some_and(|l| l.starts_with("#[cfg")) {
                lines.pop();
            }
            continue;
        }
        lines.push(line);
    }
    let text = lines.join("\n");
    let text = text.replacen("#![forbid(unsafe_code)]", "#![forbid(unsafe_code)]\n#![allow(warnings)]", 1);
    format!("{text}\n\npub mod mutation;\n")
}

fn cargo(options: &Options, tree: &Path, arguments: &[&str]) -> Result<Vec<Value>, Failure> {
    let out = Command::new("cargo")
        .args(arguments)
        .arg("--message-format=json")
        .arg(format!("-j{}", options.jobs))
        .current_dir(tree)
        .env("CARGO_TARGET_DIR", options.scratch.join("target"))
        .stderr(Stdio::inherit())
        .output()?;
    Ok(String::from_utf8_lossy(&out.stdout).lines().filter_map(|l| serde_json::from_str(l).ok()).collect())
}

/// The mutants that did not compile in an earlier call.
fn known(state: &Path, keys: &[String]) -> BTreeSet<usize> {
    let text = fs::read_to_string(state.join("not-viable.txt")).unwrap_or_default();
    let known: BTreeSet<&str> = text.lines().collect();
    (0..keys.len()).filter(|m| known.contains(keys[*m].as_str())).collect()
}

/// The mutants that a list of those asked for does not name.
fn unasked(list: Option<&Path>, keys: &[String]) -> Result<BTreeSet<usize>, Failure> {
    let Some(list) = list else { return Ok(BTreeSet::new()) };
    let text = fs::read_to_string(list).map_err(|e| format!("{}: {e}", list.display()))?;
    // "survived: KEY" as the tool writes it, "KEY  # survived" as the lists in `left` do.
    let named: BTreeSet<&str> = text
        .lines()
        .filter_map(|l| l.find("src/").map(|at| l[at..].split("  # ").next().unwrap_or_default().trim_end()))
        .collect();
    let file = |key: &str| key.split(':').next().unwrap_or_default().to_owned();
    let strange: Vec<&str> =
        named.iter().filter(|n| !keys.iter().any(|k| k == *n || file(k) == **n)).copied().collect();
    if !strange.is_empty() {
        println!("{} lines of the list name no mutant of these rooms, the first: {}", strange.len(), strange[0]);
    }
    let asked = |key: &String| named.contains(key.as_str()) || named.contains(file(key).as_str());
    Ok((0..keys.len()).filter(|m| !asked(&keys[*m])).collect())
}

/// Compiles, leaves out the mutants that rustc complains about, and compiles again until it is content.
fn compile(
    options: &Options,
    tree: &Path,
    state: &Path,
    files: &[(String, File)],
    offsets: &[usize],
    keys: &[String],
    unasked: &BTreeSet<usize>,
) -> Result<BTreeSet<usize>, Failure> {
    let kept = state.join("not-viable.txt");
    let mut dropped = known(state, keys);
    for round in 0.. {
        write(tree, &options.keep, files, offsets, &dropped.union(unasked).copied().collect())?;
        let messages = cargo(options, tree, &["check", "--lib"])?;
        let mut errors = 0;
        let mut now = BTreeSet::new();
        let mut lost = Vec::new();
        for message in &messages {
            let message = &message["message"];
            if message["level"] != "error" || message["spans"].as_array().is_none_or(Vec::is_empty) {
                continue;
            }
            errors += 1;
            let before = now.len();
            blame(tree, message, files, offsets, &mut now);
            if now.len() == before {
                lost.push(message["rendered"].as_str().unwrap_or_default().to_owned());
            }
        }
        let fresh = now.difference(&dropped).count();
        println!("round {round}: {errors} errors, {fresh} more mutants left out");
        dropped.extend(now);
        let text: String = dropped.iter().map(|m| format!("{}\n", keys[*m])).collect();
        fs::write(&kept, text)?;
        if errors == 0 {
            return Ok(dropped);
        }
        if fresh == 0 {
            lost.iter().take(10).for_each(|l| println!("{l}"));
            return Err("errors that no mutant is to blame for".into());
        }
    }
    unreachable!()
}

/// The mutants to blame for an error: the alternative that it points into, else the site, else all of the function.
fn blame(tree: &Path, message: &Value, files: &[(String, File)], offsets: &[usize], now: &mut BTreeSet<usize>) {
    let spans = message["spans"].as_array().cloned().unwrap_or_default();
    let mut sorted: Vec<&Value> = spans.iter().collect();
    sorted.sort_by_key(|s| s["is_primary"] != true);
    for function in [false, true] {
        for span in &sorted {
            let name = span["file_name"].as_str().unwrap_or_default();
            let Some(which) = files.iter().position(|(p, _)| p == name) else { continue };
            let text = fs::read_to_string(tree.join(name)).unwrap_or_default();
            let at = span["byte_start"].as_u64().unwrap_or_default() as usize;
            let end = span["byte_end"].as_u64().unwrap_or_default() as usize;
            if let Some(number) = enclosing(&text, at, end, 'm') {
                now.insert(number);
                return;
            }
            let file = &files[which].1;
            if let Some(number) = enclosing(&text, at, end, 's') {
                now.extend(file.of_site(number - offsets[which]).map(|m| m + offsets[which]));
                return;
            }
            if function && span["is_primary"] == true {
                // Everything on the line that the error is in: of a `let` whose type is not known, say.
                let line =
                    text[..at].rfind('\n').map_or(0, |i| i + 1)..text[at..].find('\n').map_or(text.len(), |i| at + i);
                let found: Vec<usize> = markers(&text[line], 's');
                if !found.is_empty() {
                    for number in found {
                        now.extend(file.of_site(number - offsets[which]).map(|m| m + offsets[which]));
                    }
                    return;
                }
            }
        }
    }
}

fn markers(text: &str, letter: char) -> Vec<usize> {
    let open = format!("/*{letter}");
    text.match_indices(&open)
        .filter_map(|(i, _)| text[i + 3..].split_once("(*/").and_then(|(n, _)| n.parse().ok()))
        .collect()
}

/// The innermost marked piece of the text that holds the given bytes.
fn enclosing(text: &str, start: usize, end: usize, letter: char) -> Option<usize> {
    let open = format!("/*{letter}");
    let mut best: Option<(usize, usize)> = None;
    for (i, _) in text[..start.min(text.len())].match_indices(&open) {
        let Some(number) = text[i + 3..].split_once("(*/").and_then(|(n, _)| n.parse::<usize>().ok()) else { continue };
        let close = format!("/*){letter}{number}*/");
        let Some(length) = text[i..].find(&close) else { continue };
        if i + length >= end && best.is_none_or(|(l, _)| length < l) {
            best = Some((length, number));
        }
    }
    best.map(|(_, n)| n)
}

/// Builds all tests; returns the programs by target.
fn build(options: &Options, tree: &Path) -> Result<BTreeMap<String, PathBuf>, Failure> {
    let started = Instant::now();
    let mut arguments = vec!["test", "--no-run", "--lib"];
    match &options.programs {
        Some(programs) => programs.iter().for_each(|p| arguments.extend(["--test", p])),
        None => arguments.extend(["--bins", "--tests"]),
    }
    let messages = cargo(options, tree, &arguments)?;
    let mut programs = BTreeMap::new();
    for message in &messages {
        if let (Some(path), true) = (message["executable"].as_str(), message["profile"]["test"] == true) {
            let kind = message["target"]["kind"][0].as_str().unwrap_or_default();
            let name = if kind == "lib" { "lib" } else { message["target"]["name"].as_str().unwrap_or_default() };
            let name = if kind == "bin" { format!("bin-{name}") } else { name.to_owned() };
            programs.insert(name, PathBuf::from(path));
        }
    }
    if messages.iter().any(|m| m["reason"] == "build-finished" && m["success"] == false) || programs.is_empty() {
        return Err("the tests do not build".into());
    }
    println!("built {} test programs in {:.0} s", programs.len(), started.elapsed().as_secs_f64());
    Ok(programs)
}

/// What a run of tests came to.
enum Ended {
    Passed,
    Failed(String),
    Timeout(String),
}

/// Runs tests of one program, one after the other, in a process group that is killed when the time is over.
fn tests_of(
    options: &Options,
    tree: &Path,
    program: &Path,
    names: &[&str],
    variable: (&str, &str),
    limit: Duration,
    slot: usize,
) -> Result<Ended, Failure> {
    let temporary = options.scratch.join(format!("run-{slot}"));
    let _ = fs::remove_dir_all(&temporary);
    fs::create_dir_all(&temporary)?;
    let out = options.scratch.join(format!("out-{slot}.txt"));
    let sink = fs::File::create(&out)?;
    let mut command = Command::new("prlimit");
    command.args(["--as=6000000000", "--fsize=1000000000", "--core=0"]);
    // The time is the processor's, so that a busy machine takes no mutant for one that never ends; what waits for ever is killed by the clock.
    let seconds = limit.as_secs_f64().ceil() as u64;
    command.arg(format!("--cpu={seconds}:{seconds}"));
    let limit = 10 * limit;
    if let Some(user) = options.user {
        std::os::unix::fs::chown(&temporary, Some(user), Some(user))?;
        command.arg("setpriv").args([format!("--reuid={user}"), format!("--regid={user}"), "--clear-groups".into()]);
    }
    command
        .arg(program)
        .args(["--exact", "--test-threads=1"])
        .args(names)
        .current_dir(tree)
        .env("CARGO_MANIFEST_DIR", tree)
        .env("TMPDIR", &temporary)
        .env("HOME", &temporary)
        .env("RAYON_NUM_THREADS", "2")
        .env("PROPTEST_FAILURE_PERSISTENCE", "off")
        .env("RUST_BACKTRACE", "0")
        .env(variable.0, variable.1)
        .stdin(Stdio::null())
        .stdout(sink.try_clone()?)
        .stderr(sink)
        .process_group(0);
    let mut child = command.spawn()?;
    let started = Instant::now();
    let mut pause = 1;
    let status = loop {
        if let Some(status) = child.try_wait()? {
            break Some(status);
        }
        if started.elapsed() > limit {
            break None;
        }
        std::thread::sleep(Duration::from_millis(pause));
        pause = (pause + 1).min(20);
    };
    // Whatever it started goes with it.
    let _ = Command::new("kill").args(["-9", "--", &format!("-{}", child.id())]).stderr(Stdio::null()).status();
    let _ = child.wait();
    let mut said = String::new();
    let mut bytes = Vec::new();
    fs::File::open(&out)?.take(4_000_000).read_to_end(&mut bytes)?;
    said.push_str(&String::from_utf8_lossy(&bytes));
    let _ = fs::remove_dir_all(&temporary);
    // The test that failed, or that never came to its end.
    let failed = names
        .iter()
        .find(|n| {
            said.contains(&format!("test {n} ... FAILED"))
                || said.contains(&format!("test {n} - should panic ... FAILED"))
        })
        .or_else(|| names.iter().rev().find(|n| said.contains(&format!("test {n} ..."))))
        .or(names.first())
        .map_or(String::new(), |n| (*n).to_owned());
    Ok(match status {
        Some(status) if status.success() => Ended::Passed,
        Some(status) if matches!(status.signal(), Some(9 | 24)) => Ended::Timeout(failed),
        Some(_) => Ended::Failed(failed),
        None => Ended::Timeout(failed),
    })
}

/// Runs each test alone and notes which mutants it reaches and how long it takes. Tests known from an earlier call are not run again.
fn reach(
    options: &Options,
    tree: &Path,
    state: &Path,
    programs: &BTreeMap<String, PathBuf>,
    keys: &[String],
    dropped: &BTreeSet<usize>,
) -> Result<Vec<Test>, Failure> {
    let kept = state.join("reached.json");
    let old: Value = fs::read(&kept).ok().and_then(|b| serde_json::from_slice(&b).ok()).unwrap_or_default();
    // Where the mutants are others than then, all is run again: nobody knows who reaches the new ones.
    let old = if old["keys"] == json!(keys) { old } else { Value::Null };
    let mut wanted = Vec::new();
    for (program, path) in programs {
        let list = |arguments: &[&str]| -> Result<BTreeSet<String>, Failure> {
            let out =
                Command::new(path).args(["--list", "--format", "terse"]).args(arguments).current_dir(tree).output()?;
            let text = String::from_utf8_lossy(&out.stdout).into_owned();
            Ok(text.lines().filter_map(|l| l.strip_suffix(": test")).map(str::to_owned).collect())
        };
        let ignored = list(&["--ignored"])?;
        let asked = |name: &str| {
            program != "lib"
                || options.units.is_empty()
                || options.units.iter().any(|u| name.starts_with(&format!("{}::", u.replace('/', "::"))))
        };
        wanted.extend(list(&[])?.difference(&ignored).filter(|n| asked(n)).map(|n| (program.clone(), n.clone())));
    }
    let mut entries = serde_json::Map::new();
    let mut tests = Vec::new();
    let started = Instant::now();
    let mut excluded = Vec::new();
    for (program, name) in wanted {
        let label = format!("{program} {name}");
        let source = source(&program, &name);
        let kept = old["tests"].get(&label).filter(|e| e["source"] == source);
        let new = kept.is_none();
        let entry = match kept {
            Some(entry) => entry.clone(),
            None => {
                let log = options.scratch.join("reached.log");
                fs::write(&log, "")?;
                if let Some(user) = options.user {
                    std::os::unix::fs::chown(&log, Some(user), Some(user))?;
                }
                let begun = Instant::now();
                let variable = ("MUTANTS_REACHED", log.to_str().unwrap_or_default());
                let ended =
                    tests_of(options, tree, &programs[&program], &[&name], variable, Duration::from_secs(400), 0)?;
                let mut passed = matches!(ended, Ended::Passed);
                let mut seconds = begun.elapsed().as_secs_f64();
                if passed {
                    // Without the recording, when that is what took the time.
                    if seconds > 1.0 {
                        let begun = Instant::now();
                        let variable = ("MUTANT", "none");
                        let again = tests_of(
                            options,
                            tree,
                            &programs[&program],
                            &[&name],
                            variable,
                            Duration::from_secs(400),
                            0,
                        )?;
                        passed = matches!(again, Ended::Passed);
                        seconds = begun.elapsed().as_secs_f64();
                    }
                }
                let ids: BTreeSet<usize> = fs::read_to_string(&log)?.lines().filter_map(|l| l.parse().ok()).collect();
                json!({"seconds": seconds, "passed": passed, "reached": ids, "source": source})
            }
        };
        if entry["passed"] == true {
            tests.push(Test {
                program,
                name,
                seconds: entry["seconds"].as_f64().unwrap_or(1.0),
                reached: entry["reached"]
                    .as_array()
                    .map(|a| {
                        a.iter().filter_map(|i| Some(i.as_u64()? as usize)).filter(|i| !dropped.contains(i)).collect()
                    })
                    .unwrap_or_default(),
                new,
            });
        } else {
            excluded.push(label.clone());
        }
        entries.insert(label, entry);
    }
    fs::write(&kept, serde_json::to_vec(&json!({"keys": keys, "tests": entries}))?)?;
    println!(
        "{} tests, {:.0} s of them; looked at in {:.0} s; left out because they fail unmutated here: {}",
        tests.len(),
        tests.iter().map(|t| t.seconds).sum::<f64>(),
        started.elapsed().as_secs_f64(),
        if excluded.is_empty() { "none".into() } else { excluded.join(", ") }
    );
    Ok(tests)
}

/// A digest of the files that a test stands in: when they change, what it reaches is looked at anew.
fn source(program: &str, name: &str) -> String {
    let mut paths = vec![format!("tests/{program}.rs")];
    let modules: Vec<&str> = name.split("::").collect();
    for n in 1..modules.len() {
        let at = format!("src/{}", modules[..n].join("/"));
        paths.extend([format!("{at}.rs"), format!("{at}/mod.rs")]);
    }
    let mut hasher = std::hash::DefaultHasher::new();
    for path in paths {
        fs::read(path).unwrap_or_default().hash(&mut hasher);
    }
    format!("{:016x}", hasher.finish())
}

#[expect(clippy::too_many_arguments, reason = "one call")]
fn run(
    options: &Options,
    tree: &Path,
    state: &Path,
    mutants: &[Mutant],
    keys: &[String],
    dropped: &BTreeSet<usize>,
    unasked: &BTreeSet<usize>,
    programs: &BTreeMap<String, PathBuf>,
    tests: &[Test],
) -> Result<(), Failure> {
    let journal = state.join("results.jsonl");
    let mut results: HashMap<String, Outcome> = HashMap::new();
    let names: BTreeSet<String> = tests.iter().map(|t| format!("{} {}", t.program, t.name)).collect();
    for line in fs::read_to_string(&journal).unwrap_or_default().lines() {
        let Ok(v) = serde_json::from_str::<Value>(line) else { continue };
        let text = |k: &str| v[k].as_str().unwrap_or_default().to_owned();
        results.insert(
            text("key"),
            Outcome {
                state: text("state"),
                by: text("by"),
                slow: v["slow"].as_f64().unwrap_or(0.0),
                runs: v["tests"].as_u64().unwrap_or(0) as usize,
            },
        );
    }
    // A verdict of "caught" stands as long as its test does; what survived is tried again on every test that it was not tried on.
    let tried = state.join("tried.txt");
    let before: BTreeSet<String> = fs::read_to_string(&tried).unwrap_or_default().lines().map(str::to_owned).collect();
    let fresh: BTreeSet<&String> = names.difference(&before).collect();

    let log = Mutex::new(fs::File::options().append(true).create(true).open(&journal)?);
    let kills: Mutex<HashMap<(String, usize), usize>> = Mutex::new(HashMap::new());
    let done = Mutex::new(results);
    let next = AtomicUsize::new(0);
    let mut queue: Vec<usize> =
        (0..mutants.len()).filter(|m| !dropped.contains(m) && keys[*m].contains(&options.only)).collect();
    // In an order by chance, always the same: wherever a run is stopped, those that it tried are a fair sample of all.
    queue.sort_by_cached_key(|m| chance(&keys[*m]));
    let started = Instant::now();
    let worker = |slot: usize| -> Result<(), String> {
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            let Some(&m) = queue.get(at) else { return Ok(()) };
            let mutant = &mutants[m];
            let old = done.lock().map_err(|e| e.to_string())?.get(&keys[m]).cloned();
            let fast = old.as_ref().map_or(-1.0, |o| o.slow);
            if let Some(old) = &old
                && (old.state == "caught" || old.state == "timeout")
                && names.contains(&old.by)
            {
                continue;
            }
            let again = old.as_ref().is_some_and(|o| o.state == "caught" || o.state == "timeout");
            let mut chosen: Vec<usize> = (0..tests.len())
                .filter(|t| tests[*t].reached.contains(&m) && tests[*t].seconds <= options.slow)
                .filter(|t| {
                    let label = format!("{} {}", tests[*t].program, tests[*t].name);
                    again || tests[*t].seconds > fast || tests[*t].new || fresh.contains(&label)
                })
                .collect();
            let reaching = tests.iter().filter(|t| t.reached.contains(&m)).count();
            let outcome = if reaching == 0 {
                Outcome { state: "not reached".into(), by: String::new(), slow: 1e9, runs: 0 }
            } else {
                let module = mutant
                    .file
                    .trim_start_matches("src/")
                    .trim_end_matches(".rs")
                    .trim_end_matches("/mod")
                    .replace('/', "::");
                {
                    let kills = kills.lock().map_err(|e| e.to_string())?;
                    let score = |t: usize| {
                        let of = |k: String| kills.get(&(k, t)).copied().unwrap_or(0);
                        let near = tests[t].program == "lib" && tests[t].name.starts_with(&module);
                        let likely = 20.0 * of(format!("{} {}", mutant.file, mutant.function)) as f64
                            + of(mutant.file.clone()) as f64
                            + if near { 10.0 } else { 0.0 };
                        (0.02 + tests[t].seconds) / (1.0 + likely)
                    };
                    chosen.sort_by(|a, b| score(*a).total_cmp(&score(*b)));
                }
                let mut outcome =
                    Outcome { state: "survived".into(), by: String::new(), slow: options.slow, runs: chosen.len() };
                let (mut budget, mut from) = (0.1, 0);
                'batches: while from < chosen.len() {
                    let (mut sum, mut to) = (0.0, from);
                    while to < chosen.len() && (to == from || sum + tests[chosen[to]].seconds <= budget) {
                        sum += tests[chosen[to]].seconds;
                        to += 1;
                    }
                    budget = f64::min(budget * 2.0, 5.0);
                    let mut groups: BTreeMap<&str, Vec<usize>> = BTreeMap::new();
                    for t in &chosen[from..to] {
                        groups.entry(tests[*t].program.as_str()).or_default().push(*t);
                    }
                    for (program, group) in groups {
                        let all: Vec<&str> = group.iter().map(|t| tests[*t].name.as_str()).collect();
                        let seconds: f64 = group.iter().map(|t| tests[*t].seconds).sum();
                        let limit = Duration::from_secs_f64(2.0 + 8.0 * seconds);
                        let variable = ("MUTANT", m.to_string());
                        let ended =
                            tests_of(options, tree, &programs[program], &all, (variable.0, &variable.1), limit, slot)
                                .map_err(|e| e.to_string())?;
                        let (word, name) = match ended {
                            Ended::Passed => continue,
                            Ended::Failed(name) => ("caught", name),
                            Ended::Timeout(name) => ("timeout", name),
                        };
                        outcome.state = word.into();
                        outcome.by = format!("{program} {name}");
                        if let Some(t) = group.iter().find(|t| tests[**t].name == name) {
                            let mut kills = kills.lock().map_err(|e| e.to_string())?;
                            *kills.entry((mutant.file.clone(), *t)).or_default() += 1;
                            *kills.entry((format!("{} {}", mutant.file, mutant.function), *t)).or_default() += 1;
                        }
                        break 'batches;
                    }
                    from = to;
                }
                outcome
            };
            let line = json!({"key": keys[m], "state": outcome.state, "by": outcome.by, "slow": outcome.slow, "tests": outcome.runs});
            writeln!(log.lock().map_err(|e| e.to_string())?, "{line}").map_err(|e| e.to_string())?;
            done.lock().map_err(|e| e.to_string())?.insert(keys[m].clone(), outcome);
            if at.is_multiple_of(100) {
                println!("{at} of {} after {:.0} s", queue.len(), started.elapsed().as_secs_f64());
                let results = done.lock().map_err(|e| e.to_string())?.clone();
                summary(state, mutants, keys, dropped, unasked, &results).map_err(|e| e.to_string())?;
            }
        }
    };
    std::thread::scope(|scope| -> Result<(), Failure> {
        let workers: Vec<_> = (0..options.jobs).map(|slot| scope.spawn(move || worker(slot))).collect();
        for w in workers {
            w.join().map_err(|_| "a worker failed")??;
        }
        Ok(())
    })?;
    if options.only.is_empty() {
        fs::write(&tried, names.iter().map(|n| format!("{n}\n")).collect::<String>())?;
    }
    let results = done.into_inner()?;
    summary(state, mutants, keys, dropped, unasked, &results)?;
    println!("{}\nthose left: {}", fs::read_to_string(state.join("table.md"))?, state.join("left.txt").display());
    Ok(())
}

/// A number made of a name alone: 64-bit FNV-1a (Fowler, Noll & Vo), its bits mixed once more as in SplitMix64 (Steele, Lea & Flood 2014).
fn chance(name: &str) -> u64 {
    let z = name.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |h, b| (h ^ u64::from(b)).wrapping_mul(0x0100_0000_01b3));
    let z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}

/// Counts by file, and every mutant that was not caught.
fn summary(
    state: &Path,
    mutants: &[Mutant],
    keys: &[String],
    dropped: &BTreeSet<usize>,
    unasked: &BTreeSet<usize>,
    results: &HashMap<String, Outcome>,
) -> Result<(), Failure> {
    let mut counts: BTreeMap<&str, BTreeMap<&str, usize>> = BTreeMap::new();
    let mut left = String::new();
    for (m, mutant) in mutants.iter().enumerate() {
        if unasked.contains(&m) {
            continue;
        }
        let word = if dropped.contains(&m) {
            "not viable"
        } else {
            results.get(&keys[m]).map_or("not run", |o| o.state.as_str())
        };
        *counts.entry(&mutant.file).or_default().entry(word).or_default() += 1;
        if !matches!(word, "not viable" | "caught" | "timeout") {
            left += &format!("{word}: {}\n", keys[m]);
        }
    }
    let words = ["caught", "timeout", "survived", "not reached", "not viable", "not run"];
    let mut table = format!("| File | {} |\n|---|{}\n", words.join(" | "), "--:|".repeat(words.len()));
    let mut total = [0; 6];
    for (file, of) in &counts {
        let row: Vec<usize> = words.iter().map(|w| of.get(w).copied().unwrap_or(0)).collect();
        row.iter().enumerate().for_each(|(i, n)| total[i] += n);
        table += &format!("| {file} | {} |\n", row.iter().map(usize::to_string).collect::<Vec<_>>().join(" | "));
    }
    table += &format!("| all | {} |\n", total.map(|n| n.to_string()).join(" | "));
    fs::write(state.join("table.md"), &table)?;
    fs::write(state.join("left.txt"), &left)?;
    Ok(())
}
