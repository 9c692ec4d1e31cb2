//! World, sensors, link and filter in one call.

use crate::particle::{ParticleFilter, Workspace};
use crate::rao_blackwell::{CloudWorkspace, RaoBlackwellised};
use crate::{Error, PlaneFilter, PointMassFilter, assumed_density, extended_kalman};
use fewbits_core::factor::Scalar;
use fewbits_core::{
    Belief, Dynamics, Factor, Gaussian, GaussianDynamics, Likelihood, LinearDynamics, LinearSensing, Link, Message,
    Observation, Observed, Scheme, Sensing,
};
use fewbits_densities::{GaussianCloud, Particles, PlaneMass, PointMass};
use nalgebra::SVector;
use rand::Rng;

/// A filter as a [`ClosedLoop`] needs it: a time update and a measurement update, both in place. `Model` is what moves the
/// belief, `Observed` what was observed of one sensor.
///
/// Law: a failed `absorb` leaves the belief as it was.
pub trait Filter<const D: usize, Model, Observed> {
    /// What the filter knows.
    type Belief: Belief<D> + Clone;
    /// Buffers kept from step to step.
    type Workspace: Default;

    /// Time update.
    ///
    /// # Errors
    /// Those of the filter.
    fn advance<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        model: &Model,
        belief: &mut Self::Belief,
        workspace: &mut Self::Workspace,
    ) -> Result<(), Error>;

    /// Measurement update; returns `ln p(observed | past)`.
    ///
    /// # Errors
    /// Those of the filter.
    fn absorb<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &mut Self::Belief,
        observed: &Observed,
        workspace: &mut Self::Workspace,
    ) -> Result<f64, Error>;
}

/// The filter of [`assumed_density`] as a value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct AssumedDensity;

impl<const D: usize, const M: usize, G, S, F> Filter<D, G, Observed<S, F, M>> for AssumedDensity
where
    G: GaussianDynamics<D>,
    S: Sensing<D, M>,
    F: Factor<M>,
{
    type Belief = Gaussian<D>;
    type Workspace = ();

    fn advance<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        model: &G,
        belief: &mut Gaussian<D>,
        (): &mut (),
    ) -> Result<(), Error> {
        *belief = extended_kalman::predict(model, belief);
        Ok(())
    }

    fn absorb<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        belief: &mut Gaussian<D>,
        observed: &Observed<S, F, M>,
        (): &mut (),
    ) -> Result<f64, Error> {
        let (next, info) = assumed_density::update_through(belief, observed)?;
        *belief = next;
        Ok(info.log_likelihood)
    }
}

impl<const D: usize, G: Dynamics<D>, L: Likelihood<D>> Filter<D, G, L> for ParticleFilter {
    type Belief = Particles<D>;
    type Workspace = Workspace<D>;

    fn advance<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        model: &G,
        belief: &mut Particles<D>,
        workspace: &mut Workspace<D>,
    ) -> Result<(), Error> {
        self.predict(rng, model, belief, workspace)
    }

    fn absorb<R: Rng + ?Sized>(
        &self,
        _: &mut R,
        belief: &mut Particles<D>,
        observed: &L,
        _: &mut Workspace<D>,
    ) -> Result<f64, Error> {
        Ok(self.update(belief, observed)?.log_likelihood)
    }
}

impl<const D: usize, G, S, F> Filter<D, G, Observed<S, F, 1>> for RaoBlackwellised
where
    G: LinearDynamics<D>,
    S: LinearSensing<D, 1>,
    F: Clone + Into<Scalar>,
{
    type Belief = GaussianCloud<D>;
    type Workspace = CloudWorkspace<D>;

    fn advance<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        model: &G,
        belief: &mut GaussianCloud<D>,
        workspace: &mut CloudWorkspace<D>,
    ) -> Result<(), Error> {
        self.predict(rng, model, belief, workspace)
    }

    fn absorb<R: Rng + ?Sized>(
        &self,
        rng: &mut R,
        belief: &mut GaussianCloud<D>,
        observed: &Observed<S, F, 1>,
        workspace: &mut CloudWorkspace<D>,
    ) -> Result<f64, Error> {
        Ok(self.update(rng, belief, observed, workspace)?.log_likelihood)
    }
}

/// The grid filters hold the kernel of their own dynamics; the model is not consulted.
macro_rules! grid_filter {
    ($dimension:literal, $filter:ty, $belief:ty $(, $parameter:ident: $bound:path)?) => {
        impl<Model, L: Likelihood<$dimension> $(, $parameter: $bound + Clone)?> Filter<$dimension, Model, L> for $filter {
            type Belief = $belief;
            type Workspace = ();

            fn advance<R: Rng + ?Sized>(&self, _: &mut R, _: &Model, belief: &mut $belief, (): &mut ()) -> Result<(), Error> {
                *belief = self.predict(belief)?;
                Ok(())
            }

            fn absorb<R: Rng + ?Sized>(&self, _: &mut R, belief: &mut $belief, observed: &L, (): &mut ()) -> Result<f64, Error> {
                Ok(belief.update(observed)?)
            }
        }
    };
}

grid_filter!(1, PointMassFilter, PointMass);
grid_filter!(2, PlaneFilter<P>, PlaneMass, P: LinearDynamics<2>);

