//! Moments of a scalar posterior by quadrature, wherever its mass may lie.

use super::Tilted;
use crate::error::Error;
use crate::gaussian::Gaussian;
use fewbits_numerics::normal::LN_SQRT_2PI;
use fewbits_numerics::quadrature::gauss_legendre;

/// Where a likelihood changes, and over which distance: the edge of a cell and the deviation of the noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    /// Where.
    pub location: f64,
    /// Over which distance.
    pub width: f64,
}

/// Below this share of the peak (in logarithms) the posterior is left out.
const DROP: f64 = 46.0;
/// Steps of a search for the mode between two candidates.
const SEARCH: usize = 60;
/// Most evaluations of the likelihood.
const MOST: usize = 200_000;
/// Panels are split until two rules agree to this share of the whole ...
const TOLERANCE: f64 = 1e-13;
/// ... or, where the likelihood's own rounding keeps them from it, until splitting no longer helps and they agree to this.
const ROUNDING: f64 = 1e-9;

/// Evidence, mean and variance of `m ~ prior` under any scalar likelihood, to about 1e-12 relative.
///
/// `features` say where the likelihood changes. The posterior's logarithm is compared at the prior's mean, at the features,
/// between them on every scale and around them; the best is refined to the mode; the axis is cut where the posterior has
/// fallen by `exp(-46)`; and what is left is integrated adaptively, with panels that begin at the features.
///
/// # Errors
/// [`Error::Impossible`] if the posterior is zero wherever it was looked for; [`Error::NotConverged`].
pub fn tilted_by_quadrature(
    prior: &Gaussian<1>,
    features: impl IntoIterator<Item = Feature>,
    log_likelihood: impl Fn(f64) -> f64,
) -> Result<Tilted<1>, Error> {
    let (centre, variance) = (prior.mean()[0], prior.covariance()[0]);
    let deviation = variance.sqrt();
    if deviation == 0.0 {
        return Tilted::unchanged(prior, log_likelihood(centre));
    }
    // All in deviations of the prior from its mean.
    let log_density = |t: f64| {
        let value = log_likelihood(centre + deviation * t) - 0.5 * t * t;
        if value.is_nan() { f64::NEG_INFINITY } else { value }
    };
    let features: Vec<(f64, f64)> = features
        .into_iter()
        .map(|f| ((f.location - centre) / deviation, f.width / deviation))
        .filter(|(at, width)| at.is_finite() && width.is_finite())
        .collect();
    let places = candidates(&features);
    let mut integrator = Integrator::new(&log_density);
    let values: Vec<f64> = places.iter().map(|t| integrator.log(*t)).collect();
    let best = (0..places.len())
        .max_by(|i, j| values[*i].total_cmp(&values[*j]))
        .ok_or(Error::Impossible)?;
    if values[best] == f64::NEG_INFINITY {
        return Err(Error::Impossible);
    }
    let left = if best > 0 { places[best - 1] } else { places[best] - 1.0 };
    let right = places.get(best + 1).copied().unwrap_or(places[best] + 1.0);
    let (mode, peak) = integrator.maximum(left, places[best], values[best], right);

    // Every place still worth counting, and a step beyond the outermost ones.
    let worth = |i: &usize| values[*i] > peak - DROP;
    let counted = || (0..places.len()).filter(worth).map(|i| places[i]);
    let low = integrator.edge(counted().fold(mode, f64::min), -1.0, peak - DROP);
    let high = integrator.edge(counted().fold(mode, f64::max), 1.0, peak - DROP);
    let mut breaks: Vec<f64> = places.into_iter().filter(|t| low < *t && *t < high).collect();
    breaks.extend([low, mode, high]);
    breaks.sort_by(f64::total_cmp);
    breaks.dedup();
    let sums = integrator.integrate(&breaks, mode, peak)?;
    let shift = sums[1] / sums[0];
    let second = sums[2] / sums[0] - shift * shift;
    let log_evidence = peak + sums[0].ln() - LN_SQRT_2PI;
    Tilted::scalar(log_evidence, centre + deviation * (mode + shift), variance * second)
}

