//! What separates cells, lines around the data, encodings.

use super::{numbers, open, open_said, rows, seconds};
use fewbits_table::{Dialect, Table};

/// Rows of a table with these lines in front: the values must be those of the plain table.
fn same_values(text: &str, columns: &[&[f64]]) {
    let mut table = open(text);
    let batch = rows(&mut table);
    assert_eq!(batch.columns.len(), columns.len(), "{text}: {:?}", table.columns());
    for (cells, expected) in batch.columns.iter().zip(columns) {
        let expected: Vec<Option<f64>> = expected.iter().map(|value| Some(*value)).collect();
        assert_eq!(numbers(cells), expected, "{text}");
    }
}

const TEMP: &[f64] = &[19.5, 20.25, 21.0, 20.75];

#[test]
fn delimiters_are_found() {
    for mark in [",", ";", "\t", "|", " , ", "   "] {
        let text = ["time,temp,rh", "0,19.5,40", "1,20.25,41", "2,21.0,40", "3,20.75,39"]
            .join("\n")
            .replace(',', mark);
        same_values(&text, &[TEMP, &[40.0, 41.0, 40.0, 39.0]]);
    }
    // Aligned by spaces, numbers at the right.
    same_values("   time    temp\n      0   19.50\n    100   20.25\n    200   21.00\n    300   20.75\n", &[TEMP]);
}

#[test]
fn loggers_are_known_by_their_first_lines() {
    let toa5 = "\"TOA5\",\"roof\",\"CR300\",\"77\",\"CR300.Std.10\",\"CPU:a.CR300\",\"991\",\"Ten\"\r\n\"TIMESTAMP\",\"RECORD\",\"T_Avg\"\r\n\
                \"TS\",\"RN\",\"Deg C\"\r\n\"\",\"\",\"Avg\"\r\n\"2023-11-14 22:13:20\",5,19.5\r\n\"2023-11-14 22:13:21\",6,\"NAN\"\r\n";
    let mut table = open(toa5);
    assert_eq!(table.dialect().format.as_deref(), Some("TOA5"));
    assert_eq!(table.columns()[2].unit, "Deg C");
    let batch = rows(&mut table);
    assert_eq!(seconds(&batch), [1_700_000_000.0, 1_700_000_001.0]);
    assert_eq!(numbers(&batch.columns[0]), [Some(5.0), Some(6.0)]);
    assert!(numbers(&batch.columns[1])[1].unwrap().is_nan());

    let hobo = "\u{feff}\"Plot Title: shed\"\r\n\"#\",\"Date Time, GMT-05:00\",\"Temp, °C (LGR S/N: 1)\",\"End Of File (LGR S/N: 1)\"\r\n\
                1,11/14/23 05:13:20 PM,19.5,\r\n2,11/14/23 05:23:20 PM,20.25,Logged\r\n";
    let mut table = open(hobo);
    let batch = rows(&mut table);
    assert_eq!(seconds(&batch), [1_700_000_000.0, 1_700_000_600.0]);
    assert_eq!(numbers(&batch.columns[1]), [Some(19.5), Some(20.25)]);
    assert_eq!(
        (table.columns()[2].name.as_str(), table.words(3)),
        ("Temp, °C (LGR S/N: 1)", ["Logged".to_owned()].as_slice())
    );

    let rdb = "# ---- notes ----\n# a \"quote that stays open\n#\nagency\tsite\tdatetime\ttz\tflow\n5s\t15s\t20d\t6s\t14n\n\
               XY\t01\t2023-11-14 22:13\tEST\t997.5\nXY\t01\t2023-11-14 22:28\tEST\t1002\n";
    let mut table = open(rdb);
    let batch = rows(&mut table);
    assert_eq!(seconds(&batch), [1_699_999_980.0, 1_700_000_880.0]);
    assert_eq!(numbers(&batch.columns[3]), [Some(997.5), Some(1002.0)]);

    let epw = "LOCATION,Town,ST,X,TMY3,1,39.7,-105.2,-7.0,1829.0\nDESIGN CONDITIONS,0\nDATA PERIODS,1,1,Data,Sunday,1/1,12/31\n\
               1996,1,1,1,60,?9,19.5\n1996,1,1,24,60,?9,20.25\n";
    let batch = rows(&mut open(epw));
    // The first hour of a day ends at one, the last at midnight.
    assert_eq!(seconds(&batch), [820_458_000.0, 820_540_800.0]);
    assert_eq!(numbers(&batch.columns[1]), [Some(19.5), Some(20.25)]);

    let annotated = "#group,false,false,true\n#datatype,string,long,double\n#default,_result,,\n,result,_time,_value\n\
                     ,,2023-11-14T22:13:20Z,19.5\n,,2023-11-14T22:13:21Z,20.25\n\n#group,false,false,true\n#datatype,string,long,double\n\
                     #default,_result,,\n,result,_time,_value\n,,2023-11-14T22:13:22Z,21\n";
    let mut table = open(annotated);
    let batch = rows(&mut table);
    assert_eq!(seconds(&batch), [1_700_000_000.0, 1_700_000_001.0, 1_700_000_002.0]);
    assert_eq!(numbers(&batch.columns[2]), [Some(19.5), Some(20.25), Some(21.0)]);
    assert_eq!(table.skipped().repeated, 1);
}

