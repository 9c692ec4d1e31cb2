//! Names and numbers in sentences.

use std::borrow::Cow;
use std::fmt::Write as _;

/// Largest number of characters of a name.
const MAX_NAME: usize = 200;

/// Whether a character would control a terminal, or reorder the text around it.
fn is_control(character: char) -> bool {
    character.is_control() || matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A name without any control character, as it may stand within a line; of a long one the beginning and the end.
pub(crate) fn name(text: &str) -> Cow<'_, str> {
    let length = text.chars().count();
    if length <= MAX_NAME && !text.chars().any(is_control) {
        return Cow::Borrowed(text);
    }
    let mut plain = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        if is_control(character) {
            // Writing to a string cannot fail.
            let _ = write!(plain, "\\u{{{:x}}}", character as u32);
        } else {
            plain.push(character);
        }
    }
    let length = plain.chars().count();
    if length > MAX_NAME {
        let begin: String = plain.chars().take(MAX_NAME / 2).collect();
        let end: String = plain.chars().skip(length - MAX_NAME / 2).collect();
        plain = format!("{begin}…{end}");
    }
    Cow::Owned(plain)
}

/// A number with at most four digits, for sizes in sentences.
pub fn short(number: f64) -> String {
    if number == 0.0 || (1e-4..1e7).contains(&number.abs()) {
        let digits = if number == 0.0 {
            0
        } else {
            (3 - number.abs().log10().floor() as i32).max(0) as usize
        };
        let text = format!("{number:.digits$}");
        if text.contains('.') {
            return text.trim_end_matches('0').trim_end_matches('.').to_owned();
        }
        return text;
    }
    format!("{number:.3e}")
}

#[cfg(test)]
mod tests {
    use super::{name, short};

    #[test]
    fn control_characters_of_names_are_written_out() {
        assert_eq!(name("a\nb °F"), "a\\u{a}b °F");
    }

    #[test]
    fn long_names_keep_both_ends() {
        let long = format!("first{}last", "°".repeat(100_000));
        let shown = name(&long);
        assert!(shown.starts_with("first") && shown.ends_with("last") && shown.chars().count() == 201, "{shown}");
    }

    #[test]
    fn sizes_in_few_digits() {
        for (number, text) in [
            (0.0, "0"),
            (0.09500000000000242, "0.095"),
            (120.0, "120"),
            (12345.6, "12346"),
            (3.2e-9, "3.200e-9"),
        ] {
            assert_eq!(short(number), text);
        }
    }
}
