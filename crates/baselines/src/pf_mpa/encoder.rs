//! How all nodes compute the same quantizer cells for the ranges.

use crate::pf_mpa::target::Target;
use fewbits_core::{Gaussian, Sensing};
use fewbits_numerics::error::{finite, positive};
use fewbits_pf_mpa::Error;
use fewbits_pf_mpa::{RangeNoise, RangeReference, optimal_loading};
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
        finite("centre", centre)?;
        positive("half_width", half_width)?;
        Ok(RangeReference { centre, half_width })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_must_be_positive() {
        assert!(Encoder::published(0.0).is_err() && Encoder::predicted(-1.0).is_err());
    }
}
