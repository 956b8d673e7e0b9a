//! The checker of certificates: the committed ones pass, altered ones do not.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::{Value, json};
use twofold::verify::{Refused, verify};

const NAMES: [&str; 8] =
    ["printed-cycle", "coexistence", "saddles", "inner-law", "sensitivity", "contraction", "crossings", "horseshoe"];

fn path(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("proofs/certificates").join(format!("{name}.json"))
}

fn certificate(name: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(path(name)).unwrap()).unwrap()
}

#[test]
fn committed_certificates_are_verified() {
    for name in NAMES {
        let verified = verify(&fs::read_to_string(path(name)).unwrap()).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(verified.theorem, name);
        assert!(!verified.findings.is_empty());
        println!("{name}: {:#?}", verified.findings);
    }
}

/// Every leaf of a document, by its path.
fn leaves(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| leaves(v, &format!("{at}/{k}"), found)),
        Value::Array(list) => list.iter().enumerate().for_each(|(i, v)| leaves(v, &format!("{at}/{i}"), found)),
        _ => found.push(at.to_owned()),
    }
}

/// The document with one leaf altered: numbers by one part in a hundred thousand or by 1e-6 (both ways), truths turned round, texts
/// lengthened.
fn altered(document: &Value, at: &str, up: bool) -> Value {
    let mut document = document.clone();
    let leaf = document.pointer_mut(at).unwrap();
    *leaf = match &*leaf {
        Value::Bool(b) => json!(!b),
        Value::String(s) => json!(format!("{s}1")),
        Value::Number(n) => {
            let x = n.as_f64().unwrap();
            let by = (1e-5 * x.abs()).max(1e-6);
            json!(if up { x + by } else { x - by })
        }
        other => panic!("{at}: {other}"),
    };
    document
}

/// What can be altered unnoticed, and why: numbers that enclose the flow and from which nothing else is derived, altered by less than a plain
/// orbit can tell, or made wider (a weaker claim, which the statement allows).
fn may_pass(name: &str, at: &str, up: bool) -> bool {
    let ends = |s: &str| at.ends_with(s);
    match name {
        // The derivative on the candidate enters the image with the candidate's width as a factor, 1e-9.
        "printed-cycle" | "coexistence" | "saddles" => {
            at.contains("derivative_on_candidate") || at.contains("preconditioner")
        }
        // A larger bound is a weaker claim.
        "inner-law" => ends("/least_s"),
        // The numbers of the flow: distances tie places together, the rest is ordered and narrow.
        "sensitivity" => at.contains("/time/") || at.contains("growth_until") || ends("/radius") || ends("/states/z"),
        // What the images' enclosures say is used in inequalities alone; a set's shape is tied to nothing below 1e-12.
        "horseshoe" => at.contains("/seen/"),
        // Places are tied to each other by the distances, at the singularity by plain orbits to 1e-4.
        "contraction" => {
            ends("/radius")
                || at.contains("/time/")
                || ["/0/", "/1/", "/2/"].iter().any(|n| at.contains(&format!("/crossings{n}")))
        }
        // Rows are tied to the table: the enclosures may be wider.
        "crossings" => ends("/radius") && up,
        _ => false,
    }
}

#[test]
fn what_is_altered_is_noticed() {
    for name in NAMES {
        let document = certificate(name);
        let mut all = Vec::new();
        leaves(&document, "", &mut all);
        let (mut tried, mut passed, mut unexpected) = (0, Vec::new(), Vec::new());
        for at in &all {
            // A plain orbit takes a while in the debug profile; the tables' rows are many.
            for up in [true, false] {
                tried += 1;
                if verify(&altered(&document, at, up).to_string()).is_ok() {
                    passed.push(at.clone());
                    if !may_pass(name, at, up) {
                        unexpected.push((at.clone(), up));
                    }
                }
            }
        }
        println!("{name}: {tried} alterations, {} unnoticed", passed.len());
        assert!(unexpected.is_empty(), "{name}: not noticed: {unexpected:#?}");
        let most = if name == "horseshoe" { 0.5 } else { 1.0 / 3.0 };
        assert!((passed.len() as f64) < most * f64::from(tried), "{name}: {} of {tried} pass", passed.len());
    }
}

#[test]
fn missing_and_added_parts_are_refused() {
    for name in NAMES {
        let document = certificate(name);
        let mut without = document.clone();
        let data = without["data"].as_object_mut().unwrap();
        let key = data.keys().next().unwrap().clone();
        data.remove(&key);
        assert!(matches!(verify(&without.to_string()), Err(Refused::Unreadable(_))), "{name} without {key}");
        let mut with = document.clone();
        with["data"]["more"] = json!(1);
        assert!(matches!(verify(&with.to_string()), Err(Refused::Unreadable(_))), "{name} with more");
    }
    // A certificate under another's name.
    let mut other = certificate("printed-cycle");
    other["theorem"] = json!("sensitivity");
    assert!(verify(&other.to_string()).is_err());
    other["theorem"] = json!("the last one");
    assert!(matches!(verify(&other.to_string()), Err(Refused::Unreadable(_))));
}

#[test]
fn exit_codes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("cert.json");
    let run = |text: &str| {
        fs::write(&at, text).unwrap();
        let output = Command::cargo_bin("twofold").unwrap().arg("verify").arg(&at).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let document = certificate("sensitivity");
    let (code, said) = run(&document.to_string());
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("sensitivity: verified") && said.contains("9.90e-13 apart"), "{said}");
    let (code, said) = run(&altered(&document, "/data/states/x/0", true).to_string());
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("NOT VERIFIED"), "{said}");
    assert_eq!(run("{}").0, 2);
    assert_eq!(run("not json").0, 2);
}
