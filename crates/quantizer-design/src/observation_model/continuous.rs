//! Priors with a density that is not one normal bell.

use crate::error::{Error, refuse};
use fewbits_numerics::error::{all_finite, at_least_one, entries, finite, positive, probabilities};
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;

/// Half-width of a bell's support, in its standard deviations.
const BELL_REACH: f64 = 9.0;
/// Largest step of the trapezoid rule in units of the narrowest bell: its error is below 1e-30.
const BELL_STEP: f64 = 0.5;
/// Nodes of a Gauss-Legendre panel on a bounded support.
const PANEL_NODES: usize = 8;
/// Panels and nodes per panel by which a function is stored.
const TABLE_PANELS: usize = 64;
const TABLE_NODES: usize = 12;
/// Largest relative difference of the integrals by half the panels and by all: a rougher function is refused.
const ROUGHNESS: f64 = 1e-6;
/// Fewest values of a sample.
const MIN_SAMPLE: usize = 5;

/// A density on the line: uniform, a mixture of normal densities, a smoothed sample, or a function on an interval.
#[derive(Debug, Clone, PartialEq)]
pub struct Continuous {
    pub(super) shape: Shape,
    mean: f64,
    deviation: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) enum Shape {
    Uniform {
        low: f64,
        high: f64,
    },
    Mixture {
        weights: Vec<f64>,
        means: Vec<f64>,
        deviations: Vec<f64>,
    },
    /// The sample itself; the bells stand at `mean + shrink (x - mean)`, so that the density has the sample's variance.
    Sample {
        values: Vec<f64>,
        centres: Vec<f64>,
        fit: SampleFit,
    },
    /// Values at the Gauss-Legendre nodes of equal panels.
    Table {
        low: f64,
        high: f64,
        densities: Vec<f64>,
    },
}

/// Errors of a prior that was estimated from a sample: by smoothing, and because the sample is finite.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SampleFit {
    /// Standard deviation of the bell at each value, in the unit of the sample.
    pub bandwidth: f64,
    /// Largest difference of the distribution functions of the smooth density and of the sample: what smoothing changes.
    pub smoothing_error: f64,
    /// With a probability of 95 % no distribution function of the source differs from the sample's by more than this
    /// (Kolmogorov): what is not known because the sample is finite.
    pub sampling_error: f64,
    /// Standard error of the mean, in the unit of the sample.
    pub mean_standard_error: f64,
    /// Standard error of the standard deviation, in the unit of the sample.
    pub deviation_standard_error: f64,
}

impl Continuous {
    pub(super) fn uniform(low: f64, high: f64) -> Result<Self, Error> {
        finite("low", low)?;
        finite("high", high)?;
        if low >= high || !(high - low).is_finite() {
            return refuse("high", high, format!("a number above low = {low}"));
        }
        Ok(Self {
            mean: 0.5 * low + 0.5 * high,
            deviation: (high - low) / 12f64.sqrt(),
            shape: Shape::Uniform { low, high },
        })
    }

    pub(super) fn mixture(weights: Vec<f64>, means: Vec<f64>, deviations: Vec<f64>) -> Result<Self, Error> {
        probabilities("weights", &weights)?;
        all_finite("means", &means)?;
        for deviation in &deviations {
            positive("deviation", *deviation)?;
        }
        if weights.len() != means.len() || weights.len() != deviations.len() {
            let given = format!("{} weights, {} means, {} deviations", weights.len(), means.len(), deviations.len());
            return refuse("weights", given, "one of each per component");
        }
        let total: f64 = weights.iter().sum();
        let first = means[0];
        let mean = first + weights.iter().zip(&means).map(|(w, m)| w * (m - first)).sum::<f64>() / total;
        let parts = weights.iter().zip(&means).zip(&deviations);
        let variance = parts
            .map(|((w, m), d)| w * (d * d + (m - mean) * (m - mean)))
            .sum::<f64>()
            / total;
        positive("variance", variance)?;
        Ok(Self {
            mean,
            deviation: variance.sqrt(),
            shape: Shape::Mixture {
                weights,
                means,
                deviations,
            },
        })
    }

