//! The kind of a column, by the counts of its cells.

use super::{Meaning, Profile};
use crate::codes;
use crate::column::{Kind, MAX_WORDS};
use crate::early::Early;
use crate::missing::{self, Spellings};

impl Profile {
    /// The kind of the column.
    pub fn kind(&self) -> Kind {
        if self.meaning == Meaning::Words && self.values() > 0 {
            return if self.words.len() <= MAX_WORDS {
                Kind::Words
            } else {
                Kind::Text
            };
        }
        if self.are_identifiers() {
            return Kind::Words;
        }
        let numbers = self.numbers + self.integers + self.faults;
        let words = self.texts + self.booleans;
        if words == self.texts && numbers + self.times == 0 && codes::have_unit(self.words.keys()) {
            // Numbers with a unit behind each, which has to be cut off.
            return Kind::Number;
        }
        if self.are_bits() {
            return Kind::Boolean;
        }
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
        } else if self.texts == 0 && (numbers == 0 || matches!(self.early, Early::TooMany)) {
            // Many different numbers are no words: they are faults among booleans.
            Kind::Boolean
        } else if self.words.len() <= MAX_WORDS && self.times == 0 && !self.has_too_many {
            Kind::Words
        } else {
            Kind::Text
        }
    }

    /// Whether cells that could be numbers are identifiers.
    fn are_identifiers(&self) -> bool {
        if self.faults + self.booleans + self.times + self.integers > 0 {
            return false;
        }
        match &self.early {
            _ if self.texts > 0 => {
                self.words.len() <= MAX_WORDS
                    && !self.has_too_many
                    && codes::are_codes(self.words.keys())
                    && (self.meaning == Meaning::Identifiers || !codes::are_hexadecimal(self.words.keys()))
            }
            Early::Words(texts) if self.padded.is_some() => {
                self.meaning == Meaning::Identifiers || codes::are_bits(texts.texts())
            }
            _ => false,
        }
    }

    /// Whether cells are booleans, also by the numbers 0 and 1.
    fn are_bits(&self) -> bool {
        let others = self.texts + self.faults + self.times + self.integers + self.fractions;
        self.booleans > 0 && others == 0 && self.range.is_none_or(|(low, high)| low >= 0.0 && high <= 1.0)
    }

    /// A cell whose digits have zeros in front, or the plus of a long number, if these are lost since the column is one of numbers.
    pub fn lost_zeros(&self) -> Option<&str> {
        let is_number = matches!(self.kind(), Kind::Number | Kind::Integer);
        self.padded.as_deref().filter(|_| is_number)
    }

    /// The words of a column of words, in the order of their letters; the usual words for a gap among numbers are words here.
    pub(crate) fn all_words(&self, gaps: &Spellings) -> Vec<String> {
        let usual = self
            .missing
            .keys()
            .filter(|word| !missing::is_usual(word, false) && !gaps.has_text(word));
        let early = match &self.early {
            Early::Words(words) => Some(words.texts()),
            Early::TooMany => None,
        };
        let early = early.into_iter().flatten();
        let mut words: Vec<String> = self.words.keys().chain(usual).chain(early).cloned().collect();
        words.sort_unstable();
        words.dedup();
        words.truncate(MAX_WORDS);
        words
    }

    /// Cells that are neither gaps nor of the column's kind.
    pub fn suspicious(&self) -> u64 {
        match self.kind() {
            Kind::Number | Kind::Integer => self.faults + self.texts + self.booleans + self.times,
            Kind::Boolean if self.are_bits() => 0,
            Kind::Boolean => self.faults + self.numbers + self.integers + self.times,
            Kind::Time => self.faults + self.texts + self.booleans + self.numbers + self.integers,
            _ => 0,
        }
    }
}
