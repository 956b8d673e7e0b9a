//! A file that grows line by line; a kill at any moment leaves all whole lines.
//!
//! Every line carries a digest of itself and is written by one call to the system. A last line that
//! was cut short is dropped when the journal is opened again; a line that was damaged otherwise is
//! an error, because what it said cannot be known. The process that writes holds a lock on the
//! file.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::files::{FileError, plain};
use super::hash::Hash;

/// A journal that is being written.
#[derive(Debug)]
pub struct Journal {
    file: File,
    path: PathBuf,
}

/// Hexadecimal digits of a line's digest.
const DIGEST: usize = 12;

impl Journal {
    /// Opens the journal at `path` for writing, making it and its folder if they are not there.
    /// Returns it with the whole lines that it holds.
    ///
    /// # Errors
    /// If the file cannot be read or written, another process writes it, or it is damaged before
    /// its last line.
    pub fn open(path: &Path) -> Result<(Self, Vec<String>), FileError> {
        let failed =
            |source| FileError { action: "open the journal", path: path.to_path_buf(), source };
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(failed)?;
        }
        match fs::metadata(path) {
            Ok(there) => plain(&there).map_err(failed)?,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {}
            Err(e) => return Err(failed(e)),
        }
        let mut file = OpenOptions::new()
            .read(true)
            .write(true)
            .create(true)
            .truncate(false)
            .open(path)
            .map_err(failed)?;
        file.try_lock().map_err(|e| match e {
            TryLockError::WouldBlock => failed(io::Error::other("another process is writing it")),
            TryLockError::Error(e) => failed(e),
        })?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).map_err(failed)?;
        let (lines, whole) = lines(&bytes).map_err(failed)?;
        file.set_len(whole as u64).and_then(|()| file.seek(SeekFrom::End(0))).map_err(failed)?;
        Ok((Self { file, path: path.to_path_buf() }, lines))
    }

    /// The whole lines of a journal, which another process may be writing.
    ///
    /// # Errors
    /// If it cannot be read or is damaged before its last line.
    pub fn read(path: &Path) -> Result<Vec<String>, FileError> {
        let bytes = super::files::read(path)?;
        let found = lines(&bytes);
        Ok(found
            .map_err(|source| FileError { action: "read", path: path.to_path_buf(), source })?
            .0)
    }

    /// Appends a line.
    ///
    /// # Errors
    /// If it cannot be written.
    ///
    /// # Panics
    /// If it holds a line's end.
    pub fn append(&mut self, line: &str) -> Result<(), FileError> {
        assert!(!line.contains('\n'), "one line at a time");
        let text = format!("{line}\t{}\n", digest(line));
        self.file.write_all(text.as_bytes()).map_err(|source| FileError {
            action: "append to",
            path: self.path.clone(),
            source,
        })
    }

    /// Removes the journal, after its content was written elsewhere.
    ///
    /// # Errors
    /// If it cannot be removed.
    pub fn remove(self) -> Result<(), FileError> {
        super::files::remove(&self.path)
    }
}

fn digest(line: &str) -> String {
    Hash::of(line.as_bytes()).as_str()[..DIGEST].to_owned()
}

/// The whole lines, and how many bytes they are.
fn lines(bytes: &[u8]) -> io::Result<(Vec<String>, usize)> {
    let whole = bytes.iter().rposition(|b| *b == b'\n').map_or(0, |i| i + 1);
    let text = std::str::from_utf8(&bytes[..whole])
        .map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))?;
    let mut found = Vec::new();
    for (i, line) in text.lines().enumerate() {
        match line.rsplit_once('\t') {
            Some((said, seal)) if seal == digest(said) => found.push(said.to_owned()),
            _ => {
                let why = format!("line {} is damaged: its digest is not that of its text", i + 1);
                return Err(io::Error::new(io::ErrorKind::InvalidData, why));
            }
        }
    }
    Ok((found, whole))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_lines_survive_a_cut_anywhere() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("j");
        let (mut journal, none) = Journal::open(&path).unwrap();
        assert!(none.is_empty());
        for line in ["a", "bc\tx", "ä"] {
            journal.append(line).unwrap();
        }
        assert!(Journal::open(&path).unwrap_err().to_string().contains("another process"));
        drop(journal);
        let bytes = std::fs::read(&path).unwrap();
        for cut in 0..=bytes.len() {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            let (mut journal, lines) = Journal::open(&path).unwrap();
            let ends = bytes[..cut].iter().filter(|b| **b == b'\n').count();
            assert_eq!(lines, ["a", "bc\tx", "ä"][..ends]);
            journal.append("next").unwrap();
            assert_eq!(Journal::read(&path).unwrap().last().map(String::as_str), Some("next"));
        }
    }

    #[test]
    fn damage_inside_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("j");
        let (mut journal, _) = Journal::open(&path).unwrap();
        journal.append("first").unwrap();
        journal.append("second").unwrap();
        drop(journal);
        let mut bytes = std::fs::read(&path).unwrap();
        bytes[1] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        assert!(Journal::open(&path).unwrap_err().to_string().contains("line 1 is damaged"));
    }

    #[test]
    fn a_journal_is_gone_when_it_is_removed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("j");
        let (mut journal, _) = Journal::open(&path).unwrap();
        journal.append("a").unwrap();
        journal.remove().unwrap();
        assert!(!path.exists());
    }
}
