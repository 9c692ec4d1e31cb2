//! Frames: a block with all that its reader needs, and a checksum.
//!
//! A block needs its bound and its number of rows from outside. A frame has them: it can be stored or sent alone.
//!
//! ```
//! use fewbits_block_codec::frame::{self, Frames, Values};
//! let samples: Vec<f64> = (0..1000).map(|n| (f64::from(n) / 50.0).sin()).collect();
//! let bytes = Frames::within(0.01)?.encode(&samples)?;
//! let mut read = vec![0.0; 1000];
//! frame::decode_into(&bytes, &mut read)?;
//! assert!(read.iter().zip(&samples).all(|(value, sample)| (value - sample).abs() <= 0.01));
//! let counts = Frames::lossless().encode(&[3_i64, -1, 1 << 62])?;
//! assert_eq!(frame::decode(&counts)?, Values::Integers(vec![3, -1, 1 << 62]));
//! # Ok::<(), fewbits_block_codec::Error>(())
//! ```
//!
//! # Bytes
//!
//! ```text
//! frame := 66 62 ("fb"), version 01, kind, bound f64, rows u64, content, CRC-32 of all before
//! kind    0  doubles, every bit                                  content := block
//!         1  doubles, within the bound                           content := block
//!         2  singles, every bit                                  content := block of the same numbers as doubles
//!         3  64-bit integers, of at most 53 bits each            content := block of the same numbers as doubles
//!         4  64-bit integers                                     content := length u64 of the first block, block of x >> 32, block of the lower 32 bits
//! ```
//! Numbers are little-endian. The bound is 0 in kinds without one. The checksum is that of Ethernet (CRC-32/ISO-HDLC).

use crate::bytes::Bytes;
use crate::{ArgumentError, BlockCodec, Damaged, Effort, Error, ensure};
use std::borrow::Cow;

const MAGIC: [u8; 3] = *b"fb\x01";
const HEAD: usize = 20;
/// Integers up to this size are exact doubles.
const WHOLE: u64 = 1 << 53;
const LOW: i64 = 0xffff_ffff;

const DOUBLES: u8 = 0;
const WITHIN: u8 = 1;
const SINGLES: u8 = 2;
const INTEGERS: u8 = 3;
const HALVES: u8 = 4;

/// Samples to encode, as the caller has them.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum Samples<'a> {
    /// Double precision.
    Doubles(&'a [f64]),
    /// Single precision.
    Singles(&'a [f32]),
    /// Integers.
    Integers(&'a [i64]),
}

/// From slices, vectors and arrays.
macro_rules! samples_of {
    ($($kind:ident($number:ty))*) => {$(
        impl<'a> From<&'a [$number]> for Samples<'a> {
            fn from(samples: &'a [$number]) -> Self {
                Self::$kind(samples)
            }
        }

        impl<'a> From<&'a Vec<$number>> for Samples<'a> {
            fn from(samples: &'a Vec<$number>) -> Self {
                Self::$kind(samples)
            }
        }

        impl<'a, const N: usize> From<&'a [$number; N]> for Samples<'a> {
            fn from(samples: &'a [$number; N]) -> Self {
                Self::$kind(samples)
            }
        }
    )*};
}

samples_of!(Doubles(f64) Singles(f32) Integers(i64));

/// Samples of a frame, of the type that was encoded.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum Values {
    /// Double precision.
    Doubles(Vec<f64>),
    /// Single precision.
    Singles(Vec<f32>),
    /// Integers.
    Integers(Vec<i64>),
}

/// Writes frames.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frames {
    bound: Option<f64>,
    codec: BlockCodec,
}

impl Frames {
    /// Frames from which every finite sample returns within `bound`, as a double.
    ///
    /// # Errors
    /// As [`BlockCodec::new`].
    pub fn within(bound: f64) -> Result<Self, Error> {
        Ok(Self {
            bound: Some(bound),
            codec: BlockCodec::new(bound)?,
        })
    }

    /// Frames from which every sample returns to the last bit, as it was given.
    pub fn lossless() -> Self {
        Self {
            bound: None,
            codec: BlockCodec::lossless(),
        }
    }

    /// The same with another computing time.
    #[must_use]
    pub fn with_effort(mut self, effort: Effort) -> Self {
        self.codec = self.codec.with_effort(effort);
        self
    }

