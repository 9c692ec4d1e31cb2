//! Whole numbers of 64 bits in recordings: every number returns, whatever it is.

use crate::common::Numbers;
use fewbits_record::{Bound, Column, Effort, Integers, Playback, Recorder, Schema, TimeBase, merged};
use std::io::Cursor;

/// Any number of 64 bits.
fn bits(random: &mut Numbers) -> i64 {
    let mut half = || (random.next() * f64::from(u32::MAX)) as i64;
    (half() << 32) ^ half()
}

/// Numbers at all places where codes change their form.
fn numbers(random: &mut Numbers) -> Vec<i64> {
    let mut numbers = vec![0, 1, -1, i64::MIN, i64::MIN + 1, i64::MAX, 1 << 53, -(1 << 53), 1 << 60];
    for exponent in 0..63 {
        let power = 1_i64 << exponent;
        numbers.extend([power - 1, power, power + 1, -power - 1, -power, 1 - power]);
    }
    // Bits of doubles that are codes of near numbers themselves, of infinities and of NaN.
    for double in [
        1.0,
        -1.0,
        2.0,
        9_007_199_254_740_992.0,
        -9_007_199_254_740_992.0,
        5e-324,
        -0.0,
    ] {
        numbers.extend([-1, 0, 1].map(|step| f64::to_bits(double).cast_signed().wrapping_add(step)));
    }
    for double in [f64::INFINITY, f64::NEG_INFINITY, f64::NAN, f64::MAX, f64::MIN_POSITIVE] {
        numbers.extend([-1, 0, 1].map(|step| double.to_bits().cast_signed().wrapping_add(step)));
    }
    numbers.extend((0..2000).map(|_| bits(random)));
    numbers
}

#[test]
fn every_number_has_a_code_of_its_own() {
    let mut random = Numbers(49);
    let numbers = numbers(&mut random);
    for origin in [
        0,
        1,
        -1,
        1 << 60,
        i64::MIN,
        i64::MAX,
        1_700_000_000_123_456_789,
        1.0_f64.to_bits().cast_signed(),
    ] {
        let integers = Integers::from_origin(origin);
        for number in &numbers {
            let code = integers.code(*number);
            assert_eq!(integers.number(code), *number, "{number} from {origin}");
            // Any double stands for a number whose code it is.
            let double = f64::from_bits(number.cast_unsigned());
            assert_eq!(integers.code(integers.number(double)).to_bits(), double.to_bits(), "{double} from {origin}");
        }
    }
}

fn recorded(numbers: &[Option<i64>], origin: i64, first: i64, effort: Effort) -> Vec<u8> {
    let columns = vec![
        Column::new("x", Bound::Absolute(0.1)).unwrap(),
        Column::of_integers("id", origin).unwrap().with_unit("count").unwrap(),
    ];
    let schema = Schema::new(columns, TimeBase::Numbered)
        .unwrap()
        .with_rows_per_block(512)
        .unwrap();
    let mut recorder = Recorder::new(Vec::new(), schema).with_effort(effort);
    for (i, number) in numbers.iter().enumerate() {
        let code = number.map(|number| Integers::from_origin(origin).code(number));
        recorder.push(first + i as i64, &[Some(i as f64), code]).unwrap();
    }
    recorder.finish().unwrap()
}

fn restored(bytes: &[u8]) -> Vec<Option<i64>> {
    let mut playback = Playback::new(Cursor::new(bytes)).unwrap();
    let integers = playback.schema().columns()[1].integers().unwrap();
    assert_eq!(playback.schema().columns()[1].unit(), "count");
    let rows = playback.rows().map(Result::unwrap);
    rows.map(|row| row.values[1].map(|code| integers.number(code)))
        .collect()
}

#[test]
fn recordings_return_every_number() {
    let mut random = Numbers(53);
    for effort in [Effort::Thorough, Effort::Fast] {
        let mut all: Vec<Option<i64>> = numbers(&mut random).into_iter().map(Some).collect();
        all.extend([None, Some(7), None]);
        for origin in [0, -5, 1 << 60] {
            assert_eq!(restored(&recorded(&all, origin, 0, effort)), all);
        }
    }
}

