//! Every figure of Jeffrey (2013), and the project's own about it, with the committed references.
//!
//! The paper's computed figures are in `papers/jeffrey-2013`, a paper's folder like any other
//! ([`crate::folder`]); sketches and studies, which are more than runs, are Rust beside their data
//! in the folder's `code`.

use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use crate::folder::Folder;
use crate::paper::Figure;
use crate::record::{FileBytes, FileError, Manifest, read_tree};

pub use super::code::{FILES, FOLDER, data};

fn folder() -> &'static Folder {
    static OWN: OnceLock<Folder> = OnceLock::new();
    OWN.get_or_init(|| {
        Folder::embedded(FOLDER, FILES)
            .expect("the embedded folder is well formed: a test reads it")
    })
}

/// Every figure, in the paper's order, then the project's own.
pub fn all() -> Vec<Figure> {
    let mut all = folder().code.map_or(Vec::new(), |code| (code.figures)());
    all.extend(folder().figures.iter().cloned());
    // The paper's figures are numbered, those of the project are not: its list's order stays.
    all.sort_by_key(|f| if f.id.starts_with("fig") { (0, f.id.clone()) } else { (1, "".into()) });
    all
}

/// A figure by its name.
///
/// # Panics
///
/// If there is none: names are written by programmers.
pub fn named(id: &str) -> Figure {
    all().into_iter().find(|f| f.id == id).unwrap_or_else(|| panic!("there is no figure {id}"))
}

/// The committed manifest of a figure, as text.
pub fn reference(id: &str) -> Option<&'static str> {
    let file = format!("expected/{id}.json");
    FILES.iter().find(|f| f.0 == file).map(|f| f.1)
}

/// Whether a file of a paper's `expected` is a figure's.
fn is_manifest(path: &str) -> bool {
    path.ends_with(".json") && path != "claims.json"
}

/// The references of the paper's folder beside `expected`, if that is a checkout's `figures`.
fn beside(expected: &Path) -> Option<PathBuf> {
    let expected = expected.canonicalize().ok()?;
    let checkout = expected.parent().filter(|_| expected.ends_with("figures"))?;
    Some(checkout.join(FOLDER).join("expected")).filter(|own| own.exists())
}

/// Reference of a figure: that of the paper's folder if `expected` is a checkout's `figures`, else
/// NAME.json in a paper's folder of references, or NAME/expected.json.
pub fn reference_file(expected: &Path, id: &str) -> PathBuf {
    let flat = |folder: &Path| folder.join(format!("{id}.json"));
    match beside(expected) {
        Some(own) => flat(&own),
        None if flat(expected).is_file() => flat(expected),
        None => expected.join(id).join("expected.json"),
    }
}

/// The figure of a reference that lies in a paper's folder as NAME.json.
fn flat_reference(file: &FileBytes) -> Option<String> {
    let name = file.path.strip_suffix(".json").filter(|name| !name.contains('/'))?;
    let text = String::from_utf8_lossy(&file.bytes);
    Manifest::parse(&text, name).is_ok_and(|m| m.figure == name).then(|| name.to_owned())
}

/// The references and pictures in `expected`, each reference as NAME/expected.json.
///
/// # Errors
/// If a file cannot be read.
pub fn references_in(expected: &Path) -> Result<Vec<FileBytes>, FileError> {
    let mut files =
        read_tree(expected, &|path| path.ends_with(".json") || path.ends_with(".png"))?.files;
    for file in &mut files {
        if let Some(name) = flat_reference(file) {
            file.path = format!("{name}/expected.json");
        }
    }
    if let Some(own) = beside(expected) {
        for FileBytes { path, bytes } in read_tree(&own, &is_manifest)?.files {
            files.push(FileBytes {
                path: format!("{}/expected.json", path.trim_end_matches(".json")),
                bytes,
            });
        }
    }
    Ok(files)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_a_checkouts_figures_have_a_paper_beside_them() {
        let folder = tempfile::tempdir().unwrap();
        let own = folder.path().join(FOLDER).join("expected");
        std::fs::create_dir_all(&own).unwrap();
        std::fs::write(own.join("fig7.json"), "{}").unwrap();
        for (name, beside) in [("figures", true), ("out", false)] {
            let expected = folder.path().join(name);
            std::fs::create_dir(&expected).unwrap();
            let file = reference_file(&expected, "fig7");
            assert_eq!(
                file.ends_with("papers/jeffrey-2013/expected/fig7.json"),
                beside,
                "{file:?}"
            );
            assert_eq!(references_in(&expected).unwrap().len(), usize::from(beside));
        }
    }

    #[test]
    fn a_papers_folder_of_references_is_one_by_itself() {
        let own = Path::new(env!("CARGO_MANIFEST_DIR")).join(FOLDER).join("expected");
        assert_eq!(reference_file(&own, "fig7"), own.join("fig7.json"));
        let found = references_in(&own).unwrap();
        for figure in all() {
            let path = format!("{}/expected.json", figure.id);
            assert!(found.iter().any(|f| f.path == path), "{path}");
        }
        assert!(found.iter().all(|f| f.path != "claims/expected.json"));
    }

    /// The folder on disk is the one that is embedded, file by file.
    #[test]
    fn the_embedded_folder_is_the_one_in_the_sources() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join(FOLDER);
        let files = read_tree(&root, &|path| !path.starts_with("out/")).unwrap().files;
        let known = |path: &str| FILES.iter().find(|f| f.0 == path).map(|f| f.1.as_bytes());
        let ours = |path: &str| {
            ["paper.toml", "sentences.toml", "theorems.toml"].contains(&path)
                || path.starts_with("figures/")
                || path.strip_prefix("expected/").is_some_and(is_manifest)
        };
        for file in files.iter().filter(|f| ours(&f.path)) {
            assert!(
                known(&file.path) == Some(file.bytes.as_slice()),
                "{} is not embedded",
                file.path
            );
        }
        assert_eq!(FILES.len(), files.iter().filter(|f| ours(&f.path)).count());
        let read = Folder::read(&root).unwrap();
        assert_eq!(format!("{:?}", read.figures), format!("{:?}", folder().figures));
    }
}
