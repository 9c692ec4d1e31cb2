//! Frames: the bytes that are sent, and their codec. `docs/wire.md` has the format byte by byte.

use crate::payload::Payload;
use crate::slot::Slot;
use core::fmt;
use crc::{CRC_16_XMODEM, Crc};

/// The version of the wire format that this crate writes and reads.
pub(crate) const VERSION: u8 = 1;
/// Bytes of the header: one for version, kind and padding, three for the slot, four for the digest.
const HEADER_BYTES: usize = 8;
/// Bytes of the destination, which follows the header in a handover.
const DESTINATION_BYTES: usize = 4;
/// Bytes of the check at the end.
pub const CHECK_BYTES: usize = 2;

const VERSION_SHIFT: u32 = 6;
const KIND_SHIFT: u32 = 3;
const SUM: Crc<u16> = Crc::<u16>::new(&CRC_16_XMODEM);

/// Kind of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(rename_all = "kebab-case"))]
#[repr(u8)]
pub enum Kind {
    /// What a sensor must know before it measures.
    Feedback = 0,
    /// A sensor's report.
    Report = 1,
    /// What the fusion centre received in the slot before, for sensors that follow its filter.
    Echo = 2,
    /// The whole state of the filter after the slot before.
    Snapshot = 3,
    /// A request for a snapshot.
    Request = 4,
    /// A belief that is sent to another node, and the address of that node.
    Handover = 5,
    /// A frame without payload: the sender works, and its slot sets clocks.
    Heartbeat = 6,
    /// The frame of this slot and digest has arrived.
    Acknowledgement = 7,
}

impl Kind {
    const ALL: [Self; 8] = [
        Self::Feedback,
        Self::Report,
        Self::Echo,
        Self::Snapshot,
        Self::Request,
        Self::Handover,
        Self::Heartbeat,
        Self::Acknowledgement,
    ];

    /// Bytes of a frame of this kind besides its payload.
    pub const fn overhead(self) -> usize {
        self.header() + CHECK_BYTES
    }

    const fn header(self) -> usize {
        match self {
            Self::Handover => HEADER_BYTES + DESTINATION_BYTES,
            _ => HEADER_BYTES,
        }
    }
}

/// What the check at the end of a frame covers. Both ends must use the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(rename_all = "kebab-case"))]
pub enum Check {
    /// Header and payload: a frame with an inverted bit is discarded.
    #[default]
    Whole,
    /// Only the header: bits of the payload may arrive inverted, and the receiver's likelihood contains their probability.
    Header,
}

/// A frame: a header, by which two ends detect that their states differ, and a payload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame<'a> {
    /// Kind of the frame.
    pub kind: Kind,
    /// The slot that it belongs to.
    pub slot: Slot,
    /// Digest of the shared state that is needed to interpret the payload.
    pub digest: u32,
    /// Address of the node for which a handover is meant; 0 and not sent in other frames.
    pub destination: u32,
    /// The message.
    pub payload: Payload<'a>,
}

impl<'a> Frame<'a> {
    /// A frame of another kind than [`Kind::Handover`].
    pub fn new(kind: Kind, slot: Slot, digest: u32, payload: Payload<'a>) -> Self {
        Self {
            kind,
            slot,
            digest,
            destination: 0,
            payload,
        }
    }

    /// Length of the encoded frame in bytes.
    #[expect(clippy::len_without_is_empty, reason = "never empty")]
    pub fn len(&self) -> usize {
        self.kind.overhead() + self.payload.bytes().len()
    }

