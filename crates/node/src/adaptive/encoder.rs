//! The sensor's half.

use super::config::Config;
use super::lattice::Lattice;
use super::law::PRECISION;
use super::replica::{Replica, Slot};
use super::report::{self, Content};
use super::{MODELS, push_number};
use crate::error::{Error, finite};
use crate::packet::Packet;

/// Bits that name a model in a refresh.
pub const MODEL_BITS: u32 = 5;
const _: () = assert!(MODELS <= 1 << MODEL_BITS);

/// What a sensor sends in one slot.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub struct Report {
    /// The whole bits that travel.
    pub packet: Packet,
    /// Bits that are written as they are: header, number, far residual.
    pub raw_bits: u32,
    /// Frequency of the coded symbol, of `2^24`; `2^24` if none was coded. The ideal length is `raw_bits + 24 - log2(frequency)` bits.
    pub frequency: u32,
    /// Whether a receiver can start here.
    pub refresh: bool,
}

/// The sensor's half: samples in, reports or silence out. It holds all its memory itself.
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

    /// An encoder that goes on where another one stopped. `replica` is `None` before the first sample.
    ///
    /// # Errors
    /// If the replica is none that an encoder with this agreement can have left.
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

    /// The agreement with the receiver.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// What the receiver holds if it lost nothing; `None` before the first sample.
    pub fn replica(&self) -> Option<&Replica> {
        self.started.then_some(&self.replica)
    }

    /// Slots so far.
    pub fn slot(&self) -> u64 {
        self.slot
    }

    /// Number of the next packet.
    pub fn sequence(&self) -> u32 {
        self.sequence
    }

    /// Whether the next report will be a refresh because it was asked for.
    pub fn refresh_requested(&self) -> bool {
        self.refresh_requested
    }

    /// What the receiver, if it lost nothing, believes the last sample to be; `None` before the first.
    pub fn reconstruction(&self) -> Option<f64> {
        self.replica().map(Replica::value)
    }

    /// Makes the next report a refresh. Without effect unless the configuration is resilient.
    pub fn request_refresh(&mut self) {
        self.refresh_requested = self.config.is_resilient();
    }

    /// A sample one slot after the last; `None` is silence.
    ///
    /// # Errors
    /// If the sample is not finite; the encoder is then as it was.
    pub fn encode(&mut self, sample: f64) -> Result<Option<Report>, Error> {
        self.encode_after(1, sample)
    }

    /// A sample `elapsed` slots after the last. Both ends know when samples are taken: for irregular time stamps, choose a slot
    /// no longer than the shortest gap.
    ///
    /// # Errors
    /// If the sample is not finite or `elapsed` is 0; the encoder is then as it was.
    pub fn encode_after(&mut self, elapsed: u32, sample: f64) -> Result<Option<Report>, Error> {
        let sample = self.reduced(elapsed, sample)?;
        if !self.started || self.refresh_requested || is_scheduled(&self.config, self.slot) {
            return Ok(Some(self.refresh(sample)));
        }
        self.slot = self.slot.wrapping_add(1);
        let slot = self.replica.predict(elapsed);
        // Within the accuracy of the prediction: silence says it.
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

    /// A slot whose report the caller writes elsewhere than in a packet: `write` gets what to say, if anything. The first sample starts
    /// the lattice and is not given to `write`.
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

    /// The replica one slot after the last sample, and that slot; `None` before the first sample.
    pub fn ahead(&self, elapsed: u32) -> Option<(Replica, Slot)> {
        let mut replica = self.replica()?.clone();
        let slot = replica.predict(elapsed);
        Some((replica, slot))
    }

    /// The sample as the receiver wants it.
    fn reduced(&self, elapsed: u32, sample: f64) -> Result<f64, Error> {
        finite("sample", sample)?;
        if elapsed == 0 {
            return Err(Error::new("elapsed", 0.0, "at least 1 slot"));
        }
        Ok(Lattice::reduce(&self.config, sample))
    }

    /// Apart on small processors, so that silence does not take its memory on the stack.
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

/// Whether a refresh is due in a slot whatever happened.
pub fn is_scheduled(config: &Config, slot: u64) -> bool {
    config.refresh_every().is_some_and(|every| slot.is_multiple_of(every))
}

fn largest_sequence(config: &Config) -> u32 {
    (1 << config.sequence_bits()) - 1
}

/// The number after `sequence`.
pub fn next_sequence(config: &Config, sequence: u32) -> u32 {
    (sequence + 1) & largest_sequence(config)
}

/// The beginning of a packet: number and flag where packets can be lost, nothing otherwise.
pub fn header(config: &Config, sequence: u32, refresh: bool) -> Packet {
    let mut packet = Packet::default();
    if config.is_resilient() {
        packet.push(u64::from(sequence), config.sequence_bits());
        packet.push(u64::from(refresh), 1);
    }
    packet
}
