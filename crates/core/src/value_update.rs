//! The update of a Gaussian by a value: the closed form for a value in Gaussian noise, in Joseph form.

use crate::assumed_density::with_rounding;
use crate::error::Error;
use crate::gaussian::Gaussian;
use fewbits_numerics::error::all_finite;
use fewbits_numerics::linalg::{congruence, congruence_of, times_transposed};
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{Cholesky, SMatrix, SVector};

/// Results of an update other than the new belief.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct KalmanInfo<const D: usize, const M: usize> {
    /// Innovation: measurement minus its prediction.
    pub innovation: SVector<f64, M>,
    /// Covariance `S = H P H' + R` of the innovation.
    pub innovation_covariance: SMatrix<f64, M, M>,
    /// Kalman gain `K = P H' S^-1`.
    pub gain: SMatrix<f64, D, M>,
    /// `ln N(innovation; 0, S)`, the increment of the log-likelihood of the data.
    pub log_likelihood: f64,
    /// Normalised innovation squared, `innovation' S^-1 innovation / M`: expectation 1 for a consistent filter.
    pub normalised_innovation_squared: f64,
}

/// The update with the matrices `H` and `R` by a measurement and its innovation, which a curved sensor forms by its own prediction.
///
/// # Errors
/// As the Kalman filter of `fewbits-filters`, which documents it.
#[inline(always)]
pub fn update<const D: usize, const M: usize>(
    matrix: &SMatrix<f64, M, D>,
    noise: &SMatrix<f64, M, M>,
    belief: &Gaussian<D>,
    measurement: &SVector<f64, M>,
    innovation: SVector<f64, M>,
) -> Result<(Gaussian<D>, KalmanInfo<D, M>), Error> {
    let cross = times_transposed(belief.covariance(), matrix);
    let innovation_covariance = congruence_of(matrix, &cross) + noise;
    let lower = Cholesky::new(innovation_covariance)
        .ok_or(Error::SingularInnovation)?
        .unpack();
    let roots = lower.diagonal();
    let gain = over(&cross, &lower);
    // The Joseph form costs two congruences, so it is taken only where the difference may cancel.
    let covariance = if is_mild(roots.as_slice(), noise) {
        less_product(belief.covariance(), &gain, &cross)
    } else {
        let keep = SMatrix::<f64, D, D>::identity() - times_transposed(&gain, &matrix.transpose());
        let joseph = congruence(&keep, belief.covariance()) + congruence(&gain, noise);
        with_rounding(joseph, &keep, belief)
    };
    // innovation' S^-1 innovation, and with it and det S the density N(innovation; 0, S).
    let squared = innovation.dot(&over(&innovation.transpose(), &lower).transpose());
    // No entry of the posterior exceeds this sum (Cauchy and Schwarz), and zero times a number is zero. The range check of the root, which
    // its logarithm needs in any case, therefore tests all entries at once.
    let root: f64 = roots.iter().product();
    let numbers = 0.0 * (squared + belief.mean().abs().sum() + belief.covariance().trace());
    let log_root_determinant = if (root + numbers).is_normal() {
        root.ln()
    } else {
        log_product(roots.as_slice(), numbers, measurement.as_slice())?
    };
    let info = KalmanInfo {
        innovation,
        innovation_covariance,
        gain,
        log_likelihood: -0.5 * squared - log_root_determinant - M as f64 * LN_SQRT_2PI,
        normalised_innovation_squared: squared / M as f64,
    };
    Ok((Gaussian::from_symmetric_parts(belief.mean() + gain * innovation, covariance), info))
}

/// `ln` of a product of positive numbers that overflows or underflows. `numbers` is zero or NaN; NaN gives an error.
#[cold]
fn log_product(factors: &[f64], numbers: f64, measurement: &[f64]) -> Result<f64, Error> {
    all_finite("measurement", measurement)?;
    let log: f64 = factors.iter().map(|x| x.ln()).sum();
    if (log + numbers).is_finite() {
        return Ok(log);
    }
    let what = "the posterior (from the belief, the sensing model or the measurement)";
    Err(Error::NotANumber { what })
}

/// `a (l l')^-1` for a lower triangular `l`, with one division per column of `l`.
#[inline(always)]
fn over<const D: usize, const M: usize>(a: &SMatrix<f64, D, M>, l: &SMatrix<f64, M, M>) -> SMatrix<f64, D, M> {
    // The result `x` solves `x l = y` with `y l' = a`: first `y` from the first column on, then `x` from the last.
    let mut out = *a;
    let reciprocals = SVector::<f64, M>::from_fn(|k, _| 1.0 / l[(k, k)]);
    for k in 0..M {
        for j in 0..k {
            for i in 0..D {
                out[(i, k)] -= l[(k, j)] * out[(i, j)];
            }
        }
        (0..D).for_each(|i| out[(i, k)] *= reciprocals[k]);
    }
    for k in (0..M).rev() {
        for j in k + 1..M {
            for i in 0..D {
                out[(i, k)] -= l[(j, k)] * out[(i, j)];
            }
        }
        (0..D).for_each(|i| out[(i, k)] *= reciprocals[k]);
    }
    out
}

/// Largest `det S / det R` for which `P - K S K'` loses at most two digits of any variance.
const MILD: f64 = 100.0;

/// Whether one or two measurements reduce the variances little enough for this; `roots` is the diagonal of the factor of `S`.
fn is_mild<const M: usize>(roots: &[f64], noise: &SMatrix<f64, M, M>) -> bool {
    let noise = match M {
        1 => noise[(0, 0)],
        2 => noise[(0, 0)] * noise[(1, 1)] - noise[(1, 0)] * noise[(0, 1)],
        _ => return false,
    };
    let root: f64 = roots.iter().product();
    root * root < MILD * noise
}

/// `p - a b'` for a symmetric result, symmetric to the last bit.
#[inline(always)]
fn less_product<const D: usize, const M: usize>(
    p: &SMatrix<f64, D, D>,
    a: &SMatrix<f64, D, M>,
    b: &SMatrix<f64, D, M>,
) -> SMatrix<f64, D, D> {
    let mut out = *p;
    for j in 0..D {
        for i in j..D {
            let product: f64 = (0..M).map(|k| a[(i, k)] * b[(j, k)]).sum();
            out[(i, j)] -= product;
            out[(j, i)] = out[(i, j)];
        }
    }
    out
}
