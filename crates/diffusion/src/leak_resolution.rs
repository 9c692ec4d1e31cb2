//! The error of a [`LeakBelief`](crate::LeakBelief) by its own resolution: a cell, a start and a rate stand for all around them.

/// Largest number of slopes: the logarithm of the rate, the start, three axes.
pub(crate) const SLOPES: usize = 5;
/// Share of the variance of the linear error that each value has for itself: within a cell a response is no straight line.
const OWN: f64 = 0.05;

/// What a sensor measures under one hypothesis.
pub(crate) struct Law {
    pub(crate) mean: f64,
    /// Change of the mean by one standard deviation of the rate, start and place that the hypothesis stands for.
    pub(crate) slopes: [f64; SLOPES],
    /// Standard deviation of what is quadratic in them.
    pub(crate) curvature: f64,
}

impl Law {
    fn linear(&self) -> f64 {
        self.slopes.iter().map(|slope| slope * slope).sum()
    }

    /// Standard deviation of the whole error of resolution.
    pub(crate) fn error(&self) -> f64 {
        self.linear().sqrt().hypot(self.curvature)
    }
}

/// By hypothesis, the Gaussian distribution of the offsets that all values of a sensor share: of rate, start and place, each of mean 0 and variance 1
/// before the first value.
#[derive(Debug, Clone)]
pub(crate) struct Offsets {
    slopes: usize,
    /// Per hypothesis the means, and the upper triangle of the covariance by rows.
    kept: Vec<f64>,
}

impl Offsets {
    /// In a domain of so many axes.
    pub(crate) fn new(hypotheses: usize, axes: usize) -> Self {
        let slopes = 2 + axes;
        let mut first = vec![0.0; slopes];
        first.extend((0..slopes).flat_map(|i| (i..slopes).map(move |j| f64::from(u8::from(i == j)))));
        let kept = first.repeat(hypotheses);
        Self { slopes, kept }
    }

    fn size(&self) -> usize {
        self.slopes * (self.slopes + 3) / 2
    }

    /// Mean and variance of the next value under a hypothesis, without its noise.
    pub(crate) fn predicted(&self, hypothesis: usize, law: &Law) -> (f64, f64) {
        let kept = &self.kept[hypothesis * self.size()..][..self.size()];
        let (means, covariance) = kept.split_at(self.slopes);
        let product = times(covariance, &law.slopes[..self.slopes]);
        let dot = |x: &[f64]| law.slopes.iter().zip(x).map(|(slope, x)| slope * x).sum::<f64>();
        (law.mean + dot(means), dot(&product).max(0.0) + OWN * law.linear() + law.curvature * law.curvature)
    }

    /// Takes a value in: `residual` from the predicted mean, `variance` with its noise, `weight` the probability that it is no fault.
    pub(crate) fn update(&mut self, hypothesis: usize, law: &Law, residual: f64, variance: f64, weight: f64) {
        let (slopes, size) = (self.slopes, self.size());
        let (means, covariance) = self.kept[hypothesis * size..][..size].split_at_mut(slopes);
        let product = times(covariance, &law.slopes[..slopes]);
        let mut entries = covariance.iter_mut();
        for (i, mean) in means.iter_mut().enumerate() {
            let gain = weight * product[i] / variance;
            *mean += gain * residual;
            for (other, entry) in product[i..slopes].iter().zip(entries.by_ref()) {
                *entry -= gain * other;
            }
        }
    }
}

/// A symmetric matrix, given by its upper triangle, times a vector.
fn times(triangle: &[f64], vector: &[f64]) -> [f64; SLOPES] {
    let (mut product, mut entries) = ([0.0; SLOPES], triangle.iter());
    for i in 0..vector.len() {
        for (j, entry) in (i..vector.len()).zip(entries.by_ref()) {
            product[i] += entry * vector[j];
            if j > i {
                product[j] += entry * vector[i];
            }
        }
    }
    product
}
