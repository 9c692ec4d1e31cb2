//! An entry of a fixture file, here and in `sensor-assignment`.

use serde::Deserialize;
use serde_json::Value;

#[derive(Deserialize)]
pub struct Entry {
    pub id: String,
    pub inputs: Value,
    pub value: Value,
    pub tolerance: Value,
}

/// Meets the entry's tolerance or says by how much it is missed.
pub fn check(entry: &Entry, ours: f64) -> Result<(), String> {
    let expected = entry.value.as_f64().unwrap();
    let tolerance = match &entry.tolerance {
        Value::Number(n) => n.as_f64().unwrap(),
        Value::String(text) => match text.split_once(' ').unwrap() {
            ("rel", share) => share.parse::<f64>().unwrap() * expected.abs(),
            ("abs", size) => size.parse().unwrap(),
            _ => return Err(format!("{}: unknown tolerance {text}", entry.id)),
        },
        other => return Err(format!("{}: unknown tolerance {other}", entry.id)),
    };
    if (ours - expected).abs() <= tolerance {
        Ok(())
    } else {
        Err(format!("{}: {ours:.12e} instead of {expected:.12e} +- {tolerance:.1e}", entry.id))
    }
}
