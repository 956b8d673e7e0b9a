//! `twofold check`: recompute the figures and compare with the committed manifests, or with
//! published pictures.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{chosen, published};
use crate::cli::progress::Progress;
use crate::cli::speak::print_json;
use crate::cli::{CliError, Exit, in_pool, print};
use crate::job::Executor;
use crate::paper::figures;
use crate::paper::pipeline::{PictureRecord, compute, questions};
use crate::record::{self, Layer, Manifest, listed};

/// Recompute figures and compare spec, data, pixels and files with the committed manifests; exit
/// code 1 on a difference.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  twofold check fig5 fig6\n  twofold check --json --quiet > \
        check.json\n  twofold check --against ~/their-pictures")]
pub struct Arguments {
    /// Figures to check, such as fig7 (any other word lists their names); all if none is named.
    figures: Vec<String>,
    /// Reference to check against instead of the paper's: another manifest, or a
    /// folder with published pictures (PNG, named like ours). A picture holds by the first of these
    /// that does: same file, same pixels, few and slightly changed pixels, small RMS, high SSIM.
    #[arg(long, value_name = "DIR|MANIFEST")]
    against: Option<PathBuf>,
    /// Folder with references, NAME.json or NAME/expected.json, or a checkout's `figures` [default:
    /// the references that this program was built with].
    #[arg(long, value_name = "DIR", conflicts_with = "against")]
    expected: Option<PathBuf>,
    /// Threads; 0 is one per core.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    /// The findings, as JSON on standard output when all is checked.
    #[arg(long)]
    json: bool,
    /// No progress on standard error.
    #[arg(long)]
    quiet: bool,
}

/// The finding about one picture, or about a figure's manifest.
#[derive(Debug, Serialize)]
struct Finding {
    /// The picture, or the figure if its manifest cannot be used.
    name: String,
    #[serde(flatten)]
    state: State,
}

#[derive(Debug, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
enum State {
    Same,
    Differs { layer: Layer, panels: Vec<String> },
    MissingReference { why: String },
    NotMade,
}

