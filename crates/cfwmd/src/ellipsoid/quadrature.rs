//! Mass and moments of independent normal variables inside or outside a ball, one dimension at a time.
//!
//! Along the leading axis `q_1 = radius sin(theta)`. Given `theta`, the others form the same problem with one dimension less, in a ball
//! of squared radius `eta cos^2(theta)`. The outside has a second part, `|q_1| >= radius` with all other components free. The last
//! component lies inside an interval, or in its two tails. Inside and outside are both sums of positive terms: where almost all mass is
//! inside, `1 - P(inside)` would lose all digits.

use super::integrate::{NEAR, cuts, over_angles, panel, tame, with_one_mode};
use fewbits_numerics::normal::{self, TruncatedMoments};
use fewbits_numerics::{LogSum, kernels};
use nalgebra::{SMatrix, SVector};
use std::f64::consts::FRAC_PI_2;
use std::sync::OnceLock;

/// A component whose variance is below this share of the ball's squared radius is taken as known. Its deviation is then below 1e-8 of
/// the radius, less than the stated error of the probability.
const KNOWN: f64 = 1e-16;

/// Whether the mass inside or outside the ball is meant.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Inside,
    Outside,
}

impl Side {
    /// `ln P` for a known point, 0 or minus infinity. `inside` says whether the point lies in the ball.
    fn of_point(self, inside: bool) -> f64 {
        if inside == (self == Self::Inside) {
            0.0
        } else {
            f64::NEG_INFINITY
        }
    }

    /// Visits nodes and weights of a quadrature over the angle that integrates `exp(f)`.
    fn integrate(
        self,
        variances: &[f64],
        means: &[f64],
        eta: f64,
        f: impl Fn(f64) -> f64,
        visit: impl FnMut(f64, f64),
    ) {
        match self {
            Self::Inside => with_one_mode(variances, means, eta, f, visit),
            Self::Outside => over_angles(&cuts(variances, means, eta.sqrt()), f, visit),
        }
    }
}

/// The leading component `q_1 = sqrt(eta) sin(theta)` as a function of `theta`: its value, the squared radius that is left for the others,
/// and the logarithm of its density times `dq_1/dtheta`.
fn leading(variance: f64, mean: f64, eta: f64) -> impl Fn(f64) -> (f64, f64, f64) {
    let (radius, deviation) = (eta.sqrt(), variance.sqrt());
    let log_scale = (radius / deviation).ln();
    move |theta: f64| {
        let (sine, cosine) = theta.sin_cos();
        let q = radius * sine;
        (q, eta * cosine * cosine, normal::log_pdf((q - mean) / deviation) + cosine.ln() + log_scale)
    }
}

/// `ln P(|q|^2 < eta)`, or `ln P(|q|^2 >= eta)`, for independent `q_j ~ N(means_j, variances_j)`. The variances decrease.
pub(super) fn log_mass(side: Side, variances: &[f64], means: &[f64], eta: f64) -> f64 {
    if eta <= 0.0 {
        return side.of_point(false);
    }
    let (Some((w, inner)), Some((b, inner_means))) = (variances.split_first(), means.split_first()) else {
        return side.of_point(true);
    };
    // The smallest variance is negligible: that coordinate is known, and its square is subtracted from the squared radius.
    if let (Some((last_w, rest)), Some((last_b, rest_means))) = (variances.split_last(), means.split_last())
        && *last_w <= KNOWN * eta
    {
        return log_mass(side, rest, rest_means, eta - last_b * last_b);
    }
    let (radius, deviation) = (eta.sqrt(), w.sqrt());
    let mut sum = LogSum::default();
    match (side, inner, inner_means) {
        (Side::Inside, [], _) => return normal::log_interval((-radius - b) / deviation, (radius - b) / deviation),
        (Side::Inside, [inner_w], [inner_b]) if tame(variances, means, eta, NEAR) => {
            return tame_plane([*w, *inner_w], [*b, *inner_b], eta);
        }
        (Side::Inside, ..) => {}
        // Outside: the two tails of the first coordinate, and (below) the part where it is within the radius.
        (Side::Outside, ..) => {
            sum.add(normal::log_cdf((-radius - b) / deviation));
            sum.add(normal::log_cdf((b - radius) / deviation));
        }
    }
    // Given the first coordinate, the others lie in or outside a smaller ball: recursion over dimensions.
    if !inner.is_empty() {
        let leading = leading(*w, *b, eta);
        let integrand = |theta: f64| {
            let (_, left, log_density) = leading(theta);
            log_density + log_mass(side, inner, inner_means, left)
        };
        side.integrate(variances, means, eta, integrand, |theta, weight| {
            sum.add(integrand(theta) + weight.ln());
        });
    }
    sum.value()
}

