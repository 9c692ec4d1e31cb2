//! Censoring sensors and their fusion centre with messages as bits: an [`Estimator`], and the sensors' half.

use super::Weighing;
use crate::over_bits::{Estimator, moments};
use fewbits_cfwmd::Error;
use fewbits_cfwmd::network::Network;
use fewbits_cfwmd::no_feedback::advance;
use fewbits_cfwmd::rule::{CensoringRule, OwnRecursion};
use fewbits_cfwmd::scheme::Censoring;
use fewbits_core::{
    BitReader, BitString, BitWriter, CodecError, Gaussian, Likelihood, LinearDynamics, LinearSensing, Message,
    NumberFormat, Observation, Scheme, SensorNode,
};
use fewbits_filters::kalman;
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::at_least_one;
use fewbits_protocol::BoxError;
use nalgebra::{SMatrix, SVector};
use rand::Rng;
use std::sync::Arc;

/// What the fusion centre broadcasts: the predicted state, and its covariance if the sensors weigh their innovation with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Broadcast<const D: usize> {
    /// The predicted mean: `D` numbers.
    Mean(SVector<f64, D>),
    /// The predicted mean and covariance: `D + D (D + 1)/2` numbers.
    Belief(Gaussian<D>),
}

impl<const D: usize> Message for Broadcast<D> {
    /// [`Weighing::FusionCentre`] decodes a mean and a covariance, the other variants a mean.
    type Format = Weighing;

    fn encode(&self, _: &Weighing, writer: &mut BitWriter) -> Result<(), CodecError> {
        match self {
            Self::Mean(mean) => mean.encode(&NumberFormat::Double, writer),
            Self::Belief(belief) => belief.encode(&NumberFormat::Double, writer),
        }
    }

    fn decode(weighing: &Weighing, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        match weighing {
            Weighing::FusionCentre => Gaussian::decode(&NumberFormat::Double, reader).map(Self::Belief),
            _ => SVector::decode(&NumberFormat::Double, reader).map(Self::Mean),
        }
    }
}

/// Per slot the rules of all sensors. After the last entry its rules are used for all later slots.
type Rules<const M: usize> = Arc<Vec<Vec<CensoringRule<M>>>>;

/// Censoring sensors by [`Network::likelihoods`]: CFwMD, CFwMD2 or a schedule. With threshold 0 every measurement is sent.
#[derive(Debug, Clone, PartialEq)]
pub struct CensoringEstimator<G, S, const D: usize, const M: usize> {
    network: Network<S, D, M>,
    dynamics: G,
    start: Gaussian<D>,
    weighing: Weighing,
    /// Rules computed beforehand; empty if they follow from the broadcast.
    rules: Rules<M>,
}

impl<G, S, const D: usize, const M: usize> CensoringEstimator<G, S, D, M>
where
    G: LinearDynamics<D>,
    S: LinearSensing<D, M> + Clone + PartialEq,
{
    /// Sensors that weigh with the covariance of their own filters (CFwMD). The rules of `slots` slots are computed beforehand; later slots
    /// use those of the last.
    ///
    /// # Errors
    /// If `slots` is zero, or an innovation covariance is not positive definite.
    pub fn own(network: Network<S, D, M>, dynamics: G, start: Gaussian<D>, slots: usize) -> Result<Self, Error> {
        at_least_one("slots", slots)?;
        let mut own = vec![OwnRecursion::new(&start); network.sensors().len()];
        let mut rules = Vec::with_capacity(slots);
        for _ in 0..slots {
            let slot = advance(&mut own, &network, &dynamics)?;
            rules.push(slot.into_iter().map(|(_, rule)| rule).collect());
        }
        Ok(Self::with_rules(network, dynamics, start, Weighing::OwnFilter, rules))
    }

    /// Sensors that receive the covariance of the prediction and weigh with it (CFwMD2).
    pub fn told(network: Network<S, D, M>, dynamics: G, start: Gaussian<D>) -> Self {
        Self::with_rules(network, dynamics, start, Weighing::FusionCentre, Vec::new())
    }

    /// Sensors that weigh with expected predicted covariances, one for each slot. Later slots use the last one.
    ///
    /// # Errors
    /// If `covariances` is empty, or an innovation covariance is not positive definite.
    pub fn scheduled(
        network: Network<S, D, M>,
        dynamics: G,
        start: Gaussian<D>,
        covariances: &[SMatrix<f64, D, D>],
    ) -> Result<Self, Error> {
        at_least_one("covariances", covariances.len())?;
        let at = |covariance: &SMatrix<f64, D, D>| network.rules_under(&Gaussian::new(*start.mean(), *covariance)?);
        let rules = covariances.iter().map(at).collect::<Result<_, Error>>()?;
        Ok(Self::with_rules(network, dynamics, start, Weighing::Scheduled, rules))
    }

    fn with_rules(
        network: Network<S, D, M>,
        dynamics: G,
        start: Gaussian<D>,
        weighing: Weighing,
        rules: Vec<Vec<CensoringRule<M>>>,
    ) -> Self {
        Self {
            network,
            dynamics,
            start,
            weighing,
            rules: Arc::new(rules),
        }
    }

    /// The sensor's half for sensor `sensor`. If there is no such sensor, it refuses every measurement.
    pub fn node(&self, sensor: usize) -> CensoringNode<S, D, M> {
        CensoringNode {
            network: self.network.clone(),
            weighing: self.weighing,
            rules: self.rules.clone(),
            sensor,
            slot: 0,
        }
    }
}

