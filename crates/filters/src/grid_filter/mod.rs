//! Gaussian in, exact likelihood on a grid that adapts, Gaussian out.
//!
//! For likelihoods of a few coordinates of the state, of any shape: sharp, wide, with edges, curved, with several modes. The grid
//! follows the posterior until it resolves it; what it cannot resolve is an error and no number.
//!
//! Not here: beliefs that are no Gaussian ([`PointMassFilter`](crate::PointMassFilter)), more than
//! about three observed coordinates ([`ParticleFilter`](crate::ParticleFilter)).

mod on_axes;
mod pass;
mod region;

pub use on_axes::GridOnAxes;

use crate::Error;
use fewbits_core::{Gaussian, Likelihood, OnAxes};
use fewbits_numerics::error::{at_least_one, refuse, within};
use fewbits_numerics::linalg::{congruence, symmetrised};
use fewbits_numerics::stored;
use nalgebra::{Cholesky, SMatrix, SVector};
use region::{Piece, Region};
use serde::{Deserialize, Serialize};

/// Deviations to each side that a grid covers by default.
const REACH: f64 = 4.0;
/// Nodes per deviation of the posterior below which its moments are refused. A Gaussian has exact moments from one node per
/// deviation on; edges of cells and curvature take more.
const MIN_NODES_PER_DEVIATION: f64 = 1.5;
/// Nodes per deviation that a grid over `+- reach` deviations must have, so that the next grid, built for deviations that were
/// measured on this one, is still fine enough.
const NOMINAL_NODES_PER_DEVIATION: f64 = 1.6;
/// Smallest number of nodes on an axis that may be asked for.
const MIN_NODES: usize = 5;
/// Largest number of nodes of one grid.
const MAX_NODES: usize = 2_000_000;
/// Nodes of one grid up to which a posterior is followed that a grid of the default number does not resolve: 241^2, 38^3.
const MAX_REFINED_NODES: usize = 60_000;
/// Grids that one update may lay. Each pass narrows the grid by a factor of about two, so that six decades between prior and likelihood
/// take about 20 passes; the rest is for several modes and for curved ridges.
const MAX_PASSES: usize = 200;
/// Share of the evidence below which it does not matter whether a part of the posterior is resolved.
const NEGLIGIBLE_SHARE: f64 = 1e-3;
/// `ln` of the ratio to a resolved part's evidence below which a part is dropped before it is resolved.
const DROPPED: f64 = 14.0;

/// An assumed-density filter whose moments come from a grid over the `K` coordinates that the likelihood depends on.
///
/// ```text
/// m, L L'     mean and covariance of those coordinates;  u = L^-1 (x - m) is standard normal
/// grid:       centre c, orthogonal axes with deviations d;  n^K nodes over +-reach deviations;  first c = 0, d = 1
/// pass:       w = exp(b (ln N(u; 0, I) + ln p(observed | x)));  b = 1 if w then is of at least 3^K effective nodes,
///             otherwise the b that gives so many;  moments of u under w
///             done if b = 1, the posterior has 1.5 nodes per deviation and lies inside the grid
///             otherwise: next grid along the principal axes of these moments, over +-reach of its deviations
/// split:      if layers of nodes across the longest axis are empty between two modes: a grid for each side
/// refine:     if the grid no longer narrows (a curved ridge): twice as many nodes on each axis
/// the other coordinates follow by regression on the K
/// ```
/// Deterministic: no draws, no seeds. All nodes that receive the same reports hold the same belief, to the last bit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct GridFilter {
    nodes: usize,
    reach: f64,
}

stored! { GridFilter as Stored { nodes: usize, reach: f64 } => GridFilter::with_nodes_and_reach(nodes, reach), Error }

impl Default for GridFilter {
    /// 15 nodes on each axis.
    fn default() -> Self {
        Self {
            nodes: 15,
            reach: REACH,
        }
    }
}

/// Buffers of a grid, kept from step to step.
#[derive(Debug, Clone)]
pub struct GridWorkspace<const K: usize> {
    columns: [Vec<f64>; K],
    logs: Vec<f64>,
    tempered: Vec<f64>,
    weights: Vec<f64>,
    layers: Vec<f64>,
    regions: Vec<Region<K>>,
    pieces: Vec<Piece<K>>,
}

impl<const K: usize> Default for GridWorkspace<K> {
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

/// What an update reveals besides the new belief.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct GridInfo {
    /// `ln p(observed | past)`.
    pub log_likelihood: f64,
    /// Nodes per deviation of the posterior along the principal axis that has fewest, of the part of it that has fewest.
    pub nodes_per_deviation: f64,
    /// Grids that were laid.
    pub passes: usize,
    /// Parts that the posterior was split into; 1 if it is compact.
    pub parts: usize,
}

impl GridFilter {
    /// A filter with `nodes` nodes on each axis, over 4 deviations to each side.
    ///
    /// Fewer than 14 are laid as 14: they would have less than 1.6 nodes per deviation, too few for moments of a posterior with edges.
    ///
    /// # Errors
    /// Unless there are 5 to 1001.
    pub fn new(nodes: usize) -> Result<Self, Error> {
        Self::with_nodes_and_reach(nodes, REACH)
    }

    /// The same over `reach` deviations to each side: with many nodes, seven leave the moments exact.
    ///
    /// A grid of fewer than 1.6 nodes per deviation is laid with so many.
    ///
    /// # Errors
    /// If it is outside 2 to 10.
    pub fn with_reach(self, reach: f64) -> Result<Self, Error> {
        Self::with_nodes_and_reach(self.nodes, reach)
    }

