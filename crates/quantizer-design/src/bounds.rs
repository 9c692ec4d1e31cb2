//! Lower bounds on the mean squared error that quantized sensors can reach.
//!
//! | bound | holds for | function |
//! |---|---|---|
//! | remote distortion-rate (2.15) | any code of one noisy source, any block length | [`remote_distortion_rate`] |
//! | quadratic Gaussian CEO | any codes at separate sensors with independent noise | [`ceo`] |
//! | Bayesian Cramer-Rao (van Trees, constant weight) | these quantizers, any estimator | [`bayesian_cramer_rao`] |
//!
//! The Cramer-Rao bound `1 / J(x)` concerns unbiased estimators of a fixed `x`. The posterior mean is biased towards the prior
//! and beats it; for a random unknown the van Trees inequality takes its place.

use crate::criterion::Criterion;
use crate::error::{Error, refuse};
use crate::problem::Problem;
use crate::scene::Prior;
use crate::system::System;
use nalgebra::{DMatrix, DVector};

/// Most sensors of a CEO bound: every subset is a constraint.
pub const CEO_MAX_SENSORS: usize = 12;

/// `D(R) = s_x^2 - s_x^4 / (s_x^2 + s^2) (1 - 2^{-2R})`: least squared error in `X` from `R` bits a sample about `X + W`, (2.15).
///
/// # Errors
/// If a variance is not positive or `bits` is negative or not finite.
pub fn remote_distortion_rate(prior_variance: f64, noise_variance: f64, bits: f64) -> Result<f64, Error> {
    let sx2 = fewbits_numerics::error::positive("prior_variance", prior_variance)?;
    let s2 = fewbits_numerics::error::positive("noise_variance", noise_variance)?;
    let bits = fewbits_numerics::error::non_negative("bits", bits)?;
    // The error of the noise alone plus what is left of the rest: no difference, so no digit is lost.
    Ok(sx2 / (sx2 + s2) * (s2 + sx2 * (-2.0 * bits).exp2()))
}

/// Fisher information about `x` in the received symbols at each value of the scene, for independent noise.
///
/// `J(x) = sum_sensors sum_t (dP_t(x)/dx)^2 / P_t(x)`; symbols of vanishing probability contribute nothing.
///
/// # Errors
/// [`Error::Argument`] if the noise is correlated.
pub fn fisher_information(system: &System) -> Result<Vec<f64>, Error> {
    let scene = system.scene();
    if !scene.is_independent() {
        return refuse("noise", "correlated noise", "independent noise for a Fisher information");
    }
    let nodes = scene.values().len();
    let mut information = vec![0.0; nodes];
    let active: Vec<usize> = (0..system.groups().len()).collect();
    let problem = Problem::new(system, Criterion::MeanSquaredError, &active)?;
    for (g, group) in system.groups().iter().enumerate() {
        let law = problem.single_sensor_law(g, group.quantizer().breakpoints());
        for (t, p) in law.symbols.chunks_exact(nodes).enumerate() {
            for (k, total) in information.iter_mut().enumerate() {
                // Raising x is lowering all breakpoints.
                let slope: f64 = law.exchange.iter().zip(&law.densities).map(|(c, d)| c[t] * d[k]).sum();
                if p[k] > 0.0 {
                    *total += group.sensors().len() as f64 * slope * (slope / p[k]);
                }
            }
        }
    }
    Ok(information)
}

/// Fisher information averaged over the prior.
///
/// # Errors
/// As [`fisher_information`].
pub fn mean_fisher_information(system: &System) -> Result<f64, Error> {
    let information = fisher_information(system)?;
    Ok(information
        .iter()
        .zip(system.scene().weights())
        .map(|(j, w)| w * j)
        .sum())
}

/// `1 / (E J(X) + 1 / s_x^2)`: no estimator from these symbols has a smaller mean squared error (van Trees 1968).
///
/// # Errors
/// [`Error::Argument`] if the noise is correlated or the prior is not Gaussian.
pub fn bayesian_cramer_rao(system: &System) -> Result<f64, Error> {
    match system.scene().prior() {
        Prior::Gaussian { sd } => Ok(1.0 / (mean_fisher_information(system)? + 1.0 / (sd * sd))),
        Prior::Discrete { .. } => refuse("prior", "a discrete prior", "a smooth prior for the van Trees bound"),
    }
}

