//! How the product of several messages is drawn.

use crate::Error;
use crate::error::refuse;
use crate::product;
use crate::published::message::KernelMessage;
use fewbits_densities::Mixture;
use fewbits_numerics::kernels::{self, scalar, vectorised};
use nalgebra::{Cholesky, Matrix2, Vector2};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// How the product of messages at a variable node is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProductSampler {
    /// Gibbs sweeps over the labels, one chain per draw.
    Gibbs {
        /// Sweeps.
        sweeps: usize,
    },
    /// Draws from the first message, weighed by all others and resampled.
    MixtureImportance {
        /// Draws from the first message.
        draws: usize,
    },
    /// Every choice of labels written out; at most a million.
    Exact,
}

/// What the sampler keeps from step to step.
#[derive(Debug, Clone, Default)]
pub(crate) struct ProductWorkspace {
    logs: Vec<f64>,
    labels: Vec<usize>,
    parts: Vec<Part>,
    draws: [Vec<f64>; 2],
    chosen: Vec<usize>,
    log_weights: Vec<f64>,
}

/// What does not change with the labels, of one message.
#[derive(Debug, Clone)]
struct Part {
    /// `S_l^-1`.
    precision: Matrix2<f64>,
    /// `(J - S_l^-1)^-1`; zero where the message is alone.
    rest: Matrix2<f64>,
    /// Whitens `rest + S_l`.
    whitener: Matrix2<f64>,
}

/// Positions drawn from the product of messages, and the label of the first message behind each.
pub(crate) struct Drawn<'a> {
    pub(crate) x: &'a mut [f64],
    pub(crate) y: &'a mut [f64],
    pub(crate) labels: &'a mut [usize],
}

impl ProductSampler {
    /// Fills `out` with draws of the product of `messages`, all finished and with kernels.
    pub(crate) fn draw<R: Rng + ?Sized>(
        self,
        rng: &mut R,
        messages: &mut [KernelMessage],
        workspace: &mut ProductWorkspace,
        out: &mut Drawn<'_>,
    ) -> Result<(), Error> {
        match self {
            Self::Gibbs { sweeps } => gibbs(rng, messages, sweeps, workspace, out),
            Self::MixtureImportance { draws } => importance(rng, messages, draws, workspace, out),
            Self::Exact => exact(rng, messages, out),
        }
    }
}

fn inverse(m: &Matrix2<f64>) -> Result<Matrix2<f64>, Error> {
    match Cholesky::new(*m) {
        Some(factor) => Ok(factor.inverse()),
        None => refuse("kernel", format!("{m:?}"), "a positive definite matrix"),
    }
}

fn whitener(m: &Matrix2<f64>) -> Result<Matrix2<f64>, Error> {
    let lower = Cholesky::new(*m).map(|f| f.l());
    match lower.and_then(|l| l.solve_lower_triangular(&Matrix2::identity())) {
        Some(w) => Ok(w),
        None => refuse("kernel", format!("{m:?}"), "a positive definite matrix"),
    }
}

/// Gibbs sweeps with what the shared kernels allow: all precisions are the same for every choice of labels, so that a label's
/// conditional is one sweep over whitened points.
fn gibbs<R: Rng + ?Sized>(
    rng: &mut R,
    messages: &mut [KernelMessage],
    sweeps: usize,
    workspace: &mut ProductWorkspace,
    out: &mut Drawn<'_>,
) -> Result<(), Error> {
    let Some(first) = messages.first() else {
        return refuse("messages", 0, "at least one");
    };
    let origin = first.point(0);
    let ProductWorkspace {
        logs, labels, parts, ..
    } = workspace;
    parts.clear();
    let mut total = Matrix2::zeros();
    for message in messages.iter() {
        let precision = inverse(&message.kernel)?;
        total += precision;
        parts.push(Part {
            precision,
            rest: Matrix2::zeros(),
            whitener: Matrix2::zeros(),
        });
    }
    let covariance = inverse(&total)?;
    let Some(spread) = Cholesky::new(covariance).map(|f| f.l()) else {
        return refuse("kernel", format!("{covariance:?}"), "a positive definite matrix");
    };
    let alone = messages.len() == 1;
    for (part, message) in parts.iter_mut().zip(messages.iter_mut()) {
        message.x.iter_mut().for_each(|x| *x -= origin[0]);
        message.y.iter_mut().for_each(|y| *y -= origin[1]);
        if alone {
            continue;
        }
        part.rest = inverse(&(total - part.precision))?;
        part.whitener = whitener(&(part.rest + message.kernel))?;
        for i in 0..message.x.len() {
            let white = part.whitener * message.point(i);
            message.white[0][i] = white[0];
            message.white[1][i] = white[1];
        }
    }
    for n in 0..out.x.len() {
        labels.clear();
        let mut shift = Vector2::zeros();
        for (message, part) in messages.iter().zip(parts.iter()) {
            let label = message.label(rng);
            labels.push(label);
            shift += part.precision * message.point(label);
        }
        for _ in 0..if alone { 0 } else { sweeps } {
            for (l, (message, part)) in messages.iter().zip(parts.iter()).enumerate() {
                shift -= part.precision * message.point(labels[l]);
                let white = part.whitener * (part.rest * shift);
                labels[l] = conditional(rng, message, &white, logs);
                shift += part.precision * message.point(labels[l]);
            }
        }
        let z = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let place = origin + covariance * shift + spread * z;
        (out.x[n], out.y[n], out.labels[n]) = (place[0], place[1], labels[0]);
    }
    for message in messages {
        message.x.iter_mut().for_each(|x| *x += origin[0]);
        message.y.iter_mut().for_each(|y| *y += origin[1]);
    }
    Ok(())
}

