//! From a message budget to a censoring threshold.

use crate::Error;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::{newton, normal};
use serde::{Deserialize, Serialize};

/// How many reports the network may send: `messages` per step on average, from `sensors` sensors (the paper's `l` of `N`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers")]
pub struct Budget {
    messages: f64,
    sensors: usize,
}

/// The stored form of [`Budget`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    messages: f64,
    sensors: usize,
}

impl TryFrom<Numbers> for Budget {
    type Error = Error;

    fn try_from(parts: Numbers) -> Result<Self, Error> {
        Budget::new(parts.messages, parts.sensors)
    }
}

impl Budget {
    /// A budget of `messages` in `(0, sensors]`.
    ///
    /// # Errors
    /// If `sensors` is zero, or `messages` is outside `(0, sensors]`.
    pub fn new(messages: f64, sensors: usize) -> Result<Self, Error> {
        at_least_one("sensors", sensors)?;
        if messages > 0.0 && messages <= sensors as f64 {
            Ok(Self { messages, sensors })
        } else {
            Err(ArgumentError::new("messages", messages, format!("a number in (0, {sensors}]")).into())
        }
    }

    /// Probability `l/N` that one sensor reports.
    pub fn rate(&self) -> f64 {
        self.messages / self.sensors as f64
    }

    /// The threshold `eta` on a normalised innovation squared of `dimension` components that meets the budget.
    ///
    /// # Errors
    /// If `dimension` is zero.
    pub fn threshold(&self, dimension: usize) -> Result<f64, Error> {
        threshold(self.rate(), dimension)
    }
}

/// The `eta` that a chi-square variable of `dimension` degrees of freedom exceeds with probability `rate`.
///
/// One degree: `(Phi^-1(rate/2))^2`. Two: `-2 ln rate`. More: Newton's method on the upper tail of the chi-square law.
///
/// # Errors
/// If `rate` is outside `(0, 1]` or `dimension` is zero.
pub fn threshold(rate: f64, dimension: usize) -> Result<f64, Error> {
    if !(rate > 0.0 && rate <= 1.0) {
        return Err(ArgumentError::new("rate", rate, "a probability in (0, 1]").into());
    }
    at_least_one("dimension", dimension)?;
    Ok(match dimension {
        _ if rate == 1.0 => 0.0,
        1 => normal::quantile(0.5 * rate).powi(2),
        2 => -2.0 * rate.ln(),
        _ => chi_square_upper_quantile(rate, dimension),
    })
}

/// `P(chi^2 > x)` and the density, at `x > 0`. The probability is a finite sum of positive terms:
///
/// `P(n + 2 degrees) = P(n degrees) + (x/2)^(n/2) exp(-x/2) / Gamma(n/2 + 1)`, from `2 Phi(-sqrt x)` at one degree and
/// `exp(-x/2)` at two.
fn chi_square_upper_tail(x: f64, dimension: usize) -> (f64, f64) {
    let half = 0.5 * x;
    // Start at one or two degrees of freedom; each step adds two.
    let (mut tail, mut density, mut degrees) = if dimension % 2 == 1 {
        (2.0 * normal::cdf(-x.sqrt()), normal::pdf(x.sqrt()) / x.sqrt(), 1)
    } else {
        ((-half).exp(), 0.5 * (-half).exp(), 2)
    };
    while degrees < dimension {
        density *= x / degrees as f64;
        tail += 2.0 * density;
        degrees += 2;
    }
    (tail, density)
}

/// The root of `ln P(chi^2 > x) - ln rate` in `x`.
fn chi_square_upper_quantile(rate: f64, dimension: usize) -> f64 {
    // The logarithm of the tail is concave in `x`, so Newton's method on it converges from any start inside the bracket.
    let mut high = dimension as f64;
    while chi_square_upper_tail(high, dimension).0 > rate {
        high *= 2.0;
    }
    let excess = |x: f64| {
        let (tail, density) = chi_square_upper_tail(x, dimension);
        (rate.ln() - tail.ln(), density / tail)
    };
    newton::increasing(excess, 0.0, high, 0.5 * high, 1e-15 * high)
}

#[cfg(test)]
mod tests {
    use super::{Budget, threshold};
    use statrs::function::gamma::gamma_ur;

    #[test]
    fn every_dimension_inverts_the_upper_tail() {
        for dimension in (1..8).chain([33, 80]) {
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
        let budget = Budget::new(1.5, 4).unwrap();
        assert_eq!(budget.rate(), 0.375);
        for messages in [0.0, -1.0, 4.01, f64::NAN, f64::INFINITY] {
            assert!(Budget::new(messages, 4).is_err());
        }
        assert!(Budget::new(1.0, 0).is_err());
        assert!(serde_json::from_str::<Budget>(r#"{"messages":5.0,"sensors":4}"#).is_err());
        assert!(threshold(0.5, 0).is_err());
    }
}
