//! Change and noise found again while rows come: the first rows hardly tell a small change, and a level that rests in them may move later.

use super::found::Unknown;
use super::instant::Instant;
use super::settings::Settings;
use crate::arguments::Model;
use std::collections::VecDeque;

/// Last rows from which the change is found if the level is lost.
const LAST: usize = 32;

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

    /// Adds an instant. If it is time, finds numbers again, and returns all rows where they differ from those before.
    pub(super) fn add(&mut self, instant: &Instant, names: &[String], settings: &mut Settings) -> Option<&[Instant]> {
        self.rows.push(instant.clone());
        if self.rows.len() < self.next {
            return None;
        }
        self.next = if self.next < self.most {
            (2 * self.next).min(self.most)
        } else {
            usize::MAX
        };
        let first = &self.rows[..self.first];
        settings
            .refine((first, &self.rows), names, &self.unknown)
            .then_some(self.rows.as_slice())
    }
}

/// The last rows of a level whose change is learnt.
pub(super) struct Last {
    rows: VecDeque<Instant>,
    most: usize,
}

impl Last {
    /// `None` if the change is not learnt from values, or is no standard deviation of steps. `reports`: rows in which
    /// each sensor reports once.
    pub(super) fn new(settings: &Settings, has_bits: bool, reports: usize) -> Option<Self> {
        let is_found = settings.world.is_learning && settings.world.model != Model::Returning && !has_bits;
        is_found.then(|| Self {
            rows: VecDeque::new(),
            most: LAST * reports,
        })
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

    /// The factor of the change's variance after the level was lost, if it is above `scale`.
    pub(super) fn scale(&mut self, settings: &Settings, names: &[String], scale: f64) -> Option<f64> {
        settings.raised(self.rows.make_contiguous(), names, scale)
    }
}
