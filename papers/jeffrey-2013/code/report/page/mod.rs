//! The report as one page: HTML that is also well-formed XML, with style, script and pictures
//! inside. It asks the network for nothing, and says so to the browser (Content-Security-Policy).
//!
//! From top to bottom: the summary and the claims; findings; odds; the figures; all verdicts;
//! rules; how it was made and how to cite.

/// Appends formatted text; writing to a String cannot fail.
macro_rules! put {
    ($to:expr, $($text:tt)*) => {{ let _ = writeln!($to, $($text)*); }};
}

mod about;
mod figure;
mod parts;
mod summary;

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use self::parts::{figure_id, figure_name};
use super::model::*;
use super::names;
use twofold_paper::html::{address, base64, escape};

const STYLE: &str = include_str!("../page.css");
const SCRIPT: &str = include_str!("../page.js");

/// Whether the page stands in the folder of the figures, so that it can link to the files beside
/// it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Links {
    /// It does: files are linked to.
    Beside,
    /// It stands elsewhere: files are only named.
    None,
}

impl Links {
    /// A link to a file of the folder, or its name.
    fn to(self, path: &str, text: &str) -> String {
        match self {
            Links::Beside => format!("<a href=\"{}\">{}</a>", address(path), escape(text)),
            Links::None => format!("{} (<code>{}</code>)", escape(text), escape(path)),
        }
    }
}

/// The page.
pub fn page(report: &Report, links: Links) -> Vec<u8> {
    let mut html = String::new();
    head(&mut html, report);
    summary::summary(&mut html, report);
    about::findings(&mut html, report);
    about::odds(&mut html, report);
    for figure in &report.figures {
        figure::figure(&mut html, figure, links);
    }
    summary::all_verdicts(&mut html, report);
    about::rules(&mut html, report);
    about::making(&mut html, report);
    about::citing(&mut html, report);
    foot(&mut html, report, links);
    html.into_bytes()
}

/// Source expression of a Content-Security-Policy for an inline style or script.
fn source_hash(text: &str) -> String {
    format!("'sha256-{}'", base64(&Sha256::digest(text.as_bytes())))
}

fn head(html: &mut String, report: &Report) {
    let a = &report.article;
    put!(
        html,
        "<!DOCTYPE html>\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n<meta \
            charset=\"utf-8\"/>"
    );
    put!(
        html,
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; \
            style-src {}; script-src {}; \
         base-uri 'none'; form-action 'none'\"/>",
        source_hash(STYLE),
        source_hash(SCRIPT)
    );
    put!(html, "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\"/>");
    put!(html, "<meta name=\"color-scheme\" content=\"light dark\"/>");
    put!(html, "<meta name=\"generator\" content=\"{}\"/>", escape(&report.made_by));
    put!(html, "<link rel=\"icon\" href=\"data:,\"/>");
    put!(html, "<title>Figures of {} ({}), recomputed</title>", escape(a.author), a.year);
    put!(html, "<style>{STYLE}</style>\n</head>\n<body>");
    put!(html, "<a class=\"skip\" href=\"#summary\">Skip to the summary</a>\n<header>");
    put!(html, "<h1>Figures of {} ({}), recomputed</h1>", escape(a.author), a.year);
    put!(
        html,
        "<p class=\"lead\">What {} finds when it computes the figures of <cite>{}</cite>: the \
            pictures, the paper’s claims held \
         against them, the work behind them, and the hashes by which any reader can check \
         them.</p>",
        escape(&report.made_by),
        escape(a.title)
    );
    put!(html, "<nav aria-label=\"Contents\">\n<ul>\n<li><a href=\"#findings\">Findings</a></li>");
    if !report.odds.is_empty() {
        put!(html, "<li><a href=\"#odds\">Odds</a></li>");
    }
    for figure in &report.figures {
        put!(
            html,
            "<li><a href=\"#{}\">{}</a></li>",
            figure_id(figure),
            escape(&figure_name(&figure.id))
        );
    }
    for (id, name) in [
        ("verdicts", "All verdicts"),
        ("rules", "Rules and thresholds"),
        ("making", "How it was made"),
        ("citing", "How to cite"),
    ] {
        put!(html, "<li><a href=\"#{id}\">{name}</a></li>");
    }
    put!(html, "</ul>\n</nav>\n</header>\n<main>");
}

fn foot(html: &mut String, report: &Report, links: Links) {
    put!(
        html,
        "</main>\n<footer>\n<p>Made by {}. For programs: {}, {}; for archives: {}.</p>",
        escape(&report.made_by),
        links.to(names::REPORT, "this report as JSON"),
        links.to(names::VERDICTS, "all verdicts with their evidence"),
        links.to(names::ARCHIVE, "RO-Crate metadata")
    );
    put!(
        html,
        "<p>To check: <code>make check</code> recomputes everything and compares; <code>twofold \
            check --against FOLDER</code> checks published \
         pictures; <code>twofold inspect FILE</code> reads what a picture says of itself.</p>"
    );
    put!(
        html,
        "<p>This page holds no path, and no time but those of <code>{}</code>: the same folder \
            gives the same bytes.</p>\n</footer>",
        names::MAKING
    );
    put!(html, "<script>{SCRIPT}</script>\n</body>\n</html>");
}
