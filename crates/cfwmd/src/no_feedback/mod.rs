//! Fusion without feedback: each sensor compares its measurement with the prediction of its own Kalman filter.
//!
//! The fusion centre does not know those predictions, so silence and even a received value say something about them too. The
//! belief is joint, over the state and every sensor's own estimate; given all observations it is what makes silence
//! informative. The paper averages the silent factor over estimates drawn independently of the past instead; that factor is
//! one constant for every state, cancels in the normalisation and leaves the filter that ignores silence (erratum
//! `cfwmd-2`).
//!
//! | estimator | item |
//! |---|---|
//! | joint Gaussian belief with exact moments after each observation: the default, as accurate as the next in every case measured | [`joint`] |
//! | exact as the number of particles grows: withheld measurements imputed, the rest Gaussian | [`imputing`](crate::published::imputing) |
//! | silence ignored (the paper's CFoMD) | [`fuse_received`](crate::published::fuse_received) |

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

/// A sensor that compares each measurement with its own filter's prediction, and updates that filter with the measurement whether it
/// reports or not (as it travels, if it does).
///
/// What its silence says is a factor of the state only for who knows its estimate, as [`Censoring`](crate::scheme::Censoring) told that
/// estimate. A fusion centre does not: it carries the estimate in its belief, as [`joint`] and
/// [`imputing`](crate::published::imputing) do.
#[derive(Debug, Clone, PartialEq)]
pub struct LocalSensor<S, const D: usize, const M: usize> {
    sensing: S,
    threshold: f64,
    format: NumberFormat,
    own: OwnRecursion<D>,
    estimate: SVector<f64, D>,
}

impl<S: LinearSensing<D, M>, const D: usize, const M: usize> LocalSensor<S, D, M> {
    /// A sensor that starts from the common belief.
    ///
    /// # Errors
    /// If the threshold is negative, or the format one of a few levels (the centre must follow the sensor's filter exactly).
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

    /// Takes one measurement, updates its own filter with it and reports what the rule lets it report.
    ///
    /// # Errors
    /// If the measurement is not finite, or an innovation covariance not positive definite; the sensor is then as it was.
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
pub(crate) fn advance<S: Sensing<D, M> + Clone + PartialEq, const D: usize, const M: usize>(
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

/// Refuses observations of the wrong number or with values that are not finite.
pub(crate) fn check<S: Sensing<D, M> + Clone + PartialEq, const D: usize, const M: usize>(
    network: &Network<S, D, M>,
    observations: &[Observation<SVector<f64, M>>],
) -> Result<(), Error> {
    network.count(network.sensors().len(), observations.len())?;
    for value in observations.iter().filter_map(|o| o.received()) {
        all_finite("report", value.as_slice())?;
    }
    Ok(())
}
