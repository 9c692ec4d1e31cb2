//! Choice of the next node.

use crate::information::{Predictions, half_log_det_plus_one, information_at};
use crate::posterior::Posterior;
use crate::{Error, RateModel, SourceSensor};
use fewbits_core::Gaussian;
use fewbits_mixture_codec::{Clump, Clumps};
use fewbits_models::Receptor;
use nalgebra::{DMatrix, DVector, Matrix2, Matrix3, Vector2};
use serde::{Deserialize, Serialize};

/// How the next node is chosen among candidates.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[non_exhaustive]
pub enum SelectionRule {
    /// The largest mutual information between samples and (position, rate), by its Gaussian bound `(1/2) ln det(I + Cov / sigma^2)`.
    #[default]
    MutualInformation,
    /// The largest pairwise lower bound of that information. If the belief has several peaks, it ranks nodes better than the Gaussian
    /// bound, at about twenty times the cost.
    PairwiseInformation,
    /// The largest mutual information by quadrature, over fewer points. It takes tens of milliseconds per candidate.
    ExactInformation,
    /// The smallest posterior Cramer-Rao bound (equations 40 to 44, conditional on the belief). The expected Fisher information is
    /// added to that of the belief; then the rate is eliminated by a Schur complement.
    CramerRao,
    /// The smallest Mahalanobis distance to the estimate (equation 45). It can repeatedly choose nodes that bring no new information.
    Mahalanobis,
    /// The smallest determinant of the covariance after the samples that the estimate predicts.
    Covariance,
}

/// Number of clumps that represent the belief.
const CLUMPS: usize = 96;
const FEW_CLUMPS: usize = 48;
/// If the uncertainty of the rate moves a clump's samples by more than this share of the noise variance, the clump becomes two points.
const SPLIT: f64 = 0.05;

/// A belief, prepared for scoring candidates.
#[derive(Debug, Clone)]
pub struct Selector {
    rule: SelectionRule,
    clumps: Clumps<3>,
    estimate: Gaussian<2>,
    precision: Matrix2<f64>,
}

impl Selector {
    /// A selector for a posterior and the Gaussian of the belief that is sent on.
    ///
    /// # Errors
    /// If the covariance of the estimate is singular.
    pub fn new(
        rule: SelectionRule,
        posterior: &Posterior,
        estimate: &Gaussian<2>,
        rate: &RateModel,
    ) -> Result<Self, Error> {
        let count = match rule {
            SelectionRule::Mahalanobis => 1,
            SelectionRule::ExactInformation => FEW_CLUMPS,
            _ => CLUMPS,
        };
        Ok(Self {
            rule,
            clumps: posterior.clumps_with_rate(rate.typical(), count)?,
            precision: estimate.cholesky()?.inverse(),
            estimate: *estimate,
        })
    }

    /// The candidate of highest score, the first in a tie; `None` if there is no candidate.
    pub fn best(&self, sensor: &SourceSensor, candidates: &[(usize, Vector2<f64>)]) -> Option<usize> {
        let mut best: Option<(f64, usize)> = None;
        for (index, node) in candidates {
            let score = self.score(sensor, node);
            if best.is_none_or(|(highest, _)| score > highest) {
                best = Some((score, *index));
            }
        }
        best.map(|(_, index)| index)
    }

    /// Score of a node; larger is better. `-inf` if the model has no concentrations there.
    pub fn score(&self, sensor: &SourceSensor, node: &Vector2<f64>) -> f64 {
        let Ok(receptor) = sensor.receptor(node) else {
            return f64::NEG_INFINITY;
        };
        match self.rule {
            SelectionRule::Mahalanobis => {
                let d = node - self.estimate.mean();
                -d.dot(&(self.precision * d))
            }
            SelectionRule::MutualInformation => self.information(sensor, &receptor),
            SelectionRule::PairwiseInformation => self.predictions(sensor, &receptor).pairwise_bounds().lower,
            SelectionRule::ExactInformation => self.predictions(sensor, &receptor).exact(),
            SelectionRule::CramerRao => self.cramer_rao(sensor, &receptor),
            SelectionRule::Covariance => -self.covariance(sensor, &receptor).ln(),
        }
    }

