//! Every reader of foreign bytes (fuzz/targets.rs) against malformed inputs: the committed corpus
//! as it is, then with random changes. An input that comes to an answer which none came to before
//! is kept and changed further, so that a search goes deeper without looking into the program.
//! `make fuzz FUZZ_SECONDS=600` searches so long a target; without the variable each target gets a
//! few hundred inputs, always the same.

use std::collections::BTreeSet;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use twofold::num::random::RandomStream;

#[path = "../../fuzz/targets.rs"]
mod targets;

/// No input is longer.
const LONGEST: usize = 1 << 17;
/// No input takes longer (debug program, busy machine).
const SLOWEST: Duration = Duration::from_secs(20);
/// Nor does the process ever take more memory, in kB.
const MOST_MEMORY: u64 = 3_000_000;
/// Inputs that are changed further.
const POOL: usize = 1500;

/// Words that provoke errors in readers: numbers at the edges, brackets, names of other things.
const WORDS: [&[u8]; 44] = [
    b"0",
    b"-0",
    b"-1",
    b"1e300",
    b"1e999",
    b"-1e-320",
    b"NaN",
    b"inf",
    b"18446744073709551616",
    b"9223372036854775808",
    b"4294967295",
    b"0.1",
    b"null",
    b"true",
    b"[]",
    b"{}",
    b"\"\"",
    b"[[[[[[[[[[[[[[[[",
    b"((((((((((((((((",
    b"))",
    b"]]",
    b"}}",
    b"\n",
    b"\r\n",
    b"\0",
    b"\xff\xff\xff\xff",
    b"\x7f\xff\xff\xff",
    b"\x80\0\0\0",
    b"\xe2\x80\xae",
    b"\xf0\x9f\x8c\x80",
    b"\x1b[2J",
    b"../../",
    b"#",
    b",",
    b";",
    b"=",
    b"+",
    b"**",
    b"^-",
    b"tanh(",
    b"sign(",
    b"\"\"\"",
    b"<entry key=\"",
    b"<![CDATA[",
];

struct Maker {
    random: RandomStream,
}

impl Maker {
    fn below(&mut self, n: usize) -> usize {
        ((self.random.uniform() * n as f64) as usize).min(n.saturating_sub(1))
    }

    /// One of `pool` with one to six changes.
    fn make(&mut self, pool: &[Vec<u8>]) -> Vec<u8> {
        let mut bytes = pool[self.below(pool.len())].clone();
        for _ in 0..=self.below(6) {
            let (at, other) = (self.below(bytes.len() + 1), self.below(bytes.len() + 1));
            let (low, high) = (at.min(other), at.max(other));
            match self.below(11) {
                0 if at < bytes.len() => bytes[at] ^= 1 << self.below(8),
                1 if at < bytes.len() => {
                    bytes[at] = [0, 0xff, 0x7f, 0x80, b' ', b'9', b'"', self.below(256) as u8]
                        [self.below(8)]
                }
                2 => bytes.truncate(at),
                3 => drop(bytes.drain(low..high.min(low + 64))),
                4 => drop(bytes.drain(low..high)),
                5 => {
                    let part = bytes[low..high.min(low + 512)].to_vec();
                    bytes.splice(at..at, part);
                }
                6 => {
                    let word = WORDS[self.below(WORDS.len())];
                    bytes.splice(at..at, word.iter().copied());
                }
                // A number becomes another one.
                7 | 8 => {
                    let digit = |b: &u8| b.is_ascii_digit() || b"+-.eE".contains(b);
                    if let Some(start) =
                        bytes[at..].iter().position(u8::is_ascii_digit).map(|i| i + at)
                    {
                        let end = bytes[start..]
                            .iter()
                            .position(|b| !digit(b))
                            .map_or(bytes.len(), |i| i + start);
                        let word = WORDS[self.below(13)];
                        bytes.splice(start..end, word.iter().copied());
                    }
                }
                // The end of another input.
                9 => {
                    let other = &pool[self.below(pool.len())];
                    let from = self.below(other.len() + 1);
                    bytes.truncate(at);
                    bytes.extend_from_slice(&other[from..]);
                }
                _ => {
                    let word = WORDS[self.below(WORDS.len())];
                    let times = self.below(2000);
                    bytes.splice(at..at, word.repeat(times));
                }
            }
        }
        bytes.truncate(LONGEST);
        bytes
    }
}

/// A message without the numbers and names in it.
fn kind(said: &str) -> String {
    let mut quoted = false;
    let plain = said.chars().filter(|c| {
        quoted ^= matches!(c, '"' | '`');
        !quoted && !c.is_ascii_digit()
    });
    plain.take(160).collect()
}

