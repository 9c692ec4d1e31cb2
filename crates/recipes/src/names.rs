//! Lists of names, separated by commas. A name that contains a comma or `=` stands in double quotes, in which a quote is written twice.

use crate::error::Error;
use fewbits_table::printable;

/// Largest number of names that a message lists.
const MAX_SHOWN: usize = 20;

/// Part of a list between two commas: the name if it was quoted, and what follows it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Part {
    pub(crate) quoted: Option<String>,
    pub(crate) rest: String,
}

/// Splits a list at the commas outside quotes. Spaces around parts are dropped; empty parts too.
pub(crate) fn parts(text: &str) -> Result<Vec<Part>, Error> {
    let refused = || Error::Quote { text: text.to_owned() };
    let (mut parts, mut left) = (Vec::new(), text.trim_start());
    while !left.is_empty() {
        let mut quoted = None;
        if let Some(mut inside) = left.strip_prefix('"') {
            let mut name = String::new();
            loop {
                let end = inside.find('"').ok_or_else(refused)?;
                name += &inside[..end];
                inside = &inside[end + 1..];
                match inside.strip_prefix('"') {
                    Some(more) => {
                        name.push('"');
                        inside = more;
                    }
                    None => break,
                }
            }
            quoted = Some(name);
            left = inside.trim_start();
            if !(left.is_empty() || left.starts_with([',', '='])) {
                return Err(refused());
            }
        }
        let (rest, more) = left.split_once(',').unwrap_or((left, ""));
        let rest = rest.trim().to_owned();
        if quoted.is_some() || !rest.is_empty() {
            parts.push(Part { quoted, rest });
        }
        left = more.trim_start();
    }
    Ok(parts)
}

/// The names of a list.
///
/// # Errors
/// If a quote has no end, or something other than a comma follows it.
pub fn list(text: &str) -> Result<Vec<String>, Error> {
    let name = |part: Part| match part.quoted {
        Some(name) if part.rest.is_empty() => Ok(name),
        Some(_) => Err(Error::Quote { text: text.to_owned() }),
        None => Ok(part.rest),
    };
    parts(text)?.into_iter().map(name).collect()
}

/// Names as a list that [`list`] reads back. Of more than 20 only the first are written, and the number of others; of a name at most 80
/// characters.
pub fn shown<S: AsRef<str>>(names: &[S]) -> String {
    let one = |name: &S| {
        let name = printable(name.as_ref());
        let is_plain = !name.is_empty() && name.trim().len() == name.len() && !name.contains([',', '=', '"']);
        if is_plain {
            name
        } else {
            format!("\"{}\"", name.replace('"', "\"\""))
        }
    };
    let mut text = names.iter().take(MAX_SHOWN).map(one).collect::<Vec<_>>().join(", ");
    if names.len() > MAX_SHOWN {
        text += &format!(" and {} more", names.len() - MAX_SHOWN);
    }
    text
}

/// Index of a column.
///
/// # Errors
/// If there is no column of this name.
pub fn position<S: AsRef<str>>(names: &[S], name: &str) -> Result<usize, Error> {
    let found = names.iter().position(|known| known.as_ref() == name);
    found.ok_or_else(|| Error::NoColumn {
        name: name.to_owned(),
        existing: shown(names),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn quoted_names_keep_their_commas() {
        let names = ["a", "Temp, °F", "say \"x\"", "k=v", " b", ""];
        assert_eq!(list(&shown(&names)).unwrap(), names);
        assert_eq!(list("a, b ,,c,").unwrap(), ["a", "b", "c"]);
        assert_eq!(list("").unwrap(), [""; 0]);
    }

    #[test]
    fn quotes_without_end_are_refused() {
        for text in ["\"a", "\"a\"b", "a,\"b\"\"", "\"a\"=1"] {
            assert!(matches!(list(text), Err(Error::Quote { .. })), "{text}");
        }
    }

    #[test]
    fn long_lists_are_cut_in_messages() {
        let names: Vec<String> = (0..4000).map(|i| format!("c{i}")).collect();
        let message = position(&names, "x").unwrap_err().to_string();
        assert!(message.ends_with("c19 and 3980 more") && message.len() < 200, "{message}");
        let message = position(&["n".repeat(100_000)], &"x".repeat(100_000))
            .unwrap_err()
            .to_string();
        assert!(message.len() < 300, "{message}");
    }
}
