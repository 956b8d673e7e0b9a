//! A folder's files, in an order that does not depend on the file system.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use super::files::{self, FileError};

/// A file of a folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FileBytes {
    /// Its path inside the folder, with forward slashes.
    pub path: String,
    /// Its content.
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

/// A folder's files, and the entries that were not read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Tree {
    /// Sorted by path.
    pub files: Vec<FileBytes>,
    /// Wanted names behind which there is nothing: links to files that are gone. Sorted.
    pub dangling: Vec<String>,
}

/// Maximum depth of folders: a figure's files are one folder down.
const DEPTH: usize = 4;

/// The most that is read of a folder: all full-length figures have some 250 MB.
const LARGEST_TREE: u64 = 4 << 30;

/// Reads every file under `folder` whose path inside it is `wanted`, sorted by path. Hidden files
/// and folders are passed over, and so are names that are not Unicode.
///
/// # Errors
/// If the folder or a file cannot be read, or there is more of them than fits in memory.
pub fn read_tree(folder: &Path, wanted: &dyn Fn(&str) -> bool) -> Result<Tree, FileError> {
    let read = |path: String, file: &Path| Ok(FileBytes { bytes: files::read(file)?, path });
    let (files, dangling) = visit_tree(folder, wanted, &read)?;
    Ok(Tree { files, dangling })
}

/// Names of what is in a folder, sorted; none if it does not exist. Names that are not Unicode are
/// passed over.
///
/// # Errors
/// If it cannot be listed.
pub fn names(folder: &Path) -> Result<Vec<String>, FileError> {
    let list = |source| FileError { action: "list", path: folder.to_path_buf(), source };
    let entries = match fs::read_dir(folder) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Vec::new()),
        entries => entries.map_err(list)?,
    };
    let mut names = Vec::new();
    for entry in entries {
        names.extend(entry.map_err(list)?.file_name().into_string().ok());
    }
    names.sort();
    Ok(names)
}

/// The first thing in `folder`, at any depth, or itself, that is neither a file nor a folder: a
/// symbolic link, a pipe, a device. None if there is no such folder.
///
/// # Errors
/// If a folder in it cannot be read.
pub fn first_special(folder: &Path) -> Result<Option<PathBuf>, FileError> {
    let cannot = |path: &Path, source: io::Error| FileError {
        action: "read",
        path: path.to_owned(),
        source,
    };
    if folder.is_symlink() {
        return Ok(Some(folder.to_owned()));
    }
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        if !folder.is_dir() {
            continue;
        }
        let entries: Result<Vec<_>, _> =
            fs::read_dir(&folder).and_then(Iterator::collect).map_err(|e| cannot(&folder, e));
        let mut entries: Vec<fs::DirEntry> = entries?;
        entries.sort_by_key(fs::DirEntry::path);
        for entry in entries {
            let path = entry.path();
            let kind = entry.file_type().map_err(|e| cannot(&path, e))?;
            if kind.is_dir() {
                open.push(path);
            } else if !kind.is_file() {
                return Ok(Some(path));
            }
        }
    }
    Ok(None)
}

/// Calls `visit` for every file that [`read_tree`] reads, several in parallel, with its path inside
/// the folder and its full path. Returns the results, and the links that lead nowhere.
///
/// # Errors
/// As [`read_tree`], and the errors of `visit`.
pub fn visit_tree<T: Send>(
    folder: &Path,
    wanted: &dyn Fn(&str) -> bool,
    visit: &(dyn Fn(String, &Path) -> Result<T, FileError> + Sync),
) -> Result<(Vec<T>, Vec<String>), FileError> {
    let mut walk = Walk { wanted, files: Vec::new(), dangling: Vec::new(), bytes: 0 };
    walk.folder(folder, "", DEPTH)?;
    let Walk { mut files, mut dangling, .. } = walk;
    files.sort();
    dangling.sort();
    let made: Result<Vec<T>, FileError> = files
        .into_par_iter()
        .map(|path| {
            let file = folder.join(&path);
            visit(path, &file)
        })
        .collect();
    Ok((made?, dangling))
}

struct Walk<'a> {
    wanted: &'a dyn Fn(&str) -> bool,
    /// Paths inside the folder.
    files: Vec<String>,
    dangling: Vec<String>,
    bytes: u64,
}

