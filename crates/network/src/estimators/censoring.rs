//! Censoring sensors; with threshold 0, sensors that send everything.

use crate::error::Error;
use crate::estimator::{Estimator, gaussian_replica};
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion, Weighing};
use fewbits_cfwmd::scheme::{Censoring, Prediction};
use fewbits_core::{
    BitReader, BitWriter, CodecError, Gaussian, LinearDynamics, LinearSensing, Message, NumberFormat, Observation,
    Scheme,
};
use fewbits_filters::kalman;
use fewbits_numerics::ArgumentError;
use nalgebra::{SMatrix, SVector};
use rand_pcg::Pcg64Dxsm;

fn of(error: fewbits_cfwmd::Error) -> Error {
    match error {
        fewbits_cfwmd::Error::Core(error) => error.into(),
        other => Error::estimator("cfwmd", other),
    }
}

/// What the fusion centre broadcasts: the prediction, with its covariance where the sensors weigh by it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Broadcast<const D: usize> {
    /// The predicted mean.
    Mean(SVector<f64, D>),
    /// Mean and covariance.
    Belief(Prediction<D>),
}

impl<const D: usize> Broadcast<D> {
    fn mean(&self) -> &SVector<f64, D> {
        match self {
            Self::Mean(mean) => mean,
            Self::Belief(prediction) => prediction.0.mean(),
        }
    }
}

impl<const D: usize> Message for Broadcast<D> {
    /// How sensors weigh says whether they are told the covariance.
    type Format = Weighing;

    fn encode(&self, _: &Weighing, writer: &mut BitWriter) -> Result<(), CodecError> {
        match self {
            Self::Mean(mean) => mean.encode(&NumberFormat::Double, writer),
            Self::Belief(prediction) => prediction.encode(&NumberFormat::Double, writer),
        }
    }

    fn decode(weighing: &Weighing, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        match weighing {
            Weighing::FusionCentre => Prediction::decode(&NumberFormat::Double, reader).map(Self::Belief),
            _ => SVector::decode(&NumberFormat::Double, reader).map(Self::Mean),
        }
    }
}

/// Censoring sensors under [`Network::fuse`]. CFwMD, CFwMD2, a schedule, or all-send by a threshold of 0.
#[derive(Debug, Clone, PartialEq)]
pub struct CensoringEstimator<G, S, const D: usize, const M: usize> {
    network: Network<S, D, M>,
    dynamics: G,
    start: Gaussian<D>,
    format: NumberFormat,
    weighing: Weighing,
    /// For each slot the rules of all sensors, where data do not matter; the last holds on.
    rules: Vec<Vec<CensoringRule<M>>>,
}

impl<G, S, const D: usize, const M: usize> CensoringEstimator<G, S, D, M>
where
    G: LinearDynamics<D>,
    S: LinearSensing<D, M> + Clone + PartialEq,
{
    /// Sensors that weigh with the covariance of their own filters (CFwMD). The rules of `slots` slots are computed beforehand; the
    /// last holds on.
    ///
    /// # Errors
    /// If there is no slot, or an innovation covariance is not positive definite.
    pub fn own(
        network: Network<S, D, M>,
        format: NumberFormat,
        dynamics: G,
        start: Gaussian<D>,
        slots: usize,
    ) -> Result<Self, Error> {
        fewbits_numerics::error::at_least_one("slots", slots)?;
        let mut own = vec![OwnRecursion::new(&start); network.sensors().len()];
        let mut rules = Vec::with_capacity(slots);
        for _ in 0..slots {
            let slot = own.iter_mut().zip(network.sensors()).map(|(own, sensor)| {
                let step = own.advance(&dynamics, sensor, start.mean()).map_err(of)?;
                CensoringRule::new(&step.innovation_covariance, network.threshold()).map_err(of)
            });
            rules.push(slot.collect::<Result<Vec<_>, Error>>()?);
        }
        Ok(Self {
            network: network.with_format(format),
            dynamics,
            start,
            format,
            weighing: Weighing::OwnFilter,
            rules,
        })
    }

    /// Sensors that are told the covariance of the prediction (CFwMD2).
    pub fn told(network: Network<S, D, M>, format: NumberFormat, dynamics: G, start: Gaussian<D>) -> Self {
        Self {
            network: network.with_format(format),
            dynamics,
            start,
            format,
            weighing: Weighing::FusionCentre,
            rules: Vec::new(),
        }
    }

    /// Sensors that weigh with expected predicted covariances, one for each slot; the last holds on.
    ///
    /// # Errors
    /// If there is none, or an innovation covariance is not positive definite.
    pub fn scheduled(
        network: Network<S, D, M>,
        format: NumberFormat,
        dynamics: G,
        start: Gaussian<D>,
        covariances: &[SMatrix<f64, D, D>],
    ) -> Result<Self, Error> {
        fewbits_numerics::error::at_least_one("covariances", covariances.len())?;
        let at = |covariance: &SMatrix<f64, D, D>| {
            let expected = Gaussian::new(*start.mean(), *covariance)?;
            network.rules_under(&expected).map_err(of)
        };
        Ok(Self {
            rules: covariances.iter().map(at).collect::<Result<_, Error>>()?,
            network: network.with_format(format),
            dynamics,
            start,
            format,
            weighing: Weighing::Scheduled,
        })
    }

    fn rules(&self, slot: u32, predicted: &Gaussian<D>) -> Result<Vec<CensoringRule<M>>, Error> {
        if self.weighing == Weighing::FusionCentre {
            return self.network.rules_under(predicted).map_err(of);
        }
        let at = (slot as usize).saturating_sub(1).min(self.rules.len() - 1);
        Ok(self.rules[at].clone())
    }
}

