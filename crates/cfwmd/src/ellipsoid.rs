//! What the silence of a vector sensor says: a Gaussian inside an ellipsoid.

use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, non_negative};
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::normal;
use fewbits_numerics::quadrature::gauss_legendre;
use nalgebra::{Cholesky, Const, SMatrix, SVector};
use std::f64::consts::FRAC_PI_2;

/// The region of silence `nu^T S^-1 nu < eta` of an innovation of `M` components.
#[derive(Debug, Clone)]
pub struct Ellipsoid<const M: usize> {
    factor: Cholesky<f64, Const<M>>,
    threshold: f64,
}

impl<const M: usize> Ellipsoid<M> {
    /// The region for innovation covariance `S` (positive definite) and threshold `eta >= 0`.
    ///
    /// # Errors
    /// Entries that are not finite, `S` not positive definite, a negative threshold.
    pub fn new(innovation_covariance: &SMatrix<f64, M, M>, threshold: f64) -> Result<Self, ArgumentError> {
        all_finite("innovation_covariance", innovation_covariance.as_slice())?;
        let factor = Cholesky::new(*innovation_covariance).ok_or_else(|| {
            ArgumentError::new(
                "innovation_covariance",
                format!("{innovation_covariance:?}"),
                "a positive definite matrix",
            )
        })?;
        Ok(Self {
            factor,
            threshold: non_negative("threshold", threshold)?,
        })
    }

    /// `eta`.
    pub fn threshold(&self) -> f64 {
        self.threshold
    }

    /// `nu^T S^-1 nu`, the normalised innovation squared.
    #[inline]
    pub fn statistic(&self, innovation: &SVector<f64, M>) -> f64 {
        match self.factor.l_dirty().solve_lower_triangular(innovation) {
            Some(white) => white.norm_squared(),
            None => f64::INFINITY,
        }
    }

    /// A point of the ellipsoid from one of the unit ball.
    pub fn from_ball(&self, point: &SVector<f64, M>) -> SVector<f64, M> {
        self.factor.l() * point * self.threshold.sqrt()
    }

    /// Logarithm of the ellipsoid's volume divided by that of the unit ball.
    pub fn log_scale(&self) -> f64 {
        let log_determinant: f64 = self.factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        log_determinant + 0.5 * M as f64 * self.threshold.ln()
    }

    /// Prepares probabilities and moments of `N(mu, V)` inside the region, for any `mu`. `V` may be singular.
    ///
    /// In coordinates whitened by `S` and rotated onto the eigenvectors of the whitened `V`, the region is the ball
    /// `|q|^2 < eta` and the components `q_j ~ N(b_j, w_j)` are independent.
    ///
    /// # Errors
    /// Entries of `V` that are not finite, a negative eigenvalue beyond rounding.
    pub fn under(&self, covariance: &SMatrix<f64, M, M>) -> Result<GaussianInEllipsoid<M>, ArgumentError> {
        all_finite("covariance", covariance.as_slice())?;
        let lower = self.factor.l();
        let refuse = || ArgumentError::new("covariance", format!("{covariance:?}"), "a positive semidefinite matrix");
        let half = lower.solve_lower_triangular(covariance).ok_or_else(refuse)?;
        let white = lower.solve_lower_triangular(&half.transpose()).ok_or_else(refuse)?;
        let (values, vectors) = symmetric_eigen(symmetrised(&white));
        // In whitened coordinates 1 is the scale of the innovation itself.
        if values.min() < -1e-9 * values.amax().max(1e-3) {
            return Err(refuse());
        }
        let mut order: [usize; M] = std::array::from_fn(|i| i);
        order.sort_by(|a, b| values[*b].total_cmp(&values[*a]));
        let basis = SMatrix::<f64, M, M>::from_fn(|i, j| vectors[(i, order[j])]);
        let forward = basis.transpose()
            * lower
                .solve_lower_triangular(&SMatrix::<f64, M, M>::identity())
                .ok_or_else(refuse)?;
        Ok(GaussianInEllipsoid {
            forward,
            backward: lower * basis,
            variances: SVector::from_fn(|i, _| values[order[i]].max(0.0)),
            threshold: self.threshold,
        })
    }
}

