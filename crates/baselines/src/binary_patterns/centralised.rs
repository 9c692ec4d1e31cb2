//! The smallest error that `N` bits allow if one encoder sees all measurements.

use super::conditional_mean::ConditionalMean;
use fewbits_binary_patterns::{Error, Source};
use fewbits_numerics::error::{positive, refuse};
use fewbits_numerics::newton;
use fewbits_quantizers::density::{CellMoments, Density};
use fewbits_quantizers::lloyd_max;

/// Largest number of sensors: the quantizer of the estimate has `2^N` levels.
const MAX_SENSORS: usize = 12;
/// Number of points of the table from which the inversion of the conditional mean starts.
const TABLE: usize = 2000;

/// Exact least mean squared error of any scheme in which `sensors` measurements of equal noise are described by one bit each.
///
/// It is `E Var[X|Ybar]` plus the Lloyd-Max distortion of `E[X|Ybar]` with `2^N` levels, where the average `Ybar` has noise
/// variance `s^2/N`. No distributed scheme has a smaller error, since it is a special case of a centralised one.
///
/// # Errors
/// If `noise_deviation` is not positive and finite, `sensors` not in `1..=12`, or the quantizer's iteration fails.
pub fn centralised_bound(source: &Source, noise_deviation: f64, sensors: usize) -> Result<f64, Error> {
    if !(1..=MAX_SENSORS).contains(&sensors) {
        return refuse("sensors", sensors, "a number of sensors in 1..=12");
    }
    let measurement = ConditionalMean::with_deviation(
        *source,
        positive("noise_deviation", noise_deviation)? / (sensors as f64).sqrt(),
    )?;
    let estimate = EstimateDensity::new(measurement);
    let quantizer = lloyd_max::design(&estimate, 1 << sensors)?;
    Ok(measurement.estimation_error() + quantizer.mean_squared_error())
}

/// Distribution of `E[X|Y]`. Integrals are taken over the measurement `y`, in which the integrands are smooth.
struct EstimateDensity {
    measurement: ConditionalMean,
    /// `E[X|y]` at evenly spaced `y`, increasing.
    table: Vec<f64>,
}

impl EstimateDensity {
    fn new(measurement: ConditionalMean) -> Self {
        let reach = measurement.measurement_reach();
        let table = (0..=TABLE)
            .map(|i| measurement.moments(reach * (2.0 * i as f64 / TABLE as f64 - 1.0)).0)
            .collect();
        Self { measurement, table }
    }

    /// The measurement whose estimate is `v`, by Newton's method within a bracket from the table.
    fn measurement_of(&self, v: f64) -> f64 {
        let reach = self.measurement.measurement_reach();
        let at = self.table.partition_point(|&t| t < v);
        if at == 0 {
            return -reach;
        }
        if at > TABLE {
            return reach;
        }
        let y_at = |i: usize| reach * (2.0 * i as f64 / TABLE as f64 - 1.0);
        let (low, high) = (y_at(at - 1), y_at(at));
        let noise = self.measurement.noise_deviation();
        let off = |y: f64| {
            let (mean, variance) = self.measurement.moments(y);
            (mean - v, variance / (noise * noise))
        };
        newton::increasing(off, low, high, 0.5 * (low + high), 1e-14 * reach)
    }

    fn integral(&self, a: f64, b: f64, f: impl Fn(f64) -> f64) -> f64 {
        let (from, to) = (self.measurement_of(a), self.measurement_of(b));
        if from >= to {
            return 0.0;
        }
        self.measurement.integrate(from, to, |_, mean, _| f(mean))
    }
}

impl Density for EstimateDensity {
    fn pdf(&self, v: f64) -> f64 {
        let y = self.measurement_of(v);
        let noise = self.measurement.noise_deviation();
        let variance = self.measurement.moments(y).1;
        if variance > 0.0 {
            self.measurement.measurement_density(y) * noise * noise / variance
        } else {
            0.0
        }
    }

    fn centre(&self) -> f64 {
        0.0
    }

    fn cell(&self, a: f64, b: f64) -> CellMoments {
        let (low, high) = (a.max(self.table[0]), b.min(self.table[TABLE]));
        let mass = self.integral(low, high, |_| 1.0);
        CellMoments::clipped((a, b), (low, high), mass, self.integral(low, high, |v| v - low))
    }

    fn squared_error(&self, a: f64, b: f64, point: f64) -> f64 {
        self.integral(a, b, |v| (v - point) * (v - point))
    }

    fn extent(&self) -> (f64, f64) {
        (self.table[0], self.table[TABLE])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn a_gaussian_source_needs_only_the_normal_table() {
        let source = Source::gaussian_with_deviation(0.5).unwrap();
        let bound = centralised_bound(&source, 0.4, 3).unwrap();
        let gain = 0.25 / (0.25 + 0.16 / 3.0);
        let table = lloyd_max::gaussian_table(3).unwrap().mean_squared_error();
        assert_relative_eq!(bound, gain * 0.16 / 3.0 + gain * 0.25 * table, max_relative = 1e-9);
    }

    #[test]
    fn the_estimate_of_one_measurement_has_any_number_of_levels() {
        let measurement = ConditionalMean::with_deviation(Source::gaussian_with_deviation(0.5).unwrap(), 0.4).unwrap();
        let gain = 0.25 / (0.25 + 0.16);
        assert_relative_eq!(measurement.estimation_error(), gain * 0.16, max_relative = 1e-9);
        for levels in [2, 3, 5, 16] {
            let found = lloyd_max::design(&EstimateDensity::new(measurement), levels).unwrap();
            let table = lloyd_max::gaussian(levels).unwrap().mean_squared_error();
            assert_relative_eq!(found.mean_squared_error(), gain * 0.25 * table, max_relative = 1e-9);
        }
    }

    #[test]
    fn the_number_of_levels_is_limited() {
        let source = Source::uniform(1.0).unwrap();
        assert!(centralised_bound(&source, 0.4, 0).is_err());
        assert!(centralised_bound(&source, 0.4, 13).is_err());
        assert!(centralised_bound(&source, f64::NAN, 3).is_err());
    }
}
