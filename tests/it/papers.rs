//! Papers as folders: `twofold paper`.
#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use tempfile::TempDir;
use twofold::folder::{Embedded, Folder};
use twofold::jeffrey_2013::Reading;
use twofold::paper::{ParameterReading, code, figures};

fn paper(arguments: &[&str], folder: &Path) -> (i32, String, String) {
    let (action, rest) = arguments.split_first().expect("an action");
    let run = Command::cargo_bin("twofold")
        .unwrap()
        .arg("paper")
        .arg(action)
        .arg(folder)
        .args(rest)
        .output()
        .unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (run.status.code().unwrap(), text(run.stdout), text(run.stderr))
}

/// The first claim's check.
const VALUE: &str = "check = \"value\"\nof = \"cycle\"\nread = \"period\"\n\
    equals = 2.1972245773362196\nwithin = 1e-6";

/// The paper that `twofold paper new` writes.
fn small() -> TempDir {
    let place = tempfile::tempdir().unwrap();
    let (code, _, said) = paper(&["new"], &place.path().join("p"));
    assert_eq!(code, 0, "{said}");
    place
}

fn change(root: &Path, file: &str, from: &str, to: &str) {
    let path = root.join(file);
    let text = fs::read_to_string(&path).unwrap();
    assert!(text.contains(from), "{file} has no {from:?}");
    fs::write(path, text.replace(from, to)).unwrap();
}

#[test]
fn a_new_paper_is_made_blessed_checked_and_reported() {
    let place = small();
    let root = place.path().join("p");
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(code == 1 && out.contains("fig1: NEW"), "{out}");
    let (code, out, _) = paper(&["bless", "--reason", "first", "--quiet"], &root);
    assert!(code == 0 && out.contains("fig1 (new)"), "{out}");
    let (code, out, _) = paper(&["check", "--quiet", "--fresh"], &root);
    assert!(code == 0 && out.contains("2 of 2 claims agree; all the same"), "{out}");
    let (code, out, _) = paper(&["report", "--quiet"], &root);
    assert!(code == 0 && out.contains("asks for datePublished (published) and license"), "{out}");
    let page = fs::read_to_string(root.join("out/report.html")).unwrap();
    assert!(page.contains("2 of 2 claims agree") && page.contains("fig1/fig1.png"), "{page}");
    let codecheck = fs::read_to_string(root.join("out/codecheck.yml")).unwrap();
    assert!(codecheck.contains("file: \"fig1/fig1.png\""), "{codecheck}");
    let metadata: serde_json::Value =
        serde_json::from_slice(&fs::read(root.join("out/ro-crate-metadata.json")).unwrap())
            .unwrap();
    let graph = metadata["@graph"].as_array().unwrap();
    for file in ["fig1/fig1.svg", "fig1/fig1.json", "codecheck.yml", "claims.json", "report.html"] {
        assert!(graph.iter().any(|e| e["@id"] == file && e["@type"] == "File"), "{file}");
        let parts = graph[1]["hasPart"].as_array().unwrap();
        assert!(parts.iter().any(|part| part["@id"] == file), "{file}");
        assert!(root.join("out").join(file).is_file(), "{file}");
    }
    // Blessed again, nothing is written.
    let before = fs::read(root.join("expected/CHANGES.md")).unwrap();
    let (_, out, _) = paper(&["bless", "--reason", "again", "--quiet"], &root);
    assert!(
        out.contains("nothing changed")
            && fs::read(root.join("expected/CHANGES.md")).unwrap() == before,
        "{out}"
    );
}

/// Archives are told the folder's day and licences.
#[test]
fn metadata_have_the_day_and_the_licences() {
    let place = small();
    let root = place.path().join("p");
    let given = "published = 2026-11-27\nlicense = \"MIT OR Apache-2.0\"\nauthors";
    change(&root, "paper.toml", "authors", given);
    let (code, out, said) = paper(&["report", "--quiet"], &root);
    assert!(code == 0 && !out.contains("asks for"), "{out}{said}");
    let bytes = fs::read(root.join("out/ro-crate-metadata.json")).unwrap();
    let metadata: serde_json::Value = serde_json::from_slice(&bytes).unwrap();
    let graph = metadata["@graph"].as_array().unwrap();
    assert_eq!(graph[1]["datePublished"], "2026-11-27");
    let licences: Vec<_> = graph[1]["license"].as_array().unwrap().iter().collect();
    let wanted = ["MIT", "Apache-2.0"].map(|name| format!("https://spdx.org/licenses/{name}"));
    assert!(licences.iter().map(|l| l["@id"].as_str().unwrap()).eq(wanted.iter()));
    assert!(licences.iter().all(|l| graph.iter().any(|e| e["@id"] == l["@id"])));
    change(&root, "paper.toml", "2026-11-27", "2026-11-27T10:00:00");
    let (code, _, said) = paper(&["report", "--quiet"], &root);
    assert!(code == 2 && said.contains("`published` is a day"), "{said}");
}

/// A paper's bytes depend neither on its place nor on the number of threads or a store.
#[test]
fn a_paper_is_the_same_bytes_wherever_it_lies() {
    let (here, there) = (small(), small());
    assert_eq!(
        paper(&["report", "--quiet", "--threads", "1", "--fresh"], &here.path().join("p")).0,
        0
    );
    assert_eq!(paper(&["report", "--quiet"], &there.path().join("p")).0, 0);
    let mut compared = 0;
    for file in [
        "claims.json",
        "report.html",
        "fig1/fig1.png",
        "fig1/fig1.svg",
        "fig1/fig1.pdf",
        "fig1/fig1.json",
        "fig1/fig1-a.csv",
    ] {
        let read = |place: &TempDir| fs::read(place.path().join("p/out").join(file)).unwrap();
        assert!(read(&here) == read(&there), "{file}");
        compared += 1;
    }
    assert_eq!(compared, 7);
}

/// The rule of a check is fixed before its data: what comes later is said.
#[test]
fn a_rule_that_changes_after_its_data_is_said_to() {
    let place = small();
    let root = place.path().join("p");
    assert_eq!(paper(&["bless", "--reason", "first", "--quiet"], &root).0, 0);
    change(&root, "claims.toml", "decided = 2026-11-26", "decided = 2001-01-01");
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(code == 1 && out.contains("DIFFERS in its rule's date"), "{out}");
    change(&root, "claims.toml", "decided = 2001-01-01", "decided = 2026-11-26");
    change(&root, "claims.toml", "within = 1e-6", "within = 1e-3");
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(
        code == 1 && out.contains("period: DIFFERS in its rule, changed when the data were known"),
        "{out}"
    );
    assert_eq!(paper(&["bless", "--reason", "wider", "--quiet"], &root).0, 0);
    assert_eq!(paper(&["report", "--quiet"], &root).0, 0);
    let page = fs::read_to_string(root.join("out/report.html")).unwrap();
    assert!(page.contains("changed when its data were known"), "{page}");
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(
        code == 0 && out.contains("period: same; its rule was written or changed when"),
        "{out}"
    );
    change(&root, "expected/claims.json", "2.197225 (", "2.297225 (");
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(code == 1 && out.contains("period: DIFFERS in its finding: 2.197225"), "{out}");
    let path = root.join("expected/claims.json");
    let mut all: serde_json::Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
    let first = all["verdicts"][0].clone();
    all["verdicts"].as_array_mut().unwrap().push(first);
    fs::write(&path, all.to_string()).unwrap();
    let (code, _, said) = paper(&["check", "--quiet"], &root);
    assert!(code == 2 && said.contains("two outcomes of claim period"), "{said}");
}

/// Advice about a file of `expected/` that cannot be read helps.
#[test]
fn advice_about_a_broken_expectation_works() {
    let place = small();
    let root = place.path().join("p");
    let bless = || paper(&["bless", "--reason", "first", "--quiet"], &root);
    assert_eq!(bless().0, 0);
    let advice =
        format!("or remove it and keep what is made: twofold paper bless {}", root.display());
    for (file, text) in [
        ("claims.json", "{"),
        ("claims.json", "{ \"version\": 7, \"verdicts\": [] }"),
        ("fig1.json", "{"),
        ("fig1.json", "{ \"version\": 7 }"),
    ] {
        let path = root.join("expected").join(file);
        fs::write(&path, text).unwrap();
        let (code, _, said) = paper(&["check", "--quiet"], &root);
        let wanted = [path.to_str().unwrap(), advice.as_str()];
        assert!(code == 2 && wanted.iter().all(|w| said.contains(w)), "{file}: {said}");
        fs::remove_file(&path).unwrap();
        let (code, _, said) = bless();
        assert_eq!(code, 0, "{said}");
        assert_eq!(paper(&["check", "--quiet"], &root).0, 0, "{file}");
    }
}

