//! The exact filter of a two-dimensional linear state, on a lattice that follows the belief.

use crate::moved::Moved;
use crate::{Error, kalman};
use fewbits_core::{Gaussian, Likelihood, LinearDynamics};
use fewbits_densities::PlaneMass;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::within;
use nalgebra::{Cholesky, Matrix2};

/// Deviations of the process noise beyond which the kernel is left out.
const KERNEL_REACH: f64 = 7.0;
/// Nodes whose density falls below this share of the peak send nothing on.
const NEGLIGIBLE: f64 = 1e-14;

/// The exact filter for `x' = A x + u`, `u ~ N(0, Q)` with positive definite `Q`, observed through any likelihood.
///
/// In coordinates `y = L^-1 x`, `Q = L L'`, the noise is white, so the kernel is a product of two scalar ones and a step costs
/// two short rows a node and their outer product. The lattice is uniform and moves by whole nodes, so the trapezoid rule
/// keeps its spectral accuracy: a spacing of 0.6 is exact to about 1e-9 for beliefs no narrower than the process noise.
///
/// ```
/// use fewbits_core::{Belief, Gaussian};
/// use fewbits_filters::PlaneFilter;
/// use fewbits_models::LinearGaussian;
/// use nalgebra::{Matrix2, Vector2};
/// let dynamics = LinearGaussian::with_covariance(Matrix2::new(0.9, 0.2, 0.0, 0.8), Matrix2::identity() * 0.3)?;
/// let filter = PlaneFilter::new(&dynamics, 0.6)?;
/// let mut belief = filter.predict(&filter.normal(&Gaussian::new(Vector2::zeros(), Matrix2::identity())?)?)?;
/// belief.update_with(|x| -0.5 * (x[0] - 1.0).powi(2))?;
/// assert!(belief.mean()[0] > 0.3 && belief.covariance()[(0, 0)] < 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// Where the noise is singular, or narrower than the lattice, [`PlaneFilter::with_basis`] evaluates the moved density between
/// the nodes instead.
#[derive(Debug, Clone, PartialEq)]
pub struct PlaneFilter<F> {
    dynamics: F,
    basis: Matrix2<f64>,
    kernel: Kernel,
}

#[derive(Debug, Clone, PartialEq)]
enum Kernel {
    /// The basis is `L` times the spacing; `transition` is `L^-1 A L`.
    White {
        transition: Matrix2<f64>,
        spacing: f64,
    },
    Moved(Moved),
}

impl<F: LinearDynamics<2> + Clone> PlaneFilter<F> {
    /// The filter with a lattice of the given spacing in process-noise deviations.
    ///
    /// # Errors
    /// If the spacing is outside `[0.05, 1]` or the process noise not positive definite.
    pub fn new(dynamics: &F, spacing: f64) -> Result<Self, Error> {
        within("spacing", spacing, 0.05, 1.0)?;
        let noise = dynamics.noise_covariance();
        let refuse = || ArgumentError::new("noise_covariance", format!("{noise:?}"), "a positive definite matrix");
        let colour = Cholesky::new(*noise).ok_or_else(refuse)?.l();
        let transition = colour.solve_lower_triangular(&(dynamics.transition() * colour));
        Ok(Self {
            dynamics: dynamics.clone(),
            basis: colour * spacing,
            kernel: Kernel::White {
                transition: transition.ok_or_else(refuse)?,
                spacing,
            },
        })
    }

    /// The filter for any process noise, singular or zero, on a lattice of the given basis (state units). Its steps should be
    /// at most a quarter of the narrowest belief's deviation in any direction: the density is then interpolated to about 1e-7.
    ///
    /// # Errors
    /// If the basis or the transition is singular.
    pub fn with_basis(dynamics: &F, basis: Matrix2<f64>) -> Result<Self, Error> {
        Ok(Self {
            dynamics: dynamics.clone(),
            kernel: Kernel::Moved(Moved::new(dynamics, &basis)?),
            basis,
        })
    }

