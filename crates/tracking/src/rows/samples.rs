//! Measurements of sensors that send on change: those that they did not send, at times without a row.

use crate::rows::instant::{Instant, Qualifier};
use std::collections::VecDeque;

/// Times nearer than this share of the interval are equal.
const EQUAL: f64 = 0.25;
/// Measurements in a gap that are counted one by one. In longer gaps fewer are, at equal distances.
const MOST: f64 = 3000.0;

/// When each sensor measured.
#[derive(Debug)]
pub(crate) struct Samples {
    /// Seconds between measurements.
    interval: f64,
    /// Time of the last measurement of each sensor.
    last: Vec<Option<f64>>,
    /// Instants that were made, in the order of time.
    ready: VecDeque<Instant>,
}

impl Samples {
    pub(crate) fn new(interval: f64) -> Self {
        Self {
            interval,
            last: Vec::new(),
            ready: VecDeque::new(),
        }
    }

    /// The next instant.
    pub(crate) fn next(&mut self) -> Option<Instant> {
        self.ready.pop_front()
    }

    /// Adds a row, and before it the measurements that were not sent.
    pub(crate) fn add(&mut self, mut row: Instant) {
        let count = row.reports.iter().map(|(sensor, _)| sensor + 1).max().unwrap_or(0);
        if self.last.len() < count {
            self.last.resize(count, None);
        }
        let mut silent: Vec<(f64, usize)> = Vec::new();
        for (sensor, last) in self.last.iter_mut().enumerate() {
            let Some(begin) = *last else { continue };
            let passed = ((row.seconds - begin) / self.interval + EQUAL).floor();
            let stride = (passed / MOST).ceil().max(1.0);
            let mut number = 1.0;
            // One at the row itself is a cell of the row.
            while begin + number * self.interval < row.seconds - EQUAL * self.interval {
                silent.push((begin + number * self.interval, sensor));
                *last = Some(begin + number * self.interval);
                number += if passed - number > 2.0 * stride { stride } else { 1.0 };
            }
        }
        silent.sort_by(|one, other| one.0.total_cmp(&other.0));
        for (seconds, sensor) in silent {
            match self
                .ready
                .back_mut()
                .filter(|before| !before.is_row && before.seconds == seconds)
            {
                Some(before) => {
                    before.reports.push((sensor, None));
                    before.qualifiers.push(Qualifier::default());
                }
                None => self.ready.push_back(Instant {
                    seconds,
                    time: row.time.clone(),
                    row: row.row,
                    is_row: false,
                    reports: vec![(sensor, None)],
                    qualifiers: vec![Qualifier::default()],
                }),
            }
        }
        // An empty cell where another sensor reports is a measurement only if it is time for one.
        let (mut reports, mut qualifiers) = (Vec::new(), Vec::new());
        for (report, own) in row.reports.iter().zip(&row.qualifiers) {
            let last = &mut self.last[report.0];
            let is_due = |last: f64| {
                let apart = (row.seconds - last) / self.interval;
                apart > EQUAL && (apart - apart.round()).abs() <= EQUAL
            };
            if report.1.is_some() || last.is_some_and(is_due) {
                *last = Some(row.seconds);
                reports.push(*report);
                qualifiers.push(*own);
            }
        }
        (row.reports, row.qualifiers) = (reports, qualifiers);
        self.ready.push_back(row);
    }
}
