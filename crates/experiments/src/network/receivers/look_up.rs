//! Static quantizers and a table at the fusion centre: no feedback, no memory. Every slot stands alone.

use crate::prelude::Error;
use fewbits_baselines::over_bits::{Estimator, moments};
use fewbits_binary_patterns::LookupTable;
use fewbits_core::{Gaussian, Message, NumberFormat, Observation};
use fewbits_numerics::ArgumentError;
use fewbits_protocol::BoxError;
use fewbits_quantizer_design::System;
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizers::{Labelling, QuantizingSensor, Symbol};
use std::sync::Arc;

type Decode<R> = dyn Fn(&[Observation<R>]) -> Result<(f64, f64), BoxError> + Send + Sync;

/// Reports of one slot and the table that decodes them to a mean and a variance. The belief is the prior until the reports come.
#[derive(Clone)]
pub struct LookUp<R: Message> {
    prior: Gaussian<1>,
    /// How the reports of each sensor travel.
    formats: Vec<R::Format>,
    decode: Arc<Decode<R>>,
}

impl LookUp<Symbol> {
    /// The decoder of least squared error of quantizers designed together, with at most `limit` outcomes, and what each sensor does, whose
    /// noise has unit variance. Neighbouring levels differ in one bit on the wire where their number is a power of two.
    ///
    /// # Errors
    /// If there are more outcomes, or a sensor has no quantizer.
    pub fn of_system(system: &System, limit: usize) -> Result<(Self, Vec<QuantizingSensor>), Error> {
        let groups = system.groups();
        let sensor = |sensor: usize| -> Result<QuantizingSensor, Error> {
            let missing = || ArgumentError::new("system", "a sensor without quantizer", "a quantizer for every sensor");
            let mut group = groups.iter().filter(|group| group.sensors.contains(&sensor));
            let quantizer = &group.next().ok_or_else(missing)?.quantizer;
            let levels = quantizer.levels();
            let labelling = Labelling::gray(levels).or_else(|_| Labelling::natural(levels))?;
            Ok(QuantizingSensor::with_variance(quantizer.clone(), labelling, 1.0)?)
        };
        let count = groups.iter().map(|group| group.sensors.len()).sum();
        let sensors = (0..count).map(sensor).collect::<Result<Vec<_>, _>>()?;
        let decoder = MmseDecoder::new(system, limit)?;
        let prior = decoder.decode(&vec![Observation::Lost; count])?;
        let look_up = Self {
            prior: Gaussian::scalar(prior.mean, prior.variance)?,
            formats: sensors.iter().map(|sensor| sensor.labelling().clone()).collect(),
            decode: Arc::new(move |reports| {
                let estimate = decoder.decode(reports)?;
                Ok((estimate.mean, estimate.variance))
            }),
        };
        Ok((look_up, sensors))
    }
}

impl LookUp<bool> {
    /// One-bit quantizers of patterned cells and their table; `variance` is that of the source, the variance of the belief after the bits the
    /// mean squared error given them.
    ///
    /// # Errors
    /// If the variance is not positive.
    pub fn of_patterns(sensors: usize, table: LookupTable, variance: f64) -> Result<Self, Error> {
        Ok(Self {
            prior: Gaussian::scalar(0.0, variance)?,
            formats: vec![(); sensors],
            decode: Arc::new(move |reports| Ok(table.decode_with_error(reports)?)),
        })
    }
}

impl<R: Message + Clone> Estimator for LookUp<R>
where
    R::Format: Clone,
{
    type Belief = Gaussian<1>;
    type Feedback = ();
    type Report = R;

    fn sensors(&self) -> usize {
        self.formats.len()
    }

    fn start(&self) -> Gaussian<1> {
        self.prior
    }

    fn predict(&self, _: u64, _: &Gaussian<1>) -> Result<Gaussian<1>, BoxError> {
        Ok(self.prior)
    }

    fn feedback(&self, _: &Gaussian<1>, _: usize) -> Result<(), BoxError> {
        Ok(())
    }

    fn update(&self, _: u64, _: &Gaussian<1>, observed: &[(usize, Observation<R>)]) -> Result<Gaussian<1>, BoxError> {
        // The sensors always speak: to them a known loss, as no observation, says nothing about the state.
        let mut all = vec![Observation::Lost; self.formats.len()];
        for (sensor, observation) in observed {
            if let Some(place) = all.get_mut(*sensor) {
                *place = observation.clone();
            }
        }
        let (mean, variance) = (self.decode)(&all)?;
        Ok(Gaussian::scalar(mean, variance)?)
    }

    fn estimate(&self, belief: &Gaussian<1>) -> Vec<(f64, f64)> {
        moments(belief)
    }

    fn belief_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn feedback_format(&self, _: usize) {}

    fn report_format(&self, sensor: usize) -> R::Format {
        self.formats[sensor].clone()
    }
}
