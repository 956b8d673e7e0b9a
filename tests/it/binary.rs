//! Symbols that the programs take from the platform's library of mathematics: none at all. Names
//! that dependencies ask for are defined in `src/bin/twofold/mathematics.rs`, the one file in which
//! anything unsafe is allowed. `cargo test` looks at the command; `make symbols` builds all
//! programs and the Python module, and looks at those too.

use std::fs;
use std::path::{Path, PathBuf};

/// Every function of C's mathematics (C17, 7.12) that rounds: with the suffixes f and l. Not those
/// that are exact by definition.
const ROUNDING: [&str; 34] = [
    "acos",
    "asin",
    "atan",
    "atan2",
    "cos",
    "sin",
    "tan",
    "acosh",
    "asinh",
    "atanh",
    "cosh",
    "sinh",
    "tanh",
    "exp",
    "exp2",
    "exp10",
    "expm1",
    "log",
    "log10",
    "log1p",
    "log2",
    "logb",
    "cbrt",
    "hypot",
    "pow",
    "erf",
    "erfc",
    "lgamma",
    "lgamma_r",
    "tgamma",
    "sincos",
    "fma",
    "fmod",
    "remainder",
];

fn number(bytes: &[u8], at: usize, length: usize) -> usize {
    bytes[at..at + length].iter().rev().fold(0, |n, b| n << 8 | usize::from(*b))
}

fn name(bytes: &[u8], at: usize) -> String {
    let end = bytes[at..].iter().position(|b| *b == 0).unwrap();
    String::from_utf8_lossy(&bytes[at..at + end]).into_owned()
}

/// The undefined names in the dynamic symbol table of an ELF file of 64 bits, little-endian (System
/// V ABI, chapters 4 and 5).
fn imports(file: &[u8]) -> Vec<String> {
    assert!(file.starts_with(b"\x7fELF\x02\x01"), "not such a file");
    let (table, size, count) =
        (number(file, 0x28, 8), number(file, 0x3a, 2), number(file, 0x3c, 2));
    let section = |i: usize| table + i * size;
    let mut found = Vec::new();
    for i in 0..count {
        // SHT_DYNSYM, and the names that it links to.
        if number(file, section(i) + 4, 4) != 11 {
            continue;
        }
        let (start, length) =
            (number(file, section(i) + 0x18, 8), number(file, section(i) + 0x20, 8));
        let strings = number(file, section(number(file, section(i) + 0x28, 4)) + 0x18, 8);
        for symbol in (start..start + length).step_by(24) {
            // SHN_UNDEF: an imported symbol.
            if number(file, symbol + 6, 2) == 0 {
                found.push(name(file, strings + number(file, symbol, 4)));
            }
        }
    }
    found
}

/// The names by which the places of an ELF file are filled in when it is loaded (SHT_RELA): a
/// shared object's own functions are among them where another library's of the same name would be
/// called instead.
fn bound_at_load(file: &[u8]) -> Vec<String> {
    let (table, size, count) =
        (number(file, 0x28, 8), number(file, 0x3a, 2), number(file, 0x3c, 2));
    let section = |i: usize| table + i * size;
    let at = |i: usize| number(file, section(i) + 0x18, 8);
    let linked = |i: usize| number(file, section(i) + 0x28, 4);
    let mut found = Vec::new();
    for i in (0..count).filter(|i| number(file, section(*i) + 4, 4) == 4 && linked(*i) != 0) {
        let (symbols, strings) = (at(linked(i)), at(linked(linked(i))));
        for entry in (at(i)..at(i) + number(file, section(i) + 0x20, 8)).step_by(24) {
            // The upper half of r_info, but on 64-bit MIPS.
            let symbol = number(file, entry + 12, 4);
            if symbol != 0 {
                found.push(name(file, strings + number(file, symbols + 24 * symbol, 4)));
            }
        }
    }
    found
}

fn rounds(symbol: &str) -> bool {
    ROUNDING.iter().any(|f| symbol == *f || symbol.strip_suffix(['f', 'l']) == Some(f))
}

/// The libraries that an ELF file says it needs (DT_NEEDED).
fn needed(file: &[u8]) -> Vec<String> {
    let (table, size, count) =
        (number(file, 0x28, 8), number(file, 0x3a, 2), number(file, 0x3c, 2));
    let section = |i: usize| table + i * size;
    let mut found = Vec::new();
    // SHT_DYNAMIC
    for i in (0..count).filter(|i| number(file, section(*i) + 4, 4) == 6) {
        let (start, length) =
            (number(file, section(i) + 0x18, 8), number(file, section(i) + 0x20, 8));
        let strings = number(file, section(number(file, section(i) + 0x28, 4)) + 0x18, 8);
        for entry in (start..start + length).step_by(16) {
            if number(file, entry, 8) == 1 {
                found.push(name(file, strings + number(file, entry + 8, 8)));
            }
        }
    }
    found
}

