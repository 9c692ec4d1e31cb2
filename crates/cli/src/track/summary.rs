//! The summary of a run.

use serde::Serialize;

/// Largest number of events that are printed.
const PRINTED_EVENTS: usize = 12;
/// Share of rejected reports from which the supposed noise is doubted; of right ones one in a million is rejected.
const OFTEN: f64 = 0.05;
/// And so many of them: a few may be spikes, which are no noise.
const FEWEST_REJECTED: u64 = 5;
/// Bits are told to be more or less surprising than predicted from so many deviations on: by chance of one sensor in 16000.
const SURPRISING: f64 = 4.0;

/// What was found over the whole table.
#[derive(Serialize)]
pub(super) struct Summary {
    pub(super) rows: u64,
    /// Rows, or single reports, that say the same again and were dropped.
    pub(super) copies: u64,
    pub(super) reports: usize,
    pub(super) bits: usize,
    pub(super) bits_per_report: f64,
    /// Assumed standard deviation of the noise of sensors for which none was given.
    pub(super) noise: f64,
    /// Deviation of the level from its forecast and in how many seconds: what was supposed, and factor of its square at the end.
    pub(super) change: f64,
    pub(super) within: f64,
    pub(super) noise_scale: f64,
    /// Root mean square difference from the estimates that use the same values unquantized.
    pub(super) difference_from_full_values: Option<f64>,
    pub(super) sensors: Vec<SensorSummary>,
    pub(super) events: Vec<EventSummary>,
    /// Whether an empty cell says something of the level.
    #[serde(skip)]
    pub(super) is_silence_said: bool,
    /// What the first rows suggest that no option says.
    pub(super) hints: Vec<String>,
}

#[derive(Serialize)]
pub(super) struct SensorSummary {
    pub(super) name: String,
    pub(super) reports: usize,
    pub(super) gaps: usize,
    /// Reports that were not used because they were too unlikely given the prediction and the others'.
    pub(super) rejected: u64,
    /// By how many deviations unlikely bits came more often than predicted, of a sensor that sends one bit.
    pub(super) surprise: Option<f64>,
    /// Standard deviation of its noise, and offset, as supposed.
    pub(super) noise: f64,
    pub(super) offset: f64,
    pub(super) working: f64,
    pub(super) used: bool,
}

#[derive(Serialize)]
pub(super) struct EventSummary {
    pub(super) time: String,
    pub(super) event: &'static str,
    pub(super) sensor: Option<String>,
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
fn noises(summary: &Summary) -> String {
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
pub(super) fn lines(summary: &Summary) -> Vec<String> {
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
    for sensor in summary.sensors.iter().filter(|sensor| sensor.rejected > 0) {
        let reports = sensor.reports + if summary.is_silence_said { sensor.gaps } else { 0 };
        let is_noisy =
            sensor.used && sensor.rejected >= FEWEST_REJECTED && sensor.rejected as f64 > OFTEN * reports as f64;
        lines.push(format!(
            "{}: {} of {reports} reports{} were too unlikely and not used{}",
            sensor.name,
            sensor.rejected,
            if summary.is_silence_said { " and silences" } else { "" },
            if is_noisy {
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
