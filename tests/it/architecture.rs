//! The dependency rules that the compiler cannot hold up by itself: what a crate's manifest may
//! name, which code may touch files or read a clock, and which words are one paper's own. What a
//! crate may import follows from its manifest. See docs/architecture.md.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

/// Every crate below the command, with the crates that it may be built on and the libraries that
/// only it may name.
const CRATES: [(&str, &[&str], &[&str]); 14] = [
    ("digest", &[], &["proc-macro2"]),
    // The only crate that names a math library or a random generator.
    ("num", &[], &["libm", "rand"]),
    // Shares nothing with what it checks.
    ("verify", &[], &["num-bigint"]),
    ("system", &["num"], &[]),
    ("integrate", &["num", "system"], &[]),
    ("hybrid", &["num", "system", "integrate"], &["csv"]),
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

/// The package of data that a crate below the figures embeds, and that crate. No crate below them
/// may name a paper.
const DATA: [(&str, &str); 1] = [("systems", "system")];

/// Crates that no crate below the command may name: flags and terminals.
const COMMAND: [&str; 5] = ["clap", "clap_complete", "clap_mangen", "indicatif", "signal-hook"];

/// Crates that serve any system and any paper, and parts of crates that do, each with the words
/// that it does not carry besides [`PAPER_WORDS`]. `system` holds the built-in systems, `job` names
/// them, `paper` draws them.
const GENERIC: [(&str, &[&str]); 8] = [
    ("num", &SYSTEM_WORDS),
    ("integrate", &SYSTEM_WORDS),
    ("rigor", &SYSTEM_WORDS),
    ("analyse", &SYSTEM_WORDS),
    ("render", &SYSTEM_WORDS),
    ("job/src/record", &SYSTEM_WORDS),
    // The equation of the caricature stands there once more.
    ("verify", &["the paper", "wheel", "printed", "jeffrey-2013", "jeffrey_2013"]),
    ("paper", &["printed", "jeffrey-2013", "jeffrey_2013", "jeffrey (2013)"]),
];

/// Words that belong to one paper and its tools. Citations (an author with a year) are no such
/// words.
const PAPER_WORDS: [&str; 5] =
    ["ndsolve", "mathematica", "reconstructed", "misprint", "this project's notes"];

/// Words of papers and of systems.
const SYSTEM_WORDS: [&str; 3] = ["the paper", "caricature", "wheel"];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Names in a manifest's `[dependencies]`.
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
    /// The same in order.
    tokens: Vec<String>,
}

