//! `twofold bless`: makes the current figures the reference, and records the reason.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::json;

use super::chosen;
use crate::cli::progress::Progress;
use crate::cli::speak::print_json;
use crate::cli::{CliError, Exit, in_pool, print};
use crate::job::Executor;
use crate::paper::code::verdict_table;
use crate::paper::figures;
use crate::paper::pipeline::{compute, questions};
use crate::record::manifest::VERSION;
use crate::record::{self, Manifest};

/// Recompute figures and write them as the new reference: their hashes, pictures, and
/// a line in CHANGES.md. Refused while any test other than the golden ones fails.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Example:\n  twofold bless fig7 --reason \"the exits are resolved in extended \
        precision\""
)]
pub struct Arguments {
    /// Figures to bless, such as fig7; all if none is named.
    figures: Vec<String>,
    /// Why the reference changes; kept in figures/CHANGES.md. Must be given.
    #[arg(long, value_name = "TEXT")]
    reason: String,
    /// A checkout's `figures`, or another folder, which gets NAME/expected.json.
    #[arg(long, value_name = "DIR", default_value = "figures")]
    expected: PathBuf,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// A record of the work as JSON on standard output.
    #[arg(long)]
    json: bool,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let reason = arguments.reason.trim();
    if reason.is_empty() || reason.contains('\n') {
        return Err(CliError::Usage(
            "--reason: give one line that says why the reference changes".into(),
        ));
    }
    let figures = chosen(&arguments.figures)?;
    record::files::try_folder(&arguments.expected)?;
    let say = |outcome: &str, changed: &[(String, String)], text: &str| {
        if !arguments.json {
            return print(text);
        }
        let changed: Vec<_> =
            changed.iter().map(|(name, what)| json!({ "picture": name, "what": what })).collect();
        print_json(
            &json!({ "format": "twofold-bless", "version": 1, "outcome": outcome, "reason": reason,
                "changed": changed }),
        )
    };
    // The tests are those of the checkout that holds the references.
    let checkout = arguments.expected.join("..").join("Cargo.toml");
    if !record::files::read_text(&checkout)
        .is_ok_and(|text| text.contains("name = \"twofold-dynamics\""))
    {
        return Err(CliError::Usage(format!(
            "{} is not in a checkout of twofold; a reference is made where its program and its \
                tests are",
            arguments.expected.display()
        )));
    }
    if !tests_pass()? {
        let why = "refused: a test fails that compares with no reference; a reference must not be \
            made by a program that is wrong";
        say("refused", &[], why)?;
        return Ok(Exit::CheckFailed);
    }
    let progress = Progress::new(arguments.quiet);
    let executor = Executor::new(None, &progress);
    in_pool(arguments.threads, || {
        executor.gather(&questions(figures.iter().flat_map(|f| &f.pictures)))
    })?;
    let mut changed: Vec<(String, String)> = Vec::new();
    for figure in &figures {
        let folder = arguments.expected.join(&*figure.id);
        let path = figures::reference_file(&arguments.expected, &figure.id);
        let before = record::files::read_text(&path)
            .ok()
            .and_then(|text| Manifest::parse(&text, &path.display().to_string()).ok());
        let mut manifest = Manifest {
            version: VERSION,
            figure: figure.id.to_string(),
            made_by: env!("CARGO_PKG_VERSION").to_owned(),
            pictures: Vec::new(),
        };
        for picture in &figure.pictures {
            let computed = compute(picture, &executor)?;
            let entry = computed.record.hashes;
            let what = match before.as_ref().and_then(|m| m.picture(&entry.name)) {
                None => Some("new".to_owned()),
                Some(old) => old.first_difference(&entry).map(|d| d.layer.name().to_owned()),
            };
            if let Some(what) = what {
                changed.push((entry.name.clone(), what));
            }
            record::write(&folder.join(format!("{}.png", entry.name)), &computed.rendered.png)?;
            manifest.pictures.push(entry);
        }
        record::write(&path, &manifest.to_json())?;
    }
    write_table(&arguments.expected)?;
    if changed.is_empty() {
        say("nothing", &[], "nothing changed")?;
        return Ok(Exit::Fine);
    }
    let list: Vec<String> = changed.iter().map(|(name, what)| format!("{name} ({what})")).collect();
    let list = list.join(", ");
    let log = arguments.expected.join("CHANGES.md");
    let mut text = record::files::read_text(&log).unwrap_or_else(|_| HEADER.to_owned());
    text += &format!("- {reason}: {list}\n");
    record::write(&log, text.as_bytes())?;
    say("blessed", &changed, &format!("blessed: {list}"))?;
    Ok(Exit::Fine)
}

const HEADER: &str = "# Why the reference pictures changed\n\nA line per `twofold bless`, oldest \
    first: reason, then each picture \
                      with the first layer that changed.\n\n";

/// Puts the verdicts into docs/findings.md, if it stands beside the references and has a place for
/// them.
fn write_table(expected: &Path) -> Result<(), CliError> {
    let path = expected.join("..").join("docs").join("findings.md");
    let Ok(written) = record::files::read_text(&path) else { return Ok(()) };
    let manifests: Vec<Manifest> = figures::all()
        .iter()
        .filter_map(|f| {
            let path = figures::reference_file(expected, &f.id);
            Manifest::parse(&record::files::read_text(&path).ok()?, &path.display().to_string())
                .ok()
        })
        .collect();
    if let Some(text) = verdict_table::with_table(&written, &verdict_table::table(&manifests)) {
        record::write(&path, text.as_bytes())?;
    }
    Ok(())
}

/// Runs the test suite without the golden tests (which a new reference is about to change).
fn tests_pass() -> Result<bool, CliError> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .args(["test", "--quiet", "--", "--skip", "golden"])
        // The book's checks may differ now: they are golden, too.
        .env("TWOFOLD_BLESS", "1")
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .status()
        .map_err(|e| {
            CliError::Usage(format!(
                "cannot run the tests with cargo: {e}; bless from a checkout with Rust installed"
            ))
        })?;
    Ok(status.success())
}
