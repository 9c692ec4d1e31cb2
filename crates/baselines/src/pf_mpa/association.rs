//! Two targets on a line and two measurements in unknown order: which measurement belongs to which target.
//!
//! The targets `T1`, `T2` are random walks of variance `q` per step. The measurements `zA`, `zB` of variance `R` arrive in random order.
//! `r = 0` means that `zA` is of the first target. The thesis computes `P(r = 0)` by a heuristic ([`AssociationRule::Tanh`]);
//! [`AssociationRule::Exact`] is the exact value.

use fewbits_core::Gaussian;
use fewbits_numerics::error::{non_negative, positive};
use fewbits_numerics::normal;
use fewbits_pf_mpa::Error;
use serde::{Deserialize, Serialize};

/// The printed constant of the tanh rule; `atanh(1/2)` rounded.
pub const PRINTED_GAIN: f64 = 0.55;

/// How `P(r = 0)` is computed from predictions `t` and measurements `z`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AssociationRule {
    /// `tanh(K D)`, `D = |t1 - zB| |t2 - zA| / (|t1 - zA| |t2 - zB|)`, as printed (`K = 0.55`). Exchanging the labels does not give the
    /// complement, and `R` is ignored (erratum `mpa-12`).
    Tanh {
        /// Gain `K`.
        gain: f64,
    },
    /// `D / (1 + D)`: symmetric in the labels, but not more accurate.
    Logistic,
    /// From the likelihoods of both orders, given Gaussian predictions.
    Exact,
}

impl AssociationRule {
    /// The rule of the thesis, [`Tanh`](Self::Tanh) with `K = 0.55`.
    pub const PRINTED: Self = Self::Tanh { gain: PRINTED_GAIN };

    /// `P(r = 0)` for predictions with the given mean and variance, measurement variance `r`.
    ///
    /// # Errors
    /// If a variance is negative, `r` is not positive, or a number is not finite; [`Error::NotANumber`] if the likelihoods
    /// overflow.
    pub fn probability(self, targets: &[Gaussian<1>; 2], z: [f64; 2], r: f64) -> Result<f64, Error> {
        fewbits_numerics::error::all_finite("z", &z)?;
        positive("r", r)?;
        number(self.of(targets, z, r), "the ratio of the likelihoods")
    }

    fn of(self, targets: &[Gaussian<1>; 2], z: [f64; 2], r: f64) -> f64 {
        match self {
            Self::Tanh { gain } => tanh_rule(separation(means(targets), z), gain),
            Self::Logistic => {
                separation(means(targets), z).map_or(0.5, |d| if d == f64::INFINITY { 1.0 } else { d / (1.0 + d) })
            }
            Self::Exact => {
                // ln N(z0; m, s) - ln N(z1; m, s) as one product: the difference of two logarithms could be infinity minus infinity.
                let log_ratio = |target: &Gaussian<1>| {
                    let middle = 0.5 * z[0] + 0.5 * z[1] - target.mean()[0];
                    (z[1] - z[0]) / (target.covariance()[0] + r) * middle
                };
                sigmoid(log_ratio(&targets[0]) - log_ratio(&targets[1]))
            }
        }
    }
}

/// `value`, or an error if it is NaN.
fn number(value: f64, what: &'static str) -> Result<f64, Error> {
    if value.is_nan() {
        return Err(Error::NotANumber { what });
    }
    Ok(value)
}

fn means(targets: &[Gaussian<1>; 2]) -> [f64; 2] {
    [targets[0].mean()[0], targets[1].mean()[0]]
}

/// `D` of the printed rule. Infinite if only its denominator is zero, `None` if numerator and denominator are.
pub fn separation(t: [f64; 2], z: [f64; 2]) -> Option<f64> {
    // Ratios first: the products of the distances could overflow or underflow.
    let (over, under) = ((t[0] - z[1]).abs(), (t[0] - z[0]).abs());
    let (other_over, other_under) = ((t[1] - z[0]).abs(), (t[1] - z[1]).abs());
    let (zero_over, zero_under) = (over == 0.0 || other_over == 0.0, under == 0.0 || other_under == 0.0);
    match (zero_over, zero_under) {
        (true, true) => None,
        (true, false) => Some(0.0),
        (false, true) => Some(f64::INFINITY),
        (false, false) => Some((over / under) * (other_over / other_under)).filter(|d| !d.is_nan()),
    }
}

/// `tanh(K D)`; 1/2 if `D` is undefined.
pub fn tanh_rule(separation: Option<f64>, gain: f64) -> f64 {
    separation.map_or(0.5, |d| (gain * d).tanh())
}

/// `1 / (1 + exp(-x))`.
pub fn sigmoid(x: f64) -> f64 {
    if x >= 0.0 {
        1.0 / (1.0 + (-x).exp())
    } else {
        x.exp() / (1.0 + x.exp())
    }
}

/// The one-step posterior of two targets, reduced to its first two moments.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pair {
    /// `P(r = 0)`: `zA` is of the first target.
    pub straight: f64,
    /// Mean and variance of each target.
    pub targets: [Gaussian<1>; 2],
    /// Covariance between the targets.
    pub covariance: f64,
}