impl Finding {
    fn line(&self) -> String {
        let name = &self.name;
        match &self.state {
            State::Same => format!("{name}: same (spec, data, verdict, pixels, PNG, SVG, PDF)"),
            State::Differs { layer, panels } if panels.is_empty() => {
                format!("{name}: DIFFERS first in its {}", layer.name())
            }
            State::Differs { layer, panels } => {
                format!("{name}: DIFFERS first in its {} of panel {}", layer.name(), listed(panels))
            }
            State::MissingReference { why } => format!("{name}: MISSING REFERENCE: {why}"),
            State::NotMade => format!(
                "{name}: NOT MADE: the manifest lists it, but its figure has no such picture"
            ),
        }
    }
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let mut figures = chosen(&arguments.figures)?;
    if let Some(folder) = arguments.against.as_ref().filter(|path| path.is_dir()) {
        return published::check(
            folder,
            &figures,
            arguments.threads,
            arguments.quiet,
            arguments.json,
        );
    }
    let given = match &arguments.against {
        None => None,
        Some(path) => {
            let manifest = read_manifest(path)?;
            if let Some(other) = arguments.figures.iter().find(|name| **name != manifest.figure) {
                return Err(CliError::Usage(format!(
                    "{} is about \"{}\" and says nothing of {other}; leave {other} out, or name \
                        another manifest",
                    path.display(),
                    manifest.figure
                )));
            }
            figures.retain(|f| *f.id == manifest.figure);
            if figures.is_empty() {
                return Err(CliError::Usage(format!(
                    "{} is about \"{}\", which is not among the figures to check; name another \
                        manifest or figure",
                    path.display(),
                    manifest.figure
                )));
            }
            Some(manifest)
        }
    };
    if let Some(folder) = arguments.expected.as_ref().filter(|folder| !folder.is_dir()) {
        return Err(CliError::Usage(format!(
            "--expected {}: there is no such folder; it holds references, NAME.json or \
                NAME/expected.json",
            folder.display()
        )));
    }
    // Every manifest is read before the first second of computing is spent.
    let manifests: Vec<Result<Manifest, CliError>> = figures
        .iter()
        .map(|figure| match &given {
            Some(manifest) => Ok(manifest.clone()),
            None => match &arguments.expected {
                Some(folder) => {
                    manifest_of(&figure.id, &figures::reference_file(folder, &figure.id))
                }
                None => embedded(&figure.id),
            },
        })
        .collect();
    let progress = Progress::new(arguments.quiet);
    // A check never rests on a store: everything is computed here and now.
    let executor = Executor::new(None, &progress);
    in_pool(arguments.threads, || {
        executor.gather(&questions(figures.iter().flat_map(|f| &f.pictures)))
    })?;
    let mut findings = Vec::new();
    let mut found = |name: &str, state: State| {
        let finding = Finding { name: name.to_owned(), state };
        let line = finding.line();
        findings.push(finding);
        if arguments.json { Ok(()) } else { print(&line) }
    };
    for (figure, manifest) in figures.iter().zip(manifests) {
        let manifest = match manifest {
            Ok(manifest) => manifest,
            Err(problem) => {
                found(&figure.id, State::MissingReference { why: problem.to_string() })?;
                continue;
            }
        };
        for picture in &figure.pictures {
            let actual = compute(picture, &executor)?.record;
            found(&actual.hashes.name, compare(&manifest, &actual))?;
        }
        for missing in
            manifest.pictures.iter().filter(|e| !figure.pictures.iter().any(|p| p.name == e.name))
        {
            found(&missing.name, State::NotMade)?;
        }
    }
    let failures = findings.iter().filter(|f| !matches!(f.state, State::Same)).count();
    if arguments.json {
        print_json(&serde_json::json!({
            "format": "twofold-check",
            "version": 1,
            "all_the_same": failures == 0,
            "findings": findings,
        }))?;
    } else if failures == 0 {
        let pictures = if findings.len() == 1 {
            "1 picture".to_owned()
        } else {
            format!("{} pictures", findings.len())
        };
        print(&format!("{pictures} checked, all the same"))?;
    } else {
        print(&format!(
            "{failures} differ. If the change is meant, look at the pictures (twofold report), \
                then: twofold bless --reason \"why\""
        ))?;
    }
    Ok(if failures == 0 { Exit::Fine } else { Exit::CheckFailed })
}

/// The first layer that differs, if one does.
fn compare(manifest: &Manifest, actual: &PictureRecord) -> State {
    let Some(expected) = manifest.picture(&actual.hashes.name) else {
        return State::MissingReference { why: "the manifest does not list this picture".into() };
    };
    match expected.first_difference(&actual.hashes) {
        None => State::Same,
        Some(difference) => State::Differs { layer: difference.layer, panels: difference.panels },
    }
}

/// The reference that this program was built with.
fn embedded(id: &str) -> Result<Manifest, CliError> {
    let text = figures::reference(id)
        .ok_or_else(|| CliError::Usage(format!("no reference is committed for {id}")))?;
    Ok(Manifest::parse(text, &format!("the built-in reference of {id}"))?)
}

/// The manifest at `path`, which must be about this figure.
fn manifest_of(id: &str, path: &Path) -> Result<Manifest, CliError> {
    let manifest = read_manifest(path)?;
    if manifest.figure == id {
        return Ok(manifest);
    }
    Err(CliError::Usage(format!(
        "{} is about \"{}\", and not about {id}",
        path.display(),
        manifest.figure
    )))
}

fn read_manifest(path: &Path) -> Result<Manifest, CliError> {
    let text = record::files::read_text(path)?;
    Ok(Manifest::parse(&text, &path.display().to_string())?)
}
