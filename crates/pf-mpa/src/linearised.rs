//! Gaussian trackers that linearise the range: the extended Kalman filters and Gaussian message passing.

use crate::Error;
use crate::target::{Manoeuvres, Target};
use crate::tracker::{Ranged, StepInfo, Tracker};
use fewbits_core::Gaussian;
use fewbits_numerics::linalg::symmetrised;
use fewbits_numerics::normal::LN_SQRT_2PI;
use nalgebra::{Matrix4, RowVector4, Vector4};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// How a quantized range enters as a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum QuantizationNoise {
    /// The reconstruction is taken for the range. Loses the target where cells are wider than the noise.
    Ignored,
    /// The reconstruction has the additional variance `width^2 / 12`.
    Uniform,
}

/// What a step does with the velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Velocity {
    /// As printed: mean and covariance pass through, no correlation with the position is kept (erratum `mpa-7`). The velocity is then
    /// dead reckoning.
    Transfer,
    /// The position's correction moves the velocity by their correlation.
    Joint,
}

/// A Gaussian belief and linearised ranges.
///
/// ```text
/// predict:  F m, F P F' + G (q + Var a) G'            (Var a only with manoeuvres)
/// update:   R = sigma(d)^2 (+ width^2 / 12), d the predicted range; all ranges linearised at the predicted mean
///           Joseph form, one range after the other
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Linearised {
    /// What manoeuvres count as.
    pub manoeuvres: Manoeuvres,
    /// How a level enters.
    pub quantization: QuantizationNoise,
    /// What becomes of the velocity.
    pub velocity: Velocity,
}

impl Linearised {
    /// Extended Kalman filter that takes reconstructions for ranges.
    pub const EKF_NAIVE: Self = Self {
        manoeuvres: Manoeuvres::Ignored,
        quantization: QuantizationNoise::Ignored,
        velocity: Velocity::Joint,
    };
    /// Extended Kalman filter with quantization noise; of plain ranges, it is the unquantized one.
    pub const EKF: Self = Self {
        quantization: QuantizationNoise::Uniform,
        ..Self::EKF_NAIVE
    };
    /// Gaussian message passing with the full update.
    pub const MESSAGE_PASSING: Self = Self {
        manoeuvres: Manoeuvres::AsNoise,
        ..Self::EKF
    };
    /// Gaussian message passing as printed, velocities transferred.
    pub const MESSAGE_PASSING_TRANSFER: Self = Self {
        velocity: Velocity::Transfer,
        ..Self::MESSAGE_PASSING
    };

    /// Measurement update of a predicted belief; returns `ln p(reconstructions | past)`.
    ///
    /// # Errors
    /// [`fewbits_core::Error::Impossible`] if the result is no number.
    pub fn update(&self, predicted: &Gaussian<4>, observed: &[Ranged]) -> Result<(Gaussian<4>, f64), Error> {
        let mut log_likelihood = 0.0;
        let (about, mut mean, mut covariance) = (*predicted.mean(), *predicted.mean(), *predicted.covariance());
        for range in observed {
            let Some((value, quantization)) = range.factor.reconstruction() else {
                continue;
            };
            let direction = range.sensing.direction(about[0], about[1]);
            let distance = range.sensing.distance(about[0], about[1]);
            let row = RowVector4::new(direction[0], direction[1], 0.0, 0.0);
            let sigma = range.factor.noise().deviation(distance);
            let noise = sigma * sigma
                + match self.quantization {
                    QuantizationNoise::Ignored => 0.0,
                    QuantizationNoise::Uniform => quantization,
                };
            let innovation = value - distance - (row * (mean - about))[0];
            let cross = covariance * row.transpose();
            let spread = (row * cross)[0] + noise;
            if spread.is_nan() || spread <= 0.0 {
                return Err(Error::IMPOSSIBLE);
            }
            let gain = cross / spread;
            let keep = Matrix4::identity() - gain * row;
            mean += gain * innovation;
            covariance = symmetrised(&(keep * covariance * keep.transpose() + gain * gain.transpose() * noise));
            log_likelihood -= 0.5 * innovation * innovation / spread + 0.5 * spread.ln() + LN_SQRT_2PI;
        }
        if self.velocity == Velocity::Transfer {
            (mean, covariance) = transferred(predicted, &mean, &covariance);
        }
        if !mean.iter().chain(covariance.iter()).all(|x| x.is_finite()) {
            return Err(Error::IMPOSSIBLE);
        }
        Ok((Gaussian::from_trusted_parts(mean, covariance), log_likelihood))
    }
}

/// The position's update beside the predicted velocity.
fn transferred(
    predicted: &Gaussian<4>,
    mean: &Vector4<f64>,
    covariance: &Matrix4<f64>,
) -> (Vector4<f64>, Matrix4<f64>) {
    let mut joined = Matrix4::zeros();
    joined
        .fixed_view_mut::<2, 2>(0, 0)
        .copy_from(&covariance.fixed_view::<2, 2>(0, 0));
    joined
        .fixed_view_mut::<2, 2>(2, 2)
        .copy_from(&predicted.covariance().fixed_view::<2, 2>(2, 2));
    let own = predicted.mean();
    (Vector4::new(mean[0], mean[1], own[2], own[3]), joined)
}

impl Tracker for Linearised {
    type Belief = Gaussian<4>;
    type Workspace = ();

    fn start<R: Rng + ?Sized>(&self, _: &mut R, _: &Target, prior: &Gaussian<4>) -> Result<Gaussian<4>, Error> {
        Ok(*prior)
    }

    fn estimate(&self, belief: &Gaussian<4>) -> Gaussian<4> {
        *belief
    }

    fn step_in_place<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        target: &Target,
        k: usize,
        belief: &mut Gaussian<4>,
        observed: &[Ranged],
        (): &mut (),
    ) -> Result<StepInfo, Error> {
        let (next, log_likelihood) = self.update(&target.predict(belief, k, self.manoeuvres), observed)?;
        *belief = next;
        Ok(StepInfo {
            log_likelihood: Some(log_likelihood),
            ..StepInfo::default()
        })
    }
}
