//! The receiver's half.

use crate::config::Config;
use crate::packet::{Packet, PacketReader, read_number};
use crate::stream::StreamReader;
use crate::{Error, MODELS, report};
use fewbits_core::{CodecError, Observation};
use fewbits_node::adaptive::{Lattice, MODEL_BITS, Replica, is_scheduled, next_sequence};
use fewbits_numerics::ArgumentError;
use serde::{Deserialize, Serialize};

/// The receiver's knowledge of a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Tracked {
    /// The reconstruction; the last one while not synchronised. `None` before the first report.
    pub value: Option<f64>,
    /// Whether the receiver's state equals the sensor's, as far as the receiver can know. If it does, and no packet was lost after the last
    /// received one, the value is within `delta` of the sample.
    pub synchronised: bool,
}

/// The receiver's half. It takes reports or silence and returns reconstructions.
///
/// On a link that loses packets ([`Config::resilient`]) a loss is noticed at once if the link reports it ([`Observation::Lost`]), at the
/// next packet by its counter, or at the next scheduled refresh if that is missing. From the loss to the next
/// refresh that arrives the error is not bounded. With a refresh every `R` slots that is at most `R - 1` slots, plus `R` for each
/// scheduled refresh that is lost too.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Receiver {
    config: Config,
    replica: Option<Replica>,
    /// Number of the slot, if it is known.
    slot: Option<u64>,
    sequence: u32,
    synchronised: bool,
}

/// The stored form of [`Receiver`].
#[derive(Deserialize)]
#[serde(rename = "Receiver", deny_unknown_fields)]
struct Stored {
    config: Config,
    replica: Option<Replica>,
    slot: Option<u64>,
    sequence: u32,
    synchronised: bool,
}

impl TryFrom<Stored> for Receiver {
    type Error = ArgumentError;

    fn try_from(stored: Stored) -> Result<Self, ArgumentError> {
        let config = stored.config;
        if stored
            .replica
            .as_ref()
            .is_some_and(|replica| !replica.is_valid(&config.0))
        {
            return Err(ArgumentError::new("replica", "inconsistent", "the state that was stored"));
        }
        Ok(Receiver {
            config,
            synchronised: stored.synchronised && stored.replica.is_some(),
            replica: stored.replica,
            slot: stored.slot,
            sequence: stored.sequence & ((1 << config.sequence_bits()) - 1),
        })
    }
}

