//! One bit per sample, or a few: the filters of Dymbo.

use crate::error::Error;
use crate::estimator::{Estimator, always_spoken, gaussian_replica};
use fewbits_core::{Gaussian, Message, NumberFormat, Observation, Scheme, Sign};
use fewbits_dymbo::{ParallelFilter, ScalarFilter, SignBit};
use nalgebra::Vector1;
use rand_pcg::Pcg64Dxsm;

fn impossible(error: fewbits_dymbo::Error) -> Error {
    match error {
        fewbits_dymbo::Error::Core(error) => error.into(),
        fewbits_dymbo::Error::Argument(error) => Error::Argument(error),
        other => Error::estimator("dymbo", other),
    }
}

/// One sensor under a [`ScalarFilter`] of Dymbo: one bit per sample, or several.
#[derive(Debug, Clone, PartialEq)]
pub struct DymboEstimator<F> {
    /// The filter, with what it knows of the link.
    pub filter: F,
    /// What is known before the first slot.
    pub start: Gaussian<1>,
}

impl<F: ScalarFilter> Estimator for DymboEstimator<F> {
    type Belief = Gaussian<1>;
    type Measurement = Vector1<f64>;
    type Question = <F::Scheme as Scheme<1>>::Feedback;
    type Report = <F::Scheme as Scheme<1>>::Report;
    type Memory = ();

    fn sensors(&self) -> usize {
        1
    }

    fn start(&self) -> Gaussian<1> {
        self.start
    }

    fn memory(&self, _: usize) {}

    fn predict(&self, _: &mut Pcg64Dxsm, _: u32, belief: &Gaussian<1>) -> Result<Gaussian<1>, Error> {
        Ok(self.filter.predict(belief))
    }

    fn question(&self, _: u32, predicted: &Gaussian<1>, _: usize) -> Result<Self::Question, Error> {
        Ok(self.filter.feedback(predicted))
    }

    fn question_format(&self, _: usize) -> <Self::Question as Message>::Format {
        self.filter.scheme().feedback_format()
    }

    fn report_format(&self, _: usize) -> <Self::Report as Message>::Format {
        self.filter.scheme().report_format()
    }

    fn report(
        &self,
        rng: &mut Pcg64Dxsm,
        _: u32,
        _: usize,
        (): &mut (),
        measurement: &Vector1<f64>,
        question: &Self::Question,
    ) -> Result<Option<Self::Report>, Error> {
        Ok(self.filter.scheme().encode(rng, &mut (), measurement, question)?)
    }

    fn update(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        predicted: &Gaussian<1>,
        observations: &[Option<Observation<Self::Report>>],
    ) -> Result<Gaussian<1>, Error> {
        let Some(Some(observation)) = observations.first() else {
            return Ok(*predicted);
        };
        Ok(self.filter.update(predicted, observation).map_err(impossible)?.0)
    }

    fn mean(&self, belief: &Gaussian<1>) -> Vec<f64> {
        vec![belief.mean()[0]]
    }
}

gaussian_replica!([F] DymboEstimator<F> where F: ScalarFilter);

/// `K` one-bit sensors of one threshold: [`ParallelFilter`].
#[derive(Debug, Clone, PartialEq)]
pub struct ParallelDymboEstimator {
    filter: ParallelFilter,
    scheme: SignBit,
    start: Gaussian<1>,
}

impl ParallelDymboEstimator {
    /// The filter, with what it knows of the links, and what is known before the first slot.
    ///
    /// # Errors
    /// None for a plant that [`ParallelFilter`] accepted.
    pub fn new(filter: ParallelFilter, start: Gaussian<1>) -> Result<Self, Error> {
        let scheme = SignBit::new(filter.plant().measurement_variance()).map_err(impossible)?;
        Ok(Self { filter, scheme, start })
    }
}

impl Estimator for ParallelDymboEstimator {
    type Belief = Gaussian<1>;
    type Measurement = Vector1<f64>;
    type Question = f64;
    type Report = Sign;
    type Memory = ();

    fn sensors(&self) -> usize {
        self.filter.sensors()
    }

    fn start(&self) -> Gaussian<1> {
        self.start
    }

    fn memory(&self, _: usize) {}

    /// The belief itself: [`ParallelFilter::step`] predicts.
    fn predict(&self, _: &mut Pcg64Dxsm, _: u32, belief: &Gaussian<1>) -> Result<Gaussian<1>, Error> {
        Ok(*belief)
    }

    fn question(&self, _: u32, belief: &Gaussian<1>, _: usize) -> Result<f64, Error> {
        Ok(self.filter.threshold(belief))
    }

    fn question_format(&self, _: usize) -> NumberFormat {
        self.scheme.feedback_format()
    }

    fn report_format(&self, _: usize) {}

    fn report(
        &self,
        rng: &mut Pcg64Dxsm,
        _: u32,
        _: usize,
        (): &mut (),
        measurement: &Vector1<f64>,
        question: &f64,
    ) -> Result<Option<Sign>, Error> {
        Ok(self.scheme.encode(rng, &mut (), measurement, question)?)
    }

    fn update(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        belief: &Gaussian<1>,
        observations: &[Option<Observation<Sign>>],
    ) -> Result<Gaussian<1>, Error> {
        Ok(self
            .filter
            .step(belief, &always_spoken(observations))
            .map_err(impossible)?
            .0)
    }

    fn mean(&self, belief: &Gaussian<1>) -> Vec<f64> {
        vec![belief.mean()[0]]
    }
}

gaussian_replica!([] ParallelDymboEstimator);
