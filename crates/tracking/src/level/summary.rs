//! What is said of a level over all rows.

use super::settings::Settings;
use crate::level::estimator::LevelRow;
use crate::rows::instant::Instant;
use serde::Serialize;

/// Largest number of events in the summary, and of those in its lines.
const MAX_EVENTS: usize = 1000;
const PRINTED_EVENTS: usize = 12;
/// Share of rejected reports from which the supposed noise is doubted; of right ones one in a million is rejected.
const OFTEN: f64 = 0.05;
/// And so many of them: a few may be spikes, which are no noise.
const FEWEST_REJECTED: u64 = 5;
/// Jumps of the level of which rejected reports are told to be, at least, and reports of each, at most.
const FEWEST_JUMPS: u64 = 3;
const MOST_AT_A_JUMP: u64 = 5;
/// Bits are told to be more or less surprising than predicted from so many deviations on: by chance of one sensor in 16000.
const SURPRISING: f64 = 4.0;

/// What was found over all rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct LevelSummary {
    /// Number of rows.
    pub rows: u64,
    /// Rows, or single reports, that say the same again and were dropped.
    pub copies: u64,
    /// Number of reports.
    pub reports: usize,
    /// Number of bits sent.
    pub bits: usize,
    /// Mean number of bits of a report.
    pub bits_per_report: f64,
    /// Assumed standard deviation of the noise of sensors for which none was given.
    pub noise: f64,
    /// Supposed standard deviation of the level from its forecast.
    pub change: f64,
    /// After how many seconds it has that.
    pub within: f64,
    /// Factor of its square at the end.
    pub noise_scale: f64,
    /// Root mean square difference from the estimates that use the same values unquantized.
    pub difference_from_full_values: Option<f64>,
    /// The sensors, in the order in which they came.
    pub sensors: Vec<SensorSummary>,
    /// The first 1000 events.
    pub events: Vec<EventSummary>,
    /// Whether an empty cell says something of the level.
    #[serde(skip)]
    is_silence_said: bool,
    /// What the rows suggest that no option says, a sentence each. Options have the names of the command's, `--noise` for `noise`.
    pub hints: Vec<String>,
}

/// A sensor over all rows.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct SensorSummary {
    /// Its name.
    pub name: String,
    /// Number of its reports.
    pub reports: usize,
    /// Number of its empty cells.
    pub gaps: usize,
    /// Reports that were not used because they were too unlikely given the prediction and the others'.
    pub rejected: u64,
    /// By how many deviations unlikely bits came more often than predicted, of a sensor that sends one bit.
    pub surprise: Option<f64>,
    /// Supposed standard deviation of its noise.
    pub noise: f64,
    /// Supposed offset.
    pub offset: f64,
    /// Probability at the end that it works.
    pub working: f64,
    /// Whether its reports are used at the end.
    pub used: bool,
}

/// An event.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[non_exhaustive]
pub struct EventSummary {
    /// Time of its row.
    pub time: String,
    /// What happened.
    pub event: &'static str,
    /// The sensor; `None` if it concerns all.
    pub sensor: Option<String>,
}

impl SensorSummary {
    pub(crate) fn new(name: &str, noise: f64, offset: f64) -> Self {
        Self {
            name: name.to_owned(),
            reports: 0,
            gaps: 0,
            rejected: 0,
            surprise: None,
            noise,
            offset,
            working: 1.0,
            used: true,
        }
    }
}

impl LevelSummary {
    pub(crate) fn new(settings: &Settings) -> Self {
        Self {
            rows: 0,
            copies: 0,
            reports: 0,
            bits: 0,
            bits_per_report: 0.0,
            noise: settings.noise,
            change: settings.world.change,
            within: settings.world.within,
            noise_scale: 1.0,
            difference_from_full_values: None,
            sensors: Vec::new(),
            events: Vec::new(),
            is_silence_said: settings.meaning.silent_within.is_some(),
            hints: settings.hints.clone(),
        }
    }

    /// Adds a row, and what it made of the level. `names`: of the sensors.
    pub(crate) fn add(&mut self, instant: &Instant, row: &LevelRow, names: &[String]) {
        self.rows += 1;
        self.reports += row.reports;
        self.bits += row.bits;
        self.noise_scale = row.noise_scale;
        for (sensor, cell) in &instant.reports {
            match cell {
                Some(_) => self.sensors[*sensor].reports += 1,
                None => self.sensors[*sensor].gaps += 1,
            }
        }
        for (event, sensor) in row.events.iter().take(MAX_EVENTS.saturating_sub(self.events.len())) {
            self.events.push(EventSummary {
                time: instant.time.clone(),
                event,
                sensor: sensor.map(|sensor| names[sensor].clone()),
            });
        }
    }

