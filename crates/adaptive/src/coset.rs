//! Reports that can be decoded although earlier ones were lost.
//!
//! [`crate::Sensor`] codes each report under what both ends learned from all earlier reports. That needs the fewest bits, but after one
//! lost packet no report can be decoded until the next refresh. Here a report contains the index of its sample modulo `2^b`. The receiver
//! takes the index of that residue class that is nearest to the last one it knows. `b` is chosen so that this is right from any of the last
//! [`TOLERATED`] `+ 1` reports. It is not sent, because the frame tells the length of a packet.
//!
//! ```text
//! lattice   x^ = 2 delta j, through zero: nothing about it can be lost
//! silence   j is that of the last report
//! report    counter (c bits), flag 0, j mod 2^b        2^b > 2 max |j - j_i| over the last reports i
//! refresh   counter (c bits), flag 1, j                in two's complement, as short as it fits
//! ```
//!
//! A lost packet therefore affects only the slots until the next one. The counter tells the receiver how many are missing; if more than
//! [`TOLERATED`] are, it waits for a refresh. The method is coding with side information at the decoder
//! only (Wyner and Ziv 1976) in its simplest form.

use crate::packet::Packet;
use crate::{Error, Tracked};
use fewbits_core::{CodecError, Observation};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, positive, within};
use serde::{Deserialize, Serialize};

/// Number of successive packets that may be lost before the next one can no longer be decoded.
pub const TOLERATED: usize = 2;
/// Number of earlier reports from any of which a new one must be decodable.
const REMEMBERED: usize = TOLERATED + 1;
/// Largest size of an index: multiples of the step are then exact enough for the bound.
const LARGEST: i64 = 1 << 40;
/// Share by which the step is shorter than `2 delta`, so that rounding cannot move a reconstruction out of its bound.
const SLACK: f64 = 1.0 / (1 << 10) as f64;

/// Configuration that sensor and receiver must share.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct CosetConfig {
    delta: f64,
    counter_bits: u32,
    refresh_every: u64,
}

fewbits_numerics::stored! { CosetConfig as Stored |config| {
    delta: fewbits_numerics::stored::Exact = fewbits_numerics::stored::Exact(config.delta),
    counter_bits: u32 = config.counter_bits,
    refresh_every: u64 = config.refresh_every,
} => CosetConfig::new(delta.0, counter_bits, refresh_every), ArgumentError }

impl CosetConfig {
    /// Every reconstruction is within `delta` of its sample while no packet is missing. A packet has a counter of `counter_bits` bits.
    /// Every `refresh_every` slots the sensor sends a refresh, from which a receiver can start.
    ///
    /// The receiver notices a loss unless a multiple of `2^counter_bits` packets vanish in a row.
    ///
    /// # Errors
    /// If `delta` is not above 0 or its double not finite, `counter_bits` not in `2..=16` or `refresh_every` is 0.
    pub fn new(delta: f64, counter_bits: u32, refresh_every: u64) -> Result<Self, ArgumentError> {
        positive("delta", delta)?;
        finite("2 delta", 2.0 * delta)?;
        within("counter_bits", f64::from(counter_bits), 2.0, 16.0)?;
        if refresh_every == 0 {
            return Err(ArgumentError::new("refresh_every", 0, "at least 1 slot"));
        }
        Ok(Self {
            delta,
            counter_bits,
            refresh_every,
        })
    }

    /// Largest error of a reconstruction, in measurement units.
    pub fn delta(&self) -> f64 {
        self.delta
    }

    fn value(&self, index: i64) -> f64 {
        2.0 * self.delta * (1.0 - SLACK) * index as f64
    }

    fn next(&self, counter: u32) -> u32 {
        (counter + 1) & self.largest_counter()
    }

    fn largest_counter(&self) -> u32 {
        (1 << self.counter_bits) - 1
    }

    fn header(&self, counter: u32, refresh: bool) -> Packet {
        let mut packet = Packet::default();
        packet.0.push(u64::from(counter), self.counter_bits);
        packet.0.push(u64::from(refresh), 1);
        packet
    }
}

fn is_index(index: &i64) -> bool {
    index.unsigned_abs() < LARGEST as u64
}

/// Number of bits of an integer in two's complement, at least one.
fn width_of(index: i64) -> u32 {
    u64::BITS - (index ^ index >> 63).leading_zeros() + 1
}

/// The integer whose two's complement in `width` bits is `bits`.
fn signed(bits: u64, width: u32) -> i64 {
    let shift = u64::BITS - width;
    (bits << shift) as i64 >> shift
}

/// The sensor's half.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredSensor", into = "StoredSensor")]
pub struct CosetSensor {
    config: CosetConfig,
    /// Indices of the last reports, the newest first; empty before the first.
    reported: Vec<i64>,
    slot: u64,
    counter: u32,
}

impl CosetSensor {
    /// A sensor before its first sample.
    pub fn new(config: CosetConfig) -> Self {
        Self {
            config,
            reported: Vec::with_capacity(REMEMBERED),
            slot: 0,
            counter: 0,
        }
    }

    /// The reconstruction of the last sample at a receiver that lost nothing; `None` before the first.
    pub fn reconstruction(&self) -> Option<f64> {
        self.reported.first().map(|index| self.config.value(*index))
    }

