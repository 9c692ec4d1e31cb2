//! Random networks of the figures of chapter 6, and an assignment without optimisation.

use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, non_negative, positive, refuse};

/// Variances with exactly this mean and population standard deviation; their deviations from the mean are proportional to the centred
/// `direction`.
///
/// With a standard normal random vector as direction, the variances are uniform on the sphere of that radius. `Ok(None)` if a variance
/// is below `least`; try another direction then.
///
/// # Errors
/// Unless `deviation <= mean sqrt(N - 1)` (for larger deviations some variance is always negative); if the mean or `least` is not
/// positive, the deviation is negative, the direction is constant or not finite, or a variance is not finite.
pub fn variances_with_moments(
    mean: f64,
    deviation: f64,
    least: f64,
    direction: &[f64],
) -> Result<Option<Vec<f64>>, ArgumentError> {
    let mean = positive("mean", mean)?;
    let deviation = non_negative("deviation", deviation)?;
    let least = positive("least", least)?;
    all_finite("direction", direction)?;
    let count = direction.len();
    if count == 0 || deviation > mean * (count as f64 - 1.0).sqrt() {
        let expected = format!("at most mean sqrt(count - 1), with mean {mean} over {count} sensors");
        return refuse("deviation", deviation, expected);
    }
    if deviation == 0.0 {
        return Ok((mean >= least).then(|| vec![mean; count]));
    }
    let centre = direction.iter().sum::<f64>() / count as f64;
    let spread = (direction.iter().map(|z| (z - centre) * (z - centre)).sum::<f64>() / count as f64).sqrt();
    if !(spread > 0.0 && spread.is_finite()) {
        return refuse("direction", "constant", "numbers that differ");
    }
    let variances: Vec<f64> = direction
        .iter()
        .map(|z| mean + deviation * (z - centre) / spread)
        .collect();
    all_finite("variances", &variances)?;
    Ok(variances.iter().all(|&v| v >= least).then_some(variances))
}

/// "Assignment II": the sensor of smallest variance gets the most significant bit, and so on; of equal sensors the lower index comes first.
pub fn by_precision(variances: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..variances.len()).collect();
    order.sort_by(|&a, &b| variances[a].total_cmp(&variances[b]));
    order
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn moments_are_exact() {
        let v = variances_with_moments(0.03, 0.01, 1e-4, &[0.3, -1.2, 2.0, 0.1])
            .unwrap()
            .unwrap();
        let mean = v.iter().sum::<f64>() / 4.0;
        let var = v.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 4.0;
        assert_relative_eq!(mean, 0.03, max_relative = 1e-14);
        assert_relative_eq!(var, 1e-4, max_relative = 1e-12);
        assert_eq!(by_precision(&[0.04, 0.01, 0.02, 0.01]), [1, 3, 2, 0]);
    }

    #[test]
    fn infeasible_moments_are_typed_errors() {
        assert!(matches!(
            variances_with_moments(0.03, 0.06, 1e-4, &[1.0, 2.0, 3.0, 4.0]),
            Err(e) if e.name == "deviation"
        ));
        assert!(variances_with_moments(0.03, 0.01, 1e-4, &[1.0; 4]).is_err());
        assert!(variances_with_moments(-0.03, 0.01, 1e-4, &[1.0, 2.0]).is_err());
        assert!(variances_with_moments(0.03, 0.01, 1e-4, &[1.0, f64::NAN]).is_err());
        assert!(variances_with_moments(0.03, 0.0, 1e-4, &[]).is_err());
        assert_eq!(variances_with_moments(0.03, 0.05, 1e-4, &[3.0, 0.0, 0.0, -3.1]).unwrap(), None);
    }
}