impl Receiver {
    /// A receiver that runs from the sensor's first slot on.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            replica: None,
            slot: Some(0),
            sequence: 0,
            synchronised: false,
        }
    }

    /// A receiver that starts, or starts again, while the sensor is running. It is synchronised from the next refresh on.
    pub fn joining(config: Config) -> Self {
        Self {
            slot: None,
            ..Self::new(config)
        }
    }

    /// The configuration that the sensor has too.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The knowledge of the last sample.
    pub fn tracked(&self) -> Tracked {
        Tracked {
            value: self.replica.as_ref().map(Replica::value),
            synchronised: self.synchronised,
        }
    }

    /// Weights of the models, as [`crate::Sensor::model_weights`].
    pub fn model_weights(&self) -> [f64; MODELS] {
        self.replica
            .as_ref()
            .map_or([1.0 / MODELS as f64; MODELS], |replica| replica.bank().weights().map(f64::from))
    }

    /// Processes what arrived one slot after the last.
    ///
    /// # Errors
    /// As [`receive_after`](Self::receive_after).
    pub fn receive(&mut self, observation: &Observation<Packet>) -> Result<Tracked, Error> {
        self.receive_after(1, observation)
    }

    /// Processes what arrived `elapsed` slots after the last.
    ///
    /// # Errors
    /// If `elapsed` is 0, or no sensor can have sent the packet. The receiver is then unchanged. A packet that is
    /// known to be damaged should be passed as [`Observation::Lost`].
    pub fn receive_after(&mut self, elapsed: u32, observation: &Observation<Packet>) -> Result<Tracked, Error> {
        if elapsed == 0 {
            return Err(ArgumentError::new("elapsed", 0, "at least 1 slot").into());
        }
        match observation {
            Observation::Received(packet) => self.packet(elapsed, packet)?,
            Observation::Lost => {
                self.synchronised = false;
                // The number of the packet that is gone is counted where the next one is compared.
            }
            Observation::Nothing => {
                let missing = self.slot.is_some_and(|slot| is_scheduled(&self.config.0, slot));
                match &mut self.replica {
                    Some(replica) if self.synchronised && !missing => {
                        let slot = replica.predict(elapsed);
                        replica.silent(&slot);
                    }
                    _ => self.synchronised = false,
                }
            }
        }
        self.slot = self.slot.map(|slot| slot.wrapping_add(1));
        Ok(self.tracked())
    }

    /// Reads the next sample of a stream.
    ///
    /// # Errors
    /// If `elapsed` is 0 or the stream is damaged. The receiver is then unchanged.
    pub fn read_after(&mut self, elapsed: u32, stream: &mut StreamReader<'_>) -> Result<f64, Error> {
        if elapsed == 0 {
            return Err(ArgumentError::new("elapsed", 0, "at least 1 slot").into());
        }
        let Some(replica) = &mut self.replica else {
            let lattice = Lattice::new(&self.config.0, stream.first()?);
            let replica = self.replica.insert(Replica::new(lattice, None));
            self.synchronised = true;
            return Ok(replica.value());
        };
        // The bank is restored if the stream is damaged: a failed call leaves the receiver unchanged.
        let saved = *replica.bank();
        let slot = replica.predict(elapsed);
        let outcome = stream.get(replica, &slot).and_then(|content| match content {
            Some(content) => {
                let outside = replica.law(&slot).bank_outside();
                report::apply(&content, &self.config.0, replica, &slot, outside)
            }
            None => {
                replica.silent(&slot);
                Ok(())
            }
        });
        if let Err(error) = outcome {
            replica.restore_bank(saved);
            return Err(error.into());
        }
        Ok(replica.value())
    }

    fn packet(&mut self, elapsed: u32, packet: &Packet) -> Result<(), CodecError> {
        let mut reader = packet.reader();
        if !self.config.is_resilient() {
            return match &self.replica {
                None => self.refresh(&mut reader),
                Some(_) => self.event(elapsed, &mut reader),
            };
        }
        let sequence = reader.read(self.config.sequence_bits())? as u32;
        if reader.read(1)? == 1 {
            self.refresh(&mut reader)?;
        } else if self.synchronised && sequence == self.sequence {
            self.event(elapsed, &mut reader)?;
        } else {
            self.synchronised = false;
        }
        self.sequence = next_sequence(&self.config.0, sequence);
        Ok(())
    }

    fn refresh(&mut self, reader: &mut PacketReader) -> Result<(), CodecError> {
        let sample = read_number(reader)?;
        let believed = if self.config.is_resilient() {
            let model = reader.read(MODEL_BITS)? as usize;
            if model > MODELS {
                return Err(CodecError::invalid("model", model, "one of the bank, or none"));
            }
            Some(model)
        } else {
            None
        };
        reader.finish()?;
        let sample = Lattice::reduce(&self.config.0, sample);
        let lattice = Lattice::new(&self.config.0, sample);
        match &mut self.replica {
            Some(replica) => replica.restart(lattice, believed),
            None => self.replica = Some(Replica::new(lattice, believed)),
        }
        self.synchronised = true;
        Ok(())
    }

    fn event(&mut self, elapsed: u32, reader: &mut PacketReader) -> Result<(), CodecError> {
        let Some(replica) = &mut self.replica else {
            return Ok(());
        };
        let saved = *replica.bank();
        let slot = replica.predict(elapsed);
        let law = replica.law(&slot);
        let outside = law.bank_outside();
        let outcome = report::read(&law, reader)
            .and_then(|content| report::apply(&content, &self.config.0, replica, &slot, outside));
        if outcome.is_err() {
            replica.restore_bank(saved);
        }
        outcome
    }
}