    /// The samples as a frame.
    ///
    /// # Errors
    /// If an integer is given within a bound and is no exact double, and as [`BlockCodec::encode`].
    pub fn encode<'a>(&self, samples: impl Into<Samples<'a>>) -> Result<Vec<u8>, Error> {
        let mut frame = Vec::new();
        self.encode_into(samples, &mut frame)?;
        Ok(frame)
    }

    /// The same, appended to `frames`.
    ///
    /// # Errors
    /// As [`encode`](Self::encode). `frames` is then unchanged.
    pub fn encode_into<'a>(&self, samples: impl Into<Samples<'a>>, frames: &mut Vec<u8>) -> Result<(), Error> {
        let samples = samples.into();
        let (kind, rows) = match samples {
            Samples::Doubles(samples) => (DOUBLES, samples.len()),
            Samples::Singles(samples) => (SINGLES, samples.len()),
            Samples::Integers(samples) => (INTEGERS, samples.len()),
        };
        let (kind, content) = match (doubles(samples), samples) {
            (Some(doubles), _) => {
                let kind = if self.bound.is_some() { WITHIN } else { kind };
                (kind, vec![self.codec.encode(&doubles)?])
            }
            (None, Samples::Integers(samples)) if self.bound.is_none() => {
                let half = |of: fn(i64) -> i64| samples.iter().map(|x| of(*x) as f64).collect::<Vec<f64>>();
                let high = self.codec.encode(&half(|x| x >> 32))?;
                let low = self.codec.encode(&half(|x| x & LOW))?;
                (HALVES, vec![(high.len() as u64).to_le_bytes().to_vec(), high, low])
            }
            _ => {
                let expected = "integers of at most 53 bits, or no bound";
                return Err(ArgumentError::new("samples", "an integer that is no exact double", expected).into());
            }
        };
        let start = frames.len();
        frames.reserve(HEAD + content.iter().map(Vec::len).sum::<usize>() + 4);
        frames.extend(MAGIC);
        frames.push(kind);
        frames.extend(self.bound.unwrap_or(0.0).to_le_bytes());
        frames.extend((rows as u64).to_le_bytes());
        content.iter().for_each(|part| frames.extend(part));
        frames.extend(crc32fast::hash(&frames[start..]).to_le_bytes());
        Ok(())
    }
}

/// The samples as doubles, if they are exact.
fn doubles(samples: Samples<'_>) -> Option<Cow<'_, [f64]>> {
    match samples {
        Samples::Doubles(samples) => Some(samples.into()),
        Samples::Singles(samples) => Some(samples.iter().map(|x| f64::from(*x)).collect()),
        Samples::Integers(samples) => {
            let exact = samples.iter().all(|x| x.unsigned_abs() <= WHOLE);
            exact.then(|| samples.iter().map(|x| *x as f64).collect())
        }
    }
}

/// The parts of a frame whose checksum is right.
struct Parts<'a> {
    kind: u8,
    bound: f64,
    rows: usize,
    content: Bytes<'a>,
}

fn damaged(value: &str) -> Error {
    Damaged::new("frame", value, "a whole frame of version 1").into()
}

fn parts(frame: &[u8]) -> Result<Parts<'_>, Error> {
    let short = || damaged("of fewer than 24 bytes");
    let (rest, checksum) = frame.split_last_chunk::<4>().ok_or_else(short)?;
    ensure!(rest.len() >= HEAD, short());
    let mut content = Bytes(rest);
    let (magic, kind) = (content.array()?, content.byte()?);
    ensure!(magic == MAGIC && kind <= HALVES, damaged("of another beginning"));
    ensure!(crc32fast::hash(rest) == u32::from_le_bytes(*checksum), damaged("of another checksum"));
    let bound = content.f64()?;
    let large = || damaged("of more rows than memory");
    let rows = usize::try_from(u64::from_le_bytes(content.array()?)).map_err(|_| large())?;
    // A few bytes may stand for any number of rows: memory that is not there must not end the program.
    let mut room: Vec<f64> = Vec::new();
    room.try_reserve_exact(rows).map_err(|_| large())?;
    Ok(Parts {
        kind,
        bound,
        rows,
        content,
    })
}

/// Number of samples of a frame.
///
/// # Errors
/// If the bytes are no whole frame with the right checksum.
pub fn rows(frame: &[u8]) -> Result<usize, Error> {
    parts(frame).map(|parts| parts.rows)
}

/// The samples of a frame.
///
/// # Errors
/// If the bytes are no whole frame with the right checksum, or no writer wrote its block.
pub fn decode(frame: &[u8]) -> Result<Values, Error> {
    let parts = parts(frame)?;
    let codec = match parts.kind {
        WITHIN => BlockCodec::new(parts.bound)?,
        _ => BlockCodec::lossless(),
    };
    let read = |block: &[u8]| codec.decode(block, parts.rows);
    let whole = |x: f64| (x.fract() == 0.0 && x.abs() <= WHOLE as f64).then_some(x as i64);
    let integers = |found: Option<Vec<i64>>| found.ok_or_else(|| damaged("of integers with numbers that are none"));
    let mut content = parts.content;
    Ok(match parts.kind {
        DOUBLES | WITHIN => Values::Doubles(read(content.0)?),
        SINGLES => Values::Singles(read(content.0)?.into_iter().map(|x| x as f32).collect()),
        INTEGERS => Values::Integers(integers(read(content.0)?.into_iter().map(whole).collect())?),
        _ => {
            let length = u64::from_le_bytes(content.array()?);
            let high = read(content.take(usize::try_from(length).unwrap_or(usize::MAX))?)?;
            let joined = high.into_iter().zip(read(content.0)?).map(|(high, low)| {
                let (high, low) = (whole(high)?, whole(low)?);
                let fits = i32::try_from(high).is_ok() && (0..=LOW).contains(&low);
                fits.then_some(high << 32 | low)
            });
            Values::Integers(integers(joined.collect())?)
        }
    })
}

