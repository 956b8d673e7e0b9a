//! The top and the bottom of the page: what holds, claim by claim.

use std::fmt::Write as _;

use super::super::model::*;
use super::parts::*;
use crate::Reading;
use twofold_paper::html::{escape, identifier, rich};
use twofold_paper::wording;

pub(super) fn summary(html: &mut String, report: &Report) {
    let s = &report.summary;
    put!(
        html,
        "<section aria-labelledby=\"summary\">\n<h2 id=\"summary\">Summary</h2>\n<div \
            class=\"prose\">"
    );
    put!(
        html,
        "<p>The paper’s parameters are taken in two readings, side by side: as printed ({}), and \
            with one digit of <i>α</i> changed \
         ({}), because the numbers as printed need not be the ones the pictures were made with. \
         Each claim of the paper about a panel is held \
         against what the run shows by one rule, the same for both readings; a claim “differs” \
         when the run shows something else, not \
         when the run is wrong.</p>\n</div>",
        rich(&wording::parameters(&Reading::Printed.into())),
        rich(&wording::parameters(&Reading::Reconstructed.into())),
    );
    if !report.problems.is_empty() {
        put!(html, "<div class=\"notice\"><p>Not everything could be read or found:</p>\n<ul>");
        for problem in &report.problems {
            put!(html, "<li>{}</li>", escape(problem));
        }
        put!(html, "</ul></div>");
    }
    put!(html, "<div class=\"cards\">");
    for reading in &s.readings {
        let title = match reading.reading {
            Some(r) => format!(
                "{}<br/>{}",
                capitalised(&format!("{} reading", r.word())),
                rich(&wording::parameters(&r.into()))
            ),
            None => "Figures with one reading".to_owned(),
        };
        put!(
            html,
            "<div class=\"card\">\n<h3>{}</h3>\n<p class=\"figure-of\">{} of {} <small>claims \
                agree</small></p>",
            title,
            reading.agree,
            reading.claims
        );
        if let (Some(r), Some(o)) = (reading.reading, report.occurring) {
            put!(
                html,
                "<p>Outcomes of figs 7 and 8 that occur in any of {} runs: {} of {}</p>",
                o.runs,
                o.panels[usize::from(r == Reading::Reconstructed)],
                o.of
            );
        }
        put!(html, "<p>What its judged panels show:</p>\n<ul>");
        for found in &reading.found {
            put!(
                html,
                "<li>{}: {}</li>",
                escape(&found.kind),
                count(found.panels, "panel", "panels")
            );
        }
        put!(html, "</ul>");
        if let Some(alike) = &reading.all_alike {
            put!(
                html,
                "<p>All {} noise-free sections end alike ({}): where the paper says the same of \
                    one of them, that is no evidence for this \
                 reading.</p>",
                alike.panels,
                escape(&alike.kind)
            );
        }
        put!(html, "</div>");
    }
    let whole = s.pictures > 0 && s.same == s.pictures && s.damaged_files == 0;
    put!(
        html,
        "<div class=\"card\">\n<h3>Reproduced bytes {}</h3>\n<p class=\"figure-of\">{} of {} \
            <small>pictures match the reference</small></p>\n<ul>",
        if whole { tag("good", "✓ all") } else { tag("bad", "! not all") },
        s.same,
        s.pictures
    );
    put!(html, "<li>{} from it</li>", count(s.different, "differs", "differ"));
    put!(html, "<li>{} without a committed reference</li>", s.without_reference);
    put!(
        html,
        "<li>{} changed or lost since they were made</li>",
        count(s.damaged_files, "file", "files")
    );
    if s.altered > 0 {
        put!(
            html,
            "<li>{} by a flag, counted nowhere else</li>",
            count(s.altered, "picture altered", "pictures altered")
        );
    }
    put!(html, "</ul>\n</div>");
    put!(
        html,
        "<div class=\"card\">\n<h3>Steps between restarts</h3>\n<p class=\"figure-of\">{} of {} \
            <small>panels by LSODA stay within \
         NDSolve’s limit</small></p>\n<p>Mathematica’s NDSolve, whose method that was, stopped \
         after MaxSteps = {} steps by default; each interval between \
         restarts is one call.</p>\n</div>\n</div>",
        s.panels_by_ndsolves_method - s.panels_beyond_ndsolve_limit,
        s.panels_by_ndsolves_method,
        grouped(NDSOLVE_MAX_STEPS)
    );
    claims(html, report);
    put!(html, "</section>");
}

/// A line of the table of claims: one claim, what each reading shows.
struct ClaimLine<'a> {
    figure: &'a FigureReport,
    /// The picture's name without its reading.
    base: String,
    panel: &'a str,
    claim: &'a str,
    /// (reading, picture, verdict)
    found: Vec<(Option<Reading>, &'a PictureReport, &'a VerdictReport)>,
}

