//! Change and noise found again while rows come: the first rows hardly tell a small change, and a level that rests in them may move later.

use crate::rows::instant::Instant;

/// What is found from the first rows, and the deviation of rounding, which a noise is not below.
#[derive(Clone)]
pub(crate) struct Unknown {
    pub(crate) change: bool,
    pub(crate) noise: bool,
    pub(crate) floor: f64,
}

/// Rows of a stream from which numbers are found again and again, each time from twice as many.
#[derive(Clone)]
pub(crate) struct Later {
    unknown: Unknown,
    rows: Vec<Instant>,
    /// Number of the rows from which numbers were found first, of those from which they are found next, and of those from which they are found last.
    first: usize,
    next: usize,
    most: usize,
}

impl Later {
    pub(crate) fn new(unknown: Unknown, first: usize, most: usize) -> Self {
        Self {
            unknown,
            rows: Vec::new(),
            first,
            next: if first < most {
                (2 * first).min(most)
            } else {
                usize::MAX
            },
            most,
        }
    }

    /// Whether no further rows are needed.
    pub(crate) fn is_done(&self) -> bool {
        self.next > self.most
    }

    /// What is found, and from how many rows it was found first.
    pub(crate) fn unknown(&self) -> (&Unknown, usize) {
        (&self.unknown, self.first)
    }

    /// Adds an instant. All so far, if it is time to find numbers again.
    pub(crate) fn add(&mut self, instant: &Instant) -> Option<&[Instant]> {
        self.rows.push(instant.clone());
        if self.rows.len() < self.next {
            return None;
        }
        self.next = if self.next < self.most {
            (2 * self.next).min(self.most)
        } else {
            usize::MAX
        };
        Some(&self.rows)
    }
}
