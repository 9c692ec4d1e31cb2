//! A whole recording as one range-coded stream, for storage or a reliable link.

use crate::packet::{Packet, read_number};
use crate::report;
use constriction::UnwrapInfallible;
use constriction::stream::model::{DecoderModel, EncoderModel, EntropyModel};
use constriction::stream::queue::{RangeDecoder, RangeEncoder};
use constriction::stream::{Decode, Encode};
use crc::{CRC_32_ISO_HDLC, Crc};
use fewbits_core::CodecError;
use fewbits_node::adaptive::{Content, ESCAPE, Law, PRECISION, Place, Replica, Slot, push_number};
use serde::{Deserialize, Serialize};
use std::borrow::Borrow;
use std::num::NonZeroU32;

const BITS: usize = PRECISION as usize;
const TOTAL: u32 = 1 << PRECISION;

/// How the reader of a stream learns which slots are silent.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Silence {
    /// The reader knows it from elsewhere, as the receiver of packets does.
    Timed,
    /// By a coded flag for each slot, so the stream is complete.
    Coded,
}

/// Adaptive frequencies of reports and silences, given whether the last two slots were silent.
#[derive(Debug, Clone, PartialEq)]
struct Flags {
    counts: [[u32; 2]; 4],
    context: usize,
}

impl Flags {
    fn new() -> Self {
        Self {
            counts: [[1; 2]; 4],
            context: 0,
        }
    }

    fn place(&self, silent: bool) -> Place {
        let [reported, quiet] = self.counts[self.context];
        let split = (u64::from(TOTAL) * u64::from(reported) / u64::from(reported + quiet)) as u32;
        // Neither event may have frequency zero.
        let split = split.clamp(1, TOTAL - 1);
        if silent {
            Place {
                left: split,
                width: TOTAL - split,
            }
        } else {
            Place { left: 0, width: split }
        }
    }

    fn add(&mut self, silent: bool) {
        let counts = &mut self.counts[self.context];
        counts[usize::from(silent)] += 1;
        if counts.iter().sum::<u32>() > 1 << 16 {
            // Halved, rounded up: old slots count less, and no count becomes zero.
            counts.iter_mut().for_each(|c| *c = c.div_ceil(2));
        }
        self.context = (2 * self.context + usize::from(silent)) & 3;
    }
}

/// A symbol whose interval is known.
#[derive(Debug, Clone, Copy)]
struct Known(Place);

impl EntropyModel<BITS> for Known {
    type Symbol = ();
    type Probability = u32;
}

impl EncoderModel<BITS> for Known {
    fn left_cumulative_and_probability(&self, _: impl Borrow<()>) -> Option<(u32, NonZeroU32)> {
        NonZeroU32::new(self.0.width).map(|width| (self.0.left, width))
    }
}

/// A search for the symbol at a quantile.
struct Search<F>(F);

impl<F> EntropyModel<BITS> for Search<F> {
    type Symbol = u32;
    type Probability = u32;
}

impl<F: Fn(u32) -> (u32, Place)> DecoderModel<BITS> for Search<F> {
    fn quantile_function(&self, quantile: u32) -> (u32, u32, NonZeroU32) {
        let (symbol, place) = (self.0)(quantile);
        (symbol, place.left, NonZeroU32::new(place.width).unwrap_or(NonZeroU32::MIN))
    }
}

/// Bits of an uncoded digit.
const DIGIT: u32 = 16;

fn digit(value: u32, width: u32) -> Place {
    Place {
        left: value << (PRECISION - width),
        width: 1 << (PRECISION - width),
    }
}

fn checksum(words: &[u32]) -> u32 {
    const CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISO_HDLC);
    let mut digest = CRC.digest();
    words.iter().for_each(|word| digest.update(&word.to_le_bytes()));
    digest.finalize()
}

/// Collects the reports of a [`Sensor`](crate::Sensor) in a stream.
#[derive(Debug, Clone)]
pub struct StreamWriter {
    encoder: RangeEncoder<u32, u64>,
    flags: Option<Flags>,
    slots: u32,
}

impl StreamWriter {
    /// An empty stream.
    pub fn new(silence: Silence) -> Self {
        Self {
            encoder: RangeEncoder::new(),
            flags: (silence == Silence::Coded).then(Flags::new),
            slots: 0,
        }
    }

    fn encode(&mut self, place: Place) -> Result<(), CodecError> {
        self.encoder
            .encode_symbol((), Known(place))
            .map_err(|_| damaged("a symbol without frequency"))
    }

    fn raw(&mut self, packet: &Packet) -> Result<(), CodecError> {
        let mut reader = packet.reader();
        while reader.remaining() > 0 {
            let width = reader.remaining().min(DIGIT);
            let value = reader.read(width)? as u32;
            self.encode(digit(value, width))?;
        }
        Ok(())
    }

    /// The first sample.
    pub(crate) fn first(&mut self, sample: f64) -> Result<(), CodecError> {
        let mut packet = Packet::default();
        push_number(&mut packet.0, sample);
        self.encode(digit(packet.bits() as u32, 8))?;
        self.slots = self.slots.saturating_add(1);
        self.raw(&packet)
    }

