//! The part of CBOR (RFC 8949) that measurement lists use, to and from the same list in JSON.

use serde_json::{Map, Number, Value as Json};

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
/// What ends an item of indefinite length.
const BREAK: u8 = 0xff;

const BASE64: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_";

/// The list, or nothing if the bytes are not CBOR of this kind.
pub(super) fn read(bytes: &[u8]) -> Option<Json> {
    let (list, rest) = first(bytes)?;
    rest.is_empty().then_some(list)
}

/// The first list, and what follows it.
pub(super) fn first(bytes: &[u8]) -> Option<(Json, &[u8])> {
    let mut rest = bytes;
    let list = item(&mut rest, MAX_DEPTH)?;
    Some((list, rest))
}

fn take<'a>(rest: &mut &'a [u8], count: usize) -> Option<&'a [u8]> {
    let (own, after) = rest.split_at_checked(count)?;
    *rest = after;
    Some(own)
}

/// Kind, argument and the low five bits of the next head; the argument is `None` for indefinite lengths.
fn head(rest: &mut &[u8]) -> Option<(u8, Option<u64>, u8)> {
    let first = take(rest, 1)?[0];
    let (kind, low) = (first >> 5, first & 31);
    let argument = match low {
        0..24 => u64::from(low),
        24..28 => take(rest, 1 << (low - 24))?
            .iter()
            .fold(0, |n, byte| n << 8 | u64::from(*byte)),
        31 => return Some((kind, None, low)),
        _ => return None,
    };
    Some((kind, Some(argument), low))
}

fn item(rest: &mut &[u8], depth: usize) -> Option<Json> {
    let depth = depth.checked_sub(1)?;
    let (kind, argument, low) = head(rest)?;
    match (kind, argument) {
        (0, Some(n)) => Some(n.into()),
        (1, Some(n)) => Some((-1 - i64::try_from(n).ok()?).into()),
        (2, length) => Some(base64(&string(rest, 2, length)?).into()),
        (3, length) => Some(String::from_utf8(string(rest, 3, length)?).ok()?.into()),
        // A decimal fraction is a number here (RFC 8428, section 6); what other tags say does not matter.
        (6, Some(4)) => match item(rest, depth)? {
            Json::Array(parts) => decimal(&parts),
            _ => None,
        },
        (6, Some(_)) => item(rest, depth),
        (4, length) => {
            let mut items = Vec::new();
            while !ends(rest, length, items.len()) {
                items.push(item(rest, depth)?);
            }
            Some(Json::Array(items))
        }
        (5, length) => {
            let (mut fields, mut count) = (Map::new(), 0);
            while !ends(rest, length, count) {
                let name = name(rest)?;
                fields.insert(name, item(rest, depth)?);
                count += 1;
            }
            Some(Json::Object(fields))
        }
        (7, Some(n)) => match low {
            20 | 21 => Some((low == 21).into()),
            22 | 23 => Some(Json::Null),
            25 => number(half(n as u16)),
            26 => number(f32::from_bits(n as u32).into()),
            27 => number(f64::from_bits(n)),
            _ => None,
        },
        _ => None,
    }
}

fn number(value: f64) -> Option<Json> {
    Number::from_f64(value).map(Json::Number)
}

/// The double nearest to `m 10^e`, of `[e, m]`.
fn decimal(parts: &[Json]) -> Option<Json> {
    let [exponent, mantissa] = parts else { return None };
    let exponent = exponent.as_i64().filter(|e| e.abs() <= MAX_EXPONENT)?;
    let mantissa = mantissa.as_number().filter(|number| !number.is_f64())?;
    number(format!("{mantissa}e{exponent}").parse().ok()?)
}

/// The bytes of a string, which may come in chunks of known length.
fn string(rest: &mut &[u8], kind: u8, length: Option<u64>) -> Option<Vec<u8>> {
    if let Some(length) = length {
        return Some(take(rest, usize::try_from(length).ok()?)?.to_vec());
    }
    let mut bytes = Vec::new();
    while !ends(rest, None, 0) {
        let (own, length, _) = head(rest)?;
        let length = length.filter(|_| own == kind)?;
        bytes.extend(take(rest, usize::try_from(length).ok()?)?);
    }
    Some(bytes)
}

/// Whether a list or map ends here; if its length is indefinite, the byte that ends it is taken.
fn ends(rest: &mut &[u8], length: Option<u64>, count: usize) -> bool {
    match length {
        Some(length) => count as u64 >= length,
        None if rest.first() == Some(&BREAK) => {
            *rest = &rest[1..];
            true
        }
        None => false,
    }
}

