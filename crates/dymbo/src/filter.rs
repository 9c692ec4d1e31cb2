//! The Dymbo filter, and the closed loop of every scalar filter here.

use crate::plant::{filtered_variance, innovation_gain, scalar};
use crate::sign_bit::{self, SignBit};
use crate::{Error, ScalarPlant};
use fewbits_core::factor::Scalar;
use fewbits_core::{Gaussian, Link, Observation, Scheme, Sign};
use fewbits_numerics::normal::SQRT_2_OVER_PI;
use rand::Rng;
use serde::{Deserialize, Serialize};
use std::f64::consts::LN_2;

/// What a step reveals besides the new belief.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct StepInfo {
    /// Predicted mean and variance, before the observation.
    pub predicted: Gaussian<1>,
    /// Change of the estimate, in state units.
    pub correction: f64,
    /// `ln p(observation | past)`, the increment of the log-likelihood of the data.
    pub log_likelihood: f64,
    /// Variance reduction divided by that of the unquantized measurement. Negative if the observation raised the variance, as an
    /// unlikely bit from a noisy link may.
    pub information: f64,
    /// Number of bits received in this step.
    pub bits: u32,
}

/// A scalar filter that broadcasts its prediction, or what follows from it, and receives reports relative to it.
pub trait ScalarFilter {
    /// The sensor's scheme: how a sample becomes a report.
    type Scheme: Scheme<1, State = (), Factor = Scalar>;

    /// The plant.
    fn plant(&self) -> &ScalarPlant;

    /// The link's probabilities of loss and of inversion that the filter assumes.
    fn link(&self) -> &Link;

    /// The sensor's scheme, as the filter assumes it.
    fn scheme(&self) -> Self::Scheme;

    /// Mean fraction of a full measurement's information that a report brings when it arrives.
    fn information(&self) -> f64;

    /// What to broadcast, given a predicted belief.
    fn feedback(&self, predicted: &Gaussian<1>) -> <Self::Scheme as Scheme<1>>::Feedback;

    /// Corrects a predicted belief with the observation of a sensor that was sent [`feedback`](Self::feedback) of this belief. If
    /// several sensors report one after the other, call it once per sensor and compute the feedback anew for each.
    ///
    /// # Errors
    /// [`Error::Impossible`] if nothing arrived although the link loses nothing, or if the estimate overflows.
    fn update(
        &self,
        predicted: &Gaussian<1>,
        observation: &Observation<<Self::Scheme as Scheme<1>>::Report>,
    ) -> Result<(Gaussian<1>, StepInfo), Error>;

    /// The belief one slot later, before any observation.
    #[inline]
    fn predict(&self, belief: &Gaussian<1>) -> Gaussian<1> {
        self.plant().predict(belief)
    }

    /// One slot: predict, then correct with the observation. If sensor and centre both run the filter, both must know which reports were
    /// lost; otherwise their beliefs diverge.
    ///
    /// # Errors
    /// As [`ScalarFilter::update`].
    #[inline]
    fn step(
        &self,
        belief: &Gaussian<1>,
        observation: &Observation<<Self::Scheme as Scheme<1>>::Report>,
    ) -> Result<(Gaussian<1>, StepInfo), Error> {
        self.update(&self.predict(belief), observation)
    }

    /// One slot of the closed loop, sensor and link included: predict, broadcast, encode the `measurement`, send the report
    /// through the link, correct with what arrives.
    ///
    /// # Errors
    /// If the measurement is not finite; as [`ScalarFilter::update`].
    fn exchange<R: Rng>(
        &self,
        rng: &mut R,
        belief: &Gaussian<1>,
        measurement: f64,
    ) -> Result<(Gaussian<1>, StepInfo), Error> {
        let (predicted, scheme) = (self.predict(belief), self.scheme());
        let report = scheme.encode(rng, &mut (), &[measurement].into(), &self.feedback(&predicted))?;
        let observation = self.link().transmit(rng, report.as_ref(), &scheme.report_format())?;
        self.update(&predicted, &observation)
    }
}

/// The fusion centre's filter for one sign bit per sample.
///
/// ```text
/// predict   mean = a mean,  P = a^2 P + sigma_u^2
/// broadcast threshold = mean
/// receive   b = +1 if the sample reached the threshold, else -1 (lost: keep the prediction)
/// correct   mean = mean + b sqrt(2/pi) P/sqrt(P + sigma^2)
///           P = P (sigma^2 + (1 - 2/pi) P)/(P + sigma^2)
/// ```
///
/// It is the assumed-density filter of a [`SignBit`] with the threshold at the prediction, in closed form. The variance does not
/// depend on the bits. The square of the correction equals the variance that the bit removes. Over a link of crossover `eps` the
/// correction is multiplied by `1 - 2 eps`, and the removed variance by its square.
///
/// ```
/// use fewbits_core::{Gaussian, Observation, Sign};
/// use fewbits_dymbo::{DymboFilter, ScalarFilter, ScalarPlant};
/// let filter = DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0)?);
/// let mut belief = Gaussian::scalar(0.0, 2.6)?;
/// for sample in [1.2, 0.8, 1.9] {
///     let bit = Sign::of(sample, filter.threshold(&belief))?;
///     belief = filter.step(&belief, &Observation::Received(bit))?.0;
/// }
/// assert!(belief.mean()[0] > 0.5 && belief.covariance()[0] < 1.0);
/// # Ok::<(), fewbits_dymbo::Error>(())
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DymboFilter {
    plant: ScalarPlant,
    link: Link,
}

