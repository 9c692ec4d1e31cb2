//! Random tables against the crate `csv` and the standard library's numbers.

use fewbits_table::{Batch, Cells, Dialect, Table};
use proptest::prelude::*;

fn cell() -> impl Strategy<Value = String> {
    prop_oneof![
        any::<f64>()
            .prop_filter("finite", |x| x.is_finite())
            // Digits of a large whole number are another number than the double.
            .prop_map(|x| if x.abs() < 9e15 {
                format!("{x}")
            } else {
                format!("{x:e}")
            }),
        any::<f64>()
            .prop_filter("finite", |x| x.is_finite())
            .prop_map(|x| format!("{x:e}")),
        (any::<i32>(), 0_usize..6).prop_map(|(x, places)| format!("{:.places$}", f64::from(x) / 1000.0)),
        Just(String::new()),
    ]
}

proptest! {
    #[test]
    fn numbers_are_those_of_the_standard_library(cells in proptest::collection::vec((cell(), cell()), 1..60)) {
        let mut text = "a,b\n0.5,0.5\n".to_owned();
        for (a, b) in &cells {
            text += &format!("{a},{b}\n");
        }
        let mut table = Table::open(std::io::Cursor::new(text), &Dialect::default()).unwrap();
        let mut batch = Batch::default();
        table.read(&mut batch, usize::MAX).unwrap();
        prop_assert_eq!(batch.rows, cells.len() + 1);
        for (i, column) in batch.columns.iter().enumerate() {
            let Cells::Numbers(numbers) = column else { panic!("{column:?}") };
            for (row, pair) in cells.iter().enumerate() {
                let expected = [&pair.0, &pair.1][i].parse::<f64>().ok().map(f64::to_bits);
                prop_assert_eq!(numbers[row + 1].map(f64::to_bits), expected);
            }
        }
    }

    #[test]
    fn quoted_cells_are_those_of_the_crate_csv(cells in proptest::collection::vec(("[ a,\"\n;x]{0,6}", "[a-c]{1,2}"), 1..20)) {
        let mut writer = csv::WriterBuilder::new().quote_style(csv::QuoteStyle::Always).from_writer(Vec::new());
        writer.write_record(["name", "other"]).unwrap();
        for (a, b) in &cells {
            writer.write_record([a, b]).unwrap();
        }
        let text = writer.into_inner().unwrap();
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(text.as_slice());
        let expected: Vec<String> = reader.records().map(|record| record.unwrap()[0].trim_matches([' ', '\t']).to_owned()).collect();
        let said = Dialect { delimiter: Some(",".to_owned()), skip: Some(0), comment: Some(String::new()), quote: Some('"'), ..Dialect::default() };
        let mut table = Table::open(std::io::Cursor::new(text), &said).unwrap();
        let mut batch = Batch::default();
        table.read(&mut batch, usize::MAX).unwrap();
        table.set_label("name").unwrap();
        prop_assert_eq!(batch.rows, expected.len());
        if let Cells::Words(indices) = &batch.columns[0] {
            for (index, expected) in indices.iter().zip(&expected) {
                let found = index.map(|index| table.words(0)[index as usize].clone()).unwrap_or_default();
                prop_assert_eq!(found.trim(), expected.trim());
            }
        }
    }

    #[test]
    fn any_bytes_are_a_table_or_an_error(bytes in proptest::collection::vec(any::<u8>(), 0..400)) {
        if let Ok(mut table) = Table::open(std::io::Cursor::new(bytes), &Dialect::default()) {
            let _ = table.find_time();
            let mut batch = Batch::default();
            for _ in 0..50 {
                if matches!(table.read(&mut batch, 7), Ok(0)) {
                    break;
                }
            }
        }
    }

    #[test]
    fn any_text_of_a_table_is_rows_or_errors(text in "([0-9.,;\"\n\r#: a-zTZ+-]|\t){0,300}") {
        if let Ok(mut table) = Table::open(std::io::Cursor::new(text), &Dialect::default()) {
            let _ = table.find_time();
            let mut batch = Batch::default();
            for _ in 0..400 {
                if matches!(table.read(&mut batch, 7), Ok(0)) {
                    return Ok(());
                }
            }
            prop_assert!(false, "reading does not end");
        }
    }
}
