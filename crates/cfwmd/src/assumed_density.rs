//! The Gaussian fusion centre: after each message the belief is the Gaussian with the exact mean and covariance.
//!
//! Tens of times cheaper than a thousand particles and not less accurate in the linear case, hence the default.
//!
//! ```text
//! for each received z:                    Kalman update
//! for each group of n identical, silent, scalar sensors: y = h'x ~ N(m, p)
//!     mean and variance of y under N(y; m, p) pi(y)^n;  carry them to x by the regression of x on y
//! for each silent vector sensor: nu ~ N(mu, V) inside the ellipsoid, mean E and covariance C
//!     K = P H' V^-1;  x += K (E - mu);  P -= K (V - C) K'
//! ```
//! With a lossy link each factor is `loss + (1 - loss) pi`, and the moments are those of a mixture of the belief before and
//! the belief after silence.

use crate::Error;
use crate::ellipsoid::EllipsoidMoments;
use crate::rule::CensoringRule;
use crate::silence::{SilentFactor, check_loss};
use fewbits_core::Gaussian;
use fewbits_models::LinearSensor;
use fewbits_numerics::error::finite;
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::normal;
use nalgebra::{Cholesky, SMatrix, SVector};

/// Moments of a scalar after silence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarMoments {
    /// `ln p(silence)`.
    pub log_mass: f64,
    /// Mean given silence.
    pub mean: f64,
    /// Variance given silence.
    pub variance: f64,
}

/// A silent scalar sensor, or several identical ones, as the fusion centre sees them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScalarSilence {
    /// Middle of the interval of silence (measurement units).
    pub centre: f64,
    /// Half-width `c`.
    pub half_width: f64,
    /// Noise variance `r` of each sensor.
    pub noise_variance: f64,
    /// Probability that the link loses what is sent.
    pub loss: f64,
    /// How many identical sensors are silent.
    pub count: usize,
}

impl ScalarSilence {
    /// Moments of `y ~ N(mean, variance)` given that all `count` sensors, which measure `y + n`, are silent.
    ///
    /// One sensor is a truncated normal in closed form; more are a quadrature of a log-concave function; with loss the
    /// binomial expansion of `(loss + (1 - loss) pi)^count` mixes these.
    ///
    /// # Errors
    /// Arguments out of range; [`Error::ImpossibleSilence`] for an empty interval without loss.
    pub fn moments(&self, mean: f64, variance: f64) -> Result<ScalarMoments, Error> {
        finite("mean", mean)?;
        fewbits_numerics::error::non_negative("variance", variance)?;
        finite("centre", self.centre)?;
        let factor = SilentFactor::new(self.half_width, self.noise_variance, self.loss)?;
        let prior = ScalarMoments {
            log_mass: 0.0,
            mean,
            variance,
        };
        if variance <= 0.0 || self.count == 0 {
            let log_mass = self.count as f64 * factor.log_probability(mean - self.centre);
            return Ok(ScalarMoments { log_mass, ..prior });
        }
        if self.loss == 0.0 {
            return self.inside(mean, variance, self.count);
        }
        // count choose j sensors are truly censored, the others' messages are lost or would have been.
        let log_lost = self.count as f64 * self.loss.ln();
        let mut mixture = ScalarMoments {
            log_mass: log_lost,
            ..prior
        };
        let mut log_share = log_lost;
        for j in 1..=self.count {
            log_share += ((self.count - j + 1) as f64 / j as f64).ln() + (-self.loss).ln_1p() - self.loss.ln();
            if self.half_width > 0.0 {
                let part = self.inside(mean, variance, j)?;
                mixture = mixture.mixed_with(ScalarMoments {
                    log_mass: log_share + part.log_mass,
                    ..part
                });
            }
        }
        Ok(mixture)
    }