/// The paper's claims, line by line, with both readings beside them.
pub(super) fn claims(html: &mut String, report: &Report) {
    let mut lines: Vec<ClaimLine> = Vec::new();
    for figure in &report.figures {
        for picture in figure.pictures.iter().filter(|p| p.alterations.is_empty()) {
            let base = match picture.reading {
                Some(r) => picture.name.replace(&format!("-{}", r.word()), ""),
                None => picture.name.clone(),
            };
            for verdict in &picture.verdicts {
                let found = (picture.reading, picture, verdict);
                let line = lines.iter_mut().find(|l| {
                    l.base == base
                        && l.panel == verdict.panel
                        && l.claim == verdict.claim
                        && l.figure.id == figure.id
                });
                match line {
                    Some(line) => line.found.push(found),
                    None => lines.push(ClaimLine {
                        figure,
                        base: base.clone(),
                        panel: &verdict.panel,
                        claim: &verdict.claim,
                        found: vec![found],
                    }),
                }
            }
        }
    }
    let (papers, others): (Vec<_>, Vec<_>) =
        lines.into_iter().partition(|line| of_the_paper(&line.figure.id));
    if papers.is_empty() {
        put!(html, "<p>No claim of the paper was judged in these pictures.</p>");
    } else {
        put!(html, "<h3 id=\"claims\">The paper’s claims, panel by panel</h3>");
        let caption = "What the paper says and what each reading shows";
        lines_of(html, report, &papers, caption, "claims-table");
    }
    if !others.is_empty() {
        put!(html, "<h3 id=\"beside\">The same panels in studies of the project</h3>");
        let caption = "Held against the same claims, and counted nowhere";
        lines_of(html, report, &others, caption, "beside-table");
    }
}

/// A table of claims.
fn lines_of(html: &mut String, report: &Report, lines: &[ClaimLine<'_>], caption: &str, id: &str) {
    let readings: Vec<Option<Reading>> =
        report.summary.readings.iter().map(|r| r.reading).collect();
    table_start(html, caption, id, None);
    put!(html, "<thead><tr><th scope=\"col\">Panel, and what the paper says</th>");
    for reading in &readings {
        put!(html, "<th scope=\"col\">{}</th>", escape(&capitalised(reading_name(*reading))));
    }
    put!(html, "</tr></thead>\n<tbody>");
    for line in lines {
        put!(
            html,
            "<tr><th scope=\"row\"><a href=\"#{}\">{} ({})</a>: {}</th>",
            figure_id(line.figure),
            escape(&line.base),
            escape(line.panel),
            escape(line.claim)
        );
        for reading in &readings {
            let cells: Vec<String> = line
                .found
                .iter()
                .filter(|(r, _, _)| r == reading)
                .map(|(_, _, v)| format!("{} {}", agreement(v.agrees), escape(short(v))))
                .collect();
            let text = if cells.is_empty() { "–".to_owned() } else { cells.join("<br/>") };
            put!(html, "<td class=\"verdict\">{text}</td>");
        }
        put!(html, "</tr>");
    }
    put!(html, "</tbody>\n</table>\n</section>");
}

pub(super) fn all_verdicts(html: &mut String, report: &Report) {
    put!(html, "<section aria-labelledby=\"verdicts\">\n<h2 id=\"verdicts\">All verdicts</h2>");
    put!(html, "<p id=\"sorted\" class=\"hidden\" role=\"status\"></p>");
    table_start(
        html,
        "Every claim judged, in every picture; with script, a column’s heading sorts by it",
        "all-verdicts",
        Some("sorted"),
    );
    put!(html, "<thead><tr>");
    for head in [
        "Picture",
        "Panel",
        "Reading",
        "Method",
        "The paper",
        "Found",
        "Verdict",
        "What the run shows",
    ] {
        put!(html, "<th scope=\"col\">{head}</th>");
    }
    put!(html, "</tr></thead>\n<tbody>");
    for figure in &report.figures {
        for picture in &figure.pictures {
            for (i, v) in picture.verdicts.iter().enumerate() {
                let altered = if picture.alterations.is_empty() { "" } else { " (altered)" };
                put!(
                    html,
                    "<tr><th scope=\"row\"><a href=\"#{}\">{}</a>{altered}</th><td \
                        data-sort=\"{:04}\">({})</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
                     <td data-sort=\"{}\">{}</td><td class=\"wide\">{}</td></tr>",
                    identifier(&picture.name),
                    escape(&picture.name),
                    i,
                    escape(&v.panel),
                    escape(reading_name(picture.reading)),
                    escape(&v.method),
                    escape(&v.claim),
                    escape(&v.kind),
                    if v.agrees { "agrees" } else { "differs" },
                    agreement(v.agrees),
                    reason(v)
                );
            }
        }
    }
    put!(html, "</tbody>\n</table>\n</section>\n</section>");
}
