//! What a block's tables code, chosen from counts in a part of its rows.

use super::SIZE_BITS;
use super::alphabet::{CODES, ESCAPE, SIZE_FIELD, SMALLEST, SYMBOLS};
use super::lanes::Place;
use super::order::{FIRST, Order, SECOND, VALUES};
use crate::error::Damaged;
use crate::indices::{LEVEL, to_wrapped_pco};
use fewbits_node::elementary::log2;
use pco::DeltaSpec;

/// Stretches of rows from which all is estimated, and the rows of each.
const PARTS: usize = 16;
const PART_ROWS: usize = 64;
/// Values are considered if their size has less than so many bits more than that of differences, in the mean.
const MORE_BITS: usize = 2;
/// One difference of so many may be longer than the cells of symbols.
const ROWS_OF_LONG: usize = 64;
/// Weight of the frequencies of all contexts in each, in symbols.
const COMMON: f32 = 24.0;

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

/// The best plan for differences, or for their differences if these are smaller.
fn of_differences(indices: &[i64]) -> (Plan, usize) {
    let [first, second] = [FIRST, SECOND].map(|kind| coded(Order { kind, centre: 0 }, indices));
    let own = Plan::of(&first);
    if size(&second) >= size(&first) {
        return (own, size(&first));
    }
    (own.shorter(Plan::of(&second)), size(&second))
}

/// Estimated bits of a row: each of these runs of differences is coded by the counts of all its other symbols.
fn estimated_bits<const OF_VALUES: bool>(runs: &[Vec<i64>], low: u32) -> f32 {
    let (mut counts, mut all) = ([0_u16; CODES], [0_u16; SYMBOLS]);
    let (mut rows, mut raw) = (0, 0);
    for run in runs {
        let mut place = Place::<OF_VALUES>::START;
        for mut difference in run.iter().copied() {
            let code = place.code(&mut difference, low);
            counts[code] += 1;
            all[code % SYMBOLS] += 1;
            raw += low;
            if code % SYMBOLS == ESCAPE {
                raw += SIZE_FIELD + (difference >> low).unsigned_abs().ilog2();
            }
        }
        rows += run.len();
    }
    let common = all.map(|count| COMMON * f32::from(count) / rows.max(1) as f32);
    let mut sum = raw as f32;
    for counts in counts.chunks(SYMBOLS) {
        let other = counts.iter().sum::<u16>() as f32 + COMMON - 1.0;
        for (count, common) in counts.iter().zip(common).filter(|(count, _)| **count > 0) {
            sum += f32::from(*count) * log2(other / (f32::from(*count) - 1.0 + common));
        }
    }
    sum / rows.max(1) as f32
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
        parts
            .iter_mut()
            .for_each(|part| *part = Order::default().differences(part));
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
        let (kind, centre) = (VALUES, (sum / rows) as i64);
        let values = coded(Order { kind, centre }, indices);
        let (own, size_of_differences) = of_differences(indices);
        if size(&values) < size_of_differences + MORE_BITS * rows as usize {
            own.shorter(Self::of(&values))
        } else {
            own
        }
    }

    /// The better one of differences and their differences.
    pub(crate) fn of_differences(indices: &[i64]) -> Self {
        of_differences(indices).0
    }

    fn shorter(self, other: Self) -> Self {
        if other.bits < self.bits { other } else { self }
    }

    /// The plan of this order. The number of low bits follows the mean size, or where few differences make most of that, the sizes of all
    /// but these.
    pub(super) fn of((order, parts): &Coded) -> Self {
        let (mut sum, mut rows, mut lengths) = (0_u128, 0, [0; u64::BITS as usize + 1]);
        for difference in parts.iter().flatten() {
            let size = difference.unsigned_abs();
            sum += u128::from(size);
            rows += 1;
            lengths[(u64::BITS - size.leading_zeros()) as usize] += 1;
        }
        let mean = (sum / rows.max(1) as u128) as u64;
        let low = mean.checked_ilog2().map_or(0, |bits| bits.saturating_sub(SIZE_BITS));
        let mut longer = rows;
        let most = lengths.iter().take_while(|count| {
            longer -= **count;
            longer > rows / ROWS_OF_LONG
        });
        let usual = (most.count() as u32).saturating_sub(SMALLEST);
        let plan = |low| Self {
            order: *order,
            low,
            bits: match order.kind {
                VALUES => estimated_bits::<true>(parts, low),
                _ => estimated_bits::<false>(parts, low),
            },
        };
        let own = plan(low);
        if usual < low { own.shorter(plan(usual)) } else { own }
    }
}
