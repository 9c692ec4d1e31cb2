//! Design criteria, computed as sums over joint outcomes.

use crate::error::{Error, refuse};
use crate::observation_model::ObservationModel;
use crate::outcomes::NodeWeights;
use serde::{Deserialize, Serialize};

/// Smaller probabilities are treated as zero inside a logarithm.
pub const LOG_FLOOR: f64 = 1e-300;

/// With at most this many values of the unknown, information is computed as the prior's entropy minus the equivocation. This keeps digits
/// if decisions are almost certain.
const FEW_VALUES: usize = 8;

/// The quantity by which a system of quantizers is designed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Criterion {
    /// Mutual information `I(X; T)` in nats, to be maximised.
    MutualInformation,
    /// Mean squared error `E (X - E[X | T])^2`, to be minimised.
    MeanSquaredError,
    /// Error probability of the maximum a posteriori decision, to be minimised; for finite priors.
    BayesError,
}

/// Whether a level or word may be used for several intervals of the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum AllowedCells {
    /// One interval for each level or word.
    #[default]
    Intervals,
    /// Any number of intervals for each (folded cells).
    Any,
}

impl Criterion {
    /// `+1` if larger is better, `-1` if smaller is.
    pub fn sense(self) -> f64 {
        match self {
            Self::MutualInformation => 1.0,
            Self::MeanSquaredError | Self::BayesError => -1.0,
        }
    }
}

/// A criterion together with the data of the model that it needs.
///
/// Every criterion is `constant + sense * sum_outcomes psi(m)`, where `m` are a few moments of the outcome's likelihood:
///
/// | criterion | moments | `psi` |
/// |---|---|---|
/// | information, few values of `X` | `q_k` | `sum w q ln(w q / Q)`, subtracted from the prior's entropy |
/// | information, independent noise | `Q = sum w q` | `-Q ln Q`; the conditional entropy is a sum over sensors |
/// | information, shared noise | `q_k`, each value of `X` | `sum w q ln(q / Q)` |
/// | squared error | `Q`, `M = sum w x q` | `M^2 / Q`, subtracted from `E X^2` |
/// | Bayes error | `q_k` | `-(sum_k w q - max_k w q)` |
#[derive(Debug, Clone)]
pub(crate) struct Scored {
    kind: Kind,
    features: Vec<NodeWeights>,
    weights: Vec<f64>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Equivocation,
    Entropy,
    Information,
    Explained,
    Decision,
}

impl Scored {
    pub(crate) fn new(criterion: Criterion, model: &ObservationModel) -> Result<Self, Error> {
        let (kind, features) = match criterion {
            Criterion::MutualInformation if model.prior().points().is_some() && model.values.len() <= FEW_VALUES => {
                (Kind::Equivocation, model.given.clone())
            }
            Criterion::MutualInformation if model.noise().is_independent() => (Kind::Entropy, vec![model.mass.clone()]),
            Criterion::MutualInformation => (Kind::Information, model.given.clone()),
            Criterion::MeanSquaredError => (Kind::Explained, vec![model.mass.clone(), model.moment.clone()]),
            Criterion::BayesError if model.prior().points().is_some() => (Kind::Decision, model.given.clone()),
            Criterion::BayesError => {
                return refuse("prior", "a continuous prior", "a discrete prior for a Bayes error");
            }
        };
        Ok(Self {
            kind,
            features,
            weights: model.weights.clone(),
        })
    }

    pub(crate) fn features(&self) -> &[NodeWeights] {
        &self.features
    }

    /// Whether the conditional entropy of the symbols is subtracted separately for each sensor.
    pub(crate) fn has_separable_entropy(&self) -> bool {
        self.kind == Kind::Entropy
    }

    /// `psi` of an outcome that represents `exp(log_multiplicity)` equally likely ones.
    pub(crate) fn value(&self, m: &[f64], log_multiplicity: f64) -> f64 {
        match self.kind {
            Kind::Entropy if m[0] > 0.0 => -m[0] * (m[0].max(LOG_FLOOR).ln() - log_multiplicity),
            Kind::Explained if m[0] > 0.0 => m[1] * (m[1] / m[0]),
            Kind::Entropy | Kind::Explained => 0.0,
            Kind::Equivocation => -equivocation(&self.weights, m),
            Kind::Information => {
                let total = self.total(m);
                self.weights
                    .iter()
                    .zip(m)
                    .filter(|(w, q)| **w > 0.0 && **q > 0.0)
                    .map(|(w, q)| w * q * (q.max(LOG_FLOOR) / total.max(LOG_FLOOR)).ln())
                    .sum()
            }
            Kind::Decision => -favourite(&self.weights, m).2,
        }
    }