/// Posterior of both targets if `zA` is of the first with probability `straight`: mean and covariance of the mixture of two Kalman
/// updates.
///
/// # Errors
/// If `straight` is outside `[0, 1]`, `r` is not above zero, or a measurement is not finite.
pub fn update(targets: &[Gaussian<1>; 2], z: [f64; 2], r: f64, straight: f64) -> Result<Pair, Error> {
    fewbits_numerics::error::all_finite("z", &z)?;
    fewbits_numerics::error::within("straight", straight, 0.0, 1.0)?;
    positive("r", r)?;
    let (first, other) = (kalman(&targets[0], z[0], r), kalman(&targets[0], z[1], r));
    let (second, swapped) = (kalman(&targets[1], z[1], r), kalman(&targets[1], z[0], r));
    let mixed = |(m0, v): (f64, f64), (m1, _): (f64, f64)| {
        let mean = straight * m0 + (1.0 - straight) * m1;
        let between = straight * (1.0 - straight) * (m0 - m1) * (m0 - m1);
        Gaussian::scalar(mean, v + between)
    };
    let covariance = straight * (1.0 - straight) * (first.0 - other.0) * (second.0 - swapped.0);
    Ok(Pair {
        straight,
        targets: [mixed(first, other)?, mixed(second, swapped)?],
        covariance,
    })
}

/// Mean and variance after a measurement.
fn kalman(prior: &Gaussian<1>, z: f64, r: f64) -> (f64, f64) {
    let (m, v) = (prior.mean()[0], prior.covariance()[0]);
    let gain = v / (v + r);
    (m + gain * (z - m), gain * r)
}

/// Both targets one step later, before the measurements: variances grow by `q`.
fn predicted(targets: &[Gaussian<1>; 2], q: f64) -> [Gaussian<1>; 2] {
    targets.map(|t| Gaussian::from_trusted_parts(*t.mean(), t.covariance().add_scalar(q)))
}

/// A tracker of two targets by one Gaussian each.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PairTracker {
    /// Knows the order. No other tracker can be more accurate.
    Genie,
    /// Weighs both orders by a rule and keeps mean and covariance of the mixture. With the exact rule it is joint probabilistic data
    /// association.
    Weighted(AssociationRule),
    /// Takes the more probable order: global nearest neighbour.
    Nearest,
}

impl PairTracker {
    /// One step of walks of variance `q`. Returns the posterior and `P(r = 0)`. `straight` is the true order; only
    /// [`Genie`](Self::Genie) uses it.
    ///
    /// # Errors
    /// If a variance is negative, `r` is not positive, or a number is not finite.
    pub fn step(self, targets: &[Gaussian<1>; 2], z: [f64; 2], q: f64, r: f64, straight: bool) -> Result<Pair, Error> {
        non_negative("q", q)?;
        let predicted = predicted(targets, q);
        let p = match self {
            Self::Genie => f64::from(u8::from(straight)),
            Self::Weighted(rule) => rule.probability(&predicted, z, r)?,
            Self::Nearest => f64::from(u8::from(AssociationRule::Exact.probability(&predicted, z, r)? >= 0.5)),
        };
        update(&predicted, z, r, p)
    }
}

/// Multiple-hypothesis tracking: the most probable histories of orders, each with two Kalman filters.
#[derive(Debug, Clone, PartialEq)]
pub struct Hypotheses {
    most: usize,
    /// Per kept history: its log weight, and both targets.
    kept: Vec<(f64, [Gaussian<1>; 2])>,
}

impl Hypotheses {
    /// The start with one history; at most `most` histories are kept.
    ///
    /// # Errors
    /// If `most` is zero.
    pub fn new(most: usize, targets: [Gaussian<1>; 2]) -> Result<Self, Error> {
        fewbits_numerics::error::at_least_one("most", most)?;
        Ok(Self {
            most,
            kept: vec![(0.0, targets)],
        })
    }

