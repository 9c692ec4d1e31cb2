//! Encoding of the ticks of a block's rows.
//!
//! | kind | stored | ticks |
//! |---|---|---|
//! | 0 grid | block number `b` | `origin + step (rows_per_block b + i)`, origin and step from the header |
//! | 1 even | start, span | `start + round(i span / (n - 1))` |
//! | 2 coded | start, mean step, scale, numbers `k_i` | `start + i step + scale k_i` |
//! | 3 raw | 64 bits each | as they are |
//!
//! The first kind that is within the tolerance is used. All arithmetic is exact in 128 bits.

use crate::bound::Bound;
use crate::codec::{self, CodecId, Context, Target};
use crate::error::Damage;
use crate::wire::{Bytes, push_varint, zigzag};
use fewbits_block_codec::Effort;

/// How the ticks of a block are stored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum TimeKind {
    Grid = 0,
    Even = 1,
    Coded = 2,
    Raw = 3,
}

impl TimeKind {
    pub(crate) fn from_bits(bits: u64) -> Self {
        [Self::Grid, Self::Even, Self::Coded, Self::Raw][(bits & 3) as usize]
    }
}

/// The expected ticks: every `step` ticks from `origin` on; no grid if `step` is 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Grid {
    pub(crate) origin: i64,
    pub(crate) step: i64,
    pub(crate) rows_per_block: usize,
    pub(crate) tolerance: u64,
}

/// Limit on block numbers, so that a varint with one more bit can hold them.
const MAX_BLOCK: i128 = 1 << 60;

const INTEGERS: Target = Target {
    bound: Bound::Lossless,
    period: None,
};

impl Grid {
    fn tick(&self, block: u64, row: usize) -> Option<i64> {
        let rows = i128::from(block) * self.rows_per_block as i128 + row as i128;
        i64::try_from(i128::from(self.origin) + i128::from(self.step) * rows).ok()
    }

    /// The ticks of the rows of a block; `None` if one overflows. If the first and the last do not, none between them does.
    fn on_grid(&self, block: u64, rows: usize) -> Option<impl Iterator<Item = i64>> {
        self.tick(block, rows.saturating_sub(1))?;
        let (first, step) = (self.tick(block, 0)?, self.step);
        Some((0..rows as i64).map(move |row| first.wrapping_add(step.wrapping_mul(row))))
    }

    /// The ticks of a block that is on the grid.
    pub(crate) fn ticks(&self, block: u64, rows: usize) -> Result<Vec<i64>, Damage> {
        let ticks = self.on_grid(block, rows).map(Iterator::collect);
        ticks.ok_or(Damage::Content("ticks"))
    }

    /// The block number, if the ticks are on the grid.
    fn block(&self, ticks: &[i64]) -> Option<u64> {
        let first = i128::from(*ticks.first()?) - i128::from(self.origin);
        let size = i128::from(self.step) * self.rows_per_block as i128;
        if size == 0 {
            return None;
        }
        // The nearest one, because the first tick may be off the grid by the tolerance.
        let block = (first + size.abs() / 2 * size.signum()).div_euclid(size);
        let block = u64::try_from(block).ok().filter(|b| i128::from(*b) < MAX_BLOCK)?;
        let mut pairs = ticks.iter().zip(self.on_grid(block, ticks.len())?);
        let fit = pairs.all(|(tick, on_grid)| on_grid.abs_diff(*tick) <= self.tolerance);
        fit.then_some(block)
    }
}

fn even_tick(start: i64, span: i64, row: usize, rows: usize) -> Option<i64> {
    let steps = (rows as i128 - 1).max(1);
    // The quotient rounded to the nearest, halves up, in whole numbers.
    let ahead = (2 * i128::from(span) * row as i128 + steps).div_euclid(2 * steps);
    i64::try_from(i128::from(start) + ahead).ok()
}

fn greatest_common_divisor(mut a: u64, mut b: u64) -> u64 {
    while b != 0 {
        (a, b) = (b, a % b);
    }
    a
}

/// Start and span of evenly spaced ticks; `None` if they are not even within the tolerance.
fn even(ticks: &[i64], tolerance: u64) -> Option<(i64, i64)> {
    let (first, last) = (*ticks.first()?, *ticks.last()?);
    let span = last.checked_sub(first)?;
    let fits = |(row, tick): (usize, &i64)| {
        even_tick(first, span, row, ticks.len()).is_some_and(|even| even.abs_diff(*tick) <= tolerance)
    };
    ticks.iter().enumerate().all(fits).then_some((first, span))
}

/// The step of the grid that follows from the first ticks; 0 for none.
pub(crate) fn step(ticks: &[i64], tolerance: u64) -> i64 {
    let steps = ticks.len() as i128 - 1;
    let even = even(ticks, tolerance).filter(|_| steps > 0);
    let step = even.and_then(|(_, span)| i64::try_from((i128::from(span) + steps / 2).div_euclid(steps)).ok());
    step.unwrap_or(0)
}

