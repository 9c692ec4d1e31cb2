//! Transition densities on a grid, as matrices.

use crate::Error;
use fewbits_core::{Gaussian, GaussianDynamics};
use fewbits_densities::{PointMass, UniformGrid};
use fewbits_numerics::error::ArgumentError;
use fewbits_numerics::normal::INV_SQRT_2PI;
use nalgebra::{Matrix1, Vector1};

/// Entries of the kernel at more standard deviations than this are below rounding.
const REACH: f64 = 8.6;
/// Widest spacing, in standard deviations of the process noise, at which the trapezoid rule has an error of about 1e-8.
const COARSEST: f64 = 1.0;

/// The transition density of scalar dynamics on a grid: the time update of [`PointMassFilter`](crate::PointMassFilter) as a matrix, computed
/// once for dynamics that stay the same, and the exact smoother.
///
/// The transition density is smooth, so the error of the trapezoid rule falls exponentially: with a spacing of 0.4 standard deviations of
/// the process noise (or of the sensing noise, if that is smaller) it is exact to rounding, as long as the grid covers the density.
///
/// ```text
/// predict:  p(x) <- h sum_y N(x; a y, q) p(y)
/// smooth:   p(x) <- p(x) sum over the future of p(observed later | x)
/// ```
///
/// ```
/// use fewbits_numerics::normal::log_cdf;
/// use fewbits_filters::{PointMass, TransitionKernel, UniformGrid};
/// use fewbits_models::Ar1;
/// let kernel = TransitionKernel::new(&Ar1::new(0.9, 0.5)?, UniformGrid::symmetric(14.0, 0.25)?)?;
/// let mut belief = kernel.predict(&PointMass::normal(*kernel.grid(), 0.0, 1.0)?)?;
/// belief.update_with(|x| log_cdf(x - 0.3))?;          // a sign bit at threshold 0.3 in unit noise
/// assert!(belief.mean() > 0.3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq)]
pub struct TransitionKernel {
    grid: UniformGrid,
    /// First column of each kernel row that is not negligible, and where the row starts in `weights`.
    rows: Vec<(usize, usize)>,
    weights: Vec<f64>,
}

impl TransitionKernel {
    /// The kernel of dynamics with Gaussian noise that the grid resolves.
    ///
    /// # Errors
    /// If the noise at some node has a standard deviation below the spacing, or a mean is not finite.
    pub fn new(dynamics: &impl GaussianDynamics<1>, grid: UniformGrid) -> Result<Self, Error> {
        Self::from_transitions(grid, &moved(&grid, dynamics))
    }

    /// The kernel whose transition density from node `i` is normal with mean and standard deviation `moved[i]`: for dynamics that are known
    /// at the nodes only.
    ///
    /// # Errors
    /// If there is not one pair per node, a mean is not finite, or a deviation is below the spacing of the grid.
    pub fn from_transitions(grid: UniformGrid, moved: &[(f64, f64)]) -> Result<Self, Error> {
        if moved.len() != grid.points() {
            let expected = format!("{}, one per node", grid.points());
            return Err(ArgumentError::new("moved", format!("{} pairs", moved.len()), expected).into());
        }
        if let Some((mean, deviation)) = moved.iter().find(|(mean, s)| !(mean.is_finite() && s.is_finite())) {
            let expected = "finite means and deviations";
            return Err(ArgumentError::new("moved", format!("({mean}, {deviation})"), expected).into());
        }
        if let Some((_, deviation)) = moved.iter().find(|(_, s)| *s < COARSEST * grid.spacing()) {
            let expected = format!("a spacing that resolves a deviation of {deviation}");
            return Err(ArgumentError::new("grid", format!("spacing {}", grid.spacing()), expected).into());
        }
        // The kernel is stored by rows (next state), but a motion says which rows a column (present state) reaches. First the range of
        // columns of each row, then its entries.
        let mut reach = vec![(grid.points(), 0); grid.points()];
        for (j, (mean, deviation)) in moved.iter().enumerate() {
            for i in grid.indices_within(mean - REACH * deviation, mean + REACH * deviation) {
                reach[i] = (reach[i].0.min(j), j + 1);
            }
        }
        let (mut rows, mut weights) = (Vec::with_capacity(grid.points() + 1), Vec::new());
        for (x, (from, to)) in grid.nodes().zip(reach) {
            rows.push((from.min(to), weights.len()));
            weights.extend(moved[from.min(to)..to].iter().map(|(mean, deviation)| {
                let z = (x - mean) / deviation;
                grid.spacing() * INV_SQRT_2PI / deviation * (-0.5 * z * z).exp()
            }));
        }
        rows.push((0, weights.len()));
        Ok(Self { grid, rows, weights })
    }

