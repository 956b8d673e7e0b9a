//! A figure: its pictures, what differs from the reference, verdicts, runs and hashes.

use std::fmt::Write as _;

use super::super::model::*;
use super::Links;
use super::parts::*;
use twofold_job::record::{Layer, listed};
use twofold_paper::compare::Comparison;
use twofold_paper::html::{data_address, escape, identifier, rich};
use twofold_paper::wording;

pub(super) fn figure(html: &mut String, figure: &FigureReport, links: Links) {
    let id = figure_id(figure);
    let title =
        if figure.title.is_empty() { String::new() } else { format!(": {}", rich(&figure.title)) };
    put!(
        html,
        "<section aria-labelledby=\"{id}\">\n<h2 id=\"{id}\">{}{title}</h2>",
        escape(&figure_name(&figure.id))
    );
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
            "<figure>{img}<figcaption>No record stands beside this picture. \
                {}</figcaption></figure>\n</article>",
            links.to(&file.path, "PNG")
        );
    }
    put!(html, "</section>");
}

pub(super) fn image(preview: &Preview, alt: &str) -> String {
    let [w, h] = preview.size;
    format!(
        "<img src=\"{}\" alt=\"{}\" width=\"{w}\" height=\"{h}\"/>",
        data_address("image/png", &preview.png),
        escape(alt)
    )
}

pub(super) fn picture(html: &mut String, picture: &PictureReport, links: Links) {
    let id = identifier(&picture.name);
    put!(html, "<article aria-labelledby=\"{id}\">");
    let reading =
        picture.reading.map_or(String::new(), |r| tag("", &format!("{} reading", r.word())));
    put!(
        html,
        "<h3 id=\"{id}\"><span>{}</span> {reading} {}</h3>",
        escape(&picture.name),
        reference_tag(&picture.reference)
    );
    if !picture.alterations.is_empty() {
        put!(
            html,
            "<p class=\"notice\">Not the published picture: {}.</p>",
            escape(&picture.alterations.join("; "))
        );
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
            (Role::Data, Some(panel)) if file.path.ends_with("-events.csv") => {
                format!("CSV ({panel}), events")
            }
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

/// Difference from the reference: the layer, the numbers, and ours | difference | theirs.
pub(super) fn mismatch(html: &mut String, picture: &PictureReport) {
    let (layer, panels, comparison, note) = match &picture.reference {
        Reference::Different { layer, panels, comparison, note, .. } => {
            (layer, panels, comparison, note)
        }
        Reference::Missing { why } => {
            put!(
                html,
                "<p class=\"notice\">There is no reference to compare with: {}.</p>",
                escape(why)
            );
            return;
        }
        _ => return,
    };
    let of =
        if panels.is_empty() { String::new() } else { format!(" of panel {}", listed(panels)) };
    put!(
        html,
        "<div class=\"notice\" data-mismatch=\"{}\">\n<p>Differs from the committed reference. The \
            first layer that differs: <strong>{}{}</strong> \
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
            format!(
                "Difference of {name}: orange where only the reference has ink, blue where only \
                    ours has"
            ),
        ),
        ("Reference", i.expected.as_ref(), format!("Reference: the committed {name}")),
    ];
    if i.expected.is_some() {
        put!(html, "<div class=\"triptych\" data-triptych=\"{}\">", identifier(name));
        for (word, preview, alt) in shown {
            if let Some(preview) = preview {
                put!(
                    html,
                    "<figure>{}<figcaption>{word}</figcaption></figure>",
                    image(preview, &alt)
                );
            }
        }
        put!(html, "</div>");
        if i.difference.is_some() {
            put!(
                html,
                "<p>In the difference: orange, ink only in the reference; blue, only in ours; \
                    grey, shared. It is smaller than the pictures: \
                 where several of their pixels are one of its own, that shows the most different \
                 one.</p>"
            );
        }
    }
}

/// Data with which the page's script turns a panel in space; without script nothing of it is seen.
pub(super) fn spaces(html: &mut String, picture: &PictureReport, id: &str) {
    for view in &picture.spaces {
        // Inside a script element no character reference is read, in HTML: what would end it or be
        // markup in XML is written as JSON escapes.
        let data = view
            .data
            .to_string()
            .replace('<', "\\u003c")
            .replace('>', "\\u003e")
            .replace('&', "\\u0026");
        let several = picture.spaces.len() > 1;
        let panel = if several {
            format!(" ({}) {}", view.label, wording::plain(&view.title))
        } else {
            String::new()
        };
        put!(
            html,
            "<script type=\"application/json\" class=\"space\" id=\"{id}-{}-space\" \
                data-title=\"{}{}\" data-panel=\"{}\">{data}</script>",
            identifier(&view.label),
            escape(&picture.name),
            escape(panel.trim_end()),
            if several { escape(&format!("({})", view.label)) } else { String::new() },
        );
    }
}

/// Cause of a difference that begins at a layer, in words.
pub(super) fn meaning(layer: Layer) -> &'static str {
    match layer {
        Layer::Spec => "another question was asked",
        Layer::Data => "the same question, other numbers",
        Layer::Verdict => "the same numbers, judged otherwise",
        Layer::Pixels => "the same numbers, drawn otherwise",
        Layer::Png | Layer::Svg | Layer::Pdf => "the same picture, another file",
    }
}

