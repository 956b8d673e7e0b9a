//! Questions in the words of the command line: `run = { system = "systems/relay.toml", t-end = 10
//! }` asks what `twofold run --system systems/relay.toml --t-end 10` asks.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;

use serde::Deserialize;
use toml::{Spanned, Value};

use super::FolderError;
use crate::cli::CliError;
use crate::cli::asked;
use crate::cli::commands::{lyapunov, orbit, rests, scan, sweep};
use crate::cli::flags::{RunFlags, Use};
use crate::cli::models::table_files;
use crate::job::AnyQuestion;
use crate::job::scan::{MOST_RUNS, ScanQuestion};
use crate::job::sweep::SweepQuestion;
use crate::paper::plots::Recorded;
use crate::system::diagnostic::nearest;
use crate::system::{Diagnostic, library};

/// The flags of a question by their names without dashes.
#[derive(Clone, Debug, Default, Deserialize)]
#[serde(transparent)]
pub struct Words(BTreeMap<Spanned<String>, Spanned<Value>>);

/// A question's words with the file that says them.
#[derive(Clone, Debug)]
pub struct Said {
    /// Path of the file in the folder, and its text.
    pub origin: Origin,
    /// Place of the question in it, in bytes.
    pub place: Range<usize>,
    flags: Vec<Flag>,
}

/// A flag that is given.
#[derive(Clone, Debug)]
struct Flag {
    name: String,
    values: Vec<String>,
    /// Its place, if a file says it.
    place: Option<(Origin, Range<usize>)>,
}

/// A file of the folder: its path there and its text.
type Origin = Arc<(String, String)>;

/// The kind of a question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ask {
    /// `twofold run`.
    Run,
    /// `twofold orbit`.
    Orbit,
    /// `twofold lyapunov`.
    Lyapunov,
    /// `twofold rests`.
    Rests,
    /// `twofold scan`.
    Scan,
    /// `twofold sweep`.
    Sweep,
}

impl Ask {
    /// The kind of answer, in words.
    pub fn asked(self) -> &'static str {
        match self {
            Ask::Run => "a run",
            Ask::Orbit => "a closed orbit",
            Ask::Lyapunov => "an exponent",
            Ask::Rests => "rests",
            Ask::Scan => "a scan",
            Ask::Sweep => "a sweep",
        }
    }

    /// Paths of the numbers among the facts that an answer may have, of either form of a system;
    /// `*` stands for an index. Pairs that end in 0 and 1 are complex numbers.
    pub fn numbers(self) -> &'static [&'static str] {
        match self {
            Ask::Run => &[
                "t",
                "state/*",
                "x/*",
                "steps",
                "switches",
                "events",
                "zeno/t",
                "zeno/error",
                "most_steps_in_segment",
            ],
            Ask::Orbit => &[
                "point/*",
                "period",
                "multipliers/*/0",
                "multipliers/*/1",
                "gap",
                "moved",
                "residual",
                "iterations",
                "returns",
                "rate",
                "largest_modulus",
                "multiplier_error",
                "rest/state/*",
                "rest/eigenvalues/*/0",
                "rest/eigenvalues/*/1",
            ],
            Ask::Lyapunov => &[
                "exponent/value",
                "exponent/standard_error",
                "exponent/duration",
                "half_width",
                "exponents/*/value",
                "exponents/*/half_width",
                "from",
                "to",
            ],
            Ask::Rests => &[
                "rests/*/state/*",
                "rests/*/eigenvalues/*/0",
                "rests/*/eigenvalues/*/1",
                "rests/*/place/surface/weight",
                "rests/*/place/intersection/weights/*",
                "rests/*/family/dimension",
                "rests/*/family/ends/*/*",
            ],
            // All that they find is in their tables.
            Ask::Scan | Ask::Sweep => &[],
        }
    }

    /// Whether a path may lead to a number; with `modulus` to a complex one.
    pub fn has_number(self, path: &str, modulus: bool) -> bool {
        let path = if modulus { format!("{path}/0") } else { path.to_owned() };
        let leads = |known: &&str| {
            let (known, path) = (known.split('/'), path.split('/'));
            let is = |(known, part): (&str, &str)| {
                if known == "*" { part.parse::<usize>().is_ok() } else { known == part }
            };
            known.clone().count() == path.clone().count() && known.zip(path).all(is)
        };
        self.numbers().iter().filter(|known| !modulus || known.ends_with("/0")).any(leads)
    }
}

