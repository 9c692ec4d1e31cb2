//! A source with its one-bit sensors, and the exact enumeration of their joint reports.

use crate::observation::source::{Nodes, Threshold};
use crate::{BinaryQuantizer, Error, PatternSensor, Source};
use fewbits_numerics::error::{at_least_one, entries};
use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_quantizer_design::outcomes::{Table, for_each};

/// Largest number of outcomes that may be enumerated.
pub(crate) const MAX_OUTCOMES: u128 = 1 << 26;

/// Width of quadrature panels in noise standard deviations; with twelve nodes per panel the integrals have an error of `1e-12`.
const PANEL: f64 = 2.0;

/// A source and the sensors that measure it, with independent noises.
///
/// Sensors with equal quantizer and noise are exchangeable: only the number of them that report 1 matters. The bank groups them, so
/// fifty sensors in three groups of 17, 16 and 17 have 5508 outcomes instead of `2^50`.
#[derive(Debug, Clone, PartialEq)]
pub struct Bank {
    source: Source,
    groups: Vec<Exchangeable>,
    /// Index of the group of each sensor, in the order given.
    membership: Vec<usize>,
}

/// A group of exchangeable sensors.
#[derive(Debug, Clone, PartialEq)]
struct Exchangeable {
    sensor: PatternSensor,
    count: usize,
}

impl Bank {
    /// The bank of these sensors. Bits are decoded in the same order.
    ///
    /// # Errors
    /// If there is no sensor.
    pub fn new(source: Source, sensors: Vec<PatternSensor>) -> Result<Self, Error> {
        at_least_one("sensors", sensors.len())?;
        let mut groups: Vec<Exchangeable> = Vec::new();
        let mut membership = Vec::with_capacity(sensors.len());
        for sensor in sensors {
            let group = match groups.iter().position(|g| g.sensor == sensor) {
                Some(at) => at,
                None => {
                    groups.push(Exchangeable { sensor, count: 0 });
                    groups.len() - 1
                }
            };
            groups[group].count += 1;
            membership.push(group);
        }
        Ok(Self {
            source,
            groups,
            membership,
        })
    }

    /// A bank of sensors with equal noise, one for each quantizer.
    ///
    /// # Errors
    /// If there is no quantizer or `noise_deviation` is not positive and finite.
    pub fn homogeneous_with_deviation(
        source: Source,
        quantizers: Vec<BinaryQuantizer>,
        noise_deviation: f64,
    ) -> Result<Self, Error> {
        let sensors = quantizers
            .into_iter()
            .map(|quantizer| PatternSensor::with_deviation(quantizer, noise_deviation))
            .collect::<Result<_, _>>()?;
        Self::new(source, sensors)
    }

    /// The source.
    pub fn source(&self) -> &Source {
        &self.source
    }

    /// Number of sensors.
    pub(crate) fn sensors(&self) -> usize {
        self.membership.len()
    }

    /// Sensor `n`; the index must be valid.
    pub(crate) fn sensor(&self, n: usize) -> &PatternSensor {
        &self.groups[self.membership[n]].sensor
    }

    /// One sensor of each group of exchangeable ones, and their number.
    #[doc(hidden)]
    pub fn groups(&self) -> impl ExactSizeIterator<Item = (&PatternSensor, usize)> {
        self.groups.iter().map(|g| (&g.sensor, g.count))
    }

    /// Number of outcomes, `prod (count + 1)` over the groups; larger numbers are returned as `u128::MAX`.
    pub fn outcomes(&self) -> u128 {
        self.groups
            .iter()
            .fold(1u128, |product, g| product.saturating_mul(g.count as u128 + 1))
    }

    /// Number of outcomes; an error if there are too many to enumerate.
    #[doc(hidden)]
    pub fn checked_outcomes(&self) -> Result<usize, Error> {
        let outcomes = self.outcomes();
        Error::at_most("the table of outcomes", outcomes, MAX_OUTCOMES)?;
        Ok(outcomes as usize)
    }

