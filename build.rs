//! Digests the sources that numbers depend on, so that an answer kept by one version of the numerics is never taken for another's.

use std::fs;
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

/// The rooms whose sources decide what a computation yields, and what they are built from.
const NUMERICS: [&str; 7] =
    ["src/num", "src/system", "src/integrate", "src/analyse", "src/job", "systems", "Cargo.lock"];

fn main() {
    let mut files = Vec::new();
    for place in NUMERICS {
        println!("cargo::rerun-if-changed={place}");
        collect(Path::new(place), &mut files);
    }
    files.sort();
    let mut digest = Sha256::new();
    for file in &files {
        // Names with forward slashes and lines without carriage returns: the same on every system.
        let name: Vec<String> = file.iter().map(|part| part.to_string_lossy().into_owned()).collect();
        let text = fs::read(file).unwrap_or_default();
        digest.update(name.join("/"));
        digest.update(text.into_iter().filter(|b| *b != b'\r').collect::<Vec<u8>>());
    }
    let hex: String = digest.finalize().iter().take(16).map(|b| format!("{b:02x}")).collect();
    println!("cargo::rustc-env=TWOFOLD_NUMERICS={hex}");
}

fn collect(place: &Path, files: &mut Vec<PathBuf>) {
    match fs::read_dir(place) {
        Ok(entries) => entries.flatten().for_each(|e| collect(&e.path(), files)),
        Err(_) if place.is_file() => files.push(place.to_path_buf()),
        // A room that is not there yet.
        Err(_) => {}
    }
}
