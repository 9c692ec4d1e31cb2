//! What the cells of a column are, counted over rows: its kind, its range, its gaps by spelling, and what looks wrong.

use crate::column::{Kind, MAX_WORDS};
use crate::early::Early;
use crate::ends::{self, End, Sentinel};
use crate::error::Place;
use crate::extent::{Extent, FewCells};
use crate::guess;
use crate::hint::{is_padded, looks_like_number, without_unit};
use crate::missing::{self, Spellings};
use crate::number::{self, Number};
use crate::quick;
use crate::seen::{Class, Seen, is_candidate};
use std::collections::BTreeMap;

mod kind;
#[cfg(feature = "parquet")]
mod typed;

/// Number of cells that are kept to find out how times are written.
const SAMPLE: usize = 64;

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
    /// Texts of numbers before the first text: they are words if the column is one of words. `None` behind that, or if there are too many.
    early: Early,
    /// Whether there are too many words by the numbers alone.
    has_too_many: bool,
    /// The unit behind the first number, if units are cut off.
    pub(crate) unit: Option<String>,
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
    /// Whether some date has a day first that is no month, and whether some has one in the second place.
    days: (bool, bool),
    /// The first number of a date of two digits each, and whether there are others: a year stands first otherwise.
    first_numbers: Option<(i64, bool)>,
    /// The first cell that is no number.
    pub first_text: Option<(Place, String)>,
    pub(crate) sample: Vec<String>,
    seen: Seen,
    /// What is said of its cells, or what its name says of them.
    pub(crate) meaning: Meaning,
    /// The first cell of digits with zeros in front.
    padded: Option<String>,
}

/// What is known of the cells of a column beside themselves.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(crate) enum Meaning {
    #[default]
    Open,
    /// Its name says that they are identifiers.
    Identifiers,
    /// The user says that they are words.
    Words,
}

