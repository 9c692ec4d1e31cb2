//! What the cells of a column are, counted over rows: its kind, its range, its gaps by spelling, and what looks wrong.

use crate::column::{Kind, MAX_WORDS};
use crate::error::Place;
use crate::extent::{Extent, FewCells};
use crate::guess;
use crate::missing::{self, Spellings};
use crate::number::{self, Number};
use std::collections::BTreeMap;

/// Number of cells that are kept to find out how times are written.
const SAMPLE: usize = 64;
/// A range that shrinks by this factor without one value, at either end, is made by that value.
const SHRINK: f64 = 4.0;

/// Counts over the cells of a column.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Profile {
    /// Cells that are doubles.
    pub numbers: u64,
    /// Whole numbers that are no doubles.
    pub integers: u64,
    /// Doubles that are not whole.
    fractions: u64,
    booleans: u64,
    times: u64,
    texts: u64,
    /// Texts that look like numbers of another spelling.
    faults: u64,
    /// Gaps by their spelling.
    pub missing: BTreeMap<String, u64>,
    /// Words and how often each occurs, up to [`MAX_WORDS`] and one more.
    pub words: BTreeMap<String, u64>,
    /// Smallest and largest finite number.
    pub range: Option<(f64, f64)>,
    low: End,
    high: End,
    extent: Extent,
    /// Smallest and largest whole number, exact also beyond doubles.
    whole: Option<(i64, i64)>,
    /// Largest number of decimals.
    pub decimals: u8,
    /// The first cell that is no number.
    pub first_text: Option<(Place, String)>,
    pub(crate) sample: Vec<String>,
}

/// The extreme value at one end, how often it occurs, and the next.
#[derive(Debug, Clone, Copy, Default)]
struct End {
    value: f64,
    count: u64,
    next: Option<f64>,
}

impl End {
    /// Adds a value; `sign` is 1 at the upper end and -1 at the lower.
    fn add(&mut self, value: f64, sign: f64) {
        let beyond = |a: f64, b: f64| sign * a > sign * b;
        if self.count == 0 {
            *self = Self {
                value,
                count: 1,
                next: None,
            };
        } else if value == self.value {
            self.count += 1;
        } else if beyond(value, self.value) {
            *self = Self {
                value,
                count: 1,
                next: Some(self.value),
            };
        } else if self.next.is_none_or(|next| beyond(value, next)) {
            self.next = Some(value);
        }
    }
}

/// A value that may stand for a gap: it makes most of the range of its column, and few cells have it.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Sentinel {
    /// The value.
    pub value: f64,
    /// Cells that have it.
    pub count: u64,
    /// The range without it.
    pub range_without: (f64, f64),
}

/// Words of booleans.
pub(crate) fn boolean(cell: &str) -> Option<bool> {
    if cell.len() > 5 {
        return None;
    }
    match cell.to_ascii_lowercase().as_str() {
        "true" | "on" | "yes" => Some(true),
        "false" | "off" | "no" => Some(false),
        _ => None,
    }
}

impl Profile {
    /// Profiles of the columns of a table, without cells.
    pub(crate) fn of_columns(columns: usize) -> Vec<Self> {
        let profile = Self {
            extent: Extent::new(columns),
            ..Self::default()
        };
        vec![profile; columns]
    }

    /// Adds a trimmed cell.
    pub(crate) fn add(&mut self, cell: &str, place: Place, syntax: number::Syntax, gaps: &Spellings, strips: bool) {
        if cell.is_empty() || (!gaps.is_empty() && gaps.has_text(cell)) {
            self.gap(cell);
            return;
        }
        self.keep(cell);
        let parsed = number::parse(cell.as_bytes(), syntax);
        let parsed = match (&parsed, strips) {
            (Err(_), true) => {
                number::without_unit(cell).map_or(parsed, |(number, _)| number::parse(number.as_bytes(), syntax))
            }
            _ => parsed,
        };
        match parsed {
            Ok(Number::Double(value, _)) if gaps.has_number(value) => self.gap(cell),
            Ok(Number::Double(value, decimals)) => self.number(value, decimals, cell),
            Ok(Number::Whole(whole)) => {
                self.integers += 1;
                self.extend(whole as f64);
                self.extend_whole(whole);
            }
            Err(_) => self.text(cell, place),
        }
    }

