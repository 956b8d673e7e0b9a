//! Atomic writes. Files are written to a temporary name beside their place and renamed: a reader,
//! or a run that is killed, never sees half a file, and an existing file stays until its successor
//! is whole.
//!
//! A target that is not a regular file (a pipe, a terminal, an open descriptor such as /dev/stdout)
//! is written to and never replaced. A symbolic link is followed, and what it leads to is replaced,
//! not the link. A temporary file is locked by the process that writes it, so that another process
//! can tell those of the dead from those of the living and remove them.

use std::collections::BTreeSet;
use std::fs::{self, File, Metadata, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use tempfile::NamedTempFile;

use super::Hash;

/// A file or folder that could not be read or written.
#[derive(Debug, thiserror::Error)]
#[error("cannot {action} {}: {source}", path.display())]
pub struct FileError {
    /// The operation that failed.
    pub action: &'static str,
    /// On which path.
    pub path: PathBuf,
    /// The system's reason.
    pub source: io::Error,
}

impl FileError {
    fn new(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> FileError {
        let path = path.to_path_buf();
        move |source| FileError { action, path, source }
    }
}

/// Writes `bytes` to `path`, making its folder; all or nothing. A file that is replaced keeps its
/// permissions; a new one can be read by everybody.
///
/// # Errors
/// If the place cannot be written, is a folder, or is a file that is protected against writing;
/// what was there is unharmed.
pub fn write(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    match place(path).map_err(FileError::new("write", path))? {
        // Appending, because an open descriptor's file may hold what came before us, and a pipe
        // does not mind.
        Place::Stream => OpenOptions::new()
            .append(true)
            .open(path)
            .and_then(|mut f| f.write_all(bytes))
            .map_err(FileError::new("write", path)),
        Place::File { at, old } => {
            let folder = folder_of(&at);
            fs::create_dir_all(folder).map_err(FileError::new("create the folder", folder))?;
            let temporary =
                Temporary::new_in(folder).map_err(FileError::new("write in", folder))?;
            temporary
                .file()
                .write_all(bytes)
                .and_then(|()| temporary.file().sync_data())
                .and_then(|()| like(temporary.file(), old.as_ref()))
                .and_then(|()| temporary.persist(&at))
                .map_err(FileError::new("write", path))
        }
    }
}

/// A file that grows: written like [`write()`], part by part, and in its place only when it is
/// finished.
pub struct Growing {
    path: PathBuf,
    to: Growth,
}

enum Growth {
    Stream(File),
    File { temporary: Temporary, at: PathBuf, old: Box<Option<Metadata>> },
}

impl Growing {
    /// Begins a file for `path`.
    ///
    /// # Errors
    /// As [`write()`].
    pub fn begin(path: &Path) -> Result<Self, FileError> {
        let to = match place(path).map_err(FileError::new("write", path))? {
            Place::Stream => Growth::Stream(
                OpenOptions::new()
                    .append(true)
                    .open(path)
                    .map_err(FileError::new("write", path))?,
            ),
            Place::File { at, old } => {
                let folder = folder_of(&at);
                fs::create_dir_all(folder).map_err(FileError::new("create the folder", folder))?;
                let temporary =
                    Temporary::new_in(folder).map_err(FileError::new("write in", folder))?;
                Growth::File { temporary, at, old: Box::new(old) }
            }
        };
        Ok(Self { path: path.to_path_buf(), to })
    }

    /// Appends.
    ///
    /// # Errors
    /// If the bytes cannot be written.
    pub fn append(&mut self, bytes: &[u8]) -> Result<(), FileError> {
        match &mut self.to {
            Growth::Stream(file) => file.write_all(bytes),
            Growth::File { temporary, .. } => temporary.file().write_all(bytes),
        }
        .map_err(FileError::new("write", &self.path))
    }

    /// Puts the file in its place, or in another one.
    ///
    /// # Errors
    /// If it cannot be put there; what was there is unharmed.
    pub fn finish(self, instead: Option<&Path>) -> Result<(), FileError> {
        let Self { path, to } = self;
        let Growth::File { temporary, mut at, mut old } = to else { return Ok(()) };
        if let Some(instead) = instead {
            match place(instead).map_err(FileError::new("write", instead))? {
                Place::Stream => {
                    let why =
                        io::Error::new(io::ErrorKind::AlreadyExists, "it is no ordinary file");
                    return Err(FileError::new("write", instead)(why));
                }
                Place::File { at: other, old: there } => (at, *old) = (other, there),
            }
        }
        temporary
            .file()
            .sync_data()
            .and_then(|()| like(temporary.file(), (*old).as_ref()))
            .and_then(|()| temporary.persist(&at))
            .map_err(FileError::new("write", instead.unwrap_or(&path)))
    }
}

/// Tries whether [`write()`] can write to `path`, and leaves everything as it is: for use before a
/// long computation.
///
/// # Errors
/// As [`write()`].
pub fn try_place(path: &Path) -> Result<(), FileError> {
    match place(path).map_err(FileError::new("write", path))? {
        // Opening a pipe would block until it has a reader.
        Place::Stream => Ok(()),
        Place::File { at, old } => {
            if cfg!(windows) && old.is_some() {
                // A spreadsheet that shows a file there does not let it be replaced: better said
                // now than after an hour.
                OpenOptions::new().append(true).open(&at).map_err(FileError::new("write", path))?;
            }
            try_folder(folder_of(&at))
        }
    }
}

/// Tries whether files can be made in `folder`, or if it is not there, in the nearest folder above
/// it that is.
///
/// # Errors
/// If they cannot.
pub fn try_folder(folder: &Path) -> Result<(), FileError> {
    let there = folder.ancestors().find(|f| f.as_os_str().is_empty() || fs::metadata(f).is_ok());
    let there = there.filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
    Temporary::new_in(there).map(drop).map_err(FileError::new("write in", there))
}

/// Target of a write.
enum Place {
    /// Something that is written to as it stands.
    Stream,
    /// A regular file, or a place where none is yet.
    File { at: PathBuf, old: Option<Metadata> },
}

/// More links than any system follows.
const MOST_LINKS: usize = 40;

/// Follows links to the end.
fn place(path: &Path) -> io::Result<Place> {
    let mut at = path.to_path_buf();
    for followed in 0..MOST_LINKS {
        if is_descriptor(&at) {
            return Ok(Place::Stream);
        }
        let found = match fs::symlink_metadata(&at) {
            Ok(found) => found,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                if followed > 0 && !folder_of(&at).is_dir() {
                    let why = format!(
                        "it is a link into a folder that is not there, {}",
                        folder_of(&at).display()
                    );
                    return Err(io::Error::new(io::ErrorKind::NotFound, why));
                }
                return Ok(Place::File { at, old: None });
            }
            Err(e) => return Err(e),
        };
        if found.is_symlink() {
            at = folder_of(&at).join(fs::read_link(&at)?);
        } else if found.is_dir() {
            return Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder"));
        } else if !found.is_file() {
            return Ok(Place::Stream);
        } else if found.permissions().readonly() {
            return Err(io::Error::new(
                io::ErrorKind::PermissionDenied,
                "the file is protected against writing",
            ));
        } else {
            return Ok(Place::File { at, old: Some(found) });
        }
    }
    Err(io::Error::other("links that lead to each other"))
}

/// Whether the path names an open descriptor of a process, such as /dev/fd/3.
fn is_descriptor(path: &Path) -> bool {
    let folder = fs::canonicalize(folder_of(path)).unwrap_or_default();
    folder == Path::new("/dev/fd") || folder.starts_with("/proc") && folder.ends_with("fd")
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Gives a new file the permissions of the one it replaces; those of a published file, whatever the
/// umask, if it replaces none.
fn like(file: &File, old: Option<&Metadata>) -> io::Result<()> {
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        let mode = old.map_or(0o644, |m| m.permissions().mode() & 0o7777);
        file.set_permissions(fs::Permissions::from_mode(mode))
    }
    #[cfg(not(unix))]
    {
        let _ = (file, old);
        Ok(())
    }
}

const PREFIX: &str = ".twofold-";
const SUFFIX: &str = ".tmp";
/// Random characters between them.
const RANDOM: usize = 6;

/// Unfinished writes of this process, for [`abandon`].
static UNDER_WAY: Mutex<UnderWay> =
    Mutex::new(UnderWay { temporaries: BTreeSet::new(), swept: BTreeSet::new() });

struct UnderWay {
    temporaries: BTreeSet<PathBuf>,
    swept: BTreeSet<PathBuf>,
}

fn under_way() -> MutexGuard<'static, UnderWay> {
    UNDER_WAY.lock().unwrap_or_else(PoisonError::into_inner)
}

