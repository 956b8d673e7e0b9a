//! The house's walls: which room may import which, who may name which library, and which words are one paper's own. See src/lib.rs.
//!
//! The tests read the sources as the compiler's lexer would, so that no way of writing a path hides an import: groups, `super::super`,
//! `self`, renamed or public uses, paths in expressions and inside macros, the library's own name in binaries and figures. What stands under
//! `#[cfg(test)]` is not looked at.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// Every room, with the rooms below it that it may import.
const ROOMS: [(&str, &[&str]); 14] = [
    ("num", &[]),
    // Shares nothing with what it checks.
    ("verify", &[]),
    ("system", &["num"]),
    ("integrate", &["num", "system"]),
    ("rigor", &["num", "system", "integrate"]),
    ("analyse", &["num", "system", "integrate", "rigor"]),
    ("record", &["num"]),
    ("job", &["num", "system", "integrate", "rigor", "analyse", "record"]),
    ("render", &["num"]),
    ("compare", &["num", "render"]),
    ("draw", &["num", "system", "integrate", "rigor", "analyse", "job", "render"]),
    ("paper", &["num", "system", "integrate", "rigor", "analyse", "record", "job", "render", "compare", "draw"]),
    (
        "report",
        &["num", "system", "integrate", "rigor", "analyse", "record", "job", "render", "compare", "draw", "paper"],
    ),
    (
        "cli",
        &[
            "num",
            "system",
            "integrate",
            "rigor",
            "analyse",
            "record",
            "job",
            "render",
            "compare",
            "draw",
            "paper",
            "report",
            "verify",
        ],
    ),
];

/// Who may name a library, by rooms (`bin` is src/bin, `figures` the figures).
const LIBRARIES: [(&str, &[&str]); 10] = [
    ("libm", &["num"]),
    ("pxfm", &["num"]),
    // Numbers in vector registers, and the runs in lanes that choose an instruction set; nothing else may look at the processor.
    ("pulp", &["num", "integrate"]),
    ("rand", &["num"]),
    ("rand_chacha", &["num"]),
    ("plotters", &["render"]),
    ("plotters_backend", &["render"]),
    ("tiny_skia", &["render"]),
    ("tempfile", &["record", "job"]),
    ("clap", &["cli", "bin"]),
];

/// Derives of the command line's library that stand outside its room; each is on its way there.
const CLAP_ELSEWHERE: [&str; 3] = ["integrate/method.rs", "integrate/schedule.rs", "paper/mod.rs"];

/// Rooms that serve any system and any paper. `system` holds the built-in systems, `job` names them, `draw` sketches them.
const GENERIC: [&str; 7] = ["num", "integrate", "rigor", "analyse", "record", "render", "compare"];

/// Words that belong to one paper, its systems and its tools. Citations (an author with a year) are no such words.
const PAPER_WORDS: [&str; 8] =
    ["the paper", "ndsolve", "mathematica", "caricature", "wheel", "reconstructed", "misprint", "this project's notes"];

/// A token of Rust, as far as paths need it.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Token {
    Name(String),
    /// `::`
    Colons,
    Other(char),
}

/// The tokens of a source text, without comments and without what literals hold.
fn lex(text: &str) -> Vec<Token> {
    let c: Vec<char> = text.chars().collect();
    let at = |i: usize| c.get(i).copied().unwrap_or('\0');
    let (mut tokens, mut i) = (Vec::new(), 0);
    while i < c.len() {
        let raw = |j: usize| {
            let hashes = c[j..].iter().take_while(|h| **h == '#').count();
            (at(j + hashes) == '"').then_some(hashes)
        };
        if at(i) == '/' && at(i + 1) == '/' {
            while i < c.len() && c[i] != '\n' {
                i += 1;
            }
        } else if at(i) == '/' && at(i + 1) == '*' {
            let mut depth = 0;
            loop {
                match (at(i), at(i + 1)) {
                    ('/', '*') => (depth, i) = (depth + 1, i + 2),
                    ('*', '/') => (depth, i) = (depth - 1, i + 2),
                    _ => i += 1,
                }
                if depth == 0 || i >= c.len() {
                    break;
                }
            }
        } else if at(i) == '"' || (matches!(at(i), 'b' | 'c') && at(i + 1) == '"') {
            i += if at(i) == '"' { 1 } else { 2 };
            while i < c.len() && c[i] != '"' {
                i += if c[i] == '\\' { 2 } else { 1 };
            }
            i += 1;
        } else if let Some((start, hashes)) = match (at(i), at(i + 1)) {
            ('r', _) => raw(i + 1).map(|h| (i + 1, h)),
            ('b' | 'c', 'r') => raw(i + 2).map(|h| (i + 2, h)),
            _ => None,
        } {
            i = start + hashes + 1;
            while i < c.len() && !(c[i] == '"' && (1..=hashes).all(|h| at(i + h) == '#')) {
                i += 1;
            }
            i += hashes + 1;
        } else if at(i) == '\'' || (at(i) == 'b' && at(i + 1) == '\'') {
            i += if at(i) == 'b' { 2 } else { 1 };
            if at(i) == '\\' {
                i += 2;
                while i < c.len() && c[i] != '\'' {
                    i += 1;
                }
                i += 1;
            } else if at(i + 1) == '\'' {
                i += 2;
            }
            // Otherwise a lifetime: its name follows as an ordinary one.
        } else if at(i).is_alphabetic() || at(i) == '_' {
            let start = i;
            while at(i).is_alphanumeric() || at(i) == '_' {
                i += 1;
            }
            tokens.push(Token::Name(c[start..i].iter().collect()));
        } else if at(i) == ':' && at(i + 1) == ':' {
            tokens.push(Token::Colons);
            i += 2;
        } else {
            if !at(i).is_whitespace() {
                tokens.push(Token::Other(at(i)));
            }
            i += 1;
        }
    }
    tokens
}

