//! A random trigger that keeps the belief Gaussian.

use crate::Error;
use fewbits_models::{LinearSensor, ScalarSensor};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::positive;
use rand::{Rng, RngExt};

/// Sends with probability `1 - exp(-nu^2 Y/2)` (Han and others 2015).
///
/// The probability of silence is a Gaussian function of the innovation, so silence is a measurement `nu = 0` with noise
/// variance `r + 1/Y`, and the Kalman filter stays exact. The price is paid in information: at equal rate the error is larger
/// than with a deterministic threshold whose silence is fused.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StochasticTrigger {
    precision: f64,
}

impl StochasticTrigger {
    /// The trigger with precision `Y > 0` (inverse measurement units squared).
    ///
    /// # Errors
    /// A precision that is not positive.
    pub fn new(precision: f64) -> Result<Self, Error> {
        Ok(Self {
            precision: positive("precision", precision)?,
        })
    }

    /// The trigger that sends innovations `N(0, s)` with probability `rate`: `Y = ((1 - rate)^-2 - 1)/s`.
    ///
    /// # Errors
    /// A rate outside `(0, 1)`, a variance that is not positive.
    pub fn for_rate(rate: f64, innovation_variance: f64) -> Result<Self, Error> {
        if !(rate > 0.0 && rate < 1.0) {
            return Err(ArgumentError::new("rate", rate, "a probability in (0, 1), both ends excluded").into());
        }
        positive("innovation_variance", innovation_variance)?;
        let silent = 1.0 - rate;
        Self::new(rate * (1.0 + silent) / (silent * silent) / innovation_variance)
    }

    /// `Y`.
    pub fn precision(&self) -> f64 {
        self.precision
    }

    /// Probability that a sensor with this innovation speaks.
    pub fn probability(&self, innovation: f64) -> f64 {
        -(-0.5 * innovation * innovation * self.precision).exp_m1()
    }

    /// Whether it speaks this time.
    pub fn speaks<R: Rng + ?Sized>(&self, rng: &mut R, innovation: f64) -> bool {
        rng.random::<f64>() < self.probability(innovation)
    }

    /// The sensor whose measurement of exactly the prediction is what silence says: noise variance `r + 1/Y`.
    ///
    /// # Errors
    /// None for a sensor that was accepted once.
    pub fn silent_sensor<const D: usize>(&self, sensor: &ScalarSensor<D>) -> Result<ScalarSensor<D>, Error> {
        Ok(LinearSensor::scalar(sensor.direction(), sensor.noise_variance() + 1.0 / self.precision)?)
    }
}

#[cfg(test)]
mod tests {
    use super::StochasticTrigger;
    use fewbits_numerics::normal::log_pdf_with;
    use fewbits_numerics::quadrature::gauss_legendre;

    #[test]
    fn the_rate_is_met() {
        for (rate, s) in [(0.5, 3.8), (0.25, 3.8), (0.9, 0.1), (1e-6, 7.0)] {
            let trigger = StochasticTrigger::for_rate(rate, s).unwrap();
            let reach = 10.0 * f64::sqrt(s);
            let mean = gauss_legendre::<24>()
                .composite(-reach, reach, 40, |nu| log_pdf_with(nu, 0.0, s).exp() * trigger.probability(nu));
            assert!((mean / rate - 1.0).abs() < 1e-9, "{rate} {s}: {mean}");
        }
    }

    #[test]
    fn silence_is_a_gaussian_measurement() {
        // p(silent | mu) = E exp(-(mu + n)^2 Y/2) is proportional to N(mu; 0, r + 1/Y).
        let (trigger, r) = (StochasticTrigger::new(0.7).unwrap(), 1.3);
        let silent = |mu: f64| {
            gauss_legendre::<24>()
                .composite(-14.0, 14.0, 40, |n| log_pdf_with(n, 0.0, r).exp() * (1.0 - trigger.probability(mu + n)))
        };
        for mu in [0.5, 2.0, -3.0] {
            let expected = (log_pdf_with(mu, 0.0, r + 1.0 / 0.7) - log_pdf_with(0.0, 0.0, r + 1.0 / 0.7)).exp();
            assert!((silent(mu) / silent(0.0) / expected - 1.0).abs() < 1e-10);
        }
    }

    #[test]
    fn bad_rates_are_refused() {
        for rate in [0.0, 1.0, -0.1, f64::NAN] {
            assert!(StochasticTrigger::for_rate(rate, 1.0).is_err());
        }
        assert!(StochasticTrigger::for_rate(0.5, 0.0).is_err());
        assert!(StochasticTrigger::new(f64::INFINITY).is_err());
    }
}
