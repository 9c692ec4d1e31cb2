//! Assignment of the bits of a Gray-coded cell index to sensors of unequal noise.
//!
//! A uniform source on `[-V, V]` is divided into `2^N` cells, whose reflected Gray code has `N` bits. Each of `N` sensors of different
//! noise sends one bit. An error in a more significant bit costs more, but such bits have few edges; less significant bits have many edges,
//! so noise inverts them more often. The best assignment is a linear assignment problem if two bit errors at once are rare ([`pair_costs`],
//! equation 6.6). The exact error of a given assignment takes `O(N)` operations per node for the decoder that returns the cell's centre
//! and `2^N` for the posterior mean ([`CodedSensors::mse`]).
//!
//! An assignment lists the sensor of every bit, both counted from 0, the most significant bit first. The thesis counts from 1.
//!
//! ```
//! use fewbits_sensor_assignment::{CodedSensors, Estimator, pair_costs};
//! let sensors = CodedSensors::with_variances(1.0, &[0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001])?;
//! let costs = pair_costs(&sensors);
//! let best = costs.solve();
//! assert_eq!(best, [4, 5, 6, 7, 3, 2, 1, 0]);
//! assert!(costs.certificate(&best)?.is_optimal());
//! let error = |assignment| sensors.mse(assignment, Estimator::CellCentre);
//! assert!(error(&best)? < error(&[7, 6, 5, 4, 3, 2, 1, 0])?);
//! # Ok::<(), fewbits_sensor_assignment::Error>(())
//! ```
//!
//! [`bit_per_sensor`] uses the assigned patterns as a start for the design of `fewbits-quantizer-design`,
//! which is for any prior, correlated noise and links that lose or invert bits.
//!
//! In Table 6.1 of the thesis the row of noise variances has the heading "sigma" (erratum `assign-1`).

#![cfg_attr(test, allow(clippy::unwrap_used))]

/// Parts of the exact errors, for the comparisons in `fewbits-baselines`. No promise is made of them.
#[doc(hidden)]
pub mod engine {
    pub use crate::coded::{Moments, explained_by_pair};
    pub use crate::cost::flipped_centre;
}

mod coded;
mod cost;
mod design;
mod exchange;
mod linear;

pub use coded::{CodedSensors, Estimator};
pub use cost::{pair_costs, quantization_error};
pub use design::bit_per_sensor;
pub use exchange::{Exchanged, exchange};
pub use fewbits_quantizer_design::Error;
pub use linear::{CostMatrix, DualCertificate};
