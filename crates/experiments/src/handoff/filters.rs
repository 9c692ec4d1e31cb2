//! What the figures share: settings, filters, references.

use super::world::{Point, Reading, START, Walk, World};
use crate::prelude::*;
use fewbits_baselines::mixture_codec::PaperReductions;
use fewbits_core::Likelihood;
use fewbits_densities::{Bandwidth, Component, KernelEstimate, Mixture, Particles, SampleSize, systematic};
use fewbits_handoff::{HandoffFilter, Whole, trimmed};
use fewbits_mixture_codec::{Reduction, cut};

/// Particles of a filter.
pub const PARTICLES: usize = 500;
/// Particles of a reference filter.
pub(super) const REFERENCE: usize = 2000;
/// Sensors in the field.
pub(super) const SENSORS: usize = 25;
/// Steps of a world.
pub(super) const STEPS: usize = 10;
/// Variance of a reading.
pub(super) const VARIANCE: f64 = 0.05;

/// How estimates are smoothed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Smoothing {
    /// Silverman's rule with the number of particles, trimmed at 0.01.
    Silverman,
    /// One and a half times Silverman's rule with the effective number, trimmed at 0.5: what shows the printed curves.
    Preset,
}

impl Smoothing {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Silverman => "silverman",
            Self::Preset => "preset",
        }
    }

    /// The filter of the paper under this smoothing.
    pub(super) fn filter(self, particles: usize) -> Result<HandoffFilter<Whole>, Error> {
        let filter = HandoffFilter {
            shrink: false,
            ..HandoffFilter::new(particles, Whole)?
        };
        Ok(match self {
            Self::Silverman => filter,
            Self::Preset => HandoffFilter {
                trim: 0.5,
                bandwidth: Bandwidth {
                    factor: 1.5,
                    size: SampleSize::Effective,
                    ..Bandwidth::default()
                },
                ..filter
            },
        })
    }
}

/// The estimate of Figure 6. Its bandwidth counts the particles that were kept, as the other program's does by the evidence of its
/// numbers (erratum `handoff-13`); [`HandoffFilter::estimate`] counts all.
pub(super) fn estimate(filter: &HandoffFilter<Whole>, particles: &Particles<2>) -> Result<KernelEstimate<2>, Error> {
    Ok(KernelEstimate::fit(trimmed(particles, filter.trim)?, &filter.bandwidth)?)
}

/// What all filters know at time 0.
pub fn prior() -> Result<Mixture<2>, Error> {
    let gaussian = Gaussian::new(Point::zeros(), SMatrix::identity() * (START * START))?;
    Ok(Mixture::single(&gaussian)?)
}

/// The world of one trial.
pub fn world(stream: Stream) -> Result<World, Error> {
    World::draw(&mut stream.named("world").rng(), SENSORS, STEPS, VARIANCE)
}

/// The KD-tree cut of an estimate under one of the paper's criteria.
pub(super) fn paper_cut(
    estimate: &KernelEstimate<2>,
    criterion: usize,
    components: usize,
) -> Result<Mixture<2>, Error> {
    let reductions = PaperReductions::new(estimate)?;
    Ok(cut::greedy(&reductions.tree, &reductions.errors[criterion], components)?.mixture(&reductions.tree)?)
}

/// The paper's criteria in the order of [`paper_cut`].
pub(super) const CRITERIA: [&str; 3] = ["ml", "kl", "l1"];

/// The Gaussian of the same moments.
pub(super) fn single(estimate: &KernelEstimate<2>) -> Result<Mixture<2>, Error> {
    Ok(Reduction::SingleGaussian.reduce(estimate, 1)?)
}

/// A systematic choice of `count` among weighted particles.
pub(super) fn chosen<R: Rng>(rng: &mut R, weights: &[f64], count: usize) -> Vec<u32> {
    let ancestors = systematic(weights, count, rng.random());
    ancestors.into_iter().map(|i| i as u32).collect()
}

/// A plain particle filter: systematic resampling, propagation, weights.
pub(super) fn plain_step<R: Rng>(rng: &mut R, particles: &mut Particles<2>, reading: &Reading) -> Result<(), Error> {
    particles.select(&chosen(rng, particles.weights(), particles.len()))?;
    Walk.propagate_columns(rng, particles.columns_mut());
    particles.reweigh(|states, logs| reading.add_log_likelihoods(states, logs))?;
    Ok(())
}

/// The middle of these numbers, the upper one of two.
pub(super) fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

/// Times at which the beliefs of a world are looked at.
pub(super) const TIMES: [usize; 3] = [2, 5, 8];

