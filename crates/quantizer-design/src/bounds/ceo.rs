//! The quadratic Gaussian CEO problem: a lower bound for separate sensors with limited rates.

use super::{independent_variances, prior_variance};
use crate::error::{Error, not_converged, refuse};
use crate::observation_model::{Noise, Prior};
use nalgebra::{DMatrix, DVector};

/// Name of the algorithm in errors.
const BARRIER: &str = "CEO barrier";
/// Largest number of sensors: every subset of sensors is a constraint.
const CEO_MAX_SENSORS: usize = 12;

/// Least mean squared error of the quadratic Gaussian CEO problem. Sensor `n` measures `X + W_n` with
/// independent noises and may send `bits[n]` bits per sample.
///
/// A distortion `D` is achievable if and only if there are rates `r_n >= 0` (the rate that each sensor spends on its own noise) with, for
/// every subset `A` of sensors (Oohama 2005; Prabhakaran, Tse and Ramchandran 2004),
///
/// ```text
/// sum_A R_n >= sum_A r_n + 1/2 ln(1/D) - 1/2 ln( 1/s_x^2 + sum_{not A} (1 - exp(-2 r_n)) / s_n^2 ).
/// ```
///
/// All subsets are needed: with unequal noise the sum-rate constraint alone gives a wrong value. The largest `ln(1/D)` is a
/// concave maximin problem in `r`. It is solved by a logarithmic barrier method; the result is feasible, and weak duality bounds
/// its distance from the optimum ([`CeoBound::gap`]).
///
/// # Errors
/// If the prior is not Gaussian, the noise is correlated, there is not one rate per sensor, there are more than 12 sensors, or a
/// rate is negative or not finite;
/// [`Error::NotConverged`] if the barrier method ends with a gap above 1e-6.
pub fn ceo(prior: &Prior, noise: &Noise, bits: &[f64]) -> Result<CeoBound, Error> {
    let prior_variance = prior_variance(prior)?;
    let noise_variances = independent_variances(noise)?;
    for r in bits {
        fewbits_numerics::error::non_negative("bits", *r)?;
    }
    let n = noise_variances.len();
    if n == 0 || n > CEO_MAX_SENSORS || bits.len() != n {
        let given = format!("{n} noise variances, {} rates", bits.len());
        return refuse("sensors", given, format!("as many of each, 1 to {CEO_MAX_SENSORS}"));
    }
    // A sensor of rate zero does not contribute.
    let reporting: Vec<usize> = (0..n).filter(|i| bits[*i] > 0.0).collect();
    if reporting.is_empty() {
        return Ok(CeoBound {
            distortion: prior_variance,
            gap: 0.0,
        });
    }
    let problem = Ceo {
        // From here on in units of the prior variance.
        precision: reporting.iter().map(|i| prior_variance / noise_variances[*i]).collect(),
        rate: reporting.iter().map(|i| bits[*i] * std::f64::consts::LN_2).collect(),
    };
    let (tau, above) = problem.solve()?;
    let bound = CeoBound {
        distortion: prior_variance * (-tau).exp(),
        gap: (above - tau).max(0.0),
    };
    if bound.gap <= MAX_GAP {
        Ok(bound)
    } else {
        Err(not_converged(BARRIER, 0, bound.gap))
    }
}

/// Largest relative gap of a CEO bound that is returned.
const MAX_GAP: f64 = 1e-6;

/// The least distortion of a CEO problem, with a bound of its numerical error.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CeoBound {
    /// A distortion that is achievable.
    pub distortion: f64,
    /// No code achieves less than `distortion * exp(-gap)`, by weak duality.
    pub gap: f64,
}

struct Ceo {
    precision: Vec<f64>,
    /// Rate of each sensor, in nats.
    rate: Vec<f64>,
}

impl Ceo {
    /// `2 sum_A (R - r) + ln(1 + sum_{not A} (1 - exp(-2 r)) precision)`, its gradient, and the curvature of the logarithm in it.
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