    /// Adds a cell that is a short number.
    #[inline]
    pub(crate) fn add_number(&mut self, value: f64, decimals: u8, cell: &str, gaps: &Spellings) {
        if !gaps.is_empty() && gaps.has_text(cell) {
            self.gap(cell);
            return;
        }
        self.keep(cell);
        if gaps.has_number(value) {
            self.gap(cell);
        } else {
            self.number(value, decimals, cell);
        }
    }

    /// Adds a cell that is a time with a date.
    pub(crate) fn add_written_time(&mut self, cell: &str, gaps: &Spellings) {
        if !gaps.is_empty() && gaps.has_text(cell) {
            self.gap(cell);
            return;
        }
        self.keep(cell);
        self.times += 1;
    }

    fn gap(&mut self, cell: &str) {
        match self.missing.get_mut(cell) {
            Some(count) => *count += 1,
            None => {
                self.missing.insert(cell.to_owned(), 1);
            }
        }
    }

    fn number(&mut self, value: f64, decimals: u8, cell: &str) {
        self.numbers += 1;
        self.decimals = self.decimals.max(decimals);
        // The cast of a double beyond 64 bits saturates: all of these are whole.
        let whole = value as i64;
        if whole as f64 == value {
            self.extend_whole(whole);
        } else {
            self.fractions += u64::from(value.abs() < 9.3e18);
        }
        if value.is_finite() {
            self.extend(value);
        }
        // Numbers may be words among words: `A1`, `7`, `B2`.
        if self.texts > 0 {
            self.word(cell);
        }
    }

    fn extend(&mut self, value: f64) {
        let (low, high) = self.range.unwrap_or((value, value));
        self.range = Some((low.min(value), high.max(value)));
        self.low.add(value, -1.0);
        self.high.add(value, 1.0);
        self.extent.push(value);
    }

    fn extend_whole(&mut self, whole: i64) {
        let (low, high) = self.whole.unwrap_or((whole, whole));
        self.whole = Some((low.min(whole), high.max(whole)));
    }

    fn word(&mut self, cell: &str) {
        if let Some(count) = self.words.get_mut(cell) {
            *count += 1;
        } else if self.words.len() <= MAX_WORDS {
            self.words.insert(cell.to_owned(), 1);
        }
    }

    fn text(&mut self, cell: &str, place: Place) {
        if missing::is_usual(cell, false) {
            self.gap(cell);
            return;
        }
        if boolean(cell).is_some() {
            self.booleans += 1;
        } else if missing::is_usual(cell, true) {
            // A gap among numbers, a word among words.
            self.gap(cell);
            return;
        } else if guess::looks_like_time(cell) {
            self.times += 1;
            return;
        } else if number::looks_like_number(cell) {
            self.faults += 1;
        } else {
            self.texts += 1;
        }
        self.first_text.get_or_insert_with(|| (place, cell.to_owned()));
        self.word(cell);
    }

    /// Adds a cell that is a double.
    #[cfg(feature = "parquet")]
    pub(crate) fn add_double(&mut self, value: Option<f64>, gaps: &Spellings) {
        match value.filter(|value| !gaps.has_number(*value)) {
            None => self.gap(""),
            Some(value) => {
                let text = if self.sample.len() < SAMPLE {
                    format!("{value}")
                } else {
                    String::new()
                };
                self.keep(&text);
                self.number(value, 0, &text);
            }
        }
    }

