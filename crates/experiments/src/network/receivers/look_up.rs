//! Static quantizers and a table at the fusion centre: no feedback, no memory. Every slot stands alone.

use crate::prelude::Error;
use fewbits_binary_patterns::LookupTable;
use fewbits_core::{Gaussian, NumberFormat, Observation};
use fewbits_numerics::ArgumentError;
use fewbits_protocol::{BoxError, Estimator, moments};
use fewbits_quantizer_design::System;
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizers::{Labelling, QuantizingSensor, Symbol};

/// The observations of sensors that always speak: to them a known loss, as no observation, says nothing about the state.
fn all<R: Clone>(sensors: usize, observed: &[(usize, Observation<R>)]) -> Vec<Observation<R>> {
    let mut all = vec![Observation::Lost; sensors];
    for (sensor, observation) in observed {
        if let Some(place) = all.get_mut(*sensor) {
            *place = observation.clone();
        }
    }
    all
}

/// What estimators share where every slot stands alone: the belief is that of the prior until the reports come.
macro_rules! stands_alone {
    () => {
        type Belief = Gaussian<1>;
        type Feedback = ();

        fn start(&self) -> Gaussian<1> {
            self.prior
        }

        fn predict(&self, _: u64, _: &Gaussian<1>) -> Result<Gaussian<1>, BoxError> {
            Ok(self.prior)
        }

        fn feedback(&self, _: &Gaussian<1>, _: usize) -> Result<(), BoxError> {
            Ok(())
        }

        fn estimate(&self, belief: &Gaussian<1>) -> Vec<(f64, f64)> {
            moments(belief)
        }

        fn belief_format(&self) -> NumberFormat {
            NumberFormat::Double
        }

        fn feedback_format(&self, _: usize) {}
    };
}

/// Quantizers designed together and the decoder of least squared error.
#[derive(Debug, Clone)]
pub(crate) struct LookUp {
    sensors: Vec<QuantizingSensor>,
    decoder: MmseDecoder,
    prior: Gaussian<1>,
}

impl LookUp {
    /// The decoder of a system of sensors with unit noise, with at most `limit` outcomes; neighbouring levels differ in one bit on the wire
    /// where their number is a power of two.
    pub(crate) fn new(system: &System, limit: usize) -> Result<Self, Error> {
        let scene = system.model();
        let mut sensors = vec![None; system.groups().iter().map(|group| group.sensors().len()).sum()];
        for group in system.groups() {
            let (quantizer, levels) = (group.quantizer(), group.quantizer().levels());
            let labelling = Labelling::gray(levels).or_else(|_| Labelling::natural(levels))?;
            let quantizing = QuantizingSensor::with_variance(quantizer.clone(), labelling, 1.0)?;
            for sensor in group.sensors() {
                if let Some(place) = sensors.get_mut(*sensor) {
                    *place = Some(quantizing.clone());
                }
            }
        }
        let missing = || ArgumentError::new("system", "a sensor without quantizer", "a quantizer for every sensor");
        let weighted = || scene.values().iter().zip(scene.weights());
        let mass: f64 = scene.weights().iter().sum();
        let mean = weighted().map(|(x, w)| w * x).sum::<f64>() / mass;
        let variance = weighted().map(|(x, w)| w * (x - mean) * (x - mean)).sum::<f64>() / mass;
        Ok(Self {
            sensors: sensors
                .into_iter()
                .map(|sensor| sensor.ok_or_else(missing))
                .collect::<Result<_, _>>()?,
            decoder: MmseDecoder::new(system, limit)?,
            prior: Gaussian::scalar(mean, variance)?,
        })
    }

    /// What each sensor does.
    pub(crate) fn schemes(&self) -> &[QuantizingSensor] {
        &self.sensors
    }
}

impl Estimator for LookUp {
    stands_alone!();
    type Report = Symbol;

    fn sensors(&self) -> usize {
        self.sensors.len()
    }

    fn update(
        &self,
        _: u64,
        _: &Gaussian<1>,
        observed: &[(usize, Observation<Symbol>)],
    ) -> Result<Gaussian<1>, BoxError> {
        let estimate = self.decoder.decode(&all(self.sensors.len(), observed))?;
        Ok(Gaussian::scalar(estimate.mean, estimate.variance)?)
    }

    fn report_format(&self, sensor: usize) -> Labelling {
        self.sensors[sensor].labelling().clone()
    }
}

/// One-bit quantizers of patterned cells and their table. The belief before the bits has the variance of the source, after them the mean
/// squared error of the table's estimate given the bits.
#[derive(Debug, Clone)]
pub(crate) struct Patterns {
    sensors: usize,
    table: LookupTable,
    prior: Gaussian<1>,
}

impl Patterns {
    /// As many sensors as the table's bank has, the table, and the variance of the source.
    pub(crate) fn new(sensors: usize, table: LookupTable, variance: f64) -> Result<Self, Error> {
        let prior = Gaussian::scalar(0.0, variance)?;
        Ok(Self { sensors, table, prior })
    }
}

impl Estimator for Patterns {
    stands_alone!();
    type Report = bool;

    fn sensors(&self) -> usize {
        self.sensors
    }

    fn update(
        &self,
        _: u64,
        _: &Gaussian<1>,
        observed: &[(usize, Observation<bool>)],
    ) -> Result<Gaussian<1>, BoxError> {
        let (mean, squared_error) = self.table.decode_with_error(&all(self.sensors, observed))?;
        Ok(Gaussian::scalar(mean, squared_error)?)
    }

    fn report_format(&self, _: usize) {}
}
