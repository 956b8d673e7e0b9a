//! The checker of certificates: the committed ones pass, forged ones do not.
//!
//! A forged number is *certainly false* if what it claims contradicts the committed certificate,
//! which is true: an enclosure that has no number in common with the committed one, bounds in the
//! wrong order, a radius that is not positive, another direction or another equation. All of these
//! must be refused. Other alterations may be true: a wider enclosure, or one that is narrower and
//! still holds the value.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use assert_cmd::Command;
use serde_json::{Value, json};
use twofold::paper::code::theorems;
use twofold::verify::{Checker, Refused, Theorem, Verified};

const NAMES: [&str; 8] = [
    "printed-cycle",
    "coexistence",
    "saddles",
    "inner-law",
    "sensitivity",
    "contraction",
    "crossings",
    "horseshoe",
];
/// Certificates that the debug profile verifies in seconds: the orbits are short.
const QUICK: [&str; 1] = ["sensitivity"];

fn checker() -> Checker {
    Checker::new(theorems())
}

fn verify(text: &str) -> Result<Verified, Refused> {
    checker().verify(text)
}

fn text(name: &str) -> String {
    let path = Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("proofs/certificates")
        .join(format!("{name}.json"));
    fs::read_to_string(path).unwrap()
}

fn certificate(name: &str) -> Value {
    serde_json::from_str(&text(name)).unwrap()
}

fn are_verified(names: &[&str]) {
    for name in names {
        let verified = verify(&text(name)).unwrap_or_else(|e| panic!("{e}"));
        assert_eq!(verified.theorem, *name);
        assert!(!verified.findings.is_empty());
        println!("{name}: {:#?}", verified.findings);
    }
}

#[test]
fn quick_certificates_are_verified() {
    are_verified(&QUICK);
}

#[test]
#[ignore = "a minute in release, many in debug: make forge"]
fn committed_certificates_are_verified() {
    are_verified(&NAMES);
}

/// Each number of a theorem's data is asked for: with another one the same certificate is refused.
#[test]
fn a_theorem_is_no_other_ones() {
    #[derive(serde::Deserialize)]
    struct File {
        theorem: Vec<Theorem>,
    }
    let file = include_str!("../../papers/jeffrey-2013/theorems.toml");
    let start = file.find("name = \"sensitivity\"").unwrap();
    for (from, to, why) in [
        ("alpha = \"0.1\"", "alpha = \"0.2\"", "alpha = 0.2"),
        ("beta = \"1e-5\"", "beta = \"0\"", "beta = 0"),
        ("v_minus = \"-1.4\"", "v_minus = \"-1.5\"", "v- = -1.5"),
        ("transition = \"tanh\"", "transition = \"linear\"", "with tanh"),
        ("apart = \"1e-12\"", "apart = \"1e-13\"", "differ by less than 1e-13"),
        ("near = \"1e-4\"", "near = \"1e-6\"", "lie at the singularity"),
        ("crossings = 3", "crossings = 4", "4 crossings"),
        ("farther = \"0.3\"", "farther = \"0.4\"", "more than 0.4 apart"),
        ("more than 0.3 apart", "more than 0.4 apart", "the statement is the one"),
    ] {
        let (before, after) = file.split_at(start);
        assert!(after.contains(from), "{from}");
        let other: File =
            toml::from_str(&(before.to_owned() + &after.replacen(from, to, 1))).unwrap();
        let found = Checker::new(other.theorem).verify(&text("sensitivity"));
        let Err(Refused::Wrong { what, .. }) = found else { panic!("{to}: {found:?}") };
        assert!(what.contains(why), "{to}: {what}");
    }
}

/// Every leaf of a document, by its path.
fn leaves(value: &Value, at: &str, found: &mut Vec<String>) {
    match value {
        Value::Object(map) => map.iter().for_each(|(k, v)| leaves(v, &format!("{at}/{k}"), found)),
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| leaves(v, &format!("{at}/{i}"), found))
        }
        _ => found.push(at.to_owned()),
    }
}

