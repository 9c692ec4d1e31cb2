//! Published schemes for comparison: other ways to send one bit per sensor, and the thesis's substitutes for a search. The
//! recommended designs are in [`search`](fewbits_binary_patterns::search). All errors are computed exactly.

mod adaptive;
pub mod count;
mod decoders;
mod information;
mod luo;
mod multi_threshold;
mod strategies;

pub use adaptive::{AdaptiveErrors, AdaptiveRule, adaptive, bounded_mle};
pub use decoders::Decoder;
pub use information::printed_crlb;
pub use luo::{Luo, LuoErrors};
pub use multi_threshold::{MultiThreshold, multi_threshold_bound};
pub use strategies::{by_information, tile};

use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::{Bank, BinaryQuantizer, Source};
use fewbits_numerics::error::at_least_one;

/// A bank of `sensors` sensors that all send the sign of their measurement.
///
/// # Errors
/// If there is no sensor or `noise_deviation` is not positive and finite.
pub fn fixed_threshold(source: Source, noise_deviation: f64, sensors: usize) -> Result<Bank, Error> {
    at_least_one("sensors", sensors)?;
    let sign = BinaryQuantizer::new(vec![0.0])?;
    Bank::homogeneous_with_deviation(source, vec![sign; sensors], noise_deviation)
}