    /// Fisher information about `x` in all bits, `sum_n P1'^2 / (P0 P1)`.
    pub fn fisher_information(&self, x: f64) -> f64 {
        self.groups
            .iter()
            .map(|g| g.count as f64 * g.sensor.quantizer().fisher_information(x, g.sensor.noise_deviation()))
            .sum()
    }

    /// Quadrature nodes for errors of `1e-12`.
    pub fn fine_nodes(&self) -> Nodes {
        let reach = self.source.reach();
        self.nodes_between(-reach, reach)
    }

    /// The same nodes for a part of the support.
    #[doc(hidden)]
    pub fn nodes_between(&self, from: f64, to: f64) -> Nodes {
        Nodes::adapted(&self.source, from, to, &self.thresholds(), PANEL, gauss_legendre::<12>())
    }

    /// All thresholds, with the noise of their sensors.
    #[doc(hidden)]
    pub fn thresholds(&self) -> Vec<Threshold> {
        let sensors = self.groups.iter().map(|g| &g.sensor);
        sensors
            .flat_map(|s| Threshold::of(s.quantizer().breakpoints(), s.noise_deviation()))
            .collect()
    }

    /// Enumerates all outcomes. `visit` gets the index of the counts (last group fastest) and `w p(x) P(outcome|x)` at the nodes.
    pub fn for_outcomes(&self, nodes: &Nodes, visit: impl FnMut(usize, &[f64])) {
        let counts = |g: &Exchangeable| {
            let quantizer = g.sensor.quantizer();
            quantizer
                .probabilities_at(&nodes.points, g.sensor.noise_deviation())
                .of_counts(g.count)
        };
        let tables: Vec<Table> = self.groups.iter().map(counts).collect();
        for_each(&tables, &nodes.weights, visit);
    }

    /// Index of the counts of a bit string; an error if its length is not the number of sensors.
    pub(crate) fn index_of(&self, bits: &[bool]) -> Result<usize, Error> {
        entries("bits", bits.len(), self.sensors())?;
        let mut counts = vec![0usize; self.groups.len()];
        for (&bit, &group) in bits.iter().zip(&self.membership) {
            counts[group] += usize::from(bit);
        }
        Ok(self
            .groups
            .iter()
            .zip(&counts)
            .fold(0, |index, (g, k)| index * (g.count + 1) + k))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    fn sign() -> BinaryQuantizer {
        BinaryQuantizer::new(vec![0.0]).unwrap()
    }

    #[test]
    fn outcomes_sum_to_one_and_repeats_are_counted() {
        let source = Source::uniform(1.0).unwrap();
        let other = BinaryQuantizer::new(vec![-0.5, 0.5]).unwrap();
        let bank =
            Bank::homogeneous_with_deviation(source, vec![sign(), other.clone(), sign(), other, sign()], 0.2).unwrap();
        assert_eq!(bank.outcomes(), 12);
        let (mut total, mut seen) = (0.0, 0);
        bank.for_outcomes(&bank.fine_nodes(), |index, w| {
            assert_eq!(index, seen);
            seen += 1;
            total += w.iter().sum::<f64>();
        });
        assert_eq!(seen, 12);
        assert_relative_eq!(total, 1.0, max_relative = 1e-13);
        assert_eq!(bank.index_of(&[true, false, true, true, false]).unwrap(), 2 * 3 + 1);
        assert!(bank.index_of(&[true]).is_err());
    }

    #[test]
    fn bad_sensors_are_refused() {
        let source = Source::uniform(1.0).unwrap();
        assert!(Bank::new(source, vec![]).is_err());
        for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(PatternSensor::with_deviation(sign(), bad).is_err());
        }
        let distinct = (0..27)
            .map(|i| BinaryQuantizer::new(vec![f64::from(i)]).unwrap())
            .collect();
        let bank = Bank::homogeneous_with_deviation(source, distinct, 0.2).unwrap();
        assert!(matches!(bank.checked_outcomes(), Err(Error::TooLarge { .. })));
    }
}