    /// Adds a cell that is a whole number.
    #[cfg(feature = "parquet")]
    pub(crate) fn add_integer(&mut self, value: Option<i64>, gaps: &Spellings) {
        match value {
            Some(whole) if (whole as f64) as i128 != i128::from(whole) => {
                self.keep(&whole.to_string());
                self.integers += 1;
                self.extend(whole as f64);
                self.extend_whole(whole);
            }
            value => self.add_double(value.map(|whole| whole as f64), gaps),
        }
    }

    /// Adds a cell that is a time, in seconds.
    #[cfg(feature = "parquet")]
    pub(crate) fn add_time(&mut self, seconds: Option<f64>) {
        match seconds {
            None => self.gap(""),
            Some(_) => self.times += 1,
        }
    }

    /// Adds a cell that is a boolean.
    #[cfg(feature = "parquet")]
    pub(crate) fn add_boolean(&mut self, value: Option<bool>) {
        match value {
            None => self.gap(""),
            Some(_) => self.booleans += 1,
        }
    }

    fn keep(&mut self, cell: &str) {
        if self.sample.len() < SAMPLE {
            self.sample.push(cell.to_owned());
        }
    }

    /// The kind of the column.
    pub fn kind(&self) -> Kind {
        let numbers = self.numbers + self.integers + self.faults;
        let words = self.texts + self.booleans;
        if numbers >= words.max(self.times).max(1) {
            // Few words among numbers are faults, not words of an enumeration.
            return if self.integers > 0 && self.fractions == 0 {
                Kind::Integer
            } else {
                Kind::Number
            };
        }
        if self.times > 0 && self.times >= words {
            Kind::Time
        } else if words == 0 {
            Kind::Number
        } else if self.texts == 0 && numbers == 0 {
            Kind::Boolean
        } else if self.words.len() <= MAX_WORDS && self.times == 0 {
            Kind::Words
        } else {
            Kind::Text
        }
    }

    /// The words of a column of words, in the order of their letters; the usual words for a gap among numbers are words here.
    pub(crate) fn all_words(&self, gaps: &Spellings) -> Vec<String> {
        let usual = self
            .missing
            .keys()
            .filter(|word| !missing::is_usual(word, false) && !gaps.has_text(word));
        let mut words: Vec<String> = self.words.keys().chain(usual).cloned().collect();
        words.sort_unstable();
        words.truncate(MAX_WORDS);
        words
    }

    /// Number of cells that are no gaps.
    pub fn values(&self) -> u64 {
        self.numbers + self.integers + self.booleans + self.times + self.texts + self.faults
    }

    /// Number of gaps.
    pub fn gaps(&self) -> u64 {
        self.missing.values().sum()
    }

    /// Cells that are neither gaps nor of the column's kind.
    pub fn suspicious(&self) -> u64 {
        match self.kind() {
            Kind::Number | Kind::Integer => self.faults + self.texts + self.booleans + self.times,
            Kind::Time => self.faults + self.texts + self.booleans + self.numbers + self.integers,
            _ => 0,
        }
    }

    /// Smallest and largest number of a column of [`Kind::Integer`], which doubles may not hold.
    pub fn whole_range(&self) -> Option<(i64, i64)> {
        self.whole.filter(|_| self.kind() == Kind::Integer)
    }

    /// A few cells that make most of the range.
    pub fn few(&self) -> Option<FewCells> {
        self.extent.few(self.range?)
    }

    /// A value that makes three quarters of the range or more and that a twentieth of the cells or less have.
    pub fn sentinel(&self) -> Option<Sentinel> {
        let (low, high) = self.range?;
        let all = self.numbers + self.integers;
        let rare = |count: u64| 20 * count <= all || count == 1;
        let found = |end: End, without: (f64, f64)| {
            let is_made = high - low > SHRINK * (without.1 - without.0) && without.1 > without.0;
            (rare(end.count) && is_made && all >= 8).then_some(Sentinel {
                value: end.value,
                count: end.count,
                range_without: without,
            })
        };
        let lower = self.low.next.and_then(|next| found(self.low, (next, high)));
        lower.or_else(|| self.high.next.and_then(|next| found(self.high, (low, next))))
    }
}
