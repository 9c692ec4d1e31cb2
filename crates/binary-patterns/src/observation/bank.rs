//! A source with its one-bit sensors, and the exact enumeration of their joint reports.

use crate::observation::source::{Nodes, Threshold};
use crate::{BinaryQuantizer, Error, PatternSensor, Source};
use fewbits_numerics::binomial;
use fewbits_numerics::error::{at_least_one, entries};
use fewbits_numerics::quadrature::gauss_legendre;
use serde::{Deserialize, Serialize};

/// Largest number of outcomes that may be enumerated.
pub(crate) const MAX_OUTCOMES: u128 = 1 << 26;

/// Outcomes of smaller probability are left out; their contribution to any error is below `1e-280`.
pub const IMPOSSIBLE: f64 = 1e-290;

/// Width of quadrature panels in noise standard deviations; with twelve nodes per panel the integrals have an error of `1e-12`.
const PANEL: f64 = 2.0;

/// A source and the sensors that measure it, with independent noises.
///
/// Sensors with equal quantizer and noise are exchangeable: only the number of them that report 1 matters. The bank groups them, so
/// fifty sensors in three groups of 17, 16 and 17 have 5508 outcomes instead of `2^50`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredBank", into = "StoredBank")]
pub struct Bank {
    source: Source,
    groups: Vec<Exchangeable>,
    /// Index of the group of each sensor, in the order given.
    membership: Vec<usize>,
}

/// A group of exchangeable sensors.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Exchangeable {
    pub sensor: PatternSensor,
    pub count: usize,
}

/// The stored form of [`Bank`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredBank {
    source: Source,
    sensors: Vec<PatternSensor>,
}

impl From<Bank> for StoredBank {
    fn from(bank: Bank) -> Self {
        Self {
            source: bank.source,
            sensors: (0..bank.sensors()).map(|n| bank.sensor(n).clone()).collect(),
        }
    }
}

impl TryFrom<StoredBank> for Bank {
    type Error = Error;

    fn try_from(parts: StoredBank) -> Result<Self, Error> {
        Bank::new(parts.source, parts.sensors)
    }
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
    pub fn sensors(&self) -> usize {
        self.membership.len()
    }

    /// Sensor `n`; the index must be valid.
    pub(crate) fn sensor(&self, n: usize) -> &PatternSensor {
        &self.groups[self.membership[n]].sensor
    }

    pub(crate) fn groups(&self) -> &[Exchangeable] {
        &self.groups
    }

    /// Number of outcomes, `prod (count + 1)` over the groups; larger numbers are returned as `u128::MAX`.
    pub fn outcomes(&self) -> u128 {
        self.groups
            .iter()
            .fold(1u128, |product, g| product.saturating_mul(g.count as u128 + 1))
    }

    pub(crate) fn checked_outcomes(&self) -> Result<usize, Error> {
        let outcomes = self.outcomes();
        Error::at_most("the table of outcomes", outcomes, MAX_OUTCOMES)?;
        Ok(outcomes as usize)
    }

    /// Smallest noise in the bank.
    pub(crate) fn finest_noise(&self) -> f64 {
        self.groups
            .iter()
            .map(|g| g.sensor.noise_deviation())
            .fold(f64::INFINITY, f64::min)
    }

    /// Fisher information about `x` in all bits, `sum_n P1'^2 / (P0 P1)`.
    pub fn fisher_information(&self, x: f64) -> f64 {
        self.groups
            .iter()
            .map(|g| g.count as f64 * g.sensor.fisher_information(x))
            .sum()
    }

    /// Quadrature nodes for errors of `1e-12`.
    pub fn fine_nodes(&self) -> Nodes {
        let reach = self.source.reach();
        self.nodes_between(-reach, reach)
    }

    /// The same nodes for a part of the support.
    pub(crate) fn nodes_between(&self, from: f64, to: f64) -> Nodes {
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
    pub fn for_outcomes(&self, nodes: &Nodes, mut visit: impl FnMut(usize, &[f64])) {
        let table_of = |g: &Exchangeable| {
            let p = g
                .sensor
                .quantizer()
                .probabilities_at(&nodes.x, g.sensor.noise_deviation());
            CountTable::from_probabilities(&p, g.count)
        };
        let tables: Vec<CountTable> = self.groups.iter().map(table_of).collect();
        let mut levels = vec![vec![0.0; nodes.len()]; tables.len() + 1];
        levels[0].copy_from_slice(&nodes.w);
        descend(&tables, &mut levels, 0, &mut visit);
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

    /// Number of sensors that report 1 in each group, for an index of [`Self::for_outcomes`].
    pub(crate) fn counts_at(&self, mut index: usize, counts: &mut Vec<usize>) {
        counts.clear();
        for g in self.groups.iter().rev() {
            counts.push(index % (g.count + 1));
            index /= g.count + 1;
        }
        counts.reverse();
    }
}

fn descend(tables: &[CountTable], levels: &mut [Vec<f64>], index: usize, visit: &mut impl FnMut(usize, &[f64])) {
    let Some((table, rest)) = tables.split_first() else {
        visit(index, &levels[0]);
        return;
    };
    for (k, row) in table.rows.iter().enumerate() {
        let (parent, below) = levels.split_at_mut(1);
        for ((child, w), p) in below[0].iter_mut().zip(&parent[0]).zip(row) {
            *child = w * p;
        }
        descend(rest, below, index * table.rows.len() + k, visit);
    }
}

/// `rows[k][i] = C(m, k) P1(x_i)^k P0(x_i)^(m-k)`.
pub struct CountTable {
    /// One row per count, one entry per node.
    pub rows: Vec<Vec<f64>>,
}

/// For larger groups the binomial probabilities are computed in logarithms, so that powers and coefficients do not overflow.
const LOG_COUNT: usize = 60;

impl CountTable {
    /// The table of `count` sensors whose bits have the probabilities `p` at the nodes.
    pub fn from_probabilities(p: &[[f64; 2]], count: usize) -> Self {
        // Row `k`: the probability that `k` of the sensors report 1.
        let log_choose = binomial::log_row(count);
        let rows = (0..=count)
            .map(|k| {
                let choose = log_choose[k].exp().round();
                p.iter()
                    .map(|&[p0, p1]| {
                        if count <= LOG_COUNT {
                            choose * p1.powi(k as i32) * p0.powi((count - k) as i32)
                        } else {
                            (log_choose[k] + times_log(k, p1) + times_log(count - k, p0)).exp()
                        }
                    })
                    .collect()
            })
            .collect();
        Self { rows }
    }
}

/// `n ln p` with `0 ln 0 = 0`.
fn times_log(n: usize, p: f64) -> f64 {
    if n == 0 { 0.0 } else { n as f64 * p.ln() }
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
        let mut counts = Vec::new();
        bank.counts_at(7, &mut counts);
        assert_eq!(counts, [2, 1]);
    }

    #[test]
    fn binomials_stay_exact_and_finite() {
        let p = [[0.75, 0.25], [0.0, 1.0], [1.0, 0.0]];
        for count in [3, 50, 60, 61, 3000] {
            let table = CountTable::from_probabilities(&p, count);
            for i in 0..p.len() {
                let sum: f64 = table.rows.iter().map(|row| row[i]).sum();
                assert_relative_eq!(sum, 1.0, max_relative = 1e-9);
            }
        }
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
