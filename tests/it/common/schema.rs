//! JSON Schema, for the report's twin.

use serde_json::Value;

/// Violations of the schema by `value`, a line each.
pub fn violations(schema: &Value, value: &Value) -> Vec<String> {
    let validator = jsonschema::draft202012::new(schema).expect("the schema is a schema");
    validator.iter_errors(value).map(|e| format!("{}: {e}", e.instance_path())).collect()
}
