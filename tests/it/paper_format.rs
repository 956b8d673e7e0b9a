//! The files of a paper's folder: their keys, generated from the structs that read them, as a page
//! and as JSON Schemas.
#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use clap::{Arg, ArgAction};
use serde_json::{Map, Value, json};

use twofold::analyse::branch::Change;
use twofold::folder::words::NOT_ASKED;

use super::common::schema;
use super::reference::{Key, hold, keys, keys_tables, meaning, root, run_flags, source};

/// (heading, struct, source)
const STRUCTS: [(&str, &str, &str); 8] = [
    ("paper.toml", "About", "src/folder/mod.rs"),
    ("A reading, `[readings.NAME]`", "ReadingFile", "src/folder/mod.rs"),
    ("figures/NAME.toml", "FigureFile", "src/folder/mod.rs"),
    ("A panel, `[[panel]]`", "PanelFile", "src/folder/mod.rs"),
    ("Points of the paper, `points`", "PointsFile", "src/folder/mod.rs"),
    ("A measure of measures.toml, `[NAME]`", "MeasureFile", "src/folder/mod.rs"),
    ("A claim of claims.toml, `[[claim]]`", "ClaimFile", "src/folder/check/written.rs"),
    ("Odds of a claim, `odds`", "OddsFile", "src/folder/check.rs"),
];

/// The keys of a struct as files write them.
fn of(name: &str) -> Vec<Key> {
    let (_, _, file) = STRUCTS.iter().find(|s| s.1 == name).unwrap();
    let mut keys = keys(&source(file), name);
    keys.iter_mut().for_each(|k| k.name = k.name.replace('_', "-"));
    keys
}

/// The kinds of checks with the keys that each needs and those that it may have, from the reader's
/// table.
fn checks() -> Vec<[Vec<String>; 3]> {
    let text = source("src/folder/check/written.rs");
    let (_, body) = text.split_once("const KINDS:").unwrap();
    let (body, _) = body.split_once("\n];").unwrap();
    let quoted =
        |part: &str| part.split('"').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
    body.split("\n    (")
        .skip(1)
        .map(|kind| {
            let parts: Vec<_> = kind.split("&[").map(quoted).collect();
            parts.try_into().expect("a kind, what it needs, what it may have")
        })
        .collect()
}

/// Description of a check, from the documentation of its variant.
fn about_check(kind: &str) -> String {
    let text = source("src/folder/check.rs");
    let (_, body) = text.split_once("enum Check {").unwrap();
    let variant = format!("{}{}", kind[..1].to_uppercase(), &kind[1..]);
    let lines: Vec<&str> = body.lines().collect();
    let at = lines.iter().position(|l| l.trim().starts_with(&variant)).unwrap();
    let docs = lines[..at].iter().rev().map_while(|line| line.trim().strip_prefix("/// "));
    docs.collect::<Vec<&str>>().into_iter().rev().collect::<Vec<_>>().join(" ")
}

#[test]
fn keys_of_a_paper_are_as_the_page_says() {
    let mut block = String::new();
    for (title, name, file) in STRUCTS {
        block += &keys_tables(&source(file), &[(title, name)])
            .replace("`and_read`", "`and-read`")
            .replace("`at_least`", "`at-least`");
    }
    block += "### Kinds of checks\n\n| check | agrees if | needs | may have |\n|---|---|---|---|\n";
    for [kind, needs, may] in checks() {
        let [needs, may] = [needs, may]
            .map(|keys| keys.iter().map(|key| format!("`{key}`")).collect::<Vec<_>>().join(", "));
        block += &format!("| `{0}` | {1} | {needs} | {may} |\n", kind[0], about_check(&kind[0]));
    }
    hold("docs/paper-keys.md", &[block]);
}

/// A flag's value.
fn value(arg: &Arg) -> Value {
    let mut value = match arg.get_action() {
        ArgAction::SetTrue => json!({ "const": true }),
        _ if arg.get_long() == Some("set") => {
            json!({ "type": ["object", "array", "string"], "additionalProperties": {
                "type": ["number", "string"] } })
        }
        _ if !arg.get_possible_values().is_empty() => {
            let values = arg.get_possible_values();
            let names: Vec<&str> =
                values.iter().map(clap::builder::PossibleValue::get_name).collect();
            json!({ "enum": names })
        }
        _ => {
            json!({ "type": ["number", "string", "array"], "items": { "type": ["number",
                "string"] } })
        }
    };
    value["description"] = meaning(arg).into();
    value
}

