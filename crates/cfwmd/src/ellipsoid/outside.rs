//! Mass and moments of independent normal variables outside a ball: sums of positive terms, however small the mass.
//!
//! `1 - P(inside)` would lose all digits where almost everything is inside. Along the leading axis `q_1` there are two parts:
//! ```text
//! |q_1| >= radius                       outside, whatever the other components are
//! q_1 = radius sin(theta)               the other components lie outside a ball of squared radius eta cos^2(theta)
//! ```
//! The last component is outside an interval: two tails of a normal variable.

use super::quadrature::{KNOWN, LogSum, Moments, leading, panel};
use fewbits_numerics::normal;
use nalgebra::SVector;
use std::f64::consts::FRAC_PI_2;

/// Panels are halved until two rules agree to this share of the whole ...
const TOLERANCE: f64 = 1e-10;
/// ... or this often: enough to find a step of the integrand to `pi / 2^24`.
const HALVINGS: u32 = 24;
/// The bulk of a component, in deviations: beyond the last the density has fallen by `exp(-32)`.
const CUTS: [f64; 3] = [0.0, 2.0, 8.0];

/// `N(means, variances)` in the coordinates from `first` on, outside the ball of squared radius `eta`; variances in decreasing order.
pub(super) fn moments<const M: usize>(
    variances: &[f64],
    means: &SVector<f64, M>,
    first: usize,
    eta: f64,
) -> Moments<M> {
    let tail = &means.as_slice()[first..first + variances.len()];
    if eta <= 0.0 {
        return free(variances, tail, first);
    }
    let (Some((w, inner)), Some(b)) = (variances.split_first(), tail.first()) else {
        return Moments::with_mass(f64::NEG_INFINITY);
    };
    if let (Some((last_w, rest)), Some(last_b)) = (variances.split_last(), tail.last())
        && *last_w <= KNOWN * eta
    {
        let mut known = moments(rest, means, first, eta - last_b * last_b);
        known.mean[first + rest.len()] = *last_b;
        return known;
    }
    let (radius, deviation) = (eta.sqrt(), w.sqrt());
    let (mut sum, mut total) = (LogSum::default(), Moments::with_mass(0.0));
    let mut add = |part: Moments<M>, log_weight: f64| {
        let share = sum.add(part.log_mass + log_weight);
        if share > 0.0 {
            // The mixture of what was there and the part, free of the cancellation of raw moments.
            let step = part.mean - total.mean;
            total.mean += step * share;
            total.covariance =
                (total.covariance + step * step.transpose() * share) * (1.0 - share) + part.covariance * share;
        }
    };
    // The two tails of the leading component, the others free.
    for (low, high) in [
        (f64::NEG_INFINITY, (-radius - b) / deviation),
        ((radius - b) / deviation, f64::INFINITY),
    ] {
        if let Ok(cut) = normal::truncated_moments(low, high) {
            let mut part = free(inner, &tail[1..], first + 1);
            part.log_mass = cut.log_probability;
            part.mean[first] = b + deviation * cut.mean;
            part.covariance[(first, first)] = w * cut.variance;
            add(part, 0.0);
        }
    }
    if !inner.is_empty() {
        let leading = leading(*w, *b, eta);
        let integrand = |theta: f64| {
            let (_, left, log_density) = leading(theta);
            log_density + log_mass(inner, &tail[1..], left)
        };
        integrate(&cuts(variances, tail, radius), integrand, |theta, weight| {
            let (q, left, log_density) = leading(theta);
            let mut slice: Moments<M> = moments(inner, means, first + 1, left);
            slice.mean[first] = q;
            add(slice, log_density + weight.ln());
        });
    }
    total.log_mass = sum.value();
    total
}

