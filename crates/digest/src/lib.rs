//! A digest of sources, for build scripts: it decides whether an answer that was stored by another
//! build is still valid.
//!
//! It covers what an answer can depend on and nothing else. Of Rust files it takes the tokens:
//! comments, documentation, blank space and items under `#[cfg(test)]` (with the files of such
//! modules) change nothing. Of other files it takes every byte, but carriage returns, which a
//! checkout may add. Of `Cargo.lock` it takes the packages that a given package is built from.
#![forbid(unsafe_code)]

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io::{Error, ErrorKind, Result};
use std::path::{Path, PathBuf};

use proc_macro2::{Delimiter, TokenStream, TokenTree};
use sha2::{Digest, Sha256};

/// Sources that a digest covers, by path.
#[derive(Default)]
pub struct Sources(BTreeMap<String, Vec<u8>>);

impl Sources {
    /// Adds every file at `root`/`place` (a file or a folder) whose path from `root` `wanted`
    /// accepts. Cargo is told to look at the place.
    ///
    /// # Errors
    ///
    /// If something cannot be read, is not there, or is no Rust though it is called so.
    pub fn add(&mut self, root: &Path, place: &str, wanted: impl Fn(&str) -> bool) -> Result<()> {
        println!("cargo::rerun-if-changed={}", root.join(place).display());
        let (mut files, mut tests) = (Vec::new(), BTreeSet::new());
        collect(&root.join(place), &mut files)?;
        let mut found = BTreeMap::new();
        for file in files {
            let relative = file.strip_prefix(root).unwrap_or(&file);
            // Names with forward slashes: the same on every system.
            let name: Vec<String> =
                relative.iter().map(|part| part.to_string_lossy().into_owned()).collect();
            let name = name.join("/");
            if !wanted(&name) {
                continue;
            }
            let mut bytes = fs::read(&file)?;
            bytes.retain(|b| *b != b'\r');
            if file.extension().is_some_and(|e| e == "rs") {
                let invalid = |e: String| {
                    Error::new(ErrorKind::InvalidData, format!("{}: {e}", file.display()))
                };
                let text = String::from_utf8(bytes).map_err(|e| invalid(e.to_string()))?;
                let (code, modules) = code(&text).map_err(invalid)?;
                bytes = code.into_bytes();
                // Folder of the modules that this file declares: beside lib.rs, main.rs and mod.rs,
                // below others.
                let stem = name.trim_end_matches(".rs");
                let base = match stem.rsplit_once('/') {
                    Some((folder, "lib" | "main" | "mod")) => folder,
                    _ => stem,
                };
                for module in modules {
                    tests.insert(format!("{base}/{module}.rs"));
                    tests.insert(format!("{base}/{module}/"));
                }
            }
            found.insert(name, bytes);
        }
        found.retain(|name, _| {
            !tests.iter().any(|t| name == t || (t.ends_with('/') && name.starts_with(t.as_str())))
        });
        self.0.append(&mut found);
        Ok(())
    }

    /// Adds the packages of the lock file at `path` that `package` is built from, by name, version
    /// and checksum.
    ///
    /// # Errors
    ///
    /// If it cannot be read, or does not hold the package.
    pub fn add_locked(&mut self, path: &Path, package: &str) -> Result<()> {
        println!("cargo::rerun-if-changed={}", path.display());
        let text = fs::read_to_string(path)?;
        // "name" or "name version" -> (its identity, what it depends on).
        let mut packages: BTreeMap<String, (String, Vec<String>)> = BTreeMap::new();
        for entry in text.split("[[package]]").skip(1) {
            let field = |key: &str| {
                let mut lines = entry
                    .lines()
                    .filter_map(|l| l.strip_prefix(key)?.strip_prefix(" = \"")?.strip_suffix('"'));
                lines.next().unwrap_or_default().to_owned()
            };
            let (name, version, sum) = (field("name"), field("version"), field("checksum"));
            let list = entry
                .split_once("dependencies = [")
                .map_or("", |(_, list)| list.split(']').next().unwrap_or_default());
            let needs: Vec<String> = list
                .split(',')
                .map(|d| d.trim().trim_matches('"').to_owned())
                .filter(|d| !d.is_empty())
                .collect();
            let value = (format!("{name} {version} {sum}"), needs);
            packages.insert(format!("{name} {version}"), value.clone());
            packages.insert(name, value);
        }
        let (mut open, mut seen) = (vec![package.to_owned()], BTreeSet::new());
        while let Some(name) = open.pop() {
            let Some((identity, needs)) = packages.get(&name) else {
                return Err(Error::new(
                    ErrorKind::NotFound,
                    format!("{}: no package {name}", path.display()),
                ));
            };
            if seen.insert(identity.clone()) {
                open.extend(needs.iter().cloned());
            }
        }
        let list: Vec<String> = seen.into_iter().collect();
        self.0.insert("Cargo.lock".to_owned(), list.join("\n").into_bytes());
        Ok(())
    }

