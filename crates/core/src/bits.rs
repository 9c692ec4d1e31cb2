//! Messages as sequences of bits.
//!
//! Every report is encoded bit by bit, so that the cost that is reported is the length of an encoding that exists. Bits are packed most
//! significant first; the last byte is padded with zeros.
//!
//! ```
//! use fewbits_core::bits::{BitReader, BitWriter};
//! let mut writer = BitWriter::new();
//! writer.write(true as u64, 1)?;
//! writer.write(5, 3)?;
//! let message = writer.finish();
//! assert_eq!((message.bits(), message.bytes()), (4, &[0b1101_0000][..]));
//! let mut reader = BitReader::new(&message);
//! assert_eq!((reader.read(1)?, reader.read(3)?), (1, 5));
//! assert!(reader.read(1).is_err());
//! # Ok::<(), fewbits_core::bits::CodecError>(())
//! ```

use smallvec::SmallVec;
use thiserror::Error;

/// Why bits could not be written or read.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CodecError {
    /// The reader ran out of bits.
    #[error("message ends after {available} bits: {requested} more were expected")]
    EndOfMessage {
        /// Bits that were asked for.
        requested: u32,
        /// Bits that were left.
        available: usize,
    },
    /// A field wider than 64 bits.
    #[error("field of {width} bits: expected at most 64")]
    FieldTooWide {
        /// Requested width.
        width: u32,
    },
    /// The value does not fit into its field.
    #[error("value {value} does not fit into {width} bits")]
    ValueTooLarge {
        /// The value.
        value: u64,
        /// Width of the field in bits.
        width: u32,
    },
    /// The bits do not encode a message of this type.
    #[error("{what} is {value}: expected {expected}")]
    Invalid {
        /// Name of the decoded field.
        what: &'static str,
        /// The value that was decoded.
        value: String,
        /// What would have been accepted.
        expected: &'static str,
    },
    /// Bits were left after a complete message.
    #[error("{left} bits are left over behind the message")]
    TrailingBits {
        /// Bits that were not read.
        left: usize,
    },
}

impl CodecError {
    /// [`CodecError::Invalid`] with a value of any type.
    pub fn invalid(what: &'static str, value: impl ToString, expected: &'static str) -> Self {
        Self::Invalid {
            what,
            value: value.to_string(),
            expected,
        }
    }
}

/// A finished sequence of bits. Up to 16 bytes need no heap memory. Serialised as its bytes and the number of bits.
#[derive(Debug, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(try_from = "(Vec<u8>, usize)", into = "(Vec<u8>, usize)")]
pub struct BitString {
    bytes: SmallVec<[u8; 16]>,
    bits: usize,
}

impl Clone for BitString {
    #[inline]
    fn clone(&self) -> Self {
        Self {
            bytes: SmallVec::from_slice(&self.bytes),
            bits: self.bits,
        }
    }
}

impl BitString {
    /// The first `bits` bits of `bytes`. Later bits are dropped, so that messages of equal bits are equal values.
    ///
    /// # Errors
    /// If `bytes` is too short.
    pub fn from_bytes(bytes: Vec<u8>, bits: usize) -> Result<Self, CodecError> {
        if bits > bytes.len().saturating_mul(8) {
            return Err(CodecError::EndOfMessage {
                requested: u32::try_from(bits).unwrap_or(u32::MAX),
                available: bytes.len() * 8,
            });
        }
        let mut bytes: SmallVec<[u8; 16]> = bytes.into();
        bytes.truncate(bits.div_ceil(8));
        let padding = 8 * bytes.len() - bits;
        if let Some(last) = bytes.last_mut() {
            *last = *last >> padding << padding;
        }
        Ok(Self { bytes, bits })
    }

    /// Length in bits: the cost of the message.
    pub fn bits(&self) -> usize {
        self.bits
    }

    /// The packed bytes.
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    /// The same message with bit `index` inverted, as a noisy link may deliver it. Unchanged if `index` is not below the length.
    pub fn with_flipped(mut self, index: usize) -> Self {
        if index < self.bits {
            self.bytes[index / 8] ^= 0x80 >> (index % 8);
        }
        self
    }
}

impl TryFrom<(Vec<u8>, usize)> for BitString {
    type Error = CodecError;

    fn try_from((bytes, bits): (Vec<u8>, usize)) -> Result<Self, CodecError> {
        Self::from_bytes(bytes, bits)
    }
}

impl From<BitString> for (Vec<u8>, usize) {
    fn from(message: BitString) -> Self {
        (message.bytes.into_vec(), message.bits)
    }
}

/// Writes fields of 0 to 64 bits one after the other. Allocates at most once if made with enough capacity
/// ([`with_capacity`](Self::with_capacity)).
#[derive(Debug, Clone, Default)]
pub struct BitWriter {
    message: BitString,
}

impl BitWriter {
    /// An empty writer.
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty writer with room for `bits` bits.
    pub fn with_capacity(bits: usize) -> Self {
        Self {
            message: BitString {
                bytes: SmallVec::with_capacity(bits.div_ceil(8)),
                bits: 0,
            },
        }
    }

