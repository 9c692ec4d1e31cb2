//! A filter with a Gaussian belief whose posterior moments are computed from the exact likelihood on an adaptive grid.
//!
//! For likelihoods that depend on a few coordinates of the state, of any shape: sharp, wide, discontinuous, curved, with several modes. The
//! grid is adapted to the posterior until it resolves it. If that is not possible, an error is returned.
//!
//! Not for beliefs that are not Gaussian ([`PointMassFilter`](crate::PointMassFilter)), nor for more than
//! about three observed coordinates ([`BootstrapFilter`](crate::BootstrapFilter)).

mod filter;
mod pass;
mod region;

pub use filter::GridFilter;

use crate::Error;
use fewbits_core::{Gaussian, Likelihood};
use fewbits_numerics::error::{refuse, within};
use fewbits_numerics::linalg::{congruence, symmetrised};
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use region::{Piece, Region};

/// Default number of nodes on each axis.
const NODES: usize = 15;
/// Default extent of a grid to each side, in standard deviations.
const REACH: f64 = 4.0;
/// Moments from fewer nodes per deviation of the posterior are not accepted. For a Gaussian one node per deviation is enough for exact
/// moments; discontinuities and curvature need more.
const MIN_NODES_PER_DEVIATION: f64 = 1.5;
/// Nodes per deviation that a grid over `+- reach` deviations must have at least, so that the next grid, scaled by deviations that were
/// measured on this one, is still fine enough.
const NOMINAL_NODES_PER_DEVIATION: f64 = 1.6;
/// Smallest number of nodes per axis that can be set.
const MIN_NODES: usize = 5;
/// Largest number of nodes of one grid.
const MAX_NODES: usize = 2_000_000;
/// A posterior that a grid of the set number of nodes does not resolve is refined up to this number of nodes: 241^2, 38^3.
const MAX_REFINED_NODES: usize = 60_000;
/// Largest number of grids of one update. Each pass narrows the grid by a factor of about two, so a likelihood that is 10^6 times narrower
/// than the prior takes about 20 passes; the rest is for several modes and for curved ridges.
const MAX_PASSES: usize = 200;
/// A part is dropped before it is resolved if its log evidence is below that of a resolved part by more than this.
const DROPPED: f64 = 14.0;

/// The settings of [`GridFilter`], and its update of a likelihood of `K` coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Grid {
    nodes: usize,
    reach: f64,
}

/// Buffers of a grid, reused from step to step.
#[derive(Debug, Clone)]
struct Workspace<const K: usize> {
    columns: [Vec<f64>; K],
    logs: Vec<f64>,
    tempered: Vec<f64>,
    weights: Vec<f64>,
    layers: Vec<f64>,
    regions: Vec<Region<K>>,
    pieces: Vec<Piece<K>>,
}

impl<const K: usize> Default for Workspace<K> {
    fn default() -> Self {
        Self {
            columns: std::array::from_fn(|_| Vec::new()),
            logs: Vec::new(),
            tempered: Vec::new(),
            weights: Vec::new(),
            layers: Vec::new(),
            regions: Vec::with_capacity(64),
            pieces: Vec::with_capacity(64),
        }
    }
}

/// The root of the covariance of the coordinates `axes`; `None` if it is singular.
fn factor_of<const D: usize, const K: usize>(
    covariance: &SMatrix<f64, D, D>,
    axes: &[usize; K],
) -> Option<Cholesky<f64, Const<K>>> {
    Cholesky::new(SMatrix::from_fn(|i, j| covariance[(axes[i], axes[j])]))
}

/// Regression of all coordinates on `axes`: the gain `P_{:K} P_K^-1`, and the matrix that takes what these explain out of a state. A
/// congruence by it is a sum of positive terms.
fn regression<const D: usize, const K: usize>(
    covariance: &SMatrix<f64, D, D>,
    axes: &[usize; K],
    factor: &Cholesky<f64, Const<K>>,
) -> (SMatrix<f64, D, K>, SMatrix<f64, D, D>) {
    let cross = SMatrix::<f64, K, D>::from_fn(|i, j| covariance[(axes[i], j)]);
    let gain = factor.solve(&cross).transpose();
    let mut keep = SMatrix::<f64, D, D>::identity();
    for (k, axis) in axes.iter().enumerate() {
        for d in 0..D {
            keep[(d, *axis)] -= gain[(d, k)];
        }
    }
    (gain, keep)
}

impl Grid {
    fn new(nodes: usize, reach: f64) -> Result<Self, Error> {
        within("reach", reach, 2.0, 10.0)?;
        let fewest = (2.0 * reach * NOMINAL_NODES_PER_DEVIATION + 1.0).ceil() as usize;
        if !(MIN_NODES..=1001).contains(&nodes) {
            return refuse("nodes", nodes, format!("{MIN_NODES} to 1001 nodes on each axis"));
        }
        Ok(Self {
            nodes: nodes.max(fewest),
            reach,
        })
    }