/// The tokens without items under `#[cfg(test)]`.
fn without_tests(tokens: &[Token]) -> Vec<Token> {
    let marker: Vec<Token> = lex("#[cfg(test)]");
    let (mut kept, mut i) = (Vec::new(), 0);
    while i < tokens.len() {
        if !tokens[i..].starts_with(&marker) {
            kept.push(tokens[i].clone());
            i += 1;
            continue;
        }
        // To the end of the item: its braces, or a semicolon before any.
        let mut depth = 0;
        i += marker.len();
        while i < tokens.len() {
            match tokens[i] {
                Token::Other('{') => depth += 1,
                Token::Other('}') => depth -= 1,
                Token::Other(';') if depth == 0 => break,
                _ => {}
            }
            i += 1;
            if depth == 0 && tokens[i - 1] == Token::Other('}') {
                i -= 1;
                break;
            }
        }
        i += 1;
    }
    kept
}

/// Every path of two or more names, groups multiplied out: `a::{b, c::d}` is a::b and a::c::d.
fn paths(tokens: &[Token]) -> Vec<Vec<String>> {
    let mut found = Vec::new();
    let mut i = 0;
    while i < tokens.len() {
        let begins = matches!(tokens[i], Token::Name(_)) && (i == 0 || tokens[i - 1] != Token::Colons);
        if begins && tokens.get(i + 1) == Some(&Token::Colons) {
            i = tree(tokens, i, &[], &mut found);
        } else {
            i += 1;
        }
    }
    found
}

/// Reads a path or a tree of paths from `i` on; returns where it ends.
fn tree(tokens: &[Token], mut i: usize, prefix: &[String], found: &mut Vec<Vec<String>>) -> usize {
    let mut path = prefix.to_vec();
    while let Some(Token::Name(name)) = tokens.get(i) {
        path.push(name.clone());
        i += 1;
        if tokens.get(i) != Some(&Token::Colons) {
            break;
        }
        i += 1;
    }
    if tokens.get(i) == Some(&Token::Other('{')) && tokens.get(i.wrapping_sub(1)) == Some(&Token::Colons) {
        i += 1;
        while i < tokens.len() && tokens[i] != Token::Other('}') {
            let before = i;
            i = tree(tokens, i, &path, found);
            // Past a renaming, a glob or a comma.
            while i < tokens.len() && !matches!(tokens[i], Token::Other(',' | '}')) {
                i += 1;
            }
            if tokens.get(i) == Some(&Token::Other(',')) {
                i += 1;
            }
            i = i.max(before + 1);
        }
        return i + 1;
    }
    if path.len() > 1 {
        found.push(path);
    }
    i
}

/// What a path names: (whether it starts at the library's root, its names from there). `module` is where it stands.
fn resolve(path: &[String], module: &[String], in_library: bool) -> (bool, Vec<String>) {
    let rest = |n: usize| path[n..].to_vec();
    match path[0].as_str() {
        "twofold" => (true, rest(1)),
        "crate" if in_library => (true, rest(1)),
        "self" | "super" if in_library => {
            let ups = path.iter().take_while(|p| *p == "super" || *p == "self").filter(|p| *p == "super").count();
            let names = path.iter().skip_while(|p| *p == "super" || *p == "self").cloned();
            let depth = module.len().saturating_sub(ups);
            (true, module[..depth].iter().cloned().chain(names).collect())
        }
        _ => (false, rest(0)),
    }
}

