//! Any scheme with any filter.

use crate::error::Error;
use crate::estimator::{Estimator, gaussian_replica};
use fewbits_core::{Belief, Gaussian, GaussianDynamics, Link, Message, Observation, Observed, Scheme, Sensing};
use fewbits_filters::{MomentFilter, StateFilter};
use nalgebra::SVector;
use rand_pcg::Pcg64Dxsm;

/// Sensors that report by one [`Scheme`], and a filter that receives them.
///
/// The reports of one slot are absorbed one after the other, in the order of the sensors.
#[derive(Debug, Clone)]
pub struct Reporting<const D: usize, const M: usize, G, S, C: Scheme<M>, F: StateFilter<D>, B> {
    /// How the world moves.
    pub dynamics: G,
    /// How each sensor senses it.
    pub sensors: Vec<S>,
    /// What all sensors report, and what that means.
    pub scheme: C,
    /// What is known of the links; see [`Channel::link`](crate::Channel::link).
    pub link: Link,
    /// Who receives them.
    pub filter: F,
    /// From the predicted noise-free measurement to the feedback.
    pub broadcast: B,
    /// What is known before the first slot.
    pub start: F::Belief,
}

impl<const D: usize, const M: usize, G, S, C, F, B> Estimator for Reporting<D, M, G, S, C, F, B>
where
    G: GaussianDynamics<D>,
    S: Sensing<D, M> + Clone,
    C: Scheme<M>,
    C::State: Clone,
    F: StateFilter<D> + Clone,
    B: Fn(&Gaussian<M>) -> C::Feedback,
{
    type Belief = F::Belief;
    type Measurement = SVector<f64, M>;
    type Question = C::Feedback;
    type Report = C::Report;
    type Memory = C::State;

    fn sensors(&self) -> usize {
        self.sensors.len()
    }

    fn start(&self) -> F::Belief {
        self.start.clone()
    }

    fn memory(&self, _: usize) -> C::State {
        self.scheme.start()
    }

    fn predict(&self, rng: &mut Pcg64Dxsm, _: u32, belief: &F::Belief) -> Result<F::Belief, Error> {
        let mut predicted = belief.clone();
        self.filter.clone().predict(rng, &self.dynamics, 1.0, &mut predicted)?;
        Ok(predicted)
    }

    fn question(&self, _: u32, predicted: &F::Belief, sensor: usize) -> Result<C::Feedback, Error> {
        let (mean, covariance) = (predicted.mean(), predicted.covariance());
        let sensor = &self.sensors[sensor];
        let matrix = sensor.jacobian(&mean);
        let expected = Gaussian::from_trusted_parts(sensor.mean(&mean), matrix * covariance * matrix.transpose());
        Ok((self.broadcast)(&expected))
    }

    fn question_format(&self, _: usize) -> <C::Feedback as Message>::Format {
        self.scheme.feedback_format()
    }

    fn report_format(&self, _: usize) -> <C::Report as Message>::Format {
        self.scheme.report_format()
    }

    fn report(
        &self,
        rng: &mut Pcg64Dxsm,
        _: u32,
        _: usize,
        memory: &mut C::State,
        measurement: &SVector<f64, M>,
        question: &C::Feedback,
    ) -> Result<Option<C::Report>, Error> {
        Ok(self.scheme.encode(rng, memory, measurement, question)?)
    }

    fn update(
        &self,
        rng: &mut Pcg64Dxsm,
        slot: u32,
        predicted: &F::Belief,
        observations: &[Option<Observation<C::Report>>],
    ) -> Result<F::Belief, Error> {
        let (mut belief, mut filter) = (predicted.clone(), self.filter.clone());
        let format = self.scheme.feedback_format();
        for (i, (sensor, observation)) in self.sensors.iter().zip(observations).enumerate() {
            let Some(observation) = observation else { continue };
            // The feedback as it travelled.
            let feedback = C::Feedback::from_bits(&format, &self.question(slot, predicted, i)?.to_bits(&format)?)?;
            let factor = self.scheme.factor(&feedback, observation, &self.link)?;
            let observed = Observed::new(sensor.clone(), factor);
            filter.update(rng, &mut belief, &[&observed])?;
        }
        Ok(belief)
    }

    fn mean(&self, belief: &F::Belief) -> Vec<f64> {
        belief.mean().as_slice().to_vec()
    }
}

gaussian_replica!([const D: usize, const M: usize, G, S, C, B] Reporting<D, M, G, S, C, MomentFilter, B>
    where G: GaussianDynamics<D>, S: Sensing<D, M> + Clone, C: Scheme<M>, C::State: Clone, B: Fn(&Gaussian<M>) -> C::Feedback);
