//! What schemes that tables name briefly are called in a plot.

use std::sync::LazyLock;

/// Names in tables, and in words. One that ends in `-` stands for all that go on with a number.
static WORDS: LazyLock<Vec<(String, String)>> = LazyLock::new(|| {
    let table = csv::Reader::from_reader(include_str!("words.csv").as_bytes());
    table.into_deserialize().filter_map(Result::ok).collect()
});

/// The label with the scheme that it begins with in words.
pub(crate) fn in_words(label: &str) -> String {
    let rest = |name: &str| {
        let rest = label.strip_prefix(name)?;
        let next = rest.chars().next();
        let whole = match name.strip_suffix('-') {
            Some(_) => next.is_some_and(|c| c.is_ascii_digit()),
            None => next.is_none_or(|c| " ,:".contains(c)),
        };
        whole.then_some(rest)
    };
    let known = |(name, words): &(String, String)| Some(format!("{words}{}", rest(name)?));
    WORDS.iter().find_map(known).unwrap_or_else(|| label.to_owned())
}

#[cfg(test)]
mod tests {
    use super::{WORDS, in_words};

    #[test]
    fn all_words_are_read() {
        assert_eq!(WORDS.len(), include_str!("words.csv").lines().count() - 1);
    }

    #[test]
    fn names_become_words_and_what_follows_stays() {
        for (name, words) in [
            ("GMPA", "Gaussian messages"),
            ("gmm-4 known rate", "Gaussian mixture of 4 known rate"),
            ("guided-40", "guided draws, 40"),
            ("PF 100", "particle filter, 100"),
            ("CFwMD2", "silence used, covariance shared (CFwMD2)"),
            ("unquantized", "unquantized"),
            ("GMPAs", "GMPAs"),
        ] {
            assert_eq!(in_words(name), words);
        }
    }
}
