//! Gaussian trackers that linearise the range: the extended Kalman filters and Gaussian message passing.

use crate::pf_mpa::target::Manoeuvres;
use crate::pf_mpa::tracker::{GaussianTracker, Ranged, Step, StepInfo};
use fewbits_core::Gaussian;
use fewbits_filters::kalman;
use fewbits_models::LinearSensor;
use fewbits_pf_mpa::Error;
use nalgebra::{Matrix1, Matrix4, RowVector4, Vector1, Vector2, Vector4};
use rand::Rng;
use serde::{Deserialize, Serialize};

/// How a linearised tracker uses a quantized range.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum QuantizationNoise {
    /// The reconstruction is used as if it were the range. The tracker loses the target if cells are wider than the noise.
    Ignored,
    /// The reconstruction is used with the additional variance `width^2 / 12`.
    Uniform,
}

/// How a measurement update changes the velocity.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Velocity {
    /// As printed: mean and covariance of the velocity are unchanged, and its correlation with the position is dropped (erratum `mpa-7`).
    /// The velocity is then never corrected.
    Transfer,
    /// The correction of the position changes the velocity by their correlation.
    Joint,
}

/// A tracker with a Gaussian belief and linearised ranges.
///
/// ```text
/// predict:  F m, F P F' + G (q + Var a) G'            (Var a only with manoeuvres)
/// update:   R = sigma(d)^2 (+ width^2 / 12), d the predicted range; all ranges linearised at the predicted mean
///           Joseph form, one range after the other
/// ```
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Linearised {
    /// How manoeuvres enter the prediction.
    pub manoeuvres: Manoeuvres,
    /// How a quantized range is used.
    pub quantization: QuantizationNoise,
    /// How the velocity is updated.
    pub velocity: Velocity,
}

impl Linearised {
    /// Extended Kalman filter that uses reconstructions as if they were ranges.
    pub const EKF_NAIVE: Self = Self {
        manoeuvres: Manoeuvres::Ignored,
        quantization: QuantizationNoise::Ignored,
        velocity: Velocity::Joint,
    };
    /// Extended Kalman filter with quantization noise. With unquantized ranges it is the usual extended Kalman filter.
    pub const EKF: Self = Self {
        quantization: QuantizationNoise::Uniform,
        ..Self::EKF_NAIVE
    };
    /// Gaussian message passing with the full update.
    pub const MESSAGE_PASSING: Self = Self {
        manoeuvres: Manoeuvres::AsNoise,
        ..Self::EKF
    };
    /// Gaussian message passing as printed: the velocity is not corrected.
    pub const MESSAGE_PASSING_TRANSFER: Self = Self {
        velocity: Velocity::Transfer,
        ..Self::MESSAGE_PASSING
    };

    /// Measurement update of a predicted belief, with `ln p(reconstructions | past)`.
    ///
    /// # Errors
    /// If a range is not finite.
    pub fn update(&self, predicted: &Gaussian<4>, observed: &[Ranged]) -> Result<(Gaussian<4>, StepInfo), Error> {
        let (mut next, mut log_likelihood) = (*predicted, 0.0);
        let about = *predicted.mean();
        for range in observed.iter().filter_map(|range| LinearRange::at(range, about.xy())) {
            let quantization = match self.quantization {
                QuantizationNoise::Ignored => 0.0,
                QuantizationNoise::Uniform => range.quantization_variance,
            };
            let row = RowVector4::new(range.direction[0], range.direction[1], 0.0, 0.0);
            let sensing = LinearSensor::new(row, Matrix1::new(range.noise_variance + quantization))?;
            let measured = row * about + Vector1::new(range.innovation);
            let (updated, info) = kalman::update(&sensing, &next, &measured)?;
            next = updated;
            log_likelihood += info.log_likelihood;
        }
        if self.velocity == Velocity::Transfer {
            next = transferred(predicted, &next);
        }
        Ok((next, StepInfo::of(log_likelihood)))
    }
}

/// A range linearised in the position about some place.
pub(crate) struct LinearRange {
    /// Gradient of the distance with respect to the position.
    pub(crate) direction: Vector2<f64>,
    /// The reconstruction minus the distance at the place.
    pub(crate) innovation: f64,
    pub(crate) noise_variance: f64,
    pub(crate) quantization_variance: f64,
}

impl LinearRange {
    pub(crate) fn at(range: &Ranged, place: Vector2<f64>) -> Option<Self> {
        let (value, quantization_variance) = range.factor.reconstruction()?;
        let distance = range.sensing.distance(place[0], place[1]);
        let deviation = range.factor.noise().deviation(distance);
        Some(Self {
            direction: range.sensing.direction(place[0], place[1]),
            innovation: value - distance,
            noise_variance: deviation * deviation,
            quantization_variance,
        })
    }
}

/// The updated position with the predicted velocity, uncorrelated.
fn transferred(predicted: &Gaussian<4>, updated: &Gaussian<4>) -> Gaussian<4> {
    let (mean, own) = (updated.mean(), predicted.mean());
    let mut joined = Matrix4::zeros();
    for (at, from) in [(0, updated), (2, predicted)] {
        let block = from.covariance().fixed_view::<2, 2>(at, at);
        joined.fixed_view_mut::<2, 2>(at, at).copy_from(&block);
    }
    Gaussian::from_trusted_parts(Vector4::new(mean[0], mean[1], own[2], own[3]), joined)
}

impl GaussianTracker for Linearised {
    type Workspace = ();

    fn advance<R: Rng>(&self, _: &mut R, step: Step<'_>, (): &mut ()) -> Result<(Gaussian<4>, StepInfo), Error> {
        self.update(&step.predicted(self.manoeuvres), step.observed)
    }
}
