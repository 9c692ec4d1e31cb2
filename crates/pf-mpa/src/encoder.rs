//! How all nodes compute the same quantizer cells for the ranges.

use crate::Error;
use crate::quantized::RangeReference;
use crate::sensor::RangeNoise;
use crate::target::Target;
use fewbits_core::{Gaussian, Sensing};
use fewbits_numerics::error::positive;
use fewbits_numerics::error::refuse;
use fewbits_numerics::{golden, normal};
use serde::{Deserialize, Serialize};

/// Terms of the published normalisation `N_f` (3.13). The last printed term has a wrong unit (erratum `mpa-2`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Normalisation {
    /// `ts V + ts^2 g / 2 + 5 (ts^2 / 2) sigma_v`, as printed.
    #[default]
    Printed,
    /// `ts V + ts^2 g / 2 + 5 (ts^2 / 2) sigma_u`: as printed with the process noise instead of the measurement noise.
    Process,
    /// As [`Process`](Self::Process), plus `5 sigma_v`.
    Robust,
}

/// How the nodes derive the reference of each range from the belief that all of them hold. No bit is sent for it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Encoder {
    /// As published: the centre is the range of the *previous* estimate. The half-width assumes a target of at most this speed.
    Published {
        /// Largest speed `V` of the target, length per time.
        max_speed: f64,
        /// Terms of `N_f`.
        normalisation: Normalisation,
    },
    /// The centre is the range of the *predicted* estimate. The half-width is the published normalisation.
    Predicted {
        /// Largest speed `V` of the target, length per time.
        max_speed: f64,
        /// Terms of `N_f`.
        normalisation: Normalisation,
    },
    /// The centre is the range of the predicted estimate. The half-width is `loading` standard deviations of the innovation:
    /// `N_f = loading sqrt(h' P h + sigma^2)`. See [`optimal_loading`].
    Adaptive {
        /// Standard deviations from the centre to the outermost nominal edge.
        loading: f64,
    },
}

impl Encoder {
    /// [`Encoder::Published`] with the printed normalisation.
    ///
    /// # Errors
    /// If the speed is not above zero.
    pub fn published(max_speed: f64) -> Result<Self, Error> {
        Ok(Self::Published {
            max_speed: positive("max_speed", max_speed)?,
            normalisation: Normalisation::Printed,
        })
    }

    /// [`Encoder::Predicted`] with the printed normalisation.
    ///
    /// # Errors
    /// If the speed is not above zero.
    pub fn predicted(max_speed: f64) -> Result<Self, Error> {
        Ok(Self::Predicted {
            max_speed: positive("max_speed", max_speed)?,
            normalisation: Normalisation::Printed,
        })
    }

    /// [`Encoder::Adaptive`] with [`optimal_loading`] for `levels` cells.
    ///
    /// # Errors
    /// If there are fewer than two levels.
    pub fn adaptive(levels: usize) -> Result<Self, Error> {
        Ok(Self::Adaptive {
            loading: optimal_loading(levels)?,
        })
    }

    /// The published half-width `N_f` at the reference range `range`.
    pub fn normaliser(target: &Target, noise: &RangeNoise, max_speed: f64, which: Normalisation, range: f64) -> f64 {
        let (half, sigma_v) = (0.5 * target.interval() * target.interval(), noise.deviation(range));
        let sigma_u = target.noise_variance().sqrt();
        let reach = target.interval() * max_speed + half * target.chain().magnitude();
        match which {
            Normalisation::Printed => reach + 5.0 * half * sigma_v,
            Normalisation::Process => reach + 5.0 * half * sigma_u,
            Normalisation::Robust => reach + 5.0 * half * sigma_u + 5.0 * sigma_v,
        }
    }

    /// The reference of one sensor, from the estimate of the step before and its prediction. Every node has both.
    ///
    /// # Errors
    /// If centre or half-width is not finite.
    pub fn reference<const D: usize>(
        &self,
        target: &Target,
        sensor: &impl Sensing<D, 1>,
        noise: &RangeNoise,
        previous: &Gaussian<D>,
        predicted: &Gaussian<D>,
    ) -> Result<RangeReference, Error> {
        let about = match self {
            Self::Published { .. } => previous,
            Self::Predicted { .. } | Self::Adaptive { .. } => predicted,
        };
        let centre = sensor.mean(about.mean())[0];
        let half_width = match *self {
            Self::Published {
                max_speed,
                normalisation,
            }
            | Self::Predicted {
                max_speed,
                normalisation,
            } => Self::normaliser(target, noise, max_speed, normalisation, centre),
            // Standard deviation of the innovation: predicted range and noise together.
            Self::Adaptive { loading } => {
                let row = sensor.jacobian(about.mean());
                let spread = (row * about.covariance() * row.transpose())[0].max(0.0);
                loading * libm::hypot(spread.sqrt(), noise.deviation(centre))
            }
        };
        let reference = RangeReference { centre, half_width };
        reference.check()?;
        Ok(reference)
    }
}

/// Standard deviations from the mean to the outermost edge of the uniform quantizer with the least mean squared error for a normal
/// variable: 1.596, 1.991, 2.344, 2.682 for 2, 4, 8, 16 levels.
///
/// # Errors
/// If there are fewer than two levels or more than 65536.
pub fn optimal_loading(levels: usize) -> Result<f64, Error> {
    if !(2..=65_536).contains(&levels) {
        return refuse("levels", levels, "2 to 65536 levels");
    }
    // Mean squared error if each cell is reconstructed by its nominal middle; the cells are symmetric about zero.
    let error = |loading: f64| {
        let width = 2.0 * loading / levels as f64;
        let cell = |q: usize| {
            let lower = if q == 0 {
                f64::NEG_INFINITY
            } else {
                q as f64 * width - loading
            };
            let upper = if q + 1 == levels {
                f64::INFINITY
            } else {
                (q + 1) as f64 * width - loading
            };
            let middle = (q as f64 + 0.5) * width - loading;
            let moments = normal::truncated_moments(lower, upper).ok();
            let squared = moments.map_or(0.0, |m| m.variance + (m.mean - middle) * (m.mean - middle));
            normal::log_interval(lower, upper).exp() * squared
        };
        (0..levels).map(cell).sum::<f64>()
    };
    // The search runs over `-loading`: if errors differ by less than rounding, the largest loading is returned.
    Ok(-golden::maximum(|x| -error(-x), -12.0, -0.5, 1e-10).0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_best_loading_is_the_textbook_one() {
        for (levels, known) in [(2, 1.596), (4, 1.991), (8, 2.344), (16, 2.682)] {
            assert!((optimal_loading(levels).unwrap() - known).abs() < 1e-3, "{levels}");
        }
        // Two levels by hand: twice the mean of a half-normal variable.
        let exact = 2.0 * (2.0 / std::f64::consts::PI).sqrt();
        assert!((optimal_loading(2).unwrap() - exact).abs() < 1e-7);
        assert!(optimal_loading(1).is_err() && optimal_loading(0).is_err() && Encoder::published(0.0).is_err());
    }
}
