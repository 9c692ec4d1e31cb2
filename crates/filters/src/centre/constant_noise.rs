//! The measurement noise of a scheme that states none.

use fewbits_core::rand::Rng;
use fewbits_core::{Deterministic, Error, Link, MeasurementNoise, Message, Observation, Scheme};
use nalgebra::{SMatrix, SVector};

/// A scheme with the covariance of the measurement noise that its likelihoods assume, the same for all measurements. It makes a scheme that does
/// not implement [`MeasurementNoise`] one that can [join](super::FusionCentre::join): one on a circle for example, whose sensing model is not
/// linear.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ConstantNoise<C, const M: usize> {
    /// The scheme.
    pub scheme: C,
    /// Covariance of the measurement noise. A centre compares it with that of the sensing model.
    pub noise: SMatrix<f64, M, M>,
}

impl<C, const M: usize> MeasurementNoise<M> for ConstantNoise<C, M> {
    fn noise_covariance_at(&self, _: &SVector<f64, M>) -> SMatrix<f64, M, M> {
        self.noise
    }
}

impl<C: Deterministic<M>, const M: usize> Deterministic<M> for ConstantNoise<C, M> {}

impl<C: Scheme<M>, const M: usize> Scheme<M> for ConstantNoise<C, M> {
    type State = C::State;
    type Feedback = C::Feedback;
    type Report = C::Report;
    type Factor = C::Factor;

    fn start(&self) -> Self::State {
        self.scheme.start()
    }

    fn feedback_format(&self) -> <Self::Feedback as Message>::Format {
        self.scheme.feedback_format()
    }

    fn report_format(&self) -> <Self::Report as Message>::Format {
        self.scheme.report_format()
    }

    fn encode(
        &self,
        rng: &mut dyn Rng,
        state: &mut Self::State,
        measurement: &SVector<f64, M>,
        feedback: &Self::Feedback,
    ) -> Result<Option<Self::Report>, Error> {
        self.scheme.encode(rng, state, measurement, feedback)
    }

    fn factor(
        &self,
        feedback: &Self::Feedback,
        observation: &Observation<Self::Report>,
        link: &Link,
    ) -> Result<Self::Factor, Error> {
        self.scheme.factor(feedback, observation, link)
    }
}