/// So are the words of a claim, which say what its rule is a measure of.
#[test]
fn words_that_change_after_their_data_are_said_to() {
    let place = small();
    let root = place.path().join("p");
    assert_eq!(paper(&["bless", "--reason", "first", "--quiet"], &root).0, 0);
    change(&root, "claims.toml", "The period is 2 ln(", "The period is just 2 ln(");
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    let said = "DIFFERS in its words, changed when the data were known";
    assert!(code == 1 && out.matches(said).count() == 1, "{out}");
    assert_eq!(paper(&["bless", "--reason", "other words", "--quiet"], &root).0, 0);
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    let said = "same; its words were changed when the data were known";
    assert!(code == 0 && out.matches(said).count() == 1, "{out}");
    assert_eq!(paper(&["report", "--quiet"], &root).0, 0);
    let page = fs::read_to_string(root.join("out/report.html")).unwrap();
    assert!(page.contains("its words changed when its data were known"), "{page}");
}

/// Whether a claim that is made now has a rule that came after its data.
fn rule_after_data(root: &Path, claim: &str) -> bool {
    let (code, out, said) = paper(&["make", "--quiet", "--json"], root);
    assert_eq!(code, 0, "{said}");
    let all: serde_json::Value = serde_json::from_str(&out).unwrap();
    let claims = all["claims"].as_array().unwrap();
    let found = claims.iter().find(|c| c["claim"] == claim).expect(claim);
    found["rule_after_data"].as_bool().unwrap()
}

/// So it is of a claim that is renamed, of other odds, and before anything is expected.
#[test]
fn a_rule_that_changes_is_seen_by_its_data() {
    let place = small();
    let root = place.path().join("p");
    let after = |claim: &str| rule_after_data(&root, claim);
    assert!(!after("period"));
    change(&root, "claims.toml", "within = 1e-6", "within = 1e-3");
    assert!(after("period"));
    fs::remove_dir_all(root.join("out")).unwrap();
    assert!(!after("period"));
    // A name alone is no rule.
    change(&root, "claims.toml", "id = \"period\"", "id = \"cycle-time\"");
    assert!(!after("cycle-time"));
    change(&root, "claims.toml", "within = 1e-3", "within = 1e-2");
    change(&root, "claims.toml", "id = \"cycle-time\"", "id = \"time\"");
    assert!(after("time"));
    fs::remove_dir_all(root.join("out")).unwrap();
    let odds = "within = 1e-2\nodds = { starts = 2, spread = 1e-3, seed = 1 }";
    change(&root, "claims.toml", "within = 1e-2", odds);
    assert!(!after("time"));
    change(&root, "claims.toml", "seed = 1", "seed = 2");
    assert!(after("time"));
    assert_eq!(paper(&["bless", "--reason", "first", "--quiet"], &root).0, 0);
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(code == 0 && out.contains("time: same; its rule was written or changed"), "{out}");
}

/// The mark stays with the rule: neither other data nor a second claim in between take it away.
#[test]
fn a_rule_after_its_data_stays_one() {
    let place = small();
    let root = place.path().join("p");
    let made = |claim: &str| rule_after_data(&root, claim);
    assert_eq!(paper(&["bless", "--reason", "first", "--quiet"], &root).0, 0);
    // Other data, made once, and then a rule for them.
    let system = "systems/relay.toml";
    change(&root, system, "w = 0.5", "w = 0.6");
    made("period");
    change(&root, "claims.toml", "within = 1e-6", "within = 1e-3");
    assert!(made("period"));
    // Data that change afterwards.
    change(&root, system, "w = 0.6", "w = 0.5");
    assert!(made("period"));
    // The same rule in a claim of another name, first beside the old one, then alone.
    let claims = fs::read_to_string(root.join("claims.toml")).unwrap();
    let from = claims.find("[[claim]]").unwrap();
    let next = claims[from + 1..].find("[[claim]]").map_or(claims.len(), |i| from + 1 + i);
    let second = claims[from..next]
        .replace("id = \"period\"", "id = \"again\"")
        .replace("within = 1e-3", "within = 1e-2");
    fs::write(root.join("claims.toml"), format!("{claims}\n{second}")).unwrap();
    assert!(made("again"));
    fs::write(root.join("claims.toml"), format!("{}{second}{}", &claims[..from], &claims[next..]))
        .unwrap();
    assert!(made("again"));
}

/// A wrong value is found to be wrong, and exit codes tell a difference from a failure.
#[test]
fn a_claim_that_does_not_hold_differs() {
    let place = small();
    let root = place.path().join("p");
    change(&root, "claims.toml", "equals = 2.1972245773362196", "equals = 2.3");
    let (code, out, _) = paper(&["make", "--quiet"], &root);
    assert!(code == 0 && out.contains("period: differs: 2.197225 (2.3 claimed"), "{out}");
    change(&root, "claims.toml", "read = \"period\"", "read = \"point/7\"");
    let (code, out, _) = paper(&["make", "--quiet"], &root);
    assert!(code == 3 && out.contains("\"point/7\": there is no \"7\""), "{out}");
    let (code, _, said) = paper(&["bless", "--reason", "x", "--quiet"], &root);
    assert!(code == 3 && said.contains("what fails is not blessed"), "{said}");
    let (_, out, _) = paper(&["check", "--quiet"], &root);
    assert!(out.contains("; once nothing fails keep them: twofold paper bless"), "{out}");
}

/// The ends of all paths in a JSON value, which are no lists or tables.
fn leaves(path: String, value: &serde_json::Value) -> Vec<(String, &serde_json::Value)> {
    let at = |name: &dyn std::fmt::Display| {
        if path.is_empty() { name.to_string() } else { format!("{path}/{name}") }
    };
    match value {
        serde_json::Value::Array(list) => {
            list.iter().enumerate().flat_map(|(i, inner)| leaves(at(&i), inner)).collect()
        }
        serde_json::Value::Object(map) => {
            map.iter().flat_map(|(name, inner)| leaves(at(name), inner)).collect()
        }
        leaf => vec![(path, leaf)],
    }
}

/// Claims are refused that read what is no number of any answer: the list has those that are.
#[test]
fn all_facts_of_answers_may_be_read() {
    use twofold::folder::words::Ask;
    let asked = |command: &str, arguments: &str, ask: Ask| {
        let out = Command::new(env!("CARGO_BIN_EXE_twofold"))
            .arg(command)
            .args(arguments.split(' '))
            .args(["--format", "json", "--quiet"])
            .output()
            .unwrap();
        let answer: serde_json::Value = serde_json::from_slice(&out.stdout)
            .unwrap_or_else(|e| panic!("{e}: {command} {arguments}: {out:?}"));
        let leaves = leaves(String::new(), &answer["facts"]).into_iter();
        for (path, value) in leaves.filter(|(_, value)| !value.is_null()) {
            assert_eq!(
                ask.has_number(&path, false),
                value.is_number(),
                "{command} {arguments}: {path}: {value}"
            );
            if let Some(of) = path.strip_suffix("/0") {
                let complex = of.contains("multipliers") || of.contains("eigenvalues");
                assert_eq!(ask.has_number(of, true), complex, "{command} {arguments}: {of}");
            }
        }
    };
    asked("run", "--system caricature --t-end 1", Ask::Run);
    asked("run", "--system caricature --t-end 1 --switch relay --band 0.01", Ask::Run);
    asked("run", "--system buck --t-end 0.001", Ask::Run);
    asked("orbit", "--system stick-slip --section v=0", Ask::Orbit);
    asked("orbit", "--system buck --period 400e-6 --settle 0.05 --along input=23..24", Ask::Orbit);
    asked("lyapunov", "--system caricature --t-end 20", Ask::Lyapunov);
    asked("lyapunov", "--system buck --t-end 0.01", Ask::Lyapunov);
    asked("rests", "--system relay-hysteresis", Ask::Rests);
}

/// All crossings of a section of one state are one point, whatever the motion does.
#[test]
fn a_section_of_one_state_is_not_scored() {
    let place = small();
    let root = place.path().join("p");
    let measure = "\n[crossings]\nrun = { system = \"systems/relay.toml\", t-end = 100, section = \
                   \"x=0\" }\n";
    let claim = "\n[[claim]]\nid = \"one\"\nplace = \"-\"\nsays = \"-\"\ndecided = 2026-11-27\n\
                 check = \"period\"\nof = \"crossings\"\nis = 1\n";
    for (file, more) in [("measures.toml", measure), ("claims.toml", claim)] {
        let text = fs::read_to_string(root.join(file)).unwrap();
        fs::write(root.join(file), text + more).unwrap();
    }
    let (code, _, said) = paper(&["make", "--quiet"], &root);
    let wanted = ["`crossings` is a section of a system with one state", "claims.toml:"];
    assert!(code == 2 && wanted.iter().all(|w| said.contains(w)), "{said}");
    // One that depends on the time, too, is a point of time.
    change(&root, "measures.toml", "section = \"x=0\"", "section = \"x=sin(t)\"");
    assert_eq!(paper(&["make", "--quiet"], &root).0, 0);
}

