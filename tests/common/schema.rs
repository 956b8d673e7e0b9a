//! As much of JSON Schema (2020-12) as schemas/report.schema.json uses. A keyword it does not know is a violation: a rule must not be
//! passed over in silence.

use serde_json::Value;

/// What is wrong with `value`, a line each.
pub fn violations(schema: &Value, value: &Value) -> Vec<String> {
    let mut found = Vec::new();
    check(schema, schema, value, "", &mut found);
    found
}

fn check(root: &Value, schema: &Value, value: &Value, at: &str, found: &mut Vec<String>) {
    let passes = |s: &Value| {
        let mut inner = Vec::new();
        check(root, s, value, at, &mut inner);
        inner.is_empty()
    };
    for (keyword, rule) in schema.as_object().expect("a schema is an object") {
        let good = match keyword.as_str() {
            "$schema" | "$defs" | "title" | "description" => true,
            "$ref" => {
                let target = rule.as_str().unwrap().strip_prefix('#').unwrap();
                check(root, root.pointer(target).expect("a $ref leads somewhere"), value, at, found);
                true
            }
            "type" => match rule {
                Value::String(one) => has_type(value, one),
                several => several.as_array().unwrap().iter().any(|t| has_type(value, t.as_str().unwrap())),
            },
            "const" => value == rule,
            "enum" => rule.as_array().unwrap().contains(value),
            "anyOf" => rule.as_array().unwrap().iter().any(passes),
            "oneOf" => rule.as_array().unwrap().iter().filter(|s| passes(s)).count() == 1,
            "required" => match value.as_object() {
                Some(map) => rule.as_array().unwrap().iter().all(|k| map.contains_key(k.as_str().unwrap())),
                None => true,
            },
            "properties" => {
                for (key, inner) in value.as_object().into_iter().flatten() {
                    if let Some(rule) = rule.get(key) {
                        check(root, rule, inner, &format!("{at}/{key}"), found);
                    }
                }
                true
            }
            "additionalProperties" => {
                assert_eq!(rule, false);
                let known = schema["properties"].as_object().unwrap();
                value.as_object().is_none_or(|map| map.keys().all(|k| known.contains_key(k)))
            }
            "items" => {
                for (i, inner) in value.as_array().into_iter().flatten().enumerate() {
                    check(root, rule, inner, &format!("{at}/{i}"), found);
                }
                true
            }
            "minItems" => value.as_array().is_none_or(|a| a.len() as u64 >= rule.as_u64().unwrap()),
            "maxItems" => value.as_array().is_none_or(|a| a.len() as u64 <= rule.as_u64().unwrap()),
            "minimum" => value.as_f64().is_none_or(|v| v >= rule.as_f64().unwrap()),
            "maximum" => value.as_f64().is_none_or(|v| v <= rule.as_f64().unwrap()),
            "pattern" => value.as_str().is_none_or(|s| matches(rule.as_str().unwrap(), s)),
            unknown => panic!("the schema's keyword {unknown} is not known here"),
        };
        if !good {
            found.push(format!("{at}: {keyword} {rule}"));
        }
    }
}

fn has_type(value: &Value, name: &str) -> bool {
    match name {
        "object" => value.is_object(),
        "array" => value.is_array(),
        "string" => value.is_string(),
        "number" => value.is_number(),
        "integer" => value.is_u64() || value.is_i64(),
        "boolean" => value.is_boolean(),
        "null" => value.is_null(),
        unknown => panic!("no type {unknown}"),
    }
}

/// The two patterns of the schema.
fn matches(pattern: &str, text: &str) -> bool {
    match pattern {
        "^[0-9a-f]{64}$" => text.len() == 64 && text.bytes().all(|b| b.is_ascii_digit() || (b'a'..=b'f').contains(&b)),
        "^twofold [0-9]+[.][0-9]+[.][0-9]+" => text.strip_prefix("twofold ").is_some_and(|v| {
            let parts: Vec<&str> = v.split('.').collect();
            parts.len() >= 3 && parts.iter().all(|p| p.starts_with(|c: char| c.is_ascii_digit()))
        }),
        unknown => panic!("the schema's pattern {unknown} is not known here"),
    }
}
