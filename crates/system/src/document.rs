//! The outer form of a system: the fields of a file, not yet parsed.

use std::collections::BTreeMap;
use std::fmt;
use std::marker::PhantomData;

use serde::de::{self, Deserializer, MapAccess, Visitor, value::MapAccessDeserializer};
use serde::ser::{SerializeMap, Serializer};
use serde::{Deserialize, Serialize};

use twofold_num::Decimal;

/// A table whose order of entries is kept.
#[derive(Clone, Debug, PartialEq)]
pub struct Ordered<V>(pub Vec<(String, V)>);

impl<V> Default for Ordered<V> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<V: Serialize> Serialize for Ordered<V> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(Some(self.0.len()))?;
        for (key, value) in &self.0 {
            map.serialize_entry(key, value)?;
        }
        map.end()
    }
}

impl<'de, V: Deserialize<'de>> Deserialize<'de> for Ordered<V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entries<V>(PhantomData<V>);
        impl<'de, V: Deserialize<'de>> Visitor<'de> for Entries<V> {
            type Value = Ordered<V>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a table of names and values, such as { x = \"-x\" }")
            }
            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Ordered<V>, A::Error> {
                let mut entries: Vec<(String, V)> = Vec::new();
                while let Some((key, value)) = map.next_entry::<String, V>()? {
                    if entries.iter().any(|(k, _)| *k == key) {
                        return Err(de::Error::custom(format!("`{key}` is given twice")));
                    }
                    entries.push((key, value));
                }
                Ok(Ordered(entries))
            }
        }
        deserializer.deserialize_map(Entries(PhantomData))
    }
}

/// Text about a state or parameter.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct About {
    /// Its meaning, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub meaning: String,
    /// Its unit; empty if it has none.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub unit: String,
}

/// Open bounds of a parameter: what lies outside makes no sense.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bounds {
    /// Values are above this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above: Option<Decimal>,
    /// Values are below this.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub below: Option<Decimal>,
}

impl Bounds {
    /// The bound that a value violates, in words, such as "above 0"; none if it is allowed.
    pub fn refuse(&self, value: f64) -> Option<String> {
        let above =
            self.above.as_ref().filter(|b| value <= b.value()).map(|b| format!("above {b}"));
        let below =
            self.below.as_ref().filter(|b| value >= b.value()).map(|b| format!("below {b}"));
        above.or(below)
    }
}

/// A state: a name, or a table with more.
#[derive(Clone, Debug, PartialEq)]
pub struct StateEntry {
    /// Its name.
    pub name: String,
    /// Its meaning and unit.
    pub about: About,
}

/// A parameter: a number, or a table with more.
#[derive(Clone, Debug, PartialEq)]
pub struct ParameterEntry {
    /// Its value.
    pub value: Decimal,
    /// Its meaning and unit.
    pub about: About,
    /// The range of values that it may have.
    pub bounds: Bounds,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StateTable {
    /// The state's name, as expressions use it.
    name: String,
    /// Its meaning, in words; appears on the axes of pictures.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    meaning: String,
    /// Its unit; appears on the axes of pictures.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    unit: String,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ParameterTable {
    /// The value: a number, or its decimal digits as a string.
    value: Decimal,
    /// Values that are not above this bound are refused, also by `--set`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    above: Option<Decimal>,
    /// Values that are not below this bound are refused.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    below: Option<Decimal>,
    /// Its meaning, in words.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    meaning: String,
    /// Its unit.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    unit: String,
}

impl Serialize for StateEntry {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        if self.about == About::default() {
            return serializer.serialize_str(&self.name);
        }
        let About { meaning, unit } = self.about.clone();
        StateTable { name: self.name.clone(), meaning, unit }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for StateEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entry;
        impl<'de> Visitor<'de> for Entry {
            type Value = StateEntry;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a state's name, or { name = \"x\", meaning = \"...\", unit = \"...\" }",
                )
            }
            fn visit_str<E: de::Error>(self, name: &str) -> Result<StateEntry, E> {
                Ok(StateEntry { name: name.into(), about: About::default() })
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<StateEntry, A::Error> {
                let StateTable { name, meaning, unit } =
                    StateTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(StateEntry { name, about: About { meaning, unit } })
            }
        }
        deserializer.deserialize_any(Entry)
    }
}

