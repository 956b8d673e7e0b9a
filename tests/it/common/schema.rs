//! JSON Schema (draft 2020-12), as far as the project's schemas use it. `make schemas` holds the
//! same files against a full validator.

use regex::Regex;
use serde_json::Value;

/// Violations of the schema by `value`, a line each.
///
/// # Panics
/// If the schema has a keyword that is not known here.
pub fn violations(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    check(schema, schema, value, "", &mut found);
    found
}

/// Whether `value` is of a schema's `type`.
fn is_of(kind: &Value, value: &Value) -> bool {
    match kind.as_str() {
        Some("null") => value.is_null(),
        Some("boolean") => value.is_boolean(),
        Some("number") => value.is_number(),
        Some("integer") => value.as_f64().is_some_and(|x| x.fract() == 0.0),
        Some("string") => value.is_string(),
        Some("array") => value.is_array(),
        Some("object") => value.is_object(),
        _ => kind.as_array().is_some_and(|kinds| kinds.iter().any(|kind| is_of(kind, value))),
    }
}

/// Adds what `rule`, a part of the schema `root`, finds wrong with `value` at the place `at`.
fn check(root: &Value, rule: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
    let Some(keywords) = rule.as_object() else {
        if rule != &Value::Bool(true) {
            found.push(format!("{at}: nothing is allowed here"));
        }
        return;
    };
    let holds = |rule: &Value| {
        let mut found = Vec::new();
        check(root, rule, value, at, &mut found);
        found.is_empty()
    };
    let (number, items, members) = (value.as_f64(), value.as_array(), value.as_object());
    let count = |limit: &Value| items.map(|i| (i.len() as u64, limit.as_u64().unwrap()));
    for (keyword, limit) in keywords {
        let right = match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" => true,
            "$ref" => {
                let pointer = limit.as_str().and_then(|r| r.strip_prefix('#')).unwrap();
                check(root, root.pointer(pointer).unwrap(), value, at, found);
                true
            }
            "type" => is_of(limit, value),
            "const" => value == limit,
            "enum" => limit.as_array().unwrap().contains(value),
            "exclusiveMinimum" => number.is_none_or(|x| x > limit.as_f64().unwrap()),
            "exclusiveMaximum" => number.is_none_or(|x| x < limit.as_f64().unwrap()),
            "minimum" => number.is_none_or(|x| x >= limit.as_f64().unwrap()),
            "maximum" => number.is_none_or(|x| x <= limit.as_f64().unwrap()),
            "minItems" => count(limit).is_none_or(|(n, least)| n >= least),
            "maxItems" => count(limit).is_none_or(|(n, most)| n <= most),
            "pattern" => {
                let pattern = Regex::new(limit.as_str().unwrap()).unwrap();
                value.as_str().is_none_or(|text| pattern.is_match(text))
            }
            "minProperties" => members.is_none_or(|m| m.len() as u64 >= limit.as_u64().unwrap()),
            "maxProperties" => members.is_none_or(|m| m.len() as u64 <= limit.as_u64().unwrap()),
            "propertyNames" => {
                for name in members.into_iter().flat_map(|m| m.keys()) {
                    check(root, limit, &Value::from(name.as_str()), &format!("{at}/{name}"), found);
                }
                true
            }
            "allOf" => {
                for rule in limit.as_array().unwrap() {
                    check(root, rule, value, at, found);
                }
                true
            }
            "if" => {
                if holds(limit) {
                    check(root, &rule["then"], value, at, found);
                }
                true
            }
            "then" => keywords.contains_key("if"),
            "anyOf" => limit.as_array().unwrap().iter().any(holds),
            "oneOf" => limit.as_array().unwrap().iter().filter(|rule| holds(rule)).count() == 1,
            "items" => {
                for (i, item) in items.into_iter().flatten().enumerate() {
                    check(root, limit, item, &format!("{at}/{i}"), found);
                }
                true
            }
            "properties" => {
                for (name, rule) in limit.as_object().unwrap() {
                    if let Some(member) = value.get(name) {
                        check(root, rule, member, &format!("{at}/{name}"), found);
                    }
                }
                true
            }
            "additionalProperties" => {
                let known = |name: &String| rule["properties"].get(name).is_some();
                for (name, member) in members.into_iter().flatten().filter(|m| !known(m.0)) {
                    check(root, limit, member, &format!("{at}/{name}"), found);
                }
                true
            }
            "required" => {
                let has = |name: &Value| value.get(name.as_str().unwrap()).is_some();
                members.is_none() || limit.as_array().unwrap().iter().all(has)
            }
            other => panic!("the schema has a keyword that is not known here: {other}"),
        };
        if !right {
            found.push(format!("{at}: {value} against {keyword} {limit}"));
        }
    }
}