/// Flags that say where an answer goes and by which means it is computed, and one that reads a
/// whole run from elsewhere: not a question's.
pub const NOT_ASKED: [&str; 12] = [
    "spec", "out", "format", "quiet", "help", "plot", "show", "threads", "shard", "resume",
    "recheck", "json",
];

/// Flags that are given several times rather than as a list.
const REPEATED: [&str; 3] = ["set", "within", "over"];

impl Words {
    fn flags(&self, origin: &Origin) -> Result<Vec<Flag>, FolderError> {
        let flag = |(key, value): (&Spanned<String>, &Spanned<Value>)| {
            let name = key.get_ref().clone();
            let values = texts(&name, value.get_ref())
                .map_err(|why| FolderError::at(origin, value.span(), why, None))?;
            Ok(Flag { name, values, place: Some((origin.clone(), key.span())) })
        };
        self.0.iter().map(flag).collect()
    }

    /// The numbers that it gives to parameters, in the file's order.
    pub fn parameters(&self) -> Vec<(String, f64)> {
        let set = self.0.iter().find(|(key, _)| key.get_ref() == "set");
        let texts = set.and_then(|(key, value)| texts(key.get_ref(), value.get_ref()).ok());
        let number = |text: &String| {
            let (name, value) = text.split_once('=')?;
            Some((name.trim().to_owned(), value.trim().parse().ok()?))
        };
        texts.iter().flatten().filter_map(number).collect()
    }
}

/// A value as the command line writes it.
fn texts(key: &str, value: &Value) -> Result<Vec<String>, String> {
    let one = |value: &Value| match value {
        Value::String(text) => Ok(text.clone()),
        Value::Integer(number) => Ok(number.to_string()),
        // The shortest decimal that is this number.
        Value::Float(number) => Ok(format!("{number:?}")),
        Value::Boolean(_) | Value::Datetime(_) | Value::Array(_) | Value::Table(_) => Err(format!(
            "`{key}` is a {}; give a number, a text, or a list of those",
            value.type_str()
        )),
    };
    match value {
        Value::Boolean(true) => Ok(Vec::new()),
        Value::Boolean(false) => Err(format!("`{key} = false` has no effect; leave it out")),
        Value::Array(list) if REPEATED.contains(&key) => list.iter().map(one).collect(),
        Value::Array(list) => {
            Ok(vec![list.iter().map(one).collect::<Result<Vec<_>, _>>()?.join(",")])
        }
        Value::Table(table) if key == "set" => {
            table.iter().map(|(name, value)| Ok(format!("{name}={}", one(value)?))).collect()
        }
        other => Ok(vec![one(other)?]),
    }
}

/// A later word replaces an earlier one; parameters (`set`) add up, each with its last value.
fn add(flags: &mut Vec<Flag>, flag: Flag) {
    match flags.iter_mut().find(|f| f.name == flag.name) {
        Some(old) if REPEATED.contains(&flag.name.as_str()) => {
            let name = |text: &str| text.split('=').next().unwrap_or_default().trim().to_owned();
            let again = |old: &str| flag.values.iter().any(|new| name(new) == name(old));
            old.values.retain(|value| !again(value));
            old.values.extend(flag.values);
            old.place = flag.place;
        }
        Some(old) => *old = flag,
        None => flags.push(flag),
    }
}

impl Said {
    /// Whether it gives this flag.
    pub fn gives(&self, name: &str) -> bool {
        self.flags.iter().any(|flag| flag.name == name)
    }