    pub(crate) fn put(&mut self, content: Option<&Content>, replica: &Replica, slot: &Slot) -> Result<(), CodecError> {
        self.slots = self.slots.saturating_add(1);
        if let Some(flags) = &mut self.flags {
            let place = flags.place(content.is_none());
            flags.add(content.is_none());
            self.encode(place)?;
        }
        let Some(content) = content else {
            return Ok(());
        };
        self.encode(content.place(&replica.law(slot)))?;
        let mut rest = Packet::default();
        content.push_rest(&mut rest.0);
        if rest.bits() > 0 {
            self.encode(digit(rest.bits() as u32, 8))?;
            self.raw(&rest)?;
        }
        Ok(())
    }

    /// The words of the finished stream, then the number of its slots and the CRC-32 (ISO-HDLC) of all of these, little-endian.
    /// [`StreamReader::open`] reads them. For 2^32 slots and more the number is `u32::MAX`.
    pub fn seal(self) -> Vec<u32> {
        let slots = self.slots;
        let mut words = self.finish();
        words.push(slots);
        words.push(checksum(&words));
        words
    }

    /// The words of the finished stream. A reader cannot detect missing or damaged words: the container must,
    /// or use [`seal`](Self::seal).
    pub fn finish(self) -> Vec<u32> {
        self.encoder.into_compressed().unwrap_infallible()
    }
}

/// Reads what a [`StreamWriter`] wrote. Any words give samples or errors.
#[derive(Debug, Clone)]
pub struct StreamReader<'a> {
    decoder: RangeDecoder<u32, u64, constriction::backends::Cursor<u32, &'a [u32]>>,
    flags: Option<Flags>,
    /// Whether the next slot is silent, if the stream itself does not say it.
    silent: Option<bool>,
    /// Number of slots left to be read, if the stream has it.
    left: Option<u32>,
}

fn damaged(value: impl std::fmt::Display) -> CodecError {
    CodecError::invalid("stream", value, "what a writer of the same configuration wrote")
}

impl<'a> StreamReader<'a> {
    /// A reader at the first word.
    ///
    /// # Errors
    /// If the stream is empty.
    pub fn new(words: &'a [u32], silence: Silence) -> Result<Self, CodecError> {
        Ok(Self {
            decoder: RangeDecoder::from_compressed(words).unwrap_infallible(),
            flags: (silence == Silence::Coded).then(Flags::new),
            silent: None,
            left: None,
        })
    }

    /// A reader of a sealed stream ([`StreamWriter::seal`]). After as many slots as were written it returns errors.
    ///
    /// # Errors
    /// If words are missing, too many or damaged.
    pub fn open(sealed: &'a [u32], silence: Silence) -> Result<Self, CodecError> {
        let [words @ .., slots, stored] = sealed else {
            return Err(damaged(format!("{} words", sealed.len())));
        };
        let found = checksum(&sealed[..sealed.len() - 1]);
        if found != *stored {
            return Err(damaged(format!("checksum {found:#010x} where {stored:#010x} is stored")));
        }
        Ok(Self {
            left: Some(*slots),
            ..Self::new(words, silence)?
        })
    }

    /// Slots that are left to be read; `None` if the stream was not sealed.
    pub fn slots_left(&self) -> Option<u32> {
        self.left
    }

    fn begin_slot(&mut self) -> Result<(), CodecError> {
        match &mut self.left {
            Some(0) => Err(damaged("no slot left")),
            Some(u32::MAX) | None => Ok(()),
            Some(left) => {
                *left -= 1;
                Ok(())
            }
        }
    }

    /// Tells a reader of [`Silence::Timed`] whether the next slot is silent.
    pub fn next_slot(&mut self, silent: bool) {
        self.silent = Some(silent);
    }

    fn decode(&mut self, find: impl Fn(u32) -> (u32, Place)) -> Result<u32, CodecError> {
        self.decoder
            .decode_symbol(Search(find))
            .map_err(|_| damaged("not decodable"))
    }

    fn digit(&mut self, width: u32) -> Result<u32, CodecError> {
        self.decode(|quantile| {
            let value = quantile >> (PRECISION - width);
            (value, digit(value, width))
        })
    }

    fn raw(&mut self) -> Result<Packet, CodecError> {
        let mut left = self.digit(8)?;
        if left > 128 {
            return Err(damaged(format!("{left} raw bits")));
        }
        let mut packet = Packet::default();
        while left > 0 {
            let width = left.min(DIGIT);
            packet.0.push(u64::from(self.digit(width)?), width);
            left -= width;
        }
        Ok(packet)
    }

    pub(crate) fn first(&mut self) -> Result<f64, CodecError> {
        self.begin_slot()?;
        let packet = self.raw()?;
        let mut reader = packet.reader();
        let sample = read_number(&mut reader)?;
        reader.finish()?;
        Ok(sample)
    }

    pub(crate) fn get(&mut self, replica: &Replica, slot: &Slot) -> Result<Option<Content>, CodecError> {
        self.begin_slot()?;
        let silent = match self.flags.take() {
            Some(mut flags) => {
                let reported = flags.place(false);
                let silent = self.decode(|quantile| {
                    let silent = quantile >= reported.width;
                    (u32::from(silent), flags.place(silent))
                });
                let silent = silent? == 1;
                flags.add(silent);
                self.flags = Some(flags);
                silent
            }
            None => self.silent.take().unwrap_or(false),
        };
        if silent {
            return Ok(None);
        }
        let law: Law<'_> = replica.law(slot);
        let symbol = self.decode(|quantile| law.find(quantile))?;
        let rest = if symbol == ESCAPE {
            self.raw()?
        } else {
            Packet::default()
        };
        let mut reader = rest.reader();
        let content = report::content(symbol, &mut reader)?;
        reader.finish()?;
        Ok(Some(content))
    }
}
