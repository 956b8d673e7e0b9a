//! A folder's files, in an order that does not depend on the file system.

use std::fs;
use std::path::Path;

use super::files::{self, FileError};

/// A file of a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileBytes {
    /// Its path inside the folder, with forward slashes.
    pub path: String,
    /// What is in it.
    pub bytes: Vec<u8>,
}

impl FileBytes {
    /// The path without its last part: "" for a file of the folder itself.
    pub fn folder(&self) -> &str {
        self.path.rsplit_once('/').map_or("", |(folder, _)| folder)
    }

    /// The last part of the path.
    pub fn name(&self) -> &str {
        self.path.rsplit_once('/').map_or(&self.path, |(_, name)| name)
    }
}

/// How deep folders are looked into: a figure's files are one folder down.
const DEPTH: usize = 4;

/// Reads every file under `folder` whose path inside it is `wanted`, sorted by path. Hidden files and folders are passed over, and
/// so are names that are not Unicode.
pub fn read_tree(folder: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<Vec<FileBytes>, FileError> {
    let mut found = Vec::new();
    walk(folder, "", DEPTH, wanted, &mut found)?;
    found.sort_by(|a: &FileBytes, b| a.path.cmp(&b.path));
    Ok(found)
}

fn walk(
    folder: &Path,
    prefix: &str,
    depth: usize,
    wanted: &dyn Fn(&str) -> bool,
    found: &mut Vec<FileBytes>,
) -> Result<(), FileError> {
    let list = |source| FileError { action: "list", path: folder.to_path_buf(), source };
    for entry in fs::read_dir(folder).map_err(list)? {
        let entry = entry.map_err(list)?;
        let Ok(name) = entry.file_name().into_string() else { continue };
        if name.starts_with('.') {
            continue;
        }
        let path = entry.path();
        let inside = format!("{prefix}{name}");
        let kind = fs::metadata(&path).map_err(|source| FileError { action: "read", path: path.clone(), source })?;
        if kind.is_dir() {
            if depth > 0 {
                walk(&path, &format!("{inside}/"), depth - 1, wanted, found)?;
            }
        } else if kind.is_file() && wanted(&inside) {
            found.push(FileBytes { path: inside, bytes: files::read(&path)? });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sorted_with_slashes_and_without_hidden_files() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b.txt", "a/c.txt", "a/b.png", ".hidden/x.txt", ".y.txt"] {
            files::write(&folder.path().join(name), name.as_bytes()).unwrap();
        }
        let found = read_tree(folder.path(), &|p| p.ends_with(".txt")).unwrap();
        let paths: Vec<&str> = found.iter().map(|f| f.path.as_str()).collect();
        assert_eq!(paths, ["a/c.txt", "b.txt"]);
        assert_eq!((found[0].folder(), found[0].name(), found[0].bytes.as_slice()), ("a", "c.txt", &b"a/c.txt"[..]));
        assert_eq!(found[1].folder(), "");
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = read_tree(&folder.path().join("nowhere"), &|_| true).unwrap_err().to_string();
        assert!(error.contains("nowhere"), "{error}");
    }
}
