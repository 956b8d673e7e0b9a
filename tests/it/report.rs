//! The report: a page, its twin for programs, and metadata for archives, made from real (short)
//! runs.

use crate::common;

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Output;

use assert_cmd::Command;
use common::{copy, figures, schema, write_references};
use serde_json::Value;
use twofold::record::{Hash, read_tree, visit_tree};
use twofold::render::{Pixels, decode_png, encode_png};
use twofold::report::{Links, MadeFile, Program, Reference, Report, assemble, page};

fn twofold(arguments: &[&str]) -> Output {
    Command::cargo_bin("twofold").unwrap().args(arguments).output().unwrap()
}

/// The pages of odds.
const ODDS: &str = concat!(
    include_str!("../../docs/census.md"),
    "\n\n",
    include_str!("../../docs/capture.md"),
    "\n\n",
    include_str!("../../docs/parameters.md")
);

/// A copy of the made figures and references for them.
struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        let folder = tempfile::tempdir().unwrap();
        copy(figures(), &folder.path().join("made"));
        write_references(&folder.path().join("made"), &folder.path().join("expected"));
        Self { folder }
    }

    fn made(&self) -> PathBuf {
        self.folder.path().join("made")
    }

    fn expected(&self) -> PathBuf {
        self.folder.path().join("expected")
    }

    /// Runs the command; its standard output.
    fn run(&self, more: &[&str]) -> String {
        let (made, expected) = (self.made(), self.expected());
        let mut all = vec![
            "report",
            "--figures",
            made.to_str().unwrap(),
            "--expected",
            expected.to_str().unwrap(),
        ];
        all.extend(more);
        let output = twofold(&all);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    }

    fn read(&self, name: &str) -> String {
        fs::read_to_string(self.made().join(name)).unwrap()
    }

    fn report(&self) -> Report {
        let known = twofold::paper::figures::all();
        assemble(
            &visit_tree(&self.made(), &|_| true, &|path, place| {
                MadeFile::read(path, place, &known)
            })
            .unwrap()
            .0,
            &read_tree(&self.expected(), &|_| true).unwrap().files,
            &Program {
                figures: &known,
                findings: concat!(
                    include_str!("../../docs/findings.md"),
                    "\n\n",
                    include_str!("../../docs/theorems.md")
                ),
                odds: ODDS,
            },
        )
    }

    /// Changes the JSON of a committed manifest or of a record.
    fn edit(&self, file: &Path, change: impl FnOnce(&mut Value)) {
        let mut value: Value = serde_json::from_slice(&fs::read(file).unwrap()).unwrap();
        change(&mut value);
        fs::write(file, serde_json::to_vec(&value).unwrap()).unwrap();
    }
}

fn parse(html: &str) -> roxmltree::Document<'_> {
    let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
    roxmltree::Document::parse_with_options(html, options).unwrap()
}

/// Panics with what is wrong with the page.
fn sound(html: &str) {
    let document = parse(html);
    let elements: Vec<_> = document.descendants().filter(|n| n.is_element()).collect();
    let name = |n: &roxmltree::Node| n.tag_name().name().to_owned();
    let mut ids = BTreeSet::new();
    for element in &elements {
        if let Some(id) = element.attribute("id") {
            assert!(ids.insert(id.to_owned()), "the id {id} is there twice");
        }
        for attribute in ["src", "href"] {
            if let Some(address) = element.attribute(attribute) {
                assert!(
                    !address.contains("//") || address.starts_with("data:"),
                    "{address} leads out of the folder"
                );
            }
        }
    }
    let mut level = 0;
    for element in &elements {
        for attribute in ["aria-labelledby", "data-sortable"] {
            if let Some(id) = element.attribute(attribute) {
                assert!(ids.contains(id), "{attribute} names {id}, which is not there");
            }
        }
        if let Some(id) = element.attribute("href").and_then(|h| h.strip_prefix('#')) {
            assert!(ids.contains(id), "a link leads to #{id}, which is not there");
        }
        match name(element).as_str() {
            "img" => {
                assert!(
                    element.attribute("alt").is_some_and(|a| a.len() > 10),
                    "a picture without a text"
                );
                assert!(
                    element.attribute("src").unwrap().starts_with("data:image/png;base64,iVBOR")
                );
            }
            "th" => assert!(element.attribute("scope").is_some(), "a heading cell without scope"),
            "table" => assert!(
                element.children().any(|c| name(&c) == "caption"),
                "a table without caption"
            ),
            "h1" | "h2" | "h3" | "h4" => {
                let here: u32 = name(element)[1..].parse().unwrap();
                assert!(here <= level + 1, "heading {here} follows heading {level}");
                level = here;
            }
            _ => {}
        }
    }
    assert!(elements.iter().any(|e| name(e) == "img"));
    assert_eq!(elements.iter().filter(|e| name(e) == "h1").count(), 1);
}

