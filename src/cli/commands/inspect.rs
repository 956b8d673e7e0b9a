//! `twofold inspect`: prints a picture's provenance and checks its seal.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::cli::speak::{harmless, print_json};
use crate::cli::{CliError, Exit, print};
use crate::paper::figures::references_in;
use crate::paper::pipeline::pixel_hash;
use crate::record::{self, Hash, Manifest, PictureEntry};
use crate::render::{Format, Provenance, ProvenanceError, decode_png, read_provenance};

/// Print the provenance inside a PNG, SVG or PDF file and say whether twofold made it and it is
/// unchanged.
///
/// Exit code 0: made by twofold and unchanged. 1: not made by twofold, or changed, or of the name
/// of a committed picture but not its bytes. 2: the file cannot be read as a picture. The seal
/// inside a file tells damage and editing; only the committed hash tells forgery.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  twofold inspect fig7-printed.png\n  twofold inspect --json \
        someone-elses.pdf")]
pub struct Arguments {
    /// The picture.
    file: PathBuf,
    /// Folder with references, NAME.json or NAME/expected.json, or a checkout's `figures` [default:
    /// figures, or where there are none the file is judged by its seal alone].
    #[arg(long, value_name = "DIR")]
    expected: Option<PathBuf>,
    /// JSON on standard output.
    #[arg(long)]
    json: bool,
}

/// The state of the seal.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
enum Seal {
    /// The file is byte for byte what was written.
    Intact,
    /// It is not.
    Broken,
    /// The provenance itself is damaged.
    Damaged,
    /// There is none.
    Absent,
}

/// The comparison of the file with the committed manifests.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
#[serde(tag = "state", rename_all = "kebab-case")]
enum Committed {
    /// It is this picture, byte for byte.
    Same { picture: String },
    /// Its pixels are this picture's; the file is not.
    SamePixels { picture: String },
    /// It bears this picture's name and is not it.
    Different { picture: String },
    /// It is a committed picture, but the file's name is that of another.
    Misnamed { picture: String, name: String },
    /// No manifest knows it.
    Unlisted,
    /// There are no manifests to ask.
    NoManifests,
}

#[derive(Debug, Serialize)]
struct Inspection {
    format: &'static str,
    sha256: Hash,
    ours_and_unchanged: bool,
    seal: Seal,
    committed: Committed,
    provenance: Vec<(String, String)>,
}

pub fn run(arguments: &Arguments) -> Result<Exit, CliError> {
    let bytes = record::files::read(&arguments.file)?;
    let read = read_provenance(&bytes);
    if let Err(error @ ProvenanceError::UnknownFormat) = read {
        return Err(CliError::Usage(format!("{}: {error}", arguments.file.display())));
    }
    let manifests = manifests(arguments.expected.as_deref())?;
    let inspection =
        inspect(&bytes, read, &manifests, arguments.file.file_stem().and_then(|s| s.to_str()));
    if arguments.json {
        print_json(&inspection)?;
    } else {
        print(&describe(&inspection, &arguments.file))?;
    }
    Ok(if inspection.ours_and_unchanged { Exit::Fine } else { Exit::CheckFailed })
}

/// All committed manifests; none if no folder is given and there is none.
fn manifests(given: Option<&Path>) -> Result<Vec<Manifest>, CliError> {
    let folder = given.unwrap_or(Path::new("figures"));
    if given.is_some() && !folder.is_dir() {
        return Err(CliError::Usage(format!(
            "--expected {}: there is no such folder; it holds references, NAME.json or \
                NAME/expected.json",
            folder.display()
        )));
    }
    if !folder.exists() {
        return Ok(Vec::new());
    }
    let mut all = Vec::new();
    for file in references_in(folder)?.into_iter().filter(|f| f.path.ends_with("/expected.json")) {
        let name = folder.join(&file.path).display().to_string();
        all.push(Manifest::parse(&String::from_utf8_lossy(&file.bytes), &name)?);
    }
    Ok(all)
}

