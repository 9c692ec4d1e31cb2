//! Files in the shape of what loggers, oscilloscopes and services write: names, units, times and values.

use super::{numbers, open, open_said, rows, seconds};
use fewbits_table::{Dialect, Table};
use std::io::Cursor;

/// Names with units, times and values of a column of a file that needs nothing said.
fn check(text: &str, names: &[&str], times: &[f64], column: usize, values: &[f64]) {
    let mut table = open(text);
    let shown: Vec<String> = table
        .columns()
        .iter()
        .map(|column| match column.unit.as_str() {
            "" => column.name.clone(),
            unit => format!("{} [{unit}]", column.name),
        })
        .collect();
    assert_eq!(shown, names, "{text}");
    let at = table.selected().iter().position(|i| *i == column).unwrap();
    let batch = rows(&mut table);
    assert_eq!(seconds(&batch), times, "{text}");
    let expected: Vec<Option<f64>> = values.iter().map(|value| Some(*value)).collect();
    assert_eq!(numbers(&batch.columns[at]), expected, "{text}");
}

#[test]
fn weather_services_and_stations() {
    let hours = [1_709_672_400.0, 1_709_676_000.0];
    check(
        "STATIONS_ID;MESS_DATUM;QN_9;TT_TU;eor\n         44;2024030521;    3;   7.5;eor\n         44;2024030522;    3;-999;eor\n",
        &["STATIONS_ID", "MESS_DATUM", "QN_9", "TT_TU", "eor"],
        &hours,
        3,
        &[7.5, -999.0],
    );
    check(
        "# SOURCE: AN INSTITUTE\n# notes, with commas\n# STN,YYYYMMDD,   TG\n#\n  260,20240305,   75\n  260,20240306,  -12\n",
        &["STN", "YYYYMMDD", "TG"],
        &[1_709_596_800.0, 1_709_683_200.0],
        2,
        &[75.0, -12.0],
    );
    check(
        "#YY  MM DD hh mm WDIR WSPD\n#yr  mo dy hr mn degT m/s\n2024 03 05 21 00  80  4.5\n2024 03 05 22 00  90  5.5\n",
        &[
            "YY [yr]",
            "MM [mo]",
            "DD [dy]",
            "hh [hr]",
            "mm [mn]",
            "WDIR [degT]",
            "WSPD [m/s]",
        ],
        &hours,
        6,
        &[4.5, 5.5],
    );
    check(
        "created_at,entry_id,field1,latitude\n2024-03-05 21:00:00 UTC,1,19.5,\n2024-03-05 22:00:00 UTC,2,20.25,\n",
        &["created_at", "entry_id", "field1", "latitude"],
        &hours,
        2,
        &[19.5, 20.25],
    );
    // Names above names: the lower line has those of the columns.
    let mut table = open_said(
        "\t\tTemp\tHi\n Date\tTime\tOut\tTemp\n05/03/24\t9:30p\t19.5\t20\n05/03/24\t10:30p\t20.25\t21\n",
        &Dialect {
            time_format: Some("dmy".to_owned()),
            ..Dialect::default()
        },
    )
    .unwrap();
    assert!(table.find_time().unwrap());
    assert_eq!(seconds(&rows(&mut table)), [1_709_674_200.0, 1_709_677_800.0]);
}

