//! Several bits per sample: the filter for the quantized innovation.

use crate::filter::{ScalarFilter, StepInfo, without_report};
use crate::plant::{filtered_variance, innovation_gain};
use crate::{CellIndex, Error, InnovationWord, Prediction, ScalarPlant};
use fewbits_core::{Gaussian, Link, Observation};
use serde::{Deserialize, Serialize};

/// The filter for sensors that report `m` bits of the normalised innovation.
///
/// ```text
/// predict   mean = a mean,  P = a^2 P + sigma_u^2,  s = sqrt(P + sigma^2)
/// broadcast mean and s
/// receive   cell j of z = (x - mean)/s in the Lloyd-Max quantizer of N(0, 1)
/// correct   mean = mean + (P/s) y_j,          y_j = E[z | word j received], the centroid over a perfect link
///           P = P - c P^2/(P + sigma^2),      c = E y_j^2, 1 - distortion over a perfect link
/// ```
///
/// The variance is the mean over all words, so it does not depend on the data. [`InnovationWord`]'s factor with the assumed-density
/// update gives the variance for the received word instead. That describes the posterior better, but the estimates are as accurate:
/// both are within 0.1 % of the minimum mean squared error.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers", into = "Numbers")]
pub struct MultibitFilter {
    plant: ScalarPlant,
    scheme: InnovationWord,
    link: Link,
    /// Per received word: the mean `y_j` of the normalised innovation given the word, and the word's probability.
    levels: Vec<(f64, f64)>,
    information: f64,
}

/// The stored form of [`MultibitFilter`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    plant: ScalarPlant,
    bits: u32,
    link: Link,
}

impl From<MultibitFilter> for Numbers {
    fn from(filter: MultibitFilter) -> Self {
        Self {
            plant: filter.plant,
            bits: filter.scheme.bits(),
            link: filter.link,
        }
    }
}

impl TryFrom<Numbers> for MultibitFilter {
    type Error = Error;

    fn try_from(parts: Numbers) -> Result<Self, Error> {
        Ok(MultibitFilter::new(parts.plant, parts.bits as usize)?.with_link(parts.link))
    }
}

impl MultibitFilter {
    /// The filter for words of 1 to 8 bits over a perfect link. With one bit it equals [`DymboFilter`](crate::DymboFilter).
    ///
    /// # Errors
    /// If `bits` is outside `1..=8`.
    pub fn new(plant: ScalarPlant, bits: usize) -> Result<Self, Error> {
        let scheme = InnovationWord::new(plant.measurement_variance(), bits)?;
        Ok(Self {
            plant,
            scheme,
            link: Link::PERFECT,
            levels: levels(&scheme, &Link::PERFECT),
            information: 1.0 - scheme.quantizer().mean_squared_error(),
        })
    }

    /// The same filter for another link. Each bit is inverted independently, so a word may arrive as any other.
    #[must_use]
    pub fn with_link(self, link: Link) -> Self {
        let levels = levels(&self.scheme, &link);
        let information = levels.iter().map(|(y, p)| p * y * y).sum();
        Self {
            link,
            levels,
            information,
            ..self
        }
    }

    /// Per word: `E[z | word received]` and the word's probability, `z` the normalised innovation.
    pub(crate) fn levels(&self) -> &[(f64, f64)] {
        &self.levels
    }
}

/// Computes [`MultibitFilter::levels`] for a link that may invert bits.
fn levels(scheme: &InnovationWord, link: &Link) -> Vec<(f64, f64)> {
    let quantizer = scheme.quantizer();
    let sent = || quantizer.centroids().iter().copied().zip(quantizer.probabilities());
    if link.crossover() == 0.0 {
        return sent().map(|(y, p)| (y, *p)).collect();
    }
    // Bayes' rule over the words `i` that may have been sent: `p(j) = sum_i p_i p(j | i)` and `y_j = sum_i p_i p(j | i) y_i / p(j)`.
    let received = |j: u64| {
        let (mass, first) = sent().zip(0..).fold((0.0, 0.0), |(mass, first), ((y, p), i)| {
            let joint = p * link.word_probability(i, j, scheme.bits());
            (mass + joint, first + joint * y)
        });
        (first / mass, mass)
    };
    (0..quantizer.centroids().len() as u64).map(received).collect()
}

impl ScalarFilter for MultibitFilter {
    type Scheme = InnovationWord;

    fn plant(&self) -> &ScalarPlant {
        &self.plant
    }

    fn link(&self) -> &Link {
        &self.link
    }

