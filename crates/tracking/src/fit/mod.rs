//! Calibration from a whole table: noise, offset, gain, drift and delay of each sensor, and the change of the level.

pub(crate) mod calibration;

use crate::error::Error;
use crate::first::limits::{self, Ends};
use crate::first::rounding;
use crate::first::stuck::Stuck;
use crate::first::values::values_of;
use crate::level::hints::{circle, growth};
use crate::level::options::Known;
use crate::rows::instant::{Instant, Qualifier};
use calibration::{CalibratedSensor, Calibration};
use fewbits_filters::calibration::{self as filters, Reading};
use fewbits_filters::fit::{Estimate, Fit, Quantity, Request, fit};
use fewbits_table::Side;

/// Values of a sensor from which a step of rounding is found, and by how much of its standard error that makes the noise larger, at least.
const FEWEST: usize = 50;
const VISIBLE: f64 = 0.2;

/// What is known of sensors that are calibrated, and what is looked for.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CalibrationOptions {
    /// What is looked for, the sensor that is right, and noises that are known.
    pub request: Request,
    /// Sensors whose readings are bits: whether the level is above a threshold, which is found.
    pub bits: Vec<usize>,
    /// Lower and upper detection limit of the other sensors: a value at or beyond one says only that the measurement is beyond it.
    pub limits: Known<(Option<f64>, Option<f64>)>,
}

/// A calibration, and what is to be said of it.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Calibrated {
    /// The calibration.
    pub calibration: Calibration,
    /// The same with all that the fit says of it.
    pub fit: Fit,
    /// The step to which each sensor rounds, if its values are taken as cells.
    pub steps: Vec<Option<f64>>,
    /// What was taken for a detection limit or may be one, a sentence each.
    pub limits: Vec<String>,
    /// What else the rows suggest, a sentence each, as [`LevelSummary::hints`](crate::LevelSummary::hints).
    pub hints: Vec<String>,
}

/// Calibrates the sensors of these names from all rows.
///
/// 1. Find detection limits, unless they are stated; values at or beyond one become half-lines.
/// 2. Fit noises, offsets, change and what is asked for by maximum likelihood ([`fewbits_filters::fit`]).
/// 3. Sensors that round visibly give cells in place of values, and the fit is repeated.
///
/// # Errors
/// If a reading of a sensor of bits is none, a report is of no sensor, or the rows do not tell what is asked for.
pub fn calibrate(options: &CalibrationOptions, names: &[String], rows: &[Instant]) -> Result<Calibrated, Error> {
    let reports = || {
        rows.iter()
            .flat_map(|row| row.reports.iter().map(|(sensor, _)| (row.row, *sensor)))
    };
    if let Some((row, sensor)) = reports().find(|(_, sensor)| *sensor >= names.len()) {
        let problem = format!("a report of sensor {sensor}: there are {}, counted from 0", names.len());
        return Err(Error::Content { row, problem });
    }
    let refused = |source| Error::Refused {
        what: "the table cannot be fitted",
        source: Box::new(source),
    };
    let bits = options.bits.as_slice();
    let mut readings = readings(rows, bits, names)?;
    let mut told = Vec::new();
    let ends = ends(options, rows, names, &mut told);
    readings.iter_mut().for_each(|instant| limit(instant, &ends));
    let mut found = fit(&readings, names.len(), &options.request).map_err(refused)?;
    let steps = steps(rows, &found, bits);
    if steps.iter().any(Option::is_some) {
        // Rounding is no noise: what is looked for is the noise before it.
        readings.iter_mut().for_each(|instant| round(instant, &steps));
        found = fit(&readings, names.len(), &options.request).map_err(refused)?;
    }
    Ok(Calibrated {
        calibration: stored(&found, names, bits),
        fit: found,
        steps,
        limits: told,
        hints: hints(rows, names, bits),
    })
}

/// Sensors that repeat values, go around a circle, or whose noise grows.
fn hints(rows: &[Instant], names: &[String], bits: &[usize]) -> Vec<String> {
    let mut stuck = Stuck::default();
    rows.iter().for_each(|row| stuck.add(row));
    let mut lines = stuck.hints(names);
    for (sensor, name) in names.iter().enumerate().filter(|(sensor, _)| !bits.contains(sensor)) {
        let values = values_of(rows, sensor);
        if let Some(period) = circle(&values) {
            lines.push(format!(
                "{name} goes around a circle of {period}, which is not calibrated here: a step across its ends counts as a jump of the level"
            ));
        } else {
            let growth = growth(&values, name, false);
            lines.extend(growth.map(|line| format!("{line}; here the noise is a mean over all values")));
        }
    }
    lines
}

/// Limits of each sensor: those that are stated, or those that its values show.
fn ends(options: &CalibrationOptions, rows: &[Instant], names: &[String], told: &mut Vec<String>) -> Vec<Ends> {
    let mut of = |sensor: usize| match options.limits {
        _ if options.bits.contains(&sensor) => (None, None),
        Known::No => (None, None),
        Known::Is(stated) => stated,
        Known::Found => limits::found(&values_of(rows, sensor), &names[sensor], told),
    };
    (0..names.len()).map(&mut of).collect()
}

/// Values at or beyond a limit, as half-lines.
fn limit(instant: &mut filters::Instant, ends: &[Ends]) {
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
fn round(instant: &mut filters::Instant, steps: &[Option<f64>]) {
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
fn readings(rows: &[Instant], bits: &[usize], names: &[String]) -> Result<Vec<filters::Instant>, Error> {
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
                let problem = format!("{cell} of `{}` is no bit: 1, or 0 or -1 is expected", names[sensor]);
                return Err(Error::Content { row, problem });
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
        Ok(filters::Instant {
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

fn stored(found: &Fit, names: &[String], bits: &[usize]) -> Calibration {
    Calibration {
        relative_to: names[found.relative_to].clone(),
        change: found.model.change,
        time_constant: found.model.time_constant,
        mean: found.model.mean,
        sensors: names
            .iter()
            .zip(&found.model.sensors)
            .enumerate()
            .map(|(sensor, (name, model))| CalibratedSensor {
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
        limits: found
            .estimates
            .iter()
            .filter_map(|one| one.limits.map(|(low, high)| (title(one.quantity, names), low, high)))
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