#[test]
fn lines_before_names_and_units_are_left_out() {
    let data = "0.0,19.5\n0.1,20.25\n0.2,21.0\n0.3,20.75\n";
    for before in [
        "time,volt\n",
        "time,volt\n(s),(V)\n",
        "second,Volt\n",
        "sep=,\ntime,volt\n",
        "Model,TX-9\nSample Interval,4e-9\nHorizontal Units,s\nTIME,CH1\n",
        "A title of many words\n\nRecord of the roof\ntime,volt\n",
        "# a\n#  b\ntime,volt\n",
        "# time,volt\n",
    ] {
        same_values(&format!("{before}{data}"), &[TEMP]);
    }
    let mut table = open("time,volt\ns,mV\n0,1.5\n1,2.5\n");
    assert_eq!(rows(&mut table).rows, 2);
    assert_eq!((table.columns()[0].unit.as_str(), table.columns()[1].unit.as_str()), ("s", "mV"));
    // Rows in the midst that are comments, the names again, or nothing.
    same_values("time,temp\n0,19.5\n# reboot\n1,20.25\n\ntime,temp\n2,21.0\n3,20.75\n", &[TEMP]);
}

#[test]
fn a_table_without_names_is_refused_or_said() {
    let text = "1325376600 69.75\n1325376900 70.25\n";
    let message = open_said(text, &Dialect::default()).err().unwrap().to_string();
    assert!(message.starts_with("line 1") && message.contains("--no-header"), "{message}");
    let said = Dialect {
        no_header: Some(true),
        ..Dialect::default()
    };
    let mut table = open_said(text, &said).unwrap();
    table.set_time(&["#1"]).unwrap();
    let batch = rows(&mut table);
    assert_eq!((seconds(&batch)[0], numbers(&batch.columns[0])), (1_325_376_600.0, vec![Some(69.75), Some(70.25)]));
    assert_eq!(table.columns()[1].name, "column_2");
}

#[test]
fn decimal_commas_and_groups() {
    let mut table = open("Zeit;Temp;Feuchte\n2023-11-14 22:13:20;19,75;40,2\n2023-11-14 22:23:20;-0,5;39,8\n");
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(19.75), Some(-0.5)]);
    // 1,721 may be either, so it is refused with both.
    let mut table = open("t;x\n0;1,721\n1;2,881\n2;4\n");
    let message = super::refusal(&mut table);
    assert!(
        message.contains("--decimal") && message.contains("line 2") && message.contains("`1,721`"),
        "{message}"
    );
    let said = Dialect {
        thousands: Some(','),
        ..Dialect::default()
    };
    let mut table = open_said("t;x\n0;1,721,992,142.283\n1;2,881\n2;4\n", &said).unwrap();
    table.find_time().unwrap();
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(1_721_992_142.283), Some(2881.0), Some(4.0)]);
}

#[test]
fn encodings_and_line_ends() {
    let text = "time,Temp °C\n0,19.5\n1,20.25\n2,21.0\n3,20.75\n";
    let utf16 = |big: bool| -> Vec<u8> {
        "\u{feff}"
            .encode_utf16()
            .chain(text.encode_utf16())
            .flat_map(|unit| if big { unit.to_be_bytes() } else { unit.to_le_bytes() })
            .collect()
    };
    let latin1: Vec<u8> = text.chars().map(|c| u32::from(c) as u8).collect();
    let said = Dialect {
        encoding: Some("latin1".to_owned()),
        ..Dialect::default()
    };
    for (bytes, said) in [
        (utf16(false), Dialect::default()),
        (utf16(true), Dialect::default()),
        (latin1.clone(), said),
    ] {
        let mut table = Table::open(std::io::Cursor::new(bytes), &said).unwrap();
        table.find_time().unwrap();
        assert_eq!(table.columns()[1].name, "Temp °C");
        assert_eq!(numbers(&rows(&mut table).columns[0]), TEMP.iter().map(|x| Some(*x)).collect::<Vec<_>>());
    }
    let message = Table::open(std::io::Cursor::new(latin1), &Dialect::default())
        .err()
        .unwrap()
        .to_string();
    assert!(message.contains("--encoding latin1"), "{message}");
    for end in ["\r\n", "\r", "\r\r\n"] {
        same_values(&text.replace('\n', end), &[TEMP]);
    }
    same_values("time,temp\r0,19.5\r\n1,20.25\n2,21.0\r3,20.75", &[TEMP]);
}

