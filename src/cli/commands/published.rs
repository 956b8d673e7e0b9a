//! `twofold check --against DIR`: compares published pictures with a fresh computation.

use std::path::Path;

use serde::Serialize;

use crate::cli::progress::Progress;
use crate::cli::speak::print_json;
use crate::cli::{CliError, Exit, in_pool, print};
use crate::compare::{Comparison, Criterion, Limits, SizesDiffer, compare};
use crate::job::Executor;
use crate::paper::Figure;
use crate::paper::pipeline::{Computed, compute, pixel_hash, questions};
use crate::record::{FileBytes, Hash, read_tree};
use crate::render::{decode_png, png_size};

/// The finding about one of their files, or about one of our pictures that they do not have.
#[derive(Debug, Serialize)]
struct Finding {
    /// The file's path in their folder; our picture's name if there is none.
    name: String,
    /// Whether it was compared at all.
    checked: bool,
    /// The strictest criterion that is met; called a rung in JSON.
    #[serde(rename = "rung")]
    criterion: Option<Criterion>,
    /// In words.
    found: String,
    /// The difference of the two, where it could be measured.
    comparison: Option<Comparison>,
}

/// Computes every figure of which the folder holds a picture, and prints for each picture the
/// criterion that it meets.
pub fn check(
    folder: &Path,
    figures: &[Figure],
    threads: usize,
    quiet: bool,
    json: bool,
) -> Result<Exit, CliError> {
    let tree = read_tree(folder, &|path| path.ends_with(".png"))?;
    let published = tree.files;
    let named = |name: &str| -> Vec<&FileBytes> {
        published.iter().filter(|f| f.name().strip_suffix(".png") == Some(name)).collect()
    };
    let known: Vec<&str> =
        figures.iter().flat_map(|f| &f.pictures).map(|p| p.name.as_str()).collect();
    if !known.iter().any(|name| !named(name).is_empty()) {
        return Err(CliError::Usage(format!(
            "{}: no picture in this folder has a name of one of ours; ours are called {}",
            folder.display(),
            known.iter().map(|n| format!("{n}.png")).collect::<Vec<_>>().join(", ")
        )));
    }
    let progress = Progress::new(quiet);
    let executor = Executor::new(None, &progress);
    let wanted = figures.iter().flat_map(|f| &f.pictures).filter(|p| !named(&p.name).is_empty());
    in_pool(threads, || executor.gather(&questions(wanted)))?;
    let limits = Limits::default();
    let mut findings = Vec::new();
    let mut say = |finding: Finding| {
        let line = format!("{}: {}", finding.name, finding.found);
        findings.push(finding);
        if json { Ok(()) } else { print(&line) }
    };
    let passed_over = |name: &str, why: &str| Finding {
        name: name.to_owned(),
        checked: false,
        criterion: None,
        found: why.to_owned(),
        comparison: None,
    };
    for picture in figures.iter().flat_map(|f| &f.pictures) {
        let files = named(&picture.name);
        if files.is_empty() {
            say(passed_over(&picture.name, "not in the folder, not checked"))?;
            continue;
        }
        let computed = compute(picture, &executor)?;
        for file in files {
            say(held(file, &computed, &limits))?;
        }
    }
    for other in published.iter().filter(|f| !known.iter().any(|n| f.name() == format!("{n}.png")))
    {
        say(passed_over(&other.path, "not named like one of the pictures to check, skipped"))?;
    }
    for link in &tree.dangling {
        say(passed_over(link, "a broken link, skipped"))?;
    }
    let checked = findings.iter().filter(|f| f.checked).count();
    let failures = findings.iter().filter(|f| f.checked && f.criterion.is_none()).count();
    if json {
        print_json(&serde_json::json!({
            "format": "twofold-check-published",
            "version": 1,
            "limits": limits,
            "checked": checked,
            "hold_on_no_rung": failures,
            "findings": findings,
        }))?;
    } else if failures == 0 {
        print(&format!("{checked} checked, all hold"))?;
    } else {
        print(&format!("{failures} of {checked} meet no criterion"))?;
    }
    Ok(if failures == 0 { Exit::Fine } else { Exit::CheckFailed })
}

/// The strictest criterion that is met, and a sentence.
fn held(file: &FileBytes, computed: &Computed, limits: &Limits) -> Finding {
    let ours = &computed.record.hashes;
    let finding = |criterion, found: String, comparison| Finding {
        name: file.path.clone(),
        checked: true,
        criterion,
        found,
        comparison,
    };
    if Hash::of(&file.bytes) == ours.png {
        return finding(
            Some(Criterion::SameFile),
            "holds exactly (file: SHA-256 equal)".into(),
            None,
        );
    }
    // The size is in the first bytes: a file that claims another is not decoded.
    let expected = (computed.rendered.pixels.width, computed.rendered.pixels.height);
    if let Some(actual) = png_size(&file.bytes).filter(|actual| *actual != expected) {
        return finding(None, cannot_be_compared(&SizesDiffer { expected, actual }), None);
    }
    let theirs = match decode_png(&file.bytes) {
        Ok(pixels) => pixels,
        Err(error) => {
            return finding(None, format!("DIFFERS: cannot be read as a picture ({error})"), None);
        }
    };
    if pixel_hash(&theirs) == ours.pixels {
        let text =
            "holds exactly in its pixels (SHA-256 equal); the file's encoding or metadata differ";
        return finding(Some(Criterion::Pixels), text.into(), None);
    }
    let comparison = match compare(&computed.rendered.pixels, &theirs) {
        Ok(comparison) => comparison,
        Err(sizes) => return finding(None, cannot_be_compared(&sizes), None),
    };
    match limits.strictest(&comparison) {
        Some(criterion) => {
            let text = format!(
                "holds within tolerance ({}); {}",
                limits.describe(criterion),
                say(&comparison)
            );
            finding(Some(criterion), text, Some(comparison))
        }
        None => finding(
            None,
            format!("DIFFERS: no criterion is met; {}", say(&comparison)),
            Some(comparison),
        ),
    }
}

fn cannot_be_compared(sizes: &SizesDiffer) -> String {
    format!("DIFFERS: ours and theirs cannot be compared, {sizes}")
}

fn say(c: &Comparison) -> String {
    format!(
        "{} pixels changed ({:.4} %), largest difference {}, RMS {:.3} (worst block {:.1}), SSIM \
            {:.5} (worst window {:.3})",
        c.changed_pixels,
        100.0 * c.changed_share,
        c.largest_difference,
        c.rms,
        c.worst_block_rms,
        c.ssim,
        c.worst_ssim
    )
}
