//! The hypotheses beside each other: their probabilities, and which of them are one.

use super::bank::Hypothesis;
use super::fit::Calibration;
use super::members::Member;
use super::spare::Spare;

/// A hypothesis whose probability is less than this share of the best one's is dropped in any case.
const LEAST: f64 = 1e-5;

/// Share of a range's evidence that stays in the recent evidence, and by how many nats that of two hypotheses may differ without deciding.
const RECALLED: f64 = 0.98;
const UNDECIDED: f64 = 20.0;
/// By how many nats the recent evidence of a hypothesis that does not determine the state may exceed that of others that do, without deciding.
const GAINED: f64 = 6.0;

/// The track is lost if fewer than this share of the latest ranges agree.
const AGREEMENT: f64 = 0.35;
/// Or if for so many ranges of each anchor those that do not contradict the others are too few for a place.
const CONTRADICTED: usize = 5;
/// Or if the misfit of levels is this many deviations: about once in a hundred thousand ranges.
const MISFIT: f64 = 4.3;
/// The edge between the two levels of a single bit lies beside the expected range by as many of its deviations as the `ln` of the noise is
/// uncertain, at most so many: a bit about the expected range says nothing about the noise, nor whether a doubtful anchor is good.
pub(super) const ASIDE: f64 = 0.8;

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

/// Mean and variance of bias and scale by all hypotheses. `None` without any.
pub(super) fn calibration_of(hypotheses: &[Hypothesis], axes: usize) -> Option<Calibration> {
    hypotheses.first()?;
    let mut sums = [(0.0, 0.0); 2];
    for (share, one) in shares_of(hypotheses).into_iter().zip(hypotheses) {
        let (mean, covariance) = one.marginal(&[2 * axes, 2 * axes + 1]);
        for (i, (sum, squares)) in sums.iter_mut().enumerate() {
            *sum += share * mean[i];
            *squares += share * (covariance[i][i] + mean[i] * mean[i]);
        }
    }
    Some(sums.map(|(mean, square)| (mean, square - mean * mean)))
}

impl Hypothesis {
    /// `ln` of its probability, up to a constant of all.
    pub(super) fn log_share(&self) -> f64 {
        self.log_weight - self.behind
    }

    /// Takes in the evidence of a range that determines the state.
    pub(super) fn weigh(&mut self, log_evidence: f64) {
        self.log_weight += log_evidence - self.behind;
        (self.recent, self.behind) = (0.0, 0.0);
    }

    /// Takes in the evidence of a range that does not, beside that of the others.
    fn recall(&mut self, log_evidence: f64, others: f64) {
        self.recent = RECALLED * self.recent + log_evidence - others;
    }

    /// Of its recent evidence beside that of hypotheses which determine the state, only what goes beyond the little errors of the model counts, and that
    /// for good. `best`: the most recent evidence of a hypothesis that does not determine the state. What that one gains others gain too as far as they
    /// have evidence: or a few nats that decide nothing would leave the first of them alone.
    fn settle(&mut self, others: f64, best: f64) {
        let gained = (best - GAINED).clamp(0.0, self.recent.max(0.0));
        let kept = (self.recent - gained).max(-UNDECIDED);
        self.log_weight += others + self.recent - kept - self.behind;
        (self.recent, self.behind) = (kept, 0.0);
    }
}

/// Takes in the evidence of a range: for each hypothesis whether the ranges leave it undetermined, and `ln` of the evidence. An undetermined hypothesis
/// can explain almost any range, so its evidence is evidence of little errors of the model: only much of it decides. Returns `ln` of the evidence that
/// no weight has taken in, since it is common to all: that of a range that leaves all of them undetermined.
pub(super) fn weigh(hypotheses: &mut [Hypothesis], evidences: &[(bool, f64)]) -> f64 {
    let most = evidences.iter().map(|(_, one)| *one).fold(f64::NEG_INFINITY, f64::max);
    let shares = shares_of(hypotheses);
    let (mut sum, mut total, mut all) = (0.0, 0.0, 0.0);
    for (share, (is_undetermined, log_evidence)) in shares.iter().zip(evidences) {
        all += share * (log_evidence - most).exp();
        if !is_undetermined {
            sum += share * (log_evidence - most).exp();
            total += share;
        }
    }
    if total == 0.0 {
        let mut best = f64::NEG_INFINITY;
        for (one, (_, log_evidence)) in hypotheses.iter_mut().zip(evidences) {
            one.recall(*log_evidence, most);
            best = best.max(one.recent);
        }
        for one in hypotheses {
            one.behind = (best - one.recent - UNDECIDED).max(0.0);
        }
        let common = most + all.ln();
        return if common.is_finite() { common } else { 0.0 };
    }
    // The evidence of those that are determined, together.
    let others = most + (sum / total).ln();
    let mut best = f64::NEG_INFINITY;
    for (one, (is_undetermined, log_evidence)) in hypotheses.iter_mut().zip(evidences) {
        if *is_undetermined && others.is_finite() {
            one.recall(*log_evidence, others);
            best = best.max(one.recent);
        } else {
            one.weigh(*log_evidence);
        }
    }
    for (one, (is_undetermined, _)) in hypotheses.iter_mut().zip(evidences) {
        if *is_undetermined && others.is_finite() {
            one.settle(others, best);
        }
    }
    0.0
}