/// `ln P(|q|^2 >= eta)`, as [`moments`] without the moments.
pub(super) fn log_mass(variances: &[f64], means: &[f64], eta: f64) -> f64 {
    if eta <= 0.0 {
        return 0.0;
    }
    let (Some((w, inner)), Some((b, inner_means))) = (variances.split_first(), means.split_first()) else {
        return f64::NEG_INFINITY;
    };
    if let (Some((last_w, rest)), Some((last_b, rest_means))) = (variances.split_last(), means.split_last())
        && *last_w <= KNOWN * eta
    {
        return log_mass(rest, rest_means, eta - last_b * last_b);
    }
    let (radius, deviation) = (eta.sqrt(), w.sqrt());
    let mut sum = LogSum::default();
    sum.add(normal::log_cdf((-radius - b) / deviation));
    sum.add(normal::log_cdf((b - radius) / deviation));
    if !inner.is_empty() {
        let leading = leading(*w, *b, eta);
        let integrand = |theta: f64| {
            let (_, left, log_density) = leading(theta);
            log_density + log_mass(inner, inner_means, left)
        };
        integrate(&cuts(variances, means, radius), integrand, |theta, weight| {
            sum.add(integrand(theta) + weight.ln());
        });
    }
    sum.value()
}

/// The components as they are.
fn free<const M: usize>(variances: &[f64], means: &[f64], first: usize) -> Moments<M> {
    let mut free = Moments::with_mass(0.0);
    for (i, (w, b)) in variances.iter().zip(means).enumerate() {
        free.mean[first + i] = *b;
        free.covariance[(first + i, first + i)] = *w;
    }
    free
}

/// Increasing angles at which the integrand may change its course: the bulk of the leading component, and where the edge of the
/// ball passes through the bulk of each other one.
fn cuts(variances: &[f64], means: &[f64], radius: f64) -> Vec<f64> {
    let mut all = vec![-FRAC_PI_2, 0.0, FRAC_PI_2];
    for (i, (w, b)) in variances.iter().zip(means).enumerate() {
        for at in CUTS
            .into_iter()
            .flat_map(|cut| [b - cut * w.sqrt(), b + cut * w.sqrt()])
        {
            let ratio = at / radius;
            if ratio.abs() < 1.0 {
                match i {
                    0 => all.push(ratio.asin()),
                    _ => all.extend([ratio.abs().acos(), -ratio.abs().acos()]),
                }
            }
        }
    }
    all.sort_by(f64::total_cmp);
    all.dedup();
    all
}

/// Visits nodes and weights of a quadrature of `exp(f)` between the cuts.
fn integrate(cuts: &[f64], f: impl Fn(f64) -> f64, mut visit: impl FnMut(f64, f64)) {
    let largest = |a: f64, b: f64| panel(a, b).map(|(theta, _)| f(theta)).fold(f64::NEG_INFINITY, f64::max);
    let panels = || cuts.windows(2).map(|pair| (pair[0], pair[1]));
    let peak = panels().map(|(a, b)| largest(a, b)).fold(f64::NEG_INFINITY, f64::max);
    if peak == f64::NEG_INFINITY {
        return;
    }
    let mass = |a: f64, b: f64| panel(a, b).map(|(theta, w)| w * (f(theta) - peak).exp()).sum::<f64>();
    let mut waiting: Vec<_> = panels().rev().map(|(a, b)| (a, b, mass(a, b), 0)).collect();
    let whole: f64 = waiting.iter().map(|panel| panel.2).sum();
    // Halving a panel that is no number would never end.
    if !whole.is_finite() {
        return;
    }
    while let Some((a, b, coarse, depth)) = waiting.pop() {
        let middle = 0.5 * (a + b);
        let (left, right) = (mass(a, middle), mass(middle, b));
        if (left + right - coarse).abs() <= TOLERANCE * whole || depth == HALVINGS {
            panel(a, middle)
                .chain(panel(middle, b))
                .for_each(|(theta, w)| visit(theta, w));
        } else {
            waiting.push((middle, b, right, depth + 1));
            waiting.push((a, middle, left, depth + 1));
        }
    }
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
