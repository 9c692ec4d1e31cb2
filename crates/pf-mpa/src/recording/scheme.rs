//! A scheme for ranges of which some are outliers.

use crate::quantized::RangeReference;
use fewbits_core::factor::Robust;
use fewbits_core::rand::Rng;
use fewbits_core::{Deterministic, Error, Link, MeasurementNoise, Message, Observation, Scheme};
use fewbits_quantizers::Symbol;
use nalgebra::{Matrix1, Vector1};

/// Probability of a level if its range is an outlier, uniform over a width of `stray` metres. It seldom falls into an inner cell.
pub(super) fn stray_level(levels: usize, stray: f64, reference: &RangeReference, level: &Symbol) -> f64 {
    let inner = (2.0 * reference.half_width / stray).min(1.0) / levels as f64;
    if level.0 == 0 || level.0 + 1 == levels {
        0.5 * (1.0 - (levels - 2) as f64 * inner)
    } else {
        inner
    }
}

/// A scheme whose report is an outlier with probability `e`: the likelihood is `(1 - e) p + e c`.
#[derive(Clone)]
pub(super) struct Tolerant<C, S> {
    pub scheme: C,
    /// Probability `e` of an outlier.
    pub outliers: f64,
    /// `c`: density or probability of a report that is an outlier.
    pub stray: S,
}

impl<C: MeasurementNoise<1>, S> MeasurementNoise<1> for Tolerant<C, S> {
    fn noise_covariance_at(&self, range: &Vector1<f64>) -> Matrix1<f64> {
        self.scheme.noise_covariance_at(range)
    }
}

impl<C: Deterministic<1>, S: Fn(&C::Feedback, &C::Report) -> f64 + Send + Sync> Deterministic<1> for Tolerant<C, S> {}

impl<C: Scheme<1>, S: Fn(&C::Feedback, &C::Report) -> f64 + Send + Sync> Scheme<1> for Tolerant<C, S> {
    type State = C::State;
    type Feedback = C::Feedback;
    type Report = C::Report;
    type Factor = Robust<C::Factor>;

    fn feedback_format(&self) -> <C::Feedback as Message>::Format {
        self.scheme.feedback_format()
    }

    fn report_format(&self) -> <C::Report as Message>::Format {
        self.scheme.report_format()
    }

    fn start(&self) -> C::State {
        self.scheme.start()
    }

    fn encode(
        &self,
        rng: &mut dyn Rng,
        state: &mut C::State,
        range: &Vector1<f64>,
        feedback: &C::Feedback,
    ) -> Result<Option<C::Report>, Error> {
        self.scheme.encode(rng, state, range, feedback)
    }

    fn factor(
        &self,
        feedback: &C::Feedback,
        observation: &Observation<C::Report>,
        link: &Link,
    ) -> Result<Self::Factor, Error> {
        let factor = self.scheme.factor(feedback, observation, link)?;
        let (share, density) = match observation {
            Observation::Received(report) => (self.outliers, (self.stray)(feedback, report)),
            // A missing report is no outlier.
            Observation::Nothing | Observation::Lost => (0.0, 0.0),
        };
        Ok(Robust::new(factor, share, density * link.arrival())?)
    }
}