/// Eigenvalues and eigenvectors (columns) of a symmetric matrix by Jacobi rotations: for the two or three dimensions of a
/// measurement as fast as anything, exact in small eigenvalues, and free of the dimension arithmetic that nalgebra's own
/// solver would impose on every caller.
pub(crate) fn symmetric_eigen<const M: usize>(mut a: SMatrix<f64, M, M>) -> (SVector<f64, M>, SMatrix<f64, M, M>) {
    let mut vectors = SMatrix::<f64, M, M>::identity();
    for _sweep in 0..32 {
        let mut off = 0.0;
        for p in 0..M {
            for q in p + 1..M {
                let entry = a[(p, q)];
                off += entry * entry;
                if entry == 0.0 {
                    continue;
                }
                let half = (a[(q, q)] - a[(p, p)]) / (2.0 * entry);
                let tangent = half.signum() / (half.abs() + half.hypot(1.0));
                let cosine = 1.0 / tangent.hypot(1.0);
                let mut turn = SMatrix::<f64, M, M>::identity();
                turn[(p, p)] = cosine;
                turn[(q, q)] = cosine;
                turn[(p, q)] = tangent * cosine;
                turn[(q, p)] = -tangent * cosine;
                a = turn.transpose() * a * turn;
                a[(p, q)] = 0.0;
                a[(q, p)] = 0.0;
                vectors *= turn;
            }
        }
        if off == 0.0 {
            break;
        }
    }
    (a.diagonal(), vectors)
}

/// Probability and moments of `N(mu, V)` inside an [`Ellipsoid`], by conditioning instead of sampling.
///
/// Along the leading axis `q_1 = sqrt(eta) sin(theta)` and what is left is the same problem with one dimension less in a ball of
/// squared radius `eta cos^2(theta)`; the last dimension is an interval of a normal variable, in closed form. So `M` dimensions
/// cost `24^(M-1)` intervals. The integrand is log-concave in `q_1` (a marginal of a log-concave function), which is used to
/// find its bulk where 24 Gauss-Legendre nodes over the whole axis would miss it. Sums are formed in the log domain.
///
/// Relative error of the probability: below 1e-6 for means up to six noise deviations outside, typically 1e-10.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct GaussianInEllipsoid<const M: usize> {
    forward: SMatrix<f64, M, M>,
    backward: SMatrix<f64, M, M>,
    variances: SVector<f64, M>,
    threshold: f64,
}

/// Mean and covariance of a Gaussian restricted to an ellipsoid.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EllipsoidMoments<const M: usize> {
    /// `ln P(inside)`.
    pub log_mass: f64,
    /// Mean given inside.
    pub mean: SVector<f64, M>,
    /// Covariance given inside.
    pub covariance: SMatrix<f64, M, M>,
}

impl<const M: usize> GaussianInEllipsoid<M> {
    /// `ln P(nu inside)` for `nu ~ N(mu, V)`.
    pub fn log_probability(&self, mu: &SVector<f64, M>) -> f64 {
        let b = self.forward * mu;
        log_mass(self.variances.as_slice(), b.as_slice(), self.threshold)
    }

    /// Mass, mean and covariance of `nu ~ N(mu, V)` inside; `None` if the mass is zero.
    pub fn moments(&self, mu: &SVector<f64, M>) -> Option<EllipsoidMoments<M>> {
        let b = self.forward * mu;
        let inside = moments(self.variances.as_slice(), &b, 0, self.threshold);
        if !inside.log_mass.is_finite() {
            return None;
        }
        let spread = inside.second - inside.mean * inside.mean.transpose();
        Some(EllipsoidMoments {
            log_mass: inside.log_mass,
            mean: self.backward * inside.mean,
            covariance: symmetrised(&(self.backward * spread * self.backward.transpose())),
        })
    }
}

/// A variance below this share of the ball's squared radius is a known number.
const KNOWN: f64 = 1e-16;
/// Means up to this many deviations ...
const TAME_MEAN: f64 = 6.0;
/// ... and radii up to this many deviations need no search for the bulk.
const TAME_RADIUS: f64 = 6.0;
/// Fall of the log integrand at which the bulk ends.
const FALL: f64 = 40.0;

