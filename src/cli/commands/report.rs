//! `twofold report`: writes one page about all figures that were made.

use std::path::{Path, PathBuf};

use serde_json::json;

use crate::cli::speak::print_json;
use crate::cli::{CliError, Exit, in_pool, print};
use crate::paper::{Figure, figures};
use crate::record::{self, FileBytes, visit_tree};
use crate::report::{Links, MadeFile, Program, Report, archive, assemble, names, page};

const FINDINGS: &str = concat!(
    include_str!("../../../docs/findings.md"),
    "\n\n",
    include_str!("../../../docs/theorems.md")
);
/// The pages of odds that the report repeats.
const ODDS: &str = concat!(
    include_str!("../../../docs/census.md"),
    "\n\n",
    include_str!("../../../docs/capture.md"),
    "\n\n",
    include_str!("../../../docs/parameters.md")
);

/// Write a self-contained page about the figures in a folder, and beside it report.json,
/// verdicts.json and RO-Crate metadata.
///
/// A difference from the reference is shown on the page; it is not a failure of this command (see
/// `twofold check`).
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  twofold report\n  twofold report --figures pictures --out page.html \
        --json"
)]
pub struct Arguments {
    /// Folder with the figures; the JSON files are written to it.
    #[arg(long, value_name = "DIR", default_value = "target/figures")]
    figures: PathBuf,
    /// Folder with references, NAME.json or NAME/expected.json, or a checkout's `figures` [default:
    /// figures, or away from a checkout the hashes that this program was built with].
    #[arg(long, value_name = "DIR")]
    expected: Option<PathBuf>,
    /// The page; index.html in the folder with the figures if not given. Elsewhere it names the
    /// files instead of linking to them.
    #[arg(long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// The files written and the findings, as JSON on standard output.
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    in_pool(0, || report(arguments))?
}

fn report(arguments: &Arguments) -> Result<Exit, CliError> {
    let folder = &arguments.figures;
    let known = figures::all();
    let (made, _) =
        visit_tree(folder, &|_| true, &|path, place| MadeFile::read(path, place, &known)).map_err(
            |e| {
                CliError::Usage(format!("{e}; run `make figures` first, or name another --figures"))
            },
        )?;
    let report = assemble(
        &made,
        &references(arguments.expected.as_deref())?,
        &Program { figures: &known, findings: FINDINGS, odds: ODDS },
    );
    if report.figures.is_empty() {
        return Err(CliError::Usage(format!(
            "{}: no figure's pictures are in this folder; run `make figures` first, or name \
                another --figures",
            folder.display()
        )));
    }
    record::files::try_folder(folder)?;
    let beside = folder.join(names::PAGE);
    let out = arguments.out.as_ref().unwrap_or(&beside);
    record::files::try_place(out)?;
    let html = page(&report, if stands_in(out, folder) { Links::Beside } else { Links::None });
    let (json, verdicts) = (report.to_json(), report.verdicts_json());
    record::write(&folder.join(names::REPORT), &json)?;
    record::write(&folder.join(names::VERDICTS), &verdicts)?;
    let mut added: Vec<(&str, &[u8])> = vec![(names::REPORT, &json), (names::VERDICTS, &verdicts)];
    // A page that stands elsewhere is not part of the folder.
    if stands_in(out, folder) && out.file_name() == Path::new(names::PAGE).file_name() {
        added.push((names::PAGE, &html));
    }
    record::write(&folder.join(names::ARCHIVE), &archive(&report, &made, &added))?;
    record::write(out, &html)?;
    if arguments.json {
        print_json(&json!({
            "format": "twofold-report-written",
            "version": 1,
            "page": out,
            "summary": report.summary,
            "problems": report.problems,
        }))?;
    } else {
        print(&said(&report, out))?;
    }
    Ok(Exit::Fine)
}

/// The committed manifests and pictures.
///
/// # Errors
///
/// If the folder that was named is none.
pub fn references(given: Option<&Path>) -> Result<Vec<FileBytes>, CliError> {
    let folder = given.unwrap_or(Path::new("figures"));
    // Away from a checkout, those that this program was built with: hashes only, no pictures.
    if given.is_none() && !folder.exists() {
        let embedded = |f: &Figure| {
            let text = figures::reference(&f.id)?;
            Some(FileBytes {
                path: format!("{}/expected.json", &*f.id),
                bytes: text.as_bytes().to_vec(),
            })
        };
        return Ok(figures::all().iter().filter_map(embedded).collect());
    }
    if !folder.is_dir() {
        return Err(CliError::Usage(format!(
            "--expected {}: there is no such folder; it holds references, NAME.json or \
                NAME/expected.json",
            folder.display()
        )));
    }
    Ok(figures::references_in(folder)?)
}

fn stands_in(page: &Path, folder: &Path) -> bool {
    let parent = page.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    match (parent.canonicalize(), folder.canonicalize()) {
        (Ok(a), Ok(b)) => a == b,
        _ => false,
    }
}

fn said(report: &Report, out: &Path) -> String {
    let s = &report.summary;
    let mut lines = vec![format!("wrote {}", out.display())];
    lines.push(format!("{} of {} pictures match the reference", s.same, s.pictures));
    for r in &s.readings {
        let name = r.reading.map_or("no reading", |r| r.word());
        lines.push(format!("{name}: {} of {} claims agree", r.agree, r.claims));
    }
    lines.extend(report.problems.iter().map(|p| format!("problem: {p}")));
    lines.join("\n")
}