/// The particles of an uncompressed filter after every reading of a world.
pub(super) fn uncompressed(world: &World, stream: Stream) -> Result<Vec<Particles<2>>, Error> {
    let mut rng = stream.named("filter").fast_rng();
    let mut particles = prior()?.sample_systematic(&mut rng, PARTICLES)?;
    let after = |reading| {
        plain_step(&mut rng, &mut particles, reading)?;
        Ok(particles.clone())
    };
    world.readings.iter().map(after).collect()
}

/// Estimates of that filter at [`TIMES`] of a world.
pub(super) fn posteriors(stream: Stream) -> Result<Vec<KernelEstimate<2>>, Error> {
    let filter = Smoothing::Silverman.filter(PARTICLES)?;
    let clouds = uncompressed(&world(stream)?, stream)?;
    TIMES.iter().map(|t| Ok(filter.estimate(&clouds[t - 1])?)).collect()
}

/// What `cells` gives of each belief, added up over those of a world: a mean over the worlds for each cell and number.
pub(super) fn over_beliefs<K: Copy + Send, const N: usize>(
    context: &Context<'_>,
    experiment: &str,
    trials: u64,
    cells: impl Fn(&KernelEstimate<2>, Stream) -> Result<Vec<(K, [f64; N])>, Error> + Sync,
) -> Result<Vec<(K, [Measured; N])>, Error> {
    let one = |it: Trial| {
        let mut sums: Vec<(K, [f64; N])> = Vec::new();
        for estimate in posteriors(it.stream)? {
            let cells = cells(&estimate, it.stream)?;
            sums.extend(cells.iter().skip(sums.len()).map(|(key, _)| (*key, [0.0; N])));
            for (sum, cell) in sums.iter_mut().zip(&cells) {
                (0..N).for_each(|k| sum.1[k] += cell.1[k]);
            }
        }
        Ok(sums)
    };
    let runs = context.trials(context.stream(experiment), trials, one)?;
    let mean = |(i, (key, _)): (usize, &(K, [f64; N]))| {
        (*key, std::array::from_fn(|k| runs.iter().map(|run| run[i].1[k]).collect()))
    };
    Ok(runs.first().into_iter().flatten().enumerate().map(mean).collect())
}

/// A mixture whose every number was sent as a 32-bit float.
pub(super) fn as_f32(mixture: &Mixture<2>) -> Result<Mixture<2>, Error> {
    let short = |x: f64| f64::from(x as f32);
    let component =
        |c: &Component<2>| Component::new(short(c.weight()), c.mean().map(short), c.covariance().map(short));
    Ok(Mixture::new(mixture.components().iter().map(component).collect::<Result<_, _>>()?)?)
}

/// KL of an estimate to several mixtures by quadrature, the estimate's own density computed once.
pub(super) struct Truth {
    columns: [Vec<f64>; 2],
    log_p: Vec<f64>,
    cell: f64,
}

impl Truth {
    /// A grid over everything within 6 kernel widths of a particle, in steps of 0.4 kernel widths.
    pub(super) fn new(p: &KernelEstimate<2>) -> Self {
        let widths = [p.kernel()[(0, 0)].sqrt(), p.kernel()[(1, 1)].sqrt()];
        let columns = p.particles().columns();
        let axis = |d: usize| {
            let low = columns[d].iter().fold(f64::INFINITY, |m, x| m.min(*x)) - 6.0 * widths[d];
            let high = columns[d].iter().fold(f64::NEG_INFINITY, |m, x| m.max(*x)) + 6.0 * widths[d];
            let count = ((high - low) / (0.4 * widths[d])).ceil();
            (low, (high - low) / count, count as usize + 1)
        };
        let ((x0, dx, nx), (y0, dy, ny)) = (axis(0), axis(1));
        let places = (0..nx).flat_map(|i| (0..ny).map(move |j| (x0 + i as f64 * dx, y0 + j as f64 * dy)));
        let grid: [Vec<f64>; 2] = places.unzip().into();
        let mut log_p = vec![0.0; nx * ny];
        p.log_pdf_columns([&grid[0], &grid[1]], &mut log_p);
        Self {
            columns: grid,
            log_p,
            cell: dx * dy,
        }
    }

    pub(super) fn kl(&self, q: &Mixture<2>) -> f64 {
        let mut log_q = vec![0.0; self.log_p.len()];
        q.log_pdf_columns([&self.columns[0], &self.columns[1]], &mut log_q);
        let terms = self.log_p.iter().zip(&log_q).filter(|(p, _)| **p > -700.0);
        terms.map(|(p, q)| p.exp() * (p - q)).sum::<f64>() * self.cell
    }
}
