//! Distinct texts of the numbers that come first in a column: they are words if texts follow, as in `7`, `8`, `A1`.

use crate::column::MAX_WORDS;
use crate::words::Hashing;
use std::collections::HashMap;

/// Texts of numbers, or that there are too many.
#[derive(Debug, Clone)]
pub(crate) enum Early {
    Words(Texts),
    TooMany,
}

/// Texts and how often each came.
#[derive(Debug, Clone, Default)]
pub(crate) struct Texts {
    counts: HashMap<String, u64, Hashing>,
    /// The last one, and how often it came again, which is not counted yet.
    last: String,
    again: u64,
}

impl Default for Early {
    fn default() -> Self {
        Self::Words(Texts::default())
    }
}

impl Early {
    /// Adds a text. Returns whether it is kept, or one too many.
    pub(crate) fn add(&mut self, cell: &str) -> bool {
        let Self::Words(texts) = self else { return false };
        if texts.last == cell {
            texts.again += 1;
            return false;
        }
        texts.settle();
        cell.clone_into(&mut texts.last);
        if texts.counts.len() > MAX_WORDS {
            *self = Self::TooMany;
        } else if let Some(count) = texts.counts.get_mut(cell) {
            *count += 1;
            return false;
        } else {
            texts.counts.insert(cell.to_owned(), 1);
        }
        true
    }
}

impl Texts {
    fn settle(&mut self) {
        if self.again > 0
            && let Some(count) = self.counts.get_mut(&self.last)
        {
            *count += self.again;
        }
        self.again = 0;
    }

    /// All of them with their counts.
    pub(crate) fn counted(mut self) -> impl Iterator<Item = (String, u64)> {
        self.settle();
        self.counts.into_iter()
    }

    pub(crate) fn texts(&self) -> impl Iterator<Item = &String> + Clone {
        self.counts.keys()
    }
}
