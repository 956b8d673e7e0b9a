//! Systems by name or file, as general ones.

use std::io;
use std::path::{Path, PathBuf};

use super::CliError;
use crate::hybrid::data::BadTable;
use crate::hybrid::definition::is_general;
use crate::hybrid::model::ModelError;
use crate::hybrid::{Definition, Model};
use crate::record::files::read_text;
use crate::system::diagnostic::nearest;
use crate::system::{Diagnostic, library};

/// Reads a system's file.
///
/// # Errors
/// If it cannot be read, or is no text.
pub fn read_system(path: &Path) -> Result<String, CliError> {
    read_text(path).map_err(|error| match error.source.kind() {
        io::ErrorKind::InvalidData => CliError::Usage(format!(
            "--system {}: it is not text; a system is a text file, .toml or .json",
            path.display()
        )),
        _ => error.into(),
    })
}

/// The system of this name, a general one or one with h, plus and minus read as such.
///
/// # Errors
/// If there is none, or it cannot be understood.
pub fn any_model(name: &str, set: &[String]) -> Result<Model, CliError> {
    if let Some(model) = named(name, set, true)? {
        return Ok(model);
    }
    if names_a_file(name) {
        // The reader says why it cannot be read.
        read_system(Path::new(name))?;
    }
    let (near, known) = known(name);
    Err(CliError::Usage(format!(
        "--system {name}: there is no such built-in system{near} Built in are {known}; give a \
            file's name for your own"
    )))
}

/// Whether the name of a system is that of a file, which may not be there.
pub fn names_a_file(name: &str) -> bool {
    name.contains(['.', '/', '\\']) || Path::new(name).is_file()
}

/// The names of all built-in systems, after advice if one of them is like `name`.
pub fn known(name: &str) -> (String, String) {
    let known: Vec<&str> = library::names().chain(library::general_names()).collect();
    let near = nearest(name, &known).map_or(".".into(), |near| format!(": did you mean {near}?"));
    (near, known.join(", "))
}

/// Refuses a name that `texts`, each NAME=VALUE, give twice.
///
/// # Errors
/// If there is one.
pub fn each_once(flag: &str, texts: &[String]) -> Result<(), CliError> {
    let name = |text: &String| text.split('=').next().unwrap_or_default().trim().to_owned();
    let names: Vec<String> = texts.iter().map(name).collect();
    match (1..names.len()).find(|i| names[..*i].contains(&names[*i])) {
        Some(i) => Err(CliError::Usage(format!(
            "{flag} \"{}\": {} is given twice; leave one of the two out",
            texts[i], names[i]
        ))),
        None => Ok(()),
    }
}

/// The definition in a system's file.
fn definition(path: &Path, text: &str, name: &str) -> Result<Definition, Box<Diagnostic>> {
    let read = if is_json(path) {
        Definition::from_json(text, name)
    } else {
        Definition::from_toml(text, name)
    };
    read.map_err(Box::new)
}

const TWO_SURFACES: &str = "it has two switching surfaces (h and [second]), and this command takes \
    systems with one, or general ones: write both with sign(...) in f = [...]";

/// Whether the text of a system has a table [second] beside its h.
fn has_two_surfaces(text: &str, path: &Path) -> bool {
    if is_json(path) {
        let read = serde_json::from_str::<serde_json::Value>(text);
        return read.is_ok_and(|json| ["h", "second"].iter().all(|key| json.get(key).is_some()));
    }
    let read = text.parse::<toml::Table>();
    read.is_ok_and(|table| ["h", "second"].iter().all(|key| table.contains_key(*key)))
}

fn is_json(path: &Path) -> bool {
    path.extension().is_some_and(|e| e.eq_ignore_ascii_case("json"))
}

/// The files of tables that the system in a file reads; none if it cannot be understood, which its
/// reader says.
///
/// # Errors
/// If the system's file cannot be read.
pub fn table_files(path: &Path) -> Result<Vec<PathBuf>, CliError> {
    let text = read_system(path)?;
    let folder = path.parent().unwrap_or(Path::new(""));
    Ok(definition(path, &text, "").map_or_else(
        |_| Vec::new(),
        |d| d.tables().iter().map(|(_, entry)| folder.join(&entry.file)).collect(),
    ))
}

/// The general system of this name with parameters `set`, or with `any` also one with h, plus and
/// minus, if there is one.
///
/// # Errors
/// If its file cannot be read or understood, or a value is wrong.
pub fn named(name: &str, set: &[String], any: bool) -> Result<Option<Model>, CliError> {
    let path = Path::new(name);
    let built_in = library::general(name).or_else(|| library::text(name).filter(|_| any));
    let (definition, file) = match built_in {
        Some(text) => (Definition::from_toml(text, name).map_err(Box::new), None),
        None => {
            if library::text(name).is_some() || !path.is_file() {
                return Ok(None);
            }
            let text = read_system(path)?;
            if !any && !is_general(&text, is_json(path)) {
                return Ok(None);
            }
            (definition(path, &text, name), path.parent().map(|folder| (folder, text)))
        }
    };
    let wrong = |problem: String| CliError::Usage(format!("--system {name}: {problem}"));
    let text = file.as_ref().map_or(built_in.unwrap_or_default(), |(_, text)| text);
    let mut model = Model::new(definition.map_err(|e| match has_two_surfaces(text, path) {
        true => wrong(TWO_SURFACES.to_owned()),
        false => wrong(e.to_string()),
    })?);
    for (table, entry) in model.definition().tables().to_vec() {
        let Some((folder, text)) = &file else {
            let data = library::table(&entry.file).unwrap_or_default();
            model = model.with_table(&table, data).map_err(|e| wrong(e.to_string()))?;
            continue;
        };
        let about = |error: &BadTable| {
            wrong(Definition::about_table(text, name, &table, error).to_string())
        };
        let data = read_text(&folder.join(&entry.file))
            .map_err(|e| about(&BadTable::unread(e.to_string())))?;
        model = model.with_table(&table, &data).map_err(|error| match &error {
            ModelError::Table(bad) => about(bad),
            _ => wrong(error.to_string()),
        })?;
    }
    each_once("--set", set)?;
    for text in set {
        let refused = |problem: String| CliError::Usage(format!("--set \"{text}\": {problem}"));
        let Some((parameter, value)) = text.split_once('=') else {
            return Err(refused(
                "there is no \"=\"; give it as NAME=VALUE, such as alpha=0.2".into(),
            ));
        };
        let value: f64 = value.trim().parse().map_err(|_| {
            refused(format!(
                "`{}` is not a decimal number; write it like 0.25, -3 or 1e-5",
                value.trim()
            ))
        })?;
        model = model.with(parameter.trim(), value).map_err(|e| refused(e.to_string()))?;
    }
    model.values().map_err(|error| {
        let named = |text: &&String| match (&error, text.split_once('=')) {
            (ModelError::Value(name, ..), Some((parameter, _))) => parameter.trim() == name,
            _ => false,
        };
        match set.iter().rfind(named) {
            Some(text) => CliError::Usage(format!("--set \"{text}\": {error}")),
            None => wrong(error.to_string()),
        }
    })?;
    Ok(Some(model))
}
