//! Evaluation of one grid: weights of its nodes, tempered if too few have weight, and the moments under these weights.

use super::region::{Piece, Region};
use super::{Grid, MAX_NODES, MAX_REFINED_NODES, MIN_NODES_PER_DEVIATION, Prior, Workspace};
use crate::Error;
use fewbits_core::Likelihood;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::error::refuse;
use fewbits_numerics::kernels;
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{SMatrix, SVector};
use std::f64::consts::PI;

/// Log ratio of the posterior's peak to that of a standard normal, below which the posterior is treated as underflowed.
const UNDERFLOW: f64 = -690.0;
/// Effective number of nodes per axis below which weights are tempered. With fewer, a
/// mode between nodes would lose its weight to another one that is at a node.
const MIN_EFFECTIVE_NODES: f64 = 3.0;
/// The grid must cover this many deviations of the posterior to each side of its mean.
const COVERED: f64 = 3.0;
/// The same for the first grid, if it is wide compared with the posterior: one more grid, narrowed to the posterior, costs as much as the
/// first. If the first grid holds 4.8 deviations, a Gaussian has less than 1e-6 of its weight beyond each end (1e-3 beyond
/// [`COVERED`]), and a further grid over a default reach of 4 would cover less.
const COVERED_BY_PREDICTION: f64 = 4.8;
/// If the posterior's deviation is at least this multiple of the predicted one, the ends of the first grid are those of the prediction. A
/// Gaussian likelihood then has at least .58 of the predicted deviation. A narrower grid would gain little, so the first one need hold
/// only one deviation of the posterior to each side of its mean.
const BLUNT: f64 = 0.5;
/// A grid is no longer narrowed if all principal axes of the weights are longer than this, in its own deviations.
const STALLED: f64 = 0.7;
/// Number of successive empty layers of nodes, across the longest axis, that separate two modes.
const GAP_LAYERS: usize = 3;
/// A layer with a smaller fraction of the weight is treated as empty.
const EMPTY_LAYER: f64 = 1e-4;
/// Smallest fraction of the weight on each side of a gap between modes.
const MODE_SHARE: f64 = 0.05;
/// Number of layers for which memory is reserved at first.
const ROOM_FOR_LAYERS: usize = 256;
/// Bisections of the tempering exponent, over at most twelve decades.
const BISECTIONS: u32 = 24;

/// Results of one grid, in its own coordinates.
#[derive(Debug, Clone)]
pub(super) struct Found<const K: usize> {
    /// Exponent to which the weights were raised; 1 for the posterior itself.
    exponent: f64,
    log_evidence: f64,
    log_peak: f64,
    /// Distance between neighbouring nodes.
    pub step: f64,
    pub mean: SVector<f64, K>,
    pub covariance: SMatrix<f64, K, K>,
    /// Deviation along the shortest principal axis.
    shortest: f64,
    /// Nodes per deviation of a Gaussian with the same effective number of nodes.
    counted: f64,
    /// A plane `along' t = offset` in a gap between two modes.
    pub gap: Option<(SVector<f64, K>, f64)>,
}

impl<const K: usize> Found<K> {
    /// Nodes per deviation of the posterior: the smaller of the number along the shortest principal axis and the number from the effective
    /// nodes. A posterior with edges, ridges or spikes has fewer effective nodes than a Gaussian of its moments. 0 if the weights are
    /// tempered.
    pub(crate) fn nodes_per_deviation(&self) -> f64 {
        if self.is_tempered() {
            0.0
        } else {
            self.counted.min(self.shortest / self.step)
        }
    }

    /// Whether more nodes are needed. If not, a grid along the principal axes is enough.
    pub(crate) fn is_coarse(&self) -> bool {
        self.is_tempered() || self.counted < MIN_NODES_PER_DEVIATION
    }

    /// Whether the evidence of this region is certainly below `exp(-log_ratio)` times the given evidence.
    pub(crate) fn is_below(&self, region: &Region<K>, log_evidence: f64, log_ratio: f64) -> bool {
        !self.is_tempered() && self.log_evidence + region.log_volume() < log_evidence - log_ratio
    }

