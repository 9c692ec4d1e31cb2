//! Fusion without feedback: each sensor compares its measurement with the prediction of its own Kalman filter.
//!
//! The fusion centre does not know those predictions. Silence depends on them, and so does the fact that a value was sent. The
//! belief is therefore joint, over the state and every sensor's own estimate. The paper instead averages the likelihood of silence over
//! estimates that are drawn independently of the past. That average is the same for every state and cancels in the
//! normalisation, so the paper's filter ignores silence (erratum `cfwmd-2`).
//!
//! | estimator | item |
//! |---|---|
//! | joint Gaussian belief with exact moments after each observation; measured as accurate as particles over the withheld measurements | [`joint`] |

pub mod joint;

pub use joint::JointBelief;

use crate::Error;
use crate::network::Network;
use crate::rule::{CensoringRule, OwnRecursion, OwnStep};
use crate::scheme::send_if;
use fewbits_core::{Gaussian, LinearDynamics, LinearSensing, NumberFormat, Observation, Sensing};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{all_finite, non_negative};
use nalgebra::SVector;

/// A sensor that compares each measurement with its own filter's prediction. It updates that filter with every measurement, sent or
/// not; a sent one is first rounded to its format.
///
/// Its silence is a likelihood of the state only if the sensor's estimate is known, as for [`Censoring`](crate::scheme::Censoring). The
/// fusion centre does not know it and carries it in its belief: [`joint`].
#[derive(Debug, Clone, PartialEq)]
pub struct LocalSensor<S, const D: usize, const M: usize> {
    sensing: S,
    threshold: f64,
    format: NumberFormat,
    own: OwnRecursion<D>,
    estimate: SVector<f64, D>,
}

impl<S: LinearSensing<D, M>, const D: usize, const M: usize> LocalSensor<S, D, M> {
    /// A sensor whose filter starts from the belief that all sensors and the fusion centre share.
    ///
    /// # Errors
    /// If the threshold is negative, or `format` is one of a few levels: the centre must follow the sensor's filter exactly.
    pub fn new(sensing: S, threshold: f64, format: NumberFormat, start: &Gaussian<D>) -> Result<Self, Error> {
        non_negative("threshold", threshold)?;
        if matches!(format, NumberFormat::Fixed(_)) {
            return Err(ArgumentError::new("format", format!("{format:?}"), "floating point").into());
        }
        Ok(Self {
            sensing,
            threshold,
            format,
            own: OwnRecursion::new(start),
            estimate: *start.mean(),
        })
    }

    /// The sensor's own estimate of the state.
    pub fn estimate(&self) -> &SVector<f64, D> {
        &self.estimate
    }

    /// Takes one measurement, updates the sensor's filter with it, and returns the value to send; `None` if the sensor is silent.
    ///
    /// # Errors
    /// If the measurement is not finite, or an innovation covariance is not positive definite. The sensor is then unchanged.
    pub fn step(
        &mut self,
        dynamics: &impl LinearDynamics<D>,
        measurement: &SVector<f64, M>,
    ) -> Result<Option<SVector<f64, M>>, Error> {
        let mut own = self.own;
        let step = own.advance(dynamics, &self.sensing, &self.estimate)?;
        let rule = CensoringRule::new(&step.innovation_covariance, self.threshold)?;
        let predicted = dynamics.transition() * self.estimate;
        let prediction = self.sensing.mean(&predicted);
        let report = send_if(&rule, measurement, &prediction, &self.format)?;
        self.estimate = predicted + step.gain * (report.unwrap_or(*measurement) - prediction);
        self.own = own;
        Ok(report)
    }
}

/// Rules and gains of all sensors' own filters in one step.
///
/// # Errors
/// If an innovation covariance is not positive definite.
#[doc(hidden)]
pub fn advance<S: Sensing<D, M> + Clone + PartialEq, const D: usize, const M: usize>(
    recursions: &mut [OwnRecursion<D>],
    network: &Network<S, D, M>,
    dynamics: &impl LinearDynamics<D>,
) -> Result<Vec<(OwnStep<D, M>, CensoringRule<M>)>, Error> {
    let each = recursions.iter_mut().zip(network.sensors()).map(|(recursion, sensor)| {
        let step = recursion.advance(dynamics, sensor, &SVector::zeros())?;
        let rule = CensoringRule::new(&step.innovation_covariance, network.threshold())?;
        Ok((step, rule))
    });
    each.collect()
}

/// Checks that there is one observation per sensor and that all values are finite.
///
/// # Errors
/// If there is not, or one is not.
#[doc(hidden)]
pub fn check<S: Sensing<D, M> + Clone + PartialEq, const D: usize, const M: usize>(
    network: &Network<S, D, M>,
    observations: &[Observation<SVector<f64, M>>],
) -> Result<(), Error> {
    network.count(network.sensors().len(), observations.len())?;
    for value in observations.iter().filter_map(|o| o.received()) {
        all_finite("report", value.as_slice())?;
    }
    Ok(())
}
