//! Recordings under wider bounds, and several recordings as one table.

use crate::common::{Cells, Numbers, record, rows, schema};
use fewbits_record::{Bound, Column, Effort, Error, Playback, Recorder, Row, Schema, TimeBase, TimeFormat, merged};
use std::io::{Cursor, Write};

fn clock(tolerance: u64) -> TimeBase {
    TimeBase::Clock {
        decimals: 0,
        tolerance,
        format: TimeFormat::Utc,
    }
}

fn open(bytes: &[u8]) -> Playback<Cursor<&[u8]>> {
    Playback::new(Cursor::new(bytes)).unwrap()
}

fn all(bytes: &[u8]) -> Vec<Row> {
    open(bytes).rows().map(Result::unwrap).collect()
}

/// A table of all kinds of bounds, with gaps, and what it is packed to.
fn table() -> (Vec<(i64, Cells)>, Vec<u8>) {
    let columns = vec![
        Column::new("wave", Bound::Absolute(0.05))
            .unwrap()
            .with_unit("K")
            .unwrap(),
        Column::new("share", Bound::ShareOfRange(0.001)).unwrap(),
        Column::new("price", Bound::Decimals(2)).unwrap(),
        Column::new("count", Bound::Lossless).unwrap(),
        Column::new("turn", Bound::Absolute(0.5))
            .unwrap()
            .with_period(360.0)
            .unwrap(),
        Column::new("steady", Bound::Absolute(0.01)).unwrap(),
    ];
    let mut numbers = Numbers(9);
    let rows: Vec<(i64, Cells)> = (0..3000)
        .map(|i| {
            let x = f64::from(i);
            let wave = (i % 50 != 13).then(|| 20.0 + 3.0 * (0.01 * x).sin() + 0.2 * numbers.next());
            let cells = [
                wave,
                Some(x.sqrt() + numbers.next()),
                Some((x * 7.7).round() / 100.0),
                Some((x / 7.0).floor()),
            ];
            let rest = [Some((x * 1.3) % 360.0), Some((0.01 * x).cos())];
            (60 * i64::from(i) + (7.0 * numbers.next()) as i64, cells.into_iter().chain(rest).collect())
        })
        .collect();
    let mut recorder = Recorder::new(
        Vec::new(),
        Schema::new(columns, clock(5))
            .unwrap()
            .with_rows_per_block(512)
            .unwrap(),
    );
    rows.iter()
        .for_each(|(tick, cells)| recorder.push(*tick, cells).unwrap());
    (rows, recorder.finish().unwrap())
}

const WIDER: [Option<Bound>; 6] = [
    Some(Bound::Absolute(0.5)),
    Some(Bound::ShareOfRange(0.02)),
    Some(Bound::Decimals(1)),
    Some(Bound::Absolute(3.0)),
    Some(Bound::Absolute(4.0)),
    None,
];

#[test]
fn added_bounds_hold_for_the_original_samples() {
    let (rows, first) = table();
    let schema = open(&first).widened(&WIDER).unwrap().unwrap();
    let second = open(&first).repack(schema, Vec::new(), Effort::Thorough).unwrap();
    assert!(5 * second.len() < 3 * first.len(), "{} of {}", second.len(), first.len());
    let mut playback = open(&second);
    let columns = playback.schema().columns().to_vec();
    let earlier: Vec<f64> = columns.iter().map(Column::earlier_bound).collect();
    assert_eq!((earlier[0], earlier[2], earlier[3], earlier[4], earlier[5]), (0.05, 0.005, 0.0, 0.5, 0.01));
    assert!(earlier[1] > 0.04 && earlier[1] < 0.06, "{}", earlier[1]);
    assert_eq!((columns[0].unit(), columns[4].period()), ("K", Some(360.0)));
    let mut read = 0;
    for block in playback.blocks() {
        let block = block.unwrap();
        for (i, tick) in block.ticks.iter().enumerate() {
            let (original, cells) = &rows[read];
            assert!(tick.abs_diff(*original) <= 5);
            for (c, column) in columns.iter().enumerate() {
                assert!(
                    column.keeps(cells[c], block.columns[c][i], block.share_bounds[c]),
                    "{} row {read}",
                    column.name()
                );
            }
            read += 1;
        }
    }
    assert_eq!(read, rows.len());
    // Ticks do not move a second time, and a column that was not named keeps its values.
    for (a, b) in all(&first).iter().zip(all(&second)) {
        assert_eq!((a.tick, a.values[5].map(f64::to_bits)), (b.tick, b.values[5].map(f64::to_bits)));
    }
}

#[test]
fn same_bounds_again_change_nothing() {
    let (_, first) = table();
    let schema = open(&first).widened(&WIDER).unwrap().unwrap();
    let second = open(&first).repack(schema, Vec::new(), Effort::Fast).unwrap();
    assert_eq!(open(&second).widened(&WIDER).unwrap(), None);
    assert_eq!(open(&first).widened(&[None; 6]).unwrap(), None);
    let narrower = [Some(Bound::Absolute(0.01)), None, None, None, None, None];
    assert_eq!(open(&first).widened(&narrower).unwrap(), None);
    assert!(open(&first).widened(&[None]).is_err());
    // A third time: three bounds add up.
    let third = [Some(Bound::Absolute(1.0)), None, None, None, None, None];
    let schema = open(&second).widened(&third).unwrap().unwrap();
    let earlier = schema.columns()[0].earlier_bound();
    assert!((0.55..0.550_000_001).contains(&earlier), "{earlier}");
    let relative = Bound::Relative {
        share: 0.01,
        floor: 0.1,
    };
    let bytes = {
        let schema = Schema::new(vec![Column::new("x", relative).unwrap()], TimeBase::Numbered).unwrap();
        record(schema, &[vec![Some(1.0)]])
    };
    assert!(open(&bytes).widened(&[Some(Bound::Absolute(1.0))]).is_err());
    assert_eq!(open(&bytes).widened(&[Some(relative)]).unwrap(), None);
}

