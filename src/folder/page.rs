//! The page about a paper, and the metadata for archives and CODECHECK.

use std::fmt::Write as _;

use serde_json::{Value, json};

use super::Folder;
use super::made::{Made, Scored, outcome};
use crate::paper::html::escape;
use crate::paper::pipeline::PictureRecord;
use crate::paper::verdict::PanelVerdict;
use crate::record::Hash;

const STYLE: &str = "body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem \
    auto;padding:0 1rem;color:#1a1a1a;background:#fff}\
h1{font-size:1.6rem;line-height:1.25}h2{font-size:1.2rem;margin-top:2.5rem}img{max-width:100%;height:auto}table{border-collapse:collapse;width:100%}\
th,td{text-align:left;vertical-align:top;padding:.4rem .6rem;border-bottom:1px solid \
#ccc}code{overflow-wrap:anywhere}\
.agrees{color:#00583c;font-weight:600}.differs{color:#9c2f00;font-weight:600}figure{margin:1.5rem \
0}small{color:#444}";

/// The page.
pub fn page(folder: &Folder, made: &Made<'_>) -> String {
    let about = &folder.about;
    let (holds, all) = made.score();
    let mut out = String::new();
    // Writing to a String cannot fail.
    let mut put = |text: String| {
        let _ = writeln!(out, "{text}");
    };
    put(format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta \
            name=\"viewport\" \
            content=\"width=device-width\">\n<title>{}</title>\n<style>{STYLE}</style>\n</head>\n\
            <body>\n<main>",
        escape(&about.title)
    ));
    put(format!("<h1>{}</h1>", escape(&about.title)));
    put(format!("<p>{}</p>", escape(&citation(folder))));
    put(format!("<p>{}</p>", escape(&about.summary)));
    put(format!("<p>{holds} of {all} claims agree with what was computed.</p>"));
    if !made.claims.is_empty() || made.panels().next().is_some() {
        put("<h2>Claims</h2>\n<table>\n<thead><tr><th scope=\"col\">where</th><th \
            scope=\"col\">what it says</th><th scope=\"col\">outcome</th><th \
            scope=\"col\">rule</th></tr></thead>\n<tbody>"
            .to_owned());
        for scored in &made.claims {
            put(row(scored));
        }
        for verdict in made.panels() {
            put(panel_row(verdict));
        }
        put("</tbody>\n</table>".to_owned());
    }
    put("<h2>Figures</h2>".to_owned());
    let mut pictures = made.pictures.iter();
    for (figure, shows) in folder.figures.iter().zip(&folder.shows) {
        for picture in pictures.by_ref().take(figure.pictures.len()) {
            put(drawn(&figure.id, shows, picture));
        }
    }
    if !about.open.is_empty() {
        put("<h2>What the paper leaves open</h2>\n<ul>".to_owned());
        for item in &about.open {
            put(format!("<li>{}</li>", escape(item)));
        }
        put("</ul>".to_owned());
    }
    put(format!(
        "<p><small>Computed by twofold {}. The same version makes the same bytes on every machine; \
            <code>twofold paper check</code> compares.</small></p>\n</main>\n</body>\n</html>",
        env!("CARGO_PKG_VERSION")
    ));
    out
}

fn row(scored: &Scored<'_>) -> String {
    let claim = scored.claim;
    let quote = if claim.quote.is_empty() {
        String::new()
    } else {
        format!("<br><q>{}</q>", escape(&claim.quote))
    };
    let note = if claim.note.is_empty() {
        String::new()
    } else {
        format!("<br><small>{}</small>", escape(&claim.note))
    };
    let (found, after) = match &scored.verdict {
        Ok(v) => {
            let word = outcome(v.agrees);
            (
                format!("<span class=\"{word}\">{word}</span>: {}", escape(&v.found)),
                match (v.rule_after_data, v.words_after_data) {
                    (true, _) => "<br><strong>written or changed when its data were known</strong>",
                    (_, true) => "<br><strong>its words changed when its data were known</strong>",
                    _ => "",
                },
            )
        }
        Err(why) => (
            format!(
                "<span class=\"differs\">cannot be scored</span>: {}",
                escape(&why.to_string())
            ),
            "",
        ),
    };
    format!(
        "<tr id=\"{}\"><td>{}</td><td>{}{quote}</td><td>{found}{note}</td><td>{}, fixed \
            {}{after}</td></tr>",
        escape(&claim.id),
        escape(&claim.place),
        escape(&claim.says),
        claim.kind(),
        escape(&claim.decided)
    )
}

