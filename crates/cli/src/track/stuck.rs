//! Sensors that repeat one value to its last digit, though their values hardly ever did so before.

use super::instant::Instant;
use fewbits_numerics::Runs;

/// Equal values in a row from which a sensor is told to be stuck, and others before it, at least.
const LONG: u32 = 30;
/// Share of values before it that may equal the one before them.
const SELDOM: f64 = 0.05;

#[derive(Debug, Clone, Copy, Default)]
struct Repeats {
    runs: Runs,
    /// The value of the longest run of one that is stuck, and its length.
    stuck: Option<(f64, u32)>,
}

impl Repeats {
    fn add(&mut self, value: f64) {
        self.runs.add(value);
        let Runs { pairs, equal, .. } = self.runs;
        let run = self.runs.repetitions.saturating_add(1);
        let is_seldom = pairs >= LONG && f64::from(equal) <= SELDOM * f64::from(pairs);
        let is_longest = self.stuck.is_none_or(|(_, longest)| run > longest);
        if run >= LONG && is_seldom && is_longest {
            self.stuck = Some((value, run));
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
