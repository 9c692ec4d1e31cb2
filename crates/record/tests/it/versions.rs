//! Files of versions 5 and 6 stay readable, and are continued. The tables beside them are what the program of version 5 printed.

use fewbits_record::{Aggregate, Bound, Column, Damage, Effort, Error, Playback, Recorder, Row, Schema, TimeBase};
use std::path::{Path, PathBuf};

const TABLES: [&str; 6] = ["mixed", "exact", "loose", "wide", "segments", "fast"];

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/corpus").join(name)
}

/// Nanoseconds since midnight of a time as `2026-01-31T12:00:00.003Z`.
fn nanoseconds(text: &str) -> i64 {
    let clock = text.split_once('T').unwrap().1.trim_end_matches('Z');
    let (clock, fraction) = clock.split_once('.').unwrap_or((clock, ""));
    let seconds = clock
        .split(':')
        .fold(0, |sum, part| 60 * sum + part.parse::<i64>().unwrap());
    format!("{seconds}{fraction:0<9}").parse().unwrap()
}

/// Times, if there are any, and cells of a table.
fn table(name: &str, has_time: bool) -> Vec<(Option<i64>, Vec<Option<f64>>)> {
    let text = std::fs::read_to_string(file(&format!("{name}.csv"))).unwrap();
    let cell = |cell: &str| (!cell.is_empty()).then(|| cell.parse().unwrap());
    let row = |line: &str| {
        let mut cells = line.split(',');
        let time = has_time.then(|| nanoseconds(cells.next().unwrap()));
        (time, cells.map(cell).collect())
    };
    text.lines().skip(1).map(row).collect()
}

/// Nanoseconds of a tick.
fn scale(schema: &Schema) -> i64 {
    match schema.time() {
        TimeBase::Clock { decimals, .. } => 10_i64.pow(9 - u32::from(decimals)),
        _ => 1,
    }
}

fn has_time(schema: &Schema) -> bool {
    schema.time() != TimeBase::Numbered
}

fn rows(path: &Path) -> (Schema, Vec<Row>, Vec<Error>) {
    let mut playback = Playback::open(path).unwrap();
    let schema = playback.schema().clone();
    let (rows, errors): (Vec<_>, Vec<_>) = playback.rows().partition(Result::is_ok);
    let errors = errors.into_iter().filter_map(Result::err).collect();
    (schema, rows.into_iter().map(Result::unwrap).collect(), errors)
}

#[test]
fn version_5_returns_the_values_of_its_own_program() {
    for (stored, name) in TABLES
        .map(|name| (name, name))
        .into_iter()
        .chain([("unfinished", "mixed")])
    {
        let (schema, read, errors) = rows(&file(&format!("v5-{stored}.fewb")));
        let expected = table(name, has_time(&schema));
        assert_eq!(read.len(), expected.len(), "{stored}");
        for (row, (time, cells)) in read.iter().zip(&expected) {
            if let (Some(time), Some((Some(first), _))) = (time, expected.first()) {
                assert_eq!((row.tick - read[0].tick) * scale(&schema), time - first, "{stored}");
            }
            let bits = |cells: &[Option<f64>]| -> Vec<_> { cells.iter().map(|cell| cell.map(f64::to_bits)).collect() };
            assert_eq!(bits(&row.values), bits(cells), "{stored}, row {}", row.tick);
        }
        let damages = errors.iter().map(|error| match error {
            Error::Block { damage, .. } => *damage,
            other => panic!("{other}"),
        });
        let damages: Vec<Damage> = damages.collect();
        let expected: &[Damage] = if stored == "unfinished" {
            &[Damage::CutOff, Damage::NoEnd]
        } else {
            &[]
        };
        assert_eq!(damages, expected, "{stored}");
    }
}

#[test]
fn version_6_keeps_the_bounds_of_the_table() {
    for name in TABLES {
        let (schema, read, errors) = rows(&file(&format!("v6-{name}.fewb")));
        let expected = table(name, has_time(&schema));
        assert!(errors.is_empty() && read.len() == expected.len(), "{name}: {errors:?}");
        let range = |column: usize| {
            let cells = expected
                .iter()
                .filter_map(|(_, cells)| cells[column].filter(|x| x.is_finite()));
            let ends = cells.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            ends.1 - ends.0
        };
        for (i, column) in schema.columns().iter().enumerate() {
            // At most 2 % of the range is asked for.
            let share = Some(0.02 * range(i));
            for (row, (_, cells)) in read.iter().zip(&expected) {
                assert!(column.keeps(cells[i], row.values[i], share), "{name} {}: {row:?}", column.name());
            }
        }
    }
}