/// The part of `theta` in `[-pi/2, pi/2]` that holds the integrand's bulk, and whether one panel is enough for it.
struct Bulk {
    cuts: [f64; 3],
    panels: usize,
}

/// Finds the bulk of `f(theta)` for independent components `q_j ~ N(b_j, w_j)` in a ball of squared radius `eta`.
fn bulk(variances: &[f64], means: &[f64], eta: f64, f: impl Fn(f64) -> f64) -> Bulk {
    let tame = variances
        .iter()
        .zip(means)
        .all(|(w, b)| b * b <= TAME_MEAN * TAME_MEAN * w && eta <= TAME_RADIUS * TAME_RADIUS * w);
    if tame {
        return Bulk {
            cuts: [-FRAC_PI_2, 0.0, FRAC_PI_2],
            panels: 1,
        };
    }
    // Golden-section search for the mode of a function that is unimodal in theta.
    const RATIO: f64 = 0.618_033_988_749_894_8;
    let (mut low, mut high) = (-FRAC_PI_2, FRAC_PI_2);
    let (mut left, mut right) = (high - RATIO * (high - low), low + RATIO * (high - low));
    let (mut at_left, mut at_right) = (f(left), f(right));
    for _ in 0..60 {
        if at_left < at_right {
            low = left;
            (left, at_left) = (right, at_right);
            right = low + RATIO * (high - low);
            at_right = f(right);
        } else {
            high = right;
            (right, at_right) = (left, at_left);
            left = high - RATIO * (high - low);
            at_left = f(left);
        }
    }
    let mode = 0.5 * (low + high);
    let floor = at_left.max(at_right) - FALL;
    let end = |outer: f64| {
        let (mut inside, mut outside) = (mode, outer);
        for _ in 0..30 {
            let middle = 0.5 * (inside + outside);
            if f(middle) > floor {
                inside = middle
            } else {
                outside = middle
            }
        }
        outside
    };
    Bulk {
        cuts: [end(-FRAC_PI_2), mode, end(FRAC_PI_2)],
        panels: 2,
    }
}

impl Bulk {
    /// Quadrature nodes and weights.
    fn nodes(&self) -> impl Iterator<Item = (f64, f64)> + '_ {
        let rule = gauss_legendre::<24>();
        let (first, second) = if self.panels == 1 {
            (self.cuts[2], self.cuts[2])
        } else {
            (self.cuts[1], self.cuts[2])
        };
        let tail = if self.panels == 1 { 0 } else { self.panels };
        rule.panels(self.cuts[0], first, self.panels)
            .chain(rule.panels(first, second, tail.max(1)).take(24 * tail))
    }
}

/// `ln P(|q|^2 < eta)` for independent `q_j ~ N(means_j, variances_j)`, the variances in decreasing order.
fn log_mass(variances: &[f64], means: &[f64], eta: f64) -> f64 {
    if eta <= 0.0 {
        return f64::NEG_INFINITY;
    }
    let (Some((w, inner_variances)), Some((b, inner_means))) = (variances.split_first(), means.split_first()) else {
        return 0.0;
    };
    if let (Some((last_w, rest_w)), Some((last_b, rest_b))) = (variances.split_last(), means.split_last())
        && *last_w <= KNOWN * eta
    {
        return log_mass(rest_w, rest_b, eta - last_b * last_b);
    }
    let (radius, deviation) = (eta.sqrt(), w.sqrt());
    if inner_variances.is_empty() {
        return normal::log_interval((-radius - b) / deviation, (radius - b) / deviation);
    }
    let log_scale = (radius / deviation).ln();
    let integrand = |theta: f64| {
        let (sine, cosine) = theta.sin_cos();
        let inner = log_mass(inner_variances, inner_means, eta * cosine * cosine);
        normal::log_pdf((radius * sine - b) / deviation) + inner + cosine.ln() + log_scale
    };
    let region = bulk(variances, means, eta, integrand);
    let mut sum = LogSum::default();
    for (theta, weight) in region.nodes() {
        sum.add(integrand(theta) + weight.ln());
    }
    sum.value()
}

