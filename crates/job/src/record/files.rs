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
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn replaces_whole_and_leaves_no_litter() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b.txt");
        write(&path, b"the first and longer one").unwrap();
        let reader = File::open(&path).unwrap();
        write(&path, b"two").unwrap();
        assert_eq!(read(&path).unwrap(), b"two");
        assert_eq!(names(path.parent().unwrap()), ["b.txt"]);
        // A reader of the old file still has it whole: it was replaced, not written over.
        assert_eq!(at_most(reader, 100).unwrap(), b"the first and longer one");
    }

    #[test]
    fn a_file_in_the_way_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let blocker = folder.path().join("blocker");
        write(&blocker, b"").unwrap();
        for error in [
            write(&blocker.join("x.png"), b"").unwrap_err(),
            try_place(&blocker.join("x.png")).unwrap_err(),
        ] {
            assert!(error.to_string().contains("blocker"), "{error}");
        }
        let error = write(folder.path(), b"").unwrap_err().to_string();
        assert!(error.contains("is a folder"), "{error}");
        assert_eq!(names(folder.path()), ["blocker"]);
    }

    #[test]
    fn a_place_is_tried_without_a_trace() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a/b/c.txt");
        try_place(&path).unwrap();
        try_folder(path.parent().unwrap()).unwrap();
        assert!(names(folder.path()).is_empty());
        write(&path, b"x").unwrap();
        try_place(&path).unwrap();
        assert_eq!(read(&path).unwrap(), b"x");
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_kept_and_else_do_not_depend_on_the_umask() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        let mode = || fs::metadata(&path).unwrap().permissions().mode() & 0o7777;
        write(&path, b"x").unwrap();
        assert_eq!(mode(), 0o644);
        fs::set_permissions(&path, fs::Permissions::from_mode(0o600)).unwrap();
        write(&path, b"secret").unwrap();
        assert_eq!((mode(), read(&path).unwrap().as_slice()), (0o600, &b"secret"[..]));
        fs::set_permissions(&path, fs::Permissions::from_mode(0o444)).unwrap();
        let error = write(&path, b"y").unwrap_err().to_string();
        assert!(error.contains("protected against writing"), "{error}");
        assert!(try_place(&path).is_err());
        assert_eq!(read(&path).unwrap(), b"secret");
    }

    #[cfg(unix)]
    #[test]
    fn links_stay_and_lead_to_the_new_file() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("elsewhere")).unwrap();
        fs::write(at("elsewhere/old"), b"old").unwrap();
        symlink("elsewhere/old", at("first")).unwrap();
        symlink("first", at("second")).unwrap();
        write(&at("second"), b"new").unwrap();
        assert_eq!(fs::read(at("elsewhere/old")).unwrap(), b"new");
        // A link to nothing makes the file that it names.
        symlink("elsewhere/not-yet", at("third")).unwrap();
        write(&at("third"), b"made").unwrap();
        assert_eq!(fs::read(at("elsewhere/not-yet")).unwrap(), b"made");
        for link in ["first", "second", "third"] {
            assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link} was replaced");
        }
        assert_eq!(names(&at("elsewhere")), ["not-yet", "old"]);
        // A link into nowhere, and links in a circle.
        symlink("nowhere/x", at("fourth")).unwrap();
        let error = write(&at("fourth"), b"").unwrap_err().to_string();
        assert!(error.contains("a link into a folder that is not there"), "{error}");
        symlink("sixth", at("fifth")).unwrap();
        symlink("fifth", at("sixth")).unwrap();
        let error = try_place(&at("sixth")).unwrap_err().to_string();
        assert!(error.contains("lead to each other"), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_open_descriptor_is_appended_to() {
        use std::os::fd::AsRawFd;
        let folder = tempfile::tempdir().unwrap();
        let log = folder.path().join("log");
        fs::write(&log, b"keep\n").unwrap();
        let open = OpenOptions::new().write(true).open(&log).unwrap();
        let descriptor = format!("/proc/self/fd/{}", open.as_raw_fd());
        write(Path::new(&descriptor), b"more\n").unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink(&descriptor, &link).unwrap();
        write(&link, b"and more\n").unwrap();
        assert_eq!(fs::read(&log).unwrap(), b"keep\nmore\nand more\n");
        assert_eq!(names(folder.path()), ["link", "log"]);
    }

    #[test]
    fn the_dead_are_swept_and_the_living_are_not() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        for name in
            [".twofold-aB3dE6.tmp", ".twofold-aB3dE6", ".twofold-my-notes.tmp", "aB3dE6.tmp"]
        {
            fs::write(at(name), b"half").unwrap();
        }
        let living = at(".twofold-Living.tmp");
        let held = File::create(&living).unwrap();
        held.lock().unwrap();
        write(&at("x"), b"x").unwrap();
        let left =
            [".twofold-Living.tmp", ".twofold-aB3dE6", ".twofold-my-notes.tmp", "aB3dE6.tmp", "x"];
        assert_eq!(names(folder.path()), left);
        drop(held);
        assert_eq!(sweep(folder.path()), 1);
        assert!(!living.exists());
    }

    /// Writers while others sweep all the time: nothing is lost, nothing stays.
    #[test]
    fn sweeping_never_takes_a_living_file() {
        let folder = tempfile::tempdir().unwrap();
        let done = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            for _ in 0..2 {
                scope.spawn(|| {
                    while !done.load(std::sync::atomic::Ordering::Relaxed) {
                        sweep(folder.path());
                    }
                });
            }
            let writers: Vec<_> = (0..2)
                .map(|w| {
                    let folder = folder.path();
                    scope.spawn(move || {
                        (0..200).all(|i| write(&folder.join(format!("{w}-{i}")), b"whole").is_ok())
                    })
                })
                .collect();
            let whole = writers.into_iter().map(|w| w.join().unwrap()).collect::<Vec<_>>();
            done.store(true, std::sync::atomic::Ordering::Relaxed);
            assert_eq!(whole, [true, true]);
        });
        let names = names(folder.path());
        assert_eq!(names.len(), 400, "{names:?}");
        assert!(names.iter().all(|n| read(&folder.path().join(n)).unwrap() == b"whole"));
    }

    #[test]
    fn what_was_removed_or_cut_meanwhile_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        fs::write(&path, b"1234").unwrap();
        still_there(&[(path.clone(), 4)]).unwrap();
        assert!(
            still_there(&[(path.clone(), 5)])
                .unwrap_err()
                .to_string()
                .contains("4 bytes instead of 5")
        );
        fs::remove_file(&path).unwrap();
        assert!(still_there(&[(path, 4)]).is_err());
    }

    #[test]
    fn reading_is_bounded_and_wants_text() {
        assert_eq!(at_most(&b"1234"[..], 4).unwrap(), b"1234");
        assert_eq!(at_most(io::repeat(0), 4).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        let error = read_text_from(io::repeat(b' '), "endless").unwrap_err().to_string();
        assert!(error.contains("endless") && error.contains("16 MiB"), "{error}");
        assert!(read_text_from(&b"\xff"[..], "x").unwrap_err().to_string().contains("not UTF-8"));
    }

    #[test]
    fn a_folder_may_be_called_like_that_of_descriptors() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("fd/x");
        write(&path, b"the first and longer one").unwrap();
        write(&path, b"two").unwrap();
        assert_eq!(read(&path).unwrap(), b"two");
    }

    #[test]
    fn only_files_with_a_temporary_name_are_swept() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at(".twofold-Folder.tmp")).unwrap();
        let left = [".twofold-Folder.tmp", ".twofold-a-b_c+.tmp", ".twofold-seven77.tmp"];
        for name in [left[1], left[2], ".twofold-abcdef.tmp", ".twofold-UVWXYZ.tmp"] {
            fs::write(at(name), b"half").unwrap();
        }
        assert_eq!(sweep(folder.path()), 2);
        assert_eq!(names(folder.path()), left);
        assert_eq!(sweep(&at("nowhere")), 0);
    }

    #[cfg(unix)]
    #[test]
    fn a_growing_file_is_seen_when_it_is_finished() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        write(&at("old"), b"what was there").unwrap();
        fs::set_permissions(at("old"), fs::Permissions::from_mode(0o640)).unwrap();
        let mut growing = Growing::begin(&at("old")).unwrap();
        growing.append(b"one ").unwrap();
        growing.append(b"two").unwrap();
        assert_eq!(read(&at("old")).unwrap(), b"what was there");
        growing.finish(None).unwrap();
        assert_eq!(read(&at("old")).unwrap(), b"one two");
        // In another place than it was begun for: with the permissions of what is there.
        let mut growing = Growing::begin(&at("new")).unwrap();
        growing.append(b"three").unwrap();
        assert!(growing.finish(Some(folder.path())).is_err());
        let mut growing = Growing::begin(&at("new")).unwrap();
        growing.append(b"three").unwrap();
        growing.finish(Some(&at("old"))).unwrap();
        assert_eq!(read(&at("old")).unwrap(), b"three");
        assert_eq!(fs::metadata(at("old")).unwrap().permissions().mode() & 0o7777, 0o640);
        // One that is never finished leaves nothing.
        drop(Growing::begin(&at("new")).unwrap());
        assert_eq!(names(folder.path()), ["old"]);
    }

    #[test]
    fn removing_what_is_gone_is_no_error() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        write(&path, b"x").unwrap();
        remove(&path).unwrap();
        assert!(!path.exists());
        remove(&path).unwrap();
        assert!(remove(folder.path()).unwrap_err().to_string().contains("cannot remove"));
    }

    #[test]
    fn a_place_where_nothing_can_be_written_is_told_beforehand() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("file");
        write(&file, b"x").unwrap();
        assert!(try_folder(&file.join("deeper/still")).is_err());
        // A name that no file system takes.
        assert!(try_place(&folder.path().join("n".repeat(300))).is_err());
        assert_eq!(names(folder.path()), ["file"]);
    }

    #[test]
    fn what_is_under_way_is_known_until_it_is_done() {
        let folder = tempfile::tempdir().unwrap();
        let known =
            || under_way().temporaries.iter().filter(|p| p.starts_with(folder.path())).count();
        let first = Temporary::new_in(folder.path()).unwrap();
        let second = Temporary::new_in(folder.path()).unwrap();
        assert_eq!(known(), 2);
        drop(first);
        assert_eq!(known(), 1);
        second.persist(&folder.path().join("x")).unwrap();
        assert_eq!(known(), 0);
        assert_eq!(names(folder.path()), ["x"]);
    }

    #[test]
    fn who_stands_in_the_way_for_a_moment_is_waited_for() {
        let busy = |e: &io::Error| e.kind() == io::ErrorKind::ResourceBusy;
        let refused_times = |times: usize, kind: io::ErrorKind| {
            let mut tried = 0;
            let done = try_again(
                &mut || {
                    tried += 1;
                    if tried > times { Ok(()) } else { Err(kind.into()) }
                },
                &busy,
            );
            (done.map_err(|e| e.kind()), tried)
        };
        assert_eq!(refused_times(0, io::ErrorKind::ResourceBusy), (Ok(()), 1));
        assert_eq!(refused_times(3, io::ErrorKind::ResourceBusy), (Ok(()), 4));
        // Not for ever, and not for what will not pass.
        let (never, tried) = refused_times(usize::MAX, io::ErrorKind::ResourceBusy);
        assert_eq!((never, tried), (Err(io::ErrorKind::ResourceBusy), TRIES + 1));
        assert_eq!(
            refused_times(3, io::ErrorKind::StorageFull),
            (Err(io::ErrorKind::StorageFull), 1)
        );
    }

    /// A file that cannot be put in its place leaves nothing behind, and the target stays.
    #[test]
    fn a_place_that_is_taken_meanwhile_leaves_no_litter() {
        let folder = tempfile::tempdir().unwrap();
        let place = folder.path().join("x");
        let temporary = Temporary::new_in(folder.path()).unwrap();
        fs::create_dir_all(place.join("deeper")).unwrap();
        assert!(temporary.persist(&place).is_err());
        assert_eq!(names(folder.path()), ["x"]);
        assert!(place.join("deeper").is_dir());
    }

    /// Windows: a program may keep a file for itself alone.
    #[cfg(windows)]
    #[test]
    fn a_file_that_another_program_keeps_for_itself_is_told_beforehand() {
        use std::os::windows::fs::OpenOptionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        write(&path, b"old").unwrap();
        let alone = OpenOptions::new().read(true).share_mode(0).open(&path).unwrap();
        assert!(try_place(&path).unwrap_err().to_string().contains("cannot write"));
        assert!(write(&path, b"new").is_err());
        drop(alone);
        try_place(&path).unwrap();
        write(&path, b"new").unwrap();
        assert_eq!(
            (read(&path).unwrap().as_slice(), names(folder.path())),
            (&b"new"[..], vec!["x".to_owned()])
        );
    }

    /// Windows: a file that another process reads is replaced when it is closed.
    #[cfg(windows)]
    #[test]
    fn a_file_that_is_read_is_replaced_after_that() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        write(&path, b"old").unwrap();
        let reader = File::open(&path).unwrap();
        let letting_go = thread::spawn(move || {
            thread::sleep(PAUSE * 5);
            drop(reader);
        });
        write(&path, b"new").unwrap();
        letting_go.join().unwrap();
        assert_eq!(
            (read(&path).unwrap().as_slice(), names(folder.path())),
            (&b"new"[..], vec!["x".to_owned()])
        );
    }

    #[test]
    fn a_text_is_read_whole() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        write(&path, "two\nlines, é\n".as_bytes()).unwrap();
        assert_eq!(read_text(&path).unwrap(), "two\nlines, é\n");
        assert!(
            read_text(&folder.path().join("y")).unwrap_err().to_string().contains("cannot read")
        );
    }
}
