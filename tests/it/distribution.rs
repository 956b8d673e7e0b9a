//! Distribution of the project: workflows are pinned and may do little, versions agree, the package
//! holds what it embeds.
//!
//! A package made of this repository has no workflows; there nothing is tested here.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use regex::Regex;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn text(path: impl AsRef<Path>) -> String {
    let path = root().join(path);
    fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// Every YAML file under `.github`.
fn workflows() -> Vec<(PathBuf, String)> {
    fn collect(folder: &Path, found: &mut Vec<(PathBuf, String)>) {
        for entry in fs::read_dir(folder).into_iter().flatten() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                collect(&path, found);
            } else if path.extension().is_some_and(|e| e == "yml") {
                found.push((path.clone(), fs::read_to_string(path).unwrap()));
            }
        }
    }
    let mut found = Vec::new();
    collect(&root().join(".github"), &mut found);
    found.sort();
    found
}

#[test]
fn actions_are_pinned_to_commits_and_each_to_one() {
    let mut pins: BTreeMap<String, String> = BTreeMap::new();
    for (path, text) in workflows() {
        for line in text.lines().map(str::trim) {
            let Some(used) = line.strip_prefix("- uses:").or(line.strip_prefix("uses:")) else {
                continue;
            };
            let wrong = || {
                format!(
                    "{}: {line}: give an action as OWNER/NAME@COMMIT # vRELEASE",
                    path.display()
                )
            };
            let (action, pin) =
                used.trim().split_once('@').unwrap_or_else(|| panic!("{}", wrong()));
            let (commit, release) = pin.split_once(" # v").unwrap_or_else(|| panic!("{}", wrong()));
            let hexadecimal = |c: char| c.is_ascii_digit() || ('a'..='f').contains(&c);
            assert!(commit.len() == 40 && commit.chars().all(hexadecimal), "{}", wrong());
            assert!(release.split('.').count() == 3, "{}", wrong());
            let first = pins.entry(action.to_owned()).or_insert(pin.to_owned());
            assert_eq!(first, pin, "{action} is used at two commits");
        }
    }
    assert!(pins.len() >= 5 || workflows().is_empty(), "{pins:?}");
}

#[test]
fn workflows_may_do_little() {
    for (path, text) in
        workflows().iter().filter(|(p, _)| p.parent().is_some_and(|p| p.ends_with("workflows")))
    {
        let path = path.display();
        assert!(
            text.lines().any(|l| l == "permissions: {}"),
            "{path}: begin with `permissions: {{}}`"
        );
        let jobs = text.matches("    runs-on:").count();
        assert_eq!(
            text.matches("\n    permissions:").count(),
            jobs,
            "{path}: every job says what it may do"
        );
        assert_eq!(
            text.matches("    timeout-minutes:").count(),
            jobs,
            "{path}: every job has an end"
        );
        let checkouts = text.matches("actions/checkout@").count();
        assert_eq!(
            text.matches("persist-credentials: false").count(),
            checkouts,
            "{path}: no job keeps a token"
        );
        for line in text.lines().filter(|l| l.contains(": write")) {
            assert!(line.contains(" # "), "{path}: {line}: say what for");
        }
        let code = text.lines().find(|l| l.contains("run:") && l.contains("${{"));
        assert_eq!(code, None, "{path}: values reach a shell as variables, never as code");
    }
}

#[test]
fn versions_agree() {
    if workflows().is_empty() {
        return;
    }
    let manifest = text("Cargo.toml");
    // Crates of one version belong together.
    let exact = format!("version = \"={}\"", env!("CARGO_PKG_VERSION"));
    for line in manifest.lines().filter(|l| l.starts_with("twofold-") && l.contains("path = ")) {
        assert!(line.contains(&exact), "{line}: {exact}");
    }
    for name in members() {
        assert!(
            text(format!("{name}/Cargo.toml")).contains("\nversion.workspace = true\n"),
            "{name}"
        );
    }
    let toolchain = text("rust-toolchain.toml");
    let channel =
        toolchain.lines().find_map(|l| l.strip_prefix("channel = \"")?.strip_suffix('"')).unwrap();
    assert!(text("Containerfile").contains(&format!("ARG RUST={channel}\n")));
    assert!(text(".github/workflows/ci.yml").contains(&format!("rust-version: {channel}\n")));
}

