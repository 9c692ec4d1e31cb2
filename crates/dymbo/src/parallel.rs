//! Several one-bit sensors that answer the same threshold in one slot.
//!
//! If the sensors can answer one after the other, do not use this filter: predict once, then call
//! [`ScalarFilter::update`](crate::ScalarFilter::update) for each sensor with a refreshed threshold, which is more accurate. This
//! filter is for sensors that must answer at the same time. They share one prediction error, so their bits are correlated, and the
//! number of `+1` is a sufficient statistic.

use crate::filter::StepInfo;
use crate::plant::{innovation_gain, scalar};
use crate::{Error, ScalarPlant};
use fewbits_core::factor::{Levels, Product, Scalar};
use fewbits_core::{Factor, Gaussian, Link, Observation, Sign};
use fewbits_numerics::binomial::log_row;
use fewbits_numerics::error::{ArgumentError, within};
use fewbits_numerics::normal::{self, SQRT_2_OVER_PI};
use fewbits_numerics::quadrature::gauss_legendre;
use serde::{Deserialize, Serialize};
use std::f64::consts::FRAC_2_PI;

/// How the bits of one slot move the estimate.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum CountFusion {
    /// The best linear function of the bits; the arcsine law gives their correlation. Cheap. With many sensors its variance does
    /// not fall below `P (1 - rho/asin rho)`, `rho = P/(P + sigma^2)`.
    #[default]
    Linear,
    /// Posterior mean and variance given the bits: the assumed-density update with the product of their factors. At ten sensors
    /// its error is 2.6 % smaller.
    Exact,
}

/// Largest number of sensors.
const MAX_SENSORS: usize = 1000;

/// The filter for `K` sensors that answer the same threshold at once.
///
/// Linear fusion: `mean = mean + G sum_i b_i` and `P = P - G sqrt(2/pi) (P/s) K`, with `s^2 = P + sigma^2`,
/// `D = 1 + (K-1)(2/pi) asin rho`, `G = sqrt(2/pi) (P/s)/D`; over a link of crossover `eps` each `sqrt(2/pi)` shrinks by
/// `1 - 2 eps`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers")]
pub struct ParallelFilter {
    plant: ScalarPlant,
    sensors: usize,
    fusion: CountFusion,
    link: Link,
}

/// The stored form of [`ParallelFilter`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    plant: ScalarPlant,
    sensors: usize,
    fusion: CountFusion,
    link: Link,
}

impl TryFrom<Numbers> for ParallelFilter {
    type Error = Error;

    fn try_from(parts: Numbers) -> Result<Self, Error> {
        Ok(ParallelFilter::new(parts.plant, parts.sensors, parts.fusion)?.with_link(parts.link))
    }
}

impl ParallelFilter {
    /// The filter for 1 to 1000 sensors over perfect links.
    ///
    /// # Errors
    /// If `sensors` is outside `1..=1000`.
    pub fn new(plant: ScalarPlant, sensors: usize, fusion: CountFusion) -> Result<Self, Error> {
        within("sensors", sensors as f64, 1.0, MAX_SENSORS as f64)?;
        Ok(Self {
            plant,
            sensors,
            fusion,
            link: Link::PERFECT,
        })
    }

    /// The same filter for other links. All sensors have the same link.
    #[must_use]
    pub fn with_link(self, link: Link) -> Self {
        Self { link, ..self }
    }

    /// The plant.
    pub fn plant(&self) -> &ScalarPlant {
        &self.plant
    }

    /// Number of sensors `K`.
    pub fn sensors(&self) -> usize {
        self.sensors
    }

    /// The links' probabilities of loss and of inversion that the filter assumes.
    pub(crate) fn link(&self) -> &Link {
        &self.link
    }

    /// The threshold to broadcast for the next slot, given the present filtered belief: the predicted mean.
    pub fn threshold(&self, belief: &Gaussian<1>) -> f64 {
        self.plant.coefficient() * belief.mean()[0]
    }

    /// Linear fusion of `count` bits: the gain `G`, and the variance after the update.
    fn linear(&self, p: f64, count: usize) -> (f64, f64) {
        let (r, count) = (self.plant.measurement_variance(), count as f64);
        let (rho, clean) = (p / (p + r), 1.0 - 2.0 * self.link.crossover());
        let scale = SQRT_2_OVER_PI * clean;
        // `D`, the variance of the sum of the bits per bit; then `P - G c K` with the covariance `c` of a bit with the state.
        let inflation = 1.0 + (count - 1.0) * FRAC_2_PI * clean * clean * rho.asin();
        let left = p * (1.0 - FRAC_2_PI * clean * clean * rho * count / inflation);
        (scale * innovation_gain(p, r) / inflation, left)
    }