    /// Bells of Silverman's width, `0.9 min(s, IQR / 1.34) n^(-1/5)`, drawn together so that mean and variance are the sample's.
    pub(super) fn sample(values: &[f64]) -> Result<Self, Error> {
        all_finite("values", values)?;
        let count = values.len();
        if count < MIN_SAMPLE {
            return refuse("values", format!("{count} values"), format!("at least {MIN_SAMPLE} values"));
        }
        let mut values = values.to_vec();
        values.sort_by(f64::total_cmp);
        let n = count as f64;
        let mean = values[0] + values.iter().map(|x| x - values[0]).sum::<f64>() / n;
        let moment = |power: i32| values.iter().map(|x| (x - mean).powi(power)).sum::<f64>() / n;
        let variance = moment(2);
        if !(variance > 0.0 && variance.is_finite()) {
            return refuse("values", format!("a sample of variance {variance}"), "values that differ");
        }
        let deviation = variance.sqrt();
        let quartile = |share: f64| values[((n - 1.0) * share).round() as usize];
        let spread = (quartile(0.75) - quartile(0.25)) / 1.34;
        // Where half of the values are equal the quartiles say nothing.
        let spread = if spread > 0.0 { spread.min(deviation) } else { deviation };
        let bandwidth = 0.9 * spread * n.powf(-0.2);
        let shrink = (1.0 - (bandwidth / deviation).powi(2)).sqrt();
        let centres: Vec<f64> = values.iter().map(|x| mean + shrink * (x - mean)).collect();
        let smooth = |y: f64| centres.iter().map(|c| normal::cdf((y - c) / bandwidth)).sum::<f64>() / n;
        // 200 places find the largest difference to well below the sampling error.
        let stride = count.div_ceil(200);
        let smoothing_error = (0..count).step_by(stride).fold(0.0, |worst: f64, i| {
            let here = smooth(values[i]);
            let first = values.partition_point(|x| *x < values[i]) as f64;
            let last = values.partition_point(|x| *x <= values[i]) as f64;
            worst.max((here - first / n).abs()).max((here - last / n).abs())
        });
        let kurtosis = moment(4) / (variance * variance);
        let fit = SampleFit {
            bandwidth,
            smoothing_error,
            sampling_error: 1.358 / n.sqrt(),
            mean_standard_error: deviation / n.sqrt(),
            deviation_standard_error: deviation * ((kurtosis - 1.0).max(0.0) / (4.0 * n)).sqrt(),
        };
        Ok(Self {
            shape: Shape::Sample { values, centres, fit },
            mean,
            deviation,
        })
    }

    pub(super) fn function(density: impl Fn(f64) -> f64, low: f64, high: f64) -> Result<Self, Error> {
        Self::uniform(low, high)?;
        let rule = gauss_legendre::<TABLE_NODES>();
        let densities = rule.panels(low, high, TABLE_PANELS).map(|(x, _)| density(x)).collect();
        let found = Self::table(low, high, densities)?;
        let half = rule.composite(low, high, TABLE_PANELS / 2, |x| density(x).max(0.0));
        let whole = rule.composite(low, high, TABLE_PANELS, |x| density(x).max(0.0));
        if (half - whole).abs() > ROUGHNESS * whole {
            return refuse("density", format!("integrals {half} and {whole} by 32 and 64 panels"), "a smooth function");
        }
        Ok(found)
    }

    pub(super) fn table(low: f64, high: f64, mut densities: Vec<f64>) -> Result<Self, Error> {
        Self::uniform(low, high)?;
        all_finite("density", &densities)?;
        if let Some(negative) = densities.iter().find(|p| **p < 0.0) {
            return refuse("density", negative, "numbers that are not negative");
        }
        let rule = gauss_legendre::<TABLE_NODES>();
        entries("density", densities.len(), TABLE_PANELS * TABLE_NODES)?;
        let nodes: Vec<(f64, f64)> = rule.panels(low, high, TABLE_PANELS).collect();
        let total: f64 = nodes.iter().zip(&densities).map(|((_, w), p)| w * p).sum();
        positive("integral of the density", total)?;
        densities.iter_mut().for_each(|p| *p /= total);
        let terms = || nodes.iter().zip(&densities);
        let mean = low + terms().map(|((x, w), p)| w * p * (x - low)).sum::<f64>();
        let variance: f64 = terms().map(|((x, w), p)| w * p * (x - mean) * (x - mean)).sum();
        Ok(Self {
            shape: Shape::Table { low, high, densities },
            mean,
            deviation: positive("variance", variance)?.sqrt(),
        })
    }

    /// The density of the unknown plus `offset`.
    pub(super) fn shifted(&self, offset: f64) -> Result<Self, Error> {
        let plus = |v: &[f64]| v.iter().map(|x| x + offset).collect::<Vec<_>>();
        match &self.shape {
            Shape::Uniform { low, high } => Self::uniform(low + offset, high + offset),
            Shape::Mixture {
                weights,
                means,
                deviations,
            } => Self::mixture(weights.clone(), plus(means), deviations.clone()),
            Shape::Sample { values, .. } => Self::sample(&plus(values)),
            Shape::Table { low, high, densities } => Self::table(low + offset, high + offset, densities.clone()),
        }
    }

    /// The density of `factor` times the unknown.
    pub(super) fn rescaled(&self, factor: f64) -> Result<Self, Error> {
        let times = |v: &[f64]| v.iter().map(|x| factor * x).collect::<Vec<_>>();
        match &self.shape {
            Shape::Uniform { low, high } => Self::uniform(factor * low, factor * high),
            Shape::Mixture {
                weights,
                means,
                deviations,
            } => Self::mixture(weights.clone(), times(means), times(deviations)),
            Shape::Sample { values, .. } => Self::sample(&times(values)),
            Shape::Table { low, high, densities } => {
                Self::table(factor * low, factor * high, densities.iter().map(|p| p / factor).collect())
            }
        }
    }

    /// Mean.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Standard deviation.
    pub fn deviation(&self) -> f64 {
        self.deviation
    }