/// A file that is being written: locked, known to [`abandon`], removed when dropped.
struct Temporary {
    file: NamedTempFile,
    known: Known,
}

/// An entry in [`UNDER_WAY`].
struct Known(PathBuf);

impl Drop for Known {
    fn drop(&mut self) {
        under_way().temporaries.remove(&self.0);
    }
}

impl Temporary {
    /// Makes one. The first of a folder also removes what dead processes left there.
    fn new_in(folder: &Path) -> io::Result<Self> {
        let first = under_way().swept.insert(folder.to_path_buf());
        if first {
            sweep(folder);
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(PREFIX).suffix(SUFFIX).rand_bytes(RANDOM);
        for _ in 0..16 {
            let temporary = {
                let mut mine = under_way();
                let file = builder.tempfile_in(folder)?;
                mine.temporaries.insert(file.path().to_path_buf());
                Self { known: Known(file.path().to_path_buf()), file }
            };
            // Another process that sweeps may have come between making and locking.
            match temporary.file().try_lock() {
                Ok(()) if temporary.file.path().exists() => return Ok(temporary),
                Ok(()) | Err(TryLockError::WouldBlock) => {}
                // Without locks on this file system, no process takes the file for an abandoned one
                // either.
                Err(TryLockError::Error(_)) => return Ok(temporary),
            }
        }
        Err(io::Error::other("other processes keep removing the temporary files in it"))
    }

    fn file(&self) -> &File {
        self.file.as_file()
    }

    /// Puts the file in its place.
    fn persist(self, place: &Path) -> io::Result<()> {
        let Self { file, known } = self;
        let mine = under_way();
        // Not by tempfile: of the two ways in which Windows replaces a file, it uses only the one
        // that fails while the file is open.
        let (open, temporary) = file.into_parts();
        let done = temporary.keep().map_err(|e| e.error).and_then(|temporary| {
            patiently(|| fs::rename(&temporary, place))
                .inspect_err(|_| drop(fs::remove_file(&temporary)))
        });
        drop(open);
        drop(mine);
        drop(known);
        done
    }
}

/// Number of retries while another process holds a file, and the pause between them.
const TRIES: usize = 50;
const PAUSE: Duration = Duration::from_millis(10);

/// Retries an operation that Windows refuses while another process holds the file: another of our
/// processes, a search index, a virus scanner. Other systems never refuse it.
fn patiently(mut act: impl FnMut() -> io::Result<()>) -> io::Result<()> {
    // "Access is denied" and "it is being used by another process", by Windows' numbers.
    let in_use = |e: &io::Error| cfg!(windows) && matches!(e.raw_os_error(), Some(5 | 32));
    try_again(&mut act, &in_use)
}

fn try_again(
    act: &mut dyn FnMut() -> io::Result<()>,
    in_use: &dyn Fn(&io::Error) -> bool,
) -> io::Result<()> {
    for _ in 0..TRIES {
        match act() {
            Err(e) if in_use(&e) => thread::sleep(PAUSE),
            done => return done,
        }
    }
    act()
}

/// Removes the temporary files that dead processes left in `folder`; returns their number. Those of
/// living processes are locked and stay.
pub fn sweep(folder: &Path) -> usize {
    let Ok(entries) = fs::read_dir(folder) else { return 0 };
    let stale = |entry: &fs::DirEntry| {
        let name = entry.file_name();
        let ours = name
            .to_str()
            .and_then(|n| n.strip_prefix(PREFIX))
            .and_then(|n| n.strip_suffix(SUFFIX))
            .is_some_and(|n| n.len() == RANDOM && n.bytes().all(|b| b.is_ascii_alphanumeric()));
        ours && entry.file_type().is_ok_and(|t| t.is_file())
    };
    let mut removed = 0;
    for entry in entries.flatten().filter(stale) {
        let Ok(file) = OpenOptions::new().read(true).write(true).open(entry.path()) else {
            continue;
        };
        // The lock is held until the file is gone: its maker, if it lives, sees one or the other.
        if file.try_lock().is_ok() && fs::remove_file(entry.path()).is_ok() {
            removed += 1;
        }
    }
    removed
}

/// Removes the temporary files of this process. Afterwards no write of this process begins or ends
/// any more (it waits for ever): only for a process that is about to leave.
pub fn abandon() {
    let mine = under_way();
    for path in &mine.temporaries {
        // A file that cannot be removed now is swept by a later run.
        let _ = fs::remove_file(path);
    }
    std::mem::forget(mine);
}

/// Checks that all written files still exist with their lengths: another process may have removed
/// them since.
///
/// # Errors
/// The first file that is missing or has another length.
pub fn still_there(files: &[(PathBuf, u64)]) -> Result<(), FileError> {
    for (path, length) in files {
        let found = fs::metadata(path).map_err(FileError::new("find again", path))?;
        if found.len() != *length {
            let why = io::Error::other(format!("it has {} bytes instead of {length}", found.len()));
            return Err(FileError::new("find unchanged", path)(why));
        }
    }
    Ok(())
}

/// Removes a file; one that is already gone is no error.
///
/// # Errors
///
/// If the file is there and cannot be removed.
pub fn remove(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(e) if e.kind() != io::ErrorKind::NotFound => Err(FileError::new("remove", path)(e)),
        _ => Ok(()),
    }
}

