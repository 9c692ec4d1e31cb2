//! The four measures between discrete distributions, and the inequalities between them that the paper prints, corrects or needs.

use fewbits_core::{Error, Gaussian};
use fewbits_mixture_codec::PlugIn;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::error::{entries, probabilities};
use fewbits_numerics::factored::Factored;
use nalgebra::SMatrix;

/// The four measures between two known distributions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Divergence {
    /// Kullback-Leibler divergence in nats; infinite if `q` is zero where `p` is not.
    pub kl: f64,
    /// Integral (sum) of the absolute difference, at most 2.
    pub l1: f64,
    /// Largest absolute log ratio.
    pub ml: f64,
    /// Half the range of the log ratio.
    pub dr: f64,
}

/// Uses the estimates as if they were the measures themselves; a KL below zero is replaced by zero.
impl From<PlugIn> for Divergence {
    fn from(estimate: PlugIn) -> Self {
        Self {
            kl: estimate.kl_plugin.max(0.0),
            l1: estimate.l1_plugin,
            ml: estimate.ml_plugin,
            dr: estimate.dr_plugin,
        }
    }
}

/// The four measures between two discrete distributions on the same points. Points at which both are zero are left out.
///
/// # Errors
/// If the lengths differ, or one is not a probability vector.
pub fn discrete(p: &[f64], q: &[f64]) -> Result<Divergence, Error> {
    probabilities("p", p)?;
    probabilities("q", q)?;
    entries("q", q.len(), p.len())?;
    let (mut kl, mut l1) = (0.0, 0.0);
    let (mut top, mut bottom) = (f64::NEG_INFINITY, f64::INFINITY);
    // If both are zero, the ratio is NaN, which maximum and minimum ignore.
    for (p, q) in p.iter().zip(q) {
        let f = log_ratio(*p, *q);
        if *p > 0.0 {
            kl += p * f;
        }
        l1 += (p - q).abs();
        top = top.max(f);
        bottom = bottom.min(f);
    }
    Ok(Divergence {
        kl: kl.max(0.0),
        l1,
        ml: top.max(-bottom),
        dr: 0.5 * (top - bottom),
    })
}

/// `ln(p / q)`, accurate for nearly equal arguments.
fn log_ratio(p: f64, q: f64) -> f64 {
    if (p - q).abs() < 0.5 * q {
        ((p - q) / q).ln_1p()
    } else {
        p.ln() - q.ln()
    }
}

/// Largest KL of two normalised densities with the given `DR`: `phi(2 DR)` with
/// `phi(h) = ln((e^h - 1)/h) - 1 + h/(e^h - 1)`. Some densities attain it. Infinite for an infinite argument, 0 for a negative one.
pub fn kl_from_dr(dr: f64) -> f64 {
    phi(2.0 * dr)
}

/// Hoeffding's simpler bound of the KL, `KL <= DR^2 / 2`.
pub fn kl_from_dr_hoeffding(dr: f64) -> f64 {
    0.5 * dr * dr
}

/// Bound of the L1 by the DR, `L1 <= 2 tanh(DR / 2)`.
pub fn l1_from_dr(dr: f64) -> f64 {
    2.0 * (0.5 * dr).tanh()
}

/// Bound of the KL by the ML, `KL <= ML tanh(ML / 2)`.
pub fn kl_from_ml(ml: f64) -> f64 {
    ml * (0.5 * ml).tanh()
}

/// `ln((e^h - 1)/h) - 1 + h/(e^h - 1)`, without cancellation for small or large `h`.
pub fn phi(h: f64) -> f64 {
    if h == f64::INFINITY {
        return h;
    }
    if h <= 0.0 {
        return 0.0;
    }
    if h < 0.05 {
        // The series about 0; the next term is below 1e-17.
        let s = h * h;
        return s * (1.0 / 8.0 - s * (1.0 / 576.0 - s * (1.0 / 25_920.0 - s / 1_075_200.0)));
    }
    let decay = (-h).exp();
    let gone = -(-h).exp_m1();
    h - h.ln() - 1.0 + gone.ln() + h * decay / gone
}