#[test]
fn oscilloscopes_and_laboratories() {
    check(
        "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-6.0e-03,2.0e-06\n0,1.5e+00,2.5e+00,,\n1,1.6e+00,2.6e+00,,\n",
        &[
            "X [Sequence]",
            "CH1 [Volt]",
            "CH2 [Volt]",
            "Start [-6.0e-03]",
            "Increment [2.0e-06]",
        ],
        &[],
        1,
        &[1.5, 1.6],
    );
    check(
        "x-axis,1,2\nsecond,Volt,Volt\n-2.0E-06,+1.5E+00,+2.5E+00\n+0.0E+00,+1.6E+00,+2.6E+00\n",
        &["x-axis [second]", "1 [Volt]", "2 [Volt]"],
        &[-2e-6, 0.0],
        1,
        &[1.5, 1.6],
    );
    let rows: String = (0..20).map(|i| format!("{i}.0,{i}.5\n")).collect();
    check(
        &format!(
            "Record Length,Analog:2\nVertical Units,Volt\nHorizontal Scale,1e-06\nSource,CH1\nSecond,Volt\n{rows}"
        ),
        &["Source [Second]", "CH1 [Volt]"],
        &(0..20).map(f64::from).collect::<Vec<_>>(),
        1,
        &(0..20).map(|i| f64::from(i) + 0.5).collect::<Vec<_>>(),
    );
    for (decimal, first) in [('.', "19.5"), (',', "19,5")] {
        let text = format!(
            "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t{decimal}\nDate\t2024/03/05\n***End_of_Header***\t\n\t\n\
             Channels\t2\t\t\nDelta_X\t1\t1\t\n***End_of_Header***\t\t\t\nX_Value\tA\tB\tComment\n0\t{first}\t1\n1\t{first}\t2\n"
        );
        check(&text, &["X_Value", "A", "B", "Comment"], &[0.0, 1.0], 1, &[19.5, 19.5]);
    }
    check(
        "time,flux,viscosity\nutc,µmol/m²/s,mPa.s\n2024-03-05T21:30:00,1.5,2\n2024-03-05T21:30:01,1.6,3\n",
        &["time [utc]", "flux [µmol/m²/s]", "viscosity [mPa.s]"],
        &[1_709_674_200.0, 1_709_674_201.0],
        1,
        &[1.5, 1.6],
    );
    check(
        "#,Date-Time (EST/EDT),\"Ch: 1 - Temperature   (°C)\"\n1,2024-03-05 21:30:00,19.5\n2,2024-03-05 21:30:01,20.25\n",
        &["#", "Date-Time (EST/EDT)", "Ch: 1 - Temperature   (°C)"],
        &[1_709_674_200.0, 1_709_674_201.0],
        2,
        &[19.5, 20.25],
    );
}

#[test]
fn numbers_of_other_places_and_programs() {
    check("time A\n0 19,5\n1 20,25\n2 21,0\n", &["time", "A"], &[0.0, 1.0, 2.0], 1, &[19.5, 20.25, 21.0]);
    check("time A\n0 1.95D+01\n1 2.5d-03\n", &["time", "A"], &[0.0, 1.0], 1, &[19.5, 0.0025]);
    // All kinds of spaces between groups of digits are one mark, and never words.
    for space in ['\u{a0}', '\u{202f}', '\u{2009}', ' '] {
        let text = format!("time;A\n0;1{space}000,5\n1;1{space}001,5\n");
        let mut table = open(&text);
        let message = super::refusal(&mut table);
        assert!(message.contains("--thousands ' ' --decimal ,"), "{message}");
        let said = Dialect {
            thousands: Some(space),
            decimal: Some(','),
            ..Dialect::default()
        };
        let mut table = open_said(&text, &said).unwrap();
        table.find_time().unwrap();
        assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(1000.5), Some(1001.5)]);
    }
    let mut table = open("time,A\n0,(19.5)\n1,(20.5)\n");
    assert!(super::refusal(&mut table).contains("brackets"));
}

#[test]
fn other_files_are_named() {
    for (bytes, word) in [
        (&b"<!DOCTYPE html>\n<html></html>\n"[..], "HTML"),
        (b"<?xml version=\"1.0\"?>\n<a/>\n", "XML"),
        (b"\xff\xfe\0\0t\0\0\0", "UTF-32"),
    ] {
        let message = match Table::open(Cursor::new(bytes.to_vec()), &Dialect::default()) {
            Ok(_) => panic!("{word} was read"),
            Err(error) => error.to_string(),
        };
        assert!(message.contains(word), "{message}");
    }
    // The option names the column.
    let many: String = (0..300).map(|i| format!("{i},text {i}\n")).collect();
    let mut table = open(&format!("time,\"a, b\"\n{many}"));
    assert!(super::refusal(&mut table).contains("--without '\"a, b\"'"));
    let mut table = open("time,x\n0,1\n1,2\n\0\0\0\x002,3\n3,4\n");
    assert!(super::refusal(&mut table).contains("NUL bytes"));
}