#[test]
#[ignore = "writes the files of version 6 anew"]
fn files_are_written() {
    for name in TABLES {
        let (schema, read, _) = rows(&file(&format!("v5-{name}.fewb")));
        let mut recorder = Recorder::new(Vec::new(), schema);
        for row in read {
            recorder.push(row.tick, &row.values).unwrap();
        }
        std::fs::write(file(&format!("v6-{name}.fewb")), recorder.finish().unwrap()).unwrap();
    }
}

/// Columns of what version 6 has beside version 5: a bound relative to each value, an earlier bound, directions in radians.
fn later_schema() -> Schema {
    let columns = vec![
        Column::new(
            "size",
            Bound::Relative {
                share: 0.01,
                floor: 0.5,
            },
        )
        .unwrap(),
        Column::new("twice", Bound::Absolute(1.0))
            .unwrap()
            .with_earlier_bound(0.25)
            .unwrap(),
        Column::new("turn", Bound::Absolute(0.1))
            .unwrap()
            .with_period(std::f64::consts::TAU)
            .unwrap(),
        Column::new("still", Bound::Lossless).unwrap(),
    ];
    let schema = Schema::new(columns, TimeBase::Numbered).unwrap();
    schema.with_rows_per_block(4096).unwrap()
}

/// By additions and multiplications of small numbers only: the same on every machine.
fn later_row(i: i64) -> Vec<Option<f64>> {
    let wave = (i % 200 - 100).abs() as f64;
    let size = (i % 97 != 5).then(|| wave * wave * wave / 64.0 - 100.0);
    vec![
        size,
        Some(wave + (i * i % 31) as f64 / 32.0),
        Some((i % 50) as f64 / 8.0),
        Some(7.5),
    ]
}

#[test]
fn version_6_with_aggregates_keeps_bounds_and_numbers() {
    let (schema, read, errors) = rows(&file("v6-later.fewb"));
    assert!(errors.is_empty() && read.len() == 9000 && schema == later_schema());
    for row in &read {
        for (i, (column, sample)) in schema.columns().iter().zip(later_row(row.tick)).enumerate() {
            assert!(column.keeps(sample, row.values[i], None), "{} of row {}", column.name(), row.tick);
        }
    }
    let mut playback = Playback::open(file("v6-later.fewb")).unwrap();
    let index = playback.index().unwrap();
    let blocks: Vec<_> = playback.blocks().map(Result::unwrap).collect();
    assert_eq!(index.len(), 3);
    for (info, block) in index.iter().zip(&blocks) {
        let of = |cells: &Vec<Option<f64>>| Aggregate::of(cells.iter().flatten().copied());
        assert_eq!(info.aggregates, Some(block.columns.iter().map(of).collect()));
    }
}

/// A walk with rests and jumps, by additions of integers: the same on every machine.
fn walk() -> Vec<f64> {
    let (mut state, mut level) = (1_u32, 0_i32);
    let next = |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let rests = state >> 8 & 31 < 12;
        let step = (state >> 24) as i32 - 128;
        level += if rests { 0 } else { step };
        level += if state >> 16 & 1023 == 0 {
            100_000 * step.signum()
        } else {
            0
        };
        f64::from(level) / 16.0
    };
    (0..5000).map(next).collect()
}

/// Independent draws, which have more entropy as differences.
fn draws() -> Vec<f64> {
    let mut state = 5_u32;
    let next = |_| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from((state >> 8) % 4000) / 16.0
    };
    (0..5000).map(next).collect()
}

/// A walk on few numbers that are on no grid.
fn levels() -> Vec<f64> {
    let near = walk().into_iter().map(|x| (x / 64.0).floor().rem_euclid(90.0));
    near.map(|x| (x * x * x * 1024.0 + x) / 3.0).collect()
}

type Signal = fn() -> Vec<f64>;

