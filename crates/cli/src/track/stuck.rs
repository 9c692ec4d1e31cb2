//! Sensors that repeat one value to its last digit, though their values hardly ever did so before.

use super::instant::Instant;

/// Equal values in a row from which a sensor is told to be stuck, and others before it, at least.
const LONG: usize = 30;
/// Share of values before it that may equal the one before them.
const SELDOM: f64 = 0.05;

#[derive(Debug, Clone, Copy, Default)]
struct Repeats {
    last: Option<f64>,
    /// Values so far; those that equal the one before them, outside the present run.
    count: usize,
    equal: usize,
    run: usize,
    /// The value of the longest run of one that is stuck, and its length.
    stuck: Option<(f64, usize)>,
}

impl Repeats {
    fn add(&mut self, value: f64) {
        self.count += 1;
        if self.last == Some(value) {
            self.run += 1;
            let before = self.count - self.run;
            let is_seldom = before >= LONG && self.equal as f64 <= SELDOM * before as f64;
            let is_longest = self.stuck.is_none_or(|(_, longest)| self.run > longest);
            if self.run >= LONG && is_seldom && is_longest {
                self.stuck = Some((value, self.run));
            }
        } else {
            self.equal += self.run.saturating_sub(1);
            (self.last, self.run) = (Some(value), 1);
        }
    }
}

/// Looks in all rows for sensors that are stuck.
#[derive(Debug, Default)]
pub(super) struct Stuck(Vec<Repeats>);

impl Stuck {
    pub(super) fn add(&mut self, instant: &Instant) {
        for (sensor, cell) in &instant.reports {
            let Some(value) = cell.filter(|cell| cell.is_finite()) else {
                continue;
            };
            if self.0.len() <= *sensor {
                self.0.resize(sensor + 1, Repeats::default());
            }
            self.0[*sensor].add(value);
        }
    }

    /// A line for each sensor that is stuck.
    pub(super) fn hints(&self, names: &[String]) -> Vec<String> {
        let of = |(repeats, name): (&Repeats, &String)| {
            let (value, run) = repeats.stuck?;
            Some(format!(
                "{name} is {value} in {run} values in a row, which its values hardly ever repeat otherwise: it may be stuck; --without {name} \
                 leaves it out"
            ))
        };
        self.0.iter().zip(names).filter_map(of).collect()
    }
}
