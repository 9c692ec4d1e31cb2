//! Moments of a scalar posterior by quadrature.

use super::Tilted;
use crate::error::Error;
use crate::gaussian::Gaussian;
use fewbits_numerics::normal::LN_SQRT_2PI;
use fewbits_numerics::quadrature::gauss_legendre;
use fewbits_numerics::{bisect, kernels};

/// A place where a likelihood changes, such as the edge of a cell, and the distance over which it changes, such as the noise deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Feature {
    /// Position on the measurement axis.
    pub location: f64,
    /// Distance over which the likelihood changes, in measurement units.
    pub width: f64,
}

/// Where the log posterior is further below its peak than this, it is left out of the integral.
const DROP: f64 = 46.0;
/// Largest number of steps of a search for the mode between two candidates.
const SEARCH: usize = 80;
/// Largest number of evaluations of the likelihood.
const MAX_EVALUATIONS: usize = 200_000;
/// Panels are split until two quadrature rules agree to this fraction of the integral ...
const TOLERANCE: f64 = 1e-11;
/// ... or, if rounding of the likelihood prevents that, until splitting no longer helps and they agree to this fraction.
const ROUNDING: f64 = 1e-9;

/// Evidence, mean and variance of `m ~ prior` under any scalar likelihood, to about 1e-12 relative.
///
/// `log_likelihoods(nodes, logs)` adds `ln p(observation | m)` at each of the nodes to `logs`; `features` lists where the
/// likelihood changes. Steps:
/// 1. Evaluate the log posterior at the prior's mean, at and around the features, and between prior and features on every scale.
/// 2. Refine the best of these points to the mode.
/// 3. Cut the axis where the posterior has fallen by `exp(-46)`.
/// 4. Integrate the rest adaptively, with panels that begin at the features.
///
/// # Errors
/// [`Error::Impossible`] if the posterior is zero at every point that was evaluated; [`Error::NotANumber`] if the likelihood or the prior
/// is NaN or infinite; [`Error::NotConverged`] if the accuracy is not reached.
pub fn tilted_by_quadrature(
    prior: &Gaussian<1>,
    features: impl IntoIterator<Item = Feature>,
    log_likelihoods: impl Fn(&[f64], &mut [f64]),
) -> Result<Tilted<1>, Error> {
    let (centre, variance) = (prior.mean()[0], prior.covariance()[0]);
    let deviation = variance.sqrt();
    if !(centre.is_finite() && deviation.is_finite()) {
        return Err(Error::NotANumber { what: "the prior" });
    }
    if deviation == 0.0 {
        let mut log = [0.0];
        log_likelihoods(&[centre], &mut log);
        return Tilted::unchanged(prior, log[0]);
    }
    // From here on positions are in prior deviations from the prior's mean.
    let features: Vec<(f64, f64)> = features
        .into_iter()
        .map(|f| ((f.location - centre) / deviation, f.width / deviation))
        .filter(|(at, width)| at.is_finite() && width.is_finite())
        .collect();
    let mut posterior = Posterior {
        centre,
        deviation,
        log_likelihoods,
        evaluations: 0,
        no_number: false,
    };
    let tilted = posterior.tilted(&features);
    if posterior.no_number {
        return Err(Error::NotANumber { what: "the likelihood" });
    }
    tilted
}