    /// Derivatives of `psi` with respect to the moments.
    pub(crate) fn slope(&self, m: &[f64], log_multiplicity: f64, out: &mut [f64]) {
        match self.kind {
            Kind::Entropy => out[0] = log_multiplicity - m[0].max(LOG_FLOOR).ln() - 1.0,
            Kind::Explained => {
                let r = if m[0] > 0.0 { m[1] / m[0] } else { 0.0 };
                out[0] = -r * r;
                out[1] = 2.0 * r;
            }
            Kind::Equivocation => {
                let (best, mass, others) = favourite(&self.weights, m);
                for (k, ((o, w), q)) in out.iter_mut().zip(&self.weights).zip(m).enumerate() {
                    *o = if mass <= 0.0 {
                        0.0
                    } else if k == best {
                        w * (-others / mass).ln_1p()
                    } else {
                        w * ((w * q).max(LOG_FLOOR) / mass).ln()
                    };
                }
            }
            Kind::Information => {
                let total = self.total(m).max(LOG_FLOOR);
                for ((o, w), q) in out.iter_mut().zip(&self.weights).zip(m) {
                    *o = w * (q.max(LOG_FLOOR) / total).ln();
                }
            }
            Kind::Decision => {
                let best = most_probable(&self.weights, m);
                for (k, (o, w)) in out.iter_mut().zip(&self.weights).enumerate() {
                    *o = if k == best { 0.0 } else { -w };
                }
            }
        }
    }

    /// The product of the matrix of second derivatives of `psi` and `direction`.
    pub(crate) fn curvature(&self, m: &[f64], direction: &[f64], out: &mut [f64]) {
        match self.kind {
            Kind::Entropy => out[0] = if m[0] > 0.0 { -direction[0] / m[0] } else { 0.0 },
            Kind::Explained => {
                if m[0] > 0.0 {
                    let r = m[1] / m[0];
                    let bend = 2.0 * (direction[1] - r * direction[0]) / m[0];
                    out[0] = -r * bend;
                    out[1] = bend;
                } else {
                    out.fill(0.0);
                }
            }
            Kind::Equivocation => {
                let (best, mass, others) = favourite(&self.weights, m);
                let change = self.total(direction);
                let moved = change - self.weights[best] * direction[best];
                for (k, (((o, w), q), d)) in out.iter_mut().zip(&self.weights).zip(m).zip(direction).enumerate() {
                    *o = if mass <= 0.0 || *q <= LOG_FLOOR {
                        0.0
                    } else if k == best {
                        // d/q - change/mass, without cancellation if the most probable value has all the mass.
                        w * (d / q * (others / mass) - moved / mass)
                    } else {
                        w * (d / q - change / mass)
                    };
                }
            }
            Kind::Information => {
                let total = self.total(m);
                let change = self.total(direction);
                let shared = if total > 0.0 { change / total } else { 0.0 };
                for (((o, w), q), d) in out.iter_mut().zip(&self.weights).zip(m).zip(direction) {
                    *o = if *q > LOG_FLOOR { w * (d / q - shared) } else { 0.0 };
                }
            }
            Kind::Decision => out.fill(0.0),
        }
    }

    fn total(&self, q: &[f64]) -> f64 {
        self.weights.iter().zip(q).map(|(w, q)| w * q).sum()
    }

    /// Constant that is added to the sum over outcomes during a design. [`Scored::offset`] is added to the returned value only.
    pub(crate) fn constant(&self, model: &ObservationModel) -> f64 {
        if self.kind == Kind::Explained {
            -model.variance
        } else {
            0.0
        }
    }

    /// The prior's entropy, if it is part of the criterion. It is added to returned values only: during a design, small changes would
    /// lose digits if it were included.
    pub(crate) fn offset(&self) -> f64 {
        if self.kind != Kind::Equivocation {
            return 0.0;
        }
        self.weights.iter().filter(|w| **w > 0.0).map(|w| -w * w.ln()).sum()
    }

    /// Reference size of the signed value without offset. Changes are compared with it, so that results do not depend on units.
    pub(crate) fn unit(&self, value: f64, model: &ObservationModel) -> f64 {
        match self.kind {
            Kind::Equivocation | Kind::Decision => value.abs(),
            Kind::Entropy | Kind::Information => value.abs().max(1.0),
            Kind::Explained => value.abs().max(model.variance),
        }
    }
}

/// Index of the most probable value, mass of the outcome, and mass of all other values.
fn favourite(weights: &[f64], q: &[f64]) -> (usize, f64, f64) {
    let best = most_probable(weights, q);
    let all = weights.iter().zip(q).enumerate();
    let others: f64 = all.filter(|(k, _)| *k != best).map(|(_, (w, q))| w * q).sum();
    (best, others + weights[best] * q[best], others)
}

/// Part of an outcome in the entropy of the unknown given the outcome, `-sum_k w q ln(w q / Q)`, as a sum of positive terms.
pub(crate) fn equivocation(weights: &[f64], q: &[f64]) -> f64 {
    let (best, mass, others) = favourite(weights, q);
    if mass <= 0.0 {
        return 0.0;
    }
    let joint = weights.iter().zip(q).map(|(w, q)| w * q).enumerate();
    let rest: f64 = joint
        .filter(|(k, joint)| *k != best && *joint > 0.0)
        .map(|(_, joint)| joint * (joint / mass).ln())
        .sum();
    // The term of the most probable value uses `ln_1p`, since its posterior is often within rounding of one.
    -(rest + (mass - others) * (-others / mass).ln_1p())
}

/// Index of the largest `w_k q_k`; the first one if several are equal.
pub(crate) fn most_probable(weights: &[f64], q: &[f64]) -> usize {
    let mut best = 0;
    for k in 1..q.len() {
        if weights[k] * q[k] > weights[best] * q[best] {
            best = k;
        }
    }
    best
}