    pub(crate) fn is_tempered(&self) -> bool {
        self.exponent < 1.0
    }

    /// Whether the moments are those of the posterior: resolved and inside the grid.
    pub(crate) fn is_done(&self, region: &Region<K>, reach: f64) -> bool {
        let widest = self.covariance.diagonal().max().sqrt();
        let covered = match region.is_prediction {
            true if widest >= BLUNT => 1.0,
            true => COVERED_BY_PREDICTION,
            false => COVERED,
        };
        let inside = |k: usize| self.mean[k].abs() + covered * self.covariance[(k, k)].sqrt() <= reach;
        self.nodes_per_deviation() >= MIN_NODES_PER_DEVIATION && (0..K).all(inside)
    }

    /// Whether the next grid would be as wide as this one.
    pub(crate) fn is_stalled(&self) -> bool {
        self.shortest > STALLED
    }

    pub(crate) fn piece(&self, region: &Region<K>) -> Piece<K> {
        let (mean, covariance) = region.moments(&self.mean, &self.covariance);
        let impossible = self.log_peak < UNDERFLOW;
        Piece {
            log_evidence: if impossible {
                f64::NEG_INFINITY
            } else {
                self.log_evidence + region.log_volume()
            },
            mean,
            covariance,
        }
    }
}

impl Grid {
    /// Evaluates one grid. `None` if the observation has probability zero at all nodes.
    pub(super) fn pass<const K: usize>(
        &self,
        prior: &Prior<K>,
        region: &Region<K>,
        observed: &(impl Likelihood<K> + ?Sized),
        workspace: &mut Workspace<K>,
    ) -> Result<Option<Found<K>>, Error> {
        let count = self.resize(region.nodes, workspace)?;
        let Workspace {
            columns,
            logs,
            tempered,
            weights,
            layers,
            ..
        } = workspace;
        let step = 2.0 * self.reach / (region.nodes - 1) as f64;
        let advance = |index: &mut [usize; K]| {
            for i in index.iter_mut().rev() {
                *i += 1;
                if *i < region.nodes {
                    break;
                }
                *i = 0;
            }
        };
        let node = |index: &[usize; K]| SVector::<f64, K>::from_fn(|k, _| step * index[k] as f64 - self.reach);

        // Positions and log prior of all nodes, then the log likelihood in one sweep.
        let basis = region.basis();
        let mut index = [0_usize; K];
        for n in 0..count {
            let u = region.centre + basis * node(&index);
            let place = prior.origin + prior.lower * u;
            for (column, x) in columns.iter_mut().zip(place.iter()) {
                column[n] = *x;
            }
            logs[n] = if region.holds(&u) {
                -0.5 * u.norm_squared()
            } else {
                f64::NEG_INFINITY
            };
            advance(&mut index);
        }
        observed.add_log_likelihoods(columns.each_ref().map(Vec::as_slice), logs);
        // A likelihood of NaN gives its node no weight.
        if logs.iter().all(|log| log.is_nan()) {
            return refuse("observed", "a log likelihood of NaN at every node", "numbers or -inf");
        }
        logs.iter_mut()
            .filter(|log| log.is_nan())
            .for_each(|log| *log = f64::NEG_INFINITY);
        let peak = kernels::largest(logs);
        if peak == f64::INFINITY {
            return refuse("observed", "a log likelihood of infinity", "finite numbers or -inf");
        }
        if peak == f64::NEG_INFINITY {
            return Ok(None);
        }

        // Weights. If too few nodes have weight to locate the posterior, temper: raise the weights to an exponent below one.
        let effective = |sums: kernels::ExpSums| sums.sum * sums.sum / sums.sum_of_squares;
        let mut sums = kernels::exp_minus(logs, peak, weights);
        let log_total = sums.sum.ln();
        let (fewest, mut exponent) = (MIN_EFFECTIVE_NODES.powi(K as i32), 1.0);
        if effective(sums) < fewest {
            // The effective number of nodes decreases with the exponent. At the lowest, e^-27.6 = 1e-12, all nodes have nearly equal
            // weight. A number within 20 % of the aim is enough, since the moments only place the next grid.
            let (mut low, mut high) = (-27.6, 0.0);
            for _ in 0..BISECTIONS {
                let middle: f64 = 0.5 * (low + high);
                exponent = middle.exp();
                tempered
                    .iter_mut()
                    .zip(&*logs)
                    .for_each(|(t, log)| *t = exponent * (log - peak));
                sums = kernels::exp_minus(tempered, 0.0, weights);
                let found = effective(sums);
                if found < fewest {
                    high = middle;
                } else if found > 1.2 * fewest {
                    low = middle;
                } else {
                    break;
                }
            }
        }

        // Moments of the grid coordinates.
        let (mut first, mut second) = (SVector::<f64, K>::zeros(), SMatrix::<f64, K, K>::zeros());
        index = [0; K];
        for w in weights.iter() {
            // The largest weight is one, so what is skipped is below 2e-12 of the sum even with `MAX_NODES` nodes.
            if *w > 1e-18 {
                let t = node(&index);
                let weighted = t * *w;
                first += weighted;
                second += weighted * t.transpose();
            }
            advance(&mut index);
        }
        let mean = first / sums.sum;
        let covariance = second / sums.sum - mean * mean.transpose();

        let (values, vectors) = symmetric_eigen(covariance);
        let counted = effective(sums).powf(1.0 / K as f64) / (2.0 * PI.sqrt());
        let mut found = Found {
            exponent,
            log_evidence: peak + log_total + K as f64 * (step.ln() - LN_SQRT_2PI),
            log_peak: peak,
            step,
            mean,
            covariance,
            shortest: values.min().max(0.0).sqrt(),
            counted,
            gap: None,
        };
        if found.is_coarse() {
            // Weight of each layer of nodes across the longest axis.
            let along: SVector<f64, K> = vectors.column(values.imax()).into();
            let lowest = -self.reach * (K as f64).sqrt() - step;
            layers.clear();
            layers.resize((-2.0 * lowest / step) as usize + 2, 0.0);
            index = [0; K];
            for w in weights.iter() {
                let layer = ((along.dot(&node(&index)) - lowest) / step) as usize;
                layers[layer] += w / sums.sum;
                advance(&mut index);
            }
            found.gap = widest_gap(layers).map(|layer| (along, lowest + step * layer));
        }
        Ok(Some(found))
    }