    /// A normal belief.
    ///
    /// # Errors
    /// If the covariance is not positive definite or a million nodes cannot hold it.
    pub fn normal(&self, belief: &Gaussian<2>) -> Result<PlaneMass, Error> {
        Ok(PlaneMass::normal(&self.basis, belief)?)
    }

    /// Time update.
    ///
    /// # Errors
    /// If the belief stands on another lattice; [`fewbits_core::Error::Impossible`] if it has left the range of numbers.
    pub fn predict(&self, belief: &PlaneMass) -> Result<PlaneMass, Error> {
        if *belief.basis() != self.basis {
            let text = format!("a lattice of basis {:?}", belief.basis());
            return Err(ArgumentError::new("belief", text, "a belief on the filter's lattice").into());
        }
        let peak = belief.density().iter().copied().fold(0.0, f64::max);
        let reached = kalman::predict(&self.dynamics, &belief.moments());
        match &self.kernel {
            Kernel::Moved(moved) => moved.predict(&self.basis, belief, &reached),
            Kernel::White { transition, spacing } => {
                Ok(PlaneMass::covering(&self.basis, &reached, |lattice, density| {
                    let (first, size) = (lattice.first(), lattice.size());
                    let (mut rows, mut columns) = (Vec::new(), Vec::new());
                    for (n, &mass) in belief.nodes().zip(belief.density()) {
                        if mass <= NEGLIGIBLE * peak {
                            continue;
                        }
                        let centre = transition * (n * *spacing);
                        let top = white(*spacing, centre[0], first[0], size[0], &mut rows);
                        let left = white(*spacing, centre[1], first[1], size[1], &mut columns);
                        for (i, row) in rows.iter().enumerate() {
                            let start = (top + i) * size[1] + left;
                            let weight = mass * row;
                            for (p, column) in density[start..start + columns.len()].iter_mut().zip(&columns) {
                                *p += weight * column;
                            }
                        }
                    }
                })?)
            }
        }
    }

    /// One step: [`predict`](Self::predict), then Bayes' rule. Returns the new belief and `ln p(observed | past)`.
    ///
    /// # Errors
    /// As [`predict`](Self::predict) and [`PlaneMass::update`].
    pub fn step(
        &self,
        belief: &PlaneMass,
        observed: &(impl Likelihood<2> + ?Sized),
    ) -> Result<(PlaneMass, f64), Error> {
        let mut next = self.predict(belief)?;
        let log_likelihood = next.update(observed)?;
        Ok((next, log_likelihood))
    }
}

/// Fills `weights` with the white kernel around `centre` along one axis; returns the index of its first node.
fn white(spacing: f64, centre: f64, first: i64, size: usize, weights: &mut Vec<f64>) -> usize {
    let index = |y: f64| y / spacing - first as f64;
    let low = index(centre - KERNEL_REACH).ceil().max(0.0) as usize;
    let high = (index(centre + KERNEL_REACH).floor() + 1.0).max(0.0) as usize;
    weights.clear();
    weights.extend((low..high.min(size)).map(|i| {
        let z = spacing * (first + i as i64) as f64 - centre;
        (-0.5 * z * z).exp()
    }));
    low.min(size)
}

#[cfg(test)]
mod tests {
    use super::PlaneFilter;
    use crate::{Error, kalman};
    use fewbits_core::factor::Value;
    use fewbits_core::{Belief, Gaussian, Observed};
    use fewbits_models::{LinearGaussian, ScalarSensor, constant_velocity_1d};
    use nalgebra::{Matrix2, Vector1, Vector2};

