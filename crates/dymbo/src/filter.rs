//! The Dymbo filter: one sign bit a sample.

use crate::plant::scalar;
use crate::update::{UpdateInfo, bit_update};
use crate::{Error, Initialisation, ScalarPlant};
use fewbits_core::{Gaussian, Observation, Sign};
use fewbits_numerics::error::within;
use fewbits_numerics::normal::SQRT_2_OVER_PI;
use std::f64::consts::{FRAC_2_PI, LN_2};

/// Where the sensor's threshold stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum ThresholdRule {
    /// At the prediction `a theta_hat(n-1)`, as the paper's text and propositions need it.
    #[default]
    Prediction,
    /// At the previous estimate `theta_hat(n-1)`, as equation (14) prints it (erratum E1); the update stays exact. For
    /// comparison only: at `a = -0.9` it costs 78 % of the mean squared error.
    PreviousEstimate,
}

/// What a step reveals besides the new belief.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StepInfo {
    /// Predicted mean and variance, before the message.
    pub predicted: Gaussian<1>,
    /// Correction of the estimate.
    pub correction: f64,
    /// What the message brought; `None` if it was lost.
    pub update: Option<UpdateInfo>,
    /// Bits received.
    pub bits: u32,
}

/// The filter at the fusion centre.
///
/// ```text
/// predict   mean = a mean,  P = a^2 P + sigma_u^2
/// broadcast threshold = mean
/// hear      b = +1 if the sample reached the threshold, else -1 (lost: keep the prediction)
/// correct   mean = mean + b sqrt(2/pi) P/sqrt(P + sigma^2)
///           P = P (sigma^2 + (1 - 2/pi) P)/(P + sigma^2)
/// ```
///
/// The variance does not depend on the data. The correction has the same size for both bits: its square is the variance
/// that the bit removed, at every step.
///
/// ```
/// use fewbits_core::{Encoder, Gaussian, Observation};
/// use fewbits_dymbo::{DymboFilter, OneBitSensor, ScalarPlant};
/// let filter = DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0)?);
/// let mut belief = Gaussian::scalar(0.0, 2.6)?;
/// for sample in [1.2, 0.8, 1.9] {
///     let bit = OneBitSensor.encode(&sample, &filter.threshold(&belief));
///     belief = filter.step(&belief, Observation::Received(bit))?.0;
/// }
/// assert!(belief.mean()[0] > 0.5 && belief.covariance()[0] < 1.0);
/// # Ok::<(), fewbits_dymbo::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DymboFilter {
    plant: ScalarPlant,
    crossover: f64,
    rule: ThresholdRule,
}

impl DymboFilter {
    /// The filter for a plant and a clean link, with the threshold at the prediction.
    pub fn new(plant: ScalarPlant) -> Self {
        Self {
            plant,
            crossover: 0.0,
            rule: ThresholdRule::Prediction,
        }
    }

    /// The same for a link that inverts a bit with known probability `crossover` in `[0, 1/2]`.
    ///
    /// # Errors
    /// Any other probability.
    pub fn with_crossover(self, crossover: f64) -> Result<Self, Error> {
        Ok(Self {
            crossover: within("crossover", crossover, 0.0, 0.5)?,
            ..self
        })
    }

    /// The same with another threshold.
    #[must_use]
    pub fn with_threshold_rule(self, rule: ThresholdRule) -> Self {
        Self { rule, ..self }
    }

    /// The plant.
    pub fn plant(&self) -> &ScalarPlant {
        &self.plant
    }

    /// Fraction of a full measurement's information that a bit at the prediction brings: `(2/pi)(1 - 2 eps)^2`.
    pub fn information(&self) -> f64 {
        let clean = 1.0 - 2.0 * self.crossover;
        FRAC_2_PI * clean * clean
    }

    /// The belief to start from.
    ///
    /// # Errors
    /// As [`Initialisation::belief`].
    pub fn init(&self, start: &Initialisation) -> Result<Gaussian<1>, Error> {
        start.belief(&self.plant)
    }

    /// The threshold to broadcast for the next sample, given the present belief.
    #[inline]
    pub fn threshold(&self, belief: &Gaussian<1>) -> f64 {
        match self.rule {
            ThresholdRule::Prediction => self.plant.coefficient() * belief.mean()[0],
            ThresholdRule::PreviousEstimate => belief.mean()[0],
        }
    }

    /// Time update.
    #[inline]
    pub fn predict(&self, belief: &Gaussian<1>) -> Gaussian<1> {
        self.plant.predict(belief)
    }

    /// Corrects a predicted belief with a bit whose threshold was its mean. Call it once a sensor, the threshold refreshed
    /// each time, where several sensors speak in one slot.
    #[inline]
    pub fn update(&self, predicted: &Gaussian<1>, bit: Sign) -> (Gaussian<1>, UpdateInfo) {
        let p = predicted.covariance()[0];
        let clean = 1.0 - 2.0 * self.crossover;
        let information = FRAC_2_PI * clean * clean;
        let gain = SQRT_2_OVER_PI * clean * self.plant.innovation_gain(p);
        let mean = predicted.mean()[0] + bit.value() * gain;
        let belief = scalar(mean, self.plant.filtered_variance(p, information));
        // Both bits are equally likely at the prediction, whatever the crossover.
        let info = UpdateInfo {
            log_likelihood: -LN_2,
            information,
        };
        (belief, info)
    }

