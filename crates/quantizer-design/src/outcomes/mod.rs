//! Joint outcomes of groups of exchangeable sensors on the nodes of a quadrature rule: the engine of every exact error.
//!
//! Given the unknown (a node of a rule) the sensors are independent. Of sensors with the same law of their symbols only the counts of
//! symbols matter. Everything that a design needs is a sum over nodes of a product of one row per group:
//!
//! ```text
//! cells    <- P(cell | node) of one sensor                               cell_probabilities
//! symbols  <- P(symbol | node), cells mixed by labels and channel        Table::mixed
//! counts   <- P(counts of the group's symbols | node)                    Table::of_counts
//! outcomes <- one row of every group's table                             moments: sums over nodes; for_each: the nodes themselves
//! ```
//!
//! `quantizer-design` computes its criteria and their derivatives from these sums, `binary-patterns` the errors of patterns, and
//! `sensor-assignment` those of assignments. A table has one row per symbol, count vector or cell, and one column per node.
//!
//! ```
//! use fewbits_quantizer_design::outcomes::{NodeWeights, Table, cell_probabilities, moments};
//! // Three equal sensors report the sign of a sample in unit noise; the unknown is -1 or 1.
//! let signs = cell_probabilities(&[-1.0, 1.0], 1.0, &[0.0]);
//! let counts = signs.of_counts(3);
//! let joint = moments(&[&counts], &[NodeWeights::of_all(vec![0.5, 0.5])]);
//! assert!(joint.len() == 4 && (joint.iter().sum::<f64>() - 1.0).abs() < 1e-14);
//! ```

pub(crate) mod axis;
pub(crate) mod counts;
mod sums;
mod table;

pub(crate) use sums::moments_until;
pub use sums::{IMPOSSIBLE, explained, for_each, for_each_log, moments};
pub use table::{NodeWeights, Table, cell_probabilities, dot};
pub(crate) use table::{SETTLED, add_scaled, intervals};
