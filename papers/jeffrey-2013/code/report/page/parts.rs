//! Small pieces of HTML that several sections use.

use std::fmt::Write as _;

use super::super::model::*;
use crate::Reading;
use twofold_paper::html::{escape, identifier};

/// Names of the project's studies.
const STUDIES: [(&str, &str); 5] = [
    ("audit", "Parameter map"),
    ("basin", "Basins"),
    ("digits", "Digits lost"),
    ("lottery", "Fig. 7 by three methods"),
    ("workprecision", "Error against work"),
];

/// "Figure 7" for fig7, a study's name, the folder's name with a capital for others.
pub(super) fn figure_name(id: &str) -> String {
    match id.strip_prefix("fig") {
        Some(number) if !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()) => {
            format!("Figure {number}")
        }
        _ => match STUDIES.iter().find(|(study, _)| *study == id) {
            Some((_, name)) => (*name).to_owned(),
            None => capitalised(id),
        },
    }
}

pub(super) fn figure_id(figure: &FigureReport) -> String {
    format!("figure-{}", identifier(&figure.id))
}

pub(super) fn reading_name(reading: Option<Reading>) -> &'static str {
    reading.map_or("one reading", |r| r.word())
}

pub(super) fn tag(class: &str, text: &str) -> String {
    format!("<span class=\"tag {class}\">{}</span>", escape(text))
}

pub(super) fn agreement(agrees: bool) -> String {
    if agrees { tag("good", "✓ agrees") } else { tag("bad", "✗ differs") }
}

pub(super) fn reference_tag(reference: &Reference) -> String {
    match reference {
        Reference::Same => tag("good", "✓ matches the reference"),
        Reference::Different { layer, .. } => {
            tag("bad", &format!("✗ differs in its {}", layer.name()))
        }
        Reference::Missing { .. } => tag("bad", "! no reference"),
        Reference::Altered => tag("", "altered, no reference"),
    }
}

pub(super) fn count(number: usize, singular: &str, plural: &str) -> String {
    format!("{number} {}", if number == 1 { singular } else { plural })
}

pub(super) fn capitalised(text: &str) -> String {
    let mut characters = text.chars();
    characters
        .next()
        .map_or(String::new(), |first| first.to_uppercase().chain(characters).collect())
}

/// The finding in a few words: its kind, or the whole line where there is no kind.
pub(super) fn short(verdict: &VerdictReport) -> &str {
    if verdict.recorded.pointer("/evidence/section").is_some() {
        &verdict.kind
    } else {
        &verdict.found
    }
}

/// A table in a box of its own that scrolls sideways, also with the keyboard.
pub(super) fn table_start(html: &mut String, caption: &str, id: &str, announce: Option<&str>) {
    let claims = ["claims-table", "beside-table"].contains(&id);
    let class = if claims { "scroll claims" } else { "scroll" };
    put!(
        html,
        "<section class=\"{class}\" tabindex=\"0\" aria-labelledby=\"{id}-caption\">\n<table \
            id=\"{id}\"{}>\n\
         <caption id=\"{id}-caption\">{}</caption>",
        announce.map_or(String::new(), |a| format!(" data-sortable=\"{a}\"")),
        escape(caption)
    );
}

/// Digits in groups of three.
pub(super) fn grouped(value: u64) -> String {
    let digits = value.to_string();
    let mut out = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(digit);
    }
    out
}

/// A number with so many decimals.
pub(super) fn decimal(value: f64, places: usize) -> String {
    format!("{value:.places$}").replace('-', "−")
}

/// The finding, and why it agrees or not; only one of them if it contains the other.
pub(super) fn reason(v: &VerdictReport) -> String {
    if v.because.contains(&v.found) {
        escape(&v.because)
    } else if v.found.contains(&v.because) {
        escape(&v.found)
    } else {
        format!("{}; {}", escape(&v.found), escape(&v.because))
    }
}
