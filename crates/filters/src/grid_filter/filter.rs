//! The filter: settings, and all observations of one instant jointly.

use super::{Grid, NODES, REACH, Workspace, factor_of, regression};
use crate::Error;
use crate::contract::{Info, StateFilter, predicted};
use fewbits_core::{Columns, Gaussian, GaussianDynamics, Likelihood, OnAxes};
use fewbits_numerics::error::{at_least_one, refuse};
use fewbits_numerics::linalg::congruence;
use nalgebra::{SMatrix, SVector};
use rand::Rng;

/// For one, two and three axes: number of parts per axis into which the belief is divided, and over how many deviations to each side. Beyond
/// 6 deviations is a probability of 2e-9. Reports of more axes are tested by moments.
const PARTS: [(usize, f64); 3] = [(97, 6.0), (25, 6.0), (13, 5.0)];
/// Deviation `s` of a part, in steps `d` from one part to the next. The density of all parts together is that of the belief within
/// `2 exp(-2 pi^2 s^2 (1 - s^2) / d^2)` for each axis: 1e-4, 4e-4 and 4e-3 for one, two and three axes.
const PART_DEVIATION: f64 = 0.7;

/// A filter with a Gaussian belief whose moments are computed on a grid over the `K` coordinates `axes`, on which the likelihoods depend. It
/// processes all observations of one instant jointly, without linearisation.
///
/// ```text
/// m, L L'     mean and covariance of those coordinates;  u = L^-1 (x - m) is standard normal
/// grid:       centre c, orthogonal axes with deviations d;  n^K nodes over +-reach deviations;  first c = 0, d = 1
/// pass:       w = exp(b (ln N(u; 0, I) + ln p(observed | x)));  b = 1 if w then has at least 3^K effective nodes,
///             otherwise the b that gives about 3^K;  moments of u under w
///             done if b = 1, the posterior has 1.5 nodes per deviation and lies inside the grid
///             otherwise: next grid along the principal axes of these moments, over +-reach of its deviations
/// split:      if layers of nodes across the longest axis are empty between two modes: a grid for each side
/// refine:     if the grid no longer narrows (a curved ridge): twice as many nodes on each axis
/// the other coordinates follow by regression on the K
/// ```
/// The filter is deterministic: no random numbers. Nodes that receive the same reports have the same belief to the last bit.
///
/// An update fails with [`Error::Impossible`] if the observations have probability zero under the belief, or one that underflows, with
/// [`Error::Unresolved`] if the posterior has fewer than 1.5 nodes per deviation, and with an argument error if a likelihood depends on a
/// coordinate outside `axes`, the covariance of `axes` is singular, or the likelihood is NaN at every node.
#[derive(Debug, Clone)]
pub struct GridFilter<const D: usize, const K: usize> {
    grid: Grid,
    axes: [usize; K],
    workspace: Workspace<K>,
}

impl<const D: usize, const K: usize> GridFilter<D, K> {
    /// The filter for likelihoods that depend only on the coordinates `axes`, with 15 nodes on each axis over 4 standard deviations to each
    /// side.
    ///
    /// # Errors
    /// If `axes` are not different coordinates of a state of `D`.
    pub fn new(axes: [usize; K]) -> Result<Self, Error> {
        at_least_one("axes", K)?;
        OnAxes::<(), D, K>::new((), axes)?;
        Ok(Self {
            grid: Grid::new(NODES, REACH)?,
            axes,
            workspace: Workspace::default(),
        })
    }

    /// The same filter with `nodes` nodes on each axis. Fewer than give 1.6 nodes per deviation (14 over 4 deviations to each side) are raised
    /// to that number: they would be too few for discontinuous posteriors.
    ///
    /// # Errors
    /// If `nodes` is not in 5 to 1001.
    pub fn with_nodes(self, nodes: usize) -> Result<Self, Error> {
        let grid = Grid::new(nodes, self.grid.reach)?;
        Ok(Self { grid, ..self })
    }

