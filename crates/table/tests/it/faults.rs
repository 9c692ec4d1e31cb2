//! Bad lines: each costs one line, is counted and named, and nothing else is lost.

use super::{numbers, open, open_said, refusal, rows};
use fewbits_table::{Batch, Dialect, Table};

fn skipping(text: &str, lines: u64) -> Table {
    let mut table = open_said(
        text,
        &Dialect {
            skip_bad: lines,
            ..Dialect::default()
        },
    )
    .unwrap();
    table.find_time().unwrap();
    table
}

#[test]
fn one_bad_line_costs_one_line() {
    for bad in [
        "2,26..5",
        "2",
        "2,3,4",
        "x,3",
        "2,\"3",
        "\0\0\0\0",
        "2,a \"b",
        "END OF FILE,9",
    ] {
        let text = format!("time,x\n0,1.5\n1,2.5\n{bad}\n3,3.5\n4,4.5\n");
        let mut table = open(&text);
        let mut batch = Batch::default();
        // The rows before it are handed out first, and reading goes on behind it.
        assert_eq!(table.read(&mut batch, 100).unwrap(), 2, "{bad}");
        let message = table.read(&mut batch, 100).unwrap_err().to_string();
        assert!(message.starts_with("line 4 (row 3)") && message.contains("--skip-bad"), "{bad}: {message}");
        assert_eq!(table.read(&mut batch, 100).unwrap(), 2, "{bad}");

        let mut table = skipping(&text, 1);
        assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(1.5), Some(2.5), Some(3.5), Some(4.5)]);
        assert_eq!((table.skipped().bad, table.skipped().faults.len()), (1, 1));
        assert!(table.skipped().faults[0].starts_with("line 4"));
    }
    // No more than that are left out.
    let mut table = skipping("time,x\n0,1\n1,a\n2,b\n3,1\n", 1);
    assert_eq!(refusal(&mut table).split(',').next(), Some("line 4 (row 3)"));
}

#[test]
fn lines_of_the_file_are_named() {
    let text = "# a\ntime,x,note\n\n0,1,\"two\nlines\"\n\n1,oops,b\n";
    let message = refusal(&mut open(text));
    assert!(message.starts_with("line 7 (row 2), column `x`: `oops`"), "{message}");
}

#[test]
fn empty_cells_and_rows() {
    // Empty cells behind the last name, lines of blanks, rows without a cell.
    let text = "time,x,\n0,1,,\n1,2\n  \n,,\n2,3,\n";
    let mut table = open(&text.replace("1,2\n", "1,2,\n"));
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(1.0), Some(2.0), Some(3.0)]);
    assert_eq!(table.skipped().blank, 1);
    // A blank line of a table of one column is a gap.
    assert_eq!(numbers(&rows(&mut open("x\n1.5\n\n2.5\n")).columns[0]), [Some(1.5), None, Some(2.5)]);
    // Short rows are refused, or their lack is a gap.
    let text = "time,x,y\n0,1,2\n1,3\n2,4,5\n";
    assert!(refusal(&mut open(text)).contains("2 cells instead of 3"));
    let mut table = open_said(
        text,
        &Dialect {
            short_rows: true,
            ..Dialect::default()
        },
    )
    .unwrap();
    table.find_time().unwrap();
    assert_eq!(numbers(&rows(&mut table).columns[1]), [Some(2.0), None, Some(5.0)]);
    // A table of names only is a table.
    assert_eq!(rows(&mut open("time,x\n")).rows, 0);
}

/// A logger that began before its sensors did: gaps below the names are rows, and the names stay.
#[test]
fn rows_of_gaps_below_the_names_are_rows() {
    let read = |text: &str| {
        let mut table = open(text);
        let names: Vec<String> = table.columns().iter().map(|column| column.name.clone()).collect();
        let found = rows(&mut table);
        // `NaN` is kept as the number that it is.
        let gaps = |column| {
            numbers(column)
                .into_iter()
                .map(|x| x.filter(|x| !x.is_nan()))
                .collect::<Vec<_>>()
        };
        (names.join(" "), found.columns.iter().map(gaps).collect::<Vec<_>>(), table.skipped().repeated)
    };
    let gap = [None, None, Some(1.0), None, Some(3.0)].to_vec();
    for word in ["", "NaN", "NA"] {
        let row = format!("{word},{word}\n");
        let text = format!("a,b\n{row}{row}1,2\n{row}3,4\n");
        assert_eq!(
            read(&text),
            ("a b".to_owned(), vec![gap.clone(), gap.iter().map(|x| x.map(|x| x + 1.0)).collect()], 0),
            "{text}"
        );
    }
    // Below a title and units, and with times, where such a row says nothing.
    let (names, columns, _) = read("Station 7\na,b\nm,s\n,\n1,2\n");
    assert_eq!((names.as_str(), &columns[0]), ("a b", &vec![None, Some(1.0)]));
    let (names, columns, _) = read("time,a\n,\n2024-01-01T00:00:00Z,1\n");
    assert_eq!((names.as_str(), columns.last()), ("time a", Some(&vec![Some(1.0)])));
}

#[test]
fn a_comment_that_may_be_a_row_is_not_dropped() {
    let text = "name,x\na,1\n#ff0000,2\nb,3\n";
    let mut table = open_said(text, &Dialect::default()).unwrap();
    assert!(refusal(&mut table).contains("--comment"));
    let mut table = open_said(
        text,
        &Dialect {
            comment: Some(String::new()),
            ..Dialect::default()
        },
    )
    .unwrap();
    assert_eq!(rows(&mut table).rows, 3);
}

#[test]
fn a_line_without_end_takes_no_memory() {
    let text = format!("time,x\n0,1\n{}\n1,2\n", "9".repeat(5_000_000));
    let mut table = skipping(&text, 1);
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(1.0), Some(2.0)]);
    assert!(table.skipped().faults[0].contains("longer than"));
    assert!(table.skipped().faults[0].len() < 300);
}

/// A source that hands out its lines one by one, as a live logger.
struct Live(std::collections::VecDeque<&'static str>);

impl std::io::Read for Live {
    fn read(&mut self, target: &mut [u8]) -> std::io::Result<usize> {
        let Some(line) = self.0.pop_front() else {
            panic!("a read that would wait for ever")
        };
        let count = line.len().min(target.len());
        target[..count].copy_from_slice(&line.as_bytes()[..count]);
        if count < line.len() {
            self.0.push_front(&line[count..]);
        }
        Ok(count)
    }
}

#[test]
fn a_live_row_waits_for_no_other() {
    let mut table = Table::open(Live(["time,x\n", "0,1\n", "1,2\n"].into()), &Dialect::default()).unwrap();
    table.find_time().unwrap();
    let mut batch = Batch::default();
    for value in [1.0, 2.0] {
        assert_eq!(table.read(&mut batch, 1).unwrap(), 1);
        assert_eq!(numbers(&batch.columns[0]), [Some(value)]);
    }
}
