//! Sensor measurement lists (RFC 8428) in JSON and CBOR.
//!
//! A list is read into resolved records: base fields are applied, times are absolute. It is written in the same form, without base fields.

mod cbor;

use crate::error::Error;
use fewbits_numerics::error::refuse;
use serde_json::{Map, Value as Json};

/// Times below this many seconds are relative to now (RFC 8428, section 4.5.3).
const RELATIVE: f64 = 268_435_456.0;
/// The version of the format that this program understands.
const VERSION: u64 = 10;

/// A value of a record.
#[derive(Debug, Clone, PartialEq)]
pub enum Value {
    /// A number in the record's unit.
    Number(f64),
    /// A text.
    Text(String),
    /// A truth value.
    Truth(bool),
    /// Bytes in base64 without padding, URL-safe.
    Data(String),
    /// Only the sum is given.
    None,
}

/// A resolved record.
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// Name, with the base name.
    pub name: String,
    /// Unit, as `Cel`; empty if none is given.
    pub unit: String,
    /// Value.
    pub value: Value,
    /// Integral of the value over time.
    pub sum: Option<f64>,
    /// Seconds since 1970.
    pub time: f64,
    /// Largest time in seconds until the next record.
    pub update_time: Option<f64>,
}

impl Record {
    /// A number with its unit at a time.
    pub fn new(name: impl Into<String>, unit: impl Into<String>, value: f64, time: f64) -> Self {
        Self {
            name: name.into(),
            unit: unit.into(),
            value: Value::Number(value),
            sum: None,
            time,
            update_time: None,
        }
    }
}

/// Reads a list in JSON; `now` in seconds since 1970 resolves relative times.
///
/// # Errors
/// If the text is not JSON or not a list of RFC 8428, has a field that must be understood and is not (a name that ends in `_`), or is of a
/// newer version.
pub fn from_json(text: &str, now: f64) -> Result<Vec<Record>, Error> {
    match serde_json::from_str::<Json>(text) {
        Ok(list) => resolve(&list, now),
        Err(error) => refuse("SenML", format!("{error}"), "JSON"),
    }
}

/// Reads a list in CBOR. As [`from_json`] otherwise.
///
/// # Errors
/// As [`from_json`].
pub fn from_cbor(bytes: &[u8], now: f64) -> Result<Vec<Record>, Error> {
    match cbor::read(bytes) {
        Some(list) => resolve(&list, now),
        None => refuse("SenML", format!("{} bytes", bytes.len()), "CBOR with the labels of RFC 8428"),
    }
}

/// Number of bytes of the first list in CBOR, where lists follow one behind the other; `None` if the bytes do not begin with one.
pub fn cbor_length(bytes: &[u8]) -> Option<usize> {
    cbor::first(bytes).map(|(_, rest)| bytes.len() - rest.len())
}

/// Writes records as JSON.
///
/// # Errors
/// If a number is not finite: the format has none.
pub fn to_json(records: &[Record]) -> Result<String, Error> {
    Ok(list(records)?.to_string())
}

/// Writes records as CBOR.
///
/// # Errors
/// As [`to_json`].
pub fn to_cbor(records: &[Record]) -> Result<Vec<u8>, Error> {
    Ok(cbor::write(&list(records)?))
}

fn list(records: &[Record]) -> Result<Json, Error> {
    let mut list = Vec::new();
    for record in records {
        let mut fields = Map::new();
        fields.insert("n".to_owned(), record.name.clone().into());
        if !record.unit.is_empty() {
            fields.insert("u".to_owned(), record.unit.clone().into());
        }
        match &record.value {
            Value::Number(number) => drop(fields.insert("v".to_owned(), finite(*number)?)),
            Value::Text(text) => drop(fields.insert("vs".to_owned(), text.clone().into())),
            Value::Truth(truth) => drop(fields.insert("vb".to_owned(), (*truth).into())),
            Value::Data(data) => drop(fields.insert("vd".to_owned(), data.clone().into())),
            Value::None => {}
        }
        fields.insert("t".to_owned(), finite(record.time)?);
        for (name, number) in [("s", record.sum), ("ut", record.update_time)] {
            if let Some(number) = number {
                fields.insert(name.to_owned(), finite(number)?);
            }
        }
        list.push(Json::Object(fields));
    }
    Ok(Json::Array(list))
}

