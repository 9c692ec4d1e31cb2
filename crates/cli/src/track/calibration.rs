//! The task `fit`: calibration from a whole table; its file.

use super::columns::Kind;
use super::faults;
use super::level_options::limits;
use super::rows;
use crate::Ending;
use crate::bounds::PerColumn;
use crate::error::Error;
use crate::fit_options::{FitOptions, Sought};
use crate::numbers::{above_zero, column, short};
use crate::output;
use crate::say::say;
use clap::ValueEnum;
use clap::builder::PossibleValue;
use fewbits_filters::fit::{Quantity, Request, SensorTest};
use fewbits_tracking::{Calibrated, Calibration, CalibrationOptions, Instant, Known, Rows, calibrate};
use std::path::Path;

/// Runs the task.
pub(crate) fn run(options: &FitOptions) -> Result<Ending, Error> {
    let kind = Kind {
        by: options.table.by.clone(),
        ..Kind::default()
    };
    let mut instants = rows::open(&options.table, &kind, None)?;
    let file = instants.source().file().to_owned();
    let refused = Error::tracking(&file);
    let mut rows = Vec::new();
    while let Some(instant) = instants.next().map_err(&refused)? {
        rows.push(instant);
    }
    instants.source().found().iter().for_each(|line| say!("{line}"));
    let names = instants.names().to_vec();
    let at = |option: &str, name: &String| {
        let place = names.iter().position(|known| known == name);
        place.ok_or_else(|| {
            let problem = format!("{option}: no sensor `{name}`: there are {}", names.join(", "));
            Error::content(&file, problem)
        })
    };
    let reference = options
        .reference
        .as_ref()
        .map(|name| at("--reference", name))
        .transpose()?;
    let bits = options
        .bits
        .iter()
        .map(|name| at("--bits", name))
        .collect::<Result<Vec<_>, _>>()?;
    const NOISE: &str = "a standard deviation above 0";
    let noises = PerColumn::parse(&options.noise, None, |text| above_zero("--noise", text, NOISE).map(Some))?;
    noises.check(&names, &file)?;
    let has = |sought: Sought| options.find.contains(&sought);
    let asked = CalibrationOptions {
        request: Request {
            reference,
            gain: has(Sought::Gain),
            slope: has(Sought::Slope),
            walk: has(Sought::Walk),
            delay: has(Sought::Delay),
            time_constant: has(Sought::TimeConstant),
            noises: names.iter().map(|name| *noises.of(name)).collect(),
        },
        limits: match options.limits.as_deref() {
            None => Known::Found,
            Some(text) => Known::Is(limits(text)?),
        },
        bits,
    };
    let calibrated = calibrate(&asked, &names, &rows).map_err(&refused)?;
    calibrated.limits.iter().for_each(|line| say!("{line}"));
    let stored = &calibrated.calibration;
    if let Some(path) = &options.output {
        output::text(Some(path), &(serde_json::to_string_pretty(stored)? + "\n"))?;
    }
    if options.json {
        output::json(stored)?;
    } else {
        output::print(&page(&calibrated, &names, &asked.bits, &rows))?;
        let left = Sought::value_variants().iter().filter(|one| !has(**one));
        let left: Vec<_> = left.filter_map(Sought::to_possible_value).collect();
        let is_explained = calibrated.fit.tests.iter().all(SensorTest::is_passed);
        if !is_explained && !left.is_empty() {
            let left: Vec<&str> = left.iter().map(PossibleValue::get_name).collect();
            say!("what is not explained may be one of these: --find {}", left.join(","));
        }
    }
    calibrated.hints.iter().for_each(|line| say!("{line}"));
    Ok(Ending::Good)
}

