//! Errors of censoring sensors and their fusion centre.

/// Errors of this crate. After a failed step the belief is unchanged.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// If an argument is out of range.
    #[error(transparent)]
    Argument(#[from] fewbits_numerics::ArgumentError),
    /// An error of the core types; [`fewbits_core::Error::Impossible`] for an observation of probability zero under the belief.
    #[error(transparent)]
    Core(fewbits_core::Error),
    /// A filter refused a step.
    #[error(transparent)]
    Filter(fewbits_filters::Error),
    /// A dynamics or sensor model refused its parameters.
    #[error(transparent)]
    Model(#[from] fewbits_models::Error),
    /// The number of observations differs from the number of sensors.
    #[error("{observations} observations were handed over: expected {sensors}, one per sensor")]
    ObservationCount {
        /// Number of observations passed.
        observations: usize,
        /// Number of sensors of the network.
        sensors: usize,
    },
    /// A report names a sensor that does not exist.
    #[error("a report came from sensor {sensor}: expected an index below {sensors}")]
    UnknownSensor {
        /// Index of the sensor, counted from zero.
        sensor: usize,
        /// Number of sensors of the network.
        sensors: usize,
    },
    /// A received value has a normalised innovation below the threshold: a sensor that follows the rule would not have sent it.
    #[error(
        "sensor {sensor} sent a measurement with normalised innovation squared {statistic}: expected at least the threshold {threshold}"
    )]
    ProtocolViolation {
        /// Index of the sensor.
        sensor: usize,
        /// Normalised innovation squared `nu' S^-1 nu` of the value.
        statistic: f64,
        /// The threshold it should have reached.
        threshold: f64,
    },
    /// The measurement does not depend on the state (`s = r`), so the divergence rule is undefined.
    #[error(
        "the innovation variance {innovation_variance} does not exceed the noise variance {noise_variance}: expected an informative measurement"
    )]
    Uninformative {
        /// Innovation variance `s`.
        innovation_variance: f64,
        /// Noise variance `r`.
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
