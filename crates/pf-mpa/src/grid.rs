//! The recommended tracker: Gaussian in, exact likelihood on a small grid, Gaussian out.

use crate::Error;
use crate::error::refuse;
use crate::linearised::Linearised;
use crate::target::{Manoeuvres, Target};
use crate::tracker::{Ranged, StepInfo, Tracker};
use fewbits_core::{Gaussian, Likelihood};
use fewbits_numerics::kernels;
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::normal::LN_SQRT_2PI;
use fewbits_numerics::stored;
use nalgebra::{Cholesky, SMatrix, SVector};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// Deviations to each side that a grid covers by default.
const REACH: f64 = 4.0;
/// The second grid covers this multiple of the first posterior's deviations.
const MARGIN: f64 = 1.2;
/// Deviations of the posterior, in those of the prediction, below which a second grid pays.
const NARROW: f64 = 0.5;
/// Smallest scale of the second grid, in deviations of the prediction.
const FINEST: f64 = 0.02;
/// Below this share of its Gaussian peak (in logarithms) the posterior counts as underflown.
const UNDERFLOW: f64 = -690.0;

/// An assumed-density filter whose moments come from a grid over the first `K` coordinates of the state: those that the
/// likelihood depends on.
///
/// ```text
/// m_K, P_K = L L'            the predicted belief of the first K coordinates
/// pass 1:  u on n^K nodes over +-4;  p = m_K + L u;  weights exp(-u'u/2) p(observed | p);  moments of u
/// pass 2:  if all deviations are below 1/2: re-centred on the first posterior, +-4 x 1.2 of the largest
/// variances at least spacing^2 / 12;  the other coordinates follow by regression on the first K
/// ```
/// Deterministic: no draws, no seeds. All nodes that receive the same reports hold the same belief, to the last bit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct GridFilter {
    nodes: usize,
    reach: f64,
}

stored! { GridFilter as Stored { nodes: usize, reach: f64 } => GridFilter::new(nodes)?.with_reach(reach), Error }

impl Default for GridFilter {
    /// 15 nodes an axis.
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
    weights: Vec<f64>,
}

impl<const K: usize> Default for GridWorkspace<K> {
    fn default() -> Self {
        Self {
            columns: std::array::from_fn(|_| Vec::new()),
            logs: Vec::new(),
            weights: Vec::new(),
        }
    }
}

/// One grid in whitened coordinates, and the posterior's moments on it.
struct Pass<const K: usize> {
    log_evidence: f64,
    mean: SVector<f64, K>,
    covariance: SMatrix<f64, K, K>,
}

impl GridFilter {
    /// A filter with `nodes` nodes along each axis.
    ///
    /// # Errors
    /// Unless there are 3 to 1001.
    pub fn new(nodes: usize) -> Result<Self, Error> {
        if !(3..=1001).contains(&nodes) {
            return refuse("nodes", nodes, "3 to 1001 nodes an axis");
        }
        Ok(Self { nodes, reach: REACH })
    }

    /// The same over `reach` deviations to each side instead of 4: with many nodes, seven leave the moments exact.
    ///
    /// # Errors
    /// If it is outside 2 to 10.
    pub fn with_reach(self, reach: f64) -> Result<Self, Error> {
        fewbits_numerics::error::within("reach", reach, 2.0, 10.0)?;
        Ok(Self { reach, ..self })
    }

    /// Nodes along each axis.
    pub fn nodes(&self) -> usize {
        self.nodes
    }

    /// Bayes' rule for any likelihood of the first `K` coordinates. Returns the new belief and `ln p(observed | past)`.
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if the posterior underflows on the grid; if `K > D` or the first `K` coordinates have
    /// a singular covariance.
    pub fn update<const D: usize, const K: usize>(
        &self,
        predicted: &Gaussian<D>,
        observed: &(impl Likelihood<K> + ?Sized),
        workspace: &mut GridWorkspace<K>,
    ) -> Result<(Gaussian<D>, f64), Error> {
        if K == 0 || K > D {
            return refuse("K", K, format!("1 to {D} coordinates"));
        }
        let count = self.nodes.checked_pow(K as u32).filter(|n| *n <= 2_000_000);
        let Some(count) = count else {
            return refuse("nodes", format!("{}^{K}", self.nodes), "at most two million nodes");
        };
        let prior_mean = SVector::<f64, K>::from_fn(|i, _| predicted.mean()[i]);
        let prior_covariance = SMatrix::<f64, K, K>::from_fn(|i, j| predicted.covariance()[(i, j)]);
        let Some(factor) = Cholesky::new(prior_covariance) else {
            return refuse("predicted", "a singular covariance of the observed coordinates", "a positive definite one");
        };
        let lower = factor.l();
        for buffer in workspace
            .columns
            .iter_mut()
            .chain([&mut workspace.logs, &mut workspace.weights])
        {
            buffer.resize(count, 0.0);
        }
        let pass = |centre: &SVector<f64, K>, scale: f64, workspace: &mut GridWorkspace<K>| {
            self.pass(&prior_mean, &lower, centre, scale, observed, workspace)
        };
        let mut posterior = pass(&SVector::zeros(), 1.0, workspace)?;
        let deviations = posterior.covariance.diagonal().map(f64::sqrt);
        if deviations.max() < NARROW {
            posterior = pass(&posterior.mean, (MARGIN * deviations.max()).max(FINEST), workspace)?;
        }
        let mean = lower * posterior.mean;
        let covariance = lower * posterior.covariance * lower.transpose();
        // Regression of all coordinates on the first K: P_{:K} P_K^-1.
        let cross = SMatrix::<f64, K, D>::from_fn(|i, j| predicted.covariance()[(i, j)]);
        let gain = factor.solve(&cross).transpose();
        let kept = predicted.covariance() - gain * cross;
        let updated = Gaussian::from_trusted_parts(
            predicted.mean() + gain * mean,
            symmetrised(&(kept + gain * covariance * gain.transpose())),
        );
        if !updated
            .mean()
            .iter()
            .chain(updated.covariance().iter())
            .all(|x| x.is_finite())
        {
            return Err(Error::IMPOSSIBLE);
        }
        Ok((updated, posterior.log_evidence))
    }

