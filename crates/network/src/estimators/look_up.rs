//! Static quantizers and a table at the fusion centre: no feedback, no memory.

use crate::error::Error;
use crate::estimator::{Estimator, always_spoken, gaussian_replica};
use fewbits_binary_patterns::{Bit, LookupTable, PatternSensor};
use fewbits_core::{Gaussian, Observation};
use fewbits_numerics::ArgumentError;
use fewbits_quantizer_design::System;
use fewbits_quantizer_design::decoder::MmseDecoder;
use fewbits_quantizers::{Labelling, Quantizer, Symbol};
use nalgebra::Vector1;
use rand_pcg::Pcg64Dxsm;

/// Quantizers designed together and the decoder of least squared error. Every slot stands alone: the belief is that of the prior
/// until the symbols come.
#[derive(Debug, Clone)]
pub struct LookUp {
    quantizers: Vec<Quantizer>,
    labellings: Vec<Labelling>,
    decoder: MmseDecoder,
    prior: Gaussian<1>,
}

impl LookUp {
    /// The decoder of a system with at most `limit` outcomes; neighbouring levels differ in one bit on the wire where their number
    /// is a power of two.
    ///
    /// # Errors
    /// If the system has more outcomes.
    pub fn new(system: &System, limit: usize) -> Result<Self, Error> {
        let scene = system.scene();
        let mut quantizers = vec![None; system.groups().iter().map(|group| group.sensors().len()).sum()];
        for group in system.groups() {
            for sensor in group.sensors() {
                if let Some(quantizer) = quantizers.get_mut(*sensor) {
                    *quantizer = Some(group.quantizer().clone());
                }
            }
        }
        let missing = || ArgumentError::new("system", "a sensor without quantizer", "a quantizer for every sensor");
        let quantizers: Vec<Quantizer> = quantizers
            .into_iter()
            .map(|quantizer| quantizer.ok_or_else(missing))
            .collect::<Result<_, _>>()?;
        let labelling = |quantizer: &Quantizer| {
            let levels = quantizer.levels();
            Labelling::gray(levels)
                .or_else(|_| Labelling::natural(levels))
                .map_err(|error| Error::estimator("look-up", error))
        };
        let (mean, variance) = moments(scene.values(), scene.weights());
        Ok(Self {
            labellings: quantizers.iter().map(labelling).collect::<Result<_, Error>>()?,
            quantizers,
            decoder: MmseDecoder::new(system, limit).map_err(|error| Error::estimator("look-up", error))?,
            prior: Gaussian::scalar(mean, variance)?,
        })
    }
}

fn moments(values: &[f64], weights: &[f64]) -> (f64, f64) {
    let all = || values.iter().zip(weights);
    let mass: f64 = weights.iter().sum();
    let mean = all().map(|(x, w)| w * x).sum::<f64>() / mass;
    (mean, all().map(|(x, w)| w * (x - mean) * (x - mean)).sum::<f64>() / mass)
}

/// Methods of estimators of a scalar where every slot stands alone: nothing is asked, nothing is remembered.
macro_rules! stands_alone {
    ($sensors:ident) => {
        fn sensors(&self) -> usize {
            self.$sensors.len()
        }

        fn start(&self) -> Gaussian<1> {
            self.prior
        }

        fn memory(&self, _: usize) {}

        fn predict(&self, _: &mut Pcg64Dxsm, _: u32, _: &Gaussian<1>) -> Result<Gaussian<1>, Error> {
            Ok(self.prior)
        }

        fn question(&self, _: u32, _: &Gaussian<1>, _: usize) -> Result<(), Error> {
            Ok(())
        }

        fn question_format(&self, _: usize) {}

        fn mean(&self, belief: &Gaussian<1>) -> Vec<f64> {
            vec![belief.mean()[0]]
        }
    };
}

impl Estimator for LookUp {
    type Belief = Gaussian<1>;
    type Measurement = Vector1<f64>;
    type Question = ();
    type Report = Symbol;
    type Memory = ();

    stands_alone!(quantizers);

    fn report_format(&self, sensor: usize) -> Labelling {
        self.labellings[sensor].clone()
    }

    fn report(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        sensor: usize,
        (): &mut (),
        measurement: &Vector1<f64>,
        (): &(),
    ) -> Result<Option<Symbol>, Error> {
        let level = self.quantizers[sensor]
            .encode(measurement[0])
            .map_err(|error| Error::estimator("look-up", error))?;
        Ok(Some(Symbol(level)))
    }

    fn update(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        _: &Gaussian<1>,
        observations: &[Option<Observation<Symbol>>],
    ) -> Result<Gaussian<1>, Error> {
        let estimate = self
            .decoder
            .decode(&always_spoken(observations))
            .map_err(|error| match error {
                fewbits_quantizer_design::Error::ImpossibleOutcome => Error::Impossible,
                other => Error::estimator("look-up", other),
            })?;
        Ok(Gaussian::scalar(estimate.mean, estimate.variance)?)
    }
}

gaussian_replica!([] LookUp);

/// One-bit quantizers of patterned cells and their table. Every slot stands alone. The belief before the bits has the variance of the source,
/// after them the mean squared error of the table's estimate given the bits.
#[derive(Debug, Clone)]
pub struct Patterns {
    sensors: Vec<PatternSensor>,
    table: LookupTable,
    prior: Gaussian<1>,
}

impl Patterns {
    /// The sensors in the order of the table's bank, the table, and the variance of the source.
    ///
    /// # Errors
    /// If there is no sensor or the variance is negative.
    pub fn new(sensors: Vec<PatternSensor>, table: LookupTable, variance: f64) -> Result<Self, Error> {
        fewbits_numerics::error::at_least_one("sensors", sensors.len())?;
        Ok(Self {
            sensors,
            table,
            prior: Gaussian::scalar(0.0, variance)?,
        })
    }
}

impl Estimator for Patterns {
    type Belief = Gaussian<1>;
    type Measurement = Vector1<f64>;
    type Question = ();
    type Report = Bit;
    type Memory = ();

    stands_alone!(sensors);

    fn report_format(&self, _: usize) {}

    fn report(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        sensor: usize,
        (): &mut (),
        measurement: &Vector1<f64>,
        (): &(),
    ) -> Result<Option<Bit>, Error> {
        let quantizer = self.sensors[sensor].quantizer();
        quantizer
            .report(measurement[0])
            .map(Some)
            .map_err(|error| Error::estimator("look-up", error))
    }

    fn update(
        &self,
        _: &mut Pcg64Dxsm,
        _: u32,
        _: &Gaussian<1>,
        observations: &[Option<Observation<Bit>>],
    ) -> Result<Gaussian<1>, Error> {
        let (mean, squared_error) = self
            .table
            .decode_with_error(&always_spoken(observations))
            .map_err(|error| Error::estimator("look-up", error))?;
        Ok(Gaussian::scalar(mean, squared_error)?)
    }
}

gaussian_replica!([] Patterns);