impl<G, S, const D: usize, const M: usize> Estimator for CensoringEstimator<G, S, D, M>
where
    G: LinearDynamics<D>,
    S: LinearSensing<D, M> + Clone + PartialEq,
{
    type Belief = Gaussian<D>;
    type Measurement = SVector<f64, M>;
    type Question = Broadcast<D>;
    type Report = SVector<f64, M>;
    type Memory = ();

    fn sensors(&self) -> usize {
        self.network.sensors().len()
    }

    fn start(&self) -> Gaussian<D> {
        self.start
    }

    fn memory(&self, _: usize) {}

    fn predict(&self, _: &mut Pcg64Dxsm, _: u32, belief: &Gaussian<D>) -> Result<Gaussian<D>, Error> {
        Ok(kalman::predict(&self.dynamics, belief))
    }

    fn question(&self, _: u32, predicted: &Gaussian<D>, _: usize) -> Result<Broadcast<D>, Error> {
        Ok(match self.weighing {
            Weighing::FusionCentre => Broadcast::Belief(Prediction(*predicted)),
            _ => Broadcast::Mean(*predicted.mean()),
        })
    }

    fn question_format(&self, _: usize) -> Weighing {
        self.weighing
    }

    fn report_format(&self, _: usize) -> NumberFormat {
        self.format
    }

    fn report(
        &self,
        rng: &mut Pcg64Dxsm,
        slot: u32,
        sensor: usize,
        (): &mut (),
        measurement: &SVector<f64, M>,
        question: &Broadcast<D>,
    ) -> Result<Option<SVector<f64, M>>, Error> {
        let rule = match question {
            Broadcast::Belief(prediction) => self.network.rule_under(sensor, &prediction.0).map_err(of)?,
            Broadcast::Mean(_) => {
                let at = (slot as usize)
                    .saturating_sub(1)
                    .min(self.rules.len().saturating_sub(1));
                let rule = self.rules.get(at).and_then(|rules| rules.get(sensor));
                rule.ok_or_else(|| ArgumentError::new("question", "a mean", "mean and covariance"))?
                    .clone()
            }
        };
        let scheme = Censoring::new(self.network.sensors()[sensor].clone(), rule, self.format).map_err(of)?;
        Ok(scheme.encode(rng, &mut (), measurement, question.mean())?)
    }

    fn update(
        &self,
        _: &mut Pcg64Dxsm,
        slot: u32,
        predicted: &Gaussian<D>,
        observations: &[Option<Observation<SVector<f64, M>>>],
    ) -> Result<Gaussian<D>, Error> {
        let rules = self.rules(slot, predicted)?;
        let fused = self
            .network
            .fuse_asked(predicted, &rules, predicted.mean(), observations);
        Ok(fused.map_err(of)?.0)
    }

    fn mean(&self, belief: &Gaussian<D>) -> Vec<f64> {
        belief.mean().as_slice().to_vec()
    }
}

gaussian_replica!([G, S, const D: usize, const M: usize] CensoringEstimator<G, S, D, M>
    where G: LinearDynamics<D>, S: LinearSensing<D, M> + Clone + PartialEq);
