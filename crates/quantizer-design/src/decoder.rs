//! What the fusion centre does with the symbols: estimate, decide, or test.

use crate::error::{Error, refuse};
use crate::law::{Active, Reports, log_likelihoods};
use crate::moments::{Table, dot};
use crate::scene::{Feature, Scene};
use crate::system::System;
use crate::table::{JointTable, Layout};
use fewbits_core::Observation;
use fewbits_quantizers::Symbol;
use serde::{Deserialize, Serialize};

/// Most numbers (outcomes times values of the unknown) that a decoder tabulates on the way to its entries.
const ENTRY_LIMIT: u64 = 1 << 25;

/// Posterior mean and variance of the unknown.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Estimate {
    /// `E[X | T = t]`, the estimate of least mean squared error.
    pub mean: f64,
    /// `var[X | T = t]`.
    pub variance: f64,
}

/// Look-up table of the posterior mean: exact, constant time, bounded in size.
///
/// Sensors of a group are counted, not told apart, so nine identical sensors of four levels take 220 entries. Where some
/// sensors' symbols are missing, the posterior given the others is computed at the nodes instead, in a time proportional to
/// the number of sensors.
///
/// ```
/// use fewbits_core::Observation;
/// use fewbits_quantizer_design::{Quantizer, Scene, Symbol, System, decoder::MmseDecoder};
/// let system = System::identical(Scene::gaussian_with_deviations(1.0, &[1.0; 9])?, Quantizer::symmetric(1.38)?)?;
/// let decoder = MmseDecoder::new(&system, 220)?;
/// let mut observations = [3, 2, 2, 3, 1, 2, 3, 2, 2].map(|t| Observation::Received(Symbol(t)));
/// let estimate = decoder.decode(&observations)?;
/// assert!((estimate.mean - 0.9).abs() < 0.1 && estimate.variance < 0.13);
/// observations[0] = Observation::Erased;
/// assert!(decoder.decode(&observations)?.variance > estimate.variance);
/// # Ok::<(), fewbits_quantizer_design::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredDecoder", into = "StoredDecoder")]
pub struct MmseDecoder {
    system: System,
    limit: usize,
    layout: Layout,
    /// Probability, mean and variance of each outcome.
    entries: Vec<[f64; 3]>,
    /// Symbol probabilities of a sensor of each group at the nodes.
    symbols: Vec<Table>,
}

/// The stored form: the system; the entries are computed again.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredDecoder {
    system: System,
    limit: usize,
}

impl From<MmseDecoder> for StoredDecoder {
    fn from(decoder: MmseDecoder) -> Self {
        Self {
            system: decoder.system,
            limit: decoder.limit,
        }
    }
}

impl TryFrom<StoredDecoder> for MmseDecoder {
    type Error = Error;

    fn try_from(stored: StoredDecoder) -> Result<Self, Error> {
        Self::new(&stored.system, stored.limit)
    }
}

impl MmseDecoder {
    /// Tabulates the posterior of every joint outcome, at most `limit` of them.
    ///
    /// # Errors
    /// [`Error::TooLarge`] beyond `limit`: decode such systems by a filter on the likelihoods instead.
    pub fn new(system: &System, limit: usize) -> Result<Self, Error> {
        if system.outcomes() > limit as u64 {
            return Err(Error::TooLarge {
                table: "decoder",
                needed: system.outcomes(),
                limit: limit as u64,
            });
        }
        let scene = system.scene();
        let allowed = system
            .clone()
            .with_outcome_limit(system.outcome_limit().max(limit as u64));
        let reports = Reports::of(&allowed)?;
        let needed = system.outcomes().saturating_mul(scene.values().len() as u64);
        let entries = if needed <= ENTRY_LIMIT {
            let likelihood = reports.moments(&scene.given);
            likelihood
                .chunks_exact(scene.values().len())
                .map(|q| posterior(scene, q))
                .collect()
        } else {
            Self::entries_by_moments(scene, &reports)
        };
        let symbols = (0..system.groups().len())
            .map(|g| {
                let entry = Active::new(system, g)?;
                Ok(Table::new(entry.symbols(entry.group.quantizer().breakpoints()), scene.nodes()))
            })
            .collect::<Result<_, Error>>()?;
        Ok(Self {
            layout: Layout::new(system),
            system: system.clone(),
            limit,
            entries,
            symbols,
        })
    }

