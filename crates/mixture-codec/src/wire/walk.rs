//! The order and the distributions of a message's numbers, used by quantiser and decoder alike.

use super::format::WireFormat;
use super::range::{Coder, Law, MAX_SYMBOL, Reader, out_of_range};
use fewbits_core::{Belief, CodecError};
use fewbits_densities::{Component, Mixture};
use fewbits_numerics::factored::Factored;
use nalgebra::{SMatrix, SVector};

/// Supplies the integers of a message, and records them with their distributions.
pub(super) trait Source {
    /// The next integer with the distribution `law`. `wanted` is the number to be quantised, in steps, if there is one.
    fn next(&mut self, law: &Law, wanted: Option<f64>) -> Result<i64, CodecError>;
}

/// Quantises the numbers of a given mixture.
#[derive(Default)]
pub(super) struct Quantiser {
    pub(super) symbols: Vec<(Law, i64)>,
}

impl Source for Quantiser {
    fn next(&mut self, law: &Law, wanted: Option<f64>) -> Result<i64, CodecError> {
        let rounded = wanted.map_or(f64::NAN, f64::round);
        let fits = match *law {
            Law::Uniform { count } => rounded >= 0.0 && rounded < count as f64,
            Law::Logistic { .. } => rounded.abs() < MAX_SYMBOL,
        };
        if !fits {
            return Err(out_of_range("parameter in steps", rounded));
        }
        self.symbols.push((*law, rounded as i64));
        Ok(rounded as i64)
    }
}

/// Decodes the numbers of a message.
pub(super) struct Decoder {
    pub(super) reader: Reader,
    pub(super) symbols: Vec<(Law, i64)>,
}

impl Source for Decoder {
    fn next(&mut self, law: &Law, _: Option<f64>) -> Result<i64, CodecError> {
        let n = self.reader.integer(law, None)?;
        self.symbols.push((*law, n));
        Ok(n)
    }
}

/// Largest distance of the logarithm of a standard deviation from that of the unit.
const NEPERS: f64 = 8.0;
/// Largest distance of the logarithm of a component's standard deviation from the overall one's.
const COMPONENT_NEPERS: f64 = 40.0;
/// Largest absolute value of the logit of a weight.
const LOGIT: f64 = 30.0;

/// Exponential by IEEE arithmetic alone, so that sender and receiver get the same bits.
fn exp(x: f64) -> f64 {
    libm::exp(x)
}