impl Serialize for ParameterEntry {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Self { value, about, bounds } = self.clone();
        if about == About::default() && bounds == Bounds::default() {
            return value.serialize(serializer);
        }
        let (About { meaning, unit }, Bounds { above, below }) = (about, bounds);
        ParameterTable { value, above, below, meaning, unit }.serialize(serializer)
    }
}

impl<'de> Deserialize<'de> for ParameterEntry {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Entry;
        impl<'de> Visitor<'de> for Entry {
            type Value = ParameterEntry;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str(
                    "a number, its digits as a string, or { value = 0.1, meaning \
                    = \"...\", unit = \"...\" }",
                )
            }
            fn visit_f64<E: de::Error>(self, value: f64) -> Result<ParameterEntry, E> {
                plain(de::value::F64Deserializer::new(value))
            }
            fn visit_i64<E: de::Error>(self, value: i64) -> Result<ParameterEntry, E> {
                plain(de::value::I64Deserializer::new(value))
            }
            fn visit_u64<E: de::Error>(self, value: u64) -> Result<ParameterEntry, E> {
                plain(de::value::U64Deserializer::new(value))
            }
            fn visit_str<E: de::Error>(self, digits: &str) -> Result<ParameterEntry, E> {
                plain(de::value::StrDeserializer::new(digits))
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<ParameterEntry, A::Error> {
                let ParameterTable { value, above, below, meaning, unit } =
                    ParameterTable::deserialize(MapAccessDeserializer::new(map))?;
                Ok(ParameterEntry {
                    value,
                    about: About { meaning, unit },
                    bounds: Bounds { above, below },
                })
            }
        }
        fn plain<'de, D: Deserializer<'de>>(deserializer: D) -> Result<ParameterEntry, D::Error> {
            let value = Decimal::deserialize(deserializer)?;
            Ok(ParameterEntry { value, about: About::default(), bounds: Bounds::default() })
        }
        deserializer.deserialize_any(Entry)
    }
}

/// A second switching surface: its function, and the fields where that is negative.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SecondEntry {
    /// The second switching function.
    pub h: String,
    /// The field where the first function is positive and the second negative.
    pub plus: Vec<String>,
    /// The field where both are negative.
    pub minus: Vec<String>,
}

/// A system's file: TOML or JSON with these fields.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Document {
    /// The name of the system: letters, digits, `-` and `_`.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// One line for headings of pictures.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub title: String,
    /// Description of the system, in sentences.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub about: String,
    /// Sources of the system, a string each.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub references: Vec<String>,
    /// One to a hundred states, in order: a name, or a table (below).
    pub states: Vec<StateEntry>,
    /// Start of runs: a number for each state. Without it runs need `--start`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Vec<Decimal>>,
    /// The two or three states that pictures show: horizontal, (depth,) vertical.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub axes: Vec<String>,
    /// The switching function: `plus` holds where h > 0, `minus` where h < 0.
    pub h: String,
    /// The field where h > 0: an expression for the derivative of each state.
    pub plus: Vec<String>,
    /// The field where h < 0, likewise.
    pub minus: Vec<String>,
    /// A second switching surface, as a table (below).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub second: Option<SecondEntry>,
    /// Parameters by name: a number, its digits as a string, or a table (below).
    #[serde(default)]
    pub parameters: Ordered<ParameterEntry>,
    /// Expressions by name, in any order, for what is used more than once.
    #[serde(default, rename = "let")]
    pub terms: Ordered<String>,
}

/// The data that determine a system's numbers, and nothing else. Two systems with equal canonical
/// forms compute the same bytes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Canonical {
    /// The states' names, in order.
    pub states: Vec<String>,
    /// The parameters' values, by name.
    pub parameters: BTreeMap<String, Decimal>,
    /// Intermediate terms, by name, as they are printed after reading.
    #[serde(rename = "let")]
    pub terms: BTreeMap<String, String>,
    /// The switching function.
    pub h: String,
    /// f+, component by component.
    pub plus: Vec<String>,
    /// f-, component by component.
    pub minus: Vec<String>,
    /// The second switching surface, if there is one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub second: Option<SecondEntry>,
}