    /// Variances as differences of moments about the prior mean, for tables too large to hold all likelihoods.
    fn entries_by_moments(scene: &Scene, reports: &Reports) -> Vec<[f64; 3]> {
        let mut square = vec![0.0; scene.nodes()];
        for ((given, w), x) in scene.given.iter().zip(&scene.weights).zip(&scene.values) {
            for (i, p) in given.weights.iter().enumerate() {
                square[given.start + i] += w * (x - scene.mean) * (x - scene.mean) * p;
            }
        }
        let square = Feature {
            start: 0,
            weights: square,
        };
        let features = [scene.mass.clone(), scene.moment.clone(), square];
        let entry = |m: &[f64]| {
            if m[0] > 0.0 {
                let off = m[1] / m[0];
                [m[0], scene.mean + off, (m[2] / m[0] - off * off).max(0.0)]
            } else {
                [0.0, scene.mean, scene.variance]
            }
        };
        reports.moments(&features).chunks_exact(3).map(entry).collect()
    }

    /// The system whose symbols are decoded.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// Number of entries.
    pub fn len(&self) -> usize {
        self.entries.len()
    }

    /// Whether there is no entry; never so.
    pub fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// The estimate from one observation per sensor. These sensors always report, so that nothing received, like an erasure, says
    /// nothing about the unknown.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one observation per sensor or a symbol is out of range; [`Error::ImpossibleOutcome`] if
    /// the outcome has probability 0 under the model, in which case the caller's belief should stand.
    pub fn decode(&self, observations: &[Observation<Symbol>]) -> Result<Estimate, Error> {
        let received: Vec<usize> = observations.iter().filter_map(|o| o.received().map(|s| s.0)).collect();
        if received.len() == observations.len() {
            return self.decode_symbols(&received);
        }
        let scene = self.system.scene();
        if observations.len() != scene.sensors() {
            let given = format!("{} observations", observations.len());
            return refuse("observations", given, format!("one per sensor, {}", scene.sensors()));
        }
        let mut product = vec![1.0; scene.nodes()];
        for (group, symbols) in self.system.groups().iter().zip(&self.symbols) {
            for symbol in group.sensors().iter().filter_map(|n| observations[*n].received()) {
                if symbol.0 >= symbols.rows() {
                    return refuse("symbol", symbol.0, format!("a number below {}", symbols.rows()));
                }
                product.iter_mut().zip(symbols.row(symbol.0)).for_each(|(p, s)| *p *= s);
                let largest = product.iter().copied().fold(0.0, f64::max);
                if largest > 0.0 {
                    product.iter_mut().for_each(|p| *p /= largest);
                }
            }
        }
        let q: Vec<f64> = scene
            .given
            .iter()
            .map(|f| dot(&f.weights, &product[f.start..f.start + f.weights.len()]))
            .collect();
        Self::estimate(posterior(scene, &q))
    }

    /// The estimate when symbol `symbols[n]` was received from sensor `n`.
    ///
    /// # Errors
    /// As [`MmseDecoder::decode`].
    pub fn decode_symbols(&self, symbols: &[usize]) -> Result<Estimate, Error> {
        Self::estimate(self.entries[self.layout.index(symbols)?])
    }

    fn estimate([probability, mean, variance]: [f64; 3]) -> Result<Estimate, Error> {
        if probability > 0.0 {
            Ok(Estimate { mean, variance })
        } else {
            Err(Error::ImpossibleOutcome)
        }
    }
}

/// Probability, posterior mean and variance from the likelihoods of the values, all sums of positive terms.
fn posterior(scene: &Scene, likelihood: &[f64]) -> [f64; 3] {
    let terms = || scene.weights.iter().zip(likelihood).zip(&scene.values);
    let mass: f64 = terms().map(|((w, q), _)| w * q).sum();
    if mass <= 0.0 {
        return [0.0, scene.mean, scene.variance];
    }
    let off = terms().map(|((w, q), x)| w * q * (x - scene.mean)).sum::<f64>() / mass;
    let mean = scene.mean + off;
    let spread = |x: f64| (x - scene.mean - off) * (x - scene.mean - off);
    [
        mass,
        mean,
        terms().map(|((w, q), x)| w * q * spread(*x)).sum::<f64>() / mass,
    ]
}