    fn scheme(&self) -> InnovationWord {
        self.scheme
    }

    fn information(&self) -> f64 {
        self.information
    }

    #[inline]
    fn feedback(&self, predicted: &Gaussian<1>) -> Prediction {
        Prediction {
            mean: predicted.mean()[0],
            deviation: (predicted.covariance()[0] + self.plant.measurement_variance()).sqrt(),
        }
    }

    #[inline]
    fn update(
        &self,
        predicted: &Gaussian<1>,
        observation: &Observation<CellIndex>,
    ) -> Result<(Gaussian<1>, StepInfo), Error> {
        let Observation::Received(word) = observation else {
            return without_report(predicted, observation, &self.link);
        };
        let (level, probability) = self.levels[self.scheme.index(*word)?];
        let (p, r) = (predicted.covariance()[0], self.plant.measurement_variance());
        let info = StepInfo {
            predicted: *predicted,
            correction: innovation_gain(p, r) * level,
            information: self.information,
            log_likelihood: probability.ln() + self.link.arrival().ln(),
            bits: self.scheme.bits(),
        };
        info.corrected(filtered_variance(p, r, self.information))
    }
}

#[cfg(test)]
mod tests {
    use super::MultibitFilter;
    use crate::{CellIndex, DymboFilter, ScalarFilter, ScalarPlant};
    use fewbits_core::{Gaussian, Link, Observation, Scheme, Sign};
    use fewbits_filters::assumed_density;
    use nalgebra::Matrix1;

    fn plant() -> ScalarPlant {
        ScalarPlant::new(0.9, 0.5, 1.0).unwrap()
    }

    #[test]
    fn one_bit_is_the_dymbo_filter() {
        let belief = Gaussian::scalar(0.4, 1.0).unwrap();
        for link in [Link::PERFECT, Link::new(0.2, 0.1).unwrap()] {
            let multibit = MultibitFilter::new(plant(), 1).unwrap().with_link(link);
            let dymbo = DymboFilter::new(plant()).with_link(link);
            assert!((multibit.information() - dymbo.information()).abs() < 1e-15);
            for (index, sign) in [(0, Sign::Below), (1, Sign::Above)] {
                let (a, word) = multibit
                    .step(&belief, &Observation::Received(CellIndex(index)))
                    .unwrap();
                let (b, bit) = dymbo.step(&belief, &Observation::Received(sign)).unwrap();
                assert!((a.mean()[0] - b.mean()[0]).abs() < 1e-14);
                assert!((a.covariance()[0] - b.covariance()[0]).abs() < 1e-14);
                assert!((word.log_likelihood - bit.log_likelihood).abs() < 1e-14);
            }
            assert!(multibit.step(&belief, &Observation::Received(CellIndex(2))).is_err());
        }
    }

    #[test]
    fn the_step_is_the_average_of_the_cells() {
        let belief = Gaussian::scalar(0.4, 1.0).unwrap();
        for link in [Link::PERFECT, Link::new(0.2, 0.1).unwrap()] {
            let filter = MultibitFilter::new(plant(), 3).unwrap().with_link(link);
            let predicted = filter.predict(&belief);
            let (mut mass, mut variance) = (0.0, 0.0);
            for word in (0..8).map(|i| Observation::Received(CellIndex(i))) {
                let (posterior, info) = filter.step(&belief, &word).unwrap();
                let factor = filter
                    .scheme()
                    .factor(&filter.feedback(&predicted), &word, &link)
                    .unwrap();
                let (exact, seen) = assumed_density::update(&predicted, &Matrix1::identity(), &factor).unwrap();
                assert!((posterior.mean()[0] - exact.mean()[0]).abs() < 1e-12);
                assert!((info.log_likelihood - seen.log_likelihood).abs() < 1e-12);
                mass += seen.log_likelihood.exp();
                variance += seen.log_likelihood.exp() * exact.covariance()[0];
                assert_eq!(info.bits, 3);
            }
            let (posterior, _) = filter.step(&belief, &Observation::Received(CellIndex(0))).unwrap();
            assert!((mass - (1.0 - link.loss())).abs() < 1e-14);
            assert!((variance / mass - posterior.covariance()[0]).abs() < 1e-12);
            assert_eq!(filter.step(&belief, &Observation::Lost).unwrap().0, predicted);
            let json = serde_json::to_string(&filter).unwrap();
            assert_eq!(serde_json::from_str::<MultibitFilter>(&json).unwrap(), filter);
        }
    }
}