    /// Moments under `N(y; mean, variance) pi(y)^count`.
    fn inside(&self, mean: f64, variance: f64, count: usize) -> Result<ScalarMoments, Error> {
        if count == 1 {
            let total = variance + self.noise_variance;
            let deviation = total.sqrt();
            let (low, high) = (
                (self.centre - self.half_width - mean) / deviation,
                (self.centre + self.half_width - mean) / deviation,
            );
            let cell = normal::truncated_moments(low, high)?;
            let gain = variance / total;
            return Ok(ScalarMoments {
                log_mass: normal::log_interval(low, high),
                mean: mean + gain * deviation * cell.mean,
                // p r / s + (p/s)^2 Var(z | cell), free of cancellation.
                variance: gain * self.noise_variance + gain * variance * cell.variance,
            });
        }
        let (p, r) = (variance, self.noise_variance);
        let deviation = r.sqrt();
        let log_density = |y: f64| {
            let mu = y - self.centre;
            let inside = normal::log_interval((-self.half_width - mu) / deviation, (self.half_width - mu) / deviation);
            let d = y - mean;
            count as f64 * inside - 0.5 * d * d / p
        };
        // Nowhere is the integrand narrower than this.
        let narrowest = (1.0 / (1.0 / p + count as f64 / r)).sqrt();
        let spread = p.sqrt();
        // Outside the interval the product of the factors falls at least as fast as a normal density of variance r/count.
        let edge = self.half_width + REACH * deviation / (count as f64).sqrt();
        let mut low = (mean - REACH * spread).max(self.centre - edge);
        let mut high = (mean + REACH * spread).min(self.centre + edge);
        if (mean - self.centre).abs() > self.half_width + 3.0 * (spread + deviation) {
            (low, high) = bulk(log_density, mean, self.centre, narrowest);
        }
        let nodes = (((high - low) / (0.8 * narrowest)).ceil() as usize).clamp(16, MOST_NODES);
        let step = (high - low) / nodes as f64;
        let mut values = [0.0; MOST_NODES + 1];
        let mut largest = f64::NEG_INFINITY;
        for (i, value) in values[..=nodes].iter_mut().enumerate() {
            *value = log_density(low + i as f64 * step);
            largest = largest.max(*value);
        }
        // Trapezoid sums of a smooth function that vanishes at both ends converge exponentially.
        let (mut mass, mut first, mut second) = (0.0, 0.0, 0.0);
        for (i, value) in values[..=nodes].iter().enumerate() {
            let weight = (value - largest).exp();
            let offset = i as f64;
            mass += weight;
            first += weight * offset;
            second += weight * offset * offset;
        }
        let centre = first / mass;
        Ok(ScalarMoments {
            log_mass: largest + (mass * step / spread).ln() - normal::LN_SQRT_2PI,
            mean: low + centre * step,
            variance: (second / mass - centre * centre) * step * step,
        })
    }
}

/// Deviations beyond which less than 3e-12 of a normal mass is left.
const REACH: f64 = 7.0;
/// Largest number of trapezoid intervals; enough for an interval of silence 140 noise deviations wide.
const MOST_NODES: usize = 512;

/// The part of the line that holds the bulk of a log-concave function whose mode lies between `a` and `b`.
fn bulk(f: impl Fn(f64) -> f64, a: f64, b: f64, narrowest: f64) -> (f64, f64) {
    let (mut low, mut high) = (a.min(b), a.max(b));
    for _ in 0..200 {
        if high - low <= 1e-3 * narrowest {
            break;
        }
        let third = (high - low) / 3.0;
        if f(low + third) < f(high - third) {
            low += third;
        } else {
            high -= third;
        }
    }
    let mode = 0.5 * (low + high);
    let floor = f(mode) - 40.0;
    let reach = |direction: f64| {
        let mut step = narrowest;
        while f(mode + direction * step) > floor {
            step *= 1.5;
        }
        mode + direction * step
    };
    (reach(-1.0), reach(1.0))
}

impl ScalarMoments {
    /// The mixture of two parts whose masses include their shares.
    fn mixed_with(self, other: Self) -> Self {
        let (large, small) = if self.log_mass >= other.log_mass {
            (self, other)
        } else {
            (other, self)
        };
        let ratio = (small.log_mass - large.log_mass).exp();
        let share = ratio / (1.0 + ratio);
        let distance = small.mean - large.mean;
        Self {
            log_mass: large.log_mass + ratio.ln_1p(),
            mean: large.mean + share * distance,
            variance: large.variance
                + share * (small.variance - large.variance)
                + share * (1.0 - share) * distance * distance,
        }
    }
}