/// A source file.
struct Source {
    /// Its path from src/, or from the package's root for figures.
    name: String,
    /// Its room, or `bin` or `figures`.
    room: String,
    text: String,
    /// What it imports: as from the library's root, and from elsewhere.
    inside: BTreeSet<Vec<String>>,
    outside: BTreeSet<Vec<String>>,
}

impl Source {
    fn new(name: String, room: String, module: &[String], in_library: bool, text: String) -> Self {
        let (mut inside, mut outside) = (BTreeSet::new(), BTreeSet::new());
        for path in paths(&without_tests(&lex(&text))) {
            let (root, names) = resolve(&path, module, in_library);
            if root {
                inside.insert(names)
            } else {
                outside.insert(names)
            };
        }
        Self { name, room, text, inside, outside }
    }

    /// The other rooms that it names.
    fn rooms(&self) -> BTreeSet<&str> {
        let heads = self.inside.iter().filter_map(|p| p.first());
        heads.map(String::as_str).filter(|r| *r != self.room && ROOMS.iter().any(|(name, _)| name == r)).collect()
    }

    /// Whether it names the library, or the path in it.
    fn names(&self, library: &str) -> bool {
        let wanted: Vec<&str> = library.split("::").collect();
        self.outside.iter().any(|p| p.iter().map(String::as_str).take(wanted.len()).eq(wanted.iter().copied()))
    }
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

/// Every source of the library, the command and the figures.
fn sources() -> Vec<Source> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut files = Vec::new();
    rust_files(&root.join("src"), &mut files);
    rust_files(&root.join("figures"), &mut files);
    let mut found = Vec::new();
    for file in files {
        let text = fs::read_to_string(&file).unwrap();
        let name = |base: &str| file.strip_prefix(root.join(base)).ok().map(|p| p.display().to_string());
        if let Some(name) = name("src") {
            let mut module: Vec<String> = name.trim_end_matches(".rs").split('/').map(str::to_owned).collect();
            if matches!(module.last().map(String::as_str), Some("mod" | "lib")) {
                module.pop();
            }
            let room = module.first().cloned().unwrap_or_default();
            let in_library = room != "bin";
            found.push(Source::new(name, room, &module, in_library, text));
        } else if let Some(name) = name("") {
            // A figure's specification is a module of paper::figures; its binary and other files use the library by name.
            let module = ["paper", "figures", "figure"].map(str::to_owned);
            found.push(Source::new(name, "figures".to_owned(), &module, file.ends_with("figure.rs"), text));
        }
    }
    found
}

#[test]
fn rooms_import_only_what_lies_below_them() {
    let mut seen = BTreeSet::new();
    for source in sources() {
        let Some((_, allowed)) = ROOMS.iter().find(|(name, _)| *name == source.room) else { continue };
        seen.insert(source.room.clone());
        for other in source.rooms() {
            assert!(allowed.contains(&other), "src/{} imports {other}; {} must not know it", source.name, source.room);
        }
    }
    assert!(seen.len() >= 12, "rooms without a source: only {seen:?} have one");
}

#[test]
fn every_room_has_its_walls() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    for entry in fs::read_dir(root).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let known = ROOMS.iter().any(|(room, _)| *room == name) || name == "bin";
        assert!(known || !path.is_dir(), "src/{name} is a room without walls: say in this test what it may import");
    }
    for (i, (name, below)) in ROOMS.iter().enumerate() {
        let lower = |r: &str| ROOMS[..i].iter().any(|(n, _)| *n == r);
        assert!(below.iter().all(|r| lower(r)), "{name} may import only rooms that are listed before it: no circles");
    }
}

#[test]
fn libraries_are_named_where_they_belong() {
    for source in sources() {
        for (library, rooms) in LIBRARIES {
            let excused = library == "clap" && CLAP_ELSEWHERE.contains(&source.name.as_str());
            let allowed = rooms.contains(&source.room.as_str()) || excused;
            assert!(allowed || !source.names(library), "{} names {library}; go through {rooms:?}", source.name);
        }
    }
}

#[test]
fn only_records_and_the_store_touch_files() {
    for source in sources() {
        let allowed = source.room == "record" || source.name == "job/store.rs";
        for word in ["std::fs", "fs", "File", "OpenOptions"] {
            assert!(allowed || !source.names(word), "{} uses {word}; go through crate::record", source.name);
        }
    }
}

