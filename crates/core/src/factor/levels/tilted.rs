//! Moments of a measurement given that its noisy value lies in weighted cells.

use super::{Cells, Levels};
use crate::cell::Cell;
use crate::error::Error;
use crate::factor::moments::tilted_by_quadrature;
use crate::factor::{Factor, Tilted};
use crate::gaussian::Gaussian;
use crate::noise::Noise;
use fewbits_numerics::normal;

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

/// The posterior of `m ~ prior` in noise of variance `r`, given that the measurement lies in the cell: `ln P(cell)`, the shift of the mean
/// and the variance. `None` if the probability underflows.
///
/// The measurement `m + n ~ N(mu, s^2)` with `s^2 = v + r` is truncated to the cell. The posterior of `m` follows by the gain `v / s^2`.
#[inline]
fn inside(cell: &Cell, prior: &Gaussian<1>, r: f64) -> Option<(f64, f64, f64)> {
    let (mean, v) = (prior.mean()[0], prior.covariance()[0]);
    let total = v + r;
    let s = total.sqrt();
    let (log, inside_mean, inside_variance) = standard((cell.lower() - mean) / s, (cell.upper() - mean) / s)?;
    // Given `y = m + n`, the mean of `m` is `mean + gain (y - mean)` and its variance `gain r`, whatever `y` is.
    let gain = v / total;
    Some((log, gain * s * inside_mean, gain * (r + v * inside_variance)))
}

impl Levels {
    /// The posterior of a likelihood with one variance of the noise; closed form. It is the mixture of the posteriors of the cells and of
    /// the prior, in proportion to their evidence.
    #[inline]
    pub(super) fn mixture(&self, prior: &Gaussian<1>, r: f64) -> Result<Tilted<1>, Error> {
        let (mean, v) = (prior.mean()[0], prior.covariance()[0]);
        let (cell, weight) = match &self.cells {
            Cells::None => return Tilted::unchanged(prior, self.log_probability(mean)),
            Cells::One(cell, weight) => (cell, weight),
            Cells::Many(cells) => return self.sum(cells, prior, r),
        };
        // If the probability of the cell underflows, the observation is attributed to the floor (a bit flip or a loss).
        let floor_only = (self.floor > 0.0).then_some((f64::NEG_INFINITY, 0.0, v));
        let (log_inside, shift, variance) = inside(cell, prior, r).or(floor_only).ok_or(Error::Impossible)?;
        if self.floor == 0.0 {
            return Tilted::scalar(self.log_scale + log_inside, mean + shift, variance);
        }
        let by_cell = weight * log_inside.exp();
        let evidence = self.floor + by_cell;
        // Posterior probability that the cell caused the observation; the floor leaves the prior unchanged.
        let share = by_cell / evidence;
        if share == 0.0 {
            return Tilted::scalar(self.log_scale + evidence.ln(), mean, v);
        }
        // The last term is the variance between the means of the two cases.
        let variance = (1.0 - share) * v + share * variance + share * (1.0 - share) * shift * shift;
        Tilted::scalar(self.log_scale + evidence.ln(), mean + share * shift, variance)
    }

    fn sum(&self, cells: &[(Cell, f64)], prior: &Gaussian<1>, r: f64) -> Result<Tilted<1>, Error> {
        let of = |(cell, weight): &(Cell, f64)| {
            let (log, shift, variance) = inside(cell, prior, r)?;
            Some((weight.ln() + log, shift, variance)).filter(|(log, ..)| log.is_finite())
        };
        let floor = (self.floor > 0.0).then(|| (self.floor.ln(), 0.0, prior.covariance()[0]));
        let parts: Vec<(f64, f64, f64)> = cells.iter().filter_map(of).chain(floor).collect();
        let largest = parts.iter().map(|part| part.0).fold(f64::NEG_INFINITY, f64::max);
        if largest == f64::NEG_INFINITY {
            return Err(Error::Impossible);
        }
        let share = |log: f64| (log - largest).exp();
        let total: f64 = parts.iter().map(|(log, ..)| share(*log)).sum();
        let shift = parts.iter().map(|(log, shift, _)| share(*log) * shift).sum::<f64>() / total;
        let spread = |(log, own, variance): &(f64, f64, f64)| share(*log) * (variance + (own - shift) * (own - shift));
        let variance = parts.iter().map(spread).sum::<f64>() / total;
        Tilted::scalar(self.log_scale + largest + total.ln(), prior.mean()[0] + shift, variance)
    }

    /// The posterior by quadrature, for a deviation of the noise that grows with the measurement.
    pub(super) fn by_quadrature(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        match self.as_constant() {
            Some(log) => Tilted::unchanged(prior, log),
            None => tilted_by_quadrature(prior, self.features(), |m, logs| self.add_log_likelihoods(&[m], logs)),
        }
    }

    #[inline]
    pub(super) fn posterior(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        match self.noise {
            Noise::Variance(r) => self.mixture(prior, r),
            Noise::Range(_) => self.by_quadrature(prior),
        }
    }
}
