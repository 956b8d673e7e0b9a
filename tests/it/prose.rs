//! Rules that the Markdown in the tree keeps, and those for subjects of commits.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{fs, iter};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Folders with Rust sources.
const RUST: [&str; 11] = [
    "crates", "src", "figures", "papers", "tests", "proofs", "examples", "benches", "fuzz",
    "python", "tools",
];

/// Folders with Python sources.
const PYTHON: [&str; 4] = ["python", "scripts", "benches", "cluster"];

/// Every Markdown file that people write, and its text without blocks that programs write.
fn pages() -> Vec<(String, String)> {
    const FOLDERS: [&str; 8] =
        ["", "docs", "notes", "proofs", "python", "benches", "tests/cases", "crates/render/fonts"];
    const MADE: [&str; 2] = ["benches/cost.md", "proofs/forgeries.md"];
    let in_folder = |folder: &&str| -> Vec<PathBuf> {
        fs::read_dir(root().join(folder)).unwrap().map(|e| e.unwrap().path()).collect()
    };
    let mut pages: Vec<_> = FOLDERS
        .iter()
        .flat_map(in_folder)
        .filter(|p| p.extension().is_some_and(|e| e == "md"))
        .map(|p| {
            (p.strip_prefix(root()).unwrap().display().to_string(), fs::read_to_string(&p).unwrap())
        })
        .filter(|(name, text)| !MADE.contains(&name.as_str()) && !text.starts_with("<!-- made by"))
        .map(|(name, text)| (name, by_hand(&text)))
        .collect();
    pages.sort();
    pages
}

/// A page without the blocks that stand between "do not edit" and "end of".
fn by_hand(text: &str) -> String {
    let mut made = false;
    text.lines()
        .filter(|line| {
            // The marks stay: two paragraphs do not become neighbours.
            made &= !line.starts_with("<!-- end");
            let keep = !made;
            made |= line.starts_with("<!--") && line.contains("do not edit");
            keep
        })
        .flat_map(|line| [line, "\n"])
        .collect()
}

/// Lines with their numbers and whether they are code.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str, bool)> {
    let mut fence = false;
    text.lines().enumerate().map(move |(i, line)| {
        let mark = line.trim_start().starts_with("```");
        fence ^= mark;
        (i + 1, line, fence || mark || line.starts_with("    "))
    })
}

#[test]
fn prose_has_at_most_100_columns() {
    let mut long = Vec::new();
    for (name, text) in pages() {
        for (number, line, code) in lines(&text) {
            // A table's row and a picture are one line; a link cannot be wrapped.
            let one = line.trim_start().starts_with(['|'])
                || line.starts_with("![")
                || !line.trim().contains(' ');
            if !code && !one && line.chars().count() > 100 {
                long.push(format!("{name}:{number}"));
            }
        }
    }
    assert!(long.is_empty(), "lines of more than 100 columns: {long:#?}");
}

/// Programs of the comparison with other solvers, whose lines it counts as they are written.
const COUNTED: [&str; 2] = ["compare.py", "systems.py"];

#[test]
fn rust_and_python_have_at_most_100_columns() {
    let mut files = Vec::new();
    for folder in RUST {
        files_of(&root().join(folder), &["rs"], &mut files);
    }
    for folder in PYTHON {
        files_of(&root().join(folder), &["py"], &mut files);
    }
    files.retain(|file| {
        let hybrid = file.parent().is_some_and(|folder| folder.ends_with("benches/hybrid"));
        !(hybrid && COUNTED.iter().any(|name| file.ends_with(name)))
    });
    assert!(files.iter().filter(|file| file.extension().is_some_and(|e| e == "py")).count() > 20);
    let mut long = Vec::new();
    for file in files {
        for (i, line) in fs::read_to_string(&file).unwrap().lines().enumerate() {
            // A table's row is one line; digits, addresses and style sheets cannot be wrapped.
            let row = line.trim_start().trim_start_matches(['/', '!']).starts_with(" |");
            let whole = line.split_whitespace().any(|word| word.chars().count() > 80);
            if line.chars().count() > 100 && !row && !whole {
                long.push(format!("{}:{}", file.display(), i + 1));
            }
        }
    }
    assert!(long.is_empty(), "lines of more than 100 columns: {long:#?}");
}

