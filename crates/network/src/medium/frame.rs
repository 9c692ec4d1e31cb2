//! Frames: real bits with a header by which two ends see whether they still agree.

use super::channel::Check;
use crc::{CRC_16_XMODEM, Crc};
use fewbits_core::{BitReader, BitString, BitWriter, CodecError};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Kind of content of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum Kind {
    /// What sensors are told before they measure.
    Question,
    /// A sensor's report.
    Report,
    /// What a fusion centre received, for those that follow it.
    Echo,
    /// The whole shared state.
    Snapshot,
    /// A request for a snapshot.
    Request,
    /// A belief that travels on, and to whom.
    Handover,
    /// A digest alone.
    Beacon,
    /// A whole frame that other nodes pass on, and the sensor that it is from or for.
    Relayed,
}

const KINDS: [Kind; 8] = [
    Kind::Question,
    Kind::Report,
    Kind::Echo,
    Kind::Snapshot,
    Kind::Request,
    Kind::Handover,
    Kind::Beacon,
    Kind::Relayed,
];
const KIND_BITS: u32 = 3;
const SLOT_BITS: u32 = 29;
const DIGEST_BITS: u32 = 32;
const FIXED_BITS: u32 = KIND_BITS + SLOT_BITS + DIGEST_BITS;
const DESTINATION_BITS: u32 = 32;
const CHECK_BITS: u32 = 16;

impl Kind {
    fn is_addressed(self) -> bool {
        matches!(self, Self::Handover | Self::Relayed)
    }
}

/// A frame: 64 bits of header (96 for a handover or a relayed frame, which name a node), the payload, a check of 16 bits.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Frame {
    /// Kind of content.
    pub kind: Kind,
    /// The sequence number: the slot that it belongs to, below `2^29`.
    pub slot: u32,
    /// Digest of the state that both ends must share for the payload to mean anything.
    pub digest: u32,
    /// To whom a handover goes in the end; the sensor that a relayed frame is from or for; 0 for others.
    pub destination: u32,
    /// The message proper.
    pub payload: BitString,
}

impl Frame {
    /// A frame to a neighbour or to all.
    pub fn new(kind: Kind, slot: u32, digest: u32, payload: BitString) -> Self {
        Self {
            kind,
            slot,
            digest,
            destination: 0,
            payload,
        }
    }

    /// This frame as other nodes pass it on; `sensor` is whom it is from or for.
    ///
    /// # Errors
    /// As [`to_bits`](Self::to_bits).
    pub fn relayed(&self, sensor: u32) -> Result<Self, CodecError> {
        Ok(Self {
            destination: sensor,
            ..Self::new(Kind::Relayed, self.slot, self.digest, self.to_bits(Check::Whole)?)
        })
    }

    /// Bits of the header of a frame of this kind.
    pub fn header_bits(kind: Kind) -> u32 {
        FIXED_BITS + if kind.is_addressed() { DESTINATION_BITS } else { 0 }
    }

    /// Bits of a frame of this kind besides its payload.
    pub fn overhead(kind: Kind) -> u32 {
        Self::header_bits(kind) + CHECK_BITS
    }

    /// What a frame says it carries, unchecked.
    pub(crate) fn kind_of(bits: &BitString) -> Option<Kind> {
        let first = bits.bytes().first().filter(|_| bits.bits() >= KIND_BITS as usize)?;
        KINDS.get(usize::from(first >> (8 - KIND_BITS))).copied()
    }

    /// The bits that travel.
    ///
    /// # Errors
    /// If the slot does not fit 29 bits.
    pub fn to_bits(&self, check: Check) -> Result<BitString, CodecError> {
        let mut writer = BitWriter::with_capacity(self.payload.bits() + Self::overhead(self.kind) as usize);
        let kind = KINDS.iter().position(|kind| *kind == self.kind).unwrap_or(0);
        if self.slot >> SLOT_BITS != 0 {
            return Err(CodecError::ValueTooLarge {
                value: u64::from(self.slot),
                width: SLOT_BITS,
            });
        }
        let start = (kind as u64) << SLOT_BITS | u64::from(self.slot);
        writer.write(start << DIGEST_BITS | u64::from(self.digest), FIXED_BITS)?;
        if self.kind.is_addressed() {
            writer.write(u64::from(self.destination), DESTINATION_BITS)?;
        }
        let header = writer.bits();
        writer.append(&self.payload);
        let covered = match check {
            Check::Header => header,
            Check::Whole => writer.bits(),
        };
        let sum = crc(writer.as_bit_string(), covered);
        writer.write(u64::from(sum), CHECK_BITS)?;
        Ok(writer.finish())
    }

