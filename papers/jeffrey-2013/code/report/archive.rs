//! RO-Crate 1.1 metadata: what an archive needs to take the folder as it is.

use rayon::prelude::*;
use serde_json::{Value, json};

use super::assemble::{MadeFile, media_type};
use super::model::{Report, indented};
use super::names;
use twofold_paper::html::address;
use twofold_render::read_provenance;

/// Date of the release, as CITATION.cff has it. RO-Crate asks for a date of publication; a clock
/// would make the bytes of this file differ from run to run.
pub const RELEASE_DATE: &str = "2026-11-21";

/// Address of the program's documentation, as in Cargo.toml.
const DOCUMENTATION: &str = "https://docs.rs/twofold-dynamics";

/// The program in a line.
const SOFTWARE: &str = "A paper's figures, claims and verdicts, and the report about them";

/// The licence of program and pictures, either of two: address, name, what it allows in a line.
const LICENCES: [(&str, &str, &str); 2] = [
    (
        "https://spdx.org/licenses/MIT",
        "MIT License",
        "Use, change and pass on freely, with the copyright notice; without warranty.",
    ),
    (
        "https://spdx.org/licenses/Apache-2.0",
        "Apache License 2.0",
        "Use, change and pass on freely, with the licence and notices of changes; grants patents; \
            without warranty.",
    ),
];
/// The article, as its author's university lists it.
const ARTICLE: &str = "https://research-information.bris.ac.uk/en/publications/singularities-that-induce-a-breakdown-of-determinism-in-mechanics";
/// The university: address, name.
const AFFILIATION: (&str, &str) = ("https://www.bristol.ac.uk/", "University of Bristol");
/// Proceedings in which the article appeared, in that list's words.
pub(super) const PROCEEDINGS: &str =
    "Proc. 5th International Conference on Structural Dynamics SEMS, Cape Town";

