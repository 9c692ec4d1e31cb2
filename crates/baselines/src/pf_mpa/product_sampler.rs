//! Draws from the product of several messages.

use crate::pf_mpa::message::KernelMessage;
use crate::pf_mpa::product;
use fewbits_core::ColumnsMut;
use fewbits_core::columns::set_state;
use fewbits_densities::{Mixture, Particles};
use fewbits_numerics::error::at_least_one;
use fewbits_numerics::error::refuse;
use fewbits_numerics::kernels::{self, scalar, vectorised};
use fewbits_pf_mpa::Error;
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

/// How the product of messages at a variable node is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ProductSampler {
    /// Gibbs sweeps over the labels, one chain per draw.
    Gibbs {
        /// Number of sweeps per draw.
        sweeps: usize,
    },
    /// Draws from the first message, weighted by the densities of all others and resampled.
    MixtureImportance {
        /// Number of draws from the first message.
        draws: usize,
    },
    /// Enumeration of all label choices, at most a million.
    Exact,
}

/// Buffers that are reused from step to step.
#[derive(Debug, Clone, Default)]
pub(crate) struct ProductWorkspace<const D: usize> {
    logs: Vec<f64>,
    labels: Vec<usize>,
    parts: Vec<Part<D>>,
    draws: Vec<SVector<f64, D>>,
    chosen: Vec<usize>,
    log_weights: Vec<f64>,
}

/// The quantities of one message that do not depend on the labels.
#[derive(Debug, Clone)]
struct Part<const D: usize> {
    /// `S_l^-1`.
    precision: SMatrix<f64, D, D>,
    /// `(J - S_l^-1)^-1`; zero if there is no other message.
    rest: SMatrix<f64, D, D>,
    /// Whitens the covariance `rest + S_l`.
    whitener: SMatrix<f64, D, D>,
}

/// Points drawn from the product of messages, and for each the label of the first message that it came from.
pub(crate) struct Drawn<'a, const D: usize> {
    pub(crate) points: ColumnsMut<'a, D>,
    pub(crate) labels: &'a mut [usize],
}

impl ProductSampler {
    /// `count` draws from the product of mixtures. All components of one mixture must have the same covariance. For moderately overlapping
    /// mixtures five Gibbs sweeps reach a total variation of 0.006; between well separated modes they do not mix.
    ///
    /// # Errors
    /// If there is no factor or no draw, or the covariances of a factor differ.
    pub fn sample<const D: usize, R: Rng + ?Sized>(
        self,
        rng: &mut R,
        factors: &[&Mixture<D>],
        count: usize,
    ) -> Result<Particles<D>, Error> {
        at_least_one("count", count)?;
        let mut messages: Vec<KernelMessage<D>> = factors
            .iter()
            .map(|f| KernelMessage::of(f))
            .collect::<Result<_, Error>>()?;
        let (mut points, mut labels) = (std::array::from_fn(|_| vec![0.0; count]), vec![0; count]);
        let mut out = Drawn {
            points: points.each_mut().map(Vec::as_mut_slice),
            labels: &mut labels,
        };
        self.draw(rng, &mut messages, &mut ProductWorkspace::default(), &mut out)?;
        Particles::uniform(points)
    }

    /// Fills `out` with draws from the product of `messages`, which are finished and have their kernels.
    pub(crate) fn draw<const D: usize, R: Rng + ?Sized>(
        self,
        rng: &mut R,
        messages: &mut [KernelMessage<D>],
        workspace: &mut ProductWorkspace<D>,
        out: &mut Drawn<'_, D>,
    ) -> Result<(), Error> {
        match self {
            Self::Gibbs { sweeps } => gibbs(rng, messages, sweeps, workspace, out),
            Self::MixtureImportance { draws } => importance(rng, messages, draws, workspace, out),
            Self::Exact => exact(rng, messages, out),
        }
    }
}