/// Git for Windows ends lines with two characters by default, also in files that are compiled in or
/// compared byte for byte.
#[test]
fn files_are_checked_out_as_they_are_committed() {
    if workflows().is_empty() {
        return;
    }
    let rules = text(".gitattributes");
    let rules: Vec<&str> = rules.lines().filter(|l| !l.is_empty() && !l.starts_with('#')).collect();
    assert_eq!(
        rules,
        ["* -text"],
        "a rule more may undo the first: see what it does to `git ls-files --eol` under \
            core.autocrlf=true"
    );
}

/// The folders of the workspace's members.
fn members() -> Vec<String> {
    let manifest = text("Cargo.toml");
    let members =
        manifest.lines().find_map(|l| l.strip_prefix("members = [")?.strip_suffix(']')).unwrap();
    let mut found = Vec::new();
    for member in members.split(", ").map(|m| m.trim_matches('"')) {
        match member.strip_suffix("/*") {
            Some(folder) => found.extend(
                fs::read_dir(root().join(folder))
                    .unwrap()
                    .map(|e| format!("{folder}/{}", e.unwrap().file_name().into_string().unwrap())),
            ),
            None => found.push(member.to_owned()),
        }
    }
    assert!(found.len() > 10, "{found:?}");
    found
}

/// Cargo reads every member of a workspace, also of those that it does not build: an image is built
/// from sources that are whole.
#[test]
fn the_image_is_built_from_a_whole_workspace() {
    if workflows().is_empty() {
        return;
    }
    let ignored = text(".containerignore");
    for member in members() {
        let top = member.split('/').next().unwrap();
        assert!(
            ignored.lines().all(|l| l != member && l != top),
            ".containerignore leaves out {member}"
        );
        assert!(root().join(&member).join("Cargo.toml").is_file(), "{member}");
    }
}

