//! The cost of assigning a bit to a sensor, if no other bit is wrong.

use super::CodedSensors;
use super::linear::CostMatrix;
use crate::Error;
use fewbits_binary_patterns::BinaryQuantizer;
use fewbits_binary_patterns::CellGrid;
use fewbits_numerics::error::refuse;
use fewbits_numerics::quadrature::gauss_legendre;

/// Estimate of the centre decoder if Gray bit `bit` of the cell of `x` is inverted and all others are right.
///
/// The cell's centre `c` is in a block of width `2 V / 2^(bit)` (bits counted from 0). Inverting the bit mirrors `c` within this
/// block. Doing so twice gives `c` again.
///
/// # Errors
/// If `bit` is not below `bits`, `bits` is out of range, the half width is not positive, or `x` is NaN.
pub fn flipped_estimate(x: f64, bit: usize, bits: usize, half_width: f64) -> Result<f64, Error> {
    let grid = CellGrid::uniform(half_width, bits)?;
    if bit >= bits {
        return refuse("bit", bit, format!("a bit below {bits}"));
    }
    Ok(flipped_centre(grid.locate(x)?, bit, grid.cells(), half_width))
}

/// As [`flipped_estimate`], from the cell's index.
fn flipped_centre(cell: usize, bit: usize, cells: usize, half_width: f64) -> f64 {
    let block = cells >> bit;
    let first = cell / block * block;
    let mirrored = 2 * first + block - 1 - cell;
    half_width * (2.0 * mirrored as f64 + 1.0 - cells as f64) / cells as f64
}

/// `P(bit wrong | x)`: the probability that the bit differs from that of the cell that contains `x`.
///
/// # Errors
/// If `x` is NaN.
pub fn bit_error(quantizer: &BinaryQuantizer, x: f64, noise_deviation: f64) -> Result<f64, Error> {
    let right = quantizer.encode(x)?;
    Ok(quantizer.probabilities(x, noise_deviation)[usize::from(!right)])
}

/// Mean squared error of the cells' centres without noise, `V^2 / (3 4^N)`.
pub fn quantization_error(half_width: f64, bits: usize) -> f64 {
    half_width * half_width / 3.0 / 4f64.powi(bits as i32)
}

/// `Gamma_{b,n} = E[(X - f_b(X))^2 P(bit b of sensor n wrong | X)]`, for every bit and sensor (equation 6.5).
///
/// The sum of the costs of an assignment plus [`quantization_error`] approximates the error of the centre decoder
/// (equation 6.6); it includes the cases with one wrong bit only. The integrand jumps at the edges of cells, so every cell has its own
/// panel. By symmetry half of them are enough.
pub fn pair_costs(sensors: &CodedSensors) -> CostMatrix {
    let size = sensors.sensors();
    CostMatrix {
        size,
        costs: (0..size * size)
            .map(|at| pair_cost(sensors, at / size, at % size))
            .collect(),
    }
}

/// One entry of [`pair_costs`].
fn pair_cost(sensors: &CodedSensors, bit: usize, sensor: usize) -> f64 {
    let (bits, v) = (sensors.sensors(), sensors.half_width());
    let quantizer = &sensors.quantizers()[bit];
    let noise = sensors.noise_deviations()[sensor];
    let cells = 1usize << bits;
    let width = 2.0 * v / cells as f64;
    // If a cell is narrow compared with the noise, the integrand is nearly a polynomial and a few nodes are enough.
    let panels = (width / noise).ceil().clamp(1.0, 1e4) as usize;
    let rule = if width < 0.3 * noise {
        gauss_legendre::<6>()
    } else {
        gauss_legendre::<12>()
    };
    let (mut points, mut weights) = (Vec::new(), Vec::new());
    // The code is symmetric except for its first bit, and so is the cost.
    for cell in cells / 2..cells {
        // Without another wrong bit, all samples of a cell whose bit is inverted have the same estimate.
        let landing = flipped_centre(cell, bit, cells, v);
        let low = v * (2.0 * cell as f64 - cells as f64) / cells as f64;
        let middle = low + 0.5 * width;
        let right = quantizer.breakpoints().partition_point(|&t| t <= middle) % 2;
        for (x, w) in rule.panels(low, low + width, panels) {
            points.push(x);
            weights.push((1 - right, w * (x - landing) * (x - landing)));
        }
    }
    let probabilities = quantizer.probabilities_at(&points, noise);
    let cost: f64 = weights
        .iter()
        .enumerate()
        .map(|(i, (wrong, w))| w * probabilities.row(*wrong)[i])
        .sum();
    cost / v
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn flipping_twice_returns() {
        for bit in 0..4 {
            for cell in 0..16 {
                let centre = -0.8 + 0.1 * (f64::from(cell) + 0.5);
                let there = flipped_estimate(centre, bit, 4, 0.8).unwrap();
                assert_relative_eq!(flipped_estimate(there, bit, 4, 0.8).unwrap(), centre, epsilon = 1e-14);
                assert!((there - centre).abs() > 0.05);
            }
        }
        assert!(flipped_estimate(0.0, 4, 4, 1.0).is_err());
        assert!(flipped_estimate(f64::NAN, 0, 4, 1.0).is_err());
    }

    #[test]
    fn the_finest_bit_moves_to_the_neighbour_of_its_pair() {
        assert_relative_eq!(flipped_estimate(0.05, 2, 3, 1.0).unwrap(), 0.375);
        assert_relative_eq!(flipped_estimate(0.3, 2, 3, 1.0).unwrap(), 0.125);
        assert_relative_eq!(flipped_estimate(0.3, 0, 3, 1.0).unwrap(), -0.375);
    }

    #[test]
    fn costs_agree_with_a_plain_midpoint_sum() {
        let sensors = CodedSensors::with_variances(1.3, &[0.04, 0.0009, 0.3]).unwrap();
        let costs = pair_costs(&sensors);
        let points = 16_000;
        for bit in 0..3 {
            for (sensor, &noise) in sensors.noise_deviations().iter().enumerate() {
                let sum: f64 = (0..points)
                    .map(|i| 1.3 * (2.0 * (f64::from(i) + 0.5) / f64::from(points) - 1.0))
                    .map(|x| {
                        let off = x - flipped_estimate(x, bit, 3, 1.3).unwrap();
                        off * off * bit_error(&sensors.quantizers()[bit], x, noise).unwrap()
                    })
                    .sum();
                assert_relative_eq!(costs.get(bit, sensor).unwrap(), sum / f64::from(points), max_relative = 1e-5);
            }
        }
    }
}
