//! Ribeiro and Giannakis (2006): one threshold per sensor, distributed over the range of the source to minimise a Cramer-Rao bound.

use super::even_nodes;
use fewbits_binary_patterns::Error;
use fewbits_binary_patterns::Nodes;
use fewbits_binary_patterns::Source;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::normal::log_cdf;
use fewbits_numerics::quadrature::gauss_legendre;
use std::f64::consts::TAU;

/// Number of thresholds of the grid.
const THRESHOLDS: usize = 401;
/// Noise standard deviations by which the thresholds extend beyond the support.
const MARGIN: f64 = 2.0;
/// The iteration stops once the relative gap, which bounds the distance from the optimum, is below this.
const GAP: f64 = 3e-4;
/// Largest number of multiplicative updates.
const MAX_UPDATES: usize = 200_000;
/// Information beyond this many standard deviations from the threshold is below `1e-17` of its peak.
const BAND: f64 = 9.0;

/// The optimum with fractional numbers of sensors.
#[derive(Debug, Clone, PartialEq)]
pub struct MultiThreshold {
    /// `E[1 / sum_k rho_k I(X; t_k)]`, the averaged Cramer-Rao bound.
    pub bound: f64,
    /// Thresholds of the grid.
    pub thresholds: Vec<f64>,
    /// Number of sensors at each threshold, not necessarily whole; they sum to the number of sensors.
    pub sensors: Vec<f64>,
    /// Largest relative distance from the optimum, by duality.
    pub gap: f64,
}

/// `ln I(x; t)` of the sign of `Y - t`: `phi(u)^2 / (s^2 Phi(u) Phi(-u))` at `u = (x - t)/s`.
fn log_information(u: f64, noise_deviation: f64) -> f64 {
    -u * u - log_cdf(u) - log_cdf(-u) - (TAU * noise_deviation * noise_deviation).ln()
}

/// Minimum over `rho >= 0`, `sum rho = N`, of `E[1 / sum_k rho_k I(X; t_k)]` with 401 thresholds over `+-(V + 2 s)`.
///
/// The problem is convex in `rho`. Whole numbers of sensors give larger values: they leave gaps between the thresholds, in which the bound
/// grows without limit as the noise vanishes.
///
/// ```text
/// rho_k <- N / K
/// repeat
///     M(x)  <- sum_k rho_k I_k(x);  phi <- E[1/M]
///     d_k   <- E[I_k / M^2]                       # minus the gradient
///     rho_k <- rho_k sqrt(N d_k / phi), rescaled to sum N
/// until max_k N d_k / phi - 1 < 3e-4              # duality gap
/// ```
///
/// # Errors
/// If there is no sensor or `noise_deviation` is not finite or below `1e-4` of the source's reach; [`Error::NotConverged`] if the gap is
/// not closed in 200000 updates.
pub fn multi_threshold_bound(source: &Source, noise_deviation: f64, sensors: usize) -> Result<MultiThreshold, Error> {
    optimum(source, noise_deviation, sensors, MAX_UPDATES)
}

fn optimum(
    source: &Source,
    noise_deviation: f64,
    sensors: usize,
    most_updates: usize,
) -> Result<MultiThreshold, Error> {
    let total = at_least_one("sensors", sensors)? as f64;
    let noise_deviation = source.resolvable(noise_deviation)?;
    let nodes = even_nodes(source, noise_deviation, gauss_legendre::<8>());
    let limit = source.reach() + MARGIN * noise_deviation;
    let thresholds: Vec<f64> = (0..THRESHOLDS)
        .map(|k| limit * (2.0 * k as f64 / (THRESHOLDS - 1) as f64 - 1.0))
        .collect();
    // A threshold has information about nearby points only; the rest of its row is left out.
    let spacing = thresholds[1] - thresholds[0];
    let band = (BAND * noise_deviation).max(4.0 * spacing);
    let rows: Vec<(usize, Vec<f64>)> = thresholds
        .iter()
        .map(|&t| {
            let first = nodes.points.partition_point(|&x| x < t - band);
            let last = nodes.points.partition_point(|&x| x <= t + band);
            let row = nodes.points[first..last]
                .iter()
                .map(|&x| log_information((x - t) / noise_deviation, noise_deviation).exp())
                .collect();
            (first, row)
        })
        .collect();
    let mut rho = vec![total / THRESHOLDS as f64; THRESHOLDS];
    let mut state = Objective::of(&rows, &rho, &nodes);
    for _ in 0..most_updates {
        if state.gap(total) < GAP {
            break;
        }
        let mut sum = 0.0;
        for (r, d) in rho.iter_mut().zip(&state.descent) {
            *r *= (total * d / state.value).sqrt();
            sum += *r;
        }
        rho.iter_mut().for_each(|r| *r *= total / sum);
        state = Objective::of(&rows, &rho, &nodes);
    }
    // A gap that is NaN (all information underflows) also fails.
    let gap = state.gap(total);
    if gap.is_nan() || gap >= GAP {
        return Err(Error::NotConverged {
            algorithm: "multiplicative updates of the thresholds",
            iterations: most_updates,
            change: gap,
        });
    }
    Ok(MultiThreshold {
        bound: state.value,
        gap,
        thresholds,
        sensors: rho,
    })
}

struct Objective {
    value: f64,
    descent: Vec<f64>,
}

impl Objective {
    fn of(rows: &[(usize, Vec<f64>)], rho: &[f64], nodes: &Nodes) -> Self {
        let mut information = vec![0.0; nodes.points.len()];
        for ((first, row), r) in rows.iter().zip(rho) {
            for (m, i) in information[*first..].iter_mut().zip(row) {
                *m += r * i;
            }
        }
        let mut value = 0.0;
        for (m, w) in information.iter_mut().zip(&nodes.weights) {
            value += w / *m;
            // From here on the slot contains w / M^2.
            *m = w / (*m * *m);
        }
        let descent = rows
            .iter()
            .map(|(first, row)| information[*first..].iter().zip(row).map(|(m, i)| m * i).sum())
            .collect();
        Self { value, descent }
    }

    fn gap(&self, total: f64) -> f64 {
        total * self.descent.iter().copied().fold(0.0, f64::max) / self.value - 1.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_optimum_scales_with_the_number_of_sensors() {
        let source = Source::uniform(1.0).unwrap();
        let ten = multi_threshold_bound(&source, 0.3, 10).unwrap();
        let twenty = multi_threshold_bound(&source, 0.3, 20).unwrap();
        assert!(ten.gap < GAP);
        assert_relative_eq!(ten.bound, 2.0 * twenty.bound, max_relative = 1e-9);
        assert_relative_eq!(ten.sensors.iter().sum::<f64>(), 10.0, max_relative = 1e-12);
    }

    #[test]
    fn in_much_noise_every_sensor_takes_the_middle() {
        let source = Source::uniform(1.0).unwrap();
        let found = multi_threshold_bound(&source, 20.0, 4).unwrap();
        assert_relative_eq!(found.bound, 400.0 * std::f64::consts::FRAC_PI_2 / 4.0, max_relative = 2e-3);
    }

    /// If the last update leaves a larger gap than allowed, the result is an error, not a bound.
    #[test]
    fn an_open_gap_is_an_error() {
        let stopped = optimum(&Source::uniform(1.0).unwrap(), 0.3, 10, 3);
        let Err(Error::NotConverged {
            iterations: 3, change, ..
        }) = stopped
        else {
            panic!("{stopped:?}");
        };
        assert!(change > GAP);
    }
}
