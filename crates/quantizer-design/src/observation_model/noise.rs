//! The noise of all sensors.

use crate::error::{Error, refuse};
use fewbits_numerics::error::entries;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

/// Entries of a covariance matrix are compared to this fraction of its largest entry.
const COVARIANCE_TOLERANCE: f64 = 1e-10;

/// Additive normal noise of all sensors: `a_n U + d_n V_n`, with a shared factor `U`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredNoise")]
pub struct Noise {
    pub(super) loadings: Vec<f64>,
    #[serde(rename = "residual_deviations")]
    pub(super) residuals: Vec<f64>,
}

/// The stored form of [`Noise`].
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct StoredNoise {
    loadings: Vec<f64>,
    residual_deviations: Vec<f64>,
}

impl TryFrom<StoredNoise> for Noise {
    type Error = Error;

    fn try_from(parts: StoredNoise) -> Result<Self, Error> {
        Noise::one_factor_with_deviations(&parts.loadings, &parts.residual_deviations)
    }
}

impl Noise {
    /// Independent noise with the given standard deviations.
    ///
    /// # Errors
    /// If there is no sensor or a standard deviation is not a positive number.
    pub fn independent_with_deviations(deviations: &[f64]) -> Result<Self, Error> {
        Self::one_factor_with_deviations(&vec![0.0; deviations.len()], deviations)
    }

    /// Noise of the given standard deviations and the same correlation between any two sensors. A negative correlation is possible for two
    /// only.
    ///
    /// # Errors
    /// If a standard deviation is not a positive number, `|rho| >= 1`, or `rho < 0` with three sensors or more.
    pub fn equicorrelated_with_deviations(deviations: &[f64], rho: f64) -> Result<Self, Error> {
        if !(rho > -1.0 && rho < 1.0) {
            return refuse("rho", rho, "a correlation inside (-1, 1)");
        }
        if rho < 0.0 && deviations.len() > 2 {
            return Err(Error::UnsupportedCorrelation {
                sensors: deviations.len(),
            });
        }
        let (shared, own) = (rho.abs().sqrt(), (1.0 - rho.abs()).sqrt());
        let sign = |n: usize| if n > 0 && rho < 0.0 { -1.0 } else { 1.0 };
        let loadings: Vec<f64> = deviations
            .iter()
            .enumerate()
            .map(|(n, s)| sign(n) * shared * s)
            .collect();
        let residuals: Vec<f64> = deviations.iter().map(|s| own * s).collect();
        Self::one_factor_with_deviations(&loadings, &residuals)
    }

    /// A shared standard normal factor with the given loadings, plus independent residuals of the given standard deviations.
    ///
    /// # Errors
    /// If there is no sensor, the lengths differ, a loading is not finite or a residual is not a positive number.
    pub fn one_factor_with_deviations(loadings: &[f64], residuals: &[f64]) -> Result<Self, Error> {
        fewbits_numerics::error::at_least_one("sensors", residuals.len())?;
        fewbits_numerics::error::all_finite("loadings", loadings)?;
        for s in residuals {
            fewbits_numerics::error::positive("noise standard deviation", *s)?;
        }
        entries("loadings", loadings.len(), residuals.len())?;
        Ok(Self {
            loadings: loadings.to_vec(),
            residuals: residuals.to_vec(),
        })
    }

