//! The Kalman filter.

use crate::Error;
pub use fewbits_core::value_update::KalmanInfo;
use fewbits_core::{Gaussian, LinearDynamics, LinearSensing, value_update};
use fewbits_numerics::linalg::congruence;
use nalgebra::SVector;

/// Time update: mean `F m`, covariance `F P F' + Q`.
#[inline]
pub fn predict<const D: usize>(dynamics: &impl LinearDynamics<D>, belief: &Gaussian<D>) -> Gaussian<D> {
    let transition = dynamics.transition();
    let covariance = congruence(transition, belief.covariance()) + dynamics.noise_covariance();
    Gaussian::from_symmetric_parts(transition * belief.mean(), covariance)
}

/// Measurement update in Joseph form, which keeps the covariance positive semidefinite under rounding.
///
/// ```text
/// innovation = z - H mean
/// S = H P H' + R
/// K = P H' S^-1                      (Cholesky of S)
/// mean = mean + K innovation
/// P = (I - K H) P (I - K H)' + K R K'         (P - K S K' where that cannot cancel)
/// log_likelihood = ln N(innovation; 0, S)
/// ```
///
/// # Errors
/// If the measurement is not finite; [`Error::SingularInnovation`]; [`Error::NotANumber`] if a number of the belief or the
/// model overflows or is NaN.
pub fn update<const D: usize, const M: usize>(
    sensing: &impl LinearSensing<D, M>,
    belief: &Gaussian<D>,
    measurement: &SVector<f64, M>,
) -> Result<(Gaussian<D>, KalmanInfo<D, M>), Error> {
    let matrix = sensing.matrix();
    let innovation = measurement - matrix * belief.mean();
    value_update::update(matrix, sensing.noise_covariance(), belief, measurement, innovation)
}

/// One step of the Kalman filter: [`predict`], then [`update`].
///
/// # Errors
/// As [`update`].
pub fn step<const D: usize, const M: usize>(
    dynamics: &impl LinearDynamics<D>,
    sensing: &impl LinearSensing<D, M>,
    belief: &Gaussian<D>,
    measurement: &SVector<f64, M>,
) -> Result<(Gaussian<D>, KalmanInfo<D, M>), Error> {
    update(sensing, &predict(dynamics, belief), measurement)
}

#[cfg(test)]
mod tests {
    use super::{predict, step, update};
    use crate::Error;
    use crate::assumed_density;
    use fewbits_core::Gaussian;
    use fewbits_core::factor::Value;
    use fewbits_models::{LinearSensor, constant_velocity_1d};
    use nalgebra::{Matrix2, Matrix2x4, Matrix3, Matrix3x2, SMatrix, SVector, Vector2, Vector3};

    /// The posterior of a linear-Gaussian problem in information form, an independent formula.
    #[test]
    fn update_is_the_information_form() {
        let prior = Gaussian::new(Vector2::new(1.0, -1.0), Matrix2::new(2.0, 0.3, 0.3, 1.0)).unwrap();
        let h = Matrix3x2::new(1.0, 0.0, 0.5, 2.0, -1.0, 1.0);
        let r = Matrix3::new(1.0, 0.2, 0.0, 0.2, 0.5, 0.1, 0.0, 0.1, 2.0);
        let z = Vector3::new(0.4, -2.0, 1.0);
        let (posterior, info) = update(&LinearSensor::new(h, r).unwrap(), &prior, &z).unwrap();
        let prior_information = prior.covariance().try_inverse().unwrap();
        let noise_information = r.try_inverse().unwrap();
        let covariance = (prior_information + h.transpose() * noise_information * h)
            .try_inverse()
            .unwrap();
        let mean = covariance * (prior_information * prior.mean() + h.transpose() * noise_information * z);
        assert!((posterior.covariance() - covariance).amax() < 1e-13);
        assert!((posterior.mean() - mean).amax() < 1e-13);
        let predicted = Gaussian::new(h * prior.mean(), info.innovation_covariance).unwrap();
        assert!((info.log_likelihood - predicted.log_pdf(&z).unwrap()).abs() < 1e-12);
    }

    /// A constant measured again and again: the variance is that of all measurements at once, whichever form was used.
    #[test]
    fn ten_thousand_measurements_of_a_constant_leave_the_exact_variance() {
        for (start, noise) in [(1.0, 1.0), (1e8, 1.0), (1.0, 1e6), (1e-9, 1e3)] {
            let sensor = LinearSensor::new(Matrix2::identity(), Matrix2::identity() * noise).unwrap();
            let mut belief = Gaussian::new(Vector2::zeros(), Matrix2::new(1.0, 0.5, 0.5, 1.0) * start).unwrap();
            let prior = belief.covariance().try_inverse().unwrap();
            for n in 1..=10_000 {
                belief = update(&sensor, &belief, &Vector2::new(1.0, -1.0)).unwrap().0;
                if n % 2500 == 1 {
                    let exact = (prior + Matrix2::identity() * (f64::from(n) / noise))
                        .try_inverse()
                        .unwrap();
                    let off = (belief.covariance() - exact).amax() / exact.amax();
                    assert!(off < 1e-9, "{off} after {n} from {start} with noise {noise}");
                }
            }
        }
    }

