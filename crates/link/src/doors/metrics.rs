//! The text format of Prometheus.

use crate::station::{Counts, Step};
use fewbits_core::Observation;
use std::fmt;

/// Name, help and value of a counter of a sensor.
type Counter = (&'static str, &'static str, fn(&Sensor) -> u64);
/// Name, help and state of a flag of a sensor.
type Flag = (&'static str, &'static str, fn(&Sensor) -> bool);

/// What a sensor has done so far.
#[derive(Debug, Clone, Copy, Default)]
struct Sensor {
    number: u32,
    reports: u64,
    bits: u64,
    lost: u64,
    is_asked: bool,
    /// `None` before the first question: nothing is known then.
    working: Option<f64>,
    dead: bool,
    excluded: bool,
}

/// Numbers of a centre for Prometheus. `Display` writes the text format, version 0.0.4.
#[derive(Debug, Clone, Default)]
pub struct Metrics {
    slot: u64,
    steps: u64,
    troubles: u64,
    estimate: Vec<(f64, f64)>,
    sensors: Vec<Sensor>,
    counts: Counts,
}

impl Metrics {
    /// Takes in a step; `numbers` are those of its sensors.
    pub fn take(&mut self, step: &Step, counts: Counts, numbers: &[u32]) {
        self.slot = step.slot;
        self.steps += 1;
        self.troubles += u64::from(step.trouble.is_some());
        self.estimate.clone_from(&step.estimate);
        self.counts = counts;
        self.sensors.resize(numbers.len(), Sensor::default());
        for (i, (sensor, number)) in self.sensors.iter_mut().zip(numbers).enumerate() {
            sensor.number = *number;
            match step.observed.get(i) {
                Some(Observation::Received(report)) => {
                    sensor.reports += 1;
                    sensor.bits += report.bits() as u64;
                }
                Some(Observation::Lost) => sensor.lost += 1,
                _ => {}
            }
            sensor.is_asked |= step.asked.get(i).copied().unwrap_or(false);
            if let Some(health) = step.health.get(i) {
                sensor.working = sensor.is_asked.then_some(health.working);
                (sensor.dead, sensor.excluded) = (health.dead, health.excluded);
            }
        }
    }
}

impl fmt::Display for Metrics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let head = |f: &mut fmt::Formatter<'_>, name: &str, kind: &str, help: &str| {
            writeln!(f, "# HELP fewbits_{name} {help}\n# TYPE fewbits_{name} {kind}")
        };
        head(f, "slot", "gauge", "Number of the last slot.")?;
        writeln!(f, "fewbits_slot {}", self.slot)?;
        head(f, "steps_total", "counter", "Slots with an update since the start.")?;
        writeln!(f, "fewbits_steps_total {}", self.steps)?;
        head(f, "troubled_steps_total", "counter", "Slots whose update did not use all observations.")?;
        writeln!(f, "fewbits_troubled_steps_total {}", self.troubles)?;
        head(f, "estimate", "gauge", "Mean of a coordinate of the state.")?;
        for (i, (mean, _)) in self.estimate.iter().enumerate() {
            writeln!(f, "fewbits_estimate{{coordinate=\"{i}\"}} {}", number(*mean))?;
        }
        head(f, "deviation", "gauge", "Standard deviation of a coordinate of the state.")?;
        for (i, (_, deviation)) in self.estimate.iter().enumerate() {
            writeln!(f, "fewbits_deviation{{coordinate=\"{i}\"}} {}", number(*deviation))?;
        }
        let counters: [Counter; 3] = [
            ("reports_total", "Reports of a sensor.", |sensor| sensor.reports),
            ("report_bits_total", "Bits of a sensor's reports.", |sensor| sensor.bits),
            ("lost_reports_total", "Reports of a sensor that were not understood.", |sensor| sensor.lost),
        ];
        for (name, help, value) in counters {
            head(f, name, "counter", help)?;
            for sensor in &self.sensors {
                writeln!(f, "fewbits_{name}{{sensor=\"{}\"}} {}", sensor.number, value(sensor))?;
            }
        }
        head(f, "sensor_working", "gauge", "Probability that a sensor works; none before it was asked.")?;
        for sensor in &self.sensors {
            if let Some(working) = sensor.working {
                writeln!(f, "fewbits_sensor_working{{sensor=\"{}\"}} {}", sensor.number, number(working))?;
            }
        }
        let flags: [Flag; 2] = [
            ("sensor_dead", "1 if a sensor is regarded as dead.", |sensor| sensor.dead),
            ("sensor_excluded", "1 if a sensor's reports are not used.", |sensor| sensor.excluded),
        ];
        for (name, help, value) in flags {
            head(f, name, "gauge", help)?;
            for sensor in &self.sensors {
                writeln!(f, "fewbits_{name}{{sensor=\"{}\"}} {}", sensor.number, u8::from(value(sensor)))?;
            }
        }
        head(f, "envelopes_total", "counter", "Envelopes by what became of them.")?;
        let Counts {
            taken,
            short,
            unknown,
            forged,
            replayed,
        } = self.counts;
        for (outcome, count) in [
            ("taken", taken),
            ("short", short),
            ("unknown", unknown),
            ("forged", forged),
            ("replayed", replayed),
        ] {
            writeln!(f, "fewbits_envelopes_total{{outcome=\"{outcome}\"}} {count}")?;
        }
        Ok(())
    }
}