/// The ratio of a number at two values of a parameter: with it the exponent of a law is scored.
#[test]
fn a_ratio_is_of_two_measures() {
    let place = small();
    let root = place.path().join("p");
    // Periods are 2 ln((1 + w)/(1 - w)): ln(11/9)/ln 3 is their ratio at w = 0.1 and 0.5.
    let ratio = "0.18265833864413814";
    let from = "check = \"order\"\nof = \"narrow-cycle\"\nand = \"cycle\"\nread \
        = \"period\"\nrelation = \"less\"";
    let to = format!(
        "check = \"ratio\"\nof = \"narrow-cycle\"\nand = \"cycle\"\nread = \"period\"\nequals = \
            {ratio}\nwithin = 1e-6"
    );
    change(&root, "claims.toml", from, &to);
    let (code, out, said) = paper(&["make", "--quiet"], &root);
    assert!(code == 0 && out.contains("2 of 2 claims agree"), "{out}{said}");
    change(&root, "claims.toml", ratio, "0.5");
    let (_, out, _) = paper(&["make", "--quiet"], &root);
    assert!(out.contains("narrower-is-faster: differs") && out.contains("0.5 claimed"), "{out}");
}

/// The share of starts in which a check holds.
#[test]
fn a_check_has_odds_from_other_starts() {
    let place = small();
    let root = place.path().join("p");
    let claim = "\n[[claim]]\nid = \"above\"\nplace = \"-\"\nsays = \"It ends above \
        zero.\"\ndecided = 2026-11-26\n\
                 check = \"order\"\nof = \"end\"\nread = \"x/0\"\nrelation = \"greater\"\nthan = \
                 0\nodds = { starts = 40, spread = 1, at-least = 0.9 }\n";
    let mut text = fs::read_to_string(root.join("claims.toml")).unwrap();
    text.push_str(claim);
    fs::write(root.join("claims.toml"), text).unwrap();
    let mut text = fs::read_to_string(root.join("measures.toml")).unwrap();
    // x' = -x keeps its sign: it ends above zero if it starts there.
    text.push_str("\n[end]\nrun = { system = \"systems/decay.toml\", t-end = 1 }\n");
    fs::write(root.join("measures.toml"), text).unwrap();
    fs::write(root.join("systems/decay.toml"), "states = [\"x\"]\nstart = [0.1]\nf = [\"-x\"]\n")
        .unwrap();
    let (code, out, said) = paper(&["make", "--json"], &root);
    assert_eq!(code, 0, "{said}");
    // Progress says for what it computes.
    let odds = ["odds of above, run 1 of 40: ", "odds of above, run 40 of 40: "];
    for purpose in ["fig1/a: ", "cycle: ", "end: "].iter().chain(&odds) {
        let lines = said.lines().filter(|line| line.starts_with(purpose));
        assert_eq!(lines.count(), 1, "{purpose}: {said}");
    }
    let out: serde_json::Value = serde_json::from_str(&out).unwrap();
    let found = out["claims"].as_array().unwrap().iter().find(|c| c["claim"] == "above").unwrap();
    let hits = found["odds"][0].as_u64().unwrap();
    // 0.1 + u with u uniform in [-1, 1]: 0.55 of them; 40 draws lie within five standard
    // deviations.
    assert!((7..=37).contains(&hits) && found["odds"][1] == 40, "{found}");
    assert_eq!(found["outcome"], "differs", "{found}");
}

/// From some starts the motion rests and has no period: the claim does not hold of them.
#[test]
fn a_start_that_cannot_be_scored_counts_against_a_claim() {
    let place = small();
    let root = place.path().join("p");
    let odds = "within = 1e-6\nodds = { starts = 20, spread = 1 }";
    change(&root, "claims.toml", "within = 1e-6", odds);
    let (code, out, said) = paper(&["make", "--quiet", "--json"], &root);
    assert_eq!(code, 0, "{said}");
    let out: serde_json::Value = serde_json::from_str(&out).unwrap();
    let found = out["claims"].as_array().unwrap().iter().find(|c| c["claim"] == "period").unwrap();
    let (hits, words) = (found["odds"][0].as_u64().unwrap(), found["found"].as_str().unwrap());
    assert!(hits > 0 && hits < 20 && found["odds"][1] == 20, "{found}");
    let against = format!("{} of them cannot be scored and count as against it", 20 - hits);
    assert!(words.contains(&format!("holds in {hits} of 20")) && words.ends_with(&against));
}

/// The papers that ship give the pictures and outcomes that are kept with them.
#[test]
fn papers_that_ship_are_reproduced() {
    let papers = Path::new(env!("CARGO_MANIFEST_DIR")).join("papers");
    let mut checked = 0;
    for entry in fs::read_dir(papers).unwrap() {
        let root = entry.unwrap().path();
        // Figures of the first paper are the golden ones: their runs are long.
        if !root.join("paper.toml").is_file() || root.ends_with("jeffrey-2013") {
            continue;
        }
        // Made in a copy: a test leaves the repository as it is.
        let place = tempfile::tempdir().unwrap();
        let copy = place.path().join("p");
        for part in ["", "systems", "figures", "data", "expected"] {
            let Ok(files) = fs::read_dir(root.join(part)) else { continue };
            fs::create_dir_all(copy.join(part)).unwrap();
            for file in files.map(|f| f.unwrap().path()).filter(|f| f.is_file()) {
                fs::copy(&file, copy.join(part).join(file.file_name().unwrap())).unwrap();
            }
        }
        let (code, out, error) = paper(&["check", "--fresh", "--quiet"], &copy);
        assert_eq!(code, 0, "{}: {out}{error}", root.display());
        checked += 1;
    }
    assert!(checked > 0, "no paper in papers/");
}

