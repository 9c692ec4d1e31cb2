//! Several one-bit sensors in one slot, all at the same threshold.
//!
//! Refreshing the threshold after each bit is better and needs nothing new: predict once, then
//! [`DymboFilter::update`](crate::DymboFilter::update) for each sensor. The types here serve sensors that must answer at the
//! same time. They share one prediction error, so their bits are correlated and the count of `+1` is sufficient.

use crate::filter::StepInfo;
use crate::plant::scalar;
use crate::update::UpdateInfo;
use crate::{Error, ScalarPlant};
use fewbits_core::{Gaussian, Observation};
use fewbits_numerics::error::{ArgumentError, at_least_one, within};
use fewbits_numerics::normal::{self, SQRT_2_OVER_PI};
use fewbits_numerics::quadrature::gauss_legendre;
use std::f64::consts::FRAC_2_PI;

/// How the count of `+1` bits moves the estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum CountFusion {
    /// The best linear function of the bits, from the arcsine law of their correlation. Cheap and free of tables; it saturates
    /// as sensors are added, at a variance of `P (1 - rho/asin rho)` with `rho = P/(P + sigma^2)`.
    #[default]
    Linear,
    /// The posterior mean given the count, from quadrature. Better by 2.6 % at ten sensors.
    Table,
}

/// Most sensors of one slot.
pub const MOST_SENSORS: usize = 1000;

/// The filter for `K` sensors that answer the same question at once.
///
/// Linear fusion: `mean = mean + G sum_i b_i` and `P = P - (2/pi)(P^2/s^2) K/D`, with `D = 1 + (K-1)(2/pi) asin rho`,
/// `G = sqrt(2/pi) (P/s)/D`, `s^2 = P + sigma^2`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ParallelFilter {
    plant: ScalarPlant,
    sensors: usize,
    fusion: CountFusion,
}

impl ParallelFilter {
    /// The filter for 1 to 1000 sensors.
    ///
    /// # Errors
    /// Any other number.
    pub fn new(plant: ScalarPlant, sensors: usize, fusion: CountFusion) -> Result<Self, Error> {
        at_least_one("sensors", sensors)?;
        within("sensors", sensors as f64, 1.0, MOST_SENSORS as f64)?;
        Ok(Self { plant, sensors, fusion })
    }

    /// The plant.
    pub fn plant(&self) -> &ScalarPlant {
        &self.plant
    }

    /// `K`.
    pub fn sensors(&self) -> usize {
        self.sensors
    }

    /// The threshold to broadcast for the next slot: the prediction.
    pub fn threshold(&self, belief: &Gaussian<1>) -> f64 {
        self.plant.coefficient() * belief.mean()[0]
    }

    /// `1 + (K - 1)(2/pi) asin rho`: the factor by which correlation inflates the variance of the sum of bits.
    fn inflation(&self, p: f64) -> f64 {
        let rho = p / (p + self.plant.measurement_variance());
        1.0 + (self.sensors as f64 - 1.0) * FRAC_2_PI * rho.asin()
    }

    /// Corrections for `0..=K` bits of `+1`, in state units, and the average variance after them.
    pub fn table(&self, predicted_variance: f64) -> (Vec<f64>, f64) {
        let k = self.sensors;
        let (p, r) = (predicted_variance, self.plant.measurement_variance());
        match self.fusion {
            CountFusion::Linear => {
                let inflation = self.inflation(p);
                let gain = SQRT_2_OVER_PI * self.plant.innovation_gain(p) / inflation;
                let corrections = (0..=k).map(|up| gain * (2.0 * up as f64 - k as f64)).collect();
                (corrections, self.linear_variance(p))
            }
            CountFusion::Table => {
                let mut corrections = Vec::with_capacity(k + 1);
                let mut variance = p;
                for up in 0..=k {
                    let (probability, mean) = count_moments(k, up, p, r);
                    corrections.push(mean);
                    variance -= probability * mean * mean;
                }
                (corrections, variance.max(0.0))
            }
        }
    }

    fn linear_variance(&self, p: f64) -> f64 {
        let rho = p / (p + self.plant.measurement_variance());
        p * (1.0 - FRAC_2_PI * rho * self.sensors as f64 / self.inflation(p))
    }

    /// One slot: predict, then correct with the number of bits that were `+1`, unless the slot was lost.
    ///
    /// # Errors
    /// A count above `K`.
    pub fn step(&self, belief: &Gaussian<1>, heard: Observation<usize>) -> Result<(Gaussian<1>, StepInfo), Error> {
        let predicted = self.plant.predict(belief);
        let Observation::Received(up) = heard else {
            return Ok((
                predicted,
                StepInfo {
                    predicted,
                    correction: 0.0,
                    update: None,
                    bits: 0,
                },
            ));
        };
        if up > self.sensors {
            return Err(ArgumentError::new("count", up, format!("at most {} bits of +1", self.sensors)).into());
        }
        let (p, r) = (predicted.covariance()[0], self.plant.measurement_variance());
        let (correction, variance) = match self.fusion {
            CountFusion::Linear => {
                let gain = SQRT_2_OVER_PI * self.plant.innovation_gain(p) / self.inflation(p);
                (gain * (2.0 * up as f64 - self.sensors as f64), self.linear_variance(p))
            }
            CountFusion::Table => {
                let (corrections, variance) = self.table(p);
                (corrections[up], variance)
            }
        };
        let update = UpdateInfo {
            log_likelihood: count_moments(self.sensors, up, p, r).0.ln(),
            information: if p > 0.0 {
                (p - variance) * (p + r) / (p * p)
            } else {
                0.0
            },
        };
        let info = StepInfo {
            predicted,
            correction,
            update: Some(update),
            bits: self.sensors as u32,
        };
        Ok((scalar(predicted.mean()[0] + correction, variance), info))
    }
}

