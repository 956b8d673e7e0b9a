//! The report as one page: HTML that is also well-formed XML, with style, script and pictures inside. It asks the network for nothing,
//! and says so to the browser (Content-Security-Policy).

use std::fmt::Write as _;

use sha2::{Digest, Sha256};

use super::archive::{PROCEEDINGS, RELEASE_DATE};
use super::html::{address, base64, data_address, escape, identifier, rich};
use super::model::*;
use super::{names, prose, rules};
use crate::compare::Comparison;
use crate::paper::Reading;
use crate::paper::wording;
use crate::record::Layer;

const STYLE: &str = include_str!("page.css");
const SCRIPT: &str = include_str!("page.js");

/// Whether the page stands in the folder of the figures, so that it can link to the files beside it.
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
    summary(&mut html, report);
    findings(&mut html, report);
    for figure in &report.figures {
        self::figure(&mut html, figure, links);
    }
    all_verdicts(&mut html, report);
    rules(&mut html, report);
    making(&mut html, report);
    citing(&mut html, report);
    foot(&mut html, report, links);
    html.into_bytes()
}

/// Appends formatted text; writing to a String cannot fail.
macro_rules! put {
    ($to:expr, $($text:tt)*) => {{ let _ = writeln!($to, $($text)*); }};
}

/// What a Content-Security-Policy calls an inline style or script.
fn source_hash(text: &str) -> String {
    format!("'sha256-{}'", base64(&Sha256::digest(text.as_bytes())))
}