/// Goes through the numbers of a message. With a target, `symbols` quantises its numbers; without, `symbols` decodes them.
pub(super) fn walk<const D: usize>(
    symbols: &mut impl Source,
    format: &WireFormat<D>,
    target: Option<(&Mixture<D>, usize)>,
) -> Result<Mixture<D>, CodecError> {
    let mut order: Vec<&Component<D>> =
        target.map_or(Vec::new(), |(m, _)| m.components().iter().filter(|c| c.weight() > 0.0).collect());
    order.sort_by(|a, b| b.weight().total_cmp(&a.weight()));
    let k = symbols.next(&Law::Uniform { count: 64 }, target.map(|_| order.len() as f64))?;
    if k == 0 {
        return Err(out_of_range("number of components", "0, reserved for later formats"));
    }
    let k = k as usize;
    let choices = format.resolutions.len() as u64;
    let choice = symbols.next(&Law::Uniform { count: choices }, target.map(|(_, r)| r as f64))?;
    let r = format
        .resolutions
        .get(choice as usize)
        .copied()
        .ok_or_else(|| out_of_range("resolution", choice))?;

    let overall = match target {
        None => None,
        Some((mixture, _)) => {
            let factor = Factored::new("covariance", &mixture.covariance())
                .map_err(|_| out_of_range("covariance", "singular"))?;
            Some((mixture.mean(), factor))
        }
    };
    let lower = cholesky(symbols, overall.as_ref().map(|(_, f)| &f.lower), &Scales::overall(format, r))?;
    let mut mean = SVector::<f64, D>::zeros();
    for i in 0..D {
        let step = if k == 1 { r } else { 0.5 * r } * lower[(i, i)];
        let count = (2.0 * format.half_width / step).ceil() + 1.0;
        if count.is_nan() || count > 1e15 {
            return Err(out_of_range("positions in the field", count));
        }
        let start = format.centre[i] - format.half_width;
        let wanted = overall.as_ref().map(|(m, _)| (m[i] - start) / step);
        mean[i] = start + step * symbols.next(&Law::Uniform { count: count as u64 }, wanted)? as f64;
    }
    if k == 1 {
        return mixture(vec![component(1.0, mean, lower)?]);
    }

    let weights = weights(symbols, r, k, &order)?;
    let white = Factored::from_lower(lower);
    let mut components = Vec::with_capacity(k);
    // Weighted sum of the means so far, and variance of its quantisation error, in whitened coordinates.
    let (mut sum, mut noise) = (SVector::<f64, D>::zeros(), SVector::<f64, D>::zeros());
    for i in 0..k {
        let own = match order.get(i) {
            None => None,
            Some(c) => {
                let covariance = white.whitener * c.covariance() * white.whitener.transpose();
                let symmetric = (covariance + covariance.transpose()) * 0.5;
                let factor =
                    Factored::new("covariance", &symmetric).map_err(|_| out_of_range("covariance", "singular"))?;
                Some((white.whitener * (c.mean() - mean), factor.lower))
            }
        };
        let l = cholesky(symbols, own.as_ref().map(|(_, l)| l), &Scales::component(r))?;
        let mut z = SVector::<f64, D>::zeros();
        for d in 0..D {
            let step = 1.4 * r * l[(d, d)];
            let (mut location, mut scale) = (0.0, 0.55);
            // The whitened means have the weighted sum zero, so those before predict the last one. Its spread is that of their
            // quantisation errors.
            if i == k - 1 {
                let w = weights[i];
                let spread = (0.35 * l[(d, d)] + 0.05).max((noise[d] / (w * w)).sqrt() + 0.5 * r / w / 12.0_f64.sqrt());
                if spread < scale {
                    (location, scale) = (-sum[d] / w, spread);
                }
            }
            let law = Law::Logistic {
                location: location / step,
                scale: scale / step,
            };
            z[d] = step * symbols.next(&law, own.as_ref().map(|(z, _)| z[d] / step))? as f64;
            sum[d] += weights[i] * z[d];
            noise[d] += weights[i] * weights[i] * step * step / 12.0;
        }
        components.push(component(weights[i], mean + product(&lower, &z), triangular(&lower, &l))?);
    }
    mixture(components)
}

/// Quantiser steps, distributions and ranges of the numbers of a Cholesky factor.
struct Scales {
    unit: f64,
    log_step: f64,
    log_law: Law,
    /// The logarithm that integer 0 stands for.
    log_start: f64,
    log_range: f64,
    ratio_step: f64,
    ratio_scale: f64,
}

impl Scales {
    fn overall<const D: usize>(format: &WireFormat<D>, r: f64) -> Self {
        let log_step = 0.5 * r;
        Self {
            unit: format.unit,
            log_step,
            log_law: Law::Uniform {
                count: (2.0 * NEPERS / log_step).ceil() as u64 + 1,
            },
            log_start: -NEPERS,
            // The range of this distribution is limited already.
            log_range: f64::INFINITY,
            ratio_step: r,
            ratio_scale: 0.5,
        }
    }

    fn component(r: f64) -> Self {
        Self {
            unit: 1.0,
            log_step: r,
            log_law: Law::Logistic {
                location: -0.62 / r,
                scale: 0.42 / r,
            },
            log_start: 0.0,
            log_range: COMPONENT_NEPERS,
            ratio_step: r,
            ratio_scale: 0.3,
        }
    }
}

