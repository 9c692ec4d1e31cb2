//! Words of a column in its unit: `words: off, on` says that 0 is `off` and 1 is `on`. Recordings know numbers only.

use fewbits_table::names;

const PREFIX: &str = "words: ";
/// Largest length of a unit.
const MAX_UNIT: usize = 1024;

/// The unit of a column of words; empty if the words are too long for a unit.
pub fn unit(words: &[String]) -> String {
    let quoted: Vec<String> = words
        .iter()
        .map(|word| format!("\"{}\"", word.replace('"', "\"\"")))
        .collect();
    let unit = format!("{PREFIX}{}", quoted.join(","));
    if words.is_empty() || unit.len() > MAX_UNIT {
        String::new()
    } else {
        unit
    }
}

/// The words that a unit lists; `None` if it is the unit of numbers.
pub fn of(unit: &str) -> Option<Vec<String>> {
    let list = unit.strip_prefix(PREFIX)?;
    Some(
        names::pieces(list, ',')
            .iter()
            .map(|word| names::unquoted(word))
            .collect(),
    )
}

#[cfg(test)]
mod tests {
    #[test]
    fn words_return_from_a_unit() {
        let words: Vec<String> = ["off", "on, \"half\"", "ü"].map(str::to_owned).into();
        assert_eq!(super::of(&super::unit(&words)), Some(words));
        assert_eq!(super::of("degC"), None);
    }
}
