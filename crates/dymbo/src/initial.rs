//! How the filter starts.

use crate::plant::scalar;
use crate::sensor::{FineMessage, FineSensor};
use crate::update::cell_update;
use crate::{Error, ScalarPlant};
use fewbits_core::Gaussian;
use fewbits_numerics::error::finite;
use fewbits_numerics::normal;
use serde::{Deserialize, Serialize};

/// The three ways to start.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Initialisation {
    /// A belief about the state, and no message yet. If it is about `theta(-1)`, the first bit is that of `n = 0`.
    Prior(Gaussian<1>),
    /// A first message of resolution `tau` and no other knowledge: `theta_hat(0) = m(0)`, variance `sigma^2 + tau^2/12`.
    ///
    /// The bound of Proposition 2, `(sigma + tau/2)^2`, is no variance to start from: it is up to twice too large and makes
    /// the filter over-cautious (erratum E7).
    Fine {
        /// The sensor that sent it.
        sensor: FineSensor,
        /// The message.
        message: FineMessage,
    },
    /// A first message that meets a prior for `theta(0)`: the cell update. Where the prior is real information, this is far
    /// better than [`Initialisation::Fine`]: at `a = 0.9`, `gamma = 0.05` the message alone is worse than the prior alone.
    FineWithPrior {
        /// The sensor that sent it.
        sensor: FineSensor,
        /// The message.
        message: FineMessage,
        /// The belief about `theta(0)` before the message.
        prior: Gaussian<1>,
    },
}

impl Initialisation {
    /// The belief to start from.
    ///
    /// # Errors
    /// [`Error::ImpossibleMessage`] if message and prior exclude each other to the last digit.
    pub fn belief(&self, plant: &ScalarPlant) -> Result<Gaussian<1>, Error> {
        match self {
            Self::Prior(belief) => Ok(*belief),
            Self::Fine { sensor, message } => {
                let tau = sensor.resolution();
                let variance = plant.measurement_variance() + tau * tau / 12.0;
                Ok(scalar(finite("message", sensor.value(*message))?, variance))
            }
            Self::FineWithPrior { sensor, message, prior } => {
                Ok(cell_update(prior, plant.measurement_variance(), &sensor.cell(*message)?)?.0)
            }
        }
    }
}

/// What a fine first message brings on average, and what it costs.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct FirstMessageValue {
    /// `E var(theta(0) | m(0))` in state units squared.
    pub expected_variance: f64,
    /// Entropy of the message in bits, the price of an ideal code for it.
    pub entropy_bits: f64,
}

/// Cells are counted out to this many standard deviations of the sample; the rest has probability below 1e-32.
const REACH: f64 = 12.0;
/// More cells than this are not a first message but a measurement.
const MOST_CELLS: f64 = 1e6;

/// Averages the prior-aware first message over all messages.
///
/// # Errors
/// More than a million cells within reach of the prior.
pub fn first_message_value(
    plant: &ScalarPlant,
    sensor: &FineSensor,
    prior: &Gaussian<1>,
) -> Result<FirstMessageValue, Error> {
    let (r, tau) = (plant.measurement_variance(), sensor.resolution());
    let reach = REACH * (prior.covariance()[0] + r).sqrt() + tau;
    if reach / tau > MOST_CELLS {
        return Err(fewbits_numerics::ArgumentError::new(
            "resolution",
            tau,
            "at most a million cells within the prior",
        )
        .into());
    }
    let multiple = |x: f64| (x / tau).round() as i64;
    let mut value = FirstMessageValue {
        expected_variance: 0.0,
        entropy_bits: 0.0,
    };
    for k in multiple(prior.mean()[0] - reach)..=multiple(prior.mean()[0] + reach) {
        let (posterior, info) = cell_update(prior, r, &sensor.cell(FineMessage(k))?)?;
        let probability = info.log_likelihood.exp();
        value.expected_variance += probability * posterior.covariance()[0];
        value.entropy_bits -= probability * info.log_likelihood / std::f64::consts::LN_2;
    }
    Ok(value)
}

/// Below this ratio of resolution to the sample's standard deviation the Fourier series of the error converges fast.
const SERIES_RATIO: f64 = 6.0;

