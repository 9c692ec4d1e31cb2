//! Spellings of a missing sample.

/// Spellings that mean a gap in every column.
const ALWAYS: [&str; 14] = [
    "", "na", "n/a", "n.a.", "null", "none", "#n/a", "#na", "<na>", "nat", "nil", "nodata", "no data", "\\n",
];
/// Spellings that mean a gap in a column of numbers; in a column of words they are words.
const AMONG_NUMBERS: [&str; 14] = [
    "?",
    "-",
    "--",
    "---",
    "–",
    "—",
    ".",
    "*",
    "m",
    "mm",
    "missing",
    "unavailable",
    "unknown",
    "#n/a n/a",
];

/// Whether a trimmed cell is a gap by the usual spellings.
pub(crate) fn is_usual(cell: &str, among_numbers: bool) -> bool {
    if cell.is_empty() {
        return true;
    }
    // The longest spelling has 11 bytes, and none begins with a digit.
    if cell.len() > 11 || cell.as_bytes()[0].is_ascii_digit() {
        return false;
    }
    let lower = cell.to_ascii_lowercase();
    ALWAYS.contains(&lower.as_str()) || (among_numbers && AMONG_NUMBERS.contains(&lower.as_str()))
}

/// Further spellings that a user named, for all columns or one.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Spellings {
    words: Vec<String>,
    numbers: Vec<f64>,
}

impl Spellings {
    pub(crate) fn new<'a>(words: impl Iterator<Item = &'a str>) -> Self {
        let words: Vec<String> = words.map(str::to_owned).collect();
        let numbers = words
            .iter()
            .filter_map(|word| word.trim().parse().ok())
            .filter(|x: &f64| x.is_finite())
            .collect();
        Self { words, numbers }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.words.is_empty()
    }

    /// Whether the text of a cell is one of them. Numbers are also found in another spelling: `-9999` names `-9999.00` too.
    pub(crate) fn has_text(&self, cell: &str) -> bool {
        self.words.iter().any(|word| word == cell)
    }

    pub(crate) fn has_number(&self, value: f64) -> bool {
        self.numbers.contains(&value)
    }

    pub(crate) fn has_numbers(&self) -> bool {
        !self.numbers.is_empty()
    }
}