/// Reads a file of `fit`.
///
/// # Errors
/// If the file is none, or a noise or gain is 0.
pub(crate) fn read(path: &Path) -> Result<Calibration, Error> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(Error::io(&name, "read"))?;
    let found: Calibration = serde_json::from_str(&text)
        .map_err(|error| Error::content(&name, format_args!("it is no file of `fewbits fit -o`: {error}")))?;
    match found.unusable() {
        None => Ok(found),
        Some(sensor) => {
            Err(Error::content(&name, format_args!("sensor {}: noise and gain must not be 0", sensor.name)))
        }
    }
}

/// Says which faults of the sensors of a file are not corrected, as [`Calibration::uncorrected`].
pub(crate) fn say_uncorrected(found: &Calibration, file: &Path, names: &[String], drifts: bool) {
    let lines = found.uncorrected(names, drifts);
    lines.iter().for_each(|line| say!("{}: {line}", file.display()));
}

fn page(calibrated: &Calibrated, names: &[String], bits: &[usize], rows: &[Instant]) -> String {
    let (found, titles) = (&calibrated.fit, &calibrated.calibration);
    let mut text = format!("{} rows; offsets are relative to {}\n\n", rows.len(), names[found.relative_to]);
    text += &format!("{:<50} {:>13} {:>13}\n", "", "value", "error");
    for (one, (title, ..)) in found.estimates.iter().zip(&titles.estimates) {
        let (name, value) = match one.quantity {
            Quantity::Bias(sensor) if bits.contains(&sensor) => (format!("threshold of {}", names[sensor]), -one.value),
            _ => (title.clone(), one.value),
        };
        let limits = one
            .limits
            .map(|(low, high)| format!("  95 in 100: {} to {}", short(low), short(high)));
        let (value, error) = (column(value), column(one.standard_error));
        text += &format!("{name:<50} {value:>13} {error:>13}{}\n", limits.unwrap_or_default());
    }
    for one in &found.correlations {
        let name = format!("correlation of {} and {}", names[one.sensors.0], names[one.sensors.1]);
        text += &format!("{name:<50} {:>13} {:>13}\n", column(one.value), column(one.standard_error));
    }
    text.push('\n');
    for (title, reason) in &titles.refused {
        text += &format!("not found: {title}: {reason}\n");
    }
    for (name, step) in names.iter().zip(&calibrated.steps) {
        if let Some(step) = step {
            text += &format!(
                "{name} is rounded to {}: its values are taken as cells, its noise is that before rounding\n",
                short(*step)
            );
        }
    }
    if let (Some(first), Some(begin)) = (found.jumps.first(), rows.first()) {
        text += &format!(
            "jumps of the level, which are no part of its change: {}, the first {} s after the first row\n",
            found.jumps.len(),
            short(first - begin.seconds)
        );
    }
    if let Some(seconds) = found.returns {
        text += &format!(
            "the level returns to a mean, in about {} s: without --find time-constant its change and the noises are off by more than stated\n",
            short(seconds)
        );
    }
    if let Some(one) = found.tests.iter().find(|one| one.is_persistent()) {
        text += &format!(
            "by {} the level keeps a direction for many rows, as in a cycle of a day, which is no part of the model: its change is too large, noises are \
             too small\n",
            names[one.sensor]
        );
    }
    for one in found.correlations.iter().filter(|one| one.is_certain()) {
        text += &format!(
            "{} and {} share noise: change, noises and their errors suppose that sensors do not, and are off by more than stated\n",
            names[one.sensors.0], names[one.sensors.1]
        );
    }
    found.faults.iter().for_each(|one| text += &faults::line(one, names));
    for one in &found.tests {
        let name = &names[one.sensor];
        let word = if one.is_passed() {
            "is explained"
        } else {
            "is NOT explained"
        };
        text += &format!(
            "{name} {word}: innovations of mean square {:.2} ({:+.1} deviations from 1), repetition {:+.1} deviations, over many rows {:+.1}",
            one.mean_square, one.size, one.repetition, one.persistence
        );
        text += &match one.wild {
            0 => "\n".to_owned(),
            wild => format!(", {wild} wild values\n"),
        };
    }
    text
}