#[test]
fn damaged_recordings_are_not_repacked() {
    let (_, first) = table();
    let schema = open(&first).widened(&WIDER).unwrap().unwrap();
    for at in [first.len() / 3, first.len() / 2] {
        let mut damaged = first.clone();
        damaged[at] ^= 16;
        let repacked = open(&damaged).repack(schema.clone(), Vec::new(), Effort::Fast);
        assert!(matches!(repacked, Err(Error::Block { .. })));
    }
    let cut = &first[..first.len() - 5];
    assert!(open(cut).repack(schema, Vec::new(), Effort::Fast).is_err());
}

/// A sink that fails after so many bytes.
struct Failing(Vec<u8>, usize);

impl Write for Failing {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        let room = self.1 - self.0.len();
        if room == 0 {
            return Err(std::io::ErrorKind::StorageFull.into());
        }
        let taken = room.min(bytes.len());
        self.0.extend_from_slice(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        Ok(())
    }
}

#[test]
fn repacking_that_fails_at_any_byte_is_told() {
    let truth = rows(60);
    let first = record(schema(20, TimeBase::Numbered), &truth);
    let wider = [Some(Bound::Absolute(1.0)), None, None];
    let schema = open(&first)
        .widened(&wider)
        .unwrap()
        .unwrap()
        .with_rows_per_block(20)
        .unwrap();
    let whole = open(&first).repack(schema.clone(), Vec::new(), Effort::Fast).unwrap();
    for room in 0..whole.len() {
        let failed = open(&first).repack(schema.clone(), Failing(Vec::new(), room), Effort::Fast);
        assert!(matches!(failed, Err(Error::Io { .. })), "{room}");
    }
    assert!(
        open(&first)
            .repack(schema, Failing(Vec::new(), whole.len()), Effort::Fast)
            .is_ok()
    );
}

#[test]
fn recordings_merge_in_the_order_of_time() {
    let part = |ticks: &[i64], rows_per_block: usize, order: [&str; 2]| {
        let columns = order.map(|name| Column::new(name, Bound::Lossless).unwrap()).to_vec();
        let schema = Schema::new(columns, clock(0))
            .unwrap()
            .with_rows_per_block(rows_per_block)
            .unwrap();
        let mut recorder = Recorder::new(Vec::new(), schema);
        for tick in ticks {
            let cell = |name| Some(if name == "a" { *tick as f64 } else { -(*tick as f64) });
            recorder.push(*tick, &order.map(cell)).unwrap();
        }
        recorder.finish().unwrap()
    };
    let even: Vec<i64> = (0..300).map(|i| 2 * i).collect();
    let odd: Vec<i64> = (0..100).map(|i| 2 * i + 101).collect();
    let late: Vec<i64> = (0..50).map(|i| 1000 + i).collect();
    let bytes = [
        part(&late, 8, ["a", "b"]),
        part(&even, 1 << 16, ["a", "b"]),
        part(&odd, 16, ["b", "a"]),
    ];
    let mut playbacks: Vec<_> = bytes.iter().map(|bytes| open(bytes)).collect();
    let mut expected: Vec<i64> = even.iter().chain(&odd).chain(&late).copied().collect();
    expected.sort_unstable();
    let read: Vec<Row> = merged(&mut playbacks, &["b", "a"], (i64::MIN, i64::MAX))
        .unwrap()
        .map(Result::unwrap)
        .collect();
    assert_eq!(read.iter().map(|row| row.tick).collect::<Vec<_>>(), expected);
    assert!(
        read.iter()
            .all(|row| row.values == [Some(-(row.tick as f64)), Some(row.tick as f64)])
    );
    let few: Vec<i64> = merged(&mut playbacks, &["a"], (150, 1003))
        .unwrap()
        .map(|row| row.unwrap().tick)
        .collect();
    assert_eq!(
        few,
        expected
            .iter()
            .copied()
            .filter(|tick| (150..=1003).contains(tick))
            .collect::<Vec<_>>()
    );
    // Damage of one recording is told, and the others are read.
    let mut damaged = bytes[2].clone();
    let at = open(&bytes[2]).index().unwrap()[1].offset as usize + 3;
    damaged[at] ^= 4;
    let mut playbacks = vec![open(&bytes[1]), open(&damaged)];
    let (good, bad): (Vec<_>, Vec<_>) = merged(&mut playbacks, &["a"], (i64::MIN, i64::MAX))
        .unwrap()
        .partition(Result::is_ok);
    assert_eq!((good.len(), bad.len()), (400 - 16, 1));
    // Other columns, or other ticks, are refused.
    let other = part(&[1], 8, ["a", "c"]);
    assert!(merged(&mut [open(&bytes[0]), open(&other)], &["a"], (0, 1)).is_err());
    let numbered = record(
        Schema::new(
            ["a", "b"]
                .map(|name| Column::new(name, Bound::Lossless).unwrap())
                .to_vec(),
            TimeBase::Numbered,
        )
        .unwrap(),
        &[vec![None, None]],
    );
    assert!(merged(&mut [open(&bytes[0]), open(&numbered)], &["a"], (0, 1)).is_err());
}
