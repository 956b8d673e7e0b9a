//! Sections about the page: findings in sentences, the rules, how it was made, how to cite.

use std::fmt::Write as _;

use super::super::archive::{PROCEEDINGS, RELEASE_DATE};
use super::super::model::*;
use super::super::{names, prose, rules};
use super::parts::*;
use twofold_paper::html::escape;

/// Section with the findings, in sentences.
pub(super) fn findings(html: &mut String, report: &Report) {
    put!(
        html,
        "<section aria-labelledby=\"findings\">\n<h2 id=\"findings\">Findings</h2>\n<div \
            class=\"prose\">"
    );
    put!(html, "<h3>In this folder</h3>");
    let here = prose::of_this_folder(report);
    if here.is_empty() {
        put!(html, "<p>No claim of the paper was judged in these pictures.</p>");
    }
    for paragraph in here {
        put!(html, "<p>{paragraph}</p>");
    }
    put!(
        html,
        "<p>A panel is one run, and a shift of its start by 1e-9 can change where it ends: a \
            verdict says what happened once, the \
         census how often it does.</p>\n<h3>In the published figures of this version</h3>"
    );
    for block in &report.findings {
        put!(html, "{block}");
    }
    put!(html, "</div>\n</section>");
}

/// Section with the odds of each outcome and the parameters that fit.
pub(super) fn odds(html: &mut String, report: &Report) {
    if report.odds.is_empty() {
        return;
    }
    put!(
        html,
        "<section aria-labelledby=\"odds\">\n<h2 id=\"odds\">Odds</h2>\n<div class=\"prose\">"
    );
    put!(html, "<p>Of the published figures of this version.</p>");
    for block in &report.odds {
        put!(html, "{block}");
    }
    put!(html, "</div>\n</section>");
}

/// The rules by which verdicts are reached, and every threshold.
pub(super) fn rules(html: &mut String, report: &Report) {
    put!(
        html,
        "<section aria-labelledby=\"rules\">\n<h2 id=\"rules\">Rules and thresholds</h2>\n<div \
            class=\"prose\">\n<p>One rule for each kind of \
         claim, the same for every panel and reading; no panel is judged by hand.</p>\n</div>\n<dl \
         class=\"rules\">"
    );
    for (claim, rule) in rules::CLAIMS {
        put!(html, "<dt>{}</dt><dd>{}</dd>", escape(claim), escape(rule));
    }
    put!(html, "</dl>");
    let (thresholds, alike) = rules::thresholds(report);
    if !alike {
        put!(
            html,
            "<p class=\"notice\">Not all verdicts in this folder were reached with the same \
                thresholds; these are the first one’s. Each verdict’s own are in \
             {}.</p>",
            names::VERDICTS
        );
    }
    table_start(
        html,
        "Thresholds of the verdicts on sections; lengths are shares of the section’s extent",
        "thresholds",
        None,
    );
    put!(
        html,
        "<thead><tr><th scope=\"col\">Name</th><th scope=\"col\" class=\"number\">Value</th><th \
            scope=\"col\">Meaning</th></tr></thead>\n<tbody>"
    );
    for (name, value, meaning) in thresholds {
        put!(
            html,
            "<tr><th scope=\"row\"><code>{}</code></th><td \
                class=\"number\">{}</td><td>{}</td></tr>",
            escape(&name),
            escape(&value),
            escape(meaning)
        );
    }
    put!(html, "</tbody>\n</table>\n</section>\n</section>");
}