/// `ln sum exp` of terms that arrive one after the other.
#[derive(Default)]
struct LogSum {
    terms: Option<(f64, f64)>,
}

impl LogSum {
    /// Adds `exp(term)`; returns the factor by which earlier terms shrink and the new term's own size.
    fn add(&mut self, term: f64) -> (f64, f64) {
        if term == f64::NEG_INFINITY {
            return (1.0, 0.0);
        }
        match &mut self.terms {
            None => {
                self.terms = Some((term, 1.0));
                (0.0, 1.0)
            }
            Some((largest, sum)) if term <= *largest => {
                let own = (term - *largest).exp();
                *sum += own;
                (1.0, own)
            }
            Some((largest, sum)) => {
                let shrink = (*largest - term).exp();
                *sum = *sum * shrink + 1.0;
                *largest = term;
                (shrink, 1.0)
            }
        }
    }

    fn value(&self) -> f64 {
        self.terms
            .map_or(f64::NEG_INFINITY, |(largest, sum)| largest + sum.ln())
    }
}

/// Mass and raw moments, in the coordinates from `first` on.
struct RawMoments<const M: usize> {
    log_mass: f64,
    mean: SVector<f64, M>,
    second: SMatrix<f64, M, M>,
}

impl<const M: usize> RawMoments<M> {
    fn with_mass(log_mass: f64) -> Self {
        Self {
            log_mass,
            mean: SVector::zeros(),
            second: SMatrix::zeros(),
        }
    }

    /// Coordinate `j`, independent of the others, takes the value `value` with second moment `square`.
    fn set(&mut self, j: usize, value: f64, square: f64) {
        for i in 0..M {
            self.second[(i, j)] = self.mean[i] * value;
            self.second[(j, i)] = self.mean[i] * value;
        }
        self.mean[j] = value;
        self.second[(j, j)] = square;
    }
}

fn moments<const M: usize>(variances: &[f64], means: &SVector<f64, M>, first: usize, eta: f64) -> RawMoments<M> {
    let tail = &means.as_slice()[first..first + variances.len()];
    let (Some((w, inner)), Some(b)) = (variances.split_first(), tail.first()) else {
        return RawMoments::with_mass(if eta > 0.0 { 0.0 } else { f64::NEG_INFINITY });
    };
    if eta <= 0.0 {
        return RawMoments::with_mass(f64::NEG_INFINITY);
    }
    if let (Some((last_w, rest)), Some(last_b)) = (variances.split_last(), tail.last())
        && *last_w <= KNOWN * eta
    {
        let mut known = moments(rest, means, first, eta - last_b * last_b);
        known.set(first + rest.len(), *last_b, last_b * last_b);
        return known;
    }
    let (radius, deviation) = (eta.sqrt(), w.sqrt());
    if inner.is_empty() {
        let (low, high) = ((-radius - b) / deviation, (radius - b) / deviation);
        let mut interval = RawMoments::with_mass(normal::log_interval(low, high));
        if let Ok(cut) = normal::truncated_moments(low, high) {
            let mean = b + deviation * cut.mean;
            interval.set(first, mean, mean * mean + w * cut.variance);
        }
        return interval;
    }
    let log_scale = (radius / deviation).ln();
    let outer = |theta: f64| {
        let (sine, cosine) = theta.sin_cos();
        let log_density = normal::log_pdf((radius * sine - b) / deviation) + cosine.ln() + log_scale;
        (radius * sine, eta * cosine * cosine, log_density)
    };
    let region = bulk(variances, tail, eta, |theta| {
        let (_, left, log_density) = outer(theta);
        log_density + log_mass(inner, &tail[1..], left)
    });
    let mut sum = LogSum::default();
    let mut total = RawMoments::with_mass(0.0);
    for (theta, weight) in region.nodes() {
        let (q, left, log_density) = outer(theta);
        let mut slice = moments(inner, means, first + 1, left);
        let (shrink, size) = sum.add(slice.log_mass + log_density + weight.ln());
        slice.set(first, q, q * q);
        total.mean = total.mean * shrink + slice.mean * size;
        total.second = total.second * shrink + slice.second * size;
    }
    total.log_mass = sum.value();
    if let Some((_, scale)) = sum.terms {
        total.mean /= scale;
        total.second /= scale;
    }
    total
}