impl DymboFilter {
    /// The filter for a plant and a perfect link.
    pub fn new(plant: ScalarPlant) -> Self {
        Self {
            plant,
            link: Link::PERFECT,
        }
    }

    /// The same filter for a link with loss or crossover.
    #[must_use]
    pub fn with_link(self, link: Link) -> Self {
        Self { link, ..self }
    }

    /// The threshold to broadcast for the next sample, given the present filtered belief: the predicted mean.
    #[inline]
    pub fn threshold(&self, belief: &Gaussian<1>) -> f64 {
        self.plant.coefficient() * belief.mean()[0]
    }

    #[inline]
    fn gain(&self, predicted_variance: f64) -> f64 {
        let clean = 1.0 - 2.0 * self.link.crossover();
        SQRT_2_OVER_PI * clean * innovation_gain(predicted_variance, self.plant.measurement_variance())
    }
}

impl ScalarFilter for DymboFilter {
    type Scheme = SignBit;

    fn plant(&self) -> &ScalarPlant {
        &self.plant
    }

    fn link(&self) -> &Link {
        &self.link
    }

    fn scheme(&self) -> SignBit {
        SignBit::of(&self.plant)
    }

    fn information(&self) -> f64 {
        sign_bit::information(&self.link)
    }

    #[inline]
    fn feedback(&self, predicted: &Gaussian<1>) -> f64 {
        predicted.mean()[0]
    }

    #[inline]
    fn update(
        &self,
        predicted: &Gaussian<1>,
        observation: &Observation<Sign>,
    ) -> Result<(Gaussian<1>, StepInfo), Error> {
        let Observation::Received(bit) = observation else {
            return without_report(predicted, observation, &self.link);
        };
        let p = predicted.covariance()[0];
        // With the threshold at the prediction both bits have probability 1/2, for any crossover.
        let log_likelihood = -LN_2 + self.link.of_received()?.ln();
        let info = StepInfo {
            predicted: *predicted,
            correction: bit.value() * self.gain(p),
            information: self.information(),
            log_likelihood,
            bits: 1,
        };
        info.corrected(filtered_variance(p, self.plant.measurement_variance(), self.information()))
    }
}

impl StepInfo {
    /// The belief with this correction and variance; impossible if a number is not finite.
    #[inline]
    pub(crate) fn corrected(self, variance: f64) -> Result<(Gaussian<1>, Self), Error> {
        let mean = self.predicted.mean()[0] + self.correction;
        if !(mean.is_finite() && variance.is_finite() && self.log_likelihood.is_finite()) {
            return Err(Error::Impossible);
        }
        Ok((scalar(mean, variance), self))
    }
}

/// The result of an observation without a report (lost or nothing): the prediction, and the probability that nothing arrived.
pub(crate) fn without_report<R>(
    predicted: &Gaussian<1>,
    observation: &Observation<R>,
    link: &Link,
) -> Result<(Gaussian<1>, StepInfo), Error> {
    let info = StepInfo {
        predicted: *predicted,
        correction: 0.0,
        information: 0.0,
        log_likelihood: link.delivery(observation).ln(),
        bits: 0,
    };
    info.corrected(predicted.covariance()[0])
}