/// [`log_mass`] inside for two dimensions and a smooth integrand: a fixed rule of 24 nodes, whose intervals are evaluated together.
fn tame_plane(variances: [f64; 2], means: [f64; 2], eta: f64) -> f64 {
    /// Sines and cosines of the nodes, and the logarithms of weight times cosine.
    static NODES: OnceLock<[[f64; 24]; 3]> = OnceLock::new();
    let [sines, cosines, log_weights] = NODES.get_or_init(|| {
        let mut nodes = [[0.0; 24]; 3];
        for (i, (theta, w)) in panel(-FRAC_PI_2, FRAC_PI_2).enumerate() {
            (nodes[0][i], nodes[1][i]) = theta.sin_cos();
            nodes[2][i] = (w * nodes[1][i]).ln();
        }
        nodes
    });
    let (radius, deviations) = (eta.sqrt(), variances.map(f64::sqrt));
    let (mut lower, mut upper, mut logs) = ([0.0; 24], [0.0; 24], [0.0; 24]);
    for i in 0..24 {
        let along = (radius * sines[i] - means[0]) / deviations[0];
        logs[i] = log_weights[i] - 0.5 * along * along;
        lower[i] = (-radius * cosines[i] - means[1]) / deviations[1];
        upper[i] = (radius * cosines[i] - means[1]) / deviations[1];
    }
    kernels::log_interval(&mut lower, &upper);
    logs.iter_mut().zip(lower).for_each(|(log, inside)| *log += inside);
    kernels::log_sum_exp(&logs) + (radius / deviations[0]).ln() - normal::LN_SQRT_2PI
}

/// Probability, mean and covariance of a Gaussian restricted to an ellipsoid or to its outside.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EllipsoidMoments<const M: usize> {
    /// Logarithm of the probability of the region.
    pub log_mass: f64,
    /// Mean given the region.
    pub mean: SVector<f64, M>,
    /// Covariance given the region.
    pub covariance: SMatrix<f64, M, M>,
}

impl<const M: usize> EllipsoidMoments<M> {
    /// Mean and covariance of the mixture `(1 - share) self + share part`; the mass is that of `self`. The sums are taken about the means:
    /// raw moments would cancel where the means are large beside the spread.
    pub(crate) fn mixed(mut self, part: &Self, share: f64) -> Self {
        let step = part.mean - self.mean;
        self.mean += step * share;
        self.covariance = (self.covariance + step * step.transpose() * share) * (1.0 - share) + part.covariance * share;
        self
    }

    fn with_mass(log_mass: f64) -> Self {
        Self {
            log_mass,
            mean: SVector::zeros(),
            covariance: SMatrix::zeros(),
        }
    }

    /// Moments of the unrestricted components.
    fn free(variances: &[f64], means: &[f64], first: usize) -> Self {
        let mut free = Self::with_mass(0.0);
        for (i, (w, b)) in variances.iter().zip(means).enumerate() {
            free.mean[first + i] = *b;
            free.covariance[(first + i, first + i)] = *w;
        }
        free
    }

    /// Replaces the moments of component `first`, of this variance and mean, by those of its truncation `cut`.
    fn with_cut(mut self, first: usize, variance: f64, mean: f64, cut: &TruncatedMoments) -> Self {
        self.log_mass = cut.log_probability;
        self.mean[first] = mean + variance.sqrt() * cut.mean;
        self.covariance[(first, first)] = variance * cut.variance;
        self
    }
}