/// The rules of markdownlint that these pages keep: MD001, MD009, MD012, MD022, MD025, MD031,
/// MD040, MD041.
#[test]
fn markdown_is_well_formed() {
    let mut wrong = Vec::new();
    for (name, text) in pages() {
        let mut say = |number: usize, what: &str| wrong.push(format!("{name}:{number}: {what}"));
        let all: Vec<&str> = text.lines().collect();
        if !all.first().is_some_and(|l| l.starts_with("# ")) {
            say(1, "does not begin with a heading");
        }
        let (mut level, mut fence) = (0, false);
        for (i, line) in all.iter().enumerate() {
            let blank = |at: Option<usize>| {
                at.and_then(|at| all.get(at)).is_none_or(|l| l.trim().is_empty())
            };
            if line.ends_with([' ', '\t']) {
                say(i + 1, "ends with a space");
            }
            if let Some(language) = line.strip_prefix("```") {
                if !fence && language.is_empty() {
                    say(i + 1, "a block of code without a language");
                }
                let outside = if fence { Some(i + 1) } else { i.checked_sub(1) };
                let mark = outside
                    .and_then(|at| all.get(at))
                    .is_some_and(|l| l.starts_with("<!-- file: "));
                if !blank(outside) && !mark {
                    say(i + 1, "a block of code without a blank line around it");
                }
                fence = !fence;
            }
            if fence {
                continue;
            }
            if i > 0 && blank(Some(i)) && blank(Some(i - 1)) && i + 1 < all.len() {
                say(i + 1, "two blank lines");
            }
            let hashes = line.chars().take_while(|c| *c == '#').count();
            if hashes > 0 && line[hashes..].starts_with(' ') {
                if hashes > level + 1 || hashes == 1 && i > 0 && name != "docs/SUMMARY.md" {
                    say(i + 1, "a heading of the wrong level");
                }
                level = hashes;
                if !blank(i.checked_sub(1)) || !blank(Some(i + 1)) {
                    say(i + 1, "a heading without a blank line around it");
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn subjects_of_commits_are_held_to_the_rule() {
    let long = format!("docs: {}", iter::repeat_n('x', 67).collect::<String>());
    for (subject, fine) in [
        ("filippov: find every event of a step", true),
        ("docs, cli: say α = 10⁻¹ in the same way", true),
        (&long[..72], true),
        (long.as_str(), false),
        ("Find every event", false),
        ("filippov: find every event.", false),
        ("filippov:no space", false),
    ] {
        let mut script = Command::new("sh")
            .args(["scripts/subjects.sh", "-"])
            .current_dir(root())
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        script.stdin.take().unwrap().write_all(subject.as_bytes()).unwrap();
        let output = script.wait_with_output().unwrap();
        assert_eq!(
            output.status.success(),
            fine,
            "{subject}: {}",
            String::from_utf8_lossy(&output.stdout)
        );
    }
}

const KINDS: [&str; 4] = ["Tutorial", "How-to", "Reference", "Explanation"];

/// docs/SUMMARY.md lists every page under its kind; the page's first line says the same kind, and
/// for whom it is.
#[test]
fn every_page_of_the_book_says_its_kind_and_its_reader() {
    let mut kind = "Explanation";
    for line in fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap().lines() {
        if let Some(part) = line.strip_prefix("# ").filter(|part| *part != "Summary") {
            kind = KINDS
                .into_iter()
                .find(|k| *k == part)
                .unwrap_or_else(|| panic!("\"{part}\" is no kind of page"));
        }
        let Some((_, file)) = line.split_once("](") else { continue };
        let file = file.trim_end_matches(')');
        let text = fs::read_to_string(root().join("docs").join(file)).unwrap();
        let first = text.lines().skip(1).find(|l| !l.is_empty()).unwrap();
        let said = format!("{kind} for readers ");
        assert!(
            first.starts_with(&said),
            "docs/{file}: its first line is \"{first}\", not \"{said}who ...\""
        );
    }
}

#[test]
fn pages_of_the_book_have_at_most_1500_words() {
    for file in fs::read_dir(root().join("docs")).unwrap().map(|e| e.unwrap().path()) {
        if file.extension().is_some_and(|e| e == "md") {
            let text = fs::read_to_string(&file).unwrap();
            // The marks of tables are no words.
            let words =
                text.split_whitespace().filter(|w| w.chars().any(char::is_alphanumeric)).count();
            assert!(words <= 1500, "{}: {words} words", file.display());
        }
    }
}

#[test]
fn a_version_of_the_changelog_has_at_most_40_lines() {
    for section in fs::read_to_string(root().join("CHANGELOG.md")).unwrap().split("\n## ").skip(1) {
        let lines = section.lines().filter(|l| !l.is_empty()).count();
        assert!(lines <= 40, "{}: {lines} lines", section.lines().next().unwrap());
    }
}

/// Terms that pages link to the glossary where they first use them; its other entries are also
/// ordinary words.
const TERMS: [&str; 22] = [
    "canard",
    "captured",
    "caricature",
    "certificate",
    "census",
    "dense output",
    "double-double",
    "exit rule",
    "Filippov system",
    "Floquet multiplier",
    "funnel",
    "hysteresis",
    "Lyapunov exponent",
    "manifest",
    "Poincaré section",
    "saltation matrix",
    "settled",
    "sliding",
    "switching function",
    "two-fold",
    "verdict",
    "Zeno",
];

/// The prose of a page in one line: no code, tables, headings and pictures.
fn running_text(text: &str) -> String {
    let prose =
        lines(text).filter(|(_, line, code)| !code && !line.starts_with(['#', '|', '!', '<']));
    let joined = prose.flat_map(|(_, line, _)| [line.trim(), " "]).collect::<String>();
    joined.split('`').step_by(2).collect()
}

/// Whether `term`, or its plural, stands in `text` outside the texts of links, before any link to
/// the glossary.
fn first_unlinked(text: &str, term: &str) -> bool {
    let (text, term) = (text.to_lowercase(), term.to_lowercase());
    let target = format!("](glossary.md#{})", term.replace(' ', "-"));
    let mut rest = text.as_str();
    let linked = rest.find(&target);
    let mut at = 0;
    while let Some(found) = rest.find(&term) {
        let (start, end) = (at + found, at + found + term.len());
        let inside = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '-');
        let after = text[end..].strip_prefix('s').unwrap_or(&text[end..]);
        let word = !inside(text[..start].chars().next_back()) && !inside(after.chars().next());
        // A link's text, or its target.
        let open = text[..start].rfind('[').is_some_and(|o| !text[o..start].contains(']'));
        let address = text[..start].rfind("](").is_some_and(|o| !text[o..start].contains(')'));
        if word && !open && !address {
            return linked.is_none_or(|linked| linked > start);
        }
        rest = &text[end..];
        at = end;
    }
    false
}

#[test]
fn terms_are_linked_to_the_glossary_where_they_are_first_used() {
    let glossary = fs::read_to_string(root().join("docs/glossary.md")).unwrap();
    for term in TERMS {
        assert!(glossary.contains(&format!("\n## {term}\n")), "{term} is not in the glossary");
    }
    let mut missing = Vec::new();
    for (name, text) in pages().iter().filter(|(name, _)| name.starts_with("docs/")) {
        if !["docs/glossary.md", "docs/SUMMARY.md"].contains(&name.as_str()) {
            let text = running_text(text);
            missing.extend(
                TERMS.iter().filter(|t| first_unlinked(&text, t)).map(|t| format!("{name}: {t}")),
            );
        }
    }
    assert!(
        missing.is_empty(),
        "link these to docs/glossary.md where they first stand: {missing:#?}"
    );
    assert!(
        first_unlinked("a canard.", "canard")
            && !first_unlinked("a [canard](glossary.md#canard), canard", "canard")
    );
    assert!(!first_unlinked("[Canards](two-fold.md) and canardly", "canard"));
}

/// Files below a folder that end in one of these extensions; no folder that programs fill.
fn files_of(folder: &Path, extensions: &[&str], found: &mut Vec<PathBuf>) {
    for path in fs::read_dir(folder).unwrap().map(|e| e.unwrap().path()) {
        let made = path
            .file_name()
            .is_none_or(|n| ["target", "node_modules", "__pycache__"].iter().any(|m| n == *m));
        if path.is_dir() && !made {
            files_of(&path, extensions, found);
        } else if path.extension().is_some_and(|e| extensions.iter().any(|x| e == *x)) {
            found.push(path);
        }
    }
}

#[test]
fn comments_do_not_begin_in_the_middle_of_a_sentence() {
    let mut files = Vec::new();
    for folder in RUST {
        files_of(&root().join(folder), &["rs"], &mut files);
    }
    assert!(files.len() > 200);
    let mut wrong = Vec::new();
    for file in files {
        for (i, line) in fs::read_to_string(&file).unwrap().lines().enumerate() {
            if line.trim_start().trim_start_matches(['/', '!']).starts_with(" ... ")
                && line.contains("//")
            {
                wrong.push(format!("{}:{}", file.display(), i + 1));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// Lines, from 1, of comments in Rust that begin with "What" or "How": such a fragment says less
/// than the noun that it stands for. A comment begins after code, a blank line or an empty comment.
fn fragments(text: &str) -> Vec<usize> {
    let comment = |line: &str| -> Option<(usize, String)> {
        let line = line.trim_start();
        let slashes = line.len() - line.trim_start_matches(['/', '!']).len();
        line.starts_with("//").then(|| (slashes, line[slashes..].trim().to_owned()))
    };
    let mut before = None;
    let mut found = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let now = comment(line).filter(|(_, words)| !words.is_empty());
        if let Some((kind, words)) = &now {
            let goes_on = before.as_ref().is_some_and(|(other, _)| other == kind);
            if !goes_on && ["What ", "How "].iter().any(|word| words.starts_with(word)) {
                found.push(i + 1);
            }
        }
        before = now;
    }
    found
}

#[test]
fn no_comment_begins_with_a_fragment() {
    let mut files = Vec::new();
    for folder in RUST {
        files_of(&root().join(folder), &["rs"], &mut files);
    }
    files.push(root().join("build.rs"));
    let mut wrong = Vec::new();
    for file in files {
        let lines = fragments(&fs::read_to_string(&file).unwrap());
        wrong.extend(lines.into_iter().map(|line| format!("{}:{line}", file.display())));
    }
    assert!(wrong.is_empty(), "name the item in the first word: {wrong:#?}");
    assert_eq!(fragments("/// What it is.\nlet x;\n    // How it ends.\n"), [1, 3]);
    assert_eq!(fragments("//! One.\n//!\n//! How to read it.\n"), [3]);
    assert!(fragments("// Of that\n// What remains.\n/// Whether it is.\n").is_empty());
}

/// Words of the first versions with a meaning that only their authors knew, and pronouns that stand
/// for a program, a caller or a user. STYLE: the field's word, and the thing itself.
const PRIVATE: [&str; 19] = [
    "desk",
    "bear out",
    "bears out",
    "borne out",
    "bears_out",
    "house",
    "houses",
    "whoever",
    "somebody",
    "anybody",
    "nobody",
    "asked of",
    "at hand",
    "hangs on",
    "that waits for",
    "the one who asked",
    "what becomes of",
    "what comes of",
    "by which method",
];

/// Words that are somebody's field elsewhere, but no name of a part of this program.
const PARTS: [&str; 4] = ["room", "rooms", "wall", "walls"];

/// Whether `text`, in lower case, holds these words, not as a part of longer ones.
fn says(text: &str, words: &str) -> bool {
    let inside = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    text.match_indices(words).any(|(at, _)| {
        !inside(text[..at].chars().next_back()) && !inside(text[at + words.len()..].chars().next())
    })
}

/// Every source and page that people write, by its path from the root: Rust, Python, scripts and
/// Markdown. Not the texts that name the private words: this file, and the note about them.
fn texts() -> Vec<(String, String)> {
    let mut files = Vec::new();
    for folder in RUST {
        files_of(&root().join(folder), &["rs"], &mut files);
    }
    for folder in PYTHON {
        files_of(&root().join(folder), &["py", "sh"], &mut files);
    }
    let named = files.into_iter().map(|path| {
        let name = path.strip_prefix(root()).unwrap().display().to_string().replace('\\', "/");
        let text = fs::read_to_string(&path).unwrap();
        (name, text)
    });
    let mut all: Vec<_> =
        named.chain(pages()).filter(|(name, _)| !name.starts_with("target/")).collect();
    all.retain(|(name, _)| {
        !["tests/it/prose.rs", "notes/words.md", "CHANGELOG.md"].contains(&name.as_str())
    });
    all
}

#[test]
fn no_text_uses_a_private_word() {
    let mut found = Vec::new();
    for (name, text) in texts() {
        let parts = name.ends_with("src/lib.rs")
            || ["docs/architecture.md", "CONTRIBUTING.md"].contains(&name.as_str());
        // Comments and paragraphs are wrapped: two neighbouring lines are read together, without
        // their marks.
        let lines: Vec<String> = text
            .lines()
            .map(|l| {
                l.trim().trim_start_matches(['/', '!', '#', '>', '*', '-']).trim().to_lowercase()
            })
            .collect();
        for (i, line) in lines.iter().enumerate() {
            let next = lines.get(i + 1).map_or("", String::as_str);
            let both = format!("{line} {next}");
            for words in PRIVATE {
                // A user of the operating system is called so.
                let user = line.contains("nogroup");
                if says(&both, words) && !says(next, words) && !user {
                    found.push(format!("{name}:{}: {words:?}", i + 1));
                }
            }
            found.extend(
                PARTS
                    .iter()
                    .filter(|w| parts && says(line, w))
                    .map(|w| format!("{name}:{}: {w:?}", i + 1)),
            );
        }
    }
    assert!(found.is_empty(), "say it in the field's words: {found:#?}");
    assert!(says("is what becomes of it", "what becomes of") && !says("a deskside", "desk"));
}

/// Names of types that once stood for several things.
const ONE_MEANING: [&str; 14] = [
    "Alike", "Course", "Desk", "Fate", "Kind", "Panel", "Passage", "Plan", "Plane", "Run",
    "Settings", "Standing", "Stands", "Watch",
];

#[test]
fn a_type_name_that_stood_for_several_things_stands_for_one() {
    let mut defined = std::collections::BTreeMap::<&str, Vec<String>>::new();
    for (name, text) in texts().iter().filter(|(name, _)| name.ends_with(".rs")) {
        for line in text.lines() {
            let mut words =
                line.split(|c: char| !c.is_alphanumeric() && c != '_').filter(|w| !w.is_empty());
            // `pub(super) struct Name`: the keyword, then the name.
            let Some(_) =
                words.by_ref().take(3).find(|w| ["struct", "enum", "trait", "type"].contains(w))
            else {
                continue;
            };
            let code = !line.trim_start().starts_with("//") && !line.contains('"');
            if let Some(of) =
                words.next().and_then(|w| ONE_MEANING.iter().find(|m| **m == w)).filter(|_| code)
            {
                defined.entry(of).or_default().push(name.clone());
            }
        }
    }
    // `job::Run` is the question of a run.
    for (name, places) in &defined {
        assert!(
            *name == "Run" && places == &["crates/job/src/run.rs"],
            "{name} is defined in {places:?}"
        );
    }
    assert_eq!(defined.len(), 1, "the test sees definitions: {defined:?}");
}

/// Public items that a user begins with, by file: each has an example in its documentation, which
/// `cargo test --doc` runs.
const EXAMPLES: [(&str, &[&str]); 30] = [
    ("num/src/dual.rs", &["struct Dual"]),
    ("num/src/double_double.rs", &["struct DoubleDouble"]),
    ("num/src/multi.rs", &["struct MultiFloat"]),
    ("num/src/interval.rs", &["struct Interval"]),
    ("num/src/random.rs", &["struct RandomStream"]),
    ("system/src/lib.rs", &["trait VectorField", "trait PiecewiseSmooth"]),
    ("system/src/definition.rs", &["fn from_toml"]),
    ("system/src/instance.rs", &["struct System", "fn builtin"]),
    ("system/src/field.rs", &["struct Field"]),
    ("system/src/smoothed.rs", &["struct Smoothed"]),
    ("system/src/filippov.rs", &["fn sliding_field", "fn two_fold"]),
    ("integrate/src/lsoda/mod.rs", &["struct LsodaOf"]),
    ("integrate/src/taylor.rs", &["struct Taylor"]),
    ("integrate/src/layered/mod.rs", &["struct Layered"]),
    ("integrate/src/filippov/engine.rs", &["fn run"]),
    ("integrate/src/filippov/surfaces.rs", &["fn run_two_surfaces"]),
    ("integrate/src/filippov/funnel.rs", &["fn funnel"]),
    ("integrate/src/delay/mod.rs", &["struct Delayed"]),
    ("analyse/src/section.rs", &["struct SectionRecorder"]),
    ("analyse/src/path.rs", &["struct PathRecorder", "struct TimesRecorder"]),
    ("analyse/src/motion.rs", &["struct MotionRecorder"]),
    ("analyse/src/lyapunov.rs", &["fn largest"]),
    ("analyse/src/floquet.rs", &["fn closed_orbit"]),
    ("analyse/src/branch.rs", &["fn follow"]),
    ("rigor/src/cycle.rs", &["fn prove_cycle"]),
    ("job/src/run.rs", &["struct Run"]),
    ("job/src/general.rs", &["struct GeneralRun", "struct GeneralRests"]),
    ("job/src/orbit.rs", &["struct ClosedOrbit"]),
    ("job/src/exponent.rs", &["struct LargestExponent"]),
    ("job/src/store.rs", &["struct Store"]),
];

/// Whether the documentation of `pub item` in this file has an example.
fn has_example(text: &str, item: &str) -> bool {
    let ends = |c: Option<char>| c.is_none_or(|c| !c.is_alphanumeric() && c != '_');
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let is = |line: &str| {
        let rest = line.strip_prefix("pub ").and_then(|l| l.strip_prefix(item));
        rest.is_some_and(|rest| ends(rest.chars().next()))
    };
    let at = lines.iter().position(|line| is(line)).unwrap_or_else(|| panic!("no pub {item}"));
    let above = lines[..at].iter().rev().take_while(|l| l.starts_with("///") || !l.ends_with('}'));
    let docs = above.skip_while(|l| !l.starts_with("///")).take_while(|l| l.starts_with("///"));
    docs.filter(|l| l.starts_with("/// ```")).count() >= 2
}

#[test]
fn what_a_user_begins_with_has_an_example() {
    for (file, items) in EXAMPLES {
        let text = fs::read_to_string(root().join("crates").join(file)).unwrap();
        for item in items {
            assert!(has_example(&text, item), "crates/{file}: pub {item} has no example");
        }
    }
    assert!(!has_example("/// One.\n#[inline]\npub fn one() {}\n", "fn one"));
    assert!(has_example("/// One.\n/// ```\n/// ```\npub fn one<T>() {}\n", "fn one"));
}
