//! One-bit quantizers: breakpoints at which the bit changes.

use crate::Error;
use fewbits_numerics::normal::{interval, log_interval, pdf};
use fewbits_quantizer_design::outcomes::{Table, cell_probabilities};
use fewbits_quantizers::Quantizer;

/// Beyond this many standard deviations the tail probability underflows.
const VANISHED: f64 = 39.0;

/// A one-bit quantizer: the bit is 0 below the first breakpoint and changes at each breakpoint.
///
/// Every one-bit quantizer of a scalar has this form, up to the names of its outputs, whatever [`Pattern`] it came from.
///
/// [`Pattern`]: crate::Pattern
#[derive(Debug, Clone, PartialEq)]
pub struct BinaryQuantizer(Quantizer);

impl BinaryQuantizer {
    /// A quantizer with strictly increasing finite breakpoints, at least one.
    ///
    /// # Errors
    /// If there is no breakpoint, one is not finite, or they do not increase strictly.
    pub fn new(breakpoints: Vec<f64>) -> Result<Self, Error> {
        let labels = (0..=breakpoints.len()).map(|cell| cell % 2).collect();
        Ok(Self(Quantizer::with_labels(breakpoints, labels)?))
    }

    /// The breakpoints, increasing.
    pub fn breakpoints(&self) -> &[f64] {
        self.0.breakpoints()
    }

    /// The bit of a measurement: the parity of the number of breakpoints at or below it.
    ///
    /// Infinite measurements are in the outermost cells.
    ///
    /// # Errors
    /// If the measurement is NaN.
    pub fn encode(&self, measurement: f64) -> Result<bool, Error> {
        Ok(self.0.encode(measurement)? == 1)
    }

    /// `[P(0|x), P(1|x)]` for the measurement `Y = x + N(0, noise_deviation^2)`.
    ///
    /// Each is a sum of interval probabilities, so that neither loses digits if it is small.
    pub fn probabilities(&self, x: f64, noise_deviation: f64) -> [f64; 2] {
        let mut mass = [0.0; 2];
        self.for_cells(x, noise_deviation, |bit, low, high| {
            if high > -VANISHED && low < VANISHED {
                mass[bit] += interval(low, high);
            }
        });
        mass
    }

    /// [`probabilities`](Self::probabilities) at many points: a row for bit 0 and one for bit 1, a column per point.
    pub fn probabilities_at(&self, points: &[f64], noise_deviation: f64) -> Table {
        let cells = cell_probabilities(points, noise_deviation, self.breakpoints());
        cells.mixed(2, |bit, cell| f64::from(cell % 2 == bit))
    }

    /// `[ln P(0|x), ln P(1|x)]`, finite for every finite `x`.
    pub(crate) fn log_probabilities(&self, x: f64, noise_deviation: f64) -> [f64; 2] {
        let mut largest = [f64::NEG_INFINITY; 2];
        self.for_cells(x, noise_deviation, |bit, low, high| {
            largest[bit] = largest[bit].max(log_interval(low, high));
        });
        let mut sum = [0.0; 2];
        self.for_cells(x, noise_deviation, |bit, low, high| {
            if largest[bit] > f64::NEG_INFINITY {
                sum[bit] += (log_interval(low, high) - largest[bit]).exp();
            }
        });
        [largest[0] + sum[0].ln(), largest[1] + sum[1].ln()]
    }

    /// `dP(1|x)/dx`, the sum of `+-phi((t - x)/s)/s` over the breakpoints `t`.
    pub(crate) fn slope(&self, x: f64, noise_deviation: f64) -> f64 {
        let mut sign = 1.0;
        let mut slope = 0.0;
        for &t in self.breakpoints() {
            slope += sign * pdf((t - x) / noise_deviation);
            sign = -sign;
        }
        slope / noise_deviation
    }

    /// Fisher information about `x` in the bit: `P1'^2 / (P0 P1)`; 0 if it underflows.
    pub fn fisher_information(&self, x: f64, noise_deviation: f64) -> f64 {
        let [p0, p1] = self.probabilities(x, noise_deviation);
        let slope = self.slope(x, noise_deviation);
        // Both factors of the product may be tiny; dividing by the smaller one last keeps the quotient in range.
        let information = (slope / p0.max(p1)) * (slope / p0.min(p1));
        if information.is_finite() { information } else { 0.0 }
    }

