//! The task `fit`: calibration from a whole table.

use super::applied::{Found, Sensor};
use super::columns::Kind;
use super::faults;
use super::first::values_of;
use super::hints::{circle, growth};
use super::instant::{Instant, Qualifier};
use super::limits::{self, Ends};
use super::rows::Instants;
use super::stuck::Stuck;
use crate::Ending;
use crate::bounds::PerColumn;
use crate::error::Error;
use crate::fit_options::{FitOptions, Sought};
use crate::numbers::{above_zero, column, short};
use crate::output;
use crate::say::say;
use clap::ValueEnum;
use clap::builder::PossibleValue;
use fewbits_filters::calibration::{self, Reading};
use fewbits_filters::fit::{Estimate, Fit, Quantity, Request, SensorTest, fit};
use fewbits_recipes::rounding;
use fewbits_table::Side;

/// Values of a sensor from which a step of rounding is found, and by how much of its standard error that makes the noise larger, at least.
const FEWEST: usize = 50;
const VISIBLE: f64 = 0.2;

/// Runs the task.
pub(crate) fn run(options: &FitOptions) -> Result<Ending, Error> {
    let kind = Kind {
        by: options.table.by.clone(),
        ..Kind::default()
    };
    let mut instants = Instants::open(&options.table, &kind)?;
    let mut rows = Vec::new();
    let mut stuck = Stuck::default();
    while let Some(instant) = instants.next()? {
        stuck.add(&instant);
        rows.push(instant);
    }
    instants.roles.told.iter().for_each(|line| say!("{line}"));
    let names = instants.names.clone();
    let at = |option: &str, name: &String| {
        let place = names.iter().position(|known| known == name);
        place.ok_or_else(|| {
            let problem = format!("{option}: no sensor `{name}`: there are {}", names.join(", "));
            Error::content(instants.file(), problem)
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
    noises.check(&names, instants.file())?;
    let has = |sought: Sought| options.find.contains(&sought);
    let request = Request {
        reference,
        gain: has(Sought::Gain),
        slope: has(Sought::Slope),
        walk: has(Sought::Walk),
        delay: has(Sought::Delay),
        time_constant: has(Sought::TimeConstant),
        noises: names.iter().map(|name| *noises.of(name)).collect(),
    };
    let refused = |source| Error::Refused {
        what: "the table cannot be fitted",
        source: Box::new(source),
    };
    let mut readings = readings(&rows, &bits, &names, instants.file())?;
    let mut told = Vec::new();
    let ends = ends(options, &rows, (&bits, &names), &mut told)?;
    told.iter().for_each(|line| say!("{line}"));
    readings.iter_mut().for_each(|instant| limit(instant, &ends));
    let mut found = fit(&readings, names.len(), &request).map_err(refused)?;
    let steps = steps(&rows, &found, &bits);
    if steps.iter().any(Option::is_some) {
        // Rounding is no noise: what is looked for is the noise before it.
        readings.iter_mut().for_each(|instant| round(instant, &steps));
        found = fit(&readings, names.len(), &request).map_err(refused)?;
    }
    let stored = stored(&found, &names, &bits);
    if let Some(path) = &options.output {
        output::text(Some(path), &(serde_json::to_string_pretty(&stored)? + "\n"))?;
    }
    if options.json {
        output::json(&stored)?;
    } else {
        output::print(&page(&found, &names, (&bits, &steps), &readings))?;
        let left = Sought::value_variants().iter().filter(|one| !has(**one));
        let left: Vec<_> = left.filter_map(Sought::to_possible_value).collect();
        let is_explained = found.tests.iter().all(SensorTest::is_passed);
        if !is_explained && !left.is_empty() {
            let left: Vec<&str> = left.iter().map(PossibleValue::get_name).collect();
            say!("what is not explained may be one of these: --find {}", left.join(","));
        }
    }
    stuck.hints(&names).iter().for_each(|line| say!("{line}"));
    for (sensor, name) in names.iter().enumerate().filter(|(sensor, _)| !bits.contains(sensor)) {
        let values = values_of(&rows, sensor);
        if let Some(period) = circle(&values) {
            say!(
                "{name} goes around a circle of {period}, which is not calibrated here: a step across its ends counts as a jump of the level"
            );
        } else {
            growth(&values, name, false)
                .iter()
                .for_each(|line| say!("{line}; here the noise is a mean over all values"));
        }
    }
    Ok(Ending::Good)
}

/// Limits of each sensor: those of the option, or those that its values show.
fn ends(
    options: &FitOptions,
    rows: &[Instant],
    (bits, names): (&[usize], &[String]),
    told: &mut Vec<String>,
) -> Result<Vec<Ends>, Error> {
    let stated = options.limits.as_deref().map(limits::limits).transpose()?;
    let mut of = |sensor: usize| match stated {
        _ if bits.contains(&sensor) => (None, None),
        Some(stated) => stated,
        None => limits::found(&values_of(rows, sensor), &names[sensor], told),
    };
    Ok((0..names.len()).map(&mut of).collect())
}

/// Values at or beyond a limit, as half-lines.
fn limit(instant: &mut calibration::Instant, ends: &[Ends]) {
    for (sensor, reading) in &mut instant.values {
        let (low, high) = ends[*sensor];
        let Some(value) = reading.value() else { continue };
        let (mut lower, mut upper) = (f64::NEG_INFINITY, f64::INFINITY);
        match (low, high) {
            (Some(low), _) if value <= low => upper = low,
            (_, Some(high)) if value >= high => lower = high,
            _ => continue,
        }
        *reading = Reading::Within { lower, upper };
    }
}

/// The step to which each sensor rounds, where it is coarser than its noise, or makes that larger than its standard error tells.
fn steps(rows: &[Instant], found: &Fit, bits: &[usize]) -> Vec<Option<f64>> {
    let of = |sensor: usize| {
        if bits.contains(&sensor) {
            return None;
        }
        let (values, noise) = (values_of(rows, sensor), found.model.sensors[sensor].noise);
        let own = |one: &&Estimate| one.quantity == Quantity::Noise(sensor);
        let error = found.estimates.iter().find(own).map(|own| own.standard_error);
        let coarse = rounding::coarse_step(&values, noise);
        coarse.or_else(|| {
            let step = rounding::step(&values)?;
            let more = noise - (noise * noise - (rounding::DEVIATION * step).powi(2)).max(0.0).sqrt();
            (values.len() >= FEWEST && more > VISIBLE * error?).then_some(step)
        })
    };
    (0..found.model.sensors.len()).map(of).collect()
}

/// Values of sensors that round, as cells.
fn round(instant: &mut calibration::Instant, steps: &[Option<f64>]) {
    for (sensor, reading) in &mut instant.values {
        if let (Some(step), Some(value)) = (steps[*sensor], reading.value()) {
            *reading = Reading::Within {
                lower: value - 0.5 * step,
                upper: value + 0.5 * step,
            };
        }
    }
}

/// Cells as readings; a bit says on which side of zero the measurement is.
fn readings(
    rows: &[Instant],
    bits: &[usize],
    names: &[String],
    file: &str,
) -> Result<Vec<calibration::Instant>, Error> {
    let reading = |row: u64, sensor: usize, cell: f64, qualifier: Option<&Qualifier>| {
        match qualifier.and_then(|one| one.limit) {
            Some(Side::Below) => {
                return Ok(Reading::Within {
                    lower: f64::NEG_INFINITY,
                    upper: cell,
                });
            }
            Some(Side::Above) => {
                return Ok(Reading::Within {
                    lower: cell,
                    upper: f64::INFINITY,
                });
            }
            None => {}
        }
        if !bits.contains(&sensor) {
            return Ok(Reading::from(cell));
        }
        let above = (0.0, f64::INFINITY);
        let below = (f64::NEG_INFINITY, 0.0);
        let (lower, upper) = match cell {
            1.0 => above,
            0.0 | -1.0 => below,
            _ => {
                let problem = format!("row {row}: {cell} of `{}` is no bit: 1, or 0 or -1 is expected", names[sensor]);
                return Err(Error::content(file, problem));
            }
        };
        Ok(Reading::Within { lower, upper })
    };
    let instant = |one: &Instant| {
        let cells = one.reports.iter().enumerate();
        let cells = cells.filter_map(|(i, (sensor, cell))| {
            let cell = cell.filter(|cell| cell.is_finite())?;
            Some((*sensor, cell, one.qualifiers.get(i)))
        });
        Ok(calibration::Instant {
            seconds: one.seconds,
            values: cells
                .map(|(sensor, cell, qualifier)| Ok((sensor, reading(one.row, sensor, cell, qualifier)?)))
                .collect::<Result<_, Error>>()?,
        })
    };
    rows.iter().map(instant).collect()
}

fn title(quantity: Quantity, names: &[String]) -> String {
    let of = |what: &str, sensor: usize| format!("{what} of {}", names[sensor]);
    match quantity {
        Quantity::Change => "change of the level per root of a second".to_owned(),
        Quantity::TimeConstant => "time constant in seconds".to_owned(),
        Quantity::Mean => "mean of the level".to_owned(),
        Quantity::Noise(sensor) => of("noise", sensor),
        Quantity::Bias(sensor) => of("offset", sensor),
        Quantity::Gain(sensor) => of("gain", sensor),
        Quantity::Slope(sensor) => of("drift per second", sensor),
        Quantity::Walk(sensor) => of("random walk of the offset per root of a second", sensor),
        Quantity::Delay(sensor) => of("delay", sensor),
        _ => "another parameter".to_owned(),
    }
}

fn stored(found: &Fit, names: &[String], bits: &[usize]) -> Found {
    Found {
        relative_to: names[found.relative_to].clone(),
        change: found.model.change,
        time_constant: found.model.time_constant,
        mean: found.model.mean,
        sensors: names
            .iter()
            .zip(&found.model.sensors)
            .enumerate()
            .map(|(sensor, (name, model))| Sensor {
                name: name.clone(),
                threshold: bits.contains(&sensor).then_some(-model.bias),
                model: *model,
            })
            .collect(),
        estimates: found
            .estimates
            .iter()
            .map(|one| (title(one.quantity, names), one.value, one.standard_error))
            .collect(),
        refused: found
            .refused
            .iter()
            .map(|one| (title(one.quantity, names), one.reason.clone()))
            .collect(),
        jumps: found.jumps.clone(),
        correlations: found
            .correlations
            .iter()
            .map(|one| (names[one.sensors.0].clone(), names[one.sensors.1].clone(), one.value, one.standard_error))
            .collect(),
        faults: found
            .faults
            .iter()
            .map(|one| (names[one.sensor].clone(), one.kind, one.size, one.evidence))
            .collect(),
        not_explained: found
            .tests
            .iter()
            .filter(|one| !one.is_passed())
            .map(|one| names[one.sensor].clone())
            .collect(),
        log_likelihood: found.log_likelihood,
    }
}

fn page(
    found: &Fit,
    names: &[String],
    (bits, steps): (&[usize], &[Option<f64>]),
    rows: &[calibration::Instant],
) -> String {
    let mut text = format!("{} rows; offsets are relative to {}\n\n", rows.len(), names[found.relative_to]);
    text += &format!("{:<50} {:>13} {:>13}\n", "", "value", "error");
    for one in &found.estimates {
        let (name, value) = match one.quantity {
            Quantity::Bias(sensor) if bits.contains(&sensor) => (format!("threshold of {}", names[sensor]), -one.value),
            quantity => (title(quantity, names), one.value),
        };
        text += &format!("{name:<50} {:>13} {:>13}\n", column(value), column(one.standard_error));
    }
    for one in &found.correlations {
        let name = format!("correlation of {} and {}", names[one.sensors.0], names[one.sensors.1]);
        text += &format!("{name:<50} {:>13} {:>13}\n", column(one.value), column(one.standard_error));
    }
    text.push('\n');
    for one in &found.refused {
        text += &format!("not found: {}: {}\n", title(one.quantity, names), one.reason);
    }
    for (name, step) in names.iter().zip(steps) {
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