fn panel_row(verdict: &PanelVerdict) -> String {
    let PanelVerdict { picture, panel, claim_text, found, because, agrees, .. } = verdict;
    let word = outcome(*agrees);
    format!(
        "<tr><td><a href=\"#{picture}\">{picture}</a> ({})</td><td>{}</td><td><span \
            class=\"{word}\">{word}</span>: {}<br><small>{}</small></td><td>the panel's \
            own</td></tr>",
        escape(panel),
        escape(claim_text),
        escape(found),
        escape(because)
    )
}

fn drawn(figure: &str, shows: &str, picture: &PictureRecord) -> String {
    let name = &picture.hashes.name;
    let shows = if shows.is_empty() { String::new() } else { format!(" ({})", escape(shows)) };
    format!(
        "<figure id=\"{name}\">\n<img src=\"{figure}/{name}.png\" alt=\"{}\" \
            loading=\"lazy\">\n<figcaption><strong>{}{shows}</strong> {} \
         <small><a href=\"{figure}/{name}.svg\">SVG</a>, <a href=\"{figure}/{name}.pdf\">PDF</a>, \
         <a href=\"{figure}/{name}.json\">hashes</a>, data {}</small></figcaption>\n</figure>",
        escape(&picture.caption),
        escape(&picture.title),
        escape(&picture.caption),
        picture.hashes.data.short()
    )
}

/// Authors, year, title, place.
fn citation(folder: &Folder) -> String {
    let about = &folder.about;
    let mut text = format!("{} ({}). {}.", about.authors.join(", "), about.year, about.title);
    if !about.journal.is_empty() {
        text += &format!(" {}.", about.journal);
    }
    if !about.doi.is_empty() {
        text += &format!(" doi:{}", about.doi);
    }
    if !about.arxiv.is_empty() {
        text += &format!(" arXiv:{}", about.arxiv);
    }
    text
}

/// The files that were made, with their digests and the pictures' titles.
fn files(folder: &Folder, made: &Made<'_>) -> Vec<(String, Hash, String)> {
    let mut all = Vec::new();
    let mut pictures = made.pictures.iter();
    for figure in &folder.figures {
        for picture in pictures.by_ref().take(figure.pictures.len()) {
            let named = |(file, hash): (String, &Hash)| {
                (format!("{}/{file}", figure.id), hash.clone(), picture.title.clone())
            };
            all.extend(picture.files().into_iter().map(named));
        }
    }
    all
}

/// The fields of a CODECHECK certificate (codecheck.yml, version 1.0) that a computation can fill;
/// names and the date are the checker's.
pub fn codecheck(folder: &Folder, made: &Made<'_>) -> String {
    // JSON's strings are YAML's double-quoted ones.
    let text = |s: &str| Value::from(s).to_string();
    let about = &folder.about;
    let (holds, all) = made.score();
    let mut out = "version: https://codecheck.org.uk/spec/config/1.0/\n".to_owned();
    let _ = writeln!(out, "paper:\n  title: {}\n  authors:", text(&about.title));
    for author in &about.authors {
        let _ = writeln!(out, "    - name: {}", text(author));
    }
    let reference = match (about.doi.as_str(), about.arxiv.as_str()) {
        ("", "") => String::new(),
        ("", arxiv) => format!("https://arxiv.org/abs/{arxiv}"),
        (doi, _) => format!("https://doi.org/{doi}"),
    };
    let _ = writeln!(out, "  reference: {}\nmanifest:", text(&reference));
    for (file, hash, title) in
        files(folder, made).into_iter().filter(|(file, ..)| !file.ends_with(".csv"))
    {
        let comment = format!("{title}; sha256 {}", hash.as_str());
        let _ = writeln!(out, "  - file: {}\n    comment: {}", text(&file), text(&comment));
    }
    let summary = format!(
        "Recomputed by twofold {}: {} pictures; {holds} of {all} claims agree.",
        env!("CARGO_PKG_VERSION"),
        made.pictures.len()
    );
    let _ = writeln!(out, "summary: {}\ncodechecker: []\nreport: report.html", text(&summary));
    out
}