    /// Noise with the given covariance matrix, which must be diagonal plus one factor (this is always so for two sensors).
    ///
    /// # Errors
    /// If the matrix is not square, symmetric and finite with positive variances and correlations inside (-1, 1), or
    /// [`Error::UnsupportedCorrelation`] if one factor does not explain it.
    pub fn covariance(matrix: &DMatrix<f64>) -> Result<Self, Error> {
        let n = matrix.nrows();
        if n == 0 || matrix.ncols() != n {
            return refuse("covariance", format!("{n} by {}", matrix.ncols()), "a square matrix");
        }
        fewbits_numerics::error::all_finite("covariance", matrix.as_slice())?;
        for i in 0..n {
            fewbits_numerics::error::positive("variance", matrix[(i, i)])?;
        }
        let deviations: Vec<f64> = (0..n).map(|i| matrix[(i, i)].sqrt()).collect();
        // Correlations have no unit, so sensors of very different units are tested alike.
        let matrix = &DMatrix::from_fn(n, n, |i, j| matrix[(i, j)] / (deviations[i] * deviations[j]));
        let tolerance = COVARIANCE_TOLERANCE;
        if (matrix - matrix.transpose()).amax() > tolerance {
            return refuse("covariance", "not symmetric", "a symmetric matrix");
        }
        if n <= 2 {
            let rho = if n == 2 { matrix[(0, 1)] } else { 0.0 };
            return Self::equicorrelated_with_deviations(&deviations, rho);
        }
        let mut loadings = shared_factor(matrix, tolerance);
        let unsupported = Err(Error::UnsupportedCorrelation { sensors: n });
        let mut residuals = Vec::with_capacity(n);
        for i in 0..n {
            for j in 0..i {
                if (matrix[(i, j)] - loadings[i] * loadings[j]).abs() > tolerance {
                    return unsupported;
                }
            }
            let left = matrix[(i, i)] - loadings[i] * loadings[i];
            if left <= tolerance {
                return unsupported;
            }
            residuals.push(deviations[i] * left.sqrt());
        }
        loadings.iter_mut().zip(&deviations).for_each(|(a, s)| *a *= s);
        Self::one_factor_with_deviations(&loadings, &residuals)
    }

    /// Number of sensors.
    pub(crate) fn sensors(&self) -> usize {
        self.residuals.len()
    }

    /// Standard deviation of sensor `n`'s noise.
    pub fn deviation(&self, n: usize) -> f64 {
        self.loadings[n].hypot(self.residuals[n])
    }

    /// `1' Sigma^-1 1`: the inverse of the smallest variance of a weighted mean of the samples.
    pub(crate) fn precision_of_mean(&self) -> f64 {
        // Sherman and Morrison's formula for a diagonal matrix plus one factor.
        let pairs = || self.loadings.iter().zip(&self.residuals);
        let own: f64 = self.residuals.iter().map(|d| 1.0 / (d * d)).sum();
        let (cross, shared) = pairs().fold((0.0, 1.0), |(c, s), (a, d)| (c + a / (d * d), s + (a / d) * (a / d)));
        own - cross * (cross / shared)
    }

    /// The noise of some of the sensors, in the given order.
    ///
    /// # Errors
    /// If `sensors` is empty or names a sensor that is not there.
    pub(crate) fn subset(&self, sensors: &[usize]) -> Result<Self, Error> {
        if let Some(n) = sensors.iter().find(|n| **n >= self.sensors()) {
            return refuse("sensor", n, format!("a number below {}", self.sensors()));
        }
        let pick = |v: &[f64]| -> Vec<f64> { sensors.iter().map(|n| v[*n]).collect() };
        Self::one_factor_with_deviations(&pick(&self.loadings), &pick(&self.residuals))
    }

    /// The noise multiplied by `factor`.
    pub(crate) fn rescaled(&self, factor: f64) -> Result<Self, Error> {
        let times = |v: &[f64]| -> Vec<f64> { v.iter().map(|x| factor * x).collect() };
        Self::one_factor_with_deviations(&times(&self.loadings), &times(&self.residuals))
    }

    /// The noise whose part of each sensor's own has at least the deviation `least`.
    pub(super) fn at_least(&self, least: f64) -> Result<Self, Error> {
        let residuals: Vec<f64> = self.residuals.iter().map(|d| d.max(least)).collect();
        Self::one_factor_with_deviations(&self.loadings, &residuals)
    }

    /// Whether the noises of the sensors are independent.
    pub fn is_independent(&self) -> bool {
        self.sensors() == 1 || self.loadings.iter().filter(|a| **a != 0.0).count() < 2
    }
}

