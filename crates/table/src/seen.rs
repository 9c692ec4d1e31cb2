//! Texts of a column that were looked at before: what each was found to be, and how often it came again.
//!
//! It takes a microsecond to find that a text is neither a number nor a time in any spelling, and few texts make most columns of text.

use crate::words::Hashing;
use std::collections::HashMap;

/// Largest number of texts that are kept, and of bytes of one.
const MAX_TEXTS: usize = 512;
const MAX_LENGTH: usize = 64;

/// What a text is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Class {
    Gap,
    Boolean,
    /// It looks like a number of another spelling.
    Fault,
    Text,
}

/// Texts by what they are.
#[derive(Debug, Clone, Default)]
pub(crate) struct Seen(HashMap<String, (Class, u64), Hashing>);

/// Whether a cell may be kept: not if it begins as a number does.
pub(crate) fn is_candidate(cell: &str) -> bool {
    let begins = |byte: Option<&u8>| byte.is_some_and(|byte| byte.is_ascii_digit() || *byte == b'.');
    let bytes = cell.as_bytes();
    match bytes.first() {
        Some(b'-' | b'+') => !begins(bytes.get(1)),
        first => !begins(first),
    }
}

impl Seen {
    /// Counts a text that is known. Returns whether it is.
    pub(crate) fn count(&mut self, cell: &str) -> bool {
        match self.0.get_mut(cell) {
            Some((_, count)) => {
                *count += 1;
                true
            }
            None => false,
        }
    }

    /// Keeps a text that was looked at and counted by the caller.
    pub(crate) fn add(&mut self, cell: &str, class: Class) {
        if self.0.len() < MAX_TEXTS && cell.len() <= MAX_LENGTH {
            self.0.insert(cell.to_owned(), (class, 0));
        }
    }

    /// What was counted since the last call.
    pub(crate) fn take(&mut self) -> Vec<(String, Class, u64)> {
        let counted = self.0.iter_mut().filter(|(_, (_, count))| *count > 0);
        counted
            .map(|(text, (class, count))| (text.clone(), *class, std::mem::take(count)))
            .collect()
    }
}