    /// One step; returns `P(r = 0)`.
    ///
    /// # Errors
    /// If a variance is negative, `r` is not positive, or a number is not finite; [`Error::Impossible`] if the
    /// measurements have probability zero under every hypothesis. The hypotheses are then unchanged.
    pub fn step(&mut self, z: [f64; 2], q: f64, r: f64) -> Result<f64, Error> {
        fewbits_numerics::error::all_finite("z", &z)?;
        non_negative("q", q)?;
        positive("r", r)?;
        let mut next = Vec::with_capacity(2 * self.kept.len());
        for (log, targets) in &self.kept {
            let targets = predicted(targets, q);
            // Every hypothesis branches in two: which measurement belongs to which target.
            for order in [[z[0], z[1]], [z[1], z[0]]] {
                let fit =
                    |i: usize| normal::log_pdf_with(order[i], targets[i].mean()[0], targets[i].covariance()[0] + r);
                let after = |i: usize| {
                    let (m, v) = kalman(&targets[i], order[i], r);
                    Gaussian::from_trusted_parts([m].into(), [[v]].into())
                };
                next.push((log + fit(0) + fit(1), [after(0), after(1)]));
            }
        }
        let largest = next.iter().fold(f64::NEG_INFINITY, |m, h| m.max(h.0));
        let finite = next
            .iter()
            .all(|h| !h.0.is_nan() && h.1.iter().all(Gaussian::is_finite));
        if !(finite && largest.is_finite()) {
            let what = "the hypotheses (from the targets or the measurements)";
            return Err(Error::unlikely_or_no_number(largest, what));
        }
        let total: f64 = next.iter().map(|h| (h.0 - largest).exp()).sum();
        // Sum before the list is shortened: entries of even index have the measurements in the given order.
        let straight: f64 = next.iter().step_by(2).map(|h| (h.0 - largest).exp()).sum();
        next.sort_by(|a, b| b.0.total_cmp(&a.0));
        next.truncate(self.most);
        next.iter_mut().for_each(|h| h.0 -= largest);
        self.kept = next;
        Ok(straight / total)
    }

    /// Means of both targets over all hypotheses.
    pub fn means(&self) -> [f64; 2] {
        let total: f64 = self.kept.iter().map(|h| h.0.exp()).sum();
        [0, 1].map(|i| self.kept.iter().map(|h| h.0.exp() * h.1[i].mean()[0]).sum::<f64>() / total)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(m: [f64; 2], v: f64) -> [Gaussian<1>; 2] {
        m.map(|m| Gaussian::scalar(m, v).unwrap())
    }

    /// Defect: measurements at 1e200 gave a probability of NaN, and the hypotheses stayed NaN ever after.
    #[test]
    fn measurements_out_of_reach_are_errors() {
        let targets = pair([0.0, 1.0], 1.0);
        assert_eq!(
            AssociationRule::Exact
                .probability(&targets, [1e200, 1e200], 1.0)
                .unwrap(),
            0.5
        );
        assert!(
            AssociationRule::Exact
                .probability(&targets, [1e200, -3e200], 1.0)
                .is_err()
        );
        let mut hypotheses = Hypotheses::new(4, targets).unwrap();
        let before = hypotheses.clone();
        assert!(hypotheses.step([1e200, 1e200], 0.1, 1.0).is_err());
        assert_eq!(hypotheses, before);
        assert!((0.0..=1.0).contains(&hypotheses.step([0.1, 0.8], 0.1, 1.0).unwrap()));
    }

    #[test]
    fn undefined_and_infinite_separations() {
        assert_eq!(separation([1.0, 2.0], [1.0, 1.0]), None);
        assert_eq!(tanh_rule(separation([1.0, 1.0], [1.0, 1.0]), 0.55), 0.5);
        assert_eq!(tanh_rule(separation([1.0, 2.0], [1.0, 3.0]), 0.55), 1.0);
        assert_eq!(tanh_rule(separation([1.0, 2.0], [3.0, 1.0]), 0.55), 0.0);
        assert!(separation([0.0, 1e-200], [1e200, -1e200]).is_some());
        assert_eq!(sigmoid(1e4) + sigmoid(-1e4), 1.0);
    }

    /// Erratum `mpa-11`.
    #[test]
    fn exact_probabilities_are_symmetric_and_hypotheses_agree_with_one_step() {
        for scale in [1e-4, 1.0, 1e4] {
            let targets = pair([1.0 * scale, 1.05 * scale], 2e-4 * scale * scale);
            let (z, r) = ([1.01 * scale, 1.04 * scale], 1e-4 * scale * scale);
            let p = AssociationRule::Exact.probability(&targets, z, r).unwrap();
            let q = AssociationRule::Exact.probability(&targets, [z[1], z[0]], r).unwrap();
            assert!((p + q - 1.0).abs() < 1e-14);
            let mut all = Hypotheses::new(16, targets).unwrap();
            assert!((all.step(z, 0.0, r).unwrap() - p).abs() < 1e-14);
            let one = update(&targets, z, r, p).unwrap();
            assert!((all.means()[0] - one.targets[0].mean()[0]).abs() < 1e-14 * scale);
        }
        let targets = pair([1.0, 2.0], 0.1);
        assert!(
            AssociationRule::Exact
                .probability(&targets, [f64::NAN, 1.0], 0.1)
                .is_err()
        );
        assert!(update(&targets, [1.0, 2.0], 0.0, 0.5).is_err() && update(&targets, [1.0, 2.0], 1.0, 1.5).is_err());
        assert!(Hypotheses::new(0, targets).is_err());
    }

    #[test]
    fn the_genie_is_two_kalman_filters() {
        let targets = pair([0.0, 1.0], 1.0);
        let known = PairTracker::Genie.step(&targets, [1.2, 0.1], 0.5, 0.5, false).unwrap();
        assert!((known.targets[0].mean()[0] - 0.75 * 0.1).abs() < 1e-15);
        assert_eq!((known.straight, known.covariance), (0.0, 0.0));
    }
}