    /// If all `K` bits arrive: the corrections for `0..=K` bits of `+1`, in state units, and the mean variance after them.
    pub fn table(&self, predicted_variance: f64) -> (Vec<f64>, f64) {
        let (k, p) = (self.sensors, predicted_variance);
        match self.fusion {
            CountFusion::Linear => {
                let (gain, variance) = self.linear(p, k);
                ((0..=k).map(|up| gain * (2.0 * up as f64 - k as f64)).collect(), variance)
            }
            CountFusion::Exact => {
                let moments = count_moments(k, p, self.plant.measurement_variance(), &self.link);
                // The mean of the posterior variance is `P` less the variance of the posterior mean.
                let removed: f64 = moments.iter().map(|(mass, mean)| mass * mean * mean).sum();
                (moments.into_iter().map(|(_, mean)| mean).collect(), (p - removed).max(0.0))
            }
        }
    }

    /// One slot: predict, then correct with one observation per sensor. The log-likelihood is exact for [`CountFusion::Exact`]. For
    /// [`CountFusion::Linear`] it is that of assumed-density updates with one bit after the other (about 40 ns per bit).
    ///
    /// # Errors
    /// If the number of observations is not the number of sensors; [`Error::Impossible`].
    pub fn step(
        &self,
        belief: &Gaussian<1>,
        observations: &[Observation<Sign>],
    ) -> Result<(Gaussian<1>, StepInfo), Error> {
        self.update(&self.plant.predict(belief), observations)
    }

    /// Corrects a predicted belief with one observation per sensor. The sensors' threshold was the mean of this belief.
    ///
    /// # Errors
    /// As [`step`](Self::step).
    pub fn update(
        &self,
        predicted: &Gaussian<1>,
        observations: &[Observation<Sign>],
    ) -> Result<(Gaussian<1>, StepInfo), Error> {
        if observations.len() != self.sensors {
            let expected = format!("{}, one per sensor", self.sensors);
            return Err(ArgumentError::new("observations", observations.len(), expected).into());
        }
        let (mean, p) = (predicted.mean()[0], predicted.covariance()[0]);
        let received = || observations.iter().filter_map(Observation::received);
        let bits = received().count();
        // A missing bit tells nothing about the state, but the probability of its loss enters the likelihood.
        let missing = observations.iter().filter(|o| o.received().is_none());
        let missing: f64 = missing.map(|observation| self.link.delivery(observation).ln()).sum();
        let factor = |bit: &Sign| Levels::sign(*bit, mean, self.plant.measurement_variance(), &self.link);
        if bits > 0 {
            self.link.of_received()?;
        }
        let (correction, variance, log_evidence) = match self.fusion {
            CountFusion::Linear => {
                let (gain, variance) = self.linear(p, bits);
                let (mut belief, mut log_evidence) = (*predicted, 0.0);
                for bit in received() {
                    let tilted = factor(bit)?.tilted(&belief)?;
                    log_evidence += tilted.log_evidence;
                    belief = scalar(tilted.mean[0], tilted.covariance[0]);
                }
                (gain * received().map(|bit| bit.value()).sum::<f64>(), variance, log_evidence)
            }
            CountFusion::Exact => {
                let bits = received().map(|bit| factor(bit).map(Scalar::from));
                let posterior = bits.collect::<Result<Product, _>>()?.tilted(predicted)?;
                (posterior.mean[0] - mean, posterior.covariance[0], posterior.log_evidence)
            }
        };
        let r = self.plant.measurement_variance();
        let gained = (p - variance) / p * ((p + r) / p);
        let info = StepInfo {
            predicted: *predicted,
            correction,
            information: if p > 0.0 { gained } else { 0.0 },
            log_likelihood: log_evidence + missing,
            bits: bits as u32,
        };
        info.corrected(variance)
    }
}

/// Half width of the integration range in standard deviations of the prediction error.
const REACH: f64 = 9.0;