/// Whether a hypothesis whose `ln` of the probability is so much that of the best one's is kept.
pub(super) fn is_worth(log_ratio: f64, negligible: f64) -> bool {
    log_ratio > negligible.max(LEAST).ln()
}

/// Drops hypotheses that are improbable beside the best one. Returns what was taken off the `ln` of all weights: only differences matter.
pub(super) fn drop_improbable(hypotheses: &mut Vec<Hypothesis>, negligible: f64, spare: &mut Spare) -> f64 {
    let best = hypotheses
        .iter()
        .map(Hypothesis::log_share)
        .fold(f64::NEG_INFINITY, f64::max);
    spare.retain(hypotheses, |one| is_worth(one.log_share() - best, negligible));
    if !best.is_finite() {
        return 0.0;
    }
    hypotheses.iter_mut().for_each(|one| one.log_weight -= best);
    best
}

/// Of hypotheses about the same place with the same model, keeps the most probable, with the probability of all.
pub(super) fn merge_same(hypotheses: &mut Vec<Hypothesis>, axes: usize, spare: &mut Spare) {
    if hypotheses.len() < 2 {
        return;
    }
    hypotheses.sort_by(|a, b| b.log_share().total_cmp(&a.log_share()));
    // Moments of position, bias and scale.
    let laws: Vec<Law> = hypotheses
        .iter()
        .map(|one| one.marginal(&[0, 1, axes - 1, 2 * axes, 2 * axes + 1]))
        .collect();
    let mut number = 0;
    let mut kept: Vec<usize> = Vec::new();
    let mut gained = vec![0.0; hypotheses.len()];
    for (i, one) in hypotheses.iter().enumerate() {
        let is_twin = |other: &&usize| hypotheses[**other].variant == one.variant && is_near(&laws[**other], &laws[i]);
        match kept.iter().find(is_twin) {
            Some(twin) => {
                let other = hypotheses[*twin].log_share() + gained[*twin];
                gained[*twin] += (one.log_share() - other).exp().ln_1p();
            }
            None => kept.push(i),
        }
    }
    spare.retain(hypotheses, |one| {
        one.log_weight += gained[number];
        number += 1;
        kept.contains(&(number - 1))
    });
}

type Law = ([f64; 5], [[f64; 5]; 5]);

/// Whether two laws say nearly the same.
fn is_near(a: &Law, b: &Law) -> bool {
    (0..5).all(|i| (a.0[i] - b.0[i]).powi(2) <= 0.1 * a.1[i][i].min(b.1[i][i]))
}

/// Counts the ranges in a row for which anchors send ranges, but contradict each other so much that those that are left are not `enough`.
pub(super) fn count_contradictions(hypotheses: &mut [Hypothesis], enough: usize, is_heard: impl Fn(usize) -> bool) {
    for one in hypotheses {
        let heard = (0..one.good.len()).filter(|anchor| is_heard(*anchor)).count();
        let is_short = heard >= enough && one.usable(&is_heard) < enough;
        one.contradicted = if is_short { one.contradicted + 1 } else { 0 };
    }
}

/// Whether the ranges show that no hypothesis is right.
pub(super) fn is_lost(hypotheses: &[Hypothesis], are_levels: bool) -> bool {
    let shares = shares_of(hypotheses);
    let sum = |of: &dyn Fn(&Hypothesis) -> f64| {
        hypotheses
            .iter()
            .zip(&shares)
            .map(|(one, share)| share * of(one))
            .sum::<f64>()
    };
    let agreement = sum(&|one| one.agreement);
    let contradicted = sum(&|one| f64::from(u8::from(one.contradicted > CONTRADICTED * one.good.len())));
    let misfit = if are_levels {
        hypotheses.iter().map(Hypothesis::misfit).fold(f64::INFINITY, f64::min)
    } else {
        0.0
    };
    agreement < AGREEMENT || misfit > MISFIT || contradicted > 0.5
}

/// The deviation of `ln` of the noise over all filters, at most [`ASIDE`].
pub(super) fn uncertainty_of_noise(bank: &[Member], hypotheses: &[Hypothesis], shares: &[f64]) -> f64 {
    let (mut mean, mut square) = (0.0, 0.0);
    for (one, share) in hypotheses.iter().zip(shares) {
        for i in &one.alive {
            let (weight, log) = (one.weights[*i], bank[*i].log_noise);
            mean += share * weight * log;
            square += share * weight * log * log;
        }
    }
    (square - mean * mean).max(0.0).sqrt().min(ASIDE)
}