#[test]
fn no_clock_but_for_progress() {
    for source in sources() {
        let clock = ["SystemTime", "Instant", "std::time::SystemTime", "std::time::Instant", "chrono", "time"];
        let named = clock.iter().any(|c| source.names(c));
        assert!(!named || source.name.ends_with("progress.rs"), "{} reads a clock", source.name);
    }
}

#[test]
fn generic_rooms_carry_no_word_of_one_paper() {
    for source in sources().iter().filter(|s| GENERIC.contains(&s.room.as_str())) {
        let code = source.text.split("#[cfg(test)]").next().unwrap_or_default();
        let tests = source.name.ends_with("tests.rs");
        for (number, line) in code.lines().enumerate().filter(|_| !tests) {
            let small = line.to_lowercase();
            for word in PAPER_WORDS {
                let whole = |at: usize| {
                    let ends = |c: Option<char>| !c.is_some_and(char::is_alphanumeric);
                    ends(small[..at].chars().next_back()) && ends(small[at + word.len()..].chars().next())
                };
                let says = small.match_indices(word).any(|(at, _)| whole(at));
                assert!(!says, "src/{}:{} says {word:?}: {line}", source.name, number + 1);
            }
            // A figure's number without an author is this paper's.
            let figure = ["fig. ", "figs ", "figure "]
                .iter()
                .any(|f| small.split(f).skip(1).any(|after| after.starts_with(|c: char| c.is_ascii_digit())));
            let cited = small.contains("19") || small.contains("20");
            assert!(!figure || cited, "src/{}:{} names a figure without its paper: {line}", source.name, number + 1);
        }
    }
}

#[test]
fn the_detector_detects() {
    // A wall test that cannot see an import would pass for ever.
    let rooms = |module: &[&str], text: &str| -> Vec<String> {
        let module: Vec<String> = module.iter().map(|m| (*m).to_owned()).collect();
        let room = module.first().cloned().unwrap_or_default();
        let source = Source::new(String::new(), room, &module, true, text.to_owned());
        source.rooms().into_iter().map(str::to_owned).collect()
    };
    for text in [
        "use crate::job::spec::RunSpec;",
        "pub use crate::job::spec as other;",
        "use crate::{num::Dual, job::{spec, table::{Entry}}};",
        "use crate::{\n    // a comment\n    job,\n};",
        "use super::super::job::spec;",
        "use super::super::{num, job};",
        "fn f() { let x = crate::job::f(); }",
        "fn f() -> super::super::job::T { panic!() }",
        "const X: u8 = vec![crate::job::X];",
        "fn f<'a>(c: char) { if c == '\"' { crate::job::f(\"'\") } }",
        "fn f() { g(r#\"\"#, '\\'', twofold::job::f()) }",
    ] {
        assert!(rooms(&["analyse", "path"], text).contains(&"job".to_owned()), "{text}");
    }
    for text in [
        "// use crate::job::spec;",
        "/* use crate::job; /* nested */ use crate::job::x; */",
        "const S: &str = \"crate::job::x\";",
        "const S: &str = r##\"crate::job::x \"# \"##;",
        "#[cfg(test)]\nmod tests { use crate::job::spec; fn f() {} }",
        "#[cfg(test)]\nuse crate::job::spec;",
        "use super::job::x;",
        "use crate::analyse::job::x;",
    ] {
        assert!(!rooms(&["analyse", "path"], text).contains(&"job".to_owned()), "{text}");
    }
    // What follows a test is seen again.
    let after = "#[cfg(test)]\nmod tests { fn f() {} }\nuse crate::job::spec;";
    assert_eq!(rooms(&["analyse"], after), ["job"]);
    // Binaries and figures know the library by its name.
    let figure = Source::new(String::new(), "figures".into(), &[], false, "use twofold::{cli, paper::x};".into());
    assert_eq!(figure.rooms().into_iter().collect::<Vec<_>>(), ["cli", "paper"]);
    let library = |text: &str| Source::new(String::new(), "job".into(), &[], true, text.into());
    assert!(library("let x = libm::exp(1.0);").names("libm"));
    assert!(!library("let x = my_libm::exp(1.0);").names("libm"));
    assert!(library("use std::{fs, io};").names("std::fs"));
    // And the house itself is seen.
    assert!(sources().iter().any(|s| s.room == "job" && s.rooms().contains("integrate")));
    assert!(sources().iter().any(|s| s.room == "bin" && s.rooms().contains("cli")));
    assert!(sources().iter().any(|s| s.room == "figures" && s.rooms().contains("paper")));
}