/// Bad input: what is wrong, where, what to do; exit code 2 and nothing written.
#[test]
fn what_is_wrong_in_a_folder_is_said_with_its_place() {
    let reading = "[readings.a]\nabout = \"\"\nextends = \"b\"\n[readings.b]\nabout \
        = \"\"\nextends = \"a\"\n[run]";
    let panel = |i: i32| {
        format!(
            "[[panel]]\nlabel = \"p{i}\"\ndraw = \"series\"\nrun = {{ system = \
                \"systems/relay.toml\", t-end = 1 }}\n"
        )
    };
    let many: String = (0..40).map(panel).chain(["[[panel]]\nlabel = \"a\"".into()]).collect();
    let cases: [(&str, &str, &str, &[&str]); 46] = [
        (
            "paper.toml",
            "rtol = 1e-9",
            "rtoll = 1e-9",
            &["unknown key `rtoll`", "paper.toml:16:1", "did you mean `rtol`?"],
        ),
        ("paper.toml", "format = 1", "format = 2", &["format 2 is not known", "paper.toml:2:10"]),
        ("paper.toml", "title =", "titel =", &["unknown field `titel`", "paper.toml:3:1"]),
        ("paper.toml", "[run]", reading, &["readings extend each other in a circle: a -> b -> a"]),
        (
            "figures/fig1.toml",
            "t-end = 12",
            "t-edn = 12",
            &["unknown key `t-edn`", "fig1.toml:10:40", "did you mean `t-end`?"],
        ),
        (
            "figures/fig1.toml",
            "t-end = 12",
            "t-end = \"x\"",
            &["invalid value 'x'", "fig1.toml:10:40"],
        ),
        (
            "figures/fig1.toml",
            "t-end = 12",
            "t-end = { a = 1 }",
            &["`t-end` is a table", "fig1.toml:10:48"],
        ),
        (
            "figures/fig1.toml",
            "t-end = 12",
            "t-end = 12, out = \"../x\"",
            &["`out` is not part of a question"],
        ),
        (
            "figures/fig1.toml",
            "t-end = 12",
            "t-end = 12, eps = 1",
            &["--eps has no effect", "fig1.toml:10:"],
        ),
        (
            "figures/fig1.toml",
            "label = \"b\"",
            "label = \"a\"",
            &["two panels `a`", "fig1.toml:13:9"],
        ),
        (
            "figures/fig1.toml",
            "label = \"b\"",
            "label = \"../b\"",
            &["the label `../b` is no plain name"],
        ),
        (
            "figures/fig1.toml",
            "draw = \"series\"",
            "draw = \"serie\"",
            &["unknown variant `serie`", "fig1.toml:9:8"],
        ),
        (
            "figures/fig1.toml",
            "systems/relay.toml",
            "../p/systems/relay.toml",
            &["does not lie in this folder", "fig1.toml:10:9"],
        ),
        (
            "figures/fig1.toml",
            "systems/relay.toml",
            "systems/reley.toml",
            &["there is no system `systems/reley.toml`"],
        ),
        (
            "figures/fig1.toml",
            "label = \"b\"",
            "label = \"a-events\"",
            &["panel `a-events` begins with panel `a` and -", "files of one name"],
        ),
        (
            "claims.toml",
            "of = \"cycle\"",
            "of = \"cycel\"",
            &["no panel or measure `cycel`", "did you mean `cycle`?"],
        ),
        ("claims.toml", "read = \"period\"", "", &["the claim reads nothing", "claims.toml:2:1"]),
        (
            "claims.toml",
            "read = \"period\"\nequals",
            "read = \"period\"\ncolumn = \"t\"\ntake = \"last\"\nequals",
            &["the claim reads a fact and a column", "claims.toml:10:10"],
        ),
        (
            "claims.toml",
            "relation = \"less\"",
            "relation = \"less\"\nthan = 3",
            &["`than` and `and` are both given", "claims.toml:23:8"],
        ),
        (
            "claims.toml",
            VALUE,
            "check = \"chaos\"\nof = \"cycle\"",
            &["`cycle` asks for a closed orbit", "lyapunov", "claims.toml:8:6"],
        ),
        (
            "claims.toml",
            VALUE,
            "check = \"period\"\nof = \"cycle\"\nis = 1",
            &["`cycle` asks for a closed orbit", "section", "claims.toml:8:6"],
        ),
        (
            "claims.toml",
            "decided = 2026-11-26",
            "decided = 10:00:00",
            &["`decided` is a day, and this is 10:00:00"],
        ),
        (
            "claims.toml",
            "check = \"value\"",
            "check = \"valeu\"",
            &["no check `valeu`", "did you mean `value`?"],
        ),
        (
            "claims.toml",
            "within = 1e-6",
            "within = 1e-6\nsame = true",
            &["`same` has no effect on a check of value"],
        ),
        (
            "claims.toml",
            "check = \"value\"",
            "check = \"ratio\"",
            &["a check of ratio needs `and`", "claims.toml:2:1"],
        ),
        (
            "figures/fig1.toml",
            "draw = \"series\"",
            "labels = [\"t\", \"x\"]\ndraw = \"series\"",
            &["`labels` has no effect on draw = \"series\""],
        ),
        (
            "figures/fig1.toml",
            "draw = \"series\"",
            "dots = true\ndraw = \"series\"",
            &["`dots` has no effect on draw = \"series\"", "fig1.toml:9:8"],
        ),
        (
            "figures/fig1.toml",
            "draw = \"series\"",
            "camera = [1, 2]\ndraw = \"series\"",
            &["`camera` has no effect on draw = \"series\""],
        ),
        (
            "claims.toml",
            "check = \"value\"\nof = \"cycle\"\nread = \"period\"\nequals = 2.1972245773362196",
            "check = \"bifurcation\"\nkind = \"foldd\"\nat = 1\nof = \"cycle\"",
            &["there is no bifurcation `foldd`", "did you mean `fold`?"],
        ),
        (
            "claims.toml",
            "check = \"value\"\nof = \"cycle\"\nread = \"period\"\nequals = 2.1972245773362196",
            "check = \"bifurcation\"\nkind = \"fold\"\nat = 1\nof = \"cycle\"",
            &["`cycle` follows no branch", "along = \"PARAMETER=FROM..TO\""],
        ),
        (
            "claims.toml",
            "read = \"period\"",
            "read = \"perod\"",
            &["no answer has a number `perod`", "did you mean `period`?", "claims.toml:9:8"],
        ),
        (
            "claims.toml",
            "read = \"period\"\nequals",
            "read = \"period/0\"\nequals",
            &["`period/0` is no number of an answer", "give period", "claims.toml:9:8"],
        ),
        (
            "claims.toml",
            "read = \"period\"\nequals",
            "read = \"states/0\"\nequals",
            &["no answer has a number `states`", "there are point, period", "claims.toml:9:8"],
        ),
        (
            "claims.toml",
            "read = \"period\"\nequals",
            "read = \"multipliers/0\"\nequals",
            &["`multipliers/0` is no number", "give multipliers/N/0 or multipliers/N/1"],
        ),
        (
            "claims.toml",
            "read = \"period\"\nequals",
            "read = \"period\"\ntake = \"modulus\"\nequals",
            &["`period` is no complex number", "leave out take", "claims.toml:9:8"],
        ),
        (
            "claims.toml",
            VALUE,
            "check = \"period\"\nof = \"fig1/a\"\nis = 1",
            &["`fig1/a` records no crossings", "section = \"y=0\"", "claims.toml:8:6"],
        ),
        (
            "figures/fig1.toml",
            "w = 0.1 }, t-end = 12",
            "w = 0.1 }, t-end = 12, section = \"x=0\"",
            &["this picture needs the path", "fig1.toml:16:71"],
        ),
        (
            "figures/fig1.toml",
            "A relay with hysteresis oscillates",
            "A relay_{with hysteresis",
            &["unbalanced braces", "fig1.toml:1:9"],
        ),
        (
            "figures/fig1.toml",
            "title = \"w = 0.1\"",
            "title = \"w \\u4e2d {\"",
            &["has no glyph for '\u{4e2d}'", "fig1.toml:14:9"],
        ),
        (
            "figures/fig1.toml",
            "columns = 1",
            "columns = 1\n[[panel]]\nlabel = \"c\"\ndraw = \"columns\"\nof = \"cycle\"\nx = \
                \"\u{4e2d}\"\ny = [\"x\"]\nlabels = [\"a\", \"\u{3042}\"]",
            &["has no glyph for '\u{3042}'", "fig1.toml:11:10"],
        ),
        (
            "figures/fig1.toml",
            "[[panel]]\nlabel = \"a\"",
            &many,
            &["the picture is too large", "fig1.toml:"],
        ),
        (
            "figures/fig1.toml",
            "[[panel]]\nlabel = \"b\"",
            "[[panel]]\nlabel = \"c\"\ndraw = \"columns\"\nof = \"fig1/a\"\nx = \"t\"\ny = \
                [\"x\"]\nnames = []\n[[panel]]\nlabel = \"b\"",
            &["0 names for 1 columns", "fig1.toml"],
        ),
        (
            "claims.toml",
            "and = \"cycle\"",
            "and = \"narrow-cycle\"",
            &["`narrow-cycle` is the same as `of`", "claims.toml:", "name another"],
        ),
        (
            "figures/fig1.toml",
            "draw = \"series\"",
            "draw = \"series\"\npoints = { name = \"a\", file = \"systems\" }",
            &["systems: it is a folder", "fig1.toml:10:10"],
        ),
        (
            "paper.toml",
            "title =",
            "code = \"none\"\ntitle =",
            &["no code called `none`", "paper.toml:3:8", "leave `code` out"],
        ),
        (
            "measures.toml",
            "orbit = {",
            "lyapunov = {}\norbit = {",
            &["asks no question, or more than one", "measures.toml:2:1"],
        ),
    ];
    for (file, from, to, said) in cases {
        let place = small();
        let root = place.path().join("p");
        change(&root, file, from, to);
        let (code, out, error) = paper(&["make", "--quiet"], &root);
        assert_eq!(code, 2, "{to}: {out}{error}");
        assert!(said.iter().all(|s| error.contains(s)), "{to}: {error}");
        assert!(!root.join("out").exists(), "{to}");
    }
}

#[test]
fn names_that_differ_in_case_alone_are_refused() {
    let place = small();
    let root = place.path().join("p");
    change(&root, "figures/fig1.toml", "label = \"b\"", "label = \"A\"");
    let (code, _, said) = paper(&["make", "--quiet"], &root);
    assert!(code == 2 && said.contains("panel `a` and panel `A` differ in case"), "{said}");
    change(&root, "figures/fig1.toml", "label = \"A\"", "label = \"b\"");
    let systems: Vec<_> = fs::read_dir(root.join("systems")).unwrap().flatten().collect();
    let system = systems[0].file_name().into_string().unwrap();
    for (part, name) in [("figures", "fig1.toml"), ("systems", system.as_str())] {
        let (one, other) = (root.join(part).join(name), root.join(part).join(name.to_uppercase()));
        let count = || fs::read_dir(root.join(part)).unwrap().count();
        let before = count();
        fs::copy(one, &other).unwrap();
        // Where they are one file there is nothing to refuse.
        if count() > before {
            let (code, _, said) = paper(&["make", "--quiet"], &root);
            let twins = format!("{part}/{} and {part}/{name} differ in case", name.to_uppercase());
            assert!(code == 2 && said.contains(&twins), "{said}");
            fs::remove_file(other).unwrap();
        }
    }
}

#[test]
fn two_figures_have_no_picture_of_one_name() {
    let place = small();
    let root = place.path().join("p");
    fs::remove_dir_all(root.join("expected")).ok();
    let text = fs::read_to_string(root.join("paper.toml")).unwrap();
    let readings = "\n[readings.b]\nabout = \"x\"\n[readings.a-b]\nabout = \"y\"\n";
    fs::write(root.join("paper.toml"), text + readings).unwrap();
    fs::copy(root.join("figures/fig1.toml"), root.join("figures/fig1-a.toml")).unwrap();
    let (code, _, said) = paper(&["make", "--quiet"], &root);
    assert!(code == 2 && said.contains("another figure has a picture called fig1-a-b"), "{said}");
}