fn head(html: &mut String, report: &Report) {
    let a = &report.article;
    put!(
        html,
        "<!DOCTYPE html>\n<html lang=\"en\" xmlns=\"http://www.w3.org/1999/xhtml\">\n<head>\n<meta charset=\"utf-8\"/>"
    );
    put!(
        html,
        "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; img-src data:; style-src {}; script-src {}; \
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
        "<p class=\"lead\">What {} finds when it computes the figures of <cite>{}</cite>: the pictures, the paper’s claims held \
         against them, the work behind them, and the hashes by which anybody can check them.</p>",
        escape(&report.made_by),
        escape(a.title)
    );
    put!(html, "<nav aria-label=\"Contents\">\n<ul>\n<li><a href=\"#findings\">Findings</a></li>");
    for figure in &report.figures {
        put!(html, "<li><a href=\"#{}\">{}</a></li>", figure_id(figure), escape(&figure_name(&figure.id)));
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

/// "Figure 7" for fig7, the folder's name with a capital for others.
fn figure_name(id: &str) -> String {
    match id.strip_prefix("fig") {
        Some(number) if !number.is_empty() && number.bytes().all(|b| b.is_ascii_digit()) => format!("Figure {number}"),
        _ => {
            let mut characters = id.chars();
            characters.next().map_or(String::new(), |first| first.to_uppercase().chain(characters).collect())
        }
    }
}

fn figure_id(figure: &FigureReport) -> String {
    format!("figure-{}", identifier(&figure.id))
}

fn reading_name(reading: Option<Reading>) -> &'static str {
    reading.map_or("one reading", |r| r.word())
}

fn tag(class: &str, text: &str) -> String {
    format!("<span class=\"tag {class}\">{}</span>", escape(text))
}

fn agreement(agrees: bool) -> String {
    if agrees { tag("good", "✓ agrees") } else { tag("bad", "✗ differs") }
}

fn reference_tag(reference: &Reference) -> String {
    match reference {
        Reference::Same => tag("good", "✓ matches the reference"),
        Reference::Different { layer, .. } => tag("bad", &format!("✗ differs in its {}", layer.name())),
        Reference::Missing { .. } => tag("bad", "! no reference"),
        Reference::Altered => tag("", "altered, no reference"),
    }
}

fn count(number: usize, singular: &str, plural: &str) -> String {
    format!("{number} {}", if number == 1 { singular } else { plural })
}

fn summary(html: &mut String, report: &Report) {
    let s = &report.summary;
    put!(html, "<section aria-labelledby=\"summary\">\n<h2 id=\"summary\">Summary</h2>\n<div class=\"prose\">");
    put!(
        html,
        "<p>The paper’s parameters are taken in two readings, side by side: as printed ({}), and with one digit of <i>α</i> changed \
         ({}), because the numbers as printed need not be the ones the pictures were made with. Each claim of the paper about a panel is held \
         against what the run shows by one rule, the same for both readings; a claim “differs” when the run shows something else, not \
         when the run is wrong.</p>\n</div>",
        rich(&parameters(Reading::Printed)),
        rich(&parameters(Reading::Reconstructed)),
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
            Some(r) => format!("{}<br/>{}", capitalised(&format!("{} reading", r.word())), rich(&parameters(r))),
            None => "Figures with one reading".to_owned(),
        };
        put!(
            html,
            "<div class=\"card\">\n<h3>{}</h3>\n<p class=\"figure-of\">{} of {} <small>claims agree</small></p>",
            title,
            reading.agree,
            reading.claims
        );
        put!(html, "<p>What its judged panels show:</p>\n<ul>");
        for found in &reading.found {
            put!(html, "<li>{}: {}</li>", escape(&found.kind), count(found.panels, "panel", "panels"));
        }
        put!(html, "</ul>");
        if let Some(alike) = &reading.all_alike {
            put!(
                html,
                "<p>All {} noise-free sections end alike ({}): where the paper says the same of one of them, that is no evidence for this \
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
        "<div class=\"card\">\n<h3>Reproduced bytes {}</h3>\n<p class=\"figure-of\">{} of {} <small>pictures match the reference</small></p>\n<ul>",
        if whole { tag("good", "✓ all") } else { tag("bad", "! not all") },
        s.same,
        s.pictures
    );
    put!(html, "<li>{} from it</li>", count(s.different, "differs", "differ"));
    put!(html, "<li>{} without a committed reference</li>", s.without_reference);
    put!(html, "<li>{} changed or lost since they were made</li>", count(s.damaged_files, "file", "files"));
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
        "<div class=\"card\">\n<h3>Steps between restarts</h3>\n<p class=\"figure-of\">{} of {} <small>panels by LSODA stay within \
         NDSolve’s limit</small></p>\n<p>Mathematica’s NDSolve, whose method that was, stopped after MaxSteps = {} steps by default; each interval between \
         restarts is one call.</p>\n</div>\n</div>",
        s.panels_by_ndsolves_method - s.panels_beyond_ndsolve_limit,
        s.panels_by_ndsolves_method,
        grouped(NDSOLVE_MAX_STEPS)
    );
    claims(html, report);
    put!(html, "</section>");
}

/// "*α* = 10^{-3}, *β* = 10^{-5}": the reading without its name.
fn parameters(reading: Reading) -> String {
    let text = wording::reading(reading);
    text.split_once(": ").map_or(text.clone(), |(_, p)| p.to_owned())
}

fn capitalised(text: &str) -> String {
    let mut characters = text.chars();
    characters.next().map_or(String::new(), |first| first.to_uppercase().chain(characters).collect())
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
fn claims(html: &mut String, report: &Report) {
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
                    l.base == base && l.panel == verdict.panel && l.claim == verdict.claim && l.figure.id == figure.id
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
    if lines.is_empty() {
        put!(html, "<p>No claim of the paper was judged in these pictures.</p>");
        return;
    }
    let readings: Vec<Option<Reading>> = report.summary.readings.iter().map(|r| r.reading).collect();
    put!(html, "<h3 id=\"claims\">The paper’s claims, panel by panel</h3>");
    table_start(html, "What the paper says and what each reading shows", "claims-table", None);
    put!(html, "<thead><tr><th scope=\"col\">Panel, and what the paper says</th>");
    for reading in &readings {
        put!(html, "<th scope=\"col\">{}</th>", escape(&capitalised(reading_name(*reading))));
    }
    put!(html, "</tr></thead>\n<tbody>");
    for line in &lines {
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

/// The finding in a few words: its kind, or the whole line where there is no kind.
fn short(verdict: &VerdictReport) -> &str {
    if verdict.recorded.pointer("/evidence/section").is_some() { &verdict.kind } else { &verdict.found }
}

/// A table in a box of its own that scrolls sideways, also with the keyboard.
fn table_start(html: &mut String, caption: &str, id: &str, announce: Option<&str>) {
    let class = if id == "claims-table" { "scroll claims" } else { "scroll" };
    put!(
        html,
        "<section class=\"{class}\" tabindex=\"0\" aria-labelledby=\"{id}-caption\">\n<table id=\"{id}\"{}>\n\
         <caption id=\"{id}-caption\">{}</caption>",
        announce.map_or(String::new(), |a| format!(" data-sortable=\"{a}\"")),
        escape(caption)
    );
}

fn figure(html: &mut String, figure: &FigureReport, links: Links) {
    let id = figure_id(figure);
    let title = if figure.title.is_empty() { String::new() } else { format!(": {}", rich(&figure.title)) };
    put!(html, "<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{}{title}</h2>", escape(&figure_name(&figure.id)));
    for picture in &figure.pictures {
        self::picture(html, picture, links);
    }
    for (file, preview) in figure.unrecorded.iter().zip(&figure.unrecorded_png) {
        let id = identifier(&file.path);
        put!(
            html,
            "<article aria-labelledby=\"{id}\">\n<h3 id=\"{id}\"><code>{}</code> {}</h3>",
            escape(&file.path),
            tag("", "no record")
        );
        let img = image(preview, &format!("The picture {}; no record describes it", file.path));
        put!(
            html,
            "<figure>{img}<figcaption>No record stands beside this picture. {}</figcaption></figure>\n</article>",
            links.to(&file.path, "PNG")
        );
    }
    put!(html, "</section>");
}

fn image(preview: &Preview, alt: &str) -> String {
    let [w, h] = preview.size;
    format!(
        "<img src=\"{}\" alt=\"{}\" width=\"{w}\" height=\"{h}\"/>",
        data_address("image/png", &preview.png),
        escape(alt)
    )
}

fn picture(html: &mut String, picture: &PictureReport, links: Links) {
    let id = identifier(&picture.name);
    put!(html, "<article aria-labelledby=\"{id}\">");
    let reading = picture.reading.map_or(String::new(), |r| tag("", &format!("{} reading", r.word())));
    put!(
        html,
        "<h3 id=\"{id}\"><span>{}</span> {reading} {}</h3>",
        escape(&picture.name),
        reference_tag(&picture.reference)
    );
    if !picture.alterations.is_empty() {
        put!(html, "<p class=\"notice\">Not the published picture: {}.</p>", escape(&picture.alterations.join("; ")));
    }
    put!(html, "<figure>");
    match &picture.images.actual {
        Some(preview) => put!(html, "{}", image(preview, &picture.description)),
        None => put!(html, "<p class=\"notice\">The PNG file is not there, or is none.</p>"),
    }
    put!(html, "<figcaption>{}</figcaption>\n</figure>", rich(&picture.caption));
    spaces(html, picture, &id);
    put!(html, "<ul class=\"links\">");
    for file in picture.files.iter().filter(|f| f.integrity != Integrity::Missing) {
        let text = match (file.role, &file.panel) {
            (Role::Data, Some(panel)) if file.path.ends_with("-events.csv") => format!("CSV ({panel}), events"),
            (Role::Data, Some(panel)) => format!("CSV ({panel})"),
            (Role::Data, None) => file.path.rsplit('/').next().unwrap_or(&file.path).to_owned(),
            (Role::Png, _) => match picture.size {
                Some([w, h]) => format!("PNG, {w} × {h}"),
                None => "PNG".to_owned(),
            },
            (Role::Svg, _) => "SVG".to_owned(),
            (Role::Pdf, _) => "PDF".to_owned(),
            _ => "Record (JSON)".to_owned(),
        };
        put!(html, "<li>{}</li>", links.to(&file.path, &text));
    }
    put!(html, "</ul>");
    if let Reference::Different { .. } | Reference::Missing { .. } = &picture.reference {
        mismatch(html, picture);
    }
    verdicts(html, picture, &id);
    if !picture.panels.is_empty() {
        runs(html, picture, &id);
    }
    hashes(html, picture, &id);
    put!(html, "</article>");
}

/// What differs: the layer, the numbers, and ours | difference | theirs.
fn mismatch(html: &mut String, picture: &PictureReport) {
    let (layer, panels, comparison, note) = match &picture.reference {
        Reference::Different { layer, panels, comparison, note, .. } => (layer, panels, comparison, note),
        Reference::Missing { why } => {
            put!(html, "<p class=\"notice\">There is no reference to compare with: {}.</p>", escape(why));
            return;
        }
        _ => return,
    };
    let of = if panels.is_empty() { String::new() } else { format!(" of panel {}", panels.join(", ")) };
    put!(
        html,
        "<div class=\"notice\" data-mismatch=\"{}\">\n<p>Differs from the committed reference. The first layer that differs: <strong>{}{}</strong> \
         ({}).</p>",
        identifier(&picture.name),
        escape(layer.name()),
        escape(&of),
        meaning(*layer)
    );
    if let Some(c) = comparison {
        put!(html, "<p>{}</p>", escape(&numbers(c)));
    }
    if let Some(note) = note {
        put!(html, "<p>Note: {}.</p>", escape(note));
    }
    put!(html, "</div>");
    let i = &picture.images;
    let name = &picture.name;
    // Ours, what lies between, theirs.
    let shown = [
        ("Ours", i.actual.as_ref(), format!("Ours: {name} as it was computed")),
        (
            "Difference",
            i.difference.as_ref(),
            format!("Difference of {name}: orange where only the reference has ink, blue where only ours has"),
        ),
        ("Reference", i.expected.as_ref(), format!("Reference: the committed {name}")),
    ];
    if i.expected.is_some() {
        put!(html, "<div class=\"triptych\" data-triptych=\"{}\">", identifier(name));
        for (word, preview, alt) in shown {
            if let Some(preview) = preview {
                put!(html, "<figure>{}<figcaption>{word}</figcaption></figure>", image(preview, &alt));
            }
        }
        put!(html, "</div>");
        if i.difference.is_some() {
            put!(
                html,
                "<p>In the difference: orange, ink only in the reference; blue, only in ours; grey, shared. It is smaller than the pictures: \
                 where several of their pixels are one of its own, that shows the most different one.</p>"
            );
        }
    }
}

/// What the page's script needs to turn a panel in space; without script nothing of it is seen.
fn spaces(html: &mut String, picture: &PictureReport, id: &str) {
    for view in &picture.spaces {
        // Inside a script element no character reference is read, in HTML: what would end it or be markup in XML is written as JSON escapes.
        let data = view.data.to_string().replace('<', "\\u003c").replace('>', "\\u003e").replace('&', "\\u0026");
        let several = picture.spaces.len() > 1;
        let panel = if several { format!(" ({}) {}", view.label, wording::plain(&view.title)) } else { String::new() };
        put!(
            html,
            "<script type=\"application/json\" class=\"space\" id=\"{id}-{}-space\" data-title=\"{}{}\" data-panel=\"{}\">{data}</script>",
            identifier(&view.label),
            escape(&picture.name),
            escape(panel.trim_end()),
            if several { escape(&format!("({})", view.label)) } else { String::new() },
        );
    }
}

/// Which room a layer points to.
fn meaning(layer: Layer) -> &'static str {
    match layer {
        Layer::Spec => "another question was asked",
        Layer::Data => "the same question, other numbers",
        Layer::Verdict => "the same numbers, judged otherwise",
        Layer::Pixels => "the same numbers, drawn otherwise",
        Layer::Png | Layer::Svg | Layer::Pdf => "the same picture, another file",
    }
}

fn numbers(c: &Comparison) -> String {
    if c.changed_pixels == 0 {
        return format!("All {} by {} pixels are the same; RMS 0, SSIM 1.", c.width, c.height);
    }
    format!(
        "{} of {} by {} pixels changed ({}); largest difference {} of 255 levels; RMS {} levels, {} in the worst block; SSIM {}, {} in the worst \
         window.",
        grouped(c.changed_pixels),
        c.width,
        c.height,
        percent(c.changed_share),
        c.largest_difference,
        decimal(c.rms, 3),
        decimal(c.worst_block_rms, 1),
        decimal(c.ssim, 5),
        decimal(c.worst_ssim, 3)
    )
}

/// A share as percent with three significant digits.
fn percent(share: f64) -> String {
    let value = 100.0 * share;
    let places = if value >= 10.0 {
        1
    } else if value >= 1.0 {
        2
    } else if value >= 0.01 {
        4
    } else {
        6
    };
    format!("{} %", decimal(value, places))
}

fn decimal(value: f64, places: usize) -> String {
    format!("{value:.places$}").replace('-', "−")
}

/// Digits in groups of three.
fn grouped(value: u64) -> String {
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

fn verdicts(html: &mut String, picture: &PictureReport, id: &str) {
    if picture.verdicts.is_empty() {
        return;
    }
    put!(html, "<h4>The paper’s claims</h4>");
    table_start(html, &format!("Claims and verdicts, {}", picture.name), &format!("{id}-verdicts"), None);
    put!(
        html,
        "<thead><tr><th scope=\"col\">Panel</th><th scope=\"col\">The paper</th><th scope=\"col\">Verdict</th><th \
         scope=\"col\">What the run shows</th></tr></thead>\n<tbody>"
    );
    for v in &picture.verdicts {
        put!(
            html,
            "<tr><th scope=\"row\">({})</th><td>{}</td><td>{}</td><td class=\"wide\">{}</td></tr>",
            escape(&v.panel),
            escape(&v.claim),
            agreement(v.agrees),
            reason(v)
        );
    }
    put!(html, "</tbody>\n</table>\n</section>");
}

/// What was found, and why that agrees or not; one of them where it says the other too.
fn reason(v: &VerdictReport) -> String {
    if v.because.contains(&v.found) {
        escape(&v.because)
    } else if v.found.contains(&v.because) {
        escape(&v.found)
    } else {
        format!("{}; {}", escape(&v.found), escape(&v.because))
    }
}

fn runs(html: &mut String, picture: &PictureReport, id: &str) {
    put!(html, "<details>\n<summary>Parameters and solver statistics</summary>");
    for p in &picture.panels {
        let title = if p.title.is_empty() { String::new() } else { format!(" {}", rich(&p.title)) };
        put!(html, "<h4>({}){title}</h4>\n<dl class=\"small\">", escape(&p.label));
        let names = p.run.system.coordinates();
        let start: Vec<String> = p.run.start.iter().map(|x| wording::number(*x)).collect();
        let schedule = wording::schedule(&p.run);
        let lines = [
            ("System", rich(&wording::system(&p.run.system))),
            ("Switch", rich(&wording::switch(&p.run.switch))),
            ("Start", format!("({}) = ({})", names.join(", "), rich(&start.join(", ")))),
            ("Time", format!("0 to {}", rich(&wording::number(p.run.t_end)))),
            ("Method", rich(&wording::method(&p.run.method))),
            ("Restarts and kicks", if schedule.is_empty() { "none".to_owned() } else { rich(&schedule) }),
        ];
        for (term, text) in lines {
            put!(html, "<dt>{term}</dt><dd>{text}</dd>");
        }
        put!(html, "</dl>");
    }
    table_start(
        html,
        &format!(
            "Work done, {}. NDSolve’s MaxSteps was {} for one call of LSODA, that is between restarts.",
            picture.name,
            grouped(NDSOLVE_MAX_STEPS)
        ),
        &format!("{id}-statistics"),
        None,
    );
    put!(html, "<thead><tr><th scope=\"col\">Panel</th>");
    for head in [
        "Points",
        "Steps",
        "Rejected",
        "Evaluations",
        "Jacobians",
        "LU",
        "Failed iterations",
        "Switches",
        "Stiff steps",
        "Starts",
        "Highest order",
        "Most steps between restarts",
    ] {
        put!(html, "<th scope=\"col\" class=\"number\">{head}</th>");
    }
    put!(html, "<th scope=\"col\">NDSolve’s limit</th></tr></thead>\n<tbody>");
    for p in &picture.panels {
        let s = &p.statistics;
        put!(html, "<tr><th scope=\"row\">({})</th>", escape(&p.label));
        for number in [
            p.points as u64,
            s.steps,
            s.rejected,
            s.evaluations,
            s.jacobians,
            s.factorisations,
            s.convergence_failures,
            s.method_switches,
            s.stiff_steps,
            s.restarts,
            s.highest_order,
            p.most_steps_in_segment,
        ] {
            put!(html, "<td class=\"number\">{}</td>", grouped(number));
        }
        let limit = match p.within_ndsolve_limit {
            Some(true) => tag("good", "✓ within"),
            Some(false) => tag("bad", "✗ beyond"),
            None => "another method".into(),
        };
        put!(html, "<td>{limit}</td></tr>");
    }
    put!(html, "</tbody>\n</table>\n</section>\n</details>");
}

fn hashes(html: &mut String, picture: &PictureReport, id: &str) {
    let expected = match &picture.reference {
        Reference::Different { expected, .. } => Some(&**expected),
        Reference::Same => Some(&picture.hashes),
        _ => None,
    };
    put!(html, "<details>\n<summary>Hashes</summary>");
    table_start(html, &format!("SHA-256 of each layer, {}", picture.name), &format!("{id}-hashes"), None);
    put!(
        html,
        "<thead><tr><th scope=\"col\">Layer</th><th scope=\"col\">SHA-256</th><th scope=\"col\">Reference</th></tr></thead>\n<tbody>"
    );
    let h = &picture.hashes;
    let layers = [
        (Layer::Spec, &h.spec, expected.map(|e| &e.spec)),
        (Layer::Data, &h.data, expected.map(|e| &e.data)),
        (Layer::Pixels, &h.pixels, expected.map(|e| &e.pixels)),
        (Layer::Png, &h.png, expected.map(|e| &e.png)),
        (Layer::Svg, &h.svg, expected.map(|e| &e.svg)),
        (Layer::Pdf, &h.pdf, expected.map(|e| &e.pdf)),
    ];
    for (layer, hash, expected) in layers {
        let status = match expected {
            None => tag("", "nothing to compare with"),
            Some(e) if e == hash => tag("good", "✓ same"),
            Some(e) => format!("{} <code>{}</code>", tag("bad", "✗ expected"), e.as_str()),
        };
        put!(
            html,
            "<tr><th scope=\"row\">{}</th><td><code>{}</code></td><td>{status}</td></tr>",
            escape(layer.name()),
            hash.as_str()
        );
    }
    put!(html, "</tbody>\n</table>\n</section>");
    table_start(html, &format!("Files, {}", picture.name), &format!("{id}-files"), None);
    put!(
        html,
        "<thead><tr><th scope=\"col\">File</th><th scope=\"col\" class=\"number\">Bytes</th><th scope=\"col\">SHA-256</th><th \
         scope=\"col\">Against its record</th></tr></thead>\n<tbody>"
    );
    for f in &picture.files {
        let class = match f.integrity {
            Integrity::Unchanged => "good",
            Integrity::Changed | Integrity::Missing => "bad",
            Integrity::Unrecorded => "",
        };
        put!(
            html,
            "<tr><th scope=\"row\"><code>{}</code></th><td class=\"number\">{}</td><td><code>{}</code></td><td>{}</td></tr>",
            escape(&f.path),
            grouped(f.bytes),
            f.sha256.as_ref().map_or("–", |h| h.as_str()),
            tag(class, if f.role == Role::Record { "the record itself" } else { f.integrity.words() })
        );
    }
    put!(html, "</tbody>\n</table>\n</section>\n</details>");
}

fn all_verdicts(html: &mut String, report: &Report) {
    put!(html, "<section aria-labelledby=\"verdicts\">\n<h2 id=\"verdicts\">All verdicts</h2>");
    put!(html, "<p id=\"sorted\" class=\"hidden\" role=\"status\"></p>");
    table_start(
        html,
        "Every claim judged, in every picture; with script, a column’s heading sorts by it",
        "all-verdicts",
        Some("sorted"),
    );
    put!(html, "<thead><tr>");
    for head in ["Picture", "Panel", "Reading", "Method", "The paper", "Found", "Verdict", "What the run shows"] {
        put!(html, "<th scope=\"col\">{head}</th>");
    }
    put!(html, "</tr></thead>\n<tbody>");
    for figure in &report.figures {
        for picture in &figure.pictures {
            for (i, v) in picture.verdicts.iter().enumerate() {
                let altered = if picture.alterations.is_empty() { "" } else { " (altered)" };
                put!(
                    html,
                    "<tr><th scope=\"row\"><a href=\"#{}\">{}</a>{altered}</th><td data-sort=\"{:04}\">({})</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>\
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

/// What was found, in sentences.
fn findings(html: &mut String, report: &Report) {
    put!(html, "<section aria-labelledby=\"findings\">\n<h2 id=\"findings\">Findings</h2>\n<div class=\"prose\">");
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
        "<p>A panel is one run, and which orbit a run ends on can hang on the ninth digit of its start: a verdict says what happened once, the \
         census how often it does.</p>\n<h3>In the published figures of this version</h3>"
    );
    for block in prose::of_the_project() {
        put!(html, "{block}");
    }
    put!(html, "</div>\n</section>");
}

/// The rules by which verdicts are reached, and every threshold.
fn rules(html: &mut String, report: &Report) {
    put!(
        html,
        "<section aria-labelledby=\"rules\">\n<h2 id=\"rules\">Rules and thresholds</h2>\n<div class=\"prose\">\n<p>One rule for each kind of \
         claim, the same for every panel and reading; no panel is judged by hand.</p>\n</div>\n<dl class=\"rules\">"
    );
    for (claim, rule) in rules::CLAIMS {
        put!(html, "<dt>{}</dt><dd>{}</dd>", escape(claim), escape(rule));
    }
    put!(html, "</dl>");
    let (thresholds, alike) = rules::thresholds(report);
    if !alike {
        put!(
            html,
            "<p class=\"notice\">Not all verdicts in this folder were reached with the same thresholds; these are the first one’s. Each verdict’s own are in \
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
        "<thead><tr><th scope=\"col\">Name</th><th scope=\"col\" class=\"number\">Value</th><th scope=\"col\">Meaning</th></tr></thead>\n<tbody>"
    );
    for (name, value, meaning) in thresholds {
        put!(
            html,
            "<tr><th scope=\"row\"><code>{}</code></th><td class=\"number\">{}</td><td>{}</td></tr>",
            escape(&name),
            escape(&value),
            escape(meaning)
        );
    }
    put!(html, "</tbody>\n</table>\n</section>\n</section>");
}

/// Programs, machines and times.
fn making(html: &mut String, report: &Report) {
    put!(html, "<section aria-labelledby=\"making\">\n<h2 id=\"making\">How it was made</h2>");
    put!(
        html,
        "<p class=\"prose\">Figures and report by {}. The same version is made to give the same bytes on any machine; times are of \
         the machine that computed.</p>",
        escape(&report.made_by)
    );
    if report.making.is_empty() {
        put!(
            html,
            "<p>The folder does not say by which build and in what time its figures were made ({} is not there).</p>",
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
            ("Time", format!("{} s from the first question to the last file", decimal(run.seconds, 1))),
            (
                "Computed",
                match (run.computed.len(), run.store) {
                    (0, true) => "nothing: every answer had been kept from an earlier call".to_owned(),
                    (n, true) => format!(
                        "{n} answers in {} s of work; the others had been kept from earlier calls",
                        decimal(computed, 1)
                    ),
                    (n, false) => {
                        format!("{n} answers in {} s of work, none taken from an earlier call", decimal(computed, 1))
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
        table_start(html, "Computations and their times, the longest first", &format!("times-{i}"), None);
        put!(
            html,
            "<thead><tr><th scope=\"col\">Computation</th><th scope=\"col\" class=\"number\">Seconds</th></tr></thead>\n<tbody>"
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

/// How to cite the software, the article, and these figures.
fn citing(html: &mut String, report: &Report) {
    let (a, version) = (&report.article, env!("CARGO_PKG_VERSION"));
    let year = RELEASE_DATE.split('-').next().unwrap_or_default();
    put!(
        html,
        "<section aria-labelledby=\"citing\">\n<h2 id=\"citing\">How to cite</h2>\n<div class=\"prose\">\n<p>Cite the article for the claims, and this \
         software for the figures and verdicts; name the version, and the SHA-256 of a picture’s pixels if it matters which one was meant.</p>\n<ul>"
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
        "<li>The twofold authors ({year}). <cite>twofold: reference software for the breakdown of determinism at a two-fold singularity</cite>, \
         version {version}.</li>\n</ul>\n</div>"
    );
    let bibtex = format!(
        "@inproceedings{{jeffrey{0},\n  author    = {{{1}}},\n  title     = {{{2}}},\n  booktitle = {{{PROCEEDINGS}}},\n  year      = {{{0}}}\n}}\n\n\
         @software{{twofold,\n  author  = {{{{The twofold authors}}}},\n  title   = {{twofold: reference software for the breakdown of determinism at a two-fold \
         singularity}},\n  version = {{{version}}},\n  year    = {{{year}}}\n}}",
        a.year, a.author, a.title
    );
    put!(
        html,
        "<section class=\"scroll\" tabindex=\"0\" aria-label=\"BibTeX\"><pre><code>{}</code></pre></section>\n</section>",
        escape(&bibtex)
    );
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
        "<p>To check: <code>make check</code> recomputes everything and compares; <code>twofold check --against FOLDER</code> checks published \
         pictures; <code>twofold inspect FILE</code> reads what a picture says of itself.</p>"
    );
    put!(
        html,
        "<p>This page holds no path, and no time but those of <code>{}</code>: the same folder gives the same bytes.</p>\n</footer>",
        names::MAKING
    );
    put!(html, "<script>{SCRIPT}</script>\n</body>\n</html>");
}
