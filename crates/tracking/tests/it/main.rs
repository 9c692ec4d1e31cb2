//! Tests of trackers through their public items, against filters written out here and against the truth of invented tables.

#![allow(clippy::unwrap_used, clippy::panic)]

mod calibration;
mod leak;
mod level;
mod ranges;
mod rows;

use fewbits_tracking::{Instant, Instants, LevelOptions, LevelRow, LevelSummary, LevelTracker, PerSensor, Rows};

/// Normal numbers, nearly: sums of twelve uniform ones.
struct Normal(u64);

impl Normal {
    fn uniform(&mut self) -> f64 {
        self.0 = self
            .0
            .wrapping_mul(6_364_136_223_846_793_005)
            .wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 11) as f64 / 2.0_f64.powi(53)
    }

    fn next(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// A level that wanders by a deviation of `change` a row from 20 on.
fn walk(normal: &mut Normal, rows: usize, change: f64) -> Vec<f64> {
    let step = |level: &mut f64, _| {
        *level += change * normal.next();
        Some(*level)
    };
    (0..rows).scan(20.0, step).collect()
}

/// Rows a second apart with these cells.
fn rows(cells: impl IntoIterator<Item = Vec<Option<f64>>>) -> Vec<Instant> {
    let row = |(k, cells): (usize, Vec<Option<f64>>)| Instant::new(k as u64 + 1, k as f64, &cells);
    cells.into_iter().enumerate().map(row).collect()
}

/// All numbers of a level are stated, and none is adapted.
fn stated(noise: f64, change: f64) -> LevelOptions {
    LevelOptions {
        noise: PerSensor::all(Some(noise)),
        change: Some((change, 1.0)),
        prior: Some((20.0, 3.0)),
        learning: Some(false),
        ..LevelOptions::default()
    }
}

/// All rows through a tracker.
fn tracked<R: Rows>(options: &LevelOptions, mut rows: Instants<R>) -> (Vec<LevelRow>, LevelSummary) {
    let mut tracker = LevelTracker::new(options, &mut rows).unwrap();
    let mut found = Vec::new();
    while let Some(instant) = rows.next().unwrap() {
        found.extend(tracker.step(rows.names(), &instant).unwrap());
    }
    (found, tracker.finish(&rows))
}
