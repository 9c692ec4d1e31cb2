//! What `fit` found, as model, prior and sensors of a centre.

use super::entries::{Entry, Model, Prior};
use crate::error::Error;
use crate::measured::Measured;
use crate::report::Report;
use crate::track::calibration;
use fewbits_tracking::Calibration;
use std::path::Path;

/// Reads the file, and says what a centre does not follow.
pub(super) fn read(path: &Path) -> Result<Calibration, Error> {
    let found = calibration::read(path)?;
    calibration::say_uncorrected(&found, path, &[], true);
    Ok(found)
}

pub(super) fn model(found: &Calibration) -> Model {
    match found.time_constant {
        Some(time_constant) => Model::OrnsteinUhlenbeck {
            mean: found.mean,
            time_constant,
            variance: found.settled(time_constant),
        },
        None => Model::RandomWalk {
            density: found.change * found.change,
        },
    }
}

pub(super) fn prior(found: &Calibration) -> Option<Prior> {
    let (mean, deviation) = found.prior()?;
    Some(Prior {
        mean: vec![mean],
        deviation: vec![deviation],
    })
}

/// What an entry says that its sensors measure; what it does not say, the sensor of its name in the file.
pub(super) fn measured(entry: &Entry, found: Option<&Calibration>) -> Result<Measured, String> {
    let own = match (&entry.name, found) {
        (Some(name), Some(found)) => {
            let sensors = || found.sensors.iter();
            let own = sensors().find(|sensor| sensor.name == *name).ok_or_else(|| {
                let names: Vec<&str> = sensors().map(|sensor| sensor.name.as_str()).collect();
                format!("name is `{name}`: expected one of the sensors in `settings`, {}", names.join(", "))
            })?;
            Some(own)
        }
        (Some(_), None) => return Err("`name` is that in a file of `fewbits fit`: expected `settings`".to_owned()),
        (None, _) => None,
    };
    let Some(deviation) = entry.deviation.or(own.map(|own| own.model.noise)) else {
        return Err("expected `deviation`, or `name` of a sensor in `settings`".to_owned());
    };
    if !(deviation.is_finite() && deviation > 0.0) {
        return Err(format!("deviation is {deviation}: expected above 0"));
    }
    let variance = deviation * deviation;
    let is_line = entry.gain.is_some() || entry.offset.is_some();
    let threshold = entry
        .threshold
        .or(own.and_then(|own| own.threshold).filter(|_| !is_line));
    if let Some(threshold) = threshold {
        return match entry.report {
            Report::Sign if threshold.is_finite() && !is_line => Ok(Measured::switch(entry.reads, variance, threshold)),
            Report::Sign if is_line => Err("a switch has a `threshold`, and neither `gain` nor `offset`".to_owned()),
            Report::Sign => Err(format!("threshold is {threshold}: expected a finite number")),
            report => Err(format!("report is `{}`: expected `bit` of a sensor with a threshold", report.word())),
        };
    }
    let gain = entry.gain.or(own.map(|own| own.model.gain)).unwrap_or(1.0);
    let offset = entry.offset.or(own.map(|own| own.model.bias)).unwrap_or_default();
    if !gain.is_finite() || gain == 0.0 {
        return Err(format!("gain is {gain}: expected a finite number that is not 0"));
    }
    if !offset.is_finite() {
        return Err(format!("offset is {offset}: expected a finite number"));
    }
    Ok(Measured::line(entry.reads, variance, gain, offset))
}