/// Standard deviations over which the prediction error is integrated.
const REACH: f64 = 9.0;

/// Probability of `up` bits of `+1` among `k`, and the mean of the prediction error `e ~ N(0, p)` given that.
fn count_moments(k: usize, up: usize, p: f64, r: f64) -> (f64, f64) {
    let (deviation, sigma) = (p.sqrt(), r.sqrt());
    let log_choose: f64 = (0..up).map(|i| ((k - i) as f64 / (i + 1) as f64).ln()).sum();
    let log_term = |e: f64| {
        let up = up as f64;
        log_choose + up * normal::log_cdf(e / sigma) + (k as f64 - up) * normal::log_cdf(-e / sigma)
    };
    // The narrowest feature is that of the posterior, about sqrt(r/k) wide.
    let width = (r / k as f64).sqrt().min(deviation).max(deviation * 1e-3);
    let panels = (2.0 * REACH * deviation / (3.0 * width).max(f64::MIN_POSITIVE)).ceil() as usize;
    let (mut mass, mut first) = (0.0, 0.0);
    for (z, w) in gauss_legendre::<20>().panels(-REACH, REACH, panels.clamp(6, 4000)) {
        let density = w * (normal::log_pdf(z) + log_term(deviation * z)).exp();
        mass += density;
        first += density * z;
    }
    (mass, if mass > 0.0 { deviation * first / mass } else { 0.0 })
}

/// Probability of `up` bits of `+1` among `k` when the prediction error is `error`, for measurement variance `r`.
pub(crate) fn count_probability(k: usize, up: usize, error: f64, r: f64) -> f64 {
    let z = error / r.sqrt();
    let choose: f64 = (0..up).map(|i| (k - i) as f64 / (i + 1) as f64).product();
    choose * normal::cdf(z).powi(up as i32) * normal::cdf(-z).powi((k - up) as i32)
}

#[cfg(test)]
mod tests {
    use super::{CountFusion, ParallelFilter, count_moments, count_probability};
    use crate::{DymboFilter, ScalarPlant};
    use fewbits_core::{Gaussian, Observation, Sign};

    fn plant() -> ScalarPlant {
        ScalarPlant::new(0.9, 0.5, 1.0).unwrap()
    }

    #[test]
    fn one_sensor_is_the_dymbo_filter() {
        let belief = Gaussian::scalar(0.3, 1.0).unwrap();
        let dymbo = DymboFilter::new(plant())
            .step(&belief, Observation::Received(Sign::Above))
            .unwrap()
            .0;
        for fusion in [CountFusion::Linear, CountFusion::Table] {
            let (one, info) = ParallelFilter::new(plant(), 1, fusion)
                .unwrap()
                .step(&belief, Observation::Received(1))
                .unwrap();
            assert!((one.mean()[0] - dymbo.mean()[0]).abs() < 1e-12);
            assert!((one.covariance()[0] - dymbo.covariance()[0]).abs() < 1e-12);
            assert!((info.update.unwrap().log_likelihood - 0.5_f64.ln()).abs() < 1e-12);
        }
    }

    #[test]
    fn counts_are_a_distribution_and_the_table_beats_the_line() {
        for k in [2, 5, 40] {
            let mass: f64 = (0..=k).map(|up| count_moments(k, up, 1.1, 1.0).0).sum();
            let given: f64 = (0..=k).map(|up| count_probability(k, up, 0.7, 1.0)).sum();
            assert!((mass - 1.0).abs() < 1e-12 && (given - 1.0).abs() < 1e-12);
            let linear = ParallelFilter::new(plant(), k, CountFusion::Linear).unwrap().table(1.1);
            let table = ParallelFilter::new(plant(), k, CountFusion::Table).unwrap().table(1.1);
            assert!(table.1 < linear.1);
            assert!(table.0.windows(2).all(|pair| pair[0] < pair[1]));
            // The linear variance is what its corrections truly leave: E (e - d)^2.
            let left: f64 = (0..=k)
                .map(|up| {
                    let (p, m) = count_moments(k, up, 1.1, 1.0);
                    p * (linear.0[up] * linear.0[up] - 2.0 * m * linear.0[up])
                })
                .sum();
            assert!((1.1 + left - linear.1).abs() < 1e-11);
        }
    }

    #[test]
    fn linear_fusion_saturates() {
        let many = ParallelFilter::new(plant(), 1000, CountFusion::Linear)
            .unwrap()
            .table(1.0)
            .1;
        assert!((many - (1.0 - 0.5 / 0.5_f64.asin())).abs() < 2e-3);
        assert!(ParallelFilter::new(plant(), 0, CountFusion::Linear).is_err());
        assert!(ParallelFilter::new(plant(), 1001, CountFusion::Linear).is_err());
        let two = ParallelFilter::new(plant(), 2, CountFusion::Linear).unwrap();
        let belief = Gaussian::scalar(0.0, 1.0).unwrap();
        assert!(two.step(&belief, Observation::Received(3)).is_err());
        assert_eq!(two.step(&belief, Observation::Lost).unwrap().0, plant().predict(&belief));
    }
}
