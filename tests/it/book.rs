//! The book under docs/: every command in it is run, every link and every chapter exists.
//!
//! A block ```` ```sh ```` holds commands, one a line; `sh,exit=N` those that must end with another
//! exit code than 0. A block after a line `<!-- file: NAME -->` is written to that file first. A
//! chapter's commands are run in their order, in a folder of their own, through a shell, with the
//! program that was built for the tests. A picture in docs/CHAPTER is the one that a command of the
//! chapter writes under its name; `TWOFOLD_UPDATE=1` writes it anew.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

const ROOT: &str = env!("CARGO_MANIFEST_DIR");

/// An action that a chapter asks for.
#[derive(Debug, PartialEq)]
enum Action {
    Write { file: String, text: String },
    Run { command: String, exit: i32, line: usize },
}

/// The pictures that chapters show of their commands: those in a folder of the chapter's name.
fn pictures() -> BTreeSet<PathBuf> {
    chapters()
        .iter()
        .filter_map(|chapter| fs::read_dir(chapter.with_extension("")).ok())
        .flat_map(|folder| folder.map(|e| e.unwrap().path()))
        .collect()
}

/// Reads a chapter's blocks.
fn actions(text: &str) -> Vec<Action> {
    let mut actions = Vec::new();
    let mut file: Option<String> = None;
    let mut lines = text.lines().enumerate();
    while let Some((_, line)) = lines.next() {
        if let Some(name) = line.strip_prefix("<!-- file: ").and_then(|l| l.strip_suffix(" -->")) {
            file = Some(name.to_owned());
            continue;
        }
        let Some(language) = line.strip_prefix("```") else { continue };
        let block: Vec<(usize, &str)> =
            lines.by_ref().take_while(|(_, l)| !l.starts_with("```")).collect();
        if let Some(file) = file.take() {
            actions.push(Action::Write {
                file,
                text: block.iter().map(|(_, l)| format!("{l}\n")).collect(),
            });
            continue;
        }
        let mut words = language.split(',').map(str::trim);
        if words.next() != Some("sh") {
            continue;
        }
        let exit = words
            .find_map(|w| w.strip_prefix("exit="))
            .map_or(0, |n| n.parse().expect("an exit code"));
        let mut open = String::new();
        for (number, line) in block {
            open.push_str(line.trim());
            if let Some(start) = open.strip_suffix('\\') {
                open = start.to_owned();
                continue;
            }
            if !open.is_empty() && !open.starts_with('#') {
                actions.push(Action::Run { command: open.clone(), exit, line: number + 1 });
            }
            open.clear();
        }
        assert!(open.is_empty(), "a command goes on behind its block: {open}");
    }
    actions
}

