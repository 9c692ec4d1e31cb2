//! Probability, mean and covariance of a Gaussian inside or outside an ellipsoid.

use super::quadrature::{EllipsoidMoments, Side, log_mass, moments};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::error::all_finite;
use fewbits_numerics::linalg::symmetrised;
use nalgebra::{SMatrix, SVector};

/// Above this probability inside, `1 - P(inside)` has lost too many digits; the mass outside is then integrated directly.
const MOSTLY_INSIDE: f64 = 0.9;

/// Probability and moments of `N(mu, V)` inside and outside an [`Ellipsoid`](super::Ellipsoid), by quadrature instead of sampling.
///
/// In coordinates whitened by `S` and rotated onto the eigenvectors of the whitened `V`, the region is the ball
/// `|q|^2 < eta` and the components `q_j ~ N(b_j, w_j)` are independent.
///
/// Along the leading axis `q_1 = sqrt(eta) sin(theta)`. Given `theta`, the others form the same problem with one dimension less, in a
/// ball of squared radius `eta cos^2(theta)`. The last dimension is an interval of a normal variable, in closed form. `M` dimensions
/// therefore cost at least `24^(M-1)` intervals. Where a component is narrow or far from zero, the axis is divided adaptively. Sums
/// are formed in the log domain.
///
/// Relative error of the probability below 1e-7; error of the moments below 1e-7 of the spread inside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianInEllipsoid<const M: usize> {
    forward: SMatrix<f64, M, M>,
    backward: SMatrix<f64, M, M>,
    variances: SVector<f64, M>,
    threshold: f64,
}

impl<const M: usize> GaussianInEllipsoid<M> {
    /// The region `nu' S^-1 nu < threshold` with `S = L L'`, `L = lower`, and a Gaussian of covariance `V`.
    pub(super) fn new(
        lower: &SMatrix<f64, M, M>,
        threshold: f64,
        covariance: &SMatrix<f64, M, M>,
    ) -> Result<Self, ArgumentError> {
        all_finite("covariance", covariance.as_slice())?;
        let refuse = || ArgumentError::new("covariance", format!("{covariance:?}"), "a positive semidefinite matrix");
        let half = lower.solve_lower_triangular(covariance).ok_or_else(refuse)?;
        let white = lower.solve_lower_triangular(&half.transpose()).ok_or_else(refuse)?;
        let (values, vectors) = symmetric_eigen(symmetrised(&white));
        // Negative eigenvalues up to 1e-9 of the largest are rounding. In whitened coordinates the innovation has variance 1, hence the
        // floor for a `V` of much smaller scale.
        let sound = values.iter().all(|x| x.is_finite()) && values.min() >= -1e-9 * values.amax().max(1e-3);
        if !sound {
            return Err(refuse());
        }
        // The component of largest variance comes first: the quadrature runs over its angle, where the integrand is widest.
        let mut order: [usize; M] = std::array::from_fn(|i| i);
        order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
        let basis = SMatrix::<f64, M, M>::from_fn(|i, j| vectors[(i, order[j])]);
        let whiten = lower
            .solve_lower_triangular(&SMatrix::<f64, M, M>::identity())
            .ok_or_else(refuse)?;
        Ok(Self {
            forward: basis.transpose() * whiten,
            backward: lower * basis,
            variances: SVector::from_fn(|i, _| values[order[i]].max(0.0)),
            threshold,
        })
    }

    /// `ln P(nu inside)` for `nu ~ N(mu, V)`.
    pub fn log_probability(&self, mu: &SVector<f64, M>) -> f64 {
        let b = self.forward * mu;
        if let Some(x) = b.iter().find(|x| !x.is_finite()) {
            return if x.is_nan() { f64::NAN } else { f64::NEG_INFINITY };
        }
        log_mass(Side::Inside, self.variances.as_slice(), b.as_slice(), self.threshold)
    }