    /// Writes the frame to the beginning of `buffer` and returns the bytes written. `None` if they do not fit.
    pub fn encode<'b>(&self, check: Check, buffer: &'b mut [u8]) -> Option<&'b [u8]> {
        let bytes = buffer.get_mut(..self.len())?;
        // Without indexing: the optimiser can then remove every panic.
        let (content, sum) = bytes.split_last_chunk_mut::<CHECK_BYTES>()?;
        let (header, payload) = content.split_at_mut_checked(self.kind.header())?;
        let (first, destination) = header.split_first_chunk_mut::<HEADER_BYTES>()?;
        let [_, s0, s1, s2] = self.slot.number().to_be_bytes();
        let [d0, d1, d2, d3] = self.digest.to_be_bytes();
        let kind = VERSION << VERSION_SHIFT | (self.kind as u8) << KIND_SHIFT | self.payload.padding();
        *first = [kind, s0, s1, s2, d0, d1, d2, d3];
        if let Some(destination) = destination.first_chunk_mut::<DESTINATION_BYTES>() {
            *destination = self.destination.to_be_bytes();
        }
        payload
            .iter_mut()
            .zip(self.payload.bytes())
            .for_each(|(to, from)| *to = *from);
        let covered = match check {
            Check::Whole => content.len(),
            Check::Header => self.kind.header(),
        };
        *sum = SUM.checksum(content.get(..covered)?).to_be_bytes();
        Some(bytes)
    }

    /// The encoded frame.
    #[cfg(feature = "std")]
    pub fn to_bytes(&self, check: Check) -> Vec<u8> {
        let mut bytes = vec![0; self.len()];
        // The buffer is as long as the frame.
        self.encode(check, &mut bytes);
        bytes
    }

    /// The kind that bytes claim to be, without any check; `None` if there are no bytes.
    pub fn kind_of(bytes: &[u8]) -> Option<Kind> {
        // Three bits: always one of the eight.
        bytes
            .first()
            .and_then(|first| Kind::ALL.get(usize::from(first >> KIND_SHIFT & 7)).copied())
    }

    /// Reads a frame that takes all of `bytes`. Any bytes give a frame or an error.
    ///
    /// # Errors
    /// If the bytes are of another version, too few, fail their check, or use bits that must be zero.
    pub fn decode(bytes: &'a [u8], check: Check) -> Result<Self, DecodeError> {
        let (Some(first), Some(kind)) = (bytes.first(), Self::kind_of(bytes)) else {
            return Err(DecodeError::TooShort { found: 0 });
        };
        let version = first >> VERSION_SHIFT;
        if version != VERSION {
            return Err(DecodeError::Version { found: version });
        }
        let padding = usize::from(first & 7);
        let too_short = DecodeError::TooShort { found: bytes.len() };
        // Without indexing: the optimiser can then remove every panic.
        let (content, sum) = bytes.split_last_chunk::<CHECK_BYTES>().ok_or(too_short)?;
        let (fields, rest) = content.split_first_chunk::<HEADER_BYTES>().ok_or(too_short)?;
        let (destination, payload) = match kind {
            Kind::Handover => rest
                .split_first_chunk::<DESTINATION_BYTES>()
                .map(|(destination, payload)| (u32::from_be_bytes(*destination), payload))
                .ok_or(too_short)?,
            _ => (0, rest),
        };
        // If the check covers the header only, inverted bits of the payload reach the estimator, which knows their probability.
        let covered = match check {
            Check::Whole => content,
            Check::Header => content.get(..kind.header()).ok_or(too_short)?,
        };
        if SUM.checksum(covered).to_be_bytes() != *sum {
            return Err(DecodeError::Check);
        }
        // The payload ends `padding` bits before its last byte does.
        let bits = payload
            .len()
            .checked_mul(8)
            .and_then(|bits| bits.checked_sub(padding))
            .ok_or(DecodeError::Padding)?;
        let [_, s0, s1, s2, d0, d1, d2, d3] = *fields;
        Ok(Self {
            kind,
            slot: Slot::of_count(u64::from(u32::from_be_bytes([0, s0, s1, s2]))),
            digest: u32::from_be_bytes([d0, d1, d2, d3]),
            destination,
            payload: Payload::new(payload, bits).ok_or(DecodeError::Padding)?,
        })
    }
}

/// Why bytes are not a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[cfg_attr(feature = "std", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "std", serde(rename_all = "kebab-case"))]
#[non_exhaustive]
pub enum DecodeError {
    /// The frame is of another version of the format, 0 to 3. Nothing else was checked.
    Version {
        /// The version.
        found: u8,
    },
    /// There are fewer bytes than header and check need.
    TooShort {
        /// Number of bytes.
        found: usize,
    },
    /// The check at the end does not match the bytes before.
    Check,
    /// There is more padding than payload, or padding that is not zero.
    Padding,
}

impl fmt::Display for DecodeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Version { found } => write!(f, "version of the frame is {found}: expected {VERSION}"),
            Self::TooShort { found } => {
                write!(f, "frame has {found} bytes: expected {} or more", HEADER_BYTES + CHECK_BYTES)
            }
            Self::Check => f.write_str("check of the frame is not that of its bytes"),
            Self::Padding => f.write_str("padding of the frame is not zero, or more than its payload"),
        }
    }
}

impl core::error::Error for DecodeError {}

/// Digest of 32 bits of a payload and its slot: FNV-1a of 64 bits over slot, number of bits and bytes, folded.
///
/// It detects that the states of two ends differ. It does not protect against forgery; that is the task of the link.
pub fn digest(slot: Slot, payload: Payload<'_>) -> u32 {
    let add = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3);
    let start = 0xcbf2_9ce4_8422_2325_u64;
    let hash = u64::from(slot.number()).to_le_bytes().iter().fold(start, add);
    let hash = (payload.bits() as u64).to_le_bytes().iter().fold(hash, add);
    let hash = payload.bytes().iter().fold(hash, add);
    (hash ^ hash >> 32) as u32
}