/// Removes a folder if nothing is in it; one that is not empty stays.
///
/// # Errors
///
/// If it is empty and cannot be removed.
pub fn remove_if_empty(folder: &Path) -> Result<(), FileError> {
    let keeps = [io::ErrorKind::NotFound, io::ErrorKind::DirectoryNotEmpty];
    match fs::remove_dir(folder) {
        Err(e) if !keeps.contains(&e.kind()) => Err(FileError::new("remove", folder)(e)),
        _ => Ok(()),
    }
}

/// The largest file that [`read`] reads: the largest table of a full-length figure has some 20 MB.
pub const LARGEST: u64 = 512 << 20;

/// The largest text that [`read_text`] reads: a spec has 1 kB, a manifest 10.
pub const LARGEST_TEXT: u64 = 16 << 20;

/// Whether a file says at its beginning or end that this program made it.
pub fn is_made_here(path: &Path) -> bool {
    const LOOKED_AT: u64 = 1 << 16;
    let says = || -> io::Result<bool> {
        let mut file = open_plain(path)?;
        let mut bytes = Vec::new();
        (&mut file).take(LOOKED_AT).read_to_end(&mut bytes)?;
        let length = file.metadata()?.len();
        file.seek(io::SeekFrom::Start(length.saturating_sub(LOOKED_AT)))?;
        file.take(LOOKED_AT).read_to_end(&mut bytes)?;
        let text = String::from_utf8_lossy(&bytes);
        Ok(text.contains("\"made_by\":\"twofold ") || text.contains("\"made_by\": \"twofold "))
    };
    says().unwrap_or(false)
}

