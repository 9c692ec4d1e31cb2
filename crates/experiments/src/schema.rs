//! What the fields of parameters and rows say about themselves, read from their derived schema.

use schemars::JsonSchema;
use schemars::generate::SchemaSettings;
use serde::Serialize;
use serde_json::{Map, Value as Json};
use std::borrow::Cow;

/// A parameter as `describe` shows it.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Parameter {
    /// Name for `--set`.
    pub name: String,
    /// Default, as `--set` takes it.
    pub default: String,
    /// What is accepted, in words.
    pub range: String,
    /// Meaning.
    pub meaning: String,
    /// Names of the entries of one point, where the parameter is a list of points.
    pub entries: Vec<String>,
}

/// A column: its name in the CSV header, its unit and what it holds.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Column {
    /// Name in the header: lower case with underscores.
    pub name: Cow<'static, str>,
    /// Unit; empty for pure numbers and labels.
    pub unit: Cow<'static, str>,
    /// What the column holds, in a few words.
    pub meaning: Cow<'static, str>,
}

/// A table as its rows describe it.
#[derive(Debug, Clone, PartialEq)]
pub struct Fields {
    /// Name of the field that holds it.
    pub(crate) key: String,
    /// Name in file names; the main table's is `main`.
    pub name: String,
    /// What it holds.
    pub meaning: String,
    /// Whether it holds measured times.
    pub volatile: bool,
    /// Path in a row and column.
    pub(crate) columns: Vec<(Vec<String>, Column)>,
}

impl Fields {
    /// The columns.
    pub fn columns(&self) -> impl Iterator<Item = &Column> {
        self.columns.iter().map(|(_, column)| column)
    }
}

fn root<T: JsonSchema>() -> Json {
    let generator = SchemaSettings::draft2020_12()
        .with(|s| s.inline_subschemas = true)
        .into_generator();
    generator.into_root_schema_for::<T>().to_value()
}

fn properties(schema: &Json) -> impl Iterator<Item = (&String, &Json)> {
    schema["properties"].as_object().into_iter().flatten()
}

fn text<'a>(schema: &'a Json, key: &str) -> &'a str {
    schema[key].as_str().unwrap_or_default()
}

/// A description on one line.
fn meaning(schema: &Json) -> String {
    text(schema, "description")
        .split_whitespace()
        .collect::<Vec<_>>()
        .join(" ")
}

/// The tables that `T` describes.
pub(crate) fn tables<T: JsonSchema>() -> Vec<Fields> {
    let schema = root::<T>();
    if schema.get("items").is_some() {
        return vec![fields("", "main".to_owned(), &schema)];
    }
    let named = |(at, (key, schema)): (usize, (&String, &Json))| {
        let name = if at == 0 {
            "main".to_owned()
        } else {
            key.replace('_', "-")
        };
        fields(key, name, schema)
    };
    properties(&schema).enumerate().map(named).collect()
}

fn fields(key: &str, name: String, list: &Json) -> Fields {
    let mut columns = Vec::new();
    for (field, schema) in properties(&list["items"]) {
        let column = |suffix: &str, note: &str| Column {
            name: format!("{field}{suffix}").into(),
            unit: text(schema, "unit").to_owned().into(),
            meaning: format!("{}{note}", meaning(schema)).into(),
        };
        let measured = |s: &Json| s["measured"] == true;
        if measured(schema) || schema["anyOf"].as_array().is_some_and(|any| any.iter().any(measured)) {
            let path = |part: &str| vec![field.clone(), part.to_owned()];
            columns.push((path("value"), column("", "")));
            columns.push((path("standard_error"), column("_se", " (its standard error)")));
        } else {
            columns.push((vec![field.clone()], column("", "")));
        }
    }
    Fields {
        key: key.to_owned(),
        name,
        meaning: meaning(list),
        volatile: list["volatile"] == true,
        columns,
    }
}

/// The parameters that `P` describes, with the given defaults; those without one are not the figure's.
pub(crate) fn parameters<P: JsonSchema>(defaults: &Map<String, Json>) -> Vec<Parameter> {
    let schema = root::<P>();
    properties(&schema)
        .filter(|(name, _)| defaults.contains_key(name.as_str()))
        .map(|(name, schema)| {
            let entry = schema.get("items").unwrap_or(schema);
            let entries: Vec<String> = properties(entry).map(|(name, _)| name.clone()).collect();
            let mut range: Vec<String> = length(schema).into_iter().chain(range(entry)).collect();
            range.extend(properties(entry).filter_map(|(name, s)| Some(format!("{name} {}", self::range(s)?))));
            Parameter {
                name: name.clone(),
                default: defaults.get(name).map(plain).unwrap_or_default(),
                range: range.join("; "),
                meaning: meaning(schema),
                entries,
            }
        })
        .collect()
}

fn length(schema: &Json) -> Option<String> {
    match (schema["minItems"].as_u64(), schema["maxItems"].as_u64()) {
        (None, None) => None,
        (Some(low), Some(high)) if low == high => Some(format!("{low} entries")),
        (low, Some(high)) => Some(format!("{} to {high} entries", low.unwrap_or(0))),
        (Some(low), None) => Some(format!("at least {low} entries")),
    }
}

fn range(schema: &Json) -> Option<String> {
    if let Some(words) = schema["enum"].as_array() {
        return Some(format!("one of {}", words.iter().map(plain).collect::<Vec<_>>().join(", ")));
    }
    let limit = |key: &str| schema.get(key).filter(|v| v.is_number()).map(plain);
    match (limit("minimum"), limit("maximum")) {
        (Some(low), Some(high)) => Some(format!("from {low} to {high}")),
        (Some(low), None) => Some(format!("at least {low}")),
        (None, Some(high)) => Some(format!("at most {high}")),
        (None, None) => None,
    }
}

/// A value as `--set` takes it: `0.5,0.9` for a list, `0.5:0.1,0.9:0.2` for a list of points.
pub fn plain(value: &Json) -> String {
    let joined = |entries: Vec<String>, by: &str| entries.join(by);
    match value {
        Json::String(text) => text.clone(),
        Json::Array(entries) => joined(entries.iter().map(plain).collect(), ","),
        Json::Object(fields) => joined(fields.values().map(plain).collect(), ":"),
        Json::Null => "none".to_owned(),
        other => other.to_string(),
    }
}