/// A lower triangular factor: the logarithms of its diagonal, then each row divided by its diagonal entry.
fn cholesky<const D: usize>(
    symbols: &mut impl Source,
    wanted: Option<&SMatrix<f64, D, D>>,
    scales: &Scales,
) -> Result<SMatrix<f64, D, D>, CodecError> {
    let mut lower = SMatrix::<f64, D, D>::zeros();
    for i in 0..D {
        let target = wanted.map(|l| ((l[(i, i)] / scales.unit).ln() - scales.log_start) / scales.log_step);
        let log = scales.log_start + scales.log_step * symbols.next(&scales.log_law, target)? as f64;
        if log.abs() > scales.log_range {
            return Err(out_of_range("logarithm of a standard deviation", log));
        }
        lower[(i, i)] = scales.unit * exp(log);
    }
    let law = Law::Logistic {
        location: 0.0,
        scale: scales.ratio_scale / scales.ratio_step,
    };
    for i in 1..D {
        for j in 0..i {
            let target = wanted.map(|l| l[(i, j)] / l[(i, i)] / scales.ratio_step);
            // Entries left of the diagonal are coded relative to it, so their steps are fractions of the row's standard deviation.
            let ratio = scales.ratio_step * symbols.next(&law, target)? as f64;
            lower[(i, j)] = ratio * lower[(i, i)];
        }
    }
    Ok(lower)
}

/// Weights in decreasing order by stick breaking: each is coded as a fraction of the weight that remains.
fn weights<const D: usize>(
    symbols: &mut impl Source,
    r: f64,
    k: usize,
    order: &[&Component<D>],
) -> Result<Vec<f64>, CodecError> {
    let step = 2.0 * r;
    let law = Law::Logistic {
        location: -1.2 / step,
        scale: 0.8 / step,
    };
    let (mut weights, mut left) = (Vec::with_capacity(k), 1.0);
    for i in 0..k - 1 {
        // Weights decrease, so this one has at least the share `1/(k - i)` of the rest. 2 % less keep the logit of equal weights finite.
        let low = 0.98 / (k - i) as f64;
        let target = order.get(i).map(|c| {
            // The remaining weight is summed from the smallest on, so that rounding cannot lose it.
            let rest: f64 = order[i..].iter().rev().map(|c| c.weight()).sum();
            let others: f64 = order[i + 1..].iter().rev().map(|c| c.weight()).sum();
            let g = (((c.weight() - low * rest) / rest).max(f64::MIN_POSITIVE) / (others / rest)).ln();
            g.clamp(-LOGIT, LOGIT) / step
        });
        let g = step * symbols.next(&law, target)? as f64;
        if g.abs() > LOGIT + step {
            return Err(out_of_range("logit of a weight", g));
        }
        let odds = exp(g);
        weights.push(left * ((low + odds) / (1.0 + odds)));
        left *= (1.0 - low) / (1.0 + odds);
    }
    weights.push(left);
    Ok(weights)
}

/// `L z` in a fixed order of operations.
fn product<const D: usize>(lower: &SMatrix<f64, D, D>, z: &SVector<f64, D>) -> SVector<f64, D> {
    SVector::from_fn(|i, _| (0..=i).map(|j| lower[(i, j)] * z[j]).sum())
}

/// `L l` of two lower triangular matrices.
fn triangular<const D: usize>(a: &SMatrix<f64, D, D>, b: &SMatrix<f64, D, D>) -> SMatrix<f64, D, D> {
    SMatrix::from_fn(|i, j| (j..=i).map(|k| a[(i, k)] * b[(k, j)]).sum())
}

fn component<const D: usize>(
    weight: f64,
    mean: SVector<f64, D>,
    lower: SMatrix<f64, D, D>,
) -> Result<Component<D>, CodecError> {
    Component::new(weight, mean, lower * lower.transpose()).map_err(|error| out_of_range("component", error))
}

fn mixture<const D: usize>(components: Vec<Component<D>>) -> Result<Mixture<D>, CodecError> {
    Mixture::new(components).map_err(|error| out_of_range("mixture", error))
}
