//! Rows that come late: each waits until no earlier one is expected.

use crate::rows::instant::Instant;
use std::collections::VecDeque;

/// Rows in the order of time.
pub(crate) struct Late {
    /// Seconds that a row waits; 0 if rows are in order.
    wait: f64,
    /// In the order of time.
    rows: VecDeque<Instant>,
    newest: f64,
    has_ended: bool,
    /// Time of the first row that was used, and of the last.
    first: Option<f64>,
    last: f64,
}

impl Late {
    pub(crate) fn new(wait: f64) -> Self {
        Self {
            wait,
            rows: VecDeque::new(),
            newest: f64::NEG_INFINITY,
            has_ended: false,
            first: None,
            last: f64::NEG_INFINITY,
        }
    }

    pub(crate) fn is_waiting(&self) -> bool {
        self.wait > 0.0
    }

    /// Adds a row behind those of its time.
    pub(crate) fn push(&mut self, row: Instant) {
        self.newest = self.newest.max(row.seconds);
        let at = self.rows.partition_point(|other| other.seconds <= row.seconds);
        self.rows.insert(at, row);
    }

    /// How long after the newest row one came.
    pub(crate) fn lateness(&self, row: &Instant) -> f64 {
        self.newest - row.seconds
    }

    /// There are no more rows. Returns whether none waits.
    pub(crate) fn end(&mut self) -> bool {
        self.has_ended = true;
        self.rows.is_empty()
    }

    /// The earliest row, if it has waited long enough, counted from the first one; `Err` if it is before one that was used.
    pub(crate) fn pop(&mut self) -> Option<Result<Instant, Instant>> {
        let oldest = self.rows.front()?.seconds;
        if !self.has_ended && oldest + self.wait >= self.newest {
            return None;
        }
        let mut row = self.rows.pop_front()?;
        if oldest < self.last {
            return Some(Err(row));
        }
        self.last = oldest;
        row.seconds -= *self.first.get_or_insert(oldest);
        Some(Ok(row))
    }
}