/// Programs, machines and times.
pub(super) fn making(html: &mut String, report: &Report) {
    put!(html, "<section aria-labelledby=\"making\">\n<h2 id=\"making\">How it was made</h2>");
    put!(
        html,
        "<p class=\"prose\">Figures and report by {}. The same version is made to give the same \
            bytes on any machine; times are of \
         the machine that computed.</p>",
        escape(&report.made_by)
    );
    if report.making.is_empty() {
        put!(
            html,
            "<p>The folder does not say by which build and in what time its figures were made ({} \
                is not there).</p>",
            names::MAKING
        );
    }
    for (i, run) in report.making.iter().enumerate() {
        let named: Vec<String> = run.figures.iter().map(|f| figure_name(f)).collect();
        put!(html, "<h3>{}</h3>\n<dl class=\"small\">", escape(&named.join(", ")));
        let computed: f64 = run.computed.iter().map(|c| c.seconds).sum();
        let lines = [
            ("Program", run.program.clone()),
            ("Commit", run.commit.clone()),
            ("Compiler", run.compiler.clone()),
            ("Built for", format!("{}, profile {}", run.target, run.profile)),
            ("Threads", run.threads.to_string()),
            (
                "Time",
                format!("{} s from the first question to the last file", decimal(run.seconds, 1)),
            ),
            (
                "Computed",
                match (run.computed.len(), run.store) {
                    (0, true) => {
                        "nothing: every answer had been kept from an earlier call".to_owned()
                    }
                    (n, true) => format!(
                        "{n} answers in {} s of work; the others had been kept from earlier calls",
                        decimal(computed, 1)
                    ),
                    (n, false) => {
                        format!(
                            "{n} answers in {} s of work, none taken from an earlier call",
                            decimal(computed, 1)
                        )
                    }
                },
            ),
        ];
        for (term, text) in lines {
            put!(html, "<dt>{term}</dt><dd>{}</dd>", escape(&text));
        }
        put!(html, "</dl>");
        if run.computed.is_empty() {
            continue;
        }
        put!(
            html,
            "<details>\n<summary>Times of {}</summary>",
            count(run.computed.len(), "computation", "computations")
        );
        table_start(
            html,
            "Computations and their times, the longest first",
            &format!("times-{i}"),
            None,
        );
        put!(
            html,
            "<thead><tr><th scope=\"col\">Computation</th><th scope=\"col\" \
                class=\"number\">Seconds</th></tr></thead>\n<tbody>"
        );
        for timed in &run.computed {
            put!(
                html,
                "<tr><th scope=\"row\">{}</th><td class=\"number\">{}</td></tr>",
                escape(&timed.what),
                decimal(timed.seconds, 2)
            );
        }
        put!(html, "</tbody>\n</table>\n</section>\n</details>");
    }
    put!(html, "</section>");
}

/// Section on citing the software, the article, and these figures.
pub(super) fn citing(html: &mut String, report: &Report) {
    let (a, version) = (&report.article, env!("CARGO_PKG_VERSION"));
    let year = RELEASE_DATE.split('-').next().unwrap_or_default();
    put!(
        html,
        "<section aria-labelledby=\"citing\">\n<h2 id=\"citing\">How to cite</h2>\n<div \
            class=\"prose\">\n<p>Cite the article for the claims, and this \
         software for the figures and verdicts; name the version, and the SHA-256 of a picture’s \
         pixels if it matters which one was meant.</p>\n<ul>"
    );
    put!(
        html,
        "<li>{} ({}). <cite>{}</cite>. {}.</li>",
        escape(a.author),
        a.year,
        escape(a.title),
        escape(PROCEEDINGS)
    );
    put!(
        html,
        "<li>The twofold authors ({year}). <cite>twofold: reference software for the breakdown of \
            determinism at a two-fold singularity</cite>, \
         version {version}.</li>\n</ul>\n</div>"
    );
    let bibtex = format!(
        "@inproceedings{{jeffrey{0},\n  author    = {{{1}}},\n  title     = {{{2}}},\n  booktitle \
            = {{{PROCEEDINGS}}},\n  year      = {{{0}}}\n}}\n\n\
         @software{{twofold,\n  author  = {{{{The twofold authors}}}},\n  title   = {{twofold: \
         reference software for the breakdown of determinism at a two-fold \
         singularity}},\n  version = {{{version}}},\n  year    = {{{year}}}\n}}",
        a.year, a.author, a.title
    );
    put!(
        html,
        "<section class=\"scroll\" tabindex=\"0\" \
            aria-label=\"BibTeX\"><pre><code>{}</code></pre></section>\n</section>",
        escape(&bibtex)
    );
}
