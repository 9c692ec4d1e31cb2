//! The posterior mean as a look-up table.

use crate::error::{Error, refuse};
use crate::law::{report_tables, symbol_tables};
use crate::observation_model::ObservationModel;
use crate::outcomes::{Table, for_each};
use crate::system::System;
use crate::table::Layout;
use fewbits_core::Observation;
use fewbits_numerics::error::entries;
use fewbits_quantizers::Symbol;

/// Posterior mean and variance of the unknown.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Estimate {
    /// `E[X | T = t]`, the estimate of least mean squared error.
    pub mean: f64,
    /// `var[X | T = t]`.
    pub variance: f64,
}

/// Look-up table of the posterior mean for every joint outcome. A look-up takes constant time.
///
/// Only the counts of symbols in a group matter, so nine identical sensors of four levels need 220 entries. If symbols of some
/// sensors are missing, the posterior given the others is computed at the quadrature nodes instead, in a time proportional to
/// the number of sensors.
///
/// ```
/// use fewbits_core::Observation;
/// use fewbits_quantizer_design::{Quantizer, ObservationModel, Symbol, System, decoder::MmseDecoder};
/// let system = System::identical(ObservationModel::gaussian_with_deviations(1.0, &[1.0; 9])?, Quantizer::symmetric(1.38)?)?;
/// let decoder = MmseDecoder::new(&system, 220)?;
/// let mut observations = [3, 2, 2, 3, 1, 2, 3, 2, 2].map(|t| Observation::Received(Symbol(t)));
/// let estimate = decoder.decode(&observations)?;
/// assert!((estimate.mean - 0.9).abs() < 0.1 && estimate.variance < 0.13);
/// observations[0] = Observation::Lost;
/// assert!(decoder.decode(&observations)?.variance > estimate.variance);
/// # Ok::<(), fewbits_quantizer_design::Error>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct MmseDecoder {
    system: System,
    layout: Layout,
    /// Probability, mean and variance of each outcome.
    entries: Vec<[f64; 3]>,
    /// Symbol probabilities at the nodes, for one sensor of each group.
    symbols: Vec<Table>,
}

impl MmseDecoder {
    /// Computes the posterior of every joint outcome, if there are at most `limit`.
    ///
    /// # Errors
    /// [`Error::TooLarge`] if there are more. Such systems can be decoded by a filter on the likelihoods.
    pub fn new(system: &System, limit: usize) -> Result<Self, Error> {
        Error::at_most("decoder", system.outcomes(), limit as u64)?;
        let model = system.model();
        let allowed = system
            .clone()
            .with_outcome_limit(system.outcome_limit().max(limit as u64));
        let mut entries = Vec::new();
        let visit = |_, product: &[f64]| entries.push(posterior(model, product));
        for_each(&report_tables(&allowed)?, &vec![1.0; model.nodes()], visit);
        Ok(Self {
            layout: Layout::new(system),
            system: system.clone(),
            entries,
            symbols: symbol_tables(system)?,
        })
    }

    /// The estimate of every joint outcome; `None` for an outcome of probability zero. The order is that of
    /// [`JointTable::outcome`](crate::table::JointTable::outcome): the first group varies slowest, and groups of one sensor are ordered by symbol.
    pub fn estimates(&self) -> impl ExactSizeIterator<Item = Option<Estimate>> + '_ {
        self.entries.iter().map(|entry| Self::estimate(*entry).ok())
    }

    /// The estimate from one observation per sensor. The sensors always report, so a missing report, like an erasure, carries no
    /// information about the unknown.
    ///
    /// # Errors
    /// [`Error::Argument`] if there is not one observation per sensor or a symbol is out of range; [`Error::ImpossibleOutcome`] if
    /// the outcome has probability 0 under the model. The caller should then keep its belief.
    pub fn decode(&self, observations: &[Observation<Symbol>]) -> Result<Estimate, Error> {
        let received: Vec<usize> = observations.iter().filter_map(|o| o.received().map(|s| s.0)).collect();
        if received.len() == observations.len() {
            return self.decode_symbols(&received);
        }
        let model = self.system.model();
        entries("observations", observations.len(), model.sensors())?;
        let mut product = vec![1.0; model.nodes()];
        for (group, symbols) in self.system.groups().iter().zip(&self.symbols) {
            for symbol in group.sensors.iter().filter_map(|n| observations[*n].received()) {
                if symbol.0 >= symbols.rows() {
                    return refuse("symbol", symbol.0, format!("a number below {}", symbols.rows()));
                }
                product.iter_mut().zip(symbols.row(symbol.0)).for_each(|(p, s)| *p *= s);
                // Normalised after each factor, since the product of many probabilities underflows.
                let largest = product.iter().copied().fold(0.0, f64::max);
                if largest > 0.0 {
                    product.iter_mut().for_each(|p| *p /= largest);
                }
            }
        }
        Self::estimate(posterior(model, &product))
    }

    /// The estimate if symbol `symbols[n]` was received from sensor `n`.
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