/// A walk of the slope.
fn bends() -> Vec<f64> {
    let (mut slope, mut sum) = (0.0, 0.0);
    let mut next = |x: f64| {
        slope += x / 4096.0;
        sum += slope;
        sum
    };
    walk().into_iter().map(&mut next).collect()
}

/// Signals whose blocks have tables that learn: of differences, of values, of levels.
const LEARNED: [(&str, Signal, Bound); 3] = [
    ("v6-tables.fewb", walk, Bound::Absolute(2.0)),
    ("v6-tables-of-values.fewb", draws, Bound::Absolute(16.0)),
    ("v6-tables-of-levels.fewb", levels, Bound::Lossless),
];

/// Signals of two kinds.
fn kinds() -> Vec<f64> {
    let near = walk().into_iter().map(|x| (x / 64.0).floor());
    near.chain(draws()).collect()
}

/// Signals whose blocks store their tables: of differences, with low bits, of differences of differences, of values, of levels, and in sections.
const TABLED: [(&str, Signal, Bound); 6] = [
    ("v6-stored.fewb", walk, Bound::Absolute(2.0)),
    ("v6-stored-low-bits.fewb", walk, Bound::Absolute(0.3)),
    ("v6-stored-of-bends.fewb", bends, Bound::Absolute(0.5)),
    ("v6-stored-of-values.fewb", draws, Bound::Absolute(16.0)),
    ("v6-stored-of-levels.fewb", levels, Bound::Lossless),
    ("v6-sections.fewb", kinds, Bound::Absolute(2.0)),
];

/// A single block with tables, which has no identity.
fn tabled(signal: Signal, bound: Bound) -> Vec<u8> {
    let schema = Schema::new(vec![Column::new("walk", bound).unwrap()], TimeBase::Numbered).unwrap();
    let mut recorder = Recorder::new(Vec::new(), schema).with_effort(Effort::Fast);
    signal().iter().for_each(|x| recorder.push_next(&[Some(*x)]).unwrap());
    recorder.finish().unwrap()
}

#[test]
fn version_6_with_tables_keeps_bytes_and_bounds() {
    for (name, signal, bound) in TABLED {
        assert!(tabled(signal, bound) == std::fs::read(file(name)).unwrap(), "{name}");
    }
    for (name, signal, bound) in LEARNED.into_iter().chain(TABLED) {
        let path = file(name);
        let (schema, read, errors) = rows(&path);
        assert!(errors.is_empty() && read.len() == signal().len(), "{name}");
        assert_eq!(schema.columns()[0].bound(), bound, "{name}");
        let mut pairs = read.iter().zip(signal());
        assert!(pairs.all(|(row, sample)| schema.columns()[0].keeps(Some(sample), row.values[0], None)), "{name}");
    }
}

#[test]
#[ignore = "writes the files of version 6 with stored tables anew"]
fn files_of_tables_are_written() {
    for (name, signal, bound) in TABLED {
        std::fs::write(file(name), tabled(signal, bound)).unwrap();
    }
}

#[test]
#[ignore = "writes the file of version 6 with aggregates anew"]
fn later_file_is_written() {
    let mut recorder = Recorder::new(Vec::new(), later_schema());
    (0..9000).for_each(|i| recorder.push(i, &later_row(i)).unwrap());
    std::fs::write(file("v6-later.fewb"), recorder.finish().unwrap()).unwrap();
}

#[test]
fn version_5_is_continued_with_the_same_rows() {
    let folder = tempfile::tempdir().unwrap();
    for name in TABLES {
        let path = folder.path().join(name);
        std::fs::copy(file(&format!("v5-{name}.fewb")), &path).unwrap();
        let (_, before, _) = rows(&path);
        let mut recorder = Recorder::resume(&path).unwrap();
        let next = recorder.next_tick();
        recorder.push_next(&before[0].values).unwrap();
        recorder.finish().unwrap();
        let (_, after, errors) = rows(&path);
        assert!(errors.is_empty(), "{name}: {errors:?}");
        // NaN differs from itself: compare what is printed.
        assert_eq!(format!("{before:?}"), format!("{:?}", &after[..before.len()]), "{name}");
        assert_eq!((after.len(), after[before.len()].tick), (before.len() + 1, next), "{name}");
        assert!(Playback::open(&path).unwrap().has_index());
    }
}