/// Opens a file of unknown origin: only a plain file, because reading a pipe, a socket or a device
/// may block or never end. Links are followed.
///
/// # Errors
/// If it cannot be opened, or is no plain file.
pub fn open_plain(path: &Path) -> io::Result<File> {
    plain(&fs::metadata(path)?)?;
    let file = File::open(path)?;
    // Between the two calls another file may have been put there.
    plain(&file.metadata()?)?;
    Ok(file)
}

/// Refuses what is no plain file.
pub(super) fn plain(what: &Metadata) -> io::Result<()> {
    match what.file_type() {
        kind if kind.is_file() => Ok(()),
        kind if kind.is_dir() => Err(io::Error::new(io::ErrorKind::IsADirectory, "it is a folder")),
        _ => {
            let why =
                "it is no plain file (a pipe, a socket or a device); give a copy of what is in it";
            Err(io::Error::new(io::ErrorKind::InvalidInput, why))
        }
    }
}

/// Reads a whole plain file of at most [`LARGEST`] bytes.
///
/// # Errors
/// If it cannot be read, is larger, or is no plain file.
pub fn read(path: &Path) -> Result<Vec<u8>, FileError> {
    open_plain(path).and_then(|f| at_most(f, LARGEST)).map_err(FileError::new("read", path))
}

/// The digest of a plain file, however large, and its length.
///
/// # Errors
/// If it cannot be read, or is no plain file.
pub fn digest(path: &Path) -> Result<(Hash, u64), FileError> {
    open_plain(path).and_then(Hash::of_stream).map_err(FileError::new("read", path))
}

/// Reads a whole plain text file of at most [`LARGEST_TEXT`] bytes.
///
/// # Errors
/// If it cannot be read, is larger, is no plain file, or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String, FileError> {
    open_plain(path).and_then(text).map_err(FileError::new("read", path))
}

/// Reads a whole text of at most [`LARGEST_TEXT`] bytes from a stream; its `name` is for the
/// message.
///
/// # Errors
/// As [`read_text`].
pub fn read_text_from(stream: impl Read, name: &str) -> Result<String, FileError> {
    text(stream).map_err(FileError::new("read", Path::new(name)))
}

fn text(stream: impl Read) -> io::Result<String> {
    String::from_utf8(at_most(stream, LARGEST_TEXT)?)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8 text"))
}

/// Everything in a stream. The stream is not asked how long it is: a device would not know.
fn at_most(stream: impl Read, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    stream.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit {
        let why = format!("it is larger than {} MiB, the most that is read here", limit >> 20);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, why));
    }
    Ok(bytes)
}

/// Whether a closed terminal ends this process: on Linux, unless the signal is ignored, as under
/// `nohup`. False elsewhere, where that is not known.
pub fn closed_terminal_ends() -> bool {
    // Signals that are ignored, as a bit mask; that of SIGHUP is the lowest.
    let ignored = |status: &str| {
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"))?;
        Some(u64::from_str_radix(mask.trim(), 16).ok()? & 1 != 0)
    };
    fs::read_to_string("/proc/self/status").is_ok_and(|status| ignored(&status) == Some(false))
}

#[cfg(test)]
mod tests;
