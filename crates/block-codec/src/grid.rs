//! The grid of a block's reconstructions: conversion between samples and integers.

use crate::Effort;
use crate::vectors::{double, rounded, wide};
use fewbits_node::adaptive::TENS;

/// Largest sample as a decimal integer: sums of two are exact doubles.
const LARGEST_DIGITS: f64 = (1_u64 << 51) as f64;
/// Largest sample of single precision as a decimal integer: beyond that neighbours are the same number.
const LARGEST_SINGLE_DIGITS: f64 = (1_u64 << 24) as f64;
/// Integers up to this size are exact doubles.
pub(crate) const WHOLE: i64 = 1 << 53;
/// Share by which steps are shorter than `2 delta`, so that rounding cannot move a reconstruction out of its bound.
const SLACK: f64 = 1.0 / (1_u64 << 30) as f64;
/// Largest number of cells of a circle.
const LARGEST_CIRCLE: f64 = (1_u64 << 40) as f64;
/// A grid can be moved by multiples of `2^-PHASE_BITS` of a cell.
const PHASE_BITS: u32 = 4;
pub(crate) const PHASES: u8 = 1 << PHASE_BITS;
/// Distance from the first sample, in cells, beyond which the phase is not determined.
const FARTHEST_PLACE: f64 = (1 << 28) as f64;
/// Number of changes of the cell between neighbouring samples that together cost about a byte.
const CROSSINGS_OF_A_BYTE: u32 = 4;
/// Number of decimal grids that are tried.
pub(crate) const DECIMALS: u8 = 13;

/// The reconstructions: points with integer indices.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Grid {
    /// Samples are integer multiples of `10^-decimals`. A cell has `width` neighbouring multiples, as many as lie within the bound of its
    /// middle. The first of them is `phase` sixteenths of the width, rounded up, from a multiple of the width.
    Decimal { decimals: u8, width: i64, phase: u8 },
    /// Samples are exactly `(origin + unit j) / 10^decimals`, or that rounded to single precision.
    Stepped {
        decimals: u8,
        unit: i64,
        origin: i64,
        is_single: bool,
    },
    /// `anchor + step (j + phase / 16)`.
    Line { anchor: f64, step: f64, phase: u8 },
    /// `cells` equal cells on a circle.
    Circle { period: f64, cells: i64 },
}

/// The integer `digits` with `sample == digits / ten` to the last bit, or that rounded to single precision, if there is one.
#[inline(always)]
fn digits(sample: f64, ten: f64, is_single: bool) -> Option<i64> {
    let whole = (sample * ten).round();
    let (value, limit) = match is_single {
        true => (f64::from((whole / ten) as f32), LARGEST_SINGLE_DIGITS),
        false => (whole / ten, LARGEST_DIGITS),
    };
    (whole.abs() < limit && value.to_bits() == sample.to_bits()).then_some(whole as i64)
}

/// Number of samples that are looked at before the loop may end.
const AT_ONCE: usize = 64;

/// Whether every sample is a whole number divided by `ten`, to the last bit.
fn have_digits(samples: &[f64], ten: f64) -> bool {
    wide!({
        samples.chunks(AT_ONCE).all(|samples| {
            samples.iter().fold(true, |all, sample| {
                let whole = rounded(sample * ten);
                all & (whole.abs() < LARGEST_DIGITS) & ((whole / ten).to_bits() == sample.to_bits())
            })
        })
    })
}

fn greatest_common_divisor(mut a: i64, mut b: i64) -> i64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a.abs()
}

impl Grid {
    /// The grid of decimal numbers, or of decimal numbers that were rounded to single precision, that fits all samples, if there is one.
    /// `delta` is zero if samples must be exact, as those of single precision.
    pub(crate) fn decimal(samples: &[f64], delta: f64, is_single: bool) -> Option<Self> {
        let fits = |ten: f64| match is_single {
            true => samples.iter().all(|x| digits(*x, ten, true).is_some()),
            false => have_digits(samples, ten),
        };
        let decimals = (0..DECIMALS).find(|decimals| fits(TENS[usize::from(*decimals)]))?;
        let ten = TENS[usize::from(decimals)];
        let (width, phase) = (Self::width(delta, ten)?, 0);
        let plain = Self::Decimal { decimals, width, phase };
        if width > 1 {
            return Some(plain);
        }
        let mut all = samples.iter().filter_map(|x| digits(*x, ten, is_single));
        let origin = all.next()?;
        // If all samples are multiples of a larger unit (for example an ADC step in millivolts), count in that unit.
        let mut unit = 0;
        while unit != 1
            && let Some(digits) = all.next()
        {
            unit = greatest_common_divisor(unit, digits - origin);
        }
        let stepped = Self::Stepped {
            decimals,
            unit: unit.max(1),
            origin,
            is_single,
        };
        Some(if unit > 1 || is_single { stepped } else { plain })
    }