    fn for_cells(&self, x: f64, noise_deviation: f64, mut visit: impl FnMut(usize, f64, f64)) {
        let mut low = f64::NEG_INFINITY;
        let mut bit = 0;
        for &t in self.breakpoints() {
            let high = (t - x) / noise_deviation;
            visit(bit, low, high);
            bit ^= 1;
            low = high;
        }
        visit(bit, low, f64::INFINITY);
    }
}

/// The same cells, with the bit as level.
impl From<BinaryQuantizer> for Quantizer {
    fn from(binary: BinaryQuantizer) -> Self {
        binary.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;
    use proptest::prelude::*;

    #[test]
    fn many_points_are_one_after_the_other() {
        let quantizer = BinaryQuantizer::new(vec![-1.0, 0.5, 0.6, 9.0]).unwrap();
        let points: Vec<f64> = (-300..300).map(|i| 0.37 * f64::from(i)).collect();
        for noise in [1e-2, 0.7, 30.0] {
            let one_by_one: Vec<_> = points.iter().map(|x| quantizer.probabilities(*x, noise)).collect();
            let many = quantizer.probabilities_at(&points, noise);
            for (i, one) in one_by_one.iter().enumerate() {
                let off = |bit: usize| (many.row(bit)[i] - one[bit]).abs();
                assert!((0..2).all(|bit| off(bit) <= 1e-15 * one[bit] + f64::MIN_POSITIVE));
            }
        }
    }

    #[test]
    fn edges_belong_to_the_cell_above() {
        let quantizer = BinaryQuantizer::new(vec![-1.0, 0.5]).unwrap();
        let bits: Vec<bool> = [f64::NEG_INFINITY, -1.0, 0.4, 0.5, f64::INFINITY]
            .iter()
            .map(|&y| quantizer.encode(y).unwrap())
            .collect();
        assert_eq!(bits, [false, true, true, false, false]);
        assert!(quantizer.encode(f64::NAN).is_err());
    }

    #[test]
    fn thresholds_must_increase() {
        for bad in [
            vec![],
            vec![1.0, 1.0],
            vec![2.0, 1.0],
            vec![f64::NAN],
            vec![f64::INFINITY],
        ] {
            assert!(BinaryQuantizer::new(bad).is_err());
        }
    }

    proptest! {
        #[test]
        fn both_probabilities_are_exact_on_their_own(x in -60.0..60.0f64, first in -2.0..2.0f64, gap in 0.01..3.0f64) {
            let quantizer = BinaryQuantizer::new(vec![first, first + gap]).unwrap();
            let [p0, p1] = quantizer.probabilities(x, 1.0);
            prop_assert!((p0 + p1 - 1.0).abs() < 1e-14);
            let logs = quantizer.log_probabilities(x, 1.0);
            for (p, log) in [p0, p1].into_iter().zip(logs) {
                prop_assert!(log.is_finite());
                if p > 1e-290 {
                    prop_assert!((p.ln() - log).abs() < 1e-11 * log.abs().max(1.0));
                }
            }
        }

        #[test]
        fn slope_is_the_derivative(x in -3.0..3.0f64) {
            let quantizer = BinaryQuantizer::new(vec![-0.7, 0.1, 1.2]).unwrap();
            let h = 1e-5;
            let numeric = (quantizer.probabilities(x + h, 0.6)[1] - quantizer.probabilities(x - h, 0.6)[1]) / (2.0 * h);
            prop_assert!((quantizer.slope(x, 0.6) - numeric).abs() < 1e-8);
        }
    }

    #[test]
    fn information_of_a_sign_is_that_of_a_probit() {
        let sign = BinaryQuantizer::new(vec![0.0]).unwrap();
        assert_relative_eq!(sign.fisher_information(0.0, 0.5), 2.0 / std::f64::consts::PI / 0.25, max_relative = 1e-14);
        assert_eq!(sign.fisher_information(100.0, 0.5), 0.0);
    }
}
