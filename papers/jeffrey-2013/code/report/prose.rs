//! Findings in sentences: those of the folder as it is, from its verdicts, and those of the
//! published figures, from the pages of findings and theorems that this program was built with,
//! whose numbers are tested.

use std::fmt::Write as _;

use super::model::{Occurring, Report, VerdictReport, of_the_paper};
use crate::Reading;
use twofold_paper::html::escape;

/// Verdicts of this folder, a paragraph for each reading, as HTML.
pub fn of_this_folder(report: &Report) -> Vec<String> {
    let pictures = || {
        let figures = report.figures.iter().filter(|f| of_the_paper(&f.id));
        figures.flat_map(|f| &f.pictures).filter(|p| p.alterations.is_empty())
    };
    let mut paragraphs = Vec::new();
    for reading in &report.summary.readings {
        let of = match reading.reading {
            Some(r) => format!("In the {} reading", r.word()),
            None => "In figures that have one reading".to_owned(),
        };
        let verdicts: Vec<(String, &VerdictReport)> = pictures()
            .filter(|p| p.reading == reading.reading)
            .flat_map(|p| p.verdicts.iter().map(|v| (panel_name(&p.name, p.reading, &v.panel), v)))
            .collect();
        let list = |agrees: bool| {
            let said = |(panel, v): &(String, &VerdictReport)| {
                if agrees {
                    format!("{panel} ({})", v.claim)
                } else {
                    format!("{panel} (said: {}; found: {})", v.claim, v.found)
                }
            };
            verdicts
                .iter()
                .filter(|(_, v)| v.agrees == agrees)
                .map(said)
                .collect::<Vec<_>>()
                .join("; ")
        };
        let mut text = format!(
            "{of}, {} of {} claims of the paper that were judged here hold",
            reading.agree, reading.claims
        );
        let (hold, fail) = (list(true), list(false));
        if !hold.is_empty() {
            let _ = write!(text, ": {hold}");
        }
        text.push('.');
        if !fail.is_empty() {
            let _ = write!(text, " These do not: {fail}.");
        }
        if let Some(alike) = &reading.all_alike {
            let _ = write!(
                text,
                " All {} noise-free sections end alike ({}), so that agreement with a claim of \
                    that kind says nothing for this reading.",
                alike.panels, alike.kind
            );
        }
        paragraphs.push(escape(&text));
    }
    paragraphs
}

/// "fig. 7(ii)".
fn panel_name(picture: &str, reading: Option<Reading>, panel: &str) -> String {
    let base =
        reading.map_or(picture.to_owned(), |r| picture.replace(&format!("-{}", r.word()), ""));
    match base.strip_prefix("fig") {
        Some(number) => format!("fig. {number}({panel})"),
        None => format!("{base} ({panel})"),
    }
}

/// Statements of docs/findings.md and docs/theorems.md: paragraphs that begin with a finding in
/// bold, and the theorems, as HTML blocks.
pub fn of_the_project(findings: &str) -> Vec<String> {
    let mut blocks = Vec::new();
    let mut heading = "";
    for block in findings.split("\n\n").map(str::trim) {
        if let Some(text) = block.strip_prefix("## ") {
            heading = text;
        } else if block.starts_with("**") {
            blocks.push(format!("<p>{}</p>", inline(block)));
        } else if heading == "Theorems" && block.starts_with("- ") {
            let items = format!("\n{block}");
            let items: Vec<String> =
                items.split("\n- ").skip(1).map(|i| format!("<li>{}</li>", inline(i))).collect();
            blocks.push(format!(
                "<p>Proved, for smoothing at ε = 10⁻³:</p>\n<ul>\n{}\n</ul>",
                items.join("\n")
            ));
        }
    }
    blocks
}

/// Sections of docs/census.md and docs/parameters.md with paragraphs and tables, as HTML blocks.
pub fn of_the_odds(page: &str) -> Vec<String> {
    let mut heading = String::new();
    let (mut tables, mut in_section) = (0, 0);
    let mut blocks = Vec::new();
    for block in page.split("\n\n").map(str::trim) {
        if let Some(text) = block.strip_prefix("## ").or_else(|| block.strip_prefix("# ")) {
            heading = inline(text);
            in_section = 0;
            blocks.push(format!("<h3>{heading}</h3>"));
        } else if block.starts_with("| ") {
            (tables, in_section) = (tables + 1, in_section + 1);
            // Each has a name of its own for screen readers.
            let caption = match in_section {
                1 => heading.clone(),
                more => format!("{heading}, table {more}"),
            };
            blocks.push(table(block, &caption, tables));
        } else if !heading.is_empty()
            && !block.is_empty()
            && !block.starts_with("<!--")
            && !block.starts_with("![")
        {
            blocks.push(format!("<p>{}</p>", inline(block)));
        }
    }
    blocks
}

/// The count of panels of docs/census.md whose outcome occurs, if the page has them.
pub fn occurring(page: &str) -> Option<Occurring> {
    let mut found: Option<Occurring> = None;
    for line in page.lines() {
        let cells: Vec<&str> = line.trim_matches(['|', ' ']).split(" | ").collect();
        let [panel, _, printed, reconstructed] = cells[..] else { continue };
        if !(panel.starts_with("7(") || panel.starts_with("8(")) {
            continue;
        }
        // "52 % [46, 58], 156 of 300".
        let counts = |cell: &str| -> Option<[u64; 2]> {
            let (hits, rest) = cell.split_once(" of ")?;
            let runs = rest.split(|c: char| !c.is_ascii_digit()).next()?;
            Some([hits.rsplit(' ').next()?.parse().ok()?, runs.parse().ok()?])
        };
        let [a, b] = [counts(printed)?, counts(reconstructed)?];
        let all = found.get_or_insert(Occurring { panels: [0; 2], of: 0, runs: a[1] });
        if [a[1], b[1]] != [all.runs; 2] {
            return None;
        }
        all.of += 1;
        for (panels, [hits, _]) in all.panels.iter_mut().zip([a, b]) {
            *panels += usize::from(hits > 0);
        }
    }
    found
}