    /// Number of neighbouring multiples of `1 / ten` within `delta` of their middle; `None` if it is too large.
    pub(crate) fn width(delta: f64, ten: f64) -> Option<i64> {
        let neighbours = (2.0 * delta * ten * (1.0 - SLACK)).floor();
        (neighbours < LARGEST_DIGITS).then(|| neighbours as i64 + 1)
    }

    /// The grid of a bound for samples that are not decimal numbers.
    pub(crate) fn line(delta: f64, anchor: f64) -> Self {
        Self::Line {
            anchor,
            step: 2.0 * delta * (1.0 - SLACK),
            phase: 0,
        }
    }

    /// The same grid moved by `moved` sixteenths of a cell, if the grid can be moved.
    pub(crate) fn with_phase(mut self, moved: u8) -> Self {
        if let Self::Decimal { phase, .. } | Self::Line { phase, .. } = &mut self {
            *phase = moved;
        }
        self
    }

    /// Sixteenths of a cell by which the grid is moved.
    pub(crate) fn phase(&self) -> u8 {
        match self {
            Self::Decimal { phase, .. } | Self::Line { phase, .. } => *phase,
            _ => 0,
        }
    }

    /// The grid moved so that neighbouring samples are most often in one cell, if that saves more than the byte for the phase.
    pub(crate) fn fitted(self, samples: &[f64], effort: Effort) -> Self {
        let phases = f64::from(PHASES);
        let (scale, offset) = match self {
            // Half a digit from the next cell, so that rounding cannot move a sample there.
            Self::Decimal { decimals, width, .. } if width > 1 => {
                let scale = phases / width as f64;
                (scale * TENS[usize::from(decimals)], scale * 0.5 / phases)
            }
            Self::Line { anchor, step, .. } => (phases / step, phases * (0.5 - anchor / step)),
            _ => return self,
        };
        // Number of samples from which the phase is chosen.
        let most = match effort {
            Effort::Thorough => 1 << 20,
            Effort::Fast => 1 << 13,
        };
        // Under phase `p` a sample is in cell `(place - p) / 16`, rounded down: for each phase, how often the cell changes.
        let crossings = wide!({
            let mut crossings = [0_u32; PHASES as usize];
            let (mut last, mut origin) = (0, None);
            for sample in samples.iter().take(most).filter(|sample| sample.is_finite()) {
                let place = sample * scale + offset;
                let origin = *origin.get_or_insert_with(|| (place / phases).floor() * phases);
                // Shifted to positive numbers, for which a conversion rounds down.
                let place = ((place - origin).clamp(-FARTHEST_PLACE, FARTHEST_PLACE) + 2.0 * FARTHEST_PLACE) as i32;
                let before = std::mem::replace(&mut last, place);
                for (phase, crossings) in (0..).zip(&mut crossings) {
                    *crossings += u32::from((place - phase) >> PHASE_BITS != (before - phase) >> PHASE_BITS);
                }
            }
            crossings
        });
        let best = (0..PHASES).min_by_key(|phase| crossings[usize::from(*phase)]);
        let best = best.unwrap_or(0);
        let saved = crossings[0] - crossings[usize::from(best)];
        if saved > CROSSINGS_OF_A_BYTE {
            self.with_phase(best)
        } else {
            self
        }
    }

    /// The grid of a bound on a circle. [`BlockCodec::on_circle`](crate::BlockCodec::on_circle) allows at most `2^40` cells.
    pub(crate) fn circle(delta: f64, period: f64) -> Self {
        let cells = (period / (2.0 * delta * (1.0 - SLACK)))
            .ceil()
            .clamp(1.0, LARGEST_CIRCLE);
        Self::Circle {
            period,
            cells: cells as i64,
        }
    }

    /// Number of multiples by which the first one of each cell is moved.
    #[inline(always)]
    pub(crate) fn digits_moved(width: i64, phase: u8) -> i64 {
        let sixteenths = i128::from(width) * i128::from(phase);
        ((sixteenths + i128::from(PHASES) - 1) >> PHASE_BITS) as i64
    }

    /// Whether both grids have the same kind and spacing; their origins may differ.
    pub(crate) fn is_like(&self, other: &Self) -> bool {
        let [own, other] = [self, other].map(|grid| {
            let mut grid = grid.with_phase(0);
            match &mut grid {
                Self::Line { anchor, .. } => *anchor = 0.0,
                Self::Stepped { origin, .. } => *origin = 0,
                _ => {}
            }
            grid
        });
        own == other
    }