/// Probability, posterior mean and variance from the likelihood at the nodes, computed as sums of positive terms.
fn posterior(model: &ObservationModel, likelihood: &[f64]) -> [f64; 3] {
    let given: Vec<f64> = model.given.iter().map(|feature| feature.of(likelihood)).collect();
    let terms = || model.weights.iter().zip(&given).zip(&model.values);
    let mass: f64 = terms().map(|((w, q), _)| w * q).sum();
    if mass <= 0.0 {
        return [0.0, model.mean, model.variance];
    }
    let off = terms().map(|((w, q), x)| w * q * (x - model.mean)).sum::<f64>() / mass;
    let mean = model.mean + off;
    let spread = |x: f64| (x - model.mean - off) * (x - model.mean - off);
    [
        mass,
        mean,
        terms().map(|((w, q), x)| w * q * spread(*x)).sum::<f64>() / mass,
    ]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Criterion, Noise, ObservationModel, Prior, Quantizer};

    #[test]
    fn the_table_attains_the_mean_squared_error() {
        let model = ObservationModel::gaussian_with_deviations(1.0, &[1.0, 0.7]).unwrap();
        let q = Quantizer::symmetric(1.2).unwrap();
        let system = System::ideal(model, vec![q.clone(), q]).unwrap();
        let decoder = MmseDecoder::new(&system, 16).unwrap();
        let mean_variance: f64 = decoder.entries.iter().map(|e| e[0] * e[2]).sum();
        assert!((mean_variance - system.value(Criterion::MeanSquaredError).unwrap()).abs() < 1e-13);
        let mirrored = decoder.decode_symbols(&[0, 0]).unwrap().mean + decoder.decode_symbols(&[3, 3]).unwrap().mean;
        assert!(mirrored.abs() < 1e-14);
        let listed: Vec<_> = decoder.estimates().collect();
        assert_eq!(listed[4 + 2], Some(decoder.decode_symbols(&[1, 2]).unwrap()));
        assert!(decoder.decode_symbols(&[0]).is_err());
        assert!(decoder.decode_symbols(&[0, 4]).is_err());
        assert!(matches!(MmseDecoder::new(&system, 15), Err(Error::TooLarge { needed: 16, .. })));
    }

    /// Marginalising a sensor over what it may have sent, by the table itself.
    #[test]
    fn an_erased_symbol_leaves_the_posterior_of_the_others() {
        for rho in [0.0, 0.5] {
            let noise = Noise::equicorrelated_with_deviations(&[1.0; 3], rho).unwrap();
            let model = ObservationModel::new(Prior::normal(0.0, 1.0).unwrap(), noise).unwrap();
            let q = Quantizer::symmetric(1.2).unwrap();
            let system = System::identical(model.clone(), q.clone()).unwrap();
            let decoder = MmseDecoder::new(&system, 20).unwrap();
            let others = System::identical(model.subset(&[0, 1]).unwrap(), q).unwrap();
            let exact = MmseDecoder::new(&others, 10).unwrap().decode_symbols(&[3, 1]).unwrap();
            for missing in [Observation::Lost, Observation::Nothing] {
                let seen = [
                    Observation::Received(Symbol(3)),
                    missing,
                    Observation::Received(Symbol(1)),
                ];
                let found = decoder.decode(&seen).unwrap();
                assert!((found.mean - exact.mean).abs() < 1e-12 && (found.variance - exact.variance).abs() < 1e-12);
                assert!(decoder.decode(&seen[..2]).is_err());
            }
            let nothing = decoder.decode(&[Observation::Lost; 3]).unwrap();
            assert!(nothing.mean.abs() < 1e-13 && (nothing.variance - 1.0).abs() < 1e-12);
            let bad = [Observation::Received(Symbol(4)), Observation::Lost, Observation::Lost];
            assert!(decoder.decode(&bad).is_err());
        }
    }

    /// Moments about the prior mean: an offset of the unknown costs no digit.
    #[test]
    fn an_offset_prior_has_the_error_of_one_at_zero() {
        let model = |m: f64| {
            let prior = Prior::discrete(vec![m, m + 1.0], vec![0.5, 0.5]).unwrap();
            ObservationModel::new(prior, Noise::independent_with_deviations(&[1.0]).unwrap()).unwrap()
        };
        let system = |m: f64| System::ideal(model(m), vec![Quantizer::new(vec![m + 0.5]).unwrap()]).unwrap();
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
}