/// Least mean squared error of the quadratic Gaussian CEO problem: sensor `n` measures `X + W_n`, independent noise of variance
/// `noise_variances[n]`, and may spend `bits[n]` a sample.
///
/// `D` is achievable if and only if rates `r_n >= 0` (what each sensor says about its own noise) exist with, for every subset
/// `A` of sensors (Oohama 2005; Prabhakaran, Tse and Ramchandran 2004),
///
/// ```text
/// sum_A R_n >= sum_A r_n + 1/2 ln(1/D) - 1/2 ln( 1/s_x^2 + sum_{not A} (1 - exp(-2 r_n)) / s_n^2 ).
/// ```
///
/// All subsets are kept: with unequal noise the sum-rate constraint alone gives a wrong value. The largest `ln(1/D)` is a
/// concave maximin problem in `r`, solved here by a logarithmic barrier; the point reached is feasible, and weak duality bounds
/// how far from the optimum it can be ([`CeoBound::gap`]).
///
/// # Errors
/// If the lengths differ, there are none or more than 12 sensors, a variance is not positive or a rate is negative;
/// [`Error::NotConverged`] if the barrier method ends with a gap above 1e-6.
pub fn ceo(prior_variance: f64, noise_variances: &[f64], bits: &[f64]) -> Result<CeoBound, Error> {
    fewbits_numerics::error::positive("prior_variance", prior_variance)?;
    for s2 in noise_variances {
        fewbits_numerics::error::positive("noise_variance", *s2)?;
    }
    for r in bits {
        fewbits_numerics::error::non_negative("bits", *r)?;
    }
    let n = noise_variances.len();
    if n == 0 || n > CEO_MAX_SENSORS || bits.len() != n {
        let given = format!("{n} noise variances, {} rates", bits.len());
        return refuse("sensors", given, format!("as many of each, 1 to {CEO_MAX_SENSORS}"));
    }
    // A sensor without a budget says nothing.
    let speaking: Vec<usize> = (0..n).filter(|i| bits[*i] > 0.0).collect();
    if speaking.is_empty() {
        return Ok(CeoBound {
            distortion: prior_variance,
            gap: 0.0,
        });
    }
    let problem = Ceo {
        // In units of the prior variance.
        precision: speaking.iter().map(|i| prior_variance / noise_variances[*i]).collect(),
        rate: speaking.iter().map(|i| bits[*i] * std::f64::consts::LN_2).collect(),
    };
    let (tau, above) = problem.solve()?;
    let bound = CeoBound {
        distortion: prior_variance * (-tau).exp(),
        gap: (above - tau).max(0.0),
    };
    if bound.gap <= LARGEST_GAP {
        Ok(bound)
    } else {
        Err(Error::NotConverged {
            algorithm: "CEO barrier",
            iterations: 0,
            change: bound.gap,
        })
    }
}

/// Largest relative gap of a CEO bound that is returned.
const LARGEST_GAP: f64 = 1e-6;

/// The least distortion of a CEO problem, with a certificate of how well it is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CeoBound {
    /// A distortion that codes can attain.
    pub distortion: f64,
    /// No codes can attain less than `distortion * exp(-gap)`; proved by weak duality.
    pub gap: f64,
}

impl CeoBound {
    /// The largest distortion that is proved to be out of reach.
    pub fn lower(&self) -> f64 {
        self.distortion * (-self.gap).exp()
    }
}

struct Ceo {
    precision: Vec<f64>,
    /// Nats.
    rate: Vec<f64>,
}

impl Ceo {
    /// `2 sum_A (R - r) + ln(1 + sum_{not A} (1 - exp(-2 r)) precision)`, its gradient, and the curvature of its logarithm.
    fn constraint(&self, subset: usize, r: &[f64]) -> (f64, DVector<f64>, DVector<f64>, f64) {
        let n = r.len();
        let (mut linear, mut inside) = (0.0, 1.0);
        let (mut gradient, mut bend) = (DVector::zeros(n), DVector::zeros(n));
        for i in 0..n {
            if subset >> i & 1 == 1 {
                linear += 2.0 * (self.rate[i] - r[i]);
                gradient[i] = -2.0;
            } else {
                inside -= self.precision[i] * (-2.0 * r[i]).exp_m1();
                bend[i] = 2.0 * self.precision[i] * (-2.0 * r[i]).exp();
            }
        }
        for i in 0..n {
            gradient[i] += bend[i] / inside;
        }
        (linear + inside.ln(), gradient, bend, inside)
    }

    fn least(&self, r: &[f64]) -> f64 {
        (0..1 << r.len())
            .map(|a| self.constraint(a, r).0)
            .fold(f64::INFINITY, f64::min)
    }