/// Bounds of an enclosure, [low, high], and balls, by their paths.
fn enclosures(value: &Value, at: &str, found: &mut Vec<String>) {
    /// Pairs of numbers that enclose nothing: coordinates, a preconditioner's rows, parts of a set.
    const NO_BOUNDS: [&str; 5] = ["centre", "unstable", "stable", "preconditioner", "part"];
    match value {
        Value::Object(map) if map.contains_key("radius") => found.push(at.to_owned()),
        Value::Object(map) => {
            let others = map.iter().filter(|(k, _)| !NO_BOUNDS.contains(&k.as_str()));
            others.for_each(|(k, v)| enclosures(v, &format!("{at}/{k}"), found));
        }
        Value::Array(list) if list.len() == 2 && list.iter().all(Value::is_f64) => {
            found.push(at.to_owned())
        }
        Value::Array(list) => {
            list.iter().enumerate().for_each(|(i, v)| enclosures(v, &format!("{at}/{i}"), found))
        }
        _ => {}
    }
}

/// The middle and the radius of an enclosure; middles of balls relative to `origin`, because their
/// second parts are below the first's last digit.
fn middle_and_radius(enclosure: &Value, origin: f64) -> (f64, f64) {
    let at = |x: &Value| x.as_f64().unwrap();
    match enclosure {
        Value::Array(bounds) => {
            let (low, high) = (at(&bounds[0]), at(&bounds[1]));
            (0.5 * low + 0.5 * high - origin, 0.5 * high - 0.5 * low)
        }
        ball => ((at(&ball["high"]) - origin) + at(&ball["low"]), at(&ball["radius"])),
    }
}

/// Whether no number is in both, or the forged one is no enclosure at all.
fn contradicts(forged: &Value, true_one: &Value) -> bool {
    let origin = true_one.get("high").map_or(0.0, |x| x.as_f64().unwrap());
    let ((m, r), (n, s)) = (middle_and_radius(forged, origin), middle_and_radius(true_one, origin));
    let not_positive = if forged.is_object() { r <= 0.0 } else { r < 0.0 };
    // Some slack for the rounding of this comparison.
    not_positive || (m - n).abs() * (1.0 - 1e-12) - 1e-15 * n.abs() > r + s
}

fn forged(document: &Value, at: &str, by: Value) -> Value {
    let mut document = document.clone();
    *document.pointer_mut(at).unwrap() = by;
    document
}

/// Ways to alter one leaf.
fn alterations(leaf: &Value) -> Vec<Value> {
    match leaf {
        Value::Bool(b) => vec![json!(!b)],
        Value::String(s) => {
            let all = [&format!("{s}1"), "", "0", "-1e9999", "nan"];
            all.into_iter().filter(|t| t != s).map(|t| json!(t)).collect()
        }
        Value::Number(n) => {
            let x = n.as_f64().unwrap();
            let all = [0.0, -x, 1.01 * x, 2.0 * x, 1e308, x * (1.0 + 1e-9), x * (1.0 - 1e-9)];
            all.into_iter().filter(|y| *y != x).map(|y| json!(y)).collect()
        }
        other => panic!("{other}"),
    }
}

/// The shape of a path: numbers of rows left out.
fn shape(at: &str) -> String {
    let names = at.split('/').filter(|part| !part.is_empty() && part.parse::<u32>().is_err());
    names.filter(|part| *part != "data").collect::<Vec<_>>().join("/")
}

#[derive(Default)]
struct Count {
    leaves: usize,
    /// Certainly false, one leaf altered: all refused.
    false_alone: usize,
    /// Certainly false, several leaves altered: all refused.
    false_in_groups: usize,
    /// May be true, one leaf altered.
    open: usize,
    /// Those of `open` that were accepted, by the shapes of their paths.
    accepted: BTreeMap<String, usize>,
}

