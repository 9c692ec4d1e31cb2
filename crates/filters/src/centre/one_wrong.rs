//! Reports of which one is wrong, and nothing says which.

use crate::Error;
use fewbits_core::{Columns, Evidence, Gaussian, Likelihood};
use nalgebra::{SMatrix, SVector};

/// The likelihood of reports of which one is wrong, each of them with the same probability.
///
/// ```text
/// p(all | x) = 1/n sum_k  p(report k | wrong) prod_{j != k} p(report j | x)
/// ```
/// A single report is wrong with probability one half.
pub(super) struct OneIsWrong<'a, const D: usize> {
    /// Each report, and `ln p` of it if it is wrong: the same for every state.
    parts: Vec<(&'a dyn Likelihood<D>, f64)>,
}

impl<'a, const D: usize> OneIsWrong<'a, D> {
    pub(crate) fn new(parts: Vec<(&'a dyn Likelihood<D>, f64)>) -> Self {
        Self { parts }
    }

    /// One hypothesis for each part, which is then wrong; of a single part also that it is right.
    fn hypotheses(&self) -> impl Iterator<Item = Option<usize>> + Clone + '_ {
        let right = (self.parts.len() == 1).then_some(None);
        (0..self.parts.len()).map(Some).chain(right)
    }

    fn count(&self) -> f64 {
        self.parts.len().max(2) as f64
    }

    /// Log likelihood, from that of each part if it is right.
    fn log_of(&self, right: impl Fn(usize) -> f64) -> f64 {
        let parts = 0..self.parts.len();
        if parts.clone().any(|k| right(k).is_nan()) {
            return f64::NAN;
        }
        let log = |wrong: Option<usize>, k: usize| if wrong == Some(k) { self.parts[k].1 } else { right(k) };
        let of = |wrong| parts.clone().map(|k| log(wrong, k)).sum::<f64>();
        log_sum(self.hypotheses().map(of)) - self.count().ln()
    }
}

/// `ln sum exp` of terms that may be `-inf`.
pub(super) fn log_sum(terms: impl Iterator<Item = f64> + Clone) -> f64 {
    let highest = terms.clone().fold(f64::NEG_INFINITY, f64::max);
    if highest.is_finite() {
        highest + terms.map(|term| (term - highest).exp()).sum::<f64>().ln()
    } else {
        highest
    }
}

impl<const D: usize> Likelihood<D> for OneIsWrong<'_, D> {
    fn log_likelihood(&self, state: &SVector<f64, D>) -> f64 {
        let right: Vec<f64> = self.parts.iter().map(|(part, _)| part.log_likelihood(state)).collect();
        self.log_of(|k| right[k])
    }

    fn add_log_likelihoods(&self, states: Columns<'_, D>, log_weights: &mut [f64]) {
        if !fewbits_core::columns::lengths_agree(&states, log_weights) {
            return;
        }
        let sweep = |part: &dyn Likelihood<D>| {
            let mut logs = vec![0.0; log_weights.len()];
            part.add_log_likelihoods(states, &mut logs);
            logs
        };
        let right: Vec<Vec<f64>> = self.parts.iter().map(|(part, _)| sweep(*part)).collect();
        for (i, log_weight) in log_weights.iter_mut().enumerate() {
            *log_weight += self.log_of(|k| right[k][i]);
        }
    }

    fn condition(&self, belief: &mut Gaussian<D>) -> Result<Evidence, Error> {
        // The posterior of each hypothesis, and its evidence.
        let mut found: Vec<(Gaussian<D>, f64)> = Vec::new();
        for wrong in self.hypotheses() {
            let (mut posterior, mut log) = (*belief, 0.0);
            let possible = self.parts.iter().enumerate().try_for_each(|(k, (part, log_wrong))| {
                log += if wrong == Some(k) {
                    *log_wrong
                } else {
                    part.condition(&mut posterior)?.log_likelihood
                };
                Ok::<(), Error>(())
            });
            if possible.is_ok() && log.is_finite() {
                found.push((posterior, log));
            }
        }
        let total = log_sum(found.iter().map(|(_, log)| *log));
        if !total.is_finite() {
            return Err(Error::Impossible);
        }
        let weighted = || found.iter().map(|(posterior, log)| ((log - total).exp(), posterior));
        let mean: SVector<f64, D> = weighted().map(|(weight, posterior)| posterior.mean() * weight).sum();
        let spread = |(weight, posterior): (f64, &Gaussian<D>)| {
            let off = posterior.mean() - mean;
            (posterior.covariance() + off * off.transpose()) * weight
        };
        let covariance: SMatrix<f64, D, D> = weighted().map(spread).sum();
        let correction = (mean - belief.mean()).iter().next().copied().unwrap_or(0.0);
        *belief = Gaussian::from_trusted_parts(mean, covariance);
        Ok(Evidence {
            log_likelihood: total - self.count().ln(),
            correction,
        })
    }

    fn reads(&self, state: &SVector<f64, D>, axis: usize) -> bool {
        self.parts.iter().any(|(part, _)| part.reads(state, axis))
    }
}