/// A question of a command in its flags.
fn question(command: &str) -> Value {
    let definition = twofold::cli::commands::definition();
    let command = definition.find_subcommand(command).unwrap();
    let hidden = ["version", "print-spec", "horizon"];
    let own = run_flags();
    let wanted =
        |a: &&Arg| a.get_long().is_some_and(|l| !hidden.contains(&l) && !NOT_ASKED.contains(&l));
    // A run's own command has flags of its output beside those of the run.
    let flags: Vec<&Arg> = match command.get_name() {
        "run" => own.iter().filter(wanted).collect(),
        _ => command.get_arguments().filter(wanted).collect(),
    };
    let properties: Map<String, Value> =
        flags.iter().map(|a| (a.get_long().unwrap().to_owned(), value(a))).collect();
    json!({ "type": "object", "additionalProperties": false, "properties": properties })
}

/// A key's value by the type that reads it.
fn typed(key: &Key) -> Value {
    let mut inner = key.of.as_str();
    while let Some(rest) = ["Option<", "Spanned<"].iter().find_map(|w| inner.strip_prefix(w)) {
        inner = rest.strip_suffix('>').unwrap();
    }
    let mut value = match inner {
        "String" => json!({ "type": "string" }),
        // A day of TOML is a text in JSON.
        "Datetime" => json!({ "type": "string", "pattern": "^[0-9]{4}-[0-9]{2}-[0-9]{2}$" }),
        "f64" => json!({ "type": "number" }),
        "u16" => json!({ "type": "integer", "minimum": 0, "maximum": u16::MAX }),
        "u64" | "u32" | "usize" => json!({ "type": "integer", "minimum": 0 }),
        "bool" => json!({ "type": "boolean" }),
        "Vec<String>" | "Vec<Spanned<String>>" => {
            json!({ "type": "array", "items": { "type": "string" } })
        }
        "[String; 2]" => {
            json!({ "type": "array", "items": { "type": "string" }, "minItems": 2, "maxItems": 2 })
        }
        "[f64; 2]" => {
            json!({ "type": "array", "items": { "type": "number" }, "minItems": 2, "maxItems": 2 })
        }
        "Draw" => {
            json!({ "enum": ["series", "plane", "space", "section", "columns", "map", "halves",
                "surface"] })
        }
        "Words" if ["orbit", "lyapunov", "rests", "scan", "sweep"].contains(&key.name.as_str()) => {
            question(&key.name)
        }
        "Words" => question("run"),
        "Vec<Spanned<PanelFile>>" => {
            json!({ "type": "array", "minItems": 1, "items": object("PanelFile") })
        }
        "BTreeMap<Spanned<String>, ReadingFile>" => named(object("ReadingFile")),
        "BTreeMap<Spanned<String>, Spanned<Words>>" => named(question("run")),
        "PanelClaim" => json!({ "oneOf": [
            { "enum": ["less-organised-than-next", "differs-from-next"] },
            { "type": "object", "required": ["section"], "additionalProperties": false,
                "properties": { "section": { "oneOf": [
                { "enum": ["periodic", "chaos", "partly-washed-out"] },
                { "type": "object", "required": ["period"], "additionalProperties": false,
                  "properties": { "period": { "type": "integer", "minimum": 1 } } },
            ] } } },
        ] }),
        "PointsFile" => object("PointsFile"),
        "OddsFile" => object("OddsFile"),
        other => panic!("{}: no schema for {other}", key.name),
    };
    match key.name.as_str() {
        "check" => value["enum"] = checks().into_iter().map(|[kind, ..]| kind[0].clone()).collect(),
        "kind" => value["enum"] = json!(Change::ALL.map(Change::word)),
        "id" | "label" => value["pattern"] = json!(PLAIN),
        "columns" => (value["minimum"], value["maximum"]) = (json!(1), json!(6)),
        "within" => value["minimum"] = json!(0),
        "is" => (value["minimum"], value["maximum"]) = (json!(1), json!(64)),
        "starts" => (value["minimum"], value["maximum"]) = (json!(1), json!(1_000_000)),
        "spread" => value["exclusiveMinimum"] = json!(0),
        "at-least" => {
            (value["exclusiveMinimum"], value["exclusiveMaximum"]) = (json!(0), json!(1));
        }
        "relation" => value["enum"] = json!(["less", "<", "greater", ">"]),
        "take" => {
            value["enum"] = json!([
                "last", "first", "max", "min", "mean", "span", "count", "share", "onset", "modulus"
            ])
        }
        "format" => value["const"] = json!(1),
        _ => {}
    }
    value["description"] = key.about.clone().into();
    value
}

/// A name that files, pages and addresses can carry.
const PLAIN: &str = "^[A-Za-z0-9_-][A-Za-z0-9._-]{0,99}$";

/// Tables under plain names.
fn named(table: Value) -> Value {
    json!({ "type": "object", "additionalProperties": table,
        "propertyNames": { "pattern": PLAIN } })
}