    fn pass<const K: usize>(
        &self,
        origin: &SVector<f64, K>,
        lower: &SMatrix<f64, K, K>,
        centre: &SVector<f64, K>,
        scale: f64,
        observed: &(impl Likelihood<K> + ?Sized),
        workspace: &mut GridWorkspace<K>,
    ) -> Result<Pass<K>, Error> {
        let GridWorkspace { columns, logs, weights } = workspace;
        let step = 2.0 * self.reach / (self.nodes - 1) as f64;
        let node = |axis: usize, i: usize| centre[axis] + scale * (step * i as f64 - self.reach);
        let mut index = [0_usize; K];
        let advance = |index: &mut [usize; K]| {
            for i in index.iter_mut().rev() {
                *i += 1;
                if *i < self.nodes {
                    break;
                }
                *i = 0;
            }
        };
        for n in 0..logs.len() {
            let u = SVector::<f64, K>::from_fn(|axis, _| node(axis, index[axis]));
            let place = origin + lower * u;
            for (column, x) in columns.iter_mut().zip(place.iter()) {
                column[n] = *x;
            }
            logs[n] = -0.5 * u.norm_squared();
            advance(&mut index);
        }
        observed.add_log_likelihoods(columns.each_ref().map(Vec::as_slice), logs);
        logs.iter_mut()
            .filter(|log| log.is_nan())
            .for_each(|log| *log = f64::NEG_INFINITY);
        let peak = kernels::largest(logs);
        if peak.is_nan() || peak < UNDERFLOW || peak == f64::INFINITY {
            return Err(Error::IMPOSSIBLE);
        }
        kernels::exp_minus(logs, peak, weights);
        let (mut total, mut first, mut second) = (0.0, SVector::<f64, K>::zeros(), SMatrix::<f64, K, K>::zeros());
        index = [0; K];
        for w in weights.iter() {
            if *w > 1e-18 {
                let u = SVector::<f64, K>::from_fn(|axis, _| step * index[axis] as f64 - self.reach);
                total += w;
                let weighted = u * *w;
                first += weighted;
                second += weighted * u.transpose();
            }
            advance(&mut index);
        }
        let mean = first / total;
        let mut covariance = second / total - mean * mean.transpose();
        for axis in 0..K {
            covariance[(axis, axis)] = covariance[(axis, axis)].max(step * step / 12.0);
        }
        Ok(Pass {
            log_evidence: peak + total.ln() + K as f64 * ((scale * step).ln() - LN_SQRT_2PI),
            mean: centre + mean * scale,
            covariance: covariance * (scale * scale),
        })
    }
}

impl Tracker for GridFilter {
    type Belief = Gaussian<4>;
    type Workspace = GridWorkspace<2>;

    fn start<R: Rng + ?Sized>(&self, _: &mut R, _: &Target, prior: &Gaussian<4>) -> Result<Gaussian<4>, Error> {
        Ok(*prior)
    }

    fn estimate(&self, belief: &Gaussian<4>) -> Gaussian<4> {
        *belief
    }

    /// Where the posterior underflows on the grid, the step is that of Gaussian message passing, and says so.
    fn step_in_place<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        target: &Target,
        k: usize,
        belief: &mut Gaussian<4>,
        observed: &[Ranged],
        workspace: &mut GridWorkspace<2>,
    ) -> Result<StepInfo, Error> {
        let predicted = target.predict(belief, k, Manoeuvres::AsNoise);
        let (updated, fallbacks) = match self.update(&predicted, observed, workspace) {
            Ok(updated) => (updated, 0),
            Err(Error::Core(fewbits_core::Error::Impossible)) => {
                (Linearised::MESSAGE_PASSING.update(&predicted, observed)?, 1)
            }
            Err(error) => return Err(error),
        };
        *belief = updated.0;
        Ok(StepInfo {
            log_likelihood: Some(updated.1),
            fallbacks,
            ..StepInfo::default()
        })
    }
}