/// As [`log_mass`], with mean and covariance over the coordinates from `first` on; entries before `first` are zero. `variances` are those
/// of the coordinates from `first` on, `means` those of all.
pub(super) fn moments<const M: usize>(
    side: Side,
    variances: &[f64],
    means: &SVector<f64, M>,
    first: usize,
    eta: f64,
) -> EllipsoidMoments<M> {
    let tail = &means.as_slice()[first..first + variances.len()];
    if eta <= 0.0 && side == Side::Outside {
        return EllipsoidMoments::free(variances, tail, first);
    }
    let (Some((w, inner)), Some(b)) = (variances.split_first().filter(|_| eta > 0.0), tail.first()) else {
        return EllipsoidMoments::with_mass(side.of_point(eta > 0.0));
    };
    // As in `log_mass`: a coordinate of negligible variance is known.
    if let (Some((last_w, rest)), Some(last_b)) = (variances.split_last(), tail.last())
        && *last_w <= KNOWN * eta
    {
        let mut known = moments(side, rest, means, first, eta - last_b * last_b);
        known.mean[first + rest.len()] = *last_b;
        return known;
    }
    let (radius, deviation) = (eta.sqrt(), w.sqrt());
    let (low, high) = ((-radius - b) / deviation, (radius - b) / deviation);
    let cuts: &[(f64, f64)] = match (side, inner) {
        (Side::Inside, []) => &[(low, high)],
        (Side::Inside, _) => &[],
        // The two tails of the leading component; the others are unrestricted.
        (Side::Outside, _) => &[(f64::NEG_INFINITY, low), (high, f64::INFINITY)],
    };
    let (mut sum, mut total) = (LogSum::default(), EllipsoidMoments::with_mass(0.0));
    let mut add = |part: EllipsoidMoments<M>, log_weight: f64| {
        let share = sum.add_with_share(part.log_mass + log_weight);
        // A part without mass has no moments: its mean may be anything.
        if share > 0.0 {
            total = total.mixed(&part, share);
        }
    };
    for cut in cuts
        .iter()
        .filter_map(|(from, to)| normal::truncated_moments(*from, *to).ok())
    {
        add(EllipsoidMoments::free(inner, &tail[1..], first + 1).with_cut(first, *w, *b, &cut), 0.0);
    }
    if !inner.is_empty() {
        let leading = leading(*w, *b, eta);
        let integrand = |theta: f64| {
            let (_, left, log_density) = leading(theta);
            log_density + log_mass(side, inner, &tail[1..], left)
        };
        side.integrate(variances, tail, eta, integrand, |theta, weight| {
            let (q, left, log_density) = leading(theta);
            let mut slice: EllipsoidMoments<M> = moments(side, inner, means, first + 1, left);
            slice.mean[first] = q;
            slice.log_mass += log_density;
            add(slice, weight.ln());
        });
    }
    total.log_mass = sum.value();
    total
}

#[cfg(test)]
mod tests {
    use super::super::Ellipsoid;
    use fewbits_core::{Belief, Gaussian};
    use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
    use rand::SeedableRng;

    /// Mass, mean and covariance outside by weighing draws: within 4.5 standard errors.
    fn check<const M: usize>(
        s: SMatrix<f64, M, M>,
        eta: f64,
        v: SMatrix<f64, M, M>,
        mu: SVector<f64, M>,
        draws: usize,
    ) {
        let region = Ellipsoid::new(&s, eta).unwrap();
        let ours = region.under(&v).unwrap().moments_outside(&mu).unwrap();
        let law = Gaussian::new(mu, v).unwrap();
        let mut rng = rand_pcg::Pcg64Mcg::seed_from_u64(5);
        let kept: Vec<SVector<f64, M>> = (0..draws)
            .map(|_| law.sample(&mut rng))
            .filter(|nu| region.statistic(nu) >= eta)
            .collect();
        let (count, all) = (kept.len() as f64, draws as f64);
        let p = count / all;
        assert!((ours.log_mass.exp() - p).abs() < 4.5 * (p * (1.0 - p) / all).sqrt(), "{} {p}", ours.log_mass.exp());
        let mean = kept.iter().sum::<SVector<f64, M>>() / count;
        for i in 0..M {
            assert!((mean[i] - ours.mean[i]).abs() < 4.5 * (ours.covariance[(i, i)] / count).sqrt());
            for j in 0..=i {
                let products = kept.iter().map(|nu| (nu[i] - mean[i]) * (nu[j] - mean[j]));
                let found = products.clone().sum::<f64>() / count;
                let square = products.map(|x| x * x).sum::<f64>() / count - found * found;
                let error = (square / count).sqrt();
                assert!(
                    (found - ours.covariance[(i, j)]).abs() < 4.5 * error,
                    "{i} {j}: {found} {:?}",
                    ours.covariance
                );
            }
        }
    }