#[test]
fn other_files_are_named_with_the_mend() {
    for (bytes, word) in [
        (&b"PK\x03\x04...."[..], "Excel"),
        (b"SQLite format 3\0", "SQLite"),
        (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", "a picture (PNG)"),
        (b"\xff\xd8\xff\xe0\0\x10JFIF", "a picture (JPEG)"),
        (b"GIF89a\x01\0", "a picture (GIF)"),
        (b"%PDF-1.7\n%\xe2\xe3", "a PDF document"),
        (b"\0\0\0\0\0\0\0\0\n", "a binary file"),
        (b"BZh91AY", "bunzip2"),
        (b"\xfd7zXZ\0", "xz -dc"),
        (b"[{\"a\": 1}]", "jq"),
        (b"PAR1....", "Parquet"),
    ] {
        let message = Table::open(bytes, &Dialect::default()).err().unwrap().to_string();
        assert!(message.contains(word), "{message}");
    }
    assert!(Table::open(&b""[..], &Dialect::default()).is_err());
    assert!(Table::open(&b"\n\n"[..], &Dialect::default()).is_err());
}

#[cfg(feature = "gzip")]
#[test]
fn gzip_is_unpacked() {
    use std::io::Write;
    let mut packer = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    packer.write_all(b"time,temp\n0,19.5\n1,20.25\n").unwrap();
    let mut table = Table::open(std::io::Cursor::new(packer.finish().unwrap()), &Dialect::default()).unwrap();
    table.find_time().unwrap();
    assert_eq!(numbers(&rows(&mut table).columns[0]), [Some(19.5), Some(20.25)]);
}

#[test]
fn lines_of_json() {
    let text = "{\"Time\": \"2023-11-14T22:13:20\", \"S\": {\"T\": 20.5, \"ok\": true, \"p\": [1, 2]}}\n\
                {\"Time\": \"2023-11-14T22:13:21\", \"S\": {\"T\": null, \"ok\": false, \"p\": [3, 9007199254740993]}}\n";
    let mut table = open(text);
    let names: Vec<&str> = table.columns().iter().map(|column| column.name.as_str()).collect();
    assert_eq!(names, ["Time", "S.T", "S.ok", "S.p.0", "S.p.1"]);
    let batch = rows(&mut table);
    assert_eq!(seconds(&batch), [1_700_000_000.0, 1_700_000_001.0]);
    assert_eq!(numbers(&batch.columns[0]), [Some(20.5), None]);
    assert_eq!(numbers(&batch.columns[1]), [Some(1.0), Some(0.0)]);
    // The digits of a whole number of 64 bits are kept.
    assert_eq!(batch.columns[3].number(1), Err("9007199254740993".to_owned()));
}

#[test]
fn a_dialect_is_stored_and_said() {
    let table = open("sep=;\nDatum;Wert\n14.11.2023 22:13;1,5\n14.11.2023 22:14;2,5\n");
    let stored = table.dialect().to_toml();
    let again = Dialect::from_toml(&stored).unwrap();
    assert_eq!(&again, table.dialect());
    let mut same = open_said("sep=;\nDatum;Wert\n14.11.2023 22:13;3,5\n", &again).unwrap();
    let batch = rows(&mut same);
    assert_eq!((seconds(&batch), numbers(&batch.columns[0])), (vec![1_699_999_980.0], vec![Some(3.5)]));
    for (text, word) in [
        ("delimiter = 'ab'", "--delimiter"),
        ("decimal = ';'", "--decimal"),
        ("colour = 1", "colour"),
        ("time-zone = 'Mars'", "--time-zone"),
    ] {
        let message = Dialect::from_toml(text).unwrap_err().to_string();
        assert!(message.contains(word), "{message}");
    }
}
