//! What one bit, or one quantizer cell, says about a normal belief: exact moments in closed form.

use crate::Error;
use crate::plant::scalar;
use fewbits_core::{Cell, Gaussian, Sign};
use fewbits_numerics::error::{finite, positive, within};
use fewbits_numerics::normal;

/// What an update reveals besides the new belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpdateInfo {
    /// `ln p(message | past)`.
    pub log_likelihood: f64,
    /// Fraction of the variance reduction of the unquantized measurement that this message brought. Negative where a
    /// message raises the variance, as a surprising bit through a noisy link may.
    pub information: f64,
}

/// Moments of `theta ~ N(mu, P)` after a sign bit `r` at `threshold` of `theta + w`, `w ~ N(0, sigma^2)`, delivered inverted
/// with probability `crossover`.
///
/// ```text
/// s = sqrt(P + sigma^2),  zeta = r (mu - threshold)/s
/// p = eps + (1 - 2 eps) Phi(zeta)                      probability of the bit
/// lambda = (1 - 2 eps) phi(zeta)/p,  delta = lambda (lambda + zeta)
/// mean = mu + r (P/s) lambda
/// variance = [P sigma^2 + P^2 (1 - delta)]/(P + sigma^2)
/// ```
///
/// The posterior itself is a skew-normal density; these are its exact mean and variance. With `crossover = 0` and the
/// threshold at `mu` this is equations (17) and (18) of the paper. A bit through a noisy link may leave a variance *above*
/// the prior's; that is right and must not be clamped.
///
/// # Errors
/// `measurement_variance <= 0`, a threshold that is not finite, `crossover` outside `[0, 1/2]`, a result out of range.
///
/// ```
/// use fewbits_core::{Gaussian, Sign};
/// use fewbits_dymbo::bit_update;
/// let (posterior, _) = bit_update(&Gaussian::scalar(0.0, 1.0)?, 1.0, Sign::Above, 0.0, 0.0)?;
/// assert!((posterior.mean()[0] - std::f64::consts::PI.sqrt().recip()).abs() < 1e-14);
/// # Ok::<(), fewbits_dymbo::Error>(())
/// ```
#[inline]
pub fn bit_update(
    prior: &Gaussian<1>,
    measurement_variance: f64,
    bit: Sign,
    threshold: f64,
    crossover: f64,
) -> Result<(Gaussian<1>, UpdateInfo), Error> {
    let r = positive("measurement_variance", measurement_variance)?;
    finite("threshold", threshold)?;
    within("crossover", crossover, 0.0, 0.5)?;
    let (mean, p) = (prior.mean()[0], prior.covariance()[0]);
    let s = (p + r).sqrt();
    let zeta = bit.value() * (mean - threshold) / s;
    let (log_likelihood, lambda, rest) = if crossover == 0.0 {
        let heard = normal::one_sided(zeta);
        (heard.log_probability, heard.mean, heard.variance)
    } else {
        let clean = 1.0 - 2.0 * crossover;
        let probability = crossover + clean * normal::cdf(zeta);
        let lambda = clean * normal::pdf(zeta) / probability;
        let product = if lambda == 0.0 { 0.0 } else { lambda * (lambda + zeta) };
        (probability.ln(), lambda, 1.0 - product)
    };
    finish(mean + bit.value() * (p / s) * lambda, p, r, rest, log_likelihood)
}

