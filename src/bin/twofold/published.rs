//! `twofold check --against DIR`: pictures that somebody published, held against a fresh computation.

use std::path::Path;

use twofold::cli::progress::Progress;
use twofold::cli::{in_pool, print};
use twofold::compare::{Comparison, Limits, Rung, compare};
use twofold::job::Desk;
use twofold::paper::Figure;
use twofold::paper::pipeline::{Computed, compute, pixel_hash, questions};
use twofold::record::{FileBytes, Hash, read_tree};
use twofold::render::decode_png;

use super::{Outcome, Problem};

/// Computes every figure of which the folder holds a picture, and says for each picture which rung of the ladder holds.
pub fn check(folder: &Path, figures: &[Figure], threads: usize, quiet: bool) -> Result<Outcome, Problem> {
    let published = read_tree(folder, &|path| path.ends_with(".png"))?.files;
    let named = |name: &str| -> Vec<&FileBytes> {
        published.iter().filter(|f| f.name().strip_suffix(".png") == Some(name)).collect()
    };
    let known: Vec<&str> = figures.iter().flat_map(|f| &f.pictures).map(|p| p.name.as_str()).collect();
    if !known.iter().any(|name| !named(name).is_empty()) {
        return Err(format!(
            "{}: no picture named like ours is in this folder; ours are called {}",
            folder.display(),
            known.iter().map(|n| format!("{n}.png")).collect::<Vec<_>>().join(", ")
        )
        .into());
    }
    let progress = Progress::new(quiet);
    let desk = Desk::new(None, &progress);
    let wanted = figures.iter().flat_map(|f| &f.pictures).filter(|p| !named(&p.name).is_empty());
    in_pool(threads, || desk.gather(&questions(wanted)))?;
    let limits = Limits::default();
    let (mut checked, mut failures) = (0, 0);
    for picture in figures.iter().flat_map(|f| &f.pictures) {
        let files = named(&picture.name);
        if files.is_empty() {
            print(&format!("{}: not in the folder, not checked", picture.name))?;
            continue;
        }
        let computed = compute(picture, &desk)?;
        for file in files {
            checked += 1;
            let (rung, why) = held(file, &computed, &limits);
            failures += usize::from(rung.is_none());
            print(&format!("{}: {why}", file.path))?;
        }
    }
    for other in published.iter().filter(|f| !known.iter().any(|n| f.name() == format!("{n}.png"))) {
        print(&format!("{}: not named like one of the pictures to check, passed over", other.path))?;
    }
    if failures == 0 {
        print(&format!("{checked} checked, all hold"))?;
        Ok(Outcome::Fine)
    } else {
        print(&format!("{failures} of {checked} hold on no rung"))?;
        Ok(Outcome::Differs)
    }
}

/// The strictest rung that holds, and a sentence.
fn held(file: &FileBytes, computed: &Computed, limits: &Limits) -> (Option<Rung>, String) {
    let ours = &computed.record.hashes;
    if Hash::of(&file.bytes) == ours.png {
        return (Some(Rung::File), "holds exactly (file: SHA-256 equal)".into());
    }
    let theirs = match decode_png(&file.bytes) {
        Ok(pixels) => pixels,
        Err(error) => return (None, format!("DIFFERS: cannot be read as a picture ({error})")),
    };
    if pixel_hash(&theirs) == ours.pixels {
        return (
            Some(Rung::Pixels),
            "holds exactly in its pixels (SHA-256 equal); the file's encoding or metadata differ".into(),
        );
    }
    let comparison = match compare(&computed.rendered.pixels, &theirs) {
        Ok(comparison) => comparison,
        Err(sizes) => return (None, format!("DIFFERS: ours and theirs cannot be compared, {sizes}")),
    };
    match limits.rung(&comparison) {
        Some(rung) => (Some(rung), format!("holds within tolerance ({}); {}", limits.describe(rung), say(&comparison))),
        None => (None, format!("DIFFERS: no rung holds; {}", say(&comparison))),
    }
}

fn say(c: &Comparison) -> String {
    format!(
        "{} pixels changed ({:.4} %), largest difference {}, RMS {:.3} (worst block {:.1}), SSIM {:.5} (worst window {:.3})",
        c.changed_pixels,
        100.0 * c.changed_share,
        c.largest_difference,
        c.rms,
        c.worst_block_rms,
        c.ssim,
        c.worst_ssim
    )
}