/// A measure: one question.
fn measure() -> Value {
    let mut measure = object("MeasureFile");
    (measure["minProperties"], measure["maxProperties"]) = (json!(1), json!(1));
    measure
}

/// A claim: the keys that its check needs, and none that has no effect on it.
fn claim() -> Value {
    let mut claim = object("ClaimFile");
    let checks = checks();
    let all: Vec<&String> =
        checks.iter().flat_map(|[_, needs, may]| needs.iter().chain(may)).collect();
    let rule = |[kind, needs, may]: &[Vec<String>; 3]| {
        let idle = all.iter().filter(|key| !needs.contains(key) && !may.contains(key));
        let idle: Map<String, Value> = idle.map(|key| ((*key).clone(), json!(false))).collect();
        let mut then = json!({ "required": needs, "properties": idle });
        if may.iter().any(|key| key == "read") {
            // A fact, or a quantity of a column.
            then["oneOf"] = json!([
                { "required": ["read"], "properties": { "column": false, "table": false,
                    "word": false, "take": { "const": "modulus" } } },
                { "required": ["column", "take"], "properties": { "read": false, "word": false,
                    "take": { "enum":
                        ["last", "first", "max", "min", "mean", "span", "count"] } } },
                { "required": ["column", "take", "word"], "properties": { "read": false,
                    "take": { "enum": ["share", "onset"] } } },
            ]);
        }
        if may.iter().any(|key| key == "than") {
            then["anyOf"] = json!([
                { "required": ["than"], "properties": { "and": false, "and-read": false } },
                { "required": ["and"], "properties": { "than": false } },
            ]);
        }
        json!({ "if": { "properties": { "check": { "const": kind[0] } }, "required": ["check"] },
            "then": then })
    };
    claim["allOf"] = checks.iter().map(rule).collect();
    claim
}

fn object(name: &str) -> Value {
    let keys = of(name);
    let properties: Map<String, Value> = keys.iter().map(|k| (k.name.clone(), typed(k))).collect();
    let required: Vec<&str> = keys.iter().filter(|k| k.needed).map(|k| k.name.as_str()).collect();
    json!({ "type": "object", "additionalProperties": false, "required": required,
        "properties": properties })
}

/// The schema of a file.
fn schema_of(file: &str) -> Value {
    let mut schema = match file {
        "paper" => object("About"),
        "figure" => object("FigureFile"),
        "measures" => named(measure()),
        "claims" => json!({
            "type": "object", "additionalProperties": false,
            "properties": { "claim": { "type": "array", "items": claim() } },
        }),
        other => panic!("no schema {other}"),
    };
    schema["$schema"] = "https://json-schema.org/draft/2020-12/schema".into();
    schema["title"] = format!("{file} file of a paper's folder, for twofold paper").into();
    schema
}

#[test]
fn schemas_of_a_paper_are_as_its_readers() {
    for file in ["paper", "figure", "measures", "claims"] {
        let path = root().join(format!("schemas/paper/{file}.schema.json"));
        let mut text = serde_json::to_string_pretty(&schema_of(file)).unwrap();
        text.push('\n');
        if std::env::var_os("TWOFOLD_UPDATE").is_some() {
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(&path, text).unwrap();
        } else {
            assert!(
                fs::read_to_string(&path).unwrap() == text,
                "{}: make reference",
                path.display()
            );
        }
    }
}

/// A TOML file as JSON, dates as text.
fn as_json(path: &Path) -> Value {
    fn of(value: toml::Value) -> Value {
        match value {
            toml::Value::Datetime(date) => date.to_string().into(),
            toml::Value::Array(list) => list.into_iter().map(of).collect(),
            toml::Value::Table(table) => {
                Value::Object(table.into_iter().map(|(k, v)| (k, of(v))).collect())
            }
            other => serde_json::to_value(other).unwrap(),
        }
    }
    of(toml::from_str(&fs::read_to_string(path).unwrap()).unwrap())
}

/// The files of a folder and the schema of each.
fn files(folder: &Path) -> Vec<(std::path::PathBuf, &'static str)> {
    let mut files = vec![(folder.join("paper.toml"), "paper")];
    files.extend(
        fs::read_dir(folder.join("figures")).unwrap().map(|e| (e.unwrap().path(), "figure")),
    );
    files.extend(
        [("measures.toml", "measures"), ("claims.toml", "claims")]
            .map(|(f, s)| (folder.join(f), s)),
    );
    files.retain(|f| f.0.exists());
    files
}