/// The samples of a frame of doubles, into `samples`.
///
/// # Errors
/// As [`decode`], or if the frame has samples of another type or number. `samples` is then unchanged.
pub fn decode_into(frame: &[u8], samples: &mut [f64]) -> Result<(), Error> {
    match decode(frame)? {
        Values::Doubles(values) if values.len() == samples.len() => {
            samples.copy_from_slice(&values);
            Ok(())
        }
        Values::Doubles(values) => {
            let given = format!("room for {}", samples.len());
            Err(ArgumentError::new("samples", given, format!("room for {}", values.len())).into())
        }
        _ => Err(ArgumentError::new("samples", "doubles", "the type of the frame: see `decode`").into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn shapes() -> Vec<Vec<u8>> {
        let doubles = [1.5, f64::NAN, -0.0, f64::INFINITY, 1e-300];
        vec![
            Frames::lossless().encode(&doubles).unwrap(),
            Frames::within(0.1).unwrap().encode(&[20.03, 20.11, f64::NAN]).unwrap(),
            Frames::lossless().encode(&[0.1_f32, f32::NAN][..]).unwrap(),
            Frames::lossless().encode(&[5_i64, -7, 1 << 53][..]).unwrap(),
            Frames::lossless().encode(&[i64::MIN, i64::MAX, 0, -1][..]).unwrap(),
            Frames::lossless().encode(&[] as &[f64]).unwrap(),
        ]
    }

    #[test]
    fn every_type_returns_as_it_was_given() {
        let [doubles, within, singles, small, large, empty] = shapes().try_into().unwrap();
        let Values::Doubles(read) = decode(&doubles).unwrap() else {
            panic!("doubles")
        };
        let bits: Vec<u64> = read.iter().map(|x| x.to_bits()).collect();
        let given = [1.5, f64::NAN, -0.0, f64::INFINITY, 1e-300].map(f64::to_bits);
        assert_eq!(bits, given);
        let Values::Doubles(read) = decode(&within).unwrap() else {
            panic!("doubles")
        };
        assert!((read[0] - 20.03).abs() <= 0.1 && (read[1] - 20.11).abs() <= 0.1 && read[2].is_nan());
        let Values::Singles(read) = decode(&singles).unwrap() else {
            panic!("singles")
        };
        assert!(read[0] == 0.1 && read[1].is_nan());
        assert_eq!(decode(&small).unwrap(), Values::Integers(vec![5, -7, 1 << 53]));
        assert_eq!(decode(&large).unwrap(), Values::Integers(vec![i64::MIN, i64::MAX, 0, -1]));
        assert_eq!((decode(&empty).unwrap(), rows(&small).unwrap()), (Values::Doubles(Vec::new()), 3));
    }

    #[test]
    fn a_damaged_byte_anywhere_is_noticed() {
        for frame in shapes() {
            for at in 0..frame.len() {
                let mut other = frame.clone();
                other[at] ^= 0x10;
                assert!(decode(&other).is_err(), "byte {at}");
                assert!(decode(&frame[..at]).is_err(), "cut at {at}");
            }
        }
    }

    #[test]
    fn rows_that_no_memory_holds_are_refused() {
        let mut frame = Frames::lossless().encode(&[1.0]).unwrap();
        frame[12..20].copy_from_slice(&(1_u64 << 60).to_le_bytes());
        let end = frame.len() - 4;
        let checksum = crc32fast::hash(&frame[..end]).to_le_bytes();
        frame[end..].copy_from_slice(&checksum);
        assert!(matches!(decode(&frame), Err(Error::Damaged(_))));
    }

    #[test]
    fn frames_are_appended_and_read_into_the_callers_memory() {
        let mut all = vec![7];
        Frames::within(0.5).unwrap().encode_into(&[1.0, 2.0], &mut all).unwrap();
        assert_eq!(all[0], 7);
        let (mut two, mut three) = ([0.0; 2], [9.0; 3]);
        decode_into(&all[1..], &mut two).unwrap();
        assert!((two[1] - 2.0).abs() <= 0.5);
        let refused = decode_into(&all[1..], &mut three).unwrap_err();
        assert_eq!((refused.argument().unwrap().name, three), ("samples", [9.0; 3]));
        let counts = Frames::lossless().encode(&[1_i64][..]).unwrap();
        assert!(decode_into(&counts, &mut [0.0]).is_err());
    }

    #[test]
    fn refused_arguments_are_named_as_the_signature_names_them() {
        for bound in [0.0, -1.0, f64::NAN, f64::INFINITY, f64::MAX] {
            let error = Frames::within(bound).unwrap_err();
            assert_eq!(error.argument().unwrap().name, "bound");
        }
        let large = Frames::within(0.1).unwrap().encode(&[i64::MAX][..]).unwrap_err();
        assert_eq!(large.argument().unwrap().name, "samples");
    }
}
