//! The sensor's half.

use super::config::Config;
use super::lattice::Lattice;
use super::law::PRECISION;
use super::replica::{Replica, Slot};
use super::report::{self, Content};
use super::{MODELS, push_number};
use crate::error::{Error, finite};
use crate::packet::Packet;

/// Bits of a model's number in a refresh.
pub const MODEL_BITS: u32 = 5;
const _: () = assert!(MODELS <= 1 << MODEL_BITS);

/// The report of one slot.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The bits that are sent.
    pub packet: Packet,
    /// Number of bits that are not entropy coded: header, whole number, far residual.
    pub raw_bits: u32,
    /// Frequency of the coded symbol out of `2^24`; `2^24` if none was coded. The ideal length is `raw_bits + 24 - log2(frequency)` bits.
    pub frequency: u32,
    /// Whether a receiver can start here.
    pub refresh: bool,
}

/// The sensor's half. It takes samples and returns reports or silence. It needs no memory outside itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Encoder {
    config: Config,
    replica: Replica,
    /// Whether the first sample was taken.
    started: bool,
    refresh_requested: bool,
    sequence: u32,
    slot: u64,
}

impl Encoder {
    /// An encoder before its first sample.
    pub const fn new(config: Config) -> Self {
        Self {
            config,
            replica: Replica::UNSET,
            started: false,
            refresh_requested: false,
            sequence: 0,
            slot: 0,
        }
    }

    /// An encoder that continues where another one stopped. `replica` is `None` before the first sample.
    ///
    /// # Errors
    /// If an encoder with this configuration cannot have had this replica.
    pub fn restored(
        config: Config,
        replica: Option<Replica>,
        slot: u64,
        sequence: u32,
        refresh_requested: bool,
    ) -> Result<Self, Error> {
        let mut encoder = Self::new(config);
        if let Some(replica) = replica {
            if !replica.is_valid(&config) {
                return Err(Error::new("replica", f64::NAN, "the state that was stored"));
            }
            encoder.replica = replica;
            encoder.started = true;
        }
        encoder.slot = slot;
        encoder.sequence = sequence & largest_sequence(&config);
        encoder.refresh_requested = refresh_requested;
        Ok(encoder)
    }

    /// The state of a receiver that lost nothing; `None` before the first sample.
    pub fn replica(&self) -> Option<&Replica> {
        self.started.then_some(&self.replica)
    }

    /// Number of slots so far.
    pub fn slot(&self) -> u64 {
        self.slot
    }

    /// Counter of the next packet.
    pub fn sequence(&self) -> u32 {
        self.sequence
    }

    /// Whether the next report will be a refresh because it was asked for.
    pub fn refresh_requested(&self) -> bool {
        self.refresh_requested
    }

    /// The reconstruction of the last sample at a receiver that lost nothing; `None` before the first.
    pub fn reconstruction(&self) -> Option<f64> {
        self.replica().map(Replica::value)
    }

    /// Makes the next report a refresh. No effect unless the configuration is resilient.
    pub fn request_refresh(&mut self) {
        self.refresh_requested = self.config.is_resilient();
    }

    /// Encodes a sample one slot after the last. `None` is silence.
    ///
    /// # Errors
    /// If the sample is not finite. The encoder is then unchanged.
    pub fn encode(&mut self, sample: f64) -> Result<Option<Report>, Error> {
        self.encode_after(1, sample)
    }

