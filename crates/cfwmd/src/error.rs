//! Errors of this crate.

/// What a censoring sensor or its fusion centre refuses, or finds impossible. A failed step leaves the belief as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// [`fewbits_core::Error::Impossible`] for an observation of probability zero under the belief.
    #[error(transparent)]
    Core(fewbits_core::Error),
    /// A filter refused a step.
    #[error(transparent)]
    Filter(fewbits_filters::Error),
    /// A model refused its parameters.
    #[error(transparent)]
    Model(#[from] fewbits_models::Error),
    /// The number of observations differs from the number of sensors.
    #[error("{observations} observations were handed over: expected {sensors}, one per sensor")]
    ObservationCount {
        /// Observations handed over.
        observations: usize,
        /// Sensors of the network.
        sensors: usize,
    },
    /// A report names a sensor that does not exist.
    #[error("a report came from sensor {sensor}: expected an index below {sensors}")]
    UnknownSensor {
        /// Index in the report.
        sensor: usize,
        /// Sensors of the network.
        sensors: usize,
    },
    /// A received value that the sensor, had it followed the rule, would not have sent.
    #[error(
        "sensor {sensor} sent a measurement with normalised innovation squared {statistic}: expected at least the threshold {threshold}"
    )]
    ProtocolViolation {
        /// Index of the sensor.
        sensor: usize,
        /// `nu' S^-1 nu` of what it sent.
        statistic: f64,
        /// The threshold it should have reached.
        threshold: f64,
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
}

impl Error {
    /// An observation of probability zero under the belief.
    pub const IMPOSSIBLE: Self = Self::Core(fewbits_core::Error::Impossible);
}

fewbits_numerics::lift!(fewbits_core => Core);
fewbits_numerics::lift!(fewbits_filters with Core => Filter);

impl From<fewbits_densities::Error> for Error {
    fn from(error: fewbits_densities::Error) -> Self {
        fewbits_filters::Error::from(error).into()
    }
}
