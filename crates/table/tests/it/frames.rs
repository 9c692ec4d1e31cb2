//! Tables within frames, blocks, two tables in one file, and lines that hide their ends.

use crate::{numbers, open, open_said, refusal, rows, seconds};
use fewbits_table::{Dialect, Kind};

fn lines(header: &str, count: usize, row: impl Fn(usize) -> String) -> String {
    (0..count).fold(header.to_owned(), |text, i| text + &row(i) + "\n")
}

/// Asserts that a text is a table `time,x` of 0, 1, 2, ... and 0.5, 1.5, 2.5, ...
fn is_plain(text: &str) {
    let mut table = open(text);
    let names: Vec<&str> = table.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["time", "x"], "{text}");
    let batch = rows(&mut table);
    assert_eq!(seconds(&batch), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0], "{text}");
    let expected: Vec<Option<f64>> = (0..6).map(|i| Some(f64::from(i) + 0.5)).collect();
    assert_eq!(numbers(&batch.columns[0]), expected, "{text}");
}

fn not_opened(text: &str) -> String {
    match open_said(text, &Dialect::default()).and_then(|mut table| table.find_time()) {
        Err(error) => error.to_string(),
        Ok(_) => panic!("nothing was refused: {text}"),
    }
}

#[test]
fn markdown_and_other_bars_are_no_columns() {
    let body = lines("", 6, |i| format!("| {i} | {i}.5 |"));
    for rule in ["| --- | --- |", "|:---|---:|", "|------+-----|"] {
        is_plain(&format!("| time | x |\n{rule}\n{body}"));
        is_plain(&format!("# Results\n\nOf one day, and more.\n\n| **time** | `x` |\n{rule}\n{body}"));
    }
    let rule = "+------+-----+";
    is_plain(&format!("{rule}\n| time | x   |\n{rule}\n{body}{rule}\n6 rows in set (0.01 sec)\n"));
    is_plain(&format!("{rule}\n| time | x |\n+======+=====+\n{}", body.replace("5 |\n", "5 |\n+------+-----+\n")));
    let bare = format!("|time|x|\n{}", body.replace(' ', ""));
    for end in ["\n", "\r\n", "\r"] {
        is_plain(&bare.replace('\n', end));
        is_plain(bare.replace('\n', end).trim_end());
    }
}

#[test]
fn boxes_have_rules_and_types_of_columns() {
    let body = lines("", 6, |i| format!("│ {i} │ {i}.5 │"));
    is_plain(&format!("┌──┬──┐\n│ time │ x │\n├──┼──┤\n{body}└──┴──┘\n"));
    is_plain(&format!("┌──┬──┐\n│ time │  x  │\n│ int64 │ double │\n├──┼──┤\n{body}└──┴──┘\n"));
    let polars = body.replace(" │ ", " ┆ ");
    is_plain(&format!("┌──┬──┐\n│ time ┆ x │\n│ ---  ┆ --- │\n│ i64 ┆ f64 │\n╞══╪══╡\n{polars}└──┴──┘\n"));
}

#[test]
fn latex_has_commands_and_ends_of_rows() {
    let body = lines("", 6, |i| format!("{i} & ${i}.5$ \\\\"));
    is_plain(&format!("time & x \\\\\n{body}"));
    is_plain(&format!(
        "\\begin{{tabular}}{{lr}}\n\\toprule\ntime & x \\\\ \\midrule\n{body}\\bottomrule\n\\end{{tabular}}\n"
    ));
}

#[test]
fn lines_in_quotes_and_sequences_are_unwrapped() {
    is_plain(&lines("\"time,x\"\n", 6, |i| format!("\"{i},{i}.5\"")));
    is_plain(&lines("\"time,\"\"x\"\"\"\n", 6, |i| format!("\"{i},\"\"{i}.5\"\"\"")));
    is_plain(&lines("", 6, |i| format!("\u{1e}{{\"time\": {i}, \"x\": {i}.5}}")));
    // One column of texts stays one.
    let table = open(&lines("\"note\"\n", 4, |i| format!("\"seen at {i}, twice\"")));
    assert_eq!(table.columns().len(), 1);
}

#[test]
fn a_dialect_that_was_shown_reads_a_frame_again() {
    let text = lines("| time | x |\n|---|---|\n", 6, |i| format!("| {i} | {i}.5 |"));
    let said = open(&text).dialect().clone();
    let mut again = open_said(&text, &said).unwrap();
    assert_eq!(numbers(&rows(&mut again).columns[0]).len(), 6);
    assert_eq!(refusal(&mut open(&(text + "| 6 | x |\n"))).split(',').next(), Some("line 9 (row 7)"));
}

