//! The sensor's half.

use crate::config::Config;
use crate::packet::Packet;
use crate::report;
use crate::stream::StreamWriter;
use crate::{Error, MODELS};
use fewbits_node::adaptive::{Encoder, Lattice, Replica};
use fewbits_numerics::ArgumentError;
use serde::{Deserialize, Serialize};

/// The report of one slot.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The bits that are sent.
    pub packet: Packet,
    /// Ideal code length in bits: `-log2` of the probability. A stream of reports approaches it.
    pub information: f64,
    /// Whether a receiver can start here.
    pub refresh: bool,
}

impl From<fewbits_node::adaptive::Report> for Report {
    fn from(report: fewbits_node::adaptive::Report) -> Self {
        Self {
            packet: Packet(report.packet),
            information: f64::from(report.raw_bits) + report::information(report.frequency),
            refresh: report.refresh,
        }
    }
}

/// The sensor's half. It takes samples and returns reports or silence.
///
/// It does not allocate. A deserialized sensor continues with the same bits. [`Encoder`] is the same for a microcontroller.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Sensor {
    config: Config,
    encoder: Encoder,
}

/// The stored form of [`Sensor`].
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
            replica: sensor.encoder.replica().cloned(),
            slot: sensor.encoder.slot(),
            sequence: sensor.encoder.sequence(),
            refresh_requested: sensor.encoder.refresh_requested(),
        }
    }
}

impl TryFrom<Stored> for Sensor {
    type Error = ArgumentError;

    fn try_from(stored: Stored) -> Result<Self, ArgumentError> {
        let (config, requested) = (stored.config, stored.refresh_requested);
        let encoder = Encoder::restored(config.0, stored.replica, stored.slot, stored.sequence, requested)?;
        Ok(Sensor { config, encoder })
    }
}

impl Sensor {
    /// A sensor before its first sample.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            encoder: Encoder::new(config.0),
        }
    }

    /// The reconstruction of the last sample at a receiver that lost nothing; `None` before the first.
    pub fn reconstruction(&self) -> Option<f64> {
        self.encoder.reconstruction()
    }

    /// Weights of the models: random walks, then velocities that decay by 0.6, then by 0.95, each in [`SCALES`](crate::SCALES)
    /// increasing scales. All are equal before the first sample.
    pub fn model_weights(&self) -> [f64; MODELS] {
        self.encoder
            .replica()
            .map_or([1.0 / MODELS as f64; MODELS], |replica| replica.bank().weights().map(f64::from))
    }

    /// Makes the next report a refresh. No effect unless the configuration is resilient.
    pub fn request_refresh(&mut self) {
        self.encoder.request_refresh();
    }

    /// Encodes a sample one slot after the last. `None` is silence.
    ///
    /// # Errors
    /// If the sample is not finite. The sensor is then unchanged.
    pub fn encode(&mut self, sample: f64) -> Result<Option<Report>, Error> {
        self.encode_after(1, sample)
    }

    /// Encodes a sample `elapsed` slots after the last. Both ends must know when samples are taken. For irregular times choose a slot that
    /// is not longer than the shortest gap.
    ///
    /// # Errors
    /// If the sample is not finite or `elapsed` is 0. The sensor is then unchanged.
    pub fn encode_after(&mut self, elapsed: u32, sample: f64) -> Result<Option<Report>, Error> {
        Ok(self
            .encoder
            .encode_after(elapsed, sample)
            .map_err(ArgumentError::from)?
            .map(Report::from))
    }

    /// Encodes a sample into a stream instead of a packet. Streams are for reliable storage: they have no headers and no refreshes.
    ///
    /// # Errors
    /// As [`encode_after`](Self::encode_after).
    pub fn write_after(&mut self, elapsed: u32, sample: f64, stream: &mut StreamWriter) -> Result<(), Error> {
        let written = self
            .encoder
            .write_after(elapsed, sample, |content, replica, slot| stream.put(content, replica, slot))
            .map_err(ArgumentError::from)?;
        match written {
            Some(written) => Ok(written?),
            // The first sample, reduced to the circle if there is one.
            None => Ok(stream.first(Lattice::reduce(&self.config.0, sample))?),
        }
    }
}
