//! Identifiers that could be numbers, and other cells whose digits are none: versions, ratios, numbers with units, formulas, dashes.

use crate::{numbers, open, open_said, refusal, rows, seconds};
use fewbits_table::{Cells, Dialect, Kind, Table};

fn column(name: &str, cells: &[&str]) -> Table {
    let text = (0..12).fold(format!("n,{name}\n"), |text, i| text + &format!("{i},{}\n", cells[i % cells.len()]));
    open_said(&text, &Dialect::default()).unwrap()
}

/// Asserts that the cells of a column come back as texts, as they stand, also where all rows are known.
fn are_words(name: &str, cells: &[&str]) {
    let survey = column(name, cells).survey().unwrap();
    let mut table = column(name, cells);
    for is_known in [false, true] {
        if is_known {
            table = column(name, cells);
            table.use_survey(&survey);
        }
        assert_eq!(table.columns()[1].kind, Kind::Words, "{name} {cells:?}");
        let batch = rows(&mut table);
        let Cells::Words(places) = &batch.columns[1] else {
            panic!("no words")
        };
        let texts: Vec<&str> = places
            .iter()
            .map(|place| table.words(1)[place.unwrap() as usize].as_str())
            .collect();
        assert_eq!(texts[..cells.len()], *cells, "{name}");
    }
    assert!(table.lost_zeros().is_empty());
}

fn are_numbers(name: &str, cells: &[&str], expected: &[f64]) {
    let mut table = column(name, cells);
    assert_eq!(table.columns()[1].kind, Kind::Number, "{name} {cells:?}");
    let found = numbers(&rows(&mut table).columns[1]);
    assert_eq!(found[..expected.len()], expected.iter().map(|x| Some(*x)).collect::<Vec<_>>(), "{name}");
}

#[test]
fn zeros_of_identifiers_are_kept() {
    for name in ["id", "site_no", "deviceId", "STATIONS_ID", "Zip Code", "Serial-No."] {
        are_words(name, &["007", "042", "100", "7"]);
    }
    // Of other columns the number counts, and the loss is told.
    are_numbers("x", &["0007", "0042", "100"], &[7.0, 42.0, 100.0]);
    let table = column("x", &["0007", "0042", "100"]);
    assert_eq!(
        table
            .lost_zeros()
            .iter()
            .map(|(column, cell)| (column.name.as_str(), *cell))
            .collect::<Vec<_>>(),
        [("x", "0007")]
    );
    let table = column("caller", &["+491715550000", "+491715550001"]);
    assert_eq!(table.lost_zeros()[0].1, "+491715550000");
    are_words("phone", &["+491715550000", "+491715550001"]);
    for (name, cells) in [("x", ["0.5", "00.5", "0"]), ("id", ["7", "42", "100"])] {
        assert!(column(name, &cells).lost_zeros().is_empty());
        assert_eq!(column(name, &cells).columns()[1].kind, Kind::Number);
    }
    // Names hide no identifier: `grid` and `idle` are other words.
    are_numbers("grid", &["007", "8"], &[7.0, 8.0]);
    are_numbers("idle time", &["007", "8"], &[7.0, 8.0]);
}

#[test]
fn binary_digits_of_one_length_are_words() {
    are_words("flags", &["00000101", "00000000", "10000000"]);
    are_numbers("x", &["000", "101"], &[0.0, 101.0]);
    are_numbers("x", &["10", "1010", "0"], &[10.0, 1010.0, 0.0]);
}

#[test]
fn powers_beside_identifiers_are_words() {
    are_words("part", &["1e5", "12E4", "A77", "3B2"]);
    are_words("part", &["007", "042", "A1", "9"]);
    are_numbers("x", &["1e5", "12E4"], &[1e5, 12e4]);
    // A fault among numbers is no identifier.
    assert!(refusal(&mut column("x", &["1e5", "2e5", "3e5", "ERR"])).contains("`ERR` is not a number"));
    assert!(refusal(&mut column("x", &["08", "09", "0A", "10"])).contains("hexadecimal"));
}