/// The printed bound for accumulated KL errors, `KL[p0, p1] + C KL[p1, p2]` with `C = max p0/p1`. **False**: for
/// `p0 = (.6, .4), p1 = (.5, .5), p2 = (.49, .51)` it is .02038, below `KL[p0, p2] = .02434`.
///
/// # Errors
/// As [`discrete`].
pub fn kl_chain_printed(p0: &[f64], p1: &[f64], p2: &[f64]) -> Result<f64, Error> {
    let (first, second) = (discrete(p0, p1)?, discrete(p1, p2)?);
    let (_, most) = ratio_range(p0, p1);
    Ok(first.kl + scaled(most, second.kl))
}

/// The corrected bound for accumulated KL errors, `KL[p0, p2] <= KL[p0, p1] + C KL[p1, p2] + (C - c)/2 L1[p1, p2]`, with `C` and `c` the
/// largest and the smallest `p0/p1`.
///
/// # Errors
/// As [`discrete`].
pub fn kl_chain_corrected(p0: &[f64], p1: &[f64], p2: &[f64]) -> Result<f64, Error> {
    let (first, second) = (discrete(p0, p1)?, discrete(p1, p2)?);
    let (least, most) = ratio_range(p0, p1);
    Ok(first.kl + scaled(most, second.kl) + scaled(0.5 * (most - least), second.l1))
}

/// `factor x`, with infinity times zero equal to zero.
fn scaled(factor: f64, x: f64) -> f64 {
    if x == 0.0 { 0.0 } else { factor * x }
}

/// Smallest and largest `p/q` over the points at which one of them is positive.
pub fn ratio_range(p: &[f64], q: &[f64]) -> (f64, f64) {
    // 0/0 is NaN, which minimum and maximum ignore.
    let ratios = p.iter().zip(q).map(|(p, q)| p / q);
    ratios.fold((f64::INFINITY, 0.0), |(low, high), r| (r.min(low), r.max(high)))
}

/// `KL[N(0, a^2), N(0, b^2)] = ln(b/a) + a^2/(2 b^2) - 1/2`, for standard deviations above 0.
///
/// # Errors
/// If one is not a finite number above 0.
pub fn kl_centred_normals(a: f64, b: f64) -> Result<f64, Error> {
    fewbits_numerics::error::positive("a", a)?;
    fewbits_numerics::error::positive("b", b)?;
    // With x = a^2/b^2 - 1 this is (x - ln(1 + x))/2. The quotient is formed first, since squares may overflow.
    let x = ((a - b) / b) * (a / b + 1.0);
    if x.abs() < 1e-3 {
        return Ok(0.5 * x * x * (0.5 - x * (1.0 / 3.0 - x * (0.25 - x * (0.2 - x / 6.0)))));
    }
    // Near -1 the sum `1 + x` has lost the digits of `a/b`, and beyond 1e10 `x` may overflow: the logarithms are as exact there.
    if !(-0.5..1e10).contains(&x) {
        return Ok(0.5 * x - (a.ln() - b.ln()));
    }
    Ok(0.5 * (x - x.ln_1p()))
}

/// `ln sup p/q` of two Gaussians, the logarithm of the amplification `C`. If `S_q - S_p` is positive definite it is
/// `(ln det S_q - ln det S_p + d' (S_q - S_p)^-1 d)/2` with `d` the difference of the means. It is `+inf` if `p` is wider in some
/// direction, and 0 if they are equal.
///
/// ML and DR also need the infimum, which is `-inf` whenever the supremum is finite, unless the two are equal. Between different Gaussians
/// over all of space both are therefore infinite, and likewise between mixtures, whose widest components decide. They are finite for
/// discrete distributions ([`discrete`]) and on bounded sets only.
///
/// # Errors
/// If a covariance is not positive definite.
pub fn log_largest_ratio<const D: usize>(p: &Gaussian<D>, q: &Gaussian<D>) -> Result<f64, Error> {
    let own = Factored::new("p", p.covariance())?;
    let other = Factored::new("q", q.covariance())?;
    // In coordinates in which p is standard normal, q has the eigenvalues 1 + gain.
    let whiten = |m: &SMatrix<f64, D, D>| own.whitener * m * own.whitener.transpose();
    let (values, vectors) = symmetric_eigen(whiten(q.covariance()));
    let gap = vectors.transpose() * (own.whitener * (p.mean() - q.mean()));
    let mut total = 2.0 * (other.half_log_det - own.half_log_det);
    for (value, gap) in values.iter().zip(gap.iter()) {
        let gain = value - 1.0;
        if gain > EQUAL * value {
            total += gap * gap / gain;
        } else if gain < -EQUAL || gap.abs() > EQUAL.sqrt() {
            return Ok(f64::INFINITY);
        }
    }
    Ok(0.5 * total.max(0.0))
}

