//! A sensor that sends at random, with a probability that keeps the belief Gaussian.

use fewbits_cfwmd::Error;
use fewbits_cfwmd::censored::mix;
use fewbits_core::factor::{Tilted, Value, add_mapped};
use fewbits_core::{Columns, Factor, Gaussian, Link, NumberFormat, Observation, Scheme, Sensing};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, positive};
use nalgebra::SVector;
use rand::{Rng, RngExt};
use serde::{Deserialize, Serialize};

/// Sends an innovation `nu` with probability `1 - exp(-nu^2 Y/2)` (Han and others 2015).
///
/// The probability of silence is a Gaussian function of the innovation. Silence therefore acts as a measurement `nu = 0` with noise
/// variance `r + 1/Y`, and over a perfect link the Kalman filter is exact. At equal rate the error is larger than with a deterministic
/// threshold whose silence is fused.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers")]
pub struct StochasticTrigger {
    precision: f64,
}

/// The stored form of [`StochasticTrigger`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    precision: f64,
}

impl TryFrom<Numbers> for StochasticTrigger {
    type Error = Error;

    fn try_from(parts: Numbers) -> Result<Self, Error> {
        StochasticTrigger::new(parts.precision)
    }
}

impl StochasticTrigger {
    /// The trigger with precision `Y > 0` (inverse measurement units squared).
    ///
    /// # Errors
    /// If the precision is not positive.
    pub fn new(precision: f64) -> Result<Self, Error> {
        Ok(Self {
            precision: positive("precision", precision)?,
        })
    }

    /// The trigger that sends innovations `N(0, s)` with probability `rate`: `Y = ((1 - rate)^-2 - 1)/s`.
    ///
    /// # Errors
    /// If the rate is outside `(0, 1)` or the variance not positive.
    pub fn for_rate(rate: f64, innovation_variance: f64) -> Result<Self, Error> {
        if !(rate > 0.0 && rate < 1.0) {
            return Err(ArgumentError::new("rate", rate, "a probability in (0, 1), both ends excluded").into());
        }
        positive("innovation_variance", innovation_variance)?;
        let silent = 1.0 - rate;
        Self::new(rate * (1.0 + silent) / (silent * silent) / innovation_variance)
    }

    /// Precision `Y`, in inverse measurement units squared.
    pub fn precision(&self) -> f64 {
        self.precision
    }

    /// Probability that a sensor with this innovation reports.
    pub fn probability(&self, innovation: f64) -> f64 {
        fewbits_node::trigger::probability(innovation, self.precision)
    }
}

/// A scalar sensor with a [`StochasticTrigger`]. It receives the predicted state of the fusion centre. Values are sent in double
/// precision.
#[derive(Debug, Clone, PartialEq)]
pub struct Triggered<S, const D: usize> {
    /// The sensor.
    pub sensing: S,
    /// Its trigger.
    pub trigger: StochasticTrigger,
}

/// Likelihood of a triggered sensor's report, silence or known loss. It contains `g(m) = exp(log_share) N(centre; m, variance)`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Bump {
    value: Value<1>,
    log_share: f64,
    kind: Kind,
}

#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// `floor + g(m)`: a report (floor 0), or nothing arrived (floor above 0 if the link loses reports).
    Above { floor: f64 },
    /// `scale (1 - g(m))`: a known loss. Here `g` is the probability of silence.
    Below { scale: f64 },
}

impl Bump {
    /// The logarithm of the likelihood at a point where `ln g` is `log_peak`.
    fn mixed(&self, log_peak: f64) -> f64 {
        match self.kind {
            Kind::Above { floor: 0.0 } => log_peak,
            Kind::Above { floor } => (floor + log_peak.exp()).ln(),
            Kind::Below { .. } if log_peak.is_nan() => log_peak,
            // Rounding may make `g` exceed 1 if the noise is negligible beside `1/Y`.
            Kind::Below { scale } => scale.ln() + (-log_peak.min(0.0).exp_m1()).ln(),
        }
    }
}

