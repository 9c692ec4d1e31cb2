//! What a censoring sensor says.

use crate::Error;
use fewbits_core::{BitReader, BitWriter, CodecError, Message, Observation};
use fewbits_numerics::ArgumentError;
use fewbits_numerics::error::{finite, within};
use nalgebra::SVector;
use serde::{Deserialize, Serialize};

/// How a value travels. Both ends know it; it costs no bits.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Format {
    /// 64-bit floating point.
    Double,
    /// 32-bit floating point.
    Single,
    /// The nearest of `2^bits` evenly spaced levels from `lower` to `upper`, ends included.
    Fixed {
        /// Lowest level (measurement units).
        lower: f64,
        /// Highest level.
        upper: f64,
        /// Bits a component, 1 to 32.
        bits: u32,
    },
}

impl Format {
    /// Evenly spaced levels.
    ///
    /// # Errors
    /// Ends that are not finite or not increasing, bits outside 1 to 32.
    pub fn fixed(lower: f64, upper: f64, bits: u32) -> Result<Self, Error> {
        finite("lower", lower)?;
        finite("upper", upper)?;
        within("bits", f64::from(bits), 1.0, 32.0)?;
        if lower < upper {
            Ok(Self::Fixed { lower, upper, bits })
        } else {
            Err(ArgumentError::new("lower", lower, format!("a number below `upper` = {upper}")).into())
        }
    }

    /// Bits a component.
    pub fn bits(&self) -> u32 {
        match self {
            Self::Double => 64,
            Self::Single => 32,
            Self::Fixed { bits, .. } => *bits,
        }
    }

    /// The value that arrives when `value` is sent.
    ///
    /// A sensor decides on the rounded value: else rounding could move a measurement that it sent back into the region of
    /// silence, where the fusion centre must take it for a breach of the protocol.
    pub fn rounded(&self, value: f64) -> f64 {
        match *self {
            Self::Double => value,
            Self::Single => f64::from(value as f32),
            Self::Fixed { lower, upper, bits } => level(lower, upper, bits, nearest(lower, upper, bits, value)),
        }
    }

    fn write(&self, value: f64, writer: &mut BitWriter) -> Result<(), CodecError> {
        if !value.is_finite() || self.rounded(value) != value {
            return Err(CodecError::Invalid {
                what: "measurement",
                value: value.to_string(),
                expected: "a finite value that the format holds exactly (see `Format::rounded`)",
            });
        }
        match *self {
            Self::Double => writer.write(value.to_bits(), 64),
            Self::Single => writer.write(u64::from((value as f32).to_bits()), 32),
            Self::Fixed { lower, upper, bits } => writer.write(nearest(lower, upper, bits, value), bits),
        }
    }

    fn read(&self, reader: &mut BitReader<'_>) -> Result<f64, CodecError> {
        let word = reader.read(self.bits())?;
        let value = match *self {
            Self::Double => f64::from_bits(word),
            Self::Single => f64::from(f32::from_bits(word as u32)),
            Self::Fixed { lower, upper, bits } => level(lower, upper, bits, word),
        };
        if value.is_finite() {
            Ok(value)
        } else {
            Err(CodecError::Invalid {
                what: "measurement",
                value: value.to_string(),
                expected: "a finite number",
            })
        }
    }
}

/// Largest index of a level.
fn top(bits: u32) -> f64 {
    ((1_u64 << bits) - 1) as f64
}

fn nearest(lower: f64, upper: f64, bits: u32, value: f64) -> u64 {
    ((value - lower) / (upper - lower) * top(bits))
        .round()
        .clamp(0.0, top(bits)) as u64
}

fn level(lower: f64, upper: f64, bits: u32, index: u64) -> f64 {
    let share = index as f64 / top(bits);
    lower * (1.0 - share) + upper * share
}

/// A censoring sensor's message: its measurement, or nothing at all.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub enum Report<const M: usize> {
    /// Zero bits: the innovation was small.
    Silence,
    /// The measurement, as its format holds it.
    Value(SVector<f64, M>),
}

impl<const M: usize> Report<M> {
    /// What the fusion centre hears if the link delivers the message.
    pub fn heard(&self) -> Observation<SVector<f64, M>> {
        match self {
            Self::Silence => Observation::Silent,
            Self::Value(value) => Observation::Received(*value),
        }
    }

    /// The measurement, if it was sent.
    pub fn value(&self) -> Option<&SVector<f64, M>> {
        match self {
            Self::Silence => None,
            Self::Value(value) => Some(value),
        }
    }
}

impl<const M: usize> Message for Report<M> {
    type Format = Format;

    fn encode(&self, format: &Format, writer: &mut BitWriter) -> Result<(), CodecError> {
        match self {
            Self::Silence => Ok(()),
            Self::Value(value) => value.iter().try_for_each(|z| format.write(*z, writer)),
        }
    }

    /// Reads a value if there are bits at all; an empty message is silence.
    fn decode(format: &Format, reader: &mut BitReader<'_>) -> Result<Self, CodecError> {
        if reader.remaining() == 0 {
            return Ok(Self::Silence);
        }
        let mut value = SVector::<f64, M>::zeros();
        for z in value.iter_mut() {
            *z = format.read(reader)?;
        }
        Ok(Self::Value(value))
    }
}

/// Sorts the messages of one step by sensor: whoever is not among them was silent (or its message lost, which cannot be told
/// apart).
///
/// # Errors
/// [`Error::UnknownSensor`], [`Error::HeardTwice`], a value that is not finite.
pub fn gather<const M: usize>(
    sensors: usize,
    messages: impl IntoIterator<Item = (usize, Report<M>)>,
) -> Result<Vec<Observation<SVector<f64, M>>>, Error> {
    let mut heard = vec![None; sensors];
    for (sensor, report) in messages {
        let slot = heard.get_mut(sensor).ok_or(Error::UnknownSensor { sensor, sensors })?;
        if slot.is_some() {
            return Err(Error::HeardTwice { sensor });
        }
        if let Report::Value(value) = &report {
            fewbits_numerics::error::all_finite("measurement", value.as_slice())?;
        }
        *slot = Some(report.heard());
    }
    Ok(heard
        .into_iter()
        .map(|slot| slot.unwrap_or(Observation::Silent))
        .collect())
}
