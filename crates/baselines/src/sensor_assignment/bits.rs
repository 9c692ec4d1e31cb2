//! One wrong bit: how likely it is, and where it lands.

use fewbits_binary_patterns::{BinaryQuantizer, Error, uniform_cells};
use fewbits_numerics::error::refuse;
use fewbits_sensor_assignment::engine::flipped_centre;

/// Estimate of the centre decoder if Gray bit `bit` of the cell of `x` is inverted and all others are right.
///
/// # Errors
/// If `bit` is not below `bits`, `bits` is out of range, the half width is not positive, or `x` is NaN.
pub fn flipped_estimate(x: f64, bit: usize, bits: usize, half_width: f64) -> Result<f64, Error> {
    let grid = uniform_cells(half_width, bits)?;
    if bit >= bits {
        return refuse("bit", bit, format!("a bit below {bits}"));
    }
    Ok(flipped_centre(grid.encode(x)?, bit, grid.cells(), half_width))
}

/// `P(bit wrong | x)`: the probability that the bit differs from that of the cell that contains `x`.
///
/// # Errors
/// If `x` is NaN.
pub fn bit_error(quantizer: &BinaryQuantizer, x: f64, noise_deviation: f64) -> Result<f64, Error> {
    let right = quantizer.encode(x)?;
    Ok(quantizer.probabilities(x, noise_deviation)[usize::from(!right)])
}