/// The randomised Neyman-Pearson test between two values of the unknown on the joint outcome.
///
/// Outcomes are accepted for the second value in decreasing order of their likelihood ratio until the false-alarm budget is
/// spent; the outcome on which it runs out is accepted with a probability.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredTest", into = "StoredTest")]
pub struct NeymanPearson {
    table: JointTable,
    false_alarm: f64,
    /// Probability of accepting the second value, an outcome.
    acceptance: Vec<f64>,
    detection: f64,
}

/// The stored form of a test; its table is computed again.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredTest {
    system: System,
    false_alarm: f64,
}

impl From<NeymanPearson> for StoredTest {
    fn from(test: NeymanPearson) -> Self {
        Self {
            system: test.table.system().clone(),
            false_alarm: test.false_alarm,
        }
    }
}

impl TryFrom<StoredTest> for NeymanPearson {
    type Error = Error;

    fn try_from(stored: StoredTest) -> Result<Self, Error> {
        Self::new(&stored.system, stored.false_alarm)
    }
}

impl NeymanPearson {
    /// The most powerful test of the second value of the prior against the first with false-alarm probability `false_alarm`.
    ///
    /// # Errors
    /// Unless the prior has exactly two values and `false_alarm` is inside (0, 1); [`Error::TooLarge`] as [`JointTable::new`].
    pub fn new(system: &System, false_alarm: f64) -> Result<Self, Error> {
        if !(false_alarm > 0.0 && false_alarm < 1.0) {
            return refuse("false_alarm", false_alarm, "a probability inside (0, 1)");
        }
        if !system.scene().is_discrete() || system.scene().values().len() != 2 {
            return refuse("prior", "not two hypotheses", "a discrete prior on two values");
        }
        let table = JointTable::new(system)?;
        // ln P1 - ln P0: a key of each outcome, so a total order, and finite where the probabilities underflow.
        let logs = log_likelihoods(system)?;
        let key = |outcome: usize| logs[2 * outcome + 1] - logs[2 * outcome];
        let mut order: Vec<usize> = (0..table.outcomes()).filter(|t| !key(*t).is_nan()).collect();
        order.sort_by(|a, b| key(*b).total_cmp(&key(*a)));
        let (mut acceptance, mut left, mut detection) = (vec![0.0; table.outcomes()], false_alarm, 0.0);
        for outcome in order {
            let (p0, p1) = (logs[2 * outcome].exp(), logs[2 * outcome + 1].exp());
            let share = if p0 <= left { 1.0 } else { left / p0 };
            acceptance[outcome] = share;
            detection += share * p1;
            left -= share * p0;
            if share < 1.0 {
                break;
            }
        }
        Ok(Self {
            table,
            false_alarm,
            acceptance,
            detection: detection.min(1.0),
        })
    }

    /// Probability of accepting the second value when it is true.
    pub fn detection_probability(&self) -> f64 {
        self.detection
    }

    /// Probability with which to accept the second value given one observation per sensor: 0 or 1 but for one outcome.
    ///
    /// Where symbols are missing (these sensors always report, so that nothing received says no more than an erasure) it is that
    /// of the most powerful test on the sensors that are left, of the same false-alarm probability, which is made anew.
    ///
    /// # Errors
    /// If there is not one observation per sensor, or a symbol is out of range.
    pub fn acceptance(&self, observations: &[Observation<Symbol>]) -> Result<f64, Error> {
        let system = self.table.system();
        if observations.len() != system.scene().sensors() {
            let given = format!("{} observations", observations.len());
            return refuse("observations", given, format!("one per sensor, {}", system.scene().sensors()));
        }
        let symbols: Vec<usize> = observations.iter().filter_map(|o| o.received().map(|s| s.0)).collect();
        if symbols.is_empty() {
            return Ok(self.false_alarm);
        }
        if symbols.len() == observations.len() {
            return Ok(self.acceptance[self.table.outcome(&symbols)?]);
        }
        let received: Vec<usize> = (0..observations.len())
            .filter(|n| observations[*n].received().is_some())
            .collect();
        let test = Self::new(&system.subset(&received)?, self.false_alarm)?;
        Ok(test.acceptance[test.table.outcome(&symbols)?])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Criterion, Prior, Quantizer, Scene, scene::Noise};

