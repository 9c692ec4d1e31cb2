//! A source observed in noise: the conditional mean, and integrals over the observation.

use fewbits_binary_patterns::engine::Kind;
use fewbits_binary_patterns::{Error, Source};
use fewbits_numerics::error::positive;
use fewbits_numerics::normal::{interval, pdf, truncated_moments};
use fewbits_numerics::quadrature::gauss_legendre;

/// Distance from the support, in noise standard deviations, beyond which the density of the measurement is negligible.
const REACH: f64 = 9.0;
/// If the source's width is below this fraction of the noise deviation, the source hardly changes the measurement.
const FAINT: f64 = 3e-6;

/// The measurement `Y = X + N(0, s^2)` and the conditional mean `E[X|Y]`, the best estimate from it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConditionalMean {
    source: Source,
    noise_deviation: f64,
}

impl ConditionalMean {
    /// From the source and the noise of the measurement, which may be an average of several.
    ///
    /// # Errors
    /// If `noise_deviation` is not positive and finite.
    pub fn with_deviation(source: Source, noise_deviation: f64) -> Result<Self, Error> {
        let noise_deviation = positive("noise_deviation", noise_deviation)?;
        Ok(Self {
            source,
            noise_deviation,
        })
    }

    pub(super) fn noise_deviation(&self) -> f64 {
        self.noise_deviation
    }

    /// Density of the measurement.
    pub(super) fn measurement_density(&self, y: f64) -> f64 {
        match self.source.kind() {
            Kind::Uniform { half_width: v } if v < FAINT * self.noise_deviation => {
                pdf(y / self.noise_deviation) / self.noise_deviation
            }
            Kind::Uniform { half_width: v } => {
                interval((-v - y) / self.noise_deviation, (v - y) / self.noise_deviation) / (2.0 * v)
            }
            Kind::Gaussian { deviation } => {
                let total = deviation.hypot(self.noise_deviation);
                pdf(y / total) / total
            }
        }
    }

    /// `(E[X|y], Var[X|y])`: for a uniform source the moments of a normal truncated to `[-V, V]`.
    pub(super) fn moments(&self, y: f64) -> (f64, f64) {
        let s = self.noise_deviation;
        match self.source.kind() {
            // To first order in `v/s`; the ends of the truncation would differ only by rounding.
            Kind::Uniform { half_width: v } if v < FAINT * s => (v / s * (v / s) * y / 3.0, v * v / 3.0),
            Kind::Uniform { half_width: v } => match truncated_moments((-v - y) / s, (v - y) / s) {
                Ok(cell) => (y + s * cell.mean, s * s * cell.variance),
                // Both ends round to one: the limit is the nearest point of the support.
                Err(_) => (y.clamp(-v, v), 0.0),
            },
            Kind::Gaussian { deviation } => {
                let gain = deviation * deviation / (deviation * deviation + s * s);
                (gain * y, gain * s * s)
            }
        }
    }

    /// Half the width of the interval outside which the density of the measurement is negligible.
    pub(super) fn measurement_reach(&self) -> f64 {
        match self.source.kind() {
            Kind::Uniform { half_width } => half_width + REACH * self.noise_deviation,
            Kind::Gaussian { deviation } => REACH * deviation.hypot(self.noise_deviation),
        }
    }

    /// `int_{from}^{to} p_Y(y) f(y, E[X|y], Var[X|y]) dy`.
    pub(super) fn integrate(&self, from: f64, to: f64, mut f: impl FnMut(f64, f64, f64) -> f64) -> f64 {
        let (width, corner) = match self.source.kind() {
            Kind::Uniform { half_width } => (self.noise_deviation, half_width - REACH * self.noise_deviation),
            Kind::Gaussian { deviation } => (deviation.hypot(self.noise_deviation), 0.0),
        };
        // If the noise is far narrower than a uniform source, only the density's two ends are smoothed; between them it is constant.
        let corner = corner.max(0.0);
        let ends = [from, (-corner).clamp(from, to), corner.clamp(from, to), to];
        let mut sum = 0.0;
        for (piece, width) in ends.windows(2).zip([width, width.max(0.25 * corner), width]) {
            if piece[0] < piece[1] {
                let panels = ((piece[1] - piece[0]) / width).ceil() as usize;
                for (y, w) in gauss_legendre::<12>().panels(piece[0], piece[1], panels) {
                    let (mean, variance) = self.moments(y);
                    sum += w * self.measurement_density(y) * f(y, mean, variance);
                }
            }
        }
        sum
    }

    /// `E Var[X|Y]`: the error that the noise alone causes.
    pub fn estimation_error(&self) -> f64 {
        let reach = self.measurement_reach();
        self.integrate(-reach, reach, |_, _, variance| variance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    /// Erratum `binary-9`.
    #[test]
    fn variance_splits_into_estimation_error_and_estimate() {
        let source = Source::uniform(1.0).unwrap();
        for (noise, tolerance) in [
            (1e-12, 1e-11),
            (0.02, 1e-11),
            (0.3, 1e-11),
            (4.0, 1e-11),
            (1e5, 1e-9),
            (1e12, 1e-9),
        ] {
            let y = ConditionalMean::with_deviation(source, noise).unwrap();
            let reach = y.measurement_reach();
            let explained = y.integrate(-reach, reach, |_, mean, _| mean * mean);
            assert_relative_eq!(explained + y.estimation_error(), source.variance(), max_relative = tolerance);
        }
    }
}
