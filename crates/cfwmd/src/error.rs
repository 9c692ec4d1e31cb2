//! Errors of this crate.

use fewbits_numerics::ArgumentError;
use thiserror::Error;

/// What a censoring sensor or its fusion centre refuses, or finds impossible.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A particle belief that cannot be: what was heard is impossible for every particle.
    #[error(transparent)]
    Density(#[from] fewbits_densities::Error),
    /// A filter refused a step.
    #[error(transparent)]
    Filter(#[from] fewbits_filters::Error),
    /// A model refused its parameters.
    #[error(transparent)]
    Model(#[from] fewbits_models::Error),
    /// The number of observations differs from the number of sensors.
    #[error("{heard} observations were handed over: expected {sensors}, one a sensor")]
    ObservationCount {
        /// Observations handed over.
        heard: usize,
        /// Sensors of the network.
        sensors: usize,
    },
    /// A message names a sensor that does not exist.
    #[error("a message came from sensor {sensor}: expected an index below {sensors}")]
    UnknownSensor {
        /// Index in the message.
        sensor: usize,
        /// Sensors of the network.
        sensors: usize,
    },
    /// A sensor was heard twice in one step.
    #[error("sensor {sensor} was heard twice in one step: expected at most one message a sensor and step")]
    HeardTwice {
        /// Index of the sensor.
        sensor: usize,
    },
    /// A received value that the sensor, had it followed the rule, would have kept to itself.
    #[error(
        "sensor {sensor} sent a measurement with normalised innovation squared {statistic}: expected at least the threshold {threshold}"
    )]
    ProtocolViolation {
        /// Index of the sensor.
        sensor: usize,
        /// `nu^T S^-1 nu` of what it sent.
        statistic: f64,
        /// The threshold it should have reached.
        threshold: f64,
    },
    /// Silence where the sensor always sends and the link never loses.
    #[error("sensor {sensor} was silent although its threshold is 0 and the link loses nothing: expected a message")]
    ImpossibleSilence {
        /// Index of the sensor.
        sensor: usize,
    },
    /// A measurement that says nothing about the state (`s = r`), for which the divergence rule is undefined.
    #[error(
        "the innovation variance {innovation_variance} does not exceed the noise variance {noise_variance}: expected an informative measurement"
    )]
    Uninformative {
        /// `s`.
        innovation_variance: f64,
        /// `r`.
        noise_variance: f64,
    },
    /// Everything heard has probability zero under the belief.
    #[error("what was heard is impossible under the belief: expected a positive likelihood")]
    Impossible,
}
