//! What a sensor of a centre measures.

use crate::error::Failure;
use fewbits_core::{Gaussian, Sensing};
use nalgebra::{Matrix1, SMatrix, SVector, Vector1};

/// Between the samples 0 and 1 of a switch.
const MIDDLE: f64 = 0.5;

/// `gain * coordinate + offset`, in noise.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Measured {
    /// Coordinate of the state.
    pub(crate) reads: usize,
    pub(crate) gain: f64,
    pub(crate) offset: f64,
    /// Variance of the noise, in the unit of the samples.
    pub(crate) variance: f64,
    /// Whether samples only say on which side of [`MIDDLE`] this is.
    is_switch: bool,
}

impl Measured {
    /// A coordinate itself.
    pub(crate) fn of(reads: usize, variance: f64) -> Self {
        Self {
            reads,
            gain: 1.0,
            offset: 0.0,
            variance,
            is_switch: false,
        }
    }

    /// `gain * coordinate + offset`.
    pub(crate) fn line(reads: usize, variance: f64, gain: f64, offset: f64) -> Self {
        Self {
            gain,
            offset,
            ..Self::of(reads, variance)
        }
    }

    /// A sensor whose samples are 0 and 1 (or -1 and 1): whether the coordinate in noise is above a threshold.
    pub(crate) fn switch(reads: usize, variance: f64, threshold: f64) -> Self {
        Self {
            offset: MIDDLE - threshold,
            is_switch: true,
            ..Self::of(reads, variance)
        }
    }

    /// Whether the state has the coordinate.
    pub(crate) fn check<const D: usize>(&self) -> Result<(), Failure> {
        match self.reads {
            reads if reads >= D => {
                Err(format!("reads is {reads}: expected below {D}, the coordinates of the model").into())
            }
            _ => Ok(()),
        }
    }

    /// The threshold with which a sensor of one bit compares its samples.
    pub(crate) fn asked(&self, predicted: f64) -> f64 {
        if self.is_switch { MIDDLE } else { predicted }
    }

    /// The state whose coordinate is what the sensor measures: a sensor that is told it needs neither gain nor offset.
    pub(crate) fn told<const D: usize>(&self, state: &Gaussian<D>) -> Gaussian<D> {
        let (mut mean, mut covariance) = (*state.mean(), *state.covariance());
        mean[self.reads] = self.gain * mean[self.reads] + self.offset;
        covariance.row_mut(self.reads).scale_mut(self.gain);
        covariance.column_mut(self.reads).scale_mut(self.gain);
        Gaussian::from_trusted_parts(mean, covariance)
    }
}

impl<const D: usize> Sensing<D, 1> for Measured {
    fn mean(&self, state: &SVector<f64, D>) -> Vector1<f64> {
        Vector1::new(self.gain * state[self.reads] + self.offset)
    }

    fn jacobian(&self, _: &SVector<f64, D>) -> SMatrix<f64, 1, D> {
        SMatrix::from_fn(|_, i| if i == self.reads { self.gain } else { 0.0 })
    }

    fn noise_covariance_at(&self, _: &SVector<f64, D>) -> Matrix1<f64> {
        Matrix1::new(self.variance)
    }
}
