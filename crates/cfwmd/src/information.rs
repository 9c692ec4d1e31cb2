//! Fisher information of a sensor that withholds what is near its prediction.

use crate::Error;
use fewbits_numerics::error::{finite, non_negative, positive};
use fewbits_numerics::normal;

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
    non_negative("half_width", half_width)?;
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
    use super::fisher_information;
    use fewbits_numerics::normal;

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