/// Points of the paper are data of a picture, though their marker may not move by a pixel.
#[test]
fn points_are_part_of_the_data() {
    let place = small();
    let root = place.path().join("p");
    let text = fs::read_to_string(root.join("figures/fig1.toml")).unwrap();
    let points = "\npoints = { name = \"paper\", file = \"p.csv\" }\n";
    fs::write(root.join("figures/fig1.toml"), text + points).unwrap();
    fs::write(root.join("p.csv"), "t,x\n3,0.05\n").unwrap();
    assert_eq!(paper(&["bless", "--reason", "first", "--quiet"], &root).0, 0);
    assert_eq!(paper(&["check", "--quiet"], &root).0, 0);
    fs::write(root.join("p.csv"), "t,x\n3,0.05000001\n").unwrap();
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(code == 1 && out.contains("fig1: DIFFERS in its data (panel b)"), "{out}");
}

/// A column that the answer does not have is named with its place and those that there are.
#[test]
fn a_misspelt_column_has_a_place() {
    let panel = "[[panel]]\nlabel = \"c\"\ndraw = \"columns\"\nof = \"fig1/a\"\nx = \"t\"\ny = \
                 [\"x\", \"xx\"]\n[[panel]]\nlabel = \"b\"";
    let claim = "check = \"value\"\nof = \"fig1/a\"\ncolumn = \"y\"\ntake = \"max\"\nequals = \
                 1\nwithin = 1";
    let table = claim.replace("\"y\"", "\"x\"\ntable = \"pathway\"");
    for (file, from, to, said) in [
        (
            "figures/fig1.toml",
            "[[panel]]\nlabel = \"b\"",
            panel,
            ["no column of numbers \"xx\"", "fig1.toml:17:11", "it has t, x"],
        ),
        (
            "claims.toml",
            VALUE,
            claim,
            ["column of numbers \"y\"", "claims.toml:9:10", "it has t, x"],
        ),
        ("claims.toml", VALUE, &table, ["no table \"pathway\"", "claims.toml:10:9", "it has path"]),
    ] {
        let place = small();
        let root = place.path().join("p");
        change(&root, file, from, to);
        let (code, _, error) = paper(&["make", "--quiet"], &root);
        assert!(code == 2 && said.iter().all(|s| error.contains(s)), "{to}: {code} {error}");
    }
}

/// A link that leads out of the folder is not followed.
#[cfg(unix)]
#[test]
fn a_system_behind_a_link_is_refused() {
    let place = small();
    let root = place.path().join("p");
    let outside = place.path().join("relay.toml");
    fs::rename(root.join("systems/relay.toml"), &outside).unwrap();
    std::os::unix::fs::symlink(&outside, root.join("systems/relay.toml")).unwrap();
    let (code, _, error) = paper(&["make", "--quiet"], &root);
    assert!(code == 2 && error.contains("does not lie in this folder"), "{error}");
}

#[cfg(unix)]
#[test]
fn a_table_behind_a_link_is_refused() {
    let place = small();
    let root = place.path().join("p");
    let measure = "\n[driven]\nrun = { system = \"./systems/driven.toml\", t-end = 1 }\n";
    let measures = fs::read_to_string(root.join("measures.toml")).unwrap();
    fs::write(root.join("measures.toml"), measures + measure).unwrap();
    let driven = "states = [\"x\"]\nstart = [0]\nf = [\"u\"]\n[tables.u]\nfile = \
                  \"u.csv\"\ntime = \"t\"\ncolumn = \"u\"\n";
    fs::write(root.join("systems/driven.toml"), driven).unwrap();
    let table = root.join("systems/u.csv");
    fs::write(&table, "t,u\n0,0\n1,1\n").unwrap();
    assert_eq!(paper(&["make", "--quiet"], &root).0, 0);
    // One that stays in the folder is followed.
    fs::rename(&table, root.join("u.csv")).unwrap();
    std::os::unix::fs::symlink("../u.csv", &table).unwrap();
    assert_eq!(paper(&["make", "--quiet"], &root).0, 0);
    fs::rename(root.join("u.csv"), place.path().join("u.csv")).unwrap();
    fs::remove_file(&table).unwrap();
    std::os::unix::fs::symlink("../../u.csv", &table).unwrap();
    let (code, _, error) = paper(&["make", "--quiet"], &root);
    let wanted = ["systems/u.csv: a link that leads out", "measures.toml:", "put the file itself"];
    assert!(code == 2 && wanted.iter().all(|w| error.contains(w)), "{error}");
}

/// Words of a paper reach its page as text.
/// A later place gives a parameter another value; a file of points has names above them.
#[test]
fn a_panel_sets_a_parameter_again_and_points_have_a_header() {
    let place = small();
    let root = place.path().join("p");
    let folder = || twofold::folder::Folder::read(&root);
    // Panel b sets it to 0.1.
    change(&root, "paper.toml", "rtol = 1e-9", "rtol = 1e-9\nset = { w = 0.3 }");
    assert_eq!(folder().err().map(|e| e.to_string()), None);
    let again = fs::read_to_string(root.join("figures/fig1.toml")).unwrap();
    fs::create_dir(root.join("data")).unwrap();
    let points = "\npoints = { name = \"paper\", file = \"data/p.csv\" }\n";
    fs::write(root.join("figures/fig1.toml"), again + points).unwrap();
    for (text, wanted) in [
        ("t,x\n3,0.05\n", None),
        ("3,0.05\n6,0.1\n", Some("its first line is two numbers")),
        ("t,x\n3,0.05\n6,?\n", Some("line 3: `6,?` is not two numbers")),
        ("t,x\n", Some("has no points")),
    ] {
        fs::write(root.join("data/p.csv"), text).unwrap();
        let said = folder().err().map(|e| e.to_string());
        match wanted {
            None => assert_eq!(said, None),
            Some(words) => assert!(said.as_ref().is_some_and(|s| s.contains(words)), "{said:?}"),
        }
    }
}

/// A figure whose file was taken away is missed, and a link in `out` is not written through.
#[test]
fn what_is_expected_and_gone_is_missed_and_links_are_refused() {
    let place = small();
    let root = place.path().join("p");
    fs::copy(root.join("figures/fig1.toml"), root.join("figures/fig2.toml")).unwrap();
    assert_eq!(paper(&["bless", "--reason", "first", "--quiet"], &root).0, 0);
    fs::remove_file(root.join("figures/fig2.toml")).unwrap();
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(code == 1 && out.contains("fig2: GONE"), "{out}");
    let (code, out, _) = paper(&["bless", "--reason", "gone", "--quiet"], &root);
    assert!(code == 0 && out.contains("fig2 (gone)"), "{out}");
    assert!(!root.join("expected/fig2.json").exists());
    assert_eq!(paper(&["check", "--quiet"], &root).0, 0);
    #[cfg(unix)]
    {
        let foreign = place.path().join("foreign");
        fs::write(&foreign, "kept").unwrap();
        fs::remove_file(root.join("out/fig1/fig1.svg")).unwrap();
        std::os::unix::fs::symlink(&foreign, root.join("out/fig1/fig1.svg")).unwrap();
        let (code, _, said) = paper(&["make", "--quiet"], &root);
        assert!(code == 2 && said.contains("out/fig1/fig1.svg: a link"), "{said}");
        assert_eq!(fs::read_to_string(&foreign).unwrap(), "kept");
        fs::remove_dir_all(root.join("out")).unwrap();
        fs::create_dir(place.path().join("elsewhere")).unwrap();
        std::os::unix::fs::symlink(place.path().join("elsewhere"), root.join("out")).unwrap();
        assert_eq!(paper(&["make", "--quiet"], &root).0, 2);
        fs::remove_file(root.join("out")).unwrap();
        // An environment of Python beside the paper's files is full of links.
        fs::create_dir(root.join("venv")).unwrap();
        std::os::unix::fs::symlink("/usr/bin/env", root.join("venv/python")).unwrap();
        assert_eq!(paper(&["make", "--quiet"], &root).0, 0);
        fs::rename(root.join("claims.toml"), &foreign).unwrap();
        std::os::unix::fs::symlink(&foreign, root.join("claims.toml")).unwrap();
        let (code, _, said) = paper(&["make", "--quiet"], &root);
        assert!(code == 2 && said.contains("leads out of the paper's folder"), "{said}");
    }
}

