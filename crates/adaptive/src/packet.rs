//! Packets: whole bits, at most 128.

use fewbits_core::{BitReader, BitWriter, CodecError, Message};
use fewbits_numerics::ArgumentError;
use serde::{Deserialize, Serialize};

/// What a sensor sends in one slot. Its length is known from its frame, so no bit is spent on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
#[serde(try_from = "Stored")]
pub struct Packet {
    /// The bits, the last one lowest.
    word: u128,
    bits: u32,
}

#[derive(Deserialize)]
#[serde(rename = "Packet", deny_unknown_fields)]
struct Stored {
    word: u128,
    bits: u32,
}

impl TryFrom<Stored> for Packet {
    type Error = ArgumentError;

    fn try_from(Stored { word, bits }: Stored) -> Result<Self, ArgumentError> {
        let beyond = word.checked_shr(bits).unwrap_or(0);
        if bits > 128 || beyond != 0 {
            return Err(ArgumentError::new("bits", bits, "at most 128, as many as the word has"));
        }
        Ok(Self { word, bits })
    }
}

fn invalid(what: &'static str, value: impl std::fmt::Display, expected: &'static str) -> CodecError {
    CodecError::Invalid {
        what,
        value: value.to_string(),
        expected,
    }
}

impl Packet {
    /// Length.
    pub fn bits(&self) -> usize {
        self.bits as usize
    }

    /// Appends the low `width` bits of `value`; the callers of this crate never exceed 128.
    pub(crate) fn push(&mut self, value: u64, width: u32) {
        if width > 0 && self.bits + width <= 128 {
            let kept = if width >= 64 { value } else { value & ((1 << width) - 1) };
            self.word = self.word.checked_shl(width).unwrap_or(0) | u128::from(kept);
            self.bits += width;
        }
    }

    pub(crate) fn reader(&self) -> PacketReader {
        PacketReader {
            packet: *self,
            position: 0,
        }
    }
}

/// Nothing is agreed on beforehand: a packet is its bits.
impl Message for Packet {
    type Format = ();

    fn encode(&self, (): &(), writer: &mut BitWriter) -> Result<(), CodecError> {
        let high = self.bits.saturating_sub(64);
        writer.write((self.word >> (self.bits - high)) as u64 & low_mask(high), high)?;
        let low = self.bits - high;
        writer.write(self.word as u64 & low_mask(low), low)
    }

    fn decode((): &(), reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        if reader.remaining() > 128 {
            return Err(invalid("packet", format!("{} bits long", reader.remaining()), "at most 128 bits"));
        }
        let mut packet = Self::default();
        while reader.remaining() > 0 {
            let width = reader.remaining().min(64) as u32;
            packet.push(reader.read(width)?, width);
        }
        Ok(packet)
    }
}

fn low_mask(width: u32) -> u64 {
    if width >= 64 { u64::MAX } else { (1 << width) - 1 }
}

/// Reads a packet from its front.
#[derive(Debug, Clone, Copy)]
pub(crate) struct PacketReader {
    packet: Packet,
    position: u32,
}

impl PacketReader {
    pub(crate) fn remaining(&self) -> u32 {
        self.packet.bits - self.position
    }

    pub(crate) fn read(&mut self, width: u32) -> Result<u64, CodecError> {
        if self.remaining() < width {
            return Err(CodecError::EndOfMessage {
                requested: width,
                available: self.remaining() as usize,
            });
        }
        self.position += width;
        Ok((self.packet.word >> self.remaining()) as u64 & low_mask(width))
    }

    /// The next `width` bits without consuming them, zeros behind the end.
    pub(crate) fn peek(&self, width: u32) -> u64 {
        let there = self.remaining().min(width);
        let bits = (self.packet.word >> (self.remaining() - there)) as u64 & low_mask(there);
        bits << (width - there)
    }

    pub(crate) fn finish(&self) -> Result<(), CodecError> {
        match self.remaining() {
            0 => Ok(()),
            left => Err(CodecError::TrailingBits { left: left as usize }),
        }
    }
}

/// Powers of ten that are whole doubles.
pub(crate) const TENS: [f64; 16] = [
    1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7, 1e8, 1e9, 1e10, 1e11, 1e12, 1e13, 1e14, 1e15,
];

/// Appends any finite number exactly. Numbers of a few decimals, as instruments write them, take 12 bits and those of their
/// digits: `0`, sign, decimals (4 bits), length (6 bits), digits; all others `1` and 64 bits.
pub(crate) fn push_number(packet: &mut Packet, value: f64) {
    let size = value.abs();
    let fits = |(_, ten): &(usize, &f64)| {
        let digits = (size * **ten).round();
        digits < 9e15 && digits / **ten == size
    };
    let decimal = TENS
        .iter()
        .enumerate()
        .find(fits)
        .map(|(e, ten)| (e as u64, (size * ten).round() as u64));
    match decimal {
        Some((decimals, digits)) if 64 - digits.leading_zeros() < 53 => {
            let length = 64 - digits.leading_zeros();
            packet.push(0, 1);
            packet.push(u64::from(value < 0.0), 1);
            packet.push(decimals, 4);
            packet.push(u64::from(length), 6);
            packet.push(digits, length);
        }
        _ => {
            packet.push(1, 1);
            packet.push(value.to_bits(), 64);
        }
    }
}

/// Reads what [`push_number`] wrote.
pub(crate) fn read_number(reader: &mut PacketReader) -> Result<f64, CodecError> {
    if reader.read(1)? == 1 {
        let value = f64::from_bits(reader.read(64)?);
        return if value.is_finite() {
            Ok(value)
        } else {
            Err(invalid("sample", value, "a finite number"))
        };
    }
    let negative = reader.read(1)? == 1;
    let decimals = reader.read(4)? as usize;
    let length = reader.read(6)? as u32;
    if length > 52 {
        return Err(invalid("length of the digits", length, "at most 52 bits"));
    }
    let size = reader.read(length)? as f64 / TENS.get(decimals).copied().unwrap_or(1.0);
    Ok(if negative { -size } else { size })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

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
            push_number(&mut packet, value);
            let mut reader = packet.reader();
            assert_eq!(read_number(&mut reader).unwrap(), value);
            reader.finish().unwrap();
        }
        let mut packet = Packet::default();
        push_number(&mut packet, 279.0);
        assert_eq!(packet.bits(), 12 + 9);
    }
}
