//! What a first message is worth: its mean squared error, the variance that it leaves, and its entropy.

use fewbits_core::factor::Levels;
use fewbits_core::{Factor, Gaussian, MeasurementNoise};
use fewbits_dymbo::{Error, Multiple, RoundedSample};
use fewbits_numerics::error::ArgumentError;
use fewbits_numerics::normal;
use nalgebra::Vector1;
use serde::{Deserialize, Serialize};

/// Expected variance after a first message, and the message's entropy.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct FirstMessageValue {
    /// `E var(theta(0) | m(0))`, the mean posterior variance in state units squared.
    pub expected_variance: f64,
    /// Entropy of the message in bits: the mean length of an ideal code for it.
    pub entropy_bits: f64,
}

/// Variance of the noise in the samples.
fn noise_variance(scheme: &RoundedSample) -> f64 {
    scheme.noise_covariance_at(&Vector1::zeros())[0]
}

/// Cells are counted out to this many standard deviations of the sample; the rest has probability below 1e-32.
const REACH: f64 = 12.0;
/// Limit on the number of cells that are summed.
const MAX_CELLS: f64 = 1e6;

/// Averages [`RoundedSample::belief_with_prior`] over all messages that the prior can cause.
///
/// # Errors
/// If more than a million cells are within reach of the prior.
pub fn first_message_value(scheme: &RoundedSample, prior: &Gaussian<1>) -> Result<FirstMessageValue, Error> {
    let (r, tau) = (noise_variance(scheme), scheme.resolution());
    let reach = REACH * (prior.covariance()[0] + r).sqrt() + tau;
    if reach / tau > MAX_CELLS {
        return Err(ArgumentError::new("resolution", tau, "at most a million cells within the prior").into());
    }
    let mean = prior.mean()[0];
    let mut value = FirstMessageValue::default();
    for k in scheme.round(mean - reach)?.0..=scheme.round(mean + reach)?.0 {
        let posterior = Levels::certain(scheme.cell(Multiple(k))?, r)?.tilted(prior)?;
        let probability = posterior.log_evidence.exp();
        value.expected_variance += probability * posterior.covariance[0];
        value.entropy_bits -= probability * posterior.log_evidence / std::f64::consts::LN_2;
    }
    Ok(value)
}

/// Below this ratio of the resolution to the sample's standard deviation the Fourier series of the error is used; nine terms suffice.
const SERIES_RATIO: f64 = 6.0;

/// Exact `E (m(0) - theta)^2` of a first message for `theta ~ N(mean, variance)`. With variance 0 the state is `mean`. The word is
/// assumed to be long enough for the sample: saturation is ignored.
///
/// With `q_k = exp(-2 pi^2 k^2 (sigma^2 + variance)/tau^2)` it is
/// `sigma^2 + tau^2/12 + sum_k (-1)^k cos(2 pi k mean/tau) q_k [4 sigma^2 + tau^2/(pi k)^2]`, largest at `mean = tau/2`. Coarse
/// resolutions are summed cell by cell instead.
pub fn first_message_mse(scheme: &RoundedSample, theta: &Gaussian<1>) -> f64 {
    let (r, tau) = (noise_variance(scheme), scheme.resolution());
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
    // Given the sample x, theta is normal with mean `mean + rho (x - mean)` and variance rho r. Sum over the cells of x.
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
    use super::{first_message_mse, first_message_value};
    use fewbits_core::Gaussian;
    use fewbits_dymbo::RoundedSample;
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
            let scheme = RoundedSample::new(sigma * sigma, tau).unwrap();
            let direct: f64 = (-600..=600)
                .map(|k| {
                    let value = tau * f64::from(k);
                    let p = normal::interval((value - 0.5 * tau - theta) / sigma, (value + 0.5 * tau - theta) / sigma);
                    p * (value - theta) * (value - theta)
                })
                .sum();
            let known = Gaussian::scalar(theta, 0.0).unwrap();
            assert!((first_message_mse(&scheme, &known) - direct).abs() < 1e-11 * direct, "{sigma} {tau} {theta}");
            let spread = Gaussian::scalar(theta, 0.7).unwrap();
            let averaged = gauss_legendre::<64>().composite(theta - 7.0, theta + 7.0, 8, |t| {
                let here = Gaussian::scalar(t, 0.0).unwrap();
                normal::log_pdf_with(t, theta, 0.7).exp() * first_message_mse(&scheme, &here)
            });
            let closed = first_message_mse(&scheme, &spread);
            assert!((closed - averaged).abs() < 1e-9 * averaged, "{closed} {averaged}");
        }
    }

    /// By the law of total variance over the cells of a wide prior, and by the entropy of a finely rounded Gaussian.
    #[test]
    fn what_a_message_is_worth_under_a_wide_prior() {
        let (r, tau, mean, p) = (1.3, 0.7, 0.4, 900.0);
        let value =
            first_message_value(&RoundedSample::new(r, tau).unwrap(), &Gaussian::scalar(mean, p).unwrap()).unwrap();
        // E var = p - var E, and E(theta | cell) = mean + p/(p + r) (E(x | cell) - mean).
        let (s, total) = (f64::sqrt(p + r), p + r);
        let spread: f64 = (-600..=600)
            .map(|k| {
                let ends = [-0.5, 0.5].map(|half| (tau * (f64::from(k) + half) - mean) / s);
                let share = normal::interval(ends[0], ends[1]);
                let first = normal::pdf(ends[0]) - normal::pdf(ends[1]);
                if share > 0.0 { first * first / share } else { 0.0 }
            })
            .sum();
        let expected = p - p * p / total * spread;
        assert!((value.expected_variance / expected - 1.0).abs() < 1e-6, "{value:?} {expected}");
        // A cell that holds all of the prior says nothing, and costs nothing.
        let coarse =
            first_message_value(&RoundedSample::new(r, 200.0).unwrap(), &Gaussian::scalar(mean, 2.0).unwrap()).unwrap();
        assert!((coarse.expected_variance - 2.0).abs() < 1e-12 && coarse.entropy_bits.abs() < 1e-12, "{coarse:?}");
        let entropy = 0.5 * (std::f64::consts::TAU * std::f64::consts::E * total).log2() - tau.log2();
        assert!((value.entropy_bits - entropy).abs() < 1e-4, "{value:?} {entropy}");
    }

    #[test]
    fn a_message_leaves_less_variance_than_the_prior() {
        let scheme = RoundedSample::new(1.0, 1.0).unwrap();
        let prior = Gaussian::scalar(0.0, 0.05 / 0.19).unwrap();
        let value = first_message_value(&scheme, &prior).unwrap();
        assert!(value.expected_variance < prior.covariance()[0]);
        let fine = RoundedSample::new(1.0, 1e-9).unwrap();
        assert!(first_message_value(&fine, &prior).is_err());
    }
}