    /// With Gaussian measurements the Kalman filter is exact.
    #[test]
    fn agrees_with_kalman() {
        let q = Matrix2::new(0.3, 0.1, 0.1, 0.2);
        let dynamics = LinearGaussian::with_covariance(Matrix2::new(0.95, 0.25, -0.1, 0.9), q).unwrap();
        let sensor = ScalarSensor::scalar(Vector2::new(1.0, 0.4), 1.0).unwrap();
        let filter = PlaneFilter::new(&dynamics, 0.6).unwrap();
        let mut belief = Gaussian::new(Vector2::new(1.0, -2.0), Matrix2::new(2.0, 0.5, 0.5, 1.0)).unwrap();
        let mut exact = filter.normal(&belief).unwrap();
        for z in [0.5, -1.5, 3.0, 1.0] {
            let (next, info) = kalman::step(&dynamics, &sensor, &belief, &Vector1::new(z)).unwrap();
            belief = next;
            let observed = Observed::new(sensor, Value::scalar(z, 1.0).unwrap());
            let (after, log_likelihood) = filter.step(&exact, &observed).unwrap();
            exact = after;
            assert!((log_likelihood - info.log_likelihood).abs() < 1e-8);
            assert!((Belief::mean(&exact) - belief.mean()).amax() < 1e-8);
            assert!((Belief::covariance(&exact) - belief.covariance()).amax() < 1e-8);
        }
        let before = exact.clone();
        assert_eq!(exact.update_with(|_| f64::NEG_INFINITY).map_err(Error::from), Err(Error::IMPOSSIBLE));
        assert_eq!(exact, before);
    }

    /// Issue: the plane filter refused constant velocity, whose noise has rank one.
    #[test]
    fn rank_one_noise_and_none_agree_with_kalman() {
        for (variance, scale) in [(0.3, 1.0), (0.0, 1.0), (0.02, 1e-3)] {
            let dynamics = constant_velocity_1d(0.8, variance * scale * scale).unwrap();
            let sensor = ScalarSensor::scalar(Vector2::new(1.0, 0.2), 4.0 * scale * scale).unwrap();
            let filter = PlaneFilter::with_basis(&dynamics, Matrix2::new(0.2, 0.0, 0.0, 0.15) * scale).unwrap();
            let covariance = Matrix2::new(2.0, 0.3, 0.3, 1.0) * (scale * scale);
            let mut belief = Gaussian::new(Vector2::new(1.0, -2.0) * scale, covariance).unwrap();
            let mut exact = filter.normal(&belief).unwrap();
            for z in [0.5, -1.5] {
                let (next, info) = kalman::step(&dynamics, &sensor, &belief, &Vector1::new(z * scale)).unwrap();
                belief = next;
                let observed = Observed::new(sensor, Value::scalar(z * scale, 4.0 * scale * scale).unwrap());
                let (after, log_likelihood) = filter.step(&exact, &observed).unwrap();
                exact = after;
                let off = log_likelihood - info.log_likelihood;
                assert!(off.abs() < 1e-6, "{variance}: {off}");
                assert!((Belief::mean(&exact) - belief.mean()).amax() < 1e-6 * scale);
                assert!((Belief::covariance(&exact) - belief.covariance()).amax() < 1e-6 * scale * scale);
            }
        }
        let dynamics = constant_velocity_1d(0.8, 0.0).unwrap();
        assert!(PlaneFilter::with_basis(&dynamics, Matrix2::zeros()).is_err());
        let coarse = PlaneFilter::with_basis(&dynamics, Matrix2::identity() * 2.0).unwrap();
        let narrow = coarse
            .normal(&Gaussian::new(Vector2::new(0.3, 0.7), Matrix2::identity() * 0.2).unwrap())
            .unwrap();
        assert!(coarse.predict(&narrow).is_err(), "a density between the nodes is an error, not a wrong answer");
    }

    #[test]
    fn refuses_singular_noise() {
        assert!(PlaneFilter::new(&constant_velocity_1d(1.0, 1.0).unwrap(), 0.6).is_err());
        let dynamics = LinearGaussian::with_covariance(Matrix2::identity(), Matrix2::identity()).unwrap();
        assert!(PlaneFilter::new(&dynamics, 2.0).is_err());
        let filter = PlaneFilter::new(&dynamics, 0.6).unwrap();
        for bad in [Matrix2::zeros(), Matrix2::identity() * 1e12] {
            let belief = Gaussian::new(Vector2::zeros(), bad).unwrap();
            assert!(filter.normal(&belief).is_err());
        }
    }
}