    /// Encodes a sample `elapsed` slots after the last. Both ends must know when samples are taken. For irregular times choose a slot that
    /// is not longer than the shortest gap.
    ///
    /// # Errors
    /// If the sample is not finite or `elapsed` is 0. The encoder is then unchanged.
    pub fn encode_after(&mut self, elapsed: u32, sample: f64) -> Result<Option<Report>, Error> {
        let sample = self.reduced(elapsed, sample)?;
        if !self.started || self.refresh_requested || is_scheduled(&self.config, self.slot) {
            return Ok(Some(self.refresh(sample)));
        }
        self.slot = self.slot.wrapping_add(1);
        let slot = self.replica.predict(elapsed);
        // The sample is within the bound of the prediction: silence.
        let Some(content) = Content::of(&self.replica, &slot, sample) else {
            self.replica.silent(&slot);
            return Ok(None);
        };
        let mut packet = header(&self.config, self.sequence, false);
        let overhead = packet.bits();
        let law = self.replica.law(&slot);
        let (place, rest_bits) = report::push(&content, &law, &mut packet);
        let outside = law.bank_outside();
        content.apply(&self.config, &mut self.replica, &slot, outside)?;
        self.sequence = next_sequence(&self.config, self.sequence);
        Ok(Some(Report {
            packet,
            raw_bits: overhead + rest_bits,
            frequency: place.width,
            refresh: false,
        }))
    }

    /// Encodes a slot whose report the caller writes in another form than a packet. `write` receives the content of the report, `None` for
    /// silence. The first sample starts the lattice and is not passed to `write`.
    ///
    /// # Errors
    /// As [`encode_after`](Self::encode_after).
    pub fn write_after<T>(
        &mut self,
        elapsed: u32,
        sample: f64,
        write: impl FnOnce(Option<&Content>, &Replica, &Slot) -> T,
    ) -> Result<Option<T>, Error> {
        let sample = self.reduced(elapsed, sample)?;
        if !self.started {
            self.refresh(sample);
            return Ok(None);
        }
        let slot = self.replica.predict(elapsed);
        let content = Content::of(&self.replica, &slot, sample);
        let written = write(content.as_ref(), &self.replica, &slot);
        self.slot = self.slot.wrapping_add(1);
        match content {
            Some(content) => {
                let outside = self.replica.law(&slot).bank_outside();
                content.apply(&self.config, &mut self.replica, &slot, outside)?;
            }
            None => self.replica.silent(&slot),
        }
        Ok(Some(written))
    }

    /// The sample, checked and reduced to the circle if there is one.
    fn reduced(&self, elapsed: u32, sample: f64) -> Result<f64, Error> {
        finite("sample", sample)?;
        if elapsed == 0 {
            return Err(Error::new("elapsed", 0.0, "at least 1 slot"));
        }
        Ok(Lattice::reduce(&self.config, sample))
    }

    /// A function of its own on small processors, so that silence does not need its stack memory.
    #[cfg_attr(not(feature = "std"), inline(never))]
    fn refresh(&mut self, sample: f64) -> Report {
        let mut packet = header(&self.config, self.sequence, true);
        push_number(&mut packet, sample);
        let mut believed = None;
        if self.config.is_resilient() {
            let best = if self.started {
                self.replica.bank().best()
            } else {
                MODELS
            };
            packet.push(best as u64, MODEL_BITS);
            believed = Some(best);
        }
        self.replica.restart(Lattice::new(&self.config, sample), believed);
        self.started = true;
        self.slot = self.slot.wrapping_add(1);
        self.sequence = next_sequence(&self.config, self.sequence);
        self.refresh_requested = false;
        Report {
            packet,
            raw_bits: packet.bits(),
            frequency: 1 << PRECISION,
            refresh: true,
        }
    }
}

/// Whether a refresh is due in this slot by the schedule.
pub fn is_scheduled(config: &Config, slot: u64) -> bool {
    config.refresh_every().is_some_and(|every| slot.is_multiple_of(every))
}

fn largest_sequence(config: &Config) -> u32 {
    (1 << config.sequence_bits()) - 1
}

/// The counter that follows `sequence`.
pub fn next_sequence(config: &Config, sequence: u32) -> u32 {
    (sequence + 1) & largest_sequence(config)
}

/// The beginning of a packet: counter and refresh flag if the configuration is resilient, otherwise nothing.
pub(crate) fn header(config: &Config, sequence: u32, refresh: bool) -> Packet {
    let mut packet = Packet::default();
    if config.is_resilient() {
        packet.push(u64::from(sequence), config.sequence_bits());
        packet.push(u64::from(refresh), 1);
    }
    packet
}