    /// The nodes.
    pub fn grid(&self) -> &UniformGrid {
        &self.grid
    }

    /// Row `i` of the kernel, and the column of its first entry.
    fn row(&self, i: usize) -> (usize, &[f64]) {
        let (column, start) = self.rows[i];
        (column, &self.weights[start..self.rows[i + 1].1])
    }

    fn check(&self, belief: &PointMass) -> Result<(), Error> {
        if *belief.grid() == self.grid {
            Ok(())
        } else {
            Err(ArgumentError::new("belief", format!("on {:?}", belief.grid()), "a density on the kernel's grid")
                .into())
        }
    }

    /// Time update. Mass that leaves the grid is lost; the rest is normalised.
    ///
    /// # Errors
    /// If the belief is on another grid; [`Error::Impossible`] if no mass remains on the grid.
    pub fn predict(&self, belief: &PointMass) -> Result<PointMass, Error> {
        self.check(belief)?;
        let next = |i: usize| -> f64 {
            let (column, row) = self.row(i);
            let from = &belief.density()[column..column + row.len()];
            row.iter().zip(from).map(|(w, q)| w * q).sum()
        };
        PointMass::from_density(self.grid, (0..self.grid.points()).map(next).collect())
    }

    /// The smoothed density: the filtered density times the likelihood of all later observations.
    ///
    /// `likelihoods[k]` contains `p(observed at step k + 1 after the belief | x)` at the nodes, up to a constant factor.
    ///
    /// # Errors
    /// If the belief is on another grid or a likelihood has the wrong length; [`Error::Impossible`] if the product is zero.
    pub fn smooth<L: AsRef<[f64]>>(&self, filtered: &PointMass, likelihoods: &[L]) -> Result<PointMass, Error> {
        self.check(filtered)?;
        let mut message = vec![1.0; self.grid.points()];
        let mut weighted = message.clone();
        for likelihood in likelihoods.iter().rev() {
            let likelihood = likelihood.as_ref();
            if likelihood.len() != self.grid.points() {
                let expected = "one value per node";
                return Err(ArgumentError::new("likelihoods", format!("{} values", likelihood.len()), expected).into());
            }
            for ((w, m), l) in weighted.iter_mut().zip(&message).zip(likelihood) {
                *w = m * l;
            }
            // p(later observations | x) = sum_x' N(x'; a x, q) p(observed | x') p(those after it | x'): the transposed kernel.
            message.fill(0.0);
            for (i, w) in weighted.iter().enumerate() {
                let (column, row) = self.row(i);
                for (m, k) in message[column..].iter_mut().zip(row) {
                    *m += k * w;
                }
            }
            // Only the ratios matter; normalisation keeps a long product from underflowing.
            let peak = message.iter().copied().fold(0.0, f64::max);
            if !(peak > 0.0 && peak.is_finite()) {
                return Err(Error::Impossible);
            }
            message.iter_mut().for_each(|m| *m /= peak);
        }
        let mut smoothed = filtered.clone();
        smoothed.reweight(&message)?;
        Ok(smoothed)
    }
}