    /// The digest: 32 hexadecimal digits.
    pub fn digest(&self) -> String {
        let mut digest = Sha256::new();
        for part in self.0.iter().flat_map(|(name, content)| [name.as_bytes(), content]) {
            digest.update((part.len() as u64).to_le_bytes());
            digest.update(part);
        }
        digest.finalize().iter().take(16).map(|b| format!("{b:02x}")).collect()
    }
}

/// Tokens of Rust code, one a line, without comments, documentation and items under `#[cfg(test)]`;
/// and the names of test modules that stand in files of their own.
///
/// # Errors
///
/// If it is no Rust.
pub fn code(text: &str) -> std::result::Result<(String, Vec<String>), String> {
    let tokens: TokenStream = text.parse().map_err(|e| format!("{e}"))?;
    let (mut code, mut modules) = (String::new(), Vec::new());
    write(tokens, &mut code, &mut modules);
    Ok((code, modules))
}

/// Every file at a place, which must exist.
fn collect(place: &Path, files: &mut Vec<PathBuf>) -> Result<()> {
    if !place.is_dir() {
        fs::metadata(place)
            .map_err(|e| Error::new(e.kind(), format!("{}: {e}", place.display())))?;
        files.push(place.to_path_buf());
        return Ok(());
    }
    for entry in fs::read_dir(place)? {
        collect(&entry?.path(), files)?;
    }
    Ok(())
}

/// Writes what tokens say, one a line, without documentation and tests; `modules` gets the names of
/// test modules that stand in files.
fn write(tokens: TokenStream, into: &mut String, modules: &mut Vec<String>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut i = 0;
    while i < tokens.len() {
        match attribute(&tokens[i..]) {
            Some((length, attribute)) if attribute == "cfg(test)" => {
                i += length;
                // To the end of the item: its body or a semicolon.
                let start = i;
                while i < tokens.len() && !ends_item(&tokens[i]) {
                    i += 1;
                }
                i += 1;
                let item: Vec<String> =
                    tokens[start..i.min(tokens.len())].iter().map(ToString::to_string).collect();
                if let [.., "mod", name, ";"] =
                    &item.iter().map(String::as_str).collect::<Vec<_>>()[..]
                {
                    modules.push((*name).to_owned());
                }
            }
            Some((length, attribute)) if attribute.starts_with("doc=") => i += length,
            _ => {
                match &tokens[i] {
                    TokenTree::Group(group) => {
                        let (open, close) = match group.delimiter() {
                            Delimiter::Parenthesis => ("(\n", ")\n"),
                            Delimiter::Brace => ("{\n", "}\n"),
                            Delimiter::Bracket => ("[\n", "]\n"),
                            Delimiter::None => ("", ""),
                        };
                        into.push_str(open);
                        write(group.stream(), into, modules);
                        into.push_str(close);
                    }
                    other => into.push_str(&format!("{other}\n")),
                }
                i += 1;
            }
        }
    }
}

/// Whether an item ends with this token, if it has begun outside all brackets.
fn ends_item(token: &TokenTree) -> bool {
    match token {
        TokenTree::Group(group) => group.delimiter() == Delimiter::Brace,
        TokenTree::Punct(punct) => matches!(punct.as_char(), ';' | ','),
        _ => false,
    }
}

