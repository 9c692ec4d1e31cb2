//! Which sensor sends which bit: unequal sensors share the bits of one Gray-coded cell index.
//!
//! A uniform source on `[-V, V]` is divided into `2^N` cells; their reflected Gray code has `N` bits, and each of `N` sensors,
//! of different noise, sends one. A wrong coarse bit costs more, but coarse bits have few edges; fine bits have many, and noise inverts them first.
//! Which assignment is best is a linear assignment problem as long as bit errors are rare enough not to meet
//! ([`pair_costs`], equation 6.6); the exact error of a given assignment costs `O(N)` a node for the decoder that takes
//! the cell's centre ([`CodedSensors::centre_mse`]) and `2^N` for the posterior mean ([`CodedSensors::mmse`]).
//!
//! An assignment lists a sensor for every bit, both counted from 0, the coarsest bit first. The thesis counts from 1.
//!
//! ```
//! use fewbits_sensor_assignment::{CodedSensors, pair_costs};
//! let sensors = CodedSensors::with_variances(1.0, &[0.04, 0.03, 0.02, 0.01, 0.008, 0.006, 0.005, 0.001])?;
//! let costs = pair_costs(&sensors);
//! let best = costs.solve();
//! assert_eq!(best, [4, 5, 6, 7, 3, 2, 1, 0]);
//! assert!(costs.certificate(&best)?.is_optimal());
//! assert!(sensors.centre_mse(&best)? < sensors.centre_mse(&[7, 6, 5, 4, 3, 2, 1, 0])?);
//! # Ok::<(), fewbits_sensor_assignment::Error>(())
//! ```
//!
//! [`bit_per_sensor`] goes on from there: it hands the assigned patterns to the design of `fewbits-quantizer-design` as its start,
//! for any prior, correlated noise and links that lose or invert bits, and returns what that returns.
//!
//! Table 6.1 of the thesis heads its row of noise variances "sigma" (erratum `assign-1`).

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod coded;
mod cost;
mod design;
mod enumerate;
mod error;
mod linear;
mod setup;

pub use coded::CodedSensors;
pub use cost::{bit_error, flipped_estimate, pair_cost, pair_costs, quantization_error};
pub use design::{BitCells, bit_cells, bit_per_sensor};
pub use enumerate::{AllErrors, Estimator, Exchanged, all_errors, exchange};
pub use error::Error;
pub use linear::{CostMatrix, DualCertificate};
pub use setup::{by_precision, variances_with_moments};