/// A label given the others: `ln w~_i = ln w_i - |white_i - centre|^2 / 2`.
#[inline]
fn conditional<R: Rng + ?Sized>(
    rng: &mut R,
    message: &KernelMessage,
    centre: &Vector2<f64>,
    logs: &mut Vec<f64>,
) -> usize {
    let count = message.x.len();
    logs.resize(count, 0.0);
    let (cx, cy) = (centre[0], centre[1]);
    let (logs, weights) = (&mut logs[..count], &message.log_weights[..count]);
    let (x, y) = (&message.white[0][..count], &message.white[1][..count]);
    let total = vectorised(
        #[inline(always)]
        || {
            let mut largest = f64::NEG_INFINITY;
            for i in 0..count {
                let (dx, dy) = (x[i] - cx, y[i] - cy);
                let log = weights[i] - 0.5 * (dx * dx + dy * dy);
                logs[i] = log;
                largest = if log > largest { log } else { largest };
            }
            for log in logs.iter_mut() {
                *log = scalar::exp(*log - largest);
            }
            let mut total = 0.0;
            for log in logs.iter() {
                total += log;
            }
            total
        },
    );
    let mut left = rng.random::<f64>() * total;
    let mut chosen = 0;
    for (i, w) in logs.iter().enumerate() {
        if *w > 0.0 {
            chosen = i;
            if left < *w {
                break;
            }
            left -= w;
        }
    }
    chosen
}

/// Systematic draws from the first message, weighed by the densities of the others, resampled.
fn importance<R: Rng + ?Sized>(
    rng: &mut R,
    messages: &[KernelMessage],
    draws: usize,
    workspace: &mut ProductWorkspace,
    out: &mut Drawn<'_>,
) -> Result<(), Error> {
    let Some((first, others)) = messages.split_first() else {
        return refuse("messages", 0, "at least one");
    };
    if draws == 0 {
        return refuse("draws", 0, "at least 1");
    }
    let ProductWorkspace {
        logs,
        draws: places,
        chosen,
        log_weights,
        ..
    } = workspace;
    places.iter_mut().for_each(|p| p.resize(draws, 0.0));
    chosen.resize(draws, 0);
    log_weights.resize(draws, 0.0);
    log_weights.fill(0.0);
    let Some(spread) = Cholesky::new(first.kernel).map(|f| f.l()) else {
        return refuse("kernel", format!("{:?}", first.kernel), "a positive definite matrix");
    };
    let (offset, mut label): (f64, usize) = (rng.random(), 0);
    for n in 0..draws {
        let level = (n as f64 + offset) / draws as f64;
        while label + 1 < first.cumulative.len() && first.cumulative[label] <= level {
            label += 1;
        }
        let z = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let place = first.point(label) + spread * z;
        (places[0][n], places[1][n], chosen[n]) = (place[0], place[1], label);
    }
    for message in others {
        let white = whitener(&message.kernel)?;
        logs.resize(message.x.len(), 0.0);
        for n in 0..draws {
            let place = Vector2::new(places[0][n], places[1][n]);
            for (i, log) in logs.iter_mut().enumerate() {
                *log = message.log_weights[i] - 0.5 * (white * (message.point(i) - place)).norm_squared();
            }
            log_weights[n] += kernels::log_sum_exp(logs);
        }
    }
    let largest = kernels::largest(log_weights);
    if !largest.is_finite() {
        return Err(Error::IMPOSSIBLE);
    }
    let total: f64 = log_weights.iter().map(|l| (l - largest).exp()).sum();
    let (step, mut cumulative, mut n) = (total / out.x.len() as f64, (log_weights[0] - largest).exp(), 0);
    let offset: f64 = rng.random();
    for k in 0..out.x.len() {
        while cumulative <= (k as f64 + offset) * step && n + 1 < draws {
            n += 1;
            cumulative += (log_weights[n] - largest).exp();
        }
        (out.x[k], out.y[k], out.labels[k]) = (places[0][n], places[1][n], chosen[n]);
    }
    Ok(())
}