/// Moments of `theta ~ N(mu, P)` given that `theta + w`, `w ~ N(0, sigma^2)`, lies in `cell`: the mean is
/// `mu + (P/s) m` and the variance `[P sigma^2 + P^2 v]/(P + sigma^2)`, with `m` and `v` the moments of a standard normal
/// variable in the normalised cell.
///
/// # Errors
/// `measurement_variance <= 0`; [`Error::ImpossibleMessage`] for a cell so far out that even its logarithm overflows.
#[inline]
pub fn cell_update(
    prior: &Gaussian<1>,
    measurement_variance: f64,
    cell: &Cell,
) -> Result<(Gaussian<1>, UpdateInfo), Error> {
    let r = positive("measurement_variance", measurement_variance)?;
    let (mean, p) = (prior.mean()[0], prior.covariance()[0]);
    let s = (p + r).sqrt();
    let (low, high) = ((cell.lower() - mean) / s, (cell.upper() - mean) / s);
    let log_likelihood = normal::log_interval(low, high);
    // Rounding may close a cell that is narrow against its distance.
    let moments = normal::truncated_moments(low, high).map_err(|_| Error::ImpossibleMessage)?;
    finish(mean + (p / s) * moments.mean, p, r, moments.variance, log_likelihood)
}

/// The posterior from its mean and `rest`, the fraction of the innovation variance that the message left.
#[inline]
fn finish(mean: f64, p: f64, r: f64, rest: f64, log_likelihood: f64) -> Result<(Gaussian<1>, UpdateInfo), Error> {
    let variance = p * (r + p * rest) / (p + r);
    if mean.is_finite() && variance.is_finite() && log_likelihood.is_finite() {
        let information = 1.0 - rest;
        Ok((
            scalar(mean, variance),
            UpdateInfo {
                log_likelihood,
                information,
            },
        ))
    } else {
        Err(Error::ImpossibleMessage)
    }
}

/// Expected [`UpdateInfo::information`] of a bit whose threshold lies `offset` innovation standard deviations from the
/// prediction: `(1 - 2 eps)^2 phi(z)^2/(p_+ p_-)`. Largest, `2/pi` for a clean link, at `offset = 0`: thresholding at the
/// prediction is the best single step.
///
/// # Errors
/// An offset that is not finite, `crossover` outside `[0, 1/2]`.
pub fn expected_bit_information(offset: f64, crossover: f64) -> Result<f64, Error> {
    let z = finite("offset", offset)?;
    let eps = within("crossover", crossover, 0.0, 0.5)?;
    if eps == 0.0 {
        return Ok(normal::inverse_mills(z) * normal::inverse_mills(-z));
    }
    let clean = 1.0 - 2.0 * eps;
    let heard = |z: f64| eps + clean * normal::cdf(z);
    let slope = clean * normal::pdf(z);
    Ok(slope * slope / (heard(z) * heard(-z)))
}

#[cfg(test)]
mod tests {
    use super::{bit_update, cell_update, expected_bit_information};
    use fewbits_core::{Cell, Gaussian, Sign};
    use fewbits_filters::{Grid, PointMass};
    use fewbits_numerics::normal::log_cdf;
    use proptest::prelude::*;