/// For each number `0..=k` of `+1` among `k` bits: its probability, and the mean of the prediction error `e ~ N(0, p)` given it.
fn count_moments(k: usize, p: f64, r: f64, link: &Link) -> Vec<(f64, f64)> {
    let (deviation, sigma) = (p.sqrt(), r.sqrt());
    let (floor, share) = (link.crossover(), 1.0 - 2.0 * link.crossover());
    let log_bit = |z: f64| match floor {
        0.0 => normal::log_cdf(z),
        _ => (floor + share * normal::cdf(z)).ln(),
    };
    // Where |e| exceeds 9 noise deviations all bits agree, and only the prior varies: wide panels suffice there. Within, the narrowest
    // feature is the posterior, about sqrt(r/k) wide.
    let inner = REACH * deviation.min(sigma);
    let width = (r / k as f64).sqrt().min(deviation);
    let fine = ((2.0 * inner / (3.0 * width).max(f64::MIN_POSITIVE)).ceil() as usize).max(6);
    let mut nodes: Vec<(f64, f64)> = gauss_legendre::<20>().panels(-inner, inner, fine).collect();
    if inner < REACH * deviation {
        nodes.extend(gauss_legendre::<20>().panels(inner, REACH * deviation, 6));
        nodes.extend(gauss_legendre::<20>().panels(-REACH * deviation, -inner, 6));
    }
    let terms: Vec<_> = nodes
        .into_iter()
        .map(|(e, w)| {
            (e, (w / deviation).ln() + normal::log_pdf(e / deviation), log_bit(e / sigma), log_bit(-e / sigma))
        })
        .collect();
    log_row(k)
        .into_iter()
        .enumerate()
        .map(|(up, log_choose)| {
            let (u, d) = (up as f64, (k - up) as f64);
            let (mut mass, mut first) = (0.0, 0.0);
            for (e, log_weight, log_up, log_down) in &terms {
                let density = (log_choose + log_weight + u * log_up + d * log_down).exp();
                mass += density;
                first += density * e;
            }
            // A count without mass cannot be received: its correction is not used.
            (mass, if mass > 0.0 { first / mass } else { 0.0 })
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::{CountFusion, ParallelFilter, count_moments};
    use crate::{DymboFilter, ScalarFilter, ScalarPlant};
    use fewbits_core::{Gaussian, Link, Observation, Sign};

    fn plant() -> ScalarPlant {
        ScalarPlant::new(0.9, 0.5, 1.0).unwrap()
    }

    /// `up` bits of `+1` among `k`.
    fn count(k: usize, up: usize) -> Vec<Observation<Sign>> {
        (0..k)
            .map(|i| Observation::Received(if i < up { Sign::Above } else { Sign::Below }))
            .collect()
    }

    #[test]
    fn one_sensor_is_the_dymbo_filter() {
        let belief = Gaussian::scalar(0.3, 1.0).unwrap();
        for link in [Link::PERFECT, Link::new(0.3, 0.1).unwrap().with_erasure(0.2).unwrap()] {
            let dymbo = DymboFilter::new(plant()).with_link(link);
            for observation in [Observation::Received(Sign::Above), Observation::Lost] {
                let (alone, info) = dymbo.step(&belief, &observation).unwrap();
                for fusion in [CountFusion::Linear, CountFusion::Exact] {
                    let filter = ParallelFilter::new(plant(), 1, fusion).unwrap().with_link(link);
                    let (one, same) = filter.step(&belief, &[observation]).unwrap();
                    assert!((one.mean()[0] - alone.mean()[0]).abs() < 1e-12);
                    assert!((one.covariance()[0] - alone.covariance()[0]).abs() < 1e-12);
                    assert!((info.log_likelihood - same.log_likelihood).abs() < 1e-12);
                    assert!((info.information - same.information).abs() < 1e-12);
                    assert_eq!(info.bits, same.bits);
                }
            }
        }
    }

    /// Probabilities that all bits agree, by the orthant probabilities of two and three normal variables of equal correlation,
    /// and the mean beside one bit, whichever of prior and noise is the wider.
    #[test]
    fn few_bits_have_closed_forms() {
        use std::f64::consts::{PI, TAU};
        for (p, r) in [
            (1.0, 1.0),
            (4e4, 0.9),
            (0.003, 1.7),
            (30.0, 2.0),
            (4e4, 1e4),
            (1e-9, 1e3),
        ] {
            for crossover in [0.0, 0.2] {
                let link = Link::flipping(crossover).unwrap();
                let clean = 1.0 - 2.0 * crossover;
                let all = |k: usize| count_moments(k, p, r, &link)[k];
                let (share, mean) = all(1);
                assert!((share - 0.5).abs() < 1e-12);
                let expected = clean * p / (p + r).sqrt() * (2.0 / PI).sqrt();
                assert!((mean / expected - 1.0).abs() < 1e-9, "{p} {r}: {mean} {expected}");
                let arc = (p / (p + r)).asin() * clean * clean;
                assert!((all(2).0 - (0.25 + arc / TAU)).abs() < 1e-11, "{p} {r}");
                assert!((all(3).0 - (0.125 + 1.5 * arc / TAU)).abs() < 1e-11, "{p} {r}");
                let total: f64 = count_moments(7, p, r, &link).iter().map(|(share, _)| share).sum();
                assert!((total - 1.0).abs() < 1e-11, "{p} {r}: {total}");
            }
        }
    }

    #[test]
    fn counts_are_a_distribution_and_the_table_beats_the_line() {
        for (k, link) in [
            (2, Link::PERFECT),
            (5, Link::flipping(0.1).unwrap()),
            (40, Link::PERFECT),
        ] {
            let moments = count_moments(k, 1.1, 1.0, &link);
            assert!((moments.iter().map(|m| m.0).sum::<f64>() - 1.0).abs() < 1e-12);
            let filter = |fusion| ParallelFilter::new(plant(), k, fusion).unwrap().with_link(link);
            let (linear, exact) = (filter(CountFusion::Linear).table(1.1), filter(CountFusion::Exact).table(1.1));
            // Two sensors: by symmetry the line is exact.
            assert!(exact.1 <= linear.1 + if k > 2 { 0.0 } else { 1e-14 });
            assert!(exact.0.windows(2).all(|pair| pair[0] < pair[1]));
            // The linear variance is what its corrections truly leave: E (e - d)^2.
            let left: f64 = moments
                .iter()
                .zip(&linear.0)
                .map(|((p, m), d)| p * (d * d - 2.0 * m * d))
                .sum();
            assert!((1.1 + left - linear.1).abs() < 1e-11);
        }
    }

    /// The table averages over counts what single steps give: its corrections are their means, its variance their mean variance.
    #[test]
    fn the_table_is_the_average_of_the_steps() {
        let (k, belief) = (6, Gaussian::scalar(0.4, 1.0).unwrap());
        for fusion in [CountFusion::Linear, CountFusion::Exact] {
            let filter = ParallelFilter::new(plant(), k, fusion).unwrap();
            let p = plant().predict(&belief).covariance()[0];
            let (corrections, variance) = filter.table(p);
            let moments = count_moments(k, p, 1.0, &Link::PERFECT);
            let mut average = 0.0;
            for up in 0..=k {
                let (posterior, info) = filter.step(&belief, &count(k, up)).unwrap();
                assert!((info.correction - corrections[up]).abs() < 1e-11);
                let choose = (0..up).fold(1.0, |c, i| c * (k - i) as f64 / (i + 1) as f64);
                // Linear fusion takes the bits one after the other.
                let off = choose * info.log_likelihood.exp() - moments[up].0;
                assert!(
                    off.abs() < if fusion == CountFusion::Exact { 1e-12 } else { 0.02 },
                    "{up}: {off} of {}",
                    moments[up].0
                );
                average += moments[up].0 * posterior.covariance()[0];
            }
            assert!((average - variance).abs() < 1e-11);
        }
    }

    #[test]
    fn linear_fusion_saturates() {
        let many = ParallelFilter::new(plant(), 1000, CountFusion::Linear)
            .unwrap()
            .table(1.0)
            .1;
        assert!((many - (1.0 - 0.5 / 0.5_f64.asin())).abs() < 2e-3);
        assert!(ParallelFilter::new(plant(), 0, CountFusion::Linear).is_err());
        assert!(ParallelFilter::new(plant(), 1001, CountFusion::Linear).is_err());
        let two = ParallelFilter::new(plant(), 2, CountFusion::Linear).unwrap();
        let belief = Gaussian::scalar(0.0, 1.0).unwrap();
        assert!(two.step(&belief, &count(3, 2)).is_err());
        assert_eq!(two.step(&belief, &[Observation::Lost; 2]).unwrap().0, plant().predict(&belief));
        assert!(two.step(&belief, &[Observation::Nothing, Observation::Lost]).is_err());
    }

    /// Regression: six seconds for one step. A wide prior costs no more than a narrow one, whatever else the machine does.
    #[test]
    fn a_thousand_sensors_and_a_wide_prior_are_quick() {
        let filter = ParallelFilter::new(plant(), 1000, CountFusion::Exact).unwrap();
        let quickest = |variance: f64| {
            let prior = Gaussian::scalar(0.0, variance).unwrap();
            let once = || {
                let start = std::time::Instant::now();
                let posterior = filter.step(&prior, &count(1000, 500)).unwrap().0;
                (start.elapsed(), posterior)
            };
            (0..20).map(|_| once()).min_by_key(|(time, _)| *time).unwrap()
        };
        let ((wide, posterior), (narrow, _)) = (quickest(1e8), quickest(1.0));
        // Between Gaussian halves of 500 bits each: pi/(2 K) of the noise variance, nearly.
        assert!((posterior.covariance()[0] * 2000.0 / std::f64::consts::PI - 1.0).abs() < 0.01);
        assert!(wide < 20 * narrow, "{wide:?} {narrow:?}");
        assert!(filter.table(1e8).1.is_finite());
    }
}