    /// The largest `tau` below all constraints for some `r >= 0`, and a proved upper bound on it.
    fn solve(&self) -> Result<(f64, f64), Error> {
        let n = self.rate.len();
        let mut r: Vec<f64> = self.rate.iter().map(|r| 0.5 * r).collect();
        let mut tau = self.least(&r) - 1.0;
        // Late on the path the slacks have few digits left, and with them the duals: the best certificate may come before.
        let mut above = f64::INFINITY;
        // One nat of slack a constraint at first; small factors keep every point near the central path, away from which the
        // curved constraints allow tiny steps only.
        let mut weight = (1u64 << n) as f64;
        while weight < 4e12 {
            weight *= 2.0;
            for _ in 0..100 {
                let (step, decrement) = self.newton_step(&r, tau, weight)?;
                let mut share = 1.0;
                loop {
                    let trial: Vec<f64> = (0..n).map(|i| r[i] + share * step[i]).collect();
                    let trial_tau = tau + share * step[n];
                    let gain = weight * share * step[n] + self.barrier_change(&r, tau, &trial, trial_tau);
                    // Close to the centre rounding hides the gain, and the full step is safe.
                    if gain > 0.01 * share * decrement || (decrement < 0.1 && gain > f64::NEG_INFINITY) {
                        (r, tau) = (trial, trial_tau);
                        break;
                    }
                    share *= 0.5;
                    if share < 1e-10 {
                        break;
                    }
                }
                if decrement < 1e-6 || share < 1e-10 {
                    break;
                }
            }
            above = above.min(self.upper(&r, tau));
        }
        Ok((self.least(&r), above))
    }

    /// Weak duality: for any weights of the constraints that sum to one, no `r` has all of them above the largest value of
    /// their weighted sum, which being concave is below its tangent at `r`. No rate above a sensor's budget is of use.
    fn upper(&self, r: &[f64], tau: f64) -> f64 {
        let n = r.len();
        let subsets = || (0..1usize << n).map(|subset| self.constraint(subset, r));
        let total: f64 = subsets().map(|c| 1.0 / (c.0 - tau)).sum();
        let (mut bound, mut slope) = (0.0, DVector::zeros(n));
        for (value, gradient, ..) in subsets() {
            let weight = 1.0 / (value - tau) / total;
            bound += weight * value;
            slope += gradient * weight;
        }
        bound + (0..n).map(|i| f64::max(-slope[i] * r[i], slope[i] * (self.rate[i] - r[i]))).sum::<f64>()
    }

    /// Change of the logarithmic barrier from one point to another, formed from ratios so that nothing cancels.
    fn barrier_change(&self, r: &[f64], tau: f64, trial: &[f64], trial_tau: f64) -> f64 {
        if trial.iter().any(|r| *r <= 0.0) {
            return f64::NEG_INFINITY;
        }
        let mut change: f64 = trial.iter().zip(r).map(|(t, r)| (t / r).ln()).sum();
        for subset in 0..1 << r.len() {
            let slack = self.constraint(subset, trial).0 - trial_tau;
            if slack <= 0.0 {
                return f64::NEG_INFINITY;
            }
            change += (slack / (self.constraint(subset, r).0 - tau)).ln();
        }
        change
    }

    /// Newton step of the barrier in `(r, tau)`, and its decrement.
    fn newton_step(&self, r: &[f64], tau: f64, weight: f64) -> Result<(DVector<f64>, f64), Error> {
        let n = r.len();
        let mut gradient = DVector::zeros(n + 1);
        let mut hessian = DMatrix::zeros(n + 1, n + 1);
        gradient[n] = weight;
        for i in 0..n {
            gradient[i] = 1.0 / r[i];
            hessian[(i, i)] = 1.0 / (r[i] * r[i]);
        }
        for subset in 0..1 << n {
            let (value, slope, bend, inside) = self.constraint(subset, r);
            let slack = value - tau;
            let mut full = slope.clone().insert_row(n, -1.0);
            gradient += &full / slack;
            full /= slack;
            hessian += &full * full.transpose();
            for i in 0..n {
                hessian[(i, i)] += 2.0 * bend[i] / (inside * slack);
                for j in 0..n {
                    hessian[(i, j)] += bend[i] * bend[j] / (inside * inside * slack);
                }
            }
        }
        let stalled = Error::NotConverged {
            algorithm: "CEO barrier",
            iterations: 0,
            change: 1.0 / weight,
        };
        let step = hessian.cholesky().ok_or(stalled)?.solve(&gradient);
        let decrement = step.dot(&gradient);
        Ok((step, decrement))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Quantizer, Scene};

