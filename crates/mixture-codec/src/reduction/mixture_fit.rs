//! Gaussian mixtures fitted to clumps by expectation-maximisation.

use super::clumps::{Clump, Clumps};
use super::em::{Limits, Points, step};
use crate::Error;
use fewbits_core::Columns;
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::eigen::raised;
use fewbits_numerics::error::at_least_one;

/// Settings of [`Clumps::fit`].
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct MixtureFit {
    /// Largest number of components.
    pub components: usize,
    /// A component below this weight is dropped, and the others are fitted again.
    pub min_weight: f64,
    /// Limit on the steps of expectation-maximisation.
    pub iterations: usize,
    /// The iteration stops if the mean log density rises by less than this, in nats.
    pub tolerance: f64,
}

impl MixtureFit {
    /// Settings for at most `components` Gaussians.
    ///
    /// # Errors
    /// If `components` is zero.
    pub fn new(components: usize) -> Result<Self, Error> {
        Ok(Self {
            components: at_least_one("components", components)?,
            min_weight: 0.02,
            iterations: 60,
            tolerance: 1e-4,
        })
    }
}

/// A component of less weight has no share of any clump.
const MIN_SHARE: f64 = 1e-12;

impl<const D: usize> Clumps<D> {
    /// A Gaussian mixture of the same mean and covariance, by expectation-maximisation over the clumps.
    ///
    /// A clump is used with its covariance: its expected log density determines its shares, and its covariance enters that of the
    /// components. The start is the coarsest split of the clumps, so the result is deterministic.
    ///
    /// # Errors
    /// If the total covariance is singular.
    pub fn fit(&self, options: &MixtureFit) -> Result<Mixture<D>, Error> {
        // This floor keeps a component from shrinking to a single clump. It is below the resolution of the belief.
        let limits = Limits {
            variances: (self.gaussian().covariance().diagonal() * 1e-9).sup(&self.least),
            weight: MIN_SHARE,
        };
        let centres: Vec<_> = self.clumps.iter().map(|c| (c.mean, c.weight)).collect();
        let spreads: Vec<_> = self.clumps.iter().map(|c| c.covariance).collect();
        let points = Points::new(&centres).with_spreads(&spreads);
        let start = self.start(options.components).into_iter();
        let of = |c: Clump<D>| Component::new(c.weight, c.mean, raised(c.covariance, &limits.variances));
        let mut components = start.map(of).collect::<Result<Vec<_>, _>>()?;
        loop {
            let mut before = f64::NEG_INFINITY;
            for _ in 0..options.iterations {
                let mean_log = step(&points, &mut components, &limits, true)?;
                // Stop: the mean log density rose by at most `tolerance` nats.
                let gained = mean_log - before;
                if gained <= options.tolerance || gained.is_nan() {
                    break;
                }
                before = mean_log;
            }
            let weights = components.iter().map(Component::weight).enumerate();
            // A component of little weight is removed, and the others are fitted again.
            match weights.min_by(|a, b| a.1.total_cmp(&b.1)) {
                Some((at, weight)) if weight < options.min_weight && components.len() > 1 => {
                    components.swap_remove(at);
                }
                _ => return Mixture::new(components),
            }
        }
    }