impl<F: Fn(&[f64], &mut [f64])> Posterior<F> {
    fn tilted(&mut self, features: &[(f64, f64)]) -> Result<Tilted<1>, Error> {
        let posterior = self;
        let (centre, deviation) = (posterior.centre, posterior.deviation);
        if let Some(tilted) = posterior.by_trapezoid(features) {
            return Ok(tilted);
        }
        let places = candidates(features);
        let mut values = vec![0.0; places.len()];
        posterior.logs(&places, &mut values);
        let best = (0..places.len())
            .max_by(|i, j| values[*i].total_cmp(&values[*j]))
            .ok_or(Error::Impossible)?;
        if values[best] == f64::NEG_INFINITY {
            return Err(Error::Impossible);
        }
        let beside = |i: Option<usize>, otherwise: f64| {
            i.and_then(|i| Some((*places.get(i)?, values[i])))
                .unwrap_or((otherwise, f64::NEG_INFINITY))
        };
        let left = beside(best.checked_sub(1), places[best] - 1.0);
        let right = beside(Some(best + 1), places[best] + 1.0);
        let (mode, peak) = posterior.maximum(left, (places[best], values[best]), right);

        // Keep all points with a posterior above the cut, and a step beyond the outermost ones.
        let counted = || {
            (0..places.len())
                .filter(|i| values[*i] > peak - DROP)
                .map(|i| places[i])
        };
        // A width may underflow; a step of zero would never end.
        let finest = (features.iter().map(|f| f.1).fold(1.0, f64::min) / 64.0).max(f64::MIN_POSITIVE);
        let low = posterior.edge(counted().fold(mode, f64::min), -finest, peak - DROP);
        let high = posterior.edge(counted().fold(mode, f64::max), finest, peak - DROP);
        let mut breaks = vec![low, mode, high];
        let around = features
            .iter()
            .flat_map(|(at, width)| [-8.0, -3.0, 0.0, 3.0, 8.0].map(|k| at + k * width));
        breaks.extend(around.filter(|t| low < *t && *t < high));
        breaks.sort_by(f64::total_cmp);
        breaks.dedup();
        let sums = posterior.integrate(&breaks, mode, peak)?;
        let shift = sums[1] / sums[0];
        let second = sums[2] / sums[0] - shift * shift;
        let log_evidence = peak + sums[0].ln() - LN_SQRT_2PI;
        Tilted::scalar(log_evidence, centre + deviation * (mode + shift), deviation * deviation * second)
    }
}

/// Points at which the search for the mode begins: increasing, without repetition.
fn candidates(features: &[(f64, f64)]) -> Vec<f64> {
    const AROUND: [f64; 4] = [-4.0, -1.0, 1.0, 4.0];
    let mut places = vec![0.0];
    places.extend(AROUND);
    for (at, width) in features {
        places.push(*at);
        places.extend(AROUND.map(|k| at + k * width));
        // The mode is a precision-weighted mean of prior and feature. Try weights over many powers of two.
        for k in -7..=7 {
            let weight = f64::from(k * 4).exp2();
            places.push(at * weight / (1.0 + weight));
        }
    }
    places.retain(|t| t.is_finite());
    places.sort_by(f64::total_cmp);
    places.dedup();
    places
}

/// Nodes of the coarse and the fine rule that are compared on a panel.
const COARSE: usize = 10;
const FINE: usize = 21;

struct Posterior<F> {
    centre: f64,
    deviation: f64,
    log_likelihoods: F,
    evaluations: usize,
    /// Whether the likelihood was NaN or `+inf` at some node.
    no_number: bool,
}

impl<F: Fn(&[f64], &mut [f64])> Posterior<F> {
    /// Writes the logarithms of likelihood times `exp(-t^2/2)`, at most 128 at a time.
    fn logs(&mut self, at: &[f64], logs: &mut [f64]) {
        let mut nodes = [0.0; 128];
        for (at, logs) in at.chunks(nodes.len()).zip(logs.chunks_mut(nodes.len())) {
            let nodes = &mut nodes[..at.len()];
            for ((node, log), t) in nodes.iter_mut().zip(logs.iter_mut()).zip(at) {
                *node = self.centre + self.deviation * t;
                *log = -0.5 * t * t;
            }
            (self.log_likelihoods)(nodes, logs);
            for log in logs.iter_mut().filter(|log| log.is_nan() || **log == f64::INFINITY) {
                *log = f64::NEG_INFINITY;
                self.no_number = true;
            }
            self.evaluations += at.len();
        }
    }

