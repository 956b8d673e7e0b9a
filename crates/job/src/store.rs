//! Answers on disk, by key, so that nothing is computed twice.
//!
//! An entry is one file, written to a temporary name and renamed, so that several processes may use
//! one store: who reads sees a whole entry or none. An entry names its question and carries the
//! digest of its own bytes; one that is damaged, cut short, or belongs to another question is
//! noticed and computed again. No link in a store is followed, and nothing in it is removed that is
//! no entry. Nothing that is checked or published rests on a store: see `--fresh`.

use std::fs::{self, FileType};
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::answer::{Answer, Stop};
use super::encode;
use super::question::{NUMERICS, Question};
use crate::record::hash::canonical_json;
use crate::record::{FileError, Hash, files};
use twofold_integrate::Statistics;

/// A folder of answers.
///
/// ```
/// use twofold_job::{Executor, Run, Store, spec::*};
/// use twofold_system::System;
/// let run = RunSpec {
///     system: System::builtin("chua").expect("built in"),
///     switch: SwitchSpec::tanh(1e-2),
///     start: vec![0.1, 0.0, 0.0],
///     t_end: 20.0,
///     method: MethodSpec::ndsolve_defaults(Method::Dopri5),
///     schedule: Default::default(),
///     observe: Observation::Section { coordinate: 1, value: 0.0 },
/// };
/// # let folder = tempfile::tempdir()?;
/// # let folder = folder.path();
/// let executor = Executor::new(Some(Store::new(folder)), &());
/// executor.ask(&Run(run))?; // computed, and kept for the next time
/// assert_eq!(Store::new(folder).entries()?.len(), 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Store {
    folder: PathBuf,
}

/// The content of a store under a key.
#[derive(Clone, Debug, PartialEq)]
pub enum Kept {
    /// The answer.
    Answer(Answer),
    /// Nothing.
    Nothing,
    /// A file that is not the answer, and why.
    Damaged(String),
}

/// First bytes of an entry.
const MAGIC: &[u8; 16] = b"twofold answer 1";
/// Length of the digest at an entry's end, in hexadecimal.
const DIGEST: usize = 64;
/// The files' ending.
const ENDING: &str = "answer";

/// The readable part of an entry.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    key: Hash,
    kind: String,
    numerics: String,
    question: Value,
    facts: Map<String, Value>,
    statistics: Option<Statistics>,
    stop: Stop,
}

