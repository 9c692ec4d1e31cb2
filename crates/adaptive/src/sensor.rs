//! The sensor's half.

use crate::config::Config;
use crate::lattice::Lattice;
use crate::packet::{Packet, push_number};
use crate::replica::{Replica, Slot};
use crate::report::{self, Content};
use crate::stream::StreamWriter;
use crate::{Error, MODELS};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::finite;
use serde::{Deserialize, Serialize};

/// Bits that name a model in a refresh.
pub(crate) const MODEL_BITS: u32 = 5;
const _: () = assert!(MODELS <= 1 << MODEL_BITS);

/// What a sensor sends in one slot.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The whole bits that travel.
    pub packet: Packet,
    /// The ideal code length in bits, `-log2` of the probability: what a stream of reports approaches.
    pub information: f64,
    /// Whether a receiver can start here.
    pub refresh: bool,
}

/// The sensor's half: samples in, reports or silence out.
///
/// Apart from its first call it allocates nothing. Stored (`serde`) and read back it goes on with the same bits.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Sensor {
    pub(crate) config: Config,
    pub(crate) replica: Option<Replica>,
    slot: u64,
    sequence: u32,
    refresh_requested: bool,
}

#[derive(Serialize, Deserialize)]
#[serde(rename = "Sensor", deny_unknown_fields)]
struct Stored {
    config: Config,
    replica: Option<Replica>,
    slot: u64,
    sequence: u32,
    refresh_requested: bool,
}

impl From<Sensor> for Stored {
    fn from(sensor: Sensor) -> Self {
        Self {
            config: sensor.config,
            replica: sensor.replica,
            slot: sensor.slot,
            sequence: sensor.sequence,
            refresh_requested: sensor.refresh_requested,
        }
    }
}

impl TryFrom<Stored> for Sensor {
    type Error = ArgumentError;

    fn try_from(stored: Stored) -> Result<Self, ArgumentError> {
        Ok(Self {
            config: stored.config,
            replica: checked(stored.replica, &stored.config)?,
            slot: stored.slot,
            sequence: stored.sequence & ((1 << stored.config.sequence_bits()) - 1),
            refresh_requested: stored.refresh_requested,
        })
    }
}

/// A stored replica that a sensor can have left.
pub(crate) fn checked(replica: Option<Replica>, config: &Config) -> Result<Option<Replica>, ArgumentError> {
    match replica {
        Some(replica) if !replica.is_valid(config) => {
            Err(ArgumentError::new("replica", "inconsistent", "the state that was stored"))
        }
        Some(mut replica) => {
            replica.values.reserve();
            Ok(Some(replica))
        }
        None => Ok(None),
    }
}