/// Complains of a program that asks for any mathematics of the platform.
fn asks_for_nothing(path: &Path) {
    let (file, shown) = (fs::read(path).unwrap(), path.display());
    let (imports, bound) = (imports(&file), bound_at_load(&file));
    assert!(
        imports.iter().any(|s| s == "write" || s == "malloc"),
        "{shown}: a program imports something: {imports:?}"
    );
    assert!(
        bound.iter().any(|s| imports.contains(s)),
        "{shown}: something is filled in: {bound:?}"
    );
    let foreign: Vec<&String> =
        imports.iter().chain(&bound).filter(|symbol| rounds(symbol)).collect();
    assert!(
        foreign.is_empty(),
        "{shown} asks the platform for {foreign:?}: results would depend on the machine"
    );
    let libraries = needed(&file);
    assert!(libraries.iter().any(|l| l.starts_with("libc.so")), "{shown}: {libraries:?}");
    assert!(!libraries.iter().any(|l| l.starts_with("libm.so")), "{shown}: {libraries:?}");
}

#[test]
#[cfg(all(target_os = "linux", target_pointer_width = "64", target_endian = "little"))]
// the test's own cosine is the platform's, to show that one would be seen
#[allow(clippy::disallowed_methods)]
fn nothing_comes_from_the_platforms_mathematics() {
    asks_for_nothing(Path::new(env!("CARGO_BIN_EXE_twofold")));
    // This very test can see them: it was compiled with a cosine of the platform.
    assert!(std::hint::black_box(0.5_f64).cos() < 1.0);
    let own = fs::read(std::env::current_exe().unwrap()).unwrap();
    assert!(imports(&own).iter().any(|s| s == "cos"), "the test is blind");
    assert!(bound_at_load(&own).iter().any(|s| s == "cos"), "the test is blind to what is bound");
}

/// The files named in TWOFOLD_PROGRAMS, separated by spaces.
#[test]
#[ignore = "make symbols"]
fn no_program_asks_for_the_platforms_mathematics() {
    let named = std::env::var("TWOFOLD_PROGRAMS")
        .expect("TWOFOLD_PROGRAMS names the programs to look at: make symbols");
    let programs: Vec<&Path> = named.split_whitespace().map(Path::new).collect();
    assert!(!programs.is_empty());
    for program in &programs {
        asks_for_nothing(program);
        println!("{}: nothing", program.display());
    }
}

#[test]
fn names_are_told_apart() {
    for symbol in ["sin", "cosf", "fmal", "tanh", "sincosf", "exp10", "log2"] {
        assert!(rounds(symbol), "{symbol}");
    }
    for symbol in ["floor", "sqrt", "malloc", "cosh_", "f", "logger", "time"] {
        assert!(!rounds(symbol), "{symbol}");
    }
}

/// All of the project's Rust, but what is built or made.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        if path.is_dir() && !name.starts_with('.') && !["target", "build"].contains(&name.as_str())
        {
            sources(&path, found);
        } else if name.ends_with(".rs") {
            found.push(path);
        }
    }
}

/// The word, in code: not in a comment, not in a string.
fn says_unsafe(line: &str) -> bool {
    let code = line.split("//").next().unwrap_or_default();
    let outside = code.split('"').step_by(2).collect::<Vec<_>>().join(" ");
    outside
        .split(|c: char| !c.is_alphanumeric() && c != '_')
        .any(|word| ["unsafe", "unsafe_code"].contains(&word))
}

#[test]
fn one_file_holds_all_that_is_unsafe() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    sources(root, &mut files);
    assert!(files.len() > 200, "{}", files.len());
    let mut found: Vec<String> = files
        .iter()
        .filter(|path| fs::read_to_string(path).unwrap().lines().any(says_unsafe))
        .map(|path| path.strip_prefix(root).unwrap().display().to_string())
        .collect();
    found.sort();
    let (libraries, others): (Vec<String>, Vec<String>) =
        found.into_iter().partition(|f| f.ends_with("/lib.rs") || f.ends_with("s/files.rs"));
    assert_eq!(others, ["src/bin/twofold/mathematics.rs"]);
    // Every library of the workspace forbids it, in a line of its own: the crates, the command and
    // three packages of data.
    let crates = fs::read_dir(root.join("crates")).unwrap().count();
    assert_eq!(libraries.len(), crates + 4, "{libraries:?}");
    for library in libraries {
        let text = fs::read_to_string(root.join(&library)).unwrap();
        let lines: Vec<&str> = text.lines().filter(|line| says_unsafe(line)).collect();
        assert_eq!(lines, ["#![forbid(unsafe_code)]"], "{library}");
    }
    // And every program of ours has it.
    let mut programs = 0;
    // Not the proofs, which ask for none, nor the tools and peers beside the project.
    let own = [root.join("src"), root.join("figures")];
    for path in files
        .iter()
        .filter(|path| path.ends_with("main.rs") && own.iter().any(|o| path.starts_with(o)))
    {
        let text = fs::read_to_string(path).unwrap();
        assert!(text.contains("mod mathematics;"), "{}", path.display());
        programs += 1;
    }
    assert!(programs >= 18, "{programs}");
}