    /// Bayes' rule on a fine grid.
    fn by_grid(mean: f64, variance: f64, log_likelihood: impl Fn(f64) -> f64) -> (f64, f64, f64) {
        let deviation = variance.sqrt();
        let grid = Grid::new(mean - 12.0 * deviation, mean + 12.0 * deviation, deviation / 400.0).unwrap();
        let mut belief = PointMass::normal(grid, mean, variance).unwrap();
        let evidence = belief.update(log_likelihood).unwrap();
        (belief.mean(), belief.variance(), evidence)
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn a_bit_is_bayes_rule(
            mean in -2.0..2.0_f64, variance in 0.1..4.0_f64, r in 0.2..3.0_f64,
            threshold in -4.0..4.0_f64, eps in 0.0..0.5_f64, clean in any::<bool>(), above in any::<bool>(),
        ) {
            let eps = if clean { 0.0 } else { eps };
            let bit = if above { Sign::Above } else { Sign::Below };
            let prior = Gaussian::scalar(mean, variance).unwrap();
            let (posterior, info) = bit_update(&prior, r, bit, threshold, eps).unwrap();
            let (m, v, evidence) = by_grid(mean, variance, |x| {
                (eps + (1.0 - 2.0 * eps) * log_cdf(bit.value() * (x - threshold) / r.sqrt()).exp()).ln()
            });
            prop_assert!((posterior.mean()[0] - m).abs() < 1e-9);
            prop_assert!((posterior.covariance()[0] - v).abs() < 1e-9);
            prop_assert!((info.log_likelihood - evidence).abs() < 1e-9);
        }

        #[test]
        fn the_two_bits_average_to_the_expected_information(z in -3.0..3.0_f64, eps in 0.0..0.5_f64) {
            let prior = Gaussian::scalar(0.0, 3.0).unwrap();
            let mean: f64 = [Sign::Above, Sign::Below]
                .into_iter()
                .map(|bit| bit_update(&prior, 1.0, bit, 2.0 * z, eps).unwrap().1)
                .map(|info| info.log_likelihood.exp() * info.information)
                .sum();
            prop_assert!((mean - expected_bit_information(z, eps).unwrap()).abs() < 1e-12);
        }

        #[test]
        fn no_finite_input_gives_nan(
            mean in -1e6..1e6_f64, variance in 0.0..1e6_f64, r in 1e-6..1e6_f64, t in -1e6..1e6_f64, width in 1e-3..1e6_f64,
        ) {
            let prior = Gaussian::scalar(mean, variance).unwrap();
            for bit in [Sign::Above, Sign::Below] {
                if let Ok((posterior, _)) = bit_update(&prior, r, bit, t, 0.0) {
                    prop_assert!(posterior.covariance()[0] >= 0.0 && posterior.covariance()[0] <= variance * (1.0 + 1e-12));
                }
            }
            if let Ok((posterior, _)) = cell_update(&prior, r, &Cell::new(t, t + width).unwrap()) {
                prop_assert!(posterior.covariance()[0] >= 0.0 && posterior.covariance()[0] <= variance * (1.0 + 1e-12));
            }
        }
    }

    #[test]
    fn half_a_crossover_says_nothing_and_certainty_does_not_move() {
        let prior = Gaussian::scalar(1.0, 2.0).unwrap();
        let (posterior, _) = bit_update(&prior, 1.0, Sign::Above, -30.0, 0.5).unwrap();
        assert_eq!(posterior, prior);
        let known = Gaussian::scalar(1.0, 0.0).unwrap();
        assert_eq!(bit_update(&known, 1.0, Sign::Below, 0.0, 0.0).unwrap().0, known);
    }

    #[test]
    fn far_thresholds_keep_their_digits() {
        // delta = lambda (lambda + zeta) exceeds 1 here if formed naively.
        let prior = Gaussian::scalar(0.0, 1.0).unwrap();
        let threshold = 1e5 * 2.0_f64.sqrt();
        let (posterior, info) = bit_update(&prior, 1.0, Sign::Above, threshold, 0.0).unwrap();
        let rest = 2.0 * (2.0 * posterior.covariance()[0] - 1.0);
        assert!(info.information <= 1.0 && (posterior.covariance()[0] - 0.5).abs() < 1e-9 && rest >= 0.0);
    }

    #[test]
    fn refuses_bad_arguments() {
        let prior = Gaussian::scalar(0.0, 1.0).unwrap();
        assert!(bit_update(&prior, 0.0, Sign::Above, 0.0, 0.0).is_err());
        assert!(bit_update(&prior, 1.0, Sign::Above, f64::NAN, 0.0).is_err());
        assert!(bit_update(&prior, 1.0, Sign::Above, 0.0, 0.6).is_err());
        assert!(bit_update(&prior, 1.0, Sign::Above, 0.0, -0.1).is_err());
        assert!(Cell::new(1.0, 1.0).is_err());
        assert!(cell_update(&prior, f64::NAN, &Cell::new(0.0, 1.0).unwrap()).is_err());
        assert!(expected_bit_information(f64::NAN, 0.0).is_err());
    }
}