/// If an attribute begins here: how many tokens it takes, and its text without spaces.
fn attribute(tokens: &[TokenTree]) -> Option<(usize, String)> {
    let is =
        |i: usize, c: char| matches!(tokens.get(i), Some(TokenTree::Punct(p)) if p.as_char() == c);
    if !is(0, '#') {
        return None;
    }
    let length = if is(1, '!') { 3 } else { 2 };
    match tokens.get(length - 1) {
        Some(TokenTree::Group(group)) if group.delimiter() == Delimiter::Bracket => {
            Some((length, group.stream().to_string().replace(char::is_whitespace, "")))
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const CODE: &str =
        "/// One.\npub fn one() -> i32 {\n    1 // one\n}\n\n#[cfg(test)]\nmod plain;\n";

    /// The digest of a folder with the sources above after an edit.
    fn after(edit: impl Fn(&Path)) -> String {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        fs::create_dir_all(root.join("src/part")).unwrap();
        for (name, text) in [
            ("lib.rs", CODE),
            ("plain.rs", "fn two() {}"),
            ("part/mod.rs", ""),
            ("data.toml", "a = 1"),
        ] {
            fs::write(root.join("src").join(name), text).unwrap();
        }
        edit(root);
        let mut sources = Sources::default();
        sources.add(root, "src", |name| !name.ends_with(".png")).unwrap();
        sources.digest()
    }

    fn rewritten(from: &'static str, to: &'static str) -> String {
        assert!(CODE.contains(from), "{from}");
        after(|root| fs::write(root.join("src/lib.rs"), CODE.replace(from, to)).unwrap())
    }

    #[test]
    fn what_computes_nothing_changes_nothing() {
        let before = after(|_| {});
        for (from, to) in [
            ("// one", "/* another /* nested */ comment */"),
            ("/// One.", "/// Another documentation, \"quoted\"."),
            ("/// One.", "#[doc = \"One\"]"),
            ("/// One.", "//! Of the file.\n"),
            ("\n\n", "\n\r\n\t \n"),
            (
                "#[cfg(test)]",
                "#[cfg(test)]\nuse std::fs;\n#[cfg(test)]\nfn helper() -> [u8; 2] { [1, 2] \
                    }\n#[cfg(test)]",
            ),
            (
                "#[cfg(test)]",
                "#[cfg(test)]\n#[allow(dead_code)]\nmod tests { fn f() { g(\"}\") } \
                    }\n#[cfg(test)]",
            ),
        ] {
            assert_eq!(rewritten(from, to), before, "{from} -> {to}");
        }
        assert_eq!(
            after(|root| fs::write(root.join("src/plain.rs"), "fn three() {}").unwrap()),
            before
        );
        assert_eq!(after(|root| fs::write(root.join("src/picture.png"), "x").unwrap()), before);
        assert_eq!(after(|root| fs::write(root.join("src/data.toml"), "a = 1\r").unwrap()), before);
    }

    #[test]
    fn what_computes_changes_the_digest() {
        let mut seen = BTreeSet::from([after(|_| {})]);
        for (from, to) in [
            ("    1", "    2"),
            ("one()", "other()"),
            ("#[cfg(test)]", "fn another() {}\n#[cfg(test)]"),
            ("/// One.", "#[inline]"),
            ("#[cfg(test)]", ""),
            ("#[cfg(test)]", "#[cfg(not(test))]"),
        ] {
            assert!(seen.insert(rewritten(from, to)), "{from} -> {to}");
        }
        for (file, text) in [
            ("data.toml", "a = 2"),
            ("part/mod.rs", "fn f() {}"),
            ("part/new.rs", "fn f() {}"),
            ("x.csv", ""),
        ] {
            assert!(
                seen.insert(after(|root| fs::write(root.join("src").join(file), text).unwrap())),
                "{file}"
            );
        }
    }

    #[test]
    fn of_the_lock_file_only_what_a_package_is_built_from() {
        let lock = "version = 4\n\n[[package]]\nname = \"ours\"\nversion = \"1.0.0\"\ndependencies \
            = [\n \"libm\",\n \"rand 0.2.0\",\n]\n\n\
            [[package]]\nname = \"libm\"\nversion = \"0.2.16\"\nchecksum = \"ab\"\n\n\
            [[package]]\nname = \"rand\"\nversion = \"0.1.0\"\n\n[[package]]\nname \
            = \"rand\"\nversion = \"0.2.0\"\n\n\
            [[package]]\nname = \"clap\"\nversion = \"4.0.0\"\ndependencies = [\n \"libm\",\n]\n";
        let digest = |text: &str| {
            let folder = tempfile::tempdir().unwrap();
            let path = folder.path().join("Cargo.lock");
            fs::write(&path, text).unwrap();
            let mut sources = Sources::default();
            sources.add_locked(&path, "ours").map(|()| sources.digest())
        };
        let before = digest(lock).unwrap();
        for unrelated in [("4.0.0", "4.0.1"), ("0.1.0", "0.1.1")] {
            assert_eq!(
                digest(&lock.replace(unrelated.0, unrelated.1)).unwrap(),
                before,
                "{unrelated:?}"
            );
        }
        for related in [("0.2.16", "0.2.17"), ("\"ab\"", "\"ac\""), ("0.2.0", "0.2.1")] {
            assert_ne!(digest(&lock.replace(related.0, related.1)).unwrap(), before, "{related:?}");
        }
        assert!(digest("version = 4\n").is_err());
    }

    #[test]
    fn a_place_that_is_not_there_is_an_error() {
        let folder = tempfile::tempdir().unwrap();
        assert!(Sources::default().add(folder.path(), "src", |_| true).is_err());
        fs::write(folder.path().join("x.rs"), "fn f( {").unwrap();
        assert!(Sources::default().add(folder.path(), "x.rs", |_| true).is_err());
    }
}
