//! Probability of each message as a function of the prediction error, and the filter's correction for it.

use crate::plant::{filtered_variance, innovation_gain, scalar};
use crate::sign_bit::SignBit;
use crate::{CellIndex, DymboFilter, Error, MultibitFilter, ParallelFilter, ScalarFilter, ScalarPlant};
use fewbits_core::factor::{Factor, Product};
use fewbits_core::{Link, Observation, Scheme, Sign};
use fewbits_numerics::binomial::log_row;
use fewbits_numerics::error::within;
use fewbits_numerics::normal::SQRT_2_OVER_PI;
use std::f64::consts::FRAC_2_PI;

/// All messages that one slot can bring at one predicted variance. Each has its likelihood as a function of the prediction error and
/// the filter's correction, in state units.
#[derive(Debug, Clone, PartialEq)]
pub struct MessageLaw {
    corrections: Vec<f64>,
    /// Per entry: the logarithm of the number of messages that it stands for, and the likelihood that they share.
    factors: Vec<(f64, Product)>,
}

/// Largest number of sensors whose bit strings are enumerated: `2^12 = 4096` strings.
const MAX_SEQUENCE: usize = 12;

const BITS: [Sign; 2] = [Sign::Below, Sign::Above];

impl MessageLaw {
    /// One sign bit. It crosses the link `actual`; the filter corrects as its own link says. Every bit arrives.
    ///
    /// # Errors
    /// If the correction is not finite.
    pub fn bit(filter: &DymboFilter, predicted_variance: f64, actual: &Link) -> Result<Self, Error> {
        let predicted = scalar(0.0, predicted_variance);
        Self::of(filter, &predicted, &BITS, actual)
    }

    /// A word of several bits over the filter's own link.
    ///
    /// # Errors
    /// If the correction is not finite.
    pub fn word(filter: &MultibitFilter, predicted_variance: f64) -> Result<Self, Error> {
        let words: Vec<CellIndex> = (0..filter.levels().len() as u16).map(CellIndex).collect();
        Self::of(filter, &scalar(0.0, predicted_variance), &words, filter.link())
    }

    /// The law of one report: one entry for each of `reports`, which are all that can be received.
    fn of<F: ScalarFilter>(
        filter: &F,
        predicted: &fewbits_core::Gaussian<1>,
        reports: &[<F::Scheme as Scheme<1>>::Report],
        actual: &Link,
    ) -> Result<Self, Error>
    where
        <F::Scheme as Scheme<1>>::Report: Copy,
    {
        let (scheme, feedback) = (filter.scheme(), filter.feedback(predicted));
        let arriving = Link::flipping(actual.crossover())?;
        let mut law = Self::empty();
        for observation in reports.iter().map(|report| Observation::Received(*report)) {
            let factor = scheme.factor(&feedback, &observation, &arriving)?;
            law.corrections
                .push(filter.update(predicted, &observation)?.1.correction);
            law.factors.push((0.0, Product::from_iter([factor])));
        }
        Ok(law)
    }

    /// The number of `+1` among several sensors that answer the same threshold at once.
    ///
    /// # Errors
    /// Never for a filter that its constructors made.
    pub(crate) fn count(filter: &ParallelFilter, predicted_variance: f64) -> Result<Self, Error> {
        let (sensors, arriving) = (filter.sensors(), Link::flipping(filter.link().crossover())?);
        let scheme = SignBit::of(filter.plant());
        let factor = |bit: Sign| scheme.factor(&0.0, &Observation::Received(bit), &arriving);
        let (above, below) = (factor(Sign::Above)?, factor(Sign::Below)?);
        let mut law = Self::empty();
        law.corrections = filter.table(predicted_variance).0;
        // All strings with `up` bits of `+1` have the same likelihood: one entry stands for `sensors` choose `up` of them.
        for (up, log_choose) in log_row(sensors).into_iter().enumerate() {
            let bits = (0..sensors).map(|i| if i < up { above.clone() } else { below.clone() });
            law.factors.push((log_choose, bits.collect()));
        }
        Ok(law)
    }

    /// The bits of several sensors that answer one after the other. The threshold is refreshed after each bit.
    ///
    /// # Errors
    /// If `sensors` is zero or above 12: the number of bit strings doubles with each sensor.
    pub(crate) fn sequence(plant: &ScalarPlant, predicted_variance: f64, sensors: usize) -> Result<Self, Error> {
        within("sensors", sensors as f64, 1.0, MAX_SEQUENCE as f64)?;
        let (scheme, r) = (SignBit::of(plant), plant.measurement_variance());
        let mut law = Self::empty();
        (law.corrections, law.factors) = (vec![0.0], vec![(0.0, Product::default())]);
        let mut p = predicted_variance;
        for _ in 0..sensors {
            let gain = SQRT_2_OVER_PI * innovation_gain(p, r);
            p = filtered_variance(p, r, FRAC_2_PI);
            let mut longer = Self::empty();
            for (threshold, (_, string)) in law.corrections.iter().zip(&law.factors) {
                // Each string of bits branches in two. The next sensor compares with the estimate that the string has led to.
                for bit in BITS {
                    let mut string = string.clone();
                    string.push(scheme.factor(threshold, &Observation::Received(bit), &Link::PERFECT)?);
                    longer.corrections.push(threshold + bit.value() * gain);
                    longer.factors.push((0.0, string));
                }
            }
            law = longer;
        }
        Ok(law)
    }