/// A crate that is published must build: every file that its sources embed is in its archive.
#[test]
fn the_package_holds_what_it_embeds() {
    if workflows().is_empty() {
        return;
    }
    let packed = |package: &str| -> Vec<String> {
        let list = ["package", "--list", "--allow-dirty", "--package", package];
        let list = Command::new(env!("CARGO")).args(list).current_dir(root()).output().unwrap();
        assert!(list.status.success(), "{}", String::from_utf8_lossy(&list.stderr));
        String::from_utf8(list.stdout).unwrap().lines().map(str::to_owned).collect()
    };
    let embeds = Regex::new(r#"include_(?:str|bytes)!\("([^"]+)"\)"#).unwrap();
    let mut embedded = 0;
    for (package, folder) in [
        ("twofold-dynamics", ""),
        ("twofold-systems", "systems"),
        ("twofold-papers", "papers"),
        ("twofold-jeffrey-2013", "papers/jeffrey-2013/code"),
        ("twofold-paper", "crates/paper"),
        ("twofold-render", "crates/render"),
        ("twofold-verify", "crates/verify"),
    ] {
        let packed = packed(package);
        for source in packed.iter().filter(|f| f.ends_with(".rs") && !f.starts_with("examples/")) {
            let code = text(Path::new(folder).join(source));
            // Tests are run where all files are.
            let code = code.split("#[cfg(test)]").next().unwrap();
            for found in embeds.captures_iter(code) {
                let mut plain = PathBuf::new();
                for part in Path::new(source).parent().unwrap().join(&found[1]).components() {
                    if part.as_os_str() == ".." {
                        plain.pop();
                    } else {
                        plain.push(part);
                    }
                }
                let plain = plain.to_str().unwrap().replace('\\', "/");
                assert!(
                    packed.contains(&plain),
                    "{package}: {source} embeds {plain}, which the package has not"
                );
                embedded += 1;
            }
        }
    }
    assert!(embedded > 30, "only {embedded} embedded files were found");
    let packed = packed("twofold-dynamics");
    for name in [
        "README.md",
        "LICENSE-MIT",
        "LICENSE-APACHE",
        "Cargo.lock",
        "build.rs",
        "rust-toolchain.toml",
    ] {
        assert!(packed.iter().any(|f| f == name), "{name}");
    }
}

/// Names of the packages that a manifest's package is compiled with, from its dependencies and
/// those of its build script on any platform; whether it can do without.
fn compiled_with(manifest: &toml::Table) -> BTreeMap<String, bool> {
    let kinds = ["dependencies", "build-dependencies"];
    let targets = manifest.get("target").and_then(|t| t.as_table()).into_iter().flatten();
    let tables = targets.filter_map(|(_, target)| target.as_table());
    std::iter::once(manifest)
        .chain(tables)
        .flat_map(|table| kinds.map(|kind| table.get(kind)))
        .flatten()
        .filter_map(|dependencies| dependencies.as_table())
        .flatten()
        .map(|(name, of)| {
            let renamed = of.get("package").and_then(|package| package.as_str());
            let optional = of.get("optional").and_then(|of| of.as_bool());
            (renamed.unwrap_or(name).to_owned(), optional.unwrap_or(false))
        })
        .collect()
}

const REMEDY: &str = "run cargo there once without --locked";

#[test]
fn locks_of_their_own_follow_the_manifests() {
    // Benchmarks and fuzzing are no members of the workspace: nothing else notices when a crate
    // is given another dependency, until `--locked` refuses to build them.
    let mut manifests = BTreeMap::new();
    for folder in ["", "systems", "papers", "papers/jeffrey-2013/code"]
        .map(PathBuf::from)
        .into_iter()
        .chain(fs::read_dir(root().join("crates")).unwrap().map(|e| e.unwrap().path()))
    {
        let manifest: toml::Table = text(folder.join("Cargo.toml")).parse().unwrap();
        let name = manifest["package"]["name"].as_str().unwrap().to_owned();
        manifests.insert(name, compiled_with(&manifest));
    }
    for lock in ["benches/Cargo.lock", "fuzz/Cargo.lock"] {
        let locked: toml::Table = text(lock).parse().unwrap();
        let mut seen = 0;
        for package in locked["package"].as_array().unwrap() {
            let name = package["name"].as_str().unwrap();
            let Some(wanted) = manifests.get(name) else { continue };
            let listed = package.get("dependencies").and_then(|of| of.as_array());
            // "rand" or, where there are two of a name, "rand 0.9.1".
            let listed: BTreeSet<String> = listed
                .into_iter()
                .flatten()
                .map(|of| of.as_str().unwrap().split(' ').next().unwrap().to_owned())
                .collect();
            for of in &listed {
                assert!(wanted.contains_key(of), "{lock}: {name} has {of} no more, {REMEDY}");
            }
            for (of, optional) in wanted {
                assert!(*optional || listed.contains(of), "{lock}: {name} lacks {of}, {REMEDY}");
            }
            seen += 1;
        }
        assert!(seen > 10, "{lock}: only {seen} crates of ours");
    }
}

/// Libraries with one set of features in programs and another one in tests are compiled twice, and
/// with them every crate of ours that needs them.
#[test]
fn tests_share_the_libraries_of_the_programs() {
    let libraries = |kinds: &str| -> BTreeMap<String, String> {
        let args = ["tree", "--locked", "--offline", "--prefix", "none", "--format", "{p}|{f}"];
        let tree = Command::new(env!("CARGO"))
            .args(args)
            .args(["--package", "twofold-dynamics", "--edges", kinds])
            .current_dir(root())
            .output()
            .unwrap();
        assert!(tree.status.success(), "{}", String::from_utf8_lossy(&tree.stderr));
        let lines = String::from_utf8(tree.stdout).unwrap();
        let named = lines.lines().filter_map(|line| line.split_once('|'));
        named.map(|(name, of)| (name.to_owned(), of.trim_end_matches(" (*)").to_owned())).collect()
    };
    let (programs, tests) = (libraries("normal,build"), libraries("normal,build,dev"));
    assert!(programs.len() > 50 && tests.len() > programs.len());
    for (name, features) in &programs {
        assert_eq!(tests.get(name), Some(features), "{name}: see rand in Cargo.toml");
    }
}
