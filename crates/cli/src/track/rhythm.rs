//! When sensors of a table of single reports would have reported: silence is a row that is not there.

use super::instant::Instant;
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

/// The usual interval of each sensor.
#[derive(Debug, Default)]
pub(super) struct Rhythm {
    sensors: Vec<Sensor>,
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

impl Rhythm {
    /// Adds an empty report for each sensor that should have reported before this instant and did not; one at an instant.
    pub(super) fn fill(&mut self, instant: &mut Instant) {
        let sensors = instant.reports.iter().map(|(sensor, _)| sensor + 1).max().unwrap_or(0);
        if self.sensors.len() < sensors {
            self.sensors.resize(sensors, Sensor::default());
        }
        let now = instant.seconds;
        for (number, sensor) in self.sensors.iter_mut().enumerate() {
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