/// Sensors that report by one scheme over one link to a filter that broadcasts what the scheme wants to know.
///
/// ```text
/// step:  x ~ p(x | x);  belief = predict(belief)
///        for each sensor:  feedback = broadcast(N(H mean, H P H'))           (all from the predicted belief)
///                          z ~ p(z | x);  report = encode(z, feedback);  observation = link(report)
///        for each sensor:  belief = update(belief, factor(feedback, observation))
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClosedLoop<'a, G, S, C, F, B> {
    /// How the world moves.
    pub dynamics: &'a G,
    /// How each sensor senses it.
    pub sensors: &'a [S],
    /// What all sensors report, and what that means.
    pub scheme: &'a C,
    /// What the reports cross.
    pub link: Link,
    /// Who receives them.
    pub filter: &'a F,
    /// From the predicted noise-free measurement to the feedback.
    pub broadcast: B,
}

/// What changes from slot to slot.
#[derive(Debug, Clone)]
pub struct LoopState<const D: usize, State, Belief, Workspace> {
    /// The state of the world.
    pub truth: SVector<f64, D>,
    /// What the filter knows of it.
    pub belief: Belief,
    /// What each sensor remembers.
    pub memories: Vec<State>,
    workspace: Workspace,
}

/// What happened in one slot.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Slot<R> {
    /// What was observed of each sensor.
    pub observations: Vec<Observation<R>>,
    /// `ln p(all observations | past)`.
    pub log_likelihood: f64,
    /// Bits of the reports that were sent, lost ones included.
    pub report_bits: usize,
    /// Bits of the feedback to all sensors.
    pub feedback_bits: usize,
}

impl<G, S, C, F, B> ClosedLoop<'_, G, S, C, F, B> {
    /// The loop before its first slot.
    pub fn start<const D: usize, const M: usize>(
        &self,
        truth: SVector<f64, D>,
        belief: F::Belief,
    ) -> LoopState<D, C::State, F::Belief, F::Workspace>
    where
        C: Scheme<M>,
        F: Filter<D, G, Observed<S, C::Factor, M>>,
    {
        LoopState {
            truth,
            belief,
            memories: self.sensors.iter().map(|_| self.scheme.start()).collect(),
            workspace: F::Workspace::default(),
        }
    }

    /// One slot. The world and the link draw from `world`, the filter from `rng`: filters with the same `world` see the same
    /// states and noise.
    ///
    /// # Errors
    /// Those of scheme and filter. The belief is then as it was before the slot; the world has moved on.
    pub fn step<const D: usize, const M: usize, W: Rng + ?Sized, R: Rng + ?Sized>(
        &self,
        world: &mut W,
        rng: &mut R,
        state: &mut LoopState<D, C::State, F::Belief, F::Workspace>,
    ) -> Result<Slot<C::Report>, Error>
    where
        G: Dynamics<D>,
        S: Sensing<D, M> + Clone,
        C: Scheme<M>,
        F: Filter<D, G, Observed<S, C::Factor, M>>,
        B: Fn(&Gaussian<M>) -> C::Feedback,
    {
        let before = state.belief.clone();
        let slot = self.slot(world, rng, state);
        if slot.is_err() {
            state.belief = before;
        }
        slot
    }

    fn slot<const D: usize, const M: usize, W: Rng + ?Sized, R: Rng + ?Sized>(
        &self,
        world: &mut W,
        rng: &mut R,
        state: &mut LoopState<D, C::State, F::Belief, F::Workspace>,
    ) -> Result<Slot<C::Report>, Error>
    where
        G: Dynamics<D>,
        S: Sensing<D, M> + Clone,
        C: Scheme<M>,
        F: Filter<D, G, Observed<S, C::Factor, M>>,
        B: Fn(&Gaussian<M>) -> C::Feedback,
    {
        state.truth = self.dynamics.propagate(world, &state.truth);
        self.filter
            .advance(rng, self.dynamics, &mut state.belief, &mut state.workspace)?;
        let (mean, covariance) = (state.belief.mean(), state.belief.covariance());
        let (report_format, feedback_format) = (self.scheme.report_format(), self.scheme.feedback_format());
        let mut slot = Slot {
            observations: Vec::with_capacity(self.sensors.len()),
            log_likelihood: 0.0,
            report_bits: 0,
            feedback_bits: 0,
        };
        let mut feedbacks = Vec::with_capacity(self.sensors.len());
        for (sensor, memory) in self.sensors.iter().zip(&mut state.memories) {
            let matrix = sensor.jacobian(&mean);
            let predicted = Gaussian::from_trusted_parts(sensor.mean(&mean), matrix * covariance * matrix.transpose());
            let sent = (self.broadcast)(&predicted).to_bits(&feedback_format)?;
            let feedback = C::Feedback::from_bits(&feedback_format, &sent)?;
            slot.feedback_bits += sent.bits();
            let measurement = sensor.sample(world, &state.truth);
            let report = self.scheme.encode(world, memory, &measurement, &feedback)?;
            if let Some(report) = &report {
                slot.report_bits += report.to_bits(&report_format)?.bits();
            }
            let observation = self.link.transmit(world, report.as_ref(), &report_format)?;
            slot.observations.push(observation);
            feedbacks.push(feedback);
        }
        for ((sensor, feedback), observation) in self.sensors.iter().zip(&feedbacks).zip(&slot.observations) {
            let factor = self.scheme.factor(feedback, observation, &self.link)?;
            let observed = Observed::new(sensor.clone(), factor);
            slot.log_likelihood += self
                .filter
                .absorb(rng, &mut state.belief, &observed, &mut state.workspace)?;
        }
        Ok(slot)
    }
}
