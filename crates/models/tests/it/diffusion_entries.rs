//! Entries of the fixture files of diffusion, here and in `diffusive`.

use serde_json::Value;

/// The entries of a fixture file whose id begins so.
pub fn beginning_with(prefix: &str, text: &str) -> Vec<Value> {
    let all: Vec<Value> = serde_json::from_str(text).unwrap();
    let chosen: Vec<Value> = all
        .into_iter()
        .filter(|e| e["id"].as_str().unwrap().starts_with(prefix))
        .collect();
    assert!(!chosen.is_empty(), "no fixture begins with {prefix}");
    chosen
}

/// A number among the inputs.
pub fn number(entry: &Value, name: &str) -> f64 {
    entry["inputs"][name]
        .as_f64()
        .unwrap_or_else(|| panic!("{name} of {}", entry["id"]))
}
