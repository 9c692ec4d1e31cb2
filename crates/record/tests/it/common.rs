//! Rows that many tests use.

use fewbits_record::{Bound, Column, Playback, Recorder, Row, Schema, TimeBase};
use std::io::Cursor;

pub type Cells = Vec<Option<f64>>;

/// A generator of reproducible numbers in `[0, 1)` (splitmix64).
pub struct Numbers(pub u64);

impl Numbers {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Three columns: a wave within 0.05, decimals, whole numbers; a gap, a NaN and an infinity.
pub fn schema(rows_per_block: usize, time: TimeBase) -> Schema {
    let columns = vec![
        Column::new("wave", Bound::Absolute(0.05)).unwrap(),
        Column::new("price", Bound::Decimals(2)).unwrap(),
        Column::new("count", Bound::Lossless).unwrap(),
    ];
    Schema::new(columns, time)
        .unwrap()
        .with_rows_per_block(rows_per_block)
        .unwrap()
}

pub fn rows(count: usize) -> Vec<Cells> {
    let mut numbers = Numbers(7);
    (0..count)
        .map(|i| {
            let x = i as f64;
            let wave = match i % 50 {
                13 => None,
                29 => Some(f64::NAN),
                31 => Some(f64::NEG_INFINITY),
                _ => Some((0.1 * x).sin() + 0.1 * numbers.next()),
            };
            let price = (!(20..26).contains(&(i % 70))).then(|| (1e4 + 300.0 * (0.02 * x).cos()).round() / 100.0);
            vec![wave, price, Some((x / 3.0).floor() - 5.0)]
        })
        .collect()
}

pub fn record(schema: Schema, rows: &[Cells]) -> Vec<u8> {
    let mut recorder = Recorder::new(Vec::new(), schema);
    for row in rows {
        recorder.push_next(row).unwrap();
    }
    recorder.finish().unwrap()
}

pub fn read(bytes: &[u8]) -> Vec<Row> {
    let mut playback = Playback::new(Cursor::new(bytes)).unwrap();
    playback.rows().collect::<Result<_, _>>().unwrap()
}

/// Whether a restored row of [`schema`] keeps all promises.
pub fn row_holds(sample: &Cells, restored: &Cells) -> bool {
    let within = |i: usize, good: &dyn Fn(f64, f64) -> bool| match (sample[i], restored[i]) {
        (None, None) => true,
        (Some(a), Some(b)) if a.is_finite() && b.is_finite() => good(a, b),
        (Some(a), Some(b)) => a.to_bits() == b.to_bits(),
        _ => false,
    };
    within(0, &|a, b| (a - b).abs() <= 0.05)
        && within(1, &|a, b| a == b)
        && within(2, &|a, b| a.to_bits() == b.to_bits())
}