impl Factor<1> for Bump {
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.mixed(self.log_share + self.value.log_likelihood(m))
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        let add = |means: &Columns<'_, 1>, logs: &mut [f64]| self.value.add_log_likelihoods(means, logs);
        add_mapped(means, log_weights, add, |logs| match self.kind {
            Kind::Above { floor } => mix(floor, self.log_share, logs),
            Kind::Below { .. } => logs.iter_mut().for_each(|log| *log = self.mixed(self.log_share + *log)),
        });
    }

    /// Silence: a mixture of the prior (weight of the floor) and the Kalman update. A known loss: the prior minus the Kalman update.
    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        let inside = self.value.tilted(prior)?;
        let log_inside = self.log_share + inside.log_evidence;
        let log_evidence = self.mixed(log_inside);
        if log_evidence == f64::NEG_INFINITY {
            return Err(Error::Impossible);
        }
        let step = inside.mean - prior.mean();
        if let Kind::Below { .. } = self.kind {
            // E[d^2] = (V - w (C + step^2)) / (1 - w) about the prior's mean, with the difference V - C formed first.
            let (w, left) = (log_inside.exp(), -log_inside.exp_m1());
            let (variance, after) = (prior.covariance()[0], inside.covariance[0]);
            let shift = step * (-w / left);
            let removed = variance * variance / (variance + self.value.noise_covariance()[0]);
            let second = (removed - w * step[0] * step[0]) / left + after;
            let (mean, spread) = (prior.mean()[0] + shift[0], second - shift[0] * shift[0]);
            if !(mean.is_finite() && spread.is_finite()) {
                return Err(Error::NotANumber {
                    what: "the posterior of a known loss",
                });
            }
            return Ok(Tilted {
                log_evidence,
                mean: [mean].into(),
                covariance: [[spread.max(0.0)]].into(),
            });
        }
        if let Kind::Above { floor: 0.0 } = self.kind {
            return Ok(Tilted { log_evidence, ..inside });
        }
        let weight = (log_inside - log_evidence).exp();
        let mean = prior.mean() + step * weight;
        let spread = (prior.covariance() + step * step * weight) * (1.0 - weight) + inside.covariance * weight;
        if !(log_evidence.is_finite() && mean[0].is_finite() && spread[0].is_finite()) {
            return Err(Error::NotANumber {
                what: "the posterior of a silence",
            });
        }
        Ok(Tilted {
            log_evidence,
            mean,
            covariance: spread,
        })
    }
}

impl<const D: usize, S: Sensing<D, 1>> Scheme<1> for Triggered<S, D> {
    type State = ();
    /// The predicted state of the fusion centre.
    type Feedback = SVector<f64, D>;
    type Report = f64;
    type Factor = Bump;

    fn feedback_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn report_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn encode(
        &self,
        rng: &mut dyn Rng,
        (): &mut (),
        measurement: &SVector<f64, 1>,
        broadcast: &SVector<f64, D>,
    ) -> Result<Option<f64>, Error> {
        let (z, prediction) = (measurement[0], self.sensing.mean(broadcast)[0]);
        let speaks = fewbits_node::trigger::speaks(z, prediction, self.trigger.precision, rng.random());
        Ok(speaks.map_err(ArgumentError::from)?.then_some(z))
    }

    /// Silence: `s(m) = E exp(-(m + n - prediction)^2 Y/2) = sqrt(2 pi/Y) N(prediction; m, r + 1/Y)`. A known loss:
    /// `1 - s(m)`.
    fn factor(&self, broadcast: &SVector<f64, D>, observation: &Observation<f64>, link: &Link) -> Result<Bump, Error> {
        let (prediction, r) = (self.sensing.mean(broadcast)[0], self.sensing.noise_covariance_at(broadcast)[0]);
        finite("prediction", prediction)?;
        let y = self.trigger.precision;
        // The probability of silence is `exp(-y (z - prediction)^2 / 2)`: a Gaussian function without its normalisation.
        let log_scale = 0.5 * (std::f64::consts::TAU.ln() - y.ln());
        Ok(match observation {
            Observation::Received(z) => {
                fewbits_numerics::error::within("crossover", link.crossover(), 0.0, 0.0)?;
                Bump {
                    value: Value::scalar(*z, r)?,
                    log_share: link.of_received()?.ln() + self.trigger.probability(z - prediction).ln(),
                    kind: Kind::Above { floor: 0.0 },
                }
            }
            Observation::Nothing => Bump {
                value: Value::scalar(prediction, r + 1.0 / y)?,
                log_share: (-link.loss()).ln_1p() + log_scale,
                kind: Kind::Above { floor: link.loss() },
            },
            Observation::Lost => Bump {
                value: Value::scalar(prediction, r + 1.0 / y)?,
                log_share: log_scale,
                kind: Kind::Below {
                    scale: link.lost_given_sent(),
                },
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::StochasticTrigger;
    use fewbits_numerics::normal::log_pdf_with;
    use fewbits_numerics::quadrature::gauss_legendre;

    #[test]
    fn the_rate_is_met() {
        for (rate, s) in [(0.5, 3.8), (0.25, 3.8), (0.9, 0.1), (1e-6, 7.0)] {
            let trigger = StochasticTrigger::for_rate(rate, s).unwrap();
            let reach = 10.0 * f64::sqrt(s);
            let mean = gauss_legendre::<24>()
                .composite(-reach, reach, 40, |nu| log_pdf_with(nu, 0.0, s).exp() * trigger.probability(nu));
            assert!((mean / rate - 1.0).abs() < 1e-9, "{rate} {s}: {mean}");
        }
    }

    #[test]
    fn bad_rates_are_refused() {
        for rate in [0.0, 1.0, -0.1, f64::NAN] {
            assert!(StochasticTrigger::for_rate(rate, 1.0).is_err());
        }
        assert!(StochasticTrigger::for_rate(0.5, 0.0).is_err());
        assert!(StochasticTrigger::new(f64::INFINITY).is_err());
    }
}
