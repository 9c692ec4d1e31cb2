//! When sensors that do not report in each row would have reported: silence is a row that is not there, or an empty cell where a value was due.

use crate::rows::instant::Instant;
use fewbits_filters::calibration::median;
use std::collections::VecDeque;

/// Number of last intervals from which the usual one is found, at least and at most.
const FEWEST: usize = 4;
const MOST: usize = 32;
/// A report is missing if it is this many usual intervals since the last.
const LATE: f64 = 1.5;
/// Intervals up to this many medians are regular, and the usual one is their median. Otherwise it is the longest of the last.
const REGULAR: f64 = 1.5;
/// After so many missing reports the sensor was silent, and the interval is not a usual one.
const SILENT: u32 = 2;

/// A column with values in at most this share of the first rows may have a rhythm of its own, if so many of its intervals are regular.
const SPARSE: f64 = 0.5;
const MOSTLY: f64 = 0.75;

/// The usual interval of each sensor.
#[derive(Debug, Default, Clone)]
pub(crate) struct Rhythm {
    sensors: Vec<Sensor>,
    /// Whether each column has a rhythm of its own. `None` if each row is a report, where all sensors have one.
    columns: Option<Vec<bool>>,
}

#[derive(Debug, Default, Clone)]
struct Sensor {
    /// Time of the last report, and of the last report or missing report.
    reported: Option<f64>,
    counted: f64,
    missing: u32,
    intervals: VecDeque<f64>,
}

impl Sensor {
    fn usual(&self) -> f64 {
        let longest = self.intervals.iter().copied().fold(0.0, f64::max);
        let middle = median(self.intervals.iter().copied().collect());
        if longest <= REGULAR * middle { middle } else { longest }
    }
}

/// Whether a column reports regularly, and less often than rows come.
fn is_slow(rows: &VecDeque<Instant>, column: usize) -> bool {
    let has_value = |row: &&Instant| {
        row.reports
            .iter()
            .any(|(sensor, cell)| *sensor == column && cell.is_some())
    };
    let times: Vec<f64> = rows.iter().filter(has_value).map(|row| row.seconds).collect();
    let intervals: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if intervals.len() < FEWEST || times.len() as f64 > SPARSE * rows.len() as f64 {
        return false;
    }
    let middle = median(intervals.clone());
    let regular = intervals
        .iter()
        .filter(|interval| **interval <= REGULAR * middle && **interval * REGULAR >= middle);
    regular.count() as f64 >= MOSTLY * intervals.len() as f64
}

impl Rhythm {
    /// Of a table with so many columns and these first rows.
    pub(crate) fn of_columns(columns: usize, rows: &VecDeque<Instant>) -> Self {
        Self {
            sensors: Vec::new(),
            columns: Some((0..columns).map(|column| is_slow(rows, column)).collect()),
        }
    }

    /// Adds an empty report for each sensor that should have reported before this instant and did not; one at an instant. Empty cells of a column
    /// with a rhythm of its own say nothing else.
    pub(crate) fn fill(&mut self, instant: &mut Instant) {
        let sensors = instant.reports.iter().map(|(sensor, _)| sensor + 1).max().unwrap_or(0);
        if self.sensors.len() < sensors {
            self.sensors.resize(sensors, Sensor::default());
        }
        let has_rhythm = |sensor: usize| {
            self.columns
                .as_ref()
                .is_none_or(|columns| columns.get(sensor) == Some(&true))
        };
        if self.columns.is_some() {
            let both = std::mem::take(&mut instant.reports)
                .into_iter()
                .zip(std::mem::take(&mut instant.qualifiers));
            let kept = both.filter(|((sensor, cell), _)| cell.is_some() || !has_rhythm(*sensor));
            (instant.reports, instant.qualifiers) = kept.unzip();
        }
        let now = instant.seconds;
        for (number, sensor) in self
            .sensors
            .iter_mut()
            .enumerate()
            .filter(|(number, _)| has_rhythm(*number))
        {
            if instant.reports.iter().any(|(other, _)| *other == number) {
                let interval = sensor
                    .reported
                    .map(|last| now - last)
                    .filter(|interval| *interval > 0.0);
                if sensor.missing < SILENT {
                    sensor.intervals.extend(interval);
                }
                while sensor.intervals.len() > MOST {
                    sensor.intervals.pop_front();
                }
                (sensor.reported, sensor.counted, sensor.missing) = (Some(now), now, 0);
            } else if sensor.intervals.len() >= FEWEST {
                let usual = sensor.usual();
                if now - sensor.counted > LATE * usual {
                    // Others may report less often: of several missing reports one counts.
                    sensor.counted += usual * ((now - sensor.counted) / usual).floor();
                    sensor.missing += 1;
                    instant.reports.push((number, None));
                }
            }
        }
    }
}