    fn start(&self, count: usize) -> Vec<Clump<D>> {
        let column = |d: usize| self.clumps.iter().map(|c| c.mean[d]).collect::<Vec<_>>();
        let columns: [Vec<f64>; D] = std::array::from_fn(column);
        let weights: Vec<f64> = self.clumps.iter().map(|c| c.weight).collect();
        let none: Columns<'_, D> = [&[]; D];
        match Clumps::new(&columns.each_ref().map(Vec::as_slice), &none, &weights, count) {
            Ok(coarse) => coarse.clumps,
            Err(_) => self.clumps.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::Belief;
    use nalgebra::{SMatrix, SVector};

    /// One step of expectation-maximisation as the textbooks have it, and the mean log density before it.
    fn step(clumps: &[Clump<2>], components: &[Clump<2>]) -> (Vec<Clump<2>>, f64) {
        let density = |k: &Clump<2>, c: &Clump<2>| {
            let precision = k.covariance.try_inverse().unwrap();
            let d = c.mean - k.mean;
            let square = d.dot(&(precision * d)) + (precision * c.covariance).trace();
            k.weight * (-0.5 * square).exp() / k.covariance.determinant().sqrt()
        };
        let total = |c: &Clump<2>| components.iter().map(|k| density(k, c)).sum::<f64>();
        let fitted = components.iter().map(|k| {
            let shares: Vec<f64> = clumps.iter().map(|c| c.weight * density(k, c) / total(c)).collect();
            let weight: f64 = shares.iter().sum();
            let mean = shares
                .iter()
                .zip(clumps)
                .map(|(s, c)| c.mean * *s)
                .sum::<SVector<f64, 2>>()
                / weight;
            let spread = |c: &Clump<2>| c.covariance + (c.mean - mean) * (c.mean - mean).transpose();
            let second: SMatrix<f64, 2, 2> = shares.iter().zip(clumps).map(|(s, c)| spread(c) * *s).sum();
            Clump {
                weight,
                mean,
                covariance: second / weight,
            }
        });
        (fitted.collect(), clumps.iter().map(|c| c.weight * total(c).ln()).sum())
    }

    #[test]
    fn fits_are_expectation_maximisation_until_it_gains_too_little() {
        // A bent band of points.
        let at = |i: i32| f64::from(i) * 0.05;
        let x: Vec<f64> = (0..120).map(|i| at(i) + 0.3 * (7.0 * at(i)).sin()).collect();
        let y: Vec<f64> = (0..120)
            .map(|i| 1e3 * ((at(i) - 2.0).powi(2) + (11.3 * at(i)).cos()))
            .collect();
        let weights: Vec<f64> = (0..120).map(|i| 1.2 + (1.7 * at(i)).sin()).collect();
        let clumps = Clumps::new(&[&x, &y], &[&[], &[]], &weights, 40).unwrap();
        let close = |found: &Mixture<2>, exact: &[Clump<2>]| {
            assert_eq!(found.len(), exact.len());
            let unit = SVector::from([1.0, 1e3]);
            for (a, b) in found.components().iter().zip(exact) {
                let gap = (a.covariance() - b.covariance).component_div(&(unit * unit.transpose()));
                let off = (a.mean() - b.mean).component_div(&unit);
                assert!((a.weight() - b.weight).abs() < 1e-8 && off.amax() < 1e-8 && gap.amax() < 1e-7, "{off} {gap}");
            }
        };
        let options = |iterations, tolerance, min_weight| MixtureFit {
            components: 3,
            min_weight,
            iterations,
            tolerance,
        };
        let mut exact = vec![clumps.start(3)];
        let mut heights = Vec::new();
        for k in 0..9 {
            let (next, height) = step(clumps.clumps(), &exact[k]);
            close(&clumps.fit(&options(k + 1, -1.0, 0.0)).unwrap(), &next);
            exact.push(next);
            heights.push(height);
        }
        // It ends after the first step before which the height rose by less than the tolerance.
        for k in [2, 5, 8] {
            let gain = heights[k] - heights[k - 1];
            assert!(gain < heights[k - 1] - heights[k - 2] || k == 2);
            let tolerance = 1.0001 * gain;
            let ends = (1..9).find(|k| heights[*k] - heights[*k - 1] <= tolerance).unwrap();
            close(&clumps.fit(&options(60, tolerance, 0.0)).unwrap(), &exact[ends + 1]);
        }
        // What is too light is dropped, one after the other, and the rest fitted on from where it was.
        let fitted = |least| clumps.fit(&options(9, -1.0, least)).unwrap();
        let lightest = (0..3)
            .min_by(|a, b| exact[9][*a].weight.total_cmp(&exact[9][*b].weight))
            .unwrap();
        let least = 1.0001 * exact[9][lightest].weight;
        let mut left = exact[9].clone();
        left.swap_remove(lightest);
        for _ in 0..9 {
            left = step(clumps.clumps(), &left).0;
        }
        assert!(left.iter().all(|c| c.weight > least));
        close(&fitted(least), &left);
        close(&fitted(0.9999 * exact[9][lightest].weight), &exact[9]);
        let one = fitted(1.0);
        assert!(
            one.len() == 1
                && (one.mean() - clumps.gaussian().mean())
                    .component_div(&SVector::from([1.0, 1e3]))
                    .amax()
                    < 1e-12
        );
        assert!(MixtureFit::new(0).is_err());
    }
}