    /// One slot: predict, then correct with the bit, unless it was lost. A sensor of this scheme always speaks, so silence
    /// is read as loss; both ends must know of it, or their thresholds drift apart.
    ///
    /// # Errors
    /// [`Error::ImpossibleMessage`] if the estimate overflows.
    #[inline]
    pub fn step(&self, belief: &Gaussian<1>, heard: Observation<Sign>) -> Result<(Gaussian<1>, StepInfo), Error> {
        let predicted = self.predict(belief);
        let Observation::Received(bit) = heard else {
            return Ok((
                predicted,
                StepInfo {
                    predicted,
                    correction: 0.0,
                    update: None,
                    bits: 0,
                },
            ));
        };
        let (posterior, info) = match self.rule {
            ThresholdRule::Prediction => self.update(&predicted, bit),
            ThresholdRule::PreviousEstimate => {
                let r = self.plant.measurement_variance();
                bit_update(&predicted, r, bit, self.threshold(belief), self.crossover)?
            }
        };
        if !(posterior.mean()[0].is_finite() && posterior.covariance()[0].is_finite()) {
            return Err(Error::ImpossibleMessage);
        }
        let correction = posterior.mean()[0] - predicted.mean()[0];
        Ok((
            posterior,
            StepInfo {
                predicted,
                correction,
                update: Some(info),
                bits: 1,
            },
        ))
    }
}

#[cfg(test)]
mod tests {
    use super::{DymboFilter, ThresholdRule};
    use crate::{Error, ScalarPlant, bit_update};
    use fewbits_core::{Gaussian, Observation, Sign};
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_closed_form_is_the_general_update_at_the_prediction(
            a in -1.0..1.0_f64, q in 0.0..3.0_f64, r in 0.1..3.0_f64, m in 0.0..5.0_f64, eps in 0.0..0.5_f64, above in any::<bool>(),
        ) {
            let plant = ScalarPlant::new(a, q, r).unwrap();
            let filter = DymboFilter::new(plant).with_crossover(eps).unwrap();
            let bit = if above { Sign::Above } else { Sign::Below };
            let belief = Gaussian::scalar(0.7, m).unwrap();
            let (posterior, info) = filter.step(&belief, Observation::Received(bit)).unwrap();
            let predicted = info.predicted;
            let (general, _) = bit_update(&predicted, r, bit, filter.threshold(&belief), eps).unwrap();
            prop_assert!((posterior.mean()[0] - general.mean()[0]).abs() < 1e-13);
            prop_assert!((posterior.covariance()[0] - general.covariance()[0]).abs() < 1e-13);
            // The squared correction is the variance removed.
            let removed = predicted.covariance()[0] - posterior.covariance()[0];
            prop_assert!((info.correction * info.correction - removed).abs() < 1e-12);
            // A bit brings something, and less than the measurement would.
            let p = predicted.covariance()[0];
            prop_assert!(posterior.covariance()[0] <= p);
            prop_assert!(posterior.covariance()[0] >= p * r / (p + r) * (1.0 - 1e-12));
        }
    }

    #[test]
    fn lost_bits_leave_the_prediction() {
        let filter = DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0).unwrap());
        let belief = Gaussian::scalar(1.0, 1.0).unwrap();
        for heard in [Observation::Lost, Observation::Silent] {
            let (posterior, info) = filter.step(&belief, heard).unwrap();
            assert_eq!((posterior, info.bits, info.update), (filter.predict(&belief), 0, None));
        }
    }

    #[test]
    fn edges() {
        // Nothing to learn: the estimate never moves.
        let still = DymboFilter::new(ScalarPlant::new(1.0, 0.0, 1.0).unwrap());
        let known = Gaussian::scalar(2.0, 0.0).unwrap();
        assert_eq!(still.step(&known, Observation::Received(Sign::Above)).unwrap().0, known);
        // Half of all bits inverted: the same.
        let deaf = DymboFilter::new(ScalarPlant::new(0.5, 1.0, 1.0).unwrap())
            .with_crossover(0.5)
            .unwrap();
        let belief = Gaussian::scalar(2.0, 1.0).unwrap();
        assert_eq!(deaf.step(&belief, Observation::Received(Sign::Above)).unwrap().0, deaf.predict(&belief));
        assert!(deaf.with_crossover(0.51).is_err());
        let huge = Gaussian::scalar(f64::MAX, f64::MAX).unwrap();
        let plant = ScalarPlant::new_unstable(2.0, 1.0, 1.0).unwrap();
        let overflow = DymboFilter::new(plant).step(&huge, Observation::Received(Sign::Above));
        assert_eq!(overflow, Err(Error::ImpossibleMessage));
    }

    #[test]
    fn the_previous_estimate_is_another_threshold() {
        let filter = DymboFilter::new(ScalarPlant::new(0.5, 0.5, 1.0).unwrap());
        let literal = filter.with_threshold_rule(ThresholdRule::PreviousEstimate);
        let belief = Gaussian::scalar(2.0, 1.0).unwrap();
        assert_eq!((filter.threshold(&belief), literal.threshold(&belief)), (1.0, 2.0));
        let (posterior, info) = literal.step(&belief, Observation::Received(Sign::Above)).unwrap();
        let expected = bit_update(&info.predicted, 1.0, Sign::Above, 2.0, 0.0).unwrap().0;
        assert_eq!(posterior, expected);
    }
}