    /// Whether the section that is asked for depends on the time.
    pub fn has_section_in_time(&self) -> bool {
        let is_time = |text: &String| {
            text.split(|c: char| !(c.is_alphanumeric() || c == '_')).any(|name| name == "t")
        };
        self.flags.iter().any(|flag| flag.name == "section" && flag.values.iter().any(is_time))
    }

    /// The words of a question over those that hold for all (`defaults`, of the file `common`): a
    /// later word replaces an earlier one, and parameters (`set`) add up.
    ///
    /// # Errors
    /// If a value is of a kind that no flag takes.
    pub fn new(
        origin: &Origin,
        words: &Spanned<Words>,
        common: &Origin,
        defaults: &[&Words],
    ) -> Result<Self, FolderError> {
        let mut flags: Vec<Flag> = Vec::new();
        let layers =
            defaults.iter().map(|w| (*w, common)).chain(std::iter::once((words.get_ref(), origin)));
        for (layer, origin) in layers {
            for flag in layer.flags(origin)? {
                add(&mut flags, flag);
            }
        }
        Ok(Self { origin: origin.clone(), place: words.span(), flags })
    }

    /// The question with some words of the same file replaced.
    ///
    /// # Errors
    /// As [`Said::new`].
    pub fn over(mut self, words: Option<&Words>) -> Result<Self, FolderError> {
        let origin = self.origin.clone();
        for flag in words.map_or(Ok(Vec::new()), |words| words.flags(&origin))? {
            add(&mut self.flags, flag);
        }
        Ok(self)
    }

    /// The same question from another start.
    pub fn from_start(&self, start: &[f64]) -> Self {
        let mut other = self.clone();
        other.flags.retain(|f| f.name != "start");
        let text = start.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(",");
        other.flags.push(Flag { name: "start".into(), values: vec![text], place: None });
        other
    }

    fn wrong(
        &self,
        key: Option<&str>,
        why: impl Into<String>,
        help: Option<String>,
    ) -> FolderError {
        let flag = key.and_then(|key| self.flags.iter().find(|f| f.name == key));
        let place = flag.and_then(|f| f.place.clone());
        let (origin, place) = place.unwrap_or_else(|| (self.origin.clone(), self.place.clone()));
        FolderError::at(&origin, place, why.into(), help)
    }

    /// The flags as arguments, with the system's file found in the folder `root`.
    fn arguments(&self, root: &Path) -> Result<Vec<String>, FolderError> {
        let mut all = Vec::new();
        for Flag { name: key, values, .. } in &self.flags {
            if NOT_ASKED.contains(&key.as_str()) {
                return Err(self.wrong(
                    Some(key),
                    format!("`{key}` is not part of a question; leave it out"),
                    None,
                ));
            }
            for value in values {
                let value = if key == "system" { self.system(root, value)? } else { value.clone() };
                all.push(format!("--{key}={value}"));
            }
            if values.is_empty() {
                all.push(format!("--{key}"));
            }
        }
        Ok(all)
    }

    /// A built-in system's name, or the path of a file that lies in the folder.
    fn system(&self, root: &Path, name: &str) -> Result<String, FolderError> {
        if library::text(name).is_some() || library::general(name).is_some() {
            return Ok(name.to_owned());
        }
        let wrong = |why: String| {
            self.wrong(
                Some("system"),
                why,
                Some(
                    "name a file of this folder, such as systems/relay.toml, or a built-in system \
                        (twofold new --list)"
                        .into(),
                ),
            )
        };
        if !super::lies_within(name) {
            return Err(wrong(format!("the system `{name}` does not lie in this folder")));
        }
        let path = root.join(name);
        let (Ok(whole), Ok(found)) = (root.canonicalize(), path.canonicalize()) else {
            return Err(wrong(format!("there is no system `{name}`")));
        };
        let lies_outside = |file: &Path| !file.starts_with(&whole);
        if lies_outside(&found) {
            return Err(wrong(format!("the system `{name}` does not lie in this folder")));
        }
        for table in table_files(&path).map_err(|e| self.refused(&e))? {
            if table.canonicalize().is_ok_and(|file| lies_outside(&file)) {
                return Err(self.wrong(
                    Some("system"),
                    format!("{}: a link that leads out of the paper's folder", table.display()),
                    Some("put the file itself there".into()),
                ));
            }
        }
        Ok(path.display().to_string())
    }