impl Walk<'_> {
    fn folder(&mut self, folder: &Path, prefix: &str, depth: usize) -> Result<(), FileError> {
        let list = |source| FileError { action: "list", path: folder.to_path_buf(), source };
        for entry in fs::read_dir(folder).map_err(list)? {
            let entry = entry.map_err(list)?;
            let Ok(name) = entry.file_name().into_string() else { continue };
            if name.starts_with('.') {
                continue;
            }
            let path = entry.path();
            let inside = format!("{prefix}{name}");
            let kind = match fs::metadata(&path) {
                Ok(kind) => kind,
                // A link to nothing, or a file that was removed since its folder was listed.
                Err(e) if e.kind() == io::ErrorKind::NotFound => {
                    if (self.wanted)(&inside) {
                        self.dangling.push(inside);
                    }
                    continue;
                }
                Err(source) => return Err(FileError { action: "read", path, source }),
            };
            if kind.is_dir() {
                if depth > 0 {
                    self.folder(&path, &format!("{inside}/"), depth - 1)?;
                }
            } else if kind.is_file() && (self.wanted)(&inside) {
                self.bytes = self.bytes.saturating_add(kind.len());
                if self.bytes > LARGEST_TREE {
                    let why = format!("the files in it have more than {} GiB", LARGEST_TREE >> 30);
                    let source = io::Error::new(io::ErrorKind::FileTooLarge, why);
                    return Err(FileError { action: "read", path: folder.to_path_buf(), source });
                }
                self.files.push(inside);
            }
        }
        Ok(())
    }
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
        let found = read_tree(folder.path(), &|p| p.ends_with(".txt")).unwrap().files;
        let paths: Vec<&str> = found.iter().map(|f| f.path.as_str()).collect();
        assert_eq!(paths, ["a/c.txt", "b.txt"]);
        assert_eq!(
            (found[0].folder(), found[0].name(), found[0].bytes.as_slice()),
            ("a", "c.txt", &b"a/c.txt"[..])
        );
        assert_eq!(found[1].folder(), "");
    }

    #[cfg(unix)]
    #[test]
    fn links_to_nothing_are_told_apart() {
        let folder = tempfile::tempdir().unwrap();
        files::write(&folder.path().join("a.txt"), b"a").unwrap();
        for name in ["b.txt", "b.png"] {
            std::os::unix::fs::symlink("nowhere", folder.path().join(name)).unwrap();
        }
        let tree = read_tree(folder.path(), &|p| p.ends_with(".txt")).unwrap();
        assert_eq!((tree.files.len(), tree.dangling), (1, vec!["b.txt".to_owned()]));
    }

    #[test]
    fn a_folder_that_is_not_there_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = read_tree(&folder.path().join("nowhere"), &|_| true).unwrap_err().to_string();
        assert!(error.contains("nowhere"), "{error}");
    }

    #[test]
    fn as_deep_and_as_much_as_is_promised() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["1/2/3/4/in.txt", "1/2/3/4/5/out.txt"] {
            files::write(&folder.path().join(name), b"12345").unwrap();
        }
        let tree = read_tree(folder.path(), &|_| true).unwrap();
        let paths: Vec<&str> = tree.files.iter().map(|f| f.path.as_str()).collect();
        assert_eq!(paths, ["1/2/3/4/in.txt"]);
        let after = |already: u64| {
            let mut walk =
                Walk { wanted: &|_| true, files: Vec::new(), dangling: Vec::new(), bytes: already };
            walk.folder(folder.path(), "", DEPTH)
        };
        after(LARGEST_TREE - 5).unwrap();
        assert!(after(LARGEST_TREE - 4).unwrap_err().to_string().contains("more than 4 GiB"));
    }

    #[cfg(unix)]
    #[test]
    fn links_in_a_circle_are_named() {
        let folder = tempfile::tempdir().unwrap();
        std::os::unix::fs::symlink("b", folder.path().join("a")).unwrap();
        std::os::unix::fs::symlink("a", folder.path().join("b")).unwrap();
        assert!(
            read_tree(folder.path(), &|_| true).unwrap_err().to_string().contains("cannot read")
        );
    }
}
