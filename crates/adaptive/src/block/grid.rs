//! Which points a block's reconstructions are: from samples to whole numbers and back.

use crate::Config;
use fewbits_core::CodecError;
use fewbits_node::adaptive::TENS;

/// Largest decimal digits of a sample: their sums stay whole doubles.
const LARGEST_DIGITS: f64 = (1_u64 << 51) as f64;
/// Whole numbers of this size are doubles.
const WHOLE: i64 = 1 << 53;
/// Steps are this much shorter than `2 delta`, so that rounding never takes a reconstruction out of its bound.
const SLACK: f64 = 1.0 / (1_u64 << 30) as f64;
/// Cells of a circle, at most.
const LARGEST_CIRCLE: f64 = (1_u64 << 40) as f64;
/// Decimals that are tried.
pub(super) const DECIMALS: u8 = 13;

/// Reconstructions are the points with whole numbers of one of these.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Grid {
    /// Samples are whole multiples of `10^-decimals`. A cell holds `width` neighbours, as many as lie within the bound of its middle.
    Decimal { decimals: u8, width: i64 },
    /// Samples are `(origin + unit j) / 10^decimals`: exactly.
    Stepped { decimals: u8, unit: i64, origin: i64 },
    /// `anchor + step j`.
    Line { anchor: f64, step: f64 },
    /// Around a circle.
    Circle { period: f64, cells: i64 },
}

/// The digits of a number of so many decimals, if it is one to the last bit.
#[inline(always)]
fn digits(sample: f64, ten: f64) -> Option<i64> {
    let whole = (sample * ten).round();
    (whole.abs() < LARGEST_DIGITS && (whole / ten).to_bits() == sample.to_bits()).then_some(whole as i64)
}

fn greatest_common_divisor(mut a: i64, mut b: i64) -> i64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a.abs()
}

impl Grid {
    /// The decimal grid that fits all samples, if there is one; `delta` is zero where they are to return exactly.
    pub(super) fn decimal(samples: &[f64], delta: f64) -> Option<Self> {
        let decimals = (0..DECIMALS).find(|decimals| {
            let ten = TENS[usize::from(*decimals)];
            samples.iter().all(|x| digits(*x, ten).is_some())
        })?;
        let ten = TENS[usize::from(decimals)];
        let width = Self::width(delta, ten)?;
        if width > 1 {
            return Some(Self::Decimal { decimals, width });
        }
        let mut all = samples.iter().filter_map(|x| digits(*x, ten));
        let origin = all.next()?;
        let unit = all.fold(0, |unit, digits| greatest_common_divisor(unit, digits - origin));
        if unit <= 1 {
            return Some(Self::Decimal { decimals, width });
        }
        Some(Self::Stepped { decimals, unit, origin })
    }

    /// Neighbouring multiples of `1 / ten` within `delta` of their middle; `None` if there are too many to count.
    pub(super) fn width(delta: f64, ten: f64) -> Option<i64> {
        let neighbours = (2.0 * delta * ten * (1.0 - SLACK)).floor();
        (neighbours < LARGEST_DIGITS).then(|| neighbours as i64 + 1)
    }

    /// The grid of a bound for samples of any digits.
    pub(super) fn line(delta: f64, anchor: f64) -> Self {
        Self::Line {
            anchor,
            step: 2.0 * delta * (1.0 - SLACK),
        }
    }

    /// The grid of a bound around a circle. [`Config::circular`] admits no more than `2^40` cells.
    pub(super) fn circle(config: &Config, period: f64) -> Self {
        let cells = (period / (2.0 * config.delta() * (1.0 - SLACK)))
            .ceil()
            .clamp(1.0, LARGEST_CIRCLE);
        Self::Circle {
            period,
            cells: cells as i64,
        }
    }

    /// Whether the points are as dense, wherever they begin.
    pub(super) fn is_like(&self, other: &Self) -> bool {
        match (self, other) {
            (Self::Line { .. }, Self::Line { .. }) => true,
            (
                Self::Stepped { decimals, unit, .. },
                Self::Stepped {
                    decimals: d, unit: u, ..
                },
            ) => (decimals, unit) == (d, u),
            _ => self == other,
        }
    }

    /// Points of the circle.
    pub(super) fn cells(&self) -> Option<i64> {
        match self {
            Self::Circle { cells, .. } => Some(*cells),
            _ => None,
        }
    }