#[test]
fn the_page_is_sound_and_self_contained() {
    let bench = Bench::new();
    bench.run(&[]);
    let html = bench.read("index.html");
    sound(&html);
    // The checker checks.
    for (good, bad) in [
        (" alt=\"", " title=\""),
        ("<th scope=\"col\"", "<th class=\"col\""),
        ("id=\"claims\"", "id=\"summary\""),
    ] {
        let broken = html.replacen(good, bad, 1);
        assert_ne!(broken, html, "{good} is not on the page");
        assert!(std::panic::catch_unwind(|| sound(&broken)).is_err(), "{bad} was not noticed");
    }
    assert!(std::panic::catch_unwind(|| sound(&html.replace("</main>", ""))).is_err());
    // Every link beside the page leads to a file.
    let document = parse(&html);
    let links: Vec<&str> = document
        .descendants()
        .filter_map(|n| n.attribute("href"))
        .filter(|h| !h.starts_with('#') && !h.starts_with("data:"))
        .collect();
    assert!(links.iter().any(|l| l.ends_with(".csv")) && links.iter().any(|l| l.ends_with(".svg")));
    for link in links {
        assert!(bench.made().join(link).is_file(), "{link} leads nowhere");
    }
}

#[test]
fn what_it_says_is_what_the_records_say() {
    let bench = Bench::new();
    let said = bench.run(&[]);
    assert!(said.contains("2 of 2 pictures match the reference"), "{said}");
    let html = bench.read("index.html");
    let report: Value = serde_json::from_str(&bench.read("report.json")).unwrap();
    assert_eq!(report["summary"]["same"], 2);
    assert_eq!(report["problems"], serde_json::json!([]));
    for reading in ["printed", "reconstructed"] {
        let record: Value =
            serde_json::from_str(&bench.read(&format!("fig7/fig7-{reading}.json"))).unwrap();
        let picture = report["figures"][0]["pictures"]
            .as_array()
            .unwrap()
            .iter()
            .find(|p| p["reading"] == reading)
            .unwrap();
        assert_eq!(picture["hashes"], record["hashes"]);
        assert_eq!(picture["panels"][1]["statistics"], record["panels"][1]["statistics"]);
        assert_eq!(picture["panels"][1]["run"], record["panels"][1]["run"]);
        for hash in ["spec", "data", "pixels", "png", "svg", "pdf"] {
            assert!(html.contains(record["hashes"][hash].as_str().unwrap()));
        }
        let verdicts = record["verdicts"].as_array().unwrap();
        let summary = report["summary"]["readings"]
            .as_array()
            .unwrap()
            .iter()
            .find(|r| r["reading"] == reading)
            .unwrap();
        assert_eq!(summary["claims"], verdicts.len());
        assert_eq!(summary["agree"], verdicts.iter().filter(|v| v["agrees"] == true).count());
    }
    // All verdicts, whole, with their evidence.
    let all: Value = serde_json::from_str(&bench.read("verdicts.json")).unwrap();
    let mut recorded = Vec::new();
    for reading in ["printed", "reconstructed"] {
        let record: Value =
            serde_json::from_str(&bench.read(&format!("fig7/fig7-{reading}.json"))).unwrap();
        recorded.extend(record["verdicts"].as_array().unwrap().clone());
    }
    assert!(!recorded.is_empty());
    assert_eq!(all["verdicts"], Value::Array(recorded));
}