fn inspect(
    bytes: &[u8],
    read: Result<Provenance, ProvenanceError>,
    manifests: &[Manifest],
    stem: Option<&str>,
) -> Inspection {
    let sha256 = Hash::of(bytes);
    let (seal, provenance) = match &read {
        Ok(p) if p.intact => (Seal::Intact, p.entries.clone()),
        Ok(p) => (Seal::Broken, p.entries.clone()),
        Err(ProvenanceError::Damaged) => (Seal::Damaged, Vec::new()),
        Err(_) => (Seal::Absent, Vec::new()),
    };
    let format = match &read {
        Ok(p) => p.format,
        Err(_) if bytes.starts_with(b"\x89PNG") => Format::Png,
        Err(_) if bytes.starts_with(b"%PDF") => Format::Pdf,
        Err(_) => Format::Svg,
    };
    let named = provenance.iter().find(|(k, _)| k == "Picture").map(|(_, v)| v.as_str());
    let committed = match committed(bytes, &sha256, format, named, manifests) {
        Committed::Same { picture } => {
            let mut names = manifests.iter().flat_map(|m| &m.pictures).map(|p| &p.name);
            match names.find(|name| stem == Some(name.as_str()) && **name != picture).cloned() {
                Some(name) => Committed::Misnamed { picture, name },
                None => Committed::Same { picture },
            }
        }
        other => other,
    };
    let contradicted =
        !matches!(committed, Committed::Same { .. } | Committed::Unlisted | Committed::NoManifests);
    Inspection {
        format: match format {
            Format::Png => "PNG",
            Format::Svg => "SVG",
            Format::Pdf => "PDF",
        },
        ours_and_unchanged: seal == Seal::Intact && !contradicted,
        sha256,
        seal,
        committed,
        provenance,
    }
}

fn committed(
    bytes: &[u8],
    hash: &Hash,
    format: Format,
    named: Option<&str>,
    manifests: &[Manifest],
) -> Committed {
    if manifests.is_empty() {
        return Committed::NoManifests;
    }
    let all = || manifests.iter().flat_map(|m| &m.pictures);
    let file = |e: &PictureEntry| match format {
        Format::Png => e.png.clone(),
        Format::Svg => e.svg.clone(),
        Format::Pdf => e.pdf.clone(),
    };
    if let Some(e) = all().find(|e| file(e) == *hash) {
        return Committed::Same { picture: e.name.clone() };
    }
    let pixels =
        (format == Format::Png).then(|| decode_png(bytes).ok()).flatten().map(|p| pixel_hash(&p));
    if let Some(e) = all().find(|e| Some(&e.pixels) == pixels.as_ref()) {
        return Committed::SamePixels { picture: e.name.clone() };
    }
    match all().find(|e| Some(e.name.as_str()) == named) {
        Some(e) => Committed::Different { picture: e.name.clone() },
        None => Committed::Unlisted,
    }
}

fn describe(i: &Inspection, file: &Path) -> String {
    let mut lines =
        vec![format!("{}: {}, SHA-256 {}", file.display(), i.format, i.sha256.as_str())];
    let width = i.provenance.iter().map(|(k, _)| k.chars().count()).max().unwrap_or(0);
    for (key, value) in &i.provenance {
        lines.push(format!("  {:width$}  {}", harmless(key), harmless(value)));
    }
    lines.push(match i.seal {
        Seal::Intact => "Seal: intact, the file is byte for byte what was written".into(),
        Seal::Broken => "Seal: BROKEN, the file was changed after it was written".into(),
        Seal::Damaged => "Seal: DAMAGED, the provenance was cut off or overwritten".into(),
        Seal::Absent => "Seal: none, the file carries no provenance of twofold".into(),
    });
    lines.push(match &i.committed {
        Committed::Same { picture } => format!("Reference: the committed {picture}, byte for byte"),
        Committed::SamePixels { picture } => {
            format!("Reference: the pixels of the committed {picture}, in another file")
        }
        Committed::Different { picture } => {
            format!("Reference: it has the name of {picture} and is NOT the committed file")
        }
        Committed::Misnamed { picture, name } => {
            format!(
                "Reference: it is the committed {picture}, byte for byte, and its name is that \
                of {name}"
            )
        }
        Committed::Unlisted => {
            "Reference: no committed manifest lists it (an altered picture, or another \
                version's)"
                .into()
        }
        Committed::NoManifests => "Reference: none; judged by its seal alone".into(),
    });
    lines.push(
        match (i.ours_and_unchanged, i.seal) {
            (true, _) => "Made by twofold, and unchanged.",
            (false, Seal::Absent) => "Not made by twofold.",
            (false, Seal::Intact) => "Made by twofold by its seal, but not the committed picture.",
            (false, _) => "Made by twofold, and changed since.",
        }
        .into(),
    );
    lines.join("\n")
}