    /// Measurement update for a likelihood of `K` coordinates, and `ln p(observed | past)`. `axes` lists these coordinates of the state, in
    /// the order in which the likelihood reads them.
    ///
    /// [`Error::Impossible`] if the observation has probability zero under the prediction, or one that underflows;
    /// [`Error::Unresolved`] if the posterior has fewer than 1.5 nodes per deviation; an argument error if `axes` are not different
    /// coordinates of the state, their covariance is singular, or the likelihood is NaN at every node.
    fn update<const D: usize, const K: usize>(
        &self,
        predicted: &Gaussian<D>,
        axes: [usize; K],
        observed: &(impl Likelihood<K> + ?Sized),
        workspace: &mut Workspace<K>,
    ) -> Result<(Gaussian<D>, f64), Error> {
        let origin = SVector::<f64, K>::from_fn(|i, _| predicted.mean()[axes[i]]);
        let Some(factor) = factor_of(predicted.covariance(), &axes) else {
            return refuse("predicted", "a singular covariance of the observed coordinates", "a positive definite one");
        };
        let prior = Prior {
            origin,
            lower: factor.l(),
        };
        let posterior = self.posterior(&prior, observed, workspace)?;

        let (gain, keep) = regression(predicted.covariance(), &axes, &factor);
        let moved = congruence(&(gain * prior.lower), &symmetrised(&posterior.covariance));
        let mean = predicted.mean() + gain * (prior.lower * posterior.mean);
        let updated = Gaussian::from_trusted_parts(mean, congruence(&keep, predicted.covariance()) + moved);
        if !updated.is_finite() {
            return Err(Error::Impossible);
        }
        Ok((updated, posterior.log_evidence))
    }

    /// Evaluates grids until all parts of the posterior are resolved, and combines their moments.
    fn posterior<const K: usize>(
        &self,
        prior: &Prior<K>,
        observed: &(impl Likelihood<K> + ?Sized),
        workspace: &mut Workspace<K>,
    ) -> Result<Piece<K>, Error> {
        workspace.pieces.clear();
        workspace.regions.clear();
        workspace.regions.push(Region::whole(self.nodes));
        // Take a region, evaluate its grid, then keep its moments, drop it, split it at a gap, refine it or narrow it.
        let mut passes = 0;
        while let Some(region) = workspace.regions.pop() {
            passes += 1;
            let found = self.pass(prior, &region, observed, workspace)?;
            // The posterior is zero in this region.
            let Some(found) = found else { continue };
            let best = best_of(&workspace.pieces);
            if found.is_done(&region, self.reach) {
                workspace.pieces.push(found.piece(&region));
            } else if found.is_below(&region, best, DROPPED) {
                continue;
            } else if passes >= MAX_PASSES {
                return Err(unresolved(&found));
            } else if let Some((along, offset)) = found.gap.filter(|_| region.can_split()) {
                workspace.regions.extend(region.split(&along, offset));
            } else if found.is_coarse() && found.is_stalled() {
                let refined = region.refined();
                if refined.nodes.pow(K as u32) > MAX_REFINED_NODES {
                    return Err(unresolved(&found));
                }
                workspace.regions.push(refined);
            } else {
                workspace.regions.push(region.narrowed(&found));
            }
        }
        let peak = best_of(&workspace.pieces);
        if peak == f64::NEG_INFINITY {
            return Err(Error::Impossible);
        }
        // Moments of the mixture of all parts, each weighted by its evidence.
        let pieces = &workspace.pieces;
        let shares = || pieces.iter().map(|piece| (piece, (piece.log_evidence - peak).exp()));
        let total: f64 = shares().map(|(_, share)| share).sum();
        let mean = shares().fold(SVector::zeros(), |sum, (piece, share)| sum + piece.mean * (share / total));
        let covariance = shares().fold(SMatrix::zeros(), |sum, (piece, share)| {
            let offset = piece.mean - mean;
            sum + (piece.covariance + offset * offset.transpose()) * (share / total)
        });
        let log_evidence = peak + total.ln();
        Ok(Piece {
            log_evidence,
            mean,
            covariance,
        })
    }
}

/// The largest logarithm of an evidence, `-inf` of no piece.
fn best_of<const K: usize>(pieces: &[Piece<K>]) -> f64 {
    let logs = pieces.iter().map(|piece| piece.log_evidence);
    logs.fold(f64::NEG_INFINITY, f64::max)
}

fn unresolved<const K: usize>(found: &pass::Found<K>) -> Error {
    Error::Unresolved {
        value: found.nodes_per_deviation(),
        unit: "nodes per deviation",
        expected: "at least 1.5",
    }
}

/// The predicted distribution of the observed coordinates: `x = origin + lower u`, `u` standard normal.
struct Prior<const K: usize> {
    origin: SVector<f64, K>,
    lower: SMatrix<f64, K, K>,
}
