//! Names of columns: lists of names in options, and a name of its own for every column.

/// A list of names, separated by commas. A name with commas is quoted as in CSV: `"Temp, °F",RH`.
pub fn split(text: &str) -> Vec<String> {
    pieces(text, ',')
        .iter()
        .map(|piece| unquoted(piece.trim()))
        .filter(|name| !name.is_empty())
        .collect()
}

/// Whether a word is one of a list, which has bars between its words.
pub(crate) fn is_one_of(words: &str, word: &str) -> bool {
    words.split('|').any(|known| known == word)
}

/// The pieces of a text between the marks that stand outside of quotes, with their quotes.
pub fn pieces(text: &str, mark: char) -> Vec<String> {
    let (mut pieces, mut is_quoted) = (vec![String::new()], false);
    for c in text.chars() {
        is_quoted ^= c == '"';
        match pieces.last_mut() {
            Some(_) if c == mark && !is_quoted => pieces.push(String::new()),
            Some(last) => last.push(c),
            None => {}
        }
    }
    pieces
}

/// A name without the quotes around it; a doubled quote is one.
pub fn unquoted(name: &str) -> String {
    match name.strip_prefix('"').and_then(|name| name.strip_suffix('"')) {
        Some(inner) => inner.replace("\"\"", "\""),
        None => name.to_owned(),
    }
}

/// A name as a list of names takes it: in quotes if it has commas or quotes.
pub fn quoted(name: &str) -> String {
    if name.contains([',', '"', '=']) {
        format!("\"{}\"", name.replace('"', "\"\""))
    } else {
        name.to_owned()
    }
}

/// Names as the argument of an option in a shell: a list, in the shell's quotes where it needs them.
pub fn as_argument<S: AsRef<str>>(names: impl IntoIterator<Item = S>) -> String {
    let names: Vec<String> = names.into_iter().map(|name| quoted(name.as_ref())).collect();
    in_shell(&names.join(","))
}

/// A word in the quotes of a shell where it needs them.
pub(crate) fn in_shell(word: &str) -> String {
    let is_plain =
        |c: char| c.is_ascii_alphanumeric() || ",._-+/:%=".contains(c) || !c.is_ascii() && !c.is_whitespace();
    match !word.is_empty() && word.chars().all(is_plain) {
        true => word.to_owned(),
        false => format!("'{}'", word.replace('\'', "'\\''")),
    }
}

/// Index of a column by a name that a user wrote: the name, the name as the file has it if only one column has it, or `#3` for the third.
pub(crate) fn find(names: &[String], own_names: &[String], wanted: &str) -> Option<usize> {
    let exact = names.iter().position(|name| name == wanted);
    let own = || {
        let mut found = own_names.iter().enumerate().filter(|(_, name)| *name == wanted);
        found.next().filter(|_| found.next().is_none()).map(|(i, _)| i)
    };
    let number = || numbered(wanted).filter(|index| *index < names.len());
    exact.or_else(own).or_else(number)
}

/// The index that a name by number means: 2 of `#3`.
pub fn numbered(name: &str) -> Option<usize> {
    let number: usize = name.strip_prefix('#')?.parse().ok()?;
    number.checked_sub(1)
}

/// Names of their own: an empty one is `column_3`, and the second `A` is `A_2`.
pub(crate) fn distinct(own_names: &[String]) -> Vec<String> {
    let mut names: Vec<String> = Vec::with_capacity(own_names.len());
    let mut taken: std::collections::HashSet<String> = own_names.iter().cloned().collect();
    let mut seen = std::collections::HashSet::new();
    for (i, own) in own_names.iter().enumerate() {
        let base = if own.is_empty() {
            format!("column_{}", i + 1)
        } else {
            own.clone()
        };
        let name = if !own.is_empty() && seen.insert(own.clone()) {
            own.clone()
        } else if own.is_empty() && taken.insert(base.clone()) {
            base
        } else {
            let mut count = 2;
            while !taken.insert(format!("{base}_{count}")) {
                count += 1;
            }
            format!("{base}_{count}")
        };
        names.push(name);
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_and_names() {
        assert_eq!(split("\"Temp, °F\",RH, x"), ["Temp, °F", "RH", "x"]);
        assert_eq!(split("\"say \"\"a\"\"\""), ["say \"a\""]);
        let own: Vec<String> = ["A", "", "A", "A_2", "column_2"].map(str::to_owned).into();
        let names = distinct(&own);
        assert_eq!(names, ["A", "column_2_2", "A_3", "A_2", "column_2"]);
        assert_eq!(find(&names, &own, "A_3"), Some(2));
        assert_eq!(find(&names, &own, "#5"), Some(4));
        assert_eq!(find(&names, &own, "#6"), None);
        assert_eq!(as_argument(["RH", "°C"]), "RH,°C");
        assert_eq!(as_argument(["Temp, °F", "it's"]), "'\"Temp, °F\",it'\\''s'");
        assert_eq!(split("\"Temp, °F\",it's"), ["Temp, °F", "it's"]);
    }
}
