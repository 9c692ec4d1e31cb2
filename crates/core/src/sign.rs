//! A sign bit.

use crate::bits::{BitReader, BitWriter, CodecError};
use crate::message::Message;
use fewbits_numerics::error::{ArgumentError, finite};
use serde::{Deserialize, Serialize};

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
    ///
    /// # Errors
    /// If either is not finite.
    #[inline]
    pub fn of(measurement: f64, threshold: f64) -> Result<Self, ArgumentError> {
        finite("measurement", measurement)?;
        finite("threshold", threshold)?;
        Ok(if measurement >= threshold {
            Self::Above
        } else {
            Self::Below
        })
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
        Ok(if reader.read(1)? == 1 { Self::Above } else { Self::Below })
    }
}