pub(super) fn numbers(c: &Comparison) -> String {
    if c.changed_pixels == 0 {
        return format!("All {} by {} pixels are the same; RMS 0, SSIM 1.", c.width, c.height);
    }
    format!(
        "{} of {} by {} pixels changed ({}); largest difference {} of 255 levels; RMS {} levels, \
            {} in the worst block; SSIM {}, {} in the worst \
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
pub(super) fn percent(share: f64) -> String {
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

pub(super) fn verdicts(html: &mut String, picture: &PictureReport, id: &str) {
    if picture.verdicts.is_empty() {
        return;
    }
    put!(html, "<h4>The paper’s claims</h4>");
    table_start(
        html,
        &format!("Claims and verdicts, {}", picture.name),
        &format!("{id}-verdicts"),
        None,
    );
    put!(
        html,
        "<thead><tr><th scope=\"col\">Panel</th><th scope=\"col\">The paper</th><th \
            scope=\"col\">Verdict</th><th \
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

pub(super) fn runs(html: &mut String, picture: &PictureReport, id: &str) {
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
            (
                "Restarts and kicks",
                if schedule.is_empty() { "none".to_owned() } else { rich(&schedule) },
            ),
        ];
        for (term, text) in lines {
            put!(html, "<dt>{term}</dt><dd>{text}</dd>");
        }
        put!(html, "</dl>");
    }
    table_start(
        html,
        &format!(
            "Work done, {}. NDSolve’s MaxSteps was {} for one call of LSODA, that is between \
                restarts.",
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

pub(super) fn hashes(html: &mut String, picture: &PictureReport, id: &str) {
    let expected = match &picture.reference {
        Reference::Different { expected, .. } => Some(&**expected),
        Reference::Same => Some(&picture.hashes),
        _ => None,
    };
    put!(html, "<details>\n<summary>Hashes</summary>");
    table_start(
        html,
        &format!("SHA-256 of each layer, {}", picture.name),
        &format!("{id}-hashes"),
        None,
    );
    put!(
        html,
        "<thead><tr><th scope=\"col\">Layer</th><th scope=\"col\">SHA-256</th><th \
            scope=\"col\">Reference</th></tr></thead>\n<tbody>"
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
        "<thead><tr><th scope=\"col\">File</th><th scope=\"col\" class=\"number\">Bytes</th><th \
            scope=\"col\">SHA-256</th><th \
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
            "<tr><th scope=\"row\"><code>{}</code></th><td \
                class=\"number\">{}</td><td><code>{}</code></td><td>{}</td></tr>",
            escape(&f.path),
            grouped(f.bytes),
            f.sha256.as_ref().map_or("–", |h| h.as_str()),
            tag(
                class,
                if f.role == Role::Record { "the record itself" } else { f.integrity.words() }
            )
        );
    }
    put!(html, "</tbody>\n</table>\n</section>\n</details>");
}