    /// The same filter over `reach` standard deviations to each side. With many nodes, 7 deviations leave the moments exact to rounding.
    /// The number of nodes is raised as in [`with_nodes`](Self::with_nodes).
    ///
    /// # Errors
    /// If `reach` is not in 2 to 10.
    pub fn with_reach(self, reach: f64) -> Result<Self, Error> {
        let grid = Grid::new(self.grid.nodes, reach)?;
        Ok(Self { grid, ..self })
    }

    /// Nodes on each axis.
    pub fn nodes(&self) -> usize {
        self.grid.nodes
    }
}

/// Likelihoods of a state of `D` as functions of the coordinates `axes`; the other coordinates are those of `state`.
struct OnPlane<'a, const D: usize, const K: usize> {
    observed: &'a [&'a dyn Likelihood<D>],
    axes: [usize; K],
    state: SVector<f64, D>,
}

impl<const D: usize, const K: usize> Likelihood<K> for OnPlane<'_, D, K> {
    fn log_likelihood(&self, place: &SVector<f64, K>) -> f64 {
        let mut state = self.state;
        self.axes
            .iter()
            .zip(place.iter())
            .for_each(|(axis, x)| state[*axis] = *x);
        self.observed.log_likelihood(&state)
    }

    fn add_log_likelihoods(&self, places: Columns<'_, K>, logs: &mut [f64]) {
        const BLOCK: usize = 256;
        if !fewbits_core::columns::lengths_agree(&places, logs) {
            return;
        }
        // Coordinates on which no likelihood depends.
        let constant: [[f64; BLOCK]; D] = std::array::from_fn(|d| [self.state[d]; BLOCK]);
        for (block, logs) in logs.chunks_mut(BLOCK).enumerate() {
            let (start, count) = (block * BLOCK, logs.len());
            let column = |d: usize| match self.axes.iter().position(|axis| *axis == d) {
                Some(k) => &places[k][start..start + count],
                None => &constant[d][..count],
            };
            let states: Columns<'_, D> = std::array::from_fn(column);
            self.observed.add_log_likelihoods(states, logs);
        }
    }
}

impl<const D: usize, const K: usize> StateFilter<D> for GridFilter<D, K> {
    type Belief = Gaussian<D>;

    fn start(&mut self, _: &mut dyn Rng, prior: &Gaussian<D>) -> Result<Gaussian<D>, Error> {
        Ok(*prior)
    }

    fn predict(
        &mut self,
        _: &mut dyn Rng,
        dynamics: &dyn GaussianDynamics<D>,
        belief: &mut Gaussian<D>,
    ) -> Result<(), Error> {
        *belief = predicted(dynamics, belief)?;
        Ok(())
    }

    fn update(
        &mut self,
        _: &mut dyn Rng,
        belief: &mut Gaussian<D>,
        observed: &[&dyn Likelihood<D>],
    ) -> Result<Info, Error> {
        if observed.is_empty() {
            return Ok(Info::default());
        }
        // The grid covers `axes` only. The other coordinates are held at the mean, so no likelihood may depend on them.
        let others = (0..D).filter(|d| !self.axes.contains(d));
        for axis in others {
            if observed.iter().any(|one| one.reads(belief.mean(), axis)) {
                let expected = format!("likelihoods that read the coordinates {:?} only", self.axes);
                return refuse("observed", format!("a likelihood that reads coordinate {axis}"), expected);
            }
        }
        let joint = OnPlane {
            observed,
            axes: self.axes,
            state: *belief.mean(),
        };
        let (next, log_likelihood) = self.grid.update(belief, self.axes, &joint, &mut self.workspace)?;
        *belief = next;
        Ok(Info::new(log_likelihood))
    }

    fn mixture(&self, belief: &Gaussian<D>) -> Option<Vec<(f64, Gaussian<D>)>> {
        divided(belief, &self.axes)
    }
}