/// Forges every leaf alone and every enclosure as a whole; certainly false ones must all be
/// refused.
fn forge(name: &str) -> Count {
    let checker = checker();
    let accepts = |document: &Value| checker.verify(&document.to_string()).is_ok();
    let document = certificate(name);
    assert!(accepts(&document), "{name}");
    let (mut at_leaves, mut at_enclosures) = (Vec::new(), Vec::new());
    leaves(&document, "", &mut at_leaves);
    enclosures(&document["data"], "/data", &mut at_enclosures);
    let mut count = Count { leaves: at_leaves.len(), ..Count::default() };
    let mut believed = Vec::new();
    for at in &at_leaves {
        let leaf = document.pointer(at).unwrap();
        let of = at_enclosures.iter().find(|e| at.starts_with(&format!("{e}/")));
        for by in alterations(leaf) {
            let altered = forged(&document, at, by.clone());
            let is_false = match of {
                Some(e) => contradicts(altered.pointer(e).unwrap(), document.pointer(e).unwrap()),
                // All else is certain: directions, equations, starts, indices, parts. A
                // preconditioner, a set's shape and a cone's slopes are the prover's choice, and a
                // larger least S is a weaker claim.
                None => {
                    let witness =
                        ["preconditioner", "centre", "unstable", "stable", "least_s", "cones"];
                    !witness.iter().any(|w| at.contains(w))
                }
            };
            let accepted = accepts(&altered);
            if is_false {
                count.false_alone += 1;
                if accepted {
                    believed.push(format!("{at}: {leaf} -> {by}"));
                }
            } else {
                count.open += 1;
                if accepted {
                    *count.accepted.entry(shape(at)).or_default() += 1;
                }
            }
        }
    }
    // Each enclosure as a whole: moved beyond itself, both ways, and shrunk to a number that is not
    // in it.
    for at in &at_enclosures {
        let enclosure = document.pointer(at).unwrap();
        for way in [-3.0, 3.0] {
            let mut moved = enclosure.clone();
            let r = middle_and_radius(enclosure, 0.0).1;
            match &mut moved {
                Value::Array(bounds) => {
                    for b in bounds.iter_mut() {
                        let x = b.as_f64().unwrap();
                        *b = json!(x + way * r.max(2.0 * f64::EPSILON * x.abs()));
                    }
                }
                ball => {
                    let (high, low) =
                        (ball["high"].as_f64().unwrap(), ball["low"].as_f64().unwrap());
                    let key = if r > f64::EPSILON * high.abs() { "high" } else { "low" };
                    let x = if key == "high" { high } else { low };
                    ball[key] = json!(x + way * r.max(f64::EPSILON * x.abs()));
                }
            }
            if contradicts(&moved, enclosure) {
                count.false_in_groups += 1;
                if accepts(&forged(&document, at, moved.clone())) {
                    believed.push(format!("{at}: {enclosure} -> {moved}"));
                }
            }
        }
    }
    // All enclosures of one name at once: without width, and all of them elsewhere.
    let mut shapes: Vec<String> = at_enclosures.iter().map(|at| shape(at)).collect();
    shapes.sort();
    shapes.dedup();
    for one in &shapes {
        let (mut point, mut elsewhere) = (document.clone(), document.clone());
        for at in at_enclosures.iter().filter(|at| shape(at) == *one) {
            for (copy, far) in [(&mut point, false), (&mut elsewhere, true)] {
                match copy.pointer_mut(at).unwrap() {
                    Value::Array(bounds) => {
                        let x = bounds[0].as_f64().unwrap();
                        let to = if far { 1.5 * x + 1.0 } else { x };
                        bounds.fill(json!(to));
                    }
                    ball if far => ball["high"] = json!(1.5 * ball["high"].as_f64().unwrap() + 1.0),
                    ball => ball["radius"] = json!(0.0),
                }
            }
        }
        for copy in [point, elsewhere] {
            count.false_in_groups += 1;
            if accepts(&copy) {
                believed.push(format!("all of {one}"));
            }
        }
    }
    assert!(believed.is_empty(), "{name}: believed: {believed:#?}");
    count
}

const HEAD: &str = "\
| certificate | leaves | tried | refused | accepted | of the refused: certainly false, alone | in \
groups | may be true | where accepted (number) |
|---|---|---|---|---|---|---|---|---|";

/// A row of proofs/forgeries.md.
fn row(name: &str, count: &Count) -> String {
    let certain = count.false_alone + count.false_in_groups;
    let accepted: usize = count.accepted.values().sum();
    let list: Vec<String> = count.accepted.iter().map(|(at, n)| format!("{at} ({n})")).collect();
    format!(
        "| {name} | {} | {} | {} | {accepted} | {} | {} | {} | {} |",
        count.leaves,
        certain + count.open,
        certain + count.open - accepted,
        count.false_alone,
        count.false_in_groups,
        count.open - accepted,
        list.join(", ")
    )
}