#[test]
fn same_figures_same_bytes() {
    let (a, b) = (Bench::new(), Bench::new());
    a.run(&[]);
    b.run(&[]);
    // A second time, with the first time's files in the folder.
    b.run(&[]);
    for name in ["index.html", "report.json", "verdicts.json", "ro-crate-metadata.json"] {
        let text = a.read(name);
        assert!(text == b.read(name), "{name} differs from run to run");
        let path = a.folder.path().to_str().unwrap();
        assert!(!text.contains(path), "{name} holds a path of this machine");
    }
}

#[test]
fn text_from_data_cannot_become_markup() {
    let bench = Bench::new();
    let evil = "</p><script>alert(\"1\")</script><img src=x onerror='alert(2)'/>&nbsp;\u{1}";
    let record = bench.made().join("fig7/fig7-printed.json");
    bench.edit(&record, |r| {
        r["caption"] = evil.into();
        r["title"] = evil.into();
        r["alterations"] = serde_json::json!([evil]);
        r["panels"][0]["title"] = evil.into();
        for field in ["claim_text", "found", "because", "method"] {
            r["verdicts"][0][field] = evil.into();
        }
    });
    let picture = fs::read(bench.made().join("fig7/fig7-printed.png")).unwrap();
    fs::write(bench.made().join("fig7").join("\"><script>.png"), &picture).unwrap();
    fs::write(bench.made().join("fig7").join("'><script>none.png"), b"x").unwrap();
    bench.run(&[]);
    let html = bench.read("index.html");
    sound(&html);
    assert_eq!(html.matches("<script>").count(), 1, "only our own script");
    assert!(html.contains("&lt;script&gt;alert(&quot;1&quot;)"));
    let document = parse(&html);
    assert!(document.descendants().all(|n| n.attributes().all(|a| !a.name().starts_with("on"))));
}

/// A square of other pixels in the committed picture; how many.
fn spoil(png: &Path) -> u64 {
    let mut pixels: Pixels = decode_png(&fs::read(png).unwrap()).unwrap();
    let mut changed = 0;
    for y in 300..320 {
        for x in 400..430 {
            let at = 4 * (y * pixels.width as usize + x);
            let dark = [10, 20, 30];
            changed += u64::from(pixels.rgba[at..at + 3] != dark);
            pixels.rgba[at..at + 3].copy_from_slice(&dark);
        }
    }
    fs::write(png, encode_png(&pixels).unwrap()).unwrap();
    changed
}

#[test]
fn a_mismatch_shows_ours_difference_and_theirs() {
    let bench = Bench::new();
    let changed = spoil(&bench.expected().join("fig7/fig7-printed.png"));
    bench.edit(&bench.expected().join("fig7/expected.json"), |m| {
        m["pictures"][0]["pixels"] = "0".repeat(64).into()
    });
    let said = bench.run(&[]);
    assert!(said.contains("1 of 2 pictures match"), "{said}");
    let report: Value = serde_json::from_str(&bench.read("report.json")).unwrap();
    let reference = &report["figures"][0]["pictures"][0]["reference"];
    assert_eq!(reference["state"], "different");
    assert_eq!(reference["layer"], "pixels");
    assert_eq!(reference["comparison"]["changed_pixels"], changed);
    assert!(reference["comparison"]["ssim"].as_f64().unwrap() < 1.0);
    let html = bench.read("index.html");
    sound(&html);
    let document = parse(&html);
    let boxes: Vec<_> =
        document.descendants().filter(|n| n.has_attribute("data-triptych")).collect();
    assert_eq!(boxes.len(), 1);
    let texts: Vec<String> = boxes[0]
        .descendants()
        .filter(|n| n.has_tag_name(("http://www.w3.org/1999/xhtml", "figcaption")))
        .map(|n| n.text().unwrap().to_owned())
        .collect();
    assert_eq!(texts, ["Ours", "Difference", "Reference"]);
    let sources: BTreeSet<&str> =
        boxes[0].descendants().filter_map(|n| n.attribute("src")).collect();
    assert_eq!(sources.len(), 3, "three different pictures");
    let notice = document
        .descendants()
        .find(|n| n.attribute("data-mismatch") == Some("fig7-printed"))
        .unwrap();
    let words: String =
        notice.descendants().filter_map(|n| n.text().filter(|_| n.is_text())).collect();
    for word in ["pixels", &changed.to_string(), "RMS", "SSIM"] {
        assert!(words.contains(word), "no {word} in: {words}");
    }
}