fn cholesky<const D: usize>(m: &SMatrix<f64, D, D>) -> Result<Cholesky<f64, Const<D>>, Error> {
    match Cholesky::new(*m) {
        Some(factor) => Ok(factor),
        None => refuse("kernel", format!("{m:?}"), "a positive definite matrix"),
    }
}

fn inverse<const D: usize>(m: &SMatrix<f64, D, D>) -> Result<SMatrix<f64, D, D>, Error> {
    Ok(cholesky(m)?.inverse())
}

fn whitener<const D: usize>(m: &SMatrix<f64, D, D>) -> Result<SMatrix<f64, D, D>, Error> {
    let solved = cholesky(m)?.l().solve_lower_triangular(&SMatrix::identity());
    solved.ok_or(Error::Impossible)
}

/// Gibbs sweeps over the labels. Because a message's kernels are equal, all precisions are the same for every choice of labels, and the
/// conditional probabilities of one label follow from distances between whitened points.
fn gibbs<const D: usize, R: Rng + ?Sized>(
    rng: &mut R,
    messages: &mut [KernelMessage<D>],
    sweeps: usize,
    workspace: &mut ProductWorkspace<D>,
    out: &mut Drawn<'_, D>,
) -> Result<(), Error> {
    let Some(first) = messages.first() else {
        return refuse("messages", 0, "at least one");
    };
    // Coordinates relative to a point of the first message: products of large coordinates would cancel.
    let origin = first.point(0);
    let ProductWorkspace {
        logs, labels, parts, ..
    } = workspace;
    parts.clear();
    let mut total = SMatrix::zeros();
    for message in messages.iter() {
        let precision = inverse(&message.kernel)?;
        total += precision;
        parts.push(Part {
            precision,
            rest: SMatrix::zeros(),
            whitener: SMatrix::zeros(),
        });
    }
    let covariance = inverse(&total)?;
    let spread = cholesky(&covariance)?.l();
    let alone = messages.len() == 1;
    for (part, message) in parts.iter_mut().zip(messages.iter_mut()) {
        message.shift(&-origin);
        if alone {
            continue;
        }
        // For the conditional of one label given the others: the product of their kernels is one Gaussian of covariance `rest`.
        part.rest = inverse(&(total - part.precision))?;
        part.whitener = whitener(&(part.rest + message.kernel))?;
        for i in 0..message.len() {
            message.white[i] = part.whitener * message.point(i);
        }
    }
    for n in 0..out.labels.len() {
        labels.clear();
        let mut shift = SVector::zeros();
        for (message, part) in messages.iter().zip(parts.iter()) {
            let label = message.label(rng);
            labels.push(label);
            shift += part.precision * message.point(label);
        }
        // Sweeps over the labels, each drawn given all others.
        for _ in 0..if alone { 0 } else { sweeps } {
            for (l, (message, part)) in messages.iter().zip(parts.iter()).enumerate() {
                shift -= part.precision * message.point(labels[l]);
                let white = part.whitener * (part.rest * shift);
                labels[l] = conditional(rng, message, &white, logs);
                shift += part.precision * message.point(labels[l]);
            }
        }
        let z = SVector::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let place = origin + covariance * shift + spread * z;
        set_state(&mut out.points, n, &place);
        out.labels[n] = labels[0];
    }
    for message in messages {
        message.shift(&origin);
    }
    Ok(())
}

