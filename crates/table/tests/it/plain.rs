//! Plain lines are split in the buffer, quoted ones by the reader of all spellings: the same cells give the same columns and counts.

use super::open_said;
use fewbits_table::{Batch, Cells, Dialect, Profile, Survey, Table};
use proptest::prelude::*;

fn said(names: usize) -> Dialect {
    Dialect {
        delimiter: Some(",".to_owned()),
        skip: Some(0),
        comment: Some(String::new()),
        quote: Some('"'),
        units_row: Some(false),
        decimal: Some('.'),
        missing: vec!["-9999".to_owned(), "ERR".to_owned(), "c0=7".to_owned()],
        skip_bad: if names > 0 { u64::MAX } else { 0 },
        ..Dialect::default()
    }
}

fn cell() -> impl Strategy<Value = String> {
    prop_oneof![
        6 => (any::<i32>(), 0_usize..8).prop_map(|(x, places)| format!("{:.places$}", f64::from(x) / 1000.0)),
        2 => any::<f64>().prop_map(|x| format!("{x}")),
        1 => any::<f64>().prop_map(|x| format!("{x:e}")),
        1 => any::<i64>().prop_map(|x| x.to_string()),
        2 => "[-+]?[0-9]{0,19}[.]?[0-9]{0,4}",
        1 => "[ \t]{0,2}[-+]?[0-9]{1,3}[.]?[0-9]{0,2}[ \t]{0,2}",
        1 => "[-+.0-9eE ,;]{0,6}".prop_map(|text| text.replace(',', "")),
        1 => "(-9999|-9999[.]00|7|7[.]0|ERR|NaN|nan|inf|-|---|NA|null|on|off|true|open|shut|a b|1_0|c0)",
        1 => "20[0-9]{2}-[01][0-9]-[0-3][0-9]([T ][0-2][0-9]:[0-6][0-9](:[0-6][0-9]([.][0-9]{1,4})?)?)?(Z|[+]02:00)?",
        1 => Just(String::new()),
    ]
}

fn lines(rows: &[Vec<String>], mark: &str, end: &str) -> String {
    let width = rows[0].len();
    let mut text = (0..width).map(|i| format!("c{i}")).collect::<Vec<_>>().join(",") + end;
    for row in rows {
        let cells: Vec<String> = row.iter().map(|cell| format!("{mark}{cell}{mark}")).collect();
        text += &(cells.join(",") + end);
    }
    text
}

fn bits(cells: &Cells) -> Vec<String> {
    (0..cells.len())
        .map(|row| match cells {
            Cells::Numbers(cells) => format!("{:?}", cells[row].map(f64::to_bits)),
            other => format!("{:?}", other.number(row)),
        })
        .collect()
}

fn told(profile: &Profile) -> String {
    let words: Vec<_> = profile.words.iter().collect();
    format!(
        "{} {} {} {} {:?} {:?} {:?} {} {:?}",
        profile.numbers,
        profile.values(),
        profile.gaps(),
        profile.suspicious(),
        profile.kind(),
        profile.missing,
        profile.range,
        profile.decimals,
        words
    )
}

fn survey(text: &str, said: &Dialect, time: Option<&str>) -> Survey {
    table(text, said, time).survey().unwrap()
}

fn table(text: &str, said: &Dialect, time: Option<&str>) -> Table {
    let mut table = open_said(text, said).unwrap();
    if let Some(time) = time {
        table.set_time(&[time]).unwrap();
    }
    table
}

/// All columns, times, places and counts of what was left out, read in batches of `limit` rows.
fn all(text: &str, said: &Dialect, time: Option<&str>, limit: usize) -> Vec<String> {
    let mut table = table(text, said, time);
    let (mut found, mut batch) = (Vec::new(), Batch::default());
    loop {
        match table.read(&mut batch, limit) {
            Ok(0) => break,
            Ok(_) => {}
            // Another line of names is not left out.
            Err(error) => {
                found.push(error.to_string());
                continue;
            }
        }
        for row in 0..batch.rows {
            let cells: Vec<String> = batch.columns.iter().map(|column| bits(column)[row].clone()).collect();
            found.push(format!("{:?} {:?} {cells:?}", batch.places[row], batch.times.get(row)));
        }
    }
    found.push(format!("{:?}", table.skipped()));
    found
}

