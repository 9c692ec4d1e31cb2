//! Gaussian trackers that linearise the range: the extended Kalman filters and Gaussian message passing.

use crate::Error;
use crate::target::{Manoeuvres, Target};
use crate::tracker::{Ranged, StepInfo, Tracker};
use fewbits_core::Gaussian;
use fewbits_filters::kalman;
use fewbits_models::LinearSensor;
use nalgebra::{Matrix1, Matrix4, RowVector4, Vector1, Vector4};
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
        let (mut next, mut log_likelihood) = (*predicted, 0.0);
        let about = *predicted.mean();
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
            // The range as a linear function of the state about the predicted mean.
            let sensing = LinearSensor::new(row, Matrix1::new(noise))?;
            let measured = row * about + Vector1::new(value - distance);
            let (updated, info) = kalman::update(&sensing, &next, &measured)?;
            next = updated;
            log_likelihood += info.log_likelihood;
        }
        if self.velocity == Velocity::Transfer {
            next = transferred(predicted, &next);
        }
        if !next.is_finite() {
            return Err(Error::IMPOSSIBLE);
        }
        Ok((next, log_likelihood))
    }
}

/// The position's update beside the predicted velocity.
fn transferred(predicted: &Gaussian<4>, updated: &Gaussian<4>) -> Gaussian<4> {
    let (mean, own) = (updated.mean(), predicted.mean());
    let mut joined = Matrix4::zeros();
    for (at, from) in [(0, updated), (2, predicted)] {
        let block = from.covariance().fixed_view::<2, 2>(at, at);
        joined.fixed_view_mut::<2, 2>(at, at).copy_from(&block);
    }
    Gaussian::from_trusted_parts(Vector4::new(mean[0], mean[1], own[2], own[3]), joined)
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
