//! Particle messages on any factor graph: what a function node and a variable node do with weighted points.
//!
//! The tracker of this crate has its own, faster versions for the plane; these are for graphs of one's own.

use crate::Error;
use crate::error::refuse;
use crate::message::ProductSampler;
use crate::product;
use fewbits_densities::{Bandwidth, KernelEstimate, Mixture, Particles};
use fewbits_filters::Resampling;
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::kernels;
use nalgebra::SVector;
use rand::Rng;
use rand::seq::SliceRandom;
use serde::{Deserialize, Serialize};

/// A function node `f(x | X_1 .. X_V)` over states of `D` coordinates: towards `x` it can be drawn from.
pub trait FunctionNode<const D: usize> {
    /// Draws `x ~ f(. | inputs)`.
    fn draw<R: Rng + ?Sized>(&self, rng: &mut R, inputs: &[SVector<f64, D>]) -> SVector<f64, D>;

    /// `ln f(x | inputs)`, up to a constant; none where `f` has no density. Only the printed weights ask for it.
    fn log_density(&self, _x: &SVector<f64, D>, _inputs: &[SVector<f64, D>]) -> Option<f64> {
        None
    }
}

/// Weights of the points of a function node's message.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum WeightRule {
    /// `1 / N`: one draw from each component of a mixture is an exact stratified sample of it. Cost `N`.
    #[default]
    DeterministicMixture,
    /// `(1/N) sum_j f(x_i | X_j) / f(x_i | X_i)` as printed: the same expectation, and a variance that explodes where components do
    /// not overlap (erratum `mpa-4`). Cost `N^2`.
    PrintedRatio,
}

/// The message of a function node: as many points as the inputs have.
///
/// ```text
/// inputs that are not equally weighted: systematic resampling, then a shuffle (inputs are paired at random)
/// x_i ~ f(. | X_i);  weights by the rule
/// ```
///
/// # Errors
/// If there is no input, inputs differ in size, a draw is not finite, the printed rule meets a node without density, or its weights
/// leave the range of numbers.
pub fn function_message<const D: usize, R: Rng + ?Sized>(
    rng: &mut R,
    node: &impl FunctionNode<D>,
    inputs: &[&Particles<D>],
    rule: WeightRule,
) -> Result<Particles<D>, Error> {
    at_least_one("inputs", inputs.len())?;
    let count = inputs[0].len();
    let mut order = Vec::with_capacity(inputs.len());
    for input in inputs {
        if input.len() != count {
            return refuse("inputs", format!("{} points", input.len()), format!("{count}, as the first"));
        }
        let mut chosen: Vec<u32> = (0..count as u32).collect();
        if input.effective_sample_size() < count as f64 * (1.0 - 1e-9) {
            Resampling::Systematic.ancestors(rng, input.weights(), &mut chosen)?;
        }
        // Resampled indices are sorted: unshuffled, inputs would be paired by their order.
        if inputs.len() > 1 {
            chosen.shuffle(rng);
        }
        order.push(chosen);
    }
    let tuple = |i: usize| -> Vec<SVector<f64, D>> {
        let points = inputs.iter().zip(&order).map(|(input, o)| input.point(o[i] as usize));
        points.map(|p| p.unwrap_or_else(SVector::zeros)).collect()
    };
    let tuples: Vec<Vec<SVector<f64, D>>> = (0..count).map(tuple).collect();
    let mut next = tuples.iter();
    let mut message =
        Particles::from_draws(count, || next.next().map_or_else(SVector::zeros, |inputs| node.draw(rng, inputs)))?;
    if rule == WeightRule::PrintedRatio {
        let mut logs = vec![0.0; count];
        let mut weights = Vec::with_capacity(count);
        for i in 0..count {
            let x = message.point(i).unwrap_or_else(SVector::zeros);
            for (log, inputs) in logs.iter_mut().zip(&tuples) {
                let Some(density) = node.log_density(&x, inputs) else {
                    return refuse("node", "without a density", "one with a density, for the printed weights");
                };
                *log = density;
            }
            weights.push(kernels::log_sum_exp(&logs) - logs[i]);
        }
        message.reweigh(|_, own| own.copy_from_slice(&weights))?;
    }
    Ok(message)
}

