//! The dependency rules that the compiler cannot hold up by itself: what a crate's manifest may
//! name, which code may touch files or read a clock, and which words are one paper's own. What a
//! crate may import follows from its manifest. See docs/architecture.md.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Every crate below the command, with the crates that it may be built on and the libraries that
/// only it may name.
const CRATES: [(&str, &[&str], &[&str]); 14] = [
    ("digest", &[], &["proc-macro2"]),
    // The only crate that names a math library or a random generator.
    ("num", &[], &["libm", "rand", "rand_chacha"]),
    // Shares nothing with what it checks.
    ("verify", &[], &["num-bigint"]),
    ("system", &["num"], &[]),
    ("hybrid", &["num", "system"], &["csv"]),
    ("integrate", &["num", "system"], &[]),
    ("rigor", &["num", "system", "integrate"], &[]),
    ("analyse", &["num", "system", "integrate", "rigor"], &[]),
    ("instances", &["system", "integrate", "analyse"], &[]),
    ("instances-switched", &["system", "integrate", "analyse", "instances"], &[]),
    ("instances-tangent", &["system", "integrate", "analyse"], &[]),
    (
        "job",
        &[
            "num",
            "system",
            "hybrid",
            "integrate",
            "rigor",
            "analyse",
            "instances",
            "instances-switched",
            "instances-tangent",
        ],
        &["csv", "zmij"],
    ),
    (
        "render",
        &["num"],
        &["plotters", "plotters-backend", "tiny-skia", "pdf-writer", "png", "miniz_oxide"],
    ),
    (
        "paper",
        &["num", "system", "hybrid", "integrate", "rigor", "analyse", "job", "render"],
        &["base64", "percent-encoding"],
    ),
];

/// Packages that hold only data, with the crate that embeds each.
const DATA: [(&str, &str); 2] = [("systems", "system"), ("jeffrey-2013", "paper")];

/// What no crate below the command may name: flags and terminals.
const COMMAND: [&str; 5] = ["clap", "clap_complete", "clap_mangen", "indicatif", "signal-hook"];

/// Crates that serve any system and any paper, and parts of crates that do. `system` holds the
/// built-in systems, `job` names them.
const GENERIC: [&str; 6] = ["num", "integrate", "rigor", "analyse", "render", "job/src/record"];

/// Words that belong to one paper, its systems and its tools. Citations (an author with a year) are
/// no such words.
const PAPER_WORDS: [&str; 8] = [
    "the paper",
    "ndsolve",
    "mathematica",
    "caricature",
    "wheel",
    "reconstructed",
    "misprint",
    "this project's notes",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// What a manifest names in `[dependencies]`.
fn dependencies(manifest: &str) -> BTreeSet<String> {
    let manifest: toml::Table = manifest.parse().unwrap();
    manifest
        .get("dependencies")
        .and_then(|t| t.as_table())
        .map(|t| t.keys().cloned().collect())
        .unwrap_or_default()
}

fn manifest(name: &str) -> String {
    fs::read_to_string(root().join("crates").join(name).join("Cargo.toml")).unwrap()
}

fn rust_files(folder: &Path, into: &mut Vec<PathBuf>) {
    let mut entries: Vec<_> = fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()).collect();
    entries.sort();
    for path in entries {
        if path.is_dir() {
            rust_files(&path, into);
        } else if path.extension().is_some_and(|e| e == "rs") {
            into.push(path);
        }
    }
}

/// A source file of a crate, of the command or of a figure.
struct Source {
    /// Its path from the repository's root, with forward slashes.
    name: String,
    text: String,
    /// Its tokens without comments and tests.
    code: BTreeSet<String>,
}

/// Every source that is no test.
fn sources() -> Vec<Source> {
    let mut files = Vec::new();
    for folder in ["crates", "src", "figures"] {
        rust_files(&root().join(folder), &mut files);
    }
    let mut tests = BTreeSet::new();
    let mut found = Vec::new();
    for file in files {
        let name = file.strip_prefix(root()).unwrap().display().to_string().replace('\\', "/");
        let text = fs::read_to_string(&file).unwrap();
        let (code, modules) = twofold_digest::code(&text).unwrap_or_else(|e| panic!("{name}: {e}"));
        let stem = name.trim_end_matches(".rs");
        let base = stem
            .strip_suffix("/lib")
            .or_else(|| stem.strip_suffix("/mod"))
            .unwrap_or(stem)
            .to_owned();
        tests.extend(modules.iter().map(|m| format!("{base}/{m}.rs")));
        found.push(Source { name, text, code: code.lines().map(str::to_owned).collect() });
    }
    found.retain(|s| !tests.contains(&s.name) && !s.name.ends_with("/build.rs"));
    found
}