#[cfg(test)]
mod tests {
    use super::{DymboFilter, ScalarFilter};
    use crate::{Error, ScalarPlant};
    use fewbits_core::{Gaussian, Link, Observation, Scheme, Sign};
    use fewbits_filters::assumed_density;
    use fewbits_monte_carlo::Stream;
    use nalgebra::Matrix1;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_closed_form_is_the_assumed_density_update(
            a in -1.0..1.0_f64, q in 0.0..3.0_f64, r in 0.1..3.0_f64, m in 0.0..5.0_f64, eps in 0.0..0.5_f64,
            loss in 0.0..0.9_f64, above in any::<bool>(), scale in prop::sample::select(vec![1e-4, 1.0, 1e4]),
        ) {
            let unit = scale * scale;
            let link = Link::new(loss, eps).unwrap();
            let filter = DymboFilter::new(ScalarPlant::new(a, q * unit, r * unit).unwrap()).with_link(link);
            let bit = Observation::Received(if above { Sign::Above } else { Sign::Below });
            let belief = Gaussian::scalar(0.7 * scale, m * unit).unwrap();
            let (posterior, info) = filter.step(&belief, &bit).unwrap();
            let predicted = info.predicted;
            let factor = filter.scheme().factor(&filter.threshold(&belief), &bit, &link).unwrap();
            let (general, seen) = assumed_density::update(&predicted, &Matrix1::identity(), &factor).unwrap();
            prop_assert!((posterior.mean()[0] - general.mean()[0]).abs() < 1e-13 * scale);
            prop_assert!((posterior.covariance()[0] - general.covariance()[0]).abs() < 1e-13 * unit);
            prop_assert!((info.log_likelihood - seen.log_likelihood).abs() < 1e-12);
            // The squared correction is the variance removed.
            let removed = predicted.covariance()[0] - posterior.covariance()[0];
            prop_assert!((info.correction * info.correction - removed).abs() < 1e-12 * unit);
            // A bit brings something, and less than the measurement would.
            let (p, r) = (predicted.covariance()[0], r * unit);
            prop_assert!(posterior.covariance()[0] <= p);
            prop_assert!(posterior.covariance()[0] >= p * r / (p + r) * (1.0 - 1e-12));
        }
    }

    #[test]
    fn what_does_not_arrive_leaves_the_prediction() {
        let filter = DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0).unwrap());
        let lossy = filter.with_link(Link::lossy(0.25).unwrap());
        let belief = Gaussian::scalar(1.0, 1.0).unwrap();
        for (filter, observation, log_likelihood) in [
            (filter, Observation::Lost, 0.0),
            (lossy, Observation::Lost, 0.0),
            (lossy, Observation::Nothing, 0.25_f64.ln()),
        ] {
            let (posterior, info) = filter.step(&belief, &observation).unwrap();
            assert_eq!((posterior, info.bits, info.information), (filter.predict(&belief), 0, 0.0));
            assert_eq!(info.log_likelihood, log_likelihood);
        }
        // Nothing cannot come out of a link that loses nothing.
        assert_eq!(filter.step(&belief, &Observation::Nothing), Err(Error::Impossible));
    }

    #[test]
    fn edges() {
        let above = Observation::Received(Sign::Above);
        // Nothing to learn: the estimate never moves.
        let still = DymboFilter::new(ScalarPlant::new(1.0, 0.0, 1.0).unwrap());
        let known = Gaussian::scalar(2.0, 0.0).unwrap();
        assert_eq!(still.step(&known, &above).unwrap().0, known);
        // Half of all bits inverted: the same.
        let useless =
            DymboFilter::new(ScalarPlant::new(0.5, 1.0, 1.0).unwrap()).with_link(Link::flipping(0.5).unwrap());
        let belief = Gaussian::scalar(2.0, 1.0).unwrap();
        assert_eq!(useless.step(&belief, &above).unwrap().0, useless.predict(&belief));
        let huge = Gaussian::scalar(f64::MAX, f64::MAX).unwrap();
        let plant = ScalarPlant::new_unstable(2.0, 1.0, 1.0).unwrap();
        assert_eq!(DymboFilter::new(plant).step(&huge, &above), Err(Error::Impossible));
        // At a = 1 the steady step is sigma_u.
        let walk = DymboFilter::new(ScalarPlant::new(1.0, 0.49, 1.7).unwrap());
        let steady = walk.plant().steady_state(walk.information()).unwrap().filtered_variance;
        let (_, info) = walk.step(&Gaussian::scalar(0.0, steady).unwrap(), &above).unwrap();
        assert!((info.correction - 0.7).abs() < 1e-14);
    }

    #[test]
    fn the_loop_is_encode_transmit_and_step() {
        let link = Link::new(0.3, 0.1).unwrap();
        let filter = DymboFilter::new(ScalarPlant::new(0.9, 0.5, 1.0).unwrap()).with_link(link);
        let belief = Gaussian::scalar(1.0, 1.0).unwrap();
        let (mut rng, mut twin) = (Stream::new(1).rng(), Stream::new(1).rng());
        for measurement in [0.2, 3.0, -1.0, 1.4, 0.8, 2.2] {
            let bit = Sign::of(measurement, filter.threshold(&belief)).unwrap();
            let observation = link.transmit(&mut twin, Some(&bit), &()).unwrap();
            let by_hand = filter.step(&belief, &observation);
            assert_eq!(filter.exchange(&mut rng, &belief, measurement), by_hand);
        }
        assert!(filter.exchange(&mut rng, &belief, f64::NAN).is_err());
        let json = serde_json::to_string(&filter).unwrap();
        assert_eq!(serde_json::from_str::<DymboFilter>(&json).unwrap(), filter);
    }
}