/// Updates a Gaussian belief with the silence of `count` identical scalar sensors `sensor`. Returns the belief and
/// `ln p(silence)`.
///
/// # Errors
/// As [`ScalarSilence::moments`].
pub fn hear_scalar_silence<const D: usize>(
    belief: &Gaussian<D>,
    row: &SVector<f64, D>,
    silence: &ScalarSilence,
) -> Result<(Gaussian<D>, f64), Error> {
    let cross = belief.covariance() * row;
    let (mean, variance) = (row.dot(belief.mean()), row.dot(&cross));
    let after = silence.moments(mean, variance.max(0.0))?;
    if variance <= 0.0 {
        return Ok((*belief, after.log_mass));
    }
    let gain = cross / variance;
    let shrink = variance - after.variance;
    Ok((
        Gaussian::from_trusted_parts(
            belief.mean() + gain * (after.mean - mean),
            belief.covariance() - gain * gain.transpose() * shrink,
        ),
        after.log_mass,
    ))
}

/// Moments of `nu ~ N(mu, V)` given that nothing arrived: inside the rule's region, or outside and lost.
pub(crate) fn silent_moments<const M: usize>(
    rule: &CensoringRule<M>,
    mu: &SVector<f64, M>,
    covariance: &SMatrix<f64, M, M>,
    loss: f64,
) -> Result<EllipsoidMoments<M>, Error> {
    let inside = if rule.threshold() > 0.0 {
        rule.region().under(covariance)?.moments(mu)
    } else {
        None
    };
    match inside {
        Some(inside) if loss == 0.0 => Ok(inside),
        None if loss == 0.0 => Err(Error::Impossible),
        inside => {
            let share = inside.map_or(0.0, |inside| (1.0 - loss) * inside.log_mass.exp());
            let total = loss + share;
            let weight = share / total;
            let (mean, spread) = inside.map_or((*mu, *covariance), |inside| (inside.mean, inside.covariance));
            let mixed = mu * (1.0 - weight) + mean * weight;
            let (a, b) = (mu - mixed, mean - mixed);
            Ok(EllipsoidMoments {
                log_mass: total.ln(),
                mean: mixed,
                covariance: (covariance + a * a.transpose()) * (1.0 - weight) + (spread + b * b.transpose()) * weight,
            })
        }
    }
}

/// Updates a Gaussian belief with the silence of one sensor of any dimension. `prediction` is what the sensor compared its
/// measurement with. Returns the belief and `ln p(silence)`.
///
/// # Errors
/// [`Error::ImpossibleSilence`] (of sensor 0) for a threshold of zero without loss; loss outside `[0, 1)`.
pub fn hear_silence<const D: usize, const M: usize>(
    belief: &Gaussian<D>,
    sensor: &LinearSensor<D, M>,
    rule: &CensoringRule<M>,
    prediction: &SVector<f64, M>,
    loss: f64,
) -> Result<(Gaussian<D>, f64), Error> {
    check_loss(loss)?;
    if rule.threshold() == 0.0 && loss == 0.0 {
        return Err(Error::ImpossibleSilence { sensor: 0 });
    }
    let matrix = sensor.matrix();
    let cross = belief.covariance() * matrix.transpose();
    let covariance = symmetrised(&(matrix * cross + sensor.noise_covariance()));
    let mu = matrix * belief.mean() - prediction;
    let after = silent_moments(rule, &mu, &covariance, loss)?;
    let factor = Cholesky::new(covariance).ok_or(fewbits_filters::Error::SingularInnovation)?;
    let gain = factor.solve(&cross.transpose()).transpose();
    Ok((
        Gaussian::from_trusted_parts(
            belief.mean() + gain * (after.mean - mu),
            belief.covariance() - gain * (covariance - after.covariance) * gain.transpose(),
        ),
        after.log_mass,
    ))
}
