//! Packets: bit strings of at most 128 bits.

use fewbits_core::{BitReader, BitWriter, CodecError, Message};
use fewbits_node::adaptive::TENS;
use fewbits_numerics::ArgumentError;
use serde::{Deserialize, Serialize};

/// The bits that a sensor sends in one slot. The receiver knows their number from the frame, so it is not encoded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(try_from = "Stored", into = "Stored")]
pub struct Packet(pub(crate) fewbits_node::Packet);

/// The stored form of [`Packet`].
#[derive(Serialize, Deserialize)]
#[serde(rename = "Packet", deny_unknown_fields)]
struct Stored {
    word: u128,
    bits: u32,
}

impl From<Packet> for Stored {
    fn from(packet: Packet) -> Self {
        Self {
            word: packet.0.word(),
            bits: packet.0.bits(),
        }
    }
}

impl TryFrom<Stored> for Packet {
    type Error = ArgumentError;

    fn try_from(Stored { word, bits }: Stored) -> Result<Self, ArgumentError> {
        let packet = fewbits_node::Packet::from_word(word, bits).map(Packet);
        packet.ok_or_else(|| ArgumentError::new("bits", bits, "at most 128, as many as the word has"))
    }
}

impl Packet {
    /// Length in bits.
    pub fn bits(&self) -> usize {
        self.0.bits() as usize
    }

    pub(crate) fn reader(&self) -> PacketReader {
        PacketReader {
            packet: self.0,
            position: 0,
        }
    }
}

/// A packet is encoded as its own bits; no format is needed.
impl Message for Packet {
    type Format = ();

    fn encode(&self, (): &(), writer: &mut BitWriter) -> Result<(), CodecError> {
        let (word, bits) = (self.0.word(), self.0.bits());
        let high = bits.saturating_sub(64);
        writer.write((word >> (bits - high)) as u64 & low_mask(high), high)?;
        let low = bits - high;
        writer.write(word as u64 & low_mask(low), low)
    }

    fn decode((): &(), reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        if reader.remaining() > 128 {
            return Err(CodecError::invalid("packet", format!("{} bits long", reader.remaining()), "at most 128 bits"));
        }
        let mut packet = fewbits_node::Packet::default();
        while reader.remaining() > 0 {
            let width = reader.remaining().min(64) as u32;
            packet.push(reader.read(width)?, width);
        }
        Ok(Self(packet))
    }
}

fn low_mask(width: u32) -> u64 {
    if width >= 64 { u64::MAX } else { (1 << width) - 1 }
}

/// Reads bits from the front of a packet.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PacketReader {
    packet: fewbits_node::Packet,
    position: u32,
}

impl PacketReader {
    pub(crate) fn remaining(&self) -> u32 {
        self.packet.bits() - self.position
    }

    pub(crate) fn read(&mut self, width: u32) -> Result<u64, CodecError> {
        if self.remaining() < width {
            return Err(CodecError::EndOfMessage {
                requested: width,
                available: self.remaining() as usize,
            });
        }
        self.position += width;
        Ok((self.packet.word() >> self.remaining()) as u64 & low_mask(width))
    }

    /// The next `width` bits without consuming them, zeros after the end.
    pub(crate) fn peek(&self, width: u32) -> u64 {
        let there = self.remaining().min(width);
        let bits = (self.packet.word() >> (self.remaining() - there)) as u64 & low_mask(there);
        bits << (width - there)
    }

    pub(crate) fn finish(&self) -> Result<(), CodecError> {
        match self.remaining() {
            0 => Ok(()),
            left => Err(CodecError::TrailingBits { left: left as usize }),
        }
    }
}

/// Reads what [`push_number`](fewbits_node::adaptive::push_number) wrote.
pub(crate) fn read_number(reader: &mut PacketReader) -> Result<f64, CodecError> {
    if reader.read(1)? == 1 {
        let value = f64::from_bits(reader.read(64)?);
        return if value.is_finite() {
            Ok(value)
        } else {
            Err(CodecError::invalid("sample", value, "a finite number"))
        };
    }
    let negative = reader.read(1)? == 1;
    let decimals = reader.read(4)? as usize;
    let length = reader.read(6)? as u32;
    if length > 52 {
        return Err(CodecError::invalid("length of the digits", length, "at most 52 bits"));
    }
    let size = reader.read(length)? as f64 / TENS.get(decimals).copied().unwrap_or(1.0);
    Ok(if negative { -size } else { size })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use fewbits_node::adaptive::push_number;

    #[test]
    fn numbers_return_exactly() {
        let values = [
            0.0,
            279.0,
            -0.043,
            22.482,
            1e-300,
            -1e300,
            f64::MAX,
            1.0 / 3.0,
            5e-324,
            123_456_789.25,
            9e15,
        ];
        for value in values {
            let mut packet = Packet::default();
            push_number(&mut packet.0, value);
            let mut reader = packet.reader();
            assert_eq!(read_number(&mut reader).unwrap(), value);
            reader.finish().unwrap();
        }
        let mut packet = Packet::default();
        push_number(&mut packet.0, 279.0);
        assert_eq!(packet.bits(), 12 + 9);
    }
}
