//! Kinds of reports of a sensor, and reading of configuration files.

use crate::error::Error;
use fewbits_cfwmd::scheme::CovarianceFeedback;
use fewbits_core::NumberFormat;
use fewbits_models::LinearSensor;
use nalgebra::SVector;
use serde::Deserialize;
use serde::de::DeserializeOwned;
use std::path::Path;

/// Kind of a sensor's reports. The files of sensor and centre must state the same.
#[derive(Deserialize, Clone, Copy)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum Report {
    /// One bit: whether the sample is at or above the prediction.
    Sign,
    /// The cell of the innovation, in 2 to 4 bits.
    Word {
        /// Bits of a report.
        bits: usize,
    },
    /// Every sample, in double precision.
    Value,
    /// The sample if its innovation reaches `threshold` standard deviations, otherwise silence.
    Censored {
        /// Standard deviations.
        threshold: f64,
    },
}

/// Reads a TOML file.
pub(crate) fn configuration<T: DeserializeOwned>(path: &Path) -> Result<T, Error> {
    let name = path.display().to_string();
    let text = std::fs::read_to_string(path).map_err(Error::io(&name, "read"))?;
    toml::from_str(&text).map_err(configured(path))
}

/// An error of a value in a configuration file.
pub(crate) fn configured<E: std::fmt::Display>(path: &Path) -> impl Fn(E) -> Error + use<E> {
    let file = path.display().to_string();
    move |error| Error::content(&file, error)
}

/// What a sensor of one coordinate of the state measures.
pub(crate) fn coordinate<const D: usize>(
    reads: usize,
    variance: f64,
) -> Result<LinearSensor<D, 1>, Box<dyn std::error::Error>> {
    if reads >= D {
        return Err(format!("reads is {reads}: expected below {D}, the coordinates of the model").into());
    }
    let direction = SVector::from_fn(|i, _| if i == reads { 1.0 } else { 0.0 });
    Ok(LinearSensor::scalar(direction, variance)?)
}

/// The scheme of a censored report.
pub(crate) fn censored<const D: usize>(
    reads: usize,
    variance: f64,
    threshold: f64,
) -> Result<CovarianceFeedback<LinearSensor<D, 1>, D, 1>, Box<dyn std::error::Error>> {
    let sensing = coordinate::<D>(reads, variance)?;
    Ok(CovarianceFeedback::new(sensing, threshold, NumberFormat::Double)?)
}