fn chapters() -> Vec<PathBuf> {
    let mut chapters: Vec<PathBuf> = fs::read_dir(Path::new(ROOT).join("docs"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.extension().is_some_and(|e| e == "md"))
        .collect();
    chapters.sort();
    chapters
}

#[test]
fn every_command_of_the_book_does_what_it_says() {
    let program = Path::new(env!("CARGO_BIN_EXE_twofold"));
    let path = std::env::join_paths(
        [program.parent().unwrap().to_path_buf()]
            .into_iter()
            .chain(std::env::split_paths(&std::env::var_os("PATH").unwrap())),
    )
    .unwrap();
    let makefile = ["Makefile", "papers/jeffrey-2013/sweeps.mk"]
        .map(|file| fs::read_to_string(Path::new(ROOT).join(file)).unwrap())
        .concat();
    let mut unseen = pictures();
    let mut run = 0;
    for chapter in chapters() {
        let folder = tempfile::tempdir().unwrap();
        // Systems that ship are named as a reader in a clone names them.
        let systems = Path::new(ROOT).join("systems");
        fs::create_dir(folder.path().join("systems")).unwrap();
        for system in
            fs::read_dir(systems).unwrap().map(|e| e.unwrap().path()).filter(|p| p.is_file())
        {
            fs::copy(&system, folder.path().join("systems").join(system.file_name().unwrap()))
                .unwrap();
        }
        for action in actions(&fs::read_to_string(&chapter).unwrap()) {
            match action {
                Action::Write { file, text } => {
                    let place = folder.path().join(&file);
                    assert!(place.starts_with(folder.path()) && !file.contains(".."), "{file}");
                    fs::write(place, text).unwrap();
                }
                Action::Run { command, exit, line } => {
                    let place = format!(
                        "{}:{line}: {command}",
                        chapter.file_name().unwrap().to_string_lossy()
                    );
                    if let Some(target) = command.strip_prefix("make ") {
                        // The targets of make are tested elsewhere; here, that they exist.
                        let target = target.split_whitespace().next().unwrap();
                        assert!(
                            makefile.lines().any(|l| l.starts_with(&format!("{target}:"))),
                            "{place}: no such target"
                        );
                        continue;
                    }
                    if ["cargo ", "pip ", "mdbook ", "python"]
                        .iter()
                        .any(|p| command.starts_with(p))
                    {
                        continue;
                    }
                    let known = command.starts_with("twofold ") || command.starts_with("cmp ");
                    assert!(known, "{place}: a command that no test would run");
                    let output = Command::new("sh")
                        .args(["-c", &command])
                        .current_dir(folder.path())
                        .env("PATH", &path)
                        .output()
                        .unwrap();
                    let said = String::from_utf8_lossy(&output.stderr);
                    if command.starts_with("twofold check")
                        && std::env::var_os("TWOFOLD_BLESS").is_some()
                    {
                        // The references are about to be made anew.
                        assert!(matches!(output.status.code(), Some(0 | 1)), "{place}\n{said}");
                        continue;
                    }
                    assert_eq!(output.status.code(), Some(exit), "{place}\n{said}");
                    assert_eq!(exit == 0, !said.contains("error:"), "{place}\n{said}");
                    let out = command
                        .split(" --out ")
                        .nth(1)
                        .and_then(|rest| rest.split_whitespace().next());
                    if let Some(out) = out.filter(|out| exit == 0 && *out != "-") {
                        let there = fs::metadata(folder.path().join(out));
                        assert!(
                            there.is_ok_and(|m| m.is_dir() || m.len() > 100),
                            "{place}: {out} was not written"
                        );
                    }
                    for shown in ["--out", "--plot"] {
                        let named = command.split_whitespace().skip_while(|w| *w != shown).nth(1);
                        let Some(name) = named else { continue };
                        let shown = chapter.with_extension("").join(name);
                        if !unseen.remove(&shown) {
                            continue;
                        }
                        let made = fs::read(folder.path().join(name)).unwrap();
                        if std::env::var_os("TWOFOLD_UPDATE").is_some() {
                            fs::write(&shown, made).unwrap();
                        } else {
                            let same = fs::read(&shown).unwrap() == made;
                            assert!(same, "{place}: {} is another picture", shown.display());
                        }
                    }
                    run += 1;
                }
            }
        }
    }
    assert!(run >= 20, "only {run} commands were found");
    assert!(unseen.is_empty(), "no command of their chapter makes {unseen:?}");
}

/// The anchor of a heading, as GitHub and mdBook make it.
fn slug(heading: &str) -> String {
    let words = heading.trim_start_matches('#').trim().to_lowercase();
    words
        .chars()
        .filter(|c| c.is_alphanumeric() || " -_".contains(*c))
        .collect::<String>()
        .replace(' ', "-")
}

#[test]
fn every_chapter_is_in_the_summary_and_every_link_leads_somewhere() {
    let docs = Path::new(ROOT).join("docs");
    let links = |text: &str| -> Vec<String> {
        text.split("](")
            .skip(1)
            .filter_map(|rest| rest.split(')').next())
            .map(str::to_owned)
            .collect()
    };
    let summary: BTreeSet<String> =
        links(&fs::read_to_string(docs.join("SUMMARY.md")).unwrap()).into_iter().collect();
    for chapter in chapters() {
        let name = chapter.file_name().unwrap().to_string_lossy().into_owned();
        assert!(name == "SUMMARY.md" || summary.contains(&name), "{name} is in no chapter list");
        for link in links(&fs::read_to_string(&chapter).unwrap()) {
            let file = link.split('#').next().unwrap();
            let elsewhere = file.is_empty() || file.contains("://") || file.starts_with("mailto:");
            assert!(elsewhere || docs.join(file).exists(), "{name}: the link {link} leads nowhere");
            let (page, anchor) = link.split_once('#').unwrap_or((&link, ""));
            if page.ends_with(".md") && !page.contains("://") && !anchor.is_empty() {
                let text = fs::read_to_string(docs.join(page)).unwrap();
                let headings = text.lines().filter(|l| l.starts_with('#')).map(slug);
                assert!(
                    headings.into_iter().any(|h| h == anchor),
                    "{name}: {page} has no heading for #{anchor}"
                );
            }
        }
    }
}

#[test]
fn blocks_are_read_as_they_are_meant() {
    let text = "<!-- file: a.toml -->\n```toml\nx = 1\n```\n\n```sh,exit=2\ntwofold run \\\n  \
        --x\n# no\n```\n```text\ntwofold no\n```\n";
    let expected = [
        Action::Write { file: "a.toml".into(), text: "x = 1\n".into() },
        Action::Run { command: "twofold run --x".into(), exit: 2, line: 8 },
    ];
    assert_eq!(actions(text), expected);
}