/// The name of a field, by its label or itself.
fn name(rest: &mut &[u8]) -> Option<String> {
    let label = match head(rest)? {
        (0, Some(n), _) => i64::try_from(n).ok()?,
        (1, Some(n), _) => -1 - i64::try_from(n).ok()?,
        (3, length, _) => return String::from_utf8(string(rest, 3, length)?).ok(),
        _ => return None,
    };
    let known = LABELS.iter().find(|(known, _)| *known == label);
    // A label that is not known is the name of a field that may be left out.
    Some(known.map_or_else(|| label.to_string(), |(_, name)| (*name).to_owned()))
}

/// A float of 16 bits (RFC 8949, appendix D).
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let size = match exponent {
        0 => fraction * 2f64.powi(-24),
        31 if fraction == 0.0 => f64::INFINITY,
        31 => f64::NAN,
        _ => (1024.0 + fraction) * 2f64.powi(exponent - 25),
    };
    if bits >> 15 == 1 { -size } else { size }
}

fn base64(bytes: &[u8]) -> String {
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let bits = group
            .iter()
            .enumerate()
            .fold(0_u32, |bits, (i, byte)| bits | u32::from(*byte) << (16 - 8 * i));
        text.extend((0..=group.len()).map(|i| char::from(BASE64[(bits >> (18 - 6 * i) & 63) as usize])));
    }
    text
}

/// The bytes of text in base64; `None` if it is not that.
fn of_base64(text: &str) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    let digits = text.trim_end_matches('=').as_bytes();
    for group in digits.chunks(4) {
        let mut bits = 0_u32;
        for (i, digit) in group.iter().enumerate() {
            let value = BASE64.iter().position(|known| known == digit)?;
            bits |= (value as u32) << (18 - 6 * i);
        }
        let count = group.len().checked_sub(1).filter(|count| *count > 0)?;
        bytes.extend(&bits.to_be_bytes()[1..=count]);
    }
    Some(bytes)
}

pub(super) fn write(list: &Json) -> Vec<u8> {
    let mut bytes = Vec::new();
    push(&mut bytes, list, "");
    bytes
}

fn push_head(bytes: &mut Vec<u8>, kind: u8, n: u64) {
    let kind = kind << 5;
    match n {
        0..24 => bytes.push(kind | n as u8),
        24..0x100 => bytes.extend([kind | 24, n as u8]),
        0x100..0x1_0000 => {
            bytes.push(kind | 25);
            bytes.extend((n as u16).to_be_bytes());
        }
        0x1_0000..0x1_0000_0000 => {
            bytes.push(kind | 26);
            bytes.extend((n as u32).to_be_bytes());
        }
        _ => {
            bytes.push(kind | 27);
            bytes.extend(n.to_be_bytes());
        }
    }
}

fn push_text(bytes: &mut Vec<u8>, text: &str) {
    push_head(bytes, 3, text.len() as u64);
    bytes.extend(text.as_bytes());
}

fn push(bytes: &mut Vec<u8>, value: &Json, field: &str) {
    match value {
        Json::Array(items) => {
            push_head(bytes, 4, items.len() as u64);
            items.iter().for_each(|item| push(bytes, item, ""));
        }
        Json::Object(fields) => {
            push_head(bytes, 5, fields.len() as u64);
            for (name, value) in fields {
                match LABELS.iter().find(|(_, known)| known == name) {
                    Some((label, _)) if *label >= 0 => push_head(bytes, 0, label.unsigned_abs()),
                    Some((label, _)) => push_head(bytes, 1, label.unsigned_abs() - 1),
                    None => push_text(bytes, name),
                }
                push(bytes, value, name);
            }
        }
        Json::String(text) => match of_base64(text).filter(|_| field == "vd") {
            Some(data) => {
                push_head(bytes, 2, data.len() as u64);
                bytes.extend(data);
            }
            None => push_text(bytes, text),
        },
        Json::Bool(truth) => bytes.push(0xf4 | u8::from(*truth)),
        Json::Null => bytes.push(0xf6),
        Json::Number(number) => {
            let value = number.as_f64().unwrap_or_default();
            // Whole numbers that a double holds exactly are shorter as integers.
            if value.fract() == 0.0 && value.abs() < 9e15 && !(value == 0.0 && value.is_sign_negative()) {
                let size = value.abs() as u64;
                match value < 0.0 {
                    true => push_head(bytes, 1, size - 1),
                    false => push_head(bytes, 0, size),
                }
            } else {
                bytes.push(0xfb);
                bytes.extend(value.to_be_bytes());
            }
        }
    }
}