    /// Bits written so far.
    pub fn bits(&self) -> usize {
        self.message.bits
    }

    /// Writes the low `width` bits of `value`, most significant first.
    ///
    /// # Errors
    /// If `width > 64` or `value >= 2^width`; nothing is written then.
    #[inline]
    pub fn write(&mut self, value: u64, width: u32) -> Result<(), CodecError> {
        if width > 64 {
            return Err(CodecError::FieldTooWide { width });
        }
        if width < 64 && value >> width != 0 {
            return Err(CodecError::ValueTooLarge { value, width });
        }
        // The new field is placed behind the bits that the last byte holds already.
        let (bytes, held) = (&mut self.message.bytes, self.message.bits % 8);
        let end = held + width as usize;
        self.message.bits += width as usize;
        match bytes.last_mut() {
            Some(last) if held > 0 && end <= 8 => *last |= (value << (8 - end)) as u8,
            Some(last) if held > 0 => {
                *last |= (value >> (end - 8)) as u8;
                let left = end - 8;
                bytes.extend_from_slice(&(value << (64 - left)).to_be_bytes()[..left.div_ceil(8)]);
            }
            _ if width == 0 => {}
            _ if end <= 8 => bytes.push((value << (8 - end)) as u8),
            _ => bytes.extend_from_slice(&(value << (64 - end)).to_be_bytes()[..end.div_ceil(8)]),
        }
        Ok(())
    }

    /// Writes all bits of a message.
    pub fn append(&mut self, message: &BitString) {
        // All of a message can be read.
        let _ = BitReader::new(message).read_into(message.bits, self);
    }

    /// Empties the writer and keeps its memory.
    pub fn clear(&mut self) {
        self.message.bytes.clear();
        self.message.bits = 0;
    }

    /// The finished message.
    pub fn finish(self) -> BitString {
        self.message
    }
}

/// Reads fields in the order in which they were written. Any bits give a value or a [`CodecError`], never a panic.
#[derive(Debug, Clone)]
pub struct BitReader<'a> {
    message: &'a BitString,
    position: usize,
}

impl<'a> BitReader<'a> {
    /// A reader at the first bit.
    pub fn new(message: &'a BitString) -> Self {
        Self { message, position: 0 }
    }

    /// Bits not yet read.
    pub fn remaining(&self) -> usize {
        self.message.bits - self.position
    }

    /// Reads a field of `width` bits.
    ///
    /// # Errors
    /// If `width > 64` or fewer bits are left; nothing is consumed then.
    #[inline]
    pub fn read(&mut self, width: u32) -> Result<u64, CodecError> {
        if width > 64 {
            return Err(CodecError::FieldTooWide { width });
        }
        if self.remaining() < width as usize {
            return Err(CodecError::EndOfMessage {
                requested: width,
                available: self.remaining(),
            });
        }
        if width == 0 {
            return Ok(0);
        }
        let (rest, skipped) = (&self.message.bytes[self.position / 8..], self.position % 8);
        self.position += width as usize;
        // Eight bytes at once; near the end of the message the missing ones count as zero.
        let word = match rest.first_chunk() {
            Some(bytes) => u64::from_be_bytes(*bytes),
            None => (0..)
                .step_by(8)
                .zip(rest)
                .fold(0, |word, (i, byte)| word | u64::from(*byte) << (56 - i)),
        };
        let mut field = word << skipped;
        // A field that begins within a byte can reach into a ninth one.
        if skipped + width as usize > 64 {
            field |= u64::from(rest[8]) >> (8 - skipped);
        }
        Ok(field >> (64 - width))
    }

    /// Reads the next `bits` bits as a message.
    ///
    /// # Errors
    /// If fewer are left; nothing is consumed then.
    pub fn read_message(&mut self, bits: usize) -> Result<BitString, CodecError> {
        if self.remaining() < bits {
            return Err(CodecError::EndOfMessage {
                requested: u32::try_from(bits).unwrap_or(u32::MAX),
                available: self.remaining(),
            });
        }
        let mut writer = BitWriter::with_capacity(bits);
        self.read_into(bits, &mut writer)?;
        Ok(writer.finish())
    }

    /// Copies bits to a writer, whole bytes if both are at the beginning of a byte.
    fn read_into(&mut self, bits: usize, writer: &mut BitWriter) -> Result<(), CodecError> {
        let (first, whole) = (self.position / 8, bits / 8);
        let mut left = bits;
        if whole > 0 && (self.position | writer.message.bits).is_multiple_of(8) {
            let bytes = &self.message.bytes[first..first + whole];
            writer.message.bytes.extend_from_slice(bytes);
            writer.message.bits += 8 * whole;
            self.position += 8 * whole;
            left %= 8;
        }
        while left > 0 {
            let width = left.min(64) as u32;
            writer.write(self.read(width)?, width)?;
            left -= width as usize;
        }
        Ok(())
    }

    /// Confirms that the message was read to its end.
    ///
    /// # Errors
    /// If bits are left.
    pub fn finish(self) -> Result<(), CodecError> {
        match self.remaining() {
            0 => Ok(()),
            left => Err(CodecError::TrailingBits { left }),
        }
    }
}