impl Store {
    /// The store in `folder`, which need not exist yet.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into() }
    }

    /// Folder of the store.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// The file of an entry. Two digits of the key make a folder, so that none grows too large.
    pub fn path(&self, key: &Hash) -> PathBuf {
        let text = key.as_str();
        self.folder.join(&text[..2]).join(format!("{text}.{ENDING}"))
    }

    /// Whether something is kept under `key`; whether it is of use, [`Store::get`] says.
    pub fn has(&self, key: &Hash) -> bool {
        let path = self.path(key);
        self.within(&path).is_ok() && path.is_file()
    }

    /// The entry under `key` for `question`.
    pub fn get(&self, key: &Hash, question: &dyn Question) -> Kept {
        let path = self.path(key);
        if let Err(error) = self.within(&path) {
            return Kept::Damaged(error.to_string());
        }
        let bytes = match files::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.source.kind() == std::io::ErrorKind::NotFound => {
                return Kept::Nothing;
            }
            Err(error) => return Kept::Damaged(error.to_string()),
        };
        match read(&bytes) {
            Ok((header, answer)) => {
                if header.key == *key
                    && header.kind == question.kind()
                    && header.question == question.json()
                {
                    Kept::Answer(answer)
                } else {
                    Kept::Damaged(format!("{} answers another question", path.display()))
                }
            }
            Err(why) => Kept::Damaged(format!("{} is damaged ({why})", path.display())),
        }
    }

    /// Keeps an answer.
    ///
    /// # Errors
    ///
    /// If the file cannot be written.
    pub fn put(
        &self,
        key: &Hash,
        question: &dyn Question,
        answer: &Answer,
    ) -> Result<(), FileError> {
        let header = Header {
            key: key.clone(),
            kind: question.kind().to_owned(),
            numerics: NUMERICS.to_owned(),
            question: question.json(),
            facts: answer.facts.clone(),
            statistics: answer.statistics.clone(),
            stop: answer.stop,
        };
        let header = canonical_json(&header);
        let mut bytes = MAGIC.to_vec();
        bytes.extend_from_slice(&(header.len() as u64).to_le_bytes());
        bytes.extend(header);
        bytes.extend(encode::bits(&answer.tables));
        let digest = Hash::of(&bytes);
        bytes.extend_from_slice(digest.as_str().as_bytes());
        let path = self.path(key);
        self.within(&path)?;
        files::write(&path, &bytes)
    }

    /// Refuses an entry's place if a link leads out of the store there.
    fn within(&self, path: &Path) -> Result<(), FileError> {
        for place in [path.parent(), Some(path)].into_iter().flatten() {
            if fs::symlink_metadata(place).is_ok_and(|m| m.is_symlink()) {
                let source = io::Error::other("it is a link, and a store follows none; remove it");
                return Err(FileError {
                    action: "use the store's",
                    path: place.to_path_buf(),
                    source,
                });
            }
        }
        Ok(())
    }

    /// The entries, sorted by path. Only what the program wrote is one: a plain file at
    /// XX/KEY.answer that is an answer with its digest, or a damaged one that begins as answers do.
    /// Links are not followed, and everything else is passed over.
    ///
    /// # Errors
    ///
    /// If the folder cannot be read.
    pub fn entries(&self) -> Result<Vec<Entry>, FileError> {
        let mut entries = Vec::new();
        if !self.folder.exists() {
            return Ok(entries);
        }
        for folder in names(&self.folder, |kind| kind.is_dir())? {
            for file in names(&self.folder.join(&folder), |kind| kind.is_file())? {
                let Some(key) = file.strip_suffix(ENDING).and_then(|name| name.strip_suffix('.'))
                else {
                    continue;
                };
                if key.get(..2) != Some(folder.as_str()) {
                    continue;
                }
                // A file that cannot be read is not removed.
                let Ok(bytes) = files::read(&self.folder.join(&folder).join(&file)) else {
                    continue;
                };
                let whole = read(&bytes).ok().map(|(header, _)| header);
                if whole.is_some() || was_entry(key, &bytes) {
                    let current =
                        whole.is_some_and(|h| h.numerics == NUMERICS && h.key.as_str() == key);
                    entries.push(Entry {
                        path: format!("{folder}/{file}"),
                        bytes: bytes.len() as u64,
                        current,
                    });
                }
            }
        }
        entries.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(entries)
    }

    /// Removes the entries for which `unwanted` is true; returns the number of bytes freed.
    ///
    /// # Errors
    ///
    /// If the folder cannot be read, or a file not removed.
    pub fn prune(&self, unwanted: impl Fn(&Entry) -> bool) -> Result<u64, FileError> {
        let mut freed = 0;
        for entry in self.entries()?.iter().filter(|e| unwanted(e)) {
            files::remove(&self.folder.join(&entry.path))?;
            freed += entry.bytes;
        }
        Ok(freed)
    }
}

/// Names in a folder of what is of this kind itself: a link is none.
fn names(folder: &Path, wanted: impl Fn(&FileType) -> bool) -> Result<Vec<String>, FileError> {
    let list = |source| FileError { action: "list", path: folder.to_path_buf(), source };
    let mut names = Vec::new();
    for entry in fs::read_dir(folder).map_err(list)? {
        let entry = entry.map_err(list)?;
        if wanted(&entry.file_type().map_err(list)?) {
            names.extend(entry.file_name().into_string().ok());
        }
    }
    Ok(names)
}

/// Whether a file of this name that begins so was an answer, of any version of the numerics. The
/// rest may be damaged.
fn was_entry(key: &str, bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC) && key.len() == DIGEST && key.bytes().all(|b| b.is_ascii_hexdigit())
}

/// An entry of a store, from outside.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Path inside the store.
    pub path: String,
    /// Length.
    pub bytes: u64,
    /// Whether it is whole, its name's, and made by this program's numerics: others are never used
    /// again.
    pub current: bool,
}

/// The answer in the bytes of an entry, whatever question it is for.
///
/// # Errors
///
/// If they are no whole entry.
pub fn answer_in(bytes: &[u8]) -> Result<Answer, encode::Malformed> {
    read(bytes).map(|(_, answer)| answer).map_err(encode::Malformed)
}