/// Places at which to look for the mode: increasing, without repetition.
fn candidates(features: &[(f64, f64)]) -> Vec<f64> {
    const AROUND: [f64; 6] = [-8.0, -3.0, -1.0, 1.0, 3.0, 8.0];
    let mut places = vec![0.0];
    places.extend(AROUND);
    for (at, width) in features {
        places.push(*at);
        places.extend(AROUND.map(|k| at + k * width));
        // Between the prior and the feature on every scale: precisions of prior and likelihood are weighed against each other.
        for k in -13..=13 {
            let weight = f64::from(k * 2).exp2();
            places.push(at * weight / (1.0 + weight));
        }
    }
    places.retain(|t| t.is_finite());
    places.sort_by(f64::total_cmp);
    places.dedup();
    places
}

struct Integrator<'a, F> {
    log_density: &'a F,
    evaluations: usize,
}

impl<'a, F: Fn(f64) -> f64> Integrator<'a, F> {
    fn new(log_density: &'a F) -> Self {
        Self {
            log_density,
            evaluations: 0,
        }
    }

    fn log(&mut self, t: f64) -> f64 {
        self.evaluations += 1;
        (self.log_density)(t)
    }

    /// Golden-section search around a candidate that is no worse than its neighbours.
    fn maximum(&mut self, mut left: f64, mut best: f64, mut value: f64, mut right: f64) -> (f64, f64) {
        const SHARE: f64 = 0.381_966_011_250_105_2;
        for _ in 0..SEARCH {
            if right - left <= 1e-13 * (left.abs() + right.abs()) {
                break;
            }
            let probe = if right - best > best - left {
                best + SHARE * (right - best)
            } else {
                best - SHARE * (best - left)
            };
            let here = self.log(probe);
            if here > value {
                if probe > best {
                    left = best
                } else {
                    right = best
                }
                (best, value) = (probe, here);
            } else if probe > best {
                right = probe;
            } else {
                left = probe;
            }
        }
        (best, value)
    }

    /// Where, going outwards from `from`, the logarithm falls below `floor`.
    fn edge(&mut self, from: f64, direction: f64, floor: f64) -> f64 {
        // Sixty doublings from the smallest step span the numbers that a posterior can live on: it is no wider than the prior.
        let mut step = 1e-12 * from.abs().max(1e-6);
        let mut inside = from;
        let mut outside = from + direction * step;
        while self.log(outside) > floor && step < 64.0 + from.abs() {
            step *= 4.0;
            inside = outside;
            outside = from + direction * step;
        }
        for _ in 0..6 {
            let middle = 0.5 * (inside + outside);
            if self.log(middle) > floor {
                inside = middle
            } else {
                outside = middle
            }
        }
        outside
    }

    /// `integral (1, t - mode, (t - mode)^2) exp(log density - peak) dt` between the breaks.
    fn integrate(&mut self, breaks: &[f64], mode: f64, peak: f64) -> Result<[f64; 3], Error> {
        let mut panels = Vec::with_capacity(64);
        let mut whole = [f64::MIN_POSITIVE; 3];
        for pair in breaks.windows(2) {
            let sums = self.panel(pair[0], pair[1], mode, peak);
            (0..3).for_each(|k| whole[k] += sums[k].abs());
            panels.push((pair[0], pair[1], sums, f64::INFINITY));
        }
        let mut total = [0.0; 3];
        while let Some((a, b, coarse, error_before)) = panels.pop() {
            if self.evaluations > MOST {
                return Err(Error::NotConverged {
                    evaluations: self.evaluations,
                });
            }
            let middle = 0.5 * (a + b);
            let (left, right) = (self.panel(a, middle, mode, peak), self.panel(middle, b, mode, peak));
            let share = |k: usize| (left[k] + right[k] - coarse[k]).abs() / whole[k];
            let error = (0..3).map(share).fold(0.0, f64::max);
            let at_rounding = error < ROUNDING && error > 0.1 * error_before;
            if error <= TOLERANCE || at_rounding || middle <= a || middle >= b {
                (0..3).for_each(|k| total[k] += left[k] + right[k]);
            } else {
                panels.push((a, middle, left, error));
                panels.push((middle, b, right, error));
            }
        }
        if total[0] > 0.0 {
            Ok(total)
        } else {
            Err(Error::Impossible)
        }
    }

    fn panel(&mut self, a: f64, b: f64, mode: f64, peak: f64) -> [f64; 3] {
        let mut sums = [0.0; 3];
        for (t, w) in gauss_legendre::<16>().on(a, b) {
            let p = w * (self.log(t) - peak).exp();
            let d = t - mode;
            sums[0] += p;
            sums[1] += p * d;
            sums[2] += p * d * d;
        }
        sums
    }
}
