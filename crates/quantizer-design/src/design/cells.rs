//! What it is worth to report a sample as one level or another, the other sensors and the decoder being as they are.
//!
//! With the decoder's scores held fixed every criterion is linear in the sensor's decisions, so the best level at a sample `y`
//! is the largest of a few functions `D_z(y)`. Both the alternating algorithm and the search for non-contiguous cells rest on
//! this.

use crate::criterion::{Criterion, LOG_FLOOR};
use crate::moments::{Table, moments};
use crate::error::{Error, refuse};
use crate::scene::Scene;
use crate::system::{SensorGroup, System};
use fewbits_quantizers::Channel;

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
/// `others` holds the joint report probabilities of the other sensors and `symbols` this sensor's, both a row per report. The
/// score is `ln p(t', t | x) / p(t', t)`, minus the squared error of the posterior mean, or minus one for a wrong decision.
pub(crate) fn level_gains(
    scene: &Scene,
    criterion: Criterion,
    others: &Table,
    symbols: &Table,
    channel: &Channel,
) -> Table {
    let (nodes, values) = (scene.nodes(), scene.values.len());
    let likelihood = moments(&[others, symbols], &scene.given);
    let mut per_symbol = vec![0.0; channel.outputs() * nodes];
    let mut score = vec![0.0; values];
    for (at, q) in likelihood.chunks_exact(values).enumerate() {
        let (other, symbol) = (at / channel.outputs(), at % channel.outputs());
        scores(scene, criterion, q, &mut score);
        let reports = others.row(other);
        let out = &mut per_symbol[symbol * nodes..(symbol + 1) * nodes];
        for ((feature, w), s) in scene.given.iter().zip(&scene.weights).zip(&score) {
            let factor = w * s;
            for (i, p) in feature.weights.iter().enumerate() {
                out[feature.start + i] += factor * p * reports[feature.start + i];
            }
        }
    }
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

fn scores(scene: &Scene, criterion: Criterion, q: &[f64], out: &mut [f64]) {
    let total: f64 = scene.weights.iter().zip(q).map(|(w, q)| w * q).sum();
    match criterion {
        Criterion::MutualInformation => {
            for (o, q) in out.iter_mut().zip(q) {
                *o = (q.max(LOG_FLOOR) / total.max(LOG_FLOOR)).ln();
            }
        }
        Criterion::MeanSquaredError => {
            let moment: f64 = scene
                .weights
                .iter()
                .zip(&scene.values)
                .zip(q)
                .map(|((w, x), q)| w * (x - scene.mean) * q)
                .sum();
            let mean = scene.mean + if total > 0.0 { moment / total } else { 0.0 };
            for (o, x) in out.iter_mut().zip(&scene.values) {
                *o = -(x - mean) * (x - mean);
            }
        }
        Criterion::BayesError => {
            let best = crate::criterion::most_probable(&scene.weights, q);
            for (k, o) in out.iter_mut().enumerate() {
                *o = if k == best { 0.0 } else { -1.0 };
            }
        }
    }
}
