//! The Kalman filter of signs by Bussgang's decomposition.

use fewbits_core::{Error, Gaussian};
use fewbits_numerics::factored::Factored;
use fewbits_numerics::linalg::{congruence, solve_semidefinite, symmetrised, times_transposed};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::FRAC_2_PI;

/// Update of a belief by the signs of `M` innovations, each sensor's threshold being its predicted measurement: the linear estimator of
/// least mean squared error.
///
/// ```text
/// S = H P H' + R;  d = diag(S)^(-1/2)
/// signs = B (z - H mean) + distortion,  B = sqrt(2/pi) d           (Bussgang 1952)
/// C = 2/pi asin(d S d)                                            (covariance of the signs, Van Vleck's arcsine law)
/// K = P H' B C^-1;  mean += K signs;  P -= K B H P
/// ```
/// The filter of Jung, Ha, Kim and Park (arXiv:2507.17284, "Bussgang-aided Kalman filter") is built on this decomposition. Only their abstract
/// was at hand; the equations above follow from the decomposition.
///
/// # Errors
/// If `R` is not positive definite, or a number is not finite.
pub fn update<const D: usize, const M: usize>(
    belief: &Gaussian<D>,
    matrix: &SMatrix<f64, M, D>,
    noise: &SMatrix<f64, M, M>,
    signs: &SVector<f64, M>,
) -> Result<Gaussian<D>, Error> {
    let spread = symmetrised(&(congruence(matrix, belief.covariance()) + noise));
    Factored::new("innovation_covariance", &spread)?;
    let roots = spread.diagonal().map(f64::sqrt);
    let of_signs = SMatrix::<f64, M, M>::from_fn(|i, j| {
        let correlation = spread[(i, j)] / (roots[i] * roots[j]);
        FRAC_2_PI * correlation.clamp(-1.0, 1.0).asin()
    });
    let mut cross = times_transposed(belief.covariance(), matrix);
    for (j, root) in roots.iter().enumerate() {
        cross.column_mut(j).scale_mut(FRAC_2_PI.sqrt() / root);
    }
    let gain = solve_semidefinite(&of_signs, &cross.transpose())?.transpose();
    let covariance = belief.covariance() - gain * cross.transpose();
    Ok(Gaussian::new(belief.mean() + gain * signs, covariance)?)
}

#[cfg(test)]
mod tests {
    use super::update;
    use fewbits_core::factor::Levels;
    use fewbits_core::{Gaussian, Link, Sign, assumed_density};
    use nalgebra::{Matrix1, Matrix2, RowVector2, Vector1, Vector2};

    fn prior() -> Gaussian<2> {
        Gaussian::new(Vector2::new(0.3, -1.0), Matrix2::new(2.0, 0.4, 0.4, 0.5)).unwrap()
    }

    /// One sign at the prediction: the linear estimator is the exact one, which is Dymbo's.
    #[test]
    fn one_sign_is_the_exact_update() {
        let row = RowVector2::new(1.0, 0.5);
        for sign in [Sign::Above, Sign::Below] {
            let found = update(&prior(), &row, &Matrix1::new(0.7), &Vector1::new(sign.value())).unwrap();
            let at = (row * prior().mean())[0];
            let factor = Levels::sign(sign, at, 0.7, &Link::default()).unwrap();
            let (exact, _) = assumed_density::update(&prior(), &row, &factor).unwrap();
            assert!((found.mean() - exact.mean()).amax() < 1e-12);
            assert!((found.covariance() - exact.covariance()).amax() < 1e-12);
        }
    }

    /// Two signs: the error of the linear estimator of least mean squared error is orthogonal to them (sums over a grid of both
    /// innovations).
    #[test]
    fn two_signs_have_the_linear_estimators_error() {
        let (matrix, noise) = (Matrix2::new(1.0, 0.5, -0.2, 1.0), Matrix2::new(0.3, 0.1, 0.1, 0.6));
        let spread = matrix * prior().covariance() * matrix.transpose() + noise;
        let law = Gaussian::new(Vector2::zeros(), spread).unwrap().factored().unwrap();
        let regression = prior().covariance() * matrix.transpose() * spread.try_inverse().unwrap();
        let mut orthogonal = Matrix2::zeros();
        let step = 0.05;
        for i in -240..240 {
            for j in -240..240 {
                let v = Vector2::new((f64::from(i) + 0.5) * step, (f64::from(j) + 0.5) * step);
                let weight = law.log_pdf(&v).exp() * step * step;
                let signs = v.map(f64::signum);
                let after = update(&prior(), &matrix, &noise, &signs).unwrap();
                let error = regression * v - (after.mean() - prior().mean());
                orthogonal += error * signs.transpose() * weight;
                if (i, j) == (0, 0) {
                    let residual = prior().covariance() - after.covariance();
                    assert!(residual.symmetric_eigenvalues().min() > 0.0);
                }
            }
        }
        assert!(orthogonal.amax() < 1e-3, "{orthogonal}");
    }
}