/// Every source that is no test.
fn sources() -> Vec<Source> {
    let mut files = Vec::new();
    for folder in ["crates", "src", "figures", "papers"] {
        rust_files(&root().join(folder), &mut files);
    }
    // As those of the library, a paper's examples are programs of their own.
    files.retain(|file| !file.components().any(|part| part.as_os_str() == "examples"));
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
        let tokens: Vec<String> = code.lines().map(str::to_owned).collect();
        found.push(Source { name, text, code: tokens.iter().cloned().collect(), tokens });
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

/// Paths of a tree of imports (`a::{b, c::d}`) that begins at a token, below `base`.
fn paths(tokens: &[String], mut at: usize, base: &[String], found: &mut Vec<Vec<String>>) -> usize {
    let mut path = base.to_vec();
    loop {
        match tokens.get(at).map(String::as_str) {
            Some("{") => {
                at += 1;
                while tokens.get(at).is_some_and(|t| t != "}") {
                    at = paths(tokens, at, &path, found);
                    at += usize::from(tokens.get(at).is_some_and(|t| t == ","));
                }
                return at + 1;
            }
            Some(name) if name.chars().all(|c| c.is_alphanumeric() || "_*".contains(c)) => {
                path.push(name.to_owned());
                at += 1;
            }
            _ => return at + 1,
        }
        let goes_on = tokens[at.min(tokens.len())..].iter().take(2).eq([":", ":"]);
        if !goes_on {
            // Up to the end of the item: `as` and a name.
            while tokens.get(at).is_some_and(|t| t == "as" || t == "_") {
                at += 2;
            }
            found.push(path);
            return at;
        }
        at += 2;
    }
}

/// Modules of a crate by their paths, with those that each imports; a module's own ancestors, which
/// re-export it, are left out.
fn imports(sources: &[Source], folder: &str) -> BTreeMap<String, BTreeSet<String>> {
    let module = |name: &str| -> Option<String> {
        let stem = name.strip_prefix(folder)?.strip_prefix('/')?.strip_suffix(".rs")?;
        let stem = stem.strip_suffix("/mod").unwrap_or(stem);
        Some(if ["lib", "main"].contains(&stem) { String::new() } else { stem.to_owned() })
    };
    let names: BTreeSet<String> = sources.iter().filter_map(|s| module(&s.name)).collect();
    let mut found = BTreeMap::new();
    for source in sources {
        let Some(name) = module(&source.name) else { continue };
        let own: Vec<String> =
            name.split('/').filter(|p| !p.is_empty()).map(str::to_owned).collect();
        let mut named = Vec::new();
        for (at, token) in source.tokens.iter().enumerate() {
            let starts = at == 0 || source.tokens[at - 1] != ":";
            let above = match token.as_str() {
                "crate" if starts => 0,
                "super" if starts => own.len().saturating_sub(1),
                _ => continue,
            };
            if source.tokens[at + 1..].iter().take(2).eq([":", ":"]) {
                let mut base = own[..above].to_vec();
                let mut next = at + 3;
                while source.tokens.get(next).is_some_and(|t| t == "super") {
                    base.pop();
                    next += 3;
                }
                paths(&source.tokens, next, &base, &mut named);
            }
        }
        let target = |path: &Vec<String>| {
            (1..=path.len()).rev().map(|n| path[..n].join("/")).find(|p| names.contains(p))
        };
        let ancestor = |other: &String| {
            name == *other || name.starts_with(&format!("{other}/")) || other.is_empty()
        };
        found.insert(
            name.clone(),
            named.iter().filter_map(target).filter(|o| !ancestor(o)).collect(),
        );
    }
    found
}

/// Modules from which a way of imports leads back to themselves.
fn circular(imports: &BTreeMap<String, BTreeSet<String>>) -> Vec<&String> {
    let returns = |start: &&String| {
        let (mut seen, mut open) = (BTreeSet::new(), vec![*start]);
        while let Some(module) = open.pop() {
            for next in imports.get(module).into_iter().flatten() {
                if next == *start {
                    return true;
                }
                if seen.insert(next) {
                    open.push(next);
                }
            }
        }
        false
    };
    imports.keys().filter(returns).collect()
}

#[test]
fn modules_of_a_crate_import_each_other_in_no_circle() {
    let sources = sources();
    let folders = CRATES.iter().map(|(name, _, _)| format!("crates/{name}/src"));
    for folder in folders.chain(["papers/jeffrey-2013/code", "src"].map(str::to_owned)) {
        let imports = imports(&sources, &folder);
        assert!(!imports.is_empty(), "{folder} has no modules");
        let circles = circular(&imports);
        assert!(circles.is_empty(), "{folder}: {circles:?} import each other");
    }
}

/// The rule sees circles: written out, renamed, over several modules.
#[test]
fn circles_of_imports_are_seen() {
    let source = |name: &str, text: &str| {
        let tokens: Vec<String> =
            twofold_digest::code(text).unwrap().0.lines().map(str::to_owned).collect();
        Source {
            name: format!("crates/x/src/{name}.rs"),
            text: text.to_owned(),
            code: tokens.iter().cloned().collect(),
            tokens,
        }
    };
    let seen = |files: &[(&str, &str)]| -> Vec<String> {
        let sources: Vec<Source> = files.iter().map(|(name, text)| source(name, text)).collect();
        circular(&imports(&sources, "crates/x/src")).into_iter().cloned().collect()
    };
    assert_eq!(seen(&[("a", "use super::b::B;"), ("b", "fn f() { crate::a::g() }")]), ["a", "b"]);
    let three = [
        ("a", "use crate::{b::{B as C, D}, e};"),
        ("b", "use super::c::*;"),
        ("c", "use crate::a;"),
    ];
    assert_eq!(seen(&three), ["a", "b", "c"]);
    assert_eq!(seen(&[("a", "use super::b::B;"), ("b", "use std::a; // crate::a")]), [""; 0]);
    assert_eq!(
        seen(&[("a", "use super::b;"), ("b", "#[cfg(test)]\nmod tests { use crate::a; }")]),
        [""; 0]
    );
    // A folder's module and what it re-exports.
    assert_eq!(seen(&[("a/mod", "pub use b::B; mod b;"), ("a/b", "use super::C;")]), [""; 0]);
    assert_eq!(
        seen(&[("a/b", "use super::c::C;"), ("a/c", "use super::super::a::b;")]),
        ["a/b", "a/c"]
    );
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
    let own = |s: &Source| {
        let found = GENERIC.iter().find(|(g, _)| s.name.starts_with(&format!("crates/{g}/")));
        found.map(|(_, words)| PAPER_WORDS.iter().chain(*words))
    };
    for source in sources() {
        let Some(words) = own(&source) else { continue };
        let code = source.text.split("#[cfg(test)]").next().unwrap_or_default();
        for (number, line) in code.lines().enumerate() {
            let small = line.to_lowercase();
            for word in words.clone() {
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

/// Numbers of theorems are data of their paper's folder.
#[test]
fn the_checker_of_certificates_has_no_number_of_a_theorem() {
    let theorems = include_str!("../../papers/jeffrey-2013/theorems.toml");
    let is_decimal = |text: &&str| text.contains(['.', 'e']) && text.parse::<f64>().is_ok();
    let numbers: BTreeSet<&str> = theorems.split('"').filter(is_decimal).collect();
    assert!(numbers.contains("0.1") && numbers.contains("0.0005"), "{numbers:?}");
    for source in sources().iter().filter(|s| s.name.starts_with("crates/verify/")) {
        let code = source.text.split("#[cfg(test)]").next().unwrap_or_default();
        let found = numbers.iter().find(|n| code.contains(&format!("\"{n}\"")));
        assert_eq!(found, None, "{} has a theorem's number", source.name);
    }
}

/// Token of a source that names a paper or one of its readings: an identifier, or a text that is
/// no example in a command's help. A built-in system's name is none.
fn paper_token(source: &Source) -> Option<String> {
    const WORDS: [&str; 6] = [
        "printed",
        "reconstructed",
        "jeffrey",
        "jeffrey_2013",
        "twofold_jeffrey_2013",
        "twofold_papers",
    ];
    let is_closed = |text: &str| text.len() > 1 && text.ends_with('"') && !text.ends_with("\\\"");
    let says = |token: &str| {
        let mut words = token.split(|c: char| !(c.is_alphanumeric() || c == '_'));
        words.any(|w| WORDS.contains(&w.to_lowercase().as_str()))
    };
    // Texts of several lines are one token.
    let mut tokens: Vec<String> = Vec::new();
    for line in &source.tokens {
        match tokens.last_mut().filter(|t| t.starts_with('"') && !is_closed(t)) {
            Some(text) => *text += line,
            None => tokens.push(line.clone()),
        }
    }
    let is_example = |at: usize| at > 1 && tokens[at - 2] == "after_help" && tokens[at - 1] == "=";
    let is_system = |token: &str| twofold::system::library::text(token.trim_matches('"')).is_some();
    let foreign = |at: &usize| says(&tokens[*at]) && !is_example(*at) && !is_system(&tokens[*at]);
    (0..tokens.len()).find(foreign).map(|at| tokens[at].clone())
}

#[test]
fn one_module_of_the_command_knows_a_paper() {
    for source in sources().iter().filter(|s| s.name.starts_with("src/")) {
        // lib.rs gives the paper's crate to users under a name.
        if !["src/paper/code.rs", "src/lib.rs"].contains(&source.name.as_str()) {
            let token = paper_token(source);
            assert!(token.is_none(), "{} names a paper: {token:?}", source.name);
        }
    }
    let named = |text: &str| {
        let tokens = twofold_digest::code(text).unwrap().0.lines().map(str::to_owned).collect();
        let (name, text) = (String::new(), String::new());
        paper_token(&Source { name, text, code: BTreeSet::new(), tokens }).is_some()
    };
    assert!(named("use twofold_jeffrey_2013::all;") && named("use crate::jeffrey_2013 as p;"));
    assert!(
        named("fn f() -> R { R::Printed }") && named("const A: &str = \"x --reading printed\";")
    );
    assert!(!named("#[command(after_help = \"x --reading printed\")]\nstruct A;"));
    assert!(!named("/// As printed.\nconst A: &str = \"caricature-as-printed\";"));
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
    assert!(all.iter().any(|s| s.name == "papers/jeffrey-2013/code/fig4/figure.rs"));
    let manifest = "[dependencies]\ntwofold-num.workspace = true\nlibm \
        = \"1\"\n[dev-dependencies]\nclap = \"1\"\n";
    assert_eq!(dependencies(manifest), ["libm", "twofold-num"].map(str::to_owned).into());
    assert!(dependencies(&self::manifest("system")).contains("twofold-num"));
}
