//! InfluxDB's line protocol.

use crate::station::Step;
use std::fmt::Write;

/// A step as one line of InfluxDB's line protocol, without a line end. `time` is the end of its slot in nanoseconds since 1970.
///
/// The fields are `mean0`, `deviation0` and so on, `reports`, `sensors`, `refused` and `events`. A number that is not finite is left out,
/// since the protocol has none.
pub fn influx_line(measurement: &str, step: &Step, events: &str, refused: u64, time: u64) -> String {
    let reports = step.reports();
    let mut line = escaped(measurement, &[',', ' ']);
    let _ = write!(line, " reports={reports}i,sensors={}i,refused={refused}i", step.observed.len());
    for (i, (mean, deviation)) in step.estimate.iter().enumerate() {
        for (name, value) in [("mean", mean), ("deviation", deviation)] {
            if value.is_finite() {
                let _ = write!(line, ",{name}{i}={value:?}");
            }
        }
    }
    if !events.is_empty() {
        let _ = write!(line, ",events=\"{}\"", escaped(events, &['"', '\\']));
    }
    let _ = write!(line, " {time}");
    line
}

/// The text with a backslash before each of these characters, and spaces in place of line ends.
fn escaped(text: &str, special: &[char]) -> String {
    let mut escaped = String::new();
    for c in text.chars() {
        if special.contains(&c) {
            escaped.push('\\');
        }
        escaped.push(if c.is_control() { ' ' } else { c });
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::Observation;

    #[test]
    fn line_is_that_of_the_protocol() {
        let observed = vec![Observation::Received(Default::default()), Observation::Nothing];
        let step = Step::new(3, observed, vec![(1.5, 0.25), (-2e-9, f64::NAN)]);
        let line = influx_line("my hall,1", &step, "dead 2 \"b\"\n", 7, 1_700_000_000_000_000_000);
        let expected = "my\\ hall\\,1 reports=1i,sensors=2i,refused=7i,mean0=1.5,deviation0=0.25,mean1=-2e-9,\
                        events=\"dead 2 \\\"b\\\" \" 1700000000000000000";
        assert_eq!(line, expected);
    }
}
