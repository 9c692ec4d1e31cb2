//! One Gaussian of a mixture.

use crate::Error;
use fewbits_core::{Columns, Gaussian};
use fewbits_numerics::error::{all_finite, non_negative};
use fewbits_numerics::factored::Factored;
use fewbits_numerics::kernels::vectorised;
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{SMatrix, SVector};
use rand::{Rng, RngExt};
use rand_distr::StandardNormal;

/// One weighted Gaussian of a [`Mixture`](crate::Mixture), with its covariance factored once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Component<const D: usize> {
    pub(super) weight: f64,
    mean: SVector<f64, D>,
    covariance: SMatrix<f64, D, D>,
    factor: Factored<D>,
}

impl<const D: usize> Component<D> {
    /// A component of any weight from 0 up. A [`Mixture`](crate::Mixture) normalises the weights of its components.
    ///
    /// # Errors
    /// If the weight is negative or not finite, the mean is not finite, or the covariance is not symmetric positive definite
    /// (judged with its diagonal scaled to one, so rows may have very different units).
    pub fn new(weight: f64, mean: SVector<f64, D>, covariance: SMatrix<f64, D, D>) -> Result<Self, Error> {
        non_negative("weight", weight)?;
        all_finite("mean", mean.as_slice())?;
        let factor = Factored::new("covariance", &covariance)?;
        Ok(Self {
            weight,
            mean,
            covariance: symmetrised(&covariance),
            factor,
        })
    }

    /// Weight of the component.
    pub fn weight(&self) -> f64 {
        self.weight
    }

    /// Mean.
    pub fn mean(&self) -> &SVector<f64, D> {
        &self.mean
    }

    /// Covariance, positive definite.
    pub fn covariance(&self) -> &SMatrix<f64, D, D> {
        &self.covariance
    }

    /// The component as a Gaussian belief, without its weight.
    pub fn gaussian(&self) -> Gaussian<D> {
        Gaussian::from_trusted_parts(self.mean, self.covariance)
    }

    /// The factored covariance.
    pub fn factor(&self) -> &Factored<D> {
        &self.factor
    }

    /// `ln N(x; mean, covariance)`, without the weight.
    #[inline]
    pub fn log_pdf(&self, x: &SVector<f64, D>) -> f64 {
        -0.5 * self.factor.squared(&(x - self.mean)) - self.factor.half_log_det - D as f64 * LN_SQRT_2PI
    }

    /// Writes `ln w + ln N(x; mean, covariance)` of every point to `out`.
    pub(super) fn log_terms(&self, columns: &Columns<'_, D>, out: &mut [f64]) {
        let offset = self.weight.ln() - self.factor.half_log_det - D as f64 * LN_SQRT_2PI;
        vectorised(
            #[inline(always)]
            || self.factor.log_forms(&self.mean, offset, columns, out),
        );
        // A NaN at a finite point comes from a difference of infinities: the distance overflowed, and the density is zero.
        for (i, log) in out.iter_mut().enumerate().filter(|(_, log)| log.is_nan()) {
            if columns.iter().all(|column| column[i].is_finite()) {
                *log = f64::NEG_INFINITY;
            }
        }
    }

    pub(super) fn draw<R: Rng + ?Sized>(&self, rng: &mut R) -> SVector<f64, D> {
        self.mean + self.factor.lower * SVector::<f64, D>::from_fn(|_, _| rng.sample(StandardNormal))
    }
}