/// The most memory that this process ever had, in kB; 0 where the system does not tell.
fn memory() -> u64 {
    let status = fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.split_whitespace().next()?.parse().ok()).unwrap_or(0)
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The inputs that a search begins with: those of fuzz/corpus, and what the repository holds of the
/// kind.
fn seeds(name: &str) -> Vec<Vec<u8>> {
    let mut folders = vec![root().join("fuzz/corpus").join(name)];
    match name {
        "system" => folders.push(root().join("systems")),
        "certificate" => folders.push(root().join("proofs/certificates")),
        "manifest" => folders.push(root().join("papers/jeffrey-2013/expected")),
        _ => {}
    }
    let mut paths: Vec<PathBuf> = folders
        .iter()
        .filter_map(|folder| fs::read_dir(folder).ok())
        .flat_map(|entries| entries.map(|entry| entry.unwrap().path()))
        .filter(|path| {
            let large = path.starts_with(root().join("papers"))
                && !["fig1", "fig2", "fig6"].iter().any(|f| path.ends_with(format!("{f}.json")));
            let other = path.extension().is_some_and(|e| name == "manifest" && e != "json");
            path.is_file() && !large && !other
        })
        .collect();
    paths.sort();
    paths.into_iter().map(|path| fs::read(path).unwrap()).collect()
}

/// Gives inputs to a reader, for so long if `seconds` are given and else so many; the number of
/// inputs and of kinds of answers.
fn search(
    name: &str,
    target: targets::Target,
    seconds: Option<u64>,
    seed: u64,
) -> Result<(u64, usize), String> {
    let mut pool = seeds(name);
    assert!(!pool.is_empty(), "{name} has no inputs to begin with");
    let stream = targets::TARGETS.iter().position(|(other, _)| *other == name).unwrap_or(0) as u64;
    let mut maker = Maker { random: RandomStream::new(seed, stream) };
    let folder = root().join("target/fuzz");
    fs::create_dir_all(&folder).unwrap();
    let mut kinds = BTreeSet::new();
    let begun = Instant::now();
    let committed = pool.len() as u64;
    let mut count = 0;
    loop {
        let more = match seconds {
            Some(seconds) => count < committed || begun.elapsed() < Duration::from_secs(seconds),
            None => count < committed + 300,
        };
        if !more {
            return Ok((count, kinds.len()));
        }
        let bytes =
            if count < committed { pool[count as usize].clone() } else { maker.make(&pool) };
        count += 1;
        if seconds.is_some() {
            // An input that ends the process at once is found here afterwards.
            fs::write(folder.join(format!("{name}-now")), &bytes).unwrap();
        }
        let one = Instant::now();
        let found = catch_unwind(AssertUnwindSafe(|| target(&bytes)));
        let complaint = match &found {
            Err(_) => Some("panics".to_owned()),
            Ok(_) if one.elapsed() > SLOWEST => Some(format!("takes {:?}", one.elapsed())),
            Ok(_) if memory() > MOST_MEMORY => Some(format!("takes {} kB", memory())),
            Ok(_) => None,
        };
        if let Some(complaint) = complaint {
            let file = folder.join(format!("{name}-found"));
            fs::write(&file, &bytes).unwrap();
            return Err(format!(
                "{name} {complaint} at input {count} of seed {seed}: {}",
                file.display()
            ));
        }
        if let Ok(said) = found
            && kinds.insert(kind(&said))
            && count > committed
            && pool.len() < POOL
        {
            pool.push(bytes);
        }
    }
}

#[test]
fn every_reader_survives() {
    let number = |name: &str| std::env::var(name).ok().and_then(|text| text.parse().ok());
    let (seconds, seed) = (number("FUZZ_SECONDS"), number("FUZZ_SEED").unwrap_or(1));
    let only = std::env::var("FUZZ").unwrap_or_default();
    let mut found = Vec::new();
    for (name, target) in targets::TARGETS {
        if !only.is_empty() && !only.split_whitespace().any(|wanted| wanted == name) {
            continue;
        }
        match search(name, target, seconds, seed) {
            Ok((inputs, kinds)) => {
                println!(
                    "{name}: {inputs} inputs, {kinds} kinds of answers, at most {} MB",
                    memory() / 1000
                )
            }
            Err(complaint) => found.push(complaint),
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

/// The search is no blind one: from one small sound input it comes to many kinds of answers.
#[test]
fn the_search_finds_what_is_there() {
    fn reader(bytes: &[u8]) -> String {
        let text = String::from_utf8_lossy(bytes);
        let Some(rest) = text.strip_prefix("a=") else { return "no name".into() };
        let value: f64 = match rest.parse() {
            Ok(value) => value,
            Err(_) => return "no number".into(),
        };
        assert!(value <= 1e200, "the defect");
        if value < 0.0 { "negative".into() } else { "fine".into() }
    }
    let mut maker = Maker { random: RandomStream::new(1, 0) };
    let pool = vec![b"a=1.5".to_vec()];
    let found: BTreeSet<String> = (0..3000)
        .map(|_| maker.make(&pool))
        .map(|bytes| catch_unwind(|| reader(&bytes)).unwrap_or_else(|_| "panics".into()))
        .collect();
    assert_eq!(
        found.iter().map(String::as_str).collect::<Vec<_>>(),
        ["fine", "negative", "no name", "no number", "panics"]
    );
    assert_eq!(kind("at 17: \"x\" is no `field` of 3"), "at : \" is no ` of ");
}