    #[test]
    fn moments_outside_agree_with_sampling() {
        let (s, v) = (Matrix2::new(3.5, 1.0, 1.0, 5.5), Matrix2::new(2.8, 0.7, 0.7, 4.9));
        check(s, 1.4, v, Vector2::new(1.5, -2.0), 100_000);
        check(s, 6.0, v, Vector2::zeros(), 200_000);
        check(s, 0.3, Matrix2::new(1.0, 0.999, 0.999, 1.0), Vector2::new(0.5, 0.2), 100_000);
        check(
            Matrix3::identity(),
            2.0,
            Matrix3::new(0.9, 0.2, 0.0, 0.2, 0.6, 0.1, 0.0, 0.1, 0.3),
            Vector3::new(0.3, -0.5, 0.2),
            100_000,
        );
    }

    /// In two dimensions of equal variance about the centre the law is Rayleigh's: `P(outside) = exp(-eta / 2 w)`.
    #[test]
    fn small_mass_outside_keeps_its_digits() {
        for (w, eta) in [(1.0, 3.0), (0.1, 2.0), (0.01, 4.0), (1e-3, 1.0), (1e-4, 0.5)] {
            let region = Ellipsoid::new(&Matrix2::identity(), eta).unwrap();
            let under = region.under(&(Matrix2::identity() * w)).unwrap();
            let outside = under.moments_outside(&Vector2::zeros()).unwrap();
            let expected = -0.5 * eta / w;
            assert!((outside.log_mass / expected - 1.0).abs() < 1e-8, "{w}: {} {expected}", outside.log_mass);
            assert!((under.log_probability_outside(&Vector2::zeros()) / expected - 1.0).abs() < 1e-7);
            // E |q|^2 = eta + 2 w, half on each axis.
            let variance = 0.5 * eta + w;
            assert!(outside.mean.amax() < 1e-6 * variance.sqrt());
            assert!((outside.covariance[(0, 0)] / variance - 1.0).abs() < 1e-6, "{w}: {}", outside.covariance);
            assert!((outside.covariance[(1, 1)] / variance - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn inside_and_outside_make_the_whole() {
        let (s, v) = (Matrix2::new(3.5, 1.0, 1.0, 5.5), Matrix2::new(2.8, 0.7, 0.7, 4.9));
        for (eta, mu) in [
            (1.4, [0.4, 0.1]),
            (0.0, [1.0, 1.0]),
            (4.0, [6.0, -3.0]),
            (9.0, [0.0, 0.0]),
        ] {
            let (region, mu) = (Ellipsoid::new(&s, eta).unwrap(), Vector2::from(mu));
            let under = region.under(&v).unwrap();
            let outside = under.moments_outside(&mu).unwrap();
            let Some(inside) = under.moments(&mu) else {
                assert!(eta == 0.0 && outside.log_mass == 0.0 && (outside.covariance - v).amax() < 1e-12);
                continue;
            };
            let (p, q) = (inside.log_mass.exp(), outside.log_mass.exp());
            assert!((p + q - 1.0).abs() < 1e-7, "{p} {q}");
            assert!((inside.mean * p + outside.mean * q - mu).amax() < 1e-6);
        }
    }
}