    /// Equal sensors: `r + ln(1 + N s_x^2 (1 - e^{-2r}) / s^2) / (2N) = R`, by bisection.
    fn symmetric(sensors: f64, snr: f64, bits: f64) -> f64 {
        let rate = bits * std::f64::consts::LN_2;
        let said = |r: f64| -sensors * snr * (-2.0 * r).exp_m1();
        let (mut low, mut high) = (0.0, rate);
        for _ in 0..200 {
            let r = 0.5 * (low + high);
            if r + said(r).ln_1p() / (2.0 * sensors) < rate {
                low = r
            } else {
                high = r
            }
        }
        1.0 / (1.0 + said(low))
    }

    #[test]
    fn equal_sensors_satisfy_the_sum_rate_equation() {
        for (n, snr, bits) in [
            (2, 1.0, 1.0),
            (3, 0.3, 2.0),
            (9, 1.0, 2.0),
            (5, 4.0, 0.4),
            (1, 1.0, 3.0),
        ] {
            let bound = ceo(2.0, &vec![2.0 / snr; n], &vec![bits; n]).unwrap();
            assert!(bound.gap < 1e-6 && bound.lower() <= bound.distortion, "{bound:?}");
            let found = bound.distortion;
            assert!((found / 2.0 - symmetric(n as f64, snr, bits)).abs() < 1e-11, "{n} {found}");
        }
    }

    #[test]
    fn one_sensor_is_the_remote_source() {
        let one = ceo(1.0, &[0.5], &[2.0]).unwrap().distortion;
        assert!((one - remote_distortion_rate(1.0, 0.5, 2.0).unwrap()).abs() < 1e-11);
        // A silent sensor does not matter.
        assert!((ceo(1.0, &[0.5, 0.1], &[2.0, 0.0]).unwrap().distortion - one).abs() < 1e-15);
        assert_eq!(ceo(1.0, &[0.5], &[0.0]).unwrap().distortion, 1.0);
    }

    #[test]
    fn a_weak_sensor_with_a_large_budget_is_bound_by_its_own_rate() {
        // An unlimited budget leaves only the other's constraint: the bound lies between the extremes.
        let [poor, rich] = [1.0, 12.0].map(|b| ceo(1.0, &[1.0, 0.5], &[b, 2.0]).unwrap().distortion);
        assert!(rich < poor && rich > 1.0 / (1.0 + 1.0 + 2.0));
    }

    #[test]
    fn fine_quantizers_attain_the_information_of_the_sample() {
        let scene = Scene::gaussian(1.0, &[1.0]).unwrap();
        let fine: Vec<f64> = (-600..=600).map(|i| f64::from(i) * 0.02).collect();
        let system = System::ideal(scene, vec![Quantizer::new(fine).unwrap()]).unwrap();
        let j = mean_fisher_information(&system).unwrap();
        assert!(j < 1.0 && j > 0.9999, "{j}");
    }

    #[test]
    fn a_remote_source_in_almost_no_noise_keeps_its_digits() {
        for (noise, bits, exact) in [
            (1e-12_f64, 30.0, 1e-12 + 2f64.powi(-60)),
            (1e-17, 30.0, 1e-17 + 2f64.powi(-60)),
            (1e-17, 0.0, 1.0),
        ] {
            let found = remote_distortion_rate(1.0, noise, bits).unwrap();
            assert!((found / exact - 1.0).abs() < 1e-11, "{noise} {bits}: {found}");
        }
    }

    /// Extreme budgets and noises end with a certified gap or with an error, never silently.
    #[test]
    fn every_ceo_bound_carries_its_certificate() {
        for (variances, bits) in [
            (vec![1e-6, 1.0, 1e6], vec![0.1, 8.0, 3.0]),
            (vec![1.0; 6], vec![1e-3; 6]),
            (vec![1e-9, 1e-9], vec![20.0, 20.0]),
            (vec![0.3, 2.0, 5.0, 0.01], vec![12.0, 0.01, 1.0, 0.5]),
        ] {
            match ceo(1.0, &variances, &bits) {
                Ok(bound) => assert!(bound.gap <= 1e-6 && bound.distortion > 0.0 && bound.distortion < 1.0, "{bound:?}"),
                Err(error) => assert!(matches!(error, Error::NotConverged { .. }), "{error}"),
            }
        }
    }

    #[test]
    fn bad_bounds_are_refused() {
        assert!(remote_distortion_rate(1.0, 0.0, 1.0).is_err());
        assert!(remote_distortion_rate(1.0, 1.0, -1.0).is_err());
        assert!(ceo(1.0, &[], &[]).is_err());
        assert!(ceo(1.0, &[1.0], &[1.0, 1.0]).is_err());
        assert!(ceo(1.0, &[1.0; 13], &[1.0; 13]).is_err());
    }
}
