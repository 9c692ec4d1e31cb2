//! What others do with one bit a sensor, all evaluated exactly.

mod adaptive;
mod luo;
mod multi_threshold;

pub use adaptive::{AdaptiveErrors, AdaptiveRule, adaptive, bounded_mle};
pub use luo::{Luo, LuoErrors};
pub use multi_threshold::{MultiThreshold, multi_threshold_bound};

use super::{Bank, BinaryQuantizer, Source};
use crate::Error;
use fewbits_numerics::error::at_least_one;

/// `sensors` sensors that all send the sign of their measurement.
///
/// # Errors
/// If there is no sensor or `noise_std` is not positive and finite.
pub fn fixed_threshold(source: Source, noise_std: f64, sensors: usize) -> Result<Bank, Error> {
    at_least_one("sensors", sensors)?;
    let sign = BinaryQuantizer::new(vec![0.0])?;
    Bank::homogeneous_with_deviation(source, vec![sign; sensors], noise_std)
}