/// Files that the program wrote of a figure or panel that is gone go from `out`, and no others.
#[test]
fn pictures_of_figures_that_are_gone_are_removed() {
    let place = small();
    let root = place.path().join("p");
    let out = |file: &str| root.join("out").join(file);
    let make = || {
        let (code, _, said) = paper(&["make", "--quiet"], &root);
        assert_eq!(code, 0, "{said}");
    };
    fs::copy(root.join("figures/fig1.toml"), root.join("figures/fig2.toml")).unwrap();
    fs::copy(root.join("figures/fig1.toml"), root.join("figures/fig3.toml")).unwrap();
    make();
    for figure in ["fig2", "fig3"] {
        fs::remove_file(root.join(format!("figures/{figure}.toml"))).unwrap();
    }
    // Files of others, one of them in the place of one of ours.
    fs::write(out("fig2/fig2.svg"), "mine").unwrap();
    fs::write(out("fig2/notes.json"), "{}").unwrap();
    fs::write(out("notes.txt"), "mine").unwrap();
    let mut files = fs::read_dir(out("fig1")).unwrap().count();
    make();
    assert!(!out("fig3").exists());
    let mut left: Vec<_> =
        fs::read_dir(out("fig2")).unwrap().map(|e| e.unwrap().file_name()).collect();
    left.sort();
    assert_eq!(left, ["fig2.svg", "notes.json"]);
    assert_eq!(fs::read_to_string(out("notes.txt")).unwrap(), "mine");
    assert_eq!(fs::read_dir(out("fig1")).unwrap().count(), files);
    // A panel of a figure that stays.
    let text = fs::read_to_string(root.join("figures/fig1.toml")).unwrap();
    let (first, _) = text.rsplit_once("[[panel]]").unwrap();
    fs::write(root.join("figures/fig1.toml"), first).unwrap();
    assert!(out("fig1/fig1-b.csv").is_file());
    files -= fs::read_dir(out("fig1"))
        .unwrap()
        .filter(|e| {
            let name = e.as_ref().unwrap().file_name().into_string().unwrap();
            name.starts_with("fig1-b")
        })
        .count();
    make();
    assert_eq!(fs::read_dir(out("fig1")).unwrap().count(), files);
    assert!(!out("fig1/fig1-b.csv").exists() && out("fig1/fig1-a.csv").is_file());
}

/// Titles and captions are parts of a picture: with another one it is another picture, which is
/// said until it is blessed, with a reason.
#[test]
fn titles_and_captions_that_change_are_differences() {
    let place = small();
    let root = place.path().join("p");
    assert_eq!(paper(&["bless", "--reason", "first", "--quiet"], &root).0, 0);
    for (old, new, layer) in [
        ("A relay with hysteresis oscillates", "A relay oscillates", "pixels"),
        ("title = \"w = 0.5\"", "title = \"w = 1/2\"", "pixels"),
        ("The state against time", "The state over time", "PNG file"),
    ] {
        change(&root, "figures/fig1.toml", old, new);
        let (code, out, _) = paper(&["check", "--quiet"], &root);
        assert!(
            code == 1 && out.contains(&format!("fig1: DIFFERS in its {layer}")),
            "{new}: {out}"
        );
        assert_eq!(paper(&["bless", "--reason", new, "--quiet"], &root).0, 0);
        let changes = fs::read_to_string(root.join("expected/CHANGES.md")).unwrap();
        assert!(changes.ends_with(&format!("- {new}: fig1 ({layer})\n")), "{changes}");
    }
}

/// The figures that a paper's code makes are expected, though its folder has no file of them.
#[test]
fn figures_of_a_papers_code_are_kept() {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join(code::FOLDER);
    let place = tempfile::tempdir().unwrap();
    let root = place.path().join("p");
    for part in ["figures", "expected"] {
        fs::create_dir_all(root.join(part)).unwrap();
    }
    let files = ["paper.toml", "figures/fig5.toml", "expected/fig5.json", "expected/fig1.json"];
    for file in files {
        fs::copy(own.join(file), root.join(file)).unwrap();
    }
    let (code, out, said) = paper(&["check", "--quiet"], &root);
    assert!(
        code == 0 && out.contains("fig5-printed: same") && !out.contains("fig1"),
        "{out}{said}"
    );
    let (code, out, _) = paper(&["bless", "--reason", "again", "--quiet"], &root);
    assert!(code == 0 && out.contains("nothing changed"), "{out}");
    change(&root, "paper.toml", "code = \"jeffrey-2013\"", "code = \"jeffrey\"");
    let (code, _, said) = paper(&["check", "--quiet"], &root);
    let wanted = ["no code called `jeffrey`", "paper.toml:", "leave `code` out"];
    assert!(code == 2 && wanted.iter().all(|w| said.contains(w)), "{said}");
    change(&root, "paper.toml", "code = \"jeffrey\"\n", "");
    let (code, out, _) = paper(&["check", "--quiet"], &root);
    assert!(code == 1 && out.contains("fig1: GONE"), "{out}");
    // Its counts are its code's, too.
    fs::copy(own.join("figures/fig9.toml"), root.join("figures/fig9.toml")).unwrap();
    let (code, _, said) = paper(&["check", "--quiet"], &root);
    assert!(code == 2 && said.contains("no committed runs are called `audit/9(i)`"), "{said}");
}

/// A pipe, or a link to nothing, under the name of a paper's file is not taken for no file.
#[cfg(unix)]
#[test]
fn pipes_and_links_to_nothing_are_refused() {
    let pipe = |path: &Path| {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        assert!(std::process::Command::new("mkfifo").arg(path).status().unwrap().success());
    };
    let link = |path: &Path| {
        fs::remove_file(path).unwrap();
        std::os::unix::fs::symlink("nowhere", path).unwrap();
    };
    /// The name of a case, what is done to the folder, what is said.
    type Case<'a> = (&'a str, &'a dyn Fn(&Path), &'a str);
    let cases: [Case; 6] = [
        ("figures/fig2.toml", &pipe, "neither a file nor a folder"),
        ("figures/fig1.toml", &link, "neither a file nor a folder"),
        ("claims.toml", &link, "a link that leads nowhere"),
        ("paper.toml", &link, "a link that leads nowhere"),
        ("out/fig1/fig1.png", &pipe, "a link, pipe or device"),
        ("expected/fig1.json", &pipe, "a link, pipe or device"),
    ];
    for (file, make, says) in cases {
        let place = small();
        let root = place.path().join("p");
        make(&root.join(file));
        let (code, out, said) = paper(&["check", "--quiet"], &root);
        assert!(code == 2 && said.contains(&format!("{file}: {says}")), "{file}: {out}{said}");
    }
}

/// A folder that cannot be listed or read is not taken for an empty one. (Root reads all.)
#[cfg(unix)]
#[test]
fn a_part_that_cannot_be_read_is_said() {
    use std::os::unix::fs::PermissionsExt;
    for (part, mode) in [("figures", 0), ("systems", 0), ("", 0o600)] {
        let place = small();
        let root = place.path().join("p");
        let folder = root.join(part);
        let allow = |mode| fs::set_permissions(&folder, fs::Permissions::from_mode(mode)).unwrap();
        allow(mode);
        let closed = fs::metadata(folder.join("x"))
            .is_err_and(|e| e.kind() == std::io::ErrorKind::PermissionDenied);
        let (code, _, said) = paper(&["check", "--quiet"], &root);
        allow(0o700);
        assert!(
            !closed || code == 2 && said.contains("Permission denied"),
            "{part}: {code} {said}"
        );
    }
}

/// The plain script takes a folder for one, whatever its name begins with.
#[cfg(unix)]
#[test]
fn the_script_takes_a_folder_that_begins_with_a_dash() {
    let place = small();
    fs::rename(place.path().join("p"), place.path().join("-h")).unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("scripts/paper-check.sh");
    let check = |folder: &str| {
        let run = std::process::Command::new("sh")
            .args([script.as_os_str(), folder.as_ref()])
            .env("TWOFOLD", env!("CARGO_BIN_EXE_twofold"))
            .current_dir(place.path())
            .output()
            .unwrap();
        (run.status.code(), String::from_utf8(run.stdout).unwrap())
    };
    let (code, out) = check("-h");
    assert!(code == Some(1) && out.contains("fig1: NEW"), "{out}");
    assert!(place.path().join("-h/out/report.html").is_file());
    assert_eq!(check("-x").0, Some(2));
}

/// The action's step that installs a toolchain: with the program on the path it needs none.
#[cfg(unix)]
#[test]
fn the_action_installs_no_toolchain_where_the_program_is() {
    let action =
        Path::new(env!("CARGO_MANIFEST_DIR")).join(".github/actions/paper-check/action.yml");
    let text = fs::read_to_string(action).unwrap();
    let step = text.lines().find_map(|line| line.trim().strip_prefix("run: ")).unwrap();
    assert!(step.ends_with("rustup toolchain install"), "{step}");
    let runs = |path: &Path| {
        let run =
            std::process::Command::new("/bin/sh").args(["-c", step]).env("PATH", path).output();
        run.unwrap().status.success()
    };
    let nothing = tempfile::tempdir().unwrap();
    let program = Path::new(env!("CARGO_BIN_EXE_twofold")).parent().unwrap();
    assert!(runs(program) && !runs(nothing.path()));
}

/// Expectations are not changed if the reason cannot be kept.
#[test]
fn nothing_is_blessed_without_a_record() {
    let place = small();
    let root = place.path().join("p");
    fs::create_dir_all(root.join("expected/CHANGES.md")).unwrap();
    let (code, _, said) = paper(&["bless", "--reason", "first", "--quiet"], &root);
    assert!(code == 2 && said.contains("CHANGES.md: it is a folder"), "{said}");
    assert_eq!(fs::read_dir(root.join("expected")).unwrap().count(), 1);
}

