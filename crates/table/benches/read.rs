//! Reading of plain numbers, beside the crate `csv` alone, which splits the same bytes and parses nothing.

use divan::Bencher;
use divan::counter::BytesCount;
use fewbits_table::{Batch, Dialect, Table};
use std::fmt::Write;

fn main() {
    divan::main();
}

/// Rows of a time and three numbers.
fn text() -> String {
    let mut text = "time,temp,rh,flow\n".to_owned();
    for i in 0..200_000_u32 {
        let x = f64::from(i % 997);
        let _ = writeln!(
            text,
            "{}.{},{:.2},{:.1},{:.4}",
            1_700_000_000 + i / 10,
            i % 10,
            20.0 + 0.01 * x,
            40.0 + 0.02 * x,
            0.001 * x
        );
    }
    text
}

/// The unit: the crate `csv` over all cells.
#[divan::bench]
fn csv_alone_unit(bencher: Bencher<'_, '_>) {
    let text = text();
    bencher.counter(BytesCount::of_str(&text)).bench_local(|| {
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let (mut record, mut cells) = (csv::ByteRecord::new(), 0);
        while reader.read_byte_record(&mut record).is_ok_and(|more| more) {
            cells += record.len();
        }
        cells
    });
}

#[divan::bench(args = [false, true])]
fn table(bencher: Bencher<'_, '_>, with_time: bool) {
    let text = text();
    bencher.counter(BytesCount::of_str(&text)).bench_local(|| {
        let mut rows = 0;
        if let Ok(mut table) = Table::open(std::io::Cursor::new(text.clone().into_bytes()), &Dialect::default()) {
            if with_time {
                rows += table.find_time().map_or(0, usize::from);
            }
            let mut batch = Batch::default();
            while let Ok(count @ 1..) = table.read(&mut batch, 1024) {
                rows += count;
            }
        }
        rows
    });
}