    /// Number of points on the circle; `None` for other grids.
    pub(crate) fn cells(&self) -> Option<i64> {
        match self {
            Self::Circle { cells, .. } => Some(*cells),
            _ => None,
        }
    }

    /// The reconstruction of an index.
    #[inline(always)]
    pub(crate) fn value(&self, index: i64) -> f64 {
        match self {
            Self::Decimal { decimals, width, phase } => {
                let moved = width - 1 + 2 * Self::digits_moved(*width, *phase);
                // Twice the middle in digits, because the middle may be half of a digit.
                let twice = 2 * i128::from(*width) * i128::from(index) + i128::from(moved);
                let twice = i64::try_from(twice).map_or(twice as f64, |twice| twice as f64);
                0.5 * twice / TENS[usize::from(*decimals)]
            }
            Self::Stepped {
                decimals,
                unit,
                origin,
                is_single,
            } => {
                let digits = (i128::from(*origin) + i128::from(*unit) * i128::from(index)) as f64;
                let value = digits / TENS[usize::from(*decimals)];
                if *is_single {
                    f64::from(value as f32).clamp(f64::MIN, f64::MAX)
                } else {
                    value
                }
            }
            Self::Line { anchor, step, phase } => {
                (anchor + step * (index as f64 + f64::from(*phase) / f64::from(PHASES))).clamp(f64::MIN, f64::MAX)
            }
            Self::Circle { period, cells } => {
                let value = period / *cells as f64 * index.rem_euclid(*cells) as f64;
                if value < *period { value } else { 0.0 }
            }
        }
    }

    /// The reconstructions of indices.
    pub(crate) fn values(&self, indices: &[i64]) -> Vec<f64> {
        // If all indices are a little smaller than these limits, arithmetic in doubles is exact and can be vectorised.
        let exact = |largest: i64| {
            let largest = largest.min(LARGEST_DIGITS as i64) as u64;
            indices
                .iter()
                .fold(true, |all, index| all & (index.unsigned_abs() < largest))
        };
        match *self {
            Self::Decimal { decimals, width, phase } if exact(WHOLE / (4 * width)) => {
                let moved = (width - 1 + 2 * Self::digits_moved(width, phase)) as f64;
                let (width, ten) = (width as f64, TENS[usize::from(decimals)]);
                wide!({
                    let twice = indices.iter().map(|index| 2.0 * width * double(*index) + moved);
                    twice.map(|twice| 0.5 * twice / ten).collect()
                })
            }
            Self::Line { anchor, step, phase } if exact(LARGEST_DIGITS as i64) => {
                let moved = f64::from(phase) / f64::from(PHASES);
                wide!({
                    let values = indices.iter().map(|index| anchor + step * (double(*index) + moved));
                    values.map(|value| value.clamp(f64::MIN, f64::MAX)).collect()
                })
            }
            _ => indices.iter().map(|index| self.value(*index)).collect(),
        }
    }

    /// The index of a sample; on a circle, of its equivalent indices the one nearest to `near`. `None` if it is too large. The caller must
    /// check that the reconstruction is within the bound.
    #[inline(always)]
    pub(crate) fn index(&self, sample: f64, near: i64) -> Option<i64> {
        let whole = |x: f64| (x.abs() < crate::rows::LARGEST as f64).then(|| x.round() as i64);
        match self {
            Self::Decimal { decimals, width, phase } => {
                let digits = (sample * TENS[usize::from(*decimals)]).round();
                (digits.abs() < LARGEST_DIGITS)
                    .then_some(digits as i64)
                    .map(|digits| (digits - Self::digits_moved(*width, *phase)).div_euclid(*width))
            }
            Self::Stepped {
                decimals,
                unit,
                origin,
                is_single,
            } => {
                let digits = digits(sample, TENS[usize::from(*decimals)], *is_single)?;
                let offset = i128::from(digits) - i128::from(*origin);
                i64::try_from(offset.div_euclid(i128::from(*unit))).ok()
            }
            Self::Line { anchor, step, phase } => {
                whole((sample - anchor) / step - f64::from(*phase) / f64::from(PHASES))
            }
            Self::Circle { period, cells } => {
                let turned = sample.rem_euclid(*period);
                let index = whole(turned / (period / *cells as f64))?;
                // The turn nearest to the index before: a direction that passes north continues without a jump.
                let around = (index - near).rem_euclid(*cells);
                let shortest = if 2 * around > *cells { around - cells } else { around };
                near.checked_add(shortest)
            }
        }
        // The field of the first index has no room for the other end.
        .filter(|index| (-crate::rows::LARGEST..crate::rows::LARGEST).contains(index))
    }
}