    /// Sets the buffers to `nodes` per axis; returns the total number of nodes.
    fn resize<const K: usize>(&self, nodes: usize, workspace: &mut Workspace<K>) -> Result<usize, Error> {
        let Some(count) = nodes.checked_pow(K as u32).filter(|n| *n <= MAX_NODES) else {
            return refuse("nodes", format!("{nodes}^{K}"), format!("at most {MAX_NODES} nodes"));
        };
        let buffers = [&mut workspace.logs, &mut workspace.tempered, &mut workspace.weights];
        for buffer in workspace.columns.iter_mut().chain(buffers) {
            // Reserve memory for one refinement, so that most steps allocate nothing.
            let room = (2 * self.nodes - 1).pow(K as u32).min(MAX_REFINED_NODES).max(count);
            buffer.reserve(room - buffer.len().min(room));
            buffer.resize(count, 0.0);
        }
        workspace
            .layers
            .reserve(ROOM_FOR_LAYERS.saturating_sub(workspace.layers.len()));
        Ok(count)
    }
}

/// The middle of the widest run of empty layers between two modes, in layers from the lowest.
fn widest_gap(layers: &[f64]) -> Option<f64> {
    let (mut below, mut run, mut best) = (0.0, 0, (0, 0));
    for (i, weight) in layers.iter().enumerate() {
        let between = (MODE_SHARE..1.0 - MODE_SHARE).contains(&below);
        run = if between && *weight < EMPTY_LAYER { run + 1 } else { 0 };
        if run > best.0 {
            best = (run, i);
        }
        below += weight;
    }
    (best.0 >= GAP_LAYERS).then(|| (best.1 + 1) as f64 - 0.5 * best.0 as f64)
}