/// Mean and deviation of the next state, from each node.
pub(crate) fn moved(grid: &UniformGrid, dynamics: &dyn GaussianDynamics<1>) -> Vec<(f64, f64)> {
    let from = |y: f64| dynamics.predict(&Gaussian::from_trusted_parts(Vector1::new(y), Matrix1::zeros()), 1.0);
    let moves = grid.nodes().map(from);
    moves
        .map(|next| (next.mean()[0], next.covariance()[0].sqrt()))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::TransitionKernel;
    use crate::{kalman, smoother};
    use fewbits_core::Gaussian;
    use fewbits_densities::{PointMass, UniformGrid};
    use fewbits_models::{Ar1, LinearSensor};
    use fewbits_numerics::normal::log_pdf_with;
    use nalgebra::Vector1;

    /// With Gaussian measurements the Kalman filter and smoother are exact, so the grid must agree with them.
    #[test]
    fn agrees_with_kalman_and_smoother() {
        for a in [0.9, -0.7, 0.0, 1.0] {
            let dynamics = Ar1::new(a, 0.5).unwrap();
            let sensing = LinearSensor::direct(1.3).unwrap();
            let kernel = TransitionKernel::new(&dynamics, UniformGrid::symmetric(16.0, 0.25).unwrap()).unwrap();
            let mut grid_belief = PointMass::normal(*kernel.grid(), 0.4, 2.0).unwrap();
            let mut belief = Gaussian::scalar(0.4, 2.0).unwrap();
            let data = [1.0, -0.5, 2.5, 0.1, -1.2];
            let (mut beliefs, mut grid_beliefs, mut likelihoods) = (vec![], vec![], vec![]);
            for z in data {
                grid_belief = kernel.predict(&grid_belief).unwrap();
                let evidence = grid_belief.update_with(|x| log_pdf_with(z, x, 1.3)).unwrap();
                let (next, info) = kalman::step(&dynamics, &sensing, &belief, &Vector1::new(z)).unwrap();
                belief = next;
                assert!((evidence - info.log_likelihood).abs() < 1e-11);
                assert!((grid_belief.mean() - belief.mean()[0]).abs() < 1e-11);
                assert!((grid_belief.variance() - belief.covariance()[0]).abs() < 1e-11);
                beliefs.push(belief);
                grid_beliefs.push(grid_belief.clone());
                likelihoods.push(
                    kernel
                        .grid()
                        .nodes()
                        .map(|x| log_pdf_with(z, x, 1.3).exp())
                        .collect::<Vec<_>>(),
                );
            }
            let mut smoothed = beliefs.clone();
            for n in (0..data.len() - 1).rev() {
                smoothed[n] = smoother::smooth_step(&dynamics, &beliefs[n], &smoothed[n + 1]).unwrap();
            }
            for n in 0..data.len() {
                let exact = kernel.smooth(&grid_beliefs[n], &likelihoods[n + 1..]).unwrap();
                assert!((exact.mean() - smoothed[n].mean()[0]).abs() < 1e-11);
                assert!((exact.variance() - smoothed[n].covariance()[0]).abs() < 1e-11);
            }
        }
    }

    /// Only the shapes of likelihoods count, however long the future is.
    #[test]
    fn smoothing_has_no_scale() {
        let kernel =
            TransitionKernel::new(&Ar1::new(0.9, 0.5).unwrap(), UniformGrid::symmetric(12.0, 0.25).unwrap()).unwrap();
        let belief = PointMass::normal(*kernel.grid(), 0.4, 2.0).unwrap();
        let future = |scale: f64| -> Vec<Vec<f64>> {
            (0..200)
                .map(|n| {
                    kernel
                        .grid()
                        .nodes()
                        .map(|x| scale * log_pdf_with((f64::from(n)).sin(), x, 1.3).exp())
                        .collect()
                })
                .collect()
        };
        let plain = kernel.smooth(&belief, &future(1.0)).unwrap();
        for scale in [1e-30, 1e30] {
            let scaled = kernel.smooth(&belief, &future(scale)).unwrap();
            assert!(
                (scaled.mean() - plain.mean()).abs() < 1e-12 && (scaled.variance() - plain.variance()).abs() < 1e-12
            );
        }
    }

    #[test]
    fn refuses_what_a_grid_cannot_resolve() {
        assert!(UniformGrid::new(1.0, 0.0, 0.1).is_err());
        assert!(UniformGrid::new(0.0, 1.0, 1e-9).is_err());
        assert!(UniformGrid::symmetric(f64::NAN, 1.0).is_err());
        // Variances and densities over such nodes must stay finite.
        assert!(UniformGrid::new(0.0, 1e301, 1e300).is_err() && UniformGrid::new(0.0, 1e-310, 5e-324).is_err());
        let grid = UniformGrid::symmetric(5.0, 0.25).unwrap();
        assert_eq!((grid.points(), grid.node(20)), (41, 0.0));
        assert!(TransitionKernel::new(&Ar1::new(0.9, 0.0).unwrap(), grid).is_err());
        let kernel = TransitionKernel::new(&Ar1::new(0.9, 1.0).unwrap(), grid).unwrap();
        let elsewhere = PointMass::normal(UniformGrid::symmetric(6.0, 0.25).unwrap(), 0.0, 1.0).unwrap();
        assert!(kernel.predict(&elsewhere).is_err());
        let here = PointMass::normal(grid, 0.0, 1.0).unwrap();
        assert!(kernel.smooth(&here, &[vec![1.0; 3]]).is_err());
    }
}