/// The Gaussian as a sum of narrow ones along `axes`, over each of which a curved sensor is nearly linear; `None` for more than three axes,
/// or if it cannot be divided.
///
/// ```text
/// x_K = m_K + L u,  u ~ N(0, I);   x = m + B u + e,   B = P_{:K} L^-T,   e independent of u
/// N(u; 0, 1) = about sum_k p_k N(u; k d, s^2),  p_k proportional to N(k d; 0, 1 - s^2),  s = 0.7 d      on each axis
/// ```
fn divided<const D: usize, const K: usize>(belief: &Gaussian<D>, axes: &[usize; K]) -> Option<Vec<(f64, Gaussian<D>)>> {
    let (parts, reach) = *PARTS.get(K.checked_sub(1)?)?;
    let covariance = belief.covariance();
    let factor = factor_of(covariance, axes)?;
    let cross = SMatrix::<f64, K, D>::from_fn(|i, d| covariance[(axes[i], d)]);
    let along = factor.l().solve_lower_triangular(&cross)?.transpose();
    let step = 2.0 * reach / (parts - 1) as f64;
    let variance = (PART_DEVIATION * step).powi(2);
    // What `u` does not explain, as a sum of positive terms: (I - B L^-1 S) P (I - B L^-1 S)', where S takes the axes out of a state.
    let (_, keep) = regression(covariance, axes, &factor);
    let part = congruence(&keep, covariance) + along * along.transpose() * variance;
    let offset = |index: usize| (index as f64 - 0.5 * (parts - 1) as f64) * step;
    let all = (0..parts.pow(K as u32)).map(|index| {
        let u = SVector::<f64, K>::from_fn(|k, _| offset(index / parts.pow(k as u32) % parts));
        let log_weight = -0.5 * u.norm_squared() / (1.0 - variance);
        (log_weight, Gaussian::from_trusted_parts(belief.mean() + along * u, part))
    });
    // Parts that together weigh less than rounding are left out.
    let lowest = -0.5 * reach * reach / (1.0 - variance);
    Some(all.filter(|(log_weight, _)| *log_weight >= lowest - 1e-9).collect())
}

#[cfg(test)]
mod tests {
    use super::divided;
    use fewbits_core::Gaussian;
    use nalgebra::{Matrix3, Vector3};

    /// `ln N(x)` up to a constant.
    fn log_density(one: &Gaussian<3>, x: &Vector3<f64>) -> f64 {
        let factor = nalgebra::Cholesky::new(*one.covariance()).unwrap();
        let u = factor.l().solve_lower_triangular(&(x - one.mean())).unwrap();
        -0.5 * u.norm_squared() - factor.l().diagonal().map(f64::ln).sum()
    }

    #[test]
    fn parts_have_the_density_of_the_whole() {
        let covariance = Matrix3::new(4.0, 1.2, 0.3, 1.2, 2e-6, 0.0, 0.3, 0.0, 1.0);
        let covariance = covariance * covariance.transpose();
        let belief = Gaussian::new(Vector3::new(1.0, -2.0, 30.0), covariance).unwrap();
        let check = |parts: Vec<(f64, Gaussian<3>)>, tolerance: f64| {
            let total: f64 = parts.iter().map(|(log, _)| log.exp()).sum();
            let factor = nalgebra::Cholesky::new(covariance).unwrap().l();
            for u in [
                [0.0; 3],
                [1.0, -1.0, 0.5],
                [2.5, 0.3, -2.0],
                [-4.5, 0.0, 0.0],
                [0.0, 4.5, 0.0],
            ] {
                let x = belief.mean() + factor * Vector3::from(u);
                let density: f64 = parts
                    .iter()
                    .map(|(log, part)| (log + log_density(part, &x)).exp())
                    .sum();
                let off = density.ln() - total.ln() - log_density(&belief, &x);
                assert!(off.abs() < tolerance, "{u:?}: {off}");
            }
        };
        check(divided(&belief, &[0]).unwrap(), 2e-4);
        check(divided(&belief, &[2, 0]).unwrap(), 1e-3);
        check(divided(&belief, &[0, 1, 2]).unwrap(), 1.5e-2);
        assert!(divided(&Gaussian::new(Vector3::zeros(), Matrix3::zeros()).unwrap(), &[0]).is_none());
    }
}