/// The header and answer in an entry's bytes.
fn read(bytes: &[u8]) -> Result<(Header, Answer), String> {
    let (content, digest) =
        bytes.split_at_checked(bytes.len().saturating_sub(DIGEST)).ok_or("it is too short")?;
    if Hash::of(content).as_str().as_bytes() != digest {
        return Err("its digest is not that of its content".into());
    }
    let (header, tables) = header_of(content)?;
    let header: Header = serde_json::from_slice(header).map_err(|e| e.to_string())?;
    let tables = encode::from_bits(tables).map_err(|e| e.to_string())?;
    let answer = Answer {
        tables,
        facts: header.facts.clone(),
        statistics: header.statistics.clone(),
        stop: header.stop,
    };
    Ok((header, answer))
}

/// An entry's header, and what follows it.
fn header_of(bytes: &[u8]) -> Result<(&[u8], &[u8]), &'static str> {
    let content = bytes.strip_prefix(MAGIC).ok_or("it is not an answer of this version")?;
    let (length, content) = content.split_first_chunk().ok_or("it is too short")?;
    let length = usize::try_from(u64::from_le_bytes(*length)).ok();
    length.and_then(|n| content.split_at_checked(n)).ok_or("its header is cut short")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Executor;
    use crate::question::Ask;
    use crate::question::{JobError, key};
    use crate::table::{Column, Table};
    use serde_json::json;
    use std::sync::atomic::{AtomicUsize, Ordering};
    use twofold_integrate::Monitor;

    static COMPUTED: AtomicUsize = AtomicUsize::new(0);

    #[derive(Debug)]
    struct Square(f64);

    impl Question for Square {
        fn kind(&self) -> &'static str {
            "square"
        }
        fn json(&self) -> Value {
            json!({ "of": self.0 })
        }
        fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
            COMPUTED.fetch_add(1, Ordering::Relaxed);
            let mut table = Table::new("square", [Column::numbers("x")]);
            table.push([(self.0 * self.0).into()]);
            Ok(Answer::of_tables(vec![table]).with_fact("of", &self.0))
        }
    }

    #[test]
    fn answers_survive_and_damage_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path().join("store"));
        let question = Square(1.0 / 3.0);
        let key = key(&question);
        assert_eq!(store.get(&key, &question), Kept::Nothing);
        let ask = || Executor::new(Some(store.clone()), &()).ask(&question).unwrap();
        let first = ask();
        assert_eq!(ask(), first);
        assert_eq!(COMPUTED.load(Ordering::Relaxed), 1, "the second answer comes from the store");

        // Every byte counts.
        let path = store.path(&key);
        let whole = fs::read(&path).unwrap();
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 1;
            fs::write(&path, &bytes).unwrap();
            assert!(matches!(store.get(&key, &question), Kept::Damaged(_)), "byte {at}");
        }
        for cut in [0, 1, 70, whole.len() - 1] {
            fs::write(&path, &whole[..cut]).unwrap();
            assert!(matches!(store.get(&key, &question), Kept::Damaged(_)), "cut at {cut}");
        }
        assert_eq!(ask(), first);
        assert_eq!(COMPUTED.load(Ordering::Relaxed), 2, "a damaged answer is computed again");
        assert_eq!(fs::read(&path).unwrap(), whole, "and kept again");

        // A foreign entry under our name, whole in itself.
        let other = Square(2.0);
        let foreign = super::super::question::key(&other);
        store.put(&foreign, &other, &other.compute(&Executor::quiet(), &()).unwrap()).unwrap();
        fs::copy(store.path(&foreign), &path).unwrap();
        assert!(matches!(store.get(&key, &question), Kept::Damaged(why)
                if why.contains("another question")));

        let entries = store.entries().unwrap();
        assert_eq!(entries.len(), 2);
        assert_eq!(
            entries.iter().filter(|e| e.current).count(),
            1,
            "the one under another's name is never used"
        );
        assert_eq!(store.prune(|_| false).unwrap(), 0);
        assert!(store.prune(|_| true).unwrap() > 0);
        assert_eq!(store.entries().unwrap(), []);
    }

    /// Files that the store did not write stay, whatever their names; links are followed neither
    /// when reading, writing nor removing.
    #[cfg(unix)]
    #[test]
    fn what_is_not_the_stores_is_left_alone() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let (store, elsewhere) = (Store::new(at("store")), Store::new(at("elsewhere")));
        let (question, answer) = (Square(5.0), Answer::of_tables(Vec::new()).with_fact("of", &5.0));
        let key = key(&question);
        let foreign = Hash::of(b"foreign");
        let foreign_place = store.path(&foreign);
        let notes = [
            at("store/notes.answer"),
            at("store/a/b/notes.answer"),
            at("store/ab/notes.answer"),
            foreign_place,
        ];
        for note in &notes {
            files::write(note, b"work").unwrap();
        }
        // An entry of ours, whole and damaged, in a place that is none.
        store.put(&key, &question, &answer).unwrap();
        let whole = fs::read(store.path(&key)).unwrap();
        files::write(&at("store/zz.answer"), &whole).unwrap();
        // A folder and an entry of another store, through links.
        elsewhere.put(&key, &question, &answer).unwrap();
        let shard = Hash::of(b"another").as_str()[..2].to_owned();
        symlink(at("elsewhere").join(&key.as_str()[..2]), at("store").join(&shard)).unwrap();
        assert_eq!(store.entries().unwrap().len(), 1);
        fs::write(store.path(&key), &whole[..whole.len() - 1]).unwrap();
        assert!(!store.entries().unwrap()[0].current, "damaged, and ours by its header");
        assert_eq!(store.prune(|_| true).unwrap(), whole.len() as u64 - 1);
        fs::write(store.path(&key), &whole[..20]).unwrap();
        assert_eq!(store.prune(|entry| !entry.current).unwrap(), 20, "its header is cut, too");
        assert!(notes.iter().all(|note| fs::read(note).unwrap() == b"work"));
        assert!(at("store/zz.answer").exists());
        assert_eq!(elsewhere.get(&key, &question), Kept::Answer(answer.clone()));
        // An entry that is a link is not used, and what it leads to is not written over.
        fs::write(at("precious"), b"precious").unwrap();
        symlink(at("precious"), store.path(&key)).unwrap();
        assert!(
            matches!(store.get(&key, &question), Kept::Damaged(why) if why.contains("it is a link"))
        );
        assert!(!store.has(&key) && store.put(&key, &question, &answer).is_err());
        assert_eq!(fs::read(at("precious")).unwrap(), b"precious");
    }

    /// An entry is its question's by its key, its kind, and what is asked: each by itself.
    #[test]
    fn an_entry_is_its_questions_in_everything() {
        #[derive(Debug)]
        struct Cube(f64);
        impl Question for Cube {
            fn kind(&self) -> &'static str {
                "cube"
            }
            fn json(&self) -> Value {
                Square(self.0).json()
            }
            fn compute(
                &self,
                executor: &dyn Ask,
                monitor: &dyn Monitor,
            ) -> Result<Answer, JobError> {
                Square(self.0).compute(executor, monitor)
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path());
        let (question, answer) = (Square(3.0), Answer::of_tables(Vec::new()).with_fact("of", &3.0));
        let (ours, others) = (key(&question), key(&Square(4.0)));
        let another =
            |kept: Kept| matches!(kept, Kept::Damaged(why) if why.contains("another question"));
        store.put(&ours, &Cube(3.0), &answer).unwrap();
        assert!(another(store.get(&ours, &question)), "of another kind");
        store.put(&ours, &Square(4.0), &answer).unwrap();
        assert!(another(store.get(&ours, &question)), "another is asked");
        store.put(&others, &question, &answer).unwrap();
        fs::copy(store.path(&others), store.path(&ours)).unwrap();
        assert!(another(store.get(&ours, &question)), "under another key");
        store.put(&ours, &question, &answer).unwrap();
        assert_eq!(store.get(&ours, &question), Kept::Answer(answer));
        // An entry that exists and is no file cannot be read; it does not count as absent.
        fs::remove_file(store.path(&others)).unwrap();
        assert_eq!(store.get(&others, &question), Kept::Nothing);
        fs::create_dir(store.path(&others)).unwrap();
        assert!(matches!(store.get(&others, &question), Kept::Damaged(_)));
    }

    #[test]
    fn what_was_interrupted_is_not_kept() {
        #[derive(Debug)]
        struct Cut;
        impl Question for Cut {
            fn kind(&self) -> &'static str {
                "cut"
            }
            fn json(&self) -> Value {
                Value::Null
            }
            fn compute(&self, _: &dyn Ask, _: &dyn Monitor) -> Result<Answer, JobError> {
                Ok(Answer { stop: Stop::Interrupted, ..Answer::of_tables(Vec::new()) })
            }
        }
        let folder = tempfile::tempdir().unwrap();
        let store = Store::new(folder.path());
        Executor::new(Some(store.clone()), &()).ask(&Cut).unwrap();
        assert_eq!(store.get(&key(&Cut), &Cut), Kept::Nothing);
    }
}
