//! Densities of forms that another crate adds.

use crate::search_box::SearchBox;
use fewbits_core::Gaussian;
use nalgebra::{SVector, Vector2};
use std::fmt::Debug;

/// A density of an added form over the position (`D` = 2), or over position and rate (`D` = 3).
pub trait AddedDensity<const D: usize>: Debug + Send + Sync {
    /// Mean and covariance.
    fn gaussian(&self) -> Gaussian<D>;

    /// A box of the position that contains the density.
    fn bounds(&self) -> SearchBox;

    /// Log density.
    fn log_density(&self, x: &SVector<f64, D>) -> f64;

    /// Log density, and the logarithm of an upper bound within `half_width` of `x` in every coordinate. `scratch` is a buffer.
    fn log_density_and_bound(&self, x: &SVector<f64, D>, half_width: f64, scratch: &mut Vec<f64>) -> (f64, f64);

    /// Moments of the rate `t` in a range at a place: of the density times `exp(-(energy - 2 correlation t + response t^2) / 2)`, with
    /// `sums` the response, correlation and energy. If `half_width` is positive, of an upper bound within that distance of the place.
    fn rate(&self, place: &Vector2<f64>, half_width: f64, sums: [f64; 3], range: [f64; 2]) -> SliceMoments;

    /// What a message says: the two numbers of five bits, and the others.
    fn numbers(&self) -> (usize, usize, Vec<f64>);
}

/// Integral, mean and variance of a density along the rate, times a likelihood.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SliceMoments {
    /// Logarithm of the integral.
    pub log_mass: f64,
    /// Mean.
    pub mean: f64,
    /// Variance.
    pub variance: f64,
}

impl SliceMoments {
    /// No mass in this range.
    pub fn nothing([low, high]: [f64; 2]) -> Self {
        Self {
            log_mass: f64::NEG_INFINITY,
            mean: 0.5 * (low + high),
            variance: 0.0,
        }
    }
}
