//! Authenticated envelopes of frames: who sent a frame, and that it is not a repetition. `docs/wire.md` has the format.

use crate::error::Error;
use fewbits_numerics::error::refuse;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;
use std::fmt;

/// Bytes before the frame: sensor number and counter.
const ENVELOPE_HEADER: usize = 12;
/// Bytes of the authentication code after the frame.
const TAG_BYTES: usize = 16;
/// Smallest length of a key in bytes.
const MIN_KEY_BYTES: usize = 32;

/// Direction of an envelope. It is authenticated too, so an envelope cannot be sent back to its sender.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From a sensor to the centre.
    ToCentre,
    /// From the centre to a sensor.
    ToSensor,
}

/// A key that one sensor shares with its centre. `Debug` does not print it.
#[derive(Clone)]
pub struct Key(Hmac<Sha256>);

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key")
    }
}

impl Key {
    /// A key of 32 bytes or more. The bytes must come from a random source; do not use a password.
    ///
    /// # Errors
    /// If there are fewer than 32 bytes.
    pub fn new(bytes: &[u8]) -> Result<Self, Error> {
        match Hmac::new_from_slice(bytes) {
            Ok(code) if bytes.len() >= MIN_KEY_BYTES => Ok(Self(code)),
            _ => refuse("key", format!("{} bytes", bytes.len()), format!("{MIN_KEY_BYTES} bytes or more")),
        }
    }

    /// The key written as hexadecimal digits; spaces are ignored.
    ///
    /// # Errors
    /// If a character is not a hexadecimal digit, the number of digits is odd, or the key is too short.
    pub fn from_hex(text: &str) -> Result<Self, Error> {
        let digits: Option<Vec<u8>> = text
            .chars()
            .filter(|c| !c.is_whitespace())
            .map(|c| c.to_digit(16).map(|digit| digit as u8))
            .collect();
        // The message must not contain the key itself.
        let expected = "an even number of hexadecimal digits";
        let Some(digits) = digits else {
            return refuse("key", "no hexadecimal text", expected);
        };
        if digits.len() % 2 == 1 {
            return refuse("key", "an odd number of digits", expected);
        }
        let bytes: Vec<u8> = digits.chunks_exact(2).map(|pair| pair[0] << 4 | pair[1]).collect();
        Self::new(&bytes)
    }

    /// A number that tells keys apart and tells nothing about them: 16 hexadecimal digits. States hold it.
    pub fn fingerprint(&self) -> String {
        let mut code = self.0.clone();
        // No envelope begins with this byte, which stands for a direction.
        code.update(b"\xfffingerprint");
        let code = code.finalize().into_bytes();
        code.iter().take(8).map(|byte| format!("{byte:02x}")).collect()
    }

    fn code(&self, direction: Direction, envelope: &[u8]) -> Hmac<Sha256> {
        let mut code = self.0.clone();
        code.update(&[match direction {
            Direction::ToCentre => 0,
            Direction::ToSensor => 1,
        }]);
        code.update(envelope);
        code
    }

    /// Makes the envelope of a frame: sensor number, counter, frame, authentication code.
    pub fn seal(&self, direction: Direction, sensor: u32, counter: u64, frame: &[u8]) -> Vec<u8> {
        let mut envelope = Vec::with_capacity(ENVELOPE_HEADER + frame.len() + TAG_BYTES);
        envelope.extend(sensor.to_be_bytes());
        envelope.extend(counter.to_be_bytes());
        envelope.extend(frame);
        let code = self.code(direction, &envelope).finalize().into_bytes();
        envelope.extend(&code[..TAG_BYTES]);
        envelope
    }

    /// Counter and frame of an envelope, if its code was made with this key.
    ///
    /// # Errors
    /// [`Refusal::TooShort`]; [`Refusal::Forged`] if the code does not match.
    pub fn open<'a>(&self, direction: Direction, envelope: &'a [u8]) -> Result<(u64, &'a [u8]), Refusal> {
        let end = envelope.len().checked_sub(TAG_BYTES).ok_or(Refusal::TooShort)?;
        let (body, tag) = envelope.split_at(end);
        let (header, frame) = body.split_at_checked(ENVELOPE_HEADER).ok_or(Refusal::TooShort)?;
        // The comparison takes the same time wherever the codes differ.
        let code = self.code(direction, body);
        code.verify_truncated_left(tag).map_err(|_| Refusal::Forged)?;
        let counter = header.last_chunk().map_or(0, |bytes| u64::from_be_bytes(*bytes));
        Ok((counter, frame))
    }
}

/// The sensor number of an envelope, without any check. `None` if it is too short.
pub fn sensor_of(envelope: &[u8]) -> Option<u32> {
    envelope.first_chunk().map(|bytes| u32::from_be_bytes(*bytes))
}

/// Why an envelope was refused. A refused envelope is only counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// Too few bytes for an envelope.
    #[error("too short")]
    TooShort,
    /// The sensor number is unknown.
    #[error("unknown sensor")]
    Unknown,
    /// The authentication code does not match the key.
    #[error("forged")]
    Forged,
    /// The counter was accepted before, or is more than 63 below the highest.
    #[error("replayed")]
    Replayed,
}

/// Accepted counters. Each is accepted once; among the last 64 in any order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct ReplayWindow {
    /// The highest accepted counter; 0 before the first. Counter 0 itself is never accepted.
    highest: u64,
    /// Bit `i`: whether `highest - i` was accepted.
    taken: u64,
}

impl ReplayWindow {
    /// The highest accepted counter; 0 before the first.
    pub fn highest(&self) -> u64 {
        self.highest
    }

    /// Accepts a counter if it is new.
    ///
    /// # Errors
    /// [`Refusal::Replayed`] if it was accepted before or is too old.
    pub fn take(&mut self, counter: u64) -> Result<(), Refusal> {
        if counter > self.highest {
            let ahead = counter - self.highest;
            // From a distance of 64 on, all counters that were accepted before are too old.
            self.taken = if ahead < 64 { self.taken << ahead } else { 0 } | 1;
            self.highest = counter;
            return Ok(());
        }
        let mask = 1_u64
            .checked_shl(u32::try_from(self.highest - counter).unwrap_or(u32::MAX))
            .unwrap_or(0);
        if mask == 0 || self.taken & mask != 0 || counter == 0 {
            return Err(Refusal::Replayed);
        }
        self.taken |= mask;
        Ok(())
    }
}
