//! Which mutant is on, or which are reached. Written into the mutated tree by scripts/mutants; no part of the crate.
#![allow(missing_docs)]

use std::fs::File;
use std::io::Write;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

const COUNT: usize = 0;
const NONE: u32 = u32::MAX - 2;
const RECORD: u32 = u32::MAX - 1;
const UNSET: u32 = u32::MAX;
static ACTIVE: AtomicU32 = AtomicU32::new(UNSET);
static REACHED: [AtomicBool; COUNT] = [const { AtomicBool::new(false) }; COUNT];
static LOG: OnceLock<Option<File>> = OnceLock::new();

/// Whether this mutant is on.
#[inline(always)]
pub fn on(id: u32) -> bool {
    let active = ACTIVE.load(Relaxed);
    if active < RECORD { active == id } else { slow(id, id) }
}

/// Whether none of these is on.
#[inline(always)]
pub fn off(first: u32, last: u32) -> bool {
    let active = ACTIVE.load(Relaxed);
    if active < RECORD { active < first || active > last } else { !slow(first, last) }
}

/// The answer of a comparison, or the mutant's. A test reaches the mutant only if the two differ.
#[inline(always)]
pub fn alt(id: u32, original: bool, other: impl FnOnce() -> bool) -> bool {
    let active = ACTIVE.load(Relaxed);
    if active == id {
        other()
    } else if active < RECORD {
        original
    } else {
        differ(id, original, other)
    }
}

#[cold]
#[inline(never)]
fn slow(first: u32, last: u32) -> bool {
    let active = start();
    if active == RECORD {
        (first..=last).for_each(mark);
    }
    first <= active && active <= last
}

#[cold]
#[inline(never)]
fn differ(id: u32, original: bool, other: impl FnOnce() -> bool) -> bool {
    match start() {
        RECORD => {
            if other() != original {
                mark(id);
            }
            original
        }
        active if active == id => other(),
        _ => original,
    }
}

fn start() -> u32 {
    if ACTIVE.load(Relaxed) == UNSET {
        let active = match std::env::var("MUTANT") {
            Ok(number) => number.parse().unwrap_or(NONE),
            Err(_) if std::env::var_os("MUTANTS_REACHED").is_some() => RECORD,
            Err(_) => NONE,
        };
        if active == RECORD {
            let path = std::env::var_os("MUTANTS_REACHED").unwrap_or_default();
            LOG.get_or_init(|| File::options().append(true).create(true).open(path).ok());
        }
        ACTIVE.store(active, Relaxed);
    }
    ACTIVE.load(Relaxed)
}

/// One line a mutant, at once: a process may be killed at any moment.
fn mark(id: u32) {
    if !REACHED[id as usize].load(Relaxed) && !REACHED[id as usize].swap(true, Relaxed) {
        if let Some(Some(mut log)) = LOG.get().map(Option::as_ref) {
            let _ = log.write_all(format!("{id}\n").as_bytes());
        }
    }
}
