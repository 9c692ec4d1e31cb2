//! A measurement known to lie in a cell, reported over a link that may lose or invert bits.

use super::{Factor, Scalar, Tilted};
use crate::cell::Cell;
use crate::columns::{Columns, lengths_agree};
use crate::error::Error;
use crate::gaussian::Gaussian;
use crate::observation::Link;
use crate::sign::Sign;
use fewbits_numerics::error::{ArgumentError, positive};
use fewbits_numerics::kernels::{self, scalar};
use fewbits_numerics::normal;
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// `p(observation | m) = floor + share P(m + n in cell)`, `n ~ N(0, r)`.
///
/// | observation | cell | floor | share |
/// |---|---|---|---|
/// | sign bit over a link with arrival `a` and crossover `c` | a half-line | `a c` | `a (1 - 2 c)` |
/// | cell of a quantizer, perfect link | the cell | 0 | 1 |
/// | nothing from a censoring sensor, loss `l` | region of silence | `l` | `1 - l` |
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Numbers", into = "Numbers")]
pub struct InCell {
    cell: Cell,
    variance: f64,
    deviation: f64,
    floor: f64,
    share: f64,
    log_share: f64,
}

/// The stored form of [`InCell`].
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Numbers {
    cell: Cell,
    #[serde(with = "fewbits_numerics::stored")]
    noise_variance: f64,
    #[serde(with = "fewbits_numerics::stored")]
    floor: f64,
    #[serde(with = "fewbits_numerics::stored")]
    share: f64,
}

impl From<InCell> for Numbers {
    fn from(factor: InCell) -> Self {
        Self {
            cell: factor.cell,
            noise_variance: factor.variance,
            floor: factor.floor,
            share: factor.share,
        }
    }
}

impl TryFrom<Numbers> for InCell {
    type Error = ArgumentError;

    fn try_from(parts: Numbers) -> Result<Self, ArgumentError> {
        InCell::new(parts.cell, parts.noise_variance, parts.floor, parts.share)
    }
}

impl InCell {
    /// `floor + share P(m + n in cell)` with noise variance `r`.
    ///
    /// # Errors
    /// If `r` is not positive, `floor` or `share` is negative, their sum exceeds one, or both are zero.
    #[inline]
    pub fn new(cell: Cell, noise_variance: f64, floor: f64, share: f64) -> Result<Self, ArgumentError> {
        positive("noise_variance", noise_variance)?;
        fewbits_numerics::error::within("floor", floor, 0.0, 1.0)?;
        // Rounding of `loss + (1 - loss)` and its like is forgiven.
        fewbits_numerics::error::within("floor + share", floor + share, f64::MIN_POSITIVE, 1.0 + 1e-12)?;
        fewbits_numerics::error::within("share", share, 0.0, 1.0)?;
        Ok(Self {
            cell,
            variance: noise_variance,
            deviation: noise_variance.sqrt(),
            floor,
            share,
            log_share: if share < 1.0 { share.ln() } else { 0.0 },
        })
    }

    /// The measurement lies in `cell`, for sure.
    ///
    /// # Errors
    /// If `r` is not positive.
    pub fn certain(cell: Cell, noise_variance: f64) -> Result<Self, ArgumentError> {
        Self::new(cell, noise_variance, 0.0, 1.0)
    }

    /// A sign bit at `threshold`, received over `link`.
    ///
    /// # Errors
    /// If `threshold` is not finite or `r` not positive.
    #[inline]
    pub fn sign(sign: Sign, threshold: f64, noise_variance: f64, link: &Link) -> Result<Self, ArgumentError> {
        let (arrives, crossover) = (link.arrival(), link.crossover());
        let cell = Cell::of_sign(sign, threshold)?;
        Self::new(cell, noise_variance, arrives * crossover, arrives * (1.0 - 2.0 * crossover))
    }

    /// Nothing from a sensor that is silent if and only if its measurement lies in `cell`, over `link`.
    ///
    /// # Errors
    /// If `r` is not positive.
    pub fn silence(cell: Cell, noise_variance: f64, link: &Link) -> Result<Self, ArgumentError> {
        Self::new(cell, noise_variance, link.loss(), 1.0 - link.loss())
    }

    /// The cell that holds the measurement.
    pub fn cell(&self) -> &Cell {
        &self.cell
    }

    /// Noise variance `r`.
    pub fn noise_variance(&self) -> f64 {
        self.variance
    }

    /// The constant part of the likelihood: its value where the probability of the cell is zero.
    pub fn floor(&self) -> f64 {
        self.floor
    }

    /// The factor of the cell's probability in the likelihood.
    pub fn share(&self) -> f64 {
        self.share
    }

    /// `ln p(observation | m)`.
    #[inline]
    pub fn log_probability(&self, m: f64) -> f64 {
        if self.floor == 0.0 {
            return self.log_share + self.of_cell(m, normal::log_cdf, normal::log_interval);
        }
        (self.floor + self.share * self.of_cell(m, normal::cdf, normal::interval)).ln()
    }

    /// Applies `half_line` to the signed distance of `m` from the only finite edge, positive inside the cell, or `interval` to both edges
    /// minus `m`. All in standard deviations of the noise.
    #[inline]
    fn of_cell(&self, m: f64, half_line: impl Fn(f64) -> f64, interval: impl Fn(f64, f64) -> f64) -> f64 {
        let (lower, upper) = (self.cell.lower(), self.cell.upper());
        if upper == f64::INFINITY {
            half_line((m - lower) / self.deviation)
        } else if lower == f64::NEG_INFINITY {
            half_line((upper - m) / self.deviation)
        } else {
            interval((lower - m) / self.deviation, (upper - m) / self.deviation)
        }
    }

