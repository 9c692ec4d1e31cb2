//! Identifiers that could be numbers: what their texts and the names of their columns say.
//!
//! `007` is a number and `1e5` is one, but 7 and 100000 are not what a part, a town or a device is called. Such texts are words where the name of
//! the column, the other cells or the digits themselves say so.

use crate::column::MAX_WORDS;
use crate::hint::{is_padded, without_unit};
use crate::names;
use crate::number::{self, Syntax};

/// Words of names of columns that hold identifiers.
const NAMES: &str = "id|ids|uid|guid|code|codes|serial|sn|zip|plz|postcode|postal|address|addr|station|stations|site|device|tag|\
    imei|iccid|imsi|mac|key|phone|tel|ticket|batch|lot|barcode|ean|upc|wmo|fips|seriennummer|artikelnummer";
/// Least number of different cells of which all have one unit behind them.
const FEWEST: usize = 4;

/// Whether a word of a name says that its cells are identifiers, as of `site_no` and `deviceId`.
pub(crate) fn is_named(name: &str) -> bool {
    let mut words = String::new();
    let mut was_small = false;
    for c in name.chars() {
        if (c.is_uppercase() && was_small) || !c.is_alphanumeric() {
            words.push(' ');
        }
        was_small = c.is_lowercase();
        words.extend(c.to_lowercase().filter(|c| c.is_alphanumeric()));
    }
    words.split(' ').any(|word| names::is_one_of(NAMES, word))
}

/// Whether texts are digits of binary numbers, all of one length of four or more.
pub(crate) fn are_bits<'a>(mut texts: impl Iterator<Item = &'a String> + Clone) -> bool {
    let length = texts.clone().next().map_or(0, String::len);
    length >= 4 && texts.all(|text| text.len() == length && text.bytes().all(|c| matches!(c, b'0' | b'1')))
}

/// Whether different texts are identifiers of letters and digits, some of which are spelled as numbers: `1e5`, `12E4` and `007` beside `A77`.
pub(crate) fn are_codes<'a>(mut texts: impl Iterator<Item = &'a String> + Clone) -> bool {
    let is_digits = |text: &str| !text.is_empty() && text.bytes().all(|c| c.is_ascii_digit());
    let is_power = |text: &str| {
        let parts = text.split_once(['e', 'E']);
        parts.is_some_and(|(digits, exponent)| is_digits(digits) && is_digits(exponent))
    };
    let is_code =
        |text: &String| text.bytes().all(|c| c.is_ascii_alphanumeric()) && text.bytes().any(|c| c.is_ascii_digit());
    let is_number = |text: &&String| is_digits(text) || is_power(text);
    texts.clone().all(is_code)
        && texts.clone().any(|text| !is_number(&text))
        && texts.any(|text| is_padded(text) || is_power(text))
}

/// Whether texts may be hexadecimal numbers: all have as many digits.
pub(crate) fn are_hexadecimal<'a>(mut texts: impl Iterator<Item = &'a String> + Clone) -> bool {
    let length = texts.clone().next().map_or(0, String::len);
    texts.all(|text| text.len() == length && text.bytes().all(|c| c.is_ascii_hexdigit()))
}

/// Whether different texts are numbers with one unit behind each, as `1200rpm` and `51.25N`.
pub(crate) fn have_unit<'a>(texts: impl ExactSizeIterator<Item = &'a String> + Clone) -> bool {
    if !(FEWEST..=MAX_WORDS).contains(&texts.len()) {
        return false;
    }
    let parts: Option<Vec<(&str, &str)>> = texts.map(|text| without_unit(text)).collect();
    let Some(parts) = parts else { return false };
    let (unit, is_comma) = (parts[0].1, parts.iter().any(|(number, _)| number.contains(',')));
    let syntax = Syntax {
        decimal: if is_comma { b',' } else { b'.' },
        thousands: None,
    };
    let is_long = unit.chars().count() >= 2 || !unit.starts_with(char::is_alphanumeric);
    let has_decimals = parts.iter().any(|(number, _)| number.contains(['.', ',']));
    unit.chars().count() <= 6
        && (is_long || has_decimals)
        && parts
            .iter()
            .all(|(number, other)| *other == unit && number::read(number.as_bytes(), syntax).is_ok())
}