#[test]
fn numbers_near_each_other_take_few_bits() {
    let numbers: Vec<Option<i64>> = (0..4000).map(|i| Some((1 << 60) + 2 * i + 1)).collect();
    let bytes = recorded(&numbers, (1 << 60) + 1, 0, Effort::Thorough);
    assert!(bytes.len() < 400, "{} bytes", bytes.len());
    assert_eq!(restored(&bytes), numbers);
}

#[test]
fn recordings_of_other_origins_are_one_table() {
    let days = [[1_i64 << 60, (1 << 60) + 9], [i64::MAX - 1, -3]];
    let files: Vec<Vec<u8>> = days
        .iter()
        .enumerate()
        .map(|(day, numbers)| recorded(&numbers.map(Some), numbers[0], 2 * day as i64, Effort::Thorough))
        .collect();
    let mut playbacks: Vec<_> = files
        .iter()
        .map(|bytes| Playback::new(Cursor::new(bytes)).unwrap())
        .collect();
    let integers = playbacks[0].schema().columns()[1].integers().unwrap();
    let rows = merged(&mut playbacks, &["id"], (i64::MIN, i64::MAX)).unwrap();
    let found: Vec<i64> = rows
        .map(|row| integers.number(row.unwrap().values[0].unwrap()))
        .collect();
    assert_eq!(found, days.concat());
}

#[test]
fn no_bound_and_no_earlier_bound_applies() {
    let bytes = recorded(&[Some(1 << 60), Some(3)], 0, 0, Effort::Thorough);
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    let wider = playback
        .widened(&[Some(Bound::Absolute(1.0)), Some(Bound::Absolute(1e6))])
        .unwrap()
        .unwrap();
    assert_eq!(wider.columns()[1].bound(), Bound::Lossless);
    assert_eq!(restored(&playback.repack(wider, Vec::new(), Effort::Thorough).unwrap()), [Some(1 << 60), Some(3)]);
    assert!(Column::of_integers("id", 0).unwrap().with_earlier_bound(1.0).is_err());
}

#[test]
fn stretches_of_whole_numbers_are_those_of_the_numbers() {
    let mut random = Numbers(53);
    let numbers = numbers(&mut random);
    let columns = vec![
        Column::of_integers("id", 1 << 60).unwrap(),
        Column::new("x", Bound::Lossless).unwrap(),
    ];
    let schema = Schema::new(columns, TimeBase::Numbered).unwrap();
    let schema = schema.with_rows_per_block(256).unwrap();
    let integers = schema.columns()[0].integers().unwrap();
    let mut recorder = Recorder::new(Vec::new(), schema);
    for (row, number) in numbers.iter().enumerate() {
        let code = (row % 5 != 0).then(|| integers.code(*number));
        recorder.push_next(&[code, Some(row as f64)]).unwrap();
    }
    let bytes = recorder.finish().unwrap();
    let mut playback = Playback::new(Cursor::new(&bytes)).unwrap();
    for every in [1_u64, 7, 300, 1 << 40] {
        let found = playback
            .aggregates(every, (i64::MIN, i64::MAX), |error| panic!("{error}"))
            .unwrap();
        for stretch in &found {
            let rows = stretch.tick as usize..numbers.len().min(stretch.tick as usize + every as usize);
            let inside: Vec<i64> = rows
                .clone()
                .filter(|row| row % 5 != 0)
                .map(|row| numbers[row])
                .collect();
            let whole = stretch.wholes[0].unwrap();
            assert_eq!((whole.count(), stretch.rows), (inside.len() as u64, rows.len() as u64));
            let ends = inside.iter().min().copied().zip(inside.iter().max().copied());
            assert_eq!(whole.ends(), ends);
            let sum: i128 = inside.iter().map(|number| i128::from(*number)).sum();
            if let Some(mean) = whole.mean() {
                let off = mean - sum as f64 / inside.len() as f64;
                assert!(off.abs() <= 4.0 * f64::EPSILON * mean.abs().max(1.0), "{mean} {sum}");
            }
            // The other column is as before.
            assert_eq!(stretch.wholes[1], None);
            assert_eq!(stretch.columns[1].ends(), Some((rows.start as f64, rows.end as f64 - 1.0)));
        }
        assert_eq!(found.iter().map(|stretch| stretch.rows).sum::<u64>(), numbers.len() as u64);
    }
}
