//! How far the posterior of one bit is from the normal density of the same moments.

use fewbits_core::factor::{Factor, Levels};
use fewbits_core::{Gaussian, Link, Sign};
use fewbits_dymbo::Error;
use fewbits_numerics::error::positive;
use fewbits_numerics::normal::{self, log_pdf_with};

/// Density at `theta` of the exact posterior after a bit at the prior mean: skew-normal,
/// `p(theta | b) = (2/s) phi((theta - mu)/s) Phi(b (theta - mu)/sigma)` with prior `N(mu, s^2)`.
pub fn posterior_density(theta: f64, prior: &Gaussian<1>, measurement_variance: f64, bit: Sign) -> f64 {
    let (offset, s) = (theta - prior.mean()[0], prior.covariance()[0].sqrt());
    2.0 / s * normal::pdf(offset / s) * normal::cdf(bit.value() * offset / measurement_variance.sqrt())
}

/// Points of the first scan, over twelve prior standard deviations either side.
const SCAN: usize = 4800;
/// Golden-section steps. Each multiplies the bracket's width by 0.618.
const REFINEMENTS: usize = 60;

/// Largest difference over `theta` between the exact posterior of one bit and the normal density with its mean and variance
/// (Proposition 1b). It falls as `0.0200/s (s/sigma)^3` when the noise grows against the prior.
///
/// # Errors
/// If a variance is not positive.
pub fn distance_from_normal(prior_variance: f64, measurement_variance: f64) -> Result<f64, Error> {
    let s = positive("prior_variance", prior_variance)?.sqrt();
    let prior = Gaussian::scalar(0.0, prior_variance)?;
    let posterior = Levels::sign(Sign::Above, 0.0, measurement_variance, &Link::PERFECT)?.tilted(&prior)?;
    let (mean, variance) = (posterior.mean[0], posterior.covariance[0]);
    let difference = |theta: f64| {
        let exact = posterior_density(theta, &prior, measurement_variance, Sign::Above);
        (exact - log_pdf_with(theta, mean, variance).exp()).abs()
    };
    let at = |i: usize| s * 12.0 * (2.0 * i as f64 / SCAN as f64 - 1.0);
    // The difference has several peaks: a scan finds the highest, golden section refines it.
    let best = (1..SCAN)
        .max_by(|&i, &j| difference(at(i)).total_cmp(&difference(at(j))))
        .unwrap_or(1);
    let (mut low, mut high) = (at(best - 1), at(best + 1));
    let golden = 0.5 * (5.0_f64.sqrt() - 1.0);
    for _ in 0..REFINEMENTS {
        let (left, right) = (high - golden * (high - low), low + golden * (high - low));
        if difference(left) > difference(right) {
            high = right;
        } else {
            low = left;
        }
    }
    Ok(difference(0.5 * (low + high)))
}

#[cfg(test)]
mod tests {
    use super::{distance_from_normal, posterior_density};
    use fewbits_core::factor::{Factor, Levels};
    use fewbits_core::{Gaussian, Link, Sign};
    use fewbits_numerics::quadrature::gauss_legendre;

    #[test]
    fn the_density_has_the_moments_of_the_update() {
        let prior = Gaussian::scalar(0.5, 2.0).unwrap();
        for bit in [Sign::Above, Sign::Below] {
            let moment = |k: i32| {
                gauss_legendre::<64>().composite(-12.0, 13.0, 4, |t| t.powi(k) * posterior_density(t, &prior, 0.3, bit))
            };
            let posterior = Levels::sign(bit, 0.5, 0.3, &Link::PERFECT)
                .unwrap()
                .tilted(&prior)
                .unwrap();
            assert!((moment(0) - 1.0).abs() < 1e-12);
            assert!((moment(1) - posterior.mean[0]).abs() < 1e-12);
            assert!((moment(2) - moment(1).powi(2) - posterior.covariance[0]).abs() < 1e-12);
        }
    }

    #[test]
    fn distance_scales_with_the_prior() {
        let unit = distance_from_normal(1.0, 4.0).unwrap();
        let wide = distance_from_normal(9.0, 36.0).unwrap();
        assert!((wide * 3.0 - unit).abs() < 1e-12);
        assert!(distance_from_normal(0.0, 1.0).is_err() && distance_from_normal(1.0, 0.0).is_err());
    }
}