#[test]
fn words_may_be_said() {
    let text = "n,v,w\n1,1.9,on\n2,1.10,1\n3,10:05,off\n4,007,0\n";
    let said = Dialect {
        words: vec!["v".to_owned(), "w".to_owned()],
        ..Dialect::default()
    };
    assert_eq!(said.as_options(), "--words v,w");
    assert_eq!(Dialect::from_toml(&said.to_toml()).unwrap(), said);
    let mut table = open_said(text, &said).unwrap();
    let batch = rows(&mut table);
    for (i, expected) in [(1, ["1.9", "1.10", "10:05", "007"]), (2, ["on", "1", "off", "0"])] {
        let Cells::Words(places) = &batch.columns[i] else {
            panic!("no words")
        };
        let texts: Vec<&str> = places
            .iter()
            .map(|place| table.words(i)[place.unwrap() as usize].as_str())
            .collect();
        assert_eq!(texts, expected);
    }
    let said = Dialect {
        words: vec!["z".to_owned()],
        ..Dialect::default()
    };
    assert!(
        open_said(text, &said)
            .err()
            .unwrap()
            .to_string()
            .contains("no column `z`")
    );
}

#[test]
fn versions_and_addresses_are_words() {
    are_words("v", &["1.2.0", "1.2.1", "1.10.0"]);
    are_words("ip", &["10.0.0.1", "10.0.0.27"]);
    // Groups of three digits are numbers of another spelling.
    assert!(refusal(&mut column("x", &["1.234.567", "2.345.678"])).contains("is not a number"));
    assert!(refusal(&mut column("v", &["1.9", "1.10", "1.10.1", "1.11"])).contains("--words v"));
}

#[test]
fn numbers_with_one_unit_behind_each_are_no_words() {
    for cells in [
        ["1rpm", "2rpm", "3rpm", "4rpm"],
        ["50.25N", "51.25N", "52.25N", "53.25N"],
        ["0.5‰", "1‰", "2‰", "3‰"],
        ["0.5\"", "1.5\"", "2.5\"", "3.5\""],
    ] {
        let message = refusal(&mut column("x", &cells));
        assert!(message.contains("--strip-units"), "{message}");
    }
    are_words("seat", &["1A", "2A", "3A", "4A"]);
    are_words("R", &["4k7", "10k", "2M2", "470R", "1k"]);
    are_words("state", &["heat 1", "heat 2", "heat 3", "heat 4"]);
}

#[test]
fn a_ratio_is_no_time_of_day() {
    are_words("ratio", &["1:2", "1:3", "12:7"]);
    let mut table = open("time,x\n9:05,1\n9:06,2\n10:07,3\n");
    assert_eq!(seconds(&rows(&mut table)), [32_700.0, 32_760.0, 36_420.0]);
    let mut table = open("time,x\n9:5:3,1\n9:5:4,2\n");
    assert_eq!(seconds(&rows(&mut table)), [32_703.0, 32_704.0]);
}

#[test]
fn dashes_are_minus_and_formulas_are_their_values() {
    for dash in ['\u{2212}', '\u{2013}', '\u{2010}', '\u{2011}', '\u{ff0d}', '\u{fe63}'] {
        let cells = [format!("{dash}1.5"), "2.5".to_owned(), format!("{dash}3")];
        let cells: Vec<&str> = cells.iter().map(String::as_str).collect();
        are_numbers("x", &cells, &[-1.5, 2.5, -3.0]);
        are_numbers("x", &cells[..1], &[-1.5]);
    }
    are_numbers("x", &["=\"0.5\"", "=\"-2\""], &[0.5, -2.0]);
    are_words("x", &["=\"007\"", "=\"008\""]);
    for gap in ["\u{2013}", "\u{2014}"] {
        let found = numbers(&rows(&mut column("x", &["1.5", gap, "2.5"])).columns[1]);
        assert_eq!(found[..3], [Some(1.5), None, Some(2.5)]);
    }
}
