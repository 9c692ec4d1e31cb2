//! A Gaussian from the peak of a density: mode and Hessian.

use fewbits_core::Gaussian;
use fewbits_diffusive::Error;
use fewbits_numerics::eigen::symmetric_eigen;
use fewbits_numerics::error::{all_finite, positive};
use nalgebra::{SMatrix, SVector};

/// Largest step of the finite differences, in standard deviations.
const STEP: f64 = 0.05;
/// Limit on the Newton steps.
const STEPS: usize = 100;
/// The search ends if the quadratic model predicts a rise below this, in nats.
const SETTLED: f64 = 1e-13;

fn no_peak<T>(reason: &'static str) -> Result<T, Error> {
    Err(Error::NoPeak { reason })
}

/// The peak of a log density and the curvature there.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak<const D: usize> {
    /// Position of the peak.
    pub mode: SVector<f64, D>,
    /// Log density at the mode.
    pub height: f64,
    /// Negative inverse Hessian at the mode. Mode and this covariance are the Laplace approximation.
    pub covariance: SMatrix<f64, D, D>,
    /// Half the log determinant of the negative Hessian.
    half_log_curvature: f64,
}

impl<const D: usize> Peak<D> {
    /// Finds a peak from `start` by Newton's method with finite differences. `scale` is the approximate extent of the peak along
    /// each coordinate. It sets the first differences and limits the first steps.
    ///
    /// # Errors
    /// [`Error::NoPeak`] if the search does not converge, or the Hessian at its end is not negative definite. A ring, a plateau or a
    /// ridge has no such Gaussian: use cells or a mixture.
    pub fn climb(
        log_density: &impl Fn(&SVector<f64, D>) -> f64,
        start: &SVector<f64, D>,
        scale: &SVector<f64, D>,
    ) -> Result<Self, Error> {
        all_finite("start", start.as_slice())?;
        for s in scale.iter() {
            positive("scale", *s)?;
        }
        let mut x = *start;
        let mut height = log_density(&x);
        if !height.is_finite() {
            return Err(Error::Impossible);
        }
        let mut extent = *scale;
        for _ in 0..STEPS {
            let (gradient, hessian) = derivatives(log_density, &x, height, &(extent * STEP));
            let Some((step, definite)) = ascent(&gradient, &hessian, &extent) else {
                return no_peak("a derivative is not finite");
            };
            // Rise of the log density that the quadratic model predicts.
            let gain = 0.5 * gradient.dot(&step);
            if definite && gain < SETTLED.max(1e-15 * height.abs()) {
                return Self::at(log_density, x, height, extent);
            }
            let mut share = 1.0;
            // Halve the step until the log density rises.
            let climbed = (0..40).find_map(|_| {
                let next = x + step * share;
                let level = log_density(&next);
                share *= 0.5;
                (level > height).then_some((next, level))
            });
            match climbed {
                Some((next, level)) => (x, height) = (next, level),
                None if definite && gain < 1e-6 => return Self::at(log_density, x, height, extent),
                None => return no_peak("no step leads upwards"),
            }
            // Base the next differences on the width of the peak by the present Hessian.
            if definite && let Some(inverse) = (-hessian).cholesky() {
                extent = inverse.inverse().diagonal().map(f64::sqrt);
            }
        }
        no_peak("the search did not settle")
    }

    fn at(
        log_density: &impl Fn(&SVector<f64, D>) -> f64,
        mode: SVector<f64, D>,
        height: f64,
        extent: SVector<f64, D>,
    ) -> Result<Self, Error> {
        let (_, hessian) = derivatives(log_density, &mode, height, &(extent * STEP));
        match (-hessian).cholesky() {
            Some(factor) => Ok(Self {
                mode,
                height,
                covariance: factor.inverse(),
                half_log_curvature: factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum(),
            }),
            None => no_peak("the Hessian is not negative definite"),
        }
    }

    /// The plain Laplace approximation: mode and inverse curvature.
    pub fn gaussian(&self) -> Gaussian<D> {
        Gaussian::from_trusted_parts(self.mode, self.covariance)
    }

    /// Laplace's approximation of the log of the integral of the density.
    pub fn log_evidence(&self) -> f64 {
        self.height - self.half_log_curvature + D as f64 * fewbits_numerics::normal::LN_SQRT_2PI
    }
}

/// Gradient and Hessian by central differences of fourth order.
fn derivatives<const D: usize>(
    f: &impl Fn(&SVector<f64, D>) -> f64,
    x: &SVector<f64, D>,
    middle: f64,
    h: &SVector<f64, D>,
) -> (SVector<f64, D>, SMatrix<f64, D, D>) {
    let shifted = |i: usize, a: f64, j: usize, b: f64| {
        let mut y = *x;
        y[i] += a * h[i];
        y[j] += b * h[j];
        f(&y)
    };
    let mut gradient = SVector::zeros();
    let mut hessian = SMatrix::zeros();
    for i in 0..D {
        let at = |a: f64| shifted(i, a, i, 0.0);
        let (p1, m1, p2, m2) = (at(1.0), at(-1.0), at(2.0), at(-2.0));
        gradient[i] = (8.0 * (p1 - m1) - (p2 - m2)) / (12.0 * h[i]);
        hessian[(i, i)] = (16.0 * (p1 + m1) - (p2 + m2) - 30.0 * middle) / (12.0 * h[i] * h[i]);
        for j in 0..i {
            let cross =
                |s: f64| shifted(i, s, j, s) - shifted(i, s, j, -s) - shifted(i, -s, j, s) + shifted(i, -s, j, -s);
            // Four times the mixed derivative at steps 1 and 2; Richardson's combination cancels the second order.
            let mixed = (16.0 * cross(1.0) - cross(2.0)) / (48.0 * h[i] * h[j]);
            hessian[(i, j)] = mixed;
            hessian[(j, i)] = mixed;
        }
    }
    (gradient, hessian)
}

/// An ascent step, and whether it is Newton's step. Other steps are at most twice the extent.
fn ascent<const D: usize>(
    gradient: &SVector<f64, D>,
    hessian: &SMatrix<f64, D, D>,
    extent: &SVector<f64, D>,
) -> Option<(SVector<f64, D>, bool)> {
    if gradient.iter().chain(hessian.iter()).any(|x| !x.is_finite()) {
        return None;
    }
    // Scaled by the extent, so that coordinates of different units are treated alike.
    let scale = SMatrix::from_diagonal(extent);
    let (g, h) = (extent.component_mul(gradient), scale * hessian * scale);
    let (values, vectors) = symmetric_eigen(-h);
    let largest = values.amax().max(f64::MIN_POSITIVE);
    let definite = values.iter().all(|v| *v > 1e-9 * largest);
    let curvatures = values.map(|v| v.abs().max(1e-9 * largest));
    // The size of each curvature is used, so that the step also ascends where the density curves upwards.
    let mut step = vectors * vectors.tr_mul(&g).component_div(&curvatures);
    let length = step.norm();
    if length > 4.0 {
        step *= 4.0 / length;
    }
    Some((extent.component_mul(&step), definite))
}
