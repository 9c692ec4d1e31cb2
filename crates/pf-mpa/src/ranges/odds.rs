//! The hypotheses beside each other: their probabilities, and which of them are one.

use super::acquisition::is_same;
use super::bank::Hypothesis;
use super::gaussian::Normal;

/// A hypothesis is dropped if its probability is less than this share of the best one's.
const DROPPED: f64 = 1e-5;

/// Probabilities of hypotheses.
pub(super) fn shares_of(hypotheses: &[Hypothesis]) -> Vec<f64> {
    let best = hypotheses
        .iter()
        .map(Hypothesis::log_share)
        .fold(f64::NEG_INFINITY, f64::max);
    let weights: Vec<f64> = hypotheses.iter().map(|one| (one.log_share() - best).exp()).collect();
    let total: f64 = weights.iter().sum();
    weights.iter().map(|weight| weight / total).collect()
}

/// Drops hypotheses that are improbable beside the best one.
pub(super) fn drop_improbable(hypotheses: &mut Vec<Hypothesis>) {
    let best = hypotheses
        .iter()
        .map(Hypothesis::log_share)
        .fold(f64::NEG_INFINITY, f64::max);
    hypotheses.retain(|one| one.log_share() - best > DROPPED.ln());
    // Only differences matter.
    hypotheses.iter_mut().for_each(|one| one.log_weight -= best);
}

/// Of hypotheses about the same place with the same model, keeps the most probable, with the probability of all.
pub(super) fn merge_same(hypotheses: &mut Vec<Hypothesis>) {
    hypotheses.sort_by(|a, b| b.log_share().total_cmp(&a.log_share()));
    let mut kept: Vec<(Hypothesis, Option<Normal>)> = Vec::new();
    for one in hypotheses.drain(..) {
        let moments = one.moments();
        let twin = kept.iter_mut().find(|(other, known)| match (&moments, known) {
            (Some(a), Some(b)) => other.variant == one.variant && is_near(a, b),
            _ => false,
        });
        match twin {
            Some((other, _)) => other.log_weight += (one.log_share() - other.log_share()).exp().ln_1p(),
            None => kept.push((one, moments)),
        }
    }
    hypotheses.extend(kept.into_iter().map(|(one, _)| one));
}

/// Whether two laws say nearly the same of position, bias and scale.
fn is_near(a: &Normal, b: &Normal) -> bool {
    let close = |i: usize| (a.mean[i] - b.mean[i]).powi(2) <= 0.1 * a.variance(i).min(b.variance(i));
    is_same(a, b) && (0..a.axes).chain([a.bias(), a.scale()]).all(close)
}