    /// The moments by the trapezoid rule; `None` if features are far from the prior or narrower than it, or if the rule does not converge.
    ///
    /// For an entire function under a Gaussian its error falls as `exp(-c/h^2)`. The rule with every second node needs no evaluations of
    /// its own, and the error of the full rule is about the fourth power of the difference: `1e-3` leaves `1e-12`. Nodes extend as far as
    /// the posterior does, in multiples of eight that fill vector registers.
    fn by_trapezoid(&mut self, features: &[(f64, f64)]) -> Option<Tilted<1>> {
        const NEAR: f64 = 4.5;
        const REACH: f64 = 9.0;
        const MAX_NODES: usize = 128;
        const NEGLIGIBLE: f64 = 34.0;
        let finest = features.iter().map(|f| f.1).fold(1.0, f64::min);
        // A likelihood that changes far out, or over less than .3 prior deviations, needs the adaptive rule.
        if features.iter().any(|(at, _)| at.abs() > 6.0) || finest < 0.3 {
            return None;
        }
        let step = 0.5 * finest;
        // Most posteriors lie within `NEAR` prior deviations; nodes beyond are evaluated only if the integrand has not fallen there.
        let near = 4 * (NEAR / (4.0 * step)).ceil() as usize;
        let most = near + 8 * ((REACH - step * near as f64) / (8.0 * step)).ceil() as usize;
        let (mut nodes, mut logs, mut weights) = ([0.0; MAX_NODES], [0.0; MAX_NODES], [0.0; MAX_NODES]);
        let (nodes, logs) = (nodes.get_mut(..2 * most)?, logs.get_mut(..2 * most)?);
        for (i, t) in nodes.iter_mut().enumerate() {
            *t = step * (i as f64 - most as f64);
        }
        let (mut from, mut to) = (most - near, most + near);
        self.logs(&nodes[from..to], &mut logs[from..to]);
        let reached = |logs: &[f64]| {
            let peak = kernels::largest(logs);
            (peak.is_finite() && logs[0].max(logs[logs.len() - 1]) <= peak - NEGLIGIBLE).then_some(peak)
        };
        let features_are_near = features.iter().all(|(at, _)| at.abs() <= NEAR - 1.0);
        let peak = match reached(&logs[from..to]).filter(|_| features_are_near) {
            Some(peak) => peak,
            None => {
                self.logs(&nodes[..from], &mut logs[..from]);
                self.logs(&nodes[to..], &mut logs[to..]);
                (from, to) = (0, 2 * most);
                reached(logs)?
            }
        };
        let (nodes, weights) = (&nodes[from..to], &mut weights[from..to]);
        kernels::exp_minus(&logs[from..to], peak, weights);
        // The sum over every second node is the same rule at twice the step. Their difference estimates the error of the coarser rule,
        // which is far above that of the finer one.
        let (mut all, mut even) = ([0.0; 3], [0.0; 3]);
        for (i, (t, p)) in nodes.iter().zip(&*weights).enumerate() {
            for (k, term) in [*p, p * t, p * t * t].into_iter().enumerate() {
                all[k] += term;
                if i % 2 == 0 {
                    even[k] += 2.0 * term;
                }
            }
        }
        let scales = [all[0], (all[0] * all[2]).sqrt(), all[2]];
        if (0..3).any(|k| (all[k] - even[k]).abs() > 1e-3 * scales[k]) {
            return None;
        }
        // The variance is summed about the mean, since the difference of raw moments would cancel for a narrow posterior.
        let shift = all[1] / all[0];
        let spread = |(t, p): (&f64, &f64)| p * (t - shift) * (t - shift);
        let second = nodes.iter().zip(&*weights).map(spread).sum::<f64>() / all[0];
        let log_evidence = peak + (all[0] * step).ln() - LN_SQRT_2PI;
        let mean = self.centre + self.deviation * shift;
        Tilted::scalar(log_evidence, mean, self.deviation * self.deviation * second).ok()
    }

    fn log(&mut self, t: f64) -> f64 {
        let mut log = [0.0];
        self.logs(&[t], &mut log);
        log[0]
    }