    /// The reconstruction of an index.
    #[inline(always)]
    pub(super) fn value(&self, index: i64) -> f64 {
        match self {
            Self::Decimal { decimals, width } => {
                // Twice the digits of the middle, which may be half of one.
                let short = width
                    .checked_mul(index)
                    .and_then(|middle| middle.checked_mul(2)?.checked_add(width - 1));
                let twice = match short {
                    Some(twice) => twice as f64,
                    None => (2 * i128::from(*width) * i128::from(index) + i128::from(*width) - 1) as f64,
                };
                0.5 * twice / TENS[usize::from(*decimals)]
            }
            Self::Stepped { decimals, unit, origin } => {
                (i128::from(*origin) + i128::from(*unit) * i128::from(index)) as f64 / TENS[usize::from(*decimals)]
            }
            Self::Line { anchor, step } => (anchor + step * index as f64).clamp(f64::MIN, f64::MAX),
            Self::Circle { period, cells } => {
                let value = period / *cells as f64 * index.rem_euclid(*cells) as f64;
                if value < *period { value } else { 0.0 }
            }
        }
    }

    /// The reconstructions of indices.
    pub(super) fn values(&self, indices: &[i64]) -> Vec<f64> {
        // Of any that are a little larger than these, the arithmetic is that of doubles: exact, and in vectors.
        let exact = |largest: i64| indices.iter().all(|index| index.unsigned_abs() < largest as u64);
        match *self {
            Self::Decimal { decimals, width } if exact(WHOLE / (4 * width)) => {
                let (width, ten) = (width as f64, TENS[usize::from(decimals)]);
                let twice = indices.iter().map(|index| 2.0 * width * *index as f64 + (width - 1.0));
                twice.map(|twice| 0.5 * twice / ten).collect()
            }
            _ => indices.iter().map(|index| self.value(*index)).collect(),
        }
    }

    /// The index of a sample, on a circle the name nearest to `near`; `None` if it is out of reach. Whether the reconstruction is
    /// within the bound is for the caller to check.
    #[inline(always)]
    pub(super) fn index(&self, sample: f64, near: i64) -> Option<i64> {
        let whole = |x: f64| (x.abs() < super::rows::LARGEST as f64).then(|| x.round() as i64);
        match self {
            Self::Decimal { decimals, width } => {
                let digits = (sample * TENS[usize::from(*decimals)]).round();
                (digits.abs() < LARGEST_DIGITS)
                    .then_some(digits as i64)
                    .map(|digits| digits.div_euclid(*width))
            }
            Self::Stepped { decimals, unit, origin } => {
                let digits = digits(sample, TENS[usize::from(*decimals)])?;
                let offset = i128::from(digits) - i128::from(*origin);
                i64::try_from(offset.div_euclid(i128::from(*unit))).ok()
            }
            Self::Line { anchor, step } => whole((sample - anchor) / step),
            Self::Circle { period, cells } => {
                let turned = sample.rem_euclid(*period);
                let index = whole(turned / (period / *cells as f64))?;
                let around = (index - near).rem_euclid(*cells);
                let shortest = if 2 * around > *cells { around - cells } else { around };
                near.checked_add(shortest)
            }
        }
        .filter(|index| index.abs() <= super::rows::LARGEST)
    }

    /// What the reader needs beyond the configuration.
    pub(super) fn write(&self, bytes: &mut Vec<u8>) {
        match self {
            Self::Stepped { unit, origin, .. } => {
                push_varint(bytes, *unit as u64);
                push_varint(bytes, zigzag(*origin));
            }
            Self::Line { anchor, .. } if *anchor != 0.0 => bytes.extend_from_slice(&anchor.to_le_bytes()),
            _ => {}
        }
    }
}

pub(super) fn zigzag(k: i64) -> u64 {
    ((k << 1) ^ (k >> 63)) as u64
}

pub(super) fn unzigzag(z: u64) -> i64 {
    (z >> 1) as i64 ^ -((z & 1) as i64)
}

/// Seven bits a byte, the lowest first; the highest bit says that more follow.
pub(super) fn push_varint(bytes: &mut Vec<u8>, mut value: u64) {
    while value >= 128 {
        bytes.push(value as u8 | 128);
        value >>= 7;
    }
    bytes.push(value as u8);
}

/// Takes bytes from the front.
#[derive(Debug)]
pub(super) struct Bytes<'a>(pub(super) &'a [u8]);

impl Bytes<'_> {
    pub(super) fn array<const N: usize>(&mut self) -> Result<[u8; N], CodecError> {
        let (taken, rest) = self.0.split_first_chunk::<N>().ok_or(CodecError::EndOfMessage {
            requested: 8 * N as u32,
            available: 8 * self.0.len(),
        })?;
        let taken = *taken;
        self.0 = rest;
        Ok(taken)
    }

    pub(super) fn varint(&mut self) -> Result<u64, CodecError> {
        let mut value = 0_u64;
        for shift in (0..70).step_by(7) {
            let [byte] = self.array()?;
            let low = u64::from(byte & 127);
            if shift == 63 && low > 1 {
                break;
            }
            value |= low << shift;
            if byte < 128 {
                return Ok(value);
            }
        }
        Err(CodecError::Invalid {
            what: "number",
            value: "more than 64 bits".into(),
            expected: "at most 64 bits",
        })
    }
}