    /// What one or two measurements leave, either side of where the short form ends, against the information form.
    #[test]
    fn the_short_form_is_the_long_one() {
        let h = Matrix2x4::new(1.0, 0.0, 0.3, 0.0, 0.0, 1.0, 0.0, -0.2);
        let l = SMatrix::<f64, 4, 4>::from_fn(|i, j| {
            if i >= j {
                1.0 / (1.0 + i as f64 + 2.0 * j as f64)
            } else {
                0.0
            }
        });
        let prior = Gaussian::new(SVector::zeros(), l * l.transpose()).unwrap();
        for noise in [100.0, 1.0, 0.1, 0.03, 0.01, 1e-4] {
            let r = Matrix2::new(1.0, 0.4, 0.4, 0.7) * noise;
            let own = update(&LinearSensor::new(h, r).unwrap(), &prior, &Vector2::zeros())
                .unwrap()
                .0;
            let information = prior.covariance().try_inverse().unwrap() + h.transpose() * r.try_inverse().unwrap() * h;
            let exact = information.try_inverse().unwrap();
            assert!((own.covariance() - exact).amax() < 1e-11 * exact.amax(), "noise {noise}");
            assert_eq!(own.covariance(), &own.covariance().transpose());
        }
    }

    /// The Kalman filter is the assumed-density update with a value, at every scale.
    /// Measurements that say nearly all leave their own covariance, less its share of what was known.
    #[test]
    fn fine_measurements_keep_their_digits() {
        let shape = Matrix2::new(1.0, 0.3, 0.3, 2.0);
        let prior = Gaussian::new(Vector2::new(1.0, -1.0), Matrix2::new(2.0, 0.3, 0.3, 1.0)).unwrap();
        for noise in [1e-4, 1e-8, 1e-11] {
            let sensor = LinearSensor::new(Matrix2::identity(), shape * noise).unwrap();
            let after = update(&sensor, &prior, &Vector2::new(0.3, 0.2)).unwrap().0;
            // R - R (P + R)^-1 R, where nothing cancels.
            let share = (prior.covariance() + shape * noise).try_inverse().unwrap() * shape * noise;
            let off = after.covariance() / noise - shape * (Matrix2::identity() - share);
            assert!(off.amax() < 1e-9, "{noise}: {off}");
        }
    }

    #[test]
    fn it_is_the_assumed_density_update_with_a_value() {
        for scale in [1e-4, 1.0, 1e4] {
            let covariance = Matrix3::new(2.0, 0.3, 0.1, 0.3, 1.0, -0.2, 0.1, -0.2, 0.5) * (scale * scale);
            let prior = Gaussian::new(Vector3::new(1.0, -1.0, 0.5) * scale, covariance).unwrap();
            let h = Matrix3x2::new(1.0, 0.0, 0.5, 2.0, -1.0, 1.0).transpose();
            let r = Matrix2::new(1.0, 0.2, 0.2, 0.5) * (scale * scale);
            let z = Vector2::new(0.4, -2.0) * scale;
            let (own, info) = update(&LinearSensor::new(h, r).unwrap(), &prior, &z).unwrap();
            let (general, other) = assumed_density::update(&prior, &h, &Value::new(z, r).unwrap()).unwrap();
            assert!((own.mean() - general.mean()).amax() < 1e-13 * scale);
            assert!((own.covariance() - general.covariance()).amax() < 1e-13 * scale * scale);
            assert!((info.log_likelihood - other.log_likelihood).abs() < 1e-12);
        }
    }

    #[test]
    fn a_known_start_stays_semidefinite() {
        let dynamics = constant_velocity_1d(1.0, 0.1).unwrap();
        let sensing = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
        let mut belief = Gaussian::known(Vector2::new(0.0, 1.0)).unwrap();
        assert_eq!(*predict(&dynamics, &belief).mean(), Vector2::new(1.0, 1.0));
        for n in 0..200 {
            belief = step(&dynamics, &sensing, &belief, &SVector::from([f64::from(n)]))
                .unwrap()
                .0;
            assert!(Gaussian::new(*belief.mean(), *belief.covariance()).is_ok());
        }
    }

    /// Defect: a variance of 1e300 seen through 1e10 gave a belief of NaN.
    #[test]
    fn overflow_is_an_error_and_no_belief() {
        let sensing = LinearSensor::scalar(SVector::<f64, 1>::new(1e10), 1.0).unwrap();
        let wide = Gaussian::scalar(0.0, 1e300).unwrap();
        let no_number = |error: Error| matches!(error, Error::NotANumber { .. });
        assert!(no_number(update(&sensing, &wide, &SVector::from([1.0])).unwrap_err()));
        let far = Gaussian::scalar(1e300, 1.0).unwrap();
        assert!(no_number(update(&sensing, &far, &SVector::from([1.0])).unwrap_err()));
        let value = Value::scalar(1.0, 1.0).unwrap();
        assert!(no_number(assumed_density::update(&wide, &SMatrix::<f64, 1, 1>::new(1e10), &value).unwrap_err()));
    }

    #[test]
    fn refuses_what_is_no_number() {
        let sensing = LinearSensor::scalar(Vector2::new(1.0, 0.0), 1.0).unwrap();
        let belief = Gaussian::known(Vector2::zeros()).unwrap();
        let nothing = update(&sensing, &belief, &SVector::from([f64::NAN]));
        assert!(matches!(nothing, Err(Error::Argument(_))));
        let bad = Gaussian::from_trusted_parts(Vector2::zeros(), -SMatrix::identity() * 3.0);
        assert_eq!(update(&sensing, &bad, &SVector::from([1.0])), Err(Error::SingularInnovation));
    }
}