    fn information(&self, sensor: &SourceSensor, receptor: &Receptor) -> f64 {
        let samples = sensor.instants().len();
        let mut mean = DVector::zeros(samples);
        let mut second = DMatrix::zeros(samples, samples);
        for clump in self.clumps.clumps() {
            let a = self.predicted(sensor, receptor, &place(clump));
            let rate = clump.mean[2];
            mean.axpy(clump.weight * rate, &a, 1.0);
            second.ger(clump.weight * (rate * rate + clump.covariance[(2, 2)]), &a, &a, 1.0);
        }
        second.ger(-1.0, &mean, &mean, 1.0);
        half_log_det_plus_one(second)
    }

    /// The samples that the clumps predict. A clump with an uncertain rate gives two points, one standard deviation on either side.
    fn predictions(&self, sensor: &SourceSensor, receptor: &Receptor) -> Predictions {
        let (mut means, mut weights) = (Vec::new(), Vec::new());
        for clump in self.clumps.clumps() {
            let a = self.predicted(sensor, receptor, &place(clump));
            let (rate, variance) = (clump.mean[2], clump.covariance[(2, 2)]);
            if variance * a.norm_squared() > SPLIT {
                for rate in [rate - variance.sqrt(), rate + variance.sqrt()] {
                    means.push(&a * rate);
                    weights.push(0.5 * clump.weight);
                }
            } else {
                means.push(a * rate);
                weights.push(clump.weight);
            }
        }
        Predictions::in_units_of_noise(&means, weights)
    }

    /// Predicted responses divided by the noise.
    fn predicted(&self, sensor: &SourceSensor, receptor: &Receptor, source: &Vector2<f64>) -> DVector<f64> {
        DVector::from_vec(sensor.responses_at(receptor, source)) / sensor.noise()
    }

    fn cramer_rao(&self, sensor: &SourceSensor, receptor: &Receptor) -> f64 {
        let mut information = Matrix3::zeros();
        for clump in self.clumps.clumps() {
            information += information_at(sensor, receptor, &place(clump), clump.mean[2]) * clump.weight;
        }
        let covariance = *self.clumps.gaussian().covariance();
        if covariance[(2, 2)] > 0.0 {
            let Some(prior) = covariance.cholesky() else {
                return f64::NEG_INFINITY;
            };
            // The information about the position that is left when the rate is unknown: the Schur complement.
            let total = prior.inverse() + information;
            let cross = Vector2::new(total[(0, 2)], total[(1, 2)]);
            let position = total.fixed_view::<2, 2>(0, 0) - cross * cross.transpose() / total[(2, 2)];
            position.determinant().ln()
        } else {
            (self.precision + information.fixed_view::<2, 2>(0, 0))
                .determinant()
                .ln()
        }
    }

    /// Determinant of the covariance of the position after the samples that the estimate predicts.
    fn covariance(&self, sensor: &SourceSensor, receptor: &Receptor) -> f64 {
        let predicted = self.predicted(sensor, receptor, self.estimate.mean()) * self.clumps.gaussian().mean()[2];
        let mut logs = Vec::with_capacity(self.clumps.clumps().len());
        for clump in self.clumps.clumps() {
            let a = self.predicted(sensor, receptor, &place(clump));
            let residual = &predicted - &a * clump.mean[2];
            let along = a.dot(&residual);
            // The uncertain rate correlates the samples of a clump: a matrix of rank one is added to the noise.
            let spread = 1.0 + clump.covariance[(2, 2)] * a.norm_squared();
            let squared = residual.norm_squared() - clump.covariance[(2, 2)] * along * along / spread;
            logs.push(clump.weight.ln() - 0.5 * squared - 0.5 * spread.ln());
        }
        let best = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logs.iter().map(|log| (log - best).exp()).collect();
        let after = self.clumps.reweighted(&weights).gaussian();
        let position = after.covariance().fixed_view::<2, 2>(0, 0);
        position.determinant().max(f64::MIN_POSITIVE)
    }
}

/// Position of a clump in the plane.
fn place(clump: &Clump<3>) -> Vector2<f64> {
    Vector2::new(clump.mean[0], clump.mean[1])
}
