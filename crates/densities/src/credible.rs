//! Credible regions of mixtures.

use crate::{Error, Mixture};
use fewbits_core::Gaussian;
use fewbits_numerics::ArgumentError;
use nalgebra::SVector;
use rand::Rng;

/// Level in the open interval from 0 to 1.
fn level(value: f64) -> Result<f64, Error> {
    if value > 0.0 && value < 1.0 {
        Ok(value)
    } else {
        Err(ArgumentError::new("level", value, "a number above 0 and below 1").into())
    }
}

impl Mixture<1> {
    /// The quantile of the given level, to rounding.
    ///
    /// # Errors
    /// If the level is not strictly between 0 and 1.
    pub fn quantile(&self, at: f64) -> Result<f64, Error> {
        level(at)?;
        let edge = |side: f64| {
            let ends = self
                .components()
                .iter()
                .map(|c| c.mean()[0] + side * 40.0 * c.cholesky_factor()[(0, 0)]);
            ends.fold(-side * f64::INFINITY, |m, x| if side < 0.0 { m.min(x) } else { m.max(x) })
        };
        let (mut low, mut high) = (edge(-1.0), edge(1.0));
        // Bisection is as exact as the distribution function and cannot fail; 1100 halvings exhaust any pair of numbers.
        for _ in 0..1100 {
            let middle = 0.5 * low + 0.5 * high;
            if middle <= low || middle >= high {
                break;
            }
            if self.cdf(middle) < at {
                low = middle;
            } else {
                high = middle;
            }
        }
        Ok(high)
    }

    /// The interval with equal probability `(1 - level)/2` on both sides.
    ///
    /// # Errors
    /// If the level is not strictly between 0 and 1.
    pub fn central_interval(&self, at: f64) -> Result<(f64, f64), Error> {
        let tail = 0.5 * (1.0 - level(at)?);
        Ok((self.quantile(tail)?, self.quantile(1.0 - tail)?))
    }
}

/// A region of highest density: all `x` with `ln p(x)` at or above a threshold. The smallest region of its probability, in
/// several pieces if the belief has several modes.
#[derive(Debug, Clone, PartialEq)]
pub struct HighestDensity<const D: usize> {
    belief: Mixture<D>,
    log_threshold: f64,
    level: f64,
}

impl<const D: usize> HighestDensity<D> {
    /// The region of probability `level`. The threshold is the `1 - level` quantile of the density at `draws` draws of the
    /// belief: its coverage has a standard deviation of `sqrt(level (1 - level) / draws)`.
    ///
    /// # Errors
    /// If the level is not strictly between 0 and 1 or there is no draw.
    pub fn new<R: Rng + ?Sized>(rng: &mut R, belief: &Mixture<D>, at: f64, draws: usize) -> Result<Self, Error> {
        level(at)?;
        let sample = belief.sample_systematic(rng, draws)?;
        let mut logs = vec![0.0; draws];
        belief.log_pdf_columns(sample.columns(), &mut logs);
        let rank = (((1.0 - at) * draws as f64) as usize).min(draws - 1);
        let (_, threshold, _) = logs.select_nth_unstable_by(rank, f64::total_cmp);
        Ok(Self {
            log_threshold: *threshold,
            belief: belief.clone(),
            level: at,
        })
    }

    /// Whether the region holds `x`.
    pub fn contains(&self, x: &SVector<f64, D>) -> bool {
        self.belief.log_pdf(x) >= self.log_threshold
    }

    /// The smallest log density inside.
    pub fn log_threshold(&self) -> f64 {
        self.log_threshold
    }

    /// The probability that was asked for.
    pub fn level(&self) -> f64 {
        self.level
    }
}

/// Outline of the ellipse that holds probability `level` of a Gaussian in the plane, as `points` points. Its squared radius in
/// standard deviations is `-2 ln(1 - level)`.
///
/// # Errors
/// If the level is not strictly between 0 and 1 or the covariance is singular.
pub fn ellipse(gaussian: &Gaussian<2>, at: f64, points: usize) -> Result<Vec<[f64; 2]>, Error> {
    let radius = (-2.0 * (-level(at)?).ln_1p()).sqrt();
    let factor = crate::matrix::Factored::new("covariance", gaussian.covariance())?;
    Ok((0..points)
        .map(|k| {
            let (sin, cos) = (std::f64::consts::TAU * k as f64 / points as f64).sin_cos();
            let x = gaussian.mean() + factor.lower * SVector::<f64, 2>::new(radius * cos, radius * sin);
            [x[0], x[1]]
        })
        .collect())
}