/// A number as Prometheus writes it.
fn number(value: f64) -> String {
    match value {
        f64::INFINITY => "+Inf".to_owned(),
        f64::NEG_INFINITY => "-Inf".to_owned(),
        value if value.is_nan() => "NaN".to_owned(),
        value => format!("{value:?}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::BitString;
    use fewbits_protocol::SensorHealth;

    #[test]
    fn every_line_is_of_the_format_and_counts_add_up() {
        let mut metrics = Metrics::default();
        let word = Observation::Received(BitString::from_bytes(vec![0xa0], 3).unwrap_or_default());
        for slot in 1..=3 {
            let mut step = Step::new(
                slot,
                vec![word.clone(), Observation::Lost, Observation::Nothing],
                vec![(1.5, f64::INFINITY)],
            );
            let health = |dead| SensorHealth {
                working: 0.5,
                dead,
                excluded: false,
            };
            step.health = vec![health(false), health(true), health(false)];
            // Its address is not known, as its frames are refused.
            step.asked[2] = false;
            let counts = Counts {
                taken: slot,
                forged: 2,
                ..Counts::default()
            };
            metrics.take(&step, counts, &[4, 7, 9]);
        }
        let text = metrics.to_string();
        assert!(
            text.contains("fewbits_sensor_working{sensor=\"4\"}")
                && !text.contains("fewbits_sensor_working{sensor=\"9\"}")
        );
        for line in [
            "fewbits_slot 3",
            "fewbits_estimate{coordinate=\"0\"} 1.5",
            "fewbits_deviation{coordinate=\"0\"} +Inf",
            "fewbits_reports_total{sensor=\"4\"} 3",
            "fewbits_report_bits_total{sensor=\"4\"} 9",
            "fewbits_lost_reports_total{sensor=\"7\"} 3",
            "fewbits_sensor_dead{sensor=\"7\"} 1",
            "fewbits_sensor_dead{sensor=\"4\"} 0",
            "fewbits_envelopes_total{outcome=\"forged\"} 2",
        ] {
            assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
        }
        // Each sample follows the type of its own name.
        let mut name = "";
        for line in text.lines() {
            match line.strip_prefix("# TYPE ") {
                Some(rest) => name = rest.split(' ').next().unwrap_or_default(),
                None if line.starts_with('#') => {}
                None => assert!(
                    line.starts_with(name)
                        && line
                            .rsplit(' ')
                            .next()
                            .is_some_and(|v| v == "+Inf" || v.parse::<f64>().is_ok())
                ),
            }
        }
    }
}