    /// How well a sample is represented; `None` for a density that was given.
    pub fn sample_fit(&self) -> Option<&SampleFit> {
        match &self.shape {
            Shape::Sample { fit, .. } => Some(fit),
            _ => None,
        }
    }

    /// Quadrature nodes and weights (of sum 1) of which neighbours are about `step` apart at most.
    pub(super) fn nodes(&self, step: f64, limit: usize) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let bells = match &self.shape {
            Shape::Uniform { low, high } => return panels(*low, *high, step, 1, limit, |_| 1.0),
            Shape::Table { low, high, densities } => {
                // A quarter of the panels of the table resolves what 32 of them have been found to resolve.
                return panels(*low, *high, step, TABLE_PANELS / 2, limit, |x| interpolated(*low, *high, densities, x));
            }
            Shape::Mixture {
                weights,
                means,
                deviations,
            } => weights
                .iter()
                .zip(means)
                .zip(deviations)
                .map(|((w, m), d)| (*w, *m, *d))
                .collect::<Vec<_>>(),
            Shape::Sample { centres, fit, .. } => centres.iter().map(|c| (1.0, *c, fit.bandwidth)).collect(),
        };
        let narrowest = bells.iter().map(|b| b.2).fold(f64::INFINITY, f64::min);
        let step = step.min(BELL_STEP * narrowest);
        let low = bells
            .iter()
            .map(|b| b.1 - BELL_REACH * b.2)
            .fold(f64::INFINITY, f64::min);
        let high = bells
            .iter()
            .map(|b| b.1 + BELL_REACH * b.2)
            .fold(f64::NEG_INFINITY, f64::max);
        let count = ((high - low) / step).ceil();
        if count.is_nan() || count >= limit as f64 {
            return super::too_fine(count.min(1e18) as usize);
        }
        let step = (high - low) / count;
        let values: Vec<f64> = (0..=count as usize).map(|i| low + i as f64 * step).collect();
        let mut weights = vec![0.0; values.len()];
        for (weight, centre, deviation) in bells {
            let first = ((centre - BELL_REACH * deviation - low) / step).max(0.0) as usize;
            let last = ((centre + BELL_REACH * deviation - low) / step).ceil() as usize;
            let range = first..(last + 1).min(values.len());
            for (w, x) in weights[range.clone()].iter_mut().zip(&values[range]) {
                *w += weight * normal::pdf((x - centre) / deviation) / deviation;
            }
        }
        Ok((values, weights))
    }

    /// A quadrature's range: what is outside has no mass worth counting.
    pub(super) fn support(&self) -> (f64, f64) {
        let reach = BELL_REACH;
        match &self.shape {
            Shape::Uniform { low, high } | Shape::Table { low, high, .. } => (*low, *high),
            Shape::Mixture { means, deviations, .. } => means
                .iter()
                .zip(deviations)
                .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (m, d)| {
                    (low.min(m - reach * d), high.max(m + reach * d))
                }),
            Shape::Sample { centres, fit, .. } => {
                let (first, last) = (centres[0], centres[centres.len() - 1]);
                (first - reach * fit.bandwidth, last + reach * fit.bandwidth)
            }
        }
    }
}

/// Gauss-Legendre panels whose nodes are `step` apart on average.
fn panels(
    low: f64,
    high: f64,
    step: f64,
    at_least: usize,
    limit: usize,
    density: impl Fn(f64) -> f64,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let count = ((high - low) / (PANEL_NODES as f64 * step)).ceil().max(at_least as f64);
    if count.is_nan() || count * PANEL_NODES as f64 >= limit as f64 {
        return super::too_fine((count * PANEL_NODES as f64).min(1e18) as usize);
    }
    let nodes = gauss_legendre::<PANEL_NODES>().panels(low, high, count as usize);
    Ok(nodes.map(|(x, w)| (x, w * density(x).max(0.0))).unzip())
}

/// The table's polynomial at `x`, in barycentric form.
fn interpolated(low: f64, high: f64, densities: &[f64], x: f64) -> f64 {
    let width = (high - low) / TABLE_PANELS as f64;
    let panel = (((x - low) / width) as usize).min(TABLE_PANELS - 1);
    let local = 2.0 * (x - low - panel as f64 * width) / width - 1.0;
    let nodes = gauss_legendre::<TABLE_NODES>().nodes();
    let values = &densities[panel * TABLE_NODES..(panel + 1) * TABLE_NODES];
    let (mut above, mut below) = (0.0, 0.0);
    for (j, (node, value)) in nodes.iter().zip(values).enumerate() {
        let distance = local - node;
        if distance == 0.0 {
            return *value;
        }
        let others = nodes.iter().enumerate().filter(|(k, _)| *k != j);
        let weight = others.map(|(_, other)| 1.0 / (node - other)).product::<f64>() / distance;
        above += weight * value;
        below += weight;
    }
    above / below
}

/// Accepts at least one component.
pub(super) fn components(parts: &[(f64, f64, f64)]) -> Result<[Vec<f64>; 3], Error> {
    at_least_one("components", parts.len())?;
    Ok([0, 1, 2].map(|i| parts.iter().map(|p| [p.0, p.1, p.2][i]).collect()))
}