    /// The summary as sentences.
    pub fn lines(&self) -> Vec<String> {
        lines(self)
    }
}

/// A number in four significant digits.
fn short(number: f64) -> String {
    let digits = 3 - number.abs().max(f64::MIN_POSITIVE).log10().floor() as i32;
    match usize::try_from(digits) {
        Ok(decimals) if decimals <= 8 => format!("{number:.decimals$}"),
        _ => format!("{number:.3e}"),
    }
}

/// The noise of each sensor.
fn noises(summary: &LevelSummary) -> String {
    let one = |sensor: &SensorSummary| format!("{} {}", sensor.name, short(sensor.noise));
    let all: Vec<String> = summary.sensors.iter().take(PRINTED_EVENTS).map(one).collect();
    let more = summary.sensors.len() - all.len();
    let rest = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    format!("{}{rest}", all.join(", "))
}

/// The lines of the summary.
fn lines(summary: &LevelSummary) -> Vec<String> {
    let mut lines = vec![
        format!(
            "{} rows, {} reports of {:.2} bits on average",
            summary.rows, summary.reports, summary.bits_per_report
        ),
        format!(
            "supposed: noise {}, change {} in {} s; learnt: {:.3} times that change",
            noises(summary),
            short(summary.change),
            short(summary.within),
            summary.noise_scale.sqrt()
        ),
    ];
    if let Some(difference) = summary.difference_from_full_values {
        lines
            .push(format!("estimates differ by {} (root mean square) from those of values in full", short(difference)));
    }
    lines.extend(summary.hints.iter().cloned());
    if summary.copies > 0 {
        lines.push(format!("{} copies of reports were dropped", summary.copies));
    }
    let reopened = summary.events.iter().filter(|event| event.event == "reopened").count() as u64;
    for sensor in summary.sensors.iter().filter(|sensor| sensor.rejected > 0) {
        let reports = sensor.reports + if summary.is_silence_said { sensor.gaps } else { 0 };
        let is_noisy =
            sensor.used && sensor.rejected >= FEWEST_REJECTED && sensor.rejected as f64 > OFTEN * reports as f64;
        lines.push(format!(
            "{}: {} of {reports} reports{} were too unlikely and not used{}",
            sensor.name,
            sensor.rejected,
            if summary.is_silence_said { " and silences" } else { "" },
            if is_noisy && reopened >= FEWEST_JUMPS && sensor.rejected <= MOST_AT_A_JUMP * reopened {
                ": they are those behind jumps of the level, which one sensor alone shows at the fourth value; --change states a larger change"
            } else if is_noisy {
                ": its noise is larger than supposed, or was so for a while, and bands are too narrow; --noise states a larger one"
            } else {
                ""
            }
        ));
    }
    for sensor in &summary.sensors {
        let (more, larger, narrow) = match sensor.surprise {
            Some(deviations) if deviations > SURPRISING => ("more", "larger", "narrow"),
            Some(deviations) if deviations < -SURPRISING => ("less", "smaller", "wide"),
            _ => continue,
        };
        lines.push(format!(
            "{}: unlikely bits came {more} often than predicted ({:.1} deviations): its noise, or the change, is {larger} than stated, and bands are too \
             {narrow}",
            sensor.name,
            sensor.surprise.unwrap_or(0.0).abs()
        ));
    }
    for sensor in summary.sensors.iter().filter(|sensor| !sensor.used) {
        let why = if sensor.working < 0.5 {
            "it is silent"
        } else {
            "it contradicts the others (constant offsets: --align ROWS)"
        };
        lines.push(format!("{} is not used any more: {why}", sensor.name));
    }
    for event in summary.events.iter().take(PRINTED_EVENTS) {
        let sensor = event.sensor.as_deref().unwrap_or("all sensors");
        lines.push(format!("{}: {sensor}: {}", event.time, event.event));
    }
    if summary.events.len() > PRINTED_EVENTS {
        lines.push(format!("and {} more events", summary.events.len() - PRINTED_EVENTS));
    }
    lines
}