    /// The packet of the next slot; `None` is silence.
    ///
    /// # Errors
    /// If the sample is not finite, or beyond `2^40` steps of the lattice. The sensor is then unchanged.
    pub fn encode(&mut self, sample: f64) -> Result<Option<Packet>, Error> {
        let config = self.config;
        finite("sample", sample)?;
        let steps = (sample / config.value(1)).round();
        let index = if steps.abs() < LARGEST as f64 {
            steps as i64
        } else {
            LARGEST
        };
        if (config.value(index) - sample).abs() > config.delta {
            let expected = "at most 2^40 times twice delta in size";
            return Err(ArgumentError::new("sample", sample, expected).into());
        }
        let refresh = self.slot.is_multiple_of(config.refresh_every);
        self.slot = self.slot.wrapping_add(1);
        let quiet = self
            .reported
            .first()
            .is_some_and(|last| (config.value(*last) - sample).abs() <= config.delta);
        if quiet && !refresh {
            return Ok(None);
        }
        let mut packet = config.header(self.counter, refresh);
        if refresh {
            packet.0.push(index as u64, width_of(index));
        } else {
            // As many low bits as distinguish the index from all others near any index that the receiver may have.
            let farthest = self.reported.iter().map(|last| index - last);
            let width = farthest.map(width_of).max().unwrap_or(1);
            packet.0.push(index as u64, width);
        }
        self.counter = config.next(self.counter);
        self.reported.truncate(REMEMBERED - 1);
        self.reported.insert(0, index);
        Ok(Some(packet))
    }
}

fewbits_numerics::stored! { CosetSensor as StoredSensor |sensor| {
    config: CosetConfig = sensor.config,
    reported: Vec<i64> = sensor.reported,
    slot: u64 = sensor.slot,
    counter: u32 = sensor.counter,
} => {
    if reported.len() > REMEMBERED || !reported.iter().all(is_index) {
        return Err(ArgumentError::new("reported", "inconsistent", "the state that was stored"));
    }
    let counter = counter & config.largest_counter();
    Ok(CosetSensor { config, reported, slot, counter })
}, ArgumentError }

/// The receiver's half.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "StoredReceiver", into = "StoredReceiver")]
pub struct CosetReceiver {
    config: CosetConfig,
    /// The index of the last decoded packet.
    index: Option<i64>,
    /// Counter of the packet after it.
    counter: u32,
    /// Number of slots since the first one, for a receiver that was there from the start.
    slot: u64,
    /// Whether too many packets are missing, so that only a refresh can be decoded.
    waiting: bool,
    synchronised: bool,
}

fewbits_numerics::stored! { CosetReceiver as StoredReceiver |receiver| {
    config: CosetConfig = receiver.config,
    index: Option<i64> = receiver.index,
    counter: u32 = receiver.counter,
    slot: u64 = receiver.slot,
    waiting: bool = receiver.waiting,
    synchronised: bool = receiver.synchronised,
} => {
    if !index.iter().all(is_index) {
        return Err(ArgumentError::new("index", "inconsistent", "the state that was stored"));
    }
    let counter = counter & config.largest_counter();
    Ok(CosetReceiver { config, index, counter, slot, waiting, synchronised })
}, ArgumentError }

impl CosetReceiver {
    /// A receiver that runs from the sensor's first slot on.
    pub fn new(config: CosetConfig) -> Self {
        Self {
            config,
            index: None,
            counter: 0,
            slot: 0,
            waiting: true,
            synchronised: false,
        }
    }

    /// The reconstruction of the last sample. While it is synchronised, the value is within the bound, unless a packet was lost after the
    /// last one that arrived.
    pub fn tracked(&self) -> Tracked {
        Tracked {
            value: self.index.map(|index| self.config.value(index)),
            synchronised: self.synchronised,
        }
    }

    /// Processes what arrived in the next slot. A packet that is known to be lost ends the synchronisation until the next packet arrives.
    ///
    /// # Errors
    /// If no sensor can have sent the packet. The receiver is then unchanged.
    pub fn receive(&mut self, observation: &Observation<Packet>) -> Result<Tracked, Error> {
        let due = self.slot.is_multiple_of(self.config.refresh_every);
        match observation {
            Observation::Received(packet) => self.packet(packet)?,
            Observation::Lost => self.synchronised = false,
            // A refresh is never silent.
            Observation::Nothing if due => self.synchronised = false,
            Observation::Nothing => {}
        }
        self.slot = self.slot.wrapping_add(1);
        Ok(self.tracked())
    }

    fn packet(&mut self, packet: &Packet) -> Result<(), CodecError> {
        let mut reader = packet.reader();
        let counter = reader.read(self.config.counter_bits)? as u32;
        let refresh = reader.read(1)? == 1;
        let width = reader.remaining();
        let invalid = |value: String, expected| CodecError::invalid("packet", value, expected);
        if !(1..=u64::BITS).contains(&width) {
            return Err(invalid(format!("{width} bits of an index"), "1 to 64 bits"));
        }
        let bits = reader.read(width)?;
        // Number of packets missing between the last decoded one and this one, modulo the range of the counter.
        let missing = counter.wrapping_sub(self.counter) & self.config.largest_counter();
        let index = if refresh {
            Some(signed(bits, width))
        } else {
            // The index of this residue class nearest to the last one.
            let last = self.index.filter(|_| !self.waiting && missing as usize <= TOLERATED);
            last.map(|last| last.wrapping_add(signed(bits.wrapping_sub(last as u64), width)))
        };
        if !index.iter().all(is_index) {
            return Err(invalid(format!("index {}", index.unwrap_or(0)), "below 2^40 in size"));
        }
        match index {
            Some(index) => {
                self.counter = self.config.next(counter);
                self.index = Some(index);
                (self.synchronised, self.waiting) = (true, false);
            }
            // The counter is cyclic: without this a later packet would seem to be the next one.
            None => (self.synchronised, self.waiting) = (false, true),
        }
        Ok(())
    }
}
