//! What a sensor says, and what the other end hears.

use crate::bits::{BitReader, BitString, BitWriter, CodecError};
use fewbits_numerics::error::ArgumentError;
use fewbits_numerics::normal;
use serde::{Deserialize, Serialize};

/// Something a sensor can say, with a real bit encoding.
///
/// Laws, checked by [`laws::round_trip`] for every implementation:
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

/// The sensor's half of a scheme: cheap, allocation-free, and ignorant of everything but its measurement and the feedback.
pub trait Encoder {
    /// What the sensor measures.
    type Measurement;
    /// What the fusion centre broadcast beforehand; `()` without feedback.
    type Feedback;
    /// What the sensor says. Silence is a message of zero bits: make it a variant.
    type Message: Message;

    /// Turns a measurement into a message.
    fn encode(&self, measurement: &Self::Measurement, feedback: &Self::Feedback) -> Self::Message;
}

/// What arrives at the listener in one slot from one sensor.
///
/// Silence carries information (the sensor chose it) and so differs from loss (the link chose it).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub enum Observation<M> {
    /// A message was received.
    Received(M),
    /// The sensor kept silent, and the listener knows that.
    Silent,
    /// The link is known to have lost whatever was sent.
    Lost,
}

impl<M> Observation<M> {
    /// The received message, if any.
    pub fn received(&self) -> Option<&M> {
        match self {
            Self::Received(message) => Some(message),
            Self::Silent | Self::Lost => None,
        }
    }
}

/// One bit: whether a measurement reached its threshold. `Above` is `+1`, ties included.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Sign {
    /// The measurement was below the threshold: `-1`.
    Below,
    /// The measurement was at or above the threshold: `+1`.
    Above,
}

impl Sign {
    /// `+1.0` or `-1.0`.
    #[inline]
    pub fn value(self) -> f64 {
        match self {
            Self::Below => -1.0,
            Self::Above => 1.0,
        }
    }

    /// Compares a measurement with a threshold; ties are `Above`.
    #[inline]
    pub fn of(measurement: f64, threshold: f64) -> Self {
        if measurement >= threshold {
            Self::Above
        } else {
            Self::Below
        }
    }

    /// The other sign.
    #[inline]
    pub fn flipped(self) -> Self {
        match self {
            Self::Below => Self::Above,
            Self::Above => Self::Below,
        }
    }
}

impl TryFrom<i32> for Sign {
    type Error = ArgumentError;

    /// Accepts `-1` and `+1`.
    fn try_from(value: i32) -> Result<Self, ArgumentError> {
        match value {
            1 => Ok(Self::Above),
            -1 => Ok(Self::Below),
            _ => Err(ArgumentError::new("bit", value, "-1 or +1")),
        }
    }
}

impl Message for Sign {
    type Format = ();

    fn encode(&self, (): &(), writer: &mut BitWriter) -> Result<(), CodecError> {
        writer.write(u64::from(*self == Self::Above), 1)
    }

    fn decode((): &(), reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        Ok(if reader.read_bit()? { Self::Above } else { Self::Below })
    }
}

/// A half-open interval `[lower, upper)` that is known to hold a measurement; either end may be infinite.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    lower: f64,
    upper: f64,
}

impl Cell {
    /// The cell `[lower, upper)`.
    ///
    /// # Errors
    /// If `lower < upper` does not hold (NaN included).
    pub fn new(lower: f64, upper: f64) -> Result<Self, ArgumentError> {
        if lower < upper {
            Ok(Self { lower, upper })
        } else {
            Err(ArgumentError::new("cell", format!("[{lower}, {upper})"), "lower < upper"))
        }
    }

    /// The half-line that a sign bit at `threshold` announces.
    ///
    /// # Errors
    /// If the threshold is not finite.
    pub fn of_sign(sign: Sign, threshold: f64) -> Result<Self, ArgumentError> {
        fewbits_numerics::error::finite("threshold", threshold)?;
        match sign {
            Sign::Above => Self::new(threshold, f64::INFINITY),
            Sign::Below => Self::new(f64::NEG_INFINITY, threshold),
        }
    }

    /// Lower end, included.
    pub fn lower(&self) -> f64 {
        self.lower
    }

    /// Upper end, excluded.
    pub fn upper(&self) -> f64 {
        self.upper
    }

    /// Whether the cell holds `value`.
    pub fn contains(&self, value: f64) -> bool {
        self.lower <= value && value < self.upper
    }

    /// `ln P(mean + noise in cell)` for zero-mean normal noise of the given standard deviation.
    #[inline]
    pub fn log_probability(&self, mean: f64, standard_deviation: f64) -> f64 {
        normal::log_interval((self.lower - mean) / standard_deviation, (self.upper - mean) / standard_deviation)
    }
}

/// The laws of [`Message`], to be called from the tests of every implementation.
pub mod laws {
    use super::{BitReader, BitString, CodecError, Message};

    /// Law 1: encoding and decoding is the identity, to the last bit. Returns the number of bits spent.
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
}
