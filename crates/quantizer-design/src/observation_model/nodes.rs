//! Quadrature nodes and weights of a prior.

use super::prior::{Prior, Shape, TABLE_NODES, TABLE_PANELS};
use super::resolution::{NODE_LIMIT, Resolution, grid, too_fine};
use crate::error::Error;
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;

/// Half-width of the Gaussian prior's rule, and of the range of a mixture component, in standard deviations.
const REACH: f64 = 9.0;
/// Largest step in units of the Gaussian prior's standard deviation.
pub(super) const PRIOR_STEP: f64 = 0.25;
/// Largest step of the trapezoid rule in units of the narrowest mixture component: its error is below 1e-30.
const BELL_STEP: f64 = 0.5;
/// Nodes of a Gauss-Legendre panel on a bounded support.
const PANEL_NODES: usize = 8;

impl Prior {
    /// Nodes at most about `step` apart, and their weights, not normalised.
    pub(super) fn nodes(&self, step: f64, resolution: Resolution) -> Result<(Vec<f64>, Vec<f64>), Error> {
        match &self.shape {
            Shape::Gaussian { mean, deviation } => {
                let step = f64::min(resolution.step * PRIOR_STEP * deviation, step);
                let offsets = grid(resolution.reach * REACH * deviation, step)?;
                Ok(offsets.iter().map(|x| (mean + x, normal::pdf(x / deviation))).unzip())
            }
            Shape::Uniform { low, high } => panels(*low, *high, step, 1, |_| 1.0),
            // Half of the stored panels are enough, since their resolution was tested when the table was made.
            Shape::Table { low, high, densities } => {
                panels(*low, *high, step, TABLE_PANELS / 2, |x| interpolated(*low, *high, densities, x))
            }
            Shape::Mixture { .. } | Shape::Sample { .. } => self.nodes_of_bells(step),
            Shape::Discrete { values, probabilities } => Ok((values.clone(), probabilities.clone())),
        }
    }

    /// The trapezoid rule over all mixture components.
    fn nodes_of_bells(&self, step: f64) -> Result<(Vec<f64>, Vec<f64>), Error> {
        let bells = self.bells();
        let narrowest = bells.iter().map(|b| b.2).fold(f64::INFINITY, f64::min);
        let step = step.min(BELL_STEP * narrowest);
        let (low, high) = self.support(Resolution::FULL);
        let count = ((high - low) / step).ceil();
        if count.is_nan() || count >= NODE_LIMIT as f64 {
            return too_fine(count);
        }
        let step = (high - low) / count;
        let values: Vec<f64> = (0..=count as usize).map(|i| low + i as f64 * step).collect();
        let mut weights = vec![0.0; values.len()];
        for (weight, centre, deviation) in bells {
            // Beyond `REACH` standard deviations a component is negligible.
            let first = ((centre - REACH * deviation - low) / step).max(0.0) as usize;
            let last = ((centre + REACH * deviation - low) / step).ceil() as usize;
            let range = first..(last + 1).min(values.len());
            for (w, x) in weights[range.clone()].iter_mut().zip(&values[range]) {
                *w += weight * normal::pdf((x - centre) / deviation) / deviation;
            }
        }
        Ok((values, weights))
    }

    /// Deviation of the narrowest part of the prior; nothing for points and tables.
    pub(super) fn finest(&self) -> Option<f64> {
        match &self.shape {
            Shape::Gaussian { deviation, .. } => Some(*deviation),
            Shape::Uniform { .. } => Some(self.deviation()),
            Shape::Mixture { .. } | Shape::Sample { .. } => {
                let bells = self.bells().into_iter();
                Some(
                    bells
                        .map(|(_, _, deviation)| deviation)
                        .fold(self.deviation(), f64::min),
                )
            }
            Shape::Table { .. } | Shape::Discrete { .. } => None,
        }
    }

    /// The range of the quadrature; the probability outside is negligible.
    pub(super) fn support(&self, resolution: Resolution) -> (f64, f64) {
        match &self.shape {
            Shape::Uniform { low, high } | Shape::Table { low, high, .. } => (*low, *high),
            Shape::Gaussian { mean, deviation } => {
                let reach = resolution.reach * REACH * deviation;
                (mean - reach, mean + reach)
            }
            Shape::Mixture { .. } | Shape::Sample { .. } => range(self.bells().into_iter().map(|b| (b.1, REACH * b.2))),
            Shape::Discrete { values, .. } => range(values.iter().map(|x| (*x, 0.0))),
        }
    }
}

/// The union of intervals given by their middles and half-widths, as one range.
fn range(parts: impl Iterator<Item = (f64, f64)>) -> (f64, f64) {
    parts.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (middle, reach)| {
        (low.min(middle - reach), high.max(middle + reach))
    })
}

/// Gauss-Legendre panels whose nodes are `step` apart on average.
fn panels(
    low: f64,
    high: f64,
    step: f64,
    at_least: usize,
    density: impl Fn(f64) -> f64,
) -> Result<(Vec<f64>, Vec<f64>), Error> {
    let count = ((high - low) / (PANEL_NODES as f64 * step)).ceil().max(at_least as f64);
    if count.is_nan() || count * PANEL_NODES as f64 >= NODE_LIMIT as f64 {
        return too_fine(count * PANEL_NODES as f64);
    }
    let nodes = gauss_legendre::<PANEL_NODES>().panels(low, high, count as usize);
    Ok(nodes.map(|(x, w)| (x, w * density(x).max(0.0))).unzip())
}

/// The polynomial of the stored values at `x`, in barycentric form.
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
