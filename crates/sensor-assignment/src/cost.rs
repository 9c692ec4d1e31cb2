//! The cost of assigning a bit to a sensor, if no other bit is wrong.

use super::CodedSensors;
use super::linear::CostMatrix;
use fewbits_numerics::quadrature::gauss_legendre;

/// Estimate of the centre decoder for a sample of a cell if Gray bit `bit` is inverted and all others are right.
///
/// The cell's centre `c` is in a block of width `2 V / 2^(bit)` (bits counted from 0). Inverting the bit mirrors `c` within this
/// block. Doing so twice gives `c` again.
pub fn flipped_centre(cell: usize, bit: usize, cells: usize, half_width: f64) -> f64 {
    let block = cells >> bit;
    let first = cell / block * block;
    let mirrored = 2 * first + block - 1 - cell;
    half_width * (2.0 * mirrored as f64 + 1.0 - cells as f64) / cells as f64
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
