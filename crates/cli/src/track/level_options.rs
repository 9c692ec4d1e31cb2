//! The options of `track` as those of the library, and their language.

use super::columns::{Finds, Kind};
use super::rows::Instants;
use crate::bounds::PerColumn;
use crate::error::Error;
use crate::numbers::{above_zero, mean_and_deviation, number};
use crate::track_options::{Model, Switch, TrackOptions};
use fewbits_tracking::{Known, LevelOptions, PerSensor, Report};

/// Largest length of a word.
const MAX_BITS: u32 = 4;

/// Lower and upper limit.
pub(super) type Ends = (Option<f64>, Option<f64>);

/// Which columns are no sensors, as the options say.
pub(super) fn kind(options: &TrackOptions) -> Result<Kind, Error> {
    let silent = options.silent_within.as_deref().map(silence).transpose()?;
    Ok(Kind {
        finds: if options.reports { Finds::Labels } else { Finds::Levels },
        sampled: silent.and_then(|(_, seconds)| seconds),
        by: options.table.by.clone(),
        accuracy: options.accuracy_column.clone(),
        threshold: options.threshold_column.clone(),
        is_filled: options.silent_within.is_some(),
        late: options.late.map_or(0.0, |late| late.as_secs_f64()),
    })
}

/// The options as the library has them.
pub(super) fn level_options(options: &TrackOptions, instants: &Instants) -> Result<LevelOptions, Error> {
    const NOISE: &str = "a standard deviation above 0";
    const THRESHOLD: &str = "a number";
    let noise = PerColumn::parse(&options.noise, None, |text| above_zero("--noise", text, NOISE).map(Some))?;
    let threshold =
        PerColumn::parse(&options.threshold, None, |text| number("--threshold", text, THRESHOLD).map(Some))?;
    let send = PerColumn::parse(&options.send, Report::Value, report)?;
    if options.table.by.is_none() {
        let (names, file) = (instants.names(), instants.source().file());
        noise.check(names, file)?;
        threshold.check(names, file)?;
        send.check(names, file)?;
    }
    let pair = |option: &'static str, text: &Option<String>| {
        let text = text.as_deref();
        text.map(|text| mean_and_deviation(option, text)).transpose()
    };
    Ok(LevelOptions {
        change: options.change.as_deref().map(change).transpose()?,
        prior: pair("--prior", &options.prior)?,
        period: match options.period.as_deref() {
            None => Known::Found,
            Some("no") => Known::No,
            Some(text) => Known::Is(above_zero("--period", text, "a period above 0, as 360, or `no`")?),
        },
        rounded: match options.rounded.as_deref() {
            None | Some("found") => Known::Found,
            Some("no") => Known::No,
            Some(text) => Known::Is(above_zero("--rounded", text, "a step above 0, `found` or `no`")?),
        },
        silent_within: options
            .silent_within
            .as_deref()
            .map(silence)
            .transpose()?
            .map(|(width, _)| width),
        limits: match options.limits.as_deref() {
            None => Known::Found,
            Some(text) => Known::Is(limits(text)?),
        },
        slope: pair("--slope", &options.slope)?,
        model: options.model.map(|model| match model {
            Model::Velocity => fewbits_tracking::Model::Velocity,
            Model::Acceleration => fewbits_tracking::Model::Acceleration,
            Model::Returning => fewbits_tracking::Model::Returning,
            // Ranges have their own tracker.
            Model::Walk | Model::Ranges => fewbits_tracking::Model::Walk,
        }),
        send: per_sensor(send),
        reports: options.reports,
        threshold: per_sensor(threshold),
        has_thresholds: options.threshold_column.is_some(),
        has_accuracies: options.accuracy_column.is_some(),
        has_limits: instants.source().has_limits,
        noise: per_sensor(noise),
        learning: options.learning.map(|learning| learning == Switch::On),
        smooth: options.smooth.is_some(),
        align: options.align,
    })
}

fn per_sensor<T>(values: PerColumn<T>) -> PerSensor<T> {
    let (named, others) = values.into_parts();
    PerSensor { named, others }
}

/// Parses `0.5/1h`. Numbered rows are one second apart.
fn change(text: &str) -> Result<(f64, f64), Error> {
    const EXPECTED: &str = "a change above 0 and the time in which it happens, as `0.5/1h`, or `0.5` in one row";
    let Some((size, time)) = text.split_once('/') else {
        return Ok((above_zero("--change", text, EXPECTED)?, 1.0));
    };
    let time = humantime::parse_duration(time).map_err(|_| Error::option("--change", text, EXPECTED))?;
    let seconds = time.as_secs_f64();
    if seconds > 0.0 {
        Ok((above_zero("--change", size, EXPECTED)?, seconds))
    } else {
        Err(Error::option("--change", text, EXPECTED))
    }
}

/// Parses a value of `--send`.
pub(super) fn report(text: &str) -> Result<Report, Error> {
    let refused =
        || Error::option("--send", text, "`value`, `bit`, or `word:2` to `word:4`; for one column as `column=bit`");
    match text {
        "value" => Ok(Report::Value),
        "bit" => Ok(Report::Sign),
        _ => {
            let bits = text.strip_prefix("word:").and_then(|bits| bits.parse().ok());
            bits.filter(|bits| (2..=MAX_BITS).contains(bits))
                .map(|bits| Report::Word { bits })
                .ok_or_else(refused)
        }
    }
}

/// The width of silence, and the seconds between two of the sensor's measurements if they are said: `0.5`, `0.5/60s`.
pub(super) fn silence(text: &str) -> Result<(f64, Option<f64>), Error> {
    const EXPECTED: &str = "a width above 0, or also how often the sensor measures, as `0.5/60s`";
    let (width, time) = match text.split_once('/') {
        Some((width, time)) => (width, Some(time)),
        None => (text, None),
    };
    let refused = || Error::option("--silent-within", text, EXPECTED);
    let seconds = time
        .map(|time| humantime::parse_duration(time).map_err(|_| refused()))
        .transpose()?
        .map(|time| time.as_secs_f64());
    if seconds.is_some_and(|seconds| seconds <= 0.0) {
        return Err(refused());
    }
    Ok((above_zero("--silent-within", width, EXPECTED)?, seconds))
}

/// Parses `0.25..`, `..40` or `0.25..40`.
pub(super) fn limits(text: &str) -> Result<Ends, Error> {
    if text == "no" {
        return Ok((None, None));
    }
    const EXPECTED: &str = "a lower limit, an upper one, or both, as `0.25..`, `..40` or `0.25..40`; or `no`";
    let (low, high) = text
        .split_once("..")
        .ok_or_else(|| Error::option("--limits", text, EXPECTED))?;
    let end = |end: &str| {
        (!end.trim().is_empty())
            .then(|| number("--limits", end, EXPECTED))
            .transpose()
    };
    Ok((end(low)?, end(high)?))
}