/// Draws a label given the others: `ln w~_i = ln w_i - |white_i - centre|^2 / 2`.
#[inline]
fn conditional<const D: usize, R: Rng + ?Sized>(
    rng: &mut R,
    message: &KernelMessage<D>,
    centre: &SVector<f64, D>,
    logs: &mut Vec<f64>,
) -> usize {
    logs.resize(message.len(), 0.0);
    let total = vectorised(
        #[inline(always)]
        || {
            let mut largest = f64::NEG_INFINITY;
            for ((log, weight), white) in logs.iter_mut().zip(&message.log_weights).zip(&message.white) {
                *log = weight - 0.5 * (white - centre).norm_squared();
                largest = if *log > largest { *log } else { largest };
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

/// Systematic draws from the first message, weighted by the densities of the others and resampled.
fn importance<const D: usize, R: Rng + ?Sized>(
    rng: &mut R,
    messages: &[KernelMessage<D>],
    draws: usize,
    workspace: &mut ProductWorkspace<D>,
    out: &mut Drawn<'_, D>,
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
    places.resize(draws, SVector::zeros());
    chosen.resize(draws, 0);
    log_weights.clear();
    log_weights.resize(draws, 0.0);
    let spread = cholesky(&first.kernel)?.l();
    first.resample(rng, chosen);
    for n in 0..draws {
        let z = SVector::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        places[n] = first.point(chosen[n]) + spread * z;
    }
    // Weights of the draws: the densities of the other messages.
    for message in others {
        let white = whitener(&message.kernel)?;
        logs.resize(message.len(), 0.0);
        for n in 0..draws {
            for (i, log) in logs.iter_mut().enumerate() {
                *log = message.log_weights[i] - 0.5 * (white * (message.point(i) - places[n])).norm_squared();
            }
            log_weights[n] += kernels::log_sum_exp(logs);
        }
    }
    let largest = kernels::largest(log_weights);
    if !largest.is_finite() {
        return Err(Error::Impossible);
    }
    let total: f64 = log_weights.iter().map(|l| (l - largest).exp()).sum();
    // Systematic resampling of the draws by these weights.
    let (step, mut cumulative, mut n) = (total / out.labels.len() as f64, (log_weights[0] - largest).exp(), 0);
    let offset: f64 = rng.random();
    for k in 0..out.labels.len() {
        while cumulative <= (k as f64 + offset) * step && n + 1 < draws {
            n += 1;
            cumulative += (log_weights[n] - largest).exp();
        }
        set_state(&mut out.points, k, &places[n]);
        out.labels[k] = chosen[n];
    }
    Ok(())
}

/// Independent draws of the enumerated product.
fn exact<const D: usize, R: Rng + ?Sized>(
    rng: &mut R,
    messages: &[KernelMessage<D>],
    out: &mut Drawn<'_, D>,
) -> Result<(), Error> {
    let mixtures: Vec<Mixture<D>> = messages.iter().map(KernelMessage::mixture).collect::<Result<_, _>>()?;
    let product = product::exact(&mixtures.iter().collect::<Vec<_>>())?.belief;
    // The first message's labels vary slowest. Labels of weight zero are left out.
    let kept: Vec<usize> = (0..messages[0].len())
        .filter(|i| messages[0].weight(*i) > 0.0)
        .collect();
    let others = product.len() / kept.len().max(1);
    let mut cumulative = Vec::with_capacity(product.len());
    let mut sum = 0.0;
    for c in product.components() {
        sum += c.weight();
        cumulative.push(sum);
    }
    for n in 0..out.labels.len() {
        let u = rng.random::<f64>() * sum;
        let k = cumulative.partition_point(|c| *c <= u).min(product.len() - 1);
        let component = &product.components()[k];
        let z = SVector::from_fn(|_, _| rng.sample::<f64, _>(StandardNormal));
        let place = component.mean() + component.factor().lower * z;
        let label = kept.get(k / others.max(1)).copied().unwrap_or(0);
        set_state(&mut out.points, n, &place);
        out.labels[n] = label;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use fewbits_core::Belief;
    use fewbits_densities::Component;
    use fewbits_monte_carlo::{Moments, Stream};
    use nalgebra::Matrix2;

    /// Three messages that overlap moderately, and their exact product.
    fn messages() -> Vec<KernelMessage<2>> {
        let mut rng = Stream::new(8).rng();
        (0..3)
            .map(|l| {
                let mut message = KernelMessage::new(6);
                for i in 0..6 {
                    message.points[0][i] = 100.0 + 0.2 * f64::from(l) + rng.sample::<f64, _>(StandardNormal);
                    message.points[1][i] = -50.0 + rng.sample::<f64, _>(StandardNormal);
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
                points: [&mut x, &mut y],
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
}