    /// Mass, mean and covariance of `nu ~ N(mu, V)` inside; `None` if the mass is zero or `mu` is not finite.
    pub fn moments(&self, mu: &SVector<f64, M>) -> Option<EllipsoidMoments<M>> {
        self.moments_on(Side::Inside, mu)
    }

    /// `ln P(nu outside)`, accurate for tiny probabilities too.
    pub(crate) fn log_probability_outside(&self, mu: &SVector<f64, M>) -> f64 {
        let b = self.forward * mu;
        if let Some(x) = b.iter().find(|x| !x.is_finite()) {
            return if x.is_nan() { f64::NAN } else { 0.0 };
        }
        let inside = log_mass(Side::Inside, self.variances.as_slice(), b.as_slice(), self.threshold);
        if inside < MOSTLY_INSIDE.ln() {
            return (-inside.exp()).ln_1p();
        }
        log_mass(Side::Outside, self.variances.as_slice(), b.as_slice(), self.threshold)
    }

    /// Mass, mean and covariance of `nu ~ N(mu, V)` outside; `None` if the mass is zero or `mu` is not finite.
    pub(crate) fn moments_outside(&self, mu: &SVector<f64, M>) -> Option<EllipsoidMoments<M>> {
        self.moments_on(Side::Outside, mu)
    }