#[test]
fn quick_certificates_are_not_forged() {
    println!("\n{HEAD}");
    for name in QUICK {
        println!("{}", row(name, &forge(name)));
    }
}

#[test]
#[ignore = "thousands of forgeries, minutes in release: make forge"]
fn no_certificate_is_forged() {
    let rows = std::thread::scope(|scope| {
        let running = NAMES.map(|name| scope.spawn(move || row(name, &forge(name))));
        running.map(|thread| thread.join().unwrap())
    });
    println!("\n{HEAD}\n{}", rows.join("\n"));
}

/// Forgeries that were accepted when a certificate's numbers were only compared with each other.
mod coordinated {
    use super::*;

    fn is_refused(checker: &Checker, document: &Value, why: &str) {
        match checker.verify(&document.to_string()) {
            Err(Refused::Wrong { what, .. }) => assert!(what.contains(why), "{what}"),
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn equal_states_do_not_part() {
        let mut document = certificate("sensitivity");
        document["data"]["states"]["x"][1] = document["data"]["states"]["x"][0].clone();
        is_refused(&checker(), &document, "the states differ");
    }

    #[test]
    fn crossings_and_distances_of_no_orbit_are_refused() {
        let mut document = certificate("sensitivity");
        for row in document["data"]["crossings"].as_array_mut().unwrap() {
            for (k, x) in [0.0, 1e6].into_iter().enumerate() {
                row["orbits"][k]["x"] = json!({ "high": x, "low": 0.0, "radius": 1e-30 });
                row["orbits"][k]["z"] = json!({ "high": 0.0, "low": 0.0, "radius": 1e-30 });
            }
            row["distance"] = json!([1e6, 1e6]);
        }
        is_refused(&checker(), &document, "holds what the checker computes");
    }

    #[test]
    fn a_crossing_is_no_point() {
        for radius in [0.0, -0.0, -1.0] {
            let mut document = certificate("crossings");
            for table in ["printed", "reconstructed"] {
                for row in document["data"][table]["crossings"].as_array_mut().unwrap() {
                    for key in ["time", "x", "z"] {
                        row[key]["radius"] = json!(radius);
                    }
                }
            }
            let at = "printed, crossing 1: time: the radius is above 0";
            is_refused(&checker(), &document, at);
        }
    }

    #[test]
    fn a_key_stands_once() {
        for (name, key) in [("printed-cycle", "determinant"), ("sensitivity", "states")] {
            let twice = text(name).replacen(
                &format!("\"{key}\":"),
                &format!("\"{key}\": [0.0, 0.0],\n\"{key}\":"),
                1,
            );
            let Err(Refused::Unreadable(why)) = verify(&twice) else { panic!("{name}") };
            assert!(
                why.contains(&format!("the key {key:?} stands twice")) && why.contains("line"),
                "{why}"
            );
        }
    }

    /// A closed orbit whose derivative is claimed to be diag(a, b), and all that is derived from
    /// it.
    fn of_other_stability(cycle: &mut Value, [a, b]: [f64; 2]) {
        let zero = json!([0.0, 0.0]);
        let derivative = json!([[[a, a], zero], [zero, [b, b]]]);
        cycle["derivative_at_point"] = derivative.clone();
        cycle["derivative_on_candidate"] = derivative;
        // The inverse of the derivative less 1: Krawczyk's image is then that of Newton's method.
        let inverse = [a, b].map(|d| 1.0 / (d - 1.0));
        cycle["preconditioner"] = json!([[inverse[0], 0.0], [0.0, inverse[1]]]);
        for (i, by) in inverse.iter().enumerate() {
            let bounds = [0, 1].map(|k| cycle["candidate"][i][k].as_f64().unwrap());
            let middle = 0.5 * bounds[0] + 0.5 * bounds[1];
            let value = [middle - 2e-11, middle + 2e-11];
            cycle["value_at_midpoint"][i] = json!(value);
            let mut image = value.map(|x| middle - by * (x - middle));
            image.sort_by(f64::total_cmp);
            // Outward by a unit in the last place, as the prover rounds.
            cycle["image"][i] = json!([image[0].next_down(), image[1].next_up()]);
            cycle["point"][i] = cycle["image"][i].clone();
        }
        cycle["trace"] = json!([a + b, a + b]);
        cycle["determinant"] = json!([a * b, a * b]);
    }

    #[test]
    #[ignore = "encloses orbits of four certificates, minutes in debug: make forge"]
    fn orbits_of_other_stability_or_that_do_not_close_or_that_meet_are_refused() {
        let checker = checker();
        for (to, from, derivative) in
            [("coexistence", "saddles", [0.5, 0.5]), ("saddles", "coexistence", [2.0, 0.5])]
        {
            let mut document = certificate(to);
            let cycle = &mut document["data"]["period three"];
            *cycle = certificate(from)["data"]["period three"].clone();
            of_other_stability(cycle, derivative);
            is_refused(&checker, &document, "holds what the checker computes");
        }

        // An orbit that does not close: the box and all that is in it, 1e-6 further on.
        let mut document = certificate("printed-cycle");
        for key in ["candidate", "value_at_midpoint", "image", "point"] {
            for bound in document["data"][key][0].as_array_mut().unwrap() {
                *bound = json!(bound.as_f64().unwrap() + 1.0 / 1_048_576.0);
            }
        }
        is_refused(
            &checker,
            &document,
            "an independent Krawczyk operator maps the candidate into itself",
        );

        // Two orbits that meet at their fourth crossing.
        let mut document = certificate("contraction");
        let last = document["data"]["orbits"][0]["crossings"][3].clone();
        document["data"]["orbits"][1]["crossings"][3]["x"] = last["x"].clone();
        document["data"]["orbits"][1]["crossings"][3]["z"] = last["z"].clone();
        document["data"]["distances"][0] = json!([0.0, 1e-16]);
        is_refused(&checker, &document, "holds what the checker computes");
    }
}

#[test]
fn missing_and_added_parts_are_refused_with_their_place() {
    for name in NAMES {
        let document = certificate(name);
        let mut without = document.clone();
        let data = without["data"].as_object_mut().unwrap();
        let key = data.keys().next().unwrap().clone();
        data.remove(&key);
        assert!(
            matches!(verify(&without.to_string()), Err(Refused::Unreadable(_))),
            "{name} without {key}"
        );
        let mut with = document.clone();
        with["data"]["more"] = json!(1);
        let Err(Refused::Unreadable(why)) = verify(&with.to_string()) else {
            panic!("{name} with more")
        };
        let place = ["column", "in data"].iter().any(|place| why.contains(place));
        assert!(why.contains("more") && place, "{why}");
    }
    // A certificate under another's name.
    let mut other = certificate("printed-cycle");
    other["theorem"] = json!("sensitivity");
    assert!(verify(&other.to_string()).is_err());
    other["theorem"] = json!("the last one");
    assert!(matches!(verify(&other.to_string()), Err(Refused::Unreadable(_))));
    // Numbers that no float holds, and no numbers.
    for absurd in ["1e999", "NaN", "1e99999999999", "null"] {
        let text = text("sensitivity").replacen("4.680675112015389", absurd, 1);
        assert!(matches!(verify(&text), Err(Refused::Unreadable(_))), "{absurd}");
    }
}

#[test]
fn exit_codes() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path().join("cert.json");
    let run = |text: &str| {
        fs::write(&at, text).unwrap();
        let output =
            Command::cargo_bin("twofold").unwrap().arg("verify").arg(&at).output().unwrap();
        (output.status.code().unwrap(), String::from_utf8_lossy(&output.stdout).into_owned())
    };
    let document = certificate("sensitivity");
    let (code, said) = run(&document.to_string());
    assert_eq!(code, 0, "{said}");
    assert!(said.contains("sensitivity: verified") && said.contains("9.90e-13 apart"), "{said}");
    let (code, said) = run(&forged(&document, "/data/states/x/0", json!("4.9e-5")).to_string());
    assert_eq!(code, 1, "{said}");
    assert!(said.contains("NOT VERIFIED"), "{said}");
    assert_eq!(run("{}").0, 2);
    assert_eq!(run("not json").0, 2);
}
