//! The house's walls: which room may import which. See src/lib.rs.

use std::fs;
use std::path::{Path, PathBuf};

fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            sources(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// (path relative to src, code lines without comments, up to the file's unit tests).
fn room(name: &str) -> Vec<(String, String)> {
    let src = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    let folder = src.join(name);
    assert!(folder.is_dir(), "no room {name}");
    sources(&folder, &mut files);
    files
        .into_iter()
        .map(|f| {
            let text = fs::read_to_string(&f).unwrap();
            let code = text.split("#[cfg(test)]").next().unwrap();
            let code: String =
                code.lines().filter(|l| !l.trim_start().starts_with("//")).map(|l| format!("{l}\n")).collect();
            (f.strip_prefix(&src).unwrap().display().to_string(), code)
        })
        .collect()
}

const ROOMS: [&str; 12] =
    ["num", "system", "integrate", "analyse", "record", "job", "render", "compare", "draw", "paper", "report", "cli"];

/// Whether `code` names the library `name` as the head of a path.
fn names(code: &str, name: &str) -> bool {
    code.match_indices(&format!("{name}::")).any(|(at, _)| {
        let before = code[..at].chars().next_back();
        !before.is_some_and(|c| c.is_alphanumeric() || c == '_' || c == ':')
    })
}

fn imports(code: &str, room: &str) -> bool {
    // A grouped import would hide a room's name from this test; none is used.
    assert!(!code.contains("use crate::{"), "write one `use crate::room` per room");
    code.contains(&format!("crate::{room}"))
}

fn forbid(from: &str, rooms: &[&str]) {
    for (file, code) in room(from) {
        for other in rooms {
            assert!(!imports(&code, other), "src/{file} imports {other}; {from} must not know it");
        }
    }
}

#[test]
fn rooms_import_only_what_they_may() {
    forbid(
        "num",
        &["system", "integrate", "analyse", "record", "job", "render", "compare", "draw", "paper", "report", "cli"],
    );
    forbid("system", &["integrate", "analyse", "record", "job", "render", "compare", "draw", "paper", "report", "cli"]);
    forbid("integrate", &["analyse", "record", "job", "render", "compare", "draw", "paper", "report", "cli"]);
    forbid("analyse", &["record", "job", "render", "compare", "draw", "paper", "report", "cli"]);
    forbid("render", &["system", "integrate", "analyse", "record", "job", "compare", "draw", "paper", "report", "cli"]);
    forbid("record", &["system", "integrate", "analyse", "job", "render", "compare", "draw", "paper", "report", "cli"]);
}

#[test]
fn only_num_names_a_math_library() {
    for name in ROOMS.into_iter().filter(|r| *r != "num") {
        for (file, code) in room(name) {
            for library in ["libm", "pxfm", "rand", "rand_chacha"] {
                assert!(!names(&code, library), "src/{file} names {library}; go through crate::num");
            }
        }
    }
}

#[test]
fn only_render_names_plotters() {
    for name in ROOMS.into_iter().filter(|r| *r != "render") {
        for (file, code) in room(name) {
            for library in ["plotters", "tiny_skia", "ttf_parser"] {
                assert!(!names(&code, library), "src/{file} names {library}; go through crate::render");
            }
        }
    }
}

#[test]
fn only_record_touches_the_file_system() {
    for name in ROOMS.into_iter().filter(|r| *r != "record") {
        for (file, code) in room(name) {
            for word in ["std::fs", "File::", "tempfile::"] {
                assert!(!code.contains(word), "src/{file} uses {word}; go through crate::record");
            }
        }
    }
}

#[test]
fn no_clock_but_for_progress() {
    for name in ROOMS {
        for (file, code) in room(name) {
            let clock = code.contains("SystemTime") || code.contains("Instant");
            assert!(!clock || file.ends_with("progress.rs"), "src/{file} reads a clock");
        }
    }
}

#[test]
fn the_detector_detects() {
    // A wall test that cannot see an import would pass for ever.
    assert!(imports("use crate::job::spec::RunSpec;", "job"));
    assert!(names("let x = libm::exp(1.0);", "libm"));
    assert!(!names("let x = my_libm::exp(1.0);", "libm"));
    assert!(room("job").iter().any(|(_, code)| imports(code, "integrate")));
}
