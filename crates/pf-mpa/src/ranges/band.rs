//! The interval that holds 95 % of a mixture of normal laws.

use fewbits_numerics::kernels::{scalar, vectorised};

/// Deviations to either side of a mean that hold 95 % of a normal law.
const BAND: f64 = 1.959_963_984_540_054;
/// Steps to an end at most, and by how much the probability beside it may be off.
const STEPS: usize = 60;
const CLOSE: f64 = 1e-6;
/// So many deviations beyond its mean a law is as good as over.
const FAR: f64 = 6.0;

/// A mixture, column by column.
#[derive(Debug, Default)]
pub(super) struct Laws {
    shares: Vec<f64>,
    means: Vec<f64>,
    deviations: Vec<f64>,
    /// Of each law at one place: the place in its deviations, probability below, and density.
    scores: Vec<f64>,
    below: Vec<f64>,
    densities: Vec<f64>,
}

impl Laws {
    pub(super) fn clear(&mut self) {
        self.shares.clear();
        self.means.clear();
        self.deviations.clear();
    }

    pub(super) fn push(&mut self, share: f64, mean: f64, deviation: f64) {
        self.shares.push(share);
        self.means.push(mean);
        self.deviations.push(deviation);
    }

    /// The ends, with 2.5 % on either side.
    pub(super) fn band(&mut self) -> (f64, f64) {
        let count = self.means.len();
        for column in [&mut self.scores, &mut self.below, &mut self.densities] {
            column.resize(count, 0.0);
        }
        (self.end(-BAND, 0.025), self.end(BAND, 0.975))
    }

    fn law(&self, i: usize) -> (f64, f64, f64) {
        (self.shares[i], self.means[i], self.deviations[i])
    }

    /// Where the probability below reaches `target`, by Halley's steps between ends that hold it. `off`: the place for one law, in deviations.
    fn end(&mut self, off: f64, target: f64) -> f64 {
        let count = self.means.len();
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for i in 0..count {
            let (_, mean, deviation) = self.law(i);
            let end = mean + off * deviation;
            (low, high) = (low.min(end), high.max(end));
        }
        if count == 1 {
            return low;
        }
        // The end of the normal law with the mixture's moments is near.
        let mean: f64 = (0..count).map(|i| self.shares[i] * self.means[i]).sum();
        let variance =
            |(share, centre, deviation): (f64, f64, f64)| share * (deviation * deviation + (centre - mean).powi(2));
        let spread: f64 = (0..count).map(|i| variance(self.law(i))).sum();
        let mut x = (mean + off * spread.sqrt()).clamp(low, high);
        for _ in 0..STEPS {
            let (error, density, slope) = self.at(x, target);
            if error.abs() < CLOSE || low >= high {
                break;
            }
            if error < 0.0 {
                low = x
            } else {
                high = x
            }
            let newton = error / density;
            let bend = 1.0 - 0.5 * newton * slope / density;
            let step = x - newton / bend.clamp(0.5, 2.0);
            x = if step > low && step < high {
                step
            } else {
                0.5 * (low + high)
            };
        }
        x
    }

    /// Probability below a place less `target`, density, and its slope.
    fn at(&mut self, x: f64, target: f64) -> (f64, f64, f64) {
        let count = self.means.len();
        let (means, deviations) = (&self.means[..count], &self.deviations[..count]);
        let (scores, probabilities) = (&mut self.scores[..count], &mut self.below[..count]);
        let densities = &mut self.densities[..count];
        vectorised(
            #[inline(always)]
            || {
                for i in 0..count {
                    let z = (x - means[i]) / deviations[i];
                    scores[i] = z;
                    probabilities[i] = scalar::cdf(z);
                    densities[i] = scalar::pdf(z);
                }
            },
        );
        let (mut below, mut density, mut slope) = (0.0, 0.0, 0.0);
        for i in 0..count {
            let (share, z) = (self.shares[i], self.scores[i]);
            if z.abs() > FAR {
                below += if z > 0.0 { share } else { 0.0 };
                continue;
            }
            // A law without a deviation, at its mean.
            below += share * if z.is_nan() { 0.5 } else { self.below[i] };
            if self.deviations[i] > 0.0 {
                let own = share * self.densities[i] / self.deviations[i];
                density += own;
                slope -= own * z / self.deviations[i];
            }
        }
        (below - target, density, slope)
    }
}
