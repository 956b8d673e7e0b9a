//! `twofold check`: recompute the figures and compare with the committed manifests, or with published pictures.

use std::path::{Path, PathBuf};

use twofold::cli::progress::Progress;
use twofold::cli::{in_pool, print};
use twofold::job::Desk;
use twofold::paper::figures;
use twofold::paper::pipeline::{PictureRecord, compute, questions};
use twofold::record::{self, Manifest};

use super::{Outcome, Problem, published};

/// Recompute figures and compare spec, data, pixels and files with the committed manifests; exit code 1 on a difference.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// Figures to check, such as fig7; all if none is named.
    figures: Vec<String>,
    /// What to check against instead of figures/figN/expected.json: another manifest, or a folder with published pictures (PNG, named
    /// like ours). A picture holds by the first of these that does: same file, same pixels, few and slightly changed pixels, small RMS,
    /// high SSIM.
    #[arg(long, value_name = "DIR|MANIFEST")]
    against: Option<PathBuf>,
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
    let mut figures = chosen(&arguments.figures)?;
    if let Some(folder) = arguments.against.as_ref().filter(|path| path.is_dir()) {
        return published::check(folder, &figures, arguments.threads, arguments.quiet);
    }
    let given = match &arguments.against {
        None => None,
        Some(path) => {
            let manifest = read_manifest(path)?;
            figures.retain(|f| f.id == manifest.figure);
            if figures.is_empty() {
                return Err(format!(
                    "{} is about \"{}\", which is not among the figures to check; name another manifest or figure",
                    path.display(),
                    manifest.figure
                )
                .into());
            }
            Some(manifest)
        }
    };
    // Every manifest is read before the first second of computing is spent.
    let manifests: Vec<Result<Manifest, Problem>> = figures
        .iter()
        .map(|figure| match &given {
            Some(manifest) => Ok(manifest.clone()),
            None => read_manifest(&arguments.expected.join(figure.id).join("expected.json")),
        })
        .collect();
    let progress = Progress::new(arguments.quiet);
    // A check never rests on a store: everything is computed here and now.
    let desk = Desk::new(None, &progress);
    in_pool(arguments.threads, || desk.gather(&questions(figures.iter().flat_map(|f| &f.pictures))))?;
    let mut failures = 0;
    let mut pictures = 0;
    for (figure, manifest) in figures.iter().zip(manifests) {
        let manifest = match manifest {
            Ok(manifest) => manifest,
            Err(problem) if arguments.against.is_some() => return Err(problem),
            Err(problem) => {
                print(&format!("{}: MISSING REFERENCE: {problem}", figure.id))?;
                failures += 1;
                continue;
            }
        };
        for picture in &figure.pictures {
            pictures += 1;
            let actual = compute(picture, &desk)?.record;
            let line = compare(&manifest, &actual);
            failures += usize::from(line.is_err());
            print(&line.unwrap_or_else(|difference| difference))?;
        }
        for missing in manifest.pictures.iter().filter(|e| !figure.pictures.iter().any(|p| p.name == e.name)) {
            print(&format!(
                "{}: NOT MADE: the manifest lists it, but {} has no such picture",
                missing.name, figure.id
            ))?;
            failures += 1;
        }
    }
    if failures == 0 {
        print(&format!("{pictures} pictures checked, all the same"))?;
        Ok(Outcome::Fine)
    } else {
        print(&format!(
            "{failures} differ. If the change is meant, look at the pictures (twofold report), then: twofold bless --reason \"why\""
        ))?;
        Ok(Outcome::Differs)
    }
}

/// "fig7-printed: same", or what differs first.
fn compare(manifest: &Manifest, actual: &PictureRecord) -> Result<String, String> {
    let name = &actual.hashes.name;
    let Some(expected) = manifest.picture(name) else {
        return Err(format!("{name}: MISSING REFERENCE: the manifest does not list this picture"));
    };
    match expected.first_difference(&actual.hashes) {
        None => Ok(format!("{name}: same (spec, data, verdict, pixels, PNG, SVG, PDF)")),
        Some(difference) => {
            let panels = if difference.panels.is_empty() {
                String::new()
            } else {
                format!(" of panel {}", difference.panels.join(", "))
            };
            Err(format!("{name}: DIFFERS first in its {}{panels}", difference.layer.name()))
        }
    }
}

fn read_manifest(path: &Path) -> Result<Manifest, Problem> {
    let text = record::files::read_text(path)?;
    Ok(Manifest::parse(&text, &path.display().to_string())?)
}

/// The figures of these names, or all.
pub fn chosen(names: &[String]) -> Result<Vec<twofold::paper::Figure>, Problem> {
    let all = figures::all();
    if let Some(unknown) = names.iter().find(|n| !all.iter().any(|f| f.id == *n)) {
        let known: Vec<&str> = all.iter().map(|f| f.id).collect();
        return Err(format!("there is no figure \"{unknown}\"; choose among {}", known.join(", ")).into());
    }
    Ok(all.into_iter().filter(|f| names.is_empty() || names.iter().any(|n| n == f.id)).collect())
}
