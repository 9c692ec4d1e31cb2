//! From a message budget to a censoring threshold.

use crate::Error;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::normal;
use statrs::function::gamma::{checked_gamma_ur, ln_gamma};

/// How often the network may speak: `messages` a step on average, from `sensors` sensors (the paper's `l` of `N`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Budget {
    messages: f64,
    sensors: usize,
}

impl Budget {
    /// A budget of `messages` in `(0, sensors]`.
    ///
    /// # Errors
    /// No sensor, or a budget outside the range.
    pub fn new(messages: f64, sensors: usize) -> Result<Self, Error> {
        at_least_one("sensors", sensors)?;
        if messages > 0.0 && messages <= sensors as f64 {
            Ok(Self { messages, sensors })
        } else {
            Err(ArgumentError::new("messages", messages, format!("a number in (0, {sensors}]")).into())
        }
    }

    /// Messages a step.
    pub fn messages(&self) -> f64 {
        self.messages
    }

    /// Number of sensors.
    pub fn sensors(&self) -> usize {
        self.sensors
    }

    /// Probability `l/N` that one sensor speaks.
    pub fn rate(&self) -> f64 {
        self.messages / self.sensors as f64
    }

    /// The threshold `eta` of a normalised innovation squared with `dimension` degrees of freedom.
    ///
    /// # Errors
    /// A dimension of zero.
    pub fn threshold(&self, dimension: usize) -> Result<f64, Error> {
        threshold(self.rate(), dimension)
    }
}

/// The `eta` that a chi-square variable of `dimension` degrees of freedom reaches with probability `rate`.
///
/// One degree: `(Phi^-1(rate/2))^2`. Two: `-2 ln rate`. More: Newton steps on the regularised incomplete gamma function.
///
/// # Errors
/// A rate outside `(0, 1]`, a dimension of zero.
pub fn threshold(rate: f64, dimension: usize) -> Result<f64, Error> {
    if !(rate > 0.0 && rate <= 1.0) {
        return Err(ArgumentError::new("rate", rate, "a probability in (0, 1]").into());
    }
    at_least_one("dimension", dimension)?;
    Ok(match dimension {
        _ if rate == 1.0 => 0.0,
        1 => normal::quantile(0.5 * rate).powi(2),
        2 => -2.0 * rate.ln(),
        _ => chi_square_upper_quantile(rate, dimension)?,
    })
}

/// Bracketing, then Newton steps on `ln P(chi^2 > x)` kept inside the bracket.
fn chi_square_upper_quantile(rate: f64, dimension: usize) -> Result<f64, Error> {
    let shape = 0.5 * dimension as f64;
    let upper = |x: f64| {
        checked_gamma_ur(shape, 0.5 * x).map_err(|e| ArgumentError::new("rate", rate, format!("a solvable rate ({e})")))
    };
    let log_density = |x: f64| (shape - 1.0) * (0.5 * x).ln() - 0.5 * x - ln_gamma(shape) - std::f64::consts::LN_2;
    let (mut low, mut high) = (0.0, dimension as f64);
    while upper(high)? > rate {
        low = high;
        high *= 2.0;
    }
    let mut x = 0.5 * (low + high);
    for _ in 0..200 {
        let p = upper(x)?;
        if p > rate {
            low = x
        } else {
            high = x
        }
        let step = x + (p.ln() - rate.ln()) * p / log_density(x).exp();
        let next = if step > low && step < high {
            step
        } else {
            0.5 * (low + high)
        };
        if (next - x).abs() <= 1e-15 * x {
            return Ok(next);
        }
        x = next;
    }
    Ok(x)
}

#[cfg(test)]
mod tests {
    use super::{Budget, threshold};
    use statrs::function::gamma::gamma_ur;

    #[test]
    fn every_dimension_inverts_the_upper_tail() {
        for dimension in 1..8 {
            for rate in [1e-9, 0.01, 0.25, 0.5, 0.9, 0.999_999] {
                let eta = threshold(rate, dimension).unwrap();
                let back = gamma_ur(0.5 * dimension as f64, 0.5 * eta);
                assert!((back / rate - 1.0).abs() < 1e-9, "{dimension} {rate}: {back}");
            }
        }
    }

    #[test]
    fn a_full_budget_sends_everything() {
        for dimension in 1..5 {
            assert_eq!(Budget::new(4.0, 4).unwrap().threshold(dimension).unwrap(), 0.0);
        }
    }

    #[test]
    fn budgets_outside_the_range_are_refused() {
        for messages in [0.0, -1.0, 4.01, f64::NAN, f64::INFINITY] {
            assert!(Budget::new(messages, 4).is_err());
        }
        assert!(Budget::new(1.0, 0).is_err());
        assert!(threshold(0.5, 0).is_err());
    }
}