impl Sensor {
    /// A sensor before its first sample.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            replica: None,
            slot: 0,
            sequence: 0,
            refresh_requested: false,
        }
    }

    /// The agreement with the receiver.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What the receiver, if it lost nothing, believes the last sample to be; `None` before the first.
    pub fn reconstruction(&self) -> Option<f64> {
        self.replica.as_ref().map(Replica::value)
    }

    /// Weights of the models: random walks, then velocities that decay by 0.6, then by 0.95, each in [`SCALES`](crate::SCALES)
    /// increasing scales. Even before the first sample.
    pub fn model_weights(&self) -> [f64; MODELS] {
        self.replica
            .as_ref()
            .map_or([1.0 / MODELS as f64; MODELS], |replica| *replica.bank.weights())
    }

    /// Makes the next report a refresh. Without effect unless the configuration is resilient.
    pub fn request_refresh(&mut self) {
        self.refresh_requested = self.config.is_resilient();
    }

    /// A sample one slot after the last; `None` is silence.
    ///
    /// # Errors
    /// If the sample is not finite; the sensor is then as it was.
    pub fn encode(&mut self, sample: f64) -> Result<Option<Report>, Error> {
        self.encode_after(1, sample)
    }

    /// A sample `elapsed` slots after the last. Both ends know when samples are taken: for irregular time stamps, choose a slot
    /// no longer than the shortest gap.
    ///
    /// # Errors
    /// If the sample is not finite or `elapsed` is 0; the sensor is then as it was.
    pub fn encode_after(&mut self, elapsed: u32, sample: f64) -> Result<Option<Report>, Error> {
        let sample = self.checked(elapsed, sample)?;
        let due = self.refresh_requested || scheduled(&self.config, self.slot);
        let Some(replica) = self.replica.as_mut().filter(|_| !due) else {
            return Ok(Some(self.refresh(sample)));
        };
        self.slot = self.slot.wrapping_add(1);
        let slot = replica.predict(elapsed);
        let Some(content) = Content::of(replica, &slot, sample) else {
            replica.silent(&slot);
            return Ok(None);
        };
        let mut packet = header(&self.config, self.sequence, false);
        let overhead = packet.bits() as f64;
        let law = replica.law(&slot);
        let information = overhead + report::push(&content, &law, &mut packet);
        let outside = law.bank_outside();
        content.apply(&self.config, replica, &slot, outside)?;
        self.sequence = next(&self.config, self.sequence);
        Ok(Some(Report {
            packet,
            information,
            refresh: false,
        }))
    }

    /// A sample into a stream instead of a packet. Streams are for reliable storage: no headers, no refreshes.
    ///
    /// # Errors
    /// As [`encode_after`](Self::encode_after).
    pub fn write_after(&mut self, elapsed: u32, sample: f64, stream: &mut StreamWriter) -> Result<(), Error> {
        let sample = self.checked(elapsed, sample)?;
        let Some(replica) = self.replica.as_mut() else {
            stream.first(sample)?;
            self.refresh(sample);
            return Ok(());
        };
        let slot = replica.predict(elapsed);
        let content = Content::of(replica, &slot, sample);
        stream.put(content.as_ref(), replica, &slot)?;
        self.slot = self.slot.wrapping_add(1);
        match content {
            Some(content) => {
                let outside = replica.law(&slot).bank_outside();
                content.apply(&self.config, replica, &slot, outside)?;
            }
            None => replica.silent(&slot),
        }
        Ok(())
    }

    fn checked(&self, elapsed: u32, sample: f64) -> Result<f64, ArgumentError> {
        finite("sample", sample)?;
        if elapsed == 0 {
            return Err(ArgumentError::new("elapsed", 0, "at least 1 slot"));
        }
        Ok(Lattice::reduce(&self.config, sample))
    }

    fn refresh(&mut self, sample: f64) -> Report {
        let mut packet = header(&self.config, self.sequence, true);
        push_number(&mut packet, sample);
        let mut believed = None;
        if self.config.is_resilient() {
            let best = self.replica.as_ref().map_or(MODELS, |replica| replica.bank.best());
            packet.push(best as u64, MODEL_BITS);
            believed = Some(best);
        }
        let lattice = Lattice::new(&self.config, sample);
        match &mut self.replica {
            Some(replica) => replica.restart(lattice, believed),
            None => self.replica = Some(Replica::new(lattice, believed)),
        }
        self.slot = self.slot.wrapping_add(1);
        self.sequence = next(&self.config, self.sequence);
        self.refresh_requested = false;
        Report {
            packet,
            information: packet.bits() as f64,
            refresh: true,
        }
    }

    /// The sensor's view of the next slot, for [`crate::SlotScheme`].
    pub(crate) fn ahead(&self, elapsed: u32) -> Option<(Replica, Slot)> {
        let mut replica = self.replica.clone()?;
        let slot = replica.predict(elapsed);
        Some((replica, slot))
    }

    pub(crate) fn next_header(&self) -> Packet {
        header(&self.config, self.sequence, false)
    }
}

/// Whether a refresh is due in a slot whatever happened.
pub(crate) fn scheduled(config: &Config, slot: u64) -> bool {
    config.refresh_every().is_some_and(|every| slot.is_multiple_of(every))
}

pub(crate) fn next(config: &Config, sequence: u32) -> u32 {
    (sequence + 1) & ((1 << config.sequence_bits()) - 1)
}

pub(crate) fn header(config: &Config, sequence: u32, refresh: bool) -> Packet {
    let mut packet = Packet::default();
    if config.is_resilient() {
        packet.push(u64::from(sequence), config.sequence_bits());
        packet.push(u64::from(refresh), 1);
    }
    packet
}
