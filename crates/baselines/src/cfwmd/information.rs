//! Information of a sent or withheld measurement: divergences between the beliefs before and after, and Fisher information.
//!
//! For scalar measurements three rules are equivalent: send if the innovation is large (`q = nu^2/s`), if the update changes
//! the belief much, or if the measurement is improbable. With noise variance `r` and innovation variance `s > r`,
//!
//! - `KL(prior || posterior) = 1/2 [(s/r - 1)(1 + q) - ln(s/r)]`
//! - `KL(posterior || prior) = 1/2 [ln(s/r) - (1 - r/s) + (1 - r/s) q]`, whose mean is the mutual information `1/2 ln(s/r)`
//! - symmetric: `(s - r)^2/(2 r s) + q (s^2 - r^2)/(2 r s)`
//!
//! all increase with `q`. None of them needs the inverse of a state covariance, which does not exist for a known start. A constant
//! threshold on a divergence equals a threshold on `q` that varies with time and sensor. For vector measurements the rules differ: the
//! divergence weighs the innovation by `S^-1 (S - R) R^-1`.

use fewbits_cfwmd::Error;
use fewbits_numerics::error::{finite, positive, refuse};
use fewbits_numerics::normal;
use serde::{Deserialize, Serialize};

/// Which divergence between the beliefs before and after an update.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// `KL(prior || posterior)`.
    PriorToPosterior,
    /// `KL(posterior || prior)`.
    PosteriorToPrior,
    /// The sum of the two.
    Symmetric,
}

/// `(a, b)` of the divergence `a + b q`, `q` the normalised innovation squared.
fn line(direction: Direction, s: f64, r: f64) -> Result<(f64, f64), Error> {
    positive("innovation_variance", s)?;
    positive("noise_variance", r)?;
    if s <= r {
        let expected = format!("more than the noise variance {r}, or the measurement says nothing about the state");
        return refuse("innovation_variance", s, expected);
    }
    let excess = s - r;
    let log_ratio = (excess / r).ln_1p();
    Ok(match direction {
        Direction::PriorToPosterior => (0.5 * (excess / r - log_ratio), 0.5 * excess / r),
        Direction::PosteriorToPrior => (0.5 * (log_ratio - excess / s), 0.5 * excess / s),
        Direction::Symmetric => {
            let scale = 0.5 / (r * s);
            (scale * excess * excess, scale * excess * (s + r))
        }
    })
}

/// Divergence, in nats, between the beliefs before and after a scalar Kalman update with this innovation.
///
/// # Errors
/// If a variance is not positive, or `s <= r`.
pub fn divergence(
    direction: Direction,
    innovation: f64,
    innovation_variance: f64,
    noise_variance: f64,
) -> Result<f64, Error> {
    finite("innovation", innovation)?;
    let (a, b) = line(direction, innovation_variance, noise_variance)?;
    Ok(a + b * innovation * innovation / innovation_variance)
}

/// Fisher information about `y = h(x)` in one step of a censoring sensor, averaged over reports and silences. With the offset
/// `mu = y - prediction`, the half-width `c` of the interval of silence and noise variance `r`:
///
/// `J = (1 - [pi + a phi(a) - b phi(b)])/r + (phi(b) - phi(a))^2/(r pi)`, `a = (-c - mu)/sqrt r`, `b = (c - mu)/sqrt r`,
/// `pi = Phi(b) - Phi(a)`.
///
/// It lies between the information of the sent values alone and `1/r`, that of a sensor that always reports.
///
/// # Errors
/// If the half-width is negative, the noise variance not positive or the offset not finite.
pub fn fisher_information(mu: f64, half_width: f64, noise_variance: f64) -> Result<f64, Error> {
    finite("mu", mu)?;
    fewbits_numerics::error::non_negative("half_width", half_width)?;
    let deviation = positive("noise_variance", noise_variance)?.sqrt();
    if half_width == 0.0 {
        return Ok(1.0 / noise_variance);
    }
    let (a, b) = ((-half_width - mu) / deviation, (half_width - mu) / deviation);
    let cell = normal::truncated_moments(a, b)?;
    let inside = normal::interval(a, b);
    // With x the noise in deviations, a value in the cell would contribute E[x^2 | cell] pi; silence contributes E[x | cell]^2 pi.
    Ok((1.0 - inside * cell.variance) / noise_variance)
}

#[cfg(test)]
mod tests {
    use super::{Direction, divergence, fisher_information};
    use fewbits_core::Gaussian;
    use fewbits_filters::kalman;
    use fewbits_models::LinearSensor;
    use fewbits_numerics::normal;
    use nalgebra::{Matrix3, SVector, Vector3};

    #[test]
    fn the_scalar_forms_are_the_divergences_of_a_kalman_update() {
        let prior =
            Gaussian::new(Vector3::new(0.3, -1.0, 2.0), Matrix3::new(2.0, 0.4, 0.1, 0.4, 1.0, -0.3, 0.1, -0.3, 1.5))
                .unwrap();
        let sensor = LinearSensor::scalar(Vector3::new(1.0, 0.5, -0.7), 0.8).unwrap();
        for z in [-4.0, 0.0, 1.3, 9.0] {
            let (posterior, info) = kalman::update(&sensor, &prior, &SVector::from([z])).unwrap();
            let (nu, s) = (info.innovation[0], info.innovation_covariance[(0, 0)]);
            let forward = prior.kl_divergence(&posterior).unwrap();
            let backward = posterior.kl_divergence(&prior).unwrap();
            for (direction, exact) in [
                (Direction::PriorToPosterior, forward),
                (Direction::PosteriorToPrior, backward),
                (Direction::Symmetric, forward + backward),
            ] {
                let ours = divergence(direction, nu, s, 0.8).unwrap();
                assert!((ours - exact).abs() < 1e-12 * exact.max(1.0), "{direction:?}: {ours} {exact}");
            }
        }
    }

    #[test]
    fn the_mean_of_the_backward_divergence_is_the_mutual_information() {
        // It is linear in q, and E q = 1.
        let at_mean = divergence(Direction::PosteriorToPrior, 3.8_f64.sqrt(), 3.8, 1.0).unwrap();
        assert!((at_mean - 0.5 * 3.8_f64.ln()).abs() < 1e-15);
    }

    #[test]
    fn an_uninformative_measurement_has_no_rule() {
        for s in [1.0, 0.5] {
            assert!(divergence(Direction::Symmetric, 1.0, s, 1.0).is_err());
        }
    }

    #[test]
    fn the_information_of_silence_is_the_formula_and_the_curvature() {
        for (mu, c, r) in [(0.3, 1.1, 1.0), (-2.0, 0.5, 2.0), (6.0, 1.0, 1.0), (0.0, 30.0, 1.0)] {
            let sd = f64::sqrt(r);
            let (a, b) = ((-c - mu) / sd, (c - mu) / sd);
            let pi = normal::interval(a, b);
            let sent = 1.0 - (pi + a * normal::pdf(a) - b * normal::pdf(b));
            let silent = (normal::pdf(b) - normal::pdf(a)).powi(2) / pi;
            let ours = fisher_information(mu, c, r).unwrap();
            assert!((ours - (sent + silent) / r).abs() < 1e-12, "{ours}");
            assert!((0.0..=1.0 / r).contains(&ours));
        }
        assert_eq!(fisher_information(0.0, 0.0, 2.0).unwrap(), 0.5);
        assert!(fisher_information(0.0, -1.0, 2.0).is_err());
    }
}
