//! What a block's tables code, chosen from counts in a part of its rows.

use super::order::Order;
use super::symbols::estimated_bits;
use super::{OF_VALUES, SIZE_BITS};
use crate::error::Damaged;
use crate::indices::{LEVEL, to_wrapped_pco};
use fewbits_node::elementary::log2;
use pco::DeltaSpec;

/// Stretches of rows from which all is estimated, and the rows of each.
const PARTS: usize = 16;
const PART_ROWS: usize = 64;
/// Values are considered if their size has less than so many bits more than that of differences, in the mean.
const MORE_BITS: usize = 2;
/// Largest number of low bits of values: its field has six bits.
const MOST_LOW: u32 = 63 - OF_VALUES;

/// What is coded, with how many low bits, and the bits of a row as estimated.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Plan {
    pub(super) order: Order,
    pub(super) low: u32,
    pub(crate) bits: f32,
}

/// The stretches from which all is estimated.
fn parts<T>(rows: &[T]) -> impl Iterator<Item = &[T]> {
    let size = (rows.len() / PARTS).clamp(1, PART_ROWS);
    let room = (rows.len() - size) / (PARTS - 1);
    (0..PARTS).map(move |part| &rows[part * room..part * room + size])
}

/// What is coded in these stretches.
pub(super) type Coded = (Order, Vec<Vec<i64>>);

pub(super) fn coded(order: Order, indices: &[i64]) -> Coded {
    (order, parts(indices).map(|part| order.differences(part)).collect())
}

/// Bits of the sizes of all.
fn size((_, parts): &Coded) -> usize {
    let bits = |x: &i64| (u64::BITS - x.unsigned_abs().leading_zeros()) as usize;
    parts.iter().flatten().map(bits).sum()
}

/// Differences, or their differences if these are smaller.
fn differences(indices: &[i64]) -> Coded {
    let [first, second] = [Order::First, Order::Second].map(|order| coded(order, indices));
    if size(&second) < size(&first) { second } else { first }
}

/// Orders of differences of pco that are considered.
const PCO_ORDERS: usize = 3;
/// Numbers of bins of the estimates of pco, of which the least counts, and bits that pco stores of each bin.
const BINS: [usize; 2] = [4, 64];
const BIN_BITS: f32 = 24.0;

/// Estimated bits of a number, of those in `sorted`, if a bin is stored and the place in it: bins of equally many numbers, each as wide as these
/// numbers are apart.
fn bits_of_bins(sorted: &[i64], rows: usize, wanted: usize) -> f32 {
    let all = sorted.len();
    let (mut sum, mut bins, mut rest) = (0.0, 0, sorted);
    while let Some(first) = rest.first() {
        // A number that alone fills a bin is not joined with others.
        let mut count = (all / wanted).max(1).min(rest.len());
        let (equal, last) = (rest.partition_point(|x| x == first), rest[count - 1]);
        count = if equal >= count {
            equal
        } else {
            let begun = rest.partition_point(|x| *x < last);
            let ended = rest.partition_point(|x| *x <= last);
            if ended - begun >= count { begun } else { ended }
        };
        let width = rest[count - 1].abs_diff(*first) as f32 * (1.0 + 1.0 / count as f32) + 1.0;
        sum += count as f32 * (log2(all as f32 / count as f32) + log2(width));
        (bins, rest) = (bins + 1, &rest[count..]);
    }
    sum / all.max(1) as f32 + bins as f32 * BIN_BITS / rows.max(1) as f32
}

/// The best order of differences for pco, and estimated bits of a row.
pub(crate) fn pco_order(indices: &[i64]) -> (usize, f32) {
    let mut parts: Vec<Vec<i64>> = parts(indices).map(<[i64]>::to_vec).collect();
    let mut best = (0, f32::INFINITY);
    for order in 0..PCO_ORDERS {
        let mut sorted = parts.concat();
        sorted.sort_unstable();
        for bins in BINS {
            let bits = bits_of_bins(&sorted, indices.len(), bins);
            if bits < best.1 {
                best = (order, bits);
            }
        }
        parts.iter_mut().for_each(|part| *part = Order::First.differences(part));
    }
    best
}

/// Estimated bits of a row of samples as pco codes them: those of some rows.
pub(crate) fn sample_bits(samples: &[f64]) -> Result<f32, Damaged> {
    let some: Vec<f64> = parts(samples).flatten().copied().collect();
    let bytes = to_wrapped_pco(&some, &DeltaSpec::default(), LEVEL)?;
    Ok(bytes.map_or(f32::INFINITY, |bytes| 8.0 * bytes.len() as f32 / some.len() as f32))
}

impl Plan {
    /// The best plan for these indices, of which there must be some.
    pub(crate) fn new(indices: &[i64]) -> Self {
        let (sum, rows) = parts(indices)
            .flatten()
            .fold((0_i128, 0), |(sum, rows), index| (sum + i128::from(*index), rows + 1));
        let values = coded(
            Order::Values {
                centre: (sum / rows) as i64,
            },
            indices,
        );
        let differences = differences(indices);
        let is_close = size(&values) < size(&differences) + MORE_BITS * rows as usize;
        let own = Self::of(&differences);
        let other = is_close
            .then(|| Self::of(&values))
            .filter(|other| other.low <= MOST_LOW);
        other.filter(|other| other.bits < own.bits).unwrap_or(own)
    }

    /// The better one of differences and their differences.
    pub(crate) fn of_differences(indices: &[i64]) -> Self {
        Self::of(&differences(indices))
    }

    /// The plan of this order.
    pub(super) fn of((order, parts): &Coded) -> Self {
        let rows: usize = parts.iter().map(Vec::len).sum();
        let sum: u128 = parts.iter().flatten().map(|d| u128::from(d.unsigned_abs())).sum();
        let mean = (sum / rows.max(1) as u128) as u64;
        let low = mean.checked_ilog2().map_or(0, |bits| bits.saturating_sub(SIZE_BITS));
        let runs = parts.iter().map(Vec::as_slice);
        let bits = match order {
            Order::Values { .. } => estimated_bits::<true>(runs, low),
            _ => estimated_bits::<false>(runs, low),
        };
        Self {
            order: *order,
            low,
            bits,
        }
    }
}