    /// `ln P`, mean and variance of a standard normal variable in `[a, b)`; `None` if the probability underflows.
    #[inline]
    fn standard(a: f64, b: f64) -> Option<(f64, f64, f64)> {
        if b == f64::INFINITY && a == f64::NEG_INFINITY {
            return Some((0.0, 0.0, 1.0));
        }
        if b == f64::INFINITY {
            let above = normal::one_sided(-a);
            return Some((above.log_probability, above.mean, above.variance));
        }
        if a == f64::NEG_INFINITY {
            let below = normal::one_sided(b);
            return Some((below.log_probability, -below.mean, below.variance));
        }
        let inside = normal::truncated_moments(a, b).ok()?;
        Some((inside.log_probability, inside.mean, inside.variance))
    }
}

impl Factor<1> for InCell {
    #[inline]
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        self.log_probability(m[0])
    }

    /// Writes probabilities into a short buffer first and takes logarithms second: each loop runs in vector registers.
    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        const BLOCK: usize = 128;
        if !lengths_agree(means, log_weights) {
            return;
        }
        let (lower, upper) = (self.cell.lower(), self.cell.upper());
        let (scale, floor, share) = (1.0 / self.deviation, self.floor, self.share);
        let constant = if floor > 0.0 { 0.0 } else { self.log_share };
        // A half-line has one finite edge; its probability rises with `m` (`m` above the edge) or falls.
        let cut = if upper == f64::INFINITY {
            Some((lower, scale))
        } else if lower == f64::NEG_INFINITY {
            Some((upper, -scale))
        } else {
            None
        };
        let wide = (upper - lower) * scale >= scalar::WIDE;
        let (mut buffer, mut upper_edges) = ([0.0; BLOCK], [0.0; BLOCK]);
        for (log_weights, means) in log_weights.chunks_mut(BLOCK).zip(means[0].chunks(BLOCK)) {
            let buffer = &mut buffer[..means.len()];
            if let Some((edge, scale)) = cut {
                buffer.iter_mut().zip(means).for_each(|(x, m)| *x = (m - edge) * scale);
                match floor > 0.0 {
                    true => kernels::cdf(buffer),
                    false => kernels::log_cdf(buffer),
                }
            } else {
                let upper_edges = &mut upper_edges[..means.len()];
                for ((low, high), m) in buffer.iter_mut().zip(&mut *upper_edges).zip(means) {
                    (*low, *high) = ((lower - m) * scale, (upper - m) * scale);
                }
                match (floor > 0.0, wide) {
                    (true, false) => kernels::interval(buffer, upper_edges),
                    (true, true) => kernels::interval_wide(buffer, upper_edges),
                    (false, false) => kernels::log_interval(buffer, upper_edges),
                    (false, true) => kernels::log_interval_wide(buffer, upper_edges),
                }
            }
            // With a floor the buffer holds probabilities, otherwise logarithms, which do not underflow far from the cell.
            if floor > 0.0 {
                buffer.iter_mut().for_each(|p| *p = floor + share * *p);
                kernels::ln(buffer);
            }
            let pairs = log_weights.iter_mut().zip(buffer);
            pairs.for_each(|(log_weight, log)| *log_weight += constant + *log);
        }
    }

    fn as_scalar(&self) -> Option<(Scalar, f64)> {
        Some(((*self).into(), 0.0))
    }

    /// The measurement `m + n ~ N(mu, s^2)` with `s^2 = v + r` is truncated to the cell. The posterior of `m` given the cell follows by the
    /// gain `v / s^2`. The result is its mixture with the prior, in proportion to `share P(cell)` and `floor`.
    #[inline]
    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        let (mean, v) = (prior.mean()[0], prior.covariance()[0]);
        let total = v + self.variance;
        let s = total.sqrt();
        let standard = Self::standard((self.cell.lower() - mean) / s, (self.cell.upper() - mean) / s);
        // If the probability of the cell underflows, the observation is attributed to the floor (a bit flip or a loss).
        let out_of_reach = (self.floor > 0.0).then_some((f64::NEG_INFINITY, 0.0, 1.0));
        let (log_inside, inside_mean, inside_variance) = standard.or(out_of_reach).ok_or(Error::Impossible)?;
        // Given `y = m + n`, the mean of `m` is `mean + gain (y - mean)` and its variance `gain r`, whatever `y` is.
        let gain = v / total;
        let shift = gain * s * inside_mean;
        let inside = gain * (self.variance + v * inside_variance);
        if self.floor == 0.0 {
            return Tilted::scalar(self.log_share + log_inside, mean + shift, inside);
        }
        let by_cell = self.share * log_inside.exp();
        let evidence = self.floor + by_cell;
        // Posterior probability that the cell caused the observation; the floor leaves the prior unchanged.
        let blame = by_cell / evidence;
        if blame == 0.0 {
            return Tilted::scalar(evidence.ln(), mean, v);
        }
        // The last term is the variance between the means of the two cases.
        let variance = (1.0 - blame) * v + blame * inside + blame * (1.0 - blame) * shift * shift;
        Tilted::scalar(evidence.ln(), mean + blame * shift, variance)
    }
}