/// The stored form of at least one tick: its kind and its bytes.
pub(crate) fn encode(ticks: &[i64], grid: &Grid) -> (TimeKind, Vec<u8>) {
    let mut bytes = Vec::new();
    if let Some(block) = grid.block(ticks) {
        push_varint(&mut bytes, block);
        return (TimeKind::Grid, bytes);
    }
    if let Some((start, span)) = even(ticks, grid.tolerance) {
        push_varint(&mut bytes, zigzag(start.wrapping_sub(grid.origin)));
        push_varint(&mut bytes, zigzag(span));
        return (TimeKind::Even, bytes);
    }
    if let Some(bytes) = coded(ticks, grid) {
        return (TimeKind::Coded, bytes);
    }
    bytes.extend(ticks.iter().flat_map(|tick| tick.to_le_bytes()));
    (TimeKind::Raw, bytes)
}

/// The shorter of two codes: exact ticks as multiples of their common divisor, or ticks rounded within the tolerance.
fn coded(ticks: &[i64], grid: &Grid) -> Option<Vec<u8>> {
    let start = *ticks.first()?;
    let divisor = ticks
        .iter()
        .fold(0, |d, tick| greatest_common_divisor(d, tick.abs_diff(start)))
        .max(1);
    let exact = coded_in(ticks, grid, divisor, i128::from(divisor));
    let moved = (grid.tolerance > 0).then(|| coded_in(ticks, grid, 2 * grid.tolerance + 1, 1));
    exact.into_iter().chain(moved.flatten()).min_by_key(Vec::len)
}

/// Codes ticks, rounded to multiples of `scale`, relative to a line whose slope is a multiple of `unit`.
fn coded_in(ticks: &[i64], grid: &Grid, scale: u64, unit: i128) -> Option<Vec<u8>> {
    let (start, last) = (*ticks.first()?, *ticks.last()?);
    let steps = ticks.len() as i128 - 1;
    // A multiple of `unit`: then the rests of exact ticks are multiples of their divisor too.
    let mean = (i128::from(last) - i128::from(start)) / (steps.max(1) * unit) * unit;
    let numbers = ticks.iter().enumerate().map(|(row, tick)| {
        let rest = i128::from(*tick) - i128::from(start) - mean * row as i128;
        let scale = i128::from(scale);
        let number = (2 * rest + scale).div_euclid(2 * scale);
        // Such numbers, and the differences of two, are exact doubles.
        (number.abs() < 1 << 52).then_some(number as f64)
    });
    let numbers: Vec<f64> = numbers.collect::<Option<_>>()?;
    let coded = codec::encode(&numbers, Context::alone(&INTEGERS), Effort::Thorough);
    if coded.broken > 0 || coded.bytes.len() >= 8 * ticks.len() {
        return None;
    }
    let mut bytes = Vec::new();
    push_varint(&mut bytes, zigzag(start.wrapping_sub(grid.origin)));
    push_varint(&mut bytes, zigzag(i64::try_from(mean).ok()?));
    push_varint(&mut bytes, scale);
    bytes.push(coded.id as u8);
    push_varint(&mut bytes, coded.bytes.len() as u64);
    bytes.extend(coded.bytes);
    Some(bytes)
}

/// Decodes `rows` ticks that [`encode`] wrote.
pub(crate) fn decode(kind: TimeKind, bytes: &mut Bytes<'_>, rows: usize, grid: &Grid) -> Result<Vec<i64>, Damage> {
    let beyond = Damage::Content("ticks");
    match kind {
        TimeKind::Grid => grid.ticks(bytes.varint()?, rows),
        TimeKind::Even => {
            let (start, span) = (grid.origin.wrapping_add(bytes.signed()?), bytes.signed()?);
            let tick = |row| even_tick(start, span, row, rows).ok_or(beyond);
            (0..rows).map(tick).collect()
        }
        TimeKind::Coded => {
            let start = i128::from(grid.origin.wrapping_add(bytes.signed()?));
            let mean = i128::from(bytes.signed()?);
            let scale = i128::from(bytes.varint()?);
            let id = CodecId::from_byte(bytes.byte()?)?;
            let length = bytes.count(bytes.0.len(), "length of ticks")?;
            let numbers = codec::decode(id, bytes.take(length)?, rows, Context::alone(&INTEGERS))?;
            let tick = |(row, number): (usize, f64)| {
                // Whole numbers below 2^63, by saturation; the product stays below 2^127.
                let ahead = (scale * i128::from(number as i64)).checked_add(mean * row as i128)?;
                i64::try_from(start.checked_add(ahead)?).ok()
            };
            let ticks: Option<_> = numbers.into_iter().enumerate().map(tick).collect();
            ticks.ok_or(beyond)
        }
        TimeKind::Raw => {
            let (all, _) = bytes.take(rows.checked_mul(8).ok_or(beyond)?)?.as_chunks();
            Ok(all.iter().map(|tick| i64::from_le_bytes(*tick)).collect())
        }
    }
}