/// Words of booleans.
pub(crate) fn boolean(cell: &str) -> Option<bool> {
    if cell.len() > 5 {
        return None;
    }
    match cell.to_ascii_lowercase().as_str() {
        "true" | "on" | "yes" | "1" => Some(true),
        "false" | "off" | "no" | "0" => Some(false),
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

    /// Adds a cell of a column of which the user says that it has words.
    fn add_word(&mut self, cell: &str, gaps: &Spellings) {
        if missing::is_usual(cell, false) || gaps.has_text(cell) {
            self.gap(cell);
            return;
        }
        self.keep(cell);
        self.texts += 1;
        self.word(cell);
    }

    /// Adds a trimmed cell.
    pub(crate) fn add(&mut self, cell: &str, place: Place, syntax: number::Syntax, gaps: &Spellings, strips: bool) {
        if cell.is_empty() {
            self.gap(cell);
            return;
        }
        if self.meaning == Meaning::Words {
            self.add_word(cell, gaps);
            return;
        }
        let is_candidate = is_candidate(cell);
        if is_candidate && self.sample.len() == SAMPLE && self.seen.count(cell) {
            return;
        }
        if !gaps.is_empty() && gaps.has_text(cell) {
            self.gap(cell);
            if is_candidate {
                self.seen.add(cell, Class::Gap);
            }
            return;
        }
        self.keep(cell);
        let parsed = number::read(cell.as_bytes(), syntax);
        let parsed = match (&parsed, without_unit(cell).filter(|_| strips)) {
            (Err(_), Some((number, unit))) => match number::read(number.as_bytes(), syntax) {
                Ok(_) if self.unit.get_or_insert_with(|| unit.to_owned()) != unit => parsed,
                found => found,
            },
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
            Err(_) => {
                let class = self.text(cell, place);
                if let Some(class) = class.filter(|_| is_candidate) {
                    self.seen.add(cell, class);
                }
            }
        }
    }

    /// Counts what was seen before and came again: to be called before the counts are used.
    pub(crate) fn settle(&mut self) {
        for (word, class, count) in self.seen.take() {
            match class {
                Class::Gap => {
                    *self.missing.entry(word).or_default() += count;
                    continue;
                }
                Class::Boolean => self.booleans += count,
                Class::Fault => self.faults += count,
                Class::Text => self.texts += count,
            }
            if let Some(known) = self.words.get_mut(&word) {
                *known += count;
            }
        }
    }

    /// Adds a cell of ASCII that is a short number.
    #[inline]
    pub(crate) fn add_number(&mut self, value: f64, decimals: u8, cell: &[u8], gaps: &Spellings) {
        let has_early = matches!(self.early, Early::Words(..));
        if !has_early && self.sample.len() == SAMPLE && self.texts == 0 && gaps.is_empty() {
            self.number(value, decimals, "");
            return;
        }
        let cell = std::str::from_utf8(cell).unwrap_or_default();
        if self.meaning == Meaning::Words {
            self.add_word(cell, gaps);
            return;
        }
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

    /// Adds a cell of ASCII that is a time in a usual spelling.
    pub(crate) fn add_written_time(&mut self, cell: &[u8], gaps: &Spellings) {
        if self.sample.len() < SAMPLE || !gaps.is_empty() || self.meaning == Meaning::Words {
            let text = std::str::from_utf8(cell).unwrap_or_default();
            if self.meaning == Meaning::Words {
                self.add_word(text, gaps);
                return;
            }
            if gaps.has_text(text) {
                self.gap(text);
                return;
            }
            self.keep(text);
        }
        self.times += 1;
        if let Some(date) = quick::first_two(cell) {
            self.decide(date);
        }
    }

    /// Notes what the first two numbers of a date say of their order.
    fn decide(&mut self, (first, second, has_short_year): (i64, i64, bool)) {
        if has_short_year {
            let (known, varies) = self.first_numbers.get_or_insert((first, false));
            *varies |= *known != first;
        }
        self.days.0 |= (13..=31).contains(&first);
        self.days.1 |= (13..=31).contains(&second);
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
        } else if self.early.add(cell) && self.padded.is_none() && is_padded(cell) {
            self.padded = Some(cell.to_owned());
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

    /// Counts a cell that is no number. What it is; `None` if it is a time.
    fn text(&mut self, cell: &str, place: Place) -> Option<Class> {
        if missing::is_usual(cell, false) {
            self.gap(cell);
            return Some(Class::Gap);
        }
        let class = if boolean(cell).is_some() {
            self.booleans += 1;
            Class::Boolean
        } else if missing::is_usual(cell, true) {
            // A gap among numbers, a word among words.
            self.gap(cell);
            return Some(Class::Gap);
        } else if guess::looks_like_time(cell) {
            self.times += 1;
            if let Some(([first, second, _], is_short)) = guess::three(cell) {
                self.decide((first, second, is_short));
            }
            return None;
        } else if looks_like_number(cell) {
            self.faults += 1;
            Class::Fault
        } else {
            self.texts += 1;
            match std::mem::replace(&mut self.early, Early::TooMany) {
                Early::Words(words) => self.words.extend(words.counted()),
                Early::TooMany => self.has_too_many |= self.texts == 1,
            }
            Class::Text
        };
        self.first_text.get_or_insert_with(|| (place, cell.to_owned()));
        self.word(cell);
        Some(class)
    }

    fn keep(&mut self, cell: &str) {
        if self.sample.len() < SAMPLE {
            self.sample.push(cell.to_owned());
        }
    }

    /// Number of cells that are no gaps.
    pub fn values(&self) -> u64 {
        self.numbers + self.integers + self.booleans + self.times + self.texts + self.faults
    }

    /// Order of day and month that the dates of the column decide, as `--time-format` says it: `dmy` if some have a first number beyond
    /// 12, `mdy` if some have such a second one. `None` if none has, or both occur.
    pub fn day_order(&self) -> Option<&'static str> {
        match self.days {
            // A number that stays in front of two others of two digits may be the year.
            (true, false) => Some("dmy").filter(|_| self.first_numbers.is_none_or(|(_, varies)| varies)),
            (false, true) => Some("mdy"),
            _ => None,
        }
    }

    /// Number of gaps.
    pub fn gaps(&self) -> u64 {
        self.missing.values().sum()
    }

    /// Smallest and largest number of a column of [`Kind::Integer`], which doubles may not hold.
    pub fn whole_range(&self) -> Option<(i64, i64)> {
        self.whole.filter(|_| self.kind() == Kind::Integer)
    }

    /// A few cells that make most of the range; or more of them, if they have a value that usually stands for a gap, as -9999.
    pub fn few(&self) -> Option<FewCells> {
        let ends = self.range?;
        self.extent.few(ends).or_else(|| {
            let sentinel = self.sentinel()?;
            Some(FewCells {
                ends,
                most: sentinel.range_without,
                share_outside: sentinel.count as f64 / (self.numbers + self.integers) as f64,
            })
        })
    }

    /// A value that makes three quarters of the range or more and that a twentieth of the cells or less have; up to nine tenths, if it is one
    /// that usually stands for a gap.
    pub fn sentinel(&self) -> Option<Sentinel> {
        ends::sentinel(self.range?, self.low, self.high, self.numbers + self.integers)
    }
}