/// Loadings of one factor that explain the off-diagonal entries, if there are such: from the largest entry and a suitable third sensor.
fn shared_factor(matrix: &DMatrix<f64>, tolerance: f64) -> Vec<f64> {
    let n = matrix.nrows();
    let pairs = (0..n).flat_map(|i| (0..i).map(move |j| (i, j)));
    let size = |i: usize, j: usize| matrix[(i, j)].abs();
    let Some((p, q)) = pairs.max_by(|a, b| size(a.0, a.1).total_cmp(&size(b.0, b.1))) else {
        return vec![0.0; n];
    };
    if size(p, q) <= tolerance {
        return vec![0.0; n];
    }
    let third = (0..n)
        .filter(|r| *r != p && *r != q && size(p, *r).min(size(q, *r)) > tolerance)
        .max_by(|a, b| size(p, *a).min(size(q, *a)).total_cmp(&size(p, *b).min(size(q, *b))));
    let mut loadings = vec![0.0; n];
    match third {
        Some(r) => {
            // With one factor each entry is a product of two loadings, so three entries give the square of one.
            let square = matrix[(p, q)] * matrix[(p, r)] / matrix[(q, r)];
            let pivot = square.max(0.0).sqrt();
            if pivot > 0.0 {
                for j in 0..n {
                    loadings[j] = matrix[(p, j)] / pivot;
                }
            }
            loadings[p] = pivot;
        }
        None => {
            // Only this pair is correlated: both loadings are in proportion to the standard deviations.
            let ratio = (matrix[(p, p)] / matrix[(q, q)]).sqrt().sqrt();
            let root = size(p, q).sqrt();
            (loadings[p], loadings[q]) = (root * ratio, root / ratio * matrix[(p, q)].signum());
        }
    }
    loadings
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation_model::{ObservationModel, Prior};

    #[test]
    fn covariances_of_one_factor_are_found() {
        let (a, d) = ([0.5, -0.3, 0.8, 0.0], [0.4, 0.5, 0.6, 0.7]);
        let matrix = DMatrix::from_fn(4, 4, |i, j| a[i] * a[j] + if i == j { d[i] * d[i] } else { 0.0 });
        let noise = Noise::covariance(&matrix).unwrap();
        for i in 0..4 {
            assert!((noise.deviation(i) - matrix[(i, i)].sqrt()).abs() < 1e-12);
            for j in 0..i {
                assert!((noise.loadings[i] * noise.loadings[j] - matrix[(i, j)]).abs() < 1e-12);
            }
        }
        let pair = DMatrix::from_row_slice(3, 3, &[1.0, -0.4, 0.0, -0.4, 4.0, 0.0, 0.0, 0.0, 1.0]);
        let noise = Noise::covariance(&pair).unwrap();
        assert!((noise.loadings[0] * noise.loadings[1] + 0.4).abs() < 1e-12);
        assert!(noise.loadings[2] == 0.0);
    }

    #[test]
    fn what_one_factor_cannot_explain_is_refused() {
        let chain = DMatrix::from_row_slice(3, 3, &[1.0, 0.5, 0.0, 0.5, 1.0, 0.5, 0.0, 0.5, 1.0]);
        assert!(matches!(Noise::covariance(&chain), Err(Error::UnsupportedCorrelation { sensors: 3 })));
        assert!(matches!(
            Noise::equicorrelated_with_deviations(&[1.0; 3], -0.2),
            Err(Error::UnsupportedCorrelation { .. })
        ));
        for rho in [1.0, -1.0, f64::NAN] {
            assert!(
                Noise::equicorrelated_with_deviations(&[1.0, 1.0], rho)
                    .unwrap_err()
                    .to_string()
                    .contains("rho")
            );
        }
        assert!(Noise::independent_with_deviations(&[1.0, 0.0]).is_err());
        assert!(Noise::independent_with_deviations(&[]).is_err());
        assert!(Prior::discrete(vec![0.0, 1.0], vec![0.4, 0.4]).is_err());
        assert!(Prior::discrete(vec![0.0], vec![0.4, 0.6]).is_err());
        assert!(Prior::binary(1.0, 1.5).is_err());
        assert!(matches!(ObservationModel::gaussian_with_deviations(1.0, &[1e-9]), Err(Error::TooLarge { .. })));
    }
}