#[test]
fn every_crate_names_only_crates_below_it() {
    let mut found: BTreeSet<String> = fs::read_dir(root().join("crates"))
        .unwrap()
        .map(|e| e.unwrap().file_name().into_string().unwrap())
        .collect();
    for (i, (name, below, _)) in CRATES.iter().enumerate() {
        assert!(found.remove(*name), "crates/{name} is not there");
        let earlier = |c: &str| CRATES[..i].iter().any(|(n, _, _)| *n == c);
        assert!(
            below.iter().all(|c| earlier(c)),
            "{name} may be built only on crates that are listed before it"
        );
        for dependency in dependencies(&manifest(name)) {
            if let Some(other) = dependency.strip_prefix("twofold-") {
                let known = below.contains(&other) || DATA.contains(&(other, *name));
                assert!(known, "crates/{name} is built on {other}, which it must not know");
            }
        }
    }
    assert!(found.is_empty(), "crates/{found:?}: say in CRATES what they may be built on");
}

#[test]
fn libraries_are_named_where_they_belong() {
    for (name, _, own) in CRATES {
        let named = dependencies(&manifest(name));
        for (_, _, libraries) in CRATES {
            let foreign = libraries.iter().find(|l| named.contains(**l) && !own.contains(l));
            assert_eq!(
                foreign, None,
                "crates/{name} names a library that only other crates may name"
            );
        }
        let flags = COMMAND.iter().find(|l| named.contains(**l));
        assert_eq!(flags, None, "crates/{name} names a library of the command line");
    }
}

#[test]
fn files_are_touched_by_records_and_the_store() {
    for source in sources() {
        let allowed = source.name.starts_with("crates/job/src/record/")
            || ["crates/job/src/store.rs", "crates/digest/src/lib.rs"]
                .contains(&source.name.as_str());
        for word in ["fs", "OpenOptions"] {
            assert!(
                allowed || !source.code.contains(word),
                "{} uses {word}; go through record",
                source.name
            );
        }
    }
}

#[test]
fn no_clock_but_for_progress() {
    for source in sources() {
        let named = ["SystemTime", "Instant", "chrono"].iter().find(|c| source.code.contains(**c));
        assert!(
            named.is_none() || source.name.ends_with("progress.rs"),
            "{} reads a clock: {named:?}",
            source.name
        );
    }
}

#[test]
fn generic_crates_carry_no_word_of_one_paper() {
    let generic = |s: &&Source| GENERIC.iter().any(|g| s.name.starts_with(&format!("crates/{g}/")));
    for source in sources().iter().filter(generic) {
        let code = source.text.split("#[cfg(test)]").next().unwrap_or_default();
        for (number, line) in code.lines().enumerate() {
            let small = line.to_lowercase();
            for word in PAPER_WORDS {
                let whole = |at: usize| {
                    let ends = |c: Option<char>| !c.is_some_and(char::is_alphanumeric);
                    ends(small[..at].chars().next_back())
                        && ends(small[at + word.len()..].chars().next())
                };
                let says = small.match_indices(word).any(|(at, _)| whole(at));
                assert!(!says, "{}:{} says {word:?}: {line}", source.name, number + 1);
            }
            // A figure's number without an author is this paper's.
            let figure = ["fig. ", "figs ", "figure "].iter().any(|f| {
                small.split(f).skip(1).any(|after| after.starts_with(|c: char| c.is_ascii_digit()))
            });
            let cited = small.contains("19") || small.contains("20");
            assert!(
                !figure || cited,
                "{}:{} names a figure without its paper: {line}",
                source.name,
                number + 1
            );
        }
    }
}

#[test]
fn the_rules_see_what_they_rule() {
    let all = sources();
    let code = |name: &str| &all.iter().find(|s| s.name == name).unwrap().code;
    assert!(code("crates/job/src/record/files.rs").contains("fs"));
    assert!(code("src/cli/progress.rs").contains("Instant"));
    // Tests that stand in files of their own are left out.
    assert!(root().join("crates/render/src/tests.rs").is_file());
    assert!(all.iter().all(|s| s.name != "crates/render/src/tests.rs"));
    assert!(all.iter().any(|s| s.name == "figures/fig4/figure.rs"));
    let manifest = "[dependencies]\ntwofold-num.workspace = true\nlibm \
        = \"1\"\n[dev-dependencies]\nclap = \"1\"\n";
    assert_eq!(dependencies(manifest), ["libm", "twofold-num"].map(str::to_owned).into());
    assert!(dependencies(&self::manifest("system")).contains("twofold-num"));
}