    fn moments_on(&self, side: Side, mu: &SVector<f64, M>) -> Option<EllipsoidMoments<M>> {
        let b = Some(self.forward * mu).filter(|b| b.iter().all(|x| x.is_finite()))?;
        let white = moments(side, self.variances.as_slice(), &b, 0, self.threshold);
        // From whitened coordinates back to those of the innovation.
        white.log_mass.is_finite().then(|| EllipsoidMoments {
            log_mass: white.log_mass,
            mean: self.backward * white.mean,
            covariance: symmetrised(&(self.backward * white.covariance * self.backward.transpose())),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::Ellipsoid;
    use fewbits_numerics::eigen::symmetric_eigen;
    use fewbits_numerics::normal::log_interval;
    use nalgebra::{Matrix1, Matrix2, Matrix3, SMatrix, SVector, Vector1, Vector2, Vector3};
    use statrs::function::gamma::gamma_lr;

    fn diagonal<const M: usize>(w: [f64; M]) -> SMatrix<f64, M, M> {
        SMatrix::from_diagonal(&SVector::from(w))
    }

    /// `P(sum lambda_j y_j^2 < eta)`, `y_j ~ N(b_j, 1)`, by Ruben's series of central chi-square probabilities.
    fn ruben<const M: usize>(lambda: [f64; M], b: [f64; M], eta: f64) -> f64 {
        let beta = 0.97 * lambda.iter().copied().fold(f64::INFINITY, f64::min);
        let ratio: Vec<f64> = lambda.iter().map(|l| beta / l).collect();
        let norm: f64 = b.iter().map(|b| b * b).sum();
        let mut c = vec![(-0.5 * norm).exp() * ratio.iter().product::<f64>().sqrt()];
        let g = |k: usize| -> f64 {
            (0..M)
                .map(|j| {
                    let left = 1.0 - ratio[j];
                    left.powi(k as i32) + k as f64 * b[j] * b[j] * ratio[j] * left.powi(k as i32 - 1)
                })
                .sum()
        };
        let gs: Vec<f64> = (0..2000).map(|k| if k == 0 { 0.0 } else { g(k) }).collect();
        for k in 1..2000 {
            let next = (0..k).map(|r| gs[k - r] * c[r]).sum::<f64>() / (2.0 * k as f64);
            c.push(next);
        }
        (0..2000)
            .map(|k| c[k] * gamma_lr(0.5 * M as f64 + k as f64, 0.5 * eta / beta))
            .sum()
    }

    #[test]
    fn two_and_three_dimensions_agree_with_rubens_series() {
        for (lambda, b, eta) in [
            ([0.6, 0.5], [0.5, -1.0], 1.386),
            ([0.99, 0.3], [2.0, 1.0], 2.77),
            ([1.0, 0.2], [-4.0, 3.0], 0.3),
            ([0.05, 0.02], [5.0, 1.0], 1.0),
        ] {
            let inside = Ellipsoid::new(&Matrix2::identity(), eta)
                .unwrap()
                .under(&diagonal(lambda))
                .unwrap();
            let mu = Vector2::new(b[0] * lambda[0].sqrt(), b[1] * lambda[1].sqrt());
            let (ours, series) = (inside.log_probability(&mu).exp(), ruben(lambda, b, eta));
            assert!((ours / series - 1.0).abs() < 1e-7, "{lambda:?} {b:?}: {ours} {series}");
        }
        for (lambda, b) in [
            ([0.9, 0.6, 0.3], [0.3, -1.0, 2.0]),
            ([0.5, 0.5, 0.5], [0.0, 0.0, 0.0]),
            ([0.8, 0.1, 0.04], [1.0, -2.0, 0.5]),
        ] {
            let inside = Ellipsoid::new(&Matrix3::identity(), 1.7)
                .unwrap()
                .under(&diagonal(lambda))
                .unwrap();
            let mu = Vector3::from_fn(|j, _| b[j] * lambda[j].sqrt());
            let (ours, series) = (inside.log_probability(&mu).exp(), ruben(lambda, b, 1.7));
            assert!((ours / series - 1.0).abs() < 1e-6, "{lambda:?} {b:?}: {ours} {series}");
        }
    }

    #[test]
    fn one_dimension_is_the_scalar_factor() {
        let inside = Ellipsoid::new(&Matrix1::new(3.0), 0.5)
            .unwrap()
            .under(&Matrix1::new(1.3))
            .unwrap();
        let scalar =
            |mu: f64| log_interval((-1.5_f64.sqrt() - mu) / 1.3_f64.sqrt(), (1.5_f64.sqrt() - mu) / 1.3_f64.sqrt());
        for mu in [0.0, 0.7, -3.0, 40.0, 1e5] {
            let (a, b) = (inside.log_probability(&Vector1::new(mu)), scalar(mu));
            assert!((a - b).abs() <= 1e-12 * b.abs().max(1.0), "{mu}: {a} {b}");
        }
    }

    #[test]
    fn moments_are_derivatives_of_the_mass() {
        // d ln P / d mu = V^-1 (E nu - mu), in three dimensions too.
        let v = Matrix3::new(1.0, 0.3, 0.1, 0.3, 0.8, -0.2, 0.1, -0.2, 0.5);
        let inside = Ellipsoid::new(&Matrix3::identity(), 2.0).unwrap().under(&v).unwrap();
        let mu = Vector3::new(0.8, -0.5, 1.1);
        let mean = inside.moments(&mu).unwrap().mean;
        let slope = Vector3::from_fn(|i, _| {
            let step = Vector3::from_fn(|j, _| if i == j { 1e-4 } else { 0.0 });
            (inside.log_probability(&(mu + step)) - inside.log_probability(&(mu - step))) / 2e-4
        });
        assert!((v * slope + mu - mean).amax() < 1e-7);
    }

    #[test]
    fn singular_covariances_reduce_the_dimension() {
        let region = Ellipsoid::new(&Matrix2::identity(), 2.0).unwrap();
        let line = region.under(&Matrix2::new(0.7, 0.0, 0.0, 0.0)).unwrap();
        let scalar = log_interval(-1.4 / 0.7_f64.sqrt(), 0.6 / 0.7_f64.sqrt());
        let mu = Vector2::new(0.4, 1.0);
        assert!((line.log_probability(&mu) - scalar).abs() < 1e-12);
        let moments = line.moments(&mu).unwrap();
        assert!((moments.mean[1] - 1.0).abs() < 1e-12 && moments.covariance[(1, 1)].abs() < 1e-12);
        // Nearly singular is nearly the same.
        let thin = region.under(&Matrix2::new(0.7, 0.0, 0.0, 1e-10)).unwrap();
        assert!((thin.log_probability(&mu) - line.log_probability(&mu)).abs() < 1e-4);
        assert_eq!(line.log_probability(&Vector2::new(0.0, 2.0)), f64::NEG_INFINITY);
        assert!(line.moments(&Vector2::new(0.0, 2.0)).is_none());
        let point = region.under(&Matrix2::zeros()).unwrap();
        assert_eq!(point.log_probability(&Vector2::new(1.0, 0.9)), 0.0);
        let moments = point.moments(&Vector2::new(1.0, 0.9)).unwrap();
        assert!(moments.log_mass == 0.0 && (moments.mean - Vector2::new(1.0, 0.9)).amax() < 1e-15);
        assert!(moments.covariance.amax() == 0.0 && point.moments(&Vector2::new(1.0, 1.1)).is_none());
    }

    #[test]
    fn far_means_and_tight_noise_stay_finite_and_monotone() {
        for w in [[0.6, 0.5], [1e-4, 1e-6], [0.9, 1e-3], [50.0, 0.1]] {
            let inside = Ellipsoid::new(&Matrix2::identity(), 1.386)
                .unwrap()
                .under(&diagonal(w))
                .unwrap();
            let mut before = f64::INFINITY;
            for distance in [0.0, 0.5, 1.0, 3.0, 10.0, 100.0, 1e4, 1e6] {
                let mu = Vector2::new(0.6, 0.8) * distance;
                let value = inside.log_probability(&mu);
                assert!(value.is_finite() && value < before + 1e-9, "{w:?} at {distance}: {value} after {before}");
                let moments = inside.moments(&mu).unwrap();
                assert!((moments.log_mass - value).abs() < 1e-6 * value.abs().max(1.0));
                assert!(moments.mean.norm_squared() < 1.386 * (1.0 + 1e-9), "{w:?} at {distance}");
                before = value;
            }
        }
    }

    #[test]
    fn a_circular_far_tail_is_exact() {
        // Equal variances: the noncentral chi-square distribution; one line through the mean gives its logarithm by hand.
        let inside = Ellipsoid::new(&Matrix2::identity(), 4.0)
            .unwrap()
            .under(&Matrix2::identity())
            .unwrap();
        let far = inside.log_probability(&Vector2::new(30.0, 0.0));
        // Rotating the mean must not matter although the quadrature's axes stay.
        for angle in [0.3_f64, 1.0, 1.5] {
            let turned = inside.log_probability(&Vector2::new(30.0 * angle.cos(), 30.0 * angle.sin()));
            assert!((turned - far).abs() < 1e-8 * far.abs(), "{angle}: {turned} {far}");
        }
    }

    /// Mass, and moments of the second component, by a fine midpoint rule over it; the first is an interval.
    fn brute(w: [f64; 2], mu: &Vector2<f64>, eta: f64) -> [f64; 3] {
        let (n, [first_sd, sd]) = (400_000, w.map(f64::sqrt));
        let low = (mu[1] - 12.0 * sd).max(-eta.sqrt());
        let width = (mu[1] + 12.0 * sd).min(eta.sqrt()) - low;
        let sums = (0..n).fold([0.0; 3], |sums, i| {
            let q = low + width * (i as f64 + 0.5) / f64::from(n);
            let half = (eta - q * q).max(0.0).sqrt();
            let p = log_interval((-half - mu[0]) / first_sd, (half - mu[0]) / first_sd)
                + fewbits_numerics::normal::log_pdf_with(q, mu[1], w[1]);
            [sums[0] + p.exp(), sums[1] + p.exp() * q, sums[2] + p.exp() * q * q]
        });
        let mean = sums[1] / sums[0];
        [
            (sums[0] * width / f64::from(n)).ln(),
            mean,
            sums[2] / sums[0] - mean * mean,
        ]
    }

    #[test]
    fn unequal_variances_are_integrated_where_the_mass_is() {
        let known = Vector2::new(-0.238_808_235, 1.559_333_679);
        for (w, mu, eta) in [
            ([9.554_230_403, 1.504_956e-4], known, 10.581_024_593),
            ([4.0, 0.01], Vector2::new(0.3, 0.2), 9.0),
            ([0.02, 0.011], Vector2::new(-0.4, 0.7), 9.0),
            ([1.2, 0.7], Vector2::new(0.4, -1.1), 2.3),
            ([0.05, 0.04], Vector2::new(0.9, 0.7), 1.8),
            ([30.0, 2.0], Vector2::new(4.0, -3.0), 1.5),
            ([0.3, 0.02], Vector2::new(2.5, 1.1), 1.386),
            ([7.0, 6.0], Vector2::new(-1.0, 2.0), 60.0),
        ] {
            let inside = Ellipsoid::new(&Matrix2::identity(), eta)
                .unwrap()
                .under(&diagonal(w))
                .unwrap();
            let (moments, [log_mass, mean, variance]) = (inside.moments(&mu).unwrap(), brute(w, &mu, eta));
            assert!((inside.log_probability(&mu) - log_mass).abs() < 1e-7, "{w:?}: {log_mass}");
            assert!((moments.log_mass - log_mass).abs() < 1e-8, "{w:?}: {log_mass}");
            assert!((moments.mean[1] - mean).abs() < 1e-7 * variance.sqrt(), "{w:?}: {mean}");
            assert!((moments.covariance[(1, 1)] / variance - 1.0).abs() < 1e-6, "{w:?}: {variance}");
        }
        // By 40-digit quadrature.
        let region = Ellipsoid::new(&Matrix2::identity(), 10.581_024_593).unwrap();
        let inside = region.under(&diagonal([9.554_230_403, 1.504_956e-4])).unwrap();
        assert!((inside.log_probability(&known) + 0.441_849_5).abs() < 1e-7);
    }

    #[test]
    fn eigenvectors_are_orthonormal_and_put_the_matrix_together() {
        let a = Matrix3::new(2.0, 0.7, -1.1, 0.7, 1.3, 0.4, -1.1, 0.4, 3.1);
        for scale in [1e-150, 1.0, 1e150] {
            let (values, vectors) = symmetric_eigen(a * scale);
            assert!((vectors.transpose() * vectors - Matrix3::identity()).amax() < 1e-14);
            let again = vectors * Matrix3::from_diagonal(&(values / scale)) * vectors.transpose();
            assert!((again - a).amax() < 1e-14, "{again}");
        }
    }

    #[test]
    fn volumes_are_those_of_the_textbook() {
        let pi = std::f64::consts::PI;
        let volume = |m: f64| m.ln();
        assert!((Ellipsoid::new(&Matrix1::new(9.0), 4.0).unwrap().log_volume() - volume(12.0)).abs() < 1e-14);
        assert!(
            (Ellipsoid::new(&Matrix2::new(4.0, 0.0, 0.0, 1.0), 1.0)
                .unwrap()
                .log_volume()
                - volume(2.0 * pi))
            .abs()
                < 1e-14
        );
        assert!(
            (Ellipsoid::new(&Matrix3::identity(), 4.0).unwrap().log_volume() - volume(32.0 * pi / 3.0)).abs() < 1e-14
        );
    }

    #[test]
    fn bad_matrices_are_refused() {
        assert!(Ellipsoid::new(&Matrix2::new(1.0, 2.0, 2.0, 1.0), 1.0).is_err());
        assert!(Ellipsoid::new(&Matrix2::identity(), -1.0).is_err());
        assert!(Ellipsoid::new(&Matrix2::new(f64::NAN, 0.0, 0.0, 1.0), 1.0).is_err());
        let region = Ellipsoid::new(&Matrix2::identity(), 1.0).unwrap();
        assert!(region.under(&Matrix2::new(1.0, 0.0, 0.0, -1.0)).is_err());
    }
}