/// The metadata of a folder that holds `made` and what the report adds to it (`added`: name and
/// bytes).
pub fn archive(report: &Report, made: &[MadeFile], added: &[(&str, &[u8])]) -> Vec<u8> {
    let own = [names::PAGE, names::REPORT, names::VERDICTS, names::ARCHIVE];
    let added = added.iter().map(|(name, bytes)| MadeFile::of((*name).to_owned(), bytes.to_vec()));
    let added: Vec<MadeFile> = added.collect();
    let mut files: Vec<&MadeFile> =
        made.iter().filter(|f| !own.contains(&f.path.as_str())).chain(&added).collect();
    files.sort_by_key(|file| &file.path);

    let mut graph = vec![
        json!({
            "@id": names::ARCHIVE,
            "@type": "CreativeWork",
            "about": { "@id": "./" },
            "conformsTo": { "@id": "https://w3id.org/ro/crate/1.1" },
        }),
        json!({
            "@id": "./",
            "@type": "Dataset",
            "name": format!("Figures of {} ({}), \
                recomputed", report.article.author, report.article.year),
            "description": format!(
                "Pictures, numbers, hashes and verdicts for \"{}\", computed by {}. The same \
                    version is made to compute the same \
                 bytes on every machine; on which this was tried, its README says. The hash of \
                 every file is given here.",
                report.article.title, report.made_by
            ),
            "datePublished": RELEASE_DATE,
            "license": { "@id": LICENCES[0].0 },
            "author": { "@id": "#authors" },
            "publisher": { "@id": "#authors" },
            "citation": { "@id": ARTICLE },
            "keywords": "non-smooth dynamics, two-fold singularity, Filippov systems, \
                reproducibility, chaos",
            "mainEntity": { "@id": names::PAGE },
            "mentions": report.figures.iter().map(|f| json!({ "@id": action(&f.id) }))
                .collect::<Vec<_>>(),
            "hasPart": files.iter().map(|file| json!({ "@id": address(&file.path) }))
                .collect::<Vec<_>>(),
        }),
        json!({
            "@id": "#authors",
            "@type": "Organization",
            "name": "The twofold authors",
            // Address of the authors: an organisation in RO-Crate should have one.
            "url": DOCUMENTATION,
        }),
        json!({
            "@id": "#software",
            "@type": ["SoftwareApplication", "SoftwareSourceCode"],
            "name": "twofold",
            "version": env!("CARGO_PKG_VERSION"),
            "softwareVersion": env!("CARGO_PKG_VERSION"),
            "description": SOFTWARE,
            "programmingLanguage": "Rust",
            "author": { "@id": "#authors" },
            "license": LICENCES.map(|(id, _, _)| json!({ "@id": id })),
        }),
        json!({
            "@id": ARTICLE,
            "@type": "ScholarlyArticle",
            "name": report.article.title,
            "author": { "@id": "#article-author" },
            "datePublished": report.article.year.to_string(),
            "isPartOf": { "@id": "#proceedings" },
            "url": ARTICLE,
        }),
        json!({ "@id": "#proceedings", "@type": "PublicationVolume", "name": PROCEEDINGS }),
        json!({
            "@id": "#article-author",
            "@type": "Person",
            "name": report.article.author,
            "affiliation": { "@id": AFFILIATION.0 },
        }),
        json!({ "@id": AFFILIATION.0, "@type": "Organization", "name": AFFILIATION.1,
            "url": AFFILIATION.0 }),
    ];
    graph.extend(LICENCES.map(|(id, name, description)| {
        json!({ "@id": id, "@type": "CreativeWork", "name": name, "description": description,
                "identifier": id })
    }));
    for figure in &report.figures {
        let within = format!("{}/", figure.id);
        let made: Vec<Value> = files
            .iter()
            .filter(|file| file.path.starts_with(&within))
            .map(|file| json!({ "@id": address(&file.path) }))
            .collect();
        graph.push(json!({
            "@id": action(&figure.id),
            "@type": "CreateAction",
            "name": format!("Computation of {}", figure.id),
            "instrument": { "@id": "#software" },
            "result": made,
        }));
    }
    graph.par_extend(files.par_iter().map(|found| file(report, found)));
    indented(&json!({ "@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph }))
}

fn action(figure: &str) -> String {
    format!("#compute-{}", address(figure))
}

fn file(report: &Report, found: &MadeFile) -> Value {
    let path = found.path.as_str();
    let mut entity = json!({
        "@id": address(path),
        "@type": "File",
        "name": name(report, path),
        "encodingFormat": media_type(path),
        "contentSize": found.size.to_string(),
        "sha256": found.sha256.as_str(),
    });
    // A picture's own provenance names the question and the numbers behind it.
    if let Ok(provenance) = read_provenance(&found.bytes) {
        let text: Vec<String> =
            provenance.entries.iter().map(|(key, value)| format!("{key}: {value}")).collect();
        entity["description"] = json!(text.join("; "));
    }
    entity
}

fn name(report: &Report, path: &str) -> String {
    let known = match path {
        names::PAGE => "The report, for people",
        names::REPORT => "The report, for programs",
        names::VERDICTS => "All verdicts with their evidence",
        names::MAKING => "Programs, machines and times of the computations",
        _ => "",
    };
    if !known.is_empty() {
        return known.to_owned();
    }
    let picture = report
        .figures
        .iter()
        .flat_map(|f| &f.pictures)
        .find_map(|p| p.files.iter().find(|f| f.path == path).map(|f| (p, f)));
    match picture {
        None => path.to_owned(),
        Some((p, f)) => match &f.panel {
            Some(panel) => format!("{}: numbers of panel ({panel})", p.name),
            None if f.role == super::Role::Record => {
                format!("{}: hashes, runs, statistics and verdicts", p.name)
            }
            None => format!("{}: {}", p.name, p.title),
        },
    }
}
