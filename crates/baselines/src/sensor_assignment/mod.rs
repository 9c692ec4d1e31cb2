//! What assignments are compared with: the errors of all of them, the most precise sensor for the coarsest bit, and random networks.

mod all_errors;
mod bits;
mod networks;

pub use all_errors::{AllErrors, all_errors};
pub use bits::{bit_error, flipped_estimate};
pub use networks::{by_precision, variances_with_moments};