/// Exact `E (m(0) - theta)^2` of a fine first message over `theta ~ N(mean, variance)`; variance 0 fixes `theta = mean`.
///
/// With `q_k = exp(-2 pi^2 k^2 (sigma^2 + variance)/tau^2)` it is
/// `sigma^2 + tau^2/12 + sum_k (-1)^k cos(2 pi k mean/tau) q_k [4 sigma^2 + tau^2/(pi k)^2]`, largest at `mean = tau/2`. Coarse
/// resolutions are summed cell by cell instead.
pub fn first_message_mse(plant: &ScalarPlant, sensor: &FineSensor, theta: &Gaussian<1>) -> f64 {
    let (r, tau) = (plant.measurement_variance(), sensor.resolution());
    let (mean, spread) = (theta.mean()[0], theta.covariance()[0]);
    let total = r + spread;
    if tau < SERIES_RATIO * total.sqrt() {
        let pi = std::f64::consts::PI;
        let term = |k: i32| {
            let k = f64::from(k);
            let decay = (-2.0 * (pi * k).powi(2) * total / (tau * tau)).exp();
            let sign = if k % 2.0 == 0.0 { 1.0 } else { -1.0 };
            sign * (2.0 * pi * k * mean / tau).cos() * decay * (4.0 * r + (tau / (pi * k)).powi(2))
        };
        // At the largest ratio the ninth term has decayed to exp(-44).
        return r + tau * tau / 12.0 + (1..=9).map(term).sum::<f64>();
    }
    // theta given x is normal around mean + rho (x - mean) with variance rho r; average the rest over each cell.
    let rho = spread / total;
    let deviation = total.sqrt();
    let reach = REACH * deviation + tau;
    let multiple = |x: f64| (x / tau).round() as i64;
    let cells = multiple(mean - reach)..=multiple(mean + reach);
    let between: f64 = cells
        .filter_map(|k| {
            let value = tau * k as f64;
            let (low, high) = ((value - 0.5 * tau - mean) / deviation, (value + 0.5 * tau - mean) / deviation);
            let moments = normal::truncated_moments(low, high).ok()?;
            let offset = value - mean - rho * deviation * moments.mean;
            Some(normal::interval(low, high) * (offset * offset + rho * rho * total * moments.variance))
        })
        .sum();
    between + rho * r
}

#[cfg(test)]
mod tests {
    use super::{Initialisation, first_message_mse, first_message_value};
    use crate::{FineMessage, FineSensor, ScalarPlant};
    use fewbits_core::Gaussian;
    use fewbits_numerics::normal;
    use fewbits_numerics::quadrature::gauss_legendre;

    #[test]
    fn mse_is_the_sum_over_cells_on_both_branches() {
        for (sigma, tau, theta) in [
            (1.0, 2.0, 0.3),
            (1.0, 5.9, 2.0),
            (1.0, 6.1, 2.0),
            (0.5, 12.0, 6.0),
            (2.0, 0.1, 0.02),
        ] {
            let plant = ScalarPlant::new(0.9, 0.5, sigma * sigma).unwrap();
            let sensor = FineSensor::new(tau).unwrap();
            let direct: f64 = (-600..=600)
                .map(|k| {
                    let value = tau * f64::from(k);
                    let p = normal::interval((value - 0.5 * tau - theta) / sigma, (value + 0.5 * tau - theta) / sigma);
                    p * (value - theta) * (value - theta)
                })
                .sum();
            let known = Gaussian::scalar(theta, 0.0).unwrap();
            assert!(
                (first_message_mse(&plant, &sensor, &known) - direct).abs() < 1e-11 * direct,
                "{sigma} {tau} {theta}"
            );
            let spread = Gaussian::scalar(theta, 0.7).unwrap();
            let averaged = gauss_legendre::<64>().composite(theta - 7.0, theta + 7.0, 8, |t| {
                let here = Gaussian::scalar(t, 0.0).unwrap();
                normal::log_pdf_with(t, theta, 0.7).exp() * first_message_mse(&plant, &sensor, &here)
            });
            let closed = first_message_mse(&plant, &sensor, &spread);
            assert!((closed - averaged).abs() < 1e-9 * averaged, "{closed} {averaged}");
        }
    }

    #[test]
    fn a_prior_can_only_help() {
        let plant = ScalarPlant::new(0.9, 0.05, 1.0).unwrap();
        let sensor = FineSensor::new(1.0).unwrap();
        let prior = Gaussian::scalar(0.0, plant.dynamics().stationary_variance().unwrap()).unwrap();
        let value = first_message_value(&plant, &sensor, &prior).unwrap();
        assert!(value.expected_variance < prior.covariance()[0]);
        let message = FineMessage(1);
        let alone = Initialisation::Fine { sensor, message }.belief(&plant).unwrap();
        let both = Initialisation::FineWithPrior { sensor, message, prior }
            .belief(&plant)
            .unwrap();
        assert!(both.covariance()[0] < prior.covariance()[0] && alone.covariance()[0] > prior.covariance()[0]);
        assert_eq!(Initialisation::Prior(prior).belief(&plant).unwrap(), prior);
        let fine = FineSensor::new(1e-9).unwrap();
        assert!(first_message_value(&plant, &fine, &prior).is_err());
    }
}
