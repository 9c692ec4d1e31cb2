//! Messages on standard error, and text for terminals.
//!
//! Names of columns and files are the text of others. Control characters in them would move the cursor, change colours or hide lines, so
//! they are written as `\u{1b}`. A standard error that is closed or full is no reason to stop.

use std::borrow::Cow;
use std::cell::RefCell;
use std::fmt::{self, Write as _};
use std::io::Write as _;

/// Largest number of characters of a name in a text, and of a line of a message. The end of a line is kept, since it says what to do.
const MAX_NAME: usize = 200;
const MAX_LINE: usize = 4000;

/// The text, or its first and last characters if it has more than `most`.
fn shortened(text: Cow<'_, str>, most: usize) -> Cow<'_, str> {
    let length = text.chars().count();
    if length <= most {
        return text;
    }
    let begin: String = text.chars().take(most / 2).collect();
    let end: String = text.chars().skip(length - (most - most / 2)).collect();
    Cow::Owned(format!("{begin}…{end}"))
}

/// Whether a character would control a terminal, or reorder the text around it.
fn is_control(character: char) -> bool {
    character.is_control() || matches!(character, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

fn escaped(text: &str, is_kept: impl Fn(char) -> bool) -> Cow<'_, str> {
    if text
        .chars()
        .all(|character| !is_control(character) || is_kept(character))
    {
        return Cow::Borrowed(text);
    }
    let mut plain = String::with_capacity(text.len() + 16);
    for character in text.chars() {
        if !is_control(character) || is_kept(character) {
            plain.push(character);
        } else {
            // Writing to a string cannot fail.
            let _ = write!(plain, "\\u{{{:x}}}", character as u32);
        }
    }
    Cow::Owned(plain)
}

/// The text without control characters other than line ends and tabs.
pub(crate) fn plain(text: &str) -> Cow<'_, str> {
    escaped(text, |character| matches!(character, '\n' | '\t'))
}

/// A name without any control character, as it may stand within a line; of a long one the beginning and the end.
pub(crate) fn name(text: &str) -> Cow<'_, str> {
    shortened(escaped(text, |_| false), MAX_NAME)
}

thread_local! {
    /// Messages of a task among several, which become one line.
    static COLLECTED: RefCell<Option<Vec<String>>> = const { RefCell::new(None) };
}

/// Runs a task whose messages and texts are not written but returned.
pub(crate) fn collect<T>(task: impl FnOnce() -> T) -> (T, Vec<String>) {
    COLLECTED.set(Some(Vec::new()));
    let result = task();
    (result, COLLECTED.take().unwrap_or_default())
}

/// Whether texts are not to be written.
pub(crate) fn is_collecting() -> bool {
    COLLECTED.with_borrow(Option::is_some)
}

/// Takes a text if it is not to be written.
pub(crate) fn is_collected(text: &str) -> bool {
    COLLECTED.with_borrow_mut(|collected| match collected {
        Some(lines) => {
            lines.extend(text.lines().map(|line| escaped(line, |_| false).into_owned()));
            true
        }
        None => false,
    })
}

/// Writes a message and a line end to standard error. Long lines are shortened.
pub(crate) fn line(message: fmt::Arguments<'_>) {
    let message = message.to_string();
    let lines = message.split('\n').map(|line| shortened(line.into(), MAX_LINE));
    data(&lines.collect::<Vec<_>>().join("\n"));
}

/// Writes a text and a line end to standard error, whole.
pub(crate) fn data(text: &str) {
    let text = format!("{text}\n");
    if is_collected(&text) {
        return;
    }
    // Nobody can be told that nobody can be told.
    let _ = std::io::stderr().lock().write_all(plain(&text).as_bytes());
}

/// As `eprintln!`, but without panic and without control characters.
macro_rules! say {
    ($($part:tt)*) => { $crate::say::line(format_args!($($part)*)) };
}
pub(crate) use say;

#[cfg(test)]
mod tests {
    use super::{name, plain};

    #[test]
    fn control_characters_are_written_out() {
        assert_eq!(plain("a\tb\n"), "a\tb\n");
        assert_eq!(plain("\u{1b}[2J\u{9b}31m\u{202e}x\r"), "\\u{1b}[2J\\u{9b}31m\\u{202e}x\\u{d}");
        assert_eq!(name("a\nb °F"), "a\\u{a}b °F");
    }

    #[test]
    fn long_names_keep_both_ends() {
        let long = format!("first{}last", "°".repeat(100_000));
        let shown = name(&long);
        assert!(shown.starts_with("first") && shown.ends_with("last") && shown.chars().count() == 201, "{shown}");
    }
}