/// Parts that a referee looks for: findings in sentences, rules with every threshold, how it was
/// made, how to cite; and a page that is light.
#[test]
fn a_referee_finds_findings_rules_making_and_citation() {
    let bench = Bench::new();
    let making = serde_json::json!({ "format": "twofold-making", "version": 1, "runs": [{
        "figures": ["fig7"], "program": "twofold 9.9.9", "commit": "0123abcd",
            "compiler": "rustc 1", "target": "here", "profile": "release",
        "threads": 3, "store": false, "seconds": 12.345, "computed": [{ "what": "fig7 <b>",
            "seconds": 11.5 }],
    }]});
    fs::write(bench.made().join("making.json"), making.to_string()).unwrap();
    bench.run(&[]);
    let html = bench.read("index.html");
    sound(&html);
    let document = parse(&html);
    let text = |id: &str| -> String {
        let section =
            document.descendants().find(|n| n.attribute("aria-labelledby") == Some(id)).unwrap();
        section.descendants().filter_map(|n| n.text().filter(|_| n.is_text())).collect()
    };
    let record: Value = serde_json::from_str(&bench.read("fig7/fig7-printed.json")).unwrap();
    let verdict = &record["verdicts"][1];
    let said = format!(
        "fig. 7(ii) (said: {}; found: {})",
        verdict["claim_text"].as_str().unwrap(),
        verdict["found"].as_str().unwrap()
    );
    assert!(text("findings").contains(&said), "{said} is not in: {}", text("findings"));
    assert!(text("findings").contains("Each visit to the singularity costs digits."));
    let odds =
        document.descendants().find(|n| n.attribute("aria-labelledby") == Some("odds")).unwrap();
    let tables: Vec<_> = odds
        .descendants()
        .filter(|n| n.has_tag_name(("http://www.w3.org/1999/xhtml", "table")))
        .collect();
    let rows = ODDS.lines().filter(|l| l.starts_with('|') && !l.starts_with("|---"));
    let shown = odds
        .descendants()
        .filter(|n| n.has_tag_name(("http://www.w3.org/1999/xhtml", "tr")))
        .count();
    assert!(
        tables.len() >= 2 && shown == rows.count(),
        "{} tables with {shown} rows",
        tables.len()
    );
    let thresholds = verdict["evidence"]["section"]["thresholds"].as_object().unwrap();
    for (name, value) in thresholds {
        assert!(
            text("rules").contains(name.as_str()) && text("rules").contains(&value.to_string()),
            "{name} = {value}"
        );
    }
    for word in [
        "twofold 9.9.9",
        "0123abcd",
        "rustc 1",
        "here, profile release",
        "12.3 s",
        "fig7 <b>",
        "11.50",
    ] {
        assert!(text("making").contains(word), "no {word} in: {}", text("making"));
    }
    for word in [
        "@software{twofold",
        "@inproceedings{jeffrey2013",
        env!("CARGO_PKG_VERSION"),
        "Proc. 5th International Conference",
    ] {
        assert!(text("citing").contains(word), "no {word}");
    }
    // Two pictures of 70 and 200 kB; without previews they alone would take 370 kB.
    assert!(html.len() < 300_000, "the page weighs {} bytes", html.len());

    fs::write(bench.made().join("making.json"), "{").unwrap();
    bench.run(&[]);
    let report: Value = serde_json::from_str(&bench.read("report.json")).unwrap();
    assert_eq!(report["making"], serde_json::json!([]));
    assert!(report["problems"][0].as_str().unwrap().starts_with("making.json: cannot be read"));
}