/// The message of a variable node: `count` draws of the product of all messages but the destination's, each smoothed by its own
/// kernel. [`ProductSampler::MixtureImportance`] draws from the first message.
///
/// # Errors
/// If there is no message or no draw, points coincide, or the exact product has more than a million terms.
pub fn variable_message<const D: usize, R: Rng + ?Sized>(
    rng: &mut R,
    messages: &[&Particles<D>],
    bandwidth: &Bandwidth,
    sampler: ProductSampler,
    count: usize,
) -> Result<Particles<D>, Error> {
    let smooth = |message: &&Particles<D>| KernelEstimate::fit((*message).clone(), bandwidth)?.to_mixture();
    let mixtures: Vec<Mixture<D>> = messages
        .iter()
        .map(smooth)
        .collect::<Result<_, fewbits_densities::Error>>()?;
    let factors: Vec<&Mixture<D>> = mixtures.iter().collect();
    Ok(match sampler {
        ProductSampler::Gibbs { sweeps } => product::gibbs(rng, &factors, count, sweeps)?,
        ProductSampler::MixtureImportance { draws } => product::importance_resampled(rng, &factors, 0, draws, count)?,
        ProductSampler::Exact => product::exact(&factors)?.belief.sample_systematic(rng, count)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::Gaussian;
    use fewbits_densities::{Rule, SampleSize, Shape};
    use fewbits_monte_carlo::Stream;
    use nalgebra::Vector1;
    use rand::RngExt;
    use rand_distr::StandardNormal;

    /// `x = X_1 + X_2 + noise`.
    struct Sum(f64);

    impl FunctionNode<1> for Sum {
        fn draw<R: Rng + ?Sized>(&self, rng: &mut R, inputs: &[Vector1<f64>]) -> Vector1<f64> {
            inputs.iter().sum::<Vector1<f64>>() + Vector1::new(self.0 * rng.sample::<f64, _>(StandardNormal))
        }

        fn log_density(&self, x: &Vector1<f64>, inputs: &[Vector1<f64>]) -> Option<f64> {
            let t = (x - inputs.iter().sum::<Vector1<f64>>())[0] / self.0;
            Some(-0.5 * t * t)
        }
    }

    fn normal(mean: f64, seed: u64) -> Particles<1> {
        Particles::from_belief(&mut Stream::new(seed).rng(), &Gaussian::scalar(mean, 1.0).unwrap(), 3000).unwrap()
    }

    #[test]
    fn both_rules_have_the_moments_of_the_integral() {
        let (a, b) = (normal(1.0, 1), normal(-3.0, 2));
        for (rule, tolerance) in [
            (WeightRule::DeterministicMixture, 0.15),
            (WeightRule::PrintedRatio, 0.4),
        ] {
            let message = function_message(&mut Stream::new(3).rng(), &Sum(1.5), &[&a, &b], rule).unwrap();
            assert!((message.mean()[0] + 2.0).abs() < tolerance, "{rule:?} {}", message.mean()[0]);
            assert!((message.covariance()[0] - 4.25).abs() < 4.0 * tolerance, "{rule:?} {}", message.covariance()[0]);
        }
        let mut weighted = a.clone();
        weighted
            .reweigh(|columns, logs| {
                logs.iter_mut()
                    .zip(columns[0])
                    .for_each(|(l, x)| *l -= 0.5 * (x - 2.0).powi(2))
            })
            .unwrap();
        let rule = WeightRule::default();
        let message = function_message(&mut Stream::new(4).rng(), &Sum(0.5), &[&weighted, &b], rule).unwrap();
        assert!((message.mean()[0] - (1.5 - 3.0)).abs() < 0.1, "{}", message.mean()[0]);
        // Paired at random: the variances of both inputs add.
        assert!((message.covariance()[0] - 1.75).abs() < 0.2, "{}", message.covariance()[0]);
    }

    #[test]
    fn a_variable_multiplies_its_messages() {
        let few = |mean: f64, seed: u64| {
            let belief = Gaussian::scalar(mean, 1.0).unwrap();
            Particles::from_belief(&mut Stream::new(seed).rng(), &belief, 60).unwrap()
        };
        let (a, b) = (few(1.0, 1), few(-1.0, 2));
        let bandwidth = Bandwidth {
            rule: Rule::Silverman,
            size: SampleSize::Effective,
            shape: Shape::Full,
            ..Bandwidth::default()
        };
        let samplers = [
            ProductSampler::Gibbs { sweeps: 8 },
            ProductSampler::MixtureImportance { draws: 20_000 },
            ProductSampler::Exact,
        ];
        let drawn = samplers.map(|sampler| {
            let mut rng = Stream::new(5).rng();
            variable_message(&mut rng, &[&a, &b], &bandwidth, sampler, 3000).unwrap()
        });
        let truth = drawn[2].mean()[0];
        assert!(truth.abs() < 0.3);
        assert!(drawn.iter().all(|d| (d.mean()[0] - truth).abs() < 0.08));
    }

    /// Without a density.
    struct Echo;

    impl FunctionNode<1> for Echo {
        fn draw<R: Rng + ?Sized>(&self, _: &mut R, inputs: &[Vector1<f64>]) -> Vector1<f64> {
            inputs[0]
        }
    }

    #[test]
    fn what_cannot_be_weighed_is_refused() {
        let (a, mut rng) = (normal(0.0, 1), Stream::new(1).rng());
        assert!(function_message(&mut rng, &Echo, &[&a], WeightRule::PrintedRatio).is_err());
        assert!(function_message(&mut rng, &Echo, &[], WeightRule::DeterministicMixture).is_err());
        let short = Particles::uniform([vec![0.0, 1.0]]).unwrap();
        assert!(function_message(&mut rng, &Echo, &[&a, &short], WeightRule::DeterministicMixture).is_err());
    }
}
