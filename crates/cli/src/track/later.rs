//! Change and noise found again while rows come: the first rows hardly tell a small change, and a level that rests in them may move later.

use super::instant::Instant;
use std::collections::VecDeque;

/// Last rows from which the change is found if the level is lost.
const LAST: usize = 32;

/// What is found from the first rows, and the deviation of rounding, which a noise is not below.
pub(super) struct Unknown {
    pub(super) change: bool,
    pub(super) noise: bool,
    pub(super) floor: f64,
}

/// Rows of a stream from which numbers are found again and again, each time from twice as many.
pub(super) struct Later {
    unknown: Unknown,
    rows: Vec<Instant>,
    /// Number of the rows from which numbers were found first, of those from which they are found next, and of those from which they are found last.
    first: usize,
    next: usize,
    most: usize,
}

impl Later {
    pub(super) fn new(unknown: Unknown, first: usize, most: usize) -> Self {
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
    pub(super) fn is_done(&self) -> bool {
        self.next > self.most
    }

    /// What is found, and from how many rows it was found first.
    pub(super) fn unknown(&self) -> (&Unknown, usize) {
        (&self.unknown, self.first)
    }

    /// Adds an instant. All so far, if it is time to find numbers again.
    pub(super) fn add(&mut self, instant: &Instant) -> Option<&[Instant]> {
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

/// The last rows of a level whose change is learnt.
pub(super) struct Last {
    rows: VecDeque<Instant>,
    most: usize,
}

impl Last {
    /// `reports`: rows in which each sensor reports once.
    pub(super) fn new(reports: usize) -> Self {
        Self {
            rows: VecDeque::new(),
            most: LAST * reports,
        }
    }

    /// Adds a row; `is_used`: whether a sensor's values count.
    pub(super) fn add(&mut self, row: &Instant, is_used: impl Fn(usize) -> bool) {
        let mut row = row.clone();
        for (sensor, cell) in &mut row.reports {
            *cell = cell.filter(|_| is_used(*sensor));
        }
        self.rows.push_back(row);
        if self.rows.len() > self.most {
            self.rows.pop_front();
        }
    }

    pub(super) fn rows(&mut self) -> &[Instant] {
        self.rows.make_contiguous()
    }
}