    /// The largest `tau` that is below all constraints for some `r >= 0`, and a proved upper bound of it.
    fn solve(&self) -> Result<(f64, f64), Error> {
        let n = self.rate.len();
        let mut r: Vec<f64> = self.rate.iter().map(|r| 0.5 * r).collect();
        let mut tau = self.least(&r) - 1.0;
        // Late in the iteration the slacks, and with them the dual variables, lose digits. The best bound may therefore come from an
        // earlier step.
        let mut above = f64::INFINITY;
        // Start with one nat of slack per constraint. Small factors keep every point near the central path; elsewhere the
        // curved constraints allow only tiny steps.
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
                    // Close to the centre the gain is below rounding, and the full step is safe.
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

    /// Upper bound by weak duality. For any weights of the constraints with sum one, the smallest constraint is at most their weighted sum.
    /// This sum is concave in `r`, so it is below its tangent at `r`. Rates above a sensor's budget are not useful.
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
        bound
            + (0..n)
                .map(|i| f64::max(-slope[i] * r[i], slope[i] * (self.rate[i] - r[i])))
                .sum::<f64>()
    }

    /// Change of the logarithmic barrier between two points, computed from ratios to avoid cancellation.
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

    /// Newton step of the barrier function in `(r, tau)`, and its decrement.
    fn newton_step(&self, r: &[f64], tau: f64, weight: f64) -> Result<(DVector<f64>, f64), Error> {
        let n = r.len();
        let mut gradient = DVector::zeros(n + 1);
        let mut hessian = DMatrix::zeros(n + 1, n + 1);
        gradient[n] = weight;
        for i in 0..n {
            gradient[i] = 1.0 / r[i];
            hessian[(i, i)] = 1.0 / (r[i] * r[i]);
        }
        // Barrier terms: the logarithm of the slack of every subset constraint.
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
        let stalled = || not_converged(BARRIER, 0, 1.0 / weight);
        let step = hessian.cholesky().ok_or_else(stalled)?.solve(&gradient);
        // The Newton decrement bounds the distance of the barrier function from its maximum.
        let decrement = step.dot(&gradient);
        Ok((step, decrement))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bounds::remote_distortion_rate;
    use crate::bounds::tests::{noise_of, unit};

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
            let two = Prior::normal(0.0, 2f64.sqrt()).unwrap();
            let bound = ceo(&two, &noise_of(&vec![2.0 / snr; n]), &vec![bits; n]).unwrap();
            assert!(bound.gap < 1e-6 && bound.gap >= 0.0, "{bound:?}");
            let found = bound.distortion;
            assert!((found / 2.0 - symmetric(n as f64, snr, bits)).abs() < 1e-11, "{n} {found}");
        }
    }

    #[test]
    fn one_sensor_is_the_remote_source() {
        let one = ceo(&unit(), &noise_of(&[0.5]), &[2.0]).unwrap().distortion;
        assert!((one - remote_distortion_rate(&unit(), &noise_of(&[0.5]), 2.0).unwrap()).abs() < 1e-11);
        // A silent sensor does not matter.
        assert!((ceo(&unit(), &noise_of(&[0.5, 0.1]), &[2.0, 0.0]).unwrap().distortion - one).abs() < 1e-15);
        assert_eq!(ceo(&unit(), &noise_of(&[0.5]), &[0.0]).unwrap().distortion, 1.0);
    }

    #[test]
    fn a_weak_sensor_with_a_large_budget_is_bound_by_its_own_rate() {
        // An unlimited budget leaves only the other's constraint: the bound lies between the extremes.
        let [poor, rich] = [1.0, 12.0].map(|b| ceo(&unit(), &noise_of(&[1.0, 0.5]), &[b, 2.0]).unwrap().distortion);
        assert!(rich < poor && rich > 1.0 / (1.0 + 1.0 + 2.0));
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
            match ceo(&unit(), &noise_of(&variances), &bits) {
                Ok(bound) => {
                    assert!(bound.gap <= 1e-6 && bound.distortion > 0.0 && bound.distortion < 1.0, "{bound:?}")
                }
                Err(error) => assert!(matches!(error, Error::NotConverged { .. }), "{error}"),
            }
        }
    }

    #[test]
    fn bad_bounds_are_refused() {
        assert!(ceo(&unit(), &noise_of(&[1.0]), &[1.0, 1.0]).is_err());
        assert!(ceo(&unit(), &noise_of(&[1.0; 13]), &[1.0; 13]).is_err());
        assert!(ceo(&unit(), &noise_of(&[1.0]), &[-1.0]).is_err());
        assert!(ceo(&Prior::binary(1.0, 0.5).unwrap(), &noise_of(&[1.0]), &[1.0]).is_err());
    }
}
