//! What schemes that tables name briefly are called in a plot.

/// Names in tables, and in words. One that ends in `-` stands for all that go on with a number.
const WORDS: [(&str, &str); 51] = [
    ("ADF", "assumed density"),
    ("CFoMD", "silence ignored (CFoMD)"),
    ("CFwMD", "silence used (CFwMD)"),
    ("CFwMD2", "silence used, covariance shared (CFwMD2)"),
    ("Dymbo", "sign bits"),
    ("Dymbo-multibit", "innovation words of one sensor"),
    ("EKF-Q", "extended Kalman"),
    ("EKF-Q-naive", "extended Kalman, naive"),
    ("EKF-U", "extended Kalman, unquantized"),
    ("GMPA", "Gaussian messages"),
    ("GMPA-transfer", "Gaussian messages, transfer"),
    ("Lloyd-Max-filter", "Lloyd-Max, filter"),
    ("Lloyd-Max-table", "Lloyd-Max, table"),
    ("MI-table", "most information, table"),
    ("PF", "particle filter,"),
    ("RBPF", "Rao-Blackwell particles,"),
    ("all-send", "all measurements"),
    ("bootstrap", "bootstrap filter"),
    ("bootstrap-", "bootstrap filter, "),
    ("cramer-rao", "Cramér-Rao"),
    ("dpcm-0", "deadband, last value"),
    ("dpcm-1", "deadband, last slope"),
    ("eq14", "equation (14), printed"),
    ("eq14_exact", "equation (14), exact"),
    ("gaussian", "Gaussian"),
    ("gaussian-", "Gaussian, numbers: "),
    ("genie", "order known"),
    ("gmm-", "Gaussian mixture of "),
    ("gnn", "likelier order"),
    ("grid-", "grid of "),
    ("guided", "guided draws"),
    ("guided-", "guided draws, "),
    ("improved-", "messages, improved, "),
    ("innovation-words", "innovation words"),
    ("jayant", "Jayant's quantizer"),
    ("jpda", "joint probabilistic"),
    ("logistic", "logistic rule"),
    ("lpg-1x5", "polynomial Gaussian of degree 5"),
    ("lpg-2x5", "two polynomial Gaussians"),
    ("mahalanobis", "Mahalanobis"),
    ("mht", "all hypotheses"),
    ("modulation", "delta modulation"),
    ("narrow-", "messages, narrow, "),
    ("particles-", "particles: "),
    ("patterns-table", "bit patterns, table"),
    ("pf-exact", "particles, exact"),
    ("pf-tanh", "particles, tanh"),
    ("published-", "messages, published, "),
    ("quantized-ranges", "quantized ranges"),
    ("rao-blackwell", "Rao-Blackwell filter"),
    ("rao-blackwell-", "Rao-Blackwell filter, "),
];

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
    let known = |(name, words): &(&str, &str)| Some(format!("{words}{}", rest(name)?));
    WORDS.iter().find_map(known).unwrap_or_else(|| label.to_owned())
}

#[cfg(test)]
mod tests {
    use super::in_words;

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
