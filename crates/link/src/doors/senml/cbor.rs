//! The part of CBOR (RFC 8949) that measurement lists use, to and from the same list in JSON.

use crate::base64;
use ciborium::Value as Cbor;
use ciborium::de::from_reader_with_recursion_limit;
use serde_json::{Number, Value as Json};

/// Fields with their labels (RFC 8428, section 6).
const LABELS: [(i64, &str); 15] = [
    (-1, "bver"),
    (-2, "bn"),
    (-3, "bt"),
    (-4, "bu"),
    (-5, "bv"),
    (-6, "bs"),
    (0, "n"),
    (1, "u"),
    (2, "v"),
    (3, "vs"),
    (4, "vb"),
    (5, "s"),
    (6, "t"),
    (7, "ut"),
    (8, "vd"),
];
/// A list of records with fields is three deep; fields of others may be deeper.
const MAX_DEPTH: usize = 16;
/// Largest exponent of a decimal fraction: doubles end before.
const MAX_EXPONENT: i64 = 400;
/// Tag of a decimal fraction.
const DECIMAL: u64 = 4;

/// The list, or nothing if the bytes are not CBOR of this kind.
pub(super) fn read(bytes: &[u8]) -> Option<Json> {
    let (list, rest) = first(bytes)?;
    rest.is_empty().then_some(list)
}

/// The first list, and what follows it.
pub(super) fn first(bytes: &[u8]) -> Option<(Json, &[u8])> {
    let mut rest = bytes;
    let list = from_reader_with_recursion_limit(&mut rest, MAX_DEPTH).ok()?;
    Some((json(list)?, rest))
}

fn json(item: Cbor) -> Option<Json> {
    Some(match item {
        Cbor::Integer(n) => Json::Number(Number::from_i128(n.into())?),
        Cbor::Float(value) => Json::Number(Number::from_f64(value)?),
        Cbor::Bytes(bytes) => base64::url(&bytes).into(),
        Cbor::Text(text) => text.into(),
        Cbor::Bool(truth) => truth.into(),
        Cbor::Null => Json::Null,
        // A decimal fraction is a number here (RFC 8428, section 6); what other tags say does not matter.
        Cbor::Tag(DECIMAL, parts) => decimal(&json(*parts)?)?,
        Cbor::Tag(_, item) => json(*item)?,
        Cbor::Array(items) => Json::Array(items.into_iter().map(json).collect::<Option<_>>()?),
        Cbor::Map(fields) => {
            let fields = fields
                .into_iter()
                .map(|(name, value)| Some((name_of(name)?, json(value)?)));
            Json::Object(fields.collect::<Option<_>>()?)
        }
        _ => return None,
    })
}

/// The double nearest to `mantissa 10^exponent`, as its decimal text is read.
fn decimal(parts: &Json) -> Option<Json> {
    let [exponent, mantissa] = parts.as_array()?.as_slice() else {
        return None;
    };
    let exponent = exponent.as_i64().filter(|e| e.abs() <= MAX_EXPONENT)?;
    let mantissa = mantissa.as_number().filter(|number| !number.is_f64())?;
    Number::from_f64(format!("{mantissa}e{exponent}").parse().ok()?).map(Json::Number)
}

/// The name of a field, which is a label or text.
fn name_of(label: Cbor) -> Option<String> {
    match label {
        Cbor::Text(name) => Some(name),
        Cbor::Integer(label) => {
            let label = i128::from(label);
            let known = LABELS.iter().find(|(known, _)| i128::from(*known) == label);
            // A label that is not known is the name of a field that may be left out.
            Some(known.map_or_else(|| label.to_string(), |(_, name)| (*name).to_owned()))
        }
        _ => None,
    }
}

/// A list of records as bytes.
pub(super) fn write(list: &Json) -> Vec<u8> {
    let mut bytes = Vec::new();
    // A vector takes all bytes.
    let _ = ciborium::into_writer(&cbor(list, ""), &mut bytes);
    bytes
}

fn cbor(value: &Json, field: &str) -> Cbor {
    match value {
        Json::Array(items) => Cbor::Array(items.iter().map(|item| cbor(item, "")).collect()),
        Json::Object(fields) => {
            let label = |name: &String| match LABELS.iter().find(|(_, known)| known == name) {
                Some((label, _)) => Cbor::Integer((*label).into()),
                None => Cbor::Text(name.clone()),
            };
            Cbor::Map(
                fields
                    .iter()
                    .map(|(name, value)| (label(name), cbor(value, name)))
                    .collect(),
            )
        }
        Json::String(text) => match base64::of_url(text).filter(|_| field == "vd") {
            Some(data) => Cbor::Bytes(data),
            None => Cbor::Text(text.clone()),
        },
        Json::Bool(truth) => Cbor::Bool(*truth),
        Json::Null => Cbor::Null,
        Json::Number(number) => {
            let value = number.as_f64().unwrap_or_default();
            // Whole numbers that a double holds exactly are shorter as integers.
            if value.fract() == 0.0 && value.abs() < 9e15 && !(value == 0.0 && value.is_sign_negative()) {
                Cbor::Integer((value as i64).into())
            } else {
                Cbor::Float(value)
            }
        }
    }
}