fn finite(number: f64) -> Result<Json, Error> {
    match serde_json::Number::from_f64(number) {
        Some(number) => Ok(Json::Number(number)),
        None => refuse("number", number, "a finite number"),
    }
}

/// Base fields, which apply until they are given again.
#[derive(Default)]
struct Base {
    name: String,
    time: f64,
    unit: String,
    value: f64,
    sum: f64,
}

fn resolve(list: &Json, now: f64) -> Result<Vec<Record>, Error> {
    let Json::Array(list) = list else {
        return refuse("SenML", "no list", "a list of records");
    };
    let (mut base, mut records) = (Base::default(), Vec::new());
    for record in list {
        let Json::Object(fields) = record else {
            return refuse("SenML", "a list with something else", "a list of records");
        };
        records.extend(resolve_one(&mut base, fields, now)?);
    }
    Ok(records)
}

fn number(fields: &Map<String, Json>, name: &str) -> Result<Option<f64>, Error> {
    match fields.get(name) {
        None => Ok(None),
        Some(value) => match value.as_f64().filter(|value| value.is_finite()) {
            Some(number) => Ok(Some(number)),
            None => refuse("SenML field", name, "a number"),
        },
    }
}

fn text<'a>(fields: &'a Map<String, Json>, name: &str) -> Result<Option<&'a str>, Error> {
    match fields.get(name) {
        None => Ok(None),
        Some(Json::String(text)) => Ok(Some(text)),
        Some(_) => refuse("SenML field", name, "a text"),
    }
}

fn resolve_one(base: &mut Base, fields: &Map<String, Json>, now: f64) -> Result<Option<Record>, Error> {
    if let Some(name) = fields.keys().find(|name| name.ends_with('_')) {
        return refuse("SenML field", name, "a field that this program understands: its name says that it must be");
    }
    if let Some(version) = fields.get("bver").map(Json::as_u64)
        && version.is_none_or(|version| version > VERSION)
    {
        return refuse(
            "SenML version",
            fields.get("bver").map_or_else(String::new, Json::to_string),
            format!("at most {VERSION}"),
        );
    }
    if let Some(name) = text(fields, "bn")? {
        base.name = name.to_owned();
    }
    if let Some(unit) = text(fields, "bu")? {
        base.unit = unit.to_owned();
    }
    base.time = number(fields, "bt")?.unwrap_or(base.time);
    base.value = number(fields, "bv")?.unwrap_or(base.value);
    base.sum = number(fields, "bs")?.unwrap_or(base.sum);
    let (value, sum) = (number(fields, "v")?, number(fields, "s")?);
    let values = [
        value.map(|value| Value::Number(base.value + value)),
        text(fields, "vs")?.map(|text| Value::Text(text.to_owned())),
        text(fields, "vd")?.map(|data| Value::Data(data.to_owned())),
        match fields.get("vb") {
            None => None,
            Some(Json::Bool(truth)) => Some(Value::Truth(*truth)),
            Some(_) => return refuse("SenML field", "vb", "true or false"),
        },
    ];
    let mut values = values.into_iter().flatten();
    let (value, other) = (values.next(), values.next());
    if other.is_some() {
        return refuse("SenML record", "several values", "one of v, vs, vb and vd");
    }
    // A record with base fields only.
    if value.is_none() && sum.is_none() {
        return Ok(None);
    }
    let name = format!("{}{}", base.name, text(fields, "n")?.unwrap_or_default());
    let is_allowed = |c: char| c.is_ascii_alphanumeric() || "-:./_".contains(c);
    if !name.chars().all(is_allowed) || !name.starts_with(|c: char| c.is_ascii_alphanumeric()) {
        return refuse("SenML name", name, "letters, digits and `- : . / _`, the first a letter or digit");
    }
    let time = base.time + number(fields, "t")?.unwrap_or(0.0);
    Ok(Some(Record {
        name,
        unit: text(fields, "u")?.unwrap_or(&base.unit).to_owned(),
        value: value.unwrap_or(Value::None),
        sum: sum.map(|sum| base.sum + sum),
        time: if time < RELATIVE { now + time } else { time },
        update_time: number(fields, "ut")?,
    }))
}

#[cfg(test)]
mod tests;
