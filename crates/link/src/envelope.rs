//! Frames under a key: who sent them, and that they are new. `docs/wire.md` has the format.

use crate::error::Error;
use fewbits_numerics::error::refuse;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;
use std::fmt;

/// Bytes before the frame: sensor and counter.
const ENVELOPE_HEADER: usize = 12;
/// Bytes of the code behind the frame.
const TAG_BYTES: usize = 16;
/// The shortest key.
const MIN_KEY_BYTES: usize = 32;

/// Where an envelope goes. It is part of what is authenticated, so that an envelope cannot be sent back.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Direction {
    /// From a sensor.
    ToCentre,
    /// From the centre.
    ToSensor,
}

/// A key that one sensor shares with its centre. It is not printed.
#[derive(Clone)]
pub struct Key(Hmac<Sha256>);

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Key")
    }
}

impl Key {
    /// A key of 32 bytes or more. They must come from a random source: a password is none.
    ///
    /// # Errors
    /// If it is shorter.
    pub fn new(bytes: &[u8]) -> Result<Self, Error> {
        match Hmac::new_from_slice(bytes) {
            Ok(code) if bytes.len() >= MIN_KEY_BYTES => Ok(Self(code)),
            _ => refuse("key", format!("{} bytes", bytes.len()), format!("{MIN_KEY_BYTES} bytes or more")),
        }
    }

    /// The key that a hexadecimal text states; spaces are ignored.
    ///
    /// # Errors
    /// If a character is no hexadecimal digit, a digit is missing, or the key is too short.
    pub fn from_hex(text: &str) -> Result<Self, Error> {
        let digits: Option<Vec<u8>> = text
            .chars()
            .filter(|c| !c.is_whitespace())
            .map(|c| c.to_digit(16).map(|digit| digit as u8))
            .collect();
        // The key itself is no part of the message.
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

    fn code(&self, direction: Direction, envelope: &[u8]) -> Hmac<Sha256> {
        let mut code = self.0.clone();
        code.update(&[match direction {
            Direction::ToCentre => 0,
            Direction::ToSensor => 1,
        }]);
        code.update(envelope);
        code
    }

    /// Puts a frame into an envelope.
    pub fn seal(&self, direction: Direction, sensor: u32, counter: u64, frame: &[u8]) -> Vec<u8> {
        let mut envelope = Vec::with_capacity(ENVELOPE_HEADER + frame.len() + TAG_BYTES);
        envelope.extend(sensor.to_be_bytes());
        envelope.extend(counter.to_be_bytes());
        envelope.extend(frame);
        let code = self.code(direction, &envelope).finalize().into_bytes();
        envelope.extend(&code[..TAG_BYTES]);
        envelope
    }

    /// The counter and the frame of an envelope, if the key made it.
    ///
    /// # Errors
    /// [`Refusal::TooShort`], [`Refusal::Forged`].
    pub fn open<'a>(&self, direction: Direction, envelope: &'a [u8]) -> Result<(u64, &'a [u8]), Refusal> {
        let end = envelope.len().checked_sub(TAG_BYTES).ok_or(Refusal::TooShort)?;
        let (body, tag) = envelope.split_at(end);
        let (header, frame) = body.split_at_checked(ENVELOPE_HEADER).ok_or(Refusal::TooShort)?;
        // Compared in a time that does not depend on where they differ.
        let code = self.code(direction, body);
        code.verify_truncated_left(tag).map_err(|_| Refusal::Forged)?;
        let counter = header.last_chunk().map_or(0, |bytes| u64::from_be_bytes(*bytes));
        Ok((counter, frame))
    }
}

/// The sensor that an envelope names, unchecked. `None` if it is too short to name one.
pub fn sensor_of(envelope: &[u8]) -> Option<u32> {
    envelope.first_chunk().map(|bytes| u32::from_be_bytes(*bytes))
}

/// Why an envelope was refused. Refused envelopes change nothing but these counts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, thiserror::Error)]
#[non_exhaustive]
pub enum Refusal {
    /// Too few bytes for an envelope.
    #[error("too short")]
    TooShort,
    /// No sensor of this number is known.
    #[error("unknown sensor")]
    Unknown,
    /// The code is not that of the key.
    #[error("forged")]
    Forged,
    /// The counter was seen before, or is too old to tell.
    #[error("replayed")]
    Replayed,
}

/// Counters that were seen: each is taken once, in any order within the last 64.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
pub struct ReplayWindow {
    /// The highest counter taken; 0 before the first, which is never taken.
    highest: u64,
    /// Bit `i`: whether `highest - i` was taken.
    taken: u64,
}

impl ReplayWindow {
    /// Takes a counter, once.
    ///
    /// # Errors
    /// [`Refusal::Replayed`].
    pub fn take(&mut self, counter: u64) -> Result<(), Refusal> {
        if counter > self.highest {
            let ahead = counter - self.highest;
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
