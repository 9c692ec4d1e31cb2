//! The laws of [`Message`].

use crate::bits::{BitReader, BitString, CodecError};
use crate::message::Message;

/// Law 1: decoding the encoded message returns the same message and reads all bits. Returns the number of bits.
///
/// # Errors
/// If encoding or decoding fails, or the decoded message differs.
pub fn round_trip<M: Message + PartialEq + std::fmt::Debug>(
    message: &M,
    format: &M::Format,
) -> Result<usize, CodecError> {
    let bits = message.to_bits(format)?;
    let decoded = M::from_bits(format, &bits)?;
    if &decoded == message {
        Ok(bits.bits())
    } else {
        Err(CodecError::Invalid {
            what: "decoded message",
            value: format!("{decoded:?}"),
            expected: "the message that was encoded",
        })
    }
}

/// Law 2: decoding arbitrary bits returns; a message that comes out encodes to bits that decode to itself.
pub fn decoding_is_total<M: Message + PartialEq + std::fmt::Debug>(bits: &BitString, format: &M::Format) -> bool {
    match M::decode(format, &mut BitReader::new(bits)) {
        Ok(message) => round_trip(&message, format).is_ok(),
        Err(_) => true,
    }
}
