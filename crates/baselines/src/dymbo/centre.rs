//! [`Estimator`]s of the scalar one-bit filters. [`OverBits`](crate::over_bits::OverBits) turns them into fusion centres that
//! receive frames of bits. The sensors' half is [`SchemeNode`](fewbits_core::SchemeNode) of the filter's scheme.

use crate::over_bits::{Estimator, moments};
use fewbits_core::{Gaussian, Message, NumberFormat, Observation, Scheme, Sign};
use fewbits_dymbo::{Error, ParallelFilter, ScalarFilter, SignBit};
use fewbits_protocol::BoxError;

/// One sensor under a [`ScalarFilter`]: one bit per sample, or several.
#[derive(Debug, Clone, PartialEq)]
pub struct ScalarEstimator<F> {
    /// The filter. It knows the link's loss and crossover.
    pub filter: F,
    /// Prior belief of the state, before the first slot.
    pub start: Gaussian<1>,
}

/// The parts of [`Estimator`] that both estimators implement alike: the belief is a scalar Gaussian and is sent in double precision.
macro_rules! scalar_belief {
    () => {
        type Belief = Gaussian<1>;

        fn start(&self) -> Gaussian<1> {
            self.start
        }

        fn estimate(&self, belief: &Gaussian<1>) -> Vec<(f64, f64)> {
            moments(belief)
        }

        fn belief_format(&self) -> NumberFormat {
            NumberFormat::Double
        }
    };
}

impl<F: ScalarFilter> Estimator for ScalarEstimator<F> {
    scalar_belief!();
    type Feedback = <F::Scheme as Scheme<1>>::Feedback;
    type Report = <F::Scheme as Scheme<1>>::Report;

    fn sensors(&self) -> usize {
        1
    }

    fn predict(&self, _: u64, belief: &Gaussian<1>) -> Result<Gaussian<1>, BoxError> {
        Ok(self.filter.predict(belief))
    }

    fn feedback(&self, predicted: &Gaussian<1>, _: usize) -> Result<Self::Feedback, BoxError> {
        Ok(self.filter.feedback(predicted))
    }

    fn update(
        &self,
        _: u64,
        predicted: &Gaussian<1>,
        observed: &[(usize, Observation<Self::Report>)],
    ) -> Result<Gaussian<1>, BoxError> {
        match observed.first() {
            Some((_, observation)) => Ok(self.filter.update(predicted, observation)?.0),
            None => Ok(*predicted),
        }
    }

    fn feedback_format(&self, _: usize) -> <Self::Feedback as Message>::Format {
        self.filter.scheme().feedback_format()
    }

    fn report_format(&self, _: usize) -> <Self::Report as Message>::Format {
        self.filter.scheme().report_format()
    }
}

/// `K` one-bit sensors that are sent the same threshold, under a [`ParallelFilter`]. Each sensor runs [`scheme`](Self::scheme).
#[derive(Debug, Clone, PartialEq)]
pub struct ParallelEstimator {
    filter: ParallelFilter,
    scheme: SignBit,
    start: Gaussian<1>,
}

impl ParallelEstimator {
    /// The estimator with `filter` and the prior belief `start` of the state.
    ///
    /// # Errors
    /// None for a plant that [`ParallelFilter`] accepted.
    pub fn new(filter: ParallelFilter, start: Gaussian<1>) -> Result<Self, Error> {
        let scheme = SignBit::new(filter.plant().measurement_variance())?;
        Ok(Self { filter, scheme, start })
    }

    /// The scheme of every sensor: one sign bit per sample.
    pub fn scheme(&self) -> SignBit {
        self.scheme
    }
}

impl Estimator for ParallelEstimator {
    scalar_belief!();
    type Feedback = f64;
    type Report = Sign;

    fn sensors(&self) -> usize {
        self.filter.sensors()
    }

    fn predict(&self, _: u64, belief: &Gaussian<1>) -> Result<Gaussian<1>, BoxError> {
        Ok(self.filter.plant().predict(belief))
    }

    fn feedback(&self, predicted: &Gaussian<1>, _: usize) -> Result<f64, BoxError> {
        Ok(predicted.mean()[0])
    }

    /// A sensor without an entry counts as [`Observation::Lost`]: these sensors send a bit in every slot, so a missing one tells nothing
    /// about the state.
    fn update(
        &self,
        _: u64,
        predicted: &Gaussian<1>,
        observed: &[(usize, Observation<Sign>)],
    ) -> Result<Gaussian<1>, BoxError> {
        let mut all = vec![Observation::Lost; self.filter.sensors()];
        for (sensor, observation) in observed {
            if let Some(place) = all.get_mut(*sensor) {
                *place = *observation;
            }
        }
        Ok(self.filter.update(predicted, &all)?.0)
    }

    fn feedback_format(&self, _: usize) -> NumberFormat {
        self.scheme.feedback_format()
    }

    fn report_format(&self, _: usize) {}
}