#[test]
fn the_first_layer_that_differs_is_named_with_its_panel() {
    let bench = Bench::new();
    bench.edit(&bench.expected().join("fig7/expected.json"), |m| {
        m["pictures"][1]["data"] = "1".repeat(64).into();
        m["pictures"][1]["panels"][1]["data"] = "1".repeat(64).into();
    });
    fs::remove_file(bench.expected().join("fig7/fig7-reconstructed.png")).unwrap();
    bench.run(&[]);
    let html = bench.read("index.html");
    assert!(html.contains("<strong>data of panel ii</strong>"), "the layer is not named");
    assert!(html.contains("not committed, only its hashes"));
    assert!(!html.contains("data-triptych"));
}

#[test]
fn files_that_are_not_what_the_record_says_are_named() {
    let bench = Bench::new();
    let file = |name: &str| bench.made().join("fig7").join(name);
    let svg = fs::read_to_string(file("fig7-printed.svg")).unwrap();
    fs::write(file("fig7-printed.svg"), svg + " ").unwrap();
    fs::remove_file(file("fig7-printed.pdf")).unwrap();
    // The last digit of one number.
    let table = fs::read_to_string(file("fig7-printed-ii.csv")).unwrap();
    let mut lines: Vec<String> = table.lines().map(str::to_owned).collect();
    let digit = lines[1].find(',').unwrap() - 1;
    let other = if &lines[1][digit..=digit] == "1" { "2" } else { "1" };
    lines[1].replace_range(digit..=digit, other);
    fs::write(file("fig7-printed-ii.csv"), lines.join("\n") + "\n").unwrap();

    let report = bench.report();
    assert_eq!(report.summary.damaged_files, 3);
    let state = |path: &str| {
        let files = report.figures[0].pictures.iter().flat_map(|p| &p.files);
        files.into_iter().find(|f| f.path == format!("fig7/{path}")).unwrap().integrity.words()
    };
    assert_eq!(state("fig7-printed.svg"), "changed since it was made");
    assert_eq!(state("fig7-printed.pdf"), "not there");
    assert_eq!(state("fig7-printed-ii.csv"), "changed since it was made");
    assert_eq!(state("fig7-printed-i.csv"), "as recorded");
    assert_eq!(state("fig7-reconstructed.svg"), "as recorded");
    for damaged in
        ["fig7-printed.pdf: not there", "fig7-printed.svg: changed", "fig7-printed-ii.csv: changed"]
    {
        assert!(report.problems.iter().any(|p| p.contains(damaged)), "{:?}", report.problems);
    }
    // A file that was changed is not the reference, whatever its record says.
    assert!(matches!(report.figures[0].pictures[0].reference, Reference::Different { .. }));
    sound(std::str::from_utf8(&page(&report, Links::Beside)).unwrap());
}

#[test]
fn altered_pictures_are_shown_and_not_counted() {
    let bench = Bench::new();
    let rename = |ending: &str| {
        let from = bench.made().join("fig7").join(format!("fig7-printed{ending}"));
        fs::rename(from, bench.made().join("fig7").join(format!("fig7-printed-shortened{ending}")))
            .unwrap();
    };
    [".png", ".svg", ".pdf", ".json", "-i.csv", "-ii.csv"].iter().for_each(|ending| rename(ending));
    bench.edit(&bench.made().join("fig7/fig7-printed-shortened.json"), |r| {
        r["hashes"]["name"] = "fig7-printed-shortened".into();
        r["alterations"] = serde_json::json!(["shortened: t = 60 instead of 200000"]);
    });
    let report = bench.report();
    assert_eq!((report.summary.pictures, report.summary.same, report.summary.altered), (1, 1, 1));
    assert_eq!(report.summary.readings.len(), 1);
    assert!(
        report.problems.iter().any(|p| p.contains("fig7-printed.png: not made")),
        "{:?}",
        report.problems
    );
    let html = String::from_utf8(page(&report, Links::Beside)).unwrap();
    assert!(html.contains("Not the published picture: shortened: t = 60 instead of 200000"));
    sound(&html);
}

