//! The built-in systems: the files of `systems/`, embedded.
//!
//! ```
//! use twofold_system::{System, library};
//! assert!(library::names().any(|name| name == "caricature"));
//! let caricature = System::builtin("caricature").expect("built in");
//! assert_eq!(caricature.coordinates(), ["x", "y", "z"]);
//! assert_eq!(caricature.parameter("v_plus"), Some(-1.2));
//! ```

use std::sync::OnceLock;

use twofold_systems::{FILES, GENERAL, TABLES};

use super::{Definition, System};

/// The names of the built-in systems.
pub fn names() -> impl Iterator<Item = &'static str> {
    FILES.iter().map(|(name, _)| *name)
}

/// The text of a built-in system's file.
pub fn text(name: &str) -> Option<&'static str> {
    FILES.iter().find(|(n, _)| *n == name).map(|(_, text)| *text)
}

/// The names of the built-in general systems, which are not read here.
pub fn general_names() -> impl Iterator<Item = &'static str> {
    GENERAL.iter().map(|(name, _)| *name)
}

/// The text of a built-in general system's file.
pub fn general(name: &str) -> Option<&'static str> {
    GENERAL.iter().find(|(n, _)| *n == name).map(|(_, text)| *text)
}

/// A table that built-in general systems read.
pub fn table(file: &str) -> Option<&'static str> {
    TABLES.iter().find(|(n, _)| *n == file).map(|(_, text)| *text)
}

/// The built-in definitions.
pub fn definitions() -> &'static [Definition] {
    static DEFINITIONS: OnceLock<Vec<Definition>> = OnceLock::new();
    DEFINITIONS.get_or_init(|| {
        // A file that could not be read would fail the test below.
        FILES
            .iter()
            .filter_map(|(name, text)| {
                Definition::from_toml(text, &format!("systems/{name}.toml")).ok()
            })
            .collect()
    })
}

/// A built-in definition.
pub fn definition(name: &str) -> Option<&'static Definition> {
    definitions().iter().find(|d| d.name() == name)
}

/// A built-in system with these values.
///
/// # Panics
/// If there is no such system or parameter, which the tests of this crate exclude for every call in
/// it.
pub(super) fn with_values(name: &str, values: &[(&str, f64)]) -> System {
    let system = System::builtin(name).unwrap_or_else(|| panic!("no built-in system {name}"));
    let parameters: Vec<_> = system.definition().parameters().to_vec();
    // A value that is not finite is kept for the caller's own check to refuse.
    let value = |p: &str, default| {
        values.iter().find(|(n, _)| *n == p).map_or(default, |(_, v)| (*v).into())
    };
    let values = parameters.into_iter().map(|p| value(&p.name, p.value)).collect();
    system.with_raw_values(values)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_is_sound_and_carries_its_name() {
        for (name, text) in FILES {
            let definition = Definition::from_toml(text, name).unwrap_or_else(|e| panic!("{e}"));
            assert_eq!(definition.name(), name);
            assert!(!definition.references().is_empty() && definition.start().is_some(), "{name}");
            assert_ne!(definition.title(), name);
        }
        assert_eq!(definitions().len(), FILES.len());
    }
}