    /// Golden-section search around a candidate that is no worse than its neighbours. Stops when the log posterior varies by less than one
    /// over the bracket; the quadrature resolves the rest.
    fn maximum(&mut self, mut left: (f64, f64), mut best: (f64, f64), mut right: (f64, f64)) -> (f64, f64) {
        // Golden section: the probe divides the longer part, so that each step shrinks the bracket by at least .618.
        const SHARE: f64 = 0.381_966_011_250_105_2;
        for _ in 0..SEARCH {
            // The log posterior varies by less than one over the bracket: the quadrature resolves the rest.
            let flat = best.1 - left.1.min(right.1) < 1.0;
            if flat || right.0 - left.0 <= 1e-15 * (left.0.abs() + right.0.abs()) {
                break;
            }
            let probe = if right.0 - best.0 > best.0 - left.0 {
                best.0 + SHARE * (right.0 - best.0)
            } else {
                best.0 - SHARE * (best.0 - left.0)
            };
            let here = (probe, self.log(probe));
            match (here.1 > best.1, probe > best.0) {
                (true, true) => (left, best) = (best, here),
                (true, false) => (right, best) = (best, here),
                (false, true) => right = here,
                (false, false) => left = here,
            }
        }
        best
    }

    /// The point where the log posterior falls below `floor`, searched from `from` in the direction of `step` with growing steps.
    fn edge(&mut self, from: f64, step: f64, floor: f64) -> f64 {
        let mut step = step;
        let mut inside = from;
        let mut outside = from + step;
        while self.log(outside) > floor && step.abs() < 64.0 + from.abs() {
            step *= 4.0;
            inside = outside;
            outside = from + step;
        }
        bisect::boundary(|t| self.log(t) > floor, inside, outside, 4).1
    }

    /// `integral (1, t - mode, (t - mode)^2) exp(log density - peak) dt` between the breaks.
    fn integrate(&mut self, breaks: &[f64], mode: f64, peak: f64) -> Result<[f64; 3], Error> {
        let mut panels: Vec<(f64, f64, f64)> = breaks
            .windows(2)
            .map(|pair| (pair[0], pair[1], f64::INFINITY))
            .collect();
        let mut total = [0.0; 3];
        // The sum so far only grows, so a panel that is small against it is small against the whole integral.
        let mut whole = [f64::MIN_POSITIVE; 3];
        while let Some((a, b, error_before)) = panels.pop() {
            if self.evaluations > MAX_EVALUATIONS {
                return Err(Error::NotConverged {
                    what: "the moments of the posterior",
                    steps: self.evaluations,
                    unit: "evaluations of the likelihood",
                });
            }
            let (coarse, fine) = self.panel(a, b, mode, peak);
            let share = |k: usize| (fine[k] - coarse[k]).abs() / whole[k].max(fine[k].abs());
            let error = (0..3).map(share).fold(0.0, f64::max);
            let at_rounding = error < ROUNDING && error > 0.1 * error_before;
            let middle = 0.5 * (a + b);
            if error <= TOLERANCE || at_rounding || middle <= a || middle >= b {
                for k in 0..3 {
                    total[k] += fine[k];
                    whole[k] += fine[k].abs();
                }
            } else {
                panels.push((a, middle, error));
                panels.push((middle, b, error));
            }
        }
        if total[0] > 0.0 {
            Ok(total)
        } else {
            Err(Error::Impossible)
        }
    }

    /// The sums over a panel by both rules.
    fn panel(&mut self, a: f64, b: f64, mode: f64, peak: f64) -> ([f64; 3], [f64; 3]) {
        let (mut nodes, mut weights) = ([0.0; COARSE + FINE], [0.0; COARSE + FINE]);
        let both = gauss_legendre::<COARSE>()
            .on(a, b)
            .chain(gauss_legendre::<FINE>().on(a, b));
        for (i, (t, w)) in both.enumerate() {
            (nodes[i], weights[i]) = (t, w);
        }
        let mut logs = [0.0; COARSE + FINE];
        self.logs(&nodes, &mut logs);
        // Moments about the mode, and densities relative to the peak: neither overflows nor cancels.
        let sums = |range: std::ops::Range<usize>| {
            let mut sums = [0.0; 3];
            for i in range {
                let p = weights[i] * (logs[i] - peak).exp();
                let d = nodes[i] - mode;
                sums[0] += p;
                sums[1] += p * d;
                sums[2] += p * d * d;
            }
            sums
        };
        (sums(0..COARSE), sums(COARSE..COARSE + FINE))
    }
}