#[test]
fn hostile_words_are_shown_as_they_are() {
    let place = small();
    let root = place.path().join("p");
    change(
        &root,
        "paper.toml",
        "A relay with hysteresis, as an example",
        "<script>alert(1)</script>",
    );
    change(&root, "claims.toml", "A narrower loop", "<img src=x onerror=y>");
    change(&root, "figures/fig1.toml", "w = 0.1\"", "*_{<b>\"");
    let (code, _, said) = paper(&["report", "--quiet"], &root);
    assert_eq!(code, 0, "{said}");
    let page = fs::read_to_string(root.join("out/report.html")).unwrap();
    assert!(
        !page.contains("<script")
            && !page.contains("<img src=x")
            && page.contains("&lt;script&gt;"),
        "{page}"
    );
}

/// A paper calls its readings as it likes: a picture has the name, and the numbers that the reading
/// and those that it extends give to parameters.
#[test]
fn a_reading_has_the_name_and_the_numbers_of_the_folder() {
    const FILES: Embedded = &[
        (
            "paper.toml",
            "format = 1
            title = 'A'
            authors = ['B']
            year = 2000
            summary = 'C'
            run = { system = 'caricature' }
            [readings.broad]
            about = ''
            run = { set = { alpha = 0.5, beta = 1e-4 } }
            [readings.narrow]
            about = ''
            extends = 'broad'
            run = { set = { alpha = 0.25 } }",
        ),
        (
            "figures/fig1.toml",
            "title = 'A'
            caption = 'B'
            [[panel]]
            label = 'a'
            draw = 'halves'
            run = { start = [0.2, 0, -1], eps = 1e-3, t-end = 10, section = 'y=0' }",
        ),
    ];
    let folder = Folder::embedded("paper", FILES).unwrap();
    let pictures = &folder.figures[0].pictures;
    let reading = |alpha: f64, name: &str| ParameterReading {
        name: name.to_owned(),
        parameters: vec![("alpha".to_owned(), alpha), ("beta".to_owned(), 1e-4)],
    };
    let found: Vec<_> = pictures.iter().map(|p| (p.name.as_str(), p.reading.clone())).collect();
    assert_eq!(
        found,
        [
            ("fig1-broad", Some(reading(0.5, "broad"))),
            ("fig1-narrow", Some(reading(0.25, "narrow")))
        ]
    );
    // Those of Jeffrey (2013) are the two that its studies know.
    for picture in figures::all().iter().flat_map(|f| &f.pictures) {
        let known = picture.reading_name().and_then(Reading::named);
        assert_eq!(picture.reading, known.map(Into::into), "{}", picture.name);
    }
}

/// Keys of a panel that change nothing, and claims that nothing can be held against.
#[test]
fn keys_without_effect_are_refused() {
    let read = |figure: &str| {
        let paper = "format = 1
            title = 'A'
            authors = ['B']
            year = 2000
            summary = 'C'
            [run]
            system = 'caricature'
            start = [0.2, 0, -1]
            eps = 1e-3
            [readings.one]
            about = ''
            run = { set = { alpha = 0.5 } }
            [readings.two]
            about = ''
            run = { set = { alpha = 0.25 } }";
        let figure: &'static str = figure.to_owned().leak();
        let files = vec![("paper.toml", paper), ("figures/fig1.toml", figure)].leak();
        Folder::embedded("paper", files).map(drop).map_err(|e| e.to_string())
    };
    let halves = "title = 'A'
caption = 'B'
readings = ['one']
draw = 'halves'
[[panel]]
label = 'a'
run = { t-end = 10, section = 'y=0' }
says = { section = { period = 1 } }
";
    let surface = halves
        .replace("halves", "surface")
        .replace(", section = 'y=0'", "")
        .replace("{ section = { period = 1 } }", "'differs-from-next'")
        + "[[panel]]
label = 'b'
run = { t-end = 11 }
";
    for whole in [halves, &surface] {
        assert_eq!(read(whole), Ok(()));
    }
    let last = "t-end = 11 }\nsays = 'less-organised-than-next'";
    for (text, from, to, said) in [
        (halves, "says", "in.two = { t-end = 11 }\nsays", ["`in.two` has no effect", "8:4"]),
        (halves, "says", "in.too = { t-end = 11 }\nsays", ["no reading `too`", "8:4"]),
        (halves, "says", "labels = ['a', 'b', 'c']\nsays", ["3 entries; give two", "8:10"]),
        (halves, "says", "camera = [1, 2, 3]\nsays", ["3 entries; give two", "8:10"]),
        (
            halves,
            "says",
            "points = [{ name = 'a', file = 'p.csv' }]\nsays",
            ["expected one table, { name = ", "8:10"],
        ),
        (halves, "says", "points = { label = 'a' }\nsays", ["unknown field `label`", "8:"]),
        (halves, "period = 1", "period = 0", ["a period is one crossing", "8:8"]),
        (
            halves,
            "{ section = { period = 1 } }",
            "'differs-from-next'",
            ["draw it as surface", "8:8"],
        ),
        (&surface, "'differs-from-next'", "{ section = 'chaos' }", ["draw it as halves", "8:8"]),
        (&surface, "t-end = 11 }", last, ["no effect on the last panel", "12:8"]),
        (&surface, "t-end = 11", "t-end = 11, section = 'y=0'", ["leave out --section", "11:21"]),
        (&surface, "label = 'b'", "label = 'b'\ntitle = 'a_{'", ["unbalanced braces", "11:9"]),
    ] {
        let said_of = read(&text.replace(from, to)).unwrap_err();
        assert!(said.iter().all(|s| said_of.contains(s)), "{to}: {said_of}");
    }
}

/// The logistic map x -> r x (1 - x) once a unit of time, at the half of it: e^-t in between is
/// undone by the factor of the map. Its period doubles at r = 3, and at 1 + sqrt(6) = 3.449.
const LOGISTIC: &str = "states = [\"x\"]\nstart = [0.3]\nparameters = { r = 2.8 }\n\
    f = [\"-x\"]\n[[event]]\nwhen = \"cos(pi*t)\"\n\
    set = { x = \"exp(1)*r*x*(1 - x)\" }\n";

/// Its scan and sweeps.
const RUNS: &str = "\n[diagram]\nscan = { system = \"systems/logistic.toml\", period = 1, t-end = \
    400, over = \"params.r=2.8..3.4:25\" }\n\
    [turns]\nsweep = { system = \"systems/logistic.toml\", period = 1, t-end = 400, over = \
    \"params.r=2.8..3.4:13\" }\n\
    [few]\nsweep = { system = \"systems/logistic.toml\", period = 1, t-end = 400, over = \
    [\"params.r=2.7,2.8,3.2,3.3\", \"start.x=0.2,0.4,0.6\"] }\n";

fn with_runs() -> TempDir {
    let place = small();
    let root = place.path().join("p");
    fs::write(root.join("systems/logistic.toml"), LOGISTIC).unwrap();
    let text = fs::read_to_string(root.join("measures.toml")).unwrap();
    fs::write(root.join("measures.toml"), text + RUNS).unwrap();
    place
}

/// A claim that reads a column, with the rest of its rule.
fn of_column(of: &str, column: &str, rule: &str) -> String {
    format!("check = \"value\"\nof = \"{of}\"\ncolumn = \"{column}\"\n{rule}")
}

/// The line of `make` about the first claim with another rule, and all that it says.
fn scored(root: &Path, rule: &str) -> (String, String) {
    let text = fs::read_to_string(root.join("claims.toml")).unwrap();
    let (before, after) = text.split_once("check = ").unwrap();
    let rest = after.split_once("\n\n").map_or("", |(_, rest)| rest);
    fs::write(root.join("claims.toml"), format!("{before}{rule}\n\n{rest}")).unwrap();
    let (_, out, said) = paper(&["make", "--quiet"], root);
    let line = out.lines().find(|line| line.contains("period:")).unwrap_or_default();
    (line.to_owned(), format!("{out}{said}"))
}

/// Period one below r = 3 and two above, whatever the start; two maps say which is whose.
#[test]
fn runs_over_two_settings_are_drawn_as_a_map() {
    let place = with_runs();
    let root = place.path().join("p");
    let file = root.join("figures/fig1.toml");
    let before = fs::read_to_string(&file).unwrap();
    let with = |of: &str, more: &str| {
        let panels = ["c", "d"].map(|label| {
            format!("\n[[panel]]\nlabel = \"{label}\"\ndraw = \"map\"\nof = \"{of}\"\n{more}\n")
        });
        fs::write(&file, before.clone() + &panels.concat()).unwrap();
    };
    with("few", "labels = [\"growth\", \"first\"]\ntitle = \"two halves\"");
    let (code, _, said) = paper(&["make", "--quiet"], &root);
    assert_eq!(code, 0, "{said}");
    let rows = fs::read_to_string(root.join("out/fig1/fig1-d-sweep.csv")).unwrap();
    for (word, count) in [(",period-1,", 6), (",period-2,", 6)] {
        assert_eq!(rows.matches(word).count(), count, "{rows}");
    }
    for (of, more, why) in [
        ("turns", "", "does not ask for runs over two settings"),
        ("cycle", "", "does not ask for runs over two settings"),
        ("few", "x = \"params.r\"", "`x` has no effect on draw = \"map\""),
        ("few", "run = { t-end = 1 }", "`run` has no effect on draw = \"map\""),
    ] {
        with(of, more);
        let (code, _, said) = paper(&["make", "--quiet"], &root);
        assert!(code == 2 && said.contains(why), "{of}, {more}: {said}");
    }
    with("few", "");
    let random = "\"start.x=0.2..0.6\"], random = 4 }";
    change(&root, "measures.toml", "\"start.x=0.2,0.4,0.6\"] }", random);
    let (code, _, said) = paper(&["make", "--quiet"], &root);
    assert!(code == 2 && said.contains("draws `start.x` at random"), "{said}");
}

