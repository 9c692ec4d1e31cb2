//! The gain of each level for a sample, for fixed other sensors and a fixed decoder.
//!
//! For fixed scores of the decoder every criterion is linear in the sensor's decisions. The best level for a sample `y`
//! is then the one with the largest of a few functions `D_z(y)`. The alternating algorithm uses this.

use crate::criterion::{Criterion, LOG_FLOOR};
use crate::error::{Error, refuse};
use crate::moments::Table;
use crate::observation_model::ObservationModel;
use crate::system::{SensorGroup, System};
use fewbits_quantizers::Channel;

/// Stands for the logarithm of probability zero. It is finite, so that a weight of zero removes it.
const LOG_IMPOSSIBLE: f64 = -1e12;

/// The group if it is a single sensor.
pub(super) fn single_sensor(system: &System, group: usize) -> Result<&SensorGroup, Error> {
    let entry = system.group(group)?;
    match entry.sensors().len() {
        1 => Ok(entry),
        n => refuse("group", format!("{n} sensors"), "a group of a single sensor"),
    }
}

/// `lambda_z(node) = sum_k w_k P(node | x_k) sum_t' P(t' | node) sum_t C[t, z] score(t', t, x_k)`, levels by nodes.
///
/// `others` holds the joint report probabilities of the other sensors, one row per report. The score is `ln p(t', t | x) / p(t', t)`, or
/// minus the squared error of the posterior mean, or minus one for a wrong decision. It is computed from `log_likelihood(i)` of the outcome
/// `i = other * outputs + symbol`, one number per value of the unknown. Probabilities may underflow; their logarithms must not.
pub(super) fn level_gains<'a>(
    model: &ObservationModel,
    criterion: Criterion,
    others: &Table,
    channel: &Channel,
    log_likelihood: impl Fn(usize) -> &'a [f64],
) -> Table {
    let (nodes, values) = (model.nodes(), model.values.len());
    let mut per_symbol = vec![0.0; channel.outputs() * nodes];
    let mut score = vec![0.0; values];
    for at in 0..others.rows() * channel.outputs() {
        let (other, symbol) = (at / channel.outputs(), at % channel.outputs());
        scores(model, criterion, log_likelihood(at), &mut score);
        let reports = others.row(other);
        let out = &mut per_symbol[symbol * nodes..(symbol + 1) * nodes];
        for ((feature, w), s) in model.given.iter().zip(&model.weights).zip(&score) {
            let factor = w * s;
            for (i, p) in feature.weights.iter().enumerate() {
                out[feature.start + i] += factor * p * reports[feature.start + i];
            }
        }
    }
    // The gain of a level is the mean gain of the symbols into which the channel turns it.
    let mut gains = vec![0.0; channel.inputs() * nodes];
    for (z, row) in gains.chunks_exact_mut(nodes).enumerate() {
        for (t, symbol) in per_symbol.chunks_exact(nodes).enumerate() {
            let c = channel.probability(t, z);
            if c != 0.0 {
                row.iter_mut().zip(symbol).for_each(|(r, s)| *r += c * s);
            }
        }
    }
    Table::new(gains, nodes)
}

/// Score of the decoder for one outcome, for each value of the unknown.
fn scores(model: &ObservationModel, criterion: Criterion, log_likelihood: &[f64], out: &mut [f64]) {
    // Relative to the most likely value, so that the largest number is 1.
    let largest = log_likelihood.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        // An outcome that has probability zero for all values.
        out.fill(0.0);
        return;
    }
    let relative = |l: &f64| (l - largest).exp();
    let total: f64 = model
        .weights
        .iter()
        .zip(log_likelihood)
        .map(|(w, l)| w * relative(l))
        .sum();
    match criterion {
        Criterion::MutualInformation => {
            let log_total = largest + total.max(LOG_FLOOR).ln();
            for (o, l) in out.iter_mut().zip(log_likelihood) {
                *o = (l - log_total).max(LOG_IMPOSSIBLE);
            }
        }
        Criterion::MeanSquaredError => {
            let terms = model.weights.iter().zip(&model.values).zip(log_likelihood);
            let moment: f64 = terms.map(|((w, x), l)| w * (x - model.mean) * relative(l)).sum();
            let mean = model.mean + if total > 0.0 { moment / total } else { 0.0 };
            for (o, x) in out.iter_mut().zip(&model.values) {
                *o = -(x - mean) * (x - mean);
            }
        }
        Criterion::BayesError => {
            let joint = |k: usize| model.weights[k].ln() + log_likelihood[k];
            let best = (1..out.len()).fold(0, |best, k| if joint(k) > joint(best) { k } else { best });
            for (k, o) in out.iter_mut().enumerate() {
                *o = if k == best { 0.0 } else { -1.0 };
            }
        }
    }
}
