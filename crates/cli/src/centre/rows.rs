//! The rows of a centre: CSV, JSON, lines of InfluxDB, or records of SenML.

use crate::error::Error;
use fewbits_core::{Event, Observation};
use fewbits_link::Step;
use fewbits_link::doors::{influx_line, senml};
use serde_json::json;
use std::fmt::Write as _;
use std::io::Write;

/// Format of the rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum RowFormat {
    /// A line of names, then a line per slot.
    Csv,
    /// A JSON object per slot.
    Json,
    /// A line of InfluxDB's line protocol per slot.
    Influx,
    /// A list of SenML (RFC 8428) in JSON per slot.
    Senml,
    /// A list of SenML in CBOR per slot, one behind the other.
    SenmlCbor,
}

pub(super) struct Rows {
    format: RowFormat,
    coordinates: usize,
    period: f64,
    numbers: Vec<u32>,
    /// Number of envelopes that had been refused at the last row.
    refused: u64,
    sink: std::io::Stdout,
}

impl Rows {
    pub(super) fn new(format: RowFormat, coordinates: usize, period: f64, numbers: Vec<u32>) -> Self {
        Self {
            format,
            coordinates,
            period,
            numbers,
            refused: 0,
            sink: std::io::stdout(),
        }
    }

    /// The line of names, for CSV.
    pub(super) fn head(&mut self) -> Result<(), Error> {
        if self.format != RowFormat::Csv {
            return Ok(());
        }
        let mut head = "slot,reports".to_owned();
        for i in 0..self.coordinates {
            let _ = write!(head, ",mean{i},deviation{i}");
        }
        self.line(&(head + ",refused,events"))
    }

    fn line(&mut self, line: &str) -> Result<(), Error> {
        let written = writeln!(self.sink, "{line}").and_then(|()| self.sink.flush());
        written.map_err(Error::io("standard output", "write"))
    }

    /// A row; `refused` is the number of refused envelopes so far.
    pub(super) fn write(&mut self, step: &Step, refused: u64) -> Result<(), Error> {
        let more = refused.saturating_sub(std::mem::replace(&mut self.refused, refused));
        let line = match self.format {
            RowFormat::Csv => self.csv(step, more),
            RowFormat::Json => self.json(step, more),
            RowFormat::Influx => {
                // In whole nanoseconds, as the schedule counts: a double would be up to 128 of them off.
                let end = step
                    .slot
                    .saturating_add(1)
                    .saturating_mul((self.period * 1e9).round() as u64);
                influx_line("fewbits", step, &self.events(step), more, end)
            }
            RowFormat::Senml => senml::to_json(&self.senml(step))?,
            RowFormat::SenmlCbor => {
                let bytes = senml::to_cbor(&self.senml(step))?;
                let written = self.sink.write_all(&bytes).and_then(|()| self.sink.flush());
                return written.map_err(Error::io("standard output", "write"));
            }
        };
        self.line(&line)
    }

    /// The events as in `track`: names and numbers of sensors, separated by semicolons.
    fn events(&self, step: &Step) -> String {
        let event = |event: &Event| match event.sensor().and_then(|i| self.numbers.get(i as usize)) {
            Some(number) => format!("{} {number}", event.name()),
            None => event.name().to_owned(),
        };
        let mut events: Vec<String> = step.events.iter().map(event).collect();
        if step.trouble.is_some() {
            events.push("impossible".to_owned());
        }
        events.join("; ")
    }

    fn csv(&self, step: &Step, refused: u64) -> String {
        let mut row = format!("{},{}", step.slot, step.reports());
        for (mean, deviation) in &step.estimate {
            let _ = write!(row, ",{mean},{deviation}");
        }
        let _ = write!(row, ",{refused},{}", self.events(step));
        row
    }

    fn json(&self, step: &Step, refused: u64) -> String {
        let estimate = step.estimate.iter();
        let estimate: Vec<_> = estimate
            .map(|(mean, deviation)| json!({"mean": mean, "deviation": deviation}))
            .collect();
        let sensors = self.numbers.iter().enumerate().map(|(i, number)| {
            let observed = match step.observed.get(i) {
                Some(Observation::Received(report)) => json!({"bits": report.bits()}),
                Some(Observation::Lost) => json!("lost"),
                _ if step.asked.get(i) == Some(&false) => json!("not asked"),
                _ => json!("nothing"),
            };
            let health = step.health.get(i);
            json!({
                "number": number,
                "observed": observed,
                "working": health.map(|health| health.working),
                "dead": health.map(|health| health.dead),
                "excluded": health.map(|health| health.excluded),
            })
        });
        json!({
            "slot": step.slot,
            "reports": step.reports(),
            "estimate": estimate,
            "refused": refused,
            "events": self.events(step),
            "trouble": step.trouble,
            "sensors": sensors.collect::<Vec<_>>(),
        })
        .to_string()
    }

    fn senml(&self, step: &Step) -> Vec<senml::Record> {
        let time = (step.slot + 1) as f64 * self.period;
        let records = step.estimate.iter().enumerate().flat_map(|(i, (mean, deviation))| {
            [("mean", *mean), ("deviation", *deviation)]
                .map(|(name, value)| senml::Record::new(format!("fewbits:{name}{i}"), "", value, time))
        });
        records.collect()
    }
}
