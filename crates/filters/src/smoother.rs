//! Rauch-Tung-Striebel smoothing, one backward step at a time. Applied to a whole record it is the fixed-interval smoother, applied to the
//! last few beliefs the fixed-lag smoother.
//!
//! [`smooth`] goes over a whole recording.
//!
//! It needs only the filtered beliefs and the dynamics, so it smooths the output of any filter with Gaussian
//! beliefs, whatever was observed.

mod recorded;

pub use recorded::{Filtered, smooth};

use crate::Error;
use fewbits_core::{Gaussian, GaussianDynamics};
use fewbits_numerics::linalg::{solve_semidefinite, symmetrised};
use nalgebra::SMatrix;

/// One backward step: the smoothed belief at `n`, from the filtered belief at `n` and the smoothed belief at `n + 1`. Exact for linear
/// dynamics; others are linearised at the filtered mean `m`.
///
/// ```text
/// P+ = F P F' + Q
/// C = P F' P+^-1                                    (pseudo-inverse where P+ is singular)
/// mean = m + C (next mean - f(m))                   (f(m) = F m if linear)
/// P = (I - C F) P (I - C F)' + C (next P + Q) C'
/// ```
///
/// # Errors
/// If a covariance is not symmetric positive semidefinite; [`Error::NotANumber`] if a moment of the result is not finite.
pub fn smooth_step<const D: usize>(
    dynamics: &(impl GaussianDynamics<D> + ?Sized),
    filtered: &Gaussian<D>,
    smoothed_next: &Gaussian<D>,
) -> Result<Gaussian<D>, Error> {
    let (mean, covariance) = (filtered.mean(), filtered.covariance());
    let (transition, noise) = (dynamics.jacobian(mean), dynamics.noise_covariance_at(mean));
    let predicted = symmetrised(&(transition * covariance * transition.transpose() + noise));
    let gain = solve_semidefinite(&predicted, &(transition * covariance))?.transpose();
    // A sum of positive semidefinite terms, equal to M + C (next P - P+) C', in which nothing cancels.
    let keep = SMatrix::<f64, D, D>::identity() - gain * transition;
    let future = smoothed_next.covariance() + noise;
    let found = Gaussian::from_trusted_parts(
        mean + gain * (smoothed_next.mean() - dynamics.mean(mean)),
        keep * covariance * keep.transpose() + gain * future * gain.transpose(),
    );
    let what = "a smoothed moment";
    Some(found)
        .filter(Gaussian::is_finite)
        .ok_or(Error::NotANumber { what })
}

#[cfg(test)]
mod tests {
    use super::smooth_step;
    use crate::kalman;
    use fewbits_core::{Dynamics, Gaussian, LinearDynamics, Sensing};
    use fewbits_models::{LinearSensor, constant_velocity_1d};
    use nalgebra::{DMatrix, DVector, SMatrix, Vector2};
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    fn record(known: bool) -> (Vec<Gaussian<2>>, Vec<f64>) {
        let dynamics = constant_velocity_1d(1.0, 0.3).unwrap();
        let sensing = LinearSensor::scalar(Vector2::new(1.0, 0.0), 0.7).unwrap();
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let covariance = if known {
            SMatrix::zeros()
        } else {
            SMatrix::identity() * 2.0
        };
        let mut belief = Gaussian::new(Vector2::new(0.5, -0.5), covariance).unwrap();
        let (mut beliefs, mut data, mut state) = (vec![belief], vec![], Vector2::new(0.5, -0.5));
        for _ in 0..6 {
            state = dynamics.propagate(&mut rng, &state);
            let z = sensing.sample(&mut rng, &state);
            belief = kalman::step(&dynamics, &sensing, &belief, &z).unwrap().0;
            beliefs.push(belief);
            data.push(z[0]);
        }
        (beliefs, data)
    }

    /// The joint Gaussian of all states and measurements, conditioned at once.
    fn joint_posterior(known: bool, data: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let dynamics = constant_velocity_1d(1.0, 0.3).unwrap();
        let n = data.len();
        let f = DMatrix::from_row_slice(2, 2, dynamics.transition().transpose().as_slice());
        let q = DMatrix::from_row_slice(2, 2, dynamics.noise_covariance().as_slice());
        let start = if known { 0.0 } else { 2.0 };
        let mut covariance = DMatrix::zeros(2 * n + 2, 2 * n + 2);
        let mut mean = DVector::zeros(2 * n + 2);
        covariance
            .view_mut((0, 0), (2, 2))
            .copy_from(&(DMatrix::identity(2, 2) * start));
        mean.rows_mut(0, 2).copy_from_slice(&[0.5, -0.5]);
        for k in 1..=n {
            let row = &f * covariance.view((2 * k - 2, 0), (2, 2 * k));
            covariance.view_mut((2 * k, 0), (2, 2 * k)).copy_from(&row);
            covariance.view_mut((0, 2 * k), (2 * k, 2)).copy_from(&row.transpose());
            let own = row.columns(2 * k - 2, 2) * f.transpose() + &q;
            covariance.view_mut((2 * k, 2 * k), (2, 2)).copy_from(&own);
            let next = &f * mean.rows(2 * k - 2, 2);
            mean.rows_mut(2 * k, 2).copy_from(&next);
        }
        let h = DMatrix::from_fn(n, 2 * n + 2, |i, j| f64::from(u8::from(j == 2 * i + 2)));
        let s = &h * &covariance * h.transpose() + DMatrix::identity(n, n) * 0.7;
        let gain = &covariance * h.transpose() * s.try_inverse().unwrap();
        let innovation = DVector::from_row_slice(data) - &h * &mean;
        (&mean + &gain * innovation, &covariance - &gain * &h * &covariance)
    }

    #[test]
    fn smoothing_is_conditioning_on_the_whole_record() {
        for known in [false, true] {
            let (filtered, data) = record(known);
            let dynamics = constant_velocity_1d(1.0, 0.3).unwrap();
            let (mean, covariance) = joint_posterior(known, &data);
            let mut belief = filtered[data.len()];
            for n in (0..=data.len()).rev() {
                if n < data.len() {
                    belief = smooth_step(&dynamics, &filtered[n], &belief).unwrap();
                }
                assert!((belief.mean() - mean.fixed_rows::<2>(2 * n)).amax() < 1e-10);
                assert!((belief.covariance() - covariance.fixed_view::<2, 2>(2 * n, 2 * n)).amax() < 1e-10);
            }
        }
    }

    /// Issue: the gain came from the Cholesky factor of a rounding pivot. A known velocity and an unknown start, without
    /// noise, are one number: the smoothed start is the smoothed end moved back.
    #[test]
    fn a_singular_prediction_is_smoothed_within_its_range() {
        for (step, scale) in [(0.7, 1.0), (0.7, 1e-4), (0.3, 1e4), (1.1, 1e-9)] {
            let still = constant_velocity_1d(step, 0.0).unwrap();
            let direction = Vector2::new(1.0, 0.6);
            let filtered = Gaussian::new(direction * scale, direction * direction.transpose() * scale * scale).unwrap();
            let ahead = still.transition() * direction;
            let next =
                Gaussian::new(ahead * (2.0 * scale), ahead * ahead.transpose() * (0.25 * scale * scale)).unwrap();
            let smoothed = smooth_step(&still, &filtered, &next).unwrap();
            assert!((smoothed.mean() - direction * (2.0 * scale)).amax() < 1e-9 * scale);
            let expected = direction * direction.transpose() * (0.25 * scale * scale);
            assert!((smoothed.covariance() - expected).amax() < 1e-9 * scale * scale);
        }
    }
}