#[test]
fn other_files_in_the_folder_do_no_harm() {
    let bench = Bench::new();
    let write = |name: &str, text: &str| {
        let path = bench.made().join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, text).unwrap();
    };
    write("fig7/notes.json", "{\"runs\": 40}");
    write("fig7/fig7-printed-lottery.csv", "run,end\n1,periodic\n");
    write("fig7/broken.json", "{");
    write("fig7/future.json", "{\"hashes\": 7}");
    write("lottery/numbers.csv", "a,b\n1,2\n");
    write("fig10/readme.txt", "nothing here");
    write("deep/er/than/we/look/at.json", "{");
    let png = fs::read(bench.made().join("fig7/fig7-printed.png")).unwrap();
    fs::create_dir_all(bench.made().join("lottery")).unwrap();
    fs::write(bench.made().join("lottery/share.png"), &png).unwrap();
    let report = bench.report();
    let ids: Vec<&str> = report.figures.iter().map(|f| f.id.as_str()).collect();
    assert_eq!(ids, ["fig7", "lottery"]);
    assert_eq!(report.figures[1].unrecorded.len(), 1);
    assert_eq!(report.problems.len(), 2, "{:?}", report.problems);
    let extra = report.figures[0].pictures[0]
        .files
        .iter()
        .find(|f| f.path == "fig7/fig7-printed-lottery.csv")
        .unwrap();
    assert_eq!((extra.integrity.words(), extra.panel.as_deref()), ("no hash recorded", None));
    assert_eq!(report.summary.damaged_files, 0);
    let html = String::from_utf8(page(&report, Links::None)).unwrap();
    sound(&html);
    assert!(html.contains("Figure 7") && html.contains("Fig. 7 by three methods"));
    assert!(!html.contains("href=\"fig7/"), "a page that stands elsewhere has no links to files");
}

#[test]
fn the_twin_follows_its_schema() {
    let bench = Bench::new();
    spoil(&bench.expected().join("fig7/fig7-printed.png"));
    bench.edit(&bench.expected().join("fig7/expected.json"), |m| {
        m["pictures"][0]["pixels"] = "0".repeat(64).into()
    });
    fs::remove_file(bench.made().join("fig7/fig7-reconstructed.svg")).unwrap();
    bench.run(&[]);
    let text =
        fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/schemas/report.schema.json"))
            .unwrap();
    let rules: Value = serde_json::from_str(&text).unwrap();
    let report: Value = serde_json::from_str(&bench.read("report.json")).unwrap();
    assert_eq!(schema::violations(&rules, &report), Vec::<String>::new());
    // The schema and its reader notice what is wrong.
    let spoilt = |change: &dyn Fn(&mut Value)| {
        let mut copy = report.clone();
        change(&mut copy);
        assert!(!schema::violations(&rules, &copy).is_empty(), "a broken report passed");
    };
    spoilt(&|r| r["version"] = 2.into());
    spoilt(&|r| r["extra"] = 1.into());
    spoilt(&|r| drop(r.as_object_mut().unwrap().remove("summary")));
    spoilt(&|r| r["figures"][0]["pictures"][0]["hashes"]["png"] = "abc".into());
    spoilt(&|r| r["figures"][0]["pictures"][0]["reference"]["state"] = "same".into());
    spoilt(&|r| {
        r["figures"][0]["pictures"][0]["reference"]["comparison"]["changed_share"] = 2.0.into()
    });
    spoilt(&|r| r["figures"][0]["pictures"][0]["panels"][0]["statistics"]["steps"] = (-1).into());
    spoilt(&|r| r["figures"][0]["pictures"][0]["verdicts"][0]["agrees"] = "yes".into());
}

