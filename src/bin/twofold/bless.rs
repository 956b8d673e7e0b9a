//! `twofold bless`: make today's figures the reference, with a reason that stays.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use twofold::cli::progress::Progress;
use twofold::cli::{in_pool, print};
use twofold::job::Desk;
use twofold::paper::pipeline::{compute, questions};
use twofold::record::manifest::VERSION;
use twofold::record::{self, Manifest};

use super::{Outcome, Problem, check};

/// Recompute figures and write them as the new reference: figures/figN/expected.json, its PNG, and a line in CHANGES.md.
/// Refused while any test other than the golden ones fails.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Figures to bless, such as fig7; all if none is named.
    figures: Vec<String>,
    /// Why the reference changes; kept in figures/CHANGES.md.
    #[arg(long, value_name = "TEXT")]
    reason: String,
    /// Folder that holds figN/expected.json.
    #[arg(long, value_name = "DIR", default_value = "figures")]
    expected: PathBuf,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

pub fn run(arguments: &Arguments) -> Result<Outcome, Problem> {
    let reason = arguments.reason.trim();
    if reason.is_empty() || reason.contains('\n') {
        return Err("--reason: give one line that says why the reference changes".into());
    }
    let figures = check::chosen(&arguments.figures)?;
    if !tests_pass()? {
        print("refused: a test that is not golden fails; a reference must not be made from a program that is wrong")?;
        return Ok(Outcome::Differs);
    }
    let progress = Progress::new(arguments.quiet);
    let desk = Desk::new(None, &progress);
    in_pool(arguments.threads, || desk.gather(&questions(figures.iter().flat_map(|f| &f.pictures))))?;
    let mut changed = Vec::new();
    for figure in &figures {
        let folder = arguments.expected.join(figure.id);
        let path = folder.join("expected.json");
        let before = record::files::read_text(&path)
            .ok()
            .and_then(|text| Manifest::parse(&text, &path.display().to_string()).ok());
        let mut manifest = Manifest {
            version: VERSION,
            figure: figure.id.to_owned(),
            made_by: env!("CARGO_PKG_VERSION").to_owned(),
            pictures: Vec::new(),
        };
        for picture in &figure.pictures {
            let computed = compute(picture, &desk)?;
            let entry = computed.record.hashes;
            let what = match before.as_ref().and_then(|m| m.picture(&entry.name)) {
                None => Some("new".to_owned()),
                Some(old) => old.first_difference(&entry).map(|d| d.layer.name().to_owned()),
            };
            if let Some(what) = what {
                changed.push(format!("{} ({what})", entry.name));
            }
            record::write(&folder.join(format!("{}.png", entry.name)), &computed.rendered.png)?;
            manifest.pictures.push(entry);
        }
        record::write(&path, &manifest.to_json())?;
    }
    if changed.is_empty() {
        print("nothing changed")?;
        return Ok(Outcome::Fine);
    }
    let log = arguments.expected.join("CHANGES.md");
    let mut text = record::files::read_text(&log).unwrap_or_else(|_| HEADER.to_owned());
    text += &format!("- {reason}: {}\n", changed.join(", "));
    record::write(&log, text.as_bytes())?;
    print(&format!("blessed: {}", changed.join(", ")))?;
    Ok(Outcome::Fine)
}

const HEADER: &str = "# Why the reference pictures changed\n\nA line per `twofold bless`, oldest first: reason, then each picture \
                      with the first layer that changed.\n\n";

/// Runs the test suite without the golden tests (which a new reference is about to change).
fn tests_pass() -> Result<bool, Problem> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .args(["test", "--quiet", "--", "--skip", "golden"])
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .status()
        .map_err(|e| format!("cannot run the tests with cargo: {e}; bless from a checkout with Rust installed"))?;
    Ok(status.success())
}
