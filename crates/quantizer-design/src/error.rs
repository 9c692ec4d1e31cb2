//! The error of this crate.

use fewbits_numerics::ArgumentError;

/// Why a model, system, design, decoder or bound was refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An argument out of range.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A quantizer or channel was refused.
    #[error(transparent)]
    Quantizer(fewbits_quantizers::Error),
    /// An iteration stopped at its limit before its tolerance was met.
    #[error("{algorithm} did not converge in {iterations} iterations: the last change was {change:e}")]
    NotConverged {
        /// Which iteration.
        algorithm: &'static str,
        /// Iterations spent.
        iterations: usize,
        /// Size of the last change, in the units of the stop rule.
        change: f64,
    },
    /// A table would be larger than the caller allows.
    #[error("{table} would need {needed} entries: at most {limit} are allowed")]
    TooLarge {
        /// Which table.
        table: &'static str,
        /// Entries needed, saturated at `u64::MAX`.
        needed: u64,
        /// Entries allowed.
        limit: u64,
    },
    /// The noise of three sensors or more needs more than one shared factor.
    #[error(
        "unsupported correlation: the noise of these {sensors} sensors is not independent noise plus one shared factor"
    )]
    UnsupportedCorrelation {
        /// Number of sensors.
        sensors: usize,
    },
    /// A design drives a cell out of existence: fewer levels serve as well.
    #[error(
        "cell {cell} of quantizer {quantizer} vanishes (its probability falls to {probability:e}): design fewer levels"
    )]
    VanishingCell {
        /// Which quantizer of the system.
        quantizer: usize,
        /// Which of its cells.
        cell: usize,
        /// Its probability when the design stopped.
        probability: f64,
    },
    /// The best cells of a level are not one interval, and a contiguous quantizer was asked for.
    #[error("the best cells are labelled {labels:?}: no contiguous quantizer is a fixed point here")]
    NotContiguous {
        /// Labels of the best cells from left to right.
        labels: Vec<usize>,
    },
    /// Symbols arrived together that cannot do so under the model.
    #[error("these symbols cannot be received together under the model: nothing follows from them")]
    ImpossibleOutcome,
}

fewbits_numerics::lift!(fewbits_quantizers => Quantizer);

pub(crate) use fewbits_numerics::error::refuse;

/// Accepts a table of so many entries up to a limit.
pub(crate) fn at_most(table: &'static str, needed: u64, limit: u64) -> Result<(), Error> {
    if needed > limit {
        return Err(Error::TooLarge { table, needed, limit });
    }
    Ok(())
}

/// A stored number that is a size: not negative, but for rounding, and finite.
pub(crate) fn stored_size<'de, D: serde::Deserializer<'de>>(source: D) -> Result<f64, D::Error> {
    let size = <f64 as serde::Deserialize>::deserialize(source)?;
    if size.is_finite() && size >= -1e-9 {
        Ok(size)
    } else {
        Err(serde::de::Error::custom(ArgumentError::new("value", size, "a finite number that is not negative")))
    }
}