#[test]
fn papers_follow_the_schemas() {
    let mut folders = vec![root().join("src/folder/template")];
    folders.extend(
        fs::read_dir(root().join("papers")).into_iter().flatten().map(|e| e.unwrap().path()),
    );
    folders.retain(|f| f.join("paper.toml").exists());
    for folder in folders {
        for (file, kind) in files(&folder) {
            let violations = schema::violations(&schema_of(kind), &as_json(&file));
            assert_eq!(violations, Vec::<String>::new(), "{}", file.display());
        }
    }
}

/// A schema and its reader refuse the same: unknown keys, keys that are missing or have no effect,
/// values of another type or out of their range. (A day as a text is the same in JSON.)
#[test]
fn a_schema_and_its_reader_refuse_the_same() {
    let changes: [(&str, &str, &str, &str); 35] = [
        ("paper.toml", "paper", "year = 2026", "year = 70000"),
        ("paper.toml", "paper", "year = 2026", "year = 2026\npublished = 10:00:00"),
        ("paper.toml", "paper", "[run]", "[readings.\"a b\"]\nabout = \"\"\n[run]"),
        ("figures/fig1.toml", "figure", "columns = 1", "columns = 0"),
        ("figures/fig1.toml", "figure", "columns = 1", "columns = 7"),
        ("figures/fig1.toml", "figure", "label = \"b\"", "label = \"b c\""),
        ("figures/fig1.toml", "figure", "label = \"b\"", "label = \".b\""),
        ("measures.toml", "measures", "[narrow-cycle]", "[\"narrow cycle\"]"),
        ("measures.toml", "measures", "[cycle]", "[none]\n[cycle]"),
        ("measures.toml", "measures", "[cycle]", "[cycle]\nrests = {}"),
        ("claims.toml", "claims", "id = \"period\"", "id = \"a/b\""),
        ("claims.toml", "claims", "within = 1e-6", "within = -1"),
        ("claims.toml", "claims", "within = 1e-6", "within = 1e-6\nis = 3"),
        ("claims.toml", "claims", "within = 1e-6", ""),
        ("claims.toml", "claims", "decided = 2026-11-26", "decided = 2026-11-26T10:00:00"),
        ("claims.toml", "claims", "read = \"period\"", ""),
        ("claims.toml", "claims", "read = \"period\"", "read = \"period\"\ntake = \"last\""),
        ("claims.toml", "claims", "relation = \"less\"", "relation = \"less\"\nthan = 3"),
        ("claims.toml", "claims", "and = \"cycle\"", ""),
        ("claims.toml", "claims", "relation = \"less\"", ""),
        (
            "claims.toml",
            "claims",
            "within = 1e-6",
            "within = 1e-6\nodds = { starts = 0, spread = 1 }",
        ),
        (
            "claims.toml",
            "claims",
            "within = 1e-6",
            "within = 1e-6\nodds = { starts = 9, spread = 0 }",
        ),
        (
            "claims.toml",
            "claims",
            "within = 1e-6",
            "within = 1e-6\nodds = { starts = 9, spread = 1, at-least = 1 }",
        ),
        ("paper.toml", "paper", "year = 2026", "year = \"2026\""),
        ("paper.toml", "paper", "authors =", "author ="),
        ("paper.toml", "paper", "rtol = 1e-9", "rtoll = 1e-9"),
        ("figures/fig1.toml", "figure", "draw = \"series\"", "draw = \"sries\""),
        ("figures/fig1.toml", "figure", "label = \"b\"", ""),
        ("measures.toml", "measures", "settle = 20", "settel = 20"),
        ("measures.toml", "measures", "[cycle]", "[cycle]\nscan = {}"),
        ("measures.toml", "measures", "settle = 20", "threads = 2"),
        ("claims.toml", "claims", "read = \"period\"", "read = \"period\"\nword = \"rest\""),
        ("claims.toml", "claims", "read = \"period\"", "column = \"outcome\"\ntake = \"share\""),
        ("claims.toml", "claims", "check = \"order\"", "check = \"ordre\""),
        ("claims.toml", "claims", "place = \"sec. 2\"", "plaec = \"sec. 2\""),
    ];
    for (file, kind, from, to) in changes {
        let place = tempfile::tempdir().unwrap();
        let folder = place.path().join("p");
        twofold::folder::make::begin(&folder).unwrap();
        let path = folder.join(file);
        assert!(twofold::folder::Folder::read(&folder).is_ok());
        assert!(schema::violations(&schema_of(kind), &as_json(&path)).is_empty());
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(from));
        fs::write(&path, text.replace(from, to)).unwrap();
        assert!(twofold::folder::Folder::read(&folder).is_err(), "{to}: the reader takes it");
        assert!(
            !schema::violations(&schema_of(kind), &as_json(&path)).is_empty(),
            "{to}: the schema takes it"
        );
    }
}
