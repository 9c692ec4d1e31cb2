//! Costs of pairs of bit and sensor, and where a wrong bit lands.

use approx::assert_relative_eq;
use fewbits_baselines::sensor_assignment::{bit_error, flipped_estimate};
use fewbits_sensor_assignment::{CodedSensors, pair_costs};

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