#[test]
fn blocks_of_curves_are_refused() {
    let block = |slope: usize| lines("", 4, |i| format!("{i} {}.5", slope * i));
    for comment in ["", "# x y\n"] {
        let mut table = open(&format!("x y\n{}\n\n{comment}{}", block(1), block(2)));
        assert!(refusal(&mut table).contains("a further block of rows begins here"));
    }
    // Blank lines between rows that go on are no blocks.
    let on = format!("x y\n{}\n\n4 4.5\n5 5.5\n", block(1));
    assert_eq!(rows(&mut open(&on)).rows, 6);
    let single = format!("x y\n{}\n{}", block(1), block(2));
    assert_eq!(rows(&mut open(&single)).rows, 8);
}

#[test]
fn two_tables_side_by_side_are_refused_if_their_times_differ() {
    let stamp = |i: usize| format!("2024-03-05 10:{i:02}:00");
    let of = |shift: usize| lines("time,x,,time,y\n", 5, |i| format!("{},{i},,{},{i}", stamp(i), stamp(i + shift)));
    let message = not_opened(&of(1));
    assert!(message.contains("side by side") && message.contains("cut -d, -f1-3"), "{message}");
    rows(&mut open(&of(0)));
    let titled = "Kitchen,,,Attic,\n".to_owned() + &of(7);
    assert!(not_opened(&titled).contains("side by side"));
    let labview = lines("X_Value\tA\tX_Value\tB\n", 5, |i| format!("{i}.0\t1\t{i}.5\t2"));
    assert!(not_opened(&labview).contains("side by side"));
}

#[test]
fn a_space_between_date_and_time_is_no_further_column() {
    for (header, front) in [("time x\n", false), ("                 time   x\n", true)] {
        let row = |i: usize| {
            format!("{}2024-03-05 10:{i:02}:00 {i}.5", if front { format!("{} ", i + 1) } else { String::new() })
        };
        let mut table = open(&lines(header, 6, row));
        let batch = rows(&mut table);
        assert_eq!(batch.times[5].seconds() - batch.times[0].seconds(), 300.0);
        let last = numbers(batch.columns.last().unwrap());
        assert_eq!(last[3], Some(3.5));
    }
}

#[test]
fn lines_that_hide_cells_are_refused() {
    for end in ['\u{85}', '\u{2028}'] {
        let text = lines("time,x\n", 5, |i| format!("{i},{i}.5")).replace('\n', &end.to_string());
        assert!(not_opened(&text).contains("lines end with U+0085"), "{end:?}");
    }
    assert!(
        not_opened(&lines("time,x\n", 5, |i| format!("{i},\u{1b}[32m{i}.5\u{1b}[0m")))
            .contains("colours of a terminal")
    );
    // A name that has one is a name.
    assert_eq!(
        open(&lines("time,\u{1b}[2Jx\n", 5, |i| format!("{i},{i}.5")))
            .columns()
            .len(),
        2
    );
    for mark in [':', '#', '/'] {
        let text = lines("id,a,b\n", 5, |i| format!("{i},{i}.5,{i}")).replace(',', &mark.to_string());
        assert!(not_opened(&text).contains(&format!("`{mark}` stands as often")), "{mark}");
    }
    assert!(not_opened("{\"hosts\": {\"all\": []}}\n").contains("JSON without a value"));
    let logged = lines("time,x\n", 5, |i| format!("2024-03-05 10:00:0{i},250,{i}.5"));
    let mut table = open_said(&logged, &Dialect::default()).unwrap();
    assert!(refusal(&mut table).contains("a comma behind seconds"));
}

#[test]
fn marks_that_were_not_tried_are_found() {
    for mark in ['~', '^'] {
        let text = lines("id,a,b\n", 5, |i| format!("{i},{i}.5,{i}")).replace(',', &mark.to_string());
        assert_eq!(open(&text).columns().len(), 3, "{mark}");
    }
    let text = lines("sep=\t\ntime\tx\n", 5, |i| format!("{i}\t{i}.5"));
    assert_eq!(open(&text).columns().len(), 2);
}

#[test]
fn units_stand_above_other_words_and_beside_dashes() {
    for (below, units) in [("s,-,°C\n", ["s", "-", "°C"]), ("s,V,°C\n,SN1,SN2\n", ["s", "V", "°C"])] {
        let table = open(&lines(&format!("time,n,T\n{below}"), 6, |i| format!("{i},{i}.5,2{i}")));
        let found: Vec<(&str, &str)> = table
            .columns()
            .iter()
            .map(|column| (column.name.as_str(), column.unit.as_str()))
            .collect();
        assert_eq!(found, [("time", units[0]), ("n", units[1]), ("T", units[2])]);
        assert!(table.columns().iter().all(|column| column.kind == Kind::Number));
    }
}

#[test]
fn late_rows_of_a_frame_are_seen_by_the_first_look() {
    // The order of day and month stands in the thirtieth row.
    let row = |i: usize| format!("| {:02}/04/2024 | {i} |", 1 + i % 30);
    let text = lines("| date | x |\n|---|---|\n", 40, row);
    let batch = rows(&mut open(&text));
    assert_eq!(batch.rows, 40);
    assert_eq!(batch.times[1].seconds() - batch.times[0].seconds(), 86_400.0);
}