#[cfg(test)]
mod tests {
    use super::Ellipsoid;
    use nalgebra::{Matrix1, Matrix2, Matrix3, SMatrix, SVector, Vector1, Vector2, Vector3};
    use rand::RngExt;
    use rand::SeedableRng;
    use rand_distr::StandardNormal;
    use rand_pcg::Pcg64Mcg;
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
        let scalar = crate::silence::SilentFactor::new(1.5_f64.sqrt(), 1.3, 0.0).unwrap();
        for mu in [0.0, 0.7, -3.0, 40.0, 1e5] {
            let (a, b) = (inside.log_probability(&Vector1::new(mu)), scalar.log_probability(mu));
            assert!((a - b).abs() <= 1e-12 * b.abs().max(1.0), "{mu}: {a} {b}");
        }
    }

    #[test]
    fn moments_agree_with_rejection_sampling() {
        let s = Matrix2::new(3.5, 1.0, 1.0, 5.5);
        let v = Matrix2::new(2.8, 0.7, 0.7, 4.9);
        let mu = Vector2::new(1.5, -2.0);
        let region = Ellipsoid::new(&s, 1.4).unwrap();
        let ours = region.under(&v).unwrap().moments(&mu).unwrap();
        let factor = v.cholesky().unwrap().l();
        let mut rng = Pcg64Mcg::seed_from_u64(5);
        let n = 200_000;
        let mut kept: Vec<Vector2<f64>> = Vec::new();
        for _ in 0..n {
            let nu = mu + factor * Vector2::from_fn(|_, _| rng.sample(StandardNormal));
            if region.statistic(&nu) < 1.4 {
                kept.push(nu);
            }
        }
        let count = kept.len() as f64;
        let p = count / n as f64;
        assert!((ours.log_mass.exp() - p).abs() < 4.5 * (p * (1.0 - p) / n as f64).sqrt());
        let mean = kept.iter().sum::<Vector2<f64>>() / count;
        let covariance = kept
            .iter()
            .map(|k| (k - mean) * (k - mean).transpose())
            .sum::<Matrix2<f64>>()
            / count;
        assert!((mean - ours.mean).amax() < 4.5 * (ours.covariance.amax() / count).sqrt());
        assert!((covariance - ours.covariance).amax() < 4.5 * ours.covariance.amax() * (2.0 / count).sqrt());
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
        let scalar = crate::silence::SilentFactor::new(1.0, 0.7, 0.0).unwrap();
        let mu = Vector2::new(0.4, 1.0);
        assert!((line.log_probability(&mu) - scalar.log_probability(0.4)).abs() < 1e-12);
        let moments = line.moments(&mu).unwrap();
        assert!((moments.mean[1] - 1.0).abs() < 1e-12 && moments.covariance[(1, 1)].abs() < 1e-12);
        // Nearly singular is nearly the same.
        let thin = region.under(&Matrix2::new(0.7, 0.0, 0.0, 1e-10)).unwrap();
        assert!((thin.log_probability(&mu) - line.log_probability(&mu)).abs() < 1e-4);
        assert_eq!(line.log_probability(&Vector2::new(0.0, 2.0)), f64::NEG_INFINITY);
        assert!(line.moments(&Vector2::new(0.0, 2.0)).is_none());
        let point = region.under(&Matrix2::zeros()).unwrap();
        assert_eq!(point.log_probability(&Vector2::new(1.0, 0.9)), 0.0);
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

    #[test]
    fn bad_matrices_are_refused() {
        assert!(Ellipsoid::new(&Matrix2::new(1.0, 2.0, 2.0, 1.0), 1.0).is_err());
        assert!(Ellipsoid::new(&Matrix2::identity(), -1.0).is_err());
        assert!(Ellipsoid::new(&Matrix2::new(f64::NAN, 0.0, 0.0, 1.0), 1.0).is_err());
        let region = Ellipsoid::new(&Matrix2::identity(), 1.0).unwrap();
        assert!(region.under(&Matrix2::new(1.0, 0.0, 0.0, -1.0)).is_err());
    }
}