proptest! {
    #[test]
    fn plain_and_quoted_cells_are_the_same(
        rows in (1_usize..5).prop_flat_map(|width| proptest::collection::vec(proptest::collection::vec(cell(), width), 1..40)),
        limit in 1_usize..20,
        is_crlf in any::<bool>(),
    ) {
        // A first row of numbers, so that all columns are of numbers unless most cells are not.
        let mut rows = rows;
        rows.insert(0, vec!["0.5".to_owned(); rows[0].len()]);
        let end = if is_crlf { "\r\n" } else { "\n" };
        let (plain, quoted) = (lines(&rows, "", end), lines(&rows, "\"", end));
        let said = said(rows[0].len());
        prop_assert_eq!(all(&plain, &said, None, limit), all(&quoted, &said, None, limit));
        let (a, b) = (survey(&plain, &said, None), survey(&quoted, &said, None));
        prop_assert_eq!((a.rows, a.skipped), (b.rows, b.skipped));
        for (a, b) in a.columns.iter().zip(&b.columns) {
            prop_assert_eq!(told(a), told(b));
        }
    }

    #[test]
    fn plain_and_quoted_times_are_the_same(
        seconds in proptest::collection::vec((-4_000_000_000_i64..9_000_000_000, 0_usize..10, 0_u8..6), 1..30),
        form in 0_u8..3,
    ) {
        let rows: Vec<Vec<String>> = seconds.iter().map(|(second, places, odd)| {
            let stamp = jiff(*second, form == 0, *places);
            let time = match (form, odd) {
                (2, _) => format!("{:.places$}", *second as f64 / 64.0),
                (0, 5) => stamp.replace('Z', "+05:30"),
                (_, 4) => stamp.replace('T', " "),
                _ => stamp,
            };
            vec![time, "1.5".to_owned()]
        }).collect();
        let said = said(2);
        let (plain, quoted) = (lines(&rows, "", "\n"), lines(&rows, "\"", "\n"));
        prop_assert_eq!(all(&plain, &said, Some("c0"), 7), all(&quoted, &said, Some("c0"), 7));
        let (a, b) = (survey(&plain, &said, Some("c0")), survey(&quoted, &said, Some("c0")));
        prop_assert_eq!(format!("{:?}", a.times), format!("{:?}", b.times));
    }
}

/// Seconds since 1970 as a date.
fn jiff(second: i64, is_utc: bool, places: usize) -> String {
    let scale = if is_utc {
        fewbits_table::Scale::Utc
    } else {
        fewbits_table::Scale::Local
    };
    fewbits_table::Time::from_ticks(second, 0).shown(scale, u8::try_from(places).unwrap_or(0))
}

#[test]
fn lines_longer_than_the_buffer_and_ends_within_it() {
    // Rows whose ends fall everywhere, also across the pieces that a source gives at once.
    struct Pieces(Vec<u8>, usize);
    impl std::io::Read for Pieces {
        fn read(&mut self, target: &mut [u8]) -> std::io::Result<usize> {
            let count = self.0.len().min(self.1).min(target.len());
            target[..count].copy_from_slice(&self.0[..count]);
            self.0.drain(..count);
            Ok(count)
        }
    }
    let mut text = "time,x\n".to_owned();
    for i in 0..300 {
        text += &format!("{i}.{},{}{}\n", i % 10, if i % 7 == 0 { " " } else { "" }, i * i);
    }
    for piece in [1, 2, 3, 7, 64, 1000] {
        let mut table = Table::open(Pieces(text.clone().into_bytes(), piece), &Dialect::default()).unwrap();
        table.find_time().unwrap();
        let mut batch = Batch::default();
        let mut rows = 0;
        while table.read(&mut batch, 16).unwrap() > 0 {
            for row in 0..batch.rows {
                assert_eq!(batch.columns[0].number(row), Ok(Some(f64::from(rows * rows))));
                assert_eq!(
                    batch.times[row]
                        .shown(fewbits_table::Scale::Seconds, 1)
                        .split('.')
                        .next(),
                    Some(rows.to_string().as_str())
                );
                rows += 1;
            }
        }
        assert_eq!(rows, 300, "{piece}");
    }
}

#[test]
fn a_source_that_fails_costs_no_rows_before() {
    struct Failing(Vec<u8>);
    impl std::io::Read for Failing {
        fn read(&mut self, target: &mut [u8]) -> std::io::Result<usize> {
            let count = self.0.len().min(target.len());
            if count == 0 {
                return Err(std::io::Error::other("gone"));
            }
            target[..count].copy_from_slice(&self.0[..count]);
            self.0.drain(..count);
            Ok(count)
        }
    }
    let text = (0..40).fold("time,x\n".to_owned(), |text, i| text + &format!("{i},{i}\n"));
    let mut table = Table::open(Failing(text.into_bytes()), &Dialect::default()).unwrap();
    let mut batch = Batch::default();
    assert_eq!(table.read(&mut batch, 100).unwrap(), 40);
    assert!(table.read(&mut batch, 100).is_err());
}
