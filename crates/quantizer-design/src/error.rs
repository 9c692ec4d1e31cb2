//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a model, system, design, decoder or bound could not be computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument is outside its range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// An error of the quantizers crate.
    #[error(transparent)]
    Quantizer(fewbits_quantizers::Error),
    /// An iteration reached its limit before it converged.
    #[error("{algorithm} did not converge in {iterations} iterations: the last change was {change:e}")]
    NotConverged {
        /// Name of the iteration.
        algorithm: &'static str,
        /// Number of iterations done.
        iterations: usize,
        /// Size of the last change, in the units of the stopping rule.
        change: f64,
    },
    /// A table would have more entries than the caller allows.
    #[error("{table} would need {needed} entries: at most {limit} are allowed")]
    TooLarge {
        /// Name of the table.
        table: &'static str,
        /// Number of entries needed; larger numbers are given as `u64::MAX`.
        needed: u64,
        /// Number of entries allowed.
        limit: u64,
    },
    /// The noise of three or more sensors is not independent noise plus one shared factor.
    #[error(
        "unsupported correlation: the noise of these {sensors} sensors is not independent noise plus one shared factor"
    )]
    UnsupportedCorrelation {
        /// Number of sensors.
        sensors: usize,
    },
    /// A cell becomes empty during the design: fewer levels are as good.
    #[error(
        "cell {cell} of quantizer {quantizer} vanishes (its probability falls to {probability:e}): design fewer levels"
    )]
    VanishingCell {
        /// Index of the quantizer in the system.
        quantizer: usize,
        /// Index of its cell.
        cell: usize,
        /// Its probability when the design stopped.
        probability: f64,
    },
    /// The best cells of a level are not one interval, but a contiguous quantizer was asked for.
    #[error("the best cells are labelled {labels:?}: no contiguous quantizer is a fixed point here")]
    NotContiguous {
        /// Labels of the best cells from left to right.
        labels: Vec<usize>,
    },
    /// The symbols received together have probability zero under the model.
    #[error("these symbols cannot be received together under the model: nothing follows from them")]
    ImpossibleOutcome,
}

fewbits_numerics::lift!(fewbits_quantizers => Quantizer);

pub(crate) use fewbits_numerics::error::refuse;

/// An error if a table needs more entries than the limit.
pub(crate) fn at_most(table: &'static str, needed: u64, limit: u64) -> Result<(), Error> {
    if needed > limit {
        return Err(Error::TooLarge { table, needed, limit });
    }
    Ok(())
}

/// Reads a stored size: finite, and not negative except for rounding.
pub(crate) fn stored_size<'de, D: serde::Deserializer<'de>>(source: D) -> Result<f64, D::Error> {
    let size = <f64 as serde::Deserialize>::deserialize(source)?;
    if size.is_finite() && size >= -1e-9 {
        Ok(size)
    } else {
        Err(serde::de::Error::custom(ArgumentError::new("value", size, "a finite number that is not negative")))
    }
}
