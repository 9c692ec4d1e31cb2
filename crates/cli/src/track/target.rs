//! One of several targets in a table of `ranges`.

use std::rc::Rc;

/// A target of a table.
pub(super) struct Target {
    pub(super) name: String,
    pub(super) rows: OfTarget,
    /// The names of all.
    pub(super) all: Rc<[String]>,
}

/// The number of a target, and that of each row.
#[derive(Clone)]
pub(super) struct OfTarget {
    number: usize,
    rows: Rc<[Option<usize>]>,
}

impl OfTarget {
    /// The rows of the target of this number; each row has the number of its target.
    pub(super) fn new(number: usize, rows: Rc<[Option<usize>]>) -> Self {
        Self { number, rows }
    }

    /// Whether a row, counted from 1, is of this target.
    pub(super) fn has(&self, row: u64) -> bool {
        let place = usize::try_from(row).unwrap_or(usize::MAX).wrapping_sub(1);
        self.rows.get(place).copied().flatten() == Some(self.number)
    }
}