/// Files about the whole paper: name, what each is, format.
const OWN: [(&str, &str, &str); 3] = [
    ("report.html", "report", "text/html"),
    ("claims.json", "outcomes of the claims", "application/json"),
    ("codecheck.yml", "fields of a CODECHECK certificate", "text/yaml"),
];

/// Parts of the metadata that RO-Crate 1.1 asks for and that are missing, with the keys of
/// `paper.toml` that give them.
pub fn crate_lacks(folder: &Folder) -> Option<String> {
    let about = &folder.about;
    let lacks = [
        about.published.is_none().then_some("datePublished (published)"),
        about.license.is_empty().then_some("license (license)"),
    ];
    let lacks: Vec<&str> = lacks.into_iter().flatten().collect();
    (!lacks.is_empty()).then(|| {
        format!(
            "RO-Crate 1.1 asks for {}: give it in paper.toml before an archive takes the folder",
            lacks.join(" and ")
        )
    })
}

/// RO-Crate 1.1 metadata.
pub fn crate_metadata(folder: &Folder, made: &Made<'_>) -> Vec<u8> {
    let about = &folder.about;
    let mut files = files(folder, made);
    let mut pictures = made.pictures.iter();
    for figure in &folder.figures {
        files.extend(pictures.by_ref().take(figure.pictures.len()).map(|picture| {
            let file = format!("{}/{}.json", figure.id, picture.hashes.name);
            (file, Hash::of(&picture.to_json()), format!("hashes of {}", picture.title))
        }));
    }
    let authors: Vec<(String, &String)> = about
        .authors
        .iter()
        .enumerate()
        .map(|(i, name)| (format!("#author-{}", i + 1), name))
        .collect();
    let identifiers: Vec<&String> =
        [&about.doi, &about.arxiv].into_iter().filter(|i| !i.is_empty()).collect();
    let mut graph = vec![
        json!({
            "@id": "ro-crate-metadata.json", "@type": "CreativeWork", "about": { "@id": "./" },
            "conformsTo": { "@id": "https://w3id.org/ro/crate/1.1" },
        }),
        json!({
            "@id": "./", "@type": "Dataset", "name": format!("Figures and claims of \"{}\", \
                recomputed", about.title),
            "description": about.summary, "citation": { "@id": "#article" },
                "mainEntity": { "@id": "report.html" },
            "hasPart": files.iter().map(|(file, ..)| file.as_str())
                .chain(OWN.map(|(file, ..)| file))
                .map(|file| json!({ "@id": file })).collect::<Vec<_>>(),
        }),
        json!({
            "@id": "#article", "@type": "ScholarlyArticle", "name": about.title,
                "datePublished": about.year.to_string(),
            "author": authors.iter().map(|(id, _)| json!({ "@id": id })).collect::<Vec<_>>(),
            "identifier": identifiers,
        }),
        json!({ "@id": "#software", "@type": "SoftwareApplication", "name": "twofold",
            "softwareVersion": env!("CARGO_PKG_VERSION") }),
        json!({ "@id": "#computation", "@type": "CreateAction",
            "instrument": { "@id": "#software" }, "result": { "@id": "./" } }),
    ];
    graph.extend(OWN.map(|(file, name, format)| {
        json!({ "@id": file, "@type": "File", "name": name, "encodingFormat": format })
    }));
    graph.extend(
        authors.iter().map(|(id, name)| json!({ "@id": id, "@type": "Person", "name": name })),
    );
    // RO-Crate asks for both; they are the publisher's to give.
    if let Some(day) = &about.published {
        graph[1]["datePublished"] = day.get_ref().to_string().into();
    }
    let licences: Vec<&str> = about.license.split(" OR ").filter(|name| !name.is_empty()).collect();
    let id = |name: &str| format!("https://spdx.org/licenses/{name}");
    if !licences.is_empty() {
        graph[1]["license"] = licences.iter().map(|name| json!({ "@id": id(name) })).collect();
    }
    graph.extend(
        licences
            .iter()
            .map(|name| json!({ "@id": id(name), "@type": "CreativeWork", "name": name })),
    );
    graph.extend(files.iter().map(|(file, hash, title)| {
        json!({ "@id": file, "@type": "File", "name": title,
                "sha256": hash.as_str() })
    }));
    let crate_ = json!({ "@context": "https://w3id.org/ro/crate/1.1/context", "@graph": graph });
    let mut bytes = serde_json::to_vec_pretty(&crate_).expect("plain data");
    bytes.push(b'\n');
    bytes
}