    #[test]
    fn the_table_attains_the_mean_squared_error() {
        let scene = Scene::gaussian_with_deviations(1.0, &[1.0, 0.7]).unwrap();
        let q = Quantizer::symmetric(1.2).unwrap();
        let system = System::ideal(scene, vec![q.clone(), q]).unwrap();
        let decoder = MmseDecoder::new(&system, 16).unwrap();
        let mean_variance: f64 = decoder.entries.iter().map(|e| e[0] * e[2]).sum();
        assert!((mean_variance - system.value(Criterion::MeanSquaredError).unwrap()).abs() < 1e-13);
        let mirrored = decoder.decode_symbols(&[0, 0]).unwrap().mean + decoder.decode_symbols(&[3, 3]).unwrap().mean;
        assert!(mirrored.abs() < 1e-14);
        assert!(decoder.decode_symbols(&[0]).is_err());
        assert!(decoder.decode_symbols(&[0, 4]).is_err());
        let json = serde_json::to_string(&decoder).unwrap();
        assert_eq!(serde_json::from_str::<MmseDecoder>(&json).unwrap(), decoder);
        assert!(matches!(MmseDecoder::new(&system, 15), Err(Error::TooLarge { needed: 16, .. })));
    }

    /// Marginalising a sensor over what it may have sent, by the table itself.
    #[test]
    fn an_erased_symbol_leaves_the_posterior_of_the_others() {
        for rho in [0.0, 0.5] {
            let noise = Noise::equicorrelated_with_deviations(&[1.0; 3], rho).unwrap();
            let scene = Scene::new(Prior::gaussian_with_deviation(1.0).unwrap(), noise).unwrap();
            let q = Quantizer::symmetric(1.2).unwrap();
            let system = System::identical(scene.clone(), q.clone()).unwrap();
            let decoder = MmseDecoder::new(&system, 20).unwrap();
            let others = System::identical(scene.subset(&[0, 1]).unwrap(), q).unwrap();
            let exact = MmseDecoder::new(&others, 10).unwrap().decode_symbols(&[3, 1]).unwrap();
            for missing in [Observation::Erased, Observation::Nothing] {
                let seen = [
                    Observation::Received(Symbol(3)),
                    missing,
                    Observation::Received(Symbol(1)),
                ];
                let found = decoder.decode(&seen).unwrap();
                assert!((found.mean - exact.mean).abs() < 1e-12 && (found.variance - exact.variance).abs() < 1e-12);
                assert!(decoder.decode(&seen[..2]).is_err());
            }
            let nothing = decoder.decode(&[Observation::Erased; 3]).unwrap();
            assert!(nothing.mean.abs() < 1e-13 && (nothing.variance - 1.0).abs() < 1e-12);
            let bad = [
                Observation::Received(Symbol(4)),
                Observation::Erased,
                Observation::Erased,
            ];
            assert!(decoder.decode(&bad).is_err());
        }
    }

    /// Moments about the prior mean: an offset of the unknown costs no digit.
    #[test]
    fn an_offset_prior_has_the_error_of_one_at_zero() {
        let scene = |m: f64| {
            let prior = Prior::discrete(vec![m, m + 1.0], vec![0.5, 0.5]).unwrap();
            Scene::new(prior, Noise::independent_with_deviations(&[1.0]).unwrap()).unwrap()
        };
        let system = |m: f64| System::ideal(scene(m), vec![Quantizer::new(vec![m + 0.5]).unwrap()]).unwrap();
        let exact = system(0.0).value(Criterion::MeanSquaredError).unwrap();
        assert!((exact - 0.213_342).abs() < 1e-6);
        for m in [1e3, 1e7, -1e9] {
            let moved = system(m);
            assert!((moved.value(Criterion::MeanSquaredError).unwrap() - exact).abs() < 1e-13);
            let decoder = MmseDecoder::new(&moved, 2).unwrap();
            let here = MmseDecoder::new(&system(0.0), 2).unwrap();
            for t in 0..2 {
                let (a, b) = (decoder.decode_symbols(&[t]).unwrap(), here.decode_symbols(&[t]).unwrap());
                assert!((a.variance - b.variance).abs() < 1e-13 && (a.mean - m - b.mean).abs() <= 1e-15 * m.abs());
            }
        }
    }