    fn parsed<T: clap::Args>(&self, root: &Path) -> Result<T, FolderError> {
        let known = asked::known::<T>();
        for Flag { name: key, .. } in &self.flags {
            if !known.contains(key) && !NOT_ASKED.contains(&key.as_str()) {
                let known: Vec<&str> =
                    known.iter().map(String::as_str).filter(|k| !NOT_ASKED.contains(k)).collect();
                let help = nearest(key, &known).map(|near| format!("did you mean `{near}`?"));
                return Err(self.wrong(Some(key), format!("unknown key `{key}`"), help));
            }
        }
        asked::parsed(self.arguments(root)?)
            .map_err(|said| self.wrong(self.named_in(&said).as_deref(), said, None))
    }

    /// The flag that a message of the command line names.
    fn named_in(&self, message: &str) -> Option<String> {
        let keys = self.flags.iter().map(|f| f.name.as_str());
        keys.filter(|key| message.contains(&format!("--{key}")))
            .max_by_key(|key| key.len())
            .map(str::to_owned)
    }

    fn refused(&self, error: &CliError) -> FolderError {
        let said = error.to_string();
        let key = self.named_in(&said);
        self.wrong(key.as_deref(), said, None)
    }

    /// The run that is asked for.
    ///
    /// # Errors
    /// If a flag is unknown, has no effect, or a value is wrong.
    pub fn recorded(&self, root: &Path, command: Use) -> Result<Recorded, FolderError> {
        let flags: RunFlags = self.parsed(root)?;
        asked::recorded(&flags, command).map_err(|e| self.refused(&e))
    }

    /// The question that is asked.
    ///
    /// # Errors
    /// As [`Said::recorded`].
    pub fn question(&self, ask: Ask, root: &Path) -> Result<AnyQuestion, FolderError> {
        let refused = |e: CliError| self.refused(&e);
        match ask {
            Ask::Run => Ok(self.recorded(root, Use::Any)?.question()),
            Ask::Orbit => self.parsed::<orbit::Arguments>(root)?.question().map_err(refused),
            Ask::Lyapunov => self.parsed::<lyapunov::Arguments>(root)?.question().map_err(refused),
            Ask::Rests => {
                let question =
                    self.parsed::<rests::Arguments>(root)?.question().map_err(refused)?;
                Ok(Arc::new(question))
            }
            Ask::Scan => {
                let scan = self.parsed::<scan::Arguments>(root)?.scan().map_err(refused)?;
                Ok(Arc::new(ScanQuestion::from(scan)))
            }
            Ask::Sweep => {
                let sweep = self.parsed::<sweep::Arguments>(root)?.sweep().map_err(refused)?;
                if sweep.rows() > MOST_RUNS {
                    let why = format!("{} runs; a measure has at most {MOST_RUNS}", sweep.rows());
                    return Err(self.wrong(Some("over"), why, None));
                }
                Ok(Arc::new(SweepQuestion::from(sweep)))
            }
        }
    }

    /// An error that points at this question.
    pub fn complain(&self, why: impl Into<String>) -> FolderError {
        self.wrong(None, why, None)
    }

    /// An error that points at one of its flags.
    pub fn complain_of(&self, flag: &str, why: impl Into<String>) -> FolderError {
        self.wrong(Some(flag), why, None)
    }
}

impl FolderError {
    /// An error at a place of a file.
    pub fn at(
        origin: &Arc<(String, String)>,
        place: Range<usize>,
        why: impl Into<String>,
        help: Option<String>,
    ) -> Self {
        FolderError::Text(Diagnostic::new(why, &origin.0, &origin.1, place, help).into())
    }
}