    /// The frame that `bits` hold. Total.
    ///
    /// # Errors
    /// If the bits end early, the check fails or there is no such kind of frame.
    pub fn from_bits(bits: &BitString, check: Check) -> Result<Self, CodecError> {
        let mut reader = BitReader::new(bits);
        let fixed = reader.read(FIXED_BITS)?;
        let kind = (fixed >> (SLOT_BITS + DIGEST_BITS)) as usize;
        let kind = *KINDS.get(kind).ok_or_else(|| invalid("kind", kind, "below 8"))?;
        let slot = (fixed >> DIGEST_BITS) as u32 & ((1 << SLOT_BITS) - 1);
        let digest = fixed as u32;
        let destination = match kind {
            kind if kind.is_addressed() => reader.read(DESTINATION_BITS)? as u32,
            _ => 0,
        };
        let length = reader
            .remaining()
            .checked_sub(CHECK_BITS as usize)
            .ok_or(CodecError::EndOfMessage {
                requested: CHECK_BITS,
                available: reader.remaining(),
            })?;
        let payload = reader.read_message(length)?;
        let covered = match check {
            Check::Header => Self::header_bits(kind) as usize,
            Check::Whole => bits.bits() - CHECK_BITS as usize,
        };
        let sum = reader.read(CHECK_BITS)?;
        if sum != u64::from(crc(bits, covered)) {
            return Err(invalid("frame check", sum as usize, "that of the bits before"));
        }
        Ok(Self {
            kind,
            slot,
            digest,
            destination,
            payload,
        })
    }
}

fn invalid(what: &'static str, value: usize, expected: &'static str) -> CodecError {
    CodecError::Invalid {
        what,
        value: value.to_string(),
        expected,
    }
}

/// The frame check of IEEE 802.15.4, CRC-16 with polynomial `x^16 + x^12 + x^5 + 1` from zero, over the first `covered` bits.
fn crc(bits: &BitString, covered: usize) -> u16 {
    const SUM: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);
    let (whole, rest) = bits.bytes().split_at(covered / 8);
    let left = covered % 8;
    let last = rest.first().map_or(0, |byte| byte & !(0xff >> left));
    (0..left).fold(SUM.checksum(whole) ^ u16::from(last) << 8, |register, _| {
        register << 1 ^ if register >> 15 == 1 { 0x1021 } else { 0 }
    })
}

/// Digest of 32 bits of shared state: FNV-1a over slot, length and bytes, folded.
pub fn digest(slot: u64, bits: &BitString) -> u32 {
    let start = 0xcbf2_9ce4_8422_2325_u64;
    let add = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    let hash = slot.to_le_bytes().iter().fold(start, add);
    let hash = (bits.bits() as u64).to_le_bytes().iter().fold(hash, add);
    let hash = bits.bytes().iter().fold(hash, add);
    (hash ^ hash >> 32) as u32
}

/// Bits as they are stored.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Stored(#[serde(with = "stored")] pub BitString);

/// `BitString` for serde: bytes and length.
pub(crate) mod stored {
    use super::{BitString, Deserialize, Deserializer, Serialize, Serializer};

    pub(crate) fn serialize<S: Serializer>(bits: &BitString, to: S) -> Result<S::Ok, S::Error> {
        (bits.bytes(), bits.bits()).serialize(to)
    }

    pub(crate) fn deserialize<'de, D: Deserializer<'de>>(from: D) -> Result<BitString, D::Error> {
        let (bytes, bits) = <(Vec<u8>, usize)>::deserialize(from)?;
        BitString::from_bytes(bytes, bits).map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn bit_string() -> impl Strategy<Value = BitString> {
        (prop::collection::vec(any::<u8>(), 0..40), 0_usize..8).prop_map(|(bytes, less)| {
            let bits = (bytes.len() * 8).saturating_sub(less);
            let whole = BitString::from_bytes(bytes, bits).unwrap();
            BitReader::new(&whole).read_message(bits).unwrap()
        })
    }

    proptest! {
        #[test]
        fn frames_come_back_and_any_bits_are_a_frame_or_an_error(
            payload in bit_string(), slot in 0_u32..1 << 29, digest in any::<u32>(), kind in 0_usize..8, noise in bit_string(),
            flip in any::<prop::sample::Index>(),
        ) {
            let mut frame = Frame::new(KINDS[kind], slot, digest, payload);
            if frame.kind.is_addressed() {
                frame.destination = digest;
            }
            for check in [Check::Whole, Check::Header] {
                let bits = frame.to_bits(check).unwrap();
                prop_assert_eq!(bits.bits(), frame.payload.bits() + Frame::overhead(frame.kind) as usize);
                prop_assert_eq!(&Frame::from_bits(&bits, check).unwrap(), &frame);
                let _ = Frame::from_bits(&noise, check);
                // The check finds every single inverted bit that it covers.
                let damaged = bits.clone().with_flipped(flip.index(bits.bits()));
                match check {
                    Check::Whole => prop_assert!(Frame::from_bits(&damaged, check).is_err()),
                    Check::Header => prop_assert!(Frame::from_bits(&damaged, check).map_or(true, |f| f.slot == slot)),
                }
            }
        }
    }

    #[test]
    fn the_check_is_that_of_the_standard() {
        // CRC-16/XMODEM of "123456789", the catalogue's check value.
        let bits = BitString::from_bytes(b"123456789".to_vec(), 72).unwrap();
        assert_eq!(crc(&bits, 72), 0x31c3);
        assert_ne!(digest(1, &bits), digest(2, &bits));
        assert!(
            Frame::new(Kind::Report, 1 << 29, 0, BitString::default())
                .to_bits(Check::Whole)
                .is_err()
        );
    }
}