/// Variances with a smaller relative difference are treated as equal.
const EQUAL: f64 = 1e-12;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phi_is_smooth_across_its_branches_and_bounded_by_hoeffding() {
        let direct = |h: f64| (h.exp_m1() / h).ln() - 1.0 + h / h.exp_m1();
        for h in [0.02, 0.049_99, 0.050_01, 0.3, 2.0, 30.0, 500.0] {
            assert!((phi(h) - direct(h)).abs() < 2e-13 * h.max(1.0), "{h}");
        }
        assert!((phi(1e-6) / (1e-12 / 8.0) - 1.0).abs() < 1e-12);
        // With 60 digits.
        for (h, exact) in [
            (0.003, 1.1249998593750281e-06),
            (0.03, 0.00011249859377812439),
            (0.049, 0.00030011499219889995),
            (0.8, 0.07929884885810966),
            (7.0, 4.0595665527344),
        ] {
            assert!((phi(h) / exact - 1.0).abs() < 1e-14, "{h} {}", phi(h));
        }
        assert!((phi(1e5) - (1e5 - 1e5_f64.ln() - 1.0)).abs() < 1e-9);
        for h in [1e-8, 1e-3, 0.7, 5.0, 60.0] {
            assert!(phi(h) <= h * h / 8.0);
        }
        assert_eq!((phi(0.0), phi(f64::INFINITY)), (0.0, f64::INFINITY));
    }

    /// Erratum `handoff-10`.
    #[test]
    fn missing_mass_is_infinite_and_common_zeros_are_nothing() {
        let d = discrete(&[0.5, 0.5, 0.0], &[1.0, 0.0, 0.0]).unwrap();
        assert_eq!((d.kl, d.l1, d.ml, d.dr), (f64::INFINITY, 1.0, f64::INFINITY, f64::INFINITY));
        assert_eq!(discrete(&[1.0, 0.0], &[1.0, 0.0]).unwrap().dr, 0.0);
        assert!(discrete(&[0.5, 0.6], &[1.0, 0.0]).is_err() && discrete(&[1.0], &[0.5, 0.5]).is_err());
    }

    /// Defect: squares of 1e181 gave NaN.
    #[test]
    fn normals_of_extreme_width_have_their_divergence() {
        for (a, b) in [
            (1e181, 0.7),
            (0.7, 1e181),
            (1e-200, 1e-200),
            (1e200, 2e200),
            (5e-324, f64::MAX),
            (1e300, f64::MAX),
        ] {
            let found: f64 = kl_centred_normals(a, b).unwrap();
            let ratio: f64 = a / b;
            let expected = 0.5 * (ratio * ratio - 1.0) - (a.ln() - b.ln());
            assert!(found == expected || (found / expected - 1.0).abs() < 1e-12, "{a} {b}: {found} {expected}");
        }
    }

    /// By `(x - ln(1 + x))/2 = x^2/2 int_0^1 u/(1 + x u) du`, whose integrand has no cancellation.
    #[test]
    fn normals_of_nearly_equal_width_lose_no_digits() {
        let rule = fewbits_numerics::quadrature::Rule::gauss_legendre(20);
        for (a, b) in [
            (0.3, 0.7),
            (1.9, 2.0),
            (3.999, 4.0),
            (1.000_3, 1.0),
            (1.000_6, 1.0),
            (1.1, 0.9),
            (5.0, 0.2),
        ] {
            let x = (a - b) * (a + b) / (b * b);
            let direct = 0.5 * x * x * rule.composite(0.0, 1.0, 400, |u| u / (1.0 + x * u));
            let found: f64 = kl_centred_normals(a, b).unwrap();
            assert!((found / direct - 1.0).abs() < 1e-11, "{a} {b}: {found} {direct}");
        }
        assert!(kl_centred_normals(0.0, 1.0).is_err() && kl_centred_normals(1.0, -1.0).is_err());
    }

    #[test]
    fn nearly_equal_laws_lose_no_digits_and_very_different_ones_no_range() {
        let e = 2.0_f64.powi(-30);
        let d = discrete(&[0.5 + e, 0.5 - e], &[0.5, 0.5]).unwrap();
        let x = 2.0 * e;
        assert!((d.kl / (x * x / 2.0) - 1.0).abs() < 1e-6, "{d:?}");
        assert!((d.ml / (x + x * x / 2.0) - 1.0).abs() < 1e-14 && (d.dr / x - 1.0).abs() < 1e-14 && d.l1 == x);
        let d = discrete(&[0.1, 0.9], &[1e-310, 1.0]).unwrap();
        assert!((d.ml - (0.1_f64.ln() - 1e-310_f64.ln())).abs() < 1e-9, "{d:?}");
        let d = discrete(&[1e-20, 1.0], &[0.9, 0.1]).unwrap();
        assert!((d.ml - (0.9_f64.ln() - 1e-20_f64.ln())).abs() < 1e-12 && (d.kl - 10.0_f64.ln()).abs() < 1e-12);
        assert!((d.dr - 0.5 * (10.0_f64.ln() + d.ml)).abs() < 1e-12 && (d.l1 - 1.8).abs() < 1e-12);
        let d = discrete(&[0.7, 0.3, 0.0, 0.0], &[0.2, 0.5, 0.3, 0.0]).unwrap();
        assert!((d.kl - (0.7 * 3.5_f64.ln() + 0.3 * 0.6_f64.ln())).abs() < 1e-14 && (d.l1 - 1.0).abs() < 1e-14);
        assert_eq!((d.ml, d.dr), (f64::INFINITY, f64::INFINITY));
    }

    #[test]
    fn ratios_and_chains_where_laws_have_holes() {
        assert_eq!(ratio_range(&[0.6, 0.4, 0.0, 0.0], &[0.5, 0.25, 0.25, 0.0]), (0.0, 1.6));
        assert_eq!(ratio_range(&[0.6, 0.4], &[1.0, 0.0]), (0.6, f64::INFINITY));
        // The second step loses nothing, however large its factor.
        let (p0, p1) = ([0.5, 0.5], [1.0, 0.0]);
        assert_eq!(kl_chain_printed(&p0, &p1, &p1).unwrap(), f64::INFINITY);
        assert_eq!(kl_chain_corrected(&p0, &p1, &p1).unwrap(), f64::INFINITY);
        let (p0, p1, p2) = ([0.75, 0.25, 0.0], [0.5, 0.3, 0.2], [0.4, 0.4, 0.2]);
        let kl = |p: &[f64], q: &[f64]| discrete(p, q).unwrap().kl;
        let chain = kl(&p0, &p1) + 1.5 * kl(&p1, &p2);
        assert!((kl_chain_printed(&p0, &p1, &p2).unwrap() - chain).abs() < 1e-15);
        assert!((kl_chain_corrected(&p0, &p1, &p2).unwrap() - chain - 0.75 * 0.2).abs() < 1e-15);
        assert_eq!(
            (kl_from_ml(f64::INFINITY), kl_from_dr(-0.3), kl_from_dr(f64::INFINITY)),
            (f64::INFINITY, 0.0, f64::INFINITY)
        );
        let decay = (-1.4_f64).exp();
        assert!((kl_from_ml(1.4) - 1.4 * (1.0 - decay) / (1.0 + decay)).abs() < 1e-15);
    }
}