#[test]
fn the_archive_metadata_describe_the_folder_as_it_is() {
    let bench = Bench::new();
    bench.run(&[]);
    let metadata: Value = serde_json::from_str(&bench.read("ro-crate-metadata.json")).unwrap();
    let graph = metadata["@graph"].as_array().unwrap();
    let ids: BTreeSet<&str> = graph.iter().map(|e| e["@id"].as_str().unwrap()).collect();
    assert_eq!(ids.len(), graph.len(), "an @id is there twice");
    let descriptor = graph.iter().find(|e| e["@id"] == "ro-crate-metadata.json").unwrap();
    assert_eq!(descriptor["conformsTo"]["@id"], "https://w3id.org/ro/crate/1.1");
    assert_eq!(descriptor["about"]["@id"], "./");
    let root = graph.iter().find(|e| e["@id"] == "./").unwrap();
    for required in ["name", "description", "datePublished", "license"] {
        assert!(!root[required].is_null(), "the root has no {required}");
    }
    fn references<'a>(value: &'a Value, into: &mut Vec<&'a str>) {
        match value {
            Value::Array(items) => items.iter().for_each(|v| references(v, into)),
            Value::Object(map) if map.len() == 1 && map.contains_key("@id") => {
                into.push(map["@id"].as_str().unwrap())
            }
            Value::Object(map) => map.values().for_each(|v| references(v, into)),
            _ => {}
        }
    }
    for entity in graph {
        let mut named = Vec::new();
        references(entity, &mut named);
        for id in named.into_iter().filter(|id| !id.starts_with("https://w3id.org/ro/crate")) {
            assert!(ids.contains(id), "{id} is named and not described");
        }
    }
    // Every file but the metadata themselves, with its true hash and length.
    let mut described = BTreeSet::new();
    for file in graph.iter().filter(|e| e["@type"] == "File") {
        let path = file["@id"].as_str().unwrap();
        let bytes = fs::read(bench.made().join(path)).unwrap();
        assert_eq!(file["sha256"], Hash::of(&bytes).as_str(), "{path}");
        assert_eq!(file["contentSize"], bytes.len().to_string(), "{path}");
        described.insert(path.to_owned());
    }
    let there: BTreeSet<String> = read_tree(&bench.made(), &|p| p != "ro-crate-metadata.json")
        .unwrap()
        .files
        .into_iter()
        .map(|f| f.path)
        .collect();
    assert_eq!(described, there);
}

#[test]
fn the_citation_file_agrees_with_the_crate() {
    let text = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/CITATION.cff")).unwrap();
    for line in [
        "cff-version: 1.2.0".to_owned(),
        format!("version: {}", env!("CARGO_PKG_VERSION")),
        format!("date-released: {}", twofold::report::RELEASE_DATE),
    ] {
        assert!(text.lines().any(|l| l == line), "CITATION.cff has no line \"{line}\"");
    }
    let changes = fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/CHANGELOG.md")).unwrap();
    let heading = format!("## [{}] - {}", env!("CARGO_PKG_VERSION"), twofold::report::RELEASE_DATE);
    assert!(changes.lines().any(|l| l == heading), "CHANGELOG.md has no line \"{heading}\"");
}

#[test]
fn a_place_without_figures_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().to_str().unwrap();
    for figures in [path.to_owned(), format!("{path}/nowhere")] {
        let output = twofold(&["report", "--figures", &figures]);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(text.contains("make figures") && text.contains(path), "{text}");
    }
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "something was written");
}

#[test]
fn without_references_it_says_so() {
    let bench = Bench::new();
    fs::remove_dir_all(bench.expected()).unwrap();
    fs::create_dir(bench.expected()).unwrap();
    let said = bench.run(&[]);
    assert!(said.contains("0 of 2 pictures match"), "{said}");
    let html = bench.read("index.html");
    sound(&html);
    assert!(html.contains("no reference has been committed for fig7"));
}
