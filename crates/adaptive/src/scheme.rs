//! One slot as a [`Scheme`]: likelihood of a report, or of silence, as a function of the noise-free measurement.

use crate::packet::Packet;
use crate::report;
use crate::{Error, Sensor};
use fewbits_core::factor::{Factor, InCell, Scalar, Tilted, Value};
use fewbits_core::{Cell, Columns, Deterministic, Gaussian, Link, Observation, Scheme};
use fewbits_node::adaptive::{Content, Lattice, REACH, Replica, Slot, push};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, positive};
use nalgebra::{SVector, Vector1};
use rand::Rng;

/// The next slot of a sensor, for any filter of the workspace. A receiver with its own model of the signal learns, besides the
/// reconstruction, in which cell of width `2 delta` the noisy measurement lies.
///
/// It contains what both ends know before the slot. Make one for each slot; in a simulation, from the sensor. Signals on a circle and
/// links that invert bits are not supported.
#[derive(Debug, Clone, PartialEq)]
pub struct SlotScheme {
    sensor: Sensor,
    replica: Replica,
    slot: Slot,
    noise_variance: f64,
}

impl SlotScheme {
    /// The slot after the last of `sensor`, whose measurements have noise of the given variance.
    ///
    /// # Errors
    /// If the sensor has not taken its first sample, its signal is circular, or the variance is not positive.
    pub fn new(sensor: &Sensor, noise_variance: f64) -> Result<Self, Error> {
        positive("noise_variance", noise_variance)?;
        if let Some(period) = sensor.config().period() {
            return Err(ArgumentError::new("period", period, "a signal on a line").into());
        }
        let none = || ArgumentError::new("sensor", "before its first sample", "a sensor that has started");
        let (replica, slot) = sensor.ahead(1).ok_or_else(none)?;
        Ok(Self {
            sensor: sensor.clone(),
            replica,
            slot,
            noise_variance,
        })
    }

    /// The reconstruction for a silent slot.
    pub fn prediction(&self) -> f64 {
        self.replica.lattice().value(self.slot.prediction())
    }

    /// The packet that reports the lattice point `steps` from the prediction. It is for tests.
    ///
    /// # Errors
    /// If `steps` is zero or beyond 4096.
    pub fn packet(&self, steps: i64) -> Result<Packet, Error> {
        let content = Content::Near(steps);
        if steps == 0 || steps.abs() > REACH {
            return Err(ArgumentError::new("steps", steps, "1 to 4096 in size").into());
        }
        let mut packet = self.sensor.next_header();
        push(&content, &self.replica.law(&self.slot), &mut packet);
        Ok(Packet(packet))
    }

    fn cell(&self, j: i64) -> Result<Cell, ArgumentError> {
        // Edges are computed from their own indices, so neighbouring cells have bitwise equal edges.
        let lattice: &Lattice = self.replica.lattice();
        let edge = |j: i64| 0.5 * (lattice.value(j - 1) + lattice.value(j));
        Cell::new(edge(j), edge(j + 1))
    }
}

/// Likelihood of a slot as a function of the noise-free measurement.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum SlotFactor {
    /// The measurement lies in a cell of the lattice, or nothing is known of it.
    Cells(Scalar),
    /// The sample itself was sent and arrived.
    Sample {
        /// Likelihood of the sample with its noise.
        value: Value<1>,
        /// `ln` of the probability that a report arrives.
        log_arrival: f64,
    },
}

impl Factor<1> for SlotFactor {
    fn log_likelihood(&self, m: &SVector<f64, 1>) -> f64 {
        match self {
            Self::Cells(factor) => factor.log_likelihood(m),
            Self::Sample { value, log_arrival } => value.log_likelihood(m) + log_arrival,
        }
    }

    fn add_log_likelihoods(&self, means: &Columns<'_, 1>, log_weights: &mut [f64]) {
        match self {
            Self::Cells(factor) => factor.add_log_likelihoods(means, log_weights),
            Self::Sample { value, log_arrival } => {
                value.add_log_likelihoods(means, log_weights);
                log_weights.iter_mut().for_each(|log| *log += log_arrival);
            }
        }
    }

    fn tilted(&self, prior: &Gaussian<1>) -> Result<Tilted<1>, Error> {
        match self {
            Self::Cells(factor) => factor.tilted(prior),
            Self::Sample { value, log_arrival } => {
                let alone = value.tilted(prior)?;
                Ok(Tilted {
                    log_evidence: alone.log_evidence + log_arrival,
                    ..alone
                })
            }
        }
    }
}

impl Deterministic<1> for SlotScheme {}

impl Scheme<1> for SlotScheme {
    type State = ();
    type Feedback = ();
    type Report = Packet;
    type Factor = SlotFactor;

    fn feedback_format(&self) {}

    fn report_format(&self) {}

    fn encode(
        &self,
        _: &mut dyn Rng,
        (): &mut (),
        measurement: &Vector1<f64>,
        (): &(),
    ) -> Result<Option<Packet>, Error> {
        let sample = finite("measurement", measurement[0])?;
        Ok(Content::of(&self.replica, &self.slot, sample).map(|content| {
            let mut packet = self.sensor.next_header();
            push(&content, &self.replica.law(&self.slot), &mut packet);
            Packet(packet)
        }))
    }

    fn factor(&self, (): &(), observation: &Observation<Packet>, link: &Link) -> Result<SlotFactor, Error> {
        if link.crossover() > 0.0 {
            let expected = "0: a packet with a wrong bit must be erased by a checksum of the link";
            return Err(ArgumentError::new("crossover", link.crossover(), expected).into());
        }
        let packet = match observation {
            Observation::Lost => {
                let silent = self.cell(self.slot.prediction())?;
                let spoke = Scalar::outside(&silent, self.noise_variance, link.lost_given_sent())?;
                return Ok(SlotFactor::Cells(spoke));
            }
            Observation::Nothing => {
                let cell = self.cell(self.slot.prediction())?;
                return Ok(SlotFactor::Cells(InCell::silence(cell, self.noise_variance, link)?.into()));
            }
            Observation::Received(packet) => packet,
        };
        let refused = |what: String| ArgumentError::new("report", what, "a report of this slot");
        let mut reader = packet.reader();
        let header = Packet(self.sensor.next_header());
        let there = reader
            .read(header.bits() as u32)
            .map_err(|error| refused(error.to_string()))?;
        if header.reader().read(header.bits() as u32) != Ok(there) {
            return Err(refused("numbered for another slot".into()).into());
        }
        let law = self.replica.law(&self.slot);
        let content = report::read(&law, &mut reader).map_err(|error| refused(error.to_string()))?;
        Ok(match content {
            Content::Near(k) | Content::Far(k) => {
                let cell = self.cell(self.slot.prediction() + k)?;
                SlotFactor::Cells(InCell::new(cell, self.noise_variance, 0.0, link.of_received()?)?.into())
            }
            // The report contains no lattice point but the sample itself.
            Content::Whole(sample) => SlotFactor::Sample {
                value: Value::scalar(sample, self.noise_variance)?,
                log_arrival: link.of_received()?.ln(),
            },
        })
    }
}
