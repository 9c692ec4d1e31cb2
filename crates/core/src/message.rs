//! Messages: what travels, as real bits.

use crate::bits::{BitReader, BitString, BitWriter, CodecError};

/// Something that travels, with a real bit encoding: a report, a broadcast, a belief.
///
/// Laws, checked by [`crate::laws::message`] for every implementation:
/// 1. decoding what was encoded gives the message back and leaves no bit over;
/// 2. decoding arbitrary bits gives a message or an error, never a panic.
///
/// Fields that both ends know beforehand (the width of a word, a code book) are the `Format`.
pub trait Message: Sized {
    /// What both ends agreed on beforehand.
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

    /// The message alone, as it would travel.
    ///
    /// # Errors
    /// As [`Message::encode`].
    fn to_bits(&self, format: &Self::Format) -> Result<BitString, CodecError> {
        let mut writer = BitWriter::new();
        self.encode(format, &mut writer)?;
        Ok(writer.finish())
    }

    /// The message that `bits` hold, to the last bit.
    ///
    /// # Errors
    /// As [`Message::decode`], or if bits are left over.
    fn from_bits(format: &Self::Format, bits: &BitString) -> Result<Self, CodecError> {
        let mut reader = BitReader::new(bits);
        let message = Self::decode(format, &mut reader)?;
        reader.finish()?;
        Ok(message)
    }
}

/// Nothing to say: zero bits.
/// One bit.
impl Message for bool {
    type Format = ();

    fn encode(&self, (): &(), writer: &mut BitWriter) -> Result<(), CodecError> {
        writer.write(u64::from(*self), 1)
    }

    fn decode((): &(), reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        reader.read_bit()
    }
}

impl Message for () {
    type Format = ();

    fn encode(&self, (): &(), _: &mut BitWriter) -> Result<(), CodecError> {
        Ok(())
    }

    fn decode((): &(), _: &mut BitReader<'_>) -> Result<Self, CodecError> {
        Ok(())
    }
}