/// Independent draws of the enumerated product.
fn exact<R: Rng + ?Sized>(rng: &mut R, messages: &[KernelMessage], out: &mut Drawn<'_>) -> Result<(), Error> {
    let mixtures: Vec<Mixture<2>> = messages.iter().map(KernelMessage::mixture).collect::<Result<_, _>>()?;
    let product = product::exact(&mixtures.iter().collect::<Vec<_>>())?.belief;
    // Labels of the first message vary slowest; those of zero weight are left out.
    let kept: Vec<usize> = (0..messages[0].x.len())
        .filter(|i| messages[0].weight(*i) > 0.0)
        .collect();
    let others = product.len() / kept.len().max(1);
    let mut cumulative = Vec::with_capacity(product.len());
    let mut sum = 0.0;
    for c in product.components() {
        sum += c.weight();
        cumulative.push(sum);
    }
    for n in 0..out.x.len() {
        let u = rng.random::<f64>() * sum;
        let k = cumulative.partition_point(|c| *c <= u).min(product.len() - 1);
        let component = &product.components()[k];
        let z = Vector2::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let place = component.mean() + component.factor().lower * z;
        let label = kept.get(k / others.max(1)).copied().unwrap_or(0);
        (out.x[n], out.y[n], out.labels[n]) = (place[0], place[1], label);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::published::message::kernel_of;
    use fewbits_densities::Component;
    use fewbits_monte_carlo::{Moments, Stream};

    /// Three messages that overlap moderately, and their exact product.
    fn messages() -> Vec<KernelMessage> {
        let mut rng = Stream::new(8).rng();
        (0..3)
            .map(|l| {
                let mut message = KernelMessage::default();
                message.resize(6);
                for i in 0..6 {
                    message.x[i] = 100.0 + 0.2 * f64::from(l) + rng.sample::<f64, _>(StandardNormal);
                    message.y[i] = -50.0 + rng.sample::<f64, _>(StandardNormal);
                    message.log_weights[i] = rng.random::<f64>();
                }
                message.finish();
                message.kernel = Matrix2::new(0.5, 0.1, 0.1, 0.4 + 0.1 * f64::from(l));
                message
            })
            .collect()
    }

    #[test]
    fn every_sampler_draws_the_product() {
        let mixtures: Vec<Mixture<2>> = messages().iter().map(|m| m.mixture().unwrap()).collect();
        let truth = product::exact(&mixtures.iter().collect::<Vec<_>>()).unwrap().belief;
        let samplers = [
            ProductSampler::Gibbs { sweeps: 12 },
            ProductSampler::MixtureImportance { draws: 40_000 },
            ProductSampler::Exact,
        ];
        for sampler in samplers {
            let mut own = messages();
            let (mut x, mut y, mut labels) = (vec![0.0; 20_000], vec![0.0; 20_000], vec![0; 20_000]);
            let mut out = Drawn {
                x: &mut x,
                y: &mut y,
                labels: &mut labels,
            };
            let mut rng = Stream::new(9).rng();
            sampler
                .draw(&mut rng, &mut own, &mut ProductWorkspace::default(), &mut out)
                .unwrap();
            // Importance draws repeat: half the draws are worth counting.
            let slack = if matches!(sampler, ProductSampler::MixtureImportance { .. }) {
                1.5
            } else {
                1.0
            };
            for (column, d) in [(&x, 0), (&y, 1)] {
                let moments: Moments = column.iter().copied().collect();
                assert!(moments.estimate().z_score(truth.mean()[d]).abs() < 4.0 * slack, "{sampler:?}");
                let squares: Moments = column.iter().map(|v| (v - truth.mean()[d]).powi(2)).collect();
                assert!(squares.estimate().z_score(truth.covariance()[(d, d)]).abs() < 4.0 * slack, "{sampler:?}");
            }
            // The product's marginal of the first label.
            for label in 0..6 {
                let share = truth.components()[label * 36..(label + 1) * 36]
                    .iter()
                    .map(Component::weight)
                    .sum::<f64>();
                let seen = labels.iter().filter(|l| **l == label).count() as f64 / 20_000.0;
                assert!((seen - share).abs() < 5.0 * slack * (share / 20_000.0).sqrt() + 1e-3, "{sampler:?} {label}");
            }
        }
    }

    #[test]
    fn one_message_is_its_own_product_and_no_spread_is_refused() {
        let mut one = messages();
        one.truncate(1);
        let (mut x, mut y, mut labels) = (vec![0.0; 5000], vec![0.0; 5000], vec![0; 5000]);
        let mut out = Drawn {
            x: &mut x,
            y: &mut y,
            labels: &mut labels,
        };
        let truth = one[0].mixture().unwrap();
        let mut rng = Stream::new(10).rng();
        let sampler = ProductSampler::Gibbs { sweeps: 5 };
        sampler
            .draw(&mut rng, &mut one, &mut ProductWorkspace::default(), &mut out)
            .unwrap();
        let moments: Moments = x.iter().copied().collect();
        assert!(moments.estimate().z_score(truth.mean()[0]).abs() < 4.0);
        assert!(kernel_of(&Matrix2::zeros(), 0.3).is_err());
        assert_eq!(kernel_of(&Matrix2::new(1.0, 1.0, 1.0, 1.0), 0.3).unwrap().1, 1);
    }
}
