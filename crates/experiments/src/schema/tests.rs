//! Rows become columns and cells.

use super::*;

rows! {
    struct Key {
        method: &'static str => "How.",
    }

    struct Row {
        key: Key,
        time: f64 ["s"] => "Time.",
        /// Squared error,
        /// in square metres.
        mse: Measured ["m^2"],
        other: Option<Measured> => "Of another.",
        printed: Option<f64> => "As printed.",
    }

    struct Two {
        rows: Vec<Row> => "Main.",
        run_times: Vec<Count> => "Counts.",
    }

    struct Count {
        n: u64 => "A count.",
    }
}

fn row(time: f64) -> Row {
    Row {
        key: Key { method: "lloyd" },
        time,
        mse: Measured::new(2.0, 0.5),
        other: None,
        printed: None,
    }
}

#[test]
fn the_fields_are_the_columns() {
    let table = Table::of(&vec![row(1.0)]).unwrap().remove(0);
    let cells = table.columns.iter().zip(&table.rows[0]);
    let cells: Vec<_> = cells.map(|(c, v)| format!("{}[{}]={v}", c.name, c.unit)).collect();
    let expected = [
        "method[]=lloyd",
        "time[s]=1",
        "mse[m^2]=2",
        "mse_se[m^2]=0.5",
        "other[]=",
        "other_se[]=",
        "printed[]=",
    ];
    assert_eq!(cells, expected);
    assert_eq!(table.columns[3].meaning, "Squared error, in square metres. (its standard error)");
}

#[test]
fn a_struct_of_lists_is_several_tables() {
    let two = Two {
        rows: Vec::new(),
        run_times: vec![Count { n: 3 }],
    };
    let tables = Table::of(&two).unwrap();
    assert_eq!((tables[0].rows.len(), tables[0].columns.len()), (0, 7));
    assert_eq!((tables[1].name.as_str(), tables[1].rows.len()), ("run-times", 1));
}

#[test]
fn a_cell_that_is_not_finite_is_refused_by_name() {
    for bad in [f64::NAN, f64::INFINITY] {
        let message = Table::of(&vec![row(1.0), row(bad)]).unwrap_err().to_string();
        assert!(message.contains("`time`, row 1"), "{message}");
    }
}

#[test]
fn answers_and_lists_are_words() {
    rows! {
        struct Words {
            best: [Answer; 2] => "Whether.",
            masks: List<u32> => "Several.",
        }
    }
    let words = Words {
        best: [Answer(true), Answer(false)],
        masks: List(vec![3, 4, 6]),
    };
    let table = Table::of(&vec![words]).unwrap().remove(0);
    let cells: Vec<String> = table.rows[0].iter().map(Value::to_string).collect();
    assert_eq!(cells, ["yes", "no", "3 4 6"]);
}

#[test]
fn arrays_are_columns_numbered_from_one() {
    rows! {
        struct Pair {
            f: [f64; 2] ["V"] => "Both.",
        }
    }
    let table = Table::of(&vec![Pair { f: [1.0, 2.0] }]).unwrap().remove(0);
    let names: Vec<_> = table.columns.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["f1", "f2"]);
}