    fn with_nodes_and_reach(nodes: usize, reach: f64) -> Result<Self, Error> {
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

    /// Nodes on each axis.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Bayes' rule for any likelihood of `K` coordinates: those of the state that `axes` names, in the order in which the likelihood
    /// reads them.
    ///
    /// # Errors
    /// [`Error::Impossible`] if the observation has probability zero under the prediction, or so little that its density
    /// underflows; [`Error::Unresolved`] if the posterior has fewer than 1.5 nodes per deviation; if `axes` are not different
    /// coordinates of the state, their covariance is singular, or the likelihood is NaN at every node.
    pub fn update<const D: usize, const K: usize>(
        &self,
        predicted: &Gaussian<D>,
        axes: [usize; K],
        observed: &(impl Likelihood<K> + ?Sized),
        workspace: &mut GridWorkspace<K>,
    ) -> Result<(Gaussian<D>, GridInfo), Error> {
        check_axes::<D, K>(&axes)?;
        let origin = SVector::<f64, K>::from_fn(|i, _| predicted.mean()[axes[i]]);
        let covariance = SMatrix::<f64, K, K>::from_fn(|i, j| predicted.covariance()[(axes[i], axes[j])]);
        let Some(factor) = Cholesky::new(covariance) else {
            return refuse("predicted", "a singular covariance of the observed coordinates", "a positive definite one");
        };
        let prior = Prior {
            origin,
            lower: factor.l(),
        };
        let (posterior, info) = self.posterior(&prior, observed, workspace)?;

        // Regression of all coordinates on those observed: P_{:K} P_K^-1. What remains of the others is a sum of positives.
        let cross = SMatrix::<f64, K, D>::from_fn(|i, j| predicted.covariance()[(axes[i], j)]);
        let gain = factor.solve(&cross).transpose();
        let mut keep = SMatrix::<f64, D, D>::identity();
        for (k, axis) in axes.iter().enumerate() {
            for d in 0..D {
                keep[(d, *axis)] -= gain[(d, k)];
            }
        }
        let moved = congruence(&(gain * prior.lower), &symmetrised(&posterior.covariance));
        let mean = predicted.mean() + gain * (prior.lower * posterior.mean);
        let updated = Gaussian::from_trusted_parts(mean, congruence(&keep, predicted.covariance()) + moved);
        if !updated.is_finite() {
            return Err(Error::Impossible);
        }
        Ok((updated, info))
    }

    /// Lays grids until all parts of the posterior are resolved, and joins their moments.
    fn posterior<const K: usize>(
        &self,
        prior: &Prior<K>,
        observed: &(impl Likelihood<K> + ?Sized),
        workspace: &mut GridWorkspace<K>,
    ) -> Result<(Moments<K>, GridInfo), Error> {
        workspace.pieces.clear();
        workspace.regions.clear();
        workspace.regions.push(Region::whole(self.nodes));
        let mut passes = 0;
        while let Some(region) = workspace.regions.pop() {
            passes += 1;
            let found = self.pass(prior, &region, observed, workspace)?;
            // Nothing of the posterior is on this side.
            let Some(found) = found else { continue };
            let best = workspace.pieces.iter().map(|piece| piece.log_evidence);
            let best = best.fold(f64::NEG_INFINITY, f64::max);
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
        let peak = workspace
            .pieces
            .iter()
            .fold(f64::NEG_INFINITY, |peak, piece| peak.max(piece.log_evidence));
        if peak == f64::NEG_INFINITY {
            return Err(Error::Impossible);
        }
        let shares = || {
            workspace
                .pieces
                .iter()
                .map(|piece| (piece, (piece.log_evidence - peak).exp()))
        };
        let total: f64 = shares().map(|(_, share)| share).sum();
        let resolution = shares()
            .filter(|(_, share)| *share > NEGLIGIBLE_SHARE * total)
            .map(|(piece, _)| piece.nodes_per_deviation)
            .fold(f64::INFINITY, f64::min);
        let mean = shares().fold(SVector::zeros(), |sum, (piece, share)| sum + piece.mean * (share / total));
        let covariance = shares().fold(SMatrix::zeros(), |sum, (piece, share)| {
            let offset = piece.mean - mean;
            sum + (piece.covariance + offset * offset.transpose()) * (share / total)
        });
        let info = GridInfo {
            log_likelihood: peak + total.ln(),
            nodes_per_deviation: resolution,
            passes,
            parts: workspace.pieces.len(),
        };
        Ok((Moments { mean, covariance }, info))
    }
}

fn unresolved<const K: usize>(found: &pass::Found<K>) -> Error {
    Error::Unresolved {
        value: found.nodes_per_deviation(),
        unit: "nodes per deviation",
        expected: "at least 1.5",
    }
}

/// The predicted belief of the observed coordinates: `x = origin + lower u`, `u` standard normal.
struct Prior<const K: usize> {
    origin: SVector<f64, K>,
    lower: SMatrix<f64, K, K>,
}

/// Moments of `u`.
struct Moments<const K: usize> {
    mean: SVector<f64, K>,
    covariance: SMatrix<f64, K, K>,
}

/// Refuses axes that are not `K` different coordinates of a state of `D`.
fn check_axes<const D: usize, const K: usize>(axes: &[usize; K]) -> Result<(), Error> {
    at_least_one("axes", K)?;
    OnAxes::<(), D, K>::new((), *axes)?;
    Ok(())
}