    #[test]
    fn likelihood_ratios_are_ordered_by_their_logarithms() {
        let five = |signal: f64, sensors: usize, b: Vec<f64>| {
            let noise = Noise::independent_with_deviations(&vec![1.0; sensors]).unwrap();
            let scene = Scene::new(Prior::binary(signal, 0.5).unwrap(), noise).unwrap();
            System::identical(scene, Quantizer::new(b).unwrap()).unwrap()
        };
        // Products of probabilities are no total order here.
        let b: Vec<f64> = (1..8).map(|i| 4.0 * f64::from(i) / 8.0).collect();
        let test = NeymanPearson::new(&five(4.0, 5, b), 1e-3).unwrap();
        assert!(test.detection_probability() > 0.99 && test.detection_probability() <= 1.0);
        // And underflow here.
        let far = five(40.0, 3, vec![10.0, 20.0, 30.0]);
        let test = NeymanPearson::new(&far, 0.01).unwrap();
        assert!((test.detection_probability() - 1.0).abs() < 1e-12);
        let all = |t: usize| [Observation::Received(Symbol(t)); 3];
        assert_eq!(test.acceptance(&all(3)).unwrap(), 1.0);
        assert!(test.acceptance(&all(0)).unwrap() < 0.011);
    }

    #[test]
    fn the_test_spends_its_budget_exactly() {
        let scene =
            Scene::new(Prior::binary(2.0, 0.5).unwrap(), Noise::independent_with_deviations(&[1.0; 3]).unwrap())
                .unwrap();
        let system = System::identical(scene, Quantizer::new(vec![0.0, 1.0, 2.0]).unwrap()).unwrap();
        let mut last: f64 = 0.0;
        for alpha in [1e-6, 0.01, 0.3, 0.9] {
            let test = NeymanPearson::new(&system, alpha).unwrap();
            let spent: f64 = (0..test.table.outcomes())
                .map(|t| test.acceptance[t] * test.table.likelihood(t)[0])
                .sum();
            assert!((spent - alpha).abs() < 1e-14);
            assert!(test.detection_probability() > last.max(alpha));
            last = test.detection_probability();
        }
        // Averaged over what the first and the last sensor report, the test without the second spends the same.
        let test = NeymanPearson::new(&system, 0.3).unwrap();
        let given = system.symbol_distributions_given_values(0).unwrap();
        let received = |t: usize| Observation::Received(Symbol(t));
        let mut spent = 0.0;
        for a in 0..4 {
            for b in 0..4 {
                let accepted = test
                    .acceptance(&[received(a), Observation::Erased, received(b)])
                    .unwrap();
                spent += given[0][a] * given[0][b] * accepted;
            }
        }
        assert!((spent - 0.3).abs() < 1e-13);
        assert_eq!(test.acceptance(&[Observation::Nothing; 3]).unwrap(), 0.3);
        assert!(test.acceptance(&[Observation::Erased; 2]).is_err());
        let json = serde_json::to_string(&test).unwrap();
        assert_eq!(serde_json::from_str::<NeymanPearson>(&json).unwrap(), test);
        assert!(
            serde_json::from_str::<NeymanPearson>(&json.replace("\"false_alarm\":0.3", "\"false_alarm\":1.3")).is_err()
        );
        let json = serde_json::to_string(&test.table).unwrap();
        assert_eq!(serde_json::from_str::<JointTable>(&json).unwrap(), test.table);
        assert!(NeymanPearson::new(&system, 0.0).is_err());
        assert!(NeymanPearson::new(&system, 1.0).is_err());
    }

    #[test]
    fn equivocation_and_information_make_up_the_prior_entropy() {
        let scene =
            Scene::new(Prior::binary(1.0, 0.3).unwrap(), Noise::independent_with_deviations(&[1.0; 3]).unwrap())
                .unwrap();
        let system = System::identical(scene, Quantizer::new(vec![0.5]).unwrap()).unwrap();
        let table = JointTable::new(&system).unwrap();
        let entropy = -(0.3 * f64::ln(0.3) + 0.7 * f64::ln(0.7));
        let sum = table.equivocation().unwrap() + system.value(Criterion::MutualInformation).unwrap();
        assert!((sum - entropy).abs() < 1e-14);
        assert_eq!(table.outcome(&[0, 1, 0]), table.outcome(&[1, 0, 0]));
        assert_eq!(table.multiplicity(table.outcome(&[0, 1, 0]).unwrap()), 3.0);
    }
}
