//! Rules that the Markdown in the tree keeps, and those for subjects of commits.

use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::{fs, iter};

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Every Markdown file that people write, and its text without blocks that programs write.
fn pages() -> Vec<(String, String)> {
    const FOLDERS: [&str; 9] =
        ["", "docs", "notes", "proofs", "python", "benches", "tests/cases", "figures", "crates/render/fonts"];
    const MADE: [&str; 3] = ["benches/cost.md", "figures/CHANGES.md", "proofs/forgeries.md"];
    let in_folder = |folder: &&str| -> Vec<PathBuf> {
        fs::read_dir(root().join(folder)).unwrap().map(|e| e.unwrap().path()).collect()
    };
    let mut pages: Vec<_> = FOLDERS
        .iter()
        .flat_map(in_folder)
        .filter(|p| p.extension().is_some_and(|e| e == "md"))
        .map(|p| (p.strip_prefix(root()).unwrap().display().to_string(), fs::read_to_string(&p).unwrap()))
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
            let one = line.trim_start().starts_with(['|']) || line.starts_with("![") || !line.trim().contains(' ');
            if !code && !one && line.chars().count() > 100 {
                long.push(format!("{name}:{number}"));
            }
        }
    }
    assert!(long.is_empty(), "lines of more than 100 columns: {long:#?}");
}

/// The rules of markdownlint that these pages keep: MD001, MD009, MD012, MD022, MD025, MD031, MD040, MD041.
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
            let blank = |at: Option<usize>| at.and_then(|at| all.get(at)).is_none_or(|l| l.trim().is_empty());
            if line.ends_with([' ', '\t']) {
                say(i + 1, "ends with a space");
            }
            if let Some(language) = line.strip_prefix("```") {
                if !fence && language.is_empty() {
                    say(i + 1, "a block of code without a language");
                }
                let outside = if fence { Some(i + 1) } else { i.checked_sub(1) };
                let mark = outside.and_then(|at| all.get(at)).is_some_and(|l| l.starts_with("<!-- file: "));
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
        assert_eq!(output.status.success(), fine, "{subject}: {}", String::from_utf8_lossy(&output.stdout));
    }
}

const KINDS: [&str; 4] = ["Tutorial", "How-to", "Reference", "Explanation"];

/// docs/SUMMARY.md lists every page under its kind; the page's first line says the same kind, and for whom it is.
#[test]
fn every_page_of_the_book_says_its_kind_and_its_reader() {
    let mut kind = "Explanation";
    for line in fs::read_to_string(root().join("docs/SUMMARY.md")).unwrap().lines() {
        if let Some(part) = line.strip_prefix("# ").filter(|part| *part != "Summary") {
            kind = KINDS.into_iter().find(|k| *k == part).unwrap_or_else(|| panic!("\"{part}\" is no kind of page"));
        }
        let Some((_, file)) = line.split_once("](") else { continue };
        let file = file.trim_end_matches(')');
        let text = fs::read_to_string(root().join("docs").join(file)).unwrap();
        let first = text.lines().skip(1).find(|l| !l.is_empty()).unwrap();
        let said = format!("{kind} for readers ");
        assert!(first.starts_with(&said), "docs/{file}: its first line is \"{first}\", not \"{said}who ...\"");
    }
}

#[test]
fn pages_of_the_book_have_at_most_1500_words() {
    for file in fs::read_dir(root().join("docs")).unwrap().map(|e| e.unwrap().path()) {
        if file.extension().is_some_and(|e| e == "md") {
            let text = fs::read_to_string(&file).unwrap();
            // The marks of tables are no words.
            let words = text.split_whitespace().filter(|w| w.chars().any(char::is_alphanumeric)).count();
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