/// A table of Markdown.
fn table(markdown: &str, caption: &str, number: usize) -> String {
    let row = |line: &str, [open, close]: [&str; 2]| {
        let line = line.trim();
        let line = line.strip_prefix('|').unwrap_or(line);
        let cells = line.strip_suffix('|').unwrap_or(line).split('|');
        format!(
            "<tr>{}</tr>",
            cells.map(|cell| format!("{open}{}{close}", inline(cell.trim()))).collect::<String>()
        )
    };
    let mut lines = markdown.lines();
    let head = row(lines.next().unwrap_or_default(), ["<th scope=\"col\">", "</th>"]);
    let body: Vec<String> = lines.skip(1).map(|line| row(line, ["<td>", "</td>"])).collect();
    format!(
        "<section class=\"scroll\" tabindex=\"0\" \
            aria-labelledby=\"odds-{number}-caption\">\n<table id=\"odds-{number}\">\n\
         <caption id=\"odds-{number}-caption\">{caption}</caption>\n<thead>{head}</thead>\n\
         <tbody>\n{}\n</tbody>\n</table>\n</section>",
        body.join("\n")
    )
}

/// Markdown's emphasis, code and links inside a paragraph. A link's target is a place in the
/// repository: only its text is kept.
fn inline(markdown: &str) -> String {
    let mut out = String::new();
    let mut rest = markdown;
    let (mut strong, mut emphasis) = (false, false);
    while let Some(at) = rest.find(['*', '`', '[']) {
        out.push_str(&escape(&rest[..at]));
        rest = &rest[at..];
        if let Some(after) = rest.strip_prefix("**") {
            out.push_str(if strong { "</strong>" } else { "<strong>" });
            (strong, rest) = (!strong, after);
        } else if let Some(after) = rest.strip_prefix('*') {
            out.push_str(if emphasis { "</em>" } else { "<em>" });
            (emphasis, rest) = (!emphasis, after);
        } else if let Some((code, after)) = rest.strip_prefix('`').and_then(|r| r.split_once('`')) {
            let _ = write!(out, "<code>{}</code>", escape(code));
            rest = after;
        } else if let Some((text, after)) = link(rest) {
            out.push_str(&inline(text));
            rest = after;
        } else {
            out.push_str(&escape(&rest[..1]));
            rest = &rest[1..];
        }
    }
    out.push_str(&escape(rest));
    if emphasis {
        out.push_str("</em>");
    }
    if strong {
        out.push_str("</strong>");
    }
    out
}

/// "[text](target)" at the start: the text, and what follows.
fn link(from: &str) -> Option<(&str, &str)> {
    let (text, after) = from.strip_prefix('[')?.split_once("](")?;
    (!text.contains(']')).then_some(())?;
    Some((text, after.split_once(')')?.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markdown_becomes_html() {
        assert_eq!(
            inline("**A & b.** See [`x`](y/z.md), *p*."),
            "<strong>A &amp; b.</strong> See <code>x</code>, <em>p</em>."
        );
        assert_eq!(inline("of runs [7, 22] < 1"), "of runs [7, 22] &lt; 1");
        assert_eq!(inline("`a*b` and *c"), "<code>a*b</code> and <em>c</em>");
    }

    #[test]
    fn the_page_has_findings() {
        let blocks = of_the_project(concat!(
            include_str!("../../../../docs/findings.md"),
            "\n\n",
            include_str!("../../../../docs/theorems.md")
        ));
        assert!(blocks.len() >= 6, "{blocks:#?}");
        assert!(blocks.iter().any(|b| b.contains(
            "<strong>Each visit to the singularity costs \
            digits.</strong>"
        )));
        assert!(blocks.last().unwrap().contains("<li>"));
        assert!(blocks.iter().all(|b| !b.contains("](") && !b.contains("**")), "{blocks:#?}");
    }

    #[test]
    fn the_page_has_the_tables_of_odds_and_of_the_misprint() {
        let page = concat!(
            include_str!("../../../../docs/census.md"),
            "\n\n",
            include_str!("../../../../docs/parameters.md")
        );
        let blocks = of_the_odds(page);
        let tables: Vec<&String> = blocks.iter().filter(|b| b.contains("<table")).collect();
        assert!(tables.len() >= 2, "{blocks:#?}");
        // Every row of a table of the page is one here.
        let rows = page.lines().filter(|l| l.starts_with('|') && !l.starts_with("|---")).count();
        assert_eq!(tables.iter().map(|t| t.matches("<tr>").count()).sum::<usize>(), rows);
        assert!(tables[0].contains("<td>7(ii)</td><td>period three</td>"), "{}", tables[0]);
        let caption = |table: &&String| {
            let (_, text) = table.split_once("<caption ").unwrap();
            text.split_once("</caption>").unwrap().0.split_once('>').unwrap().1.to_owned()
        };
        let captions: std::collections::BTreeSet<String> = tables.iter().map(caption).collect();
        assert_eq!(captions.len(), tables.len(), "{captions:?}");
        // 7(i), 8(ii) and 8(iii) as printed.
        assert_eq!(occurring(page), Some(Occurring { panels: [3, 6], of: 6, runs: 300 }));
        assert_eq!(occurring("no table"), None);
        assert!(
            blocks.iter().all(|b| !b.contains("](") && !b.contains("**") && !b.contains("|---")),
            "{blocks:#?}"
        );
    }
}
