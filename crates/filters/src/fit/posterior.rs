//! The parameters that the readings leave possible, as a sample of weighted models.

use super::errors::Spread;
use super::model::LevelModel;
use super::parameters::Estimate;
use super::problem::{Hypothesis, Problem};
use fewbits_numerics::normal::quantile;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// Models of a sample, in pairs that lie opposite to each other about the maximum: of a short table so many that they have this many readings
/// together, within these limits, and of a long one fewer.
const READINGS: usize = 200_000;
const MODELS: [usize; 2] = [128, 512];
const MODELS_OF_LONG: usize = 32;
/// The sample is drawn so much wider than the readings leave open, since a posterior has heavier tails than the Gaussian at its maximum.
const WIDER: f64 = 1.25;
/// Hypotheses, and models, of a smaller share than this are left out.
const NEGLIGIBLE: f64 = 1e-4;

/// A model and its share of the posterior.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WeightedModel {
    /// Its probability; all sum to one.
    pub weight: f64,
    /// The model.
    pub model: LevelModel,
}

/// A standard error is at least the deviation of the posterior from what was found: that is larger where the likelihood is no parabola, as of a time
/// constant of which the readings show few.
pub(super) fn widen(estimate: &mut Estimate, posterior: &[WeightedModel]) {
    let of = |one: &WeightedModel| Some((one.weight, estimate.quantity.of(&one.model)? - estimate.value));
    let (mut sum, mut squares) = (0.0, 0.0);
    for (weight, off) in posterior.iter().filter_map(of) {
        sum += weight;
        squares += weight * off * off;
    }
    estimate.standard_error = estimate.standard_error.max((squares / sum).sqrt());
}

impl Problem<'_> {
    /// A sample of the posterior: of the model that was chosen, whose spread this is, and of those that were left out for it, by the information
    /// criterion of Schwarz.
    pub(super) fn posterior(&mut self, spread: &Spread) -> Vec<WeightedModel> {
        let count = self.readings.told.len() as f64;
        let evidence = |one: &Hypothesis| one.worth - 0.5 * one.free.len() as f64 * count.ln();
        let own = Hypothesis {
            model: self.model.clone(),
            free: self.free.clone(),
            worth: self.worth(&self.model),
        };
        let mut all = self.sample(spread, evidence(&own));
        for other in std::mem::take(&mut self.left_out) {
            let other_evidence = evidence(&other);
            if other_evidence < evidence(&own) + NEGLIGIBLE.ln() {
                continue;
            }
            (self.model, self.free) = (other.model, other.free);
            let spread = self.spread();
            all.extend(self.sample(&spread, other_evidence));
        }
        (self.model, self.free) = (own.model.clone(), own.free);
        let largest = all.iter().map(|one| one.weight).fold(f64::NEG_INFINITY, f64::max);
        all.iter_mut().for_each(|one| one.weight = (one.weight - largest).exp());
        let most = all.iter().map(|one| one.weight).fold(0.0, f64::max);
        all.retain(|one| one.weight > NEGLIGIBLE * most);
        let sum: f64 = all.iter().map(|one| one.weight).sum();
        if all.is_empty() || !sum.is_finite() {
            return vec![WeightedModel {
                weight: 1.0,
                model: own.model,
            }];
        }
        all.iter_mut().for_each(|one| one.weight /= sum);
        all
    }

    /// A sample of one hypothesis, weighted by importance. Weights are logarithms, those of all together `evidence`.
    fn sample(&self, spread: &Spread, evidence: f64) -> Vec<WeightedModel> {
        let pairs = match self.part {
            Some(_) => MODELS_OF_LONG / 2,
            None => (READINGS / self.readings.told.len().max(1)).clamp(MODELS[0], MODELS[1]) / 2,
        };
        let mut all = Vec::with_capacity(2 * pairs);
        for pair in 0..pairs {
            let normal = normals(pair, spread.determined.len());
            for side in [WIDER, -WIDER] {
                let off = &spread.factor * &normal * side;
                let mut point = DVector::zeros(self.free.len());
                spread
                    .determined
                    .iter()
                    .zip(off.iter())
                    .for_each(|(i, by)| point[*i] = *by);
                let model = self.at(&point);
                let weight = self.worth(&model) + 0.5 * normal.norm_squared();
                all.push(WeightedModel { weight, model });
            }
        }
        let largest = all.iter().map(|one| one.weight).fold(f64::NEG_INFINITY, f64::max);
        let sum: f64 = all.iter().map(|one| (one.weight - largest).exp()).sum();
        let shift = evidence - largest - sum.ln();
        all.iter_mut().for_each(|one| one.weight += shift);
        all
    }
}

/// Normal numbers that fill the space evenly: multiples of the roots of primes.
fn normals(number: usize, count: usize) -> DVector<f64> {
    let is_prime = |one: &usize| {
        (2..*one)
            .take_while(|by| by * by <= *one)
            .all(|by| !one.is_multiple_of(by))
    };
    let roots = (2..).filter(is_prime).map(|prime| (prime as f64).sqrt());
    let one = |root: f64| quantile((0.5 + (number + 1) as f64 * root).fract().clamp(1e-9, 1.0 - 1e-9));
    DVector::from_iterator(count, roots.take(count).map(one))
}