fn in_slot<const M: usize>(rules: &Rules<M>, slot: u64) -> Result<&[CensoringRule<M>], ArgumentError> {
    let last = rules.len().saturating_sub(1);
    let at = usize::try_from(slot.saturating_sub(1)).map_or(last, |at| at.min(last));
    let none = || ArgumentError::new("rules", "none", "rules of one slot at least");
    rules.get(at).map(Vec::as_slice).ok_or_else(none)
}

impl<G, S, const D: usize, const M: usize> Estimator for CensoringEstimator<G, S, D, M>
where
    G: LinearDynamics<D>,
    S: LinearSensing<D, M> + Clone + PartialEq,
{
    type Belief = Gaussian<D>;
    type Feedback = Broadcast<D>;
    type Report = SVector<f64, M>;

    fn sensors(&self) -> usize {
        self.network.sensors().len()
    }

    fn start(&self) -> Gaussian<D> {
        self.start
    }

    fn predict(&self, _: u64, belief: &Gaussian<D>) -> Result<Gaussian<D>, BoxError> {
        Ok(kalman::predict(&self.dynamics, belief))
    }

    fn feedback(&self, predicted: &Gaussian<D>, _: usize) -> Result<Broadcast<D>, BoxError> {
        Ok(match self.weighing {
            Weighing::FusionCentre => Broadcast::Belief(*predicted),
            _ => Broadcast::Mean(*predicted.mean()),
        })
    }

    fn update(
        &self,
        slot: u64,
        predicted: &Gaussian<D>,
        observed: &[(usize, Observation<SVector<f64, M>>)],
    ) -> Result<Gaussian<D>, BoxError> {
        let mut all = vec![None; self.sensors()];
        for (sensor, observation) in observed {
            if let Some(place) = all.get_mut(*sensor) {
                *place = Some(*observation);
            }
        }
        let told;
        let rules = match self.weighing {
            Weighing::FusionCentre => {
                told = self.network.rules_under(predicted)?;
                &told
            }
            _ => in_slot(&self.rules, slot)?,
        };
        let mut belief = *predicted;
        self.network
            .likelihoods(rules, predicted.mean(), &all)?
            .condition(&mut belief)?;
        Ok(belief)
    }

    fn estimate(&self, belief: &Gaussian<D>) -> Vec<(f64, f64)> {
        moments(belief)
    }

    fn belief_format(&self) -> NumberFormat {
        NumberFormat::Double
    }

    fn feedback_format(&self, _: usize) -> Weighing {
        self.weighing
    }

    fn report_format(&self, _: usize) -> NumberFormat {
        self.network.format()
    }
}

/// The sensor's half of a [`CensoringEstimator`]. It counts slots if its rule depends on the slot.
#[derive(Debug, Clone, PartialEq)]
pub struct CensoringNode<S, const D: usize, const M: usize> {
    network: Network<S, D, M>,
    weighing: Weighing,
    rules: Rules<M>,
    sensor: usize,
    /// The last slot that it took part in or skipped.
    slot: u64,
}

/// Length of the slot number in the stored state of a sensor, in bits.
const SLOT_BITS: u32 = 64;

fn refused(name: &'static str, error: CodecError) -> Error {
    ArgumentError::new(name, error, "bits of the agreed format").into()
}

impl<S: LinearSensing<D, M> + Clone + PartialEq, const D: usize, const M: usize> SensorNode<M>
    for CensoringNode<S, D, M>
{
    fn report(
        &mut self,
        rng: &mut dyn Rng,
        measurement: &SVector<f64, M>,
        feedback: &BitString,
    ) -> Result<Option<BitString>, Error> {
        let (slot, format) = (self.slot.saturating_add(1), self.network.format());
        let sensors = self.network.sensors();
        let unknown = || ArgumentError::new("sensor", self.sensor, format!("below {}", sensors.len()));
        let sensing = sensors.get(self.sensor).ok_or_else(unknown)?.clone();
        let told = Broadcast::<D>::from_bits(&self.weighing, feedback).map_err(|e| refused("feedback", e))?;
        let (mean, rule) = match &told {
            Broadcast::Belief(predicted) => (predicted.mean(), self.network.rule_under(self.sensor, predicted)?),
            Broadcast::Mean(mean) => {
                let rule = in_slot(&self.rules, slot)?.get(self.sensor);
                (mean, rule.ok_or_else(unknown)?.clone())
            }
        };
        let scheme = Censoring::new(sensing, rule, format)?;
        let report = scheme.encode(rng, &mut (), measurement, mean)?;
        let bits = report.map(|report| report.to_bits(&format)).transpose();
        let bits = bits.map_err(|error| refused("report", error))?;
        self.slot = slot;
        Ok(bits)
    }

    fn skip(&mut self, slots: u64) {
        self.slot = self.slot.saturating_add(slots);
    }

    fn stored(&self) -> Option<BitString> {
        let mut writer = BitWriter::new();
        writer.write(self.slot, SLOT_BITS).ok()?;
        Some(writer.finish())
    }

    fn restore(&mut self, memory: &BitString) -> Result<(), Error> {
        let mut reader = BitReader::new(memory);
        let slot = reader.read(SLOT_BITS).and_then(|slot| reader.finish().map(|()| slot));
        self.slot = slot.map_err(|error| refused("memory", error))?;
        Ok(())
    }
}