    fn empty() -> Self {
        Self {
            corrections: Vec::new(),
            factors: Vec::new(),
        }
    }

    /// The filter's correction for each message, in state units.
    pub(crate) fn corrections(&self) -> &[f64] {
        &self.corrections
    }

    /// Probability and correction of every message when the prediction error is `error`.
    pub(crate) fn messages(&self, error: f64) -> impl Iterator<Item = (f64, f64)> + '_ {
        let probability = move |(log, factor): &(f64, Product)| (log + factor.log_likelihood(&[error].into())).exp();
        self.factors
            .iter()
            .map(probability)
            .zip(self.corrections.iter().copied())
    }
}

#[cfg(test)]
mod tests {
    use super::MessageLaw;
    use crate::{CountFusion, DymboFilter, MultibitFilter, ParallelFilter, ScalarPlant};
    use fewbits_core::Link;
    use fewbits_numerics::normal::{cdf, interval};

    fn plant() -> ScalarPlant {
        ScalarPlant::new(0.9, 0.5, 1.0).unwrap()
    }

    fn probabilities(law: &MessageLaw, error: f64) -> Vec<f64> {
        law.messages(error).map(|(probability, _)| probability).collect()
    }

    #[test]
    fn messages_are_a_distribution() {
        let flipping = Link::flipping(0.2).unwrap();
        let counts = ParallelFilter::new(plant(), 4, CountFusion::Exact)
            .unwrap()
            .with_link(flipping);
        let words = MultibitFilter::new(plant(), 3).unwrap();
        let laws = [
            MessageLaw::bit(&DymboFilter::new(plant()), 1.1, &flipping).unwrap(),
            MessageLaw::word(&words, 1.1).unwrap(),
            MessageLaw::word(&words.with_link(flipping), 1.1).unwrap(),
            MessageLaw::count(&counts, 1.1).unwrap(),
            MessageLaw::sequence(&plant(), 1.1, 4).unwrap(),
        ];
        for law in laws {
            for error in [-3.0, 0.2, 7.0] {
                assert!((probabilities(&law, error).iter().sum::<f64>() - 1.0).abs() < 1e-12);
            }
        }
        assert!(MessageLaw::sequence(&plant(), 1.0, 13).is_err() && MessageLaw::sequence(&plant(), 1.0, 0).is_err());
    }

    /// Each probability by its own formula, for measurement variance 1.
    #[test]
    fn messages_have_their_probabilities() {
        let close = |found: &[f64], expected: &[f64]| {
            assert_eq!(found.len(), expected.len());
            assert!(found.iter().zip(expected).all(|(f, e)| (f - e).abs() < 1e-14), "{found:?} {expected:?}");
        };
        for e in [-2.0, 0.3, 1.7] {
            let bit = MessageLaw::bit(&DymboFilter::new(plant()), 1.1, &Link::flipping(0.2).unwrap()).unwrap();
            close(&probabilities(&bit, e), &[0.2 + 0.6 * cdf(-e), 0.2 + 0.6 * cdf(e)]);
            let words = MultibitFilter::new(plant(), 2).unwrap();
            let edge = 2.1_f64.sqrt() * crate::ScalarFilter::scheme(&words).quantizer().breakpoints()[2];
            let inner = [interval(-edge - e, -e), interval(-e, edge - e)];
            let expected = [cdf(-edge - e), inner[0], inner[1], cdf(e - edge)];
            close(&probabilities(&MessageLaw::word(&words, 1.1).unwrap(), e), &expected);
            let count = ParallelFilter::new(plant(), 2, CountFusion::Linear).unwrap();
            let expected = [cdf(-e).powi(2), 2.0 * cdf(e) * cdf(-e), cdf(e).powi(2)];
            close(&probabilities(&MessageLaw::count(&count, 1.1).unwrap(), e), &expected);
            let gain = (2.0 / std::f64::consts::PI).sqrt() * 1.1 / 2.1_f64.sqrt();
            let (down, up) = (e + gain, e - gain);
            let expected = [
                cdf(-e) * cdf(-down),
                cdf(-e) * cdf(down),
                cdf(e) * cdf(-up),
                cdf(e) * cdf(up),
            ];
            close(&probabilities(&MessageLaw::sequence(&plant(), 1.1, 2).unwrap(), e), &expected);
        }
    }
}