/// An orbit diagram and a table of runs: drawn as columns, and read by claims.
#[test]
fn scans_and_sweeps_are_measures() {
    let place = with_runs();
    let root = place.path().join("p");
    let panel = |label, of, y| {
        format!(
            "\n[[panel]]\nlabel = \"{label}\"\ndraw = \"columns\"\nof = \"{of}\"\nx = \
                \"params.r\"\ny = [\"{y}\"]\ndots = true\n"
        )
    };
    let text = fs::read_to_string(root.join("figures/fig1.toml")).unwrap();
    let panels = panel("c", "diagram", "x") + &panel("d", "turns", "exponent");
    fs::write(root.join("figures/fig1.toml"), text + &panels).unwrap();
    let (code, _, said) = paper(&["make"], &root);
    assert_eq!(code, 0, "{said}");
    for line in ["diagram: scan over params.r, runs 1 to 1: ", "turns: sweep over params.r, rows"] {
        assert!(said.contains(line), "{line}: {said}");
    }
    let scan = Command::cargo_bin("twofold")
        .unwrap()
        .args(["scan", "--period", "1", "--t-end", "400", "--over", "params.r=2.8..3.4:25"])
        .args(["--quiet", "--system"])
        .arg(root.join("systems/logistic.toml"))
        .output()
        .unwrap();
    let rows = |bytes: &[u8]| -> Vec<String> {
        let text = std::str::from_utf8(bytes).unwrap();
        text.lines().filter(|line| !line.starts_with('#')).map(str::to_owned).collect()
    };
    let ours = fs::read(root.join("out/fig1/fig1-c-passages.csv")).unwrap();
    assert_eq!(rows(&ours), rows(&scan.stdout));

    let onset = |of, word, at, within| {
        let take = format!("take = \"onset\"\nword = \"{word}\"");
        of_column(of, "params.r", &format!("{take}\nequals = {at}\nwithin = {within}"))
    };
    let share = |equals, within| {
        let take = "take = \"share\"\nword = \"period-2\"";
        of_column("few", "outcome", &format!("{take}\nequals = {equals}\nwithin = {within}"))
    };
    for (rule, outcome, words) in [
        (onset("diagram", "period-2", "3", "0.1"), "agrees", "period-2 begins from 2.9"),
        (onset("turns", "period-2", "3", "0.15"), "agrees", "period-2 begins from 3 to 3.05"),
        (onset("diagram", "period-2", "3.3", "0.1"), "differs", "3.3 claimed"),
        (onset("diagram", "period-3", "3.2", "0.1"), "cannot be scored", "some are open"),
        (onset("diagram", "period-2", "3", "1e-3"), "cannot be scored", "does not decide it"),
        (onset("diagram", "period-2", "9", "0.1"), "differs", "9 claimed"),
        (share("0.5", "0.3"), "agrees", "6 of 12 rows are period-2: 0.5 ± "),
        (share("0.1", "0.1"), "differs", "0.1 claimed"),
        (share("0.6", "0.1"), "cannot be scored", "does not decide it"),
    ] {
        let (line, all) = scored(&root, &rule);
        assert!(line.contains(outcome) && line.contains(words), "{rule}: {line}\n{all}");
    }
    // Nothing was computed again.
    let (_, _, said) = paper(&["make"], &root);
    assert!(!said.contains("over params.r, r"), "{said}");
}

/// Values that do not go one way have no onset; a run that fails leaves no hole in a diagram.
#[test]
fn a_scan_that_is_no_diagram_is_not_scored() {
    let place = with_runs();
    let root = place.path().join("p");
    let onset = "take = \"onset\"\nword = \"period-2\"\nequals = 3\nwithin = 1";
    let (line, all) = scored(&root, &of_column("few", "params.r", onset));
    assert!(line.contains("do not go one way"), "{line}\n{all}");
    let rule = of_column("diagram", "x", "take = \"max\"\nequals = 1\nwithin = 1");
    change(&root, "systems/logistic.toml", "-x\"", "-x + 0*sqrt(3.3 - r)\"");
    let (line, all) = scored(&root, &rule);
    assert!(line.contains("params.r = 3.325: "), "{line}\n{all}");
    // Of a sweep it is a row, and leaves the share open.
    let share = "take = \"share\"\nword = \"period-2\"\nequals = 0.5\nwithin = 0.3";
    let (line, all) = scored(&root, &of_column("turns", "outcome", share));
    assert!(line.contains("are open") && line.contains("cannot be scored"), "{line}\n{all}");
}

/// Wrong words of scans and sweeps, and of what claims read of them.
#[test]
fn what_is_wrong_in_scans_and_sweeps_is_said_with_its_place() {
    let onset = |of: &str, word: &str| {
        let take = format!("take = \"onset\"\nword = \"{word}\"\nequals = 3\nwithin = 1");
        of_column(of, "params.r", &take)
    };
    let share = |of: &str, column: &str, more: &str| {
        of_column(of, column, &format!("take = \"share\"\n{more}equals = 3\nwithin = 1"))
    };
    let over = "over = \"params.r=2.8..3.4:25\"";
    let diagram = |word: &str| format!("{over}, {word}");
    let cases: Vec<(&str, &str, String, &[&str])> = vec![
        ("measures.toml", over, "over = \"params.q=1..2:3\"".into(), &["q", "measures.toml:9:"]),
        ("measures.toml", over, "over = 3".into(), &["measures.toml:9:"]),
        ("measures.toml", over, "overs = 3".into(), &["unknown key `overs`", "mean `over`?"]),
        ("measures.toml", over, diagram("alike = 0.1"), &["--alike has no effect", "toml:9:"]),
        ("measures.toml", over, diagram("plot = \"x.png\""), &["`plot` is not part of", ":9:"]),
        ("measures.toml", over, diagram("threads = 2"), &["`threads` is not part of", ":9:"]),
        ("measures.toml", ":13\"", ":13\", shard = \"1/2\"".into(), &["`shard` is not part of"]),
        ("measures.toml", ":13\"", ":2000000\"".into(), &["at most 1000000", "toml:11:"]),
        ("measures.toml", ":13\"", ":13\", random = 3".into(), &["measures.toml:11:"]),
        ("claims.toml", VALUE, onset("diagram", "period-1"), &["does not tell", "toml:11:8"]),
        ("claims.toml", VALUE, onset("turns", "perod-2"), &["no outcome `perod-2`", "toml:11:8"]),
        ("claims.toml", VALUE, onset("turns", "failed"), &["leaves open what", "toml:11:8"]),
        ("claims.toml", VALUE, onset("cycle", "rest"), &["no onset is taken", "toml:8:6"]),
        ("claims.toml", VALUE, share("diagram", "x", "word = \"rest\"\n"), &["no share is taken"]),
        ("claims.toml", VALUE, share("few", "outcome", ""), &["of which word?", "toml:9:10"]),
        (
            "claims.toml",
            VALUE,
            share("few", "outcom", "word = \"rest\"\n"),
            &["no column of words \"outcom\"", "toml:9:10", "it has mode, event, outcome"],
        ),
        (
            "claims.toml",
            VALUE,
            of_column("few", "end", "take = \"max\"\nword = \"rest\"\nequals = 3\nwithin = 1"),
            &["`word` has an effect on share and onset alone", "toml:11:8"],
        ),
        ("claims.toml", "of = \"cycle\"", "of = \"few\"".into(), &["a sweep has no facts"]),
    ];
    for (file, from, to, said) in cases {
        let place = with_runs();
        let root = place.path().join("p");
        change(&root, file, from, &to);
        let (code, out, error) = paper(&["make", "--quiet"], &root);
        assert_eq!(code, 2, "{to}: {out}{error}");
        assert!(said.iter().all(|s| error.contains(s)), "{to}: {error}");
    }
    let place = with_runs();
    let root = place.path().join("p");
    change(&root, "measures.toml", over, &diagram("follow = \"both\""));
    change(&root, "claims.toml", VALUE, &onset("diagram", "period-2"));
    let (code, _, error) = paper(&["make", "--quiet"], &root);
    assert!(code == 2 && error.contains("goes up and down, and has two onsets"), "{error}");
}
