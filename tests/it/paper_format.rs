//! The files of a paper's folder: their keys, generated from the structs that read them, as a page
//! and as JSON Schemas.
#![cfg(feature = "cli")]

use std::fs;
use std::path::Path;

use clap::{Arg, ArgAction};
use serde_json::{Map, Value, json};

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
    ("A claim of claims.toml, `[[claim]]`", "ClaimFile", "src/folder/check.rs"),
    ("Odds of a claim, `odds`", "OddsFile", "src/folder/check.rs"),
];

/// The keys of a struct as files write them.
fn of(name: &str) -> Vec<Key> {
    let (_, _, file) = STRUCTS.iter().find(|s| s.1 == name).unwrap();
    let mut keys = keys(&source(file), name);
    keys.iter_mut().for_each(|k| k.name = k.name.replace('_', "-"));
    keys
}

/// The kinds of checks with the keys that each takes, from the table that the reader uses.
fn checks() -> Vec<(String, Vec<String>)> {
    let text = source("src/folder/check.rs");
    let (_, body) = text.split_once("const KINDS:").unwrap();
    let (body, _) = body.split_once("\n];").unwrap();
    let quoted =
        |line: &str| line.split('"').skip(1).step_by(2).map(str::to_owned).collect::<Vec<_>>();
    let lines = body.lines().filter(|l| l.trim().starts_with("(\""));
    lines
        .map(|l| {
            let mut words = quoted(l);
            (words.remove(0), words)
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
    block += "### Kinds of checks\n\n| check | agrees if | takes |\n|---|---|---|\n";
    for (kind, takes) in checks() {
        let takes = takes.iter().map(|t| format!("`{t}`")).collect::<Vec<_>>().join(", ");
        block += &format!("| `{kind}` | {} | {takes} |\n", about_check(&kind));
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
    let hidden = ["spec", "out", "format", "quiet", "help", "version", "print-spec", "horizon"];
    let own = run_flags();
    let wanted = |a: &&Arg| a.get_long().is_some_and(|l| !hidden.contains(&l));
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
        "Datetime" => json!({}),
        "f64" => json!({ "type": "number" }),
        "u64" | "u32" | "u16" | "usize" => json!({ "type": "integer", "minimum": 0 }),
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
            json!({ "enum": ["series", "plane", "space", "section", "columns", "halves",
                "surface"] })
        }
        "Words" if ["orbit", "lyapunov", "rests"].contains(&key.name.as_str()) => {
            question(&key.name)
        }
        "Words" => question("run"),
        "Vec<Spanned<PanelFile>>" => {
            json!({ "type": "array", "minItems": 1, "items": object("PanelFile") })
        }
        "toml::value::Datetime" => json!({}),
        "BTreeMap<Spanned<String>, ReadingFile>" => {
            json!({ "type": "object", "additionalProperties": object("ReadingFile") })
        }
        "BTreeMap<Spanned<String>, Spanned<Words>>" => {
            json!({ "type": "object", "additionalProperties": question("run") })
        }
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
        "check" => value["enum"] = checks().into_iter().map(|(kind, _)| kind).collect(),
        "relation" => value["enum"] = json!(["less", "<", "greater", ">"]),
        "take" => {
            value["enum"] =
                json!(["last", "first", "max", "min", "mean", "span", "count", "modulus"])
        }
        "format" => value["const"] = json!(1),
        _ => {}
    }
    value["description"] = key.about.clone().into();
    value
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
        "measures" => json!({ "type": "object", "additionalProperties": object("MeasureFile") }),
        "claims" => json!({
            "type": "object", "additionalProperties": false,
            "properties": { "claim": { "type": "array", "items": object("ClaimFile") } },
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

/// A schema and its reader refuse the same: unknown keys, keys that are missing, values of another
/// type.
#[test]
fn a_schema_and_its_reader_refuse_the_same() {
    let changes: [(&str, &str, &str, &str); 8] = [
        ("paper.toml", "paper", "year = 2026", "year = \"2026\""),
        ("paper.toml", "paper", "authors =", "author ="),
        ("paper.toml", "paper", "rtol = 1e-9", "rtoll = 1e-9"),
        ("figures/fig1.toml", "figure", "draw = \"series\"", "draw = \"sries\""),
        ("figures/fig1.toml", "figure", "label = \"b\"", ""),
        ("measures.toml", "measures", "settle = 20", "settel = 20"),
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
