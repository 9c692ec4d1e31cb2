//! Messages with a bit encoding.

use crate::bits::{BitReader, BitString, BitWriter, CodecError};

/// A value that can be sent, with its encoding in bits: a report, a broadcast, a belief.
///
/// Laws, checked by [`crate::laws::message`] for every implementation:
/// 1. decoding what was encoded gives the message back and leaves no bit over;
/// 2. decoding arbitrary bits gives a message or an error, never a panic.
///
/// What both ends know beforehand (the width of a word, a code book) is the `Format` and costs no bits.
pub trait Message: Sized {
    /// What sender and receiver agreed on beforehand.
    type Format;

    /// Appends the message's bits.
    ///
    /// # Errors
    /// If the message does not fit the format.
    fn encode(&self, format: &Self::Format, writer: &mut BitWriter) -> Result<(), CodecError>;

    /// Reads a message.
    ///
    /// # Errors
    /// If the bits are no message of this format.
    fn decode(format: &Self::Format, reader: &mut BitReader<'_>) -> Result<Self, CodecError>;

    /// Encodes the message alone.
    ///
    /// # Errors
    /// As [`Message::encode`].
    #[inline]
    fn to_bits(&self, format: &Self::Format) -> Result<BitString, CodecError> {
        let mut writer = BitWriter::new();
        self.encode(format, &mut writer)?;
        Ok(writer.finish())
    }

    /// Decodes a message that consists of all of `bits`.
    ///
    /// # Errors
    /// As [`Message::decode`], or if bits are left over.
    #[inline]
    fn from_bits(format: &Self::Format, bits: &BitString) -> Result<Self, CodecError> {
        let mut reader = BitReader::new(bits);
        let message = Self::decode(format, &mut reader)?;
        reader.finish()?;
        Ok(message)
    }
}

/// Encoded as one bit.
impl Message for bool {
    type Format = ();

    fn encode(&self, (): &(), writer: &mut BitWriter) -> Result<(), CodecError> {
        writer.write(u64::from(*self), 1)
    }

    fn decode((): &(), reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        Ok(reader.read(1)? == 1)
    }
}

/// The empty message, of zero bits.
impl Message for () {
    type Format = ();

    fn encode(&self, (): &(), _: &mut BitWriter) -> Result<(), CodecError> {
        Ok(())
    }

    fn decode((): &(), _: &mut BitReader<'_>) -> Result<Self, CodecError> {
        Ok(())
    }
}
